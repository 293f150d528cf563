// SPDX-License-Identifier: MIT OR Apache-2.0
//! Certificate of the bounds of a program's sections, as plain data: `takt bound --certificate` writes it, `takt verify --bound` checks
//! it by rules of its own. `docs/verify.md` has the format.
//!
//! Lists refer to one another by index. A lemma refers only to lemmas before it, and a place of a lemma only leads to places after it, so
//! that a checker reads a certificate once, from the first line to the last.

use crate::program::Program;
use serde::{Deserialize, Serialize};

/// First field of a certificate.
pub const FORMAT: &str = "takt bounds 1";

/// Best and worst case, in cycles.
pub type Cycles = (u64, u64);
/// Best and worst case of a part of a path. The worst is negative where iterations have a price above their cycles.
pub type Cost = (u64, i64);

/// Certificate of one program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// [`FORMAT`].
    pub format: String,
    /// Name of the machine.
    pub machine: String,
    /// [`fingerprint`] of the program.
    pub program: String,
    /// Claims.
    pub sections: Vec<Claim>,
    /// Proofs of the claims. A claim is proved if its best case is at most the best of any proof, and its worst at least the least worst.
    pub proofs: Vec<Proof>,
}

/// Claimed cycles of a section.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// Label of the first bundle, or `once`; for people.
    pub name: String,
    /// First bundle.
    pub address: u32,
    /// The section starts at reset; all others start at a tick.
    pub once: bool,
    /// Cycles to the issue of the `wait` or `halt`.
    pub cycles: Times,
    /// Cycles to the publication of the outputs, if a `publish` may come before the `wait`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub published: Option<Times>,
}

/// Cycles, by the moment of the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Times {
    /// From reset; or from a tick that comes after the front end has refilled.
    pub refilled: Cycles,
    /// From a tick after the `wait`, however soon; `None` from reset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_time: Option<Cycles>,
    /// From the `wait`, if the tick came before it; `None` from reset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missed: Option<Cycles>,
}

/// Proof of bounds.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Proof {
    /// Price of an iteration in cycles, by head, of loops with a promised total: an iteration costs its cycles less the price, and a section
    /// that enters the loop pays the price times the total.
    pub prices: Vec<(u32, u64)>,
    /// States that places refer to.
    pub states: Vec<State>,
    /// Parts of the program from one state at entry.
    pub lemmas: Vec<Lemma>,
    /// Beginnings of sections: every one that a `wait` can lead to.
    pub entries: Vec<Entry>,
}

/// State of a path at the delivery of a bundle.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    /// Registers with a result in flight, ascending, and the cycles until it is on the bus.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pending: Vec<(u16, u16)>,
    /// Busy units (slot, unit of the slot), ascending, and the cycles until each accepts an operation.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub busy: Vec<(u8, u8, u16)>,
    /// Registers with a known value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub known: Vec<(u16, u32)>,
    /// Known count of the loop that begins at the bundle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
    /// A `publish` has issued since the section began.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub published: bool,
}

/// Part of the program, with the ways out of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Lemma {
    /// Code without a cycle but for loops proved before: a section, a subroutine, an iteration of a loop. It is entered at the first place.
    Code {
        /// Places, each with the cycles from the entry.
        places: Vec<Place>,
        /// Ways out.
        exits: Vec<Exit>,
    },
    /// All iterations of a loop.
    Loop {
        /// First bundle of the loop.
        head: u32,
        /// State at entry.
        state: u32,
        /// For each iteration, the places at which it can begin: the cycles from the entry, less the price of the iterations before.
        turns: Vec<Vec<Turn>>,
        /// Cycles of one iteration, less the price, if the last of `turns` ends as it begins: its only state leads to itself.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        steady: Option<Cost>,
        /// Ways out.
        exits: Vec<Exit>,
    },
}

/// Bundle in one state.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// First bundle.
    pub at: u32,
    /// State at its delivery.
    pub state: u32,
    /// Cycles from the entry of the lemma to its delivery.
    pub cycles: Cost,
    /// Execution from here on.
    pub step: Step,
    /// Edges, in the order of the step: of a branch the taken one first, of a loop's last bundle the one back, of a `publish` the one on;
    /// of a call or a loop, those of its lemma's exits.
    pub edges: Vec<Edge>,
}

