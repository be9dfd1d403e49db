//! Settings of the voxel GI of a camera.

use crate::clipmap::ClipmapShape;
use crate::demand::SignalsOfVoxels;
use crate::types::MOST_PAGES;
use akari_render::camera::GathersBounces;
use akari_render::prelude::*;
use akari_render::signals::stop_signals;
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Asks for indirect light by voxels on this camera.
///
/// There is one clipmap: it follows the first active camera (by [`Camera::order`]) that has this component, with that
/// one's settings of space and memory.
#[derive(Component, Debug, Clone, Copy, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[require(AkariCamera, GathersBounces)]
#[component(on_remove = stop)]
#[serde(default, deny_unknown_fields)]
pub struct VoxelGi {
    /// Voxels along each axis of a cascade: 32, 64, 128 or 256 (others are rounded up).
    pub resolution: u32,
    /// Cascades, each twice as wide as the one before. 1 to 5.
    pub cascades: u32,
    /// Edge of a voxel of the first cascade, metres. 10⁻⁴ to 10⁴.
    pub voxel_size: f32,
    /// Pages of 16 voxels of the pool, 1,024 to 65,535. Where they run out, bricks stay empty, and a warning says so.
    pub pages: u32,
    /// Most bricks of 4³ voxels that are made from triangles in a frame. 1 to 65,535.
    pub bricks_per_frame: u32,
    /// Whether light bounces more than once: each frame adds a bounce to what the voxels send out. Without it metal mirrors lamps
    /// and the sky alone.
    pub feedback: bool,
    /// Cones of the hemisphere of each pixel: 1, 5, 9 or 16 (others count as the next smaller one).
    pub cones: u32,
    /// Cones of the specular lobe of each pixel, 0 to 4; 0 reflects nothing.
    pub specular_cones: u32,
    /// Width of cones, as a share of that of the cells of the hemisphere, or of the lobe, that they stand for. 0 to 1:
    /// narrow ones see sharper and cost more.
    pub aperture: f32,
    /// Pixels per traced one and axis: 1, 2 or 4.
    pub scale: u32,
    /// Cones of the hemisphere of each voxel's face in a frame: 1, 5, 9 or 16.
    pub gather_cones: u32,
    /// Visits over which a voxel's light is averaged, 1 to 256. A visit is a frame where `pages_per_frame` is enough for
    /// all pages.
    pub history: u32,
    /// Most pages of 16 voxels that are lit in a frame, 256 to 65,535. Where there are more, they have their turns: a
    /// change of the lights is seen everywhere within `4 pages / pages_per_frame` frames.
    pub pages_per_frame: u32,
    /// Rays from each voxel to each area light, 1 to 64.
    pub light_rays: u32,
    /// Cones from each pixel to each area light, for the shadows of what is in no bake: 0, 1, 4, 9 or 16 (others count as the
    /// next smaller one). 0 throws none. Of the four lights that send the most to the camera, see [`crate::soft_shadows`].
    pub shadow_cones: u32,
    /// March plain isotropic cones, as voxel cone tracing is commonly done: one opacity for all directions, one colour for
    /// all faces. They leak; here for comparison.
    pub plain_cones: bool,
}

/// Takes away what the component brought.
fn stop(mut world: DeferredWorld, context: HookContext) {
    if let Ok(mut camera) = world.commands().get_entity(context.entity) {
        camera.try_remove::<(GathersBounces, SignalsOfVoxels)>();
    }
    stop_signals(world, context);
}

impl VoxelGi {
    /// Knobs that a frame's budget leaves where they are: those that make all voxels anew, and those that say what is drawn,
    /// not how exactly.
    pub const FIXED_KNOBS: [&str; 9] = [
        "resolution",
        "cascades",
        "voxel_size",
        "pages",
        "bricks_per_frame",
        "feedback",
        "specular_cones",
        "shadow_cones",
        "plain_cones",
    ];

    /// Pixels per traced one and axis.
    pub fn signal_scale(&self) -> u32 {
        match self.scale {
            0 | 1 => 1,
            2 | 3 => 2,
            _ => 4,
        }
    }

    /// Sizes of the clipmap.
    pub fn shape(&self) -> ClipmapShape {
        ClipmapShape::new(self.resolution, self.cascades, self.voxel_size)
    }

    /// Pages of the pool.
    pub fn page_count(&self) -> u32 {
        self.pages.clamp(FEWEST_PAGES, MOST_PAGES)
    }

    /// Most bricks to make in a frame.
    pub fn brick_cap(&self) -> u32 {
        self.bricks_per_frame.clamp(1, MOST_BRICKS)
    }
}

const FEWEST_PAGES: u32 = 1024;
/// Most workgroups of a dispatch along an axis, by the WebGPU limits.
const MOST_BRICKS: u32 = 65_535;

impl Default for VoxelGi {
    fn default() -> Self {
        Self::preset(Quality::default())
    }
}

