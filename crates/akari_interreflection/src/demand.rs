//! Whether the scene calls for interreflection.

use crate::EFFECT;
use crate::casters::gather_casters;
use crate::reflector::Reflector;
use crate::settings::{DefaultInterreflection, Interreflection};
use akari_render::camera::GathersBounces;
use akari_render::prelude::*;
use akari_render::sky::SkyMap;
use bevy::light::{EnvironmentMapLight, GeneratedEnvironmentMapLight};
use bevy::prelude::*;

/// Census entry: meshes marked as reflectors that are not hidden.
pub const REFLECTORS: &str = "reflectors";
/// Census entry: Bevy's punctual and directional lights that are not hidden.
pub const REFLECTED_LIGHTS: &str = "lights that reflectors see";
/// Census entry: active cameras with an [`AkariCamera`].
pub const CAMERAS: &str = "cameras with interreflection";
/// Census entry: active cameras with an environment map that shines, and for which no other effect brings its bounces.
pub const REFLECTED_SKIES: &str = "skies that reflectors see";
/// Census entry of the effect of area lights, if it is there.
const AREA_LIGHTS: &str = "visible area lights";

/// Census entry: those of them for which light of reflectors is held back.
pub const SHADOWED_CAMERAS: &str = "cameras with interreflection that is held back";
/// Census entry: triangles of all opaque meshes that cast shadows, while there are such cameras.
pub const HIDING_TRIANGLES: &str = "triangles that hold light of reflectors back";
/// Census entry: how many there may be ([`MostBlockers`](crate::casters::MostBlockers)).
pub const MOST_HIDING_TRIANGLES: &str = "triangles that may hold light of reflectors back";

/// What hides reflectors from what they light, and lights from reflectors.
pub fn occlusion(census: &Census) -> String {
    let (shadowed, all) = (census.count(SHADOWED_CAMERAS), census.count(CAMERAS));
    if shadowed == 0 {
        return "none".to_owned();
    }
    let triangles = census.count(HIDING_TRIANGLES);
    let most = census.count(MOST_HIDING_TRIANGLES);
    let mut what = if triangles > most {
        format!("reflectors alone, since {triangles} triangles are more than {most}")
    } else {
        "opaque meshes".to_owned()
    };
    if shadowed < all {
        what += ", none for some cameras";
    }
    what
}

/// Systems of the main world.
pub(crate) fn build(app: &mut App) {
    app.add_systems(
        PostUpdate,
        (
            (count, gather_casters).chain().in_set(AkariSystems::Census),
            record_demand.in_set(AkariSystems::Demand),
        ),
    );
}

/// The demand: a pure function of the census.
pub fn demand(census: &Census) -> Demand {
    let reflectors = census.count(REFLECTORS);
    let lights = census.count(REFLECTED_LIGHTS) + census.count(AREA_LIGHTS);
    if reflectors == 0 {
        Demand::idle("no mesh is marked as a reflector")
    } else if lights == 0 && census.count(REFLECTED_SKIES) == 0 {
        Demand::idle("no light for the reflectors")
    } else if census.count(CAMERAS) == 0 {
        Demand::idle("no active camera asks for effects")
    } else {
        let plural = |count: u32, one: &str| {
            let s = if count == 1 { "" } else { "s" };
            format!("{count} {one}{s}")
        };
        let what = match (lights, census.count(REFLECTED_SKIES) > 0) {
            (0, _) => "the sky".to_owned(),
            (_, true) => format!("{} and the sky", plural(lights, "light")),
            (_, false) => plural(lights, "light"),
        };
        Demand::needed(format!(
            "{} may reflect {what}; occlusion: {}",
            plural(reflectors, "reflector"),
            occlusion(census)
        ))
    }
}

fn count(
    reflectors: Query<&InheritedVisibility, (With<Reflector>, With<Mesh3d>)>,
    directional: Query<(&DirectionalLight, &InheritedVisibility)>,
    points: Query<(&PointLight, &InheritedVisibility)>,
    spots: Query<(&SpotLight, &InheritedVisibility)>,
    cameras: Query<
        (
            &Camera,
            Option<&Interreflection>,
            Option<&EnvironmentMapLight>,
            Has<GeneratedEnvironmentMapLight>,
            Has<GathersBounces>,
        ),
        (With<AkariCamera>, With<Camera3d>),
    >,
    defaults: Res<DefaultInterreflection>,
    mut census: ResMut<Census>,
) {
    let shown = reflectors.iter().filter(|visible| visible.get()).count();
    set(&mut census, REFLECTORS, shown);
    if shown == 0 {
        return;
    }
    let (mut active, mut shadowed, mut skies) = (0, 0, 0);
    for (camera, settings, map, generated, gathers) in &cameras {
        if camera.is_active {
            active += 1;
            shadowed += usize::from(settings.unwrap_or(&defaults.0).shadow_rays > 0);
            // A generated map is one as soon as it is made.
            let shines = map.map_or(generated, |map| SkyMap::new(map).is_some());
            skies += usize::from(shines && !gathers);
        }
    }
    set(&mut census, CAMERAS, active);
    set(&mut census, SHADOWED_CAMERAS, shadowed);
    set(&mut census, REFLECTED_SKIES, skies);
    let lights = directional
        .iter()
        .filter(|(light, visible)| visible.get() && light.illuminance > 0.0)
        .count()
        + points
            .iter()
            .filter(|(light, visible)| visible.get() && light.intensity > 0.0)
            .count()
        + spots
            .iter()
            .filter(|(light, visible)| visible.get() && light.intensity > 0.0)
            .count();
    set(&mut census, REFLECTED_LIGHTS, lights);
}

/// Sets an entry without marking the census as changed where it is not.
pub(crate) fn set(census: &mut ResMut<Census>, name: &'static str, count: usize) {
    let count = count as u32;
    if census.count(name) != count {
        census.set(name, count);
    }
}

fn record_demand(census: Res<Census>, mut report: ResMut<EffectReport>) {
    if census.is_changed() || report.get(EFFECT).is_none() {
        report.record(EFFECT, demand(&census));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectors_lights_and_a_camera_are_needed() {
        let mut census = Census::default();
        for name in [REFLECTORS, CAMERAS] {
            assert!(!demand(&census).needed);
            census.set(name, 1);
        }
        assert!(!demand(&census).needed, "no light");
        census.set(AREA_LIGHTS, 2);
        assert_eq!(
            demand(&census),
            Demand::needed("1 reflector may reflect 2 lights; occlusion: none")
        );
        census.set(REFLECTED_SKIES, 1);
        assert_eq!(
            demand(&census),
            Demand::needed("1 reflector may reflect 2 lights and the sky; occlusion: none")
        );
        census.set(AREA_LIGHTS, 0);
        assert_eq!(
            demand(&census),
            Demand::needed("1 reflector may reflect the sky; occlusion: none")
        );
        census.set(AREA_LIGHTS, 2);
        census.set(REFLECTED_SKIES, 0);
        census.set(SHADOWED_CAMERAS, 1);
        assert_eq!(
            demand(&census),
            Demand::needed("1 reflector may reflect 2 lights; occlusion: opaque meshes")
        );
        census.set(CAMERAS, 2);
        assert_eq!(occlusion(&census), "opaque meshes, none for some cameras");
        census.set(CAMERAS, 1);
        census.set(HIDING_TRIANGLES, 70_000);
        census.set(MOST_HIDING_TRIANGLES, 65_536);
        assert_eq!(
            occlusion(&census),
            "reflectors alone, since 70000 triangles are more than 65536"
        );
        census.set(REFLECTORS, 0);
        assert!(!demand(&census).needed);
    }
}
