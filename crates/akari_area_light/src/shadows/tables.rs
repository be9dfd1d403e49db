//! From bakes and the meshes that they are of to the arrays that shaders read.

use super::types::{GpuReceiver, GpuSlot, RECEIVER_MIRRORED, RECEIVER_TWO_SIDED};
use akari_math::octahedral::octahedral_pack;
use akari_visibility::bake::Bake;
use akari_visibility::grid::{
    ENTRY_HANGING, GridTriangle, MAX_ENTRIES, grid_sample_count, grid_triangle, pack_grid_triangle,
};
use akari_visibility::tree::TreeLink;
use bevy::math::{Affine3A, Vec3};
use bevy::platform::collections::HashMap;
use bevy::render::render_resource::ShaderType;

/// Normals within 25° of that of the first triangle share a slot: what a light gives to surfaces so near to each other
/// in orientation differs by little, and so do their shadow ratios by less.
const SAME_SLOT_COSINE: f32 = 0.906;

/// A mesh that was found in the world, for an instance of a bake.
#[derive(Debug, Clone)]
pub struct ReceiverMesh {
    /// Index of the instance in its bake.
    pub instance: usize,
    /// Where it is.
    pub world_from_mesh: Affine3A,
    /// Positions in the space of the mesh.
    pub positions: Vec<[f32; 3]>,
    /// Its triangles, as many as the instance has.
    pub triangles: Vec<[u32; 3]>,
    /// Whether it is drawn from both sides.
    pub two_sided: bool,
}

/// Everything about baked shadows that does not depend on lights.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ShadowTables {
    /// Triangles, of all meshes that were found.
    pub receivers: Vec<GpuReceiver>,
    /// Slot of each grid point of each triangle; hanging points from [`ShadowTables::hanging_offset`] on.
    pub entries: Vec<u32>,
    /// Word of `entries` at which the hanging points begin.
    pub hanging_offset: u32,
    /// Samples, once for each orientation in which they are used.
    pub slots: Vec<GpuSlot>,
    /// Words of all trees.
    pub nodes: Vec<u32>,
}

/// Why bakes do not fit together.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TableError {
    /// Too many grid points for their indices.
    #[error("the bakes of the scene have more than {MAX_ENTRIES} grid points together")]
    TooManyEntries,
    /// Too many nodes for their indices.
    #[error("the bakes of the scene have more nodes together than a link can tell apart")]
    TooManyNodes,
}

/// Slots of one sample: index and the normals that were put together there.
#[derive(Default)]
struct SlotBuilder {
    slots: Vec<GpuSlot>,
    normals: Vec<Vec3>,
    /// For each sample its slots: index, the normal that began it, and whether there is one of the back, too.
    of_sample: Vec<Vec<(u32, Vec3, bool)>>,
}

impl SlotBuilder {
    /// The slot of a sample for triangles of this normal. A two-sided one is followed by that of the back.
    fn slot(
        &mut self,
        sample: u32,
        normal: Vec3,
        two_sided: bool,
        gpu: impl Fn() -> GpuSlot,
    ) -> u32 {
        let known = &mut self.of_sample[sample as usize];
        let found = known
            .iter()
            .find(|(_, first, two)| *two == two_sided && first.dot(normal) >= SAME_SLOT_COSINE);
        if let Some(&(slot, _, _)) = found {
            self.normals[slot as usize] += normal;
            if two_sided {
                self.normals[slot as usize + 1] -= normal;
            }
            return slot;
        }
        let slot = self.slots.len() as u32;
        known.push((slot, normal, two_sided));
        for side in 0..1 + u32::from(two_sided) {
            self.slots.push(gpu());
            self.normals.push(if side == 0 { normal } else { -normal });
        }
        slot
    }
}

impl ShadowTables {
    /// Bytes of the largest of the arrays on the GPU.
    pub fn largest_buffer(&self) -> u64 {
        let words = self.entries.len().max(self.nodes.len()) as u64 * size_of::<u32>() as u64;
        let receivers = self.receivers.len() as u64 * GpuReceiver::min_size().get();
        let slots = self.slots.len() as u64 * GpuSlot::min_size().get();
        words.max(receivers).max(slots)
    }

