// SPDX-License-Identifier: MIT OR Apache-2.0
//! Events of emulator and circuit, and their encoding in words, which the driver sends.

use std::fmt::Write as _;
use takt_emu::{Event, Fault, FaultKind};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register, SlotIndex};
use takt_system::{LinkEvent, LinkEventKind};

/// Observable event of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CircuitEvent {
    /// Event in a core; the core of a single-core circuit has number 0.
    Core {
        /// Index of the core.
        core: usize,
        /// Event within the core.
        event: CoreEvent,
    },
    /// Event on a link between cores, or between a core and the host.
    Link(LinkEvent),
}

impl CircuitEvent {
    /// Cycle of the event.
    pub fn cycle(&self) -> Cycle {
        match self {
            CircuitEvent::Core { event, .. } => event.cycle,
            CircuitEvent::Link(event) => event.cycle,
        }
    }

    /// Sort key: cycle, cores before links, each by index, and the event itself.
    pub(crate) fn key(&self) -> (Cycle, u8, usize, Option<CoreEvent>, Option<LinkEventKind>) {
        match *self {
            CircuitEvent::Core { core, event } => (event.cycle, 0, core, Some(event), None),
            CircuitEvent::Link(event) => (event.cycle, 1, event.link, None, Some(event.kind)),
        }
    }

    /// Place at which the other side must have an equal event: a different event there is reported as its counterpart.
    pub(crate) fn place(&self) -> impl Ord + use<> {
        match *self {
            CircuitEvent::Core { core, event } => (event.cycle, 0, core, Some((event.kind, event.slot))),
            CircuitEvent::Link(event) => (event.cycle, 1, event.link, None),
        }
    }

    /// Decodes an event from a driver's words; `None` for an unknown kind.
    pub(crate) fn read(words: &[u32]) -> Option<CircuitEvent> {
        let (cycle, number) = (Cycle::from(words[1]), words[7] as usize);
        let Some(&kind) = KINDS.get(words[0] as usize) else {
            let kind = match words[0] as usize - KINDS.len() {
                0 => LinkEventKind::Value(words[5]),
                1 => LinkEventKind::Published,
                2 => LinkEventKind::Taken,
                3 => LinkEventKind::Skipped,
                4 => LinkEventKind::Pushed,
                5 => LinkEventKind::Popped,
                6 => LinkEventKind::Overflow,
                7 => LinkEventKind::Underflow,
                _ => return None,
            };
            return Some(CircuitEvent::Link(LinkEvent { cycle, link: number, kind }));
        };
        let event = CoreEvent {
            cycle,
            kind,
            slot: words[3] as u8,
            address: words[2],
            register: words[4] as u16,
            value: words[5],
            flags: words[6] as u8,
        };
        Some(CircuitEvent::Core { core: number, event })
    }
}

/// Number of words of an event.
pub(crate) const EVENT_WORDS: usize = 8;

/// Observable event of a core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct CoreEvent {
    /// Cycle of the issue, the writeback or the tick.
    pub cycle: Cycle,
    /// Kind of the event, which decides about the meaning of the other fields.
    pub kind: EventKind,
    /// Slot of the operation, if any.
    pub slot: u8,
    /// Address of the bundle; of the data word for a store.
    pub address: u32,
    /// Register written; kind of a fault; number of a published output.
    pub register: u16,
    /// Value written to the register, the data word or the port.
    pub value: u32,
    /// Flags raised, as in the status register.
    pub flags: u8,
}

/// Kind of an event in a core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EventKind {
    /// Issue of a bundle.
    Issue,
    /// Issue of a store.
    Store,
    /// Writeback to a register.
    Retire,
    /// Write to an output port.
    Port,
    /// Deadline missed by the program.
    Missed,
    /// Tick lost because the last one is still pending.
    Lost,
    /// Halt of the machine.
    Halt,
    /// Fault of a bundle.
    Fault,
    /// Publication: a `publish` or a `wait` issues, and the last value written to an output port since the last one becomes visible.
    Publish,
    /// Value on the input pins; only in a system, whose driver reports it.
    Input,
}

const KINDS: [EventKind; 10] = [
    EventKind::Issue,
    EventKind::Store,
    EventKind::Retire,
    EventKind::Port,
    EventKind::Missed,
    EventKind::Lost,
    EventKind::Halt,
    EventKind::Fault,
    EventKind::Publish,
    EventKind::Input,
];

/// Instruction of an event, if it has one.
pub(crate) fn instruction(program: &Program, event: &CoreEvent) -> String {
    match event.kind {
        EventKind::Issue | EventKind::Fault | EventKind::Retire => {
            let slot = (event.kind == EventKind::Retire).then_some(event.slot);
            describe(program, BundleAddress::new(event.address), slot)
        }
        _ => String::new(),
    }
}

