// SPDX-License-Identifier: MIT OR Apache-2.0
//! FPGA families as values: [`Family`] holds everything that the rest of Takt knows about a family. Each family has one file or folder
//! here, with its value, its Verilog and its formats. [`FAMILIES`] lists them.
//!
//! A new family is a new value of [`Family`], of which the compiler requires every field. Parts that a family may lack are options:
//! without [`Family::board`] no board can have the family, without [`Family::place`] its cores are only counted, without [`Family::pack`]
//! there is no bitstream, unless the tools of the maker make it from the project that [`Family::flow`] writes.

#[cfg(test)]
mod confinement;
mod count;
pub mod cyclone_v;
pub mod ecp5;
mod flow;
pub mod gatemate;
pub mod gowin;
pub mod ice40;
mod netlist;
pub mod nexus;
mod pins;
mod place;
mod pll;
pub mod series_7;
mod synthesis;

pub use count::{Cells, Resources};
pub use flow::{Attachment, Flow, Processor, Project};
pub use pins::{Constraints, Pin, PinRole, Pinout, Pull, Sites};
pub use place::{
    Equality, MappedTable, MeasurementDevice, Models, Pack, Place, Proof, ROUTED, UNKEPT, YosysFile,
};
pub use pll::{Pll, PllError};
pub use synthesis::{Mapping, Synthesis};

use takt_isa::memory::{BlockRam, Memories};

/// Name and text of a file.
pub type File = (&'static str, &'static str);

/// Family of FPGAs.
#[derive(Clone, Debug)]
pub struct Family {
    /// Name on the command line and in exported folders: `gowin`.
    pub name: &'static str,
    /// Maker and name: `Gowin GW2A`.
    pub text: &'static str,
    /// Devices, from the smallest to the largest.
    pub parts: &'static [Part],
    /// Lowest and highest speed grade, as in the names of the parts; 0 without grades.
    pub grades: (u8, u8),
    /// Verilog modules of the family's own cells, by file name. Each replaces the general module of the same file name in `rtl/core` or
    /// `rtl/units/common` and keeps its contract.
    pub modules: &'static [File],
    /// Memories: shapes of a block RAM and of a memory in logic, and whether the bitstream fills them.
    pub memories: Memories,
    /// Name of the look-up table in rows of measurements: `LUT4`.
    pub lut: &'static str,
    /// Cells that a design takes for each of its flip-flops, beside those of its tables, where a cell holds a table and a flip-flop: of
    /// placed designs. `None` where flip-flops have places of their own.
    pub cells_per_flip_flop: Option<f64>,
    /// Bits of the operands of a multiplier block.
    pub multiplier: [u32; 2],
    /// Carry chain; `None` if it is part of the cells that count as look-up tables.
    pub carry: Option<Carry>,
    /// Flip-flops start with the values of Verilog's `initial`; otherwise a board needs a reset button.
    pub initial_registers: bool,
    /// Oscillator within the device; `None` without an oscillator that a design can use.
    pub oscillator: Option<Oscillator>,
    /// Way to the clock of the flash that the device is configured from, where it is no ordinary pin; `None` without such a way.
    pub flash_clock: Option<FlashClock>,
    /// Cells of yosys' netlist that count as resources.
    pub cells: Cells,
    /// PLL; `None` if Takt knows no dividers for it: the pin's clock is then the board's clock.
    pub pll: Option<Pll>,
    /// Synthesis with yosys; `None` if yosys has no command for the family.
    pub synthesis: Option<Synthesis>,
    /// Place and route with nextpnr; `None` if no open tool supports the family.
    pub place: Option<Place>,
    /// Packing of a placed design into a bitstream.
    pub pack: Option<Pack>,
    /// Models of the cells, for simulation after synthesis and after place and route.
    pub models: Option<Models>,
    /// Comparison of the replaced register bank with the general one; `None` if the bank is not replaced.
    pub bank: Option<Proof>,
    /// Packages, pins and their constraints; `None` if no board may have the family.
    pub board: Option<Pinout>,
    /// Projects for the maker's tools; `None` if Takt writes none.
    pub flow: Option<Flow>,
}

/// Device of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Maker's name of the device; the family's name if the family is only counted.
    pub name: &'static str,
    /// Name or option of the device for place and route; empty without place and route.
    pub tool: &'static str,
    /// Resources of the device; `None` if it stands for a family.
    pub room: Option<Resources>,
}

/// Cell of a carry chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Carry {
    /// Cell of yosys' netlist.
    pub cell: &'static str,
    /// Number of look-up tables whose places the cell takes.
    pub luts: u64,
    /// Ports by which nextpnr's report names the chain.
    pub ports: &'static [&'static str],
}

/// Cell that drives the clock of the configuration flash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlashClock {
    /// Instance in Verilog that takes the net `flash_clock`.
    pub instance: &'static str,
    /// The cell in simulation, where it drives nothing.
    pub stand_in: File,
}

