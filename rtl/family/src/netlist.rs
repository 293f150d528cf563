// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cells of a netlist in yosys' JSON format.

use serde_json::{Map, Value, json};

/// A cell, given its inputs and outputs.
pub(crate) fn cell(kind: &str, parameters: Value, inputs: Value, outputs: Value) -> Value {
    let mut directions = Map::new();
    let mut connections = Map::new();
    for (pins, direction) in [(inputs, "input"), (outputs, "output")] {
        for (pin, nets) in pins.as_object().into_iter().flatten() {
            directions.insert(pin.clone(), json!(direction));
            connections.insert(pin.clone(), nets.clone());
        }
    }
    json!({
        "hide_name": 1, "type": kind, "parameters": parameters, "attributes": {},
        "port_directions": directions, "connections": connections,
    })
}

/// Highest number of a net, above which numbers are free.
pub(crate) fn highest_net(cells: &Map<String, Value>) -> u64 {
    let nets = cells.values().flat_map(|cell| cell["connections"].as_object().into_iter().flatten());
    let bits = nets.flat_map(|(_, net)| net.as_array().into_iter().flatten()).filter_map(Value::as_u64);
    bits.max().unwrap_or(1)
}
