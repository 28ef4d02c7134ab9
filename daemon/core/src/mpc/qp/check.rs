//! Checks of a solver's answer that need no trust in the solver.

use wide::f64x4;

use super::Qp;
use super::lanes::{LANES, fill_last_group, groups, groups_mut, padded};

/// How far an answer is from satisfying the Karush-Kuhn-Tucker conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KktResidual {
    /// ‖Hz + g + Aᵀy‖∞ relative to the largest of its three parts (and 1).
    pub stationarity: f64,
    /// Largest violation of a bound times the row's weight.
    pub violation: f64,
    /// Largest |y_i · slack_i| relative to the largest part of the gradient (and 1).
    pub complementarity: f64,
}

impl KktResidual {
    /// Whether all three are finite and at most `tolerance`.
    pub fn is_within(&self, tolerance: f64) -> bool {
        // Written so that NaN fails.
        self.stationarity <= tolerance && self.violation <= tolerance && self.complementarity <= tolerance
    }
}

/// Slack of a row towards the bound that its multiplier belongs to.
fn pushed_slack(value: f64, lower: f64, upper: f64, multiplier: f64) -> f64 {
    if multiplier >= 0.0 { upper - value } else { value - lower }
}

/// The multipliers that are not zero, with their rows: few of many, so the others are passed over in groups. (Rows are counted by
/// ranges: a checked sum for each would keep the groups from being compared at once.)
fn pushing(multipliers: &[f64]) -> impl Iterator<Item = (usize, f64)> {
    let groups = (0..multipliers.len()).step_by(LANES).zip(multipliers.chunks(LANES));
    let some = groups.filter(|(_, group)| group.iter().fold(false, |some, y| some | (*y != 0.0)));
    some.flat_map(|(first, ys)| (first..first + ys.len()).zip(ys.iter().copied())).filter(|(_, y)| *y != 0.0)
}

/// All bits of the lanes for which `is_in` is true: what is anything elsewhere, NaN as well, is zero with it.
fn lanes_where(is_in: impl Fn(usize) -> bool) -> f64x4 {
    f64x4::new(core::array::from_fn(|lane| f64::from_bits(if is_in(lane) { u64::MAX } else { 0 })))
}

/// Four rows of H z while they are added up.
struct FourRows<'a> {
    rows: [&'a [[f64; LANES]]; LANES],
    /// z of these rows.
    z: [f64x4; LANES],
    /// Of each row the products, to be added across the lanes.
    sums: [f64x4; LANES],
}

impl FourRows<'_> {
    /// Adds to each row's sum its product with `z` of these columns, from the lanes in `right`; returns `product` of the
    /// columns with what they get from these rows, from the lanes in `left`.
    #[inline(always)]
    fn add(&mut self, column: usize, z: f64x4, product: f64x4, [right, left]: [&[f64x4; LANES]; 2]) -> f64x4 {
        let mut product = product;
        for i in 0..LANES {
            let row = f64x4::new(self.rows[i][column]);
            self.sums[i] = (row & right[i]).mul_add(z, self.sums[i]);
            product = (row & left[i]).mul_add(self.z[i], product);
        }
        product
    }
}

