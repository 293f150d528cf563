// SPDX-License-Identifier: MIT OR Apache-2.0
//! Adapts nextpnr's netlist to the models of its cells: pins of words come together again, tables and carry chains become yosys' cells.

use crate::netlist::{cell, highest_net};
use serde_json::{Map, Value, json};

/// Renames the library's PLL, which has no behaviour: the stand-in has its name.
pub(super) fn library(text: &str) -> String {
    text.replace("module rPLL (", "module rPLL_without_behaviour (")
}

/// Adapts the cells of a routed netlist to their models, but for the tables, in which faults can be planted.
pub(super) fn mend(cells: &mut Map<String, Value>) {
    for of in cells.values_mut() {
        match of["type"].as_str().unwrap_or_default() {
            "IBUF" | "OBUF" => *of = buffer(pin(of, "I"), pin(of, "O")),
            "GOWIN_GND" => *of = buffer(json!("0"), pin(of, "G")),
            "GOWIN_VCC" => *of = buffer(json!("1"), pin(of, "V")),
            "SDP" => block_ram(of),
            "MULT18X18" => multiplier(of),
            "RAM16SDP4" => {
                let _ = of["connections"].as_object_mut().and_then(|pins| pins.remove("CE"));
            }
            "rPLL" => pll(of),
            // The device's reset acts before the design begins; a placeholder has no logic.
            "GSR" | "DUMMY_CELL" => *of = Value::Null,
            _ => {}
        }
    }
    cells.retain(|_, of| !of.is_null());
}

/// Truth table of a cell that is plain logic; `None` for other cells.
pub(super) fn truth_table(cell: &mut Value) -> Option<&mut Value> {
    table_inputs(cell).map(|_| &mut cell["parameters"]["INIT"])
}

/// Number of inputs of a table; `None` for other cells.
fn table_inputs(cell: &Value) -> Option<usize> {
    let kind = cell["type"].as_str()?;
    kind.strip_prefix("LUT")?.parse().ok()
}

/// Net at a pin; `None` for an open pin.
fn net(of: &Value, pin: &str) -> Option<Value> {
    of["connections"][pin].get(0).cloned()
}

/// Net at a pin, 0 if the pin is open.
fn pin(of: &Value, pin: &str) -> Value {
    net(of, pin).unwrap_or_else(|| json!("0"))
}

/// Nets at the pins `NAME0` to `NAME{bits - 1}`, open ones at a level.
fn word(of: &Value, name: &str, bits: usize, level: &str) -> Value {
    (0..bits).map(|bit| net(of, &format!("{name}{bit}")).unwrap_or_else(|| json!(level))).collect()
}

fn buffer(from: Value, to: Value) -> Value {
    cell("$_BUF_", json!({}), json!({ "A": [from] }), json!({ "Y": [to] }))
}

/// Block RAM with a port to write and one to read; contents that the design leaves open are 0.
fn block_ram(of: &mut Value) {
    let mut parameters = of["parameters"].as_object().cloned().unwrap_or_default();
    for value in parameters.values_mut() {
        *value = json!(value.as_str().unwrap_or_default().replace('x', "0"));
    }
    let mut inputs = json!({
        "ADA": word(of, "ADA", 14, "0"), "ADB": word(of, "ADB", 14, "0"), "DI": word(of, "DI", 36, "0"),
        "BLKSELA": word(of, "BLKSELA", 3, "0"), "BLKSELB": word(of, "BLKSELB", 3, "0"),
    });
    for name in ["CLKA", "CEA", "CLKB", "CEB", "OCE", "RESETA", "RESETB"] {
        inputs[name] = json!([pin(of, name)]);
    }
    // Ports of other widths have another cell, of which there is no model.
    let is_modelled = ["BIT_WIDTH_0", "BIT_WIDTH_1"].iter().all(|name| {
        let width = parameters.get(*name).and_then(Value::as_str).map(|text| u32::from_str_radix(text, 2));
        matches!(width, Some(Ok(9 | 18 | 36)))
    });
    let kind = if is_modelled { "SDPX9B" } else { "SDPB" };
    *of = cell(kind, Value::Object(parameters), inputs, json!({ "DO": word(of, "DO", 36, "x") }));
}

