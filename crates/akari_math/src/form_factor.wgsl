#define_import_path akari_math::form_factor

// Twin: `form_factor.rs`. Change both or neither.

#import akari_math::special::{TINY, atan2_poly, safe_normalize}

const INV_TWO_PI: f32 = 0.15915494;
// Below this sine, angle / sine is 1 + sine^2 / 6 to 2e-17.
const SMALL_SINE: f32 = 1e-4;
// Floor of the sine of an edge that passes through the shading point.
const MIN_SINE: f32 = 1e-12;

// Vertices of a polygon as seen from the shading point, summed edge by edge as they come.
struct FormFactorChain {
    // Sum of the edges so far, not yet divided by 2 pi.
    sum: vec3<f32>,
    // 1 once a vertex has come.
    started: u32,
    // Unit direction of the first vertex.
    first: vec3<f32>,
    // Unit direction of the latest vertex.
    previous: vec3<f32>,
}

// Angle of the arc from unit vector `a` to unit vector `b`, times the unit normal of its plane, pointing to the side
// from which the arc turns clockwise.
fn edge_form_factor(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    let normal = cross(b - a, a);
    let sine = sqrt(dot(normal, normal));
    let cosine = dot(a, b);
    if sine < SMALL_SINE && cosine > 0.0 {
        return normal * (1.0 + sine * sine / 6.0);
    }
    return normal * (atan2_poly(sine, cosine) / max(sine, MIN_SINE));
}

fn form_factor_chain_new() -> FormFactorChain {
    return FormFactorChain(vec3<f32>(0.0), 0u, vec3<f32>(0.0), vec3<f32>(0.0));
}

// Adds the edge from the latest vertex to `vertex`. A vertex at the shading point has no direction and is left out.
fn form_factor_chain_push(chain: FormFactorChain, vertex: vec3<f32>) -> FormFactorChain {
    let direction = safe_normalize(vertex, vec3<f32>(0.0));
    if dot(direction, direction) < 0.5 {
        return chain;
    }
    var next = chain;
    if chain.started == 0u {
        next.first = direction;
        next.started = 1u;
    } else {
        next.sum = chain.sum + edge_form_factor(chain.previous, direction);
    }
    next.previous = direction;
    return next;
}

// The vector form factor: adds the edge from the latest vertex to the first, and divides by 2 pi.
fn form_factor_chain_close(chain: FormFactorChain) -> vec3<f32> {
    return (chain.sum + edge_form_factor(chain.previous, chain.first)) * INV_TWO_PI;
}
