//! Polygons of light under a clamped cosine and under GGX, and what bounds them.

use crate::table::*;
use akari_math::area_light::{diffuse_specular_combine, range_falloff};
use akari_math::light_image::light_image_footprint;
use akari_math::ltc::lookup::{ltc_m, ltc_m_inv, ltc_specular_integral};
use akari_math::ltc::polygon::{form_factor, ltc_form_factor};
use akari_math::ltc::table;
use akari_math::oracle;
use akari_math::tile_bounds::solid_angle_bound;
use glam::{DMat3, DVec3, Mat3, Vec2, Vec3, Vec4};

const CORNERS: usize = 4;
/// What the project promises of the cosine's integral.
const PROMISED: f64 = 5e-7;

pub fn rows() -> Vec<Row> {
    vec![
        polygons(),
        in_the_world(),
        reflected(),
        falloff(),
        radiance(),
        culling(),
        footprint(),
    ]
}

pub fn guards() -> Vec<Guard> {
    let guard = |what, row, module, from, to| Guard {
        what,
        row,
        module,
        from,
        to,
    };
    vec![
        guard(
            "the scaling before vectors are made unit",
            "polygon of light",
            "akari_math::special",
            "    return v / largest;",
            "    return v;",
        ),
        guard(
            "the floor of an edge's sine",
            "polygon of light",
            "akari_math::form_factor",
            "max(sine, MIN_SINE)",
            "sine",
        ),
        guard(
            "the clip at the horizon of the surface",
            "polygon of light",
            "akari_math::polygon",
            "select(0u, 1u, vertex.z > ON_PLANE * max_abs_component(vertex))",
            "1u",
        ),
        guard(
            "the points inside the light's bounding sphere",
            "bound for culling",
            "akari_math::tile_bounds",
            "if gap <= 0.0 {",
            "if gap < -1e30 {",
        ),
    ]
}

fn push(row: &mut Vec<f32>, polygon: [Vec3; CORNERS], m_inv: Mat3) {
    for corner in polygon {
        push3(row, corner);
    }
    row.extend(m_inv.to_cols_array());
}

/// A rectangle in the plane through `center` with these two directions.
fn rectangle(center: Vec3, u: Vec3, v: Vec3) -> [Vec3; CORNERS] {
    [
        center - u - v,
        center + u - v,
        center + u + v,
        center - u + v,
    ]
}

fn corners(x: &[f32]) -> [Vec3; CORNERS] {
    std::array::from_fn(|i| vec3(x, 3 * i))
}

fn corners_wide(x: &[f64]) -> Vec<DVec3> {
    (0..CORNERS).map(|i| dvec3(x, 3 * i)).collect()
}

fn matrix(x: &[f32], i: usize) -> Mat3 {
    Mat3::from_cols(vec3(x, i), vec3(x, i + 3), vec3(x, i + 6))
}

fn matrix_wide(x: &[f64], i: usize) -> DMat3 {
    DMat3::from_cols(dvec3(x, i), dvec3(x, i + 3), dvec3(x, i + 6))
}

const LIGHT: &str = "#import akari_math::ltc::polygon::{LtcPolygon, ltc_polygon_new, ltc_polygon_add_edge, ltc_polygon_close}
fn light(m_inv: mat3x3<f32>, origin: vec3<f32>) -> LtcPolygon {
    var polygon = ltc_polygon_new();
    for (var i = 0u; i < 4u; i++) {
        ltc_polygon_add_edge(&polygon, m_inv, x_vec3(3u * i) - origin, x_vec3(3u * ((i + 1u) % 4u)) - origin);
    }
    ltc_polygon_close(&polygon, m_inv);
    return polygon;
}";

