//! Which settings are measured on which scenes.

use super::Scope;
use crate::error::CliError;
use bevy_akari::prelude::{AkariSettings, Quality};
use bevy_akari::render::quality::Knob;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Effects with a picture that can be held against a reference, by the names of their settings.
pub const EFFECTS: [&str; 6] = [
    "area_lights",
    "shadows",
    "lobes",
    "denoise",
    "voxel_gi",
    "interreflection",
];

/// Ends the name of a scene whose every frame is the first.
const FIRST_FRAME: &str = "_first_frame";

/// One curve to be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject {
    /// One of [`EFFECTS`].
    pub effect: &'static str,
    /// The scene.
    pub scene: PathBuf,
    /// Whether there is nothing to build upon: every frame is the first.
    pub first_frame: bool,
}

impl Subject {
    /// Name of its files.
    pub fn slug(&self) -> String {
        format!("{}-{}", self.effect, self.scene_name())
    }

    /// Side of its pictures, pixels.
    pub fn side(&self, scope: &Scope) -> u32 {
        if self.effect == "lobes" {
            scope.lobes_size
        } else {
            scope.size
        }
    }

    /// The scene's file name without its ending, and what it is seen in.
    pub fn scene_name(&self) -> String {
        let stem = self
            .scene
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        if self.first_frame {
            format!("{stem}{FIRST_FRAME}")
        } else {
            stem
        }
    }
}

/// One setting to be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Name of the preset, or `knob = value`.
    pub label: String,
    /// The preset, if it is one.
    pub preset: Option<Quality>,
    /// The knob that was turned, if it is none.
    pub knob: Option<&'static str>,
    /// The settings of all effects.
    pub settings: AkariSettings,
    /// Knobs of the effect.
    pub values: BTreeMap<String, f32>,
}

/// Scenes of the repository that show what an effect does.
fn scenes_of(effect: &str, quick: bool) -> &'static [&'static str] {
    match (effect, quick) {
        ("area_lights", true) => &["many_lights", "spheres_textured"],
        ("area_lights", false) => &["spheres_quad", "spheres_textured", "gallery", "many_lights"],
        ("shadows", true) => &["shadows_28"],
        ("shadows", false) => &["shadows_28", "shadows_10", "shadows_3", "cornell"],
        ("lobes", true) => &["fine_metal"],
        ("lobes", false) => &["fine_metal", "normal_mapped"],
        ("interreflection", true) => &["corner", "corner_glossy", "corner_screen"],
        ("interreflection", false) => &["corner", "corner_glossy", "corner_screen", "ring"],
        // A metal block throws caustics, which voxels know nothing of and no setting mends: they would hide what does.
        ("voxel_gi", true) => &["cornell_matte"],
        ("voxel_gi", false) => &[
            "cornell_matte",
            "glossy_hall",
            "furnace",
            "corridor",
            "cornell",
        ],
        (_, true) => &["roughness_map", "cornell"],
        (_, false) => &[
            "roughness_map",
            "cornell",
            "sphere_sharp",
            "sphere_rough",
            "incident_edge",
        ],
    }
}

/// All curves that were asked for.
///
/// # Errors
/// If an effect is unknown, or a scene is not there.
pub fn subjects(
    effects: &[String],
    scenes: &[PathBuf],
    quick: bool,
) -> Result<Vec<Subject>, CliError> {
    let mut wanted: Vec<&'static str> = Vec::new();
    for name in effects {
        let spelled = name.replace('-', "_");
        match EFFECTS.into_iter().find(|effect| *effect == spelled) {
            Some(effect) if wanted.contains(&effect) => {}
            Some(effect) => wanted.push(effect),
            None => {
                return Err(CliError::usage(format!(
                    "--effects: there is no curve of '{name}'; there are: {}",
                    EFFECTS.join(", ")
                )));
            }
        }
    }
    if wanted.is_empty() {
        wanted.extend(EFFECTS);
    }
    let mut subjects = Vec::new();
    for effect in wanted {
        let of_effect: Vec<PathBuf> = if scenes.is_empty() {
            scenes_of(effect, quick)
                .iter()
                .map(|name| PathBuf::from(format!("assets/scenes/{name}.glb")))
                .collect()
        } else {
            scenes.to_vec()
        };
        for scene in of_effect {
            // What has just come into view has no history, and is filtered all the same.
            let kinds: &[bool] = match effect {
                // A quick look is at one scene of each kind.
                "denoise" if quick && scenes.is_empty() => {
                    let is_first = !scene.ends_with("roughness_map.glb");
                    if is_first { &[true] } else { &[false] }
                }
                "denoise" => &[false, true],
                _ => &[false],
            };
            subjects.extend(kinds.iter().map(|first_frame| Subject {
                effect,
                scene: scene.clone(),
                first_frame: *first_frame,
            }));
        }
    }
    if let Some(missing) = subjects.iter().find(|subject| !subject.scene.is_file()) {
        return Err(CliError::input(format!(
            "{}: there is no such scene; run `akari report` in the repository's folder, or name scenes by --scenes",
            missing.scene.display()
        )));
    }
    Ok(subjects)
}

