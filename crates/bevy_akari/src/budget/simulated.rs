//! The controller against a simulated GPU.

use super::controller::{Change, Controller, FrameCost, Reason};
use super::ladders::{Ladder, Rung};
use super::{BudgetLog, Budgeting, FrameBudget, NoFrameBudget, hold_budget};
use crate::prelude::{AkariCamera, AreaLighting, Denoise, VoxelGi};
use bevy::diagnostic::{Diagnostic, DiagnosticMeasurement, DiagnosticPath, DiagnosticsStore};
use bevy::ecs::world::World;
use std::time::{Duration, Instant};

/// Four rungs, each twice as dear and half as wrong.
fn ladder(effect: &str) -> Ladder {
    let rung = |i: i32| Rung {
        settings: [("radius".to_owned(), i as f32)].into(),
        cost: 2f32.powi(i),
        error: 2f32.powi(-i),
    };
    Ladder {
        effect: effect.to_owned(),
        passes: "akari_test".to_owned(),
        rungs: (0..4).map(rung).collect(),
    }
}

/// A GPU whose effects cost what they cost, whatever the ladders believe.
struct Gpu {
    /// Of all that no knob changes, milliseconds.
    base_ms: f32,
    /// Of each effect on each of its rungs, milliseconds.
    effects_ms: Vec<Vec<f32>>,
    /// Standard deviation of a frame's time, as a share of it.
    noise: f32,
    state: u64,
}

impl Gpu {
    fn new(base_ms: f32, effects_ms: &[[f32; 4]], noise: f32) -> Self {
        Self {
            base_ms,
            effects_ms: effects_ms.iter().map(|rungs| rungs.to_vec()).collect(),
            noise,
            state: 1,
        }
    }

    /// Uniform in [0, 1): the sequence of a 64-bit linear congruential generator (Knuth's multiplier).
    fn random(&mut self) -> f32 {
        self.state = self
            .state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.state >> 40) as f32 / (1u64 << 24) as f32
    }

    /// About normal: the sum of twelve uniform numbers less six.
    fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.random()).sum::<f32>() - 6.0
    }

    fn frame(&mut self, rungs: &[usize]) -> FrameCost {
        let factor = (1.0 + self.noise * self.normal()).max(0.1);
        let effect_ms: Vec<f32> = self
            .effects_ms
            .iter()
            .zip(rungs)
            .map(|(costs, rung)| factor * costs[*rung])
            .collect();
        FrameCost {
            total_ms: factor * self.base_ms + effect_ms.iter().sum::<f32>(),
            effect_ms,
        }
    }
}

/// Runs frames; returns the changes and the last time without noise.
fn run(gpu: &mut Gpu, controller: &mut Controller, frames: u32) -> (Vec<Change>, f32) {
    let mut changes = Vec::new();
    for _ in 0..frames {
        let rungs: Vec<usize> = controller.rungs().collect();
        changes.extend(controller.update(&gpu.frame(&rungs)));
    }
    let rungs: Vec<usize> = controller.rungs().collect();
    let still = gpu.base_ms
        + gpu
            .effects_ms
            .iter()
            .zip(&rungs)
            .map(|(costs, rung)| costs[*rung])
            .sum::<f32>();
    (changes, still)
}

const RUNGS: [f32; 4] = [1.0, 2.0, 4.0, 8.0];

#[test]
fn twice_over_the_budget_fits_within_thirty_frames_and_stays() {
    for noise in [0.0, 0.03, 0.06] {
        for base in [0.5, 4.0] {
            let mut gpu = Gpu::new(base, &[RUNGS, RUNGS], noise);
            let full = base + 16.0;
            let budget = 0.5 * full;
            let mut controller = Controller::new(budget, &[ladder("a"), ladder("b")]);
            let (changes, ms) = run(&mut gpu, &mut controller, 30);
            assert!(!changes.is_empty());
            assert!(ms <= 1.1 * budget, "{base}, {noise}: {ms} of {budget}");
            let (changes, ms) = run(&mut gpu, &mut controller, 300);
            assert!(changes.len() <= 2, "{base}, {noise}: {changes:?}");
            assert!(ms <= 1.1 * budget, "{base}, {noise}: {ms} of {budget}");
        }
    }
}

