#define_import_path akari_math::sg::polygon

// Twin: `sg/polygon.rs`, where the formulas, domains, error bounds and sources are. Change both or neither.

#import akari_math::special::{TINY, atan2_poly, one_minus_exp_neg_over_x, safe_normalize, scale_to_unit_box}
#import akari_math::polygon::{HorizonClip, horizon_clip_new, horizon_clip_push, horizon_middle, is_long_horizon_edge}

// Scale of the sharpness in the parameters of the rules.
const RULE_SHARPNESS: f32 = 60.0;
// Floor of the sine of an edge whose ends are the same or opposite.
const MIN_SINE: f32 = 1e-12;
// Below this size the angle of a complex number that is made of unit vectors is lost.
const MIN_FACTOR: f32 = 1e-12;
// Below this size it has lost five digits.
const SMALL_FACTOR: f32 = 1e-2;
// sharpness * (1 less cosine) on the whole boundary from which an integral begins to snap to all or nothing, and from
// which it has.
const SETTLING: f32 = 8.0;
const SETTLED: f32 = 12.0;
// The largest 1 less cosine that there is.
const FARTHEST: f32 = 2.0;
const FOUR_PI: f32 = 12.5663706;
// Floor of c in k^2, which the fits stay above.
const MIN_WIDTH: f32 = 0.5;
// Floor of k^2 over c / sharpness: an interpolated rule might make it negative.
const MIN_BREADTH: f32 = 0.2;

// A quadrature rule for the edges of polygons under one lobe.
struct SgRule {
    sharpness: f32,
    // The lobe's integral over the sphere over 4 pi.
    mean: f32,
    // k^2 = x n^2 + y |n| + z, n the cosine between axis and normal of the edge's plane.
    breadth: vec3<f32>,
    // Weight of the middle node and its slope in P^2; weight 0 where there is none.
    center: vec2<f32>,
    // How many of the pairs below there are.
    pairs: u32,
    // Two nodes each: place, its slope in P^2, weight, its slope.
    outer: vec4<f32>,
    second: vec4<f32>,
    third: vec4<f32>,
    inner: vec4<f32>,
}

// An edge in the coordinates of a rule.
struct SgArc {
    // Unit direction of the middle of the arc in s, from the closest approach.
    middle: vec2<f32>,
    // Tangent of a quarter of the arc in s.
    reach: f32,
    breadth: f32,
    // Cosine between axis and normal of the edge's plane.
    n_dot_axis: f32,
    // Cosine of the smallest angle between axis and great circle, and 1 less it.
    radius: f32,
    gap: f32,
    // 1 less the cosine between axis and the nearest point of the edge.
    nearest: f32,
}

// A polygon under one lobe.
struct SgPolygon {
    // The integral in sr; valid after `sg_polygon_close`.
    integral: f32,
    // Solid angle of the part above the surface in sr; valid after `sg_polygon_close`.
    solid_angle: f32,
    clip: HorizonClip,
    // 1 once a vertex above the surface has come.
    started: u32,
    // Unit directions of the first and of the latest vertex above the surface.
    first: vec3<f32>,
    previous: vec3<f32>,
    // Sum of the edges so far.
    edges: f32,
    // Smallest 1 less cosine to the axis on the edges so far.
    nearest: f32,
    // Complex number, up to scale, whose angle is half the solid angle so far.
    area: vec2<f32>,
}

