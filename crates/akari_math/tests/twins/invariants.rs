//! What holds whatever the numbers are: parts add up, shares stay shares, more of a cause is no less of its effect.

use akari_math::convex_shadow::{
    ClippedPolygon, box_shadow, clipped_polygon_new, clipped_polygon_push, sphere_shadow,
};
use akari_math::directional_albedo::ggx_albedo_terms;
use akari_math::form_factor::{
    form_factor_chain_close, form_factor_chain_new, form_factor_chain_push,
};
use akari_math::sg::lobe::sg_integral;
use akari_math::sg::polygon::sg_polygon_integral;
use akari_math::voxel::cone::{cone_tangent, crossing_transmittance, lobe_cone_height};
use akari_math::voxel::coverage::triangle_in_cube;
use akari_math::voxel::slice::plane_slice_share;
use glam::Vec3;
use proptest::prelude::*;

fn direction() -> impl Strategy<Value = Vec3> {
    (-1.0_f32..1.0, 0.0_f32..std::f32::consts::TAU).prop_map(|(z, angle)| {
        let radius = (1.0 - z * z).sqrt();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    })
}

fn point(lo: f32, hi: f32) -> impl Strategy<Value = Vec3> {
    (lo..hi, lo..hi, lo..hi).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

/// A rectangle wholly above the horizon.
fn lifted() -> impl Strategy<Value = [Vec3; 4]> {
    (direction(), 0.05_f32..0.6, 0.05_f32..0.6).prop_map(|(d, a, b)| {
        let center = Vec3::new(2.0 * d.x, 2.0 * d.y, 1.0 + d.z.abs());
        let u = center.cross(Vec3::new(0.3, 0.5, -0.8)).normalize() * a;
        let v = u.cross(center).normalize() * b;
        [
            center - u - v,
            center + u - v,
            center + u + v,
            center - u + v,
        ]
    })
}

fn vector_form_factor(vertices: &[Vec3]) -> Vec3 {
    let mut chain = form_factor_chain_new();
    for &vertex in vertices {
        chain = form_factor_chain_push(chain, vertex);
    }
    form_factor_chain_close(chain)
}

fn clipped(corners: [Vec3; 4], apex: Vec3) -> ClippedPolygon {
    let mut polygon = clipped_polygon_new();
    for corner in corners {
        clipped_polygon_push(&mut polygon, corner - apex);
    }
    polygon
}

/// Largest error of eight nodes over the lobe's integral, as documented.
const EIGHT_NODES: f32 = 1.0e-4;

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, rng_seed: proptest::test_runner::RngSeed::Fixed(11), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn parts_of_a_polygon_under_a_lobe_add_up(quad in lifted(), axis in direction(), log in -2.0_f32..6.0, s in 0.1_f32..0.9, t in 0.1_f32..0.9) {
        let sharpness = 10.0_f32.powf(log);
        let energy = sg_integral(sharpness);
        let share = |polygon: &[Vec3]| sg_polygon_integral(polygon, axis, sharpness, 8) / energy;
        let [a, b, c, d] = quad;
        let (p, q) = (a.lerp(b, s), d.lerp(c, t));
        let whole = share(&quad);
        let parts = share(&[a, p, q, d]) + share(&[p, b, c, q]);
        // Each of the three is off by as much as the rule is.
        prop_assert!((whole - parts).abs() <= 3.0 * EIGHT_NODES + 2e-6, "{whole} {parts}");
        prop_assert!(whole.abs() <= 1.0 + EIGHT_NODES);
        // The other way round it has the other sign.
        let turned = share(&[d, c, b, a]);
        prop_assert!((whole + turned).abs() <= 2.0 * EIGHT_NODES + 2e-6, "{whole} {turned}");
    }

    #[test]
    fn parts_of_a_triangle_in_voxels_add_up(a in point(0.05, 2.95), b in point(0.05, 2.95), c in point(0.05, 2.95)) {
        let mut sum = Vec3::ZERO;
        let mut moment = Vec3::ZERO;
        for cell in 0..27 {
            let corner = Vec3::new((cell % 3) as f32, (cell / 3 % 3) as f32, (cell / 9) as f32);
            let part = triangle_in_cube(a - corner, b - corner, c - corner);
            sum += part.area;
            moment += part.area.length() * (part.centroid + corner);
        }
        let whole = 0.5 * (b - a).cross(c - a);
        prop_assert!((sum - whole).length() <= 1e-5, "{sum} {whole}");
        let centroid = (a + b + c) / 3.0;
        prop_assert!((moment - whole.length() * centroid).length() <= 3e-5, "{moment}");
    }

    #[test]
    fn what_is_hidden_is_a_part(quad in lifted(), apex in point(-4.0, 4.0)) {
        let seen = vector_form_factor(&quad.map(|v| v - apex)).length();
        for shadow in [box_shadow as fn(&mut ClippedPolygon, Vec3), sphere_shadow] {
            let mut polygon = clipped(quad, apex);
            shadow(&mut polygon, apex);
            let hidden = vector_form_factor(&polygon.vertices[..polygon.count as usize]).length();
            prop_assert!(hidden <= seen + 1e-6, "{hidden} of {seen}");
        }
        // The ball is within the box: seen from outside of both it hides no more, but for its octagon's corners.
        prop_assume!(apex.abs().max_element() > 1.0);
        let mut by_box = clipped(quad, apex);
        box_shadow(&mut by_box, apex);
        let of = |p: &ClippedPolygon| vector_form_factor(&p.vertices[..p.count as usize]).length();
        let mut by_ball = clipped(quad, apex);
        sphere_shadow(&mut by_ball, apex);
        prop_assert!(of(&by_ball) <= of(&by_box) * 1.06 + 0.02, "{} {}", of(&by_ball), of(&by_box));
    }

    #[test]
    fn light_through_voxels_only_gets_less(coverage in point(0.0, 0.99), crossings in point(0.0, 4.0), more in 0.0_f32..1.0, axis in 0_usize..3) {
        let through = crossing_transmittance(coverage, crossings);
        prop_assert!((0.0..=1.0).contains(&through));
        let mut covered = coverage;
        covered[axis] += (0.99 - coverage[axis]) * more;
        prop_assert!(crossing_transmittance(covered, crossings) <= through * (1.0 + 1e-5) + 1e-7);
        let mut longer = crossings;
        longer[axis] += more;
        prop_assert!(crossing_transmittance(coverage, longer) <= through * (1.0 + 1e-5) + 1e-7);
        // Two stretches, one after the other.
        let twice = crossing_transmittance(coverage, crossings + crossings);
        prop_assert!((twice - through * through).abs() <= 1e-5, "{twice} {through}");
    }

    #[test]
    fn cones_widen_with_energy_and_narrow_with_sharpness(log in -6.0_f32..12.0, energy in 0.0_f32..0.98, more in 1e-3_f32..0.01) {
        let sharpness = 10.0_f32.powf(log);
        let height = lobe_cone_height(sharpness, energy);
        prop_assert!((0.0..=2.0).contains(&height));
        prop_assert!(lobe_cone_height(sharpness, energy + more) >= height);
        prop_assert!(lobe_cone_height(sharpness * 1.1, energy) <= height * (1.0 + 1e-6));
        prop_assert!(cone_tangent(height) >= 0.0);
    }

    #[test]
    fn slices_are_shares(normal in direction(), point in point(0.0, 1.0)) {
        let share = plane_slice_share(normal, point);
        prop_assert!((-1e-6..=1.0 + 1e-6).contains(&share), "{share}");
        // A point of the voxel lies on the plane, and so does the opposite normal's.
        prop_assert!((plane_slice_share(-normal, point) - share).abs() <= 3e-5);
    }

    #[test]
    fn no_surface_reflects_more_than_it_gets(roughness in 0.0_f32..1.0, cosine in 0.0_f32..1.0) {
        let terms = ggx_albedo_terms(roughness, cosine);
        prop_assert!(terms.x >= -1e-6 && terms.y >= 0.0 && terms.x + terms.y <= 1.0 + 1e-6, "{terms}");
    }
}
