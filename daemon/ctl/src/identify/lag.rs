//! What no lag explains: by how much a joint follows later at some times than at others.

use super::joint_loop::Moving;
use super::loops::{BLOCK_S, Evidence, FoundLoop};

/// Below this a lag is none that matters, s.
const LEAST_S: f64 = 2e-4;
/// Stretches that it takes to say that they differ.
const LEAST_STRETCHES: usize = 5;
/// A lag has to explain this part of what the fit leaves: else the joint is not late but pushed, by its
/// neighbours or by friction.
const LEAST_EXPLAINED: f64 = 0.5;
/// A stretch counts where it has this part of the speed changes of the liveliest.
const LEAST_LIVELY: f64 = 0.05;

/// Twice the deviation of a joint's lag from stretch to stretch, beyond what noise makes of it, s;
/// `None` where that is nothing.
pub(super) fn unexplained_lag_s(evidence: &Evidence<'_>, joint: usize, found: &FoundLoop) -> Option<f64> {
    let mut stretches: Vec<(f64, f64, f64)> = Vec::new();
    for ((track, used), moved) in evidence.tracks.iter().zip(evidence.used).zip(evidence.follow(&found.model, joint)) {
        let mut at = 1;
        while at + 1 < track.len() {
            let end_s = ((track.time_s[at] / BLOCK_S).floor() + 1.0) * BLOCK_S;
            let (mut product, mut square, mut left) = (0.0, 0.0, 0.0);
            while at + 1 < track.len() && track.time_s[at] < end_s {
                if used[at] {
                    let slope = slope(&moved, &track.time_s, at);
                    // An arm that is late by d shows v(t − d).
                    let off = track.velocity[at][joint] - moved[at].shown;
                    product -= slope * off;
                    left += off * off;
                    square += slope * slope;
                }
                at += 1;
            }
            stretches.push((product, square, left));
        }
    }
    let liveliest = stretches.iter().map(|(_, square, _)| *square).fold(0.0, f64::max);
    stretches.retain(|(_, square, _)| *square > LEAST_LIVELY * liveliest && *square > 0.0);
    if stretches.len() < LEAST_STRETCHES {
        return None;
    }
    let noise = found.residual_rad_s * found.residual_rad_s;
    let total: f64 = stretches.iter().map(|(_, square, _)| square).sum();
    // Each weighs by its changes of speed; noise alone would leave noise / square of each.
    let explained = stretches.iter().map(|(product, square, _)| product * product / square).sum::<f64>();
    let left: f64 = stretches.iter().map(|(.., left)| left).sum();
    let spread = explained / total;
    let by_noise = stretches.len() as f64 * noise / total;
    let lag_s = 2.0 * (spread - by_noise).max(0.0).sqrt();
    // The noise of so few stretches varies by about √(2/n) of itself.
    let is_certain = spread > by_noise * (1.0 + 3.0 * (2.0 / stretches.len() as f64).sqrt());
    (is_certain && lag_s > LEAST_S && explained > LEAST_EXPLAINED * left).then_some(lag_s)
}

fn slope(moved: &[Moving], time_s: &[f64], at: usize) -> f64 {
    (moved[at + 1].shown - moved[at - 1].shown) / (time_s[at + 1] - time_s[at - 1])
}
