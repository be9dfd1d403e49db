//! Integral of a spherical Gaussian over a polygon, by quadrature over the edges with rules of our own.
//!
//! **Form.** Let `u = 1 − ω·ξ` and `E(x) = (1 − e⁻ˣ)/x`. Stokes' theorem with the potential that vanishes at the axis
//! turns the integral into one over the boundary. We take the part of it that is singular opposite to the axis out as the
//! solid angle Ω, which has a closed form:
//!
//! `∫_P e^{−λu} dω = E(2λ) Ω + Σ_edges n·ξ ∫₀ᵀ g(u(t)) dt`,  `g(u) = [E(λu) − E(2λ)]/(2 − u)`,
//!
//! `n` the unit normal of the plane of the edge, `t` the arc along it. `g` is smooth and bounded on the whole sphere: no
//! case for an axis inside the polygon, on an edge or a vertex of it, or opposite to it, and at λ = 0, where `g` is 0, the
//! result is exactly the solid angle.
//!
//! **Substitution.** On the great circle of an edge `u = 1 − R cos τ`, τ from its closest approach to the axis, and g
//! falls off like `1/(n·ξ² + τ²)` over a width that depends on n·ξ and λ. `tan τ = k tan s` makes the integrand nearly
//! constant in s. This map of the circle is projective: a direction `(X, Y)` in s is the direction `(X, kY)` in τ. With the
//! half-angle parameter `p = tan((s − s_mid)/2)` nodes are rational in the ends of the edge; there is no angle, no
//! tangent and no arc tangent in an edge, and one exponential a node.
//!
//! **Rules.** `k² = α n·ξ² + δ |n·ξ| √(c/λ) + c/λ`; nodes `±ξ P (1 + a P²)` and weights `w P (1 + b P²)` for the reach
//! `P` of an edge in p. All of these are quadratic in `v = 1/(1 + λ/60)` and fitted over random triangles and λ
//! (`akari_ltc_fit::sg`, which prints the tables below: `cargo test -p akari_ltc_fit --release --test sg_rules -- --ignored
//! --nocapture`). Gauss-Legendre nodes of the same number are up to thirty times worse.
//!
//! **Error** over the lobe's integral, largest and mean of 400 triangles each of 0.01 to 1 rad for λ of 10, 1e3 and 1e7
//! (test `sg_polygons`, which holds these figures for more λ; CPU and GPU):
//!
//! | nodes | λ = 10 | λ = 1e3 | λ = 1e7 |
//! |---|---|---|---|
//! | 1 | 1.2e-02, 3.3e-04 | 2.4e-02, 1.3e-03 | 4.5e-02, 1.1e-03 |
//! | 2 | 1.4e-03, 3.8e-05 | 1.2e-02, 5.0e-04 | 4.7e-03, 1.2e-04 |
//! | 3 | 1.6e-04, 6.6e-06 | 3.2e-03, 1.0e-04 | 4.0e-03, 8.6e-05 |
//! | 4 | 4.8e-05, 1.3e-06 | 8.7e-04, 3.9e-05 | 1.8e-03, 4.1e-05 |
//! | 6 | 3.7e-06, 8.3e-08 | 1.6e-04, 5.8e-06 | 2.7e-04, 8.4e-06 |
//! | 8 | 1.2e-06, 3.9e-08 | 9.7e-05, 3.0e-06 | 8.7e-05, 2.5e-06 |
//!
//! Error against time beside other ways is in `docs/sg_polygon.md`. Polygons as large as a hemisphere, seen from near their
//! plane, have up to four times the largest error (test `hard_cases`). Where no part of a polygon's boundary is near the
//! lobe, λu above 12, the integral is all of the lobe's or exactly 0 ([`sg_polygon_settle`]).
//!
//! Vertices come one by one and no array of them is kept, as in [`crate::ltc::polygon`]: relative to the shading point,
//! in the shading frame, in any unit; the part below `z = 0` is clipped. **Sign**: counter-clockwise as seen from the
//! shading point is positive. Sharpness from 0 to 1e12. Nothing is ever non-finite.
//!
//! WGSL module: `akari_math::sg::polygon`.

use crate::polygon::{
    HorizonClip, horizon_clip_new, horizon_clip_push, horizon_middle, is_long_horizon_edge,
};
use crate::special::{
    TINY, atan2_poly, one_minus_exp_neg_over_x, safe_normalize, scale_to_unit_box,
};
use glam::{Vec2, Vec3, Vec4};

