//! The `[surface]` section of a scenario.

use std::f64::consts::TAU;

use admittance_host::config::ConfigError;
use admittance_host::{config_enum, config_section};
use nalgebra::Vector3;

use super::{Law, PlateMotion, Shape, StiffnessStep, Surface};
use crate::maxwell::Maxwell;

/// Defaults of keys that mean nothing without another one.
const CYLINDER_AXIS: [f64; 3] = [0.0, 0.0, 1.0];
const RELAXATION_TIME_S: f64 = 0.01;
const SLIP_VELOCITY_M_S: f64 = 0.001;
const PLATE_FREQUENCY_HZ: f64 = 1.0;
/// Largest speed of a plate's sine in m/s, as of its constant velocity.
const MOST_SINE_SPEED: f64 = 1.0;

config_enum! {
    /// What a surface is.
    pub enum ShapeName {
        /// Flat.
        Plane = "plane",
        /// Round in one direction.
        Cylinder = "cylinder",
        /// Round in all directions.
        Sphere = "sphere",
    }
}

config_section! {
    /// A step in stiffness along the path.
    pub struct StiffnessStepSection {
        /// Way in which the stiffness changes, base frame; any length above zero.
        direction: [f64; 3], unit "1", range -1.0..=1.0;
        /// Where it is half done, along that direction from point_m.
        at_m: f64, unit "m", range -10.0..=10.0;
        /// Length over which it changes; 0 is a jump.
        width_m: f64 = 0.001, unit "m", range 0.0..=1.0;
        /// Stiffness behind it.
        stiffness_n_m: f64, unit "N/m", range 100.0..=1e8;
    }
    cross_check step_has_a_direction;
}

config_section! {
    /// A force that grows faster than the depth: k δ (1 + (δ/d)²).
    pub struct HardeningSection {
        /// d, at which the cubic part is as large as the linear one.
        depth_m: f64, unit "m", range 1e-6..=1.0;
    }
}

config_section! {
    /// The law of Hunt and Crossley: k d (δ/d)ⁿ (1 + α δ̇).
    pub struct HuntCrossleySection {
        /// n.
        exponent: f64 = 1.5, unit "1", range 1.0..=3.0;
        /// d, at which the force without damping is stiffness_n_m times it.
        depth_m: f64 = 0.001, unit "m", range 1e-6..=1.0;
        /// α.
        damping_s_m: f64, unit "s/m", range 0.0..=1000.0;
    }
}

config_section! {
    /// How the surface moves along its normal, from the start of the motion on.
    pub struct PlateSection {
        /// Constant velocity; above zero it comes towards the tool.
        velocity_m_s: f64 = 0.0, unit "m/s", range -1.0..=1.0;
        /// Amplitude of a sine beside.
        amplitude_m: f64 = 0.0, unit "m", range 0.0..=0.1;
        /// Its frequency.
        frequency_hz: f64 = PLATE_FREQUENCY_HZ, unit "Hz", range 0.001..=1000.0;
    }
    cross_check plate_is_no_faster;
}

