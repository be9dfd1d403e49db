//! Direct light without Monte Carlo, in `f64`: what the path tracer, and other renderers, are tested against.
//!
//! Written apart from the path tracer's own BRDF, from the textbook forms, so that a mistake in one shows.

use glam::DVec3;

/// Irradiance in units of the radiance, at `point` with unit normal `normal`, from a polygon of uniform radiance.
///
/// Lambert's formula (Lambert 1760; Arvo 1995, equation 2.3) `E/L = ½ Σ θᵢ n·Γᵢ` over the edges of the polygon
/// clipped to the horizon. `polygon` may be concave; it emits to the side from which it is seen counter-clockwise;
/// the result is negative at points on its other side. Domain: points not on the polygon itself. Error: rounding,
/// about 1e-15 × number of vertices.
pub fn polygon_irradiance(polygon: &[DVec3], point: DVec3, normal: DVec3) -> f64 {
    let clipped = clip_to_horizon(polygon, point, normal);
    let mut sum = 0.0;
    for i in 0..clipped.len() {
        let (a, b) = (clipped[i], clipped[(i + 1) % clipped.len()]);
        let cross = a.cross(b);
        let s = cross.length();
        if s > 0.0 {
            sum += s.atan2(a.dot(b)) * cross.dot(normal) / s;
        }
    }
    -0.5 * sum
}

/// The part of the polygon above the tangent plane, relative to `point` (Sutherland and Hodgman 1974). A concave
/// polygon may fall into pieces joined by doubled edges on the horizon, which cancel in every integral.
fn clip_to_horizon(polygon: &[DVec3], point: DVec3, normal: DVec3) -> Vec<DVec3> {
    let mut out = Vec::with_capacity(polygon.len() + 2);
    for i in 0..polygon.len() {
        let (a, b) = (polygon[i] - point, polygon[(i + 1) % polygon.len()] - point);
        let (ha, hb) = (a.dot(normal), b.dot(normal));
        if ha >= 0.0 {
            out.push(a);
        }
        if (ha > 0.0 && hb < 0.0) || (ha < 0.0 && hb > 0.0) {
            out.push(a + (b - a) * (ha / (ha - hb)));
        }
    }
    out
}

/// GGX BRDF without Fresnel (a white mirror's): `D V` with height-correlated Smith (glTF 2.0 appendix B.3), 1/sr.
/// Unit directions `v`, `l` in the shading frame; 0 below the horizon.
pub fn ggx_brdf(v: DVec3, l: DVec3, alpha: f64) -> f64 {
    if v.z <= 0.0 || l.z <= 0.0 {
        return 0.0;
    }
    let h = (v + l).normalize();
    let a2 = alpha * alpha;
    let tan2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
    let d = a2 / (std::f64::consts::PI * h.z.powi(4) * (a2 + tan2).powi(2));
    let lambda = |w: DVec3| {
        let t2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        0.5 * ((1.0 + a2 * t2).sqrt() - 1.0)
    };
    let g2 = 1.0 / (1.0 + lambda(v) + lambda(l));
    d * g2 / (4.0 * v.z * l.z)
}

/// Directional albedo of [`ggx_brdf`] at view cosine `cos`: `∫ D V (n·l) dl`, at most 1.
///
/// Midpoint rule with `n` × `n` cells over half-vectors distributed as `D (n·h)`; error about 1/n.
pub fn ggx_albedo(cos: f64, alpha: f64, n: u32) -> f64 {
    let v = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..n {
        let xi = (f64::from(i) + 0.5) / f64::from(n);
        let tan2 = alpha * alpha * xi / (1.0 - xi);
        let hz = 1.0 / (1.0 + tan2).sqrt();
        let r = (1.0 - hz * hz).max(0.0).sqrt();
        for j in 0..n {
            // Half a turn: the integrand is even in the azimuth.
            let phi = std::f64::consts::PI * (f64::from(j) + 0.5) / f64::from(n);
            let h = DVec3::new(r * phi.cos(), r * phi.sin(), hz);
            let vh = v.dot(h);
            let l = 2.0 * vh * h - v;
            if vh <= 0.0 || l.z <= 0.0 {
                continue;
            }
            // f cos dl = f cos · 4 vh dh, and dh has density D cos_h: D cancels out of f.
            let d = {
                let a2 = alpha * alpha;
                a2 / (std::f64::consts::PI * hz.powi(4) * (a2 + tan2).powi(2))
            };
            sum += ggx_brdf(v, l, alpha) * l.z * 4.0 * vh / (d * hz);
        }
    }
    sum / f64::from(n * n)
}

