// SPDX-License-Identifier: MIT OR Apache-2.0
//! Faults: errors that stop the machine.

use takt_isa::program::{IllegalWord, Location};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register, SlotIndex};

/// Fault of a bundle. The bundle has not executed, and the state before it can be inspected.
///
/// Plain data: [`Fault::show`] renders it with the names and places of the program; its own `Display` has numbers instead.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Cycle in which the bundle would have issued; for [`FaultKind::CycleLimit`] the limit.
    pub cycle: Cycle,
    /// Address of the bundle.
    pub address: BundleAddress,
    /// Slot of the operation at fault, if a single operation is at fault.
    pub slot: Option<SlotIndex>,
    /// Kind of fault, with its details.
    pub kind: FaultKind,
}

/// Kinds of a [`Fault`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// A word of the bundle encodes no instruction, or an instruction that its slot cannot execute.
    IllegalWord(Box<IllegalWord>),
    /// Execution left the program.
    ProgramCounter {
        /// Number of bundles in the program.
        bundles: u32,
    },
    /// A load or store outside the data memory.
    DataAddress {
        /// Word address: the sum of offset and signed register.
        address: i64,
        /// Number of words in the data memory.
        depth: u32,
        /// Store; otherwise a load.
        store: bool,
    },
    /// An operation reads a register that neither the loader, nor the host, nor an operation has written.
    UnwrittenRegister {
        /// Address of the register.
        register: Register,
    },
    /// A call with the return stack full.
    StackOverflow {
        /// Capacity of the stack in entries.
        depth: u32,
    },
    /// A return with the return stack empty.
    StackUnderflow,
    /// A `loop` nested deeper than the sequencer counts.
    LoopOverflow {
        /// Nesting depth that the sequencer supports.
        depth: u32,
    },
    /// A `loop` whose count is not 1 to 65,535.
    LoopCount {
        /// Count as a signed integer.
        count: i32,
    },
    /// A `loop` in whose body the loop around it ends, or an operation that redirects in the last bundle of a loop.
    LoopNesting {
        /// Last bundle of the loop around it.
        last: BundleAddress,
    },
    /// A loop iterates more often in one run than its bound in the source promises.
    LoopBound {
        /// Bound on the iterations of a run.
        most: u32,
    },
    /// A loop iterates more often in one section than the total in the source promises.
    LoopTotal {
        /// Bound on the iterations in a section.
        total: u32,
    },
    /// A run reached the limit on cycles.
    CycleLimit {
        /// Limit in cycles since reset.
        limit: Cycle,
    },
}

impl FaultKind {
    /// Short name of the kind, for tables.
    pub const fn name(&self) -> &'static str {
        match self {
            FaultKind::IllegalWord(_) => "illegal word",
            FaultKind::ProgramCounter { .. } => "program counter",
            FaultKind::DataAddress { .. } => "data address",
            FaultKind::UnwrittenRegister { .. } => "unwritten register",
            FaultKind::StackOverflow { .. } => "return stack full",
            FaultKind::StackUnderflow => "return stack empty",
            FaultKind::LoopOverflow { .. } => "loops too deep",
            FaultKind::LoopCount { .. } => "loop count",
            FaultKind::LoopNesting { .. } => "loop nesting",
            FaultKind::LoopBound { .. } | FaultKind::LoopTotal { .. } => "loop bound",
            FaultKind::CycleLimit { .. } => "cycle limit",
        }
    }
}

impl Fault {
    /// Renders the fault with the names of the program that was running.
    pub fn show<'a>(&'a self, program: &'a Program) -> FaultDisplay<'a> {
        FaultDisplay { fault: self, program: Some(program) }
    }

    /// Source location of the operation at fault, or else of its bundle, if the program knows it.
    pub fn location(&self, program: &Program) -> Option<Location> {
        let own = self.slot.and_then(|slot| program.operation_location(self.address, slot));
        own.or_else(|| program.location(self.address))
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        FaultDisplay { fault: self, program: None }.fmt(f)
    }
}

impl std::error::Error for Fault {}

/// A [`Fault`] as text: one line, `FILE:LINE: PLACE: MESSAGE`, or its parts.
#[derive(Clone, Copy, Debug)]
pub struct FaultDisplay<'a> {
    fault: &'a Fault,
    program: Option<&'a Program>,
}

