// SPDX-License-Identifier: MIT OR Apache-2.0
//! What became of a program's counted loops, for its report.

use crate::context::Context;
use crate::expand::loops::LoopNote;
use crate::report::source::Lines;
use std::fmt;

/// The number of iterations of a counted loop each time it is entered.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LoopCount {
    /// Always so many, at least one.
    Exactly(u32),
    /// Up to so many: it depends on a register, or on the iterations of the loops around. Code before the loop passes over it where
    /// there would be none.
    AtMost(u32),
}

impl LoopCount {
    /// The most that there can be.
    pub const fn most(self) -> u32 {
        match self {
            LoopCount::Exactly(count) | LoopCount::AtMost(count) => count,
        }
    }

    /// True if there are always as many.
    pub const fn is_exact(self) -> bool {
        matches!(self, LoopCount::Exactly(_))
    }
}

impl fmt::Display for LoopCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.most() == 1 { "" } else { "s" };
        write!(f, "{}{} iteration{plural}", if self.is_exact() { "" } else { "up to " }, self.most())
    }
}

/// The form that a loop has in the program.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LoopForm {
    /// It is written out.
    Unrolled(WrittenOut),
    /// It runs, with so many of its iterations in one.
    Rolled(u32),
}

/// The reason why a loop is written out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WrittenOut {
    /// Its body needs the index when it is assembled.
    NeedsIndex,
    /// `unroll` says so.
    Asked,
    /// It has few iterations, and no loop within.
    Few,
}

impl fmt::Display for WrittenOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            WrittenOut::NeedsIndex => "its body needs the index when it is assembled",
            WrittenOut::Asked => "by `unroll`",
            WrittenOut::Few => "it is short",
        })
    }
}

/// A counted loop of the source, or an equation between slices.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CountedLoop {
    /// The name that counts; `None` for an equation between slices.
    pub name: Option<String>,
    /// The file that it stands in.
    pub file: String,
    /// The line, from 1.
    pub line: u32,
    /// Its iterations.
    pub count: LoopCount,
    /// What became of it.
    pub form: LoopForm,
}

impl fmt::Display for CountedLoop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, name) = self.name.as_ref().map_or(("slice", ""), |name| ("loop ", name));
        write!(f, "{what}{name} at {}:{}: ", self.file, self.line)?;
        write!(f, "{}", self.count)?;
        match self.form {
            LoopForm::Unrolled(why) => write!(f, ", written out: {why}"),
            LoopForm::Rolled(1) => Ok(()),
            LoopForm::Rolled(unroll) => write!(f, ", unrolled by {unroll}"),
        }
    }
}

/// The reports of loops, in the order of the source as it is expanded.
pub(crate) fn reports(context: &Context, notes: &[LoopNote]) -> Vec<CountedLoop> {
    let sources = &context.reports.sources;
    let report = |note: &LoopNote| {
        let file = sources.files().get(sources.file_of(note.span.start))?;
        let line = Lines::of(&file.text).index(note.span.start - file.base) as u32 + 1;
        let name = Some(context.scopes.text(note.variable)).filter(|name| !name.starts_with(':'));
        let (name, file) = (name.map(str::to_owned), file.name.to_string());
        Some(CountedLoop { name, file, line, count: note.count, form: note.form })
    };
    notes.iter().filter_map(report).collect()
}
