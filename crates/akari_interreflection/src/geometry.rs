//! Meshes of reflectors as triangles of the world, and diffuse ones cut into patches.

use crate::types::{FLAG_TWO_SIDED, GpuCluster, GpuReflectorMaterial, GpuTriangle};
use akari_math::area_light::surface_reflectance;
use bevy::math::{Affine3A, Vec3A};
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;

/// Why a mesh reflects nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReflectorFault {
    /// Its data are on the GPU only.
    NotOnCpu,
    /// It has no positions of three 32-bit floats.
    NoPositions,
    /// It is not a list of triangles.
    NoTriangles,
}

impl std::fmt::Display for ReflectorFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NotOnCpu => {
                "its vertices were kept on the GPU only; load it with RenderAssetUsages::MAIN_WORLD, too"
            }
            Self::NoPositions => "it has no vertex positions of three 32-bit floats",
            Self::NoTriangles => "it is not a list of triangles",
        })
    }
}

/// Triangles of a mesh in its own space: corners, and normals there.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReflectorMesh {
    /// Corners and normals of each triangle.
    pub triangles: Vec<([Vec3; 3], [Vec3; 3])>,
    /// Triangles that were left out: without area, or not finite.
    pub dropped: u32,
}

impl ReflectorMesh {
    /// The triangles of a mesh.
    ///
    /// # Errors
    /// Why there are none.
    pub fn new(mesh: &Mesh) -> Result<Self, ReflectorFault> {
        let floats = |id| match mesh.try_attribute_option(id) {
            Err(_) => Err(ReflectorFault::NotOnCpu),
            Ok(Some(VertexAttributeValues::Float32x3(values))) => Ok(Some(values)),
            Ok(_) => Ok(None),
        };
        let positions = floats(Mesh::ATTRIBUTE_POSITION)?.ok_or(ReflectorFault::NoPositions)?;
        let normals = floats(Mesh::ATTRIBUTE_NORMAL)?;
        let indices = mesh
            .try_indices_option()
            .map_err(|_| ReflectorFault::NotOnCpu)?;
        if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
            return Err(ReflectorFault::NoTriangles);
        }
        let indices: Vec<usize> = match indices {
            Some(Indices::U16(indices)) => indices.iter().map(|&i| usize::from(i)).collect(),
            Some(Indices::U32(indices)) => indices.iter().map(|&i| i as usize).collect(),
            None => (0..positions.len()).collect(),
        };
        let mut result = Self::default();
        for corners in indices.as_chunks::<3>().0 {
            let at = |i: usize| positions.get(i).copied().map(Vec3::from);
            let [Some(a), Some(b), Some(c)] = corners.map(at) else {
                result.dropped += 1;
                continue;
            };
            let area = (b - a).cross(c - a);
            if !(area.is_finite() && area.length_squared() > 0.0) {
                result.dropped += 1;
                continue;
            }
            let face = area.normalize();
            let normal = |i: usize| {
                normals
                    .and_then(|normals| normals.get(i))
                    .map_or(face, |normal| Vec3::from(*normal).normalize_or(face))
            };
            result.triangles.push(([a, b, c], corners.map(normal)));
        }
        Ok(result)
    }
}

/// How a material reflects: its factors, not its textures. `None` if it takes no part (unlit, see-through).
pub fn reflector_material(material: &StandardMaterial) -> Option<GpuReflectorMaterial> {
    let opaque = matches!(
        material.alpha_mode,
        AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage
    );
    if !opaque || material.unlit || material.specular_transmission > 0.0 {
        return None;
    }
    let base_color = material.base_color.to_linear().to_vec3();
    let values = [
        material.metallic,
        material.reflectance,
        material.perceptual_roughness,
    ];
    if !base_color.is_finite() || values.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let [metallic, reflectance, roughness] = values.map(|value| value.clamp(0.0, 1.0));
    let surface = surface_reflectance(
        base_color.clamp(Vec3::ZERO, Vec3::ONE),
        metallic,
        reflectance,
    );
    Some(GpuReflectorMaterial {
        diffuse_color: surface.diffuse_color,
        // Bevy's floor, below which its own lighting does not go either.
        perceptual_roughness: roughness.max(MIN_PERCEPTUAL_ROUGHNESS),
        normal_reflectance: surface.normal_reflectance,
        grazing_reflectance: surface.grazing_reflectance,
        dielectric_normal_reflectance: surface.dielectric_normal_reflectance,
        dielectric_grazing_reflectance: surface.dielectric_grazing_reflectance,
    })
}

