#define_import_path akari_math::ltc::polygon

// Twin: `ltc/polygon.rs`, where the method, the sign convention and the error bounds are. Change both or neither.

#import akari_math::special::scale_to_unit_box
#import akari_math::form_factor::{FormFactorChain, form_factor_chain_new, form_factor_chain_push, form_factor_chain_close}
#import akari_math::polygon::{HorizonClip, horizon_clip_new, horizon_clip_push, horizon_middle, is_long_horizon_edge}

// Clamped-cosine integral over a polygon, for Lambert surfaces.
struct LambertPolygon {
    // Vector form factor; valid after `lambert_polygon_close`.
    diffuse: vec3<f32>,
    clip: HorizonClip,
    chain: FormFactorChain,
}

// Clamped-cosine and linearly-transformed-cosine integrals over a polygon.
struct LtcPolygon {
    // Vector form factor of the part above the surface; valid after `ltc_polygon_close`.
    diffuse: vec3<f32>,
    // Vector form factor in the cosine space of the lobe; valid after `ltc_polygon_close`.
    specular: vec3<f32>,
    clip: HorizonClip,
    chain: FormFactorChain,
    lobe_clip: HorizonClip,
    lobe_chain: FormFactorChain,
}

fn lambert_polygon_new() -> LambertPolygon {
    return LambertPolygon(vec3<f32>(0.0), horizon_clip_new(), form_factor_chain_new());
}

// Adds the edge from `a` to `b`, vertices relative to the shading point in the shading frame; `a` is the `b` of the
// edge before.
fn lambert_polygon_add_edge(polygon: ptr<function, LambertPolygon>, a: vec3<f32>, b: vec3<f32>) {
    if (*polygon).clip.started == 0u {
        lambert_polygon_push(polygon, a);
    }
    lambert_polygon_push(polygon, b);
}

fn lambert_polygon_push(polygon: ptr<function, LambertPolygon>, vertex: vec3<f32>) {
    let scaled = scale_to_unit_box(vertex);
    // A vertex at the shading point has no direction: leave it out.
    if all(scaled == vec3<f32>(0.0)) {
        return;
    }
    let step = horizon_clip_push((*polygon).clip, scaled);
    (*polygon).clip = step.clip;
    if step.has_crossing != 0u {
        (*polygon).chain = form_factor_chain_push((*polygon).chain, step.crossing);
    }
    if step.has_vertex != 0u {
        (*polygon).chain = form_factor_chain_push((*polygon).chain, scaled);
    }
}

// Closes the polygon; `diffuse` is then the vector form factor, its `z` the integral.
fn lambert_polygon_close(polygon: ptr<function, LambertPolygon>) {
    // No edge where the last `b` was the first `a`, as it should be.
    if any((*polygon).clip.previous != (*polygon).clip.first) {
        lambert_polygon_push(polygon, (*polygon).clip.first);
    }
    (*polygon).diffuse = form_factor_chain_close((*polygon).chain);
}

fn ltc_polygon_new() -> LtcPolygon {
    return LtcPolygon(
        vec3<f32>(0.0),
        vec3<f32>(0.0),
        horizon_clip_new(),
        form_factor_chain_new(),
        horizon_clip_new(),
        form_factor_chain_new(),
    );
}

// Adds the edge from `a` to `b`, vertices relative to the shading point in the shading frame; `a` is the `b` of the
// edge before.
fn ltc_polygon_add_edge(polygon: ptr<function, LtcPolygon>, m_inv: mat3x3<f32>, a: vec3<f32>, b: vec3<f32>) {
    if (*polygon).clip.started == 0u {
        ltc_polygon_push(polygon, m_inv, a);
    }
    ltc_polygon_push(polygon, m_inv, b);
}

// First clip, at the horizon of the surface.
fn ltc_polygon_push(polygon: ptr<function, LtcPolygon>, m_inv: mat3x3<f32>, vertex: vec3<f32>) {
    let scaled = scale_to_unit_box(vertex);
    if all(scaled == vec3<f32>(0.0)) {
        return;
    }
    let step = horizon_clip_push((*polygon).clip, scaled);
    (*polygon).clip = step.clip;
    // A loop rather than two calls, so that what follows is compiled once.
    for (var k = 0u; k < 2u; k++) {
        let is_crossing = k == 0u;
        if select(step.has_vertex, step.has_crossing, is_crossing) != 0u {
            ltc_polygon_push_visible(polygon, m_inv, select(scaled, step.crossing, is_crossing));
        }
    }
}

// A vertex of the part above the surface.
fn ltc_polygon_push_visible(polygon: ptr<function, LtcPolygon>, m_inv: mat3x3<f32>, vertex: vec3<f32>) {
    let previous = (*polygon).chain.previous;
    (*polygon).chain = form_factor_chain_push((*polygon).chain, vertex);
    let latest = (*polygon).chain.previous;
    // The plane of a long edge along the horizon is known exactly here, but not from its ends once they are
    // transformed and rounded: a third point keeps it.
    for (var k = select(1u, 0u, is_long_horizon_edge(previous, latest)); k < 2u; k++) {
        var point = vertex;
        if k == 0u {
            point = horizon_middle(previous, latest);
        }
        ltc_polygon_push_lobe(polygon, m_inv * point);
    }
}

// Second clip, at the horizon of the cosine space of the lobe.
fn ltc_polygon_push_lobe(polygon: ptr<function, LtcPolygon>, vertex: vec3<f32>) {
    let scaled = scale_to_unit_box(vertex);
    if all(scaled == vec3<f32>(0.0)) {
        return;
    }
    let step = horizon_clip_push((*polygon).lobe_clip, scaled);
    (*polygon).lobe_clip = step.clip;
    for (var k = 0u; k < 2u; k++) {
        let is_crossing = k == 0u;
        if select(step.has_vertex, step.has_crossing, is_crossing) != 0u {
            let visible = select(scaled, step.crossing, is_crossing);
            (*polygon).lobe_chain = form_factor_chain_push((*polygon).lobe_chain, visible);
        }
    }
}

// Closes the polygon; `diffuse` and `specular` are then the vector form factors, their `z` the integrals.
fn ltc_polygon_close(polygon: ptr<function, LtcPolygon>, m_inv: mat3x3<f32>) {
    if any((*polygon).clip.previous != (*polygon).clip.first) {
        ltc_polygon_push(polygon, m_inv, (*polygon).clip.first);
    }
    let first = (*polygon).chain.first;
    let latest = (*polygon).chain.previous;
    for (var k = select(1u, 0u, is_long_horizon_edge(latest, first)); k < 2u; k++) {
        var point = (*polygon).lobe_clip.first;
        if k == 0u {
            point = m_inv * horizon_middle(latest, first);
        }
        ltc_polygon_push_lobe(polygon, point);
    }
    (*polygon).diffuse = form_factor_chain_close((*polygon).chain);
    (*polygon).specular = form_factor_chain_close((*polygon).lobe_chain);
}