/// Numbers of nodes for which there are rules.
pub const RULE_NODES: [u32; 6] = [1, 2, 3, 4, 6, 8];

/// Scale of λ in the parameters of the rules: `v = 1/(1 + λ/60)`.
pub const RULE_SHARPNESS: f32 = 60.0;
/// Floor of the sine of an edge whose ends are the same or opposite.
const MIN_SINE: f32 = 1e-12;
/// Below this size the angle of a complex number that is made of unit vectors is lost.
const MIN_FACTOR: f32 = 1e-12;
/// Below this size it has lost five digits.
const SMALL_FACTOR: f32 = 1e-2;
/// `λu` on the whole boundary from which an integral begins to snap to all or nothing: e⁻⁸ is 3e-4.
const SETTLING: f32 = 8.0;
/// `λu` from which it has.
const SETTLED: f32 = 12.0;
/// The largest `u` that there is.
const FARTHEST: f32 = 2.0;
const FOUR_PI: f32 = 12.566_371;
/// Floor of c in `k²`, which the fits stay above.
const MIN_WIDTH: f32 = 0.5;
/// Floor of `k²` over `c/λ`: an interpolated rule might make it negative.
const MIN_BREADTH: f32 = 0.2;

/// A quadrature rule for the edges of polygons under one lobe.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SgRule {
    /// Sharpness λ of the lobe.
    pub sharpness: f32,
    /// `E(2λ)`, the lobe's integral over the sphere over 4π.
    pub mean: f32,
    /// `k² = x n² + y |n| + z`, `n` the cosine between axis and normal of the edge's plane.
    pub breadth: Vec3,
    /// Weight of the middle node and its slope in P²; weight 0 where there is none.
    pub center: Vec2,
    /// How many of the pairs below there are.
    pub pairs: u32,
    /// Two nodes: place, its slope in P², weight, its slope.
    pub outer: Vec4,
    /// Two more.
    pub second: Vec4,
    /// Two more.
    pub third: Vec4,
    /// Two more.
    pub inner: Vec4,
}

/// An edge in the coordinates of a rule.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SgArc {
    /// Unit direction of the middle of the arc in s, from the closest approach.
    pub middle: Vec2,
    /// `P`, the tangent of a quarter of the arc in s; 0 to 1.
    pub reach: f32,
    /// `k`.
    pub breadth: f32,
    /// Cosine between axis and normal of the edge's plane.
    pub n_dot_axis: f32,
    /// Cosine of the smallest angle between axis and great circle.
    pub radius: f32,
    /// 1 − `radius`, with all of its digits.
    pub gap: f32,
    /// `u` at the point of the edge nearest to the axis.
    pub nearest: f32,
}

/// A polygon under one lobe.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SgPolygon {
    /// The integral in sr; valid after [`sg_polygon_close`].
    pub integral: f32,
    /// Solid angle of the part above the surface in sr; valid after [`sg_polygon_close`].
    pub solid_angle: f32,
    /// Clip at the horizon of the surface.
    pub clip: HorizonClip,
    /// 1 once a vertex above the surface has come.
    pub started: u32,
    /// Unit direction of the first vertex above the surface.
    pub first: Vec3,
    /// Unit direction of the latest.
    pub previous: Vec3,
    /// Sum of the edges so far.
    pub edges: f32,
    /// Smallest `u` on the edges so far.
    pub nearest: f32,
    /// Complex number, up to scale, whose angle is half the solid angle so far.
    pub area: Vec2,
}

