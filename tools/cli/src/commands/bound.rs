// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt bound`: best and worst case of each section of each core, by static analysis; for a system, also the latencies from
//! the host's inputs to its outputs.

mod certificate;
mod groups;
pub(crate) mod paths;
#[cfg(feature = "board")]
pub(crate) mod pins;

use crate::commands::left_out;
use crate::run::application::Application;
use crate::terminal::files::{self, Out};
use crate::terminal::number::{self, Time};
use crate::terminal::options::{self, OptionalMachine, SourceArguments};
use crate::terminal::output::Failure;
use crate::terminal::page::{Columns, left, right};
use anyhow::{Result, bail};
use clap::Args;
use groups::microseconds;
use paths::{Deadline, way_json, write_ways};
use serde_json::{Value, json};
use std::io::Write;
use std::path::PathBuf;
use takt_analysis::{Bounds, SectionBounds};
use takt_isa::Program;
use takt_isa::timing::{Cycle, Span};
use takt_system::latency::Latency;
use takt_system::{Core, Description};

/// Bound the cycles of each section, whatever the inputs.
///
/// Follows every path through the program with the machine's exact timing. Loops need `.loop_bound N` before their first bundle, which
/// the emulator checks. What cannot be bounded for certain is an error.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Bound {
    /// Source or image, `-` being standard input; or a system, a `.toml` file.
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) machine: OptionalMachine,
    #[command(flatten)]
    pub(crate) source: SourceArguments,
    /// Fail (status 1) unless every period ends before the next tick, this time after its own, or, of a system, unless every first response
    /// is certain to come within this time: `100us`, `0.1ms`, or a number of cycles.
    #[arg(long, value_name = "TIME", value_parser = number::time, allow_hyphen_values = true)]
    pub(crate) deadline: Option<Time>,
    /// Clock in MHz, for a deadline in seconds and for cycles to time.
    #[arg(long, value_name = "MHZ", default_value_t = options::PAPER_CLOCK, value_parser = number::clock, allow_hyphen_values = true)]
    pub(crate) clock: f64,
    /// With a system and --deadline: FIFOs are empty when a command comes. Without it, no deadline of a way over one is certain to be kept.
    #[arg(long, requires = "deadline")]
    pub(crate) empty_fifos: bool,
    /// From an edge at a pin of a board to one at another: the cycles of each part of the way, with the peripherals of --wiring.
    #[arg(long, requires = "wiring")]
    pins: bool,
    /// With --pins: which peripherals are at which pins (docs/board.md).
    #[arg(long, value_name = "TOML", requires = "pins")]
    pub(crate) wiring: Option<PathBuf>,
    /// With --pins: the board, where the wiring does not name it.
    #[arg(long, value_name = "BOARD", requires = "pins")]
    board: Option<String>,
    /// Write a proof of the bounds of a program to this file, which `takt verify --bound` checks (docs/verify.md).
    #[arg(long, value_name = "FILE")]
    pub(crate) certificate: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt bound prog.s                                  best and worst of every section
  takt bound prog.s --deadline 100us --clock 125MHz  for CI: status 1 if a period can take longer
  takt bound prog.s --certificate prog.json          with a proof, for `takt verify --bound prog.json prog.s`
  takt bound robot.s --pins --wiring robot.toml      from an encoder's edge to a PWM's, on a board
  takt bound system.toml                             of each core, and from the host's inputs to outputs
  takt bound axis.toml --pins --wiring wiring.toml   over a system's cores and links, from pin to pin";

/// Comparison of the worst period with a deadline.
struct Verdict {
    deadline: Cycle,
    worst: Cycle,
}

impl Verdict {
    /// The next period's tick comes after the `wait` has issued, even in the worst case.
    fn keeps_tick(&self) -> bool {
        self.worst < self.deadline
    }
}

