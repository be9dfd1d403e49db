//! Points that are spread evenly over a polygon: where cones to an area light go.
//!
//! In f64 and without a WGSL twin: the points of a light are the same for all pixels, and are made on the CPU when it
//! changes.

use crate::voxel::soft_shadow::{PATTERN_EDGE, PATTERN_PLACES};
use glam::{DVec2, DVec3};

/// Areas below this share of the square of the polygon's extent are none.
const LEAST_AREA: f64 = 1e-12;

/// A map of the unit square onto a simple polygon, convex or not, that keeps areas: what is `k` % of the square is `k` % of
/// the polygon.
///
/// `u` is the share of the polygon's area that lies to the left; `v` the share of the polygon's cross-section there that
/// lies below. Of a rectangle along the axes it is the linear map.
#[derive(Debug, Clone, PartialEq)]
pub struct EvenMap {
    slabs: Vec<Slab>,
    area: f64,
}

/// What lies between two corners along x.
#[derive(Debug, Clone, PartialEq)]
struct Slab {
    left: f64,
    right: f64,
    /// Area of those before.
    before: f64,
    /// The edges that cross it, from below: y at `left` and at `right`. Two and two bound the inside.
    edges: Vec<[f64; 2]>,
    /// Length of the cross-section at `left` and at `right`.
    lengths: [f64; 2],
}

impl EvenMap {
    /// Of a polygon's corners in order, either way round. `None` without an area, or where a corner is not finite.
    #[must_use]
    pub fn new(corners: &[DVec2]) -> Option<Self> {
        if corners.len() < 3 || !corners.iter().all(|corner| corner.is_finite()) {
            return None;
        }
        let mut xs: Vec<f64> = corners.iter().map(|corner| corner.x).collect();
        xs.sort_by(f64::total_cmp);
        xs.dedup();
        let mut slabs = Vec::new();
        let mut area = 0.0;
        for pair in xs.windows(2) {
            let (left, right) = (pair[0], pair[1]);
            let mut edges: Vec<[f64; 2]> = Vec::new();
            for (i, a) in corners.iter().enumerate() {
                let b = &corners[(i + 1) % corners.len()];
                let (a, b) = if a.x <= b.x { (a, b) } else { (b, a) };
                if a.x <= left && b.x >= right {
                    let y = |x: f64| a.y + (b.y - a.y) * ((x - a.x) / (b.x - a.x));
                    edges.push([y(left), y(right)]);
                }
            }
            edges.sort_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1])));
            let mut lengths = [0.0; 2];
            for bounds in edges.chunks_exact(2) {
                for side in 0..2 {
                    lengths[side] += (bounds[1][side] - bounds[0][side]).max(0.0);
                }
            }
            let before = area;
            area += 0.5 * (right - left) * (lengths[0] + lengths[1]);
            slabs.push(Slab {
                left,
                right,
                before,
                edges,
                lengths,
            });
        }
        let low = corners.iter().copied().reduce(DVec2::min)?;
        let high = corners.iter().copied().reduce(DVec2::max)?;
        let extent = (high - low).max_element();
        (area.is_finite() && area > LEAST_AREA * extent * extent).then_some(Self { slabs, area })
    }

    /// Area of the polygon.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area
    }

    /// The point for `u` and `v`, 0 to 1.
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> DVec2 {
        let wanted = u.clamp(0.0, 1.0) * self.area;
        let index = self.slabs.partition_point(|slab| slab.before <= wanted);
        let slab = &self.slabs[index.saturating_sub(1)];
        let width = slab.right - slab.left;
        let [start, end] = slab.lengths;
        // Area up to t: width (start t + (end − start) t² / 2), solved without cancellation.
        let share = (wanted - slab.before) / width;
        let root = (start * start + 2.0 * (end - start) * share)
            .max(0.0)
            .sqrt();
        let sum = start + root;
        let t = if sum > 0.0 {
            (2.0 * share / sum).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let at = |edge: &[f64; 2]| edge[0] + (edge[1] - edge[0]) * t;
        let mut left = v.clamp(0.0, 1.0) * (start + (end - start) * t);
        let mut y = slab.edges.first().map_or(0.0, at);
        for bounds in slab.edges.chunks_exact(2) {
            let (low, high) = (at(&bounds[0]), at(&bounds[1]));
            let length = (high - low).max(0.0);
            y = low + left.min(length);
            if left <= length {
                break;
            }
            left -= length;
        }
        DVec2::new(slab.left + width * t, y)
    }
}

