//! What can be tried of the denoiser: by keys in a window, by arguments for a picture.
//!
//! The state stands in the window's title and is printed to the console with each change.

use crate::demo::{Restart, add_plugin};
use crate::stochastic::StochasticReflections;
use crate::unfiltered::{ShowUnfiltered, UnfilteredPlugin};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_akari::denoise::input::SignalScale;
use bevy_akari::prelude::*;
use bevy_akari::render::signals::MakesSignals;

/// Keys and title. The state is the resource [`Controls`]; with [`Tracing`], its keys are there, too.
pub struct ControlsPlugin {
    /// Name of the example, at the beginning of the title.
    pub name: &'static str,
}

/// The systems of [`ControlsPlugin`], in `Update`.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct ControlsSystems;

/// How the signal is filtered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// By a method of the denoiser.
    By(Method),
    /// Not at all.
    Off,
}

/// All filters, in the order of the key.
const FILTERS: [Filter; 6] = [
    Filter::By(Method::Guided),
    Filter::By(Method::Lobe),
    Filter::By(Method::Normal),
    Filter::By(Method::AxisAligned),
    Filter::By(Method::Distribution),
    Filter::Off,
];

/// No debug view and all debug views, in the order of the key.
const VIEWS: [Option<DenoiseDebugView>; 6] = [
    None,
    Some(DenoiseDebugView::LobeAxis),
    Some(DenoiseDebugView::LobeWidth),
    Some(DenoiseDebugView::Weights),
    Some(DenoiseDebugView::History),
    Some(DenoiseDebugView::Resampled),
];

const SCALES: [SignalScale; 3] = [SignalScale::Full, SignalScale::Half, SignalScale::Quarter];

/// What the denoiser is asked to do.
#[derive(Resource, Debug, Clone, Copy, PartialEq, clap::Args)]
pub struct Controls {
    /// guided, lobe, normal, axis-aligned, distribution, or off
    #[arg(long, value_name = "METHOD", default_value = "guided", value_parser = parse_filter)]
    pub method: Filter,
    /// a-trous, full or separable
    #[arg(long, value_name = "KERNEL", default_value = "a-trous", value_parser = parse_kernel)]
    pub kernel: Kernel,
    /// Keep no history: each frame stands for itself
    #[arg(long)]
    pub no_history: bool,
    /// Show the signal as it came in the left half of the picture
    #[arg(long)]
    pub split: bool,
    /// Debug view: lobe-axis, lobe-width, weights, history or resampled
    #[arg(long, value_name = "VIEW", value_parser = parse_view)]
    pub view: Option<DenoiseDebugView>,
    /// Pixel whose weights the debug view shows; in a window, the one under the mouse
    #[arg(long, value_name = "X,Y", value_parser = parse_cursor)]
    pub cursor: Option<Vec2>,
}

/// What [`StochasticReflections`] is asked to do.
#[derive(Resource, Debug, Clone, Copy, PartialEq, clap::Args)]
pub struct Tracing {
    /// Pixels per sample and axis: 1, 2 or 4
    #[arg(long, value_name = "PIXELS", default_value = "1", value_parser = parse_scale)]
    pub scale: SignalScale,
    /// Rays a sample; some hundred make a reference with --method off
    #[arg(long, value_name = "RAYS", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub samples: u32,
}

impl Default for Controls {
    fn default() -> Self {
        Self {
            method: Filter::By(Method::default()),
            kernel: Kernel::default(),
            no_history: false,
            split: false,
            view: None,
            cursor: None,
        }
    }
}

fn filter_name(filter: Filter) -> &'static str {
    match filter {
        Filter::By(Method::Guided) => "guided",
        Filter::By(Method::Lobe) => "lobe",
        Filter::By(Method::Normal) => "normal",
        Filter::By(Method::AxisAligned) => "axis-aligned",
        Filter::By(Method::Distribution) => "distribution",
        Filter::Off => "off",
    }
}

fn kernel_name(kernel: Kernel) -> &'static str {
    match kernel {
        Kernel::Full => "full",
        Kernel::Separable => "separable",
        Kernel::ATrous => "a-trous",
    }
}

fn view_name(view: Option<DenoiseDebugView>) -> &'static str {
    match view {
        None => "none",
        Some(DenoiseDebugView::LobeAxis) => "lobe-axis",
        Some(DenoiseDebugView::LobeWidth) => "lobe-width",
        Some(DenoiseDebugView::Weights) => "weights",
        Some(DenoiseDebugView::History) => "history",
        Some(DenoiseDebugView::Resampled) => "resampled",
    }
}

