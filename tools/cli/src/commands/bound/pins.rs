// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt bound --pins`: latency bounds from an edge at an input pin to an edge at an output pin.

use super::Bound;
use super::groups::{grouped, listed, microseconds};
use crate::commands::board;
use crate::terminal::files::{self, Out};
use anyhow::{Result, bail};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use takt_analysis::Bounds;
use takt_board::latency::{Answer, End, Part, PinPath, PinPaths, Sampling, Until, samples};
use takt_board::{Application, Board, Wiring};

/// Minimum width of a part's text, in characters.
const WIDTH: usize = 36;

/// Format of the table of parts.
#[derive(Clone, Copy)]
struct Table {
    /// Clock in MHz, for times.
    clock: f64,
    /// Width of a part's text, in characters.
    width: usize,
}

/// Paths between pins, with the context needed for output.
struct PinPathReport<'a> {
    application: Application<'a>,
    board: Board,
    wiring: Wiring,
    ways: PinPaths,
}

pub(crate) fn run(
    arguments: &Bound,
    wiring: &Path,
    application: Application<'_>,
    bounds: &[Bounds],
    color: bool,
    out: &mut Out,
) -> Result<()> {
    if arguments.deadline.is_some() {
        bail!("--deadline is not for --pins, where the wiring states the period");
    }
    let name = files::input_name(wiring);
    let (board, wiring) = board::wired(wiring, arguments.board.as_deref(), &application, color)?;
    let ways = takt_board::latency::ways(&wiring, &application, bounds)?;
    if ways.ways.is_empty() {
        if !ways.queues.is_empty() {
            bail!(
                "{name}: no bound from pin to pin: every path goes over a FIFO ({}), where the latency depends on what is queued",
                ways.queues.join(", ")
            );
        }
        let why = match application.is_program() {
            true => "the wiring needs an input (quadrature, step, hall, digital-in, ssi, biss-c, sinc3, or spi) and an output (pwm, pwm3, sigma-delta, digital-out) that are connected to ports, the second of which depends on the first".to_owned(),
            false => format!("the links of {} lead from no input of the wiring (quadrature, step, hall, digital-in, ssi, biss-c, sinc3, spi) to an output of it (pwm, sigma-delta, digital-out)", files::input_name(&arguments.file)),
        };
        bail!("{name}: no path from pin to pin: {why}");
    }
    PinPathReport { application, board, wiring, ways }.write(arguments, out)
}

impl PinPathReport<'_> {
    fn write(&self, arguments: &Bound, out: &mut Out) -> Result<()> {
        if arguments.json {
            return files::json(&self.json(), out);
        }
        writeln!(
            out,
            "cycles from an edge at a pin to the first edge at a pin that follows: {} on {}, {} at {} MHz",
            files::input_name(&arguments.file),
            self.board.name,
            self.application.cores(),
            self.wiring.clock
        )?;
        let parts = self.ways.ways.iter().flat_map(|way| &way.between);
        let width = parts.map(|part| part.text.chars().count()).max().unwrap_or(0).max(WIDTH);
        let groups = match self.application.is_program() {
            true => Group::of_program(&self.ways.ways),
            false => Group::all(&self.ways.ways),
        };
        for group in groups {
            group.write(Table { clock: self.wiring.clock, width }, out)?;
        }
        let samples = samples(&self.wiring);
        if !samples.is_empty() {
            writeln!(out, "sampled")?;
        }
        for Sampling { peripheral, ports, text } in samples {
            writeln!(out, "  {peripheral} ({}): {text}", ports.join(", "))?;
        }
        for late in &self.ways.late {
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
        let way = |way: &PinPath| {
            let mut value = json!({
                "cores": way.cores, "links": way.links, "inputs": ends(&way.inputs), "between": parts(&way.between), "outputs": ends(&way.outputs),
                "total": way.total().as_ref().map(part),
                "total_to_modulator": way.total_to_modulator().as_ref().map(part),
                "is_certain": way.is_certain,
            });
            if let [Some(acts), Some(edge)] = [Until::Acts, Until::Edge].map(|until| way.from_sample(until)) {
                value["from_sample"] =
                    json!({ "until_it_acts": part(&acts), "to_its_first_edge": part(&edge) });
            }
            for (end, output) in way.outputs.iter().enumerate() {
                value["outputs"][end]["answer"] = json!(match output.answer {
                    Answer::Edge => "edge",
                    Answer::Density => "density",
                });
            }
            value
        };
        let sample =
            |of: &Sampling| json!({ "peripheral": of.peripheral, "ports": of.ports, "instant": of.text });
        json!({
            "samples": samples(&self.wiring).iter().map(sample).collect::<Vec<_>>(),
            "ways": self.ways.ways.iter().map(way).collect::<Vec<_>>(), "over_fifos": self.ways.queues,
            "deadlines_missed": self.ways.late, "board": self.board.name, "clock_mhz": self.wiring.clock,
            "period": self.wiring.period, "without_edges": self.ways.others,
        })
    }
}

