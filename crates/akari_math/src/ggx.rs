//! GGX: distribution, masking, Fresnel, and the spherical Gaussian nearest to its reflection.
//!
//! `alpha` is perceptual roughness squared, in `[0, 1]`; vectors are unit and in one space.
//!
//! WGSL module: `akari_math::ggx`.

use crate::frame::{orthonormal_basis, shading_frame};
use crate::special::{TINY, safe_normalize};
use glam::{Vec2, Vec3};

const INV_PI: f32 = 0.318_309_89;
const TWO_PI: f32 = 6.283_185_3;
/// Smallest alpha of the distribution and of masking: below it the peak of the distribution, `1/(π α²)`, leaves the
/// range in which f32 products of it are finite.
pub const MIN_ALPHA: f32 = 1e-5;
/// Smallest cosine between view and dominant visible normal.
const MIN_V_DOT_M: f32 = 1e-4;
/// Smallest cosine between normal and view of a sample: interpolated normals turn away from the view.
const MIN_N_DOT_V: f32 = 1e-4;
/// Sharpness added per unit of alpha, fitted so that the lobe joins the diffuse cosine lobe at α = 1.
const SHARPNESS_PER_ALPHA: f32 = 1.8;

/// Spherical Gaussian of a GGX reflection.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReflectionLobe {
    /// Unit axis.
    pub axis: Vec3,
    /// 1 / sharpness; 0 for a mirror, at most 1/1.8.
    pub inverse_sharpness: f32,
}

/// A direction that GGX reflects light from, and how much of that light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReflectedSample {
    /// Unit, from the surface.
    pub direction: Vec3,
    /// Reflected radiance over incident radiance, each in `[0, 1]`; 0 for directions into the surface.
    pub weight: Vec3,
}

/// Elliptic spherical Gaussian of a GGX reflection.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AnisotropicLobe {
    /// Unit axis.
    pub axis: Vec3,
    /// Unit vector at right angles to the axis, in the plane of incidence.
    pub tangent: Vec3,
    /// Inverse sharpness along the tangent, and across it (along `axis × tangent`); 0 for a mirror.
    pub variance: Vec2,
}

/// GGX distribution of normals `D(h) = (α/d)²/π`, `d = α² (n·h)² + |n × h|²`, in 1/sr.
///
/// Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", eq. 33. The usual
/// `((α² − 1)(n·h)² + 1)` cancels near the peak: relative error 0.68 at α = 1e-3 in f32. Here `n × h` is computed as
/// `n × (h − n)`, relative error below 2e-6 for α from 1e-5 to 1 within the peak (test `twins`). α is at least
/// [`MIN_ALPHA`].
#[must_use]
pub fn ggx_ndf(normal: Vec3, half_vector: Vec3, alpha: f32) -> f32 {
    let a = alpha.max(MIN_ALPHA);
    let cosine = normal.dot(half_vector);
    let sine = normal.cross(half_vector - normal);
    let scaled = a / (a * a * cosine * cosine + sine.dot(sine));
    scaled * scaled * INV_PI
}

/// `√(c² + α² (1 − c²))`, which Smith's masking is made of. Relative error 3e-7.
#[must_use]
pub fn smith_root(cosine: f32, alpha: f32) -> f32 {
    let a = alpha.max(MIN_ALPHA);
    (cosine * cosine + a * a * (1.0 - cosine * cosine).max(0.0)).sqrt()
}

/// Smith's masking `G1 = 2c / (c + √(c² + α²(1 − c²)))` for `c = n·v`; 0 below the surface.
///
/// Walter et al. 2007, eq. 34. Relative error 5e-7.
#[must_use]
pub fn smith_masking(n_dot_v: f32, alpha: f32) -> f32 {
    let c = n_dot_v.max(0.0);
    2.0 * c / (c + smith_root(c, alpha))
}

/// Height-correlated masking and shadowing over `4 (n·v) (n·l)`, in 1: `0.5 / (l √… + v √…)`.
///
/// Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", eq. 99. Finite at grazing
/// incidence; the largest value is of the order of `1/α²` times the inverse cosine. Relative error 6e-7.
#[must_use]
pub fn smith_visibility(n_dot_v: f32, n_dot_l: f32, alpha: f32) -> f32 {
    let v = n_dot_v.max(0.0);
    let l = n_dot_l.max(0.0);
    0.5 / (l * smith_root(v, alpha) + v * smith_root(l, alpha)).max(TINY)
}

/// Height-correlated masking and shadowing `G2`, in `[0, 1]`; 0 below the surface. Heitz 2014, eq. 99.
/// Relative error 6e-7.
#[must_use]
pub fn smith_masking_shadowing(n_dot_v: f32, n_dot_l: f32, alpha: f32) -> f32 {
    let v = n_dot_v.max(0.0);
    let l = n_dot_l.max(0.0);
    2.0 * v * l / (l * smith_root(v, alpha) + v * smith_root(l, alpha)).max(TINY)
}