// The rule of `nodes` nodes an edge: 1, 2, 3, 4, 6 or 8.
fn sg_rule(nodes: u32, sharpness: f32) -> SgRule {
    let v = 1.0 / (1.0 + sharpness / RULE_SHARPNESS);
    var breadth = vec3<f32>(0.0);
    var center = vec2<f32>(0.0);
    var outer = vec4<f32>(0.0);
    var second = vec4<f32>(0.0);
    var third = vec4<f32>(0.0);
    var inner = vec4<f32>(0.0);
    if nodes == 1u {
        breadth = vec3<f32>(0.710668, -0.722921, 2.338819) + v * (vec3<f32>(5.050345, -3.026901, 16.766113) + v * vec3<f32>(-5.462473, 3.711720, -18.000676));
        center = vec2<f32>(2.000000, -0.008071) + v * (vec2<f32>(0.000000, -1.700125) + v * vec2<f32>(0.000000, 1.438535));
    } else if nodes == 2u {
        breadth = vec3<f32>(1.110988, -0.768929, 5.816058) + v * (vec3<f32>(5.366094, -4.445527, 19.052890) + v * vec3<f32>(-6.828948, 5.830043, -23.952188));
        outer = vec4<f32>(0.539175, -0.175726, 1.000000, -0.055146) + v * (vec4<f32>(-0.024426, -0.392449, 0.000000, -0.247479) + v * vec4<f32>(0.028082, 0.441639, 0.000000, 0.268627));
    } else if nodes == 3u {
        breadth = vec3<f32>(1.508694, -0.773916, 8.360067) + v * (vec3<f32>(2.951459, -3.969415, 23.903576) + v * vec3<f32>(-5.119028, 5.692203, -31.852994));
        center = vec2<f32>(0.869843, -0.258215) + v * (vec2<f32>(-0.113627, -0.519233) + v * vec2<f32>(0.013091, 0.663340));
        outer = vec4<f32>(0.758130, -0.089316, 0.565078, 0.178486) + v * (vec4<f32>(-0.039876, -0.350391, 0.056813, 0.219003) + v * vec4<f32>(0.012049, 0.380937, -0.006545, -0.332946));
    } else if nodes == 4u {
        breadth = vec3<f32>(0.708777, -0.696795, 4.087754) + v * (vec3<f32>(3.201516, -1.865980, 10.802461) + v * vec3<f32>(-3.957808, 3.239964, -13.461724));
        outer = vec4<f32>(0.899389, -0.038218, 0.285978, 0.304982) + v * (vec4<f32>(-0.323774, -0.231179, 0.504431, -0.548641) + v * vec4<f32>(0.259079, 0.210857, -0.391283, 0.476379));
        second = vec4<f32>(0.359685, 0.014592, 0.714022, -0.122211) + v * (vec4<f32>(-0.249880, -0.052964, -0.504431, -0.023820) + v * vec4<f32>(0.193920, -0.170095, 0.391283, -0.007352));
    } else if nodes == 6u {
        breadth = vec3<f32>(2.150473, -1.127942, 15.332735) + v * (vec3<f32>(6.276706, -8.514159, 4.703307) + v * vec3<f32>(-10.278665, 12.219835, -19.906743));
        outer = vec4<f32>(0.913282, -0.002846, 0.193087, 0.266561) + v * (vec4<f32>(0.029466, -0.248267, -0.023667, 1.660493) + v * vec4<f32>(-0.005848, 0.263674, 0.012345, -1.974965));
        second = vec4<f32>(0.643464, -0.192368, 0.357850, 0.204546) + v * (vec4<f32>(0.012811, -0.184317, 0.000929, -0.757854) + v * vec4<f32>(-0.039406, 0.383919, 0.057825, 0.559873));
        third = vec4<f32>(0.225964, -0.288406, 0.449063, -0.284904) + v * (vec4<f32>(0.021534, -0.063760, 0.022738, -0.056632) + v * vec4<f32>(-0.051824, 0.381755, -0.070169, 0.356624));
    } else {
        breadth = vec3<f32>(0.202063, 0.822664, 2.870652) + v * (vec3<f32>(-0.273018, 3.058374, -9.885823) + v * vec3<f32>(2.186348, -5.674934, 12.045762));
        outer = vec4<f32>(0.961569, 0.000031, 0.099914, 0.001306) + v * (vec4<f32>(0.003757, -0.002215, 0.000363, -0.000598) + v * vec4<f32>(-0.005390, 0.011003, 0.001027, -0.001294));
        second = vec4<f32>(0.794276, 0.000792, 0.224628, 0.012710) + v * (vec4<f32>(0.001356, -0.000639, -0.003555, -0.004539) + v * vec4<f32>(0.001331, -0.009096, 0.001237, -0.007847));
        third = vec4<f32>(0.537993, -0.013734, 0.292714, -0.007952) + v * (vec4<f32>(-0.005981, 0.013338, 0.012126, 0.003676) + v * vec4<f32>(-0.007440, 0.007911, 0.010534, 0.003773));
        inner = vec4<f32>(0.193709, 0.041958, 0.382744, -0.002008) + v * (vec4<f32>(-0.000846, -0.059120, -0.008934, 0.001405) + v * vec4<f32>(-0.010568, 0.005510, -0.012799, 0.001030));
    }
    let width = max(breadth.z, MIN_WIDTH) / max(sharpness, 1.0);
    return SgRule(
        sharpness,
        one_minus_exp_neg_over_x(2.0 * sharpness),
        vec3<f32>(breadth.x, breadth.y * sqrt(width), width),
        center,
        rule_pairs(nodes),
        outer,
        second,
        third,
        inner,
    );
}

