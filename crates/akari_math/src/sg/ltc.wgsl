#define_import_path akari_math::sg::ltc

// Twin: `sg/ltc.rs`, where the formulas, domains, error bounds and sources are. Change both or neither.

#import akari_math::special::{TINY, atan2_poly, scale_to_unit_box}
#import akari_math::polygon::{HorizonClip, horizon_clip_new, horizon_clip_push, horizon_middle, is_long_horizon_edge}
#import akari_math::sg::lobe::sg_integral

const INV_TWO_PI: f32 = 0.15915494;
// Scale of the sharpness in the parameters of the mixtures.
const MIXTURE_SHARPNESS: f32 = 8.0;
// Sharpness below which no mixture is used.
const MIN_MIXTURE_SHARPNESS: f32 = 4.0;

// Cosine lobes that resemble a spherical Gaussian.
struct SgMixture {
    // Scales of the lobes.
    widths: vec3<f32>,
    // Weights, which add up to the integral over the sphere; 0 for lobes that there are not.
    weights: vec3<f32>,
}

// A polygon under one mixture.
struct SgLtcPolygon {
    // The integral in sr; valid after `sg_ltc_polygon_close`.
    integral: f32,
    clip: HorizonClip,
    // 1 once a vertex above the surface has come; the first of them and the latest, any scale.
    started: u32,
    first: vec3<f32>,
    previous: vec3<f32>,
    // The same above both horizons, in the frame of the lobe.
    lobe_clip: HorizonClip,
    lobe_started: u32,
    lobe_first: vec3<f32>,
    lobe_previous: vec3<f32>,
    // Sums of the edges of each cosine lobe so far, not yet divided by 2 pi.
    sums: vec3<f32>,
}

// Share of a mixture in the blend with quadrature.
fn sg_ltc_share(sharpness: f32) -> f32 {
    return min(max(sharpness / MIN_MIXTURE_SHARPNESS - 1.0, 0.0), 1.0);
}

// Mixture of `lobes` cosine lobes, 1 to 3.
fn sg_mixture(lobes: u32, sharpness: f32) -> SgMixture {
    let v = 1.0 / (1.0 + sharpness / MIXTURE_SHARPNESS);
    var widths = vec3<f32>(1.0);
    var shares = vec3<f32>(1.0, 0.0, 0.0);
    if lobes == 1u {
        widths.x = 0.934814 + v * (0.032946 + v * (-0.066220 + v * 0.166412));
    } else if lobes == 2u {
        widths.x = 1.507712 + v * (-0.403643 + v * (1.163637 + v * -1.942005));
        widths.y = 1.705068 + v * (-0.376943 + v * (1.480118 + v * -2.815187));
        let first = 7.499702 + v * (-7.756207 + v * (10.932674 + v * -11.357130));
        shares = vec3<f32>(first, 1.0 - first, 0.0);
    } else {
        widths.x = 0.972633 + v * (-0.342907 + v * (1.193243 + v * -1.072928));
        widths.y = 1.186111 + v * (-0.291294 + v * (1.652900 + v * -2.240503));
        widths.z = 1.480270 + v * (-0.203883 + v * (2.508114 + v * -4.256625));
        let first = -2.860038 + v * (5.025888 + v * (0.726890 + v * -7.710157));
        let second = 8.762429 + v * (-13.086335 + v * (6.418712 + v * 6.197571));
        shares = vec3<f32>(first, second, 1.0 - first - second);
    }
    return SgMixture(widths * sqrt(2.0 / max(sharpness, MIN_MIXTURE_SHARPNESS)), shares * sg_integral(sharpness));
}

// z of the form factor, times 2 pi, of the edge from `a` to `b` (any scale) scaled by (1, 1, width).
fn sg_ltc_edge(a: vec3<f32>, b: vec3<f32>, width: f32) -> f32 {
    let normal = cross(b - a, a);
    let squared = width * width * (normal.x * normal.x + normal.y * normal.y) + normal.z * normal.z;
    let sine = sqrt(max(squared, TINY));
    let cosine = a.x * b.x + a.y * b.y + width * width * a.z * b.z;
    return normal.z * (atan2_poly(sine, cosine) / sine);
}

fn sg_ltc_polygon_new() -> SgLtcPolygon {
    return SgLtcPolygon(
        0.0,
        horizon_clip_new(),
        0u,
        vec3<f32>(0.0),
        vec3<f32>(0.0),
        horizon_clip_new(),
        0u,
        vec3<f32>(0.0),
        vec3<f32>(0.0),
        vec3<f32>(0.0),
    );
}

