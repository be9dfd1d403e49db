//! What a row is, how it is run, and what is asked of its results.

use akari_gpu_test::{Gpu, Kernel, KernelError, UNWRITTEN, run_kernel};
use glam::{DVec3, Vec3};

pub type TwinFn = fn(&[f32], &mut Vec<f32>);
pub type OracleFn = fn(&[f64], &mut Vec<f64>);

/// WGSL of a row.
pub struct Source {
    /// `#import` lines and functions.
    pub header: String,
    /// Reads `x(i)`, writes `y(i, value)`.
    pub body: &'static str,
}

/// A function under adversarial inputs.
pub struct Row {
    pub name: &'static str,
    pub source: Source,
    pub inputs: usize,
    pub outputs: usize,
    pub twin: TwinFn,
    /// What is true, in f64.
    pub oracle: OracleFn,
    /// Every output lies in here.
    pub range: [f64; 2],
    pub sweeps: Vec<Sweep>,
}

/// Inputs in an order in which neighbours are near.
pub struct Sweep {
    pub name: String,
    /// Row after row.
    pub samples: Vec<f32>,
    pub error: Bound,
    /// Of the change of the error from one sample to the next.
    pub jump: Bound,
    /// In place of the row's, for input that no scene should have.
    pub range: Option<[f64; 2]>,
}

/// `absolute + relative · |truth|`.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    pub absolute: f64,
    pub relative: f64,
}

pub const fn absolute(absolute: f64) -> Bound {
    Bound {
        absolute,
        relative: 0.0,
    }
}

pub const fn relative(relative: f64) -> Bound {
    Bound {
        // Below the smallest normal number a device may return 0.
        absolute: 1.2e-38,
        relative,
    }
}

/// What has no true value: only finite and within the range.
pub const ANY: Bound = absolute(f64::INFINITY);

impl Bound {
    fn of(self, truth: f64) -> f64 {
        self.absolute + self.relative * truth.abs()
    }
}

/// A sweep whose error may jump from its one bound to its other at most.
pub fn sweep(name: impl Into<String>, error: Bound, samples: Vec<f32>) -> Sweep {
    Sweep {
        name: name.into(),
        samples,
        error,
        jump: error,
        range: None,
    }
}

impl Sweep {
    /// The same with a bound of its own for jumps.
    pub fn jump(mut self, jump: Bound) -> Self {
        self.jump = jump;
        self
    }

    /// The same within another range.
    pub fn within(mut self, range: [f64; 2]) -> Self {
        self.range = Some(range);
        self
    }
}

/// A guard of a WGSL module that is taken out.
pub struct Guard {
    /// What it guards against.
    pub what: &'static str,
    /// The row that must notice.
    pub row: &'static str,
    pub module: &'static str,
    pub from: &'static str,
    pub to: &'static str,
}

const HELPERS: &str = "
fn x_vec2(i: u32) -> vec2<f32> { return vec2<f32>(x(i), x(i + 1u)); }
fn x_vec3(i: u32) -> vec3<f32> { return vec3<f32>(x(i), x(i + 1u), x(i + 2u)); }
fn x_vec4(i: u32) -> vec4<f32> { return vec4<f32>(x(i), x(i + 1u), x(i + 2u), x(i + 3u)); }
fn y_vec2(i: u32, v: vec2<f32>) { y(i, v.x); y(i + 1u, v.y); }
fn y_vec3(i: u32, v: vec3<f32>) { y(i, v.x); y(i + 1u, v.y); y(i + 2u, v.z); }
";

/// WGSL modules of all crates that need no engine, in order of dependency.
fn modules() -> impl Iterator<Item = (&'static str, &'static str)> {
    akari_math::WGSL_MODULES
        .iter()
        .chain(akari_visibility::WGSL_MODULES)
        .copied()
}

impl Row {
    /// How many inputs there are.
    pub fn cases(&self) -> usize {
        self.input().len() / self.inputs
    }

