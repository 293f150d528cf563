// SPDX-License-Identifier: MIT OR Apache-2.0
//! Adapts nextpnr's netlist to the models of its cells: open pins are tied, tables become expressions.

use crate::netlist::{cell, highest_net};
use serde_json::{Map, Value, json};

/// Corrects a file of yosys' library that assigns a cell's carry to a new wire, which nothing reads, instead of to its output.
pub(super) fn library(text: &str) -> String {
    text.replace("wire FCO = (", "assign FCO = (")
}

/// Adapts the cells of a routed netlist to their models.
pub(super) fn mend(cells: &mut Map<String, Value>) {
    // The placeholder of a memory's write port has no logic of its own.
    cells.retain(|_, cell| cell["parameters"]["MODE"] != "RAMW_BLOCK");
    cells.values_mut().for_each(mend_cell);
}

/// Truth table of a cell that is plain logic; `None` for other cells.
pub(super) fn truth_table(cell: &mut Value) -> Option<&mut Value> {
    let is_logic = cell["type"] == "TRELLIS_COMB" && cell["parameters"]["MODE"].is_null();
    is_logic.then(|| &mut cell["parameters"]["INITVAL"])
}

/// Adapts a cell of nextpnr to its model: removes pins without a net, and ties those that the model needs.
fn mend_cell(cell: &mut Value) {
    let pins = cell["connections"].as_object_mut().map(|pins| {
        let open: Vec<String> =
            pins.iter().filter(|(_, net)| net[0].is_null()).map(|(pin, _)| pin.clone()).collect();
        pins.retain(|_, net| !net[0].is_null());
        open
    });
    let is_open = |pin: &str| pins.iter().flatten().any(|open| open == pin);
    let kind = cell["type"].as_str().unwrap_or_default().to_owned();
    match kind.as_str() {
        // The PLL's stand-in in simulation has no parameters.
        "EHXPLLL" => cell["parameters"] = json!({}),
        "TRELLIS_IO" => buffer(cell),
        "TRELLIS_FF" => {
            // A datum that does not come from the adjacent table is at pin M.
            if take(cell, "SD").is_none_or(|direct| direct == "0")
                && let Some(pins) = cell["connections"].as_object_mut()
                && let Some(datum) = pins.remove("M")
            {
                tie(cell, "DI", datum);
            }
            // Without a net, set and reset are inactive and the clock enable is active.
            for (pin, level) in [("LSR", "0"), ("CE", "1")] {
                if cell["connections"][pin].is_null() {
                    tie(cell, pin, json!([level]));
                }
            }
        }
        // Open inputs of a table are high; carry chains rely on it.
        "TRELLIS_COMB" => {
            take(cell, "WCKMUX");
            for pin in ["A", "B", "C", "D"] {
                if is_open(pin) {
                    tie(cell, pin, json!(["1"]));
                }
            }
        }
        // Open inputs are high here, too, unless a parameter of the pin's multiplexer says otherwise: `CEAMUX` is 0, 1, INV, or CEA for
        // the pin itself.
        "DP16KD" | "MULT18X18D" => {
            let parameters: Vec<String> =
                cell["parameters"].as_object().into_iter().flatten().map(|(name, _)| name.clone()).collect();
            for (name, pin) in parameters.iter().filter_map(|name| Some((name, name.strip_suffix("MUX")?))) {
                let connected = !cell["connections"][pin].is_null();
                match take(cell, name).as_deref() {
                    Some(level @ ("0" | "1")) => tie(cell, pin, json!([level])),
                    Some("INV") if !connected => tie(cell, pin, json!(["0"])),
                    // No model supports an inverted pin: Verilator reports the parameter.
                    Some("INV") => cell["parameters"][name] = json!("INV"),
                    _ if !connected => tie(cell, pin, json!(["1"])),
                    _ => {}
                }
            }
        }
        _ => {}
    }
}

