//! Integral of a spherical Gaussian over a polygon, by mixtures of one to three linearly transformed cosines.
//!
//! `∫_P e^{λ(ω·ξ − 1)} dω ≈ I(λ) Σ_k w_k F(diag(1, 1, a_k) P)`: in a frame with the axis along z a cosine lobe scaled by
//! `(a, a, 1)` resembles the lobe, and integrates over a polygon as a form factor (Heitz, Dupuy, Hill, Neubelt 2016,
//! "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines"; Okada, Iwasaki 2017, "Efficient Calculation for
//! Interreflection using Linearly Transformed Cosines", eq. 4 to 7, for one lobe). The lobe's integral over the sphere
//! `I(λ) = 2π (1 − e^{−2λ})/λ` belongs to it; eq. 7 of Okada and Iwasaki omits it.
//!
//! Widths `a_k √(λ/2)` and weights are cubic in `v = 1/(1 + λ/8)`, fitted for λ ≥ 4 by least squares
//! (`akari_ltc_fit::sg`, which prints the coefficients below: `cargo test -p akari_ltc_fit --release --test sg_rules --
//! --ignored --nocapture`). Mean square error of the value over angles uniform in 0 to π/2 (test `mixtures` there):
//!
//! | λ | Okada, Iwasaki 2017 | one lobe | two | three |
//! |---|---|---|---|---|
//! | 10 | 0.0024 | 0.0023 | 6.8e-5 | 1.4e-5 |
//! | 50 | 0.0020 | 0.0018 | 1.6e-4 | 4.1e-5 |
//!
//! One weight of two or three lobes is negative, so that rounding counts up to 14-fold; the integral may be slightly
//! below 0. The lobe behind its own horizon, e^{−λ} of it, is left out: below λ = 4 nothing here is accurate, and
//! [`sg_ltc_share`] goes to 0.
//!
//! **Error and time**: `docs/sg_polygon.md`. These are the cheapest forms, at half the time of the quadrature of
//! [`crate::sg::polygon`] with four nodes and forty (three lobes) to two hundred times (one lobe) its mean error. Further
//! lobes cost next to nothing, since lobes share the cross products of the edges.
//!
//! Vertices, clipping and signs as in [`crate::sg::polygon`].
//!
//! WGSL module: `akari_math::sg::ltc`.

use crate::frame::orthonormal_basis;
use crate::polygon::{
    HorizonClip, horizon_clip_new, horizon_clip_push, horizon_middle, is_long_horizon_edge,
};
use crate::sg::lobe::sg_integral;
use crate::sg::polygon::sg_polygon_integral;
use crate::special::{TINY, atan2_poly, scale_to_unit_box};
use glam::{Mat3, Vec3};

const INV_TWO_PI: f32 = 0.159_154_94;
/// Scale of λ in the parameters of the mixtures: `v = 1/(1 + λ/8)`.
const MIXTURE_SHARPNESS: f32 = 8.0;
/// Sharpness below which no mixture is used.
pub const MIN_MIXTURE_SHARPNESS: f32 = 4.0;
/// Nodes of the quadrature that takes over there.
pub const LOW_SHARPNESS_NODES: u32 = 4;

/// Cosine lobes that resemble a spherical Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SgMixture {
    /// Scales `a_k` of the lobes.
    pub widths: Vec3,
    /// Weights, which add up to the integral of the spherical Gaussian over the sphere; 0 for lobes that there are not.
    pub weights: Vec3,
}

/// A polygon under one mixture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SgLtcPolygon {
    /// The integral in sr; valid after [`sg_ltc_polygon_close`].
    pub integral: f32,
    /// Clip at the horizon of the surface.
    pub clip: HorizonClip,
    /// 1 once a vertex above the surface has come.
    pub started: u32,
    /// The first vertex above the surface, any scale.
    pub first: Vec3,
    /// The latest vertex above the surface, any scale.
    pub previous: Vec3,
    /// Clip at the horizon of the lobe, in its frame.
    pub lobe_clip: HorizonClip,
    /// 1 once a vertex above both horizons has come.
    pub lobe_started: u32,
    /// The first vertex above both, in the frame of the lobe, any scale.
    pub lobe_first: Vec3,
    /// The latest vertex above both, in the frame of the lobe, any scale.
    pub lobe_previous: Vec3,
    /// Sums of the edges of each cosine lobe so far, not yet divided by 2π.
    pub sums: Vec3,
}

