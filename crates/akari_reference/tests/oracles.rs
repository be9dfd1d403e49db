//! The path tracer against solutions without Monte Carlo, within its own stated noise.

mod common;

use akari_reference::analytic::{ggx_albedo, polygon_ggx_radiance, polygon_irradiance};
use akari_scene::exr_io::RgbImage;
use akari_scene::{
    AreaLight, AreaLightShape, ColorSpace, Environment, Filter, Image, Pixels, PunctualKind,
    PunctualLight, Scene, Texture, Wrap,
};
use common::*;
use glam::{Affine2, DAffine3, DQuat, DVec3, Vec2, Vec3};
use std::f64::consts::PI;

fn scene_with(floor_material: akari_scene::Material, lights: &[Vec<Vec3>]) -> Scene {
    let mut scene = Scene::default();
    scene.cameras.push(looking_down());
    add_polygon(&mut scene, "floor", &floor(3.0), floor_material);
    for light in lights {
        add_polygon(&mut scene, "light", light, emitter(3.0));
    }
    scene
}

/// A triangle and a quad over the floor, a hexagon beside it that the horizon cuts, a concave polygon.
fn lights() -> Vec<(&'static str, Vec<Vec3>)> {
    let hexagon = (0..6)
        .map(|i| {
            let a = i as f32 * std::f32::consts::FRAC_PI_3;
            Vec3::new(0.8 * a.cos(), 0.8 * a.sin(), -1.6)
        })
        .collect();
    let at = |list: &[[f32; 3]]| list.iter().map(|p| Vec3::from(*p)).collect();
    vec![
        (
            "triangle",
            at(&[[0.3, 1.4, -0.4], [0.9, 1.2, 0.3], [0.2, 1.0, 0.5]]),
        ),
        (
            "quad",
            at(&[
                [-0.5, 1.5, -0.5],
                [0.5, 1.5, -0.5],
                [0.5, 1.5, 0.5],
                [-0.5, 1.5, 0.5],
            ]),
        ),
        ("hexagon through the floor", hexagon),
        (
            "small and far",
            at(&[
                [4.0, 9.0, 0.0],
                [4.1, 9.0, 0.0],
                [4.1, 9.0, 0.1],
                [4.0, 9.0, 0.1],
            ]),
        ),
    ]
}

fn f64s(polygon: &[Vec3]) -> Vec<DVec3> {
    polygon.iter().map(|p| p.as_dvec3()).collect()
}

#[test]
fn lambert_under_polygons_is_lamberts_formula() {
    for (name, light) in lights() {
        let scene = scene_with(lambert(0.6), std::slice::from_ref(&light));
        let polygon = f64s(&light);
        let truth = |p: DVec3| 0.6 / PI * 3.0 * polygon_irradiance(&polygon, p, DVec3::Y).max(0.0);
        let options = akari_reference::Options {
            no_occlusion: true,
            ..small()
        };
        assert_within_noise(&run(&scene, None, &options), name, truth);
        // Nothing is between the floor and the light but the floor itself: shadows change nothing here.
        assert_within_noise(&run(&scene, None, &small()), name, truth);
    }
}

#[test]
fn several_lights_add_up() {
    let all: Vec<Vec<Vec3>> = lights().into_iter().map(|(_, l)| l).collect();
    let scene = scene_with(lambert(0.6), &all);
    let polygons: Vec<Vec<DVec3>> = all.iter().map(|l| f64s(l)).collect();
    let options = akari_reference::Options {
        no_occlusion: true,
        ..small()
    };
    assert_within_noise(&run(&scene, None, &options), "all lights", |p| {
        let sum: f64 = polygons
            .iter()
            .map(|l| polygon_irradiance(l, p, DVec3::Y).max(0.0))
            .sum();
        0.6 / PI * 3.0 * sum
    });
}

