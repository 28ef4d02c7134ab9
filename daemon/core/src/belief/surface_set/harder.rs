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