/// The rule of `nodes` nodes an edge, one of [`RULE_NODES`] (any other number is taken for 8), for sharpness λ from 0
/// to 1e12.
#[must_use]
pub fn sg_rule(nodes: u32, sharpness: f32) -> SgRule {
    let v = 1.0 / (1.0 + sharpness / RULE_SHARPNESS);
    let breadth;
    let mut center = Vec2::ZERO;
    let mut outer = Vec4::ZERO;
    let mut second = Vec4::ZERO;
    let mut third = Vec4::ZERO;
    let mut inner = Vec4::ZERO;
    if nodes == 1 {
        breadth = Vec3::new(0.710668, -0.722921, 2.338819)
            + v * (Vec3::new(5.050345, -3.026901, 16.766113)
                + v * Vec3::new(-5.462473, 3.711720, -18.000676));
        center = Vec2::new(2.000000, -0.008071)
            + v * (Vec2::new(0.000000, -1.700125) + v * Vec2::new(0.000000, 1.438535));
    } else if nodes == 2 {
        breadth = Vec3::new(1.110988, -0.768929, 5.816058)
            + v * (Vec3::new(5.366094, -4.445527, 19.052890)
                + v * Vec3::new(-6.828948, 5.830043, -23.952188));
        outer = Vec4::new(0.539175, -0.175726, 1.000000, -0.055146)
            + v * (Vec4::new(-0.024426, -0.392449, 0.000000, -0.247479)
                + v * Vec4::new(0.028082, 0.441639, 0.000000, 0.268627));
    } else if nodes == 3 {
        breadth = Vec3::new(1.508694, -0.773916, 8.360067)
            + v * (Vec3::new(2.951459, -3.969415, 23.903576)
                + v * Vec3::new(-5.119028, 5.692203, -31.852994));
        center = Vec2::new(0.869843, -0.258215)
            + v * (Vec2::new(-0.113627, -0.519233) + v * Vec2::new(0.013091, 0.663340));
        outer = Vec4::new(0.758130, -0.089316, 0.565078, 0.178486)
            + v * (Vec4::new(-0.039876, -0.350391, 0.056813, 0.219003)
                + v * Vec4::new(0.012049, 0.380937, -0.006545, -0.332946));
    } else if nodes == 4 {
        breadth = Vec3::new(0.708777, -0.696795, 4.087754)
            + v * (Vec3::new(3.201516, -1.865980, 10.802461)
                + v * Vec3::new(-3.957808, 3.239964, -13.461724));
        outer = Vec4::new(0.899389, -0.038218, 0.285978, 0.304982)
            + v * (Vec4::new(-0.323774, -0.231179, 0.504431, -0.548641)
                + v * Vec4::new(0.259079, 0.210857, -0.391283, 0.476379));
        second = Vec4::new(0.359685, 0.014592, 0.714022, -0.122211)
            + v * (Vec4::new(-0.249880, -0.052964, -0.504431, -0.023820)
                + v * Vec4::new(0.193920, -0.170095, 0.391283, -0.007352));
    } else if nodes == 6 {
        breadth = Vec3::new(2.150473, -1.127942, 15.332735)
            + v * (Vec3::new(6.276706, -8.514159, 4.703307)
                + v * Vec3::new(-10.278665, 12.219835, -19.906743));
        outer = Vec4::new(0.913282, -0.002846, 0.193087, 0.266561)
            + v * (Vec4::new(0.029466, -0.248267, -0.023667, 1.660493)
                + v * Vec4::new(-0.005848, 0.263674, 0.012345, -1.974965));
        second = Vec4::new(0.643464, -0.192368, 0.357850, 0.204546)
            + v * (Vec4::new(0.012811, -0.184317, 0.000929, -0.757854)
                + v * Vec4::new(-0.039406, 0.383919, 0.057825, 0.559873));
        third = Vec4::new(0.225964, -0.288406, 0.449063, -0.284904)
            + v * (Vec4::new(0.021534, -0.063760, 0.022738, -0.056632)
                + v * Vec4::new(-0.051824, 0.381755, -0.070169, 0.356624));
    } else {
        breadth = Vec3::new(0.202063, 0.822664, 2.870652)
            + v * (Vec3::new(-0.273018, 3.058374, -9.885823)
                + v * Vec3::new(2.186348, -5.674934, 12.045762));
        outer = Vec4::new(0.961569, 0.000031, 0.099914, 0.001306)
            + v * (Vec4::new(0.003757, -0.002215, 0.000363, -0.000598)
                + v * Vec4::new(-0.005390, 0.011003, 0.001027, -0.001294));
        second = Vec4::new(0.794276, 0.000792, 0.224628, 0.012710)
            + v * (Vec4::new(0.001356, -0.000639, -0.003555, -0.004539)
                + v * Vec4::new(0.001331, -0.009096, 0.001237, -0.007847));
        third = Vec4::new(0.537993, -0.013734, 0.292714, -0.007952)
            + v * (Vec4::new(-0.005981, 0.013338, 0.012126, 0.003676)
                + v * Vec4::new(-0.007440, 0.007911, 0.010534, 0.003773));
        inner = Vec4::new(0.193709, 0.041958, 0.382744, -0.002008)
            + v * (Vec4::new(-0.000846, -0.059120, -0.008934, 0.001405)
                + v * Vec4::new(-0.010568, 0.005510, -0.012799, 0.001030));
    }
    let width = breadth.z.max(MIN_WIDTH) / sharpness.max(1.0);
    SgRule {
        sharpness,
        mean: one_minus_exp_neg_over_x(2.0 * sharpness),
        breadth: Vec3::new(breadth.x, breadth.y * width.sqrt(), width),
        center,
        pairs: rule_pairs(nodes),
        outer,
        second,
        third,
        inner,
    }
}

