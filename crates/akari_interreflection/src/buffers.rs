//! What the passes read that outlives a frame: reflectors and their clusters, what rays walk, and the environment map.

use crate::EFFECT;
use crate::blockers::Blockers;
use crate::clusters::Clusters;
use crate::geometry::bends;
use crate::scene::{BlockerScene, Triangles, ViewInterreflection};
use crate::shading::ReflectorKinds;
use crate::types::{GpuBlockerNode, GpuCluster, GpuClusterLight, GpuReflectedSky, GpuTriangle};
use akari_render::prelude::*;
use akari_render::sky::{SkyMap, last_level};
use bevy::prelude::*;
use bevy::render::render_resource::encase::private::WriteInto;
use bevy::render::render_resource::*;
use bevy::render::renderer::RenderDevice;
use bevy::render::texture::GpuImage;

/// Elements as the GPU reads them; one default element where there are none, since a binding cannot be empty.
pub fn storage<T: ShaderType + WriteInto + ShaderSize + Default + Clone>(
    device: &RenderDevice,
    label: &'static str,
    elements: &[T],
) -> Buffer {
    let padded = if elements.is_empty() {
        vec![T::default()]
    } else {
        elements.to_vec()
    };
    let mut bytes = encase::StorageBuffer::new(Vec::new());
    if let Err(error) = bytes.write(&padded) {
        error!("interreflection: {label} could not be written: {error}");
    }
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some(label),
        contents: bytes.as_ref(),
        usage: BufferUsages::STORAGE,
    })
}
/// The environment map as the passes read it.
pub struct BoundSky {
    /// How to read the map.
    pub uniform: Buffer,
    /// The map, a cube.
    pub map: TextureView,
    /// Its sampler.
    pub sampler: Sampler,
    /// Whether what it shows changes.
    pub changes: bool,
}

impl BoundSky {
    pub fn new(device: &RenderDevice, map: &SkyMap, image: &GpuImage, changes: bool) -> Self {
        let mut bytes = encase::UniformBuffer::new(Vec::new());
        let uniform = GpuReflectedSky {
            to_map: map.to_map(),
            intensity: map.intensity,
            last_level: last_level(image),
        };
        if let Err(error) = bytes.write(&uniform) {
            error!("interreflection: the sky's uniform could not be written: {error}");
        }
        Self {
            uniform: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("akari_interreflection_sky"),
                contents: bytes.as_ref(),
                usage: BufferUsages::UNIFORM,
            }),
            map: image.texture_view.clone(),
            sampler: image.sampler.clone(),
            changes,
        }
    }
}

/// Triangles and their clusters on the GPU.
#[derive(Clone)]
pub struct Tree {
    /// What they were made of.
    pub source: Triangles,
    /// Whether there are clusters.
    pub clustered: bool,
    /// Triangles, in the order of the clusters.
    pub triangles: Buffer,
    /// Clusters of patches, then of glossy triangles.
    pub clusters: Buffer,
    /// Where the levels of the tree of patches begin in what follows, and their clusters from the leaves up.
    pub order: Buffer,
    /// What each cluster of patches sends.
    pub cluster_light: Buffer,
    /// Clusters of patches.
    pub of_patches: u32,
    /// All clusters.
    pub count: u32,
    /// Levels of the tree of patches.
    pub levels: u32,
    /// What the shading passes have to know.
    pub kinds: ReflectorKinds,
    /// Lowest corner of the box around all triangles.
    pub low: Vec3,
    /// Highest corner of that box.
    pub high: Vec3,
}

