//! Which corners of triangles are one vertex: those that have one sample.
//!
//! Corners at the same position see the same of the world, whichever triangle they belong to, as long as one ray origin
//! serves them all: a little off the surface, on the front of every triangle. So corners are one vertex if they are at
//! the same place (equal coordinates) and their triangles' normals lie within a cone about their mean. A crease is one
//! vertex too, up to a right angle: its sample sees what is above either side. Both sides of a thin wall are two.

use glam::{DVec3, Vec3};

/// Smallest cosine between the normal of a triangle and the mean normal of the vertex: 60°. Three faces that meet at a
/// right angle are at 54.7° from their mean.
const MIN_COSINE: f64 = 0.5;

/// Normals this close to each other count as one: triangles of one plane, as `f32` vertices leave them.
const SAME_COSINE: f64 = 0.9999;

/// Normals of the triangles around a place, each direction once, so that the tessellation of a face does not matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fan {
    normals: Vec<DVec3>,
}

impl Fan {
    pub(crate) fn add(&mut self, normal: DVec3) {
        if !self.has(normal) {
            self.normals.push(normal);
        }
    }

    fn has(&self, normal: DVec3) -> bool {
        self.normals.iter().any(|n| n.dot(normal) > SAME_COSINE)
    }

    pub(crate) fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// The direction in the middle; none for no normals, or for opposite ones.
    pub(crate) fn mean(&self) -> Option<DVec3> {
        self.normals.iter().sum::<DVec3>().try_normalize()
    }

    /// Whether all normals lie within the cone also with this one.
    fn takes(&self, normal: DVec3) -> bool {
        if self.has(normal) {
            return true;
        }
        let with = || self.normals.iter().copied().chain([normal]);
        let mean: DVec3 = with().sum();
        // Opposite normals have no mean.
        let least = (MIN_COSINE * mean.length()).max(f64::MIN_POSITIVE);
        with().all(|n| n.dot(mean) >= least)
    }
}

/// Corners that are one vertex.
struct Cluster {
    fan: Fan,
    two_sided: bool,
    corners: Vec<u32>,
}

/// Vertex of each corner, numbered by first appearance.
pub(crate) fn weld(
    triangles: &[[Vec3; 3]],
    normals: &[Option<DVec3>],
    two_sided: &[bool],
) -> Vec<[u32; 3]> {
    // −0 and 0 are the same place.
    let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut corners: Vec<([u32; 3], u32)> = triangles
        .iter()
        .flatten()
        .enumerate()
        .map(|(i, &p)| (key(p), i as u32))
        .collect();
    corners.sort_unstable();
    // First corner of the vertex, for each corner.
    let mut first = vec![0_u32; corners.len()];
    for group in corners.chunk_by(|a, b| a.0 == b.0) {
        let mut clusters: Vec<Cluster> = Vec::new();
        let mut loose = Vec::new();
        for &(_, corner) in group {
            let t = corner as usize / 3;
            let Some(normal) = normals[t] else {
                loose.push(corner);
                continue;
            };
            let fits = clusters
                .iter_mut()
                .find(|c| c.two_sided == two_sided[t] && c.fan.takes(normal));
            if let Some(cluster) = fits {
                cluster.fan.add(normal);
                cluster.corners.push(corner);
            } else {
                let mut fan = Fan::default();
                fan.add(normal);
                clusters.push(Cluster {
                    fan,
                    two_sided: two_sided[t],
                    corners: vec![corner],
                });
            }
        }
        // A triangle without area is never drawn: its corners go with any vertex there.
        match clusters.first_mut() {
            Some(cluster) => cluster.corners.extend(loose),
            None => {
                for &corner in &loose {
                    first[corner as usize] = loose[0];
                }
            }
        }
        for cluster in &clusters {
            let lowest = cluster.corners.iter().copied().min().unwrap_or_default();
            for &corner in &cluster.corners {
                first[corner as usize] = lowest;
            }
        }
    }
    let mut number = vec![u32::MAX; corners.len()];
    let mut next = 0;
    let mut vertex = |corner: usize| {
        let n = &mut number[first[corner] as usize];
        if *n == u32::MAX {
            *n = next;
            next += 1;
        }
        *n
    };
    (0..triangles.len())
        .map(|t| [0, 1, 2].map(|k| vertex(3 * t + k)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(t: &[Vec3; 3]) -> Option<DVec3> {
        let [a, b, c] = t.map(|v| v.as_dvec3());
        (b - a).cross(c - a).try_normalize()
    }

    fn welded(triangles: &[[Vec3; 3]], two_sided: bool) -> Vec<[u32; 3]> {
        let normals: Vec<_> = triangles.iter().map(unit).collect();
        weld(triangles, &normals, &vec![two_sided; triangles.len()])
    }

    fn cube() -> Vec<[Vec3; 3]> {
        let mut triangles = Vec::new();
        for axis in 0..3 {
            for side in [-1.0_f32, 1.0] {
                let corner = |s: f32, t: f32| {
                    let mut p = Vec3::ZERO;
                    p[axis] = side;
                    p[(axis + 1) % 3] = s * side;
                    p[(axis + 2) % 3] = t;
                    p
                };
                let [a, b, c, d] = [
                    corner(-1.0, -1.0),
                    corner(1.0, -1.0),
                    corner(1.0, 1.0),
                    corner(-1.0, 1.0),
                ];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        triangles
    }

    #[test]
    fn a_cube_has_eight_vertices_and_a_leaf_has_two_sides() {
        let triangles = cube();
        for t in &triangles {
            let middle = (t[0] + t[1] + t[2]).as_dvec3();
            assert!(
                unit(t).unwrap().dot(middle) > 0.0,
                "the test's cube is inside out"
            );
        }
        let vertices = welded(&triangles, false);
        assert_eq!(vertices.iter().flatten().max(), Some(&7));
        // Seen from inside it is the same; the numbers are those of first appearance.
        assert_eq!(vertices[0], [0, 1, 2]);

        // Back to back: nothing is shared.
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let sheet = [[a, b, c], [a, c, b]];
        assert_eq!(welded(&sheet, false), vec![[0, 1, 2], [3, 4, 5]]);
        // Side by side: all on the diagonal.
        let quad = [[a, b, c], [c, b, Vec3::new(1.0, 1.0, 0.0)]];
        assert_eq!(welded(&quad, false), vec![[0, 1, 2], [2, 1, 3]]);
    }

    #[test]
    fn negative_zero_is_zero_and_degenerate_triangles_share() {
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let triangles = [
            [a, b, c],
            [Vec3::new(-0.0, 0.0, -0.0), c, -Vec3::X],
            [a, a, b],
            [Vec3::splat(9.0); 3],
        ];
        assert_eq!(
            welded(&triangles, false),
            vec![[0, 1, 2], [0, 2, 3], [0, 0, 1], [4, 4, 4]]
        );
    }
}
