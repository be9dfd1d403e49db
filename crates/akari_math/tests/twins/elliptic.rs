//! Rows of `sg::elliptic`, and what its lobe and its rule integrate to.

use crate::harness::{Case, Mutation, absolute, domain, dvec3, push3, rows, vec3};
use akari_math::frame::orthonormal_basis;
use akari_math::sg::elliptic::{
    EllipticLobe, LobeRing, RING_NODES, elliptic_direction, elliptic_lobe, elliptic_normal,
    elliptic_stretch, elliptic_value, elliptic_versine, lobe_ring_add, lobe_ring_new, ring_place,
    ring_weight,
};
use akari_math::sg::lobe::sg_integral;
use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};

const MODULE: &str = "akari_math::sg::elliptic";

/// Logarithms of a parabola of this gradient and Hessian (xx, yy, xy), `reach` from the middle.
fn ring_of(gradient: Vec2, hessian: Vec3, reach: f32) -> LobeRing {
    (0..RING_NODES).fold(lobe_ring_new(), |ring, i| {
        let place = ring_place(i);
        let at = place * reach;
        let bent =
            0.5 * (hessian.x * at.x * at.x + hessian.y * at.y * at.y) + hessian.z * at.x * at.y;
        lobe_ring_add(ring, place, 0.25 + gradient.dot(at) + bent)
    })
}

/// A lobe that is turned by `angle` about its axis.
fn lobe_of(axis: Vec3, angle: f32, stretch: f32, sharpness: f32) -> EllipticLobe {
    let basis = orthonormal_basis(axis);
    let along = basis.x_axis * angle.cos() + basis.y_axis * angle.sin();
    EllipticLobe {
        axis,
        sharpness,
        along,
        stretch,
        across: axis.cross(along),
    }
}

/// The same in f64: axis, along, across.
fn axes_of(x: &[f64]) -> [DVec3; 3] {
    let axis = dvec3(x, 0);
    let basis = orthonormal_basis(axis.as_vec3());
    let [u, v] = [basis.x_axis.as_dvec3(), basis.y_axis.as_dvec3()];
    let along = u * x[3].cos() + v * x[3].sin();
    [axis, along, axis.cross(along)]
}

