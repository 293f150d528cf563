// SPDX-License-Identifier: MIT OR Apache-2.0
//! Resources of a device, and how many of them a netlist takes.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Resources of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resources {
    /// Look-up tables ([`Family::lut`](crate::Family::lut)), including those of carry chains and of memories in logic.
    pub luts: u64,
    /// Look-up tables in carry chains among these, where they were counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub carries: Option<u64>,
    /// Number of flip-flops.
    pub flip_flops: u64,
    /// Multipliers of the family's width.
    pub multipliers: u64,
    /// Block RAMs of the family's size.
    pub block_rams: u64,
}

/// Cells by their names in yosys, each with the number of places that it takes. A name matches all cells that begin with it; the longest
/// matching name counts.
#[derive(Clone, Copy, Debug)]
pub struct Cells {
    /// Cells in look-up tables.
    pub luts: &'static [(&'static str, u64)],
    /// Cells of carry chains among these; empty if carry chains have no cells of their own.
    pub carries: &'static [(&'static str, u64)],
    /// Flip-flop cells.
    pub flip_flops: &'static [(&'static str, u64)],
    /// Multiplier cells.
    pub multipliers: &'static [(&'static str, u64)],
    /// Block RAM cells.
    pub block_rams: &'static [(&'static str, u64)],
}

/// Number of places that a cell takes.
fn places(cells: &[(&str, u64)], name: &str) -> u64 {
    // The longest matching name counts: `SDP` and `SP` differ.
    let fitting = cells.iter().filter(|(kind, _)| name.starts_with(kind));
    fitting.max_by_key(|(kind, _)| kind.len()).map_or(0, |(_, places)| *places)
}

impl Cells {
    /// Resources without any cell.
    pub fn none(&self) -> Resources {
        Resources { carries: (!self.carries.is_empty()).then_some(0), ..Resources::default() }
    }

    /// Adds `count` cells of a kind.
    pub fn add(&self, resources: &mut Resources, kind: &str, count: u64) {
        resources.luts += count * places(self.luts, kind);
        resources.carries = resources.carries.map(|carries| carries + count * places(self.carries, kind));
        resources.flip_flops += count * places(self.flip_flops, kind);
        resources.multipliers += count * places(self.multipliers, kind);
        resources.block_rams += count * places(self.block_rams, kind);
    }

    /// Resources by the statistics of yosys (`stat -json`).
    pub fn resources(&self, statistics: &Value) -> Resources {
        let mut resources = self.none();
        let cells = statistics["design"]["num_cells_by_type"].as_object();
        for (kind, count) in cells.into_iter().flatten() {
            self.add(&mut resources, kind, count.as_u64().unwrap_or(0));
        }
        resources
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{gowin, lacks};
    use serde_json::json;

    #[test]
    fn cells_are_counted_by_their_longest_name() {
        let statistics = json!({"design": {"num_cells_by_type": {
            "LUT4": 10, "LUT1": 1, "ALU": 5, "MUX2_LUT5": 7, "RAM16SDP4": 2, "DFFCE": 3, "DFF": 1, "MULT18X18": 2, "SDPX9B": 4, "SP": 1,
            "IBUF": 9,
        }}});
        let gowin = &gowin::FAMILY;
        let taken = gowin.cells.resources(&statistics);
        let expected = Resources { luts: 24, carries: Some(5), flip_flops: 4, multipliers: 2, block_rams: 5 };
        assert_eq!(taken, expected);
        assert!(lacks(&gowin.parts[0], &taken).is_empty());
        let large = Resources { block_rams: 47, luts: 20_737, ..taken };
        let few = [("LUTs", 20_737, 20_736), ("block RAMs", 47, 46)];
        assert_eq!(lacks(&gowin.parts[0], &large), few);
    }
}
