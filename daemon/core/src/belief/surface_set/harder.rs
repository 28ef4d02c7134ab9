//! Whether a surface that is held became harder than any that was told. A hold whose stiffness is at the
//! end of the range has a second one beside it, which takes the surface to be out of the range: once that
//! one explains the samples better by far, the surface is.

use nalgebra::Vector3;

use super::cell::Range;
use super::hold::Hold;
use super::tilt::Tilt;
use super::touch::{EVIDENCE, HARDEST, OUTSIDE};
use super::{Tuning, Way};

/// Part of the end of the range from which on a stiffness is at it.
const AT_END: f64 = 0.999;

/// The second hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Harder {
    hold: Hold,
    /// Its range.
    range: Range,
    /// By how much it explains the samples better. As much as it takes to believe it, it can fall behind:
    /// in hours of noise at the end of the range some minutes would else be convincing.
    better: f64,
}

impl Harder {
    /// Beside a hold that is at the end of the range; `None` where it is not.
    fn beside(hold: &Hold, told: &Range) -> Option<Self> {
        let is_at_end = hold.likeliest().stiffness >= told.most * AT_END;
        is_at_end.then(|| {
            let range = Range { least: told.most * OUTSIDE, most: told.most * HARDEST };
            let mut harder = *hold;
            harder.keep(&range);
            Self { hold: harder, range, better: 0.0 }
        })
    }

    /// What is beside a hold that has followed the same samples, before this one.
    pub(super) fn follow(
        before: Option<Self>,
        hold: &Hold,
        way: &Way,
        (force, beside): (f64, &Vector3<f64>),
        weight: f64,
        (tuning, tilt): (&Tuning, &Tilt),
    ) -> Option<Self> {
        let Some(mut harder) = before.filter(|_| hold.likeliest().stiffness >= tuning.range.most * AT_END) else {
            return Self::beside(hold, &tuning.range);
        };
        let tuning = Tuning { range: harder.range, ..*tuning };
        harder.hold.turn(&way.beside, &tuning);
        harder.hold.follow(way, (force, beside), weight, (&tuning, tilt));
        harder.better = (harder.better + hold.surprise() - harder.hold.surprise()).max(-EVIDENCE);
        Some(harder)
    }

    /// The hold that goes on where the surface is harder than told; `None` where it is not known to be.
    pub(super) fn found(&self) -> Option<Hold> {
        (self.better > EVIDENCE * self.hold.scale()).then_some(self.hold)
    }

    /// The same, of a normal that took over what this one has of a tilt, and depths that are `shift` m more.
    pub(super) fn shift(&mut self, shift: f64) {
        self.hold.take_tilt();
        self.hold.shift(shift);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};

    use super::super::touch::Moments;
    use super::*;
    use crate::belief::way::Piece;

    /// A slope along x is none along y: both holds have to know that the path has turned.
    #[test]
    fn it_turns_with_the_path() {
        const STIFFNESS: f64 = 1e5;
        let told = Range { least: 1e4, most: STIFFNESS };
        let tuning = Tuning {
            lag: 0.0,
            range: told,
            depths: (0.0, 0.0),
            felt_after: 1e-4,
            noise: 0.1,
            offset: 0.0,
            tolerance: 0.0,
            slope: 0.01,
        };
        let mean = SVector::<f64, 3>::new(50.0, STIFFNESS, 0.0);
        let known = SMatrix::<f64, 3, 3>::from_diagonal(&SVector::<f64, 3>::new(0.01, 0.0, 1.0));
        let mut hold = Hold::new(0.0, &Moments { mean, covariance: known }, (0.0, 0.0), &tuning);
        let (mut harder, tilt, mut fallen) = (None, Tilt::none(), 0.0);
        let mut slide = |direction: Vector3<f64>, slope: f64| {
            for _ in 0..200 {
                let mut way = Way::new();
                way.push(Piece { duration: 0.001, depth: [5e-4; 3] });
                way.beside = direction * 1e-4;
                fallen += slope * 1e-4 * STIFFNESS;
                hold.turn(&way.beside, &tuning);
                let seen = (50.0 - fallen, &Vector3::zeros());
                hold.follow(&way, seen, 100.0, (&tuning, &tilt));
                harder = Harder::follow(harder, &hold, &way, seen, 100.0, (&tuning, &tilt));
            }
            harder.expect("at the end of the range").hold.falling_away(&Vector3::x())
        };
        assert!(slide(Vector3::x(), 0.01) > 5e-3);
        assert!(slide(Vector3::y(), 0.0).abs() < 1e-9);
    }
}
