//! Sparse matrices while they are written, and as Clarabel takes them.

use clarabel::algebra::CscMatrix;

/// Entries of a sparse matrix.
#[derive(Debug, Clone, Default)]
pub(super) struct Entries {
    at: Vec<(usize, usize)>,
    pub(super) values: Vec<f64>,
}

impl Entries {
    pub(super) fn push(&mut self, row: usize, column: usize, value: f64) {
        self.at.push((column, row));
        self.values.push(value);
    }

    /// The order of the entries by column and row.
    pub(super) fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.at.len()).collect();
        order.sort_by_key(|&index| self.at[index]);
        order
    }

    pub(super) fn matrix(&self, order: &[usize], rows: usize, columns: usize) -> CscMatrix<f64> {
        let mut starts = vec![0; columns + 1];
        for (column, _) in &self.at {
            starts[column + 1] += 1;
        }
        for column in 0..columns {
            starts[column + 1] += starts[column];
        }
        CscMatrix::new(
            rows,
            columns,
            starts,
            order.iter().map(|&index| self.at[index].1).collect(),
            order.iter().map(|&index| self.values[index]).collect(),
        )
    }
}
