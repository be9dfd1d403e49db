//! Baked shadows at one point held against rays: what the interpolated samples say of a light, and what is true.

use akari_reference::ray_scene::{Cwbvh, Ray, RayScene, offset_for};
use bevy::math::Ray3d;
use bevy::prelude::*;
use bevy_akari::area_light::shadows::tables::ShadowTables;
use bevy_akari::area_light::shadows::types::GpuSlot;
use bevy_akari::headless::ReadImage;
use bevy_akari::math::frame::orthonormal_basis;
use bevy_akari::math::ltc::polygon::{
    lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new,
};
use bevy_akari::math::octahedral::octahedral_unpack;
use bevy_akari::visibility::face::{FACES, cube_from_world};
use bevy_akari::visibility::grid::{ENTRY_HANGING, grid_triangle, micro_triangle};
use bevy_akari::visibility::query::{
    traversal_close, traversal_enter, traversal_is_piece, traversal_new, traversal_next,
    traversal_push, traversal_split, traversal_visibility, traversal_word,
};
use std::num::NonZero;
use std::sync::Arc;

/// A convex one-sided light in the world, of at most 16 corners.
#[derive(Debug, Clone)]
pub struct ProbeLight {
    /// Corners, clockwise as seen from where it shines, as for the GPU.
    corners: Vec<Vec3>,
    center: Vec3,
    /// Where it shines.
    normal: Vec3,
}

impl ProbeLight {
    /// A light with these corners in the plane z = 0 of its own frame, shining along −Z.
    #[must_use]
    pub fn new(vertices: &[Vec2], place: &GlobalTransform) -> Self {
        let corners: Vec<Vec3> = vertices
            .iter()
            .map(|vertex| place.transform_point(vertex.extend(0.0)))
            .collect();
        let center = corners.iter().sum::<Vec3>() / corners.len().max(1) as f32;
        Self {
            corners,
            center,
            normal: place.forward().into(),
        }
    }
}

/// A point of a triangle that was baked.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    triangle: usize,
    barycentrics: Vec3,
    /// Where it is.
    pub position: Vec3,
}

/// Shadow ratios of a bake and of rays, on the CPU.
pub struct ShadowProbe {
    tables: Arc<ShadowTables>,
    rays: Cwbvh,
}

impl ShadowProbe {
    /// For all triangles of a scene's bakes.
    #[must_use]
    pub fn new(tables: Arc<ShadowTables>) -> Self {
        let triangles: Vec<[Vec3; 3]> = tables.receivers.iter().map(|r| [r.a, r.b, r.c]).collect();
        Self {
            rays: Cwbvh::build(&triangles),
            tables,
        }
    }

    /// What a ray meets first.
    #[must_use]
    pub fn meet(&self, ray: Ray3d) -> Option<SurfacePoint> {
        let ray = Ray {
            origin: ray.origin,
            direction: *ray.direction,
            tmin: 0.0,
            tmax: f32::INFINITY,
        };
        let hit = self.rays.closest(&ray, |_| true)?;
        let receiver = &self.tables.receivers[hit.triangle as usize];
        let barycentrics = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
        Some(SurfacePoint {
            triangle: hit.triangle as usize,
            barycentrics,
            position: receiver.a * barycentrics.x
                + receiver.b * barycentrics.y
                + receiver.c * barycentrics.z,
        })
    }

    /// Share of the light's irradiance that arrives, by the samples of the bake: what the shader computes (`ratios.wgsl`,
    /// `shadows.wgsl`). None where no sample would be lit by it.
    #[must_use]
    pub fn baked_ratio(&self, point: &SurfacePoint, light: &ProbeLight) -> Option<f32> {
        let grid = grid_triangle(self.tables.receivers[point.triangle].grid);
        let cell = micro_triangle(grid.level, point.barycentrics);
        let (mut sum, mut weights) = (0.0, 0.0);
        let mut add = |slot: u32, weight: f32| {
            if let Some(ratio) = self.slot_ratio(&self.tables.slots[slot as usize], light) {
                sum += weight * ratio;
                weights += weight;
            }
        };
        for (local, weight) in cell.samples.into_iter().zip(cell.weights.to_array()) {
            let entry = self.tables.entries[(grid.first + local) as usize];
            if entry & ENTRY_HANGING == 0 {
                add(entry, weight);
                continue;
            }
            let word = (self.tables.hanging_offset + 3 * (entry & !ENTRY_HANGING)) as usize;
            let second = f32::from_bits(self.tables.entries[word + 2]);
            add(self.tables.entries[word], weight * (1.0 - second));
            add(self.tables.entries[word + 1], weight * second);
        }
        (weights > 0.0).then(|| sum / weights)
    }

