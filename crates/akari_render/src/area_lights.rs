//! The area lights of the scene as polygons, for effects that light something else than pixels by them.
//!
//! Whoever owns area lights fills [`AreaLightPolygons`] in the render world, at extraction; whoever bounces light reads
//! it. So neither knows the other.

use bevy::prelude::*;

/// One plane polygon that shines.
#[derive(Debug, Clone, PartialEq)]
pub struct AreaLightPolygon {
    /// Corners in the world, metres, counter-clockwise as seen from the front. At least three.
    pub corners: Vec<Vec3>,
    /// Radiance, nits.
    pub radiance: Vec3,
    /// Distance from the centre at which its light has faded away, metres, or infinity.
    pub range: f32,
    /// Whether its back shines, too.
    pub two_sided: bool,
}

/// All area lights that shine. In the render world.
#[derive(Resource, Debug, Default, Clone)]
pub struct AreaLightPolygons {
    /// The lights.
    pub lights: Vec<AreaLightPolygon>,
    /// The entity of each, in the main world.
    pub entities: Vec<Entity>,
}
