//! The arm's kinematics behind one interface, whatever its joints and task axes; lists have room for
//! the most of them.

use admittance_core::robot::Chain;
use admittance_core::with_arm;
use admittance_host::robot_description::RobotDescription;
use ipc_types::{MAX_JOINTS, TASK_AXES};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// One value for each joint; zeros after them.
pub(super) type Joints = [f64; MAX_JOINTS];
/// One value for each task axis; zeros after them.
pub(super) type Axes = [f64; TASK_AXES];

/// The arm at a joint position.
pub(super) struct Placed {
    /// Orientation of the TCP in the base frame.
    pub(super) rotation: Matrix3<f64>,
    /// Its position, m.
    pub(super) position: Vector3<f64>,
    /// All six rows of J.
    pub(super) jacobian: SMatrix<f64, TASK_AXES, MAX_JOINTS>,
    /// J⁻¹ of the task axes; zero where the pose is singular.
    pub(super) inverse: SMatrix<f64, MAX_JOINTS, TASK_AXES>,
}

/// An arm of some number of joints.
pub(super) trait Arm {
    fn at(&self, position: &Joints) -> Placed;
}

struct ArmOf<const N: usize, const D: usize>(Chain<N>);

impl<const N: usize, const D: usize> Arm for ArmOf<N, D> {
    fn at(&self, position: &Joints) -> Placed {
        let kinematics = self.0.kinematics(&SVector::<f64, N>::from_fn(|joint, _| position[joint]));
        let inverse = kinematics.inverse::<D>(0.0);
        Placed {
            rotation: kinematics.pose.rotation,
            position: kinematics.pose.position,
            jacobian: SMatrix::from_fn(|row, joint| if joint < N { kinematics.jacobian[(row, joint)] } else { 0.0 }),
            inverse: inverse.map_or_else(
                |_| SMatrix::zeros(),
                |inverse| {
                    SMatrix::from_fn(
                        |joint, axis| {
                            if joint < N && axis < D { inverse.matrix[(joint, axis)] } else { 0.0 }
                        },
                    )
                },
            ),
        }
    }
}

/// The arm of a description; `None` for one that no program here knows.
pub(super) fn arm(robot: &RobotDescription) -> Option<Box<dyn Arm>> {
    let (joints, axes) = (robot.joint.len(), robot.task_axes);
    with_arm!((joints, axes), <N, D> => {
        robot.chain::<N>().map(|chain| Box::new(ArmOf::<N, D>(chain)) as Box<dyn Arm>)
    }, else None)
}
