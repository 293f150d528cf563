// SPDX-License-Identifier: MIT OR Apache-2.0
//! Attributes, stated by an element or by its class of defaults, and the rotations that they describe.

use super::super::space::{self, IDENTITY, M3, Pose, V3};
use super::super::xml::{line, numbers};
use super::{Reader, table};
use crate::Error;
use roxmltree::Node;
use std::collections::HashMap;

/// A class of defaults.
struct Class<'a> {
    parent: Option<usize>,
    /// Default values by element and attribute.
    values: HashMap<(&'a str, &'a str), &'a str>,
}

/// Name under which an element finds its defaults: all actuators share theirs, and so do both kinds of tendon.
fn sharing(element: &str) -> &str {
    match element {
        "fixed" | "spatial" => "tendon",
        "plugin" => "actuator",
        other if table::ACTUATORS.split(' ').any(|kind| kind == other) => "actuator",
        other => other,
    }
}

/// Classes of defaults; the first applies to elements without a class.
pub(super) struct Classes<'a> {
    list: Vec<Class<'a>>,
    names: HashMap<&'a str, usize>,
}

impl<'a, 'i: 'a> Classes<'a> {
    /// Reads all sections `default`, with nested classes.
    pub(super) fn read(sections: impl Iterator<Item = Node<'a, 'i>>) -> Result<Classes<'a>, Error> {
        let main = Class { parent: None, values: HashMap::new() };
        let mut classes = Classes { list: vec![main], names: HashMap::from([("main", 0)]) };
        for section in sections {
            if let Some(name) = section.attribute("class") {
                classes.names.insert(name, 0);
            }
            classes.fill(0, section)?;
        }
        Ok(classes)
    }

    fn fill(&mut self, class: usize, node: Node<'a, 'i>) -> Result<(), Error> {
        table::check("default", node)?;
        for child in node.children().filter(Node::is_element) {
            if child.has_tag_name("default") {
                let name = child.attribute("class").filter(|name| !name.is_empty());
                let name = name.ok_or_else(|| {
                    Error::on(line(child), "a class of defaults needs a name, in the attribute `class`")
                })?;
                if self.names.insert(name, self.list.len()).is_some() {
                    return Err(Error::on(line(child), format!("`{name}`: two classes have this name")));
                }
                self.list.push(Class { parent: Some(class), values: HashMap::new() });
                self.fill(self.list.len() - 1, child)?;
                continue;
            }
            let element = sharing(child.tag_name().name());
            if matches!(element, "joint" | "geom" | "tendon" | "actuator") {
                table::check(element, child)?;
            }
            for attribute in child.attributes() {
                let (name, value) = (attribute.name(), attribute.value());
                self.list[class].values.insert((element, name), value);
            }
        }
        Ok(())
    }

    /// Finds a class by name.
    pub(super) fn named(&self, node: Node<'_, '_>, name: &str) -> Result<usize, Error> {
        let class = self.names.get(name).copied();
        class.ok_or_else(|| Error::on(line(node), format!("there is no class `{name}` of defaults")))
    }

    /// Value of an attribute: stated by the element, or by its class (the element's own, otherwise `class`) or an ancestor of that class.
    pub(super) fn value(
        &self,
        node: Node<'a, 'i>,
        class: usize,
        name: &str,
    ) -> Result<Option<&'a str>, Error> {
        if let Some(value) = node.attribute(name) {
            return Ok(Some(value));
        }
        let mut class = match node.attribute("class") {
            Some(name) => Some(self.named(node, name)?),
            None => Some(class),
        };
        while let Some(Class { parent, values }) = class.map(|class| &self.list[class]) {
            if let Some(value) = values.get(&(sharing(node.tag_name().name()), name)) {
                return Ok(Some(value));
            }
            class = *parent;
        }
        Ok(None)
    }
}

impl<'a, 'i: 'a> Reader<'a> {
    /// Numbers of an attribute with a default.
    pub(super) fn numbers<const N: usize>(
        &self,
        node: Node<'a, 'i>,
        class: usize,
        name: &str,
        default: [f64; N],
    ) -> Result<[f64; N], Error> {
        self.classes.value(node, class, name)?.map_or(Ok(default), |value| numbers(node, name, value))
    }

    /// A number of an attribute with a default.
    pub(super) fn number(
        &self,
        node: Node<'a, 'i>,
        class: usize,
        name: &str,
        default: f64,
    ) -> Result<f64, Error> {
        self.numbers(node, class, name, [default]).map(|[number]| number)
    }

