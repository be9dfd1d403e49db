//! Counts of pixels that are no numbers or at the end of their range, by the passes that made them: for debugging.
//!
//! With the resource [`CountFaults`] set, a small compute pass looks at the picture before and after the passes that add
//! light to it, and at the noisy signals; what it finds goes to [`GpuLedger::counters`], a frame or two late, under the
//! names of [`FAULT_COUNTERS`]. Several cameras are counted together. Without the resource there is no pass, no buffer
//! and no pipeline.
//!
//! *Non-finite* pixels have a channel that is NaN or infinite, told by its bits. *Clamped* ones are at or above 65408, the
//! largest radiance that every format of a signal holds: whatever was above it is lost. What is added to the picture is
//! what there is after the passes less what there was before them, so that a fault that Bevy's own lighting brought is
//! not counted as ours. The lobes of pixels are stored as whole numbers each of which stands for a lobe: there is nothing
//! to count in them.

use crate::ledger::{GpuLedger, read_back_words};
use crate::pipelines::Pipelines;
use crate::signals::{AkariPassSystems, ViewSignals};
use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::pbr::deferred::deferred_lighting;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{storage_buffer_sized, texture_2d};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::view::ViewTarget;
use bevy::render::{Extract, ExtractSchedule, Render, RenderApp, RenderSystems};
use std::num::NonZeroU64;

/// Label of the counting pass.
pub const FAULTS_LABEL: &str = "akari_faults";
/// Name under which its buffer is accounted for.
pub const EFFECT: &str = "faults";

/// Set it to count pixels that are no numbers; see [the module](self). For debugging: it costs a pass over the picture
/// for each place that is looked at.
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct CountFaults(pub bool);

/// Names of the counts in [`GpuLedger::counters`]: non-finite and clamped pixels of each.
pub const FAULT_COUNTERS: [[&str; 2]; 4] = [
    [
        "area lights: non-finite pixels added",
        "area lights: clamped pixels added",
    ],
    [
        "specular signals: non-finite pixels",
        "specular signals: clamped pixels",
    ],
    [
        "diffuse signals: non-finite pixels",
        "diffuse signals: clamped pixels",
    ],
    [
        "denoise: non-finite pixels added",
        "denoise: clamped pixels added",
    ],
];

/// Where it is counted.
#[derive(Clone, Copy)]
enum Place {
    BeforeDirect,
    AfterDirect,
    Specular,
    Diffuse,
    BeforeFilter,
    AfterFilter,
}

const PLACES: u64 = Place::AfterFilter as u64 + 1;
/// Bytes between the counts of two places: the largest alignment of a binding's offset.
const STRIDE: u64 = 256;
/// Bytes of the counts of a place.
const COUNTS: u64 = 8;
/// Invocations of a workgroup in each direction.
const WORKGROUP: u32 = 8;

#[derive(Resource)]
struct FaultCounters {
    layout: BindGroupLayoutDescriptor,
    pipeline: CachedComputePipelineId,
    counts: Buffer,
}

/// The systems of the counting but the one that says whether to count: not run while nothing is to be counted.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
struct FaultSystems;

/// Whether to count, or to let go of what counted.
fn counts(wanted: Res<CountFaults>, counters: Option<Res<FaultCounters>>) -> bool {
    wanted.0 || counters.is_some()
}

/// Adds the systems of the counting.
pub(crate) fn build(app: &mut App) {
    app.init_resource::<CountFaults>();
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    bevy::asset::embedded_asset!(app, "faults.wgsl");
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    let in_main_pass = || {
        (
            count_before_direct
                .after(deferred_lighting)
                .before(AkariPassSystems::Direct),
            count_after_direct
                .after(AkariPassSystems::Direct)
                .before(AkariPassSystems::Signals),
            count_before_filter
                .after(AkariPassSystems::Signals)
                .before(AkariPassSystems::Accumulate),
            count_after_filter
                .after(AkariPassSystems::Filter)
                .before(main_opaque_pass_3d),
        )
            .in_set(Core3dSystems::MainPass)
            .in_set(FaultSystems)
    };
    render_app
        .configure_sets(Render, FaultSystems.run_if(counts))
        .configure_sets(Core3d, FaultSystems.run_if(counts))
        .init_resource::<CountFaults>()
        .add_systems(ExtractSchedule, extract_count_faults)
        .add_systems(
            Render,
            (
                prepare_counters.in_set(RenderSystems::PrepareResources),
                collect_counts.in_set(RenderSystems::Cleanup),
            )
                .in_set(FaultSystems),
        )
        .add_systems(Core3d, in_main_pass());
}

fn extract_count_faults(mut target: ResMut<CountFaults>, source: Extract<Res<CountFaults>>) {
    target.set_if_neq(**source);
}

