//! The reflectors of the scene in the render world, rebuilt when one of them or its mesh or material changed.

use crate::EFFECT;
use crate::blockers::BlockerMesh;
use crate::casters::Casters;
use crate::geometry::{
    ReflectorMesh, is_diffuse, is_glossy, place_triangle, reflector_material, split,
};
use crate::lights::nearest_distance;
use crate::reflector::Reflector;
use crate::settings::{DefaultInterreflection, Interreflection};
use crate::shadow_boxes::{Fineness, LightBox, SMALLEST_PART, ShadowBox};
use crate::types::{GpuReflectorMaterial, GpuTriangle};
use akari_render::area_lights::AreaLightPolygon;
use akari_render::camera::GathersBounces;
use akari_render::prelude::*;
use akari_render::scene_lights::PunctualLight;
use akari_render::sky::SkyMap;
use bevy::light::{EnvironmentMapLight, GeneratedEnvironmentMapLight};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;
use std::sync::Arc;

/// All reflectors. Empty while the effect is idle.
#[derive(Resource, Debug, Default)]
pub struct ReflectorScene {
    /// Triangles in the world.
    pub triangles: Vec<GpuTriangle>,
    /// The entity of each, in the main world.
    pub owners: Vec<Entity>,
    /// Their materials.
    pub materials: Vec<GpuReflectorMaterial>,
    /// Triangles that were left out: without area, or not finite.
    pub dropped: u32,
    /// Counts up with each change.
    pub version: u64,
}

/// What rays may meet. Empty while none is sent.
#[derive(Resource, Debug, Default)]
pub struct BlockerScene {
    /// Bodies in the world.
    pub bodies: Vec<Arc<BlockerMesh>>,
    /// Where each of them is that has triangles.
    pub shadows: Vec<ShadowBox>,
    /// As of [`Casters`].
    pub version: u64,
}

/// Takes the bodies that changed to the render world.
pub fn extract_blockers(mut scene: ResMut<BlockerScene>, casters: Extract<Res<Casters>>) {
    if scene.version != casters.version {
        scene.version = casters.version;
        let (entities, bodies): (Vec<_>, Vec<_>) = casters.blockers().unzip();
        scene.shadows = (entities.iter().zip(&bodies))
            .filter_map(|(owner, body)| ShadowBox::new(*owner, body.clone()))
            .collect();
        scene.bodies = bodies;
    }
}

/// On a view in the render world: it is to be lit by reflectors, in this way.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
pub struct ViewInterreflection {
    /// The camera's settings.
    pub settings: Interreflection,
    /// Whether another effect gathers what bounces diffusely, so that only what reflectors mirror is added.
    pub mirrored_only: bool,
    /// The camera's environment map; `None` where that other effect brings it.
    pub sky: Option<SkyMap>,
    /// Whether Bevy makes that map anew as it likes, so that what it lights is never up to date.
    pub sky_changes: bool,
}

/// Marks the views.
pub fn extract_views(
    mut commands: Commands,
    cameras: Extract<
        Query<
            (
                RenderEntity,
                &Camera,
                Option<&Interreflection>,
                Has<GathersBounces>,
                Option<&EnvironmentMapLight>,
                Has<GeneratedEnvironmentMapLight>,
            ),
            (With<AkariCamera>, With<Camera3d>),
        >,
    >,
    defaults: Extract<Res<DefaultInterreflection>>,
    report: Extract<Res<EffectReport>>,
    marked: Query<Entity, With<ViewInterreflection>>,
) {
    let mut wanted = HashSet::<Entity>::default();
    if report.is_active(EFFECT) {
        for (view, camera, settings, gathers, map, generated) in &cameras {
            if camera.is_active {
                wanted.insert(view);
                commands.entity(view).insert(ViewInterreflection {
                    settings: settings.copied().unwrap_or(defaults.0),
                    mirrored_only: gathers,
                    sky: map.filter(|_| !gathers).and_then(SkyMap::new),
                    sky_changes: generated,
                });
            }
        }
    }
    for view in &marked {
        if !wanted.contains(&view) {
            commands
                .entity(view)
                .remove::<(ViewInterreflection, crate::prepare::ViewReflectors)>();
        }
    }
}

type ReflectorQuery = (
    Entity,
    &'static Mesh3d,
    &'static MeshMaterial3d<StandardMaterial>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
);
type ReflectorChanged = (
    With<Reflector>,
    Or<(
        Added<Reflector>,
        Changed<Mesh3d>,
        Changed<MeshMaterial3d<StandardMaterial>>,
        Changed<GlobalTransform>,
        Changed<InheritedVisibility>,
    )>,
);

/// What may have gone.
#[derive(bevy::ecs::system::SystemParam)]
pub struct Removed<'w, 's> {
    marks: Extract<'w, 's, RemovedComponents<'static, 'static, Reflector>>,
    meshes: Extract<'w, 's, RemovedComponents<'static, 'static, Mesh3d>>,
    mesh_events: Extract<'w, 's, MessageReader<'static, 'static, AssetEvent<Mesh>>>,
    material_events: Extract<'w, 's, MessageReader<'static, 'static, AssetEvent<StandardMaterial>>>,
}

