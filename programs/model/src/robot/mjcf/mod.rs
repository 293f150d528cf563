// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robots from MJCF, MuJoCo's format: bodies within bodies, attributes with defaults by class. There is no crate that reads it without
//! MuJoCo itself, which is C++.

mod attributes;
mod bodies;
mod shapes;

use super::tree::Tree;
use super::xml::line;
use super::{GRAVITY, MAX_LINKS};
use crate::Error;
use attributes::{Classes, word};
use roxmltree::{Document, Node};

/// The link that does not move.
const WORLD: &str = "world";
/// The advice to make one file of a model, for parts that are not read here.
const REMEDY: &str = "MuJoCo writes a model without it: mujoco.mj_saveLastXML";

/// The settings of `compiler`.
#[derive(Clone, Copy)]
struct Compiler {
    /// The unit of angles, rad.
    angle: f64,
    /// The axes of Euler angles, 0 to 2, and true if they stay where they are.
    euler: [(usize, bool); 3],
    /// Bodies take mass and inertia from their shapes: always, never, or where nothing is stated.
    from_shapes: Option<bool>,
    /// The groups of the shapes that have mass.
    groups: (f64, f64),
}

/// The state of a reading.
struct Reader<'a> {
    compiler: Compiler,
    classes: Classes<'a>,
    snap: f64,
    snapped: usize,
    tree: Tree,
    /// The names that were given: links and joints.
    names: [std::collections::HashSet<String>; 2],
}

/// The robot of a document whose first element is `mujoco`.
pub(super) fn from_xml(document: &Document<'_>, snap: f64) -> Result<Tree, Error> {
    let root = document.root_element();
    if let Some(include) = document.descendants().find(|node| node.has_tag_name("include")) {
        return Err(Error::on(line(include), format!("`include` is not read: {REMEDY}")));
    }
    let mut tree = Tree {
        name: root.attribute("model").unwrap_or("robot").to_owned(),
        links: vec![(WORLD.to_owned(), super::space::Inertia::default())],
        joints: Vec::new(),
        gravity: [0.0, 0.0, -GRAVITY],
        notes: Vec::new(),
    };
    let sections = |name: &'static str| root.children().filter(move |child| child.has_tag_name(name));
    let mut compiler = Compiler {
        angle: 1_f64.to_radians(),
        euler: [(0, false), (1, false), (2, false)],
        from_shapes: None,
        groups: (0.0, 5.0),
    };
    for section in sections("compiler") {
        settings(section, &mut compiler)?;
    }
    for section in sections("option") {
        forces(section, &mut tree)?;
    }
    if tree.gravity != [0.0, 0.0, -GRAVITY] {
        let [x, y, z] = tree.gravity;
        tree.notes.push(format!("gravity is {x} {y} {z} m/s²"));
    }
    let mut ignored = |section: &'static str, tags: &[&str], what: &str| {
        let found = sections(section).flat_map(|section| section.children());
        let mut found = found
            .filter(|node| node.is_element() && (tags.is_empty() || tags.contains(&node.tag_name().name())));
        if let Some(first) = found.next() {
            let more = found.count();
            let more = if more == 0 { String::new() } else { format!(" and {more} more") };
            tree.notes.push(format!("{what} are ignored: that on line {}{more}", line(first)));
        }
    };
    ignored("equality", &[], "equality constraints, by which joints depend on one another,");
    ignored("tendon", &[], "tendons");
    let mut reader = Reader {
        classes: Classes::read(sections("default"))?,
        compiler,
        snap,
        snapped: 0,
        tree,
        names: Default::default(),
    };
    reader.names[0].insert(WORLD.to_owned());
    let mut worlds = 0;
    for world in sections("worldbody") {
        worlds += 1;
        reader.world(world)?;
    }
    if worlds == 0 {
        return Err(Error::plain("the model has no `worldbody`, in which the bodies are"));
    }
    if reader.snapped > 0 {
        let text =
            format!("{} rotations within {snap} rad of quarter turns were taken for them", reader.snapped);
        reader.tree.notes.push(text);
    }
    Ok(reader.tree)
}

/// Reads `compiler`.
fn settings(node: Node<'_, '_>, compiler: &mut Compiler) -> Result<(), Error> {
    let wrong = |name: &str, value: &str, known: &str| {
        Error::on(line(node), format!("`{name}` is `{value}`: {known}"))
    };
    for attribute in node.attributes() {
        let (name, value) = (attribute.name(), attribute.value().trim());
        match name {
            "angle" => {
                compiler.angle = match value {
                    "radian" => 1.0,
                    "degree" => 1_f64.to_radians(),
                    _ => return Err(wrong(name, value, "`radian` and `degree` are known")),
                }
            }
            "eulerseq" => {
                let axis = |letter: u8| {
                    Some((
                        (b"xyz".iter().position(|x| *x == letter.to_ascii_lowercase()))?,
                        letter.is_ascii_uppercase(),
                    ))
                };
                let axes: Option<Vec<_>> = value.bytes().map(axis).collect();
                let axes = axes.and_then(|axes| <[_; 3]>::try_from(axes).ok());
                compiler.euler = axes
                    .ok_or_else(|| wrong(name, value, "three of the letters x, y, z, X, Y, Z are needed"))?;
            }
            "inertiafromgeom" => {
                compiler.from_shapes = match value {
                    "auto" => None,
                    "true" => Some(true),
                    "false" => Some(false),
                    _ => return Err(wrong(name, value, "`auto`, `true` and `false` are known")),
                }
            }
            "inertiagrouprange" => {
                let [low, high] = attributes::numbers(node, name, value)?;
                compiler.groups = (low, high);
            }
            "coordinate" if value != "local" => {
                return Err(wrong(name, value, "positions are in the frames of the bodies, `local`"));
            }
            // These change masses and inertias behind the file's back.
            "boundmass" | "boundinertia" | "balanceinertia" | "settotalmass" => {
                let off = match value {
                    "false" => true,
                    value => value.parse::<f64>().is_ok_and(|value| value <= 0.0),
                };
                if !off {
                    return Err(wrong(name, value, &format!("masses are read as they are; {REMEDY}")));
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// Reads `option`.
fn forces(node: Node<'_, '_>, tree: &mut Tree) -> Result<(), Error> {
    if let Some(value) = node.attribute("gravity") {
        tree.gravity = attributes::numbers(node, "gravity", value)?;
    }
    for name in ["density", "viscosity"] {
        if let Some(value) = node.attribute(name) {
            let [size] = attributes::numbers(node, name, value)?;
            if size != 0.0 {
                tree.notes.push("forces of the medium (`density`, `viscosity`) are ignored".to_owned());
            }
        }
    }
    let flags = node.children().filter(|child| child.has_tag_name("flag"));
    if flags.filter_map(|flag| word(flag, "gravity")).any(|word| word == "disable") {
        tree.gravity = [0.0; 3];
    }
    Ok(())
}

impl Reader<'_> {
    /// Gives a name, once: to a link or a joint.
    fn name(&mut self, joint: bool, name: &str, at: usize) -> Result<String, Error> {
        let names = &mut self.names[usize::from(joint)];
        let what = if joint { "joints" } else { "bodies" };
        if names.len() >= MAX_LINKS {
            return Err(Error::on(at, format!("the robot has more than {MAX_LINKS} {what}")));
        }
        match names.insert(name.to_owned()) {
            true => Ok(name.to_owned()),
            false => Err(Error::on(at, format!("`{name}`: two {what} have this name"))),
        }
    }
}
