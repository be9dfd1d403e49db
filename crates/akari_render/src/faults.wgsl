// Counts pixels of a picture that are no numbers, and those at the end of what can be stored.

@group(0) @binding(0) var picture: texture_2d<f32>;
// Pixels with a channel that is NaN or infinite; pixels with one at or above LARGEST.
@group(0) @binding(1) var<storage, read_write> counts: array<atomic<u32>, 2>;

// Largest radiance that every format of a signal holds (akari_math::signal_packing).
const LARGEST: f32 = 65408.0;
const EXPONENT: u32 = 0x7f800000u;

@compute @workgroup_size(8, 8, 1)
fn count(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= textureDimensions(picture)) {
        return;
    }
    let value = textureLoad(picture, id.xy, 0);
    // By the bits: a compiler may take it that NaN does not occur.
    let is_odd = (bitcast<vec4<u32>>(value) & vec4(EXPONENT)) == vec4(EXPONENT);
    if any(is_odd.xyz) {
        atomicAdd(&counts[0], 1u);
    } else if any(abs(value.xyz) >= vec3(LARGEST)) {
        atomicAdd(&counts[1], 1u);
    }
}
