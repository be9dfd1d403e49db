//! Spherical Gaussians over triangles: error against time of every way to integrate them, on the GPU and on the CPU.
//!
//! `cargo bench -p bevy_akari_benches --bench sg_polygons` prints the table; with `-- write` it also writes
//! `crates/akari_math/docs/sg_polygon.md` and `.svg`. Times are GPU spans of the adapter named first, and times of the Rust
//! twins, the ways taking turns in one run. With `-- instructions` it counts CPU instructions of the twins instead, where
//! `perf` or `valgrind` can, and with `-- instructions write` writes `crates/akari_math/docs/sg_polygon_instructions.md`.

use akari_gpu_test::{DeviceType, Gpu, Kernel, gpu, time_kernels};
use akari_math::WGSL_MODULES;
use akari_math::ltc::polygon::form_factor;
use akari_math::oracle::{gauss_legendre, sg_integral, sg_polygon::sg_polygon};
use akari_math::sg::ltc::sg_ltc_polygon_integral;
use akari_math::sg::polygon::sg_polygon_integral;
use bevy_akari_benches::instructions::Counter;
use bevy_akari_benches::plot::{Series, error_against_time};
use glam::{Quat, Vec3};
use std::fmt::Write;
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// Triangles for each λ.
const TRIANGLES: usize = 400;
/// λ of the errors and of the times; the mixtures leave smaller ones to quadrature.
const SHARPNESSES: [f32; 6] = [10.0, 50.0, 200.0, 1e3, 1e4, 1e7];
/// Lobes over each triangle in one invocation, so that what a kernel does besides does not count.
const LOBES: usize = 16;
/// Copies of the triangles in the input of the GPU, so that it is busy. A software adapter has enough with one, and
/// its spans stay shorter than the slices in which a machine shares its processors.
const COPIES: usize = 1;
const COPIES_ON_HARDWARE: usize = 64;
/// Rounds whose fastest counts, on the GPU and on the CPU.
const GPU_ROUNDS: usize = 150;
const CPU_ROUNDS: usize = 15;

/// A way to integrate.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    /// The clamped cosine, which tells nothing of the lobe: what a Lambert surface costs.
    Cosine,
    /// Cosine lobes.
    Mixture(u32),
    /// Gauss-Legendre nodes in the angle s.
    Angle(usize),
    /// Nodes of our rules.
    Rule(u32),
}

const WAYS: [Way; 13] = [
    Way::Cosine,
    Way::Mixture(1),
    Way::Mixture(2),
    Way::Mixture(3),
    Way::Angle(4),
    Way::Angle(6),
    Way::Angle(8),
    Way::Rule(1),
    Way::Rule(2),
    Way::Rule(3),
    Way::Rule(4),
    Way::Rule(6),
    Way::Rule(8),
];

impl Way {
    fn name(self) -> String {
        match self {
            Self::Cosine => "clamped cosine, for scale".into(),
            Self::Mixture(1) => "1 cosine lobe (Okada, Iwasaki 2017)".into(),
            Self::Mixture(lobes) => format!("{lobes} cosine lobes"),
            Self::Angle(nodes) => format!("{nodes} Gauss nodes in the angle"),
            Self::Rule(1) => "1 node".into(),
            Self::Rule(nodes) => format!("{nodes} nodes"),
        }
    }

    fn integral(self, triangle: &[Vec3; 3], axis: Vec3, sharpness: f32) -> f32 {
        match self {
            Self::Cosine => form_factor(triangle).z,
            Self::Mixture(lobes) => sg_ltc_polygon_integral(triangle, axis, sharpness, lobes),
            Self::Angle(nodes) => by_angle(triangle, axis, sharpness, nodes),
            Self::Rule(nodes) => sg_polygon_integral(triangle, axis, sharpness, nodes),
        }
    }

    /// Body of the WGSL function `integral(axis, sharpness)`, if there is one.
    fn wgsl(self) -> Option<String> {
        let (call, close) = match self {
            Self::Cosine => (
                "var polygon = lambert_polygon_new();".into(),
                ["lambert_polygon_add_edge(&polygon, ", "lambert_polygon_close(&polygon); return polygon.diffuse.z;"],
            ),
            Self::Mixture(lobes) => (
                format!(
                    "let frame = orthonormal_basis(axis); let mixture = sg_mixture({lobes}u, sharpness);
                    var polygon = sg_ltc_polygon_new();"
                ),
                [
                    "sg_ltc_polygon_add_edge(&polygon, frame, mixture, ",
                    "sg_ltc_polygon_close(&polygon, frame, mixture); return polygon.integral;",
                ],
            ),
            Self::Rule(nodes) => (
                format!("let rule = sg_rule({nodes}u, sharpness); var polygon = sg_polygon_new();"),
                [
                    "sg_polygon_add_edge(&polygon, axis, rule, ",
                    "sg_polygon_close(&polygon, axis, rule); return polygon.integral;",
                ],
            ),
            Self::Angle(_) => return None,
        };
        let [add, close] = close;
        Some(format!(
            "{call}
            for (var i = 0u; i < 3u; i++) {{ {add} corner(i), corner((i + 1u) % 3u)); }}
            {close}"
        ))
    }
}