/// Knobs of an effect that are left as they are, where that is not none: those that show in no still picture, and for a
/// quick look those that show least.
fn left_out(effect: &str, scene: &str, quick: bool) -> &'static [&'static str] {
    match (effect, quick) {
        // Of two scenes, each has what one of the knobs is about.
        ("area_lights", true) if scene == "many_lights" => &["texture_cells", "culling"],
        ("area_lights", true) if scene == "spheres_textured" => &["contribution_cutoff", "culling"],
        ("voxel_gi", true) => &[
            "pages",
            "bricks_per_frame",
            "pages_per_frame",
            "gather_cones",
            "history",
            "light_rays",
            "aperture",
            "voxel_size",
            "cascades",
            "cones",
            // One bounce, for comparison with all of them.
            "feedback",
            // All is matte in its scene.
            "specular_cones",
            // Indirect light has none.
            "shadow_cones",
            // For comparison, not a setting that one chooses.
            "plain_cones",
        ],
        ("voxel_gi", false) => &["pages", "bricks_per_frame", "shadow_cones"],
        // One of the scenes has what hides something; `most_patches` is only a limit.
        ("interreflection", true) if scene == "corner_screen" => {
            &["most_patches", "tier", "patch", "cut"]
        }
        // All is matte in its scene: nothing has a lobe.
        ("interreflection", true) if scene == "corner" => &["most_patches", "shadow_rays", "tier"],
        // Each tier has pipelines of its own, which take a software driver 20 s to compile: those of the presets do.
        ("interreflection", true) => &["most_patches", "shadow_rays", "patch", "tier"],
        // The denoiser is given every pixel: nothing is upsampled.
        ("denoise", true) if scene.ends_with(FIRST_FRAME) => {
            &["resample_below", "history", "levels"]
        }
        ("denoise", true) => &["resample_below", "levels"],
        ("denoise", _) => &["resample_below"],
        // They show in what reads lobes, which the curve of the denoiser is about.
        ("lobes", _) => &["wang", "stored"],
        _ => &[],
    }
}

/// Values of a knob that has few, not evenly apart, or whose steps are dear.
fn values_of(effect: &str, knob: &str, quick: bool) -> Option<&'static [f32]> {
    match (effect, knob, quick) {
        ("area_lights", "contribution_cutoff", true) => Some(&[0.25, 1.0]),
        ("area_lights", "contribution_cutoff", false) => {
            Some(&[0.00390625, 0.015625, 0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0])
        }
        ("voxel_gi", "cones" | "gather_cones", _) => Some(&[1.0, 5.0, 9.0, 16.0]),
        ("voxel_gi", "scale", true) => Some(&[1.0]),
        ("voxel_gi", "scale", _) => Some(&[1.0, 2.0, 4.0]),
        ("voxel_gi", "resolution", true) => Some(&[64.0, 128.0]),
        ("voxel_gi", "resolution", false) => Some(&[32.0, 64.0, 128.0, 256.0]),
        ("area_lights", "texture_cells", true) => Some(&[4.0]),
        ("interreflection", "cut", true) => Some(&[0.08, 0.3, 0.6]),
        ("interreflection", "shadow_rays", true) => Some(&[0.0, 1.0]),
        ("interreflection", "patch", true) => Some(&[0.125, 0.25, 0.5, 1.0, 2.0]),
        ("shadows", "pieces_roughness", true) => Some(&[-1.0]),
        ("lobes", "geometric_filter", true) => Some(&[0.0]),
        ("lobes", "geometric_looks", _) => Some(&[2.0, 4.0, 8.0]),
        ("voxel_gi", "voxel_size", _) => Some(&[0.03125, 0.0625, 0.125, 0.25]),
        _ => None,
    }
}

