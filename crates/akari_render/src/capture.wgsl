// Writes what the G-buffer says of each pixel into a buffer: two vec4 a pixel.

#import bevy_render::view::View
#import akari_render::gbuffer::{position_in_view, unpack_surface}

struct Band {
    // First row of the band, and one past its last.
    first_row: u32,
    end_row: u32,
    width: u32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var depth_texture: texture_depth_2d;
@group(0) @binding(3) var gbuffer_texture: texture_2d<u32>;
@group(0) @binding(4) var<storage, read_write> surfaces: array<vec4<f32>>;

@compute @workgroup_size(8, 8, 1)
fn capture(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = band.first_row + id.y;
    if id.x >= band.width || row >= band.end_row {
        return;
    }
    let at = 2u * (id.y * band.width + id.x);
    let pixel = vec2<u32>(view.viewport.xy) + vec2(id.x, row);
    let depth = textureLoad(depth_texture, pixel, 0);
    // Reverse z: 0 is the background.
    if depth == 0.0 {
        surfaces[at] = vec4(0.0);
        surfaces[at + 1u] = vec4(0.0);
        return;
    }
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    let position = position_in_view(view, vec2<f32>(pixel) + 0.5, depth);
    surfaces[at] = vec4(surface.normal_ws, -position.z);
    surfaces[at + 1u] = vec4(surface.base_color, surface.perceptual_roughness);
}
