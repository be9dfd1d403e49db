//! The settings of all effects as one value: what a settings file holds and `--set` changes.

use akari_area_light::settings::{AreaLighting, DefaultAreaLighting};
use akari_area_light::shadows::settings::{AreaShadows, DefaultAreaShadows};
use akari_denoise::settings::{DefaultDenoise, Denoise};
use akari_interreflection::settings::{DefaultInterreflection, Interreflection};
use akari_lobes::settings::{DefaultSpecularLobes, SpecularLobes};
use akari_render::quality::{Knob, KnobError, Knobs, Quality};
use akari_voxel_gi::settings::VoxelGi;
use bevy::ecs::component::Mutable;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// The settings of all effects.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AkariSettings {
    /// Area lights.
    pub area_lights: AreaLighting,
    /// Baked shadows of area lights.
    pub shadows: AreaShadows,
    /// Specular lobes of pixels.
    pub lobes: SpecularLobes,
    /// Accumulation, filtering and upsampling of noisy signals.
    pub denoise: Denoise,
    /// Indirect light by voxels, on cameras that ask for it.
    pub voxel_gi: VoxelGi,
    /// Light between reflectors and what cameras see.
    pub interreflection: Interreflection,
}

impl Default for AkariSettings {
    fn default() -> Self {
        Self::preset(Quality::default())
    }
}

/// Why a setting could not be changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SettingError {
    /// No effect of that name; the known ones are listed.
    #[error("there is no effect '{0}'; known are: {known}", known = EFFECT_NAMES.join(", "))]
    UnknownEffect(String),
    /// The effect is there, but not the knob, or its value is not valid.
    #[error("{effect}: {error}")]
    Knob {
        /// Name of the effect.
        effect: &'static str,
        /// What is wrong.
        error: KnobError,
    },
}

/// Names of the effects as `--set effect.knob=value` knows them.
pub const EFFECT_NAMES: [&str; 6] = [
    "area_lights",
    "shadows",
    "lobes",
    "denoise",
    "voxel_gi",
    "interreflection",
];

/// What all settings can do, whatever their type.
trait AnyKnobs {
    fn set(&mut self, knob: &str, value: f32) -> Result<(), KnobError>;
    fn list(&self) -> Vec<(Knob, f32)>;
}

impl<T: Knobs> AnyKnobs for T {
    fn set(&mut self, knob: &str, value: f32) -> Result<(), KnobError> {
        self.set_knob(knob, value)
    }

    fn list(&self) -> Vec<(Knob, f32)> {
        T::KNOBS
            .iter()
            .filter_map(|knob| Some((*knob, self.value(knob.name)?)))
            .collect()
    }
}

impl AkariSettings {
    /// The settings of a preset for every effect.
    pub fn preset(quality: Quality) -> Self {
        Self {
            area_lights: AreaLighting::preset(quality),
            shadows: AreaShadows::preset(quality),
            lobes: SpecularLobes::preset(quality),
            denoise: Denoise::preset(quality),
            voxel_gi: VoxelGi::preset(quality),
            interreflection: Interreflection::preset(quality),
        }
    }

    /// The same with every knob that does not count beside the others at its value of [`Quality::High`].
    #[must_use]
    pub fn effective(self) -> Self {
        Self {
            area_lights: self.area_lights.effective(),
            shadows: self.shadows.effective(),
            lobes: self.lobes.effective(),
            denoise: self.denoise.effective(),
            voxel_gi: self.voxel_gi.effective(),
            interreflection: self.interreflection.effective(),
        }
    }

    /// In the order of [`EFFECT_NAMES`].
    fn effects(&mut self) -> [&mut dyn AnyKnobs; EFFECT_NAMES.len()] {
        [
            &mut self.area_lights,
            &mut self.shadows,
            &mut self.lobes,
            &mut self.denoise,
            &mut self.voxel_gi,
            &mut self.interreflection,
        ]
    }

    /// Sets one knob of one effect.
    ///
    /// # Errors
    /// If there is no such effect or knob, or the value is not valid; the message lists what is.
    pub fn set(&mut self, effect: &str, knob: &str, value: f32) -> Result<(), SettingError> {
        // Both spellings: fields are written with underscores, effects on the command line with hyphens.
        let wanted = effect.replace('-', "_");
        for (name, settings) in EFFECT_NAMES.into_iter().zip(self.effects()) {
            if name == wanted {
                return settings
                    .set(knob, value)
                    .map_err(|error| SettingError::Knob {
                        effect: name,
                        error,
                    });
            }
        }
        Err(SettingError::UnknownEffect(effect.to_owned()))
    }

    /// Every knob of every effect with its current value.
    pub fn knobs(&self) -> Vec<(&'static str, Knob, f32)> {
        let mut copy = *self;
        EFFECT_NAMES
            .into_iter()
            .zip(copy.effects())
            .flat_map(|(name, settings)| {
                settings
                    .list()
                    .into_iter()
                    .map(move |(knob, value)| (name, knob, value))
            })
            .collect()
    }

