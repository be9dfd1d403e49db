//! What holds for every polygon, lobe and frame.

use crate::harness::Random;
use akari_math::frame::shading_frame;
use akari_math::ltc::lookup::{ltc_m, ltc_m_inv};
use akari_math::ltc::polygon::{form_factor, ltc_form_factor};
use akari_math::polygon::clip_polygon;
use akari_math::sg::lobe::{sg_integral, sg_product_integral_unit, sg_product_unit};
use akari_math::{ggx, special};
use glam::{Mat3, Quat, Vec3, Vec4};
use proptest::prelude::*;

fn direction() -> impl Strategy<Value = Vec3> {
    (-1.0_f32..1.0, 0.0_f32..std::f32::consts::TAU).prop_map(|(z, angle)| {
        let radius = (1.0 - z * z).sqrt();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    })
}

/// A planar, convex quad about a point 0.3 to 3 away.
fn quad() -> impl Strategy<Value = [Vec3; 4]> {
    (
        direction(),
        0.3_f32..3.0,
        direction(),
        0.05_f32..2.0,
        0.05_f32..2.0,
    )
        .prop_map(|(center, distance, normal, a, b)| {
            let frame = shading_frame(normal, Vec3::new(0.3, 0.5, -0.8));
            let (u, v) = (frame.x_axis * a, frame.y_axis * b);
            let c = center * distance;
            [c - u - v, c + u - v, c + u + v, c - u + v]
        })
}

fn m_inv() -> impl Strategy<Value = Mat3> {
    (0.5_f32..1.5, -0.3_f32..0.3, -0.3_f32..0.3, 0.4_f32..1.4)
        .prop_map(|(m00, m02, m20, m22)| ltc_m_inv(Vec4::new(m00, m02, m20, m22), 1.0))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, rng_seed: proptest::test_runner::RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_split_adds_up(quad in quad(), m_inv in m_inv(), s in 0.1_f32..0.9, t in 0.1_f32..0.9) {
        let [a, b, c, d] = quad;
        let (p, q) = (a.lerp(b, s), d.lerp(c, t));
        for m in [Mat3::IDENTITY, m_inv] {
            let whole = ltc_form_factor(&quad, m);
            let parts = ltc_form_factor(&[a, p, q, d], m) + ltc_form_factor(&[p, b, c, q], m);
            prop_assert!((whole - parts).abs().max_element() < 3e-6, "{whole} {parts}");
        }
    }

    #[test]
    fn the_other_orientation_has_the_other_sign(quad in quad(), m_inv in m_inv()) {
        let mut flipped = quad;
        flipped.reverse();
        prop_assert!((form_factor(&quad) + form_factor(&flipped)).abs().max_element() < 1e-6);
        prop_assert!((ltc_form_factor(&quad, m_inv) + ltc_form_factor(&flipped, m_inv)).abs().max_element() < 1e-6);
    }

    #[test]
    fn any_vertex_may_be_the_first(quad in quad(), m_inv in m_inv()) {
        let [a, b, c, d] = quad;
        prop_assert!((ltc_form_factor(&quad, m_inv) - ltc_form_factor(&[c, d, a, b], m_inv)).abs().max_element() < 1e-6);
    }

    #[test]
    fn a_turn_about_the_normal_changes_nothing(quad in quad(), angle in 0.0_f32..std::f32::consts::TAU) {
        let turn = Quat::from_rotation_z(angle);
        let turned = quad.map(|v| turn * v);
        prop_assert!((form_factor(&quad).z - form_factor(&turned).z).abs() < 2e-6);
    }

    #[test]
    fn the_scale_changes_nothing(quad in quad(), m_inv in m_inv(), scale in -7.0_f32..7.0) {
        let scale = 10.0_f32.powf(scale);
        let scaled = quad.map(|v| v * scale);
        prop_assert!((ltc_form_factor(&quad, m_inv) - ltc_form_factor(&scaled, m_inv)).abs().max_element() < 2e-6);
    }

    #[test]
    fn the_streaming_clip_is_the_clip(quad in quad()) {
        // Lifted off the plane by what clip_polygon leaves of it.
        let clipped = clip_polygon(&quad, Vec4::new(0.0, 0.0, 1.0, 0.0));
        prop_assert!(clipped.iter().all(|v| v.z >= -1e-6));
        prop_assert!((form_factor(&quad) - form_factor(&clipped)).abs().max_element() < 2e-6);
    }

    #[test]
    fn integrals_are_fractions(quad in quad(), m_inv in m_inv()) {
        for value in [form_factor(&quad).z, ltc_form_factor(&quad, m_inv).z] {
            prop_assert!(value.abs() <= 1.0 + 1e-6);
        }
    }

    #[test]
    fn a_transform_and_its_inverse(m_inv in m_inv(), v in direction()) {
        let m = ltc_m(Vec4::new(m_inv.x_axis.x, m_inv.z_axis.x, m_inv.x_axis.z, m_inv.z_axis.z), 1.0);
        prop_assert!((m * (m_inv * v)).normalize().distance(v) < 1e-5);
    }

    #[test]
    fn frames_are_rotations(normal in direction(), view in direction(), angle in -8.0_f32..0.0, scale in 0.5_f32..2.0) {
        // Views from anywhere, and close to either pole.
        let close = (normal + view * 10.0_f32.powf(angle)).normalize();
        for view in [view, close, -close, normal, -normal, Vec3::ZERO] {
            let frame = shading_frame(normal * scale, view * scale);
            let error = frame.transpose() * frame - Mat3::IDENTITY;
            prop_assert!(error.to_cols_array().iter().all(|e| e.abs() < 1e-6), "{frame}");
            prop_assert!((frame.determinant() - 1.0).abs() < 1e-6);
            prop_assert!((frame.z_axis - normal).length() < 1e-6);
            // The view has no part along the bitangent, and none against the tangent.
            prop_assert!(frame.y_axis.dot(view).abs() < 2e-6 && frame.x_axis.dot(view) > -2e-6);
        }
    }

    #[test]
    fn products_of_lobes_are_symmetric(a in direction(), b in direction(), la in -3.0_f32..6.0, lb in -3.0_f32..6.0, w in direction()) {
        let (la, lb) = (10.0_f32.powf(la), 10.0_f32.powf(lb));
        let (ab, ba) = (sg_product_integral_unit(a, la, b, lb), sg_product_integral_unit(b, lb, a, la));
        prop_assert!((ab - ba).abs() <= 1e-6 * ab.max(ba));
        prop_assert!(ab <= sg_integral(la.max(lb)) * (1.0 + 1e-6));
        // The product is the product: at any direction, in the logarithm, relative to the sharpness.
        let p = sg_product_unit(a, la, b, lb);
        let apart = -0.5 * (la * (w - a).length_squared() + lb * (w - b).length_squared());
        let together = p.log_amplitude - 0.5 * p.sharpness * (w - p.axis).length_squared();
        prop_assert!((apart - together).abs() <= 4e-6 * (1.0 + la + lb), "{apart} {together}");
    }

    #[test]
    fn masking_is_a_fraction(v in 0.0_f32..1.0, l in 0.0_f32..1.0, alpha in 0.0_f32..1.0) {
        let g2 = ggx::smith_masking_shadowing(v, l, alpha);
        prop_assert!((0.0..=1.0 + 1e-6).contains(&g2));
        prop_assert!(g2 <= ggx::smith_masking(v, alpha) + 1e-6);
        prop_assert!((g2 - ggx::smith_masking_shadowing(l, v, alpha)).abs() < 1e-6);
    }
}