/// Text such as `bundle 12 (tracking.s:40): fadd a1, a2, a3`, with one slot's instruction or all.
fn describe(program: &Program, address: BundleAddress, slot: Option<u8>) -> String {
    let mut text = program.bundle_text(address);
    let machine = program.machine;
    let words = SlotIndex::all().zip(program.words(address).unwrap_or_default());
    let shown: Vec<String> = words
        .filter(|(s, _)| slot.is_none_or(|slot| slot == s.get()))
        .map(|(s, &word)| match takt_isa::Instruction::decode(word) {
            Ok(instruction) => instruction.text(machine, s),
            Err(_) => format!("0x{word:012x}"),
        })
        .collect();
    if !shown.is_empty() {
        let _ = write!(text, ": {}", shown.join(" || "));
    }
    text
}

pub(crate) fn show(program: &Program, event: &CoreEvent) -> String {
    let name = || {
        let register = Register::new(event.register.into());
        register.map_or_else(|| format!("?{}", event.register), |register| program.register_text(register))
    };
    let slot = || program.machine.slots.get(usize::from(event.slot)).map_or("?", |slot| slot.name);
    let flags = takt_isa::fp::Flags::from_bits(event.flags);
    match event.kind {
        EventKind::Issue => format!("issues bundle {}", event.address),
        EventKind::Store => format!("stores 0x{:08x} in data word {}", event.value, event.address),
        EventKind::Retire => format!(
            "slot {} writes {} = 0x{:08x}, flags {flags}, for bundle {}",
            slot(),
            name(),
            event.value,
            event.address
        ),
        EventKind::Port => format!("output port {} takes 0x{:08x}", name(), event.value),
        EventKind::Publish => format!("output {} is published as 0x{:08x}", event.register, event.value),
        EventKind::Input => format!("input port {} is given 0x{:08x}", name(), event.value),
        EventKind::Missed => "the deadline is missed".to_owned(),
        EventKind::Lost => "the tick is lost".to_owned(),
        EventKind::Halt => "halts".to_owned(),
        EventKind::Fault => {
            let kind = match event.register {
                1 => "illegal word",
                2 => "data address",
                3 => "return stack full",
                4 => "return stack empty",
                5 => "loops too deep",
                6 => "loop count",
                7 => "loop nesting",
                _ => "unknown",
            };
            format!("fault ({kind}) at bundle {}, slot {}", event.address, slot())
        }
    }
}

/// The circuit stops at the fault, too. It does not detect every fault of the emulator (`docs/timing.md`).
pub fn circuit_stops(fault: &Fault) -> bool {
    fault_code(&fault.kind).is_some()
}

/// The circuit's number of a fault; `None` for a fault that only the emulator detects.
pub(crate) fn fault_code(kind: &FaultKind) -> Option<u16> {
    match kind {
        FaultKind::IllegalWord(_) | FaultKind::ProgramCounter { .. } => Some(1),
        FaultKind::DataAddress { .. } => Some(2),
        FaultKind::StackOverflow { .. } => Some(3),
        FaultKind::StackUnderflow => Some(4),
        FaultKind::LoopOverflow { .. } => Some(5),
        FaultKind::LoopCount { .. } => Some(6),
        FaultKind::LoopNesting { .. } => Some(7),
        FaultKind::UnwrittenRegister { .. }
        | FaultKind::LoopBound { .. }
        | FaultKind::LoopTotal { .. }
        | FaultKind::CycleLimit { .. } => None,
    }
}

/// An event with a kind and a cycle only.
pub(crate) fn bare(kind: EventKind, cycle: Cycle) -> CoreEvent {
    CoreEvent { cycle, kind, slot: 0, address: 0, register: 0, value: 0, flags: 0 }
}

/// Event that the circuit must report for an event of the emulator; `None` if the circuit reports nothing.
pub(crate) fn expect(event: &Event) -> Option<CoreEvent> {
    Some(match *event {
        Event::Issue { cycle, address } => {
            CoreEvent { address: address.get(), ..bare(EventKind::Issue, cycle) }
        }
        Event::Retire(retire) => match (retire.register, retire.memory) {
            (Some(register), _) => CoreEvent {
                slot: retire.slot.get(),
                address: retire.address.get(),
                register: register.get(),
                value: retire.value,
                flags: retire.flags.bits(),
                ..bare(EventKind::Retire, retire.cycle)
            },
            (None, Some(address)) => {
                CoreEvent { address, value: retire.value, ..bare(EventKind::Store, retire.cycle) }
            }
            (None, None) => return None,
        },
        Event::PortWrite(write) => CoreEvent {
            slot: write.slot.get(),
            register: write.register.get(),
            value: write.value,
            ..bare(EventKind::Port, write.cycle)
        },
        Event::DeadlineMissed { cycle } => bare(EventKind::Missed, cycle),
        Event::TickLost { cycle } => bare(EventKind::Lost, cycle),
        Event::Halt { cycle, .. } => bare(EventKind::Halt, cycle),
        Event::Fault(ref fault) => CoreEvent {
            slot: fault.slot.map_or(0, SlotIndex::get),
            address: fault.address.get(),
            register: fault_code(&fault.kind)?,
            ..bare(EventKind::Fault, fault.cycle)
        },
        Event::Tick { .. } | Event::Publish { .. } | Event::Wait { .. } => return None,
    })
}
