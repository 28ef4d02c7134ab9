//! Whatever is wanted, what is streamed keeps the limits, and arrives.

use admittance_drive_limits::{DriveLimits, Reference};
use proptest::prelude::*;

/// The largest of each: speed, acceleration and jerk over its limit, seen from the stream alone.
fn worst(limits: &DriveLimits<3>, stream: &[[f64; 3]], since: f64) -> [f64; 3] {
    let mut worst = [0.0_f64; 3];
    let mut change_before = [0.0; 3];
    for both in stream.windows(2) {
        let change: [f64; 3] = std::array::from_fn(|joint| (both[1][joint] - both[0][joint]) / since);
        for (joint, speed) in both[1].iter().enumerate() {
            let jerk = (change[joint] - change_before[joint]) / since;
            let parts =
                [speed / limits.speed[joint], change[joint] / limits.acceleration[joint], jerk / limits.jerk[joint]];
            assert!(parts.iter().all(|part| part.is_finite()), "{parts:?}");
            worst.iter_mut().zip(parts).for_each(|(worst, part)| *worst = worst.max(part.abs()));
        }
        change_before = change;
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn what_jumps_is_streamed_within_the_limits(
        speed in prop::array::uniform3(0.2..5.0),
        acceleration in prop::array::uniform3(1.0..50.0),
        jerk in prop::array::uniform3(50.0..2e4),
        since in prop::sample::select(vec![0.00025, 0.001, 0.004]),
        wanted in prop::collection::vec((prop::array::uniform3(-6.0..6.0), 1_usize..60), 1..12),
    ) {
        let limits = DriveLimits { speed, acceleration, jerk };
        let mut reference = Reference::steady([0.0; 3]);
        let mut stream = vec![reference.velocity];
        for (wanted, ticks) in &wanted {
            for _ in 0..*ticks {
                reference = limits.follow(&reference, since, wanted);
                stream.push(reference.velocity);
            }
        }
        // A jump of one unit in the last place of a velocity is divided by h² on its way to a jerk.
        for part in worst(&limits, &stream, since) {
            prop_assert!(part <= 1.0 + 1e-6, "{part} of {limits:?}");
        }
        let (target, _) = wanted[wanted.len() - 1];
        let target = limits.within_speed(&target);
        let mut ticks = 0;
        while reference.velocity != target && ticks < 2_000_000 {
            let before = reference;
            reference = limits.follow(&reference, since, &target);
            prop_assert!(before != reference || reference.velocity == target, "it stays at {reference:?}, short of {target:?}");
            ticks += 1;
        }
        prop_assert_eq!(reference.velocity, target);
    }

    #[test]
    fn from_a_steady_motion_no_joint_passes_its_target_nor_leaves_the_straight_way(
        from in prop::array::uniform3(-2.0..2.0),
        to in prop::array::uniform3(-2.0..2.0),
        jerk in prop::array::uniform3(50.0..2e4),
    ) {
        let limits = DriveLimits { speed: [2.0; 3], acceleration: [10.0; 3], jerk };
        let mut reference = Reference::steady(from);
        while reference.velocity != to {
            reference = limits.follow(&reference, 0.001, &to);
            let parts: Vec<f64> =
                (0..3).filter(|joint| (to[*joint] - from[*joint]).abs() > 1e-3).map(|joint| (reference.velocity[joint] - from[joint]) / (to[joint] - from[joint])).collect();
            prop_assert!(parts.iter().all(|part| (-1e-9..=1.0 + 1e-9).contains(part)), "{parts:?}");
            prop_assert!(parts.iter().all(|part| (part - parts[0]).abs() < 1e-6), "{parts:?}");
        }
    }
}

#[test]
fn what_is_allowed_is_streamed_as_it_is() {
    let limits = DriveLimits { speed: [2.0; 3], acceleration: [10.0; 3], jerk: [1000.0; 3] };
    let mut reference = Reference::steady([0.0; 3]);
    // 5 rad/s², reached in ramps of 1 rad/s²: a target that moves as fast is not lagged behind.
    let mut wanted = 0.0;
    for tick in 0..300 {
        wanted += 0.001 * f64::from(tick.min(5));
        reference = limits.follow(&reference, 0.001, &[wanted; 3]);
        assert_eq!(reference.velocity, [wanted; 3], "tick {tick}");
    }
}

#[test]
fn without_limits_everything_is() {
    let mut reference = Reference::steady([0.0; 3]);
    for wanted in [[3.0, -2.0, 0.5], [1e3; 3], [0.0; 3]] {
        reference = DriveLimits::NONE.follow(&reference, 0.001, &wanted);
        assert_eq!(reference.velocity, wanted);
    }
    let limits = DriveLimits { jerk: [f64::INFINITY; 3], acceleration: [10.0; 3], speed: [f64::INFINITY; 3] };
    let reference = limits.follow(&Reference::steady([0.0; 3]), 0.001, &[1.0, 0.5, 0.0]);
    assert_eq!(reference.velocity.map(|velocity| (velocity * 1e6).round()), [1e4, 5e3, 0.0]);
}
