//! The passes that a view runs in this frame: which pipelines in which order, and what they bind.

use crate::bindings::Bindings;
use crate::debug::ViewDenoiseDebug;
use crate::extract::ViewDenoise;
use crate::pipeline::{DenoisePipelines, Pass, PipelineKey};
use crate::prepare::{DenoiseState, is_narrow, shape};
use crate::settings::{Denoise, Method};
use crate::targets::{DenoiseTargets, ListBuffers, REMEMBERED_FORMAT, WORD_FORMAT};
use akari_render::capture::{LIGHT_FORMAT, Light, ViewCapture};
use akari_render::guides::ViewGuides;
use akari_render::pipelines::Pipelines;
use akari_render::signals::ViewSignals;
use akari_render::tiles::TileKind;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::RenderDevice;
use bevy::render::texture::GpuImage;
use bevy::render::view::ExtractedView;
use bevy::shader::ShaderDefVal;

/// A pass of this frame, with all that it binds.
pub struct PreparedPass {
    /// Its label.
    pub label: &'static str,
    /// Bind group of the pass, behind that of the guides.
    pub group: BindGroup,
    /// What runs.
    pub work: Work,
}

/// What a pass runs.
pub enum Work {
    /// One invocation a pixel.
    Pixels(CachedComputePipelineId),
    /// One invocation a pixel of the tiles of a kind.
    Tiles(CachedComputePipelineId, TileKind),
    /// A single workgroup that binds no guides.
    Single(CachedComputePipelineId),
    /// One invocation a listed pixel.
    Listed(CachedComputePipelineId, Buffer),
    /// A triangle that covers the target: an image, or the picture.
    Draw(CachedRenderPipelineId, Option<TextureView>),
}

/// The passes of a view in this frame.
#[derive(Component, Default)]
pub struct ViewDenoisePasses {
    /// Pixels of the full resolution.
    pub size: UVec2,
    /// Cleared before everything else.
    pub cleared: Vec<Buffer>,
    /// Up to the list of pixels to be shaded again.
    pub accumulate: Vec<PreparedPass>,
    /// From their return on.
    pub filter: Vec<PreparedPass>,
}

/// One signal of a view.
#[derive(Clone, Copy)]
struct Signal<'a> {
    index: usize,
    radiance: &'a TextureView,
    output: Option<&'a GpuImage>,
    /// Where the result goes besides.
    captured: Option<&'a TextureView>,
}

/// Label of the pass that draws a signal's last stage once more, for
/// [`CaptureBuffers`](akari_render::capture::CaptureBuffers).
const CAPTURE_LABEL: &str = "akari_denoise_capture";

/// Lists the passes of this frame: pipelines, and what they bind.
pub fn prepare_denoise_passes(
    mut commands: Commands,
    views: Query<(
        Entity,
        &ExtractedView,
        &ViewDenoise,
        &ViewSignals,
        &ViewGuides,
        &DenoiseTargets,
        &DenoiseState,
        Option<&ViewPrepassTextures>,
        Option<&ViewDenoiseDebug>,
        Option<&ViewCapture>,
    )>,
    pipelines: Option<ResMut<DenoisePipelines>>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Pipelines,
    device: Res<RenderDevice>,
) {
    let Some(mut pipelines) = pipelines else {
        return;
    };
    for (entity, view, denoise, signals, guides, targets, state, prepass, debug, capture) in &views
    {
        if targets.shape != shape(&denoise.settings, signals, guides.size, debug) {
            continue;
        }
        let output = |handle: Option<&Handle<Image>>| handle.and_then(|handle| images.get(handle));
        let wanted = denoise.output.as_ref();
        let outputs = [
            output(wanted.and_then(|output| output.specular.as_ref())),
            output(wanted.and_then(|output| output.diffuse.as_ref())),
        ];
        let captured = [Light::IndirectSpecular, Light::IndirectDiffuse]
            .map(|light| capture.and_then(|capture| capture.light(light)));
        let signal_list: Vec<Signal> = [&signals.specular, &signals.diffuse]
            .into_iter()
            .enumerate()
            .filter_map(|(index, radiance)| {
                Some(Signal {
                    index,
                    radiance: radiance.as_ref()?,
                    output: outputs[index],
                    captured: captured[index],
                })
            })
            // Results that are to go into images must not end up in the picture while these are on their way.
            .filter(|signal| wanted.is_none() || signal.output.is_some())
            .collect();
        let mut planner = Planner {
            settings: &denoise.settings,
            signals,
            guides,
            targets,
            state: *state,
            motion: prepass.and_then(ViewPrepassTextures::motion_vectors_view),
            picture: view.target_format,
            pipelines: &mut pipelines,
            cache: &cache,
            device: &device,
        };
        let mut passes = ViewDenoisePasses {
            size: targets.shape.size,
            cleared: targets
                .list
                .iter()
                .map(|list| list.radiance.clone())
                .collect(),
            ..default()
        };
        for signal in &signal_list {
            passes.accumulate.push(planner.accumulate(*signal));
        }
        if let Some(list) = &targets.list {
            passes.accumulate.push(planner.resample_arguments(list));
            if let Some(first) = signal_list.first() {
                passes.filter.push(planner.merge(*first, list));
            }
        }
        for signal in &signal_list {
            planner.filter(*signal, &mut passes.filter);
        }
        // While the guide of the last signal is still there.
        if let (Some(debug), Some(last)) = (debug, signal_list.last()) {
            passes.filter.push(planner.debug(*last, debug));
        }
        let remembers = targets.shape.history && !signal_list.is_empty();
        if let (true, Some(remembered)) = (remembers, &targets.remembered) {
            passes.filter.push(planner.remember(remembered));
        }
        commands.entity(entity).insert(passes);
    }
}

