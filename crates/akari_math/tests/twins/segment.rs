//! Rows of `segment`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, vec3};
use akari_math::segment::{segment_box, segment_inverse, segment_triangle};
use glam::Vec3;

const MODULE: &str = "akari_math::segment";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

/// Boxes of sides 0.2 to 2, some flat, and segments to a place within or well beside them.
fn boxes(seed: u64, inside: bool) -> Vec<f32> {
    rows(seed, 400, |random, row| {
        let center = random.direction() * random.range(0.0, 2.0);
        let mut half = Vec3::new(
            random.range(0.1, 1.0),
            random.range(0.1, 1.0),
            random.range(0.1, 1.0),
        );
        if random.next().is_multiple_of(4) {
            half.z = 0.0;
        }
        let mut at = Vec3::new(
            random.range(-0.9, 0.9),
            random.range(-0.9, 0.9),
            random.range(-0.9, 0.9),
        );
        let mut ahead = random.direction();
        if !inside {
            // Beyond a side, and along it.
            let axis = (random.next() % 3) as usize;
            let side = if random.next().is_multiple_of(2) {
                1.0
            } else {
                -1.0
            };
            at[axis] = side * random.range(1.1, 2.0);
            half = half.max(Vec3::splat(0.1));
            ahead[axis] = 0.0;
        }
        let target = center + at * half;
        let length = random.range(2.0, 9.0);
        let origin = target - ahead * length;
        push3(row, origin);
        push3(row, ahead * (length * random.range(1.1, 2.0)));
        push3(row, center - half);
        push3(row, center + half);
        row.push(random.range(0.0, 0.9));
        row.push(1.0);
    })
}