/// What stretching makes of a direction.
fn mapped(x: &[f64], direction: DVec3) -> DVec3 {
    let [axis, along, across] = axes_of(x);
    DVec3::new(
        along.dot(direction) * x[4],
        across.dot(direction) / x[4],
        axis.dot(direction),
    )
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
            functions: &["lobe_ring_new", "lobe_ring_add", "ring_place", "elliptic_lobe"],
            imports: "#import akari_math::frame::orthonormal_basis",
            body: "let step = x(8u);
                let root = sqrt(1.0 + step * step);
                let reach = sqrt(2.0 * step * step / (root * (1.0 + root)));
                var ring = lobe_ring_new();
                for (var i = 0u; i < 7u; i++) {
                    let place = ring_place(i);
                    let at = place * reach;
                    let bent = 0.5 * (x(5u) * at.x * at.x + x(6u) * at.y * at.y) + x(7u) * at.x * at.y;
                    ring = lobe_ring_add(ring, place, 0.25 + x(3u) * at.x + x(4u) * at.y + bent);
                }
                let lobe = elliptic_lobe(x_vec3(0u), orthonormal_basis(x_vec3(0u)), step, ring, x(9u));
                y_vec3(0u, lobe.axis); y(3u, lobe.sharpness / x(9u)); y(4u, lobe.stretch);
                y_vec3(5u, lobe.along); y_vec3(8u, lobe.across);",
            inputs: 10,
            outputs: 11,
            twin: |x, y| {
                let step = x[8];
                let root = (1.0 + step * step).sqrt();
                let reach = (2.0 * step * step / (root * (1.0 + root))).sqrt();
                let ring = ring_of(Vec2::new(x[3], x[4]), vec3(x, 5), reach);
                let axis = vec3(x, 0);
                let lobe = elliptic_lobe(axis, orthonormal_basis(axis), step, ring, x[9]);
                push3(y, lobe.axis);
                y.push(lobe.sharpness / x[9]);
                y.push(lobe.stretch);
                push3(y, lobe.along);
                push3(y, lobe.across);
            },
            // By the eigenvectors of the Hessian, whose fall is not cut off here.
            oracle: Some(|x, y| {
                let angle = x[8].atan();
                let reach = (2.0 * (1.0 - angle.cos())).sqrt();
                let basis = orthonormal_basis(dvec3(x, 0).as_vec3());
                let (u, v) = (basis.x_axis.as_dvec3(), basis.y_axis.as_dvec3());
                let turn = 0.5 * (2.0 * x[7]).atan2(x[5] - x[6]);
                let long = DVec2::from_angle(turn);
                let short = long.perp();
                let sharp = |d: DVec2| {
                    let form = x[5] * d.x * d.x + x[6] * d.y * d.y + 2.0 * x[7] * d.x * d.y;
                    (-form).clamp(x[9] / 8.0, x[9] * 8.0)
                };
                let gradient = DVec2::new(x[3], x[4]);
                let place = |d: DVec2| (gradient.dot(d) / sharp(d)).clamp(-reach, reach);
                let flat = long * place(long) + short * place(short);
                let axis = (dvec3(x, 0) + u * flat.x + v * flat.y).normalize();
                let tangent = u * long.x + v * long.y;
                let along = (tangent - axis * axis.dot(tangent)).normalize();
                y.extend(axis.to_array());
                y.push((sharp(long) * sharp(short)).sqrt() / x[9]);
                y.push((sharp(long) / sharp(short)).powf(0.25));
                y.extend(along.to_array());
                y.extend(axis.cross(along).to_array());
            }),
            domains: vec![domain(
                "parabolas",
                rows(830, 500, |random, row| {
                    let sharpness = random.log_range(0.5, 4.0);
                    let step = (1.7 / sharpness.sqrt()).min(0.7);
                    push3(row, random.direction());
                    for _ in 0..2 {
                        row.push(random.range(-0.8, 0.8) / step);
                    }
                    // Two sharpnesses that are told apart, turned.
                    let high = sharpness * random.range(0.9, 1.5);
                    let low = high * random.range(0.1, 0.7);
                    let turn = random.range(-1.5, 1.5);
                    let (mean, half) = (0.5 * (high + low), 0.5 * (high - low));
                    row.push(-mean + half * (2.0 * turn).cos());
                    row.push(-mean - half * (2.0 * turn).cos());
                    row.push(half * (2.0 * turn).sin());
                    row.push(step);
                    row.push(sharpness);
                }),
                absolute(2e-4),
                absolute(2e-4),
            )],
            mutations: vec![
                mutation("-2.0 * (ring.sum / 6.0", "-2.1 * (ring.sum / 6.0"),
                mutation("2.0 / (3.0 * squared)", "2.1 / (3.0 * squared)"),
                mutation("ring.first / (3.0 * reach)", "ring.first / (3.1 * reach)"),
                mutation("gradient.y * long.x - gradient.x", "gradient.y * long.x + gradient.x"),
                mutation("root * (1.0 + root)", "root * root * root"),
                mutation("let low = sharpness / MOST_REFINEMENT", "let low = sharpness / 4.0"),
            ],
        },
        Case {
            module: MODULE,
            functions: &[
                "elliptic_stretch",
                "elliptic_normal",
                "elliptic_versine",
                "elliptic_value",
                "elliptic_direction",
                "ring_weight",
            ],
            imports: "#import akari_math::frame::orthonormal_basis
                #import akari_math::sg::elliptic::{EllipticLobe, ring_place}",
            body: "let basis = orthonormal_basis(x_vec3(0u));
                let along = basis[0] * cos(x(3u)) + basis[1] * sin(x(3u));
                let lobe = EllipticLobe(x_vec3(0u), x(5u), along, x(4u), cross(x_vec3(0u), along));
                y(0u, elliptic_value(lobe, x(5u), x_vec3(6u)));
                y(1u, elliptic_versine(lobe, x_vec3(6u)));
                y_vec3(2u, elliptic_normal(lobe, x_vec3(9u)));
                y_vec3(5u, elliptic_direction(lobe, ring_place(2u)));
                y(8u, ring_weight(0u) + 6.0 * ring_weight(3u));
                y(9u, dot(x_vec3(6u) * elliptic_stretch(lobe), elliptic_normal(lobe, x_vec3(9u))));",
            inputs: 12,
            outputs: 10,
            twin: |x, y| {
                let lobe = lobe_of(vec3(x, 0), x[3], x[4], x[5]);
                let (direction, normal) = (vec3(x, 6), vec3(x, 9));
                y.push(elliptic_value(lobe, x[5], direction));
                y.push(elliptic_versine(lobe, direction));
                push3(y, elliptic_normal(lobe, normal));
                push3(y, elliptic_direction(lobe, ring_place(2)));
                y.push(ring_weight(0) + 6.0 * ring_weight(3));
                let mapped = elliptic_stretch(lobe).transpose() * direction;
                y.push(mapped.dot(elliptic_normal(lobe, normal)));
            },
            oracle: Some(|x, y| {
                let [axis, along, across] = axes_of(x);
                let to = mapped(x, dvec3(x, 6));
                let versine = 1.0 - to.normalize().z;
                y.push((-(x[5] * versine).min(8.0)).exp() / to.length().powi(3));
                y.push(versine);
                let matrix = DMat3::from_cols(along * x[4], across / x[4], axis);
                y.extend((matrix.inverse() * dvec3(x, 9)).to_array());
                let reach = (2.0 / x[5].sqrt()).min(1.0);
                let node = axis
                    + along * (0.5 * reach / x[4])
                    + across * (0.75_f64.sqrt() * reach * x[4]);
                y.extend(node.normalize().to_array());
                y.push(1.0);
                // A plane through the origin stays one.
                y.push(dvec3(x, 6).dot(dvec3(x, 9)));
            }),
            domains: vec![domain(
                "any",
                rows(831, 500, |random, row| {
                    let axis = random.direction();
                    push3(row, axis);
                    row.push(random.range(-3.0, 3.0));
                    row.push(random.range(0.36, 1.0));
                    let sharpness = random.log_range(-0.5, 4.0);
                    row.push(sharpness);
                    let angle = random.range(0.0, (3.0 / sharpness.sqrt()).min(1.5));
                    push3(row, random.around(axis, angle));
                    push3(row, random.direction());
                }),
                absolute(2e-5),
                absolute(2e-5),
            )],
            mutations: vec![
                mutation("squared * sqrt(squared)", "squared"),
                mutation("dot(lobe.across, normal) * lobe.stretch", "dot(lobe.across, normal)"),
                mutation("NODE_RADIUS: f32 = 2.0", "NODE_RADIUS: f32 = 1.9"),
                mutation("return 0.5 * dot(offset, offset)", "return 0.51 * dot(offset, offset)"),
                mutation("select(1.0 / 12.0, 0.5", "select(1.0 / 12.0, 0.6"),
            ],
        },
    ]
}

