//! What the paper claims, held against the rows.

use super::{LIMIT_N, Row};

/// Peak in N that the high damping exceeds: "more than 200 %" above the limit.
const HIGH_DAMPING_PEAK_N: f64 = 600.0;

/// The claims that the rows do not show, in words; none if all is as the paper says.
pub(crate) fn broken(rows: &[&Row]) -> Vec<String> {
    let mut broken = Vec::new();
    for row in rows {
        let (name, peak, losses) = (row.name, row.peak_force_y_n, row.contact_losses);
        match name {
            "damping-low" if losses == 0 => broken.push(format!("{name} never lost contact, it should bounce")),
            "damping-high" if peak <= HIGH_DAMPING_PEAK_N => {
                broken.push(format!("{name} peaked at {peak:.1} N, it should exceed {HIGH_DAMPING_PEAK_N} N"));
            }
            _ if name.starts_with("mpc") => {
                // Written so that NaN counts as a failure.
                let (touched, within) = (peak > 0.0, peak <= LIMIT_N);
                if !within {
                    broken.push(format!("{name} peaked at {peak:.1} N, above {LIMIT_N} N"));
                }
                if let Some(stop) = &row.stop {
                    broken.push(format!("{name}'s daemon stopped the arm: {stop}"));
                }
                if losses > 0 || !touched {
                    broken.push(format!("{name} lost contact {losses} times, or never touched"));
                }
            }
            _ => {}
        }
    }
    broken
}

#[cfg(test)]
mod tests {
    use super::super::Percentiles;
    use super::*;

    fn row(name: &'static str, peak_force_y_n: f64, contact_losses: u32) -> Row {
        let answer_time_us = Percentiles { p50: 1.0, p99: 1.0, max: 1.0 };
        let (settled_force_y_n, tangential_speed_m_s, cycles, missed_samples) = (1.0, 0.1, 500, 0);
        Row {
            name,
            peak_force_y_n,
            contact_losses,
            settled_force_y_n,
            tangential_speed_m_s,
            cycles,
            missed_samples,
            answer_time_us,
            stop: None,
        }
    }

    #[test]
    fn each_claim_can_break() {
        let good = [row("damping-low", 219.0, 8), row("damping-high", 625.0, 0), row("mpc-paper", 160.0, 0)];
        assert!(broken(&good.iter().collect::<Vec<_>>()).is_empty());
        let bad = [
            row("damping-low", 219.0, 0),
            row("damping-high", 500.0, 0),
            row("mpc-paper", 200.1, 0),
            row("mpc-default", 100.0, 1),
            row("mpc-paper", f64::NAN, 0),
            row("mpc-paper", 0.0, 0),
            Row { stop: Some("SamplesMissed at 1.072 s (Stopped)".to_owned()), ..row("mpc-default", 144.0, 0) },
        ];
        for row in &bad {
            assert!(!broken(&[row]).is_empty(), "{row:?}");
        }
    }
}