#[test]
#[should_panic(expected = "bias")]
fn two_percent_too_much_is_found() {
    let (_, light) = lights().remove(1);
    let scene = scene_with(lambert(0.6), std::slice::from_ref(&light));
    let output = run(&scene, None, &small());
    let polygon = f64s(&light);
    // The rms test would also fail: allow it, the mean is what must be caught.
    let mut generous = output.clone();
    generous.noise.as_mut().unwrap().relative_rms = 0.03;
    assert_within_noise(&generous, "wrong on purpose", |p| {
        1.02 * 0.6 / PI * 3.0 * polygon_irradiance(&polygon, p, DVec3::Y)
    });
}

#[test]
fn ggx_under_polygons_is_its_quadrature() {
    let eye = DVec3::new(0.0, 2.0, 2.5);
    for (roughness, spp) in [(0.15, 512), (0.4, 256), (1.0, 256)] {
        let alpha = f64::from(roughness * roughness);
        for (name, light) in lights().into_iter().take(3) {
            let scene = scene_with(white_metal(roughness), std::slice::from_ref(&light));
            let polygon = f64s(&light);
            let options = akari_reference::Options {
                spp,
                no_occlusion: true,
                ..small()
            };
            let output = run(&scene, None, &options);
            assert_within_noise(&output, &format!("{name}, roughness {roughness}"), |p| {
                let view = (eye - p).normalize();
                3.0 * polygon_ggx_radiance(&polygon, p, DVec3::Y, view, alpha, 1e-4)
            });
        }
    }
}

#[test]
fn white_furnace() {
    let sky = Environment::uniform([1.0; 3]);
    let eye = DVec3::new(0.0, 2.0, 2.5);
    for roughness in [0.1, 0.3, 0.6, 1.0] {
        let scene = scene_with(white_metal(roughness), &[]);
        let output = run(&scene, Some(&sky), &small());
        let alpha = f64::from(roughness * roughness);
        assert_within_noise(&output, &format!("furnace, roughness {roughness}"), |p| {
            let albedo = ggx_albedo((eye - p).normalize().y, alpha, 300);
            assert!(albedo <= 1.0 + 1e-6);
            albedo
        });
        for p in &output.color.data {
            assert!(p[0] <= 1.02, "{p:?}");
        }
    }
    // Lambert loses nothing but its albedo; a coated one no more than all.
    let output = run(&scene_with(lambert(0.7), &[]), Some(&sky), &small());
    assert_within_noise(&output, "Lambert furnace", |_| 0.7);
    let coated = akari_scene::Material {
        specular: 1.0,
        roughness: 0.3,
        ..lambert(1.0)
    };
    let data = run(&scene_with(coated, &[]), Some(&sky), &small())
        .color
        .data;
    let mean = data.iter().map(|p| p[0]).sum::<f32>() / data.len() as f32;
    // glTF's Fresnel mix by V·H is not exactly conserving: a white base under a coat gains up to a percent.
    assert!(mean < 1.02 && mean > 0.95, "{mean}");
}

#[test]
fn closed_box_that_glows() {
    // Every wall emits e and reflects ρ: radiance is e (1 − ρ^D)/(1 − ρ) everywhere, whatever the shape.
    let (e, rho) = (0.5, 0.7_f32);
    let mut scene = Scene::default();
    let mut camera = looking_down();
    camera.world_from_local.translation = DVec3::new(0.1, 0.2, 0.3);
    scene.cameras.push(camera);
    let wall = akari_scene::Material {
        emission: Vec3::splat(e),
        ..lambert(rho)
    };
    let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut corners = square.map(|(a, b)| {
                let mut p = [0.0; 3];
                p[axis] = side;
                p[(axis + 1) % 3] = a;
                p[(axis + 2) % 3] = b;
                Vec3::from(p)
            });
            if side > 0.0 {
                corners.reverse();
            }
            add_polygon(&mut scene, "wall", &corners, wall.clone());
        }
    }
    for depth in [1, 2, 3, 6, 12] {
        let options = akari_reference::Options {
            max_depth: depth,
            spp: 64,
            ..small()
        };
        let output = run(&scene, None, &options);
        let truth = f64::from(e * (1.0 - rho.powi(depth as i32)) / (1.0 - rho));
        assert_within_noise(&output, &format!("glowing box, depth {depth}"), |_| truth);
    }
}

