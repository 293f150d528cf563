// SPDX-License-Identifier: MIT OR Apache-2.0
//! Faster units tried out (what-if analysis): their effect on the unchanged program, and on the program reassembled for them.

use crate::picture::{FasterUnitCycles, Speedup};
use crate::{Trace, WhatIf};
use std::collections::HashMap;
use std::sync::{LazyLock, Mutex, PoisonError};
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Machine, Program, SlotIndex};

/// Program assembled for another machine.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Reassembled program, with that machine.
    pub program: Program,
    /// First bundle and cycles above the lower bound, for each scheduled basic block.
    pub spare: Vec<(BundleAddress, Cycle)>,
}

/// Effect of a faster unit, for each unit of a trace. `assemble` assembles the program for another machine, and `run` traces it in the same
/// way; if either returns `None`, only the effect on the unchanged program is reported.
pub fn what_if(
    program: &Program,
    trace: &Trace,
    assemble: &dyn Fn(&'static Machine) -> Option<Candidate>,
    run: &dyn Fn(&Program) -> Option<Trace>,
) -> Vec<Speedup> {
    let reassembled = |what: &WhatIf| {
        let Candidate { program, spare } = assemble(quicker(program.machine, what.unit))?;
        let found = run(&program)?;
        let visits = |address| found.issues.iter().filter(|issue| issue.address == address).count() as Cycle;
        let spare: Cycle = spare.iter().map(|(address, spare)| visits(*address) * spare).sum();
        Some(FasterUnitCycles { cycles: found.cycles, least: found.cycles.saturating_sub(spare) })
    };
    trace.what_if(program).into_iter().map(|what| Speedup { reassembled: reassembled(&what), what }).collect()
}

/// Machines that [`what_if`] asks for, in its order, so that a caller can assemble for several at a time beforehand.
pub fn faster_machines(program: &Program, trace: &Trace) -> Vec<&'static Machine> {
    trace.what_if(program).iter().map(|what| quicker(program.machine, what.unit)).collect()
}

/// Machines with a faster unit or front end, by the address of the original machine.
type FasterMachines = HashMap<(usize, Option<(SlotIndex, u8)>), &'static Machine>;

/// Machine with one cycle less in a unit or in the front end. It is leaked once per unit and original machine, and reused.
fn quicker(machine: &'static Machine, unit: Option<(SlotIndex, u8)>) -> &'static Machine {
    static KNOWN: LazyLock<Mutex<FasterMachines>> = LazyLock::new(Mutex::default);
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    known.entry((std::ptr::from_ref(machine).addr(), unit)).or_insert_with(|| faster_machine(machine, unit))
}

fn faster_machine(machine: &Machine, unit: Option<(SlotIndex, u8)>) -> &'static Machine {
    let mut slots = machine.slots.to_vec();
    let mut refill = machine.refill;
    match unit {
        Some((slot, unit)) => {
            let slot = &mut slots[slot.index()];
            let mut units = slot.units.to_vec();
            let row = &mut units[usize::from(unit)];
            row.latency -= 1;
            row.interval = row.interval.saturating_sub(1).max(1);
            slot.units = Box::leak(units.into());
        }
        None => refill -= 1,
    }
    Box::leak(Box::new(Machine { slots: Box::leak(slots.into()), refill, ..*machine }))
}
