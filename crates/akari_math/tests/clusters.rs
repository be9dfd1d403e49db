//! What `cluster` claims of the rectangles of `cluster_tree`, against the triangles themselves in f64.

use akari_math::cluster::{
    cluster_gloss_error, cluster_ndf_bound, cluster_shape_error, cluster_side,
};
use akari_math::cluster_tree::{ClusterNode, ClusterTree, ClusterTriangle, MIXED};
use akari_math::oracle::{ggx_ndf, unclipped_form_factor};
use glam::{DVec3, Vec3};

/// `SplitMix64` (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn range(&mut self, lo: f32, hi: f32) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        lo + (hi - lo) * (((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32)
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::from_array([0; 3].map(|_| self.range(-1.0, 1.0)));
            if v.length_squared() < 1.0 && v.length_squared() > 0.01 {
                return v.normalize();
            }
        }
    }
}

/// A sheet of `rows`² squares over the unit square whose height is `bend (x² + y²) / 2` with `bumps` on it.
fn sheet(rows: u32, bend: f32, bumps: f32) -> Vec<ClusterTriangle> {
    let at = |i: u32, j: u32| {
        let (x, y) = (i as f32 / rows as f32, j as f32 / rows as f32);
        let bump = bumps * (9.0 * x).sin() * (7.0 * y).cos();
        Vec3::new(x, y, 0.5 * bend * (x * x + y * y) + bump)
    };
    let mut triangles = Vec::new();
    for j in 0..rows {
        for i in 0..rows {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            for corners in [[a, b, c], [a, c, d]] {
                let normal = (corners[1] - corners[0])
                    .cross(corners[2] - corners[0])
                    .normalize();
                triangles.push(ClusterTriangle {
                    corners,
                    normals: [normal; 3],
                    group: 0,
                    alpha: 0.0,
                });
            }
        }
    }
    triangles
}

fn rectangle(node: &ClusterNode) -> [Vec3; 4] {
    let (u, v) = (node.axis_u, node.axis_v);
    let c = node.center;
    [c - u - v, c + u - v, c + u + v, c - u + v]
}

/// π times the vector form factor: the vector irradiance of radiance 1.
fn irradiance(corners: &[Vec3], receiver: Vec3) -> DVec3 {
    let seen: Vec<DVec3> = corners
        .iter()
        .map(|corner| corner.as_dvec3() - receiver.as_dvec3())
        .collect();
    unclipped_form_factor(&seen) * std::f64::consts::PI
}

#[test]
fn a_tree_holds_every_triangle_once_and_flat_sheets_exactly() {
    let mut triangles = sheet(23, 0.0, 0.0);
    for (i, triangle) in triangles.iter_mut().enumerate() {
        triangle.group = u32::from(i % 3 == 0);
    }
    let tree = ClusterTree::new(&triangles);
    let mut order = tree.order.clone();
    order.sort_unstable();
    assert!(
        order
            .iter()
            .enumerate()
            .all(|(i, &index)| i as u32 == index)
    );
    assert_eq!(tree.nodes[0].group, MIXED);
    let leaves: u32 = (tree.nodes.iter().filter(|node| node.leaf))
        .map(|node| node.count)
        .sum();
    assert_eq!(leaves as usize, triangles.len());
    for (index, node) in tree.nodes.iter().enumerate() {
        assert!(node.skip as usize > index && node.skip as usize <= tree.nodes.len());
        if !node.leaf {
            let left = &tree.nodes[index + 1];
            let right = &tree.nodes[left.skip as usize];
            assert_eq!((right.skip, left.depth), (node.skip, node.depth + 1));
            assert_eq!(left.count + right.count, node.count);
        }
    }
    let levels = tree.levels();
    assert_eq!(levels.iter().map(Vec::len).sum::<usize>(), tree.nodes.len());
    assert_eq!(levels.last(), Some(&vec![0]));
    // One rectangle is the sheet, and so are most of the nodes below it.
    let tree = ClusterTree::new(&sheet(23, 0.0, 0.0));
    assert!(tree.nodes[0].mismatch < 1e-4, "{:?}", tree.nodes[0]);
    assert!((tree.nodes[0].area - 1.0).abs() < 1e-4);
    let exact = tree
        .nodes
        .iter()
        .filter(|node| node.mismatch < 1e-3)
        .count();
    assert!(
        2 * exact > tree.nodes.len(),
        "{exact} of {}",
        tree.nodes.len()
    );
    assert_eq!(ClusterTree::new(&[]).nodes.len(), 0);
    // Bad triangles do no harm.
    let bad = [f32::NAN, f32::INFINITY, 0.0].map(|value| ClusterTriangle {
        corners: [Vec3::splat(value); 3],
        ..ClusterTriangle::default()
    });
    let tree = ClusterTree::new(&bad.repeat(9));
    assert_eq!(tree.order.len(), 27);
}

