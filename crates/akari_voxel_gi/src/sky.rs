//! Light from beside all voxels: environment maps and ambient light, and the interiors that it does not reach.

use crate::EFFECT;
use crate::buffers::encoded;
use akari_render::prelude::*;
pub use akari_render::sky::{Sky, SkyMap, has_map};
use akari_render::sky::{last_level, loaded};
use bevy::math::{Affine3A, DMat3, DVec3};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::RenderDevice;
use bevy::render::texture::GpuImage;

/// Most interiors that count; beyond it those nearest to the camera do.
pub const MOST_INTERIORS: usize = 16;

/// A box that no sky shines into and that no light leaves: what is within gathers light of what is within, and the sky is
/// cut off. Direct light of lamps, and of the sun through a window, comes in as ever.
///
/// The box is the cube of edge 1 about the entity's origin, as its [`Transform`] places, turns and scales it. It should end
/// within the walls of a room: then light does not leak through them however thin they are, and the sky that a camera in
/// the room cannot see does not shine in where the clipmap ends. Boxes that overlap are one room. At most
/// [`MOST_INTERIORS`], those nearest to the camera.
#[derive(Component, Debug, Default, Clone, Copy, Reflect)]
#[reflect(Component, Default, Debug, Clone)]
#[require(Transform)]
pub struct VoxelGiInterior;

/// The interiors of the scene, those nearest to the camera first. Empty while the effect is idle.
#[derive(Resource, Debug, Default, PartialEq)]
pub struct VoxelInteriors(pub Vec<Affine3A>);

/// Field by field as `VoxelInterior` in `sky.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuVoxelInterior {
    /// Row of the transform from positions relative to the anchor into the box.
    pub x_row: Vec4,
    /// Row of it.
    pub y_row: Vec4,
    /// Row of it.
    pub z_row: Vec4,
}

/// Field by field as `VoxelSurroundings` in `sky.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuVoxelSurroundings {
    /// Radiance from everywhere, nits.
    pub ambient: Vec3,
    /// Nits per unit of the map.
    pub intensity: f32,
    /// Quaternion that turns directions of the world into those of the map.
    pub rotation: Vec4,
    /// Level of the map that is filtered for a roughness of 1.
    pub last_level: f32,
    /// Interiors that count.
    pub interior_count: u32,
    /// Lights that metal mirrors.
    pub light_count: u32,
    /// 1 where it mirrors what voxels reflect, too: one more bounce.
    pub mirrors_voxels: u32,
    /// The interiors.
    pub interiors: [GpuVoxelInterior; MOST_INTERIORS],
}

/// Takes the interiors to the render world.
pub fn extract_interiors(
    mut target: ResMut<VoxelInteriors>,
    interiors: Extract<Query<&GlobalTransform, With<VoxelGiInterior>>>,
    cameras: Extract<Query<&GlobalTransform, With<crate::settings::VoxelGi>>>,
    report: Extract<Res<EffectReport>>,
    mut warned: Local<bool>,
) {
    let mut found: Vec<Affine3A> = if report.is_active(EFFECT) {
        interiors.iter().map(GlobalTransform::affine).collect()
    } else {
        Vec::new()
    };
    // A box without a volume holds nothing.
    found.retain(|affine| affine.is_finite() && affine.matrix3.determinant() != 0.0);
    if found.len() > MOST_INTERIORS {
        if !std::mem::replace(&mut *warned, true) {
            warn!(
                "voxel GI: {} interiors, of which the {MOST_INTERIORS} nearest to the camera count",
                found.len()
            );
        }
        let eye = cameras
            .iter()
            .next()
            .map_or(Vec3::ZERO, GlobalTransform::translation);
        found.sort_by(|a, b| {
            let distance = |affine: &Affine3A| Vec3::from(affine.translation).distance_squared(eye);
            distance(a).total_cmp(&distance(b))
        });
        found.truncate(MOST_INTERIORS);
    }
    if target.0 != found {
        target.0 = found;
    }
}

