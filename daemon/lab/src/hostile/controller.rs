//! The motion controller of an attack: a plant in this process, on real ports and at real times,
//! whose samples something may spoil on their way.

use std::time::{Duration, Instant};

use admittance_host::clock::{monotonic_ns, sleep_until_ns};
use ipc_types::services::{self, Access};
use ipc_types::{
    Client, CommandSample, IpcSettings, Mode, Node, Notifier, Publisher, RequestKind, RequestSample, ResponseSample,
    ResponseStatus, StateSample, Subscriber,
};
use plant_sim::plant::CycleTiming;
use plant_sim::run::{AnyPlant, any_plant};
use plant_sim::scenario::Scenario;

use super::arena::{Findings, PATIENCE};
use super::watch::Watch;
use admittancectl::request::request;

/// Cycles by which the machine may hold the controller up before it leaves samples out.
const BEHIND: u64 = 4;
/// Between two looks for an answer.
const POLL_NS: u64 = 200_000;
/// When a request is given up, and asked again.
const ASKED_AGAIN: Duration = Duration::from_secs(5);
/// Cycles between two looks whether there is control again.
const CALM_CYCLES: u64 = 40;

/// How a sample is published.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delivery {
    /// As it should be.
    Whole,
    /// Not at all.
    None,
    /// Without a notification.
    Unannounced,
    /// Twice, with both notifications.
    Twice,
    /// Only the notification.
    Hollow,
}

/// The ports of a motion controller, and its plant.
pub(crate) struct Controller {
    states: Publisher<StateSample>,
    arrived: Notifier,
    commands: Subscriber<CommandSample>,
    plant: Box<dyn AnyPlant>,
    period: u64,
    boots: u64,
    /// Samples published.
    pub(crate) published: u64,
}

impl Controller {
    pub(crate) fn open(node: &Node, settings: &IpcSettings, scenario: &Scenario) -> Result<Self, String> {
        let text = |error: &dyn std::fmt::Display| error.to_string();
        let (instance, create) = (&settings.instance, Access::OpenOrCreate);
        let states = services::state(node, instance, create).map_err(|e| text(&e))?;
        let arrived = services::state_arrival(node, instance, create).map_err(|e| text(&e))?;
        let commands = services::command(node, instance, create).map_err(|e| text(&e))?;
        let period = (scenario.timing.sampling_time_s * 1e9) as u64;
        Ok(Self {
            states: states.publisher().map_err(|e| text(&e))?,
            arrived: arrived.notifier().map_err(|e| text(&e))?,
            commands: commands.subscriber().map_err(|e| text(&e))?,
            plant: plant(scenario, 1)?,
            period,
            boots: 1,
            published: 0,
        })
    }

    /// Starts anew, as a controller that was restarted, with this scenario at the same rate.
    pub(crate) fn restart(&mut self, scenario: &Scenario) -> Result<(), String> {
        self.boots += 1;
        self.plant = plant(scenario, self.boots)?;
        Ok(())
    }

    /// Whether the scenario's motion is over.
    pub(crate) fn is_finished(&self) -> bool {
        self.plant.is_finished() || self.plant.met_singularity()
    }

    /// One cycle: publishes the sample after `spoil` has had it, and waits for the answer until the
    /// next one is due.
    pub(crate) fn cycle(&mut self, spoil: impl FnOnce(&mut StateSample) -> Delivery) {
        while monotonic_ns() > self.plant.now_ns() + BEHIND * self.period {
            self.go_on();
        }
        let due = self.plant.now_ns();
        sleep_until_ns(due);
        let mut sample = *self.plant.sample();
        let delivery = spoil(&mut sample);
        if matches!(delivery, Delivery::Whole | Delivery::Unannounced | Delivery::Twice) {
            self.publish(&sample, delivery != Delivery::Unannounced);
        }
        if delivery == Delivery::Twice {
            self.publish(&sample, true);
        }
        if delivery == Delivery::Hollow {
            // Nobody who listens is no failure.
            let _ = self.arrived.notify();
        }
        let give_up = due + self.period - POLL_NS;
        loop {
            if let Ok(Some(command)) = self.commands.receive() {
                // What does not answer a sample of this plant is of no use to it, and that is all.
                let _ = self.plant.receive(&command, monotonic_ns());
                if command.state_stamp_ns == sample.stamp_ns {
                    break;
                }
            }
            let now = monotonic_ns();
            if now >= give_up {
                break;
            }
            sleep_until_ns((now + POLL_NS).min(give_up));
        }
        self.go_on();
    }

