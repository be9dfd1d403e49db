// A noisy signal, as any renderer with a few rays a pixel makes it: reflections of emissive rectangles and spheres, by
// directions that are drawn at random from the GGX lobe of each surface.
//
// `trace` fills the images of the signal, one texel per block of pixels. `retrace` shades the pixels that the denoiser
// lists because samples and history together are too few there.

#import akari_lobes::guides::{gbuffer_texture, load_surface_guide, view}
#import akari_math::area_light::surface_reflectance
#import akari_math::frame::shading_frame
#import akari_math::ggx::{fresnel_schlick, smith_masking, smith_masking_shadowing}
#import akari_math::reprojection::sample_offset
#import akari_render::gbuffer::unpack_surface

// As `GpuReflections` in `stochastic.rs`.
struct Reflections {
    // Pixels of the full resolution.
    size: vec2<u32>,
    // Pixels per texel of the signal and axis.
    scale: u32,
    // Counts up with each frame.
    frame: u32,
    // Rays a texel, and rays a pixel that is shaded again.
    samples: u32,
    samples_again: u32,
    // Elements of `shapes` that count.
    shapes: u32,
}

// As `GpuShape`. A sphere has a radius; a rectangle has none, and shines to the side of cross(axis_x, axis_y).
struct Shape {
    center: vec3<f32>,
    radius: f32,
    // Unit axis, half of the side along it.
    axis_x: vec3<f32>,
    half_x: f32,
    axis_y: vec3<f32>,
    half_y: f32,
    radiance: vec3<f32>,
}

@group(1) @binding(0) var<uniform> reflections: Reflections;
@group(1) @binding(1) var<storage, read> shapes: array<Shape>;
// `trace` only.
@group(1) @binding(2) var radiance_out: texture_storage_2d<rgba16float, write>;
@group(1) @binding(3) var hit_distance_out: texture_storage_2d<r32float, write>;
// `retrace` only: see `ResampleList` in `akari_render::signals`.
@group(1) @binding(4) var<storage, read> listed: array<u32>;
@group(1) @binding(5) var<storage, read_write> shaded: array<vec4<f32>>;

// Words of `listed` before its pixels.
const LIST_HEADER: u32 = 4u;
// The samples of `retrace` continue the sequence far behind those of `trace`, so that no number is drawn twice.
const AGAIN: u32 = 0x10000u;
// Farthest hit, metres.
const MAX_DISTANCE: f32 = 1e6;
// Rays start this far from the surface, relative to the distance from the camera: ten roundings of a position.
const START: f32 = 1e-6;
// Smallest cosine between normal and view: interpolated normals may face away.
const MIN_N_DOT_V: f32 = 1e-4;
const TWO_PI: f32 = 6.2831853;

// Two numbers of [0, 1), for each pixel, frame and sample others: the hash pcg3d of Jarzynski and Olano 2020, "Hash
// Functions for GPU Rendering".
fn random(pixel: vec2<u32>, index: u32) -> vec2<f32> {
    var v = vec3(pixel.x | (pixel.y << 16u), reflections.frame, index);
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    // 24 bits, as many as f32 holds.
    return vec2<f32>(v.xy >> vec2(8u)) / 16777216.0;
}

// A microfacet normal as often as the view sees it, around z: Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with
// Spherical Caps".
fn sample_visible_normal(view_local: vec3<f32>, alpha: f32, random: vec2<f32>) -> vec3<f32> {
    // Stretched, the ellipsoid of the microfacets is a sphere, whose mirror directions cover a cap evenly.
    let stretched = normalize(vec3(alpha * view_local.xy, view_local.z));
    let z = (1.0 - random.y) * (1.0 + stretched.z) - stretched.z;
    let sine = sqrt(saturate(1.0 - z * z));
    let angle = TWO_PI * random.x;
    let half_vector = vec3(sine * cos(angle), sine * sin(angle), z) + stretched;
    // Normals go back by the inverse transpose of the stretching.
    return normalize(vec3(alpha * half_vector.xy, max(half_vector.z, 1e-12)));
}

// Distance along a ray to a shape's front, at least `start`; `MAX_DISTANCE` if there is none.
fn intersect(shape: Shape, origin: vec3<f32>, direction: vec3<f32>, start: f32) -> f32 {
    let to_center = shape.center - view.world_position - origin;
    let along = dot(to_center, direction);
    if shape.radius > 0.0 {
        // From the point of the ray that is next to the centre: the difference of squares of large numbers would cancel.
        let nearest = to_center - along * direction;
        let discriminant = shape.radius * shape.radius - dot(nearest, nearest);
        let distance = along - sqrt(max(discriminant, 0.0));
        return select(MAX_DISTANCE, distance, discriminant > 0.0 && distance > start);
    }
    let normal = cross(shape.axis_x, shape.axis_y);
    let facing = dot(normal, direction);
    // Rectangles have no back, like the faces of a mesh.
    if facing >= -1e-6 {
        return MAX_DISTANCE;
    }
    let distance = dot(normal, to_center) / facing;
    let place = distance * direction - to_center;
    let inside = abs(dot(place, shape.axis_x)) <= shape.half_x && abs(dot(place, shape.axis_y)) <= shape.half_y;
    return select(MAX_DISTANCE, distance, inside && distance > start);
}

