//! Rows of `voxel::coverage`.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp_of, vec3};
use akari_math::voxel::coverage;
use glam::{DVec3, Vec3};

const COVERAGE: &str = "akari_math::voxel::coverage";

fn mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: COVERAGE,
        from,
        to,
    }
}

/// Area vector and centroid of the part of a triangle in the unit cube, in f64.
fn oracle(triangle: [DVec3; 3]) -> (DVec3, DVec3) {
    let mut polygon = triangle.to_vec();
    for plane in 0..6 {
        let axis = plane / 2;
        let upper = plane % 2 == 1;
        let inside = |p: DVec3| if upper { 1.0 - p[axis] } else { p[axis] };
        let keeps = |d: f64| if upper { d > 0.0 } else { d >= 0.0 };
        let mut next = Vec::new();
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (dp, dq) = (inside(p), inside(q));
            if keeps(dp) {
                next.push(p);
            }
            if keeps(dp) != keeps(dq) {
                next.push(p.lerp(q, dp / (dp - dq)));
            }
        }
        polygon = next;
    }
    if polygon.len() < 3 {
        return (DVec3::ZERO, DVec3::splat(0.5));
    }
    let (mut area, mut weight, mut moment) = (DVec3::ZERO, 0.0, DVec3::ZERO);
    for pair in polygon[1..].windows(2) {
        let part = (pair[0] - polygon[0]).cross(pair[1] - polygon[0]) / 2.0;
        area += part;
        weight += part.length();
        moment += (polygon[0] + pair[0] + pair[1]) / 3.0 * part.length();
    }
    (area, moment / f64::max(weight, f64::MIN_POSITIVE))
}

/// Triangles whose centre is near the cube, of a size. Those of which less than a hundredth lies in the cube, whose
/// centroid is a quotient of small numbers, are left out.
fn triangles(seed: u64, n: usize, size: f32) -> Vec<f32> {
    rows(seed, n, move |random, row| {
        loop {
            let centre = Vec3::splat(0.5) + random.direction() * random.range(0.0, 0.7);
            let [a, b, c] =
                [(); 3].map(|()| centre + random.direction() * size * random.range(0.5, 1.0));
            if oracle([a, b, c].map(|v| v.as_dvec3())).0.length()
                > 0.01 * f64::from(size.min(1.0).powi(2))
            {
                for vertex in [a, b, c] {
                    push3(row, vertex);
                }
                break;
            }
        }
    })
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: COVERAGE,
            functions: &["triangle_in_cube"],
            imports: "",
            body: "let covered = triangle_in_cube(x_vec3(0u), x_vec3(3u), x_vec3(6u));
                y_vec3(0u, covered.area); y_vec3(3u, covered.centroid);",
            inputs: 9,
            outputs: 6,
            twin: |x, y| {
                let covered = coverage::triangle_in_cube(vec3(x, 0), vec3(x, 3), vec3(x, 6));
                push3(y, covered.area);
                push3(y, covered.centroid);
            },
            oracle: Some(|x, y| {
                let (area, centroid) = oracle([dvec3(x, 0), dvec3(x, 3), dvec3(x, 6)]);
                y.extend(area.to_array());
                y.extend(centroid.to_array());
            }),
            domains: vec![
                domain(
                    "smaller than the cube",
                    triangles(500, 300, 0.4),
                    absolute(1e-6),
                    ulp_of(8, 1.0),
                ),
                domain(
                    "as large as the cube",
                    triangles(501, 400, 1.0),
                    absolute(2e-6),
                    ulp_of(16, 1.0),
                ),
                domain(
                    "much larger",
                    triangles(502, 400, 50.0),
                    absolute(1e-4),
                    absolute(1e-4),
                ),
            ],
            mutations: vec![
                mutation("1.0 - coordinate", "1.001 - coordinate"),
                mutation("plane < 6u", "plane < 5u"),
                mutation("doubled * 0.5", "doubled * 0.5001"),
                mutation("(1.0 / 3.0)", "0.3334"),
            ],
        },
        Case {
            module: COVERAGE,
            functions: &["inside_of_plane", "is_inside_of_plane"],
            imports: "",
            body: "for (var plane = 0u; plane < 6u; plane += 1u) {
                    let distance = inside_of_plane(x_vec3(0u), plane);
                    y(2u * plane, distance);
                    y(2u * plane + 1u, f32(is_inside_of_plane(distance, plane)));
                }",
            inputs: 3,
            outputs: 12,
            twin: |x, y| {
                for plane in 0..6 {
                    let distance = coverage::inside_of_plane(vec3(x, 0), plane);
                    y.push(distance);
                    y.push(f32::from(u8::from(coverage::is_inside_of_plane(
                        distance, plane,
                    ))));
                }
            },
            oracle: None,
            domains: vec![domain(
                "around the cube, and on its planes",
                rows(503, 100, |random, row| {
                    push3(row, random.direction() * random.range(0.0, 2.0));
                    row.extend([0.0, 1.0, random.range(-1.0, 2.0)]);
                }),
                absolute(0.0),
                ulp_of(1, 1.0),
            )],
            mutations: vec![
                mutation(
                    "distance >= 0.0, distance > 0.0",
                    "distance > 0.0, distance > 0.0",
                ),
                mutation(
                    "distance >= 0.0, distance > 0.0",
                    "distance >= 0.0, distance >= 0.0",
                ),
            ],
        },
    ]
}
