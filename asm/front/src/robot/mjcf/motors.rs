// SPDX-License-Identifier: MIT OR Apache-2.0
//! Inertia and damping that actuators add to their joints; checks that tendons add none.

use super::super::tree::Condition;
use super::super::xml::{line, some};
use super::{Reader, table};
use crate::Error;
use roxmltree::Node;

impl<'a, 'i: 'a> Reader<'a> {
    /// Reads `tendon`. A tendon without spring, friction and inertia only transmits, and is ignored.
    pub(super) fn tendons(&mut self, section: Node<'a, 'i>) -> Result<(), Error> {
        for node in section.children().filter(Node::is_element) {
            let kind = node.tag_name().name();
            if !matches!(kind, "fixed" | "spatial") {
                return Err(Error::on(line(node), format!("there is no tendon `{kind}`")));
            }
            table::check("tendon", node)?;
            self.passed.insert("tendon".to_owned());
            for (name, _) in table::refused("tendon") {
                let value = self.classes.value(node, 0, name)?;
                let off = match name {
                    "stiffness" | "springyield" => self.options.is_off("spring"),
                    "damping" => self.options.is_off("damper"),
                    "frictionloss" => self.options.is_off("frictionloss"),
                    _ => false,
                };
                if value.is_some_and(|value| !table::is_neutral(value)) && !off {
                    self.joined(node, format!("`{name}` of a tendon is not computed"));
                }
            }
        }
        Ok(())
    }

    /// Records an error about a tendon, which applies to robots with its joints.
    fn joined(&mut self, tendon: Node<'_, '_>, text: String) {
        let joints = tendon.children().filter(|child| child.has_tag_name("joint"));
        let joints = joints.filter_map(|joint| joint.attribute("joint").map(str::to_owned)).collect();
        // The path of a spatial tendon depends on the pose, so it concerns every joint.
        let joints = tendon.has_tag_name("fixed").then_some(joints);
        let mend = "state it at the joints, or take a part without them: --base, --tip";
        let error = Error::on(line(tendon), format!("{text}: {mend}"));
        self.tree.conditions.push(Condition { joints, error });
    }

    /// Reads `actuator`: armature and damping, scaled by the gear. Control laws are ignored: forces are ports of the program.
    pub(super) fn actuators(&mut self, section: Node<'a, 'i>, tendons: &[Node<'a, 'i>]) -> Result<(), Error> {
        for node in section.children().filter(Node::is_element) {
            let kind = node.tag_name().name();
            if kind != "plugin" && !table::ACTUATORS.split(' ').any(|known| known == kind) {
                return Err(Error::on(line(node), format!("there is no actuator `{kind}`")));
            }
            table::check("actuator", node)?;
            self.passed.insert("actuator".to_owned());
            let armature = self.number(node, 0, "armature", 0.0)?;
            let damping = self.linear(node, 0, "damping")?;
            if let Some((name, value)) =
                [("armature", armature), ("damping", damping)].iter().find(|(_, x)| *x < 0.0)
            {
                return Err(Error::on(line(node), format!("`{name}` is {value}; it must not be negative")));
            }
            if armature == 0.0 && damping == 0.0 {
                continue;
            }
            let gear = match self.classes.value(node, 0, "gear")? {
                Some(value) => some(node, "gear", value, 6)?[0],
                None => 1.0,
            };
            if let Some(name) = node.attribute("joint").or_else(|| node.attribute("jointinparent")) {
                let joint = self.tree.joints.iter_mut().find(|joint| joint.name == name);
                let joint =
                    joint.ok_or_else(|| Error::on(line(node), format!("there is no joint `{name}`")))?;
                joint.passive.armature += armature * gear * gear;
                joint.passive.damping += damping * gear * gear;
                continue;
            }
            let mut all = tendons.iter().flat_map(Node::children);
            let tendon =
                node.attribute("tendon").and_then(|name| all.find(|one| one.attribute("name") == Some(name)));
            let text = "`armature` and `damping` of an actuator are computed at joints only";
            match tendon {
                Some(tendon) => self.joined(tendon, text.to_owned()),
                None => return Err(Error::on(line(node), text)),
            }
        }
        Ok(())
    }

    /// Linear coefficient of a force; nonzero quadratic and cubic ones are refused.
    pub(super) fn linear(&self, node: Node<'a, 'i>, class: usize, name: &str) -> Result<f64, Error> {
        let Some(value) = self.classes.value(node, class, name)? else { return Ok(0.0) };
        let parts = some(node, name, value, 3)?;
        if parts[1..].iter().any(|part| *part != 0.0) {
            let text = format!("`{name}` is `{value}`: only the first number, a linear force, is computed");
            return Err(Error::on(line(node), text));
        }
        Ok(parts[0])
    }
}
