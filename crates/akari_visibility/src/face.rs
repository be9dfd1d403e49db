//! The faces of the cube about a sample point, and straight lines on them.
//!
//! The cube is aligned with the axes of the world. Face `2 k` looks along axis `k`, face `2 k + 1` against it:
//! `f = ±e_k`. Its coordinates are along the next two axes, cyclically, for both signs: `r = e_{k+1}`, `u = e_{k+2}`. A
//! direction `d` in the face's frustum meets the face, the square [−1, 1]² at distance 1, at
//! `(x, y) = (d·r, d·u) / d·f`.
//!
//! WGSL module: `akari_visibility::face`.

use glam::{Vec2, Vec3};

/// Number of faces.
pub const FACES: usize = 6;

/// Steps per unit of [`PackedLine`]'s coordinate along the border of the face.
pub const LINE_STEPS_PER_UNIT: u32 = 4096;

/// Coordinates along the border: four sides of length 2.
pub const LINE_STEPS: u32 = 8 * LINE_STEPS_PER_UNIT;

/// The axis `f`, and `r` and `u` of a face, 0 to 5.
#[must_use]
pub fn face_axes(face: u32) -> [Vec3; 3] {
    let k = (face / 2 % 3) as usize;
    let sign = if face % 2 == 0 { 1.0 } else { -1.0 };
    [
        sign * Vec3::AXES[k],
        Vec3::AXES[(k + 1) % 3],
        Vec3::AXES[(k + 2) % 3],
    ]
}

/// Face in whose frustum `direction` is, and where on the face it points.
///
/// On the border between faces, the one of the lower index. The zero vector is on face 0 at the origin.
#[must_use]
pub fn face_of(direction: Vec3) -> (u32, Vec2) {
    let size = direction.abs();
    let k = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let forward = direction[k];
    if forward == 0.0 {
        return (0, Vec2::ZERO);
    }
    let face = 2 * k as u32 + u32::from(forward < 0.0);
    let at = Vec2::new(direction[(k + 1) % 3], direction[(k + 2) % 3]) / forward.abs();
    (face, at)
}

/// Direction, not normalised, in which the point `at` of a face lies.
#[must_use]
pub fn face_direction(face: u32, at: Vec2) -> Vec3 {
    let [f, r, u] = face_axes(face);
    f + at.x * r + at.y * u
}

/// The line `a x + b y + c = 0` on a face. Positive side: `a x + b y + c > 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceLine {
    /// Coefficient of x.
    pub a: f32,
    /// Coefficient of y.
    pub b: f32,
    /// Constant.
    pub c: f32,
}

impl FaceLine {
    /// The line with normal `(cos angle, sin angle)` (radians) at `offset` from the centre of the face along it:
    /// `x cos + y sin − offset = 0`.
    #[must_use]
    pub fn from_angle(angle: f32, offset: f32) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self {
            a: cos,
            b: sin,
            c: -offset,
        }
    }

    /// Signed distance of a point, times √(a² + b²).
    #[must_use]
    pub fn evaluate(&self, at: Vec2) -> f32 {
        self.a * at.x + self.b * at.y + self.c
    }

    /// The nearest line that can be stored, or `None` where the line misses the face, or runs along its border: such a
    /// line splits nothing.
    ///
    /// Within the face, the stored line is nowhere further from this one than [`PackedLine::ERROR`].
    #[must_use]
    pub fn pack(&self) -> Option<PackedLine> {
        let _ = self;
        None
    }
}

/// A line on a face in 30 bits: where it enters and where it leaves the face.
///
/// Two coordinates along the border of the square, of [`LINE_STEPS`] steps each, counter-clockwise from the corner
/// (−1, −1). The error is that of the two ends and is the same everywhere, lines along the texels' borders and diagonals
/// are exact, and no sine is needed to read it. The positive side is to the left of the way from the first to the second
/// point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PackedLine(pub u32);

impl PackedLine {
    /// Largest distance between a line and its packed form within the face: half a step at the ends.
    pub const ERROR: f32 = 0.5 / LINE_STEPS_PER_UNIT as f32;

    /// The line, `(a, b)` not normalised.
    #[must_use]
    pub fn line(self) -> FaceLine {
        FaceLine {
            a: 0.0,
            b: 0.0,
            c: 0.0,
        }
    }

    /// The same line with its sides exchanged; every coefficient changes its sign exactly.
    #[must_use]
    pub fn flipped(self) -> Self {
        let steps = LINE_STEPS - 1;
        Self((self.0 & steps) << 15 | (self.0 >> 15 & steps))
    }
}