/// Pairs of nodes of the rule of `nodes` nodes.
#[must_use]
pub fn rule_pairs(nodes: u32) -> u32 {
    if nodes > 4 && nodes != 6 {
        return 4;
    }
    nodes / 2
}

/// `g(u) = [E(λu) − E(2λ)]/(2 − u)`.
///
/// For `u` above 1 in the equal form `[E(2λ) − e^{−λu} E(λ(2 − u))]/u`, which has no cancellation over a small
/// denominator. Absolute error below 2e-7 (test `twins`).
#[must_use]
pub fn sg_edge_kernel(u: f32, sharpness: f32, mean: f32) -> f32 {
    if u < 1.0 {
        return (one_minus_exp_neg_over_x(sharpness * u) - mean) / (2.0 - u);
    }
    let rest = sharpness * (2.0 - u).max(0.0);
    (mean - (-sharpness * u).exp() * one_minus_exp_neg_over_x(rest)) / u
}

/// Integrand at the direction `(x, y)` (any length) in s, but for constant factors.
#[must_use]
pub fn sg_arc_node(arc: SgArc, rule: SgRule, direction: Vec2) -> f32 {
    let stretched = Vec2::new(direction.x, arc.breadth * direction.y);
    let length_squared = stretched.dot(stretched).max(TINY);
    let cosine = stretched.x / length_squared.sqrt();
    let y_squared = stretched.y * stretched.y / length_squared;
    // 1 - cosine, by the form that does not cancel.
    let versine = if cosine > 0.0 {
        y_squared / (1.0 + cosine)
    } else {
        1.0 - cosine
    };
    let u = arc.gap + arc.radius * versine;
    sg_edge_kernel(u, rule.sharpness, rule.mean) / length_squared
}

/// Two nodes on both sides of the middle of an edge.
#[must_use]
pub fn sg_arc_pair(arc: SgArc, rule: SgRule, pair: Vec4) -> f32 {
    let reach_squared = arc.reach * arc.reach;
    let p = arc.reach * pair.x * (1.0 + pair.y * reach_squared);
    let weight = arc.reach * pair.z * (1.0 + pair.w * reach_squared);
    let along = arc.middle * (1.0 - p * p);
    let across = Vec2::new(-arc.middle.y, arc.middle.x) * (2.0 * p);
    weight
        * (1.0 + p * p)
        * (sg_arc_node(arc, rule, along + across) + sg_arc_node(arc, rule, along - across))
}

/// The arc from unit vector `a` to unit vector `b` in the coordinates of a rule.
#[must_use]
pub fn sg_arc(a: Vec3, b: Vec3, axis: Vec3, rule: SgRule) -> SgArc {
    // The differences are exact for near directions, where the products with `b` and `axis` cancel.
    let scaled_normal = (b - a).cross(a);
    let sine = scaled_normal.dot(scaled_normal).sqrt();
    let cosine = a.dot(b);
    let normal = scaled_normal / sine.max(MIN_SINE);
    let offset = axis - a;
    let n_dot_axis = normal.dot(offset);
    // From the closest approach to a, as cosine and sine.
    let start = Vec2::new(a.dot(axis), -a.cross(normal).dot(offset));
    let length = start.dot(start).sqrt();
    let mut from = Vec2::new(1.0, 0.0);
    if length > MIN_SINE {
        from = start / length;
    }
    let to = Vec2::new(
        from.x * cosine - from.y * sine,
        from.y * cosine + from.x * sine,
    );
    let breadth_squared = rule.breadth.x * n_dot_axis * n_dot_axis
        + rule.breadth.y * n_dot_axis.abs()
        + rule.breadth.z;
    let breadth = breadth_squared
        .max(MIN_BREADTH * rule.breadth.z)
        .sqrt()
        .min(1.0);
    // The ends in s, as unit vectors, and the middle between them: of an arc over a right angle by its chord.
    let first_end = Vec2::new(breadth * from.x, from.y);
    let last_end = Vec2::new(breadth * to.x, to.y);
    let first = first_end / first_end.dot(first_end).max(TINY).sqrt();
    let last = last_end / last_end.dot(last_end).max(TINY).sqrt();
    let mut middle = first + last;
    if first.dot(last) < 0.0 {
        middle = Vec2::new(last.y - first.y, first.x - last.x);
    }
    middle /= middle.dot(middle).max(TINY).sqrt();
    let half_sine = (middle.x * last.y - middle.y * last.x).max(0.0);
    let half_cosine = middle.dot(last).max(0.0);
    let radius = length.min(1.0);
    let gap = n_dot_axis * n_dot_axis / (1.0 + radius);
    // The end of the edge is the beginning of the next one.
    let mut nearest = 0.5 * offset.dot(offset);
    if from.y < 0.0 && to.y > 0.0 {
        nearest = gap;
    }
    SgArc {
        middle,
        reach: half_sine / (1.0 + half_cosine),
        breadth,
        n_dot_axis,
        radius,
        gap,
        nearest,
    }
}