/// The edge integral of `E(λu)/(2 − u)` with Gauss-Legendre nodes in `s`, `t − t₀ = w tan s`: the textbook substitution,
/// with its tangents and arc tangents. Nothing is clipped.
fn by_angle(triangle: &[Vec3; 3], axis: Vec3, sharpness: f32, nodes: usize) -> f32 {
    use std::sync::OnceLock;
    static RULES: OnceLock<[Vec<(f32, f32)>; 9]> = OnceLock::new();
    let rules = RULES.get_or_init(|| {
        std::array::from_fn(|n| {
            gauss_legendre(n)
                .into_iter()
                .map(|(node, weight)| (node as f32, weight as f32))
                .collect()
        })
    });
    let unit = triangle.map(Vec3::normalize);
    let mut sum = 0.0;
    for i in 0..3 {
        let (a, b) = (unit[i], unit[(i + 1) % 3]);
        let scaled = (b - a).cross(a);
        let sine = scaled.length();
        let normal = scaled / sine.max(1e-12);
        let along = a.cross(normal);
        let n = normal.dot(axis);
        let angle = sine.atan2(a.dot(b));
        let closest = along.dot(axis).atan2(a.dot(axis));
        let width = (n * n + 2.25 / sharpness.max(1.0)).sqrt();
        let (lo, hi) = (
            (-closest / width).atan(),
            ((angle - closest) / width).atan(),
        );
        for &(node, weight) in &rules[nodes] {
            let s = lo + (hi - lo) * node;
            let t = closest + width * s.tan();
            let point = a * t.cos() + along * t.sin();
            let offset = point - axis;
            let u = 0.5 * offset.dot(offset);
            let x = sharpness * u;
            let kernel = if x < 1e-3 { 1.0 } else { -(-x).exp_m1() / x } / (2.0 - u);
            sum += n * weight * (hi - lo) * kernel * width / (s.cos() * s.cos());
        }
    }
    sum
}

/// A triangle of 0.01 to 1 rad about the normal of the surface, and a lobe near it.
struct Sample {
    triangle: [Vec3; 3],
    axis: Vec3,
    sharpness: f32,
}

/// Numbers without a pattern, the same in every run (`SplitMix64`, Steele et al. 2014), uniform in `[0, 1)`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }
}

fn samples() -> Vec<Sample> {
    let mut random = Random(1);
    let mut samples = Vec::new();
    for sharpness in SHARPNESSES {
        for _ in 0..TRIANGLES {
            let width = 1.0 / sharpness.sqrt();
            let offset = if random.next() < 0.7 {
                (3.0 * random.next() * width).min(1.2)
            } else {
                1.2 * random.next()
            };
            let size = 10.0_f32.powf(-2.0 * random.next()).tan();
            let mut angles = [0; 3].map(|_| std::f32::consts::TAU * random.next());
            angles.sort_by(|a, b| b.total_cmp(a));
            let turn = Quat::from_rotation_z(std::f32::consts::TAU * random.next());
            let triangle = angles.map(|angle| {
                let reach = size * (0.3 + 0.7 * random.next());
                turn * Vec3::new(reach * angle.cos(), reach * angle.sin(), 1.0)
            });
            samples.push(Sample {
                triangle,
                axis: (turn * Vec3::new(-offset.sin(), 0.0, offset.cos())).normalize(),
                sharpness,
            });
        }
    }
    samples
}

/// Largest and mean error over the lobe's integral.
fn errors(way: Way, samples: &[Sample], exact: &[f64]) -> [f64; 2] {
    let (mut largest, mut sum) = (0.0_f64, 0.0);
    for (sample, exact) in samples.iter().zip(exact) {
        let value = way.integral(&sample.triangle, sample.axis, sample.sharpness);
        let error = (f64::from(value) - exact).abs() / sg_integral(f64::from(sample.sharpness));
        largest = largest.max(error);
        sum += error;
    }
    [largest, sum / samples.len() as f64]
}

