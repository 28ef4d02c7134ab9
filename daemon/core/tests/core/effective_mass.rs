//! What an arm weighs in an impact, against the textbook's two links, and against what a force does.

use admittance_core::robot::{ArmDynamics, Chain, Joint, JointKind, LinkInertia, Pose};
use nalgebra::{Matrix3, Vector2, Vector3, Vector6};

/// Two uniform rods of 1 m, 4 and 3 kg, in the plane of x and y.
fn rods(reflected: [f64; 2]) -> ArmDynamics<2> {
    let at = |x: f64| Vector3::new(x, 0.0, 0.0);
    let kind = JointKind::Revolute;
    let joint = |x: f64| Joint { origin: at(x), rotation: Matrix3::identity(), axis: Vector3::z(), kind };
    let tool = Pose { position: at(1.0), rotation: Matrix3::identity() };
    let rod = |mass: f64| LinkInertia {
        mass,
        center_of_gravity: at(0.5),
        inertia: Matrix3::from_diagonal(&Vector3::new(0.001, mass / 12.0, mass / 12.0)),
    };
    let chain = Chain::new([joint(0.0), joint(1.0)], tool).expect("a chain");
    ArmDynamics::new(chain, [rod(4.0), rod(3.0)], reflected.into(), Vector3::new(0.0, -9.81, 0.0)).expect("an arm")
}

#[test]
fn it_is_the_textbook_s_of_two_links() {
    // 1 / (j M⁻¹ jᵀ) by hand: M11 = 6.1358, M12 = 1.4012, M22 = 1 kg m², j = (1.5427, 0.9211) m.
    let mass = rods([0.0; 2]).effective_mass(&Vector2::new(0.9, -1.3), &Vector3::y()).expect("it moves along y");
    assert!((mass - 1.157_973_061_090_641).abs() < 1e-9, "{mass} kg");
    // Across its plane it does not move.
    assert_eq!(rods([0.0; 2]).effective_mass(&Vector2::new(0.9, -1.3), &Vector3::z()), None);
}

#[test]
fn a_force_accelerates_it_as_that_mass() {
    let (q, still) = (Vector2::new(-0.4, 1.1), Vector2::zeros());
    for reflected in [[0.0, 0.0], [2.1, 0.9]] {
        let arm = rods(reflected);
        let direction = Vector3::new(0.6, -0.8, 0.0);
        let wrench = Vector6::new(0.6, -0.8, 0.0, 0.0, 0.0, 0.0);
        let balance = arm.at(&q).gravity_torque();
        let joints = arm.at(&q).acceleration(&still, &balance, &wrench).expect("finite");
        // J by hand: what the robot exerts comes back on it.
        let (first, second) = (q[0], q[0] + q[1]);
        let x = -(first.sin() + second.sin()) * joints[0] - second.sin() * joints[1];
        let y = (first.cos() + second.cos()) * joints[0] + second.cos() * joints[1];
        let along = direction.x * x + direction.y * y;
        let mass = arm.effective_mass(&q, &direction).expect("it moves");
        assert!((along * mass + 1.0).abs() < 1e-12, "{mass} kg and {along} m/s²");
    }
}
