//! The table that `akari_math` ships: its figures, its layout, and that the fitter still makes it.

use akari_ltc_fit::quality::{
    Clipping, Place, distance, integral_bin, measure, measure_cells, measure_grid,
};
use akari_ltc_fit::report::{
    PUBLISHED_ALBEDO_ERROR, PUBLISHED_MAX_TOTAL_VARIATION, PUBLISHED_MEAN_TOTAL_VARIATION, Summary,
};
use akari_ltc_fit::spheres::{SphereError, spheres};
use akari_ltc_fit::{
    Entry, RESOLUTION, Table, coordinates, fit_cells, flushed_half, reflection_at,
};
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
        mirror: [e.mirror[0], e.mirror[2], e.mirror[1], e.mirror[3]],
        ..e
    });
    let grid = Summary::of(&measure_grid(&transposed));
    // In the mirror frame a symmetric lobe is its own transpose; the skewed ones tell.
    assert!(
        grid.mean_total_variation > 3.0 * MEAN_TOTAL_VARIATION
            && grid.max_total_variation > 3.0 * MAX_TOTAL_VARIATION,
        "{grid:?}"
    );
}

#[test]
fn a_table_in_the_frame_of_the_normal_is_caught() {
    // What a renderer that forgot the mirror frame would shade with.
    let table = shipped();
    let n = table.resolution();
    let entries: Vec<Entry> = (0..n * n)
        .map(|i| {
            let entry = table.cell(i % n, i / n);
            let (_, n_dot_v) = coordinates(n, (i % n) as f64, (i / n) as f64);
            Entry {
                mirror: entry.model(1.0).lobe.in_mirror_frame(n_dot_v),
                ..entry
            }
        })
        .collect();
    let grid = Summary::of(&measure_grid(&Table::from_entries(n, &entries)));
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
        let [fresh_distance, stored_distance] =
            [fresh, &stored].map(|e| distance(&reflection, &e.model(reflection.n_dot_v)).0);
        // A mirror's lobe is so narrow that rounding its direction to f16 shows.
        let tolerance = if x == 0 { 0.1 } else { 0.01 };
        assert!(
            (fresh_distance - stored_distance).abs() <= tolerance,
            "({x}, {y}): total variation {fresh_distance} against {stored_distance}"
        );
        let terms = [(fresh.albedo(), stored.albedo()), (fresh.bias, stored.bias)];
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
            let (_, n_dot_v) = coordinates(RESOLUTION, x as f64, y as f64);
            let lobe = entry.model(n_dot_v).lobe;
            assert!(
                lobe.determinant() > 0.0 && lobe.norm() > 0.5,
                "({x}, {y}): {lobe:?}"
            );
            assert!(entry.scale >= 0.0 && entry.bias >= 0.0, "({x}, {y})");
            assert!(
                (0.0..1.0).contains(&entry.tail_z) && entry.tail_x.abs() <= entry.tail_z + 1e-3,
                "({x}, {y})"
            );
            let largest = entry
                .to_array()
                .into_iter()
                .map(f64::abs)
                .fold(0.0, f64::max);
            assert!(largest < 4.0, "({x}, {y}): {largest}");
            let flushed = Entry::from_array(entry.to_array().map(flushed_half));
            let lobe = flushed.model(n_dot_v).lobe;
            assert!(lobe.determinant() > 0.0, "({x}, {y}) when flushed");
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
    let bin = |roughness, place, clipping| {
        integral_bin(&shipped(), roughness, (60.0, 80.0), place, clipping)
    };
    for roughness in [0.3, 0.6, 1.0] {
        let near = bin(roughness, Place::NearMirror, Clipping::BeforeAndAfter);
        assert!(near.rms <= 0.06, "{near:?}");
    }
    // Far from the mirror direction a smooth surface hardly reflects; what counts there are the rough ones.
    for (roughness, largest) in [(0.4, 0.2), (0.6, 0.1), (0.8, 0.08), (1.0, 0.02)] {
        let off = bin(roughness, Place::OffMirror, Clipping::BeforeAndAfter);
        assert!(off.rms <= largest, "{off:?}");
    }
    // The first clip is part of the method: without it, light from below the surface leaks in.
    let [clipped, unclipped] = [Clipping::BeforeAndAfter, Clipping::AfterOnly]
        .map(|clipping| bin(0.3, Place::NearMirror, clipping));
    assert!(
        unclipped.rms > 1.2 * clipped.rms,
        "{clipped:?} {unclipped:?}"
    );
}

/// Relative RMSE of a table over spheres under the first two lights, which are those of the renderer's aim, and the
/// worst over all lights: (all pixels, those at 60° to 80°).
fn sphere_errors(table: &Table) -> [(f64, f64); 2] {
    let totals: Vec<SphereError> = spheres(table).iter().map(|e| e.total()).collect();
    let worst = |totals: &[SphereError]| {
        totals.iter().fold((0.0_f64, 0.0_f64), |worst, t| {
            (
                worst.0.max(t.all.relative_rmse()),
                worst.1.max(t.grazing.relative_rmse()),
            )
        })
    };
    [worst(&totals[..2]), worst(&totals)]
}

#[test]
fn spheres_under_lights_are_within_the_aims() {
    let [aim, worst] = sphere_errors(&shipped());
    assert!(aim.0 <= 0.015 && aim.1 <= 0.06, "{aim:?}");
    assert!(worst.0 <= 0.025 && worst.1 <= 0.08, "{worst:?}");
    // Without the tail, they are not.
    let bare = changed(&shipped(), |e| Entry {
        tail_z: 0.0,
        tail_x: 0.0,
        ..e
    });
    let [bare_aim, _] = sphere_errors(&bare);
    assert!(bare_aim.0 > 0.015 && bare_aim.1 > 0.06, "{bare_aim:?}");
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
