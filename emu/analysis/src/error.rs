// SPDX-License-Identifier: MIT OR Apache-2.0
//! The errors of the static analyses: reasons why a program has no bound.

use takt_isa::program::Location;
use takt_isa::{BundleAddress, Program};

/// The reason why there is no bound, and the bundle at fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {refusal}")]
pub struct BoundError {
    /// The bundle.
    pub address: BundleAddress,
    /// Its place in the source, as far as the program knows it.
    pub location: Option<Location>,
    /// The reason.
    pub refusal: Refusal,
    /// The place in words.
    place: String,
}

/// The kinds of [`BoundError`]. An analysis that cannot prove a bound refuses the program; it never guesses.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// A loop without a bound.
    #[error(
        "a loop begins here ({closed} leads back) and has no bound: write `.loop_bound N` before its first \
         bundle, N being how often that one is executed each time the loop is entered"
    )]
    Unbounded {
        /// The bundle with the back edge.
        closed: String,
    },
    /// A loop with a path back to its head that its bound does not count.
    #[error(
        "this loop has a bound, but {from} leads to it again in a way that restarts the count: let a backward \
         jump or branch close the loop"
    )]
    Uncounted {
        /// The bundle.
        from: String,
    },
    /// Two loops, each of which contains the other's head.
    #[error("this loop and another each contain the head of the other: their turns cannot be told apart")]
    Overlap,
    /// A loop bound at a bundle that heads no loop: no jump leads back to it.
    #[error(".loop_bound stands here, but no jump or branch leads back to this bundle: it heads no loop")]
    NoLoop,
    /// A loop that the sequencer counts, whose count is not a constant.
    #[error(
        "how often this loop is repeated is a register's value: write `.loop_bound N` before its first bundle"
    )]
    UnknownCount,
    /// A loop that the sequencer counts, which is not entered and left only at its ends.
    #[error(
        "control comes into this loop, or leaves it, other than by `loop` and its last bundle: how often it is \
         repeated is not known"
    )]
    Unstructured,
    /// A subroutine that calls itself.
    #[error("recursion: {callee} is being executed already when it is called here")]
    Recursion {
        /// The subroutine.
        callee: String,
    },
    /// Calls that nest deeper than the return stack.
    #[error("calls nest {needed} deep from here, and the return stack holds {depth}")]
    StackOverflow {
        /// Entries needed.
        needed: u32,
        /// Entries that the stack has.
        depth: u32,
    },
    /// A return without a call.
    #[error("a return without a call: where it leads is not known")]
    StackUnderflow,
    /// A `wait` in a subroutine.
    #[error("`wait` within a subroutine: where the next period returns to is not known")]
    WaitInSubroutine,
    /// A bundle that cannot execute.
    #[error("illegal word in slot {slot}: {reason}")]
    IllegalWord {
        /// The slot.
        slot: &'static str,
        /// The reason.
        reason: String,
    },
    /// Execution that continues past the end of the program.
    #[error("execution goes on past the end of the program, which has {bundles} bundles")]
    LeavesProgram {
        /// Bundles in the program.
        bundles: u32,
    },
    /// An input or a state without a range.
    #[error(
        "{} `{name}` is read here and has no range: write `.range {name} = least, largest`",
        if *.input { "the input" } else { "the state" }
    )]
    NoRange {
        /// Its name.
        name: String,
        /// True if it is an input port.
        input: bool,
    },
    /// A data word that keeps a value from one period to another.
    #[error(
        "{word} is read here before this period has written it, and the program changes it: what \
         lasts from one period to another has a range only in a `.state` with a `.range`, so that arrays that do are beyond this analysis"
    )]
    NoRangeOfWord {
        /// The word, and how the source names it.
        word: String,
    },
    /// A limit of the analysis, exceeded.
    #[error("more than {limit} {what}: the analysis gives up")]
    Limit {
        /// The limit.
        limit: u64,
        /// The things that are limited.
        what: &'static str,
    },
}

impl BoundError {
    pub(crate) fn new(program: &Program, address: BundleAddress, refusal: Refusal) -> BoundError {
        let location = program.location(address);
        BoundError { address, location, refusal, place: place(program, address) }
    }
}

/// `tracking.s:40: bundle 12 (loop)`: a bundle, its line and its label.
pub(crate) fn place(program: &Program, address: BundleAddress) -> String {
    let mut text = format!("bundle {address}");
    if let Some((label, distance)) = program.nearest_label(address) {
        text.push_str(&if distance == 0 {
            format!(" ({label})")
        } else {
            format!(" ({label} + {distance})")
        });
    }
    match program.bundle_place(address) {
        Some(place) => format!("{place}: {text}"),
        None => text,
    }
}
