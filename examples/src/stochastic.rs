//! A producer of noisy light, small enough to be read: what a renderer has to do to have its signal cleaned up.
//!
//! On the camera, [`StochasticReflections`] brings a [`DenoiseInput`] whose images it keeps at the camera's size and
//! whose frames it counts. In the render world, a compute pass in [`AkariPassSystems::Signals`] draws a direction from
//! the GGX lobe of each texel's surface, casts a ray at all [`Reflected`] shapes, and writes radiance and hit distance.
//! Surfaces come from [`ViewGuides`], which the denoiser's camera has anyway. A second pass, in
//! [`AkariPassSystems::Resample`], shades the pixels that the denoiser lists.
//!
//! The rays are cast at the shapes themselves, not at meshes, and one bounce deep: a [`Reflected`] stands beside each
//! mesh, and what has none is not reflected. A ray tracer would replace `cast_ray` in `stochastic.wgsl`.

use crate::demo::Restart;
use bevy::asset::{AssetEventSystems, embedded_asset, load_embedded_asset};
use bevy::camera::CameraUpdateSystems;
use bevy::core_pipeline::schedule::Core3d;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::view::ViewUniformOffset;
use bevy::render::{Extract, ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::shader::ShaderDefVal;
use bevy_akari::area_light::emissive::NoAreaLight;
use bevy_akari::prelude::*;
use bevy_akari::render::guides::ViewGuides;
use bevy_akari::render::signals::{AkariPassSystems, ResampleList, ViewSignals};

/// Label of the pass that fills the signal, and of its time span.
pub const TRACE_LABEL: &str = "example_trace";
/// Label of the pass that shades pixels again, and of its time span.
pub const RETRACE_LABEL: &str = "example_retrace";
/// Format of the radiance.
const RADIANCE_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
/// Format of the hit distance.
const HIT_DISTANCE_FORMAT: TextureFormat = TextureFormat::R32Float;
/// Invocations of a workgroup in each direction, as in the shader.
const WORKGROUP: u32 = 8;

/// Makes the reflections of cameras with [`StochasticReflections`].
pub struct StochasticPlugin;

/// On a camera: its surfaces reflect the [`Reflected`] shapes, by a few random rays a pixel.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
#[require(DenoiseInput)]
pub struct StochasticReflections {
    /// Rays for each texel of the signal.
    pub samples: u32,
    /// Rays for each pixel that the denoiser asks for.
    pub samples_again: u32,
    /// Resolution of the signal.
    pub scale: SignalScale,
    /// Begins anew in the next frame: the same random numbers, no history. A camera cut needs it.
    pub restart: bool,
}

impl Default for StochasticReflections {
    fn default() -> Self {
        Self {
            samples: 1,
            samples_again: 4,
            scale: SignalScale::Full,
            restart: true,
        }
    }
}

/// What rays can hit, in the frame of its entity: it shines evenly with a radiance in nits.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
#[require(Transform, Visibility)]
pub struct Reflected {
    /// Its outline.
    pub shape: ReflectedShape,
    /// What it shines with.
    pub radiance: LinearRgba,
}

/// Outline of a [`Reflected`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReflectedShape {
    /// In the plane of x and y, seen from +z only.
    Rectangle(Rectangle),
    /// Around the origin. Scaled by the x axis.
    Sphere(Sphere),
}

impl Reflected {
    /// The shape together with the mesh that the camera sees. It reflects as `surface` says and is not made a
    /// [`PolygonLight`] of.
    pub fn with_mesh(
        self,
        surface: StandardMaterial,
        meshes: &mut Assets<Mesh>,
        materials: &mut Assets<StandardMaterial>,
    ) -> impl Bundle {
        let mesh = match self.shape {
            ReflectedShape::Rectangle(rectangle) => meshes.add(rectangle),
            // Fine enough that its silhouette is the sphere's to a fraction of a pixel.
            ReflectedShape::Sphere(sphere) => meshes.add(sphere.mesh().uv(96, 64)),
        };
        let material = materials.add(StandardMaterial {
            emissive: self.radiance,
            ..surface
        });
        (self, Mesh3d(mesh), MeshMaterial3d(material), NoAreaLight)
    }

    /// As a panel that reflects nothing itself.
    pub fn panel(
        self,
        meshes: &mut Assets<Mesh>,
        materials: &mut Assets<StandardMaterial>,
    ) -> impl Bundle {
        let black = StandardMaterial {
            base_color: Color::BLACK,
            reflectance: 0.0,
            perceptual_roughness: 1.0,
            ..default()
        };
        self.with_mesh(black, meshes, materials)
    }
}

