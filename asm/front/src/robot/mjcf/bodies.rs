// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nested bodies as links and joints. A body may have several joints, which move one after the other, each about an anchor of its own:
//! massless links join them.

use super::super::space::{self, IDENTITY, Inertia, Pose, V3};
use super::super::tree::{Element, ElementKind};
use super::super::xml::numbers;
use super::super::{Kind, PassiveForces};
use super::attributes::about;
use super::{Reader, WORLD, table};
use crate::Error;
use roxmltree::Node;

/// Element of a body, with its frame relative to the body, and its class of defaults.
struct Item<'a, 'i> {
    node: Node<'a, 'i>,
    frame: Pose,
    class: usize,
}

/// Surroundings of a body: the link that carries it, the frame around it relative to that link, the class of defaults, and whether a
/// joint carries it.
#[derive(Clone, Copy)]
struct Scope<'s> {
    link: &'s str,
    frame: Pose,
    class: usize,
    moves: bool,
}

impl<'a, 'i: 'a> Reader<'a> {
    /// Reads the bodies of a `worldbody`.
    pub(super) fn world(&mut self, node: Node<'a, 'i>) -> Result<(), Error> {
        let class = self.class(node, 0)?;
        for item in self.items(node, Pose::IDENTITY, class)? {
            if item.node.has_tag_name("body") {
                let scope = Scope { link: WORLD, frame: item.frame, class: item.class, moves: false };
                self.body(item.node, scope)?;
            }
        }
        Ok(())
    }

    /// Class of defaults for the contents of an element.
    fn class(&self, node: Node<'a, 'i>, around: usize) -> Result<usize, Error> {
        node.attribute("childclass").map_or(Ok(around), |name| self.classes.named(node, name))
    }

