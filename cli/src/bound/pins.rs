//! `takt bound --pins`: from an edge at a pin to an edge at a pin.

use super::{Bound, microseconds};
use crate::board;
use crate::files::{self, Out};
use crate::output;
use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use takt_analysis::Bounds;
use takt_board::Wiring;
use takt_board::latency::{End, Part, Ways, ways};
use takt_isa::Program;

pub(super) fn run(
    arguments: &Bound,
    wiring: &Path,
    program: &Program,
    bounds: &Bounds,
    color: bool,
    out: &mut Out,
) -> Result<()> {
    if arguments.deadline.is_some() {
        bail!("--deadline is not for --pins, where the wiring states the period");
    }
    let name = files::input_name(wiring);
    let (board, wiring) = board::wired(wiring, arguments.board.as_deref(), program, color)?;
    // A board gives the tick only after the outputs were read, so the program always waits by then.
    let periods = bounds.sections.iter().filter(|section| !section.once).map(|section| section.cycles);
    let program_takes = periods
        .reduce(|a, b| takt_analysis::Span { best: a.best.min(b.best), worst: a.worst.max(b.worst) })
        .context("the program has no period: it never waits for the tick")?;
    let ways = ways(&wiring, (program_takes.best, program_takes.worst));
    if ways.inputs.is_empty() || ways.outputs.is_empty() {
        bail!(
            "{name}: no path from pin to pin: the wiring needs an input (quadrature, step, digital-in) and an output (pwm, sigma-delta, digital-out) that are connected to ports"
        );
    }
    let all = |edge: fn(&Part) -> u64, pick: fn(u64, u64) -> u64| {
        let ends = [&ways.inputs, &ways.outputs].map(|ends| {
            let sums = ends.iter().map(|end| edge(&Part::sum("", &end.parts)));
            sums.reduce(pick).unwrap_or(0)
        });
        ends.iter().sum::<u64>() + edge(&Part::sum("", &ways.between))
    };
    let total = Part {
        text: "from pin to pin".to_owned(),
        best: all(|part| part.best, u64::min),
        worst: all(|part| part.worst, u64::max),
    };
    let period = u64::from(wiring.period);
    let busy = Part::sum("", &ways.between[1..]).worst;
    if arguments.json {
        return output::json(&json(&ways, &total, &board.name, &wiring), out);
    }
    writeln!(
        out,
        "cycles from an edge at a pin to an edge at a pin: {} on {}, {} at {} MHz",
        files::input_name(&arguments.file),
        board.name,
        program.machine.name,
        wiring.clock
    )?;
    let ends = |ends: &[End], out: &mut Out| -> Result<()> {
        for same in ends.chunk_by(|a, b| a.parts == b.parts) {
            let names: Vec<String> =
                same.iter().map(|end| format!("{} ({})", end.peripheral, end.port)).collect();
            writeln!(out, "{}", names.join(", "))?;
            same[0].parts.iter().try_for_each(|part| line(part, wiring.clock, out))?;
        }
        Ok(())
    };
    ends(&ways.inputs, out)?;
    writeln!(out, "every period")?;
    ways.between.iter().try_for_each(|part| line(part, wiring.clock, out))?;
    ends(&ways.outputs, out)?;
    writeln!(out, "in all")?;
    line(&total, wiring.clock, out)?;
    if busy >= period {
        writeln!(
            out,
            "a deadline can be missed: {busy} cycles from the tick, of {period}; then a period or more is added"
        )?;
    }
    if !ways.others.is_empty() {
        writeln!(out, "no edge to count from or to: {}", ways.others.join(", "))?;
    }
    Ok(())
}

fn line(part: &Part, clock: f64, out: &mut Out) -> Result<()> {
    let Part { text, best, worst } = part;
    let cycles = if best == worst { best.to_string() } else { format!("{best} to {worst}") };
    Ok(writeln!(out, "  {text:<36} {cycles:>14} {:>14}", microseconds(*worst, clock))?)
}

fn json(ways: &Ways, total: &Part, board: &str, wiring: &Wiring) -> Value {
    let part = |part: &Part| json!({ "what": part.text, "best": part.best, "worst": part.worst });
    let parts = |parts: &[Part]| parts.iter().map(part).collect::<Vec<_>>();
    let ends = |ends: &[End]| {
        let end =
            |end: &End| json!({ "peripheral": end.peripheral, "port": end.port, "parts": parts(&end.parts) });
        ends.iter().map(end).collect::<Vec<_>>()
    };
    json!({
        "board": board, "clock_mhz": wiring.clock, "period": wiring.period, "inputs": ends(&ways.inputs),
        "between": parts(&ways.between), "outputs": ends(&ways.outputs), "total": part(total), "without_edges": ways.others,
    })
}
