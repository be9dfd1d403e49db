//! Integral of a clamped cosine, and of a linearly transformed one, over a polygon of any shape.
//!
//! `∫_P D(ω) dω = ∫_{M⁻¹P} max(z, 0)/π dω`, the form factor of the polygon transformed by `M⁻¹` (Heitz, Dupuy, Hill,
//! Neubelt 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines", eq. 4 and 11). The polygon is
//! clipped twice: at the horizon of the surface, so that the part of a lobe below the surface gathers nothing, and,
//! after `M⁻¹`, at the horizon of the cosine space. Edges are integrated as in [`crate::form_factor`].
//!
//! Vertices come edge by edge and no array of them is kept: any number of vertices, convex or concave, any number of
//! crossings of the horizon. They are relative to the shading point, in the shading frame ([`crate::frame`]), in any
//! unit: lengths from 1e-7 to 1e7 are tested, and the result depends on directions alone.
//!
//! **Sign**: counter-clockwise as seen from the shading point is positive. The integrals `.z` are then in `[0, 1]`.
//!
//! **Error** (test `hard_classes`, f64 reference on the same vertices, CPU and GPU): absolute 5e-7 for tiny (1e-5), far
//! (1e4 m), huge (1e4), horizon-crossing, near-plane (1e-6), sliver (1e-6) and concave polygons, without a transform and
//! with those of rough lobes. Besides:
//!
//! - a lobe of width α magnifies the rounding of directions: 5e-7 + 2e-8/α (test `lobes_magnify_rounding`);
//! - the integral jumps where the shading point crosses the polygon's plane inside the polygon, by up to 1. Nearer to
//!   that plane than 1e-6 of the polygon's extent, f32 vertices do not tell the side where the polygon crosses the
//!   horizon too; the result is then the one or the other;
//! - small polygons have a relative error of about 1e-7 over the angle that they subtend;
//! - nothing is ever non-finite (test `degenerate_polygons`). Vertices at the shading point are left out; a polygon
//!   without area gives 0.
//!
//! WGSL module: `akari_math::ltc::polygon`.

use crate::form_factor::{
    FormFactorChain, form_factor_chain_close, form_factor_chain_new, form_factor_chain_push,
};
use crate::polygon::{
    HorizonClip, horizon_clip_new, horizon_clip_push, horizon_middle, is_long_horizon_edge,
};
use crate::special::scale_to_unit_box;
use glam::{Mat3, Vec3};

/// Clamped-cosine integral over a polygon, for Lambert surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LambertPolygon {
    /// Vector form factor of the part above the surface; valid after [`lambert_polygon_close`].
    pub diffuse: Vec3,
    /// Clip at the horizon of the surface.
    pub clip: HorizonClip,
    /// Edges above the surface.
    pub chain: FormFactorChain,
}

/// Clamped-cosine and linearly-transformed-cosine integrals over a polygon.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LtcPolygon {
    /// Vector form factor of the part above the surface; valid after [`ltc_polygon_close`].
    pub diffuse: Vec3,
    /// Vector form factor in the cosine space of the lobe; valid after [`ltc_polygon_close`].
    pub specular: Vec3,
    /// Clip at the horizon of the surface.
    pub clip: HorizonClip,
    /// Edges above the surface.
    pub chain: FormFactorChain,
    /// Clip at the horizon of the cosine space.
    pub lobe_clip: HorizonClip,
    /// Edges in the cosine space.
    pub lobe_chain: FormFactorChain,
}

/// An empty polygon.
#[must_use]
pub fn lambert_polygon_new() -> LambertPolygon {
    LambertPolygon {
        diffuse: Vec3::ZERO,
        clip: horizon_clip_new(),
        chain: form_factor_chain_new(),
    }
}

/// Adds the edge from `a` to `b`, vertices relative to the shading point in the shading frame; `a` is the `b` of the
/// edge before.
pub fn lambert_polygon_add_edge(polygon: &mut LambertPolygon, a: Vec3, b: Vec3) {
    if polygon.clip.started == 0 {
        lambert_polygon_push(polygon, a);
    }
    lambert_polygon_push(polygon, b);
}

/// Adds one vertex; what [`lambert_polygon_add_edge`] is made of.
pub fn lambert_polygon_push(polygon: &mut LambertPolygon, vertex: Vec3) {
    let scaled = scale_to_unit_box(vertex);
    if scaled == Vec3::ZERO {
        return;
    }
    let step = horizon_clip_push(polygon.clip, scaled);
    polygon.clip = step.clip;
    if step.has_crossing != 0 {
        polygon.chain = form_factor_chain_push(polygon.chain, step.crossing);
    }
    if step.has_vertex != 0 {
        polygon.chain = form_factor_chain_push(polygon.chain, scaled);
    }
}

/// Closes the polygon; `diffuse` is then the vector form factor, its `z` the integral.
pub fn lambert_polygon_close(polygon: &mut LambertPolygon) {
    if polygon.clip.previous != polygon.clip.first {
        lambert_polygon_push(polygon, polygon.clip.first);
    }
    polygon.diffuse = form_factor_chain_close(polygon.chain);
}