/// Makes the passes of one view.
struct Planner<'a> {
    settings: &'a Denoise,
    signals: &'a ViewSignals,
    guides: &'a ViewGuides,
    targets: &'a DenoiseTargets,
    state: DenoiseState,
    motion: Option<&'a TextureView>,
    picture: TextureFormat,
    pipelines: &'a mut DenoisePipelines,
    cache: &'a Pipelines<'a>,
    device: &'a RenderDevice,
}

impl<'a> Planner<'a> {
    fn defs(&self, signal: Option<Signal>, more: &[&str]) -> Vec<ShaderDefVal> {
        let mut defs = self.guides.shader_defs.clone();
        if signal.is_some_and(|signal| signal.index == 1) {
            defs.push("DIFFUSE_SIGNAL".into());
        }
        if self.signals.glossy_only {
            defs.push("GLOSSY_ONLY".into());
        }
        if signal.is_some_and(|signal| self.tiles_of(signal) == TileKind::Glossy) {
            defs.push("GLOSSY_SIGNAL".into());
        }
        defs.extend(more.iter().map(|def| ShaderDefVal::from(*def)));
        defs
    }

    /// The tiles that have any of a signal.
    fn tiles_of(&self, signal: Signal) -> TileKind {
        if self.signals.glossy_only && signal.index == 0 {
            TileKind::Glossy
        } else {
            TileKind::Surface
        }
    }

    /// A pass over the tiles of a signal.
    fn over_tiles(
        &mut self,
        pass: Pass,
        signal: Signal,
        shader_defs: Vec<ShaderDefVal>,
        bindings: &Bindings,
    ) -> PreparedPass {
        let kind = self.tiles_of(signal);
        let mut prepared = self.compute(pass, shader_defs, bindings);
        if let Work::Pixels(pipeline) = prepared.work {
            prepared.work = Work::Tiles(pipeline, kind);
        }
        prepared
    }

    fn compute(
        &mut self,
        pass: Pass,
        shader_defs: Vec<ShaderDefVal>,
        bindings: &Bindings,
    ) -> PreparedPass {
        let key = PipelineKey {
            pass,
            shader_defs,
            target: None,
        };
        let layout = vec![self.guides.layout.clone(), bindings.layout()];
        PreparedPass {
            label: pass.label(),
            group: bindings.group(self.device, self.cache),
            work: Work::Pixels(self.pipelines.compute(self.cache, key, layout)),
        }
    }

    /// This frame's estimate, and the other one: the history before it is read, room for the guide afterwards.
    fn estimates(&self, signal: Signal) -> (&'a TextureView, &'a TextureView) {
        let slots = &self.targets.estimates[signal.index];
        let current = self.state.current.min(slots.len() - 1);
        (&slots[current], &slots[slots.len() - 1 - current])
    }

    fn accumulate(&mut self, signal: Signal) -> PreparedPass {
        let targets = self.targets;
        let (current, previous) = self.estimates(signal);
        let mut defs = Vec::new();
        let mut bindings = Bindings::new(Pass::Accumulate.label(), ShaderStages::COMPUTE)
            .uniform(0, &targets.view)
            .float(1, signal.radiance)
            .write(2, current, WORD_FORMAT)
            .read_write(3, targets.supports_of(signal.index));
        if self.signals.scale > 1 {
            defs.push("UPSAMPLE");
        }
        match self.settings.method {
            Method::Normal => defs.push("METHOD_NORMAL"),
            Method::Guided => defs.push("METHOD_GUIDED"),
            _ => {}
        }
        if let (true, Some(remembered)) = (targets.shape.history, &targets.remembered) {
            defs.push("HISTORY");
            bindings = bindings.uint(4, previous).uint(5, remembered);
            if let Some(motion) = self.motion {
                defs.push("MOTION_VECTORS");
                bindings = bindings.float(6, motion);
            }
            // Only what is reflected sharply moves otherwise than its surface.
            if let (0, Some(hit_distance)) = (signal.index, &self.signals.hit_distance) {
                defs.push("HIT_DISTANCE");
                bindings = bindings.float(7, hit_distance);
            }
        }
        // One list: the first signal decides.
        let first = signal.index == 0 || self.signals.specular.is_none();
        if let (true, Some(list)) = (first, &targets.list) {
            defs.push("RESAMPLE");
            bindings = bindings.read_write(8, &list.pixels);
        }
        let defs = self.defs(Some(signal), &defs);
        self.over_tiles(Pass::Accumulate, signal, defs, &bindings)
    }

