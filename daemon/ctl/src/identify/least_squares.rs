//! Least squares of a model with a few parameters (Levenberg and Marquardt), and how far its
//! parameters may be off when the residuals are neither independent nor of one size.

use nalgebra::{SMatrix, SVector};

const ITERATIONS: usize = 40;
/// A smaller relative fall of the sum of squares is far less than what noise makes of the parameters.
const CONVERGED: f64 = 1e-7;
/// A parameter whose variance others multiply by more than this cannot be told from them.
pub(super) const MOST_INFLATION: f64 = 1e6;

/// What is to be fitted.
pub(super) struct Problem<'a, const K: usize> {
    pub(super) start: [f64; K],
    /// By how much each parameter is moved to see what it does.
    pub(super) probe: [f64; K],
    /// Bounds.
    pub(super) least: [f64; K],
    pub(super) most: [f64; K],
    /// Residuals, divided by what they are expected to be.
    pub(super) residuals: &'a dyn Fn(&[f64; K]) -> Vec<f64>,
    /// The stretch of time that each residual is of: within one they may depend on each other.
    pub(super) blocks: &'a [usize],
}

/// What came of it.
#[derive(Debug, Clone)]
pub(super) struct Fit<const K: usize> {
    pub(super) values: [f64; K],
    /// Half of the 95 % interval of each.
    pub(super) half_width: [f64; K],
    /// By how much the others multiply a parameter's variance; infinite where it does nothing.
    pub(super) inflation: [f64; K],
    /// (JᵀJ)⁻¹.
    pub(super) inverse: SMatrix<f64, K, K>,
    pub(super) residuals: Vec<f64>,
    /// Residuals that would tell as much if they were independent.
    pub(super) effective: f64,
}

impl<const K: usize> Fit<K> {
    pub(super) fn mean_square(&self) -> f64 {
        mean_square(&self.residuals)
    }

    /// Akaike's criterion, of as many residuals as are worth counting.
    pub(super) fn akaike(&self, effective: f64) -> f64 {
        effective * self.mean_square().max(f64::MIN_POSITIVE).ln() + 2.0 * K as f64
    }
}

pub(super) fn mean_square(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64
}

impl<const K: usize> Problem<'_, K> {
    /// The best parameters near the start.
    pub(super) fn solve(&self) -> Fit<K> {
        let mut at = self.start;
        let mut residuals = (self.residuals)(&at);
        let mut jacobian = self.jacobian(&at);
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            let before = mean_square(&residuals);
            let (normal, slope) = (normal(&jacobian), project(&jacobian, &residuals));
            let mut has_improved = false;
            while damping < 1e8 {
                let next = self.next(&at, &normal, &slope, damping);
                let there = (self.residuals)(&next);
                if mean_square(&there) < before {
                    (at, residuals, damping, has_improved) = (next, there, damping * 0.2, true);
                    break;
                }
                damping *= 8.0;
            }
            if !has_improved {
                break;
            }
            jacobian = self.jacobian(&at);
            if before - mean_square(&residuals) < CONVERGED * before {
                break;
            }
        }
        self.judged(at, residuals, &jacobian)
    }

    fn next(&self, at: &[f64; K], normal: &SMatrix<f64, K, K>, slope: &SVector<f64, K>, damping: f64) -> [f64; K] {
        let mut damped = *normal;
        for k in 0..K {
            damped[(k, k)] += damping * normal[(k, k)] + f64::MIN_POSITIVE;
        }
        let way = damped.try_inverse().map_or_else(SVector::zeros, |inverse| inverse * slope);
        std::array::from_fn(|k| (at[k] - way[k]).clamp(self.least[k], self.most[k]))
    }

    /// Rows of J: what each parameter does to each residual.
    fn jacobian(&self, at: &[f64; K]) -> Vec<[f64; K]> {
        let mut rows = vec![[0.0; K]; self.blocks.len()];
        for k in 0..K {
            let moved = |by: f64| {
                let mut there = *at;
                there[k] = (at[k] + by).clamp(self.least[k], self.most[k]);
                (there[k], (self.residuals)(&there))
            };
            let ((low, below), (high, above)) = (moved(-self.probe[k]), moved(self.probe[k]));
            for ((row, above), below) in rows.iter_mut().zip(&above).zip(&below) {
                row[k] = (above - below) / (high - low);
            }
        }
        rows
    }

    /// The spread of the parameters: the larger of what correlated noise of one size makes, and of
    /// what the blocks show by disagreeing.
    fn judged(&self, values: [f64; K], residuals: Vec<f64>, jacobian: &[[f64; K]]) -> Fit<K> {
        let normal = normal(jacobian);
        let scale: SVector<f64, K> = SVector::from_fn(|k, _| normal[(k, k)].sqrt().max(f64::MIN_POSITIVE.sqrt()));
        let scaled: SMatrix<f64, K, K> =
            SMatrix::from_fn(|i, k| normal[(i, k)] / (scale[i] * scale[k]) + if i == k { 1e-13 } else { 0.0 });
        let unscaled = scaled.try_inverse().unwrap_or_else(|| SMatrix::<f64, K, K>::identity() * f64::INFINITY);
        let inverse: SMatrix<f64, K, K> = SMatrix::from_fn(|i, k| unscaled[(i, k)] / (scale[i] * scale[k]));
        let effective = residuals.len() as f64 / correlation_time(&residuals);
        let square = mean_square(&residuals) * residuals.len() as f64 / (effective - K as f64).max(1.0);
        let blocks = self.blocks.iter().max().map_or(0, |last| last + 1);
        let (mut pulls, mut told) =
            (vec![SVector::<f64, K>::zeros(); blocks], vec![SVector::<f64, K>::zeros(); blocks]);
        for ((row, residual), block) in jacobian.iter().zip(&residuals).zip(self.blocks) {
            let row = SVector::from(*row);
            pulls[*block] += row * *residual;
            told[*block] += row.component_mul(&row);
        }
        let pulls: SMatrix<f64, K, K> = pulls.iter().map(|pull| pull * pull.transpose()).sum();
        let by_blocks = inverse * pulls * inverse;
        let half_width = std::array::from_fn(|k| {
            // Blocks that tell nothing of a parameter do not count as witnesses.
            let (sum, squares) =
                told.iter().fold((0.0, 0.0), |(sum, squares), block| (sum + block[k], squares + block[k] * block[k]));
            let freedom = if squares > 0.0 { sum * sum / squares - 1.0 } else { 0.0 };
            let witnesses = by_blocks[(k, k)] * (freedom + 1.0) / freedom.max(0.5);
            let noise = square * inverse[(k, k)];
            student(freedom) * witnesses.max(0.0).sqrt().max(1.96 / student(freedom) * noise.max(0.0).sqrt())
        });
        let inflation = std::array::from_fn(|k| if normal[(k, k)] > 0.0 { unscaled[(k, k)] } else { f64::INFINITY });
        Fit { values, half_width, inflation, inverse, residuals, effective }
    }
}

