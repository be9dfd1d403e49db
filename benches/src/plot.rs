//! Plots of errors against time, as SVG.

use std::fmt::Write;

/// Size of a panel and of the margins around it, in pixels.
const PANEL: [f64; 2] = [330.0, 300.0];
const MARGIN: f64 = 62.0;
/// Colours that stay apart for most kinds of colour blindness (Okabe, Ito 2008).
const COLORS: [&str; 4] = ["#d55e00", "#009e73", "#0072b2", "#cc79a7"];

/// One way to compute something, at several settings.
#[derive(Clone, Debug)]
pub struct Series {
    name: String,
    points: Vec<Point>,
}

/// A setting: largest and mean error, and what it costs.
#[derive(Clone, Debug)]
struct Point {
    label: String,
    cpu: f64,
    gpu: Option<f64>,
    errors: [f64; 2],
}

impl Series {
    /// A series without points.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            points: Vec::new(),
        }
    }

    /// Adds a setting: nanoseconds on the CPU, largest and mean error, nanoseconds on the GPU if known.
    pub fn push(&mut self, label: String, cpu: f64, errors: [f64; 2], gpu: Option<f64>) {
        self.points.push(Point {
            label,
            cpu,
            gpu,
            errors,
        });
    }
}

/// Logarithmic axis from one power of ten to another.
struct Axis {
    lo: f64,
    hi: f64,
}

impl Axis {
    fn around(values: impl Iterator<Item = f64>) -> Self {
        let (lo, hi) = values
            .filter(|v| *v > 0.0)
            .fold((f64::INFINITY, 0.0), |(lo, hi), v| {
                (f64::min(lo, v), f64::max(hi, v))
            });
        if lo > hi {
            return Self { lo: 0.0, hi: 1.0 };
        }
        // Half decades are fine enough for times, which span less than two.
        Self {
            lo: (2.0 * lo.log10() - 0.1).floor() / 2.0,
            hi: (2.0 * hi.log10() + 0.1).ceil() / 2.0,
        }
    }

    fn place(&self, value: f64) -> f64 {
        (value.max(1e-300).log10() - self.lo) / (self.hi - self.lo)
    }

    fn ticks(&self) -> impl Iterator<Item = f64> {
        let range = self.lo.floor() as i32..=self.hi.ceil() as i32;
        let few = self.hi - self.lo < 3.0;
        let steps: &[f64] = if few { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let (lo, hi) = (self.lo - 1e-9, self.hi + 1e-9);
        range
            .flat_map(move |power| steps.iter().map(move |step| step * 10.0_f64.powi(power)))
            .filter(move |tick| (lo..=hi).contains(&tick.log10()))
    }
}

/// Panels of the largest and the mean error over the time on the GPU, where it is known, and on the CPU.
#[must_use]
pub fn error_against_time(title: &str, adapter: &str, series: &[Series]) -> String {
    let has_gpu = series
        .iter()
        .any(|s| s.points.iter().any(|p| p.gpu.is_some()));
    let times: &[(&str, fn(&Point) -> Option<f64>)] = if has_gpu {
        &[("GPU", |p| p.gpu), ("CPU", |p| Some(p.cpu))]
    } else {
        &[("CPU", |p| Some(p.cpu))]
    };
    let [width, height] = [
        2.0 * (PANEL[0] + MARGIN) + 20.0,
        times.len() as f64 * (PANEL[1] + MARGIN) + 60.0,
    ];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
        <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
        <text x=\"{MARGIN}\" y=\"18\" font-size=\"14\">{}: error against time a triangle ({})</text>\n",
        escaped(title),
        escaped(adapter)
    );
    for (index, series) in series.iter().enumerate() {
        let x = MARGIN + 235.0 * index as f64;
        let _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"27\" width=\"10\" height=\"10\" fill=\"{}\"/><text x=\"{}\" y=\"36\">{}</text>",
            COLORS[index % COLORS.len()],
            x + 14.0,
            escaped(&series.name)
        );
    }
    for (row, (unit, time)) in times.iter().enumerate() {
        for (column, what) in ["largest error", "mean error"].into_iter().enumerate() {
            let origin = [
                MARGIN + column as f64 * (PANEL[0] + MARGIN),
                50.0 + row as f64 * (PANEL[1] + MARGIN),
            ];
            panel(
                &mut svg,
                origin,
                [&format!("{unit}, ns"), what],
                series,
                *time,
                column,
            );
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// Two errors, named, of each series over its time on the GPU, whatever its unit.
#[must_use]
pub fn errors_over_gpu_time(
    heading: &str,
    time: &str,
    errors: [&str; 2],
    series: &[Series],
) -> String {
    /// Room for the name of a series.
    const LEGEND: f64 = 180.0;
    let [width, height] = [2.0 * (PANEL[0] + MARGIN) + 20.0, PANEL[1] + MARGIN + 60.0];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
        <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
        <text x=\"{MARGIN}\" y=\"18\" font-size=\"14\">{}</text>\n",
        escaped(heading)
    );
    for (index, series) in series.iter().enumerate() {
        let x = MARGIN + LEGEND * index as f64;
        let _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"27\" width=\"10\" height=\"10\" fill=\"{}\"/><text x=\"{}\" y=\"36\">{}</text>",
            COLORS[index % COLORS.len()],
            x + 14.0,
            escaped(&series.name)
        );
    }
    for (column, what) in errors.into_iter().enumerate() {
        let origin = [MARGIN + column as f64 * (PANEL[0] + MARGIN), 50.0];
        panel(&mut svg, origin, [time, what], series, |p| p.gpu, column);
    }
    svg.push_str("</svg>\n");
    svg
}