/// Nanoseconds a triangle on the CPU, the fastest of all rounds of each way.
fn cpu_times(samples: &[Sample]) -> [f64; WAYS.len()] {
    let mut fastest = [f64::INFINITY; WAYS.len()];
    for _ in 0..CPU_ROUNDS {
        for (way, fastest) in WAYS.into_iter().zip(&mut fastest) {
            let start = Instant::now();
            for sample in samples {
                let value = way.integral(
                    black_box(&sample.triangle),
                    black_box(sample.axis),
                    black_box(sample.sharpness),
                );
                black_box(value);
            }
            let each = start.elapsed().as_secs_f64() * 1e9 / samples.len() as f64;
            *fastest = fastest.min(each);
        }
    }
    fastest
}

const HEADER: &str = "
#import akari_math::sg::polygon::{sg_rule, sg_polygon_new, sg_polygon_add_edge, sg_polygon_close}
#import akari_math::sg::ltc::{sg_mixture, sg_ltc_polygon_new, sg_ltc_polygon_add_edge, sg_ltc_polygon_close}
#import akari_math::ltc::polygon::{lambert_polygon_new, lambert_polygon_add_edge, lambert_polygon_close}
#import akari_math::frame::orthonormal_basis
var<private> shift: f32;
fn corner(i: u32) -> vec3<f32> { return vec3<f32>(x(3u * i) + shift, x(3u * i + 1u), x(3u * i + 2u)); }";

/// Nanoseconds a triangle on the GPU: the fastest of all rounds of each way that there is in WGSL.
fn gpu_times(gpu: &Gpu, samples: &[Sample]) -> Option<[Option<f64>; WAYS.len()]> {
    let software = gpu.adapter_info.device_type == DeviceType::Cpu;
    let copies = if software { COPIES } else { COPIES_ON_HARDWARE };
    let mut input = Vec::new();
    for _ in 0..copies {
        for sample in samples {
            for v in sample.triangle {
                input.extend(v.to_array());
            }
            input.extend(sample.axis.to_array());
            input.push(sample.sharpness);
        }
    }
    let headers = WAYS.map(|way| {
        let body = way.wgsl()?;
        Some(format!(
            "{HEADER}\nfn integral(axis: vec3<f32>, sharpness: f32) -> f32 {{ {body} }}"
        ))
    });
    // Each lobe and triangle is moved a little, so that no work is shared.
    let body = format!(
        "var sum = 0.0;
        for (var lobe = 0u; lobe < {LOBES}u; lobe++) {{
            shift = f32(lobe) * 1e-5;
            let axis = normalize(vec3<f32>(x(9u), x(10u), x(11u)) + shift * vec3<f32>(1.0, 0.0, 1.0));
            sum += integral(axis, x(12u));
        }}
        y(0u, sum);"
    );
    let kernels: Vec<Kernel<'_>> = headers
        .iter()
        .flatten()
        .map(|header| Kernel {
            header,
            body: &body,
            inputs: 13,
            outputs: 1,
        })
        .collect();
    let times = match time_kernels(gpu, WGSL_MODULES, &kernels, &input, GPU_ROUNDS) {
        Ok(times) => times?,
        Err(error) => {
            eprintln!("no times on the GPU: {error}");
            return None;
        }
    };
    let triangles = (samples.len() * copies * LOBES) as f64;
    let mut times = times
        .into_iter()
        .map(|rounds| rounds.into_iter().fold(f64::INFINITY, f64::min) * 1e6 / triangles);
    Some(
        headers
            .each_ref()
            .map(|header| header.as_ref().and_then(|_| times.next())),
    )
}

/// Argument of the process whose instructions are counted; then the index of the way, and how often it is gone.
const COUNTED: &str = "--counted-way";

/// The work of the process that is counted, if this is it.
fn is_counted(samples: &[Sample]) -> bool {
    let arguments: Vec<String> = std::env::args().collect();
    let [.., flag, way, rounds] = &arguments[..] else {
        return false;
    };
    let (true, Ok(way), Ok(rounds)) = (flag == COUNTED, way.parse::<usize>(), rounds.parse())
    else {
        return false;
    };
    let Some(way) = WAYS.get(way) else {
        return true;
    };
    for _ in 0..rounds {
        for sample in samples {
            black_box(way.integral(&black_box(sample.triangle), sample.axis, sample.sharpness));
        }
    }
    true
}

