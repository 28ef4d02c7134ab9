//! Whether a step is short enough for an arm: its springs, its gears' dampers and its drives' gains
//! are not part of the step's matrix A (see `integration`), so that a step too long for them bursts.
//!
//! A swing of angular frequency ω without damping grows by ω (ωh)³ / 8 in a second of steps of length
//! h: those are the eigenvalues of a step on x″ = −ω² x, (1 − z²/2) ± iz with z = ωh.

use ipc_types::MAX_JOINTS;
use nalgebra::{Cholesky, Const, SMatrix, SVector};

use super::RigidBody;

/// Largest ωh: twelve steps in a period.
const MOST_ANGLE: f64 = 0.5;
/// Largest growth of a swing in 1/s: an e-fold in a second.
const MOST_GROWTH: f64 = 1.0;
/// Largest decay in a step, relative: the method bursts at 2, and drives a tick late as well.
const MOST_DECAY: f64 = 1.0;

/// What a step does not resolve.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unresolved {
    /// A gear swings too fast.
    #[error(
        "rigid_body.joint[{joint}].gear_stiffness_n_m_rad = {stiffness}: with the masses at its sides it swings at {frequency_hz:.0} \
         Hz, which steps of {step_s:e} s do not resolve: accepted: timing.substep_s of at most {accepted_step_s:.1e} s, or a \
         softer gear, or a damped one"
    )]
    Gear {
        /// Index of the joint, from 0.
        joint: usize,
        /// N m/rad.
        stiffness: f64,
        /// Of the swing, Hz.
        frequency_hz: f64,
        /// s.
        step_s: f64,
        /// s.
        accepted_step_s: f64,
    },
    /// The arm swings too fast on the surface, where the impact alone takes it; what the controller then
    /// presses deeper is not looked at.
    #[error(
        "surface.stiffness_n_m: as deep as an impact alone leads, {stiffness:.3e} N/m, the arm swings on it at {frequency_hz:.0} Hz, which steps of \
         {step_s:e} s do not resolve: accepted: timing.substep_s of at most {accepted_step_s:.1e} s, or a softer surface"
    )]
    Surface {
        /// N/m.
        stiffness: f64,
        /// Of the swing, Hz.
        frequency_hz: f64,
        /// s.
        step_s: f64,
        /// s.
        accepted_step_s: f64,
    },
    /// A gear's damper is too strong.
    #[error(
        "rigid_body.joint[{joint}].gear_damping_n_m_s_rad = {damping}: with the masses at its sides it is too strong for steps of \
         {step_s:e} s: accepted: timing.substep_s of at most {accepted_step_s:.1e} s, or at most {accepted:.3} N m s/rad"
    )]
    Damper {
        /// Index of the joint, from 0.
        joint: usize,
        /// N m s/rad.
        damping: f64,
        /// N m s/rad.
        accepted: f64,
        /// s.
        step_s: f64,
        /// s.
        accepted_step_s: f64,
    },
    /// A drive's gain is too high.
    #[error(
        "rigid_body.joint[{joint}].speed_gain_n_m_s_rad = {gain}: the drive undoes more than a speed error in a tick of \
         {tick_s:e} s, for what it moves is too light: accepted: at most {accepted:.3} N m s/rad, or a higher \
         rigid_body.drive.rate_hz, or a rotor_inertia_kg_m2 that the joint has"
    )]
    Gain {
        /// Index of the joint, from 0.
        joint: usize,
        /// N m s/rad.
        gain: f64,
        /// N m s/rad.
        accepted: f64,
        /// s.
        tick_s: f64,
    },
}

/// Coordinates of both sides of every gear, links first; those that an arm has not are never moved.
const SIDES: usize = 2 * MAX_JOINTS;
type Sides = SVector<f64, SIDES>;
type Masses = Cholesky<f64, Const<SIDES>>;

/// A surface as a spring at the TCP.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spring<const N: usize> {
    /// Speed along it by joint velocity, Jᵀ n in m.
    pub(crate) lever: SVector<f64, N>,
    /// N/m.
    pub(crate) stiffness: f64,
}

/// A spring or a damper between the coordinates: what it is, how strong, and along which of them.
struct Element {
    /// Index of the joint; `None` is the surface.
    joint: Option<usize>,
    strength: f64,
    along: Sides,
}

/// A motion that the elements bring about: its eigenvalue, and its shape with unit mass.
struct Mode {
    value: f64,
    shape: Sides,
}

