// SPDX-License-Identifier: MIT OR Apache-2.0
//! Statements of [`enclose()`](super::enclose()) about a program, as plain data.

use super::interval::Interval;
use super::{Problem, ulp};
use takt_isa::Register;
use takt_isa::program::Range;

/// Error bound of an output.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputBound {
    /// Name of the output port.
    pub name: String,
    /// Register of the output port.
    pub register: Register,
    /// Range of the output's values; `None` if a problem leaves it open.
    pub range: Option<Interval>,
    /// Bound on the error's magnitude, in the output's unit; `None` if a problem leaves it open.
    pub error: Option<f64>,
    /// Bound on each operation's contribution to the error, by word, largest first.
    pub parts: Vec<(u32, f64)>,
}

impl OutputBound {
    /// Bound in ulps of the output's largest value.
    pub fn ulps(&self) -> Option<f64> {
        Some(self.error? / ulp(self.range?.magnitude()))
    }
}

/// Hazard: an operation that may have no finite result, or that depends on bits without an enclosure.
#[derive(Clone, Debug, PartialEq)]
pub struct Hazard {
    /// Word of the operation, an index into [`Program::code`].
    pub word: u32,
    /// Reason why the operation has no enclosure.
    pub problem: Problem,
    /// Registers that the operation reads, each with the range of its values if known.
    pub operands: Vec<(Register, Option<Interval>)>,
}

/// Point of the induction over periods at which a state must lie in its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// Start of the first period: base of the induction.
    First,
    /// End of a period that began with all states in their ranges: step of the induction.
    Later,
}

/// State that was not proved to lie in its range.
#[derive(Clone, Debug, PartialEq)]
pub struct UnprovedRange {
    /// State's register and declared range.
    pub range: Range,
    /// Point at which the proof fails.
    pub moment: Moment,
    /// Values that the state may have then; `None` if they are not known as numbers.
    pub found: Option<Interval>,
}

/// State whose range no single period keeps, but all periods together do: the period's map of the states is linear and converges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converging {
    /// State's register and declared range.
    pub range: Range,
    /// Values that the state may have at the end of any period.
    pub found: Interval,
}

/// Statements about every period that begins with inputs and states within their ranges, the states free of error.
#[derive(Clone, Debug, PartialEq)]
pub struct Enclosure {
    /// Bounds of the outputs that carry binary32 and that a period writes.
    pub outputs: Vec<OutputBound>,
    /// Operations that may yield NaN or infinity, or convert out of range; only the first of each dependence chain. An empty list proves:
    /// no NaN, no overflow, no division by zero, no conversion out of range.
    pub hazards: Vec<Hazard>,
    /// States whose declared range is not proved, at one of the two points of an induction over periods.
    pub assumed: Vec<UnprovedRange>,
    /// States whose declared range is proved for all periods together.
    pub converging: Vec<Converging>,
    /// Operations executed abstractly, iterations of loops included.
    pub operations: u64,
}

impl Enclosure {
    /// States not proved to begin the first period in their range. Unless empty, the other statements need not hold.
    pub fn first(&self) -> impl Iterator<Item = &UnprovedRange> {
        self.assumed.iter().filter(|state| state.moment == Moment::First)
    }

    /// States not proved to end a period in their range.
    pub fn later(&self) -> impl Iterator<Item = &UnprovedRange> {
        self.assumed.iter().filter(|state| state.moment == Moment::Later)
    }
}