#[test]
fn punctual_lights() {
    let mut scene = scene_with(lambert(0.5), &[]);
    let position = DVec3::new(0.3, 1.5, -0.2);
    // Local −Z points down.
    let down = DAffine3::from_rotation_translation(DQuat::from_rotation_x(-PI / 2.0), position);
    let light = |kind, intensity: f32| PunctualLight {
        name: "lamp".into(),
        kind,
        intensity: Vec3::splat(intensity),
        range: None,
        world_from_local: down,
    };
    let point = light(PunctualKind::Point, 10.0);
    let at_point = move |p: DVec3| {
        let d = position - p;
        0.5 / PI * 10.0 * d.y / d.length().powi(3)
    };
    scene.punctual_lights = vec![point.clone()];
    assert_within_noise(&run(&scene, None, &small()), "point", at_point);
    scene.punctual_lights = vec![light(PunctualKind::Directional, 4.0)];
    assert_within_noise(&run(&scene, None, &small()), "directional", |_| {
        0.5 / PI * 4.0
    });
    let spot = PunctualKind::Spot {
        inner_cone_angle: 0.2,
        outer_cone_angle: 0.6,
    };
    scene.punctual_lights = vec![light(spot, 10.0)];
    assert_within_noise(&run(&scene, None, &small()), "spot", |p| {
        let cos = (position - p).normalize().y;
        let (inner, outer) = (0.2_f64.cos(), 0.6_f64.cos());
        at_point(p) * ((cos - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2)
    });
    scene.punctual_lights = vec![point, light(PunctualKind::Directional, 4.0)];
    assert_within_noise(&run(&scene, None, &small()), "two", |p| {
        at_point(p) + 0.5 / PI * 4.0
    });
}

#[test]
fn draft_area_lights() {
    // A rectangle that looks down, against the polygon of the same shape; not seen by the camera, nor in the way.
    let mut scene = scene_with(lambert(0.5), &[]);
    let down = DAffine3::from_rotation_translation(DQuat::from_rotation_x(-PI / 2.0), DVec3::Y);
    let light = |shape| AreaLight {
        name: "panel".into(),
        shape,
        radiance: Vec3::splat(2.0),
        world_from_local: down,
    };
    scene.area_lights = vec![light(AreaLightShape::Rect {
        width: 1.0,
        height: 0.5,
    })];
    let corners = [(-0.5, -0.25), (0.5, -0.25), (0.5, 0.25), (-0.5, 0.25)];
    let polygon: Vec<DVec3> = corners.map(|(x, z)| DVec3::new(x, 1.0, z)).to_vec();
    assert_within_noise(&run(&scene, None, &small()), "rect", |p| {
        0.5 / PI * 2.0 * polygon_irradiance(&polygon, p, DVec3::Y)
    });
    scene.materials[0] = white_metal(0.3);
    let eye = DVec3::new(0.0, 2.0, 2.5);
    assert_within_noise(&run(&scene, None, &small()), "rect, reflected", |p| {
        let view = (eye - p).normalize();
        2.0 * polygon_ggx_radiance(&polygon, p, DVec3::Y, view, f64::from(0.3_f32 * 0.3), 1e-4)
    });
    // A disk of radius r at height h over the point below it: E = π L r²/(r² + h²); here a far point is enough.
    scene.materials[0] = lambert(0.5);
    scene.area_lights = vec![light(AreaLightShape::Disk { diameter: 1.0 })];
    let disk: Vec<DVec3> = (0..4000)
        .map(|i| {
            let a = f64::from(i) * PI / 2000.0;
            DVec3::new(0.5 * a.cos(), 1.0, 0.5 * a.sin())
        })
        .collect();
    assert_within_noise(&run(&scene, None, &small()), "disk", |p| {
        0.5 / PI * 2.0 * polygon_irradiance(&disk, p, DVec3::Y)
    });
}

/// A texture of one row, looked up without interpolation.
fn texture_row(
    scene: &mut Scene,
    name: &str,
    texels: &[[u8; 4]],
    color_space: ColorSpace,
) -> Texture {
    scene.images.push(Image {
        name: name.into(),
        width: texels.len() as u32,
        height: 1,
        pixels: Pixels::U8(texels.to_vec()),
    });
    Texture {
        image: scene.images.len() - 1,
        color_space,
        tex_coord: 0,
        transform: Affine2::IDENTITY,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        filter: Filter::Nearest,
    }
}

/// Texture coordinates of a quad's corners: u along the first edge, v along the last.
const QUAD_UVS: [Vec2; 4] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];

