//! How good a table is: total variation, albedo, integrals over rectangular lights.

use crate::brdf::Reflection;
use crate::fit::{coordinates, reflection_at};
use crate::lobe::Model;
use crate::polygon::{Rectangle, clip_to_horizon, dot, form_factor, model_integral, reflected};
use crate::quadrature::Fineness;
use crate::spheres::{SpheresError, spheres};
use crate::table::Table;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Columns of a 64² table at which the published table was measured.
const GRID_X: [usize; 8] = [4, 10, 16, 20, 32, 45, 55, 63];
/// Rows of the same: 0°, 21°, 42°, 59°, 75°, 86°.
const GRID_Y: [usize; 6] = [0, 16, 32, 44, 54, 61];
/// Points per row of [`Quality::grid`].
pub const GRID_ANGLES: usize = GRID_Y.len();
/// The rest of the table is measured at every third cell.
const STRIDE: usize = 3;

/// Perceptual roughnesses of the bins of integrals.
pub const BIN_ROUGHNESSES: [f64; 8] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0];
/// View angles of the bins, degrees.
pub const BIN_DEGREES: [(f64, f64); 5] = [
    (0.0, 45.0),
    (45.0, 70.0),
    (70.0, 80.0),
    (80.0, 88.0),
    (60.0, 80.0),
];
/// Random rectangles per bin.
pub const RECTANGLES: usize = 320;

/// The table against the reflection at one point.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Perceptual roughness.
    pub roughness: f64,
    /// n·v.
    pub n_dot_v: f64,
    /// ½ ∫ |p − q| over the upper hemisphere between the normalised reflection p and the normalised lobe q.
    pub total_variation: f64,
    /// ‖p − q‖₂ / ‖p‖₂.
    pub relative_l2: f64,
    /// Albedo of the table less that of the reflection for F = 1.
    pub albedo_error: f64,
    /// The same for the part of Schlick's weight (f0 = 0, f90 = 1).
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
}

/// Where the renderer clips the light to the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clipping {
    /// Before and after the transform: what our table is fitted for.
    BeforeAndAfter,
    /// After the transform only, as the published method does.
    AfterOnly,
}

/// Where random lights are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Centred within 52° of the mirror direction.
    NearMirror,
    /// Centred anywhere else above the horizon: where only the lobe's tail sees them.
    OffMirror,
}

const MIRROR_CONE_DEGREES: f64 = 52.0;

/// All figures of a table.
#[derive(Clone, Debug)]
pub struct Quality {
    /// At the 48 cells on which the published table was measured: by roughness, then by angle.
    pub grid: Vec<Point>,
    /// At every third cell of every third row; the last row, which no view reads alone, apart.
    pub cells: Vec<Point>,
    /// In the middle between cells, next to each of `cells`.
    pub midpoints: Vec<Point>,
    /// Lights near the mirror direction, by roughness, then by angle; with our clipping.
    pub bins: Vec<IntegralBin>,
    /// Lights elsewhere above the horizon, likewise.
    pub off_mirror_bins: Vec<IntegralBin>,
    /// Spheres under lights of several shapes.
    pub spheres: Vec<SpheresError>,
}

/// Total variation and relative L2 distance between a normalised reflection and a model.
pub fn distance(reflection: &Reflection, model: &Model) -> (f64, f64) {
    let nodes = reflection.nodes(Fineness::REPORT);
    let values: Vec<f64> = nodes
        .iter()
        .map(|n| reflection.cosine_weighted(n.direction))
        .collect();
    let total: f64 = nodes.iter().zip(&values).map(|(n, f)| n.weight * f).sum();
    let (mut variation, mut square, mut target) = (0.0, 0.0, 0.0);
    for (node, f) in nodes.iter().zip(values) {
        let p = f / total;
        let difference = p - model.density(node.direction);
        variation += node.weight * difference.abs();
        square += node.weight * difference * difference;
        target += node.weight * p * p;
    }
    (0.5 * variation, (square / target).sqrt())
}

/// Measures a table at table coordinates, in cells.
pub fn measure(table: &Table, x: f64, y: f64) -> Point {
    let (roughness, n_dot_v) = coordinates(table.resolution(), x, y);
    let reflection = reflection_at(table.resolution(), x, y);
    let entry = table.interpolate(x, y);
    let (total_variation, relative_l2) = distance(&reflection, &entry.model(reflection.n_dot_v));
    let (a0, a1) = reflection.albedo();
    Point {
        roughness,
        n_dot_v,
        total_variation,
        relative_l2,
        albedo_error: entry.albedo() - a0,
        fresnel_error: entry.bias - a1,
    }
}

fn measure_all(table: &Table, points: &[(f64, f64)]) -> Vec<Point> {
    points
        .par_iter()
        .map(|&(x, y)| measure(table, x, y))
        .collect()
}

