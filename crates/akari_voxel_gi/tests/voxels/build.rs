//! Voxels of polygons, made on the CPU in f64: what the passes are tested with, apart from the voxelizer.

use akari_math::voxel::brick::{PAGE_RECORDS, brick_slot, page_owner_pack, voxel_index};
use akari_math::voxel::packing::{
    VoxelSurface, coverage_pack, voxel_radiance_pack, voxel_surface_pack,
};
use glam::{DVec3, IVec3, UVec3, Vec3};
use std::collections::BTreeMap;

/// A plane polygon, counter-clockwise as seen from its front.
#[derive(Clone, Debug)]
pub struct Polygon {
    pub corners: Vec<DVec3>,
    pub albedo: f64,
    pub emission: f64,
}

impl Polygon {
    pub fn normal(&self) -> DVec3 {
        let origin = self.corners[0];
        let sum: DVec3 = self.corners[1..]
            .windows(2)
            .map(|pair| (pair[0] - origin).cross(pair[1] - origin))
            .sum();
        sum.normalize()
    }
}

/// What one voxel gathers.
#[derive(Clone, Copy, Default)]
struct Face {
    area: f64,
    centroid: DVec3,
    normal: DVec3,
    albedo: f64,
    emission: f64,
    place: DVec3,
}

/// One level: `bricks` of 4³ voxels of edge `voxel` along each axis, from brick `origin` of the world.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    pub voxel: f64,
    pub origin: IVec3,
    pub bricks: u32,
}

/// Buffers in the layout of `types.rs`, and the area of each face.
pub struct Voxels {
    pub clipmap: Vec<u32>,
    pub bricks: Vec<u32>,
    pub coverage: Vec<u32>,
    pub surface: Vec<u32>,
    pub emission: Vec<u32>,
    pub owners: Vec<u32>,
    /// Element `6 record + face`: area that it stands for, each patch of a plane counted once; level.
    pub areas: Vec<(f64, usize)>,
    /// Centroid of each face, metres.
    pub places: Vec<DVec3>,
}

/// By how much surfaces are moved into the solid, in voxels, as by the voxelizer.
const INWARD_SHIFT: f64 = 1e-3;

/// The part of a polygon on one side of an axis-aligned plane.
fn clip(corners: &[DVec3], axis: usize, at: f64, keep_above: bool) -> Vec<DVec3> {
    let side = |p: DVec3| {
        if keep_above {
            p[axis] - at
        } else {
            at - p[axis]
        }
    };
    let mut kept = Vec::new();
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (da, db) = (side(a), side(b));
        if da >= 0.0 {
            kept.push(a);
        }
        if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
            kept.push(a + (b - a) * (da / (da - db)));
        }
    }
    kept
}

/// Area and centroid.
fn measure(corners: &[DVec3], normal: DVec3) -> (f64, DVec3) {
    let origin = corners[0];
    let (mut area, mut moment) = (0.0, DVec3::ZERO);
    for pair in corners[1..].windows(2) {
        let part = 0.5 * (pair[0] - origin).cross(pair[1] - origin).dot(normal);
        area += part;
        moment += part * (origin + pair[0] + pair[1]) / 3.0;
    }
    (area, if area > 0.0 { moment / area } else { origin })
}

