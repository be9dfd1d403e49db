//! Fixed places that stand for a solid angle: where a surface looks for the light of the sky, the same in every frame.
//!
//! WGSL module: `akari_math::places`.

use crate::special::TINY;
use glam::{Vec2, Vec3, Vec4};

/// Turns by it fill a disc evenly (Vogel 1979, "A Better Way to Construct the Sunflower Head").
const GOLDEN_ANGLE: f32 = 2.399_963_2;
/// Powers of `1 / p` of `p⁵ = p + 1` (Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences").
const CUBE_STEPS: Vec4 = Vec4::new(0.856_674_9, 0.733_891_85, 0.628_706_7, 0.538_597_25);
/// Largest exponent of the weight of a place that is beside what it should be on: what lies between all places is seen.
const MOST_EXPONENT: f32 = 13.0;
/// Squared alpha of a GGX lobe over the squared radius of a disc that is as wide, see [`spread_roughness`].
const ALPHA_OF_DISC: f32 = 0.125;

/// Unit direction of place `index` of `count` about z, with a density as the cosine: evenly over the disc below.
#[must_use]
pub fn cosine_place(index: u32, count: u32) -> Vec3 {
    let square = (index as f32 + 0.5) / count as f32;
    let turn = GOLDEN_ANGLE * index as f32;
    Vec3::new(
        square.sqrt() * turn.cos(),
        square.sqrt() * turn.sin(),
        (1.0 - square).sqrt(),
    )
}

/// Place `index` in the unit cube of four dimensions, each within [0, 1): a sequence that fills it evenly.
#[must_use]
pub fn cube_place(index: u32) -> Vec4 {
    (Vec4::splat(0.5) + index as f32 * CUBE_STEPS).fract()
}

/// Unit direction into the triangle of three unit directions, and the solid angle in sr that it stands for, so that their mean
/// over the unit square is the triangle's. Places are even over the flat triangle in the sphere: seen from its middle, solid
/// angle over area differs by no more than the triangle's middle is nearer than its corners.
/// Between opposite corners there is no direction: the zero vector, which stands for nothing.
#[must_use]
pub fn triangle_place(a: Vec3, b: Vec3, c: Vec3, place: Vec2) -> (Vec3, f32) {
    let at = a + place.x.sqrt() * ((b - a) + place.y * (c - b));
    let squared = at.dot(at).max(TINY);
    let solid_angle =
        0.5 * a.dot((b - a).cross(c - a)).abs() / (squared * squared.sqrt()).max(TINY);
    (at / squared.sqrt(), solid_angle)
}

/// Solid angle over π that a [`cosine_place`] of this cosine stands for, times their number, once a linear map of determinant
/// `jacobian` has made its unit direction `size` long: the inverse of a linearly transformed cosine (Heitz et al. 2016,
/// "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines", eq. 1). At most 1e30 `jacobian`.
#[must_use]
pub fn mapped_spread(jacobian: f32, size: f32, cosine: f32) -> f32 {
    let long = size.max(TINY);
    jacobian / (long * long * long * cosine).max(TINY)
}

/// Weight, within [2e-6, 1], of a place of which what it should be on is as far away as this chord, squared; `spread` is the
/// squared radius of its part of the sphere. A Gaussian, of which two radii hold all but a part in three thousand.
#[must_use]
pub fn beside_weight(chord_squared: f32, spread: f32) -> f32 {
    (-(2.0 * chord_squared / spread.max(TINY)).min(MOST_EXPONENT)).exp()
}

/// Perceptual roughness, within [0, 1], of the GGX lobe along its normal that is as wide as a round part of the sphere of which
/// `share` is the solid angle over π.
///
/// Such a lobe is a Gaussian of sharpness `1 / (2 α²)`, with a variance of `2 α²` along each axis; a disc of squared radius
/// `share` has a quarter of that (Křivánek and Colbert 2008, "Real-time Shading with Filtered Importance Sampling", take the
/// level of a map by solid angle, too).
#[must_use]
pub fn spread_roughness(share: f32) -> f32 {
    (ALPHA_OF_DISC * share.max(0.0)).sqrt().sqrt().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places stand for all of what they are spread over.
    #[test]
    fn places_add_up_to_the_solid_angle() {
        const COUNT: u32 = 4096;
        let (a, b, c) = (
            Vec3::new(0.2, 0.1, 1.0).normalize(),
            Vec3::new(0.9, -0.2, 0.4).normalize(),
            Vec3::new(-0.1, 0.8, 0.5).normalize(),
        );
        let mean = |value: &dyn Fn(u32) -> f32| {
            (0..COUNT).map(|i| f64::from(value(i))).sum::<f64>() / f64::from(COUNT)
        };
        let of_triangle =
            mean(&|i| triangle_place(a, b, c, Vec4::truncate(cube_place(i)).truncate()).1);
        // Oosterom and Strackee 1983.
        let denominator = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
        let exact = 2.0 * f64::from(a.dot(b.cross(c)).abs()).atan2(f64::from(denominator));
        assert!(
            (of_triangle / exact - 1.0).abs() < 2e-3,
            "{of_triangle} of {exact}"
        );
        // Of the square in place of the triangle it would be another.
        let folded = mean(&|i| {
            triangle_place(a, b, c, Vec2::new(cube_place(i).x.powi(2), cube_place(i).y)).1
        });
        assert!((folded / exact - 1.0).abs() > 2e-3, "{folded} of {exact}");
        // The hemisphere has twice pi, seen through any linear map that keeps the horizon.
        for (stretch, half) in [(1.0, 2.0), (0.3, 2.0)] {
            let spread = mean(&|i| {
                let place = cosine_place(i, COUNT);
                let mapped = Vec3::new(stretch * place.x, stretch * place.y, place.z);
                mapped_spread(stretch * stretch, mapped.length(), place.z)
            });
            assert!((spread / half - 1.0).abs() < 2e-2, "{stretch}: {spread}");
        }
        let cosine = mean(&|i| cosine_place(i, COUNT).z);
        assert!((cosine - 2.0 / 3.0).abs() < 1e-3, "{cosine}");
    }
}
