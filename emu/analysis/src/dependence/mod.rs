//! After how many periods an output follows an input: a data-flow analysis over registers, data memory and branches.
//!
//! For one input port it keeps, for every register and data word, the age of the reads that the value depends on ([`Periods`]): the
//! least over all ways through the program, which no response precedes, and a most that holds on every way. A `wait` makes
//! everything a period older. Branches count as dependences of what is written under them (control dependence, by post-dominators).
//! An address that is not a constant may be any word. `docs/analysis.md` has the argument.
//!
//! Only the periods that repeat are looked at: what runs once, or only at first, answers no later command.

mod cell;
mod dominators;
mod graph;
mod solve;

use crate::error::BoundError;
use graph::Flat;
use solve::Solved;
use std::collections::BTreeSet;
use takt_isa::{Program, Register};

/// The most periods that are distinguished; more count as at least so many, without an upper limit.
pub const MAX_PERIODS: u32 = 1 << 12;
/// Bundles of all periods at most, those of a subroutine once for each way of calling it. Beyond, everything may depend on everything.
pub const MAX_NODES: usize = 1 << 14;
/// Rounds of periods that are gone through at most, for each input.
pub const MAX_ROUNDS: u32 = MAX_PERIODS + 16;

/// So many periods after that of a read an output follows from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Periods {
    /// It cannot in fewer: 0 if it can in the period of the read itself.
    pub least: u32,
    /// It does after so many at most, whatever the branches and addresses; `None` if these can put it off without end.
    pub most: Option<u32>,
    /// True if states carry the dependence on to later periods.
    pub lasting: bool,
}

impl Periods {
    /// Within the period of the read, always.
    pub const DIRECT: Periods = Periods { least: 0, most: Some(0), lasting: false };
    /// The top of the domain: nothing is known.
    pub const UNKNOWN: Periods = Periods { least: 0, most: None, lasting: true };

    /// Of an output that depends on two inputs which change together.
    #[must_use]
    pub fn sooner(self, other: Periods) -> Periods {
        let most = match (self.most, other.most) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        };
        Periods { least: self.least.min(other.least), most, lasting: self.lasting || other.lasting }
    }
}

/// When the value of an output port goes out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sent {
    /// With each write.
    Written,
    /// With the `wait`: what bundles before it have written.
    AtWait,
    /// With a write to this output port.
    By(Register),
}

/// A program's data flow.
#[derive(Debug)]
pub struct Dependence {
    flat: Option<Flat>,
}

impl Dependence {
    /// Dependences of a program in which writes of some output ports send others, as pairs.
    ///
    /// # Errors
    /// As [`crate::bound`]: where a loop or a call cannot be followed.
    pub fn new(
        program: &Program,
        sent_by: &BTreeSet<(Register, Register)>,
    ) -> Result<Dependence, BoundError> {
        Ok(Dependence { flat: Flat::new(program, sent_by)? })
    }

    /// Dependences of a program of which nothing is known.
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
    /// After how many periods an output port follows; `None` if it never does.
    pub fn output(&self, output: Register, sent: Sent) -> Option<Periods> {
        match &self.solved {
            Some(solved) => solved.output(output, sent),
            None => Some(Periods::UNKNOWN),
        }
    }
}
