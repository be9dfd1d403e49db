//! Which tiles of a view's pixels a pass has to work on: lists that the GPU makes, and dispatches that follow them.
//!
//! `akari_lobes` sorts the tiles of every view with guides; a pass that reads `akari_lobes::tiles` is dispatched by
//! [`ViewTiles::dispatch`], and never runs on a tile that has nothing for it.

use bevy::prelude::*;
use bevy::render::render_resource::{Buffer, ComputePass};

/// Pixels of a tile along each axis, and invocations along each axis of a workgroup that works on one.
pub const TILE_SIZE: u32 = 8;
/// Pixels per texel and axis that a pass may work at.
pub const TILE_SCALES: [u32; 3] = [1, 2, 4];
/// Words of the arguments of a dispatch: workgroups along x, y and z.
const ARGUMENT_WORDS: usize = 3;

/// Lists of tiles, by what is in them; the numbers are those of `akari_lobes::tiles`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TileKind {
    /// At least one lit surface.
    Surface = 0,
    /// At least one surface that reflects more sharply than a diffuse one.
    Glossy = 1,
    /// Lit surfaces, none of them glossy.
    Matte = 2,
}

impl TileKind {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Surface, Self::Glossy, Self::Matte];

    /// Name of the counter that tells how many tiles of a frame are of this kind.
    pub fn counter(self) -> &'static str {
        match self {
            Self::Surface => "tiles with surfaces",
            Self::Glossy => "tiles with glossy surfaces",
            Self::Matte => "tiles with matte surfaces alone",
        }
    }
}

/// Arguments of the dispatches over a view's tiles.
#[derive(Debug, Clone)]
pub struct ViewTiles {
    /// As many workgroups as there are listed tiles, for each of [`TileKind::ALL`] and [`TILE_SCALES`].
    pub arguments: Buffer,
}

impl ViewTiles {
    /// Runs the pass's pipeline on the tiles of a kind. A workgroup has [`TILE_SIZE`]² invocations, which are pixels of one
    /// tile at scale 1, and texels of as many tiles as they fill at a larger one.
    pub fn dispatch(&self, pass: &mut ComputePass, kind: TileKind, scale: u32) {
        pass.dispatch_workgroups_indirect(&self.arguments, argument_offset(kind, scale));
    }
}

fn scale_index(scale: u32) -> usize {
    TILE_SCALES
        .iter()
        .rposition(|known| *known <= scale)
        .unwrap_or(0)
}

/// Where the arguments are, bytes.
fn argument_offset(kind: TileKind, scale: u32) -> u64 {
    let index = kind as usize * TILE_SCALES.len() + scale_index(scale);
    (index * ARGUMENT_WORDS * size_of::<u32>()) as u64
}

/// Tiles along each axis.
pub fn tile_grid(size: UVec2) -> UVec2 {
    size.map(|pixels| pixels.div_ceil(TILE_SIZE))
}

/// The arguments before any tile is listed: rows of workgroups as wide as the grid, and none of them. The GPU adds rows, so
/// that no dimension exceeds the limit of a dispatch, and less than one row is idle.
pub fn empty_arguments(grid: UVec2) -> Vec<u32> {
    TileKind::ALL
        .iter()
        .flat_map(|_| TILE_SCALES)
        .flat_map(|scale| [grid.x.div_ceil(scale * scale), 0, 1])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_where_dispatches_look_for_them() {
        let arguments = empty_arguments(UVec2::new(33, 7));
        for kind in TileKind::ALL {
            for scale in TILE_SCALES {
                let at = argument_offset(kind, scale) as usize / size_of::<u32>();
                let row = 33u32.div_ceil(scale * scale);
                assert_eq!(arguments[at..at + ARGUMENT_WORDS], [row, 0, 1]);
            }
        }
        let last = argument_offset(TileKind::Matte, 4) as usize / size_of::<u32>();
        assert_eq!(arguments.len(), last + ARGUMENT_WORDS);
    }

    #[test]
    fn a_grid_covers_every_pixel() {
        assert_eq!(tile_grid(UVec2::new(64, 65)), UVec2::new(8, 9));
        // A row of tiles of the widest of screens is within the limit of a dispatch, 65,535.
        assert!(tile_grid(UVec2::splat(32_768)).x <= 65_535);
    }
}
