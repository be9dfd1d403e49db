//! Fits the table of linearly transformed cosines that `akari_math` ships, and measures it.
//!
//! The table stands for isotropic GGX with height-correlated Smith masking. A renderer that uses it clips the light
//! to the surface's horizon **first**, then applies M⁻¹, then clips again; so the lobe that counts is the part of
//! D above the surface, and the fit is free to put the rest below it (the published fit is not: Heitz, Dupuy, Hill,
//! Neubelt 2016, *Real-Time Polygonal-Light Shading with Linearly Transformed Cosines*). Under the lobe lies a tail that
//! is linear in the direction, fitted with it ([`Model`]), for lights far from the mirror direction.
//!
//! - [`fit_table`] fits, [`generate`] writes the file that `akari_math::ltc::table` includes.
//! - [`sg`] fits what integrates spherical Gaussians over polygons: quadrature rules and mixtures of cosines.
//! - [`quality()`] measures a table (total variation, albedo, integrals over polygons), [`report()`] prints the figures.

pub mod brdf;
mod fit;
pub mod lobe;
mod objective;
pub mod polygon;
pub mod quadrature;
pub mod quality;
pub mod report;
pub mod sg;
pub mod spheres;
pub mod table;

pub use fit::{coordinates, fit_cells, fit_table, flushed_half, reflection_at};
pub use lobe::{Lobe, Model};
pub use quality::{Quality, quality};
pub use report::report;
pub use table::{Entry, Table, TableError};

use std::io::Write;
use std::path::Path;

/// Cells along each edge of the shipped table.
pub const RESOLUTION: usize = 64;

/// Smallest GGX width α that the table holds; smoother cells repeat it.
///
/// The smallest entries that matter, about 2 α n·v in row 2 of B, are then normal f16 numbers down to n·v = 0.03, the
/// last row but one.
pub const MIN_ALPHA: f64 = 1e-3;

/// Smallest n·v at which a lobe is evaluated. No view reads the last row (n·v = 0) alone: it is fitted to the views
/// between it and the row above.
pub const MIN_N_DOT_V: f64 = 4e-3;

/// Fits the shipped table and writes it to `out_path`; see [`fit_table`] and [`write_table`].
///
/// Takes minutes on two cores. `progress(done, total)` is called from worker threads.
pub fn generate(out_path: &Path, progress: impl Fn(usize, usize) + Sync) -> std::io::Result<Table> {
    let table = fit_table(RESOLUTION, progress);
    write_table(&table, out_path)?;
    Ok(table)
}

/// Writes a table through a temporary file beside `out_path` and a rename, so that no half-written file can be seen.
pub fn write_table(table: &Table, out_path: &Path) -> std::io::Result<()> {
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
        // The error that counts is the first one; the file may never have been created.
        let _ = std::fs::remove_file(temporary);
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writing_replaces_the_file_and_leaves_nothing_else() {
        let folder = std::env::temp_dir().join(format!("akari_ltc_fit_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        let path = folder.join("table.bin");
        std::fs::write(&path, b"old").expect("the old file");
        let entry = Entry::from_array([1.0, 0.0, 0.0, 1.0, 0.5, 0.25, 0.1, 1.0]);
        let table = Table::from_entries(2, &[entry; 4]);
        write_table(&table, &path).expect("the folder can be written");
        assert_eq!(
            std::fs::read(&path).expect("the file is there"),
            table.to_bytes()
        );
        assert_eq!(
            std::fs::read_dir(&folder)
                .expect("the folder is there")
                .count(),
            1
        );
        // A folder that is not there: an error, not a panic.
        assert!(write_table(&table, &folder.join("no").join("table.bin")).is_err());
        std::fs::remove_dir_all(&folder).expect("the folder can be removed");
    }
}
