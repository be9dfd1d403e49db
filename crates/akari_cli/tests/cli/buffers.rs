//! `render --buffers` against `reference --aov`: two programs' view of the same pixels.

use crate::run::{Place, asset, has_adapter};
use akari_scene::Scene;
use akari_scene::exr_io::{RgbImage, read_rgb};
use bevy_akari::math::ggx::ggx_reflection_lobe;
use glam::Vec3;

const SIZE: &str = "96x54";
/// Share of pixels at silhouettes, where a rasteriser's snapped vertices and a ray may see different surfaces.
const SILHOUETTES: f64 = 0.005;

/// Share of the pixels of which `wrong` is true.
fn share(count: usize, wrong: impl Fn(usize) -> bool) -> f64 {
    (0..count).filter(|pixel| wrong(*pixel)).count() as f64 / count as f64
}

/// Largest difference of the three channels.
fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max)
}

/// The lobes of the GPU against their twin on the CPU, from the other buffers.
fn check_lobes(
    place: &Place,
    scene: &str,
    ours: &dyn Fn(&str) -> RgbImage,
    theirs: &dyn Fn(&str) -> RgbImage,
    surface: impl Fn(usize) -> bool,
) {
    /// Of the axis, radians: two octahedral coordinates of 12 bits for the normal and of 16 for the axis.
    const AXIS: f32 = 2e-3;
    /// Of the sharpness: roughness has 8 bits, and sharpness goes by its fourth power.
    const SHARPNESS: f32 = 0.05;
    let scene = Scene::load(std::path::Path::new(scene)).expect("a scene");
    let eye = scene.cameras[0].world_from_local.translation.as_vec3();
    let (axis, sharpness) = (ours("lobe_axis").data, ours("lobe_sharpness").data);
    let (normal, roughness) = (ours("normal").data, ours("roughness").data);
    let (depth, position) = (ours("depth").data, theirs("position").data);
    let wrong = |i: usize, alpha_of: &dyn Fn(f32) -> f32| {
        let view = (eye - Vec3::from(position[i])).normalize_or_zero();
        let lobe = ggx_reflection_lobe(normal[i].into(), view, alpha_of(roughness[i][0]));
        distance(axis[i], lobe.axis.to_array()) > AXIS
            || (sharpness[i][0] * lobe.inverse_sharpness - 1.0).abs() > SHARPNESS
    };
    let off = share(axis.len(), |i| surface(i) && wrong(i, &|r| r * r));
    assert!(off < SILHOUETTES, "lobes differ in {off} of the pixels");
    let off = share(axis.len(), |i| surface(i) && wrong(i, &|r| r));
    assert!(off > 0.1, "another alpha must be noticed: {off}");
    let nothing = |i: usize| depth[i][0] == 0.0;
    assert!(share(axis.len(), nothing) > 0.0, "there is background");
    for i in (0..axis.len()).filter(|i| nothing(*i)) {
        assert_eq!((axis[i], sharpness[i]), ([0.0; 3], [0.0; 3]), "{i}");
    }
    // The buffers alone change nothing; geometric antialiasing, which comes with lobes, does.
    let scene = scene.source.display().to_string();
    let render = |effects: &str| {
        let arguments = [
            "render", &scene, "--size", SIZE, "--out", "p.exr", "--quiet",
        ];
        let more = ["--effects", effects, "--stats", "s.json"];
        place.akari(&[&arguments[..], &more].concat()).ok();
        let stats = std::fs::read(place.file("s.json")).expect("statistics");
        let stats: serde_json::Value = serde_json::from_slice(&stats).expect("JSON");
        (
            read_rgb(&place.file("p.exr")).expect("p.exr").data,
            stats["effects"].clone(),
        )
    };
    let (picture, effects) = render("auto");
    assert_eq!(picture, ours("color").data);
    for effect in ["lobes", "denoise", "upsample"] {
        assert_eq!(effects[effect]["active"], false, "{effects}");
        assert!(
            effects[effect]["reason"].as_str() > Some(""),
            "{effect}: {effects}"
        );
    }
    let (picture, effects) = render("area-lights,lobes,denoise,upsample");
    assert_ne!(picture, ours("color").data);
    assert_eq!(effects["lobes"]["active"], true, "{effects}");
    assert_eq!(effects["denoise"]["active"], false, "{effects}");
}

