//! Mutated requests: several clients that ask for anything, while the arm goes on touching.

use std::path::Path;
use std::time::{Duration, Instant};

use admittance_host::clock::monotonic_ns;
use admittance_runner::config::Config;
use ipc_types::{
    Client, Law, PendingResponse, REQUEST_VALUES, RequestKind, RequestSample, ResponseSample, ResponseStatus,
};
use rand::{Rng, RngExt as _};

use super::arena::{Arena, Findings, PATIENCE, in_arena};
use super::cell::Cell;
use super::controller::{Controller, Delivery};
use super::spoil::{EDGES, STRANGE};
use super::watch::Watch;
use super::{Count, Counts};
use crate::answers::Bounds;
use crate::keys::{self, set};
use admittancectl::{Exit, Outcome};

/// Requests of one case.
pub(super) const PER_CASE: u64 = 1000;
/// Clients, and requests that each may have under way.
const CLIENTS: usize = 3;
const UNDER_WAY: usize = 2;
/// The client that now and then no longer wants to know: its next requests may then displace one
/// that waits, as the service is made.
const FICKLE: usize = 0;
/// What requests may change in a cell under attack.
const ALLOWED: &str = "normal_stiffness_min_n_m = 1e4\nnormal_stiffness_max_n_m = 1e6\nsurface_normal_angle_rad = 0.2\n\
    contact_point_distance_m = 0.05\nlaw = true\ntare_bias_max = [4.0, 4.0, 4.0, 1.0, 1.0, 1.0]";

/// Clients that ask for anything, and what they wait for.
pub(super) struct Askers {
    clients: Vec<Client>,
    pending: Vec<(usize, RequestSample, PendingResponse, Instant)>,
    /// Bounds of the force limits in force.
    limits: Vec<(f64, f64)>,
    pub(super) asked: u64,
    pub(super) done: u64,
}

impl Askers {
    pub(super) fn new(arena: &Arena, node: &ipc_types::Node, limits: Vec<(f64, f64)>) -> Result<Self, String> {
        let clients = (0..CLIENTS).map(|_| arena.client(node)).collect::<Result<_, _>>()?;
        Ok(Self { clients, pending: Vec::new(), limits, asked: 0, done: 0 })
    }

    /// From now on this configuration may be in force: its force limits, and what requests may make
    /// of them.
    pub(super) fn allow(&mut self, config: &Config) {
        let requests = &config.requests;
        let limits =
            [Some(&config.contact.force_limit), requests.force_limit_min.as_ref(), requests.force_limit_max.as_ref()];
        for limits in limits.into_iter().flatten() {
            for ((low, high), limit) in self.limits.iter_mut().zip(limits) {
                (*low, *high) = (low.min(*limit), high.max(*limit));
            }
        }
    }

    /// Lets every client that may ask for something more; now and then one no longer wants to know.
    pub(super) fn ask(&mut self, random: &mut impl Rng) {
        for index in 0..self.clients.len() {
            let under_way = self.pending.iter().filter(|(client, ..)| *client == index).count();
            if under_way >= UNDER_WAY {
                continue;
            }
            let request = draw(random);
            if let Ok(pending) = self.clients[index].send_copy(request) {
                self.asked += 1;
                if index != FICKLE || random.random_bool(0.5) {
                    self.pending.push((index, request, pending, Instant::now()));
                }
            }
        }
    }

    /// Looks at the answers; one that does not come is found after `patience`.
    pub(super) fn hear(&mut self, patience: Duration, findings: &mut Findings) {
        let (limits, done) = (&self.limits, &mut self.done);
        self.pending.retain(|(index, request, pending, since)| match pending.receive() {
            Ok(Some(response)) => {
                *done += u64::from(response.status == ResponseStatus::Done.code());
                flaws(request, &response, limits).into_iter().for_each(|why| findings.note(why));
                false
            }
            Ok(None) if since.elapsed() > patience => {
                if *index == FICKLE {
                    return false;
                }
                findings.note(format!("no answer within {} s: {request:?}", patience.as_secs()));
                false
            }
            Ok(None) => true,
            Err(error) => {
                findings.note(format!("{error:?}: {request:?}"));
                false
            }
        });
    }

    pub(super) fn are_waiting(&self) -> bool {
        self.pending.iter().any(|(client, ..)| *client != FICKLE)
    }
}

/// What is wrong with an answer.
fn flaws(request: &RequestSample, response: &ResponseSample, limits: &[(f64, f64)]) -> Vec<String> {
    let mut flaws = Vec::new();
    let text = response.text();
    let told = |what: &str| format!("{what}: \"{text}\" to {request:?}");
    if response.id != request.id {
        flaws.push(told("an answer to something else"));
    }
    let length = response.text_length as usize;
    // Of a file there may be several errors.
    let is_plain = |text: &str| !text.is_empty() && !text.chars().any(|letter| letter.is_control() && letter != '\n');
    if !response.text.get(..length).and_then(|text| std::str::from_utf8(text).ok()).is_some_and(is_plain) {
        flaws.push(told("the text"));
    }
    let status = ResponseStatus::from_code(response.status);
    let asked = RequestKind::from_code(request.kind);
    let is_change = asked.is_some_and(|kind| {
        [RequestKind::SetForceLimit, RequestKind::SetEnvironment, RequestKind::SetLaw].contains(&kind)
    });
    // While control ends, and after its deadline, nothing is accepted.
    let accepts = text.contains("accepted") || text.contains("is ending");
    if status.is_none()
        || (status == Some(ResponseStatus::Unknown)) != asked.is_none()
        || (is_change && status == Some(ResponseStatus::Refused) && !accepts)
    {
        flaws.push(told("the status"));
    }
    let arrays: [&[f64]; 6] = [
        &response.wrench,
        &response.velocity_offset,
        &response.wrench_bias,
        &response.surface_normal,
        &response.contact_point,
        &response.force_limit,
    ];
    if !arrays.iter().all(|values| values.iter().all(|value| value.is_finite())) {
        flaws.push(told("the numbers"));
    }
    let is_within = |(value, (low, high)): (&f64, &(f64, f64))| (*low..=*high).contains(value);
    if !response.force_limit.iter().zip(limits).all(is_within) {
        flaws.push(told(&format!("force limits {:?} out of {limits:?}", response.force_limit)));
    }
    if !(1e2..=1e8).contains(&response.normal_stiffness_n_m) {
        flaws.push(told(&format!("stiffness {}", response.normal_stiffness_n_m)));
    }
    flaws
}

