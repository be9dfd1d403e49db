//! Spherical Gaussians over polygons: errors of every tier against f64, on the CPU and on the GPU; hard cases.

use crate::harness::{Random, push3};
use akari_gpu_test::{Gpu, Kernel, gpu_or_skip, run_kernel};
use akari_math::WGSL_MODULES;
use akari_math::oracle::{self, sg_polygon::sg_polygon};
use akari_math::sg::ltc::{LOW_SHARPNESS_NODES, sg_ltc_polygon_integral};
use akari_math::sg::polygon::{self, sg_polygon_integral};
use glam::{Quat, Vec3};

const TRIANGLES: usize = 400;
const SHARPNESSES: [f32; 8] = [0.0, 1.0, 10.0, 50.0, 200.0, 1e3, 1e4, 1e7];

/// A triangle in the shading frame and an axis.
#[derive(Clone, Copy, Debug)]
struct Case {
    triangle: [Vec3; 3],
    axis: Vec3,
    sharpness: f32,
}

/// A triangle of 0.01 to 1 rad about the normal of the surface, mostly within three widths of the lobe.
fn wide(random: &mut Random, sharpness: f32) -> Case {
    let width = 1.0 / sharpness.max(1.0).sqrt();
    let offset = if random.range(0.0, 1.0) < 0.7 {
        (random.range(0.0, 3.0) * width).min(1.2)
    } else {
        random.range(0.0, 1.2)
    };
    let size = random.log_range(-2.0, 0.0).tan();
    let mut angles = [0; 3].map(|_| random.range(0.0, std::f32::consts::TAU));
    angles.sort_by(|a, b| b.total_cmp(a));
    // Any turn about the normal, so that no direction is an axis of the frame.
    let turn = Quat::from_rotation_z(random.range(0.0, std::f32::consts::TAU));
    let triangle = angles.map(|angle| {
        let reach = size * random.range(0.3, 1.0);
        turn * Vec3::new(reach * angle.cos(), reach * angle.sin(), 1.0)
    });
    Case {
        triangle,
        axis: (turn * Vec3::new(-offset.sin(), 0.0, offset.cos())).normalize(),
        sharpness,
    }
}

fn exact(case: &Case) -> f64 {
    let triangle = case.triangle.map(|v| v.as_dvec3());
    sg_polygon(&triangle, case.axis.as_dvec3(), f64::from(case.sharpness))
}

/// A way to integrate.
#[derive(Clone, Copy, Debug)]
enum Tier {
    /// Cosine lobes.
    Ltc(u32),
    /// Nodes an edge.
    Rule(u32),
}

fn on_cpu(case: &Case, tier: Tier) -> f32 {
    let Case {
        triangle,
        axis,
        sharpness,
    } = case;
    match tier {
        Tier::Ltc(lobes) => sg_ltc_polygon_integral(triangle, *axis, *sharpness, lobes),
        Tier::Rule(nodes) => sg_polygon_integral(triangle, *axis, *sharpness, nodes),
    }
}

