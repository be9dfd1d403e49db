//! What passes of several effects make in the same way, so that the engine is touched in one place.

use bevy::image::ToExtents;
use bevy::math::UVec2;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_phase::TrackedRenderPass;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::render::view::ViewTarget;

/// A texture of one value a pixel that one pass stores and others load.
///
/// A side of 0 counts as 1: there are no empty textures.
pub fn storage_texture(
    device: &RenderDevice,
    label: &'static str,
    size: UVec2,
    format: TextureFormat,
) -> TextureView {
    let descriptor = TextureDescriptor {
        label: Some(label),
        size: size.max(UVec2::ONE).to_extents(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING,
        view_formats: &[],
    };
    let texture = device.create_texture(&descriptor);
    texture.create_view(&TextureViewDescriptor::default())
}

/// Layout of a compute pass whose bindings are numbered as they stand.
pub fn compute_layout(
    label: &'static str,
    entries: impl IntoIterator<Item = BindGroupLayoutEntryBuilder>,
) -> BindGroupLayoutDescriptor {
    let entries: Vec<BindGroupLayoutEntry> = (0..)
        .zip(entries)
        .map(|(binding, entry)| entry.build(binding, ShaderStages::COMPUTE))
        .collect();
    BindGroupLayoutDescriptor::new(label, &entries)
}

/// A colour target that keeps its alpha. With `blend`, light is added to what it holds; few GPUs can do that with 32-bit floats.
pub fn light_target(format: TextureFormat, blend: bool) -> ColorTargetState {
    let add = BlendComponent {
        src_factor: BlendFactor::One,
        dst_factor: BlendFactor::One,
        operation: BlendOperation::Add,
    };
    ColorTargetState {
        format,
        blend: blend.then_some(BlendState {
            color: add,
            alpha: add,
        }),
        write_mask: ColorWrites::COLOR,
    }
}

/// Bilinear filtering, clamped to the edge.
pub fn linear_sampler(device: &RenderDevice, label: &'static str) -> Sampler {
    device.create_sampler(&SamplerDescriptor {
        label: Some(label),
        mag_filter: FilterMode::Linear,
        min_filter: FilterMode::Linear,
        ..default()
    })
}

/// Bytes of the texture of [`ltc_table`].
pub const LTC_TABLE_BYTES: u64 = akari_math::ltc::table::TABLE_BYTES.len() as u64;

/// The fitted table of linearly transformed cosines as a texture array of two layers: M⁻¹, and magnitudes.
pub fn ltc_table(device: &RenderDevice, queue: &RenderQueue, label: &'static str) -> TextureView {
    use akari_math::ltc::table::{SIZE, TABLE_BYTES};
    let descriptor = TextureDescriptor {
        label: Some(label),
        size: Extent3d {
            depth_or_array_layers: 2,
            ..UVec2::splat(SIZE as u32).to_extents()
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: TextureFormat::Rgba16Float,
        usage: TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    };
    let order = TextureDataOrder::LayerMajor;
    let texture = device.create_texture_with_data(queue, &descriptor, order, TABLE_BYTES);
    texture.create_view(&TextureViewDescriptor {
        dimension: Some(TextureViewDimension::D2Array),
        ..default()
    })
}

/// An image that a pass draws on, all zeros before.
pub fn cleared(view: &TextureView) -> RenderPassColorAttachment<'_> {
    RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: Operations {
            load: LoadOp::Clear(LinearRgba::NONE.into()),
            store: StoreOp::Store,
        },
    }
}

/// Runs one pass that draws over a camera's part of the picture, in a time span of the same name.
pub fn draw_on_picture<'a>(
    ctx: &'a mut RenderContext,
    label: &'static str,
    target: &ViewTarget,
    camera: &ExtractedCamera,
    draw: impl FnOnce(&mut TrackedRenderPass<'a>),
) {
    let attachment = target.get_unsampled_color_attachment();
    draw_on(ctx, label, attachment, |pass| {
        if let Some(viewport) = &camera.viewport {
            pass.set_camera_viewport(viewport);
        }
        draw(pass);
    });
}

/// Runs one pass that draws on one image, in a time span of the same name.
pub fn draw_on<'a>(
    ctx: &'a mut RenderContext,
    label: &'static str,
    attachment: RenderPassColorAttachment,
    draw: impl FnOnce(&mut TrackedRenderPass<'a>),
) {
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some(label),
        color_attachments: &[Some(attachment)],
        ..default()
    });
    let span = diagnostics.pass_span(&mut pass, label);
    draw(&mut pass);
    span.end(&mut pass);
}

/// Runs one compute pass in a time span of the same name.
pub fn compute(ctx: &mut RenderContext, label: &'static str, work: impl FnOnce(&mut ComputePass)) {
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, label);
    {
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor {
            label: Some(label),
            timestamp_writes: None,
        });
        work(&mut pass);
    }
    span.end(encoder);
}
