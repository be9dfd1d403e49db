//! A metal floor whose roughness changes abruptly from patch to patch, under coloured panels (Tokuyoshi 2015, Fig. 4).

use super::glb::{Material, Sampling, Scene};
use super::mesh::{panel, polygon, rectangle, with_rectangle_uvs};
use super::png;

/// Patches along each side of the floor; even, so that both kinds cover the same area.
pub const PATCHES: u32 = 8;
/// Texels along a patch. One would do for a nearest lookup; with these, a renderer that interpolates smears a sixteenth
/// of a patch.
const PATCH_TEXELS: u32 = 16;
/// Texels along the texture.
pub const SIZE: u32 = PATCHES * PATCH_TEXELS;

/// Roughness of a white texel: the two kinds of patches are then whole numbers of 255ths, 0.51 · 25/255 = 0.05 and
/// 0.51 · 200/255 = 0.4.
pub const ROUGHNESS_FACTOR: f32 = 0.51;
/// Texel of the sharp patches: perceptual roughness 0.05.
pub const SHARP: u8 = 25;
/// Texel of the rough patches: perceptual roughness 0.4.
pub const ROUGH: u8 = 200;

/// Green texel of the metallic-roughness texture.
pub fn roughness_texel(x: u32, y: u32) -> u8 {
    if (x / PATCH_TEXELS + y / PATCH_TEXELS).is_multiple_of(2) {
        SHARP
    } else {
        ROUGH
    }
}

pub fn roughness_map() -> Scene {
    let mut scene = Scene::new("roughness_map");
    scene.camera("camera", [0.0, 2.55, 3.7], [0.0, 0.42, -0.45], 42.0);

    let texels: Vec<[u8; 3]> = (0..SIZE)
        .flat_map(|y| (0..SIZE).map(move |x| [255, roughness_texel(x, y), 255]))
        .collect();
    let png = png::encode(SIZE, SIZE, &texels, png::Content::Data);
    let texture = scene.texture("roughness", &png, Sampling::NearestClamped);
    const FLOOR: f64 = 3.2;
    let floor = panel([0.0; 3], [0.0, 1.0, 0.0], &rectangle(FLOOR, FLOOR));
    scene.object(
        "floor",
        &with_rectangle_uvs(floor),
        Material {
            metallic_roughness_texture: Some(texture),
            ..Material::metal([0.95, 0.93, 0.90], ROUGHNESS_FACTOR)
        },
    );

    // Walls at the back and on both sides, so that the patches reflect something between the panels, too.
    let (side, back, front, height) = (2.2, -2.0, 2.2, 4.2);
    for (name, corners) in [
        (
            "back_wall",
            [
                [-side, 0.0, back],
                [side, 0.0, back],
                [side, height, back],
                [-side, height, back],
            ],
        ),
        (
            "left_wall",
            [
                [-side, 0.0, front],
                [-side, 0.0, back],
                [-side, height, back],
                [-side, height, front],
            ],
        ),
        (
            "right_wall",
            [
                [side, 0.0, back],
                [side, 0.0, front],
                [side, height, front],
                [side, height, back],
            ],
        ),
    ] {
        scene.object(
            name,
            &polygon(&corners),
            Material::lambert([0.4, 0.4, 0.42]),
        );
    }

    // Three rows of panels before the back wall, turned to the floor: their mirror images, with straight edges of high
    // contrast, lie over the whole floor.
    const COLUMNS: [[f32; 3]; 5] = [
        [6.0, 0.7, 0.4],
        [0.5, 4.5, 0.9],
        [5.0, 5.0, 4.6],
        [0.5, 1.2, 7.0],
        [6.0, 3.6, 0.4],
    ];
    const ROWS: [f64; 3] = [0.75, 1.85, 2.95];
    for (row, y) in ROWS.into_iter().enumerate() {
        for column in 0..COLUMNS.len() {
            // Every row starts with another colour.
            let radiance = COLUMNS[(column + 2 * row) % COLUMNS.len()];
            let x = (column as f64 - 2.0) * 0.78;
            let outline = rectangle(0.5, 0.7);
            scene.object(
                &format!("panel_{row}{column}"),
                &panel([x, y, back + 0.15], [0.0, -0.15, 1.0], &outline),
                Material::light(radiance),
            );
        }
    }
    scene
}
