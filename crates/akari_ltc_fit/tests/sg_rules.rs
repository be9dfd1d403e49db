//! What `akari_math::sg` ships to integrate spherical Gaussians over polygons with: that the fits still make it, and its
//! figures. The ignored tests print the tables.

use akari_ltc_fit::sg::mixture::{Mixture, mean_square_error};
use akari_ltc_fit::sg::rule::{Family, Rule, cost, samples};
use akari_math::sg::ltc::sg_mixture;
use akari_math::sg::polygon::RULE_NODES;

/// Seeds of the samples of the fit, and of samples that it has not seen.
const FIT: u64 = 3;
const FRESH: u64 = 99;

#[test]
fn shipped_rules_are_those_of_the_fit() {
    let seen = samples(FIT);
    // Rules of more nodes take the best part of a minute to fit.
    for nodes in [1_u32, 2, 3] {
        let shipped = cost(|at| Rule::shipped(nodes, at), nodes as usize, &seen);
        let fitted = Family::fitted(nodes as usize, &seen);
        let fitted = cost(|at| fitted.at(at), nodes as usize, &seen);
        println!("{nodes} nodes: shipped {shipped:.3e}, fitted {fitted:.3e}");
        assert!(shipped < 1.02 * fitted, "{nodes}: {shipped} {fitted}");
    }
}

#[test]
fn shipped_rules_beat_gauss_legendre_on_fresh_triangles() {
    let fresh = samples(FRESH);
    for nodes in RULE_NODES {
        let shipped = cost(|at| Rule::shipped(nodes, at), nodes as usize, &fresh);
        let gauss = Family::gauss_legendre(nodes as usize);
        let gauss = cost(|at| gauss.at(at), nodes as usize, &fresh);
        println!("{nodes} nodes: shipped {shipped:.3e}, Gauss-Legendre {gauss:.3e}");
        assert!(shipped < 0.8 * gauss, "{nodes}: {shipped} {gauss}");
        // Another rule is noticed.
        let other = cost(|at| Rule::shipped(nodes, 0.7 * at), nodes as usize, &fresh);
        assert!(other > 1.02 * shipped, "{nodes}: {shipped} {other}");
    }
}

/// Widths and weights, which add up to 1.
fn shipped_mixture(lobes: u32, sharpness: f64) -> Vec<(f64, f64)> {
    let mixture = sg_mixture(lobes, sharpness as f32);
    let whole = f64::from(mixture.weights.element_sum());
    let (widths, weights) = (mixture.widths.to_array(), mixture.weights.to_array());
    (0..lobes as usize)
        .map(|i| (f64::from(widths[i]), f64::from(weights[i]) / whole))
        .collect()
}

#[test]
fn mixtures() {
    // Okada and Iwasaki 2017 state 0.0024 and 0.0020 for one lobe.
    for (lobes, limits) in [(1, [0.0024, 0.0019]), (2, [1e-4, 2e-4]), (3, [2e-5, 5e-5])] {
        let fitted = Mixture::fitted(lobes as usize);
        for (sharpness, limit) in [10.0, 50.0].into_iter().zip(limits) {
            let error = mean_square_error(&shipped_mixture(lobes, sharpness), sharpness);
            println!("{lobes} lobes, sharpness {sharpness}: mean square error {error:.2e}");
            assert!(error <= limit, "{lobes} {sharpness}: {error}");
        }
        for sharpness in [4.0, 7.0, 10.0, 30.0, 1e3, 1e6] {
            for (shipped, fitted) in shipped_mixture(lobes, sharpness)
                .into_iter()
                .zip(fitted.at(sharpness))
            {
                assert!((shipped.0 / fitted.0 - 1.0).abs() < 1e-3);
                assert!((shipped.1 - fitted.1).abs() < 1e-2);
            }
        }
    }
    // A lobe a tenth wider is told from the best one.
    let [(width, weight)] = shipped_mixture(1, 10.0)[..] else {
        panic!("one lobe");
    };
    assert!(mean_square_error(&[(1.1 * width, weight)], 10.0) > 0.0024);
}

#[test]
#[ignore = "prints the tables of akari_math::sg::polygon; a minute"]
fn print_rules() {
    let (seen, fresh) = (samples(FIT), samples(FRESH));
    for nodes in RULE_NODES {
        let family = Family::fitted(nodes as usize, &seen);
        print!("fit {nodes}:");
        for (sharpness, group) in akari_ltc_fit::sg::rule::sharpnesses().zip(&fresh) {
            let rule = family.at(sharpness);
            let errors = group.iter().map(|sample| sample.error(&rule).abs());
            let (largest, sum) = errors.fold((0.0, 0.0), |(m, s), e| (f64::max(m, e), s + e));
            print!(" {largest:.1e}/{:.0e}", sum / group.len() as f64);
        }
        println!("\n{}\n{}", family.literals(true), family.literals(false));
    }
}

#[test]
#[ignore = "prints the coefficients of akari_math::sg::ltc"]
fn print_mixtures() {
    for lobes in 1..=3 {
        println!("{lobes} lobes\n{}", Mixture::fitted(lobes).literals());
    }
}
