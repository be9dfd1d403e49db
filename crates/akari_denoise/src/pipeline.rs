//! Shaders and pipelines, queued when a view first needs them. Nothing here exists before.

use akari_render::gpu;
use akari_render::pipelines::Pipelines;
use bevy::asset::{AssetServer, load_embedded_asset};
use bevy::core_pipeline::FullscreenShader;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::shader::ShaderDefVal;

/// The passes, in the order in which they run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pass {
    /// Samples of this frame and the history → one estimate per pixel.
    Accumulate,
    /// Number of listed pixels → arguments of the indirect dispatch.
    ResampleArguments,
    /// Pixels shaded again → estimates.
    Merge,
    /// What the next frame compares with.
    Remember,
    /// What neighbours do not foretell of a pixel.
    Residual,
    /// How much of that is noise.
    Noise,
    /// Prefiltered image and its variance.
    Guide,
    /// A stage of the filter, but the last.
    Stage,
    /// The last stage of the filter, a fragment shader.
    LastStage,
    /// A debug view, a fragment shader.
    Debug,
}

impl Pass {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Accumulate,
        Self::ResampleArguments,
        Self::Merge,
        Self::Remember,
        Self::Residual,
        Self::Noise,
        Self::Guide,
        Self::Stage,
        Self::LastStage,
        Self::Debug,
    ];

    /// Label of the pass and of its time span.
    pub fn label(self) -> &'static str {
        match self {
            Self::Accumulate => "akari_denoise_accumulate",
            Self::ResampleArguments => "akari_denoise_resample_arguments",
            Self::Merge => "akari_denoise_merge",
            Self::Remember => "akari_denoise_remember",
            Self::Residual => "akari_denoise_residual",
            Self::Noise => "akari_denoise_noise",
            Self::Guide => "akari_denoise_guide",
            Self::Stage => "akari_denoise_stage",
            Self::LastStage => "akari_denoise_last_stage",
            Self::Debug => "akari_denoise_debug",
        }
    }
}

/// What makes one pipeline differ from another.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct PipelineKey {
    /// The pass.
    pub pass: Pass,
    /// Definitions of its shader, those of the guides among them.
    pub shader_defs: Vec<ShaderDefVal>,
    /// Format and blending of what a fragment shader draws into.
    pub target: Option<(TextureFormat, bool)>,
}

/// Shaders, and the pipelines made so far. Dropped when no view needs them any more.
#[derive(Resource)]
pub struct DenoisePipelines {
    shaders: HashMap<Pass, Handle<Shader>>,
    vertex: VertexState,
    compute: HashMap<PipelineKey, CachedComputePipelineId>,
    render: HashMap<PipelineKey, CachedRenderPipelineId>,
}

impl DenoisePipelines {
    /// Loads the shaders.
    pub fn new(assets: &AssetServer, fullscreen: &FullscreenShader) -> Self {
        let shaders = Pass::ALL.map(|pass| {
            let shader = match pass {
                Pass::Accumulate => load_embedded_asset!(assets, "accumulate.wgsl"),
                Pass::ResampleArguments => load_embedded_asset!(assets, "arguments.wgsl"),
                Pass::Merge => load_embedded_asset!(assets, "merge.wgsl"),
                Pass::Remember => load_embedded_asset!(assets, "remember.wgsl"),
                Pass::Residual => load_embedded_asset!(assets, "residual.wgsl"),
                Pass::Noise => load_embedded_asset!(assets, "noise.wgsl"),
                Pass::Guide => load_embedded_asset!(assets, "guide.wgsl"),
                Pass::Stage | Pass::LastStage => load_embedded_asset!(assets, "filter.wgsl"),
                Pass::Debug => load_embedded_asset!(assets, "debug.wgsl"),
            };
            (pass, shader)
        });
        Self {
            shaders: shaders.into_iter().collect(),
            vertex: fullscreen.to_vertex_state(),
            compute: HashMap::default(),
            render: HashMap::default(),
        }
    }

    /// The compute pipeline of a key, queued at the first call.
    pub fn compute(
        &mut self,
        cache: &Pipelines,
        key: PipelineKey,
        layout: Vec<BindGroupLayoutDescriptor>,
    ) -> CachedComputePipelineId {
        let shader = self.shaders[&key.pass].clone();
        *self.compute.entry(key).or_insert_with_key(|key| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(key.pass.label().into()),
                layout,
                shader,
                shader_defs: key.shader_defs.clone(),
                ..default()
            })
        })
    }

    /// The render pipeline of a key, queued at the first call.
    pub fn render(
        &mut self,
        cache: &Pipelines,
        key: PipelineKey,
        layout: Vec<BindGroupLayoutDescriptor>,
    ) -> CachedRenderPipelineId {
        let shader = self.shaders[&key.pass].clone();
        let vertex = self.vertex.clone();
        *self.render.entry(key).or_insert_with_key(|key| {
            cache.queue_render_pipeline(RenderPipelineDescriptor {
                label: Some(key.pass.label().into()),
                layout,
                vertex,
                fragment: Some(FragmentState {
                    shader,
                    shader_defs: key.shader_defs.clone(),
                    targets: vec![
                        (key.target).map(|(format, blend)| gpu::light_target(format, blend)),
                    ],
                    ..default()
                }),
                ..default()
            })
        })
    }
}
