//! How a new row stands to the working set: what is left of its normal, and what that means.

/// Below this part of its length, what is left of a normal after taking away the others is
/// rounding: the row depends on them. Coefficients carry about 1e-12 of rounding; rows that differ
/// by less than this have the same effect.
const DEPENDENT: f64 = 1e-9;

/// The same where rows are exchanged for one another without end.
const NEARLY_DEPENDENT: f64 = 1e-7;

/// What may be left of a normal without the others and be rounding: part of its length, or of the
/// longest of those that it is a combination of.
const COMBINED: f64 = 1e-12;

/// How a new normal c stands to W, from [`WorkingSet::project`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::mpc::qp) struct Projection {
    /// ‖c‖².
    pub(in crate::mpc::qp) whole: f64,
    /// ‖c − Q Qᵀ c‖².
    pub(in crate::mpc::qp) rest: f64,
    /// Whether c is a combination of the normals in W.
    pub(in crate::mpc::qp) dependent: bool,
    /// Columns before this one are zero in what is left.
    pub(super) start: usize,
}

impl Projection {
    pub(super) fn new(whole: f64, rest: f64, start: usize) -> Self {
        Self { whole, rest, dependent: rest <= whole * (DEPENDENT * DEPENDENT) || rest.is_nan(), start }
    }

    /// Whether following what is left of c moves y by ten million times what it is missed by, or more.
    pub(in crate::mpc::qp) fn is_nearly_dependent(&self) -> bool {
        self.rest <= self.whole * (NEARLY_DEPENDENT * NEARLY_DEPENDENT)
    }

    /// Whether what is left is rounding in what c is a combination of: the longest part is given.
    pub(in crate::mpc::qp) fn is_cancelled(&self, longest: f64) -> bool {
        self.rest <= longest * longest * (COMBINED * COMBINED)
    }

    /// The same with so much more left of c, across to the rest.
    pub(in crate::mpc::qp) fn with(&self, more: f64) -> Self {
        Self::new(self.whole, self.rest + more * more, self.start)
    }

    /// Whether c is a combination but for its own rounding.
    pub(in crate::mpc::qp) fn is_exact(&self) -> bool {
        self.rest <= self.whole * (COMBINED * COMBINED)
    }
}
