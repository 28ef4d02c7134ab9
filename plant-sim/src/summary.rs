//! Results of a run, from the plant's truth alone.

use ipc_types::TruthSample;

/// Time in s at the end of the motion over which the settled values are means.
pub const SETTLED_WINDOW_S: f64 = 0.2;

/// Above what rounding adds to the time of a sample, in s, and below any cycle time.
const ROUNDING_S: f64 = 1e-6;

/// Accumulates truth samples of one run, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Time in s at which the motion ends.
    end_s: f64,
    /// Unit vector along the surface, in the sense in which the motion slides; base frame.
    tangent: [f64; 3],
    /// Largest |f_y| in N.
    pub peak_force_y_n: f64,
    /// Largest normal force in N.
    pub peak_normal_force_n: f64,
    /// Times that contact ended after the first touch.
    pub contact_losses: u32,
    /// State samples seen since the motion started.
    pub cycles: u64,
    /// Commands that came too late to act.
    pub missed_samples: u64,
    /// Scenario time of the first contact in s.
    pub first_contact_s: Option<f64>,
    settled: Mean,
    tangential: Mean,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    fn value(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.sum / f64::from(self.count) }
    }
}

impl Summary {
    /// For a motion of `duration_s` along `tangent` (any length above zero).
    pub fn new(duration_s: f64, tangent: [f64; 3]) -> Self {
        let length = tangent.iter().map(|t| t * t).sum::<f64>().sqrt();
        Self {
            end_s: duration_s,
            tangent: tangent.map(|t| t / length),
            peak_force_y_n: 0.0,
            peak_normal_force_n: 0.0,
            contact_losses: 0,
            cycles: 0,
            missed_samples: 0,
            first_contact_s: None,
            settled: Mean::default(),
            tangential: Mean::default(),
        }
    }

    /// For a scenario: the tangent is the component of the first phase's velocity along its
    /// surface.
    pub fn of_scenario(scenario: &crate::scenario::Scenario) -> Self {
        let duration: f64 = scenario.motion.iter().map(|phase| phase.duration_s).sum();
        let twist = &scenario.motion[0].twist;
        let velocity: [f64; 3] = std::array::from_fn(|axis| twist.get(axis).copied().unwrap_or(0.0));
        let Some(surface) = &scenario.surface else { return Self::new(duration, velocity) };
        let square: f64 = surface.normal.iter().map(|n| n * n).sum();
        let along: f64 = surface.normal.iter().zip(velocity).map(|(n, v)| n * v).sum();
        Self::new(duration, std::array::from_fn(|axis| velocity[axis] - surface.normal[axis] * along / square))
    }

    /// Takes the next truth sample.
    pub fn add(&mut self, truth: &TruthSample) {
        // What follows is the retreat, in which the tool leaves on purpose.
        if truth.scenario_time_s > self.end_s + ROUNDING_S {
            return;
        }
        self.missed_samples += u64::from(truth.missed);
        if truth.scenario_time_s < 0.0 {
            return;
        }
        self.cycles += 1;
        self.peak_force_y_n = self.peak_force_y_n.max(truth.peak_wrench[1].abs());
        self.peak_normal_force_n = self.peak_normal_force_n.max(truth.peak_normal_force_n);
        self.contact_losses = truth.contact_losses;
        if truth.in_contact == 1 {
            self.first_contact_s.get_or_insert(truth.scenario_time_s);
        }
        if (self.end_s - SETTLED_WINDOW_S..self.end_s).contains(&truth.scenario_time_s) {
            self.settled.add(truth.wrench[1].abs());
            self.tangential.add(self.tangent.iter().zip(&truth.tcp_twist).map(|(t, v)| t * v).sum());
        }
    }

    /// Mean |f_y| in N over the last 0.2 s of the motion.
    pub fn settled_force_y_n(&self) -> f64 {
        self.settled.value()
    }

    /// Mean speed along the surface in m/s over the last 0.2 s of the motion; positive downhill
    /// with the motion.
    pub fn tangential_speed_m_s(&self) -> f64 {
        self.tangential.value()
    }
}
