//! Rows of `sg::polygon` and `sg::ltc`.

use crate::harness::{
    Budget, Case, Mutation, Random, absolute, domain, dvec3, push3, rows, ulp, vec3,
};
use akari_math::frame::orthonormal_basis;
use akari_math::oracle;
use akari_math::sg::{lobe, ltc, polygon};
use akari_math::special::one_minus_exp_neg_over_x;
use glam::{Vec2, Vec3};

const POLYGON: &str = "akari_math::sg::polygon";
const LTC: &str = "akari_math::sg::ltc";

fn mutation(module: &'static str, from: &'static str, to: &'static str) -> Mutation {
    Mutation { module, from, to }
}

fn vec2(row: &[f32], i: usize) -> Vec2 {
    Vec2::new(row[i], row[i + 1])
}

/// Sharpness in all decades for each of `counts`.
fn counted_sharpnesses(seed: u64, counts: &[f32]) -> Vec<f32> {
    let mut random = Random::new(seed);
    let mut rows = Vec::new();
    for &count in counts {
        for sharpness in [0.0, 4.0, 6.0, 1e12] {
            rows.extend([count, sharpness]);
        }
        for _ in 0..60 {
            rows.extend([count, random.log_range(-3.0, 9.0)]);
        }
    }
    rows
}

/// An edge near the lobe, the axis, sharpness between `10^lo` and `10^hi`, nodes.
fn edges(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let axis = random.direction();
        let sharpness = random.log_range(lo, hi);
        let near = random.range(0.0, 4.0) / (1.0 + sharpness).sqrt();
        let a = random.around(axis, near);
        let length = random.log_range(-2.0, 0.3);
        let b = random.around(a, length);
        push3(row, a);
        push3(row, b);
        push3(row, axis);
        row.push(sharpness);
        row.push([1.0, 2.0, 3.0, 4.0, 6.0, 8.0][(random.next() % 6) as usize]);
    })
}

/// A triangle, an axis, sharpness between `10^lo` and `10^hi`.
fn triangles(seed: u64, n: usize, [z_lo, z_hi]: [f32; 2], lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let mut center = Vec3::ZERO;
        for _ in 0..3 {
            let mut v = random.direction() * random.range(0.5, 2.0);
            v.z = random.range(z_lo, z_hi);
            push3(row, v);
            center += v;
        }
        let sharpness = random.log_range(lo, hi);
        let angle = random.range(0.0, 4.0) / (1.0 + sharpness).sqrt();
        let axis = random.around(center.normalize(), angle);
        push3(row, axis);
        row.push(sharpness);
    })
}

/// Triangles without area, on the horizon, below it, at the shading point.
fn degenerate_triangles() -> Vec<f32> {
    let mut rows = Vec::new();
    for triangle in [
        [Vec3::ZERO, Vec3::X, Vec3::Y],
        [Vec3::ZERO; 3],
        [Vec3::Z; 3],
        [Vec3::NEG_Z, Vec3::X - Vec3::Z, Vec3::Y - Vec3::Z],
        [Vec3::X, Vec3::Y, Vec3::NEG_X],
        [Vec3::Z, Vec3::ZERO, Vec3::X + Vec3::Z],
    ] {
        for (axis, sharpness) in [(Vec3::Z, 10.0), (Vec3::NEG_Z, 1e7), (Vec3::X, 1e-3)] {
            for v in triangle {
                push3(&mut rows, v);
            }
            push3(&mut rows, axis);
            rows.push(sharpness);
        }
    }
    rows
}

