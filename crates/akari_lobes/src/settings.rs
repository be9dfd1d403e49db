//! Settings, as a component on a camera or as the default of all cameras.

use akari_render::quality::{Knob, Knobs, Quality};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Variance of the reconstruction filter of a pixel that geometric antialiasing assumes, pixels²: 1 / (2 π)
/// (Tokuyoshi and Kaplanyan 2019, "Improved Geometric Specular Antialiasing").
pub const PIXEL_FILTER_VARIANCE: f32 = 0.159_154_94;
/// Most that geometric antialiasing adds to alpha² (Tokuyoshi and Kaplanyan 2019).
pub const MAX_ADDED_ROUGHNESS: f32 = 0.18;

/// How the specular lobe of each pixel is found. On a camera, for that camera; else [`DefaultSpecularLobes`] counts.
#[derive(Component, Debug, Clone, Copy, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct SpecularLobes {
    /// Whether lobes are stored (8 bytes a pixel, one pass), or made again from the G-buffer at each look (no memory,
    /// as Tokuyoshi 2015 has it).
    pub stored: bool,
    /// Whether the lobe is that of Wang et al. 2009, "All-Frequency Rendering of Dynamic, Spatially-Varying
    /// Reflectance", about the mirror direction: only for comparison. The default is the lobe about the dominant
    /// visible normal, which is much closer to GGX (`akari_math::ggx`).
    pub wang: bool,
    /// Variance of the pixel's filter for geometric antialiasing, pixels²; 0 switches it off. Range 0 to 1.
    ///
    /// It widens the roughness in Bevy's G-buffer by how much the normal turns between neighbouring pixels, so that
    /// Bevy's lighting, ours, and the lobes agree.
    pub geometric_filter: f32,
    /// From how many neighbours of a pixel geometric antialiasing learns how much the normal turns there. 2: one along each
    /// axis, so that edges turn rough. 4: both sides, without edges. 8: the rows beside them, too, for less noise where
    /// detail is finer than pixels. Range 2 to 8; numbers between these count as the next smaller one.
    pub geometric_looks: u32,
}

/// Settings of every camera that has no [`SpecularLobes`].
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct DefaultSpecularLobes(pub SpecularLobes);

impl Default for SpecularLobes {
    fn default() -> Self {
        Self::preset(Quality::default())
    }
}

impl Knobs for SpecularLobes {
    const KNOBS: &'static [Knob] = &[
        Knob {
            name: "stored",
            what: "1: lobes are stored, 8 bytes a pixel; 0: made again from the G-buffer at each look",
            min: 0.0,
            max: 1.0,
            integer: true,
            presets: [1.0, 1.0, 1.0, 1.0],
            cost: "0 saves one pass and the memory, and makes each look at a pixel dearer",
        },
        Knob {
            name: "wang",
            what: "1: the lobe of Wang et al. 2009, for comparison; 0: about the dominant visible normal",
            min: 0.0,
            max: 1.0,
            integer: true,
            presets: [0.0, 0.0, 0.0, 0.0],
            cost: "none",
        },
        Knob {
            name: "geometric_filter",
            what: "variance of the pixel's filter for geometric antialiasing, pixels²; 0: off",
            min: 0.0,
            max: 1.0,
            integer: false,
            presets: [
                PIXEL_FILTER_VARIANCE,
                PIXEL_FILTER_VARIANCE,
                PIXEL_FILTER_VARIANCE,
                PIXEL_FILTER_VARIANCE,
            ],
            cost: "two passes and 4 bytes a pixel unless 0",
        },
        Knob {
            name: "geometric_looks",
            what: "neighbours that geometric antialiasing looks at: 2, 4 or 8",
            min: 2.0,
            max: 8.0,
            integer: true,
            presets: [2.0, 4.0, 8.0, 8.0],
            cost: "grows with them",
        },
    ];

    akari_render::knob_fields!(stored, wang, geometric_filter, geometric_looks);

    fn effective(self) -> Self {
        let high = Self::preset(Quality::High);
        let geometric_looks = match self.geometric_looks {
            _ if self.geometric_filter == 0.0 => high.geometric_looks,
            8.. => 8,
            4.. => 4,
            _ => 2,
        };
        Self {
            geometric_looks,
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
        let fields = ["stored", "wang", "geometric_filter", "geometric_looks"];
        assert_eq!(knob_faults::<SpecularLobes>(&fields), [""; 0]);
    }

    #[test]
    fn looks_count_in_steps_and_only_where_there_is_a_filter() {
        let with = |geometric_filter, geometric_looks| {
            let settings = SpecularLobes {
                geometric_filter,
                geometric_looks,
                ..default()
            };
            settings.effective().geometric_looks
        };
        assert_eq!(
            [2, 3, 4, 7, 8].map(|looks| with(0.1, looks)),
            [2, 2, 4, 4, 8]
        );
        assert_eq!(with(0.0, 2), with(0.0, 4));
    }
}
