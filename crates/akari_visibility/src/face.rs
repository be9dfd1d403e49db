//! The faces of the cube about a sample point, and straight lines on them.
//!
//! The cube is turned against the axes of the world ([`cube_from_world`]), because what people build is aligned with
//! them: an edge along a row of texels is off by up to half a texel over its whole length, while one that crosses the
//! rows is found to a fraction of that. Measured on slats over a floor: the shadow of a light 28° wide from faces of 64
//! texels is off by 2.4 % with an aligned cube, by far less with a turned one (`benches/area_shadows`).
//!
//! All else here is in the axes of the cube. Face `2 k` looks along axis `k`, face `2 k + 1` against it:
//! `f = ±e_k`. Its coordinates are along the next two axes, cyclically, for both signs: `r = e_{k+1}`, `u = e_{k+2}`. A
//! direction `d` in the face's frustum meets the face, the square [−1, 1]² at distance 1, at
//! `(x, y) = (d·r, d·u) / d·f`.
//!
//! A line `a x + b y + c = 0` on a face is the plane through the sample point with the normal `a r + b u + c f`: what is
//! clipped by it need not be projected.
//!
//! WGSL module: `akari_visibility::face`.

use glam::{DVec3, Vec2, Vec3};

/// Number of faces.
pub const FACES: usize = 6;

/// Steps per unit of [`PackedLine`]'s coordinate along the border of the face.
pub const LINE_STEPS_PER_UNIT: u32 = 4096;

/// Bits of one such coordinate: the border consists of four sides of length 2.
pub const LINE_STEP_BITS: u32 = 15;

const LINE_STEP_MASK: u32 = (1 << LINE_STEP_BITS) - 1;
/// Steps along one side.
const SIDE_STEPS: u32 = 2 * LINE_STEPS_PER_UNIT;
const SIDE_STEP_BITS: u32 = LINE_STEP_BITS - 2;
const _: () = assert!(1 << SIDE_STEP_BITS == SIDE_STEPS);
const SQRT_HALF: f32 = 0.70710678;

/// A point of a face.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FacePoint {
    /// Place on the face, [−1, 1]².
    pub at: Vec2,
    /// The face, 0 to 5.
    pub face: u32,
}

/// Axes of the cube in the world, times 49. The quaternion (5, 3, 0, 8) gives whole numbers, none of which is near 0 or
/// another one of its axis.
const CUBE_X: Vec3 = Vec3::new(-15.0, 40.0, 24.0);
const CUBE_Y: Vec3 = Vec3::new(-40.0, -24.0, 15.0);
const CUBE_Z: Vec3 = Vec3::new(24.0, -15.0, 40.0);
const CUBE_SCALE: f32 = 1.0 / 49.0;

/// A vector along the axes of the world, along those of the cube. Lengths stay, within 2 ULP.
#[must_use]
pub fn cube_from_world(v: Vec3) -> Vec3 {
    CUBE_SCALE * Vec3::new(v.dot(CUBE_X), v.dot(CUBE_Y), v.dot(CUBE_Z))
}

/// The inverse of [`cube_from_world`].
#[must_use]
pub fn world_from_cube(v: Vec3) -> Vec3 {
    CUBE_SCALE * (v.x * CUBE_X + v.y * CUBE_Y + v.z * CUBE_Z)
}

/// [`cube_from_world`] in double precision. CPU only.
#[must_use]
pub fn cube_from_world_f64(v: DVec3) -> DVec3 {
    let axes = [CUBE_X, CUBE_Y, CUBE_Z].map(|axis| axis.as_dvec3());
    DVec3::from_array(axes.map(|axis| v.dot(axis) / 49.0))
}

/// [`world_from_cube`] in double precision. CPU only.
#[must_use]
pub fn world_from_cube_f64(v: DVec3) -> DVec3 {
    let [x, y, z] = [CUBE_X, CUBE_Y, CUBE_Z].map(|axis| axis.as_dvec3());
    (v.x * x + v.y * y + v.z * z) / 49.0
}

/// A vector of the cube from its parts along `r`, `u` and the **positive** axis of the face: a cyclic permutation, for
/// which the sign of the face does not matter.
#[must_use]
pub fn face_permute(face: u32, v: Vec3) -> Vec3 {
    let axis = face >> 1;
    if axis == 0 {
        return Vec3::new(v.z, v.x, v.y);
    }
    if axis == 1 {
        return Vec3::new(v.y, v.z, v.x);
    }
    v
}

/// 1 for the faces along a positive axis, −1 for the others.
#[must_use]
pub fn face_sign(face: u32) -> f32 {
    if face & 1 == 1 { -1.0 } else { 1.0 }
}

/// Direction, not normalised, in which the point `at` of a face lies: `f + x r + y u`.
#[must_use]
pub fn face_direction(face: u32, at: Vec2) -> Vec3 {
    face_permute(face, Vec3::new(at.x, at.y, face_sign(face)))
}