fn voxelize(level: &Level, polygons: &[Polygon]) -> BTreeMap<[i32; 3], [Face; 6]> {
    let mut voxels: BTreeMap<[i32; 3], [Face; 6]> = BTreeMap::new();
    let low = level.origin * 4;
    let high = low + IVec3::splat(4 * level.bricks as i32);
    for polygon in polygons {
        let normal = polygon.normal();
        let corners: Vec<DVec3> = polygon
            .corners
            .iter()
            .map(|p| p / level.voxel - normal * INWARD_SHIFT)
            .collect();
        let range = |corners: &[DVec3], axis: usize| {
            let least = corners.iter().map(|p| p[axis]).fold(f64::MAX, f64::min);
            let most = corners.iter().map(|p| p[axis]).fold(f64::MIN, f64::max);
            (least.floor() as i32).max(low[axis])..(most.floor() as i32 + 1).min(high[axis])
        };
        for x in range(&corners, 0) {
            let slab = clip(
                &clip(&corners, 0, f64::from(x), true),
                0,
                f64::from(x + 1),
                false,
            );
            if slab.len() < 3 {
                continue;
            }
            for y in range(&slab, 1) {
                let row = clip(
                    &clip(&slab, 1, f64::from(y), true),
                    1,
                    f64::from(y + 1),
                    false,
                );
                if row.len() < 3 {
                    continue;
                }
                for z in range(&row, 2) {
                    let piece = clip(
                        &clip(&row, 2, f64::from(z), true),
                        2,
                        f64::from(z + 1),
                        false,
                    );
                    if piece.len() < 3 {
                        continue;
                    }
                    let (area, centroid) = measure(&piece, normal);
                    if area <= 1e-9 {
                        continue;
                    }
                    let local = centroid - DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                    let faces = voxels.entry([x, y, z]).or_default();
                    for (f, face) in faces.iter_mut().enumerate() {
                        let part = area * (normal[f / 2] * [1.0, -1.0][f % 2]).max(0.0);
                        if part > 1e-6 {
                            face.area += part;
                            face.centroid += part * local;
                            face.place += part * centroid;
                            face.normal += part * normal;
                            face.albedo += part * polygon.albedo;
                            face.emission += part * polygon.emission;
                        }
                    }
                }
            }
        }
    }
    voxels
}

impl Voxels {
    /// Voxelizes polygons into levels, for an anchor anywhere in the world.
    pub fn new(levels: &[Level], anchor: DVec3, polygons: &[Polygon]) -> Self {
        let slots: u32 = levels.iter().map(|level| level.bricks.pow(3)).sum();
        let mut this = Self {
            clipmap: vec![0; 10 * 12 + 4],
            bricks: vec![0; 4 * slots as usize],
            coverage: Vec::new(),
            surface: Vec::new(),
            emission: Vec::new(),
            owners: Vec::new(),
            areas: Vec::new(),
            places: Vec::new(),
        };
        let mut first_slot = 0;
        for (index, level) in levels.iter().enumerate() {
            let to_anchor = (anchor - level.origin.as_dvec3() * 4.0 * level.voxel).as_vec3();
            let words = &mut this.clipmap[12 * index..12 * index + 12];
            for axis in 0..3 {
                words[axis] = to_anchor[axis].to_bits();
                words[4 + axis] = level.origin[axis] as u32;
            }
            words[3] = (level.voxel as f32).to_bits();
            words[7] = level.bricks;
            words[8] = first_slot;
            words[9] = index as u32;
            let mut by_brick: BTreeMap<u32, Vec<(u32, [Face; 6])>> = BTreeMap::new();
            for (at, faces) in voxelize(level, polygons) {
                let voxel = IVec3::from(at);
                let slot = first_slot + brick_slot(voxel >> 2, level.bricks);
                let local: UVec3 = (voxel & 3).as_uvec3();
                let list = by_brick.entry(slot).or_default();
                list.push((voxel_index(local), faces));
            }
            for (slot, mut voxels) in by_brick {
                voxels.sort_by_key(|voxel| voxel.0);
                this.add_brick(slot, index, level, &voxels);
            }
            first_slot += level.bricks.pow(3);
        }
        let counts = [
            levels.len() as u32,
            levels.len() as u32,
            slots,
            this.owners.len() as u32,
        ];
        this.clipmap[120..124].copy_from_slice(&counts);
        assert!(this.owners.len() < 65_535, "{} pages", this.owners.len());
        this
    }