/// Radiance that a white GGX mirror (no Fresnel) at `point` reflects towards `view`, in units of the radiance of a
/// uniform, one-sided `polygon` (see [`polygon_irradiance`] for its side): `∫ D V (n·l) cosθ'/d² dA`.
///
/// Adaptive quadrature over the polygon's area until halving a triangle changes nothing above `tolerance` of the
/// whole; `normal` and `view` are unit vectors. Domain: points not on the polygon; α ≥ 1e-3.
pub fn polygon_ggx_radiance(
    polygon: &[DVec3],
    point: DVec3,
    normal: DVec3,
    view: DVec3,
    alpha: f64,
    tolerance: f64,
) -> f64 {
    let clipped = clip_to_horizon(polygon, point, normal);
    if clipped.len() < 3 {
        return 0.0;
    }
    let (x, y) = normal.any_orthonormal_pair();
    let local = |d: DVec3| DVec3::new(d.dot(x), d.dot(y), d.dot(normal));
    let v = local(view);
    let plane = clipped[1..]
        .windows(2)
        .map(|w| (w[0] - clipped[0]).cross(w[1] - clipped[0]))
        .sum::<DVec3>()
        .normalize_or_zero();
    if plane.dot(-clipped[0]) <= 0.0 {
        return 0.0;
    }
    let integrand = |p: DVec3| {
        let d2 = p.length_squared();
        let l = p / d2.sqrt();
        ggx_brdf(v, local(l), alpha) * l.dot(normal) * -l.dot(plane) / d2
    };
    // A fan with signed areas: what lies outside of a concave polygon cancels.
    let fan: Vec<([DVec3; 3], f64)> = clipped[1..]
        .windows(2)
        .map(|w| {
            let t = [clipped[0], w[0], w[1]];
            let sign = (t[1] - t[0]).cross(t[2] - t[0]).dot(plane).signum();
            (t, sign)
        })
        .collect();
    // A first even subdivision finds the lobe and gives the scale of the tolerance.
    let mut pieces: Vec<([DVec3; 3], f64)> = fan;
    for _ in 0..START_LEVELS {
        pieces = pieces
            .into_iter()
            .flat_map(|(t, s)| quarters(t).map(|q| (q, s)))
            .collect();
    }
    let scale: f64 = pieces
        .iter()
        .map(|(t, s)| s * rule(&integrand, t))
        .sum::<f64>()
        .abs();
    let allowed = tolerance * scale / pieces.len() as f64;
    pieces
        .iter()
        .map(|(t, s)| s * adapt(&integrand, t, rule(&integrand, t), allowed, MAX_LEVELS))
        .sum()
}

/// Even halvings before adaptation: 4⁴ triangles of each of the fan.
const START_LEVELS: u32 = 4;
/// Most halvings after that.
const MAX_LEVELS: u32 = 12;

