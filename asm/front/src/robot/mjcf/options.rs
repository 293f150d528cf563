// SPDX-License-Identifier: MIT OR Apache-2.0
//! Settings of `option`. A model may have several sections; the last statement of each attribute counts.

use super::super::space::V3;
use super::super::xml::{line, numbers};
use super::super::{GRAVITY, PassiveForces};
use super::table;
use crate::Error;
use roxmltree::Node;
use std::collections::BTreeSet;

/// Settings with an effect on the motion.
pub(super) struct Options {
    gravity: V3,
    /// Nonzero attributes of the medium, with their lines.
    medium: Vec<(&'static str, usize)>,
    /// Flags that are switched off.
    off: BTreeSet<String>,
}

impl Default for Options {
    fn default() -> Options {
        Options { gravity: [0.0, 0.0, -GRAVITY], medium: Vec::new(), off: BTreeSet::new() }
    }
}

impl Options {
    /// Reads a section, which overrides earlier ones.
    pub(super) fn add(&mut self, node: Node<'_, '_>) -> Result<(), Error> {
        table::check("option", node)?;
        if let Some(value) = node.attribute("gravity") {
            self.gravity = numbers(node, "gravity", value)?;
        }
        for (name, _) in table::refused("option") {
            if let Some(value) = node.attribute(name) {
                let [size] = numbers(node, name, value)?;
                self.medium.retain(|(other, _)| *other != name);
                self.medium.extend((size != 0.0).then_some((name, line(node))));
            }
        }
        for flag in node.children().filter(|child| child.has_tag_name("flag")) {
            table::check("flag", flag)?;
            for attribute in flag.attributes() {
                let (name, value) = (attribute.name(), attribute.value().trim());
                match value {
                    "disable" => self.off.insert(name.to_owned()),
                    "enable" => self.off.remove(name),
                    _ => {
                        let text = format!("`{name}` is `{value}`: expected `enable` or `disable`");
                        return Err(Error::on(line(flag), text));
                    }
                };
            }
        }
        Ok(())
    }

    /// The flag is off, or an older release's flag that includes it.
    pub(super) fn is_off(&self, flag: &str) -> bool {
        let whole = match flag {
            "spring" | "damper" => "passive",
            "frictionloss" => "constraint",
            other => other,
        };
        self.off.contains(flag) || self.off.contains(whole)
    }

    /// The flags switch off all passive forces.
    pub(super) fn is_bare(&self) -> bool {
        self.is_off("spring") && self.is_off("damper")
    }

    /// Acceleration of free fall, m/s².
    pub(super) fn gravity(&self) -> Result<V3, Error> {
        match self.medium.first() {
            Some((name, line)) if !self.is_bare() => {
                let text = format!(
                    "`{name}`: forces of a medium are not computed; without it the robot moves as in a vacuum"
                );
                Err(Error::on(*line, text))
            }
            _ if self.is_off("gravity") => Ok([0.0; 3]),
            _ => Ok(self.gravity),
        }
    }

    /// Passive forces that the flags leave on.
    pub(super) fn left(&self, passive: PassiveForces) -> PassiveForces {
        let left = |flag: &str, value: f64| if self.is_off(flag) { 0.0 } else { value };
        PassiveForces {
            damping: left("damper", passive.damping),
            stiffness: left("spring", passive.stiffness),
            friction: left("frictionloss", passive.friction),
            ..passive
        }
    }

    /// Notes about settings that differ from the defaults.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let gravity = if self.is_off("gravity") { [0.0; 3] } else { self.gravity };
        if gravity != [0.0, 0.0, -GRAVITY] {
            let [x, y, z] = gravity;
            notes.push(format!("gravity is {x} {y} {z} m/s²"));
        }
        let off = [("spring", "springs"), ("damper", "dampers"), ("frictionloss", "friction")];
        let off: Vec<&str> =
            off.iter().filter(|(flag, _)| self.is_off(flag)).map(|(_, name)| *name).collect();
        if !off.is_empty() {
            notes.push(format!("switched off by `flag`: {}", off.join(", ")));
        }
        notes
    }
}
