//! The table that `akari_math` ships: its figures, its layout, and that the fitter still makes it.

use akari_ltc_fit::quality::{
    Clipping, distance, integral_bin, measure, measure_cells, measure_grid,
};
use akari_ltc_fit::report::{
    PUBLISHED_ALBEDO_ERROR, PUBLISHED_MAX_TOTAL_VARIATION, PUBLISHED_MEAN_TOTAL_VARIATION, Summary,
};
use akari_ltc_fit::{Entry, Lobe, RESOLUTION, Table, fit_cells, flushed_half, reflection_at};
use akari_math::ltc::table::{SIZE, TABLE_BYTES, sample};

/// The aims: mean and largest total variation over the 48 cells of the published measurement, albedo error.
const MEAN_TOTAL_VARIATION: f64 = 0.05;
const MAX_TOTAL_VARIATION: f64 = 0.25;
const ALBEDO_ERROR: f64 = 0.01;

fn shipped() -> Table {
    Table::from_bytes(TABLE_BYTES).expect("the shipped file is a table")
}

/// A table with every entry changed.
fn changed(table: &Table, change: impl Fn(Entry) -> Entry) -> Table {
    let n = table.resolution();
    let entries: Vec<Entry> = (0..n * n)
        .map(|i| change(table.cell(i % n, i / n)))
        .collect();
    Table::from_entries(n, &entries)
}

#[test]
fn figures_are_within_the_aims_and_better_than_the_published_table() {
    let table = shipped();
    assert_eq!(table.resolution(), RESOLUTION);
    let grid = Summary::of(&measure_grid(&table));
    assert!(
        grid.mean_total_variation <= MEAN_TOTAL_VARIATION,
        "{grid:?}"
    );
    assert!(grid.max_total_variation <= MAX_TOTAL_VARIATION, "{grid:?}");
    assert!(grid.max_albedo_error <= ALBEDO_ERROR, "{grid:?}");
    assert!(grid.mean_total_variation < PUBLISHED_MEAN_TOTAL_VARIATION);
    assert!(grid.max_total_variation < PUBLISHED_MAX_TOTAL_VARIATION);
    assert!(grid.max_albedo_error < PUBLISHED_ALBEDO_ERROR);

    // Everywhere else: one lobe reaches 0.30 at n·v = 0.03, and interpolation adds to it for mirrors.
    let cells = Summary::of(&measure_cells(&table, 0.0));
    assert!(
        cells.mean_total_variation <= MEAN_TOTAL_VARIATION,
        "{cells:?}"
    );
    assert!(cells.max_total_variation <= 0.31, "{cells:?}");
    assert!(cells.max_albedo_error <= ALBEDO_ERROR, "{cells:?}");
    assert!(cells.max_fresnel_error <= ALBEDO_ERROR, "{cells:?}");
}

#[test]
fn albedo_between_the_cells_is_within_the_aim() {
    let midpoints = measure_cells(&shipped(), 0.5);
    let all = Summary::of(&midpoints);
    assert!(all.mean_total_variation <= MEAN_TOTAL_VARIATION, "{all:?}");
    // Between the last two rows the albedo of a smooth surface dips and recovers, which no straight line follows.
    let last_rows_n_dot_v = 0.03;
    assert!(
        all.max_albedo_error <= 0.03 && all.max_fresnel_error <= 0.03,
        "{all:?}"
    );
    let (inner, outer): (Vec<_>, Vec<_>) = midpoints
        .into_iter()
        .partition(|p| p.n_dot_v > last_rows_n_dot_v);
    assert!(!outer.is_empty());
    let inner = Summary::of(&inner);
    assert!(inner.max_albedo_error <= ALBEDO_ERROR, "{inner:?}");
    assert!(inner.max_fresnel_error <= ALBEDO_ERROR, "{inner:?}");
}

#[test]
fn a_transposed_table_is_caught() {
    let transposed = changed(&shipped(), |e| Entry {
        lobe: Lobe {
            m02: e.lobe.m20,
            m20: e.lobe.m02,
            ..e.lobe
        },
        ..e
    });
    let grid = Summary::of(&measure_grid(&transposed));
    assert!(grid.mean_total_variation > 0.4, "{grid:?}");
}

#[test]
fn a_table_with_its_axes_exchanged_is_caught() {
    let table = shipped();
    let n = table.resolution();
    let entries: Vec<Entry> = (0..n * n).map(|i| table.cell(i / n, i % n)).collect();
    let grid = Summary::of(&measure_grid(&Table::from_entries(n, &entries)));
    assert!(
        grid.mean_total_variation > 0.2 && grid.max_albedo_error > 0.1,
        "{grid:?}"
    );
}