// Pairs of nodes of the rule of `nodes` nodes.
fn rule_pairs(nodes: u32) -> u32 {
    if nodes > 4u && nodes != 6u {
        return 4u;
    }
    return nodes / 2u;
}

// [E(sharpness u) - E(2 sharpness)] / (2 - u).
fn sg_edge_kernel(u: f32, sharpness: f32, mean: f32) -> f32 {
    if u < 1.0 {
        return (one_minus_exp_neg_over_x(sharpness * u) - mean) / (2.0 - u);
    }
    let rest = sharpness * max(2.0 - u, 0.0);
    return (mean - exp(-sharpness * u) * one_minus_exp_neg_over_x(rest)) / u;
}

// Integrand at the direction `direction` (any length) in s, but for constant factors.
fn sg_arc_node(arc: SgArc, rule: SgRule, direction: vec2<f32>) -> f32 {
    let stretched = vec2<f32>(direction.x, arc.breadth * direction.y);
    let length_squared = max(dot(stretched, stretched), TINY);
    let cosine = stretched.x / sqrt(length_squared);
    let y_squared = stretched.y * stretched.y / length_squared;
    // 1 - cosine, by the form that does not cancel.
    let versine = select(1.0 - cosine, y_squared / (1.0 + max(cosine, 0.0)), cosine > 0.0);
    let u = arc.gap + arc.radius * versine;
    return sg_edge_kernel(u, rule.sharpness, rule.mean) / length_squared;
}

// Two nodes on both sides of the middle of an edge.
fn sg_arc_pair(arc: SgArc, rule: SgRule, nodes: vec4<f32>) -> f32 {
    let reach_squared = arc.reach * arc.reach;
    let p = arc.reach * nodes.x * (1.0 + nodes.y * reach_squared);
    let weight = arc.reach * nodes.z * (1.0 + nodes.w * reach_squared);
    let along = arc.middle * (1.0 - p * p);
    let across = vec2<f32>(-arc.middle.y, arc.middle.x) * (2.0 * p);
    return weight * (1.0 + p * p) * (sg_arc_node(arc, rule, along + across) + sg_arc_node(arc, rule, along - across));
}

