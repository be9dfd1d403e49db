//! `report.html`: one file that needs no network.

use super::document::{Curve, Point, Report};
use super::plot::{escape, figure, scatter};
use crate::error::CliError;
use base64::Engine;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Pictures of a curve: ours by default settings, the reference, ten times their difference.
pub const PICTURES: [&str; 3] = ["ours", "reference", "difference"];

/// Where a picture of a curve lies.
pub fn picture_path(parts: &Path, slug: &str, picture: &str) -> PathBuf {
    parts.join(format!("{slug}-{picture}.png"))
}

/// The front of a curve, fastest first; of equal points one.
pub fn front_by_time(curve: &Curve) -> Vec<&Point> {
    let mut front: Vec<&Point> = curve.points.iter().filter(|point| point.on_front).collect();
    front.sort_by(|a, b| a.cost_ms().total_cmp(&b.cost_ms()));
    front
}

/// The page.
///
/// # Errors
/// If a picture cannot be read.
pub fn page(report: &Report, parts: &Path) -> Result<String, CliError> {
    let device = &report.device;
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
         content=\"width=device-width\"><title>What accuracy costs in time</title><style>{}</style></head><body>\n\
         <h1>What accuracy costs in time</h1>\n<p>bevy_akari {} on <b>{}</b> ({}, {}, {}){}. Times are those of this device \
         alone.</p>\n",
        include_str!("page.css"),
        escape(&report.version),
        escape(&device.adapter),
        escape(&device.kind),
        escape(&device.backend),
        escape(&device.driver),
        if report.quick {
            ", quick: small pictures, few settings"
        } else {
            ""
        },
    );
    html.push_str(
        "<p class=\"ask\"><label>I have <input id=\"budget\" type=\"number\" min=\"0\" step=\"any\"> ms a frame for one \
         effect.</label></p>\n<table class=\"answers\"><thead><tr><th>effect</th><th>scene</th><th>most exact setting in \
         that time</th><th>ms</th><th>relative RMSE</th><th>memory</th></tr></thead><tbody id=\"answers\">",
    );
    // Without scripts, the default setting is the answer.
    for curve in &report.curves {
        let _ = write!(
            html,
            "<tr data-curve=\"{}\"><td>{}</td><td>{}</td>{}</tr>",
            escape(&slug(curve)),
            escape(&curve.effect),
            escape(&curve.scene),
            curve.points.first().map_or_else(String::new, answer_cells)
        );
    }
    html.push_str("</tbody></table>\n");
    for curve in &report.curves {
        section(&mut html, curve, parts)?;
    }
    let fronts: serde_json::Map<String, serde_json::Value> = report
        .curves
        .iter()
        .map(|curve| {
            let rows: Vec<_> = front_by_time(curve)
                .into_iter()
                .map(|point| serde_json::json!({ "ms": point.cost_ms(), "cells": answer_cells(point) }))
                .collect();
            (slug(curve), rows.into())
        })
        .collect();
    // `<` would let a string end the script.
    let fronts = serde_json::Value::from(fronts)
        .to_string()
        .replace('<', "\\u003c");
    let _ = write!(
        html,
        "<script>const fronts = {fronts};\n{}</script>\n</body></html>\n",
        include_str!("page.js")
    );
    Ok(html)
}

fn slug(curve: &Curve) -> String {
    format!("{}-{}", curve.effect, curve.scene)
}

fn bytes(count: u64) -> String {
    format!("{:.2} MB", count as f64 / 1e6)
}

fn answer_cells(point: &Point) -> String {
    format!(
        "<td>{}</td><td>{}</td><td>{} %</td><td>{}</td>",
        escape(&point.label),
        figure(point.cost_ms()),
        figure(100.0 * point.error.rel_rmse),
        bytes(point.gpu_bytes)
    )
}

