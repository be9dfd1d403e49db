// Stores the lobe of each pixel.

#import akari_math::lobe_packing::lobe_pack
#import akari_lobes::guides::load_specular_guide

@group(1) @binding(0) var lobes: texture_storage_2d<rg32uint, write>;

@compute @workgroup_size(8, 8, 1)
fn build(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= textureDimensions(lobes)) {
        return;
    }
    let guide = load_specular_guide(vec2<i32>(id.xy));
    let packed = lobe_pack(guide.axis, guide.inverse_sharpness, guide.perceptual_roughness);
    textureStore(lobes, id.xy, vec4(packed, 0u, 0u));
}
