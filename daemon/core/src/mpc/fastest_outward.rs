//! The joint velocities that lead out of the surface fastest, of those that offsets can ask for.
//!
//! It is a linear programme: the largest nᵀΔṗ of offsets on the axes that give way within their limits,
//! with every joint of J⁻¹(ṗ0 + Δṗ) within its own. It is climbed face by face: from Δṗ = 0 along the
//! part of n that the limits met so far leave, to the next limit; one that holds the climb back no
//! more, its multiplier being negative, is left again (Rosen, "The gradient projection method", J. SIAM
//! 8, 1960). A climb that is not over when its steps are keeps the limits all the same.

use nalgebra::{SMatrix, SVector};

use super::{Settings, Situation};

/// Offsets and joint velocities are those that were meant within this, m/s and rad/s.
const SAME: f64 = 1e-9;
/// What is left of n, or of a limit's row, beside others: rounding.
const NOTHING: f64 = 1e-9;
/// Steps of a climb: every limit of six joints and six axes met and half of them left again.
const STEPS: usize = 18;

/// The joint velocities in rad/s (m/s where a joint slides).
pub(super) fn outward<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
) -> SVector<f64, N> {
    let (limits, sample) = (&settings.limits, situation.sample);
    let normal = &situation.belief.surface().normal;
    let jacobian = sample.posture.jacobian();
    // Every joint at its limit, where offsets can ask for it: of a redundant arm a twist asks for some
    // joint velocities only.
    if let Some(speed) = &limits.joint_speed {
        let lever = jacobian.tr_mul(normal);
        let fastest = lever.zip_map(speed, |lever, speed| libm::copysign(speed, lever));
        let twist = jacobian * fastest;
        let offset = twist - sample.twist_reference;
        let allowed = |axis: usize| if settings.admittance[axis] { limits.offset[axis] } else { SAME };
        if (0..D).all(|axis| offset[axis].abs() <= allowed(axis))
            && (situation.told_with(&twist) - fastest).amax() <= SAME
        {
            return fastest;
        }
    }
    let of_admittance =
        |from: &SVector<f64, D>| SVector::from_fn(|axis, _| if settings.admittance[axis] { from[axis] } else { 0.0 });
    let bounds = Bounds {
        jacobian_inverse: &situation.model.jacobian_inverse,
        speed: &limits.joint_speed,
        offset: &limits.offset,
    };
    bounds.climb(situation.told_with(&sample.twist_reference), &of_admittance(normal), of_admittance)
}

/// A limit that is met: of a joint, or of the offset on an axis. Upper is its positive end.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Limit {
    of: usize,
    is_joint: bool,
    is_upper: bool,
}

/// Of joint velocities and offsets.
struct Bounds<'a, const N: usize, const D: usize> {
    jacobian_inverse: &'a SMatrix<f64, N, D>,
    speed: &'a Option<SVector<f64, N>>,
    offset: &'a SVector<f64, D>,
}

