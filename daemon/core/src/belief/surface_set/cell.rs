//! A cell of contact depths, [c_j, c_j+1], and every stiffness: with weights a, b ≥ 0 of its two
//! nodes the stiffness is k = a + b, the contact depth (a c_j + b c_j+1) / k, and the force that f̂
//! should show a φ_j + b φ_j+1. So what fits the samples is a linear least squares in two numbers,
//! and the surfaces that fit well enough are an ellipse cut with the trapezoid
//! a, b ≥ 0, k_min ≤ a + b ≤ k_max.

/// Part of the product of two sums of squares below which their determinant is rounding.
const SINGULAR: f64 = 1e-12;

/// What stiffness may be, N/m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    /// k_min.
    pub least: f64,
    /// k_max.
    pub most: f64,
}

/// The sums of a cell. Costs are relative to that of no contact, Σ w f².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    /// c_j ≤ c_j+1 in m.
    pub depth: [f64; 2],
    /// Σ w φ_j², Σ w φ_j φ_j+1, Σ w φ_j+1².
    pub squares: [f64; 3],
    /// Σ w φ_j f, Σ w φ_j+1 f.
    pub products: [f64; 2],
}

/// Weights of the two nodes, N/m.
pub(super) type Weights = [f64; 2];

/// The best surface of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Best {
    /// Its cost, relative to no contact.
    pub cost: f64,
    /// Its weights.
    pub weights: Weights,
}

/// Contact depth and stiffness of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spring {
    /// Contact depth in m.
    pub depth: f64,
    /// k in N/m.
    pub stiffness: f64,
}

impl Cell {
    /// The cost of a surface, relative to no contact.
    pub(super) fn cost(&self, [a, b]: Weights) -> f64 {
        let ([aa, ab, bb], [ra, rb]) = (self.squares, self.products);
        a * (a * aa + 2.0 * b * ab - 2.0 * ra) + b * (b * bb - 2.0 * rb)
    }

    /// The surface of these weights.
    pub(super) fn spring(&self, [a, b]: Weights) -> Spring {
        let stiffness = a + b;
        Spring { depth: self.depth[0] + b / stiffness * (self.depth[1] - self.depth[0]), stiffness }
    }

    /// The cheapest surface, whatever it is; `None` where the samples don't tell two from one.
    fn centre(&self) -> Option<Weights> {
        let ([aa, ab, bb], [ra, rb]) = (self.squares, self.products);
        let determinant = aa * bb - ab * ab;
        (determinant > SINGULAR * aa * bb)
            .then(|| [(bb * ra - ab * rb) / determinant, (aa * rb - ab * ra) / determinant])
    }

    /// N⁻¹ g, for the normal matrix N of the least squares; `None` where it has no inverse.
    fn inverse_times(&self, [ga, gb]: [f64; 2]) -> Option<[f64; 2]> {
        let [aa, ab, bb] = self.squares;
        let determinant = aa * bb - ab * ab;
        (determinant > SINGULAR * aa * bb)
            .then(|| [(bb * ga - ab * gb) / determinant, (aa * gb - ab * ga) / determinant])
    }

    /// The cheapest surface within the range.
    pub(super) fn best(&self, range: &Range) -> Best {
        if let Some(weights) = self.centre().filter(|weights| range.holds(*weights)) {
            return Best { cost: self.cost(weights), weights };
        }
        let mut best: Option<Best> = None;
        for (from, to) in range.edges() {
            let (constant, slope, curvature) = self.along(from, to);
            let t = if curvature > 0.0 { (-0.5 * slope / curvature).clamp(0.0, 1.0) } else { 0.0 };
            let cost = constant + t * (slope + t * curvature);
            if best.is_none_or(|best| cost < best.cost) {
                best = Some(Best { cost, weights: between(from, to, t) });
            }
        }
        best.unwrap_or(Best { cost: 0.0, weights: [range.least, 0.0] })
    }

    /// The cost along an edge: c₀ + c₁ t + c₂ t², t from 0 to 1.
    fn along(&self, from: Weights, to: Weights) -> (f64, f64, f64) {
        let ([aa, ab, bb], [ra, rb]) = (self.squares, self.products);
        let (da, db) = (to[0] - from[0], to[1] - from[1]);
        let slope = 2.0 * (da * (from[0] * aa + from[1] * ab - ra) + db * (from[0] * ab + from[1] * bb - rb));
        (self.cost(from), slope, da * da * aa + 2.0 * da * db * ab + db * db * bb)
    }