/// The axes `r`, `u`, `f` of a face, 0 to 5. CPU only.
#[must_use]
pub fn face_axes(face: u32) -> [Vec3; 3] {
    [
        face_permute(face, Vec3::X),
        face_permute(face, Vec3::Y),
        face_permute(face, Vec3::Z * face_sign(face)),
    ]
}

/// Face in whose frustum `direction` (any length) is, and where on the face it points.
///
/// On the border between faces, the one of the lower index. The zero vector is at the centre of face 0. Error of the
/// place: 1 ULP, one division.
#[must_use]
pub fn face_of(direction: Vec3) -> FacePoint {
    let size = direction.abs();
    let mut axis = 2;
    if size.y >= size.z {
        axis = 1;
    }
    if size.x >= size.y && size.x >= size.z {
        axis = 0;
    }
    // Undoes `face_permute`: the permutation of the other cyclic sense.
    let mut local = direction;
    if axis == 0 {
        local = Vec3::new(direction.y, direction.z, direction.x);
    } else if axis == 1 {
        local = Vec3::new(direction.z, direction.x, direction.y);
    }
    if local.z == 0.0 {
        return FacePoint {
            at: Vec2::ZERO,
            face: 0,
        };
    }
    let depth = local.z.abs();
    FacePoint {
        at: Vec2::new(local.x / depth, local.y / depth),
        face: 2 * axis + u32::from(local.z < 0.0),
    }
}

/// Unit normal, pointing inwards, of the plane through the sample point and the side 0 to 3 of a face: at x = 1, −1,
/// y = 1, −1.
///
/// The plane between two faces has, from either of them, components of the same absolute value: a polygon that is cut
/// there has the same distances on both sides, and so the same cuts.
#[must_use]
pub fn face_side(face: u32, side: u32) -> Vec3 {
    let outwards = if side & 1 == 1 { SQRT_HALF } else { -SQRT_HALF };
    let depth = face_sign(face) * SQRT_HALF;
    if side < 2 {
        return face_permute(face, Vec3::new(outwards, 0.0, depth));
    }
    face_permute(face, Vec3::new(0.0, outwards, depth))
}

/// A vector that is nearly in the plane of a side, put exactly there: its part across the side becomes plus or minus its
/// part along the axis of the face.
///
/// All faces that meet at a side or a corner then agree exactly on its direction. Without that, cuts of a light that is
/// large against its distance would lie off the side by the rounding of the light's extent, not of their own length.
/// Where opposite sides meet, on the axis across which they lie, both parts are nothing but rounding: they become 0.
#[must_use]
pub fn face_onto_side(face: u32, side: u32, v: Vec3) -> Vec3 {
    let forward = face_permute(face, Vec3::Z);
    let lateral = face_permute(face, if side < 2 { Vec3::X } else { Vec3::Y });
    let depth = face_sign(face) * v.dot(forward);
    let across = if side & 1 == 1 { -depth } else { depth };
    if (v.dot(lateral) - across).abs() > 0.25 * depth.abs() {
        return Vec3::select((forward + lateral).cmpgt(Vec3::splat(0.5)), Vec3::ZERO, v);
    }
    Vec3::select(lateral.cmpgt(Vec3::splat(0.5)), Vec3::splat(across), v)
}

/// Point of the border of a face at a coordinate of [`PackedLine`]: counter-clockwise from (−1, −1). Exact.
#[must_use]
pub fn border_point(steps: u32) -> Vec2 {
    let side = (steps >> SIDE_STEP_BITS) & 3;
    let t = (steps & (SIDE_STEPS - 1)) as f32 / LINE_STEPS_PER_UNIT as f32 - 1.0;
    // The third and the fourth side lie opposite of the first and the second.
    let sign = 1.0 - (side & 2) as f32;
    if side & 1 == 0 {
        return Vec2::new(sign * t, -sign);
    }
    Vec2::new(sign, sign * t)
}

/// Coefficients `(a, b, c)` of a packed line, not normalised.
///
/// `a` and `b` are exact; `c` is rounded once, with or without fused operations, since the products are exact. The line
/// with exchanged ends has exactly the opposite coefficients.
#[must_use]
pub fn unpack_line(bits: u32) -> Vec3 {
    let p = border_point(bits & LINE_STEP_MASK);
    let q = border_point((bits >> LINE_STEP_BITS) & LINE_STEP_MASK);
    Vec3::new(p.y - q.y, q.x - p.x, p.x * q.y - q.x * p.y)
}

/// `a x + b y + c` at a point of the face: positive on the positive side of a packed line.
#[must_use]
pub fn line_height(bits: u32, at: Vec2) -> f32 {
    let line = unpack_line(bits);
    line.x * at.x + line.y * at.y + line.z
}

