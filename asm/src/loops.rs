// SPDX-License-Identifier: MIT OR Apache-2.0
//! Final form of a program's counted loops, for its report.

use std::fmt;

/// The number of iterations of a counted loop each time it is entered.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LoopCount {
    /// A constant count, at least one.
    Exactly(u32),
    /// Upper bound of a count that depends on a register, or on the iterations of the enclosing loops. Code before the loop skips it
    /// if the count is zero.
    AtMost(u32),
}

impl LoopCount {
    /// The largest possible count.
    pub const fn most(self) -> u32 {
        match self {
            LoopCount::Exactly(count) | LoopCount::AtMost(count) => count,
        }
    }

    /// The count is constant.
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
    /// A copy of the body for each iteration.
    Unrolled(UnrollReason),
    /// A loop at run time, with this many of the source's iterations in each turn.
    Rolled(u32),
}

/// The reason why a loop is written out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum UnrollReason {
    /// The body needs the index when it is assembled.
    NeedsIndex,
    /// The source asks for it by `unroll`.
    Asked,
    /// The loop has few iterations, and contains no loop.
    Few,
}

impl fmt::Display for UnrollReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            UnrollReason::NeedsIndex => "its body needs the index when it is assembled",
            UnrollReason::Asked => "by `unroll`",
            UnrollReason::Few => "it is short",
        })
    }
}

/// A counted loop of the source, or an equation between slices.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CountedLoop {
    /// Name of the index variable; `None` for an equation between slices.
    pub name: Option<String>,
    /// Source file of the loop.
    pub file: String,
    /// Line in the file, from 1.
    pub line: u32,
    /// Iterations each time that the loop is entered.
    pub count: LoopCount,
    /// Form of the loop in the program.
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