/// Field by field as `Reflections` in the shader.
#[derive(ShaderType, Debug, Clone, Copy, Default)]
struct GpuReflections {
    size: UVec2,
    scale: u32,
    frame: u32,
    samples: u32,
    samples_again: u32,
    shapes: u32,
}

/// Field by field as `Shape` in the shader.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
struct GpuShape {
    center: Vec3,
    radius: f32,
    axis_x: Vec3,
    half_x: f32,
    axis_y: Vec3,
    half_y: f32,
    radiance: Vec3,
}

impl GpuShape {
    fn new(reflected: &Reflected, transform: &GlobalTransform) -> Self {
        let matrix = transform.affine().matrix3;
        let radiance = reflected.radiance.to_vec3();
        let center = transform.translation();
        match reflected.shape {
            ReflectedShape::Sphere(sphere) => Self {
                center,
                radius: sphere.radius * Vec3::from(matrix.x_axis).length(),
                radiance,
                ..default()
            },
            ReflectedShape::Rectangle(rectangle) => {
                let (axis_x, length_x) = Vec3::from(matrix.x_axis).normalize_and_length();
                let (axis_y, length_y) = Vec3::from(matrix.y_axis).normalize_and_length();
                Self {
                    center,
                    radius: 0.0,
                    axis_x,
                    half_x: rectangle.half_size.x * length_x,
                    axis_y,
                    half_y: rectangle.half_size.y * length_y,
                    radiance,
                }
            }
        }
    }
}

impl Plugin for StochasticPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "stochastic.wgsl");
        app.add_systems(
            PostUpdate,
            // New images still go to the GPU in this frame.
            write_inputs
                .after(CameraUpdateSystems)
                .before(AssetEventSystems),
        )
        .add_observer(
            |_: On<Restart>, mut cameras: Query<&mut StochasticReflections>| {
                for mut reflections in &mut cameras {
                    reflections.restart = true;
                }
            },
        );
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            return;
        };
        render_app
            .init_resource::<ShapeBuffer>()
            .init_resource::<TracePipelines>()
            .add_systems(ExtractSchedule, (extract_shapes, extract_views))
            .add_systems(
                Render,
                (
                    write_shapes.in_set(RenderSystems::PrepareResources),
                    prepare_views.in_set(RenderSystems::PrepareBindGroups),
                ),
            )
            .add_systems(
                Core3d,
                (
                    trace.in_set(AkariPassSystems::Signals),
                    retrace.in_set(AkariPassSystems::Resample),
                ),
            );
    }
}

/// Keeps the images at the size of the camera's target, and counts the frames.
fn write_inputs(
    mut cameras: Query<(&Camera, &mut StochasticReflections, &mut DenoiseInput)>,
    mut images: ResMut<Assets<Image>>,
) {
    for (camera, mut reflections, mut input) in &mut cameras {
        let Some(size) = camera.physical_target_size() else {
            continue;
        };
        let texels = size.map(|pixels| pixels.div_ceil(reflections.scale.pixels()));
        let held = input.specular.as_ref().and_then(|image| images.get(image));
        if held.map(Image::size) != Some(texels) {
            let mut add = |format| {
                let mut image = Image::new_target_texture(texels.x, texels.y, format, None);
                image.texture_descriptor.usage |= TextureUsages::STORAGE_BINDING;
                Some(images.add(image))
            };
            input.specular = add(RADIANCE_FORMAT);
            input.hit_distance = add(HIT_DISTANCE_FORMAT);
        }
        input.scale = reflections.scale;
        input.reset = reflections.restart;
        input.frame = if reflections.restart {
            0
        } else {
            input.frame.wrapping_add(1)
        };
        if reflections.restart {
            reflections.restart = false;
        }
    }
}

/// All shapes of the scene.
#[derive(Resource, Default)]
struct ShapeBuffer(StorageBuffer<Vec<GpuShape>>);

fn extract_shapes(
    shapes: Extract<Query<(&Reflected, &GlobalTransform, &InheritedVisibility)>>,
    mut buffer: ResMut<ShapeBuffer>,
) {
    let list = buffer.0.get_mut();
    list.clear();
    list.extend(
        shapes
            .iter()
            .filter(|(_, _, visible)| visible.get())
            .map(|(reflected, transform, _)| GpuShape::new(reflected, transform)),
    );
}

