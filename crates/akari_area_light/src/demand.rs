//! Whether the scene calls for area lights, which materials stay out, and what the culling pass counted.

use crate::EFFECT;
use crate::light::PolygonLight;
use crate::prepare::ViewAreaLights;
use crate::types::COUNTER_NAMES;
use akari_render::ledger::{CollectCounters, read_back_words};
use akari_render::prelude::*;
use bevy::light::RectLight;
use bevy::material::OpaqueRendererMethod;
use bevy::prelude::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// Census entry: rectangular and polygonal lights that are not hidden.
pub const VISIBLE_AREA_LIGHTS: &str = "visible area lights";
/// Census entry: active cameras that ask for area lighting.
pub const AREA_LIT_CAMERAS: &str = "cameras with area lighting";

/// Systems of the main world.
pub fn build(app: &mut App) {
    app.add_systems(
        PostUpdate,
        (
            count_area_lights.in_set(AkariSystems::Census),
            (record_demand, warn_of_forward_materials)
                .chain()
                .in_set(AkariSystems::Demand),
        ),
    );
}

/// The demand: a pure function of the census.
pub fn demand(census: &Census) -> Demand {
    let lights = census.count(VISIBLE_AREA_LIGHTS);
    let cameras = census.count(AREA_LIT_CAMERAS);
    if lights == 0 {
        Demand::idle("no area light is visible")
    } else if cameras == 0 {
        Demand::idle("no active camera asks for area lighting")
    } else {
        let plural = if lights == 1 {
            "area light is"
        } else {
            "area lights are"
        };
        Demand::needed(format!("{lights} {plural} visible"))
    }
}

fn count_area_lights(
    lights: Query<&InheritedVisibility, Or<(With<RectLight>, With<PolygonLight>)>>,
    changed_lights: Query<
        (),
        (
            Or<(With<RectLight>, With<PolygonLight>)>,
            Or<(
                Added<RectLight>,
                Added<PolygonLight>,
                Changed<InheritedVisibility>,
            )>,
        ),
    >,
    mut removed_rect: RemovedComponents<RectLight>,
    mut removed_polygon: RemovedComponents<PolygonLight>,
    cameras: Query<&Camera, (With<AkariCamera>, With<Camera3d>)>,
    mut census: ResMut<Census>,
) {
    let removed = removed_rect.read().count() + removed_polygon.read().count();
    if removed > 0 || !changed_lights.is_empty() {
        let visible = lights.iter().filter(|visibility| visibility.get()).count();
        census.set(VISIBLE_AREA_LIGHTS, visible as u32);
    }
    // A handful of cameras: counting them costs less than finding out whether one of them changed.
    let active = cameras.iter().filter(|camera| camera.is_active).count() as u32;
    if census.count(AREA_LIT_CAMERAS) != active {
        census.set(AREA_LIT_CAMERAS, active);
    }
}

fn record_demand(census: Res<Census>, mut report: ResMut<EffectReport>) {
    if census.is_changed() || report.get(EFFECT).is_none() {
        report.record(EFFECT, demand(&census));
    }
}

/// Says once that a material stays with Bevy's own lighting, and which.
fn warn_of_forward_materials(
    report: Res<EffectReport>,
    drawn: Query<(NameOrEntity, &MeshMaterial3d<StandardMaterial>)>,
    changed: Query<(), Changed<MeshMaterial3d<StandardMaterial>>>,
    materials: Res<Assets<StandardMaterial>>,
    mut warned: Local<bool>,
) {
    let look = !*warned && report.is_active(EFFECT) && (report.is_changed() || !changed.is_empty());
    if !look {
        return;
    }
    for (name, handle) in &drawn {
        let Some(material) = materials.get(&handle.0) else {
            continue;
        };
        if let Some(why) = stays_forward(material) {
            warn!(
                "the material of {name} is drawn forward ({why}): Bevy lights it, by at most eight rectangular lights \
                 and no polygonal or textured one"
            );
            *warned = true;
            return;
        }
    }
}

/// Why Bevy draws a material forward even where the camera has a deferred prepass.
fn stays_forward(material: &StandardMaterial) -> Option<&'static str> {
    if !matches!(
        material.alpha_mode,
        AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage
    ) {
        return Some("it is transparent");
    }
    if material.specular_transmission > 0.0 || material.diffuse_transmission > 0.0 {
        return Some("it transmits light");
    }
    // `Auto` is deferred: `AkariRenderPlugin` makes that the default.
    matches!(material.opaque_render_method, OpaqueRendererMethod::Forward)
        .then_some("its opaque_render_method is Forward")
}

/// Copies the counters of this frame to the CPU without waiting for them.
pub fn collect_counters(
    collect: Res<CollectCounters>,
    views: Query<&ViewAreaLights>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    if !collect.0 {
        return;
    }
    for view in &views {
        let ledger = ledger.clone();
        let words = (0, COUNTER_NAMES.len());
        read_back_words(&view.counters, words, &device, &queue, move |counts| {
            for (name, count) in COUNTER_NAMES.iter().zip(counts) {
                ledger.set_counter(name, u64::from(*count));
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demand_follows_the_census() {
        let mut census = Census::default();
        assert!(!demand(&census).needed);
        census.set(VISIBLE_AREA_LIGHTS, 3);
        assert!(!demand(&census).needed, "no camera");
        census.set(AREA_LIT_CAMERAS, 1);
        assert_eq!(demand(&census), Demand::needed("3 area lights are visible"));
        census.set(VISIBLE_AREA_LIGHTS, 0);
        assert!(!demand(&census).needed);
    }

    #[test]
    fn forward_materials_are_told_with_their_reason() {
        let opaque = StandardMaterial::default();
        assert_eq!(stays_forward(&opaque), None);
        let forward = StandardMaterial {
            opaque_render_method: OpaqueRendererMethod::Forward,
            ..opaque.clone()
        };
        assert!(stays_forward(&forward).is_some());
        let glass = StandardMaterial {
            alpha_mode: AlphaMode::Blend,
            ..opaque
        };
        assert_eq!(stays_forward(&glass), Some("it is transparent"));
    }
}
