// SPDX-License-Identifier: MIT OR Apache-2.0
//! Families of devices: how yosys is called for them, what its cells take there, and whether a design finds room.

use crate::venv::NEXTPNR_GOWIN;
use serde_json::Value;
use takt_board::place;
use takt_board::tools::{Mapping, NEXTPNR};
use takt_rtl::synthesis::Resources;

/// A family of devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Family {
    /// Lattice ECP5: placed and routed.
    Ecp5,
    /// Gowin: GW2A-18, placed and routed if it fits.
    Gowin,
    /// Intel Cyclone V: counted.
    Intel,
    /// AMD (Xilinx) 7 series: counted, for an Artix XC7A35T.
    Xilinx,
    /// Lattice iCE40 UltraPlus: counted.
    Ice40,
}

/// nextpnr's arguments for a Gowin.
pub(super) const GOWIN_PLACE: &[&str] =
    &["--device", "GW2A-LV18PG256C8/I7", "--vopt", "family=GW2A-18", "--vopt", "cst=pins.cst"];
/// The places of a machine's pins (those of the Tang Primer 20K); nextpnr asks for one of each.
pub(super) const GOWIN_PINS: &str = "IO_LOC \"clk\" H11;
IO_LOC \"rst\" T3;
IO_LOC \"serial_in\" T2;
IO_LOC \"serial_out\" C13;
";
/// The 8 of its C8/I7.
pub(super) const GOWIN_GRADE: u8 = 8;

/// Cells by their names in yosys, and how many places each takes. A name stands for all that begin with it.
type Cells = &'static [(&'static str, u64)];

/// The counting of a family's resources, for families other than ECP5.
pub(super) struct Counted {
    /// Which it is.
    pub(super) family: Family,
    /// The device: that of a measurement's row.
    pub(super) device: &'static str,
    /// yosys' command, without the top module.
    pub(super) synthesis: &'static str,
    /// The table's names of its look-up tables, multipliers and block RAMs.
    pub(super) terms: [&'static str; 3],
    /// The device's resources; none if the row stands for a family.
    pub(super) room: Option<Resources>,
    luts: Cells,
    /// Of these, those of carry chains.
    carries: Cells,
    flip_flops: Cells,
    multipliers: Cells,
    block_rams: Cells,
}

const fn room(luts: u64, flip_flops: u64, multipliers: u64, block_rams: u64) -> Option<Resources> {
    Some(Resources { luts, carries: None, flip_flops, multipliers, block_rams })
}

/// Every family but ECP5. The rooms are the makers' (DS180, DS102, iCE40 UltraPlus' data sheet).
pub(super) const COUNTED: [Counted; 4] = [
    Counted {
        family: Family::Gowin,
        device: "GW2A-18",
        synthesis: "synth_gowin -family gw2a -json netlist.json",
        terms: ["LUT4, carry cells included", "of 18 x 18 bits", "of 18 kbit"],
        room: room(20_736, 15_552, 48, 46),
        // A memory of 16 words of 4 bits is made of four LUT4.
        luts: &[("LUT", 1), ("ALU", 1), ("RAM16SDP4", 4), ("RAM16SDP2", 2), ("RAM16SDP1", 1)],
        carries: &[("ALU", 1)],
        flip_flops: &[("DFF", 1)],
        multipliers: &[
            ("MULT18X18", 1),
            ("MULT9X9", 1),
            ("MULT36X36", 4),
            ("MULTADDALU18X18", 2),
            ("MULTALU", 1),
        ],
        block_rams: &[("SDP", 1), ("DPB", 1), ("DPX9B", 1), ("SPX9", 1), ("SP", 1), ("pROM", 1)],
    },
    Counted {
        family: Family::Intel,
        device: "Cyclone V",
        synthesis: "synth_intel_alm -family cyclonev",
        terms: ["ALUT", "of up to 27 x 27 bits", "of 10 kbit"],
        room: None,
        luts: &[("MISTRAL_ALUT", 1), ("MISTRAL_NOT", 1), ("MISTRAL_MLAB", 2)],
        carries: &[],
        flip_flops: &[("MISTRAL_FF", 1)],
        multipliers: &[("MISTRAL_MUL", 1)],
        block_rams: &[("MISTRAL_M10K", 1)],
    },
    Counted {
        family: Family::Xilinx,
        device: "XC7A35T",
        synthesis: "synth_xilinx -family xc7 -flatten -noiopad -noclkbuf",
        terms: ["LUT6", "DSP48E1", "of 18 kbit"],
        room: room(20_800, 41_600, 90, 100),
        luts: &[
            ("LUT", 1),
            ("INV", 1),
            ("SRL", 1),
            ("RAM32M", 4),
            ("RAM64M", 4),
            ("RAM32X1D", 2),
            ("RAM64X1D", 2),
        ],
        carries: &[],
        flip_flops: &[("FD", 1)],
        multipliers: &[("DSP48E1", 1)],
        block_rams: &[("RAMB18E1", 1), ("RAMB36E1", 2)],
    },
    Counted {
        family: Family::Ice40,
        device: "iCE40UP5K",
        synthesis: "synth_ice40 -device u -dsp",
        terms: ["LUT4", "of 16 x 16 bits", "of 4 kbit"],
        room: room(5_280, 5_280, 8, 30),
        luts: &[("SB_LUT4", 1)],
        carries: &[],
        flip_flops: &[("SB_DFF", 1)],
        multipliers: &[("SB_MAC16", 1)],
        block_rams: &[("SB_RAM40_4K", 1)],
    },
];

impl Family {
    /// The resources counted of it; none for ECP5.
    pub(super) fn counted(self) -> Option<&'static Counted> {
        COUNTED.iter().find(|counted| counted.family == self)
    }

