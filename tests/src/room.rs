//! A scene of the repository in a running app, with the indirect light that the path tracer gives it.

use crate::accuracy::scene_path;
use crate::headless_or_skip;
use akari_reference::{Aovs, NoProgress, Options, render};
use akari_scene::{Projection as SceneProjection, Scene};
use bevy::asset::RenderAssetUsages;
use bevy::math::DQuat;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use bevy_akari::render::guides::NeedsGuides;

/// Light of each pixel.
pub type Light = Vec<[f64; 3]>;

/// Bounces beyond which what is left is below a thousandth.
const ALL_BOUNCES: u32 = 16;

/// A scene that is drawn with one setting after the other.
pub struct Room {
    /// The app.
    pub headless: Headless,
    /// Its camera.
    pub camera: Entity,
    /// What each pixel shows.
    pub surfaces: Aovs,
    /// Indirect light of the path tracer.
    pub truth: Light,
    direct: Light,
}

impl Room {
    /// Loads a scene, traces its indirect light and draws its direct light. Textures are left out, but for those of the
    /// reference, so that the scene should have none. `None` without a GPU.
    ///
    /// # Panics
    /// If the scene cannot be read or drawn.
    pub fn new(test: &str, name: &str, side: u32, spp: u32) -> Option<Self> {
        Self::changed(test, name, side, spp, |_| {})
    }

    /// The same, of a scene that is changed after it was loaded.
    ///
    /// # Panics
    /// If the scene cannot be read or drawn.
    pub fn changed(
        test: &str,
        name: &str,
        side: u32,
        spp: u32,
        change: impl FnOnce(&mut Scene),
    ) -> Option<Self> {
        Self::of_bounces(test, name, side, spp, ALL_BOUNCES, change)
    }

    /// The same with the light of paths of so many segments at most: 3 is one bounce.
    ///
    /// # Panics
    /// If the scene cannot be read or drawn.
    pub fn of_bounces(
        test: &str,
        name: &str,
        side: u32,
        spp: u32,
        most_depth: u32,
        change: impl FnOnce(&mut Scene),
    ) -> Option<Self> {
        let mut headless = headless_or_skip(test)?;
        let mut scene = Scene::load(&scene_path(name)).expect("a scene of the repository");
        change(&mut scene);
        spawn_scene(headless.app.world_mut(), &scene);
        let camera = &scene.cameras[0];
        let SceneProjection::Perspective { yfov, znear, .. } = camera.projection else {
            panic!("{name}: no perspective camera");
        };
        let projection = Projection::Perspective(PerspectiveProjection {
            fov: yfov,
            near: znear,
            near_clip_plane: Vec4::new(0.0, 0.0, -1.0, -znear),
            ..default()
        });
        let place = Transform {
            translation: camera.world_from_local.translation.as_vec3(),
            rotation: DQuat::from_mat3(&camera.world_from_local.matrix3).as_quat(),
            ..default()
        };
        let camera = headless
            .spawn_camera(UVec2::splat(side), projection, place)
            .expect("a small image is possible");
        // With what indirect light will bring: it filters the roughness that direct light sees, too.
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert((AkariCamera, NeedsGuides));
        headless.step_until_ready().expect("it renders");
        let direct = read(&mut headless, camera);
        let traced = |max_depth| {
            let options = Options {
                width: side,
                height: side,
                spp,
                max_depth,
                aovs: true,
                pixel_centers: true,
                ..Options::default()
            };
            render(&scene, None, &options, &NoProgress).expect("it renders")
        };
        let (all, once) = (traced(most_depth), traced(2));
        let pairs = all.color.data.iter().zip(&once.color.data);
        let truth = pairs
            .map(|(a, b)| std::array::from_fn(|c| f64::from(a[c]) - f64::from(b[c])))
            .collect();
        Some(Self {
            headless,
            camera,
            surfaces: once.aovs.expect("asked for"),
            truth,
            direct,
        })
    }

    /// From now on draws with these settings.
    pub fn set(&mut self, components: impl Bundle) {
        let mut camera = self.headless.app.world_mut().entity_mut(self.camera);
        camera.insert(components);
        // The direct light that is taken from the picture has no shadows.
        if let Some(mut settings) = camera.get_mut::<VoxelGi>() {
            settings.shadow_cones = 0;
        }
    }

    /// Draws frames.
    ///
    /// # Panics
    /// If the GPU refuses.
    pub fn step(&mut self, frames: u32) {
        self.headless.step_until_ready().expect("it renders");
        for _ in 0..frames {
            self.headless.step().expect("it renders");
        }
    }