impl<const N: usize, const D: usize> Bounds<'_, N, D> {
    /// The joint velocities under the offset that goes farthest `along` a vector, from those without an offset on;
    /// `gives` takes from a vector what it has on axes that have no offset.
    fn climb(
        &self,
        mut velocity: SVector<f64, N>,
        along: &SVector<f64, D>,
        gives: impl Fn(&SVector<f64, D>) -> SVector<f64, D>,
    ) -> SVector<f64, N> {
        let (mut offset, mut met) = (SVector::zeros(), Met::none());
        for _ in 0..STEPS {
            let direction = met.beside(along);
            if direction.norm() <= NOTHING {
                if met.leave(along) {
                    continue;
                }
                break;
            }
            let by_offset = self.jacobian_inverse * direction;
            let Some((way, limit)) = self.next((&offset, &direction), (&velocity, &by_offset), &met) else { break };
            offset += direction * way;
            velocity += by_offset * way;
            met.push(limit, gives(&self.row(&limit)));
        }
        velocity
    }

    /// How far it is to the next limit, and which that is; of offset and joint velocities with their rates.
    fn next(
        &self,
        (offset, direction): (&SVector<f64, D>, &SVector<f64, D>),
        (velocity, by_offset): (&SVector<f64, N>, &SVector<f64, N>),
        met: &Met<D>,
    ) -> Option<(f64, Limit)> {
        let way = |limit: f64, value: f64, rate: f64| {
            ((limit - libm::copysign(1.0, rate) * value) / rate.abs().max(f64::MIN_POSITIVE)).max(0.0)
        };
        let of_offset = (0..D).map(|axis| {
            let limit = Limit { of: axis, is_joint: false, is_upper: direction[axis] > 0.0 };
            (way(self.offset[axis], offset[axis], direction[axis]), direction[axis], limit)
        });
        let of_joints = self.speed.iter().flat_map(|speed| {
            (0..N).map(|joint| {
                let limit = Limit { of: joint, is_joint: true, is_upper: by_offset[joint] > 0.0 };
                (way(speed[joint], velocity[joint], by_offset[joint]), by_offset[joint], limit)
            })
        });
        let limits = of_offset.chain(of_joints).filter(|(_, rate, limit)| rate.abs() > NOTHING && !met.has(limit));
        limits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(way, _, limit)| (way, limit))
    }

    /// How the value that a limit bounds grows with the offset, outward as the limit has it.
    fn row(&self, limit: &Limit) -> SVector<f64, D> {
        let sign = if limit.is_upper { 1.0 } else { -1.0 };
        if limit.is_joint {
            self.jacobian_inverse.row(limit.of).transpose() * sign
        } else {
            SVector::from_fn(|axis, _| if axis == limit.of { sign } else { 0.0 })
        }
    }
}

/// The limits that are met, and their rows A = R Qᵀ: what of n is along them holds the climb back.
struct Met<const D: usize> {
    limits: [Option<Limit>; D],
    rows: [SVector<f64, D>; D],
    /// Orthonormal, in columns.
    q: SMatrix<f64, D, D>,
    /// Lower triangular.
    r: SMatrix<f64, D, D>,
    len: usize,
}

impl<const D: usize> Met<D> {
    fn none() -> Self {
        Self { limits: [None; D], rows: [SVector::zeros(); D], q: SMatrix::zeros(), r: SMatrix::zeros(), len: 0 }
    }

    fn has(&self, limit: &Limit) -> bool {
        self.limits[..self.len].contains(&Some(*limit))
    }

    /// What of a vector is beside the rows.
    fn beside(&self, vector: &SVector<f64, D>) -> SVector<f64, D> {
        let mut rest = *vector;
        // Twice: what rounding leaves the first time is gone.
        for _ in 0..2 {
            for column in 0..self.len {
                let along = self.q.column(column);
                rest -= along * along.dot(&rest);
            }
        }
        rest
    }

    /// Takes in a limit, unless it is one with those that there are.
    fn push(&mut self, limit: Limit, row: SVector<f64, D>) {
        let rest = self.beside(&row);
        let length = rest.norm();
        if self.len == D || length <= NOTHING * row.norm() {
            return;
        }
        let place = self.len;
        for column in 0..place {
            self.r[(place, column)] = self.q.column(column).dot(&row);
        }
        self.r[(place, place)] = length;
        self.q.set_column(place, &(rest / length));
        (self.limits[place], self.rows[place]) = (Some(limit), row);
        self.len += 1;
    }

    /// Leaves the limit that holds back a climb along `vector` least, if there is one that does not at all:
    /// of vector = Σ λ row the least λ is below zero.
    fn leave(&mut self, vector: &SVector<f64, D>) -> bool {
        let mut multipliers = [0.0; D];
        for place in (0..self.len).rev() {
            let beyond: f64 = (place + 1..self.len).map(|later| self.r[(later, place)] * multipliers[later]).sum();
            multipliers[place] = (self.q.column(place).dot(vector) - beyond) / self.r[(place, place)];
        }
        let pull = |place: usize| multipliers[place] * self.rows[place].norm();
        let Some(least) = (0..self.len).min_by(|a, b| pull(*a).total_cmp(&pull(*b))) else { return false };
        if pull(least) >= -NOTHING {
            return false;
        }
        let (limits, rows, len) = (self.limits, self.rows, self.len);
        *self = Self::none();
        for place in (0..len).filter(|place| *place != least) {
            if let Some(limit) = limits[place] {
                self.push(limit, rows[place]);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Matrix4x3, Vector3, Vector4};

    use super::*;

    /// Evenly from −1 to 1, a new one each time (Numerical Recipes, "quick and dirty").
    fn numbers(mut seed: u32) -> impl FnMut() -> f64 {
        move || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed) / f64::from(u32::MAX) * 2.0 - 1.0
        }
    }