/// Corners at `x(0)`, axis at `x(9)`, sharpness at `x(12)`.
const HEADER: &str = "
#import akari_math::sg::polygon::{sg_rule, sg_polygon_new, sg_polygon_add_edge, sg_polygon_close}
#import akari_math::sg::ltc::{sg_ltc_share, sg_mixture, sg_ltc_polygon_new, sg_ltc_polygon_add_edge, sg_ltc_polygon_close}
#import akari_math::frame::orthonormal_basis
fn corner(i: u32) -> vec3<f32> { return vec3<f32>(x(3u * i), x(3u * i + 1u), x(3u * i + 2u)); }
fn by_rule(nodes: u32) -> f32 {
    let axis = corner(3u);
    let rule = sg_rule(nodes, x(12u));
    var polygon = sg_polygon_new();
    for (var i = 0u; i < 3u; i++) {
        sg_polygon_add_edge(&polygon, axis, rule, corner(i), corner((i + 1u) % 3u));
    }
    sg_polygon_close(&polygon, axis, rule);
    return polygon.integral;
}
fn by_mixture(lobes: u32) -> f32 {
    let frame = orthonormal_basis(corner(3u));
    let mixture = sg_mixture(lobes, x(12u));
    var polygon = sg_ltc_polygon_new();
    for (var i = 0u; i < 3u; i++) {
        sg_ltc_polygon_add_edge(&polygon, frame, mixture, corner(i), corner((i + 1u) % 3u));
    }
    sg_ltc_polygon_close(&polygon, frame, mixture);
    return polygon.integral;
}";
const BODY: &str = "
    let sharpness = x(12u);
    let share = sg_ltc_share(sharpness);
    let low = by_rule(LOW_NODESu);
    for (var lobes = 1u; lobes <= 3u; lobes++) {
        var integral = low;
        if share > 0.0 { integral = share * by_mixture(lobes) + (1.0 - share) * low; }
        y(lobes - 1u, integral);
    }
    y(3u, by_rule(1u)); y(4u, by_rule(2u)); y(5u, by_rule(3u)); y(6u, by_rule(4u)); y(7u, by_rule(6u)); y(8u, by_rule(8u));";

/// All tiers of all cases: case after case, in the order of [`TIERS`].
fn on_gpu(gpu: &Gpu, cases: &[Case]) -> Vec<f32> {
    let mut input = Vec::new();
    for case in cases {
        for v in case.triangle {
            push3(&mut input, v);
        }
        push3(&mut input, case.axis);
        input.push(case.sharpness);
    }
    let kernel = Kernel {
        header: HEADER,
        body: &BODY.replace("LOW_NODES", &LOW_SHARPNESS_NODES.to_string()),
        inputs: 13,
        outputs: TIERS.len(),
    };
    run_kernel(gpu, WGSL_MODULES, &kernel, &input).unwrap_or_else(|error| panic!("{error}"))
}

/// Largest and mean error over the lobe's integral.
fn errors(actual: &[f32], expected: &[f64], sharpness: f32) -> [f64; 2] {
    assert!(actual.iter().all(|y| y.is_finite()), "not finite");
    let whole = oracle::sg_integral(f64::from(sharpness));
    let errors = actual
        .iter()
        .zip(expected)
        .map(|(&a, &e)| (f64::from(a) - e).abs() / whole);
    let (largest, sum) = errors.fold((0.0, 0.0), |(m, s), e| (f64::max(m, e), s + e));
    [largest, sum / actual.len() as f64]
}