impl Knobs for VoxelGi {
    const KNOBS: &'static [Knob] = &[
        Knob {
            name: "resolution",
            what: "voxels along each axis of a cascade: 32, 64, 128, 256",
            min: 32.0,
            max: 256.0,
            integer: true,
            presets: [64.0, 128.0, 128.0, 256.0],
            cost: "surfaces in a cascade, and the pages they need, grow with its square",
        },
        Knob {
            name: "cascades",
            what: "cascades, each twice as wide as the one before",
            min: 1.0,
            max: 5.0,
            integer: true,
            presets: [3.0, 3.0, 3.0, 4.0],
            cost: "each costs as much as the first, where there are surfaces",
        },
        Knob {
            name: "voxel_size",
            what: "edge of a voxel of the first cascade, metres",
            min: 1e-4,
            max: 1e4,
            integer: false,
            presets: [0.125, 0.0625, 0.0625, 0.03125],
            cost: "none by itself: a smaller one makes the cascades reach less far",
        },
        Knob {
            name: "pages",
            what: "pages of 16 voxels",
            min: FEWEST_PAGES as f32,
            max: MOST_PAGES as f32,
            integer: true,
            presets: [8192.0, 16384.0, 28672.0, 65535.0],
            cost: "1.3 to 2 KB each",
        },
        Knob {
            name: "bricks_per_frame",
            what: "most bricks of 4³ voxels that are made from triangles in a frame",
            min: 1.0,
            max: MOST_BRICKS as f32,
            integer: true,
            presets: [1024.0, 2048.0, 4096.0, 8192.0],
            cost: "time of a frame in which much changes; fewer bricks lag behind longer",
        },
        Knob {
            name: "feedback",
            what: "1: light bounces again and again; 0: once",
            min: 0.0,
            max: 1.0,
            integer: true,
            presets: [1.0, 1.0, 1.0, 1.0],
            cost: "cones from the voxels in each frame, and 384 bytes a page",
        },
        Knob {
            name: "cones",
            what: "cones of the hemisphere of each pixel: 1, 5, 9, 16",
            min: 1.0,
            max: 16.0,
            integer: true,
            presets: [5.0, 5.0, 9.0, 16.0],
            cost: "time of the pass, in proportion",
        },
        Knob {
            name: "specular_cones",
            what: "cones of the specular lobe of each pixel; 0 reflects nothing",
            min: 0.0,
            max: 4.0,
            integer: true,
            presets: [1.0, 1.0, 1.0, 2.0],
            cost: "time of the pass, in proportion",
        },
        Knob {
            name: "aperture",
            what: "width of cones over that of what they stand for",
            min: 0.0,
            max: 1.0,
            integer: false,
            presets: [0.5, 0.25, 0.125, 0.125],
            cost: "less for wide cones, which see blurred, and lose light at edges: 6 % in a room that is turned against \
                   the grid with 0.5",
        },
        Knob {
            name: "scale",
            what: "pixels per traced one and axis: 1, 2, 4",
            min: 1.0,
            max: 4.0,
            integer: true,
            presets: [4.0, 2.0, 2.0, 1.0],
            cost: "less, by its square",
        },
        Knob {
            name: "gather_cones",
            what: "cones of the hemisphere of each voxel's face in a frame: 1, 5, 9, 16",
            min: 1.0,
            max: 16.0,
            integer: true,
            presets: [1.0, 1.0, 1.0, 5.0],
            cost: "time of the gathering, in proportion",
        },
        Knob {
            name: "history",
            what: "visits over which a voxel's light is averaged",
            min: 1.0,
            max: 256.0,
            integer: true,
            presets: [16.0, 32.0, 32.0, 64.0],
            cost: "none: changes of the light take that many visits",
        },
        Knob {
            name: "pages_per_frame",
            what: "most pages of 16 voxels that are lit in a frame",
            min: 256.0,
            max: MOST_PAGES as f32,
            integer: true,
            presets: [2048.0, 4096.0, 8192.0, 16384.0],
            cost: "time of injection and gathering, in proportion; fewer see changes later",
        },
        Knob {
            name: "light_rays",
            what: "rays from each voxel to each area light",
            min: 1.0,
            max: 64.0,
            integer: true,
            presets: [2.0, 4.0, 4.0, 8.0],
            cost: "time of the injection, in proportion",
        },
        Knob {
            name: "shadow_cones",
            what: "cones from each pixel to each area light, for shadows of what is in no bake: 0, 1, 4, 9, 16",
            min: 0.0,
            max: 16.0,
            integer: true,
            presets: [0.0, 4.0, 4.0, 9.0],
            cost: "time of the pass, in proportion to cones and lights; 0: no pass, no memory",
        },
        Knob {
            name: "plain_cones",
            what: "1: isotropic cones as commonly done, for comparison: they leak; 0: ours",
            min: 0.0,
            max: 1.0,
            integer: true,
            presets: [0.0, 0.0, 0.0, 0.0],
            cost: "less time, and light that comes through walls",
        },
    ];

    akari_render::knob_fields!(
        resolution,
        cascades,
        voxel_size,
        pages,
        bricks_per_frame,
        feedback,
        cones,
        specular_cones,
        scale,
        gather_cones,
        history,
        pages_per_frame,
        light_rays,
        aperture,
        shadow_cones,
        plain_cones
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_render::quality::knob_faults;

    #[test]
    fn fields_are_knobs() {
        let fields = [
            "resolution",
            "cascades",
            "voxel_size",
            "pages",
            "bricks_per_frame",
            "feedback",
            "cones",
            "specular_cones",
            "scale",
            "gather_cones",
            "history",
            "pages_per_frame",
            "light_rays",
            "aperture",
            "shadow_cones",
            "plain_cones",
        ];
        assert_eq!(knob_faults::<VoxelGi>(&fields), [""; 0]);
    }

    #[test]
    fn presets_are_shapes_that_are_possible() {
        for index in 0..4 {
            let preset = |name| {
                let knob = VoxelGi::KNOBS.iter().find(|knob| knob.name == name);
                knob.expect("a knob").presets[index]
            };
            let shape = ClipmapShape::new(
                preset("resolution") as u32,
                preset("cascades") as u32,
                preset("voxel_size"),
            );
            assert_eq!(shape.resolution as f32, preset("resolution"));
            assert!(shape.slots() < 1 << 30, "slots have 30 bits");
        }
    }
}
