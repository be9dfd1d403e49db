//! The integral over polygons that break naive forms, on the CPU and on the GPU, against f64.

use crate::harness::{Random, widen};
use akari_gpu_test::{Kernel, gpu_or_skip, run_kernel};
use akari_math::WGSL_MODULES;
use akari_math::ltc::{lookup::ltc_m_inv, polygon};
use akari_math::oracle;
use glam::{DMat3, DVec3, Mat3, Vec3, Vec4};

/// Vertices of a polygon of the test.
const CORNERS: usize = 8;
const POLYGONS: usize = 1200;
/// The bound that the project promises.
const MAX_ERROR: f64 = 5e-7;

type Polygon = Vec<Vec3>;

fn quad(random: &mut Random, center: Vec3, size: f32, aspect: f32) -> Polygon {
    let normal = random.direction();
    let u = random.around(normal, std::f32::consts::FRAC_PI_2);
    let v = normal.cross(u);
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(s, t)| center + size * (s * u + aspect * t * v))
        .to_vec()
}

fn upper(random: &mut Random) -> Vec3 {
    let v = random.direction();
    Vec3::new(v.x, v.y, v.z.abs())
}

/// A star of four spikes: concave, and with four crossings where the horizon cuts it.
fn star(random: &mut Random, center: Vec3, size: f32) -> Polygon {
    let normal = random.direction();
    let u = random.around(normal, std::f32::consts::FRAC_PI_2);
    let v = normal.cross(u);
    (0..CORNERS)
        .map(|i| {
            let angle = std::f32::consts::TAU * i as f32 / CORNERS as f32;
            let radius = size * if i % 2 == 0 { 1.0 } else { 0.3 };
            center + radius * (angle.cos() * u + angle.sin() * v)
        })
        .collect()
}

type Maker = fn(&mut Random) -> Polygon;

const CLASSES: &[(&str, Maker)] = &[
    ("regular", |r| {
        let (center, size) = (upper(r) * r.range(1.0, 5.0), r.range(0.2, 1.0));
        quad(r, center, size, 1.0)
    }),
    ("tiny 1e-3", |r| {
        let center = upper(r);
        quad(r, center, 1e-3, 1.0)
    }),
    ("tiny 1e-5", |r| {
        let center = upper(r);
        quad(r, center, 1e-5, 1.0)
    }),
    ("far 1e4 m", |r| {
        let center = upper(r) * 1e4;
        quad(r, center, 1.0, 1.0)
    }),
    ("huge 1e4", |r| {
        // The plane is at least 1e-6 of the extent away: nearer, f32 vertices do not tell on which side the point is.
        loop {
            let center = upper(r);
            let polygon = quad(r, center, 1e4, 1.0);
            let normal = (polygon[1] - polygon[0])
                .cross(polygon[3] - polygon[0])
                .normalize();
            if normal.dot(center).abs() > 0.02 {
                return polygon;
            }
        }
    }),
    ("horizon-crossing", |r| {
        let v = r.direction();
        let center = Vec3::new(v.x, v.y, r.range(-0.2, 0.2));
        quad(r, center, 0.7, 1.0)
    }),
    ("edge at horizon ±1e-6", |r| {
        let center = upper(r);
        let polygon = quad(r, center, 0.5, 1.0);
        let lowest = polygon[0].z.min(polygon[1].z);
        let lift = r.range(-1e-6, 1e-6) - lowest;
        polygon
            .into_iter()
            .map(|v| v + Vec3::new(0.0, 0.0, lift))
            .collect()
    }),
    ("near plane 1e-3", |r| {
        let shift = Vec3::new(r.range(-0.2, 0.2), r.range(-0.2, 0.2), 1e-3);
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| Vec3::new(x, y, 0.0) + shift)
            .to_vec()
    }),
    ("near plane 1e-6", |r| {
        let shift = Vec3::new(r.range(-0.2, 0.2), r.range(-0.2, 0.2), 1e-6);
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.2), (-1.0, 1.0)]
            .map(|(x, y)| Vec3::new(x, y, 0.0) + shift)
            .to_vec()
    }),
    ("sliver 1e-4", |r| {
        let center = upper(r);
        quad(r, center, 1.0, 1e-4)
    }),
    ("sliver 1e-6", |r| {
        let center = upper(r);
        quad(r, center, 1.0, 1e-6)
    }),
    ("concave", |r| {
        let (center, size) = (upper(r) * r.range(1.0, 3.0), r.range(0.3, 1.0));
        star(r, center, size)
    }),
    ("concave across the horizon", |r| {
        let v = r.direction();
        let center = Vec3::new(v.x, v.y, r.range(-0.2, 0.2));
        star(r, center, 0.7)
    }),
    ("on the light's plane", |r| {
        [(0.2, 0.1), (1.2, 0.1), (1.2, 1.0), (0.2, 1.0)]
            .map(|(y, z)| Vec3::new(r.range(0.0, 1e-7), y + 0.3, z))
            .to_vec()
    }),
    ("1e-7 m", |r| {
        let (center, size) = (upper(r) * 1e-7, 5e-8);
        quad(r, center, size, 1.0)
    }),
    ("1e7 m", |r| {
        let (center, size) = (upper(r) * 1e7, 5e6);
        quad(r, center, size, 1.0)
    }),
];

