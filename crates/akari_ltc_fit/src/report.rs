//! The figures of a table as text, beside those of the published one.

use crate::quality::{BIN_DEGREES, GRID_ANGLES, IntegralBin, Point, Quality};
use crate::spheres::SPHERE_ROUGHNESSES;
use std::fmt::Write;

/// Mean total variation of the published table over the same 48 cells (its whole lobe against GGX).
pub const PUBLISHED_MEAN_TOTAL_VARIATION: f64 = 0.067;
/// Largest total variation of the published table over the same 48 cells.
pub const PUBLISHED_MAX_TOTAL_VARIATION: f64 = 0.341;
/// Largest albedo error of the published table over the same 48 cells.
pub const PUBLISHED_ALBEDO_ERROR: f64 = 0.031;

/// The same with the lobe normalised over the upper hemisphere, as ours is: what the first clip alone gains.
pub const PUBLISHED_CLIPPED_MEAN_TOTAL_VARIATION: f64 = 0.061;
/// Largest of the same.
pub const PUBLISHED_CLIPPED_MAX_TOTAL_VARIATION: f64 = 0.300;

/// Largest and mean of the figures of some points.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Mean total variation.
    pub mean_total_variation: f64,
    /// Largest total variation.
    pub max_total_variation: f64,
    /// Mean relative L2 distance.
    pub mean_relative_l2: f64,
    /// Largest |albedo error|.
    pub max_albedo_error: f64,
    /// Largest |Fresnel error|.
    pub max_fresnel_error: f64,
}

impl Summary {
    /// Of at least one point.
    pub fn of(points: &[Point]) -> Self {
        let n = points.len().max(1) as f64;
        points.iter().fold(Self::default(), |s, p| Self {
            mean_total_variation: s.mean_total_variation + p.total_variation / n,
            max_total_variation: s.max_total_variation.max(p.total_variation),
            mean_relative_l2: s.mean_relative_l2 + p.relative_l2 / n,
            max_albedo_error: s.max_albedo_error.max(p.albedo_error.abs()),
            max_fresnel_error: s.max_fresnel_error.max(p.fresnel_error.abs()),
        })
    }
}

/// All figures as lines of text.
pub fn report(quality: &Quality) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_report(&mut out, quality);
    out
}

fn write_report(out: &mut String, quality: &Quality) -> std::fmt::Result {
    writeln!(
        out,
        "total variation between GGX and lobe with tail, by alpha and view angle"
    )?;
    for row in quality.grid.chunks(GRID_ANGLES) {
        let Some(first) = row.first() else { continue };
        write!(out, "  alpha {:.4}:", first.roughness * first.roughness)?;
        for p in row {
            write!(
                out,
                "  {:2.0}° {:.3}",
                p.n_dot_v.acos().to_degrees(),
                p.total_variation
            )?;
        }
        writeln!(out)?;
    }
    writeln!(
        out,
        "\nwhere               mean TV  max TV  mean L2  albedo error  Fresnel error"
    )?;
    let sets = [
        ("grid of 48 cells", &quality.grid),
        ("every third cell", &quality.cells),
        ("between the cells", &quality.midpoints),
    ];
    for (name, points) in sets {
        let s = Summary::of(points);
        writeln!(
            out,
            "{name:18}  {:.4}   {:.4}  {:.4}   {:.5}       {:.5}",
            s.mean_total_variation,
            s.max_total_variation,
            s.mean_relative_l2,
            s.max_albedo_error,
            s.max_fresnel_error
        )?;
    }
    writeln!(
        out,
        "published, grid     {PUBLISHED_MEAN_TOTAL_VARIATION:.3}    {PUBLISHED_MAX_TOTAL_VARIATION:.3}            {PUBLISHED_ALBEDO_ERROR:.3}"
    )?;

    writeln!(
        out,
        "  + clip            {PUBLISHED_CLIPPED_MEAN_TOTAL_VARIATION:.3}    {PUBLISHED_CLIPPED_MAX_TOTAL_VARIATION:.3}"
    )?;

    writeln!(
        out,
        "\nintegrals over random rectangles, error in %: mean |error| / mean value, in brackets relative RMSE"
    )?;
    write_bin_table(out, &quality.bins, true)?;
    writeln!(
        out,
        "\nthe same over random rectangles elsewhere above the horizon, more than 52° from the mirror direction"
    )?;
    write_bin_table(out, &quality.off_mirror_bins, false)?;

    writeln!(
        out,
        "\nwhite-metal spheres, relative RMSE in % over all pixels / over those seen at 60° to 80°, by roughness"
    )?;
    write!(out, "  {:20}", "")?;
    for roughness in SPHERE_ROUGHNESSES {
        write!(out, "  {roughness:10.2}")?;
    }
    writeln!(out, "         all         bias")?;
    for error in &quality.spheres {
        write!(out, "  {:20}", error.light)?;
        let total = error.total();
        for sphere in error.spheres.iter().chain([&total]) {
            let (all, grazing) = (sphere.all.relative_rmse(), sphere.grazing.relative_rmse());
            write!(out, "  {:4.1} /{:5.1}", 100.0 * all, 100.0 * grazing)?;
        }
        let (all, grazing) = (total.all.bias(), total.grazing.bias());
        writeln!(out, "  {:4.1} /{:5.1}", 100.0 * all, 100.0 * grazing)?;
    }
    Ok(())
}

