//! Rows of `ltc::lookup`, and what its functions promise of the shipped table.

use crate::harness::{Case, Mutation, Random, absolute, domain, dvec3, rows, ulp_of, vec3};
use akari_math::ltc::{lookup, table};
use glam::{DMat3, DVec3, Mat3, Vec2, Vec4};

const LOOKUP: &str = "akari_math::ltc::lookup";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: LOOKUP,
        from,
        to,
    }
}

/// B for roughnesses down to the table's smallest: the lobe's widths shrink, its frame stays.
fn push_texel(random: &mut Random, width: f32, row: &mut Vec<f32>) {
    row.extend([
        random.range(0.5, 1.6),
        random.range(-0.3, 0.3),
        random.range(-0.3, 0.3) * width,
        random.range(0.3, 1.6) * width,
    ]);
}

fn transform_rows(seed: u64, width: f32) -> Vec<f32> {
    rows(seed, 400, |random, row| {
        row.extend([random.range(-0.1, 1.1), random.range(0.0, 1.0)]);
        push_texel(random, width, row);
    })
}

/// Texel, n·v, specular integral, diffuse vector, tail.
fn integral_rows(seed: u64) -> Vec<f32> {
    rows(seed, 500, |random, row| {
        push_texel(random, 1.0, row);
        row.extend([random.range(0.0, 1.0), random.range(0.0, 1.0)]);
        row.extend((random.direction() * random.range(0.0, 1.0)).to_array());
        let tail_z = random.range(0.0, 0.75);
        row.extend([tail_z, random.range(-1.0, 1.0) * tail_z]);
    })
}

/// The mirror frame's X and Z as columns, y apart.
fn mirror_frame(n_dot_v: f64) -> DMat3 {
    let c = n_dot_v.clamp(0.0, 1.0);
    let s = (1.0 - c * c).sqrt();
    DMat3::from_cols(DVec3::new(c, 0.0, s), DVec3::Y, DVec3::new(-s, 0.0, c))
}

fn m_inv_f64(texel: &[f64], n_dot_v: f64) -> DMat3 {
    let b = DMat3::from_cols_array(&[
        texel[0], 0.0, texel[2], 0.0, 1.0, 0.0, texel[1], 0.0, texel[3],
    ]);
    b * mirror_frame(n_dot_v).transpose()
}

fn lobe_weight_f64(m_inv: DMat3, tail_z: f64) -> f64 {
    let (m00, m20) = (m_inv.x_axis.x, m_inv.x_axis.z);
    2.0 * (1.0 - tail_z) / (1.0 + m00 / m00.hypot(m20))
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: LOOKUP,
            functions: &["ltc_uv", "ltc_m_inv", "ltc_m"],
            imports: "",
            body: "y_vec2(0u, ltc_uv(x(0u), x(1u)));
                y_mat3(2u, ltc_m_inv(x_vec4(2u), x(1u)));
                y_mat3(11u, ltc_m(x_vec4(2u), x(1u)));",
            inputs: 6,
            outputs: 20,
            twin: |x, y| {
                y.extend(lookup::ltc_uv(x[0], x[1]).to_array());
                let texel = Vec4::from_slice(&x[2..]);
                y.extend(lookup::ltc_m_inv(texel, x[1]).to_cols_array());
                y.extend(lookup::ltc_m(texel, x[1]).to_cols_array());
            },
            oracle: Some(|x, y| {
                let parameters = [x[0].clamp(0.0, 1.0), (1.0 - x[1].clamp(0.0, 1.0)).sqrt()];
                y.extend(parameters.map(|p| (p * 63.0 + 0.5) / 64.0));
                let m_inv = m_inv_f64(&x[2..], x[1]);
                y.extend(m_inv.to_cols_array());
                y.extend((m_inv.inverse() * m_inv.determinant()).to_cols_array());
            }),
            domains: vec![
                domain(
                    "rough",
                    transform_rows(78, 1.0),
                    absolute(4e-7),
                    ulp_of(4, 1.0),
                ),
                domain(
                    "smooth",
                    transform_rows(83, 2e-3),
                    absolute(4e-7),
                    ulp_of(4, 1.0),
                ),
            ],
            mutations: vec![
                mutation("0.5 / LTC_TABLE_SIZE", "0.49 / LTC_TABLE_SIZE"),
                mutation("texel.x * c - texel.y * s", "texel.x * c + texel.y * s"),
                mutation("texel.z * s + texel.w * c", "texel.w * c"),
                mutation("(1.0 - c) * (1.0 + c)", "(1.0 - c) * (1.001 + c)"),
                mutation(
                    "texel.x * texel.w - texel.y * texel.z",
                    "texel.x * texel.w + texel.y * texel.z",
                ),
            ],
        },
        Case {
            module: LOOKUP,
            functions: &["ltc_specular_integral", "ltc_lobe_weight"],
            imports: "#import akari_math::ltc::lookup::ltc_m_inv",
            body: "let m_inv = ltc_m_inv(x_vec4(0u), x(4u));
                y(0u, ltc_specular_integral(x(5u), x_vec3(6u), m_inv, vec2<f32>(x(9u), x(10u))));
                y(1u, ltc_lobe_weight(m_inv, x(9u)));",
            inputs: 11,
            outputs: 2,
            twin: |x, y| {
                let m_inv = lookup::ltc_m_inv(Vec4::from_slice(x), x[4]);
                y.push(lookup::ltc_specular_integral(
                    x[5],
                    vec3(x, 6),
                    m_inv,
                    Vec2::new(x[9], x[10]),
                ));
                y.push(lookup::ltc_lobe_weight(m_inv, x[9]));
            },
            oracle: Some(|x, y| {
                let weight = lobe_weight_f64(m_inv_f64(x, x[4]), x[9]);
                let diffuse = dvec3(x, 6);
                y.push((weight * x[5] + x[9] * diffuse.z + x[10] * diffuse.x).max(0.0));
                y.push(weight);
            }),
            domains: vec![domain(
                "table",
                integral_rows(84),
                absolute(2e-6),
                ulp_of(16, 1.0),
            )],
            mutations: vec![
                mutation("tail.y * diffuse.x", "tail.y * diffuse.y"),
                mutation("tail.x * diffuse.z + ", ""),
                mutation("+ tail.y * diffuse.x, 0.0)", "+ tail.y * diffuse.x, -1.0)"),
                mutation("0.5 + 0.5 * m00", "0.5 + 0.501 * m00"),
                mutation("(1.0 - tail_z)", "(1.0 - 0.99 * tail_z)"),
            ],
        },
        Case {
            module: LOOKUP,
            functions: &["diffuse_fresnel"],
            imports: "",
            body: "y(0u, diffuse_fresnel(x(0u)));",
            inputs: 1,
            outputs: 1,
            twin: |x, y| y.push(lookup::diffuse_fresnel(x[0])),
            oracle: Some(|x, y| y.push(diffuse_fresnel_f64(x[0].clamp(0.0, 1.0)))),
            domains: vec![domain(
                "cosines",
                (-3..=103_i8).map(|i| f32::from(i) / 100.0).collect(),
                absolute(8e-6),
                ulp_of(4, 0.1),
            )],
            mutations: vec![
                mutation("0.028159764", "0.028165764"),
                mutation("0.008554668", "0.008564668"),
            ],
        },
    ]
}

