// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robots from tables of Denavit-Hartenberg parameters: a file of comma-separated values, as spreadsheets write it, which docs/model.md
//! describes.

use super::space::{self, IDENTITY, Inertia, Pose};
use super::tree::{Element, ElementKind, Tree, rotation};
use super::{GRAVITY, Kind, MAX_JOINTS, PassiveForces};
use crate::Error;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use takt_text::readers::{Row, Treatment, fate};
use takt_text::table::{no_number, separator};

/// Columns that a table must have; angles may be in degrees, as in `alpha_deg`.
const NEEDED: [&str; 6] = ["joint", "kind", "a", "alpha", "d", "theta"];
/// Suffix of a column of angles in degrees.
const DEGREES: &str = "_deg";
/// Prefix of the line by which a spreadsheet names its separator.
const NAMED: &str = "sep=";

const fn row(of: &'static str, parts: &'static str, fate: Treatment, text: &'static str) -> Row {
    Row { of, parts, fate, text }
}

/// Treatment of each column and line.
pub const TABLE: &[Row] = &[
    row(
        "column",
        "joint kind a alpha d theta",
        Treatment::Computes,
        "lengths in m, angles in rad; more than a turn is refused",
    ),
    row("column", "alpha_deg theta_deg", Treatment::Computes, "in place of `alpha` and `theta`: degrees"),
    row("column", "mass cx cy cz ixx iyy izz ixy ixz iyz", Treatment::Computes, "0 if left out"),
    row("kind", "revolute continuous prismatic fixed", Treatment::Computes, ""),
    row(
        "line",
        "convention sep",
        Treatment::Computes,
        "`# convention: standard` or `modified`; `sep=;` in the first line",
    ),
    row("line", "#", Treatment::PassesOver, "comments, and lines of separators only"),
];

/// Placement of the frames: one of the two conventions for Denavit-Hartenberg parameters.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Convention {
    /// Denavit and Hartenberg: a link's frame lies at its distal end.
    Standard,
    /// Craig, Khalil and Kleinfinger: a link's frame lies at its proximal end.
    Modified,
}

/// Parses a number that may contain `pi`: `0.5`, `-pi/2`, `3*pi/4`.
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
            "pi" => PI,
            factor => factor.parse::<f64>().ok()?,
        };
    }
    value.is_finite().then_some(value)
}

/// Reads a robot from a table.
///
/// # Errors
/// If the text is not such a table, with the line.
pub fn read(source: &str, name: &str, snap: f64) -> Result<Tree, Error> {
    let mut convention = None;
    let mut header: Option<Header<'_>> = None;
    let mut table = Table { tree: Tree::new(name.to_owned(), [0.0, 0.0, -GRAVITY]), snap, snapped: 0 };
    table.tree.links.push(("base".to_owned(), Inertia::default()));
    for (index, line) in source.trim_start_matches('\u{feff}').lines().enumerate() {
        let wrong = |text: String| Error::on(index + 1, text);
        let line = line.trim();
        // Spreadsheets fill every line up to the last column.
        let text = line.trim_end_matches([',', ';', '\t', ' ']);
        if let Some(comment) = text.strip_prefix('#') {
            if let Some((_, which)) = comment.split_once("convention:") {
                convention = Some(Convention::named(which.trim()).map_err(wrong)?);
            }
            continue;
        }
        if text.is_empty() || text.to_ascii_lowercase().starts_with(NAMED) {
            continue;
        }
        let Some(header) = &header else {
            header = Some(Header::of(line).map_err(wrong)?);
            continue;
        };
        let convention = convention.ok_or_else(|| {
            wrong("state above the table which frames it uses: `# convention: standard` or `# convention: modified`".to_owned())
        })?;
        table.joint(header.cells(line).map_err(wrong)?, convention).map_err(wrong)?;
    }
    let Table { mut tree, snapped, .. } = table;
    if tree.joints.is_empty() {
        return Err(Error::plain("the table has no joint"));
    }
    if snapped > 0 {
        tree.notes.push(format!("{snapped} angles within {snap} rad of a quarter turn were taken for it"));
    }
    Ok(tree)
}

impl Convention {
    fn named(name: &str) -> Result<Convention, String> {
        match name {
            "standard" => Ok(Convention::Standard),
            "modified" => Ok(Convention::Modified),
            other => Err(format!("unknown convention `{other}`; expected `standard` or `modified`")),
        }
    }
}

/// Strips the quotes that some spreadsheets put around a field.
fn field(text: &str) -> &str {
    text.trim().trim_matches('"')
}

/// Columns by name, and their separator.
struct Header<'a> {
    columns: HashMap<&'a str, usize>,
    separator: char,
}

