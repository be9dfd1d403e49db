#define_import_path akari_denoise::signal

// Which guide and which albedo belong to the signal of this pass, and which tiles it is in.

#import akari_lobes::guides::{
    Guide, demodulation_of, diffuse_albedo, load_diffuse_guide, load_specular_guide, matte_albedo, specular_albedo,
}
#import akari_lobes::tiles::{
    GLOSSY_TILES, HOLDS_GLOSSY, HOLDS_SURFACE, ListedTexel, SURFACE_TILES, listed_texel, tile_holds,
}

fn load_guide(pixel: vec2<i32>) -> Guide {
#ifdef DIFFUSE_SIGNAL
    return load_diffuse_guide(pixel);
#else
    var guide = load_specular_guide(pixel);
#ifdef GLOSSY_SIGNAL
    guide.valid = guide.valid && guide.glossy;
#endif
    return guide;
#endif
}

fn demodulation(pixel: vec2<i32>, guide: Guide) -> vec3<f32> {
#ifdef DIFFUSE_SIGNAL
#ifdef GLOSSY_ONLY
    return demodulation_of(matte_albedo(pixel, guide));
#else
    return demodulation_of(diffuse_albedo(pixel));
#endif
#else
    return demodulation_of(specular_albedo(pixel, guide));
#endif
}

// The pixel of an invocation: passes of a signal run on the tiles that have any of it.
fn listed_pixel(group: vec3<u32>, invocation: u32) -> ListedTexel {
#ifdef GLOSSY_SIGNAL
    return listed_texel(GLOSSY_TILES, 1u, group.xy, invocation);
#else
    return listed_texel(SURFACE_TILES, 1u, group.xy, invocation);
#endif
}

// Whether the passes before have written a pixel of the view.
fn has_signal(pixel: vec2<i32>) -> bool {
#ifdef GLOSSY_SIGNAL
    return tile_holds(vec2<u32>(pixel), HOLDS_GLOSSY);
#else
    return tile_holds(vec2<u32>(pixel), HOLDS_SURFACE);
#endif
}