/// Paths between inputs and outputs that differ only in their ends.
#[derive(Clone)]
struct Group {
    /// A representative path, with all inputs and outputs.
    way: PinPath,
    /// Names of the input pins.
    inputs: Vec<String>,
    /// Names of the output pins.
    outputs: Vec<String>,
    /// Names of the first links.
    first: Vec<String>,
    /// Names of the last links.
    last: Vec<String>,
    /// In a program: groups of ports with the outputs that follow them, unless all outputs follow all ports.
    ports: Vec<[Vec<String>; 2]>,
}

impl Group {
    fn all(ways: &[PinPath]) -> Vec<Group> {
        let names =
            |ends: &[End]| ends.iter().map(|end| format!("{} {}", end.peripheral, end.port)).collect();
        let alone = |way: &PinPath| Group {
            way: way.clone(),
            inputs: names(&way.inputs),
            outputs: names(&way.outputs),
            first: way.links.first().cloned().into_iter().collect(),
            last: way.links.last().cloned().into_iter().collect(),
            ports: Vec::new(),
        };
        let inner = |way: &PinPath| -> Vec<String> {
            way.links.get(1..way.links.len().saturating_sub(1)).unwrap_or_default().to_vec()
        };
        let alike = |a: &Group, b: &Group| {
            let [a, b] = [&a.way, &b.way];
            let key = |way: &PinPath| (way.periods.clone(), way.is_certain);
            (&a.cores, inner(a), &a.between, key(a)) == (&b.cores, inner(b), &b.between, key(b))
        };
        grouped(
            ways.iter().map(alone),
            alike,
            (
                |group| &group.inputs,
                |group, other| {
                    group.first.extend(other.first);
                    group.first.dedup();
                    group.inputs.extend(other.inputs);
                    group.way.inputs.extend(other.way.inputs);
                },
            ),
            (
                |group| &group.outputs,
                |group, other| {
                    group.last.extend(other.last);
                    group.last.dedup();
                    group.outputs.extend(other.outputs);
                    group.way.outputs.extend(other.way.outputs);
                },
            ),
        )
    }

    /// Groups the paths of a program, which share everything between their ends unless their states differ. Each set of states forms a
    /// group.
    fn of_program(ways: &[PinPath]) -> Vec<Group> {
        let mut groups: Vec<Group> = Vec::new();
        for group in Group::all(ways) {
            let [inputs, outputs] = [&group.way.inputs, &group.way.outputs];
            let ports = [inputs, outputs].map(|ends| ends.iter().map(|end| end.port.clone()).collect());
            let alike = |other: &&mut Group| {
                (&other.way.between, other.way.is_certain) == (&group.way.between, group.way.is_certain)
            };
            match groups.iter_mut().find(alike) {
                None => groups.push(Group { ports: vec![ports], ..group }),
                Some(other) => {
                    other.ports.push(ports);
                    let add = |ends: &mut Vec<End>, more: &[End]| {
                        let new: Vec<End> = more.iter().filter(|end| !ends.contains(end)).cloned().collect();
                        ends.extend(new);
                    };
                    add(&mut other.way.inputs, inputs);
                    add(&mut other.way.outputs, outputs);
                }
            }
        }
        groups
    }

    fn write(&self, table: Table, out: &mut Out) -> Result<()> {
        if let [_, _, ..] = self.ports[..] {
            writeln!(out, "which follows which")?;
            for [inputs, outputs] in &self.ports {
                writeln!(out, "  {} -> {}", inputs.join(", "), outputs.join(", "))?;
            }
        }
        let PinPath { cores, links, between, .. } = &self.way;
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
        totals.iter().flatten().try_for_each(|total| line(total, table, out))?;
        for total in [Until::Acts, Until::Edge].iter().filter_map(|until| self.way.from_sample(*until)) {
            line(&total, table, out)?;
            let jitter = total.worst - total.best;
            line(&Part { text: "  jitter".to_owned(), best: jitter, worst: jitter }, table, out)?;
        }
        if !self.way.is_certain {
            writeln!(
                out,
                "  not certain: branches or addresses of data memory can put the response off to later periods"
            )?;
        }
        Ok(())
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