impl Tree {
    pub fn new(device: &RenderDevice, source: Triangles, clustered: bool, alphas: &[f32]) -> Self {
        let mut ordered = source.triangles.clone();
        let clusters = if clustered {
            Clusters::new(&mut ordered, source.patches, alphas)
        } else {
            Clusters::default()
        };
        let light = u64::from(clusters.of_patches.max(1)) * GpuClusterLight::min_size().get();
        let mirrors = &source.triangles[source.patches as usize..];
        let of_mirrors = &clusters.clusters[clusters.of_patches as usize..];
        let (low, high) = (source.triangles.iter())
            .flat_map(|triangle| [triangle.a, triangle.b, triangle.c])
            .fold((Vec3::MAX, Vec3::MIN), |(low, high), corner| {
                (low.min(corner), high.max(corner))
            });
        Self {
            clustered,
            triangles: storage::<GpuTriangle>(device, "akari_interreflection_triangles", &ordered),
            clusters: storage::<GpuCluster>(
                device,
                "akari_interreflection_clusters",
                &clusters.clusters,
            ),
            order: storage::<u32>(device, "akari_interreflection_order", &clusters.order),
            cluster_light: device.create_buffer(&BufferDescriptor {
                label: Some("akari_interreflection_cluster_light"),
                size: light,
                usage: BufferUsages::STORAGE,
                mapped_at_creation: false,
            }),
            of_patches: clusters.of_patches,
            count: clusters.clusters.len() as u32,
            levels: clusters.levels,
            kinds: ReflectorKinds {
                patches: source.patches > 0,
                mirrors: !mirrors.is_empty(),
                bends: mirrors.iter().any(bends) || of_mirrors.iter().any(GpuCluster::bends),
                clusters: !clusters.clusters.is_empty(),
            },
            low,
            high,
            source,
        }
    }

    pub fn bytes(&self) -> u64 {
        self.triangles.size() + self.clusters.size() + self.order.size() + self.cluster_light.size()
    }
}

/// What rays walk on the GPU, for all views.
#[derive(Resource, Default)]
pub struct SharedBlockers(pub Option<BlockerBuffers>);

/// What rays walk on the GPU.
pub struct BlockerBuffers {
    /// Version of what it was made of.
    pub version: u64,
    /// The tree of boxes.
    pub nodes: Buffer,
    /// Three corners of each triangle.
    pub corners: Buffer,
    /// How many of them there are.
    pub triangles: u32,
}

impl BlockerBuffers {
    pub fn new(device: &RenderDevice, scene: &BlockerScene) -> Self {
        let bodies = scene.bodies.iter().map(|body| &**body);
        let Blockers { mut nodes, corners } = Blockers::new(bodies);
        if nodes.is_empty() {
            // What stands for none leads to the end.
            nodes.push(GpuBlockerNode {
                skip: 1,
                low: Vec3::MAX,
                high: Vec3::MAX,
                leaf: 0,
            });
        }
        Self {
            version: scene.version,
            nodes: storage::<GpuBlockerNode>(device, "akari_interreflection_blockers", &nodes),
            triangles: (corners.len() / 3) as u32,
            corners: device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("akari_interreflection_blocker_corners"),
                // A binding cannot be empty.
                contents: if corners.is_empty() {
                    bytemuck::bytes_of(&Vec4::ZERO)
                } else {
                    bytemuck::cast_slice(&corners)
                },
                usage: BufferUsages::STORAGE,
            }),
        }
    }

    pub fn bytes(&self) -> u64 {
        self.nodes.size() + self.corners.size()
    }
}

/// Uploads what rays may meet where it changed, and lets go of it once no view sends any.
pub fn prepare_blockers(
    mut shared: ResMut<SharedBlockers>,
    views: Query<&ViewInterreflection>,
    scene: Res<BlockerScene>,
    device: Res<RenderDevice>,
    ledger: Res<GpuLedger>,
) {
    let wanted = views.iter().any(|view| view.settings.shadow_rays > 0);
    let version = shared.0.as_ref().map(|blockers| blockers.version);
    if version == wanted.then_some(scene.version) {
        return;
    }
    shared.0 = wanted.then(|| BlockerBuffers::new(&device, &scene));
    let (bytes, triangles) = (shared.0.as_ref()).map_or((0, 0), |blockers| {
        (blockers.bytes(), u64::from(blockers.triangles))
    });
    ledger.set_bytes(EFFECT, "blockers", bytes);
    ledger.set_counter("interreflection triangles that hide", triangles);
}