fn write_shapes(
    mut buffer: ResMut<ShapeBuffer>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    buffer.0.write_buffer(&device, &queue);
}

/// On a view in the render world: reflections are traced for it.
#[derive(Component)]
struct ViewReflections(StochasticReflections);

/// How, in this frame.
#[derive(Component)]
struct PreparedReflections {
    uniform: UniformBuffer<GpuReflections>,
    pipelines: Pipelines,
    texels: UVec2,
}

fn extract_views(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, &Camera, &StochasticReflections)>>,
    marked: Query<Entity, With<ViewReflections>>,
) {
    let mut wanted = HashSet::new();
    for (view, camera, reflections) in &cameras {
        if camera.is_active {
            wanted.insert(view);
            commands.entity(view).insert(ViewReflections(*reflections));
        }
    }
    for view in marked.iter().filter(|view| !wanted.contains(view)) {
        commands
            .entity(view)
            .remove::<(ViewReflections, PreparedReflections)>();
    }
}

/// The two passes.
#[derive(Debug, Clone, Copy)]
struct Pipelines {
    trace: CachedComputePipelineId,
    retrace: CachedComputePipelineId,
}

/// The pipelines for each way in which guides are declared.
#[derive(Resource, Default)]
struct TracePipelines(HashMap<Vec<ShaderDefVal>, Pipelines>);

fn trace_layout() -> BindGroupLayoutDescriptor {
    let store = |format| texture_storage_2d(format, StorageTextureAccess::WriteOnly);
    BindGroupLayoutDescriptor::new(
        TRACE_LABEL,
        &BindGroupLayoutEntries::with_indices(
            ShaderStages::COMPUTE,
            (
                (0, uniform_buffer::<GpuReflections>(false)),
                (1, storage_buffer_read_only_sized(false, None)),
                (2, store(RADIANCE_FORMAT)),
                (3, store(HIT_DISTANCE_FORMAT)),
            ),
        ),
    )
}

fn retrace_layout() -> BindGroupLayoutDescriptor {
    BindGroupLayoutDescriptor::new(
        RETRACE_LABEL,
        &BindGroupLayoutEntries::with_indices(
            ShaderStages::COMPUTE,
            (
                (0, uniform_buffer::<GpuReflections>(false)),
                (1, storage_buffer_read_only_sized(false, None)),
                (4, storage_buffer_read_only_sized(false, None)),
                (5, storage_buffer_sized(false, None)),
            ),
        ),
    )
}

fn prepare_views(
    mut commands: Commands,
    mut views: Query<(
        Entity,
        &ViewReflections,
        &ViewSignals,
        &ViewGuides,
        Option<&mut PreparedReflections>,
    )>,
    shapes: Res<ShapeBuffer>,
    mut pipelines: ResMut<TracePipelines>,
    cache: Res<PipelineCache>,
    assets: Res<AssetServer>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    for (entity, ViewReflections(settings), signals, guides, existing) in &mut views {
        // The guides declare their bindings by definitions, so that each set of these has pipelines of its own.
        let pipelines = *pipelines
            .0
            .entry(guides.shader_defs.clone())
            .or_insert_with_key(|shader_defs| {
                let queue = |label: &'static str, entry_point: &'static str, layout| {
                    cache.queue_compute_pipeline(ComputePipelineDescriptor {
                        label: Some(label.into()),
                        layout: vec![guides.layout.clone(), layout],
                        shader: load_embedded_asset!(assets.as_ref(), "stochastic.wgsl"),
                        shader_defs: shader_defs.clone(),
                        entry_point: Some(entry_point.into()),
                        ..default()
                    })
                };
                Pipelines {
                    trace: queue(TRACE_LABEL, "trace", trace_layout()),
                    retrace: queue(RETRACE_LABEL, "retrace", retrace_layout()),
                }
            });
        let values = GpuReflections {
            size: guides.size,
            scale: signals.scale,
            frame: signals.frame,
            samples: settings.samples,
            samples_again: settings.samples_again,
            shapes: shapes.0.get().len() as u32,
        };
        let texels = guides.size.map(|pixels| pixels.div_ceil(signals.scale));
        if let Some(mut prepared) = existing {
            prepared.uniform.set(values);
            prepared.uniform.write_buffer(&device, &queue);
            prepared.pipelines = pipelines;
            prepared.texels = texels;
        } else {
            let mut uniform = UniformBuffer::from(values);
            uniform.write_buffer(&device, &queue);
            commands.entity(entity).insert(PreparedReflections {
                uniform,
                pipelines,
                texels,
            });
        }
    }
}

