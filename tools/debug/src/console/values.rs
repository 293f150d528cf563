// SPDX-License-Identifier: MIT OR Apache-2.0
//! Console commands that show and set values of registers, ports and memory.

use super::inspector::{Inspector, number};
use crate::info;
use crate::panes::{self, Kind};
use crate::session::{Place, ValueNotations, WatchExpression, noted, ulp_distance};
use std::fmt::Write as _;
use takt_isa::Type;
use takt_isa::program::Space;

impl Inspector {
    pub(super) fn print(&self, arguments: &str) -> Result<String, String> {
        let mut text = String::new();
        let each = |part: &str| self.session.elements(part).unwrap_or_else(|| vec![part.to_owned()]);
        for part in parts(arguments).into_iter().flat_map(each) {
            let live = self.session.parse(&part)?;
            let _ = match self.session.place(&live)? {
                Some((place, ty, Some(bits))) => {
                    let note = self.note(&live, Some(place));
                    writeln!(text, "{} = {}{note}", live.text(), ValueNotations::every_way(ty, bits))
                }
                Some((place, _, None)) => {
                    writeln!(text, "{} = (never written){}", live.text(), self.note(&live, Some(place)))
                }
                None => {
                    let value = number(self.session.evaluate(&live)?);
                    writeln!(text, "{} = {value}{}", live.text(), self.note(&live, None))
                }
            };
        }
        Ok(text)
    }

    /// Note on a value: which value of the name it is, if the name has several, and which operands are stale.
    fn note(&self, live: &WatchExpression, place: Option<Place>) -> String {
        let label = self.session.label(live).map(|label| {
            let at = match place {
                Some(Place::Register(register)) => self.session.program().machine.register_name(register),
                Some(Place::Word(_)) | None => None,
            };
            format!("{label} in {}", at.unwrap_or_default())
        });
        let notes: Vec<String> = label.into_iter().chain(self.session.note(live)).collect();
        noted((!notes.is_empty()).then(|| notes.join("; ")))
    }

    pub(super) fn info(&self, arguments: &str) -> Result<String, String> {
        info::info(&self.session, arguments)
    }

    /// Parses an assignment: destination, new bits, and the answer to print.
    ///
    /// # Errors
    /// If the assignment is malformed, or its destination cannot be set.
    pub(super) fn setting(&self, arguments: &str) -> Result<(Place, u32, String), String> {
        let (target, value) = arguments.split_once('=').ok_or("set takes `place = expression`")?;
        let target = self.session.parse(target)?;
        let (place, ty, _) = self
            .session
            .place(&target)?
            .ok_or_else(|| format!("`{}` is not a register, port or data word", target.text()))?;
        let value = self.session.parse(value)?;
        let bits = self.session.evaluate(&value)?.bits(ty).map_err(|fault| fault.to_string())?;
        let note = noted(self.session.note(&value));
        Ok((place, bits, format!("{} = {}{note}\n", target.text(), ValueNotations::every_way(ty, bits))))
    }

    pub(super) fn ulp(&self, arguments: &str) -> Result<String, String> {
        let [a, b] = parts(arguments)[..] else { return Err("ulp takes two expressions".to_owned()) };
        let value = |text| {
            let live = self.session.parse(text)?;
            Ok::<_, String>((self.session.evaluate(&live)?.real(), self.session.note(&live)))
        };
        let ((first, of_first), (second, of_second)) = (value(a)?, value(b)?);
        let distance = ulp_distance(first, second);
        let note = noted(of_first.or(of_second));
        let steps = match distance.steps {
            Some(1) => "1 number further as binary32".to_owned(),
            Some(steps) => format!("{steps} numbers further as binary32"),
            None => "a NaN has no distance".to_owned(),
        };
        Ok(format!("{a} is {:.3} ulp from {b}; {steps}{note}\n", distance.error))
    }

    pub(super) fn check(&self, arguments: &str) -> Result<String, String> {
        let live = self.session.parse(arguments)?;
        let holds = self.session.evaluate(&live);
        if holds.as_ref().is_ok_and(|value| !value.is_zero()) {
            let note = self.session.note(&live);
            return Ok(note.map_or(String::new(), |note| format!("{} holds  ({note})\n", live.text())));
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
        let line = |row: &panes::NamedRegister| {
            format!("{:<width$} {:<5} {}\n", row.name, row.place, row.every_way())
        };
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
        let note = self.session.note(&live);
        let memory = self.session.emulator().memory();
        let start = usize::try_from(start)
            .ok()
            .filter(|start| *start < memory.len())
            .ok_or_else(|| format!("data word {start}: the memory has words 0 to {}", memory.len() - 1))?;
        let program = self.session.program();
        let mut text = note.map_or(String::new(), |note| format!("({note})\n"));
        for (word, bits) in memory.iter().enumerate().skip(start).take(count) {
            let labels = program.symbols.iter().filter(|symbol| symbol.space == Space::Data);
            let label = labels.into_iter().find(|symbol| symbol.address as usize == word);
            let label = label.map_or("", |symbol| symbol.name.as_str());
            let _ = writeln!(text, "{word:>5} {label:<12} {}", ValueNotations::every_way(Type::F, *bits));
        }
        Ok(text)
    }
}

/// Splits a list at commas outside brackets.
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
