#define_import_path akari_interreflection::sky

// The environment map: light from infinitely far away.

#import akari_math::places::spread_roughness
#import akari_render::sky::sky_place
#import akari_interreflection::types::ReflectedSky

@group(#{SKY_GROUP}) @binding(0) var<uniform> reflected_sky: ReflectedSky;
@group(#{SKY_GROUP}) @binding(1) var sky_map: texture_cube<f32>;
@group(#{SKY_GROUP}) @binding(2) var sky_sampler: sampler;

// Mean radiance over a round part of the sky, whose solid angle is this share of pi. A level of the map is filtered by a GGX
// lobe of alpha = roughness^2 seen along its normal.
fn sky_radiance(direction: vec3<f32>, share: f32) -> vec3<f32> {
    let level = spread_roughness(share) * reflected_sky.last_level;
    let texel = textureSampleLevel(sky_map, sky_sampler, sky_place(reflected_sky.to_map, direction), level);
    return reflected_sky.intensity * max(texel.rgb, vec3(0.0));
}
