//! Lines on a face in whole numbers.
//!
//! The ends of a stored line are multiples of 1/4096 on the border of the face, and so are the centres of texels: which
//! side a texel is on is decided exactly, in the same way on every machine.

use akari_visibility::face::{LINE_STEPS_PER_UNIT, PackedLine};

/// Steps around the border of the face.
pub(crate) const BORDER_STEPS: u32 = 4 * SIDE;
/// Steps from the centre of the face to its border.
pub(crate) const UNIT_STEPS: u32 = LINE_STEPS_PER_UNIT;
const UNIT: i32 = UNIT_STEPS as i32;
const SIDE: u32 = 2 * UNIT_STEPS;

/// The line `A x + B y + C = 0` with x and y in steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct IntLine {
    ends: [u32; 2],
    a: i32,
    b: i32,
    c: i32,
}

/// The point at a coordinate along the border, counter-clockwise from (−1, −1), in steps.
fn border_point(at: u32) -> [i32; 2] {
    let along = (at % SIDE) as i32;
    match at / SIDE {
        0 => [along - UNIT, -UNIT],
        1 => [UNIT, along - UNIT],
        2 => [UNIT - along, UNIT],
        _ => [-UNIT, UNIT - along],
    }
}

/// The coordinate along the border of a point on it, in units.
fn border_coordinate(x: f64, y: f64) -> f64 {
    // The nearest side.
    let d = [y + 1.0, 1.0 - x, 1.0 - y, x + 1.0].map(f64::abs);
    let side = (0..4).min_by(|&i, &j| d[i].total_cmp(&d[j])).unwrap_or(0);
    let along = [x, y, -x, -y][side].clamp(-1.0, 1.0) + 1.0;
    2.0 * side as f64 + along
}

impl IntLine {
    /// None if both ends are on the same side of the square: it splits nothing.
    pub(crate) fn new(ends: [u32; 2]) -> Option<Self> {
        let [[px, py], [qx, qy]] = ends.map(border_point);
        let (dx, dy) = (qx - px, qy - py);
        let along_border = (px == qx && px.abs() == UNIT) || (py == qy && py.abs() == UNIT);
        if along_border {
            return None;
        }
        // Left of the way from P to Q is positive.
        Some(Self {
            ends,
            a: -dy,
            b: dx,
            c: dy * px - dx * py,
        })
    }

    /// The ends nearest to those of the line with normal `(cos angle, sin angle)` at `offset` (units).
    pub(crate) fn ends_of(angle: f64, offset: f64) -> Option<[u32; 2]> {
        let (sin, cos) = angle.sin_cos();
        // A point of the line and its direction with the positive side to the left.
        let (x, y) = (offset * cos, offset * sin);
        let (dx, dy) = (sin, -cos);
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for (p, d) in [(x, dx), (y, dy)] {
            if d.abs() < 1e-12 {
                if p.abs() >= 1.0 {
                    return None;
                }
                continue;
            }
            let (s, t) = ((-1.0 - p) / d, (1.0 - p) / d);
            enter = enter.max(s.min(t));
            leave = leave.min(s.max(t));
        }
        if !(enter < leave) {
            return None;
        }
        let step = |t: f64| {
            let at = border_coordinate(x + t * dx, y + t * dy) * f64::from(LINE_STEPS_PER_UNIT);
            (at.round() as u32) % BORDER_STEPS
        };
        Some([step(enter), step(leave)])
    }

    pub(crate) fn packed(&self) -> Option<PackedLine> {
        PackedLine::new(self.ends[0], self.ends[1])
    }

    pub(crate) fn ends(&self) -> [u32; 2] {
        self.ends
    }

    /// Whether the centre of a texel is on the positive side.
    #[cfg(test)]
    pub(crate) fn is_positive(&self, x: u32, y: u32, size: u32) -> bool {
        let center = |i: u32| (2 * i as i32 + 1) * (UNIT / size as i32) - UNIT;
        self.a * center(x) + self.b * center(y) + self.c > 0
    }

    /// Where the line crosses the rows of a face.
    pub(crate) fn crossings(&self, size: u32) -> RowCrossings {
        let unit = f64::from(UNIT);
        // Between whole numbers, so that no centre is on the line.
        RowCrossings::new(
            f64::from(self.a) * unit,
            f64::from(self.b) * unit,
            f64::from(self.c) - 0.5,
            size,
        )
    }
}

/// The crossings of a line with the rows of texels: linear in the row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowCrossings {
    start: f64,
    slope: f64,
    /// The negative side is at the low columns.
    pub(crate) negative_low: bool,
}

