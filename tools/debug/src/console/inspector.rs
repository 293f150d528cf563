// SPDX-License-Identifier: MIT OR Apache-2.0
//! View of one core at its position: place, source, operations in flight, displayed values.

use crate::panes::{self, InFlightOperation, Panes};
use crate::session::{Session, ValueNotations, WatchExpression, hex_float, noted};
use std::fmt::Write as _;
use takt_asm::expr::Value;
use takt_isa::timing::Cycle;

/// Session of one core, with the expressions on display.
pub(super) struct Inspector {
    pub(super) session: Session,
    displays: Vec<WatchExpression>,
    /// Values of named registers before the last command that moved the run or changed a value.
    before: Vec<Option<u32>>,
}

impl Inspector {
    pub(super) fn new(session: Session) -> Inspector {
        let before = panes::values(&session);
        Inspector { session, displays: Vec::new(), before }
    }

    /// Current cycle, and values of the named registers.
    pub(super) fn position(&self) -> (Cycle, Vec<Option<u32>>) {
        (self.session.cycle(), panes::values(&self.session))
    }

    /// Makes the values from before a command the reference for change marks, if the position or a value differs.
    pub(super) fn moved_from(&mut self, before: (Cycle, Vec<Option<u32>>)) {
        if self.position() != before {
            self.before = before.1;
        }
    }

    pub(super) fn panes(&mut self) -> Panes {
        let displays = self.displayed();
        Panes::new(&mut self.session, &self.before, displays)
    }

    /// Expressions on display with their values.
    pub(super) fn displayed(&self) -> Vec<(String, String)> {
        self.displays.iter().map(|live| (live.text().to_owned(), self.short(live))).collect()
    }

    /// Value in the notation of its type, with a note if it is stale.
    pub(super) fn short(&self, live: &WatchExpression) -> String {
        let value = match self.session.place(live) {
            Ok(Some((_, ty, Some(bits)))) => ValueNotations::new(ty, bits).text,
            Ok(Some((.., None))) => "(never written)".to_owned(),
            _ => match self.session.evaluate(live) {
                Ok(value) => number(value),
                Err(error) => return format!("({error})"),
            },
        };
        format!("{value}{}", noted(self.session.note(live)))
    }

    /// Position in one line, followed by the source line, the bundle and the active calls.
    pub(super) fn place(&mut self) -> String {
        format!("{}\n{}", panes::head(&mut self.session), self.at_hand())
    }

    /// Current source line and next bundle, with the active calls.
    pub(super) fn at_hand(&self) -> String {
        let (session, mut text) = (&self.session, String::new());
        if let Some(location) = session.location()
            && let Some(line) = session.source_line(location)
        {
            let _ = writeln!(text, "{:>5}  {}", location.line, line.trim_end());
        }
        for (slot, operation) in panes::bundle(session) {
            if let Some(operation) = operation {
                let _ = writeln!(text, "    {slot:<4} {operation}");
            }
        }
        for call in panes::calls(session) {
            let _ = writeln!(text, "    called from {call}");
        }
        for counted in panes::loops(session) {
            let _ = writeln!(text, "    {counted}");
        }
        text
    }

    pub(super) fn flight(&self) -> String {
        let mut text = String::new();
        let flying = panes::flight(&self.session);
        let width = flying.iter().map(|row| row.register.len()).max().unwrap_or(0).max(12);
        for InFlightOperation { left, register, mnemonic, from } in flying {
            let cycles = if left == 1 { "cycle" } else { "cycles" };
            let _ = writeln!(text, "{left:>3} {cycles:<6}  {register:<width$} {mnemonic} of {from}");
        }
        if text.is_empty() { "nothing is in flight\n".to_owned() } else { text }
    }

    pub(super) fn stalls(&self) -> String {
        let rows = panes::stalls(&self.session);
        rows.iter().map(|(cycles, what)| format!("{cycles:>10}  {what}\n")).collect()
    }

    pub(super) fn list(&self, arguments: &str) -> Result<String, String> {
        let here = self.session.location();
        let line = match (arguments, here) {
            ("", Some(location)) => location.line,
            ("", None) => return Err("no source line belongs to this position".to_owned()),
            (text, _) => text.parse().map_err(|_| format!("`{text}` is not a line number"))?,
        };
        let file = here.map_or(0, |location| location.file);
        let lines = panes::lines(&self.session, file, line.saturating_sub(5)..=line.saturating_add(5));
        let lines = lines.ok_or_else(|| {
            let name = self.session.program().files.get(file as usize).map_or("it", String::as_str);
            format!(
                "the program carries no source of {name}: an image has its sources unless it was assembled with --strip"
            )
        })?;
        let mut text = String::new();
        for line in lines {
            let mark = if line.next { '>' } else { ' ' };
            let _ = writeln!(text, "{mark}{:>5}  {}", line.number, line.text);
        }
        Ok(text)
    }

    pub(super) fn display(&mut self, arguments: &str) -> Result<String, String> {
        if arguments.is_empty() {
            self.displays.clear();
            return Ok(String::new());
        }
        let live = self.session.parse(arguments)?;
        let text = format!("{} = {}\n", live.text(), self.short(&live));
        self.displays.push(live);
        Ok(text)
    }
}

/// Text of a computed value: a binary32 number with its hexadecimal notation, any other number with the nearest binary32.
pub(super) fn number(value: Value) -> String {
    let Value::Real(real) = value else { return value.to_string() };
    let near = real as f32;
    if f64::from(near) == real {
        format!("{value}  {}", hex_float(near))
    } else {
        format!("{value}  (binary32: {near:?})")
    }
}
