//! Ray queries over triangles.
//!
//! Two rules keep them right. An origin on a surface is moved off along the geometric normal, and `tmin` is
//! positive, both by [`offset_for`] of the triangle: with `tmin = 0` a coincident surface is hit at t = 0 or not by
//! luck of the boxes' order. And the triangle test gives the same answer for an edge seen from either of its
//! triangles, so that no ray slips through between them.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::RayHit;
use obvhs::triangle::Triangle;

/// A ray; `direction` has unit length.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Hits at or before this distance do not count.
    pub tmin: f32,
    /// Hits at or beyond this distance do not count.
    pub tmax: f32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance.
    pub t: f32,
    /// Index of the triangle in the order given to the builder.
    pub triangle: u32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
}

/// What the path tracer asks of an acceleration structure. `accept(hit, ray)` tells whether a hit counts (alpha,
/// culling).
pub trait RayScene: Sync {
    /// The nearest accepted hit.
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit>;
    /// Whether there is an accepted hit.
    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool;
    /// Visits every hit, in no order.
    fn for_each_hit(&self, ray: &Ray, visit: impl FnMut(&Hit));
}

/// How far to move an origin off a triangle, and the `tmin` to use with it: 32 ULP of its largest coordinate.
///
/// A point interpolated from `f32` vertices is off by at most a few ULP of their coordinates, so this leaves the
/// surface (and any that coincides with it) behind, at 4e-6 of the scene's size for a triangle as large as it.
pub fn offset_for(vertices: &[Vec3; 3]) -> f32 {
    const RELATIVE: f32 = 32.0 * f32::EPSILON;
    let largest = vertices
        .iter()
        .map(|v| v.abs().max_element())
        .fold(0.0, f32::max);
    (RELATIVE * largest).max(f32::MIN_POSITIVE)
}

/// Ray against triangle with Plücker edge functions (as in Embree's robust mode; Shevtsov et al. 2007): the value
/// of a shared edge is the exact negative seen from the other triangle, so that its sign leaves no gap.
#[inline(always)]
fn intersect(
    origin: Vec3A,
    direction: Vec3A,
    [p0, p1, p2]: &[Vec3A; 3],
    tmin: f32,
    tmax: f32,
) -> Option<(f32, f32, f32)> {
    let v0 = *p0 - origin;
    let v1 = *p1 - origin;
    let v2 = *p2 - origin;
    let e0 = v2 - v0;
    let e1 = v0 - v1;
    let e2 = v1 - v2;
    let u = e0.cross(v2 + v0).dot(direction);
    let v = e1.cross(v0 + v1).dot(direction);
    let w = e2.cross(v1 + v2).dot(direction);
    let low = u.min(v).min(w);
    let high = u.max(v).max(w);
    if low < 0.0 && high > 0.0 {
        return None;
    }
    let sum = u + v + w;
    let normal = e0.cross(e1);
    let slope = normal.dot(direction);
    if sum == 0.0 || slope == 0.0 {
        return None;
    }
    let t = v0.dot(normal) / slope;
    // Written so that NaN is no hit.
    if t > tmin && t < tmax {
        Some((t, u / sum, v / sum))
    } else {
        None
    }
}

/// An 8-wide compressed BVH (`obvhs`, medium build: slower builds gain nothing on rays).
pub struct Cwbvh {
    /// None for an empty scene.
    bvh: Option<CwBvh>,
    /// Vertices in the order of the leaves.
    vertices: Vec<[Vec3A; 3]>,
    /// Triangle index of each of `vertices`.
    ids: Vec<u32>,
}

impl Cwbvh {
    /// Builds over triangles with finite vertices.
    pub fn build(triangles: &[[Vec3; 3]]) -> Self {
        if triangles.is_empty() {
            return Self {
                bvh: None,
                vertices: Vec::new(),
                ids: Vec::new(),
            };
        }
        let list: Vec<Triangle> = triangles
            .iter()
            .map(|[a, b, c]| Triangle {
                v0: (*a).into(),
                v1: (*b).into(),
                v2: (*c).into(),
            })
            .collect();
        let bvh = build_cwbvh_from_tris(
            &list,
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        );
        let ids = bvh.primitive_indices.clone();
        let vertices = ids
            .iter()
            .map(|&i| triangles[i as usize].map(Vec3A::from))
            .collect();
        Self {
            bvh: Some(bvh),
            vertices,
            ids,
        }
    }