    fn slot_ratio(&self, slot: &GpuSlot, light: &ProbeLight) -> Option<f32> {
        if light.normal.dot(slot.position - light.center) <= 0.0 {
            return None;
        }
        // Trees, and the pieces that come of them, are along the axes of the samples' cubes.
        let normal = cube_from_world(octahedral_unpack(slot.normal));
        let to_frame = orthonormal_basis(normal).transpose();
        // Vector irradiance along the normal, whichever way the corners run.
        let irradiance = |corners: &[Vec3]| {
            let mut polygon = lambert_polygon_new();
            let ends = corners.iter().cycle().skip(1);
            for (a, b) in corners.iter().zip(ends) {
                lambert_polygon_add_edge(&mut polygon, to_frame * *a, to_frame * *b);
            }
            lambert_polygon_close(&mut polygon);
            polygon.diffuse.z
        };
        let corners: Vec<Vec3> = light
            .corners
            .iter()
            .map(|&corner| cube_from_world(corner - slot.position))
            .collect();
        let whole = irradiance(&corners);
        let mut t = traversal_new();
        corners
            .iter()
            .for_each(|&corner| traversal_push(&mut t, corner));
        traversal_close(&mut t);
        let mut visible = 0.0;
        for face in 0..FACES {
            traversal_enter(&mut t, face as u32, slot.trees[face]);
            while traversal_next(&mut t) {
                if traversal_is_piece(&t) {
                    let piece = &t.vertices[t.first as usize..][..t.count as usize];
                    visible += traversal_visibility(&t) * irradiance(piece);
                } else {
                    let word = traversal_word(&t) as usize;
                    // A bake of leaves alone has no nodes, and the sides of a face need none.
                    let node = |at: usize| self.tables.nodes.get(at).copied().unwrap_or(0);
                    let [first, second] = [node(word), node(word + 1)];
                    traversal_split(&mut t, first, second);
                }
            }
        }
        (whole.abs() > 0.0).then(|| (visible / whole).clamp(0.0, 1.0))
    }

    /// The same by rays to `cells`² points in each triangle of the light's fan, and how much the surface faces the light:
    /// its irradiance without shadows over that of a surface that faces each point of the light. None where the surface
    /// or the light is turned away.
    #[must_use]
    pub fn traced_ratio(
        &self,
        point: &SurfacePoint,
        light: &ProbeLight,
        cells: u32,
    ) -> Option<[f32; 2]> {
        let receiver = &self.tables.receivers[point.triangle];
        let corners = [receiver.a, receiver.b, receiver.c];
        let normal = (receiver.b - receiver.a)
            .cross(receiver.c - receiver.a)
            .normalize();
        let offset = offset_for(&corners);
        let origin = point.position + normal * offset;
        let (mut facing, mut whole, mut visible) = (0.0, 0.0, 0.0);
        for i in 1..light.corners.len().saturating_sub(1) {
            let [a, b, c] = [light.corners[0], light.corners[i], light.corners[i + 1]];
            let area = 0.5 * (b - a).cross(c - a).length();
            for cell in 0..cells * cells {
                let at = |k: u32| (k as f32 + 0.5) / cells as f32;
                // Equal areas for equal cells.
                let root = at(cell % cells).sqrt();
                let u = at(cell / cells);
                let to_light = a.lerp(b.lerp(c, u), root) - origin;
                let distance = to_light.length();
                let direction = to_light / distance;
                let from_light =
                    area * (-light.normal.dot(direction)).max(0.0) / (distance * distance);
                facing += from_light;
                let weight = from_light * normal.dot(direction).max(0.0);
                if weight <= 0.0 {
                    continue;
                }
                whole += weight;
                let ray = Ray {
                    origin,
                    direction,
                    tmin: offset,
                    tmax: distance,
                };
                if !self.rays.occluded(&ray, |_| true) {
                    visible += weight;
                }
            }
        }
        (whole > 0.0).then(|| [visible / whole, whole / facing])
    }
}

