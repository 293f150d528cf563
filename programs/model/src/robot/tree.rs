// SPDX-License-Identifier: MIT OR Apache-2.0
//! Links and joints as a description has them, and the robot that a part of them makes.

use super::space::{self, IDENTITY, Inertia, M3, Pose, V3};
use super::{Frame, Joint, Kind, MAX_JOINTS, Passive, Robot};
use crate::Error;
use std::collections::{HashMap, HashSet};

/// The motion that the joint of a description allows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ElementKind {
    /// It moves.
    Moves(Kind),
    /// It does not.
    Fixed,
    /// It moves in a way that the equations do not have: its kind, and those that are known.
    Refused(&'static str, &'static str),
}

/// A joint of a description, and the link that it carries.
#[derive(Clone, Debug)]
pub struct Element {
    /// The joint's name.
    pub name: String,
    /// The motion that it allows.
    pub kind: ElementKind,
    /// The link that carries it.
    pub parent: String,
    /// The link that it carries.
    pub child: String,
    /// The child's frame at position 0 in the parent's: origin in m, and roll, pitch, yaw in rad.
    pub origin: V3,
    /// Its rotation.
    pub rotation: M3,
    /// The axis, in the child's frame; of any length but 0.
    pub axis: V3,
    /// The forces that act in it by themselves.
    pub passive: Passive,
    /// The line of the description that it is on, if that is known.
    pub line: Option<usize>,
}

impl Element {
    /// An error about it.
    fn wrong(&self, text: impl std::fmt::Display) -> Error {
        Error { line: self.line, ..Error::at(&self.name, text) }
    }
}

/// A description.
#[derive(Clone, Debug)]
pub struct Tree {
    /// The robot's name.
    pub name: String,
    /// The links and what they weigh.
    pub links: Vec<(String, Inertia)>,
    /// The joints.
    pub joints: Vec<Element>,
    /// Acceleration of free fall in the root's frame, m/s².
    pub gravity: V3,
    /// The decisions on the way, to be told.
    pub notes: Vec<String>,
}

impl Tree {
    /// The joint that carries each link.
    fn carriers(&self) -> Result<HashMap<&str, &Element>, Error> {
        let mut carriers = HashMap::new();
        let known = |name: &str| self.links.iter().any(|(link, _)| link == name);
        for joint in &self.joints {
            for link in [&joint.parent, &joint.child] {
                if !known(link) {
                    return Err(joint.wrong(format!("there is no link `{link}`")));
                }
            }
            if let Some(other) = carriers.insert(joint.child.as_str(), joint) {
                let text = format!(
                    "link `{}` is already carried by joint `{}`: a robot is a tree, without loops",
                    joint.child, other.name
                );
                return Err(joint.wrong(text));
            }
        }
        Ok(carriers)
    }

