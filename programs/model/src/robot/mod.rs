// SPDX-License-Identifier: MIT OR Apache-2.0
//! A robot: a tree of joints that move, each with the body behind it. Fixed joints are merged away. The files of this folder make
//! a [`Robot`] and import it from here, which re-exports what they read: together they are one module.

pub mod dh;
pub mod frames;
pub mod mjcf;
mod nesting;
pub mod space;
mod tree;
pub mod urdf;
pub mod xml;

pub(crate) use tree::list;
pub use tree::{Element, ElementKind, Tree};

use crate::Error;
use space::{Inertia, Pose, V3};

/// The motion that a joint allows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// It turns: revolute and continuous joints.
    Revolute,
    /// It slides.
    Prismatic,
}

impl Kind {
    /// The unit of its position.
    pub fn unit(self) -> &'static str {
        match self {
            Kind::Revolute => "rad",
            Kind::Prismatic => "m",
        }
    }

    /// The unit of its force.
    pub fn force(self) -> &'static str {
        match self {
            Kind::Revolute => "N m",
            Kind::Prismatic => "N",
        }
    }
}

/// A joint's rotor and passive forces, as MuJoCo has them.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct Passive {
    /// Inertia of the motor's rotor behind the gear, kg m² (kg of one that slides).
    pub armature: f64,
    /// Viscous friction, N m s (N s/m).
    pub damping: f64,
    /// Coulomb friction, N m (N).
    pub friction: f64,
    /// Of a spring, N m/rad (N/m).
    pub stiffness: f64,
    /// The position at which the spring is at rest.
    pub rest: f64,
}

/// A joint that moves, and the body that it carries.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// The motion that it allows.
    pub kind: Kind,
    /// The joint that carries it, which comes before it; none for one on the base.
    pub parent: Option<usize>,
    /// The body's frame at position 0, in that of the joint that carries it.
    pub place: Pose,
    /// The direction of its axis in its body's frame, of length 1.
    pub axis: V3,
    /// Mass and moments of its body, all that is fixed to it included, in its frame.
    pub body: Inertia,
    /// The forces that act in it by themselves.
    pub passive: Passive,
}

/// A named frame: a link of the description.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The link's name.
    pub name: String,
    /// The joint that carries it; none for one that is fixed to the base.
    pub joint: Option<usize>,
    /// Its place in that joint's body.
    pub pose: Pose,
}

/// A robot on a fixed base.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// The link that does not move.
    pub base: String,
    /// The joints, those that carry others first.
    pub joints: Vec<Joint>,
    /// The links.
    pub frames: Vec<Frame>,
    /// Acceleration of free fall in the base's frame, m/s².
    pub gravity: V3,
    /// The decisions on the way, to be told.
    pub notes: Vec<String>,
}

/// A robot's description in URDF or MJCF, whichever its first element says it is. Angles within `snap` of a multiple of π/2 are
/// taken for it.
///
/// # Errors
/// If it is neither, or has what the equations cannot express, with the line.
pub fn read(source: &str, snap: f64) -> Result<Tree, Error> {
    let document = xml::parse(source)?;
    match document.root_element().tag_name().name() {
        "mujoco" => mjcf::from_xml(&document, snap),
        _ => urdf::from_xml(&document, source, snap),
    }
}

/// Standard gravity as robot models have it, m/s².
pub const GRAVITY: f64 = 9.81;
/// Joints that move which a robot may have.
pub const MAX_JOINTS: usize = 128;
/// Links that a description may have, and joints, fixed ones included.
pub const MAX_LINKS: usize = 4096;

impl Robot {
    /// The link of a name.
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