/// H z, from the upper triangle of H alone, four rows at a time: what is left of the diagonal or beyond the variables
/// may be anything.
fn write_product(qp: &Qp<'_>, z: &[f64], product: &mut [f64]) {
    let (n, stride) = (qp.variables, qp.stride);
    let all = [lanes_where(|_| true); LANES];
    let from_diagonal = core::array::from_fn(|i| lanes_where(|lane| lane >= i));
    let behind_diagonal = core::array::from_fn(|i| lanes_where(|lane| lane > i));
    let Some(last) = n.div_ceil(LANES).checked_sub(1) else { return };
    let is_variable = lanes_where(|lane| last * LANES + lane < n);
    let (z, product) = (groups(z), groups_mut(product));
    let end = f64x4::new(z[last]) & is_variable;
    product.fill([0.0; LANES]);
    for block in 0..=last {
        let row = |i: usize| &qp.hessian[(block * LANES + i) * stride..][..stride];
        // Rows beyond the variables are not there: with a z of 0 any other does.
        let rows = core::array::from_fn(|i| groups(row(i.min(n - 1 - block * LANES))));
        let own = if block == last { end } else { f64x4::new(z[block]) };
        let mut four = FourRows { rows, z: own.to_array().map(f64x4::splat), sums: [f64x4::ZERO; LANES] };
        let mut sum = f64x4::new(product[block]);
        if block == last {
            let [right, left] = [&from_diagonal, &behind_diagonal].map(|lanes| lanes.map(|lanes| lanes & is_variable));
            sum = four.add(block, own, sum, [&right, &left]);
        } else {
            sum = four.add(block, own, sum, [&from_diagonal, &behind_diagonal]);
            for column in block + 1..last {
                product[column] =
                    four.add(column, f64x4::new(z[column]), f64x4::new(product[column]), [&all, &all]).to_array();
            }
            let is_there = [is_variable; LANES];
            product[last] = four.add(last, end, f64x4::new(product[last]), [&is_there, &is_there]).to_array();
        }
        let [a, b, c, d] = f64x4::transpose(four.sums);
        product[block] = (sum + ((a + b) + (c + d))).to_array();
    }
}

/// The residual of `z`, which is stride long and may be anything beyond n, with the multipliers `y`. n²
/// multiplications, and what the rows take for A z and Aᵀ y; `scratch` is at least 2·stride + rows rounded up to
/// whole groups; A z stands in it behind 2·stride afterwards.
pub fn kkt_residual(qp: &Qp<'_>, z: &[f64], y: &[f64], scratch: &mut [f64]) -> KktResidual {
    let (n, stride) = (qp.variables, qp.stride);
    let (curvature, rest) = scratch.split_at_mut(stride);
    let (pushed, values) = rest.split_at_mut(stride);
    pushed.fill(0.0);
    qp.rows.add_transposed(y, pushed);
    write_product(qp, z, curvature);
    let (mut worst, mut scale, mut finite) = (0.0_f64, 1.0_f64, true);
    for i in 0..n {
        let sum = curvature[i] + qp.gradient[i] + pushed[i];
        // f64::max forgets NaN.
        finite &= sum.is_finite();
        worst = worst.max(sum.abs());
        scale = scale.max(curvature[i].abs()).max(qp.gradient[i].abs()).max(pushed[i].abs());
    }
    // Beyond the rows nothing is bounded, but a number it has to be.
    let values = &mut values[..padded(qp.row_count)];
    fill_last_group(values, 0.0);
    qp.rows.values(z, values);
    let bounds = groups(qp.lower).iter().zip(groups(qp.upper)).zip(groups(qp.weight));
    let (mut violation, mut numbers) = (f64x4::ZERO, f64x4::splat(f64::from_bits(u64::MAX)));
    for (value, ((lower, upper), weight)) in groups(values).iter().zip(bounds) {
        let value = f64x4::new(*value);
        let outside = (value - f64x4::new(*upper)).max(f64x4::new(*lower) - value) * f64x4::new(*weight);
        numbers &= outside.simd_eq(outside);
        violation = violation.max(outside);
    }
    finite &= numbers.all();
    let violation = violation.to_array().into_iter().fold(0.0, f64::max);
    let mut product = 0.0_f64;
    for (row, multiplier) in pushing(&y[..qp.row_count]) {
        let slack = pushed_slack(values[row], qp.lower[row], qp.upper[row], multiplier);
        product = product.max((multiplier * slack).abs());
    }
    let stationarity = if finite { worst / scale } else { f64::NAN };
    KktResidual { stationarity, violation, complementarity: product / scale }
}

