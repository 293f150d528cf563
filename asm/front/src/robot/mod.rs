// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robots: trees of moving joints, each with its body. Fixed joints are merged away. The files of this folder make a [`Robot`] and import
//! it from here, which re-exports what they read: together they are one module.

pub mod dh;
pub mod frames;
pub mod functions;
pub mod mjcf;
mod nesting;
mod source;
pub mod space;
mod tree;
pub mod urdf;
pub mod xml;

pub(crate) use tree::list;
pub use tree::{Condition, Element, ElementKind, Tree};

use crate::{Error, Files};
use source::Source;
use space::{Inertia, Pose, V3};

/// The motion that a joint allows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// Turning: revolute and continuous joints.
    Revolute,
    /// Sliding along the axis.
    Prismatic,
}

impl Kind {
    /// Unit of a joint's position.
    pub fn unit(self) -> &'static str {
        match self {
            Kind::Revolute => "rad",
            Kind::Prismatic => "m",
        }
    }

    /// Unit of a joint's force.
    pub fn force(self) -> &'static str {
        match self {
            Kind::Revolute => "N m",
            Kind::Prismatic => "N",
        }
    }
}

/// A joint's rotor and passive forces, as in MuJoCo's models.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct PassiveForces {
    /// Rotor inertia of the motor, seen through the gear, kg m² (kg for a sliding joint).
    pub armature: f64,
    /// Viscous friction, N m s (N s/m).
    pub damping: f64,
    /// Coulomb friction, N m (N).
    pub friction: f64,
    /// Spring stiffness, N m/rad (N/m).
    pub stiffness: f64,
    /// Position at which the spring is at rest, rad (m).
    pub rest: f64,
}

/// A moving joint with its body.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Name in the description; ports are named after it.
    pub name: String,
    /// Motion that the joint allows.
    pub kind: Kind,
    /// Parent joint, with a smaller index; `None` on the base.
    pub parent: Option<usize>,
    /// Frame of the body at position 0, in the parent's frame.
    pub place: Pose,
    /// Unit vector along the axis, in the body's frame.
    pub axis: V3,
    /// Mass and moments of the body, in its frame, including everything fixed to it.
    pub body: Inertia,
    /// Rotor inertia, friction and spring.
    pub passive: PassiveForces,
}

/// A named frame: a link of the description.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Link name in the description.
    pub name: String,
    /// Joint that carries the link; `None` for a link fixed to the base.
    pub joint: Option<usize>,
    /// Pose in the body of that joint.
    pub pose: Pose,
}

/// A robot on a fixed base.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name of the model, for the title of the source.
    pub name: String,
    /// Name of the link that does not move.
    pub base: String,
    /// Moving joints, parents first.
    pub joints: Vec<Joint>,
    /// All links, fixed ones included.
    pub frames: Vec<Frame>,
    /// Acceleration of free fall in the base's frame, m/s².
    pub gravity: V3,
    /// Decisions of the reader, reported to the user.
    pub notes: Vec<String>,
}

/// Reads a robot in URDF or MJCF, according to the root element, with the files that it includes. Angles within `snap` of a multiple of π/2
/// are rounded to it.
///
/// # Errors
/// If the text is neither, or has parts that the equations cannot express, with the line.
pub fn read(text: &str, snap: f64, files: Files<'_>) -> Result<Tree, Error> {
    let source = Source::of(text, files)?;
    let tree =
        xml::parse(&source.text).and_then(|document| match document.root_element().tag_name().name() {
            "mujoco" => mjcf::from_xml(&document, &source, snap),
            _ => urdf::from_xml(&document, snap),
        });
    tree.map_err(|error| source.placed(error))
}

/// Standard gravity in robot models, m/s².
pub const GRAVITY: f64 = 9.81;
/// Maximum number of moving joints of a robot.
pub const MAX_JOINTS: usize = 128;
/// Maximum number of links of a description, and of joints, fixed ones included.
pub const MAX_LINKS: usize = 4096;

impl Robot {
    /// Finds a link by name.
    pub fn frame(&self, name: &str) -> Option<&Frame> {
        self.frames.iter().find(|frame| frame.name == name)
    }

    /// Joints that carry no other.
    pub fn leaves(&self) -> Vec<usize> {
        (0..self.joints.len())
            .filter(|&joint| !self.joints.iter().any(|other| other.parent == Some(joint)))
            .collect()
    }
}
