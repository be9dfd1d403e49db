// Adds a signal to the picture: as it came on the left, filtered on the right.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput

@group(0) @binding(0) var noisy: texture_2d<f32>;
@group(0) @binding(1) var filtered: texture_2d<f32>;
// First column that is filtered, pixels of the full resolution per texel of the signal and axis, two of padding.
@group(0) @binding(2) var<uniform> parts: vec4<u32>;

@fragment
fn show(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(in.position.xy);
    if pixel.x < parts.x {
        return vec4(textureLoad(noisy, pixel / parts.y, 0).rgb, 0.0);
    }
    return vec4(textureLoad(filtered, pixel, 0).rgb, 0.0);
}