fn panel(
    svg: &mut String,
    [left, top]: [f64; 2],
    [x_name, y_name]: [&str; 2],
    series: &[Series],
    time: fn(&Point) -> Option<f64>,
    error: usize,
) {
    let all = || series.iter().flat_map(|s| &s.points);
    let x_axis = Axis::around(all().filter_map(time));
    let y_axis = Axis::around(all().filter(|p| time(p).is_some()).map(|p| p.errors[error]));
    let x_of = |value| left + PANEL[0] * x_axis.place(value);
    let y_of = |value| top + PANEL[1] * (1.0 - y_axis.place(value));
    let (right, bottom) = (left + PANEL[0], top + PANEL[1]);
    for tick in x_axis.ticks() {
        let x = x_of(tick);
        let _ = writeln!(
            svg,
            "<path d=\"M{x:.1} {top}V{bottom}\" stroke=\"#ddd\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{tick}</text>",
            bottom + 14.0
        );
    }
    for tick in y_axis.ticks() {
        let y = y_of(tick);
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {y:.1}H{right}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{tick:.0e}</text>",
            left - 4.0,
            y + 4.0
        );
    }
    let _ = writeln!(
        svg,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#888\"/>\n\
        <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x_name}</text>\n\
        <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" font-weight=\"bold\">{y_name}</text>",
        PANEL[0],
        PANEL[1],
        left + 0.5 * PANEL[0],
        bottom + 30.0,
        right - 6.0,
        top + 16.0
    );
    for (index, series) in series.iter().enumerate() {
        let color = COLORS[index % COLORS.len()];
        let points: Vec<(&Point, f64, f64)> = series
            .points
            .iter()
            .filter_map(|p| Some((p, x_of(time(p)?), y_of(p.errors[error]))))
            .collect();
        if points.is_empty() {
            continue;
        }
        let line: Vec<String> = points
            .iter()
            .map(|(_, x, y)| format!("{x:.1},{y:.1}"))
            .collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\"/>",
            line.join(" ")
        );
        for (point, x, y) in points {
            let _ = writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{color}\"/><text x=\"{:.1}\" y=\"{:.1}\" fill=\"{color}\">{}</text>",
                x + 6.0,
                y - 5.0,
                escaped(&point.label)
            );
        }
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}
