//! `takt bound`: the best and the worst that each section can take, from the program alone.

#[cfg(feature = "board")]
pub(crate) mod pins;

use crate::files::{self, Out};
use crate::load::{self, Load};
use crate::number::{self, Time};
use crate::output::{self, Failure};
use crate::select::{self, OptionalMachine, SourceArguments};
use crate::system;
use anyhow::{Result, anyhow, bail};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::PathBuf;
use takt_analysis::{Bounds, SectionBounds};
use takt_isa::Program;
use takt_isa::timing::Cycle;
use takt_isa::timing::Span;

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
    #[arg(long, value_name = "MHZ", default_value_t = select::PAPER_CLOCK, value_parser = number::clock, allow_hyphen_values = true)]
    pub(crate) clock: f64,
    /// With a system and --deadline: FIFOs are empty when a command comes. Without it, no deadline of a way over one is certain to be kept.
    #[arg(long, requires = "deadline")]
    pub(crate) empty_fifos: bool,
    /// From an edge at a pin of a board to one at another: the cycles of each part of the way, with the peripherals of --wiring.
    #[cfg(feature = "board")]
    #[arg(long, requires = "wiring")]
    pins: bool,
    /// With --pins: which peripherals are at which pins (docs/board.md).
    #[cfg(feature = "board")]
    #[arg(long, value_name = "TOML", requires = "pins")]
    pub(crate) wiring: Option<PathBuf>,
    /// With --pins: the board, where the wiring does not name it.
    #[cfg(feature = "board")]
    #[arg(long, value_name = "BOARD", requires = "pins")]
    board: Option<String>,
    /// Print the result as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt bound prog.s                                  best and worst of every section
  takt bound prog.s --deadline 100us --clock 125MHz  for CI: status 1 if a period can take longer
  takt bound robot.s --pins --wiring robot.toml      from an encoder's edge to a PWM's, on a board
  takt bound system.toml                             of each core, and from the host's inputs to outputs
  takt bound axis.toml --pins --wiring wiring.toml   over a system's cores and links, from pin to pin";

/// Names that are shown of a list with many.
const SHOWN: usize = 3;

/// Names one after the other, of many the first ones.
pub(crate) fn listed(names: &[String]) -> String {
    match names {
        many if many.len() > SHOWN => format!("{}, … ({})", many[..SHOWN].join(", "), many.len()),
        few => few.join(", "),
    }
}

/// The name of one end, or the merging of another group's ends of that side into one's own.
type Side<G> = (fn(&G) -> &Vec<String>, fn(&mut G, G));

/// Groups of ways that are alike but for the names of their ends: each of one group's heads leads to each of its tails.
pub(crate) fn grouped<G>(
    ways: impl Iterator<Item = G>,
    alike: impl Fn(&G, &G) -> bool,
    (heads, with_heads): Side<G>,
    (tails, with_tails): Side<G>,
) -> Vec<G> {
    let merged = |groups: Vec<G>, same: fn(&G) -> &Vec<String>, with: fn(&mut G, G)| {
        let mut merged: Vec<G> = Vec::new();
        for group in groups {
            match merged.iter_mut().find(|other| alike(other, &group) && same(other) == same(&group)) {
                Some(other) => with(other, group),
                None => merged.push(group),
            }
        }
        merged
    };
    // First the tails of the same heads, then the heads of the same tails.
    merged(merged(ways.collect(), heads, with_tails), tails, with_heads)
}

/// The deadline against the worst period.
struct Verdict {
    deadline: Cycle,
    worst: Cycle,
}

impl Verdict {
    /// The tick of the next period must come after the cycle in which `wait` issues.
    fn kept(&self) -> bool {
        self.worst < self.deadline
    }
}

pub(crate) fn run(arguments: &Bound, color: bool, out: &mut Out) -> Result<()> {
    files::check(&[("FILE", &arguments.file)], &[])?;
    if load::is_system(&arguments.file) {
        return system::bound::run(arguments, color, out);
    }
    if arguments.empty_fifos {
        let why = "--empty-fifos is for systems, which have FIFOs between their cores";
        return Err(Failure::Usage(why.to_owned()).into());
    }
    let program =
        Load::new(arguments.machine.machine, color).with(&arguments.source).program(&arguments.file)?;
    let bounds = takt_analysis::bound(&program).map_err(|error| anyhow!("no bound: {error}"))?;
    #[cfg(feature = "board")]
    if let Some(wiring) = &arguments.wiring {
        return pins::run(arguments, wiring, (&program).into(), &[bounds], color, out);
    }
    let verdict = match (arguments.deadline, bounds.worst_period()) {
        (None, _) => None,
        (Some(_), None) => bail!("a deadline, and the program has no period: it never waits for the tick"),
        (Some(deadline), Some(worst)) => Some(Verdict { deadline: deadline.cycles(arguments.clock), worst }),
    };
    if arguments.json {
        output::json(&result_json(arguments, &program, &bounds, verdict.as_ref()), out)?;
    } else {
        write_text(arguments, &program, &bounds, verdict.as_ref(), out)?;
    }
    match verdict {
        Some(verdict) if !verdict.kept() => Err(Failure::Reported.into()),
        _ => Ok(()),
    }
}

/// The sections' bounds, as JSON.
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
        value
    };
    bounds.sections.iter().map(section).collect()
}

fn result_json(arguments: &Bound, program: &Program, bounds: &Bounds, verdict: Option<&Verdict>) -> Value {
    json!({
        "program": files::input_name(&arguments.file),
        "machine": program.machine.name,
        "sections": sections_json(program, bounds),
        "deadline": verdict.map(|verdict| json!({
            "cycles": verdict.deadline,
            "clock_mhz": arguments.clock,
            "worst": verdict.worst,
            "kept": verdict.kept(),
        })),
    })
}

/// The sections' bounds, as a table.
pub(crate) fn write_sections(program: &Program, bounds: &Bounds, clock: f64, out: &mut Out) -> Result<()> {
    let text = |span: Span| match span.best == span.worst {
        true => span.worst.to_string(),
        false => format!("{} to {}", span.best, span.worst),
    };
    let refill = program.machine.refill;
    let width = bounds.sections.iter().map(|section| section.name.len()).max().unwrap_or(0);
    for section in &bounds.sections {
        let place = section.location.map_or_else(String::new, |location| program.place_text(location));
        let (name, time) = (&section.name, microseconds(section.cycles.worst, clock));
        writeln!(out, "  {name:<width$}  {:>12}  {time:>12}  {place}", text(section.cycles))?;
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
    Ok(())
}

/// Cycles as a time.
pub(crate) fn microseconds(cycles: Cycle, clock: f64) -> String {
    format!("{:.3} µs", cycles as f64 / clock)
}

fn write_text(
    arguments: &Bound,
    program: &Program,
    bounds: &Bounds,
    verdict: Option<&Verdict>,
    out: &mut Out,
) -> Result<()> {
    let clock = arguments.clock;
    writeln!(out, "cycles on {}, whatever the inputs", program.machine.name)?;
    write_sections(program, bounds, clock, out)?;
    if let Some(verdict) = verdict {
        let Verdict { deadline, worst } = *verdict;
        let time = microseconds(deadline, clock);
        if verdict.kept() {
            let spare = deadline - 1 - worst;
            writeln!(out, "deadline of {deadline} cycles ({time} at {clock} MHz): kept, {spare} to spare")?;
        } else {
            writeln!(
                out,
                "deadline of {deadline} cycles ({time} at {clock} MHz): not kept, a period can take {worst} and \
                 must take fewer than {deadline}"
            )?;
        }
    }
    Ok(())
}
