//! The twin table: every WGSL function of `akari_math` against its Rust twin, and the twin against the formula in f64.

mod bounds;
mod clusters;
mod elliptic;
mod filters;
mod footprints;
mod ggx;
mod hard_classes;
mod harness;
mod invariants;
mod layout;
mod light_image;
mod lookup;
mod ltc;
mod mirrored_light;
mod ndf_filter;
mod noise;
mod packing;
mod places;
mod properties;
mod reflection_lobes;
mod reflector;
mod segment;
mod sg;
mod sg_polygon_terms;
mod sg_polygons;
mod shadows;
mod signals;
mod soft_shadow;
mod special;
mod voxel;
mod voxel_cones;
mod voxel_coverage;
mod weight_properties;
mod weight_terms;
mod weights;

use akari_gpu_test::{gpu_or_skip, module_functions};
use akari_math::WGSL_MODULES;
use harness::{Case, figures, violation, widen};
use std::collections::BTreeSet;

/// All rows of the table.
fn table() -> Vec<Case> {
    let mut cases = special::cases();
    cases.extend(sg::cases());
    cases.extend(sg_polygon_terms::cases());
    cases.extend(elliptic::cases());
    cases.extend(mirrored_light::cases());
    cases.extend(ggx::cases());
    cases.extend(clusters::cases());
    cases.extend(reflector::cases());
    cases.extend(places::cases());
    cases.extend(segment::cases());
    cases.extend(packing::cases());
    cases.extend(ltc::cases());
    cases.extend(lookup::cases());
    cases.extend(light_image::cases());
    cases.extend(bounds::cases());
    cases.extend(signals::cases());
    cases.extend(weights::cases());
    cases.extend(weight_terms::cases());
    cases.extend(noise::cases());
    cases.extend(filters::cases());
    cases.extend(ndf_filter::cases());
    cases.extend(shadows::cases());
    cases.extend(voxel::cases());
    cases.extend(voxel_cones::cases());
    cases.extend(soft_shadow::cases());
    cases.extend(voxel_coverage::cases());
    cases
}

/// Functions of modules that are tested beside this table, with where.
const ELSEWHERE: &[(&str, &str)] = &[];

#[test]
fn every_function_is_in_the_table() {
    let covered: BTreeSet<(String, String)> = table()
        .iter()
        .flat_map(|case| {
            case.functions
                .iter()
                .map(|function| (case.module.to_owned(), (*function).to_owned()))
        })
        .collect();
    let mut missing = Vec::new();
    let mut existing = BTreeSet::new();
    for (path, _) in WGSL_MODULES {
        let functions =
            module_functions(WGSL_MODULES, path).unwrap_or_else(|error| panic!("{path}: {error}"));
        for function in functions {
            let elsewhere = ELSEWHERE.iter().any(|(module, _)| module == path);
            if !elsewhere && !covered.contains(&((*path).to_owned(), function.clone())) {
                missing.push(format!("{path}::{function}"));
            }
            existing.insert(((*path).to_owned(), function));
        }
    }
    assert!(
        missing.is_empty(),
        "without a row in the twin table: {missing:?}"
    );
    let gone: Vec<_> = covered.difference(&existing).collect();
    assert!(
        gone.is_empty(),
        "in the twin table, but not in the WGSL: {gone:?}"
    );
}

#[test]
fn rust_twins_are_accurate() {
    let mut failures = Vec::new();
    for case in table() {
        let twin = case.twin_output();
        let oracle = case.oracle_output();
        for (domain, range) in case.output_ranges() {
            let name = format!("{} [{}]", case.name(), domain.name);
            let Some(oracle) = &oracle else {
                if let Some(bad) = twin[range.clone()].iter().position(|y| !y.is_finite()) {
                    failures.push(format!("{name}: output {bad} is not finite"));
                }
                continue;
            };
            let (actual, expected) = (&twin[range.clone()], &oracle[range]);
            println!("{name}: {}", figures(actual, expected));
            if let Some((count, worst)) = violation(actual, expected, domain.accuracy) {
                failures.push(format!(
                    "{name}: {count} out of {:?}; worst {worst}",
                    domain.accuracy
                ));
            }
        }
    }
    assert!(
        failures.is_empty(),
        "twins off their oracle:\n{}",
        failures.join("\n")
    );
}

#[test]
fn wgsl_agrees_with_the_rust_twins() {
    let Some(gpu) = gpu_or_skip("wgsl_agrees_with_the_rust_twins") else {
        return;
    };
    let mut failures = Vec::new();
    for case in table() {
        let expected = widen(&case.twin_output());
        let actual = match case.device_output(gpu, None) {
            Ok(actual) => actual,
            Err(error) => {
                failures.push(format!("{}: {error}", case.name()));
                continue;
            }
        };
        for (domain, range) in case.output_ranges() {
            let name = format!("{} [{}]", case.name(), domain.name);
            let (actual, expected) = (&actual[range.clone()], &expected[range]);
            println!("{name}: {}", figures(actual, expected));
            if let Some((count, worst)) = violation(actual, expected, domain.device) {
                failures.push(format!(
                    "{name}: {count} out of {:?}; worst {worst}",
                    domain.device
                ));
            }
        }
    }
    assert!(
        failures.is_empty(),
        "WGSL off its twin:\n{}",
        failures.join("\n")
    );
}

/// Each mutation must be noticed by some budget, and each budget must notice some mutation.
#[test]
fn every_budget_can_fail() {
    let Some(gpu) = gpu_or_skip("every_budget_can_fail") else {
        return;
    };
    let mut failures = Vec::new();
    let mut mutations = 0;
    for case in table() {
        let expected = widen(&case.twin_output());
        let ranges = case.output_ranges();
        let mut noticed = vec![false; ranges.len()];
        for mutation in &case.mutations {
            mutations += 1;
            let change = format!("{}: {} -> {}", case.name(), mutation.from, mutation.to);
            let actual = match case.device_output(gpu, Some(mutation)) {
                Ok(actual) => actual,
                Err(error) => {
                    failures.push(format!("{change}: {error}"));
                    continue;
                }
            };
            let mut any = false;
            for (noticed, (domain, range)) in noticed.iter_mut().zip(&ranges) {
                let fails = violation(
                    &actual[range.clone()],
                    &expected[range.clone()],
                    domain.device,
                )
                .is_some();
                *noticed |= fails;
                any |= fails;
            }
            if !any {
                failures.push(format!("{change}: not noticed"));
            }
        }
        for (noticed, (domain, _)) in noticed.iter().zip(&ranges) {
            if !noticed {
                failures.push(format!(
                    "{} [{}]: no mutation fails this budget",
                    case.name(),
                    domain.name
                ));
            }
        }
    }
    println!("{mutations} mutations");
    assert!(
        failures.is_empty(),
        "budgets that cannot fail:\n{}",
        failures.join("\n")
    );
}