fn polygon_cases() -> Vec<Case> {
    vec![
        Case {
            module: POLYGON,
            functions: &["sg_rule", "rule_pairs"],
            imports: "",
            body: "let rule = sg_rule(u32(x(0u)), x(1u));
                y_vec3(0u, rule.breadth); y_vec2(3u, rule.center);
                for (var i = 0u; i < 4u; i++) {
                    y(5u + i, rule.outer[i]); y(9u + i, rule.second[i]); y(13u + i, rule.third[i]); y(17u + i, rule.inner[i]);
                }
                y(21u, rule.sharpness); y(22u, rule.mean); y(23u, f32(rule_pairs(u32(x(0u))) + 8u * rule.pairs));",
            inputs: 2,
            outputs: 24,
            twin: |x, y| {
                let rule = polygon::sg_rule(x[0] as u32, x[1]);
                push3(y, rule.breadth);
                y.extend(rule.center.to_array());
                for nodes in [rule.outer, rule.second, rule.third, rule.inner] {
                    y.extend(nodes.to_array());
                }
                let pairs = polygon::rule_pairs(x[0] as u32) + 8 * rule.pairs;
                y.extend([rule.sharpness, rule.mean, pairs as f32]);
            },
            oracle: None,
            // Sums of three terms of order 20.
            domains: [1.0, 2.0, 3.0, 4.0, 6.0, 8.0]
                .into_iter()
                .map(|nodes| {
                    let budget = Budget {
                        ulp: 16,
                        absolute: 1e-5,
                    };
                    domain("all sharpnesses", counted_sharpnesses(600, &[nodes]), ulp(0), budget)
                })
                .collect(),
            mutations: RULE_MUTATIONS
                .iter()
                .map(|(from, to)| mutation(POLYGON, from, to))
                .collect(),
        },
        Case {
            module: POLYGON,
            functions: &["sg_edge_kernel"],
            imports: "#import akari_math::special::one_minus_exp_neg_over_x",
            body: "y(0u, sg_edge_kernel(x(0u), x(1u), one_minus_exp_neg_over_x(2.0 * x(1u))));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| {
                let mean = one_minus_exp_neg_over_x(2.0 * x[1]);
                y.push(polygon::sg_edge_kernel(x[0], x[1], mean));
            },
            oracle: Some(|x, y| {
                let mean = oracle::one_minus_exp_neg_over_x(2.0 * x[1]);
                y.push(if x[0] < 1.9 {
                    (oracle::one_minus_exp_neg_over_x(x[0] * x[1]) - mean) / (2.0 - x[0])
                } else {
                    let rest = oracle::one_minus_exp_neg_over_x(x[1] * (2.0 - x[0]));
                    (mean - (-x[0] * x[1]).exp() * rest) / x[0]
                });
            }),
            domains: vec![
                domain(
                    "near side",
                    rows(601, 800, |random, row| row.extend([random.range(0.0, 1.0), random.log_range(-4.0, 8.0)])),
                    absolute(3e-7),
                    absolute(4e-7),
                ),
                domain(
                    "far side",
                    rows(602, 800, |random, row| row.extend([random.range(1.0, 2.0), random.log_range(-4.0, 3.0)])),
                    absolute(3e-7),
                    absolute(4e-7),
                ),
                domain(
                    "at the axis and opposite to it",
                    rows(603, 200, |random, row| {
                        let u = random.log_range(-12.0, -2.0);
                        row.extend([[u, 2.0 - u][(random.next() % 2) as usize], random.log_range(-4.0, 12.0)]);
                    }),
                    absolute(3e-7),
                    absolute(4e-7),
                ),
            ],
            mutations: vec![
                mutation(POLYGON, "- mean) / (2.0 - u)", "- mean) / (2.00001 - u)"),
                mutation(POLYGON, "let rest = sharpness * max(2.0 - u, 0.0)", "let rest = sharpness * max(2.001 - u, 0.0)"),
                mutation(POLYGON, "exp(-sharpness * u)", "exp(-sharpness * u * 1.0001)"),
            ],
        },
        Case {
            module: POLYGON,
            functions: &["sg_solid_angle_push", "sg_solid_angle_factor", "sg_angle_sum"],
            imports: "",
            body: "let area = vec2<f32>(x(9u), x(10u));
                y_vec2(0u, sg_solid_angle_factor(x_vec3(0u), x_vec3(3u), x_vec3(6u)));
                y_vec2(2u, sg_angle_sum(area, vec2<f32>(x(0u), x(1u))));
                y_vec2(4u, sg_solid_angle_push(area, x_vec3(0u), x_vec3(3u), x_vec3(6u)));",
            inputs: 11,
            outputs: 6,
            twin: |x, y| {
                let (first, a, b, area) = (vec3(x, 0), vec3(x, 3), vec3(x, 6), vec2(x, 9));
                y.extend(polygon::sg_solid_angle_factor(first, a, b).to_array());
                y.extend(polygon::sg_angle_sum(area, vec2(x, 0)).to_array());
                y.extend(polygon::sg_solid_angle_push(area, first, a, b).to_array());
            },
            oracle: None,
            domains: vec![
                domain(
                    "triangles",
                    rows(604, 600, |random, row| {
                        for _ in 0..3 {
                            let v = random.direction();
                            push3(row, Vec3::new(v.x, v.y, v.z.abs() + 0.1).normalize());
                        }
                        let angle = random.range(-3.0, 3.0);
                        row.extend([angle.cos(), angle.sin()]);
                    }),
                    ulp(0),
                    absolute(2e-6),
                ),
                // The other branch: three triangles to the normal instead.
                domain(
                    "opposite corners",
                    rows(605, 200, |random, row| {
                        let first = random.around(Vec3::Z, 1.57);
                        push3(row, first);
                        push3(row, random.around(Vec3::Z, 1.2));
                        push3(row, Vec3::new(-first.x, -first.y, 1e-4).normalize());
                        row.extend([1.0, 0.0]);
                    }),
                    ulp(0),
                    absolute(2e-5),
                ),
            ],
            mutations: vec![
                mutation(POLYGON, "0.5 * dot(sum, sum)", "0.5001 * dot(sum, sum)"),
                mutation(POLYGON, "a.y * b.x + a.x * b.y", "a.y * b.x + 1.0001 * a.x * b.y"),
                mutation(POLYGON, "sg_solid_angle_factor(up, b, first)", "sg_solid_angle_factor(up, first, b)"),
            ],
        },
        Case {
            module: POLYGON,
            functions: &["sg_arc_integral", "sg_arc", "sg_arc_node", "sg_arc_pair"],
            imports: "#import akari_math::sg::polygon::sg_rule",
            body: "let axis = x_vec3(6u);
                let rule = sg_rule(u32(x(10u)), x(9u));
                let arc = sg_arc(x_vec3(0u), x_vec3(3u), axis, rule);
                let scale = arc.n_dot_axis * arc.breadth / rule.mean;
                y(0u, sg_arc_integral(arc, rule) / rule.mean);
                y(1u, scale * arc.reach * sg_arc_node(arc, rule, arc.middle));
                y(2u, scale * sg_arc_pair(arc, rule, rule.outer));
                y(3u, arc.nearest);",
            inputs: 11,
            outputs: 4,
            twin: |x, y| {
                let rule = polygon::sg_rule(x[10] as u32, x[9]);
                let (a, b, axis) = (vec3(x, 0), vec3(x, 3), vec3(x, 6));
                let arc = polygon::sg_arc(a, b, axis, rule);
                let scale = arc.n_dot_axis * arc.breadth / rule.mean;
                y.push(polygon::sg_arc_integral(arc, rule) / rule.mean);
                y.push(scale * arc.reach * polygon::sg_arc_node(arc, rule, arc.middle));
                y.push(scale * polygon::sg_arc_pair(arc, rule, rule.outer));
                y.push(arc.nearest);
            },
            oracle: None,
            domains: vec![
                domain("sharpness to 10", edges(606, 800, -3.0, 1.0), ulp(0), absolute(5e-6)),
                domain("sharpness to 1e4", edges(607, 800, 1.0, 4.0), ulp(0), absolute(5e-6)),
                domain("sharpness to 1e7", edges(608, 400, 4.0, 7.0), ulp(0), absolute(5e-6)),
            ],
            mutations: vec![
                mutation(POLYGON, "1.0 - cosine, y_squared", "1.0 - cosine, 1.01 * y_squared"),
                mutation(POLYGON, "(1.0 + p * p) * (sg_arc_node", "(1.0 + 1.01 * p * p) * (sg_arc_node"),
                mutation(POLYGON, "+ rule.breadth.y * abs(n_dot_axis)", "+ 0.95 * rule.breadth.y * abs(n_dot_axis)"),
                mutation(POLYGON, "last.y - first.y, first.x - last.x", "last.y - first.y, last.x - first.x"),
                mutation(POLYGON, "n_dot_axis * n_dot_axis / (1.0 + radius)", "n_dot_axis * n_dot_axis / (1.01 + radius)"),
                mutation(POLYGON, "weight = arc.reach * rule.center.x", "weight = 0.99 * arc.reach * rule.center.x"),
                mutation(POLYGON, "sg_arc_pair(arc, rule, rule.third)", "sg_arc_pair(arc, rule, rule.second)"),
                mutation(POLYGON, "rule.pairs > 3u", "rule.pairs > 4u"),
            ],
        },
        Case {
            module: POLYGON,
            functions: &[
                "sg_polygon_close", "sg_polygon_new", "sg_polygon_add_edge", "sg_polygon_push", "sg_polygon_push_visible",
                "sg_polygon_push_direction", "sg_polygon_settle",
            ],
            imports: "#import akari_math::sg::polygon::sg_rule",
            body: "let axis = x_vec3(9u);
                let rule = sg_rule(8u, x(12u));
                var polygon = sg_polygon_new();
                for (var i = 0u; i < 3u; i++) {
                    sg_polygon_add_edge(&polygon, axis, rule, x_vec3(3u * i), x_vec3(3u * ((i + 1u) % 3u)));
                }
                sg_polygon_close(&polygon, axis, rule);
                y(0u, polygon.integral / rule.mean); y(1u, polygon.solid_angle);",
            inputs: 13,
            outputs: 2,
            twin: |x, y| {
                let (axis, rule) = (vec3(x, 9), polygon::sg_rule(8, x[12]));
                let mut polygon = polygon::sg_polygon_new();
                for i in 0..3 {
                    let (a, b) = (vec3(x, 3 * i), vec3(x, 3 * ((i + 1) % 3)));
                    polygon::sg_polygon_add_edge(&mut polygon, axis, rule, a, b);
                }
                polygon::sg_polygon_close(&mut polygon, axis, rule);
                y.extend([polygon.integral / rule.mean, polygon.solid_angle]);
            },
            oracle: Some(|x, y| {
                let triangle = [dvec3(x, 0), dvec3(x, 3), dvec3(x, 6)];
                let mean = oracle::one_minus_exp_neg_over_x(2.0 * x[12]);
                let above = oracle::clip_at_horizon(&triangle);
                let exact = oracle::sg_polygon::sg_polygon(&triangle, dvec3(x, 9), x[12]);
                y.push(exact / mean);
                y.push(if above.len() < 3 { 0.0 } else { oracle::sg_polygon::solid_angle(&above) });
            }),
            domains: vec![
                domain("above", triangles(609, 600, [0.1, 2.0], -3.0, 1.0), absolute(4e-5), absolute(1e-5)),
                // The rule is off by up to 3e-4 of 4 pi here.
                domain("above, narrow lobes", triangles(610, 400, [0.1, 2.0], 1.0, 4.0), absolute(4e-3), absolute(2e-4)),
                domain("across the horizon", triangles(611, 600, [-1.0, 1.0], -3.0, 1.0), absolute(4e-4), absolute(5e-6)),
                domain("degenerate", degenerate_triangles(), absolute(1e-6), absolute(1e-6)),
            ],
            mutations: vec![
                mutation(POLYGON, "2.0 * atan2_poly", "2.0001 * atan2_poly"),
                mutation(POLYGON, "sg_polygon_push_visible(polygon, axis, rule, (*polygon).first)", "sg_polygon_push_visible(polygon, axis, rule, (*polygon).previous)"),
                mutation(POLYGON, "+ (*polygon).edges;", "+ (*polygon).edges + 1e-4;"),
                mutation(POLYGON, "SETTLING: f32 = 8.0", "SETTLING: f32 = 4.0"),
                mutation(POLYGON, "select(0.5 * dot(offset, offset), gap", "select(0.5 * dot(offset, offset), 2.0"),
                mutation("akari_math::polygon", "vertex.z > ON_PLANE * max_abs_component(vertex)", "vertex.z > 0.1 * max_abs_component(vertex)"),
            ],
        },
    ]
}

