//! The lights that users put into a scene, next to Bevy's [`RectLight`].

use bevy::math::Affine2;
use bevy::prelude::*;
use std::f32::consts::TAU;

/// Fewest corners of a polygonal light.
pub const MIN_VERTICES: usize = 3;
/// Most corners of a polygonal light.
pub const MAX_VERTICES: usize = 64;
/// Corners of the polygon that stands for a disk: its outline then deviates from the circle by at most 0.5 % of the
/// radius, and its area is exact.
pub const DISK_VERTICES: usize = 32;

/// A planar polygon that shines with the same radiance in every direction of its front (a Lambertian emitter).
///
/// The polygon lies in the XY plane of the entity's local frame and faces the local −Z direction, as Bevy's
/// `RectLight` does. It may be convex or concave, but must not cross itself. The order of its corners (clockwise or
/// not) does not matter.
#[derive(Component, Debug, Clone, PartialEq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(Transform, Visibility)]
pub struct PolygonLight {
    /// Corners in the local XY plane, in metres. [`MIN_VERTICES`] to [`MAX_VERTICES`].
    pub vertices: Vec<Vec2>,
    /// Colour, multiplied with the luminance.
    pub color: Color,
    /// Luminance of the surface in nits (cd/m²): the radiance that the camera sees when it looks at the light.
    pub luminance: f32,
    /// Distance from the light's centre, in metres, at which its light has faded to nothing, with the same curve as
    /// Bevy's `RectLight`. Infinite: no end, as in nature.
    pub range: f32,
    /// Whether the back shines, too.
    pub two_sided: bool,
}

impl Default for PolygonLight {
    fn default() -> Self {
        Self::rectangle(1.0, 1.0)
    }
}

impl PolygonLight {
    /// A white light of 1,000 nits, without end of range, one-sided, with these corners.
    pub fn new(vertices: impl Into<Vec<Vec2>>) -> Self {
        Self {
            vertices: vertices.into(),
            color: Color::WHITE,
            luminance: 1000.0,
            range: f32::INFINITY,
            two_sided: false,
        }
    }

    /// A rectangle around the origin, `width` along X and `height` along Y.
    pub fn rectangle(width: f32, height: f32) -> Self {
        let half = Vec2::new(width, height) * 0.5;
        Self::new([
            Vec2::new(-half.x, -half.y),
            Vec2::new(half.x, -half.y),
            Vec2::new(half.x, half.y),
            Vec2::new(-half.x, half.y),
        ])
    }

    /// A regular polygon around the origin whose corners lie on a circle.
    pub fn regular(sides: usize, circumradius: f32) -> Self {
        let corners: Vec<Vec2> = (0..sides)
            .map(|corner| Vec2::from_angle(TAU * corner as f32 / sides as f32) * circumradius)
            .collect();
        Self::new(corners)
    }

    /// A disk around the origin: a regular polygon of [`DISK_VERTICES`] corners with the disk's area.
    pub fn disk(radius: f32) -> Self {
        let step = TAU / DISK_VERTICES as f32;
        // Area of the polygon: n/2 · R² · sin(2π/n); of the disk: π r².
        Self::regular(DISK_VERTICES, radius * (step / step.sin()).sqrt())
    }

    /// With this luminance in nits.
    #[must_use]
    pub fn with_luminance(mut self, nits: f32) -> Self {
        self.luminance = nits;
        self
    }

    /// With this colour.
    #[must_use]
    pub fn with_color(mut self, color: impl Into<Color>) -> Self {
        self.color = color.into();
        self
    }

    /// With an end of its reach, in metres from its centre.
    #[must_use]
    pub fn with_range(mut self, metres: f32) -> Self {
        self.range = metres;
        self
    }

    /// Shining from both sides.
    #[must_use]
    pub fn two_sided(mut self) -> Self {
        self.two_sided = true;
        self
    }
}

/// An image on a [`PolygonLight`] or a [`RectLight`]: the light's radiance is multiplied by it.
///
/// Any size and aspect work, power of two or not; the image may be one that the GPU draws or a video writes. It is
/// filtered anew when the asset changes, or in each frame if it is [`dynamic`](Self::dynamic).
#[derive(Component, Debug, Clone, PartialEq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct AreaLightTexture {
    /// The image; its colours are linear after sampling (an sRGB image is decoded by the GPU).
    pub image: Handle<Image>,
    /// Image coordinates (0 to 1, v downwards; beyond that the image repeats) from the local XY plane in metres.
    /// `None` stretches the image over the bounding rectangle of the light, upright as seen from its front.
    pub uv_from_local: Option<Affine2>,
    /// Whether the image's content changes from frame to frame without its asset changing, as a render target's or a
    /// video's does. It is then filtered anew in each frame (cost: see `images`).
    pub dynamic: bool,
}

impl Default for AreaLightTexture {
    fn default() -> Self {
        Self::new(Handle::default())
    }
}

impl AreaLightTexture {
    /// The image stretched over the light's bounding rectangle.
    pub fn new(image: Handle<Image>) -> Self {
        Self {
            image,
            uv_from_local: None,
            dynamic: false,
        }
    }
}

