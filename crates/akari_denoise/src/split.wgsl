// Takes apart what a pass has added to the picture: the picture as it was, and the light that came with the pass.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput

@group(0) @binding(0) var picture_after: texture_2d<f32>;
@group(0) @binding(1) var picture_before: texture_2d<f32>;

struct Parts {
    @location(0) picture: vec4<f32>,
    @location(1) signal: vec4<f32>,
}

@fragment
fn split(in: FullscreenVertexOutput) -> Parts {
    let pixel = vec2<i32>(in.position.xy);
    let after = textureLoad(picture_after, pixel, 0);
    let before = textureLoad(picture_before, pixel, 0);
    let added = after.rgb - before.rgb;
    // Radiance is never negative: what the pass has taken away stays with the picture.
    return Parts(vec4(before.rgb + min(added, vec3(0.0)), after.a), vec4(max(added, vec3(0.0)), 1.0));
}
