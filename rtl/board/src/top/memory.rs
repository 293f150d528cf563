// SPDX-License-Identifier: MIT OR Apache-2.0
//! The check that memories fit into a device, before the tools say so after minutes.

use super::error::TooMuch;
use super::image::Contents;
use super::shadow::copied_words;
use crate::application::Application;
use crate::boards::Board;
use crate::wiring::Wiring;
use takt_isa::Machine;
use takt_isa::memory::block_rams;
use takt_rtl::synthesis;

/// Bits of a record of the image, for so many cores: a single one has no number (`takt_boot`).
fn record_bits(cores: usize) -> u64 {
    if cores > 1 { 73 } else { 69 }
}

/// Block RAMs of the copies that the host reads, of a core among so many.
fn copies(machine: &Machine, cores: usize) -> u64 {
    let banks = machine.slots.iter().map(|slot| block_rams(slot.bank.depth.into(), 32));
    banks.sum::<u64>() + block_rams(copied_words(machine, cores).into(), 32)
}

pub(super) fn check(
    board: &Board,
    wiring: &Wiring,
    application: &Application<'_>,
    contents: &Contents,
) -> Result<(), TooMuch> {
    let machines = || application.description().cores.iter().map(|known| known.program.machine);
    let cores = machines().map(synthesis::block_rams).sum();
    let count = application.description().cores.len();
    let observers = if wiring.observe { machines().map(|machine| copies(machine, count)).sum() } else { 0 };
    let image = block_rams(contents.room as u64, record_bits(count));
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