/// The 48 points at which the published table was measured; for another resolution, the same coordinates.
pub fn measure_grid(table: &Table) -> Vec<Point> {
    let scale = (table.resolution() - 1) as f64 / (crate::RESOLUTION - 1) as f64;
    let points: Vec<(f64, f64)> = GRID_X
        .iter()
        .flat_map(|&x| {
            GRID_Y
                .iter()
                .map(move |&y| (x as f64 * scale, y as f64 * scale))
        })
        .collect();
    measure_all(table, &points)
}

/// Every third cell up to the last column and the last row but one, moved by `offset` cells in both directions and
/// kept inside the table.
pub fn measure_cells(table: &Table, offset: f64) -> Vec<Point> {
    let last = table.resolution() - 1;
    let every = |end: usize| (0..end).step_by(STRIDE).chain([end]);
    let points: Vec<(f64, f64)> = every(last - 1)
        .flat_map(|y| every(last).map(move |x| (x, y)))
        .map(|(x, y)| {
            (
                (x as f64 + offset).min(last as f64 - offset),
                y as f64 + offset,
            )
        })
        .collect();
    measure_all(table, &points)
}

/// `SplitMix64` (Steele, Lea, Flood 2014, *Fast Splittable Pseudorandom Number Generators*).
struct Random(u64);

impl Random {
    fn range(&mut self, from: f64, to: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let unit = ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64;
        from + (to - from) * unit
    }

    /// Uniform by solid angle within `degrees` of `axis`.
    fn in_cone(&mut self, axis: [f64; 3], degrees: f64) -> [f64; 3] {
        let z = self.range(degrees.to_radians().cos(), 1.0);
        let (s, (sin, cos)) = ((1.0 - z * z).sqrt(), self.range(0.0, TAU).sin_cos());
        in_frame(axis, [s * cos, s * sin, z])
    }

    /// A light 1.5 m to 6 m away, half edges 0.25 m to 1.5 m, tilted up to 60°.
    fn rectangle(&mut self, n_dot_v: f64, place: Place) -> Rectangle {
        let mirror = [-(1.0 - n_dot_v * n_dot_v).sqrt(), 0.0, n_dot_v];
        let direction = match place {
            Place::NearMirror => self.in_cone(mirror, MIRROR_CONE_DEGREES),
            Place::OffMirror => loop {
                let direction = self.in_cone([0.0, 0.0, 1.0], 90.0);
                if dot(direction, mirror) < MIRROR_CONE_DEGREES.to_radians().cos() {
                    break direction;
                }
            },
        };
        let distance = self.range(1.5, 6.0);
        let normal = self.in_cone(direction, 60.0);
        let (sin, cos) = self.range(0.0, TAU).sin_cos();
        let (u, v) = (self.range(0.25, 1.5), self.range(0.25, 1.5));
        Rectangle {
            centre: direction.map(|d| d * distance),
            half_edges: [
                in_frame(normal, [cos * u, sin * u, 0.0]),
                in_frame(normal, [-sin * v, cos * v, 0.0]),
            ],
        }
    }
}

/// `local` in a frame whose z is the unit vector `axis` (Duff et al. 2017, *Building an Orthonormal Basis,
/// Revisited*, listing 3).
fn in_frame(axis: [f64; 3], local: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = axis;
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    let t = [1.0 + sign * x * x * a, sign * b, -sign * x];
    let u = [b, sign + y * y * a, -y];
    std::array::from_fn(|i| t[i] * local[0] + u[i] * local[1] + axis[i] * local[2])
}

/// Integrals over [`RECTANGLES`] random rectangles: the table's closed form against quadrature of the reflection, F = 1.
///
/// The rectangles depend on the bin alone, so two tables see the same ones.
pub fn integral_bin(
    table: &Table,
    roughness: f64,
    degrees: (f64, f64),
    place: Place,
    clipping: Clipping,
) -> IntegralBin {
    let seed = [roughness, degrees.0, degrees.1]
        .iter()
        .fold(0_u64, |seed, v| {
            seed.wrapping_mul(1_000_003)
                .wrapping_add((v * 1000.0) as u64)
        });
    let mut random = Random(seed);
    let cases: Vec<(f64, Rectangle)> = (0..RECTANGLES)
        .map(|_| {
            let n_dot_v = random.range(degrees.0, degrees.1).to_radians().cos();
            (n_dot_v, random.rectangle(n_dot_v, place))
        })
        .collect();
    let alpha = (roughness * roughness).max(crate::MIN_ALPHA);
    let values: Vec<(f64, f64)> = cases
        .par_iter()
        .map(|(n_dot_v, rectangle)| {
            let corners = rectangle.corners();
            let truth = reflected(&corners, &Reflection::new(alpha, *n_dot_v));
            let entry = table.sample(roughness, *n_dot_v);
            let model = entry.model(*n_dot_v);
            let integral = match clipping {
                Clipping::BeforeAndAfter => model_integral(&model, &corners),
                Clipping::AfterOnly => {
                    let mapped = corners.map(|corner| model.lobe.transform(corner));
                    let [x, _, z] = form_factor(&clip_to_horizon(&corners));
                    model.lobe_weight() * form_factor(&clip_to_horizon(&mapped))[2]
                        + model.tail_z * z
                        + model.tail_x * x
                }
            };
            (entry.albedo() * integral - truth, truth)
        })
        .collect();
    let sum = |f: &dyn Fn(&(f64, f64)) -> f64| values.iter().map(f).sum::<f64>();
    IntegralBin {
        roughness,
        degrees,
        mean: sum(&|v| v.0.abs()) / sum(&|v| v.1),
        rms: (sum(&|v| v.0 * v.0) / sum(&|v| v.1 * v.1)).sqrt(),
    }
}

