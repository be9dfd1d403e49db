//! White-metal spheres of several roughnesses under one light: the picture that the table's accuracy is told by.
//!
//! As a renderer sees it, without shadows and with F = 1: for points spread over each sphere like pixels, the table's
//! closed form against quadrature. Most of what such a picture shows at grazing angles lies far from the mirror
//! direction, which random lights about that direction do not tell.

use crate::brdf::Reflection;
use crate::polygon::{V3, cross, dot, model_integral, reflected, scaled, sum, unit};
use crate::table::{Entry, Table};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Perceptual roughnesses of the spheres.
pub const SPHERE_ROUGHNESSES: [f64; 7] = [0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0];
/// Their centres, m; y is up.
const CENTRES: [V3; SPHERE_ROUGHNESSES.len()] = [
    [-1.65, 0.5, -0.75],
    [-0.55, 0.5, -0.75],
    [0.55, 0.5, -0.75],
    [1.65, 0.5, -0.75],
    [-1.1, 0.5, 0.65],
    [0.0, 0.5, 0.65],
    [1.1, 0.5, 0.65],
];
const RADIUS: f64 = 0.45;
const CAMERA: V3 = [0.0, 4.6, 4.6];
/// Points along the diameter of a sphere's disk.
const POINTS: usize = 24;
/// Grazing view angles, degrees.
const GRAZING: (f64, f64) = (60.0, 80.0);

/// A flat regular light.
#[derive(Clone, Copy, Debug)]
struct Light {
    name: &'static str,
    position: V3,
    target: V3,
    corners: usize,
    /// m².
    area: f64,
}

/// Lights behind, beside and before the spheres, near and far, large and small.
const LIGHTS: [Light; 6] = [
    Light {
        name: "quad behind",
        position: [0.4, 2.5, -1.3],
        target: [0.0, 0.3, 0.1],
        corners: 4,
        area: 2.4,
    },
    Light {
        name: "triangle behind",
        position: [0.4, 2.5, -1.3],
        target: [0.0, 0.3, 0.1],
        corners: 3,
        area: 2.4,
    },
    Light {
        name: "hexagon above",
        position: [0.2, 3.2, 0.5],
        target: [0.0, 0.5, 0.0],
        corners: 6,
        area: 5.0,
    },
    Light {
        name: "quad beside, low",
        position: [-3.0, 1.0, 1.0],
        target: [0.0, 0.5, 0.0],
        corners: 4,
        area: 1.5,
    },
    Light {
        name: "triangle before",
        position: [1.5, 2.0, 3.0],
        target: [0.0, 0.5, 0.0],
        corners: 3,
        area: 1.0,
    },
    Light {
        name: "hexagon far behind",
        position: [-1.0, 2.5, -5.0],
        target: [0.0, 0.5, 0.0],
        corners: 6,
        area: 4.0,
    },
];

impl Light {
    /// Corners, m.
    fn outline(&self) -> Vec<V3> {
        let axis = unit(sum(self.target, scaled(self.position, -1.0)));
        let right = unit(cross(axis, [0.0, 1.0, 0.0]));
        let up = cross(right, axis);
        let n = self.corners as f64;
        let radius = (2.0 * self.area / (n * (TAU / n).sin())).sqrt();
        (0..self.corners)
            .map(|i| {
                let (sin, cos) = (TAU * (i as f64 + 0.5) / n).sin_cos();
                let offset = sum(scaled(right, radius * cos), scaled(up, radius * sin));
                sum(self.position, offset)
            })
            .collect()
    }
}

/// Sums of squares over some pixels.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSum {
    error2: f64,
    value2: f64,
    error: f64,
    value: f64,
}

impl PixelSum {
    fn add(&mut self, error: f64, value: f64) {
        self.error2 += error * error;
        self.value2 += value * value;
        self.error += error;
        self.value += value;
    }

