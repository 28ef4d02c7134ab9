//! A step of the arm, its gears and its friction under constant motor torques.
//!
//! The method is ROS2 of Verwer, Spee, Blom and Hundsdorfer (SIAM J. Sci. Comput. 20, 1999), of second
//! order whatever matrix A stands in for the Jacobian:
//!
//! (1 − γhA) k₁ = f(y), (1 − γhA) k₂ = f(y + h k₁) − 2 k₁, y⁺ = y + 3/2 h k₁ + 1/2 h k₂
//!
//! A has the slope of friction, in the joints and at the surface, and of the surface's damping: what
//! sticks would chatter, and a light tool on a strong damper burst. Springs it has not; `resolution`
//! holds them to the step.

use nalgebra::SVector;

use super::{Load, RigidBody};

/// 1 − 1/√2: with it the method is L-stable.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// Both sides of the gears.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion<const N: usize> {
    pub(super) position: SVector<f64, N>,
    pub(super) velocity: SVector<f64, N>,
    pub(super) rotor_position: SVector<f64, N>,
    pub(super) rotor_velocity: SVector<f64, N>,
}

impl<const N: usize> Motion<N> {
    fn is_finite(&self) -> bool {
        let all = [&self.position, &self.velocity, &self.rotor_position, &self.rotor_velocity];
        all.iter().all(|vector| vector.iter().all(|value| value.is_finite()))
    }
}

/// What accelerates both sides, N m.
struct Torques<const N: usize> {
    joint: SVector<f64, N>,
    /// Means nothing where the gear is stiff.
    rotor: SVector<f64, N>,
}

/// A change, or a rate, of both sides' velocities.
struct Change<const N: usize> {
    joint: SVector<f64, N>,
    rotor: SVector<f64, N>,
}

impl<const N: usize> RigidBody<N> {
    /// A step of `h` seconds; `None` where the motion is then no longer finite, or where the masses with
    /// their friction are so ill-conditioned that no acceleration can be computed.
    pub(super) fn step(&self, before: &Motion<N>, h: f64, load: &impl Load<N>) -> Option<Motion<N>> {
        let slope: SVector<f64, N> =
            SVector::from_fn(|joint, _| self.joints[joint].friction.slope(before.rotor_velocity[joint]));
        let here = self.arm.at(&before.position);
        let mass = here.mass_matrix();
        // M (1 − γhA) is M with friction on its diagonal; of a rotor alone it is a number.
        let mut damped = mass;
        for joint in (0..N).filter(|joint| self.joints[*joint].gear.is_none()) {
            damped[(joint, joint)] += GAMMA * h * slope[joint];
        }
        let pressed = load.at(&before.position, &before.velocity, 0.0);
        if let Some(resistance) = pressed.resistance {
            damped += resistance * (GAMMA * h);
        }
        let factor = damped.cholesky()?;
        let rotor_mass: SVector<f64, N> = SVector::from_fn(|joint, _| self.joints[joint].reflected_inertia);
        let damped_rotor: SVector<f64, N> = SVector::from_fn(|joint, _| {
            if self.joints[joint].gear.is_some() { rotor_mass[joint] + slope[joint] * (GAMMA * h) } else { 1.0 }
        });

        let torques = self.torques(before);
        let bias = here.bias(&before.velocity, &pressed.wrench);
        let first =
            Change { joint: factor.solve(&(torques.joint - bias)), rotor: torques.rotor.component_div(&damped_rotor) };

        let along = Change { joint: before.velocity * h, rotor: before.rotor_velocity * h };
        let there = self.moved(before, &along, &Change { joint: first.joint * h, rotor: first.rotor * h });
        let torques = self.torques(&there);
        let pressing = load.at(&there.position, &there.velocity, h).wrench;
        let free = self.arm.at(&there.position).acceleration(&there.velocity, &torques.joint, &pressing)?;
        let rotor_rest = torques.rotor - rotor_mass.component_mul(&first.rotor) * 2.0;
        let second = Change {
            joint: factor.solve(&(mass * (free - first.joint * 2.0))),
            rotor: rotor_rest.component_div(&damped_rotor),
        };

        // Positions have no part in A: of them the same formula leaves h q̇ + h²/2 k₁.
        let way = |velocity: &SVector<f64, N>, rate: &SVector<f64, N>| velocity * h + rate * (0.5 * h * h);
        let change = |first: &SVector<f64, N>, second: &SVector<f64, N>| (first * 1.5 + second * 0.5) * h;
        let along =
            Change { joint: way(&before.velocity, &first.joint), rotor: way(&before.rotor_velocity, &first.rotor) };
        let faster = Change { joint: change(&first.joint, &second.joint), rotor: change(&first.rotor, &second.rotor) };
        Some(self.moved(before, &along, &faster)).filter(Motion::is_finite)
    }

    fn torques(&self, motion: &Motion<N>) -> Torques<N> {
        let mut torques = Torques { joint: SVector::zeros(), rotor: SVector::zeros() };
        for (joint, parameters) in self.joints.iter().enumerate() {
            let driving = self.torque[joint] - parameters.friction.torque(motion.rotor_velocity[joint]);
            match parameters.gear {
                None => torques.joint[joint] = driving,
                Some(gear) => {
                    let through = gear.stiffness * (motion.rotor_position[joint] - motion.position[joint])
                        + gear.damping * (motion.rotor_velocity[joint] - motion.velocity[joint]);
                    torques.joint[joint] = through;
                    torques.rotor[joint] = driving - through;
                }
            }
        }
        torques
    }

    /// With these changes of position and velocity; a rotor behind a stiff gear goes with its joint.
    fn moved(&self, from: &Motion<N>, along: &Change<N>, faster: &Change<N>) -> Motion<N> {
        let (position, velocity) = (from.position + along.joint, from.velocity + faster.joint);
        let gives = |joint: usize| self.joints[joint].gear.is_some();
        let rotor = |joint: usize, own: f64, link: f64| if gives(joint) { own } else { link };
        Motion {
            rotor_position: SVector::from_fn(|joint, _| {
                rotor(joint, from.rotor_position[joint] + along.rotor[joint], position[joint])
            }),
            rotor_velocity: SVector::from_fn(|joint, _| {
                rotor(joint, from.rotor_velocity[joint] + faster.rotor[joint], velocity[joint])
            }),
            position,
            velocity,
        }
    }
}
