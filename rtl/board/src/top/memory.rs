// SPDX-License-Identifier: MIT OR Apache-2.0
//! The check that memories fit into a device, before the tools say so after minutes.

use super::error::{MemoryExcess, TopError};
use super::image::Contents;
use super::shadow_memory::copied_words;
use crate::application::Application;
use crate::boards::Board;
use crate::wiring::Wiring;
use takt_isa::Machine;
use takt_isa::memory::{BlockRam, Shape};
use takt_rtl::plan::Plan;
use takt_rtl::{Library, memories};

/// Bits of a record of the image; with a single core, records have no core number (`takt_boot`).
fn record_bits(cores: usize) -> u64 {
    if cores > 1 { 73 } else { 69 }
}

/// Block RAMs of a core's copies that the host reads, in a system of `cores` cores.
fn copies(machine: &Machine, cores: usize, block: &BlockRam) -> u64 {
    let words = |words: u32| block.blocks(Shape { words: words.into(), bits: 32 });
    let banks = machine.slots.iter().map(|slot| words(slot.bank.depth.into()));
    banks.sum::<u64>() + words(copied_words(machine, cores))
}

/// Checks that memories fit, and returns the block RAMs that are left; `None` if the device's are not known.
pub(super) fn check(
    board: &Board,
    wiring: &Wiring,
    application: &Application<'_>,
    contents: &Contents,
    library: &Library,
) -> Result<Option<u64>, TopError> {
    let (memories, block) = (&board.family.memories, board.family.block_ram());
    if !block.is_initial {
        return Err(TopError::NoContents(board.family.text));
    }
    if !board.family.initial_registers && board.reset.is_none() {
        return Err(TopError::NoReset(board.family.text));
    }
    let Some(room) = board.device.room else { return Ok(None) };
    let machines = || application.description().cores.iter().map(|core| core.program.machine);
    let mut cores = 0;
    for machine in machines() {
        // The export reports machines without a circuit.
        let Ok(plan) = Plan::new(machine, library) else { return Ok(None) };
        let plan = Plan { ecc: wiring.safety.ecc, ..plan };
        cores += memories::block_rams(&plan, library, block).total();
    }
    // A second core has memories of its own.
    let times = 1 + u64::from(wiring.safety.second_core.is_some());
    cores *= times;
    let count = application.description().cores.len();
    let observers =
        if wiring.observe { machines().map(|machine| copies(machine, count, block)).sum() } else { 0 };
    let image = block.blocks(Shape { words: contents.room as u64, bits: record_bits(count) });
    let (needed, has) = (cores + image + observers, room.block_rams);
    let device = board.device.name;
    let left = has.saturating_sub(needed);
    if needed > has {
        let records = contents.records.len();
        let copies = match observers {
            0 => String::new(),
            n => format!(
                ", {n} for copies of registers and data that the host reads (`observe = false` leaves them out)"
            ),
        };
        return Err(MemoryExcess {
            kind: application.kind(),
            needed,
            image,
            records,
            cores,
            copies,
            device,
            has,
        }
        .into());
    }
    let programs = application.description().cores.iter().map(|core| &core.program);
    let small = programs.flat_map(|program| program.machine.logic_memories(program.latched_inputs() > 0));
    let (needed, has) =
        (times * small.map(|memory| memories.flip_flops(memory)).sum::<u64>(), room.flip_flops);
    if needed > has {
        let (kind, family) = (application.kind(), board.family.text);
        return Err(TopError::FlipFlops { kind, needed, family, device, has });
    }
    Ok(Some(left))
}
