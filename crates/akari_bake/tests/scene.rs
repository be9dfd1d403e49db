//! What of a scene casts and receives.

mod common;

use akari_bake::probe::Probe;
use akari_bake::{Error, Geometry, GeometryOptions, MeshInput, Roles};
use akari_scene::{
    AlphaMode, ColorSpace, Filter, Image, Instance, Material, Mesh, Pixels, Primitive, Scene,
    Texture, Wrap,
};
use akari_visibility::face::{cube_from_world, face_direction, face_of};
use akari_visibility::sites::Site;
use glam::{Affine2, DAffine3, DVec3, Vec2, Vec3};

/// A square with corners at `(±half, ±half)` in the plane of the axes `u` and `v`, facing `u × v`.
fn quad(center: Vec3, u: Vec3, v: Vec3, material: usize) -> Mesh {
    let n = u.cross(v).normalize();
    Mesh {
        name: "quad".into(),
        primitives: vec![Primitive {
            positions: vec![
                center - u - v,
                center + u - v,
                center + u + v,
                center - u + v,
            ],
            normals: vec![n; 4],
            uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
            indices: vec![0, 1, 2, 0, 2, 3],
            material,
            ..Primitive::default()
        }],
    }
}

fn scene(meshes: Vec<Mesh>, materials: Vec<Material>) -> Scene {
    Scene {
        instances: (0..meshes.len())
            .map(|mesh| Instance {
                name: format!("node {mesh}"),
                mesh,
                world_from_local: DAffine3::IDENTITY,
            })
            .collect(),
        meshes,
        materials,
        ..Scene::default()
    }
}

fn material() -> Material {
    Material {
        name: "plain".into(),
        ..Material::default()
    }
}

fn all<'a>(scene: &'a Scene, options: GeometryOptions) -> Geometry<'a> {
    Geometry::from_scene(scene, options, |_, _, roles| roles).unwrap()
}

/// Texels of faces along the axes of the world, as the cube of a vertex has them: how many matter, and how many are visible.
fn counts(geometry: &Geometry<'_>, vertex: u32) -> [(u32, u32); 6] {
    let mut probe = Probe::new(geometry, 128);
    let masks = probe.see(Site::Vertex(vertex));
    std::array::from_fn(|face| {
        let (mut cared, mut visible) = (0, 0);
        for (x, y) in (0..32).flat_map(|y| (0..32).map(move |x| (x, y))) {
            let at = |i: u32| (2 * i + 1) as f32 / 32.0 - 1.0;
            let direction = face_direction(face as u32, Vec2::new(at(x), at(y)));
            let place = face_of(cube_from_world(direction));
            let texel = |x: f32| (64.0 * (x + 1.0)).clamp(0.0, 127.0) as u32;
            let bit = masks[place.face as usize].get(texel(place.at.x), texel(place.at.y));
            cared += u32::from(bit.is_some());
            visible += u32::from(bit == Some(true));
        }
        (cared, visible)
    })
}

/// Whether two counts of one face are the same but for texels along one edge.
fn near(a: u32, b: u32) -> bool {
    a.abs_diff(b) <= FULL / 32
}

const FULL: u32 = 32 * 32;
/// The face that looks up, and the one that looks down.
const UP: usize = 2;
const DOWN: usize = 3;

