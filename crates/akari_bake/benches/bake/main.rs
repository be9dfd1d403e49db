//! Bake time per vertex, size and error of its trees, beside the paper's method on the same vertices.
//!
//! `cargo bench -p akari_bake [MESH]...`: meshes by part of their names; their folder in `AKARI_MESHES`. Times are CPU
//! time of one thread. Without `--bench`, as tests run it, it measures a small mesh made here.
//!
//! `cargo bench -p akari_bake -- whole [MESH]...` bakes all of the meshes, and tells time, memory and size.

mod mesh_files;
mod paper;

use std::path::{Path, PathBuf};

use akari_bake::fit::{FitSettings, Fitter};
use akari_bake::probe::Probe;
use akari_bake::{
    FaceMask, Geometry, GeometryOptions, MeshInput, Options, Phase, Progress, Roles, Status,
};
use akari_visibility::sites::Site;
use glam::{DAffine3, Vec3};
use mesh_files::Mesh;

/// Vertices that are measured: so many runs of so many neighbours, as a bake visits them.
const RUNS: usize = 5;
const RUN: usize = 40;
/// Of these, every so-manieth is given to the paper's method, which takes long.
const PAPER_STRIDE: usize = 10;
/// Texels along the side of a face, as in the paper.
const SIZE: u32 = 64;
/// Share of a face's texels that a leaf may have wrong.
const TOLERANCES: [f32; 2] = [0.0, 0.0005];
/// Bytes per leaf of the paper: its data divided by vertices and leaves (table 1), the same to 1 % in its three scenes.
const PAPER_BYTES_PER_LEAF: f64 = 12.8;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if !arguments.iter().any(|a| a == "--bench") {
        measure("bumpy sphere", bumpy_sphere(24), 2, 4);
        return;
    }
    let folder = std::env::var_os("AKARI_MESHES").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/meshes"),
        PathBuf::from,
    );
    let whole = arguments.iter().any(|a| a == "whole");
    let wanted: Vec<&String> = arguments
        .iter()
        .filter(|a| !a.starts_with('-') && *a != "whole")
        .collect();
    for (name, file) in [
        ("teapot", "teapot.obj"),
        ("bunny", "stanford-bunny.obj.gz"),
        ("dragon", "dragon_vrip_res2.ply.gz"),
    ] {
        if !wanted.is_empty() && !wanted.iter().any(|w| name.contains(w.as_str())) {
            continue;
        }
        match mesh_files::read(&folder.join(file)) {
            Ok(mesh) if whole => bake_all(name, mesh),
            Ok(mesh) => measure(name, mesh, RUNS, RUN),
            Err(e) => println!("{name}: {}: {e}", folder.join(file).display()),
        }
    }
}

/// CPU time of this thread, seconds; the clock's where the system does not tell.
fn thread_seconds() -> f64 {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|s| s.split_whitespace().next()?.parse::<f64>().ok())
        .map_or_else(
            || {
                START
                    .get_or_init(std::time::Instant::now)
                    .elapsed()
                    .as_secs_f64()
            },
            |nanoseconds| 1e-9 * nanoseconds,
        )
}

