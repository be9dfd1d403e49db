//! Rows of `area_light` and `tile_bounds`, and the bounds against what they bound.

use crate::harness::{
    Budget, Case, Mutation, Random, absolute, domain, dvec3, push3, rows, ulp, ulp_of, vec3,
};
use akari_math::{area_light, oracle, tile_bounds};
use glam::{DMat3, DVec3, Vec3, Vec4};

const LIGHT: &str = "akari_math::area_light";
const BOUNDS: &str = "akari_math::tile_bounds";

fn light_mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: LIGHT,
        from,
        to,
    }
}

fn bounds_mutation(from: &'static str, to: &'static str) -> Mutation {
    Mutation {
        module: BOUNDS,
        from,
        to,
    }
}

/// A box, a sphere, a plane.
fn scenes(seed: u64, n: usize) -> Vec<f32> {
    rows(seed, n, |random, row| {
        let corner = random.direction() * random.range(0.0, 3.0);
        push3(row, corner);
        push3(
            row,
            corner
                + Vec3::new(
                    random.range(0.1, 2.0),
                    random.range(0.1, 2.0),
                    random.range(0.1, 2.0),
                ),
        );
        push3(row, random.direction() * random.range(0.0, 5.0));
        row.push(random.range(0.1, 2.0));
        push3(row, random.direction());
        row.push(random.range(-3.0, 3.0));
    })
}

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            module: LIGHT,
            functions: &["range_falloff"],
            imports: "",
            body: "y(0u, range_falloff(x(0u), x(1u)));",
            inputs: 2,
            outputs: 1,
            twin: |x, y| y.push(area_light::range_falloff(x[0], x[1])),
            oracle: Some(|x, y| y.push((1.0 - (x[0] * x[1]).powi(2)).clamp(0.0, 1.0).powi(2))),
            domains: vec![
                domain("within", rows(80, 300, |r, row| row.extend([r.range(0.0, 25.0), 0.04])), absolute(5e-7), ulp_of(4, 1.0)),
                domain("beyond, or without range", vec![26.0, 0.04, 1e20, 1e10, 1e20, 0.0, 0.0, 0.04, 25.0, 0.04], absolute(5e-7), ulp_of(1, 1.0)),
            ],
            mutations: vec![light_mutation("ratio * ratio", "ratio"), light_mutation("min(distance_squared * inverse_range_squared, 1.0)", "min(distance_squared * inverse_range_squared, 1.01)")],
        },
        Case {
            module: LIGHT,
            functions: &["surface_reflectance", "dielectric_f0_from_reflectance", "dielectric_f90_from_f0"],
            imports: "",
            body: "let s = surface_reflectance(x_vec3(0u), x(3u), x(4u));
                y_vec3(0u, s.diffuse_color); y(3u, s.grazing_reflectance); y_vec3(4u, s.normal_reflectance);
                y(7u, s.dielectric_normal_reflectance); y(8u, s.dielectric_grazing_reflectance);
                y(9u, dielectric_f0_from_reflectance(x(4u))); y(10u, dielectric_f90_from_f0(x(4u)));",
            inputs: 5,
            outputs: 11,
            twin: |x, y| {
                let s = area_light::surface_reflectance(vec3(x, 0), x[3], x[4]);
                push3(y, s.diffuse_color);
                y.push(s.grazing_reflectance);
                push3(y, s.normal_reflectance);
                y.extend([
                    s.dielectric_normal_reflectance,
                    s.dielectric_grazing_reflectance,
                    area_light::dielectric_f0_from_reflectance(x[4]),
                    area_light::dielectric_f90_from_f0(x[4]),
                ]);
            },
            oracle: Some(|x, y| {
                let (color, metallic) = (dvec3(x, 0), x[3]);
                let f0 = 0.16 * x[4] * x[4];
                let f90 = (f0 / 0.04).min(1.0);
                y.extend((color * (1.0 - metallic)).to_array());
                y.push(f90 + (1.0 - f90) * metallic);
                y.extend(DVec3::splat(f0).lerp(color, metallic).to_array());
                y.extend([f0, f90, f0, (x[4] / 0.04).min(1.0)]);
            }),
            domains: vec![
                domain("materials", rows(81, 300, |r, row| row.extend((0..5).map(|_| r.range(0.0, 1.0)))), absolute(3e-7), ulp_of(2, 1.0)),
                domain("Lambert, metal", vec![0.5, 0.6, 0.7, 0.0, 0.0, 0.5, 0.6, 0.7, 1.0, 0.5], absolute(1e-7), ulp(1)),
            ],
            mutations: vec![
                light_mutation("MAX_DIELECTRIC_F_ZERO: f32 = 0.16", "MAX_DIELECTRIC_F_ZERO: f32 = 0.161"),
                light_mutation("FULL_GRAZING_F_ZERO: f32 = 0.04", "FULL_GRAZING_F_ZERO: f32 = 0.05"),
                light_mutation("dielectric_f90 * dielectric + metallic", "dielectric_f90 * dielectric"),
            ],
        },
        Case {
            module: LIGHT,
            functions: &["diffuse_transmission", "specular_albedo", "diffuse_specular_combine"],
            imports: "",
            body: "let t = diffuse_transmission(x_vec3(0u), x(3u), x(4u));
                let s = specular_albedo(x_vec3(0u), x(3u), x(4u), x(5u));
                y(0u, t); y_vec3(1u, s);
                y_vec3(4u, diffuse_specular_combine(x_vec3(6u), t * x_vec3(0u), x(4u), s, x(5u)));",
            inputs: 9,
            outputs: 7,
            twin: |x, y| {
                let t = area_light::diffuse_transmission(vec3(x, 0), x[3], x[4]);
                let s = area_light::specular_albedo(vec3(x, 0), x[3], x[4], x[5]);
                y.push(t);
                push3(y, s);
                push3(y, area_light::diffuse_specular_combine(vec3(x, 6), t * vec3(x, 0), x[4], s, x[5]));
            },
            oracle: Some(|x, y| {
                let f0 = dvec3(x, 0);
                let t = 1.0 - f0.lerp(DVec3::splat(x[3]), x[4]).max_element();
                let s = f0 * x[4] + x[3] * x[5];
                y.push(t);
                y.extend(s.to_array());
                y.extend((dvec3(x, 6) * (f0 * t * x[4] + s * x[5])).to_array());
            }),
            domains: vec![domain("parameters in [0, 1]", rows(82, 300, |r, row| row.extend((0..9).map(|_| r.range(0.0, 1.0)))), absolute(6e-7), ulp_of(4, 1.0))],
            mutations: vec![
                light_mutation("max(max(reflected.x, reflected.y), reflected.z)", "reflected.x"),
                light_mutation("f0 * scale + vec3<f32>(f90 * bias)", "f0 * scale + vec3<f32>(bias)"),
                light_mutation("diffuse_albedo * diffuse_integral +", "diffuse_albedo +"),
            ],
        },
        Case {
            module: BOUNDS,
            functions: &["box_distance_squared", "sphere_touches_box", "box_plane_distance", "box_behind_plane"],
            imports: "",
            body: "let lo = x_vec3(0u); let hi = x_vec3(3u); let plane = x_vec4(10u);
                y(0u, box_distance_squared(x_vec3(6u), lo, hi));
                y(1u, f32(sphere_touches_box(x_vec3(6u), x(9u), lo, hi)));
                y(2u, box_plane_distance(lo, hi, plane));
                y(3u, f32(box_behind_plane(lo, hi, plane)));",
            inputs: 14,
            outputs: 4,
            twin: |x, y| {
                let (lo, hi, plane) = (vec3(x, 0), vec3(x, 3), Vec4::new(x[10], x[11], x[12], x[13]));
                y.extend([
                    tile_bounds::box_distance_squared(vec3(x, 6), lo, hi),
                    tile_bounds::sphere_touches_box(vec3(x, 6), x[9], lo, hi) as f32,
                    tile_bounds::box_plane_distance(lo, hi, plane),
                    tile_bounds::box_behind_plane(lo, hi, plane) as f32,
                ]);
            },
            oracle: Some(|x, y| {
                let (lo, hi, p) = (dvec3(x, 0), dvec3(x, 3), dvec3(x, 6));
                let distance = (p.clamp(lo, hi) - p).length_squared();
                let corners = (0..8).map(|i| DVec3::new(if i & 1 == 0 { lo.x } else { hi.x }, if i & 2 == 0 { lo.y } else { hi.y }, if i & 4 == 0 { lo.z } else { hi.z }));
                let plane = corners.map(|c| c.dot(dvec3(x, 10)) + x[13]).fold(f64::NEG_INFINITY, f64::max);
                y.extend([distance, f64::from(u8::from(distance <= x[9] * x[9])), plane, f64::from(u8::from(plane < 0.0))]);
            }),
            domains: vec![domain("boxes", scenes(83, 1000), Budget { ulp: 4, absolute: 4e-6 }, ulp_of(8, 4.0))],
            mutations: vec![
                bounds_mutation("max(box_min - point, point - box_max)", "max(box_min - point, box_max - point)"),
                bounds_mutation("<= radius * radius", "<= radius"),
                bounds_mutation("< -SLACK * magnitude", "< SLACK * magnitude + 0.1"),
            ],
        },
        Case {
            module: BOUNDS,
            functions: &["solid_angle_bound", "form_factor_bound", "lobe_bound", "contribution_bound"],
            imports: "",
            body: "let s = solid_angle_bound(x(0u), x(1u), x(2u), x(3u));
                y(0u, s); y(1u, form_factor_bound(s)); y(2u, lobe_bound(s, x(4u))); y(3u, contribution_bound(2.5, s, x(4u)));",
            inputs: 5,
            outputs: 4,
            twin: |x, y| {
                let s = tile_bounds::solid_angle_bound(x[0], x[1], x[2], x[3]);
                y.extend([
                    s,
                    tile_bounds::form_factor_bound(s),
                    tile_bounds::lobe_bound(s, x[4]),
                    tile_bounds::contribution_bound(2.5, s, x[4]),
                ]);
            },
            oracle: None,
            domains: vec![
                // The bounds are made of one another: WGSL allows 2.5 ULP to each of the divisions and roots in a row.
                domain("near and far", rows(84, 500, |r, row| row.extend([r.log_range(-3.0, 1.0), r.range(0.1, 2.0), r.log_range(0.7, 5.0), r.range(-1.0, 5.0), r.range(0.0, 1.0)])), ulp(0), ulp(16)),
                domain("inside the sphere", vec![1.0, 1.0, 0.5, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1e7, 1e4, 1e12, 1.0, 1e-9], ulp(0), ulp(16)),
            ],
            mutations: vec![
                bounds_mutation("2.0 * sine * sine", "2.001 * sine * sine"),
                bounds_mutation("(area / max(gap, TINY)) * INV_PI", "(area / max(gap, TINY)) * 0.32"),
                bounds_mutation("* 0.5 / (a * a * a)", "* 0.5 / (a * a)"),
                bounds_mutation("return 4.0;", "return 3.0;"),
                bounds_mutation("radiance * (form_factor_bound", "1.001 * radiance * (form_factor_bound"),
            ],
        },
        Case {
            module: BOUNDS,
            functions: &["cutoff_class", "cutoff_class_edge"],
            imports: "",
            body: "let c = cutoff_class(x(0u)); y(0u, f32(c)); y(1u, cutoff_class_edge(c));",
            inputs: 1,
            outputs: 2,
            twin: |x, y| {
                let class = tile_bounds::cutoff_class(x[0]);
                y.extend([class as f32, tile_bounds::cutoff_class_edge(class)]);
            },
            oracle: None,
            domains: vec![
                domain("shares", rows(86, 500, |r, row| row.push(r.log_range(-12.0, 3.0))), ulp(0), ulp(0)),
                domain("edges", vec![0.0, 1e-30, 0.25, 0.5, 0.75, 1.0, 1.5, 1e30, 2.328_306_4e-10], ulp(0), ulp(0)),
            ],
            mutations: vec![
                bounds_mutation("HALF_OCTAVES_OF_ONE - 1u - steps", "HALF_OCTAVES_OF_ONE - steps"),
                bounds_mutation("steps >= HALF_OCTAVES_OF_ONE", "steps > HALF_OCTAVES_OF_ONE"),
                bounds_mutation("min(class_, CUTOFF_CLASSES)", "class_ + 1u"),
            ],
        },
    ]
}

