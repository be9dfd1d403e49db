//! The six faces of a cube about a sample.

use std::ops::Neg;

/// An axis of a face as a signed axis of the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    index: usize,
    negative: bool,
}

/// Right, up and forward of a face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Basis([Axis; 3]);

const fn axis(index: usize, negative: bool) -> Axis {
    Axis { index, negative }
}

/// +X, −X, +Y, −Y, +Z, −Z.
pub(crate) const FACES: [Basis; 6] = [
    Basis([axis(1, false), axis(2, false), axis(0, false)]),
    Basis([axis(1, false), axis(2, false), axis(0, true)]),
    Basis([axis(2, false), axis(0, false), axis(1, false)]),
    Basis([axis(2, false), axis(0, false), axis(1, true)]),
    Basis([axis(0, false), axis(1, false), axis(2, false)]),
    Basis([axis(0, false), axis(1, false), axis(2, true)]),
];

impl Basis {
    /// Components of a world vector along right, up and forward.
    #[inline(always)]
    pub(crate) fn to_face(self, v: [f64; 3]) -> [f64; 3] {
        self.0.map(|a| {
            let x = v[a.index];
            if a.negative { -x } else { x }
        })
    }

    /// The same for the corners of a box.
    #[inline(always)]
    pub(crate) fn box_to_face<T: Copy + Neg<Output = T>>(
        self,
        lo: [T; 3],
        hi: [T; 3],
    ) -> ([T; 3], [T; 3]) {
        let low = self.0.map(|a| {
            if a.negative {
                -hi[a.index]
            } else {
                lo[a.index]
            }
        });
        let high = self.0.map(|a| {
            if a.negative {
                -lo[a.index]
            } else {
                hi[a.index]
            }
        });
        (low, high)
    }

    /// The world direction `a·right + b·up + forward`.
    #[inline(always)]
    pub(crate) fn direction(self, a: f64, b: f64) -> [f64; 3] {
        let mut d = [0.0; 3];
        for (axis, x) in self.0.iter().zip([a, b, 1.0]) {
            d[axis.index] = if axis.negative { -x } else { x };
        }
        d
    }
}
