//! Shadows of what moves, from stand-ins: a box or an ellipsoid about the mesh.
//!
//! A fallback, and named so in the statistics: its outline is that of the stand-in. It needs no map, no bias and no
//! resolution, and is as soft as the light makes it: what a convex body hides of a polygon is a polygon
//! (`akari_math::convex_shadow`), and the share of the light's irradiance in it is taken away from baked receivers.
//! Bodies that hide the same part of a light count both.

use super::matching::BakedReceivers;
use akari_render::prelude::*;
use bevy::camera::primitives::Aabb;
use bevy::light::NotShadowCaster;
use bevy::math::{Affine3A, Vec4};
use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;
use serde::{Deserialize, Serialize};

/// Most stand-ins; the largest are taken.
pub const MOST_CASTERS: usize = 64;

/// Stands in for the mesh of its entity when area lights throw shadows on baked receivers.
///
/// For what moves, and is therefore in no bake. Takes the mesh's bounds in its own space
/// ([`Aabb`]), turned and scaled with it.
#[derive(
    Component, Debug, Clone, Copy, Default, PartialEq, Eq, Reflect, Serialize, Deserialize,
)]
#[reflect(Component, Default, Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ShadowProxy {
    /// The ellipsoid that touches the sides of the bounds.
    #[default]
    Ellipsoid,
    /// The bounds.
    Box,
}

/// One stand-in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovingCaster {
    /// The space in which the body is [−1, 1]³ or the unit sphere, into the world.
    pub world_from_unit: Affine3A,
    /// The shape.
    pub shape: ShadowProxy,
}

/// All stand-ins, the largest first.
#[derive(Resource, Debug, Default, Clone, PartialEq)]
pub struct MovingCasters(pub Vec<MovingCaster>);

/// A stand-in as shaders read it.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuMovingCaster {
    /// Rows of unit from world.
    pub unit_x: Vec4,
    /// Second row.
    pub unit_y: Vec4,
    /// Third row.
    pub unit_z: Vec4,
    /// Columns of world from unit, without the translation; w is 1 for a box, 0 for an ellipsoid.
    pub world_x: Vec4,
    /// Second column.
    pub world_y: Vec4,
    /// Third column.
    pub world_z: Vec4,
    /// Centre, and radius of a sphere about it that holds the body.
    pub bounds: Vec4,
}

/// The stand-ins as a uniform.
#[derive(ShaderType, Debug, Clone, Copy, PartialEq)]
pub struct GpuMovingCasters {
    /// The first `count` count.
    pub casters: [GpuMovingCaster; MOST_CASTERS],
    /// How many there are.
    pub count: u32,
}

impl MovingCaster {
    /// As shaders read it; none if it has no volume.
    pub fn gpu(&self) -> Option<GpuMovingCaster> {
        let world = self.world_from_unit;
        let determinant = world.matrix3.determinant();
        if determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        let unit = world.inverse();
        if !unit.is_finite() {
            return None;
        }
        let row = |k: usize| Vec3::from(unit.matrix3.row(k)).extend(unit.translation[k]);
        let column = |k: usize, w: f32| Vec3::from(world.matrix3.col(k)).extend(w);
        let is_box = self.shape == ShadowProxy::Box;
        let lengths = [0, 1, 2].map(|k| world.matrix3.col(k).length());
        let radius = if is_box {
            Vec3::from_array(lengths).length()
        } else {
            lengths.into_iter().fold(0.0, f32::max)
        };
        Some(GpuMovingCaster {
            unit_x: row(0),
            unit_y: row(1),
            unit_z: row(2),
            world_x: column(0, f32::from(u8::from(is_box))),
            world_y: column(1, 0.0),
            world_z: column(2, 0.0),
            bounds: Vec3::from(world.translation).extend(radius),
        })
    }
}

impl Default for GpuMovingCasters {
    fn default() -> Self {
        Self::new(&[])
    }
}

impl GpuMovingCasters {
    /// All of them that have a volume.
    pub fn new(casters: &[MovingCaster]) -> Self {
        let mut gpu = Self {
            casters: [GpuMovingCaster::default(); MOST_CASTERS],
            count: 0,
        };
        for (place, caster) in gpu
            .casters
            .iter_mut()
            .zip(casters.iter().filter_map(MovingCaster::gpu))
        {
            *place = caster;
            gpu.count += 1;
        }
        gpu
    }
}

