#define_import_path akari_math::ggx

// Twin: `ggx.rs`, where the formulas, domains, error bounds and sources are. Change both or neither.

#import akari_math::frame::{orthonormal_basis, shading_frame}
#import akari_math::special::{TINY, safe_normalize}

const INV_PI: f32 = 0.31830989;
const TWO_PI: f32 = 6.2831853;
// Smallest alpha of the NDF and of masking: below it the peak of the NDF, 1 / (pi alpha^2), leaves the range of f32
// products.
const MIN_ALPHA: f32 = 1e-5;
// Smallest cosine between view and dominant visible normal.
const MIN_V_DOT_M: f32 = 1e-4;
// Smallest cosine between normal and view of a sample.
const MIN_N_DOT_V: f32 = 1e-4;
// Sharpness added per unit of alpha, fitted so that the lobe joins the diffuse cosine lobe at alpha = 1.
const SHARPNESS_PER_ALPHA: f32 = 1.8;

// SG lobe of a GGX reflection: axis and 1 / sharpness.
struct ReflectionLobe {
    axis: vec3<f32>,
    inverse_sharpness: f32,
}

// A direction that GGX reflects light from, and how much of that light.
struct ReflectedSample {
    direction: vec3<f32>,
    weight: vec3<f32>,
}

// Elliptic SG lobe of a GGX reflection: inverse sharpness along the tangent and across it.
struct AnisotropicLobe {
    axis: vec3<f32>,
    tangent: vec3<f32>,
    variance: vec2<f32>,
}

// GGX distribution of normals, in 1 / sr.
fn ggx_ndf(normal: vec3<f32>, half_vector: vec3<f32>, alpha: f32) -> f32 {
    let a = max(alpha, MIN_ALPHA);
    let cosine = dot(normal, half_vector);
    let sine = cross(normal, half_vector - normal);
    let scaled = a / (a * a * cosine * cosine + dot(sine, sine));
    return scaled * scaled * INV_PI;
}

// sqrt(c^2 + alpha^2 (1 - c^2)), which Smith's masking is made of.
fn smith_root(cosine: f32, alpha: f32) -> f32 {
    let a = max(alpha, MIN_ALPHA);
    return sqrt(cosine * cosine + a * a * max(1.0 - cosine * cosine, 0.0));
}

// Smith's masking of GGX, G1.
fn smith_masking(n_dot_v: f32, alpha: f32) -> f32 {
    let c = max(n_dot_v, 0.0);
    return 2.0 * c / (c + smith_root(c, alpha));
}

// Height-correlated masking and shadowing over 4 (n.v) (n.l).
fn smith_visibility(n_dot_v: f32, n_dot_l: f32, alpha: f32) -> f32 {
    let v = max(n_dot_v, 0.0);
    let l = max(n_dot_l, 0.0);
    return 0.5 / max(l * smith_root(v, alpha) + v * smith_root(l, alpha), TINY);
}

// Height-correlated masking and shadowing, G2.
fn smith_masking_shadowing(n_dot_v: f32, n_dot_l: f32, alpha: f32) -> f32 {
    let v = max(n_dot_v, 0.0);
    let l = max(n_dot_l, 0.0);
    return 2.0 * v * l / max(l * smith_root(v, alpha) + v * smith_root(l, alpha), TINY);
}

// Schlick's Fresnel reflectance with an explicit value at grazing incidence.
fn fresnel_schlick(f0: vec3<f32>, f90: f32, v_dot_h: f32) -> vec3<f32> {
    let m = 1.0 - saturate(v_dot_h);
    let m_squared = m * m;
    return f0 + (vec3<f32>(f90) - f0) * (m_squared * m_squared * m);
}

// Unit normal of the microfacet that the view sees most of, for unit `normal` and `view`.
fn ggx_dominant_visible_normal(normal: vec3<f32>, view: vec3<f32>, alpha: f32) -> vec3<f32> {
    let cosine = dot(normal, view);
    let projected = view - normal * cosine;
    let alpha_squared = alpha * alpha;
    let stretched = alpha_squared * dot(projected, projected);
    let t = sqrt(stretched + cosine * cosine);
    // t + cosine, without the cancellation where the view is below the surface.
    let along_normal = select(stretched / max(t - cosine, TINY), t + cosine, cosine >= 0.0);
    return safe_normalize(alpha_squared * projected + along_normal * normal, normal);
}

