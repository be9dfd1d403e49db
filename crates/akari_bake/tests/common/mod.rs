//! Scenes made by code, and helpers.

// Each test binary uses some of it.
#![allow(dead_code)]

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use akari_bake::{Geometry, GeometryOptions, MeshInput, Options, Progress, Roles, Status};
use glam::{DAffine3, Vec3};

pub struct Mesh {
    pub name: &'static str,
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// A sphere with waves, `n` rings, about `center`.
pub fn bumpy_sphere(n: u32, center: Vec3, radius: f32) -> Mesh {
    let mut positions = Vec::new();
    for i in 0..=n {
        for j in 0..2 * n {
            let theta = std::f32::consts::PI * i as f32 / n as f32;
            let phi = std::f32::consts::PI * j as f32 / n as f32;
            let r = radius * (1.0 + 0.2 * (5.0 * phi).sin() * (4.0 * theta).sin());
            let (sin, cos) = theta.sin_cos();
            // The poles are one point each, whatever sin(π) says.
            let sin = if i == 0 || i == n { 0.0 } else { sin };
            positions.push(center + r * Vec3::new(sin * phi.cos(), cos, sin * phi.sin()));
        }
    }
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..2 * n {
            let at = |i: u32, j: u32| i * 2 * n + j % (2 * n);
            if i > 0 {
                triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            }
            if i + 1 < n {
                triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
    }
    Mesh {
        name: "bumpy sphere",
        positions,
        triangles,
    }
}

/// A square of two triangles, facing up.
pub fn floor(half: f32, y: f32) -> Mesh {
    Mesh {
        name: "floor",
        positions: [(-half, -half), (-half, half), (half, half), (half, -half)]
            .map(|(x, z)| Vec3::new(x, y, z))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

pub fn geometry(meshes: &[Mesh]) -> Geometry<'static> {
    let inputs: Vec<MeshInput<'_>> = meshes
        .iter()
        .map(|mesh| MeshInput {
            name: mesh.name,
            positions: &mesh.positions,
            triangles: &mesh.triangles,
            world_from_mesh: DAffine3::IDENTITY,
            roles: Roles::BOTH,
            two_sided: false,
        })
        .collect();
    Geometry::from_meshes(&inputs, GeometryOptions::default()).unwrap()
}

/// A sphere over a floor.
pub fn small() -> Geometry<'static> {
    geometry(&[
        bumpy_sphere(12, Vec3::new(0.1, 0.4, 0.0), 0.4),
        floor(1.5, -0.2),
    ])
}

/// Faces as small as they may be, and hardly any refinement.
pub fn quick() -> Options {
    Options {
        face_size: 32,
        shadow_tolerance: 0.15,
        max_level: 3,
        threads: Some(2),
        ..Options::default()
    }
}

/// Stops after a number of samples and remembers what it was told.
#[derive(Default)]
pub struct Watch {
    pub stop_after: Option<u64>,
    pub stopped: AtomicBool,
    pub calls: AtomicU64,
    pub last: Mutex<Option<Status>>,
}

impl Progress for Watch {
    fn update(&self, status: &Status) {
        assert!(status.resumed <= status.done && status.done <= status.total);
        self.calls.fetch_add(1, Ordering::Relaxed);
        *self.last.lock().unwrap() = Some(*status);
        let fresh = status.done - status.resumed;
        if status.phase == akari_bake::Phase::Samples
            && self.stop_after.is_some_and(|limit| fresh >= limit)
        {
            self.stopped.store(true, Ordering::Relaxed);
        }
    }

    fn cancelled(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

pub fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}
