// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reader of URDF. [`TABLE`] lists the treatment of each element: only parts that affect motion are read.

use super::source::Source;
use super::space::{self, Inertia, Pose, V3};
use super::tree::{Element, ElementKind, Tree, list, rotation};
use super::xml::{self, Lines, numbers};
use super::{GRAVITY, Kind, MAX_LINKS, PassiveForces};
use crate::{Error, no_files};
use roxmltree::{Document, Node};
use std::collections::{BTreeSet, HashSet};
use takt_text::readers::{Row, Treatment, fate};

/// Default tolerance within which an angle counts as a multiple of π/2, rad: descriptions write π/2 with 6 to 16 digits.
pub const SNAP: f64 = 1e-6;
/// Largest tolerance that is accepted, rad: a larger one would change the geometry.
pub const MAX_SNAP: f64 = 0.01;

const fn row(of: &'static str, parts: &'static str, fate: Treatment, text: &'static str) -> Row {
    Row { of, parts, fate, text }
}

/// Treatment of each element and attribute of URDF. Unknown parts are ignored with a note, but refused where they could place or weigh a
/// link.
pub const TABLE: &[Row] = &[
    row("robot", "name link joint", Treatment::Computes, ""),
    row(
        "robot",
        "version material transmission gazebo mujoco sensor",
        Treatment::PassesOver,
        "appearance, other programs' settings",
    ),
    row("link", "name inertial", Treatment::Computes, "without `inertial` a link weighs nothing"),
    row("link", "visual collision type", Treatment::PassesOver, "shapes, whatever they contain"),
    row("inertial", "origin mass inertia", Treatment::Computes, "mass and inertia are needed"),
    row(
        "joint",
        "name type origin parent child axis",
        Treatment::Computes,
        "revolute, continuous, prismatic, fixed",
    ),
    row("joint", "limit safety_controller calibration", Treatment::PassesOver, "limits are the host's"),
    row(
        "joint",
        "dynamics",
        Treatment::PassesOver,
        "damping and friction are left out of the equations; a note names their joints",
    ),
    row(
        "joint",
        "mimic",
        Treatment::PassesOver,
        "a joint that mimics another is one of its own; a note names it",
    ),
    row("type", "revolute continuous prismatic fixed", Treatment::Computes, ""),
    row("type", "floating", Treatment::Computes, "held, which a note says; with `--floating error` refused"),
    row("type", "planar spherical", Treatment::Refuses, "unless before `--base` or held"),
    row("origin", "xyz rpy", Treatment::Computes, ""),
    row("axis", "xyz", Treatment::Computes, ""),
    row("mass", "value", Treatment::Computes, ""),
    row("inertia", "ixx ixy ixz iyy iyz izz", Treatment::Computes, "all six are needed"),
    row("parent", "link", Treatment::Computes, ""),
    row("child", "link", Treatment::Computes, ""),
];

/// Elements whose unknown parts are refused, because they may affect motion.
const STRICT: [&str; 7] = ["inertial", "origin", "axis", "mass", "inertia", "parent", "child"];

/// Reads a robot in URDF. Angles within `snap` of a multiple of π/2 are rounded to it.
///
/// # Errors
/// If the text is not URDF, or has parts that the equations cannot express, with the line of the joint or link.
pub fn read(text: &str, snap: f64) -> Result<Tree, Error> {
    let source = Source::of(text, &no_files)?;
    from_xml(&xml::parse(&source.text)?, snap)
}

/// Reads a robot from a parsed XML document.
pub(super) fn from_xml(document: &Document<'_>, snap: f64) -> Result<Tree, Error> {
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        let name = root.tag_name().name();
        return Err(Error::plain(format!("this is not a URDF: its root element is `{name}`, not `robot`")));
    }
    if let Some(macros) = document.descendants().find(is_xacro) {
        let text = "this is a file for xacro, which makes URDF of it: `xacro FILE > robot.urdf`";
        return Err(Error::on(xml::line(macros), text));
    }
    for (element, what) in [("link", "links"), ("joint", "joints, fixed ones included")] {
        if let Some(one) = elements(root, element).nth(MAX_LINKS) {
            let text = format!("the robot has more than {MAX_LINKS} {what}: leave out what does not move");
            return Err(Error::on(xml::line(one), text));
        }
    }
    let mut reader = Reader { snap, ..Reader::default() };
    let (links, joints) = (reader.links(root)?, reader.joints(root, &Lines::of(document.input_text()))?);
    let name = root.attribute("name").unwrap_or("robot").to_owned();
    let gravity = [0.0, 0.0, -GRAVITY];
    reader.pass_over(root)?;
    Ok(Tree { links, joints, notes: reader.notes(), ..Tree::new(name, gravity) })
}

