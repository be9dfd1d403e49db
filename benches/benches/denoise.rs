//! How much error the denoiser takes away, what it costs, and how it fares beside other filters.
//!
//! `cargo bench -p bevy_akari_benches --bench denoise -- [PART…] [--side=256] [--quick]`. Parts: `methods` (Figures 4 and
//! 5 of Tokuyoshi 2015), `beta` (Figure 6), `guided` (the default method, 1 to 256 samples a pixel), `history`,
//! `upsampling`, `cost`. References are traced once and kept in `target/references`.

use bevy_akari::buffers::BufferDenoiser;
use bevy_akari::prelude::*;
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
            let input = lab.input(spp, 7);
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
            let input = lab.input(4, 7);
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

fn guided(plan: &Plan) {
    println!("guided, one parameter set: error (MSE) over that of the input");
    println!(
        "scene                spp  full     separable  a-trous 3  a-trous 5   sharp patches (full)"
    );
    for name in [
        "roughness_map",
        "incident_edge",
        "cornell",
        "cornell",
        "sphere_sharp",
        "sphere_rough",
        "normal_mapped",
        "moving_object",
        "gallery",
        "floor_light",
        "many_lights",
        "spheres_textured",
    ] {
        let lab = plan.lab(name);
        let truth = lab.reference(plan.reference);
        let settings = Denoise {
            method: Method::Guided,
            history: 1,
            ..paper()
        };
        let mut denoiser = denoiser(&lab, settings);
        for spp in [1, 4, 16, 64, 256] {
            let input = lab.input(spp, 7);
            let before = lab.mse(&input, &truth, |_| true);
            print!("{name:20} {spp:4}");
            let mut sharp = None;
            for (kernel, levels) in [
                (Kernel::Full, 5),
                (Kernel::Separable, 5),
                (Kernel::ATrous, 3),
                (Kernel::ATrous, 5),
            ] {
                denoiser.set_settings(Denoise {
                    kernel,
                    levels,
                    ..settings
                });
                let output = filter(&mut denoiser, &input);
                print!("  {:8.4}", lab.mse(&output, &truth, |_| true) / before);
                if name == "roughness_map" && kernel == Kernel::Full {
                    let is_sharp = |i: usize| lab.aovs.roughness[i] < 0.2;
                    sharp = Some(
                        lab.mse(&output, &truth, is_sharp) / lab.mse(&input, &truth, is_sharp),
                    );
                }
            }
            match sharp {
                Some(ratio) => println!("   {ratio:8.4}"),
                None => println!(),
            }
        }
    }
    println!();
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

fn upsampling(plan: &Plan) {
    println!("upsampling: PSNR in dB against the full resolution, signal of 256 samples a pixel");
    println!("scene            scale    normal: spatial, 16 frames   lobe: spatial, 16 frames");
    for name in ["normal_mapped", "roughness_map"] {
        let lab = plan.lab(name);
        let truth = lab.reference(plan.reference);
        let clean = lab.input(256, 3);
        for scale in [SignalScale::Half, SignalScale::Quarter] {
            print!("{name:16} {scale:?}");
            for method in [Method::Normal, Method::Lobe] {
                // Upsampling alone: the smallest kernel, so that nothing but the samples' spread shows.
                let settings = Denoise {
                    method,
                    radius: 1,
                    kernel: Kernel::Full,
                    beta: 1000.0,
                    kappa: 1e9,
                    sigma_n_squared: 1e-6,
                    history: 32,
                    ..paper()
                };
                let settings = if method == Method::Normal {
                    Denoise {
                        sigma_n_squared: 0.01,
                        ..settings
                    }
                } else {
                    settings
                };
                let mut denoiser = denoiser(&lab, settings);
                for frame in 0..16 {
                    let signal = sampled(&clean, lab.side, scale, frame);
                    accumulate(&mut denoiser, &signal, scale, frame, frame == 0);
                    if frame == 0 || frame == 15 {
                        let output = denoiser.read().expect("it can be read");
                        print!("   {:6.2}", psnr(lab.mse(&output, &truth, |_| true)));
                    }
                }
            }
            println!();
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
