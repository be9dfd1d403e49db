//! From the triangles of a planar primitive to the one polygon that they cover.
//!
//! Plain slices in, plain vectors out, in f64 inside: no scene, no engine, and no WGSL twin, since lights are made on the
//! CPU.

use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;

/// Most vertices that a polygonal light may have.
pub const MAX_VERTICES: usize = 16;
/// Largest distance from the common plane, as a share of the polygon's extent: exporters round to `f32` and
/// artists rotate, neither of which comes near it; a bulge that shows does.
const PLANARITY: f64 = 1e-4;
/// A vertex closer than this share of the extent to the line through its neighbours is no corner.
const COLLINEARITY: f64 = 1e-5;
/// The outline's area and the triangles' summed area must agree to this share, or triangles overlap.
const AREA_AGREEMENT: f64 = 1e-3;

/// Why triangles do not join to one polygon.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OutlineError {
    /// There is nothing to join.
    #[error("it has no triangles")]
    Empty,
    /// An index without a vertex.
    #[error("index {index} is out of range ({vertices} vertices)")]
    IndexOutOfRange {
        /// The index.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// NaN or infinity.
    #[error("vertex {0} is not finite")]
    NotFinite(usize),
    /// All triangles together have no area.
    #[error("its area is zero")]
    ZeroArea,
    /// Vertices leave the common plane.
    #[error("it is not planar (a vertex is {deviation:.3e} off the plane, extent {extent:.3e})")]
    NotPlanar {
        /// Largest distance from the plane.
        deviation: f64,
        /// Largest distance of two corners of the bounding box.
        extent: f64,
    },
    /// Neighbouring triangles turn different ways, or lie on one another.
    #[error("its triangles overlap or wind in different directions")]
    Inconsistent,
    /// The outline meets itself.
    #[error("its outline touches or crosses itself")]
    SelfIntersecting,
    /// There is an inner outline.
    #[error("it has a hole")]
    Hole,
    /// There are several outer outlines.
    #[error("it consists of {0} separate pieces")]
    SeveralPieces(usize),
    /// Too many corners.
    #[error("its outline has {0} corners (at most {MAX_VERTICES})")]
    TooManyVertices(usize),
}

/// The polygon that the triangles `indices` (three each) over `positions` cover: its corners, in the triangles'
/// winding, starting at the corner that is first in `positions`.
///
/// Domain: any input; what does not join to one simple polygon of 3 to [`MAX_VERTICES`] corners is an error that
/// says why. The polygon may be concave. Vertices of equal position are the same vertex; corners on a straight
/// edge are dropped. Tolerances: out of plane 1e-4 of the extent, collinear 1e-5 of the extent.
pub fn outline(positions: &[Vec3], indices: &[u32]) -> Result<Vec<Vec3>, OutlineError> {
    if indices.len() < 3 {
        return Err(OutlineError::Empty);
    }
    for &index in indices {
        match positions.get(index as usize) {
            None => {
                return Err(OutlineError::IndexOutOfRange {
                    index,
                    vertices: positions.len(),
                });
            }
            Some(p) if !p.is_finite() => return Err(OutlineError::NotFinite(index as usize)),
            Some(_) => {}
        }
    }
    let triangles = weld(positions, indices);
    let point = |i: u32| positions[i as usize].as_dvec3();

    let (normal, area) = plane_normal(&triangles, point)?;
    let extent = check_planar(&triangles, point, normal)?;

    let loops = boundary_loops(&triangles)?;
    if loops.len() > 1 {
        let holes = loops
            .iter()
            .any(|l| area_vector(l.iter().map(|&i| point(i))).dot(normal) < 0.0);
        return Err(if holes {
            OutlineError::Hole
        } else {
            OutlineError::SeveralPieces(loops.len())
        });
    }
    let Some(boundary) = loops.into_iter().next() else {
        return Err(OutlineError::Inconsistent);
    };
    let corners = drop_collinear(boundary, point, COLLINEARITY * extent)?;
    if corners.len() < 3 {
        return Err(OutlineError::ZeroArea);
    }
    if corners.len() > MAX_VERTICES {
        return Err(OutlineError::TooManyVertices(corners.len()));
    }
    check_simple(&corners, point, normal)?;
    let outline_area = area_vector(corners.iter().map(|&i| point(i))).dot(normal);
    if (outline_area - area).abs() > AREA_AGREEMENT * area {
        return Err(OutlineError::Inconsistent);
    }
    Ok(corners.into_iter().map(|i| positions[i as usize]).collect())
}

