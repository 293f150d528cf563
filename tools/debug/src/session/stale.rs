// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stale values: registers whose newer value, which the current line would read, is in flight or not yet computed.

use super::machine::Machine;
use std::collections::HashMap;
use takt_asm::names::Names;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register};

/// Reason why a register holds an old value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StaleReason {
    /// The newer value arrives in this number of cycles.
    InFlight(Cycle),
    /// This bundle will compute the newer value.
    NotComputed(BundleAddress),
}

impl StaleReason {
    /// Explanation in words, for a note.
    pub fn text(self, program: &Program) -> String {
        match self {
            StaleReason::InFlight(1) => "a new value is in flight, 1 cycle to go".to_owned(),
            StaleReason::InFlight(left) => format!("a new value is in flight, {left} cycles to go"),
            StaleReason::NotComputed(bundle) => {
                let bundle = program.bundle_text(bundle);
                format!("{bundle} is still to compute the one that this line would read")
            }
        }
    }
}

/// Bundles that write each register, in ascending order, with the source position of the writing operation.
#[derive(Default)]
pub(super) struct Writers(HashMap<Register, Vec<(BundleAddress, u32)>>);

impl Writers {
    pub(super) fn of(program: &Program, names: &Names) -> Writers {
        let mut writers = Writers::default();
        let slots = program.machine.slots;
        for address in program.addresses() {
            let words = address.index() * slots.len()..(address.index() + 1) * slots.len();
            let (Some(Ok(bundle)), Some(positions)) = (program.bundle(address), names.positions.get(words))
            else {
                continue;
            };
            for ((instruction, slot), at) in bundle.iter().zip(slots).zip(positions) {
                if let (Some(register), Some(at)) = (instruction.writes(slot), at) {
                    writers.0.entry(register).or_default().push((address, at.order));
                }
            }
        }
        writers
    }
}

impl Machine<'_> {
    /// Reason why a register's value is older than the current line would read; `None` if it is up to date.
    pub(crate) fn stale(&self, register: Register) -> Option<StaleReason> {
        // If the view reads ahead, it already includes results in flight.
        let flying = self.arrives(register).filter(|_| !self.ahead);
        flying.map(StaleReason::InFlight).or_else(|| self.writes_yet(register).map(StaleReason::NotComputed))
    }

    /// A bundle that will still write the register although it precedes the current line in the source.
    fn writes_yet(&self, register: Register) -> Option<BundleAddress> {
        let (next, order) = (self.emulator.next_address(), self.at_hand().order);
        let writers = self.writers.0.get(&register)?;
        writers.iter().find(|(address, of)| next <= *address && *of < order).map(|(address, _)| *address)
    }

    /// Cycles until a result in flight arrives in a register.
    pub(crate) fn arrives(&self, register: Register) -> Option<Cycle> {
        let now = self.emulator.now();
        let flying = self.emulator.in_flight().filter(|retire| retire.register == Some(register));
        flying.map(|retire| retire.cycle.saturating_sub(now)).filter(|left| *left > 0).max()
    }

    /// Last result in flight to a register, of the operations that precede the current line in the source.
    pub(super) fn coming(&self, register: Register) -> Option<u32> {
        let slots = self.emulator.machine().slots.len();
        let order = self.at_hand().order;
        let flying = self.emulator.in_flight().filter(|retire| retire.register == Some(register));
        let before = flying.filter(|retire| {
            let word = retire.address.index() * slots + retire.slot.index();
            self.names.positions.get(word).copied().flatten().is_none_or(|at| at.order < order)
        });
        before.max_by_key(|retire| retire.cycle).map(|retire| retire.value)
    }
}