    pub fn input(&self) -> Vec<f32> {
        let samples = self.sweeps.iter().flat_map(|sweep| &sweep.samples);
        samples.copied().collect()
    }

    /// Runs the WGSL, without one of its guards where one is given.
    pub fn device_output(
        &self,
        gpu: &Gpu,
        without: Option<&Guard>,
    ) -> Result<Vec<f32>, KernelError> {
        let mut changed = 0;
        let modules: Vec<(&str, String)> = modules()
            .map(|(path, source)| match without {
                Some(guard) if guard.module == path => {
                    changed += source.matches(guard.from).count();
                    (path, source.replace(guard.from, guard.to))
                }
                _ => (path, source.to_owned()),
            })
            .collect();
        if let Some(guard) = without {
            assert!(changed > 0, "{}: no guard {}", guard.module, guard.from);
        }
        let modules: Vec<(&str, &str)> = modules.iter().map(|(p, s)| (*p, s.as_str())).collect();
        let kernel = Kernel {
            header: &format!("{}\n{HELPERS}", self.source.header),
            body: self.source.body,
            inputs: self.inputs,
            outputs: self.outputs,
        };
        run_kernel(gpu, &modules, &kernel, &self.input())
    }
}

/// What is found of one sweep.
pub struct Verdict {
    pub name: String,
    /// The largest error, and the largest share of its bound that an error or a jump takes.
    pub error: f64,
    pub share: f64,
    pub fault: Option<String>,
}

/// Holds `output` against what the row asks.
pub fn check(row: &Row, output: &[f32]) -> Vec<Verdict> {
    assert_eq!(output.len(), row.cases() * row.outputs, "{}", row.name);
    let mut verdicts = Vec::new();
    let mut outputs = output.chunks_exact(row.outputs);
    for sweep in &row.sweeps {
        let (mut error, mut share) = (0.0_f64, 0.0_f64);
        let mut fault: Option<String> = None;
        let range = sweep.range.unwrap_or(row.range);
        let mut previous: Option<(Vec<f64>, Vec<f64>)> = None;
        for (index, input) in sweep.samples.chunks_exact(row.inputs).enumerate() {
            let found = outputs.next().expect("as many outputs as inputs");
            let wide: Vec<f64> = input.iter().map(|&x| f64::from(x)).collect();
            let mut truth = Vec::new();
            (row.oracle)(&wide, &mut truth);
            assert_eq!(truth.len(), row.outputs, "{}: the oracle", row.name);
            let mut errors = Vec::new();
            for (column, (&found, &truth)) in found.iter().zip(&truth).enumerate() {
                let value = f64::from(found);
                let off = value - truth;
                let mut say = |what: String| {
                    fault.get_or_insert_with(|| {
                        format!(
                            "{}: {what} at sample {index}, output {column}: {value:e} for {truth:e}; input {input:?}",
                            sweep.name
                        )
                    });
                };
                if !value.is_finite() {
                    say(if found.to_bits() == UNWRITTEN {
                        "not written".to_owned()
                    } else {
                        "not finite".to_owned()
                    });
                } else if value < range[0] || value > range[1] {
                    say(format!("out of the range {range:?}"));
                }
                let allowed = sweep.error.of(truth);
                let is_asked = allowed.is_finite();
                if is_asked {
                    assert!(truth.is_finite(), "{}: the oracle at {input:?}", row.name);
                    error = error.max(off.abs());
                    share = share.max(off.abs() / allowed);
                    if off.is_nan() || off.abs() > allowed {
                        say(format!("error {off:e}, {allowed:e} allowed"));
                    }
                }
                if let Some((errors, truths)) = &previous {
                    let step = (off - errors[column]).abs();
                    let allowed = sweep.jump.of(truth.abs().max(truths[column].abs()));
                    if is_asked && allowed.is_finite() {
                        share = share.max(step / allowed);
                        if step.is_nan() || step > allowed {
                            say(format!("jump of the error {step:e}, {allowed:e} allowed"));
                        }
                    }
                }
                errors.push(off);
            }
            previous = Some((errors, truth));
        }
        verdicts.push(Verdict {
            name: sweep.name.clone(),
            error,
            share,
            fault,
        });
    }
    verdicts
}

