// SPDX-License-Identifier: MIT OR Apache-2.0
//! Shows one core at its position: its place, its source, the operations in flight, displayed values.

use crate::panes::{self, Flying, Panes};
use crate::session::{Live, Session, Shown, hex_float};
use std::fmt::Write as _;
use takt_asm::expr::Value;
use takt_isa::timing::Cycle;

/// A core's session and what is displayed of it.
pub(super) struct Inspector {
    pub(super) session: Session,
    displays: Vec<Live>,
    /// The values of named registers before the last command that moved or changed something.
    before: Vec<Option<u32>>,
}

impl Inspector {
    pub(super) fn new(session: Session) -> Inspector {
        let before = panes::values(&session);
        Inspector { session, displays: Vec::new(), before }
    }

    /// The cycle, and what named registers hold.
    pub(super) fn position(&self) -> (Cycle, Vec<Option<u32>>) {
        (self.session.cycle(), panes::values(&self.session))
    }

    /// Marks what has changed since a position, if anything has.
    pub(super) fn moved_from(&mut self, before: (Cycle, Vec<Option<u32>>)) {
        if self.position() != before {
            self.before = before.1;
        }
    }

    pub(super) fn panes(&mut self) -> Panes {
        let displays = self.displayed();
        Panes::new(&mut self.session, &self.before, displays)
    }

    /// The displayed expressions with their values.
    pub(super) fn displayed(&self) -> Vec<(String, String)> {
        self.displays.iter().map(|live| (live.text().to_owned(), self.short(live))).collect()
    }

    /// A value in one way, that of its type.
    pub(super) fn short(&self, live: &Live) -> String {
        match self.session.place(live) {
            Ok(Some((_, ty, Some(bits)))) => Shown::new(ty, bits).text,
            Ok(Some((.., None))) => "(never written)".to_owned(),
            _ => self.session.evaluate(live).map_or_else(|error| format!("({error})"), number),
        }
    }

    /// The position in one line, then the source line, the bundle and the calls.
    pub(super) fn place(&mut self) -> String {
        format!("{}\n{}", panes::head(&mut self.session), self.at_hand())
    }

    /// The source line and the bundle at this position, and the calls that lead to it.
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
        for Flying { left, register, mnemonic, from } in flying {
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
            (text, _) => text.parse().map_err(|_| format!("`{text}` is no line number"))?,
        };
        let file = here.map_or(0, |location| location.file);
        let lines = panes::lines(&self.session, file, line.saturating_sub(5)..=line.saturating_add(5));
        let lines = lines.ok_or_else(|| {
            let name = self.session.program().files.get(file as usize).map_or("it", String::as_str);
            format!(
                "the program carries no source of {name}: an image does unless it is assembled with --strip"
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

/// A computed value, and the nearest binary32.
pub(super) fn number(value: Value) -> String {
    let Value::Real(real) = value else { return value.to_string() };
    let near = real as f32;
    if f64::from(near) == real {
        format!("{value}  {}", hex_float(near))
    } else {
        format!("{value}  (binary32: {near:?})")
    }
}