/// Scales a mesh to 1 m and puts a floor of 4 m under it.
fn with_floor(mut mesh: Mesh) -> (Mesh, Mesh) {
    let min = mesh
        .positions
        .iter()
        .copied()
        .reduce(Vec3::min)
        .unwrap_or_default();
    let max = mesh
        .positions
        .iter()
        .copied()
        .reduce(Vec3::max)
        .unwrap_or_default();
    let (middle, scale) = (0.5 * (min + max), (max - min).max_element().recip());
    for p in &mut mesh.positions {
        *p = (*p - middle) * scale;
    }
    let y = (min.y - middle.y) * scale;
    let floor = Mesh {
        positions: [(-2.0, -2.0), (-2.0, 2.0), (2.0, 2.0), (2.0, -2.0)]
            .map(|(x, z)| Vec3::new(x, y, z))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    (mesh, floor)
}

#[derive(Clone, Copy, Default)]
struct Row {
    rays: f64,
    trees: f64,
    leaves: f64,
    bytes: f64,
    wrong: f64,
    absolute: f64,
}

impl Row {
    fn print(&self, name: &str) {
        println!(
            "  {name:44} {:8.3} {:8.3} {:8.3} {:8.1} {:7.0} {:6.2} {:9.4} {:9.4}",
            1e3 * self.rays,
            1e3 * self.trees,
            1e3 * (self.rays + self.trees),
            self.leaves,
            self.bytes,
            self.bytes / self.leaves,
            100.0 * self.wrong,
            100.0 * self.absolute,
        );
    }
}

fn input<'a>(name: &'a str, mesh: &'a Mesh) -> MeshInput<'a> {
    MeshInput {
        name,
        positions: &mesh.positions,
        triangles: &mesh.triangles,
        world_from_mesh: DAffine3::IDENTITY,
        roles: Roles::BOTH,
        two_sided: false,
    }
}

/// Largest memory of the process so far, MB, where the system tells it.
fn peak_megabytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(1e-3 * kilobytes)
}

/// Tells of each tenth.
struct Tenths(std::sync::Mutex<(Phase, u64)>);

impl Progress for Tenths {
    fn update(&self, status: &Status) {
        let now = (status.phase, 10 * status.done / status.total.max(1));
        let mut last = self
            .0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        if *last != now {
            *last = now;
            println!(
                "  {:?} {}0 %, {:.0} s, {:.0} s left, {:.0} MB",
                now.0,
                now.1,
                status.elapsed.as_secs_f64(),
                status.left.unwrap_or_default().as_secs_f64(),
                peak_megabytes().unwrap_or(f64::NAN),
            );
        }
    }
}

fn bake_all(name: &str, mesh: Mesh) {
    let (mesh, floor) = with_floor(mesh);
    let geometry = match Geometry::from_meshes(
        &[input(name, &mesh), input("floor", &floor)],
        GeometryOptions::default(),
    ) {
        Ok(geometry) => geometry,
        Err(e) => return println!("{name}: {e}"),
    };
    println!(
        "{name} over a floor: {} triangles; {:.0} MB before the bake",
        geometry.caster_count(),
        peak_megabytes().unwrap_or(f64::NAN),
    );
    let output =
        std::env::temp_dir().join(format!("akari_bench_{name}_{}.akari", std::process::id()));
    let tenths = Tenths(std::sync::Mutex::new((Phase::Writing, u64::MAX)));
    match akari_bake::bake(&geometry, &Options::default(), &output, &tenths) {
        Ok(report) => println!(
            "  {report:?}\n  {:.1} core-ms, {:.1} leaves, {:.0} bytes per sample; {:.2} bytes per leaf; wrong {:.4} %, |m−b| {:.4} %; peak {:.0} MB",
            1e3 * report.cpu_seconds.unwrap_or(f64::NAN) / report.samples as f64,
            report.leaves_per_sample(),
            report.bytes_per_sample(),
            report.bytes_per_leaf(),
            100.0 * report.misclassified_share(),
            100.0 * report.mean_absolute_error(),
            peak_megabytes().unwrap_or(f64::NAN),
        ),
        Err(e) => println!("{name}: {e}"),
    }
    // It was only made to be measured.
    let _ = std::fs::remove_file(&output);
    let _ = std::fs::remove_file(akari_bake::journal_path(&output));
}

/// Bytes of a sample in memory and on the GPU: its trees, six references, its position.
fn sample_bytes(trees: usize) -> f64 {
    (trees + 6 * size_of::<u32>() + 3 * size_of::<f32>()) as f64
}

