//! Which emissive primitives are polygonal area lights, and why the others are not.

use glam::{DVec2, DVec3, Vec2, Vec3};

use crate::outline::{OutlineError, outline};
use crate::texture::Texture;
use crate::types::Scene;

/// Largest difference between a vertex's uv and the affine map through all of them.
const UV_TOLERANCE: f64 = 1e-3;

/// An emissive planar primitive as one polygon in world space.
#[derive(Clone, Debug)]
pub struct LightPolygon {
    /// Corners, 3 to 16, metres, counter-clockwise seen from the emitting side.
    pub vertices: Vec<Vec3>,
    /// Linear radiance, nits, before the texture.
    pub radiance: Vec3,
    /// Emits from both sides.
    pub double_sided: bool,
    /// Multiplies `radiance`.
    pub texture: Option<Texture>,
    /// Where the texture lies, if there is one.
    pub uv: Option<UvMap>,
}

/// The affine map from world positions in the light's plane to vertex texture coordinates (before
/// [`Texture::transform`](crate::Texture)): `uv(p) = uv_at_origin + (du·(p − origin), dv·(p − origin))`.
#[derive(Clone, Copy, Debug)]
pub struct UvMap {
    /// A point of the plane.
    pub origin: Vec3,
    /// Texture coordinates there.
    pub uv_at_origin: Vec2,
    /// Gradient of u, 1/m, in the plane.
    pub du: Vec3,
    /// Gradient of v, 1/m, in the plane.
    pub dv: Vec3,
}

impl UvMap {
    /// Texture coordinates at `p`.
    pub fn uv(&self, p: Vec3) -> Vec2 {
        let d = p - self.origin;
        self.uv_at_origin + Vec2::new(self.du.dot(d), self.dv.dot(d))
    }
}

/// Why an emissive primitive is no polygonal area light.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LightPolygonRejection {
    /// The shape does not fit.
    #[error("{0}")]
    Outline(#[from] OutlineError),
    /// The emissive texture has nothing to be placed by.
    #[error("its emissive texture has no texture coordinates")]
    NoUv,
    /// The texture is bent over the polygon.
    #[error("its texture coordinates are no affine map of the position (off by {0:.1e})")]
    UvNotAffine(f64),
}

/// An emissive primitive of the scene with the verdict.
#[derive(Clone, Debug)]
pub struct LightPolygonCandidate {
    /// Node and mesh, for messages.
    pub name: String,
    /// Index into [`Scene::instances`].
    pub instance: usize,
    /// Index into the mesh's primitives.
    pub primitive: usize,
    /// The polygon, or why there is none.
    pub result: Result<LightPolygon, LightPolygonRejection>,
}

/// All emissive primitives of the scene, in order of instances, each with its polygon or the reason why it has
/// none. Such primitives still light the scene as meshes.
pub fn light_polygons(scene: &Scene) -> Vec<LightPolygonCandidate> {
    let mut candidates = Vec::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh];
        for (j, primitive) in mesh.primitives.iter().enumerate() {
            let material = &scene.materials[primitive.material];
            if !material.is_emissive() {
                continue;
            }
            candidates.push(LightPolygonCandidate {
                name: format!("{} / {} primitive {j}", instance.name, mesh.name),
                instance: i,
                primitive: j,
                result: polygon_of(scene, i, j),
            });
        }
    }
    candidates
}

fn polygon_of(
    scene: &Scene,
    instance: usize,
    primitive: usize,
) -> Result<LightPolygon, LightPolygonRejection> {
    let instance = &scene.instances[instance];
    let primitive = &scene.meshes[instance.mesh].primitives[primitive];
    let material = &scene.materials[primitive.material];
    let positions: Vec<Vec3> = primitive
        .positions
        .iter()
        .map(|p| {
            instance
                .world_from_local
                .transform_point3(p.as_dvec3())
                .as_vec3()
        })
        .collect();
    let mut vertices = outline(&positions, &primitive.indices)?;
    // A mirroring transform turns the winding, but not which side is the front.
    if instance.world_from_local.matrix3.determinant() < 0.0 {
        vertices.reverse();
    }
    let uv = match &material.emissive_texture {
        None => None,
        Some(texture) => {
            let uvs = &primitive.uvs[texture.tex_coord];
            if uvs.len() != positions.len() {
                return Err(LightPolygonRejection::NoUv);
            }
            let used: Vec<(DVec3, DVec2)> = primitive
                .indices
                .iter()
                .map(|&i| (positions[i as usize].as_dvec3(), uvs[i as usize].as_dvec2()))
                .collect();
            Some(fit_uv(&vertices, &used)?)
        }
    };
    Ok(LightPolygon {
        vertices,
        radiance: material.emission,
        double_sided: material.double_sided,
        texture: material.emissive_texture.clone(),
        uv,
    })
}

