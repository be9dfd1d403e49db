#define_import_path akari_interreflection::sky

// The environment map: light from infinitely far away.

#import akari_render::sky::sky_place

// As `GpuReflectedSky` in `types.rs`.
struct ReflectedSky {
    // Quaternion that turns directions of the world into those of the map.
    to_map: vec4<f32>,
    // Nits per unit of the map.
    intensity: f32,
    // Level of the map that is filtered for a roughness of 1.
    last_level: f32,
}

@group(#{SKY_GROUP}) @binding(0) var<uniform> reflected_sky: ReflectedSky;
@group(#{SKY_GROUP}) @binding(1) var sky_map: texture_cube<f32>;
@group(#{SKY_GROUP}) @binding(2) var sky_sampler: sampler;

// Golden angle: turns by it fill a disc evenly (Vogel 1979).
const TURN: f32 = 2.39996323;
// Squared alpha over the squared radius of a disc that is as wide.
const ALPHA_OF_DISC: f32 = 0.125;

// Mean radiance over a round part of the sky, whose solid angle is this share of pi. A level of the map is filtered by a GGX
// lobe of alpha = roughness^2 seen along its normal: a Gaussian of sharpness 1 / (2 alpha^2). It is as wide as a disc whose
// squared radius is 8 alpha^2, as each axis of a disc has a quarter of that as its variance (Krivanek and Colbert 2008,
// "Real-time Shading with Filtered Importance Sampling", take the level by solid angle, too).
fn sky_radiance(direction: vec3<f32>, share: f32) -> vec3<f32> {
    let roughness = min(sqrt(sqrt(ALPHA_OF_DISC * max(share, 0.0))), 1.0);
    let level = roughness * reflected_sky.last_level;
    let texel = textureSampleLevel(sky_map, sky_sampler, sky_place(reflected_sky.to_map, direction), level);
    return reflected_sky.intensity * max(texel.rgb, vec3(0.0));
}