    /// The largest value at a corner: every three limits that meet somewhere within all the others.
    fn best_corner(
        inverse: &Matrix4x3<f64>,
        start: &Vector4<f64>,
        speed: f64,
        offset: f64,
        along: &Vector3<f64>,
    ) -> f64 {
        let mut limits: Vec<(Vector3<f64>, f64)> = Vec::new();
        for sign in [1.0, -1.0] {
            limits.extend((0..4).map(|joint| (inverse.row(joint).transpose() * sign, speed - sign * start[joint])));
            limits.extend((0..3).map(|axis| (Vector3::ith(axis, sign), offset)));
        }
        let mut best = f64::NEG_INFINITY;
        for (a, b, c) in (0..14).flat_map(|a| (a + 1..14).flat_map(move |b| (b + 1..14).map(move |c| (a, b, c)))) {
            let rows = Matrix3::from_rows(&[a, b, c].map(|limit: usize| limits[limit].0.transpose()));
            let Some(solved) = rows.try_inverse() else { continue };
            let corner = solved * Vector3::new(limits[a].1, limits[b].1, limits[c].1);
            if limits.iter().all(|(row, most)| row.dot(&corner) <= most + 1e-9) {
                best = best.max(along.dot(&corner));
            }
        }
        best
    }

    #[test]
    fn the_climb_ends_at_the_best_corner() {
        let mut number = numbers(7);
        for case in 0..2000 {
            let inverse = Matrix4x3::from_fn(|_, _| number());
            let start = Vector4::from_fn(|_, _| 0.9 * number());
            let along = Vector3::from_fn(|_, _| number());
            let offset = 3.0 * (number() + 1.1);
            let bounds = Bounds {
                jacobian_inverse: &inverse,
                speed: &Some(Vector4::repeat(1.0)),
                offset: &Vector3::repeat(offset),
            };
            let velocity = bounds.climb(start, &along, |row| *row);
            assert!(velocity.amax() <= 1.0 + 1e-9, "case {case}: {velocity}");
            // Of the joint velocities the offset that made them.
            let made =
                (inverse.transpose() * inverse).try_inverse().unwrap() * inverse.transpose() * (velocity - start);
            assert!(made.amax() <= offset + 1e-6, "case {case}: {made}");
            let (found, best) = (along.dot(&made), best_corner(&inverse, &start, 1.0, offset, &along));
            assert!((found - best).abs() < 1e-6 * best.abs().max(1.0), "case {case}: {found}, best {best}");
        }
    }

    #[test]
    fn an_axis_that_does_not_give_way_has_no_offset() {
        let inverse = Matrix4x3::new(1.0, 0.2, -0.3, 0.1, 0.8, 0.4, -0.5, 0.3, 0.9, 0.2, -0.6, 0.1);
        let gives = |row: &Vector3<f64>| Vector3::new(row.x, 0.0, row.z);
        let bounds =
            Bounds { jacobian_inverse: &inverse, speed: &Some(Vector4::repeat(1.0)), offset: &Vector3::repeat(100.0) };
        let velocity = bounds.climb(Vector4::zeros(), &gives(&Vector3::new(0.6, 0.5, 0.3)), gives);
        let made = (inverse.transpose() * inverse).try_inverse().unwrap() * inverse.transpose() * velocity;
        assert!(made.y.abs() < 1e-9 && (velocity.amax() - 1.0).abs() < 1e-9, "{made} {velocity}");
    }
}
