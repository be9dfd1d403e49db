//! How far two lists of numbers are apart.

use std::fmt;

/// How many `f32` lie between `a` and `b`, through zero; −0 and 0 are 0 apart. `u32::MAX` where either is NaN.
#[must_use]
pub fn ulp_distance(a: f32, b: f32) -> u32 {
    if a.is_nan() || b.is_nan() {
        return u32::MAX;
    }
    // Maps the floats to integers in their order.
    let key = |x: f32| {
        let bits = x.to_bits() as i32;
        if bits < 0 {
            i32::MIN.wrapping_sub(bits)
        } else {
            bits
        }
    };
    key(a).abs_diff(key(b))
}

/// Where a difference is largest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// Size of the difference.
    pub value: f64,
    /// Index of the element.
    pub index: usize,
}

impl Worst {
    fn raise(&mut self, value: f64, index: usize) {
        if value > self.value {
            *self = Self { value, index };
        }
    }
}

/// The differences of two lists.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompareReport {
    /// Largest distance in units of the last place.
    pub ulp: Worst,
    /// Largest absolute difference.
    pub absolute: Worst,
    /// Largest difference over the size of the expected number, where that is not 0.
    pub relative: Worst,
    /// How many elements are not finite where a finite one is expected.
    pub non_finite: usize,
    /// The first of them.
    pub first_non_finite: Option<usize>,
}

impl fmt::Display for CompareReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "max {} ULP (at {}), {:.2e} absolute (at {}), {:.2e} relative (at {})",
            self.ulp.value,
            self.ulp.index,
            self.absolute.value,
            self.absolute.index,
            self.relative.value,
            self.relative.index
        )?;
        if let Some(first) = self.first_non_finite {
            write!(f, ", {} not finite (first at {first})", self.non_finite)?;
        }
        Ok(())
    }
}

/// Compares `actual` with `expected`, element by element. A difference in units of the last place is against the
/// expected number rounded to `f32`.
///
/// # Panics
///
/// Where the lengths differ.
#[must_use]
pub fn compare(actual: &[f32], expected: &[f64]) -> CompareReport {
    assert_eq!(actual.len(), expected.len(), "lists of different length");
    let mut report = CompareReport::default();
    for (index, (&a, &e)) in actual.iter().zip(expected).enumerate() {
        if !a.is_finite() {
            report.non_finite += 1;
            report.first_non_finite.get_or_insert(index);
            continue;
        }
        let difference = (f64::from(a) - e).abs();
        report
            .ulp
            .raise(f64::from(ulp_distance(a, e as f32)), index);
        report.absolute.raise(difference, index);
        if e != 0.0 {
            report.relative.raise(difference / e.abs(), index);
        }
    }
    report
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ulp_distances() {
        assert_eq!(ulp_distance(1.0, 1.0), 0);
        assert_eq!(ulp_distance(1.0, 1.0 + f32::EPSILON), 1);
        assert_eq!(ulp_distance(0.0, -0.0), 0);
        assert_eq!(ulp_distance(f32::from_bits(1), -f32::from_bits(1)), 2);
        assert_eq!(ulp_distance(f32::NAN, f32::NAN), u32::MAX);
    }

    #[test]
    fn a_difference_is_found_where_it_is() {
        let report = compare(&[1.0, 2.0, f32::NAN, 0.5], &[1.0, 2.5, 1.0, 0.5 + 1e-9]);
        assert_eq!(
            report.absolute,
            Worst {
                value: 0.5,
                index: 1
            }
        );
        assert_eq!(
            report.relative,
            Worst {
                value: 0.2,
                index: 1
            }
        );
        assert_eq!((report.non_finite, report.first_non_finite), (1, Some(2)));
    }
}
