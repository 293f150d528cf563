// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mass and inertia of shapes, for bodies without an `inertial`.

use super::super::space::{self, Inertia, Pose, V3};
use super::super::xml::{line, some};
use super::attributes::towards;
use super::{REMEDY, Reader};
use crate::Error;
use roxmltree::Node;
use std::f64::consts::PI;

/// Default density of a shape: water's, kg/m³.
const DENSITY: f64 = 1000.0;

/// Volume of a shape, m³, and its inertia about its centre for a mass of 1 kg, m².
fn solid(shape: &str, [x, y, z]: V3) -> (f64, V3) {
    match shape {
        "ellipsoid" => (
            4.0 / 3.0 * PI * x * y * z,
            [(y * y + z * z) / 5.0, (x * x + z * z) / 5.0, (x * x + y * y) / 5.0],
        ),
        "box" => (8.0 * x * y * z, [(y * y + z * z) / 3.0, (x * x + z * z) / 3.0, (x * x + y * y) / 3.0]),
        "cylinder" => {
            let across = (3.0 * x * x + 4.0 * y * y) / 12.0;
            (2.0 * PI * x * x * y, [across, across, x * x / 2.0])
        }
        // Capsule: a cylinder between two hemispheres.
        _ => {
            let (tube, ends) = (2.0 * PI * x * x * y, 4.0 / 3.0 * PI * x * x * x);
            let (tube_part, ends_part) = (tube / (tube + ends), ends / (tube + ends));
            let across = tube_part * (3.0 * x * x + 4.0 * y * y) / 12.0
                + ends_part * (0.4 * x * x + y * y + 0.75 * x * y);
            (tube + ends, [across, across, tube_part * x * x / 2.0 + ends_part * 0.4 * x * x])
        }
    }
}

impl<'a, 'i: 'a> Reader<'a> {
    /// Mass and moments of a shape, in its body's or frame's coordinates.
    pub(super) fn shape(&mut self, node: Node<'a, 'i>, class: usize) -> Result<Inertia, Error> {
        let nothing = Ok(Inertia::default());
        let group = self.number(node, class, "group", 0.0)?;
        if group < self.compiler.groups.0 || group > self.compiler.groups.1 {
            return nothing;
        }
        let wrong = |text: String| Error::on(line(node), text);
        let value = |name: &str| self.classes.value(node, class, name);
        let stated = value("mass")?;
        let amount = match stated {
            Some(_) => self.number(node, class, "mass", 0.0)?,
            None => self.number(node, class, "density", DENSITY)?,
        };
        if amount < 0.0 {
            return Err(wrong(format!(
                "`{}` is negative",
                if stated.is_some() { "mass" } else { "density" }
            )));
        }
        if amount == 0.0 {
            return nothing;
        }
        let shape = value("type")?.unwrap_or("sphere").trim();
        let needs: usize = match shape {
            "plane" | "hfield" => return nothing,
            "sphere" => 1,
            "capsule" | "cylinder" => 2,
            "ellipsoid" | "box" => 3,
            "mesh" | "sdf" => {
                let text = format!(
                    "the body that moves takes its mass from a shape of type `{shape}`, which is in another file: \
                     state it with `inertial`; {REMEDY}, with `inertial` for each body"
                );
                return Err(wrong(text));
            }
            other => return Err(wrong(format!("there is no shape `{other}`"))),
        };
        if value("mesh")?.is_some() {
            let text = format!(
                "a shape fitted to a mesh, which is in another file, gives a body its mass: {REMEDY}"
            );
            return Err(wrong(text));
        }
        if value("shellinertia")? == Some("true") {
            return Err(wrong(format!("`shellinertia` is not read: {REMEDY}")));
        }
        let (mut size, fromto) = (value("size")?, value("fromto")?);
        let mut pose = self.pose(node, class)?;
        let mut sizes = match size.take() {
            Some(text) => some(node, "size", text, 3)?,
            None => Vec::new(),
        };
        if let Some(text) = fromto.filter(|_| shape != "sphere") {
            let ends = some(node, "fromto", text, 6)?;
            let &[a, b, c, d, e, f] = &ends[..] else {
                return Err(wrong(format!("`fromto` is `{text}`: expected 6 numbers")));
            };
            let (from, to) = ([a, b, c], [d, e, f]);
            let along = space::sub(to, from);
            let length = space::norm(along);
            if !(length > 0.0 && length.is_finite()) {
                return Err(wrong(format!("`fromto` is `{text}`: its ends are the same")));
            }
            pose.origin = space::scale(0.5, space::add(from, to));
            pose.rotation = towards(space::scale(1.0 / length, along));
            let radius = sizes.first().copied().unwrap_or(0.0);
            sizes = if needs == 2 { vec![radius, length / 2.0] } else { vec![radius, radius, length / 2.0] };
        }
        if sizes.len() < needs || sizes[..needs].iter().any(|x| *x <= 0.0) {
            return Err(wrong(format!("a shape `{shape}` needs {needs} positive numbers as its `size`")));
        }
        let sizes = match shape {
            "sphere" => [sizes[0]; 3],
            _ => std::array::from_fn(|i| sizes.get(i).copied().unwrap_or(0.0)),
        };
        let (volume, moments) = solid(if shape == "sphere" { "ellipsoid" } else { shape }, sizes);
        let mass = if stated.is_some() { amount } else { amount * volume };
        let [xx, yy, zz] = moments.map(|moment| mass * moment);
        let tensor = [[xx, 0.0, 0.0], [0.0, yy, 0.0], [0.0, 0.0, zz]];
        Ok(Inertia::new(mass, [0.0; 3], &tensor).outside(&pose))
    }

    /// Mass and moments stated by `inertial`, in its body's or frame's coordinates.
    pub(super) fn inertial(&mut self, node: Node<'a, 'i>, class: usize) -> Result<Inertia, Error> {
        let pose: Pose = self.pose(node, class)?;
        let mass = self.number(node, class, "mass", 0.0)?;
        if mass < 0.0 {
            return Err(Error::on(line(node), format!("a mass is {mass}; a mass must not be negative")));
        }
        let tensor = match node.attribute("fullinertia") {
            Some(_) => {
                let [xx, yy, zz, xy, xz, yz] = self.numbers(node, class, "fullinertia", [0.0; 6])?;
                [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
            }
            None => {
                let [xx, yy, zz] = self.numbers(node, class, "diaginertia", [0.0; 3])?;
                [[xx, 0.0, 0.0], [0.0, yy, 0.0], [0.0, 0.0, zz]]
            }
        };
        Ok(Inertia::new(mass, [0.0; 3], &tensor).outside(&pose))
    }
}