impl<const N: usize> RigidBody<N> {
    /// Whether steps of at most `substep_s` seconds resolve the arm at a joint position in rad, in the
    /// air and on a surface.
    pub(crate) fn check_step(
        &self,
        position: &SVector<f64, N>,
        substep_s: f64,
        surface: Option<Spring<N>>,
    ) -> Result<(), Unresolved> {
        let tick_s = crate::seconds(self.drive.period_ns());
        let step_s = substep_s.min(tick_s);
        let Some(mass) = self.both_sides(position) else { return Ok(()) };
        self.check_gains(&mass, tick_s)?;
        let gear = |strength: f64, joint: usize| Element { joint: Some(joint), strength, along: across::<N>(joint) };
        let gears = || self.joints.iter().enumerate().filter_map(|(joint, of)| of.gear.map(|gear| (joint, gear)));
        let dampers: Vec<Element> = gears().map(|(joint, of)| gear(of.damping, joint)).collect();
        if let Some((mode, Element { joint: Some(joint), strength, .. })) = fastest(&mass, &dampers)
            && mode.value * step_s > MOST_DECAY
        {
            let (joint, damping, accepted) = (*joint, *strength, *strength * MOST_DECAY / (mode.value * step_s));
            return Err(Unresolved::Damper {
                joint,
                damping,
                accepted,
                step_s,
                accepted_step_s: MOST_DECAY / mode.value,
            });
        }
        let mut springs: Vec<Element> = gears().map(|(joint, of)| gear(of.stiffness, joint)).collect();
        if let Some(Spring { lever, stiffness }) = surface {
            let along = Sides::from_fn(|index, _| lever.get(index).copied().unwrap_or(0.0));
            springs.push(Element { joint: None, strength: stiffness, along });
        }
        for mode in modes(&mass, &springs) {
            let (omega, damping) = (mode.value.max(0.0).sqrt(), self.modal_damping(&mode, &dampers));
            let accepted_step_s = longest_step_s(omega, damping);
            if step_s <= accepted_step_s {
                continue;
            }
            let frequency_hz = omega / std::f64::consts::TAU;
            return Err(match leading(&mode, &springs) {
                Some(Element { joint: Some(joint), strength, .. }) => {
                    Unresolved::Gear { joint: *joint, stiffness: *strength, frequency_hz, step_s, accepted_step_s }
                }
                _ => {
                    let stiffness = surface.map_or(0.0, |spring| spring.stiffness);
                    Unresolved::Surface { stiffness, frequency_hz, step_s, accepted_step_s }
                }
            });
        }
        Ok(())
    }

    fn check_gains(&self, mass: &Masses, tick_s: f64) -> Result<(), Unresolved> {
        let parameters = self.drive.parameters();
        // The integral part adds to the proportional one within a tick.
        let share = 1.0 + tick_s / parameters.integral_time_s;
        let gains: Vec<Element> = (0..N)
            .map(|joint| {
                let at = if self.joints[joint].gear.is_some() { N + joint } else { joint };
                let along = Sides::from_fn(|index, _| f64::from(u8::from(index == at)));
                Element { joint: Some(joint), strength: parameters.gain[joint] * share, along }
            })
            .collect();
        match fastest(mass, &gains) {
            Some((mode, Element { joint: Some(joint), .. })) if mode.value * tick_s > MOST_DECAY => {
                let gain = parameters.gain[*joint];
                let accepted = gain * MOST_DECAY / (mode.value * tick_s);
                Err(Unresolved::Gain { joint: *joint, gain, accepted, tick_s })
            }
            _ => Ok(()),
        }
    }

    /// The masses of the links, then of the rotors behind gears that give; where a gear is stiff its
    /// rotor is with the link, and stands for nothing.
    fn both_sides(&self, position: &SVector<f64, N>) -> Option<Masses> {
        let links = self.arm.at(position).mass_matrix();
        let mut mass = SMatrix::<f64, SIDES, SIDES>::identity();
        mass.view_mut((0, 0), (N, N)).copy_from(&links);
        for (joint, of) in self.joints.iter().enumerate().filter(|(_, of)| of.gear.is_some()) {
            mass[(N + joint, N + joint)] = of.reflected_inertia;
        }
        mass.cholesky()
    }

    /// Decay in 1/s of a swing, by the gears' dampers and by viscous friction.
    fn modal_damping(&self, mode: &Mode, dampers: &[Element]) -> f64 {
        let by_gears: f64 = dampers.iter().map(|damper| damper.strength * damper.along.dot(&mode.shape).powi(2)).sum();
        let rotor = |joint: usize| if self.joints[joint].gear.is_some() { N + joint } else { joint };
        let by_friction: f64 =
            (0..N).map(|joint| self.joints[joint].friction.viscous * mode.shape[rotor(joint)].powi(2)).sum();
        0.5 * (by_gears + by_friction)
    }
}