pub(crate) fn run(arguments: &Bound, color: bool, out: &mut Out) -> Result<()> {
    if arguments.wiring.is_some() && !cfg!(feature = "board") {
        return left_out::left_out("board");
    }
    let writes: Vec<_> = arguments.certificate.iter().map(|path| ("--certificate", path.as_path())).collect();
    files::check(&[("FILE", &arguments.file)], &writes)?;
    let application = Application::load(&arguments.file, &arguments.machine, &arguments.source, color)?;
    if arguments.empty_fifos && application.system().is_none() {
        let why = "--empty-fifos is for systems, which have FIFOs between their cores";
        return Err(Failure::Usage(why.to_owned()).into());
    }
    if arguments.certificate.is_some() && application.system().is_some() {
        let why = "--certificate is of one program: bound the program of each core";
        return Err(Failure::Usage(why.to_owned()).into());
    }
    let bounds = match (&arguments.certificate, &application) {
        (Some(path), Application::Program(loaded)) => vec![certificate::write(path, &loaded.program)?],
        _ => application.bounds()?,
    };
    let deadline = arguments.deadline.map(|deadline| deadline.cycles(arguments.clock));
    #[cfg(feature = "board")]
    if let Some(wiring) = &arguments.wiring {
        let pinned = match &application {
            Application::Program(loaded) => (&loaded.program).into(),
            Application::System(system) => (&system.description).into(),
        };
        return pins::run(arguments, wiring, pinned, &bounds, color, out);
    }
    let kept = match &application {
        Application::Program(loaded) => of_program(arguments, &loaded.program, &bounds[0], deadline, out)?,
        Application::System(system) => of_system(arguments, &system.description, &bounds, deadline, out)?,
    };
    if kept { Ok(()) } else { Err(Failure::Reported.into()) }
}

/// Writes the bounds of a program; returns whether they meet the deadline, if one is given.
fn of_program(
    arguments: &Bound,
    program: &Program,
    bounds: &Bounds,
    deadline: Option<Cycle>,
    out: &mut Out,
) -> Result<bool> {
    let verdict = match (deadline, bounds.worst_period()) {
        (None, _) => None,
        (Some(_), None) => bail!("--deadline needs a period, but the program never waits for the tick"),
        (Some(deadline), Some(worst)) => Some(Verdict { deadline, worst }),
    };
    if arguments.json {
        files::json(&program_json(arguments, program, bounds, verdict.as_ref()), out)?;
    } else {
        writeln!(out, "cycles on {}, whatever the inputs", program.machine.name)?;
        write_sections(program, bounds, arguments.clock, out)?;
        write_verdict(verdict.as_ref(), arguments, out)?;
    }
    Ok(verdict.is_none_or(|verdict| verdict.keeps_tick()))
}

/// Writes the bounds of a system; returns whether every first response meets the deadline, if one is given.
fn of_system(
    arguments: &Bound,
    description: &Description,
    bounds: &[Bounds],
    deadline: Option<Cycle>,
    out: &mut Out,
) -> Result<bool> {
    let deadline = deadline.map(|cycles| Deadline { cycles, empty: arguments.empty_fifos });
    let ways = paths::paths(description, bounds);
    if deadline.is_some() && matches!(&ways, Ok(ways) if ways.is_empty()) {
        bail!("--deadline needs a path from an input of the system to an output, but there is none");
    }
    if !arguments.json {
        // Print the bounds of the cores even if the system has none.
        write_cores(description, bounds, arguments.clock, out)?;
    }
    let ways = ways?;
    if arguments.json {
        files::json(&system_json(arguments, description, bounds, &ways, deadline), out)?;
    } else {
        write_ways(description, &ways, arguments.clock, deadline, out)?;
    }
    let kept = |deadline: Deadline| ways.iter().all(|way| deadline.meets_deadline(way) == Some(true));
    Ok(deadline.is_none_or(kept))
}

/// Section bounds as JSON.
pub(crate) fn sections_json(program: &Program, bounds: &Bounds) -> Value {
    let span = |span: Span| json!({ "best": span.best, "worst": span.worst });
    let section = |section: &SectionBounds| {
        let mut value = json!({
            "name": section.name,
            "address": section.address,
            "place": section.location.map(|location| program.place_text(location)),
            "ends": section.ends,
            "once": section.once,
            "cycles": span(section.cycles),
        });
        if !section.once {
            value["in_time"] = span(section.in_time);
            value["missed"] = span(section.missed);
        }
        if let Some(published) = section.published {
            value["published"] = match section.once {
                true => json!({ "cycles": span(published.cycles) }),
                false => json!({
                    "cycles": span(published.cycles),
                    "in_time": span(published.in_time),
                    "missed": span(published.missed),
                }),
            };
        }
        value
    };
    bounds.sections.iter().map(section).collect()
}

