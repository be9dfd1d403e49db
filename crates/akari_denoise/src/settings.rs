//! Settings, as a component on a camera or as the default of all cameras.

use akari_render::quality::{Knob, KnobValue, Knobs, Quality};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Which likeness of two pixels the filter goes by.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Ours: likeness of the lobes and of a prefiltered image against its estimated noise; recognises what is clean
    /// already and leaves it alone.
    #[default]
    Guided,
    /// Likeness of the specular lobes alone (Tokuyoshi 2015).
    Lobe,
    /// Likeness of the normals (σ² = 0.01 in Tokuyoshi 2015), for comparison.
    Normal,
    /// A kernel as wide as the lobe, whatever lies under it, for comparison (the family of axis-aligned filters, Mehta
    /// et al. 2012).
    AxisAligned,
    /// Likeness of the local mean and variance of the image as distributions (Tokuyoshi 2015, section 3).
    Distribution,
}

impl Method {
    /// All methods, in the order of their numbers.
    pub const ALL: [Self; 5] = [
        Self::Guided,
        Self::Lobe,
        Self::Normal,
        Self::AxisAligned,
        Self::Distribution,
    ];
}

/// Which neighbours the filter visits.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// All within the radius, in one pass: (2 r + 1)² of them.
    Full,
    /// First along rows, then along columns: 2 (2 r + 1) of them. Not exact, since the weights do not separate.
    Separable,
    /// 5 × 5 in each of several passes, ever further apart (Dammertz et al. 2010): 25 a level; with a radius of 1, 3 × 3:
    /// 9 a level.
    #[default]
    ATrous,
}

impl Kernel {
    /// All kernels, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Full, Self::Separable, Self::ATrous];
}

impl KnobValue for Method {
    fn to_knob(self) -> f32 {
        f32::from(self as u8)
    }

    fn from_knob(value: f32) -> Self {
        Self::ALL[(value as usize).min(Self::ALL.len() - 1)]
    }
}

impl KnobValue for Kernel {
    fn to_knob(self) -> f32 {
        f32::from(self as u8)
    }

    fn from_knob(value: f32) -> Self {
        Self::ALL[(value as usize).min(Self::ALL.len() - 1)]
    }
}

/// Largest radius of a level of the à-trous kernel, taps.
pub const A_TROUS_RADIUS: u32 = 2;

/// How noisy signals are cleaned up. On a camera, for that camera; else [`DefaultDenoise`] counts.
#[derive(Component, Debug, Clone, Copy, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Denoise {
    /// Which likeness of two pixels counts.
    pub method: Method,
    /// Which neighbours are visited.
    pub kernel: Kernel,
    /// Radius of the full and the separable kernel, pixels, and of a level of the à-trous kernel, taps; that has at most
    /// 2. 0 to 16; 0 filters nothing, so that only history and upsampling work.
    pub radius: u32,
    /// Levels of the à-trous kernel: its radius is 2^(levels + 1) - 2 pixels. 3 to 6.
    pub levels: u32,
    /// Exponent β of the lobes' likeness, for every method but `guided`, which has its own. 0.1 to 1000.
    pub beta: f32,
    /// Sharpness κ of the kernel that lobes are smoothed by, for every method but `guided`. 1 to 1e9.
    pub kappa: f32,
    /// Variance σn² of the normal-aware method. 1e-6 to 10.
    pub sigma_n_squared: f32,
    /// Whether lobes are compared as ellipses (at grazing angles GGX is far from round), not as circles.
    pub anisotropic: bool,
    /// Frames of history that an estimate is made of; 1 keeps none, and then no pass and no memory. 1 to 64.
    pub history: u32,
    /// Confidence below which a pixel of an upsampled signal is listed to be shaded again: the overlap of the neighbours'
    /// lobes with its own, halved where their samples deviate by a twentieth of (2 + their mean) and no history tells
    /// which is right. 0 lists none. 0 to 1. At most one in eleven of the pixels, and only where the producer can.
    pub resample_below: f32,
}

/// Settings of every camera that has no [`Denoise`].
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct DefaultDenoise(pub Denoise);

impl Default for Denoise {
    fn default() -> Self {
        Self::preset(Quality::default())
    }
}