/// What an edge adds to the integral beyond the solid angle, in sr.
#[must_use]
pub fn sg_arc_integral(arc: SgArc, rule: SgRule) -> f32 {
    let mut sum = 0.0;
    if rule.center.x > 0.0 {
        let reach_squared = arc.reach * arc.reach;
        let weight = arc.reach * rule.center.x * (1.0 + rule.center.y * reach_squared);
        sum = weight * sg_arc_node(arc, rule, arc.middle);
    }
    if rule.pairs > 0 {
        sum += sg_arc_pair(arc, rule, rule.outer);
    }
    if rule.pairs > 1 {
        sum += sg_arc_pair(arc, rule, rule.second);
    }
    if rule.pairs > 2 {
        sum += sg_arc_pair(arc, rule, rule.third);
    }
    if rule.pairs > 3 {
        sum += sg_arc_pair(arc, rule, rule.inner);
    }
    2.0 * arc.breadth * arc.n_dot_axis * sum
}

/// Complex number whose angle is half the solid angle of the triangle of three unit vectors.
///
/// van Oosterom, Strackee 1983, "The Solid Angle of a Plane Triangle". Differences keep the digits of small triangles,
/// the sum those of opposite directions.
#[must_use]
pub fn sg_solid_angle_factor(apex: Vec3, a: Vec3, b: Vec3) -> Vec2 {
    let sum = a + b;
    Vec2::new(
        0.5 * sum.dot(sum) + apex.dot(sum),
        apex.dot((b - apex).cross(a - apex)),
    )
}

/// Product of two complex numbers, scaled so that the larger component is 1; the first where the second is 0.
#[must_use]
pub fn sg_angle_sum(a: Vec2, b: Vec2) -> Vec2 {
    let largest = b.x.abs().max(b.y.abs());
    if largest < MIN_FACTOR {
        return a;
    }
    let product = Vec2::new(a.x * b.x - a.y * b.y, a.y * b.x + a.x * b.y);
    product / product.x.abs().max(product.y.abs()).max(TINY)
}

/// `area` and the triangle from `first` to the edge from `a` to `b`: complex numbers whose angle is half a solid angle.
/// Products add the angles, so that one arc tangent serves a polygon.
///
/// Where the triangle has nearly opposite corners, so that its angle is that of a number near 0, the three triangles
/// between its edges and the normal of the surface stand for it.
#[must_use]
pub fn sg_solid_angle_push(area: Vec2, first: Vec3, a: Vec3, b: Vec3) -> Vec2 {
    let factor = sg_solid_angle_factor(first, a, b);
    if factor.x.abs().max(factor.y.abs()) > SMALL_FACTOR {
        return sg_angle_sum(area, factor);
    }
    let up = Vec3::new(0.0, 0.0, 1.0);
    let one = sg_angle_sum(area, sg_solid_angle_factor(up, first, a));
    let two = sg_angle_sum(one, sg_solid_angle_factor(up, a, b));
    sg_angle_sum(two, sg_solid_angle_factor(up, b, first))
}

/// An empty polygon.
#[must_use]
pub fn sg_polygon_new() -> SgPolygon {
    SgPolygon {
        clip: horizon_clip_new(),
        nearest: FARTHEST,
        area: Vec2::new(1.0, 0.0),
        ..SgPolygon::default()
    }
}

/// Adds the edge from `a` to `b`, vertices relative to the shading point in the shading frame; `a` is the `b` of the
/// edge before. `axis` is the lobe's unit axis in that frame.
pub fn sg_polygon_add_edge(polygon: &mut SgPolygon, axis: Vec3, rule: SgRule, a: Vec3, b: Vec3) {
    if polygon.clip.started == 0 {
        sg_polygon_push(polygon, axis, rule, a);
    }
    sg_polygon_push(polygon, axis, rule, b);
}

