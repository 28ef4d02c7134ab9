//! Where another program leads the TCP: which of its samples count, and the twist ṗ0 that follows from them, within the
//! motion controller's limits. No port and no clock: time is an argument.

use ipc_types::{TASK_AXES, TwistFrame, TwistSample};

/// Axes of the tool's frame in the base frame, as columns.
pub type Rotation = [[f64; 3]; 3];

/// The largest value of a twist that is looked at, m/s and rad/s: what is beyond it is no speed, and squared or turned no number.
const LARGEST: f64 = 1e3;
/// By so much a sample may be stamped ahead of the time at which it is looked at, ns.
const AHEAD_NS: u64 = 1_000_000;
/// The longest time in ns that a change of the twist is spread over from one look to the next: who looks less often than this
/// leads nothing.
const LONGEST_STEP_NS: u64 = 100_000_000;

/// What the motion controller lets a program ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeadLimits {
    /// Fastest that the TCP moves, m/s. A faster twist is brought down to it, with its turning.
    pub linear_m_s: f64,
    /// Fastest that it turns, rad/s. A faster twist is brought down to it, with its motion.
    pub angular_rad_s: f64,
    /// Fastest change of the motion, m/s².
    pub linear_acceleration_m_s2: f64,
    /// Fastest change of the turning, rad/s².
    pub angular_acceleration_rad_s2: f64,
    /// The longest that a sample may ask to count, ns.
    pub longest_valid_ns: u64,
}

/// Why a sample does not count. What was there before it goes on, until its own time is over.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum LeadRefusal {
    /// It leads nowhere.
    #[error("twist[{axis}] = {value} of sample {sequence}: accepted: -{LARGEST} to {LARGEST}")]
    Value {
        /// The axis, 0 to 5.
        axis: usize,
        /// Its value.
        value: f64,
        /// The sample.
        sequence: u64,
    },
    /// Axes that are not known here.
    #[error("frame = {got} of sample {sequence}: accepted: a code of TwistFrame")]
    Frame {
        /// The code.
        got: u32,
        /// The sample.
        sequence: u64,
    },
    /// It would count for too long, or not at all.
    #[error("valid_for_ns = {got} of sample {sequence}: accepted: 1 to {accepted}")]
    Validity {
        /// The time.
        got: u64,
        /// The longest.
        accepted: u64,
        /// The sample.
        sequence: u64,
    },
    /// It no longer counts.
    #[error("sample {sequence} counted until {late_ns} ns ago")]
    Expired {
        /// Since when.
        late_ns: u64,
        /// The sample.
        sequence: u64,
    },
    /// It is stamped later than now.
    #[error("sample {sequence} is stamped {ahead_ns} ns ahead: accepted: at most {AHEAD_NS}")]
    FromFuture {
        /// By how much.
        ahead_ns: u64,
        /// The sample.
        sequence: u64,
    },
    /// A later one of the same program was there before.
    #[error("sample {sequence} comes after sample {newest} of the same program")]
    Old {
        /// The newest.
        newest: u64,
        /// The sample.
        sequence: u64,
    },
}

/// A sample that counts.
#[derive(Debug, Clone, Copy)]
struct Led {
    boot_id: u64,
    sequence: u64,
    until_ns: u64,
    frame: TwistFrame,
    twist: [f64; TASK_AXES],
}

/// The twist that a program leads with. It changes by ramps alone, to zero as well when nothing counts any more.
#[derive(Debug, Clone)]
pub struct Lead {
    limits: LeadLimits,
    newest: Option<Led>,
    /// ṗ0 when it was last looked at, m/s and rad/s, base frame.
    twist: [f64; TASK_AXES],
    looked_ns: Option<u64>,
}

impl Lead {
    /// At rest, led by nobody.
    pub fn new(limits: LeadLimits) -> Self {
        Self { limits, newest: None, twist: [0.0; TASK_AXES], looked_ns: None }
    }