// The arc from unit vector `a` to unit vector `b` in the coordinates of a rule.
fn sg_arc(a: vec3<f32>, b: vec3<f32>, axis: vec3<f32>, rule: SgRule) -> SgArc {
    // The differences are exact for near directions, where the products with `b` and `axis` cancel.
    let scaled_normal = cross(b - a, a);
    let sine = sqrt(dot(scaled_normal, scaled_normal));
    let cosine = dot(a, b);
    let normal = scaled_normal / max(sine, MIN_SINE);
    let offset = axis - a;
    let n_dot_axis = dot(normal, offset);
    // From the closest approach to a, as cosine and sine.
    let start = vec2<f32>(dot(a, axis), -dot(cross(a, normal), offset));
    let size = sqrt(dot(start, start));
    var begin = vec2<f32>(1.0, 0.0);
    if size > MIN_SINE {
        begin = start / size;
    }
    let end = vec2<f32>(begin.x * cosine - begin.y * sine, begin.y * cosine + begin.x * sine);
    let breadth_squared = rule.breadth.x * n_dot_axis * n_dot_axis + rule.breadth.y * abs(n_dot_axis) + rule.breadth.z;
    let breadth = min(sqrt(max(breadth_squared, MIN_BREADTH * rule.breadth.z)), 1.0);
    // The ends in s, as unit vectors, and the middle between them: of an arc over a right angle by its chord.
    let first_end = vec2<f32>(breadth * begin.x, begin.y);
    let last_end = vec2<f32>(breadth * end.x, end.y);
    let first = first_end / sqrt(max(dot(first_end, first_end), TINY));
    let last = last_end / sqrt(max(dot(last_end, last_end), TINY));
    var middle = first + last;
    if dot(first, last) < 0.0 {
        middle = vec2<f32>(last.y - first.y, first.x - last.x);
    }
    middle = middle / sqrt(max(dot(middle, middle), TINY));
    let half_sine = max(middle.x * last.y - middle.y * last.x, 0.0);
    let half_cosine = max(dot(middle, last), 0.0);
    let radius = min(size, 1.0);
    let gap = n_dot_axis * n_dot_axis / (1.0 + radius);
    // The end of the edge is the beginning of the next one.
    let nearest = select(0.5 * dot(offset, offset), gap, begin.y < 0.0 && end.y > 0.0);
    return SgArc(
        middle,
        half_sine / (1.0 + half_cosine),
        breadth,
        n_dot_axis,
        radius,
        gap,
        nearest,
    );
}

// What an edge adds to the integral beyond the solid angle, in sr.
fn sg_arc_integral(arc: SgArc, rule: SgRule) -> f32 {
    var sum = 0.0;
    if rule.center.x > 0.0 {
        let reach_squared = arc.reach * arc.reach;
        let weight = arc.reach * rule.center.x * (1.0 + rule.center.y * reach_squared);
        sum = weight * sg_arc_node(arc, rule, arc.middle);
    }
    if rule.pairs > 0u {
        sum += sg_arc_pair(arc, rule, rule.outer);
    }
    if rule.pairs > 1u {
        sum += sg_arc_pair(arc, rule, rule.second);
    }
    if rule.pairs > 2u {
        sum += sg_arc_pair(arc, rule, rule.third);
    }
    if rule.pairs > 3u {
        sum += sg_arc_pair(arc, rule, rule.inner);
    }
    return 2.0 * arc.breadth * arc.n_dot_axis * sum;
}

// Complex number whose angle is half the solid angle of the triangle of three unit vectors.
fn sg_solid_angle_factor(apex: vec3<f32>, a: vec3<f32>, b: vec3<f32>) -> vec2<f32> {
    let sum = a + b;
    return vec2<f32>(0.5 * dot(sum, sum) + dot(apex, sum), dot(apex, cross(b - apex, a - apex)));
}

// Product of two complex numbers, scaled so that the larger component is 1; the first where the second is 0.
fn sg_angle_sum(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let largest = max(abs(b.x), abs(b.y));
    if largest < MIN_FACTOR {
        return a;
    }
    let product = vec2<f32>(a.x * b.x - a.y * b.y, a.y * b.x + a.x * b.y);
    return product / max(max(abs(product.x), abs(product.y)), TINY);
}

// `area` and the triangle from `first` to the edge from `a` to `b`: complex numbers whose angle is half a solid angle.
fn sg_solid_angle_push(area: vec2<f32>, first: vec3<f32>, a: vec3<f32>, b: vec3<f32>) -> vec2<f32> {
    let factor = sg_solid_angle_factor(first, a, b);
    if max(abs(factor.x), abs(factor.y)) > SMALL_FACTOR {
        return sg_angle_sum(area, factor);
    }
    // Nearly opposite corners: the three triangles between the edges and the normal of the surface instead.
    let up = vec3<f32>(0.0, 0.0, 1.0);
    let one = sg_angle_sum(area, sg_solid_angle_factor(up, first, a));
    let two = sg_angle_sum(one, sg_solid_angle_factor(up, a, b));
    return sg_angle_sum(two, sg_solid_angle_factor(up, b, first));
}