/// Rebuilds [`ReflectorScene`] if a reflector was added, changed, moved, shown, hidden or removed.
pub fn extract_reflectors(
    mut scene: ResMut<ReflectorScene>,
    reflectors: Extract<Query<ReflectorQuery, With<Reflector>>>,
    changed: Extract<Query<(), ReflectorChanged>>,
    mut removed: Removed,
    meshes: Extract<Res<Assets<Mesh>>>,
    materials: Extract<Res<Assets<StandardMaterial>>>,
    report: Extract<Res<EffectReport>>,
    names: Extract<Query<NameOrEntity>>,
    mut warned: Local<HashSet<Entity>>,
    mut was_active: Local<bool>,
) {
    let events = removed.marks.read().count()
        + removed.meshes.read().count()
        + removed.mesh_events.read().count()
        + removed.material_events.read().count();
    let active = report.is_active(EFFECT);
    if !active {
        if *was_active {
            let version = scene.version + 1;
            *scene = ReflectorScene {
                version,
                ..ReflectorScene::default()
            };
        }
        *was_active = false;
        return;
    }
    if *was_active && events == 0 && changed.is_empty() {
        return;
    }
    *was_active = true;
    let version = scene.version + 1;
    *scene = ReflectorScene {
        version,
        ..ReflectorScene::default()
    };
    let mut known_meshes: HashMap<AssetId<Mesh>, Option<ReflectorMesh>> = HashMap::default();
    let mut known_materials: HashMap<AssetId<StandardMaterial>, Option<u32>> = HashMap::default();
    // In the order of entities, so that sums do not depend on that of archetypes.
    let mut sorted: Vec<_> = reflectors.iter().collect();
    sorted.sort_unstable_by_key(|(entity, ..)| *entity);
    for (entity, mesh, material, transform, visible) in sorted {
        let Some(standard) = materials.get(&material.0) else {
            continue;
        };
        if !visible.get() {
            continue;
        }
        let ReflectorScene {
            materials: gpu_materials,
            ..
        } = &mut *scene;
        let index = *known_materials.entry(material.id()).or_insert_with(|| {
            let gpu = reflector_material(standard)?;
            gpu_materials.push(gpu);
            Some(gpu_materials.len() as u32 - 1)
        });
        let Some(index) = index else { continue };
        let Some(asset) = meshes.get(mesh.id()) else {
            continue;
        };
        let geometry = known_meshes.entry(mesh.id()).or_insert_with(|| {
            ReflectorMesh::new(asset)
                .inspect_err(|fault| {
                    if warned.insert(entity) {
                        let name = names
                            .get(entity)
                            .map_or_else(|_| entity.to_string(), |name| name.to_string());
                        warn!("the mesh of {name} reflects nothing: {fault}");
                    }
                })
                .ok()
        });
        let Some(geometry) = geometry else { continue };
        let affine = transform.affine();
        let two_sided = standard.double_sided || standard.cull_mode.is_none();
        let placed: Vec<_> = geometry
            .triangles
            .iter()
            .filter_map(|(corners, normals)| {
                place_triangle(corners, normals, &affine, index, two_sided)
            })
            .collect();
        scene.dropped += geometry.dropped + (geometry.triangles.len() - placed.len()) as u32;
        (scene.owners).extend(std::iter::repeat_n(entity, placed.len()));
        scene.triangles.extend(placed);
    }
}

/// What a setting of patches makes of the scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Triangles {
    /// Diffuse patches, then glossy triangles.
    pub triangles: Vec<GpuTriangle>,
    /// How many of them are patches.
    pub patches: u32,
}

/// Halvings of a triangle at most: a thousandth of its longest edge.
const MOST_HALVINGS: u32 = 20;

/// Tries at patches that are no more than the settings allow.
const MOST_TRIES: u32 = 11;