    /// Indirect light of one more frame.
    pub fn indirect(&mut self) -> Light {
        let all = read(&mut self.headless, self.camera);
        let pairs = all.iter().zip(&self.direct);
        pairs
            .map(|(a, b)| std::array::from_fn(|c| a[c] - b[c]))
            .collect()
    }
}

fn read(headless: &mut Headless, camera: Entity) -> Light {
    let image = headless.read(camera).expect("it can be read");
    let pixels = image.data.iter();
    pixels
        .map(|[r, g, b, _]| [f64::from(*r), f64::from(*g), f64::from(*b)])
        .collect()
}

/// Mean over the channels of the pixels that `chosen` takes, and relative RMSE there.
///
/// # Panics
/// If it takes none.
pub fn bias_and_error(light: &Light, truth: &Light, chosen: impl Fn(usize) -> bool) -> (f64, f64) {
    let (mut sum, mut true_sum, mut error, mut power) = (0.0, 0.0, 0.0, 0.0);
    let mut count = 0;
    for (i, (a, b)) in light.iter().zip(truth).enumerate() {
        if chosen(i) {
            count += 1;
            for (a, b) in a.iter().zip(b) {
                sum += a;
                true_sum += b;
                error += (a - b) * (a - b);
                power += b * b;
            }
        }
    }
    assert!(count > 0, "no pixel was chosen");
    (sum / true_sum - 1.0, (error / power).sqrt())
}

/// Pixels that stand out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Outliers {
    /// Brighter than their surroundings.
    pub bright: usize,
    /// Darker.
    pub dark: usize,
    /// Pixels that have surroundings to be held against.
    pub of: usize,
}

/// Pixels of the luminance `factor` and more of the median of the 5 × 5 pixels about them that show the same surface, and of
/// `1 / factor` and less. `chosen` says which pixels are looked at.
pub fn outliers(
    light: &Light,
    surfaces: &Aovs,
    side: usize,
    factor: f64,
    chosen: impl Fn(usize) -> bool,
) -> Outliers {
    /// Fewer pixels of the same surface say nothing.
    const LEAST: usize = 10;
    let luminance = |i: usize| {
        let [r, g, b] = light[i];
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let same = |i: usize, j: usize| {
        let near = |a: [f32; 3], b: [f32; 3]| Vec3::from(a).distance(Vec3::from(b)) < 1e-3;
        near(surfaces.normal[i], surfaces.normal[j]) && near(surfaces.albedo[i], surfaces.albedo[j])
    };
    let mut found = Outliers::default();
    for i in (0..light.len()).filter(|i| chosen(*i)) {
        let (x, y) = (i % side, i / side);
        let mut around: Vec<f64> = (y.saturating_sub(2)..(y + 3).min(side))
            .flat_map(|y| (x.saturating_sub(2)..(x + 3).min(side)).map(move |x| y * side + x))
            .filter(|j| *j != i && same(i, *j))
            .map(luminance)
            .collect();
        if around.len() < LEAST {
            continue;
        }
        around.sort_by(f64::total_cmp);
        let median = around[around.len() / 2];
        found.of += 1;
        found.bright += usize::from(luminance(i) >= factor * median);
        found.dark += usize::from(factor * luminance(i) <= median);
    }
    found
}

/// Spawns meshes and materials of a scene, its emissive panels among them; no textures.
pub fn spawn_scene(world: &mut World, scene: &Scene) {
    for instance in &scene.instances {
        let (scale, rotation, translation) =
            instance.world_from_local.to_scale_rotation_translation();
        let place = Transform {
            translation: translation.as_vec3(),
            rotation: rotation.as_quat(),
            scale: scale.as_vec3(),
        };
        for primitive in &scene.meshes[instance.mesh].primitives {
            let vectors =
                |of: &[Vec3]| -> Vec<[f32; 3]> { of.iter().map(Vec3::to_array).collect() };
            let mesh = Mesh::new(
                PrimitiveTopology::TriangleList,
                RenderAssetUsages::default(),
            )
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vectors(&primitive.positions))
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vectors(&primitive.normals))
            .with_inserted_indices(Indices::U32(primitive.indices.clone()));
            let source = &scene.materials[primitive.material];
            let dielectric = ((source.ior - 1.0) / (source.ior + 1.0)).powi(2) * source.specular;
            let emission = source.emission;
            let material = StandardMaterial {
                base_color: LinearRgba::from_vec4(source.base_color).into(),
                metallic: source.metallic,
                perceptual_roughness: source.roughness,
                reflectance: (dielectric / 0.16).sqrt().min(1.0),
                emissive: LinearRgba::rgb(emission.x, emission.y, emission.z),
                ..default()
            };
            let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
            let material = world
                .resource_mut::<Assets<StandardMaterial>>()
                .add(material);
            world.spawn((Mesh3d(mesh), MeshMaterial3d(material), place));
        }
    }
}
