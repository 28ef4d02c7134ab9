//! The task frame: between the base frame, in which samples and files speak, and the directions that
//! the law works in.

use admittance_core::robot::rotation_from_rpy;
use admittance_core::{Parameters, Turn};
use nalgebra::{Matrix3, SVector, Vector3};

use crate::config::{Config, FrameName};

/// Least length of what is left of an axis beside a normal that counts as not along it.
const LEAST_LEFT: f64 = 0.1;

/// Orientation of the task frame in the base frame; both have the same origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaskFrame {
    /// Its axes in the base frame, as columns; `None` is the base frame: then nothing is turned, and no
    /// bit changes.
    axes: Option<Matrix3<f64>>,
}

impl TaskFrame {
    /// That of a configuration.
    pub fn of(config: &Config) -> Self {
        let axes = match config.task.frame {
            FrameName::Base => None,
            FrameName::Rpy => Some(rotation_from_rpy(config.task.rpy_rad)),
            // Until a sample says where the tool is.
            FrameName::Tool => Some(rotation_from_rpy(config.environment.contact_rpy_rad)),
            FrameName::Surface => on_surface(&config.environment.surface_normal.into()),
        };
        Self { axes }
    }

    /// That of a configuration where the TCP has this orientation in the base frame.
    pub fn with_tool(config: &Config, tcp: &Matrix3<f64>) -> Self {
        match config.task.frame {
            FrameName::Tool => Self::at(tcp),
            FrameName::Base | FrameName::Rpy | FrameName::Surface => Self::of(config),
        }
    }

    /// That of a TCP with this orientation in the base frame.
    pub fn at(tcp: &Matrix3<f64>) -> Self {
        Self { axes: Some(*tcp) }
    }

    /// Its axes in the base frame, as columns; `None` of the base frame.
    pub fn axes(&self) -> Option<&Matrix3<f64>> {
        self.axes.as_ref()
    }

    /// From the base frame to it.
    fn turn(&self) -> Option<Turn> {
        self.axes.map(|axes| Turn::between(&Matrix3::identity(), &axes))
    }

    /// From it to another; `None` where that is the same.
    pub fn to(&self, other: &Self) -> Option<Turn> {
        let axes = |frame: &Self| frame.axes.unwrap_or_else(Matrix3::identity);
        (self != other).then(|| Turn::between(&axes(self), &axes(other)))
    }

    /// Parameters of the base frame in it.
    pub fn see<const N: usize, const D: usize>(&self, parameters: &Parameters<N, D>) -> Parameters<N, D> {
        self.axes.map_or(*parameters, |axes| parameters.seen_from(&axes))
    }

    /// A direction or position of the base frame in it.
    pub fn vector(&self, vector: Vector3<f64>) -> Vector3<f64> {
        self.turn().map_or(vector, |turn| turn.vector(&vector))
    }

    /// A direction or position of it in the base frame.
    pub fn vector_in_base(&self, vector: Vector3<f64>) -> Vector3<f64> {
        self.turn().map_or(vector, |turn| turn.back(&vector))
    }

    /// A twist or wrench of the base frame in it.
    pub fn twist<const D: usize>(&self, twist: SVector<f64, D>) -> SVector<f64, D> {
        self.turn().map_or(twist, |turn| turn.twist(&twist))
    }

    /// One of it in the base frame.
    pub fn twist_in_base<const D: usize>(&self, twist: SVector<f64, D>) -> SVector<f64, D> {
        self.axes.map_or(twist, |axes| Turn::between(&axes, &Matrix3::identity()).twist(&twist))
    }
}

/// The frame whose z is the normal; `None` of a normal without direction.
fn on_surface(normal: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let z = normal.try_normalize(0.0)?;
    let beside = |axis: Vector3<f64>| (axis - z * z.dot(&axis)).try_normalize(LEAST_LEFT);
    let x = beside(Vector3::x()).or_else(|| beside(Vector3::y()))?;
    Some(Matrix3::from_columns(&[x, z.cross(&x), z]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_on_a_surface_has_the_normal_as_z() {
        for normal in [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0], [-3.0, 0.01, 0.0], [0.3, -0.2, -0.5]] {
            let normal = Vector3::from(normal);
            let axes = on_surface(&normal).unwrap();
            assert!((axes.column(2) - normal.normalize()).norm() < 1e-15);
            assert!((axes * axes.transpose() - Matrix3::identity()).norm() < 1e-14, "{axes}");
            assert!(axes.determinant() > 0.0);
        }
        assert_eq!(on_surface(&Vector3::z()), Some(Matrix3::identity()));
        assert_eq!(on_surface(&Vector3::zeros()), None);
    }

    #[test]
    fn a_twist_turns_in_halves_and_back() {
        let frame = TaskFrame { axes: Some(rotation_from_rpy([0.3, -0.4, 1.2])) };
        let twist = SVector::<f64, 6>::new(0.1, -0.2, 0.3, 1.0, 2.0, -3.0);
        let turned = frame.twist(twist);
        let linear = frame.vector(Vector3::new(0.1, -0.2, 0.3));
        assert!((turned.fixed_rows::<3>(0) - linear).norm() < 1e-15);
        assert!((frame.twist_in_base(turned) - twist).norm() < 1e-14);
        assert!((frame.vector_in_base(linear) - Vector3::new(0.1, -0.2, 0.3)).norm() < 1e-15);
        assert!((turned - twist).norm() > 0.1);
    }

    #[test]
    fn the_base_frame_changes_no_bit() {
        let base = TaskFrame { axes: None };
        assert!(base.twist(SVector::<f64, 2>::new(-0.0, 0.0))[0].is_sign_negative());
        assert!(base.vector_in_base(Vector3::new(-0.0, 0.0, 0.0)).x.is_sign_negative());
        assert_eq!(base.to(&base), None);
    }
}
