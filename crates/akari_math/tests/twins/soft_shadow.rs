//! Rows of `voxel::soft_shadow`.

use crate::harness::{Case, Mutation, domain, dvec3, push3, rows, ulp, ulp_of, vec3};
use akari_math::voxel::soft_shadow;
use glam::{UVec2, Vec3};

const MODULE: &str = "akari_math::voxel::soft_shadow";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["pattern_place"],
            imports: "",
            body: "y(0u, f32(pattern_place(vec2<u32>(u32(x(0u)), u32(x(1u))))));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| {
                y.push(soft_shadow::pattern_place(UVec2::new(x[0] as u32, x[1] as u32)) as f32);
            },
            oracle: None,
            domains: vec![domain(
                "pixels",
                rows(930, 200, |r, row| {
                    row.extend([(r.next() % 10_000) as f32, (r.next() % 10_000) as f32]);
                }),
                ulp(0),
                ulp(0),
            )],
            mutations: vec![
                mutation("low.x ^ low.y", "low.x"),
                mutation("high.x ^ high.y", "high.x"),
                mutation("PATTERN_EDGE * y", "2u * y"),
                mutation("2u * low.y + high.y", "2u * high.y + low.y"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["light_point_weight", "light_part_tangent"],
            imports: "",
            // The weight in units of that of a light which stands face to face, so that one budget holds at all distances.
            body: "let to = x_vec3(0u); let size = max(dot(to, to), 1e-12);
                y(0u, size * light_point_weight(to, x_vec3(3u), x_vec3(6u), x(9u) > 0.5));
                y(1u, light_part_tangent(x(10u), to, x_vec3(6u)));",
            inputs: 11,
            outputs: 2,
            twin: |x, y| {
                let to: Vec3 = vec3(x, 0);
                let size = to.dot(to).max(1e-12);
                let (normal, light) = (vec3(x, 3), vec3(x, 6));
                y.push(size * soft_shadow::light_point_weight(to, normal, light, x[9] > 0.5));
                y.push(soft_shadow::light_part_tangent(x[10], to, light));
            },
            oracle: Some(|x, y| {
                let (to, normal, light) = (dvec3(x, 0), dvec3(x, 3), dvec3(x, 6));
                let square = to.length_squared().max(1e-12);
                let leaving = -to.dot(light);
                let sent = if x[9] > 0.5 {
                    leaving.abs()
                } else {
                    leaving.max(0.0)
                };
                y.push(to.dot(normal).max(0.0) * sent / square);
                let cosine = (leaving.abs() / square.sqrt()).min(1.0);
                let radius = (x[10].max(0.0) * cosine / std::f64::consts::PI).sqrt();
                y.push((radius / square.sqrt()).min(1.0));
            }),
            domains: vec![
                domain(
                    "lights at all distances, from both sides",
                    rows(931, 400, |r, row| {
                        push3(row, r.direction() * r.log_range(-3.0, 5.0));
                        push3(row, r.direction());
                        push3(row, r.direction());
                        row.extend([(r.next() % 2) as f32, r.log_range(-6.0, 6.0)]);
                    }),
                    ulp_of(8, 1.0),
                    // A root of a cosine near 0, and the device's division.
                    ulp_of(2000, 1.0),
                ),
                domain(
                    "upon the light, and farther than anything",
                    vec![
                        0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0, //
                        0.0, 0.0, 1e-7, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0, //
                        0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, //
                        0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, //
                        3e14, 0.0, 1e15, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1e6,
                    ],
                    ulp_of(8, 1.0),
                    ulp_of(16, 1.0),
                ),
            ],
            mutations: vec![
                mutation(
                    "max(leaving, 0.0), abs(leaving)",
                    "abs(leaving), max(leaving, 0.0)",
                ),
                mutation(
                    "max(dot(to_point, normal), 0.0)",
                    "abs(dot(to_point, normal))",
                ),
                mutation("(sent * reciprocal)", "(sent * sent * reciprocal)"),
                mutation(
                    "MIN_DISTANCE_SQUARED: f32 = 1e-12",
                    "MIN_DISTANCE_SQUARED: f32 = 1e-16",
                ),
                mutation("DISK_RADIUS: f32 = 0.5641896", "DISK_RADIUS: f32 = 0.565"),
                mutation("MAX_TANGENT: f32 = 1.0", "MAX_TANGENT: f32 = 1.1"),
                mutation("* sqrt(cosine) * reciprocal", "* cosine * reciprocal"),
            ],
        },
    ]
}
