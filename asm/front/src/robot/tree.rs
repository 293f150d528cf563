// SPDX-License-Identifier: MIT OR Apache-2.0
//! Links and joints of a description, and the robot made of a part of them.

use super::space::{self, IDENTITY, Inertia, M3, Pose, V3};
use super::{Frame, Joint, Kind, MAX_JOINTS, PassiveForces, Robot};
use crate::Error;
use std::collections::{HashMap, HashSet};

/// Motion of a joint in a description.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ElementKind {
    /// Motion along or about the axis.
    Moves(Kind),
    /// No motion: the child is fixed to the parent.
    Fixed,
    /// Free base: names of the joint's kind and of the supported kinds, for a message.
    Floating(&'static str, &'static str),
    /// Free base that [`Tree::held`] fixed.
    Held,
    /// Unsupported motion: names of the joint's kind and of the supported kinds, for a message.
    Refused(&'static str, &'static str),
}

/// A joint of a description, with the names of the links that it connects.
#[derive(Clone, Debug)]
pub struct Element {
    /// Name of the joint, unique in the description.
    pub name: String,
    /// Motion that the joint allows.
    pub kind: ElementKind,
    /// Name of the parent link.
    pub parent: String,
    /// Name of the child link.
    pub child: String,
    /// Origin of the child's frame in the parent's at position 0, m.
    pub origin: V3,
    /// Rotation of the child's frame in the parent's at position 0.
    pub rotation: M3,
    /// Axis in the child's frame, not necessarily normalised.
    pub axis: V3,
    /// Rotor inertia, friction and spring.
    pub passive: PassiveForces,
    /// Included file that states the joint; `None` for the main file.
    pub file: Option<String>,
    /// Line of the joint, if known.
    pub line: Option<usize>,
}

impl Element {
    /// An error at this joint.
    fn wrong(&self, text: impl std::fmt::Display) -> Error {
        Error { file: self.file.clone(), line: self.line, ..Error::at(&self.name, text) }
    }
}

/// A description: all links and joints of a file.
#[derive(Clone, Debug)]
pub struct Tree {
    /// Name of the model.
    pub name: String,
    /// Links with their inertias.
    pub links: Vec<(String, Inertia)>,
    /// Joints in any order, fixed ones included.
    pub joints: Vec<Element>,
    /// Acceleration of free fall in the root's frame, m/s².
    pub gravity: V3,
    /// Decisions of the reader, reported to the user.
    pub notes: Vec<String>,
    /// Errors that apply only if one of their joints moves.
    pub conditions: Vec<Condition>,
    /// Fraction of its weight that is taken off each link (`gravcomp`), where not 0.
    pub lifted: HashMap<String, f64>,
    /// Joints whose motors carry the weight taken off by `lifted`.
    pub lifting: HashSet<String>,
}

/// An error about a coupling of joints; it applies only if one of them moves in the chosen part of the robot.
#[derive(Clone, Debug)]
pub struct Condition {
    /// Coupled joints; `None` for all joints.
    pub joints: Option<Vec<String>>,
    /// Error to report in that case.
    pub error: Error,
}

impl Tree {
    /// A description without links.
    pub(super) fn new(name: String, gravity: V3) -> Tree {
        Tree {
            name,
            links: Vec::new(),
            joints: Vec::new(),
            gravity,
            notes: Vec::new(),
            conditions: Vec::new(),
            lifted: HashMap::new(),
            lifting: HashSet::new(),
        }
    }

    /// Fixes the base, where a joint lets it float.
    pub fn held(mut self) -> Tree {
        let mut still: HashSet<String> = self.links.iter().map(|(link, _)| link.clone()).collect();
        for joint in &self.joints {
            still.remove(&joint.child);
        }
        // Fixpoint iteration: joints may be listed in any order.
        loop {
            let before = still.len();
            for joint in &mut self.joints {
                if !still.contains(&joint.parent) {
                    continue;
                }
                if let ElementKind::Floating(..) = joint.kind {
                    joint.kind = ElementKind::Held;
                }
                if matches!(joint.kind, ElementKind::Fixed | ElementKind::Held) {
                    still.insert(joint.child.clone());
                }
            }
            if still.len() == before {
                return self;
            }
        }
    }

