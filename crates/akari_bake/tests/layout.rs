//! How a scene becomes the geometry of a bake: order, roles, identity.

mod common;

use akari_bake::{
    Geometry, GeometryOptions, NoProgress, Options, Roles, SceneLayout, bake, identity,
};
use akari_scene::{
    AlphaMode, ColorSpace, Filter, Image, Instance, Material, Mesh, Pixels, Primitive, Scene,
    Texture, Wrap,
};
use akari_visibility::bake::Bake;
use glam::{Affine2, DAffine3, DVec3, Vec2, Vec3, Vec4};

/// Where things are in [`scene`].
const LAMP: usize = 1;
const PLANT: usize = 2;
const SIGN: usize = 3;

fn square(triangles: usize, material: usize) -> Primitive {
    Primitive {
        positions: vec![
            Vec3::new(-1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.0, -1.0),
            Vec3::new(-1.0, 0.0, -1.0),
        ],
        normals: vec![Vec3::Y; 4],
        uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
        indices: [0, 1, 2, 0, 2, 3][..3 * triangles].to_vec(),
        material,
        ..Primitive::default()
    }
}

/// A floor of two primitives, a lamp that looks down on it, a plant with holes, an unlit sign.
fn scene() -> Scene {
    let material = |name: &str| Material {
        name: name.into(),
        ..Material::default()
    };
    let texture = Texture {
        image: 0,
        color_space: ColorSpace::Srgb,
        tex_coord: 0,
        transform: Affine2::IDENTITY,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        filter: Filter::Nearest,
    };
    let mesh = |name: &str, primitives| Mesh {
        name: name.into(),
        primitives,
    };
    let at = |y: f64, scale: f64| {
        DAffine3::from_translation(DVec3::new(0.1, y, 0.2))
            * DAffine3::from_scale(DVec3::splat(scale))
    };
    let instance = |name: &str, mesh, world_from_local| Instance {
        name: name.into(),
        mesh,
        world_from_local,
    };
    Scene {
        materials: vec![
            material("plain"),
            Material {
                emission: Vec3::splat(5.0),
                ..material("glow")
            },
            Material {
                alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
                base_color_texture: Some(texture),
                double_sided: true,
                ..material("leaf")
            },
            Material {
                unlit: true,
                ..material("ink")
            },
        ],
        meshes: vec![
            mesh("floor", vec![square(2, 0), square(0, 0), square(1, 0)]),
            mesh("panel", vec![square(2, 1)]),
            mesh("plant", vec![square(2, 2)]),
            mesh("sign", vec![square(2, 3)]),
        ],
        images: vec![Image {
            name: "holes".into(),
            width: 2,
            height: 1,
            pixels: Pixels::U8(vec![[9, 9, 9, 0], [255; 4]]),
        }],
        instances: vec![
            instance("room", 0, at(0.0, 3.0)),
            instance("lamp", 1, at(2.0, 0.3) * DAffine3::from_rotation_x(3.0)),
            instance("pot", 2, at(0.5, 0.4)),
            instance("sign", 3, at(0.7, 0.1)),
            // The same mesh and the same name once more.
            instance("pot", 2, at(0.9, 0.2)),
        ],
        ..Scene::default()
    }
}

fn geometry(scene: &Scene) -> Geometry<'_> {
    Geometry::from_scene(scene, GeometryOptions::default(), |_, _, roles| roles).unwrap()
}

#[test]
fn receivers_are_listed_in_the_order_of_the_file() {
    let scene = scene();
    let layout = SceneLayout::of(&scene);
    let names: Vec<_> = layout.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "room / floor / 0",
            "room / floor / 2",
            "pot / plant / 0",
            "pot / plant / 0"
        ]
    );
    assert_eq!(layout.primitives, [(0, 0), (0, 2), (PLANT, 0), (4, 0)]);
    let ranges: Vec<_> = layout
        .instances
        .iter()
        .map(|i| (i.first_triangle, i.triangle_count))
        .collect();
    assert_eq!(ranges, [(0, 2), (2, 1), (3, 2), (5, 2)]);
    let geometry = geometry(&scene);
    assert_eq!(geometry.topology().instances, layout.instances);
    assert_eq!(geometry.source(), layout.source);
    // The sign casts and does not receive; the lamp does neither; the floor is below all of it.
    assert_eq!(geometry.caster_count(), 2 + 2 + 2);
    assert_eq!(geometry.enclosure().triangles, 3);

    // The file says the same, and is recognised by it.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.akari");
    let options = Options {
        max_level: 1,
        ..common::quick()
    };
    bake(&geometry, &options, &path, &NoProgress).unwrap();
    let file = Bake::read(&path).unwrap();
    assert_eq!(file.instances, layout.instances);
    assert_eq!(file.identity, identity(&geometry, &options));
    assert!(
        file.check_scene(&path, layout.source, &layout.instances)
            .is_ok()
    );
    let stale = |change: fn(&mut Scene)| {
        let mut other = self::scene();
        change(&mut other);
        let layout = SceneLayout::of(&other);
        let text = file
            .check_scene(&path, layout.source, &layout.instances)
            .unwrap_err()
            .to_string();
        assert!(
            text.contains("a.akari") && text.contains("`akari bake` again"),
            "{text}"
        );
        text
    };
    let text = stale(|s| s.instances[PLANT].world_from_local.translation.x += 0.5);
    assert!(text.contains("\"pot / plant / 0\" has moved"), "{text}");
    let text = stale(|s| s.meshes[0].primitives[2].positions[1].x = 1.5);
    assert!(text.contains("\"room / floor / 2\" has changed"), "{text}");
    let text = stale(|s| s.meshes[0].primitives.truncate(1));
    assert!(text.contains("room / floor / 2"), "{text}");
    let text = stale(|s| s.instances.truncate(4));
    assert!(
        text.contains("is of 4 meshes, and the scene has 3"),
        "{text}"
    );
    // What only casts is in the hash alone.
    let text = stale(|s| s.instances[SIGN].world_from_local.translation.x += 0.5);
    assert!(text.contains("casts shadows"), "{text}");
}

