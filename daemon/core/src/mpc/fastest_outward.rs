//! The joint velocities that lead out of the surface fastest, of those that offsets can ask for.
//!
//! It is a linear programme: the largest nᵀΔṗ of offsets on the axes that give way within their limits,
//! with every joint of J⁻¹(ṗ0 + Δṗ) within its own. It is climbed face by face: from Δṗ = 0 along the
//! part of n that the limits met so far leave, to the next limit; one that holds the climb back no
//! more, its multiplier being negative, is left again (Rosen, "The gradient projection method", J. SIAM
//! 8, 1960). A climb that is not over when its steps are has come less far.

use nalgebra::{SMatrix, SVector};

use super::{Settings, Situation};

/// Offsets and joint velocities are those that were meant within this, m/s and rad/s.
const SAME: f64 = 1e-9;
/// What is left of n, or of a limit's row, beside others: rounding.
const NOTHING: f64 = 1e-9;
/// Steps of a climb, for each joint and each axis.
const STEPS: usize = 4;

/// Ways out, as joint velocities in rad/s (m/s where a joint slides).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WaysOut<const N: usize> {
    /// Along the normal, as far as all limits allow.
    pub along: SVector<f64, N>,
    /// The fastest.
    pub fastest: SVector<f64, N>,
}

/// The fastest way out.
pub(super) fn outward<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
) -> SVector<f64, N> {
    ways_out(settings, situation).fastest
}

