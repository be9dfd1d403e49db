//! A camera that turns around a point: drag with the left mouse button or press the arrow keys to turn, use the wheel
//! to come closer.

use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;

/// Turns the camera that it is on around `focus`, in the frame of the camera's parent.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
pub struct Orbit {
    /// The point that the camera looks at.
    pub focus: Vec3,
    /// From the camera to that point, in metres.
    pub distance: f32,
    /// Angle around the vertical axis, in radians; 0 looks along −Z.
    pub yaw: f32,
    /// Angle above the horizon, in radians.
    pub pitch: f32,
}

/// Radians for a drag by one pixel.
const TURN_PER_PIXEL: f32 = 0.005;
/// Radians in a second while an arrow key is held.
const TURN_PER_SECOND: f32 = 0.8;
/// A step of the wheel changes the logarithm of the distance by this.
const ZOOM_PER_LINE: f32 = 0.1;
/// The camera stays on or above the horizon of its focus, and off the pole, where up is no longer up.
const PITCH: (f32, f32) = (0.0, 1.5);
/// Metres; the lower end keeps the near plane away from what is looked at.
const DISTANCE: (f32, f32) = (1.0, 100.0);

impl Orbit {
    /// Starts where the camera is, around the point of its line of sight that is next to the origin.
    pub fn from_view(view: &Transform) -> Self {
        let back = view.back();
        let distance = view.translation.dot(*back).clamp(DISTANCE.0, DISTANCE.1);
        Self {
            focus: view.translation - back * distance,
            distance,
            yaw: back.x.atan2(back.z),
            pitch: back.y.clamp(-1.0, 1.0).asin(),
        }
    }

    /// Where the camera is.
    pub fn view(&self) -> Transform {
        let rotation = Quat::from_euler(EulerRot::YXZ, self.yaw, -self.pitch, 0.0);
        let back = rotation * Vec3::Z;
        Transform::from_translation(self.focus + back * self.distance).with_rotation(rotation)
    }

    /// Turns by these angles in radians and brings the focus closer by the factor e^`zoom`.
    pub fn change(&mut self, turn: Vec2, zoom: f32) {
        self.yaw += turn.x;
        self.pitch = (self.pitch + turn.y).clamp(PITCH.0, PITCH.1);
        self.distance = (self.distance * (-zoom).exp()).clamp(DISTANCE.0, DISTANCE.1);
    }
}

/// Moves every [`Orbit`] as mouse and keyboard say.
pub fn turn_orbits(
    buttons: Res<ButtonInput<MouseButton>>,
    keys: Res<ButtonInput<KeyCode>>,
    motion: Res<AccumulatedMouseMotion>,
    scroll: Res<AccumulatedMouseScroll>,
    time: Res<Time>,
    mut orbits: Query<(&mut Orbit, &mut Transform)>,
) {
    let held = |less, more| {
        f32::from(u8::from(keys.pressed(more))) - f32::from(u8::from(keys.pressed(less)))
    };
    let arrows = Vec2::new(
        held(KeyCode::ArrowLeft, KeyCode::ArrowRight),
        held(KeyCode::ArrowDown, KeyCode::ArrowUp),
    );
    let mut turn = arrows * TURN_PER_SECOND * time.delta_secs();
    if buttons.pressed(MouseButton::Left) {
        // The scene follows the mouse: to the right of the screen means that the camera goes left.
        turn += Vec2::new(-motion.delta.x, motion.delta.y) * TURN_PER_PIXEL;
    }
    let lines = match scroll.unit {
        MouseScrollUnit::Line => scroll.delta.y,
        MouseScrollUnit::Pixel => scroll.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
    };
    // Untouched, the camera stays exactly where the scene put it.
    if turn == Vec2::ZERO && lines == 0.0 {
        return;
    }
    for (mut orbit, mut transform) in &mut orbits {
        orbit.change(turn, lines * ZOOM_PER_LINE);
        *transform = orbit.view();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_orbit_starts_where_the_camera_is() {
        for (eye, target) in [
            (Vec3::new(0.0, 2.5, 8.4), Vec3::new(0.0, 0.8, 0.0)),
            (Vec3::new(-3.0, 0.5, -2.0), Vec3::new(1.0, 0.2, 0.3)),
        ] {
            let camera = Transform::from_translation(eye).looking_at(target, Vec3::Y);
            let orbit = Orbit::from_view(&camera);
            let view = orbit.view();
            assert!(view.translation.abs_diff_eq(eye, 1e-5), "{view:?}");
            assert!(
                view.forward().abs_diff_eq(*camera.forward(), 1e-5),
                "{view:?}"
            );
            assert!(view.up().abs_diff_eq(*camera.up(), 1e-5), "{view:?}");
        }
    }

    #[test]
    fn a_turned_camera_still_looks_at_the_focus() {
        let mut orbit =
            Orbit::from_view(&Transform::from_xyz(0.0, 2.0, 6.0).looking_at(Vec3::ZERO, Vec3::Y));
        let focus = orbit.focus;
        for turn in [
            Vec2::new(1.0, 0.2),
            Vec2::new(-7.0, 9.0),
            Vec2::new(0.3, -9.0),
        ] {
            orbit.change(turn, 0.5);
            let view = orbit.view();
            let towards = (focus - view.translation).normalize();
            assert!(view.forward().abs_diff_eq(towards, 1e-5), "{orbit:?}");
            assert!(
                view.up().y > 0.0 && view.translation.y >= focus.y - 1e-5,
                "{view:?}"
            );
        }
        orbit.change(Vec2::ZERO, f32::MAX);
        assert_eq!(orbit.distance, DISTANCE.0);
    }

    #[test]
    fn to_turn_right_moves_the_camera_right() {
        let mut orbit = Orbit::from_view(&Transform::from_xyz(0.0, 0.0, 5.0));
        orbit.change(Vec2::new(0.1, 0.0), 0.0);
        assert!(orbit.view().translation.x > 0.0);
        orbit.change(Vec2::new(0.0, 0.1), 0.0);
        assert!(orbit.view().translation.y > 0.0);
    }
}