/// Cuts the diffuse triangles into patches, finer where shadows may fall and finest where bodies stand on them. If there are
/// more than the settings allow, those become larger first, then all alike. Where only what is mirrored counts, there are none.
pub fn cut(
    scene: &ReflectorScene,
    shadows: &[ShadowBox],
    lights: &[PunctualLight],
    polygons: &[AreaLightPolygon],
    view: &ViewInterreflection,
) -> Triangles {
    let settings = &view.settings;
    if view.mirrored_only {
        let glossy = (scene.triangles.iter())
            .filter(|triangle| is_glossy(&scene.materials[triangle.material as usize]));
        return Triangles {
            triangles: glossy.copied().collect(),
            patches: 0,
        };
    }
    let of = |keep: fn(&GpuReflectorMaterial) -> bool| {
        scene
            .triangles
            .iter()
            .filter(move |triangle| keep(&scene.materials[triangle.material as usize]))
    };
    let shadows = if settings.shadow_rays > 0 {
        shadows
    } else {
        &[]
    };
    let mut boxes = LightBox::of(lights, polygons);
    if view.sky.is_some() {
        // What hides a part of it does so from wherever it is.
        boxes.push(LightBox::AROUND);
    }
    let mut fineness = Fineness {
        share: settings.patch.max(1e-3),
        smallest_part: SMALLEST_PART,
    };
    let mut patches = Vec::new();
    // Fewer with each try, first where shadows meet what throws them; a scene of more triangles than patches is left as it is.
    for _ in 0..MOST_TRIES {
        patches.clear();
        for (index, triangle) in scene.triangles.iter().enumerate() {
            if !is_diffuse(&scene.materials[triangle.material as usize]) {
                continue;
            }
            let shadows = ShadowBox::over(shadows, triangle, scene.owners.get(index), &boxes);
            let fine = |triangle: &GpuTriangle, longest: f32| {
                let middle = (triangle.a + triangle.b + triangle.c) / 3.0;
                longest <= fineness.share * nearest_distance(lights, polygons, middle)
                    && (shadows.iter())
                        .all(|shadow| shadow.is_fine(triangle, longest, fineness, &boxes))
            };
            split(*triangle, MOST_HALVINGS, &fine, &mut patches);
            if patches.len() > settings.most_patches as usize {
                break;
            }
        }
        if patches.len() <= settings.most_patches as usize {
            break;
        }
        if fineness.smallest_part < 1.0 {
            fineness.smallest_part *= 2.0;
        } else {
            fineness.share *= 2.0;
        }
    }
    if patches.len() > settings.most_patches as usize {
        patches = of(is_diffuse).copied().collect();
    }
    let count = patches.len() as u32;
    patches.extend(of(is_glossy));
    Triangles {
        triangles: patches,
        patches: count,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_finer_near_a_light_and_bounded_in_number() {
        let scene = ReflectorScene {
            triangles: vec![GpuTriangle {
                b: Vec3::X * 4.0,
                c: Vec3::Y * 4.0,
                ..GpuTriangle::default()
            }],
            materials: vec![GpuReflectorMaterial {
                diffuse_color: Vec3::ONE,
                grazing_reflectance: 1.0,
                ..GpuReflectorMaterial::default()
            }],
            ..ReflectorScene::default()
        };
        let light = PunctualLight::Point {
            position: Vec3::new(0.0, 0.0, 0.5),
            intensity: Vec3::ONE,
            range: 10.0,
            spot: None,
        };
        let mut settings = Interreflection::default();
        let cut_to = |settings: &Interreflection| {
            let view = ViewInterreflection {
                settings: *settings,
                mirrored_only: false,
                sky: None,
                sky_changes: false,
            };
            cut(&scene, &[], &[light], &[], &view)
        };
        let fine = cut_to(&settings);
        let longest = |triangle: &GpuTriangle| triangle.a.distance(triangle.b);
        let (near, far) = (fine.triangles[..fine.patches as usize].iter())
            .partition::<Vec<&GpuTriangle>, _>(|triangle| triangle.a.length() < 1.0);
        let mean = |list: &[&GpuTriangle]| {
            list.iter().map(|triangle| longest(triangle)).sum::<f32>() / list.len() as f32
        };
        assert!(mean(&near) < 0.5 * mean(&far));
        assert_eq!(fine.triangles.len() as u32, fine.patches + 1, "one glossy");
        // Under a small body that is between it and the light.
        let (low, high) = (Vec3::new(1.0, 1.0, 0.1), Vec3::new(1.2, 1.2, 0.3));
        let across = [[low, high, Vec3::new(high.x, low.y, low.z)]];
        let parts = Arc::new(BlockerMesh::new(across.to_vec()));
        let body = ShadowBox::new(Entity::PLACEHOLDER, parts).expect("it has a triangle");
        let view = |shadow_rays| ViewInterreflection {
            settings: Interreflection {
                shadow_rays,
                ..settings
            },
            mirrored_only: false,
            sky: None,
            sky_changes: false,
        };
        let shaded = |rays| {
            cut(
                &scene,
                std::slice::from_ref(&body),
                &[light],
                &[],
                &view(rays),
            )
            .patches
        };
        assert!(
            shaded(1) > fine.patches + 20,
            "{} {}",
            shaded(1),
            fine.patches
        );
        assert_eq!(shaded(0), fine.patches);
        settings.most_patches = 64;
        assert!(cut_to(&settings).patches <= 64);
        let view = ViewInterreflection {
            settings,
            mirrored_only: true,
            sky: None,
            sky_changes: false,
        };
        let mirrored = cut(&scene, &[], &[light], &[], &view);
        assert_eq!((mirrored.patches, mirrored.triangles.len()), (0, 1));
    }
}