/// Bevy's smallest perceptual roughness.
const MIN_PERCEPTUAL_ROUGHNESS: f32 = 0.089;

/// Whether a material reflects diffusely.
pub fn is_diffuse(material: &GpuReflectorMaterial) -> bool {
    material.diffuse_color.max_element() > 0.0
}

/// Whether a material has a specular lobe.
pub fn is_glossy(material: &GpuReflectorMaterial) -> bool {
    material.grazing_reflectance > 0.0 || material.normal_reflectance.max_element() > 0.0
}

/// Half of what `FLAT` is in `receiver.wgsl`, so that the GPU finds no triangle to bend that is not found here.
const FLAT: f32 = 0.5e-5;

/// Whether normals turn from one side of a triangle to the other.
pub fn bends(triangle: &GpuTriangle) -> bool {
    let face = (triangle.b - triangle.a).cross(triangle.c - triangle.a);
    let face = face.normalize_or_zero();
    [triangle.normal_a, triangle.normal_b, triangle.normal_c]
        .iter()
        .any(|normal| 1.0 - face.dot(*normal) > FLAT)
}

impl GpuCluster {
    /// Whether normals turn from one side of its rectangle to the other.
    pub fn bends(&self) -> bool {
        0.5 * (self.bend_u.length_squared()).max(self.bend_v.length_squared()) > FLAT
    }
}

/// A triangle of a mesh in the world. `None` if nothing is left of it there.
pub fn place_triangle(
    corners: &[Vec3; 3],
    normals: &[Vec3; 3],
    transform: &Affine3A,
    material: u32,
    two_sided: bool,
) -> Option<GpuTriangle> {
    let [a, mut b, mut c] = corners.map(|corner| transform.transform_point3(corner));
    let normal_matrix = transform.matrix3.inverse().transpose();
    // A mirrored placement turns the winding over, and the front with it: Bevy swaps it back.
    let mirrored = transform.matrix3.determinant() < 0.0;
    let [normal_a, mut normal_b, mut normal_c] = *normals;
    if mirrored {
        (b, c) = (c, b);
        (normal_b, normal_c) = (normal_c, normal_b);
    }
    let area = (b - a).cross(c - a);
    let face = area.try_normalize()?;
    let placed = |normal: Vec3| Vec3::from(normal_matrix * Vec3A::from(normal)).normalize_or(face);
    Some(GpuTriangle {
        a,
        material,
        b,
        flags: if two_sided { FLAG_TWO_SIDED } else { 0 },
        c,
        pad: 0,
        normal_a: placed(normal_a),
        normal_b: placed(normal_b),
        normal_c: placed(normal_c),
    })
}