/// A bound is below the edge of its class, and at least two thirds of it.
#[test]
fn classes_hold_their_bounds() {
    let mut random = Random::new(87);
    for _ in 0..1000 {
        let share = random.log_range(-9.0, 0.0);
        let edge = tile_bounds::cutoff_class_edge(tile_bounds::cutoff_class(share));
        assert!(
            share <= edge && edge <= share * 1.51,
            "{share} in a class to {edge}"
        );
    }
    assert_eq!(tile_bounds::cutoff_class(1.0), tile_bounds::CUTOFF_CLASSES);
    assert!(tile_bounds::cutoff_class(1.0 - f32::EPSILON) < tile_bounds::CUTOFF_CLASSES);
}

/// No polygon gives more than its bounds, Lambert or GGX; and the bounds are not idle.
#[test]
fn bounds_hold() {
    let mut random = Random::new(85);
    let (mut tightest, mut tightest_lobe) = (0.0_f64, 0.0_f64);
    for _ in 0..3000 {
        let normal = random.direction();
        let u = normal.cross(random.direction()).normalize();
        let v = normal.cross(u);
        let (half_u, half_v) = (random.log_range(-2.0, 0.3), random.log_range(-2.0, 0.3));
        let center = random.direction() * random.log_range(-0.5, 1.5);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(s, t)| center + s * half_u * u + t * half_v * v);
        let area = 4.0 * half_u * half_v;
        let radius = (half_u * half_u + half_v * half_v).sqrt();
        // The cell is the shading point itself.
        let plane = normal.extend(-normal.dot(center));
        let height = tile_bounds::box_plane_distance(Vec3::ZERO, Vec3::ZERO, plane).abs();
        let distance_squared = tile_bounds::box_distance_squared(center, Vec3::ZERO, Vec3::ZERO);
        let solid_angle = tile_bounds::solid_angle_bound(area, radius, distance_squared, height);
        let bound = f64::from(tile_bounds::form_factor_bound(solid_angle));
        let polygon = corners.map(|c| c.as_dvec3());
        let actual = oracle::form_factor(&polygon).z.abs();
        assert!(actual <= bound, "{actual} > {bound} for {corners:?}");
        tightest = tightest.max(actual / bound);

        // The lobe, with unit Fresnel reflectance, by quadrature over the polygon.
        let alpha = random.range(0.05, 1.0);
        let view = DVec3::new(random.range(0.01, 1.0).acos().sin() as f64, 0.0, 0.0);
        let view = DVec3::new(view.x, 0.0, (1.0 - view.x * view.x).sqrt().max(1e-3)).normalize();
        let n = 24;
        let mut lobe = 0.0;
        for i in 0..n {
            for j in 0..n {
                let (s, t) = ((i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64);
                let point =
                    polygon[0] + s * (polygon[1] - polygon[0]) + t * (polygon[3] - polygon[0]);
                let l = point.normalize();
                if l.z > 0.0 {
                    let density = oracle::ggx_ndf(DVec3::Z, view + l, f64::from(alpha))
                        * oracle::smith_masking_shadowing(view.z, l.z, f64::from(alpha))
                        / (4.0 * view.z);
                    lobe += density * normal.as_dvec3().dot(l).abs() / point.length_squared();
                }
            }
        }
        lobe *= f64::from(area) / (n * n) as f64;
        let bound = f64::from(tile_bounds::lobe_bound(solid_angle, alpha));
        // The bound 1 is that of a white furnace; the quadrature is too coarse for polygons that near.
        if bound >= 1.0 {
            continue;
        }
        // 5 % for the quadrature, which is coarse where a lobe is narrow and the polygon near.
        assert!(
            lobe <= 1.05 * bound,
            "{lobe} > {bound} at alpha {alpha} for {corners:?}"
        );
        tightest_lobe = tightest_lobe.max(lobe / bound);
    }
    println!("largest share of the bound: Lambert {tightest:.3}, lobe {tightest_lobe:.3}");
    assert!(tightest > 0.5 && tightest_lobe > 0.2);
    // The table's m_inv of a wide lobe is the identity: the Lambert bound is a bound of that too.
    assert_eq!(
        oracle::ltc_form_factor(&[DVec3::Z; 3], DMat3::IDENTITY),
        DVec3::ZERO
    );
}
