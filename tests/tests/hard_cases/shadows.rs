//! Parts of lights: what trees of baked visibility cut out of them, and what boxes and balls hide.

use crate::table::*;
use akari_math::convex_shadow::{
    ClippedPolygon, box_shadow, clipped_polygon_new, clipped_polygon_push, sphere_shadow,
};
use akari_math::form_factor::{
    form_factor_chain_close, form_factor_chain_new, form_factor_chain_push,
};
use akari_math::oracle;
use akari_visibility::face::{FaceLine, face_axes, face_side, line_normal};
use akari_visibility::query::visit_tree_pieces;
use akari_visibility::tree::{Tree, TreeBuilder};
use glam::{DVec3, Vec3};
use std::sync::OnceLock;

const CORNERS: usize = 4;
const SHADOW: &str = "akari_math::convex_shadow";
const QUERY: &str = "akari_visibility::query";
/// What f32 leaves of a sum of form factors of parts.
const PARTS: Bound = absolute(2e-6);

pub fn rows() -> Vec<Row> {
    vec![tree(), hidden_by_a_box(), hidden_by_a_ball()]
}

pub fn guards() -> Vec<Guard> {
    let guard = |what, row, module, from, to| Guard {
        what,
        row,
        module,
        from,
        to,
    };
    vec![
        guard(
            "points inside of the box",
            "light behind a box",
            SHADOW,
            "if outside.x <= 1.0 && outside.y <= 1.0 && outside.z <= 1.0 {",
            "if outside.x < -1.0 {",
        ),
        guard(
            "the part of the light before the box",
            "light behind a box",
            SHADOW,
            "if abs(at) > 1.0 {",
            "if abs(at) > 1e30 {",
        ),
        guard(
            "points inside of the ball",
            "light behind a ball",
            SHADOW,
            "if distance <= 1.0 {",
            "if distance <= -1.0 {",
        ),
        guard(
            "vertices on a plane",
            "light through trees",
            QUERY,
            "const ON_PLANE: f32 = 1e-6;",
            "const ON_PLANE: f32 = -1e-3;",
        ),
    ]
}

/// Angle and offset of the one line on each face: across, through corners, near a border, through the middle.
const LINES: [(f32, f32); 6] = [
    (0.0, 0.0),
    (std::f32::consts::FRAC_PI_4, 0.0),
    (0.3, 0.97),
    (2.0, -0.4),
    (1.5, 0.999),
    (-std::f32::consts::FRAC_PI_4, -1.2),
];
/// Visibility on both sides, as stored: 1 and 51/255.
const SIDES: [f32; 2] = [1.0, 0.2];

/// One tree a face, of one line.
fn trees() -> &'static [Tree; 6] {
    static TREES: OnceLock<[Tree; 6]> = OnceLock::new();
    TREES.get_or_init(|| {
        std::array::from_fn(|face| {
            let mut builder = TreeBuilder::new();
            let line = FaceLine::from_angle(LINES[face].0, LINES[face].1);
            let line = line.pack().expect("a line across the face");
            let sides = SIDES.map(|visibility| builder.leaf(visibility));
            let root = builder.split(line, sides[0], sides[1]);
            builder.finish(root).expect("one node")
        })
    })
}

/// The same as planes through the point: the sides of each face, and its line with the visibility of both sides.
fn cones() -> &'static [([DVec3; 4], DVec3, [f64; 2]); 6] {
    static CONES: OnceLock<[([DVec3; 4], DVec3, [f64; 2]); 6]> = OnceLock::new();
    CONES.get_or_init(|| {
        std::array::from_fn(|face| {
            let [word, payload] = trees()[face].node_words(0);
            let axes = face_axes(face as u32);
            // A hair within the face: below a side's plane is outside.
            let middle = axes[2].as_dvec3();
            let sides = std::array::from_fn(|side| {
                let plane = face_side(face as u32, side as u32).as_dvec3();
                plane * plane.dot(middle).signum()
            });
            let normal = line_normal(face as u32, word).as_dvec3();
            let visibility = [payload & 0xff, payload >> 8 & 0xff].map(|v| f64::from(v) / 255.0);
            (sides, normal, visibility)
        })
    })
}

