//! Bodies made by code: surfaces of revolution, tubes, ellipsoids with bumps.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use std::f32::consts::TAU;

/// Closed surfaces, several of which make one mesh. Triangles run counter-clockwise as seen from outside.
#[derive(Debug, Clone, Default)]
pub struct Body {
    /// Metres.
    pub positions: Vec<Vec3>,
    /// Indices of their corners.
    pub triangles: Vec<[u32; 3]>,
}

impl Body {
    /// A mesh with smooth normals, its vertices kept on the CPU.
    #[must_use]
    pub fn mesh(self) -> Mesh {
        let indices = self.triangles.into_iter().flatten().collect();
        Mesh::new(
            PrimitiveTopology::TriangleList,
            RenderAssetUsages::default(),
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions)
        .with_inserted_indices(Indices::U32(indices))
        .with_computed_smooth_normals()
    }

    /// A skin over rings of equally many points, closed at both ends by a point.
    ///
    /// The points of a ring run around the direction from `start` to `end` the way that carries Z to X around Y.
    fn add_skin(&mut self, start: Vec3, rings: &[Vec<Vec3>], end: Vec3) {
        let first = self.positions.len() as u32;
        let around = rings.first().map_or(0, Vec::len) as u32;
        self.positions.push(start);
        self.positions.extend(rings.iter().flatten());
        self.positions.push(end);
        let last = self.positions.len() as u32 - 1;
        let at = |ring: u32, step: u32| first + 1 + ring * around + step % around;
        for step in 0..around {
            self.triangles.push([first, at(0, step), at(0, step + 1)]);
            for ring in 1..rings.len() as u32 {
                let (a, b) = (at(ring - 1, step), at(ring, step));
                let (c, d) = (at(ring - 1, step + 1), at(ring, step + 1));
                self.triangles.extend([[a, b, c], [c, b, d]]);
            }
            let top = rings.len() as u32 - 1;
            self.triangles
                .push([last, at(top, step + 1), at(top, step)]);
        }
    }

    /// A surface of revolution about Y. The profile runs upwards, as radius and height, and begins and ends on the axis.
    pub fn add_lathe(&mut self, profile: &[Vec2], around: u32) {
        let [start, inner @ .., end] = profile else {
            return;
        };
        let on_axis = |point: &Vec2| Vec3::new(0.0, point.y, 0.0);
        let rings: Vec<Vec<Vec3>> = inner
            .iter()
            .map(|point| {
                ring(around)
                    .map(|turn| Vec3::new(point.x * turn.x, point.y, point.x * turn.y))
                    .collect()
            })
            .collect();
        self.add_skin(on_axis(start), &rings, on_axis(end));
    }

    /// A tube along a path in the plane z = 0, of a radius at each point, closed at its ends.
    pub fn add_tube(&mut self, path: &[(Vec2, f32)], around: u32) {
        let place = |index: usize| path[index].0.extend(0.0);
        let last = path.len().saturating_sub(1);
        let rings: Vec<Vec<Vec3>> = (0..path.len())
            .map(|i| {
                let along = place((i + 1).min(last)) - place(i.saturating_sub(1));
                let across = Vec3::Z.cross(along.normalize_or_zero());
                ring(around)
                    .map(|turn| place(i) + path[i].1 * (turn.x * Vec3::Z + turn.y * across))
                    .collect()
            })
            .collect();
        if !path.is_empty() {
            self.add_skin(place(0), &rings, place(last));
        }
    }

    /// An ellipsoid of these half-axes, scaled in each direction (of the unit sphere) by `bumps`.
    pub fn add_ellipsoid(
        &mut self,
        place: Transform,
        half_axes: Vec3,
        around: u32,
        bumps: impl Fn(Vec3) -> f32,
    ) {
        let point =
            |direction: Vec3| place.transform_point(half_axes * direction * bumps(direction));
        let rows = around / 2;
        let rings: Vec<Vec<Vec3>> = (1..rows)
            .map(|row| {
                let polar = TAU / 2.0 * row as f32 / rows as f32;
                ring(around)
                    .map(|turn| turn * polar.sin())
                    .map(|turn| point(Vec3::new(turn.x, -polar.cos(), turn.y)))
                    .collect()
            })
            .collect();
        self.add_skin(point(Vec3::NEG_Y), &rings, point(Vec3::Y));
    }
}

/// Points of the unit circle.
fn ring(count: u32) -> impl Iterator<Item = Vec2> {
    (0..count).map(move |step| Vec2::from_angle(TAU * step as f32 / count as f32))
}

/// Points on a Catmull-Rom spline through `knots`, `steps` for each piece, the last knot included.
fn spline<T: Copy, R>(knots: &[T], steps: usize, mix: impl Fn([T; 4], f32) -> R) -> Vec<R> {
    let at = |i: usize| knots[i.min(knots.len() - 1)];
    let mut points = Vec::new();
    for i in 0..knots.len().saturating_sub(1) {
        let near = [at(i.saturating_sub(1)), at(i), at(i + 1), at(i + 2)];
        points.extend((0..steps).map(|step| mix(near, step as f32 / steps as f32)));
    }
    if let Some(&last) = knots.last() {
        points.push(mix([last; 4], 0.0));
    }
    points
}

fn catmull_rom(near: [f32; 4], t: f32) -> f32 {
    let [a, b, c, d] = near;
    let (square, cube) = (t * t, t * t * t);
    0.5 * (2.0 * b
        + (c - a) * t
        + (2.0 * a - 5.0 * b + 4.0 * c - d) * square
        + (3.0 * (b - c) + d - a) * cube)
}