fn sg_polygon_new() -> SgPolygon {
    return SgPolygon(
        0.0,
        0.0,
        horizon_clip_new(),
        0u,
        vec3<f32>(0.0),
        vec3<f32>(0.0),
        0.0,
        FARTHEST,
        vec2<f32>(1.0, 0.0),
    );
}

// Adds the edge from `a` to `b`, vertices relative to the shading point in the shading frame; `a` is the `b` of the
// edge before. `axis` is the lobe's unit axis in that frame.
fn sg_polygon_add_edge(polygon: ptr<function, SgPolygon>, axis: vec3<f32>, rule: SgRule, a: vec3<f32>, b: vec3<f32>) {
    if (*polygon).clip.started == 0u {
        sg_polygon_push(polygon, axis, rule, a);
    }
    sg_polygon_push(polygon, axis, rule, b);
}

fn sg_polygon_push(polygon: ptr<function, SgPolygon>, axis: vec3<f32>, rule: SgRule, vertex: vec3<f32>) {
    let scaled = scale_to_unit_box(vertex);
    // A vertex at the shading point has no direction: leave it out.
    if all(scaled == vec3<f32>(0.0)) {
        return;
    }
    let step = horizon_clip_push((*polygon).clip, scaled);
    (*polygon).clip = step.clip;
    if step.has_crossing != 0u {
        sg_polygon_push_visible(polygon, axis, rule, step.crossing);
    }
    if step.has_vertex != 0u {
        sg_polygon_push_visible(polygon, axis, rule, scaled);
    }
}

// Adds a vertex of the part above the surface.
fn sg_polygon_push_visible(polygon: ptr<function, SgPolygon>, axis: vec3<f32>, rule: SgRule, vertex: vec3<f32>) {
    let direction = safe_normalize(vertex, vec3<f32>(0.0));
    if dot(direction, direction) < 0.5 {
        return;
    }
    if (*polygon).started == 0u {
        (*polygon).first = direction;
        (*polygon).previous = direction;
        (*polygon).started = 1u;
        return;
    }
    if is_long_horizon_edge((*polygon).previous, direction) {
        let middle = safe_normalize(horizon_middle((*polygon).previous, direction), direction);
        sg_polygon_push_direction(polygon, axis, rule, middle);
    }
    sg_polygon_push_direction(polygon, axis, rule, direction);
}

// Adds the edge from the latest direction to this one.
fn sg_polygon_push_direction(polygon: ptr<function, SgPolygon>, axis: vec3<f32>, rule: SgRule, direction: vec3<f32>) {
    let arc = sg_arc((*polygon).previous, direction, axis, rule);
    (*polygon).edges += sg_arc_integral(arc, rule);
    (*polygon).nearest = min((*polygon).nearest, arc.nearest);
    (*polygon).area = sg_solid_angle_push((*polygon).area, (*polygon).first, (*polygon).previous, direction);
    (*polygon).previous = direction;
}

// Closes the polygon; `integral` and `solid_angle` are then valid.
fn sg_polygon_close(polygon: ptr<function, SgPolygon>, axis: vec3<f32>, rule: SgRule) {
    // No edge where the last `b` was the first `a`, as it should be.
    if any((*polygon).clip.previous != (*polygon).clip.first) {
        sg_polygon_push(polygon, axis, rule, (*polygon).clip.first);
    }
    if (*polygon).started != 0u {
        sg_polygon_push_visible(polygon, axis, rule, (*polygon).first);
    }
    (*polygon).solid_angle = 2.0 * atan2_poly((*polygon).area.y, (*polygon).area.x);
    let integral = rule.mean * (*polygon).solid_angle + (*polygon).edges;
    (*polygon).integral = sg_polygon_settle(integral, (*polygon).nearest, rule);
}

// The integral of a polygon whose boundary comes no nearer to the axis than 1 less cosine = `nearest`: all or nothing
// where the lobe is small there.
fn sg_polygon_settle(integral: f32, nearest: f32, rule: SgRule) -> f32 {
    let whole = FOUR_PI * rule.mean;
    let settled = whole * floor(integral / whole + 0.5);
    let share = min(max((rule.sharpness * nearest - SETTLING) / (SETTLED - SETTLING), 0.0), 1.0);
    return integral + share * (settled - integral);
}