    fn publish(&mut self, sample: &StateSample, announced: bool) {
        self.published += u64::from(self.states.send_copy(*sample).is_ok());
        if announced {
            let _ = self.arrived.notify();
        }
    }

    fn go_on(&mut self) {
        self.plant.settle(CycleTiming::default());
        self.plant.integrate();
    }

    /// Asks while samples go on, and waits for the answer.
    pub(crate) fn ask(
        &mut self,
        client: &Client,
        kind: RequestKind,
        mut each: impl FnMut(),
    ) -> Result<ResponseSample, String> {
        let give_up = Instant::now() + PATIENCE;
        while Instant::now() < give_up {
            let pending = client.send_copy(addressed(request(kind))).map_err(|error| format!("{kind}: {error:?}"))?;
            // A request that came after its deadline is asked again.
            let until = Instant::now() + ASKED_AGAIN;
            while Instant::now() < until {
                self.cycle(|_| Delivery::Whole);
                each();
                match pending.receive() {
                    Ok(Some(response)) if response.status != ResponseStatus::Expired.code() => return Ok(*response),
                    Ok(Some(_)) => break,
                    Ok(None) => {}
                    Err(error) => return Err(format!("{kind}: the response was lost: {error:?}")),
                }
            }
        }
        Err(format!("{kind}: no answer within {} s", PATIENCE.as_secs()))
    }

    /// Some good samples.
    pub(crate) fn rest(&mut self, watch: &mut Watch, findings: &mut Findings) {
        for _ in 0..CALM_CYCLES {
            self.cycle(|_| Delivery::Whole);
            watch.look(findings);
        }
    }

    /// Lets the file hold again, whatever requests and other files have changed. In contact that
    /// may not be: then control ends first.
    pub(crate) fn restore(
        &mut self,
        client: &Client,
        watch: &mut Watch,
        findings: &mut Findings,
    ) -> Result<(), String> {
        let give_up = Instant::now() + PATIENCE;
        loop {
            let answer = self.ask(client, RequestKind::Reload, || watch.look(findings))?;
            if answer.status == ResponseStatus::Done.code() {
                return Ok(());
            }
            if Instant::now() > give_up {
                return Err(format!("the file's values are not taken again: {}", answer.text()));
            }
            self.ask(client, RequestKind::Disable, || watch.look(findings))?;
            self.rest(watch, findings);
        }
    }

    /// Only good samples from now on: the daemon has to control again, after a reset where it has
    /// stopped.
    pub(crate) fn calm(
        &mut self,
        air: &Scenario,
        client: &Client,
        watch: &mut Watch,
        findings: &mut Findings,
    ) -> Result<(), String> {
        self.restart(air)?;
        let (give_up, before) = (Instant::now() + PATIENCE, watch.seen);
        loop {
            self.rest(watch, findings);
            let answer = self.ask(client, RequestKind::Status, || watch.look(findings))?;
            let next = match Mode::from_code(answer.mode) {
                // Where nothing is seen nothing is found.
                Some(Mode::Free) if watch.seen == before => return Err("control without a record".to_owned()),
                Some(Mode::Free) => return Ok(()),
                Some(Mode::Stopped) => RequestKind::Reset,
                _ if answer.enabled == 0 => RequestKind::Enable,
                _ => RequestKind::Status,
            };
            let said = self.ask(client, next, || watch.look(findings))?;
            if Instant::now() > give_up {
                return Err(format!("no control again: {}; {next}: {}", answer.text(), said.text()));
            }
        }
    }
}

/// The plant of a scenario, whose samples begin now.
fn plant(scenario: &Scenario, boot: u64) -> Result<Box<dyn AnyPlant>, String> {
    let first = monotonic_ns() + Duration::from_millis(2).as_nanos() as u64;
    any_plant(scenario, first, (first ^ boot) | 1, false).map_err(|error| error.to_string())
}

/// A request that stays valid for as long as tools let it.
pub(crate) fn addressed(sample: RequestSample) -> RequestSample {
    let now = monotonic_ns();
    RequestSample { id: now, deadline_ns: now + 2_000_000_000, ..sample }
}