fn section(html: &mut String, curve: &Curve, parts: &Path) -> Result<(), CliError> {
    let reference = &curve.reference;
    let noise = reference.noise.map_or_else(String::new, |noise| {
        format!(", own noise {} %", figure(100.0 * noise))
    });
    let _ = writeln!(
        html,
        "<section id=\"{}\"><h2>{} on {}</h2><p>{}; {} x {} pixels; reference of {} samples a pixel{noise}.</p>",
        escape(&slug(curve)),
        escape(&curve.effect),
        escape(&curve.scene),
        escape(&curve.what),
        curve.size[0],
        curve.size[1],
        reference.spp
    );
    html.push_str(&scatter(curve));
    html.push_str("<div class=\"pictures\">");
    for (picture, caption) in PICTURES.iter().zip([
        "ours, default settings",
        "reference",
        "difference, times 10",
    ]) {
        let path = picture_path(parts, &slug(curve), picture);
        let png = std::fs::read(&path).map_err(|error| {
            CliError::input(format!(
                "{}: cannot be read: {error}; take {} away and run the command again",
                path.display(),
                parts.display()
            ))
        })?;
        let _ = write!(
            html,
            "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{}\"><figcaption>{caption}</figcaption></figure>",
            base64::engine::general_purpose::STANDARD.encode(png)
        );
    }
    html.push_str(
        "</div>\n<table class=\"points\"><thead><tr><th>setting</th><th>front</th><th>GPU ms, least</th><th>median</th><th>99 %</th><th>frame \
         ms</th><th>memory, MB</th><th>relative RMSE, %</th><th>relMSE</th><th>FLIP</th><th>FLIP 99 %</th><th>bias, \
         %</th><th>flicker, %</th><th>not finite</th></tr></thead><tbody>\n",
    );
    for point in &curve.points {
        let error = &point.error;
        let gpu = |pick: fn(&super::document::Milliseconds) -> f64| {
            point
                .gpu_ms
                .as_ref()
                .map_or_else(|| "-".to_owned(), |ms| figure(pick(ms)))
        };
        let _ = write!(
            html,
            "<tr{}><td title=\"{}\">{}</td><td>{}</td>",
            if point.preset.is_some() {
                " class=\"preset\""
            } else {
                ""
            },
            escape(&point.passes.join(", ")),
            escape(&point.label),
            if point.on_front { "yes" } else { "" },
        );
        for cell in [
            gpu(|ms| ms.least),
            gpu(|ms| ms.median),
            gpu(|ms| ms.p99),
            figure(point.frame_ms.median),
            figure(point.gpu_bytes as f64 / 1e6),
            figure(100.0 * error.rel_rmse),
            figure(error.rel_mse),
            figure(error.flip_mean),
            figure(error.flip_p99),
            figure(100.0 * error.bias),
            figure(100.0 * point.flicker),
            error.non_finite.to_string(),
        ] {
            let _ = write!(html, "<td>{cell}</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></section>\n");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::document::{Device, Milliseconds, Reference, SCHEMA, mark_front};
    use super::*;
    use akari_reference::metrics::compare;
    use akari_scene::exr_io::RgbImage;

    fn point(label: &str, ms: f64, off: f32) -> Point {
        let truth = RgbImage::filled(8, 8, [1.0; 3]);
        let ours = RgbImage::filled(8, 8, [1.0 + off; 3]);
        let time = Milliseconds::of(&[ms]).unwrap();
        Point {
            label: label.to_owned(),
            preset: (label == "high").then(|| label.to_owned()),
            knob: (label != "high").then(|| "cells".to_owned()),
            settings: [("cells".to_owned(), 1.0)].into(),
            error: compare(&ours, &truth, None).unwrap(),
            flicker: 0.0,
            gpu_ms: Some(time),
            frame_ms: time,
            gpu_bytes: 1000,
            passes: vec!["akari_pass".to_owned()],
            on_front: false,
        }
    }

    fn report(folder: &Path) -> Report {
        let mut points = vec![
            point("high", 2.0, 0.1),
            point("cells <&> = 2", 1.0, 0.3),
            point("cells = 3", 3.0, 0.3),
        ];
        mark_front(&mut points);
        for picture in PICTURES {
            std::fs::write(picture_path(folder, "area_lights-box", picture), b"png").unwrap();
        }
        Report {
            schema: SCHEMA,
            version: "1".to_owned(),
            quick: true,
            device: Device {
                adapter: "a <device>".to_owned(),
                kind: "software".to_owned(),
                backend: "Vulkan".to_owned(),
                driver: "d".to_owned(),
            },
            curves: vec![Curve {
                effect: "area_lights".to_owned(),
                scene: "box".to_owned(),
                what: "direct".to_owned(),
                size: [8, 8],
                reference: Reference {
                    spp: 4,
                    max_depth: 2,
                    noise: Some(0.01),
                },
                points,
            }],
        }
    }

    /// Whether every element that is opened is closed in order; void elements excepted.
    fn balanced(html: &str) -> Result<(), String> {
        const VOID: [&str; 4] = ["meta", "input", "img", "!DOCTYPE"];
        let body = html.split("<script>").next().unwrap_or_default();
        let mut open: Vec<&str> = Vec::new();
        for piece in body.split('<').skip(1) {
            let tag = piece.split('>').next().unwrap_or_default();
            let name = tag.split([' ', '/']).next().unwrap_or_default();
            if let Some(closed) = tag.strip_prefix('/') {
                if open.pop() != Some(closed) {
                    return Err(format!("</{closed}>"));
                }
            } else if !tag.ends_with('/') && !VOID.contains(&name) {
                open.push(name);
            }
        }
        // The script stands within the body.
        if open == ["html", "body"] {
            Ok(())
        } else {
            Err(open.join(" "))
        }
    }

    #[test]
    fn the_page_is_whole_sound_and_needs_no_network() {
        let folder = tempfile::tempdir().unwrap();
        let html = page(&report(folder.path()), folder.path()).unwrap();
        balanced(&html).unwrap();
        assert!(balanced("<html><body><p></body></html>").is_err());
        assert!(!html.contains("http"), "a link to somewhere else");
        let markup = html.split("<script>").next().unwrap();
        assert!(!markup.contains("NaN") && !markup.contains("inf"));
        assert!(html.contains("a &lt;device&gt;") && html.contains("cells &lt;&amp;&gt; = 2"));
        // Two of three on the front: a row each, and the beaten point marked as such.
        assert_eq!(html.matches("<td>yes</td>").count(), 2);
        assert_eq!(html.matches("class=\"beaten\"").count(), 1);
        assert_eq!(html.matches("data:image/png;base64,").count(), 3);
    }

    #[test]
    fn a_missing_picture_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let report = report(folder.path());
        std::fs::remove_file(picture_path(folder.path(), "area_lights-box", "ours")).unwrap();
        let error = page(&report, folder.path()).unwrap_err();
        assert!(
            error.message.contains("area_lights-box-ours.png"),
            "{error}"
        );
    }
}
