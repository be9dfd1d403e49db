#define_import_path akari_voxel_gi::casters

// Where the casters are whose shadows nobody else throws: boxes about them. What voxels hold there counts as theirs.

const MOST_BOXES: u32 = 32u;

// As `GpuCasters` in `soft_shadows.rs`.
struct Casters {
    // Low and high corners, relative to the anchor, metres.
    corners: array<vec4<f32>, 64>,
    count: u32,
}

@group(2) @binding(3) var<uniform> casters: Casters;

// Whether a position, relative to the anchor, is in one of the boxes, or closer to it than `slack` along each axis.
fn in_caster(position: vec3<f32>, slack: f32) -> bool {
    for (var i = 0u; i < min(casters.count, MOST_BOXES); i++) {
        if all(position >= casters.corners[2u * i].xyz - slack) && all(position <= casters.corners[2u * i + 1u].xyz + slack) {
            return true;
        }
    }
    return false;
}