/// What a certificate of infeasibility proves: any z with |z_i| ≤ `reach` that meets all other rows
/// violates one that `may_give` by at least this much, in that row's unit; `None` when it proves
/// nothing.
///
/// For any z, Σ y_i (A z)_i ≤ Σ y⁺ (upper + t_i) − Σ y⁻ (lower − t_i), so with t_i = t on rows that
/// may give and 0 on others t ≥ (−Σ y⁺ upper + Σ y⁻ lower − ‖Aᵀy‖₁ reach) / Σ |y| of rows that may
/// give. `scratch` is at least stride long.
pub fn certificate_gap(
    qp: &Qp<'_>,
    y: &[f64],
    reach: f64,
    may_give: &dyn Fn(usize) -> bool,
    scratch: &mut [f64],
) -> Option<f64> {
    let (mut gap, mut giving) = (0.0, 0.0);
    for (row, multiplier) in pushing(&y[..qp.row_count]) {
        gap -= multiplier * if multiplier > 0.0 { qp.upper[row] } else { qp.lower[row] };
        if may_give(row) {
            giving += multiplier.abs();
        }
    }
    let residual = &mut scratch[..qp.stride];
    residual.fill(0.0);
    qp.rows.add_transposed(y, residual);
    gap -= residual.iter().map(|residual| residual.abs() * reach).sum::<f64>();
    let least = gap / giving;
    (least > 0.0 && least.is_finite()).then_some(least)
}

#[cfg(test)]
mod tests {
    use super::super::Rows;
    use super::*;

    struct NoRows;

    impl Rows for NoRows {
        fn values(&self, _: &[f64], _: &mut [f64]) {}
        fn coefficients(&self, _: usize, out: &mut [f64]) -> usize {
            out.len()
        }
        fn add_transposed(&self, _: &[f64], _: &mut [f64]) {}
    }

    const MOST: usize = 9;
    const STRIDE: usize = padded(MOST);

    /// Of H z + g with H the first n×n of the matrix, which is NaN elsewhere.
    fn stationarity(n: usize, upper: impl Fn(usize, usize) -> f64, z: &[f64], gradient: &[f64]) -> f64 {
        let stride = padded(n);
        let mut hessian = [f64::NAN; MOST * STRIDE];
        for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
            hessian[i * stride + j] = upper(i, j);
        }
        let qp = Qp {
            variables: n,
            stride,
            hessian: &hessian[..n * stride],
            gradient: &gradient[..stride],
            rows: &NoRows,
            row_count: 0,
            lower: &[],
            upper: &[],
            weight: &[],
        };
        kkt_residual(&qp, &z[..stride], &[], &mut [0.0; 3 * STRIDE]).stationarity
    }

    #[test]
    fn the_product_takes_the_upper_triangle_and_nothing_else() {
        let upper = |i: usize, j: usize| 1.0 / (1 + i + 2 * j) as f64;
        for n in 1..=MOST {
            // Beyond the variables z is anything, too.
            let z: [f64; STRIDE] = core::array::from_fn(|i| if i < n { 1.0 - 0.3 * i as f64 } else { f64::NAN });
            let mut gradient = [0.0; STRIDE];
            for i in 0..n {
                gradient[i] = -(0..n).map(|j| upper(i.min(j), i.max(j)) * z[j]).sum::<f64>();
            }
            let residual = stationarity(n, upper, &z, &gradient);
            assert!(residual < 1e-14, "{n} variables: {residual:e}");
            for (row, column) in (0..n).flat_map(|row| (row..n).map(move |column| (row, column))) {
                let other = |value: f64| {
                    let upper = |i, j| if (i, j) == (row, column) { value } else { upper(i, j) };
                    stationarity(n, upper, &z, &gradient)
                };
                assert!(other(f64::NAN).is_nan(), "{n} variables: NaN at {row}, {column} is not seen");
                assert!(other(upper(row, column) + 1.0) > 0.01, "{n} variables: {row}, {column} is not read");
            }
        }
    }
}
