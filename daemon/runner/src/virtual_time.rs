//! The law against a plant in virtual time: no clock, no ports, no sleep; the same code as in real
//! time.

use admittance_core::quantities::Instant;
use ipc_types::{CommandSample, StateSample, TruthSample, VirtualPlant};

use crate::cycle::{Cycle, CycleReport};

/// A controller and the plant that it is run against.
pub struct VirtualTime<P> {
    /// The controller.
    pub cycle: Box<dyn Cycle>,
    plant: P,
    command: CommandSample,
}

/// One cycle that is over.
#[derive(Debug, Clone)]
pub struct Step {
    /// The sample that was answered.
    pub state: StateSample,
    /// The answer.
    pub command: CommandSample,
    /// What the cycle tells besides.
    pub report: CycleReport,
    /// Which of the law's questions for the time was the first to be answered with yes; 0 = none.
    pub expired_at: u64,
    /// What was true at the instant of the sample, with the peaks since the sample before.
    pub truth: TruthSample,
}

impl<P: VirtualPlant> VirtualTime<P> {
    /// A controller against `plant`.
    pub fn new(cycle: Box<dyn Cycle>, plant: P) -> Self {
        Self { cycle, plant, command: CommandSample::zeroed() }
    }

    /// The plant.
    pub fn plant(&self) -> &P {
        &self.plant
    }

    /// The sample that the next step answers; `None` at the end.
    ///
    /// # Errors
    /// The plant has not published it.
    pub fn sample(&self) -> Result<Option<&StateSample>, String> {
        if self.plant.is_finished() {
            return Ok(None);
        }
        self.plant.sample().map(Some).ok_or_else(|| "the plant published no sample".to_owned())
    }

    /// Answers a sample at its own instant, with unlimited time; `None` at the end.
    ///
    /// # Errors
    /// The plant has not published a sample, or refuses the command.
    pub fn step(&mut self) -> Result<Option<Step>, String> {
        self.step_in_time(|_| false)
    }

    /// Answers a sample at its own instant; `None` at the end. `expired` says whether time is up
    /// when the law asks; it is given how often the law has asked about this sample, this time
    /// included.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_in_time(&mut self, mut expired: impl FnMut(u64) -> bool) -> Result<Option<Step>, String> {
        let Some(state) = self.sample()?.copied() else { return Ok(None) };
        let (mut asked, mut expired_at) = (0, 0);
        let mut is_expired = || {
            asked += 1;
            let is_over = expired(asked);
            expired_at = if is_over && expired_at == 0 { asked } else { expired_at };
            is_over
        };
        let now = Instant::from_nanoseconds(state.stamp_ns);
        let report = self.cycle.answer(&state, now, &mut is_expired, &mut self.command);
        self.command.sequence += 1;
        let truth = self.plant.advance(Some(&self.command))?;
        Ok(Some(Step { state, command: self.command, report, expired_at, truth }))
    }

    /// Runs to the end of the motion.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn run(mut self) -> Result<Vec<Step>, String> {
        std::iter::from_fn(|| self.step().transpose()).collect()
    }
}
