//! Rows of `reflector`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, vec3};
use akari_math::reflector::{
    image_sharpness, lobe_landing, tail_sharpness, triangle_weights, unbent_point,
};
use glam::{DQuat, DVec3};

const MODULE: &str = "akari_math::reflector";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

/// The nearest point of a triangle, by its region.
fn nearest(point: DVec3, a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let foot = point - normal * (point - a).dot(normal) / normal.length_squared();
    let inside = |p: DVec3, q: DVec3| (q - p).cross(foot - p).dot(normal) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        return foot;
    }
    let on_edge = |p: DVec3, q: DVec3| {
        let t = (point - p).dot(q - p) / (q - p).length_squared();
        p + (q - p) * t.clamp(0.0, 1.0)
    };
    [on_edge(a, b), on_edge(b, c), on_edge(c, a)]
        .into_iter()
        .min_by(|p, q| {
            p.distance_squared(point)
                .total_cmp(&q.distance_squared(point))
        })
        .expect("three edges")
}

/// Corners of triangles that are no slivers, and a point.
fn triangles(seed: u64, far: f32) -> Vec<f32> {
    rows(seed, 600, |random, row| {
        let point = random.direction() * random.range(0.0, far);
        push3(row, point);
        let u = random.direction();
        let v = u.any_orthonormal_vector();
        let at = random.direction() * 0.5;
        push3(row, at);
        push3(row, at + u * random.range(0.3, 1.0));
        push3(
            row,
            at + v * random.range(0.3, 1.0) + u * random.range(-0.5, 0.5),
        );
    })
}

/// An axis at an angle to the way down, and a triangle whose plane is 0.5 to 2 below the origin.
fn in_front(seed: u64, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, 500, |random, row| {
        let normal = random.direction();
        let angle = random.range(lo, hi);
        let axis = random.around(-normal, angle);
        push3(row, axis);
        let u = normal.any_orthonormal_vector();
        let at = -normal * random.range(0.5, 2.0);
        push3(row, at);
        push3(row, at + u);
        push3(row, at + normal.cross(u));
    })
}