/// A row of the identity.
pub fn example() -> Row {
    Row {
        name: "identity",
        source: Source {
            header: String::new(),
            body: "y(0u, x(0u));",
        },
        inputs: 1,
        outputs: 1,
        twin: |x, y| y.push(x[0]),
        oracle: |x, y| y.push(x[0]),
        range: [0.0, 1.0],
        sweeps: vec![sweep("0 to 1", absolute(0.1), steps(0.0, 1.0, 10)).jump(absolute(0.1))],
    }
}

/// `n + 1` numbers from `from` to `to`, evenly.
pub fn steps(from: f32, to: f32, n: usize) -> Vec<f32> {
    (0..=n)
        .map(|i| from + (to - from) * (i as f32 / n as f32))
        .collect()
}

/// `n + 1` numbers from `10^from` to `10^to`, evenly in the logarithm.
pub fn log_steps(from: f64, to: f64, n: usize) -> Vec<f32> {
    (0..=n)
        .map(|i| 10.0_f64.powf(from + (to - from) * (i as f64 / n as f64)) as f32)
        .collect()
}

/// Roughness from 0 to 1: finely near 0, evenly from there on.
pub fn roughnesses() -> Vec<f32> {
    let mut values = vec![0.0];
    values.extend(log_steps(-8.0, -2.0, 60));
    values.extend(steps(0.01, 1.0, 199).into_iter().skip(1));
    values
}

/// Sharpness 0, then 1e-30 to 1e30.
pub fn sharpnesses() -> Vec<f32> {
    let mut values = vec![0.0];
    values.extend(log_steps(-30.0, 30.0, 600));
    values
}

/// A number that grows from `-span` to `span`, finer towards 0 and with 0 itself.
pub fn through_zero(span: f64, n: usize) -> Vec<f32> {
    let half = log_steps(span.log10() - 9.0, span.log10(), n);
    let below = half.iter().rev().map(|x| -x);
    below.chain([0.0]).chain(half.iter().copied()).collect()
}

/// The samples of one sweep, each made by `row`.
pub fn samples<T: Copy>(values: &[T], mut row: impl FnMut(T, &mut Vec<f32>)) -> Vec<f32> {
    let mut output = Vec::new();
    for &value in values {
        row(value, &mut output);
    }
    output
}

pub fn push3(output: &mut Vec<f32>, v: Vec3) {
    output.extend(v.to_array());
}

pub fn push3_wide(output: &mut Vec<f64>, v: DVec3) {
    output.extend(v.to_array());
}

pub fn vec3(row: &[f32], i: usize) -> Vec3 {
    Vec3::new(row[i], row[i + 1], row[i + 2])
}

pub fn dvec3(row: &[f64], i: usize) -> DVec3 {
    DVec3::new(row[i], row[i + 1], row[i + 2])
}

/// Unit vector at `angle` from +z, towards +x.
pub fn tilted(angle: f64) -> Vec3 {
    DVec3::new(angle.sin(), 0.0, angle.cos()).as_vec3()
}

/// Numbers without a pattern, the same in every run (`SplitMix64`, Steele et al. 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `[lo, hi)`.
    pub fn range(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * ((self.next() >> 40) as f32 / (1u64 << 24) as f32)
    }

    /// Unit vector, uniform on the sphere.
    pub fn direction(&mut self) -> Vec3 {
        let z = self.range(-1.0, 1.0);
        let angle = self.range(0.0, std::f32::consts::TAU);
        let radius = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    }
}
