// Adds the light of all area lights to one pixel: load, call the formulas of `akari_math`, store. Drawn are the tiles that
// the culling pass listed.

#import bevy_render::view::View
#import akari_math::area_light::{
    diffuse_specular_combine, diffuse_transmission, range_falloff, surface_reflectance,
}
#import akari_math::frame::shading_frame
#import akari_math::ltc::lookup::diffuse_fresnel
#import akari_math::ltc::polygon::{
    LambertPolygon, LtcPolygon, lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new,
    ltc_polygon_add_edge, ltc_polygon_close, ltc_polygon_new,
}
#import akari_render::gbuffer::{Surface, position_relative, unpack_surface, view_direction}
#import akari_render::ltc_layer::{LtcLayer, ltc_layer}
#import akari_area_light::types::{
    AreaLight, AreaLightView, FLAG_TWO_SIDED, LIGHTS_PER_WORD, NO_TEXTURE, TILE_COORDINATE_BITS, TILE_CORNERS,
    TILE_SIZE,
}
#ifdef TEXTURED
#import akari_math::light_image::{footprint_position, light_image_footprint, light_image_lod}
#endif
#ifdef SHADOWS
#import akari_visibility::face::cube_from_world
#import akari_visibility::query::{
    Traversal, traversal_close, traversal_new, traversal_push, traversal_visibility,
}
#import akari_area_light::shadow_trees::{light_parts, next_piece, params, part_corner, part_size, slots}
#import akari_area_light::shadows::{Samples, interpolate_shadow, shadow_samples}
#endif
#ifdef MOVING_CASTERS
#import akari_math::convex_shadow::{
    box_shadow, clipped_polygon_new, clipped_polygon_push, sphere_shadow,
}
#import akari_area_light::shadow_types::MovingCaster
#import akari_area_light::shadows::moving
#endif

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> area_view: AreaLightView;
@group(0) @binding(2) var depth_texture: texture_depth_2d;
@group(0) @binding(3) var gbuffer_texture: texture_2d<u32>;
@group(0) @binding(4) var pass_id_texture: texture_2d<u32>;
@group(0) @binding(5) var<storage, read> lights: array<AreaLight>;
@group(0) @binding(6) var<storage, read> vertices: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read> masks: array<u32>;
@group(0) @binding(8) var ltc_table: texture_2d_array<f32>;
@group(0) @binding(9) var table_sampler: sampler;
#ifdef TEXTURED
@group(0) @binding(10) var light_images: texture_2d_array<f32>;
@group(0) @binding(11) var image_sampler: sampler;
#endif

#ifdef SOFT_SHADOWS
// As `GpuSoftLights` in `soft.rs`: for each byte of the words, the first light that it is of, and how many.
struct SoftLights {
    ranges: array<vec4<u32>, 4>,
}