/// The presets of an effect, then `high` with one knob turned at a time. No setting appears twice, nor one that differs
/// from another only in knobs that do not count. `scene` is the scene's name.
pub fn variants(effect: &'static str, scene: &str, scope: &Scope) -> Vec<Variant> {
    let values = |settings: &AkariSettings| -> BTreeMap<String, f32> {
        settings
            .knobs()
            .into_iter()
            .filter(|(owner, _, _)| *owner == effect)
            .map(|(_, knob, value)| (knob.name.to_owned(), value))
            .collect()
    };
    let mut variants: Vec<Variant> = Vec::new();
    // `high` first: of equal presets the default's name stays.
    for quality in [Quality::High, Quality::Low, Quality::Medium, Quality::Ultra] {
        // Every other effect stays as it is by default, so that only this one is measured.
        let mut settings = AkariSettings::default();
        for (knob, value) in values(&AkariSettings::preset(quality)) {
            // Valid, since it comes from a preset.
            let _ = settings.set(effect, &knob, value);
        }
        variants.push(Variant {
            label: preset_name(quality).to_owned(),
            preset: Some(quality),
            knob: None,
            values: values(&settings),
            settings,
        });
    }
    let high = AkariSettings::default();
    for (owner, knob, current) in high.knobs() {
        if owner != effect || left_out(effect, scene, scope.quick).contains(&knob.name) {
            continue;
        }
        let tried = values_of(effect, knob.name, scope.quick)
            .map_or_else(|| steps(&knob, current, scope.steps), <[f32]>::to_vec);
        for value in tried {
            let mut settings = high;
            if settings.set(effect, knob.name, value).is_err() {
                continue;
            }
            let effective = settings.effective();
            if variants
                .iter()
                .any(|other| other.settings.effective() == effective)
            {
                continue;
            }
            let values = values(&settings);
            variants.push(Variant {
                label: format!("{} = {}", knob.name, short(value)),
                preset: None,
                knob: Some(knob.name),
                settings,
                values,
            });
        }
    }
    variants
}

/// Those that differ from all before them, and presets that do not, each with the place among the former of what it draws the
/// same as.
pub fn split_repeated(variants: Vec<Variant>) -> (Vec<Variant>, Vec<(Variant, usize)>) {
    let mut different: Vec<Variant> = Vec::new();
    let mut repeated = Vec::new();
    for variant in variants {
        let effective = variant.settings.effective();
        let same = different
            .iter()
            .position(|other| other.settings.effective() == effective);
        match same {
            Some(same) => repeated.push((variant, same)),
            None => different.push(variant),
        }
    }
    (different, repeated)
}

/// Name of a preset as the command line spells it.
pub fn preset_name(quality: Quality) -> &'static str {
    match quality {
        Quality::Low => "low",
        Quality::Medium => "medium",
        Quality::High => "high",
        Quality::Ultra => "ultra",
    }
}

/// A number in as few digits as tell it from its neighbours.
fn short(value: f32) -> String {
    let rounded = format!("{value:.3}").parse::<f32>().unwrap_or(value);
    if rounded == value {
        format!("{value}")
    } else {
        format!("{value:.2e}")
    }
}

