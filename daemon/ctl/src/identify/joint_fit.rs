//! A fit of one joint's speed loop, of some of its parameters beside the others.

use super::joint_loop::Loop;
use super::least_squares::{Fit, MOST_INFLATION, Problem};
use super::loops::Evidence;

/// Place of the report's lag among the parameters of a fit.
pub(super) const LAG: usize = 3;

/// Expected sizes of the residuals of velocity and of position per cycle, rad/s.
#[derive(Clone, Copy)]
pub(super) struct Sizes {
    pub(super) velocity: f64,
    pub(super) position: f64,
}

/// A fit of one joint, whatever its parameters.
#[derive(Clone)]
pub(super) struct JointFit {
    pub(super) model: Loop,
    /// Of time constant, dead time, damping and report lag.
    pub(super) half_width: [f64; 4],
    pub(super) is_told: bool,
    pub(super) akaike: f64,
    pub(super) mean_square: f64,
    pub(super) effective: f64,
    /// What an error of the report lag does to time constant and dead time, if it was free.
    pub(super) by_lag: [f64; 2],
}

impl Evidence<'_> {
    fn sized(&self, model: &Loop, joint: usize, sizes: Sizes) -> Vec<f64> {
        let [velocity, position] = self.residuals(model, joint);
        let velocity = velocity.into_iter().map(|residual| residual / sizes.velocity);
        velocity.chain(position.into_iter().map(|residual| residual / sizes.position)).collect()
    }

    /// A fit of these parameters, in the order of time constant, dead time, damping and report lag;
    /// the others stay as at the start.
    pub(super) fn fit<const K: usize>(
        &self,
        joint: usize,
        start: Loop,
        sizes: Sizes,
        blocks: &[usize],
        free: [usize; K],
    ) -> JointFit {
        let of = |values: &[f64; K]| {
            let mut all = [start.time_constant_s, start.dead_time_s, start.damping, start.report_lag_s];
            free.iter().zip(values).for_each(|(parameter, value)| all[*parameter] = *value);
            Loop { time_constant_s: all[0], dead_time_s: all[1], damping: all[2], report_lag_s: all[3] }
        };
        // Time constant, dead time, damping, report lag: value, probe, least, most.
        let rows = [
            [start.time_constant_s, 1e-4 * start.time_constant_s, 3e-4, 0.5],
            [start.dead_time_s, 2e-6, -0.005, 0.1],
            [start.damping, 1e-4, 0.1, 5.0],
            [start.report_lag_s, 2e-6, 0.0, 0.1],
        ];
        let row = |k: usize| free[k];
        let problem = Problem {
            start: std::array::from_fn(|k| rows[row(k)][0]),
            probe: std::array::from_fn(|k| rows[row(k)][1]),
            least: std::array::from_fn(|k| rows[row(k)][2]),
            most: std::array::from_fn(|k| rows[row(k)][3]),
            residuals: &|values: &[f64; K]| self.sized(&of(values), joint, sizes),
            blocks,
        };
        let fit: Fit<K> = problem.solve();
        let mut half_width = [0.0; 4];
        (0..K).for_each(|k| half_width[row(k)] = fit.half_width[k]);
        let lag_variance = fit.inverse[(K - 1, K - 1)];
        let by_lag = if free[K - 1] == LAG && lag_variance > 0.0 {
            [0, 1].map(|k| fit.inverse[(k, K - 1)] / lag_variance)
        } else {
            [0.0; 2]
        };
        JointFit {
            model: of(&fit.values),
            half_width,
            is_told: fit.inflation.iter().all(|inflation| *inflation < MOST_INFLATION),
            akaike: fit.akaike(fit.effective),
            mean_square: fit.mean_square(),
            effective: fit.effective,
            by_lag,
        }
    }
}
