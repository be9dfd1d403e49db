//! Small scenes made by code.

// Each test file uses its own part.
#![allow(dead_code)]

use akari_reference::{NoProgress, Options, Output, render};
use akari_scene::{Camera, Environment, Instance, Material, Mesh, Primitive, Scene};
use glam::{DAffine3, DVec3, Vec3};

pub const SIZE: u32 = 16;

/// Adds a planar polygon as a fan of triangles.
pub fn add_polygon(scene: &mut Scene, name: &str, corners: &[Vec3], material: Material) {
    let normal = (corners[1] - corners[0])
        .cross(corners[2] - corners[0])
        .normalize();
    scene.materials.push(material);
    scene.meshes.push(Mesh {
        name: name.into(),
        primitives: vec![Primitive {
            positions: corners.to_vec(),
            normals: vec![normal; corners.len()],
            indices: (1..corners.len() as u32 - 1)
                .flat_map(|i| [0, i, i + 1])
                .collect(),
            material: scene.materials.len() - 1,
            ..Primitive::default()
        }],
    });
    scene.instances.push(Instance {
        name: name.into(),
        mesh: scene.meshes.len() - 1,
        world_from_local: DAffine3::IDENTITY,
    });
}

/// The square [−s, s]² in the plane y = 0, facing up.
pub fn floor(s: f32) -> [Vec3; 4] {
    [(-s, -s), (-s, s), (s, s), (s, -s)].map(|(x, z)| Vec3::new(x, 0.0, z))
}

pub fn lambert(albedo: f32) -> Material {
    Material {
        base_color: Vec3::splat(albedo).extend(1.0),
        metallic: 0.0,
        specular: 0.0,
        ..Material::default()
    }
}

pub fn white_metal(roughness: f32) -> Material {
    Material {
        roughness,
        ..Material::default()
    }
}

pub fn emitter(radiance: f32) -> Material {
    Material {
        emission: Vec3::splat(radiance),
        ..lambert(0.0)
    }
}

/// A camera that sees a part of the floor only.
pub fn looking_down() -> Camera {
    Camera::look_at(DVec3::new(0.0, 2.0, 2.5), DVec3::new(0.0, 0.0, 0.2), 0.5)
}

pub fn small() -> Options {
    Options {
        width: SIZE,
        height: SIZE,
        spp: 256,
        max_depth: 2,
        pixel_centers: true,
        aovs: true,
        ..Options::default()
    }
}

pub fn run(scene: &Scene, environment: Option<&Environment>, options: &Options) -> Output {
    let output = render(scene, environment, options, &NoProgress).unwrap();
    assert_eq!(output.statistics.non_finite_samples, 0);
    output
}

/// Compares the red channel with `expected(position)` of each pixel: within the image's own noise, in each pixel and
/// in the mean. Gives the relative error of the mean.
pub fn assert_within_noise(
    output: &Output,
    label: &str,
    mut expected: impl FnMut(DVec3) -> f64,
) -> f64 {
    let positions = &output.aovs.as_ref().unwrap().position;
    let (mut squares, mut errors, mut sum, mut difference) = (0.0, 0.0, 0.0, 0.0);
    for (pixel, position) in output.color.data.iter().zip(positions) {
        let truth = expected(Vec3::from(*position).as_dvec3());
        let error = f64::from(pixel[0]) - truth;
        squares += truth * truth;
        errors += error * error;
        sum += truth;
        difference += error;
    }
    assert!(sum > 0.0, "{label}: nothing to compare");
    let (rms, bias) = ((errors / squares).sqrt(), difference / sum);
    let noise = output.noise.unwrap().relative_rms;
    let count = positions.len() as f64;
    eprintln!("{label}: rms error {rms:.5}, stated noise {noise:.5}, bias {bias:+.5}");
    // f32 rounding has a floor of its own.
    const ROUNDING: f64 = 2e-6;
    assert!(rms < 1.3 * noise + ROUNDING, "{label}: {rms} {noise}");
    assert!(noise < 0.1, "{label}: too noisy to tell");
    // Four standard errors of the mean.
    assert!(
        bias.abs()
            < 4.0 * noise / count.sqrt() * (squares / count).sqrt() / (sum / count) + ROUNDING,
        "{label}: bias {bias}"
    );
    bias
}
