// Stands in for a producer that can shade single pixels: takes them from a finished image.

#import akari_math::lobe_packing::half_pack

@group(0) @binding(0) var<storage, read> listed: array<u32>;
@group(0) @binding(1) var<storage, read_write> shaded: array<vec2<u32>>;
@group(0) @binding(2) var image: texture_2d<f32>;

// Words before the pixels.
const HEADER: u32 = 4u;
// Largest number that is packed.
const MAX_HALF: f32 = 65504.0;

@compute @workgroup_size(64, 1, 1)
fn resample(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= listed[0] {
        return;
    }
    let word = listed[HEADER + id.x];
    let pixel = vec2<i32>(vec2(word & 0xffffu, word >> 16u));
    let radiance = clamp(textureLoad(image, pixel, 0).rgb, vec3(0.0), vec3(MAX_HALF));
    shaded[id.x] = vec2(
        half_pack(radiance.x) | (half_pack(radiance.y) << 16u), half_pack(radiance.z) | (half_pack(1.0) << 16u),
    );
}
