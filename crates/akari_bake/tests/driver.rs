//! The file does not depend on threads, interruptions and shards.

mod common;

use akari_bake::{Error, NoProgress, Options, bake, journal_path};
use akari_visibility::bake::Bake;
use akari_visibility::part::{Part, Shard, merge};
use common::{Watch, files, quick, small};

#[test]
fn threads_do_not_matter_and_nothing_is_left_beside_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = small();
    let mut first: Option<Vec<u8>> = None;
    for threads in [1, 2, 5] {
        let output = folder.path().join(format!("{threads}.akari"));
        let options = Options {
            threads: Some(threads),
            ..quick()
        };
        let watch = Watch::default();
        let report = bake(&geometry, &options, &output, &watch).unwrap();
        let bytes = std::fs::read(&output).unwrap();
        assert_eq!(report.bytes, bytes.len() as u64);
        assert!(!report.was_complete && report.resumed_samples == 0);
        assert_eq!(
            report.levels.iter().sum::<u64>(),
            geometry.topology().triangles.len() as u64
        );
        // The floor is refined.
        assert!(report.levels.len() > 1, "{report:?}");
        assert!(report.leaves_per_sample() > 6.0 && report.mean_absolute_error() < 0.01);
        assert_eq!(first.get_or_insert_with(|| bytes.clone()), &bytes);
        let last = watch.last.lock().unwrap().unwrap();
        assert_eq!(last.done, last.total);
        std::fs::remove_file(&output).unwrap();
        assert!(files(folder.path()).is_empty());
    }
    // The wrong way: other settings do give another file.
    let output = folder.path().join("other.akari");
    let options = Options {
        leaf_tolerance: 0.01,
        ..quick()
    };
    bake(&geometry, &options, &output, &NoProgress).unwrap();
    assert_ne!(first.unwrap(), std::fs::read(&output).unwrap());
}

#[test]
fn an_interrupted_bake_continues() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = small();
    let whole = folder.path().join("whole.akari");
    let report = bake(&geometry, &quick(), &whole, &NoProgress).unwrap();
    let output = folder.path().join("a.akari");
    let mut interruptions = 0;
    let resumed = loop {
        let watch = Watch {
            stop_after: Some(100),
            ..Watch::default()
        };
        match bake(&geometry, &quick(), &output, &watch) {
            Err(Error::Cancelled) => interruptions += 1,
            other => break other.unwrap(),
        }
        assert!(!output.exists() && journal_path(&output).exists());
        assert!(interruptions < 100);
    };
    assert!(interruptions >= 3, "{interruptions}");
    assert!(resumed.resumed_samples > 0);
    assert_eq!(
        std::fs::read(&whole).unwrap(),
        std::fs::read(&output).unwrap()
    );
    // What the report says of the result does not depend on it either.
    assert_eq!(resumed.leaves, report.leaves);
    assert_eq!(resumed.absolute_error, report.absolute_error);
    assert_eq!(resumed.samples, report.samples);

    // A finished bake is left as it is; without `resume` it is made again.
    let again = bake(&geometry, &quick(), &output, &NoProgress).unwrap();
    assert!(again.was_complete && again.bytes == report.bytes);
    let anew = Options {
        resume: false,
        ..quick()
    };
    assert!(
        !bake(&geometry, &anew, &output, &NoProgress)
            .unwrap()
            .was_complete
    );
    assert_eq!(files(folder.path()), ["a.akari", "whole.akari"]);
    // Other settings are another bake.
    let other = Options {
        leaf_tolerance: 0.01,
        ..quick()
    };
    assert!(
        !bake(&geometry, &other, &output, &NoProgress)
            .unwrap()
            .was_complete
    );
}