/// Replaces tables, carries and multiplexers of a design by yosys' own cells, which yosys writes as expressions. (As instances of the
/// library's model, each table would be a separate module: Verilator takes minutes for thousands of these.)
pub(super) fn tables(cells: Map<String, Value>) -> Map<String, Value> {
    let mut free = highest_net(&cells);
    let mut found = Map::new();
    for (name, mut of) in cells {
        if of["type"] != "TRELLIS_COMB" || of["parameters"]["MODE"] == "DPRAM" {
            found.insert(name, of);
            continue;
        }
        let is_carry = take(&mut of, "MODE").is_some_and(|mode| mode == "CCU2");
        let injects = take(&mut of, "CCU2_INJECT1").is_some_and(|injects| injects == "YES");
        // A multiplexer of multiplexers, for a table of six inputs or more; otherwise a multiplexer of two tables.
        let is_wide = ["FXA", "FXB"].iter().any(|pin| !of["connections"][pin].is_null());
        let table = format!("{:0>16}", take(&mut of, "INITVAL").unwrap_or_default());
        let pin = |name: &str| match &of["connections"][name] {
            Value::Null => json!("0"),
            net => net[0].clone(),
        };
        let mut put = |what: &str, kind: &str, parameters: Value, inputs: Value, output: &Value| {
            let of = cell(kind, parameters, inputs, json!({ "Y": [output] }));
            found.insert(format!("{name}{what}"), of);
        };
        // The design's net at a pin, or a new net.
        let mut net = |name: Option<&str>| match name.map(|name| &of["connections"][name]) {
            Some(Value::Array(net)) => net[0].clone(),
            _ => {
                free += 1;
                json!(free)
            }
        };
        let lut =
            |width: usize| json!({ "WIDTH": format!("{width:032b}"), "LUT": table.get(16 - (1 << width)..) });
        let inputs = [pin("A"), pin("B"), pin("C"), pin("D")];
        let sum = is_carry && !injects;
        let value = net(Some("F").filter(|_| !sum));
        put("", "$lut", lut(4), json!({ "A": inputs }), &value);
        let mut f = value.clone();
        if sum {
            f = net(Some("F"));
            put("$sum", "$_XOR_", json!({}), json!({ "A": [value], "B": [pin("FCI")] }), &f);
        }
        if is_carry && of["connections"].get("FCO").is_some() {
            let mut generated = json!("0");
            if sum {
                generated = net(None);
                put("$generated", "$lut", lut(2), json!({ "A": inputs[..2] }), &generated);
            }
            let carry = json!({ "A": [generated], "B": [pin("FCI")], "S": [value] });
            put("$carry", "$_MUX_", json!({}), carry, &pin("FCO"));
        }
        if of["connections"].get("OFX").is_some() {
            let (a, b) = if is_wide { (pin("FXA"), pin("FXB")) } else { (f, pin("F1")) };
            put("$wide", "$_MUX_", json!({}), json!({ "A": [a], "B": [b], "S": [pin("M")] }), &pin("OFX"));
        }
    }
    found
}

/// Removes a parameter from a cell and returns its text. (A text that could be read as bits ends with a space.)
fn take(cell: &mut Value, name: &str) -> Option<String> {
    let value = cell["parameters"].as_object_mut()?.remove(name)?;
    value.as_str().map(|text| text.trim().to_owned())
}

fn tie(cell: &mut Value, pin: &str, net: Value) {
    cell["connections"][pin] = net;
    cell["port_directions"][pin] = json!("input");
}

/// Replaces a pin of the device by a buffer: the tristate model would drive a port of the top from both sides.
fn buffer(of: &mut Value) {
    let (from, to) = match take(of, "DIR").as_deref() {
        Some("INPUT") => ("B", "O"),
        Some("OUTPUT") => ("I", "B"),
        // Boards have no bidirectional pins.
        _ => return,
    };
    let [from, to] = [from, to].map(|pin| of["connections"][pin].clone());
    *of = cell("$_BUF_", json!({}), json!({ "A": from }), json!({ "Y": to }));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mended(kind: &str, parameters: Value, connections: Value) -> (Value, Value) {
        let mut cell = json!({ "type": kind, "parameters": parameters, "connections": connections, "port_directions": {} });
        mend_cell(&mut cell);
        (cell["parameters"].take(), cell["connections"].take())
    }

    #[test]
    fn pins_without_a_net_have_the_devices_default() {
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
            assert_eq!(flip_flop, (json!({}), json!({ "CE": ["1"], "DI": [7], "LSR": ["0"] })));
        }
    }

    #[test]
    fn the_carry_is_assigned_to_the_cells_pin() {
        let text = "wire FCO = (~l4o & gated_lut2_0) | (l4o & FCI);";
        assert!(library(text).starts_with("assign FCO = ("));
    }
}