/// Points of a planar polygon in space, and its area: of `side`² parts of equal area [`PATTERN_PLACES`] each, part after
/// part. `None` as for [`EvenMap::new`].
///
/// Within a part they are a grid of 4 × 4 whose rows and columns are sheared, so that along either axis of the light no
/// two of them hide at once behind an edge across it.
#[must_use]
pub fn light_points(corners: &[DVec3], side: u32) -> Option<(Vec<DVec3>, f64)> {
    let first = *corners.first()?;
    let mut doubled_area = DVec3::ZERO;
    for (i, corner) in corners.iter().enumerate() {
        let next = corners[(i + 1) % corners.len()];
        doubled_area += (*corner - first).cross(next - first);
    }
    let normal = doubled_area.try_normalize()?;
    let along = (*corners.get(1)? - first).try_normalize()?;
    let across = normal.cross(along);
    let outline: Vec<DVec2> = corners
        .iter()
        .map(|corner| {
            let place = *corner - first;
            DVec2::new(place.dot(along), place.dot(across))
        })
        .collect();
    let map = EvenMap::new(&outline)?;
    let mut points = Vec::with_capacity((side * side * PATTERN_PLACES) as usize);
    let edge = f64::from(PATTERN_EDGE);
    for part in 0..side * side {
        let cell = [part % side, part / side].map(f64::from);
        for place in 0..PATTERN_PLACES {
            let at = [place % PATTERN_EDGE, place / PATTERN_EDGE].map(f64::from);
            let u = (at[0] + (at[1] + 0.5) / edge) / edge;
            let v = (at[1] + (at[0] + 0.5) / edge) / edge;
            let point = map.point(
                (cell[0] + u) / f64::from(side),
                (cell[1] + v) / f64::from(side),
            );
            points.push(first + along * point.x + across * point.y);
        }
    }
    Some((points, map.area()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn l_shape() -> Vec<DVec2> {
        [
            (0.0, 0.0),
            (3.0, 0.0),
            (3.0, 1.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (0.0, 3.0),
        ]
        .map(|(x, y)| DVec2::new(x, y))
        .to_vec()
    }

    fn star() -> Vec<DVec2> {
        (0..10)
            .map(|i| {
                let radius = if i % 2 == 0 { 2.0 } else { 0.7 };
                DVec2::from_angle(f64::from(i) * 0.2 * std::f64::consts::PI + 0.1) * radius
            })
            .collect()
    }

    fn contains(corners: &[DVec2], point: DVec2) -> bool {
        let mut inside = false;
        for (i, a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            if (a.y > point.y) != (b.y > point.y)
                && point.x < a.x + (b.x - a.x) * (point.y - a.y) / (b.y - a.y)
            {
                inside = !inside;
            }
        }
        inside
    }

    /// Largest difference, as a share of the polygon's area, between the share of the points that are in a rectangle
    /// and the share of the area that is there.
    fn unevenness(corners: &[DVec2], points: &[DVec2]) -> f64 {
        const STEPS: i32 = 400;
        let mut worst = 0.0_f64;
        for k in 0..6 {
            let low = DVec2::new(-2.0 + 0.6 * f64::from(k), -2.0 + 0.5 * f64::from(k));
            let high = low + DVec2::new(1.7, 1.9);
            let within = |p: DVec2| p.cmpge(low).all() && p.cmple(high).all();
            let (mut inside, mut both) = (0, 0);
            for i in 0..STEPS * STEPS {
                let at = |i: i32| -4.0 + 8.0 * (f64::from(i) + 0.5) / f64::from(STEPS);
                let p = DVec2::new(at(i % STEPS), at(i / STEPS));
                if contains(corners, p) {
                    inside += 1;
                    both += i32::from(within(p));
                }
            }
            let share = f64::from(both) / f64::from(inside);
            let hits = points.iter().filter(|p| within(**p)).count();
            worst = worst.max((hits as f64 / points.len() as f64 - share).abs());
        }
        worst
    }

    #[test]
    fn points_are_even_over_any_outline() {
        const N: u32 = 256;
        let triangle = [(0.0, 0.0), (2.0, 0.3), (0.7, 2.5)].map(|(x, y)| DVec2::new(x, y));
        for corners in [l_shape(), star(), triangle.to_vec()] {
            let map = EvenMap::new(&corners).expect("it has an area");
            let at = |i: u32| (f64::from(i) + 0.5) / f64::from(N);
            let points: Vec<DVec2> = (0..N * N)
                .map(|i| map.point(at(i % N), at(i / N)))
                .collect();
            assert!(points.iter().all(|p| contains(&corners, *p)));
            let worst = unevenness(&corners, &points);
            assert!(worst < 0.01, "{worst}");
            // The measure can fail: those of the other half of the square are not even.
            assert!(unevenness(&corners, &points[..points.len() / 2]) > 0.05);
            let reversed: Vec<DVec2> = corners.iter().rev().copied().collect();
            let other = EvenMap::new(&reversed).expect("it has an area");
            assert!((other.area() - map.area()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_rectangle_is_mapped_linearly() {
        let corners = [(1.0, 2.0), (4.0, 2.0), (4.0, 4.0), (1.0, 4.0)];
        let map = EvenMap::new(&corners.map(|(x, y)| DVec2::new(x, y))).expect("an area");
        for (u, v) in [(0.0, 0.0), (0.3, 0.9), (1.0, 1.0), (0.5, 0.25)] {
            let expected = DVec2::new(1.0 + 3.0 * u, 2.0 + 2.0 * v);
            assert!(map.point(u, v).abs_diff_eq(expected, 1e-12));
        }
    }

    #[test]
    fn points_of_a_light_lie_in_it_and_no_two_behind_one_edge() {
        let turn = glam::DQuat::from_rotation_y(0.4) * glam::DQuat::from_rotation_x(1.1);
        let place = DVec3::new(1e5, 3.0, -2e5);
        let local = [(-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5)];
        let corners = local.map(|(x, y)| place + turn * DVec3::new(x, y, 0.0));
        for side in 1..=4 {
            let (points, area) = light_points(&corners, side).expect("an area");
            assert!((area - 2.0).abs() < 1e-6);
            assert_eq!(points.len(), (side * side * PATTERN_PLACES) as usize);
            let back: Vec<DVec3> = points
                .iter()
                .map(|p| turn.inverse() * (*p - place))
                .collect();
            assert!(back.iter().all(|p| p.x.abs() < 1.0 && p.y.abs() < 0.5));
            assert!(back.iter().all(|p| p.z.abs() < 1e-6));
            // Of the first part.
            for axis in 0..2 {
                let mut places: Vec<f64> = back[..16].iter().map(|p| p[axis]).collect();
                places.sort_by(f64::total_cmp);
                let step = [2.0, 1.0][axis] / f64::from(16 * side);
                assert!(
                    places
                        .windows(2)
                        .all(|pair| (pair[1] - pair[0] - step).abs() < 1e-6)
                );
            }
        }
    }

    #[test]
    fn what_has_no_area_has_no_points() {
        let line = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        assert_eq!(light_points(&line, 2), None);
        assert_eq!(light_points(&[], 2), None);
        assert_eq!(light_points(&[DVec3::ZERO; 4], 2), None);
        let broken = [DVec3::ZERO, DVec3::X, DVec3::new(0.0, f64::NAN, 0.0)];
        assert_eq!(light_points(&broken, 2), None);
        assert_eq!(EvenMap::new(&[DVec2::ZERO, DVec2::X]), None);
    }
}
