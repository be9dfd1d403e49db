//! Debug views: what the denoiser sees and does, drawn over the picture.

use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;

/// What is drawn.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Debug, Clone, PartialEq)]
pub enum DenoiseDebugView {
    /// Axis of the lobe, from -1..1 to 0..1.
    #[default]
    LobeAxis,
    /// Width of the lobe, √(1 / (1 + sharpness)): black for a mirror, white for a uniform lobe.
    LobeWidth,
    /// Weights of the first stage around the cursor's pixel, in red; the pixel itself in green.
    Weights,
    /// Frames of history, black for none, white for the longest.
    History,
    /// The picture with the pixels that were shaded again in red.
    Resampled,
}

impl DenoiseDebugView {
    pub(crate) fn shader_def(self) -> &'static str {
        match self {
            Self::LobeAxis => "VIEW_LOBE_AXIS",
            Self::LobeWidth => "VIEW_LOBE_WIDTH",
            Self::Weights => "VIEW_WEIGHTS",
            Self::History => "VIEW_HISTORY",
            Self::Resampled => "VIEW_RESAMPLED",
        }
    }
}

/// On a camera with signals: draws a debug view instead of the picture. Tonemapping still follows.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct DenoiseDebug {
    /// What is drawn.
    pub view: DenoiseDebugView,
    /// Position of the cursor in physical pixels of the target, from its upper left corner.
    pub cursor: Vec2,
}

/// The same in the render world.
#[derive(Component, Debug, Clone, Copy)]
pub struct ViewDenoiseDebug {
    /// What is drawn.
    pub view: DenoiseDebugView,
    /// Position of the cursor.
    pub cursor: Vec2,
}

pub(crate) fn extract_debug_views(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, &DenoiseDebug)>>,
    marked: Query<Entity, With<ViewDenoiseDebug>>,
) {
    let mut wanted = Vec::new();
    for (view, debug) in &cameras {
        wanted.push(view);
        commands.entity(view).insert(ViewDenoiseDebug {
            view: debug.view,
            cursor: debug.cursor,
        });
    }
    for view in &marked {
        if !wanted.contains(&view) {
            commands.entity(view).remove::<ViewDenoiseDebug>();
        }
    }
}