impl FaultDisplay<'_> {
    /// Message of the kind, without the place.
    pub fn message(&self) -> String {
        match &self.fault.kind {
            FaultKind::IllegalWord(reason) => format!("illegal word: {reason}"),
            FaultKind::ProgramCounter { bundles } => {
                let plural = if *bundles == 1 { "" } else { "s" };
                format!("execution left the program, which has {bundles} bundle{plural}")
            }
            FaultKind::DataAddress { address, depth, store } => {
                let does = if *store { "writes" } else { "reads" };
                format!("{does} data word {address}, but the data memory has words 0 to {}", depth - 1)
            }
            FaultKind::UnwrittenRegister { register } => {
                let name = match self.program {
                    Some(program) => program.register_text(*register),
                    None => format!("register {register}"),
                };
                format!("reads {name}, which was never written")
            }
            FaultKind::StackOverflow { depth } => {
                format!("call with the return stack full ({depth} entries)")
            }
            FaultKind::StackUnderflow => "return with the return stack empty".to_owned(),
            FaultKind::LoopOverflow { depth } => {
                format!("a loop inside {depth} others, the most that are counted")
            }
            FaultKind::LoopCount { count } => {
                format!("a loop of {count} iterations; its count is 1 to 65535")
            }
            FaultKind::LoopNesting { last } => {
                format!(
                    "the loop around it ends with bundle {last}: too early, or in an operation that redirects"
                )
            }
            FaultKind::LoopBound { most } => {
                format!("the loop iterates more often than its `.loop_bound {most}` allows")
            }
            FaultKind::LoopTotal { total } => {
                format!(
                    "the loop iterates more often in this section than `total {total}` of its `.loop_bound` allows"
                )
            }
            FaultKind::CycleLimit { limit } => format!("limit of {limit} cycles reached"),
        }
    }

    /// Place in the source, like `pd.s:12`.
    fn source(&self, program: &Program) -> Option<String> {
        let own = self.fault.slot.and_then(|slot| program.operation_place(self.fault.address, slot));
        own.or_else(|| program.bundle_place(self.fault.address))
    }

    /// Place and cycle, like `bundle 12, slot add, cycle 44`.
    pub fn place(&self) -> String {
        let Fault { cycle, address, slot, .. } = *self.fault;
        let slot = match (slot, self.program) {
            (Some(slot), Some(program)) => format!(", slot {}", program.machine.slot(slot).name),
            (Some(slot), None) => format!(", slot {slot}"),
            (None, _) => String::new(),
        };
        format!("bundle {address}{slot}, cycle {cycle}")
    }
}

impl std::fmt::Display for FaultDisplay<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(program) = self.program
            && let Some(place) = self.source(program)
        {
            write!(f, "{place}: ")?;
        }
        write!(f, "{}: {}", self.place(), self.message())
    }
}

/// Reason why a program cannot be loaded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LoadError {
    /// More bundles than the program memory holds.
    #[error("the program has {bundles} bundles; {machine} holds {depth}")]
    Code {
        /// Number of bundles in the program.
        bundles: usize,
        /// Name of the machine.
        machine: &'static str,
        /// Number of bundles that the machine holds.
        depth: u32,
    },
    /// The last bundle is incomplete.
    #[error("{words} words are not a whole number of bundles of {slots}")]
    Bundle {
        /// Number of words in the program.
        words: usize,
        /// Number of the machine's slots.
        slots: usize,
    },
    /// More data than the data memory holds.
    #[error("the program has {words} words of data; {machine} holds {depth}")]
    Data {
        /// Number of words in the program's data.
        words: usize,
        /// Name of the machine.
        machine: &'static str,
        /// Number of words that the machine holds.
        depth: u32,
    },
    /// A constant for a register that the loader cannot set.
    #[error("constant for register address {register}, which {machine} {}", if *.register == Register::ZERO { "keeps at zero" } else { "does not have" })]
    Constant {
        /// Address of the register.
        register: Register,
        /// Name of the machine.
        machine: &'static str,
    },
    /// A port at an address where the machine has no port of its kind.
    #[error("port {name} at register address {register}, where {machine} has no {kind} port")]
    Port {
        /// Name of the port.
        name: String,
        /// Address of the register.
        register: Register,
        /// Name of the machine.
        machine: &'static str,
        /// Direction of the port: `input` or `output`.
        kind: &'static str,
    },
    /// A machine with more slots than the emulator handles.
    #[error("{machine} has {slots} slots; the emulator handles 1 to {most}")]
    Slots {
        /// Name of the machine.
        machine: &'static str,
        /// Number of the machine's slots.
        slots: usize,
        /// Limit on the slots.
        most: usize,
    },
}
