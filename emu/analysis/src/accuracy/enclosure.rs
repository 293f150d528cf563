// SPDX-License-Identifier: MIT OR Apache-2.0
//! The statements of [`enclose()`](super::enclose()) about a program, as plain data.

use super::interval::Interval;
use super::{Problem, ulp};
use takt_isa::Register;
use takt_isa::program::Range;

/// The bound of an output's error.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputBound {
    /// Its name.
    pub name: String,
    /// Its register.
    pub register: Register,
    /// The values that it may have; `None` if a problem leaves that open.
    pub range: Option<Interval>,
    /// The magnitude of its error at most.
    pub error: Option<f64>,
    /// The most that each operation's rounding adds to that, by word, the largest first.
    pub parts: Vec<(u32, f64)>,
}

impl OutputBound {
    /// The bound in ulps of the output's largest value.
    pub fn ulps(&self) -> Option<f64> {
        Some(self.error? / ulp(self.range?.magnitude()))
    }
}

/// A hazard: an operation that may go wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Hazard {
    /// Index into [`Program::code`].
    pub word: u32,
    /// The hazard.
    pub problem: Problem,
    /// The registers that the operation reads, and the numbers that they may hold, if known.
    pub operands: Vec<(Register, Option<Interval>)>,
}

/// The moment at which a state must lie in its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The first period begins: the base of the induction over periods.
    First,
    /// A period ends that began with all states in their ranges: its step.
    Later,
}

/// A state that was not shown to be in its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Assumed {
    /// The state.
    pub range: Range,
    /// The moment.
    pub moment: Moment,
    /// The values that it may then have; `None` if that is not known as a number.
    pub found: Option<Interval>,
}

/// The enclosure of every period that begins with inputs and states within their ranges, the states free of error.
#[derive(Clone, Debug, PartialEq)]
pub struct Enclosure {
    /// The outputs that carry binary32 and that a period writes.
    pub outputs: Vec<OutputBound>,
    /// Operations that may have no number as their result, or convert a number that fits no integer; of those that depend on such an
    /// operation, the first. If there are none: no NaN, no overflow, no division by zero, no conversion out of range.
    pub hazards: Vec<Hazard>,
    /// States whose range is promised by the source and not proved, at one of the two moments of an induction over periods.
    pub assumed: Vec<Assumed>,
    /// Operations gone through.
    pub operations: u64,
}

impl Enclosure {
    /// States not shown to begin the first period in their range: where there is one, the rest need not hold.
    pub fn first(&self) -> impl Iterator<Item = &Assumed> {
        self.assumed.iter().filter(|state| state.moment == Moment::First)
    }

    /// States not shown to end a period in their range.
    pub fn later(&self) -> impl Iterator<Item = &Assumed> {
        self.assumed.iter().filter(|state| state.moment == Moment::Later)
    }
}