#[test]
fn half_lit_texture_is_half_a_polygon() {
    let (_, light) = lights().remove(1);
    let mut scene = scene_with(lambert(0.6), std::slice::from_ref(&light));
    let texels = [[255, 255, 255, 255], [0, 0, 0, 255]];
    let texture = texture_row(&mut scene, "half", &texels, ColorSpace::Srgb);
    scene.materials[1].emissive_texture = Some(texture);
    scene.meshes[1].primitives[0].uvs[0] = QUAD_UVS.to_vec();
    let q = f64s(&light);
    let half = [q[0], 0.5 * (q[0] + q[1]), 0.5 * (q[2] + q[3]), q[3]];
    let truth = |p: DVec3| 0.6 / PI * 3.0 * polygon_irradiance(&half, p, DVec3::Y);
    assert_within_noise(&run(&scene, None, &small()), "half-lit texture", truth);
    // The other half would be another image.
    let other = [half[1], q[1], q[2], half[2]];
    let p = DVec3::new(-0.3, 0.0, 0.2);
    assert!(
        (truth(p) / (0.6 / PI * 3.0 * polygon_irradiance(&other, p, DVec3::Y)) - 1.0).abs() > 0.1
    );
}

#[test]
fn constant_normal_map_tilts_the_normal() {
    let mut scene = scene_with(lambert(0.6), &[]);
    // Red 0.6, green −0.4: towards the tangent and against the bitangent.
    let byte = |x: f32| ((x + 1.0) * 127.5).round() as u8;
    let texel = [byte(0.6), byte(-0.4), byte(0.692_820_3), 255];
    let texture = texture_row(&mut scene, "tilt", &[texel], ColorSpace::Linear);
    scene.materials[0].normal_texture = Some(texture);
    let primitive = &mut scene.meshes[0].primitives[0];
    primitive.uvs[0] = QUAD_UVS.to_vec();
    primitive.tangents = vec![Vec3::X.extend(1.0); 4];
    let output = run(&scene, Some(&Environment::uniform([1.0; 3])), &small());
    // n = +Y, t = +X, b = n × t = −Z.
    let expected = Vec3::new(0.6, 0.692_820_3, 0.4);
    for n in &output.aovs.unwrap().normal {
        assert!((Vec3::from(*n) - expected).length() < 0.01, "{n:?}");
    }
}

#[test]
fn environment_with_a_sun() {
    // A dim sky with one bright texel above the horizon, against a fine midpoint sum.
    let (w, h) = (64_u32, 32_u32);
    let mut image = RgbImage::filled(w, h, [0.2; 3]);
    image.data[(6 * w + 40) as usize] = [900.0; 3];
    let sky = Environment::from_image("sky".as_ref(), image).unwrap();
    let n = 2048;
    let mut irradiance = 0.0;
    for j in 0..n / 4 {
        let v = (f64::from(j) + 0.5) / f64::from(n / 2);
        let weight = (PI * v).sin() * (PI * v).cos();
        for i in 0..n {
            let u = (f64::from(i) + 0.5) / f64::from(n);
            let direction = Environment::direction(u as f32, v as f32);
            irradiance += weight * f64::from(sky.radiance(direction).x);
        }
    }
    irradiance *= 2.0 * PI * PI / f64::from(n * (n / 2));
    let output = run(&scene_with(lambert(0.6), &[]), Some(&sky), &small());
    assert_within_noise(&output, "sun", |_| 0.6 / PI * irradiance);
}
