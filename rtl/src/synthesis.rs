// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results of synthesis: the committed `rtl/synthesis.json`, which `cargo xtask synth` writes.

use serde::{Deserialize, Serialize};
use takt_isa::Machine;

/// One design on one device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Synthesis {
    /// Name of the machine, or of the unit; path of a system's file.
    pub design: String,
    /// The device, as its maker calls it: `LFE5U-85F`.
    pub device: String,
    /// Speed grade; none where only resources are counted.
    pub grade: Option<u8>,
    /// The clock in MHz after place and route, for seeds 1, 2, …; empty where only resources are counted.
    pub mhz: Vec<f64>,
    /// The resources of the device that it takes.
    pub resources: Resources,
    /// The critical path of the median seed, in words.
    pub critical_path: String,
    /// Day of the measurement: `2026-11-21`.
    pub date: String,
    /// The tools and their versions.
    pub tools: String,
    /// A hash of the Verilog; none in measurements before 2026-11-25.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub circuit: String,
    /// The resources of a system's parts, before place and route; else none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<PartResources>,
}

/// A part of a system: a core with its gate, a link, or the rest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartResources {
    /// Its description.
    pub name: String,
    /// The resources that it takes.
    pub resources: Resources,
}

/// Resources of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resources {
    /// Look-up tables, those of carry chains and of memories in logic included: LUT4 on ECP5, GW2A and iCE40, ALUTs on Cyclone V,
    /// LUT6 on 7 series.
    pub luts: u64,
    /// The number of them in carry chains: on ECP5 halves of their cells, where it was counted; on GW2A.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub carries: Option<u64>,
    /// Flip-flops.
    pub flip_flops: u64,
    /// Multipliers of 18 x 18 bits (on Cyclone V up to 27 x 27, on 7 series 25 x 18, on iCE40 16 x 16).
    pub multipliers: u64,
    /// Block RAMs: 18 kbit on ECP5, GW2A and 7 series, 10 kbit on Cyclone V, 4 kbit on iCE40.
    pub block_rams: u64,
}

impl Synthesis {
    /// Clocks in MHz from the lowest to the highest.
    fn sorted(&self) -> Vec<f64> {
        let mut mhz = self.mhz.clone();
        mhz.sort_by(f64::total_cmp);
        mhz
    }

    /// The lowest clock of all seeds in MHz.
    pub fn least(&self) -> Option<f64> {
        self.sorted().first().copied()
    }

    /// The median clock in MHz; of an even number of seeds the lower one of the two in the middle.
    pub fn median(&self) -> Option<f64> {
        let mhz = self.sorted();
        mhz.get(mhz.len().saturating_sub(1) / 2).copied()
    }

    /// The highest clock of all seeds in MHz.
    pub fn greatest(&self) -> Option<f64> {
        self.sorted().last().copied()
    }
}

/// Reads the text of `rtl/synthesis.json`.
///
/// # Errors
/// If it is none.
pub fn parse(text: &str) -> serde_json::Result<Vec<Synthesis>> {
    serde_json::from_str(text)
}

/// Every committed measurement.
pub fn committed() -> Vec<Synthesis> {
    serde_json::from_str(include_str!("../synthesis.json")).expect("`cargo xtask synth` wrote the file")
}

/// The representative measurement of a machine: on the largest device, at the best speed grade.
pub fn of_machine(name: &str) -> Option<Synthesis> {
    let placed = committed().into_iter().filter(|row| row.design == name && row.device == "LFE5U-85F");
    placed.max_by_key(|row| row.grade)
}

/// Block RAMs of a core: as synthesis counted them, for memories of other depths with the difference of these; or, for a machine
/// whose row was not measured, those of its program and data.
pub fn block_rams(machine: &'static Machine) -> u64 {
    let memories = |machine: &Machine| machine.code_block_rams() + machine.data_block_rams();
    let row = machine.row();
    let others = of_machine(row.name)
        .map_or(0, |measured| measured.resources.block_rams.saturating_sub(memories(row)));
    others + memories(machine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memories_of_other_depths_take_the_difference() {
        let machine = |name| Machine::from_name(name).expect("it is a machine");
        let measured = of_machine("t3").expect("it is measured").resources.block_rams;
        assert_eq!(block_rams(machine("t3")), measured);
        assert_eq!(block_rams(machine("t3,data=32768")), measured + 64 - 2);
    }

    #[test]
    fn median_is_a_clock_that_was_reached() {
        let row = |mhz: &[f64]| Synthesis {
            design: "x".to_owned(),
            device: "LFE5U-85F".to_owned(),
            grade: Some(8),
            mhz: mhz.to_vec(),
            resources: Resources::default(),
            critical_path: String::new(),
            date: String::new(),
            tools: String::new(),
            circuit: String::new(),
            parts: Vec::new(),
        };
        assert_eq!(row(&[]).median(), None);
        assert_eq!(row(&[3.0, 1.0, 2.0]).median(), Some(2.0));
        assert_eq!(row(&[4.0, 3.0, 1.0, 2.0]).median(), Some(2.0));
        assert_eq!((row(&[3.0, 1.0, 2.0]).least(), row(&[3.0, 1.0, 2.0]).greatest()), (Some(1.0), Some(3.0)));
    }

    #[test]
    fn committed_file_can_be_read() {
        for row in committed() {
            assert_ne!(row.grade.is_some(), row.mhz.is_empty(), "{row:?}");
        }
    }
}
