//! One linearly transformed cosine, symmetric about the plane of incidence.

use std::f64::consts::FRAC_1_PI;

/// M⁻¹ of a linearly transformed cosine with M⁻¹\[1\]\[1\] = 1 and the four entries below (row, column); the other
/// four are zero.
///
/// Density: D(l) = D₀(w / |w|) det M⁻¹ / |w|³ with w = M⁻¹ l and D₀(z) = max(z, 0)/π (Heitz, Dupuy, Hill, Neubelt
/// 2016, *Real-Time Polygonal-Light Shading with Linearly Transformed Cosines*, equation 1). Its integral over the
/// sphere is 1; the part above the surface is [`Lobe::norm`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// M⁻¹\[0\]\[0\].
    pub m00: f64,
    /// M⁻¹\[0\]\[2\].
    pub m02: f64,
    /// M⁻¹\[2\]\[0\].
    pub m20: f64,
    /// M⁻¹\[2\]\[2\].
    pub m22: f64,
}

impl Lobe {
    /// The untransformed cosine.
    pub const COSINE: Self = Self {
        m00: 1.0,
        m02: 0.0,
        m20: 0.0,
        m22: 1.0,
    };

    /// The lobe of four table entries, in the table's order.
    pub fn from_array([m00, m02, m20, m22]: [f64; 4]) -> Self {
        Self { m00, m02, m20, m22 }
    }

    /// The four entries in the table's order.
    pub fn to_array(self) -> [f64; 4] {
        [self.m00, self.m02, self.m20, self.m22]
    }

    /// det M⁻¹; positive for every lobe that the fit returns.
    pub fn determinant(&self) -> f64 {
        self.m00 * self.m22 - self.m02 * self.m20
    }

    /// M⁻¹ l.
    pub fn transform(&self, l: [f64; 3]) -> [f64; 3] {
        [
            self.m00 * l[0] + self.m02 * l[2],
            l[1],
            self.m20 * l[0] + self.m22 * l[2],
        ]
    }

    /// D(l), 1/sr, for a unit `l` anywhere on the sphere.
    pub fn density(&self, l: [f64; 3]) -> f64 {
        let w = self.transform(l);
        let length2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
        FRAC_1_PI * w[2].max(0.0) * self.determinant() / (length2 * length2)
    }

    /// N = ∫ D over the upper hemisphere, in closed form.
    ///
    /// M⁻¹ takes the half space z ≥ 0 to another half space; its normal n′ is row 2 of M, (−m20, 0, m00) up to a
    /// positive factor. The cosine lobe over the wedge between that half space and z′ ≥ 0 integrates to
    /// (1 + n′_z/|n′|)/2.
    pub fn norm(&self) -> f64 {
        0.5 * (1.0 + self.m00 / self.m00.hypot(self.m20))
    }

    /// Direction that M⁻¹ takes to +z, in the plane of incidence.
    pub fn axis(&self) -> [f64; 3] {
        // Row 0 vanishes on it; row 2 is positive on it where the determinant is.
        let length = self.m00.hypot(self.m02);
        [-self.m02 / length, 0.0, self.m00 / length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::{Fineness, hemisphere};

    #[test]
    fn norm_is_the_integral_over_the_upper_hemisphere() {
        let lobes = [
            (Lobe::COSINE, 1.0),
            // A cosine turned by 90° about y: half of it is above the surface.
            (Lobe::from_array([0.0, 1.0, -1.0, 0.0]), 0.5),
        ];
        for (lobe, known) in lobes {
            assert!((lobe.norm() - known).abs() < 1e-15);
        }
        for entries in [
            [0.5, 0.4, -0.3, 0.6],
            [0.8, 0.7, -0.1, 0.2],
            [1.2, -0.3, 0.5, 0.9],
            [-0.1, 0.5, -0.6, 0.3],
        ] {
            let lobe = Lobe::from_array(entries);
            let axis = lobe.axis();
            let mapped = lobe.transform(axis);
            assert!(mapped[0].abs() < 1e-15 && mapped[2] > 0.0);
            let integral: f64 = hemisphere(0.2, 0.3, Fineness::REPORT)
                .iter()
                .map(|n| n.weight * lobe.density(n.direction))
                .sum();
            assert!(
                (integral - lobe.norm()).abs() < 1e-3,
                "{entries:?}: {integral} against {}",
                lobe.norm()
            );
        }
    }
}
