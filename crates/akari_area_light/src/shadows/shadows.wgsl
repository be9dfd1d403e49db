#define_import_path akari_area_light::shadows

// From a pixel to the samples of its triangle, and their shadow ratios.

#import akari_visibility::grid::{ENTRY_HANGING, grid_triangle, micro_triangle}
#import akari_area_light::shadow_types::{RECEIVER_MIRRORED, RECEIVER_TWO_SIDED, Receiver}
#ifdef MOVING_CASTERS
#import akari_area_light::shadow_types::MovingCasters
#endif
#import akari_area_light::shadow_trees::params

@group(1) @binding(3) var<storage, read> ratios: array<f32>;
@group(1) @binding(4) var<storage, read> receivers: array<Receiver>;
@group(1) @binding(5) var<storage, read> entries: array<u32>;
@group(1) @binding(6) var receiver_texture: texture_2d<u32>;
#ifdef MOVING_CASTERS
@group(1) @binding(7) var<uniform> moving: MovingCasters;
#endif

// Two for each corner of a cell of the sample grid.
const MOST_SAMPLES: u32 = 6u;
// A sample that counts less than this is left out.
const SMALLEST_WEIGHT: f32 = 1e-4;
// As in `receivers.wgsl`, for pixels at the rim of a triangle.
const ON_TRIANGLE: f32 = 2e-5;

// The samples that a pixel is interpolated from; none on what was not baked.
struct Samples {
    count: u32,
    slots: array<u32, MOST_SAMPLES>,
    weights: array<f32, MOST_SAMPLES>,
}

// What samples know of a light.
struct Shadow {
    // Interpolated share of the light's irradiance that arrives.
    ratio: f32,
    // Smallest and largest share of the samples.
    lowest: f32,
    highest: f32,
}

fn add_sample(samples: ptr<function, Samples>, slot: u32, weight: f32) {
    if weight > SMALLEST_WEIGHT {
        (*samples).slots[(*samples).count] = slot;
        (*samples).weights[(*samples).count] = weight;
        (*samples).count += 1u;
    }
}

// The triangle at a pixel, counted from 1. Bevy draws a pixel at the rim of a mesh that the receivers' pass may miss by
// rounding: then the triangle of a neighbour, if the pixel lies in its plane.
fn receiver_number(world_position: vec3<f32>, pixel: vec2<i32>, position_rel: vec3<f32>) -> u32 {
    let here = textureLoad(receiver_texture, pixel, 0).r;
    if here != 0u {
        return here;
    }
    let last = vec2<i32>(textureDimensions(receiver_texture)) - 1;
    for (var i = 0; i < 4; i++) {
        let step = select(vec2(0, 2 * i - 5), vec2(2 * i - 1, 0), i < 2);
        let number = textureLoad(receiver_texture, clamp(pixel + step, vec2(0), last), 0).r;
        if number == 0u {
            continue;
        }
        let receiver = receivers[number - 1u];
        let normal = normalize(cross(receiver.b - receiver.a, receiver.c - receiver.a));
        let height = dot(normal, position_rel - (receiver.a - world_position));
        let reach = max(max(abs(receiver.a.x), abs(receiver.a.y)), abs(receiver.a.z));
        if abs(height) <= ON_TRIANGLE * (length(position_rel) + reach) {
            return number;
        }
    }
    return 0u;
}

fn shadow_samples(world_position: vec3<f32>, pixel: vec2<i32>, position_rel: vec3<f32>, view_ws: vec3<f32>) -> Samples {
    var samples: Samples;
    let number = receiver_number(world_position, pixel, position_rel);
    if number == 0u {
        return samples;
    }
    let receiver = receivers[number - 1u];
    let ab = receiver.b - receiver.a;
    let ac = receiver.c - receiver.a;
    let ap = position_rel - (receiver.a - world_position);
    let normal = cross(ab, ac);
    // Only triangles with an area are drawn.
    let scale = 1.0 / max(dot(normal, normal), 1e-37);
    let v = dot(cross(ap, ac), normal) * scale;
    let w = dot(cross(ab, ap), normal) * scale;
    let grid = grid_triangle(receiver.grid);
    let cell = micro_triangle(grid.level, vec3(1.0 - v - w, v, w));
    // The slot of the back stands after that of the front.
    let front = select(1.0, -1.0, (receiver.flags & RECEIVER_MIRRORED) != 0u);
    let sees_back = front * dot(normal, view_ws) < 0.0;
    let back = select(0u, 1u, (receiver.flags & RECEIVER_TWO_SIDED) != 0u && sees_back);
    for (var i = 0u; i < 3u; i++) {
        let entry = entries[grid.first + cell.samples[i]];
        if (entry & ENTRY_HANGING) == 0u {
            add_sample(&samples, entry + back, cell.weights[i]);
        } else {
            let word = params.hanging_offset + 3u * (entry & ~ENTRY_HANGING);
            let second = bitcast<f32>(entries[word + 2u]);
            add_sample(&samples, entries[word] + back, cell.weights[i] * (1.0 - second));
            add_sample(&samples, entries[word + 1u] + back, cell.weights[i] * second);
        }
    }
    return samples;
}

// What the samples of a pixel know of a light; their weights become those for this light, of sum 1. A sample that no
// light reaches, whatever stands before it, says nothing; if none of them says anything, the surface itself hides the
// light.
fn interpolate_shadow(samples: ptr<function, Samples>, light: u32) -> Shadow {
    var sum = 0.0;
    var shadow = Shadow(0.0, 1.0, 0.0);
    for (var i = 0u; i < (*samples).count; i++) {
        let ratio = ratios[light * params.slot_count + (*samples).slots[i]];
        if ratio < 0.0 {
            (*samples).weights[i] = 0.0;
            continue;
        }
        sum += (*samples).weights[i];
        shadow.ratio += (*samples).weights[i] * ratio;
        shadow.lowest = min(shadow.lowest, ratio);
        shadow.highest = max(shadow.highest, ratio);
    }
    if sum > 0.0 {
        shadow.ratio /= sum;
        for (var i = 0u; i < (*samples).count; i++) {
            (*samples).weights[i] /= sum;
        }
    }
    return shadow;
}