    /// The settings of every camera that has none of its own; defaults for effects whose plugin is not there, and for
    /// `voxel_gi`, which each camera has to itself.
    pub fn of_world(world: &World) -> Self {
        Self {
            area_lights: world
                .get_resource::<DefaultAreaLighting>()
                .map_or_else(AreaLighting::default, |default| default.0),
            shadows: world
                .get_resource::<DefaultAreaShadows>()
                .map_or_else(AreaShadows::default, |default| default.0),
            lobes: world
                .get_resource::<DefaultSpecularLobes>()
                .map_or_else(SpecularLobes::default, |default| default.0),
            denoise: world
                .get_resource::<DefaultDenoise>()
                .map_or_else(Denoise::default, |default| default.0),
            voxel_gi: VoxelGi::default(),
            interreflection: world
                .get_resource::<DefaultInterreflection>()
                .map_or_else(Interreflection::default, |default| default.0),
        }
    }

    /// Makes them the settings of every camera that has none of its own; `voxel_gi` is for whoever puts it on a camera.
    pub fn apply(&self, world: &mut World) {
        world.insert_resource(DefaultAreaLighting(self.area_lights));
        world.insert_resource(DefaultAreaShadows(self.shadows));
        world.insert_resource(DefaultSpecularLobes(self.lobes));
        world.insert_resource(DefaultDenoise(self.denoise));
        world.insert_resource(DefaultInterreflection(self.interreflection));
    }

    /// The settings that a camera draws with: its own, and for effects of which it has none those of every such camera.
    pub fn of_camera(world: &World, camera: Entity) -> Self {
        let common = Self::of_world(world);
        Self {
            area_lights: own(world, camera).unwrap_or(common.area_lights),
            shadows: own(world, camera).unwrap_or(common.shadows),
            lobes: own(world, camera).unwrap_or(common.lobes),
            denoise: own(world, camera).unwrap_or(common.denoise),
            voxel_gi: own(world, camera).unwrap_or(common.voxel_gi),
            interreflection: own(world, camera).unwrap_or(common.interreflection),
        }
    }

    /// Makes them a camera's own, for effects of which it has settings of its own; the others stay common.
    pub fn apply_to_camera(&self, world: &mut World, camera: Entity) {
        set_own(world, camera, self.area_lights);
        set_own(world, camera, self.shadows);
        set_own(world, camera, self.lobes);
        set_own(world, camera, self.denoise);
        set_own(world, camera, self.voxel_gi);
        set_own(world, camera, self.interreflection);
    }

    /// As a RON document.
    ///
    /// # Errors
    /// Never for valid settings; the error is that of the writer.
    pub fn to_ron(&self) -> Result<String, ron::Error> {
        ron::ser::to_string_pretty(self, ron::ser::PrettyConfig::default())
    }

    /// From a RON document; what it leaves out keeps its default. Values are checked against their ranges.
    ///
    /// # Errors
    /// What is wrong, and on which line.
    pub fn from_ron(text: &str) -> Result<Self, String> {
        let read: Self = ron::from_str(text).map_err(|error| error.to_string())?;
        let mut checked = read;
        for (effect, knob, value) in read.knobs() {
            checked
                .set(effect, knob.name, value)
                .map_err(|error| error.to_string())?;
        }
        Ok(checked)
    }
}

/// A camera's own settings of an effect.
fn own<T: Component + Copy>(world: &World, camera: Entity) -> Option<T> {
    world.get::<T>(camera).copied()
}

/// Changes a camera's own settings of an effect, if it has some, and they are others.
fn set_own<T: Component<Mutability = Mutable> + PartialEq>(
    world: &mut World,
    camera: Entity,
    settings: T,
) {
    if let Some(mut own) = world.get_mut::<T>(camera) {
        own.set_if_neq(settings);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_a_round_trip() {
        for quality in Quality::ALL {
            let settings = AkariSettings::preset(quality);
            let text = settings.to_ron().expect("serialisable");
            assert_eq!(AkariSettings::from_ron(&text), Ok(settings), "{text}");
        }
        assert_eq!(AkariSettings::from_ron("()"), Ok(AkariSettings::default()));
    }

    #[test]
    fn wrong_settings_are_refused_by_name() {
        for (text, named) in [
            ("(area_lights: (texture_cells: 99))", "texture_cells"),
            ("(area_lights: (texture_cels: 2))", "texture_cels"),
            ("(area_ligths: ())", "area_ligths"),
        ] {
            let error = AkariSettings::from_ron(text).expect_err(text);
            assert!(error.contains(named), "{error}");
        }
        let mut settings = AkariSettings::default();
        assert!(settings.set("area-lights", "texture_cells", 2.0).is_ok());
        assert_eq!(settings.area_lights.texture_cells, 2);
        let error = settings
            .set("voxels", "size", 1.0)
            .expect_err("no such effect");
        assert!(error.to_string().contains("area_lights"), "{error}");
    }
}
