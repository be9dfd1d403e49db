#define_import_path akari_math::cluster

// Twin: `cluster.rs`, where the formulas, domains and sources are. Change both or neither.

#import akari_math::special::{one_minus_exp_neg_over_x, TINY}

const INV_PI: f32 = 0.318309886;
// Errors are cut off here.
const MOST_ERROR: f32 = 16.0;
// Floor of a GGX width in a denominator.
const MIN_ALPHA: f32 = 1e-3;

// 1 if a receiver is in front of all triangles, -1 if it is behind all, 0 if that is not known.
fn cluster_side(height: f32, deviation: f32, farthest: f32, turn: f32) -> f32 {
    let cosine = 1.0 - 0.5 * turn * turn;
    let sine = turn * sqrt(max(1.0 - 0.25 * turn * turn, 0.0));
    if cosine <= 0.0 {
        return 0.0;
    }
    if (height - deviation) * cosine > farthest * sine {
        return 1.0;
    }
    if (height + deviation) * cosine < -farthest * sine {
        return -1.0;
    }
    return 0.0;
}

// Share of a cluster's solid angle that is in the rectangle or in the triangles but not in both.
fn cluster_shape_error(mismatch: f32, rim: f32, lateral: f32, clearance: f32, distance_ratio: f32) -> f32 {
    let shifted = rim * min(lateral / max(clearance, TINY), 1e6);
    let cubed = distance_ratio * distance_ratio * distance_ratio;
    return min((mismatch + shifted) * min(cubed, 1e6), MOST_ERROR);
}

// Relative error of the radiance of a cluster that is looked up at one point.
fn cluster_light_error(residual: f32, variation: f32, aperture: f32, mean: f32) -> f32 {
    return min((residual + variation * min(aperture, 1.0)) / max(mean, TINY), MOST_ERROR);
}

// Relative error of the light that a cluster mirrors.
fn cluster_gloss_error(turn: f32, stray: f32, parallax: f32, alpha: f32) -> f32 {
    let width = max(alpha, MIN_ALPHA);
    let turned = turn / width;
    let exponent = min(2.0 * turned * turned + (2.0 * stray + parallax) / width, 4.0);
    // e^x - 1 = x e^x (1 - e^-x)/x.
    return min(exponent * exp(exponent) * one_minus_exp_neg_over_x(exponent), MOST_ERROR);
}

// Largest value of GGX's distribution for normals of a cluster.
fn cluster_ndf_bound(chord: f32, spread: f32, alpha: f32) -> f32 {
    let least = min(max(chord - spread, 0.0), 1.4142135);
    let least_squared = least * least;
    let sine_squared = least_squared * (1.0 - 0.25 * least_squared);
    let alpha_squared = max(alpha, MIN_ALPHA) * max(alpha, MIN_ALPHA);
    let denominator = alpha_squared + (1.0 - alpha_squared) * sine_squared;
    return INV_PI * alpha_squared / (denominator * denominator);
}