    fn add_brick(&mut self, slot: u32, index: usize, level: &Level, voxels: &[(u32, [Face; 6])]) {
        let mask = voxels.iter().fold(0_u64, |mask, voxel| mask | 1 << voxel.0);
        let mut pages = [0_u16; 4];
        for (rank, page) in voxels.chunks(PAGE_RECORDS as usize).enumerate() {
            pages[rank] = self.owners.len() as u16;
            self.owners.push(page_owner_pack(slot, rank as u32));
            for place in 0..PAGE_RECORDS as usize {
                let faces = page
                    .get(place)
                    .map_or([Face::default(); 6], |voxel| voxel.1);
                self.add_record(index, level, &faces);
            }
        }
        let words = &mut self.bricks[4 * slot as usize..4 * slot as usize + 4];
        words[0] = mask as u32;
        words[1] = (mask >> 32) as u32;
        words[2] = u32::from(pages[0]) | u32::from(pages[1]) << 16;
        words[3] = u32::from(pages[2]) | u32::from(pages[3]) << 16;
    }

    fn add_record(&mut self, index: usize, level: &Level, faces: &[Face; 6]) {
        let side = |sign: usize| {
            Vec3::from_array([0, 1, 2].map(|axis| faces[2 * axis + sign].area as f32))
        };
        self.coverage
            .extend(coverage_pack(side(0), side(1)).to_array());
        for (f, face) in faces.iter().enumerate() {
            let share = face.area.max(1e-12);
            let normal = face.normal.normalize_or(DVec3::Z);
            let packed = voxel_surface_pack(
                VoxelSurface {
                    albedo: Vec3::splat((face.albedo / share) as f32),
                    centroid: (face.centroid / share).as_vec3(),
                    normal: normal.as_vec3(),
                },
                f as u32,
            );
            self.surface.extend(packed.to_array());
            let emission = Vec3::splat((face.emission / share) as f32);
            self.emission
                .push(voxel_radiance_pack(emission, Vec3::splat(0.5)));
            let area = face.area * normal[f / 2].abs() * level.voxel * level.voxel;
            self.areas.push((area, index));
            self.places.push(face.place / share * level.voxel);
        }
    }
}

/// A box whose inside is seen: six walls of one albedo, of which the top one has a square patch in its middle, a
/// quarter as wide, that shines. Turned by `turn`, about `center`.
pub fn furnace(
    center: DVec3,
    size: f64,
    albedo: f64,
    emission: f64,
    turn: glam::DMat3,
) -> Vec<Polygon> {
    let mut polygons = Vec::new();
    let mut add = |axis: usize, side: f64, low: [f64; 2], high: [f64; 2], emission: f64| {
        let point = |u: f64, v: f64| {
            let mut p = DVec3::ZERO;
            p[axis] = side;
            p[(axis + 1) % 3] = u;
            p[(axis + 2) % 3] = v;
            center + turn * (p * 0.5 * size)
        };
        let mut corners = vec![
            point(low[0], low[1]),
            point(high[0], low[1]),
            point(high[0], high[1]),
            point(low[0], high[1]),
        ];
        // Seen from inside.
        if side > 0.0 {
            corners.reverse();
        }
        polygons.push(Polygon {
            corners,
            albedo,
            emission,
        });
    };
    for axis in 0..3 {
        add(axis, -1.0, [-1.0; 2], [1.0; 2], 0.0);
        if axis != 1 {
            add(axis, 1.0, [-1.0; 2], [1.0; 2], 0.0);
        }
    }
    let (a, b) = (-0.25, 0.25);
    add(1, 1.0, [a, a], [b, b], emission);
    add(1, 1.0, [-1.0, -1.0], [1.0, a], 0.0);
    add(1, 1.0, [-1.0, b], [1.0, 1.0], 0.0);
    add(1, 1.0, [-1.0, a], [a, b], 0.0);
    add(1, 1.0, [b, a], [1.0, b], 0.0);
    polygons
}
