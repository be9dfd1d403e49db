//! GPU times of passes, out of Bevy's diagnostics.

use bevy::diagnostic::DiagnosticsStore;

/// GPU time of each pass in the last frame that was measured, milliseconds, by the name of its time span.
///
/// A pass that runs several times in a frame (once for each signal, once for each level) is the sum of its runs, and one
/// that no longer runs is not there: Bevy keeps one measurement for each run, and the last ones of what has stopped. All
/// measurements of a frame are entered at the same instant (`bevy_render::diagnostic`).
pub fn pass_times(store: &DiagnosticsStore) -> Vec<(&str, f64)> {
    let passes: Vec<_> = store
        .iter()
        .filter_map(|diagnostic| {
            let pass = diagnostic
                .path()
                .as_str()
                .strip_prefix("render/")?
                .strip_suffix("/elapsed_gpu")?;
            Some((pass, diagnostic, diagnostic.measurement()?.time))
        })
        .collect();
    let newest = passes.iter().map(|(.., time)| *time).max();
    passes
        .into_iter()
        .filter(|(.., time)| Some(*time) == newest)
        .map(|(pass, diagnostic, time)| {
            let runs = diagnostic.measurements().filter(|run| run.time == time);
            (pass, runs.map(|run| run.value).sum())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::diagnostic::{Diagnostic, DiagnosticMeasurement, DiagnosticPath};
    use std::time::{Duration, Instant};

    #[test]
    fn runs_of_a_frame_add_up_and_what_has_stopped_is_gone() {
        let mut store = DiagnosticsStore::default();
        let first = Instant::now();
        let second = first + Duration::from_millis(1);
        for (path, time, value) in [
            ("render/akari_filter/elapsed_gpu", first, 10.0),
            ("render/akari_gone/elapsed_gpu", first, 5.0),
            ("render/akari_filter/elapsed_gpu", second, 1.0),
            ("render/akari_filter/elapsed_gpu", second, 2.0),
            ("render/akari_filter/elapsed_cpu", second, 70.0),
            ("fps", second, 60.0),
        ] {
            let path = DiagnosticPath::new(path);
            if store.get(&path).is_none() {
                store.add(Diagnostic::new(path.clone()));
            }
            if let Some(diagnostic) = store.get_mut(&path) {
                diagnostic.add_measurement(DiagnosticMeasurement { time, value });
            }
        }
        assert_eq!(pass_times(&store), [("akari_filter", 3.0)]);
        assert!(pass_times(&DiagnosticsStore::default()).is_empty());
    }
}
