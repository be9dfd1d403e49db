//! Single samples: for measurements and tests.

use akari_visibility::face::{FACES, cube_from_world_f64};
use akari_visibility::sites::Site;
use glam::DVec3;

use crate::geometry::Geometry;
use crate::mask::FaceMask;
use crate::sampling::SamplePoint;

/// What one sample of a geometry sees, without a bake.
#[derive(Debug)]
pub struct Probe<'g> {
    geometry: &'g Geometry<'g>,
    masks: [FaceMask; FACES],
}

/// Where the rays of a probe start, in the frame of [`Probe::caster`].
#[derive(Clone, Copy, Debug)]
pub struct RayOrigin {
    /// Start.
    pub position: DVec3,
    /// Hits nearer than this do not count, metres.
    pub tmin: f64,
}

impl<'g> Probe<'g> {
    /// Faces of `size` texels along a side, one of [`crate::FACE_SIZES`].
    #[must_use]
    pub fn new(geometry: &'g Geometry<'g>, size: u32) -> Self {
        Self {
            geometry,
            masks: std::array::from_fn(|_| FaceMask::new(size)),
        }
    }

    /// Number of welded vertices, each of which is a [`Site::Vertex`].
    #[must_use]
    pub fn vertex_count(&self) -> u32 {
        self.geometry.adjacency.vertex_count() as u32
    }

    /// Vertices in the order in which a bake visits them.
    #[must_use]
    pub fn vertices_along_curve(&self) -> Vec<u32> {
        crate::driver::vertices_along_curve(self.geometry)
    }

    /// The six faces at a site.
    pub fn see(&mut self, site: Site) -> &[FaceMask; FACES] {
        let point = self.geometry.sample_point(site);
        self.geometry.see(&point, None, &mut self.masks);
        &self.masks
    }

    /// The six faces at a point of the world that is on no surface, above the plane of `normal` (unit, of the world).
    pub fn see_from(&mut self, point: DVec3, normal: DVec3) -> &[FaceMask; FACES] {
        let point = cube_from_world_f64(point - self.geometry.origin);
        let point = SamplePoint::free(point, cube_from_world_f64(normal));
        self.geometry.see(&point, None, &mut self.masks);
        &self.masks
    }

    /// Where rays start on the front of a site; none if its triangles have no area.
    #[must_use]
    pub fn origin(&self, site: Site) -> Option<RayOrigin> {
        let point: SamplePoint = self.geometry.sample_point(site);
        let origin = point.origin(1.0, None)?;
        Some(RayOrigin {
            position: origin.position,
            tmin: origin.tmin,
        })
    }

    /// Number of casting triangles.
    #[must_use]
    pub fn caster_count(&self) -> usize {
        self.geometry.bvh.triangles.len()
    }

    /// Vertices of a casting triangle, about the middle of the scene and along the axes of the cubes.
    #[must_use]
    pub fn caster(&self, index: usize) -> [glam::Vec3; 3] {
        self.geometry.bvh.triangles[index]
            .vertices
            .map(glam::Vec3::from)
    }
}
