//! What hangs on the wrench sensor: mass, centre of gravity and bias, from its weight in several
//! orientations and from what accelerates it; and the noise that is left.

use admittance_core::intake::{Conditioning, GivenIn};
use admittance_core::quantities::GivenWrench;
use admittance_runner::config::{Config, WrenchSection};
use admittance_runner::parameters::conditioning;
use nalgebra::{Matrix3, Vector3, Vector6};

use super::estimate::Estimate;
use super::least_squares::{Fit, MOST_INFLATION, Problem, correlation_time, mean_square, student};
use super::loops::BLOCK_S;
use super::track::Track;
use super::way::Instant;

/// Mass, mass times centre of gravity, bias.
const PARAMETERS: usize = 10;
const ROUNDS: usize = 2;
/// A slower acceleration leaves the weight alone, m/s²; a tool is about so long, m.
const QUIET_M_S2: f64 = 0.05;
const LEVER_M: f64 = 0.1;
/// More samples than this are thinned out.
const MOST_ROWS: usize = 3000;
/// Noise of at least this much, N, N m: rounding.
const LEAST_NOISE: f64 = 1e-6;

/// The lag and the dead time of the wrench estimate, s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Filter {
    pub(super) time_constant_s: f64,
    pub(super) dead_time_s: f64,
}

#[derive(Debug, Clone)]
pub(super) struct FoundTool {
    pub(super) mass_kg: Estimate,
    /// In the frame of the TCP; none where there is no mass for certain.
    pub(super) center_of_gravity_m: Option<[Estimate; 3]>,
    pub(super) bias: [Estimate; 6],
    /// Whether mass and bias can be told from each other well enough.
    pub(super) is_told: bool,
    /// Standard deviation on one axis of x y z, N.
    pub(super) noise_n: Estimate,
    values: [f64; PARAMETERS],
}

/// A sample with what the sensor would show of each parameter.
struct Row {
    track: usize,
    sample: usize,
    block: usize,
    rotation: Matrix3<f64>,
    given: Vector6<f64>,
    /// Columns of all parameters but the bias.
    by: [Vector6<f64>; 4],
    /// Whether the tool is hardly accelerated: what is felt of it is its weight.
    is_quiet: bool,
}

/// What the tool would be felt as, at every sample of all tracks.
pub(super) struct Felt {
    rows: Vec<Row>,
    conditioning: Conditioning<6>,
    /// How many components of a sample's wrench mean something.
    components: usize,
}

/// A wrench at the TCP in the base frame as the sensor gives it.
fn reading(
    conditioning: &Conditioning<6>,
    tcp: &Matrix3<f64>,
    force: &Vector3<f64>,
    torque: &Vector3<f64>,
) -> Vector6<f64> {
    let wrench = Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z);
    Conditioning { tool_mass: 1.0, tool_weight: Vector3::zeros(), ..*conditioning }.unloaded(tcp, &wrench).0
}

/// What passes a filter: the acceleration of the TCP, and by the centre of gravity's coordinates
/// that of a point there, and the moment of what accelerates it.
#[derive(Clone, Copy, Default)]
struct Signals {
    linear: Vector3<f64>,
    by_center: Matrix3<f64>,
    moment: Matrix3<f64>,
}

impl Signals {
    fn mixed(&self, other: &Self, share: f64) -> Self {
        Self {
            linear: self.linear + (other.linear - self.linear) * share,
            by_center: self.by_center + (other.by_center - self.by_center) * share,
            moment: self.moment + (other.moment - self.moment) * share,
        }
    }
}

