// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model of the circuit `takt_filter`.

/// Synchroniser of an input pin, with a filter against short pulses.
#[derive(Clone, Debug)]
pub struct Filter {
    hold: u32,
    synchroniser: [bool; 2],
    held: u32,
    level: bool,
}

impl Filter {
    /// Filter that passes a level once it has been stable for `hold` cycles.
    pub fn new(hold: u32) -> Filter {
        Filter { hold: hold.max(1), synchroniser: [false; 2], held: 0, level: false }
    }

    /// The level of the filtered pin.
    pub fn level(&self) -> bool {
        self.level
    }

    /// Takes the clock's edge, with the levels of reset and pin.
    pub fn clock(&mut self, rst: bool, pin: bool) {
        let [first, second] = self.synchroniser;
        let passes = self.held == self.hold - 1;
        self.held = if rst || second == self.level || passes { 0 } else { self.held + 1 };
        if rst || passes {
            self.level = second;
        }
        self.synchroniser = [pin, first];
    }
}