fn cut(polygon: &[DVec3], plane: DVec3) -> Vec<DVec3> {
    let mut kept = Vec::new();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (plane.dot(a), plane.dot(b));
        if da >= 0.0 {
            kept.push(a);
        }
        if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
            kept.push(a + (b - a) * (da / (da - db)));
        }
    }
    kept
}

fn corners(x: &[f32]) -> [Vec3; CORNERS] {
    std::array::from_fn(|i| vec3(x, 3 * i))
}

fn corners_wide(x: &[f64]) -> [DVec3; CORNERS] {
    std::array::from_fn(|i| dvec3(x, 3 * i))
}

/// Vector form factor of a polygon that is not clipped at any horizon.
fn form_factor(vertices: &[Vec3]) -> Vec3 {
    let mut chain = form_factor_chain_new();
    for &vertex in vertices {
        chain = form_factor_chain_push(chain, vertex);
    }
    form_factor_chain_close(chain)
}

fn facing(center: Vec3, width: f32, height: f32) -> [Vec3; CORNERS] {
    let u = center.cross(Vec3::new(0.2, 1.0, 0.1)).normalize();
    let v = u.cross(center).normalize();
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(s, t): (f32, f32)| center + 0.5 * (s * width * u + t * height * v))
}

/// A light through trees: the form factor of the parts, each by its visibility.
fn tree() -> Row {
    let mut sweeps = Vec::new();
    let mut add = |name: String, polygons: Vec<[Vec3; CORNERS]>| {
        sweeps.push(sweep(
            name,
            PARTS,
            samples(&polygons, |polygon, row| {
                for corner in polygon {
                    push3(row, corner);
                }
            }),
        ));
    };
    // Around the point, across faces, edges and corners of the cube.
    for size in [1e-4_f32, 0.05, 0.5, 2.0] {
        let turn = |i: i32| {
            let angle = f64::from(i) * std::f64::consts::TAU / 240.0;
            DVec3::new(angle.cos(), 0.4 * (3.0 * angle).sin(), angle.sin())
                .as_vec3()
                .normalize()
        };
        add(
            format!("around the point, {size} wide"),
            (0..240)
                .map(|i| facing(turn(i), size, 0.7 * size))
                .collect(),
        );
    }
    // An edge of the light over a line of a face, in steps down to 1e-9.
    for (face, axis) in [(0_usize, Vec3::Y), (1, Vec3::Z), (3, Vec3::X)] {
        let middle = face_axes(face as u32)[2];
        add(
            format!("an edge over the line of face {face}"),
            through_zero(0.5, 60)
                .into_iter()
                .map(|shift| facing(middle * 2.0 + axis * shift, 0.8, 0.5))
                .collect(),
        );
    }
    let corner = Vec3::ONE.normalize();
    add(
        "needles over a corner of the cube".to_owned(),
        log_steps(-9.0, 1.0, 120)
            .into_iter()
            .map(|s| facing(corner, 0.8, s))
            .collect(),
    );
    add(
        "tiny to huge".to_owned(),
        log_steps(-7.0, 2.0, 180)
            .into_iter()
            .map(|s| facing(Vec3::new(0.9, 0.3, 0.2), s, s))
            .collect(),
    );
    add(
        "scale of the scene".to_owned(),
        log_steps(-9.0, 9.0, 180)
            .into_iter()
            .map(|s| facing(Vec3::new(0.9, 0.9, 0.2), 0.8, 0.5).map(|v| v * s))
            .collect(),
    );
    let mut random = Random::new(11);
    add(
        "anywhere".to_owned(),
        (0..1500)
            .map(|_| {
                let size = 10.0_f32.powf(random.range(-3.0, 0.5));
                facing(random.direction(), size, size * random.range(0.1, 1.0))
            })
            .collect(),
    );
    // Words of all nodes, and the face that each belongs to is its index.
    let words: Vec<String> = trees()
        .iter()
        .flat_map(|tree| tree.node_words(0))
        .map(|word| format!("{word}u"))
        .collect();
    Row {
        name: "light through trees",
        source: Source {
            header: format!(
                "#import akari_math::form_factor::{{form_factor_chain_new, form_factor_chain_push, form_factor_chain_close}}
#import {QUERY}::{{Traversal, traversal_new, traversal_push, traversal_close, traversal_enter, traversal_next, traversal_is_piece, traversal_visibility, traversal_split}}
fn visible() -> vec3<f32> {{
    var words = array<u32, 12>({});
    var t = traversal_new();
    for (var i = 0u; i < 4u; i++) {{
        traversal_push(&t, x_vec3(3u * i));
    }}
    traversal_close(&t);
    var sum = vec3<f32>(0.0);
    for (var face = 0u; face < 6u; face++) {{
        traversal_enter(&t, face, {}u);
        while traversal_next(&t) {{
            if traversal_is_piece(&t) {{
                var chain = form_factor_chain_new();
                for (var i = 0u; i < t.count; i++) {{
                    chain = form_factor_chain_push(chain, t.vertices[t.first + i]);
                }}
                sum += traversal_visibility(&t) * form_factor_chain_close(chain);
            }} else {{
                traversal_split(&t, words[2u * face], words[2u * face + 1u]);
            }}
        }}
    }}
    return sum;
}}",
                words.join(", "),
                trees()[0].root().0
            ),
            body: "y_vec3(0u, visible());",
        },
        inputs: 12,
        outputs: 3,
        twin: |x, y| {
            let mut sum = Vec3::ZERO;
            visit_tree_pieces(trees(), &corners(x), |piece, visibility| {
                sum += visibility * form_factor(piece);
            });
            push3(y, sum);
        },
        oracle: |x, y| {
            let mut sum = DVec3::ZERO;
            for (sides, line, visibility) in cones() {
                let mut part = corners_wide(x).to_vec();
                for side in sides {
                    part = cut(&part, *side);
                }
                for (plane, visibility) in [(-*line, visibility[0]), (*line, visibility[1])] {
                    sum += visibility * oracle::unclipped_form_factor(&cut(&part, plane));
                }
            }
            push3_wide(y, sum);
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps,
    }
}

/// Corners relative to the apex, then the apex, in the space of the box or ball.
const CLIPPED: &str = "#import akari_math::form_factor::{form_factor_chain_new, form_factor_chain_push, form_factor_chain_close}
#import akari_math::convex_shadow::{ClippedPolygon, clipped_polygon_new, clipped_polygon_push, box_shadow, sphere_shadow}
fn light() -> ClippedPolygon {
    var polygon = clipped_polygon_new();
    for (var i = 0u; i < 4u; i++) {
        clipped_polygon_push(&polygon, x_vec3(3u * i));
    }
    return polygon;
}
fn hidden(polygon: ptr<function, ClippedPolygon>) -> vec3<f32> {
    var chain = form_factor_chain_new();
    for (var i = 0u; i < (*polygon).count; i++) {
        chain = form_factor_chain_push(chain, (*polygon).vertices[i]);
    }
    return form_factor_chain_close(chain);
}";

fn light(x: &[f32]) -> ClippedPolygon {
    let mut polygon = clipped_polygon_new();
    for corner in corners(x) {
        clipped_polygon_push(&mut polygon, corner);
    }
    polygon
}

/// A light of `size` at `at`, facing the apex, seen from `apex`.
fn seen(at: Vec3, size: f32, apex: Vec3, row: &mut Vec<f32>) {
    for corner in facing(at - apex, size, size) {
        push3(row, corner);
    }
    push3(row, apex);
}

fn hidden_by_a_box() -> Row {
    let mut sweeps = Vec::new();
    let mut random = Random::new(12);
    for size in [0.01_f32, 1.0, 6.0] {
        let at = Vec3::new(-0.3, -5.0, 0.4);
        sweeps.push(sweep(
            format!("apex across the silhouette's edges, light of {size}"),
            PARTS,
            samples(&steps(-4.0, 4.0, 400), |x, row| {
                seen(at, size, Vec3::new(x, 3.0, 0.3), row);
            }),
        ));
        sweeps.push(sweep(
            format!("apex through a face's plane, light of {size}"),
            PARTS,
            samples(&through_zero(0.5, 60), |d, row| {
                seen(at, size, Vec3::new(1.0 + d, 3.0, 0.3), row);
            }),
        ));
        let anywhere: Vec<Vec3> = (0..400)
            .map(|_| {
                let d = random.direction();
                Vec3::new(d.x, d.y.abs() + 0.2, d.z) * random.range(2.0, 9.0)
            })
            .collect();
        sweeps.push(sweep(
            format!("apex anywhere, light of {size}"),
            PARTS,
            samples(&anywhere, |apex, row| seen(at, size, apex, row)),
        ));
    }
    sweeps.push(sweep(
        "from far",
        PARTS,
        samples(&log_steps(0.5, 6.0, 110), |far, row| {
            seen(
                Vec3::new(0.0, -5.0, 0.0),
                3.0,
                Vec3::new(0.1, 1.0, 0.2) * far,
                row,
            );
        }),
    ));
    // Before the box, beside it, and from inside of it: nothing is hidden.
    let mut open = Vec::new();
    for apex in [
        Vec3::ZERO,
        Vec3::splat(0.999_999),
        Vec3::new(1.0, 0.3, -0.2),
    ] {
        seen(Vec3::new(0.0, -5.0, 0.0), 3.0, apex, &mut open);
    }
    for height in [2.0_f32, 3.0, 1e3] {
        seen(
            Vec3::new(0.1, height, 0.2),
            0.5,
            Vec3::new(0.3, 1.5, 0.1),
            &mut open,
        );
    }
    for height in [2.0_f32, 3.0, 4.0] {
        seen(
            Vec3::new(0.1, height, 0.2),
            0.5,
            Vec3::new(0.3, 6.0, 0.1),
            &mut open,
        );
    }
    sweeps.push(sweep(
        "from inside, and with the light before it",
        PARTS,
        open,
    ));
    let mut broken = Vec::new();
    for apex in [
        Vec3::splat(1e15),
        Vec3::new(1.0, 1.0, 1.0),
        Vec3::new(1.0, 5.0, 1.0),
    ] {
        for polygon in [[Vec3::ZERO; 4], [Vec3::NEG_Y; 4], [Vec3::splat(-1e15); 4]] {
            for corner in polygon {
                push3(&mut broken, corner);
            }
            push3(&mut broken, apex);
        }
    }
    sweeps.push(sweep("no light, and at the corners", ANY, broken));
    Row {
        name: "light behind a box",
        source: Source {
            header: CLIPPED.to_owned(),
            body: "var polygon = light(); box_shadow(&polygon, x_vec3(12u)); y_vec3(0u, hidden(&polygon));",
        },
        inputs: 15,
        outputs: 3,
        twin: |x, y| {
            let mut polygon = light(x);
            box_shadow(&mut polygon, vec3(x, 12));
            push3(y, form_factor(&polygon.vertices[..polygon.count as usize]));
        },
        oracle: |x, y| {
            let apex = dvec3(x, 12);
            let polygon = corners_wide(x);
            let at: DVec3 = polygon.iter().sum::<DVec3>() / 4.0 + apex;
            // The light is wholly before the box, or the apex in it; or wholly beyond it.
            let is_open = apex.abs().max_element() <= 1.0 || at.y > 1.0;
            push3_wide(
                y,
                if is_open {
                    DVec3::ZERO
                } else {
                    behind_box(&polygon, apex)
                },
            );
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps,
    }
}

/// Form factor of what the box hides of a light that is wholly beyond it: a light ∩ convex hull of the box's corners
/// as seen from the apex, by the planes through pairs of corners that have all others on one side.
fn behind_box(polygon: &[DVec3], apex: DVec3) -> DVec3 {
    let corners: Vec<DVec3> = (0..8)
        .map(|i| {
            let side = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
            DVec3::new(side(1), side(2), side(4)) - apex
        })
        .collect();
    let mut part = polygon.to_vec();
    for (i, a) in corners.iter().enumerate() {
        for b in &corners[i + 1..] {
            let plane = a.cross(*b);
            let scale = plane.length() * apex.length().max(1.0);
            let heights: Vec<f64> = corners.iter().map(|c| plane.dot(*c) / scale).collect();
            if plane.length() < 1e-9 {
                continue;
            }
            if heights.iter().all(|&h| h > -1e-12) {
                part = cut(&part, plane);
            } else if heights.iter().all(|&h| h < 1e-12) {
                part = cut(&part, -plane);
            }
        }
    }
    oracle::unclipped_form_factor(&part)
}

fn hidden_by_a_ball() -> Row {
    // The octagon about the cone has its area and is up to a few per cent inside and outside of its rim.
    let rim = |size: f32| absolute(if size < 0.1 { 1e-3 } else { 0.02 });
    let mut sweeps = Vec::new();
    for size in [0.01_f32, 0.5] {
        let at = Vec3::new(0.0, -5.0, 0.0);
        sweeps.push(
            sweep(
                format!("apex across the rim, light of {size}"),
                rim(size),
                samples(&steps(-8.0, 8.0, 800), |x, row| {
                    seen(at, size, Vec3::new(x, 3.0, 0.1), row);
                }),
            )
            .jump(absolute(3e-3)),
        );
    }
    // Every light but the whole sky is behind it from just outside, and none from just inside.
    sweeps.push(sweep(
        "from inside",
        absolute(1e-7),
        samples(&steps(0.0, 1.0, 100), |d, row| {
            seen(
                Vec3::new(0.0, -5.0, 0.0),
                3.0,
                Vec3::new(0.0, d.min(0.999_999), 0.0),
                row,
            );
        }),
    ));
    sweeps.push(sweep(
        "from outside, down to 1e-6 of the surface",
        absolute(2e-6),
        samples(&log_steps(-6.0, 0.5, 130), |d, row| {
            seen(
                Vec3::new(0.0, -5.0, 0.0),
                0.5,
                Vec3::new(0.0, 1.0 + d, 0.0),
                row,
            );
        }),
    ));
    let mut broken = Vec::new();
    for apex in [Vec3::splat(1e15), Vec3::Y, Vec3::new(0.0, 1.0 + 1e-7, 0.0)] {
        for polygon in [[Vec3::ZERO; 4], [Vec3::NEG_Y; 4], [Vec3::splat(-1e15); 4]] {
            for corner in polygon {
                push3(&mut broken, corner);
            }
            push3(&mut broken, apex);
        }
    }
    sweeps.push(sweep("no light, and on the surface", ANY, broken));
    Row {
        name: "light behind a ball",
        source: Source {
            header: CLIPPED.to_owned(),
            body: "var polygon = light(); sphere_shadow(&polygon, x_vec3(12u)); y_vec3(0u, hidden(&polygon));",
        },
        inputs: 15,
        outputs: 3,
        twin: |x, y| {
            let mut polygon = light(x);
            sphere_shadow(&mut polygon, vec3(x, 12));
            push3(y, form_factor(&polygon.vertices[..polygon.count as usize]));
        },
        oracle: |x, y| {
            let apex = dvec3(x, 12);
            let polygon = corners_wide(x);
            let distance = apex.length();
            if distance <= 1.0 {
                push3_wide(y, DVec3::ZERO);
                return;
            }
            // The true cone, as many planes.
            const PLANES: u32 = 512;
            let axis = -apex / distance;
            let tangent = 1.0 / (distance * distance - 1.0).sqrt();
            let (u, v) = axis.any_orthonormal_pair();
            let mut part = polygon.to_vec();
            for k in 0..PLANES {
                let angle = std::f64::consts::TAU * f64::from(k) / f64::from(PLANES);
                part = cut(&part, tangent * axis - (angle.cos() * u + angle.sin() * v));
            }
            push3_wide(y, oracle::unclipped_form_factor(&part));
        },
        range: [-1.0 - 1e-6, 1.0 + 1e-6],
        sweeps,
    }
}
