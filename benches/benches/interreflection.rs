//! What interreflection costs by tier and by number of reflecting triangles, and how far tiers are apart.
//!
//! `cargo bench -p bevy_akari_benches --bench interreflection`; times are GPU spans of the adapter named first, all tiers in
//! one run. `-- write` writes the table into the documentation of `akari_interreflection`.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_akari::headless::{Headless, ReadImage};
use bevy_akari::interreflection::pipeline::SHADE_LABEL;
use bevy_akari::prelude::*;
use bevy_akari_tests::{headless_or_skip, picture, spawn_camera};
use std::fmt::Write;

/// Side of the pictures.
const SIDE: u32 = 32;
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
/// Frames that are timed; the first draws what a software GPU compiles.
const FRAMES: usize = 3;

/// A square wall of 2 m in `rows`² squares of two triangles.
fn wall(rows: u32) -> Mesh {
    let at = |i: u32| 2.0 * i as f32 / rows as f32;
    let mut positions = Vec::new();
    for y in 0..=rows {
        for x in 0..=rows {
            positions.push([at(x) - 1.0, at(y), -1.0]);
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
    let normals = vec![[0.0, 0.0, 1.0]; positions.len()];
    Mesh::new(
        PrimitiveTopology::TriangleList,
        RenderAssetUsages::default(),
    )
    .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
    .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
    .with_inserted_indices(Indices::U32(indices))
}

struct Bench {
    headless: Headless,
    camera: Entity,
    wall: Entity,
    materials: [Handle<StandardMaterial>; 2],
}

impl Bench {
    fn new() -> Option<Self> {
        let mut headless = headless_or_skip("interreflection")?;
        let world = headless.app.world_mut();
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        let lambert = materials.add(StandardMaterial {
            base_color: Color::linear_rgb(0.7, 0.5, 0.3),
            reflectance: 0.0,
            ..default()
        });
        let metal = materials.add(StandardMaterial {
            metallic: 1.0,
            perceptual_roughness: 0.3,
            ..default()
        });
        let mut meshes = world.resource_mut::<Assets<Mesh>>();
        let floor = meshes.add(Plane3d::default().mesh().size(2.0, 2.0).build());
        let one = meshes.add(wall(1));
        world.spawn((Mesh3d(floor), MeshMaterial3d(lambert.clone())));
        let wall = world
            .spawn((Mesh3d(one), MeshMaterial3d(lambert.clone())))
            .id();
        world.spawn((
            PolygonLight::rectangle(0.5, 0.5).with_luminance(30.0),
            Transform::from_xyz(0.35, 1.9, 1.0).looking_at(Vec3::new(0.0, 0.35, -0.6), Vec3::Y),
        ));
        let camera = spawn_camera(&mut headless, SIDE, Vec3::new(0.0, 2.2, 1.6));
        Some(Self {
            headless,
            camera,
            wall,
            materials: [lambert, metal],
        })
    }

    /// What the wall adds, and the time of the pass in ms.
    fn measure(&mut self, rows: u32, glossy: bool, tier: u32) -> (Vec<f64>, f64) {
        let material = self.materials[usize::from(glossy)].clone();
        let world = self.headless.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(wall(rows));
        world.entity_mut(self.camera).insert(Interreflection {
            tier,
            // As many patches as triangles.
            patch: 4.0,
            most_patches: 65_536,
        });
        let body = (Mesh3d(mesh), MeshMaterial3d(material));
        world
            .entity_mut(self.wall)
            .remove::<Reflector>()
            .insert(body);
        let without = picture(&mut self.headless, self.camera);
        let world = self.headless.app.world_mut();
        world.entity_mut(self.wall).insert(Reflector);
        let with = picture(&mut self.headless, self.camera);
        let mut times = Vec::new();
        for _ in 0..FRAMES {
            self.headless.step().expect("it renders");
            let spans = self.headless.gpu_times();
            times.extend(
                spans
                    .iter()
                    .filter(|(name, _)| name.contains(SHADE_LABEL))
                    .map(|(_, ms)| *ms),
            );
        }
        let time = times.into_iter().fold(f64::INFINITY, f64::min);
        let values = |image: &ReadImage| -> Vec<f64> {
            let pixels = image.data.iter().flat_map(|pixel| &pixel[..3]);
            pixels.map(|value| f64::from(*value)).collect()
        };
        let added = (values(&with).iter())
            .zip(values(&without))
            .map(|(a, b)| a - b)
            .collect();
        (added, time)
    }
}

fn relative_rmse(a: &[f64], truth: &[f64]) -> f64 {
    let error: f64 = a.iter().zip(truth).map(|(a, b)| (a - b) * (a - b)).sum();
    (error / truth.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

fn main() {
    let Some(mut bench) = Bench::new() else {
        return;
    };
    let mut page = String::from(
        "# One bounce by triangles: what tiers and triangles cost\n\n\
         Written by `cargo bench -p bevy_akari_benches --bench interreflection -- write`; do not edit.\n\n",
    );
    let _ = writeln!(
        page,
        "A wall of 2 m, cut into triangles, lights a Lambert floor before it; {SIDE} x {SIDE} pixels, one area light. Smallest\n\
         GPU time of the shading pass of {FRAMES} frames on {}. Errors against the path tracer stand in the README; the\n\
         differences here are those of the light that is added, as relative RMSE.\n",
        bench.headless.adapter()
    );
    page.push_str("## Tiers\n\nA metal wall of alpha 0.09 in 98 triangles.\n\n| tier | | ms | difference from 8 nodes |\n|---|---|---|---|\n");
    let (best, _) = bench.measure(7, true, 9);
    for (index, name) in TIERS.iter().enumerate() {
        let tier = index as u32 + 1;
        let (added, time) = bench.measure(7, true, tier);
        let error = relative_rmse(&added, &best);
        let row = format!("| {tier} | {name} | {time:.1} | {error:.1e} |");
        println!("{row}");
        let _ = writeln!(page, "{row}");
    }
    page.push_str(
        "\n## Triangles\n\nEvery pixel visits every triangle. Differences are from 2 triangles.\n\n\
         | triangles | Lambert, ms | difference | metal, 3 nodes, ms | difference |\n|---|---|---|---|---|\n",
    );
    let whole = [false, true].map(|glossy| bench.measure(1, glossy, 6).0);
    for rows in [1, 7, 22] {
        let _ = write!(page, "| {} ", 2 * rows * rows);
        for (glossy, whole) in [false, true].into_iter().zip(&whole) {
            let (added, time) = bench.measure(rows, glossy, 6);
            let error = relative_rmse(&added, whole);
            let cells = format!("| {time:.1} | {:.1} % ", 100.0 * error);
            println!("{} {cells}", 2 * rows * rows);
            page.push_str(&cells);
        }
        page.push_str("|\n");
    }
    println!("{page}");
    if std::env::args().any(|argument| argument == "write") {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../crates/akari_interreflection/docs/interreflection.md"
        );
        let folder = std::path::Path::new(path).parent();
        let made = folder.map_or(Ok(()), std::fs::create_dir_all);
        if let Err(error) = made.and_then(|()| std::fs::write(path, &page)) {
            eprintln!("{path}: {error}");
        }
    }
}
