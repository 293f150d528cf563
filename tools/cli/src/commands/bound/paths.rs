// SPDX-License-Identifier: MIT OR Apache-2.0
//! Paths through a system, from a host command to the first response of an output.

use super::groups::{grouped, listed, microseconds};
use crate::terminal::files::Out;
use anyhow::{Result, anyhow};
use serde_json::{Value, json};
use std::io::Write;
use takt_analysis::Bounds;
use takt_system::Description;
use takt_system::latency::{Latency, latencies};

/// Latency bounds of all paths.
pub(crate) fn paths(description: &Description, bounds: &[Bounds]) -> Result<Vec<Latency>> {
    latencies(description, bounds).map_err(|error| anyhow!("no end-to-end bound: {error}"))
}

/// Deadline for a first response.
#[derive(Clone, Copy)]
pub(crate) struct Deadline {
    pub(super) cycles: u64,
    /// Assume that FIFOs are empty at the time of the command.
    pub(super) empty: bool,
}

impl Deadline {
    pub(super) fn meets_deadline(self, way: &Latency) -> Option<bool> {
        way.meets_deadline(self.cycles, self.empty)
    }
}

/// Bounds of a path, as JSON.
pub(crate) fn way_json(description: &Description, way: &Latency) -> Value {
    let links = |links: &[usize]| -> Vec<String> {
        links.iter().map(|link| description.links[*link].name.clone()).collect()
    };
    json!({
        "inputs": way.inputs,
        "outputs": way.outputs,
        "links": links(&way.links),
        "cores": way.cores.iter().map(|core| &description.cores[*core].name).collect::<Vec<_>>(),
        "states": { "least": way.least_states, "most": way.most_states, "carried_on": way.lasting },
        "if_empty": links(&way.queues),
        "best": way.best,
        "worst": way.most_states.as_ref().map(|_| way.worst),
        "worst_with_least_states": way.worst,
    })
}

/// Writes a table of the paths; paths that differ only in the names of their ends share a row.
pub(crate) fn write_ways(
    description: &Description,
    ways: &[Latency],
    clock: f64,
    deadline: Option<Deadline>,
    out: &mut Out,
) -> Result<()> {
    if ways.is_empty() {
        writeln!(out, "\nno way leads from an input of the system to an output")?;
        return Ok(());
    }
    writeln!(out, "\nfrom a command of the host to an output's first response")?;
    let alike = |a: &Latency, b: &Latency| {
        let key = |way: &Latency| (way.best, way.worst);
        (&a.cores, key(a), &a.queues) == (&b.cores, key(b), &b.queues)
            && (&a.least_states, &a.most_states) == (&b.least_states, &b.most_states)
    };
    let groups = grouped(
        ways.iter().cloned(),
        alike,
        (
            |way| &way.inputs,
            |way, other| {
                way.inputs.extend(other.inputs);
                way.lasting |= other.lasting;
            },
        ),
        (
            |way| &way.outputs,
            |way, other| {
                way.outputs.extend(other.outputs);
                way.lasting |= other.lasting;
            },
        ),
    );
    for way in groups {
        let cores: Vec<&str> = way.cores.iter().map(|core| description.cores[*core].name.as_str()).collect();
        writeln!(out, "  {} -> {}, through {}", listed(&way.inputs), listed(&way.outputs), cores.join(", "))?;
        if let Some(states) = states_text(&way, &cores) {
            writeln!(out, "    {states}")?;
        }
        let verdict = deadline.map_or("", |deadline| match deadline.meets_deadline(&way) {
            Some(true) => ": kept",
            Some(false) => ": too late",
            None => ": not certain to be kept",
        });
        let queues: Vec<String> =
            way.queues.iter().map(|link| description.links[*link].name.clone()).collect();
        let queues = if queues.is_empty() {
            String::new()
        } else {
            format!(", if nothing is queued in {}", listed(&queues))
        };
        let (best, worst) = (microseconds(way.best, clock), microseconds(way.worst, clock));
        match way.most_states {
            Some(_) => writeln!(
                out,
                "    {} to {} cycles ({best} to {worst}){queues}{verdict}",
                way.best, way.worst
            )?,
            None => writeln!(
                out,
                "    {} cycles or more ({best}), at most {} ({worst}) with the fewest states{queues}{verdict}",
                way.best, way.worst
            )?,
        }
    }
    Ok(())
}

/// States on the path to a first response; `None` for a direct path, which ends with the response.
fn states_text(way: &Latency, cores: &[&str]) -> Option<String> {
    let periods = |count: u32| format!("{count} period{}", if count == 1 { "" } else { "s" });
    let through = |(number, core): (usize, &&str)| {
        let (least, most) = (way.least_states[number], way.most_states.as_ref().map(|most| most[number]));
        match most {
            Some(most) if most > least => Some(format!("{core} {least} to {}", periods(most))),
            _ => (least > 0).then(|| format!("{core} {}", periods(least))),
        }
    };
    let through: Vec<String> = cores.iter().enumerate().filter_map(through).collect();
    let states = format!("through states: {}", through.join(", "));
    match (through.is_empty(), way.most_states.is_some()) {
        (true, true) => way
            .lasting
            .then(|| "the direct path; states can carry the command on to later periods".to_owned()),
        (false, true) => Some(states),
        (true, false) => {
            Some("directly or through states, as branches and addresses of data memory have it".to_owned())
        }
        (false, false) => Some(format!("{states} or more, as branches and addresses of data memory have it")),
    }
}
