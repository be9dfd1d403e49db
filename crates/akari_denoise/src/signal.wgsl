#define_import_path akari_denoise::signal

// Which guide and which albedo belong to the signal of this pass.

#import akari_lobes::guides::{
    Guide, diffuse_demodulation, load_diffuse_guide, load_specular_guide, specular_demodulation,
}

fn load_guide(pixel: vec2<i32>) -> Guide {
#ifdef DIFFUSE_SIGNAL
    return load_diffuse_guide(pixel);
#else
    return load_specular_guide(pixel);
#endif
}

fn demodulation(pixel: vec2<i32>, guide: Guide) -> vec3<f32> {
#ifdef DIFFUSE_SIGNAL
    return diffuse_demodulation(pixel);
#else
    return specular_demodulation(pixel, guide);
#endif
}
