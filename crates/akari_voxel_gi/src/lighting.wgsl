#define_import_path akari_voxel_gi::lighting

// What lights the voxels, as in `lights.rs`, and what the two lighting passes share.

// As `GpuVoxelLighting`.
struct VoxelLighting {
    // Radiance of whatever is seen beside all voxels, nits.
    sky: vec3<f32>,
    // Lights in `lights`.
    light_count: u32,
    // Counts up with each frame.
    frame: u32,
    // Cones that each face gathers with in a frame.
    cones: u32,
    // Share of this frame in the mean over frames.
    rate: f32,
    // Width of the cones over that of their cells.
    aperture: f32,
    // Farthest that light is gathered from, metres.
    reach: f32,
    // Rays to each area light.
    light_rays: u32,
    pad_a: u32,
    pad_b: u32,
}

@group(0) @binding(0) var<uniform> lighting: VoxelLighting;
@group(0) @binding(1) var<storage, read> page_owner: array<u32>;
