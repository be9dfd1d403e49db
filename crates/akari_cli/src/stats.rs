//! `--stats`: what a render took and held, as JSON.

use crate::error::CliError;
use bevy_akari::prelude::{EffectReport, GpuLedger};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// Times of each frame.
#[derive(Debug, Default)]
pub struct FrameTimes {
    frames_ms: Vec<f64>,
    gpu_ms: BTreeMap<String, Vec<f64>>,
}

impl FrameTimes {
    /// Adds one frame.
    pub fn add(&mut self, frame: Duration, gpu: BTreeMap<String, f64>) {
        self.frames_ms.push(frame.as_secs_f64() * 1e3);
        for (name, milliseconds) in gpu {
            self.gpu_ms.entry(name).or_default().push(milliseconds);
        }
    }
}

/// Median and minimum in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Milliseconds {
    median: f64,
    min: f64,
}

impl Milliseconds {
    fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        Some(Self {
            median: *sorted.get(sorted.len() / 2)?,
            min: *sorted.first()?,
        })
    }
}

#[derive(Debug, Serialize)]
struct Pass {
    executions: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    gpu_ms: Option<Milliseconds>,
}

#[derive(Debug, Serialize)]
struct Lights {
    area: u32,
}

/// Everything that `--stats` tells.
#[derive(Debug, Serialize)]
pub struct Stats {
    adapter: String,
    frames: u32,
    passes: BTreeMap<String, Pass>,
    frame_ms: Option<Milliseconds>,
    gpu_bytes: BTreeMap<&'static str, u64>,
    effects: EffectReport,
    lights: Lights,
    counters: BTreeMap<&'static str, u64>,
    non_finite_pixels: u64,
    peak_memory_bytes: Option<u64>,
}

impl Stats {
    /// Puts them together. `executions` counts the passes of this project within the timed frames; passes of Bevy
    /// appear with their times and one execution a frame.
    pub fn new(
        adapter: String,
        frames: u32,
        executions: BTreeMap<&'static str, u64>,
        times: &FrameTimes,
        ledger: &GpuLedger,
        effects: &EffectReport,
        area_lights: u32,
        non_finite_pixels: u64,
    ) -> Self {
        let mut passes: BTreeMap<String, Pass> = BTreeMap::new();
        for (name, values) in &times.gpu_ms {
            let executions = if name.starts_with("akari_") {
                0
            } else {
                values.len() as u64
            };
            let gpu_ms = Milliseconds::of(values);
            passes.insert(name.clone(), Pass { executions, gpu_ms });
        }
        for (name, count) in executions {
            let pass = passes.entry(name.to_owned()).or_insert(Pass {
                executions: 0,
                gpu_ms: None,
            });
            pass.executions = count;
        }
        // A pass that ran while the scene was loading and never again has a time, but took no part.
        passes.retain(|_, pass| pass.executions > 0);
        Self {
            adapter,
            frames,
            passes,
            frame_ms: Milliseconds::of(&times.frames_ms),
            gpu_bytes: ledger.bytes_by_effect(),
            effects: effects.clone(),
            lights: Lights { area: area_lights },
            counters: ledger.counters(),
            non_finite_pixels,
            peak_memory_bytes: peak_memory_bytes(),
        }
    }

    /// Writes them through a temporary file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), CliError> {
        let mut text = serde_json::to_string_pretty(self)
            .map_err(|error| CliError::other(error.to_string()))?;
        text.push('\n');
        let _writing = crate::progress::writing();
        akari_scene::write_atomic(path, text.as_bytes())?;
        Ok(())
    }
}

/// Largest resident memory of this process, where the system tells.
pub fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_minima() {
        assert_eq!(Milliseconds::of(&[]), None);
        let three = Milliseconds::of(&[5.0, 1.0, 2.0]);
        assert_eq!(
            three,
            Some(Milliseconds {
                median: 2.0,
                min: 1.0
            })
        );
    }
}