/// Added to a number of small size, leaves its nearest whole number in the low bits (2^52 + 2^51).
const ROUND: f64 = 6_755_399_441_055_744.0;

impl RowCrossings {
    /// Of the line `a x + b y + c = 0`, in units of the face.
    #[inline(always)]
    pub(crate) fn new(a: f64, b: f64, c: f64, size: u32) -> Self {
        /// Stands for a = 0: as steep as it takes that a row is on one side.
        const FLAT: f64 = 1e-9;
        let a = if a == 0.0 { FLAT * b.abs() } else { a };
        let n = f64::from(size);
        // Row j is at y = (2 j + 1)/n − 1; the column of x is (x + 1) n/2 − ½, and the first one beyond x is half more,
        // rounded down: that is the nearest to (x + 1) n/2.
        let slope = -b / a;
        let x0 = -c / a + slope * (1.0 / n - 1.0);
        Self {
            start: (x0 + 1.0) * (0.5 * n),
            slope,
            negative_low: a > 0.0,
        }
    }

    /// Where the crossing of row `y` is, in columns.
    #[inline(always)]
    pub(crate) fn at(&self, y: f64) -> f64 {
        self.start + y * self.slope
    }

    /// How many columns are below a crossing, clamped to `low..=high`.
    #[inline(always)]
    pub(crate) fn column_of(t: f64, low: f64, high: f64) -> u32 {
        // Not `clamp`, `max` and `min`, which look for NaN: this is the innermost loop of the bake.
        let t = if t > low { t } else { low };
        let t = if t < high { t } else { high };
        (t + ROUND).to_bits() as u32
    }

    /// How many columns of a row are below the crossing, clamped to `low..=high`.
    #[inline(always)]
    pub(crate) fn column(&self, y: f64, low: f64, high: f64) -> u32 {
        Self::column_of(self.at(y), low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ends at random, some of them at corners and centres of texels.
    fn lines(size: u32) -> impl Iterator<Item = IntLine> {
        let mut state = 1_u64;
        let mut next = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as u32
        };
        (0..600).filter_map(move |k| {
            let coarse = [1, UNIT_STEPS / size, 2 * UNIT_STEPS / size, SIDE][k % 4];
            let mut end = || next() % BORDER_STEPS / coarse * coarse;
            IntLine::new([end(), end()])
        })
    }

    #[test]
    fn crossings_are_exact() {
        for size in [32, 64, 256] {
            for line in lines(size) {
                let crossings = line.crossings(size);
                for y in 0..size {
                    let c = crossings.column(f64::from(y), 0.0, f64::from(size));
                    for x in 0..size {
                        let positive = (x >= c) == crossings.negative_low;
                        assert_eq!(
                            positive,
                            line.is_positive(x, y, size),
                            "{line:?} at {x}, {y} of {size}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn the_stored_line_has_the_same_sides() {
        const SIZE: u32 = 64;
        let mut on_line = 0;
        for line in lines(SIZE) {
            let stored = line.packed().unwrap().line();
            for y in 0..SIZE {
                for x in 0..SIZE {
                    let centre = |i: u32| (2 * i + 1) as f32 / SIZE as f32 - 1.0;
                    let side = stored.evaluate(glam::Vec2::new(centre(x), centre(y)));
                    // The stored coefficients are rounded to f32.
                    if side.abs() < 1e-6 {
                        on_line += 1;
                        continue;
                    }
                    assert_eq!(side > 0.0, line.is_positive(x, y, SIZE), "{line:?} {x} {y}");
                }
            }
        }
        assert!(on_line > 0, "lines through centres are among them");
    }

    #[test]
    fn ends_of_angles() {
        for k in 0..64 {
            let angle = f64::from(k) * 0.1;
            for offset in [-1.2, -0.5, 0.0, 0.3, 1.1] {
                let Some(line) = IntLine::ends_of(angle, offset).and_then(IntLine::new) else {
                    assert!(f64::abs(offset) > 0.99);
                    continue;
                };
                for (x, y) in [(10, 50), (32, 32), (60, 3)] {
                    let centre = |i: u32| f64::from(2 * i + 1) / 64.0 - 1.0;
                    let side = centre(x) * angle.cos() + centre(y) * angle.sin() - offset;
                    if side.abs() > 1e-3 {
                        assert_eq!(side > 0.0, line.is_positive(x, y, 64), "{angle} {offset}");
                    }
                }
            }
        }
        // Both ends on one side, and beyond the face.
        assert_eq!(IntLine::new([5, 8000]), None);
        assert_eq!(IntLine::new([0, SIDE]), None);
        assert_eq!(IntLine::ends_of(0.0, 1.5), None);
    }
}