/// Triangles over vertices that are unique by position (the first of equal ones); those with a repeated vertex
/// are left out. Slivers of three distinct vertices stay: they carry the topology of T-junctions.
fn weld(positions: &[Vec3], indices: &[u32]) -> Vec<[u32; 3]> {
    let mut first: HashMap<[u32; 3], u32> = HashMap::new();
    // Adding 0.0 turns -0.0 into 0.0, which is the same place.
    let key = |p: Vec3| (p + 0.0).to_array().map(f32::to_bits);
    for &i in indices {
        first
            .entry(key(positions[i as usize]))
            .and_modify(|j| *j = (*j).min(i))
            .or_insert(i);
    }
    indices
        .chunks_exact(3)
        .map(|t| [0, 1, 2].map(|k| first[&key(positions[t[k] as usize])]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect()
}

/// Half the sum of the cross products of neighbouring corners: the area along the normal, for a planar loop.
fn area_vector(points: impl Iterator<Item = DVec3> + Clone) -> DVec3 {
    let Some(origin) = points.clone().next() else {
        return DVec3::ZERO;
    };
    let relative = points.map(|p| p - origin);
    let next = relative.clone().skip(1);
    relative
        .zip(next)
        .fold(DVec3::ZERO, |sum, (a, b)| sum + a.cross(b))
        * 0.5
}

/// Common unit normal and summed area.
fn plane_normal(
    triangles: &[[u32; 3]],
    point: impl Fn(u32) -> DVec3,
) -> Result<(DVec3, f64), OutlineError> {
    let mut sum = DVec3::ZERO;
    let mut area = 0.0;
    for t in triangles {
        let [a, b, c] = t.map(&point);
        let cross = 0.5 * (b - a).cross(c - a);
        sum += cross;
        area += cross.length();
    }
    if area <= f64::MIN_POSITIVE {
        return Err(OutlineError::ZeroArea);
    }
    let normal = sum.try_normalize().ok_or(OutlineError::Inconsistent)?;
    Ok((normal, area))
}

/// Checks that all triangles lie in one plane and face one way; gives the extent.
fn check_planar(
    triangles: &[[u32; 3]],
    point: impl Fn(u32) -> DVec3,
    normal: DVec3,
) -> Result<f64, OutlineError> {
    let mut min = DVec3::INFINITY;
    let mut max = DVec3::NEG_INFINITY;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    // Heights over the plane relative to the first vertex: no cancellation far from the origin.
    let origin = point(triangles[0][0]);
    for p in triangles.iter().flatten().map(|&i| point(i)) {
        min = min.min(p);
        max = max.max(p);
        let height = (p - origin).dot(normal);
        low = low.min(height);
        high = high.max(height);
    }
    let extent = (max - min).length();
    let deviation = high - low;
    if deviation > PLANARITY * extent {
        return Err(OutlineError::NotPlanar { deviation, extent });
    }
    for t in triangles {
        let [a, b, c] = t.map(&point);
        // A sliver's direction is noise; one with an area that counts must face as the others do.
        if (b - a).cross(c - a).dot(normal) < -COLLINEARITY * extent * extent {
            return Err(OutlineError::Inconsistent);
        }
    }
    Ok(extent)
}

/// Closed loops of the directed edges that have no partner in the other direction.
fn boundary_loops(triangles: &[[u32; 3]]) -> Result<Vec<Vec<u32>>, OutlineError> {
    let mut edges = std::collections::BTreeSet::new();
    for &[a, b, c] in triangles {
        for edge in [(a, b), (b, c), (c, a)] {
            if !edges.insert(edge) {
                return Err(OutlineError::Inconsistent);
            }
        }
    }
    let mut next = std::collections::BTreeMap::new();
    for &(a, b) in &edges {
        if !edges.contains(&(b, a)) && next.insert(a, b).is_some() {
            return Err(OutlineError::SelfIntersecting);
        }
    }
    let mut loops = Vec::new();
    while let Some((&start, _)) = next.iter().next() {
        let mut boundary = Vec::new();
        let mut at = start;
        while let Some(to) = next.remove(&at) {
            boundary.push(at);
            at = to;
        }
        if at != start {
            return Err(OutlineError::Inconsistent);
        }
        loops.push(boundary);
    }
    Ok(loops)
}

/// Removes vertices that lie on the line through their neighbours; a spike is an error.
fn drop_collinear(
    mut corners: Vec<u32>,
    point: impl Fn(u32) -> DVec3,
    tolerance: f64,
) -> Result<Vec<u32>, OutlineError> {
    let mut i = 0;
    let mut kept_in_a_row = 0;
    while corners.len() >= 3 && kept_in_a_row < corners.len() {
        let n = corners.len();
        i %= n;
        let [a, b, c] = [corners[(i + n - 1) % n], corners[i], corners[(i + 1) % n]].map(&point);
        let base = c - a;
        let distance = if base.length() > tolerance {
            (b - a).cross(base).length() / base.length()
        } else {
            (b - a).length()
        };
        if distance <= tolerance {
            if (b - a).dot(c - b) < -tolerance * tolerance {
                return Err(OutlineError::SelfIntersecting);
            }
            corners.remove(i);
            kept_in_a_row = 0;
        } else {
            i += 1;
            kept_in_a_row += 1;
        }
    }
    // Removal may have taken the first vertex: start again at the smallest index, as documented.
    if let Some(start) = (0..corners.len()).min_by_key(|&k| corners[k]) {
        corners.rotate_left(start);
    }
    Ok(corners)
}

/// Checks that no two edges that are not neighbours meet.
fn check_simple(
    corners: &[u32],
    point: impl Fn(u32) -> DVec3,
    normal: DVec3,
) -> Result<(), OutlineError> {
    let (x, y) = normal.any_orthonormal_pair();
    let origin = point(corners[0]);
    let flat: Vec<DVec2> = corners
        .iter()
        .map(|&i| point(i) - origin)
        .map(|p| DVec2::new(p.dot(x), p.dot(y)))
        .collect();
    let n = flat.len();
    let side = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - a);
    for i in 0..n {
        for j in i + 2..n {
            if i == 0 && j == n - 1 {
                continue;
            }
            let (a, b) = (flat[i], flat[i + 1]);
            let (c, d) = (flat[j], flat[(j + 1) % n]);
            let straddles = |p: f64, q: f64| (p <= 0.0 && q >= 0.0) || (p >= 0.0 && q <= 0.0);
            // Collinear disjoint edges give four zeros; the boxes tell them from touching ones.
            let boxes_meet = a.min(b).cmple(c.max(d)).all() && c.min(d).cmple(a.max(b)).all();
            if boxes_meet
                && straddles(side(a, b, c), side(a, b, d))
                && straddles(side(c, d, a), side(c, d, b))
            {
                return Err(OutlineError::SelfIntersecting);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f32, y: f32) -> Vec3 {
        // A tilted plane far from the origin, so that nothing hides behind an axis.
        Vec3::new(100.0 + x, 20.0 + 0.6 * y, -50.0 + 0.8 * y)
    }

    fn fan(n: usize) -> (Vec<Vec3>, Vec<u32>) {
        let positions = (0..n)
            .map(|i| {
                let a = i as f32 / n as f32 * std::f32::consts::TAU;
                v(a.cos(), a.sin())
            })
            .collect();
        let indices = (1..n as u32 - 1).flat_map(|i| [0, i, i + 1]).collect();
        (positions, indices)
    }

    #[test]
    fn quad_of_two_triangles_with_unshared_vertices() {
        let p = [
            v(0., 0.),
            v(1., 0.),
            v(1., 1.),
            v(0., 0.),
            v(1., 1.),
            v(0., 1.),
        ];
        let polygon = outline(&p, &[0, 1, 2, 3, 4, 5]).unwrap();
        assert_eq!(polygon, [p[0], p[1], p[2], p[5]]);
    }

    #[test]
    fn grid_becomes_its_four_corners() {
        const N: u32 = 5;
        let p: Vec<Vec3> = (0..=N)
            .flat_map(|j| (0..=N).map(move |i| v(i as f32, j as f32)))
            .collect();
        let mut indices = Vec::new();
        for j in 0..N {
            for i in 0..N {
                let a = j * (N + 1) + i;
                indices.extend([a, a + 1, a + N + 2, a, a + N + 2, a + N + 1]);
            }
        }
        let polygon = outline(&p, &indices).unwrap();
        assert_eq!(polygon, [p[0], p[5], p[35], p[30]]);
    }

    #[test]
    fn concave_polygon_keeps_its_notch() {
        let p = [v(0., 0.), v(2., 0.), v(2., 2.), v(1., 0.5), v(0., 2.)];
        let polygon = outline(&p, &[0, 1, 3, 1, 2, 3, 0, 3, 4]).unwrap();
        assert_eq!(polygon, p);
    }

    #[test]
    fn vertex_limit() {
        let (p, i) = fan(16);
        assert_eq!(outline(&p, &i).unwrap().len(), 16);
        let (p, i) = fan(17);
        assert_eq!(outline(&p, &i), Err(OutlineError::TooManyVertices(17)));
    }

    #[test]
    fn rejections_say_why() {
        let quad = [v(0., 0.), v(1., 0.), v(1., 1.), v(0., 1.)];
        let ok = [0, 1, 2, 0, 2, 3];
        assert_eq!(outline(&quad, &[]), Err(OutlineError::Empty));
        assert!(matches!(
            outline(&quad, &[0, 1, 9]),
            Err(OutlineError::IndexOutOfRange { index: 9, .. })
        ));
        let mut bent = quad;
        bent[3].z += 0.3;
        assert!(matches!(
            outline(&bent, &ok),
            Err(OutlineError::NotPlanar { .. })
        ));
        let mut nan = quad;
        nan[2].x = f32::NAN;
        assert_eq!(outline(&nan, &ok), Err(OutlineError::NotFinite(2)));
        assert_eq!(
            outline(&quad, &[0, 1, 2, 0, 3, 2]),
            Err(OutlineError::Inconsistent)
        );
        assert_eq!(
            outline(&quad, &[0, 1, 2, 0, 1, 2]),
            Err(OutlineError::Inconsistent)
        );
        let line = [v(0., 0.), v(1., 0.), v(2., 0.)];
        assert!(outline(&line, &[0, 1, 2]).is_err());
        let apart = [
            v(0., 0.),
            v(1., 0.),
            v(0., 1.),
            v(5., 5.),
            v(6., 5.),
            v(5., 6.),
        ];
        assert_eq!(
            outline(&apart, &[0, 1, 2, 3, 4, 5]),
            Err(OutlineError::SeveralPieces(2))
        );
        // A frame: outer square 0..3, inner square 4..7.
        let frame = [
            v(0., 0.),
            v(3., 0.),
            v(3., 3.),
            v(0., 3.),
            v(1., 1.),
            v(2., 1.),
            v(2., 2.),
            v(1., 2.),
        ];
        let ring = [
            0, 1, 5, 0, 5, 4, 1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7,
        ];
        assert_eq!(outline(&frame, &ring), Err(OutlineError::Hole));
        // Two triangles that touch in one vertex.
        let bow = [v(0., 0.), v(1., 0.), v(0., 1.), v(-1., 0.), v(0., -1.)];
        assert_eq!(
            outline(&bow, &[0, 1, 2, 0, 3, 4]),
            Err(OutlineError::SelfIntersecting)
        );
    }

    #[test]
    fn overlapping_spiral_is_refused() {
        // A strip that winds once around and lies on its own start: every edge is consistent, the outline crosses.
        let mut p = Vec::new();
        let mut indices = Vec::new();
        for k in 0..8_u32 {
            let a = k as f32 * 1.0;
            p.push(v(a.cos(), a.sin()));
            p.push(v(2.0 * a.cos(), 2.0 * a.sin()));
            if k > 0 {
                let b = 2 * k;
                indices.extend([b - 2, b - 1, b + 1, b - 2, b + 1, b]);
            }
        }
        assert_eq!(outline(&p, &indices), Err(OutlineError::SelfIntersecting));
    }
}