/// Share of a mixture in the blend with quadrature: 0 below λ = 4, 1 from 8 on.
#[must_use]
pub fn sg_ltc_share(sharpness: f32) -> f32 {
    (sharpness / MIN_MIXTURE_SHARPNESS - 1.0).max(0.0).min(1.0)
}

/// Mixture of `lobes` cosine lobes, 1 to 3, for sharpness λ from 4 to 1e12.
#[must_use]
pub fn sg_mixture(lobes: u32, sharpness: f32) -> SgMixture {
    let v = 1.0 / (1.0 + sharpness / MIXTURE_SHARPNESS);
    let widths;
    let shares;
    if lobes == 1 {
        widths = Vec3::new(
            0.934814 + v * (0.032946 + v * (-0.066220 + v * 0.166412)),
            1.0,
            1.0,
        );
        shares = Vec3::new(1.0, 0.0, 0.0);
    } else if lobes == 2 {
        widths = Vec3::new(
            1.507712 + v * (-0.403643 + v * (1.163637 + v * -1.942005)),
            1.705068 + v * (-0.376943 + v * (1.480118 + v * -2.815187)),
            1.0,
        );
        let first = 7.499702 + v * (-7.756207 + v * (10.932674 + v * -11.357130));
        shares = Vec3::new(first, 1.0 - first, 0.0);
    } else {
        widths = Vec3::new(
            0.972633 + v * (-0.342907 + v * (1.193243 + v * -1.072928)),
            1.186111 + v * (-0.291294 + v * (1.652900 + v * -2.240503)),
            1.480270 + v * (-0.203883 + v * (2.508114 + v * -4.256625)),
        );
        let first = -2.860038 + v * (5.025888 + v * (0.726890 + v * -7.710157));
        let second = 8.762429 + v * (-13.086335 + v * (6.418712 + v * 6.197571));
        shares = Vec3::new(first, second, 1.0 - first - second);
    }
    SgMixture {
        widths: widths * (2.0 / sharpness.max(MIN_MIXTURE_SHARPNESS)).sqrt(),
        weights: shares * sg_integral(sharpness),
    }
}

/// `z` of the form factor, times 2π, of the edge from `a` to `b` (any scale) scaled by `(1, 1, width)`.
///
/// `c = (b − a) × a` is scaled instead of the vertices, so that lobes share it. Absolute error below 5e-7 (test `twins`).
#[must_use]
pub fn sg_ltc_edge(a: Vec3, b: Vec3, width: f32) -> f32 {
    let normal = (b - a).cross(a);
    let squared = width * width * (normal.x * normal.x + normal.y * normal.y) + normal.z * normal.z;
    let sine = squared.max(TINY).sqrt();
    let cosine = a.x * b.x + a.y * b.y + width * width * a.z * b.z;
    normal.z * (atan2_poly(sine, cosine) / sine)
}

/// An empty polygon.
#[must_use]
pub fn sg_ltc_polygon_new() -> SgLtcPolygon {
    SgLtcPolygon {
        clip: horizon_clip_new(),
        lobe_clip: horizon_clip_new(),
        ..SgLtcPolygon::default()
    }
}

/// Adds the edge from `a` to `b`, vertices relative to the shading point in the shading frame; `a` is the `b` of the
/// edge before. `frame` has the axis of the lobe as its third column.
pub fn sg_ltc_polygon_add_edge(
    polygon: &mut SgLtcPolygon,
    frame: Mat3,
    mixture: SgMixture,
    a: Vec3,
    b: Vec3,
) {
    if polygon.clip.started == 0 {
        sg_ltc_polygon_push(polygon, frame, mixture, a);
    }
    sg_ltc_polygon_push(polygon, frame, mixture, b);
}

/// Adds one vertex; what [`sg_ltc_polygon_add_edge`] is made of.
pub fn sg_ltc_polygon_push(
    polygon: &mut SgLtcPolygon,
    frame: Mat3,
    mixture: SgMixture,
    vertex: Vec3,
) {
    let scaled = scale_to_unit_box(vertex);
    if scaled == Vec3::ZERO {
        return;
    }
    let step = horizon_clip_push(polygon.clip, scaled);
    polygon.clip = step.clip;
    if step.has_crossing != 0 {
        sg_ltc_polygon_push_visible(polygon, frame, mixture, step.crossing);
    }
    if step.has_vertex != 0 {
        sg_ltc_polygon_push_visible(polygon, frame, mixture, scaled);
    }
}