/// (1/π) ∫ (1 − v·h)⁵ cos θ dl by the midpoint rule in sin² θ, which makes cos θ dl uniform, and the azimuth.
fn diffuse_fresnel_f64(n_dot_v: f64) -> f64 {
    const RINGS: u32 = 400;
    const SPOKES: u32 = 256;
    let sin_v = (1.0 - n_dot_v * n_dot_v).sqrt();
    let mut total = 0.0;
    for ring in 0..RINGS {
        let sin2 = (f64::from(ring) + 0.5) / f64::from(RINGS);
        for spoke in 0..SPOKES {
            // Half a turn stands for the other half.
            let azimuth = std::f64::consts::PI * (f64::from(spoke) + 0.5) / f64::from(SPOKES);
            let v_dot_l = sin_v * sin2.sqrt() * azimuth.cos() + n_dot_v * (1.0 - sin2).sqrt();
            total += (1.0 - (0.5 * (1.0 + v_dot_l)).max(0.0).sqrt()).powi(5);
        }
    }
    total / f64::from(RINGS * SPOKES)
}

#[test]
fn a_mirror_is_where_the_view_says() {
    // Off the rows and columns of the table too: the axis of a smooth lobe, row 2 of M⁻¹ against row 0.
    for i in 1..200_u8 {
        let n_dot_v = f32::from(i) / 200.0;
        let texel = table::sample(0.05, n_dot_v).texel0;
        let axis = lookup::ltc_m(texel, n_dot_v) * glam::Vec3::Z;
        let mirror = glam::Vec3::new(-(1.0 - n_dot_v * n_dot_v).sqrt(), 0.0, n_dot_v);
        let angle = axis.normalize().cross(mirror).length();
        assert!(
            angle < MIRROR_ANGLE || n_dot_v < GRAZING,
            "{n_dot_v}: {angle} rad"
        );
    }
}

/// Where a smooth lobe's axis may lie off the mirror direction, rad; at grazing angles it does on purpose.
const MIRROR_ANGLE: f32 = 1e-3;
const GRAZING: f32 = 0.1;

#[test]
fn a_texel_and_its_inverse_at_any_view() {
    for i in 0..=100_u8 {
        let n_dot_v = f32::from(i) / 100.0;
        let texel = table::sample(0.4, n_dot_v).texel0;
        let product = lookup::ltc_m(texel, n_dot_v) * lookup::ltc_m_inv(texel, n_dot_v);
        let scale = product.y_axis.y;
        assert!(
            (product * (1.0 / scale)).abs_diff_eq(Mat3::IDENTITY, 1e-4),
            "{n_dot_v}: {product}"
        );
    }
}
