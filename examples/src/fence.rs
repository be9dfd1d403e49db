//! What stands in `area_shadows`, and the light that moves around it.

use crate::shapes::{bunny, teapot};
use bevy::asset::RenderAssetUsages;
use bevy::image::ImageSampler;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use std::f32::consts::PI;

/// Something that does not move.
#[derive(Debug, Clone)]
pub struct Part {
    /// What it is called in reports.
    pub name: &'static str,
    /// Its shape.
    pub mesh: Mesh,
    /// Where it stands.
    pub place: Transform,
    /// Base color.
    pub color: Color,
    /// Perceptual roughness.
    pub roughness: f32,
}

/// Side of a square of the floor and the wall, metres: each has samples of its own fineness.
const SQUARE: f32 = 0.5;

/// Floor, wall, a teapot, a bunny, and a fence.
#[must_use]
pub fn parts() -> Vec<Part> {
    let at = Transform::from_xyz;
    let squares = |half: Vec2| {
        Plane3d::new(Vec3::Y, half)
            .mesh()
            .subdivisions((2.0 * half.min_element() / SQUARE) as u32 - 1)
            .build()
    };
    let mut parts = vec![
        Part {
            name: "floor",
            mesh: squares(Vec2::new(4.0, 4.0)),
            place: at(0.0, 0.0, 1.6),
            color: Color::linear_rgb(0.42, 0.40, 0.38),
            roughness: 0.45,
        },
        Part {
            name: "wall",
            mesh: squares(Vec2::new(4.0, 2.0)),
            place: at(0.0, 2.0, -2.4).with_rotation(Quat::from_rotation_x(PI / 2.0)),
            color: Color::linear_rgb(0.62, 0.60, 0.56),
            roughness: 0.9,
        },
        Part {
            name: "teapot",
            mesh: teapot().mesh(),
            place: at(-1.0, 0.0, 0.35).with_rotation(Quat::from_rotation_y(-0.35)),
            color: Color::linear_rgb(0.10, 0.32, 0.34),
            roughness: 0.25,
        },
        Part {
            name: "bunny",
            mesh: bunny().mesh(),
            place: at(0.85, 0.0, 0.5).with_rotation(Quat::from_rotation_y(-0.5)),
            color: Color::linear_rgb(0.70, 0.64, 0.56),
            roughness: 0.75,
        },
    ];
    /// Width, height and thickness of a slat, metres.
    const SLAT: Vec3 = Vec3::new(0.1, 0.85, 0.03);
    const SLATS: i32 = 9;
    const SPACING: f32 = 0.28;
    const FENCE_Z: f32 = -0.75;
    let mut wood = |name, size: Vec3, place: Vec3| {
        parts.push(Part {
            name,
            mesh: Cuboid::from_size(Vec3::ONE).mesh().build(),
            place: Transform::from_translation(place).with_scale(size),
            color: Color::linear_rgb(0.45, 0.26, 0.13),
            roughness: 0.6,
        });
    };
    for slat in 0..SLATS {
        let x = (slat - SLATS / 2) as f32 * SPACING;
        wood("slat", SLAT, Vec3::new(x, SLAT.y / 2.0, FENCE_Z));
    }
    // A piece for each slat: a grid of samples is as fine along a triangle as across it, and one over the whole length
    // would miss the slats' shadows or waste samples on its width.
    for (piece, y) in (0..SLATS).flat_map(|piece| [(piece, 0.22), (piece, 0.62)]) {
        let x = (piece - SLATS / 2) as f32 * SPACING;
        wood(
            "rail",
            Vec3::new(SPACING, 0.07, 0.03),
            Vec3::new(x, y, FENCE_Z - SLAT.z),
        );
    }
    parts
}

/// Where the moving light is at a time: on its way around the scene, turning about its axis, growing and shrinking.
///
/// It stays above and outside of everything: visibility is told by direction, so that what stands behind a light would
/// hide it, too.
#[must_use]
pub fn light_place(time: f32) -> Transform {
    const RADII: Vec2 = Vec2::new(2.3, 1.5);
    const START: f32 = -0.7;
    let around = Vec2::from_angle(START + 0.4 * time) * RADII;
    let height = 2.1 + 0.2 * (0.9 * time).sin();
    let scale = 1.0 + 0.35 * (0.7 * time).sin();
    let mut light = Transform::from_xyz(around.x, height, around.y - 0.2)
        .looking_at(Vec3::new(0.0, 0.3, 0.2), Vec3::Y)
        .with_scale(Vec3::splat(scale));
    light.rotate_local_z(0.35 * time);
    light
}

/// A window of coloured panes.
#[must_use]
pub fn light_image() -> Image {
    const SIZE: u32 = 64;
    const PANES: [[u8; 3]; 6] = [
        [255, 40, 30],
        [255, 190, 30],
        [30, 120, 255],
        [60, 220, 80],
        [255, 255, 255],
        [190, 50, 255],
    ];
    let texels = (0..SIZE * SIZE).flat_map(|i| {
        let (x, y) = (i % SIZE, i / SIZE);
        let (column, row) = (x * 3 / SIZE, y * 2 / SIZE);
        // Lead between the panes.
        let lead = |at: u32, panes: u32| (at * panes) % SIZE < panes * 2;
        let [r, g, b] = if lead(x, 3) || lead(y, 2) {
            [12; 3]
        } else {
            PANES[(row * 3 + column) as usize]
        };
        [r, g, b, u8::MAX]
    });
    let mut image = Image::new(
        Extent3d {
            width: SIZE,
            height: SIZE,
            depth_or_array_layers: 1,
        },
        TextureDimension::D2,
        texels.collect(),
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::default(),
    );
    image.sampler = ImageSampler::linear();
    image
}
