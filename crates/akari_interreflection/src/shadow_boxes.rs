//! Where bodies may throw shadows on diffuse reflectors: patches are finer there.
//!
//! Light of a patch is known at its corners, so that a patch as large as a body that stands before it does not have its
//! shadow. Whether there is one is asked of boxes: the body's against that about the patch and a light (the shaft of Haines and
//! Wallace 1991, "Shaft Culling for Efficient Ray-Traced Radiosity", without its slanted sides), so that a light that moves
//! leaves most patches as they are.
//!
//! Near a body its shadow is as sharp as the way to it is short, so that the parts of the body count, too, down to a share of
//! it: those of the tree that rays walk, and below its leaves pieces of triangles.

use crate::blockers::{BlockerMesh, Visit};
use crate::types::GpuTriangle;
use akari_render::area_lights::AreaLightPolygon;
use akari_render::scene_lights::PunctualLight;
use bevy::prelude::*;
use std::sync::Arc;

/// Longest edge of a patch in the shadow of a body, over the body's largest extent and
/// [`patch`](crate::settings::Interreflection::patch).
const DETAIL: f32 = 0.4;
/// The same in the shadow of one of its parts, over the part's largest extent.
const DETAIL_OF_PART: f32 = 0.8;
/// The smallest part that counts, over the body's largest extent.
pub const SMALLEST_PART: f32 = 0.125;
/// Most bodies that are looked at for one triangle: the largest, which hide most.
const MOST_SHADOWS: usize = 64;
/// Length, in metres, of the way to a light that is infinitely far away.
const FAR: f32 = 1e5;
/// What touches a body by less, over its extent, is beside it.
const TOUCH: f32 = 1e-4;

/// A body that throws shadows, in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct ShadowBox {
    owner: Entity,
    around: Bounds,
    parts: Arc<BlockerMesh>,
}

/// Least and largest coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

/// How fine patches are to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fineness {
    /// Longest edge over the distance from a light.
    pub share: f32,
    /// The smallest part of a body whose shadow is looked for, over the body; from 1 on bodies count as wholes.
    pub smallest_part: f32,
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
            let Bounds { low, high } = Bounds::of(&polygon.corners);
            Self::At(low, high)
        });
        punctual.chain(polygons).collect()
    }
}

impl Bounds {
    fn of(points: &[Vec3]) -> Self {
        let none = Self {
            low: Vec3::MAX,
            high: Vec3::MIN,
        };
        points.iter().fold(none, |bounds, p| Self {
            low: bounds.low.min(*p),
            high: bounds.high.max(*p),
        })
    }

    fn size(&self) -> f32 {
        (self.high - self.low).max_element()
    }

    /// Whether what is in it may hide a light from a triangle within `other` that is nearer to it than `reach`, metres.
    fn shadows<'a>(
        &self,
        other: &Self,
        reach: f32,
        mut lights: impl Iterator<Item = &'a LightBox>,
    ) -> bool {
        let Self { low, high } = *other;
        let gap = (self.low - high).max(low - self.high).max(Vec3::ZERO);
        let touch = Vec3::splat(TOUCH * reach);
        gap.length() < reach
            && lights.any(|light| {
                let (from, to) = match *light {
                    LightBox::At(from, to) => (low.min(from), high.max(to)),
                    LightBox::Along(way) => (low.min(low + way), high.max(high + way)),
                };
                from.cmplt(self.high - touch).all() && to.cmpgt(self.low + touch).all()
            })
    }
}

/// A patch, and how small a part has to be for its shadow to show on it.
struct Asked<'a> {
    patch: Bounds,
    longest: f32,
    share: f32,
    smallest: f32,
    lights: &'a [LightBox],
}

/// What a patch is beside a part of a body.
enum Beside {
    /// Out of its shadow.
    Nothing,
    /// Fine enough for it as a whole.
    Fine,
    /// Fine enough, and it has no parts that count.
    Finest,
    /// Too large.
    Coarse,
}

