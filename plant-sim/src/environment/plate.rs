//! A surface that moves along its normal: a press, a conveyor that vibrates, another machine.

/// The motion of a surface, from the start of the arm's motion on; before, it rests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateMotion {
    /// Along the outward normal, m/s; above zero it comes towards the tool.
    pub velocity: f64,
    /// Of a sine beside, m.
    pub amplitude: f64,
    /// Of the sine, rad/s.
    pub frequency: f64,
}

impl PlateMotion {
    /// Where it is along the outward normal in m, from where it was at rest, and how fast in m/s.
    pub fn at(&self, time_s: f64) -> (f64, f64) {
        if time_s <= 0.0 {
            return (0.0, 0.0);
        }
        let (sine, cosine) = (self.frequency * time_s).sin_cos();
        (self.velocity * time_s + self.amplitude * sine, self.velocity + self.amplitude * self.frequency * cosine)
    }

    /// Speed in m/s that it never exceeds.
    pub(crate) fn most_speed(&self) -> f64 {
        self.velocity.abs() + self.amplitude * self.frequency
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_speed_is_the_derivative_of_where_it_is() {
        let plate = PlateMotion { velocity: 0.02, amplitude: 0.001, frequency: std::f64::consts::TAU * 3.0 };
        assert_eq!(plate.at(-0.1), (0.0, 0.0));
        // A quarter of a period is 1/12 s: 0.02/12 + 0.001 m, and the sine stands still.
        let (where_it_is, speed) = plate.at(1.0 / 12.0);
        assert!((where_it_is - 0.002_666_666_666_666_7).abs() < 1e-12 && (speed - 0.02).abs() < 1e-12);
        for time_s in [0.01, 0.3, 0.77] {
            let difference = (plate.at(time_s + 1e-6).0 - plate.at(time_s - 1e-6).0) / 2e-6;
            let (_, speed) = plate.at(time_s);
            assert!((difference - speed).abs() < 1e-7 && speed.abs() <= plate.most_speed(), "{difference} {speed}");
        }
    }
}
