//! Integrals over polygonal lights in f64: the closed form with the table, and quadrature with the reflection.

use crate::brdf::Reflection;
use crate::lobe::{Lobe, Model};
use std::f64::consts::TAU;

/// A point or a direction in the shading frame, or along the axes of a scene.
pub type V3 = [f64; 3];

pub(crate) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub(crate) fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
pub(crate) fn scaled(a: V3, s: f64) -> V3 {
    a.map(|x| x * s)
}
pub(crate) fn sum(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
pub(crate) fn unit(a: V3) -> V3 {
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

/// (1/π) ∫ ω dω over a polygon above the horizon; the same for either orientation.
///
/// Lambert's boundary form, (1/2π) Σ θₑ nₑ, with the angle from `atan2`.
pub fn form_factor(polygon: &[V3]) -> V3 {
    let mut total = [0.0; 3];
    for (i, &a) in polygon.iter().enumerate() {
        let (a, b) = (unit(a), unit(polygon[(i + 1) % polygon.len()]));
        let c = cross(a, b);
        let sine = dot(c, c).sqrt();
        if sine > 0.0 {
            total = sum(total, scaled(c, sine.atan2(dot(a, b)) / (sine * TAU)));
        }
    }
    // ∫ z dω is positive above the horizon.
    scaled(total, 1.0_f64.copysign(total[2]))
}

/// ∫ D over the part of a polygon above the surface: clip, transform, clip, form factor. What the renderer does.
pub fn lobe_integral(lobe: &Lobe, polygon: &[V3]) -> f64 {
    let above = clip_to_horizon(polygon);
    let mapped: Vec<V3> = above.iter().map(|&v| lobe.transform(v)).collect();
    form_factor(&clip_to_horizon(&mapped))[2]
}

/// ∫ q over the part of a polygon above the surface, as the renderer shades: never negative.
pub fn model_integral(model: &Model, polygon: &[V3]) -> f64 {
    let [x, _, z] = form_factor(&clip_to_horizon(polygon));
    let lobe = model.lobe_weight() * lobe_integral(&model.lobe, polygon);
    (lobe + model.tail_z * z + model.tail_x * x).max(0.0)
}

/// Halvings of the light's triangles before any estimate is trusted: a narrow lobe must not fall between the nodes.
const FIRST_HALVINGS: u32 = 4;
/// Halvings at most.
const HALVINGS: u32 = 14;
/// A triangle is done when halving it changes its integral by less than this part of the whole.
const TOLERANCE: f64 = 1e-5;

/// Barycentric coordinates and weights of the rule of degree 5 on a triangle (Radon 1948; Strang, Fix 1973, table
/// 4.1): the centroid, then two families of three.
const CENTROID_WEIGHT: f64 = 0.225;
const FAMILIES: [(f64, f64); 2] = [
    (0.059_715_871_789_769_82, 0.132_394_152_788_506_2),
    (0.797_426_985_353_087_3, 0.125_939_180_544_827_15),
];

/// ∫ f cos θ dω over a flat convex polygon, by adaptive quadrature over its area. Relative error about 1e-4, or less.
pub fn reflected(polygon: &[V3], reflection: &Reflection) -> f64 {
    let above = clip_to_horizon(polygon);
    let integrand = |p: V3, area_normal: V3| {
        let distance2 = dot(p, p);
        let l = scaled(p, 1.0 / distance2.sqrt());
        dot(area_normal, l).abs() / distance2 * reflection.cosine_weighted(l)
    };
    let rule = |[a, b, c]: [V3; 3]| {
        // Its length is the triangle's area.
        let normal = scaled(cross(sum(b, scaled(a, -1.0)), sum(c, scaled(a, -1.0))), 0.5);
        let at = |u: f64, v: f64, w: f64| {
            integrand(sum(scaled(a, u), sum(scaled(b, v), scaled(c, w))), normal)
        };
        let third = 1.0 / 3.0;
        let mut total = CENTROID_WEIGHT * at(third, third, third);
        for (u, weight) in FAMILIES {
            let v = 0.5 * (1.0 - u);
            total += weight * (at(u, v, v) + at(v, u, v) + at(v, v, u));
        }
        total
    };
    let mut triangles: Vec<[V3; 3]> = (2..above.len())
        .map(|i| [above[0], above[i - 1], above[i]])
        .collect();
    for _ in 0..FIRST_HALVINGS {
        triangles = triangles.into_iter().flat_map(halved).collect();
    }
    let first: Vec<([V3; 3], f64)> = triangles.into_iter().map(|t| (t, rule(t))).collect();
    let scale: f64 = first.iter().map(|(_, value)| value).sum();
    first
        .into_iter()
        .map(|(triangle, value)| {
            refined(
                &rule,
                triangle,
                value,
                TOLERANCE * scale,
                HALVINGS - FIRST_HALVINGS,
            )
        })
        .sum()
}

/// The four triangles between the corners and the middles of the edges.
fn halved([a, b, c]: [V3; 3]) -> [[V3; 3]; 4] {
    let middle = |a, b| scaled(sum(a, b), 0.5);
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

fn refined(
    rule: &impl Fn([V3; 3]) -> f64,
    triangle: [V3; 3],
    value: f64,
    tolerance: f64,
    halvings: u32,
) -> f64 {
    let parts = halved(triangle).map(|t| (t, rule(t)));
    let better: f64 = parts.iter().map(|(_, value)| value).sum();
    if (better - value).abs() <= tolerance || halvings == 0 {
        return better;
    }
    parts
        .into_iter()
        .map(|(t, value)| refined(rule, t, value, tolerance, halvings - 1))
        .sum()
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn form_factor_of_known_shapes() {
        // A quarter of the hemisphere, bounded by the horizon.
        let quarter = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!((form_factor(&quarter)[2] - 0.25).abs() < 1e-15);
        // By symmetry ∫ ω dω has three equal components.
        assert!(
            form_factor(&quarter)
                .iter()
                .all(|f| (f - 0.25).abs() < 1e-15)
        );
        // Disk of radius r at height h: r²/(r² + h²), here 1/2, from a polygon of many sides.
        let disk: Vec<V3> = (0..4096)
            .map(|i| {
                let (s, c) = (f64::from(i) * TAU / 4096.0).sin_cos();
                [c, s, 1.0]
            })
            .collect();
        assert!((form_factor(&disk)[2] - 0.5).abs() < 1e-6);
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
        let leak = form_factor(&clip_to_horizon(&leaking))[2] - lobe_integral(&lobe, &unclipped);
        assert!(leak > 1e-3, "{leak}");
    }

    #[test]
    fn quadrature_and_lobe_integral_agree_where_both_are_exact() {
        // GGX of α = 1 at normal incidence, over the hemisphere: what the closed forms give.
        let sky = Rectangle {
            centre: [0.0, 0.0, 0.01],
            half_edges: [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
        };
        let albedo = reflected(&sky.corners(), &Reflection::new(1.0, 1.0));
        assert!((albedo - (1.0 - 2.0_f64.ln())).abs() < 3e-3, "{albedo}");
        assert!((lobe_integral(&Lobe::COSINE, &sky.corners()) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn quadrature_finds_narrow_lobes_and_follows_tails() {
        let light = Rectangle {
            centre: [-0.5, 0.2, 2.0],
            half_edges: [[1.0, 0.0, 0.3], [0.0, 0.8, 0.0]],
        };
        // In the light's middle, all but the lobe's tail comes back.
        for alpha in [1e-3, 5e-3, 0.02] {
            let narrow = Reflection::new(alpha, 0.25_f64.atan().cos());
            let value = reflected(&light.corners(), &narrow);
            assert!((value - 1.0).abs() < 0.05, "{alpha}: {value}");
        }
        // Against a uniform grid, where the lobe is wide or far away.
        for (alpha, n_dot_v) in [(1.0, 1.0), (0.3, 0.3), (0.06, 0.3)] {
            let reflection = Reflection::new(alpha, n_dot_v);
            let value = reflected(&light.corners(), &reflection);
            const GRID: i32 = 400;
            let [u, v] = light.half_edges;
            let area_normal = scaled(cross(u, v), 4.0 / f64::from(GRID * GRID));
            let mut total = 0.0;
            for i in 0..GRID {
                for j in 0..GRID {
                    let at = |i: i32| (2.0 * f64::from(i) + 1.0) / f64::from(GRID) - 1.0;
                    let p = sum(light.centre, sum(scaled(u, at(i)), scaled(v, at(j))));
                    let distance2 = dot(p, p);
                    let l = scaled(p, 1.0 / distance2.sqrt());
                    total += dot(area_normal, l).abs() / distance2 * reflection.cosine_weighted(l);
                }
            }
            assert!(
                (value - total).abs() < 2e-4 * total,
                "{alpha} {n_dot_v}: {value} {total}"
            );
        }
    }

    #[test]
    fn a_model_over_almost_everything_is_1_and_never_below_0() {
        let wide = [
            [-1e9, -1e9, 1.0],
            [1e9, -1e9, 1.0],
            [1e9, 1e9, 1.0],
            [-1e9, 1e9, 1.0],
        ];
        let model = Model {
            lobe: Lobe::from_array([0.5, 0.4, -0.3, 0.6]),
            tail_z: 0.2,
            tail_x: 0.1,
        };
        assert!((model_integral(&model, &wide) - 1.0).abs() < 1e-8);
        // The tail is negative at the horizon away from the view, where a narrow lobe is nothing.
        let narrow = Model {
            lobe: Lobe::from_array([1.0, 0.0, 0.0, 0.01]),
            ..model
        };
        let far = [[-1.0, -0.1, 0.1], [-1.0, 0.1, 0.1], [-1.0, 0.0, 0.2]];
        let unclamped = narrow.density(unit([-1.0, 0.0, 0.13]));
        assert!(unclamped < 0.0);
        assert_eq!(model_integral(&narrow, &far), 0.0);
    }
}