fn measure(name: &str, mesh: Mesh, runs: usize, run: usize) {
    let (mesh, floor) = with_floor(mesh);
    let inputs = [input(name, &mesh), input("floor", &floor)];
    // The floor encloses the scene and would be left out; the paper has it, so it casts here too.
    let options = GeometryOptions {
        enclosure_casts: true,
    };
    let start = thread_seconds();
    let geometry = match Geometry::from_meshes(&inputs, options) {
        Ok(geometry) => geometry,
        Err(e) => return println!("{name}: {e}"),
    };
    let mut probe = Probe::new(&geometry, SIZE);
    println!(
        "{name} over a floor: {} triangles, {} vertices; BVH and welding {:.2} s; {} vertices measured",
        probe.caster_count(),
        probe.vertex_count(),
        thread_seconds() - start,
        runs * run,
    );
    println!(
        "  {:44} {:>8} {:>8} {:>8} {:>8} {:>7} {:>6} {:>9} {:>9}",
        "core-ms per vertex, at 64²",
        "rays",
        "trees",
        "all",
        "leaves",
        "bytes",
        "B/leaf",
        "wrong %",
        "|m−b| %"
    );
    let order = probe.vertices_along_curve();
    let chosen: Vec<Site> = (0..runs)
        .flat_map(|k| {
            let first = (2 * k + 1) * order.len() / (2 * runs);
            order[first..(first + run).min(order.len())].to_vec()
        })
        .map(Site::Vertex)
        .collect();
    let count = chosen.len() as f64;
    // Once for the caches, as in a bake; then for the clock.
    let mut masks: Vec<[FaceMask; 6]> = Vec::new();
    let mut rays = 0.0;
    for group in chosen.chunks(run) {
        probe.see(group[0]);
        let start = thread_seconds();
        for &site in group {
            std::hint::black_box(probe.see(site));
        }
        rays += (thread_seconds() - start) / count;
        for &site in group {
            masks.push(probe.see(site).clone());
        }
    }
    let mut ours = [Row::default(); TOLERANCES.len()];
    for (tolerance, result) in TOLERANCES.into_iter().zip(&mut ours) {
        let mut fitter = Fitter::new(FitSettings {
            tolerance,
            max_depth: 48,
        });
        let mut row = Row {
            rays,
            ..Row::default()
        };
        let (mut texels, mut wrong, mut absolute) = (0.0, 0.0, 0.0);
        let start = thread_seconds();
        for masks in &masks {
            let mut bytes = 0;
            for mask in masks {
                let Ok((tree, quality)) = fitter.fit(mask) else {
                    continue;
                };
                bytes += tree.byte_count();
                row.leaves += f64::from(quality.leaves) / count;
                texels += f64::from(quality.texels);
                wrong += f64::from(quality.misclassified);
                absolute += quality.absolute_error;
            }
            row.bytes += sample_bytes(bytes) / count;
        }
        row.trees = (thread_seconds() - start) / count;
        row.wrong = wrong / texels;
        row.absolute = absolute / texels;
        row.print(&format!("ours, leaf tolerance {tolerance}"));
        *result = row;
    }
    paper_rows(&probe, &chosen, &masks, ours);
}

