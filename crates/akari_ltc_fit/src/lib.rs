//! Fits the table of linearly transformed cosines that `akari_math` ships, and measures it.
//!
//! The table stands for isotropic GGX with height-correlated Smith masking. A renderer that uses it clips the light
//! to the surface's horizon **first**, then applies M⁻¹, then clips again; so the lobe that counts is the part of
//! D above the surface, and the fit is free to put the rest below it (the published fit is not: Heitz, Dupuy, Hill,
//! Neubelt 2016, *Real-Time Polygonal-Light Shading with Linearly Transformed Cosines*).
//!
//! - [`fit_table`] fits, [`generate`] writes the file that `akari_math::ltc::table` includes.
//! - [`quality`] measures a table: total variation, albedo, integrals over polygons.

pub mod brdf;
mod fit;
mod objective;
pub mod lobe;
pub mod polygon;
pub mod quadrature;
mod quality;
pub mod table;

pub use fit::{cell_coordinates, fit_cells, fit_table};
pub use lobe::Lobe;
pub use quality::{Bevy, IntegralBin, Published, Quality, TotalVariation, quality, report};
pub use table::{Entry, Table, TableError};

use std::io::Write;
use std::path::Path;

/// Cells along each edge of the shipped table.
pub const RESOLUTION: usize = 64;

/// Smallest GGX width α that the table holds; smoother cells repeat it.
///
/// f16 resolves the lobe's direction to 2⁻¹² rad ≈ 2.4e-4, so a lobe much narrower than this would only jitter from
/// cell to cell; and the smallest entry that matters, 2 α n·v in row 2 of M⁻¹, stays a normal f16 number.
pub const MIN_ALPHA: f64 = 1e-3;

/// n·v of the last row. At 0 itself the lobe of a smooth surface degenerates.
pub const MIN_N_DOT_V: f64 = 4e-3;

/// Fits the shipped table and writes it to `out_path` through a temporary file beside it and a rename.
///
/// `progress(done, total)` is called from worker threads.
pub fn generate(out_path: &Path, progress: impl Fn(usize, usize) + Sync) -> std::io::Result<Table> {
    let table = fit_table(RESOLUTION, progress);
    let mut temporary = out_path.as_os_str().to_owned();
    temporary.push(".partial");
    let temporary = Path::new(&temporary);
    let written = std::fs::File::create(temporary)
        .and_then(|mut file| {
            file.write_all(&table.to_bytes())?;
            file.sync_all()
        })
        .and_then(|()| std::fs::rename(temporary, out_path));
    if written.is_err() {
        // The error that counts is the first one.
        let _ = std::fs::remove_file(temporary);
    }
    written.map(|()| table)
}