/// Every bin of [`BIN_ROUGHNESSES`] × [`BIN_DEGREES`].
pub fn integral_bins(table: &Table, place: Place, clipping: Clipping) -> Vec<IntegralBin> {
    BIN_ROUGHNESSES
        .iter()
        .flat_map(|&roughness| {
            BIN_DEGREES.map(|degrees| integral_bin(table, roughness, degrees, place, clipping))
        })
        .collect()
}

/// All figures of a table.
pub fn quality(table: &Table) -> Quality {
    Quality {
        grid: measure_grid(table),
        cells: measure_cells(table, 0.0),
        midpoints: measure_cells(table, 0.5),
        bins: integral_bins(table, Place::NearMirror, Clipping::BeforeAndAfter),
        off_mirror_bins: integral_bins(table, Place::OffMirror, Clipping::BeforeAndAfter),
        spheres: spheres(table),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobe::Lobe;
    use crate::table::Entry;

    #[test]
    fn distance_of_a_lobe_to_another_is_between_0_and_1() {
        // α = 1 at normal incidence is near a cosine; the cosine turned by 60° is not.
        let reflection = Reflection::new(1.0, 1.0);
        let (near, _) = distance(&reflection, &Model::without_tail(Lobe::COSINE));
        let (sin, cos) = 60_f64.to_radians().sin_cos();
        let (far, _) = distance(
            &reflection,
            &Model::without_tail(Lobe::from_array([cos, sin, -sin, cos])),
        );
        assert!(near < 0.1 && far > 0.4 && far < 1.0, "{near} {far}");
    }

    #[test]
    fn random_rectangles_are_rectangles_of_the_stated_sizes() {
        let mut random = Random(1);
        for _ in 0..200 {
            let n_dot_v = random.range(0.05, 1.0);
            let Rectangle { centre, half_edges } = random.rectangle(n_dot_v, Place::NearMirror);
            let [u, v] = half_edges;
            assert!(dot(u, v).abs() < 1e-12);
            for (length, from, to) in [(u, 0.25, 1.5), (v, 0.25, 1.5), (centre, 1.5, 6.0)] {
                let length = dot(length, length).sqrt();
                assert!((from - 1e-12..=to + 1e-12).contains(&length));
            }
            let mirror = [-(1.0 - n_dot_v * n_dot_v).sqrt(), 0.0, n_dot_v];
            assert!(
                dot(centre, mirror)
                    >= MIRROR_CONE_DEGREES.to_radians().cos() * dot(centre, centre).sqrt() - 1e-12
            );
            let centre = random.rectangle(n_dot_v, Place::OffMirror).centre;
            assert!(centre[2] > 0.0);
            assert!(
                dot(centre, mirror)
                    < MIRROR_CONE_DEGREES.to_radians().cos() * dot(centre, centre).sqrt() + 1e-12
            );
        }
    }

    #[test]
    fn integral_bins_see_a_wrong_amplitude() {
        let bin = |scale| {
            let entry = Entry {
                mirror: Lobe::COSINE.to_array(),
                scale,
                bias: 0.0,
                tail_z: 0.0,
                tail_x: 0.0,
            };
            let table = Table::from_entries(2, &[entry; 4]);
            integral_bin(
                &table,
                1.0,
                (0.0, 5.0),
                Place::NearMirror,
                Clipping::BeforeAndAfter,
            )
        };
        // GGX of α = 1 reflects 1 − ln 2 = 0.307 of what the unit cosine does, in a lobe near it.
        let (right, wrong) = (bin(1.0 - 2.0_f64.ln()), bin(1.0));
        assert!(right.mean < 0.25, "{right:?}");
        assert!(wrong.mean > 2.0, "{wrong:?}");
    }
}
