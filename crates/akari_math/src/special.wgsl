#define_import_path akari_math::special

// Twin: `special.rs`, where the formulas, domains, error bounds and sources are. Change both or neither.
// Nothing here produces Inf or NaN for finite input: WGSL implementations may assume that neither occurs, so every
// denominator is guarded before the division.

// Smallest denominator that a guard leaves: far below any meaningful value, far above the subnormals, which a device
// may flush to zero.
const TINY: f32 = 1e-30;
const PI: f32 = 3.14159265;
const HALF_PI: f32 = 1.57079633;
const QUARTER_PI: f32 = 0.78539816;
const TAN_PI_OVER_EIGHT: f32 = 0.41421356;

// (1 - exp(-x)) / x for x >= 0.
fn one_minus_exp_neg_over_x(x: f32) -> f32 {
    if x < 0.5 {
        return 1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0 - x * (1.0 / 5040.0 - x * (1.0 / 40320.0)))))));
    }
    return (1.0 - exp(-x)) / x;
}

// Largest absolute component.
fn max_abs_component(v: vec3<f32>) -> f32 {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

// `v` divided by its largest absolute component; zero where that is below `TINY`.
fn scale_to_unit_box(v: vec3<f32>) -> vec3<f32> {
    let largest = max_abs_component(v);
    if largest < TINY {
        return vec3<f32>(0.0);
    }
    return v / largest;
}

// Unit vector along `v`, or `fallback` where `v` is too short to have a direction.
fn safe_normalize(v: vec3<f32>, fallback: vec3<f32>) -> vec3<f32> {
    let scaled = scale_to_unit_box(v);
    let length_squared = dot(scaled, scaled);
    if length_squared < 0.5 {
        return fallback;
    }
    return scaled / sqrt(length_squared);
}

// Angle of the vector (x, y) from the x axis, in [-pi, pi]; 0 for the zero vector.
fn atan2_poly(y: f32, x: f32) -> f32 {
    let absolute_x = abs(x);
    let absolute_y = abs(y);
    let larger = max(absolute_x, absolute_y);
    let smaller = min(absolute_x, absolute_y);
    // Octant: the ratio is in [0, 1]. Above tan(pi / 8), atan(r) = pi / 4 + atan((r - 1) / (r + 1)).
    let reduced = smaller > TAN_PI_OVER_EIGHT * larger;
    let numerator = select(smaller, smaller - larger, reduced);
    let denominator = select(larger, smaller + larger, reduced);
    let t = numerator / max(denominator, TINY);
    let u = t * t;
    let polynomial = -0.33332757 + u * (0.19971879 + u * (-0.13824453 + u * 0.07902595));
    var angle = select(0.0, QUARTER_PI, reduced) + (t + t * u * polynomial);
    if absolute_y > absolute_x {
        angle = HALF_PI - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    return select(angle, -angle, y < 0.0);
}

// erfc(x) for x >= 1, as exp(-x^2) times a polynomial in t = 1 / (1 + 0.35 x).
fn erfc_tail(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.35 * x);
    let polynomial = t * (0.1974971164 + t * (0.1968135787 + t * (0.1913271669 + t * (0.1306961639 + t * (0.2226192154 + t * (-0.0983388305 + t * (0.263011709 + t * -0.1036973654)))))));
    // From 9.5 on, erfc is below 1e-40.
    let bounded = min(x, 9.5);
    return exp(-bounded * bounded) * polynomial;
}

// erf(x) for |x| <= 1.
fn erf_core(x: f32) -> f32 {
    let u = x * x;
    return x * (1.128379166 + u * (-0.3761262582 + u * (0.1128358515 + u * (-0.0268538119 + u * (0.005188327588 + u * (-0.0008010192537 + u * 0.00007853857212))))));
}

// Error function.
fn erf_poly(x: f32) -> f32 {
    let absolute = abs(x);
    if absolute <= 1.0 {
        return erf_core(x);
    }
    let value = 1.0 - erfc_tail(absolute);
    return select(value, -value, x < 0.0);
}

// Complementary error function, relative to its own size for x > 0.
fn erfc_poly(x: f32) -> f32 {
    let absolute = abs(x);
    if absolute <= 1.0 {
        return 1.0 - erf_core(x);
    }
    let tail = erfc_tail(absolute);
    return select(tail, 2.0 - tail, x < 0.0);
}