#[test]
fn the_fitter_still_makes_the_table() {
    let table = shipped();
    let picks = [0, 12, 25, 38, 50, 63];
    let cells: Vec<(usize, usize)> = picks.iter().flat_map(|&y| picks.map(|x| (x, y))).collect();
    let fresh = fit_cells(RESOLUTION, &cells);
    for (&(x, y), fresh) in cells.iter().zip(&fresh) {
        let stored = table.cell(x, y);
        // The lobes as densities: entries of narrow lobes may differ where the density does not.
        let reflection = reflection_at(RESOLUTION, x as f64, y as f64);
        let (fresh_distance, _) = distance(&reflection, &fresh.lobe);
        let (stored_distance, _) = distance(&reflection, &stored.lobe);
        // A mirror's lobe is so narrow that rounding its direction to f16 shows.
        let tolerance = if x == 0 { 0.1 } else { 0.01 };
        assert!(
            (fresh_distance - stored_distance).abs() <= tolerance,
            "({x}, {y}): total variation {fresh_distance} against {stored_distance}"
        );
        let terms = [
            (fresh.albedo(), stored.albedo()),
            (fresh.bias * fresh.lobe_norm, stored.bias * stored.lobe_norm),
            (fresh.diffuse_fresnel, stored.diffuse_fresnel),
            (fresh.lobe_norm, stored.lobe_norm),
        ];
        for (i, (a, b)) in terms.into_iter().enumerate() {
            // The last row's terms follow its lobe, which may settle elsewhere.
            let tolerance = if y == RESOLUTION - 1 { 0.02 } else { 2e-3 };
            assert!(
                (a - b).abs() <= tolerance,
                "({x}, {y}), term {i}: {a} against {b}"
            );
        }
    }
}

#[test]
fn every_cell_is_a_lobe_also_where_subnormal_halves_are_flushed() {
    let table = shipped();
    for y in 0..RESOLUTION {
        for x in 0..RESOLUTION {
            let entry = table.cell(x, y);
            assert!(entry.lobe.determinant() > 0.0, "({x}, {y})");
            assert!(
                (entry.lobe_norm - entry.lobe.norm()).abs() < 1e-3,
                "({x}, {y})"
            );
            assert!(
                entry.lobe_norm > 0.5 && entry.scale >= 0.0 && entry.bias >= 0.0,
                "({x}, {y})"
            );
            let largest = entry
                .to_array()
                .into_iter()
                .map(f64::abs)
                .fold(0.0, f64::max);
            assert!(largest < 4.0, "({x}, {y}): {largest}");
            let flushed = Lobe::from_array(entry.lobe.to_array().map(flushed_half));
            assert!(flushed.determinant() > 0.0, "({x}, {y}) when flushed");
        }
    }
    let flushed = changed(&table, |e| {
        Entry::from_array(e.to_array().map(flushed_half))
    });
    let grid = Summary::of(&measure_grid(&flushed));
    assert!(
        grid.mean_total_variation <= MEAN_TOTAL_VARIATION,
        "{grid:?}"
    );
}

#[test]
fn integrals_over_lights_at_grazing_angles() {
    // The renderer's aim is 6 % at 60° to 80°; the published table has 4 % to 21 % there.
    for roughness in [0.3, 0.6, 1.0] {
        let bin = integral_bin(
            &shipped(),
            roughness,
            (60.0, 80.0),
            Clipping::BeforeAndAfter,
        );
        assert!(bin.rms <= 0.05, "{bin:?}");
    }
    // The first clip is part of the method: without it, light from below the surface leaks in.
    let [clipped, unclipped] = [Clipping::BeforeAndAfter, Clipping::AfterOnly]
        .map(|clipping| integral_bin(&shipped(), 0.3, (60.0, 80.0), clipping));
    assert!(
        unclipped.rms > 1.2 * clipped.rms,
        "{clipped:?} {unclipped:?}"
    );
}

#[test]
fn there_is_no_jump_between_neighbours() {
    // Two local minima side by side would show as a lobe halfway between them that is neither.
    let table = shipped();
    for y in (0..60).step_by(6) {
        for x in (8..63).step_by(6) {
            let (x, y) = (x as f64, y as f64);
            let middle = measure(&table, x + 0.5, y + 0.5).total_variation;
            let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
                .map(|(dx, dy)| measure(&table, x + dx, y + dy).total_variation);
            let worst = corners.into_iter().fold(0.0, f64::max);
            assert!(
                middle <= worst + 0.02,
                "({x}, {y}): {middle} between {corners:?}"
            );
        }
    }
}

#[test]
fn the_shipped_lookup_reads_what_the_fitter_means() {
    let table = shipped();
    assert_eq!(SIZE, RESOLUTION);
    for i in 0..=20 {
        for j in 0..=20 {
            let (roughness, n_dot_v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
            let expected = table.sample(roughness, n_dot_v).to_array();
            let read = sample(roughness as f32, n_dot_v as f32);
            let read = [read.texel0.to_array(), read.texel1.to_array()].concat();
            for (a, b) in expected.into_iter().zip(read) {
                assert!(
                    (a - f64::from(b)).abs() < 1e-5,
                    "{roughness} {n_dot_v}: {a} {b}"
                );
            }
        }
    }
}
