//! Error of one image against another: what `akari compare` prints.

use akari_scene::exr_io::RgbImage;
use akari_scene::tonemap;
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8};
use serde::{Deserialize, Serialize};

/// Stabiliser of `rel_mse`'s denominator: the usual 1e-2 (Rousselle et al. 2011).
const REL_MSE_EPSILON: f64 = 0.01;
/// Share of B's root mean square below which `mape` does not divide by a smaller value.
const MAPE_FLOOR: f64 = 1e-3;

/// Error of image A against image B over the pixels of the mask. Names are those of the JSON on stdout.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Root mean square of a − b over all channels.
    pub rmse: f64,
    /// `rmse` over the root mean square of B.
    pub rel_rmse: f64,
    /// Mean of (a − b)² / (b² + 0.01).
    pub rel_mse: f64,
    /// Mean of |a − b| / max(|b|, 1e-3 of B's root mean square).
    pub mape: f64,
    /// mean(a) / mean(b) − 1.
    pub bias: f64,
    /// Mean of the FLIP error, 0 (alike) to 1.
    pub flip_mean: f64,
    /// 99th percentile of the FLIP error.
    pub flip_p99: f64,
    /// Largest |a − b| of a channel.
    pub max_abs: f64,
    /// Pixels with NaN or infinity in A or B; they count in no other figure.
    pub non_finite: u64,
}

/// Why two images cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// Different sizes.
    #[error("{what} has {} x {} pixels, the reference {} x {}: render both at one size", .size.0, .size.1, .reference.0, .reference.1)]
    Size {
        /// `the image` or `the mask`.
        what: &'static str,
        /// Its width and height.
        size: (u32, u32),
        /// The reference's.
        reference: (u32, u32),
    },
    /// Nothing to compare.
    #[error("no pixel is left to compare: the mask is 0 everywhere or all pixels are not finite")]
    Empty,
}

/// Compares `a` with the reference `b` where `mask` (any channel above ½) allows; without a mask everywhere.
///
/// FLIP (Andersson et al. 2020, through `nv-flip`, 67 pixels per degree) sees both images tone mapped as
/// [`tonemap`] does for a PNG, with the automatic exposure of `b` for both. It is computed on whole images, pixels
/// that are not finite set to black in both, and pooled over the mask.
pub fn compare(
    a: &RgbImage,
    b: &RgbImage,
    mask: Option<&RgbImage>,
) -> Result<Metrics, CompareError> {
    let reference = (b.width, b.height);
    for (what, image) in [("the image", Some(a)), ("the mask", mask)] {
        if let Some(image) = image
            && ((image.width, image.height) != reference || image.data.len() != b.data.len())
        {
            return Err(CompareError::Size {
                what,
                size: (image.width, image.height),
                reference,
            });
        }
    }
    let finite = |i: usize| a.data[i].iter().chain(&b.data[i]).all(|c| c.is_finite());
    let inside = |i: usize| mask.is_none_or(|m| m.data[i].iter().any(|c| *c > 0.5));
    let (chosen, broken): (Vec<usize>, Vec<usize>) = (0..b.data.len())
        .filter(|&i| inside(i))
        .partition(|&i| finite(i));
    if chosen.is_empty() {
        return Err(CompareError::Empty);
    }
    let values = || {
        chosen
            .iter()
            .flat_map(|&i| (0..3).map(move |k| (f64::from(a.data[i][k]), f64::from(b.data[i][k]))))
    };
    let count = 3.0 * chosen.len() as f64;
    let rms_b = (values().map(|(_, b)| b * b).sum::<f64>() / count).sqrt();
    let rmse = (values().map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / count).sqrt();
    // A black reference: equal images have no error, others an infinite one, which JSON cannot say.
    let ratio = |x: f64, y: f64| {
        if y > 0.0 {
            x / y
        } else if x == 0.0 {
            0.0
        } else {
            f64::MAX
        }
    };
    let floor = (MAPE_FLOOR * rms_b).max(f64::MIN_POSITIVE);
    let (mean_a, mean_b) = values().fold((0.0, 0.0), |(x, y), (a, b)| (x + a, y + b));
    let mut flip = flip_errors(a, b, finite);
    let mut flip: Vec<f32> = chosen
        .iter()
        .map(|&i| std::mem::take(&mut flip[i]))
        .collect();
    let flip_mean = flip.iter().map(|e| f64::from(*e)).sum::<f64>() / flip.len() as f64;
    // Nearest rank.
    let rank = (flip.len() * 99).div_ceil(100) - 1;
    let (_, flip_p99, _) = flip.select_nth_unstable_by(rank, f32::total_cmp);
    let flip_p99 = f64::from(*flip_p99);
    Ok(Metrics {
        rmse,
        rel_rmse: ratio(rmse, rms_b),
        rel_mse: values()
            .map(|(a, b)| (a - b) * (a - b) / (b * b + REL_MSE_EPSILON))
            .sum::<f64>()
            / count,
        mape: values()
            .map(|(a, b)| ((a - b).abs() / b.abs().max(floor)).min(f64::MAX / count))
            .sum::<f64>()
            / count,
        bias: if mean_a == mean_b {
            0.0
        } else {
            ratio(mean_a - mean_b, mean_b)
        },
        flip_mean,
        flip_p99,
        max_abs: values().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
        non_finite: broken.len() as u64,
    })
}

