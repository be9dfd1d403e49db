//! What each scene calls for: passes, memory and pipelines of every effect, as one table; and that they go again.

use crate::shadows::Stage;
use bevy::prelude::*;
use bevy_akari::prelude::*;
use bevy_akari::render::capture::CaptureBuffers;
use bevy_akari_tests::*;
use std::collections::{BTreeMap, BTreeSet};

/// Name of an effect, and how the labels of its passes and pipelines begin.
const EFFECTS: [(&str, &str); 6] = [
    ("area-lights", "akari_area_light_"),
    ("shadows", "akari_area_light_"),
    ("lobes", "akari_lobes_"),
    ("denoise", "akari_denoise_"),
    ("voxel-gi", "akari_voxel_gi_"),
    ("interreflection", "akari_interreflection_"),
];
/// Passes of the shadows, whose labels begin as those of the lights.
const OF_SHADOWS: [&str; 2] = [
    "akari_area_light_receivers",
    "akari_area_light_shadow_ratios",
];

/// Passes of voxel GI that are there for shadows of area lights alone.
const OF_SOFT_SHADOWS: &str = "akari_voxel_gi_soft_shadows";

/// Whether something that no bake knows stands in the light of an area light that voxels may shadow.
fn has_soft_shadows(causes: &[Cause]) -> bool {
    let has = |cause| causes.contains(&cause);
    has(AreaLight) && has(Voxels) && (!has(Bake) || has(Body))
}

fn effect_of(label: &str) -> Option<&'static str> {
    if OF_SHADOWS.contains(&label) {
        return Some("shadows");
    }
    EFFECTS
        .iter()
        .find(|(_, prefix)| label.starts_with(prefix))
        .map(|(effect, _)| *effect)
}

/// Workgroups along each side of the stage's picture, 8 pixels each.
const GROUPS: u32 = crate::shadows::SIDE.div_ceil(8);

/// What there may be in a scene that calls for an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cause {
    AreaLight,
    HiddenAreaLight,
    Lamp,
    Bake,
    NoisySignal,
    Voxels,
    Capture,
    Reflectors,
    Body,
}
use Cause::*;

/// Causes, and the effects that run for them.
const TABLE: &[(&[Cause], &[&str])] = &[
    (&[], &[]),
    (&[Lamp], &[]),
    (&[HiddenAreaLight], &[]),
    (&[Bake], &[]),
    (&[Voxels], &[]),
    (&[Capture], &[]),
    (&[Reflectors], &[]),
    (&[Reflectors, HiddenAreaLight], &[]),
    (&[Reflectors, Lamp], &["interreflection"]),
    (
        &[Reflectors, AreaLight],
        &["area-lights", "interreflection"],
    ),
    (&[AreaLight], &["area-lights"]),
    (&[AreaLight, Bake], &["area-lights", "shadows"]),
    (&[HiddenAreaLight, Bake], &[]),
    (&[NoisySignal], &["denoise", "lobes"]),
    (
        &[AreaLight, NoisySignal],
        &["area-lights", "denoise", "lobes"],
    ),
    (&[Voxels, Lamp], &["denoise", "lobes", "voxel-gi"]),
    (&[Voxels, HiddenAreaLight], &[]),
    (
        &[AreaLight, Bake, NoisySignal],
        &["area-lights", "denoise", "lobes", "shadows"],
    ),
    (
        &[AreaLight, Bake, Voxels],
        &["area-lights", "denoise", "lobes", "shadows", "voxel-gi"],
    ),
    (
        &[AreaLight, Bake, Voxels, Body],
        &["area-lights", "denoise", "lobes", "shadows", "voxel-gi"],
    ),
    (
        &[AreaLight, Voxels],
        &["area-lights", "denoise", "lobes", "voxel-gi"],
    ),
    (&[Body, Bake], &[]),
    (&[], &[]),
];

/// Rows of the table that have each effect once or twice more.
const AGAIN: [&[Cause]; 3] = [
    &[Reflectors, AreaLight],
    &[AreaLight, Bake, NoisySignal],
    &[AreaLight, Bake, Voxels],
];

