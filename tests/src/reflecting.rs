//! A corner that reflects: a floor, and a wall of as many triangles as one likes.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::prelude::*;

use crate::{headless_or_skip, picture, spawn_camera};

/// A wall of 2 m in `rows`² squares of two triangles, whose sides come forward by `bend` metres.
pub fn wall(rows: u32, bend: f32) -> Mesh {
    let at = |i: u32| 2.0 * i as f32 / rows as f32;
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for y in 0..=rows {
        for x in 0..=rows {
            let across = at(x) - 1.0;
            positions.push([across, at(y), bend * across * across - 1.0]);
            let normal = Vec3::new(-2.0 * bend * across, 0.0, 1.0).normalize();
            normals.push(normal.to_array());
        }
    }
    let mut indices = Vec::new();
    for y in 0..rows {
        for x in 0..rows {
            let a = y * (rows + 1) + x;
            let (b, c, d) = (a + 1, a + rows + 2, a + rows + 1);
            indices.extend([a, b, c, a, c, d]);
        }
    }
    Mesh::new(
        PrimitiveTopology::TriangleList,
        RenderAssetUsages::default(),
    )
    .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
    .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
    .with_inserted_indices(Indices::U32(indices))
}

/// What the wall is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Material {
    /// Diffuse.
    Lambert,
    /// Metal of a perceptual roughness.
    Metal(f32),
}

/// A Lambert floor before a wall, in the light of one panel.
pub struct Corner {
    /// The app.
    pub headless: Headless,
    camera: Entity,
    wall: Entity,
}

impl Corner {
    /// `None` without a GPU.
    ///
    /// # Panics
    /// If it cannot be drawn.
    pub fn new(test: &str, side: u32) -> Option<Self> {
        let mut headless = headless_or_skip(test)?;
        let world = headless.app.world_mut();
        let lambert = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(StandardMaterial {
                base_color: Color::linear_rgb(0.7, 0.5, 0.3),
                reflectance: 0.0,
                ..default()
            });
        let mut meshes = world.resource_mut::<Assets<Mesh>>();
        let floor = meshes.add(Plane3d::default().mesh().size(2.0, 2.0).build());
        world.spawn((Mesh3d(floor), MeshMaterial3d(lambert)));
        let wall = world.spawn(Transform::IDENTITY).id();
        world.spawn((
            PolygonLight::rectangle(0.5, 0.5).with_luminance(30.0),
            Transform::from_xyz(0.35, 1.9, 1.0).looking_at(Vec3::new(0.0, 0.35, -0.6), Vec3::Y),
        ));
        let camera = spawn_camera(&mut headless, side, Vec3::new(0.0, 2.2, 1.6));
        // From the beginning, so that the picture without reflectors has the light.
        headless
            .app
            .world_mut()
            .entity_mut(camera)
            .insert(AkariCamera);
        Some(Self {
            headless,
            camera,
            wall,
        })
    }

    /// Puts up a wall that reflects nothing yet.
    pub fn build(&mut self, mesh: Mesh, material: Material) {
        let world = self.headless.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let material = match material {
            Material::Lambert => StandardMaterial {
                base_color: Color::linear_rgb(0.7, 0.5, 0.3),
                reflectance: 0.0,
                ..default()
            },
            Material::Metal(perceptual_roughness) => StandardMaterial {
                metallic: 1.0,
                perceptual_roughness,
                ..default()
            },
        };
        let material = world
            .resource_mut::<Assets<StandardMaterial>>()
            .add(material);
        world
            .entity_mut(self.wall)
            .remove::<Reflector>()
            .insert((Mesh3d(mesh), MeshMaterial3d(material)));
    }

    fn values(&mut self) -> Vec<f64> {
        let image: ReadImage = picture(&mut self.headless, self.camera);
        let pixels = image.data.iter().flat_map(|pixel| &pixel[..3]);
        pixels.map(|value| f64::from(*value)).collect()
    }

    /// The picture without what the wall sends on.
    pub fn plain(&mut self) -> Vec<f64> {
        let mut wall = self.headless.app.world_mut().entity_mut(self.wall);
        wall.remove::<Reflector>();
        self.values()
    }

    /// What the wall adds to it.
    pub fn added(&mut self, settings: Interreflection, plain: &[f64]) -> Vec<f64> {
        let world = self.headless.app.world_mut();
        world.entity_mut(self.camera).insert(settings);
        world.entity_mut(self.wall).insert(Reflector);
        let with = self.values();
        with.iter().zip(plain).map(|(a, b)| a - b).collect()
    }
}

/// Settings that make a patch of each triangle.
pub fn triangles_as_patches(tier: u32, cut: f32) -> Interreflection {
    Interreflection {
        tier,
        patch: 4.0,
        most_patches: 65_536,
        cut,
        shadow_rays: 0,
    }
}

/// Root mean square of a difference over that of the second.
pub fn relative_rmse(a: &[f64], truth: &[f64]) -> f64 {
    let error: f64 = a.iter().zip(truth).map(|(a, b)| (a - b) * (a - b)).sum();
    (error / truth.iter().map(|b| b * b).sum::<f64>()).sqrt()
}