/// The tiers, and the largest and mean error that each is allowed for each of [`SHARPNESSES`].
const TIERS: [(Tier, [[f64; 2]; 8]); 9] = [
    (
        Tier::Ltc(1),
        [
            [1.0e-7, 1.0e-8],
            [5.7e-7, 2.2e-8],
            [5.3e-2, 1.9e-3],
            [1.2e-1, 5.3e-3],
            [1.4e-1, 9.4e-3],
            [1.8e-1, 1.1e-2],
            [1.9e-1, 1.7e-2],
            [7.3e-2, 4.2e-3],
        ],
    ),
    (
        Tier::Ltc(2),
        [
            [1.0e-7, 1.0e-8],
            [5.7e-7, 2.2e-8],
            [4.3e-3, 2.0e-4],
            [2.8e-2, 9.7e-4],
            [5.9e-2, 3.2e-3],
            [6.4e-2, 3.8e-3],
            [7.5e-2, 7.5e-3],
            [6.1e-2, 3.4e-3],
        ],
    ),
    (
        Tier::Ltc(3),
        [
            [1.0e-7, 1.0e-8],
            [5.7e-7, 2.2e-8],
            [1.8e-3, 8.3e-5],
            [1.9e-2, 5.5e-4],
            [3.6e-2, 1.9e-3],
            [4.0e-2, 2.5e-3],
            [4.8e-2, 4.6e-3],
            [4.0e-2, 2.1e-3],
        ],
    ),
    (
        Tier::Rule(1),
        [
            [1.0e-7, 1.0e-8],
            [1.8e-3, 2.9e-5],
            [1.4e-2, 3.8e-4],
            [3.3e-2, 1.2e-3],
            [5.7e-2, 2.2e-3],
            [2.8e-2, 1.5e-3],
            [5.5e-2, 4.5e-3],
            [5.2e-2, 1.3e-3],
        ],
    ),
    (
        Tier::Rule(2),
        [
            [1.0e-7, 1.0e-8],
            [9.9e-5, 2.0e-6],
            [1.7e-3, 4.4e-5],
            [5.3e-3, 1.7e-4],
            [9.4e-3, 5.0e-4],
            [1.4e-2, 5.8e-4],
            [1.3e-2, 9.6e-4],
            [5.5e-3, 1.4e-4],
        ],
    ),
    (
        Tier::Rule(3),
        [
            [1.0e-7, 1.0e-8],
            [9.4e-6, 2.1e-7],
            [1.9e-4, 7.6e-6],
            [1.4e-3, 3.4e-5],
            [2.2e-3, 1.1e-4],
            [3.7e-3, 1.2e-4],
            [3.0e-3, 2.5e-4],
            [4.6e-3, 9.9e-5],
        ],
    ),
    (
        Tier::Rule(4),
        [
            [1.0e-7, 1.0e-8],
            [5.7e-7, 2.2e-8],
            [5.6e-5, 1.5e-6],
            [4.8e-4, 1.4e-5],
            [8.4e-4, 4.9e-5],
            [1.1e-3, 4.5e-5],
            [1.2e-3, 9.8e-5],
            [2.1e-3, 4.8e-5],
        ],
    ),
    (
        Tier::Rule(6),
        [
            [1.0e-7, 1.0e-8],
            [1.0e-7, 1.0e-8],
            [4.3e-6, 9.6e-8],
            [2.1e-5, 9.7e-7],
            [8.3e-5, 4.0e-6],
            [1.9e-4, 6.7e-6],
            [2.1e-4, 1.7e-5],
            [3.2e-4, 9.7e-6],
        ],
    ),
    (
        Tier::Rule(8),
        [
            [1.0e-7, 1.0e-8],
            [1.0e-7, 1.0e-8],
            [1.4e-6, 4.5e-8],
            [1.7e-5, 4.2e-7],
            [6.3e-5, 2.3e-6],
            [1.2e-4, 3.5e-6],
            [1.4e-4, 7.2e-6],
            [1.1e-4, 2.9e-6],
        ],
    ),
];