    /// Puts bakes together, each with those of its meshes that were found.
    ///
    /// # Errors
    /// If they are too large together.
    pub fn build(bakes: &[(&Bake, &[ReceiverMesh])]) -> Result<Self, TableError> {
        let mut tables = Self::default();
        let mut hanging_words: Vec<u32> = Vec::new();
        let mut builder = SlotBuilder::default();
        for &(bake, meshes) in bakes {
            // Two nodes in three words: a bake begins with an even one.
            let first_node = (tables.nodes.len() / 3 * 2) as u32;
            let words = bake.pool.words();
            if tables.nodes.len() + words.len() > (TreeLink::LEAF as usize) {
                return Err(TableError::TooManyNodes);
            }
            tables.nodes.extend_from_slice(words);
            tables
                .nodes
                .resize(tables.nodes.len().next_multiple_of(3), 0);

            builder.of_sample = vec![Vec::new(); bake.grid.sample_count as usize];
            let gpu_slot = |sample: u32| GpuSlot {
                position: bake.positions[sample as usize].into(),
                normal: 0,
                trees: bake.trees[sample as usize].map(|link| {
                    if link.is_leaf() {
                        link.0
                    } else {
                        link.0 + first_node
                    }
                }),
            };
            // Hanging points of each orientation, by their index in the bake and the slots between which they are.
            let mut hanging: HashMap<[u32; 3], u32> = HashMap::default();
            for mesh in meshes {
                let instance = &bake.instances[mesh.instance];
                // A mirror turns the winding, but not which side is the front.
                let mirrored = mesh.world_from_mesh.matrix3.determinant() < 0.0;
                let grids = bake
                    .grid
                    .triangles
                    .iter()
                    .skip(instance.first_triangle as usize);
                for (corners, &word) in mesh.triangles.iter().zip(grids) {
                    let [a, b, c] = corners.map(|i| {
                        mesh.world_from_mesh
                            .transform_point3(mesh.positions[i as usize].into())
                    });
                    let mut normal = (b - a).cross(c - a).normalize_or_zero();
                    if mirrored {
                        normal = -normal;
                    }
                    let from = grid_triangle(word);
                    let first = tables.entries.len();
                    let count = grid_sample_count(from.level) as usize;
                    if first + count > MAX_ENTRIES {
                        return Err(TableError::TooManyEntries);
                    }
                    for &entry in &bake.grid.entries[from.first as usize..][..count] {
                        let mut slot = |sample: u32| {
                            builder.slot(sample, normal, mesh.two_sided, || gpu_slot(sample))
                        };
                        if entry & ENTRY_HANGING == 0 {
                            tables.entries.push(slot(entry));
                            continue;
                        }
                        let number = entry & !ENTRY_HANGING;
                        let between = bake.grid.hanging[number as usize];
                        let key = [number, slot(between.first), slot(between.second)];
                        let index = *hanging.entry(key).or_insert_with(|| {
                            let index = hanging_words.len() as u32 / 3;
                            hanging_words.extend([key[1], key[2], between.weight.to_bits()]);
                            index
                        });
                        tables.entries.push(ENTRY_HANGING | index);
                    }
                    tables.receivers.push(GpuReceiver {
                        a,
                        grid: pack_grid_triangle(GridTriangle {
                            first: first as u32,
                            level: from.level,
                        }),
                        b,
                        flags: u32::from(mesh.two_sided) * RECEIVER_TWO_SIDED
                            + u32::from(mirrored) * RECEIVER_MIRRORED,
                        c,
                    });
                }
            }
        }
        tables.hanging_offset = tables.entries.len() as u32;
        tables.entries.extend(hanging_words);
        tables.slots = builder.slots;
        for (slot, normal) in tables.slots.iter_mut().zip(builder.normals) {
            slot.normal = octahedral_pack(normal.normalize_or(Vec3::Y));
        }
        Ok(tables)
    }
}