/// Transforms of cosines: none, and two as of rough lobes seen at an angle; with the bound that each allows.
///
/// A narrower lobe magnifies the rounding of the vertices: `lobes_magnify_rounding` measures it.
fn transforms() -> [(&'static str, Mat3); 3] {
    [
        ("identity", Mat3::IDENTITY),
        ("skewed", ltc_m_inv(Vec4::new(1.1, -0.25, 0.2, 0.9), 1.0)),
        ("narrow", ltc_m_inv(Vec4::new(0.9, -0.5, 0.25, 0.45), 1.0)),
    ]
}

fn polygons(class: usize) -> Vec<Polygon> {
    let mut random = Random::new(100 + class as u64);
    (0..POLYGONS)
        .map(|_| CLASSES[class].1(&mut random))
        .collect()
}

fn exact(polygon: &[Vec3], m_inv: Mat3) -> [f64; 2] {
    let vertices: Vec<DVec3> = polygon.iter().map(|v| v.as_dvec3()).collect();
    [
        oracle::form_factor(&vertices).z,
        oracle::ltc_form_factor(&vertices, m_inv.as_dmat3()).z,
    ]
}

fn on_cpu(polygon: &[Vec3], m_inv: Mat3) -> [f32; 2] {
    [
        polygon::form_factor(polygon).z,
        polygon::ltc_form_factor(polygon, m_inv).z,
    ]
}

/// Corners at `x(0)`, how many at `x(24)`, `M^-1` from `x(25)`.
const HEADER: &str =
    "#import akari_math::ltc::polygon::{ltc_polygon_new, ltc_polygon_add_edge, ltc_polygon_close}
fn corner(i: u32) -> vec3<f32> { return vec3<f32>(x(3u * i), x(3u * i + 1u), x(3u * i + 2u)); }";
const BODY: &str = "
    let m_inv = mat3x3<f32>(vec3<f32>(x(25u), x(26u), x(27u)), vec3<f32>(x(28u), x(29u), x(30u)), vec3<f32>(x(31u), x(32u), x(33u)));
    let corners = u32(x(24u));
    var polygon = ltc_polygon_new();
    for (var i = 0u; i < corners; i++) {
        ltc_polygon_add_edge(&polygon, m_inv, corner(i), corner((i + 1u) % corners));
    }
    ltc_polygon_close(&polygon, m_inv);
    y(0u, polygon.diffuse.z);
    y(1u, polygon.specular.z);";

fn row(polygon: &[Vec3], m_inv: Mat3) -> Vec<f32> {
    let mut row: Vec<f32> = polygon.iter().flat_map(|v| v.to_array()).collect();
    row.resize(3 * CORNERS, 0.0);
    row.push(polygon.len() as f32);
    row.extend(m_inv.to_cols_array());
    row
}

fn worst(actual: &[f32], expected: &[f64]) -> f64 {
    assert!(actual.iter().all(|y| y.is_finite()), "not finite");
    actual
        .iter()
        .zip(expected)
        .map(|(&a, &e)| (f64::from(a) - e).abs())
        .fold(0.0, f64::max)
}

#[test]
fn hard_classes() {
    let gpu = gpu_or_skip("hard_classes on the GPU");
    let mut failures = Vec::new();
    for (transform, m_inv) in transforms() {
        for (class, (name, _)) in CLASSES.iter().enumerate() {
            let polygons = polygons(class);
            let expected: Vec<f64> = polygons.iter().flat_map(|p| exact(p, m_inv)).collect();
            let twin: Vec<f32> = polygons.iter().flat_map(|p| on_cpu(p, m_inv)).collect();
            let mut figures = vec![("CPU", worst(&twin, &expected))];
            if let Some(gpu) = gpu {
                let input: Vec<f32> = polygons.iter().flat_map(|p| row(p, m_inv)).collect();
                let kernel = Kernel {
                    header: HEADER,
                    body: BODY,
                    inputs: 34,
                    outputs: 2,
                };
                let output = run_kernel(gpu, WGSL_MODULES, &kernel, &input)
                    .unwrap_or_else(|error| panic!("{error}"));
                figures.push(("GPU", worst(&output, &expected)));
                figures.push(("GPU - CPU", worst(&output, &widen(&twin))));
            }
            println!(
                "{name}, {transform}: {}",
                figures
                    .iter()
                    .map(|(w, e)| format!("{w} {e:.2e}"))
                    .collect::<Vec<_>>()
                    .join(", ")
            );
            for (where_, error) in figures {
                if error > MAX_ERROR {
                    failures.push(format!("{name}, {transform}, {where_}: {error:.2e}"));
                }
            }
        }
    }
    assert!(
        failures.is_empty(),
        "above {MAX_ERROR:e}:\n{}",
        failures.join("\n")
    );
}

/// The middle point of long edges along the horizon is what keeps large lights within the bound.
#[test]
fn huge_lights_need_the_middle_point() {
    let Some(gpu) = gpu_or_skip("huge_lights_need_the_middle_point") else {
        return;
    };
    let class = CLASSES
        .iter()
        .position(|(name, _)| *name == "huge 1e4")
        .expect("class");
    let (_, m_inv) = transforms()[1];
    let polygons = polygons(class);
    let expected: Vec<f64> = polygons.iter().flat_map(|p| exact(p, m_inv)).collect();
    let input: Vec<f32> = polygons.iter().flat_map(|p| row(p, m_inv)).collect();
    let mutated: Vec<(&str, String)> = WGSL_MODULES
        .iter()
        .map(|(path, source)| {
            (
                *path,
                source.replace("a.z == 0.0 && b.z == 0.0", "a.z > 1.0"),
            )
        })
        .collect();
    assert!(
        mutated
            .iter()
            .zip(WGSL_MODULES)
            .any(|((_, mutated), (_, source))| mutated != source)
    );
    let modules: Vec<(&str, &str)> = mutated
        .iter()
        .map(|(path, source)| (*path, source.as_str()))
        .collect();
    let kernel = Kernel {
        header: HEADER,
        body: BODY,
        inputs: 34,
        outputs: 2,
    };
    let output =
        run_kernel(gpu, &modules, &kernel, &input).unwrap_or_else(|error| panic!("{error}"));
    let error = worst(&output, &expected);
    assert!(error > 10.0 * MAX_ERROR, "{error:e}");
}

/// The classes tell a good form from the naive ones.
#[test]
fn hard_classes_fail_naive_forms() {
    let acos = |vertices: &[Vec3]| {
        let unit: Vec<Vec3> = vertices.iter().map(|v| v.normalize()).collect();
        let edge = |a: Vec3, b: Vec3| {
            let angle = a.dot(b).acos();
            b.cross(a).z * angle / angle.sin()
        };
        (0..unit.len())
            .map(|i| edge(unit[i], unit[(i + 1) % unit.len()]))
            .sum::<f32>()
            / std::f32::consts::TAU
    };
    let mut failing = 0;
    for class in [2, 3, 4] {
        failing += polygons(class)
            .iter()
            .filter(|p| p.iter().all(|v| v.z > 0.0))
            .filter(|p| (f64::from(acos(p)) - exact(p, Mat3::IDENTITY)[0]).abs() <= MAX_ERROR)
            .count();
    }
    // Of 3600 polygons the naive form gets less than half right, the rest being NaN or off.
    assert!(failing < 1800, "{failing}");
}

/// `M^-1` of a lobe narrow by `1/s` magnifies the rounding of directions by up to `s`.
#[test]
fn lobes_magnify_rounding() {
    let mut random = Random::new(140);
    for alpha in [0.3_f32, 0.1, 0.01, 1e-3] {
        let (sine, cosine) = 0.8_f32.sin_cos();
        // A cosine of width alpha about a direction 0.8 rad from the normal.
        let rotation = Mat3::from_cols(
            Vec3::new(cosine, 0.0, -sine),
            Vec3::Y,
            Vec3::new(sine, 0.0, cosine),
        );
        let m = rotation * Mat3::from_diagonal(Vec3::new(alpha, alpha, 1.0));
        let inverse = m.inverse();
        let m_inv = inverse * (1.0 / inverse.y_axis.y);
        let mut error = 0.0_f64;
        for _ in 0..2000 {
            let axis = Vec3::new(sine, 0.0, cosine);
            let center = random.around(axis, 2.0 * alpha);
            let size = alpha * random.range(0.3, 2.0);
            let polygon = quad(&mut random, center, size, 1.0);
            let value = on_cpu(&polygon, m_inv)[1];
            error = error.max((f64::from(value) - exact(&polygon, m_inv)[1]).abs());
        }
        println!("alpha {alpha}: {error:.2e}");
        assert!(
            error <= 5e-7 + 2e-8 / f64::from(alpha),
            "alpha {alpha}: {error:e}"
        );
    }
}

/// Input that no scene should have: nothing but finite numbers comes out, and 0 where there is no area.
#[test]
fn degenerate_polygons() {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let nothing: Vec<Polygon> = vec![
        vec![],
        vec![z],
        vec![x + z, y + z],
        vec![Vec3::ZERO; 4],
        vec![z; 5],
        // Vertices at the shading point, the rest a line.
        vec![Vec3::ZERO, x + z, y + z],
        vec![Vec3::ZERO, x + z, Vec3::ZERO, y + z],
        // In the surface's plane, and below.
        vec![x, y, -x, -y],
        vec![x - z, y - z, -x - z],
        // Collinear.
        vec![x + z, 2.0 * x + z, 3.0 * x + z],
        vec![x + z, -x + z, x + z, -x + z],
        vec![z * 1e-38, x * 1e-38, y * 1e-38],
    ];
    // On the edge, in the plane, through a corner, of both signs, both huge and tiny.
    let finite: Vec<Polygon> = vec![
        vec![z - x, z + x, -z + x, -z - x],
        vec![x, z, -x, -z],
        vec![z + x, -z - x, y],
        vec![Vec3::ZERO, z + x, z + y, y],
        vec![z * 3e38, x * 3e38, y * 3e38],
        vec![z * 1e38, x * 1e-38, y + z],
        vec![x + 1e-7 * z, y + 1e-7 * z, -x + 1e-7 * z, -y + 1e-7 * z],
    ];
    let m_inv = ltc_m_inv(Vec4::new(0.9, -0.5, 0.25, 0.45), 1.0);
    let singular = Mat3::from_cols(Vec3::ZERO, Vec3::Y, Vec3::ZERO);
    let check = |output: [f32; 2], polygon: &Polygon, zero: bool, where_: &str| {
        assert!(
            output
                .iter()
                .all(|v| v.is_finite() && v.abs() <= 1.0 + 1e-6),
            "{where_} {polygon:?}: {output:?}"
        );
        if zero {
            assert!(
                output.iter().all(|v| v.abs() < 1e-7),
                "{where_} {polygon:?}: {output:?}"
            );
        }
    };
    let mut input = Vec::new();
    let all: Vec<(&Polygon, bool)> = nothing
        .iter()
        .map(|p| (p, true))
        .chain(finite.iter().map(|p| (p, false)))
        .collect();
    for m_inv in [Mat3::IDENTITY, m_inv, singular, Mat3::ZERO] {
        for (polygon, zero) in &all {
            check(on_cpu(polygon, m_inv), polygon, *zero, "CPU");
            input.extend(row(polygon, m_inv));
        }
    }
    let Some(gpu) = gpu_or_skip("degenerate_polygons on the GPU") else {
        return;
    };
    let kernel = Kernel {
        header: HEADER,
        body: BODY,
        inputs: 34,
        outputs: 2,
    };
    let output =
        run_kernel(gpu, WGSL_MODULES, &kernel, &input).unwrap_or_else(|error| panic!("{error}"));
    for (output, (polygon, zero)) in output.chunks_exact(2).zip(all.iter().cycle()) {
        check([output[0], output[1]], polygon, *zero, "GPU");
    }
}

/// The oracle of this file, on its own terms: additive, and 1 over the hemisphere.
#[test]
fn the_oracle_covers_the_hemisphere() {
    let r = 1e9;
    let square = [(r, r), (r, -r), (-r, -r), (-r, r)].map(|(x, y)| DVec3::new(x, y, 1.0));
    assert!((oracle::form_factor(&square).z - 1.0).abs() < 1e-8);
    assert!(
        (oracle::ltc_form_factor(&square, DMat3::from_diagonal(DVec3::new(3.0, 1.0, 0.5))).z - 1.0)
            .abs()
            < 1e-8
    );
}
