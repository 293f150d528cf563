//! Controller programs for the Takt processor, and the binary64 models that judge them.
//!
//! - [`gcode`] reads a tool path, [`path`] is its geometry, [`trajectory`] turns it into the reference of every
//!   sampling period;
//! - [`hybrid`] is the five-axis hybrid robot of the founding paper: kinematics, dynamics, the tracking
//!   controller in binary64 and in native binary32, the plant, and the loop that joins them;
//! - [`accuracy`] measures binary32 results against binary64.
//!
//! Everything is in SI units (m, rad, s, kg, N, N·m), nothing here prints, and no input makes it panic.

pub mod accuracy;
pub mod gcode;
pub mod hybrid;
pub mod path;
pub mod real;
pub mod trajectory;

/// The test path of the paper, the letters "AGH", each in a plane of its own.
pub const AGH: &str = include_str!("../data/agh.ngc");

/// The assembly sources: path within this crate's folder, and text.
pub const SOURCES: &[(&str, &str)] = &[
    ("hybrid/robot.s", include_str!("../hybrid/robot.s")),
    ("hybrid/tracking.s", include_str!("../hybrid/tracking.s")),
    ("hybrid/tracking_literal.s", include_str!("../hybrid/tracking_literal.s")),
];
