//! Bounds of a scene, and a camera for scenes that have none.

use glam::{DAffine3, DMat3, DVec3};

use crate::types::{AreaLightShape, Camera, Projection, Scene};

/// Axis-aligned bounds in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl Bounds {
    /// The middle.
    pub fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        (self.max - self.min).length()
    }
}

/// Vertical field of view of the made-up camera: 45 degrees.
const FRAMED_YFOV: f64 = std::f64::consts::FRAC_PI_4;
/// Direction from the scene's centre to the made-up camera: from the front, a little from the right and above.
const FRAMED_FROM: DVec3 = DVec3::new(0.35, 0.45, 1.0);

impl Scene {
    /// Bounds of all instanced triangles and area lights in world space; none for a scene without any.
    pub fn bounds(&self) -> Option<Bounds> {
        let mut min = DVec3::INFINITY;
        let mut max = DVec3::NEG_INFINITY;
        let mut add = |p: DVec3| {
            min = min.min(p);
            max = max.max(p);
        };
        for instance in &self.instances {
            for primitive in &self.meshes[instance.mesh].primitives {
                for &i in &primitive.indices {
                    add(instance
                        .world_from_local
                        .transform_point3(primitive.positions[i as usize].as_dvec3()));
                }
            }
        }
        for light in &self.area_lights {
            let (x, y) = match light.shape {
                AreaLightShape::Rect { width, height } => (0.5 * width, 0.5 * height),
                AreaLightShape::Disk { diameter } => (0.5 * diameter, 0.5 * diameter),
            };
            for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
                add(light.world_from_local.transform_point3(DVec3::new(
                    f64::from(x) * sx,
                    f64::from(y) * sy,
                    0.0,
                )));
            }
        }
        (min.x <= max.x).then_some(Bounds { min, max })
    }

    /// A camera that sees the whole scene: 45° vertical field of view, from direction (0.35, 0.45, 1) of the
    /// bounding box's centre, far enough that the bounding sphere fits an image at least as wide as high.
    ///
    /// An empty scene gets a camera at (0, 0, 5).
    pub fn frame_camera(&self) -> Camera {
        let bounds = self.bounds().unwrap_or(Bounds {
            min: DVec3::splat(-1.0),
            max: DVec3::splat(1.0),
        });
        // A scene that is one point still gets a camera in front of it.
        let radius = (0.5 * bounds.diagonal()).max(1e-3);
        let distance = radius / (0.5 * FRAMED_YFOV).sin();
        let back = if self.bounds().is_some() {
            FRAMED_FROM.normalize()
        } else {
            DVec3::Z
        };
        Camera {
            name: "framed".into(),
            world_from_local: look_along(bounds.center() + distance * back, -back),
            projection: Projection::Perspective {
                yfov: FRAMED_YFOV as f32,
                aspect: None,
                znear: (1e-3 * distance) as f32,
                zfar: None,
            },
        }
    }
}

impl Scene {
    /// The camera that a user asked for by name or by index (`None`: the first; a scene without a camera is framed,
    /// see [`Scene::frame_camera`]).
    pub fn select_camera(&self, selection: Option<&str>) -> Result<Camera, crate::SceneError> {
        let Some(wanted) = selection else {
            return Ok(self
                .cameras
                .first()
                .cloned()
                .unwrap_or_else(|| self.frame_camera()));
        };
        let by_name = self.cameras.iter().find(|c| c.name == wanted);
        let by_index = || wanted.parse().ok().and_then(|i: usize| self.cameras.get(i));
        by_name.or_else(by_index).cloned().ok_or_else(|| {
            let names: Vec<String> = self
                .cameras
                .iter()
                .enumerate()
                .map(|(i, c)| format!("{i} '{}'", c.name))
                .collect();
            crate::SceneError::invalid(
                &self.source,
                "cameras",
                format!("there is no camera '{wanted}'"),
                if names.is_empty() {
                    "the scene has none: leave the choice out and it is framed".to_owned()
                } else {
                    format!("there are: {}", names.join(", "))
                },
            )
        })
    }
}

impl Camera {
    /// A perspective camera at `eye` that looks at `target` (+Y up), with vertical field of view `yfov` (radians).
    pub fn look_at(eye: DVec3, target: DVec3, yfov: f32) -> Self {
        Self {
            name: "camera".into(),
            world_from_local: look_along(eye, (target - eye).normalize_or(DVec3::NEG_Z)),
            projection: Projection::Perspective {
                yfov,
                aspect: None,
                znear: 0.01,
                zfar: None,
            },
        }
    }
}

/// World from camera for a camera at `eye` that looks along the unit vector `forward`; +Y is up, or −Z/+Z where
/// that is undefined.
pub(crate) fn look_along(eye: DVec3, forward: DVec3) -> DAffine3 {
    let back = -forward;
    let right = DVec3::Y.cross(back);
    let right = if right.length_squared() > 1e-12 {
        right.normalize()
    } else {
        DVec3::X
    };
    DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), eye)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{Instance, Mesh, Primitive};
    use glam::Vec3;

    #[test]
    fn framed_camera_sees_every_corner() {
        let positions: Vec<Vec3> = (0..8)
            .map(|i| {
                Vec3::new(
                    (i & 1) as f32 * 4.0 + 100.0,
                    (i >> 1 & 1) as f32 * 2.0,
                    (i >> 2) as f32 * 3.0,
                )
            })
            .collect();
        let scene = Scene {
            meshes: vec![Mesh {
                name: "box".into(),
                primitives: vec![Primitive {
                    indices: vec![0, 1, 2, 3, 4, 5, 6, 7, 0],
                    positions: positions.clone(),
                    ..Default::default()
                }],
            }],
            instances: vec![Instance {
                name: "box".into(),
                mesh: 0,
                world_from_local: DAffine3::IDENTITY,
            }],
            ..Default::default()
        };
        let camera = scene.frame_camera();
        let Projection::Perspective { yfov, .. } = camera.projection else {
            panic!("perspective")
        };
        let t = f64::from(0.5 * yfov).tan();
        for p in positions {
            let q = camera
                .world_from_local
                .inverse()
                .transform_point3(p.as_dvec3());
            assert!(
                q.z < 0.0 && q.x.abs() <= -q.z * t && q.y.abs() <= -q.z * t,
                "{q}"
            );
        }
        assert_eq!(scene.select_camera(None).unwrap().name, "framed");
        assert!(scene.select_camera(Some("0")).is_err());
        let with_camera = Scene {
            cameras: vec![Camera {
                name: "side".into(),
                ..camera
            }],
            ..scene
        };
        for choice in [None, Some("side"), Some("0")] {
            assert_eq!(with_camera.select_camera(choice).unwrap().name, "side");
        }
        let message = with_camera.select_camera(Some("top")).unwrap_err();
        assert!(message.to_string().contains("0 'side'"), "{message}");
        assert!(Scene::default().bounds().is_none());
        assert!(Scene::default().frame_camera().world_from_local.is_finite());
    }
}