/// Normal of the plane through the sample point and a packed line of a face, towards the line's positive side:
/// `a r + b u + c f`.
///
/// Of any length from 3e-4 to 4: what is compared with distances is scaled instead. Zero where the bits are no line. `a`
/// and `b` exact, `c` rounded once.
#[must_use]
pub fn line_normal(face: u32, bits: u32) -> Vec3 {
    let line = unpack_line(bits);
    face_permute(face, Vec3::new(line.x, line.y, face_sign(face) * line.z))
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

    /// The nearest line that can be stored, or `None` where the line misses the face or runs along its border, so that
    /// it splits nothing, or where a coefficient is not finite.
    ///
    /// Within the face, the stored line is nowhere further from this one than [`PackedLine::ERROR`].
    #[must_use]
    pub fn pack(&self) -> Option<PackedLine> {
        let (a, b, c) = (f64::from(self.a), f64::from(self.b), f64::from(self.c));
        let length_squared = a * a + b * b;
        if !(length_squared.is_finite() && c.is_finite()) || length_squared == 0.0 {
            return None;
        }
        // The way along the line with the positive side to its left, clipped to the square (Liang and Barsky 1984).
        let (dx, dy) = (b, -a);
        let (x0, y0) = (-c * a / length_squared, -c * b / length_squared);
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for (start, along) in [(x0, dx), (y0, dy)] {
            if along == 0.0 {
                if start.abs() >= 1.0 {
                    return None;
                }
                continue;
            }
            let (low, high) = ((-1.0 - start) / along, (1.0 - start) / along);
            enter = enter.max(low.min(high));
            leave = leave.min(low.max(high));
        }
        if enter >= leave {
            return None;
        }
        let border = |t: f64| border_step(x0 + t * dx, y0 + t * dy);
        PackedLine::new(border(enter), border(leave))
    }
}

/// The step nearest to a point of the border.
fn border_step(x: f64, y: f64) -> u32 {
    let (side, t) = if y.abs() >= x.abs() {
        if y < 0.0 { (0, x) } else { (2, -x) }
    } else if x > 0.0 {
        (1, y)
    } else {
        (3, -y)
    };
    let along = ((t.clamp(-1.0, 1.0) + 1.0) * f64::from(LINE_STEPS_PER_UNIT)).round() as u32;
    (side * SIDE_STEPS + along) & LINE_STEP_MASK
}

/// A line on a face in 30 bits: where it enters and where it leaves the face.
///
/// Two coordinates of 15 bits along the border of the square, counter-clockwise from the corner (−1, −1), in steps of
/// 1/4096. The error is that of the two ends and is the same everywhere, lines along the borders and the diagonals of
/// texels are exact, and no sine is needed to read it. The positive side is to the left of the way from the first to the
/// second point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PackedLine(u32);

impl PackedLine {
    /// Largest distance between a line and its packed form within the face: half a step at the ends, a 256th of a texel
    /// of a face of 64².
    pub const ERROR: f32 = 0.5 / LINE_STEPS_PER_UNIT as f32;

    /// The line from one point of the border to another, or `None` where both are on one side of the square.
    #[must_use]
    pub fn new(from: u32, to: u32) -> Option<Self> {
        Self::from_bits((from & LINE_STEP_MASK) | (to & LINE_STEP_MASK) << LINE_STEP_BITS)
    }

    /// The line in the low 30 bits of `bits`, or `None` where both of its ends are on one side of the square.
    #[must_use]
    pub fn from_bits(bits: u32) -> Option<Self> {
        let p = border_point(bits & LINE_STEP_MASK);
        let q = border_point((bits >> LINE_STEP_BITS) & LINE_STEP_MASK);
        let same_side = (p.x == q.x && p.x.abs() == 1.0) || (p.y == q.y && p.y.abs() == 1.0);
        (!same_side).then_some(Self(bits & ((1 << (2 * LINE_STEP_BITS)) - 1)))
    }

    /// The 30 bits.
    #[must_use]
    pub fn bits(self) -> u32 {
        self.0
    }

    /// The line, `(a, b)` not normalised.
    #[must_use]
    pub fn line(self) -> FaceLine {
        let line = unpack_line(self.0);
        FaceLine {
            a: line.x,
            b: line.y,
            c: line.z,
        }
    }