    fn resample_arguments(&mut self, list: &'a ListBuffers) -> PreparedPass {
        let pass = Pass::ResampleArguments;
        let bindings = Bindings::new(pass.label(), ShaderStages::COMPUTE)
            .read_write(0, &list.pixels)
            .read_write(1, &list.indirect);
        let key = PipelineKey {
            pass,
            shader_defs: Vec::new(),
            target: None,
        };
        PreparedPass {
            label: pass.label(),
            group: bindings.group(self.device, self.cache),
            work: Work::Single(
                self.pipelines
                    .compute(self.cache, key, vec![bindings.layout()]),
            ),
        }
    }

    fn merge(&mut self, signal: Signal, list: &'a ListBuffers) -> PreparedPass {
        let (current, _) = self.estimates(signal);
        let mut defs = Vec::new();
        let mut bindings = Bindings::new(Pass::Merge.label(), ShaderStages::COMPUTE)
            .uniform(0, &self.targets.view)
            .read(1, &list.pixels)
            .read(2, &list.radiance)
            .write(3, current, WORD_FORMAT)
            .read_write(4, self.targets.supports_of(signal.index));
        if let Some(marks) = &self.targets.marks {
            defs.push("MARK_RESAMPLED");
            bindings = bindings.write(5, marks, WORD_FORMAT);
        }
        let defs = self.defs(Some(signal), &defs);
        let mut prepared = self.compute(Pass::Merge, defs, &bindings);
        if let Work::Pixels(pipeline) = prepared.work {
            prepared.work = Work::Listed(pipeline, list.indirect.clone());
        }
        prepared
    }

    fn remember(&mut self, remembered: &'a TextureView) -> PreparedPass {
        let bindings = Bindings::new(Pass::Remember.label(), ShaderStages::COMPUTE)
            .uniform(0, &self.targets.view)
            .read(1, self.targets.supports_of(0))
            .read(2, self.targets.supports_of(1))
            .write(3, remembered, REMEMBERED_FORMAT);
        let defs = self.defs(None, &[]);
        self.compute(Pass::Remember, defs, &bindings)
    }