/// Fills the images of the signal.
fn trace(
    view: ViewQuery<(
        &PreparedReflections,
        &ViewSignals,
        &ViewGuides,
        &ViewUniformOffset,
    )>,
    shapes: Res<ShapeBuffer>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (prepared, signals, guides, view_offset) = view.into_inner();
    let (Some(guides), Some(radiance), Some(hit_distance)) =
        (&guides.group, &signals.specular, &signals.hit_distance)
    else {
        return;
    };
    let (Some(pipeline), Some(uniform), Some(shapes)) = (
        cache.get_compute_pipeline(prepared.pipelines.trace),
        prepared.uniform.binding(),
        shapes.0.binding(),
    ) else {
        return;
    };
    let group = ctx.render_device().create_bind_group(
        TRACE_LABEL,
        &cache.get_bind_group_layout(&trace_layout()),
        &BindGroupEntries::with_indices((
            (0, uniform),
            (1, shapes),
            (2, radiance),
            (3, hit_distance),
        )),
    );
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, TRACE_LABEL);
    {
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor {
            label: Some(TRACE_LABEL),
            timestamp_writes: None,
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, guides, &[view_offset.offset]);
        pass.set_bind_group(1, &group, &[]);
        let groups = prepared.texels.map(|texels| texels.div_ceil(WORKGROUP));
        pass.dispatch_workgroups(groups.x, groups.y, 1);
    }
    span.end(encoder);
}

/// Shades the listed pixels. Their number is known to the GPU only: it writes the size of the dispatch itself.
fn retrace(
    view: ViewQuery<(
        &PreparedReflections,
        &ResampleList,
        &ViewGuides,
        &ViewUniformOffset,
    )>,
    shapes: Res<ShapeBuffer>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (prepared, list, guides, view_offset) = view.into_inner();
    let (Some(guides), Some(pipeline), Some(uniform), Some(shapes)) = (
        &guides.group,
        cache.get_compute_pipeline(prepared.pipelines.retrace),
        prepared.uniform.binding(),
        shapes.0.binding(),
    ) else {
        return;
    };
    let group = ctx.render_device().create_bind_group(
        RETRACE_LABEL,
        &cache.get_bind_group_layout(&retrace_layout()),
        &BindGroupEntries::with_indices((
            (0, uniform),
            (1, shapes),
            (4, list.pixels.as_entire_binding()),
            (5, list.radiance.as_entire_binding()),
        )),
    );
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, RETRACE_LABEL);
    {
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor {
            label: Some(RETRACE_LABEL),
            timestamp_writes: None,
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, guides, &[view_offset.offset]);
        pass.set_bind_group(1, &group, &[]);
        pass.dispatch_workgroups_indirect(&list.indirect, 0);
    }
    span.end(encoder);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn shapes_follow_their_transforms() {
        let rectangle = Reflected {
            shape: ReflectedShape::Rectangle(Rectangle::new(2.0, 4.0)),
            radiance: LinearRgba::rgb(1.0, 2.0, 3.0),
        };
        let placed = Transform::from_xyz(1.0, 2.0, 3.0)
            .with_rotation(Quat::from_rotation_y(FRAC_PI_2))
            .with_scale(Vec3::new(3.0, 0.5, 1.0));
        let shape = GpuShape::new(&rectangle, &placed.into());
        assert_eq!(
            (shape.center, shape.radius),
            (Vec3::new(1.0, 2.0, 3.0), 0.0)
        );
        assert!((shape.half_x - 3.0).abs() < 1e-5 && (shape.half_y - 1.0).abs() < 1e-5);
        // +z, the side that shines, has turned to +x.
        let normal = shape.axis_x.cross(shape.axis_y);
        assert!(normal.abs_diff_eq(Vec3::X, 1e-5), "{normal}");

        let sphere = Reflected {
            shape: ReflectedShape::Sphere(Sphere::new(0.5)),
            ..rectangle
        };
        let shape = GpuShape::new(&sphere, &placed.with_scale(Vec3::splat(2.0)).into());
        assert!((shape.radius - 1.0).abs() < 1e-5);
        assert_eq!(shape.radiance, Vec3::new(1.0, 2.0, 3.0));
    }
}
