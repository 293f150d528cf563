// SPDX-License-Identifier: MIT OR Apache-2.0
//! Console commands for the cores of a system and for its links.

use super::Console;
use crate::panes::{self, CoreLine};
use crate::system::{link_named, link_text};
use std::fmt::Write as _;

impl Console {
    /// Status line of each core of a system.
    pub(super) fn core_lines(&mut self) -> Vec<CoreLine> {
        let Some(system) = self.system() else { return Vec::new() };
        let names: Vec<String> =
            system.system().description().cores.iter().map(|core| core.name.clone()).collect();
        let selected = self.selected;
        let cores = names.into_iter().zip(&mut self.cores).enumerate();
        let line = |(number, (name, core)): (usize, (String, &mut super::Inspector))| CoreLine {
            name,
            state: panes::core_state(&mut core.session),
            selected: number == selected,
        };
        cores.map(line).collect()
    }

    pub(super) fn cores_text(&mut self) -> String {
        let Some(system) = self.system() else { return String::new() };
        let mut text = format!("cycle {}, {} turns of the host\n", system.cycle(), system.turns());
        let lines = self.core_lines();
        let width = lines.iter().map(|core| core.name.len()).max().unwrap_or(0);
        for CoreLine { name, state, selected } in lines {
            let mark = if selected { '>' } else { ' ' };
            let _ = writeln!(text, "{mark} {name:<width$}  {state}");
        }
        text
    }

    pub(super) fn select_named(&mut self, name: &str) -> Result<String, String> {
        let names: Vec<&str> = (0..self.cores()).map(|core| self.name(core)).collect();
        self.selected = if name.is_empty() {
            (self.selected + 1) % names.len()
        } else {
            let core = names.iter().position(|known| *known == name);
            core.ok_or_else(|| format!("there is no core `{name}` (cores: {})", names.join(" ")))?
        };
        Ok(self.place())
    }

    pub(super) fn links_text(&self, wanted: &str) -> Result<String, String> {
        let Some(system) = self.system().map(|session| session.system()) else { return Ok(String::new()) };
        let description = system.description();
        let wanted = (!wanted.is_empty()).then(|| link_named(wanted, description)).transpose()?;
        let links = description.links.iter().enumerate();
        let shown = links.filter(|(link, _)| wanted.is_none_or(|wanted| wanted == *link));
        Ok(shown.map(|(link, row)| format!("{}: {}\n", row.name, link_text(system, link))).collect())
    }

    /// Executes a command on the selected core, or on another core if the arguments name it as `core.name`. In the second case the answer
    /// is prefixed with the core's name, and the selection changes only if the command moves the run.
    pub(super) fn about_a_core(
        &mut self,
        arguments: &str,
        run: fn(&mut Console, &str) -> Result<String, String>,
    ) -> Result<String, String> {
        let error = match run(self, arguments) {
            Err(error) if self.system().is_some() => error,
            result => return result,
        };
        // Names in the selected core's program take precedence; the command has failed there.
        let names: Vec<&str> = (0..self.cores()).map(|core| self.name(core)).collect();
        let (cores, own) = core_names(arguments, &names);
        let core = match cores[..] {
            [] => return Err(error),
            [core] => core,
            _ => {
                return Err(format!(
                    "{error} (one command is about one core: each core's names in one of its own)"
                ));
            }
        };
        let (selected, cycle) = (self.selected, self.session().cycle());
        self.selected = core;
        let result = run(self, &own);
        if result.is_err() || self.session().cycle() == cycle {
            self.selected = selected;
        }
        let name = self.name(core);
        result.map(|said| format!("core {name}: {said}")).map_err(|error| format!("core {name}: {error}"))
    }
}

/// Finds core names before a dot. Returns the cores without repetition, and the text without the names: `outer.p` is `p` of core `outer`.
fn core_names(text: &str, names: &[&str]) -> (Vec<usize>, String) {
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    let (mut cores, mut own, mut rest) = (Vec::new(), String::new(), text);
    while !rest.is_empty() {
        let end = rest.find(|c| !is_name(c)).unwrap_or(rest.len());
        let (word, behind) = rest.split_at(end);
        let found = word.split_once('.').and_then(|(core, name)| {
            Some((names.iter().position(|known| *known == core)?, name)).filter(|_| !name.is_empty())
        });
        match found {
            Some((core, name)) => {
                own.push_str(name);
                if !cores.contains(&core) {
                    cores.push(core);
                }
            }
            None => own.push_str(word),
        }
        // Skip separators up to the next word.
        let next = behind.find(is_name).unwrap_or(behind.len());
        own.push_str(&behind[..next]);
        rest = &behind[next..];
    }
    (cores, own)
}
