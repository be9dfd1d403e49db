//! Rows of `sg::mirrored_light`, and the light of a glossy wall on a floor.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, ulp, vec3};
use akari_math::oracle;
use akari_math::sg::mirrored_light::{sg_mirrored_direction, sg_mirrored_light};
use akari_math::sg::polygon::sg_polygon_integral;
use glam::DVec3;

const MODULE: &str = "akari_math::sg::mirrored_light";

/// A receiver and a light above a plane, its normal, a width.
fn above(seed: u64, n: usize, lo: f32, hi: f32) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let normal = random.direction();
        for _ in 0..2 {
            let side = random.around(normal, std::f32::consts::FRAC_PI_2);
            let height = random.log_range(lo, hi);
            push3(row, normal * height + side * random.range(0.0, 2.0));
        }
        push3(row, normal);
        row.push(random.range(0.0, 1.0));
    })
}

pub fn cases() -> Vec<Case> {
    let mutation = |from, to| Mutation {
        module: MODULE,
        from,
        to,
    };
    vec![
        Case {
            module: MODULE,
            functions: &["sg_mirrored_light"],
            imports: "",
            body: "let lobe = sg_mirrored_light(x_vec3(0u), x_vec3(3u), x_vec3(6u), x(9u));
                y_vec3(0u, lobe.axis); y(3u, lobe.inverse_sharpness);",
            inputs: 10,
            outputs: 4,
            twin: |x, y| {
                let lobe = sg_mirrored_light(vec3(x, 0), vec3(x, 3), vec3(x, 6), x[9]);
                push3(y, lobe.axis);
                y.push(lobe.inverse_sharpness);
            },
            // By the angle of incidence and the distances, as derived.
            oracle: Some(|x, y| {
                let (receiver, light, normal) = (dvec3(x, 0), dvec3(x, 3), dvec3(x, 6));
                let image = light - 2.0 * normal.dot(light) * normal / normal.length_squared();
                let axis = (image - receiver).normalize();
                let cosine = -axis.dot(normal);
                let to_receiver = normal.dot(receiver) / cosine;
                let to_light = normal.dot(light) / cosine;
                let ratio = 1.0 + to_receiver / to_light;
                y.extend(axis.to_array());
                y.push(2.0 * x[9] * x[9] * cosine / (ratio * ratio));
            }),
            domains: vec![
                domain(
                    "heights of 0.1 to 3",
                    above(700, 600, -1.0, 0.5),
                    absolute(4e-6),
                    absolute(2e-6),
                ),
                domain(
                    "heights of 1e-4 to 0.1",
                    above(701, 400, -4.0, -1.0),
                    absolute(1e-5),
                    absolute(1e-5),
                ),
            ],
            mutations: vec![
                mutation(
                    "2.0 * light_height * normal",
                    "2.001 * light_height * normal",
                ),
                mutation("(light_height / heights)", "(receiver_height / heights)"),
                mutation(
                    "max(dot(normal, light), 0.0)",
                    "max(dot(normal, light), 0.01)",
                ),
            ],
        },
        Case {
            module: MODULE,
            functions: &["sg_mirrored_light"],
            imports: "",
            body: "let lobe = sg_mirrored_light(x_vec3(0u), x_vec3(3u), x_vec3(6u), x(9u));
                y_vec3(0u, lobe.axis); y(3u, lobe.inverse_sharpness);",
            inputs: 10,
            outputs: 4,
            twin: |x, y| {
                let lobe = sg_mirrored_light(vec3(x, 0), vec3(x, 3), vec3(x, 6), x[9]);
                push3(y, lobe.axis);
                y.push(lobe.inverse_sharpness);
            },
            // Nothing but finite numbers.
            oracle: None,
            domains: vec![domain(
                "in the plane, below it, at one place",
                [[0.0, 0.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]
                    .into_iter()
                    .flat_map(|[a, b]| [0.3, 0.3, a, 0.3, 0.3, b, 0.0, 0.0, 1.0, 0.5])
                    .collect(),
                ulp(0),
                ulp(4),
            )],
            mutations: vec![mutation(
                "max(dot(normal, light), 0.0)",
                "max(dot(normal, light), 0.01)",
            )],
        },
        Case {
            module: MODULE,
            functions: &["sg_mirrored_direction"],
            imports: "",
            body: "let lobe = sg_mirrored_direction(x_vec3(0u), x_vec3(3u), x(6u));
                y_vec3(0u, lobe.axis); y(3u, lobe.inverse_sharpness);",
            inputs: 7,
            outputs: 4,
            twin: |x, y| {
                let lobe = sg_mirrored_direction(vec3(x, 0), vec3(x, 3), x[6]);
                push3(y, lobe.axis);
                y.push(lobe.inverse_sharpness);
            },
            // What a source very far away tends to.
            oracle: Some(|x, y| {
                let (to_light, normal) = (dvec3(x, 0), dvec3(x, 3));
                let cosine = normal.dot(to_light);
                let axis = to_light - 2.0 * cosine * normal / normal.length_squared();
                y.extend(axis.normalize().to_array());
                y.push(2.0 * x[6] * x[6] * cosine);
            }),
            domains: vec![domain(
                "above",
                rows(702, 400, |random, row| {
                    let normal = random.direction();
                    let angle = random.range(0.0, 1.5);
                    push3(row, random.around(normal, angle));
                    push3(row, normal);
                    row.push(random.range(0.0, 1.0));
                }),
                absolute(1e-6),
                absolute(1e-6),
            )],
            mutations: vec![mutation(
                "2.0 * cosine * normal",
                "2.0001 * cosine * normal",
            )],
        },
    ]
}

/// A wall at x = 0, 2 m by 2 m, that a lamp lights and that lights the floor at z = 0.
const LIGHT: DVec3 = DVec3::new(0.9, 0.2, 1.1);
const WALL: DVec3 = DVec3::X;

/// Radiance from a point of the wall to a point of the floor, for a lamp of 1 cd and a mirror's Fresnel term.
fn wall_radiance(point: DVec3, floor: DVec3, alpha: f64) -> f64 {
    let (view, to_light) = ((floor - point).normalize(), LIGHT - point);
    let incident = to_light.normalize();
    let (n_dot_v, n_dot_l) = (WALL.dot(view), WALL.dot(incident));
    let brdf = oracle::ggx_ndf(WALL, view + incident, alpha)
        * oracle::smith_masking_shadowing(n_dot_v, n_dot_l, alpha)
        / (4.0 * n_dot_v * n_dot_l);
    brdf * n_dot_l / to_light.length_squared()
}

/// Irradiance on the floor, by midpoints over the wall.
fn exact(floor: DVec3, alpha: f64) -> f64 {
    const SIDE: usize = 400;
    let step = 2.0 / SIDE as f64;
    let mut sum = 0.0;
    for i in 0..SIDE {
        for j in 0..SIDE {
            let point = DVec3::new(0.0, (i as f64 + 0.5) * step - 1.0, (j as f64 + 0.5) * step);
            let offset = point - floor;
            let direction = offset.normalize();
            sum += wall_radiance(point, floor, alpha) * direction.z * -WALL.dot(direction)
                / offset.length_squared();
        }
    }
    sum * step * step
}

/// The same by lobes: the wall in `parts × parts` squares.
fn by_lobes(floor: DVec3, alpha: f64, parts: usize) -> f64 {
    let lobe = sg_mirrored_light(
        floor.as_vec3(),
        LIGHT.as_vec3(),
        WALL.as_vec3(),
        alpha as f32,
    );
    let axis = lobe.axis.as_dvec3();
    let sharpness = 1.0 / f64::from(lobe.inverse_sharpness);
    let hit = floor + axis * (floor.x / -axis.x);
    let size = 2.0 / parts as f64;
    let mut sum = 0.0;
    for i in 0..parts {
        for j in 0..parts {
            let (y, z) = (i as f64 * size - 1.0, j as f64 * size);
            // Counter-clockwise as seen from the floor.
            let corners = [(y, z), (y + size, z), (y + size, z + size), (y, z + size)]
                .map(|(y, z)| (DVec3::new(0.0, y, z) - floor).as_vec3());
            let nearest = DVec3::new(0.0, hit.y.clamp(y, y + size), hit.z.clamp(z, z + size));
            let direction = (nearest - floor).normalize();
            let exponent = 0.5 * sharpness * (direction - axis).length_squared();
            let amplitude = wall_radiance(nearest, floor, alpha) * exponent.min(30.0).exp();
            // The floor's frame is the world's.
            let integral = sg_polygon_integral(&corners, lobe.axis, sharpness as f32, 4);
            sum += amplitude * direction.z * f64::from(integral);
        }
    }
    sum
}

fn relative_rmse(alpha: f64, parts: usize) -> f64 {
    let (mut difference, mut square) = (0.0, 0.0);
    for x in [0.1, 0.4, 0.8, 1.2, 1.9] {
        for y in [-0.7, 0.0, 0.5] {
            let floor = DVec3::new(x, y, 0.0);
            let truth = exact(floor, alpha);
            difference += (by_lobes(floor, alpha, parts) - truth).powi(2);
            square += truth * truth;
        }
    }
    f64::sqrt(difference / square)
}

#[test]
fn glossy_wall_lights_a_floor() {
    let mut failures = Vec::new();
    for (alpha, limits) in [
        (0.05, [0.012, 0.022]),
        (0.1, [0.027, 0.045]),
        (0.2, [0.06, 0.058]),
        (0.4, [0.14, 0.2]),
        (0.7, [0.07, 0.16]),
        (1.0, [0.24, 0.07]),
    ] {
        let errors = [relative_rmse(alpha, 1), relative_rmse(alpha, 8)];
        println!("alpha {alpha}: relative RMSE {errors:.4?} of 1 and of 64 polygons");
        if errors[0] > limits[0] || errors[1] > limits[1] {
            failures.push(format!("alpha {alpha}: {errors:?} above {limits:?}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
