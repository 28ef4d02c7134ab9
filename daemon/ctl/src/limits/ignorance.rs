//! What it costs not to know the stiffness: the highest safe speed on every surface of a range, by
//! what is told of it.

use admittance_runner::config::{Config, ContactPointName};
use serde::Serialize;

use super::cell::{self, highest_m_s, weight};
use super::search::{self, Cases};
use super::{Approach, Question};
use crate::parallel::{self, Progress};
use crate::plausible::{CONTACT_TOLERANCE_M, NOISE_N};

/// How many times its beginning the end of a range is.
const WIDTHS: [f64; 3] = [3.0, 10.0, 50.0];

/// What a controller is told of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Told {
    /// Its stiffness, whichever it is.
    Each,
    /// The range.
    Range,
    /// The configured stiffness, whatever the true one is.
    Configured,
}

/// One range at one noise, with the answers by what is told.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Price {
    /// Least and greatest stiffness in N/m, the configured one in the middle.
    pub(super) range_n_m: [f64; 2],
    /// Standard deviation of the wrench's noise, N; it is told.
    pub(super) noise_n: f64,
    /// Each surface told as it is.
    pub(super) each: Answer,
    /// The range told.
    pub(super) range: Answer,
    /// The configured stiffness told for all of them.
    pub(super) configured: Answer,
}

/// A speed at which all surfaces of the range are safe.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Answer {
    /// m/s; 0 where the lowest one is not safe, `None` where the configuration does not allow it.
    pub(super) speed_m_s: Option<f64>,
    /// What comes first above it.
    pub(super) limited_by: String,
}

/// The rows.
///
/// # Errors
/// What controller or plant do not accept although the checks did.
pub(super) fn prices(config: &Config, question: &Question, threads: usize) -> Result<Vec<Price>, String> {
    let (told, noise) = (config.environment.normal_stiffness_n_m, config.environment.wrench_noise_n);
    let noise = if noise > 0.0 { noise } else { NOISE_N };
    let rows: Vec<([f64; 2], f64)> = [0.0, noise]
        .into_iter()
        .flat_map(|noise_n| WIDTHS.map(|width| ([told / width.sqrt(), told * width.sqrt()], noise_n)))
        .map(|(range, noise_n)| (range.map(|end| search::round_to_digits(end, 3)), noise_n))
        .collect();
    let kinds = [Told::Each, Told::Range, Told::Configured];
    let stiffnesses = |[least, most]: [f64; 2]| [least, told, most];
    let count = (rows.len() * kinds.len()) as u64;
    let cases = u64::from(question.instants) * stiffnesses([told; 2]).len() as u64;
    let each = search::expected_tries(cases) * weight(config.control.sampling_time_s);
    let progress = Progress::begin(count * each, &format!("{count} answers about ranges of the stiffness"));
    let answers = parallel::map_within(&progress, count, threads, |index| {
        let ((range, noise_n), told) = (rows[index as usize / kinds.len()], kinds[index as usize % kinds.len()]);
        let part = progress.part(each);
        let tried = || part.add(weight(config.control.sampling_time_s));
        answer(config, question, &World { stiffnesses: stiffnesses(range), range, noise_n }, told, &tried)
    })?;
    let mut answers = answers.into_iter();
    let mut next = || answers.next().ok_or("an answer is missing");
    let row =
        |(range_n_m, noise_n)| Ok(Price { range_n_m, noise_n, each: next()?, range: next()?, configured: next()? });
    rows.into_iter().map(row).collect()
}

/// Surfaces that may be there.
struct World {
    /// The true ones that are tried, N/m.
    stiffnesses: [f64; 3],
    range: [f64; 2],
    noise_n: f64,
}

