//! The bits of a sample against the path tracer's rays.

mod common;

use akari_bake::probe::Probe;
use akari_reference::ray_scene::{Cwbvh, Ray, RayScene};
use akari_visibility::face::{face_direction, world_from_cube};
use akari_visibility::sites::Site;
use common::{bumpy_sphere, floor, geometry};
use glam::{Vec2, Vec3};

const SIZE: u32 = 32;

#[test]
fn bits_agree_with_the_path_tracer() {
    // Two floors in one plane, and a sphere that cuts through both.
    let meshes = [
        bumpy_sphere(16, Vec3::new(0.1, 0.1, 0.0), 0.4),
        floor(1.5, -0.2),
        floor(0.7, -0.2),
        floor(2.0, -0.6),
    ];
    let geometry = geometry(&meshes);
    let mut probe = Probe::new(&geometry, SIZE);
    let triangles: Vec<[Vec3; 3]> = (0..probe.caster_count()).map(|i| probe.caster(i)).collect();
    let bvh = Cwbvh::build(&triangles);
    let (mut compared, mut differing, mut blocked, mut shifted) = (0, 0, 0, 0);
    for vertex in (0..probe.vertex_count()).step_by(7) {
        let site = Site::Vertex(vertex);
        let origin = probe.origin(site).unwrap();
        let masks = probe.see(site).clone();
        for (face, mask) in (0_u32..).zip(&masks) {
            for i in 0..SIZE * SIZE {
                let Some(bit) = mask.get(i % SIZE, i / SIZE) else {
                    continue;
                };
                let centre = |i: u32| (2 * i + 1) as f32 / SIZE as f32 - 1.0;
                let at = Vec2::new(centre(i % SIZE), centre(i / SIZE));
                let free = |at: Vec2| {
                    let ray = Ray {
                        origin: origin.position.as_vec3(),
                        direction: face_direction(face, at).normalize(),
                        tmin: origin.tmin as f32,
                        tmax: f32::INFINITY,
                    };
                    !bvh.occluded(&ray, |_| true)
                };
                compared += 1;
                blocked += u32::from(!bit);
                differing += u32::from(free(at) != bit);
                // Deliberately wrong: half a texel off.
                shifted += u32::from(free(at + 1.0 / SIZE as f32) != bit);
            }
        }
    }
    assert!(
        compared > 100_000 && blocked > compared / 10,
        "{compared} {blocked}"
    );
    // The path tracer's rays are in f32: they may pass an edge on the other side.
    assert!(differing * 10_000 < compared, "{differing} of {compared}");
    assert!(shifted * 1000 > compared, "{shifted}");
}

#[test]
fn a_sample_on_a_plane_sees_the_half_above_and_a_corner_sees_more() {
    let geometry = geometry(&[floor(1.0, 0.0)]);
    let mut probe = Probe::new(&geometry, 64);
    for vertex in 0..4 {
        let masks = probe.see(Site::Vertex(vertex));
        let mut compared = 0;
        for (face, mask) in masks.iter().enumerate() {
            for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (x, y))) {
                let at = |i: u32| (2 * i + 1) as f32 / 64.0 - 1.0;
                let direction = face_direction(face as u32, Vec2::new(at(x), at(y)));
                let height = world_from_cube(direction).y;
                // Not the texels whose centres lie on the horizon.
                if height.abs() > 1e-3 {
                    assert_eq!(mask.get(x, y), (height > 0.0).then_some(true));
                    compared += 1;
                }
            }
        }
        assert!(compared > 6 * 64 * 60);
    }
}
