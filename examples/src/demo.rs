//! An example that is a window or a picture: one set of plugins for both.

use crate::orbit::{Orbit, turn_orbits};
use crate::{Picture, attach, exit_code, numbered, save, start_headless};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy::window::WindowResolution;
use bevy_akari::headless::{Headless, HeadlessTarget};
use bevy_akari::prelude::*;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Everything begins anew: what moves is where it started, histories are forgotten.
#[derive(Event, Debug, Clone, Copy)]
pub struct Restart;

/// Adds a plugin that needs no `finish`, to any app: a headless one has been finished when it is handed out, and then
/// `App::add_plugins` refuses.
pub fn add_plugin(app: &mut App, plugin: impl Plugin) {
    plugin.build(app);
}

/// Window or picture.
#[derive(Debug, Clone, PartialEq, clap::Args)]
pub struct Demo {
    /// Draw one picture to a file instead of opening a window
    #[arg(long)]
    pub headless: bool,
    #[command(flatten)]
    picture: Picture,
    /// Frames up to the picture, at 60 a second
    #[arg(long, value_name = "COUNT", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: u32,
    /// Draw each of the frames to a file of its own, numbered
    #[arg(long)]
    pub each: bool,
    /// Turn the camera by so many degrees in each frame of the picture
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub turn: f32,
}

impl Demo {
    /// Runs the app that `build` makes, with a camera that has [`Orbit`].
    pub fn run(&self, name: &str, build: impl FnOnce(&mut App)) -> ExitCode {
        self.try_run(name, |app| {
            build(app);
            Ok(())
        })
    }

    /// The same for an app that may fail to be made.
    pub fn try_run(
        &self,
        name: &str,
        build: impl FnOnce(&mut App) -> Result<(), Box<dyn Error>>,
    ) -> ExitCode {
        exit_code(if self.draws_to_file() {
            self.draw(name, build)
        } else {
            self.open_window(build)
        })
    }

    /// Whether there will be a picture instead of a window.
    #[must_use]
    pub fn draws_to_file(&self) -> bool {
        self.headless || self.picture.out.is_some() || cfg!(not(feature = "window"))
    }

    fn draw(
        &self,
        name: &str,
        build: impl FnOnce(&mut App) -> Result<(), Box<dyn Error>>,
    ) -> Result<(), Box<dyn Error>> {
        const FRAMES_PER_SECOND: f64 = 60.0;
        let mut headless = start_headless()?;
        let frame_time = Duration::from_secs_f64(1.0 / FRAMES_PER_SECOND);
        headless
            .app
            .insert_resource(TimeUpdateStrategy::ManualDuration(frame_time));
        build(&mut headless.app)?;
        let camera = Self::wait_for_camera(&mut headless)?;
        attach(&mut headless, camera, self.picture.size)?;
        headless.step_until_ready()?;
        headless.app.world_mut().trigger(Restart);
        let default_out = PathBuf::from(format!("{name}.png"));
        let out: &Path = self.picture.out.as_deref().unwrap_or(&default_out);
        for frame in 0..self.frames {
            headless.step()?;
            if let Some(AppExit::Error(_)) = headless.app.should_exit() {
                return Err("the app stopped; the log above says why".into());
            }
            let last = frame + 1 == self.frames;
            if self.each || last {
                let image = headless
                    .app
                    .world()
                    .get::<HeadlessTarget>(camera)
                    .map(|target| target.image.clone())
                    .ok_or("the camera draws into no image")?;
                let image = headless.read_image(&image)?;
                if self.each {
                    save(&image, &numbered(out, frame))?;
                } else {
                    save(&image, out)?;
                }
            }
            if self.turn != 0.0
                && let Ok(mut camera) = headless.app.world_mut().get_entity_mut(camera)
                && let Some(mut orbit) = camera.get_mut::<Orbit>()
            {
                orbit.change(Vec2::new(self.turn.to_radians(), 0.0), 0.0);
                let view = orbit.view();
                camera.insert(view);
            }
        }
        println!("{}: drawn on {}", out.display(), headless.adapter());
        Ok(())
    }

    /// Start-up systems spawn the camera, or a scene file that they load brings it.
    fn wait_for_camera(headless: &mut Headless) -> Result<Entity, Box<dyn Error>> {
        /// Far beyond what a scene of the repository takes.
        const MOST_FRAMES: u32 = 10_000;
        for _ in 0..MOST_FRAMES {
            headless.step()?;
            if let Some(AppExit::Error(_)) = headless.app.should_exit() {
                return Err("the app stopped; the log above says why".into());
            }
            let world = headless.app.world_mut();
            let camera = world
                .query_filtered::<Entity, (With<Camera3d>, With<Orbit>)>()
                .iter(world)
                .next();
            if let Some(camera) = camera {
                return Ok(camera);
            }
        }
        Err("the scene has no camera".into())
    }

    fn open_window(
        &self,
        build: impl FnOnce(&mut App) -> Result<(), Box<dyn Error>>,
    ) -> Result<(), Box<dyn Error>> {
        // The examples are built with X11 only.
        if cfg!(target_os = "linux") && std::env::var_os("DISPLAY").is_none() {
            return Err("there is no display; --headless --out FILE.png draws to a file".into());
        }
        let size = self.picture.size;
        let mut app = App::new();
        app.add_plugins((
            DefaultPlugins.set(WindowPlugin {
                primary_window: Some(Window {
                    resolution: WindowResolution::new(size.x, size.y),
                    ..default()
                }),
                ..default()
            }),
            AkariPlugins,
        ))
        .add_systems(Update, turn_orbits);
        build(&mut app)?;
        match app.run() {
            AppExit::Success => Ok(()),
            AppExit::Error(_) => Err("the app stopped; the log above says why".into()),
        }
    }
}
