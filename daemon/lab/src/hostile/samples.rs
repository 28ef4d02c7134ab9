//! Garbage samples: a controller on the real ports that sends what no controller should.

use rand::{Rng, RngExt as _};

use super::arena::{Arena, Findings};
use super::cell::Cell;
use super::controller::Controller;
use super::spoil::{Manner, Spoiler};
use super::watch::Watch;
use super::{Count, Counts};
use crate::answers::Bounds;
use admittancectl::{Exit, Outcome};

/// Samples of one case.
pub(super) const PER_CASE: u64 = 2000;
/// Samples until the daemon has to be in control again.
const EPISODE: std::ops::Range<u64> = 100..700;

/// One case: episodes of touches whose samples are spoilt, and calm after each.
pub(super) fn case(random: &mut rand_chacha::ChaCha8Rng, findings: &mut Findings) -> Outcome<Counts> {
    let cell = Cell::draw(random)?;
    let mut arena = Arena::new(&cell.text)?;
    let counts = attack(&cell, &mut arena, random, findings);
    if let Err(why) = &counts {
        findings.note(why.clone());
    }
    arena.end(findings);
    Ok(counts.unwrap_or_default())
}

fn attack(cell: &Cell, arena: &mut Arena, random: &mut impl Rng, findings: &mut Findings) -> Result<Counts, String> {
    let text = |(_, why): (Exit, String)| why;
    let node = arena.node("hostile controller").map_err(text)?;
    let settings = arena.session.settings().clone();
    let client = arena.client(&node)?;
    let mut watch = Watch::new(&node, &settings.instance, &cell.config, Bounds::of(&cell.config))?;
    let mut controller = Controller::open(&node, &settings, &cell.air)?;
    controller.calm(&cell.air, &client, &mut watch, findings)?;
    let (mut sent, mut episodes) = (0, 0);
    while sent < PER_CASE && findings.0.is_empty() {
        episodes += 1;
        controller.restart(&cell.touch(random).map_err(text)?)?;
        let mut spoiler = Spoiler::new(Manner::draw(random));
        let length = random.random_range(EPISODE).min(PER_CASE - sent);
        sent += length;
        for _ in 0..length {
            if controller.is_finished() {
                controller.restart(&cell.touch(random).map_err(text)?)?;
            }
            controller.cycle(|sample| spoiler.spoil(random, sample));
            watch.look(findings);
        }
        arena.is_alive()?;
        let calm = controller.calm(&cell.air, &client, &mut watch, findings);
        arena.is_alive()?;
        calm?;
        arena.look_at_holdings(findings);
    }
    Ok(Counts::from([
        (Count::Samples, sent),
        (Count::Episodes, episodes),
        (Count::Refused, watch.refused),
        (Count::Records, watch.seen),
    ]))
}