    #[inline(always)]
    fn test(&self, ray: &obvhs::ray::Ray, leaf: usize) -> Option<Hit> {
        let (t, u, v) = intersect(
            ray.origin,
            ray.direction,
            &self.vertices[leaf],
            ray.tmin,
            ray.tmax,
        )?;
        Some(Hit {
            t,
            triangle: self.ids[leaf],
            u,
            v,
        })
    }
}

fn convert(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(
        ray.origin.into(),
        ray.direction.into(),
        ray.tmin,
        ray.tmax,
    )
}

impl RayScene for Cwbvh {
    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let bvh = self.bvh.as_ref()?;
        let mut best: Option<Hit> = None;
        bvh.ray_traverse(convert(ray), &mut RayHit::none(), |r, leaf| {
            match self.test(r, leaf) {
                Some(hit) if accept(&hit) => {
                    best = Some(hit);
                    hit.t
                }
                _ => f32::INFINITY,
            }
        });
        best
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        let Some(bvh) = &self.bvh else { return false };
        !bvh.ray_traverse_miss(convert(ray), |r, leaf| match self.test(r, leaf) {
            Some(hit) if accept(&hit) => hit.t,
            _ => f32::INFINITY,
        })
    }

    fn for_each_hit(&self, ray: &Ray, mut visit: impl FnMut(&Hit)) {
        let Some(bvh) = &self.bvh else { return };
        bvh.ray_traverse_anyhit(convert(ray), |r, leaf| {
            if let Some(hit) = self.test(r, leaf) {
                visit(&hit);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Deterministic numbers in [0, 1).
    pub(crate) struct Lcg(pub u64);

    impl Lcg {
        pub(crate) fn next(&mut self) -> f32 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f32 / (1_u64 << 24) as f32
        }

        fn vector(&mut self) -> Vec3 {
            Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
        }
    }

    /// Nearest hit in `f64` by Möller and Trumbore 1997, and how close the ray came to any triangle's edge.
    fn brute(triangles: &[[Vec3; 3]], ray: &Ray) -> (Option<(f64, u32)>, f64) {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let mut best: Option<(f64, u32)> = None;
        let mut margin = f64::INFINITY;
        for (i, t) in triangles.iter().enumerate() {
            let [a, b, c] = t.map(|v| v.as_dvec3());
            let (e1, e2) = (b - a, c - a);
            let p: DVec3 = d.cross(e2);
            let det = e1.dot(p);
            if det == 0.0 {
                continue;
            }
            let s = o - a;
            let u = s.dot(p) / det;
            let q = s.cross(e1);
            let v = d.dot(q) / det;
            let t = e2.dot(q) / det;
            if t <= f64::from(ray.tmin) || t >= f64::from(ray.tmax) {
                continue;
            }
            margin = margin.min(u.min(v).min(1.0 - u - v).abs());
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && best.is_none_or(|(best, _)| t < best) {
                best = Some((t, i as u32));
            }
        }
        (best, margin)
    }

    /// A soup with walls that coincide: two tessellations of the same plane, and random triangles.
    fn soup(rng: &mut Lcg) -> Vec<[Vec3; 3]> {
        let mut list = Vec::new();
        let q = |x: f32, z: f32| Vec3::new(x, 0.0, z);
        let (a, b, c, d) = (q(-3.0, -3.0), q(3.0, -3.0), q(3.0, 3.0), q(-3.0, 3.0));
        list.extend([[a, b, c], [a, c, d], [a, b, d], [b, c, d]]);
        let e = q(0.0, 0.0);
        list.extend([[a, b, e], [b, c, e], [c, d, e], [d, a, e]]);
        for _ in 0..300 {
            let center = rng.vector() * 2.0;
            list.push([0, 1, 2].map(|_| center + 0.3 * rng.vector()));
        }
        list
    }

    #[test]
    fn agrees_with_brute_force_also_from_coplanar_surfaces() {
        let mut rng = Lcg(7);
        let triangles = soup(&mut rng);
        let bvh = Cwbvh::build(&triangles);
        let (mut hits, mut checked) = (0, 0);
        for k in 0..4000 {
            // From a point on a triangle, as the path tracer starts its rays.
            let triangle = &triangles[k % triangles.len()];
            let (mut u, mut v) = (rng.next(), rng.next());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = *triangle;
            let normal = (b - a).cross(c - a).normalize();
            let offset = offset_for(triangle);
            let direction = rng.vector().normalize();
            let normal = normal * normal.dot(direction).signum();
            let ray = Ray {
                origin: a * (1.0 - u - v) + b * u + c * v + offset * normal,
                direction,
                tmin: offset,
                tmax: f32::INFINITY,
            };
            let (expected, margin) = brute(&triangles, &ray);
            // f32 and f64 may disagree about a ray that grazes an edge.
            if margin < 1e-5 {
                continue;
            }
            checked += 1;
            let found = bvh.closest(&ray, |_| true);
            assert_eq!(found.is_some(), expected.is_some(), "ray {k} {ray:?}");
            assert_eq!(bvh.occluded(&ray, |_| true), expected.is_some(), "ray {k}");
            if let (Some(found), Some((t, _))) = (found, expected) {
                hits += 1;
                assert!(f64::from(found.t) - t < 1e-4 * t + 1e-5, "{} {t}", found.t);
                // The plane that the origin lies in is behind, in all of its tessellations.
                assert!(found.t > 1e-3 || k % triangles.len() >= 8, "self-hit at {}", found.t);
            }
        }
        assert!(hits > 1000 && checked > 3900, "{hits} hits of {checked}");
    }

    #[test]
    fn without_the_offset_coplanar_surfaces_are_hit() {
        // The wrong way, so that the test above is known to be able to fail.
        let mut rng = Lcg(7);
        let triangles = soup(&mut rng);
        let bvh = Cwbvh::build(&triangles);
        let mut wrong = 0;
        for _ in 0..500 {
            let origin = Vec3::new(rng.next(), -1e-6, rng.next());
            let mut direction = rng.vector();
            direction.y = direction.y.abs();
            let ray = Ray {
                origin,
                direction: direction.normalize(),
                tmin: -1.0,
                tmax: f32::INFINITY,
            };
            wrong += usize::from(bvh.closest(&ray, |_| true).is_some_and(|h| h.t < 1e-3));
        }
        assert!(wrong > 400, "{wrong}");
    }

    #[test]
    fn no_ray_slips_through_shared_edges() {
        // A closed, finely split sphere seen from inside: every ray must hit.
        const N: usize = 40;
        let point = |i: usize, j: usize| {
            let theta = std::f32::consts::PI * i as f32 / N as f32;
            let phi = std::f32::consts::TAU * (j % (2 * N)) as f32 / (2 * N) as f32;
            Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
        };
        let mut triangles = Vec::new();
        for i in 0..N {
            for j in 0..2 * N {
                // The poles are one point each, whatever sin(pi) says.
                let fix = |p: Vec3, i: usize| match i {
                    0 => Vec3::Y,
                    N => Vec3::NEG_Y,
                    _ => p,
                };
                let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                    .map(|(i, j)| fix(point(i, j), i));
                if i > 0 {
                    triangles.push([a, b, d]);
                }
                if i + 1 < N {
                    triangles.push([b, c, d]);
                }
            }
        }
        let bvh = Cwbvh::build(&triangles);
        let mut rng = Lcg(3);
        for k in 0..100_000 {
            // Half of them straight at vertices and edges.
            let direction = if k % 2 == 0 {
                let t = triangles[k % triangles.len()];
                t[0].lerp(t[1], (k % 3) as f32 * 0.5)
            } else {
                rng.vector()
            };
            let ray = Ray {
                origin: Vec3::ZERO,
                direction: direction.normalize(),
                tmin: 1e-4,
                tmax: f32::INFINITY,
            };
            assert!(bvh.closest(&ray, |_| true).is_some(), "ray {k} escaped");
        }
    }

    #[test]
    fn filters_and_empty_scenes() {
        let t = [Vec3::new(-1.0, -1.0, 0.0), Vec3::X, Vec3::Y];
        let ray = Ray {
            origin: Vec3::Z,
            direction: Vec3::NEG_Z,
            tmin: 0.0,
            tmax: 10.0,
        };
        let one = Cwbvh::build(&[t]);
        assert!(one.closest(&ray, |_| true).is_some());
        assert!(one.closest(&ray, |_| false).is_none());
        assert!(!one.occluded(&ray, |_| false));
        let three = Cwbvh::build(&[0.0, -1.0, -2.0].map(|z| t.map(|v| v + z * Vec3::Z)));
        let mut count = 0;
        three.for_each_hit(&ray, |_| count += 1);
        assert_eq!(count, 3);
        assert_eq!(three.closest(&ray, |h| h.triangle != 0).unwrap().t, 2.0);
        assert!(Cwbvh::build(&[]).closest(&ray, |_| true).is_none());
    }
}