/// Adds a vertex of the part above the surface, with a third point on long edges along the horizon, whose plane the
/// turn to the frame of the lobe would lose.
pub fn sg_ltc_polygon_push_visible(
    polygon: &mut SgLtcPolygon,
    frame: Mat3,
    mixture: SgMixture,
    vertex: Vec3,
) {
    if polygon.started == 0 {
        polygon.first = vertex;
        polygon.started = 1;
    } else if is_long_horizon_edge(polygon.previous, vertex) {
        let middle = horizon_middle(polygon.previous, vertex);
        sg_ltc_polygon_push_turned(polygon, mixture, frame.transpose() * middle);
    }
    polygon.previous = vertex;
    sg_ltc_polygon_push_turned(polygon, mixture, frame.transpose() * vertex);
}

/// Clip at the horizon of the lobe, of a vertex in its frame.
pub fn sg_ltc_polygon_push_turned(polygon: &mut SgLtcPolygon, mixture: SgMixture, vertex: Vec3) {
    let scaled = scale_to_unit_box(vertex);
    if scaled == Vec3::ZERO {
        return;
    }
    let step = horizon_clip_push(polygon.lobe_clip, scaled);
    polygon.lobe_clip = step.clip;
    if step.has_crossing != 0 {
        sg_ltc_polygon_push_lobe(polygon, mixture, scale_to_unit_box(step.crossing));
    }
    if step.has_vertex != 0 {
        sg_ltc_polygon_push_lobe(polygon, mixture, scaled);
    }
}

/// Adds a vertex of the part above both horizons.
pub fn sg_ltc_polygon_push_lobe(polygon: &mut SgLtcPolygon, mixture: SgMixture, vertex: Vec3) {
    if vertex == Vec3::ZERO {
        return;
    }
    if polygon.lobe_started == 0 {
        polygon.lobe_first = vertex;
        polygon.lobe_started = 1;
    } else {
        let from = polygon.lobe_previous;
        polygon.sums.x += sg_ltc_edge(from, vertex, mixture.widths.x);
        if mixture.weights.y != 0.0 {
            polygon.sums.y += sg_ltc_edge(from, vertex, mixture.widths.y);
        }
        if mixture.weights.z != 0.0 {
            polygon.sums.z += sg_ltc_edge(from, vertex, mixture.widths.z);
        }
    }
    polygon.lobe_previous = vertex;
}

/// Closes the polygon; `integral` is then valid.
pub fn sg_ltc_polygon_close(polygon: &mut SgLtcPolygon, frame: Mat3, mixture: SgMixture) {
    // No edge where the last `b` was the first `a`, as it should be.
    if polygon.clip.previous != polygon.clip.first {
        sg_ltc_polygon_push(polygon, frame, mixture, polygon.clip.first);
    }
    if polygon.started != 0 {
        sg_ltc_polygon_push_visible(polygon, frame, mixture, polygon.first);
    }
    if polygon.lobe_started != 0 {
        sg_ltc_polygon_push_lobe(polygon, mixture, polygon.lobe_first);
    }
    polygon.integral = INV_TWO_PI * mixture.weights.dot(polygon.sums);
}

/// Integral in sr of a lobe of unit amplitude over the part of a polygon above the horizon, by `lobes` cosine lobes and,
/// below λ = 8, by quadrature; vertices relative to the shading point in the shading frame. CPU only.
#[must_use]
pub fn sg_ltc_polygon_integral(vertices: &[Vec3], axis: Vec3, sharpness: f32, lobes: u32) -> f32 {
    let share = sg_ltc_share(sharpness);
    let mut integral = 0.0;
    if share > 0.0 {
        let (frame, mixture) = (orthonormal_basis(axis), sg_mixture(lobes, sharpness));
        let mut polygon = sg_ltc_polygon_new();
        for (i, &a) in vertices.iter().enumerate() {
            let b = vertices[(i + 1) % vertices.len()];
            sg_ltc_polygon_add_edge(&mut polygon, frame, mixture, a, b);
        }
        sg_ltc_polygon_close(&mut polygon, frame, mixture);
        integral = share * polygon.integral;
    }
    if share < 1.0 {
        let low = sg_polygon_integral(vertices, axis, sharpness, LOW_SHARPNESS_NODES);
        integral += (1.0 - share) * low;
    }
    integral
}
