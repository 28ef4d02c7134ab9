//! The way of the tool into the surface between two samples, and what a lag makes of it.

use nalgebra::Vector3;

/// Most pieces of a way; an even number.
pub(crate) const MAX_PIECES: usize = 40;
/// α below which the weights are a series.
const SHORT: f64 = 0.02;

/// A piece of the way in which the depth is a parabola.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    /// Length in s.
    pub duration: f64,
    /// Depth in m at its start, in the middle, at its end.
    pub depth: [f64; 3],
}

/// The way from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Way {
    pieces: [Piece; MAX_PIECES],
    len: usize,
    /// The way along the surface, base frame, m.
    pub beside: Vector3<f64>,
}

impl Way {
    /// No piece.
    pub(crate) fn new() -> Self {
        Self { pieces: [Piece { duration: 0.0, depth: [0.0; 3] }; MAX_PIECES], len: 0, beside: Vector3::zeros() }
    }

    /// One more piece. Where there is no room two neighbours become one each: many inputs that reach
    /// the joints at different times, or many that were missed, are followed in less detail.
    pub(crate) fn push(&mut self, piece: Piece) {
        if self.len == MAX_PIECES {
            self.len /= 2;
            for index in 0..self.len {
                self.pieces[index] = self.pieces[2 * index].and(&self.pieces[2 * index + 1]);
            }
        }
        self.pieces[self.len] = piece;
        self.len += 1;
    }

    /// The pieces, in order.
    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.len]
    }

    /// How long it takes, s.
    pub(crate) fn duration(&self) -> f64 {
        self.pieces().iter().map(|piece| piece.duration).sum()
    }

    /// Length of the path along the surface, m.
    pub(crate) fn along(&self) -> f64 {
        self.beside.norm()
    }

    /// Depth at its end, m.
    pub(crate) fn end(&self) -> f64 {
        self.pieces().last().map_or(0.0, |piece| piece.depth[2])
    }

    /// Depth in m so many seconds after its start.
    pub(crate) fn depth_at(&self, time: f64) -> f64 {
        let (mut begun, mut depth) = (0.0, 0.0);
        for piece in self.pieces() {
            depth = piece.depth_at(time - begun);
            begun += piece.duration;
            if time < begun {
                break;
            }
        }
        depth
    }

    /// Greatest depth on it, m.
    pub(crate) fn deepest(&self) -> f64 {
        self.pieces().iter().flat_map(|piece| piece.depth).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Bends it by the cubic that ends with this depth (m) and rate (m/s) instead of those that it
    /// has, `rate` being its own at the end.
    pub(crate) fn bend(&mut self, depth: f64, rate: f64, wanted_rate: f64) {
        let (duration, error) = (self.duration(), depth - self.end());
        let rest = (wanted_rate - rate) * duration;
        // x² (3 − 2x) ends with 1 and rate 0, x² (x − 1) with 0 and rate 1.
        let cubic = |x: f64| x * x * ((3.0 - 2.0 * x) * error + (x - 1.0) * rest);
        let mut time = 0.0;
        for piece in &mut self.pieces[..self.len] {
            for (index, depth) in piece.depth.iter_mut().enumerate() {
                *depth += cubic((time + 0.5 * index as f64 * piece.duration) / duration);
            }
            time += piece.duration;
        }
    }
}

impl Piece {
    /// Depth in m so many seconds after its start, or at its end.
    fn depth_at(&self, time: f64) -> f64 {
        let x = (time / self.duration).min(1.0);
        let [start, middle, end] = self.depth;
        start + x * (4.0 * middle - 3.0 * start - end + 2.0 * x * (start - 2.0 * middle + end))
    }

    /// Itself and the `next` one as one.
    fn and(&self, next: &Self) -> Self {
        let duration = self.duration + next.duration;
        let half = 0.5 * duration;
        let middle = if half <= self.duration { self.depth_at(half) } else { next.depth_at(half - self.duration) };
        Self { duration, depth: [self.depth[0], middle, next.depth[2]] }
    }