/// Least-squares affine map of `points` in the plane of `vertices`.
fn fit_uv(vertices: &[Vec3], points: &[(DVec3, DVec2)]) -> Result<UvMap, LightPolygonRejection> {
    let origin = vertices[0].as_dvec3();
    let normal = (1..vertices.len() - 1)
        .map(|i| (vertices[i].as_dvec3() - origin).cross(vertices[i + 1].as_dvec3() - origin))
        .sum::<DVec3>()
        .normalize_or(DVec3::Z);
    let (x_axis, y_axis) = normal.any_orthonormal_pair();
    let flat = |p: DVec3| DVec2::new((p - origin).dot(x_axis), (p - origin).dot(y_axis));

    let count = points.len() as f64;
    let mean_xy = points.iter().map(|(p, _)| flat(*p)).sum::<DVec2>() / count;
    let mean_uv = points.iter().map(|(_, uv)| *uv).sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let (mut ux, mut uy) = (DVec2::ZERO, DVec2::ZERO);
    for (p, uv) in points {
        let d = flat(*p) - mean_xy;
        let e = *uv - mean_uv;
        xx += d.x * d.x;
        xy += d.x * d.y;
        yy += d.y * d.y;
        ux += e * d.x;
        uy += e * d.y;
    }
    // The outline has an area, so the points are not collinear and the determinant is positive.
    let determinant = xx * yy - xy * xy;
    if determinant <= 0.0 {
        return Err(OutlineError::ZeroArea.into());
    }
    let by_x = (ux * yy - uy * xy) / determinant;
    let by_y = (uy * xx - ux * xy) / determinant;
    let uv_at_origin = mean_uv - by_x * mean_xy.x - by_y * mean_xy.y;
    let residual = points
        .iter()
        .map(|(p, uv)| {
            let d = flat(*p);
            (uv_at_origin + by_x * d.x + by_y * d.y - *uv)
                .abs()
                .max_element()
        })
        .fold(0.0, f64::max);
    // Written so that NaN coordinates fail, too.
    if !(residual <= UV_TOLERANCE) {
        return Err(LightPolygonRejection::UvNotAffine(residual));
    }
    Ok(UvMap {
        origin: vertices[0],
        uv_at_origin: uv_at_origin.as_vec2(),
        du: (by_x.x * x_axis + by_y.x * y_axis).as_vec3(),
        dv: (by_x.y * x_axis + by_y.y * y_axis).as_vec3(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{ColorSpace, Filter, Wrap};
    use crate::types::{Instance, Material, Mesh, Primitive};
    use glam::{Affine2, DAffine3, DQuat};

    fn scene(scale: DVec3) -> Scene {
        let texture = Texture {
            image: 0,
            color_space: ColorSpace::Srgb,
            tex_coord: 0,
            transform: Affine2::IDENTITY,
            wrap_u: Wrap::Clamp,
            wrap_v: Wrap::Clamp,
            filter: Filter::Linear,
        };
        Scene {
            materials: vec![Material {
                emission: Vec3::splat(5.0),
                emissive_texture: Some(texture),
                ..Default::default()
            }],
            meshes: vec![Mesh {
                name: "panel".into(),
                primitives: vec![Primitive {
                    positions: vec![
                        Vec3::new(-1., -1., 0.),
                        Vec3::new(1., -1., 0.),
                        Vec3::new(1., 1., 0.),
                        Vec3::new(-1., 1., 0.),
                    ],
                    uvs: [
                        vec![Vec2::new(0., 1.), Vec2::ONE, Vec2::X, Vec2::ZERO],
                        vec![],
                    ],
                    indices: vec![0, 1, 2, 0, 2, 3],
                    ..Default::default()
                }],
            }],
            instances: vec![Instance {
                name: "lamp".into(),
                mesh: 0,
                world_from_local: DAffine3::from_scale_rotation_translation(
                    scale,
                    DQuat::from_rotation_x(0.7),
                    DVec3::new(3., 4., 5.),
                ),
            }],
            ..Default::default()
        }
    }

    #[test]
    fn textured_panel() {
        for mirror in [1.0, -1.0] {
            let scene = scene(DVec3::new(mirror * 2.0, 0.5, 1.0));
            let found = light_polygons(&scene);
            assert_eq!(found.len(), 1);
            let polygon = found[0].result.as_ref().unwrap();
            let map = polygon.uv.unwrap();
            let primitive = &scene.meshes[0].primitives[0];
            for (p, uv) in primitive.positions.iter().zip(&primitive.uvs[0]) {
                let world = scene.instances[0]
                    .world_from_local
                    .transform_point3(p.as_dvec3())
                    .as_vec3();
                assert!((map.uv(world) - *uv).abs().max_element() < 1e-5);
            }
            // The front stays the front: normal of the outline = transformed +Z, also when mirrored.
            let v = &polygon.vertices;
            let normal = (v[1] - v[0]).cross(v[2] - v[0]).normalize();
            let expected = DQuat::from_rotation_x(0.7) * DVec3::Z;
            assert!((normal - expected.as_vec3()).length() < 1e-5, "{normal}");
        }
    }

    #[test]
    fn bent_texture_is_refused() {
        let mut scene = scene(DVec3::ONE);
        scene.meshes[0].primitives[0].uvs[0][2] = Vec2::new(0.7, 0.2);
        assert!(matches!(
            light_polygons(&scene)[0].result,
            Err(LightPolygonRejection::UvNotAffine(_))
        ));
        scene.meshes[0].primitives[0].uvs[0].clear();
        assert_eq!(
            light_polygons(&scene)[0].result.as_ref().unwrap_err(),
            &LightPolygonRejection::NoUv
        );
    }
}