fn multiplier(of: &mut Value) {
    let inputs = json!({
        "A": word(of, "A", 18, "0"), "B": word(of, "B", 18, "0"),
        "ASIGN": [pin(of, "ASIGN")], "BSIGN": [pin(of, "BSIGN")],
    });
    *of = cell("MULT18X18", json!({}), inputs, json!({ "DOUT": word(of, "DOUT", 36, "x") }));
}

/// The PLL, whose stand-in in simulation passes the clock on.
fn pll(of: &mut Value) {
    let inputs = json!({ "CLKIN": [pin(of, "CLKIN")] });
    let mut outputs = json!({});
    for name in ["CLKOUT", "LOCK"] {
        if let Some(net) = net(of, name) {
            outputs[name] = json!([net]);
        }
    }
    *of = cell("rPLL", json!({}), inputs, outputs);
}

/// Replaces tables, multiplexers and carry chains of a design by yosys' own cells.
pub(super) fn tables(cells: Map<String, Value>) -> Map<String, Value> {
    let mut free = highest_net(&cells);
    let mut found = Map::new();
    for (name, mut of) in cells {
        for (_, net) in of["connections"].as_object_mut().into_iter().flatten() {
            for bit in net.as_array_mut().into_iter().flatten().filter(|bit| *bit == "x") {
                free += 1;
                *bit = json!(free);
            }
        }
        let kind = of["type"].as_str().unwrap_or_default();
        if let Some(width) = table_inputs(&of) {
            // A carry chain took the place of a table that nothing reads.
            let Some(output) = net(&of, "F") else { continue };
            let inputs = (0..width).map(|i| pin(&of, &format!("I{i}"))).collect();
            let table = of["parameters"]["INIT"].as_str().unwrap_or_default();
            found.insert(name, lut(inputs, table, output));
        } else if kind.starts_with("MUX2_LUT") {
            let inputs = json!({ "A": [pin(&of, "I0")], "B": [pin(&of, "I1")], "S": [pin(&of, "S0")] });
            found.insert(name, cell("$_MUX_", json!({}), inputs, json!({ "Y": [pin(&of, "O")] })));
        } else if kind == "ALU" {
            sum(&name, &of, &mut free, &mut found);
        } else {
            found.insert(name, of);
        }
    }
    found
}

/// Table of yosys; of the text, as many bits count as the inputs need.
fn lut(inputs: Vec<Value>, table: &str, output: Value) -> Value {
    let (width, bits) = (inputs.len(), 1 << inputs.len());
    let table = format!("{table:0>bits$}");
    let parameters = json!({ "WIDTH": format!("{width:032b}"), "LUT": table[table.len() - bits..] });
    cell("$lut", parameters, json!({ "A": inputs }), json!({ "Y": [output] }))
}

/// One place of a carry chain. Its table of four inputs says whether the carry passes, and the first quarter of it, of which two inputs
/// choose, is the carry otherwise.
fn sum(name: &str, of: &Value, free: &mut u64, found: &mut Map<String, Value>) {
    let mode = of["parameters"]["ALU_MODE"].as_str().unwrap_or_default();
    let table = of["parameters"]["RAW_ALU_LUT"].as_str().or_else(|| alu_table(mode)).unwrap_or_default();
    let table = format!("{table:0>16}");
    let table = &table[table.len() - 16..];
    let mut new = || {
        *free += 1;
        json!(*free)
    };
    let (passes, otherwise) = (new(), new());
    let [a, b, c, d] = ["I0", "I1", "I2", "I3"].map(|name| pin(of, name));
    let carried = pin(of, "CIN");
    found.insert(format!("{name}$passes"), lut(vec![a.clone(), b.clone(), c, d], table, passes.clone()));
    found.insert(format!("{name}$otherwise"), lut(vec![a, b], &table[12..], otherwise.clone()));
    if let Some(sum) = net(of, "SUM") {
        found.insert(format!("{name}$sum"), lut(vec![passes.clone(), carried.clone()], "0110", sum));
    }
    if let Some(carry) = net(of, "COUT") {
        let inputs = json!({ "A": [otherwise], "B": [carried], "S": [passes] });
        found.insert(format!("{name}$carry"), cell("$_MUX_", json!({}), inputs, json!({ "Y": [carry] })));
    }
}