    /// Calls `seen` with every surface on the edges of the range at which those that cost at most
    /// `level` begin or end.
    fn ends(&self, level: f64, range: &Range, seen: &mut dyn FnMut(Weights)) {
        for (from, to) in range.edges() {
            let (constant, slope, curvature) = self.along(from, to);
            let excess = constant - level;
            let square = slope * slope - 4.0 * curvature * excess;
            if square < 0.0 || curvature <= 0.0 {
                if excess <= 0.0 {
                    seen(from);
                    seen(to);
                }
                continue;
            }
            let root = libm::sqrt(square);
            let (first, last) = ((-slope - root) / (2.0 * curvature), (-slope + root) / (2.0 * curvature));
            if last >= 0.0 && first <= 1.0 {
                seen(between(from, to, first.max(0.0)));
                seen(between(from, to, last.min(1.0)));
            }
        }
    }

    /// The least and the greatest depth at which a surface that costs at most `level` presses with
    /// `force` (N); `None` where no surface does.
    pub(super) fn depths_of(&self, force: f64, level: f64, range: &Range) -> Option<(f64, f64)> {
        let (start, length) = (self.depth[0], self.depth[1] - self.depth[0]);
        let mut found: Option<(f64, f64)> = None;
        let mut see = |[a, b]: Weights| {
            let depth = start + (force + b * length) / (a + b);
            found = Some(found.map_or((depth, depth), |(least, most)| (least.min(depth), most.max(depth))));
        };
        self.ends(level, range, &mut see);
        // Where the force at depth y, a y + b (y − length), of the ellipse's surfaces has `force`
        // as its extreme: (force − centre's)² = left · gᵀ N⁻¹ g with g = (y, y − length).
        if let Some(centre) = self.centre() {
            let left = level - self.cost(centre);
            let [aa, ab, bb] = self.squares;
            let determinant = aa * bb - ab * ab;
            let (stiffness, at_start) = (centre[0] + centre[1], -centre[1] * length);
            // gᵀ N⁻¹ g = p y² + q y + r.
            let p = (bb - 2.0 * ab + aa) / determinant;
            let q = -2.0 * length * (aa - ab) / determinant;
            let r = length * length * aa / determinant;
            let (missing, by) = (force - at_start, left.max(0.0));
            let (c2, c1, c0) =
                (stiffness * stiffness - by * p, -2.0 * stiffness * missing - by * q, missing * missing - by * r);
            for y in roots(c2, c1, c0).into_iter().flatten() {
                if let Some(weights) = self.extreme(centre, [y, y - length], left, missing - stiffness * y)
                    && range.holds(weights)
                {
                    see(weights);
                }
            }
        }
        found
    }

    /// The greatest force in N at `depth` of a surface that costs at most `level`; `None` where no
    /// surface does.
    pub(super) fn strongest(&self, depth: f64, level: f64, range: &Range) -> Option<f64> {
        let gradient = [depth - self.depth[0], depth - self.depth[1]];
        let mut most: Option<f64> = None;
        let mut see = |[a, b]: Weights| {
            let force = a * gradient[0] + b * gradient[1];
            most = Some(most.map_or(force, |most| most.max(force)));
        };
        self.ends(level, range, &mut see);
        if let Some(centre) = self.centre()
            && let Some(weights) = self.extreme(centre, gradient, level - self.cost(centre), 1.0)
            && range.holds(weights)
        {
            see(weights);
        }
        most
    }

    /// Where on the ellipse that costs `left` more than its centre a linear function with this
    /// gradient is greatest, or with a negative `side` least.
    fn extreme(&self, centre: Weights, gradient: [f64; 2], left: f64, side: f64) -> Option<Weights> {
        let [da, db] = self.inverse_times(gradient)?;
        let width = da * gradient[0] + db * gradient[1];
        if left < 0.0 || width <= 0.0 {
            return None;
        }
        let by = libm::copysign(libm::sqrt(left / width), side);
        Some([centre[0] + by * da, centre[1] + by * db])
    }

    /// Variance of the force at `depth`, in N² for a scale of one, as the samples leave it.
    pub(super) fn force_variance(&self, depth: f64) -> Option<f64> {
        let gradient = [depth - self.depth[0], depth - self.depth[1]];
        let [da, db] = self.inverse_times(gradient)?;
        Some(da * gradient[0] + db * gradient[1])
    }
}

impl Range {
    /// Whether the surface of these weights is one of a cell, within the range.
    pub(super) fn holds(&self, [a, b]: Weights) -> bool {
        a >= 0.0 && b >= 0.0 && (self.least..=self.most).contains(&(a + b))
    }

    /// The edges of the trapezoid.
    fn edges(&self) -> [(Weights, Weights); 4] {
        let corners = [[self.least, 0.0], [self.most, 0.0], [0.0, self.most], [0.0, self.least]];
        [(corners[0], corners[1]), (corners[1], corners[2]), (corners[2], corners[3]), (corners[3], corners[0])]
    }
}

fn between(from: Weights, to: Weights, t: f64) -> Weights {
    [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])]
}

