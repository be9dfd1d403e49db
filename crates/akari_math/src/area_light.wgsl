#define_import_path akari_math::area_light

// Twin: `area_light.rs`. Change both or neither.

// Reflectance at normal incidence of a dielectric whose `reflectance` is 1.
const MAX_DIELECTRIC_F_ZERO: f32 = 0.16;
// Reflectance at normal incidence from which on a dielectric reflects everything at grazing incidence.
const FULL_GRAZING_F_ZERO: f32 = 0.04;

// How a surface reflects, from its base colour, metallic and reflectance.
struct SurfaceReflectance {
    // Albedo of the diffuse part before what the dielectric interface keeps from it.
    diffuse_color: vec3<f32>,
    // Fresnel reflectance at grazing incidence, f90; an imported name must not end in a digit.
    grazing_reflectance: f32,
    // Fresnel reflectance at normal incidence, f0.
    normal_reflectance: vec3<f32>,
    // The same two of the dielectric alone.
    dielectric_normal_reflectance: f32,
    dielectric_grazing_reflectance: f32,
}

// Window that takes a light smoothly to 0 at its range: saturate(1 - (d^2 / r^2)^2)^2.
fn range_falloff(distance_squared: f32, inverse_range_squared: f32) -> f32 {
    let ratio = min(distance_squared * inverse_range_squared, 1.0);
    let window = 1.0 - ratio * ratio;
    return window * window;
}

fn dielectric_f0_from_reflectance(reflectance: f32) -> f32 {
    return MAX_DIELECTRIC_F_ZERO * reflectance * reflectance;
}

fn dielectric_f90_from_f0(dielectric_f0: f32) -> f32 {
    return saturate(dielectric_f0 / FULL_GRAZING_F_ZERO);
}

fn surface_reflectance(base_color: vec3<f32>, metallic: f32, reflectance: f32) -> SurfaceReflectance {
    let dielectric_f0 = dielectric_f0_from_reflectance(reflectance);
    let dielectric_f90 = dielectric_f90_from_f0(dielectric_f0);
    let dielectric = 1.0 - metallic;
    return SurfaceReflectance(
        base_color * dielectric,
        dielectric_f90 * dielectric + metallic,
        vec3<f32>(dielectric_f0 * dielectric) + base_color * metallic,
        dielectric_f0,
        dielectric_f90,
    );
}

// Fraction of light that passes a dielectric interface to the diffuse layer below it.
fn diffuse_transmission(dielectric_f0: vec3<f32>, dielectric_f90: f32, diffuse_fresnel: f32) -> f32 {
    let reflected = dielectric_f0 + (vec3<f32>(dielectric_f90) - dielectric_f0) * diffuse_fresnel;
    return 1.0 - saturate(max(max(reflected.x, reflected.y), reflected.z));
}

// Directional albedo of the specular part from the table's `scale` and `bias`.
fn specular_albedo(f0: vec3<f32>, f90: f32, scale: f32, bias: f32) -> vec3<f32> {
    return f0 * scale + vec3<f32>(f90 * bias);
}

// Radiance reflected to the view from a light of constant radiance.
fn diffuse_specular_combine(
    radiance: vec3<f32>,
    diffuse_albedo: vec3<f32>,
    diffuse_integral: f32,
    specular_albedo: vec3<f32>,
    specular_integral: f32,
) -> vec3<f32> {
    return radiance * (diffuse_albedo * diffuse_integral + specular_albedo * specular_integral);
}
