//! Reflection of one area light at one point: what the integrals of [`crate::ltc`] are multiplied by.
//!
//! WGSL module: `akari_math::area_light`.

use glam::Vec3;

/// Reflectance at normal incidence of a dielectric whose `reflectance` is 1.
const MAX_DIELECTRIC_F_ZERO: f32 = 0.16;
/// Reflectance at normal incidence from which on a dielectric reflects everything at grazing incidence.
const FULL_GRAZING_F_ZERO: f32 = 0.04;

/// How a surface reflects, from its base colour, metallic and reflectance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceReflectance {
    /// Albedo of the diffuse part before what the dielectric interface keeps from it ([`diffuse_transmission`]).
    pub diffuse_color: Vec3,
    /// Fresnel reflectance at grazing incidence, f90. (WGSL identifiers that are imported must not end in a digit.)
    pub grazing_reflectance: f32,
    /// Fresnel reflectance at normal incidence, f0.
    pub normal_reflectance: Vec3,
    /// Fresnel reflectance at normal incidence of the dielectric alone.
    pub dielectric_normal_reflectance: f32,
    /// Fresnel reflectance at grazing incidence of the dielectric alone.
    pub dielectric_grazing_reflectance: f32,
}

/// Window that takes a light smoothly to 0 at its range `r`: `saturate(1 − (d²/r²)²)²`.
///
/// `distance_squared` in m², `inverse_range_squared` in 1/m² (0 for a light without range, factor 1). The meaning of
/// `range` in Bevy and in glTF's `KHR_lights_punctual` (Karis 2013, "Real Shading in Unreal Engine 4", eq. 9). Error
/// 4 ULP of 1.
#[must_use]
pub fn range_falloff(distance_squared: f32, inverse_range_squared: f32) -> f32 {
    let ratio = (distance_squared * inverse_range_squared).min(1.0);
    let window = 1.0 - ratio * ratio;
    window * window
}

/// Fresnel reflectance at normal incidence of a dielectric, `0.16 reflectance²` (Lagarde, de Rousiers 2014, "Moving
/// Frostbite to PBR"; 0.5 gives 0.04, an index of refraction of 1.5).
#[must_use]
pub fn dielectric_f0_from_reflectance(reflectance: f32) -> f32 {
    MAX_DIELECTRIC_F_ZERO * reflectance * reflectance
}

/// Fresnel reflectance at grazing incidence of a dielectric, `saturate(f0 / 0.04)`.
///
/// Below the `f0` of common dielectrics the reflectance is a specular weight, not an index of refraction: it fades the
/// grazing reflection too, and a weight of 0 is exactly Lambert (glTF `KHR_materials_specular`).
#[must_use]
pub fn dielectric_f90_from_f0(dielectric_f0: f32) -> f32 {
    (dielectric_f0 / FULL_GRAZING_F_ZERO).clamp(0.0, 1.0)
}

/// The reflectance parameters of glTF's metallic-roughness material (glTF 2.0, Appendix B): a mix by `metallic` of a
/// metal (`f0 = base_color`, `f90 = 1`, no diffuse part) and a dielectric of diffuse colour `base_color`.
///
/// `metallic` and `reflectance` in `[0, 1]`.
#[must_use]
pub fn surface_reflectance(
    base_color: Vec3,
    metallic: f32,
    reflectance: f32,
) -> SurfaceReflectance {
    let dielectric_f0 = dielectric_f0_from_reflectance(reflectance);
    let dielectric_f90 = dielectric_f90_from_f0(dielectric_f0);
    let dielectric = 1.0 - metallic;
    SurfaceReflectance {
        diffuse_color: base_color * dielectric,
        grazing_reflectance: dielectric_f90 * dielectric + metallic,
        normal_reflectance: Vec3::splat(dielectric_f0 * dielectric) + base_color * metallic,
        dielectric_normal_reflectance: dielectric_f0,
        dielectric_grazing_reflectance: dielectric_f90,
    }
}

/// Fraction of light that passes a dielectric interface to the diffuse layer below it, in `[0, 1]`.
///
/// `1 − max over channels of (f0 + (f90 − f0) diffuse_fresnel)`: the `fresnel_mix` of glTF 2.0, Appendix B, with the
/// weight `(1 − v·h)⁵` averaged over the cosine hemisphere, [`diffuse_fresnel`](crate::ltc::lookup::diffuse_fresnel).
#[must_use]
pub fn diffuse_transmission(dielectric_f0: Vec3, dielectric_f90: f32, diffuse_fresnel: f32) -> f32 {
    let reflected = dielectric_f0 + (Vec3::splat(dielectric_f90) - dielectric_f0) * diffuse_fresnel;
    1.0 - reflected
        .x
        .max(reflected.y)
        .max(reflected.z)
        .clamp(0.0, 1.0)
}

/// Directional albedo of the specular part, `f0 · scale + f90 · bias`, from the table of [`crate::ltc::lookup`].
#[must_use]
pub fn specular_albedo(f0: Vec3, f90: f32, scale: f32, bias: f32) -> Vec3 {
    f0 * scale + Vec3::splat(f90 * bias)
}

/// Radiance reflected to the view from a light of constant `radiance`:
/// `L (diffuse_albedo E_diffuse + specular_albedo E_specular)`.
///
/// `diffuse_albedo` is `diffuse_color · diffuse_transmission`; `diffuse_integral` is the `.z` of the form factor of
/// [`crate::ltc::polygon::LtcPolygon`], `specular_integral` is
/// [`ltc_specular_integral`](crate::ltc::lookup::ltc_specular_integral). Radiance in and out in the same unit.
#[must_use]
pub fn diffuse_specular_combine(
    radiance: Vec3,
    diffuse_albedo: Vec3,
    diffuse_integral: f32,
    specular_albedo: Vec3,
    specular_integral: f32,
) -> Vec3 {
    radiance * (diffuse_albedo * diffuse_integral + specular_albedo * specular_integral)
}
