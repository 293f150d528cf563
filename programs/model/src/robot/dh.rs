// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robots from tables of Denavit-Hartenberg parameters: a comma-separated file, which docs/model.md describes.

use super::space::{self, IDENTITY, Inertia, Pose};
use super::tree::{Element, ElementKind, Tree, rotation};
use super::{GRAVITY, Kind, MAX_JOINTS, Passive};
use crate::Error;
use std::collections::HashMap;

/// The columns that a table must have.
const NEEDED: [&str; 6] = ["joint", "kind", "a", "alpha", "d", "theta"];
/// And those that it may have, which are 0 otherwise: mass, its centre in the link's frame, inertia about the centre.
const OPTIONAL: [&str; 10] = ["mass", "cx", "cy", "cz", "ixx", "iyy", "izz", "ixy", "ixz", "iyz"];

/// Which of the two ways to place frames a table follows.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Convention {
    /// Denavit and Hartenberg: a link's frame lies at its end.
    Standard,
    /// Craig, Khalil and Kleinfinger: it lies at its beginning.
    Modified,
}

/// A number, in which `pi` may stand: `0.5`, `-pi/2`, `3*pi/4`.
fn number(text: &str) -> Option<f64> {
    let (text, sign) = match text.strip_prefix('-') {
        Some(rest) => (rest, -1.0),
        None => (text, 1.0),
    };
    let (above, below) = match text.split_once('/') {
        Some((above, below)) => (above, below.trim().parse::<f64>().ok()?),
        None => (text, 1.0),
    };
    let mut value = sign / below;
    for factor in above.split('*') {
        value *= match factor.trim() {
            "pi" => std::f64::consts::PI,
            factor => factor.parse::<f64>().ok()?,
        };
    }
    value.is_finite().then_some(value)
}

/// A robot from a table.
///
/// # Errors
/// If it is not one, with the line.
pub fn read(source: &str, name: &str, snap: f64) -> Result<Tree, Error> {
    let mut convention = None;
    let mut columns: Option<HashMap<&str, usize>> = None;
    let mut tree = Tree {
        name: name.to_owned(),
        links: Vec::new(),
        joints: Vec::new(),
        gravity: [0.0, 0.0, -GRAVITY],
        notes: Vec::new(),
    };
    tree.links.push(("base".to_owned(), Inertia::default()));
    let mut snapped = 0;
    for (index, line) in source.lines().enumerate() {
        let wrong = |text: String| Error::on(index + 1, text);
        let line = line.trim();
        if let Some(comment) = line.strip_prefix('#') {
            if let Some((_, which)) = comment.split_once("convention:") {
                convention = Some(match which.trim() {
                    "standard" => Convention::Standard,
                    "modified" => Convention::Modified,
                    other => {
                        return Err(wrong(format!(
                            "convention `{other}`: `standard` and `modified` are known"
                        )));
                    }
                });
            }
            continue;
        }
        if line.is_empty() {
            continue;
        }
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let Some(columns) = &columns else {
            columns = Some(header(&fields).map_err(wrong)?);
            continue;
        };
        let convention = convention.ok_or_else(|| {
            wrong("say above it which frames the table means: `# convention: standard` or `# convention: modified`".to_owned())
        })?;
        if fields.len() != columns.len() {
            return Err(wrong(format!("{} fields; the header has {}", fields.len(), columns.len())));
        }
        let value = |column: &str| match columns.get(column).map(|&at| fields[at]) {
            None | Some("") => Ok(0.0),
            Some(text) => {
                let value = number(text);
                value.ok_or_else(|| {
                    wrong(format!("`{column}`: `{text}` is no finite number, such as 0.5 or -pi/2"))
                })
            }
        };
        let kind = match fields[columns["kind"]] {
            "revolute" | "continuous" => ElementKind::Moves(Kind::Revolute),
            "prismatic" => ElementKind::Moves(Kind::Prismatic),
            "fixed" => ElementKind::Fixed,
            other => {
                return Err(wrong(format!("kind `{other}`: `revolute`, `prismatic` and `fixed` are known")));
            }
        };
        let joint = fields[columns["joint"]];
        if joint.is_empty() || tree.joints.iter().any(|other| other.name == joint) {
            return Err(wrong(format!("joint `{joint}`: every joint has a name of its own")));
        }
        if tree.joints.len() >= 2 * MAX_JOINTS {
            return Err(wrong(format!("more than {MAX_JOINTS} joints")));
        }
        let [a, alpha, d, theta] = [value("a")?, value("alpha")?, value("d")?, value("theta")?];
        let mut turn = |axis: usize, angle: f64| {
            let mut rpy = [0.0; 3];
            rpy[axis] = angle;
            let (rotation, count) = rotation(rpy, snap);
            snapped += count;
            Pose { rotation, origin: [0.0; 3] }
        };
        let shift = |x: f64, z: f64| Pose { rotation: IDENTITY, origin: [x, 0.0, z] };
        let (before, after) = match convention {
            Convention::Standard => (turn(2, theta), shift(a, d).then(&turn(0, alpha))),
            Convention::Modified => {
                (turn(0, alpha).then(&shift(a, 0.0)).then(&turn(2, theta)), shift(0.0, d))
            }
        };
        let [mass, cx, cy, cz] = [value("mass")?, value("cx")?, value("cy")?, value("cz")?];
        if mass < 0.0 {
            return Err(wrong(format!("its mass is {mass}; a mass is not negative")));
        }
        let [xx, yy, zz] = [value("ixx")?, value("iyy")?, value("izz")?];
        let [xy, xz, yz] = [value("ixy")?, value("ixz")?, value("iyz")?];
        let body = Inertia::new(mass, [cx, cy, cz], &[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
        // Two links: one at the joint's axis, and the table's, fixed to it.
        let carrier = tree.links[tree.links.len() - 1].0.clone();
        let (axis, link) = (format!("{joint}_axis"), format!("{joint}_link"));
        tree.links.extend([(axis.clone(), Inertia::default()), (link.clone(), body)]);
        let element = |name: &str, kind, parent: String, child: String, pose: &Pose| Element {
            name: name.to_owned(),
            kind,
            parent,
            child,
            origin: pose.origin,
            rotation: space::cleaned(&pose.rotation),
            axis: [0.0, 0.0, 1.0],
            passive: Passive::default(),
            line: None,
        };
        tree.joints.push(element(joint, kind, carrier, axis.clone(), &before));
        tree.joints.push(element(&format!("{joint}_fixed"), ElementKind::Fixed, axis, link, &after));
    }
    if tree.joints.is_empty() {
        return Err(Error::plain("the table has no joint"));
    }
    if snapped > 0 {
        tree.notes.push(format!("{snapped} angles within {snap} rad of a quarter turn were taken for it"));
    }
    Ok(tree)
}

fn header<'a>(fields: &[&'a str]) -> Result<HashMap<&'a str, usize>, String> {
    let mut columns = HashMap::new();
    for (at, &field) in fields.iter().enumerate() {
        if !NEEDED.contains(&field) && !OPTIONAL.contains(&field) {
            let known = NEEDED.iter().chain(&OPTIONAL).copied().collect::<Vec<_>>().join(", ");
            return Err(format!("column `{field}` is not known; the columns are {known}"));
        }
        if columns.insert(field, at).is_some() {
            return Err(format!("column `{field}` is there twice"));
        }
    }
    match NEEDED.iter().find(|needed| !columns.contains_key(**needed)) {
        Some(missing) => {
            Err(format!("the header has no column `{missing}`; needed are {}", NEEDED.join(", ")))
        }
        None => Ok(columns),
    }
}