#[test]
fn ladders_that_are_wrong_about_the_costs_are_corrected() {
    // The ladder thinks that each rung halves the time; here the lower three differ by little.
    let mut gpu = Gpu::new(1.0, &[[6.0, 6.6, 7.2, 15.0]], 0.03);
    let budget = 8.0;
    let mut controller = Controller::new(budget, &[ladder("a")]);
    let (_, ms) = run(&mut gpu, &mut controller, 60);
    assert!(ms <= 1.1 * budget, "{ms}");
    let (changes, ms) = run(&mut gpu, &mut controller, 600);
    assert!(ms <= 1.1 * budget, "{ms}");
    assert!(changes.len() <= 4, "{changes:?}");
    // The other way round: all rungs cost far less than the ladder fears.
    let mut gpu = Gpu::new(1.0, &[[1.0, 1.1, 1.2, 1.3]], 0.03);
    let mut controller = Controller::new(4.0, &[ladder("a")]);
    controller.place(0, 0);
    run(&mut gpu, &mut controller, 400);
    assert_eq!(controller.rungs().next(), Some(3), "time is left unused");
}

#[test]
fn spikes_change_nothing() {
    let mut gpu = Gpu::new(1.0, &[RUNGS], 0.02);
    let mut controller = Controller::new(10.0, &[ladder("a")]);
    for frame in 0..600 {
        let mut cost = gpu.frame(&[3]);
        if frame % 20 < 2 {
            cost.total_ms *= 6.0;
        }
        assert_eq!(controller.update(&cost), None, "frame {frame}");
    }
}

#[test]
fn a_step_of_the_load_is_followed_down_and_up() {
    let mut gpu = Gpu::new(1.0, &[RUNGS], 0.02);
    let budget = 10.0;
    let mut controller = Controller::new(budget, &[ladder("a")]);
    let (changes, _) = run(&mut gpu, &mut controller, 100);
    assert_eq!(changes, []);
    gpu.base_ms = 7.0;
    let (changes, ms) = run(&mut gpu, &mut controller, 100);
    assert!(ms <= 1.1 * budget, "{ms}");
    assert!(
        changes
            .iter()
            .all(|change| change.reason == Reason::OverBudget)
    );
    gpu.base_ms = 1.0;
    let (changes, ms) = run(&mut gpu, &mut controller, 400);
    assert!(ms <= budget, "{ms}");
    assert_eq!(controller.rungs().next(), Some(3), "{changes:?}");
    assert!(
        changes
            .iter()
            .all(|change| change.reason == Reason::RoomToSpare)
    );
    // A budget that nothing fits into: on the lowest rung, and quiet.
    gpu.base_ms = 50.0;
    let (_, _) = run(&mut gpu, &mut controller, 60);
    assert_eq!(controller.rungs().next(), Some(0));
    let (changes, _) = run(&mut gpu, &mut controller, 300);
    assert_eq!(changes, []);
}

#[test]
fn a_raise_that_was_too_much_is_not_repeated() {
    // The top rung costs more than the ladder says, and only on some frames: it looks possible again and again.
    let mut gpu = Gpu::new(1.0, &[[1.0, 2.0, 4.0, 9.5]], 0.01);
    let mut controller = Controller::new(10.0, &[ladder("a")]);
    let (changes, ms) = run(&mut gpu, &mut controller, 2000);
    assert!(ms <= 10.0, "{ms}");
    assert!(changes.len() <= 3, "{changes:?}");
}

#[test]
fn the_dearer_error_is_lowered_last() {
    // Both cost the same; lowering the second costs ten times the error.
    let mut fine = ladder("b");
    for (i, rung) in fine.rungs.iter_mut().enumerate() {
        rung.error = 10f32.powi(3 - i as i32);
    }
    let mut gpu = Gpu::new(1.0, &[RUNGS, RUNGS], 0.0);
    let mut controller = Controller::new(14.0, &[ladder("a"), fine]);
    run(&mut gpu, &mut controller, 30);
    let rungs: Vec<usize> = controller.rungs().collect();
    assert!(rungs[0] < 3 && rungs[1] == 3, "{rungs:?}");
}

