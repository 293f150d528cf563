// SPDX-License-Identifier: MIT OR Apache-2.0
//! Data-flow analysis of response time: the number of periods after which an output follows an input.
//!
//! The abstract value of every register and data word, with respect to one input port, is the age, in periods, of the reads of that port on
//! which it depends ([`Periods`]): the least age over all paths (no response comes earlier), and an age that is not exceeded on any path. A
//! `wait` makes every value one period older. A value that is written under a branch depends on the branch's condition (control dependence,
//! found by post-dominators). An address that is not constant may refer to any word. `docs/analysis.md` has the argument.
//!
//! Periods that do not repeat are left out, since code that runs once, or only at first, responds to no later input.

mod cell;
mod dominators;
mod graph;
mod solve;

use crate::error::BoundError;
use graph::PeriodGraphs;
use solve::Solution;
use std::collections::BTreeSet;
use takt_isa::{Program, Register};

/// Largest age that is distinguished. A greater age is clamped to it in `least`, and unbounded in `most`.
pub const MAX_PERIODS: u32 = 1 << 12;
/// Limit on the bundles of all periods, a subroutine's counted for each call path. In a larger program, every output may depend on
/// every input.
pub const MAX_NODES: usize = 1 << 14;
/// Limit on the iterations to the fixed point, for each input; one iteration covers one period.
pub const MAX_ROUNDS: u32 = MAX_PERIODS + 16;

/// Response time of an output, in periods after the period that reads the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Periods {
    /// Least age: the output cannot follow earlier; 0 means in the period of the read itself.
    pub least: u32,
    /// Greatest age: the output has followed by then on every path; `None` if branches or addresses can delay it without end.
    pub most: Option<u32>,
    /// States carry the dependence on to later periods, as a filter's do.
    pub lasting: bool,
}

impl Periods {
    /// Response within the period of the read, always.
    pub const DIRECT: Periods = Periods { least: 0, most: Some(0), lasting: false };
    /// Response that excludes nothing, for programs that are not analysed.
    pub const UNKNOWN: Periods = Periods { least: 0, most: None, lasting: true };

    /// Response to two inputs that change together: the sooner of two.
    #[must_use]
    pub fn sooner(self, other: Periods) -> Periods {
        let most = match (self.most, other.most) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        };
        Periods { least: self.least.min(other.least), most, lasting: self.lasting || other.lasting }
    }
}

/// Event with which the value of an output port leaves the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum OutputEvent {
    /// Each write of the port sends its value.
    Written,
    /// The `wait` sends, for latched ports: it publishes earlier bundles' writes.
    AtWait,
    /// A write to this other output port sends.
    By(Register),
}

/// Data-flow graph of a program; empty if the program is not analysed.
#[derive(Debug)]
pub struct Dependence {
    flat: Option<PeriodGraphs>,
}

impl Dependence {
    /// Analyses a program. `sent_by` holds pairs (port, other port): a write to the other port sends the first.
    ///
    /// # Errors
    /// The errors of [`crate::bound`], if a loop or a call cannot be followed.
    pub fn new(
        program: &Program,
        sent_by: &BTreeSet<(Register, Register)>,
    ) -> Result<Dependence, BoundError> {
        Ok(Dependence { flat: PeriodGraphs::new(program, sent_by)? })
    }

    /// Every output depends on every input: for programs that cannot be analysed.
    pub const fn unknown() -> Dependence {
        Dependence { flat: None }
    }

    /// Dependences on an input port.
    pub fn on(&self, input: Register) -> Dependents<'_> {
        Dependents { solved: self.flat.as_ref().map(|flat| Solution::new(flat, input)) }
    }
}

/// Dependences on an input port, solved to a fixed point.
#[derive(Debug)]
pub struct Dependents<'a> {
    solved: Option<Solution<'a>>,
}

impl Dependents<'_> {
    /// Response time of an output port; `None` if it never follows the input.
    pub fn output(&self, output: Register, sent: OutputEvent) -> Option<Periods> {
        match &self.solved {
            Some(solved) => solved.output(output, sent),
            None => Some(Periods::UNKNOWN),
        }
    }
}