/// The real roots of c₂ x² + c₁ x + c₀.
pub(super) fn roots(c2: f64, c1: f64, c0: f64) -> [Option<f64>; 2] {
    let square = c1 * c1 - 4.0 * c2 * c0;
    if square < 0.0 || (c1 == 0.0 && c2 == 0.0) {
        return [None; 2];
    }
    // Without cancellation.
    let q = -0.5 * (c1 + libm::copysign(libm::sqrt(square), c1));
    [(c2 != 0.0).then(|| q / c2), (q != 0.0).then(|| c0 / q)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const RANGE: Range = Range { least: 1e4, most: 5e5 };

    /// Sums of made-up samples of a surface of 8e4 N/m at 0.3 of the cell, with errors.
    fn cell(noise: f64) -> Cell {
        let mut cell = Cell { depth: [0.010, 0.0102], squares: [0.0; 3], products: [0.0; 2] };
        let mut state = 7_u64;
        for sample in 0..12 {
            let x = 0.0103 + 0.0002 * f64::from(sample);
            let phi = [0.4 * (x - 0.010), 0.38 * (x - 0.0102)];
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let error = noise * ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5);
            let f = 8e4 * (0.7 * phi[0] + 0.3 * phi[1]) + error;
            let w = 1.0 / 0.26;
            cell.squares[0] += w * phi[0] * phi[0];
            cell.squares[1] += w * phi[0] * phi[1];
            cell.squares[2] += w * phi[1] * phi[1];
            cell.products[0] += w * phi[0] * f;
            cell.products[1] += w * phi[1] * f;
        }
        cell
    }

    /// Every surface of a fine grid: stiffness and share of the way through the cell.
    fn grid(range: &Range) -> impl Iterator<Item = Weights> {
        let (least, ratio) = (range.least, range.most / range.least);
        (0..=3000).flat_map(move |i| {
            let k = least * libm::pow(ratio, f64::from(i) / 3000.0);
            (0..=600).map(move |j| {
                let share = f64::from(j) / 600.0;
                [k * (1.0 - share), k * share]
            })
        })
    }

    #[test]
    fn the_best_surface_is_that_of_a_grid() {
        for (noise, range) in
            [(0.0, RANGE), (6.0, RANGE), (6.0, Range { least: 1e5, most: 5e5 }), (6.0, Range { least: 1e4, most: 5e4 })]
        {
            let cell = cell(noise);
            let best = cell.best(&range);
            let by_grid = grid(&range).map(|weights| cell.cost(weights)).fold(f64::INFINITY, f64::min);
            assert!(range.holds(best.weights) || (best.weights[0] + best.weights[1] - range.most).abs() < 1e-6);
            assert!(best.cost <= by_grid + 1e-9 * by_grid.abs(), "{best:?} {by_grid}");
            assert!(best.cost > by_grid - 0.02 * by_grid.abs().max(1.0), "{best:?} {by_grid}");
        }
        let exact = cell(0.0);
        let spring = exact.spring(exact.best(&RANGE).weights);
        assert!((spring.stiffness - 8e4).abs() < 1e-3 && (spring.depth - 0.01006).abs() < 1e-9, "{spring:?}");
    }

    #[test]
    fn depths_and_forces_of_a_set_are_those_of_a_grid() {
        for (noise, range, z) in [
            (6.0, RANGE, 1.0),
            (6.0, RANGE, 3.0),
            (20.0, RANGE, 6.0),
            (6.0, Range { least: 1e4, most: 7.9e4 }, 3.0),
            (6.0, Range { least: 8.1e4, most: 5e5 }, 4.0),
        ] {
            let cell = cell(noise);
            let level = cell.best(&range).cost + z * z;
            let (force, depth) = (200.0, 0.0125);
            let (mut least, mut most, mut strongest) = (f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY);
            for [a, b] in grid(&range).filter(|weights| cell.cost(*weights) <= level) {
                let reached = (force + a * cell.depth[0] + b * cell.depth[1]) / (a + b);
                (least, most) = (f64::min(least, reached), f64::max(most, reached));
                strongest = f64::max(strongest, a * (depth - cell.depth[0]) + b * (depth - cell.depth[1]));
            }
            let found = cell.depths_of(force, level, &range).unwrap();
            assert!((found.0 - least).abs() < 1e-5 && found.0 <= least + 1e-9, "{found:?} {least}");
            assert!((found.1 - most).abs() < 1e-5 && found.1 >= most - 1e-9, "{found:?} {most}");
            let force = cell.strongest(depth, level, &range).unwrap();
            assert!(force >= strongest - 1e-6 && force < strongest + 0.7, "{force} {strongest}");
        }
        let cell = cell(6.0);
        assert_eq!(cell.depths_of(200.0, cell.best(&RANGE).cost - 1.0, &RANGE), None);
    }
}