// Adds the edge from `a` to `b`, vertices relative to the shading point in the shading frame; `a` is the `b` of the
// edge before. `frame` has the axis of the lobe as its third column.
fn sg_ltc_polygon_add_edge(polygon: ptr<function, SgLtcPolygon>, frame: mat3x3<f32>, mixture: SgMixture, a: vec3<f32>, b: vec3<f32>) {
    if (*polygon).clip.started == 0u {
        sg_ltc_polygon_push(polygon, frame, mixture, a);
    }
    sg_ltc_polygon_push(polygon, frame, mixture, b);
}

fn sg_ltc_polygon_push(polygon: ptr<function, SgLtcPolygon>, frame: mat3x3<f32>, mixture: SgMixture, vertex: vec3<f32>) {
    let scaled = scale_to_unit_box(vertex);
    // A vertex at the shading point has no direction: leave it out.
    if all(scaled == vec3<f32>(0.0)) {
        return;
    }
    let step = horizon_clip_push((*polygon).clip, scaled);
    (*polygon).clip = step.clip;
    if step.has_crossing != 0u {
        sg_ltc_polygon_push_visible(polygon, frame, mixture, step.crossing);
    }
    if step.has_vertex != 0u {
        sg_ltc_polygon_push_visible(polygon, frame, mixture, scaled);
    }
}

// Adds a vertex of the part above the surface, with a third point on long edges along the horizon, whose plane the turn
// to the frame of the lobe would lose.
fn sg_ltc_polygon_push_visible(polygon: ptr<function, SgLtcPolygon>, frame: mat3x3<f32>, mixture: SgMixture, vertex: vec3<f32>) {
    if (*polygon).started == 0u {
        (*polygon).first = vertex;
        (*polygon).started = 1u;
    } else if is_long_horizon_edge((*polygon).previous, vertex) {
        let middle = horizon_middle((*polygon).previous, vertex);
        sg_ltc_polygon_push_turned(polygon, mixture, transpose(frame) * middle);
    }
    (*polygon).previous = vertex;
    sg_ltc_polygon_push_turned(polygon, mixture, transpose(frame) * vertex);
}

// Clip at the horizon of the lobe, of a vertex in its frame.
fn sg_ltc_polygon_push_turned(polygon: ptr<function, SgLtcPolygon>, mixture: SgMixture, vertex: vec3<f32>) {
    let scaled = scale_to_unit_box(vertex);
    if all(scaled == vec3<f32>(0.0)) {
        return;
    }
    let step = horizon_clip_push((*polygon).lobe_clip, scaled);
    (*polygon).lobe_clip = step.clip;
    if step.has_crossing != 0u {
        sg_ltc_polygon_push_lobe(polygon, mixture, scale_to_unit_box(step.crossing));
    }
    if step.has_vertex != 0u {
        sg_ltc_polygon_push_lobe(polygon, mixture, scaled);
    }
}

// Adds a vertex of the part above both horizons.
fn sg_ltc_polygon_push_lobe(polygon: ptr<function, SgLtcPolygon>, mixture: SgMixture, vertex: vec3<f32>) {
    if all(vertex == vec3<f32>(0.0)) {
        return;
    }
    if (*polygon).lobe_started == 0u {
        (*polygon).lobe_first = vertex;
        (*polygon).lobe_started = 1u;
    } else {
        let start = (*polygon).lobe_previous;
        (*polygon).sums.x += sg_ltc_edge(start, vertex, mixture.widths.x);
        if mixture.weights.y != 0.0 {
            (*polygon).sums.y += sg_ltc_edge(start, vertex, mixture.widths.y);
        }
        if mixture.weights.z != 0.0 {
            (*polygon).sums.z += sg_ltc_edge(start, vertex, mixture.widths.z);
        }
    }
    (*polygon).lobe_previous = vertex;
}

// Closes the polygon; `integral` is then valid.
fn sg_ltc_polygon_close(polygon: ptr<function, SgLtcPolygon>, frame: mat3x3<f32>, mixture: SgMixture) {
    // No edge where the last `b` was the first `a`, as it should be.
    if any((*polygon).clip.previous != (*polygon).clip.first) {
        sg_ltc_polygon_push(polygon, frame, mixture, (*polygon).clip.first);
    }
    if (*polygon).started != 0u {
        sg_ltc_polygon_push_visible(polygon, frame, mixture, (*polygon).first);
    }
    if (*polygon).lobe_started != 0u {
        sg_ltc_polygon_push_lobe(polygon, mixture, (*polygon).lobe_first);
    }
    (*polygon).integral = INV_TWO_PI * dot(mixture.weights, (*polygon).sums);
}