#[test]
fn shards_merge_to_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = small();
    let whole = folder.path().join("whole.akari");
    bake(&geometry, &quick(), &whole, &NoProgress).unwrap();
    let expected = std::fs::read(&whole).unwrap();
    for count in [3, 8] {
        let mut parts = Vec::new();
        let mut samples = 0;
        for index in 1..=count {
            let output = folder.path().join(format!("{index}-{count}.part"));
            let options = Options {
                shard: Shard { index, count },
                threads: Some(1 + index as usize % 2),
                ..quick()
            };
            let report = bake(&geometry, &options, &output, &NoProgress).unwrap();
            samples += report.samples;
            assert!(
                bake(&geometry, &options, &output, &NoProgress)
                    .unwrap()
                    .was_complete
            );
            parts.push((format!("part {index}"), Part::read(&output).unwrap()));
        }
        parts.reverse();
        let merged = merge(&parts).unwrap();
        let output = folder.path().join("merged.akari");
        merged.write(&output).unwrap();
        assert_eq!(expected, std::fs::read(&output).unwrap(), "{count} shards");
        // Hardly anything is sampled twice or in vain.
        assert!(samples < merged.trees.len() as u64 * 11 / 10, "{samples}");
        // One part less is refused.
        parts.pop();
        assert!(merge(&parts).is_err());
    }
}

#[test]
fn a_bake_says_where_its_samples_are() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = small();
    let output = folder.path().join("a.akari");
    bake(&geometry, &quick(), &output, &NoProgress).unwrap();
    let read = Bake::read(&output).unwrap();
    assert_eq!(read.settings, quick().settings(geometry.enclosure()));
    assert_eq!(read.identity, akari_bake::identity(&geometry, &quick()));
    assert_eq!(read.instances.len(), 2);
    assert_eq!(read.positions.len(), read.trees.len());
    for p in &read.positions {
        let on_floor = (p[1] + 0.2).abs() < 1e-6;
        let radius = glam::Vec3::from(*p).distance(glam::Vec3::new(0.1, 0.4, 0.0));
        assert!(on_floor || (0.3..0.5).contains(&radius), "{p:?}");
    }
}

#[test]
fn large_faces_and_short_rays() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = small();
    let output = folder.path().join("a.akari");
    let mut visible = Vec::new();
    for (face_size, max_distance) in [(32, None), (128, None), (32, Some(0.3)), (32, Some(1e-3))] {
        let options = Options {
            face_size,
            max_distance,
            max_level: 0,
            resume: false,
            ..quick()
        };
        bake(&geometry, &options, &output, &NoProgress).unwrap();
        let read = Bake::read(&output).unwrap();
        // Straight up and aside, from everywhere.
        let mut sum = 0.0;
        for sample in 0..read.trees.len() as u32 {
            for k in 0..16 {
                let (sin, cos) = (0.4 * k as f32).sin_cos();
                let direction = glam::Vec3::new(cos, 0.1 + 0.1 * k as f32, sin);
                sum += read.visibility_at(sample, direction);
            }
        }
        visible.push(sum / (16 * read.trees.len()) as f32);
    }
    let [all, large, near, nothing] = visible[..] else {
        panic!("four bakes were made");
    };
    assert!((all - large).abs() < 0.02, "{visible:?}");
    assert!(near > all + 0.005 && nothing > near + 0.05, "{visible:?}");
}

#[test]
fn options_out_of_range_and_unwritable_places_are_refused() {
    let geometry = small();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("a.akari");
    let refused = [
        Options {
            face_size: 48,
            ..quick()
        },
        Options {
            leaf_tolerance: f32::NAN,
            ..quick()
        },
        Options {
            shadow_tolerance: 0.0,
            ..quick()
        },
        Options {
            max_level: 11,
            ..quick()
        },
        Options {
            max_depth: 65,
            ..quick()
        },
        Options {
            max_distance: Some(f32::INFINITY),
            ..quick()
        },
        Options {
            threads: Some(0),
            ..quick()
        },
        Options {
            shard: Shard { index: 4, count: 3 },
            ..quick()
        },
    ];
    for options in refused {
        let error = bake(&geometry, &options, &output, &NoProgress).unwrap_err();
        assert!(matches!(error, Error::Options(_)), "{options:?}: {error}");
    }
    let nowhere = folder.path().join("no/a.akari");
    let message = bake(&geometry, &quick(), &nowhere, &NoProgress)
        .unwrap_err()
        .to_string();
    assert!(message.contains("no/a.akari"), "{message}");
    assert!(files(folder.path()).is_empty());
}