/// Values of a knob to be tried, at most `most` of them besides those of its presets: all of a small whole range; else
/// steps by a factor around the present value, within the range.
fn steps(knob: &Knob, current: f32, most: usize) -> Vec<f32> {
    let mut values: Vec<f32> = knob.presets.to_vec();
    let span = knob.max - knob.min;
    if knob.integer && span <= most as f32 {
        values.extend((0..=span as u32).map(|i| knob.min + i as f32));
    } else if current == 0.0 || knob.min < 0.0 {
        // No factor leads away from 0: even steps through the range.
        values.extend((0..most).map(|i| knob.min + span * i as f32 / (most.max(2) - 1) as f32));
    } else {
        let factor = if knob.integer { 2.0f32 } else { 4.0 };
        for i in 0..most as i32 {
            // Alternating above and below: 1, -1, 2, -2 ...
            let power = (i / 2 + 1) * if i % 2 == 0 { 1 } else { -1 };
            values.push(current * factor.powi(power));
        }
    }
    for value in &mut values {
        *value = value.clamp(knob.min, knob.max);
        if knob.integer {
            *value = value.round();
        }
    }
    values.sort_by(f32::total_cmp);
    values.dedup();
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCOPE: Scope = Scope {
        size: 64,
        lobes_size: 64,
        spp: 4,
        rounds: 1,
        steps: 4,
        face_size: 16,
        history_frames: 2,
        bounce_frames: 4,
        quick: true,
    };

    #[test]
    fn every_effect_has_four_settings_and_none_twice() {
        for effect in EFFECTS {
            let variants = variants(effect, "", &SCOPE);
            assert!(variants.len() >= 4, "{effect}: {}", variants.len());
            assert_eq!(variants[0].label, "high");
            let turned: Vec<_> = variants.iter().filter(|v| v.preset.is_none()).collect();
            for (i, variant) in turned.iter().enumerate() {
                assert!(
                    turned[..i]
                        .iter()
                        .all(|other| other.values != variant.values),
                    "{effect}: {} twice",
                    variant.label
                );
                let high = AkariSettings::default();
                let changed = variant
                    .settings
                    .knobs()
                    .iter()
                    .zip(high.knobs())
                    .filter(|(a, b)| a.2 != b.2)
                    .count();
                assert_eq!(changed, 1, "{effect}: {}", variant.label);
            }
        }
    }

    #[test]
    fn what_draws_the_same_is_measured_once() {
        let all = variants("lobes", "", &SCOPE);
        let (different, repeated) = split_repeated(all.clone());
        assert_eq!(different.len() + repeated.len(), all.len());
        let (ultra, same) = &repeated[0];
        assert_eq!(
            (ultra.label.as_str(), different[*same].label.as_str()),
            ("ultra", "high")
        );
        assert_eq!(repeated.len(), 1);
        // Settings that differ are all measured.
        let (different, repeated) = split_repeated(variants("interreflection", "", &SCOPE));
        assert!(different.len() > 4 && repeated.is_empty());
    }

    #[test]
    fn a_long_look_at_voxel_gi_turns_more_knobs() {
        let turned = |quick| {
            let variants = variants("voxel_gi", "", &Scope { quick, ..SCOPE });
            let knobs: std::collections::BTreeSet<_> =
                variants.iter().filter_map(|variant| variant.knob).collect();
            knobs
        };
        let (few, all) = (turned(true), turned(false));
        for knob in ["resolution", "scale"] {
            assert!(few.contains(knob), "{knob}");
        }
        for knob in ["cones", "cascades", "specular_cones", "feedback"] {
            assert!(all.contains(knob), "{knob}");
        }
        assert!(all.is_superset(&few) && all.len() > few.len());
        assert!(!all.contains("pages"));
    }

    #[test]
    fn steps_stay_in_range_and_hold_the_presets() {
        for (_, knob, value) in AkariSettings::default().knobs() {
            let steps = steps(&knob, value, 5);
            for preset in knob.presets {
                assert!(steps.contains(&preset), "{}: {preset}", knob.name);
            }
            for step in &steps {
                assert!(
                    (knob.min..=knob.max).contains(step),
                    "{}: {step}",
                    knob.name
                );
                assert!(
                    !knob.integer || step.fract() == 0.0,
                    "{}: {step}",
                    knob.name
                );
            }
        }
    }

    #[test]
    fn unknown_effects_and_missing_scenes_are_refused() {
        let error = subjects(&["raytracing".into()], &[], true).unwrap_err();
        assert_eq!(error.code, crate::error::USAGE);
        let error = subjects(&[], &["no/such.glb".into()], true).unwrap_err();
        assert_eq!(error.code, crate::error::INPUT);
        assert!(error.message.contains("no/such.glb"));
    }
}
