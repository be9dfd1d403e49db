//! What the examples of reflectors share: keys for tier, roughness and motion, and the error of the tier, measured while it
//! is looked at: two small cameras draw the same view, one with the best tier and without clusters.

use crate::demo::Restart;
use crate::orbit::Orbit;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy_akari::headless::unit_exposure;
use bevy_akari::prelude::*;

/// Tiers by their number, from 1.
const TIERS: [&str; 9] = [
    "1 cosine lobe",
    "2 cosine lobes",
    "3 cosine lobes",
    "1 node",
    "2 nodes",
    "3 nodes",
    "4 nodes",
    "6 nodes",
    "8 nodes",
];
/// Size of the pictures that are compared. Rows are a multiple of 256 bytes, so that a read needs no padding.
const PROBE: UVec2 = UVec2::new(48, 27);
/// Step of the roughness by a key.
const ROUGHNESS_STEP: f32 = 0.05;
/// Bevy's own floor of the perceptual roughness.
const LEAST_ROUGHNESS: f32 = 0.089;

/// What is asked for.
#[derive(Resource, Debug, Clone, PartialEq, clap::Args)]
pub struct ReflectControls {
    /// Integral of a lobe over a triangle: 1 to 3 cosine lobes; 4 to 9: 1, 2, 3, 4, 6, 8 nodes an edge
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=9))]
    pub tier: u32,
    /// Perceptual roughness of the metal
    #[arg(long, default_value_t = 0.3)]
    pub roughness: f32,
    /// Nothing reflects
    #[arg(long)]
    pub direct_only: bool,
    /// Let the light rest
    #[arg(long)]
    pub still: bool,
}

/// Whose roughness the keys change.
#[derive(Component)]
pub struct Metal;

/// A mesh that reflects while reflection is on.
#[derive(Component)]
pub struct MayReflect;

/// Seconds since the start, while the light moves.
#[derive(Resource, Debug, Default, Clone, Copy)]
pub struct LightTime(pub f32);

/// On a camera whose picture is compared.
#[derive(Component, Clone, Copy, PartialEq, Debug)]
enum Probe {
    Ours,
    Best,
}

/// The latest pictures, and how far the first is from the second.
#[derive(Resource, Default)]
struct Compared {
    ours: Option<Vec<f32>>,
    best: Option<Vec<f32>>,
    error: Option<f64>,
}

impl ReflectControls {
    fn settings(&self) -> Interreflection {
        Interreflection {
            tier: self.tier,
            ..AkariSettings::preset(Quality::High).interreflection
        }
    }

    fn best() -> Interreflection {
        Interreflection {
            tier: TIERS.len() as u32,
            cut: 0.0,
            ..AkariSettings::preset(Quality::High).interreflection
        }
    }

    fn press(&mut self, key: KeyCode) {
        let step = match key {
            KeyCode::KeyT => {
                self.tier = self.tier % TIERS.len() as u32 + 1;
                return;
            }
            KeyCode::KeyG => {
                self.direct_only ^= true;
                return;
            }
            KeyCode::Space => {
                self.still ^= true;
                return;
            }
            KeyCode::KeyR => ROUGHNESS_STEP,
            KeyCode::KeyF => -ROUGHNESS_STEP,
            _ => return,
        };
        self.roughness = (self.roughness + step).clamp(LEAST_ROUGHNESS, 1.0);
    }

    fn describe(&self) -> String {
        let switch = |on| if on { "on" } else { "off" };
        let tier = TIERS[(self.tier as usize - 1).min(TIERS.len() - 1)];
        format!(
            "T: tier {} ({tier}) | R, F: roughness {:.2} | G: reflection {} | Space: motion {}",
            self.tier,
            self.roughness,
            switch(!self.direct_only),
            switch(!self.still),
        )
    }
}

/// Adds keys, settings and the live error. `name` stands in the title.
pub fn build(app: &mut App, name: &'static str, controls: ReflectControls) {
    app.insert_resource(ClearColor(Color::BLACK))
        .insert_resource(GlobalAmbientLight::NONE)
        .insert_resource(controls)
        .init_resource::<LightTime>()
        .init_resource::<Compared>()
        .add_systems(
            Update,
            (
                read_keys.run_if(resource_exists::<ButtonInput<KeyCode>>),
                spawn_probes,
                apply_controls,
                follow,
                pass_time,
                move |controls: Res<ReflectControls>,
                      compared: Res<Compared>,
                      windows: Query<&mut Window>| {
                    write_title(name, &controls, &compared, windows);
                },
            )
                .chain(),
        )
        .add_observer(
            |_: On<Restart>, mut time: ResMut<LightTime>, mut compared: ResMut<Compared>| {
                time.0 = 0.0;
                *compared = Compared::default();
            },
        );
}

/// The camera of such an example.
pub fn camera(view: Transform) -> impl Bundle {
    (
        Camera3d::default(),
        AkariCamera,
        Msaa::Off,
        unit_exposure(),
        Tonemapping::KhronosPbrNeutral,
        view,
        Orbit::from_view(&view),
    )
}