    /// yosys' commands up to the netlist.
    pub(super) fn synthesis(self, top: &str, mapping: Mapping) -> String {
        match self.counted() {
            Some(counted) => format!("{} -top {top}", counted.synthesis),
            None => place::synthesis(top, mapping),
        }
    }

    /// The package that places and routes for it.
    pub(super) fn placer(self) -> Option<&'static str> {
        match self {
            Family::Ecp5 => Some(NEXTPNR),
            Family::Gowin => Some(NEXTPNR_GOWIN),
            Family::Intel | Family::Xilinx | Family::Ice40 => None,
        }
    }
}

impl Counted {
    /// From yosys' statistics.
    pub(super) fn resources(&self, statistics: &Value) -> Resources {
        let cells = statistics["design"]["num_cells_by_type"].as_object();
        let count = |kinds: Cells| -> u64 {
            let places = |name: &str| {
                // The longest name counts: `SDP` and `SP` are two.
                let fitting = kinds.iter().filter(|(kind, _)| name.starts_with(kind));
                fitting.max_by_key(|(kind, _)| kind.len()).map_or(0, |(_, places)| *places)
            };
            cells.into_iter().flatten().map(|(name, count)| places(name) * count.as_u64().unwrap_or(0)).sum()
        };
        Resources {
            luts: count(self.luts),
            carries: (!self.carries.is_empty()).then(|| count(self.carries)),
            flip_flops: count(self.flip_flops),
            multipliers: count(self.multipliers),
            block_rams: count(self.block_rams),
        }
    }

    /// The resources that the device lacks; none if the design fits, or if the row stands for a family.
    pub(super) fn lacks(&self, taken: &Resources) -> Vec<&'static str> {
        let Some(room) = self.room else { return Vec::new() };
        [
            ("LUTs", taken.luts, room.luts),
            ("flip-flops", taken.flip_flops, room.flip_flops),
            ("multipliers", taken.multipliers, room.multipliers),
            ("block RAMs", taken.block_rams, room.block_rams),
        ]
        .into_iter()
        .filter(|(_, taken, room)| taken > room)
        .map(|(name, ..)| name)
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn cells_are_counted_by_their_longest_name() {
        let statistics = json!({"design": {"num_cells_by_type": {
            "LUT4": 10, "LUT1": 1, "ALU": 5, "MUX2_LUT5": 7, "RAM16SDP4": 2, "DFFCE": 3, "DFF": 1, "MULT18X18": 2, "SDPX9B": 4, "SP": 1,
            "IBUF": 9,
        }}});
        let gowin = Family::Gowin.counted().expect("it is counted");
        let taken = gowin.resources(&statistics);
        let expected = Resources { luts: 24, carries: Some(5), flip_flops: 4, multipliers: 2, block_rams: 5 };
        assert_eq!(taken, expected);
        assert!(gowin.lacks(&taken).is_empty());
        let large = Resources { block_rams: 47, luts: 20_737, ..taken };
        assert_eq!(gowin.lacks(&large), ["LUTs", "block RAMs"]);
    }

    #[test]
    fn every_family_but_ecp5_is_counted_once() {
        use clap::ValueEnum;
        for family in Family::value_variants() {
            let rows = COUNTED.iter().filter(|counted| counted.family == *family).count();
            assert_eq!(rows, usize::from(*family != Family::Ecp5), "{family:?}");
        }
    }
}
