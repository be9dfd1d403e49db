//! Three-component vectors in `f64`: positions are computed in double precision and rounded once, when they are
//! written, so that the bytes of a scene do not depend on the platform's `sin` and `cos`.

pub type Vec3 = [f64; 3];

pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `a / |a|`; callers pass vectors that are non-zero by construction.
pub fn normalize(a: Vec3) -> Vec3 {
    scale(a, 1.0 / dot(a, a).sqrt())
}

/// Right-handed orthonormal frame `[right, up, back]` whose third axis is the direction `back`, with `up` as near to
/// +Y as possible (to -Z where `back` is vertical). A camera or a light panel with this frame looks along `-back`,
/// respectively emits along `+back`.
pub fn frame(back: Vec3) -> [Vec3; 3] {
    let back = normalize(back);
    // Within 0.6° of the vertical the cross product with +Y loses its digits.
    let up_hint = if back[1].abs() > 0.99995 {
        [0.0, 0.0, -1.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let right = normalize(cross(up_hint, back));
    [right, cross(back, right), back]
}

/// Unit quaternion `[x, y, z, w]` of the rotation whose columns are `axes` (Shepperd 1978: the largest component
/// first, so that no root is taken of a difference near zero).
pub fn quaternion(axes: [Vec3; 3]) -> [f64; 4] {
    let [x, y, z] = axes;
    let (m00, m11, m22) = (x[0], y[1], z[2]);
    let candidates = [
        1.0 + m00 - m11 - m22,
        1.0 - m00 + m11 - m22,
        1.0 - m00 - m11 + m22,
        1.0 + m00 + m11 + m22,
    ];
    let largest = (0..4).fold(0, |best, i| {
        if candidates[i] > candidates[best] {
            i
        } else {
            best
        }
    });
    let twice = candidates[largest].sqrt();
    let s = 0.5 / twice;
    let half = 0.5 * twice;
    match largest {
        0 => [
            half,
            (y[0] + x[1]) * s,
            (z[0] + x[2]) * s,
            (y[2] - z[1]) * s,
        ],
        1 => [
            (y[0] + x[1]) * s,
            half,
            (z[1] + y[2]) * s,
            (z[0] - x[2]) * s,
        ],
        2 => [
            (z[0] + x[2]) * s,
            (z[1] + y[2]) * s,
            half,
            (x[1] - y[0]) * s,
        ],
        _ => [
            (y[2] - z[1]) * s,
            (z[0] - x[2]) * s,
            (x[1] - y[0]) * s,
            half,
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotate(q: [f64; 4], v: Vec3) -> Vec3 {
        let u = [q[0], q[1], q[2]];
        let t = scale(cross(u, v), 2.0);
        add(add(v, scale(t, q[3])), cross(u, t))
    }

    #[test]
    fn quaternion_turns_the_axes_into_the_frame() {
        for back in [
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [1.0, 2.0, -3.0],
            [-1.0, 0.2, 0.1],
        ] {
            let axes = frame(back);
            let q = quaternion(axes);
            for (i, axis) in axes.iter().enumerate() {
                let mut unit = [0.0; 3];
                unit[i] = 1.0;
                let error = sub(rotate(q, unit), *axis);
                assert!(
                    dot(error, error) < 1e-24,
                    "{back:?}: axis {i} is off by {error:?}"
                );
            }
            assert!(
                (dot(cross(axes[0], axes[1]), axes[2]) - 1.0).abs() < 1e-12,
                "{back:?}: not right-handed"
            );
        }
    }
}