fn spawn_probes(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    main: Query<&Projection, (With<Orbit>, With<Camera3d>)>,
    probes: Query<(), With<Probe>>,
) {
    let (Ok(projection), true) = (main.single(), probes.is_empty()) else {
        return;
    };
    for (probe, order) in [(Probe::Ours, -2), (Probe::Best, -1)] {
        let mut image =
            Image::new_target_texture(PROBE.x, PROBE.y, TextureFormat::Rgba32Float, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let image = images.add(image);
        commands.spawn((
            Camera3d::default(),
            Camera { order, ..default() },
            RenderTarget::Image(image.clone().into()),
            AkariCamera,
            Msaa::Off,
            unit_exposure(),
            Tonemapping::None,
            DebandDither::Disabled,
            projection.clone(),
            probe,
        ));
        commands
            .spawn((Readback::texture(image), probe))
            .observe(compare);
    }
}

/// Keeps a picture that was read, and measures once both are there.
fn compare(
    read: On<ReadbackComplete>,
    probes: Query<&Probe>,
    mut compared: ResMut<Compared>,
    windows: Query<(), With<Window>>,
    mut told: Local<bool>,
    controls: Res<ReflectControls>,
) {
    let values: Vec<f32> = (read.data.as_chunks::<4>().0.iter())
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect();
    match probes.get(read.entity) {
        Ok(Probe::Ours) => compared.ours = Some(values),
        Ok(Probe::Best) => compared.best = Some(values),
        Err(_) => return,
    }
    let (Some(ours), Some(best)) = (&compared.ours, &compared.best) else {
        return;
    };
    let (mut error, mut square) = (0.0, 0.0);
    for (a, b) in ours.as_chunks::<4>().0.iter().zip(best.as_chunks::<4>().0) {
        for (a, b) in a[..3].iter().zip(&b[..3]) {
            error += f64::from(a - b).powi(2);
            square += f64::from(*b).powi(2);
        }
    }
    if square > 0.0 {
        let relative = (error / square).sqrt();
        compared.error = Some(relative);
        if windows.is_empty() && !*told {
            *told = true;
            println!(
                "tier {}: {:.3} % from 8 nodes without clusters, relative RMSE of the picture",
                controls.tier,
                100.0 * relative
            );
        }
    }
    compared.ours = None;
    compared.best = None;
}

fn read_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut controls: ResMut<ReflectControls>,
    mut exit: MessageWriter<AppExit>,
) {
    for key in keys.get_just_pressed() {
        if *key == KeyCode::Escape {
            exit.write(AppExit::Success);
        }
        let mut changed = controls.clone();
        changed.press(*key);
        controls.set_if_neq(changed);
    }
}

fn apply_controls(
    controls: Res<ReflectControls>,
    cameras: Query<(Entity, Option<&Probe>), With<Camera3d>>,
    set: Query<(), With<Interreflection>>,
    metals: Query<&MeshMaterial3d<StandardMaterial>, With<Metal>>,
    bodies: Query<(Entity, Has<Reflector>), With<MayReflect>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut commands: Commands,
) {
    for (camera, probe) in &cameras {
        if controls.is_changed() || !set.contains(camera) {
            let settings = match probe {
                Some(Probe::Best) => ReflectControls::best(),
                _ => controls.settings(),
            };
            commands.entity(camera).insert(settings);
        }
    }
    for material in &metals {
        let differs = (materials.get(material.id()))
            .is_some_and(|material| material.perceptual_roughness != controls.roughness);
        if differs && let Some(mut material) = materials.get_mut(material.id()) {
            material.perceptual_roughness = controls.roughness;
        }
    }
    for (body, reflects) in &bodies {
        if reflects == controls.direct_only {
            if reflects {
                commands.entity(body).remove::<Reflector>();
            } else {
                commands.entity(body).insert(Reflector);
            }
        }
    }
}

/// Probes see what the camera sees.
fn follow(
    main: Query<&Transform, (With<Orbit>, Without<Probe>)>,
    mut probes: Query<&mut Transform, (With<Probe>, With<Camera3d>)>,
) {
    if let Ok(view) = main.single() {
        for mut probe in &mut probes {
            probe.set_if_neq(*view);
        }
    }
}

fn pass_time(time: Res<Time>, controls: Res<ReflectControls>, mut passed: ResMut<LightTime>) {
    if !controls.still {
        passed.0 += time.delta_secs();
    }
}

fn write_title(
    name: &str,
    controls: &ReflectControls,
    compared: &Compared,
    mut windows: Query<&mut Window>,
) {
    let error = compared.error.map_or_else(String::new, |error| {
        format!(" | {:.3} % from the best tier", 100.0 * error)
    });
    for mut window in &mut windows {
        let title = format!("Akari {name} | {}{error}", controls.describe());
        if window.title != title {
            window.title = title;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_go_through_all_tiers_and_stay_in_range() {
        let mut controls = ReflectControls {
            tier: 1,
            roughness: 0.3,
            direct_only: false,
            still: false,
        };
        for tier in (2..=9).chain([1]) {
            controls.press(KeyCode::KeyT);
            assert_eq!(controls.tier, tier);
            assert!(controls.describe().contains(TIERS[tier as usize - 1]));
        }
        for _ in 0..40 {
            controls.press(KeyCode::KeyR);
        }
        assert_eq!(controls.roughness, 1.0);
        for _ in 0..40 {
            controls.press(KeyCode::KeyF);
        }
        assert_eq!(controls.roughness, LEAST_ROUGHNESS);
        controls.press(KeyCode::KeyG);
        assert!(controls.direct_only);
    }
}