/// Cuts a triangle into halves at its longest edge until `fine` says so, at most `levels` times.
pub fn split(
    triangle: GpuTriangle,
    levels: u32,
    fine: &impl Fn(&GpuTriangle, f32) -> bool,
    patches: &mut Vec<GpuTriangle>,
) {
    let GpuTriangle {
        a,
        b,
        c,
        normal_a,
        normal_b,
        normal_c,
        ..
    } = triangle;
    let edges = [a.distance(b), b.distance(c), c.distance(a)];
    let longest = edges.iter().copied().fold(0.0, f32::max);
    if levels == 0 || fine(&triangle, longest) {
        patches.push(triangle);
        return;
    }
    let middle = |p: Vec3, q: Vec3| (p + q) * 0.5;
    let between = |p: Vec3, q: Vec3| (p + q).normalize_or(p);
    // Turned so that the longest edge goes from the first corner to the second.
    let [(p, np), (q, nq), (r, nr)] = if edges[0] == longest {
        [(a, normal_a), (b, normal_b), (c, normal_c)]
    } else if edges[1] == longest {
        [(b, normal_b), (c, normal_c), (a, normal_a)]
    } else {
        [(c, normal_c), (a, normal_a), (b, normal_b)]
    };
    let (m, nm) = (middle(p, q), between(np, nq));
    for [(a, normal_a), (b, normal_b), (c, normal_c)] in
        [[(p, np), (m, nm), (r, nr)], [(m, nm), (q, nq), (r, nr)]]
    {
        let half = GpuTriangle {
            a,
            b,
            c,
            normal_a,
            normal_b,
            normal_c,
            ..triangle
        };
        split(half, levels - 1, fine, patches);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> GpuTriangle {
        GpuTriangle {
            b: Vec3::X * 2.0,
            c: Vec3::Y,
            normal_a: Vec3::Z,
            normal_b: Vec3::Z,
            normal_c: Vec3::Z,
            ..GpuTriangle::default()
        }
    }

    fn area(triangle: &GpuTriangle) -> Vec3 {
        (triangle.b - triangle.a).cross(triangle.c - triangle.a) * 0.5
    }

    #[test]
    fn patches_cover_the_triangle_once() {
        let mut patches = Vec::new();
        split(triangle(), 20, &|_, longest| longest < 0.3, &mut patches);
        let sum: Vec3 = patches.iter().map(area).sum();
        assert!(sum.abs_diff_eq(area(&triangle()), 1e-5), "{sum}");
        assert!(patches.len() > 20);
        assert!(patches.iter().all(|patch| area(patch).z > 0.0), "winding");
        let mut capped = Vec::new();
        split(triangle(), 3, &|_, _| false, &mut capped);
        assert_eq!(capped.len(), 8);
    }

    #[test]
    fn bad_triangles_are_dropped_and_counted() {
        let mesh = Mesh::new(
            PrimitiveTopology::TriangleList,
            bevy::asset::RenderAssetUsages::default(),
        )
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_POSITION,
            vec![
                [0.0f32, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [f32::NAN, 0.0, 0.0],
            ],
        )
        .with_inserted_indices(Indices::U32(vec![0, 1, 2, 0, 1, 1, 0, 1, 3, 0, 1, 99]));
        let reflector = ReflectorMesh::new(&mesh).expect("a list of triangles");
        assert_eq!((reflector.triangles.len(), reflector.dropped), (1, 3));
        assert_eq!(reflector.triangles[0].1, [Vec3::Z; 3], "the face's normal");
        let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let (corners, normals) = reflector.triangles[0];
        let placed = place_triangle(&corners, &normals, &mirror, 0, false).expect("an area");
        assert!(area(&placed).z > 0.0, "a mirrored mesh keeps its front");
        let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
        assert_eq!(place_triangle(&corners, &normals, &flat, 0, false), None);
    }

    #[test]
    fn materials_are_told_apart() {
        let lambert = StandardMaterial {
            reflectance: 0.0,
            ..StandardMaterial::default()
        };
        let lambert = reflector_material(&lambert).expect("opaque");
        assert!(is_diffuse(&lambert) && !is_glossy(&lambert));
        let metal = StandardMaterial {
            metallic: 1.0,
            ..StandardMaterial::default()
        };
        let metal = reflector_material(&metal).expect("opaque");
        assert!(!is_diffuse(&metal) && is_glossy(&metal));
        let glass = StandardMaterial {
            alpha_mode: AlphaMode::Blend,
            ..StandardMaterial::default()
        };
        assert_eq!(reflector_material(&glass), None);
    }
}
