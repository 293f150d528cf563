// SPDX-License-Identifier: MIT OR Apache-2.0
//! Restores an emulated machine to the state of another one with the same program: a circuit, as far as a debugger can read it, or an
//! emulator that waits for the tick.

use crate::emulator::{Emulator, Front, IterationCounts, MAX_CYCLE, Recent, Status};
use crate::machine::{Loop, State};
use std::collections::BTreeMap;
use takt_isa::fp::Flags;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Flow, Register};

/// Known state of a machine with nothing in flight. Its return stack is unknown, and assumed to be empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MachineState {
    /// Position at which execution stands.
    pub at: Position,
    /// Registers with their bits, and input ports as the host has set them. Registers that are left out were never written.
    pub registers: BTreeMap<Register, u32>,
    /// Data memory, from word 0.
    pub memory: Vec<u32>,
    /// Sticky exception flags of the machine.
    pub flags: Flags,
}

/// Position of a machine's execution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// Before the first cycle, after a reset.
    Reset,
    /// After the issue of this bundle's `wait`.
    Wait(BundleAddress),
    /// Stopped at this bundle.
    Stopped(BundleAddress),
}

/// State of a machine that waits for the tick with nothing in flight, in full: a run that resumes from it equals the run that it was taken
/// from. [`Emulator::waiting_state`] takes it, [`Emulator::resume`] returns to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WaitingState {
    /// Bundle whose `wait` issued.
    pub at: BundleAddress,
    /// Registers with their bits, and input ports as the host has set them. Registers that are left out were never written.
    pub registers: BTreeMap<Register, u32>,
    /// Data memory, from word 0.
    pub memory: Vec<u32>,
    /// Sticky exception flags of the machine.
    pub flags: Flags,
    /// Return stack, oldest entry first.
    pub stack: Vec<BundleAddress>,
    /// Active counted loops, innermost last: first bundle, last bundle, iterations left with the present one.
    pub loops: Vec<(BundleAddress, BundleAddress, u16)>,
    /// Iterations of each loop with a bound since the loop was entered, in the order of the program's bounds.
    pub turns: Vec<u32>,
}

impl Emulator {
    /// State of the machine, if it waits for the tick and nothing is in flight; otherwise `None`.
    pub fn waiting_state(&self) -> Option<WaitingState> {
        let Status::Waiting { address, .. } = self.status else { return None };
        if !self.state.pending.is_empty() {
            return None;
        }
        let state = &self.state;
        let known = Register::all().filter(|&register| state.written.contains(register));
        let mut registers: BTreeMap<Register, u32> =
            known.map(|register| (register, state.get(register))).collect();
        if let Some(latches) = &state.latches {
            registers
                .extend(latches.changed.iter().map(|&register| (register, latches.inputs[register.index()])));
        }
        Some(WaitingState {
            at: address,
            registers,
            memory: state.memory.clone(),
            flags: state.flags,
            stack: state.stack.clone(),
            loops: self.loops().collect(),
            turns: self.turns.iter().map(|turns| turns.run).collect(),
        })
    }

    /// Sets the machine to a state of a run of the same program; cycles go on counting, ticks are scheduled anew. Compiled blocks are kept.
    ///
    /// Returns false, and changes nothing, if the program has no such state.
    pub fn resume(&mut self, saved: &WaitingState) -> bool {
        let now = self.now.max(1);
        self.resume_at(saved, now - 1, now)
    }

    /// Sets the machine to a state as [`Emulator::resume`] does, at the beginning of cycle `now`, with a `wait` that issued in `since`.
    ///
    /// Returns false, and changes nothing, if the program has no such state, or no machine such cycles.
    pub fn resume_at(&mut self, saved: &WaitingState, since: Cycle, now: Cycle) -> bool {
        if since >= now || now > MAX_CYCLE {
            return false;
        }
        let machine = self.program.machine;
        let bundle = self.program.bundle(saved.at).and_then(Result::ok);
        let Some(Flow::Wait(target)) = bundle.map(|bundle| Flow::of(&bundle)) else { return false };
        let last = self.program.bundles();
        let is_inside = |(start, end, left): &(BundleAddress, BundleAddress, u16)| {
            start.get() < last && end.get() < last && *left > 0
        };
        let fits = saved.memory.len() == machine.data_depth as usize
            && saved.stack.len() <= machine.stack_depth as usize
            && saved.loops.len() <= machine.loop_depth as usize
            && saved.loops.iter().all(is_inside)
            && saved.turns.len() == self.turns.len();
        if !fits {
            return false;
        }
        let mut state = State::new(&self.program);
        for (&register, &bits) in &saved.registers {
            if register != Register::ZERO && machine.has_register(register) {
                state.set(register, bits);
            }
        }
        state.memory.clone_from(&saved.memory);
        state.flags = saved.flags;
        state.stack.extend(&saved.stack);
        let loops = saved.loops.iter();
        state.loops.extend(loops.map(|&(start, end, left)| Loop { start, end: end.next(), left }));
        state.publish_outputs(machine);
        self.state = state;
        for (turns, &run) in self.turns.iter_mut().zip(&saved.turns) {
            *turns = IterationCounts { run, section: 0 };
        }
        self.now = now;
        self.wait_since(since, saved.at, target);
        true
    }

    /// The machine waits since a cycle, with nothing in flight and every unit free.
    fn wait_since(&mut self, since: Cycle, address: BundleAddress, target: BundleAddress) {
        self.front = Front { next: target, delivered: 0, from: Some(address) };
        self.status = Status::Waiting { since, address };
        self.recent = Recent::List(Vec::new());
        self.scoreboard = None;
        self.planned = None;
        self.period = None;
        self.report = None;
        self.ticks.wait_since(since);
    }

    /// Resets the machine and sets it to a known state; cycles count from there.
    ///
    /// Returns false, and leaves the machine reset, if the state is [`Position::Wait`] at a bundle without a `wait`.
    pub fn restore(&mut self, saved: &MachineState) -> bool {
        self.reset();
        let state = &mut self.state;
        for (&register, &bits) in &saved.registers {
            if register != Register::ZERO && self.program.machine.has_register(register) {
                state.set(register, bits);
            }
        }
        for (word, bits) in state.memory.iter_mut().zip(&saved.memory) {
            *word = *bits;
        }
        state.flags = saved.flags;
        state.publish_outputs(self.program.machine);
        match saved.at {
            Position::Reset => {}
            Position::Wait(address) => {
                let bundle = self.program.bundle(address).and_then(Result::ok);
                let Some(Flow::Wait(target)) = bundle.map(|bundle| Flow::of(&bundle)) else {
                    self.reset();
                    return false;
                };
                self.now = 1;
                self.wait_since(0, address, target);
            }
            Position::Stopped(address) => {
                self.front = Front { next: address, delivered: 0, from: Some(address) };
                self.status = Status::Halted { cycle: 0, address };
                self.now = 1;
            }
        }
        true
    }
}
