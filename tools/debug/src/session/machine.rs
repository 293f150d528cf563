// SPDX-License-Identifier: MIT OR Apache-2.0
//! Machine at a position: registers as the next bundle reads them, data words, and the current source line.

use super::stale::Writers;
use takt_asm::names::{Names, Position};
use takt_emu::Emulator;
use takt_isa::program::Location;
use takt_isa::{Program, Register};

/// A register or a data word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A register by address.
    Register(Register),
    /// A data word by address.
    Word(u32),
}

/// View of the machine for the evaluation of expressions.
pub(crate) struct Machine<'e> {
    pub(crate) emulator: &'e Emulator,
    pub(crate) periods: u64,
    pub(crate) names: &'e Names,
    pub(super) writers: &'e Writers,
    /// Current source line, if it differs from that of the next bundle.
    pub(crate) line: Option<Location>,
    /// Registers include results still in flight, as the current line will read them.
    pub(crate) ahead: bool,
}

impl Machine<'_> {
    /// Value that a bundle would read if it issued in the next cycle.
    pub(crate) fn register(&self, register: Register) -> Option<u32> {
        if let Some(coming) = self.coming(register).filter(|_| self.ahead) {
            return Some(coming);
        }
        let now = self.emulator.now();
        let due = self.emulator.in_flight().filter(|retire| retire.cycle == now);
        due.filter(|retire| retire.register == Some(register))
            .map(|retire| retire.value)
            .next()
            .or_else(|| self.emulator.register(register))
    }

    /// Position of the current line in the source order.
    pub(crate) fn at_hand(&self) -> Position {
        let (slots, next) = (self.emulator.machine().slots.len(), self.emulator.next_address());
        let start = next.index() * slots;
        let lines = self.emulator.program().locations(next);
        let word = lines.iter().position(|line| line.is_some() && *line == self.line);
        let position = word.and_then(|word| self.names.positions.get(start + word).copied().flatten());
        position.unwrap_or_else(|| self.names.at_hand(slots, next))
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
