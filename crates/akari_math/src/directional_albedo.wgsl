#define_import_path akari_math::directional_albedo

// Twin: `directional_albedo.rs`, where the formulas, domains and error bounds are. Change both or neither.

// Smallest alpha of the fit: below it, a mirror.
const MIN_FIT_ALPHA: f32 = 1e-4;
// Floor of the albedo, which signals are divided by.
const MIN_ALBEDO: f32 = 1e-3;

// Factors of f0 and of f90 in the directional albedo.
fn ggx_albedo_terms(perceptual_roughness: f32, n_dot_v: f32) -> vec2<f32> {
    let r = saturate(perceptual_roughness);
    let c = saturate(n_dot_v);
    let a = max(r * r, MIN_FIT_ALPHA);
    let lost = a * a * c * (1.0 + 6.23 * a - 2.954 * r)
        / (a * a * a * (1.301 - 1.23 * c) + c * (7.676 * a * a + c * (1.265 * c - 3.01 * a)));
    let v_dot_h = (c * c + a * (c * (0.811 + 2.988 * r) + 4.858 * a))
        / (c + a * (1.05 + 5.244 * a + 4.053 * r));
    let m = 1.0 - min(v_dot_h, 1.0);
    let total = 1.0 - lost;
    let grazing = total * (m * m * m * m * m);
    return vec2<f32>(total - grazing, grazing);
}

// Directional albedo of GGX with Schlick's Fresnel, per channel.
fn ggx_directional_albedo(f0: vec3<f32>, f90: f32, perceptual_roughness: f32, n_dot_v: f32) -> vec3<f32> {
    let terms = ggx_albedo_terms(perceptual_roughness, n_dot_v);
    return min(max(f0 * terms.x + vec3<f32>(f90 * terms.y), vec3<f32>(MIN_ALBEDO)), vec3<f32>(1.0));
}