impl Asked<'_> {
    fn beside(&self, part: &Bounds) -> Beside {
        let size = part.size().max(self.smallest);
        // Of a light from all around there are no sharp shadows.
        let from = self.lights.iter().filter(|at| **at != LightBox::AROUND);
        if !part.shadows(&self.patch, size, from) {
            Beside::Nothing
        } else if self.longest > DETAIL_OF_PART * self.share * size {
            Beside::Coarse
        } else if size > self.smallest {
            Beside::Fine
        } else {
            Beside::Finest
        }
    }

    /// Whether the patch is fine enough for all pieces of a triangle, cut as patches are.
    fn is_fine_for(&self, [a, b, c]: [Vec3; 3]) -> bool {
        match self.beside(&Bounds::of(&[a, b, c])) {
            Beside::Nothing | Beside::Finest => true,
            Beside::Coarse => false,
            Beside::Fine => {
                let edges = [a.distance(b), b.distance(c), c.distance(a)];
                let [p, q, r] = if edges[0] >= edges[1] && edges[0] >= edges[2] {
                    [a, b, c]
                } else if edges[1] >= edges[2] {
                    [b, c, a]
                } else {
                    [c, a, b]
                };
                let middle = 0.5 * (p + q);
                self.is_fine_for([p, middle, r]) && self.is_fine_for([middle, q, r])
            }
        }
    }
}

impl ShadowBox {
    /// Of an entity of the main world, if it has any triangles.
    pub fn new(owner: Entity, parts: Arc<BlockerMesh>) -> Option<Self> {
        let (low, high) = parts.bounds()?;
        Some(Self {
            owner,
            around: Bounds { low, high },
            parts,
        })
    }

    /// Whether it may hide a light from a triangle that is no farther from it than it is large: beyond that its shadow is
    /// wider than its details.
    fn falls_on(&self, triangle: &GpuTriangle, lights: &[LightBox]) -> bool {
        let triangle = Bounds::of(&[triangle.a, triangle.b, triangle.c]);
        (self.around).shadows(&triangle, self.around.size(), lights.iter())
    }

