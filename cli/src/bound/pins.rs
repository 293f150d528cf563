//! `takt bound --pins`: from an edge at a pin to an edge at a pin.

use super::{Bound, grouped, listed, microseconds};
use crate::board;
use crate::files::{self, Out};
use crate::output;
use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use takt_analysis::Bounds;
use takt_board::latency::{Answer, End, Part, Way, Ways, system_ways, ways};
use takt_board::{Application, Board, Wiring};
use takt_isa::Program;
use takt_system::Description;
use takt_system::latency::Passages;

/// Characters of a part's text, at least.
const WIDTH: usize = 36;

/// How parts are written.
#[derive(Clone, Copy)]
struct Table {
    /// In MHz.
    clock: f64,
    /// Characters of a part's text.
    width: usize,
}

/// The ways, and what else there is to say about them.
struct Found<'a> {
    application: Application<'a>,
    board: Board,
    wiring: Wiring,
    ways: Ways,
    /// Where a deadline can be missed; the bounds do not include that.
    late: Vec<String>,
}

/// Of a single program.
pub(super) fn program(
    arguments: &Bound,
    wiring: &Path,
    program: &Program,
    bounds: &Bounds,
    color: bool,
    out: &mut Out,
) -> Result<()> {
    let name = files::input_name(wiring);
    let (board, wiring) = read(arguments, wiring, program.into(), color)?;
    // A board gives the tick only after the outputs were read, so the program always waits by then.
    let periods = bounds.sections.iter().filter(|section| !section.once).map(|section| section.cycles);
    let program_takes = periods
        .reduce(|a, b| takt_analysis::Span { best: a.best.min(b.best), worst: a.worst.max(b.worst) })
        .context("the program has no period: it never waits for the tick")?;
    let ways = ways(&wiring, (program_takes.best, program_takes.worst));
    let Some(way) = ways.ways.first() else {
        bail!(
            "{name}: no path from pin to pin: the wiring needs an input (quadrature, step, digital-in) and an output (pwm, sigma-delta, digital-out) that are connected to ports"
        );
    };
    let (busy, period) = (Part::sum("", &way.between[1..]).worst, u64::from(wiring.period));
    let late = (busy >= period).then(|| format!("{busy} cycles from the tick, of {period}"));
    let late = late.into_iter().collect();
    Found { application: program.into(), board, wiring, ways, late }.write(arguments, out)
}

/// Of a system.
pub(crate) fn system(
    arguments: &Bound,
    wiring: &Path,
    description: &Description,
    bounds: &[Bounds],
    color: bool,
    out: &mut Out,
) -> Result<()> {
    let name = files::input_name(wiring);
    let (board, wiring) = read(arguments, wiring, description.into(), color)?;
    let passages = Passages::new(description, bounds);
    let ways = system_ways(&wiring, &passages).context("no bound from pin to pin")?;
    if ways.ways.is_empty() {
        let file = files::input_name(&arguments.file);
        match &ways.queues[..] {
            [] => bail!(
                "{name}: no path from pin to pin: the links of {file} lead from no input of the wiring (quadrature, step, digital-in) to an output of it (pwm, sigma-delta, digital-out)"
            ),
            queues => bail!(
                "{name}: no bound from pin to pin: every path goes over a FIFO ({}), where the latency depends on what is queued",
                queues.join(", ")
            ),
        }
    }
    let is_on_way =
        |core: &usize| ways.ways.iter().any(|way| way.cores.contains(&description.cores[*core].name));
    let cores = (0..description.cores.len()).filter(is_on_way);
    let late = cores.filter_map(|core| Some(passages.deadline(core)?.to_string())).collect();
    Found { application: description.into(), board, wiring, ways, late }.write(arguments, out)
}

fn read(
    arguments: &Bound,
    wiring: &Path,
    application: Application<'_>,
    color: bool,
) -> Result<(Board, Wiring)> {
    if arguments.deadline.is_some() {
        bail!("--deadline is not for --pins, where the wiring states the period");
    }
    board::wired(wiring, arguments.board.as_deref(), application, color)
}

