//! How much error the denoiser takes away, what it costs, and how it fares beside other filters.
//!
//! `cargo bench -p bevy_akari_benches --bench denoise -- [PART…] [--side=256] [--quick]`. Parts: `methods` (Figures 4 and
//! 5 of Tokuyoshi 2015), `beta` (Figure 6), `guided` (the default method, 1 to 256 samples a pixel), `history`,
//! `upsampling`, `overhead` (of lobe-aware over normal-aware weights), `cost`. Pictures are traced once and kept in
//! `target/references`.

use bevy_akari::buffers::BufferDenoiser;
use bevy_akari::prelude::*;
use bevy_akari::render::quality::Knobs;
use bevy_akari_tests::denoise::{Lab, accumulate, filter, psnr, sampled};
use bevy_akari_tests::headless_or_skip;
use std::collections::BTreeMap;

/// What is asked for on the command line.
struct Plan {
    parts: Vec<String>,
    side: u32,
    /// Samples a pixel of references.
    reference: u32,
}

impl Plan {
    fn from_arguments() -> Self {
        let mut plan = Self {
            parts: Vec::new(),
            side: 256,
            reference: 2048,
        };
        for argument in std::env::args().skip(1) {
            if let Some(side) = argument.strip_prefix("--side=") {
                plan.side = side.parse().expect("--side=PIXELS");
            } else if argument == "--quick" {
                plan.side = 128;
                plan.reference = 512;
            } else if !argument.starts_with('-') {
                plan.parts.push(argument);
            }
        }
        plan
    }

    fn wants(&self, part: &str) -> bool {
        self.parts.is_empty() || self.parts.iter().any(|name| name == part)
    }

    fn lab(&self, name: &str) -> Lab {
        Lab::new(name, self.side, depth(name))
    }
}

/// Path length in segments at which a scene's light is told: those of panels only need no bounces.
fn depth(name: &str) -> u32 {
    match name {
        "roughness_map" | "incident_edge" => 3,
        _ => 4,
    }
}

fn main() {
    let plan = Plan::from_arguments();
    let Some(headless) = headless_or_skip("denoise") else {
        return;
    };
    println!(
        "adapter: {}; {} x {} pixels, references of {} samples a pixel\n",
        headless.adapter(),
        plan.side,
        plan.side,
        plan.reference
    );
    drop(headless);
    if plan.wants("methods") {
        methods(&plan);
    }
    if plan.wants("beta") {
        beta_sweep(&plan);
    }
    if plan.wants("guided") {
        guided(&plan);
    }
    if plan.wants("history") {
        history(&plan);
    }
    if plan.wants("upsampling") {
        upsampling(&plan);
    }
    if plan.wants("overhead") {
        overhead(&plan);
    }
    if plan.wants("cost") {
        cost(&plan);
    }
}

/// The paper's filter is one cross-bilateral pass over all neighbours.
fn paper() -> Denoise {
    Denoise {
        kernel: Kernel::Full,
        radius: 10,
        beta: 20.0,
        kappa: 100.0,
        sigma_n_squared: 0.01,
        anisotropic: false,
        history: 1,
        ..Denoise::default()
    }
}

fn denoiser(lab: &Lab, settings: Denoise) -> BufferDenoiser {
    lab.denoiser("denoise", settings)
        .expect("there was an adapter before")
}

fn methods(plan: &Plan) {
    println!("error (MSE) over that of the input; beta 20, kappa 100, sigma_n^2 0.01, radius 10");
    println!(
        "scene                spp  guided   lobe     lobe (elliptic)  normal   axis-al.  distrib.  lobe (Wang)"
    );
    for name in [
        "roughness_map",
        "sphere_sharp",
        "sphere_rough",
        "incident_edge",
        "cornell",
    ] {
        let lab = plan.lab(name);
        let truth = lab.reference(plan.reference);
        let mut denoiser = denoiser(&lab, paper());
        for spp in [1, 4, 16] {
            let input = lab.kept_input(spp, 7);
            let before = lab.mse(&input, &truth, |_| true);
            print!("{name:20} {spp:4}");
            let plain = |method, anisotropic| Denoise {
                method,
                anisotropic,
                ..paper()
            };
            for settings in [
                // Ours as it comes, the others as the paper has them.
                Denoise {
                    history: 1,
                    ..Denoise::default()
                },
                plain(Method::Lobe, false),
                plain(Method::Lobe, true),
                plain(Method::Normal, false),
                plain(Method::AxisAligned, false),
                plain(Method::Distribution, false),
            ] {
                denoiser.set_settings(settings);
                let output = filter(&mut denoiser, &input);
                print!("  {:7.4}", lab.mse(&output, &truth, |_| true) / before);
            }
            denoiser.set_settings(plain(Method::Lobe, false));
            let camera = denoiser.camera;
            let world = denoiser.headless.app.world_mut();
            world.entity_mut(camera).insert(SpecularLobes {
                wang: true,
                ..SpecularLobes::default()
            });
            denoiser.set_settings(plain(Method::Lobe, false));
            let output = filter(&mut denoiser, &input);
            println!("  {:7.4}", lab.mse(&output, &truth, |_| true) / before);
            let world = denoiser.headless.app.world_mut();
            world.entity_mut(camera).remove::<SpecularLobes>();
        }
    }
    println!();
}