fn write_bin_table(out: &mut String, bins: &[IntegralBin], published: bool) -> std::fmt::Result {
    write!(out, "  roughness        ")?;
    for (from, to) in BIN_DEGREES {
        write!(out, "  {from:2.0}-{to:2.0}°       ")?;
    }
    writeln!(out)?;
    for row in bins.chunks(BIN_DEGREES.len()) {
        let Some(first) = row.first() else { continue };
        write_bins(
            out,
            first.roughness,
            "ours",
            row.iter().map(|b: &IntegralBin| (b.mean, b.rms)),
        )?;
        for published in PUBLISHED_BINS
            .iter()
            .filter(|p| published && p.roughness == first.roughness)
        {
            write_bins(
                out,
                first.roughness,
                "published",
                published.errors.iter().copied(),
            )?;
            write_bins(
                out,
                first.roughness,
                "  + clip",
                published.clipped_errors.iter().copied(),
            )?;
        }
    }
    Ok(())
}

fn write_bins(
    out: &mut String,
    roughness: f64,
    name: &str,
    errors: impl Iterator<Item = (f64, f64)>,
) -> std::fmt::Result {
    write!(out, "  {roughness:.1} {name:13}")?;
    for (mean, rms) in errors {
        write!(out, "  {:5.1} ({:5.1})", 100.0 * mean, 100.0 * rms)?;
    }
    writeln!(out)
}

/// Errors of the published table for one roughness, by [`BIN_DEGREES`]: (mean, relative RMSE).
#[derive(Clone, Copy, Debug)]
pub struct PublishedBins {
    /// Perceptual roughness.
    pub roughness: f64,
    /// As published: clipped after the transform only.
    pub errors: [(f64, f64); BIN_DEGREES.len()],
    /// With the light clipped to the horizon first as well.
    pub clipped_errors: [(f64, f64); BIN_DEGREES.len()],
}

/// The published table (in the f16 form that Bevy 0.19.1 ships) over the same rectangles, measured with
/// [`integral_bins`](crate::quality::integral_bins).
pub const PUBLISHED_BINS: [PublishedBins; 8] = [
    PublishedBins {
        roughness: 0.1,
        errors: [
            (0.001, 0.001),
            (0.002, 0.002),
            (0.006, 0.005),
            (0.025, 0.034),
            (0.005, 0.004),
        ],
        clipped_errors: [
            (0.001, 0.001),
            (0.002, 0.002),
            (0.005, 0.005),
            (0.027, 0.041),
            (0.004, 0.003),
        ],
    },
    PublishedBins {
        roughness: 0.2,
        errors: [
            (0.004, 0.003),
            (0.022, 0.016),
            (0.072, 0.052),
            (0.172, 0.141),
            (0.047, 0.043),
        ],
        clipped_errors: [
            (0.004, 0.003),
            (0.019, 0.014),
            (0.047, 0.037),
            (0.146, 0.116),
            (0.037, 0.036),
        ],
    },
    PublishedBins {
        roughness: 0.3,
        errors: [
            (0.010, 0.009),
            (0.052, 0.042),
            (0.148, 0.115),
            (0.319, 0.266),
            (0.125, 0.098),
        ],
        clipped_errors: [
            (0.010, 0.009),
            (0.041, 0.032),
            (0.091, 0.071),
            (0.176, 0.153),
            (0.085, 0.067),
        ],
    },
    PublishedBins {
        roughness: 0.4,
        errors: [
            (0.012, 0.010),
            (0.100, 0.089),
            (0.226, 0.176),
            (0.403, 0.331),
            (0.167, 0.151),
        ],
        clipped_errors: [
            (0.011, 0.009),
            (0.069, 0.057),
            (0.136, 0.104),
            (0.212, 0.170),
            (0.111, 0.098),
        ],
    },
    PublishedBins {
        roughness: 0.5,
        errors: [
            (0.022, 0.023),
            (0.119, 0.110),
            (0.261, 0.232),
            (0.428, 0.363),
            (0.223, 0.209),
        ],
        clipped_errors: [
            (0.020, 0.019),
            (0.080, 0.070),
            (0.163, 0.138),
            (0.241, 0.208),
            (0.132, 0.120),
        ],
    },
    PublishedBins {
        roughness: 0.6,
        errors: [
            (0.025, 0.031),
            (0.106, 0.119),
            (0.267, 0.212),
            (0.365, 0.329),
            (0.211, 0.187),
        ],
        clipped_errors: [
            (0.022, 0.024),
            (0.074, 0.075),
            (0.164, 0.137),
            (0.222, 0.202),
            (0.127, 0.111),
        ],
    },
    PublishedBins {
        roughness: 0.8,
        errors: [
            (0.023, 0.027),
            (0.086, 0.076),
            (0.158, 0.132),
            (0.220, 0.174),
            (0.137, 0.110),
        ],
        clipped_errors: [
            (0.021, 0.022),
            (0.069, 0.061),
            (0.111, 0.097),
            (0.152, 0.128),
            (0.098, 0.081),
        ],
    },
    PublishedBins {
        roughness: 1.0,
        errors: [
            (0.016, 0.014),
            (0.027, 0.022),
            (0.053, 0.048),
            (0.094, 0.079),
            (0.043, 0.036),
        ],
        clipped_errors: [
            (0.016, 0.014),
            (0.027, 0.022),
            (0.053, 0.048),
            (0.094, 0.079),
            (0.043, 0.036),
        ],
    },
];
