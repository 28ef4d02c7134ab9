//! The surface and its contact, each against the formula spelled out.

use super::*;

fn surface() -> Surface {
    Surface {
        point: Vector3::new(1.32, 0.68, 0.0),
        normal: planar_normal(25f64.to_radians()),
        shape: Shape::Plane,
        stiffness: 1e5,
        step: None,
        law: Law::Linear,
        damping: 0.0,
        maxwell: None,
        friction: 0.0,
        slip_velocity: 1e-3,
        plate: None,
    }
}

#[test]
fn force_is_stiffness_matrix_times_penetration() {
    // (20), (21) spelled out: K_e = Tᵀ diag(0, k) T, f = K_e (p − p_contact).
    let (sine, cosine) = 25f64.to_radians().sin_cos();
    let t = nalgebra::Matrix2::new(cosine, -sine, sine, cosine);
    let k = t.transpose() * nalgebra::Matrix2::new(0.0, 0.0, 0.0, 1e5) * t;
    let offset = Vector3::new(0.0004, -0.0011, 0.0);
    let contact = surface().contact(&(surface().point + offset), &Vector3::zeros(), &Creep::default(), 0.0);
    let expected = k * offset.xy();
    assert!((contact.force.xy() - expected).norm() < 1e-9, "{} {expected}", contact.force);
    assert!(contact.force.y < 0.0, "pushing down on a floor is a negative y force");
    assert!((contact.normal_force - contact.force.norm()).abs() < 1e-9);
    assert!(k.determinant().abs() < 1e-3, "the plane resists along its normal alone");
}

#[test]
fn surface_never_pulls_and_gives_no_energy() {
    let surface = Surface { damping: 300.0, friction: 0.3, ..surface() };
    // Press in and out on a sine with a sideways sweep: the work done on the environment is
    // never negative.
    let (mut work, mut largest, steps) = (0.0, 0.0f64, 20_000);
    for index in 0..steps {
        let phase = std::f64::consts::TAU * f64::from(index) / f64::from(steps);
        let depth = 0.002 * phase.sin();
        let velocity = surface.normal * (-0.002 * phase.cos()) + Vector3::new(0.0, 0.0, 0.003 * phase.sin());
        let contact = surface.contact(&(surface.point - surface.normal * depth), &velocity, &Creep::default(), 0.0);
        assert!(contact.normal_force >= 0.0);
        assert!(contact.force.dot(&surface.normal) <= 0.0, "a pull at depth {depth}");
        work += contact.force.dot(&velocity) * std::f64::consts::TAU / f64::from(steps);
        largest = largest.max(contact.normal_force);
    }
    assert!(largest > 199.0 && work > 1e-3, "peak {largest} N, work {work} J");
}

fn cylinder(curvature: f64) -> Shape {
    Shape::Cylinder { curvature, axis: Vector3::z() }
}

#[test]
fn a_cylinder_is_round() {
    for (curvature, at_the_middle) in [(5.0, 1.0), (-5.0, -1.0)] {
        let surface = Surface { shape: cylinder(curvature), ..surface() };
        let middle = surface.point - surface.normal * 0.2 * at_the_middle;
        for angle in [-0.8_f64, 0.0, 0.3, 1.0] {
            let out = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), angle) * surface.normal;
            // 1 mm in the material, anywhere along its axis.
            let position = middle + out * at_the_middle * (0.2 - 0.001 * at_the_middle) + Vector3::z() * angle;
            assert!((surface.penetration(&position, 0.0) - 0.001).abs() < 1e-12, "{angle}");
            assert!((surface.normal_at(&position, 0.0) - out).norm() < 1e-12, "{angle}");
            let force = surface.contact(&position, &Vector3::zeros(), &Creep::default(), 0.0).force;
            assert!((force + out * 100.0).norm() < 1e-6, "{force}");
        }
    }
    let (plane, flat) = (surface(), Surface { shape: cylinder(1e-9), ..surface() });
    let position = plane.point + Vector3::new(0.3, -0.2, 0.1);
    assert!((plane.penetration(&position, 0.0) - flat.penetration(&position, 0.0)).abs() < 1e-9);
}

#[test]
fn friction_drags_along_the_sliding_direction() {
    let surface = Surface { friction: 0.3, ..surface() };
    let sliding = Vector3::new(surface.normal.y, -surface.normal.x, 0.0) * 0.1;
    let inside = surface.point - surface.normal * 0.001;
    let contact = surface.contact(&inside, &sliding, &Creep::default(), 0.0);
    let along = contact.force.dot(&sliding.normalize());
    assert!((along / contact.normal_force - 0.3).abs() < 1e-4, "friction {along} N");
    assert!((contact.force.dot(&surface.normal) + contact.normal_force).abs() < 1e-9);
    let slow = surface.contact(&inside, &(sliding * 1e-6), &Creep::default(), 0.0);
    assert!(slow.force.dot(&sliding.normalize()) < 0.01, "no jump at zero speed");
}
#[test]
fn what_moves_away_is_pressed_less_and_drags_less() {
    // 1 mm deep in a plate that has come 2 mm towards the tool, at 0.02 m/s.
    let plate = PlateMotion { velocity: 0.02, amplitude: 0.0, frequency: 0.0 };
    let moving = Surface { plate: Some(plate), damping: 300.0, ..surface() };
    let position = moving.point + moving.normal * 0.001;
    assert!(moving.contact(&position, &Vector3::zeros(), &Creep::default(), 0.0).normal_force == 0.0, "not yet there");
    // k δ + d δ̇ = 1e5 · 0.001 + 300 · 0.02 against a tool at rest; none of the damping along with it.
    let against = |velocity: Vector3<f64>| moving.contact(&position, &velocity, &Creep::default(), 0.1).normal_force;
    assert!((against(Vector3::zeros()) - 106.0).abs() < 1e-9);
    assert!((against(moving.normal * 0.02) - 100.0).abs() < 1e-9);
    assert!((moving.point_at(0.1) - moving.point - moving.normal * 0.002).norm() < 1e-12);
}

#[test]
fn resistance_is_force_over_velocity() {
    let rough = Surface { damping: 300.0, friction: 0.3, ..surface() };
    let position = rough.point - rough.normal * 0.001;
    for velocity in [Vector3::new(0.03, -0.02, 0.01), Vector3::new(1e-5, 0.0, 2e-5)] {
        let contact = rough.contact(&position, &velocity, &Creep::default(), 0.0);
        let resting = rough.normal * -100.0;
        let by_matrix = rough.resistance(&position, &velocity, &contact, 0.0) * velocity + resting;
        assert!((by_matrix - contact.force).norm() < 1e-9, "{by_matrix} {}", contact.force);
    }
}