impl Found<'_> {
    fn write(&self, arguments: &Bound, out: &mut Out) -> Result<()> {
        if arguments.json {
            return output::json(&self.json(), out);
        }
        writeln!(
            out,
            "cycles from an edge at a pin to an edge at a pin: {} on {}, {} at {} MHz",
            files::input_name(&arguments.file),
            self.board.name,
            self.application.cores(),
            self.wiring.clock
        )?;
        let parts = self.ways.ways.iter().flat_map(|way| &way.between);
        let width = parts.map(|part| part.text.chars().count()).max().unwrap_or(0).max(WIDTH);
        for group in Group::all(&self.ways.ways) {
            group.write(Table { clock: self.wiring.clock, width }, out)?;
        }
        for late in &self.late {
            writeln!(out, "a deadline can be missed: {late}; then a period or more is added")?;
        }
        if !self.ways.others.is_empty() {
            writeln!(out, "no edge to count from or to: {}", self.ways.others.join(", "))?;
        }
        if !self.ways.queues.is_empty() {
            let queues = self.ways.queues.join(", ");
            writeln!(out, "left out, because the latency depends on what is queued: paths over {queues}")?;
        }
        Ok(())
    }

    fn json(&self) -> Value {
        let part = |part: &Part| json!({ "what": part.text, "best": part.best, "worst": part.worst });
        let parts = |parts: &[Part]| parts.iter().map(part).collect::<Vec<_>>();
        let ends = |ends: &[End]| {
            let end = |end: &End| json!({ "peripheral": end.peripheral, "port": end.port, "parts": parts(&end.parts) });
            ends.iter().map(end).collect::<Vec<_>>()
        };
        let way = |way: &Way| {
            let mut value = json!({
                "inputs": ends(&way.inputs), "between": parts(&way.between), "outputs": ends(&way.outputs),
                "total": way.total().as_ref().map(part),
                "total_to_modulator": way.total_to_modulator().as_ref().map(part),
            });
            for (end, output) in way.outputs.iter().enumerate() {
                value["outputs"][end]["answer"] = json!(match output.answer {
                    Answer::Edge => "edge",
                    Answer::Density => "density",
                });
            }
            value
        };
        let ways = &self.ways.ways;
        let mut value = match self.application {
            Application::Program(_) => way(&ways[0]),
            Application::System(_) => {
                let way = |known: &Way| {
                    let mut value = way(known);
                    value["cores"] = json!(known.cores);
                    value["links"] = json!(known.links);
                    value
                };
                json!({
                    "ways": ways.iter().map(way).collect::<Vec<_>>(), "over_fifos": self.ways.queues,
                    "deadlines_missed": self.late,
                })
            }
        };
        value["board"] = json!(self.board.name);
        value["clock_mhz"] = json!(self.wiring.clock);
        value["period"] = json!(self.wiring.period);
        value["without_edges"] = json!(self.ways.others);
        value
    }
}

/// Ways that differ in their ends only, from each input to each output.
#[derive(Clone)]
struct Group {
    /// With all inputs and outputs.
    way: Way,
    /// The links that they begin with.
    first: Vec<String>,
    /// The links that they end with.
    last: Vec<String>,
}

impl Group {
    fn all(ways: &[Way]) -> Vec<Group> {
        let alone = |way: &Way| Group {
            way: way.clone(),
            first: way.links.first().cloned().into_iter().collect(),
            last: way.links.last().cloned().into_iter().collect(),
        };
        let inner = |way: &Way| -> Vec<String> {
            way.links.get(1..way.links.len().saturating_sub(1)).unwrap_or_default().to_vec()
        };
        let alike = |a: &Group, b: &Group| {
            let [a, b] = [&a.way, &b.way];
            (&a.cores, inner(a), &a.between, &a.periods) == (&b.cores, inner(b), &b.between, &b.periods)
        };
        grouped(
            ways.iter().map(alone),
            alike,
            (
                |group| &group.first,
                |group, other| {
                    group.first.extend(other.first);
                    group.way.inputs.extend(other.way.inputs);
                },
            ),
            (
                |group| &group.last,
                |group, other| {
                    group.last.extend(other.last);
                    group.way.outputs.extend(other.way.outputs);
                },
            ),
        )
    }

    fn write(&self, table: Table, out: &mut Out) -> Result<()> {
        let Way { cores, links, between, .. } = &self.way;
        if !cores.is_empty() {
            writeln!(out, "\nthrough {}", cores.join(", "))?;
            let inner = links[1..links.len() - 1].iter().cloned();
            let over = std::iter::once(listed(&self.first)).chain(inner).chain([listed(&self.last)]);
            writeln!(out, "over {}", over.collect::<Vec<_>>().join("; "))?;
        }
        ends(&self.way.inputs, table, out)?;
        writeln!(out, "{}", if cores.is_empty() { "every period" } else { "between" })?;
        between.iter().try_for_each(|part| line(part, table, out))?;
        ends(&self.way.outputs, table, out)?;
        writeln!(out, "in all")?;
        let totals = [self.way.total(), self.way.total_to_modulator()];
        totals.iter().flatten().try_for_each(|total| line(total, table, out))
    }
}

fn ends(ends: &[End], table: Table, out: &mut Out) -> Result<()> {
    for same in ends.chunk_by(|a, b| (&a.parts, a.answer) == (&b.parts, b.answer)) {
        let names: Vec<String> =
            same.iter().map(|end| format!("{} ({})", end.peripheral, end.port)).collect();
        writeln!(out, "{}", names.join(", "))?;
        same[0].parts.iter().try_for_each(|part| line(part, table, out))?;
        if same[0].answer == Answer::Density {
            writeln!(out, "  then the pin: a density of ones, with no bound for any one pulse")?;
        }
    }
    Ok(())
}

fn line(part: &Part, Table { clock, width }: Table, out: &mut Out) -> Result<()> {
    let Part { text, best, worst } = part;
    let cycles = if best == worst { best.to_string() } else { format!("{best} to {worst}") };
    Ok(writeln!(out, "  {text:<width$} {cycles:>14} {:>14}", microseconds(*worst, clock))?)
}
