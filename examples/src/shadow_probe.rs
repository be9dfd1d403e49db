//! Baked shadows at one point held against rays: what the interpolated samples say of a light, and what is true.

use akari_reference::ray_scene::{Cwbvh, Ray, RayScene, offset_for};
use bevy::math::Ray3d;
use bevy::prelude::*;
use bevy_akari::area_light::shadows::tables::ShadowTables;
use bevy_akari::area_light::shadows::types::GpuSlot;
use bevy_akari::math::frame::orthonormal_basis;
use bevy_akari::math::ltc::polygon::{
    lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new,
};
use bevy_akari::math::octahedral::octahedral_unpack;
use bevy_akari::visibility::face::FACES;
use bevy_akari::visibility::grid::{ENTRY_HANGING, grid_triangle, micro_triangle};
use bevy_akari::visibility::query::{
    traversal_close, traversal_enter, traversal_is_piece, traversal_new, traversal_next,
    traversal_push, traversal_split, traversal_visibility, traversal_word,
};
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
        let to_frame = orthonormal_basis(octahedral_unpack(slot.normal)).transpose();
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
        let corners: Vec<Vec3> = light.corners.iter().map(|c| c - slot.position).collect();
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
                    let [first, second] = [self.tables.nodes[word], self.tables.nodes[word + 1]];
                    traversal_split(&mut t, first, second);
                }
            }
        }
        (whole.abs() > 0.0).then(|| (visible / whole).clamp(0.0, 1.0))
    }

    /// The same by rays to `cells`² points in each triangle of the light's fan. None where the surface or the light is
    /// turned away.
    #[must_use]
    pub fn traced_ratio(
        &self,
        point: &SurfacePoint,
        light: &ProbeLight,
        cells: u32,
    ) -> Option<f32> {
        let receiver = &self.tables.receivers[point.triangle];
        let corners = [receiver.a, receiver.b, receiver.c];
        let normal = (receiver.b - receiver.a)
            .cross(receiver.c - receiver.a)
            .normalize();
        let offset = offset_for(&corners);
        let origin = point.position + normal * offset;
        let (mut whole, mut visible) = (0.0, 0.0);
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
                let weight =
                    area * normal.dot(direction).max(0.0) * (-light.normal.dot(direction)).max(0.0)
                        / (distance * distance);
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
        (whole > 0.0).then(|| visible / whole)
    }
}