fn beta_sweep(plan: &Plan) {
    println!(
        "Figure 6: error (MSE) over that of the input at 4 samples a pixel, by beta and by sigma_n^2"
    );
    let scenes = ["sphere_sharp", "sphere_medium", "sphere_rough"];
    let mut best: BTreeMap<&str, Vec<f32>> = BTreeMap::new();
    for (what, values) in [
        (
            "beta",
            [0.5f32, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0],
        ),
        (
            "1/sigma_n^2",
            [
                2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 10_000.0,
            ],
        ),
    ] {
        print!("{what:14}");
        for value in values {
            print!(" {value:8}");
        }
        println!();
        for name in scenes {
            let lab = plan.lab(name);
            let truth = lab.reference(plan.reference);
            let mut denoiser = denoiser(&lab, paper());
            let input = lab.kept_input(4, 7);
            let before = lab.mse(&input, &truth, |_| true);
            let mut least = (f64::INFINITY, 0.0);
            print!("{name:14}");
            for value in values {
                denoiser.set_settings(if what == "beta" {
                    Denoise {
                        method: Method::Lobe,
                        beta: value,
                        ..paper()
                    }
                } else {
                    Denoise {
                        method: Method::Normal,
                        sigma_n_squared: 1.0 / value,
                        ..paper()
                    }
                });
                let output = filter(&mut denoiser, &input);
                let ratio = lab.mse(&output, &truth, |_| true) / before;
                if ratio < least.0 {
                    least = (ratio, value);
                }
                print!(" {ratio:8.4}");
            }
            println!("   best at {}", least.1);
            best.entry(what).or_default().push(least.1);
        }
    }
    for (what, values) in best {
        let (low, high) = values
            .iter()
            .fold((f32::INFINITY, 0.0f32), |(low, high), v| {
                (low.min(*v), high.max(*v))
            });
        println!("{what}: optima spread over a factor of {}", high / low);
    }
    println!();
}

