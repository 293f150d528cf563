// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robots from URDF.

use super::space::{self, Inertia, Pose};
use super::tree::{Element, ElementKind, Tree, rotation};
use super::{GRAVITY, Kind, MAX_LINKS, Passive, xml};
use crate::Error;
use roxmltree::Document;

/// The largest distance from a multiple of a quarter turn at which an angle is taken for it, rad: descriptions write π/2 with 6 to 16 digits.
pub const SNAP: f64 = 1e-6;
/// The most that it may be, rad: beyond, it would be another geometry.
pub const MAX_SNAP: f64 = 0.01;

/// A robot's description in URDF. Angles within `snap` of a multiple of π/2 are taken for it.
///
/// # Errors
/// If it is not URDF, or has what the equations cannot express, with the line of the joint or link.
pub fn read(source: &str, snap: f64) -> Result<Tree, Error> {
    from_xml(&xml::parse(source)?, source, snap)
}

/// The same of a text that was read as XML.
pub(super) fn from_xml(document: &Document<'_>, source: &str, snap: f64) -> Result<Tree, Error> {
    if document.root_element().tag_name().name() != "robot" {
        let name = document.root_element().tag_name().name();
        return Err(Error::plain(format!("this is no URDF: its element is `{name}`, not `robot`")));
    }
    for (element, what) in [("link", "links"), ("joint", "joints, fixed ones included")] {
        let mut all = document.root_element().children().filter(|child| child.has_tag_name(element));
        if let Some(one) = all.nth(MAX_LINKS) {
            let line = xml::line(one);
            let text = format!("the robot has more than {MAX_LINKS} {what}: leave out what does not move");
            return Err(Error::on(line, text));
        }
    }
    let robot = urdf_rs::read_from_string(source).map_err(|error| not_urdf(source, &error.to_string()))?;
    convert(&robot, snap).map_err(|error| error.located(source))
}

/// The parser's message, with the line of the value that it quotes.
fn not_urdf(source: &str, message: &str) -> Error {
    let text = message.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("it cannot be read");
    let text = format!("this is no URDF: {}", text.strip_prefix("custom: ").unwrap_or(text));
    let quoted = message.rsplit_once('[').and_then(|(_, rest)| rest.split_once(']')).map(|(value, _)| value);
    let at = quoted.and_then(|value| source.find(&format!("\"{value}\"")));
    match at {
        Some(at) => Error::on(1 + source[..at].matches('\n').count(), text),
        None => Error::plain(text),
    }
}

/// The joints that are read.
const KNOWN: &str = "revolute, continuous, prismatic and fixed ones";

fn convert(robot: &urdf_rs::Robot, snap: f64) -> Result<Tree, Error> {
    let mut snapped = 0;
    let mut pose = |name: &str, origin: &urdf_rs::Pose| {
        if !origin.xyz.iter().chain(origin.rpy.iter()).all(|x| x.is_finite()) {
            return Err(Error::at(name, "its origin is not finite"));
        }
        let (rotation, count) = rotation(*origin.rpy, snap);
        snapped += count;
        Ok(Pose { rotation, origin: *origin.xyz })
    };
    if robot.links.is_empty() {
        return Err(Error::plain("the robot has no link"));
    }
    let mut links: Vec<(String, Inertia)> = Vec::new();
    let mut names = std::collections::HashSet::new();
    for link in &robot.links {
        if !names.insert(&link.name) {
            return Err(Error::at(&link.name, "two links have this name"));
        }
        let mass = link.inertial.mass.value;
        if !(mass.is_finite() && mass >= 0.0) {
            return Err(Error::at(
                &link.name,
                format!("its mass is {mass}; a mass is finite and not negative"),
            ));
        }
        let i = &link.inertial.inertia;
        let tensor = [[i.ixx, i.ixy, i.ixz], [i.ixy, i.iyy, i.iyz], [i.ixz, i.iyz, i.izz]];
        if !tensor.iter().flatten().all(|x| x.is_finite()) {
            return Err(Error::at(&link.name, "its inertia is not finite"));
        }
        let frame = pose(&link.name, &link.inertial.origin)?;
        links.push((link.name.clone(), Inertia::new(mass, [0.0; 3], &tensor).outside(&frame)));
    }
    let mut joints: Vec<Element> = Vec::new();
    let mut notes = Vec::new();
    let mut names = std::collections::HashSet::new();
    for joint in &robot.joints {
        use urdf_rs::JointType;
        let name = &joint.name;
        if !names.insert(name) {
            return Err(Error::at(name, "two joints have this name"));
        }
        let kind = match joint.joint_type {
            JointType::Revolute | JointType::Continuous => ElementKind::Moves(Kind::Revolute),
            JointType::Prismatic => ElementKind::Moves(Kind::Prismatic),
            JointType::Fixed => ElementKind::Fixed,
            JointType::Floating => ElementKind::Refused("a floating joint", KNOWN),
            JointType::Planar => ElementKind::Refused("a planar joint", KNOWN),
            JointType::Spherical => ElementKind::Refused("a spherical joint", KNOWN),
        };
        if let Some(mimic) = &joint.mimic {
            notes.push(format!("`{name}` mimics `{}`: it is a joint of its own here", mimic.joint));
        }
        let Pose { rotation, origin } = pose(name, &joint.origin)?;
        joints.push(Element {
            name: name.clone(),
            kind,
            parent: joint.parent.link.clone(),
            child: joint.child.link.clone(),
            origin,
            rotation: space::cleaned(&rotation),
            axis: *joint.axis.xyz,
            passive: Passive::default(),
            line: None,
        });
    }
    if snapped > 0 {
        notes.push(format!("{snapped} angles within {snap} rad of a quarter turn were taken for it"));
    }
    Ok(Tree { name: robot.name.clone(), links, joints, gravity: [0.0, 0.0, -GRAVITY], notes })
}
