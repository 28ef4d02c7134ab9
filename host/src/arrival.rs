//! When the next state sample is due: the controller's clock, tracked from the stamps and arrivals
//! of its samples. A robot's messages are samples in this sense.
//!
//! Sample n is expected at stamp φ + n P and seen `latency` later. Phase φ and period P follow the
//! stamps like a second-order phase-locked loop, the latency the median of what it was. A late
//! sample, by its stamp or by its arrival, tells nothing about the clock: its stamp is ignored, and
//! its latency counts like any other above the median. Of a sample that was there already when the
//! thread woke up from a sleep the latency is not known, only that it was no longer: else a thread
//! that wakes late would sleep ever longer.

/// The controller's clock as the samples so far tell it; times in ns of CLOCK_MONOTONIC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArrivalEstimate {
    /// T_s as configured.
    nominal: f64,
    /// What is known about the run that samples come from; nothing before the first one.
    track: Option<Track>,
    /// Whether the thread has slept since it last looked.
    has_slept: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Track {
    boot_id: u64,
    sequence: u64,
    /// Expected stamp of sample `sequence`.
    phase: f64,
    period: f64,
    /// From the stamp of a sample to its being seen.
    latency: f64,
    /// When it was seen.
    seen: u64,
    /// Samples in a row whose stamp was not the expected one.
    outliers: u32,
    /// Samples that the loop has taken in, up to [`SETTLED`].
    taken: u32,
}

/// Part of a period by which a stamp may deviate before it is ignored.
const GATE: f64 = 0.1;
/// Ignored stamps in a row after which the clock is taken to be another one.
const OUTLIERS: u32 = 8;
/// Samples after which the loop is as slow as it gets: shorter than any drift of a clock, longer
/// than jitter.
const SETTLED: u32 = 32;
/// Largest relative deviation of the period that is believed; one of 1 % ends control.
const DRIFT: f64 = 0.02;
/// Part of a period after which a sample is looked for that was not notified, then after twice that
/// each time.
const GRACE: f64 = 0.125;
/// Periods for which it is looked for.
const EXPECTED: f64 = 2.0;
/// Part of a period by which the latency moves towards a sample's.
const LATENCY_STEP: f64 = 0.001;

impl ArrivalEstimate {
    /// Nothing seen of a controller with this sampling time in ns.
    pub fn new(sampling_time: u64) -> Self {
        Self { nominal: sampling_time as f64, track: None, has_slept: false }
    }

    /// Records that the thread looks: after a sleep, or after a look that found nothing.
    pub fn look(&mut self, after_sleep: bool) {
        self.has_slept = after_sleep;
    }

    /// Records a sample that was stamped at `stamp` and seen at `seen`.
    pub fn see(&mut self, boot_id: u64, sequence: u64, stamp: u64, seen: u64) {
        // A stamp that does not fit this clock is ignored.
        if stamp > seen {
            return;
        }
        let fresh = Track {
            boot_id,
            sequence,
            phase: stamp as f64,
            period: self.nominal,
            latency: ((seen - stamp) as f64).min(self.nominal * GATE),
            seen,
            outliers: 0,
            taken: 1,
        };
        let Some(track) = &mut self.track else {
            self.track = Some(fresh);
            return;
        };
        if boot_id != track.boot_id {
            *track = fresh;
            return;
        }
        if sequence <= track.sequence {
            return;
        }
        track.seen = seen;
        let steps = (sequence - track.sequence) as f64;
        track.sequence = sequence;
        track.phase += steps * track.period;
        let error = stamp as f64 - track.phase;
        if error.abs() > self.nominal * GATE {
            track.outliers += 1;
            if track.outliers >= OUTLIERS {
                *track = fresh;
            }
            return;
        }
        track.outliers = 0;
        track.taken = (track.taken + 1).min(SETTLED);
        // Gains of the least-squares line through the samples so far, which ends as a critically
        // damped loop.
        let n = f64::from(track.taken);
        let (phase_gain, period_gain) = (2.0 * (2.0 * n - 1.0) / (n * (n + 1.0)), 6.0 / (n * (n + 1.0)));
        track.phase += phase_gain * error;
        track.period += period_gain * error / steps;
        track.period = track.period.clamp(self.nominal * (1.0 - DRIFT), self.nominal * (1.0 + DRIFT));
        let step = self.nominal * LATENCY_STEP;
        let longer = (seen - stamp) as f64 - track.latency;
        track.latency += if self.has_slept { -step } else { longer.clamp(-step, step) };
        // Spinning may have to begin before the stamp, where waking up takes longer than it lasts.
        track.latency = track.latency.max(-self.nominal * GATE);
    }

