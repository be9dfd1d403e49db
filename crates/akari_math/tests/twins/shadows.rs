//! Rows of `convex_shadow`.

use crate::harness::{Case, Mutation, absolute, domain, push3, rows, vec3};
use akari_math::convex_shadow::*;
use glam::Vec3;

const MODULE: &str = "akari_math::convex_shadow";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: MODULE,
        from,
        to,
    }
}

/// An apex and four corners of a parallelogram, on the other side of the body.
fn scenes(seed: u64, n: usize) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let apex = random.direction() * random.range(1.1, 6.0);
        push3(row, apex);
        let center = -apex * random.range(0.4, 1.2) + random.direction() * random.range(0.0, 1.5);
        let (u, v) = (random.direction() * 2.0, random.direction() * 2.0);
        for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            push3(row, center + a * u + b * v - apex);
        }
    })
}

/// Twice the area vector of what is left, and the sum of heights over it, which a wrong order of vertices changes.
const SUMMARY: &str = "
    var area = vec3<f32>(0.0);
    for (var i = 0u; i < p.count; i++) {
        area += cross(p.vertices[i], p.vertices[(i + 1u) % p.count]);
    }
    y(0u, area.x); y(1u, area.y); y(2u, area.z);";

fn summary(polygon: &ClippedPolygon, y: &mut Vec<f32>) {
    let n = polygon.count as usize;
    let area: Vec3 = (0..n)
        .map(|i| polygon.vertices[i].cross(polygon.vertices[(i + 1) % n]))
        .sum();
    y.extend(area.to_array());
}

fn polygon(x: &[f32]) -> ClippedPolygon {
    let mut polygon = clipped_polygon_new();
    for k in 1..5 {
        clipped_polygon_push(&mut polygon, vec3(x, 3 * k));
    }
    polygon
}

const PUSHED: &str = "var p = clipped_polygon_new();
    for (var k = 1u; k < 5u; k++) { clipped_polygon_push(&p, x_vec3(3u * k)); }";

pub fn cases() -> Vec<Case> {
    // Areas reach 16 · 6; a crossing is off by the rounding of its heights.
    let device = absolute(2e-4);
    let body = |call: &str| -> &'static str {
        Box::leak(format!("{PUSHED} {call} {SUMMARY}").into_boxed_str())
    };
    vec![
        Case {
            module: MODULE,
            functions: &[
                "clipped_polygon_new",
                "clipped_polygon_push",
                "clipped_polygon_cut",
                "component",
                "from_components",
                "box_shadow",
            ],
            imports: "",
            body: body("box_shadow(&p, x_vec3(0u));"),
            inputs: 15,
            outputs: 3,
            twin: |x, y| {
                let mut p = polygon(x);
                box_shadow(&mut p, vec3(x, 0));
                summary(&p, y);
            },
            oracle: None,
            domains: vec![domain("boxes", scenes(91, 1000), absolute(0.0), device)],
            mutations: vec![
                mutation(
                    "select(axis, 0u, axis == 2u)",
                    "select(axis, 1u, axis == 2u)",
                ),
                mutation("t - q, second, p - s", "t - q, second, s - p"),
                mutation("dot(normal, apex) <= 0.0", "dot(normal, apex) > 0.0"),
                mutation("1.0 - abs(at)", "abs(at) - 1.0"),
                mutation("if height_a >= 0.0 {", "if height_a < 0.0 {"),
            ],
        },
        Case {
            module: MODULE,
            functions: &[
                "clipped_polygon_new",
                "clipped_polygon_push",
                "sphere_shadow",
            ],
            imports: "",
            body: body("sphere_shadow(&p, x_vec3(0u));"),
            inputs: 15,
            outputs: 3,
            twin: |x, y| {
                let mut p = polygon(x);
                sphere_shadow(&mut p, vec3(x, 0));
                summary(&p, y);
            },
            oracle: None,
            domains: vec![domain("spheres", scenes(92, 1000), absolute(0.0), device)],
            mutations: vec![
                mutation("0.97367", "1.02"),
                mutation("1.0 / distance - distance", "distance - 1.0 / distance"),
                mutation("k < CONE_PLANES", "k + 1u < CONE_PLANES"),
                mutation("sin(angle) * basis[1]", "sin(angle) * basis[0]"),
            ],
        },
    ]
}
