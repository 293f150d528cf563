// SPDX-License-Identifier: MIT OR Apache-2.0
//! The machine at a position: registers as the bundle to come reads them, data words, the source line at hand.

use takt_asm::names::{Names, Position};
use takt_emu::Emulator;
use takt_isa::program::Location;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Program, Register};

/// A register or a data word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A register by address.
    Register(Register),
    /// A data word by address.
    Word(u32),
}

/// The machine as expressions see it.
pub(crate) struct Machine<'e> {
    pub(crate) emulator: &'e Emulator,
    pub(crate) periods: u64,
    pub(crate) names: &'e Names,
    /// The line at hand, if it is not the one that the next bundle shows.
    pub(crate) line: Option<Location>,
}

impl Machine<'_> {
    /// The value that a bundle issued in the cycle to come would read.
    pub(crate) fn register(&self, register: Register) -> Option<u32> {
        let now = self.emulator.now();
        let due = self.emulator.in_flight().filter(|retire| retire.cycle == now);
        due.filter(|retire| retire.register == Some(register))
            .map(|retire| retire.value)
            .next()
            .or_else(|| self.emulator.register(register))
    }

    /// The position of the source line at hand.
    pub(crate) fn at_hand(&self) -> Position {
        let (slots, next) = (self.emulator.machine().slots.len(), self.emulator.next_address());
        let start = next.index() * slots;
        let lines = self.emulator.program().locations(next);
        let word = lines.iter().position(|line| line.is_some() && *line == self.line);
        let position = word.and_then(|word| self.names.positions.get(start + word).copied().flatten());
        position.unwrap_or_else(|| self.names.at_hand(slots, next))
    }

    /// A bundle that is still to write a register although it comes before the line at hand in the source: what is there now
    /// is older than what that line would read.
    pub(crate) fn writes_yet(&self, register: Register) -> Option<BundleAddress> {
        let program = self.emulator.program();
        let (position, slots) = (self.at_hand(), program.machine.slots);
        let end = BundleAddress::new(program.bundles());
        self.emulator.next_address().until(end).find(|address| {
            let words = address.index() * slots.len()..(address.index() + 1) * slots.len();
            let Some(Ok(bundle)) = program.bundle(*address) else { return false };
            let positions = self.names.positions.get(words).unwrap_or_default();
            bundle.iter().zip(slots).zip(positions).any(|((instruction, slot), at)| {
                instruction.writes(slot) == Some(register) && at.is_some_and(|at| at.order < position.order)
            })
        })
    }

    /// Cycles until the result in flight to a register is there, if there is one.
    pub(crate) fn arrives(&self, register: Register) -> Option<Cycle> {
        let now = self.emulator.now();
        let flying = self.emulator.in_flight().filter(|retire| retire.register == Some(register));
        flying.map(|retire| retire.cycle.saturating_sub(now)).filter(|left| *left > 0).max()
    }

    pub(crate) fn read(&self, place: Place, program: &Program) -> Result<u32, String> {
        match place {
            Place::Register(register) => self
                .register(register)
                .ok_or_else(|| format!("{} was never written", program.register_text(register))),
            Place::Word(word) => self.emulator.memory().get(word as usize).copied().ok_or_else(|| {
                format!("data word {word}: the memory has words 0 to {}", self.emulator.memory().len() - 1)
            }),
        }
    }
}
