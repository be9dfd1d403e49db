use super::*;
use crate::bvh::Caster;
use glam::Vec3;

/// Deterministic numbers in [0, 1).
struct Lcg(u64);

impl Lcg {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next() as f32, self.next() as f32, self.next() as f32) * 2.0 - 1.0
    }
}

fn caster(vertices: [Vec3; 3]) -> Caster {
    Caster {
        vertices,
        front: None,
        cut: None,
    }
}

/// Large and small triangles, slivers, coinciding walls, and a grid whose vertices lie on texel centres' planes.
fn soup(rng: &mut Lcg) -> Vec<Caster> {
    let mut list = Vec::new();
    for k in 0..90 {
        let middle = 1.5 * rng.vector();
        let size = [0.02, 0.1, 0.3, 0.6][k % 4];
        list.push(caster([0, 1, 2].map(|_| middle + size * rng.vector())));
    }
    for _ in 0..20 {
        let (a, b) = (rng.vector() * 2.0, rng.vector() * 2.0);
        list.push(caster([a, b, a.lerp(b, 0.4) + 1e-4 * rng.vector()]));
    }
    let q = |x: f32, z: f32| Vec3::new(x, -1.0, z);
    list.push(caster([q(-2.0, -2.0), q(2.0, -2.0), q(2.0, 2.0)]));
    list.push(caster([q(-2.0, -2.0), q(2.0, 2.0), q(-2.0, 2.0)]));
    list.push(caster([q(-2.0, 2.0), q(2.0, -2.0), q(2.0, 2.0)]));
    for i in 0..6 {
        for j in 0..6 {
            let at = |i: i32, j: i32| Vec3::new(i as f32 / 8.0, j as f32 / 8.0, 1.0);
            list.push(caster([at(i, j), at(i + 1, j), at(i + 1, j + 1)]));
            list.push(caster([at(i, j), at(i + 1, j + 1), at(i, j + 1)]));
        }
    }
    list
}

fn run(
    face: usize,
    bvh: &Bvh,
    origin: &Origin,
    window: Window,
    accept: &impl Accept,
    open: &mut Tile,
) {
    match face {
        0 => cover::<0>(bvh, origin, window, accept, open),
        1 => cover::<1>(bvh, origin, window, accept, open),
        2 => cover::<2>(bvh, origin, window, accept, open),
        3 => cover::<3>(bvh, origin, window, accept, open),
        4 => cover::<4>(bvh, origin, window, accept, open),
        _ => cover::<5>(bvh, origin, window, accept, open),
    }
}

fn full(window: Window) -> Tile {
    let mut tile = [0; TILE];
    tile[..window.extent() as usize].fill(u64::MAX >> (64 - window.extent()));
    tile
}

/// The same test for every texel and every triangle, without boxes, runs or order.
fn one_by_one(
    face: usize,
    bvh: &Bvh,
    origin: &Origin,
    window: Window,
    accept: &impl Accept,
) -> Tile {
    let mut open = full(window);
    for triangle in &bvh.triangles {
        let projected = match face {
            0 => Projected::new::<0>(triangle, origin.position),
            1 => Projected::new::<1>(triangle, origin.position),
            2 => Projected::new::<2>(triangle, origin.position),
            3 => Projected::new::<3>(triangle, origin.position),
            4 => Projected::new::<4>(triangle, origin.position),
            _ => Projected::new::<5>(triangle, origin.position),
        };
        let Some(projected) = projected else { continue };
        for y in 0..window.extent() {
            for x in 0..window.extent() {
                let (a, b) = (window.column(x), window.row(y));
                if projected.covers(a, b) && counts(&projected, a, b, triangle, origin, accept) {
                    open[y as usize] &= !(1 << x);
                }
            }
        }
    }
    open
}

