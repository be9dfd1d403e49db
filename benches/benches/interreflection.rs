//! What interreflection costs by tier, preset and number of reflecting triangles, and how wrong each is.
//!
//! `cargo bench -p bevy_akari_benches --bench interreflection` prints the tables; with `-- write` it also writes
//! `crates/akari_interreflection/docs/error_time.md` and its plot; with `-- tiers`, `presets`, `rays`, `sky`, `clusters` or `blockers`
//! it measures that table alone. Times are GPU spans of the adapter named in it, all in one run, but for those of the trees
//! that rays walk (`blockers`), which the CPU makes.

use bevy::light::EnvironmentMapLight;
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy_akari::interreflection::blockers::{BlockerMesh, Blockers};
use bevy_akari::interreflection::geometry::ReflectorMesh;
use bevy_akari::interreflection::pipeline::SHADE_LABEL;
use bevy_akari::prelude::*;
use bevy_akari_benches::plot::{Series, errors_over_gpu_time};
use bevy_akari_tests::reflecting::{Corner, Material, relative_rmse, triangles_as_patches, wall};
use std::fmt::Write;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

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
/// The tier that others are held against.
const BEST: u32 = 9;
/// Frames whose shortest span counts.
const FRAMES: usize = 9;
/// The same where a frame takes seconds.
const SLOW_FRAMES: usize = 1;
/// By how many metres the sides of the bent wall come forward.
const BEND: f32 = 0.35;
const METAL: Material = Material::Metal(0.3);
/// Squares along a side of the wall: 98 and 10,082 triangles.
const FEW: u32 = 7;
const MANY: u32 = 71;
/// The same of presets and of shadow rays: 968 triangles.
const PRESET_ROWS: u32 = 22;

/// What the wall adds, and the time of the pass in ms.
fn measure(
    corner: &mut Corner,
    settings: Interreflection,
    plain: &[f64],
    frames: usize,
) -> (Vec<f64>, f64) {
    let added = corner.added(settings, plain);
    let mut least = f64::INFINITY;
    for _ in 0..frames {
        corner.headless.step().expect("it renders");
        let spans = corner.headless.gpu_times();
        let ours = spans.iter().filter(|(name, _)| name.contains(SHADE_LABEL));
        least = ours.map(|(_, ms)| *ms).fold(least, f64::min);
    }
    (added, least)
}

/// Relative RMSE, and the largest difference over the mean.
fn errors(added: &[f64], truth: &[f64]) -> [f64; 2] {
    let mean = truth.iter().sum::<f64>() / truth.len() as f64;
    let largest = (added.iter().zip(truth))
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    [relative_rmse(added, truth), largest / mean]
}

/// Every tier at each triangle of a flat metal wall.
fn tiers(corner: &mut Corner, series: &mut Vec<Series>) -> String {
    let mut rows = String::from(
        "| tier | | ms | ns a triangle and pixel | relative RMSE | largest error over the mean |\n|---|---|---|---|---|---|\n",
    );
    corner.build(wall(FEW, 0.0), METAL);
    let plain = corner.plain();
    let (truth, _) = measure(corner, triangles_as_patches(BEST, 0.0), &plain, FRAMES);
    let mut lobes = Series::new("cosine lobes");
    let mut nodes = Series::new("nodes");
    for (index, name) in TIERS.iter().enumerate() {
        let tier = index as u32 + 1;
        let (added, time) = measure(corner, triangles_as_patches(tier, 0.0), &plain, FRAMES);
        let [rmse, largest] = errors(&added, &truth);
        let per_triangle = 1e6 * time / f64::from(2 * FEW * FEW * SIDE * SIDE);
        let _ = writeln!(
            rows,
            "| {tier} | {name} | {time:.1} | {per_triangle:.0} | {rmse:.1e} | {largest:.1e} |"
        );
        eprintln!("{}", rows.lines().last().unwrap_or_default());
        let into = if tier > 3 { &mut nodes } else { &mut lobes };
        if tier < BEST {
            into.push(
                name.chars().take(1).collect(),
                time,
                [rmse, largest],
                Some(time),
            );
        }
    }
    series.extend([lobes, nodes]);
    rows
}