#[test]
fn a_room_does_not_hide_its_lights() {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let lamp = Material {
        emission: Vec3::splat(10.0),
        ..material()
    };
    // Walls seen from inside, a lamp below the ceiling that faces down, and a table.
    let meshes = vec![
        quad(-y, z, x, 0),
        quad(y, x, z, 0),
        quad(-x, y, z, 0),
        quad(x, z, y, 0),
        quad(-z, x, y, 0),
        quad(z, y, x, 0),
        quad(0.95 * y, 0.3 * x, 0.3 * z, 1),
        quad(-0.5 * y, 0.2 * z, 0.2 * x, 0),
    ];
    let scene = scene(meshes, vec![material(), lamp]);
    let geometry = all(&scene, GeometryOptions::default());
    // The table is left; the lamp neither casts nor receives.
    assert_eq!(geometry.caster_count(), 2);
    assert_eq!(geometry.topology().triangles.len(), 14);
    assert_eq!(geometry.topology().instances.len(), 7);
    assert_eq!(geometry.topology().instances[1].name, "node 1 / quad / 0");
    assert!(
        geometry.notes()[0].contains("12 triangles"),
        "{:?}",
        geometry.notes()
    );
    // A corner of the room is one vertex for three walls, and sees the table in front of the rest.
    let corner = counts(&geometry, 0);
    let (cared, visible) = corner.iter().fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    assert!(cared.abs_diff(6 * FULL * 7 / 8) < FULL / 10, "{corner:?}");
    assert!(visible < cared && visible > cared * 9 / 10, "{corner:?}");

    // With the walls, the corner sees nothing at all.
    let closed = all(
        &scene,
        GeometryOptions {
            enclosure_casts: true,
        },
    );
    assert_eq!(closed.caster_count(), 14);
    assert!(counts(&closed, 0).iter().all(|c| c.1 == 0));
    // The same scene, and another bake.
    assert_eq!(closed.source(), geometry.source());
    assert_eq!(geometry.enclosure().triangles, 12);
    assert_eq!(closed.enclosure(), Default::default());

    // Exporters call any wall double-sided.
    let mut two_sided = scene.clone();
    for material in &mut two_sided.materials {
        material.double_sided = true;
    }
    let open = all(&two_sided, GeometryOptions::default());
    assert_eq!(open.enclosure().triangles, 12);
    let options = akari_bake::Options::default();
    assert_ne!(
        akari_bake::identity(&closed, &options).settings,
        akari_bake::identity(&geometry, &options).settings
    );

    // What the caller says counts.
    let without_table = Geometry::from_scene(&scene, GeometryOptions::default(), |i, _, roles| {
        if i == 7 { Roles::NONE } else { roles }
    })
    .unwrap();
    assert_eq!(without_table.caster_count(), 0);
    assert_eq!(without_table.topology().triangles.len(), 12);
    assert_ne!(without_table.source(), geometry.source());
}

/// A floor and something 0.5 above it that is as large as the face that looks up.
fn covered(cover: Material) -> Scene {
    let meshes = vec![
        quad(Vec3::ZERO, 0.1 * Vec3::Z, 0.1 * Vec3::X, 0),
        quad(0.5 * Vec3::Y, 3.0 * Vec3::X, 3.0 * Vec3::Z, 1),
        // Beyond both, so that neither encloses the scene.
        quad(9.0 * Vec3::Y, 0.01 * Vec3::X, 0.01 * Vec3::Z, 0),
        quad(-9.0 * Vec3::Y, 0.01 * Vec3::X, 0.01 * Vec3::Z, 0),
    ];
    scene(meshes, vec![material(), cover])
}

#[test]
fn alpha_is_respected() {
    let seen = |cover: Material, images: Vec<Image>| {
        let mut scene = covered(cover);
        scene.images = images;
        counts(&all(&scene, GeometryOptions::default()), 0)[UP].1
    };
    let with = |alpha: f32, alpha_mode| Material {
        base_color: glam::Vec4::new(1.0, 1.0, 1.0, alpha),
        alpha_mode,
        ..material()
    };
    let mask = AlphaMode::Mask { cutoff: 0.5 };
    assert!(near(seen(with(0.2, AlphaMode::Opaque), Vec::new()), 0));
    assert!(near(seen(with(0.2, mask), Vec::new()), FULL));
    assert!(near(seen(with(0.5, mask), Vec::new()), 0));
    assert!(near(seen(with(0.4, AlphaMode::Blend), Vec::new()), FULL));
    assert!(near(seen(with(0.6, AlphaMode::Blend), Vec::new()), 0));
    // A texture whose left half is not there.
    let image = Image {
        name: "half".into(),
        width: 2,
        height: 1,
        pixels: Pixels::U8(vec![[255, 255, 255, 0], [255; 4]]),
    };
    let textured = Material {
        base_color_texture: Some(Texture {
            image: 0,
            color_space: ColorSpace::Srgb,
            tex_coord: 0,
            transform: Affine2::IDENTITY,
            wrap_u: Wrap::Clamp,
            wrap_v: Wrap::Clamp,
            filter: Filter::Nearest,
        }),
        ..with(1.0, mask)
    };
    let half = seen(textured.clone(), vec![image.clone()]);
    // The vertex is 0.1 off the middle, which is a fifth of the height of the cover: 3.2 of 16 columns.
    assert!(near(half, 19 * 32) || near(half, 13 * 32), "{half}");
    // The bake knows the texture.
    let mut one = covered(textured);
    one.images = vec![image];
    let source = all(&one, GeometryOptions::default()).source();
    one.images[0].pixels = Pixels::U8(vec![[255, 255, 255, 1], [255; 4]]);
    assert_ne!(all(&one, GeometryOptions::default()).source(), source);
}

