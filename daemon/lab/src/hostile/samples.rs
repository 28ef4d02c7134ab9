//! Garbage samples: a controller on the real ports that sends what no controller should.

use std::path::Path;

use rand::{Rng, RngExt as _};

use super::arena::{Arena, Findings, in_arena};
use super::cell::Cell;
use super::controller::Controller;
use super::spoil::{Manner, Spoiler};
use super::watch::Watch;
use super::{Count, Counts};
use crate::answers::Bounds;
use admittancectl::{Exit, Outcome};

/// Garbage samples of one case; the good ones between them come on top.
pub(super) const PER_CASE: u64 = 1000;
/// Samples until the daemon has to be in control again.
const EPISODE: std::ops::Range<u64> = 100..700;

/// One case: episodes of touches whose samples are spoilt, and calm after each.
pub(super) fn case(
    random: &mut rand_chacha::ChaCha8Rng,
    daemon: Option<&Path>,
    findings: &mut Findings,
) -> Outcome<Counts> {
    let cell = Cell::draw(random)?;
    in_arena(&cell.text, daemon, findings, |arena, findings| attack(&cell, arena, random, findings))
}

fn attack(cell: &Cell, arena: &mut Arena, random: &mut impl Rng, findings: &mut Findings) -> Result<Counts, String> {
    let text = |(_, why): (Exit, String)| why;
    let node = arena.node("hostile controller").map_err(text)?;
    let settings = arena.session.settings().clone();
    let client = arena.client(&node)?;
    let mut watch = Watch::new(&node, &settings.instance, &cell.config, Bounds::of(&cell.config))?;
    let mut controller = Controller::open(&node, &settings, &cell.air)?;
    controller.calm(&cell.air, &client, &mut watch, findings)?;
    let (mut spoilt, mut episodes) = (0, 0);
    while spoilt < PER_CASE && findings.0.is_empty() {
        episodes += 1;
        controller.restart(&cell.touch(random).map_err(text)?)?;
        let mut spoiler = Spoiler::new(Manner::draw(random));
        for _ in 0..random.random_range(EPISODE) {
            if controller.is_finished() {
                controller.restart(&cell.touch(random).map_err(text)?)?;
            }
            controller.cycle(|sample| spoiler.spoil(random, sample));
            watch.look(findings);
        }
        spoilt += spoiler.spoilt;
        arena.is_alive()?;
        let calm = controller.calm(&cell.air, &client, &mut watch, findings);
        arena.is_alive()?;
        calm?;
        arena.look_at_holdings(findings);
    }
    Ok(Counts::from([
        (Count::Samples, controller.published),
        (Count::Spoilt, spoilt),
        (Count::Episodes, episodes),
        (Count::Refused, watch.refused),
        (Count::Records, watch.seen),
    ]))
}
