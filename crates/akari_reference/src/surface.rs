//! A shading point: frame, BRDF, emission.

use glam::Vec3;

use crate::bsdf::Bsdf;
use crate::ray_scene::{Hit, Ray};
use crate::world::World;

/// Smallest cosine of the view direction to the shading normal; interpolated normals may point away from the
/// viewer, where no BRDF is defined.
const MIN_VIEW_COS: f32 = 1e-4;

/// Everything that shading needs at a hit.
pub(crate) struct Surface {
    pub(crate) position: Vec3,
    /// Towards the viewer.
    pub(crate) geometric_normal: Vec3,
    /// Shading normal, towards the viewer.
    pub(crate) normal: Vec3,
    tangent: Vec3,
    bitangent: Vec3,
    pub(crate) bsdf: Bsdf,
    /// Direction to the viewer in the shading frame.
    pub(crate) view: Vec3,
    /// How far new rays start off the surface.
    pub(crate) offset: f32,
    pub(crate) albedo: Vec3,
    pub(crate) roughness: f32,
    /// Takes no part in light transport.
    pub(crate) unlit: bool,
}

impl Surface {
    pub(crate) fn new(world: &World, ray: &Ray, hit: &Hit) -> Self {
        let vertex = world.vertex(hit);
        let material = world.owner(hit.triangle).0.material;
        let (u, v) = (hit.u, hit.v);
        let to_viewer = -ray.direction;

        let mut normal = vertex.normal;
        if let (Some(texture), Some(tangent)) = (&material.normal_texture, vertex.tangent) {
            let texel = world.texture(hit.triangle, Some(texture), u, v).truncate() * 2.0 - 1.0;
            let t = tangent.truncate();
            let b = tangent.w * normal.cross(t);
            let scale = material.normal_scale;
            normal = (scale * texel.x * t + scale * texel.y * b + texel.z * normal)
                .normalize_or(vertex.normal);
        }
        // The back shades like the front.
        let back = vertex.geometric_normal.dot(to_viewer) < 0.0;
        let side = if back { -1.0 } else { 1.0 };
        let geometric_normal = side * vertex.geometric_normal;
        normal *= side;
        let cos = normal.dot(to_viewer);
        if cos < MIN_VIEW_COS {
            normal = (normal + (MIN_VIEW_COS - cos) * to_viewer).normalize_or(geometric_normal);
        }
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let view = Vec3::new(
            to_viewer.dot(tangent),
            to_viewer.dot(bitangent),
            to_viewer.dot(normal).max(MIN_VIEW_COS),
        )
        .normalize();

        let albedo = world.base_color(hit.triangle, u, v).truncate();
        let metallic_roughness = world.texture(
            hit.triangle,
            material.metallic_roughness_texture.as_ref(),
            u,
            v,
        );
        let roughness = material.roughness * metallic_roughness.y;
        let specular = material.specular
            * world
                .texture(hit.triangle, material.specular_texture.as_ref(), u, v)
                .w;
        let specular_color = material.specular_color
            * world
                .texture(hit.triangle, material.specular_color_texture.as_ref(), u, v)
                .truncate();
        Self {
            position: vertex.position,
            geometric_normal,
            normal,
            tangent,
            bitangent,
            bsdf: Bsdf::new(
                albedo,
                material.metallic * metallic_roughness.z,
                roughness,
                specular,
                specular_color,
                material.ior,
            ),
            view,
            offset: vertex.offset,
            albedo,
            roughness,
            unlit: material.unlit,
        }
    }

    pub(crate) fn to_local(&self, d: Vec3) -> Vec3 {
        Vec3::new(
            d.dot(self.tangent),
            d.dot(self.bitangent),
            d.dot(self.normal),
        )
    }

    pub(crate) fn to_world(&self, d: Vec3) -> Vec3 {
        d.x * self.tangent + d.y * self.bitangent + d.z * self.normal
    }

    /// A ray that leaves the surface on its viewer's side.
    pub(crate) fn leave(&self, direction: Vec3, tmax: f32) -> Ray {
        Ray {
            origin: self.position + self.offset * self.geometric_normal,
            direction,
            tmin: self.offset,
            tmax,
        }
    }
}