// SG lobe of the light that GGX reflects to unit `view`.
fn ggx_reflection_lobe(normal: vec3<f32>, view: vec3<f32>, alpha: f32) -> ReflectionLobe {
    let m = ggx_dominant_visible_normal(normal, view, alpha);
    let v_dot_m = dot(view, m);
    let jacobian = max(dot(normal, m), 0.0) / (4.0 * max(v_dot_m, MIN_V_DOT_M));
    let alpha_squared = alpha * alpha;
    let sharpness_over = 2.0 * max(1.0 - alpha_squared, 0.0) * jacobian + SHARPNESS_PER_ALPHA * alpha_squared * alpha;
    return ReflectionLobe(
        safe_normalize(2.0 * v_dot_m * m - view, normal),
        alpha_squared / max(sharpness_over, TINY),
    );
}

// The same after Wang et al. 2009: the mirrored view, sharpness 2 / alpha^2 / (4 |n.v|).
fn ggx_reflection_lobe_wang(normal: vec3<f32>, view: vec3<f32>, alpha: f32) -> ReflectionLobe {
    let cosine = dot(normal, view);
    return ReflectionLobe(
        safe_normalize(2.0 * cosine * normal - view, normal),
        2.0 * alpha * alpha * abs(cosine),
    );
}

// `ggx_reflection_lobe`, stretched along the plane of incidence by the Jacobian of the half vector.
fn ggx_anisotropic_lobe(normal: vec3<f32>, view: vec3<f32>, alpha: f32) -> AnisotropicLobe {
    let m = ggx_dominant_visible_normal(normal, view, alpha);
    let lobe = ggx_reflection_lobe(normal, view, alpha);
    let frame = shading_frame(normal, view);
    let v_dot_m = clamp(dot(view, m), MIN_V_DOT_M, 1.0);
    // Towards a circle with roughness.
    let stretch = v_dot_m + (1.0 - v_dot_m) * (alpha * alpha);
    return AnisotropicLobe(
        lobe.axis,
        safe_normalize(cross(frame[1], lobe.axis), frame[0]),
        vec2<f32>(lobe.inverse_sharpness / stretch, lobe.inverse_sharpness * stretch),
    );
}

// Unit normal of a microfacet that the view sees, drawn by two numbers in [0, 1).
fn ggx_visible_normal(normal: vec3<f32>, view: vec3<f32>, alpha: f32, random: vec2<f32>) -> vec3<f32> {
    let frame = orthonormal_basis(normal);
    let a = max(alpha, MIN_ALPHA);
    let local = transpose(frame) * view;
    let stretched = safe_normalize(vec3<f32>(a * local.x, a * local.y, local.z), vec3<f32>(0.0, 0.0, 1.0));
    let height = (1.0 - random.y) * (1.0 + stretched.z);
    let radius = sqrt(random.y * (1.0 + stretched.z) * max(1.0 - stretched.z + height, 0.0));
    let angle = TWO_PI * random.x;
    let across = vec2<f32>(radius * cos(angle) + stretched.x, radius * sin(angle) + stretched.y);
    let half_vector = vec3<f32>(a * across.x, a * across.y, height);
    return frame * safe_normalize(half_vector, vec3<f32>(0.0, 0.0, 1.0));
}

// A direction of the reflection to the view, drawn by two numbers in [0, 1), and what is reflected of its light.
fn ggx_reflected_sample(
    normal: vec3<f32>,
    view: vec3<f32>,
    alpha: f32,
    f0: vec3<f32>,
    f90: f32,
    random: vec2<f32>,
) -> ReflectedSample {
    let m = ggx_visible_normal(normal, view, alpha, random);
    let v_dot_m = dot(view, m);
    let direction = safe_normalize(2.0 * v_dot_m * m - view, normal);
    let n_dot_l = dot(normal, direction);
    if n_dot_l <= 0.0 {
        return ReflectedSample(direction, vec3<f32>(0.0));
    }
    let n_dot_v = max(dot(normal, view), MIN_N_DOT_V);
    let unshadowed = smith_masking_shadowing(n_dot_v, n_dot_l, alpha) / smith_masking(n_dot_v, alpha);
    return ReflectedSample(direction, fresnel_schlick(f0, f90, v_dot_m) * min(unshadowed, 1.0));
}
