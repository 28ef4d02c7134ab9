//! Files of consecutive closed-loop MPC problems with their exact solutions; little-endian.
//!
//! Header: eight int32, nx nu nd nc H count 0 0; then float64 the diagonals of Q (nx) and R (nu).
//! Each record, float64, row-major: A (nx·nx), B (nx·nu), c (nx), x0 (nx), xref (nx), F (nc·nd), f0
//! (nc), f_lo (nc), f_hi (nc), Jinv (nd·nu), v_lo (nd), v_hi (nd), U (H·nu). The problem: min
//! Σ_{k=1..H} (x_k−xref)ᵀQ(x_k−xref) + Σ u_kᵀR u_k with x_{k+1} = A x_k + B u_k + c, f_lo ≤ F q_k +
//! f0 ≤ f_hi for k = 2..H, v_lo ≤ Jinv u_k ≤ v_hi; x = [q (nd), q̇ (nd), f̂ (nc)].

mod checks;
mod problems;

use std::path::Path;

use admittance_core::output::MAX_STEPS;

use crate::sequence::Sequence;

/// Why a file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ProblemFileError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// The file is no file of problems.
    #[error("{field}: found {found}, accepted: {accepted}")]
    Format {
        /// The field.
        field: String,
        /// What was found.
        found: String,
        /// What would be accepted.
        accepted: String,
    },
}

fn format_error(field: impl Into<String>, found: impl ToString, accepted: impl Into<String>) -> ProblemFileError {
    ProblemFileError::Format { field: field.into(), found: found.to_string(), accepted: accepted.into() }
}

/// The matrices of one problem, as they stand in the file.
#[derive(Debug, Clone)]
pub struct Record {
    /// A, nx×nx.
    pub a: Vec<f64>,
    /// B, nx×nu.
    pub b: Vec<f64>,
    /// c, nx.
    pub c: Vec<f64>,
    /// x_0, nx.
    pub initial: Vec<f64>,
    /// xref, nx.
    pub set_point: Vec<f64>,
    /// F, nc×nd.
    pub f: Vec<f64>,
    /// f0, nc.
    pub f0: Vec<f64>,
    /// f_lo, nc.
    pub f_lower: Vec<f64>,
    /// f_hi, nc.
    pub f_upper: Vec<f64>,
    /// Jinv, nd×nu.
    pub jacobian_inverse: Vec<f64>,
    /// v_lo, nd.
    pub v_lower: Vec<f64>,
    /// v_hi, nd.
    pub v_upper: Vec<f64>,
    /// U, H×nu: the solution, in order of time.
    pub solution: Vec<f64>,
}

/// A file.
#[derive(Debug, Clone)]
pub struct ProblemFile {
    /// nd.
    pub joints: usize,
    /// nu.
    pub inputs: usize,
    /// nc.
    pub forces: usize,
    /// H.
    pub horizon: usize,
    /// Diagonal of Q, nx.
    pub state_weight: Vec<f64>,
    /// Diagonal of R, nu.
    pub input_weight: Vec<f64>,
    /// The problems.
    pub records: Vec<Record>,
}

/// Work on a file's problems, whatever their sizes.
pub trait Task {
    /// What comes out.
    type Output;

    /// Runs it for N joints and as many task axes, M of which have an input.
    fn run<const N: usize, const M: usize>(self, sequence: &Sequence<N, M>) -> Self::Output;
}

struct Reader<'a> {
    bytes: &'a [u8],
}

impl Reader<'_> {
    fn take(&mut self, field: &str, count: usize) -> Result<Vec<f64>, ProblemFileError> {
        let Some((numbers, rest)) = self.bytes.split_at_checked(8 * count) else {
            return Err(format_error(field, format!("{} bytes", self.bytes.len()), format!("{} bytes", 8 * count)));
        };
        self.bytes = rest;
        let numbers: Vec<f64> = numbers.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        match numbers.iter().position(|number| !number.is_finite()) {
            Some(index) => Err(format_error(format!("{field}[{index}]"), numbers[index], "a finite number")),
            None => Ok(numbers),
        }
    }
}

impl ProblemFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`ProblemFileError`], which names the field.
    pub fn read(path: &Path) -> Result<Self, ProblemFileError> {
        Self::parse(&std::fs::read(path)?)
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`ProblemFileError::Format`].
    pub fn parse(bytes: &[u8]) -> Result<Self, ProblemFileError> {
        let Some((header, rest)) = bytes.split_at_checked(32) else {
            return Err(format_error("header", format!("{} bytes", bytes.len()), "at least 32 bytes"));
        };
        let header: Vec<i32> = header.as_chunks().0.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect();
        let number = |field: &str, index: usize, range: std::ops::RangeInclusive<i32>| {
            let value = header[index];
            if range.contains(&value) {
                Ok(value as usize)
            } else {
                Err(format_error(format!("header, {field}"), value, format!("{} to {}", range.start(), range.end())))
            }
        };
        let joints = number("nd", 2, 2..=6)?;
        if joints != 2 && joints != 6 {
            return Err(format_error("header, nd", joints, "2 or 6"));
        }
        let inputs = number("nu", 1, 1..=joints as i32)?;
        let forces = number("nc", 3, 0..=inputs as i32)?;
        let states = 2 * joints + forces;
        number("nx", 0, states as i32..=states as i32)?;
        let horizon = number("H", 4, 2..=MAX_STEPS as i32)?;
        let count = number("count", 5, 1..=i32::MAX)?;
        let mut reader = Reader { bytes: rest };
        let state_weight = reader.take("Q", states)?;
        let input_weight = reader.take("R", inputs)?;
        let mut records = Vec::new();
        for index in 0..count {
            let mut take = |field: &str, count: usize| reader.take(&format!("record {index}, {field}"), count);
            records.push(Record {
                a: take("A", states * states)?,
                b: take("B", states * inputs)?,
                c: take("c", states)?,
                initial: take("x0", states)?,
                set_point: take("xref", states)?,
                f: take("F", forces * joints)?,
                f0: take("f0", forces)?,
                f_lower: take("f_lo", forces)?,
                f_upper: take("f_hi", forces)?,
                jacobian_inverse: take("Jinv", joints * inputs)?,
                v_lower: take("v_lo", joints)?,
                v_upper: take("v_hi", joints)?,
                solution: take("U", horizon * inputs)?,
            });
        }
        if !reader.bytes.is_empty() {
            return Err(format_error("end of file", format!("{} more bytes", reader.bytes.len()), "nothing"));
        }
        let file = Self { joints, inputs, forces, horizon, state_weight, input_weight, records };
        file.check_structure()?;
        Ok(file)
    }

    /// Numbers in a state.
    pub fn states(&self) -> usize {
        2 * self.joints + self.forces
    }

    /// T_s in s.
    pub fn sampling_time(&self) -> f64 {
        self.records[0].a[self.joints]
    }

    /// Runs a task on the problems.
    pub fn run<T: Task>(&self, task: T) -> T::Output {
        match (self.joints, self.inputs) {
            (2, 1) => task.run(&self.sequence::<2, 1>()),
            (2, _) => task.run(&self.sequence::<2, 2>()),
            (_, 1) => task.run(&self.sequence::<6, 1>()),
            (_, 2) => task.run(&self.sequence::<6, 2>()),
            (_, 3) => task.run(&self.sequence::<6, 3>()),
            (_, 4) => task.run(&self.sequence::<6, 4>()),
            (_, 5) => task.run(&self.sequence::<6, 5>()),
            (_, _) => task.run(&self.sequence::<6, 6>()),
        }
    }
}
