//! Single pixels of indirect light that stand out from what is around them: bright ones that few cones in thousands leave, and
//! dark ones where a block stands on a floor.

use bevy_akari::prelude::*;
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