/// Longest step in s for a swing of an angular frequency in rad/s that decays by `damping` in 1/s.
fn longest_step_s(omega: f64, damping: f64) -> f64 {
    (MOST_ANGLE / omega).min((8.0 * (damping + MOST_GROWTH)).cbrt() / omega.powf(4.0 / 3.0))
}

/// What turns a gear: its link one way, its rotor the other.
fn across<const N: usize>(joint: usize) -> Sides {
    Sides::from_fn(|index, _| f64::from(i8::from(index == joint) - i8::from(index == N + joint)))
}

/// The motions of masses under elements that all answer alike.
fn modes(mass: &Masses, elements: &[Element]) -> Vec<Mode> {
    let matrix = elements
        .iter()
        .fold(SMatrix::<f64, SIDES, SIDES>::zeros(), |sum, of| sum + of.along * of.along.transpose() * of.strength);
    // L⁻¹ K L⁻ᵀ has the eigenvalues of M⁻¹ K.
    let lower = mass.l();
    let Some(half) = lower.solve_lower_triangular(&matrix) else { return Vec::new() };
    let Some(whole) = lower.solve_lower_triangular(&half.transpose()) else { return Vec::new() };
    let found = whole.symmetric_eigen();
    let shape = |column: usize| lower.tr_solve_lower_triangular(&found.eigenvectors.column(column).into_owned());
    (0..SIDES)
        .filter_map(|column| Some(Mode { value: found.eigenvalues[column], shape: shape(column)? }))
        .filter(|mode| mode.value > 0.0)
        .collect()
}

/// The element that has most of a motion's energy.
fn leading<'a>(mode: &Mode, elements: &'a [Element]) -> Option<&'a Element> {
    let energy = |element: &Element| element.strength * element.along.dot(&mode.shape).powi(2);
    elements.iter().max_by(|one, other| energy(one).total_cmp(&energy(other)))
}

fn fastest<'a>(mass: &Masses, elements: &'a [Element]) -> Option<(Mode, &'a Element)> {
    let mode = modes(mass, elements).into_iter().max_by(|one, other| one.value.total_cmp(&other.value))?;
    let element = leading(&mode, elements)?;
    Some((mode, element))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step of `integration` on x″ = −ω² x, so often; how much larger the swing is then.
    fn growth(omega: f64, step_s: f64, steps: u32) -> f64 {
        let (mut x, mut v) = (1.0f64, 0.0f64);
        for _ in 0..steps {
            let first = -omega * omega * x;
            let second = -omega * omega * (x + step_s * v);
            (x, v) = (x + step_s * v + 0.5 * step_s * step_s * first, v + 0.5 * step_s * (first + second));
        }
        x.hypot(v / omega)
    }

    #[test]
    fn a_swing_grows_as_the_bound_says() {
        for (omega, step_s) in [(1000.0, 1e-4), (1000.0, 2e-4), (4000.0, 1e-4)] {
            let steps = (1.0 / step_s) as u32 / 20;
            let rate = growth(omega, step_s, steps).ln() / (f64::from(steps) * step_s);
            let bound = omega * (omega * step_s).powi(3) / 8.0;
            assert!((rate / bound - 1.0).abs() < 0.1, "{rate}, not {bound} 1/s");
        }
        // A swing of 1000 rad/s may grow by an e-fold in a second: its step is 0.2 ms.
        assert!((longest_step_s(1000.0, 0.0) - 2e-4).abs() < 1e-9);
        // One that decays enough is held to twelve steps in a period.
        assert!((longest_step_s(1000.0, 100.0) - 5e-4).abs() < 1e-9);
    }

    #[test]
    fn two_masses_on_a_spring_swing_as_the_textbook_says() {
        // ω² = k (1/m + 1/M), and the other motion is free.
        let mut mass = SMatrix::<f64, SIDES, SIDES>::identity();
        (mass[(0, 0)], mass[(1, 1)]) = (2.0, 3.0);
        let mass = mass.cholesky().expect("masses");
        let mut along = Sides::zeros();
        (along[0], along[1]) = (1.0, -1.0);
        let found = modes(&mass, &[Element { joint: Some(0), strength: 600.0, along }]);
        let fastest = found.iter().map(|mode| mode.value).fold(0.0, f64::max);
        assert!((fastest - 500.0).abs() < 1e-9, "{fastest}");
    }
}
