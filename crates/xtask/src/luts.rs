//! `cargo xtask gen-luts`: fits the LTC table and writes the file that `akari_math` includes.
//!
//! The fitter is behind the feature `luts`, so that a first `cargo xtask demo` does not wait for it; without the
//! feature this task runs itself again with it, in the release profile.

use std::path::Path;

use crate::failure::Result;
use crate::workspace;

#[cfg(not(feature = "luts"))]
pub fn generate(out: &Path) -> Result<()> {
    let options = [
        "run",
        "--quiet",
        "--release",
        "--package",
        "xtask",
        "--features",
        "luts",
        "--",
        "gen-luts",
        "--out",
    ];
    workspace::run(workspace::cargo().args(options).arg(out))
}

#[cfg(feature = "luts")]
pub fn generate(out: &Path) -> Result<()> {
    use crate::failure::Context;

    let bar = indicatif::ProgressBar::new(0);
    let style = indicatif::ProgressStyle::with_template("{wide_bar} {pos}/{len} cells, {eta} left");
    bar.set_style(style.context(|| "progress bar".into())?);
    let out = workspace::root().join(out);
    let table = akari_ltc_fit::generate(&out, |done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    table.context(|| format!("cannot write {}", out.display()))?;
    println!("{}", out.display());
    Ok(())
}
