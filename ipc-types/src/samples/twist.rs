//! To a motion controller: where another program leads the TCP.

use iceoryx2::prelude::ZeroCopySend;

use crate::TASK_AXES;

wire_sample! {
    /// Where a program leads the TCP, for a motion controller that takes its commanded motion from here. It counts for
    /// valid_for_ns and no longer; then the controller comes to rest.
    struct TwistSample: "admittanced.TwistSample.v1", size 88, writer "a program that leads, such as admittancectl move" {
        0 sequence: u64 ["1", ">= 1, one more with every sample"]
            "Number of this sample; restarts at 1 with a new boot_id.";
        8 stamp_ns: u64 ["ns", "CLOCK_MONOTONIC, increasing"]
            "When it was published.";
        16 boot_id: u64 ["1", "not 0"]
            "Chosen anew at each start of the program that leads.";
        24 valid_for_ns: u64 ["ns", ">= 1, at most what the motion controller allows"]
            "How long after stamp_ns it counts; the twist is zero from then on. Publish the next one before.";
        32 frame: u32 as TwistFrame ["1", "a code of TwistFrame"]
            "The axes of twist.";
        36 reserved: u32 ["1", "0"]
            "Not used: zero.";
        40 twist: [f64; TASK_AXES] ["m/s, rad/s", "finite; 0 on axes that the arm does not control"]
            "Velocity of the TCP without any offset: linear x y z, then angular rx ry rz. The motion controller brings it \
             down to its own limits.";
    }
}