/// The one of `all` that has this name.
fn by_name<T: Copy>(all: &[T], name: impl Fn(T) -> &'static str, text: &str) -> Result<T, String> {
    all.iter()
        .copied()
        .find(|value| name(*value) == text)
        .ok_or_else(|| {
            let names: Vec<_> = all.iter().map(|value| name(*value)).collect();
            format!("there are {}", names.join(", "))
        })
}

fn parse_filter(text: &str) -> Result<Filter, String> {
    by_name(&FILTERS, filter_name, text)
}

fn parse_kernel(text: &str) -> Result<Kernel, String> {
    by_name(&Kernel::ALL, kernel_name, text)
}

fn parse_view(text: &str) -> Result<DenoiseDebugView, String> {
    let views = VIEWS.map(Option::unwrap_or_default);
    by_name(&views[1..], |view| view_name(Some(view)), text)
}

fn parse_scale(text: &str) -> Result<SignalScale, String> {
    let of = |scale: SignalScale| scale.pixels().to_string();
    SCALES
        .into_iter()
        .find(|scale| of(*scale) == text)
        .ok_or_else(|| format!("there are {}", SCALES.map(of).join(", ")))
}

/// Reads a pixel.
///
/// # Errors
/// If it is none.
pub fn parse_cursor(text: &str) -> Result<Vec2, String> {
    let parsed = text
        .split_once(',')
        .and_then(|(x, y)| Some(UVec2::new(x.parse().ok()?, y.parse().ok()?)));
    parsed
        .map(|pixel| pixel.as_vec2())
        .ok_or_else(|| "a pixel is two whole numbers with a comma between them".to_owned())
}

/// The one of `all` after this one, the first after the last.
fn next<T: Copy + PartialEq>(all: &[T], value: T) -> T {
    let at = all.iter().position(|other| *other == value);
    all[at.map_or(0, |at| (at + 1) % all.len())]
}

impl Controls {
    /// The denoiser's settings.
    pub fn settings(&self) -> Denoise {
        let mut settings = Denoise {
            kernel: self.kernel,
            ..default()
        };
        if let Filter::By(method) = self.method {
            settings.method = method;
        }
        if self.no_history {
            settings.history = 1;
        }
        settings
    }

    /// How much of the picture shows the signal as it came.
    pub fn unfiltered_share(&self) -> f32 {
        match (self.method, self.split) {
            (Filter::Off, _) => 1.0,
            (_, true) => 0.5,
            (_, false) => 0.0,
        }
    }

    fn press(&mut self, key: KeyCode) {
        match key {
            KeyCode::KeyM => self.method = next(&FILTERS, self.method),
            KeyCode::KeyK => self.kernel = next(&Kernel::ALL, self.kernel),
            KeyCode::KeyH => self.no_history ^= true,
            KeyCode::KeyS => self.split ^= true,
            KeyCode::KeyV => self.view = next(&VIEWS, self.view),
            _ => {}
        }
    }

    fn describe(&self) -> String {
        let switch = |on| if on { "on" } else { "off" };
        format!(
            "M: method {} | K: kernel {} | H: history {} | S: split {} | V: view {}",
            filter_name(self.method),
            kernel_name(self.kernel),
            switch(!self.no_history),
            switch(self.split),
            view_name(self.view),
        )
    }
}

impl Tracing {
    fn press(&mut self, key: KeyCode) {
        /// Rays at which the key starts again with one.
        const MOST_SAMPLES: u32 = 16;
        match key {
            KeyCode::KeyU => self.scale = next(&SCALES, self.scale),
            KeyCode::KeyN if self.samples >= MOST_SAMPLES => self.samples = 1,
            KeyCode::KeyN => self.samples *= 4,
            _ => {}
        }
    }

    fn describe(&self) -> String {
        format!(
            " | U: 1/{} of the resolution | N: {} rays",
            self.scale.pixels(),
            self.samples
        )
    }
}