/// The paper's method on some of the vertices, and ours beside it.
fn paper_rows(
    probe: &Probe<'_>,
    chosen: &[Site],
    masks: &[[FaceMask; 6]],
    ours: [Row; TOLERANCES.len()],
) {
    let triangles: Vec<[Vec3; 3]> = (0..probe.caster_count()).map(|i| probe.caster(i)).collect();
    let bvh = paper::bvh(&triangles);
    let some: Vec<usize> = (0..chosen.len()).step_by(PAPER_STRIDE).collect();
    let count = some.len() as f64;
    let mut bits = Vec::new();
    let (mut rays, mut differing, mut compared) = (0.0, 0_u64, 0_u64);
    for &i in &some {
        let Some(origin) = probe.origin(chosen[i]) else {
            continue;
        };
        let start = thread_seconds();
        let faces = paper::trace(&bvh, origin.position, origin.tmin, SIZE);
        rays += (thread_seconds() - start) / count;
        for (face, mask) in faces.iter().zip(&masks[i]) {
            for (texel, &bit) in (0_u32..).zip(face) {
                if let Some(ours) = mask.get(texel % SIZE, texel / SIZE) {
                    compared += 1;
                    differing += u64::from(ours != bit);
                }
            }
        }
        bits.push((i, faces));
    }
    let [exact, coarse] = TOLERANCES.map(f64::from);
    let mut comparisons: Vec<(String, Row, Row)> = Vec::new();
    for (patient, which, all) in [
        (true, 0, true),
        (true, 1, true),
        (false, 0, true),
        (false, 1, true),
        (true, 1, false),
    ] {
        let tolerance = [exact, coarse][which];
        let mut fit = paper::Fit::default();
        let start = thread_seconds();
        for (i, faces) in &bits {
            for (face, mask) in faces.iter().zip(&masks[*i]) {
                let centre = |i: u32| f64::from(2 * i + 1) / f64::from(SIZE) - 1.0;
                let mut texels: Vec<paper::Texel> = (0_u32..)
                    .zip(face)
                    .filter(|(t, _)| all || mask.get(t % SIZE, t / SIZE).is_some())
                    .map(|(t, &bit)| paper::Texel {
                        x: centre(t % SIZE),
                        y: centre(t / SIZE),
                        visible: f64::from(u8::from(bit)),
                    })
                    .collect();
                paper::fit(
                    &mut texels,
                    tolerance * f64::from(SIZE * SIZE),
                    patient,
                    &mut fit,
                );
            }
        }
        let trees = (thread_seconds() - start) / count;
        let leaves = fit.leaves as f64 / count;
        let texels = fit.texels as f64;
        let row = Row {
            rays,
            trees,
            leaves,
            bytes: PAPER_BYTES_PER_LEAF * leaves,
            wrong: fit.misclassified as f64 / texels,
            absolute: fit.absolute_error / texels,
        };
        let name = format!(
            "paper, {}{}, ε {tolerance:.4}",
            if patient {
                "80 iterations"
            } else {
                "argmin's stop"
            },
            if all { "" } else { ", horizon left out" },
        );
        row.print(&name);
        comparisons.push((name, row, ours[which]));
    }
    for (name, paper, ours) in comparisons {
        println!(
            "  against {name}: {:.0} times less time, {:.2} of the leaves, {:.2} of the bytes, {:.2} of the error",
            (paper.rays + paper.trees) / (ours.rays + ours.trees),
            ours.leaves / paper.leaves,
            ours.bytes / paper.bytes,
            if paper.absolute > 0.0 {
                ours.absolute / paper.absolute
            } else {
                0.0
            },
        );
    }
    println!(
        "  the paper's rays and our bits differ in {differing} of {compared} texels above the horizon\n"
    );
}

/// A sphere with waves: a mesh for tests.
fn bumpy_sphere(n: u32) -> Mesh {
    let mut mesh = Mesh {
        positions: Vec::new(),
        triangles: Vec::new(),
    };
    for i in 0..=n {
        for j in 0..2 * n {
            let theta = std::f32::consts::PI * i as f32 / n as f32;
            let phi = std::f32::consts::PI * j as f32 / n as f32;
            let radius = 1.0 + 0.2 * (5.0 * phi).sin() * (4.0 * theta).sin();
            mesh.positions.push(
                radius
                    * Vec3::new(
                        theta.sin() * phi.cos(),
                        theta.cos(),
                        theta.sin() * phi.sin(),
                    ),
            );
        }
    }
    for i in 0..n {
        for j in 0..2 * n {
            let at = |i: u32, j: u32| i * 2 * n + j % (2 * n);
            mesh.triangles
                .push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
            mesh.triangles
                .push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
        }
    }
    mesh
}