/// The element needs the macro processor xacro.
fn is_xacro(node: &Node<'_, '_>) -> bool {
    let written = |value: &str| value.contains("${") || value.contains("$(");
    let moves = |node: &Node<'_, '_>| STRICT.contains(&node.tag_name().name());
    node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
        || (moves(node) && node.attributes().any(|attribute| written(attribute.value())))
}

/// State of the reader.
#[derive(Default)]
struct Reader {
    snap: f64,
    snapped: usize,
    /// Names of ignored parts: those listed in the table, and others.
    known: BTreeSet<String>,
    unknown: BTreeSet<String>,
    mimics: Vec<String>,
    /// Joints whose friction is left out.
    rough: Vec<String>,
}

impl Reader {
    fn links(&mut self, root: Node<'_, '_>) -> Result<Vec<(String, Inertia)>, Error> {
        let mut links = Vec::new();
        let mut names = HashSet::new();
        for node in elements(root, "link") {
            let name = named(node)?;
            if !names.insert(name) {
                return Err(wrong(node, "two links have this name"));
            }
            self.pass_over(node)?;
            links.push((name.to_owned(), self.body(node)?));
        }
        if links.is_empty() {
            return Err(Error::plain("the robot has no link"));
        }
        Ok(links)
    }

    /// Mass and moments of a link; zeros without `inertial`.
    fn body(&mut self, link: Node<'_, '_>) -> Result<Inertia, Error> {
        let Some(inertial) = only(link, "inertial")? else { return Ok(Inertia::default()) };
        self.pass_over(inertial)?;
        if let Some(origin) = only(inertial, "origin")? {
            self.pass_over(origin)?;
        }
        let needs = |name: &str| {
            let element = only(inertial, name)?;
            element.ok_or_else(|| Error::on(xml::line(inertial), format!("`inertial` needs `{name}`")))
        };
        let (mass, inertia) = (needs("mass")?, needs("inertia")?);
        for part in [mass, inertia] {
            self.pass_over(part)?;
        }
        let mass = self.values::<1>(mass, "value")?[0];
        if mass < 0.0 {
            return Err(wrong(link, format!("its mass is {mass}; a mass must be finite and not negative")));
        }
        let [xx, xy, xz, yy, yz, zz] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
            .map(|name| self.values::<1>(inertia, name).map(|[value]| value));
        let (xx, xy, xz, yy, yz, zz) = (xx?, xy?, xz?, yy?, yz?, zz?);
        let tensor = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        Ok(Inertia::new(mass, [0.0; 3], &tensor).outside(&self.pose(inertial)?))
    }

    fn joints(&mut self, root: Node<'_, '_>, lines: &Lines) -> Result<Vec<Element>, Error> {
        let mut joints: Vec<Element> = Vec::new();
        let mut names = HashSet::new();
        for node in elements(root, "joint") {
            let name = named(node)?;
            if !names.insert(name) {
                return Err(wrong(node, "two joints have this name"));
            }
            self.pass_over(node)?;
            for part in node.children().filter(|child| STRICT.contains(&child.tag_name().name())) {
                self.pass_over(part)?;
            }
            let kind = kind(node)?;
            let end = |end: &str| {
                let element = only(node, end)?.ok_or_else(|| wrong(node, format!("it has no `{end}`")))?;
                let link = element.attribute("link");
                link.map(str::to_owned)
                    .ok_or_else(|| wrong(node, format!("`{end}` needs the attribute `link`")))
            };
            let (parent, child) = (end("parent")?, end("child")?);
            if let Some(mimic) = only(node, "mimic")? {
                let other = mimic.attribute("joint").unwrap_or("another");
                self.mimics.push(format!("`{name}` mimics `{other}`: it is a joint of its own here"));
            }
            let friction = only(node, "dynamics")?.is_some_and(|node| {
                let value =
                    |name: &str| node.attribute(name).and_then(|value| value.trim().parse::<f64>().ok());
                ["damping", "friction"].into_iter().filter_map(value).any(|value| value != 0.0)
            });
            if friction && kind != ElementKind::Fixed {
                self.rough.push(name.to_owned());
            }
            let Pose { rotation, origin } = self.pose(node)?;
            let axis = match only(node, "axis")? {
                Some(axis) if kind != ElementKind::Fixed => self.values::<3>(axis, "xyz")?,
                _ => [1.0, 0.0, 0.0],
            };
            joints.push(Element {
                name: name.to_owned(),
                kind,
                parent,
                child,
                origin,
                rotation: space::cleaned(&rotation),
                axis,
                passive: PassiveForces::default(),
                file: None,
                line: Some(lines.at(node)),
            });
        }
        Ok(joints)
    }

