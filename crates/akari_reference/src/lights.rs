//! Light arriving at a point: samples of emitters, punctual lights and the environment, with their densities.

use akari_scene::{Environment, PunctualKind};
use glam::{DVec3, Vec2, Vec3};

use crate::environment::EnvironmentSampler;
use crate::light_tree::{LEAF_SIZE, LightTree};
use crate::ray_scene::{Cwbvh, Hit, Ray, RayScene, offset_for};
use crate::spherical;
use crate::world::{Emitter, EmitterSource, World};

/// Below this solid angle a triangle is sampled by area: the spherical construction cancels.
const MIN_SOLID_ANGLE: f64 = 1e-6;
/// Share of an emitter's weight that does not depend on its height over the horizon, so that one with a sliver
/// above it is still found.
const HORIZON_FLOOR: f64 = 0.05;

/// A direction with light from it.
pub(crate) struct LightSample {
    /// Unit, towards the light.
    pub(crate) direction: Vec3,
    /// Where shadow rays end.
    pub(crate) distance: f32,
    /// Radiance, or for punctual lights irradiance on a surface that faces them.
    pub(crate) radiance: Vec3,
    /// Density per solid angle; none for a punctual light, whose choice is already divided out.
    pub(crate) pdf: Option<f32>,
    /// The emitter's own triangle, which must not shadow it.
    pub(crate) triangle: u32,
}

pub(crate) struct Lights<'a> {
    world: &'a World<'a>,
    tree: LightTree,
    /// Over all emitters, for light without occlusion.
    emitters_bvh: Cwbvh,
    /// Over the emitters that are no surface, with their indices.
    unseen_bvh: Cwbvh,
    unseen: Vec<u32>,
    pub(crate) environment: Option<EnvironmentSampler<'a>>,
    punctual: Vec<Punctual>,
}

struct Punctual {
    kind: PunctualKind,
    position: Vec3,
    /// Along which it shines.
    axis: Vec3,
    intensity: Vec3,
    range: Option<f32>,
}

impl Punctual {
    /// Direction to it, distance, and irradiance at a facing surface at `p`. Spot and range falloff as the
    /// specification of `KHR_lights_punctual` recommends.
    fn at(&self, p: Vec3) -> Option<(Vec3, f32, Vec3)> {
        if self.kind == PunctualKind::Directional {
            return Some((-self.axis, f32::INFINITY, self.intensity));
        }
        let to = self.position - p;
        let distance = to.length();
        if !(distance > 0.0) {
            return None;
        }
        let direction = to / distance;
        let mut scale = 1.0 / (distance * distance);
        if let Some(range) = self.range {
            scale *= (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0);
        }
        if let PunctualKind::Spot {
            inner_cone_angle,
            outer_cone_angle,
        } = self.kind
        {
            let (inner, outer) = (inner_cone_angle.cos(), outer_cone_angle.cos());
            let cos = self.axis.dot(-direction);
            let falloff = ((cos - outer) / (inner - outer).max(1e-6)).clamp(0.0, 1.0);
            scale *= falloff * falloff;
        }
        let irradiance = self.intensity * scale;
        (irradiance.max_element() > 0.0 && irradiance.is_finite())
            .then_some((direction, distance, irradiance))
    }
}

/// What an emitter may contribute at a point: solid angle and weight for choosing it.
#[derive(Clone, Copy)]
struct Weighed {
    solid_angle: f64,
    weight: f64,
}

impl Weighed {
    const NONE: Self = Self {
        solid_angle: 0.0,
        weight: 0.0,
    };
}

/// The place on a triangle at barycentric `u`, `v` of a part of it.
fn place(triangle: u32, [a, b, c]: [Vec2; 3], u: f32, v: f32) -> Hit {
    let at = a + (b - a) * u + (c - a) * v;
    Hit {
        t: 0.0,
        triangle,
        u: at.x,
        v: at.y,
    }
}

impl<'a> Lights<'a> {
    pub(crate) fn new(
        world: &'a World<'a>,
        environment: Option<&'a Environment>,
        no_occlusion: bool,
    ) -> Self {
        let unseen: Vec<u32> = (0..world.emitters.len() as u32)
            .filter(|&i| matches!(world.emitters[i as usize].source, EmitterSource::Unseen(_)))
            .collect();
        let triangles = |ids: &[u32]| -> Vec<[Vec3; 3]> {
            ids.iter()
                .map(|&i| world.emitters[i as usize].vertices)
                .collect()
        };
        let all: Vec<u32> = (0..world.emitters.len() as u32).collect();
        let punctual = world
            .scene
            .punctual_lights
            .iter()
            .filter(|l| l.intensity.max_element() > 0.0)
            .map(|l| Punctual {
                kind: l.kind,
                position: (l.world_from_local.translation - world.origin).as_vec3(),
                axis: -l.world_from_local.matrix3.z_axis.as_vec3(),
                intensity: l.intensity,
                range: l.range,
            })
            .collect();
        Self {
            world,
            tree: LightTree::new(&world.emitters),
            emitters_bvh: Cwbvh::build(&triangles(if no_occlusion { &all } else { &[] })),
            unseen_bvh: Cwbvh::build(&triangles(&unseen)),
            unseen,
            environment: environment.and_then(EnvironmentSampler::new),
            punctual,
        }
    }