    /// The joints from a link to the root, that of the link first.
    fn path<'a>(
        &'a self,
        carriers: &HashMap<&str, &'a Element>,
        link: &str,
    ) -> Result<Vec<&'a Element>, Error> {
        let mut path: Vec<&Element> = Vec::new();
        let mut link = link;
        while let Some(joint) = carriers.get(link).copied() {
            path.push(joint);
            link = &joint.parent;
            if path.len() > self.joints.len() {
                return Err(joint.wrong("its link carries itself: a robot is a tree, without loops"));
            }
        }
        Ok(path)
    }

    fn link(&self, name: &str, what: &str) -> Result<&str, Error> {
        self.links.iter().map(|(link, _)| link.as_str()).find(|link| *link == name).ok_or_else(|| {
            let names: Vec<_> = self.links.iter().map(|(link, _)| link.as_str()).collect();
            Error::plain(format!("{what}: there is no link `{name}`; the links are {}", list(&names)))
        })
    }

    /// The robot between `base`, by default the root, and `tip`, by default all that the base carries. Joints that branch off
    /// the way to the tip, or come after it, are held at 0, and gravity acts as it does on the root.
    ///
    /// # Errors
    /// If there is no such link, the tip is not carried by the base, the links are no tree, or there is nothing that moves.
    pub fn robot(&self, base: Option<&str>, tip: Option<&str>) -> Result<Robot, Error> {
        let carriers = self.carriers()?;
        let mut roots =
            self.links.iter().map(|(link, _)| link.as_str()).filter(|link| !carriers.contains_key(link));
        let root = roots
            .next()
            .ok_or_else(|| Error::plain("every link is carried by a joint: a robot is a tree with a base"))?;
        if let Some(other) = roots.next() {
            let text =
                format!("links `{root}` and `{other}` are both carried by no joint: a robot has one base");
            return Err(Error::plain(text));
        }
        let base = base.map_or(Ok(root), |name| self.link(name, "--base"))?;
        let way = match tip {
            None => None,
            Some(tip) => {
                let path = self.path(&carriers, self.link(tip, "--tip")?)?;
                let end = path.iter().position(|joint| joint.parent == base);
                let end = end
                    .ok_or_else(|| Error::plain(format!("--tip: link `{tip}` is not carried by `{base}`")))?;
                Some(path[..=end].iter().map(|joint| joint.name.as_str()).collect::<HashSet<_>>())
            }
        };
        // The direction of free fall in the root's frame, as the base sees it with all joints at 0.
        let fall = space::norm(self.gravity);
        let mut down = self.gravity.map(|x| if fall > 0.0 { x / fall } else { 0.0 });
        for joint in self.path(&carriers, base)?.iter().rev() {
            down = space::turn(&space::transpose(&joint.rotation), down);
        }
        let mut robot = Robot {
            name: self.name.clone(),
            base: base.to_owned(),
            joints: Vec::new(),
            frames: Vec::new(),
            gravity: space::scale(fall, space::cleaned_vector(down, 1.0)),
            notes: self.notes.clone(),
        };
        let mut children: HashMap<&str, Vec<&Element>> = HashMap::new();
        for joint in &self.joints {
            children.entry(&joint.parent).or_default().push(joint);
        }
        let bodies: HashMap<&str, &Inertia> =
            self.links.iter().map(|(name, body)| (name.as_str(), body)).collect();
        let mut held = Vec::new();
        let mut stack: Vec<(&str, Carrier)> = vec![(base, Carrier::Known(None, Pose::IDENTITY))];
        let mut seen = 0;
        while let Some((link, carrier)) = stack.pop() {
            let (carrier, pose) = match carrier {
                Carrier::Known(carrier, pose) => (carrier, pose),
                Carrier::New(joint) => {
                    robot.joints.push(joint);
                    (Some(robot.joints.len() - 1), Pose::IDENTITY)
                }
            };
            seen += 1;
            if seen > self.links.len() {
                return Err(Error::plain("the links are no tree: a link carries itself"));
            }
            robot.frames.push(Frame { name: link.to_owned(), joint: carrier, pose });
            let body = bodies.get(link).map(|body| body.outside(&pose));
            if let (Some(joint), Some(body)) = (carrier, body) {
                let joint: &mut Joint = &mut robot.joints[joint];
                joint.body = joint.body.plus(&body);
            }
            // The first joint of a link comes first: the last one pushed.
            for joint in children.get(link).into_iter().flatten().rev() {
                let rest = Pose { rotation: joint.rotation, origin: joint.origin };
                if joint.kind == ElementKind::Fixed {
                    stack.push((&joint.child, Carrier::Known(carrier, pose.then(&rest))));
                    continue;
                }
                if way.as_ref().is_some_and(|way| !way.contains(joint.name.as_str())) {
                    // A branch off the base has no effect.
                    if carrier.is_some() {
                        held.push(joint.name.as_str());
                    }
                    stack.push((&joint.child, Carrier::Known(carrier, pose.then(&rest))));
                    continue;
                }
                let kind = match joint.kind {
                    ElementKind::Moves(kind) => kind,
                    ElementKind::Refused(kind, known) => {
                        let text = format!(
                            "{kind}: only {known} are known; take the part of the robot behind it with --base {}",
                            joint.child
                        );
                        return Err(joint.wrong(text));
                    }
                    ElementKind::Fixed => continue,
                };
                let length = space::norm(joint.axis);
                if !(length.is_finite() && length > 1e-9) {
                    return Err(joint.wrong("its axis has no direction"));
                }
                if robot.joints.len() >= MAX_JOINTS {
                    let text = format!(
                        "the robot has more than {MAX_JOINTS} joints; --base and --tip take a part of it"
                    );
                    return Err(joint.wrong(text));
                }
                let moving = Joint {
                    name: joint.name.clone(),
                    kind,
                    parent: carrier,
                    place: pose.then(&rest),
                    axis: space::scale(1.0 / length, joint.axis),
                    passive: joint.passive,
                    body: Inertia::default(),
                };
                stack.push((&joint.child, Carrier::New(moving)));
            }
        }
        if robot.joints.is_empty() {
            return Err(Error::plain(match tip {
                Some(tip) => format!("no joint moves between `{base}` and `{tip}`"),
                None => format!("no joint that `{base}` carries moves"),
            }));
        }
        if !held.is_empty() {
            robot.notes.push(format!("held at 0: {}", list(&held)));
        }
        Ok(robot)
    }
}

/// The carrier of a link: a joint that has its number, or one that gets it now, so that joints are numbered in the order of the
/// description, each after the one that carries it.
enum Carrier {
    Known(Option<usize>, Pose),
    New(Joint),
}

/// Names for a message, not too many of them.
pub(crate) fn list(names: &[&str]) -> String {
    /// No more than are readable.
    const SHOWN: usize = 40;
    let mut text = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        text += &format!(" and {} more", names.len() - SHOWN);
    }
    text
}

/// The rotation of roll, pitch and yaw, and those of the angles that were taken for quarter turns though they are not quite.
pub(crate) fn rotation(rpy: V3, snap: f64) -> (M3, usize) {
    let mut snapped = 0;
    let [roll, pitch, yaw] = rpy.map(|angle| {
        let turns = (angle / std::f64::consts::FRAC_PI_2).round();
        let whole = turns * std::f64::consts::FRAC_PI_2;
        if angle != whole && (angle - whole).abs() <= snap {
            snapped += 1;
            whole
        } else {
            angle
        }
    });
    let yaw_pitch = space::product(&space::about(2, yaw), &space::about(1, pitch));
    let rotation = space::product(&yaw_pitch, &space::about(0, roll));
    (if rpy == [0.0; 3] { IDENTITY } else { rotation }, snapped)
}