/// Stretched or not, the lobe holds what its Gaussian does.
#[test]
fn an_elliptic_lobe_has_the_integral_of_its_gaussian() {
    const STEPS: u32 = 400;
    for (stretch, sharpness) in [(1.0, 9.0), (0.7, 9.0), (0.4, 30.0), (0.36, 3.0)] {
        let lobe = lobe_of(Vec3::Z, 0.3, stretch, sharpness);
        let mut sum = 0.0;
        for i in 0..STEPS {
            for j in 0..STEPS {
                let angle = std::f32::consts::TAU * (i as f32 + 0.5) / STEPS as f32;
                // Area-preserving.
                let z = 1.0 - 2.0 * (j as f32 + 0.5) / STEPS as f32;
                let radius = (1.0 - z * z).sqrt();
                let direction = Vec3::new(radius * angle.cos(), radius * angle.sin(), z);
                // Not cut off.
                let versine = elliptic_versine(lobe, direction);
                if sharpness * versine < 8.0 {
                    sum += f64::from(elliptic_value(lobe, sharpness, direction));
                }
            }
        }
        let integral = sum * 4.0 * std::f64::consts::PI / f64::from(STEPS * STEPS);
        let truth = f64::from(sg_integral(sharpness));
        assert!(
            (integral / truth - 1.0).abs() < 5e-3,
            "{stretch}, {sharpness}: {integral}, {truth}"
        );
    }
}