    /// Joint that carries each link.
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

    /// Joints from a link up to the root, starting with the link's own.
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

    /// Returns the link that no joint carries.
    fn root(&self, carriers: &HashMap<&str, &Element>) -> Result<&str, Error> {
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
        Ok(root)
    }

    /// Names of the joints from `base` to `tip`.
    fn way<'a>(
        &'a self,
        carriers: &HashMap<&str, &'a Element>,
        base: &str,
        tip: &str,
    ) -> Result<HashSet<&'a str>, Error> {
        let path = self.path(carriers, self.link(tip, "--tip")?)?;
        let end = path.iter().position(|joint| joint.parent == base);
        let end =
            end.ok_or_else(|| Error::plain(format!("--tip: link `{tip}` is not carried by `{base}`")))?;
        Ok(path[..=end].iter().map(|joint| joint.name.as_str()).collect())
    }

    /// Gravity in the frame of `base`, with all joints at 0.
    fn gravity_at(&self, carriers: &HashMap<&str, &Element>, base: &str) -> Result<V3, Error> {
        let fall = space::norm(self.gravity);
        let mut down = self.gravity.map(|x| if fall > 0.0 { x / fall } else { 0.0 });
        for joint in self.path(carriers, base)?.iter().rev() {
            down = space::turn(&space::transpose(&joint.rotation), down);
        }
        Ok(space::scale(fall, space::cleaned_vector(down, 1.0)))
    }

    /// Extracts the robot between `base` (by default the root) and `tip` (by default everything that the base carries). Joints off the path
    /// to the tip, or beyond it, are held at 0. Gravity acts as on the root.
    ///
    /// # Errors
    /// If a link is unknown, the base does not carry the tip, the links are no tree, or nothing moves.
    pub fn robot(&self, base: Option<&str>, tip: Option<&str>) -> Result<Robot, Error> {
        let carriers = self.carriers()?;
        let root = self.root(&carriers)?;
        let base = base.map_or(Ok(root), |name| self.link(name, "--base"))?;
        let way = tip.map(|tip| self.way(&carriers, base, tip)).transpose()?;
        let gravity = self.gravity_at(&carriers, base)?;
        let mut robot = Robot {
            name: self.name.clone(),
            base: base.to_owned(),
            joints: Vec::new(),
            frames: Vec::new(),
            gravity,
            notes: self.notes.clone(),
        };
        let mut children: HashMap<&str, Vec<&Element>> = HashMap::new();
        for joint in &self.joints {
            children.entry(&joint.parent).or_default().push(joint);
        }
        let bodies: HashMap<&str, &Inertia> =
            self.links.iter().map(|(name, body)| (name.as_str(), body)).collect();
        let (mut held, mut floating) = (Vec::new(), Vec::new());
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
                return Err(Error::plain("the links do not form a tree: a link carries itself"));
            }
            robot.frames.push(Frame { name: link.to_owned(), joint: carrier, pose });
            let body = bodies.get(link).map(|body| body.outside(&pose));
            if let (Some(joint), Some(body)) = (carrier, body) {
                let joint: &mut Joint = &mut robot.joints[joint];
                joint.body = joint.body.plus(&body);
            }
            // Children are pushed in reverse, so that the first is visited first.
            for joint in children.get(link).into_iter().flatten().rev() {
                let rest = Pose { rotation: joint.rotation, origin: joint.origin };
                if matches!(joint.kind, ElementKind::Fixed | ElementKind::Held) {
                    if joint.kind == ElementKind::Held {
                        floating.push(joint.name.as_str());
                    }
                    stack.push((&joint.child, Carrier::Known(carrier, pose.then(&rest))));
                    continue;
                }
                if way.as_ref().is_some_and(|way| !way.contains(joint.name.as_str())) {
                    // Branches off the base have no effect.
                    if carrier.is_some() {
                        held.push(joint.name.as_str());
                    }
                    stack.push((&joint.child, Carrier::Known(carrier, pose.then(&rest))));
                    continue;
                }
                let place = pose.then(&rest);
                let moving = moving_joint(joint, carrier, place, robot.joints.len())?;
                stack.extend(moving.map(|moving| (joint.child.as_str(), Carrier::New(moving))));
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
        if !floating.is_empty() {
            let names = list(&floating);
            robot
                .notes
                .push(format!("the base is held, though it floats: {names} (`--floating error` refuses)"));
        }
        self.conditioned(&mut robot)?;
        Ok(robot)
    }
}

