//! What a row of the twin table is, and how it is run.

use akari_gpu_test::{CompareReport, Gpu, Kernel, KernelError, compare, run_kernel, ulp_distance};
use akari_math::WGSL_MODULES;
use glam::Vec3;

/// How far a result may be off: an element passes by either of the two.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// Units in the last place.
    pub ulp: u32,
    /// Absolute difference.
    pub absolute: f64,
}

pub const fn ulp(ulp: u32) -> Budget {
    Budget { ulp, absolute: 0.0 }
}

/// Units in the last place of `scale`: for results that come out of a cancellation between numbers of that size.
pub const fn ulp_of(ulp: u32, scale: f64) -> Budget {
    Budget {
        ulp: 0,
        absolute: ulp as f64 * scale * 1.192_092_9e-7,
    }
}

pub const fn absolute(absolute: f64) -> Budget {
    Budget { ulp: 0, absolute }
}

/// A part of the domain of a function, with budgets of its own.
pub struct Domain {
    pub name: &'static str,
    /// Rows of input, one after the other.
    pub rows: Vec<f32>,
    /// Rust twin against the f64 oracle; not looked at without an oracle.
    pub accuracy: Budget,
    /// WGSL against the Rust twin.
    pub device: Budget,
}

pub fn domain(name: &'static str, rows: Vec<f32>, accuracy: Budget, device: Budget) -> Domain {
    Domain {
        name,
        rows,
        accuracy,
        device,
    }
}

/// A change of the source that the budgets must notice.
pub struct Mutation {
    /// Import path of the module.
    pub module: &'static str,
    pub from: &'static str,
    pub to: &'static str,
}

pub type TwinFn = fn(&[f32], &mut Vec<f32>);
pub type OracleFn = fn(&[f64], &mut Vec<f64>);

/// One or more WGSL functions that are measured together.
pub struct Case {
    /// Import path of the module of `functions`.
    pub module: &'static str,
    /// The functions that this case covers; imported into `body`.
    pub functions: &'static [&'static str],
    /// What else `body` imports.
    pub imports: &'static str,
    /// Reads `x(i)`, writes `y(i, value)`; see [`Kernel`].
    pub body: &'static str,
    pub inputs: usize,
    pub outputs: usize,
    pub twin: TwinFn,
    pub oracle: Option<OracleFn>,
    pub domains: Vec<Domain>,
    pub mutations: Vec<Mutation>,
}

const HELPERS: &str = "
fn x_vec3(i: u32) -> vec3<f32> { return vec3<f32>(x(i), x(i + 1u), x(i + 2u)); }
fn x_vec4(i: u32) -> vec4<f32> { return vec4<f32>(x(i), x(i + 1u), x(i + 2u), x(i + 3u)); }
fn x_mat3(i: u32) -> mat3x3<f32> { return mat3x3<f32>(x_vec3(i), x_vec3(i + 3u), x_vec3(i + 6u)); }
fn y_vec2(i: u32, v: vec2<f32>) { y(i, v.x); y(i + 1u, v.y); }
fn y_vec3(i: u32, v: vec3<f32>) { y(i, v.x); y(i + 1u, v.y); y(i + 2u, v.z); }
fn y_mat3(i: u32, m: mat3x3<f32>) { y_vec3(i, m[0]); y_vec3(i + 3u, m[1]); y_vec3(i + 6u, m[2]); }
// The halves of a word as whole numbers, which every f32 holds exactly.
fn y_bits(i: u32, bits: u32) { y(i, f32(bits & 0xffffu)); y(i + 1u, f32(bits >> 16u)); }
";

impl Case {
    pub fn name(&self) -> String {
        format!(
            "{}::{}",
            self.module.trim_start_matches("akari_math::"),
            self.functions[0]
        )
    }

    pub fn input(&self) -> Vec<f32> {
        self.domains
            .iter()
            .flat_map(|domain| domain.rows.iter().copied())
            .collect()
    }

    pub fn twin_output(&self) -> Vec<f32> {
        let mut output = Vec::new();
        for (index, row) in self.input().chunks_exact(self.inputs).enumerate() {
            (self.twin)(row, &mut output);
            assert_eq!(
                output.len(),
                (index + 1) * self.outputs,
                "{}: outputs of the twin",
                self.name()
            );
        }
        output
    }

    pub fn oracle_output(&self) -> Option<Vec<f64>> {
        let oracle = self.oracle?;
        let mut output = Vec::new();
        for row in self.input().chunks_exact(self.inputs) {
            let row: Vec<f64> = row.iter().map(|&x| f64::from(x)).collect();
            oracle(&row, &mut output);
        }
        Some(output)
    }

