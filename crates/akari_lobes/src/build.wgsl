// Stores the lobe of each pixel.

#import akari_math::lobe_packing::lobe_pack
#import akari_lobes::guides::load_specular_guide

// What is stored where there is no lit surface.
const NO_LOBE: u32 = 0xffffffffu;

@group(1) @binding(0) var lobes: texture_storage_2d<rg32uint, write>;

@compute @workgroup_size(8, 8, 1)
fn build(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= textureDimensions(lobes)) {
        return;
    }
    let guide = load_specular_guide(vec2<i32>(id.xy));
    var packed = vec2(NO_LOBE);
    if guide.valid {
        packed = lobe_pack(guide.axis, guide.inverse_sharpness, guide.perceptual_roughness);
    }
    textureStore(lobes, id.xy, vec4(packed, 0u, 0u));
}