struct Hit {
    radiance: vec3<f32>,
    distance: f32,
}

// What a ray sees: the nearest shape, or black.
fn cast_ray(origin: vec3<f32>, direction: vec3<f32>, start: f32) -> Hit {
    var hit = Hit(vec3(0.0), MAX_DISTANCE);
    for (var i = 0u; i < reflections.shapes; i++) {
        let distance = intersect(shapes[i], origin, direction, start);
        if distance < hit.distance {
            hit = Hit(shapes[i].radiance, distance);
        }
    }
    return hit;
}

struct Reflected {
    // In the unit of the view target.
    radiance: vec3<f32>,
    // Mean distance of what was hit, metres; 0 if nothing was.
    hit_distance: f32,
}

// Mean of so many samples of what the surface at a pixel reflects.
fn reflected(pixel: vec2<u32>, samples: u32, first: u32) -> Reflected {
    let guide = load_surface_guide(vec2<i32>(pixel));
    if !guide.valid {
        return Reflected(vec3(0.0), 0.0);
    }
    let surface = unpack_surface(textureLoad(gbuffer_texture, pixel, 0));
    let reflectance = surface_reflectance(surface.base_color, surface.metallic, surface.reflectance);
    let alpha = guide.perceptual_roughness * guide.perceptual_roughness;
    // Tangent, bitangent and normal; the view lies over the tangent.
    let frame = shading_frame(guide.normal_ws, guide.view_ws);
    let n_dot_v = max(dot(guide.normal_ws, guide.view_ws), MIN_N_DOT_V);
    let view_local = vec3(sqrt(saturate(1.0 - n_dot_v * n_dot_v)), 0.0, n_dot_v);
    let masking = smith_masking(n_dot_v, alpha);
    let start = START * length(guide.position_rel);
    var sum = vec3(0.0);
    var distance_sum = 0.0;
    var hits = 0.0;
    for (var i = 0u; i < samples; i++) {
        let half_vector = sample_visible_normal(view_local, alpha, random(pixel, first + i));
        let v_dot_h = dot(view_local, half_vector);
        let light_local = 2.0 * v_dot_h * half_vector - view_local;
        // Towards the surface: what microfacets reflect to each other is left out, as everywhere in real-time GGX.
        if light_local.z <= 0.0 {
            continue;
        }
        let hit = cast_ray(guide.position_rel, frame * light_local, start);
        if hit.distance < MAX_DISTANCE {
            // BRDF times cosine over the density of the direction: F G2 / G1.
            let fresnel = fresnel_schlick(reflectance.normal_reflectance, reflectance.grazing_reflectance, v_dot_h);
            let shadowing = smith_masking_shadowing(n_dot_v, light_local.z, alpha) / masking;
            sum += hit.radiance * fresnel * shadowing;
            distance_sum += hit.distance;
            hits += 1.0;
        }
    }
    // View targets hold radiance times exposure.
    return Reflected(sum * (view.exposure / f32(max(samples, 1u))), distance_sum / max(hits, 1.0));
}

@compute @workgroup_size(8, 8, 1)
fn trace(@builtin(global_invocation_id) id: vec3<u32>) {
    let texel = id.xy;
    if any(texel >= textureDimensions(radiance_out)) {
        return;
    }
    // One pixel of each block, in every frame another one.
    let pixel = texel * reflections.scale + sample_offset(reflections.frame, reflections.scale);
    var result = Reflected(vec3(0.0), 0.0);
    if all(pixel < reflections.size) {
        result = reflected(pixel, reflections.samples, 0u);
    }
    textureStore(radiance_out, texel, vec4(result.radiance, 1.0));
    textureStore(hit_distance_out, texel, vec4(result.hit_distance));
}

// As `RESAMPLE_WORKGROUP` in `akari_render::signals`.
@compute @workgroup_size(64, 1, 1)
fn retrace(@builtin(global_invocation_id) id: vec3<u32>) {
    // The list begins with how many pixels there are.
    if id.x >= listed[0] {
        return;
    }
    let word = listed[LIST_HEADER + id.x];
    let result = reflected(vec2(word & 0xffffu, word >> 16u), reflections.samples_again, AGAIN);
    shaded[id.x] = vec4(result.radiance, 1.0);
}
