//! Adversarial inputs of every effect, in one table: each row runs in f64 (the oracle), in Rust and on the GPU.
//!
//! A row holds a function and *sweeps*: inputs in an order in which neighbours are near one another, through what breaks
//! naive forms (the horizon, the antipode of a lobe, the plane of a light, roughness 0 to 1, sharpness 0 to 1e30, sizes
//! from 1e-12 to 1e12). Of every sample it is asked that
//!
//! - nothing is NaN or infinite, and everything lies within the stated range (energy: at most 1),
//! - the result is within the stated error of the oracle,
//! - the *error* jumps by no more than stated from one sample to the next: the result is as continuous as the truth is.
//!
//! `every_guard_is_missed` takes guards out of the WGSL one by one; the table must notice each.
//!
//! No engine is linked into this binary: formulas only. What whole pictures do with such input is in `render`.

mod area_lights;
mod denoise;
mod interreflection;
mod lobes;
mod shadows;
mod table;
mod voxel_gi;

use akari_gpu_test::gpu_or_skip;
use std::collections::BTreeMap;
use table::{Guard, Row, check};

/// Effect and its rows.
fn table() -> Vec<(&'static str, Vec<Row>)> {
    vec![
        ("area lights", area_lights::rows()),
        ("denoise", denoise::rows()),
        ("interreflection", interreflection::rows()),
        ("lobes", lobes::rows()),
        ("shadows", shadows::rows()),
        ("voxel GI", voxel_gi::rows()),
    ]
}

fn guards() -> Vec<(&'static str, Vec<Guard>)> {
    vec![
        ("area lights", area_lights::guards()),
        ("denoise", denoise::guards()),
        ("interreflection", interreflection::guards()),
        ("lobes", lobes::guards()),
        ("shadows", shadows::guards()),
        ("voxel GI", voxel_gi::guards()),
    ]
}

/// Cases that each effect has at least: a table that lost its rows would hold everything.
const FEWEST: usize = 4000;

#[test]
fn rust_holds_every_bound() {
    run("Rust", |row| {
        let mut output = Vec::new();
        for input in row.input().chunks_exact(row.inputs) {
            (row.twin)(input, &mut output);
        }
        Some(output)
    });
}

#[test]
fn the_gpu_holds_every_bound() {
    let Some(gpu) = gpu_or_skip("the_gpu_holds_every_bound") else {
        return;
    };
    run("GPU", |row| match row.device_output(gpu, None) {
        Ok(output) => Some(output),
        Err(error) => {
            println!("{}: {error}", row.name);
            None
        }
    });
}

fn run(where_: &str, output: impl Fn(&Row) -> Option<Vec<f32>>) {
    let mut faults = Vec::new();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for (effect, rows) in table() {
        for row in rows {
            *counts.entry(effect).or_default() += row.cases();
            let Some(output) = output(&row) else {
                faults.push(format!("{effect}, {}: did not run", row.name));
                continue;
            };
            let verdicts = check(&row, &output);
            let nearest = verdicts.iter().max_by(|a, b| a.share.total_cmp(&b.share));
            let nearest = nearest.expect("a row has sweeps");
            println!(
                "{where_}, {effect}, {}: {} cases in {} sweeps, nearest to its bound ({:.0} %) is {}, error {:.1e}",
                row.name,
                row.cases(),
                verdicts.len(),
                100.0 * nearest.share,
                nearest.name,
                nearest.error
            );
            let found = verdicts.into_iter().filter_map(|verdict| verdict.fault);
            faults.extend(found.map(|fault| format!("{effect}, {}: {fault}", row.name)));
        }
    }
    for (effect, count) in &counts {
        println!("{where_}, {effect}: {count} cases");
        assert!(*count >= FEWEST, "{effect}: only {count} cases");
    }
    assert!(faults.is_empty(), "{where_}:\n{}", faults.join("\n"));
}

/// Each guard that is taken out of the shaders is noticed by the effect's rows.
#[test]
fn every_guard_is_missed() {
    let Some(gpu) = gpu_or_skip("every_guard_is_missed") else {
        return;
    };
    let table = table();
    let mut unnoticed = Vec::new();
    for (effect, guards) in guards() {
        assert!(!guards.is_empty(), "{effect}: no guard");
        let rows = table.iter().find(|(name, _)| *name == effect);
        let rows = &rows.expect("an effect of the table").1;
        for guard in guards {
            let row = rows.iter().find(|row| row.name == guard.row);
            let row = row.unwrap_or_else(|| panic!("{effect}: no row {}", guard.row));
            let faults: Vec<String> = match row.device_output(gpu, Some(&guard)) {
                Ok(output) => check(row, &output)
                    .into_iter()
                    .filter_map(|verdict| verdict.fault)
                    .collect(),
                Err(error) => panic!("{effect}, without {}: {error}", guard.what),
            };
            match faults.first() {
                Some(fault) => println!("{effect}, without {}: {fault}", guard.what),
                None => unnoticed.push(format!("{effect}: {}", guard.what)),
            }
        }
    }
    assert!(
        unnoticed.is_empty(),
        "guards that nothing misses:\n{}",
        unnoticed.join("\n")
    );
}

/// The checks themselves: each kind of fault is seen.
#[test]
fn each_kind_of_fault_is_seen() {
    let row = table::example();
    let good: Vec<f32> = row.input();
    assert!(check(&row, &good).iter().all(|v| v.fault.is_none()));
    let wrong = |index: usize, value: f32| {
        let mut output = good.clone();
        output[index] = value;
        check(&row, &output)
            .into_iter()
            .find_map(|verdict| verdict.fault)
            .expect("a fault")
    };
    assert!(wrong(3, f32::NAN).contains("not finite"));
    assert!(wrong(3, f32::from_bits(akari_gpu_test::UNWRITTEN)).contains("not written"));
    assert!(wrong(9, 1.5).contains("range"));
    assert!(wrong(3, good[3] + 0.2).contains("error"));
    // Half of the error that is allowed, to the other side at the next sample.
    let mut output = good.clone();
    output[4] += 0.06;
    output[5] -= 0.06;
    let faults: Vec<_> = check(&row, &output)
        .into_iter()
        .filter_map(|verdict| verdict.fault)
        .collect();
    assert!(faults[0].contains("jump"), "{faults:?}");
}
