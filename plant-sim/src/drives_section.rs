//! `[drives]`: what the drives of the emulated robot take.

use admittance_client::{DriveLimits, Drives};
use admittance_host::config_section;
use ipc_types::MAX_JOINTS;

config_section! {
    /// Drives that refuse jumps. The emulated motion controller keeps their limits itself, whatever it is commanded,
    /// and comes to rest within them when it stops by itself.
    pub struct DrivesSection {
        /// Largest speed reference of each joint; of a prismatic joint in m/s. Unlimited when absent.
        joint_speed_rad_s: Option<Vec<f64>>, unit "rad/s, m/s", range 0.01..=100.0, length 2..=8;
        /// Largest change from one reference to the next over the time between them.
        joint_acceleration_rad_s2: Vec<f64>, unit "rad/s^2, m/s^2", range 0.01..=1e5, length 2..=8;
        /// Largest change of that, over the same time. Unlimited when absent.
        joint_jerk_rad_s3: Option<Vec<f64>>, unit "rad/s^3, m/s^3", range 0.1..=1e8, length 2..=8;
        /// Time from one reference to the next. When absent that of a plan's first steps by default: as many to a
        /// cycle as last 1 ms or more, four at most.
        interval_s: Option<f64>, unit "s", range 1e-5..=0.1;
    }
}

impl DrivesSection {
    /// What they take from a controller with this time from sample to sample.
    pub fn drives(&self, sampling_time_ns: u64) -> Drives {
        let padded = |limits: Option<&Vec<f64>>| {
            std::array::from_fn(|joint| limits.and_then(|limits| limits.get(joint)).copied().unwrap_or(f64::INFINITY))
        };
        let limits: DriveLimits<MAX_JOINTS> = DriveLimits {
            speed: padded(self.joint_speed_rad_s.as_ref()),
            acceleration: padded(Some(&self.joint_acceleration_rad_s2)),
            jerk: padded(self.joint_jerk_rad_s3.as_ref()),
        };
        let inputs = (sampling_time_ns / 1_000_000).clamp(1, 4);
        let interval_ns =
            self.interval_s.map_or(sampling_time_ns / inputs, |interval_s| (interval_s * 1e9).round() as u64);
        Drives { limits, interval_ns }
    }
}