fn mix_points(near: [Vec2; 4], t: f32) -> Vec2 {
    Vec2::new(
        catmull_rom(near.map(|point| point.x), t),
        catmull_rom(near.map(|point| point.y), t),
    )
}

fn mix_tube(near: [(Vec2, f32); 4], t: f32) -> (Vec2, f32) {
    (
        mix_points(near.map(|(point, _)| point), t),
        catmull_rom(near.map(|(_, radius)| radius), t),
    )
}

/// A pot with lid, spout (towards −X) and handle, 1 m high, standing on y = 0.
#[must_use]
pub fn teapot() -> Body {
    const AROUND: u32 = 40;
    const TUBE_AROUND: u32 = 14;
    const STEPS: usize = 3;
    let knots = [
        (0.30, 0.0),
        (0.44, 0.06),
        (0.57, 0.26),
        (0.56, 0.46),
        (0.45, 0.64),
        (0.34, 0.71),
        (0.34, 0.74),
        (0.24, 0.81),
        (0.09, 0.86),
        (0.055, 0.90),
        (0.09, 0.95),
        (0.05, 0.99),
    ]
    .map(Vec2::from);
    let mut profile = vec![Vec2::ZERO];
    profile.extend(spline(&knots, STEPS, mix_points));
    profile.push(Vec2::new(0.0, 1.0));
    let mut pot = Body::default();
    pot.add_lathe(&profile, AROUND);
    let knot = |x, y, radius| (Vec2::new(x, y), radius);
    let spout = [
        knot(-0.42, 0.26, 0.15),
        knot(-0.62, 0.32, 0.12),
        knot(-0.74, 0.50, 0.085),
        knot(-0.84, 0.68, 0.06),
        knot(-0.96, 0.76, 0.055),
    ];
    pot.add_tube(&spline(&spout, STEPS, mix_tube), TUBE_AROUND);
    let handle = [
        knot(0.44, 0.62, 0.05),
        knot(0.66, 0.66, 0.045),
        knot(0.84, 0.56, 0.045),
        knot(0.84, 0.38, 0.045),
        knot(0.70, 0.24, 0.045),
        knot(0.50, 0.20, 0.05),
    ];
    pot.add_tube(&spline(&handle, STEPS, mix_tube), TUBE_AROUND);
    pot
}

/// A sitting animal with long ears, 1.4 m high, looking along Z, its feet on y = 0.
#[must_use]
pub fn bunny() -> Body {
    const FINE: u32 = 32;
    const COARSE: u32 = 20;
    let at = Transform::from_xyz;
    let smooth = |_: Vec3| 1.0;
    let fur = |d: Vec3| 1.0 + 0.03 * (9.0 * d.x).sin() * (8.0 * d.y).sin() * (7.0 * d.z).cos();
    let mut bunny = Body::default();
    bunny.add_ellipsoid(at(0.0, 0.42, -0.05), Vec3::new(0.36, 0.40, 0.44), FINE, fur);
    bunny.add_ellipsoid(
        at(0.0, 0.88, 0.22),
        Vec3::new(0.25, 0.23, 0.27),
        FINE,
        smooth,
    );
    bunny.add_ellipsoid(at(0.0, 0.30, -0.48), Vec3::splat(0.12), COARSE, fur);
    for side in [-1.0, 1.0] {
        let ear = at(0.12 * side, 1.22, 0.10).with_rotation(Quat::from_euler(
            EulerRot::ZXY,
            -0.22 * side,
            -0.25,
            0.0,
        ));
        // A hollow on the front.
        let hollow = |d: Vec3| 1.0 - 0.45 * d.z.max(0.0) * (1.0 - d.y * d.y);
        bunny.add_ellipsoid(ear, Vec3::new(0.085, 0.30, 0.06), COARSE, hollow);
        bunny.add_ellipsoid(
            at(0.2 * side, 0.08, 0.25),
            Vec3::new(0.11, 0.08, 0.22),
            COARSE,
            smooth,
        );
        bunny.add_ellipsoid(
            at(0.13 * side, 0.36, 0.30),
            Vec3::new(0.09, 0.22, 0.10),
            COARSE,
            smooth,
        );
    }
    bunny
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// Volume that the triangles enclose, positive if they are seen counter-clockwise from outside.
    fn volume(body: &Body) -> f32 {
        body.triangles
            .iter()
            .map(|t| t.map(|i| body.positions[i as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum()
    }

    #[test]
    fn surfaces_are_closed_and_face_outwards() {
        for (name, body) in [("teapot", teapot()), ("bunny", bunny())] {
            let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
            for [a, b, c] in &body.triangles {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *edges.entry((*from.min(to), *from.max(to))).or_default() +=
                        if from < to { 1 } else { -1 };
                }
            }
            assert!(edges.values().all(|&sum| sum == 0), "{name} has a hole");
            assert!(volume(&body) > 0.1, "{name}: {}", volume(&body));
            let lowest = body.positions.iter().map(|p| p.y).fold(1.0, f32::min);
            assert!(lowest.abs() < 0.03, "{name} does not stand: {lowest}");
        }
        let mut sphere = Body::default();
        sphere.add_ellipsoid(Transform::IDENTITY, Vec3::ONE, 64, |_| 1.0);
        let ball = 2.0 / 3.0 * TAU;
        assert!((volume(&sphere) / ball - 1.0).abs() < 0.01);
        let mut tube = Body::default();
        tube.add_tube(&[(Vec2::ZERO, 0.1), (Vec2::new(1.0, 1.0), 0.1)], 64);
        let cylinder = TAU / 2.0 * 0.01 * 2_f32.sqrt();
        assert!((volume(&tube) / cylinder - 1.0).abs() < 0.01);
    }
}
