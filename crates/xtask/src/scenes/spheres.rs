//! The scenes of the accuracy figures: white-metal spheres of every roughness over a Lambert floor, under one light.

use super::glb::{Material, Placement, Sampling, Scene};
use super::mesh::{Mesh, panel, rectangle, regular, unit_sphere, with_rectangle_uvs};
use super::small::floor;
use super::vec3::{self, Vec3};
use super::{FLOOR_ALBEDO, SPHERE_RINGS, SPHERE_SEGMENTS, pattern};

/// Perceptual roughness of the spheres.
pub const ROUGHNESS: [f32; 7] = [0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0];
/// Radius of the spheres in metres.
pub const RADIUS: f64 = 0.45;
/// Gap between floor and spheres: a contact point would be a place where "which is nearer" depends on rounding.
pub const GAP: f64 = 0.05;

/// Shape of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Light {
    Quad,
    Triangle,
    Hexagon,
    Textured,
}

/// Centres of the spheres: four at the back, three in the gaps before them.
pub fn centers() -> [Vec3; 7] {
    std::array::from_fn(|i| {
        let (x, z) = if i < 4 {
            (i as f64 * 1.1 - 1.65, -0.75)
        } else {
            ((i - 4) as f64 * 1.1 - 1.1, 0.65)
        };
        [x, RADIUS + GAP, z]
    })
}

/// The scene with a light of the given shape; all shapes have the same centre, direction, area and radiance.
pub fn spheres(light: Light) -> Scene {
    const AREA: f64 = 2.4;
    const RADIANCE: f32 = 20.0;
    let name = match light {
        Light::Quad => "spheres_quad",
        Light::Triangle => "spheres_triangle",
        Light::Hexagon => "spheres_hexagon",
        Light::Textured => "spheres_textured",
    };
    let mut scene = Scene::new(name);
    scene.camera("camera", [0.0, 4.6, 4.6], [0.0, 0.25, 0.0], 38.0);
    scene.object("floor", &floor(12.0), Material::lambert([FLOOR_ALBEDO; 3]));

    let sphere = scene.geometry(&unit_sphere(SPHERE_SEGMENTS, SPHERE_RINGS));
    for (roughness, center) in ROUGHNESS.into_iter().zip(centers()) {
        let name = format!("sphere_roughness_{roughness:.2}");
        let mesh = scene.mesh(&name, sphere, Material::metal([1.0; 3], roughness));
        scene.node(
            &name,
            mesh,
            Placement {
                translation: center,
                scale: [RADIUS; 3],
                ..Placement::default()
            },
        );
    }

    let outline = match light {
        Light::Quad => rectangle(2.0, AREA / 2.0),
        // Areas of regular polygons of circumradius r: 3√3/4 r² and 3√3/2 r².
        Light::Triangle => regular(3, (AREA * 4.0 / (3.0 * 3f64.sqrt())).sqrt()),
        Light::Hexagon => regular(6, (AREA * 2.0 / (3.0 * 3f64.sqrt())).sqrt()),
        Light::Textured => {
            let aspect = f64::from(pattern::WIDTH) / f64::from(pattern::HEIGHT);
            rectangle((AREA * aspect).sqrt(), (AREA / aspect).sqrt())
        }
    };
    // Above and behind the spheres, so that some of what the camera sees lies at grazing angles in the light's mirror
    // direction, and some has the light partly below its horizon. Outside the picture.
    let position = [0.4, 2.5, -1.3];
    let mut panel: Mesh = panel(position, vec3::sub([0.0, 0.3, 0.1], position), &outline);
    let mut material = Material::light([RADIANCE; 3]);
    if light == Light::Textured {
        panel = with_rectangle_uvs(panel);
        material.emissive_texture =
            Some(scene.texture("pattern", &pattern::png(), Sampling::LinearClamped));
    }
    scene.object("light", &panel, material);
    scene
}
