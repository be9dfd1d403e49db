//! Where a lobe looks at a triangle that reflects, and how sharp the light from there is.
//!
//! Interreflection over a triangle (Xu et al. 2014, "A Practical Algorithm for Rendering Interreflections with All-frequency
//! BRDFs"; Okada and Iwasaki 2017, eq. 2) is the integral of a spherical Gaussian times a smooth factor at one direction:
//! that of the axis, taken to the nearest point of the triangle.
//!
//! WGSL module: `akari_math::reflector`.

use crate::special::TINY;
use glam::Vec3;

/// Smallest share of an axis that goes down to the plane of a triangle: one that goes away from it looks at what lies
/// farthest along it.
const MIN_DESCENT: f32 = 1e-2;
const TWO_PI: f32 = std::f32::consts::TAU;

/// Weights of the corners at the point of a triangle that is nearest to `point`. They add up to 1, and none is negative.
///
/// A triangle with an area. The point is within 4e-6 of its largest coordinate of the nearest one (test `twins`).
#[must_use]
pub fn triangle_weights(point: Vec3, a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    let (ab, ac, offset) = (b - a, c - a, point - a);
    let normal = ab.cross(ac);
    let squared = normal.dot(normal).max(TINY);
    let of_b = offset.cross(ac).dot(normal) / squared;
    let of_c = ab.cross(offset).dot(normal) / squared;
    if of_b >= 0.0 && of_c >= 0.0 && of_b + of_c <= 1.0 {
        return Vec3::new(1.0 - of_b - of_c, of_b, of_c);
    }
    // The nearest point of each edge.
    let bc = c - b;
    let along_ab = (offset.dot(ab) / ab.dot(ab).max(TINY)).clamp(0.0, 1.0);
    let along_ac = (offset.dot(ac) / ac.dot(ac).max(TINY)).clamp(0.0, 1.0);
    let along_bc = ((point - b).dot(bc) / bc.dot(bc).max(TINY)).clamp(0.0, 1.0);
    let to_ab = offset - ab * along_ab;
    let to_ac = offset - ac * along_ac;
    let to_bc = (point - b) - bc * along_bc;
    let (on_ab, on_ac, on_bc) = (to_ab.dot(to_ab), to_ac.dot(to_ac), to_bc.dot(to_bc));
    if on_ab <= on_ac && on_ab <= on_bc {
        return Vec3::new(1.0 - along_ab, along_ab, 0.0);
    }
    if on_ac <= on_bc {
        return Vec3::new(1.0 - along_ac, 0.0, along_ac);
    }
    Vec3::new(0.0, 1.0 - along_bc, along_bc)
}

/// Where a lobe about the unit `axis` from the origin meets the plane of a triangle that the origin is in front of.
#[must_use]
pub fn lobe_landing(axis: Vec3, a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    let normal = (b - a).cross(c - a);
    let size = normal.dot(normal).max(TINY).sqrt();
    let height = (-normal.dot(a)).max(0.0);
    axis * (height / (-normal.dot(axis)).max(MIN_DESCENT * size))
}

/// What `point`, as seen from the origin in a mirror of this `normal` there, has to be moved to for a flat mirror of the normal
/// `flat` to show the same: it is mirrored by its own normal, and back by the other.
///
/// Unit normals. As far from the origin as the point. Moved so, the corners of bent mirrors beside each other, one surface with
/// one normal at each corner, show lights as one mirror does, without gaps or overlaps at their edges.
#[must_use]
pub fn unbent_point(point: Vec3, normal: Vec3, flat: Vec3) -> Vec3 {
    let mirrored = point - 2.0 * point.dot(normal) * normal;
    mirrored - 2.0 * mirrored.dot(flat) * flat
}

/// Sharpness of the light from a polygon that a flat surface mirrors, from what the surface's lobe takes of the polygon at
/// the place that mirrors its centre, and the solid angle of the polygon's image in sr: `2 π integral / solid_angle`.
///
/// A lobe of that peak then holds the light of the whole image, which a mirror hands on whatever its roughness does to its
/// outline. For a small source it is [`crate::sg::mirrored_light`]'s; for a large one, whose image the lobe resolves
/// (`integral` → 1), that of a Gaussian as large as the image. Within [0, 1e8].
#[must_use]
pub fn image_sharpness(integral: f32, solid_angle: f32) -> f32 {
    (TWO_PI * integral.max(0.0) / solid_angle.max(TINY)).min(MAX_SHARPNESS)
}

/// Sharper than any lobe of GGX.
const MAX_SHARPNESS: f32 = 1e8;

/// Sharpness of a GGX lobe about what is `1 - cosine = offset` away from its axis, where a Gaussian of the same `sharpness`
/// at the axis would long have ended: GGX falls as `(1 + sharpness offset / 2)^-2`, and this is minus the logarithm's slope.
#[must_use]
pub fn tail_sharpness(sharpness: f32, offset: f32) -> f32 {
    sharpness / (1.0 + 0.5 * sharpness * offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bent_mirrors_beside_each_other_show_a_light_once() {
        // Two facets of a cylinder about y, seen from before it, and where their flat mirrors show a light.
        let normal = |angle: f32| Vec3::new(angle.sin(), 0.0, -angle.cos());
        let light = Vec3::new(0.9, 0.3, -0.4).normalize();
        let edge = Vec3::new(0.2, 0.4, 1.5);
        let at_edge = normal(0.3);
        let away = |middle: Vec3| {
            let image = light - 2.0 * light.dot(middle) * middle;
            let shown = unbent_point(edge, at_edge, middle);
            assert!((shown.length() - edge.length()).abs() < 1e-6);
            image.angle_between(shown)
        };
        // The edge that they share is as far from the light's image by way of one as of the other; where it is, it is not.
        assert!((away(normal(0.25)) - away(normal(0.4))).abs() < 1e-5);
        let flat = |middle: Vec3| (light - 2.0 * light.dot(middle) * middle).angle_between(edge);
        assert!((flat(normal(0.25)) - flat(normal(0.4))).abs() > 0.1);
    }
}
