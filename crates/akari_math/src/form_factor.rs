//! Vector form factor of a polygon, edge by edge.
//!
//! `F = (1/2π) Σ θ n` over the edges, `θ` the angle that the edge subtends and `n` the unit normal of the plane through
//! the edge and the shading point (Lambert 1760; Baum, Rushmeier, Winget 1989, "Improving radiosity solutions through
//! the use of analytically determined form-factors"). `F·n_surface` is the clamped-cosine integral over π of a polygon
//! above the horizon of the surface.
//!
//! **Sign**: a polygon whose vertices run counter-clockwise as seen from the shading point has an `F` that points
//! towards it, and so a positive integral.
//!
//! WGSL module: `akari_math::form_factor`.

use crate::special::{atan2_poly, safe_normalize};
use glam::Vec3;

const INV_TWO_PI: f32 = 0.159_154_94;
/// Below this sine, angle / sine is 1 + sine²/6 to 2e-17.
const SMALL_SINE: f32 = 1e-4;
/// Floor of the sine of an edge that passes through the shading point.
const MIN_SINE: f32 = 1e-12;

/// Vertices of a polygon as seen from the shading point, summed edge by edge as they come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FormFactorChain {
    /// Sum of the edges so far, not yet divided by 2π.
    pub sum: Vec3,
    /// 1 once a vertex has come.
    pub started: u32,
    /// Unit direction of the first vertex.
    pub first: Vec3,
    /// Unit direction of the latest vertex.
    pub previous: Vec3,
}

/// Angle of the arc from unit vector `a` to unit vector `b` (radians), times the unit normal of its plane, `b × a`
/// normalised.
///
/// `c = (b − a) × a`, `θ n = c · atan2(|c|, a·b) / |c|`. The difference is exact for near vertices, where `b × a`
/// cancels; `acos(a·b)` would lose all digits there and near the horizon. Absolute error below 4e-7 (test `twins`), no
/// case is non-finite. Antipodal vertices, an edge through the shading point, have no plane: what comes out then is
/// of length at most π, and 0 where `c` is exactly 0.
#[must_use]
pub fn edge_form_factor(a: Vec3, b: Vec3) -> Vec3 {
    let normal = (b - a).cross(a);
    let sine = normal.dot(normal).sqrt();
    let cosine = a.dot(b);
    if sine < SMALL_SINE && cosine > 0.0 {
        return normal * (1.0 + sine * sine / 6.0);
    }
    normal * (atan2_poly(sine, cosine) / sine.max(MIN_SINE))
}

/// A chain without vertices; closing it gives 0.
#[must_use]
pub fn form_factor_chain_new() -> FormFactorChain {
    FormFactorChain::default()
}

/// Adds the edge from the latest vertex to `vertex` (relative to the shading point, any scale).
///
/// A vertex at the shading point has no direction and is left out: the edge then goes on from the vertex before.
#[must_use]
pub fn form_factor_chain_push(chain: FormFactorChain, vertex: Vec3) -> FormFactorChain {
    let direction = safe_normalize(vertex, Vec3::ZERO);
    if direction.dot(direction) < 0.5 {
        return chain;
    }
    let mut next = chain;
    if chain.started == 0 {
        next.first = direction;
        next.started = 1;
    } else {
        next.sum = chain.sum + edge_form_factor(chain.previous, direction);
    }
    next.previous = direction;
    next
}

/// The vector form factor: adds the edge from the latest vertex to the first, and divides by 2π.
#[must_use]
pub fn form_factor_chain_close(chain: FormFactorChain) -> Vec3 {
    (chain.sum + edge_form_factor(chain.previous, chain.first)) * INV_TWO_PI
}
