// SPDX-License-Identifier: MIT OR Apache-2.0
//! Adapts nextpnr's netlist to the models of its cells, which are those of yosys' library: packed cells become tables, flip-flops, block
//! RAMs and multipliers again.

use crate::netlist::{cell, highest_net};
use serde_json::{Map, Value, json};

/// Renames the library's PLL, which has no behaviour: the stand-in has its name. Ports have no values of their own, which Verilator does
/// not read: no pin is left open.
pub(super) fn library(text: &str) -> String {
    let text = text.replace("module SB_PLL40_PAD (", "module SB_PLL40_PAD_without_behaviour (");
    format!("`define NO_ICE40_DEFAULT_ASSIGNMENTS\n{text}")
}

/// Adapts the cells of a routed netlist to their models, but for the tables, in which faults can be planted.
pub(super) fn mend(cells: &mut Map<String, Value>) {
    pll(cells);
    for cell in cells.values_mut() {
        match cell["type"].as_str().unwrap_or_default() {
            "ICESTORM_RAM" => block_ram(cell),
            "ICESTORM_DSP" => multiplier(cell),
            "SB_GB" => *cell = buffer(cell, "USER_SIGNAL_TO_GLOBAL_BUFFER", "GLOBAL_BUFFER_OUTPUT"),
            "SB_IO" => pin(cell),
            _ => {}
        }
    }
    // A pin whose only use is the PLL has no buffer.
    cells.retain(|_, cell| !cell.is_null());
}

/// Truth table of a cell that is plain logic; `None` for other cells.
pub(super) fn truth_table(cell: &mut Value) -> Option<&mut Value> {
    let is_logic = cell["type"] == "ICESTORM_LC" && cell["parameters"]["CARRY_ENABLE"] == "0";
    is_logic.then(|| &mut cell["parameters"]["LUT_INIT"])
}

/// Net at a pin; `None` for an open pin.
fn net(cell: &Value, pin: &str) -> Option<Value> {
    cell["connections"][pin].get(0).cloned()
}

/// Net at a pin, or a level if the pin is open.
fn net_or(cell: &Value, pin: &str, level: &str) -> Value {
    net(cell, pin).unwrap_or_else(|| json!(level))
}

/// Nets at the pins `NAME_0` to `NAME_{bits - 1}`, open ones at a level.
fn vector(cell: &Value, name: &str, bits: usize, level: &str) -> Value {
    (0..bits).map(|bit| net_or(cell, &format!("{name}_{bit}"), level)).collect()
}

fn buffer(of: &Value, from: &str, to: &str) -> Value {
    match (net(of, from), net(of, to)) {
        (Some(from), Some(to)) => cell("$_BUF_", json!({}), json!({ "A": [from] }), json!({ "Y": [to] })),
        // The buffer of a PLL's output has no input of its own.
        _ => Value::Null,
    }
}

/// Pin of the device: boards have plain inputs and outputs.
fn pin(of: &mut Value) {
    *of = match net(of, "D_OUT_0") {
        Some(_) => buffer(of, "D_OUT_0", "PACKAGE_PIN"),
        None => buffer(of, "PACKAGE_PIN", "D_IN_0"),
    };
}

/// The PLL between its pin, which has the place that an attribute names, and the buffer of its output.
fn pll(cells: &mut Map<String, Value>) {
    let Some((name, own)) = cells.iter().find(|(_, cell)| cell["type"] == "ICESTORM_PLL") else { return };
    let (name, pad) = (name.clone(), own["attributes"]["BEL_PAD_INPUT"].clone());
    let locked = net(own, "LOCK");
    let at_pad = |cell: &&Value| cell["type"] == "SB_IO" && cell["attributes"]["NEXTPNR_BEL"] == pad;
    let input = cells.values().find(at_pad).and_then(|cell| net(cell, "PACKAGE_PIN"));
    let is_output =
        |cell: &&Value| cell["type"] == "SB_GB" && net(cell, "USER_SIGNAL_TO_GLOBAL_BUFFER").is_none();
    let output = cells.values().find(is_output).and_then(|cell| net(cell, "GLOBAL_BUFFER_OUTPUT"));
    let (Some(input), Some(output)) = (input, output) else { return };
    let inputs = json!({ "PACKAGEPIN": [input], "RESETB": ["1"], "BYPASS": ["0"] });
    let mut outputs = json!({ "PLLOUTGLOBAL": [output] });
    if let Some(locked) = locked {
        outputs["LOCK"] = json!([locked]);
    }
    cells.insert(name, cell("SB_PLL40_PAD", json!({}), inputs, outputs));
}

