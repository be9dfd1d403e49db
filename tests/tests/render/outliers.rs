//! Single pixels of indirect light that stand out from what is around them: bright ones that few cones in thousands leave, and
//! dark ones where a block stands on a floor, or where reflectors meet.

use bevy_akari::prelude::*;
use bevy_akari_tests::accuracy::{render_with_cli, scene_path};
use bevy_akari_tests::headless_or_skip;
use bevy_akari_tests::room::{Outliers, Room, outliers};

const SIDE: u32 = 128;
/// Samples a pixel of the reference: of its own noise, which is caustics most of all, much is left.
const SPP: u32 = 64;
/// A person sees a pixel that is a quarter brighter than those around it, or as much darker.
const FACTOR: f64 = 1.25;

#[test]
fn few_pixels_of_the_cornell_box_stand_out() {
    let Some(mut room) = Room::new("no_pixel_stands_out", "cornell", SIDE, SPP) else {
        return;
    };
    let settings = VoxelGi {
        voxel_size: 0.04,
        ..VoxelGi::default()
    };
    room.set(settings);
    room.step(64);
    let surfaces = room.surfaces.clone();
    let glossy = |i: usize| surfaces.albedo[i][0] > 0.85 && surfaces.roughness[i] < 0.5;
    let matte =
        |i: usize| surfaces.depth[i] > 0.0 && !glossy(i) && surfaces.emission[i] == [0.0; 3];
    let light = room.indirect();
    let count = |light: &_, chosen: &dyn Fn(usize) -> bool| -> Outliers {
        outliers(light, &surfaces, SIDE as usize, FACTOR, chosen)
    };
    let (on_matte, on_metal) = (count(&light, &matte), count(&light, &glossy));
    let of_paths = count(&room.truth, &matte);
    println!("matte {on_matte:?}, metal {on_metal:?}; noise of {SPP} paths on matte {of_paths:?}");
    assert!(on_matte.of > 8000 && on_metal.of > 800);
    // Most are where the right wall meets the floor. How many varies by some: pages are lit in the order in which they come.
    assert!(on_matte.bright <= 30, "matte: {on_matte:?}");
    assert!(on_matte.dark <= 90, "matte: {on_matte:?}");
    // Edges of what the metal mirrors.
    assert!(on_metal.dark <= 30, "metal: {on_metal:?}");
    // The check can fail: noise is found, and so is a single pixel.
    assert!(of_paths.bright > 100, "paths: {of_paths:?}");
    let mut changed = light;
    let pixel = (0..changed.len())
        .filter(|i| matte(*i))
        .nth(5000)
        .expect("there are more");
    changed[pixel] = changed[pixel].map(|x| 1.4 * x);
    assert_eq!(count(&changed, &matte).bright, on_matte.bright + 1);
}

/// Pixels to which less than half is added of what is to each of the eight around them.
fn dark_dots(added: &[f64], side: usize) -> Vec<usize> {
    let inner = (1..side - 1).flat_map(|y| (1..side - 1).map(move |x| y * side + x));
    inner
        .filter(|&i| {
            let rows = [i - side, i, i + side];
            let around = rows.into_iter().flat_map(|at| [at - 1, at, at + 1]);
            let others = around.filter(|&at| at != i).map(|at| added[at]);
            added[i] < 0.5 * others.fold(f64::INFINITY, f64::min)
        })
        .collect()
}

#[test]
fn no_pixel_is_dark_where_reflectors_meet() {
    if headless_or_skip("no_pixel_is_dark").is_none() {
        return;
    }
    // In a picture of this size two pixels lie in the seam between the floor and the wall.
    const SEAM_SIDE: u32 = 80;
    let scene = scene_path("corner");
    let picture = |effects: &str| {
        let options = ["--effects", effects, "--frames", "1", "--quiet"];
        render_with_cli(&scene, SEAM_SIDE, &options).0.data
    };
    let (with, without) = (
        picture("area-lights,interreflection"),
        picture("area-lights"),
    );
    let pairs = with.iter().zip(&without);
    let mut added: Vec<f64> = pairs.map(|(a, b)| f64::from(a[0] - b[0])).collect();
    let side = SEAM_SIDE as usize;
    assert_eq!(dark_dots(&added, side), Vec::<usize>::new(), "dark dots");
    let in_seam = 47 * side + 57;
    added[in_seam] = 0.0;
    assert_eq!(dark_dots(&added, side), [in_seam]);
}
