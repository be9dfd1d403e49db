//! What a bake tells about its result.

use crate::fit::FitQuality;

/// Numbers about a bake, or about the part of it that this process made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The output was there already, whole, of the same scene and settings: the errors below are not known then.
    pub was_complete: bool,
    /// Triangles that receive.
    pub triangles: u64,
    /// Triangles at each level; the index is the level.
    pub levels: Vec<u64>,
    /// Triangles whose grid is as fine as `max_level` allows and still off by more than the tolerance.
    pub capped_triangles: u64,
    /// Samples.
    pub samples: u64,
    /// Of them, found in the journal of an interrupted bake.
    pub resumed_samples: u64,
    /// Leaves of all trees before equal trees are joined; a face without a line has one.
    pub leaves: u64,
    /// Texels above the horizon, of all samples.
    pub texels: u64,
    /// Of these, how many the leaf's mean puts on the wrong side of ½.
    pub misclassified: u64,
    /// Sum of |mean of the leaf − bit| over the texels.
    pub absolute_error: f64,
    /// Bytes of the file.
    pub bytes: u64,
    /// CPU time of all threads, seconds, where the system tells it.
    pub cpu_seconds: Option<f64>,
    /// Seconds from start to end.
    pub seconds: f64,
}

impl Report {
    pub(crate) fn add(&mut self, quality: &FitQuality) {
        self.leaves += u64::from(quality.leaves);
        self.texels += u64::from(quality.texels);
        self.misclassified += u64::from(quality.misclassified);
        self.absolute_error += quality.absolute_error;
    }

    /// Leaves of the six faces together.
    #[must_use]
    pub fn leaves_per_sample(&self) -> f64 {
        ratio(self.leaves as f64, self.samples)
    }

    /// Bytes of the file per sample.
    #[must_use]
    pub fn bytes_per_sample(&self) -> f64 {
        ratio(self.bytes as f64, self.samples)
    }

    /// Bytes of the file per leaf.
    #[must_use]
    pub fn bytes_per_leaf(&self) -> f64 {
        ratio(self.bytes as f64, self.leaves)
    }

    /// Share of the texels above the horizon on the wrong side of ½.
    #[must_use]
    pub fn misclassified_share(&self) -> f64 {
        ratio(self.misclassified as f64, self.texels)
    }

    /// Mean of |mean of the leaf − bit| over the texels above the horizon.
    #[must_use]
    pub fn mean_absolute_error(&self) -> f64 {
        ratio(self.absolute_error, self.texels)
    }
}

fn ratio(a: f64, b: u64) -> f64 {
    if b == 0 { 0.0 } else { a / b as f64 }
}
