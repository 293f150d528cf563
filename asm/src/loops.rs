// SPDX-License-Identifier: MIT OR Apache-2.0
//! What became of a program's counted loops, for its report.

use crate::context::Context;
use crate::expand::loops::LoopNote;
use crate::report::source::Lines;
use std::fmt;

/// The iterations of a loop.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LoopCount {
    /// So many.
    Exactly(u32),
    /// Up to so many: it depends on a register, or on the loops around.
    AtMost(u32),
}

/// The form that a loop has in the program.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LoopForm {
    /// It is written out.
    Unrolled,
    /// It runs, with so many of its iterations in one.
    Rolled(u32),
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
        let plural = |count: u32| if count == 1 { "" } else { "s" };
        match self.count {
            LoopCount::Exactly(count) => write!(f, "{count} iteration{}", plural(count))?,
            LoopCount::AtMost(count) => write!(f, "up to {count} iteration{}", plural(count))?,
        }
        match self.form {
            LoopForm::Unrolled => write!(f, ", written out"),
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
