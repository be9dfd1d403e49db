//! Indirect light from the scene file to the picture, against the path tracer: what GI adds to a picture is compared with
//! what paths of two and more bounces add to the reference.

use akari_reference::{NoProgress, Options, render};
use akari_scene::Scene;
use akari_scene::exr_io::RgbImage;
use bevy_akari_tests::accuracy::*;
use bevy_akari_tests::headless_or_skip;

/// Side of the pictures.
const SIDE: u32 = 32;
/// Samples a pixel of the references.
///
/// With 256, the noise of the caustic of the metal block is 16 % of all indirect light (relative RMS), with these 6 %.
const SPP: u32 = 2048;
/// Bounces beyond which what is left is below a thousandth.
const ALL_BOUNCES: u32 = 16;

/// The part of the light in `all` that is not in `direct`, less where a pixel shows the light itself.
struct Indirect(Vec<[f64; 3]>);

impl Indirect {
    fn of(all: &RgbImage, direct: &RgbImage) -> Self {
        let pixels = all.data.iter().zip(&direct.data);
        Self(
            pixels
                .map(|(a, b)| std::array::from_fn(|c| f64::from(a[c]) - f64::from(b[c])))
                .collect(),
        )
    }

    fn mean(&self) -> f64 {
        self.0.iter().flatten().sum::<f64>() / (3 * self.0.len()) as f64
    }

    fn relative_rmse(&self, truth: &Self) -> f64 {
        let pairs = self.0.iter().flatten().zip(truth.0.iter().flatten());
        let error: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
        (error / truth.0.iter().flatten().map(|b| b * b).sum::<f64>()).sqrt()
    }
}

fn traced(name: &str) -> Indirect {
    let scene = Scene::load(&scene_path(name)).expect("a scene of the repository");
    let picture = |max_depth| {
        let options = Options {
            width: SIDE,
            height: SIDE,
            spp: SPP,
            max_depth,
            pixel_centers: true,
            ..Options::default()
        };
        let output = render(&scene, None, &options, &NoProgress).expect("it renders");
        output.color
    };
    Indirect::of(&picture(ALL_BOUNCES), &picture(2))
}

fn drawn(name: &str) -> Indirect {
    let scene = scene_path(name);
    // The direct light that is taken away again has no shadows.
    let frames = [
        "--frames",
        "32",
        "--set",
        "voxel_gi.voxel_size=0.04",
        "--set",
        "voxel_gi.shadow_cones=0",
    ];
    let with = [&["--effects", "area-lights,voxel-gi"], &frames[..]].concat();
    let (all, stats) = render_with_cli(&scene, SIDE, &with);
    assert!(
        stats["passes"]["akari_voxel_gi_cones"]["executions"]
            .as_u64()
            .is_some_and(|count| count >= 32),
        "{name}: the cones did not run: {}",
        stats["passes"]
    );
    assert_eq!(stats["non_finite_pixels"], 0, "{name}");
    let (direct, _) = render_with_cli(&scene, SIDE, &["--effects", "area-lights"]);
    Indirect::of(&all, &direct)
}

#[test]
fn indirect_light_has_the_energy_of_the_reference() {
    if headless_or_skip("indirect_light").is_none() {
        return;
    }
    // A closed room of one albedo: 1 % too dark. And a room with two coloured walls and a metal block that is almost a mirror,
    // whose caustics are missing without reflectors and are most of its error. With a Lambert block in its place, 14 %.
    // The bias, -4.6 to -5.1 %, is what the diffuse bounce of the mirror loses through the open side; a glossy box of roughness 0.5
    // is within 5 % (`a_glossy_box_lights_the_walls`).
    for (name, most_bias, most_error) in [("furnace", 0.03, 0.08), ("cornell", 0.06, 0.36)] {
        let (ours, truth) = (drawn(name), traced(name));
        let bias = ours.mean() / truth.mean() - 1.0;
        let error = ours.relative_rmse(&truth);
        println!(
            "{name}: bias {:.1} %, relative RMSE {:.1} %",
            100.0 * bias,
            100.0 * error
        );
        assert!(bias.abs() <= most_bias, "{name}: bias {bias}");
        assert!(error <= most_error, "{name}: relative RMSE {error}");
        // One constant for all pixels, of the right mean, is no picture of the Cornell box.
        let flat = Indirect(vec![[truth.mean(); 3]; truth.0.len()]);
        if name == "cornell" {
            let error = flat.relative_rmse(&truth);
            assert!(error > most_error, "a constant passes: {error}");
        }
    }
}
