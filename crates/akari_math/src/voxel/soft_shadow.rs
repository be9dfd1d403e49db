//! Soft shadows of area lights by cones to points of the light: which point a pixel takes, what it counts, how wide its
//! cone is.
//!
//! WGSL module: `akari_math::voxel::soft_shadow`. Where the points of a light lie is in [`crate::light_points`].

use glam::{UVec2, Vec3};

/// Places in each part of a light that pixels of a square of [`PATTERN_EDGE`]² take in turn.
pub const PATTERN_PLACES: u32 = 16;
/// Pixels along an edge of that square.
pub const PATTERN_EDGE: u32 = 4;
/// Squared distance below which a light counts as that far away, m²: a micrometre.
const MIN_DISTANCE_SQUARED: f32 = 1e-12;
/// 1/√π: radius of a disk over the root of its area.
const DISK_RADIUS: f32 = 0.564_189_6;
/// Largest tangent of a cone's half aperture, that of 45°.
const MAX_TANGENT: f32 = 1.0;

/// Which of the [`PATTERN_PLACES`] a pixel takes: `sx + 4 sy` of the cell (sx, sy) of a grid of 4 × 4.
///
/// A bijection on each square of 4 × 4 pixels, wherever it begins, and neighbours are far apart: each square of 2 × 2
/// pixels has one place in each quarter of the part.
#[must_use]
pub fn pattern_place(pixel: UVec2) -> u32 {
    let low = UVec2::new(pixel.x & 1, pixel.y & 1);
    let high = UVec2::new((pixel.x >> 1) & 1, (pixel.y >> 1) & 1);
    let x = 2 * (low.x ^ low.y) + (high.x ^ high.y);
    let y = 2 * low.y + high.y;
    x + PATTERN_EDGE * y
}

/// Irradiance per area of a light of radiance 1 at a point of it: `cos θ_r cos θ_l / d²`, 1/m².
///
/// `to_point` goes from the surface to the point, metres, up to 10¹⁵; closer than a micrometre counts as that. The
/// normals have length 1. 0 behind the surface, and behind the light unless it is two-sided.
#[must_use]
pub fn light_point_weight(
    to_point: Vec3,
    normal: Vec3,
    light_normal: Vec3,
    two_sided: bool,
) -> f32 {
    let reciprocal = 1.0 / to_point.dot(to_point).max(MIN_DISTANCE_SQUARED);
    let leaving = -to_point.dot(light_normal);
    let sent = if two_sided {
        leaving.abs()
    } else {
        leaving.max(0.0)
    };
    (to_point.dot(normal).max(0.0) * reciprocal) * (sent * reciprocal)
}

/// Tangent of the half aperture of the cone whose cross-section is that of a part of a light of `area` m² at `to_point`:
/// `√(area cos θ_l / π) / d`, at most 1. The domain is that of [`light_point_weight`].
#[must_use]
pub fn light_part_tangent(area: f32, to_point: Vec3, light_normal: Vec3) -> f32 {
    let reciprocal = 1.0 / to_point.dot(to_point).max(MIN_DISTANCE_SQUARED).sqrt();
    let cosine = (to_point.dot(light_normal).abs() * reciprocal).min(1.0);
    (DISK_RADIUS * area.max(0.0).sqrt() * cosine.sqrt() * reciprocal).min(MAX_TANGENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_square_of_pixels_has_every_place() {
        for corner in (0..8).flat_map(|x| (0..8).map(move |y| UVec2::new(x, y))) {
            let mut places = 0_u32;
            for i in 0..16 {
                places |= 1 << pattern_place(corner + UVec2::new(i % 4, i / 4));
            }
            assert_eq!(places, 0xffff, "{corner}");
            let mut quarters = 0_u32;
            for i in 0..4 {
                let place = pattern_place(2 * corner + UVec2::new(i % 2, i / 2));
                quarters |= 1 << ((place & 3) / 2 + (place >> 2) / 2 * 2);
            }
            assert_eq!(quarters, 0xf, "{corner}");
        }
    }

    /// The weights of the points of a light, times the area of each, add up to its form factor times π.
    #[test]
    fn weights_add_up_to_the_form_factor() {
        const N: u32 = 64;
        let mut sum = 0.0_f64;
        for i in 0..N * N {
            let at = |i: u32| (i as f32 + 0.5) / N as f32 - 0.5;
            let to = Vec3::new(0.7 + at(i % N), 0.3 + at(i / N), 0.8);
            sum += f64::from(light_point_weight(to, Vec3::Z, Vec3::NEG_Z, false));
        }
        let corner = |x: f32, y: f32| Vec3::new(0.7 + x, 0.3 + y, 0.8);
        let corners = [
            corner(-0.5, -0.5),
            corner(-0.5, 0.5),
            corner(0.5, 0.5),
            corner(0.5, -0.5),
        ];
        let mut exact = 0.0_f64;
        for i in 0..4 {
            let (a, b) = (
                corners[i].as_dvec3().normalize(),
                corners[(i + 1) % 4].as_dvec3().normalize(),
            );
            exact += 0.5 * a.dot(b).acos() * a.cross(b).normalize().z;
        }
        let sum = sum / f64::from(N * N);
        assert!((sum / exact.abs() - 1.0).abs() < 1e-3, "{sum} {exact}");
    }
}