/// One literal of each branch of `sg_rule`, and what is common to them.
const RULE_MUTATIONS: &[(&str, &str)] = &[
    ("0.710668", "0.711168"),
    ("1.438535", "1.439035"),
    ("1.110988", "1.111488"),
    ("0.268627", "0.269127"),
    ("1.508694", "1.509194"),
    ("-0.332946", "-0.332446"),
    ("0.708777", "0.709277"),
    ("-0.007352", "-0.006852"),
    ("2.150473", "2.150973"),
    ("0.356624", "0.357124"),
    ("0.202063", "0.202563"),
    ("-0.000846", "-0.000346"),
    ("max(sharpness, 1.0)", "max(sharpness, 1.01)"),
    ("return nodes / 2u", "return nodes / 3u"),
    ("return 4u", "return 3u"),
    ("RULE_SHARPNESS: f32 = 60.0", "RULE_SHARPNESS: f32 = 60.1"),
];

fn ltc_cases() -> Vec<Case> {
    vec![
        Case {
            module: LTC,
            functions: &["sg_mixture", "sg_ltc_share"],
            imports: "",
            body: "let mixture = sg_mixture(u32(x(0u)), x(1u));
                let width = sqrt(2.0 / max(x(1u), 4.0));
                y_vec3(0u, mixture.widths / width); y_vec3(3u, mixture.weights); y(6u, sg_ltc_share(x(1u)));",
            inputs: 2,
            outputs: 7,
            twin: |x, y| {
                let mixture = ltc::sg_mixture(x[0] as u32, x[1]);
                push3(y, mixture.widths / (2.0 / x[1].max(4.0)).sqrt());
                push3(y, mixture.weights);
                y.push(ltc::sg_ltc_share(x[1]));
            },
            oracle: None,
            domains: [1.0, 2.0, 3.0]
                .into_iter()
                .map(|lobes| {
                    // Terms up to 13, times the integral of the lobe, at most 4 pi.
                    domain("all sharpnesses", counted_sharpnesses(620, &[lobes]), ulp(0), Budget { ulp: 16, absolute: 1e-5 })
                })
                .collect(),
            mutations: vec![
                mutation(LTC, "0.934814", "0.934914"),
                mutation(LTC, "v * -1.942005", "v * -1.943005"),
                mutation(LTC, "1.705068", "1.705168"),
                mutation(LTC, "-7.756207", "-7.757207"),
                mutation(LTC, "1.193243", "1.194243"),
                mutation(LTC, "1.186111", "1.186211"),
                mutation(LTC, "v * -4.256625", "v * -4.257625"),
                mutation(LTC, "v * -7.710157", "v * -7.711157"),
                mutation(LTC, "8.762429", "8.762529"),
                mutation(LTC, "sharpness / MIN_MIXTURE_SHARPNESS - 1.0", "sharpness / MIN_MIXTURE_SHARPNESS - 1.001"),
            ],
        },
        Case {
            module: LTC,
            functions: &["sg_ltc_edge"],
            imports: "",
            body: "y(0u, sg_ltc_edge(x_vec3(0u), x_vec3(3u), x(6u)));",
            inputs: 7,
            outputs: 1,
            twin: |x, y| y.push(ltc::sg_ltc_edge(vec3(x, 0), vec3(x, 3), x[6])),
            oracle: Some(|x, y| {
                let scale = glam::DVec3::new(1.0, 1.0, x[6]);
                let (a, b) = (dvec3(x, 0) * scale, dvec3(x, 3) * scale);
                let c = b.cross(a);
                y.push(c.z * c.length().atan2(a.dot(b)) / c.length().max(1e-300));
            }),
            domains: vec![
                domain(
                    "wide",
                    rows(621, 800, |random, row| {
                        let (a, b) = (random.direction(), random.direction());
                        push3(row, Vec3::new(a.x, a.y, a.z.abs()));
                        push3(row, Vec3::new(b.x, b.y, b.z.abs()) * random.range(0.5, 1.5));
                        row.push(random.range(0.05, 1.0));
                    }),
                    absolute(2e-5),
                    absolute(2e-5),
                ),
                domain(
                    "narrow",
                    rows(622, 400, |random, row| {
                        let width = random.log_range(-5.0, -1.0);
                        let angle = width * random.range(0.0, 3.0);
                        let a = random.around(Vec3::Z, angle);
                        push3(row, a);
                        let step = width * random.range(0.01, 3.0);
                        push3(row, random.around(a, step));
                        row.push(width);
                    }),
                    // The rounding of unit vectors over the width.
                    absolute(2e-2),
                    absolute(1e-4),
                ),
            ],
            mutations: vec![
                mutation(LTC, "width * width * a.z * b.z", "1.001 * width * width * a.z * b.z"),
                mutation(LTC, "+ normal.z * normal.z", "+ 1.001 * normal.z * normal.z"),
            ],
        },
        Case {
            module: LTC,
            functions: &[
                "sg_ltc_polygon_close", "sg_ltc_polygon_new", "sg_ltc_polygon_add_edge", "sg_ltc_polygon_push",
                "sg_ltc_polygon_push_visible", "sg_ltc_polygon_push_turned", "sg_ltc_polygon_push_lobe",
            ],
            imports: "#import akari_math::sg::ltc::sg_mixture
                #import akari_math::sg::lobe::sg_integral
                #import akari_math::frame::orthonormal_basis",
            body: "let frame = orthonormal_basis(x_vec3(9u));
                let mixture = sg_mixture(3u, x(12u));
                var polygon = sg_ltc_polygon_new();
                for (var i = 0u; i < 3u; i++) {
                    sg_ltc_polygon_add_edge(&polygon, frame, mixture, x_vec3(3u * i), x_vec3(3u * ((i + 1u) % 3u)));
                }
                sg_ltc_polygon_close(&polygon, frame, mixture);
                y(0u, polygon.integral / sg_integral(x(12u)));",
            inputs: 13,
            outputs: 1,
            twin: |x, y| {
                let (frame, mixture) = (orthonormal_basis(vec3(x, 9)), ltc::sg_mixture(3, x[12]));
                let mut polygon = ltc::sg_ltc_polygon_new();
                for i in 0..3 {
                    let (a, b) = (vec3(x, 3 * i), vec3(x, 3 * ((i + 1) % 3)));
                    ltc::sg_ltc_polygon_add_edge(&mut polygon, frame, mixture, a, b);
                }
                ltc::sg_ltc_polygon_close(&mut polygon, frame, mixture);
                y.push(polygon.integral / lobe::sg_integral(x[12]));
            },
            // What the mixture integrates to, not what the lobe does.
            oracle: Some(|x, y| {
                let triangle = [dvec3(x, 0), dvec3(x, 3), dvec3(x, 6)];
                let mixture = ltc::sg_mixture(3, x[12] as f32);
                let axis = dvec3(x, 9).normalize();
                let tangent = axis.any_orthonormal_vector();
                let frame = glam::DMat3::from_cols(tangent, axis.cross(tangent), axis).transpose();
                let mut sum = 0.0;
                for (width, weight) in mixture.widths.to_array().into_iter().zip(mixture.weights.to_array()) {
                    let stretch = glam::DMat3::from_diagonal(glam::DVec3::new(1.0, 1.0, f64::from(width)));
                    sum += f64::from(weight) * oracle::ltc_form_factor(&triangle, stretch * frame).z;
                }
                y.push(sum / oracle::sg_integral(x[12]));
            }),
            domains: vec![
                domain("above", triangles(623, 600, [0.1, 2.0], 0.6, 2.0), absolute(1e-5), absolute(1e-5)),
                domain("above, narrow lobes", triangles(624, 400, [0.1, 2.0], 2.0, 5.0), absolute(2e-4), absolute(2e-4)),
                domain("across the horizon", triangles(625, 600, [-1.0, 1.0], 0.6, 2.0), absolute(2e-5), absolute(2e-5)),
                domain("degenerate", degenerate_triangles(), absolute(1e-6), absolute(1e-6)),
            ],
            mutations: vec![
                mutation(LTC, "0.15915494", "0.1593"),
                mutation(LTC, "transpose(frame) * vertex", "transpose(frame) * (vertex * vec3<f32>(1.0, 1.0, 1.01))"),
                mutation(LTC, "sg_ltc_polygon_push_lobe(polygon, mixture, (*polygon).lobe_first)", "sg_ltc_polygon_push_lobe(polygon, mixture, (*polygon).lobe_previous)"),
                mutation(LTC, "INV_TWO_PI * dot(mixture.weights, (*polygon).sums)", "INV_TWO_PI * dot(mixture.weights, (*polygon).sums) + 1e-4"),
            ],
        },
    ]
}

pub fn cases() -> Vec<Case> {
    let mut cases = polygon_cases();
    cases.extend(ltc_cases());
    cases
}
