// SPDX-License-Identifier: MIT OR Apache-2.0
//! Statements of [`enclose()`](super::enclose()) about a program, as plain data.

use super::extent::OperationExtent;
use super::interval::Interval;
use super::{Problem, ulp};
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::program::{ArrayRange, Assumption, Range};
use takt_isa::{Program, Register, Type};

/// Place of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputPlace {
    /// Register of an output port.
    Port(Register),
    /// First word of an array that is a result.
    Array(u32),
}

/// Range of an output, and for a float the bound of its error.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputBound {
    /// Name of the output port; of an array that is a result, that of its worst element.
    pub name: String,
    /// Output port, or array.
    pub place: OutputPlace,
    /// Type of the output: binary32, or a signed integer.
    pub ty: Type,
    /// Range of the output's values, over all elements of an array; `None` if a problem leaves it open.
    pub range: Option<Interval>,
    /// Bound on the error's magnitude, in the output's unit; `None` if a problem leaves it open, and for an integer: integers are decisions,
    /// which are taken from the run.
    pub error: Option<f64>,
    /// Bound on each operation's contribution to the error, by word, largest first.
    pub parts: Vec<(u32, f64)>,
    /// Hazards that leave the range open, by the word of their operation.
    pub open: Vec<u32>,
    /// Words of the operations that compute the value, on all paths.
    pub from: BTreeSet<u32>,
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

/// Promised range of a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StateRange {
    /// Range of a register.
    Register(Range),
    /// Range of every word of an array in data memory.
    Array(ArrayRange),
}

impl StateRange {
    /// The least and the largest value as numbers.
    pub fn ends(&self) -> (f64, f64) {
        match self {
            StateRange::Register(range) => range.ends(),
            StateRange::Array(range) => range.ends(),
        }
    }

    /// Type of the values: binary32, or a signed integer.
    pub fn ty(&self) -> Type {
        match self {
            StateRange::Register(range) => range.ty,
            StateRange::Array(range) => range.ty,
        }
    }

    /// Name of the state in the source.
    pub fn name(&self, program: &Program) -> String {
        match self {
            StateRange::Register(range) => program.register_text(range.register),
            StateRange::Array(range) => {
                program.data_label(range.first).map_or_else(|| program.data_text(range.first), str::to_owned)
            }
        }
    }
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
    /// State with its declared range.
    pub range: StateRange,
    /// Point at which the proof fails.
    pub moment: Moment,
    /// Values that the state may have then; `None` if they are not known as numbers.
    pub found: Option<Interval>,
}

/// State whose range no single period keeps, but all periods together do: the period's map of the states is linear and converges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converging {
    /// State with its declared range.
    pub range: StateRange,
    /// Values that the state may have at the end of any period.
    pub found: Interval,
}

/// Assumption that bounds rely on.
#[derive(Clone, Debug, PartialEq)]
pub struct Relied {
    /// Assumption of the source.
    pub assumption: Assumption,
    /// Register that the operation writes.
    pub register: Register,
    /// Outputs that depend on the value, by name.
    pub outputs: Vec<String>,
}

/// Statements about every period that begins with inputs and states within their ranges, the states free of error.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Enclosure {
    /// Bounds of the outputs that carry binary32 or integers and that a period writes, and of the arrays that are results.
    pub outputs: Vec<OutputBound>,
    /// Operations that may yield NaN or infinity, or convert out of range; only the first of each dependence chain. Sums of integers that may
    /// wrap, shifts by more than 31, accesses that may leave their array. An empty list proves that there are none of these.
    pub hazards: Vec<Hazard>,
    /// States whose declared range is not proved, at one of the two points of an induction over periods.
    pub assumed: Vec<UnprovedRange>,
    /// States whose declared range is proved for all periods together.
    pub converging: Vec<Converging>,
    /// Assumptions of the source that narrow a value, in the order of the code. The bounds hold for periods that keep them.
    pub relied: Vec<Relied>,
    /// Ranges and errors at the operations of binary32, by word.
    pub extents: BTreeMap<u32, OperationExtent>,
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
