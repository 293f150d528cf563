// SPDX-License-Identifier: MIT OR Apache-2.0
//! Architectural state of the machine, and the results in flight.

use crate::event::{PortWrite, Retire};
use takt_isa::fp::{Flags, is_nan};
use takt_isa::spec::check::MAX_SLOTS;
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Machine, Program, Register, SlotIndex};

/// Number of words in the register array: the register space, followed by temporary words for blocks (`block`).
pub(crate) const WORDS: usize = 2 * Register::COUNT;
/// First scratch word. There is one for each slot, for bundles that exchange registers.
const SCRATCH: u16 = Register::COUNT as u16;
/// First word for late results. [`MAX_LATENCY`] words for each slot are enough, since each bank is written at most once per cycle.
const LATE: u16 = SCRATCH + MAX_SLOTS as u16;
const _: () = assert!(WORDS.is_power_of_two(), "the mask of an index is all ones");
const _: () = assert!(
    LATE as usize + MAX_SLOTS * MAX_LATENCY as usize <= WORDS,
    "late results overflow the register array"
);
/// Limit on the NaNs on output ports that are kept until the host takes them; more are only counted.
pub const MAX_NAN_WRITES: usize = 256;

/// Word of the register array: a register or a temporary word.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Word(u16);

impl Word {
    /// Scratch word of a slot, for a bundle that exchanges registers.
    pub(crate) const fn scratch(slot: SlotIndex) -> Word {
        Word(SCRATCH + slot.get() as u16)
    }

    /// Word of a block's late result of this number, which is below `MAX_SLOTS * MAX_LATENCY`.
    pub(crate) const fn late(number: usize) -> Word {
        Word(LATE + number as u16)
    }

    /// Number of the late result in this word; `None` for other words.
    #[inline(always)]
    pub(crate) const fn late_number(self) -> Option<usize> {
        if self.0 >= LATE { Some((self.0 - LATE) as usize) } else { None }
    }

    /// Index into the register array. (The mask changes nothing; it lets the compiler omit the bounds check.)
    #[inline(always)]
    pub(crate) const fn index(self) -> usize {
        self.0 as usize & (WORDS - 1)
    }
}

impl From<Register> for Word {
    #[inline(always)]
    fn from(register: Register) -> Word {
        Word(register.get())
    }
}

/// Set of registers, as a bit map.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct RegisterSet([u64; Register::COUNT / 64]);

impl RegisterSet {
    #[inline]
    pub(crate) fn insert(&mut self, register: Register) {
        self.0[register.index() / 64] |= 1 << (register.index() % 64);
    }

    #[inline]
    pub(crate) fn contains(&self, register: Register) -> bool {
        self.0[register.index() / 64] >> (register.index() % 64) & 1 != 0
    }

    /// Number of registers in the set.
    pub(crate) fn len(&self) -> u32 {
        self.0.iter().map(|word| word.count_ones()).sum()
    }

    pub(crate) fn insert_all(&mut self, other: &RegisterSet) {
        self.0.iter_mut().zip(other.0).for_each(|(word, other)| *word |= other);
    }

    pub(crate) fn contains_all(&self, other: &RegisterSet) -> bool {
        self.0.iter().zip(other.0).all(|(word, other)| other & !word == 0)
    }
}

/// Result between issue and writeback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PendingResult {
    /// Event of its retirement; `register` is always set.
    pub(crate) retire: Retire,
    pub(crate) register: Register,
    pub(crate) output: bool,
    /// Reports a NaN on writeback, since the port carries binary32.
    pub(crate) float: bool,
    /// The write is recorded for [`crate::Emulator::take_port_writes`].
    pub(crate) watched: bool,
}

/// NaNs written to output ports.
#[derive(Clone, Debug, Default)]
pub(crate) struct NanWrites {
    pub(crate) kept: Vec<PortWrite>,
    pub(crate) count: u64,
}

impl NanWrites {
    pub(crate) fn record(&mut self, write: PortWrite) {
        self.count += 1;
        if self.kept.len() < MAX_NAN_WRITES {
            self.kept.push(write);
        }
    }
}

/// Active loop of the sequencer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Loop {
    /// First bundle of the body.
    pub(crate) start: BundleAddress,
    /// Address after the last bundle of the body.
    pub(crate) end: BundleAddress,
    /// Iterations left, the present one included.
    pub(crate) left: u16,
}

/// Architectural state: everything that operations read and write.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) registers: Box<[u32; WORDS]>,
    pub(crate) written: RegisterSet,
    pub(crate) memory: Vec<u32>,
    pub(crate) stack: Vec<BundleAddress>,
    /// Active loops, innermost last.
    pub(crate) loops: Vec<Loop>,
    pub(crate) flags: Flags,
    /// Results in flight, in the order of issue.
    pub(crate) pending: Vec<PendingResult>,
    pub(crate) nan_writes: NanWrites,
    /// Writes to watched ports that the host has not taken yet.
    pub(crate) port_writes: Vec<PortWrite>,
    /// Host's side of latched ports; the program's side is in the registers. `None` if ports are not latched.
    pub(crate) latches: Option<Box<Latches>>,
}

/// Buffers of latched ports on the host's side. The registers are the program's side: the inputs as last latched, the outputs as written.
#[derive(Clone, Debug)]
pub(crate) struct Latches {
    /// Inputs as the host has set them.
    pub(crate) inputs: [u32; Register::COUNT],
    /// Outputs as last published, and the set of outputs ever published.
    pub(crate) outputs: [u32; Register::COUNT],
    pub(crate) published: RegisterSet,
    /// Inputs set since they were last latched.
    pub(crate) changed: Vec<Register>,
    /// The inputs must be latched at the beginning of the next cycle.
    pub(crate) take: bool,
}