/// Triangles that are no slivers, and segments that pass well within or well outside of them at no grazing angle.
fn triangles(seed: u64, inside: bool) -> Vec<f32> {
    rows(seed, 600, |random, row| {
        let u = random.direction();
        let v = u.any_orthonormal_vector();
        let (a, b) = (random.direction() * 0.5, random.range(0.5, 1.0));
        let b = a + u * b;
        let c = a + v * random.range(0.5, 1.0) + u * random.range(-0.3, 0.3);
        let (s, t) = if inside {
            let s = random.range(0.05, 0.9);
            (s, random.range(0.05, 0.95 - s))
        } else {
            // Beyond each edge in turn.
            match random.next() % 3 {
                0 => (random.range(-0.9, -0.05), random.range(-0.5, 1.5)),
                1 => (random.range(-0.5, 1.5), random.range(-0.9, -0.05)),
                _ => {
                    let s = random.range(-0.5, 1.5);
                    (s, 1.05 - s + random.range(0.0, 0.9))
                }
            }
        };
        let target = a + s * (b - a) + t * (c - a);
        let normal = u.cross(v);
        let angle = random.range(0.0, 1.1);
        let side = if random.next().is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        let ahead = random.around(side * normal, angle);
        let length = random.range(0.5, 4.0);
        push3(row, target - ahead * length);
        // Some end before the plane, some begin behind it.
        let reach = match random.next() % 4 {
            0 => -1.0,
            1 => 0.5,
            _ => random.range(1.1, 3.0),
        };
        push3(row, ahead * (length * reach));
        push3(row, a);
        push3(row, b);
        push3(row, c);
    })
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["segment_inverse"],
            imports: "",
            body: "y_vec3(0u, segment_inverse(x_vec3(0u)));",
            inputs: 3,
            outputs: 3,
            twin: |x, y| push3(y, segment_inverse(vec3(x, 0))),
            oracle: Some(|x, y| {
                y.extend(x[..3].iter().map(|v| {
                    let sign = if *v < 0.0 { -1.0 } else { 1.0 };
                    1.0 / if v.abs() < 1e-20 { sign * 1e-20 } else { *v }
                }));
            }),
            domains: vec![
                domain(
                    "any",
                    rows(850, 300, |random, row| {
                        let size = random.log_range(-6.0, 6.0);
                        push3(row, random.direction() * size);
                    }),
                    ulp(1),
                    ulp(4),
                ),
                domain(
                    "none",
                    vec![0.0, 1.0, -1e-25, 1e-21, 0.0, -2.0],
                    ulp(2),
                    ulp(4),
                ),
            ],
            mutations: vec![
                mutation("vec3<f32>(1.0) / select", "vec3<f32>(1.001) / select"),
                mutation(
                    "vec3<f32>(-MIN_COMPONENT), segment <",
                    "vec3<f32>(MIN_COMPONENT), segment <",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["segment_box"],
            imports: "#import akari_math::segment::segment_inverse",
            body: "y(0u, segment_box(x_vec3(0u), segment_inverse(x_vec3(3u)), x_vec3(6u), x_vec3(9u), x(12u), x(13u)));",
            inputs: 14,
            outputs: 1,
            twin: |x, y| {
                let inverse = segment_inverse(vec3(x, 3));
                y.push(segment_box(
                    vec3(x, 0),
                    inverse,
                    vec3(x, 6),
                    vec3(x, 9),
                    x[12],
                    x[13],
                ));
            },
            oracle: Some(|x, y| {
                let (mut first, mut last) = (x[12], x[13]);
                for k in 0..3 {
                    let (origin, along) = (x[k], x[3 + k]);
                    let (low, high) = (x[6 + k] - origin, x[9 + k] - origin);
                    if along == 0.0 {
                        if low > 0.0 || high < 0.0 {
                            first = f64::INFINITY;
                        }
                        continue;
                    }
                    first = first.max((low / along).min(high / along));
                    last = last.min((low / along).max(high / along));
                }
                y.push(if first <= last { first } else { -1.0 });
            }),
            domains: vec![
                domain("through", boxes(851, true), absolute(2e-6), absolute(2e-6)),
                domain("beside", boxes(852, false), absolute(2e-6), absolute(2e-6)),
            ],
            mutations: vec![
                mutation("max(enter.z, start)", "max(enter.z, 0.5 * start)"),
                mutation("leave.y), leave.z)", "leave.y), leave.y)"),
                mutation("max(max(enter.x, enter.y)", "max(max(enter.y, enter.y)"),
                mutation("min(min(leave.x, leave.y)", "min(min(leave.y, leave.y)"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["segment_triangle"],
            imports: "",
            body: "y(0u, segment_triangle(x_vec3(0u), x_vec3(3u), x_vec3(6u), x_vec3(9u), x_vec3(12u)));",
            inputs: 15,
            outputs: 1,
            twin: |x, y| {
                y.push(segment_triangle(
                    vec3(x, 0),
                    vec3(x, 3),
                    vec3(x, 6),
                    vec3(x, 9),
                    vec3(x, 12),
                ));
            },
            // Möller and Trumbore 1997.
            oracle: Some(|x, y| {
                let (origin, segment, a) = (dvec3(x, 0), dvec3(x, 3), dvec3(x, 6));
                let (ab, ac) = (dvec3(x, 9) - a, dvec3(x, 12) - a);
                let p = segment.cross(ac);
                let inverse = 1.0 / ab.dot(p);
                let s = (origin - a).dot(p) * inverse;
                let q = (origin - a).cross(ab);
                let t = segment.dot(q) * inverse;
                let share = ac.dot(q) * inverse;
                let met = s >= 0.0 && t >= 0.0 && s + t <= 1.0 && share >= 0.0;
                y.push(if met { share } else { -1.0 });
            }),
            domains: vec![
                domain(
                    "through",
                    triangles(853, true),
                    absolute(4e-6),
                    absolute(4e-6),
                ),
                domain(
                    "beside",
                    triangles(854, false),
                    absolute(4e-6),
                    absolute(4e-6),
                ),
            ],
            mutations: vec![
                mutation("min(min(of_a, of_b), of_c)", "min(min(of_a, of_b), of_b)"),
                mutation("max(max(of_a, of_b), of_c)", "max(max(of_b, of_b), of_c)"),
                mutation("dot(normal, a) / along", "dot(normal, a) / (1.001 * along)"),
                mutation("share >= 0.0", "share >= 0.5"),
            ],
        },
    ]
}