/// Execution from a place to its edges.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Step {
    /// Bundles one after the other, up to this one.
    To(u32),
    /// The same, and then the subroutine of this lemma.
    Call(u32, u32),
    /// The loop of this lemma.
    Loop(u32),
}

/// Edge from a place.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edge {
    /// Place or exit at the edge's end.
    pub to: Target,
    /// Cycles from the place on.
    pub cycles: Cost,
}

/// Target of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Target {
    /// Later place of the lemma; from a turn, place at which the next turn begins.
    Place(u32),
    /// Exit of the lemma.
    Exit(u32),
    /// No run takes the edge, or it leads back to the only place of a steady turn.
    None,
}

/// Place at which an iteration begins.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// State at the delivery of the head.
    pub state: u32,
    /// Cycles from the entry of the loop.
    pub cycles: Cost,
    /// Lemma of the iteration.
    pub lemma: u32,
    /// Targets of that lemma's exits.
    pub edges: Vec<Target>,
}

/// Way out of a lemma.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exit {
    /// Kind.
    pub end: End,
    /// State at the delivery of the next bundle: of [`End::Go`], [`End::Return`] and [`End::Wait`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state: Option<u32>,
    /// Cycles from the entry to the delivery of the next bundle, of the others to their issue. A `wait` is of both kinds: its cycles are those
    /// to its issue.
    pub cycles: Cost,
}

/// Kind of an exit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum End {
    /// Bundle outside; back, if by a jump or a taken branch from the same or a later bundle.
    Go {
        /// The bundle.
        to: u32,
        /// The edge leads back.
        back: bool,
    },
    /// Return from the subroutine, by the bundle `at`.
    Return {
        /// Bundle of the return.
        at: u32,
    },
    /// End of the section at a `wait`.
    Wait {
        /// Bundle of the `wait`.
        at: u32,
        /// Bundle at which the next section begins.
        target: u32,
    },
    /// First `publish` of the section; the path goes on by another edge.
    Publish {
        /// Bundle of the `publish`.
        at: u32,
    },
    /// End of the program.
    Halt {
        /// Bundle of the `halt`.
        at: u32,
    },
}

/// Beginning of a section.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// First bundle.
    pub address: u32,
    /// At reset.
    pub once: bool,
    /// State at the delivery of the first bundle.
    pub state: u32,
    /// The first bundle is delivered as soon after the `wait` as it can be.
    pub soonest: bool,
    /// Lemma of the section.
    pub lemma: u32,
}

/// Digest of everything in a program and its machine that bounds depend on (FNV-1a of 128 bits): equal for equal ones, and no secret. A checker
/// needs it only to say so if a certificate is of another program, since it proves each certificate by the program that it is given.
pub fn fingerprint(program: &Program) -> String {
    let mut hash: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    let mut add = |numbers: &[u64]| {
        for byte in numbers.iter().flat_map(|number| number.to_le_bytes()) {
            hash = (hash ^ u128::from(byte)).wrapping_mul(0x0100_0000_0000_0000_0000_013b);
        }
    };
    let machine = program.machine;
    let inputs = machine.inputs;
    add(&[inputs.base.into(), inputs.depth.into(), machine.refill.into(), machine.resolve.into()]);
    add(&[machine.slots.len() as u64]);
    for slot in machine.slots {
        add(&[slot.bank.base.into(), slot.bank.depth.into(), slot.units.len() as u64]);
        for unit in slot.units {
            add(&[unit.latency.into(), unit.interval.into(), unit.functions.len() as u64]);
            unit.functions.iter().for_each(|function| add(&[*function as u64]));
        }
    }
    add(&[program.code.len() as u64]);
    add(&program.code);
    add(&[program.constants.len() as u64]);
    for (register, value) in &program.constants {
        add(&[register.index() as u64, (*value).into()]);
    }
    add(&[program.loop_bounds.len() as u64]);
    for bound in &program.loop_bounds {
        let total = bound.total.map_or(0, |total| u64::from(total) + 1);
        add(&[bound.address.get().into(), bound.most.into(), total]);
    }
    format!("{hash:032x}")
}