/// Oscillator within a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillator {
    /// Maker's name of the cell.
    pub cell: &'static str,
    /// Lowest and highest nominal frequency, MHz.
    pub mhz: (f64, f64),
    /// Nominal frequency of [`Oscillator::instance`], MHz.
    pub runs: f64,
    /// Instance in Verilog that drives `oscillation` at some 10 MHz, or at the cell's only frequency.
    pub instance: &'static str,
}

impl PartialEq for Family {
    fn eq(&self, other: &Family) -> bool {
        self.name == other.name
    }
}

/// All families, in the order of the documents.
pub static FAMILIES: &[&Family] = &[
    &ecp5::FAMILY,
    &gowin::FAMILY,
    &gowin::arora_v::FAMILY,
    &gowin::little_bee::FAMILY,
    &ice40::FAMILY,
    &gatemate::FAMILY,
    &nexus::FAMILY,
    &cyclone_v::FAMILY,
    &series_7::FAMILY,
];

/// Family on which the clock and area of machines are measured, and for which they are estimated.
pub static REFERENCE: &Family = &ecp5::FAMILY;

/// Device on which [`REFERENCE`] is measured.
pub static MEASURED: &MeasurementDevice = &ecp5::MEASURED;

impl Family {
    /// Finds a family by name.
    pub fn from_name(name: &str) -> Option<&'static Family> {
        FAMILIES.iter().copied().find(|family| family.name == name)
    }

    /// Finds the family of a device.
    pub fn of_part(part: &str) -> Option<&'static Family> {
        FAMILIES.iter().copied().find(|family| family.part(part).is_some())
    }

    /// Finds a device by name.
    pub fn part(&self, name: &str) -> Option<&'static Part> {
        self.parts.iter().find(|part| part.name == name)
    }

    /// Default device of the family: the measured device, otherwise the largest.
    pub fn representative(&self) -> Option<&'static Part> {
        let measured = self.place.as_ref().and_then(|place| self.part(place.measured.part));
        measured.or_else(|| self.parts.last())
    }

    /// The cells that limit a design, in words.
    pub fn cells_text(&self) -> &'static str {
        if self.cells_per_flip_flop.is_some() { "cells" } else { self.lut }
    }

    /// Block RAM.
    pub fn block_ram(&self) -> &BlockRam {
        &self.memories.block
    }
}

/// Resources that a device lacks for a design: name, number needed, number available. Empty if the design fits, or if the device stands
/// for a family.
pub fn lacks(part: &Part, taken: &Resources) -> Vec<(&'static str, u64, u64)> {
    let Some(room) = part.room else { return Vec::new() };
    let all = [
        ("LUTs", taken.luts, room.luts),
        ("flip-flops", taken.flip_flops, room.flip_flops),
        ("multipliers", taken.multipliers, room.multipliers),
        ("block RAMs", taken.block_rams, room.block_rams),
    ];
    all.into_iter().filter(|(_, taken, room)| taken > room).collect()
}

const fn room(luts: u64, flip_flops: u64, multipliers: u64, block_rams: u64) -> Option<Resources> {
    Some(Resources { luts, carries: None, flip_flops, multipliers, block_rams })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_parts_are_unique() {
        let mut names: Vec<&str> = FAMILIES.iter().map(|family| family.name).collect();
        names.extend(FAMILIES.iter().flat_map(|family| family.parts).map(|part| part.name));
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn measurement_devices_exist() {
        for family in FAMILIES {
            let Some(place) = &family.place else { continue };
            assert!(
                family.part(place.measured.part).is_some_and(|part| part.room.is_some()),
                "{}",
                family.name
            );
            assert!(family.synthesis.is_some(), "{}: place and route of no netlist", family.name);
        }
        for (family, options) in
            FAMILIES.iter().map(|family| (family, family.pack.is_some() || family.models.is_some()))
        {
            assert!(!options || family.place.is_some(), "{}: a bitstream of no placement", family.name);
        }
    }

    #[test]
    fn flows_have_pins_and_devices_for_them() {
        for family in FAMILIES {
            let Some(flow) = &family.flow else { continue };
            assert!(family.board.is_some(), "{}: a project without pins", family.name);
            let boards = family.parts.iter().filter(|part| part.room.is_some());
            assert!(boards.clone().count() > 0 && boards.clone().all(|part| !part.tool.is_empty()));
            assert_eq!(
                FAMILIES
                    .iter()
                    .filter_map(|other| other.flow)
                    .filter(|other| other.name == flow.name)
                    .count(),
                1
            );
            let Some(processor) = flow.processor else { continue };
            assert!(
                boards.clone().any(processor.is_on) && !boards.clone().all(processor.is_on),
                "{}",
                family.name
            );
        }
    }

    #[test]
    fn replaced_banks_are_compared() {
        for family in FAMILIES {
            let replaces = family.modules.iter().any(|(name, _)| *name == "takt_bank.v");
            assert_eq!(family.bank.is_some(), replaces, "{}", family.name);
        }
    }
}