/// Fresnel reflectance `f0 + (f90 − f0)(1 − v·h)⁵`.
///
/// Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering", eq. 15, with an explicit value at grazing
/// incidence. Absolute error 4e-7.
#[must_use]
pub fn fresnel_schlick(f0: Vec3, f90: f32, v_dot_h: f32) -> Vec3 {
    let m = 1.0 - v_dot_h.clamp(0.0, 1.0);
    let m_squared = m * m;
    f0 + (Vec3::splat(f90) - f0) * (m_squared * m_squared * m)
}

/// Unit normal of the microfacets that the view sees most of: `normalize(α² v_t + (t + v_n) n)`, `t = √(α² |v_t|² +
/// v_n²)`, with `v_t` and `v_n` the view's parts along the surface and the normal.
///
/// The mean direction of the visible normals points there (Heitz 2018, "Sampling the GGX Distribution of Visible
/// Normals": the middle of the visible part of the stretched hemisphere). Below the surface `t + v_n` is computed
/// without cancellation; the normal where both parts vanish.
#[must_use]
pub fn ggx_dominant_visible_normal(normal: Vec3, view: Vec3, alpha: f32) -> Vec3 {
    let cosine = normal.dot(view);
    let projected = view - normal * cosine;
    let alpha_squared = alpha * alpha;
    let stretched = alpha_squared * projected.dot(projected);
    let t = (stretched + cosine * cosine).sqrt();
    let along_normal = if cosine >= 0.0 {
        t + cosine
    } else {
        stretched / (t - cosine).max(TINY)
    };
    safe_normalize(alpha_squared * projected + along_normal * normal, normal)
}

/// Spherical Gaussian of the light that GGX reflects to `view`.
///
/// The axis is the view reflected about the dominant visible normal `m`; the sharpness `λ = (2/α² − 2) J + 1.8 α`, `J =
/// (n·m)/(4 v·m)`, given as `1/λ = α² / (2 (1 − α²) J + 1.8 α³)`, which is finite from a mirror (0) to α = 1 (0.56).
/// Axis and first term are those of Tokuyoshi's virtual spherical Gaussian lights (Tokuyoshi 2015, "Virtual Spherical
/// Gaussian Lights for Real-Time Glossy Indirect Illumination", and the code that followed it); the term 1.8 α is
/// fitted here, and lets the lobe join the diffuse cosine lobe at α = 1.
///
/// Mean L2 cosine to the true lobe over α from 0.01 to 1 and view angles from 0 to 85°: 0.916; for the mirrored axis
/// and `2/α²/(4 n·v)` of Wang et al. 2009 0.786 (test `reflection_lobe_is_near_the_true_one`). The best single lobe has
/// 0.919: what is missing is anisotropy at grazing views.
#[must_use]
pub fn ggx_reflection_lobe(normal: Vec3, view: Vec3, alpha: f32) -> ReflectionLobe {
    let m = ggx_dominant_visible_normal(normal, view, alpha);
    let v_dot_m = view.dot(m);
    let jacobian = normal.dot(m).max(0.0) / (4.0 * v_dot_m.max(MIN_V_DOT_M));
    let alpha_squared = alpha * alpha;
    let sharpness_over = 2.0 * (1.0 - alpha_squared).max(0.0) * jacobian
        + SHARPNESS_PER_ALPHA * alpha_squared * alpha;
    ReflectionLobe {
        axis: safe_normalize(2.0 * v_dot_m * m - view, normal),
        inverse_sharpness: alpha_squared / sharpness_over.max(TINY),
    }
}

/// Spherical Gaussian of a GGX reflection after Wang et al. 2009, "All-Frequency Rendering of Dynamic,
/// Spatially-Varying Reflectance": the mirrored view, sharpness `λ = 2/α² / (4 |n·v|)`.
///
/// Kept for comparison with [`ggx_reflection_lobe`]: its mean L2 cosine to the true lobe is 0.786 against 0.916. Given
/// as `1/λ = 2 α² |n·v|`, which is 0 for a mirror, and 0 at grazing views, where this model becomes a mirror too.
#[must_use]
pub fn ggx_reflection_lobe_wang(normal: Vec3, view: Vec3, alpha: f32) -> ReflectionLobe {
    let cosine = normal.dot(view);
    ReflectionLobe {
        axis: safe_normalize(2.0 * cosine * normal - view, normal),
        inverse_sharpness: 2.0 * alpha * alpha * cosine.abs(),
    }
}