#[test]
fn rectangles_are_as_near_to_their_triangles_as_claimed() {
    let mut random = Random(7);
    let (mut tried, mut nearest, mut wrong) = (0, 0.0_f64, 0);
    for (bend, bumps) in [
        (0.0, 0.0),
        (0.2, 0.0),
        (1.0, 0.0),
        (-0.6, 0.0),
        (0.1, 0.01),
        (0.0, 0.03),
    ] {
        let triangles = sheet(12, bend, bumps);
        let tree = ClusterTree::new(&triangles);
        for node in &tree.nodes {
            for _ in 0..6 {
                let direction = (node.normal + 0.9 * random.direction()).normalize();
                let receiver = node.center + direction * (node.radius * random.range(1.2, 12.0));
                let offset = node.center - receiver;
                let height = -node.normal.dot(offset);
                let farthest = offset.length() + node.radius;
                if cluster_side(height, node.deviation, farthest, node.turn) < 1.0 {
                    continue;
                }
                let below = &tree.order[node.first as usize..][..node.count as usize];
                let mut truth = DVec3::ZERO;
                for &index in below {
                    let corners = triangles[index as usize].corners;
                    assert!(
                        (corners[1] - corners[0])
                            .cross(corners[2] - corners[0])
                            .dot(receiver - corners[0])
                            > 0.0,
                        "said to be in front of all"
                    );
                    truth += irradiance(&corners, receiver);
                }
                let ours = irradiance(&rectangle(node), receiver);
                let clearance = height - node.deviation;
                let nearest_distance = (offset.length() - node.radius).max(clearance);
                let lateral = (offset + node.normal * height).length() + node.radius;
                let claimed = |mismatch, rim| {
                    f64::from(cluster_shape_error(
                        mismatch,
                        rim,
                        lateral,
                        clearance,
                        offset.length() / nearest_distance,
                    ))
                };
                let bound = claimed(node.mismatch, node.rim);
                let error = (ours - truth).length() / truth.length();
                // Rounding of corners in f32.
                let rounding = 1e-5;
                tried += 1;
                assert!(
                    error <= bound + rounding,
                    "{error} > {bound}: {node:?} from {receiver}"
                );
                if bound > 1e-3 {
                    nearest = nearest.max(error / bound);
                }
                // Without the height of the rim it would not hold.
                if error > claimed(node.mismatch, 0.0) + rounding {
                    wrong += 1;
                }
            }
        }
    }
    println!("{tried} views of clusters: the largest error is {nearest:.2} of what is claimed");
    assert!(tried > 2000);
    assert!(nearest > 0.05, "a bound that is never near says nothing");
    assert!(wrong > 10, "{wrong}");
}

#[test]
fn what_turns_a_normal_changes_its_gloss_no_more_than_claimed() {
    let mut random = Random(11);
    let (mut nearest, mut wrong) = (0.0_f64, 0);
    for _ in 0..20_000 {
        let alpha = 10.0_f32.powf(random.range(-2.0, 0.0));
        let normal = random.direction();
        let half_vector =
            (normal + alpha * random.range(0.0, 3.0) * random.direction()).normalize();
        let other = (normal + alpha * random.range(0.0, 0.5) * random.direction()).normalize();
        // Nothing is reflected behind a surface, where the formula goes on.
        if normal.dot(half_vector).min(other.dot(half_vector)) <= 0.0 {
            continue;
        }
        let turn = other.distance(normal);
        let ndf = |n: Vec3| {
            ggx_ndf(
                n.as_dvec3().normalize(),
                half_vector.as_dvec3().normalize(),
                alpha.into(),
            )
        };
        let error = (ndf(other) / ndf(normal) - 1.0).abs();
        let bound = f64::from(cluster_gloss_error(0.0, turn, 0.0, alpha));
        assert!(
            error <= bound * 1.01 + 1e-4,
            "{error} > {bound}, alpha {alpha}, turn {turn}, angle {}",
            normal.angle_between(half_vector)
        );
        nearest = nearest.max(error / (bound + 1e-4));
        if error > f64::from(cluster_gloss_error(0.0, 0.5 * turn, 0.0, alpha)) + 1e-3 {
            wrong += 1;
        }
        let chord = normal.distance(half_vector);
        let most = f64::from(cluster_ndf_bound(chord, turn, alpha));
        assert!(ndf(other) <= most * 1.001 + 1e-4, "{} > {most}", ndf(other));
    }
    assert!(nearest > 0.5, "{nearest}");
    assert!(wrong > 100, "half of the turn would do");
}