    /// The same line with its sides exchanged; every coefficient changes its sign exactly.
    #[must_use]
    pub fn flipped(self) -> Self {
        Self((self.0 & LINE_STEP_MASK) << LINE_STEP_BITS | self.0 >> LINE_STEP_BITS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn axes_are_a_frame_and_faces_contain_their_directions() {
        for face in 0..FACES as u32 {
            let [r, u, f] = face_axes(face);
            assert_eq!(r.cross(u), f * face_sign(face));
            for at in [Vec2::ZERO, Vec2::new(0.9, -0.3), Vec2::new(-0.5, 0.99)] {
                let direction = face_direction(face, at);
                assert_eq!(direction, f + at.x * r + at.y * u);
                let found = face_of(direction * 3.0);
                assert_eq!(found.face, face);
                assert!(found.at.distance(at) < 1e-6);
                for side in 0..4 {
                    assert!(face_side(face, side).dot(direction) > 0.0);
                }
            }
            // Just beyond each side.
            for (side, at) in [
                (0, Vec2::new(1.01, 0.0)),
                (1, Vec2::new(-1.01, 0.0)),
                (2, Vec2::new(0.0, 1.01)),
                (3, Vec2::new(0.0, -1.01)),
            ] {
                assert!(face_side(face, side).dot(face_direction(face, at)) < 0.0);
                assert_ne!(face_of(face_direction(face, at)).face, face);
            }
        }
        assert_eq!(face_of(Vec3::ZERO), FacePoint::default());
        assert_eq!(face_of(Vec3::ONE).face, 0);
        assert_eq!(face_of(-Vec3::ONE).face, 1);
    }

    #[test]
    fn neighbours_share_their_planes() {
        // Six planes between faces, each the side of four faces, of two of them with the normal the other way round.
        let normals: Vec<Vec3> = (0..6)
            .flat_map(|face| (0..4).map(move |side| face_side(face, side)))
            .collect();
        for &normal in &normals {
            let count = |n: Vec3| normals.iter().filter(|&&m| m == n).count();
            assert_eq!((count(normal), count(-normal)), (2, 2), "{normal}");
        }
    }

    #[test]
    fn lines_that_split_nothing_are_refused() {
        let line = |a, b, c| FaceLine { a, b, c }.pack();
        for missed in [
            line(1.0, 0.0, -1.0),
            line(0.0, 1.0, 1.0),
            line(1.0, 1.0, 2.5),
            line(0.0, 0.0, 1.0),
            line(f32::NAN, 1.0, 0.0),
            line(1.0, f32::INFINITY, 0.0),
            line(1.0, 1.0, f32::NAN),
            // Cuts off a corner that is smaller than a step.
            line(1.0, 1.0, -1.99999),
        ] {
            assert_eq!(missed, None);
        }
        assert!(line(1.0, 1.0, -1.99).is_some());
        assert_eq!(PackedLine::from_bits(0), None);
        assert_eq!(PackedLine::new(5, 8192), None);
        // A diagonal of the face.
        let diagonal = PackedLine::new(0, 2 * SIDE_STEPS).unwrap();
        assert_eq!(diagonal.line().evaluate(Vec2::new(0.25, 0.25)), 0.0);
        assert!(diagonal.line().evaluate(Vec2::new(-0.5, 0.5)) > 0.0);
    }

    #[test]
    fn borders_of_texels_are_exact() {
        for i in 1..256 {
            let x = i as f32 / 128.0 - 1.0;
            let line = FaceLine {
                a: 3.0,
                b: 0.0,
                c: -3.0 * x,
            };
            let packed = line.pack().unwrap().line();
            for y in [-1.0, -0.3, 1.0] {
                assert_eq!(packed.evaluate(Vec2::new(x, y)), 0.0, "x = {x}");
            }
            assert!(packed.evaluate(Vec2::new(1.0, 0.0)) > 0.0);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, rng_seed: proptest::test_runner::RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn packed_lines_are_near(angle in 0.0_f32..std::f32::consts::TAU, offset in -1.41_f32..1.41, scale in -3.0_f32..3.0) {
            let line = FaceLine::from_angle(angle, offset);
            let scale = 10.0_f32.powf(scale);
            let scaled = FaceLine { a: line.a * scale, b: line.b * scale, c: line.c * scale };
            let Some(packed) = scaled.pack() else {
                // It misses the face, or nearly so.
                let corner = line.a.abs() + line.b.abs();
                prop_assert!(offset.abs() > corner - 1e-3);
                return Ok(());
            };
            // Both ends of the stored line are near the line, and so is all between them.
            let error = [packed.bits() & LINE_STEP_MASK, packed.bits() >> LINE_STEP_BITS]
                .map(|step| line.evaluate(border_point(step)).abs());
            prop_assert!(error.iter().all(|&e| e <= PackedLine::ERROR + 1e-6), "{error:?}");
            // The sides are the same: the normals point the same way.
            let stored = packed.line();
            prop_assert!(stored.a * line.a + stored.b * line.b > 0.0);
            let flipped = packed.flipped().line();
            prop_assert_eq!((flipped.a, flipped.b, flipped.c), (-stored.a, -stored.b, -stored.c));
            prop_assert_eq!(packed.flipped().flipped(), packed);
            prop_assert_eq!(stored.pack(), Some(packed));
        }
    }
}
