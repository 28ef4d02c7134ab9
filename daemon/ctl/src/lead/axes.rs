//! A twist as it is typed: axes and speeds.

use admittance_core::quantities::AXIS_NAMES;
use ipc_types::TASK_AXES;

/// An axis, 0 to 5, and its speed in m/s or rad/s.
pub(super) type AxisSpeed = (usize, f64);

pub(super) fn axis_and_speed(text: &str) -> Result<AxisSpeed, String> {
    let accepted = || {
        format!("accepted: AXIS=SPEED with an axis of {} and a finite number, such as z=-0.02", AXIS_NAMES.join(" "))
    };
    let (axis, speed) = text.split_once('=').ok_or_else(accepted)?;
    let axis = AXIS_NAMES.iter().position(|name| *name == axis).ok_or_else(accepted)?;
    let speed = speed.parse().ok().filter(|speed: &f64| speed.is_finite()).ok_or_else(accepted)?;
    Ok((axis, speed))
}

/// The twist of these axes, for an arm that controls some of them.
///
/// # Errors
/// Which axis cannot be, and what is accepted.
pub(super) fn twist_of(axes: &[AxisSpeed], controlled: &[bool; TASK_AXES]) -> Result<[f64; TASK_AXES], String> {
    let mut twist = [None; TASK_AXES];
    for (axis, speed) in axes {
        let name = AXIS_NAMES[*axis];
        if twist[*axis].replace(*speed).is_some() {
            return Err(format!("{name} is there twice: accepted: each axis once"));
        }
        if !controlled[*axis] {
            let names: Vec<&str> =
                (0..TASK_AXES).filter(|axis| controlled[*axis]).map(|axis| AXIS_NAMES[axis]).collect();
            return Err(format!("{name}: accepted: {}, which the arm controls", names.join(" ")));
        }
    }
    Ok(twist.map(Option::unwrap_or_default))
}

/// "z -0.02 m/s", the axes that move alone.
pub(super) fn shown(twist: &[f64; TASK_AXES]) -> String {
    let unit = |axis: usize| if axis < 3 { "m/s" } else { "rad/s" };
    let moving = (0..TASK_AXES).filter(|axis| twist[*axis] != 0.0);
    let each: Vec<String> = moving.map(|axis| format!("{} {} {}", AXIS_NAMES[axis], twist[axis], unit(axis))).collect();
    if each.is_empty() { "at rest".to_owned() } else { each.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANAR: [bool; TASK_AXES] = [true, true, false, false, false, false];

    #[test]
    fn axes_have_one_finite_speed_each() {
        assert_eq!(axis_and_speed("z=-0.02"), Ok((2, -0.02)));
        for text in ["", "z", "w=1", "z=", "z=fast", "z=inf", "z=NaN", "-0.02"] {
            assert!(axis_and_speed(text).is_err_and(|why| why.contains("accepted: AXIS=SPEED")), "{text}");
        }
        assert_eq!(twist_of(&[(1, -0.1)], &PLANAR), Ok([0.0, -0.1, 0.0, 0.0, 0.0, 0.0]));
        let twice = twist_of(&[(1, 0.1), (1, 0.2)], &PLANAR).expect_err("twice");
        assert_eq!(twice, "y is there twice: accepted: each axis once");
        let missing = twist_of(&[(2, 0.1)], &PLANAR).expect_err("not there");
        assert_eq!(missing, "z: accepted: x y, which the arm controls");
    }

    #[test]
    fn what_moves_is_shown_with_its_unit() {
        assert_eq!(shown(&[0.0, 0.1, 0.0, 0.0, -0.2, 0.0]), "y 0.1 m/s, ry -0.2 rad/s");
        assert_eq!(shown(&[0.0; TASK_AXES]), "at rest");
    }
}
