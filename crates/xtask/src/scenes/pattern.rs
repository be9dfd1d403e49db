//! The picture on the textured lights: saturated and dark fields with sharp edges on the left, smooth gradients on the
//! right, so that both a blurred lookup and a wrong orientation show. 96 × 64 is no power of two on purpose.

use super::png;

pub const WIDTH: u32 = 96;
pub const HEIGHT: u32 = 64;

/// The pattern as a PNG file (sRGB encoded, as glTF reads emissive textures).
pub fn png() -> Vec<u8> {
    let pixels: Vec<[u8; 3]> = (0..HEIGHT)
        .flat_map(|y| (0..WIDTH).map(move |x| pixel(x, y)))
        .collect();
    png::encode(WIDTH, HEIGHT, &pixels, png::Content::Color)
}

fn pixel(x: u32, y: u32) -> [u8; 3] {
    const SHARP_WIDTH: u32 = 48;
    const FIELD: u32 = 16;
    const FIELDS: [[[u8; 3]; 3]; 4] = [
        [[255, 40, 20], [20, 20, 20], [30, 90, 255]],
        [[10, 10, 10], [255, 200, 30], [10, 10, 10]],
        [[40, 230, 70], [10, 10, 10], [255, 60, 200]],
        [[255, 255, 255], [30, 220, 230], [20, 20, 20]],
    ];
    if x < SHARP_WIDTH {
        // Thin dark lines between the fields: the finest detail that there is.
        if x % FIELD == FIELD - 1 || y % FIELD == FIELD - 1 {
            return [0, 0, 0];
        }
        return FIELDS[(y / FIELD) as usize][(x / FIELD) as usize];
    }
    // Sunset: orange below, violet above, with a soft bright disk; integer arithmetic keeps the bytes the same everywhere.
    let vertical = y * 255 / (HEIGHT - 1);
    let (dx, dy) = (x as i32 - 72, y as i32 - 28);
    let falloff = 255 - (((dx * dx + dy * dy) * 255) / (18 * 18)).min(255);
    let mix = |top: u32, bottom: u32| (top * (255 - vertical) + bottom * vertical) / 255;
    [mix(70, 255), mix(30, 110), mix(140, 20)]
        .map(|channel| (channel + falloff as u32).min(255) as u8)
}
