//! One path.

use glam::Vec3;

use crate::lights::{LightSample, Lights};
use crate::ray_scene::{Hit, Ray};
use crate::sampler::{Sampler, Use};
use crate::surface::Surface;
use crate::world::World;

/// From this path length on, paths end by chance (Russian roulette).
const ROULETTE_DEPTH: u32 = 4;
/// Highest chance to go on.
const ROULETTE_MAX: f32 = 0.95;

/// What a path needs to know.
pub(crate) struct Integrator<'a> {
    pub(crate) world: &'a World<'a>,
    pub(crate) lights: &'a Lights<'a>,
    /// Longest path in segments.
    pub(crate) max_depth: u32,
    pub(crate) no_occlusion: bool,
}

/// The last surface, for the density of next-event estimation.
struct Previous {
    position: Vec3,
    normal: Vec3,
    pdf: f32,
}

/// Veach's power heuristic with exponent 2: the weight of a sample of density `a` where another technique has `b`.
fn power_heuristic(a: f32, b: f32) -> f32 {
    // Scaled, so that squares neither overflow nor vanish.
    let r = b / a;
    1.0 / (1.0 + r * r)
}

impl Integrator<'_> {
    /// Radiance against the direction of a camera ray that first meets `hit`. Counts rays in `rays`.
    pub(crate) fn radiance(
        &self,
        mut ray: Ray,
        mut hit: Option<Hit>,
        sampler: &Sampler,
        rays: &mut u64,
    ) -> Vec3 {
        let mut radiance = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        let mut previous: Option<Previous> = None;
        for depth in 1..=self.max_depth {
            let Some(found) = hit else {
                radiance += throughput * self.background(&ray, previous.as_ref());
                break;
            };
            radiance += throughput * self.emitted(&ray, &found, previous.as_ref());
            if depth == self.max_depth {
                break;
            }
            let surface = Surface::new(self.world, &ray, &found);
            if surface.unlit {
                if depth == 1 {
                    radiance += surface.albedo;
                }
                break;
            }
            radiance += throughput * self.direct(&surface, sampler, depth, rays);

            // The last segment can only end on a light.
            if depth + 1 == self.max_depth && !self.lights.can_be_hit() {
                break;
            }
            let [lobe, u1, u2, roulette] = sampler.get(depth, Use::Bsdf);
            let Some(sample) = surface.bsdf.sample(surface.view, [lobe, u1, u2]) else {
                break;
            };
            let direction = surface.to_world(sample.direction).normalize();
            throughput *= sample.weight;
            let origin = Previous {
                position: surface.position,
                normal: surface.normal,
                pdf: sample.pdf,
            };
            if self.no_occlusion {
                let free = Ray {
                    origin: surface.position,
                    direction,
                    tmin: surface.offset,
                    tmax: f32::INFINITY,
                };
                let seed = sampler.noise(depth);
                let emitters = self.lights.all_along(&free, seed, |emitter| {
                    self.emitter_weight(emitter, &origin, direction)
                });
                *rays += 1;
                radiance += throughput * (emitters + self.background(&free, Some(&origin)));
                break;
            }
            // Below the real surface, only the interpolated normal thinks that there is light.
            if direction.dot(surface.geometric_normal) <= 0.0 {
                break;
            }
            if depth >= ROULETTE_DEPTH {
                let go_on = throughput.max_element().min(ROULETTE_MAX);
                if roulette >= go_on {
                    break;
                }
                throughput /= go_on;
            }
            ray = surface.leave(direction, f32::INFINITY);
            *rays += 1;
            hit = self.world.closest(&ray, sampler.noise(depth));
            let reach = Ray {
                tmax: hit.map_or(f32::INFINITY, |h| h.t),
                ..ray
            };
            radiance += throughput
                * self.lights.unseen_along(&reach, |emitter| {
                    self.emitter_weight(emitter, &origin, direction)
                });
            previous = Some(origin);
        }
        radiance
    }

    fn emitter_weight(&self, emitter: u32, from: &Previous, direction: Vec3) -> f32 {
        let light_pdf = self
            .lights
            .emitter_pdf(emitter, from.position, from.normal, direction);
        power_heuristic(from.pdf, light_pdf)
    }

    /// Radiance of the environment, weighted if a surface sampled it.
    fn background(&self, ray: &Ray, previous: Option<&Previous>) -> Vec3 {
        let Some(environment) = &self.lights.environment else {
            return Vec3::ZERO;
        };
        let weight = previous.map_or(1.0, |p| {
            power_heuristic(p.pdf, environment.pdf(ray.direction))
        });
        weight * environment.radiance(ray.direction)
    }

    /// Radiance that a surface in sight shows by itself: its emission, or its colour if it is unlit.
    pub(crate) fn shown(&self, ray: &Ray, hit: &Hit, surface: &Surface) -> Vec3 {
        let emitted = self.emitted(ray, hit, None);
        if surface.unlit && self.max_depth > 1 {
            emitted + surface.albedo
        } else {
            emitted
        }
    }

    /// Radiance that the surface met emits against the ray, weighted if a surface sampled it.
    fn emitted(&self, ray: &Ray, hit: &Hit, previous: Option<&Previous>) -> Vec3 {
        let Some(emitter) = self.world.emitter_at(hit.triangle, hit.u, hit.v) else {
            return Vec3::ZERO;
        };
        let e = &self.world.emitters[emitter as usize];
        if e.normal.dot(ray.direction) >= 0.0 && !e.double_sided {
            return Vec3::ZERO;
        }
        let weight = previous.map_or(1.0, |p| self.emitter_weight(emitter, p, ray.direction));
        weight * self.world.emission(hit.triangle, hit.u, hit.v)
    }

    /// Next-event estimation: light from emitters, punctual lights and environment, reflected once.
    fn direct(&self, surface: &Surface, sampler: &Sampler, depth: u32, rays: &mut u64) -> Vec3 {
        let (p, n) = (surface.position, surface.normal);
        let mut sum = Vec3::ZERO;
        let seed = sampler.noise(depth);
        if !self.world.emitters.is_empty() {
            let u = sampler.get(depth, Use::Light);
            let light = self.lights.sample_emitter(p, n, [u[0], u[1], u[2]], seed);
            sum += self.contribution(surface, light, seed, rays);
        }
        if self.lights.environment.is_some() || !self.world.scene.punctual_lights.is_empty() {
            let u = sampler.get(depth, Use::Environment);
            let light = self.lights.sample_environment([u[0], u[1]]);
            sum += self.contribution(surface, light, seed, rays);
            let light = self.lights.sample_punctual(p, n, u[2]);
            sum += self.contribution(surface, light, seed, rays);
        }
        sum
    }

    fn contribution(
        &self,
        surface: &Surface,
        light: Option<LightSample>,
        seed: u32,
        rays: &mut u64,
    ) -> Vec3 {
        let Some(light) = light else {
            return Vec3::ZERO;
        };
        let (f, bsdf_pdf) = surface
            .bsdf
            .eval(surface.view, surface.to_local(light.direction));
        if f == Vec3::ZERO || light.radiance == Vec3::ZERO {
            return Vec3::ZERO;
        }
        if !self.no_occlusion {
            if light.direction.dot(surface.geometric_normal) <= 0.0 {
                return Vec3::ZERO;
            }
            let ray = surface.leave(light.direction, light.distance);
            *rays += 1;
            if self.world.occluded(&ray, seed, light.triangle) {
                return Vec3::ZERO;
            }
        }
        match light.pdf {
            None => f * light.radiance,
            Some(pdf) => f * light.radiance * (power_heuristic(pdf, bsdf_pdf) / pdf),
        }
    }
}
