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

    /// The lobe whose B = M⁻¹ \[X Z\] is (\[0\]\[0\], \[0\]\[2\], \[2\]\[0\], \[2\]\[2\]) = `b`, where Z = (−s, 0, c) is the mirror direction
    /// of a view at cosine `n_dot_v` = c, s = √(1 − c²), and X = (c, 0, s).
    ///
    /// [X Z] is a rotation about y, so M⁻¹ = B \[X Z\]ᵀ.
    pub fn from_mirror_frame([b00, b02, b20, b22]: [f64; 4], n_dot_v: f64) -> Self {
        let (c, s) = (n_dot_v, sine(n_dot_v));
        Self {
            m00: b00 * c - b02 * s,
            m02: b00 * s + b02 * c,
            m20: b20 * c - b22 * s,
            m22: b20 * s + b22 * c,
        }
    }

    /// The inverse of [`Lobe::from_mirror_frame`]: B = M⁻¹ \[X Z\].
    pub fn in_mirror_frame(&self, n_dot_v: f64) -> [f64; 4] {
        let (c, s) = (n_dot_v, sine(n_dot_v));
        [
            self.m00 * c + self.m02 * s,
            self.m02 * c - self.m00 * s,
            self.m20 * c + self.m22 * s,
            self.m22 * c - self.m20 * s,
        ]
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

fn sine(cosine: f64) -> f64 {
    ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt()
}

/// A normalised reflection as the renderer has it: a transformed cosine over a tail that is linear in the direction.
///
/// q(l) = (1 − `tail_z`) D(l) / N + (`tail_z` `l_z` + `tail_x` `l_x`) / π on z ≥ 0. The tail is what a single lobe lacks far from
/// the mirror direction. It costs the renderer nothing: over a polygon it integrates to the vector form factor that the
/// diffuse part needs anyway. As ∫ `l_z` / π = 1 and ∫ `l_x` / π = 0 over the hemisphere, ∫ q = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// D.
    pub lobe: Lobe,
    /// Part of the energy in the tail.
    pub tail_z: f64,
    /// Slope of the tail in the plane of incidence, positive towards the view.
    pub tail_x: f64,
}

impl Model {
    /// The lobe alone.
    pub fn without_tail(lobe: Lobe) -> Self {
        Self {
            lobe,
            tail_z: 0.0,
            tail_x: 0.0,
        }
    }

    /// (1 − `tail_z`) / N.
    pub fn lobe_weight(&self) -> f64 {
        (1.0 - self.tail_z) / self.lobe.norm()
    }

    /// q(l), 1/sr, for a unit `l` above the surface.
    pub fn density(&self, l: [f64; 3]) -> f64 {
        self.lobe_weight() * self.lobe.density(l)
            + FRAC_1_PI * (self.tail_z * l[2] + self.tail_x * l[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::{Fineness, hemisphere};

    #[test]
    fn the_mirror_frame_holds_what_the_lobe_does_to_the_mirror_direction() {
        let lobe = Lobe::from_array([0.5, 0.4, -0.3, 0.6]);
        let (c, s) = (0.6, 0.8);
        let b = lobe.in_mirror_frame(c);
        // B's columns are the images of X and Z.
        let (x, z) = (lobe.transform([c, 0.0, s]), lobe.transform([-s, 0.0, c]));
        for (a, b) in b.into_iter().zip([x[0], z[0], x[2], z[2]]) {
            assert!((a - b).abs() < 1e-15, "{a} {b}");
        }
        let back = Lobe::from_mirror_frame(b, c).to_array();
        for (a, b) in back.into_iter().zip(lobe.to_array()) {
            assert!((a - b).abs() < 1e-15, "{a} {b}");
        }
        assert!((Lobe::from_mirror_frame(b, 0.61).m00 - lobe.m00).abs() > 1e-3);
    }

    #[test]
    fn a_model_integrates_to_1() {
        let model = Model {
            lobe: Lobe::from_array([0.5, 0.4, -0.3, 0.6]),
            tail_z: 0.2,
            tail_x: 0.1,
        };
        let integral: f64 = hemisphere(0.2, 0.3, Fineness::REPORT)
            .iter()
            .map(|n| n.weight * model.density(n.direction))
            .sum();
        assert!((integral - 1.0).abs() < 1e-3, "{integral}");
    }

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