/// Table of a mode of the carry chain's place, as Project Apicula writes it into the bitstream (`chipdb.py`); a number is binary.
fn alu_table(mode: &str) -> Option<&'static str> {
    let number = u32::from_str_radix(mode, 2).map_err(|_| ());
    Some(match (mode, number) {
        // A carry into logic, or a 0 into a chain; a 1 into a chain.
        ("C2L", _) => "0000000000000000",
        ("ONE2C", _) => "0000000000001111",
        (_, Ok(0)) => "0110000001101010",
        (_, Ok(1)) => "1001000010011010",
        (_, Ok(2)) => "0110000010011010",
        (_, Ok(3)) => "1001000010011111",
        (_, Ok(4)) => "1001000010011010",
        (_, Ok(9)) => "0111100010001000",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(kind: &str, parameters: Value, connections: Value) -> Map<String, Value> {
        let cell = json!({ "type": kind, "parameters": parameters, "connections": connections, "port_directions": {} });
        let mut cells = [("c".to_owned(), cell)].into_iter().collect();
        mend(&mut cells);
        tables(cells)
    }

    /// Value of a table for inputs, the first of which is the lowest bit.
    fn value(table: &Value, inputs: usize) -> bool {
        let bits = table["parameters"]["LUT"].as_str().expect("a table");
        bits.as_bytes()[bits.len() - 1 - inputs] == b'1'
    }

    /// The modes that yosys uses have the sums and carries of the model in its library, for all inputs.
    #[test]
    fn carry_chains_add_and_subtract() {
        for mode in ["0", "1", "10", "11", "100", "1001"] {
            let pins =
                json!({ "I0": [2], "I1": [3], "I2": ["1"], "I3": [4], "CIN": [5], "SUM": [6], "COUT": [7] });
            let found = of("ALU", json!({ "ALU_MODE": mode }), pins);
            assert_eq!(found.len(), 4, "{mode}");
            for inputs in 0..8_usize {
                let [a, b, d] = [0, 1, 2].map(|bit| inputs >> bit & 1 == 1);
                let (passes, otherwise) = match mode {
                    "0" => (a ^ b, a),
                    "1" => (a ^ !b, a),
                    "10" => (if d { a ^ b } else { a ^ !b }, a),
                    "11" => (a ^ !b, true),
                    "100" => (a ^ !b, a),
                    _ => ((a & b) ^ d, a & b),
                };
                let at = usize::from(a) | usize::from(b) << 1 | 1 << 2 | usize::from(d) << 3;
                assert_eq!(value(&found["c$passes"], at), passes, "{mode} {inputs}");
                assert_eq!(value(&found["c$otherwise"], at & 3), otherwise, "{mode} {inputs}");
            }
            assert_eq!(found["c$sum"]["connections"]["Y"], json!([6]));
            assert_eq!(found["c$carry"]["connections"]["B"], json!([5]));
        }
    }

    #[test]
    fn words_come_together_and_open_pins_have_nets() {
        let found = of(
            "SDP",
            json!({ "BIT_WIDTH_0": "1001", "BIT_WIDTH_1": "100100", "INIT_RAM_00": "1x0" }),
            json!({ "ADA3": [2], "CLKA": [3], "DO1": [4], "DI0": [5] }),
        );
        let memory = &found["c"];
        assert_eq!(
            (&memory["type"], &memory["parameters"]["INIT_RAM_00"]),
            (&json!("SDPX9B"), &json!("100"))
        );
        assert_eq!(memory["connections"]["ADA"][3], json!(2));
        assert_eq!(
            (&memory["connections"]["DO"][1], &memory["connections"]["DO"][0]),
            (&json!(4), &json!(6))
        );
        let narrow = of("SDP", json!({ "BIT_WIDTH_0": "1001", "BIT_WIDTH_1": "10" }), json!({}));
        assert_eq!(narrow["c"]["type"], "SDPB", "a cell without a model");
        assert!(of("GSR", json!({}), json!({})).is_empty());
        let mux = of("MUX2_LUT5", json!({}), json!({ "I0": [2], "I1": [3], "S0": [4], "O": [5] }));
        assert_eq!(mux["c"]["connections"], json!({ "A": [2], "B": [3], "S": [4], "Y": [5] }));
        let table = of("LUT1", json!({ "INIT": "01" }), json!({ "I0": [2], "F": [3] }));
        assert!(value(&table["c"], 0) && !value(&table["c"], 1));
    }
}