impl Knobs for Denoise {
    const KNOBS: &'static [Knob] = &[
        Knob {
            name: "method",
            what: "0: guided; 1: lobe; 2: normal; 3: axis-aligned; 4: distribution",
            min: 0.0,
            max: 4.0,
            integer: true,
            presets: [0.0, 0.0, 0.0, 0.0],
            cost: "guided adds a small pass for its guide",
        },
        Knob {
            name: "kernel",
            what: "0: full; 1: separable; 2: à-trous",
            min: 0.0,
            max: 2.0,
            integer: true,
            presets: [2.0, 2.0, 2.0, 2.0],
            cost: "(2 r + 1)² taps; 2 (2 r + 1) taps; 25 taps a level, 9 with a radius of 1",
        },
        Knob {
            name: "radius",
            what: "radius of the full and the separable kernel, pixels; of an à-trous level, taps (at most 2); 0: no filter",
            min: 0.0,
            max: 16.0,
            integer: true,
            presets: [1.0, 6.0, 6.0, 6.0],
            cost: "see kernel",
        },
        Knob {
            name: "levels",
            what: "levels of the à-trous kernel",
            min: 3.0,
            max: 6.0,
            integer: true,
            presets: [3.0, 3.0, 3.0, 3.0],
            cost: "25 taps (9 with a radius of 1) and one pass a level",
        },
        Knob {
            name: "beta",
            what: "exponent of the lobes' likeness, for every method but guided",
            min: 0.1,
            max: 1000.0,
            integer: false,
            presets: [20.0, 20.0, 20.0, 20.0],
            cost: "none",
        },
        Knob {
            name: "kappa",
            what: "sharpness of the kernel that lobes are smoothed by, for every method but guided",
            min: 1.0,
            max: 1e9,
            integer: false,
            presets: [100.0, 100.0, 100.0, 100.0],
            cost: "none",
        },
        Knob {
            name: "sigma_n_squared",
            what: "variance of the normal-aware method",
            min: 1e-6,
            max: 10.0,
            integer: false,
            presets: [0.01, 0.01, 0.01, 0.01],
            cost: "none",
        },
        Knob {
            name: "anisotropic",
            what: "1: lobes are compared as ellipses; 0: as circles",
            min: 0.0,
            max: 1.0,
            integer: true,
            presets: [0.0, 0.0, 0.0, 0.0],
            cost: "more arithmetic a tap",
        },
        Knob {
            name: "history",
            what: "frames that an estimate is made of; 1 keeps no history",
            min: 1.0,
            max: 64.0,
            integer: true,
            presets: [16.0, 16.0, 32.0, 64.0],
            cost: "memory and motion vectors unless 1; a longer history reacts more slowly",
        },
        Knob {
            name: "resample_below",
            what: "confidence below which an upsampled pixel is shaded again; 0: none",
            min: 0.0,
            max: 1.0,
            integer: false,
            presets: [0.0, 0.1, 0.25, 0.5],
            cost: "the producer's price of each pixel that is listed",
        },
    ];

    akari_render::knob_fields!(
        method,
        kernel,
        radius,
        levels,
        beta,
        kappa,
        sigma_n_squared,
        anisotropic,
        history,
        resample_below
    );

    fn effective(self) -> Self {
        let high = Self::preset(Quality::High);
        Self {
            radius: match self.kernel {
                Kernel::ATrous => self.radius.min(A_TROUS_RADIUS),
                Kernel::Full | Kernel::Separable => self.radius,
            },
            levels: match self.kernel {
                Kernel::ATrous => self.levels,
                Kernel::Full | Kernel::Separable => high.levels,
            },
            beta: match self.method {
                Method::Lobe | Method::Distribution => self.beta,
                Method::Guided | Method::Normal | Method::AxisAligned => high.beta,
            },
            kappa: match self.method {
                Method::Lobe => self.kappa,
                _ => high.kappa,
            },
            sigma_n_squared: match self.method {
                Method::Normal => self.sigma_n_squared,
                _ => high.sigma_n_squared,
            },
            anisotropic: match self.method {
                Method::Guided | Method::Lobe => self.anisotropic,
                _ => high.anisotropic,
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
            "method",
            "kernel",
            "radius",
            "levels",
            "beta",
            "kappa",
            "sigma_n_squared",
            "anisotropic",
            "history",
            "resample_below",
        ];
        assert_eq!(knob_faults::<Denoise>(&fields), [""; 0]);
    }

    #[test]
    fn knobs_that_do_not_count_are_told_from_those_that_do() {
        let changed = |knob: &str, value: f32, settings: Denoise| {
            let mut other = settings;
            other.set_knob(knob, value).expect("valid");
            other.effective() != settings.effective()
        };
        let guided = Denoise::preset(Quality::High);
        for (knob, value) in [
            ("beta", 3.0),
            ("kappa", 3.0),
            ("sigma_n_squared", 3.0),
            ("radius", 9.0),
        ] {
            assert!(!changed(knob, value, guided), "{knob} of {guided:?}");
        }
        for (knob, value) in [
            ("radius", 1.0),
            ("levels", 4.0),
            ("history", 4.0),
            ("method", 2.0),
        ] {
            assert!(changed(knob, value, guided), "{knob} of {guided:?}");
        }
        let lobe = Denoise {
            method: Method::Lobe,
            kernel: Kernel::Full,
            ..guided
        };
        assert!(changed("kappa", 3.0, lobe) && changed("radius", 9.0, lobe));
        assert!(!changed("levels", 4.0, lobe) && !changed("sigma_n_squared", 3.0, lobe));
    }

    #[test]
    fn invalid_values_are_refused_with_a_reason() {
        let mut settings = Denoise::default();
        let before = settings;
        for (name, value) in [("method", 5.0), ("levels", 2.0), ("kappa", f32::NAN)] {
            let error = settings.set_knob(name, value).expect_err("out of range");
            assert!(error.to_string().contains(name), "{error}");
        }
        assert_eq!(settings, before, "a refused value changes nothing");
    }
}
