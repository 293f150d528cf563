// SPDX-License-Identifier: MIT OR Apache-2.0
//! Block RAM of a register bank in a yosys netlist, for the comparison of `takt_bank.v` with the general module.

use serde_json::Value;
use std::collections::BTreeMap;

/// Pins of a block RAM that together determine whether it writes: port A's enable, and the bytes of its word.
const WRITES: [&str; 5] = ["CEA", "ADA0", "ADA1", "ADA2", "ADA3"];

/// Net on each pin of the only block RAM in a netlist; for an output with an external register, the net after that register.
pub(super) fn pins(netlist: &Value) -> Result<BTreeMap<String, String>, String> {
    let module = &netlist["modules"]["takt_bank"];
    let lacking = |what: &str| format!("the netlist of takt_bank has no {what}");
    let cells: Vec<&Value> = module["cells"].as_object().ok_or_else(|| lacking("cells"))?.values().collect();
    let of_type = |kind: &str| cells.iter().copied().filter(|cell| cell["type"] == kind).collect::<Vec<_>>();
    let (rams, registers) = (of_type("DP16KD"), of_type("TRELLIS_FF"));
    let [ram] = rams[..] else { return Err(format!("a bank is {} block RAMs", rams.len())) };
    let mut names = BTreeMap::new();
    for (port, what) in module["ports"].as_object().ok_or_else(|| lacking("ports"))? {
        for (i, bit) in what["bits"].as_array().into_iter().flatten().enumerate() {
            names.insert(bit.to_string(), format!("{port}[{i}]"));
        }
    }
    let inside = ["REGMODE_A", "REGMODE_B"].map(|mode| ram["parameters"][mode] == "OUTREG");
    let behind = |bit: &Value| -> Option<&Value> {
        let register = registers.iter().find(|register| register["connections"]["DI"][0] == *bit)?;
        Some(&register["connections"]["Q"][0])
    };
    let (mut pins, mut writes) = (BTreeMap::new(), Vec::new());
    for (pin, bits) in ram["connections"].as_object().ok_or_else(|| lacking("pins of a block RAM"))? {
        let bit = &bits[0];
        let output = pin.starts_with("DO");
        let late =
            if output && !inside[usize::from(pin.starts_with("DOB"))] { behind(bit) } else { Some(bit) };
        let what = late.and_then(|bit| names.get(&bit.to_string()).cloned());
        if WRITES.contains(&pin.as_str()) {
            writes.extend(what);
        } else if let Some(what) = what {
            pins.insert(pin.clone(), what);
        } else if !output && !pin.starts_with("DI") && !pin.starts_with("OCE") {
            pins.insert(pin.clone(), bit.to_string());
        }
    }
    writes.dedup();
    pins.insert("writes".to_owned(), writes.join(" "));
    for width in ["DATA_WIDTH_A", "DATA_WIDTH_B", "CLKAMUX", "CLKBMUX", "CSDECODE_A", "CSDECODE_B"] {
        let value = &ram["parameters"][width];
        pins.insert(width.to_owned(), value.as_str().unwrap_or_default().trim_start_matches('0').to_owned());
    }
    Ok(pins)
}