/// The filtered signals at each instant of a way; `center` is where the centre of gravity is believed
/// to be.
fn filtered(way: &[Instant], filter: Filter, center: &Vector3<f64>) -> Vec<(f64, Signals)> {
    let turning = |instant: &Instant| instant.angular.cross_matrix() * instant.rotation;
    let mut shown = Signals::default();
    let mut all = vec![(way.first().map_or(0.0, |first| first.time_s), shown)];
    for pair in way.windows(2) {
        let length_s = pair[1].time_s - pair[0].time_s;
        let linear = (pair[1].linear - pair[0].linear) / length_s;
        let by_center = (turning(&pair[1]) - turning(&pair[0])) / length_s;
        let acceleration = linear + by_center * center;
        let levers = (pair[0].rotation + pair[1].rotation) * 0.5;
        let moment = Matrix3::from_columns(&[0, 1, 2].map(|axis| levers.column(axis).cross(&acceleration)));
        let lag = filter.time_constant_s;
        let share = if lag > 0.0 { -(-length_s / lag).exp_m1() } else { 1.0 };
        shown = shown.mixed(&Signals { linear, by_center, moment }, share);
        all.push((pair[1].time_s, shown));
    }
    all
}

fn delayed(signals: &[(f64, Signals)], at_s: f64) -> Signals {
    let next = signals.partition_point(|(time_s, _)| *time_s <= at_s);
    match (next.checked_sub(1).map(|before| signals[before]), signals.get(next)) {
        (Some((from_s, before)), Some((to_s, after))) => before.mixed(after, (at_s - from_s) / (to_s - from_s)),
        (Some((_, last)), None) => last,
        (None, _) => Signals::default(),
    }
}

impl Felt {
    pub(super) fn new(
        config: &Config,
        tracks: &[Track],
        ways: &[Vec<Instant>],
        filter: Filter,
        center: Vector3<f64>,
    ) -> Self {
        // All six components are looked at, whatever the arm's axes: what has a value for each is left out.
        let section = WrenchSection { deadband: None, bias: [0.0; 6], ..config.wrench.clone() };
        let conditioning = conditioning::<6>(&section).unwrap_or_else(Conditioning::none);
        let gravity = Vector3::from(config.wrench.gravity_m_s2);
        let (mut rows, mut before) = (Vec::new(), 0);
        for (number, (track, way)) in tracks.iter().zip(ways).enumerate() {
            let signals = filtered(way, filter, &center);
            for instant in way {
                let Some((sample, given)) = instant.sample.and_then(|at| Some((at, track.wrench[at]?))) else {
                    continue;
                };
                let shown = delayed(&signals, instant.time_s - filter.dead_time_s);
                let tcp = &instant.rotation;
                let of = |force: Vector3<f64>, torque: Vector3<f64>| reading(&conditioning, tcp, &force, &torque);
                let by_center = |axis: usize| {
                    let torque = shown.moment.column(axis) - tcp.column(axis).cross(&gravity);
                    of(shown.by_center.column(axis).into_owned(), torque)
                };
                let by = [of(shown.linear - gravity, Vector3::zeros()), by_center(0), by_center(1), by_center(2)];
                let turning = shown.by_center.norm() * LEVER_M;
                let is_quiet = shown.linear.norm() + turning < QUIET_M_S2;
                let block = before + (instant.time_s / BLOCK_S) as usize;
                rows.push(Row { track: number, sample, block, rotation: *tcp, given: given.into(), by, is_quiet });
            }
            before += (track.time_s.last().copied().unwrap_or(0.0) / BLOCK_S) as usize + 1;
        }
        let components = match conditioning.given_in {
            GivenIn::Base | GivenIn::Turned(_) => config.robot.task_axes as usize,
            GivenIn::Sensor(_) => 6,
        };
        Self { rows, conditioning, components }
    }

    /// The tool that fits the samples that are marked: by its weight alone where that tells it, since
    /// what accelerates it is known through the loops and the filter only.
    pub(super) fn tool(&self, used: &[Vec<bool>]) -> Option<FoundTool> {
        let rows: Vec<&Row> = self.rows.iter().filter(|row| used[row.track][row.sample]).collect();
        let quiet: Vec<&Row> = rows.iter().copied().filter(|row| row.is_quiet).collect();
        let by_weight = self.tool_of(&quiet).filter(|tool| tool.is_told);
        by_weight.or_else(|| self.tool_of(&rows))
    }

