// SPDX-License-Identifier: MIT OR Apache-2.0
//! The device for which a search looks for machines.

use crate::terminal::options;
use std::fmt;
use takt_family::{FAMILIES, Family, Part, Resources};
use takt_rtl::estimate::Estimator;

/// A device, and the room for a core on it.
#[derive(Clone, Copy)]
pub(super) struct Device {
    pub(super) family: &'static Family,
    pub(super) part: &'static Part,
    /// Resources of the device without those of the board's own logic.
    pub(super) room: Resources,
}

/// Logic of a board without a host: tick, interlock, loading of the image, and some peripherals. The board of
/// `programs/examples/board/step` has 462 tables and 134 flip-flops beside its core on an iCE40UP5K.
const BOARD: Resources =
    Resources { luts: 600, carries: None, flip_flops: 300, multipliers: 0, block_rams: 0 };

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Resources { luts, flip_flops, multipliers, block_rams, .. } = self.room;
        write!(
            f,
            "{}: {luts} {} and {flip_flops} flip-flops beside a board's logic, {block_rams} block RAMs, {multipliers} multipliers",
            self.part.name,
            self.family.cells_text()
        )
    }
}

/// Devices of families for which areas and clocks are estimated.
fn devices() -> impl Iterator<Item = Device> {
    FAMILIES.iter().filter(|family| Estimator::knows(family)).flat_map(|family| {
        family.parts.iter().filter_map(|part| {
            let room = part.room?;
            let luts = room.luts.saturating_sub(BOARD.luts);
            let flip_flops = room.flip_flops.saturating_sub(BOARD.flip_flops);
            Some(Device { family, part, room: Resources { luts, flip_flops, ..room } })
        })
    })
}

/// Parses a device's name, or its end, in small or capital letters, as a value parser for clap.
pub(super) fn device(text: &str) -> Result<Device, String> {
    let (all, wanted) = (devices().collect::<Vec<_>>(), text.to_ascii_lowercase());
    let found: Vec<&Device> = all
        .iter()
        .filter(|device| !wanted.is_empty() && device.part.name.to_ascii_lowercase().ends_with(&wanted))
        .collect();
    let exact = found.iter().find(|device| device.part.name.eq_ignore_ascii_case(text));
    let names = |of: &mut dyn Iterator<Item = &Device>| of.map(|device| device.part.name).collect::<Vec<_>>();
    match (exact, &found[..]) {
        (Some(device), _) | (None, [device]) => Ok(**device),
        (None, []) => {
            let names = names(&mut all.iter());
            let near = options::suggest(text, names.iter().copied());
            Err(format!("machines are estimated for no such device{near} ({})", names.join(", ")))
        }
        (None, several) => Err(format!(
            "that is the end of several names: {}",
            names(&mut several.iter().copied()).join(", ")
        )),
    }
}