/// The rule is exact to the fifth degree, and not to the sixth.
#[test]
fn the_rule_has_the_moments_of_a_gaussian() {
    // In widths: the nodes are at a radius of 2.
    let mean = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        (0..RING_NODES)
            .map(|i| {
                let place = 2.0 * ring_place(i).as_dvec2();
                f64::from(ring_weight(i)) * f(place.x, place.y)
            })
            .sum()
    };
    assert!((mean(&|_, _| 1.0) - 1.0).abs() < 1e-6);
    for (name, value, truth) in [
        ("x^2", mean(&|x, _| x * x), 1.0),
        ("xy", mean(&|x, y| x * y), 0.0),
        ("x^4", mean(&|x, _| x.powi(4)), 3.0),
        ("x^2 y^2", mean(&|x, y| x * x * y * y), 1.0),
        ("x^3 y", mean(&|x, y| x.powi(3) * y), 0.0),
        ("x^5", mean(&|x, _| x.powi(5)), 0.0),
    ] {
        assert!((value - truth).abs() < 1e-5, "{name}: {value}");
    }
    assert!((mean(&|x, _| x.powi(6)) - 15.0).abs() > 1.0);
}

/// A product of two lobes of GGX, which a Gaussian of the same curvature at the peak leaves a quarter of the light out of.
#[test]
fn a_product_of_tails_keeps_its_light() {
    let sharpness = 40.0_f64;
    // (1 + λ (1 - cosine) / 4)^-4: as sharp at its peak as a Gaussian of sharpness λ.
    let value = |direction: Vec3| {
        let versine = 0.5 * f64::from((direction - Vec3::Z).length_squared());
        (1.0 + 0.25 * sharpness * versine).powi(-4)
    };
    // ∫ 2π (1 + λt/4)^-4 dt over [0, 2].
    let end = (1.0 + 0.5 * sharpness).powi(-3);
    let truth = std::f64::consts::TAU * 4.0 / (3.0 * sharpness) * (1.0 - end);
    let basis = orthonormal_basis(Vec3::Z);
    let step = 2.0 / (sharpness as f32).sqrt();
    let mut ring = lobe_ring_new();
    for i in 0..RING_NODES {
        let place = ring_place(i);
        let at = Vec3::Z + step * (basis.x_axis * place.x + basis.y_axis * place.y);
        ring = lobe_ring_add(ring, place, value(at.normalize()).ln() as f32);
    }
    let lobe = elliptic_lobe(Vec3::Z, basis, step, ring, sharpness as f32);
    let mean: f64 = (0..RING_NODES)
        .map(|i| {
            let direction = elliptic_direction(lobe, ring_place(i));
            f64::from(ring_weight(i)) * value(direction)
                / f64::from(elliptic_value(lobe, lobe.sharpness, direction))
        })
        .sum();
    let of = |sharpness: f32| f64::from(sg_integral(sharpness)) / truth - 1.0;
    let (ours, laplace) = (
        (1.0 + of(lobe.sharpness)) * mean - 1.0,
        of(sharpness as f32),
    );
    println!(
        "product of tails: {:+.1} %, by Laplace's method {:+.1} %",
        100.0 * ours,
        100.0 * laplace
    );
    assert!(ours.abs() < 0.07, "{ours}");
    assert!(laplace < -0.15, "{laplace}");
}