    /// Takes a sample that is looked at at `now_ns`.
    ///
    /// # Errors
    /// [`LeadRefusal`]: it is as if it had not come.
    pub fn take(&mut self, sample: &TwistSample, now_ns: u64) -> Result<(), LeadRefusal> {
        let TwistSample { sequence, stamp_ns, boot_id, valid_for_ns, frame, twist, .. } = *sample;
        // Written so that NaN is refused.
        if let Some(axis) = twist.iter().position(|value| !(-LARGEST..=LARGEST).contains(value)) {
            return Err(LeadRefusal::Value { axis, value: twist[axis], sequence });
        }
        let frame = TwistFrame::from_code(frame).ok_or(LeadRefusal::Frame { got: frame, sequence })?;
        let accepted = self.limits.longest_valid_ns;
        if !(1..=accepted).contains(&valid_for_ns) {
            return Err(LeadRefusal::Validity { got: valid_for_ns, accepted, sequence });
        }
        let ahead_ns = stamp_ns.saturating_sub(now_ns);
        if ahead_ns > AHEAD_NS {
            return Err(LeadRefusal::FromFuture { ahead_ns, sequence });
        }
        let until_ns = stamp_ns.saturating_add(valid_for_ns);
        if until_ns <= now_ns {
            return Err(LeadRefusal::Expired { late_ns: now_ns - until_ns, sequence });
        }
        if let Some(newest) = self.newest.filter(|newest| newest.boot_id == boot_id && sequence <= newest.sequence) {
            return Err(LeadRefusal::Old { newest: newest.sequence, sequence });
        }
        self.newest = Some(Led { boot_id, sequence, until_ns, frame, twist });
        Ok(())
    }

    /// ṗ0 from `now_ns` on, m/s and rad/s, base frame, for a tool that stands so.
    pub fn twist(&mut self, now_ns: u64, tool: &Rotation) -> [f64; TASK_AXES] {
        let wanted = self.wanted(now_ns, tool);
        self.ramp(now_ns, wanted)
    }

    /// The same between two state samples, where the daemon knows of nothing new: ṗ0 stays as it was told last, and goes to
    /// zero when nothing counts any more.
    pub fn coast(&mut self, now_ns: u64) -> [f64; TASK_AXES] {
        let wanted = if self.counts(now_ns).is_some() { self.twist } else { [0.0; TASK_AXES] };
        self.ramp(now_ns, wanted)
    }

    /// As far towards `wanted` as the limits allow in the time since it was last looked at.
    fn ramp(&mut self, now_ns: u64, wanted: [f64; TASK_AXES]) -> [f64; TASK_AXES] {
        let looked_ns = self.looked_ns.replace(now_ns).unwrap_or(now_ns);
        let elapsed_s = now_ns.saturating_sub(looked_ns).min(LONGEST_STEP_NS) as f64 * 1e-9;
        let steps = [self.limits.linear_acceleration_m_s2, self.limits.angular_acceleration_rad_s2];
        for (part, step) in [0..3, 3..TASK_AXES].into_iter().zip(steps.map(|rate| rate * elapsed_s)) {
            let change: [f64; 3] =
                std::array::from_fn(|axis| wanted[part.start + axis] - self.twist[part.start + axis]);
            let size = length(&change);
            for axis in 0..3 {
                let value = &mut self.twist[part.start + axis];
                // Where it was to go is reached to the last bit: zero is zero.
                *value = if size <= step { wanted[part.start + axis] } else { *value + change[axis] * (step / size) };
            }
        }
        self.twist
    }

    /// The arm stands, and nobody has led it there: no sample that came before counts. ṗ0 begins at zero when it is next
    /// looked at, however long that takes.
    pub fn rest(&mut self) {
        *self = Self::new(self.limits);
    }

    /// The arm is held: what is asked for counts on, and ṗ0 begins anew at zero.
    pub fn halt(&mut self) {
        (self.twist, self.looked_ns) = ([0.0; TASK_AXES], None);
    }

    /// The newest sample, while it counts.
    fn counts(&self, now_ns: u64) -> Option<Led> {
        self.newest.filter(|led| now_ns < led.until_ns)
    }

    /// What the newest sample asks for at this instant, within the limits of speed, base frame.
    fn wanted(&self, now_ns: u64, tool: &Rotation) -> [f64; TASK_AXES] {
        let Some(led) = self.counts(now_ns) else { return [0.0; TASK_AXES] };
        let [vx, vy, vz, rx, ry, rz] = led.twist;
        let (linear, angular) = match led.frame {
            TwistFrame::Base => ([vx, vy, vz], [rx, ry, rz]),
            TwistFrame::Tool => (turned(tool, [vx, vy, vz]), turned(tool, [rx, ry, rz])),
        };
        // Both alike: the tool then goes where it was to go, slower.
        let excess =
            (length(&linear) / self.limits.linear_m_s).max(length(&angular) / self.limits.angular_rad_s).max(1.0);
        std::array::from_fn(|axis| if axis < 3 { linear[axis] } else { angular[axis - 3] } / excess)
    }
}

fn turned(rotation: &Rotation, vector: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| (0..3).map(|column| rotation[column][row] * vector[column]).sum())
}

