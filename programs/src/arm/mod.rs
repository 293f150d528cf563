// SPDX-License-Identifier: MIT OR Apache-2.0
//! Six-axis articulated arm of the second founding paper: its kinematics in binary64, and the sweep that compares the programs
//! `arm/forward.s` and `arm/inverse.s` with it.
//!
//! Lengths in mm, angles in degrees, like the programs' ports. Equation numbers refer to the paper; see `docs/arm.md`. The files of this
//! folder import its constants and poses from here, and are re-exported: together they are one module.

mod kinematics;
pub mod square;
mod sweep;

pub use kinematics::{Failure, Solution, forward, inverse, is_clear};
pub use sweep::{Arm, ForwardResult, InverseResult, RoundTrip, Sweep, angle_between, sweep};

/// Distance of joint 2's axis from joint 1's, mm. Denavit-Hartenberg parameters are from Table 1.
pub const A1: f64 = 75.0;
/// Length of the upper arm, mm.
pub const A2: f64 = 270.0;
/// Offset of the forearm, mm.
pub const A3: f64 = 90.0;
/// Height of joint 2, mm.
pub const D1: f64 = 345.0;
/// Length of the forearm, mm.
pub const D4: f64 = 295.0;
/// Distance from the wrist's centre to the flange, mm.
pub const D6: f64 = 102.0;

/// `status` of a valid result.
pub const GOOD: u32 = 0;
/// `status` of the inverse: out of reach, or an input is NaN or infinite.
pub const OUT_OF_REACH: u32 = 1;
/// `status` of the inverse: wrist singularity.
pub const WRIST_SINGULAR: u32 = 2;
/// `status` of the inverse: the wrist's centre lies on joint 1's axis.
pub const ON_AXIS: u32 = 3;
/// `status` of the forward kinematics: the tool points nearly up or down, so roll and yaw are ill-conditioned.
pub const STEEP: u32 = 1;
/// `status` of the forward kinematics: an input is out of range, NaN or infinite.
pub const NO_ANGLE: u32 = 2;

/// Threshold on sin² θ5 below which the inverse reports the wrist singularity.
pub const STRAIGHT: f64 = 1.0 / 1_048_576.0;
/// Squared distance from joint 1's axis below which the inverse reports the axis singularity, mm².
pub const AXIS_RADIUS2: f64 = 1.0;

/// Margin of stated accuracy: lower limit on the sines of θ5 and of ψ (the angle between upper arm and forearm's line) and on cos(pitch),
/// 10° from the singularities.
pub const MARGIN: f64 = 0.173_648_177_666_930_33;
/// Margin of stated accuracy: least distance of the wrist's centre from joint 1's axis, mm.
pub const AXIS_MARGIN: f64 = 50.0;

/// Position and orientation of the tool: roll, pitch and yaw, where yaw = atan2(w_y, w_x), pitch is w's elevation, and roll = atan2(v_z,
/// -u_z).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose<T> {
    /// Position x, y, z, mm.
    pub position: [T; 3],
    /// Orientation as roll, pitch, yaw, degrees.
    pub orientation: [T; 3],
}

/// Branch of a solution: θ1 turned by 180°; elbow; wrist.
pub type Configuration = [bool; 3];

/// All eight configurations; θ1's branch changes fastest.
pub const CONFIGURATIONS: [Configuration; 8] = {
    let mut all = [[false; 3]; 8];
    let mut i = 0;
    while i < 8 {
        all[i] = [i & 1 == 1, i & 2 == 2, i & 4 == 4];
        i += 1;
    }
    all
};

/// Example of forward kinematics in the paper.
pub struct ForwardExample {
    /// Joint angles in degrees.
    pub joints: [f64; 6],
    /// Tool point relative to the flange, mm.
    pub tool: [f64; 3],
    /// Result of the paper's circuit.
    pub circuit: Pose<f64>,
    /// Result computed in binary64.
    pub binary64: Pose<f64>,
}

/// Figures of the forward example.
pub const FORWARD_EXAMPLE: ForwardExample = ForwardExample {
    joints: [109.53, -18.375, 114.56, -11.89, -0.12, 50.32],
    tool: [10.0, -15.0, 100.0],
    circuit: Pose {
        position: [-277.209_899, 765.236_267, 419.554_229],
        orientation: [-141.578_125, 6.070_312_5, 109.5],
    },
    binary64: Pose {
        position: [-277.213_810_8, 765.230_915_0, 419.558_571_0],
        orientation: [-141.567_346_6, 6.067_574_0, 109.505_136_7],
    },
};

/// Example of inverse kinematics in the paper.
pub struct InverseExample {
    /// Position and orientation of the tool.
    pub pose: Pose<f64>,
    /// Tool point relative to the flange, mm.
    pub tool: [f64; 3],
    /// Result of the paper's circuit, joint angles in degrees.
    pub circuit: [f64; 6],
}

/// Figures of the inverse example; the configuration is 0, 0, 0.
pub const INVERSE_EXAMPLE: InverseExample = InverseExample {
    pose: Pose { position: [500.123, 430.99, 420.256], orientation: [80.5, 10.333, 50.26] },
    tool: [10.0, -15.0, 100.0],
    circuit: [35.734_375, 59.507_812_5, -21.585_937_5, 164.031_25, -63.640_625, 90.398_437_5],
};
