//! `report.json`: what was measured, on what.

use akari_reference::metrics::Metrics;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Version of the shape of `report.json`: a reader of another one refuses it.
pub const SCHEMA: u32 = 2;

/// All of it. Times of one report come from one device; those of another device belong into another report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Version of this program.
    pub version: String,
    /// Whether fewer settings, smaller pictures and fewer samples were asked for.
    pub quick: bool,
    /// Where it was measured.
    pub device: Device,
    /// One for each effect and scene.
    pub curves: Vec<Curve>,
}

/// What rendered.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Device {
    /// Name of the GPU, or of the software that stands in for one.
    pub adapter: String,
    /// Discrete, integrated, virtual, software.
    pub kind: String,
    /// Vulkan, Metal, Dx12, Gl.
    pub backend: String,
    /// Driver and its version.
    pub driver: String,
}

/// Error against time of one effect on one scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Name of the effect, as settings files spell it.
    pub effect: String,
    /// Name of the scene.
    pub scene: String,
    /// What the picture holds, and what it is held against, in words.
    pub what: String,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// The picture it should be.
    pub reference: Reference,
    /// One for each setting.
    pub points: Vec<Point>,
}

/// How the reference was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// Samples a pixel.
    pub spp: u32,
    /// Longest path, segments.
    pub max_depth: u32,
    /// Relative RMS of what is left of its own noise.
    pub noise: Option<f64>,
}

impl Reference {
    /// What of a relative RMSE against this reference is the picture's own: the reference's noise has nothing to do with
    /// the picture, so that their squares add up. Below a quarter of the noise nothing can be told, and that is what is
    /// returned.
    pub fn own_error(&self, rel_rmse: f64) -> f64 {
        /// The noise is an estimate, itself good to a few hundredths; so is its square, and a sixteenth of that stands out.
        const RESOLVED: f64 = 0.25;
        let noise = self.noise.unwrap_or(0.0);
        let excess = rel_rmse * rel_rmse - noise * noise;
        // What is not a number stays one that is not.
        if excess < (RESOLVED * noise) * (RESOLVED * noise) {
            RESOLVED * noise
        } else {
            excess.sqrt()
        }
    }
}

/// One setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Name of the preset, or `knob = value`.
    pub label: String,
    /// Name of the preset, if it is one.
    pub preset: Option<String>,
    /// The knob that differs from the preset `high`, if it is no preset.
    pub knob: Option<String>,
    /// All knobs of the effect.
    pub settings: BTreeMap<String, f32>,
    /// Error of the picture.
    pub error: Metrics,
    /// Mean |difference| of two frames of the same still scene over the mean: what a person sees as flicker.
    pub flicker: f64,
    /// Time of the effects' passes on the GPU. Absent where the device has no timestamps.
    pub gpu_ms: Option<Milliseconds>,
    /// Time of a whole frame, engine and CPU included.
    pub frame_ms: Milliseconds,
    /// Bytes that the effects hold on the GPU.
    pub gpu_bytes: u64,
    /// Passes of the effects in one frame.
    pub passes: Vec<String>,
    /// Whether no other setting is both faster and more exact.
    pub on_front: bool,
}

impl Point {
    /// The time that the curve is drawn over: that of the GPU where it is known. The least of all rounds, since whatever
    /// else a machine does adds to a time and never takes from it.
    pub fn cost_ms(&self) -> f64 {
        self.gpu_ms
            .as_ref()
            .map_or(self.frame_ms.least, |gpu| gpu.least)
    }

    /// What it usually takes: the median of the same times.
    pub fn usual_ms(&self) -> f64 {
        self.gpu_ms
            .as_ref()
            .map_or(self.frame_ms.median, |gpu| gpu.median)
    }
}

/// Times of several frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Milliseconds {
    /// The shortest; of several passes, the sum of each one's shortest, which takes fewer frames to find than a frame in
    /// which nothing disturbs any of them.
    pub least: f64,
    /// Half of the frames took longer.
    pub median: f64,
    /// One frame in a hundred took longer; the longest of fewer frames.
    pub p99: f64,
    /// How many frames.
    pub frames: u32,
}

impl Milliseconds {
    /// From the times of the passes of single frames, by name; nothing from none. A pass that some frame goes without has
    /// taken no time there.
    pub fn of_passes(frames: &[BTreeMap<String, f64>]) -> Option<Self> {
        let sums: Vec<f64> = frames.iter().map(|passes| passes.values().sum()).collect();
        let whole = Self::of(&sums)?;
        let names: BTreeSet<&String> = frames.iter().flat_map(BTreeMap::keys).collect();
        let shortest = |name: &String| {
            let times = frames.iter().map(|passes| passes.get(name).copied());
            times
                .map(Option::unwrap_or_default)
                .fold(f64::INFINITY, f64::min)
        };
        Some(Self {
            least: names.into_iter().map(shortest).sum(),
            ..whole
        })
    }

