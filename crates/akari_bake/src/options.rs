//! What a bake is told, and how it tells of itself.

use std::time::Duration;

use akari_visibility::identity::{BakeSettings, EnclosureSettings};
use akari_visibility::part::Shard;

use crate::Error;

/// Version of the algorithm in [`BakeSettings::algorithm`]: changes when the same scene and settings give other bits,
/// levels or trees, so that parts of different versions are never mixed.
pub const ALGORITHM: u32 = 2;

/// Sizes of a face that can be baked, in texels along its side.
pub const FACE_SIZES: [u32; 4] = [32, 64, 128, 256];

/// How to bake. The result depends on all of it but `threads`, `resume` and (after the merge) `shard`.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Texels along the side of a cube face, one of [`FACE_SIZES`]. Time grows with the side, and a bit more; the error
    /// of shadows falls with its inverse. 64 is enough for lights wider than about 10°.
    pub face_size: u32,
    /// Texels that a leaf may have wrong, as a share of a face's texels, in [0, 0.5]; 0 fits every texel.
    pub leaf_tolerance: f32,
    /// Largest error of the interpolated shadow at which a triangle's grid is fine enough, in (0, 1]: root mean square
    /// over lights 11° wide in all directions, half-way between the samples, where it is largest.
    pub shadow_tolerance: f32,
    /// Finest level of a triangle's sample grid, at most [`akari_visibility::grid::MAX_LEVEL`]: an edge is cut into up
    /// to 2^level pieces. 0 samples the vertices only, as the paper does.
    pub max_level: u32,
    /// Most lines between the root of a tree and a leaf, at most [`akari_visibility::tree::MAX_DEPTH`].
    pub max_depth: u32,
    /// Surfaces farther away than this cast no shadow, metres.
    pub max_distance: Option<f32>,
    /// Threads to use; none: as many as the machine has.
    pub threads: Option<usize>,
    /// Which part of how many to bake.
    pub shard: Shard,
    /// Continue from the journal that an interrupted bake of the same scene and settings left beside the output.
    pub resume: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            face_size: 64,
            leaf_tolerance: 0.0005,
            shadow_tolerance: 0.02,
            max_level: 7,
            max_depth: 48,
            max_distance: None,
            threads: None,
            shard: Shard { index: 1, count: 1 },
            resume: true,
        }
    }
}

impl Options {
    /// The part of the options that the file states, for a scene of which this enclosure is left out.
    #[must_use]
    pub fn settings(&self, enclosure: EnclosureSettings) -> BakeSettings {
        BakeSettings {
            algorithm: ALGORITHM,
            face_size: self.face_size,
            leaf_tolerance: self.leaf_tolerance,
            shadow_tolerance: self.shadow_tolerance,
            max_level: self.max_level,
            max_depth: self.max_depth,
            max_distance: self.max_distance,
            enclosure,
        }
    }

    /// Refuses options outside of their ranges.
    pub fn check(&self) -> Result<(), Error> {
        let refuse = |what: String| Err(Error::Options(what));
        if !FACE_SIZES.contains(&self.face_size) {
            return refuse(format!(
                "face size {}: it is 32, 64, 128 or 256",
                self.face_size
            ));
        }
        if !(0.0..=0.5).contains(&self.leaf_tolerance) {
            return refuse(format!(
                "leaf tolerance {}: it lies between 0 and 0.5",
                self.leaf_tolerance
            ));
        }
        if !(self.shadow_tolerance > 0.0 && self.shadow_tolerance <= 1.0) {
            return refuse(format!(
                "shadow tolerance {}: it lies above 0, up to 1",
                self.shadow_tolerance
            ));
        }
        if self.max_level > akari_visibility::grid::MAX_LEVEL {
            return refuse(format!(
                "maximum level {}: at most {}",
                self.max_level,
                akari_visibility::grid::MAX_LEVEL
            ));
        }
        if self.max_depth == 0 || self.max_depth as usize > akari_visibility::tree::MAX_DEPTH {
            return refuse(format!(
                "maximum depth {}: it lies between 1 and {}",
                self.max_depth,
                akari_visibility::tree::MAX_DEPTH
            ));
        }
        if let Some(distance) = self.max_distance
            && !(distance > 0.0 && distance.is_finite())
        {
            return refuse(format!("maximum distance {distance}: it is above 0"));
        }
        if self.threads == Some(0) {
            return refuse("0 threads: at least 1".to_owned());
        }
        let Shard { index, count } = self.shard;
        if index == 0 || index > count {
            return refuse(format!(
                "shard {index}/{count}: from 1/{count} to {count}/{count}"
            ));
        }
        Ok(())
    }
}

/// What a bake is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Choosing how finely each triangle is sampled; counted in triangles.
    Levels,
    /// Visibility and trees of the samples; counted in samples.
    Samples,
    /// Putting the file together.
    Writing,
}

/// How far a bake is.
#[derive(Clone, Copy, Debug)]
pub struct Status {
    /// What is being done.
    pub phase: Phase,
    /// Done in this phase, what an earlier run left included.
    pub done: u64,
    /// Of how many.
    pub total: u64,
    /// Of `done`, what an earlier run had left.
    pub resumed: u64,
    /// Since this phase began.
    pub elapsed: Duration,
    /// Estimate of what is left of this phase, once there is something to estimate from.
    pub left: Option<Duration>,
}

/// Told how far the bake is, and asked whether to go on. Called from any thread, several times per second.
pub trait Progress: Sync {
    /// Something was done.
    fn update(&self, status: &Status);
    /// Whether to stop: [`crate::bake`] then keeps what is done and gives [`Error::Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }
}

/// Reports to nobody and never cancels.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProgress;

impl Progress for NoProgress {
    fn update(&self, _: &Status) {}
}