    /// Pose of `origin`; absent parts are 0.
    fn pose(&mut self, node: Node<'_, '_>) -> Result<Pose, Error> {
        let Some(origin) = only(node, "origin")? else { return Ok(Pose::IDENTITY) };
        let part = |name: &str| match origin.attribute(name) {
            Some(_) => self.values::<3>(origin, name),
            None => Ok([0.0; 3]),
        };
        let (xyz, rpy): (V3, V3) = (part("xyz")?, part("rpy")?);
        let (rotation, count) = rotation(rpy, self.snap);
        self.snapped += count;
        Ok(Pose { rotation, origin: xyz })
    }

    /// Numbers of a required attribute.
    fn values<const N: usize>(&self, node: Node<'_, '_>, name: &str) -> Result<[f64; N], Error> {
        let value = node.attribute(name).ok_or_else(|| {
            Error::on(xml::line(node), format!("`{}` needs `{name}`", node.tag_name().name()))
        })?;
        numbers(node, name, value)
    }

    /// Records the names of ignored parts.
    fn pass_over(&mut self, node: Node<'_, '_>) -> Result<(), Error> {
        let of = node.tag_name().name();
        let attributes = node.attributes().filter(|attribute| attribute.namespace().is_none());
        let parts = node.children().filter(Node::is_element).map(|child| child.tag_name().name());
        for part in parts.chain(attributes.map(|attribute| attribute.name())) {
            match fate(TABLE, of, part) {
                Some(Treatment::Computes) => {}
                Some(_) => {
                    self.known.insert(format!("`{part}`"));
                }
                None if STRICT.contains(&of) => {
                    let text = format!("`{part}` of `{of}` is not known: docs/readers.md lists what is read");
                    return Err(Error::on(xml::line(node), text));
                }
                None => {
                    self.unknown.insert(format!("`{part}` of `{of}`"));
                }
            }
        }
        Ok(())
    }

    fn notes(self) -> Vec<String> {
        let joined = |names: BTreeSet<String>| names.into_iter().collect::<Vec<_>>().join(", ");
        let mut notes = self.mimics;
        if !self.rough.is_empty() {
            let names: Vec<&str> = self.rough.iter().map(String::as_str).collect();
            notes.push(format!("damping and friction (`dynamics`) are left out: of {}", list(&names)));
        }
        if self.snapped > 0 {
            let (snapped, snap) = (self.snapped, self.snap);
            notes.push(format!("{snapped} angles within {snap} rad of a quarter turn were taken for it"));
        }
        if !self.known.is_empty() {
            notes.push(format!("passed over: {}", joined(self.known)));
        }
        if !self.unknown.is_empty() {
            notes.push(format!("passed over, unknown here: {}", joined(self.unknown)));
        }
        notes
    }
}

/// Motion of a joint, from its `type`.
fn kind(node: Node<'_, '_>) -> Result<ElementKind, Error> {
    const KNOWN: &str = "revolute, continuous, prismatic and fixed ones";
    let name = node.attribute("type").ok_or_else(|| wrong(node, "it has no `type`"))?.trim();
    Ok(match name {
        "revolute" | "continuous" => ElementKind::Moves(Kind::Revolute),
        "prismatic" => ElementKind::Moves(Kind::Prismatic),
        "fixed" => ElementKind::Fixed,
        "floating" => ElementKind::Floating("a floating joint", KNOWN),
        "planar" => ElementKind::Refused("a planar joint", KNOWN),
        "spherical" => ElementKind::Refused("a spherical joint", KNOWN),
        other => {
            let text = format!("`{other}` is not a type of joint; there are {KNOWN}, floating and planar");
            return Err(wrong(node, text));
        }
    })
}

fn elements<'a, 'i>(
    node: Node<'a, 'i>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'i>> + use<'a, 'i> {
    node.children().filter(move |child| child.has_tag_name(name))
}

/// Child element that may occur once at most.
fn only<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Result<Option<Node<'a, 'i>>, Error> {
    let mut found = node.children().filter(|child| child.is_element() && child.tag_name().name() == name);
    let first = found.next();
    match found.next() {
        Some(second) => Err(Error::on(xml::line(second), format!("a second `{name}`; only one is allowed"))),
        None => Ok(first),
    }
}

fn named<'a>(node: Node<'a, '_>) -> Result<&'a str, Error> {
    let name = node.attribute("name").filter(|name| !name.is_empty());
    name.ok_or_else(|| Error::on(xml::line(node), format!("a {} without a `name`", node.tag_name().name())))
}

/// An error at a joint or link.
fn wrong(node: Node<'_, '_>, text: impl std::fmt::Display) -> Error {
    let error = Error::at(node.attribute("name").unwrap_or_default(), text);
    Error { line: Some(xml::line(node)), ..error }
}
