// SPDX-License-Identifier: MIT OR Apache-2.0
//! A core whose memories have error correction does in every cycle what the core without does.

use crate::common::assemble;
use crate::lockstep::track;
use crate::pair::{DELAY, runs_as_the_emulator, start};
use takt_isa::{Machine, Program, T1, T3, T4};
use takt_rtl::{Design, Library, Safety, export};

/// The core of a machine, perhaps with a second one.
pub(crate) fn design(machine: &'static Machine, latched: u16, second_core: Option<u32>) -> Design {
    let design = export(machine, &Library::builtin()).and_then(|design| design.latching(latched));
    design.and_then(|design| design.with(Safety { ecc: true, second_core })).expect("every core can have it")
}

#[test]
fn no_cycle_of_any_program_changes() {
    for (machine, second_core) in [(&T1, None), (&T3, None), (&T4, None), (&T1, Some(DELAY))] {
        runs_as_the_emulator(machine, &design(machine, 0, second_core));
    }
}

#[test]
fn latched_ports_are_those_without() {
    let program = Program { latched: true, ..assemble(&T1, "hybrid/tracking.s") };
    track(&program, start(&design(&T1, program.latched_inputs(), None)), 20);
}
