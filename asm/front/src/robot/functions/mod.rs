// SPDX-License-Identifier: MIT OR Apache-2.0
//! Functions of a robot. [`derive()`] searches for the shortest equations of a [`RobotFunction`]; the type is defined here and the files of
//! this folder import it: together they are one module.

mod inverse;
mod kinematics;
mod links;
mod mass;
mod search;
mod vector;

pub use search::{Options, derive};

/// A function of a robot.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RobotFunction {
    /// Pose of the tip.
    ForwardKinematics,
    /// Velocity of the tip per joint velocity.
    Jacobian,
    /// Joint forces of a motion.
    InverseDynamics,
    /// Joint forces at rest.
    Gravity,
    /// Joint-space inertia, a symmetric matrix.
    MassMatrix,
    /// Joint accelerations under forces.
    ForwardDynamics,
    /// Joint forces that make tracking errors decay.
    ComputedTorque,
}

impl RobotFunction {
    /// Every function with its name and description.
    pub const ALL: [(RobotFunction, &'static str, &'static str); 7] = [
        (
            RobotFunction::ForwardKinematics,
            "forward-kinematics",
            "pose of the tip in the base's frame: rotation and position",
        ),
        (
            RobotFunction::Jacobian,
            "jacobian",
            "geometric Jacobian of the tip, in the base's axes: linear velocity, then angular",
        ),
        (RobotFunction::InverseDynamics, "inverse-dynamics", "joint forces that a motion takes"),
        (RobotFunction::Gravity, "gravity", "joint forces that hold the robot at rest"),
        (RobotFunction::MassMatrix, "mass-matrix", "joint-space inertia, the lower triangle"),
        (RobotFunction::ForwardDynamics, "forward-dynamics", "joint accelerations under joint forces"),
        (
            RobotFunction::ComputedTorque,
            "computed-torque",
            "joint forces that follow a reference: inverse dynamics of qddr + kp (qr - q) + kd (qdr - qd)",
        ),
    ];

    /// The function's name on the command line.
    pub fn name(self) -> &'static str {
        RobotFunction::ALL.iter().find(|(what, ..)| *what == self).map_or("", |(_, name, _)| name)
    }

    /// Description for help and for the title of the source.
    pub fn text(self) -> &'static str {
        RobotFunction::ALL.iter().find(|(what, ..)| *what == self).map_or("", |(_, _, text)| text)
    }

    /// Finds a function by its name on the command line.
    pub fn from_name(name: &str) -> Option<RobotFunction> {
        RobotFunction::ALL.iter().find(|(_, other, _)| *other == name).map(|(what, ..)| *what)
    }
}
