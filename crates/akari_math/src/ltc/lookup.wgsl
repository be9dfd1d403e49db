#define_import_path akari_math::ltc::lookup

// Twin: `ltc/lookup.rs`. Change both or neither.

#import akari_math::special::TINY

// Texels along each side of the table.
const LTC_TABLE_SIZE: f32 = 64.0;

// Texture coordinates of the table for a roughness and the cosine between normal and view.
fn ltc_uv(perceptual_roughness: f32, n_dot_v: f32) -> vec2<f32> {
    let parameters = vec2<f32>(saturate(perceptual_roughness), sqrt(1.0 - saturate(n_dot_v)));
    return parameters * ((LTC_TABLE_SIZE - 1.0) / LTC_TABLE_SIZE) + 0.5 / LTC_TABLE_SIZE;
}

// M^-1 from its texel (m00, m02, m20, m22), indices row then column; [1][1] is 1.
fn ltc_m_inv(texel: vec4<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(
        vec3<f32>(texel.x, 0.0, texel.z),
        vec3<f32>(0.0, 1.0, 0.0),
        vec3<f32>(texel.y, 0.0, texel.w),
    );
}

// M, the inverse of `ltc_m_inv(texel)`, times the positive determinant of the latter.
fn ltc_m(texel: vec4<f32>) -> mat3x3<f32> {
    let determinant = max(texel.x * texel.w - texel.y * texel.z, TINY);
    return mat3x3<f32>(
        vec3<f32>(texel.w, 0.0, -texel.z),
        vec3<f32>(0.0, determinant, 0.0),
        vec3<f32>(-texel.y, 0.0, texel.x),
    );
}