/// What the guided method is tried with: the presets, and other kernels.
fn guided_settings() -> [(&'static str, Denoise); 6] {
    let preset = |quality| Denoise {
        history: 1,
        ..Denoise::preset(quality)
    };
    let other = |kernel, radius, levels| Denoise {
        method: Method::Guided,
        kernel,
        radius,
        levels,
        ..preset(Quality::Medium)
    };
    [
        ("default", preset(Quality::Medium)),
        ("low", preset(Quality::Low)),
        (
            "ultra",
            Denoise {
                anisotropic: false,
                ..preset(Quality::Ultra)
            },
        ),
        ("full 10", other(Kernel::Full, 10, 3)),
        ("separ. 6", other(Kernel::Separable, 6, 3)),
        ("5 levels", other(Kernel::ATrous, 2, 5)),
    ]
}

fn guided(plan: &Plan) {
    println!(
        "guided, one parameter set: error (MSE) over that of the input; ultra without ellipses"
    );
    print!("scene                spp");
    for (name, _) in guided_settings() {
        print!("  {name:>8}");
    }
    println!("   sharp patches alone: default, ultra");
    let mut worst = (0.0, String::new());
    for name in [
        "roughness_map",
        "incident_edge",
        "cornell",
        "sphere_sharp",
        "sphere_medium",
        "sphere_rough",
        "normal_mapped",
        "moving_object",
        "gallery",
        "floor_light",
        "many_lights",
        "spheres_quad",
        "spheres_textured",
    ] {
        let lab = plan.lab(name);
        let truth = lab.reference(plan.reference);
        let mut denoiser = denoiser(&lab, guided_settings()[0].1);
        for spp in [1, 4, 16, 64, 256] {
            let input = lab.kept_input(spp, 7);
            let before = lab.mse(&input, &truth, |_| true);
            print!("{name:20} {spp:4}");
            let mut sharp = String::new();
            for (column, settings) in guided_settings() {
                denoiser.set_settings(settings);
                let output = filter(&mut denoiser, &input);
                let ratio = lab.mse(&output, &truth, |_| true) / before;
                print!("  {ratio:8.4}");
                if ratio > worst.0 {
                    worst = (ratio, format!("{name}, {spp} samples, {column}"));
                }
                if name == "roughness_map" && matches!(column, "default" | "ultra") {
                    let is_sharp = |i: usize| lab.aovs.roughness[i] < 0.2;
                    let ratio =
                        lab.mse(&output, &truth, is_sharp) / lab.mse(&input, &truth, is_sharp);
                    sharp += &format!("  {ratio:8.4}");
                }
            }
            println!(" {sharp}");
        }
    }
    println!("largest: {:.4} ({})\n", worst.0, worst.1);
}

fn history(plan: &Plan) {
    println!(
        "frames of history at 1 sample a pixel each: error (MSE) over that of one frame's input"
    );
    for name in ["cornell", "roughness_map"] {
        let lab = plan.lab(name);
        let truth = lab.reference(plan.reference);
        let settings = Denoise {
            history: 32,
            ..Denoise::default()
        };
        let mut denoiser = denoiser(&lab, settings);
        let before = lab.mse(&lab.input(1, 100), &truth, |_| true);
        print!("{name:20}");
        for frame in 0..16u32 {
            let input = lab.input(1, u64::from(100 + frame));
            accumulate(&mut denoiser, &input, SignalScale::Full, frame, frame == 0);
            if (frame + 1).is_power_of_two() {
                let output = denoiser.read().expect("it can be read");
                print!(
                    "  {:2}: {:.4}",
                    frame + 1,
                    lab.mse(&output, &truth, |_| true) / before
                );
            }
        }
        println!();
    }
    println!();
}

/// Upsampling alone, without a filter, by the parameters of the paper.
fn spread_only(method: Method) -> Denoise {
    Denoise {
        method,
        radius: 0,
        history: 32,
        ..paper()
    }
}

fn upsampling(plan: &Plan) {
    println!(
        "upsampling: PSNR in dB against the full resolution of the same picture of 64 samples a pixel; beta 20, kappa \
         100, sigma_n^2 0.01; in time: 16 frames, each of whose samples stays where it is"
    );
    println!(
        "scene          pixels  scale     in space: normal    lobe  guided   in time    both: normal    lobe"
    );
    // At 1/4, the ripples of the normal map are finer than the samples in a picture of half the size.
    for (name, side) in [
        ("normal_mapped", 256),
        ("normal_mapped", plan.side.min(160)),
        ("roughness_map", plan.side),
    ] {
        let lab = Lab::new(name, side, 3);
        let clean = lab.reference(64);
        for scale in [SignalScale::Half, SignalScale::Quarter] {
            print!("{name:14} {side:4}²   {scale:8?}");
            let run = |settings: Denoise, frames: u32| {
                let mut denoiser = denoiser(&lab, settings);
                for frame in 0..frames {
                    let signal = sampled(&clean, lab.side, scale, frame);
                    accumulate(&mut denoiser, &signal, scale, frame, frame == 0);
                }
                let output = denoiser.read().expect("it can be read");
                psnr(lab.mse(&output, &clean, |_| true))
            };
            // So narrow that only the likest sample counts.
            let nearest = Denoise {
                beta: 1000.0,
                kappa: 1e9,
                ..spread_only(Method::Lobe)
            };
            print!("        {:8.2}", run(spread_only(Method::Normal), 1));
            print!("{:8.2}", run(spread_only(Method::Lobe), 1));
            print!("{:8.2}", run(spread_only(Method::Guided), 1));
            print!("  {:8.2}", run(nearest, 16));
            print!("        {:8.2}", run(spread_only(Method::Normal), 16));
            println!("{:8.2}", run(spread_only(Method::Lobe), 16));
        }
    }
    println!();
}

/// Frames that are timed in turn, and such that are not since pipelines and caches are cold.
const TIMED_FRAMES: u32 = 24;
const COLD_FRAMES: u32 = 3;

fn overhead(plan: &Plan) {
    println!(
        "lobe-aware over normal-aware: GPU time of the pass, least of {TIMED_FRAMES} frames in turn, and their ratio"
    );
    let lab = plan.lab("roughness_map");
    let input = lab.kept_input(1, 7);
    let filters = [
        ("full 10", Kernel::Full, 10),
        ("a-trous 3", Kernel::ATrous, 2),
    ];
    let mut rows: Vec<(String, Denoise, SignalScale, &str)> = Vec::new();
    for (name, kernel, radius) in filters {
        let settings = Denoise {
            kernel,
            radius,
            levels: 3,
            ..paper()
        };
        rows.push((
            format!("filter, {name}"),
            settings,
            SignalScale::Full,
            "stage",
        ));
    }
    for (name, scale, frames) in [
        ("upsampling 1/2", SignalScale::Half, 1),
        ("upsampling 1/4", SignalScale::Quarter, 1),
        ("upsampling 1/2, history", SignalScale::Half, 32),
        ("upsampling 1/4, history", SignalScale::Quarter, 32),
    ] {
        let settings = Denoise {
            history: frames,
            ..spread_only(Method::Lobe)
        };
        rows.push((name.to_owned(), settings, scale, "accumulate"));
    }
    for stored in [true, false] {
        for (name, settings, scale, span) in &rows {
            let mut pair = [Method::Normal, Method::Lobe].map(|method| {
                let mut denoiser = denoiser(
                    &lab,
                    Denoise {
                        method,
                        ..*settings
                    },
                );
                let camera = denoiser.camera;
                let world = denoiser.headless.app.world_mut();
                world.entity_mut(camera).insert(SpecularLobes {
                    stored,
                    ..SpecularLobes::default()
                });
                denoiser
            });
            let mut times = [Vec::new(), Vec::new()];
            for frame in 0..COLD_FRAMES + TIMED_FRAMES {
                let signal = sampled(&input, lab.side, *scale, frame);
                for (denoiser, times) in pair.iter_mut().zip(&mut times) {
                    accumulate(denoiser, &signal, *scale, frame, frame == 0);
                    let ms: f64 = denoiser
                        .headless
                        .gpu_times()
                        .iter()
                        .filter(|(label, _)| {
                            label.starts_with("akari_denoise") && label.contains(span)
                        })
                        .map(|(_, ms)| ms)
                        .sum();
                    if frame >= COLD_FRAMES {
                        times.push(ms);
                    }
                }
            }
            // The least: whatever else the machine does only adds to it.
            let [normal, lobe] = times.map(|times| times.into_iter().fold(f64::INFINITY, f64::min));
            println!(
                "lobes {}: {name:26} normal {normal:7.3} ms, lobe {lobe:7.3} ms, {:+6.1} %",
                if stored { "stored    " } else { "recomputed" },
                100.0 * (lobe / normal - 1.0)
            );
        }
    }
    println!();
}

fn cost(plan: &Plan) {
    println!("GPU milliseconds of each pass (least of 10 frames) and bytes a pixel, side by side");
    let lab = plan.lab("roughness_map");
    let input = lab.input(1, 1);
    let pixels = f64::from(plan.side * plan.side);
    for stored in [true, false] {
        for (name, settings) in [
            (
                "guided, full 10",
                Denoise {
                    method: Method::Guided,
                    ..paper()
                },
            ),
            (
                "lobe, full 10",
                Denoise {
                    method: Method::Lobe,
                    ..paper()
                },
            ),
            (
                "normal, full 10",
                Denoise {
                    method: Method::Normal,
                    ..paper()
                },
            ),
            (
                "elliptic, full 10",
                Denoise {
                    method: Method::Lobe,
                    anisotropic: true,
                    ..paper()
                },
            ),
            (
                "guided, separable",
                Denoise {
                    method: Method::Guided,
                    kernel: Kernel::Separable,
                    ..paper()
                },
            ),
            (
                "guided, a-trous 3",
                Denoise {
                    method: Method::Guided,
                    kernel: Kernel::ATrous,
                    levels: 3,
                    ..paper()
                },
            ),
            (
                "guided, a-trous 5",
                Denoise {
                    method: Method::Guided,
                    kernel: Kernel::ATrous,
                    levels: 5,
                    ..paper()
                },
            ),
            (
                "guided, a-trous 3, history",
                Denoise {
                    method: Method::Guided,
                    kernel: Kernel::ATrous,
                    levels: 3,
                    history: 16,
                    ..paper()
                },
            ),
        ] {
            let mut denoiser = denoiser(&lab, settings);
            let camera = denoiser.camera;
            denoiser
                .headless
                .app
                .world_mut()
                .entity_mut(camera)
                .insert(SpecularLobes {
                    stored,
                    ..SpecularLobes::default()
                });
            let mut least: BTreeMap<String, f64> = BTreeMap::new();
            for frame in 0..10 {
                accumulate(&mut denoiser, &input, SignalScale::Full, frame, false);
                for (span, ms) in denoiser.headless.gpu_times() {
                    if span.starts_with("akari_denoise") || span.starts_with("akari_lobes") {
                        let entry = least.entry(span).or_insert(f64::INFINITY);
                        *entry = entry.min(ms);
                    }
                }
            }
            let bytes: u64 = denoiser.headless.ledger().bytes_by_effect().values().sum();
            let total: f64 = least.values().sum();
            println!(
                "lobes {}: {name:28} {total:8.2} ms, {:5.1} bytes a pixel",
                if stored { "stored    " } else { "recomputed" },
                bytes as f64 / pixels
            );
            for (span, ms) in &least {
                println!("    {span:36} {ms:8.3}");
            }
        }
    }
}
