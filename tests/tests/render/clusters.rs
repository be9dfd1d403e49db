//! Thousands of reflecting triangles behind few rectangles: how far the picture is from that of all triangles.

use bevy_akari::interreflection::pipeline::{AGGREGATE_LABEL, SHADE_LABEL};
use bevy_akari_tests::reflecting::{Corner, Material, relative_rmse, triangles_as_patches, wall};

/// Side of the pictures.
const SIDE: u32 = 16;
/// Squares along a side of the wall, two triangles each.
const ROWS: u32 = 71;
/// Nodes an edge of the integrals: 3.
const TIER: u32 = 6;

#[test]
fn clusters_are_as_near_to_their_triangles_as_is_asked() {
    let Some(mut corner) = Corner::new("clusters_are_as_near", SIDE) else {
        return;
    };
    // Bent, so that no rectangle is exact.
    for material in [Material::Lambert, Material::Metal(0.4)] {
        corner.build(wall(ROWS, 0.35), material);
        let plain = corner.plain();
        let aggregated = |corner: &Corner| {
            let passes = corner.headless.ledger().passes();
            [AGGREGATE_LABEL, SHADE_LABEL].map(|label| passes.get(label).copied().unwrap_or(0))
        };
        let before = aggregated(&corner);
        let all = corner.added(triangles_as_patches(TIER, 0.0), &plain);
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        assert!(mean > 1e-3, "{material:?}: nothing is reflected");
        assert_eq!(
            aggregated(&corner)[0],
            before[0],
            "no clusters were asked for"
        );
        let mut errors = Vec::new();
        for cut in [1.0, 0.4, 0.1] {
            let clustered = corner.added(triangles_as_patches(TIER, cut), &plain);
            let error = relative_rmse(&clustered, &all);
            let largest = (clustered.iter().zip(&all))
                .map(|(a, b)| (a - b).abs() / (b + mean))
                .fold(0.0, f64::max);
            println!(
                "{material:?}, error of at most {cut}: relative RMSE {:.2} %, largest {:.2} % of a pixel and the mean",
                100.0 * error,
                100.0 * largest
            );
            assert!(error > 0.0, "no cluster was taken");
            if cut < 1.0 {
                assert!(
                    error <= 0.5 * f64::from(cut),
                    "{material:?}, {cut}: {error}"
                );
                assert!(largest <= f64::from(cut), "{material:?}, {cut}: {largest}");
            }
            errors.push(error);
        }
        // Where any error is allowed it is more than what an error of at most 0.1 may be here.
        assert!(errors[0] > 0.05, "{material:?}: {errors:?}");
        assert!(errors[2] < errors[1], "{material:?}: {errors:?}");
        if material == Material::Lambert {
            assert!(aggregated(&corner)[0] > before[0], "light of clusters");
        }
    }
    let counters = corner.headless.ledger().counters();
    assert!(
        counters
            .get("interreflection clusters")
            .is_some_and(|&count| count > 1000)
    );
}