    /// When the next sample is expected; `None` before the first one. Never much later than a
    /// period after the last one was seen, whatever its sequence and stamp said: the thread may
    /// sleep until then.
    pub fn next(&self) -> Option<u64> {
        self.track.as_ref().map(|track| self.not_late(track, track.phase + track.period + track.latency))
    }

    /// For how long a thread that is woken by notifications may block before it looks for the next
    /// sample all the same: that is how one is found whose notification never comes. `None` when
    /// none is expected any more.
    ///
    /// Counted from the stamp that is expected: a latency that had become longer by looking late
    /// would make the next look later still.
    pub fn look_after(&self, now: u64) -> Option<u64> {
        let track = self.track.as_ref()?;
        let first = self.not_late(track, track.phase + track.period).saturating_add((self.nominal * GRACE) as u64);
        if now < first {
            return Some(first - now);
        }
        let is_expected = now < first.saturating_add((self.nominal * EXPECTED) as u64);
        is_expected.then_some((self.nominal * 2.0 * GRACE) as u64)
    }

    fn not_late(&self, track: &Track, expected: f64) -> u64 {
        (expected as u64).min(track.seen.saturating_add((self.nominal * (1.0 + 2.0 * GATE)) as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: u64 = 1_000_000;
    /// How long the thread spins, before and after.
    const SPIN: u64 = 50_000;

    /// A controller whose clock has this true period in ns, and an estimate of it.
    struct Clock {
        estimate: ArrivalEstimate,
        start: u64,
        period: f64,
        sequence: u64,
    }

    impl Clock {
        fn new(period: f64) -> Self {
            Self { estimate: ArrivalEstimate::new(PERIOD), start: 7_000_000_000_000, period, sequence: 0 }
        }

        fn instant(&self, sequence: u64) -> u64 {
            self.start + (self.period * sequence as f64).round() as u64
        }

        /// The next sample, stamped and seen so much after its instant.
        fn sample(&mut self, stamp_delay: u64, latency: u64) {
            self.sequence += 1;
            let stamp = self.instant(self.sequence) + stamp_delay;
            self.estimate.see(1, self.sequence, stamp, stamp + latency);
        }

        /// How far the expected arrival of the next sample is from its true instant plus `latency`,
        /// ns.
        fn error(&self, latency: u64) -> f64 {
            let expected = self.instant(self.sequence + 1) + latency;
            self.estimate.next().expect("samples were seen") as f64 - expected as f64
        }
    }

    fn settled(period: f64) -> Clock {
        let mut clock = Clock::new(period);
        (0..200).for_each(|_| clock.sample(0, 5_000));
        clock
    }

    #[test]
    fn nothing_is_expected_before_the_first_sample() {
        assert_eq!(ArrivalEstimate::new(PERIOD).next(), None);
        let mut clock = Clock::new(PERIOD as f64);
        clock.sample(0, 5_000);
        assert!(clock.error(5_000).abs() <= 1.0);
    }

    #[test]
    fn a_clock_500_ppm_off_is_tracked() {
        for ppm in [-500.0, -20.0, 500.0, 5000.0] {
            let mut clock = Clock::new(PERIOD as f64 * (1.0 + ppm * 1e-6));
            for sample in 0..2000 {
                clock.sample(0, 5_000);
                // Also while it is being found, the next sample is within the time of spinning.
                assert!(clock.error(5_000).abs() < SPIN as f64, "{ppm} ppm, sample {sample}: {}", clock.error(5_000));
            }
            assert!(clock.error(5_000).abs() < 10.0, "{ppm} ppm: {} ns off", clock.error(5_000));
        }
    }

    #[test]
    fn a_sample_late_by_one_to_five_periods_does_not_shift_the_next() {
        for periods in 1..=5 {
            let mut by_stamp = settled(PERIOD as f64 * 1.0001);
            by_stamp.sample(periods * PERIOD, 5_000);
            assert!(by_stamp.error(5_000).abs() < 50.0, "stamped {periods} late: {} ns", by_stamp.error(5_000));
            let mut by_arrival = settled(PERIOD as f64 * 1.0001);
            by_arrival.sample(0, periods * PERIOD);
            let shift = 1_000.0;
            assert!(by_arrival.error(5_000).abs() <= shift + 50.0, "{periods} late: {} ns", by_arrival.error(5_000));
            // Nor do some of them, one in ten.
            for sample in 0..400 {
                by_stamp.sample(if sample % 10 == 3 { periods * PERIOD } else { 0 }, 5_000);
                by_arrival.sample(0, if sample % 10 == 3 { periods * PERIOD } else { 5_000 });
                assert!(by_stamp.error(5_000).abs() < 100.0);
                assert!(by_arrival.error(5_000).abs() <= 2.0 * shift);
            }
        }
    }

    #[test]
    fn a_sample_is_looked_for_soon_after_it_is_due_notified_or_not() {
        let mut clock = settled(PERIOD as f64);
        // Found an eighth of a period late for ever: it does not become later.
        (0..5000).for_each(|_| clock.sample(0, PERIOD / 8));
        let (due, seen) = (clock.instant(clock.sequence + 1), clock.instant(clock.sequence) + PERIOD / 8);
        assert!(clock.estimate.look_after(seen).expect("expected").abs_diff(due + PERIOD / 8 - seen) < 100);
        assert_eq!(clock.estimate.look_after(due + PERIOD / 2), Some(PERIOD / 4));
        assert_eq!(clock.estimate.look_after(due + 3 * PERIOD), None, "the controller has ended");
        assert_eq!(ArrivalEstimate::new(PERIOD).look_after(due), None);
    }

    #[test]
    fn a_thread_that_wakes_late_does_not_sleep_ever_longer() {
        let mut clock = settled(PERIOD as f64);
        let (spin, wake_up) = (10_000, 70_000);
        let mut latest = 0;
        for _ in 0..20_000 {
            // It sleeps until shortly before the sample is due, wakes up late, and looks.
            let arrives = clock.instant(clock.sequence + 1) + 5_000;
            let awake = clock.estimate.next().expect("samples were seen") - spin + wake_up;
            clock.estimate.look(awake >= arrives);
            // By a notification, where it is still to come.
            let seen = if awake >= arrives { awake } else { arrives + wake_up };
            latest = latest.max(seen - arrives);
            clock.sample(0, 5_000 + seen - arrives);
        }
        assert!(latest <= 2 * wake_up, "{latest} ns after it arrived");
    }

    #[test]
    fn lost_samples_do_not_matter() {
        let mut clock = settled(PERIOD as f64 * 1.0005);
        for lost in [1, 2, 50] {
            clock.sequence += lost;
            clock.sample(0, 5_000);
            assert!(clock.error(5_000).abs() < 50.0, "{lost} lost: {} ns off", clock.error(5_000));
        }
    }

    #[test]
    fn jitter_is_averaged() {
        let mut clock = settled(PERIOD as f64);
        let mut worst = 0.0_f64;
        for sample in 0..1000_u64 {
            // Up to 20 µs, in no order.
            clock.sample(sample * 7_919 % 20_000, 5_000);
            if sample >= 100 {
                worst = worst.max((clock.error(5_000) - 10_000.0).abs());
            }
        }
        assert!(worst < 5_000.0, "{worst} ns off the mean");
    }

    #[test]
    fn latency_is_part_of_the_arrival() {
        let mut clock = Clock::new(PERIOD as f64);
        (0..1000).for_each(|_| clock.sample(0, 180_000));
        assert!(clock.error(180_000).abs() < 2_000.0, "{} ns off", clock.error(180_000));
    }

    #[test]
    fn another_clock_is_found() {
        let mut clock = settled(PERIOD as f64);
        clock.start += PERIOD * 4 / 10;
        (0..OUTLIERS).for_each(|_| clock.sample(0, 5_000));
        assert!(clock.error(5_000).abs() < 100.0, "a pause of the controller: {} ns off", clock.error(5_000));
        clock.estimate.see(2, 1, clock.start, clock.start + 5_000);
        assert_eq!(clock.estimate.next(), Some(clock.start + 5_000 + PERIOD));
    }

    #[test]
    fn a_sequence_that_jumps_does_not_put_off_the_next() {
        let mut clock = settled(PERIOD as f64);
        let seen = clock.instant(clock.sequence + 1) + 5_000;
        clock.estimate.see(1, 1 << 50, seen - 5_000, seen);
        let next = clock.estimate.next().expect("samples were seen");
        assert!(next <= seen + 2 * PERIOD, "{} ns after the last one", next - seen);
    }

    #[test]
    fn a_stamp_from_the_future_is_not_believed() {
        let mut clock = settled(PERIOD as f64);
        clock.estimate.see(1, clock.sequence + 1, u64::MAX, clock.start);
        assert!(clock.error(5_000).abs() < 100.0);
    }
}
