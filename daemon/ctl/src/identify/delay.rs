//! The command delay: by how much later than their samples commands act. The twist reference acts
//! at its sample, so only what the daemon adds to it shows the delay; in free motion that is nothing.

use super::estimate::Estimate;
use super::joint_loop::Moving;
use super::least_squares::{MOST_INFLATION, Problem};
use super::loops::{BLOCK_S, FoundLoops};
use super::reference::{delay_bracket, references};
use super::track::Track;

/// Stamps and straight lines between samples allow no narrower interval, s.
const FINEST_S: f64 = 1e-5;

/// The delay in s, by the samples of each track that `shows` marks; `None` where they do not tell.
pub(super) fn command_delay(tracks: &[Track], loops: &FoundLoops, shows: &[Vec<bool>]) -> Option<Estimate> {
    // A controller that is ahead of its samples tells no delay.
    let (least, most) = delay_bracket(tracks).filter(|(least, most)| least < most)?;
    let (mut blocks, mut before) = (Vec::new(), 0);
    let told: Vec<usize> = (0..loops.joints.len()).filter(|joint| loops.joints[*joint].is_told).collect();
    for (track, shows) in tracks.iter().zip(shows) {
        let of = |sample: usize| before + (track.time_s[sample] / BLOCK_S * 4.0) as usize;
        for _ in &told {
            blocks.extend((0..track.len()).filter(|sample| shows[*sample]).map(of));
        }
        before = of(track.len() - 1) + 1;
    }
    if blocks.is_empty() {
        return None;
    }
    let residuals = |values: &[f64; 1]| {
        let mut all = Vec::with_capacity(blocks.len());
        for (track, shows) in tracks.iter().zip(shows) {
            let references = references(track, values[0]);
            for joint in &told {
                let found = &loops.joints[*joint];
                let start = Moving::beginning(track.position[0][*joint], track.velocity[0][*joint]);
                let moved = found.model.follow(&references, *joint, &track.time_s, start);
                let size = found.residual_rad_s.max(1e-7);
                let of = |sample: usize| (moved[sample].shown - track.velocity[sample][*joint]) / size;
                all.extend((0..track.len()).filter(|sample| shows[*sample]).map(of));
            }
        }
        all
    };
    let problem = Problem {
        start: [0.5 * (least + most)],
        probe: [2e-6],
        least: [least],
        most: [most],
        residuals: &residuals,
        blocks: &blocks,
    };
    let fit = problem.solve();
    let dead_times: f64 = told.iter().map(|joint| loops.joints[*joint].dead_time_s.half_width).sum();
    let found = Estimate::new(fit.values[0], fit.half_width[0])
        .doubted(FINEST_S)
        .doubted(dead_times / told.len().max(1) as f64);
    // As wide as what the sequences of the commands say by themselves: nothing was added.
    (fit.inflation[0] < MOST_INFLATION && found.half_width < 0.5 * (most - least)).then_some(found)
}