    /// Runs the WGSL, with a mutation where one is given.
    pub fn device_output(
        &self,
        gpu: &Gpu,
        mutation: Option<&Mutation>,
    ) -> Result<Vec<f32>, KernelError> {
        let mutated: Option<String> = mutation.map(|mutation| {
            let (_, source) = WGSL_MODULES
                .iter()
                .find(|(path, _)| *path == mutation.module)
                .expect("module");
            assert!(
                source.contains(mutation.from),
                "{}: nothing to mutate: {}",
                self.name(),
                mutation.from
            );
            source.replacen(mutation.from, mutation.to, 1)
        });
        let modules: Vec<(&str, &str)> = WGSL_MODULES
            .iter()
            .map(|&(path, source)| match (&mutated, mutation) {
                (Some(mutated), Some(mutation)) if mutation.module == path => {
                    (path, mutated.as_str())
                }
                _ => (path, source),
            })
            .collect();
        let header = format!(
            "#import {}::{{{}}}\n{}\n{HELPERS}",
            self.module,
            self.functions.join(", "),
            self.imports
        );
        let kernel = Kernel {
            header: &header,
            body: self.body,
            inputs: self.inputs,
            outputs: self.outputs,
        };
        run_kernel(gpu, &modules, &kernel, &self.input())
    }

    /// The range of output numbers that belongs to each domain.
    pub fn output_ranges(&self) -> Vec<(&Domain, std::ops::Range<usize>)> {
        let mut start = 0;
        self.domains
            .iter()
            .map(|domain| {
                assert_eq!(
                    domain.rows.len() % self.inputs,
                    0,
                    "{}: rows of {}",
                    self.name(),
                    domain.name
                );
                let end = start + domain.rows.len() / self.inputs * self.outputs;
                let range = start..end;
                start = end;
                (domain, range)
            })
            .collect()
    }
}

/// What is wrong with `actual` under `budget`: how many elements, and the worst of them.
pub fn violation(actual: &[f32], expected: &[f64], budget: Budget) -> Option<(usize, String)> {
    let mut count = 0;
    let mut worst: Option<(f64, String)> = None;
    for (index, (&a, &e)) in actual.iter().zip(expected).enumerate() {
        let (difference, distance) = ((f64::from(a) - e).abs(), ulp_distance(a, e as f32));
        if a.is_finite() && (distance <= budget.ulp || difference <= budget.absolute) {
            continue;
        }
        count += 1;
        let size = if a.is_finite() {
            difference
        } else {
            f64::INFINITY
        };
        if worst.as_ref().is_none_or(|(worst, _)| size > *worst) {
            worst = Some((
                size,
                format!("{a:e} for {e:e} at output {index} ({distance} ULP)"),
            ));
        }
    }
    worst.map(|(_, text)| (count, text))
}

pub fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}

pub fn figures(actual: &[f32], expected: &[f64]) -> CompareReport {
    compare(actual, expected)
}

/// Numbers without a pattern, the same in every run (`SplitMix64`, Steele et al. 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> u64 {
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

    /// Uniform in the logarithm between `10^lo` and `10^hi`.
    pub fn log_range(&mut self, lo: f32, hi: f32) -> f32 {
        10.0_f32.powf(self.range(lo, hi))
    }

    /// Unit vector, uniform on the sphere.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(
                self.range(-1.0, 1.0),
                self.range(-1.0, 1.0),
                self.range(-1.0, 1.0),
            );
            if v.length_squared() < 1.0 && v.length_squared() > 0.01 {
                return v.normalize();
            }
        }
    }

    /// Unit vector at `angle` (radians) from `axis`.
    pub fn around(&mut self, axis: Vec3, angle: f32) -> Vec3 {
        let side = loop {
            let side = axis.cross(self.direction());
            if side.length_squared() > 0.01 {
                break side.normalize();
            }
        };
        (axis * angle.cos() + side * angle.sin()).normalize()
    }
}

/// `n` rows, each made by `row`.
pub fn rows(seed: u64, n: usize, mut row: impl FnMut(&mut Random, &mut Vec<f32>)) -> Vec<f32> {
    let mut random = Random::new(seed);
    let mut output = Vec::new();
    for _ in 0..n {
        row(&mut random, &mut output);
    }
    output
}

pub fn push3(output: &mut Vec<f32>, v: Vec3) {
    output.extend(v.to_array());
}

pub fn vec3(row: &[f32], i: usize) -> Vec3 {
    Vec3::new(row[i], row[i + 1], row[i + 2])
}

pub fn dvec3(row: &[f64], i: usize) -> glam::DVec3 {
    glam::DVec3::new(row[i], row[i + 1], row[i + 2])
}