/// Block RAM of 4 kbit. Contents that the design leaves open are 0, as in the bitstream.
fn block_ram(of: &mut Value) {
    let mut parameters = of["parameters"].as_object().cloned().unwrap_or_default();
    let mut falls = |name: &str| parameters.remove(name).is_some_and(|value| value == "1");
    let edges = [falls("NEG_CLK_R"), falls("NEG_CLK_W")];
    for value in parameters.values_mut() {
        *value = json!(value.as_str().unwrap_or_default().replace('x', "0"));
    }
    let kind = match edges {
        [false, false] => "SB_RAM40_4K",
        [true, false] => "SB_RAM40_4KNR",
        [false, true] => "SB_RAM40_4KNW",
        [true, true] => "SB_RAM40_4KNRNW",
    };
    let clock = |name: &str, falls: bool| if falls { format!("{name}N") } else { name.to_owned() };
    let mut inputs = json!({
        "RCLKE": [net_or(of, "RCLKE", "1")], "RE": [net_or(of, "RE", "0")], "RADDR": vector(of, "RADDR", 11, "0"),
        "WCLKE": [net_or(of, "WCLKE", "1")], "WE": [net_or(of, "WE", "0")], "WADDR": vector(of, "WADDR", 11, "0"),
        "MASK": vector(of, "MASK", 16, "0"), "WDATA": vector(of, "WDATA", 16, "0"),
    });
    inputs[clock("RCLK", edges[0])] = json!([net_or(of, "RCLK", "0")]);
    inputs[clock("WCLK", edges[1])] = json!([net_or(of, "WCLK", "0")]);
    let outputs = json!({ "RDATA": vector(of, "RDATA", 16, "x") });
    *of = cell(kind, Value::Object(parameters), inputs, outputs);
}

/// Multiplier of 16 by 16 bits with its registers and adders.
fn multiplier(of: &mut Value) {
    let mut inputs = json!({ "CE": [net_or(of, "CE", "1")] });
    for name in ["A", "B", "C", "D"] {
        inputs[name] = vector(of, name, 16, "0");
    }
    for name in [
        "CLK",
        "AHOLD",
        "BHOLD",
        "CHOLD",
        "DHOLD",
        "IRSTTOP",
        "IRSTBOT",
        "ORSTTOP",
        "ORSTBOT",
        "OLOADTOP",
        "OLOADBOT",
        "ADDSUBTOP",
        "ADDSUBBOT",
        "OHOLDTOP",
        "OHOLDBOT",
        "CI",
        "ACCUMCI",
        "SIGNEXTIN",
    ] {
        inputs[name] = json!([net_or(of, name, "0")]);
    }
    let outputs = json!({ "O": vector(of, "O", 32, "x") });
    *of = cell("SB_MAC16", of["parameters"].clone(), inputs, outputs);
}

/// Replaces the logic cells of a design by yosys' own tables and gates, and the library's flip-flops.
pub(super) fn tables(cells: Map<String, Value>) -> Map<String, Value> {
    let mut free = highest_net(&cells);
    let mut found = Map::new();
    for (name, mut of) in cells {
        open_outputs(&mut of, &mut free);
        if of["type"] == "ICESTORM_LC" {
            logic_cell(&name, &of, &mut free, &mut found);
        } else {
            found.insert(name, of);
        }
    }
    found
}

/// Gives each open bit of an output a net that nothing reads.
fn open_outputs(of: &mut Value, free: &mut u64) {
    for (_, net) in of["connections"].as_object_mut().into_iter().flatten() {
        for bit in net.as_array_mut().into_iter().flatten().filter(|bit| *bit == "x") {
            *free += 1;
            *bit = json!(*free);
        }
    }
}

