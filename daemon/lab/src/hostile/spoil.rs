//! State samples that something has spoilt: bits, numbers, sequences, stamps, counts, deliveries.

use ipc_types::StateSample;
use rand::{Rng, RngExt as _};

use super::controller::Delivery;

/// Numbers that programs stumble over.
pub(crate) const STRANGE: [f64; 20] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    -0.0,
    0.0,
    1.0,
    -1.0,
    1e-12,
    1e3,
    -1e3,
    999_999.9,
    1e6,
    -1e9,
    1e18,
    1e154,
    1e300,
];
/// Integers that programs stumble over.
pub(crate) const EDGES: [u64; 9] =
    [0, 1, 2, u32::MAX as u64, 1 << 32, i64::MAX as u64, 1 << 63, u64::MAX - 1, u64::MAX];

/// How a run of samples is spoilt.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Manner {
    /// Share of the samples that something happens to.
    share: f64,
    /// Samples in a row that have the same happen to them.
    run: u32,
}

impl Manner {
    pub(crate) fn draw(random: &mut impl Rng) -> Self {
        Self {
            share: [0.01, 0.1, 0.5, 1.0][random.random_range(0..4)],
            run: [1, 1, 3, 40, 400][random.random_range(0..5)],
        }
    }
}

/// Spoils samples one after the other.
pub(crate) struct Spoiler {
    manner: Manner,
    /// What happens to the samples of the present run, and how many of them are left.
    harms: Vec<Harm>,
    left: u32,
    /// The last sample as it was published.
    last: StateSample,
    /// Samples that something has happened to.
    pub(crate) spoilt: u64,
}

impl Spoiler {
    pub(crate) fn new(manner: Manner) -> Self {
        Self { manner, harms: Vec::new(), left: 0, last: StateSample::zeroed(), spoilt: 0 }
    }

    /// Spoils this sample, or does not.
    pub(crate) fn spoil(&mut self, random: &mut impl Rng, sample: &mut StateSample) -> Delivery {
        if self.left == 0 {
            self.harms.clear();
            self.left = self.manner.run;
            if random.random_bool(self.manner.share) {
                let count = random.random_range(1..=3);
                self.harms.extend((0..count).map(|_| HARMS[random.random_range(0..HARMS.len())]));
            }
        }
        self.left -= 1;
        self.spoilt += u64::from(!self.harms.is_empty());
        let mut delivery = Delivery::Whole;
        for harm in &self.harms {
            delivery = harm.apply(random, sample, &self.last).unwrap_or(delivery);
        }
        if matches!(delivery, Delivery::Whole | Delivery::Unannounced | Delivery::Twice) {
            self.last = *sample;
        }
        delivery
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Harm {
    Bits,
    Bit,
    Strange,
    Scaled,
    Jump,
    Wrench,
    Sequence,
    Stamp,
    Again,
    Boot,
    Joints,
    Flags,
    Lost,
    Unannounced,
    Twice,
    Hollow,
}

const HARMS: [Harm; 16] = [
    Harm::Bits,
    Harm::Bit,
    Harm::Strange,
    Harm::Scaled,
    Harm::Jump,
    Harm::Wrench,
    Harm::Sequence,
    Harm::Stamp,
    Harm::Again,
    Harm::Boot,
    Harm::Joints,
    Harm::Flags,
    Harm::Lost,
    Harm::Unannounced,
    Harm::Twice,
    Harm::Hollow,
];

impl Harm {
    fn apply(self, random: &mut impl Rng, sample: &mut StateSample, last: &StateSample) -> Option<Delivery> {
        match self {
            Self::Bits => *sample = noise(random),
            Self::Bit => {
                let value = number(random, sample);
                *value = f64::from_bits(value.to_bits() ^ 1 << random.random_range(0..64));
            }
            Self::Strange => *number(random, sample) = STRANGE[random.random_range(0..STRANGE.len())],
            Self::Scaled => *number(random, sample) *= 10f64.powi(random.random_range(-8..9)),
            Self::Jump => *number(random, sample) += 10f64.powi(random.random_range(-6..4)),
            Self::Wrench => sample.wrench.iter_mut().for_each(|value| *value += random.random_range(-300.0..300.0)),
            Self::Sequence => sample.sequence = integer(random, sample.sequence, last.sequence),
            Self::Stamp => {
                let stamp = integer(random, sample.stamp_ns, last.stamp_ns);
                let off = 10u64.pow(random.random_range(3..11));
                let near = [stamp, sample.stamp_ns.saturating_add(off), sample.stamp_ns.saturating_sub(off)];
                sample.stamp_ns = near[random.random_range(0..near.len())];
            }
            Self::Again => *sample = *last,
            Self::Boot => sample.boot_id = integer(random, sample.boot_id, last.boot_id),
            Self::Joints => sample.joint_count = integer(random, sample.joint_count.into(), 8) as u32,
            Self::Flags => {
                let flag = integer(random, 1, 0) as u32;
                let flags = [&mut sample.wrench_valid, &mut sample.drives_enabled, &mut sample.plays_plan];
                *flags.into_iter().nth(random.random_range(0..3))? = flag;
            }
            Self::Lost => return Some(Delivery::None),
            Self::Unannounced => return Some(Delivery::Unannounced),
            Self::Twice => return Some(Delivery::Twice),
            Self::Hollow => return Some(Delivery::Hollow),
        }
        None
    }
}

/// One of the sample's numbers.
fn number<'a>(random: &mut impl Rng, sample: &'a mut StateSample) -> &'a mut f64 {
    let values: [&'a mut [f64]; 5] = [
        &mut sample.joint_position,
        &mut sample.joint_velocity,
        &mut sample.joint_position_reference,
        &mut sample.twist_reference,
        &mut sample.wrench,
    ];
    let mut all: Vec<&'a mut f64> = values.into_iter().flatten().collect();
    all.swap_remove(random.random_range(0..all.len()))
}

/// Another integer than `value`, or the same.
fn integer(random: &mut impl Rng, value: u64, last: u64) -> u64 {
    let step = 1u64 << random.random_range(0..40);
    match random.random_range(0..6) {
        0 => EDGES[random.random_range(0..EDGES.len())],
        1 => random.random(),
        2 => last,
        3 => value.wrapping_add(step),
        4 => value.wrapping_sub(step),
        _ => value.wrapping_add(1),
    }
}

/// A sample of random bits.
fn noise(random: &mut impl Rng) -> StateSample {
    let mut sample = StateSample {
        sequence: random.random(),
        stamp_ns: random.random(),
        boot_id: random.random(),
        applied_command_sequence: random.random(),
        joint_count: random.random(),
        wrench_valid: random.random(),
        drives_enabled: random.random(),
        plays_plan: random.random(),
        ..StateSample::zeroed()
    };
    let values: [&mut [f64]; 5] = [
        &mut sample.joint_position,
        &mut sample.joint_velocity,
        &mut sample.joint_position_reference,
        &mut sample.twist_reference,
        &mut sample.wrench,
    ];
    values.into_iter().flatten().for_each(|value| *value = f64::from_bits(random.random()));
    sample
}
