//! Ray queries over triangles.
//!
//! Two rules keep them right. An origin on a surface is moved off along the geometric normal, and `tmin` is
//! positive, both by [`offset_for`] of the triangle: with `tmin = 0` a coincident surface is hit at t = 0 or not by
//! luck of the boxes' order. And the triangle test is watertight: neighbours agree about the edge and the vertices
//! that they share, so that no ray slips through between them.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::RayHit;
use obvhs::{Boundable, BvhBuildParams};

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

/// A ray with two axes across it.
struct Frame {
    origin: Vec3A,
    direction: Vec3A,
    x: Vec3A,
    y: Vec3A,
}

/// Ray against triangle: edge functions of the vertices projected along the ray (after Woop, Benthin and Wald 2013).
/// A vertex has one projection, whichever triangle asks, and the sign of an edge function is exact (rounding is
/// monotone, and a 0 in `f32` is looked at again in `f64`): no ray slips through a shared edge or vertex.
#[inline(always)]
fn intersect(
    frame: &Frame,
    [p0, p1, p2]: &[Vec3A; 3],
    tmin: f32,
    tmax: f32,
) -> Option<(f32, f32, f32)> {
    let (a, b, c) = (*p0 - frame.origin, *p1 - frame.origin, *p2 - frame.origin);
    let (ax, ay) = (frame.x.dot(a), frame.y.dot(a));
    let (bx, by) = (frame.x.dot(b), frame.y.dot(b));
    let (cx, cy) = (frame.x.dot(c), frame.y.dot(c));
    let mut u = cx * by - cy * bx;
    let mut v = ax * cy - ay * cx;
    let mut w = bx * ay - by * ax;
    if u == 0.0 || v == 0.0 || w == 0.0 {
        let edge = |px: f32, py: f32, qx: f32, qy: f32| {
            (f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)) as f32
        };
        u = edge(cx, cy, bx, by);
        v = edge(ax, ay, cx, cy);
        w = edge(bx, by, ax, ay);
    }
    if u.min(v).min(w) < 0.0 && u.max(v).max(w) > 0.0 {
        return None;
    }
    let sum = u + v + w;
    if sum == 0.0 {
        return None;
    }
    let inverse = 1.0 / sum;
    let d = frame.direction;
    let t = (u * d.dot(a) + v * d.dot(b) + w * d.dot(c)) * inverse;
    // Written so that NaN is no hit.
    if t > tmin && t < tmax {
        Some((t, v * inverse, w * inverse))
    } else {
        None
    }
}

/// Boxes grow by this share of the largest coordinate. The slab test of a box rounds where the triangle test does not:
/// a ray along a box's face (a vertex of a grid, an axis-aligned wall) would be culled from both of its sides.
const BOX_MARGIN: f32 = 16.0 * f32::EPSILON;

/// The box of a triangle, grown.
struct Padded(Aabb);

impl Boundable for Padded {
    fn aabb(&self) -> Aabb {
        self.0
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
        let largest = triangles
            .iter()
            .flatten()
            .map(|v| v.abs().max_element())
            .fold(0.0, f32::max);
        let margin = Vec3A::splat(BOX_MARGIN * largest);
        let boxes: Vec<Padded> = triangles
            .iter()
            .map(|[a, b, c]| {
                Padded(Aabb::new(
                    Vec3A::from(a.min(*b).min(*c)) - margin,
                    Vec3A::from(a.max(*b).max(*c)) + margin,
                ))
            })
            .collect();
        let bvh = build_cwbvh(
            &boxes,
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
    fn test(&self, frame: &Frame, ray: &obvhs::ray::Ray, leaf: usize) -> Option<Hit> {
        let (t, u, v) = intersect(frame, &self.vertices[leaf], ray.tmin, ray.tmax)?;
        Some(Hit {
            t,
            triangle: self.ids[leaf],
            u,
            v,
        })
    }
}

/// The ray as `obvhs` takes it. Its own constructor bounds the inverse direction by 1/ε, so that boxes and triangles
/// see different directions where a component is below ε, and a ray along an edge falls between two boxes.
fn convert(ray: &Ray) -> (obvhs::ray::Ray, Frame) {
    /// Components below this are taken for 0, in boxes and in triangles.
    const TINY: f32 = 1e-20;
    let direction = ray.direction.map(|d| if d.abs() < TINY { 0.0 } else { d });
    let inverse = direction.map(|d| if d == 0.0 { 1.0 / TINY } else { 1.0 / d });
    let converted = obvhs::ray::Ray {
        origin: ray.origin.into(),
        direction: direction.into(),
        inv_direction: inverse.into(),
        tmin: ray.tmin,
        tmax: ray.tmax,
    };
    let (x, y) = direction.any_orthonormal_pair();
    let frame = Frame {
        origin: converted.origin,
        direction: converted.direction,
        x: x.into(),
        y: y.into(),
    };
    (converted, frame)
}

impl RayScene for Cwbvh {
    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let bvh = self.bvh.as_ref()?;
        let mut best: Option<Hit> = None;
        let (ray, frame) = convert(ray);
        bvh.ray_traverse(ray, &mut RayHit::none(), |r, leaf| {
            match self.test(&frame, r, leaf) {
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
        let (ray, frame) = convert(ray);
        !bvh.ray_traverse_miss(ray, |r, leaf| match self.test(&frame, r, leaf) {
            Some(hit) if accept(&hit) => hit.t,
            _ => f32::INFINITY,
        })
    }

    fn for_each_hit(&self, ray: &Ray, mut visit: impl FnMut(&Hit)) {
        let Some(bvh) = &self.bvh else { return };
        let (ray, frame) = convert(ray);
        bvh.ray_traverse_anyhit(ray, |r, leaf| {
            if let Some(hit) = self.test(&frame, r, leaf) {
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
                assert!(
                    found.t > 1e-3 || k % triangles.len() >= 8,
                    "self-hit at {}",
                    found.t
                );
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
            Vec3::new(
                theta.sin() * phi.cos(),
                theta.cos(),
                theta.sin() * phi.sin(),
            )
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