/// Presets, and the highest one with coarser and finer clusters, at a bent metal wall.
fn presets(corner: &mut Corner, series: &mut Vec<Series>) -> String {
    let mut rows =
        String::from("| | ms | relative RMSE | largest error over the mean |\n|---|---|---|---|\n");
    corner.build(wall(PRESET_ROWS, BEND), METAL);
    let plain = corner.plain();
    let (truth, time) = measure(corner, triangles_as_patches(BEST, 0.0), &plain, FRAMES);
    let _ = writeln!(rows, "| all triangles, 8 nodes | {time:.1} | | |");
    let mut of_presets = Series::new("presets");
    let mut of_cuts = Series::new("error allowed, 3 nodes");
    let preset = |quality: Quality| AkariSettings::preset(quality).interreflection;
    let cuts = [0.8, 0.4, 0.2, 0.1, 0.05, 0.02];
    let high = preset(Quality::High);
    let settings = (Quality::ALL.into_iter())
        .map(|quality| (format!("{quality:?}").to_lowercase(), preset(quality), true))
        .chain(cuts.map(|cut| (format!("{cut}"), Interreflection { cut, ..high }, false)));
    for (name, settings, is_preset) in settings {
        let (added, time) = measure(corner, settings, &plain, FRAMES);
        let [rmse, largest] = errors(&added, &truth);
        let title = if is_preset {
            name.clone()
        } else {
            format!("high with `cut` {name}")
        };
        let _ = writeln!(rows, "| {title} | {time:.1} | {rmse:.1e} | {largest:.1e} |");
        eprintln!("{}", rows.lines().last().unwrap_or_default());
        let into = if is_preset {
            &mut of_presets
        } else {
            &mut of_cuts
        };
        // No place on a logarithmic axis.
        if rmse > 0.0 {
            into.push(name, time, [rmse, largest], Some(time));
        }
    }
    series.extend([of_presets, of_cuts]);
    rows
}

/// Few and many triangles of the same walls, one by one and in clusters.
fn clusters(corner: &mut Corner) -> String {
    let count = |rows: u32| 2 * rows * rows;
    let mut rows = format!(
        "| wall | {} triangles, ms | {} in clusters, ms | {} in clusters, ms | ratio | {} one by one, ms | relative RMSE against them | largest error over the mean |\n|---|---|---|---|---|---|---|---|\n",
        count(FEW),
        count(FEW),
        count(MANY),
        count(MANY)
    );
    let high = AkariSettings::preset(Quality::High).interreflection;
    for (name, bend, material) in [
        ("flat, Lambert", 0.0, Material::Lambert),
        ("flat, metal", 0.0, METAL),
        ("bent, Lambert", BEND, Material::Lambert),
        ("bent, metal", BEND, METAL),
    ] {
        corner.build(wall(FEW, bend), material);
        let plain = corner.plain();
        let (_, few_alone) = measure(corner, triangles_as_patches(high.tier, 0.0), &plain, FRAMES);
        let (_, few) = measure(
            corner,
            triangles_as_patches(high.tier, high.cut),
            &plain,
            FRAMES,
        );
        corner.build(wall(MANY, bend), material);
        let plain = corner.plain();
        let (truth, alone) = measure(
            corner,
            triangles_as_patches(high.tier, 0.0),
            &plain,
            SLOW_FRAMES,
        );
        let (added, many) = measure(
            corner,
            triangles_as_patches(high.tier, high.cut),
            &plain,
            FRAMES,
        );
        let [rmse, largest] = errors(&added, &truth);
        let _ = writeln!(
            rows,
            "| {name} | {few_alone:.1} | {few:.1} | {many:.1} | {:.1} | {alone:.1} | {:.1} % | {:.1} % |",
            many / few,
            100.0 * rmse,
            100.0 * largest
        );
        eprintln!("{}", rows.lines().last().unwrap_or_default());
    }
    rows
}

