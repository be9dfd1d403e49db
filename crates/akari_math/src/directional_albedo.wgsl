#define_import_path akari_math::directional_albedo

// Twin: `directional_albedo.rs`. Change both or neither.

// Floor of the albedo, which signals are divided by.
const MIN_ALBEDO: f32 = 1e-3;

// Factors of f0 and of f90 in the directional albedo.
fn ggx_albedo_terms(perceptual_roughness: f32, n_dot_v: f32) -> vec2<f32> {
    let r = saturate(perceptual_roughness);
    let c = saturate(n_dot_v);
    let m = 1.0 - c;
    let grazing = m * m * m * m * m * (1.0 - r) * (1.0 - r);
    return vec2<f32>(1.0 - grazing - 0.5 * r * r * r, grazing);
}

// Directional albedo of GGX with Schlick's Fresnel, per channel.
fn ggx_directional_albedo(f0: vec3<f32>, f90: f32, perceptual_roughness: f32, n_dot_v: f32) -> vec3<f32> {
    let terms = ggx_albedo_terms(perceptual_roughness, n_dot_v);
    return min(max(f0 * terms.x + vec3<f32>(f90 * terms.y), vec3<f32>(MIN_ALBEDO)), vec3<f32>(1.0));
}
