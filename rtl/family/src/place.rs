// SPDX-License-Identifier: MIT OR Apache-2.0
//! Place and route with nextpnr, bitstreams, and the models of cells with which a netlist is simulated.

use crate::{File, Part};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// nextpnr's netlist, in the folder where a design is built.
pub const ROUTED: &str = "routed.json";

/// Place and route with nextpnr.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// PyPI package with its version, as an argument of pip.
    pub package: &'static str,
    /// Program of that package.
    pub program: &'static str,
    /// Arguments that select a device, its package and its speed grade.
    pub device: fn(&Part, &str, u8) -> Vec<String>,
    /// Arguments for the constraints file, [`Pinout::file`](crate::Pinout::file) or [`MeasurementDevice::pins`].
    pub pins: &'static [&'static str],
    /// Cells of nextpnr's report that are LUTs, flip-flops, multipliers and block RAMs; `None` if these are counted in yosys' netlist.
    pub used: Option<[&'static str; 4]>,
    /// Suffixes that yosys and nextpnr append to names of the source; a suffix extends to the end of a name.
    pub suffixes: &'static [&'static str],
    /// Ports without a given pin are placed at any free pin.
    pub places_any_pin: bool,
    /// Arguments that weigh timing in the placement, for boards and for measurements.
    pub timing: &'static [&'static str],
    /// Factor between nextpnr's clocks and those that may be relied on: 1 unless its delays of the family are too short.
    pub margin: f64,
    /// Device on which cores are measured.
    pub measured: &'static MeasurementDevice,
}

/// Device on which cores are measured.
#[derive(Clone, Copy, Debug)]
pub struct MeasurementDevice {
    /// Name of the device.
    pub part: &'static str,
    /// Package of the device.
    pub package: &'static str,
    /// Speed grade of the device.
    pub grade: u8,
    /// File with the places of a core's pins `clk`, `rst`, `serial_in` and `serial_out`. Without fixed places, the placer takes ten times
    /// as long.
    pub pins: File,
    /// Further arguments of place and route.
    pub options: &'static [&'static str],
    /// Units that were counted but not placed alone: name; LUTs, flip-flops and multipliers.
    pub units: &'static [(&'static str, [u64; 3])],
    /// LUTs, and flip-flops, of an output port, a counted loop, an entry of the return stack, and a bit of the address of a memory or a bank:
    /// differences between machines that were synthesised with more and fewer of them.
    pub parts: [[f64; 4]; 2],
}

/// Packing of a placed design into a bitstream.
#[derive(Clone, Copy, Debug)]
pub struct Pack {
    /// Arguments of place and route that write the placed design. A file stands at the end of an argument.
    pub placed: &'static [&'static str],
    /// File of the placed design; [`ROUTED`] if it is the netlist.
    pub from: &'static str,
    /// Program that packs it; the package of place and route installs it.
    pub program: &'static str,
    /// Arguments of the packing program for a device.
    pub arguments: fn(&Part) -> Vec<&'static str>,
    /// File of the bitstream.
    pub bitstream: &'static str,
}

/// Models of a family's cells in Verilog.
#[derive(Clone, Copy, Debug)]
pub struct Models {
    /// Models of the cells for which yosys' library has no behaviour; `None` if it has all.
    pub cells: Option<File>,
    /// Files of yosys' library that a routed netlist needs.
    pub library: &'static [YosysFile],
    /// Adapts the cells of a routed netlist to the models.
    pub mend: fn(&mut Map<String, Value>),
    /// Replaces the tables of a routed netlist by yosys' own cells, which yosys writes as expressions.
    pub tables: fn(Map<String, Value>) -> Map<String, Value>,
    /// Truth table, as a text of bits, of a cell of a routed netlist that is plain logic: a place to plant a fault. `None` for other
    /// cells.
    pub truth_table: for<'a> fn(&'a mut Value) -> Option<&'a mut Value>,
    /// Table of a mapped netlist.
    pub mapped_table: MappedTable,
    /// Files of yosys' library that a mapped netlist needs, by their paths there.
    pub mapped_library: &'static [&'static str],
    /// Proof that a mapped netlist equals the design; `None` if none is stated for the family.
    pub equality: Option<Equality>,
}

impl Models {
    /// The models, if the feature `netlist` is on; without it nothing refers to them.
    pub(crate) const fn if_wanted(self) -> Option<Models> {
        if cfg!(feature = "netlist") { Some(self) } else { None }
    }
}

/// yosys' commands after which `flatten` leaves no module, in a circuit that keeps some for the sake of its mapping.
pub const UNKEPT: &str = "setattr -mod -unset keep_hierarchy; setattr -unset keep_hierarchy t:*";

/// Proof that a mapped netlist equals the design, without the cells for which both have the same.
#[derive(Clone, Copy, Debug)]
pub struct Equality {
    /// yosys' commands that map the memories, and nothing else, of the designs read so far, given the top module.
    pub memories: fn(&str) -> String,
    /// Cells that are cut out of both netlists: memories and multipliers.
    pub cut: &'static [&'static str],
    /// Cells among them, or their pins as `CELL.PIN`, that outputs do not follow before the next edge of the clock.
    pub clocked: &'static [&'static str],
}

/// Look-up table of four inputs, as yosys maps to it.
#[derive(Clone, Copy, Debug)]
pub struct MappedTable {
    /// Cell of yosys' netlist.
    pub cell: &'static str,
    /// Inputs; the first is the lowest bit of the address.
    pub inputs: [&'static str; 4],
    /// Output.
    pub output: &'static str,
    /// Parameter with the contents.
    pub contents: &'static str,
}

impl MappedTable {
    /// Verilog for yosys' `techmap` that turns the table into yosys' own cell.
    pub fn techmap(&self) -> String {
        let MappedTable { cell, inputs: [a, b, c, d], output, contents } = self;
        format!(
            "module {cell} (input {a}, {b}, {c}, {d}, output {output});
    parameter [15:0] {contents} = 16'd0;
    \\$lut #(.WIDTH(4), .LUT({contents})) table4 (.A({{{d}, {c}, {b}, {a}}}), .Y({output}));
endmodule
"
        )
    }
}

/// A file of yosys' library.
#[derive(Clone, Copy, Debug)]
pub struct YosysFile {
    /// Path in the library.
    pub path: &'static str,
    /// Name in the simulation.
    pub name: &'static str,
    /// Corrects the file's text.
    pub mend: fn(&str) -> String,
}

/// Comparison of a family's register bank with the general one after synthesis.
#[derive(Clone, Copy, Debug)]
pub struct Proof {
    /// yosys' synthesis, without the top module.
    pub synthesis: &'static str,
    /// Nets on the pins of the only block RAM in a netlist of `takt_bank`, in a form that is equal for equal banks.
    pub pins: fn(&Value) -> Result<BTreeMap<String, String>, String>,
}