@group(#{SOFT_GROUP}) @binding(0) var soft_shadows: texture_2d<u32>;
@group(#{SOFT_GROUP}) @binding(1) var<uniform> soft_lights: SoftLights;

// The part of a light that passes, of the bytes of a word; 1 if none of them is of this light.
fn soft_shadow(light: u32, word: u32) -> f32 {
    let passes = unpack4x8unorm(word);
    for (var k = 0u; k < 4u; k++) {
        if light - soft_lights.ranges[k].x < soft_lights.ranges[k].y {
            return passes[k];
        }
    }
    return 1.0;
}
#endif

// A two-sided light does not shine on its own plane: relative to its radius, a point closer than this lies on it up
// to the rounding of its depth.
const ON_LIGHT_PLANE: f32 = 1e-4;
// Fresnel reflectance of a clear coat at normal incidence (glTF KHR_materials_clearcoat: index of refraction 1.5).
const CLEARCOAT_F0: f32 = 0.04;
// Beyond all layer coordinates.
const FAR: f32 = 3e38;
// Rays of a look that grazes or passes below an interpolated normal see the surface as from this cosine.
const MIN_N_DOT_V: f32 = 1e-4;

// Look-ups along an elongated footprint of a light's image.
const SPREAD_LOOKUPS: u32 = 5u;

// A light as the pixel sees it.
struct SeenLight {
    // Centre relative to the shading point, along the axes of the world.
    center: vec3<f32>,
    // Radiance at the shading point: what the range leaves of it. 0 if the light does not reach the point.
    radiance: vec3<f32>,
    // -1 where the back is seen, whose corners run the other way round.
    side: f32,
}

fn see_light(light: AreaLight, position_rel: vec3<f32>) -> SeenLight {
    var seen: SeenLight;
    seen.center = (light.center_ws - view.world_position) - position_rel;
    seen.radiance = vec3(0.0);
    seen.side = 1.0;
    if (light.render_layers & area_view.render_layers) == 0u {
        return seen;
    }
    let height = -dot(light.normal_ws, seen.center);
    if (light.flags & FLAG_TWO_SIDED) != 0u {
        if abs(height) <= ON_LIGHT_PLANE * light.radius {
            return seen;
        }
        seen.side = sign(height);
    } else if height <= 0.0 {
        return seen;
    }
    let to_range_center = (light.range_center_ws - view.world_position) - position_rel;
    let falloff = range_falloff(dot(to_range_center, to_range_center), light.inverse_range_squared);
    seen.radiance = light.radiance * falloff;
    return seen;
}

// The colour that the light's image adds to an integral whose vector form factor points along `axis`, over a part of
// the light that is `cell_size` wide in layer coordinates.
fn light_color(light: AreaLight, seen: SeenLight, frame: mat3x3<f32>, m: mat3x3<f32>, m_inv: mat3x3<f32>, axis: vec3<f32>, cell_size: f32) -> vec3<f32> {
#ifdef TEXTURED
    if light.texture_layer != NO_TEXTURE {
        let footprint = light_image_footprint(
            axis * seen.side,
            m,
            m_inv,
            seen.center * frame,
            light.normal_ws * frame,
            vec4(light.texture_u.xyz * frame, light.texture_u.w),
            vec4(light.texture_v.xyz * frame, light.texture_v.w),
            cell_size,
        );
        let lod = light_image_lod(footprint.width, f32(textureDimensions(light_images).x));
        let count = select(1u, SPREAD_LOOKUPS, footprint.spread != 0u);
        var color = vec3(0.0);
        for (var i = 0u; i < count; i++) {
            let at = footprint.center + footprint.line * footprint_position(f32(i), f32(count));
            color += textureSampleLevel(light_images, image_sampler, at, light.texture_layer, lod).rgb;
        }
        return color / f32(count);
    }
#endif
    return vec3(1.0);
}

// Corners of a square's two triangles, counter-clockwise on a screen whose y points down.
const CORNERS = array<vec2<u32>, TILE_CORNERS>(
    vec2(0u, 0u), vec2(0u, 1u), vec2(1u, 0u),
    vec2(1u, 0u), vec2(0u, 1u), vec2(1u, 1u),
);

// The square of one lit tile. What reaches beyond the viewport is clipped.
@vertex
fn vertex(@location(0) tile: u32, @builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    var corners = CORNERS;
    let at = vec2(tile & ((1u << TILE_COORDINATE_BITS) - 1u), tile >> TILE_COORDINATE_BITS) + corners[index];
    let uv = vec2<f32>(at * TILE_SIZE) / view.viewport.zw;
    return vec4(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let depth = textureLoad(depth_texture, pixel, 0);
    // Reverse z: 0 is the background.
    if depth == 0.0 || textureLoad(pass_id_texture, pixel, 0).r != area_view.lighting_pass_id {
        discard;
    }
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    if surface.unlit {
        discard;
    }
    let position_rel = position_relative(view, position.xy, depth);
    let view_ws = view_direction(view, position_rel);
    let frame = shading_frame(surface.normal_ws, view_ws);
    let n_dot_v = clamp(dot(surface.normal_ws, view_ws), MIN_N_DOT_V, 1.0);

    let reflectance = surface_reflectance(surface.base_color, surface.metallic, surface.reflectance);
    let base = ltc_layer(ltc_table, table_sampler, surface.perceptual_roughness, n_dot_v, reflectance.normal_reflectance, reflectance.grazing_reflectance);
    let diffuse_albedo = reflectance.diffuse_color
        * diffuse_transmission(vec3(reflectance.dielectric_normal_reflectance), reflectance.dielectric_grazing_reflectance, diffuse_fresnel(n_dot_v));
    let glossy = reflectance.grazing_reflectance > 0.0;

    var coat: LtcLayer;
    var coat_transmission = 1.0;
    if surface.clearcoat > 0.0 {
        coat = ltc_layer(ltc_table, table_sampler, surface.clearcoat_perceptual_roughness, n_dot_v, vec3(CLEARCOAT_F0), 1.0);
        coat.albedo *= surface.clearcoat;
        coat_transmission = 1.0 - surface.clearcoat * (CLEARCOAT_F0 + (1.0 - CLEARCOAT_F0) * diffuse_fresnel(n_dot_v));
    }

#ifdef SHADOWS
    let samples = shadow_samples(view.world_position, pixel, position_rel, view_ws);
    let by_pieces = surface.perceptual_roughness <= params.pieces_roughness
        || (surface.clearcoat > 0.0 && surface.clearcoat_perceptual_roughness <= params.pieces_roughness);
#endif
#ifdef SOFT_SHADOWS
    let soft = textureLoad(soft_shadows, pixel, 0).xy;
#endif
    let tile = (vec2<u32>(position.xy) - vec2<u32>(view.viewport.xy)) / TILE_SIZE;
    let first_word = (tile.y * area_view.tiles_x + tile.x) * area_view.words_per_tile;
    var radiance = vec3(0.0);
    for (var word = 0u; word < area_view.words_per_tile; word++) {
        var mask = masks[first_word + word];
        // Lowest bit first, so that lights are summed in the same order whatever was culled.
        while mask != 0u {
            let bit = firstTrailingBit(mask);
            mask &= mask - 1u;
            let light = lights[word * LIGHTS_PER_WORD + bit];
            let seen = see_light(light, position_rel);
            if all(seen.radiance == vec3(0.0)) {
                continue;
            }
            var arrives = 1.0;
#ifdef SHADOWS
            if samples.count > 0u {
                var lit_samples = samples;
                let shadow = interpolate_shadow(&lit_samples, word * LIGHTS_PER_WORD + bit);
                arrives = shadow.ratio;
                if shadow.highest <= 0.0 {
                    continue;
                }
                var passes = 1.0;
#ifdef SOFT_BY_CASTER
                passes = soft_shadow(word * LIGHTS_PER_WORD + bit, soft.y);
                if passes <= 0.0 {
                    continue;
                }
#endif
#ifdef MOVING_CASTERS
                passes *= moving_casters_pass(light, seen, position_rel, frame);
                if passes <= 0.0 {
                    continue;
                }
#endif
                arrives *= passes;
                let in_penumbra = shadow.highest > params.penumbra_threshold
                    && shadow.lowest < 1.0 - params.penumbra_threshold;
                if by_pieces && in_penumbra {
                    let lit = shade_pieces(light, seen, position_rel, frame, base, coat, surface.clearcoat > 0.0, lit_samples);
                    radiance += diffuse_specular_combine(
                        passes * seen.radiance, diffuse_albedo * lit.diffuse, coat_transmission,
                        base.albedo * lit.specular, coat_transmission,
                    );
                    radiance += passes * seen.radiance * coat.albedo * lit.coat;
                    continue;
                }
            }
#endif
#ifdef SOFT_SHADOWS
#ifdef SHADOWS
            let in_no_bake = samples.count == 0u;
#else
            let in_no_bake = true;
#endif
            if in_no_bake {
                arrives = soft_shadow(word * LIGHTS_PER_WORD + bit, soft.x);
                if arrives <= 0.0 {
                    continue;
                }
            }
#endif
            var lit = shade_light(light, seen, frame, base, diffuse_albedo, glossy) * coat_transmission;
            if surface.clearcoat > 0.0 {
                lit += shade_light(light, seen, frame, coat, vec3(0.0), true);
            }
            radiance += arrives * lit;
        }
    }
    return vec4(radiance * view.exposure, 0.0);
}

// Radiance that one light sends to the camera by way of one layer.
fn shade_light(light: AreaLight, seen: SeenLight, frame: mat3x3<f32>, layer: LtcLayer, diffuse_albedo: vec3<f32>, glossy: bool) -> vec3<f32> {
    let identity = mat3x3<f32>(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0));
    let last = light.vertex_offset + light.vertex_count - 1u;
    // world · frame (vector times matrix) multiplies by the transpose: world to shading space.
    var a = (seen.center + vertices[last].xyz) * frame;
    if !glossy {
        var polygon = lambert_polygon_new();
        for (var i = 0u; i < light.vertex_count; i++) {
            let b = (seen.center + vertices[light.vertex_offset + i].xyz) * frame;
            lambert_polygon_add_edge(&polygon, a, b);
            a = b;
        }
        lambert_polygon_close(&polygon);
        let integral = max(polygon.diffuse.z * seen.side, 0.0);
        let color = light_color(light, seen, frame, identity, identity, polygon.diffuse, light.cell_size);
        return seen.radiance * color * diffuse_albedo * integral;
    }
    var polygon = ltc_polygon_new();
    for (var i = 0u; i < light.vertex_count; i++) {
        let b = (seen.center + vertices[light.vertex_offset + i].xyz) * frame;
        ltc_polygon_add_edge(&polygon, layer.m_inv, a, b);
        a = b;
    }
    ltc_polygon_close(&polygon, layer.m_inv);
    let form_factor = polygon.diffuse * seen.side;
    let diffuse = max(form_factor.z, 0.0);
    // `ltc_specular_integral`, but each part with the colour of the image where it gathers its light.
    let lobe = layer.lobe_weight * max(polygon.specular.z * seen.side, 0.0);
    let tail = dot(layer.tail, form_factor.zx);
    let diffuse_color = light_color(light, seen, frame, identity, identity, polygon.diffuse, light.cell_size);
    let specular_color = light_color(light, seen, frame, layer.m, layer.m_inv, polygon.specular, light.cell_size);
    let specular = max(specular_color * lobe + diffuse_color * tail, vec3(0.0));
    return diffuse_specular_combine(
        seen.radiance,
        diffuse_albedo * diffuse_color,
        diffuse,
        layer.albedo * specular,
        1.0,
    );
}

#ifdef SHADOWS
// What the pieces of a light that a pixel's samples see add up to, for a radiance of 1, with the colours of its image.
struct LitPieces {
    // Form factor.
    diffuse: vec3<f32>,
    // Specular integrals of the base layer and of the clear coat.
    specular: vec3<f32>,
    coat: vec3<f32>,
}

// The specular integral over a closed polygon, with the colours where it gathers its light. Not bounded below: pieces
// are added first, and those of a fan have signs.
fn specular_color_integral(light: AreaLight, seen: SeenLight, frame: mat3x3<f32>, layer: LtcLayer, polygon: LtcPolygon, diffuse_color: vec3<f32>, size: f32) -> vec3<f32> {
    let lobe = layer.lobe_weight * polygon.specular.z * seen.side;
    let tail = dot(layer.tail, polygon.diffuse.zx * seen.side);
    let color = light_color(light, seen, frame, layer.m, layer.m_inv, polygon.specular, size);
    return color * lobe + diffuse_color * tail;
}

// The light in the trees of each sample, piece by piece with the BRDF of the pixel.
//
// With `parallax`, a sample is asked what it sees of the light, and the pixel is lit by that part of the light: exact
// where blockers touch the light, and nowhere is a point of the light taken for another. Without, the sample is asked
// about the directions in which the pixel sees the light: exact for blockers that are far away.
fn shade_pieces(
    light: AreaLight,
    seen: SeenLight,
    position_rel: vec3<f32>,
    frame: mat3x3<f32>,
    base: LtcLayer,
    coat: LtcLayer,
    has_coat: bool,
    samples: Samples,
) -> LitPieces {
    var lit: LitPieces;
    let identity = mat3x3<f32>(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0));
    // Pieces come along the axes of the cubes: world to shading space by way of them.
    let cube_frame = mat3x3<f32>(cube_from_world(frame[0]), cube_from_world(frame[1]), cube_from_world(frame[2]));
    let across = cube_from_world(light.texture_u.xyz);
    let down = cube_from_world(light.texture_v.xyz);
    for (var k = 0u; k < samples.count; k++) {
        if samples.weights[k] == 0.0 {
            continue;
        }
        let slot = samples.slots[k];
        // From the sample to the pixel.
        var offset = position_rel - (slots[slot].position - view.world_position);
        if params.parallax == 0u {
            offset = vec3(0.0);
        }
        let back = cube_from_world(offset);
        for (var part = 0u; part < light_parts(light.vertex_count); part++) {
            var t = traversal_new();
            for (var i = 0u; i < part_size(light.vertex_count, part); i++) {
                let corner = seen.center + offset + vertices[light.vertex_offset + part_corner(part, i)].xyz;
                traversal_push(&t, cube_from_world(corner));
            }
            traversal_close(&t);
            var face = 0u;
            while next_piece(&t, &face, slot) {
                let weight = samples.weights[k] * traversal_visibility(&t);
                var polygon = ltc_polygon_new();
                var a = (t.vertices[t.first + t.count - 1u] - back) * cube_frame;
                var low = vec2(FAR);
                var high = vec2(-FAR);
                for (var i = 0u; i < t.count; i++) {
                    let at = vec2(dot(across, t.vertices[t.first + i]), dot(down, t.vertices[t.first + i]));
                    low = min(low, at);
                    high = max(high, at);
                    let b = (t.vertices[t.first + i] - back) * cube_frame;
                    ltc_polygon_add_edge(&polygon, base.m_inv, a, b);
                    a = b;
                }
                ltc_polygon_close(&polygon, base.m_inv);
                // No wider than the piece: it has the colour of its own part of the image.
                let size = min(light.cell_size, max(high.x - low.x, high.y - low.y));
                let diffuse_color = light_color(light, seen, frame, identity, identity, polygon.diffuse, size);
                lit.diffuse += weight * seen.side * polygon.diffuse.z * diffuse_color;
                lit.specular += weight * specular_color_integral(light, seen, frame, base, polygon, diffuse_color, size);
                if has_coat {
                    var over = ltc_polygon_new();
                    a = (t.vertices[t.first + t.count - 1u] - back) * cube_frame;
                    for (var i = 0u; i < t.count; i++) {
                        let b = (t.vertices[t.first + i] - back) * cube_frame;
                        ltc_polygon_add_edge(&over, coat.m_inv, a, b);
                        a = b;
                    }
                    ltc_polygon_close(&over, coat.m_inv);
                    lit.coat += weight * specular_color_integral(light, seen, frame, coat, over, diffuse_color, size);
                }
            }
        }
    }
    lit.diffuse = max(lit.diffuse, vec3(0.0));
    lit.specular = max(lit.specular, vec3(0.0));
    lit.coat = max(lit.coat, vec3(0.0));
    return lit;
}
#endif

#ifdef MOVING_CASTERS
// Slack of the test whether a body can hide anything of a light, as a cosine.
const CONE_SLACK: f32 = 1e-3;

// Whether the body may stand between the pixel and the light: whether the cones about the two touch.
fn may_hide(caster: MovingCaster, light: AreaLight, seen: SeenLight, position_rel: vec3<f32>) -> bool {
    let to_body = caster.bounds.xyz - view.world_position - position_rel;
    let to_light = seen.center;
    let body_sine = caster.bounds.w / max(length(to_body), caster.bounds.w);
    let light_sine = light.radius / max(length(to_light), light.radius);
    let body_cosine = sqrt(1.0 - body_sine * body_sine);
    let light_cosine = sqrt(1.0 - light_sine * light_sine);
    // The cosine of the sum of the half angles; beyond a right angle together, they are taken to touch.
    let limit = body_cosine * light_cosine - body_sine * light_sine;
    let cosine = dot(to_body, to_light) / max(length(to_body) * length(to_light), 1e-30);
    return limit <= 0.0 || cosine >= limit - CONE_SLACK;
}

// Share of the light's irradiance that passes the bodies which stand in for moving things.
fn moving_casters_pass(light: AreaLight, seen: SeenLight, position_rel: vec3<f32>, frame: mat3x3<f32>) -> f32 {
    var passes = 1.0;
    // Of the whole light, once it is needed.
    var whole = -1.0;
    let position_ws = vec4(view.world_position + position_rel, 1.0);
    for (var k = 0u; k < moving.count; k++) {
        let caster = moving.casters[k];
        if !may_hide(caster, light, seen, position_rel) {
            continue;
        }
        let apex = vec3(dot(caster.unit_x, position_ws), dot(caster.unit_y, position_ws), dot(caster.unit_z, position_ws));
        let is_box = caster.world_x.w > 0.5;
        let find_whole = whole < 0.0;
        whole = max(whole, 0.0);
        var hidden = 0.0;
        for (var part = 0u; part < light_parts(light.vertex_count); part++) {
            let count = part_size(light.vertex_count, part);
            var polygon = clipped_polygon_new();
            var all = lambert_polygon_new();
            var a = seen.center + vertices[light.vertex_offset + part_corner(part, count - 1u)].xyz;
            for (var i = 0u; i < count; i++) {
                let b = seen.center + vertices[light.vertex_offset + part_corner(part, i)].xyz;
                clipped_polygon_push(&polygon, vec3(dot(caster.unit_x.xyz, b), dot(caster.unit_y.xyz, b), dot(caster.unit_z.xyz, b)));
                lambert_polygon_add_edge(&all, a * frame, b * frame);
                a = b;
            }
            if find_whole {
                lambert_polygon_close(&all);
                whole += seen.side * all.diffuse.z;
            }
            if is_box {
                box_shadow(&polygon, apex);
            } else {
                sphere_shadow(&polygon, apex);
            }
            if polygon.count < 3u {
                continue;
            }
            let world_from_unit = mat3x3<f32>(caster.world_x.xyz, caster.world_y.xyz, caster.world_z.xyz);
            var dark = lambert_polygon_new();
            var p = world_from_unit * polygon.vertices[polygon.count - 1u];
            for (var i = 0u; i < polygon.count; i++) {
                let q = world_from_unit * polygon.vertices[i];
                lambert_polygon_add_edge(&dark, p * frame, q * frame);
                p = q;
            }
            lambert_polygon_close(&dark);
            hidden += seen.side * dark.diffuse.z;
        }
        if whole > 0.0 {
            passes *= 1.0 - saturate(hidden / whole);
        }
    }
    return passes;
}
#endif