    /// What a lag of `lag` s keeps of its value, and the weights of the three depths in the
    /// value at the end: exact for a parabola.
    pub(crate) fn weights(&self, lag: f64) -> (f64, [f64; 3]) {
        if lag <= 0.0 {
            return (0.0, [0.0, 0.0, 1.0]);
        }
        let alpha = self.duration / lag;
        let decay = libm::exp(-alpha);
        // Moments of α exp(−α u), u from 0 (the end) to 1.
        let moments = if alpha < SHORT {
            let of = |n: f64| {
                alpha
                    * (1.0 / (n + 1.0) - alpha / (n + 2.0) + alpha * alpha / (2.0 * (n + 3.0))
                        - alpha * alpha * alpha / (6.0 * (n + 4.0)))
            };
            [of(0.0), of(1.0), of(2.0)]
        } else {
            [
                1.0 - decay,
                (1.0 - decay * (1.0 + alpha)) / alpha,
                (2.0 - decay * (alpha * (alpha + 2.0) + 2.0)) / (alpha * alpha),
            ]
        };
        let [m0, m1, m2] = moments;
        (decay, [2.0 * m2 - m1, 4.0 * (m1 - m2), m0 - 3.0 * m1 + 2.0 * m2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lag_of_a_parabola_is_exact() {
        // x = 0.01 + 0.3 t − 20 t², by a fine sum.
        for (lag, duration) in [(0.02, 0.0005), (0.02, 0.00025), (0.001, 0.0005), (0.03, 0.004)] {
            let x = |t: f64| 0.01 + t * (0.3 - 20.0 * t);
            let piece = Piece { duration, depth: [x(0.0), x(0.5 * duration), x(duration)] };
            let (decay, weights) = piece.weights(lag);
            let shown = decay * 0.003 + weights.iter().zip(piece.depth).map(|(w, x)| w * x).sum::<f64>();
            let steps = 20_000;
            let h = duration / f64::from(steps);
            let mut value = 0.003;
            for step in 0..steps {
                let left = libm::exp(-h / lag);
                value = left * value + (1.0 - left) * x((f64::from(step) + 0.5) * h);
            }
            assert!((shown - value).abs() < 1e-10, "{shown} {value}");
        }
    }

    #[test]
    fn the_deepest_point_is_between_two_samples() {
        let mut way = Way::new();
        assert_eq!(way.deepest(), f64::NEG_INFINITY);
        way.push(Piece { duration: 0.001, depth: [1e-3, 3e-3, 2e-3] });
        way.push(Piece { duration: 0.001, depth: [2e-3, 1e-3, 1e-3] });
        assert_eq!(way.deepest(), 3e-3);
    }

    #[test]
    fn between_its_pieces_the_depth_is_theirs() {
        // x = 0.3 t − 20 t², in pieces of different lengths.
        let x = |t: f64| t * (0.3 - 20.0 * t);
        let (mut way, mut begun) = (Way::new(), 0.0);
        for duration in [0.001, 0.0005, 0.0025] {
            let depth = [0.0, 0.5, 1.0].map(|part| x(begun + part * duration));
            way.push(Piece { duration, depth });
            begun += duration;
        }
        for step in 0..=40 {
            let time = 0.0001 * f64::from(step);
            assert!((way.depth_at(time) - x(time)).abs() < 1e-12, "{time} s: {}", way.depth_at(time));
        }
    }

    #[test]
    fn a_way_of_any_number_of_pieces_is_one() {
        // Of a parabola nothing is lost, whatever the pieces.
        let x = |t: f64| 0.01 + t * (0.3 - 20.0 * t);
        for count in [MAX_PIECES, MAX_PIECES + 1, 3 * MAX_PIECES, 500] {
            let (mut way, mut begun) = (Way::new(), 0.0);
            for index in 0..count {
                let duration = if index % 3 == 0 { 2e-5 } else { 1.1e-5 };
                way.push(Piece { duration, depth: [0.0, 0.5, 1.0].map(|part| x(begun + part * duration)) });
                begun += duration;
            }
            assert!((way.duration() - begun).abs() < 1e-12 && (way.end() - x(begun)).abs() < 1e-12, "{count}");
            for step in 0..=40 {
                let time = begun * f64::from(step) / 40.0;
                assert!((way.depth_at(time) - x(time)).abs() < 1e-12, "{count} pieces, {time} s");
            }
        }
    }

    #[test]
    fn a_bent_way_ends_as_it_was_measured() {
        let mut way = Way::new();
        // 0.1 m/s for 4 ms, in 4 pieces.
        for piece in 0..4 {
            let at = |part: f64| 1e-4 * (f64::from(piece) + part);
            way.push(Piece { duration: 0.001, depth: [at(0.0), at(0.5), at(1.0)] });
        }
        way.bend(4.1e-4, 0.1, 0.16);
        let pieces = way.pieces();
        assert_eq!(pieces[0].depth[0], 0.0);
        assert!((way.end() - 4.1e-4).abs() < 1e-12);
        let last = pieces[3].depth;
        let rate = (3.0 * last[2] - 4.0 * last[1] + last[0]) / 0.001;
        assert!((rate - 0.16).abs() < 2e-3, "{rate}");
    }
}