/// Rays that look what reflectors hide of each other, and nothing else changed.
fn shadow_rays(corner: &mut Corner) -> String {
    let mut rows = String::from("| rays | ms | times none |\n|---|---|---|\n");
    corner.build(wall(PRESET_ROWS, BEND), METAL);
    let plain = corner.plain();
    let high = AkariSettings::preset(Quality::High).interreflection;
    let mut none = f64::INFINITY;
    for shadow_rays in [0, 1, 3, 7] {
        let settings = Interreflection {
            shadow_rays,
            ..triangles_as_patches(high.tier, high.cut)
        };
        let (_, time) = measure(corner, settings, &plain, FRAMES);
        if shadow_rays == 0 {
            none = time;
        }
        let _ = writeln!(rows, "| {shadow_rays} | {time:.1} | {:.2} |", time / none);
        eprintln!("{}", rows.lines().last().unwrap_or_default());
    }
    rows
}

/// An even sky beside the light, and nothing else changed.
fn sky(corner: &mut Corner) -> String {
    let mut rows =
        String::from("| wall | rays | without, ms | with, ms | ratio |\n|---|---|---|---|---|\n");
    let high = AkariSettings::preset(Quality::High).interreflection;
    let world = corner.headless.app.world_mut();
    let mut cameras = world.query_filtered::<Entity, With<AkariCamera>>();
    let camera = cameras.iter(world).next().expect("a camera");
    for (name, material) in [("Lambert", Material::Lambert), ("metal", METAL)] {
        for shadow_rays in [0, 3] {
            let settings = Interreflection {
                shadow_rays,
                ..triangles_as_patches(high.tier, high.cut)
            };
            corner.build(wall(PRESET_ROWS, BEND), material);
            let plain = corner.plain();
            let (_, without) = measure(corner, settings, &plain, FRAMES);
            let world = corner.headless.app.world_mut();
            let mut images = world.resource_mut::<Assets<Image>>();
            let map = EnvironmentMapLight::solid_color(&mut images, Color::WHITE);
            world.entity_mut(camera).insert(map);
            let (_, with) = measure(corner, settings, &plain, FRAMES);
            let world = corner.headless.app.world_mut();
            world.entity_mut(camera).remove::<EnvironmentMapLight>();
            let _ = writeln!(
                rows,
                "| {name} | {shadow_rays} | {without:.1} | {with:.1} | {:.2} |",
                with / without
            );
            eprintln!("{}", rows.lines().last().unwrap_or_default());
        }
    }
    rows
}

/// CPU time, in ms, of what rays walk: trees of meshes that are new, and what a body that moves costs.
fn blockers() -> String {
    const TRIES: usize = 5;
    let mut rows = String::from(
        "| triangles | tree of a mesh, ms | boxes of a body that moved, ms | all for the GPU, ms |\n|---|---|---|---|\n",
    );
    for squares in [22, 71, 224] {
        let mesh = ReflectorMesh::new(&wall(squares, BEND)).expect("a wall of triangles");
        let corners: Vec<_> = mesh.triangles.iter().map(|(corners, _)| *corners).collect();
        let mut least = [f64::INFINITY; 3];
        for _ in 0..TRIES {
            let mut lap = Instant::now();
            let mut times = [0.0; 3];
            let mut end = |which: usize| {
                times[which] = 1e3 * lap.elapsed().as_secs_f64();
                lap = Instant::now();
            };
            let mesh = BlockerMesh::new(corners.clone());
            end(0);
            let moved = mesh.placed(&Affine3A::from_rotation_y(1.0));
            end(1);
            black_box(Blockers::new([&moved]));
            end(2);
            for (least, time) in least.iter_mut().zip(times) {
                *least = least.min(time);
            }
        }
        let [tree, boxes, all] = least;
        let _ = writeln!(
            rows,
            "| {} | {tree:.2} | {boxes:.2} | {all:.2} |",
            corners.len()
        );
    }
    rows
}

