// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values: what there is to see of registers, ports and memory, and what is set.

use super::inspector::{Inspector, number};
use crate::info;
use crate::panes::{self, Kind};
use crate::session::{Live, Place, Shown, ulp_distance};
use std::fmt::Write as _;
use takt_asm::expr::Value;
use takt_isa::Type;
use takt_isa::program::Space;

impl Inspector {
    pub(super) fn print(&self, arguments: &str) -> Result<String, String> {
        let mut text = String::new();
        for part in parts(arguments) {
            let live = self.session.parse(part)?;
            let _ = match self.session.place(&live)? {
                Some((place, ty, Some(bits))) => {
                    let note = self.note(&live, place);
                    writeln!(text, "{} = {}{note}", live.text(), Shown::every_way(ty, bits))
                }
                Some((place, _, None)) => {
                    writeln!(text, "{} = (never written){}", live.text(), self.note(&live, place))
                }
                None => writeln!(text, "{} = {}", live.text(), number(self.session.evaluate(&live)?)),
            };
        }
        Ok(text)
    }

    /// Which value of a name it is that is shown, and whether another one is on its way to its register.
    fn note(&self, live: &Live, place: Place) -> String {
        let mut notes = Vec::new();
        if let Some(label) = self.session.label(live) {
            let at = match place {
                Place::Register(register) => self.session.program().machine.register_name(register),
                Place::Word(_) => None,
            };
            notes.push(format!("{label} in {}", at.unwrap_or_default()));
        }
        if let Place::Register(register) = place
            && let Some(left) = self.session.arrives(register)
        {
            let cycles = if left == 1 { "cycle" } else { "cycles" };
            notes.push(format!("a new value is in flight, {left} {cycles} to go"));
        } else if let Place::Register(register) = place
            && let Some(bundle) = self.session.writes_yet(register)
        {
            let bundle = self.session.program().bundle_text(bundle);
            notes.push(format!("{bundle} is still to compute the one that this line would read"));
        }
        if notes.is_empty() { String::new() } else { format!("  ({})", notes.join("; ")) }
    }

    pub(super) fn info(&self, arguments: &str) -> Result<String, String> {
        info::info(&self.session, arguments)
    }

    /// The place that is to be set, its bits, and what is said of it.
    ///
    /// # Errors
    /// If something is wrong with it.
    pub(super) fn setting(&self, arguments: &str) -> Result<(Place, u32, String), String> {
        let (target, value) = arguments.split_once('=').ok_or("set takes `place = expression`")?;
        let target = self.session.parse(target)?;
        let (place, ty, _) = self
            .session
            .place(&target)?
            .ok_or_else(|| format!("`{}` is no register, port or data word", target.text()))?;
        let value = self.session.parse(value)?;
        let bits = self.session.evaluate(&value)?.bits(ty).map_err(|fault| fault.to_string())?;
        Ok((place, bits, format!("{} = {}\n", target.text(), Shown::every_way(ty, bits))))
    }

    pub(super) fn ulp(&self, arguments: &str) -> Result<String, String> {
        let [a, b] = parts(arguments)[..] else { return Err("ulp takes two expressions".to_owned()) };
        let value = |text| self.session.evaluate(&self.session.parse(text)?).map(Value::real);
        let distance = ulp_distance(value(a)?, value(b)?);
        let steps = match distance.steps {
            Some(1) => "1 number further as binary32".to_owned(),
            Some(steps) => format!("{steps} numbers further as binary32"),
            None => "a NaN is no distance away".to_owned(),
        };
        Ok(format!("{a} is {:.3} ulp from {b}; {steps}\n", distance.error))
    }

    pub(super) fn check(&self, arguments: &str) -> Result<String, String> {
        let live = self.session.parse(arguments)?;
        let holds = self.session.evaluate(&live);
        if holds.as_ref().is_ok_and(|value| !value.is_zero()) {
            return Ok(String::new());
        }
        let why = holds.err().map_or(String::new(), |error| format!(" ({error})"));
        let mut text = format!("check failed in {}: {}{why}", self.session.time(), live.text());
        for name in live.places() {
            if let Ok(part) = self.session.parse(name) {
                let _ = write!(text, "\n    {name} = {}", self.short(&part));
            }
        }
        Err(text)
    }

    pub(super) fn registers(&self, pattern: &str) -> String {
        let pattern = if pattern.is_empty() { "*" } else { pattern };
        let kinds = [Kind::Input, Kind::Output, Kind::Register].into_iter();
        let rows = kinds.flat_map(|kind| panes::named(&self.session, kind));
        let rows: Vec<_> = rows.filter(|row| crate::matches(pattern, &row.name)).collect();
        let width = rows.iter().map(|row| row.name.len()).max().unwrap_or(0).max(12);
        let line =
            |row: &panes::Named| format!("{:<width$} {:<5} {}\n", row.name, row.place, row.every_way());
        rows.iter().map(line).collect()
    }

    pub(super) fn ports(&self) -> String {
        let mut text = String::new();
        for (word, kind) in [("in", Kind::Input), ("out", Kind::Output)] {
            for row in panes::named(&self.session, kind) {
                let _ = writeln!(text, "{word:<4} {:<16} {}", row.name, row.every_way());
            }
        }
        text
    }

    pub(super) fn memory(&self, arguments: &str) -> Result<String, String> {
        let (address, count) = match arguments.rsplit_once(' ') {
            Some((address, count)) if count.parse::<usize>().is_ok() => (address, count.parse().unwrap_or(1)),
            _ => (arguments, 8usize),
        };
        let live = self.session.parse(address)?;
        let start = self.session.evaluate(&live)?.integer().map_err(|fault| fault.to_string())?;
        let memory = self.session.emulator().memory();
        let start = usize::try_from(start)
            .ok()
            .filter(|start| *start < memory.len())
            .ok_or_else(|| format!("data word {start}: the memory has words 0 to {}", memory.len() - 1))?;
        let program = self.session.program();
        let mut text = String::new();
        for (word, bits) in memory.iter().enumerate().skip(start).take(count) {
            let labels = program.symbols.iter().filter(|symbol| symbol.space == Space::Data);
            let label = labels.into_iter().find(|symbol| symbol.address as usize == word);
            let label = label.map_or("", |symbol| symbol.name.as_str());
            let _ = writeln!(text, "{word:>5} {label:<12} {}", Shown::every_way(Type::F, *bits));
        }
        Ok(text)
    }
}

/// The parts of a list between commas that stand in no brackets.
fn parts(text: &str) -> Vec<&str> {
    let (mut depth, mut start, mut parts) = (0i32, 0, Vec::new());
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth -= 1,
            b',' if depth == 0 => {
                parts.push(text[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(text[start..].trim());
    parts
}
