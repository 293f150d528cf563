//! `takt bound SYSTEM.toml`: each core's sections, and the way from the host's inputs to its outputs.

use super::{LoadedSystem, load};
use crate::bound::{Bound, grouped, listed, microseconds, sections_json, write_sections};
use crate::files::{self, Out};
use crate::output::{self, Failure};
use anyhow::{Result, anyhow, bail};
use serde_json::{Value, json};
use std::io::Write;
use takt_analysis::Bounds;
use takt_system::latency::{Latency, latencies};
use takt_system::{Core, Description};

pub(crate) fn run(arguments: &Bound, color: bool, out: &mut Out) -> Result<()> {
    if arguments.machine.machine.is_some() {
        let why = "--machine with a system: the system's file names each core's";
        return Err(Failure::Usage(why.to_owned()).into());
    }
    let LoadedSystem { description, .. } = load(&arguments.file, &arguments.source, color)?;
    let bounds = bounds(&description)?;
    #[cfg(feature = "board")]
    if let Some(wiring) = &arguments.wiring {
        return crate::bound::pins::run(arguments, wiring, (&description).into(), &bounds, color, out);
    }
    let deadline = arguments
        .deadline
        .map(|deadline| Deadline { cycles: deadline.cycles(arguments.clock), empty: arguments.empty_fifos });
    let ways = latencies(&description, &bounds).map_err(|error| anyhow!("no end-to-end bound: {error}"));
    if deadline.is_some() && matches!(&ways, Ok(ways) if ways.is_empty()) {
        bail!("a deadline, and no way leads from an input of the system to an output");
    }
    let is_kept = |ways: &[Latency]| {
        deadline.is_none_or(|deadline| ways.iter().all(|way| deadline.kept(way) == Some(true)))
    };
    let verdict = ways.as_ref().is_ok_and(|ways| is_kept(ways));
    if arguments.json {
        let ways = ways?;
        output::json(&result_json(arguments, &description, &bounds, &ways, deadline), out)?;
    } else {
        write_text(arguments, &description, &bounds, out)?;
        // The cores' bounds stand even where the system's do not.
        write_ways(&description, &ways?, arguments.clock, deadline, out)?;
    }
    if verdict { Ok(()) } else { Err(Failure::Reported.into()) }
}

/// The deadline that a first response is held against.
#[derive(Clone, Copy)]
pub(super) struct Deadline {
    cycles: u64,
    /// True if FIFOs are empty when the command comes.
    empty: bool,
}

impl Deadline {
    fn kept(self, way: &Latency) -> Option<bool> {
        way.kept(self.cycles, self.empty)
    }
}

/// The bounds of each core's sections.
pub(super) fn bounds(description: &Description) -> Result<Vec<Bounds>> {
    let bound = |core: &Core| {
        takt_analysis::bound(&core.program).map_err(|error| anyhow!("core {}: no bound: {error}", core.name))
    };
    description.cores.iter().map(bound).collect()
}

fn result_json(
    arguments: &Bound,
    description: &Description,
    bounds: &[Bounds],
    ways: &[Latency],
    deadline: Option<Deadline>,
) -> Value {
    let core = |(core, bounds): (&Core, &Bounds)| {
        json!({
            "name": core.name,
            "program": core.path,
            "machine": core.program.machine.name,
            "period": core.period(description.tick),
            "sections": sections_json(&core.program, bounds),
        })
    };
    let way = |way: &Latency| {
        let mut value = way_json(description, way);
        value["kept"] = json!(deadline.and_then(|deadline| deadline.kept(way)));
        value
    };
    json!({
        "system": files::input_name(&arguments.file),
        "tick": description.tick,
        "clock_mhz": arguments.clock,
        "cores": description.cores.iter().zip(bounds).map(core).collect::<Vec<_>>(),
        "latencies": ways.iter().map(way).collect::<Vec<_>>(),
        "deadline": deadline.map(|deadline| deadline.cycles),
    })
}

/// A way's bounds, as JSON.
pub(super) fn way_json(description: &Description, way: &Latency) -> Value {
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

fn write_text(arguments: &Bound, description: &Description, bounds: &[Bounds], out: &mut Out) -> Result<()> {
    writeln!(out, "cycles, whatever the inputs")?;
    for (core, bounds) in description.cores.iter().zip(bounds) {
        let period = core.period(description.tick);
        let time = microseconds(period, arguments.clock);
        writeln!(
            out,
            "\n{}: {} on {}, a tick every {period} ({time})",
            core.name, core.path, core.program.machine.name
        )?;
        write_sections(&core.program, bounds, arguments.clock, out)?;
    }
    Ok(())
}

pub(super) fn write_ways(
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
        let verdict = deadline.map_or("", |deadline| match deadline.kept(&way) {
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

/// Which states a first response comes through; nothing of a way that is direct and ends with the response.
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
