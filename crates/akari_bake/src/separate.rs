//! The line half-way between two sets of texels, where a line separates them.
//!
//! Every second split of a tree has a leaf on either side. Where that can be had, it need not be searched for: the
//! shortest way between the convex hulls is found in a few steps (Gilbert, Johnson and Keerthi 1988), and the line across
//! its middle keeps as far from both sets as a line can. A straight edge on a face is found at once, whatever its angle.

use glam::DVec2;

/// Steps until it is given up; a dozen is much.
const STEPS: usize = 32;
/// Sets that are nearer than this (texels, squared) touch, for all that a stored line can tell.
const TOUCHING: f64 = 1e-6;
/// The shortest way is found when it cannot become shorter by more than this share, or only by corners that it has.
const CONVERGED: f64 = 1e-9;

/// Unit normal and offset of the line that has all `positive` points on its positive side and all `negative` ones on
/// the other, at the same distance; none if there is none.
pub(crate) fn separate(positive: &[DVec2], negative: &[DVec2]) -> Option<(DVec2, f64)> {
    // The point of the hull of all differences that is nearest to the origin, and the corners that it is a mean of.
    let mut way = *positive.first()? - *negative.first()?;
    let mut corners = vec![way];
    for _ in 0..STEPS {
        if way.length_squared() < TOUCHING {
            return None;
        }
        let (front, back) = (lowest(positive, way), highest(negative, way));
        let next = front - back;
        let shorter_by = way.length_squared() - way.dot(next);
        if shorter_by <= CONVERGED * way.length_squared() || corners.contains(&next) {
            let normal = way.normalize();
            return Some((normal, 0.5 * normal.dot(front + back)));
        }
        corners.push(next);
        (way, corners) = nearest(&corners)?;
    }
    None
}

fn lowest(points: &[DVec2], direction: DVec2) -> DVec2 {
    let mut best = (f64::INFINITY, DVec2::ZERO);
    for &p in points {
        let height = direction.dot(p);
        if height < best.0 {
            best = (height, p);
        }
    }
    best.1
}

fn highest(points: &[DVec2], direction: DVec2) -> DVec2 {
    lowest(points, -direction)
}

/// The point of a segment or triangle that is nearest to the origin, and the corners that it is a mean of. None if the
/// origin is inside.
fn nearest(corners: &[DVec2]) -> Option<(DVec2, Vec<DVec2>)> {
    if let [a, b, c] = *corners {
        let side = |p: DVec2, q: DVec2| p.perp_dot(q);
        let (x, y, z) = (side(a, b), side(b, c), side(c, a));
        if (x > 0.0 && y > 0.0 && z > 0.0) || (x < 0.0 && y < 0.0 && z < 0.0) {
            return None;
        }
    }
    let mut best: Option<(f64, DVec2, Vec<DVec2>)> = None;
    for (i, &a) in corners.iter().enumerate() {
        for &b in &corners[i + 1..] {
            let along = b - a;
            let length = along.length_squared();
            let t = if length > 0.0 {
                (-a.dot(along) / length).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let point = a + t * along;
            let distance = point.length_squared();
            if best.as_ref().is_none_or(|b| distance < b.0) {
                let ends = match t {
                    0.0 => vec![a],
                    1.0 => vec![b],
                    _ => vec![a, b],
                };
                best = Some((distance, point, ends));
            }
        }
    }
    best.map(|(_, point, ends)| (point, ends))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separates_what_a_line_separates() {
        for k in 0..200 {
            let normal = DVec2::from_angle(0.31 * f64::from(k));
            let offset = 20.0 + 0.37 * f64::from(k % 40);
            let (mut positive, mut negative) = (Vec::new(), Vec::new());
            for i in 0..64 {
                for j in 0..64 {
                    let p = DVec2::new(f64::from(i), f64::from(j));
                    if normal.dot(p) > offset {
                        positive.push(p);
                    } else {
                        negative.push(p);
                    }
                }
            }
            if positive.is_empty() || negative.is_empty() {
                assert_eq!(separate(&positive, &negative), None);
                continue;
            }
            let (n, d) = separate(&positive, &negative).unwrap();
            let front = positive
                .iter()
                .map(|p| n.dot(*p) - d)
                .fold(f64::INFINITY, f64::min);
            let back = negative
                .iter()
                .map(|p| d - n.dot(*p))
                .fold(f64::INFINITY, f64::min);
            assert!(
                front > 0.0 && (front - back).abs() < 1e-9,
                "{k}: {front} {back}"
            );
            // No line keeps farther from both than the given one does, which is one of many.
            let given = positive
                .iter()
                .map(|p| normal.dot(*p))
                .fold(f64::INFINITY, f64::min)
                - negative
                    .iter()
                    .map(|p| normal.dot(*p))
                    .fold(f64::NEG_INFINITY, f64::max);
            assert!(front + back >= given - 1e-9, "{k}");
        }
    }

    #[test]
    fn says_no_to_what_no_line_separates() {
        let p = |x: f64, y: f64| DVec2::new(x, y);
        let cross = [p(0.0, 0.0), p(1.0, 1.0)];
        let other = [p(1.0, 0.0), p(0.0, 1.0)];
        assert_eq!(separate(&cross, &other), None);
        assert_eq!(separate(&cross, &[p(0.5, 0.5)]), None);
        assert_eq!(separate(&cross, &cross), None);
        let square = [p(0.0, 0.0), p(2.0, 0.0), p(2.0, 2.0), p(0.0, 2.0)];
        assert_eq!(separate(&square, &[p(1.0, 1.2)]), None);
        assert!(separate(&square, &[p(3.0, 1.2)]).is_some());
    }
}