/// FLIP error of every pixel.
fn flip_errors(a: &RgbImage, b: &RgbImage, finite: impl Fn(usize) -> bool) -> Vec<f32> {
    let scale = tonemap::auto_scale(b);
    let bytes = |image: &RgbImage| -> Vec<u8> {
        image
            .data
            .iter()
            .enumerate()
            .flat_map(|(i, p)| {
                if finite(i) {
                    tonemap::pixel(*p, scale)
                } else {
                    [0; 3]
                }
            })
            .collect()
    };
    let image = |i: &RgbImage| FlipImageRgb8::with_data(i.width, i.height, &bytes(i));
    nv_flip::flip(image(b), image(a), DEFAULT_PIXELS_PER_DEGREE).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient() -> RgbImage {
        RgbImage {
            width: 32,
            height: 32,
            data: (0..32 * 32)
                .map(|i| [i as f32 / 1024.0, 0.5, (i % 32) as f32 / 32.0])
                .collect(),
        }
    }

    #[test]
    fn equal_images_have_no_error() {
        let m = compare(&gradient(), &gradient(), None).unwrap();
        assert_eq!(
            (m.rmse, m.rel_rmse, m.rel_mse, m.mape),
            (0.0, 0.0, 0.0, 0.0)
        );
        assert_eq!(
            (m.bias, m.max_abs, m.flip_mean, m.non_finite),
            (0.0, 0.0, 0.0, 0)
        );
    }

    #[test]
    fn hand_computed() {
        let b = RgbImage::filled(8, 8, [1.0, 2.0, 2.0]);
        let a = RgbImage::filled(8, 8, [1.5, 2.0, 2.0]);
        let m = compare(&a, &b, None).unwrap();
        assert!((m.rmse - (0.25_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((m.rel_rmse - (0.25_f64 / 9.0).sqrt()).abs() < 1e-12);
        assert!((m.rel_mse - 0.25 / 1.01 / 3.0).abs() < 1e-12);
        assert!((m.mape - 0.5 / 3.0).abs() < 1e-12);
        assert!((m.bias - 0.1).abs() < 1e-12);
        assert_eq!(m.max_abs, 0.5);
        assert!(m.flip_mean > 0.01);
    }

    #[test]
    fn mask_and_non_finite_pixels_are_left_out() {
        let b = gradient();
        let mut a = gradient();
        a.data[3] = [9.0; 3];
        a.data[4] = [f32::NAN, 0.0, 0.0];
        let mut mask = RgbImage::filled(32, 32, [1.0; 3]);
        mask.data[3] = [0.0; 3];
        let m = compare(&a, &b, Some(&mask)).unwrap();
        assert_eq!((m.rmse, m.non_finite), (0.0, 1));
        let m = compare(&a, &b, None).unwrap();
        assert!(m.rmse > 0.0 && m.rmse.is_finite() && m.max_abs > 8.0);
    }

    #[test]
    fn refusals() {
        let b = gradient();
        let small = RgbImage::filled(8, 8, [0.0; 3]);
        let message = compare(&small, &b, None).unwrap_err().to_string();
        assert!(
            message.contains("8 x 8") && message.contains("32 x 32"),
            "{message}"
        );
        assert!(compare(&b, &b, Some(&small)).is_err());
        let none = RgbImage::filled(32, 32, [0.0; 3]);
        assert_eq!(compare(&b, &b, Some(&none)), Err(CompareError::Empty));
        let m = compare(&b, &none, None).unwrap();
        assert!(m.rel_rmse.is_finite());
    }

    #[test]
    fn json_keys_are_the_contract() {
        let m = compare(&gradient(), &gradient(), None).unwrap();
        let json = serde_json::to_value(m).unwrap();
        let mut keys: Vec<&str> = json
            .as_object()
            .unwrap()
            .keys()
            .map(String::as_str)
            .collect();
        keys.sort_unstable();
        assert_eq!(
            keys,
            [
                "bias",
                "flip_mean",
                "flip_p99",
                "mape",
                "max_abs",
                "non_finite",
                "rel_mse",
                "rel_rmse",
                "rmse"
            ]
        );
    }
}