/// A light that rises through the horizon in steps of 1e-6 brightens without a jump.
#[test]
fn no_jump_at_the_horizon() {
    let m_inv = ltc_m_inv(Vec4::new(0.9, -0.5, 0.25, 0.45), 1.0);
    let mut random = Random::new(90);
    for _ in 0..20 {
        let center = Vec3::new(random.range(-1.0, 1.0), random.range(0.3, 1.0), 0.0);
        let normal = random.direction();
        let u = random.around(normal, std::f32::consts::FRAC_PI_2);
        let v = normal.cross(u);
        let polygon = [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)]
            .map(|(s, t)| center + s * u + t * v);
        // Sweeps over each vertex in turn.
        for pivot in polygon {
            let mut previous: Option<[f32; 2]> = None;
            for step in -100..=100 {
                let lift = Vec3::new(0.0, 0.0, step as f32 * 1e-6 - pivot.z);
                let moved = polygon.map(|p| p + lift);
                let value = [form_factor(&moved).z, ltc_form_factor(&moved, m_inv).z];
                if let Some(previous) = previous {
                    for (a, b) in value.iter().zip(previous) {
                        assert!((a - b).abs() < 1e-5, "jump of {:e} at {lift}", a - b);
                    }
                }
                previous = Some(value);
            }
        }
    }
}

/// The special functions hold together at their switches and ends.
#[test]
fn special_functions_are_monotonic() {
    let mut previous = f32::INFINITY;
    for i in 0..20_000 {
        let value = special::one_minus_exp_neg_over_x(i as f32 * 1e-3);
        assert!(value <= previous * (1.0 + 3e-7), "at {i}");
        previous = value;
    }
    assert_eq!(special::one_minus_exp_neg_over_x(0.0), 1.0);
    assert_eq!(special::atan2_poly(0.0, 0.0), 0.0);
    assert_eq!(special::erf_poly(20.0), 1.0);
    assert_eq!(special::erfc_poly(-20.0), 2.0);
}
