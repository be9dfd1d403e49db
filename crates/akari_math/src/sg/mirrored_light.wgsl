#define_import_path akari_math::sg::mirrored_light

// Twin: `sg/mirrored_light.rs`, where the derivation and the error bounds are. Change both or neither.

#import akari_math::special::{TINY, safe_normalize}
#import akari_math::ggx::ReflectionLobe

// Lobe about `receiver` of the light from a source at `light` that a plane of unit normal `normal` through the origin and
// of GGX width `alpha` reflects there.
fn sg_mirrored_light(receiver: vec3<f32>, light: vec3<f32>, normal: vec3<f32>, alpha: f32) -> ReflectionLobe {
    let receiver_height = max(dot(normal, receiver), 0.0);
    let light_height = max(dot(normal, light), 0.0);
    let path = (light - receiver) - 2.0 * light_height * normal;
    let distance = sqrt(max(dot(path, path), TINY));
    let heights = max(receiver_height + light_height, TINY);
    return ReflectionLobe(
        safe_normalize(path, -normal),
        2.0 * alpha * alpha * (light_height / distance) * (light_height / heights),
    );
}

// The same for a source that is far away in the unit direction `to_light`.
fn sg_mirrored_direction(to_light: vec3<f32>, normal: vec3<f32>, alpha: f32) -> ReflectionLobe {
    let cosine = max(dot(normal, to_light), 0.0);
    return ReflectionLobe(safe_normalize(to_light - 2.0 * cosine * normal, -normal), 2.0 * alpha * alpha * cosine);
}