    /// Those whose shadow may fall on a triangle of `owner`, other than its own.
    pub fn over<'a>(
        all: &'a [Self],
        triangle: &GpuTriangle,
        owner: Option<&Entity>,
        lights: &[LightBox],
    ) -> Vec<&'a Self> {
        let mut over: Vec<&Self> = (all.iter())
            .filter(|shadow| Some(&shadow.owner) != owner && shadow.falls_on(triangle, lights))
            .collect();
        if over.len() > MOST_SHADOWS {
            over.sort_by(|a, b| b.around.size().total_cmp(&a.around.size()));
            over.truncate(MOST_SHADOWS);
        }
        over
    }

    /// Whether a part of such a triangle shows its shadow, or has none.
    pub fn is_fine(
        &self,
        triangle: &GpuTriangle,
        longest: f32,
        fineness: Fineness,
        lights: &[LightBox],
    ) -> bool {
        if !self.falls_on(triangle, lights) {
            return true;
        }
        let size = self.around.size();
        if longest > DETAIL * fineness.share * size {
            return false;
        }
        if fineness.smallest_part >= 1.0 {
            return true;
        }
        let asked = Asked {
            patch: Bounds::of(&[triangle.a, triangle.b, triangle.c]),
            longest,
            share: fineness.share,
            smallest: fineness.smallest_part * size,
            lights,
        };
        self.parts.visit(
            |low, high| match asked.beside(&Bounds { low, high }) {
                Beside::Nothing | Beside::Finest => Visit::Pass,
                Beside::Fine => Visit::Enter,
                Beside::Coarse => Visit::End,
            },
            |corners| asked.is_fine_for(corners),
        )
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

    /// A body of twelve triangles.
    fn block(low: Vec3, high: Vec3) -> ShadowBox {
        let corner = |i: usize| {
            let far = |axis: usize| f32::from(u8::from(i >> axis & 1 == 1));
            low + (high - low) * Vec3::new(far(0), far(1), far(2))
        };
        let faces = [
            [0, 1, 3, 2],
            [4, 6, 7, 5],
            [0, 4, 5, 1],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 5, 7, 3],
        ];
        let triangles = (faces.iter())
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
            .map(|corners| corners.map(corner));
        let mesh = BlockerMesh::new(triangles.collect());
        ShadowBox::new(Entity::PLACEHOLDER, Arc::new(mesh)).expect("it has triangles")
    }

    const WHOLE: f32 = 1.0;

    fn fineness(share: f32, smallest_part: f32) -> Fineness {
        Fineness {
            share,
            smallest_part,
        }
    }

    #[test]
    fn shadows_are_sharpest_where_bodies_stand() {
        let body = block(Vec3::ZERO, Vec3::new(0.8, 0.8, 0.8));
        let lamp = [LightBox::At(
            Vec3::new(3.0, 2.0, 0.2),
            Vec3::new(3.2, 2.0, 0.4),
        )];
        // The longest edge that is fine enough, by bisection.
        let longest = |at: Vec3, smallest_part: f32, lights: &[LightBox]| {
            let (mut fine, mut coarse) = (0.0, 1.0);
            for _ in 0..20 {
                let tried = 0.5 * (fine + coarse);
                let point = floor(at);
                let point = GpuTriangle {
                    b: at + 1e-3 * Vec3::Z,
                    c: at + 1e-3 * Vec3::X,
                    ..point
                };
                if body.is_fine(&point, tried, fineness(1.0, smallest_part), lights) {
                    fine = tried;
                } else {
                    coarse = tried;
                }
            }
            fine
        };
        let behind = |x: f32| longest(Vec3::new(-x, 0.0, 0.4), SMALLEST_PART, &lamp);
        let size = 0.8;
        let finest = DETAIL_OF_PART * SMALLEST_PART * size;
        assert!((behind(0.01) - finest).abs() < 1e-4, "{}", behind(0.01));
        assert!(behind(0.3) > 2.0 * finest, "{}", behind(0.3));
        assert!(
            (behind(0.7) - DETAIL * size).abs() < 1e-4,
            "{}",
            behind(0.7)
        );
        let as_a_whole = longest(Vec3::new(-0.01, 0.0, 0.4), WHOLE, &lamp);
        assert!((as_a_whole - DETAIL * size).abs() < 1e-4, "{as_a_whole}");
        // Before it there is no shadow, and the sky throws none that is sharp.
        let before = longest(Vec3::new(0.81, 0.0, 0.4), SMALLEST_PART, &lamp);
        assert!(before > 0.99, "{before}");
        let in_sky = longest(
            Vec3::new(-0.01, 0.0, 0.4),
            SMALLEST_PART,
            &[LightBox::AROUND],
        );
        assert!((in_sky - DETAIL * size).abs() < 1e-4, "{in_sky}");
    }

    #[test]
    fn shadows_fall_behind_bodies() {
        let body = block(Vec3::ZERO, Vec3::new(0.5, 0.5, 0.5));
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
        let ground = block(Vec3::new(-2.0, 0.0, -2.0), Vec3::new(2.0, 0.0, 2.0));
        assert!(!ground.falls_on(&floor(Vec3::ZERO), &lamp));
        // Its own body is left out.
        let triangle = floor(Vec3::new(-0.3, 0.0, 0.2));
        let all = [body.clone()];
        let over = |owner| ShadowBox::over(&all, &triangle, owner, &lamp).len();
        assert_eq!((over(None), over(Some(&Entity::PLACEHOLDER))), (1, 0));
        assert!(!body.is_fine(&triangle, 0.141, fineness(0.5, WHOLE), &lamp));
        assert!(body.is_fine(&triangle, 0.141, fineness(0.8, WHOLE), &lamp));
    }
}