    /// Whether a ray can run into light.
    pub(crate) fn can_be_hit(&self) -> bool {
        !self.world.emitters.is_empty() || self.environment.is_some()
    }

    fn weigh(&self, emitter: &Emitter, p: DVec3, n: DVec3) -> Weighed {
        let [a, b, c] = emitter.vertices.map(|v| v.as_dvec3() - p);
        let facing = -emitter.normal.as_dvec3().dot(a);
        if facing <= 0.0 && !emitter.double_sided {
            return Weighed::NONE;
        }
        let cosine = |v: DVec3| v.dot(n) / v.length().max(f64::MIN_POSITIVE);
        let cosines = [cosine(a), cosine(b), cosine(c)];
        let highest = cosines.iter().fold(0.0, |m: f64, c| m.max(*c));
        if highest <= 0.0 {
            return Weighed::NONE;
        }
        let mean =
            0.25 * (cosines.iter().map(|c| c.max(0.0)).sum::<f64>() + cosine(a + b + c).max(0.0));
        let solid_angle = spherical::solid_angle(a, b, c);
        Weighed {
            solid_angle,
            weight: f64::from(emitter.strength) * solid_angle * (mean + HORIZON_FLOOR * highest),
        }
    }

    /// Density of `direction` towards an emitter of this solid angle, the emitter being chosen.
    fn density(emitter: &Emitter, weighed: &Weighed, p: DVec3, direction: DVec3) -> f64 {
        if weighed.solid_angle >= MIN_SOLID_ANGLE {
            return 1.0 / weighed.solid_angle;
        }
        let [a, b, c] = emitter.vertices.map(|v| v.as_dvec3() - p);
        let normal = (b - a).cross(c - a);
        let slope = normal.dot(direction);
        if slope == 0.0 {
            return 0.0;
        }
        // distance² / (area · cosine), with area · cosine = |slope| / 2.
        let distance = a.dot(normal) / slope;
        2.0 * distance * distance / slope.abs()
    }

    /// A direction to one of the emitters, in proportion to their unshadowed irradiance at `p` as well as known.
    pub(crate) fn sample_emitter(
        &self,
        p: Vec3,
        n: Vec3,
        u: [f32; 3],
        seed: u32,
    ) -> Option<LightSample> {
        let mut choice = u[0];
        let (leaf, leaf_probability) = self.tree.sample(p, n, &mut choice)?;
        let (p64, n64) = (p.as_dvec3(), n.as_dvec3());
        let emitters = &self.world.emitters;
        let mut candidates = [Weighed::NONE; LEAF_SIZE];
        let mut sum = 0.0;
        for (candidate, &i) in candidates.iter_mut().zip(leaf) {
            *candidate = self.weigh(&emitters[i as usize], p64, n64);
            sum += candidate.weight;
        }
        if !(sum > 0.0) {
            return None;
        }
        let mut rest = f64::from(choice) * sum;
        let last = candidates.iter().rposition(|c| c.weight > 0.0)?;
        let chosen = (0..last)
            .find(|&k| {
                if rest < candidates[k].weight {
                    return true;
                }
                rest -= candidates[k].weight;
                false
            })
            .unwrap_or(last);
        let emitter = &emitters[leaf[chosen] as usize];
        let weighed = candidates[chosen];
        let [a, b, c] = emitter.vertices.map(|v| v.as_dvec3() - p64);
        let (u1, u2) = (f64::from(u[1]), f64::from(u[2]));
        let direction = if weighed.solid_angle >= MIN_SOLID_ANGLE {
            spherical::sample(a.normalize(), b.normalize(), c.normalize(), [u1, u2])?
        } else {
            let root = u1.sqrt();
            (a * (1.0 - root) + b * (root * (1.0 - u2)) + c * (root * u2)).try_normalize()?
        };
        let probability = f64::from(leaf_probability) * weighed.weight / sum;
        let pdf = probability * Self::density(emitter, &weighed, p64, direction);
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let distance = a.dot(normal) / normal.dot(direction);
        if !(pdf > 0.0 && pdf.is_finite() && distance > 0.0 && distance.is_finite()) {
            return None;
        }
        let at = direction * distance - a;
        let scale = 1.0 / normal.length_squared();
        let hit_u = (at.cross(e2).dot(normal) * scale).clamp(0.0, 1.0);
        let hit_v = (e1.cross(at).dot(normal) * scale).clamp(0.0, 1.0 - hit_u);
        let (triangle, radiance) = match emitter.source {
            EmitterSource::Unseen(radiance) => (u32::MAX, radiance),
            EmitterSource::Triangle { triangle, corners } => {
                let hit = place(triangle, corners, hit_u as f32, hit_v as f32);
                if !self.world.covers(&hit, seed) {
                    return None;
                }
                (triangle, self.world.emission(triangle, hit.u, hit.v))
            }
        };
        // The last stretch belongs to the emitter and to what lies in its plane.
        const END: f32 = 1.0 - 1e-5;
        Some(LightSample {
            direction: direction.as_vec3(),
            distance: (distance as f32 * END - offset_for(&emitter.vertices)).max(0.0),
            radiance,
            pdf: Some(pdf as f32),
            triangle,
        })
    }

