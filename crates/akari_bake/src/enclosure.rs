//! Triangles that have the whole scene in front of them.

use akari_visibility::identity::EnclosureSettings;
use glam::{DVec3, Vec3};

use crate::bvh::Caster;

/// How far a point may lie behind a triangle's plane and still count as in front of it, as a share of the scene's
/// diagonal: corners of rooms are not modelled to the last bit.
const TOLERANCE: f64 = 1e-5;

/// Directions in which the farthest points are known: the 26 neighbours of a cell.
const DIRECTIONS: usize = 26;

/// Points in groups with bounds, to find one that lies behind a plane.
pub(crate) struct Enclosure {
    points: Vec<Vec3>,
    /// Bounds of each group of points.
    groups: Vec<(Vec3, Vec3)>,
    /// Farthest points in some directions.
    extremes: Vec<Vec3>,
    tolerance: f64,
}

const GROUP: usize = 256;

impl Enclosure {
    /// The scene's points: those of the casters, and others.
    pub(crate) fn new(
        casters: &[Caster],
        others: impl Iterator<Item = Vec3>,
        diagonal: f64,
    ) -> Self {
        let mut points: Vec<Vec3> = casters
            .iter()
            .flat_map(|c| c.vertices)
            .chain(others)
            .collect();
        points.sort_unstable_by_key(|p| p.to_array().map(f32::to_bits));
        points.dedup();
        let mut extremes = Vec::with_capacity(DIRECTIONS);
        for i in 0..27_usize {
            let direction = Vec3::new(
                (i % 3) as f32 - 1.0,
                (i / 3 % 3) as f32 - 1.0,
                (i / 9) as f32 - 1.0,
            );
            let farthest = points
                .iter()
                .copied()
                .max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)));
            extremes.extend(farthest);
        }
        // Points along a curve through space are near to each other in the list.
        points.sort_unstable_by_key(|p| crate::morton::key(*p, &extremes));
        let groups = points
            .chunks(GROUP)
            .map(|chunk| {
                chunk
                    .iter()
                    .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), &p| {
                        (min.min(p), max.max(p))
                    })
            })
            .collect();
        Self {
            points,
            groups,
            extremes,
            tolerance: TOLERANCE * diagonal,
        }
    }

    /// Whether a point lies behind the plane through `at`.
    fn has_point_behind(&self, normal: DVec3, at: DVec3) -> bool {
        let limit = normal.dot(at) - self.tolerance;
        let behind = |p: &Vec3| normal.dot(p.as_dvec3()) < limit;
        if self.extremes.iter().any(behind) {
            return true;
        }
        self.groups
            .iter()
            .zip(self.points.chunks(GROUP))
            .any(|(&(min, max), points)| {
                // The corner of the bounds that is farthest back.
                let corner = Vec3::select(normal.cmpgt(DVec3::ZERO), min, max);
                behind(&corner) && points.iter().any(behind)
            })
    }

    /// Takes the enclosing triangles out, and tells which these were.
    pub(crate) fn remove(&self, casters: &mut Vec<Caster>) -> EnclosureSettings {
        let mut enclosure = EnclosureSettings::default();
        let mut hasher = blake3::Hasher::new();
        let mut index = 0_u32;
        casters.retain(|c| {
            let front = c.front;
            let [a, b, c] = c.vertices.map(|v| v.as_dvec3());
            let stays = match front {
                Some(front) => self.has_point_behind(front, a),
                // Both sides are fronts, as exporters say of any wall: the side that the scene is on counts.
                None => match (b - a).cross(c - a).try_normalize() {
                    Some(normal) => {
                        self.has_point_behind(normal, a) && self.has_point_behind(-normal, a)
                    }
                    None => true,
                },
            };
            if !stays {
                enclosure.triangles += 1;
                hasher.update(&index.to_le_bytes());
            }
            index += 1;
            stays
        });
        if enclosure.triangles > 0 {
            let hash = hasher.finalize();
            let (word, _) = hash
                .as_bytes()
                .split_first_chunk()
                .unwrap_or((&[0; 8], &[]));
            enclosure.digest = u64::from_le_bytes(*word);
        }
        enclosure
    }
}
