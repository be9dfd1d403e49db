//! How good a table is: total variation, albedo, integrals over rectangular lights.

use crate::brdf::Reflection;
use crate::lobe::Lobe;
use crate::polygon::{Rectangle, lobe_integral};
use crate::quadrature::Fineness;
use crate::table::Table;
use crate::{MIN_ALPHA, MIN_N_DOT_V, cell_coordinates};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Total variation at one point of the table.
#[derive(Clone, Copy, Debug)]
pub struct TotalVariation {
    /// Perceptual roughness.
    pub roughness: f64,
    /// n·v.
    pub n_dot_v: f64,
    /// ½ ∫ |p − q| over the upper hemisphere between the normalised reflection p and the normalised lobe q.
    pub distance: f64,
    /// ‖p − q‖₂ / ‖p‖₂.
    pub relative_l2: f64,
    /// Albedo of the table less that of the reflection, F = 1.
    pub albedo_error: f64,
    /// The same for the Schlick part, bias · N − A₁.
    pub fresnel_error: f64,
}

/// Error of integrals over random rectangles for one roughness and one range of view angles.
#[derive(Clone, Copy, Debug)]
pub struct IntegralBin {
    /// Perceptual roughness.
    pub roughness: f64,
    /// View angle from, to, degrees.
    pub degrees: (f64, f64),
    /// Mean |error| / mean value.
    pub mean: f64,
    /// √(Σ error² / Σ value²).
    pub rms: f64,
    /// √(Σ error² / Σ value²) over the lights wholly above the horizon.
    pub rms_above: f64,
}

/// All figures of a table.
#[derive(Clone, Debug)]
pub struct Quality {
    /// At the 48 cells on which the published table was measured, by roughness, then by angle.
    pub grid: Vec<TotalVariation>,
    /// At every fourth cell in both directions, and the last ones.
    pub cells: Vec<TotalVariation>,
    /// At the centres between four cells, every fourth.
    pub midpoints: Vec<TotalVariation>,
    /// Integrals over rectangles.
    pub bins: Vec<IntegralBin>,
}

/// Published figures, for comparison.
#[derive(Clone, Copy, Debug)]
pub struct Published;
/// Bevy's.
#[derive(Clone, Copy, Debug)]
pub struct Bevy;

/// Columns of the 64² grid at which the published table was measured.
const GRID_X: [usize; 8] = [4, 10, 16, 20, 32, 45, 55, 63];
/// Rows of the same.
const GRID_Y: [usize; 6] = [0, 16, 32, 44, 54, 61];

/// Compares a lobe with a reflection.
pub fn distance(reflection: &Reflection, lobe: &Lobe) -> (f64, f64) {
    let nodes = reflection.nodes(Fineness::REPORT);
    let values: Vec<(f64, f64)> = nodes
        .iter()
        .map(|n| (n.weight, reflection.cosine_weighted(n.direction)))
        .collect();
    let total: f64 = values.iter().map(|(w, f)| w * f).sum();
    let norm = lobe.norm();
    let (mut variation, mut square, mut target) = (0.0, 0.0, 0.0);
    for (node, (w, f)) in nodes.iter().zip(values) {
        let p = f / total;
        let d = p - lobe.density(node.direction) / norm;
        variation += w * d.abs();
        square += w * d * d;
        target += w * p * p;
    }
    (0.5 * variation, (square / target).sqrt())
}

/// Measures a table at table coordinates.
pub fn measure(table: &Table, x: f64, y: f64) -> TotalVariation {
    let last = (table.resolution() - 1) as f64;
    let (roughness, s) = (x / last, y / last);
    let n_dot_v = 1.0 - s * s;
    let reflection = Reflection::new((roughness * roughness).max(MIN_ALPHA), n_dot_v.max(MIN_N_DOT_V));
    let entry = table.interpolate(x, y);
    let (distance, relative_l2) = distance(&reflection, &entry.lobe);
    let (a0, a1) = reflection.albedo();
    TotalVariation {
        roughness,
        n_dot_v,
        distance,
        relative_l2,
        albedo_error: entry.albedo() - a0,
        fresnel_error: entry.bias * entry.lobe_norm - a1,
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014) to [0, 1).
struct Random(u64);
impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn range(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.next()
    }
}

/// A random light within 52° of the mirror direction, 1.5 to 6 m away, half edges 0.25 to 1.5 m, tilted up to 60°.
fn random_rectangle(random: &mut Random, n_dot_v: f64) -> Rectangle {
    let cone = |random: &mut Random, axis: [f64; 3], max_degrees: f64| {
        let z = random.range(max_degrees.to_radians().cos(), 1.0);
        let (s, (sin, cos)) = ((1.0 - z * z).sqrt(), random.range(0.0, 2.0 * PI).sin_cos());
        around(axis, [s * cos, s * sin, z])
    };
    let sin_v = (1.0 - n_dot_v * n_dot_v).sqrt();
    let direction = cone(random, [-sin_v, 0.0, n_dot_v], 52.0);
    let distance = random.range(1.5, 6.0);
    let normal = cone(random, direction, 60.0);
    let (sin, cos) = random.range(0.0, 2.0 * PI).sin_cos();
    let (half_u, half_v) = (random.range(0.25, 1.5), random.range(0.25, 1.5));
    Rectangle {
        centre: direction.map(|d| d * distance),
        half_edges: [
            around(normal, [cos * half_u, sin * half_u, 0.0]),
            around(normal, [-sin * half_v, cos * half_v, 0.0]),
        ],
    }
}