/// Nearest distances along a ray to the inside of a triangle, by Möller and Trumbore 1997, with how near the ray comes
/// to any edge: an implementation that shares nothing with the one tested.
fn moller(origin: DVec3, d: DVec3, triangle: &LeafTriangle) -> Option<(f64, f64)> {
    let [a, b, c] = triangle.vertices.map(|v| Vec3::from(v).as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let p = d.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let v = d.dot(q) / det;
    Some((e2.dot(q) / det, u.min(v).min(1.0 - u - v)))
}

fn origins(rng: &mut Lcg) -> Vec<Origin> {
    (0..6)
        .map(|k| Origin {
            position: (rng.vector() * [0.3, 1.5][k % 2]).as_dvec3(),
            tmin: 1e-6,
            tmax: f64::INFINITY,
        })
        .collect()
}

#[test]
fn the_traversal_changes_no_bit() {
    let mut rng = Lcg(3);
    let bvh = Bvh::build(&soup(&mut rng));
    let all = |_: u32, _: f64, _: f64| true;
    let mut origins = origins(&mut rng);
    // Reaches that end among the triangles.
    for (k, (tmin, tmax)) in [(0.3, 1.0), (1e-6, 0.7), (0.9, 5.0)]
        .into_iter()
        .enumerate()
    {
        origins.push(Origin {
            tmin,
            tmax,
            ..origins[k]
        });
    }
    // On a vertex of the grid: edges run exactly through centres of texels.
    origins.push(Origin {
        position: DVec3::new(0.25, 0.25, 1.0 - 1.0 / 8.0),
        tmin: 1e-6,
        tmax: f64::INFINITY,
    });
    let (mut open_texels, mut texels) = (0, 0);
    for origin in &origins {
        for size in [32, 64] {
            let window = Window { size, x0: 0, y0: 0 };
            for face in 0..6 {
                let mut open = full(window);
                run(face, &bvh, origin, window, &all, &mut open);
                let expected = one_by_one(face, &bvh, origin, window, &all);
                assert_eq!(open, expected, "{origin:?} face {face} size {size}");
                open_texels += open.iter().map(|w| w.count_ones()).sum::<u32>();
                texels += size * size;
            }
        }
    }
    // Neither all nor nothing was seen.
    assert!(open_texels > texels / 20 && open_texels < texels * 19 / 20);
}

#[test]
fn tiles_of_large_faces_are_parts_of_one() {
    let mut rng = Lcg(4);
    let bvh = Bvh::build(&soup(&mut rng));
    let all = |_: u32, _: f64, _: f64| true;
    let origin = origins(&mut rng)[0];
    for size in [128, 256] {
        for face in [1, 4] {
            for (x0, y0) in [(0, 0), (64, 0), (size - 64, size - 64)] {
                let window = Window { size, x0, y0 };
                let mut open = full(window);
                run(face, &bvh, &origin, window, &all, &mut open);
                assert_eq!(open, one_by_one(face, &bvh, &origin, window, &all));
            }
        }
    }
}

#[test]
fn bits_are_those_of_rays() {
    let mut rng = Lcg(5);
    let casters = soup(&mut rng);
    let bvh = Bvh::build(&casters);
    let all = |_: u32, _: f64, _: f64| true;
    let window = Window {
        size: 32,
        x0: 0,
        y0: 0,
    };
    let (mut compared, mut doubtful, mut moved) = (0, 0, 0);
    for origin in origins(&mut rng) {
        for (face, basis) in FACES.iter().enumerate() {
            let mut open = full(window);
            run(face, &bvh, &origin, window, &all, &mut open);
            // Deliberately wrong: rays from somewhere else must not give the same bits.
            let mut elsewhere = full(window);
            let wrong = Origin {
                position: origin.position + DVec3::new(0.05, -0.03, 0.04),
                ..origin
            };
            run(face, &bvh, &wrong, window, &all, &mut elsewhere);
            for y in 0..32 {
                for x in 0..32 {
                    let direction = DVec3::from(basis.direction(window.column(x), window.row(y)));
                    let length = direction.length();
                    let (mut hit, mut margin) = (false, f64::INFINITY);
                    for triangle in &bvh.triangles {
                        let Some((t, inside)) = moller(origin.position, direction, triangle) else {
                            continue;
                        };
                        if t * length > origin.tmin {
                            margin = margin.min(inside.abs());
                            hit |= inside >= 0.0;
                        }
                    }
                    let bit = open[y as usize] >> x & 1 == 1;
                    moved += u32::from((elsewhere[y as usize] >> x & 1 == 1) != bit);
                    if margin < 1e-10 {
                        doubtful += 1;
                        continue;
                    }
                    compared += 1;
                    assert_eq!(bit, !hit, "{origin:?} face {face} texel {x} {y}");
                }
            }
        }
    }
    assert!(doubtful < 20 && compared > 30_000, "{doubtful} {compared}");
    assert!(moved > 300, "{moved}");
}

#[test]
fn alpha_is_asked_where_the_surface_is_hit() {
    let triangle = [
        Vec3::new(-3.0, -3.0, 1.0),
        Vec3::new(3.0, -3.0, 1.0),
        Vec3::new(0.0, 6.0, 1.0),
    ];
    let bvh = Bvh::build(&[Caster {
        vertices: triangle,
        front: None,
        cut: Some(7),
    }]);
    // Only the half nearer to the second vertex is there.
    let half = |id: u32, u: f64, v: f64| {
        assert_eq!(id, 7);
        u > 1.0 - u - v
    };
    let window = Window {
        size: 64,
        x0: 0,
        y0: 0,
    };
    let origin = Origin {
        position: DVec3::ZERO,
        tmin: 1e-6,
        tmax: f64::INFINITY,
    };
    let mut open = full(window);
    run(4, &bvh, &origin, window, &half, &mut open);
    // u > w is x > 0 on this triangle.
    for row in open {
        assert_eq!(row, 0x0000_0000_ffff_ffff);
    }
    for face in [0, 1, 2, 3, 5] {
        let mut open = full(window);
        run(face, &bvh, &origin, window, &half, &mut open);
        let mut expected = one_by_one(face, &bvh, &origin, window, &half);
        assert_eq!(open, expected);
        if face == 5 {
            expected = full(window);
            assert_eq!(open, expected, "nothing is behind");
        }
    }
}

#[test]
fn half_lines_are_exact_and_empty_scenes_are_open() {
    let mut rng = Lcg(9);
    for size in [32, 64, 128, 256] {
        for _ in 0..2000 {
            let window = Window {
                size,
                x0: if size > 64 { 64 } else { 0 },
                y0: 0,
            };
            let last = window.extent() - 1;
            let mut slope = rng.next() * 2.0 - 1.0;
            let mut constant = rng.next() * 2.0 - 1.0;
            match (rng.next() * 8.0) as u32 {
                0 => slope = 0.0,
                1 => slope *= 1e-300,
                2 => constant = 0.0,
                // Through the centre of a texel.
                3 => constant = -slope * window.column(5),
                4 => constant *= 1e300,
                _ => {}
            }
            let x0 = (rng.next() * f64::from(last)) as u32;
            let bits = half_line(slope, constant, window, x0, last);
            for x in 0..=last {
                let inside = x >= x0 && slope * window.column(x) + constant >= 0.0;
                assert_eq!(bits >> x & 1 == 1, inside, "{slope} {constant} {x}");
            }
        }
    }
    let bvh = Bvh::build(&[]);
    let window = Window {
        size: 64,
        x0: 0,
        y0: 0,
    };
    let origin = Origin {
        position: DVec3::ZERO,
        tmin: 0.0,
        tmax: f64::INFINITY,
    };
    let mut open = full(window);
    run(
        0,
        &bvh,
        &origin,
        window,
        &|_: u32, _: f64, _: f64| true,
        &mut open,
    );
    assert_eq!(open, full(window));
}
