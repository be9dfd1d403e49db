//! Settings of the area lights of a view.

use akari_render::prelude::*;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// How the area lights of a view are drawn.
///
/// On a camera it switches area lighting on for that camera (and brings
/// [`AkariCamera`] with it). Every other `AkariCamera` takes the settings of
/// [`DefaultAreaLighting`].
#[derive(Component, Debug, Clone, Copy, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[require(AkariCamera)]
#[serde(default, deny_unknown_fields)]
pub struct AreaLighting {
    /// Light that may be lost in a tile, as a bound on its summed radiance times the camera's exposure; 0 keeps every
    /// light everywhere. Range 0 to 1.
    ///
    /// Lights without a range reach everywhere. A tile drops the dimmest of them, as many as may together bring this at
    /// most (`akari_math::tile_bounds`), so that whatever the scene, no pixel loses more. A light with a range is never
    /// dropped within it.
    pub contribution_cutoff: f32,
    /// Cells per side into which the image of a textured light is cut, each lit by itself. 1 to 8.
    ///
    /// One cell is the method of Heitz et al. 2016: a single prefiltered look-up for the whole light. More cells
    /// converge to the exact integral; the light costs as much as cells² lights without a texture.
    pub texture_cells: u32,
    /// Whether lights are culled by tiles of the screen. Off, each pixel visits every light: only for comparison.
    pub culling: bool,
}

/// Settings of every camera that has an [`AkariCamera`] but no [`AreaLighting`].
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct DefaultAreaLighting(pub AreaLighting);

impl Default for AreaLighting {
    fn default() -> Self {
        Self::preset(Quality::default())
    }
}

impl Knobs for AreaLighting {
    const KNOBS: &'static [Knob] = &[
        Knob {
            name: "contribution_cutoff",
            what: "pre-exposed radiance that a pixel may lose to culling of lights without a range",
            min: 0.0,
            max: 1.0,
            integer: false,
            presets: [1.0 / 4.0, 1.0 / 16.0, 1.0 / 64.0, 0.0],
            cost: "1,024 lights: 1/16 takes two thirds of the time of 0, 1/4 half of it",
        },
        Knob {
            name: "texture_cells",
            what: "cells per side of a textured light, each lit by itself",
            min: 1.0,
            max: 8.0,
            integer: true,
            presets: [1.0, 1.0, 1.0, 8.0],
            cost: "a textured light costs cells² times an untextured one",
        },
        Knob {
            name: "culling",
            what: "1: lights are culled by screen tiles; 0: each pixel visits every light",
            min: 0.0,
            max: 1.0,
            integer: true,
            presets: [1.0, 1.0, 1.0, 1.0],
            cost: "0 costs the full price of every light at every pixel",
        },
    ];

    akari_render::knob_fields!(contribution_cutoff, texture_cells, culling);
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_render::quality::knob_faults;

    #[test]
    fn fields_are_knobs() {
        let fields = ["contribution_cutoff", "texture_cells", "culling"];
        assert_eq!(knob_faults::<AreaLighting>(&fields), [""; 0]);
    }

    #[test]
    fn invalid_values_are_refused_with_a_reason() {
        let mut settings = AreaLighting::default();
        let before = settings;
        for (name, value) in [
            ("contribution_cutoff", f32::NAN),
            ("contribution_cutoff", -1.0),
            ("texture_cells", 2.5),
            ("texture_cells", 9.0),
        ] {
            let error = settings.set_knob(name, value).expect_err("out of range");
            assert!(error.to_string().contains(name), "{error}");
        }
        let unknown = settings
            .set_knob("textur_cells", 2.0)
            .expect_err("no such knob");
        assert!(unknown.to_string().contains("texture_cells"), "{unknown}");
        assert_eq!(settings, before, "a refused value changes nothing");
    }
}