impl Latches {
    /// Buffers after reset: outputs show the values that the loader wrote, and inputs are latched before the first cycle.
    fn new(state: &State, machine: &Machine) -> Latches {
        let mut latches = Latches {
            inputs: [0; Register::COUNT],
            outputs: [0; Register::COUNT],
            published: RegisterSet::default(),
            changed: Vec::new(),
            take: true,
        };
        latches.publish(state, machine);
        latches
    }

    fn publish(&mut self, state: &State, machine: &Machine) {
        for register in machine.slots.iter().flat_map(|slot| machine.output_registers(slot)) {
            if state.written.contains(register) {
                self.outputs[register.index()] = state.get(register);
                self.published.insert(register);
            }
        }
    }
}

impl State {
    /// State after loading and reset.
    pub(crate) fn new(program: &Program) -> State {
        let mut memory = program.data.clone();
        memory.resize(program.machine.data_depth as usize, 0);
        let mut state = State {
            registers: Box::new([0; WORDS]),
            written: RegisterSet::default(),
            memory,
            stack: Vec::with_capacity(program.machine.stack_depth as usize),
            loops: Vec::with_capacity(program.machine.loop_depth as usize),
            flags: Flags::NONE,
            pending: Vec::new(),
            nan_writes: NanWrites::default(),
            port_writes: Vec::new(),
            latches: None,
        };
        state.written.insert(Register::ZERO);
        for &(register, bits) in &program.constants {
            state.set(register, bits);
        }
        if program.latched {
            state.latches = Some(Box::new(Latches::new(&state, program.machine)));
        }
        state
    }

    /// Sets an input port for the host.
    #[inline]
    pub(crate) fn set_input(&mut self, register: Register, bits: u32) {
        let Some(latches) = &mut self.latches else { return self.set(register, bits) };
        latches.inputs[register.index()] = bits;
        if !latches.changed.contains(&register) {
            latches.changed.push(register);
        }
    }

    /// Latches the inputs, if ports are latched.
    pub(crate) fn take_inputs(&mut self) {
        let Some(latches) = &mut self.latches else { return };
        latches.take = false;
        for register in latches.changed.drain(..) {
            self.registers[register.index()] = latches.inputs[register.index()];
            self.written.insert(register);
        }
    }

    /// Schedules the latching of inputs for the beginning of the next cycle, if ports are latched.
    pub(crate) fn take_inputs_next(&mut self) {
        if let Some(latches) = &mut self.latches {
            latches.take = true;
        }
    }

    /// Publishes the outputs, if ports are latched.
    pub(crate) fn publish_outputs(&mut self, machine: &Machine) {
        if let Some(mut latches) = self.latches.take() {
            latches.publish(self, machine);
            self.latches = Some(latches);
        }
    }

    /// Visible value of an output port; `None` before its first write.
    pub(crate) fn output(&self, register: Register) -> Option<u32> {
        match &self.latches {
            None => self.written.contains(register).then(|| self.get(register)),
            Some(latches) => latches.published.contains(register).then(|| latches.outputs[register.index()]),
        }
    }

    #[inline]
    pub(crate) fn get(&self, word: impl Into<Word>) -> u32 {
        self.registers[word.into().index()]
    }

    /// Writes a register and marks it written.
    #[inline]
    pub(crate) fn set(&mut self, register: Register, bits: u32) {
        self.registers[register.index()] = bits;
        // Avoid the store for registers already written, which are nearly all: a later read of the set need not wait for it.
        if !self.written.contains(register) {
            self.written.insert(register);
        }
    }

    /// Writes back one result. Returns the port write if the register is an output port.
    pub(crate) fn write_back(&mut self, pending: &PendingResult) -> Option<PortWrite> {
        let Retire { cycle, slot, address, value, flags, .. } = pending.retire;
        self.set(pending.register, value);
        self.flags |= flags;
        if !pending.output {
            return None;
        }
        let nan = pending.float && is_nan(value);
        let write = PortWrite { cycle, slot, address, register: pending.register, value, nan };
        if nan {
            self.nan_writes.record(write);
        }
        if pending.watched {
            self.port_writes.push(write);
        }
        Some(write)
    }

    /// Registers of the results that are on their buses in cycle `last` or before.
    pub(crate) fn due(&self, last: Cycle) -> impl Iterator<Item = Register> {
        let due = self.pending.iter().filter(move |pending| pending.retire.cycle <= last);
        due.map(|pending| pending.register)
    }

    /// A result for the register is in flight.
    pub(crate) fn is_pending(&self, register: Register) -> bool {
        self.pending.iter().any(|pending| pending.register == register)
    }

    /// Writes back every result that is on its bus in cycle `last` or before. (The order does not matter to the state: no two pending
    /// results have the same register.)
    #[inline]
    pub(crate) fn write_back_until(&mut self, last: Cycle) {
        if self.pending.is_empty() {
            return;
        }
        let mut kept = 0;
        for i in 0..self.pending.len() {
            let pending = self.pending[i];
            if pending.retire.cycle <= last {
                self.write_back(&pending);
            } else {
                self.pending[kept] = pending;
                kept += 1;
            }
        }
        self.pending.truncate(kept);
    }
}
