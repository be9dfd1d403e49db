//! Rays through pixels.

use akari_scene::{Camera, Projection};
use glam::{DVec3, Vec3};

use crate::ray_scene::Ray;

/// A camera for an image size, in coordinates relative to the world's origin of computation.
pub(crate) struct RayCamera {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    /// Along which depth is measured.
    pub(crate) forward: Vec3,
    half_width: f32,
    half_height: f32,
    perspective: bool,
    near: f32,
    far: f32,
    size: (f32, f32),
}

impl RayCamera {
    pub(crate) fn new(camera: &Camera, width: u32, height: u32, origin: DVec3) -> Self {
        let m = camera.world_from_local.matrix3;
        let aspect = width as f32 / height as f32;
        let (half_height, perspective, near, far) = match camera.projection {
            Projection::Perspective {
                yfov, znear, zfar, ..
            } => ((0.5 * yfov).tan(), true, znear, zfar),
            Projection::Orthographic {
                ymag, znear, zfar, ..
            } => (ymag, false, znear, Some(zfar)),
        };
        Self {
            eye: (camera.world_from_local.translation - origin).as_vec3(),
            right: m.x_axis.as_vec3(),
            up: m.y_axis.as_vec3(),
            forward: -m.z_axis.as_vec3(),
            half_width: half_height * aspect,
            half_height,
            perspective,
            near,
            far: far.unwrap_or(f32::INFINITY),
            size: (width as f32, height as f32),
        }
    }

    /// The ray through image position `x`, `y` in pixels from the top left corner, between the clipping planes.
    pub(crate) fn ray(&self, x: f32, y: f32) -> Ray {
        let sx = (2.0 * x / self.size.0 - 1.0) * self.half_width;
        let sy = (1.0 - 2.0 * y / self.size.1) * self.half_height;
        let offset = sx * self.right + sy * self.up;
        if self.perspective {
            let unnormalized = self.forward + offset;
            let length = unnormalized.length();
            Ray {
                origin: self.eye,
                direction: unnormalized / length,
                tmin: self.near * length,
                tmax: self.far * length,
            }
        } else {
            Ray {
                origin: self.eye + offset,
                direction: self.forward,
                tmin: self.near,
                tmax: self.far,
            }
        }
    }

    /// Distance of a point along the view axis.
    pub(crate) fn depth(&self, p: Vec3) -> f32 {
        (p - self.eye).dot(self.forward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    #[test]
    fn corners_and_centre() {
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 1.0);
        let rays = RayCamera::new(&camera, 200, 100, DVec3::new(0.0, 0.0, 1.0));
        let centre = rays.ray(100.0, 50.0);
        assert!((centre.direction - Vec3::NEG_Z).length() < 1e-6);
        assert_eq!(centre.origin, Vec3::new(0.0, 0.0, 4.0));
        let top_left = rays.ray(0.0, 0.0).direction;
        let t = 0.5_f32.tan();
        let expected = Vec3::new(-2.0 * t, t, -1.0).normalize();
        assert!((top_left - expected).length() < 1e-6);
        assert!((rays.depth(Vec3::new(3.0, 1.0, 1.0)) - 3.0).abs() < 1e-6);
        let ortho = Camera {
            projection: Projection::Orthographic {
                xmag: 1.0,
                ymag: 2.0,
                znear: 0.1,
                zfar: 9.0,
            },
            world_from_local: DAffine3::IDENTITY,
            ..camera
        };
        let ray = RayCamera::new(&ortho, 200, 100, DVec3::ZERO).ray(200.0, 100.0);
        assert!((ray.origin - Vec3::new(4.0, -2.0, 0.0)).length() < 1e-6);
        assert_eq!((ray.direction, ray.tmax), (Vec3::NEG_Z, 9.0));
    }
}