    /// Pose of an element in the frame around it.
    pub(super) fn pose(&mut self, node: Node<'a, 'i>, class: usize) -> Result<Pose, Error> {
        let origin = self.numbers(node, class, "pos", [0.0; 3])?;
        let mut stated: Option<(&str, M3)> = None;
        for name in ["quat", "axisangle", "euler", "xyaxes", "zaxis"] {
            let Some(value) = self.classes.value(node, class, name)? else { continue };
            if let Some((other, _)) = stated {
                // A rotation stated by the element overrides its class's.
                if node.attribute(name).is_none() {
                    continue;
                }
                if node.attribute(other).is_some() {
                    let text = format!("both `{other}` and `{name}` are stated; leave one of them out");
                    return Err(Error::on(line(node), text));
                }
            }
            let rotation = self.rotation(node, name, value)?;
            stated = Some((
                name,
                rotation.ok_or_else(|| {
                    Error::on(line(node), format!("`{name}` is `{value}`, which is not a direction"))
                })?,
            ));
        }
        let rotation = stated.map_or(IDENTITY, |(_, rotation)| self.snapped(rotation));
        Ok(Pose { rotation, origin })
    }

    fn rotation(&self, node: Node<'_, '_>, name: &str, value: &str) -> Result<Option<M3>, Error> {
        let unit = self.compiler.angle;
        Ok(match name {
            "quat" => {
                let [w, x, y, z] = numbers(node, name, value)?;
                let size = (w * w + x * x + y * y + z * z).sqrt();
                (size > TINY && size.is_finite()).then(|| quaternion([w, x, y, z].map(|part| part / size)))
            }
            "axisangle" => {
                let [x, y, z, angle] = numbers(node, name, value)?;
                unit_vector([x, y, z]).map(|axis| about(axis, angle * unit))
            }
            "euler" => {
                let angles: V3 = numbers(node, name, value)?;
                let turns = self.compiler.euler.into_iter().zip(angles);
                Some(turns.fold(IDENTITY, |whole, ((axis, fixed), angle)| {
                    let turn = space::about(axis, angle * unit);
                    if fixed { space::product(&turn, &whole) } else { space::product(&whole, &turn) }
                }))
            }
            "xyaxes" => {
                let [a, b, c, d, e, f] = numbers(node, name, value)?;
                unit_vector([a, b, c]).and_then(|x| {
                    let y = [d, e, f];
                    let y = unit_vector(space::sub(y, space::scale(space::dot(x, y), x)))?;
                    Some(space::columns(x, y, space::cross(x, y)))
                })
            }
            _ => unit_vector(numbers(node, name, value)?).map(towards),
        })
    }

    /// Snaps a rotation to quarter turns within the tolerance.
    fn snapped(&mut self, rotation: M3) -> M3 {
        let snap = self.snap.max(ROUNDING);
        let mut result = rotation;
        // A rotation that maps an axis onto an axis is a turn about it.
        let near = |x: f64| x.abs() >= 1.0 - snap * snap / 2.0 - f64::EPSILON;
        let aligned = (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).find(|&(i, j)| near(rotation[i][j]));
        if let Some((i, j)) = aligned {
            let sign = rotation[i][j].signum();
            let ([a, b], [c, d]) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
            let (mut cosine, mut sine) = (rotation[a][c], rotation[b][c]);
            let size = cosine.hypot(sine);
            (cosine, sine) = (cosine / size, sine / size);
            for (one, other) in [(&mut cosine, &mut sine)] {
                if one.abs() <= snap {
                    (*one, *other) = (0.0, other.signum());
                } else if other.abs() <= snap {
                    (*one, *other) = (one.signum(), 0.0);
                }
            }
            result = [[0.0; 3]; 3];
            result[i][j] = sign;
            (result[a][c], result[b][c]) = (cosine, sine);
            (result[a][d], result[b][d]) = (-sign * sine, sign * cosine);
        }
        let off = result.iter().flatten().zip(rotation.iter().flatten());
        self.snapped += usize::from(off.map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) > ROUNDING);
        result
    }
}

/// Length below which a vector has no direction.
const TINY: f64 = 1e-10;
/// Rounding error of an angle computed from the file's numbers.
const ROUNDING: f64 = 1e-12;

fn unit_vector(a: V3) -> Option<V3> {
    let size = space::norm(a);
    (size > TINY && size.is_finite()).then(|| a.map(|x| x / size))
}

/// Rotation of a unit quaternion.
fn quaternion([w, x, y, z]: [f64; 4]) -> M3 {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Rotation about a unit vector.
pub(super) fn about(axis: V3, angle: f64) -> M3 {
    let (sine, cosine) = space::sin_cos(angle);
    let [x, y, z] = axis;
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            IDENTITY[i][j] * cosine + sine * cross[i][j] + (1.0 - cosine) * axis[i] * axis[j]
        })
    })
}

/// Smallest rotation that turns z into a direction.
pub(super) fn towards(direction: V3) -> M3 {
    let across = space::cross([0.0, 0.0, 1.0], direction);
    let angle = space::norm(across).atan2(direction[2]);
    // Straight down, any horizontal axis will do; MuJoCo takes x.
    about(unit_vector(across).unwrap_or([1.0, 0.0, 0.0]), angle)
}