/// `local` in a frame whose z is `axis` (Duff et al. 2017, *Building an Orthonormal Basis, Revisited*).
fn around(axis: [f64; 3], local: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = axis;
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    let t = [1.0 + sign * x * x * a, sign * b, -sign * x];
    let u = [b, sign + y * y * a, -y];
    std::array::from_fn(|i| t[i] * local[0] + u[i] * local[1] + axis[i] * local[2])
}

/// Rectangles per bin.
const RECTANGLES: usize = 160;

/// One bin of integral errors.
pub fn integral_bin(table: &Table, roughness: f64, degrees: (f64, f64)) -> IntegralBin {
    let seed = (roughness * 1000.0) as u64 * 1_000_003 + (degrees.0 * 10.0) as u64 * 1009 + (degrees.1 * 10.0) as u64;
    let mut random = Random(seed);
    let cases: Vec<(f64, Rectangle)> = (0..RECTANGLES)
        .map(|_| {
            let n_dot_v = random.range(degrees.0, degrees.1).to_radians().cos();
            (n_dot_v, random_rectangle(&mut random, n_dot_v))
        })
        .collect();
    let alpha = (roughness * roughness).max(MIN_ALPHA);
    let panels = ((4.0 / alpha) as usize).clamp(12, 60);
    let errors: Vec<(f64, f64, bool)> = cases
        .par_iter()
        .map(|(n_dot_v, rectangle)| {
            let truth = rectangle.reflected(&Reflection::new(alpha, *n_dot_v), panels);
            let entry = table.sample(roughness, *n_dot_v);
            let ours = (entry.scale + entry.bias) * lobe_integral(&entry.lobe, &rectangle.corners());
            (ours - truth, truth, rectangle.corners().iter().all(|c| c[2] > 0.0))
        })
        .collect();
    let fold = |f: &dyn Fn(&(f64, f64, bool)) -> f64| errors.iter().map(f).sum::<f64>();
    IntegralBin {
        roughness,
        degrees,
        mean: fold(&|e| e.0.abs()) / fold(&|e| e.1),
        rms: (fold(&|e| e.0 * e.0) / fold(&|e| e.1 * e.1)).sqrt(),
        rms_above: (fold(&|e| if e.2 { e.0 * e.0 } else { 0.0 }) / fold(&|e| if e.2 { e.1 * e.1 } else { 0.0 })).sqrt(),
    }
}

/// All figures of a table.
pub fn quality(table: &Table) -> Quality {
    let n = table.resolution();
    let last = n - 1;
    let at = |points: Vec<(f64, f64)>| -> Vec<TotalVariation> {
        points.par_iter().map(|&(x, y)| measure(table, x, y)).collect()
    };
    let scale = last as f64 / 63.0;
    let grid = GRID_X
        .iter()
        .flat_map(|&x| GRID_Y.iter().map(move |&y| (x as f64 * scale, y as f64 * scale)))
        .collect();
    let steps: Vec<usize> = (0..last).step_by(4.min(last)).chain([last]).collect();
    let cells = steps
        .iter()
        .flat_map(|&y| steps.iter().map(move |&x| (x as f64, y as f64)))
        .collect();
    let midpoints = steps
        .iter()
        .flat_map(|&y| steps.iter().map(move |&x| (x, y)))
        .map(|(x, y)| (x.min(last - 1) as f64 + 0.5, y.min(last - 1) as f64 + 0.5))
        .collect();
    let mut bins = Vec::new();
    for roughness in [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0] {
        for degrees in [(0.0, 45.0), (45.0, 70.0), (60.0, 80.0), (70.0, 80.0), (80.0, 88.0)] {
            bins.push(integral_bin(table, roughness, degrees));
        }
    }
    let _ = cell_coordinates;
    Quality {
        grid: at(grid),
        cells: at(cells),
        midpoints: at(midpoints),
        bins,
    }
}

fn summary(points: &[TotalVariation]) -> String {
    let mean = |f: &dyn Fn(&TotalVariation) -> f64| points.iter().map(f).sum::<f64>() / points.len() as f64;
    let max = |f: &dyn Fn(&TotalVariation) -> f64| points.iter().map(f).fold(0.0, f64::max);
    format!(
        "TV mean {:.4} max {:.4}, L2 mean {:.4}, albedo max {:.5}, fresnel max {:.5}",
        mean(&|p| p.distance),
        max(&|p| p.distance),
        mean(&|p| p.relative_l2),
        max(&|p| p.albedo_error.abs()),
        max(&|p| p.fresnel_error.abs())
    )
}

/// Text.
pub fn report(quality: &Quality) -> String {
    let mut out = String::new();
    let mut line = |s: String| {
        out.push_str(&s);
        out.push('\n');
    };
    for row in quality.grid.chunks(GRID_Y.len()) {
        line(format!(
            "alpha {:.4}: {}",
            row[0].roughness * row[0].roughness,
            row.iter()
                .map(|p| format!("{:.0}° {:.3}", p.n_dot_v.max(MIN_N_DOT_V).acos().to_degrees(), p.distance))
                .collect::<Vec<_>>()
                .join(" | ")
        ));
    }
    line(format!("grid: {}", summary(&quality.grid)));
    line(format!("cells: {}", summary(&quality.cells)));
    line(format!("midpoints: {}", summary(&quality.midpoints)));
    for row in quality.bins.chunks(5) {
        line(format!(
            "r {:.1}: {}",
            row[0].roughness,
            row.iter()
                .map(|b| format!(
                    "{:.0}-{:.0}° mean {:.1} rms {:.1} ({:.1})",
                    b.degrees.0,
                    b.degrees.1,
                    100.0 * b.mean,
                    100.0 * b.rms,
                    100.0 * b.rms_above
                ))
                .collect::<Vec<_>>()
                .join(" | ")
        ));
    }
    out
}
