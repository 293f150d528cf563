// SPDX-License-Identifier: MIT OR Apache-2.0
//! Restores an emulated machine to the state of another one with the same program: a circuit, as far as a debugger can read it.

use crate::emulator::{Emulator, Front, Status};
use std::collections::BTreeMap;
use takt_isa::fp::Flags;
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

impl Emulator {
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
                self.front = Front { next: target, delivered: 0, from: address };
                self.status = Status::Waiting { since: 0, address };
                self.ticks.waited = Some(0);
                self.now = 1;
            }
            Position::Stopped(address) => {
                self.front = Front { next: address, delivered: 0, from: address };
                self.status = Status::Halted { cycle: 0, address };
                self.now = 1;
            }
        }
        true
    }
}