#[test]
fn sg_polygons() {
    let cases: Vec<Case> = SHARPNESSES
        .into_iter()
        .enumerate()
        .flat_map(|(index, sharpness)| {
            let mut random = Random::new(400 + index as u64);
            (0..TRIANGLES)
                .map(|_| wide(&mut random, sharpness))
                .collect::<Vec<_>>()
        })
        .collect();
    let expected: Vec<f64> = cases.iter().map(exact).collect();
    let device = gpu_or_skip("sg_polygons on the GPU").map(|gpu| on_gpu(gpu, &cases));
    let mut failures = Vec::new();
    for (column, (tier, limits)) in TIERS.into_iter().enumerate() {
        for (index, sharpness) in SHARPNESSES.into_iter().enumerate() {
            let range = index * TRIANGLES..(index + 1) * TRIANGLES;
            let expected = &expected[range.clone()];
            let twin: Vec<f32> = cases[range.clone()]
                .iter()
                .map(|case| on_cpu(case, tier))
                .collect();
            let mut figures = vec![("CPU", errors(&twin, expected, sharpness))];
            if let Some(device) = &device {
                let device: Vec<f32> = range
                    .map(|row| device[row * TIERS.len() + column])
                    .collect();
                figures.push(("GPU", errors(&device, expected, sharpness)));
            }
            for (place, [largest, mean]) in figures {
                println!("{tier:?} {sharpness:e} {place}: [{largest:.1e}, {mean:.1e}]");
                if largest > limits[index][0] || mean > limits[index][1] {
                    failures.push(format!(
                        "{tier:?}, sharpness {sharpness:e}, {place}: {largest:.2e} {mean:.2e} above {:?}",
                        limits[index]
                    ));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Polygons and lobes that break naive forms: three corners and the axis.
type Maker = fn(&mut Random) -> ([Vec3; 3], Vec3);

fn around(random: &mut Random, center: Vec3, size: f32) -> [Vec3; 3] {
    let u = random.around(center, std::f32::consts::FRAC_PI_2);
    let v = center.cross(u);
    let turn = random.range(0.0, std::f32::consts::TAU);
    [0.0, 2.1, 4.2].map(|step| {
        let angle = turn - step;
        center + size * (angle.cos() * u + angle.sin() * v)
    })
}

fn upper(random: &mut Random) -> Vec3 {
    let v = random.direction();
    Vec3::new(v.x, v.y, v.z.abs())
}

const CLASSES: &[(&str, Maker)] = &[
    ("axis in it", |r| {
        let center = upper(r);
        let size = r.log_range(-2.0, 0.0);
        (around(r, center, size), center)
    }),
    ("axis on an edge", |r| {
        let center = upper(r);
        let size = r.log_range(-2.0, 0.0);
        let t = around(r, center, size);
        let share = r.range(0.0, 1.0);
        (
            t,
            (t[0].normalize() * share + t[1].normalize() * (1.0 - share)).normalize(),
        )
    }),
    ("axis on a vertex", |r| {
        let center = upper(r);
        let size = r.log_range(-2.0, 0.0);
        let t = around(r, center, size);
        (t, t[0].normalize())
    }),
    ("opposite to the axis", |r| {
        let center = upper(r);
        let size = r.log_range(-2.0, 0.0);
        (around(r, center, size), -center)
    }),
    ("edge opposite to the axis", |r| {
        let center = upper(r);
        let size = r.log_range(-2.0, 0.0);
        let t = around(r, center, size);
        (t, -(t[0].normalize() + t[1].normalize()).normalize())
    }),
    ("vertex opposite to the axis", |r| {
        let center = upper(r);
        let size = r.log_range(-2.0, 0.0);
        let t = around(r, center, size);
        (t, -t[2].normalize())
    }),
    ("tiny 1e-4", |r| {
        let center = upper(r);
        let near = r.log_range(-4.0, 0.0);
        (around(r, center, 1e-4), r.around(center, near))
    }),
    ("tiny 1e-6", |r| {
        let center = upper(r);
        let near = r.log_range(-6.0, 0.0);
        (around(r, center, 1e-6), r.around(center, near))
    }),
    ("sliver 1e-5", |r| {
        let center = upper(r);
        let [a, b, _] = around(r, center, 0.5);
        let c = (a + b) * 0.5 + 1e-5 * r.direction();
        let near = r.log_range(-3.0, 0.0);
        ([a, b, c], r.around(center, near))
    }),
    ("across the horizon", |r| {
        let v = r.direction();
        let center = Vec3::new(v.x, v.y, r.range(-0.3, 0.3));
        let near = r.log_range(-2.0, 0.3);
        (around(r, center, 0.8), r.around(center.normalize(), near))
    }),
    ("near its plane", |r| {
        let turn = Quat::from_rotation_z(r.range(0.0, 6.0));
        let t = [(-1.0, -1.0), (0.5, 1.5), (2.0, -0.5)];
        (t.map(|(x, y)| turn * Vec3::new(x, y, 1e-3)), upper(r))
    }),
    ("huge and near its plane", |r| {
        let normal = upper(r);
        let t = around(r, normal, 1e4);
        (t.map(|v| v + normal * r.range(0.5, 1.0)), r.direction())
    }),
];

/// Largest error over the lobe's integral that each tier is allowed in any of the classes: by the large polygons, and by
/// those with the axis on their boundary.
const LIMITS: [f64; TIERS.len()] = [0.2, 0.08, 0.05, 0.12, 0.04, 0.01, 6e-3, 1.5e-3, 6e-4];
const LIMITS_OF_ROUNDING: [f64; TIERS.len()] =
    [0.2, 0.08, 0.08, 0.12, 0.05, 0.04, 0.04, 0.04, 0.04];

/// Nothing is non-finite in any tier, and the finest is accurate wherever f32 vertices say enough.
#[test]
fn hard_cases() {
    const EACH: usize = 60;
    let mut cases = Vec::new();
    let mut names = Vec::new();
    for (class, (name, maker)) in CLASSES.iter().enumerate() {
        for (index, sharpness) in [0.0, 1e-6, 0.5, 5.0, 50.0, 1e3, 1e5, 1e7, 1e12]
            .into_iter()
            .enumerate()
        {
            let mut random = Random::new(500 + 20 * class as u64 + index as u64);
            for _ in 0..EACH {
                let (triangle, axis) = maker(&mut random);
                cases.push(Case {
                    triangle,
                    axis,
                    sharpness,
                });
                names.push((*name, sharpness));
            }
        }
    }
    let mut rows = vec![("CPU", {
        let tiers = TIERS.map(|(tier, _)| tier);
        let row = |case| tiers.map(|tier| on_cpu(case, tier));
        cases.iter().flat_map(row).collect::<Vec<f32>>()
    })];
    if let Some(gpu) = gpu_or_skip("hard_cases on the GPU") {
        rows.push(("GPU", on_gpu(gpu, &cases)));
    }
    let expected: Vec<f64> = cases.iter().map(exact).collect();
    let mut failures = Vec::new();
    for (place, rows) in &rows {
        let mut start = 0;
        while start < cases.len() {
            let end = start + EACH;
            let (name, sharpness) = names[start];
            let whole = oracle::sg_integral(f64::from(sharpness));
            let mut worst = [0.0_f64; TIERS.len()];
            for row in start..end {
                for (tier, worst) in worst.iter_mut().enumerate() {
                    let value = rows[row * TIERS.len() + tier];
                    if value.is_finite() {
                        *worst = worst.max((f64::from(value) - expected[row]).abs() / whole);
                    } else {
                        failures.push(format!(
                            "{place}, {name}, {sharpness:e}: {value} of {:?}",
                            cases[row]
                        ));
                    }
                }
            }
            // Unit vectors of f32 place a lobe of sharpness 1e12 no better than a tenth of its width.
            let limits = if sharpness > 1e7 {
                LIMITS_OF_ROUNDING
            } else {
                LIMITS
            };
            for ((tier, _), (worst, limit)) in TIERS.iter().zip(worst.iter().zip(limits)) {
                if *worst > limit {
                    failures.push(format!(
                        "{place}, {name}, {sharpness:e}, {tier:?}: {worst:.1e}"
                    ));
                }
            }
            println!(
                "{place}, {name}, {sharpness:e}: {}",
                worst.map(|e| format!("{e:.1e}")).join(" ")
            );
            start = end;
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// A triangle behind a lobe gets nothing of it, which a rule alone does not tell.
#[test]
fn triangles_far_from_a_lobe_stay_dark() {
    let mut random = Random::new(700);
    let rule = polygon::sg_rule(1, 1e3);
    let whole = oracle::sg_integral(1e3) as f32;
    let (mut raw, mut settled) = (0.0_f32, 0.0_f32);
    for _ in 0..100 {
        let center = upper(&mut random);
        let triangle = around(&mut random, center, 0.3);
        let mut polygon = polygon::sg_polygon_new();
        for i in 0..3 {
            polygon::sg_polygon_add_edge(
                &mut polygon,
                -center,
                rule,
                triangle[i],
                triangle[(i + 1) % 3],
            );
        }
        polygon::sg_polygon_close(&mut polygon, -center, rule);
        settled = settled.max(polygon.integral.abs() / whole);
        raw = raw.max((rule.mean * polygon.solid_angle + polygon.edges).abs() / whole);
    }
    assert_eq!(settled, 0.0);
    assert!(raw > 1e-3, "{raw}");
}