/// CPU instructions of each way, a triangle.
fn instructions(triangles: usize) -> Result<String, String> {
    let counter = Counter::find()?;
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let count = |way: usize, rounds: u64| {
        let mut command = Command::new(&program);
        command.args([COUNTED, &way.to_string(), &rounds.to_string()]);
        counter.count(&command)
    };
    let mut text = format!(
        "# Spherical Gaussians over triangles: CPU instructions\n\n\
        Written by `cargo bench -p bevy_akari_benches --bench sg_polygons -- instructions write`; do not edit.\n\n\
        Instructions of the Rust twins ({}, counted by {}) a triangle, over the triangles of\n\
        [error against time](sg_polygon.md), clip at the horizon included (but for the nodes in the angle): what two rounds\n\
        over all of them take beyond what one does.\n\n\
        | | instructions |\n|---|---|\n",
        std::env::consts::ARCH,
        counter.name()
    );
    for (index, way) in WAYS.into_iter().enumerate() {
        let (one, two) = (count(index, 1)?, count(index, 2)?);
        let each = two.saturating_sub(one) as f64 / triangles as f64;
        let _ = writeln!(text, "| {} | {each:.0} |", way.name());
    }
    Ok(text)
}

/// Prints [`instructions`], and writes them if it is asked for.
fn report_instructions(triangles: usize) {
    let written = instructions(triangles).and_then(|text| {
        print!("{text}");
        if !std::env::args().any(|argument| argument == "write") {
            return Ok(());
        }
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/akari_math/docs");
        std::fs::write(folder.join("sg_polygon_instructions.md"), text)
            .map_err(|error| format!("cannot write to {}: {error}", folder.display()))
    });
    if let Err(error) = written {
        eprintln!("{error}");
        std::process::exit(1);
    }
}

fn main() {
    let samples = samples();
    if is_counted(&samples) {
        return;
    }
    if std::env::args().any(|argument| argument == "instructions") {
        report_instructions(samples.len());
        return;
    }
    let exact: Vec<f64> = samples
        .iter()
        .map(|sample| {
            let triangle = sample.triangle.map(|v| v.as_dvec3());
            sg_polygon(
                &triangle,
                sample.axis.as_dvec3(),
                f64::from(sample.sharpness),
            )
        })
        .collect();
    let adapter = gpu();
    let on_gpu = adapter.ok().and_then(|gpu| gpu_times(gpu, &samples));
    let on_cpu = cpu_times(&samples);
    let name = match adapter {
        Ok(gpu) if on_gpu.is_some() => gpu.adapter_info.name.clone(),
        Ok(_) => "none with timestamps".into(),
        Err(reason) => reason.into(),
    };
    let mut text = format!(
        "# Spherical Gaussians over triangles: error against time\n\n\
        Written by `cargo bench -p bevy_akari_benches --bench sg_polygons -- write`; do not edit.\n\n\
        {TRIANGLES} triangles of 0.01 to 1 rad for each λ of 10, 50, 200, 1e3, 1e4 and 1e7, most of them within three\n\
        widths of the lobe, against the same integral in f64. Errors are over the lobe's integral on the sphere. Times are\n\
        nanoseconds a triangle, clip at the horizon included (but for the nodes in the angle, which are not clipped), the\n\
        ways taking turns in one run: spans on the GPU ({name}), and the Rust twins on the CPU.\n\n\
        | | largest error | mean error | GPU | CPU |\n|---|---|---|---|---|\n"
    );
    let mut series = [
        Series::new("mixtures of linearly transformed cosines"),
        Series::new("Gauss-Legendre nodes in the angle"),
        Series::new("our rules"),
    ];
    for (index, way) in WAYS.into_iter().enumerate() {
        let gpu = on_gpu.and_then(|times| times[index]);
        let gpu_text = gpu.map_or("–".into(), |ns| format!("{ns:.1}"));
        let cpu = on_cpu[index];
        let errors = (way != Way::Cosine).then(|| errors(way, &samples, &exact));
        let [largest, mean] = errors.map_or(["–".into(), "–".into()], |e| {
            e.map(|x| format!("{x:.1e}"))
        });
        let _ = writeln!(
            text,
            "| {} | {largest} | {mean} | {gpu_text} | {cpu:.0} |",
            way.name()
        );
        let (which, label) = match way {
            Way::Cosine => continue,
            Way::Mixture(n) => (0, n as usize),
            Way::Angle(n) => (1, n),
            Way::Rule(n) => (2, n as usize),
        };
        if let Some([largest, mean]) = errors {
            series[which].push(label.to_string(), cpu, [largest, mean], gpu);
        }
    }
    text.push_str("\n![error against time](sg_polygon.svg)\n");
    print!("{text}");
    if std::env::args().any(|argument| argument == "write") {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/akari_math/docs");
        let written = std::fs::create_dir_all(&folder)
            .and_then(|()| std::fs::write(folder.join("sg_polygon.md"), &text))
            .and_then(|()| {
                let plot = error_against_time("Spherical Gaussian over a triangle", &name, &series);
                std::fs::write(folder.join("sg_polygon.svg"), plot)
            });
        if let Err(error) = written {
            eprintln!("cannot write to {}: {error}", folder.display());
            std::process::exit(1);
        }
    }
}