fn quarters([a, b, c]: [DVec3; 3]) -> [[DVec3; 3]; 4] {
    let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

/// Seven-point rule of degree 5 on a triangle (Radon 1948).
fn rule(f: &impl Fn(DVec3) -> f64, &[a, b, c]: &[DVec3; 3]) -> f64 {
    let area = 0.5 * (b - a).cross(c - a).length();
    let root = 15.0_f64.sqrt();
    let mut sum = 9.0 / 40.0 * f((a + b + c) / 3.0);
    for (beta, weight) in [
        ((6.0 - root) / 21.0, (155.0 - root) / 1200.0),
        ((6.0 + root) / 21.0, (155.0 + root) / 1200.0),
    ] {
        let s = beta * (a + b + c);
        let rest = 1.0 - 3.0 * beta;
        sum += weight * (f(s + rest * a) + f(s + rest * b) + f(s + rest * c));
    }
    area * sum
}

fn adapt(
    f: &impl Fn(DVec3) -> f64,
    triangle: &[DVec3; 3],
    whole: f64,
    allowed: f64,
    levels: u32,
) -> f64 {
    let parts = quarters(*triangle);
    let values = parts.map(|p| rule(f, &p));
    let sum: f64 = values.iter().sum();
    if levels == 0 || (sum - whole).abs() <= allowed {
        return sum;
    }
    parts
        .iter()
        .zip(values)
        .map(|(p, v)| adapt(f, p, v, 0.5 * allowed, levels - 1))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A square of half-width `s` at height `h`, emitting downwards.
    fn ceiling(s: f64, h: f64) -> Vec<DVec3> {
        [(-s, -s), (-s, s), (s, s), (s, -s)]
            .map(|(x, y)| DVec3::new(x, y, h))
            .to_vec()
    }

    #[test]
    fn closed_forms() {
        // Configuration factor of a parallel rectangle over its corner (Howell, C-11), four times.
        let (s, h) = (0.7_f64, 1.3_f64);
        let r = s / h;
        let q = (1.0 + r * r).sqrt();
        let corner = 1.0 / (2.0 * PI) * 2.0 * r / q * (r / q).atan();
        let expected = 4.0 * corner * PI;
        let e = polygon_irradiance(&ceiling(s, h), DVec3::ZERO, DVec3::Z);
        assert!((e - expected).abs() < 1e-12, "{e} {expected}");
        // A sky-filling ceiling, and its back.
        let sky = polygon_irradiance(&ceiling(1e6, 1.0), DVec3::ZERO, DVec3::Z);
        assert!((sky - PI).abs() < 1e-5);
        let back = polygon_irradiance(&ceiling(s, -h), DVec3::ZERO, DVec3::NEG_Z);
        assert!((back + expected).abs() < 1e-12);
        // Half of a wall that the horizon cuts in its middle equals the upper half alone.
        let wall = |low: f64| {
            [(-1.0, low), (-1.0, 1.0), (1.0, 1.0), (1.0, low)]
                .map(|(x, z)| DVec3::new(x, 1.5, z))
                .to_vec()
        };
        let cut = polygon_irradiance(&wall(-1.0), DVec3::ZERO, DVec3::Z);
        let upper = polygon_irradiance(&wall(0.0), DVec3::ZERO, DVec3::Z);
        assert!((cut - upper).abs() < 1e-14 && cut.abs() > 0.1);
    }

    #[test]
    fn albedo_of_a_smooth_and_a_rough_mirror() {
        assert!((ggx_albedo(0.8, 1e-3, 200) - 1.0).abs() < 1e-3);
        let rough = ggx_albedo(0.8, 1.0, 400);
        // Single scattering loses most light of a very rough mirror (Kulla and Conty 2017, figure 4).
        assert!(rough < 0.5 && rough > 0.3, "{rough}");
        assert!((rough - ggx_albedo(0.8, 1.0, 800)).abs() < 1e-3);
    }

    #[test]
    fn a_sky_of_light_gives_the_albedo() {
        // A ceiling that fills the hemisphere reflects with the directional albedo: two independent quadratures.
        for (alpha, cos) in [(0.25, 0.9), (0.5, 0.6)] {
            let view = DVec3::new((1.0_f64 - cos * cos).sqrt(), 0.0, cos);
            let radiance = polygon_ggx_radiance(
                &ceiling(300.0, 1.0),
                DVec3::ZERO,
                DVec3::Z,
                view,
                alpha,
                1e-5,
            );
            let albedo = ggx_albedo(cos, alpha, 1000);
            assert!(
                (radiance / albedo - 1.0).abs() < 5e-3,
                "{radiance} {albedo}"
            );
        }
        let other_side = polygon_ggx_radiance(
            &ceiling(1.0, -1.0),
            DVec3::ZERO,
            DVec3::Z,
            DVec3::Z,
            0.5,
            1e-3,
        );
        assert_eq!(other_side, 0.0);
    }
}
