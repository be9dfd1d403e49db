//! Shapes of the scenes as indexed triangles, front faces counter-clockwise.

use super::vec3::{self, Vec3};

/// Indexed triangles. `positions`, `normals` and (where there are any) `uvs` have one entry per vertex.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub uvs: Vec<[f64; 2]>,
    pub indices: Vec<u16>,
}

impl Mesh {
    /// Appends a planar convex polygon, triangulated as a fan from its first corner, facing the side from which
    /// `corners` run counter-clockwise.
    fn push_polygon(&mut self, corners: &[Vec3]) {
        // At most 2^16 - 1 vertices: 65535 would be the primitive restart value.
        let first =
            u16::try_from(self.positions.len()).expect("a shape has fewer than 65535 vertices");
        let normal = vec3::normalize(vec3::cross(
            vec3::sub(corners[1], corners[0]),
            vec3::sub(corners[2], corners[0]),
        ));
        self.positions.extend_from_slice(corners);
        self.normals.extend(corners.iter().map(|_| normal));
        for i in 1..corners.len() as u16 - 1 {
            self.indices.extend([first, first + i, first + i + 1]);
        }
    }
}

/// Planar convex polygon, see [`Mesh::push_polygon`].
pub fn polygon(corners: &[Vec3]) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.push_polygon(corners);
    mesh
}

/// Polygon given by its corners in the plane (`x` to the right and `y` up when seen from the front), placed so that
/// its origin lies at `center` and its front looks along `facing`.
pub fn panel(center: Vec3, facing: Vec3, outline: &[[f64; 2]]) -> Mesh {
    let [right, up, _] = vec3::frame(facing);
    let corners: Vec<Vec3> = outline
        .iter()
        .map(|[x, y]| {
            vec3::add(
                center,
                vec3::add(vec3::scale(right, *x), vec3::scale(up, *y)),
            )
        })
        .collect();
    polygon(&corners)
}

/// Outline of a rectangle, counter-clockwise from the lower left corner.
pub fn rectangle(width: f64, height: f64) -> Vec<[f64; 2]> {
    let (x, y) = (0.5 * width, 0.5 * height);
    vec![[-x, -y], [x, -y], [x, y], [-x, y]]
}

/// Outline of a regular polygon with its first corner at the top, counter-clockwise.
pub fn regular(corner_count: u32, circumradius: f64) -> Vec<[f64; 2]> {
    (0..corner_count)
        .map(|i| {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(corner_count);
            [-circumradius * angle.sin(), circumradius * angle.cos()]
        })
        .collect()
}

/// Gives a rectangle made by [`panel`] the texture coordinates under which an image stands upright when seen from the
/// front (glTF: `v` runs downwards from the image's first row).
pub fn with_rectangle_uvs(mut mesh: Mesh) -> Mesh {
    assert_eq!(
        mesh.positions.len(),
        4,
        "texture coordinates of a rectangle"
    );
    mesh.uvs = vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    mesh
}

/// Axis-aligned box with outward faces.
pub fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let corner = |i: usize| -> Vec3 {
        std::array::from_fn(|axis| {
            if i >> axis & 1 == 0 {
                min[axis]
            } else {
                max[axis]
            }
        })
    };
    let mut mesh = Mesh::default();
    // Corner numbers have bit 0 for +x, bit 1 for +y, bit 2 for +z.
    for face in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
    ] {
        mesh.push_polygon(&face.map(corner));
    }
    mesh
}

/// Unit sphere around the origin with `segments` around the Y axis and `rings` from pole to pole; its normals are its
/// positions.
pub fn unit_sphere(segments: u16, rings: u16) -> Mesh {
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        // Exactly zero at the poles, so that their vertices coincide.
        let radius = if ring == 0 || ring == rings {
            0.0
        } else {
            polar.sin()
        };
        for segment in 0..segments {
            let azimuth = std::f64::consts::TAU * f64::from(segment) / f64::from(segments);
            mesh.positions
                .push([radius * azimuth.sin(), polar.cos(), radius * azimuth.cos()]);
        }
    }
    mesh.normals = mesh.positions.clone();
    for ring in 0..rings {
        for segment in 0..segments {
            let next = (segment + 1) % segments;
            let (a, b) = (ring * segments + segment, ring * segments + next);
            let (c, d) = (a + segments, b + segments);
            // The quads at the poles are triangles: their other half has no area.
            if ring + 1 != rings {
                mesh.indices.extend([a, c, d]);
            }
            if ring != 0 {
                mesh.indices.extend([a, d, b]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume enclosed by a closed mesh; positive when its triangles are counter-clockwise from outside.
    fn volume(mesh: &Mesh) -> f64 {
        triangles(mesh)
            .map(|[a, b, c]| vec3::dot(a, vec3::cross(b, c)) / 6.0)
            .sum()
    }

    fn triangles(mesh: &Mesh) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        mesh.indices
            .chunks_exact(3)
            .map(|t| [0, 1, 2].map(|i| mesh.positions[usize::from(t[i])]))
    }

    #[test]
    fn solids_are_closed_and_face_outwards() {
        let box_volume = volume(&cuboid([-1.0, 0.0, 2.0], [1.0, 3.0, 2.5]));
        assert!((box_volume - 3.0).abs() < 1e-12, "{box_volume}");
        let sphere = unit_sphere(96, 48);
        let exact = 4.0 / 3.0 * std::f64::consts::PI;
        assert!(
            (volume(&sphere) / exact - 1.0).abs() < 0.005,
            "{}",
            volume(&sphere)
        );
        for [a, b, c] in triangles(&sphere) {
            let normal = vec3::cross(vec3::sub(b, a), vec3::sub(c, a));
            assert!(
                vec3::dot(normal, a) > 0.0,
                "a triangle without area or facing inwards at {a:?}"
            );
        }
        let mut turned = cuboid([-1.0; 3], [1.0; 3]);
        turned.indices.swap(1, 2);
        assert!(
            (volume(&turned) - 8.0).abs() > 0.1,
            "a turned triangle has to show in the volume"
        );
    }

    #[test]
    fn panels_face_where_they_are_told() {
        let facing = vec3::normalize([0.3, -0.8, 0.5]);
        for outline in [rectangle(2.0, 1.0), regular(3, 1.0), regular(6, 1.0)] {
            let mesh = panel([1.0, 2.0, 3.0], facing, &outline);
            for normal in &mesh.normals {
                assert!(vec3::dot(*normal, facing) > 1.0 - 1e-12, "{normal:?}");
            }
        }
    }
}