    /// Density with which [`Self::sample_emitter`] takes `direction` by way of `emitter`.
    pub(crate) fn emitter_pdf(&self, emitter: u32, p: Vec3, n: Vec3, direction: Vec3) -> f32 {
        let Some((leaf, leaf_probability)) = self.tree.leaf(emitter, p, n) else {
            return 0.0;
        };
        let (p, n) = (p.as_dvec3(), n.as_dvec3());
        let emitters = &self.world.emitters;
        let sum: f64 = leaf
            .iter()
            .map(|&i| self.weigh(&emitters[i as usize], p, n).weight)
            .sum();
        let own = self.weigh(&emitters[emitter as usize], p, n);
        if !(own.weight > 0.0) {
            return 0.0;
        }
        let density = Self::density(&emitters[emitter as usize], &own, p, direction.as_dvec3());
        (f64::from(leaf_probability) * own.weight / sum * density) as f32
    }

    /// One punctual light, chosen by its irradiance at `p`.
    pub(crate) fn sample_punctual(&self, p: Vec3, n: Vec3, u: f32) -> Option<LightSample> {
        if self.punctual.is_empty() {
            return None;
        }
        let lit = |light: &Punctual| light.at(p).filter(|(direction, ..)| direction.dot(n) > 0.0);
        let weight = |(direction, _, irradiance): (Vec3, f32, Vec3)| {
            irradiance.element_sum() * direction.dot(n)
        };
        let sum: f32 = self.punctual.iter().filter_map(lit).map(weight).sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let mut rest = u * sum;
        let mut chosen = None;
        for found in self.punctual.iter().filter_map(lit) {
            let w = weight(found);
            chosen = Some((found, w));
            if rest < w {
                break;
            }
            rest -= w;
        }
        let ((direction, distance, irradiance), w) = chosen?;
        (w > 0.0).then(|| LightSample {
            direction,
            distance,
            radiance: irradiance * (sum / w),
            pdf: None,
            triangle: u32::MAX,
        })
    }

    /// A direction of the environment.
    pub(crate) fn sample_environment(&self, u: [f32; 2]) -> Option<LightSample> {
        let environment = self.environment.as_ref()?;
        let (direction, pdf) = environment.sample(u)?;
        Some(LightSample {
            direction,
            distance: f32::INFINITY,
            radiance: environment.radiance(direction),
            pdf: Some(pdf),
            triangle: u32::MAX,
        })
    }

    /// Radiance of an emitter towards the origin of a ray that meets it.
    fn emitter_radiance(&self, emitter: u32, ray: &Ray, u: f32, v: f32, seed: u32) -> Vec3 {
        let e = &self.world.emitters[emitter as usize];
        if e.normal.dot(ray.direction) >= 0.0 && !e.double_sided {
            return Vec3::ZERO;
        }
        match e.source {
            EmitterSource::Unseen(radiance) => radiance,
            EmitterSource::Triangle { triangle, corners } => {
                let hit = place(triangle, corners, u, v);
                if self.world.covers(&hit, seed) {
                    self.world.emission(triangle, hit.u, hit.v)
                } else {
                    Vec3::ZERO
                }
            }
        }
    }

    /// Sums `weight(emitter) × radiance` over all emitters along a ray that are no surface.
    pub(crate) fn unseen_along(&self, ray: &Ray, weight: impl Fn(u32) -> f32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        if self.unseen.is_empty() {
            return sum;
        }
        self.unseen_bvh.for_each_hit(ray, |hit| {
            let emitter = self.unseen[hit.triangle as usize];
            let radiance = self.emitter_radiance(emitter, ray, hit.u, hit.v, 0);
            if radiance != Vec3::ZERO {
                sum += weight(emitter) * radiance;
            }
        });
        sum
    }

    /// Sums `weight(emitter) × radiance` over all emitters along a ray, whatever lies before them.
    pub(crate) fn all_along(&self, ray: &Ray, seed: u32, weight: impl Fn(u32) -> f32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        self.emitters_bvh.for_each_hit(ray, |hit| {
            let radiance = self.emitter_radiance(hit.triangle, ray, hit.u, hit.v, seed);
            if radiance != Vec3::ZERO {
                sum += weight(hit.triangle) * radiance;
            }
        });
        sum
    }
}
