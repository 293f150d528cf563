//! The three-processor controller: the three programs run as a system, with packets from a host and a plant behind encoders and drives, and
//! each module is compared with its binary64 model. docs/controller.md. The largest differences are printed
//! (`--nocapture`).
#![allow(clippy::print_stdout)]

mod bench;
mod errors;
mod jog;
mod motion;
mod packets;
mod queue;
mod servo;
mod signals;
mod world;
