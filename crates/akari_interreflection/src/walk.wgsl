#define_import_path akari_interreflection::walk

// Which clusters and triangles a pixel looks at.

#import akari_math::special::TINY
#import akari_interreflection::bindings::{cluster_lights, clusters, materials, settings, triangles, view}
#import akari_interreflection::clusters::{
    ClusterView, gloss_of, largest, least_versine, light_error, shape_error, view_cluster,
}
#import akari_interreflection::lights::INV_PI
#import akari_interreflection::receiver::{light_of, ON_PLANE, PARALLEL, Receiver, see, see_cluster, Seen}
#import akari_interreflection::types::{Cluster, FLAG_TWO_SIDED, MIXED_MATERIAL}

// Share of white, times the allowed error, that a cluster's error may be where it is a large part of the cluster's light: in
// proportion to the solid angle, but at least this part of it.
const FLOOR: f32 = 0.02;
const LEAST_SHARE: f32 = 1.0 / 256.0;
// By how much a GGX lobe may be denser than its spherical Gaussian.
const LOBE_MARGIN: f32 = 2.0;
const TWO_PI: f32 = 6.28318531;
#ifdef SKY
// Radiance, nits, that no sky has: no part of it is too dark to matter.
const SKY_RADIANCE: f32 = 1e30;
// Deviation of a GGX lobe seen along its normal, over alpha.
const ALPHA_RADIUS: f32 = 1.41421356;
#endif

// Where a walk is. Clusters stand in the order in which a visit of all would meet them, and say where the next one is that is not
// below them; the triangles of a leaf are visited between two of them.
struct Walk {
    // The next triangle, and the end of those that are visited.
    triangle: u32,
    last_triangle: u32,
    // The next cluster, and the end of them.
    cluster: u32,
    last_cluster: u32,
}

// A triangle that lights the pixel, or a cluster that may be seen as its rectangle.
struct Found {
    seen: Seen,
    material: u32,
    // Of it.
    index: u32,
#ifdef SHADOW_RAYS
    // How far the triangles may be from what stands for them.
    gap: f32,
    // Error that does not matter.
    allowed: f32,
    of_cluster: bool,
    // The walk through a cluster's parts.
    parts: Walk,
#endif
}

#ifdef CLUSTERS
// What is to be done with a cluster.
struct Choice {
    // It sends nothing here.
    dark: bool,
    // Its back is to the pixel.
    behind: bool,
    // Error of its rectangle.
    error: f32,
    // Largest weight of a direction in it: reflectance over pi, or of the lobe's peak.
    weight: f32,
}

fn choose(receiver: Receiver, cluster: Cluster, seen: ClusterView, offset: vec3<f32>) -> Choice {
    var choice: Choice;
    let two_sided = (cluster.flags & FLAG_TWO_SIDED) != 0u;
    let facing = dot(receiver.normal_ws, offset) + cluster.radius;
    // All triangles are below the horizon, or show their backs, or lie in one plane with the pixel: as `see` has it.
    let rounding = ON_PLANE * max(seen.nearest, length(receiver.position_rel));
    let off_plane = abs(seen.height) + cluster.deviation + cluster.turn * seen.farthest;
    let in_plane = off_plane <= rounding;
    let parallel = abs(dot(cluster.normal, receiver.normal_ws)) > PARALLEL;
    choice.behind = seen.side < 0.0 && !in_plane;
    choice.dark = facing <= 0.0 || (choice.behind && !two_sided) || (in_plane && parallel);
    choice.weight = largest(receiver.diffuse_albedo) * INV_PI * min(facing / max(seen.nearest, TINY), 1.0);
    choice.error = shape_error(cluster, seen);
#ifdef GLOSSY_RECEIVERS
    if receiver.glossy {
        let away = least_versine(cluster, offset, receiver.lobe_axis);
        let tail = 1.0 / (1.0 + 0.5 * receiver.lobe_sharpness * away);
        let density = LOBE_MARGIN * 0.5 * INV_PI * receiver.lobe_sharpness * tail * tail;
        choice.weight += largest(receiver.layer.albedo) * density;
        // Of what is wider than the lobe, a part that the lobe looks at counts as the whole.
        choice.error *= max(density * seen.solid_angle, 1.0);
    }
#endif
    // Where the triangles' own test of the plane would differ.
    let near_plane = abs(seen.height) - cluster.deviation <= ON_PLANE * max(seen.farthest, length(receiver.position_rel));
    if cluster.material == MIXED_MATERIAL || seen.side == 0.0 || near_plane {
        choice.error = 1.0;
    }
    return choice;
}