fn length(vector: &[f64; 3]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const LIMITS: LeadLimits = LeadLimits {
        linear_m_s: 0.1,
        angular_rad_s: 0.5,
        linear_acceleration_m_s2: 1.0,
        angular_acceleration_rad_s2: 5.0,
        longest_valid_ns: 200 * MS,
    };
    const LEVEL: Rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn sample(sequence: u64, stamp_ns: u64, twist: [f64; TASK_AXES]) -> TwistSample {
        TwistSample { sequence, stamp_ns, boot_id: 7, valid_for_ns: 100 * MS, twist, ..TwistSample::zeroed() }
    }

    /// One at rest that is looked at.
    fn looked_at(now_ns: u64) -> Lead {
        let mut lead = Lead::new(LIMITS);
        assert_eq!(lead.twist(now_ns, &LEVEL), [0.0; TASK_AXES]);
        lead
    }

    /// ṗ0 after `cycles` of 4 ms, the sample taken at the first.
    fn led(lead: &mut Lead, from_ns: u64, cycles: u64) -> [f64; TASK_AXES] {
        (1..=cycles).map(|cycle| lead.twist(from_ns + cycle * 4 * MS, &LEVEL)).last().expect("a cycle")
    }

    #[test]
    fn it_ramps_up_and_when_its_time_is_over_down_to_zero() {
        let mut lead = looked_at(1000 * MS);
        lead.take(&sample(1, 1000 * MS, [0.0, 0.0, -0.05, 0.0, 0.0, 0.0]), 1000 * MS).expect("sound");
        assert_eq!(led(&mut lead, 1000 * MS, 1)[2], -0.004);
        assert_eq!(led(&mut lead, 1004 * MS, 12)[2], -0.05);
        assert_eq!(led(&mut lead, 1052 * MS, 11)[2], -0.05);
        // Until 1100 ms: from then on 50 ms to zero.
        let mut last = -0.05;
        for cycle in 25..=36 {
            let now = lead.twist((1000 + 4 * cycle) * MS, &LEVEL)[2];
            assert!((now - last - 0.004).abs() < 1e-12, "cycle {cycle}: {last} to {now}");
            last = now;
        }
        assert_eq!(led(&mut lead, 1144 * MS, 1), [0.0; TASK_AXES]);
        assert_eq!(led(&mut lead, 1148 * MS, 1), [0.0; TASK_AXES]);
    }

    #[test]
    fn between_samples_it_never_grows_and_goes_to_zero_when_its_time_is_over() {
        let mut lead = looked_at(1000 * MS);
        lead.take(&sample(1, 1000 * MS, [0.0, 0.0, -0.05, 0.0, 0.0, 0.0]), 1000 * MS).expect("sound");
        let told = led(&mut lead, 1000 * MS, 5);
        assert_eq!(told[2], -0.02);
        // What the program asks for now is for the next state sample.
        lead.take(&sample(2, 1020 * MS, [0.09, 0.0, 0.0, 0.0, 0.0, 0.4]), 1020 * MS).expect("sound");
        for cycle in 6..=29 {
            assert_eq!(lead.coast((1000 + 4 * cycle) * MS), told, "cycle {cycle}");
        }
        // Until 1120 ms: from then on 20 ms to zero.
        for cycle in 30..=34 {
            let now = lead.coast((1000 + 4 * cycle) * MS)[2];
            assert!((now + 0.02 - 0.004 * (cycle - 29) as f64).abs() < 1e-12, "cycle {cycle}: {now}");
        }
        assert_eq!(lead.coast(1140 * MS), [0.0; TASK_AXES]);
    }

    #[test]
    fn what_is_too_fast_goes_the_same_way_slower() {
        let mut lead = looked_at(0);
        let longer = |sample| TwistSample { valid_for_ns: 200 * MS, ..sample };
        lead.take(&longer(sample(1, 0, [0.3, 0.4, 0.0, 0.0, 0.0, 1.0])), 0).expect("sound");
        let twist = led(&mut lead, 0, 26);
        let expected = [0.06, 0.08, 0.0, 0.0, 0.0, 0.2];
        assert!(twist.iter().zip(expected).all(|(got, wanted)| (got - wanted).abs() < 1e-12), "{twist:?}");
        lead.take(&longer(sample(2, 104 * MS, [0.01, 0.0, 0.0, 0.0, 2.0, 0.0])), 104 * MS).expect("sound");
        let twist = led(&mut lead, 104 * MS, 28);
        let expected = [0.0025, 0.0, 0.0, 0.0, 0.5, 0.0];
        assert!(twist.iter().zip(expected).all(|(got, wanted)| (got - wanted).abs() < 1e-12), "{twist:?}");
    }

    #[test]
    fn the_tools_axes_are_turned_into_the_bases() {
        let mut lead = looked_at(0);
        let along_tool =
            TwistSample { frame: TwistFrame::Tool.code(), ..sample(1, 0, [0.0, 0.0, 0.05, 0.0, 0.0, 0.0]) };
        lead.take(&along_tool, 0).expect("sound");
        // z of the tool points along -x of the base.
        let tool = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        let twist = (1..20).map(|cycle| lead.twist(cycle * 4 * MS, &tool)).last().expect("a cycle");
        assert_eq!(twist, [-0.05, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn what_does_not_count_is_named_and_changes_nothing() {
        let mut lead = looked_at(1000 * MS);
        let sound = sample(5, 1000 * MS, [0.02, 0.0, 0.0, 0.0, 0.0, 0.0]);
        lead.take(&sound, 1000 * MS).expect("sound");
        let (sequence, next) = (6, TwistSample { sequence: 6, ..sound });
        let mut not_finite = next;
        not_finite.twist[4] = f64::NEG_INFINITY;
        let cases = [
            (not_finite, LeadRefusal::Value { axis: 4, value: f64::NEG_INFINITY, sequence }),
            (TwistSample { frame: 2, ..next }, LeadRefusal::Frame { got: 2, sequence }),
            (TwistSample { valid_for_ns: 0, ..next }, LeadRefusal::Validity { got: 0, accepted: 200 * MS, sequence }),
            (
                TwistSample { valid_for_ns: 201 * MS, ..next },
                LeadRefusal::Validity { got: 201 * MS, accepted: 200 * MS, sequence },
            ),
            (TwistSample { stamp_ns: 1006 * MS, ..next }, LeadRefusal::FromFuture { ahead_ns: 2 * MS, sequence }),
            (TwistSample { stamp_ns: 904 * MS, ..next }, LeadRefusal::Expired { late_ns: 0, sequence }),
            (sound, LeadRefusal::Old { newest: 5, sequence: 5 }),
        ];
        for (sample, refusal) in cases {
            assert_eq!(lead.take(&sample, 1004 * MS), Err(refusal));
        }
        assert!(lead.take(&TwistSample { boot_id: 8, sequence: 1, ..sound }, 1004 * MS).is_ok(), "another program");
        assert_eq!(led(&mut lead, 1004 * MS, 10)[0], 0.02);
    }

    #[test]
    fn who_rests_forgets_who_led() {
        let mut lead = looked_at(0);
        lead.take(&sample(1, 0, [0.02; TASK_AXES]), 0).expect("sound");
        assert_ne!(led(&mut lead, 0, 2), [0.0; TASK_AXES]);
        lead.rest();
        assert_eq!(led(&mut lead, 8 * MS, 2), [0.0; TASK_AXES]);
    }

    #[test]
    fn who_begins_begins_at_zero_however_long_nobody_has_looked() {
        let forward = |sequence, stamp_ns| sample(sequence, stamp_ns, [0.0, 0.05, 0.0, 0.0, 0.0, 0.0]);
        let mut lead = looked_at(0);
        lead.rest();
        lead.take(&forward(1, 200 * MS), 200 * MS).expect("sound");
        assert_eq!(lead.twist(204 * MS, &LEVEL)[1], 0.0);
        assert_eq!(led(&mut lead, 204 * MS, 1)[1], 0.004);
        assert_eq!(led(&mut lead, 208 * MS, 12)[1], 0.05);
        // Held for a while: the sample counts on, its speed does not.
        lead.halt();
        lead.take(&forward(2, 300 * MS), 300 * MS).expect("sound");
        assert_eq!(lead.twist(304 * MS, &LEVEL)[1], 0.0);
        assert_eq!(led(&mut lead, 304 * MS, 1)[1], 0.004);
    }

    #[test]
    fn what_is_refused_or_too_fast_leaves_numbers() {
        let (sine, cosine) = std::f64::consts::FRAC_PI_4.sin_cos();
        let tilted = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
        let in_tool = |value| TwistSample { frame: TwistFrame::Tool.code(), ..sample(1, 0, [value; TASK_AXES]) };
        let mut lead = looked_at(0);
        assert!(matches!(lead.take(&in_tool(f64::MAX), 0), Err(LeadRefusal::Value { axis: 0, .. })));
        lead.take(&in_tool(LARGEST), 0).expect("sound");
        for cycle in 1..100 {
            let twist = lead.twist(cycle * 4 * MS, &tilted);
            assert!(twist.iter().all(|value| value.is_finite()), "{twist:?}");
        }
    }
}
