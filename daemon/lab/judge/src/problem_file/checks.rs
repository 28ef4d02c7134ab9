//! Whether the numbers of a file are those of problems that the solver takes.

use super::{ProblemFile, ProblemFileError, format_error};

/// Largest deviation of an entry of A, B or c from the model's, relative to the larger of 1 and the
/// entry.
const STRUCTURE: f64 = 1e-12;

impl ProblemFile {
    /// Whether A, B and c are those of the Euler model (17) with the constants of the first record.
    pub(super) fn check_structure(&self) -> Result<(), ProblemFileError> {
        let (nd, nx, nu, t) = (self.joints, self.states(), self.inputs, self.sampling_time());
        let first = &self.records[0].a;
        self.check_ranges()?;
        for (index, record) in self.records.iter().enumerate() {
            for row in 0..nx {
                let decay = first[row * nx + row];
                let c = match row / nd {
                    0 => Some(0.0),
                    1 => None,
                    _ => Some((1.0 - decay) * record.f0[row - 2 * nd]),
                };
                let expected_a = |column: usize| match row / nd {
                    0 => f64::from(column == row) + if column == row + nd { t } else { 0.0 },
                    1 => {
                        if column == row {
                            decay
                        } else {
                            0.0
                        }
                    }
                    _ if column < nd => (1.0 - decay) * record.f[(row - 2 * nd) * nd + column],
                    _ => {
                        if column == row {
                            decay
                        } else {
                            0.0
                        }
                    }
                };
                let expected_b = |column: usize| match row / nd {
                    1 => (1.0 - decay) * record.jacobian_inverse[(row - nd) * nu + column],
                    _ => 0.0,
                };
                let entries = (0..nx)
                    .map(|column| ("A", column, record.a[row * nx + column], expected_a(column)))
                    .chain((0..nu).map(|column| ("B", column, record.b[row * nu + column], expected_b(column))))
                    .chain(c.map(|c| ("c", 0, record.c[row], c)));
                for (matrix, column, found, expected) in entries {
                    if (found - expected).abs() > STRUCTURE * expected.abs().max(1.0) {
                        return Err(format_error(
                            format!("record {index}, {matrix}[{row}, {column}]"),
                            found,
                            format!("{expected}, as in the Euler model (17) with constant T_s, T_V and T_est"),
                        ));
                    }
                }
            }
        }
        Ok(())
    }

    /// Whether the model can be read off and each problem is strictly convex, with bounds the right
    /// way round.
    fn check_ranges(&self) -> Result<(), ProblemFileError> {
        let (nd, nx, t) = (self.joints, self.states(), self.sampling_time());
        let check = |is_accepted: bool, field: String, found: f64, accepted: &str| {
            if is_accepted { Ok(()) } else { Err(format_error(field, found, accepted)) }
        };
        for (index, &weight) in self.state_weight.iter().enumerate() {
            check(weight >= 0.0, format!("Q[{index}]"), weight, "a weight of at least 0")?;
        }
        for (index, &weight) in self.input_weight.iter().enumerate() {
            check(weight > 0.0, format!("R[{index}]"), weight, "a weight above 0")?;
        }
        check(t > 0.0, format!("record 0, A[0, {nd}]"), t, "a sampling time above 0 s")?;
        for row in nd..nx {
            let decay = self.records[0].a[row * nx + row];
            let accepted = "1 − T_s/T above −1 and below 1";
            check(decay.abs() < 1.0, format!("record 0, A[{row}, {row}]"), decay, accepted)?;
        }
        for (index, record) in self.records.iter().enumerate() {
            for (field, lower, upper) in
                [("f_hi", &record.f_lower, &record.f_upper), ("v_hi", &record.v_lower, &record.v_upper)]
            {
                for (axis, (&lower, &upper)) in lower.iter().zip(upper).enumerate() {
                    let accepted = format!("at least the lower bound, {lower}");
                    check(lower <= upper, format!("record {index}, {field}[{axis}]"), upper, &accepted)?;
                }
            }
        }
        Ok(())
    }
}