    fn tool_of(&self, rows: &[&Row]) -> Option<FoundTool> {
        let rows: Vec<&Row> = rows.iter().copied().step_by(rows.len().div_ceil(MOST_ROWS).max(1)).collect();
        if rows.len() < 20 {
            return None;
        }
        let components = self.components;
        let blocks: Vec<usize> = rows.iter().flat_map(|row| std::iter::repeat_n(row.block, components)).collect();
        let mut sizes = [1.0; 2];
        let mut fit = None;
        for _ in 0..ROUNDS {
            let residuals = |values: &[f64; PARAMETERS]| {
                let of = |row: &&Row| {
                    let left = left(row, values);
                    (0..components).map(move |of| left[of] / sizes[of / 3]).collect::<Vec<_>>()
                };
                rows.iter().flat_map(of).collect::<Vec<_>>()
            };
            let problem = Problem {
                start: [0.0; PARAMETERS],
                probe: [0.1; PARAMETERS],
                least: [-1e6; PARAMETERS],
                most: [1e6; PARAMETERS],
                residuals: &residuals,
                blocks: &blocks,
            };
            let found = problem.solve();
            let all: Vec<Vector6<f64>> = rows.iter().map(|row| left(row, &found.values)).collect();
            let size = |from: usize| {
                let all: Vec<f64> =
                    all.iter().flat_map(|left| (from..(from + 3).min(components)).map(|of| left[of])).collect();
                mean_square(&all).sqrt().max(LEAST_NOISE)
            };
            sizes = [size(0), size(3)];
            fit = Some(found);
        }
        fit.map(|fit| found(&fit, &rows, components))
    }

    /// What is left of the wrench of every sample when `tool` is taken out: what the robot exerts on
    /// the environment at the TCP, base frame, N and N m; by track and sample.
    pub(super) fn without(&self, tool: &FoundTool) -> impl Iterator<Item = (usize, usize, Vector6<f64>)> {
        let empty = Conditioning { tool_mass: 0.0, tool_weight: Vector3::zeros(), ..self.conditioning };
        let values = tool.values;
        self.rows.iter().map(move |row| {
            let wrench = empty.wrench(&GivenWrench(left(row, &values)), &row.rotation, &Vector6::zeros());
            (row.track, row.sample, wrench)
        })
    }
}

/// What a row shows beyond what these parameters make of it.
fn left(row: &Row, values: &[f64; PARAMETERS]) -> Vector6<f64> {
    let bias = Vector6::from_fn(|of, _| values[4 + of]);
    row.given - bias - (0..4).map(|k| row.by[k] * values[k]).sum::<Vector6<f64>>()
}

fn found(fit: &Fit<PARAMETERS>, rows: &[&Row], components: usize) -> FoundTool {
    let (values, half) = (fit.values, fit.half_width);
    let mass_kg = Estimate::new(values[0], half[0]);
    let center = |axis: usize| {
        let center = values[1 + axis] / values[0];
        Estimate::new(center, half[1 + axis].hypot(center * half[0]) / values[0])
    };
    let noise = |component: usize| -> Vec<f64> { rows.iter().map(|row| left(row, &values)[component]).collect() };
    let components_of_force = components.min(3);
    let all: Vec<f64> = (0..components_of_force).flat_map(&noise).collect();
    let noise_n = mean_square(&all).sqrt();
    let worth = (0..components_of_force).map(|of| rows.len() as f64 / correlation_time(&noise(of))).sum::<f64>();
    let noise_half = noise_n * student(worth) / (2.0 * worth.max(1.0)).sqrt();
    FoundTool {
        mass_kg,
        center_of_gravity_m: mass_kg.is_there().then(|| [center(0), center(1), center(2)]),
        bias: std::array::from_fn(|of| Estimate::new(values[4 + of], half[4 + of])),
        is_told: fit.inflation[0] < MOST_INFLATION && half[0] < (0.1 * values[0]).max(0.1),
        noise_n: Estimate::new(noise_n, noise_half),
        values,
    }
}