/// Brings the causes into the scene; what it gives back takes them out.
fn cause(stage: &mut Stage, cause: Cause) -> Box<dyn FnOnce(&mut Stage)> {
    let despawn = |entity: Entity| -> Box<dyn FnOnce(&mut Stage)> {
        Box::new(move |stage: &mut Stage| {
            stage.headless.app.world_mut().despawn(entity);
        })
    };
    let camera = stage.camera;
    match cause {
        AreaLight => {
            let world = stage.headless.app.world_mut();
            let light = light_above(Vec3::new(0.3, 3.0, 0.0), 1.0);
            despawn(world.spawn(light).id())
        }
        HiddenAreaLight => {
            let world = stage.headless.app.world_mut();
            let light = light_above(Vec3::new(0.3, 3.0, 0.0), 1.0);
            despawn(world.spawn((light, Visibility::Hidden)).id())
        }
        Lamp => {
            let world = stage.headless.app.world_mut();
            let light = PointLight::default();
            let at = Transform::from_xyz(0.0, 3.0, 1.0);
            despawn(world.spawn((light, at)).id())
        }
        Bake => despawn(stage.give_bake()),
        NoisySignal => {
            let world = stage.headless.app.world_mut();
            let signal = world.resource_mut::<Assets<Image>>().add(even_signal());
            world.entity_mut(camera).insert(DenoiseInput {
                specular: Some(signal),
                ..default()
            });
            Box::new(move |stage| {
                let world = stage.headless.app.world_mut();
                world.entity_mut(camera).remove::<DenoiseInput>();
            })
        }
        Voxels => {
            let world = stage.headless.app.world_mut();
            world.entity_mut(camera).insert(VoxelGi {
                resolution: 32,
                cascades: 1,
                voxel_size: 0.25,
                shadow_cones: 4,
                ..default()
            });
            Box::new(move |stage| {
                let world = stage.headless.app.world_mut();
                world.entity_mut(camera).remove::<VoxelGi>();
            })
        }
        Body => {
            let world = stage.headless.app.world_mut();
            let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::default());
            let material = world
                .resource_mut::<Assets<StandardMaterial>>()
                .add(StandardMaterial::default());
            let place = Transform::from_xyz(1.5, 1.0, 0.0).with_scale(Vec3::splat(0.5));
            despawn(
                world
                    .spawn((Mesh3d(mesh), MeshMaterial3d(material), place))
                    .id(),
            )
        }
        Reflectors => {
            let bodies = stage.meshes.clone();
            for body in &bodies {
                stage
                    .headless
                    .app
                    .world_mut()
                    .entity_mut(*body)
                    .insert(Reflector);
            }
            Box::new(move |stage| {
                for body in bodies {
                    stage
                        .headless
                        .app
                        .world_mut()
                        .entity_mut(body)
                        .remove::<Reflector>();
                }
            })
        }
        Capture => {
            let world = stage.headless.app.world_mut();
            world.entity_mut(camera).insert(CaptureBuffers::default());
            Box::new(move |stage| {
                let world = stage.headless.app.world_mut();
                world.entity_mut(camera).remove::<CaptureBuffers>();
            })
        }
    }
}

fn even_signal() -> Image {
    let mut image = Image::new_fill(
        bevy::render::render_resource::Extent3d {
            width: 64,
            height: 64,
            depth_or_array_layers: 1,
        },
        bevy::render::render_resource::TextureDimension::D2,
        &1.0_f32.to_le_bytes().repeat(4),
        bevy::render::render_resource::TextureFormat::Rgba32Float,
        bevy::asset::RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_descriptor.usage |= bevy::render::render_resource::TextureUsages::TEXTURE_BINDING;
    image
}

/// Passes of three frames, with how often each ran.
fn passes(stage: &mut Stage) -> BTreeMap<&'static str, u64> {
    let before = stage.headless.ledger().passes();
    for _ in 0..3 {
        stage.headless.step().expect("it renders");
    }
    let mut passes = stage.headless.ledger().passes();
    passes.retain(|name, count| {
        *count -= before.get(name).copied().unwrap_or(0);
        *count > 0
    });
    passes
}