fn prepare_counters(
    wanted: Res<CountFaults>,
    counters: Option<Res<FaultCounters>>,
    mut commands: Commands,
    assets: Res<AssetServer>,
    cache: Pipelines,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    match counters {
        None if wanted.0 => {
            let layout = BindGroupLayoutDescriptor::new(
                FAULTS_LABEL,
                &BindGroupLayoutEntries::sequential(
                    ShaderStages::COMPUTE,
                    (
                        texture_2d(TextureSampleType::Float { filterable: false }),
                        storage_buffer_sized(false, NonZeroU64::new(COUNTS)),
                    ),
                ),
            );
            let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(FAULTS_LABEL.into()),
                layout: vec![layout.clone()],
                shader: load_embedded_asset!(&*assets, "faults.wgsl"),
                ..default()
            });
            ledger.set_bytes(EFFECT, "counts", PLACES * STRIDE);
            commands.insert_resource(FaultCounters {
                layout,
                pipeline,
                counts: device.create_buffer(&BufferDescriptor {
                    label: Some("akari_faults_counts"),
                    size: PLACES * STRIDE,
                    usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                }),
            });
        }
        Some(_) if !wanted.0 => {
            ledger.free(EFFECT);
            commands.remove_resource::<FaultCounters>();
        }
        Some(counters) => {
            queue.write_buffer(&counters.counts, 0, &[0; (PLACES * STRIDE) as usize]);
        }
        None => {}
    }
}

/// Counts the pixels of `picture` at one place.
fn count(
    place: Place,
    picture: &TextureView,
    counters: &FaultCounters,
    cache: &PipelineCache,
    ledger: &GpuLedger,
    ctx: &mut RenderContext,
) {
    let Some(pipeline) = cache.get_compute_pipeline(counters.pipeline) else {
        return;
    };
    let group = ctx.render_device().create_bind_group(
        FAULTS_LABEL,
        &cache.get_bind_group_layout(&counters.layout),
        &BindGroupEntries::sequential((
            picture,
            BufferBinding {
                buffer: &counters.counts,
                offset: place as u64 * STRIDE,
                size: NonZeroU64::new(COUNTS),
            },
        )),
    );
    let size = picture.texture().size();
    let mut pass = ctx
        .command_encoder()
        .begin_compute_pass(&ComputePassDescriptor {
            label: Some(FAULTS_LABEL),
            timestamp_writes: None,
        });
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(
        size.width.div_ceil(WORKGROUP),
        size.height.div_ceil(WORKGROUP),
        1,
    );
    drop(pass);
    ledger.count_pass(FAULTS_LABEL);
}

fn count_target(
    place: Place,
    target: &ViewTarget,
    counters: Option<Res<FaultCounters>>,
    cache: &PipelineCache,
    ledger: &GpuLedger,
    ctx: &mut RenderContext,
) {
    if let Some(counters) = counters {
        count(
            place,
            target.main_texture_view(),
            &counters,
            cache,
            ledger,
            ctx,
        );
    }
}

fn count_before_direct(
    view: ViewQuery<&ViewTarget>,
    counters: Option<Res<FaultCounters>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let place = Place::BeforeDirect;
    count_target(
        place,
        view.into_inner(),
        counters,
        &cache,
        &ledger,
        &mut ctx,
    );
}

fn count_after_direct(
    view: ViewQuery<&ViewTarget>,
    counters: Option<Res<FaultCounters>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let place = Place::AfterDirect;
    count_target(
        place,
        view.into_inner(),
        counters,
        &cache,
        &ledger,
        &mut ctx,
    );
}

fn count_before_filter(
    view: ViewQuery<(&ViewTarget, Option<&ViewSignals>)>,
    counters: Option<Res<FaultCounters>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    let (target, signals) = view.into_inner();
    let (Some(counters), Some(signals)) = (&counters, signals) else {
        return;
    };
    let textures = [
        (Place::BeforeFilter, Some(target.main_texture_view())),
        (Place::Specular, signals.specular.as_ref()),
        (Place::Diffuse, signals.diffuse.as_ref()),
    ];
    for (place, texture) in textures {
        if let Some(texture) = texture {
            count(place, texture, counters, &cache, &ledger, &mut ctx);
        }
    }
}

fn count_after_filter(
    view: ViewQuery<(&ViewTarget, Has<ViewSignals>)>,
    counters: Option<Res<FaultCounters>>,
    cache: Res<PipelineCache>,
    ledger: Res<GpuLedger>,
    mut ctx: RenderContext,
) {
    if let (target, true) = view.into_inner() {
        let place = Place::AfterFilter;
        count_target(place, target, counters, &cache, &ledger, &mut ctx);
    }
}

/// Copies the counts of this frame to the CPU without waiting for them.
fn collect_counts(
    counters: Option<Res<FaultCounters>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    ledger: Res<GpuLedger>,
) {
    let Some(counters) = counters else {
        return;
    };
    let ledger = ledger.clone();
    let size = (PLACES * STRIDE) as usize / size_of::<u32>();
    read_back_words(&counters.counts, (0, size), &device, &queue, move |words| {
        let word = |place: Place, which: usize| {
            let at = (place as u64 * STRIDE) as usize / size_of::<u32>() + which;
            u64::from(words.get(at).copied().unwrap_or(0))
        };
        for which in 0..2 {
            let found = [
                word(Place::AfterDirect, which).saturating_sub(word(Place::BeforeDirect, which)),
                word(Place::Specular, which),
                word(Place::Diffuse, which),
                word(Place::AfterFilter, which).saturating_sub(word(Place::BeforeFilter, which)),
            ];
            for (names, found) in FAULT_COUNTERS.iter().zip(found) {
                ledger.set_counter(names[which], found);
            }
        }
    });
}
