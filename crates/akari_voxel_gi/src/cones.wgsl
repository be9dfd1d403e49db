// Indirect light of each pixel, or of one pixel in each block: diffuse by a set of cones over the hemisphere, specular by
// cones drawn from the pixel's lobe. Noisy: for the denoiser. What reflects no more sharply than a diffuse surface has no
// cones of its lobe: its lobe counts as diffuse.
//
// Definitions: SPECULAR, the tiles with glossy pixels; BESIDE_SPECULAR, the others; neither, all tiles, no cones of lobes.

#import akari_lobes::guides::{
    Guide, load_specular_guide, matte_albedo, no_guide, specular_albedo, view,
}
#import akari_lobes::tiles::{GLOSSY_TILES, MATTE_TILES, SURFACE_TILES, listed_texel}
#import akari_math::frame::orthonormal_basis
#import akari_math::random::{random_hash, random_sequence}
#import akari_math::reprojection::sample_offset
#import akari_math::special::safe_normalize
#import akari_math::voxel::cone::{CONE_ENERGY, cone_tangent, lobe_cone_height}
#import akari_voxel_gi::diffuse::gather_diffuse
#import akari_voxel_gi::sky::trace_light
#import akari_voxel_gi::trace::VoxelRay

// As `GpuCones` in `cones.rs`.
struct Cones {
    // Pixels of the full resolution.
    size: vec2<u32>,
    // Pixels per texel and axis.
    scale: u32,
    // Counts up with each frame.
    frame: u32,
    // The view's position from the anchor, metres.
    eye: vec3<f32>,
    cones: u32,
    specular_cones: u32,
    aperture: f32,
    reach: f32,
    pad_a: u32,
}

@group(2) @binding(0) var<uniform> cones: Cones;
@group(2) @binding(1) var diffuse_out: texture_storage_2d<rgba16float, write>;
#ifdef SPECULAR
@group(2) @binding(2) var specular_out: texture_storage_2d<rgba16float, write>;
@group(2) @binding(3) var hit_distance_out: texture_storage_2d<r32float, write>;
#endif

const PI: f32 = 3.1415927;
const TWO_PI: f32 = 6.2831853;
// Largest number that a texel holds.
const MAX_TEXEL: f32 = 65504.0;
// Smallest 1 / sharpness of a lobe: a mirror's.
const MIN_INVERSE_SHARPNESS: f32 = 1e-6;
// Width at which a cone of a lobe sees the sky at least, over that of the lobe: it widens what is drawn from the lobe by an
// eighth, and keeps a sun from being met by one frame in a hundred.
const SKY_APERTURE: f32 = 0.5;

// What cones bring of the specular lobe.
struct SpecularLight {
    radiance: vec3<f32>,
    // Mean distance of what was met, metres.
    distance: f32,
}

#ifdef SPECULAR
fn gather_specular(guide: Guide, pixel: vec2<u32>) -> SpecularLight {
    var light = SpecularLight(vec3(0.0), 0.0);
    let sharpness = 1.0 / max(guide.inverse_sharpness, MIN_INVERSE_SHARPNESS);
    let lobe_tangent = cone_tangent(lobe_cone_height(sharpness, CONE_ENERGY));
    let tangent = cones.aperture * lobe_tangent;
    let sky_tangent = max(cones.aperture, SKY_APERTURE) * lobe_tangent;
    let basis = orthonormal_basis(guide.axis);
    for (var i = 0u; i < cones.specular_cones; i++) {
        let shift = random_hash(vec3(pixel, 0x73706563u + i));
        let random = random_sequence(cones.frame, shift.x, shift.y);
        // Drawn from the lobe: the part of its energy within this height is even in [0, 1).
        let height = lobe_cone_height(sharpness, 0.99 * random.x);
        let sine = sqrt(max(height * (2.0 - height), 0.0));
        let angle = TWO_PI * random.y;
        var direction = basis * vec3(sine * cos(angle), sine * sin(angle), 1.0 - height);
        // What would go into the surface comes out again on the same side.
        let below = dot(direction, guide.normal_ws);
        if below < 0.0 {
            direction -= 2.0 * below * guide.normal_ws;
        }
        direction = safe_normalize(direction, guide.axis);
        let ray = VoxelRay(
            guide.position_rel + cones.eye, direction, guide.normal_ws, tangent, cones.reach,
            shift.z ^ (cones.frame * 0x9e3779b9u),
        );
        let traced = trace_light(ray, sky_tangent);
        light.radiance += traced.radiance;
        light.distance += traced.distance;
    }
    let count = f32(max(cones.specular_cones, 1u));
    return SpecularLight(light.radiance / count, light.distance / count);
}
#endif

@compute @workgroup_size(8, 8, 1)
fn trace(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
#ifdef SPECULAR
    let kind = GLOSSY_TILES;
#else
#ifdef BESIDE_SPECULAR
    let kind = MATTE_TILES;
#else
    let kind = SURFACE_TILES;
#endif
#endif
    let work = listed_texel(kind, cones.scale, group.xy, invocation);
    let texel = work.texel;
    if !work.listed || any(texel >= textureDimensions(diffuse_out)) {
        return;
    }
    let pixel = texel * cones.scale + sample_offset(cones.frame, cones.scale);
    let place = vec2<i32>(pixel);
    var guide = no_guide();
    if all(pixel < cones.size) {
        guide = load_specular_guide(place);
    }
    var diffuse = vec3(0.0);
    if guide.valid {
        let gathered = gather_diffuse(
            guide.position_rel + cones.eye, guide.normal_ws, cones.cones, cones.aperture, cones.reach, pixel, cones.frame,
        );
        diffuse = gathered.irradiance * matte_albedo(place, guide) / PI;
    }
    // View targets hold radiance times exposure.
    textureStore(diffuse_out, texel, vec4(min(diffuse * view.exposure, vec3(MAX_TEXEL)), 1.0));
#ifdef SPECULAR
    var specular = SpecularLight(vec3(0.0), 0.0);
    if guide.valid && guide.glossy {
        specular = gather_specular(guide, pixel);
        specular.radiance *= specular_albedo(place, guide);
    }
    textureStore(specular_out, texel, vec4(min(specular.radiance * view.exposure, vec3(MAX_TEXEL)), 1.0));
    textureStore(hit_distance_out, texel, vec4(specular.distance));
#endif
}
