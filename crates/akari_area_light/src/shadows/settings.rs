//! Settings of the shadows of area lights.

use akari_render::prelude::*;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// How the shadows of area lights are drawn, on a camera; else [`DefaultAreaShadows`] counts.
///
/// It does nothing unless a bake is in the scene ([`BakedVisibility`](super::asset::BakedVisibility)).
#[derive(Component, Debug, Clone, Copy, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AreaShadows {
    /// Whether there are any. Off, the passes and buffers of the shadows do not exist.
    pub enabled: bool,
    /// Perceptual roughness up to which the light that a pixel sees is integrated piece by piece in penumbrae; rougher
    /// surfaces take the share of the irradiance that arrives. Below 0: all do. 1: none do. Range −1 to 1.
    pub pieces_roughness: f32,
    /// Whether pieces are the parts of the light that the samples see, rather than the directions in which they see.
    pub parallax: bool,
    /// Shares of the irradiance nearer than this to 0 or 1 count as outside of a penumbra. Range 0 to 0.5.
    pub penumbra_threshold: f32,
}

/// Settings of every camera that has no [`AreaShadows`] of its own.
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct DefaultAreaShadows(pub AreaShadows);

impl Default for AreaShadows {
    fn default() -> Self {
        Self::preset(Quality::default())
    }
}

impl Knobs for AreaShadows {
    const KNOBS: &'static [Knob] = &[
        Knob {
            name: "enabled",
            what: "1: baked shadows; 0: none, and nothing of them in memory",
            min: 0.0,
            max: 1.0,
            integer: true,
            presets: [1.0, 1.0, 1.0, 1.0],
            cost: "0 costs nothing",
        },
        Knob {
            name: "pieces_roughness",
            what: "perceptual roughness up to which penumbrae are integrated piece by piece; -1: nowhere",
            min: -1.0,
            max: 1.0,
            integer: false,
            presets: [-1.0, 0.5, 1.0, 1.0],
            cost: "pixels of penumbrae up to this roughness visit three visibility trees a light",
        },
        Knob {
            name: "parallax",
            what: "1: a pixel is lit by the parts of the light that its samples see; 0: from the directions in which they see",
            min: 0.0,
            max: 1.0,
            integer: true,
            presets: [1.0, 1.0, 1.0, 1.0],
            cost: "both cost the same",
        },
        Knob {
            name: "penumbra_threshold",
            what: "shares of a light nearer than this to 0 or 1 are outside of a penumbra",
            min: 0.0,
            max: 0.5,
            integer: false,
            presets: [1.0 / 16.0, 1.0 / 64.0, 1.0 / 64.0, 1.0 / 256.0],
            cost: "a larger value visits fewer trees",
        },
    ];

    akari_render::knob_fields!(enabled, pieces_roughness, parallax, penumbra_threshold);

    fn effective(self) -> Self {
        let high = Self::preset(Quality::High);
        if !self.enabled {
            return Self {
                enabled: false,
                ..high
            };
        }
        Self {
            parallax: if self.pieces_roughness < 0.0 {
                high.parallax
            } else {
                self.parallax
            },
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_render::quality::knob_faults;

    #[test]
    fn fields_are_knobs() {
        let fields = [
            "enabled",
            "pieces_roughness",
            "parallax",
            "penumbra_threshold",
        ];
        assert_eq!(knob_faults::<AreaShadows>(&fields), [""; 0]);
    }
}