/// A pixel of a [`Comparison`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComparedPixel {
    /// Share of the light's irradiance that arrives by the bake.
    pub baked: f32,
    /// The same by rays.
    pub traced: f32,
    /// How much the surface faces the light, 0 to 1.
    pub facing: f32,
}

impl ComparedPixel {
    /// Error of the irradiance, relative to that of a surface that faces the light.
    #[must_use]
    pub fn error(&self) -> f32 {
        self.facing * (self.baked - self.traced)
    }
}

/// Shadows of a bake and of rays at every pixel of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// None out of the light's reach. Rows from the top.
    pub pixels: Vec<Option<ComparedPixel>>,
    size: UVec2,
}

impl Comparison {
    /// Of the light at the pixels' middles, with `cells` as in [`ShadowProbe::traced_ratio`], on all cores.
    pub fn new(
        probe: &ShadowProbe,
        light: &ProbeLight,
        cells: u32,
        size: UVec2,
        ray: impl Fn(Vec2) -> Option<Ray3d> + Sync,
    ) -> Self {
        let pixel = |x: u32, y: u32| {
            let point = probe.meet(ray(UVec2::new(x, y).as_vec2() + 0.5)?)?;
            let baked = probe.baked_ratio(&point, light)?;
            let [traced, facing] = probe.traced_ratio(&point, light, cells)?;
            Some(ComparedPixel {
                baked,
                traced,
                facing,
            })
        };
        let threads = std::thread::available_parallelism().map_or(1, NonZero::get) as u32;
        let mut pixels = vec![None; (size.x * size.y) as usize];
        std::thread::scope(|scope| {
            // Rows in turns, since those of the sky are done at once.
            let mut of_thread: Vec<Vec<(u32, &mut [Option<ComparedPixel>])>> = Vec::new();
            of_thread.resize_with(threads as usize, Vec::new);
            for (y, row) in (0..).zip(pixels.chunks_mut(size.x.max(1) as usize)) {
                of_thread[(y % threads) as usize].push((y, row));
            }
            for rows in of_thread {
                scope.spawn(|| {
                    for (y, row) in rows {
                        for (x, compared) in (0..).zip(row) {
                            *compared = pixel(x, y);
                        }
                    }
                });
            }
        });
        Self { pixels, size }
    }