/// Collects the stand-ins, as long as there is something that they throw shadows on.
pub fn collect_moving_casters(
    receivers: Res<BakedReceivers>,
    bodies: Query<
        (&ShadowProxy, &Aabb, &GlobalTransform, &InheritedVisibility),
        Without<NotShadowCaster>,
    >,
    mut casters: ResMut<MovingCasters>,
    mut warned: Local<bool>,
) {
    let mut list: Vec<MovingCaster> = Vec::new();
    if receivers.tables.is_some() {
        for (shape, bounds, transform, visibility) in &bodies {
            if visibility.get() {
                let unit = Affine3A::from_scale_rotation_translation(
                    bounds.half_extents.into(),
                    Quat::IDENTITY,
                    bounds.center.into(),
                );
                list.push(MovingCaster {
                    world_from_unit: transform.affine() * unit,
                    shape: *shape,
                });
            }
        }
        let size = |caster: &MovingCaster| caster.world_from_unit.matrix3.determinant().abs();
        list.sort_by(|a, b| size(b).total_cmp(&size(a)));
        if list.len() > MOST_CASTERS && !*warned {
            warn!(
                "{} moving meshes have a ShadowProxy: only the {MOST_CASTERS} largest throw shadows of area lights",
                list.len()
            );
            *warned = true;
        }
        list.truncate(MOST_CASTERS);
    }
    // Changed only where something has.
    if casters.0 != list {
        casters.0 = list;
    }
}

/// Says once that meshes which were not baked throw no shadows of area lights.
pub fn warn_of_meshes_without_shadow(
    receivers: Res<BakedReceivers>,
    report: Res<EffectReport>,
    drawn: Query<
        (NameOrEntity, &InheritedVisibility),
        (
            With<Mesh3d>,
            Without<ShadowProxy>,
            Without<NotShadowCaster>,
            Without<crate::light::PolygonLight>,
            Without<crate::emissive::NoAreaLight>,
        ),
    >,
    added: Query<(), Added<Mesh3d>>,
    lights: Query<&ChildOf, With<crate::emissive::EmissiveMeshLight>>,
    mut warned: Local<bool>,
) {
    let look = !*warned
        && report.is_active(super::EFFECT)
        && (receivers.is_changed() || !added.is_empty());
    if !look {
        return;
    }
    let mut left_out = drawn.iter().filter(|(mesh, visibility)| {
        visibility.get()
            && !receivers.is_receiver(mesh.entity)
            && !lights.iter().any(|light| light.parent() == mesh.entity)
    });
    if let Some((name, _)) = left_out.next() {
        let others = left_out.count();
        info!(
            "{name} and {others} other meshes are in no bake: they neither throw nor receive baked shadows. Those that move \
             throw soft shadows with a ShadowProxy"
        );
        *warned = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_without_a_volume_are_left_out() {
        let body = |scale: Vec3| MovingCaster {
            world_from_unit: Affine3A::from_scale_rotation_translation(
                scale,
                Quat::from_rotation_y(0.3),
                Vec3::new(1.0, 2.0, 3.0),
            ),
            shape: ShadowProxy::Box,
        };
        let gpu = GpuMovingCasters::new(&[
            body(Vec3::new(1.0, 0.0, 1.0)),
            body(Vec3::new(1.0, 2.0, 2.0)),
            body(Vec3::splat(f32::NAN)),
        ]);
        assert_eq!(gpu.count, 1);
        let caster = gpu.casters[0];
        assert!((caster.bounds.w - 3.0).abs() < 1e-6);
        // A corner of the body is a corner of the unit box.
        let corner = body(Vec3::new(1.0, 2.0, 2.0))
            .world_from_unit
            .transform_point3(Vec3::ONE);
        for row in [caster.unit_x, caster.unit_y, caster.unit_z] {
            assert!((row.dot(corner.extend(1.0)) - 1.0).abs() < 1e-6);
        }
    }
}
