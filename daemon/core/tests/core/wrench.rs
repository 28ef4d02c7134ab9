//! From a sensor's reading to f̂: against golden/wrench.json, which an independent script computes
//! from virtual work, and what must hold for any sensor.

use admittance_core::intake::{Conditioning, GivenIn, GivenSign};
use admittance_core::quantities::GivenWrench;
use admittance_core::robot::{Pose, rotation_from_rpy};
use nalgebra::{Matrix3, SVector, Vector2, Vector3, Vector6};
use proptest::prelude::*;
use serde::Deserialize;

use crate::common::given;

/// Largest difference that rounding explains: newtons and newton metres up to some hundred.
const ROUNDING: f64 = 1e-11;

#[derive(Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    tcp_rpy: [f64; 3],
    sensor_origin: [f64; 3],
    sensor_rpy: [f64; 3],
    reaction: bool,
    bias: [f64; 6],
    mass: f64,
    center_of_gravity: [f64; 3],
    gravity: [f64; 3],
    given: [f64; 6],
    wrench: [f64; 6],
}

impl Case {
    fn conditioning(&self) -> Conditioning<6> {
        Conditioning {
            given_in: GivenIn::Sensor(Pose {
                position: self.sensor_origin.into(),
                rotation: rotation_from_rpy(self.sensor_rpy),
            }),
            sign: if self.reaction { GivenSign::Reaction } else { GivenSign::OnEnvironment },
            bias: self.bias.into(),
            tool_weight: Vector3::from(self.gravity) * self.mass,
            tool_center_of_gravity: self.center_of_gravity.into(),
            ..Conditioning::none()
        }
    }

    fn tcp(&self) -> Matrix3<f64> {
        rotation_from_rpy(self.tcp_rpy)
    }
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("../golden/wrench.json")).expect("the golden file is what its script wrote")
}

#[test]
fn it_is_what_virtual_work_says() {
    let cases = golden().cases;
    assert!(cases.len() >= 10 && cases.iter().any(|case| case.reaction) && cases.iter().any(|case| !case.reaction));
    for case in &cases {
        let conditioning = case.conditioning();
        let found = conditioning.wrench(&GivenWrench(case.given.into()), &case.tcp(), &SVector::zeros());
        let error = (found - Vector6::from(case.wrench)).amax();
        assert!(error <= ROUNDING, "off by {error:e}: {found} is not {:?}", case.wrench);
        // The planar arm sees the first two of it.
        let planar = Conditioning::<2> {
            given_in: conditioning.given_in,
            sign: conditioning.sign,
            bias: conditioning.bias,
            tool_weight: conditioning.tool_weight,
            tool_center_of_gravity: conditioning.tool_center_of_gravity,
            ..Conditioning::none()
        };
        assert_eq!(
            planar.wrench(&GivenWrench(case.given.into()), &case.tcp(), &SVector::zeros()).as_slice(),
            &found.as_slice()[..2]
        );
    }
}

#[test]
fn nothing_configured_changes_no_bit() {
    let given = Vector6::new(-0.0, 5e-324, -1.5, f64::MAX, 0.1 + 0.2, 1.0 / 3.0);
    let wrench = Conditioning::<6>::none().wrench(&GivenWrench(given), &Matrix3::identity(), &SVector::zeros());
    assert_eq!(wrench.map(f64::to_bits), given.map(f64::to_bits));
}

#[test]
fn the_end_of_the_range_is_seen_on_what_is_given() {
    let conditioning = Conditioning::<2> {
        bias: Vector6::repeat(90.0),
        saturation: Some(Vector6::new(100.0, 100.0, 200.0, 10.0, 10.0, 10.0)),
        ..Conditioning::none()
    };
    let given = |index: usize, value: f64| {
        let mut given = Vector6::zeros();
        given[index] = value;
        conditioning.saturated(&GivenWrench(given))
    };
    assert_eq!((given(0, 99.9), given(0, 100.0), given(1, -100.0), given(5, -11.0)), (None, Some(0), Some(1), Some(5)));
    assert_eq!(given(0, f64::NAN), None, "what is no number is told as that");
    assert_eq!(Conditioning::<2>::none().saturated(&GivenWrench(Vector6::repeat(1e5))), None);
}

#[test]
fn the_deadband_hides_what_is_small_and_takes_nothing_off_the_rest() {
    let conditioning = Conditioning::<2> { deadband: Vector2::new(2.0, 0.0), ..Conditioning::none() };
    let wrench =
        |x: f64, y: f64| conditioning.wrench(&given(Vector2::new(x, y)), &Matrix3::identity(), &SVector::zeros());
    assert_eq!(wrench(2.0, 1e-9), Vector2::new(0.0, 1e-9));
    assert_eq!(wrench(-2.0, -3.0), Vector2::new(0.0, -3.0));
    assert_eq!(wrench(2.0001, 0.0), Vector2::new(2.0001, 0.0));
    assert!(wrench(f64::NAN, 0.0)[0].is_nan(), "what is no number is no zero");
}

fn vector(size: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-size..size)
}

fn six(size: f64) -> impl Strategy<Value = Vector6<f64>> {
    prop::array::uniform6(-size..size).prop_map(Into::into)
}

prop_compose! {
    fn any_sensor()(
        (is_sensor, reaction) in any::<(bool, bool)>(),
        origin in vector(0.5), rpy in vector(3.1), bias in six(20.0), weight in vector(80.0), center in vector(0.3),
    ) -> Conditioning<6> {
        let sensor = Pose { position: origin.into(), rotation: rotation_from_rpy(rpy) };
        Conditioning {
            given_in: if is_sensor { GivenIn::Sensor(sensor) } else { GivenIn::Base },
            sign: if reaction { GivenSign::Reaction } else { GivenSign::OnEnvironment },
            bias,
            tool_weight: weight.into(),
            tool_center_of_gravity: center.into(),
            ..Conditioning::none()
        }
    }
}

proptest! {
    #[test]
    fn without_contact_nothing_is_left(sensor in any_sensor(), tcp in vector(3.1)) {
        let tcp = rotation_from_rpy(tcp);
        let left = sensor.wrench(&GivenWrench(sensor.unloaded(&tcp, &Vector6::zeros()).0 + sensor.bias), &tcp, &SVector::zeros());
        prop_assert!(left.amax() <= ROUNDING, "{left}");
    }

    #[test]
    fn a_force_keeps_its_size_and_the_reaction_is_its_opposite(
        sensor in any_sensor(), tcp in vector(3.1), push in six(200.0),
    ) {
        let tcp = rotation_from_rpy(tcp);
        let unloaded = sensor.unloaded(&tcp, &Vector6::zeros()).0 + sensor.bias;
        let felt = sensor.wrench(&GivenWrench(unloaded + push), &tcp, &SVector::zeros());
        let sizes = (felt.fixed_rows::<3>(0).norm(), push.fixed_rows::<3>(0).norm());
        prop_assert!((sizes.0 - sizes.1).abs() <= 1e-10, "{sizes:?}");
        // The other sign on the other readings is the same wrench.
        let opposite = Conditioning {
            sign: if sensor.sign == GivenSign::Reaction { GivenSign::OnEnvironment } else { GivenSign::Reaction },
            bias: -sensor.bias,
            ..sensor
        };
        let error = (opposite.wrench(&GivenWrench(-(unloaded + push)), &tcp, &SVector::zeros()) - felt).amax();
        prop_assert!(error <= 1e-10, "{error:e}");
    }
}
