//! Clips a polyline to a rectangle: plotters would draw what lies outside along the edge.

use std::ops::Range;

/// The pieces of the polyline inside the rectangle, in order. A point that is not finite ends a
/// piece.
pub(crate) fn clip(points: &[(f64, f64)], x: &Range<f64>, y: &Range<f64>) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut end = None;
    for pair in points.windows(2) {
        let Some((from, to)) = clip_segment(pair[0], pair[1], x, y) else { continue };
        match pieces.last_mut() {
            Some(piece) if end == Some(from) => piece.push(to),
            _ => pieces.push(vec![from, to]),
        }
        // Only a segment that was not cut at its end goes on into the next one.
        end = (to == pair[1]).then_some(to);
    }
    pieces
}

/// Liang and Barsky's clipping of one segment.
fn clip_segment(from: (f64, f64), to: (f64, f64), x: &Range<f64>, y: &Range<f64>) -> Option<((f64, f64), (f64, f64))> {
    let delta = (to.0 - from.0, to.1 - from.1);
    if !(delta.0.is_finite() && delta.1.is_finite()) {
        return None;
    }
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (d, gap) in [
        (-delta.0, from.0 - x.start),
        (delta.0, x.end - from.0),
        (-delta.1, from.1 - y.start),
        (delta.1, y.end - from.1),
    ] {
        if d == 0.0 {
            if gap < 0.0 {
                return None;
            }
        } else if d < 0.0 {
            enter = enter.max(gap / d);
        } else {
            leave = leave.min(gap / d);
        }
    }
    if enter > leave {
        return None;
    }
    let at = |t: f64| match t {
        0.0 => from,
        1.0 => to,
        t => (from.0 + t * delta.0, from.1 + t * delta.1),
    };
    Some((at(enter), at(leave)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_inside_stays_one_piece() {
        let points = [(0.1, 0.1), (0.5, 0.5), (0.9, 0.1)];
        assert_eq!(clip(&points, &(0.0..1.0), &(0.0..1.0)), vec![points.to_vec()]);
    }

    #[test]
    fn a_line_that_leaves_and_returns_is_cut_at_the_edge() {
        let points = [(0.0, 0.5), (0.2, 0.5), (0.4, -0.5), (0.6, 0.5), (1.0, 0.5)];
        let pieces = clip(&points, &(0.0..1.0), &(0.0..1.0));
        assert_eq!(pieces.len(), 2);
        assert_eq!(pieces[0], vec![(0.0, 0.5), (0.2, 0.5), (0.30000000000000004, 0.0)]);
        assert_eq!(pieces[1].first(), Some(&(0.5, 0.0)));
    }

    #[test]
    fn what_is_outside_or_not_finite_is_gone() {
        assert!(clip(&[(0.0, 2.0), (1.0, 2.0)], &(0.0..1.0), &(0.0..1.0)).is_empty());
        assert!(clip(&[(0.0, f64::NAN), (1.0, 0.5)], &(0.0..1.0), &(0.0..1.0)).is_empty());
        assert_eq!(clip(&[(-1.0, 0.5), (2.0, 0.5)], &(0.0..1.0), &(0.0..1.0)), vec![vec![(0.0, 0.5), (1.0, 0.5)]]);
    }
}