/// An empty polygon.
#[must_use]
pub fn ltc_polygon_new() -> LtcPolygon {
    LtcPolygon {
        diffuse: Vec3::ZERO,
        specular: Vec3::ZERO,
        clip: horizon_clip_new(),
        chain: form_factor_chain_new(),
        lobe_clip: horizon_clip_new(),
        lobe_chain: form_factor_chain_new(),
    }
}

/// Adds the edge from `a` to `b`, vertices relative to the shading point in the shading frame; `a` is the `b` of the
/// edge before.
pub fn ltc_polygon_add_edge(polygon: &mut LtcPolygon, m_inv: Mat3, a: Vec3, b: Vec3) {
    if polygon.clip.started == 0 {
        ltc_polygon_push(polygon, m_inv, a);
    }
    ltc_polygon_push(polygon, m_inv, b);
}

/// First clip, at the horizon of the surface; what [`ltc_polygon_add_edge`] is made of.
pub fn ltc_polygon_push(polygon: &mut LtcPolygon, m_inv: Mat3, vertex: Vec3) {
    let scaled = scale_to_unit_box(vertex);
    if scaled == Vec3::ZERO {
        return;
    }
    let step = horizon_clip_push(polygon.clip, scaled);
    polygon.clip = step.clip;
    for (visible, has) in [
        (step.crossing, step.has_crossing),
        (scaled, step.has_vertex),
    ] {
        if has != 0 {
            ltc_polygon_push_visible(polygon, m_inv, visible);
        }
    }
}

/// A vertex of the part above the surface.
///
/// The plane of a long edge along the horizon is known exactly before `M⁻¹`, but not from its ends once they are
/// transformed and rounded, where they are nearly opposite (a light that is large against its distance): a third point
/// keeps it.
pub fn ltc_polygon_push_visible(polygon: &mut LtcPolygon, m_inv: Mat3, vertex: Vec3) {
    let previous = polygon.chain.previous;
    polygon.chain = form_factor_chain_push(polygon.chain, vertex);
    let latest = polygon.chain.previous;
    if is_long_horizon_edge(previous, latest) {
        ltc_polygon_push_lobe(polygon, m_inv * horizon_middle(previous, latest));
    }
    ltc_polygon_push_lobe(polygon, m_inv * vertex);
}

/// Second clip, at the horizon of the cosine space of the lobe.
pub fn ltc_polygon_push_lobe(polygon: &mut LtcPolygon, vertex: Vec3) {
    let scaled = scale_to_unit_box(vertex);
    if scaled == Vec3::ZERO {
        return;
    }
    let step = horizon_clip_push(polygon.lobe_clip, scaled);
    polygon.lobe_clip = step.clip;
    for (visible, has) in [
        (step.crossing, step.has_crossing),
        (scaled, step.has_vertex),
    ] {
        if has != 0 {
            polygon.lobe_chain = form_factor_chain_push(polygon.lobe_chain, visible);
        }
    }
}

/// Closes the polygon; `diffuse` and `specular` are then the vector form factors, their `z` the integrals.
pub fn ltc_polygon_close(polygon: &mut LtcPolygon, m_inv: Mat3) {
    if polygon.clip.previous != polygon.clip.first {
        ltc_polygon_push(polygon, m_inv, polygon.clip.first);
    }
    let (first, latest) = (polygon.chain.first, polygon.chain.previous);
    if is_long_horizon_edge(latest, first) {
        ltc_polygon_push_lobe(polygon, m_inv * horizon_middle(latest, first));
    }
    ltc_polygon_push_lobe(polygon, polygon.lobe_clip.first);
    polygon.diffuse = form_factor_chain_close(polygon.chain);
    polygon.specular = form_factor_chain_close(polygon.lobe_chain);
}

/// Vector form factor of the part of a polygon above the horizon; `.z` is the clamped-cosine integral over π.
///
/// Vertices relative to the shading point in the shading frame; CPU only.
#[must_use]
pub fn form_factor(vertices: &[Vec3]) -> Vec3 {
    let mut polygon = lambert_polygon_new();
    for (i, &a) in vertices.iter().enumerate() {
        lambert_polygon_add_edge(&mut polygon, a, vertices[(i + 1) % vertices.len()]);
    }
    lambert_polygon_close(&mut polygon);
    polygon.diffuse
}

/// Vector form factor, in cosine space, of the part of a polygon above the horizon; `.z` is the integral of the lobe
/// over the polygon. CPU only.
#[must_use]
pub fn ltc_form_factor(vertices: &[Vec3], m_inv: Mat3) -> Vec3 {
    let mut polygon = ltc_polygon_new();
    for (i, &a) in vertices.iter().enumerate() {
        ltc_polygon_add_edge(&mut polygon, m_inv, a, vertices[(i + 1) % vertices.len()]);
    }
    ltc_polygon_close(&mut polygon, m_inv);
    polygon.specular
}