/// Joint of a robot with `joints` joints before it, without its body; `None` if the element does not move.
fn moving_joint(
    joint: &Element,
    parent: Option<usize>,
    place: Pose,
    joints: usize,
) -> Result<Option<Joint>, Error> {
    let kind = match joint.kind {
        ElementKind::Moves(kind) => kind,
        ElementKind::Floating(kind, known) | ElementKind::Refused(kind, known) => {
            let text = format!(
                "{kind}: only {known} are known; take the part of the robot behind it with `--base {}`",
                joint.child
            );
            return Err(joint.wrong(text));
        }
        ElementKind::Fixed | ElementKind::Held => return Ok(None),
    };
    let length = space::norm(joint.axis);
    if !(length.is_finite() && length > 1e-9) {
        return Err(joint.wrong("its axis has no direction"));
    }
    if joints >= MAX_JOINTS {
        let text = format!("the robot has more than {MAX_JOINTS} joints; --base and --tip take a part of it");
        return Err(joint.wrong(text));
    }
    Ok(Some(Joint {
        name: joint.name.clone(),
        kind,
        parent,
        place,
        axis: space::scale(1.0 / length, joint.axis),
        passive: joint.passive,
        body: Inertia::default(),
    }))
}

impl Tree {
    /// Checks the conditions, and reduces gravity by the weight that all bodies lack.
    fn conditioned(&self, robot: &mut Robot) -> Result<(), Error> {
        let moves = |name: &str| robot.joints.iter().any(|joint| joint.name == name);
        for Condition { joints, error } in &self.conditions {
            if joints.as_ref().is_none_or(|joints| joints.iter().any(|name| moves(name))) {
                return Err(error.clone());
            }
        }
        let bodies: HashMap<&str, &Inertia> =
            self.links.iter().map(|(name, body)| (name.as_str(), body)).collect();
        let weighs = |frame: &&Frame| {
            frame.joint.is_some() && bodies.get(frame.name.as_str()).is_some_and(|body| body.mass > 0.0)
        };
        let lift = |frame: &Frame| self.lifted.get(&frame.name).copied().unwrap_or(0.0);
        let lifts: Vec<f64> = robot.frames.iter().filter(weighs).map(lift).collect();
        let most = lifts.iter().copied().fold(0.0, f64::max);
        let motors = robot.joints.iter().filter(|joint| self.lifting.contains(&joint.name)).count();
        if lifts.iter().all(|lift| *lift == 0.0) || motors == robot.joints.len() {
            return Ok(());
        }
        if motors > 0 || lifts.iter().any(|lift| *lift != most) {
            let frame = robot.frames.iter().filter(weighs).find(|frame| lift(frame) == most);
            let name = frame.map_or("", |frame| &frame.name);
            let text = "`gravcomp` takes weight off this body and not off all bodies that move, at all joints: leave it out, or state \
                        it for all";
            return Err(Error::at(name, text));
        }
        robot.gravity = robot.gravity.map(|x| x * (1.0 - most) + 0.0);
        robot.notes.push(format!("`gravcomp` takes {} % of their weight off all bodies", 100.0 * most));
        Ok(())
    }
}

/// Joint that carries a link: one with a number, or one that is numbered on this visit, so that numbers follow the order of the description
/// and parents precede children.
enum Carrier {
    Known(Option<usize>, Pose),
    New(Joint),
}

/// Names for a message; beyond 40 names, the number of the others.
pub(crate) fn list(names: &[&str]) -> String {
    /// No more than are readable.
    const SHOWN: usize = 40;
    let mut text = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        text += &format!(" and {} more", names.len() - SHOWN);
    }
    text
}

/// Rotation of roll, pitch and yaw, and the number of angles that were rounded to quarter turns.
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