#[test]
fn the_identity_is_of_what_takes_part() {
    let source = SceneLayout::of(&scene()).source;
    let changed = |change: fn(&mut Scene)| {
        let mut other = scene();
        change(&mut other);
        SceneLayout::of(&other).source != source
    };
    // Lights move, turn, shrink, dim, show other pictures; names and colours are nobody's business.
    let free: [fn(&mut Scene); 10] = [
        |s| s.instances[LAMP].world_from_local.translation = DVec3::new(7.0, 30.0, -2.0),
        |s| {
            s.instances[LAMP].world_from_local *=
                DAffine3::from_rotation_y(0.5) * DAffine3::from_scale(DVec3::splat(0.1));
        },
        |s| s.materials[1].emission = Vec3::new(0.0, 1e-3, 0.0),
        |s| {
            s.materials[1].emissive_texture = s.materials[2].base_color_texture.clone();
        },
        |s| drop(s.instances.remove(LAMP)),
        |s| s.instances[PLANT].name = "vase".into(),
        |s| s.meshes[0].name = "ground".into(),
        |s| s.materials[0].base_color = Vec4::new(0.1, 0.2, 0.3, 0.4),
        |s| s.materials[0].roughness = 0.1,
        |s| s.images[0].pixels = Pixels::U8(vec![[1, 2, 3, 0], [4, 5, 6, 255]]),
    ];
    for (k, change) in free.into_iter().enumerate() {
        assert!(!changed(change), "change {k} made the bake stale");
    }
    let bound: [fn(&mut Scene); 13] = [
        |s| s.instances[PLANT].world_from_local.translation.y += 1e-9,
        |s| s.instances[SIGN].world_from_local.matrix3.x_axis.y += 0.1,
        |s| s.meshes[0].primitives[0].positions[2].y += 1e-6,
        |s| s.meshes[0].primitives[0].indices.rotate_left(1),
        |s| s.instances.swap(PLANT, SIGN),
        |s| drop(s.instances.pop()),
        // A light that does not shine is a surface.
        |s| s.materials[1].emission = Vec3::ZERO,
        |s| s.materials[0].double_sided = true,
        |s| s.materials[3].unlit = false,
        |s| s.materials[2].alpha_mode = AlphaMode::Opaque,
        |s| s.materials[2].alpha_mode = AlphaMode::Mask { cutoff: 0.6 },
        |s| s.images[0].pixels = Pixels::U8(vec![[9, 9, 9, 1], [255; 4]]),
        |s| s.meshes[2].primitives[0].uvs[0][1].x = 0.5,
    ];
    for (k, change) in bound.into_iter().enumerate() {
        assert!(changed(change), "change {k} was not noticed");
    }
    let without = |what: usize| {
        SceneLayout::with_roles(
            &scene(),
            |i, _, roles| {
                if i == what { Roles::NONE } else { roles }
            },
        )
    };
    assert_eq!(without(LAMP).source, source);
    assert_ne!(without(PLANT).source, source);
    assert_eq!(without(PLANT).primitives, [(0, 0), (0, 2), (4, 0)]);
}

#[test]
fn where_the_lights_are_changes_no_bit_but_the_enclosure() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        max_level: 1,
        ..common::quick()
    };
    let baked = |change: fn(&mut Scene), name: &str| {
        let mut scene = scene();
        change(&mut scene);
        let geometry = geometry(&scene);
        let path = folder.path().join(name);
        bake(&geometry, &options, &path, &NoProgress).unwrap();
        (
            geometry.enclosure(),
            identity(&geometry, &options),
            std::fs::read(&path).unwrap(),
        )
    };
    let here = baked(|_| {}, "here");
    let there = baked(
        |s| s.instances[LAMP].world_from_local.translation = DVec3::new(7.0, 30.0, -2.0),
        "there",
    );
    assert_eq!(here, there);
    // Below the floor: the floor is between light and scene, and casts. What now has everything on one side is the upper
    // pot, which is double-sided.
    let below = baked(
        |s| s.instances[LAMP].world_from_local.translation.y = -2.0,
        "below",
    );
    assert_eq!((here.0.triangles, below.0.triangles), (3, 2));
    assert_eq!(below.1.source, here.1.source);
    assert_ne!(below.1.settings, here.1.settings);
    assert_ne!(below.2, here.2);
}