#[test]
fn times_that_are_no_numbers_are_passed_over() {
    let mut controller = Controller::new(1.0, &[ladder("a")]);
    for total_ms in [f32::NAN, f32::INFINITY, -f32::INFINITY] {
        for _ in 0..50 {
            let cost = FrameCost {
                total_ms,
                effect_ms: vec![total_ms],
            };
            assert_eq!(controller.update(&cost), None);
        }
    }
    let wrong_count = FrameCost {
        total_ms: 9.0,
        effect_ms: vec![],
    };
    for _ in 0..50 {
        assert_eq!(controller.update(&wrong_count), None);
    }
    // The same controller still works.
    let cost = FrameCost {
        total_ms: 9.0,
        effect_ms: vec![8.0],
    };
    assert!((0..20).any(|_| controller.update(&cost).is_some()));
}

/// One rung a value of one knob.
fn ladder_of(effect: &str, passes: &str, knob: &str, values: &[f32]) -> Ladder {
    let rung = |(i, value): (usize, &f32)| Rung {
        settings: [(knob.to_owned(), *value)].into(),
        cost: *value,
        error: 2f32.powi(-(i as i32)),
    };
    Ladder {
        effect: effect.to_owned(),
        passes: passes.to_owned(),
        rungs: values.iter().enumerate().map(rung).collect(),
    }
}

/// Settings that a camera has of its own are turned as those of all cameras are, of every effect, unless it is left out.
#[test]
fn settings_of_a_camera_of_its_own_are_turned() {
    const FRAMES: u32 = 60;
    /// Less than any two of the effects take at their best with the third as it is.
    const BUDGET_MS: f64 = 8.0;
    for left_out in [false, true] {
        let mut world = World::new();
        world.init_resource::<DiagnosticsStore>();
        world.init_resource::<BudgetLog>();
        world.insert_resource(FrameBudget {
            gpu_ms: BUDGET_MS as f32,
        });
        world.insert_resource(Budgeting {
            ladders: vec![
                ladder_of(
                    "voxel_gi",
                    "akari_voxel_gi",
                    "cones",
                    &[1.0, 5.0, 9.0, 16.0],
                ),
                ladder_of("denoise", "akari_denoise", "levels", &[3.0, 5.0, 6.0]),
                ladder_of(
                    "area_lights",
                    "akari_area_light",
                    "texture_cells",
                    &[1.0, 4.0, 8.0],
                ),
            ],
            controller: None,
            warned: false,
            frames_without_times: 0,
        });
        let before = VoxelGi {
            resolution: 32,
            cones: 16,
            ..VoxelGi::default()
        };
        let denoise = Denoise {
            levels: 6,
            ..Denoise::default()
        };
        let lights = AreaLighting {
            texture_cells: 8,
            ..AreaLighting::default()
        };
        let camera = world.spawn((AkariCamera, before, denoise, lights)).id();
        if left_out {
            world.entity_mut(camera).insert(NoFrameBudget);
        }
        let start = Instant::now();
        let mut last_ms = 0.0;
        for frame in 0..FRAMES {
            let camera = world.entity(camera);
            let (voxels, denoise, lights) =
                camera.components::<(&VoxelGi, &Denoise, &AreaLighting)>();
            let times = [
                ("akari_voxel_gi_cones", 2.0 * f64::from(voxels.cones)),
                ("akari_denoise_stage", f64::from(denoise.levels)),
                ("akari_area_light_shade", f64::from(lights.texture_cells)),
            ];
            last_ms = times.iter().map(|(_, ms)| ms).sum();
            let mut store = world.resource_mut::<DiagnosticsStore>();
            for (pass, value) in times {
                let path = DiagnosticPath::new(format!("render/{pass}/elapsed_gpu"));
                if store.get(&path).is_none() {
                    store.add(Diagnostic::new(path.clone()));
                }
                let time = start + Duration::from_millis(u64::from(frame));
                if let Some(diagnostic) = store.get_mut(&path) {
                    diagnostic.add_measurement(DiagnosticMeasurement { time, value });
                }
            }
            hold_budget(&mut world);
        }
        let after = world.entity(camera);
        let (after, smoother, lit) = after.components::<(&VoxelGi, &Denoise, &AreaLighting)>();
        if left_out {
            assert_eq!((*after, *smoother, *lit), (before, denoise, lights));
            assert!(last_ms > BUDGET_MS, "the clock tells it: {last_ms}");
        } else {
            assert!(last_ms <= BUDGET_MS, "{last_ms} ms");
            assert_eq!((after.cones, smoother.levels, lit.texture_cells), (1, 3, 1));
            // What no rung names stays.
            let others = VoxelGi {
                cones: before.cones,
                ..*after
            };
            assert_eq!(others, before);
        }
    }
}