/// A point, a normal, and one as far from it as the range.
fn normals(seed: u64, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, 300, |random, row| {
        push3(row, random.direction() * random.log_range(-2.0, 1.0));
        let normal = random.direction();
        push3(row, normal);
        let angle = random.range(lo, hi);
        push3(row, random.around(normal, angle));
    })
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: MODULE,
            functions: &["unbent_point"],
            imports: "",
            body: "y_vec3(0u, unbent_point(x_vec3(0u), x_vec3(3u), x_vec3(6u)));",
            inputs: 9,
            outputs: 3,
            twin: |x, y| push3(y, unbent_point(vec3(x, 0), vec3(x, 3), vec3(x, 6))),
            oracle: Some(|x, y| {
                // Twice turned as the normals are to each other.
                let (normal, flat) = (dvec3(x, 3).normalize(), dvec3(x, 6).normalize());
                let turn = DQuat::from_rotation_arc(normal, flat);
                y.extend((turn * (turn * dvec3(x, 0))).to_array());
            }),
            domains: vec![
                domain("one", normals(805, 0.0, 0.0), absolute(4e-6), absolute(4e-6)),
                domain("near", normals(806, 0.0, 0.3), absolute(8e-6), absolute(8e-6)),
                domain("any", normals(807, 0.3, 3.0), absolute(1e-5), absolute(1e-5)),
            ],
            mutations: vec![
                mutation("(2.0 * dot(point, normal)) * normal", "(1.99 * dot(point, normal)) * normal"),
                mutation("(2.0 * dot(mirrored, flat)) * flat", "(2.0 * dot(point, flat)) * flat"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["triangle_weights"],
            imports: "",
            body: "let weights = triangle_weights(x_vec3(0u), x_vec3(3u), x_vec3(6u), x_vec3(9u));
                y_vec3(0u, weights.x * x_vec3(3u) + weights.y * x_vec3(6u) + weights.z * x_vec3(9u));",
            inputs: 12,
            outputs: 3,
            twin: |x, y| {
                let (a, b, c) = (vec3(x, 3), vec3(x, 6), vec3(x, 9));
                let weights = triangle_weights(vec3(x, 0), a, b, c);
                push3(y, weights.x * a + weights.y * b + weights.z * c);
            },
            oracle: Some(|x, y| {
                let point = nearest(dvec3(x, 0), dvec3(x, 3), dvec3(x, 6), dvec3(x, 9));
                y.extend(point.to_array());
            }),
            domains: vec![
                domain("near", triangles(800, 1.0), absolute(4e-6), absolute(2e-6)),
                domain("far", triangles(801, 50.0), absolute(2e-4), absolute(1e-4)),
            ],
            mutations: vec![
                mutation("of_b + of_c <= 1.0", "of_b + of_c <= 0.9"),
                // From afar a corner is nearest, mostly.
                mutation(
                    "vec3<f32>(1.0 - along_ab, along_ab, 0.0)",
                    "vec3<f32>(1.0 - along_ab, 0.9 * along_ab, 0.0)",
                ),
                mutation("dot(bc, bc), TINY), 0.0, 1.0", "dot(bc, bc), TINY), 0.1, 1.0"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["lobe_landing"],
            imports: "",
            body: "y_vec3(0u, lobe_landing(x_vec3(0u), x_vec3(3u), x_vec3(6u), x_vec3(9u)));",
            inputs: 12,
            outputs: 3,
            twin: |x, y| push3(y, lobe_landing(vec3(x, 0), vec3(x, 3), vec3(x, 6), vec3(x, 9))),
            oracle: Some(|x, y| {
                let (axis, a) = (dvec3(x, 0), dvec3(x, 3));
                let normal = (dvec3(x, 6) - a).cross(dvec3(x, 9) - a).normalize();
                let down = (-normal.dot(axis)).max(0.01);
                y.extend((axis * (-normal.dot(a) / down)).to_array());
            }),
            domains: vec![
                domain("down", in_front(802, 0.0, 1.3), absolute(2e-5), absolute(2e-5)),
                domain(
                    "along and away",
                    in_front(804, 1.3, 3.1),
                    absolute(2e-3),
                    absolute(2e-3),
                ),
            ],
            mutations: vec![
                mutation("max(-dot(normal, a), 0.0)", "max(-dot(normal, a * 1.01), 0.0)"),
                mutation("MIN_DESCENT * size", "2.0 * MIN_DESCENT * size"),
            ],
        },
        Case {
            module: MODULE,
            functions: &["image_sharpness", "tail_sharpness"],
            imports: "",
            body: "y(0u, image_sharpness(x(0u), x(1u))); y(1u, tail_sharpness(x(2u), x(3u)));",
            inputs: 4,
            outputs: 2,
            twin: |x, y| {
                y.push(image_sharpness(x[0], x[1]));
                y.push(tail_sharpness(x[2], x[3]));
            },
            oracle: Some(|x, y| {
                let sharpness = std::f64::consts::TAU * x[0].max(0.0) / x[1].max(1e-30);
                y.push(sharpness.min(1e8));
                y.push(x[2] / (1.0 + 0.5 * x[2] * x[3]));
            }),
            domains: vec![
                domain(
                    "any",
                    rows(803, 300, |random, row| {
                        row.push(random.range(0.0, 1.0));
                        row.push(random.log_range(-6.0, 1.0));
                        row.push(random.log_range(-3.0, 7.0));
                        row.push(random.range(0.0, 2.0));
                    }),
                    ulp(4),
                    ulp(4),
                ),
                domain(
                    "ends",
                    vec![0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1e8, 2.0, -1.0, 1.0, 1e8, 0.0],
                    ulp(4),
                    ulp(4),
                ),
            ],
            mutations: vec![
                mutation("min(TWO_PI *", "min(2.0 * TWO_PI *"),
                mutation("0.5 * sharpness * offset", "0.51 * sharpness * offset"),
            ],
        },
    ]
}
