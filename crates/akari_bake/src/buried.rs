//! Samples inside of things.
//!
//! A floor goes on below the furniture that stands on it, and so do its samples. They see the furniture from inside:
//! nothing. Interpolated with their neighbours in the open, they would draw a dark fringe around whatever touches
//! anything. Such a sample sees next to nothing, and what it sees first, in most directions, is the back of one-sided
//! surfaces; in a dark corner that is open it is fronts. It then takes over what its nearest neighbour in the open sees.

use glam::{DVec3, Vec4};

use crate::bvh::{Accept, Bvh, Child, LeafTriangle};
use crate::coverage::Origin;
use crate::mask::FaceMask;

/// A sample that sees more than this share is not asked about.
const DARK: f64 = 0.1;
/// Rays that are traced, over the sphere; half of them above a horizon.
const RAYS: u32 = 64;
/// Share of the rays that has to meet a back first.
const BACKS: f64 = 0.5;

/// Whether a sample is inside of something. `masks` is what it sees.
pub(crate) fn is_buried(
    bvh: &Bvh,
    origin: &Origin,
    normal: DVec3,
    masks: &[FaceMask; 6],
    accept: &impl Accept,
) -> bool {
    let (cared, visible) = masks.iter().fold((0, 0), |(cared, visible), mask| {
        (cared + mask.cared_count(), visible + mask.visible_count())
    });
    if cared == 0 || f64::from(visible) > DARK * f64::from(cared) {
        return false;
    }
    let (mut rays, mut backs) = (0, 0);
    for k in 0..RAYS {
        let direction = spiral(k);
        if direction.dot(normal) > 0.0 {
            rays += 1;
            backs += u32::from(first_hit_is_back(bvh, origin, direction, accept));
        }
    }
    f64::from(backs) > BACKS * f64::from(rays)
}

/// Points that are spread evenly over the sphere: equal steps in height, golden angles around.
fn spiral(k: u32) -> DVec3 {
    let height = 1.0 - f64::from(2 * k + 1) / f64::from(RAYS);
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let (sin, cos) = (golden * f64::from(k)).sin_cos();
    let radius = (1.0 - height * height).sqrt();
    DVec3::new(radius * cos, height, radius * sin)
}

/// Whether the nearest surface along a ray is a one-sided one, seen from behind.
fn first_hit_is_back(bvh: &Bvh, origin: &Origin, direction: DVec3, accept: &impl Accept) -> bool {
    if bvh.nodes.is_empty() {
        return false;
    }
    let position = origin.position.as_vec3().to_array().map(Vec4::splat);
    // Components of 0 are tiny ones for the boxes, which have a margin.
    const TINY: f64 = 1e-20;
    let inverse = direction.to_array().map(|d| {
        let d = if d.abs() < TINY { TINY } else { d };
        Vec4::splat((1.0 / d) as f32)
    });
    let mut nearest = (origin.tmax, false);
    let mut stack = vec![Child::ROOT];
    while let Some(child) = stack.pop() {
        let node = match child.get() {
            Ok(triangle) => {
                let triangle = &bvh.triangles[triangle];
                if let Some((t, back)) = hit(triangle, origin.position, direction, accept)
                    && t > origin.tmin
                    && t < nearest.0
                {
                    nearest = (t, back && !triangle.is_two_sided());
                }
                continue;
            }
            Err(node) => &bvh.nodes[node],
        };
        let (mut enter, mut leave) = (Vec4::ZERO, Vec4::splat(nearest.0 as f32));
        for axis in 0..3 {
            // By the sign, so that an empty box is left before it is entered.
            let (near, far) = if inverse[axis].x > 0.0 {
                (node.min[axis], node.max[axis])
            } else {
                (node.max[axis], node.min[axis])
            };
            enter = enter.max((near - position[axis]) * inverse[axis]);
            leave = leave.min((far - position[axis]) * inverse[axis]);
        }
        let mut hits = enter.cmple(leave).bitmask();
        while hits != 0 {
            stack.push(node.child[hits.trailing_zeros() as usize]);
            hits &= hits - 1;
        }
    }
    nearest.1
}

/// Distance, and whether the back is met (Möller and Trumbore 1997).
fn hit(
    triangle: &LeafTriangle,
    origin: DVec3,
    direction: DVec3,
    accept: &impl Accept,
) -> Option<(f64, bool)> {
    let [a, b, c] = triangle.vertices.map(|v| DVec3::from(v.map(f64::from)));
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(e1);
    let v = direction.dot(q) / determinant;
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    // The determinant is positive where the ray meets the front.
    (inside && triangle.covers(accept, u, v)).then(|| (e2.dot(q) / determinant, determinant < 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Caster;
    use glam::Vec3;

    fn cube(front: impl Fn(DVec3) -> Option<DVec3>) -> Bvh {
        let mut casters = Vec::new();
        for axis in 0..3 {
            for side in [-1.0_f32, 1.0] {
                let corner = |s: f32, t: f32| {
                    let mut p = Vec3::ZERO;
                    p[axis] = side;
                    p[(axis + 1) % 3] = s;
                    p[(axis + 2) % 3] = t;
                    p
                };
                let mut outward = DVec3::ZERO;
                outward[axis] = f64::from(side);
                let [a, b, c, d] =
                    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(s, t)| corner(s, t));
                for vertices in [[a, b, c], [a, c, d]] {
                    casters.push(Caster {
                        vertices,
                        front: front(outward),
                        cut: None,
                    });
                }
            }
        }
        Bvh::build(&casters)
    }

    #[test]
    fn inside_of_a_solid_is_buried_and_inside_of_a_room_is_not() {
        let all = |_: u32, _: f64, _: f64| true;
        let dark: [FaceMask; 6] =
            std::array::from_fn(|_| FaceMask::from_fn(32, |_, _| Some(false)));
        let light: [FaceMask; 6] =
            std::array::from_fn(|_| FaceMask::from_fn(32, |x, _| Some(x < 16)));
        let buried = |bvh: &Bvh, position, masks| {
            let origin = Origin {
                position,
                tmin: 1e-6,
                tmax: f64::INFINITY,
            };
            is_buried(bvh, &origin, DVec3::Y, masks, &all)
        };
        let solid = cube(Some);
        let inside = DVec3::new(0.2, -0.3, 0.1);
        assert!(buried(&solid, inside, &dark));
        assert!(
            !buried(&solid, inside, &light),
            "what sees is not asked about"
        );
        assert!(!buried(&solid, DVec3::new(0.0, 1.5, 0.0), &dark));
        let room = cube(|outward| Some(-outward));
        assert!(!buried(&room, inside, &dark));
        let thin = cube(|_| None);
        assert!(!buried(&thin, inside, &dark));
        assert!(!buried(&Bvh::build(&[]), inside, &dark));
    }
}
