// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results of synthesis: the committed `rtl/synthesis.json`, written by `cargo evidence synth`.

use serde::{Deserialize, Serialize};
use takt_family::{MEASURED, Resources};

/// Measurement of a design on a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Synthesis {
    /// Name of the machine or of the unit, or path of a system's file.
    pub design: String,
    /// Maker's name of the device ([`Part::name`](takt_family::Part::name)).
    pub device: String,
    /// Speed grade; `None` where only resources are counted.
    pub grade: Option<u8>,
    /// Clock in MHz after place and route, for seeds 1, 2, …; empty where only resources are counted.
    pub mhz: Vec<f64>,
    /// Resources of the device that the design takes.
    pub resources: Resources,
    /// Critical path of the median seed, in words.
    pub critical_path: String,
    /// Day of the measurement: `2026-11-21`.
    pub date: String,
    /// Tools and their versions.
    pub tools: String,
    /// Hash of the Verilog; empty in measurements before 2026-11-25.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub circuit: String,
    /// Resources of a system's parts, before place and route; otherwise empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<PartResources>,
}

/// Part of a system: a core with its gate, a link, or the rest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartResources {
    /// Description of the part.
    pub name: String,
    /// Resources of the device that the part takes.
    pub resources: Resources,
}

impl Synthesis {
    /// Clocks in MHz, ascending.
    fn sorted(&self) -> Vec<f64> {
        let mut mhz = self.mhz.clone();
        mhz.sort_by(f64::total_cmp);
        mhz
    }

    /// Lowest clock of all seeds, in MHz.
    pub fn least(&self) -> Option<f64> {
        self.sorted().first().copied()
    }

    /// Median clock in MHz; of an even number of seeds the lower of the two medians.
    pub fn median(&self) -> Option<f64> {
        let mhz = self.sorted();
        mhz.get(mhz.len().saturating_sub(1) / 2).copied()
    }

    /// Highest clock of all seeds, in MHz.
    pub fn greatest(&self) -> Option<f64> {
        self.sorted().last().copied()
    }
}

/// Reads the text of `rtl/synthesis.json`.
///
/// # Errors
/// If the text does not have the file's format.
pub fn parse(text: &str) -> serde_json::Result<Vec<Synthesis>> {
    serde_json::from_str(text)
}

/// Committed measurements of all designs.
pub fn committed() -> Vec<Synthesis> {
    serde_json::from_str(include_str!("../synthesis.json")).expect("`cargo evidence synth` wrote the file")
}

/// Representative measurement of a machine: on the largest device, at the best speed grade.
pub fn of_machine(name: &str) -> Option<Synthesis> {
    let placed = committed().into_iter().filter(|row| row.design == name && row.device == MEASURED.part);
    placed.max_by_key(|row| row.grade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_is_a_clock_that_was_reached() {
        let row = |mhz: &[f64]| Synthesis {
            design: "x".to_owned(),
            device: MEASURED.part.to_owned(),
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