    /// Elements of a body, including those inside frames.
    fn items(&mut self, node: Node<'a, 'i>, frame: Pose, class: usize) -> Result<Vec<Item<'a, 'i>>, Error> {
        table::check(if node.has_tag_name("frame") { "frame" } else { "body" }, node)?;
        let mut items = Vec::new();
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                kind @ ("geom" | "inertial") => {
                    table::check(kind, child)?;
                    items.push(Item { node: child, frame, class });
                }
                "frame" => {
                    let inner = frame.then(&self.pose(child, class)?);
                    let class = self.class(child, class)?;
                    items.extend(self.items(child, inner, class)?);
                }
                _ => items.push(Item { node: child, frame, class }),
            }
        }
        Ok(items)
    }

    fn body(&mut self, node: Node<'a, 'i>, scope: Scope<'_>) -> Result<(), Error> {
        let at = self.lines.at(node);
        let place = || format!("body of {}", self.source.words(at));
        let name = node.attribute("name").map_or_else(place, str::to_owned);
        let name = self.name(false, &name, at)?;
        let mut pose = scope.frame.then(&self.pose(node, scope.class)?);
        if let Some(value) = node.attribute("gravcomp").filter(|_| !self.options.is_bare()) {
            let [lift] = numbers(node, "gravcomp", value)?;
            self.tree.lifted.insert(name.clone(), lift);
        }
        let class = self.class(node, scope.class)?;
        let items = self.items(node, Pose::IDENTITY, class)?;
        let joints = |item: &&Item<'_, '_>| matches!(item.node.tag_name().name(), "joint" | "freejoint");
        let count = items.iter().filter(joints).count();
        let moves = scope.moves || count > 0;
        let mut carrier = scope.link.to_owned();
        for (index, item) in items.iter().filter(joints).enumerate() {
            let (mut joint, rest) = self.joint(item, pose, &name)?;
            let last = index + 1 == count && rest == Pose::IDENTITY;
            joint.parent = carrier;
            joint.child = if last { name.clone() } else { self.between(&name, &joint)? };
            carrier = joint.child.clone();
            pose = rest;
            self.tree.joints.push(joint);
        }
        if carrier != name {
            let weld = Element {
                name: name.clone(),
                kind: ElementKind::Fixed,
                parent: carrier,
                child: name.clone(),
                origin: pose.origin,
                rotation: space::cleaned(&pose.rotation),
                axis: [0.0, 0.0, 1.0],
                passive: PassiveForces::default(),
                file: None,
                line: Some(at),
            };
            self.tree.joints.push(weld);
        }
        // Joints never feel the inertia of a body that does not move.
        let body = if moves { self.mass(&items)? } else { Inertia::default() };
        self.tree.links.push((name.clone(), body));
        for item in items.iter().filter(|item| item.node.has_tag_name("body")) {
            self.body(item.node, Scope { link: &name, frame: item.frame, class: item.class, moves })?;
        }
        Ok(())
    }

    /// Adds a massless link after a joint that is not the body's last.
    fn between(&mut self, body: &str, joint: &Element) -> Result<String, Error> {
        let name = self.name(false, &format!("{body}/{}", joint.name), joint.line.unwrap_or(0))?;
        self.tree.links.push((name.clone(), Inertia::default()));
        Ok(name)
    }

    fn mass(&mut self, items: &[Item<'a, 'i>]) -> Result<Inertia, Error> {
        let stated = items.iter().find(|item| item.node.has_tag_name("inertial"));
        if let Some(item) = stated.filter(|_| self.compiler.from_shapes != Some(true)) {
            return Ok(self.inertial(item.node, item.class)?.outside(&item.frame));
        }
        let mut whole = Inertia::default();
        if self.compiler.from_shapes != Some(false) {
            for item in items.iter().filter(|item| item.node.has_tag_name("geom")) {
                whole = whole.plus(&self.shape(item.node, item.class)?.outside(&item.frame));
            }
        }
        Ok(whole)
    }

    /// Reads a joint. `pose` is the body's pose before the joint moves; the returned pose is the body's after the joint.
    fn joint(&mut self, item: &Item<'a, 'i>, pose: Pose, body: &str) -> Result<(Element, Pose), Error> {
        let Item { node, frame, class } = *item;
        let at = self.lines.at(node);
        let free = node.has_tag_name("freejoint");
        table::check(if free { "freejoint" } else { "joint" }, node)?;
        let kind =
            if free { "free" } else { self.classes.value(node, class, "type")?.unwrap_or("hinge").trim() };
        let kind = match kind {
            "hinge" => ElementKind::Moves(Kind::Revolute),
            "slide" => ElementKind::Moves(Kind::Prismatic),
            "free" => ElementKind::Floating("a free joint", "hinges and slides"),
            "ball" => ElementKind::Refused("a ball joint", "hinges and slides"),
            other => return Err(Error::on(at, format!("there is no joint `{other}`"))),
        };
        let name = match (node.attribute("name").filter(|name| !name.is_empty()), kind) {
            (Some(name), _) => name.to_owned(),
            (None, ElementKind::Refused(..) | ElementKind::Floating(..)) => format!("joint of {body}"),
            (None, _) => {
                return Err(Error::on(at, "this joint has no `name`, which its ports need"));
            }
        };
        let name = self.name(true, &name, at)?;
        let mut joint = Element {
            name,
            kind,
            parent: String::new(),
            child: String::new(),
            origin: pose.origin,
            rotation: space::cleaned(&pose.rotation),
            axis: [0.0, 0.0, 1.0],
            passive: PassiveForces::default(),
            file: None,
            line: Some(at),
        };
        let ElementKind::Moves(moves) = kind else { return Ok((joint, Pose::IDENTITY)) };
        let axis: V3 = self.numbers(node, class, "axis", [0.0, 0.0, 1.0])?;
        let length = space::norm(axis);
        if !(length > 0.0 && length.is_finite()) {
            return Err(Error::on(at, format!("`{}`: its axis has no direction", joint.name)));
        }
        joint.axis = space::turn(&frame.rotation, axis.map(|x| x / length));
        joint.axis = space::cleaned_vector(joint.axis, 1.0);
        let unit = if moves == Kind::Revolute { self.compiler.angle } else { 1.0 };
        let number = |name: &str| self.number(node, class, name, 0.0);
        let zero = unit * number("ref")?;
        joint.passive = PassiveForces {
            armature: number("armature")?,
            damping: self.linear(node, class, "damping")?,
            friction: number("frictionloss")?,
            stiffness: self.linear(node, class, "stiffness")?,
            rest: unit * number("springref")?,
        };
        let PassiveForces { armature, damping, friction, stiffness, .. } = joint.passive;
        let stated = [
            ("armature", armature),
            ("damping", damping),
            ("frictionloss", friction),
            ("stiffness", stiffness),
        ];
        if let Some((name, value)) = stated.iter().find(|(_, value)| *value < 0.0) {
            return Err(Error::on(
                at,
                format!("`{}`: `{name}` is {value}; it must not be negative", joint.name),
            ));
        }
        for (name, why) in table::refused("joint") {
            if self.classes.value(node, class, name)?.is_some_and(|value| !table::is_neutral(value)) {
                let why = if why.is_empty() { "leave it out" } else { why };
                return Err(Error::on(at, format!("`{}`: `{name}` is not read: {why}", joint.name)));
            }
        }
        if self.classes.value(node, class, "actuatorgravcomp")?.is_some_and(|value| value.trim() == "true") {
            self.tree.lifting.insert(joint.name.clone());
        }
        let (moved, rest) = match moves {
            Kind::Revolute => {
                let anchor = frame.point(self.numbers(node, class, "pos", [0.0; 3])?);
                let moved = Pose { rotation: about(joint.axis, -zero), origin: anchor };
                (moved, Pose { rotation: IDENTITY, origin: space::scale(-1.0, anchor) })
            }
            Kind::Prismatic => {
                let moved = Pose { rotation: IDENTITY, origin: space::scale(-zero, joint.axis) };
                (moved, Pose::IDENTITY)
            }
        };
        let place = pose.then(&moved);
        (joint.origin, joint.rotation) = (place.origin, space::cleaned(&place.rotation));
        // Adding 0 turns -0 into 0, so that the comparison with the identity holds for a body without an anchor.
        let rest = Pose { origin: rest.origin.map(|x| x + 0.0), ..rest };
        Ok((joint, rest))
    }
}
