// SPDX-License-Identifier: MIT OR Apache-2.0
//! Figures from the tools' reports.

use crate::place::PlaceError;
use serde_json::Value;
use takt_family::{Family, Resources};

/// Resources of a design: the total less the wrapper's share.
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

/// Clock in MHz that nextpnr's report states.
///
/// # Errors
/// If the report states no clock.
pub fn clock(report: &Value) -> Result<f64, PlaceError> {
    let clocks = report["fmax"].as_object().ok_or_else(|| lacking("clock"))?;
    let achieved = clocks.values().filter_map(|clock| clock["achieved"].as_f64());
    achieved.reduce(f64::min).ok_or_else(|| lacking("clock"))
}

/// Resources of a design: from nextpnr's report, if it is given and the family's reports count resources, otherwise from yosys'
/// statistics. Carry chains are always counted by yosys.
///
/// # Errors
/// If nextpnr's report lacks one of them.
pub fn resources(
    family: &Family,
    statistics: &Value,
    report: Option<&Value>,
) -> Result<Resources, PlaceError> {
    let counted = family.cells.resources(statistics);
    let placed = report.zip(family.place.as_ref().and_then(|place| place.used));
    let Some((report, [luts, flip_flops, multipliers, block_rams])) = placed else { return Ok(counted) };
    let used = |cell: &str| report["utilization"][cell]["used"].as_u64().ok_or_else(|| lacking(cell));
    Ok(Resources {
        luts: used(luts)?,
        carries: counted.carries,
        flip_flops: used(flip_flops)?,
        multipliers: used(multipliers)?,
        block_rams: used(block_rams)?,
    })
}

/// Longest path from register to register, as text: its time, the signals on it that have a name in the source, and the cells that it
/// passes through.
pub fn critical_path(report: &Value, family: &Family) -> Option<String> {
    let ports = family.carry.map_or(&[][..], |carry| carry.ports);
    let suffixes = family.place.as_ref()?.suffixes;
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
            let carries = |end: &Value| end["port"].as_str().is_some_and(|port| ports.contains(&port));
            chains += u32::from(!carries(from) && carries(to));
            levels += u32::from(!carries(from) && !carries(to));
        }
        let last = index + 1 == steps.len();
        let cell =
            if last { to["cell"].as_str()? } else { step["net"].as_str().unwrap_or(from["cell"].as_str()?) };
        let name = signal(cell, suffixes);
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

/// Total time of the steps of these kinds, ns.
fn total(steps: &[Value], kinds: &[&str]) -> f64 {
    let some = steps.iter().filter(|step| step["type"].as_str().is_some_and(|kind| kinds.contains(&kind)));
    some.filter_map(|step| step["delay"].as_f64()).sum()
}

/// Name of a net or cell in the source, without the suffixes of yosys and nextpnr.
fn signal(name: &str, suffixes: &[&str]) -> String {
    let end = suffixes.iter().filter_map(|suffix| name.find(suffix)).min().unwrap_or(name.len());
    let name = &name[..end];
    name.split('[').next().unwrap_or(name).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use takt_family::REFERENCE;

    #[test]
    fn names_equal_the_sources() {
        let suffixes = ["_LUT", "_CARRY", "_FF", "$"];
        assert_eq!(signal("unit.rest_FF_Q_12_D_LUT4_Z", &suffixes), "unit.rest");
        assert_eq!(signal("core.bank[12]", &suffixes), "core.bank");
        assert_eq!(signal("unit.less_2_CARRY_A0_S1$COMB1", &suffixes), "unit.less_2");
    }

    #[test]
    fn path_in_words() {
        let [carry, flip_flop] = [REFERENCE.cells.carries[0].0, REFERENCE.cells.flip_flops[0].0];
        let [into, out] =
            [REFERENCE.carry.expect("a chain").ports[0], REFERENCE.carry.expect("a chain").ports[1]];
        let (x, y, sum) = (format!("x_{flip_flop}_Q"), format!("y_{flip_flop}_Q"), format!("sum_{carry}"));
        let end = |cell: &str, port: &str| json!({"cell": cell, "port": port});
        let step = |kind: &str, delay: f64, from: Value, to: Value| json!({"type": kind, "delay": delay, "from": from, "to": to});
        let mut wire = step("routing", 1.0, end(&x, "Q"), end(&sum, "A"));
        wire["net"] = json!("x[3]");
        let steps = json!([
            step("clk-to-q", 0.5, end(&x, "Q"), end(&x, "Q")),
            wire,
            step("logic", 0.25, end(&sum, "A"), end(&sum, out)),
            step("logic", 0.25, end(&sum, into), end(&sum, "F")),
            step("logic", 0.5, end("y_LUT4_Z", "A"), end("y_LUT4_Z", "F")),
            step("setup", 0.0, end(&y, "DI"), end(&y, "DI")),
        ]);
        let report = json!({"critical_paths": [
            {"from": "<async>", "to": "posedge clk", "path": [step("routing", 99.0, end("p", "O"), end("x", "A"))]},
            {"from": "posedge clk", "to": "posedge clk", "path": steps},
        ]});
        assert_eq!(
            critical_path(&report, REFERENCE).as_deref(),
            Some("2.5 ns, 1.0 of them routing, logic levels 1, carry chains 1: x → sum → y")
        );
    }
}