config_section! {
    /// What the TCP may touch.
    pub struct SurfaceSection {
        /// A point of the undeformed surface, base frame.
        point_m: [f64; 3], unit "m", range -100.0..=100.0;
        /// Outward normal, base frame; any length above zero. A plane that falls by α towards +x:
        /// [sin α, cos α, 0].
        normal: [f64; 3], unit "1", range -1.0..=1.0;
        /// What it is; when absent a plane where curvature_1_m is 0, else a cylinder.
        shape: Option<ShapeName>;
        /// 1/radius of a cylinder or sphere that has this normal at point_m: above zero it falls away
        /// to all sides, below zero it is a hollow. 0 is a plane.
        curvature_1_m: f64 = 0.0, unit "1/m", range -100.0..=100.0;
        /// Direction of the cylinder's axis, base frame; what of it is along the normal is left out.
        axis: [f64; 3] = CYLINDER_AXIS, unit "1", range -1.0..=1.0;
        /// Stiffness along the normal, k_env of (19).
        stiffness_n_m: f64, unit "N/m", range 100.0..=1e8;
        /// Where another stiffness begins; the same everywhere when absent.
        step: Option<StiffnessStepSection>;
        /// A spring that hardens; a linear one when absent.
        hardening: Option<HardeningSection>;
        /// The law of Hunt and Crossley in place of the spring.
        hunt_crossley: Option<HuntCrossleySection>;
        /// Damping along the normal.
        damping_n_s_m: f64 = 0.0, unit "N s/m", range 0.0..=1e5;
        /// Stiffness of a spring beside the first, in series with a damper: a Maxwell element, with
        /// which the surface creeps. None when absent.
        maxwell_stiffness_n_m: Option<f64>, unit "N/m", range 100.0..=1e8;
        /// Time in which a force held by the Maxwell element falls to 37 %: its damping over its
        /// stiffness.
        maxwell_relaxation_time_s: f64 = RELAXATION_TIME_S, unit "s", range 0.0001..=10.0;
        /// Coulomb friction coefficient.
        friction: f64 = 0.0, unit "1", range 0.0..=2.0;
        /// Sliding speed at which friction reaches 1/√2 of its full value.
        slip_velocity_m_s: f64 = SLIP_VELOCITY_M_S, unit "m/s", range 0.000001..=1.0;
        /// A surface that moves; at rest when absent.
        plate: Option<PlateSection>;
    }
    cross_check keys_fit_each_other;
}

/// Of length 1; `None` where it has no direction.
fn direction_of(vector: [f64; 3]) -> Option<Vector3<f64>> {
    Vector3::from(vector).try_normalize(1e-3)
}

fn step_has_a_direction(step: &StiffnessStepSection, path: &str, errors: &mut Vec<ConfigError>) {
    if direction_of(step.direction).is_none() {
        let key = format!("{path}.direction");
        errors.push(ConfigError::new(key, format!("{:?}", step.direction), "a vector that is not zero"));
    }
}

fn plate_is_no_faster(plate: &PlateSection, path: &str, errors: &mut Vec<ConfigError>) {
    let mut refuse = |key: &str, found: f64, accepted: String| {
        errors.push(ConfigError::new(format!("{path}.{key}"), found, accepted));
    };
    let speed = plate.amplitude_m * TAU * plate.frequency_hz;
    if speed > MOST_SINE_SPEED {
        let accepted = format!(
            "at most {MOST_SINE_SPEED} m/s for amplitude_m * 2 pi * frequency_hz, which is {speed:.3} m/s with {path}.frequency_hz = {}",
            plate.frequency_hz
        );
        refuse("amplitude_m", plate.amplitude_m, accepted);
    }
    if plate.amplitude_m == 0.0 && plate.frequency_hz != PLATE_FREQUENCY_HZ {
        refuse("frequency_hz", plate.frequency_hz, format!("none without {path}.amplitude_m above 0: nothing swings"));
    }
}