/// Integrals of the cosine and of the transformed cosine.
fn polygons() -> Row {
    let transforms = [
        ("cosine", Mat3::IDENTITY),
        ("rough", ltc_m_inv(Vec4::new(1.1, -0.25, 0.2, 0.9), 1.0)),
        ("skewed", ltc_m_inv(Vec4::new(0.9, -0.5, 0.25, 0.45), 1.0)),
    ];
    let mut sweeps = Vec::new();
    for (transform, m_inv) in transforms {
        // Needles and strips are beyond the promise. Of a strip that is longer than a thousand distances the two ends are
        // nearly opposite, and their rounding turns the plane between them.
        let bound = |name: &str| {
            absolute(match name {
                "needles" | "strips" => 4.0 * PROMISED,
                "strips without end" => 1e-3,
                _ => PROMISED,
            })
        };
        let mut add = |name: &str, make: &dyn Fn(f32) -> [Vec3; CORNERS], values: &[f32]| {
            sweeps.push(sweep(
                format!("{name}, {transform}"),
                bound(name),
                samples(values, |value, row| push(row, make(value), m_inv)),
            ));
        };
        let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
        let micro: Vec<f32> = (-300..=300).map(|i| i as f32 * 1e-6).collect();
        let standing = |h: f32| rectangle(Vec3::new(0.1, 1.0, h), 0.4 * x, 0.3 * z);
        add("sinks through the horizon", &|h| standing(0.3 + h), &micro);
        add("rises through the horizon", &|h| standing(h - 0.3), &micro);
        add(
            "from the zenith to the nadir",
            &standing,
            &steps(2.0, -2.0, 400),
        );
        add(
            "lying, down to the surface and below it",
            &|h| rectangle(Vec3::new(0.2, -0.1, h), x, y),
            &through_zero(1.0, 120)
                .into_iter()
                .filter(|h: &f32| h.abs() > 2e-6)
                .collect::<Vec<_>>(),
        );
        add(
            "the point through the light's plane",
            &|d| rectangle(Vec3::new(d, 0.4, 0.5), 0.3 * y, 0.3 * z),
            &through_zero(1.0, 120),
        );
        add(
            "an edge through the point",
            &|d| rectangle(Vec3::new(0.5 + d, 0.0, 0.0), 0.5 * x, 0.5 * z),
            // Up to the edge: a point in a light's plane and inside of the light sees it from neither side.
            &through_zero(1e-2, 60)
                .into_iter()
                .filter(|&d| d >= 0.0)
                .collect::<Vec<_>>(),
        );
        add(
            "a corner through the point",
            &|d| rectangle(Vec3::new(0.5 + d, 0.5 + d, 0.2), 0.5 * x, 0.5 * y),
            &through_zero(1e-2, 60),
        );
        let tilt = (y + 0.3 * z).normalize();
        let sizes = log_steps(-12.0, 5.0, 170);
        add(
            "tiny to huge",
            &|s| rectangle(Vec3::new(0.3, 0.2, 0.8), s * x, s * tilt),
            &sizes,
        );
        let strip = |s: f32| rectangle(Vec3::new(0.3, 0.2, 0.8), 0.5 * x, s * tilt);
        let thin = |s: f32| rectangle(Vec3::new(0.3, 0.2, 0.8), x / s, s * tilt);
        add("needles", &strip, &log_steps(-12.0, 0.0, 120));
        add("strips", &strip, &log_steps(0.0, 2.0, 60));
        add("strips", &thin, &log_steps(-2.0, 2.0, 120));
        for ends in [log_steps(-5.0, -2.0, 90), log_steps(2.0, 5.0, 90)] {
            add("strips without end", &strip, &ends);
            add("strips without end", &thin, &ends);
        }
        add(
            "scale of the scene",
            &|s| rectangle(Vec3::new(0.3, 0.2, 0.8), 0.5 * x, 0.4 * tilt).map(|v| v * s),
            &log_steps(-12.0, 12.0, 240),
        );
        add(
            "away to 1e12",
            &|s| rectangle(Vec3::new(0.3, 0.2, 0.8) * s, 0.5 * x, 0.4 * tilt),
            &log_steps(0.0, 12.0, 120),
        );
    }
    let nothing = [
        [Vec3::ZERO; 4],
        [Vec3::Z; 4],
        [
            Vec3::X + Vec3::Z,
            Vec3::Y + Vec3::Z,
            Vec3::X + Vec3::Z,
            Vec3::Y + Vec3::Z,
        ],
        [Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y],
        [
            Vec3::splat(-1.0),
            Vec3::new(1.0, -1.0, -1.0),
            Vec3::new(1.0, 1.0, -1.0),
            -Vec3::Z,
        ],
    ];
    sweeps.push(sweep(
        "without an area",
        absolute(PROMISED),
        samples(&nothing, |polygon, row| push(row, polygon, Mat3::IDENTITY)),
    ));
    let odd = [
        [
            Vec3::Z * 3e38,
            Vec3::X * 3e38,
            Vec3::Y * 3e38,
            Vec3::splat(3e38),
        ],
        [Vec3::Z * 1e38, Vec3::X * 1e-38, Vec3::Y + Vec3::Z, Vec3::Z],
        [Vec3::Z + Vec3::X, -Vec3::Z - Vec3::X, Vec3::Y, -Vec3::Y],
        [Vec3::ZERO, Vec3::Z + Vec3::X, Vec3::ZERO, Vec3::Y],
        // Below 1e-30 a vector has no direction.
        [
            Vec3::splat(1e-40),
            Vec3::Z * 1e-40,
            Vec3::X * 1e-40,
            Vec3::Y * 1e-40,
        ],
        // Lying on the surface, within its rounding, and about the point; inside of a light, in its plane.
        [(-0.8, -1.1), (1.2, -1.1), (1.2, 0.9), (-0.8, 0.9)].map(|(x, y)| Vec3::new(x, y, 1e-9)),
        rectangle(Vec3::new(0.1, 0.0, 0.0), 0.5 * Vec3::X, 0.5 * Vec3::Z),
    ];
    let mut input = Vec::new();
    for polygon in odd {
        for m_inv in [Mat3::IDENTITY, Mat3::ZERO, transforms[2].1] {
            push(&mut input, polygon, m_inv);
        }
    }
    sweeps.push(sweep("no polygon at all", ANY, input));
    Row {
        name: "polygon of light",
        source: Source {
            header: LIGHT.to_owned(),
            body: "let m_inv = mat3x3<f32>(x_vec3(12u), x_vec3(15u), x_vec3(18u));
                let polygon = light(m_inv, vec3<f32>(0.0));
                y(0u, polygon.diffuse.z); y(1u, polygon.specular.z);",
        },
        inputs: 21,
        outputs: 2,
        twin: |x, y| {
            y.push(form_factor(&corners(x)).z);
            y.push(ltc_form_factor(&corners(x), matrix(x, 12)).z);
        },
        oracle: |x, y| {
            y.push(oracle::form_factor(&corners_wide(x)).z);
            y.push(oracle::ltc_form_factor(&corners_wide(x), matrix_wide(x, 12)).z);
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps,
    }
}

/// Point and light far from the origin: positions lose digits there, their difference must not lose more.
fn in_the_world() -> Row {
    let mut sweeps = Vec::new();
    for far in [0.0_f32, 1e3, 1e6, 1e9] {
        for size in [0.5_f32, 8.0, 1e3] {
            sweeps.push(sweep(
                format!("{far:e} m from the origin, light of {size} m"),
                absolute(PROMISED),
                samples(&steps(0.2, 3.0, 150), |height, row| {
                    let origin = Vec3::new(far, -0.7 * far, 0.4 * far);
                    let center = origin + Vec3::new(0.3, 0.2, height) * size;
                    for corner in rectangle(center, 0.5 * size * Vec3::X, 0.5 * size * Vec3::Y) {
                        push3(row, corner);
                    }
                    push3(row, origin);
                }),
            ));
        }
    }
    Row {
        name: "polygon of light in the world",
        source: Source {
            header: LIGHT.to_owned(),
            body: "let m_inv = mat3x3<f32>(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0));
                y(0u, light(m_inv, x_vec3(12u)).diffuse.z);",
        },
        inputs: 15,
        outputs: 1,
        twin: |x, y| {
            let origin = vec3(x, 12);
            y.push(form_factor(&corners(x).map(|v| v - origin)).z);
        },
        oracle: |x, y| {
            let origin = dvec3(x, 12);
            let relative: Vec<DVec3> = corners_wide(x).into_iter().map(|v| v - origin).collect();
            y.push(oracle::form_factor(&relative).z);
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps,
    }
}

/// The whole specular integral with the shipped table, from a mirror to rough and from the normal to grazing.
///
/// Inputs: corners, texel of the transform, tail, n·v.
fn reflected() -> Row {
    let push = |polygon: [Vec3; CORNERS], roughness: f32, n_dot_v: f32, row: &mut Vec<f32>| {
        let sample = table::sample(roughness, n_dot_v);
        for corner in polygon {
            push3(row, corner);
        }
        row.extend(sample.texel0.to_array());
        row.extend([sample.texel1.z, sample.texel1.w, n_dot_v]);
    };
    let about_mirror = |n_dot_v: f32, size: f32| {
        let sine = (1.0 - n_dot_v * n_dot_v).max(0.0).sqrt();
        let mirror = Vec3::new(-sine, 0.0, n_dot_v.max(0.05));
        // Counter-clockwise as seen from the point.
        rectangle(
            mirror * 2.0,
            Vec3::Y * -size,
            mirror.cross(Vec3::Y).normalize() * size,
        )
    };
    let mut sweeps = Vec::new();
    for n_dot_v in [1.0_f32, 0.9, 0.5, 0.1, 1e-3, 0.0] {
        for size in [0.02_f32, 0.5, 20.0] {
            // A lobe of width alpha magnifies the rounding of directions by up to 1 / alpha.
            for (name, roughnesses, error) in [
                ("roughness 0.3 to 1", steps(0.3, 1.0, 140), 2e-6),
                ("roughness 0 to 0.3", steps(0.0, 0.3, 120), 4e-4),
            ] {
                sweeps.push(sweep(
                    format!("{name}, n·v {n_dot_v:e}, light of {size} m"),
                    absolute(error),
                    samples(&roughnesses, |roughness, row| {
                        push(about_mirror(n_dot_v, size), roughness, n_dot_v, row);
                    }),
                ));
            }
        }
    }
    for roughness in [0.0_f32, 0.1, 0.5, 1.0] {
        sweeps.push(sweep(
            format!("from the normal to grazing, roughness {roughness}"),
            absolute(if roughness < 0.3 { 4e-4 } else { 2e-6 }),
            samples(&steps(1.0, 0.0, 200), |n_dot_v, row| {
                push(about_mirror(n_dot_v, 0.5), roughness, n_dot_v, row);
            }),
        ));
    }
    Row {
        name: "reflected light",
        source: Source {
            header: format!(
                "{LIGHT}\n#import akari_math::ltc::lookup::{{ltc_m_inv, ltc_specular_integral}}"
            ),
            body: "let m_inv = ltc_m_inv(x_vec4(12u), x(18u));
                let polygon = light(m_inv, vec3<f32>(0.0));
                y(0u, ltc_specular_integral(polygon.specular.z, polygon.diffuse, m_inv, x_vec2(16u)));",
        },
        inputs: 19,
        outputs: 1,
        twin: |x, y| {
            let m_inv = ltc_m_inv(Vec4::new(x[12], x[13], x[14], x[15]), x[18]);
            let polygon = corners(x);
            let specular = ltc_form_factor(&polygon, m_inv).z;
            y.push(ltc_specular_integral(
                specular,
                form_factor(&polygon),
                m_inv,
                Vec2::new(x[16], x[17]),
            ));
        },
        oracle: |x, y| {
            let c = x[18].clamp(0.0, 1.0);
            let s = ((1.0 - c) * (1.0 + c)).sqrt();
            // The lobe's transform in the frame of the mirror direction, turned into that of the surface.
            let turn = DMat3::from_cols(
                DVec3::new(c, 0.0, -s),
                DVec3::Y,
                DVec3::new(s, 0.0, c),
            );
            let own = DMat3::from_cols(
                DVec3::new(x[12], 0.0, x[14]),
                DVec3::Y,
                DVec3::new(x[13], 0.0, x[15]),
            );
            let m_inv = own * turn;
            let polygon = corners_wide(x);
            let diffuse = oracle::form_factor(&polygon);
            let column = m_inv.x_axis;
            let norm = 0.5 + 0.5 * column.x / (column.x * column.x + column.z * column.z).sqrt();
            let lobe = (1.0 - x[16]) / norm * oracle::ltc_form_factor(&polygon, m_inv).z;
            y.push((lobe + x[16] * diffuse.z + x[17] * diffuse.x).max(0.0));
        },
        // Lobe and tail add up to 1 over the hemisphere, to what the fit leaves.
        range: [0.0, 1.05],
        sweeps,
    }
}

fn falloff() -> Row {
    let mut sweeps = Vec::new();
    for inverse_range_squared in [0.0_f32, 1e-30, 1e-12, 1e-4, 1.0, 1e6, 1e18] {
        sweeps.push(sweep(
            format!("1/range² {inverse_range_squared:e}"),
            absolute(1e-6),
            samples(&log_steps(-20.0, 20.0, 400), |distance_squared, row| {
                row.extend([distance_squared, inverse_range_squared]);
            }),
        ));
    }
    Row {
        name: "range of a light",
        source: Source {
            header: "#import akari_math::area_light::range_falloff".to_owned(),
            body: "y(0u, range_falloff(x(0u), x(1u)));",
        },
        inputs: 2,
        outputs: 1,
        twin: |x, y| y.push(range_falloff(x[0], x[1])),
        oracle: |x, y| {
            let ratio = (x[0] * x[1]).min(1.0);
            y.push((1.0 - ratio * ratio).powi(2));
        },
        range: [0.0, 1.0],
        sweeps,
    }
}

/// Subnormal to huge radiance: what is reflected stays in proportion to it.
fn radiance() -> Row {
    let mut sweeps = Vec::new();
    for (diffuse, specular) in [(0.0_f32, 1.0_f32), (1.0, 0.0), (0.3, 0.6), (1e-20, 1e-20)] {
        sweeps.push(sweep(
            format!("radiance 1e-45 to 1e38, integrals {diffuse:e} and {specular:e}"),
            relative(1e-6),
            samples(&log_steps(-45.0, 38.0, 400), |radiance, row| {
                row.extend([radiance, diffuse, specular]);
            }),
        ));
    }
    Row {
        name: "radiance",
        source: Source {
            header: "#import akari_math::area_light::diffuse_specular_combine".to_owned(),
            body: "y(0u, diffuse_specular_combine(vec3<f32>(x(0u)), vec3<f32>(0.5), x(1u), vec3<f32>(0.5), x(2u)).y);",
        },
        inputs: 3,
        outputs: 1,
        twin: |x, y| {
            let half = Vec3::splat(0.5);
            y.push(diffuse_specular_combine(Vec3::splat(x[0]), half, x[1], half, x[2]).y);
        },
        oracle: |x, y| y.push(x[0] * 0.5 * (x[1] + x[2])),
        range: [0.0, 1e38],
        sweeps,
    }
}

/// How much of the solid angle the bound for culling leaves out: nothing.
///
/// A square of half-side 1 in the plane z = 0; the sample is a point. Output: solid angle over π, in excess of the bound.
fn culling() -> Row {
    let mut sweeps = Vec::new();
    for (name, direction) in [
        ("above", Vec3::Z),
        ("beside", Vec3::new(0.7, 0.0, 0.7)),
        ("in the plane", Vec3::X),
        ("a hair above the plane", Vec3::new(1.0, 0.0, 1e-6)),
    ] {
        sweeps.push(sweep(
            format!("{name}, from the middle to 1e12"),
            ANY,
            samples(&log_steps(-6.0, 12.0, 360), |distance, row| {
                push3(row, direction * distance);
            }),
        ));
    }
    let mut random = Random::new(5);
    let points: Vec<Vec3> = (0..1500)
        .map(|_| random.direction() * 10.0_f32.powf(random.range(-2.0, 3.0)))
        .collect();
    sweeps.push(sweep(
        "anywhere",
        ANY,
        samples(&points, |point, row| push3(row, point)),
    ));
    Row {
        name: "bound for culling",
        source: Source {
            header: format!("{EXCESS_HEADER}\n#import akari_math::tile_bounds::solid_angle_bound"),
            body: "let p = x_vec3(0u);
                y(0u, solid_angle(p) - solid_angle_bound(4.0, 1.41421356, dot(p, p), abs(p.z)));",
        },
        inputs: 3,
        outputs: 1,
        twin: |x, y| {
            let p = vec3(x, 0);
            let bound =
                solid_angle_bound(4.0, std::f32::consts::SQRT_2, p.length_squared(), p.z.abs());
            let mut exact = Vec::new();
            exact_solid_angle(p.as_dvec3(), &mut exact);
            y.push(exact[0] as f32 - bound);
        },
        oracle: |x, y| exact_solid_angle(dvec3(x, 0), y),
        // The bound is at most 4 and never below the truth, but for the rounding of the truth in f32.
        range: [-4.1, 4e-6],
        sweeps,
    }
}

/// Solid angle over π of the square from a point, by the angles of its two triangles (van Oosterom, Strackee 1983).
const EXCESS_HEADER: &str = "
#import akari_math::special::{atan2_poly, safe_normalize}
fn triangle(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> f32 {
    return 2.0 * atan2_poly(abs(dot(a, cross(b, c))), 1.0 + dot(a, b) + dot(b, c) + dot(c, a));
}
fn solid_angle(p: vec3<f32>) -> f32 {
    let a = safe_normalize(vec3<f32>(-1.0, -1.0, 0.0) - p, vec3<f32>(0.0));
    let b = safe_normalize(vec3<f32>(1.0, -1.0, 0.0) - p, vec3<f32>(0.0));
    let c = safe_normalize(vec3<f32>(1.0, 1.0, 0.0) - p, vec3<f32>(0.0));
    let d = safe_normalize(vec3<f32>(-1.0, 1.0, 0.0) - p, vec3<f32>(0.0));
    return (triangle(a, b, c) + triangle(a, c, d)) / 3.14159265;
}";

fn exact_solid_angle(p: DVec3, y: &mut Vec<f64>) {
    let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, z)| DVec3::new(x, z, 0.0) - p);
    y.push(oracle::sg_polygon::solid_angle(&square).abs() / std::f64::consts::PI);
}

/// Where the image of a light is looked up: within the image, however the light lies.
fn footprint() -> Row {
    let push = |center: Vec3, normal: Vec3, roughness: f32, n_dot_v: f32, row: &mut Vec<f32>| {
        push3(row, center);
        push3(row, normal);
        row.extend(table::sample(roughness, n_dot_v).texel0.to_array());
        row.push(n_dot_v);
    };
    let mut sweeps = Vec::new();
    for roughness in [0.0_f32, 0.05, 0.5, 1.0] {
        sweeps.push(sweep(
            format!("light's plane through the point, roughness {roughness}"),
            ANY,
            samples(&through_zero(1.0, 120), |d, row| {
                push(Vec3::new(0.2, d, 0.7), Vec3::NEG_Y, roughness, 0.5, row);
            }),
        ));
        sweeps.push(sweep(
            format!("near to far, roughness {roughness}"),
            ANY,
            samples(&log_steps(-12.0, 12.0, 240), |s, row| {
                push(
                    Vec3::new(0.2, 0.3, 0.9) * s,
                    Vec3::NEG_Z,
                    roughness,
                    0.5,
                    row,
                );
            }),
        ));
        sweeps.push(sweep(
            format!("lobe along the light's plane, roughness {roughness}"),
            ANY,
            samples(&through_zero(0.5, 60), |tilt, row| {
                let normal = Vec3::new(1.0, 0.0, tilt).normalize();
                push(Vec3::new(1.0, 0.0, 0.8), normal, roughness, 0.9, row);
            }),
        ));
    }
    sweeps.push(sweep(
        "no normal, no distance",
        ANY,
        samples(
            &[
                (Vec3::ZERO, Vec3::Z),
                (Vec3::Z, Vec3::ZERO),
                (Vec3::ZERO, Vec3::ZERO),
            ],
            |(center, normal), row| push(center, normal, 0.3, 0.3, row),
        ),
    ));
    Row {
        name: "look-up of a light's image",
        source: Source {
            header: "#import akari_math::light_image::light_image_footprint
#import akari_math::ltc::lookup::{ltc_m, ltc_m_inv}"
                .to_owned(),
            body: "let m_inv = ltc_m_inv(x_vec4(6u), x(10u));
                let m = ltc_m(x_vec4(6u), x(10u));
                let f = light_image_footprint(vec3<f32>(0.0, 0.0, 1.0), m, m_inv, x_vec3(0u), x_vec3(3u),
                    vec4<f32>(1.0, 0.0, 0.0, 0.5), vec4<f32>(0.0, 1.0, 0.0, 0.5), 1e9);
                let is_within = all(f.center >= vec2<f32>(0.0)) && all(f.center <= vec2<f32>(1.0));
                y_vec2(0u, select(vec2<f32>(1e30), f.center, is_within)); y(2u, f.width); y_vec2(3u, f.line);",
        },
        inputs: 11,
        outputs: 5,
        twin: |x, y| {
            let texel = Vec4::new(x[6], x[7], x[8], x[9]);
            let f = light_image_footprint(
                Vec3::Z,
                ltc_m(texel, x[10]),
                ltc_m_inv(texel, x[10]),
                vec3(x, 0),
                vec3(x, 3),
                Vec4::new(1.0, 0.0, 0.0, 0.5),
                Vec4::new(0.0, 1.0, 0.0, 0.5),
                1e9,
            );
            let is_within = f.center.cmpge(Vec2::ZERO).all() && f.center.cmple(Vec2::ONE).all();
            let center = if is_within { f.center } else { Vec2::splat(1e30) };
            y.extend([center.x, center.y, f.width, f.line.x, f.line.y]);
        },
        // There is no other form of it: the sweeps ask for finite numbers within the image.
        oracle: |_, y| y.extend([0.5, 0.5, 0.0, 0.0, 0.0]),
        // Half-axes are cut at 1e8 layers.
        range: [-1.5e8, 1.5e8],
        sweeps,
    }
}