fn answer(
    base: &Config,
    question: &Question,
    world: &World,
    told: Told,
    tried: &(impl Fn() + Sync),
) -> Result<Answer, String> {
    let configs: Result<Vec<Config>, String> =
        world.stiffnesses.iter().map(|stiffness| config_told(base, world, told, *stiffness)).collect();
    let configs = match configs {
        Ok(configs) => configs,
        Err(why) => return Ok(Answer { speed_m_s: None, limited_by: why }),
    };
    let (highest, bound) = highest_m_s(base, &question.approach);
    let count = world.stiffnesses.len() as u64;
    let try_case = |speed: f64, index: u64| {
        let (surface, instant) = ((index % count) as usize, index / count);
        let phase = instant as f64 / f64::from(question.instants);
        let found = is_safe(&configs[surface], &question.approach, (speed, phase), world, (surface, index));
        tried();
        found
    };
    let cases = Cases { count: count * u64::from(question.instants), threads: 1, try_case };
    let found = search::highest_safe(highest, &cases)?;
    let limited_by = found.beyond.map_or_else(|| bound.to_owned(), |(_, why)| why);
    Ok(Answer { speed_m_s: Some(found.safe_m_s), limited_by })
}

/// The configuration with so much told of a surface.
///
/// # Errors
/// What its checks do not accept.
fn config_told(base: &Config, world: &World, told: Told, stiffness: f64) -> Result<Config, String> {
    let mut config = base.clone();
    let environment = &mut config.environment;
    environment.wrench_noise_n = world.noise_n;
    let range = (told == Told::Range).then_some(world.range);
    environment.stiffness_range_n_m = range;
    let is_configured = environment.contact == ContactPointName::Configured;
    let tolerance = environment.contact_tolerance_m.unwrap_or(CONTACT_TOLERANCE_M);
    environment.contact_tolerance_m = range.filter(|_| is_configured).map(|_| tolerance);
    let told = if told == Told::Each { stiffness } else { base.environment.normal_stiffness_n_m };
    cell::config_for(&config, base.control.sampling_time_s, told)
}

/// Whether an approach at a speed (m/s), touching so much of a cycle after a sample, is safe on one
/// of the surfaces.
fn is_safe(
    config: &Config,
    approach: &Approach,
    (speed_m_s, phase): (f64, f64),
    world: &World,
    (surface, seed): (usize, u64),
) -> Result<Result<(), String>, String> {
    let mut scenario = approach.scenario(config, speed_m_s, phase);
    let stiffness = world.stiffnesses[surface];
    if let Some(surface) = &mut scenario.surface {
        surface.stiffness_n_m = stiffness;
    }
    (scenario.noise.wrench, scenario.noise.seed) = (world.noise_n, seed);
    let found = cell::is_safe_in(config, &scenario)?;
    Ok(found.map_err(|why| format!("{why} ({} N/m)", super::table::stiffness(stiffness))))
}

#[cfg(test)]
mod tests {
    use super::super::Worlds;
    use super::super::tests::planar;
    use super::*;

    #[test]
    fn a_range_costs_less_than_a_wrong_number_and_never_gains() {
        let mut config = planar();
        config.environment.wrench_noise_n = 0.5;
        let question = Question {
            approach: Approach::new(&config, None, None).unwrap(),
            stiffnesses_n_m: Vec::new(),
            sampling_times_s: Vec::new(),
            // With a range a contact begins somewhat below β, which at a single instant may be a cycle: of so many the worst is
            // a cycle late either way.
            instants: 8,
            worlds: Worlds { count: 1, seed: 1 },
        };
        let prices = prices(&config, &question, 2).unwrap();
        let speed = |answer: &Answer| answer.speed_m_s.unwrap();
        assert_eq!(prices.len(), 2 * WIDTHS.len());
        for price in &prices {
            let [each, range, configured] = [&price.each, &price.range, &price.configured].map(speed);
            println!("{price:?}");
            assert!(each > 0.0 && range > 0.0 && range <= each * 1.1, "{price:?}");
            assert!(configured < 0.95 * range, "{price:?}");
        }
        let hardest = prices.iter().filter(|price| price.noise_n == 0.0).map(|price| speed(&price.each));
        assert!(hardest.is_sorted_by(|a, b| a >= b), "a wider range has harder surfaces");
    }

    #[test]
    fn a_range_that_no_key_accepts_is_no_answer() {
        let mut config = planar();
        config.environment.normal_stiffness_n_m = 5e7;
        let world = World { stiffnesses: [5e6, 5e7, 5e8], range: [5e6, 5e8], noise_n: 0.0 };
        let why = config_told(&config, &world, Told::Range, 5e7).unwrap_err();
        assert!(why.contains("stiffness_range_n_m"), "{why}");
    }
}
