// For each tile of the screen, one bit for each light: may it reach any pixel of the tile? One workgroup a tile. Tiles that
// any light may reach are listed: the shading pass draws these alone.

#import bevy_render::view::View
#import akari_math::area_light::{dielectric_f0_from_reflectance, dielectric_f90_from_f0}
#import akari_math::tile_bounds::{
    box_behind_plane, box_distance_squared, box_plane_distance, contribution_bound, CUTOFF_CLASSES, cutoff_class,
    cutoff_class_edge, form_factor_bound, solid_angle_bound, sphere_touches_box,
}
#import akari_render::gbuffer::{position_in_view, rotate_to_view, unpack_surface}
#import akari_area_light::types::{
    AreaLight, AreaLightView, COUNTER_BELOW_CUTOFF, COUNTER_KEPT, COUNTER_LIT, COUNTER_OUT_OF_RANGE, COUNTER_TILES,
    COUNTER_TURNED_AWAY, CULL_WORKGROUP, DrawArguments, FLAG_TWO_SIDED, LIGHTS_PER_WORD, TILE_COORDINATE_BITS,
    TILE_SIZE,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> area_view: AreaLightView;
@group(0) @binding(2) var depth_texture: texture_depth_2d;
@group(0) @binding(3) var gbuffer_texture: texture_2d<u32>;
@group(0) @binding(4) var pass_id_texture: texture_2d<u32>;
@group(0) @binding(5) var<storage, read> lights: array<AreaLight>;
@group(0) @binding(6) var<storage, read_write> masks: array<u32>;
@group(0) @binding(7) var<storage, read_write> counters: array<atomic<u32>, 6>;
@group(0) @binding(8) var<storage, read_write> lit_tiles: array<u32>;
@group(0) @binding(9) var<storage, read_write> draw: DrawArguments;

const NO_ALPHA: f32 = 2.0;
const FAR: f32 = 3e38;

// Box of each invocation's pixels, then of ever more of them.
var<workgroup> low: array<vec3<f32>, CULL_WORKGROUP>;
var<workgroup> high: array<vec3<f32>, CULL_WORKGROUP>;
// Smallest alpha of a glossy pixel, or NO_ALPHA.
var<workgroup> alpha: array<f32, CULL_WORKGROUP>;
// All words of the tile's mask, one over the other.
var<workgroup> any_light: atomic<u32>;
// Lights of each class below the cutoff, and the first class that the tile drops.
var<workgroup> classes: array<atomic<u32>, CUTOFF_CLASSES>;
var<workgroup> first_dropped: u32;

const KEPT: u32 = 0u;
const OUT_OF_RANGE: u32 = 1u;
const TURNED_AWAY: u32 = 2u;
const BELOW_CUTOFF: u32 = 3u;
const ON_OTHER_LAYERS: u32 = 4u;

struct Verdict {
    verdict: u32,
    // How little a light that is kept may bring, as a class below the cutoff.
    below: u32,
}

fn judge(light: AreaLight, box_min: vec3<f32>, box_max: vec3<f32>, alpha_min: f32) -> Verdict {
    if (light.render_layers & area_view.render_layers) == 0u {
        return Verdict(ON_OTHER_LAYERS, CUTOFF_CLASSES);
    }
    if area_view.culling == 0u {
        return Verdict(KEPT, CUTOFF_CLASSES);
    }
    let center = rotate_to_view(view, light.center_ws - view.world_position);
    if light.inverse_range_squared > 0.0 {
        let range_center = rotate_to_view(view, light.range_center_ws - view.world_position);
        if sphere_touches_box(range_center, inverseSqrt(light.inverse_range_squared), box_min, box_max) == 0u {
            return Verdict(OUT_OF_RANGE, CUTOFF_CLASSES);
        }
    }
    let normal = rotate_to_view(view, light.normal_ws);
    let plane = vec4(normal, -dot(normal, center));
    let two_sided = (light.flags & FLAG_TWO_SIDED) != 0u;
    if !two_sided && box_behind_plane(box_min, box_max, plane) != 0u {
        return Verdict(TURNED_AWAY, CUTOFF_CLASSES);
    }
    if light.inverse_range_squared == 0.0 && area_view.cutoff > 0.0 {
        var height = box_plane_distance(box_min, box_max, plane);
        if two_sided {
            height = max(height, box_plane_distance(box_min, box_max, -plane));
        }
        let distance_squared = box_distance_squared(center, box_min, box_max);
        let solid_angle = solid_angle_bound(light.area, light.radius, distance_squared, height);
        let radiance = max(max(light.radiance.r, light.radiance.g), light.radiance.b) * view.exposure;
        var bound = radiance * form_factor_bound(solid_angle);
        if alpha_min < NO_ALPHA {
            bound = contribution_bound(radiance, solid_angle, alpha_min);
        }
        return Verdict(KEPT, cutoff_class(bound / area_view.cutoff));
    }
    return Verdict(KEPT, CUTOFF_CLASSES);
}

// The first class of which all lights may go, and all of those below: what they may bring together is within the cutoff.
fn class_to_drop() -> u32 {
    var lost = 0.0;
    for (var dropped = CUTOFF_CLASSES; dropped > 0u; dropped--) {
        let class_ = dropped - 1u;
        lost += f32(atomicLoad(&classes[class_])) * cutoff_class_edge(class_);
        if lost > 1.0 {
            return dropped;
        }
    }
    return 0u;
}

