//! A box over a floor under an area light, drawn with soft shadows from voxels, and as the path tracer sees it.

use crate::{headless_or_skip, spawn_camera};
use akari_reference::{NoProgress, Options, render};
use akari_scene::{
    AreaLight, AreaLightShape, Camera as SceneCamera, Instance, Material, Primitive, Scene,
};
use bevy::math::DAffine3;
use bevy::mesh::{Indices, VertexAttributeValues};
use bevy::prelude::*;
use bevy_akari::headless::Headless;
use bevy_akari::prelude::*;
use bevy_akari::render::capture::{CaptureBuffers, Light};
use bevy_akari::render::quality::Knobs;

/// Side of the picture, pixels.
pub const SIDE: u32 = 96;
const CAMERA: Vec3 = Vec3::new(0.0, 3.0, 4.0);
const ALBEDO: f32 = 0.8;
/// Radiance of the lights, nits.
pub const RADIANCE: f32 = 20.0;

/// A box of edge 1 in this place.
pub fn body_place() -> Transform {
    Transform::from_xyz(0.3, 0.8, 0.2)
        .with_rotation(Quat::from_rotation_y(0.5))
        .with_scale(Vec3::new(1.1, 0.5, 0.8))
}

/// A floor, a box and a light over them, with and without voxels.
pub struct Scenery {
    /// The app.
    pub headless: Headless,
    /// The camera, whose direct light is captured.
    pub camera: Entity,
    /// The light.
    pub light: Entity,
    /// What it is captured into.
    pub capture: CaptureBuffers,
    body: Entity,
}

/// White Lambert.
pub fn matte() -> StandardMaterial {
    StandardMaterial {
        base_color: Color::linear_rgb(ALBEDO, ALBEDO, ALBEDO),
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    }
}

/// Voxels for shadows by this many cones alone.
pub fn settings(shadow_cones: u32) -> VoxelGi {
    VoxelGi {
        resolution: 128,
        cascades: 2,
        voxel_size: 0.0625,
        shadow_cones,
        // Indirect light is not looked at.
        feedback: false,
        cones: 1,
        specular_cones: 0,
        light_rays: 1,
        pages_per_frame: 256,
        ..VoxelGi::preset(Quality::Low)
    }
}

impl Scenery {
    /// The box stands aside. None without a GPU.
    pub fn new(test: &str, light: Transform, size: Vec2) -> Option<Self> {
        let mut headless = headless_or_skip(test)?;
        let world = headless.app.world_mut();
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(matte());
        let mut meshes = world.resource_mut::<Assets<Mesh>>();
        let floor = meshes.add(Plane3d::default().mesh().size(8.0, 8.0).build());
        let cube = meshes.add(Cuboid::new(1.0, 1.0, 1.0));
        world.spawn((Mesh3d(floor), MeshMaterial3d(material.clone())));
        let body = world
            .spawn((
                Mesh3d(cube),
                MeshMaterial3d(material),
                Transform::from_xyz(-2.0, 0.8, -1.0),
            ))
            .id();
        let light = world
            .spawn((
                PolygonLight::rectangle(size.x, size.y).with_luminance(RADIANCE),
                light,
            ))
            .id();
        let camera = spawn_camera(&mut headless, SIDE, CAMERA);
        let capture = CaptureBuffers::default();
        let mut entity = headless.app.world_mut().entity_mut(camera);
        entity.insert((AkariCamera, capture.clone()));
        Some(Self {
            headless,
            camera,
            body,
            light,
            capture,
        })
    }

    /// Gives the camera these settings.
    pub fn set(&mut self, settings: VoxelGi) {
        let mut camera = self.headless.app.world_mut().entity_mut(self.camera);
        camera.insert(settings);
    }

    /// Moves the box.
    pub fn place_body(&mut self, place: Transform) {
        let mut body = self.headless.app.world_mut().entity_mut(self.body);
        body.insert(place);
    }

    /// Direct light of the latest frame.
    pub fn direct(&mut self) -> Vec<f32> {
        for _ in 0..8 {
            if let Some(capture) = self.capture.take() {
                drop(capture);
                break;
            }
            self.headless.step().expect("it renders");
        }
        for _ in 0..8 {
            self.headless.step().expect("it renders");
            if let Some(capture) = self.capture.take() {
                return capture.light(Light::Direct).iter().map(|c| c[0]).collect();
            }
        }
        panic!("nothing was captured");
    }

    /// The same once all pipelines and voxels are there.
    pub fn settled(&mut self) -> Vec<f32> {
        self.headless.step_until_ready().expect("it renders");
        for _ in 0..6 {
            self.headless.step().expect("it renders");
        }
        self.direct()
    }
}

