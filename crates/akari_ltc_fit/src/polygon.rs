//! Integrals over polygonal lights in f64: the closed form with the table, and quadrature with the reflection.

use crate::brdf::Reflection;
use crate::lobe::Lobe;
use crate::quadrature::{composite, gauss_legendre};

type V3 = [f64; 3];

fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
fn scaled(a: V3, s: f64) -> V3 {
    a.map(|x| x * s)
}
fn sum(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
fn unit(a: V3) -> V3 {
    scaled(a, 1.0 / dot(a, a).sqrt())
}

/// The part of a polygon with z ≥ 0 (Sutherland, Hodgman 1974).
pub fn clip_to_horizon(polygon: &[V3]) -> Vec<V3> {
    let mut out = Vec::with_capacity(polygon.len() + 2);
    for (i, &b) in polygon.iter().enumerate() {
        let a = polygon[(i + polygon.len() - 1) % polygon.len()];
        if (a[2] >= 0.0) != (b[2] >= 0.0) {
            let t = a[2] / (a[2] - b[2]);
            let mut crossing = sum(scaled(a, 1.0 - t), scaled(b, t));
            crossing[2] = 0.0;
            out.push(crossing);
        }
        if b[2] >= 0.0 {
            out.push(b);
        }
    }
    out
}

/// ∫ max(z, 0)/π over the solid angle of a polygon above the horizon; positive for either orientation.
///
/// Lambert's boundary form, (1/2π) Σ θₑ nₑ·z, with the angle from `atan2`.
pub fn form_factor(polygon: &[V3]) -> f64 {
    let mut total = 0.0;
    for (i, &a) in polygon.iter().enumerate() {
        let (a, b) = (unit(a), unit(polygon[(i + 1) % polygon.len()]));
        let c = cross(a, b);
        let sine = dot(c, c).sqrt();
        if sine > 0.0 {
            total += c[2] * sine.atan2(dot(a, b)) / sine;
        }
    }
    (total / std::f64::consts::TAU).abs()
}

/// ∫ D over the part of a polygon above the surface: clip, transform, clip, form factor. What the renderer does.
pub fn lobe_integral(lobe: &Lobe, polygon: &[V3]) -> f64 {
    let above = clip_to_horizon(polygon);
    let mapped: Vec<V3> = above.iter().map(|&v| lobe.transform(v)).collect();
    form_factor(&clip_to_horizon(&mapped))
}

/// A rectangular light seen from the shading point at the origin.
#[derive(Clone, Copy, Debug)]
pub struct Rectangle {
    /// Centre, m.
    pub centre: V3,
    /// Half edges, m, perpendicular to each other.
    pub half_edges: [V3; 2],
}

impl Rectangle {
    /// The four corners in order.
    pub fn corners(&self) -> [V3; 4] {
        let [u, v] = self.half_edges;
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(a, b)| sum(self.centre, sum(scaled(u, a), scaled(v, b))))
    }

    /// ∫ f cos θ dω over the rectangle, by quadrature over its area with `panels`² panels of 8² Gauss nodes.
    pub fn reflected(&self, reflection: &Reflection, panels: usize) -> f64 {
        let breaks: Vec<f64> = (0..=panels)
            .map(|i| 2.0 * i as f64 / panels as f64 - 1.0)
            .collect();
        let nodes = composite(&breaks, &gauss_legendre(8));
        let [u, v] = self.half_edges;
        // Its length is the area per unit of parameter area.
        let area_normal = cross(u, v);
        let mut total = 0.0;
        for &(a, weight_a) in &nodes {
            for &(b, weight_b) in &nodes {
                let p = sum(self.centre, sum(scaled(u, a), scaled(v, b)));
                if p[2] <= 0.0 {
                    continue;
                }
                let distance2 = dot(p, p);
                let l = scaled(p, 1.0 / distance2.sqrt());
                total += weight_a * weight_b * dot(area_normal, l).abs() / distance2
                    * reflection.cosine_weighted(l);
            }
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn form_factor_of_known_shapes() {
        // A quarter of the hemisphere, bounded by the horizon.
        let quarter = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!((form_factor(&quarter) - 0.25).abs() < 1e-15);
        // Disk of radius r at height h: r²/(r² + h²), here 1/2, from a polygon of many sides.
        let disk: Vec<V3> = (0..4096)
            .map(|i| {
                let (s, c) = (f64::from(i) * std::f64::consts::TAU / 4096.0).sin_cos();
                [c, s, 1.0]
            })
            .collect();
        assert!((form_factor(&disk) - 0.5).abs() < 1e-6);
    }

    #[test]
    fn lobe_integral_over_almost_everything_is_the_norm() {
        let lobe = Lobe::from_array([0.5, 0.4, -0.3, 0.6]);
        let wide = [
            [-1e9, -1e9, 1.0],
            [1e9, -1e9, 1.0],
            [1e9, 1e9, 1.0],
            [-1e9, 1e9, 1.0],
        ];
        assert!((lobe_integral(&lobe, &wide) - lobe.norm()).abs() < 1e-8);
        // Without the first clip, light from below the surface would be counted.
        let unclipped = [
            [-1e9, -1e9, -5e8],
            [1e9, -1e9, -5e8],
            [1e9, 1e9, 1.0],
            [-1e9, 1e9, 1.0],
        ];
        let leaking: Vec<V3> = unclipped.iter().map(|&v| lobe.transform(v)).collect();
        let leak = form_factor(&clip_to_horizon(&leaking)) - lobe_integral(&lobe, &unclipped);
        assert!(leak > 1e-3, "{leak}");
    }

    #[test]
    fn rectangle_quadrature_has_converged() {
        let rectangle = Rectangle {
            centre: [-0.5, 0.2, 2.0],
            half_edges: [[1.0, 0.0, 0.3], [0.0, 0.8, 0.0]],
        };
        let rough = Reflection::new(1.0, 1.0);
        let (coarse, fine) = (
            rectangle.reflected(&rough, 4),
            rectangle.reflected(&rough, 12),
        );
        assert!((coarse - fine).abs() < 1e-9 * fine, "{coarse} {fine}");
        // A narrow lobe at the rectangle needs panels of its size.
        let narrow = Reflection::new(0.02, (0.25_f64).atan().cos());
        let (one, many) = (
            rectangle.reflected(&narrow, 1),
            rectangle.reflected(&narrow, 48),
        );
        assert!(
            (one - many).abs() > 1e-2 && (many - 1.0).abs() < 0.05,
            "{one} {many}"
        );
    }

    #[test]
    fn rectangle_quadrature_and_lobe_integral_agree_where_both_are_exact() {
        // GGX of α = 1 at normal incidence, over the hemisphere: what the closed forms give.
        let sky = Rectangle {
            centre: [0.0, 0.0, 0.01],
            half_edges: [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
        };
        let albedo = sky.reflected(&Reflection::new(1.0, 1.0), 400);
        assert!((albedo - (1.0 - 2.0_f64.ln())).abs() < 3e-3, "{albedo}");
        assert!((lobe_integral(&Lobe::COSINE, &sky.corners()) - 1.0).abs() < 1e-4);
    }
}
