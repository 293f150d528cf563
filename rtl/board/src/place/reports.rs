// SPDX-License-Identifier: MIT OR Apache-2.0
//! The tools' reports.

use crate::place::PlaceError;
use serde_json::Value;
use takt_rtl::synthesis::Resources;

/// The resources of a design, from those of it in its wrapper.
pub fn less(all: Resources, wrapper: Resources) -> Resources {
    Resources {
        luts: all.luts.saturating_sub(wrapper.luts),
        flip_flops: all.flip_flops.saturating_sub(wrapper.flip_flops),
        ..all
    }
}

fn lacking(what: &str) -> PlaceError {
    PlaceError::Report(format!("nextpnr's report has no {what}"))
}

/// The clock in MHz that a report of nextpnr states.
///
/// # Errors
/// If it states none.
pub fn clock(report: &Value) -> Result<f64, PlaceError> {
    let clocks = report["fmax"].as_object().ok_or_else(|| lacking("clock"))?;
    let achieved = clocks.values().filter_map(|clock| clock["achieved"].as_f64());
    achieved.reduce(f64::min).ok_or_else(|| lacking("clock"))
}

/// The resources that nextpnr counts.
///
/// # Errors
/// If it counts one of them not.
pub fn ecp5(report: &Value) -> Result<Resources, PlaceError> {
    let used = |cell: &str| report["utilization"][cell]["used"].as_u64().ok_or_else(|| lacking(cell));
    Ok(Resources {
        luts: used("TRELLIS_COMB")?,
        carries: None,
        flip_flops: used("TRELLIS_FF")?,
        multipliers: used("MULT18X18D")?,
        block_rams: used("DP16KD")?,
    })
}

/// Halves of carry chains' cells, each of which takes the place of a LUT4; from yosys' statistics.
pub fn halves_of_carries(statistics: &Value) -> u64 {
    2 * statistics["design"]["num_cells_by_type"]["CCU2C"].as_u64().unwrap_or(0)
}

/// The longest path from register to register, in words: its time, the signals on it that have a name in the source, and
/// what it passes through.
pub fn critical_path(report: &Value) -> Option<String> {
    let paths = report["critical_paths"].as_array()?;
    let steps = paths
        .iter()
        .filter(|path| path["from"] == path["to"])
        .filter_map(|path| path["path"].as_array())
        .max_by(|a, b| {
            total(a, &["clk-to-q", "logic", "routing", "setup"])
                .total_cmp(&total(b, &["clk-to-q", "logic", "routing", "setup"]))
        })?;
    let mut names: Vec<String> = Vec::new();
    let (mut levels, mut chains) = (0, 0);
    for (index, step) in steps.iter().enumerate() {
        let (from, to) = (&step["from"], &step["to"]);
        if step["type"] == "logic" {
            let carries = |end: &Value| matches!(end["port"].as_str(), Some("FCI" | "FCO"));
            chains += u32::from(!carries(from) && carries(to));
            levels += u32::from(!carries(from) && !carries(to));
        }
        let last = index + 1 == steps.len();
        let cell =
            if last { to["cell"].as_str()? } else { step["net"].as_str().unwrap_or(from["cell"].as_str()?) };
        let name = signal(cell);
        if names.last() != Some(&name) {
            names.push(name);
        }
    }
    Some(format!(
        "{:.1} ns, {:.1} of them routing, logic levels {levels}, carry chains {chains}: {}",
        total(steps, &["clk-to-q", "logic", "routing", "setup"]),
        total(steps, &["routing"]),
        names.join(" → ")
    ))
}

/// Nanoseconds of the steps of some kinds.
fn total(steps: &[Value], kinds: &[&str]) -> f64 {
    let some = steps.iter().filter(|step| step["type"].as_str().is_some_and(|kind| kinds.contains(&kind)));
    some.filter_map(|step| step["delay"].as_f64()).sum()
}

/// The name that a net or cell has in the source: without what yosys and nextpnr append.
fn signal(name: &str) -> String {
    let cut = ["_LUT4", "_CCU2C", "_TRELLIS", "_PFUMX", "_L6MUX", "_DPR16X4", "_DI", "_MULT18", "$"];
    let end = cut.iter().filter_map(|suffix| name.find(suffix)).min().unwrap_or(name.len());
    let name = &name[..end];
    name.split('[').next().unwrap_or(name).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn names_are_those_of_the_source() {
        assert_eq!(signal("unit.rest_TRELLIS_FF_Q_12_DI_LUT4_Z"), "unit.rest");
        assert_eq!(signal("core.bank[12]"), "core.bank");
        assert_eq!(signal("unit.less_2_CCU2C_A0_S1$CCU2_COMB1"), "unit.less_2");
    }

    #[test]
    fn path_in_words() {
        let end = |cell: &str, port: &str| json!({"cell": cell, "port": port});
        let step = |kind: &str, delay: f64, from: Value, to: Value| json!({"type": kind, "delay": delay, "from": from, "to": to});
        let mut wire = step("routing", 1.0, end("x_TRELLIS_FF_Q", "Q"), end("sum_CCU2C", "A"));
        wire["net"] = json!("x[3]");
        let steps = json!([
            step("clk-to-q", 0.5, end("x_TRELLIS_FF_Q", "Q"), end("x_TRELLIS_FF_Q", "Q")),
            wire,
            step("logic", 0.25, end("sum_CCU2C", "A"), end("sum_CCU2C", "FCO")),
            step("logic", 0.25, end("sum_CCU2C", "FCI"), end("sum_CCU2C", "F")),
            step("logic", 0.5, end("y_LUT4_Z", "A"), end("y_LUT4_Z", "F")),
            step("setup", 0.0, end("y_TRELLIS_FF_Q", "DI"), end("y_TRELLIS_FF_Q", "DI")),
        ]);
        let report = json!({"critical_paths": [
            {"from": "<async>", "to": "posedge clk", "path": [step("routing", 99.0, end("p", "O"), end("x", "A"))]},
            {"from": "posedge clk", "to": "posedge clk", "path": steps},
        ]});
        assert_eq!(
            critical_path(&report).as_deref(),
            Some("2.5 ns, 1.0 of them routing, logic levels 1, carry chains 1: x → sum → y")
        );
    }
}