    /// The pixels of both.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            error2: self.error2 + other.error2,
            value2: self.value2 + other.value2,
            error: self.error + other.error,
            value: self.value + other.value,
        }
    }

    /// Root mean square error over root mean square value; 0 where there is no light.
    pub fn relative_rmse(&self) -> f64 {
        if self.value2 > 0.0 {
            (self.error2 / self.value2).sqrt()
        } else {
            0.0
        }
    }

    /// Σ error / Σ value; 0 where there is no light.
    pub fn bias(&self) -> f64 {
        if self.value > 0.0 {
            self.error / self.value
        } else {
            0.0
        }
    }
}

/// Error over the pixels of one sphere.
#[derive(Clone, Copy, Debug, Default)]
pub struct SphereError {
    /// All pixels.
    pub all: PixelSum,
    /// Those seen at 60° to 80°.
    pub grazing: PixelSum,
}

/// Error over the pixels of the spheres under one light.
#[derive(Clone, Debug)]
pub struct SpheresError {
    /// The light.
    pub light: &'static str,
    /// By roughness, [`SPHERE_ROUGHNESSES`].
    pub spheres: Vec<SphereError>,
}

impl SpheresError {
    /// All spheres together.
    pub fn total(&self) -> SphereError {
        self.spheres
            .iter()
            .fold(SphereError::default(), |sum, s| SphereError {
                all: sum.all.with(s.all),
                grazing: sum.grazing.with(s.grazing),
            })
    }
}

/// The spheres, shaded with what the table holds, under each light.
pub fn spheres(table: &Table) -> Vec<SpheresError> {
    spheres_of(&|roughness, n_dot_v| table.sample(roughness, n_dot_v))
}

/// The spheres, shaded with the entry for a perceptual roughness and an n·v, under each light.
pub fn spheres_of(entry: &(impl Fn(f64, f64) -> Entry + Sync)) -> Vec<SpheresError> {
    LIGHTS
        .iter()
        .map(|light| {
            let outline = light.outline();
            let spheres = SPHERE_ROUGHNESSES
                .par_iter()
                .zip(&CENTRES)
                .map(|(&roughness, &centre)| sphere(entry, roughness, centre, &outline))
                .collect();
            SpheresError {
                light: light.name,
                spheres,
            }
        })
        .collect()
}

fn sphere(
    entry: &impl Fn(f64, f64) -> Entry,
    roughness: f64,
    centre: V3,
    outline: &[V3],
) -> SphereError {
    let to_camera = unit(sum(CAMERA, scaled(centre, -1.0)));
    let right = unit(cross([0.0, 1.0, 0.0], to_camera));
    let up = cross(to_camera, right);
    let mut error = SphereError::default();
    let at = |i: usize| (2.0 * i as f64 + 1.0) / POINTS as f64 - 1.0;
    for (u, v) in (0..POINTS * POINTS).map(|i| (at(i % POINTS), at(i / POINTS))) {
        let depth2 = 1.0 - u * u - v * v;
        if depth2 <= 0.0 {
            continue;
        }
        let normal = sum(
            scaled(to_camera, depth2.sqrt()),
            sum(scaled(right, u), scaled(up, v)),
        );
        let position = sum(centre, scaled(normal, RADIUS));
        let view = unit(sum(CAMERA, scaled(position, -1.0)));
        let n_dot_v = dot(normal, view);
        if n_dot_v <= crate::MIN_N_DOT_V {
            continue;
        }
        // The view in the xz-plane at +x. No point of the grid is seen exactly along its normal.
        let x = unit(sum(view, scaled(normal, -n_dot_v)));
        let y = cross(normal, x);
        let polygon: Vec<V3> = outline
            .iter()
            .map(|&corner| {
                let to = sum(corner, scaled(position, -1.0));
                [dot(to, x), dot(to, y), dot(to, normal)]
            })
            .collect();
        let truth = reflected(&polygon, &Reflection::new(roughness * roughness, n_dot_v));
        let entry = entry(roughness, n_dot_v);
        let value = entry.albedo() * model_integral(&entry.model(n_dot_v), &polygon);
        error.all.add(value - truth, truth);
        let degrees = n_dot_v.acos().to_degrees();
        if (GRAZING.0..GRAZING.1).contains(&degrees) {
            error.grazing.add(value - truth, truth);
        }
    }
    error
}
