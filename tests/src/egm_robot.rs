//! What an ABB robot says by EGM.

use egm_messages::{
    EgmClock, EgmFeedBack, EgmHeader, EgmJoints, EgmMciState, EgmMeasuredForce, EgmMotorState, EgmPlanned,
    EgmRapidCtrlExecState, EgmRobot,
};

/// The message of this cycle of a robot that stands: its number, and 4 ms after the last one on its clock.
pub fn standing(cycle: u32) -> EgmRobot {
    let joints = || Some(EgmJoints { joints: vec![17.0, 68.0, -103.0, 126.0, 90.0, 17.0] });
    let microseconds = u64::from(cycle) * 4000;
    let time = Some(EgmClock { sec: microseconds / 1_000_000, usec: microseconds % 1_000_000 });
    EgmRobot {
        header: Some(EgmHeader { seqno: Some(cycle), tm: Some(4u32.wrapping_mul(cycle)), mtype: Some(2) }),
        feed_back: Some(EgmFeedBack { joints: joints(), time, ..EgmFeedBack::default() }),
        planned: Some(EgmPlanned { joints: joints(), ..EgmPlanned::default() }),
        motor_state: Some(EgmMotorState { state: 1 }),
        mci_state: Some(EgmMciState { state: 3 }),
        rapid_exec_state: Some(EgmRapidCtrlExecState { state: 2 }),
        measured_force: Some(EgmMeasuredForce { fc_active: Some(true), force: vec![0.0; 6] }),
        ..EgmRobot::default()
    }
}
