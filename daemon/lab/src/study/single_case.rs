//! A single case of a study: to find out what went wrong, and to run its files in the daemon and
//! the plant.

use std::fmt::Write as _;
use std::path::Path;

use super::controller::{self, Profile, Variant};
use super::draw::Draw;
use super::{closed_loop, statistics};

/// The case in words: the draw, what is attainable, and what each variant did.
///
/// # Errors
/// What controller, plant or judge do not accept.
pub(crate) fn describe(seed: u64, index: u64) -> Result<String, String> {
    let draw = Draw::new(seed, index)?;
    let mut text = format!("{draw:#?}\nnormal force limit: {:.3} N\n", draw.normal_force_limit_n());
    for variant in Variant::ALL {
        let config = controller::controller(&draw, Profile::Default, variant)?;
        let seen = closed_loop::run(&config, &controller::scenario(&draw)?)?;
        if let (Variant::Nominal, Some(first)) = (variant, &seen.first_active) {
            let answer = closed_loop::contact(&draw, first).lowest_peak()?;
            let _ = writeln!(
                text,
                "first active sample: {:.3} N; lowest attainable peak {:.3} N (linear optimum {:.3} N)",
                first.normal_force_n, answer.peak_n, answer.optimum_n
            );
        }
        let over =
            if statistics::exceeds(seen.peak_while_feasible_n, draw.normal_force_limit_n()) { ", unsound" } else { "" };
        let _ = writeln!(
            text,
            "{}: first verdict feasible {:?}, infeasible cycles {}, stop reason {}, peak {:.3} N (in feasible cycles {:.3} \
             N{over}), losses {}, resting {:.3} N",
            variant.name(),
            seen.first_verdict_feasible,
            seen.infeasible_cycles,
            seen.stop_reason,
            seen.peak_n,
            seen.peak_while_feasible_n,
            seen.contact_losses,
            seen.resting_force_n,
        );
    }
    Ok(text)
}

/// Writes the case's scenario.toml, and a controller.toml for each variant, into a directory.
///
/// # Errors
/// A case that cannot be drawn, and what the file system says.
pub(crate) fn save(seed: u64, index: u64, directory: &Path) -> Result<(), String> {
    let draw = Draw::new(seed, index)?;
    let write = |name: String, text: String| {
        let path = directory.join(name);
        std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))
    };
    std::fs::create_dir_all(directory).map_err(|error| format!("{}: {error}", directory.display()))?;
    write("scenario.toml".to_owned(), controller::scenario_text(&draw))?;
    for variant in Variant::ALL {
        let text = controller::controller_text(&draw, Profile::Default, variant);
        write(format!("controller-{}.toml", variant.name()), text)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::closed_loop;
    use crate::study::controller::{Profile, Variant, controller, scenario};

    /// A contact that a study has found: after a bounce that no sample showed, the arm came back
    /// as fast as it came first, and was stopped at 1.26 times what was attainable.
    #[test]
    fn a_bounce_between_two_samples_is_no_reason_to_stop() {
        let draw = Draw::new(246_883, 137).unwrap();
        let config = controller(&draw, Profile::Default, Variant::Nominal).unwrap();
        let seen = closed_loop::run(&config, &scenario(&draw).unwrap()).unwrap();
        assert!(seen.is_feasible() && !seen.stopped(), "{seen:?}");
    }
}
