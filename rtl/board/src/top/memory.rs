// SPDX-License-Identifier: MIT OR Apache-2.0
//! The check that memories fit into a device, before the tools say so after minutes.

use super::error::TooMuch;
use super::image::Contents;
use crate::application::Application;
use crate::boards::Board;
use crate::wiring::Wiring;
use takt_isa::Machine;
use takt_rtl::synthesis;

/// Block RAMs of an ECP5 that a memory with one write port and one read port takes: the fewest over all forms of a block RAM, each so
/// many words of so many bits.
fn blocks(words: u64, width: u64) -> u64 {
    let forms = [(512, 36), (1024, 18), (2048, 9), (4096, 4), (8192, 2), (16384, 1)];
    forms.map(|(deep, wide)| words.div_ceil(deep) * width.div_ceil(wide)).into_iter().min().unwrap_or(0)
}

/// Bits of a record of the image.
const RECORD: u64 = 73;

/// Block RAMs of a core: as synthesis counted them, or, for a machine that was not measured, those of its program and data.
fn core(machine: &Machine) -> u64 {
    let programs = machine.slots.len() as u64 * blocks(machine.code_depth.into(), 48);
    let least = programs + blocks(machine.data_depth.into(), 32);
    synthesis::of_machine(machine.name).map_or(least, |measured| measured.resources.block_rams)
}

/// Block RAMs of the copies that the host reads.
fn copies(machine: &Machine) -> u64 {
    let banks = machine.slots.iter().map(|slot| blocks(slot.bank.depth.into(), 32));
    banks.sum::<u64>() + blocks(machine.data_depth.into(), 32)
}

pub(super) fn check(
    board: &Board,
    wiring: &Wiring,
    application: &Application<'_>,
    contents: &Contents,
) -> Result<(), TooMuch> {
    let machines = || application.description().cores.iter().map(|known| known.program.machine);
    let cores = machines().map(core).sum();
    let observers = if wiring.observe { machines().map(copies).sum() } else { 0 };
    let image = blocks(contents.room as u64, RECORD);
    let (needed, has) = (cores + image + observers, board.device.blocks);
    if needed <= has {
        return Ok(());
    }
    let (device, records) = (board.device.part, contents.records.len());
    let copies = match observers {
        0 => String::new(),
        n => format!(
            ", {n} for copies of registers and data that the host reads (`observe = false` leaves them out)"
        ),
    };
    Err(TooMuch { kind: application.kind(), needed, image, records, cores, copies, device, has })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_memory_takes_the_fewest_blocks_of_its_forms() {
        assert_eq!([blocks(1024, 18), blocks(1024, 48), blocks(1024, 32), blocks(512, 32)], [1, 3, 2, 1]);
        assert_eq!([blocks(2048, 73), blocks(16384, 1), blocks(16385, 1)], [9, 1, 2]);
    }
}
