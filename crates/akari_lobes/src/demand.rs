//! Whether any camera has a use for lobes.

use crate::EFFECT;
use akari_render::guides::NeedsGuides;
use akari_render::prelude::*;
use bevy::prelude::*;

/// Census entry: active cameras one of whose effects reads lobes.
pub const CAMERAS_WITH_GUIDES: &str = "cameras whose effects read lobes";

/// Systems of the main world.
pub(crate) fn build(app: &mut App) {
    app.add_systems(
        PostUpdate,
        (
            count_cameras.in_set(AkariSystems::Census),
            record_demand.in_set(AkariSystems::Demand),
        ),
    );
}

/// The demand: a pure function of the census.
pub fn demand(census: &Census) -> Demand {
    match census.count(CAMERAS_WITH_GUIDES) {
        0 => Demand::idle("no effect of an active camera reads lobes"),
        1 => Demand::needed("effects of 1 camera read lobes"),
        cameras => Demand::needed(format!("effects of {cameras} cameras read lobes")),
    }
}

fn count_cameras(cameras: Query<&Camera, With<NeedsGuides>>, mut census: ResMut<Census>) {
    // A handful of cameras: counting them costs less than finding out whether one of them changed.
    let active = cameras.iter().filter(|camera| camera.is_active).count() as u32;
    if census.count(CAMERAS_WITH_GUIDES) != active {
        census.set(CAMERAS_WITH_GUIDES, active);
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
    fn lobes_are_made_for_whoever_reads_them() {
        let mut census = Census::default();
        assert!(!demand(&census).needed);
        census.set(CAMERAS_WITH_GUIDES, 2);
        let demand = demand(&census);
        assert!(
            demand.needed && demand.reason.contains('2'),
            "{}",
            demand.reason
        );
    }
}
