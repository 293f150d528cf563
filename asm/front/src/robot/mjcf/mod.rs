// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reader of MJCF, MuJoCo's format: nested bodies, attributes with defaults by class. No crate reads MJCF without MuJoCo itself, which is
//! C++. [`TABLE`] lists the treatment of each element and attribute.

mod attributes;
mod bodies;
mod motors;
mod options;
mod shapes;
mod table;

use super::MAX_LINKS;
use super::source::Source;
use super::tree::{Tree, list};
use super::xml::{self, Lines, line};
use crate::Error;
use attributes::Classes;
use options::Options;
use roxmltree::{Document, Node};
use std::collections::BTreeSet;
use takt_text::readers::{Treatment, fate};

pub use table::TABLE;

/// Name of the link that does not move.
const WORLD: &str = "world";
/// Advice for parts that are not read: have MuJoCo resolve them.
const REMEDY: &str = "MuJoCo writes a model without it: mujoco.mj_saveLastXML";

/// Settings of the element `compiler`.
#[derive(Clone, Copy)]
struct Compiler {
    /// Unit of angles, rad.
    angle: f64,
    /// Euler angles: axis of each, 0 to 2, and whether the rotation is extrinsic.
    euler: [(usize, bool); 3],
    /// Bodies take mass and inertia from their shapes: always, never, or (`None`) where nothing is stated.
    from_shapes: Option<bool>,
    /// Range of groups whose shapes have mass.
    groups: (f64, f64),
}

/// State of the reader.
struct Reader<'a> {
    compiler: Compiler,
    options: Options,
    classes: Classes<'a>,
    source: &'a Source,
    lines: Lines,
    snap: f64,
    snapped: usize,
    tree: Tree,
    /// Sections and elements without an effect here.
    passed: BTreeSet<String>,
    /// Names in use: of links and of joints.
    names: [std::collections::HashSet<String>; 2],
}

/// Reads the robot of a document with the root element `mujoco`.
pub(super) fn from_xml(document: &Document<'_>, source: &Source, snap: f64) -> Result<Tree, Error> {
    let root = document.root_element();
    table::check("mujoco", root)?;
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
    let mut options = Options::default();
    for section in sections("option") {
        options.add(section)?;
    }
    let name = root.attribute("model").unwrap_or("robot").to_owned();
    let mut tree = Tree::new(name, options.gravity()?);
    tree.links.push((WORLD.to_owned(), super::space::Inertia::default()));
    tree.notes = options.notes();
    let mut equalities = sections("equality").flat_map(|section| section.children()).filter(Node::is_element);
    if let Some(first) = equalities.next() {
        let more = equalities.count();
        let more = if more == 0 { String::new() } else { format!(" and {more} more") };
        let place = source.words(line(first));
        let text = format!(
            "equality constraints, by which joints depend on one another, are ignored: that on {place}{more}"
        );
        tree.notes.push(text);
    }
    let mut reader = Reader {
        compiler,
        options,
        classes: Classes::read(sections("default"))?,
        source,
        lines: Lines::of(document.input_text()),
        snap,
        snapped: 0,
        tree,
        passed: passed(root),
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
    let tendons: Vec<_> = sections("tendon").collect();
    for section in &tendons {
        reader.tendons(*section)?;
    }
    for section in sections("actuator") {
        reader.actuators(section, &tendons)?;
    }
    Ok(reader.done())
}

/// Sections without an effect here.
fn passed(root: Node<'_, '_>) -> BTreeSet<String> {
    let sections = root.children().filter(Node::is_element).map(|section| section.tag_name().name());
    let passed = sections.filter(|name| fate(TABLE, "mujoco", name) == Some(Treatment::PassesOver));
    passed.filter(|name| *name != "equality").map(str::to_owned).collect()
}

/// Reads the settings of `compiler`.
fn settings(node: Node<'_, '_>, compiler: &mut Compiler) -> Result<(), Error> {
    table::check("compiler", node)?;
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
                    _ => return Err(wrong(name, value, "expected `radian` or `degree`")),
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
                compiler.euler =
                    axes.ok_or_else(|| wrong(name, value, "expected three of the letters x, y, z, X, Y, Z"))?;
            }
            "inertiafromgeom" => {
                compiler.from_shapes = match value {
                    "auto" => None,
                    "true" => Some(true),
                    "false" => Some(false),
                    _ => return Err(wrong(name, value, "expected `auto`, `true` or `false`")),
                }
            }
            "inertiagrouprange" => {
                let [low, high] = xml::numbers(node, name, value)?;
                compiler.groups = (low, high);
            }
            "coordinate" if value != "local" => {
                return Err(wrong(name, value, "expected `local`, positions in the frames of the bodies"));
            }
            _ if fate(TABLE, "compiler", name) == Some(Treatment::Refuses) && !table::is_neutral(value) => {
                return Err(wrong(name, value, &format!("masses are read as they are; {REMEDY}")));
            }
            _ => {}
        }
    }
    Ok(())
}

impl Reader<'_> {
    /// The robot with all notes, and lines mapped back to the files that were read.
    fn done(self) -> Tree {
        let Reader { mut tree, snap, snapped, passed, source, options, .. } = self;
        if snapped > 0 {
            let text = format!("{snapped} rotations within {snap} rad of quarter turns were taken for them");
            tree.notes.push(text);
        }
        if !passed.is_empty() {
            let names: Vec<&str> = passed.iter().map(String::as_str).collect();
            tree.notes.push(format!("passed over: {}", list(&names)));
        }
        for joint in &mut tree.joints {
            // The flags act on the sum of a joint's own damping and its actuators'.
            joint.passive = options.left(joint.passive);
            if let Some((file, line)) = joint.line.map(|line| source.place(line)) {
                (joint.file, joint.line) = (file.map(str::to_owned), Some(line));
            }
        }
        for condition in &mut tree.conditions {
            condition.error = source.placed(condition.error.clone());
        }
        tree
    }

    /// Reserves the name of a link or joint; an error if it is in use.
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