@compute @workgroup_size(CULL_WORKGROUP, 1, 1)
fn cull(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let origin = vec2<u32>(view.viewport.xy) + tile.xy * TILE_SIZE;
    let end = vec2<u32>(view.viewport.xy + view.viewport.zw);

    var box_min = vec3(FAR);
    var box_max = vec3(-FAR);
    var alpha_min = NO_ALPHA;
    for (var i = invocation; i < TILE_SIZE * TILE_SIZE; i += CULL_WORKGROUP) {
        let pixel = origin + vec2(i % TILE_SIZE, i / TILE_SIZE);
        if any(pixel >= end) {
            continue;
        }
        let depth = textureLoad(depth_texture, pixel, 0);
        if depth == 0.0 || textureLoad(pass_id_texture, pixel, 0).r != area_view.lighting_pass_id {
            continue;
        }
        let position = position_in_view(view, vec2<f32>(pixel) + 0.5, depth);
        box_min = min(box_min, position);
        box_max = max(box_max, position);
        let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
        let f90 = dielectric_f90_from_f0(dielectric_f0_from_reflectance(surface.reflectance));
        if surface.metallic > 0.0 || f90 > 0.0 {
            alpha_min = min(alpha_min, surface.perceptual_roughness * surface.perceptual_roughness);
        }
        if surface.clearcoat > 0.0 {
            let coat = surface.clearcoat_perceptual_roughness;
            alpha_min = min(alpha_min, coat * coat);
        }
    }
    low[invocation] = box_min;
    high[invocation] = box_max;
    alpha[invocation] = alpha_min;
    // Bevy asks for workgroup memory as it is found.
    if invocation == 0u {
        atomicStore(&any_light, 0u);
        first_dropped = CUTOFF_CLASSES;
    }
    for (var class_ = invocation; class_ < CUTOFF_CLASSES; class_ += CULL_WORKGROUP) {
        atomicStore(&classes[class_], 0u);
    }
    for (var stride = CULL_WORKGROUP / 2u; stride > 0u; stride /= 2u) {
        workgroupBarrier();
        if invocation < stride {
            low[invocation] = min(low[invocation], low[invocation + stride]);
            high[invocation] = max(high[invocation], high[invocation + stride]);
            alpha[invocation] = min(alpha[invocation], alpha[invocation + stride]);
        }
    }
    workgroupBarrier();
    box_min = low[0];
    box_max = high[0];
    alpha_min = alpha[0];
    let empty = box_min.x > box_max.x;

    // First the lights of each class are counted, then those that are left are written. Each invocation writes whole words of
    // the mask, so that no two of them touch the same one. One place judges, since compilers copy it to each.
    var counts = vec4(0u);
    let first_word = (tile.y * area_view.tiles_x + tile.x) * area_view.words_per_tile;
    let has_cutoff = area_view.cutoff > 0.0 && area_view.culling != 0u;
    for (var writes = select(1u, 0u, has_cutoff); writes < 2u; writes++) {
        for (var word = invocation; word < area_view.words_per_tile; word += CULL_WORKGROUP) {
            var mask = 0u;
            if !empty {
                let first = word * LIGHTS_PER_WORD;
                let count = min(area_view.light_count - min(first, area_view.light_count), LIGHTS_PER_WORD);
                for (var bit = 0u; bit < count; bit++) {
                    let judged = judge(lights[first + bit], box_min, box_max, alpha_min);
                    if writes == 0u {
                        if judged.below < CUTOFF_CLASSES {
                            atomicAdd(&classes[judged.below], 1u);
                        }
                        continue;
                    }
                    var result = judged.verdict;
                    if judged.below < CUTOFF_CLASSES && judged.below >= first_dropped {
                        result = BELOW_CUTOFF;
                    }
                    if result == KEPT {
                        mask |= 1u << bit;
                    }
                    counts += select(vec4(0u), vec4(1u), vec4(result) == vec4(KEPT, OUT_OF_RANGE, TURNED_AWAY, BELOW_CUTOFF));
                }
            }
            if writes == 1u {
                masks[first_word + word] = mask;
                if mask != 0u {
                    atomicOr(&any_light, mask);
                }
            }
        }
        workgroupBarrier();
        if writes == 0u && invocation == 0u {
            first_dropped = class_to_drop();
        }
        workgroupBarrier();
    }
    if invocation == 0u && atomicLoad(&any_light) != 0u {
        lit_tiles[atomicAdd(&draw.instance_count, 1u)] = tile.x | (tile.y << TILE_COORDINATE_BITS);
        atomicAdd(&counters[COUNTER_LIT], 1u);
    }
    if !empty {
        if invocation == 0u {
            atomicAdd(&counters[COUNTER_TILES], 1u);
        }
        if any(counts != vec4(0u)) {
            atomicAdd(&counters[COUNTER_KEPT], counts.x);
            atomicAdd(&counters[COUNTER_OUT_OF_RANGE], counts.y);
            atomicAdd(&counters[COUNTER_TURNED_AWAY], counts.z);
            atomicAdd(&counters[COUNTER_BELOW_CUTOFF], counts.w);
        }
    }
}
