//! Where bodies may throw shadows on diffuse reflectors: patches are finer there.
//!
//! Light of a patch is known at its corners, so that a patch as large as a body that stands before it does not have its
//! shadow. Whether there is one is asked of boxes: the body's against that about the patch and a light (the shaft of Haines and
//! Wallace 1991, "Shaft Culling for Efficient Ray-Traced Radiosity", without its slanted sides), so that a light that moves
//! leaves most patches as they are.

use crate::lights::PunctualLight;
use crate::types::GpuTriangle;
use akari_render::area_lights::AreaLightPolygon;
use bevy::prelude::*;

/// Longest edge of a patch in the shadow of a body, over the body's largest extent and
/// [`patch`](crate::settings::Interreflection::patch).
const DETAIL: f32 = 0.4;
/// Most bodies that are looked at for one triangle: the largest, which hide most.
const MOST_SHADOWS: usize = 64;
/// Length, in metres, of the way to a light that is infinitely far away.
const FAR: f32 = 1e5;
/// What touches a body by less, over its extent, is beside it.
const TOUCH: f32 = 1e-4;

/// A body that throws shadows, as a box in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowBox {
    owner: Entity,
    low: Vec3,
    high: Vec3,
}

/// Where a light is, as a box in the world: from the end of a direction if it is infinitely far away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightBox {
    /// Least and largest coordinates.
    At(Vec3, Vec3),
    /// Way to it.
    Along(Vec3),
}

impl LightBox {
    /// Of the sky.
    pub const AROUND: Self = Self::At(Vec3::splat(-FAR), Vec3::splat(FAR));

    /// Of all lights.
    pub fn of(lights: &[PunctualLight], polygons: &[AreaLightPolygon]) -> Vec<Self> {
        let punctual = lights.iter().map(|light| match *light {
            PunctualLight::Directional { to_light, .. } => Self::Along(to_light * FAR),
            PunctualLight::Point { position, .. } => Self::At(position, position),
        });
        let polygons = polygons.iter().map(|polygon| {
            let (low, high) = bounds(&polygon.corners);
            Self::At(low, high)
        });
        punctual.chain(polygons).collect()
    }
}

fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    points
        .iter()
        .fold((Vec3::MAX, Vec3::MIN), |(low, high), p| {
            (low.min(*p), high.max(*p))
        })
}

impl ShadowBox {
    /// Of an entity of the main world.
    pub fn new(owner: Entity, low: Vec3, high: Vec3) -> Self {
        Self { owner, low, high }
    }

    fn size(&self) -> f32 {
        (self.high - self.low).max_element()
    }

    /// Whether it may hide a light from a triangle that is no farther from it than it is large: beyond that its shadow is
    /// wider than its details.
    fn falls_on(&self, triangle: &GpuTriangle, lights: &[LightBox]) -> bool {
        let (low, high) = bounds(&[triangle.a, triangle.b, triangle.c]);
        let size = self.size();
        let gap = (self.low - high).max(low - self.high).max(Vec3::ZERO);
        let touch = Vec3::splat(TOUCH * size);
        gap.length() < size
            && lights.iter().any(|light| {
                let (from, to) = match *light {
                    LightBox::At(from, to) => (low.min(from), high.max(to)),
                    LightBox::Along(way) => (low.min(low + way), high.max(high + way)),
                };
                from.cmplt(self.high - touch).all() && to.cmpgt(self.low + touch).all()
            })
    }

    /// Those whose shadow may fall on a triangle of `owner`, other than its own.
    pub fn over(
        all: &[Self],
        triangle: &GpuTriangle,
        owner: Option<&Entity>,
        lights: &[LightBox],
    ) -> Vec<Self> {
        let mut over: Vec<Self> = (all.iter())
            .filter(|shadow| Some(&shadow.owner) != owner && shadow.falls_on(triangle, lights))
            .copied()
            .collect();
        if over.len() > MOST_SHADOWS {
            over.sort_by(|a, b| b.size().total_cmp(&a.size()));
            over.truncate(MOST_SHADOWS);
        }
        over
    }

    /// Whether a part of such a triangle shows its shadow, or has none.
    pub fn is_fine(
        &self,
        triangle: &GpuTriangle,
        longest: f32,
        share: f32,
        lights: &[LightBox],
    ) -> bool {
        longest <= DETAIL * share * self.size() || !self.falls_on(triangle, lights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn floor(at: Vec3) -> GpuTriangle {
        GpuTriangle {
            a: at,
            b: at + 0.1 * Vec3::Z,
            c: at + 0.1 * Vec3::X,
            ..GpuTriangle::default()
        }
    }

    #[test]
    fn shadows_fall_behind_bodies() {
        let body = ShadowBox::new(Entity::PLACEHOLDER, Vec3::ZERO, Vec3::new(0.5, 0.5, 0.5));
        let lamp = [LightBox::At(
            Vec3::new(3.0, 2.0, 0.2),
            Vec3::new(3.2, 2.0, 0.4),
        )];
        assert!(body.falls_on(&floor(Vec3::new(-0.3, 0.0, 0.2)), &lamp));
        assert!(
            !body.falls_on(&floor(Vec3::new(0.7, 0.0, 0.2)), &lamp),
            "before it"
        );
        assert!(
            !body.falls_on(&floor(Vec3::new(-1.0, 0.0, 0.2)), &lamp),
            "far from it"
        );
        let sun = [LightBox::Along(Vec3::new(-1.0, 1.0, 0.0) * FAR)];
        assert!(body.falls_on(&floor(Vec3::new(0.7, 0.0, 0.2)), &sun));
        assert!(!body.falls_on(&floor(Vec3::new(-0.3, 0.0, 0.2)), &sun));
        // What stands on a floor is in no shadow of the floor.
        let ground = ShadowBox::new(
            Entity::PLACEHOLDER,
            Vec3::new(-2.0, 0.0, -2.0),
            Vec3::new(2.0, 0.0, 2.0),
        );
        assert!(!ground.falls_on(&floor(Vec3::ZERO), &lamp));
        // Its own body is left out.
        let triangle = floor(Vec3::new(-0.3, 0.0, 0.2));
        let over = |owner| ShadowBox::over(&[body], &triangle, owner, &lamp).len();
        assert_eq!((over(None), over(Some(&Entity::PLACEHOLDER))), (1, 0));
        assert!(!body.is_fine(&triangle, 0.141, 0.5, &lamp));
        assert!(body.is_fine(&triangle, 0.141, 0.8, &lamp));
    }
}