#[test]
fn every_effect_is_there_for_its_causes_only() {
    let Some(mut stage) = Stage::new("every_effect_is_there_for_its_causes_only") else {
        return;
    };
    let mut seen: BTreeSet<&str> = BTreeSet::new();
    let mut faults = Vec::new();
    println!("| causes | effect | passes in three frames | GPU bytes |\n|---|---|---|---|");
    for (causes, expected) in TABLE {
        let undo: Vec<_> = causes.iter().map(|c| cause(&mut stage, *c)).collect();
        stage.headless.step_until_ready().expect("it renders");
        seen.extend(expected.iter().copied());

        let passes = passes(&mut stage);
        let bytes = stage.headless.ledger().bytes_by_effect();
        let dispatches = stage.headless.ledger().dispatches();
        let report = stage.headless.app.world().resource::<EffectReport>();
        let pipelines: BTreeSet<&str> = stage
            .headless
            .pipeline_labels()
            .iter()
            .filter_map(|label| effect_of(label))
            .collect();
        let soft = passes
            .keys()
            .filter(|label| label.starts_with(OF_SOFT_SHADOWS));
        let expected_soft = if has_soft_shadows(causes) { 2 } else { 0 };
        if soft.count() != expected_soft {
            faults.push(format!(
                "{causes:?}: soft shadows are not as the causes call for"
            ));
        }
        for (effect, _) in EFFECTS {
            let is_expected = expected.contains(&effect);
            let of_effect: Vec<String> = passes
                .iter()
                .filter(|(label, _)| effect_of(label) == Some(effect))
                .map(|(label, count)| match dispatches.get(label) {
                    Some([x, y, z]) => format!("{label} × {count} ({x} × {y} × {z})"),
                    None => format!("{label} × {count}"),
                })
                .collect();
            let held = bytes.get(effect).copied().unwrap_or(0);
            let is_active = report.is_active(effect);
            if is_expected {
                println!(
                    "| {causes:?} | {effect} | {} | {held} |",
                    of_effect.join(", ")
                );
            }
            // A dispatch is over the picture, in workgroups of 8² (tiles of 16² for the lights), and no larger.
            for (label, [x, y, z]) in dispatches
                .iter()
                .filter(|(label, _)| passes.contains_key(*label))
            {
                if *x > GROUPS || *y > GROUPS || *z != 1 || *x * *y == 0 {
                    faults.push(format!("{causes:?}, {label}: {x} × {y} × {z} workgroups"));
                }
            }
            let mut say = |what: &str| faults.push(format!("{causes:?}, {effect}: {what}"));
            if is_active != is_expected {
                say(&format!("active: {is_active}: {:?}", report.get(effect)));
            }
            if of_effect.is_empty() == is_expected {
                say(&format!("passes: {of_effect:?}"));
            }
            if (held > 0) != is_expected {
                say(&format!("{held} bytes"));
            }
            // A pipeline stays once it is made; before there was a cause there is none.
            if pipelines.contains(effect) != seen.contains(effect) {
                say("a pipeline that nothing called for, or none");
            }
        }
        for undo in undo {
            undo(&mut stage);
        }
        stage.headless.step_until_ready().expect("it renders");
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));

    // What was there once is not compiled anew when it comes back.
    let count = |stage: &Stage| {
        let labels = stage.headless.pipeline_labels();
        labels.iter().filter_map(|label| effect_of(label)).count()
    };
    let compiled = count(&stage);
    for causes in AGAIN {
        let undo: Vec<_> = causes.iter().map(|c| cause(&mut stage, *c)).collect();
        stage.headless.step_until_ready().expect("it renders");
        let ran = passes(&mut stage);
        assert!(!ran.is_empty(), "{causes:?}");
        for undo in undo {
            undo(&mut stage);
        }
        stage.headless.step_until_ready().expect("it renders");
        assert_eq!(count(&stage), compiled, "{causes:?}: pipelines made anew");
    }
    assert_eq!(seen.len(), EFFECTS.len(), "effects without a row: {seen:?}");
}