/// Name of the example, for the title.
#[derive(Resource)]
struct TitleName(&'static str);

impl Plugin for ControlsPlugin {
    fn build(&self, app: &mut App) {
        add_plugin(app, UnfilteredPlugin);
        app.init_resource::<Controls>()
            .insert_resource(TitleName(self.name))
            .add_systems(
                Update,
                (
                    read_keys.run_if(resource_exists::<ButtonInput<KeyCode>>),
                    apply_controls.run_if(resource_changed::<Controls>),
                    apply_tracing.run_if(resource_exists_and_changed::<Tracing>),
                    follow_mouse,
                    write_title.run_if(
                        resource_changed::<Controls>
                            .or_else(resource_exists_and_changed::<Tracing>),
                    ),
                )
                    .chain()
                    .in_set(ControlsSystems),
            );
    }
}

fn read_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut controls: ResMut<Controls>,
    tracing: Option<ResMut<Tracing>>,
    mut commands: Commands,
    mut exit: MessageWriter<AppExit>,
) {
    let mut changed = *controls;
    let mut traced = tracing.as_deref().copied();
    for key in keys.get_just_pressed() {
        changed.press(*key);
        if let Some(traced) = &mut traced {
            traced.press(*key);
        }
        match key {
            KeyCode::Backspace => commands.trigger(Restart),
            KeyCode::Escape => {
                exit.write(AppExit::Success);
            }
            _ => {}
        }
    }
    controls.set_if_neq(changed);
    if let (Some(mut tracing), Some(traced)) = (tracing, traced) {
        tracing.set_if_neq(traced);
    }
}

fn apply_controls(
    controls: Res<Controls>,
    cameras: Query<Entity, With<MakesSignals>>,
    mut commands: Commands,
) {
    for camera in &cameras {
        let mut camera = commands.entity(camera);
        camera.insert(controls.settings());
        match controls.unfiltered_share() {
            0.0 => camera.remove::<ShowUnfiltered>(),
            share => camera.insert(ShowUnfiltered { share }),
        };
        match controls.view {
            None => camera.remove::<DenoiseDebug>(),
            Some(view) => camera.insert(DenoiseDebug {
                view,
                // Where no mouse has been yet, nowhere.
                cursor: controls.cursor.unwrap_or(Vec2::NEG_ONE),
            }),
        };
    }
}

fn apply_tracing(tracing: Res<Tracing>, mut cameras: Query<&mut StochasticReflections>) {
    for mut reflections in &mut cameras {
        reflections.scale = tracing.scale;
        reflections.samples = tracing.samples;
    }
}

fn follow_mouse(windows: Query<&Window, With<PrimaryWindow>>, mut views: Query<&mut DenoiseDebug>) {
    let Some(cursor) = windows.iter().find_map(Window::physical_cursor_position) else {
        return;
    };
    for mut view in &mut views {
        view.cursor = cursor;
    }
}

fn write_title(
    name: Res<TitleName>,
    controls: Res<Controls>,
    tracing: Option<Res<Tracing>>,
    mut windows: Query<&mut Window>,
) {
    let tracing = tracing.map_or_else(String::new, |tracing| tracing.describe());
    let state = format!("{}{tracing}", controls.describe());
    for mut window in &mut windows {
        println!("{state}");
        window.title = format!("Akari {} | {state}", name.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_back() {
        for filter in FILTERS {
            assert_eq!(parse_filter(filter_name(filter)), Ok(filter));
        }
        for kernel in Kernel::ALL {
            assert_eq!(parse_kernel(kernel_name(kernel)), Ok(kernel));
        }
        for view in VIEWS.into_iter().flatten() {
            assert_eq!(parse_view(view_name(Some(view))), Ok(view));
        }
        for scale in SCALES {
            assert_eq!(parse_scale(&scale.pixels().to_string()), Ok(scale));
        }
        assert_eq!(parse_cursor("12,7"), Ok(Vec2::new(12.0, 7.0)));
        let error = parse_filter("bilateral").expect_err("there is no such method");
        assert!(
            error.contains("axis-aligned") && error.contains("off"),
            "{error}"
        );
        for bad in ["none", "", "LobeAxis"] {
            assert!(parse_view(bad).is_err(), "{bad}");
        }
        for bad in ["3", "", "1/2"] {
            assert!(parse_scale(bad).is_err(), "{bad}");
        }
        for bad in ["", "5", "5,", "-1,2", "1.5,2"] {
            assert!(parse_cursor(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_key_goes_through_all_values_and_comes_back() {
        let mut controls = Controls::default();
        let mut seen = Vec::new();
        for _ in FILTERS {
            seen.push(filter_name(controls.method));
            controls.press(KeyCode::KeyM);
        }
        assert_eq!(controls, Controls::default());
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), FILTERS.len());
        controls.press(KeyCode::KeyH);
        assert_eq!(controls.settings().history, 1);
        assert!(Controls::default().settings().history > 1);
    }

    #[test]
    fn switched_off_shows_the_signal_as_it_came() {
        let mut controls = Controls::default();
        assert_eq!(controls.unfiltered_share(), 0.0);
        controls.split = true;
        assert_eq!(controls.unfiltered_share(), 0.5);
        controls.method = Filter::Off;
        assert_eq!(controls.unfiltered_share(), 1.0);
    }
}