    /// From the times of single frames; nothing from none.
    pub fn of(times: &[f64]) -> Option<Self> {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        let nearest_rank = |share: f64| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(rank.saturating_sub(1)).copied()
        };
        Some(Self {
            least: *sorted.first()?,
            median: nearest_rank(0.5)?,
            p99: nearest_rank(0.99)?,
            frames: sorted.len() as u32,
        })
    }
}

/// Marks the points that no other one beats in both time and error.
pub fn mark_front(points: &mut [Point]) {
    let figures: Vec<_> = points
        .iter()
        .map(|point| (point.cost_ms(), point.error.rel_rmse))
        .collect();
    for (point, on_front) in points.iter_mut().zip(front(&figures)) {
        point.on_front = on_front;
    }
}

/// Share by which two times have to differ to count as different: those of one setting, measured twice in one run on a
/// busy machine, do.
pub const TIME_TIE: f64 = 0.05;
/// The same for errors, which come from pictures that are the same each time but for rounding.
pub const ERROR_TIE: f64 = 1e-3;

/// The Pareto front of (time, error): whether no other entry is at least as good in both and better in one, where
/// differences of less than [`TIME_TIE`] and [`ERROR_TIE`] are none. Of entries that are the same but for those, all are
/// on it; one that is no number is not.
pub fn front(figures: &[(f64, f64)]) -> Vec<bool> {
    figures
        .iter()
        .map(|&(time, error)| {
            let valid = time.is_finite() && error.is_finite();
            let beaten = |&(other_time, other_error): &(f64, f64)| {
                let faster = other_time < time * (1.0 - TIME_TIE);
                let no_slower = other_time <= time * (1.0 + TIME_TIE);
                let more_exact = other_error < error * (1.0 - ERROR_TIE);
                let as_exact = other_error <= error * (1.0 + ERROR_TIE);
                (faster && as_exact) || (more_exact && no_slower)
            };
            valid && !figures.iter().any(beaten)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let figures = [
            (1.0, 0.5),
            (2.0, 0.2),
            (2.0, 0.3),
            (3.0, 0.2),
            (4.0, 0.1),
            (4.0, 0.1),
            (0.5, f64::NAN),
            (f64::INFINITY, 0.01),
        ];
        assert_eq!(
            front(&figures),
            [true, true, false, false, true, true, false, false]
        );
        assert_eq!(front(&[]), Vec::<bool>::new());
        // Noise of the clock puts nothing off the front; the same error for clearly more time does.
        assert_eq!(
            front(&[(1.0, 0.1), (1.03, 0.1), (1.2, 0.1), (1.2, 0.09)]),
            [true, true, false, true]
        );
    }

    #[test]
    fn noise_of_the_reference_is_not_the_pictures_error() {
        let reference = Reference {
            spp: 1,
            max_depth: 2,
            noise: Some(0.04),
        };
        assert!((reference.own_error(0.05) - 0.03).abs() < 1e-12);
        // Nothing is known below a part of the noise, not even that it is zero.
        assert_eq!(reference.own_error(0.04), 0.01);
        assert_eq!(reference.own_error(0.02), 0.01);
        assert!(reference.own_error(f64::NAN).is_nan());
        let silent = Reference {
            noise: None,
            ..reference
        };
        assert_eq!(silent.own_error(0.05), 0.05);
    }

    #[test]
    fn times_are_ranked() {
        assert_eq!(Milliseconds::of(&[]), None);
        let times: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let ms = Milliseconds::of(&times).unwrap();
        assert_eq!(
            (ms.least, ms.median, ms.p99, ms.frames),
            (1.0, 100.0, 198.0, 200)
        );
        let few = Milliseconds::of(&[3.0, 1.0, 2.0]).unwrap();
        assert_eq!((few.median, few.p99), (2.0, 3.0));
    }

    #[test]
    fn each_pass_has_its_own_shortest_time() {
        let frame = |times: &[(&str, f64)]| -> BTreeMap<String, f64> {
            let named = times.iter().map(|(name, time)| ((*name).to_owned(), *time));
            named.collect()
        };
        let frames = [
            frame(&[("filter", 1.0), ("store", 4.0), ("once", 9.0)]),
            frame(&[("filter", 3.0), ("store", 2.0)]),
        ];
        let ms = Milliseconds::of_passes(&frames).unwrap();
        assert_eq!((ms.least, ms.median, ms.frames), (3.0, 5.0, 2));
        assert_eq!(Milliseconds::of_passes(&[]), None);
    }
}