/// Table, carry and flip-flop of a logic cell.
fn logic_cell(name: &str, of: &Value, free: &mut u64, found: &mut Map<String, Value>) {
    let has = |parameter: &str| of["parameters"][parameter].as_str().is_some_and(|text| text.ends_with('1'));
    let inputs: Vec<Value> = ["I0", "I1", "I2", "I3"].map(|pin| net_or(of, pin, "0")).to_vec();
    if has("CARRY_ENABLE")
        && let Some(carry) = net(of, "COUT")
    {
        let constant = if has("CIN_SET") { "1" } else { "0" };
        let carried = if has("CIN_CONST") { json!(constant) } else { net_or(of, "CIN", "0") };
        let table = json!({ "WIDTH": format!("{:032b}", 3), "LUT": "11101000" });
        let majority = json!({ "A": [inputs[1], inputs[2], carried] });
        found.insert(format!("{name}$carry"), cell("$lut", table, majority, json!({ "Y": [carry] })));
    }
    let is_stored = has("DFF_ENABLE");
    let output = net(of, "O");
    if output.is_none() && net(of, "LO").is_none() {
        return;
    }
    let mut new = || {
        *free += 1;
        json!(*free)
    };
    let mut value = net(of, "LO");
    if !is_stored && let Some(output) = &output {
        value = Some(output.clone());
    }
    let value = value.unwrap_or_else(&mut new);
    let table = json!({
        "WIDTH": format!("{:032b}", 4),
        "LUT": format!("{:0>16}", of["parameters"]["LUT_INIT"].as_str().unwrap_or_default().trim()),
    });
    found.insert(name.to_owned(), cell("$lut", table, json!({ "A": inputs }), json!({ "Y": [value] })));
    let Some(output) = output.filter(|_| is_stored) else { return };
    let (mut kind, mut pins) = ("SB_DFF".to_owned(), json!({ "C": [net_or(of, "CLK", "0")], "D": [value] }));
    if has("NEG_CLK") {
        kind.push('N');
    }
    if let Some(enable) = net(of, "CEN") {
        kind.push('E');
        pins["E"] = json!([enable]);
    }
    if let Some(clear) = net(of, "SR") {
        if !has("ASYNC_SR") {
            kind.push('S');
        }
        let pin = if has("SET_NORESET") { "S" } else { "R" };
        kind.push_str(pin);
        pins[pin] = json!([clear]);
    }
    found.insert(format!("{name}$stored"), cell(&kind, json!({}), pins, json!({ "Q": [output] })));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn logic(parameters: Value, connections: Value) -> Map<String, Value> {
        let of = json!({ "type": "ICESTORM_LC", "parameters": parameters, "connections": connections });
        tables([("c".to_owned(), of)].into_iter().collect())
    }

    #[test]
    fn logic_cells_are_tables_carries_and_flip_flops() {
        let parameters = json!({
            "LUT_INIT": "0110100110010110", "CARRY_ENABLE": "1", "CIN_CONST": "0", "CIN_SET": "0", "DFF_ENABLE": "1",
            "SET_NORESET": "1", "ASYNC_SR": "0", "NEG_CLK": "0",
        });
        let pins = json!({
            "I0": [], "I1": [3], "I2": [4], "I3": [5], "CIN": [5], "COUT": [6], "O": [7], "LO": [], "CLK": [8], "CEN": [9],
            "SR": [10],
        });
        let found = logic(parameters, pins);
        assert_eq!(found["c$carry"]["connections"], json!({ "A": [3, 4, 5], "Y": [6] }));
        assert_eq!(found["c"]["connections"], json!({ "A": ["0", 3, 4, 5], "Y": [11] }));
        assert_eq!(found["c$stored"]["type"], "SB_DFFESS");
        let flip_flop = json!({ "C": [8], "D": [11], "E": [9], "S": [10], "Q": [7] });
        assert_eq!(found["c$stored"]["connections"], flip_flop);
    }

    #[test]
    fn open_contents_and_pins_have_the_devices_default() {
        let mut cells = Map::new();
        let pins = json!({ "RCLK": [2], "WCLK": [2], "RDATA_0": [3], "WADDR_1": [4] });
        let parameters = json!({ "INIT_0": "1x0", "READ_MODE": "01", "NEG_CLK_R": "0", "NEG_CLK_W": "1" });
        cells.insert(
            "m".to_owned(),
            json!({ "type": "ICESTORM_RAM", "parameters": parameters, "connections": pins }),
        );
        mend(&mut cells);
        let memory = &cells["m"];
        assert_eq!(memory["type"], "SB_RAM40_4KNW");
        assert_eq!(memory["parameters"], json!({ "INIT_0": "100", "READ_MODE": "01" }));
        let of = &memory["connections"];
        assert_eq!((&of["RCLK"], &of["WCLKN"], &of["RCLKE"]), (&json!([2]), &json!([2]), &json!(["1"])));
        assert_eq!(of["WADDR"][1], json!(4));
        assert_eq!(tables(cells)["m"]["connections"]["RDATA"][1], json!(5));
    }
}