/// Adds one vertex; what [`sg_polygon_add_edge`] is made of.
pub fn sg_polygon_push(polygon: &mut SgPolygon, axis: Vec3, rule: SgRule, vertex: Vec3) {
    let scaled = scale_to_unit_box(vertex);
    if scaled == Vec3::ZERO {
        return;
    }
    let step = horizon_clip_push(polygon.clip, scaled);
    polygon.clip = step.clip;
    if step.has_crossing != 0 {
        sg_polygon_push_visible(polygon, axis, rule, step.crossing);
    }
    if step.has_vertex != 0 {
        sg_polygon_push_visible(polygon, axis, rule, scaled);
    }
}

/// Adds a vertex of the part above the surface.
///
/// The ends of a long edge along the horizon may be nearly opposite, where they no longer tell its plane: a third point
/// keeps it.
pub fn sg_polygon_push_visible(polygon: &mut SgPolygon, axis: Vec3, rule: SgRule, vertex: Vec3) {
    let direction = safe_normalize(vertex, Vec3::ZERO);
    if direction.dot(direction) < 0.5 {
        return;
    }
    if polygon.started == 0 {
        polygon.first = direction;
        polygon.previous = direction;
        polygon.started = 1;
        return;
    }
    if is_long_horizon_edge(polygon.previous, direction) {
        let middle = safe_normalize(horizon_middle(polygon.previous, direction), direction);
        sg_polygon_push_direction(polygon, axis, rule, middle);
    }
    sg_polygon_push_direction(polygon, axis, rule, direction);
}

/// Adds the edge from the latest direction to this one.
pub fn sg_polygon_push_direction(
    polygon: &mut SgPolygon,
    axis: Vec3,
    rule: SgRule,
    direction: Vec3,
) {
    let arc = sg_arc(polygon.previous, direction, axis, rule);
    polygon.edges += sg_arc_integral(arc, rule);
    polygon.nearest = polygon.nearest.min(arc.nearest);
    polygon.area = sg_solid_angle_push(polygon.area, polygon.first, polygon.previous, direction);
    polygon.previous = direction;
}

/// Closes the polygon; `integral` and `solid_angle` are then valid.
pub fn sg_polygon_close(polygon: &mut SgPolygon, axis: Vec3, rule: SgRule) {
    // No edge where the last `b` was the first `a`, as it should be.
    if polygon.clip.previous != polygon.clip.first {
        sg_polygon_push(polygon, axis, rule, polygon.clip.first);
    }
    if polygon.started != 0 {
        sg_polygon_push_visible(polygon, axis, rule, polygon.first);
    }
    polygon.solid_angle = 2.0 * atan2_poly(polygon.area.y, polygon.area.x);
    let integral = rule.mean * polygon.solid_angle + polygon.edges;
    polygon.integral = sg_polygon_settle(integral, polygon.nearest, rule);
}

/// The integral of a polygon whose boundary comes no nearer to the axis than `u = nearest`.
///
/// Where e^{−λu} is small there, the polygon holds the lobe as a whole or not at all, and which of them is plain from a
/// coarse integral. So triangles far from a lobe get nothing of it, and mirrors that see nothing but the polygon lose
/// nothing.
#[must_use]
pub fn sg_polygon_settle(integral: f32, nearest: f32, rule: SgRule) -> f32 {
    let whole = FOUR_PI * rule.mean;
    let settled = whole * (integral / whole + 0.5).floor();
    let share = ((rule.sharpness * nearest - SETTLING) / (SETTLED - SETTLING))
        .max(0.0)
        .min(1.0);
    integral + share * (settled - integral)
}

/// Integral in sr of a lobe of unit amplitude over the part of a polygon above the horizon, by the rule of `nodes`
/// nodes an edge; vertices relative to the shading point in the shading frame. CPU only.
#[must_use]
pub fn sg_polygon_integral(vertices: &[Vec3], axis: Vec3, sharpness: f32, nodes: u32) -> f32 {
    let rule = sg_rule(nodes, sharpness);
    let mut polygon = sg_polygon_new();
    for (i, &a) in vertices.iter().enumerate() {
        let b = vertices[(i + 1) % vertices.len()];
        sg_polygon_add_edge(&mut polygon, axis, rule, a, b);
    }
    sg_polygon_close(&mut polygon, axis, rule);
    polygon.integral
}
