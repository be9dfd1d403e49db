//! Rows of `polygon`, `form_factor` and `ltc::polygon`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, ulp_of, vec3};
use akari_math::form_factor::{self, FormFactorChain};
use akari_math::ltc::{lookup, polygon as ltc_polygon};
use akari_math::{oracle, polygon};
use glam::{Mat3, Vec3, Vec4};

const POLYGON: &str = "akari_math::polygon";
const FORM_FACTOR: &str = "akari_math::form_factor";
const LTC: &str = "akari_math::ltc::polygon";

fn mutation(module: &'static str, from: &'static str, to: &'static str) -> Mutation {
    Mutation { module, from, to }
}

/// Two unit vectors at an angle between `10^lo` and `10^hi`.
fn unit_pairs(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let a = random.direction();
        let angle = random.log_range(lo, hi);
        let b = random.around(a, angle);
        push3(row, a);
        push3(row, b);
    })
}

/// A triangle and `M^-1`; some triangles cross the horizon, some its image in cosine space.
fn triangles(seed: u64, n: usize, z_lo: f32, z_hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        for _ in 0..3 {
            let mut v = random.direction() * random.range(0.5, 2.0);
            v.z = random.range(z_lo, z_hi);
            push3(row, v);
        }
        let m_inv = lookup::ltc_m_inv(
            Vec4::new(
                random.range(0.5, 1.5),
                random.range(-0.4, 0.4),
                random.range(-0.4, 0.4),
                random.range(0.3, 1.2),
            ),
            1.0,
        );
        row.extend(m_inv.to_cols_array());
    })
}