#[test]
fn buffers_agree_with_the_reference() {
    if !has_adapter() {
        return;
    }
    let place = Place::new();
    let scene = asset("spheres_quad.glb");
    place
        .akari(&[
            "render",
            &scene,
            "--size",
            SIZE,
            "--out",
            "c.exr",
            "--buffers",
            "deep/ours",
            "--quiet",
        ])
        .ok();
    place
        .akari(&[
            "reference",
            &scene,
            "--size",
            SIZE,
            "--out",
            "e.exr",
            "--aov",
            "aov",
            "--spp",
            "1",
            "--max-depth",
            "1",
            "--pixel-centers",
            "--quiet",
        ])
        .ok();
    let read = |name: &str| -> RgbImage { read_rgb(&place.file(name)).expect(name) };
    let ours = |name: &str| read(&format!("deep/ours/{name}.exr"));
    let theirs = |name: &str| read(&format!("aov/{name}.exr"));
    let pixels = ours("depth").data.len();

    let (depth, true_depth) = (ours("depth").data, theirs("depth").data);
    assert!(
        share(pixels, |i| depth[i][0] > 0.0) > 0.3,
        "most of the picture shows a surface"
    );
    // Vertices are snapped to 1/256 of a pixel; on a floor that is seen at a grazing angle that moves the depth.
    const DEPTH: f32 = 1e-4;
    let wrong_depth = |i: usize| (depth[i][0] - true_depth[i][0]).abs() > DEPTH * true_depth[i][0];
    let off = share(pixels, wrong_depth);
    assert!(off < SILHOUETTES, "depth differs in {off} of the pixels");
    let surface = |i: usize| depth[i][0] > 0.0 && !wrong_depth(i);

    // Two 12-bit octahedral coordinates, and an 8-bit mesh normal interpolated in another order.
    const NORMAL: f32 = 1e-3;
    let (normal, true_normal) = (ours("normal").data, theirs("normal").data);
    let off = share(pixels, |i| {
        surface(i) && distance(normal[i], true_normal[i]) > NORMAL
    });
    assert!(off < SILHOUETTES, "normals differ in {off} of the pixels");
    let turned = share(pixels, |i| {
        surface(i) && distance(normal[i], true_normal[i].map(|axis| -axis)) > NORMAL
    });
    assert!(turned > 0.3, "turned normals must be noticed: {turned}");

    // Half a step of 8 bits, and of 8 bits of the 2.2th root: d(x^2.2)/dx at 1 is 2.2.
    const STEP: f32 = 0.51 / 255.0;
    let (roughness, true_roughness) = (ours("roughness").data, theirs("roughness").data);
    check_lobes(&place, &scene, &ours, &theirs, surface);
    let off = share(pixels, |i| {
        surface(i) && distance(roughness[i], true_roughness[i]) > STEP
    });
    assert!(
        off < SILHOUETTES,
        "roughness differs in {off} of the pixels"
    );
    let (albedo, true_albedo) = (ours("albedo").data, theirs("albedo").data);
    let off = share(pixels, |i| {
        surface(i) && distance(albedo[i], true_albedo[i]) > 2.2 * STEP
    });
    assert!(
        off < SILHOUETTES,
        "base colours differ in {off} of the pixels"
    );

    // Where nothing emits, the picture is the light of the area lights, rounded to Bevy's 16-bit float target.
    let (color, emission, direct) = (ours("color").data, read("e.exr").data, ours("direct").data);
    assert_eq!(color, read("c.exr").data);
    let brightest = |pixel: [f32; 3]| pixel.into_iter().fold(0.0, f32::max);
    let half = |i: usize| 1e-3 * brightest(direct[i]) + 1e-6;
    let dark = |i: usize| emission[i] == [0.0; 3];
    assert!(
        share(pixels, |i| brightest(direct[i]) > 0.01) > 0.3,
        "the light reaches the scene"
    );
    let off = share(pixels, |i| {
        dark(i) && distance(color[i], direct[i]) > half(i)
    });
    assert!(
        off < SILHOUETTES,
        "direct light differs from the picture in {off} of the pixels"
    );
    let twice = share(pixels, |i| {
        dark(i) && distance(color[i], direct[i].map(|channel| 2.0 * channel)) > half(i)
    });
    assert!(twice > 0.3, "light counted twice must be noticed: {twice}");
}

