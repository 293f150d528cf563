//! `takt bound SYSTEM.toml`: each core's sections, and the way from the host's inputs to its outputs.

use super::{LoadedSystem, load};
use crate::bound::{Bound, grouped, listed, microseconds, sections_json, write_sections};
use crate::files::{self, Out};
use crate::output::{self, Failure};
use anyhow::{Result, anyhow};
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
        return crate::bound::pins::system(arguments, wiring, &description, &bounds, color, out);
    }
    let deadline = arguments.deadline.map(|deadline| deadline.cycles(arguments.clock));
    let ways = latencies(&description, &bounds).map_err(|error| anyhow!("no end-to-end bound: {error}"));
    let late =
        |ways: &[Latency]| deadline.map(|deadline| ways.iter().filter(|way| way.worst > deadline).count());
    let verdict = ways.as_ref().ok().and_then(|ways| late(ways));
    if arguments.json {
        let ways = ways?;
        output::json(&result_json(arguments, &description, &bounds, &ways, deadline), out)?;
    } else {
        write_text(arguments, &description, &bounds, out)?;
        // The cores' bounds stand even where the system's do not.
        write_ways(&description, &ways?, arguments.clock, deadline, out)?;
    }
    match verdict {
        Some(late) if late > 0 => Err(Failure::Reported.into()),
        _ => Ok(()),
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
    deadline: Option<u64>,
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
        json!({
            "inputs": way.inputs,
            "outputs": way.outputs,
            "links": way.links.iter().map(|link| &description.links[*link].name).collect::<Vec<_>>(),
            "cores": way.cores.iter().map(|core| &description.cores[*core].name).collect::<Vec<_>>(),
            "best": way.best,
            "worst": way.worst,
            "kept": deadline.map(|deadline| way.worst <= deadline),
        })
    };
    json!({
        "system": files::input_name(&arguments.file),
        "tick": description.tick,
        "clock_mhz": arguments.clock,
        "cores": description.cores.iter().zip(bounds).map(core).collect::<Vec<_>>(),
        "latencies": ways.iter().map(way).collect::<Vec<_>>(),
        "deadline": deadline,
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
    deadline: Option<u64>,
    out: &mut Out,
) -> Result<()> {
    if ways.is_empty() {
        writeln!(out, "\nno way leads from an input of the system to an output")?;
        return Ok(());
    }
    writeln!(out, "\nfrom a command of the host to an output that follows from it")?;
    let alike = |a: &Latency, b: &Latency| (&a.cores, a.best, a.worst) == (&b.cores, b.best, b.worst);
    let groups = grouped(
        ways.iter().cloned(),
        alike,
        (|way| &way.inputs, |way, other| way.inputs.extend(other.inputs)),
        (|way| &way.outputs, |way, other| way.outputs.extend(other.outputs)),
    );
    for way in groups {
        let cores: Vec<&str> = way.cores.iter().map(|core| description.cores[*core].name.as_str()).collect();
        writeln!(out, "  {} -> {}, through {}", listed(&way.inputs), listed(&way.outputs), cores.join(", "))?;
        let late = deadline.map_or("", |deadline| if way.worst > deadline { ": too late" } else { ": kept" });
        let (best, worst) = (microseconds(way.best, clock), microseconds(way.worst, clock));
        writeln!(out, "    {} to {} cycles ({best} to {worst}){late}", way.best, way.worst)?;
    }
    Ok(())
}