/// Both. (The fastest in the end is not always the one on which the tool gets least deep: joints that are slower to
/// follow may be those that lead out.)
pub(super) fn ways_out<const N: usize, const D: usize>(
    settings: &Settings<N, D>,
    situation: &Situation<'_, N, D>,
) -> WaysOut<N> {
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
            return WaysOut { along: fastest, fastest };
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
    /// `gives` takes from a vector what it has on axes that have no offset. A joint of which ṗ0 asks for too much is
    /// taken back first, the worst before the others.
    fn climb(
        &self,
        velocity: SVector<f64, N>,
        along: &SVector<f64, D>,
        gives: impl Fn(&SVector<f64, D>) -> SVector<f64, D>,
    ) -> WaysOut<N> {
        let mut at = (velocity, SVector::zeros());
        for _ in 0..N {
            let Some((most, limit)) = self.worst_exceeded(&at.0) else { break };
            (_, at) = self.go(at, &-gives(&self.row(&limit)), most, &gives);
        }
        let (along, (fastest, _)) = self.go(at, along, f64::INFINITY, &gives);
        WaysOut { along, fastest }
    }

    /// The joint limit that is exceeded most, and by how much; `None` where all are kept.
    fn worst_exceeded(&self, velocity: &SVector<f64, N>) -> Option<(f64, Limit)> {
        let excess = velocity.abs() - self.speed.as_ref()?;
        let worst = excess.imax();
        let limit = Limit { of: worst, is_joint: true, is_upper: velocity[worst] > 0.0 };
        (excess[worst] > SAME).then_some((excess[worst], limit))
    }

    /// From joint velocities and the offset that makes them on to those that are farthest `along` a vector, by `most`
    /// at most; and the joint velocities at the first limit.
    fn go(
        &self,
        (mut velocity, mut offset): (SVector<f64, N>, SVector<f64, D>),
        along: &SVector<f64, D>,
        mut most: f64,
        gives: impl Fn(&SVector<f64, D>) -> SVector<f64, D>,
    ) -> (SVector<f64, N>, (SVector<f64, N>, SVector<f64, D>)) {
        let (mut first, mut met) = (None, Met::none());
        for _ in 0..STEPS * (N + D) {
            let direction = met.beside(along);
            if direction.norm() <= NOTHING {
                if met.leave(along) {
                    continue;
                }
                break;
            }
            let by_offset = self.jacobian_inverse * direction;
            let next = self.next((&offset, &direction), (&velocity, &by_offset), &met);
            let rest = most / along.dot(&direction);
            let way = next.map_or(rest, |(way, _)| way.min(rest));
            if way == f64::INFINITY {
                break;
            }
            offset += direction * way;
            velocity += by_offset * way;
            first = first.or(Some(velocity));
            match next {
                Some((_, limit)) if way < rest => {
                    most -= way * along.dot(&direction);
                    met.push(limit, gives(&self.row(&limit)));
                }
                _ => break,
            }
        }
        (first.unwrap_or(velocity), (velocity, offset))
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
        // Of rows that have all but nothing beside those that are met, rounding is all that is left.
        let least = NOTHING * direction.norm();
        let of_offset = (0..D).map(|axis| {
            let limit = Limit { of: axis, is_joint: false, is_upper: direction[axis] > 0.0 };
            let is_followed = direction[axis].abs() > least;
            (way(self.offset[axis], offset[axis], direction[axis]), is_followed, limit)
        });
        let of_joints = self.speed.iter().flat_map(|speed| {
            (0..N).map(|joint| {
                let limit = Limit { of: joint, is_joint: true, is_upper: by_offset[joint] > 0.0 };
                let is_followed = by_offset[joint].abs() > least * self.jacobian_inverse.row(joint).norm();
                (way(speed[joint], velocity[joint], by_offset[joint]), is_followed, limit)
            })
        });
        let limits = of_offset.chain(of_joints).filter(|(_, is_followed, limit)| *is_followed && !met.has(limit));
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
    fn best_corner(bounds: &Bounds<'_, 4, 3>, start: &Vector4<f64>, along: &Vector3<f64>) -> f64 {
        let mut limits: Vec<(Vector3<f64>, f64)> = Vec::new();
        for (sign, is_upper) in [(1.0, true), (-1.0, false)] {
            let row = |of, is_joint| bounds.row(&Limit { of, is_joint, is_upper });
            limits.extend((0..4).map(|joint| (row(joint, true), 1.0 - sign * start[joint])));
            limits.extend((0..3).map(|axis| (row(axis, false), bounds.offset[axis])));
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

    /// The offset that has made joint velocities what they are.
    fn offset_of(inverse: &Matrix4x3<f64>, velocity: &Vector4<f64>, start: &Vector4<f64>) -> Vector3<f64> {
        (inverse.transpose() * inverse).try_inverse().unwrap() * inverse.transpose() * (velocity - start)
    }

    #[test]
    fn the_climb_ends_at_the_best_corner() {
        let mut number = numbers(7);
        for case in 0..2000 {
            let inverse = Matrix4x3::from_fn(|_, _| number());
            let start = Vector4::from_fn(|_, _| 0.9 * number());
            // In one case of two an axis does not give way.
            let gives_y = case % 2 == 0;
            let gives = |row: &Vector3<f64>| Vector3::new(row.x, if gives_y { row.y } else { 0.0 }, row.z);
            let along = gives(&Vector3::from_fn(|_, _| number()));
            let offset = gives(&Vector3::repeat(3.0 * (number() + 1.1)));
            let bounds = Bounds { jacobian_inverse: &inverse, speed: &Some(Vector4::repeat(1.0)), offset: &offset };
            let WaysOut { along: first, fastest } = bounds.climb(start, &along, gives);
            assert!(fastest.amax() <= 1.0 + 1e-9, "case {case}: {fastest}");
            let [first, found] = [first, fastest].map(|velocity| offset_of(&inverse, &velocity, &start));
            assert!((0..3).all(|axis| found[axis].abs() <= offset[axis] + 1e-6), "case {case}: {found}");
            assert!(first.cross(&along).norm() < 1e-6 * first.norm().max(1.0), "case {case}: {first} {along}");
            let (value, best) = (along.dot(&found), best_corner(&bounds, &start, &along));
            assert!((value - best).abs() < 1e-6 * best.abs().max(1.0), "case {case}: {value}, best {best}");
        }
    }

    /// A joint that ṗ0 asks for too much of is taken back first.
    #[test]
    fn joints_end_within_their_limits_wherever_they_begin() {
        let (mut number, mut tried) = (numbers(11), 0);
        for case in 0..2000 {
            let inverse = Matrix4x3::from_fn(|_, _| number());
            let mut start = Vector4::from_fn(|_, _| 0.9 * number());
            start[case % 4] = 1.0 + 0.3 * (number() + 1.0);
            let along = Vector3::from_fn(|_, _| number());
            let bounds = Bounds {
                jacobian_inverse: &inverse,
                speed: &Some(Vector4::repeat(1.0)),
                offset: &Vector3::repeat(100.0),
            };
            if best_corner(&bounds, &start, &along) == f64::NEG_INFINITY {
                continue;
            }
            let fastest = bounds.climb(start, &along, |row| *row).fastest;
            assert!(fastest.amax() <= 1.0 + 1e-8, "case {case}: {fastest}");
            tried += 1;
        }
        assert!(tried > 1000, "{tried} of 2000 have a way back");
    }

    /// Eight joints and six axes: what the climb ends with no limit holds back, and so nothing is better.
    #[test]
    fn a_climb_of_the_largest_arm_is_over_in_time() {
        let mut number = numbers(3);
        for case in 0..500 {
            let inverse = SMatrix::<f64, 8, 6>::from_fn(|_, _| number());
            let start = SVector::<f64, 8>::from_fn(|_, _| 0.9 * number());
            let along = SVector::<f64, 6>::from_fn(|_, _| number());
            let bounds = Bounds {
                jacobian_inverse: &inverse,
                speed: &Some(SVector::repeat(1.0)),
                offset: &SVector::repeat(1e3),
            };
            let fastest = bounds.climb(start, &along, |row| *row).fastest;
            // Again from there: it goes nowhere.
            let again = bounds.climb(fastest, &along, |row| *row).fastest;
            assert!(fastest.amax() <= 1.0 + 1e-9 && (again - fastest).amax() < 1e-6, "case {case}");
        }
    }
}