/// Why the shape of a light cannot shine. It then contributes nothing, and a warning says so once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShapeFault {
    /// Fewer than [`MIN_VERTICES`] or more than [`MAX_VERTICES`] corners.
    VertexCount(usize),
    /// A corner, the transform, the luminance or the colour is not a finite number.
    NotFinite,
    /// The corners span no area.
    NoArea,
    /// Two sides of the polygon cross.
    SelfIntersecting,
    /// The luminance or a channel of the colour is negative.
    Negative,
}

impl std::fmt::Display for ShapeFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::VertexCount(count) => {
                write!(
                    f,
                    "it has {count} corners; {MIN_VERTICES} to {MAX_VERTICES} are possible"
                )
            }
            Self::NotFinite => f.write_str(
                "a corner, its transform, its luminance or its colour is not a finite number",
            ),
            Self::NoArea => f.write_str("its corners span no area"),
            Self::SelfIntersecting => {
                f.write_str("two of its sides cross; order the corners around the outline")
            }
            Self::Negative => f.write_str("its luminance or a channel of its colour is negative"),
        }
    }
}

/// Signed area of a polygon, positive if its corners run counter-clockwise with X right and Y up.
pub fn signed_area(vertices: &[Vec2]) -> f32 {
    // Relative to the first corner, so that a polygon far from the origin loses no digits.
    let Some(&origin) = vertices.first() else {
        return 0.0;
    };
    let doubled: f32 = vertices
        .windows(2)
        .map(|pair| (pair[0] - origin).perp_dot(pair[1] - origin))
        .sum();
    0.5 * doubled
}

/// Checks that the corners make a simple polygon with an area.
///
/// # Errors
/// The first fault found.
pub fn check_outline(vertices: &[Vec2]) -> Result<(), ShapeFault> {
    let count = vertices.len();
    if !(MIN_VERTICES..=MAX_VERTICES).contains(&count) {
        return Err(ShapeFault::VertexCount(count));
    }
    if !vertices.iter().all(|vertex| vertex.is_finite()) {
        return Err(ShapeFault::NotFinite);
    }
    let (mut low, mut high) = (vertices[0], vertices[0]);
    for vertex in vertices {
        low = low.min(*vertex);
        high = high.max(*vertex);
    }
    let extent = (high - low).length_squared();
    // Relative to the extent, an area below this is a line up to rounding of its corners.
    const SMALLEST_RELATIVE_AREA: f32 = 1e-7;
    if signed_area(vertices).abs() <= SMALLEST_RELATIVE_AREA * extent {
        return Err(ShapeFault::NoArea);
    }
    for first in 0..count {
        // Neighbouring sides share a corner and cannot cross.
        for second in first + 2..count {
            if first == 0 && second == count - 1 {
                continue;
            }
            let (a, b) = (vertices[first], vertices[first + 1]);
            let (c, d) = (vertices[second], vertices[(second + 1) % count]);
            if sides_cross(a, b, c, d) {
                return Err(ShapeFault::SelfIntersecting);
            }
        }
    }
    Ok(())
}

/// Whether the open segments ab and cd have one inner point in common.
fn sides_cross(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let side = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp_dot(r - p);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_has_the_area_of_its_circle() {
        let disk = PolygonLight::disk(0.7);
        let circle = std::f32::consts::PI * 0.49;
        assert!((signed_area(&disk.vertices) / circle - 1.0).abs() < 1e-5);
    }

    #[test]
    fn good_outlines_pass() {
        let l_shape = [
            (0.0, 0.0),
            (2.0, 0.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (1.0, 2.0),
            (0.0, 2.0),
        ]
        .map(Vec2::from);
        for light in [
            PolygonLight::default(),
            PolygonLight::regular(3, 1e-3),
            PolygonLight::disk(1e3),
            PolygonLight::new(l_shape),
        ] {
            assert_eq!(check_outline(&light.vertices), Ok(()));
        }
        assert!((signed_area(&l_shape) - 3.0).abs() < 1e-6);
    }

    #[test]
    fn bad_outlines_are_named() {
        let fault = |corners: &[(f32, f32)]| {
            let corners: Vec<Vec2> = corners.iter().copied().map(Vec2::from).collect();
            check_outline(&corners)
        };
        assert_eq!(
            fault(&[(0.0, 0.0), (1.0, 0.0)]),
            Err(ShapeFault::VertexCount(2))
        );
        assert_eq!(fault(&[(0.0, 0.0); 65]), Err(ShapeFault::VertexCount(65)));
        assert_eq!(
            fault(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]),
            Err(ShapeFault::NoArea)
        );
        assert_eq!(fault(&[(0.0, 0.0); 4]), Err(ShapeFault::NoArea));
        assert_eq!(
            fault(&[(0.0, 0.0), (f32::NAN, 1.0), (2.0, 2.0)]),
            Err(ShapeFault::NotFinite)
        );
        let bow_tie = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.5)];
        assert_eq!(fault(&bow_tie), Err(ShapeFault::SelfIntersecting));
    }
}