fn primitive(mesh: &Mesh) -> Primitive {
    let vectors = |attribute| match mesh.attribute(attribute) {
        Some(VertexAttributeValues::Float32x3(values)) => {
            values.iter().map(|v| Vec3::from(*v)).collect()
        }
        _ => panic!("three floats"),
    };
    let indices = match mesh.indices() {
        Some(Indices::U32(indices)) => indices.clone(),
        Some(Indices::U16(indices)) => indices.iter().map(|i| u32::from(*i)).collect(),
        None => panic!("indices"),
    };
    Primitive {
        positions: vectors(Mesh::ATTRIBUTE_POSITION),
        normals: vectors(Mesh::ATTRIBUTE_NORMAL),
        indices,
        ..Primitive::default()
    }
}

fn world_from(place: &Transform) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        place.scale.as_dvec3(),
        place.rotation.as_dquat(),
        place.translation.as_dvec3(),
    )
}

/// What the path tracer says.
pub struct Truth {
    shadowed: Vec<f32>,
    whole: Vec<f32>,
    /// Of pixels of the floor, away from edges of the box.
    on_floor: Vec<bool>,
}

impl Truth {
    /// By `spp` paths a pixel.
    pub fn new(body: &Transform, light: &Transform, size: Vec2, spp: u32) -> Self {
        let floor = Plane3d::default().mesh().size(8.0, 8.0).build();
        let cube = Cuboid::new(1.0, 1.0, 1.0).mesh().build();
        let mesh = |mesh: &Mesh| akari_scene::Mesh {
            name: String::new(),
            primitives: vec![primitive(mesh)],
        };
        let instance = |mesh, place: &Transform| Instance {
            name: String::new(),
            mesh,
            world_from_local: world_from(place),
        };
        let view =
            Transform::from_translation(CAMERA).looking_at(Vec3::new(0.0, 0.4, 0.0), Vec3::Y);
        let PerspectiveProjection { fov, near, .. } = PerspectiveProjection::default();
        let scene = Scene {
            meshes: vec![mesh(&floor), mesh(&cube)],
            materials: vec![Material {
                base_color: Vec3::splat(ALBEDO).extend(1.0),
                metallic: 0.0,
                specular: 0.0,
                ..Material::default()
            }],
            instances: vec![instance(0, &Transform::IDENTITY), instance(1, body)],
            cameras: vec![SceneCamera {
                name: String::new(),
                world_from_local: world_from(&view),
                projection: akari_scene::Projection::Perspective {
                    yfov: fov,
                    aspect: None,
                    znear: near,
                    zfar: None,
                },
            }],
            area_lights: vec![AreaLight {
                name: String::new(),
                shape: AreaLightShape::Rect {
                    width: size.x,
                    height: size.y,
                },
                radiance: Vec3::splat(RADIANCE),
                world_from_local: world_from(light),
            }],
            ..Scene::default()
        };
        let traced = |no_occlusion| {
            let options = Options {
                width: SIDE,
                height: SIDE,
                spp,
                max_depth: 2,
                no_occlusion,
                pixel_centers: true,
                aovs: true,
                ..Options::default()
            };
            render(&scene, None, &options, &NoProgress).expect("it renders")
        };
        let (shadowed, whole) = (traced(false), traced(true));
        let aovs = shadowed.aovs.expect("asked for");
        let floor = |x: i32, y: i32| {
            let side = SIDE as i32;
            let i = (y.clamp(0, side - 1) * side + x.clamp(0, side - 1)) as usize;
            aovs.depth[i] > 0.0 && aovs.position[i][1].abs() < 1e-3 && aovs.normal[i][1] > 0.9
        };
        let on_floor = (0..(SIDE * SIDE) as i32)
            .map(|i| {
                let (x, y) = (i % SIDE as i32, i / SIDE as i32);
                (-1..=1).all(|dy| (-1..=1).all(|dx| floor(x + dx, y + dy)))
            })
            .collect();
        let red = |image: &akari_scene::exr_io::RgbImage| image.data.iter().map(|c| c[0]).collect();
        Self {
            shadowed: red(&shadowed.color),
            whole: red(&whole.color),
            on_floor,
        }
    }

    /// Which pixels of the floor have more than `low` and less than `high` of the light.
    pub fn region(&self, low: f32, high: f32) -> Vec<bool> {
        (0..self.whole.len())
            .map(|i| {
                let share = self.shadowed[i] / self.whole[i].max(1e-6);
                self.on_floor[i] && share > low && share < high
            })
            .collect()
    }

    /// Relative RMSE and bias on some pixels.
    pub fn error(&self, picture: &[f32], chosen: &[bool]) -> (f64, f64) {
        let (mut square, mut power, mut sum, mut true_sum) = (0.0, 0.0, 0.0, 0.0);
        for i in (0..picture.len()).filter(|i| chosen[*i]) {
            let (ours, theirs) = (f64::from(picture[i]), f64::from(self.shadowed[i]));
            square += (ours - theirs).powi(2);
            power += theirs * theirs;
            sum += ours;
            true_sum += theirs;
        }
        assert!(true_sum > 0.0, "no pixel was chosen");
        ((square / power).sqrt(), sum / true_sum - 1.0)
    }
}