fn normal<const K: usize>(jacobian: &[[f64; K]]) -> SMatrix<f64, K, K> {
    let mut normal = SMatrix::zeros();
    for row in jacobian {
        for i in 0..K {
            for k in 0..K {
                normal[(i, k)] += row[i] * row[k];
            }
        }
    }
    normal
}

fn project<const K: usize>(jacobian: &[[f64; K]], residuals: &[f64]) -> SVector<f64, K> {
    let mut sum = SVector::zeros();
    for (row, residual) in jacobian.iter().zip(residuals) {
        for k in 0..K {
            sum[k] += row[k] * residual;
        }
    }
    sum
}

/// How many residuals in a row say the same thing, on average; at least 1.
pub(super) fn correlation_time(residuals: &[f64]) -> f64 {
    const LONGEST: usize = 400;
    let square = mean_square(residuals);
    if square <= 0.0 {
        return 1.0;
    }
    let mut time = 1.0;
    for lag in 1..LONGEST.min(residuals.len()) {
        let products: f64 = residuals.iter().zip(&residuals[lag..]).map(|(a, b)| a * b).sum();
        let share = products / (residuals.len() as f64 * square);
        if share < 0.05 {
            break;
        }
        time += 2.0 * share;
    }
    time
}

/// The two-sided 95 % quantile of Student's distribution (Abramowitz and Stegun 26.7.5), which has
/// no use below two degrees of freedom here.
pub(super) fn student(freedom: f64) -> f64 {
    let freedom = freedom.max(2.0);
    1.95996 + 2.37227 / freedom + 2.82225 / freedom.powi(2) + 2.55585 / freedom.powi(3) + 1.58953 / freedom.powi(4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, expected) in [(2.0, 4.303), (3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (1e6, 1.960)] {
            assert!((student(freedom) / expected - 1.0).abs() < 0.01, "{freedom}: {}", student(freedom));
        }
    }

    /// A decay with noise that lasts; how many of 200 intervals hold the truth.
    #[test]
    fn intervals_hold_the_truth_although_noise_lasts() {
        let truth = [2.0, 0.3];
        let model = |at: &[f64; 2], t: f64| at[0] * (-t / at[1]).exp();
        let blocks: Vec<usize> = (0..1000).map(|sample| sample / 50).collect();
        let (mut held, mut state) = (0, 12345_u64);
        let mut draw = || {
            // The sum of twelve uniform numbers is nearly normal.
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                sum + (state >> 11) as f64 / (1_u64 << 53) as f64
            })
        };
        for _ in 0..200 {
            let mut noise = 0.0;
            let data: Vec<f64> = (0..1000)
                .map(|sample| {
                    noise = 0.9 * noise + 0.01 * draw();
                    model(&truth, f64::from(sample % 100) * 0.01) + noise
                })
                .collect();
            let residuals = |at: &[f64; 2]| -> Vec<f64> {
                (0..1000).zip(&data).map(|(sample, data)| model(at, f64::from(sample % 100) * 0.01) - data).collect()
            };
            let problem = Problem {
                start: [1.0, 0.5],
                probe: [1e-5; 2],
                least: [0.0, 0.01],
                most: [10.0; 2],
                residuals: &residuals,
                blocks: &blocks,
            };
            let fit = problem.solve();
            held += u32::from((fit.values[1] - truth[1]).abs() < fit.half_width[1]);
        }
        assert!((184..=200).contains(&held), "{held} of 200");
    }
}