/// Elliptic spherical Gaussian of the light that GGX reflects to `view`: [`ggx_reflection_lobe`], stretched.
///
/// A microfacet that turns by a small angle turns the reflection by twice that in the plane of incidence and by
/// `2 v·m` times that across it: the half-vector's Jacobian, 4 along and `4 (v·m)²` across. The variances are `v/c`
/// along and `v c` across, `c = v·m`, so that their geometric mean is the isotropic inverse sharpness v. Towards α = 1
/// the shape comes from the horizon and the masking instead, and joins the circular diffuse lobe:
/// `c = v·m + (1 − v·m) α²`. Where the view is along the normal both are equal, and the tangent is arbitrary.
///
/// Mean L2 cosine of `exp(−½ (x²/(v/c) + y²/(v c) + z²/v))`, `(x, y, z)` the difference to the axis in the frame of
/// tangent, bitangent and axis, to the true lobe: 0.967, at worst 0.88, where the isotropic lobe has 0.915 and 0.57,
/// and the best ellipse on that axis 0.971 (test `reflection_lobe_is_near_the_true_one`). Finite for any view and α in
/// `[0, 1]`.
#[must_use]
pub fn ggx_anisotropic_lobe(normal: Vec3, view: Vec3, alpha: f32) -> AnisotropicLobe {
    let m = ggx_dominant_visible_normal(normal, view, alpha);
    let lobe = ggx_reflection_lobe(normal, view, alpha);
    let frame = shading_frame(normal, view);
    let v_dot_m = view.dot(m).clamp(MIN_V_DOT_M, 1.0);
    let stretch = v_dot_m + (1.0 - v_dot_m) * (alpha * alpha);
    AnisotropicLobe {
        axis: lobe.axis,
        tangent: safe_normalize(frame.y_axis.cross(lobe.axis), frame.x_axis),
        variance: Vec2::new(
            lobe.inverse_sharpness / stretch,
            lobe.inverse_sharpness * stretch,
        ),
    }
}

/// Unit normal of a microfacet that the view sees, drawn by two numbers in `[0, 1)`.
///
/// Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps": about the view, stretched until the
/// microfacets are a hemisphere, reflections are uniform over a spherical cap; their half vectors, stretched back, are the
/// normals. The half vector's height and the cap's radius are taken from `(1 - y)(1 + v_z)` and `y (1 + v_z)`, without
/// cancellation: error below 2e-5 (test `twins`; 2e-3 within a thousandth of the cap's rim, where the half vector vanishes).
#[must_use]
pub fn ggx_visible_normal(normal: Vec3, view: Vec3, alpha: f32, random: Vec2) -> Vec3 {
    let frame = orthonormal_basis(normal);
    let a = alpha.max(MIN_ALPHA);
    let local = frame.transpose() * view;
    let stretched = safe_normalize(
        Vec3::new(a * local.x, a * local.y, local.z),
        Vec3::new(0.0, 0.0, 1.0),
    );
    let height = (1.0 - random.y) * (1.0 + stretched.z);
    let radius = (random.y * (1.0 + stretched.z) * (1.0 - stretched.z + height).max(0.0)).sqrt();
    let angle = TWO_PI * random.x;
    let across = Vec2::new(
        radius * angle.cos() + stretched.x,
        radius * angle.sin() + stretched.y,
    );
    let half_vector = Vec3::new(a * across.x, a * across.y, height);
    frame * safe_normalize(half_vector, Vec3::new(0.0, 0.0, 1.0))
}

/// A direction of the GGX reflection to `view`, drawn by two numbers in `[0, 1)`; the mean of `weight` times incident
/// radiance over many is the reflected radiance, masking and Fresnel included.
///
/// Directions are those of [`ggx_visible_normal`], which leaves of the reflection integral `F G₂ / G₁` (Heitz 2018, "Sampling
/// the GGX Distribution of Visible Normals", eq. 19).
#[must_use]
pub fn ggx_reflected_sample(
    normal: Vec3,
    view: Vec3,
    alpha: f32,
    f0: Vec3,
    f90: f32,
    random: Vec2,
) -> ReflectedSample {
    let m = ggx_visible_normal(normal, view, alpha, random);
    let v_dot_m = view.dot(m);
    let direction = safe_normalize(2.0 * v_dot_m * m - view, normal);
    let n_dot_l = normal.dot(direction);
    if n_dot_l <= 0.0 {
        return ReflectedSample {
            direction,
            weight: Vec3::ZERO,
        };
    }
    let n_dot_v = normal.dot(view).max(MIN_N_DOT_V);
    let unshadowed =
        smith_masking_shadowing(n_dot_v, n_dot_l, alpha) / smith_masking(n_dot_v, alpha);
    ReflectedSample {
        direction,
        weight: fresnel_schlick(f0, f90, v_dot_m) * unshadowed.min(1.0),
    }
}