// Radiance at the camera, with exposure, below which an error of a cluster does not matter.
fn allowance(seen: ClusterView) -> f32 {
    return settings.cut * FLOOR * max(seen.solid_angle / TWO_PI, LEAST_SHARE);
}

// Whether a cluster may be seen as its rectangle, or is as good as dark: its error within what is allowed. -1 if it is dark, 1
// if its rectangle is to be seen, 0 if neither.
fn decide(receiver: Receiver, cluster: Cluster, index: u32, seen: ClusterView, offset: vec3<f32>, diffuse: bool) -> i32 {
    let choice = choose(receiver, cluster, seen, offset);
    if choice.dark || (diffuse && choice.behind) {
        return -1;
    }
    var most = 0.0;
    var error = choice.error;
    if diffuse {
        let light = cluster_lights[index];
        most = light.brightest;
        error += light_error(cluster, light, seen);
    } else if cluster.material == MIXED_MATERIAL {
        return 0;
    } else {
        let material = materials[cluster.material];
        let alpha = material.perceptual_roughness * material.perceptual_roughness;
        var wrong = 0.0;
        for (var k = 0u; k < settings.lights; k++) {
            let gloss = gloss_of(cluster, seen, offset, cluster.center, light_of(k), alpha, material.grazing_reflectance);
            most += gloss.radiance;
            wrong = max(wrong, gloss.error);
        }
        error += wrong;
#ifdef SKY
        // How bright the sky is in there is not known. What turns otherwise than the rectangle shows another part of it.
        most = SKY_RADIANCE;
        error += 2.0 * cluster.turn / max(ALPHA_RADIUS * alpha + sqrt(seen.solid_angle), TINY);
#endif
    }
    error = min(error, 1.0);
    most *= choice.weight * seen.solid_angle * view.exposure;
    if error <= settings.cut || error * most <= allowance(seen) {
        return select(-1, 1, error < 1.0);
    }
    return 0;
}
#endif

// All patches, or all glossy triangles.
fn walk_over(diffuse: bool) -> Walk {
    let split = settings.patches;
#ifdef CLUSTERS
    if settings.clusters > 0u {
        return Walk(
            0u,
            0u,
            select(settings.patch_clusters, 0u, diffuse),
            select(settings.clusters, settings.patch_clusters, diffuse),
        );
    }
#endif
    return Walk(select(split, 0u, diffuse), select(split + settings.glossy, split, diffuse), 0u, 0u);
}

// The next part of a reflector to compute the light of; one that is not visible at the end. A loop of its own, so that pixels
// that look for theirs wait for no others that have found one.
fn find(receiver: Receiver, walk: ptr<function, Walk>, diffuse: bool) -> Found {
    var found: Found;
    found.seen.visible = false;
    loop {
        if (*walk).triangle < (*walk).last_triangle {
            let index = (*walk).triangle;
            let triangle = triangles[index];
            found.seen = see(triangle, receiver);
            // The back of a patch is lit by what its front turns away from: not computed.
            found.seen.visible = found.seen.visible && (!diffuse || found.seen.side > 0.0);
            found.material = triangle.material;
            found.index = index;
#ifdef SHADOW_RAYS
            found.gap = 0.0;
            found.allowed = settings.cut * FLOOR * LEAST_SHARE;
            found.of_cluster = false;
#endif
            (*walk).triangle = index + 1u;
#ifdef CLUSTERS
        } else if (*walk).cluster < (*walk).last_cluster {
            let index = (*walk).cluster;
            let cluster = clusters[index];
            let offset = (cluster.center - view.world_position) - receiver.position_rel;
            let from_here = view_cluster(cluster, offset);
            let decision = decide(receiver, cluster, index, from_here, offset, diffuse);
            let inner = cluster.count == 0u;
            if decision > 0 {
                found.seen = see_cluster(cluster, offset, from_here.side);
                found.material = cluster.material;
                found.index = index;
#ifdef SHADOW_RAYS
                found.gap = cluster.deviation;
                found.allowed = allowance(from_here);
                found.of_cluster = true;
                let below = select(cluster.skip, index + 1u, inner);
                found.parts = Walk(cluster.first, cluster.first + cluster.count, below, (*walk).last_cluster);
#endif
            }
            if decision == 0 {
                (*walk).triangle = cluster.first;
                (*walk).last_triangle = cluster.first + cluster.count;
            }
            (*walk).cluster = select(cluster.skip, index + 1u, decision == 0 && inner);
#endif
        } else {
            break;
        }
        if found.seen.visible {
            break;
        }
    }
    return found;
}
