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

// M^-1 from its texel (b00, b02, b20, b22) in the frame of the mirror direction, indices row then column; [1][1] is 1.
fn ltc_m_inv(texel: vec4<f32>, n_dot_v: f32) -> mat3x3<f32> {
    let c = saturate(n_dot_v);
    let s = sqrt((1.0 - c) * (1.0 + c));
    return mat3x3<f32>(
        vec3<f32>(texel.x * c - texel.y * s, 0.0, texel.z * c - texel.w * s),
        vec3<f32>(0.0, 1.0, 0.0),
        vec3<f32>(texel.x * s + texel.y * c, 0.0, texel.z * s + texel.w * c),
    );
}

// M, the inverse of `ltc_m_inv(texel, n_dot_v)`, times the positive determinant of the latter.
fn ltc_m(texel: vec4<f32>, n_dot_v: f32) -> mat3x3<f32> {
    let determinant = max(texel.x * texel.w - texel.y * texel.z, TINY);
    let m_inv = ltc_m_inv(texel, n_dot_v);
    return mat3x3<f32>(
        vec3<f32>(m_inv[2].z, 0.0, -m_inv[0].z),
        vec3<f32>(0.0, determinant, 0.0),
        vec3<f32>(-m_inv[2].x, 0.0, m_inv[0].x),
    );
}

// What the integral of the transformed cosine counts: (1 - tail_z) / N.
fn ltc_lobe_weight(m_inv: mat3x3<f32>, tail_z: f32) -> f32 {
    let m00 = m_inv[0].x;
    let m20 = m_inv[0].z;
    let norm = 0.5 + 0.5 * m00 / sqrt(max(m00 * m00 + m20 * m20, TINY));
    return (1.0 - tail_z) / max(norm, TINY);
}

// Integral of lobe and tail (tail_z, tail_x) over a polygon, from its form factors; never negative.
fn ltc_specular_integral(specular_z: f32, diffuse: vec3<f32>, m_inv: mat3x3<f32>, tail: vec2<f32>) -> f32 {
    let lobe = ltc_lobe_weight(m_inv, tail.x) * specular_z;
    return max(lobe + tail.x * diffuse.z + tail.y * diffuse.x, 0.0);
}

// Schlick's weight averaged over what a Lambert lobe reflects.
fn diffuse_fresnel(n_dot_v: f32) -> f32 {
    let c = saturate(n_dot_v);
    return 0.028159764 + c * (-0.07974446 + c * (0.085935265 + c * (-0.04282759 + c * 0.008554668)));
}