    /// In words: how large the errors are ([`ComparedPixel::error`]), and where the largest is.
    #[must_use]
    pub fn summary(&self) -> String {
        /// Outside of these, rays find a light whole or hidden.
        const PENUMBRA: std::ops::Range<f32> = 0.005..0.995;
        let root_mean_square = |of: fn(&ComparedPixel) -> bool| {
            let errors = self.pixels.iter().flatten().filter(|pixel| of(pixel));
            let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), pixel| {
                (sum + f64::from(pixel.error()).powi(2), count + 1.0)
            });
            (sum / f64::max(count, 1.0)).sqrt()
        };
        let error = |at: usize| self.pixels[at].map_or(0.0, |pixel| pixel.error());
        let worst = (0..self.pixels.len())
            .max_by(|a, b| error(*a).abs().total_cmp(&error(*b).abs()))
            .unwrap_or(0);
        let width = self.size.x.max(1) as usize;
        format!(
            "{} pixels in the light's reach: root mean square error {:.2} % of the irradiance of a surface that faces it, \
             in penumbrae {:.2} %, largest {:+.1} % at {},{}",
            self.pixels.iter().flatten().count(),
            100.0 * root_mean_square(|_| true),
            100.0 * root_mean_square(|pixel| PENUMBRA.contains(&pixel.traced)),
            100.0 * error(worst),
            worst % width,
            worst / width,
        )
    }

    /// Left, the shares by rays; right, ten times the errors: red where the bake is too bright, blue where too dark.
    #[must_use]
    pub fn picture(&self) -> ReadImage {
        const GAIN: f32 = 10.0;
        const OUT_OF_REACH: [f32; 4] = [0.0, 0.02, 0.15, 1.0];
        let mut data = Vec::with_capacity(2 * self.pixels.len());
        for row in self.pixels.chunks(self.size.x.max(1) as usize) {
            data.extend(row.iter().map(|pixel| {
                pixel.map_or(OUT_OF_REACH, |pixel| {
                    Vec3::splat(pixel.traced).extend(1.0).to_array()
                })
            }));
            data.extend(row.iter().map(|pixel| {
                let error = pixel.map_or(0.0, |pixel| GAIN * pixel.error());
                [error.clamp(0.0, 1.0), 0.0, (-error).clamp(0.0, 1.0), 1.0]
            }));
        }
        ReadImage {
            width: 2 * self.size.x,
            height: self.size.y,
            data,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::math::Affine3A;
    use bevy_akari::area_light::shadows::tables::ReceiverMesh;

    /// A floor, under a lid that hides half of the light from the middle of the floor.
    fn probe(with_lid: bool) -> ShadowProbe {
        use crate::baking::{BakeFile, StaticMesh, bake};
        let floor = Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(1.0)));
        let lid = Mesh::from(Plane3d::new(Vec3::Y, Vec2::splat(0.5)));
        let place = Transform::from_xyz(0.5, 1.0, 0.0);
        let mut meshes = vec![StaticMesh::new("floor", &floor, &Transform::IDENTITY)];
        if with_lid {
            meshes.push(StaticMesh::new("lid", &lid, &place));
        }
        let meshes: Vec<StaticMesh> = meshes.into_iter().map(|m| m.expect("a mesh")).collect();
        let options = akari_bake::Options {
            max_level: 3,
            ..default()
        };
        let name = format!("akari_probe_{}_{with_lid}.akari", std::process::id());
        let path = std::env::temp_dir().join(name);
        let file = BakeFile::Named(path.clone());
        let bake = bake(&meshes, &options, &file, Arc::default()).expect("a bake");
        std::fs::remove_file(path).expect("the file");
        let receivers: Vec<ReceiverMesh> = meshes
            .iter()
            .zip([Affine3A::IDENTITY, place.compute_affine()])
            .enumerate()
            .map(|(instance, (mesh, world_from_mesh))| ReceiverMesh {
                instance,
                world_from_mesh,
                positions: mesh.positions().iter().map(Vec3::to_array).collect(),
                triangles: mesh.triangles().to_vec(),
                two_sided: false,
            })
            .collect();
        let tables = ShadowTables::build(&[(&bake, &receivers)]).expect("tables");
        ShadowProbe::new(Arc::new(tables))
    }

    #[test]
    fn half_a_light_is_half_a_light_by_samples_and_by_rays() {
        let shining_from = |height: f32| {
            let place = Transform::from_xyz(0.0, height, 0.0).looking_at(Vec3::ZERO, Vec3::Z);
            let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(Vec2::from);
            ProbeLight::new(&corners, &place.into())
        };
        // From the side, under the lid.
        let target = Vec3::new(0.0, 0.0, 0.01);
        let eye = Vec3::new(-2.0, 0.5, 0.0);
        let ray = Ray3d::new(eye, Dir3::new(target - eye).expect("a direction"));
        for (with_lid, share) in [(true, 0.5), (false, 1.0)] {
            let probe = probe(with_lid);
            let point = probe.meet(ray).expect("the floor");
            assert!(point.position.distance(target) < 1e-4);
            let light = shining_from(2.0);
            let baked = probe.baked_ratio(&point, &light).expect("lit");
            let [traced, facing] = probe.traced_ratio(&point, &light, 32).expect("lit");
            assert!((baked - share).abs() < 0.02, "{baked} of {share}");
            assert!((traced - share).abs() < 0.02, "{traced} of {share}");
            assert!((0.9..1.0).contains(&facing), "{facing}");
            // Nothing arrives from below.
            assert_eq!(probe.traced_ratio(&point, &shining_from(-2.0), 4), None);
        }
    }
}
