//! Soft shadows that another effect finds in each frame ([`ViewSoftShadows`]): which of its lights are which of ours, and what
//! the shading binds of them.
//!
//! Where a surface was baked, what arrives of a light is what the bake lets through times what the other effect's casters do;
//! elsewhere it is what all that the other effect knows of lets through.

use crate::extract::{ExtractedAreaLights, ViewAreaLighting};
use crate::prepare::{AreaLightBuffers, ViewAreaLights};
use crate::shadows::matching::BakedReceivers;
use crate::shadows::moving::ShadowProxy;
use akari_render::prelude::*;
use akari_render::soft_shadows::{CastsAreaShadow, MOST_SOFT_LIGHTS, ViewSoftShadows};
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// What of the shading pass depends on soft shadows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SoftKey {
    /// Whether what the bake does not know is told apart.
    pub by_caster: bool,
}

/// Which of the shading pass's lights have soft shadows, field by field as `SoftLights` in `shade.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuSoftLights {
    /// For each byte of the words, the first light that it is of (x), and the number of lights (y): of the cells of a
    /// textured light all. A light without an entry has no soft shadows.
    pub ranges: [UVec4; MOST_SOFT_LIGHTS],
}

/// The bind group of the shading pass.
#[derive(Component)]
pub struct SoftLightsGroup(pub BindGroup);

/// Layout of that group.
pub fn soft_layout() -> BindGroupLayoutDescriptor {
    BindGroupLayoutDescriptor::new(
        "akari_area_light_soft_layout",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                texture_2d(TextureSampleType::Uint),
                uniform_buffer::<GpuSoftLights>(false),
            ),
        ),
    )
}

/// Index of the group: behind that of baked shadows, if there is one.
pub fn soft_group(shadows: bool) -> u32 {
    if shadows { 2 } else { 1 }
}

impl GpuSoftLights {
    /// The ranges of `lights`, where `sources` has for each of the shading pass's lights the entity that it is of.
    fn new(lights: &[Entity], sources: &[Entity]) -> Self {
        let mut soft = Self::default();
        for (range, light) in soft.ranges.iter_mut().zip(lights) {
            if let Some(first) = sources.iter().position(|source| source == light) {
                let count = sources[first..]
                    .iter()
                    .take_while(|source| *source == light)
                    .count();
                *range = UVec4::new(first as u32, count as u32, 0, 0);
            }
        }
        soft
    }
}

/// Binds the soft shadows of the views that have some.
pub fn prepare_soft_lights(
    mut commands: Commands,
    views: Query<(Entity, &ViewSoftShadows, &ViewAreaLights), With<ViewAreaLighting>>,
    left: Query<Entity, (With<SoftLightsGroup>, Without<ViewSoftShadows>)>,
    buffers: Option<Res<AreaLightBuffers>>,
    extracted: Res<ExtractedAreaLights>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    for view in &left {
        commands.entity(view).remove::<SoftLightsGroup>();
    }
    let Some(buffers) = buffers else {
        return;
    };
    for (entity, shadows, lights) in &views {
        let Some(of_cells) = buffers.of_cells(lights.texture_cells()) else {
            continue;
        };
        let sources: Vec<Entity> = of_cells
            .arrays
            .sources
            .iter()
            .filter_map(|index| Some(extracted.lights.get(*index)?.entity))
            .collect();
        let mut uniform = UniformBuffer::from(GpuSoftLights::new(&shadows.lights, &sources));
        uniform.write_buffer(&device, &queue);
        let Some(binding) = uniform.binding() else {
            continue;
        };
        let group = device.create_bind_group(
            "akari_area_light_soft",
            &cache.get_bind_group_layout(&soft_layout()),
            &BindGroupEntries::sequential((&shadows.texture, binding)),
        );
        commands.entity(entity).insert(SoftLightsGroup(group));
    }
}

/// Marks the meshes whose shadows the bake or a stand-in throws.
pub fn mark_casters(
    mut commands: Commands,
    receivers: Res<BakedReceivers>,
    report: Res<EffectReport>,
    proxies: Query<Entity, With<ShadowProxy>>,
    added: Query<(), Added<ShadowProxy>>,
    mut removed: RemovedComponents<ShadowProxy>,
    marked: Query<Entity, With<CastsAreaShadow>>,
) {
    let any_removed = removed.read().count() > 0;
    if !(receivers.is_changed() || report.is_changed() || any_removed || !added.is_empty()) {
        return;
    }
    let mut wanted: HashSet<Entity> = HashSet::default();
    // Where nobody draws baked shadows, whoever finds shadows throws all of them.
    if receivers.tables.is_some() && report.is_active(crate::shadows::EFFECT) {
        wanted.extend(receivers.entities());
        wanted.extend(&proxies);
    }
    for entity in &marked {
        if !wanted.remove(&entity) {
            commands.entity(entity).try_remove::<CastsAreaShadow>();
        }
    }
    for entity in wanted {
        if let Ok(mut entity) = commands.get_entity(entity) {
            entity.try_insert(CastsAreaShadow);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_cells_of_a_light_share_its_shadow() {
        let [a, b, c] = [1, 2, 3].map(|index| Entity::from_raw_u32(index).expect("an index"));
        let soft = GpuSoftLights::new(&[c, a], &[a, b, b, c, c, c]);
        let ranges = soft.ranges.map(|range| (range.x, range.y));
        assert_eq!(ranges, [(3, 3), (0, 1), (0, 0), (0, 0)]);
        assert_eq!(GpuSoftLights::new(&[b], &[a]), GpuSoftLights::default());
    }
}