fn program_json(arguments: &Bound, program: &Program, bounds: &Bounds, verdict: Option<&Verdict>) -> Value {
    json!({
        "program": files::input_name(&arguments.file),
        "machine": program.machine.name,
        "sections": sections_json(program, bounds),
        "deadline": verdict.map(|verdict| json!({
            "cycles": verdict.deadline,
            "clock_mhz": arguments.clock,
            "worst": verdict.worst,
            "kept": verdict.keeps_tick(),
        })),
    })
}

fn system_json(
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
        value["kept"] = json!(deadline.and_then(|deadline| deadline.meets_deadline(way)));
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

/// Writes section bounds as a table.
pub(crate) fn write_sections(program: &Program, bounds: &Bounds, clock: f64, out: &mut Out) -> Result<()> {
    let text = |span: Span| number::least_to_most(span.best, span.worst);
    let refill = program.machine.refill;
    let width = bounds.sections.iter().map(|section| section.name.len()).max().unwrap_or(0);
    let columns = [left(width + 4, 0), right(12, 0), right(14, 0), left(0, 0)];
    let columns = Columns::new(&columns, out.page());
    for section in &bounds.sections {
        let place = section.location.map_or_else(String::new, |location| program.place_text(location));
        let (name, time) = (&section.name, microseconds(section.cycles.worst, clock));
        let cells = [format!("  {name}"), text(section.cycles), time, format!("  {place}")];
        out.lines(&columns.row(&cells, Some(1)))?;
    }
    for section in bounds.sections.iter().filter(|section| !section.once) {
        writeln!(
            out,
            "{}: {} if the tick comes less than {refill} cycles after the wait, {} after a missed deadline",
            section.name,
            text(section.in_time),
            text(section.missed)
        )?;
    }
    for section in &bounds.sections {
        let Some(published) = section.published else { continue };
        let time = microseconds(published.cycles.worst, clock);
        writeln!(out, "{}: outputs published after {} ({time})", section.name, text(published.cycles))?;
    }
    Ok(())
}

/// Writes a table of the sections of each core in a system.
fn write_cores(description: &Description, bounds: &[Bounds], clock: f64, out: &mut Out) -> Result<()> {
    writeln!(out, "cycles, whatever the inputs")?;
    for (core, bounds) in description.cores.iter().zip(bounds) {
        let (name, path, machine) = (&core.name, &core.path, core.program.machine.name);
        let period = core.period(description.tick);
        let time = microseconds(period, clock);
        writeln!(out, "\n{name}: {path} on {machine}, a tick every {period} ({time})")?;
        write_sections(&core.program, bounds, clock, out)?;
    }
    Ok(())
}

fn write_verdict(verdict: Option<&Verdict>, arguments: &Bound, out: &mut Out) -> Result<()> {
    let clock = arguments.clock;
    if let Some(verdict) = verdict {
        let Verdict { deadline, worst } = *verdict;
        let time = microseconds(deadline, clock);
        if verdict.keeps_tick() {
            let spare = deadline - 1 - worst;
            let kept = out.page().strong(&format!("kept, {spare} to spare"));
            out.lines(&format!("deadline of {deadline} cycles ({time} at {clock} MHz): {kept}\n"))?;
        } else {
            let kept = out.page().strong("not kept");
            // Who means a time writes its unit; a number alone is one of cycles.
            let hint = match arguments.deadline {
                Some(Time::Cycles(count)) => format!("; for a time, write its unit: `{count}us`"),
                _ => String::new(),
            };
            let cycles = if deadline == 1 { "cycle" } else { "cycles" };
            out.lines(&format!(
                "deadline of {deadline} {cycles} ({time} at {clock} MHz{hint}): {kept}, a period can take {worst} and \
                 must take fewer than {deadline}\n"
            ))?;
        }
    }
    Ok(())
}
