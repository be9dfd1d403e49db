#define_import_path akari_render::ltc_layer

// One specular layer of a surface as the table of linearly transformed cosines has it.

#import akari_math::area_light::specular_albedo
#import akari_math::ltc::lookup::{ltc_lobe_weight, ltc_m, ltc_m_inv, ltc_uv}

struct LtcLayer {
    m_inv: mat3x3<f32>,
    m: mat3x3<f32>,
    albedo: vec3<f32>,
    // What the lobe's integral counts, and the tail under it: (tail_z, tail_x).
    lobe_weight: f32,
    tail: vec2<f32>,
}

fn ltc_layer(
    table: texture_2d_array<f32>,
    table_sampler: sampler,
    perceptual_roughness: f32,
    n_dot_v: f32,
    f0: vec3<f32>,
    f90: f32,
) -> LtcLayer {
    let uv = ltc_uv(perceptual_roughness, n_dot_v);
    let texel0 = textureSampleLevel(table, table_sampler, uv, 0, 0.0);
    let texel1 = textureSampleLevel(table, table_sampler, uv, 1, 0.0);
    var layer: LtcLayer;
    layer.m_inv = ltc_m_inv(texel0, n_dot_v);
    layer.m = ltc_m(texel0, n_dot_v);
    layer.albedo = specular_albedo(f0, f90, texel1.x, texel1.y);
    layer.lobe_weight = ltc_lobe_weight(layer.m_inv, texel1.z);
    layer.tail = texel1.zw;
    return layer;
}
