//! How far two images are apart.

/// The differences of two images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageDifference {
    /// Root of the mean squared difference over all numbers.
    pub rms: f64,
    /// `rms` over the root mean square of the expected image; 0 where both are black.
    pub relative_rms: f64,
    /// Largest absolute difference.
    pub max: f64,
    /// Pixel of the largest difference.
    pub max_pixel: usize,
    /// Pixels that are not finite in the actual image.
    pub non_finite: usize,
}

/// Compares two linear RGB images, three numbers per pixel. Pixels that are not finite are counted and left out.
///
/// # Panics
///
/// Where the sizes differ or are not whole pixels, or the expected image is not finite.
#[must_use]
pub fn image_difference(actual: &[f32], expected: &[f32]) -> ImageDifference {
    assert_eq!(actual.len(), expected.len(), "images of different size");
    assert_eq!(actual.len() % 3, 0, "not whole RGB pixels");
    let mut difference = ImageDifference::default();
    let (mut squares, mut expected_squares, mut count) = (0.0_f64, 0.0_f64, 0_usize);
    for (pixel, (a, e)) in actual
        .chunks_exact(3)
        .zip(expected.chunks_exact(3))
        .enumerate()
    {
        assert!(
            e.iter().all(|e| e.is_finite()),
            "pixel {pixel} of the expected image is not finite"
        );
        if !a.iter().all(|a| a.is_finite()) {
            difference.non_finite += 1;
            continue;
        }
        for (&a, &e) in a.iter().zip(e) {
            let d = (f64::from(a) - f64::from(e)).abs();
            squares += d * d;
            expected_squares += f64::from(e) * f64::from(e);
            count += 1;
            if d > difference.max {
                (difference.max, difference.max_pixel) = (d, pixel);
            }
        }
    }
    if count > 0 {
        difference.rms = (squares / count as f64).sqrt();
    }
    if squares > 0.0 {
        difference.relative_rms = (squares / expected_squares.max(f64::MIN_POSITIVE)).sqrt();
    }
    difference
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_of_images() {
        let expected = [1.0; 12];
        assert_eq!(
            image_difference(&expected, &expected),
            ImageDifference::default()
        );
        let mut actual = expected;
        actual[4] = 3.0;
        let difference = image_difference(&actual, &expected);
        assert_eq!((difference.max, difference.max_pixel), (2.0, 1));
        assert!((difference.rms - (4.0_f64 / 12.0).sqrt()).abs() < 1e-12);
        assert!((difference.relative_rms - (4.0_f64 / 12.0).sqrt()).abs() < 1e-12);
        actual[11] = f32::NAN;
        assert_eq!(image_difference(&actual, &expected).non_finite, 1);
    }
}