impl<'a> Header<'a> {
    fn of(line: &'a str) -> Result<Header<'a>, String> {
        let separator = separator(line);
        let mut columns = HashMap::new();
        for (at, field) in line.split(separator).map(field).enumerate() {
            if fate(TABLE, "column", field).is_none() {
                let known = TABLE.iter().filter(|row| row.of == "column").map(|row| row.parts);
                let known = known.collect::<Vec<_>>().join(" ").replace(' ', ", ");
                return Err(format!("column `{field}` is not known; the columns are {known}"));
            }
            if columns.insert(field, at).is_some() {
                return Err(format!("column `{field}` is there twice"));
            }
        }
        let degrees = |name: &str| format!("{name}{DEGREES}");
        for name in NEEDED {
            match (columns.contains_key(name), columns.contains_key(degrees(name).as_str())) {
                (true, true) => {
                    return Err(format!(
                        "columns `{name}` and `{}` exclude each other: leave one out",
                        degrees(name)
                    ));
                }
                (false, false) => {
                    let needed = NEEDED.join(", ");
                    return Err(format!("the header has no column `{name}`; needed are {needed}"));
                }
                _ => {}
            }
        }
        Ok(Header { columns, separator })
    }

    fn cells<'s>(&'s self, line: &'s str) -> Result<Cells<'s>, String> {
        let fields: Vec<&str> = line.split(self.separator).map(field).collect();
        if fields.len() != self.columns.len() {
            let text = format!("{} fields; the header has {}", fields.len(), self.columns.len());
            return Err(match self.separator {
                ',' if fields.len() > self.columns.len() => {
                    format!("{text} (numbers have a decimal point, as 0.5)")
                }
                _ => text,
            });
        }
        Ok(Cells { columns: &self.columns, fields })
    }
}

/// The fields of a row.
struct Cells<'a> {
    columns: &'a HashMap<&'a str, usize>,
    fields: Vec<&'a str>,
}

impl Cells<'_> {
    fn text(&self, column: &str) -> Option<&str> {
        self.columns.get(column).map(|&at| self.fields[at])
    }

    /// A number; 0 if the column is absent or the field empty.
    fn value(&self, column: &str) -> Result<f64, String> {
        match self.text(column) {
            None | Some("") => Ok(0.0),
            Some(text) => number(text).ok_or_else(|| match no_number(text) {
                why if why.contains("comma") => format!("`{column}`: {why}"),
                why => format!("`{column}`: {why}, such as 0.5 or -pi/2"),
            }),
        }
    }

    /// An angle in rad, from a column of radians or of degrees.
    fn angle(&self, column: &str) -> Result<f64, String> {
        let degrees = format!("{column}{DEGREES}");
        if self.columns.contains_key(degrees.as_str()) {
            return Ok(self.value(&degrees)?.to_radians());
        }
        let angle = self.value(column)?;
        if angle.abs() > TAU * (1.0 + 1e-6) {
            return Err(format!(
                "`{column}`: {angle} rad is more than a turn; if it is in degrees, call the column `{degrees}`"
            ));
        }
        Ok(angle)
    }
}

/// State of the reader: the robot so far.
struct Table {
    tree: Tree,
    snap: f64,
    snapped: usize,
}

impl Table {
    fn turn(&mut self, axis: usize, angle: f64) -> Pose {
        let mut rpy = [0.0; 3];
        rpy[axis] = angle;
        let (rotation, count) = rotation(rpy, self.snap);
        self.snapped += count;
        Pose { rotation, origin: [0.0; 3] }
    }

    /// Adds the joint of a row, with its link.
    fn joint(&mut self, cells: Cells<'_>, convention: Convention) -> Result<(), String> {
        let kind = match cells.text("kind").unwrap_or_default() {
            "revolute" | "continuous" => ElementKind::Moves(Kind::Revolute),
            "prismatic" => ElementKind::Moves(Kind::Prismatic),
            "fixed" => ElementKind::Fixed,
            other => {
                return Err(format!("unknown kind `{other}`; expected `revolute`, `prismatic` or `fixed`"));
            }
        };
        let joint = cells.text("joint").unwrap_or_default();
        if joint.is_empty() || self.tree.joints.iter().any(|other| other.name == joint) {
            return Err(format!("joint `{joint}`: every joint needs a name of its own"));
        }
        if self.tree.joints.len() >= 2 * MAX_JOINTS {
            return Err(format!("more than {MAX_JOINTS} joints"));
        }
        let [a, d] = [cells.value("a")?, cells.value("d")?];
        let [alpha, theta] = [cells.angle("alpha")?, cells.angle("theta")?];
        let shift = |x: f64, z: f64| Pose { rotation: IDENTITY, origin: [x, 0.0, z] };
        let (before, after) = match convention {
            Convention::Standard => (self.turn(2, theta), shift(a, d).then(&self.turn(0, alpha))),
            Convention::Modified => {
                (self.turn(0, alpha).then(&shift(a, 0.0)).then(&self.turn(2, theta)), shift(0.0, d))
            }
        };
        let mass = cells.value("mass")?;
        if mass < 0.0 {
            return Err(format!("its mass is {mass}; a mass must not be negative"));
        }
        let centre = [cells.value("cx")?, cells.value("cy")?, cells.value("cz")?];
        let [xx, yy, zz] = [cells.value("ixx")?, cells.value("iyy")?, cells.value("izz")?];
        let [xy, xz, yz] = [cells.value("ixy")?, cells.value("ixz")?, cells.value("iyz")?];
        let body = Inertia::new(mass, centre, &[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
        // Two links: one at the joint's axis, and the table's, fixed to it.
        let tree = &mut self.tree;
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
            passive: PassiveForces::default(),
            file: None,
            line: None,
        };
        tree.joints.push(element(joint, kind, carrier, axis.clone(), &before));
        tree.joints.push(element(&format!("{joint}_fixed"), ElementKind::Fixed, axis, link, &after));
        Ok(())
    }
}
