// The share of each light's irradiance that each sample receives: one invocation for a slot and a light. Runs for the
// lights that have moved, and for nothing else.

#import akari_math::frame::orthonormal_basis
#import akari_math::ltc::polygon::{LambertPolygon, lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new}
#import akari_math::octahedral::octahedral_unpack
#import akari_visibility::face::cube_from_world
#import akari_visibility::query::{
    Traversal, traversal_close, traversal_new, traversal_push, traversal_visibility,
}
#import akari_area_light::types::{AreaLight, FLAG_TWO_SIDED}
#import akari_area_light::shadow_types::RATIO_WORKGROUP
#import akari_area_light::shadow_trees::{light_parts, next_piece, params, part_corner, part_size, slots}

@group(0) @binding(0) var<storage, read> lights: array<AreaLight>;
@group(0) @binding(1) var<storage, read> vertices: array<vec4<f32>>;
// Indices of the lights that have moved.
@group(0) @binding(2) var<storage, read> moved: array<u32>;
@group(0) @binding(3) var<storage, read_write> ratios: array<f32>;

// No light arrives, with or without shadows: says nothing about its neighbourhood.
const NO_LIGHT: f32 = -1.0;

// Shadow ratio of a light: what arrives of its irradiance, 0 to 1, or NO_LIGHT.
fn shadow_ratio(slot: u32, light: AreaLight) -> f32 {
    let center = light.center_ws - slots[slot].position;
    let height = -dot(light.normal_ws, center);
    if height <= 0.0 && (light.flags & FLAG_TWO_SIDED) == 0u {
        return NO_LIGHT;
    }
    let side = select(-1.0, 1.0, height > 0.0);
    // In the axes of the sample's cube.
    let frame = orthonormal_basis(cube_from_world(octahedral_unpack(slots[slot].normal)));
    var whole = 0.0;
    var visible = 0.0;
    for (var part = 0u; part < light_parts(light.vertex_count); part++) {
        let count = part_size(light.vertex_count, part);
        var t = traversal_new();
        var polygon = lambert_polygon_new();
        var a = cube_from_world(center + vertices[light.vertex_offset + part_corner(part, count - 1u)].xyz);
        for (var i = 0u; i < count; i++) {
            let b = cube_from_world(center + vertices[light.vertex_offset + part_corner(part, i)].xyz);
            traversal_push(&t, b);
            lambert_polygon_add_edge(&polygon, a * frame, b * frame);
            a = b;
        }
        traversal_close(&t);
        lambert_polygon_close(&polygon);
        whole += side * polygon.diffuse.z;
        var face = 0u;
        while next_piece(&t, &face, slot) {
            var piece = lambert_polygon_new();
            var p = t.vertices[t.first + t.count - 1u];
            for (var i = 0u; i < t.count; i++) {
                let q = t.vertices[t.first + i];
                lambert_polygon_add_edge(&piece, p * frame, q * frame);
                p = q;
            }
            lambert_polygon_close(&piece);
            visible += side * traversal_visibility(&t) * piece.diffuse.z;
        }
    }
    if whole <= 0.0 {
        return NO_LIGHT;
    }
    return saturate(visible / whole);
}

@compute @workgroup_size(RATIO_WORKGROUP, 1, 1)
fn ratio(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
) {
    let light = moved[id.y];
    for (var slot = id.x; slot < params.slot_count; slot += workgroups.x * RATIO_WORKGROUP) {
        ratios[light * params.slot_count + slot] = shadow_ratio(slot, lights[light]);
    }
}
