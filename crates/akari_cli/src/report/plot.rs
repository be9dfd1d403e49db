//! Error over time as an SVG picture: both axes logarithmic, each knob a colour, the front a line.

use super::document::{Curve, Point};
use std::fmt::Write;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 380.0;
/// Room for the numbers and names of the axes.
const LEFT: f64 = 66.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 48.0;
/// Smallest figure that is drawn: nothing lies at 0 on a logarithmic axis.
const SMALLEST: f64 = 1e-9;
/// Colours of the knobs, in turns; chosen to differ in lightness as well (after Okabe and Ito 2008).
const COLORS: [&str; 7] = [
    "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#8a8a00",
];

/// A logarithmic axis over all figures, with some room at both ends.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(figures: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for figure in figures.filter(|figure| figure.is_finite()) {
            let log = figure.max(SMALLEST).log10();
            low = low.min(log);
            high = high.max(log);
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        // A third of a decade at least: equal figures would leave nothing to divide by.
        let room = (0.08 * (high - low)).max(0.17 - 0.5 * (high - low));
        Self {
            low: low - room,
            high: high + room,
            from,
            to,
        }
    }

    /// Where a figure lies; what is no number, at the far end.
    fn place(&self, figure: f64) -> f64 {
        if !figure.is_finite() {
            return self.to;
        }
        let share = (figure.max(SMALLEST).log10() - self.low) / (self.high - self.low);
        self.from + share.clamp(0.0, 1.0) * (self.to - self.from)
    }

    /// Powers of ten; over few decades 2 and 5 of each as well, within one decade more.
    fn ticks(&self) -> Vec<f64> {
        let decades = self.high - self.low;
        let steps: &[f64] = if decades > 2.5 {
            &[1.0]
        } else if decades > 0.7 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
        };
        let mut ticks = Vec::new();
        for power in self.low.floor() as i32..=self.high.ceil() as i32 {
            for step in steps {
                let figure = step * 10f64.powi(power);
                if (self.low..=self.high).contains(&figure.log10()) {
                    ticks.push(figure);
                }
            }
        }
        ticks
    }
}

/// A figure with two digits that count.
pub fn figure(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = 1 - value.abs().log10().floor() as i32;
    format!("{value:.*}", digits.clamp(0, 9) as usize)
}

/// Text within markup.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// The knobs of a curve in the order in which they appear.
fn knobs(curve: &Curve) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for point in &curve.points {
        if let Some(knob) = &point.knob
            && !names.contains(&knob.as_str())
        {
            names.push(knob);
        }
    }
    names
}

fn color(knobs: &[&str], point: &Point) -> &'static str {
    let place = point
        .knob
        .as_deref()
        .and_then(|knob| knobs.iter().position(|name| *name == knob));
    place.map_or("currentColor", |place| COLORS[place % COLORS.len()])
}

/// Where the names of presets stand: those that would lie on one another share a line.
fn preset_labels(curve: &Curve, at: impl Fn(&Point) -> (f64, f64)) -> Vec<(f64, f64, String)> {
    /// Width of a name and height of a line.
    const ROOM: (f64, f64) = (60.0, 14.0);
    let mut labels: Vec<(f64, f64, String)> = Vec::new();
    for point in &curve.points {
        let Some(preset) = &point.preset else {
            continue;
        };
        let (x, y) = at(point);
        let near = labels
            .iter_mut()
            .find(|label| (label.0 - x).abs() < ROOM.0 && (label.1 - y).abs() < ROOM.1);
        match near {
            Some(label) => {
                label.2.push_str(", ");
                label.2.push_str(preset);
            }
            None => labels.push((x, y, preset.clone())),
        }
    }
    labels
}