fn main() {
    if std::env::args().any(|argument| argument == "blockers") {
        print!("{}", blockers());
        return;
    }
    let Some(mut corner) = Corner::new("interreflection", SIDE) else {
        return;
    };
    let adapter = corner.headless.adapter();
    // Without the driver.
    let adapter = adapter.split(" (Mesa").next().unwrap_or_default();
    let mut series = Vec::new();
    let tables: [(&str, fn(&mut Corner) -> String); 5] = [
        ("tiers", |corner| tiers(corner, &mut Vec::new())),
        ("presets", |corner| presets(corner, &mut Vec::new())),
        ("rays", shadow_rays),
        ("sky", sky),
        ("clusters", clusters),
    ];
    for (name, table) in tables {
        if std::env::args().any(|argument| argument == name) {
            print!("{}", table(&mut corner));
            return;
        }
    }
    let clusters = clusters(&mut corner);
    let tiers = tiers(&mut corner, &mut series);
    let presets = presets(&mut corner, &mut series);
    let rays = shadow_rays(&mut corner);
    let sky = sky(&mut corner);
    let high = AkariSettings::preset(Quality::High).interreflection;
    let text = format!(
        "# One bounce by triangles: error against time\n\n\
        Written by `cargo bench -p bevy_akari_benches --bench interreflection -- write`; do not edit.\n\n\
        A wall of 2 m, cut into triangles, lights a Lambert floor before it; {SIDE} × {SIDE} pixels, one area light. Times are\n\
        the shortest GPU spans of the shading pass of {FRAMES} frames on {adapter}, all in one run; errors are those of the\n\
        light that is added, against all triangles with 8 nodes an edge. What all of it is off from the path tracer stands in\n\
        the README.\n\n\
        ## Tiers\n\nA flat metal wall of alpha 0.09, each of its {} triangles. CPU instructions of the integrals alone:\n\
        [akari_math](../../akari_math/docs/sg_polygon_instructions.md).\n\n{tiers}\n\
        ## Presets\n\nA bent metal wall of 968 triangles.\n\n{presets}\n\
        ## Shadow rays\n\nThe same wall with `tier` and `cut` of the preset `high`, and so many rays for each light of a triangle or\n\
        cluster; presets have 0, 1, 3 and 7.\n\n{rays}\n\
        ## Sky\n\nThe same wall, of Lambert too, beside the light and an even sky (`EnvironmentMapLight`): mirrors look at it from\n\
        16 places, and with rays at what hides each.\n\n{sky}\n\
        ## Few and many triangles\n\nThe bent wall's sides come {BEND} m forward. Clusters may err by {} (`cut` of the preset `high`).\n\n{clusters}\n\
        ![error against time](error_time.svg)\n",
        2 * FEW * FEW,
        high.cut
    );
    print!("{text}");
    if std::env::args().any(|argument| argument == "write") {
        let folder =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/akari_interreflection/docs");
        let heading = format!("One bounce by triangles: error against time of a frame ({adapter})");
        let plot = errors_over_gpu_time(
            &heading,
            "shading pass, ms",
            ["relative RMSE", "largest error over the mean"],
            &series,
        );
        let written = std::fs::create_dir_all(&folder)
            .and_then(|()| std::fs::write(folder.join("error_time.md"), &text))
            .and_then(|()| std::fs::write(folder.join("error_time.svg"), plot));
        if let Err(error) = written {
            eprintln!("cannot write to {}: {error}", folder.display());
            std::process::exit(1);
        }
    }
}
