//! The summary as text over the picture.

use super::summary::AkariSummary;
use crate::budget::{BudgetLog, FrameBudget, own_pass_times};
use crate::settings::AkariSettings;
use akari_render::camera::AkariCamera;
use akari_render::demand::EffectReport;
use akari_render::ledger::GpuLedger;
use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;

/// Measures what the effects cost, and shows it.
///
/// Adds Bevy's `RenderDiagnosticsPlugin` if it is not there.
#[derive(Debug, Default, Clone, Copy)]
pub struct AkariDiagnosticsPlugin;

/// The text over the picture. Absent from the world while it is off.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct AkariOverlay {
    /// Whether it is shown.
    pub visible: bool,
    /// The key that shows and hides it, if any.
    pub key: Option<KeyCode>,
    /// Frames between two looks at the figures, at least 1.
    pub refresh_frames: u32,
    /// Height of its letters, logical pixels.
    pub font_size: f32,
}

impl Default for AkariOverlay {
    fn default() -> Self {
        Self {
            visible: true,
            key: Some(KeyCode::F3),
            // A quarter of a second at 60 Hz: figures that can be read.
            refresh_frames: 15,
            font_size: 12.0,
        }
    }
}

/// The text's entity.
#[derive(Component)]
struct OverlayText;

impl Plugin for AkariDiagnosticsPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<RenderDiagnosticsPlugin>() {
            app.add_plugins(RenderDiagnosticsPlugin);
        }
        app.register_type::<AkariOverlay>()
            .register_type::<AkariSummary>()
            .init_resource::<AkariOverlay>()
            .init_resource::<AkariSummary>()
            // After the effects' demand, which is told in `PostUpdate`.
            .add_systems(Last, (toggle_overlay, write_summary, show_overlay).chain());
    }
}

fn toggle_overlay(keys: Option<Res<ButtonInput<KeyCode>>>, mut overlay: ResMut<AkariOverlay>) {
    let pressed = overlay
        .key
        .zip(keys)
        .is_some_and(|(key, keys)| keys.just_pressed(key));
    if pressed {
        overlay.visible = !overlay.visible;
    }
}

fn write_summary(world: &mut World, mut frames: Local<u32>) {
    let every = world.resource::<AkariOverlay>().refresh_frames.max(1);
    let due = frames.is_multiple_of(every);
    *frames = frames.wrapping_add(1);
    if !due {
        return;
    }
    let (Some(report), Some(ledger)) = (
        world.get_resource::<EffectReport>(),
        world.get_resource::<GpuLedger>(),
    ) else {
        return;
    };
    let times = world
        .get_resource::<DiagnosticsStore>()
        .map_or_else(Vec::new, own_pass_times);
    let summary = AkariSummary::new(report, ledger, &times, &AkariSettings::of_world(world))
        .with_budget(
            world.get_resource::<FrameBudget>(),
            world.get_resource::<BudgetLog>(),
        );
    world.resource_mut::<AkariSummary>().set_if_neq(summary);
}

/// The camera that the text is drawn over: the last active one that asks for effects. Else Bevy chooses, which takes none
/// that draws into an image.
fn overlaid_camera(cameras: &Query<(Entity, &Camera), With<AkariCamera>>) -> Option<Entity> {
    cameras
        .iter()
        .filter(|(_, camera)| camera.is_active)
        .max_by_key(|(_, camera)| camera.order)
        .map(|(entity, _)| entity)
}

fn show_overlay(
    mut commands: Commands,
    cameras: Query<(Entity, &Camera), With<AkariCamera>>,
    targets: Query<&UiTargetCamera>,
    overlay: Res<AkariOverlay>,
    summary: Res<AkariSummary>,
    mut texts: Query<(Entity, &mut Text, &mut TextFont), With<OverlayText>>,
    roots: Query<&ChildOf>,
) {
    let Ok((entity, mut text, mut font)) = texts.single_mut() else {
        if overlay.visible {
            spawn_overlay(&mut commands, &overlay, &summary);
        }
        return;
    };
    let root = roots.get(entity).map_or(entity, ChildOf::parent);
    if !overlay.visible {
        commands.entity(root).despawn();
        return;
    }
    let present = targets.get(root).ok().map(|target| target.0);
    match overlaid_camera(&cameras) {
        wanted if wanted == present => {}
        Some(camera) => {
            commands.entity(root).insert(UiTargetCamera(camera));
        }
        None => {
            commands.entity(root).remove::<UiTargetCamera>();
        }
    }
    if summary.is_changed() {
        text.0 = summary.to_string();
    }
    if overlay.is_changed() {
        font.font_size = overlay.font_size.into();
    }
}

fn spawn_overlay(commands: &mut Commands, overlay: &AkariOverlay, summary: &AkariSummary) {
    /// Between the text and the edges of its ground, and of the window, logical pixels.
    const MARGIN: Val = Val::Px(6.0);
    /// Dark enough to read white letters before any scene.
    const GROUND: Color = Color::linear_rgba(0.0, 0.0, 0.0, 0.7);
    commands.spawn((
        Name::new("akari overlay"),
        Node {
            position_type: PositionType::Absolute,
            left: MARGIN,
            top: MARGIN,
            padding: UiRect::all(MARGIN),
            ..default()
        },
        BackgroundColor(GROUND),
        GlobalZIndex(i32::MAX),
        children![(
            OverlayText,
            Text::new(summary.to_string()),
            TextFont::from_font_size(overlay.font_size),
            TextColor(Color::WHITE),
            TextLayout::no_wrap(),
        )],
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_key_shows_and_hides_it() {
        let mut app = App::new();
        app.init_resource::<AkariOverlay>()
            .init_resource::<ButtonInput<KeyCode>>()
            .add_systems(Last, toggle_overlay);
        let mut press = |key: KeyCode| {
            let mut keys = app.world_mut().resource_mut::<ButtonInput<KeyCode>>();
            keys.reset_all();
            keys.press(key);
            app.update();
            let after_press = app.world().resource::<AkariOverlay>().visible;
            // Held down, it does nothing more.
            let mut keys = app.world_mut().resource_mut::<ButtonInput<KeyCode>>();
            keys.clear();
            app.update();
            assert_eq!(app.world().resource::<AkariOverlay>().visible, after_press);
            after_press
        };
        assert!(press(KeyCode::F4), "another key");
        assert!(!press(KeyCode::F3));
        assert!(press(KeyCode::F3));
        // Without a key, and without a keyboard, it stays as it is.
        app.world_mut().resource_mut::<AkariOverlay>().key = None;
        app.world_mut()
            .resource_mut::<ButtonInput<KeyCode>>()
            .press(KeyCode::F3);
        app.update();
        app.world_mut().remove_resource::<ButtonInput<KeyCode>>();
        app.update();
        assert!(app.world().resource::<AkariOverlay>().visible);
    }
}
