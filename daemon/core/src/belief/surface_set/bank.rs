//! A bank of nodes: depths at which the surface may begin. For each, what f̂ would show of a spring
//! of 1 N/m there, φ, and four sums over the samples: they suffice for the least squares of every
//! [`Cell`] between two neighbours.

use super::cell::Cell;
use crate::belief::way::Piece;

/// K nodes, ascending.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bank<const K: usize> {
    depth: [f64; K],
    /// Way along the surface until the tool was there, m.
    beside: [f64; K],
    /// φ in m.
    response: [f64; K],
    /// Σ w φ².
    square: [f64; K],
    /// Σ w φ φ', φ' that of the next node.
    product: [f64; K],
    /// Σ w φ f.
    force: [f64; K],
    len: usize,
}

impl<const K: usize> Bank<K> {
    /// No nodes.
    pub(super) fn empty() -> Self {
        let zeros = [0.0; K];
        Self { depth: zeros, beside: zeros, response: zeros, square: zeros, product: zeros, force: zeros, len: 0 }
    }

    /// Depth of the last node in m; −∞ without one.
    pub(super) fn last(&self) -> f64 {
        if self.len == 0 { f64::NEG_INFINITY } else { self.depth[self.len - 1] }
    }

    /// Depth of the first node in m; ∞ without one.
    pub(super) fn first(&self) -> f64 {
        if self.len == 0 { f64::INFINITY } else { self.depth[0] }
    }

    /// A node at a greater depth than any, at which the tool is now, after so much way along the
    /// surface. The first one is forgotten where there is no room.
    pub(super) fn push(&mut self, depth: f64, beside: f64) {
        if self.len == K {
            let Self { depth, beside, response, square, product, force, len: _ } = self;
            for values in [depth, beside, response, square, product, force] {
                values.copy_within(1.., 0);
            }
            self.len -= 1;
        }
        for values in [&mut self.response, &mut self.square, &mut self.product, &mut self.force] {
            values[self.len] = 0.0;
        }
        (self.depth[self.len], self.beside[self.len]) = (depth, beside);
        self.len += 1;
    }

    /// Forgets the nodes that are deeper.
    pub(super) fn drop_below(&mut self, depth: f64) {
        while self.len > 0 && self.depth[self.len - 1] > depth {
            self.len -= 1;
        }
        if self.len > 0 {
            self.product[self.len - 1] = 0.0;
        }
    }

    /// φ after a piece of the way.
    pub(super) fn advance(&mut self, piece: &Piece, [start, middle, end]: [f64; 3], decay: f64) {
        let [x0, x1, x2] = piece.depth;
        for (response, depth) in self.response.iter_mut().zip(&self.depth).take(self.len) {
            let force = |x: f64| (x - depth).max(0.0);
            *response = decay * *response + start * force(x0) + middle * force(x1) + end * force(x2);
        }
    }

    /// The sums after a sample with this pressing `force` (N) and `weight`.
    pub(super) fn add(&mut self, force: f64, weight: f64) {
        for j in 0..self.len {
            let weighted = weight * self.response[j];
            self.square[j] += weighted * self.response[j];
            self.force[j] += weighted * force;
            if j + 1 < self.len {
                self.product[j] += weighted * self.response[j + 1];
            }
        }
    }

    /// Way along the surface until the tool was at this depth, m; `None` where no cell has it.
    pub(super) fn beside(&self, depth: f64) -> Option<f64> {
        let (depths, beside) = (&self.depth[..self.len], &self.beside[..self.len]);
        let next = depths.partition_point(|node| *node < depth);
        let Some(last) = next.checked_sub(1) else {
            return beside.first().filter(|_| depths[0] == depth).copied();
        };
        let part = (depth - depths[last]) / (depths.get(next)? - depths[last]);
        Some(beside[last] + part * (beside[next] - beside[last]))
    }

    /// Number of cells.
    pub(super) fn cells(&self) -> usize {
        self.len.saturating_sub(1)
    }

    /// A cell, and the responses of its two nodes in m.
    pub(super) fn cell(&self, j: usize) -> (Cell, [f64; 2]) {
        let cell = Cell {
            depth: [self.depth[j], self.depth[j + 1]],
            squares: [self.square[j], self.product[j], self.square[j + 1]],
            products: [self.force[j], self.force[j + 1]],
        };
        (cell, [self.response[j], self.response[j + 1]])
    }
}
