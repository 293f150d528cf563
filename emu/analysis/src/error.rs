// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of the static analyses: reasons why a program has no bound.

use takt_isa::program::Location;
use takt_isa::{BundleAddress, Program};

/// Reason why there is no bound, and the bundle at fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {refusal}")]
pub struct BoundError {
    /// Bundle at which the analysis stopped.
    pub address: BundleAddress,
    /// Source line of the bundle, if known.
    pub location: Option<Location>,
    /// Reason for the refusal, with the names that its message needs.
    pub refusal: Refusal,
    /// Bundle, source line and label, for the message.
    place: String,
}

/// Kinds of [`BoundError`]. An analysis that cannot prove a bound refuses the program; it never guesses.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// A loop without a bound.
    #[error(
        "a loop begins here ({closed} leads back) and has no bound: write `.loop_bound N` before its first \
         bundle, N being how often that one is executed each time the loop is entered"
    )]
    Unbounded {
        /// Bundle with the back edge.
        closed: String,
    },
    /// A loop with a path back to its head that bypasses the count of its bound.
    #[error(
        "this loop has a bound, but {from} leads to it again in a way that restarts the count: let a backward \
         jump or branch close the loop"
    )]
    Uncounted {
        /// Bundle whose edge to the head restarts the count.
        from: String,
    },
    /// Overlapping loops: each contains the head of the other.
    #[error("this loop and another each contain the head of the other: their turns cannot be told apart")]
    Overlap,
    /// A loop bound at a bundle that heads no loop: no jump leads back to it.
    #[error(".loop_bound stands here, but no jump or branch leads back to this bundle: it heads no loop")]
    NoLoop,
    /// A loop that the sequencer counts, whose count is not a constant.
    #[error(
        "the iteration count of this loop is a register's value: write `.loop_bound N` before its first bundle"
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
        /// Label or address of the subroutine.
        callee: String,
    },
    /// Calls that nest deeper than the return stack.
    #[error("calls nest {needed} deep from here, and the return stack holds {depth}")]
    StackOverflow {
        /// Entries of the return stack that the calls need.
        needed: u32,
        /// Entries of the return stack.
        depth: u32,
    },
    /// Loops that nest deeper than the sequencer counts.
    #[error(
        "counted loops nest {needed} deep from here, those of subroutines included, and the sequencer counts {depth}"
    )]
    LoopOverflow {
        /// Nesting depth of counted loops.
        needed: u32,
        /// Nesting depth that the sequencer supports.
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
        /// Name of the slot.
        slot: &'static str,
        /// Reason why the word is illegal.
        reason: String,
    },
    /// Execution that continues past the end of the program.
    #[error("execution continues past the end of the program, which has {bundles} bundles")]
    LeavesProgram {
        /// Number of bundles in the program.
        bundles: u32,
    },
    /// An input or a state without a range.
    #[error(
        "{} `{name}` is read here and has no range: write `.range {name} = least, largest`",
        if *.input { "the input" } else { "the state" }
    )]
    NoRange {
        /// Name of the input or state in the source.
        name: String,
        /// An input port; else a state.
        input: bool,
    },
    /// A data word that keeps a value from one period to another.
    #[error(
        "{word} is read here before this period has written it, and the program changes it: write `.range {array} = least, largest`"
    )]
    NoRangeOfWord {
        /// Data word, as the source names it.
        word: String,
        /// Name of the word's array.
        array: String,
    },
    /// An exceeded limit of the analysis.
    #[error("more than {limit} {what}: the analysis gives up")]
    Limit {
        /// Value of the limit, in units of `what`.
        limit: u64,
        /// Unit of the limit, in the plural.
        what: &'static str,
    },
}

impl BoundError {
    pub(crate) fn new(program: &Program, address: BundleAddress, refusal: Refusal) -> BoundError {
        let location = program.location(address);
        BoundError { address, location, refusal, place: place(program, address) }
    }
}

/// Bundle, source line and label: `tracking.s:40: bundle 12 (loop)`.
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