fn keys_fit_each_other(surface: &SurfaceSection, path: &str, errors: &mut Vec<ConfigError>) {
    let mut refuse = |key: &str, found: String, accepted: &str| {
        errors.push(ConfigError::new(format!("{path}.{key}"), found, accepted));
    };
    if direction_of(surface.normal).is_none() {
        refuse("normal", format!("{:?}", surface.normal), "a vector that is not zero");
    }
    let is_flat = surface.curvature_1_m == 0.0;
    match surface.shape() {
        ShapeName::Plane if !is_flat => {
            refuse("curvature_1_m", surface.curvature_1_m.to_string(), "0 with shape = \"plane\"");
        }
        ShapeName::Cylinder | ShapeName::Sphere if is_flat => {
            refuse("curvature_1_m", "0".to_owned(), "1/radius with this shape, not 0");
        }
        ShapeName::Cylinder if surface.cylinder_axis().is_none() => {
            refuse("axis", format!("{:?}", surface.axis), "a vector that is not along the normal");
        }
        _ => {}
    }
    if surface.hunt_crossley.is_some() {
        if let Some(hardening) = &surface.hardening {
            let accepted = "no [surface.hardening] beside [surface.hunt_crossley], which hardens by its exponent";
            refuse("hardening", format!("{{ depth_m = {} }}", hardening.depth_m), accepted);
        }
        if surface.damping_n_s_m > 0.0 {
            let found = surface.damping_n_s_m.to_string();
            refuse("damping_n_s_m", found, "0 with hunt_crossley, which has its own damping_s_m");
        }
    }
    let is_plain = surface.hunt_crossley.is_none() && surface.hardening.is_none() && surface.step.is_none();
    if let Some(stiffness) = surface.maxwell_stiffness_n_m.filter(|_| !is_plain) {
        let accepted = "none with step, hardening or hunt_crossley: what creeps is linear, and the same everywhere";
        refuse("maxwell_stiffness_n_m", stiffness.to_string(), accepted);
    }
    if surface.shape() != ShapeName::Cylinder && surface.axis != CYLINDER_AXIS {
        refuse("axis", format!("{:?}", surface.axis), "none but of a cylinder: plane and sphere have no axis");
    }
    if surface.maxwell_stiffness_n_m.is_none() && surface.maxwell_relaxation_time_s != RELAXATION_TIME_S {
        let found = surface.maxwell_relaxation_time_s.to_string();
        refuse("maxwell_relaxation_time_s", found, "none without maxwell_stiffness_n_m: nothing creeps");
    }
    if surface.friction == 0.0 && surface.slip_velocity_m_s != SLIP_VELOCITY_M_S {
        let found = surface.slip_velocity_m_s.to_string();
        refuse("slip_velocity_m_s", found, "none without friction above 0: nothing drags");
    }
}

impl SurfaceSection {
    fn shape(&self) -> ShapeName {
        let curved = if self.curvature_1_m == 0.0 { ShapeName::Plane } else { ShapeName::Cylinder };
        self.shape.unwrap_or(curved)
    }

    /// Direction of the cylinder's axis, at a right angle to the normal; `None` where it has none.
    fn cylinder_axis(&self) -> Option<Vector3<f64>> {
        let (normal, axis) = (direction_of(self.normal)?, Vector3::from(self.axis));
        (axis - normal * normal.dot(&axis)).try_normalize(1e-3)
    }

    /// The surface of a section that passed its checks.
    pub(crate) fn surface(&self) -> Surface {
        let curvature = self.curvature_1_m;
        Surface {
            point: self.point_m.into(),
            normal: Vector3::from(self.normal).normalize(),
            shape: match self.shape() {
                ShapeName::Plane => Shape::Plane,
                ShapeName::Cylinder => {
                    Shape::Cylinder { curvature, axis: self.cylinder_axis().unwrap_or_else(Vector3::z) }
                }
                ShapeName::Sphere => Shape::Sphere { curvature },
            },
            stiffness: self.stiffness_n_m,
            step: self.step.as_ref().map(|step| StiffnessStep {
                direction: Vector3::from(step.direction).normalize(),
                at: step.at_m,
                width: step.width_m,
                stiffness: step.stiffness_n_m,
            }),
            law: match (&self.hunt_crossley, &self.hardening) {
                (Some(law), _) => {
                    Law::HuntCrossley { exponent: law.exponent, depth: law.depth_m, damping: law.damping_s_m }
                }
                (None, Some(law)) => Law::Hardening { depth: law.depth_m },
                (None, None) => Law::Linear,
            },
            damping: self.damping_n_s_m,
            maxwell: self
                .maxwell_stiffness_n_m
                .map(|stiffness| Maxwell { stiffness, relaxation_time: self.maxwell_relaxation_time_s }),
            friction: self.friction,
            slip_velocity: self.slip_velocity_m_s,
            plate: self.plate.as_ref().map(|plate| PlateMotion {
                velocity: plate.velocity_m_s,
                amplitude: plate.amplitude_m,
                frequency: TAU * plate.frequency_hz,
            }),
        }
    }
}