/// What turns linearly from one side of a rectangle to the other is between both sides as its logarithm's chord says.
#[test]
fn what_bends_shines_between_its_sides_as_claimed() {
    const STEPS: u32 = 64;
    let mut random = Random(23);
    let (mut nearest, mut wrong) = (0.0_f64, 0);
    for _ in 0..4000 {
        let alpha = f64::from(10.0_f32.powf(random.range(-2.0, 0.0)));
        let turn = alpha * f64::from(random.range(0.05, 0.6));
        let middle = alpha * f64::from(random.range(-2.0, 2.0));
        if middle.abs() + turn > 1.4 {
            continue;
        }
        let (normal, tangent) = (DVec3::Z, DVec3::X);
        let log_ndf = |angle: f64| {
            let half_vector = normal * angle.cos() + tangent * angle.sin();
            ggx_ndf(normal, half_vector, alpha).ln()
        };
        let (first, last) = (log_ndf(middle - turn), log_ndf(middle + turn));
        let (mut truth, mut ours) = (0.0, 0.0);
        for i in 0..STEPS {
            let t = (f64::from(i) + 0.5) / f64::from(STEPS);
            truth += log_ndf(middle + turn * (2.0 * t - 1.0)).exp();
            ours += (first + t * (last - first)).exp();
        }
        let error = (ours / truth - 1.0).abs();
        let claimed = |share: f64| {
            f64::from(cluster_gloss_error(
                (share * turn) as f32,
                0.0,
                0.0,
                alpha as f32,
            ))
        };
        assert!(
            error <= claimed(1.0) + 1e-4,
            "{error}, alpha {alpha}, turn {turn}"
        );
        nearest = nearest.max(error / (claimed(1.0) + 1e-4));
        wrong += u32::from(error > claimed(0.5) + 1e-3);
    }
    println!("bent: the largest error is {nearest:.2} of what is claimed");
    assert!(nearest > 0.3 && wrong > 10, "{nearest}, {wrong}");
}

/// Triangles of a mirror that bends one way are clustered in strips along the other.
#[test]
fn bent_mirrors_are_clustered_along_what_does_not_turn() {
    const ROWS: u32 = 32;
    let at = |i: u32, j: u32| {
        let x = 2.0 * i as f32 / ROWS as f32 - 1.0;
        let y = 2.0 * j as f32 / ROWS as f32;
        let point = Vec3::new(x, y, 0.35 * x * x);
        (point, Vec3::new(-0.7 * x, 0.0, 1.0).normalize())
    };
    let mirror = |alpha: f32| -> Vec<ClusterTriangle> {
        let mut triangles = Vec::new();
        for j in 0..ROWS {
            for i in 0..ROWS {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                for three in [[a, b, c], [a, c, d]] {
                    triangles.push(ClusterTriangle {
                        corners: three.map(|(corner, _)| corner),
                        normals: three.map(|(_, normal)| normal),
                        group: 0,
                        alpha,
                    });
                }
            }
        }
        triangles
    };
    let cut = 0.2;
    // Clusters that are met from above.
    let met = |triangles: &[ClusterTriangle], width: f32, linear: bool| {
        let tree = ClusterTree::new(triangles);
        let (mut index, mut count) = (0, 0);
        while index < tree.nodes.len() {
            let node = &tree.nodes[index];
            let (turn, stray) = if linear {
                (node.turn, node.stray)
            } else {
                (0.0, node.turn)
            };
            let taken = cluster_gloss_error(turn, stray, 0.0, width) <= cut;
            count += if taken {
                1
            } else if node.leaf {
                node.count
            } else {
                0
            };
            index = if taken { node.skip as usize } else { index + 1 };
        }
        count
    };
    let alpha = 0.09;
    let (strips, squares) = (mirror(alpha), mirror(0.0));
    let ours = met(&strips, alpha, true);
    let (flat, square) = (met(&strips, alpha, false), met(&squares, alpha, true));
    println!(
        "{} triangles: {ours} strips; {square} without their width, {flat} if flat",
        strips.len()
    );
    assert!(ours <= 2 * ROWS, "{ours}");
    assert!(square > 4 * ours && flat > 4 * ours, "{square}, {flat}");
    // The linear change is the mirror's: in a strip nothing strays from it by what its normals turn.
    let tree = ClusterTree::new(&strips);
    let strip = (tree.nodes.iter())
        .find(|node| node.turn < 0.05)
        .expect("strips");
    assert!(strip.stray < 0.05 * strip.turn, "{strip:?}");
    for side in [-1.0, 1.0] {
        let along = if strip.bend_u.length() > strip.bend_v.length() {
            (strip.axis_u, strip.bend_u)
        } else {
            (strip.axis_v, strip.bend_v)
        };
        let x = (strip.center + side * along.0).x;
        let normal = (strip.normal + side * along.1).normalize();
        let truth = Vec3::new(-0.7 * x, 0.0, 1.0).normalize();
        assert!(
            normal.distance(truth) < 0.1 * strip.turn,
            "{normal} of {truth}"
        );
    }
}
