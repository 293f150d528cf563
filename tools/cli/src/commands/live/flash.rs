// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images in a board's flash: `takt load --flash` and `takt live flash`.

use crate::terminal::files::Out;
use crate::terminal::progress::progress;
use anyhow::{Context, Result};
use std::io::Write;
use takt_board::Host;
use takt_board::flash::{self, Place, Slot};
use takt_board::serial::Serial;

/// The board's flash.
pub(super) fn place(host: &mut Host<Serial>) -> Result<Place> {
    host.flash()?.context(
        "this board has no flash: its wiring names the pins of one in the table `[flash]` (docs/board.md)",
    )
}

/// Stores a program's records as the newest image.
pub(super) fn store(
    host: &mut Host<Serial>,
    place: &Place,
    records: &[[u32; 3]],
    out: &mut Out,
) -> Result<()> {
    let entries = flash::entries(records);
    let bar = progress(flash::image(0, 0, &entries).len() as u64, "bytes", false);
    let stored = flash::store(host, place, &entries, |more| bar.inc(more as u64));
    bar.finish_and_clear();
    let (slot, number) = stored?;
    writeln!(
        out,
        "image {number} stored in the flash and compared, as the {slot} of two; the next power-up starts it"
    )?;
    Ok(())
}

/// Shows the images, or makes them invalid.
pub(super) fn run(host: &mut Host<Serial>, forget: bool, out: &mut Out) -> Result<()> {
    let place = place(host)?;
    if forget {
        flash::forget(host, &place)?;
        writeln!(out, "no image is valid now; the next power-up starts the bitstream's program")?;
        return Ok(());
    }
    let started = host.started()?;
    let numbers = flash::numbers(host, &place)?;
    match started.running() {
        Some(slot) => writeln!(out, "started with the {slot} image")?,
        None => writeln!(out, "started with the bitstream's program")?,
    }
    let newest = flash::newest(numbers);
    for (slot, (number, at)) in Slot::ALL.into_iter().zip(numbers.into_iter().zip(place.slots)) {
        let next = if newest == Some(slot) { "; the next power-up starts it" } else { "" };
        let failed =
            if started.failed(slot) { "; at the last start it read otherwise the second time" } else { "" };
        match number {
            Some(number) => writeln!(out, "{slot} image, at 0x{at:06x}: number {number}{next}{failed}")?,
            None => {
                writeln!(out, "{slot} image, at 0x{at:06x}: none that is valid for this circuit{failed}")?
            }
        }
    }
    Ok(())
}