/// The picture.
pub fn scatter(curve: &Curve) -> String {
    let times = Axis::new(curve.points.iter().map(Point::cost_ms), LEFT, WIDTH - RIGHT);
    let errors = Axis::new(
        curve
            .points
            .iter()
            .map(|point| 100.0 * point.error.rel_rmse),
        HEIGHT - BOTTOM,
        TOP,
    );
    let at = |point: &Point| {
        (
            times.place(point.cost_ms()),
            errors.place(100.0 * point.error.rel_rmse),
        )
    };
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"error over time of {} on {}\">",
        escape(&curve.effect),
        escape(&curve.scene)
    );
    let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
    // Writing into a string cannot fail.
    for tick in times.ticks() {
        let x = times.place(tick);
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\"/><text x=\"{x:.1}\" y=\"{:.1}\" \
             text-anchor=\"middle\">{}</text>",
            bottom + 16.0,
            figure(tick)
        );
    }
    for tick in errors.ticks() {
        let y = errors.place(tick);
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\" \
             text-anchor=\"end\">{}</text>",
            LEFT - 6.0,
            y + 4.0,
            figure(tick)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">milliseconds</text><text transform=\"translate(14 {:.1}) \
         rotate(-90)\" text-anchor=\"middle\">relative RMSE, %</text>",
        0.5 * (LEFT + right),
        HEIGHT - 8.0,
        0.5 * (TOP + bottom)
    );
    if let Some(noise) = curve.reference.noise {
        let y = errors.place(100.0 * noise);
        if y < bottom {
            let _ = write!(
                svg,
                "<line class=\"noise\" x1=\"{LEFT}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\"><title>noise of the \
                 reference: {} %</title></line>",
                figure(100.0 * noise)
            );
        }
    }
    let front: Vec<String> = super::page::front_by_time(curve)
        .into_iter()
        .map(|point| {
            let (x, y) = at(point);
            format!("{x:.1},{y:.1}")
        })
        .collect();
    let _ = write!(
        svg,
        "<polyline class=\"front\" points=\"{}\"/>",
        front.join(" ")
    );
    let knobs = knobs(curve);
    for point in &curve.points {
        let (x, y) = at(point);
        let title = format!(
            "{}: {} ms, {} %",
            point.label,
            figure(point.cost_ms()),
            figure(100.0 * point.error.rel_rmse)
        );
        let radius = if point.preset.is_some() { 6.0 } else { 4.0 };
        let filled = if point.on_front {
            ""
        } else {
            " class=\"beaten\""
        };
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{0}\" stroke=\"{0}\"{filled}><title>{1}</title></circle>",
            color(&knobs, point),
            escape(&title)
        );
    }
    for (x, y, names) in preset_labels(curve, at) {
        /// Most that a letter of a name takes.
        const LETTER: f64 = 7.5;
        // To the left of its point where there is no room to the right.
        let leaves = x + 8.0 + LETTER * names.len() as f64 > WIDTH;
        let (shift, anchor) = if leaves {
            (-8.0, "end")
        } else {
            (8.0, "start")
        };
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
            x + shift,
            y - 6.0,
            escape(&names)
        );
    }
    svg.push_str("</svg>");
    let mut legend = String::from("<p class=\"legend\"><span>&#9679; preset</span>");
    for (i, knob) in knobs.iter().enumerate() {
        let _ = write!(
            legend,
            "<span style=\"color:{}\">&#9679; {}</span>",
            COLORS[i % COLORS.len()],
            escape(knob)
        );
    }
    legend.push_str("<span>filled: on the front</span></p>");
    svg + &legend
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_two_digits() {
        for (value, text) in [
            (0.0, "0"),
            (123.4, "123"),
            (12.34, "12"),
            (1.26, "1.3"),
            (0.0126, "0.013"),
            (1e-12, "0.000000000"),
        ] {
            assert_eq!(figure(value), text);
        }
    }

    #[test]
    fn axes_hold_all_figures_and_have_ticks() {
        for figures in [
            vec![1.0],
            vec![3.0, 3.0],
            vec![0.01, 900.0],
            vec![0.0, 5.0],
            vec![f64::NAN],
            vec![],
        ] {
            let axis = Axis::new(figures.iter().copied(), 10.0, 110.0);
            for figure in figures {
                let x = axis.place(figure);
                assert!((10.0..=110.0).contains(&x), "{figure}: {x}");
            }
            assert!(!axis.ticks().is_empty());
        }
        let axis = Axis::new([1.0, 100.0].into_iter(), 0.0, 1.0);
        assert!(axis.place(1.0) < axis.place(10.0) && axis.place(10.0) < axis.place(100.0));
    }
}
