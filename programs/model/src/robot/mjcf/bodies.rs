// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bodies within bodies as links and joints. A body may have several joints, which move one after the other, each about an anchor of
//! its own: between them lie links without mass.

use super::super::space::{self, IDENTITY, Inertia, Pose, V3};
use super::super::tree::{Element, ElementKind};
use super::super::xml::line;
use super::super::{Kind, Passive};
use super::attributes::about;
use super::{REMEDY, Reader, WORLD};
use crate::Error;
use roxmltree::Node;

/// An element of a body, with the frame that it is stated in, relative to the body, and the class of its defaults.
struct Item<'a, 'i> {
    node: Node<'a, 'i>,
    frame: Pose,
    class: usize,
}

/// The place of a body: the link that carries it, the frame around it relative to that link, its class of defaults, and true if a
/// joint carries it.
#[derive(Clone, Copy)]
struct Scope<'s> {
    link: &'s str,
    frame: Pose,
    class: usize,
    moves: bool,
}

impl<'a, 'i: 'a> Reader<'a> {
    /// All that the world carries.
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

    /// The class of what is within an element.
    fn class(&self, node: Node<'a, 'i>, around: usize) -> Result<usize, Error> {
        node.attribute("childclass").map_or(Ok(around), |name| self.classes.named(node, name))
    }

    /// The elements of a body, those within frames included.
    fn items(&mut self, node: Node<'a, 'i>, frame: Pose, class: usize) -> Result<Vec<Item<'a, 'i>>, Error> {
        let mut items = Vec::new();
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "frame" => {
                    let inner = frame.then(&self.pose(child, class)?);
                    let class = self.class(child, class)?;
                    items.extend(self.items(child, inner, class)?);
                }
                "replicate" | "attach" | "composite" | "flexcomp" => {
                    let text = format!("`{}` is not read: {REMEDY}", child.tag_name().name());
                    return Err(Error::on(line(child), text));
                }
                _ => items.push(Item { node: child, frame, class }),
            }
        }
        Ok(items)
    }

    fn body(&mut self, node: Node<'a, 'i>, scope: Scope<'_>) -> Result<(), Error> {
        let at = line(node);
        let name = node.attribute("name").map_or_else(|| format!("body of line {at}"), str::to_owned);
        let name = self.name(false, &name, at)?;
        let mut pose = scope.frame.then(&self.pose(node, scope.class)?);
        if node.attribute("gravcomp").is_some_and(|value| value.trim() != "0") {
            self.tree.notes.push(format!("`gravcomp` of `{name}` is ignored: it has its weight"));
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
                passive: Passive::default(),
                line: Some(at),
            };
            self.tree.joints.push(weld);
        }
        // A body that does not move has no inertia that a joint would notice.
        let body = if moves { self.mass(&items)? } else { Inertia::default() };
        self.tree.links.push((name.clone(), body));
        for item in items.iter().filter(|item| item.node.has_tag_name("body")) {
            self.body(item.node, Scope { link: &name, frame: item.frame, class: item.class, moves })?;
        }
        Ok(())
    }

    /// The link behind a joint that is not the body itself.
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

    /// A joint whose body has the pose `pose` before it moves, and the body's pose behind it.
    fn joint(&mut self, item: &Item<'a, 'i>, pose: Pose, body: &str) -> Result<(Element, Pose), Error> {
        let Item { node, frame, class } = *item;
        let at = line(node);
        let free = node.has_tag_name("freejoint");
        let kind =
            if free { "free" } else { self.classes.value(node, class, "type")?.unwrap_or("hinge").trim() };
        let kind = match kind {
            "hinge" => ElementKind::Moves(Kind::Revolute),
            "slide" => ElementKind::Moves(Kind::Prismatic),
            "free" => ElementKind::Refused("a free joint", "hinges and slides"),
            "ball" => ElementKind::Refused("a ball joint", "hinges and slides"),
            other => return Err(Error::on(at, format!("there is no joint `{other}`"))),
        };
        let name = match (node.attribute("name").filter(|name| !name.is_empty()), kind) {
            (Some(name), _) => name.to_owned(),
            (None, ElementKind::Refused(..)) => format!("joint of {body}"),
            (None, _) => {
                return Err(Error::on(at, "a joint without a `name`, after which its ports are named"));
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
            passive: Passive::default(),
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
        joint.passive = Passive {
            armature: number("armature")?,
            damping: number("damping")?,
            friction: number("frictionloss")?,
            stiffness: number("stiffness")?,
            rest: unit * number("springref")?,
        };
        let Passive { armature, damping, friction, stiffness, .. } = joint.passive;
        let stated = [
            ("armature", armature),
            ("damping", damping),
            ("frictionloss", friction),
            ("stiffness", stiffness),
        ];
        if let Some((name, value)) = stated.iter().find(|(_, value)| *value < 0.0) {
            return Err(Error::on(at, format!("`{}`: `{name}` is {value}; it is not negative", joint.name)));
        }
        if self.classes.value(node, class, "springdamper")?.is_some_and(|value| value.trim() != "0 0") {
            let text =
                format!("`{}`: `springdamper` is not read: state `stiffness` and `damping`", joint.name);
            return Err(Error::on(at, text));
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
        // -0 is 0, so that a body without an anchor of its own is its link.
        let rest = Pose { origin: rest.origin.map(|x| x + 0.0), ..rest };
        Ok((joint, rest))
    }
}