/// Mean of all channels.
fn mean(image: &RgbImage) -> f64 {
    let sum: f64 = image.data.iter().flatten().map(|x| f64::from(*x)).sum();
    sum / image.data.len() as f64
}

#[test]
fn indirect_light_is_written_apart() {
    if !has_adapter() {
        return;
    }
    let place = Place::new();
    let scene = asset("cornell.glb");
    let render = |effects: &str, folder: &str| {
        let arguments = [
            "render",
            &scene,
            "--size",
            "48x48",
            "--out",
            "c.exr",
            "--frames",
            "6",
            "--set",
            "voxel_gi.voxel_size=0.04",
            "--effects",
            effects,
            "--buffers",
            folder,
            "--quiet",
        ];
        place.akari(&arguments).ok();
        let read = |name: &str| -> RgbImage {
            read_rgb(&place.file(&format!("{folder}/{name}.exr"))).expect(name)
        };
        [
            "color",
            "direct",
            "indirect_diffuse",
            "indirect_specular",
            "albedo",
        ]
        .map(read)
    };
    let [_, direct, diffuse, specular, _] = render("area-lights", "without");
    assert!(mean(&direct) > 0.0);
    assert_eq!((mean(&diffuse), mean(&specular)), (0.0, 0.0));
    let [color, direct, diffuse, specular, albedo] = render("area-lights,voxel-gi", "with");
    assert!(mean(&diffuse) > 0.05 * mean(&direct), "the room is lit");
    assert!(mean(&specular) > 0.0, "one block is of metal");
    // The picture is their sum, rounded to 16 bits with each addition; the light itself, brighter than all else, is apart.
    let brightest = |pixel: [f32; 3]| pixel.into_iter().fold(0.0, f32::max);
    let emits = |i: usize| brightest(color.data[i]) > 4.0;
    let off = |parts: &[&RgbImage]| {
        share(color.data.len(), |i| {
            let sum: [f32; 3] =
                std::array::from_fn(|c| parts.iter().map(|part| part.data[i][c]).sum());
            !emits(i) && distance(sum, color.data[i]) > 3e-3 * brightest(color.data[i]) + 1e-6
        })
    };
    let wrong = off(&[&direct, &diffuse, &specular]);
    assert!(wrong < SILHOUETTES, "{wrong} of the pixels do not add up");
    assert!(off(&[&direct, &diffuse]) > 0.02, "specular light counts");
    assert!(off(&[&direct, &specular]) > 0.3, "diffuse light counts");
    // The metal block, the brightest of all surfaces, reflects nothing diffusely; the red wall hardly anything green.
    let metal: Vec<usize> = (0..color.data.len())
        .filter(|i| albedo.data[*i][1] > 0.85)
        .collect();
    let diffuse_metal = share(metal.len(), |i| {
        brightest(diffuse.data[metal[i]]) >= 0.02 * brightest(specular.data[metal[i]]).max(0.1)
    });
    println!(
        "{:.4} of {} pixels of metal look diffuse",
        diffuse_metal,
        metal.len()
    );
    // Voxels are filled in no fixed order, so that which pixels of its edges catch light of what is beside it changes from
    // run to run: up to 2 of 261 were seen to.
    const EDGES: f64 = 0.02;
    assert!(diffuse_metal < EDGES, "{diffuse_metal} of the metal");
}