#[test]
fn both_sides_of_a_double_sided_surface_receive() {
    let two_sided = Material {
        double_sided: true,
        ..material()
    };
    let mut scene = covered(material());
    scene.materials.push(two_sided);
    scene.meshes[0].primitives[0].material = 2;
    let front_and_back = counts(&all(&scene, GeometryOptions::default()), 0);
    assert!(front_and_back.iter().all(|c| c.0 == FULL));
    // The cover above, hardly anything below.
    assert!(near(front_and_back[UP].1, 0));
    assert!(near(front_and_back[DOWN].1, FULL));
    scene.meshes[0].primitives[0].material = 0;
    let front = counts(&all(&scene, GeometryOptions::default()), 0);
    assert!(near(front[UP].0, FULL) && near(front[DOWN].0, 0));
}

#[test]
fn mirrored_instances_keep_their_front() {
    let mut scene = covered(material());
    let upright = counts(&all(&scene, GeometryOptions::default()), 0);
    scene.instances[0].world_from_local = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let mirrored = counts(&all(&scene, GeometryOptions::default()), 0);
    assert!(near(mirrored[UP].0, upright[UP].0));
    // Upside down it looks down.
    scene.instances[0].world_from_local = DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0));
    let down = counts(&all(&scene, GeometryOptions::default()), 0);
    assert!(near(down[UP].0, 0) && near(down[DOWN].0, FULL));
}

#[test]
fn the_foot_of_a_wall_is_dark_behind_it() {
    // The wall shares no vertex with the floor, whose edge lies in its plane.
    let meshes = vec![
        quad(Vec3::ZERO, Vec3::Z, Vec3::X, 0),
        quad(Vec3::new(1.0, 0.3, 0.1), 5.0 * Vec3::Y, 7.0 * Vec3::Z, 0),
        quad(Vec3::new(3.0, -1.0, 0.1), 0.1 * Vec3::Y, 0.1 * Vec3::Z, 0),
        quad(Vec3::new(-3.0, 9.0, 0.1), 0.1 * Vec3::Y, 0.1 * Vec3::Z, 0),
    ];
    let scene = scene(meshes, vec![material()]);
    let geometry = all(&scene, GeometryOptions::default());
    let mut seen = 0;
    for vertex in 0..4 {
        let faces = counts(&geometry, vertex);
        // +X looks into the wall.
        let toward_wall = faces[0];
        assert!(near(toward_wall.0, FULL / 2));
        assert!(
            near(toward_wall.1, 0),
            "vertex {vertex} sees through the wall"
        );
        seen += faces[1].1;
    }
    assert!(seen.abs_diff(4 * FULL / 2) < FULL / 8, "{seen}");
}

#[test]
fn geometry_that_cannot_be_baked_is_named() {
    let good = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let bad = [Vec3::ZERO, Vec3::X, Vec3::new(f32::NAN, 0.0, 0.0)];
    let input = |positions, triangles, world_from_mesh| MeshInput {
        name: "the mesh",
        positions,
        triangles,
        world_from_mesh,
        roles: Roles::BOTH,
        two_sided: false,
    };
    let huge = DAffine3::from_scale(DVec3::splat(1e30));
    for (positions, triangles, transform, expected) in [
        (&bad[..], &[[0, 1, 2]][..], DAffine3::IDENTITY, "vertex 2"),
        (
            &good[..],
            &[[0, 1, 3]][..],
            DAffine3::IDENTITY,
            "vertex 3 of 3",
        ),
        (&good[..], &[[0, 1, 2]][..], huge, "1e15"),
        (&good[..], &[][..], DAffine3::IDENTITY, "no mesh receives"),
    ] {
        let message = Geometry::from_meshes(
            &[input(positions, triangles, transform)],
            GeometryOptions::default(),
        )
        .unwrap_err()
        .to_string();
        assert!(message.contains(expected), "{message}");
        assert!(
            expected.contains("no mesh") || message.contains("the mesh"),
            "{message}"
        );
    }
    let error = Geometry::from_meshes(&[], GeometryOptions::default()).unwrap_err();
    assert!(matches!(error, Error::Geometry { .. }));

    // A triangle without area is kept in its place and told of; so are a mesh that is all of them, and a point.
    let flat = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X, Vec3::Y];
    for triangles in [&[[0, 1, 2], [0, 1, 3]][..], &[[0, 1, 2]], &[[0, 0, 0]]] {
        let geometry = Geometry::from_meshes(
            &[input(&flat, triangles, DAffine3::IDENTITY)],
            GeometryOptions::default(),
        )
        .unwrap();
        assert_eq!(geometry.topology().triangles.len(), triangles.len());
        assert!(
            geometry.notes()[0].contains("1 triangles have no area"),
            "{:?}",
            geometry.notes()
        );
        let folder = tempfile::tempdir().unwrap();
        let report = akari_bake::bake(
            &geometry,
            &common::quick(),
            &folder.path().join("a.akari"),
            &akari_bake::NoProgress,
        )
        .unwrap();
        assert_eq!(report.triangles, triangles.len() as u64);
    }
}