    fn method_defs(&self) -> Vec<&'static str> {
        let mut defs = match self.settings.method {
            Method::Guided => vec!["METHOD_GUIDED", "LOBE_WEIGHT"],
            Method::Lobe => vec!["LOBE_WEIGHT"],
            Method::Normal => vec!["METHOD_NORMAL"],
            Method::AxisAligned => vec!["METHOD_AXIS_ALIGNED"],
            Method::Distribution => vec!["METHOD_DISTRIBUTION"],
        };
        if self.settings.anisotropic {
            defs.push("ANISOTROPIC");
        }
        defs
    }

    fn filter(&mut self, signal: Signal, passes: &mut Vec<PreparedPass>) {
        let targets = self.targets;
        let (estimate, other) = self.estimates(signal);
        let mut method = self.method_defs();
        if signal.index == 1 {
            // A clamped cosine is round.
            method.retain(|def| *def != "ANISOTROPIC");
        }
        // Without a guide, whatever is bound in its place is not read.
        let workspace = targets.remembered.as_ref().unwrap_or(estimate);
        if self.settings.method == Method::Guided {
            let bindings = Bindings::new(Pass::Residual.label(), ShaderStages::COMPUTE)
                .uniform(0, &targets.view)
                .uint(1, estimate)
                .write(2, workspace, REMEMBERED_FORMAT);
            let defs = self.defs(Some(signal), &[]);
            passes.push(self.over_tiles(Pass::Residual, signal, defs, &bindings));
            let bindings = Bindings::new(Pass::Noise.label(), ShaderStages::COMPUTE)
                .uniform(0, &targets.view)
                .uint(1, workspace)
                .write(2, other, WORD_FORMAT);
            let narrow: &[&str] = if is_narrow(self.settings) {
                &["NARROW"]
            } else {
                &[]
            };
            let defs = self.defs(Some(signal), narrow);
            passes.push(self.over_tiles(Pass::Noise, signal, defs, &bindings));
        }
        if targets.shape.guide {
            let bindings = Bindings::new(Pass::Guide.label(), ShaderStages::COMPUTE)
                .uniform(0, &targets.view)
                .uint(1, estimate)
                .uint(2, other)
                .write(3, workspace, REMEMBERED_FORMAT);
            let defs = self.defs(Some(signal), &method);
            passes.push(self.over_tiles(Pass::Guide, signal, defs, &bindings));
        }
        let mut intermediates: Vec<&TextureView> = Vec::new();
        if targets.estimates[signal.index].len() == 2 {
            intermediates.push(other);
        }
        intermediates.extend(targets.scratch_of(signal.index, self.state.current));
        let last = targets.shape.stages - 1;
        let mut changes = None;
        for (index, stage) in (0..).zip(&targets.stages) {
            let is_last = index == last;
            let visible = if is_last {
                ShaderStages::FRAGMENT
            } else {
                ShaderStages::COMPUTE
            };
            let pass = if is_last {
                Pass::LastStage
            } else {
                Pass::Stage
            };
            let mut bindings = Bindings::new(pass.label(), visible)
                .uniform(0, &targets.view)
                .uniform(1, stage)
                .uint(2, estimate)
                .uint(3, workspace);
            let mut defs = method.clone();
            if let Some(changes) = changes {
                defs.push("CHANGED");
                bindings = bindings.uint(5, changes);
            }
            if is_last {
                defs.push("LAST_STAGE");
                // Without history and upsampling an estimate is a texel, but for its rounding.
                if self.signals.scale == 1 && !targets.shape.history {
                    defs.push("EXACT_SIGNAL");
                    bindings = bindings.float(6, signal.radiance);
                }
                let defs = self.defs(Some(signal), &defs);
                if let Some(captured) = signal.captured {
                    let target = (LIGHT_FORMAT, false);
                    let image = Some(captured.clone());
                    let drawn = self.draw(pass, target, image, defs.clone(), &bindings);
                    passes.push(PreparedPass {
                        label: CAPTURE_LABEL,
                        ..drawn
                    });
                }
                let (target, image) = match signal.output {
                    // 32-bit floats cannot be blended everywhere, and nothing is there to blend with.
                    Some(image) => (
                        (image.texture_descriptor.format, false),
                        Some(image.texture_view.clone()),
                    ),
                    None => ((self.picture, true), None),
                };
                passes.push(self.draw(pass, target, image, defs, &bindings));
                break;
            }
            let target = intermediates[index as usize % intermediates.len()];
            bindings = bindings.write(4, target, WORD_FORMAT);
            let defs = self.defs(Some(signal), &defs);
            passes.push(self.over_tiles(pass, signal, defs, &bindings));
            changes = Some(target);
        }
    }

    fn draw(
        &mut self,
        pass: Pass,
        target: (TextureFormat, bool),
        image: Option<TextureView>,
        shader_defs: Vec<ShaderDefVal>,
        bindings: &Bindings,
    ) -> PreparedPass {
        let key = PipelineKey {
            pass,
            shader_defs,
            target: Some(target),
        };
        let layout = vec![self.guides.layout.clone(), bindings.layout()];
        PreparedPass {
            label: pass.label(),
            group: bindings.group(self.device, self.cache),
            work: Work::Draw(self.pipelines.render(self.cache, key, layout), image),
        }
    }

    fn debug(&mut self, signal: Signal, debug: &ViewDenoiseDebug) -> PreparedPass {
        let targets = self.targets;
        let (estimate, _) = self.estimates(signal);
        let mut defs = self.method_defs();
        defs.push(debug.view.shader_def());
        let mut bindings = Bindings::new(Pass::Debug.label(), ShaderStages::FRAGMENT)
            .uniform(0, &targets.view)
            .uniform(1, &targets.stages[0])
            .uint(2, estimate)
            .read(3, targets.supports_of(signal.index))
            .uint(4, targets.remembered.as_ref().unwrap_or(estimate));
        if let Some(marks) = &targets.marks {
            defs.push("MARK_RESAMPLED");
            bindings = bindings.uint(6, marks);
        }
        let shader_defs = self.defs(Some(signal), &defs);
        let key = PipelineKey {
            pass: Pass::Debug,
            shader_defs,
            target: Some((self.picture, false)),
        };
        let layout = vec![self.guides.layout.clone(), bindings.layout()];
        PreparedPass {
            label: Pass::Debug.label(),
            group: bindings.group(self.device, self.cache),
            work: Work::Draw(self.pipelines.render(self.cache, key, layout), None),
        }
    }
}