fn degenerate_triangles() -> Vec<f32> {
    let identity = Mat3::IDENTITY.to_cols_array();
    let mut rows = Vec::new();
    for triangle in [
        [Vec3::ZERO, Vec3::X, Vec3::Y],
        [Vec3::ZERO; 3],
        [Vec3::Z; 3],
        [Vec3::NEG_Z, Vec3::X - Vec3::Z, Vec3::Y - Vec3::Z],
        [Vec3::X, Vec3::Y, Vec3::NEG_X],
        [Vec3::Z, Vec3::ZERO, Vec3::X + Vec3::Z],
    ] {
        for v in triangle {
            push3(&mut rows, v);
        }
        rows.extend(identity);
    }
    rows
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: FORM_FACTOR,
            functions: &["edge_form_factor"],
            imports: "",
            body: "y_vec3(0u, edge_form_factor(x_vec3(0u), x_vec3(3u)));",
            inputs: 6,
            outputs: 3,
            twin: |x, y| push3(y, form_factor::edge_form_factor(vec3(x, 0), vec3(x, 3))),
            oracle: Some(|x, y| {
                let (a, b) = (dvec3(x, 0).normalize(), dvec3(x, 3).normalize());
                let c = b.cross(a);
                y.extend((c * (c.length().atan2(a.dot(b)) / c.length().max(1e-300))).to_array());
            }),
            domains: vec![
                domain("1e-3 to 2 rad", unit_pairs(70, 1500, -3.0, 0.3), absolute(6e-7), ulp_of(8, 0.5)),
                domain("1e-7 to 1e-3 rad", unit_pairs(71, 800, -7.0, -3.0), absolute(1e-7), ulp_of(1, 1e-3)),
                // Towards a half circle the plane of the edge becomes uncertain: as the unit vectors over the sine, 0.04 at
                // 3.1 radians, times an angle of 3 and once more for the division and the arc tangent.
                domain("2 to 3.1 rad", unit_pairs(72, 500, 0.302, 0.4913), absolute(1e-4), ulp_of(400, 1.0)),
                domain("same or opposite", vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0], ulp(0), ulp(0)),
            ],
            mutations: vec![
                mutation(FORM_FACTOR, "sine * sine / 6.0", "sine * sine / 6.0 + 1e-3"),
                mutation(FORM_FACTOR, "normal * (atan2_poly(sine, cosine)", "1.0005 * normal * (atan2_poly(sine, cosine)"),
                mutation(FORM_FACTOR, "cross(b - a, a)", "cross(b - a, a) + vec3<f32>(0.0, 1e-6, 0.0)"),
                mutation("akari_math::special", "0.19971879", "0.1998"),
            ],
        },
        Case {
            module: FORM_FACTOR,
            functions: &["form_factor_chain_new", "form_factor_chain_push", "form_factor_chain_close"],
            imports: "",
            body: "var chain = form_factor_chain_new();
                for (var i = 0u; i < 3u; i++) { chain = form_factor_chain_push(chain, x_vec3(3u * i)); }
                y_vec3(0u, form_factor_chain_close(chain));",
            inputs: 18,
            outputs: 3,
            twin: |x, y| {
                let mut chain: FormFactorChain = form_factor::form_factor_chain_new();
                for i in 0..3 {
                    chain = form_factor::form_factor_chain_push(chain, vec3(x, 3 * i));
                }
                push3(y, form_factor::form_factor_chain_close(chain));
            },
            oracle: Some(|x, y| y.extend(oracle::unclipped_form_factor(&[dvec3(x, 0), dvec3(x, 3), dvec3(x, 6)]).to_array())),
            domains: vec![
                domain("triangles", triangles(73, 500, 0.1, 2.0), absolute(3e-7), ulp_of(4, 1.0)),
            ],
            mutations: vec![
                mutation(FORM_FACTOR, "0.15915494", "0.15916"),
                mutation(FORM_FACTOR, "edge_form_factor(chain.previous, chain.first)", "edge_form_factor(chain.first, chain.previous)"),
            ],
        },
        Case {
            module: POLYGON,
            functions: &["plane_crossing", "plane_distance"],
            imports: "",
            body: "let a = x_vec3(0u); let b = x_vec3(3u); let plane = vec4<f32>(0.6, 0.0, 0.8, 0.25);
                let da = plane_distance(plane, a); let db = plane_distance(plane, b);
                y(0u, da); y_vec3(1u, plane_crossing(a, b, da, db));",
            inputs: 6,
            outputs: 4,
            twin: |x, y| {
                let (a, b, plane) = (vec3(x, 0), vec3(x, 3), Vec4::new(0.6, 0.0, 0.8, 0.25));
                let (da, db) = (polygon::plane_distance(plane, a), polygon::plane_distance(plane, b));
                y.push(da);
                push3(y, polygon::plane_crossing(a, b, da, db));
            },
            oracle: None,
            domains: vec![domain(
                "edges that cross",
                rows(74, 500, |random, row| {
                    push3(row, random.direction() + Vec3::new(0.6, 0.0, 0.8));
                    push3(row, random.direction() - 1.3 * Vec3::new(0.6, 0.0, 0.8));
                }),
                ulp(0),
                ulp_of(8, 1.0),
            )],
            mutations: vec![mutation(POLYGON, "plane.xyz, point) + plane.w", "plane.xyz, point) - plane.w"), mutation(POLYGON, "let weight_a = abs(distance_b)", "let weight_a = abs(distance_a)")],
        },
        Case {
            module: POLYGON,
            functions: &["horizon_clip_push", "horizon_clip_new", "horizon_crossing", "horizon_middle",
                "is_long_horizon_edge", "above_horizon"],
            imports: "",
            body: "let first = horizon_clip_push(horizon_clip_new(), x_vec3(0u));
                let step = horizon_clip_push(first.clip, x_vec3(3u));
                y_vec3(0u, step.crossing);
                y(3u, f32(first.has_crossing + first.has_vertex + 4u * step.has_crossing + 8u * step.has_vertex + 16u * step.clip.inside + 32u * step.clip.started));
                y_vec3(4u, step.clip.first);
                y_vec3(7u, step.clip.previous);
                y_vec3(10u, horizon_crossing(x_vec3(0u), x_vec3(3u)));
                y(13u, f32(above_horizon(x_vec3(3u))));
                y_vec3(14u, horizon_middle(x_vec3(0u), x_vec3(3u)));
                y(17u, select(0.0, 1.0, is_long_horizon_edge(x_vec3(0u), x_vec3(3u))));",
            inputs: 6,
            outputs: 18,
            twin: |x, y| {
                let first = polygon::horizon_clip_push(polygon::horizon_clip_new(), vec3(x, 0));
                let step = polygon::horizon_clip_push(first.clip, vec3(x, 3));
                push3(y, step.crossing);
                y.push((first.has_crossing + first.has_vertex + 4 * step.has_crossing + 8 * step.has_vertex + 16 * step.clip.inside + 32 * step.clip.started) as f32);
                push3(y, step.clip.first);
                push3(y, step.clip.previous);
                push3(y, polygon::horizon_crossing(vec3(x, 0), vec3(x, 3)));
                y.push(polygon::above_horizon(vec3(x, 3)) as f32);
                push3(y, polygon::horizon_middle(vec3(x, 0), vec3(x, 3)));
                y.push(f32::from(u8::from(polygon::is_long_horizon_edge(vec3(x, 0), vec3(x, 3)))));
            },
            oracle: None,
            domains: vec![
                domain(
                    "edges above, below and across",
                    rows(75, 500, |random, row| {
                        push3(row, random.direction());
                        push3(row, random.direction());
                    }),
                    ulp(0),
                    ulp_of(2, 1.0),
                ),
                domain("vertices on the horizon", {
                    let mut rows = Vec::new();
                    for z in [0.0, 9e-8, 1.1e-7, -1e-7, 1.0, -1.0] {
                        for w in [0.0, 5e-8, 1.0, -1.0] {
                            rows.extend([1.0, 0.3, z, -0.4, 1.0, w]);
                        }
                    }
                    for k in 0..32 {
                            let (sine, cosine) = (0.2 * k as f32).sin_cos();
                            rows.extend([1.0, 0.0, 0.0, cosine, sine, 0.0]);
                        }
                        rows
                }, ulp(0), ulp_of(2, 1.0)),
            ],
            mutations: vec![
                mutation(POLYGON, "ON_PLANE: f32 = 1e-7", "ON_PLANE: f32 = 2e-7"),
                mutation(POLYGON, "let weight_a = abs(b.z)", "let weight_a = b.z"),
                mutation(POLYGON, "turn * chord.y", "chord.y"),
                mutation(POLYGON, "dot(a, b) < 0.0", "dot(a, b) < 0.5"),
                mutation(POLYGON, "inside != clip.inside", "inside == clip.inside"),
            ],
        },
        Case {
            module: LTC,
            functions: &[
                "ltc_polygon_new", "ltc_polygon_add_edge", "ltc_polygon_close", "ltc_polygon_push", "ltc_polygon_push_lobe",
                "ltc_polygon_push_visible",
                "lambert_polygon_new", "lambert_polygon_add_edge", "lambert_polygon_close", "lambert_polygon_push",
            ],
            imports: "",
            body: "var p = ltc_polygon_new();
                var l = lambert_polygon_new();
                let m_inv = x_mat3(9u);
                for (var i = 0u; i < 3u; i++) {
                    let a = x_vec3(3u * i);
                    let b = x_vec3(3u * ((i + 1u) % 3u));
                    ltc_polygon_add_edge(&p, m_inv, a, b);
                    lambert_polygon_add_edge(&l, a, b);
                }
                ltc_polygon_close(&p, m_inv);
                lambert_polygon_close(&l);
                y_vec3(0u, p.diffuse); y_vec3(3u, p.specular); y_vec3(6u, l.diffuse);",
            inputs: 18,
            outputs: 9,
            twin: |x, y| {
                let (mut p, mut l) = (ltc_polygon::ltc_polygon_new(), ltc_polygon::lambert_polygon_new());
                let m_inv = Mat3::from_cols_slice(&x[9..]);
                for i in 0..3 {
                    let (a, b) = (vec3(x, 3 * i), vec3(x, 3 * ((i + 1) % 3)));
                    ltc_polygon::ltc_polygon_add_edge(&mut p, m_inv, a, b);
                    ltc_polygon::lambert_polygon_add_edge(&mut l, a, b);
                }
                ltc_polygon::ltc_polygon_close(&mut p, m_inv);
                ltc_polygon::lambert_polygon_close(&mut l);
                push3(y, p.diffuse);
                push3(y, p.specular);
                push3(y, l.diffuse);
            },
            oracle: Some(|x, y| {
                let triangle = [dvec3(x, 0), dvec3(x, 3), dvec3(x, 6)];
                let m_inv = glam::DMat3::from_cols_slice(&x[9..]);
                let diffuse = oracle::form_factor(&triangle).to_array();
                y.extend(diffuse);
                y.extend(oracle::ltc_form_factor(&triangle, m_inv).to_array());
                y.extend(diffuse);
            }),
            domains: vec![
                domain("above the horizon", triangles(76, 600, 0.2, 2.0), absolute(5e-7), ulp_of(5, 1.0)),
                // A vertex of the clipped polygon is as uncertain as the crossing it comes from, whose weights cancel where
                // an edge runs close to the horizon; three to five edges of 3 ULP each add up beside it.
                domain("across the horizon", triangles(77, 1000, -1.0, 1.0), absolute(5e-6), ulp_of(16, 1.0)),
                domain("degenerate", degenerate_triangles(), absolute(1.0), ulp_of(4, 1.0)),
            ],
            mutations: vec![
                mutation(LTC, "form_factor_chain_close((*polygon).lobe_chain)", "form_factor_chain_close((*polygon).chain)"),
                mutation(LTC, "m_inv * point);", "point);"),
                mutation(LTC, "select(scaled, step.crossing, is_crossing));", "select(step.crossing, scaled, is_crossing));"),
                mutation(LTC, "if all(scaled == vec3<f32>(0.0)) {\n        return;\n    }\n    let step = horizon_clip_push((*polygon).clip, scaled);\n    (*polygon).clip = step.clip;\n    // A loop", "let step = horizon_clip_push((*polygon).clip, scaled + vec3<f32>(0.0, 0.0, 1e-4));\n    (*polygon).clip = step.clip;\n    // A loop"),
            ],
        },
    ]
}
