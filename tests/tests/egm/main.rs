//! admittance-egm between the daemon and a robot controller that is emulated (`plant-sim --egm`), or spoken for by a Python
//! package that was written elsewhere: real processes over UDP.

mod attacks;
mod cell;
mod contact;
mod decay;
mod faults;
mod files;
mod led;
mod network;
mod page;
mod python;
mod torques;