/// Any request.
pub(crate) fn draw(random: &mut impl Rng) -> RequestSample {
    let kind = match random.random_range(0..20) {
        0 => random.random(),
        1 => EDGES[random.random_range(0..EDGES.len())] as u32,
        _ => RequestKind::ALL[random.random_range(0..RequestKind::ALL.len())].code(),
    };
    let now = monotonic_ns();
    let deadline_ns = match random.random_range(0..10) {
        0 => EDGES[random.random_range(0..EDGES.len())],
        1 => now.saturating_sub(random.random_range(0..1_000_000_000)),
        2 => now + random.random_range(0..5_000_000),
        _ => now + 60_000_000_000,
    };
    let mut values = [0.0; REQUEST_VALUES];
    for value in &mut values {
        *value = match random.random_range(0..4) {
            0 => STRANGE[random.random_range(0..STRANGE.len())],
            1 => f64::from_bits(random.random()),
            2 => random.random_range(-1.0..1.0),
            _ => 10f64.powf(random.random_range(-3.0..6.0)),
        };
    }
    let law =
        if random.random_bool(0.8) { Law::ALL[random.random_range(0..Law::ALL.len())].code() } else { random.random() };
    let force = if random.random_bool(0.9) { random.random_range(0..2) } else { random.random() };
    let given = if random.random_bool(0.8) { random.random_range(0..256) } else { random.random() };
    RequestSample { id: random.random(), deadline_ns, kind, force, law, given, values }
}

/// The cell with all that requests may change, within bounds; and the bounds of the force limits.
pub(super) fn permit(cell: &mut Cell) -> Outcome<Vec<(f64, f64)>> {
    let mut table = keys::parsed(&cell.text)?;
    keys::parsed(ALLOWED)?.into_iter().for_each(|(key, value)| set(&mut table, "requests", &key, value));
    let limits = cell.config.contact.force_limit.clone();
    let minimum = &cell.config.contact.minimum_force;
    // Above what the rest of the configuration needs on every axis, or not: both are refused well.
    let bounds: Vec<_> = limits.iter().zip(minimum).map(|(limit, low)| (low.max(limit * 0.05), limit * 1.5)).collect();
    let list = |of: fn(&(f64, f64)) -> f64| toml::Value::Array(bounds.iter().map(|pair| of(pair).into()).collect());
    set(&mut table, "requests", "force_limit_min", list(|(low, _)| *low));
    set(&mut table, "requests", "force_limit_max", list(|(_, high)| *high));
    let damping = vec![toml::Value::Float(500.0); limits.len()];
    set(&mut table, "damping", "damping_n_s_m", damping);
    cell.text = table.to_string();
    cell.config = super::arena::parsed(&cell.text)?;
    Ok(bounds)
}

/// One case.
pub(super) fn case(
    random: &mut rand_chacha::ChaCha8Rng,
    daemon: Option<&Path>,
    findings: &mut Findings,
) -> Outcome<Counts> {
    let mut cell = Cell::draw(random)?;
    let limits = permit(&mut cell)?;
    in_arena(&cell.text, daemon, findings, |arena, findings| attack(&cell, limits, arena, random, findings))
}

fn attack(
    cell: &Cell,
    limits: Vec<(f64, f64)>,
    arena: &mut Arena,
    random: &mut impl Rng,
    findings: &mut Findings,
) -> Result<Counts, String> {
    let text = |(_, why): (Exit, String)| why;
    let node = arena.node("hostile clients").map_err(text)?;
    let settings = arena.session.settings().clone();
    let client = arena.client(&node)?;
    let mut watch = Watch::new(&node, &settings.instance, &cell.config, Bounds::of(&cell.config).without_normal())?;
    let mut controller = Controller::open(&node, &settings, &cell.air)?;
    controller.calm(&cell.air, &client, &mut watch, findings)?;
    arena.look_at_holdings(findings);
    let mut askers = Askers::new(arena, &node, limits)?;
    controller.restart(&cell.touch(random).map_err(text)?)?;
    while (askers.asked < PER_CASE || askers.are_waiting()) && findings.0.is_empty() {
        if controller.is_finished() {
            controller.restart(&cell.touch(random).map_err(text)?)?;
        }
        controller.cycle(|_| Delivery::Whole);
        watch.look(findings);
        if askers.asked < PER_CASE {
            askers.ask(random);
        }
        askers.hear(PATIENCE, findings);
    }
    arena.is_alive()?;
    // What requests have changed goes with a reload.
    controller.restart(&cell.air)?;
    controller.restore(&client, &mut watch, findings)?;
    let counts =
        Counts::from([(Count::Requests, askers.asked), (Count::Done, askers.done), (Count::Records, watch.seen)]);
    drop(askers);
    controller.calm(&cell.air, &client, &mut watch, findings)?;
    arena.is_alive()?;
    arena.look_at_holdings(findings);
    Ok(counts)
}
