// Puts the filtered roughness into the G-buffer: its first word, the only channel that the pipeline writes.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput

@group(0) @binding(0) var first_words: texture_2d<u32>;

@fragment
fn store_roughness(in: FullscreenVertexOutput) -> @location(0) vec4<u32> {
    return vec4(textureLoad(first_words, vec2<i32>(in.position.xy), 0).r, 0u, 0u, 0u);
}
