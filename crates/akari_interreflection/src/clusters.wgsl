#define_import_path akari_interreflection::clusters

// A cluster as a receiver sees it, and what of it may be wrong or missing.

#import akari_math::cluster::{
    cluster_gloss_error, cluster_light_error, cluster_ndf_bound, cluster_shape_error, cluster_side,
}
#import akari_math::special::{safe_normalize, TINY}
#import akari_interreflection::types::{Cluster, ClusterLight}
#import akari_render::scene_lights::{KIND_DIRECTIONAL, KIND_POLYGON, Light}

const TWO_PI: f32 = 6.28318531;
// Largest length of the difference of two directions, over the sine of the angle between them, up to a right angle.
const CHORD_OF_SINE: f32 = 1.41421356;
// Largest radiance in the denominator of a bound.
const MIN_SQUARED: f32 = 1e-12;

struct ClusterView {
    // 1 in front of all triangles, -1 behind all of them, 0 unknown.
    side: f32,
    // Over the plane; negative behind it.
    height: f32,
    nearest: f32,
    farthest: f32,
    lateral: f32,
    clearance: f32,
    // Most that the cluster covers of the sphere, sr.
    solid_angle: f32,
}

// `offset` is from the receiver to the cluster's middle.
fn view_cluster(cluster: Cluster, offset: vec3<f32>) -> ClusterView {
    var seen: ClusterView;
    let distance = length(offset);
    seen.height = -dot(cluster.normal, offset);
    seen.farthest = distance + cluster.radius;
    seen.side = cluster_side(seen.height, cluster.deviation, seen.farthest, cluster.turn);
    seen.clearance = max(abs(seen.height) - cluster.deviation, 0.0);
    seen.nearest = max(distance - cluster.radius, seen.clearance);
    seen.lateral = length(offset + cluster.normal * seen.height) + cluster.radius;
    // At grazing angles that is little: the cosine at a triangle is its plane's distance over that of the point.
    let off_plane = abs(seen.height) + cluster.deviation + cluster.turn * seen.farthest;
    let cosine = min(off_plane / max(seen.nearest, TINY), 1.0);
    seen.solid_angle = min(cosine * cluster.area / max(seen.nearest * seen.nearest, MIN_SQUARED), TWO_PI);
    return seen;
}

fn shape_error(cluster: Cluster, seen: ClusterView) -> f32 {
    let ratio = min((seen.farthest - cluster.radius) / max(seen.nearest, TINY), 1e3);
    return cluster_shape_error(cluster.mismatch, cluster.rim, seen.lateral, seen.clearance, ratio);
}

fn largest(v: vec3<f32>) -> f32 {
    return max(max(v.x, v.y), v.z);
}

// Of the light that the diffuse part of a cluster sends.
fn light_error(cluster: Cluster, light: ClusterLight, seen: ClusterView) -> f32 {
    let variation = largest(abs(light.slope_u)) + largest(abs(light.slope_v));
    let half_diagonal = length(cluster.axis_u) + length(cluster.axis_v);
    let aperture = half_diagonal / max(seen.nearest, TINY);
    // What is off the plane is seen shifted along it.
    let shift = cluster.deviation * min(seen.lateral / max(seen.clearance, TINY), 1e3);
    let least_side = max(min(length(cluster.axis_u), length(cluster.axis_v)), TINY);
    let residual = light.residual + variation * min(shift / least_side, 1.0);
    return cluster_light_error(residual, variation, aperture, largest(light.mean));
}

// 1 - cosine of the smallest angle between a unit axis and a point of the cluster.
fn least_versine(cluster: Cluster, offset: vec3<f32>, axis: vec3<f32>) -> f32 {
    let distance = length(offset);
    let sine = cluster.radius / max(distance, TINY);
    if sine >= 1.0 {
        return 0.0;
    }
    let cosine = sqrt(1.0 - sine * sine);
    let to_axis = clamp(dot(axis, offset) / max(distance, TINY), -1.0, 1.0);
    if to_axis >= cosine {
        return 0.0;
    }
    return 1.0 - (to_axis * cosine + sqrt(1.0 - to_axis * to_axis) * sine);
}

// What a light and a cluster may do to each other.
struct Gloss {
    // Largest radiance that the cluster sends to the receiver.
    radiance: f32,
    // Relative error of a flat mirror in its place.
    error: f32,
}

fn gloss_of(cluster: Cluster, seen: ClusterView, offset: vec3<f32>, center: vec3<f32>, light: Light, alpha: f32, grazing_reflectance: f32) -> Gloss {
    var to_light = light.direction;
    var nearest = 0.0;
    var of_light = 0.0;
    var incident = largest(light.color);
    if light.kind != KIND_DIRECTIONAL {
        let from_center = light.position - center;
        let distance = length(from_center);
        to_light = safe_normalize(from_center, cluster.normal);
        nearest = max(distance - cluster.radius - light.radius, 0.0);
        of_light = min((cluster.radius + light.radius) / max(distance, TINY), 1.0);
        let squared = max(nearest * nearest, MIN_SQUARED);
        if light.kind == KIND_POLYGON {
            incident = incident * min(light.area / squared, TWO_PI);
        } else {
            incident = incident / squared;
        }
    }
    let distance = length(offset);
    let to_receiver = safe_normalize(-offset, cluster.normal);
    let normal = select(cluster.normal, -cluster.normal, seen.height < 0.0);
    let sum = to_light + to_receiver;
    let sum_length = length(sum);
    let half_vector = safe_normalize(sum, normal);
    // Of two unit vectors' sums, one at least as long as |sum| less both chords.
    let chords = CHORD_OF_SINE * (of_light + min(cluster.radius / max(distance, TINY), 1.0));
    let spread = min(chords / max(sum_length - 0.5 * chords, 0.01), 2.0);
    let most = cluster_ndf_bound(length(half_vector - normal), spread + cluster.turn, alpha);
    let n_dot_v = max(seen.clearance / max(seen.farthest, TINY) - cluster.turn, 0.0);
    let masking = sqrt(n_dot_v * n_dot_v * (1.0 - alpha * alpha) + alpha * alpha);
    var gloss: Gloss;
    // Visibility times the light's cosine is at most 1/(2 masking) in height-correlated Smith.
    gloss.radiance = grazing_reflectance * most * incident * 0.5 / max(masking, 1e-3);
    if light.kind == KIND_POLYGON {
        gloss.radiance = min(gloss.radiance, largest(light.color));
    }
    var parallax = cluster.deviation / max(seen.nearest, TINY);
    if light.kind != KIND_DIRECTIONAL {
        parallax += cluster.deviation / max(nearest, TINY);
    }
    gloss.error = cluster_gloss_error(cluster.turn, cluster.stray, min(parallax, 4.0), alpha);
    return gloss;
}
