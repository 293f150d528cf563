// SPDX-License-Identifier: MIT OR Apache-2.0
//! Replay of a core by itself: the recorded inputs and ticks of a system, in the same cycles, reproduce the core's run.

use crate::System;
use std::collections::VecDeque;
use takt_emu::{Emulator, Event, LoadError};
use takt_isa::Register;
use takt_isa::timing::Cycle;

/// Recorded inputs and ticks of each core of a system.
pub struct Recording {
    cores: Vec<RecordedInputs>,
}

/// Recorded inputs and ticks of a core.
#[derive(Clone, Default)]
struct RecordedInputs {
    /// Values of input ports, each with the first cycle in which it counts.
    inputs: VecDeque<(Cycle, Register, u32)>,
    ticks: Vec<Cycle>,
    /// Cycles until the last period ended, or until the core halted.
    end: Cycle,
}

impl Recording {
    /// Starts recording a system after reset.
    pub fn new(system: &mut System) -> Recording {
        system.keep_core_events();
        Recording { cores: vec![RecordedInputs::default(); system.description().cores.len()] }
    }

    /// Records the events since the last call; call it after each run of the system.
    pub fn record(&mut self, system: &mut System) {
        for input in system.take_input_events() {
            let delay = system.description().cores[input.core].input_delay();
            self.cores[input.core].inputs.push_back((input.cycle + delay, input.register, input.value));
        }
        for (core, event) in system.take_core_events() {
            match event {
                Event::Tick { cycle } => self.cores[core].ticks.push(cycle),
                Event::Wait { cycle, .. } | Event::Halt { cycle, .. } => self.cores[core].end = cycle + 1,
                _ => {}
            }
        }
    }

    /// Replay of a core, up to its last completed period.
    ///
    /// # Errors
    /// If the core's memories cannot hold its program.
    pub fn replay(&self, system: &System, core: usize) -> Result<Replay, LoadError> {
        let (description, given) = (system.description(), &self.cores[core]);
        let mut emulator = Emulator::new(&description.cores[core].program)?;
        let start = description.mailboxes(core).into_iter();
        let start = start.map(|mailbox| (0, mailbox.register, description.initial(mailbox.source)));
        let inputs = Inputs(start.chain(given.inputs.iter().copied()).collect());
        for &tick in given.ticks.iter().filter(|tick| **tick < given.end) {
            emulator.tick_at(tick);
        }
        Ok(Replay { emulator, inputs, end: given.end })
    }
}

/// Core outside of its system.
pub struct Replay {
    /// Emulator of the core, with its ticks scheduled.
    pub emulator: Emulator,
    /// Input changes to come.
    pub inputs: Inputs,
    /// Cycles until the core's last period has ended, or until it has halted.
    pub end: Cycle,
}

/// Future input changes of a core.
pub struct Inputs(VecDeque<(Cycle, Register, u32)>);

impl Inputs {
    /// Sets the inputs that count from the core's next cycle on.
    pub fn set(&mut self, emulator: &mut Emulator) {
        while let Some((_, register, value)) = self.0.pop_front_if(|(cycle, ..)| *cycle <= emulator.now()) {
            // The register is an input port, so setting it cannot fail.
            let _ = emulator.set_input_bits(register, value);
        }
    }
}