/// An interior relative to the anchor.
fn gpu_interior(interior: &Affine3A, anchor: DVec3) -> GpuVoxelInterior {
    let [x, y, z] = [
        interior.matrix3.x_axis,
        interior.matrix3.y_axis,
        interior.matrix3.z_axis,
    ]
    .map(|axis| Vec3::from(axis).as_dvec3());
    let inverse = DMat3::from_cols(x, y, z).inverse();
    let shift = inverse * (anchor - Vec3::from(interior.translation).as_dvec3());
    let rows = inverse.transpose();
    let row = |axis: DVec3, shift: f64| axis.extend(shift).as_vec4();
    GpuVoxelInterior {
        x_row: row(rows.x_axis, shift.x),
        y_row: row(rows.y_axis, shift.y),
        z_row: row(rows.z_axis, shift.z),
    }
}

/// What shaders bind of the sky, beside the voxels.
pub struct SkyBindings {
    /// `GpuVoxelSurroundings`.
    pub uniform: Buffer,
    /// The map, once it is loaded.
    pub map: Option<(TextureView, Sampler)>,
    /// The lights that metal mirrors, where it does.
    pub lights: Option<Buffer>,
}

/// The lights that metal mirrors.
#[derive(Clone)]
pub struct MirroredLights {
    /// As `pack_lights` writes them.
    pub buffer: Buffer,
    /// Number of lights.
    pub count: u32,
    /// Whether it mirrors what voxels reflect, too.
    pub voxels: bool,
}

impl SkyBindings {
    /// For one camera's sky.
    pub fn new(
        sky: &Sky,
        interiors: &VoxelInteriors,
        anchor: DVec3,
        images: &RenderAssets<GpuImage>,
        device: &RenderDevice,
        mirrored: Option<MirroredLights>,
    ) -> Self {
        let map = loaded(sky, images);
        let mut surroundings = GpuVoxelSurroundings {
            ambient: sky.ambient,
            rotation: Quat::IDENTITY.into(),
            interior_count: interiors.0.len().min(MOST_INTERIORS) as u32,
            light_count: mirrored.as_ref().map_or(0, |lights| lights.count),
            mirrors_voxels: u32::from(mirrored.as_ref().is_some_and(|lights| lights.voxels)),
            ..default()
        };
        for (target, interior) in surroundings.interiors.iter_mut().zip(&interiors.0) {
            *target = gpu_interior(interior, anchor);
        }
        if let (Some(image), Some(map)) = (map, &sky.map) {
            surroundings.intensity = map.intensity;
            surroundings.rotation = map.to_map();
            surroundings.last_level = last_level(image);
        }
        Self {
            uniform: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("akari_voxel_gi_surroundings"),
                contents: &encoded(&surroundings),
                usage: BufferUsages::UNIFORM,
            }),
            map: map.map(|image| (image.texture_view.clone(), image.sampler.clone())),
            lights: mirrored.map(|lights| lights.buffer),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_the_same_however_far_from_the_origin() {
        let turn = Quat::from_rotation_y(0.7);
        let place = Vec3::new(1000.0, 5.0, -30.0);
        let interior =
            Affine3A::from_scale_rotation_translation(Vec3::new(4.0, 2.0, 6.0), turn, place);
        let anchor = DVec3::new(999.0, 4.5, -31.0);
        let gpu = gpu_interior(&interior, anchor);
        // A corner of the box.
        let corner = (turn * Vec3::new(2.0, 1.0, -3.0) + place).as_dvec3() - anchor;
        let at = corner.as_vec3().extend(1.0);
        let local = Vec3::new(gpu.x_row.dot(at), gpu.y_row.dot(at), gpu.z_row.dot(at));
        assert!(
            (local - Vec3::new(0.5, 0.5, -0.5)).length() < 1e-4,
            "{local}"
        );
    }
}
