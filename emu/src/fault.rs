//! Faults: why the machine stopped where no program means it to.

use takt_isa::Program;
use takt_isa::program::{IllegalWord, Location};
use takt_isa::timing::{Address, Cycle};

/// A fault. The bundle that it names did not execute, and the state from before it stays to be inspected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The cycle in which the bundle would have issued; for [`FaultKind::CycleLimit`] the limit.
    pub cycle: Cycle,
    /// The bundle.
    pub address: Address,
    /// The slot whose operation is at fault, where it is one operation's.
    pub slot: Option<u8>,
    /// The operation's place in the source, as far as the program knows it.
    pub location: Option<Location>,
    /// What happened.
    pub kind: FaultKind,
    /// Where it happened, in words.
    place: Box<str>,
}

/// What a [`Fault`] is about.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultKind {
    /// A word of the bundle is no instruction, or none that its slot can execute.
    #[error("illegal word: {0}")]
    IllegalWord(Box<IllegalWord>),
    /// Execution left the program.
    #[error("execution left the program, which has {bundles} bundles")]
    ProgramCounter {
        /// Bundles in the program.
        bundles: u32,
    },
    /// A load or store outside the data memory.
    #[error("{} data word {address}, but the data memory has words 0 to {}", if *.store { "writes" } else { "reads" }, depth - 1)]
    DataAddress {
        /// The word address, offset and signed register added.
        address: i64,
        /// Words in the data memory.
        depth: u32,
        /// Whether it is a store.
        store: bool,
    },
    /// An operation reads a register that neither the loader, nor the host, nor an operation has written.
    #[error("reads {name}, which was never written")]
    UnwrittenRegister {
        /// The register.
        register: u16,
        /// Its name in the source.
        name: String,
    },
    /// A call with the return stack full.
    #[error("call with the return stack full ({depth} entries)")]
    StackOverflow {
        /// Entries of the stack.
        depth: u32,
    },
    /// A return with the return stack empty.
    #[error("return with the return stack empty")]
    StackUnderflow,
    /// The head of a loop is reached more often in one run of the loop than the source promises.
    #[error("the loop turns more than the {most} times that its .loop_bound promises")]
    LoopBound {
        /// Turns at most.
        most: u32,
    },
    /// The machine has run for as many cycles as it may.
    #[error("limit of {limit} cycles reached")]
    CycleLimit {
        /// The limit.
        limit: Cycle,
    },
}

impl Fault {
    pub(crate) fn new(
        program: &Program,
        cycle: Cycle,
        address: Address,
        slot: Option<u8>,
        kind: FaultKind,
    ) -> Fault {
        let slots = program.machine.slots;
        let word =
            slot.and_then(|slot| (address as usize).checked_mul(slots.len())?.checked_add(slot.into()));
        let own = word.and_then(|word| *program.lines.get(word)?);
        let location = own.or_else(|| {
            // Program::location slices, which an address far outside would overflow.
            (address < program.bundles()).then(|| program.location(address)).flatten()
        });
        let text = word.and_then(|word| program.word_place(word));
        let mut place = match text.or_else(|| program.bundle_place(address)) {
            Some(place) => format!("{place}: bundle {address}"),
            None => format!("bundle {address}"),
        };
        if let Some(slot) = slot.and_then(|slot| slots.get(usize::from(slot))) {
            place.push_str(", slot ");
            place.push_str(slot.name);
        }
        Fault { cycle, address, slot, location, kind, place: place.into() }
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, cycle {}: {}", self.place, self.cycle, self.kind)
    }
}

impl std::error::Error for Fault {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.kind)
    }
}

/// Why a program cannot be loaded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LoadError {
    /// More bundles than the program memory holds.
    #[error("program of {bundles} bundles; {machine} holds {depth}")]
    Code {
        /// Bundles in the program.
        bundles: usize,
        /// The machine.
        machine: &'static str,
        /// Bundles that it holds.
        depth: u32,
    },
    /// The last bundle lacks words.
    #[error("{words} words are no whole number of bundles of {slots}")]
    Bundle {
        /// Words in the program.
        words: usize,
        /// Slots of the machine.
        slots: usize,
    },
    /// More data than the data memory holds.
    #[error("{words} words of data; {machine} holds {depth}")]
    Data {
        /// Words in the program.
        words: usize,
        /// The machine.
        machine: &'static str,
        /// Words that it holds.
        depth: u32,
    },
    /// A constant for a register that the loader cannot set.
    #[error("constant for register address {register}, which {machine} {}", if *.register == takt_isa::ZERO { "keeps at zero" } else { "does not have" })]
    Constant {
        /// The register.
        register: u16,
        /// The machine.
        machine: &'static str,
    },
    /// A port at an address where the machine has none of its kind.
    #[error("port {name} at register address {register}, where {machine} has no {kind} port")]
    Port {
        /// The port's name.
        name: String,
        /// The register.
        register: u16,
        /// The machine.
        machine: &'static str,
        /// `input` or `output`.
        kind: &'static str,
    },
    /// A machine with more slots than the emulator handles.
    #[error("{machine} has {slots} slots; the emulator handles 1 to {most}")]
    Slots {
        /// The machine.
        machine: &'static str,
        /// Its slots.
        slots: usize,
        /// The limit.
        most: usize,
    },
}
