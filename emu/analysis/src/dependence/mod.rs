// SPDX-License-Identifier: MIT OR Apache-2.0
//! Data-flow analysis of response time: the number of periods after which an output follows an input.
//!
//! For one input port, the abstract value of every register and data word is the age, in periods, of the reads of that port
//! on which it depends ([`Periods`]): the least age over all paths (no response comes earlier), and an age that is not
//! exceeded on any path. A `wait` makes everything one period older. A value that is written under a branch depends on the
//! branch's condition (control dependence, found by post-dominators). An address that is not a constant may be that of any
//! word. `docs/analysis.md` has the argument.
//!
//! Only the periods that repeat are analysed, since code that runs once, or only at first, responds to no later input.

mod cell;
mod dominators;
mod graph;
mod solve;

use crate::error::BoundError;
use graph::Flat;
use solve::Solved;
use std::collections::BTreeSet;
use takt_isa::{Program, Register};

/// The largest age that is told apart. A greater one counts as this one for the least, and as unbounded for the most.
pub const MAX_PERIODS: u32 = 1 << 12;
/// Limit on the bundles of all periods, a subroutine's counted for each call path. In a larger program, every output may depend on
/// every input.
pub const MAX_NODES: usize = 1 << 14;
/// Limit on the iterations to the fixed point, for each input; one iteration covers one period.
pub const MAX_ROUNDS: u32 = MAX_PERIODS + 16;

/// The response time of an output, in periods after the one that reads the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Periods {
    /// The output cannot follow earlier; 0 means in the period of the read itself.
    pub least: u32,
    /// It follows by then, whatever the branches and addresses; `None` if these can delay it without end.
    pub most: Option<u32>,
    /// True if states carry the dependence on to later periods, as a filter's do.
    pub lasting: bool,
}

impl Periods {
    /// The response within the period of the read, always.
    pub const DIRECT: Periods = Periods { least: 0, most: Some(0), lasting: false };
    /// The response of which nothing is known.
    pub const UNKNOWN: Periods = Periods { least: 0, most: None, lasting: true };

    /// The response to two inputs that change together: the sooner of two.
    #[must_use]
    pub fn sooner(self, other: Periods) -> Periods {
        let most = match (self.most, other.most) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        };
        Periods { least: self.least.min(other.least), most, lasting: self.lasting || other.lasting }
    }
}

/// The event with which the value of an output port leaves the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sent {
    /// Each write of the port.
    Written,
    /// The `wait`, for ports that are latched: it publishes what earlier bundles have written.
    AtWait,
    /// A write to this other output port.
    By(Register),
}

/// The data-flow graph of a program; empty if nothing is known of it.
#[derive(Debug)]
pub struct Dependence {
    flat: Option<Flat>,
}

impl Dependence {
    /// Analyses a program. `sent_by` has the pairs (port, other port) in which a write to the other port sends the first.
    ///
    /// # Errors
    /// Those of [`crate::bound`], if a loop or a call cannot be followed.
    pub fn new(
        program: &Program,
        sent_by: &BTreeSet<(Register, Register)>,
    ) -> Result<Dependence, BoundError> {
        Ok(Dependence { flat: Flat::new(program, sent_by)? })
    }

    /// The dependence of every output on every input, for a program of which nothing is known.
    pub const fn unknown() -> Dependence {
        Dependence { flat: None }
    }

    /// The dependences on an input port.
    pub fn on(&self, input: Register) -> Dependents<'_> {
        Dependents { solved: self.flat.as_ref().map(|flat| Solved::new(flat, input)) }
    }
}

/// The dependences on an input port.
#[derive(Debug)]
pub struct Dependents<'a> {
    solved: Option<Solved<'a>>,
}

impl Dependents<'_> {
    /// The response time of an output port; `None` if it never follows the input.
    pub fn output(&self, output: Register, sent: Sent) -> Option<Periods> {
        match &self.solved {
            Some(solved) => solved.output(output, sent),
            None => Some(Periods::UNKNOWN),
        }
    }
}
