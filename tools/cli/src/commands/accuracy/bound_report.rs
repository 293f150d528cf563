// SPDX-License-Identifier: MIT OR Apache-2.0
//! Proved error bounds of a program, as text and as JSON.

use super::lines::{SHOWN_PARTS, by_line, line_text};
use crate::terminal::files::Out;
use crate::terminal::number::rounded;
use anyhow::Result;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::Write;
use takt_analysis::accuracy::{
    Converging, Enclosure, ErrorShare, Hazard, Interval, Moment, OutputBound, Problem, Relied, UnprovedRange,
};
use takt_isa::program::Location;
use takt_isa::{Instruction, Op, Program, Register, Type};

/// Proved error bounds of a program, ready for output.
pub(super) struct BoundReport<'a> {
    pub(super) program: &'a Program,
    pub(super) enclosure: &'a Enclosure,
}

fn ends_text(low: f64, high: f64) -> String {
    format!("[{}, {}]", rounded(low, 7), rounded(high, 7))
}

/// Units in the last place as text: hundredths where they matter.
pub(super) fn ulps_text(ulps: f64) -> String {
    if ulps < 1e4 { format!("{ulps:.2}") } else { rounded(ulps, 4) }
}

fn interval(interval: Option<Interval>) -> String {
    interval.map_or_else(|| "anywhere".to_owned(), |Interval { low, high }| ends_text(low, high))
}

/// Range of an output; a dash where a condition is missing.
fn shown_range(output: &OutputBound) -> String {
    output.range.map_or_else(|| "-".to_owned(), |range| interval(Some(range)))
}

/// Condition that excludes a hazard, as a source states it.
fn condition(problem: Problem) -> Option<&'static str> {
    Some(match problem {
        Problem::DivisionByZero => {
            "`max(x, least)` keeps a divisor from zero; `.assume x >= least` behind the operation that computes it says that it is never less"
        }
        Problem::Domain => {
            "`max(x, 0)` keeps the operand of a root, `sat(x, 1)` that of an arccosine where the function has a value; `.assume` says that it lies there"
        }
        Problem::Overflow => "a narrower `.range`, `sat(x, most)` or `.assume x <= most` limits the operands",
        Problem::Conversion => "`sat(x, 2^30)` limits the number that is converted",
        Problem::NotFinite | Problem::Output => {
            "a `.range` of the input, state or array that the value comes from"
        }
        Problem::Wrap => "a narrower `.range` of the integers, or `min` and `max`",
        Problem::Shift => "`min(max(n, 0), 31)` limits the amount",
        Problem::Address => "`min(max(i, first), last)` limits the index; `.range` says which values it has",
        Problem::Bits | Problem::Unbounded | Problem::Told => return None,
    })
}

impl BoundReport<'_> {
    pub(super) fn parts(&self, output: &OutputBound) -> Vec<(Option<Location>, f64, f64)> {
        let parts: Vec<ErrorShare> =
            output.parts.iter().map(|(word, error)| ErrorShare { word: *word, error: *error }).collect();
        by_line(self.program, &parts)
    }

    /// Places of the hazards that leave an output's range open.
    pub(super) fn open(&self, output: &OutputBound) -> Vec<String> {
        output.open.iter().map(|word| self.program.word_text(*word as usize)).collect()
    }

    /// Conditions without which an output has no bound, each with its place.
    pub(super) fn needed(&self, output: &OutputBound) -> Vec<String> {
        let hazards = self.enclosure.hazards.iter();
        let open =
            hazards.filter(|hazard| output.open.contains(&hazard.word) && !hazard.problem.is_defined());
        let needed = |hazard: &Hazard| {
            let place = self.program.word_text(hazard.word as usize);
            format!("bounded if {} at {place}", self.missing(hazard))
        };
        open.map(needed).collect()
    }

    /// Condition that a hazard's operation lacks, as a clause.
    fn missing(&self, hazard: &Hazard) -> String {
        let names: Vec<String> = self.operands(hazard).into_iter().map(|(name, _)| name).collect();
        let name = |names: Option<&String>| names.cloned().unwrap_or_else(|| "the operand".to_owned());
        let (first, last) = (name(names.first()), name(names.last()));
        let code = self.program.code.get(hazard.word as usize);
        let op = code.and_then(|word| Instruction::decode(*word).ok()).map(|instruction| instruction.op);
        match (hazard.problem, op) {
            (Problem::DivisionByZero, _) => format!("{last} is never 0"),
            (Problem::Domain, Some(Op::fsqrt)) => format!("{first} >= 0"),
            (Problem::Domain, Some(Op::facos)) => format!("{first} is within [-1, 1]"),
            (Problem::Domain, _) => format!("the function has a value for {first}"),
            (Problem::Overflow, _) => format!("{} has a limit", names.join(" or ")),
            (Problem::Bits, _) => format!("{first} is a number"),
            (Problem::Unbounded, _) => format!("{first} has a limit in the loop"),
            _ => format!("{first} is finite"),
        }
    }

    fn operands(&self, hazard: &Hazard) -> Vec<(String, Option<Interval>)> {
        let named = hazard.operands.iter();
        named.map(|(register, range)| (self.operand_text(*register, hazard.problem), *range)).collect()
    }

    /// Name of an operand; for a literal, its value.
    fn operand_text(&self, register: Register, problem: Problem) -> String {
        let Some(bits) = self.program.initial(register).filter(|_| self.is_literal(register)) else {
            return self.program.register_text(register);
        };
        // Small integers are subnormal numbers as floats.
        let is_integer = matches!(problem, Problem::Wrap | Problem::Shift | Problem::Address);
        match f32::from_bits(bits) {
            value if is_integer || value.is_subnormal() => bits.cast_signed().to_string(),
            value => format!("{value:?}"),
        }
    }

    /// The register holds a literal from the source.
    fn is_literal(&self, register: Register) -> bool {
        let is_named = self.program.named_registers().any(|port| port.register == register);
        self.program.initial(register).is_some() && !is_named
    }

    pub(super) fn json(&self) -> Value {
        let BoundReport { program, enclosure } = self;
        let ends = |interval: Option<Interval>| interval.map(|Interval { low, high }| [low, high]);
        let output = |output: &OutputBound| {
            let lines = self.parts(output).into_iter().map(|(location, error, share)| {
                json!({ "place": line_text(program, location), "error": error, "share": share })
            });
            json!({
                "name": output.name,
                "type": output.ty.name(),
                "range": ends(output.range),
                "error": output.error,
                "ulp": output.ulps(),
                "lines": lines.collect::<Vec<_>>(),
                "open": self.open(output),
            })
        };
        let hazard = |hazard: &Hazard| {
            let operands = self.operands(hazard).into_iter();
            let operands = operands.map(|(name, range)| json!({ "name": name, "range": ends(range) }));
            json!({
                "place": program.word_text(hazard.word as usize),
                "problem": hazard.problem.to_string(),
                "condition": condition(hazard.problem),
                "operands": operands.collect::<Vec<_>>(),
            })
        };
        let assumed = |UnprovedRange { range, moment, found }: &UnprovedRange| {
            json!({
                "name": range.name(program),
                "range": range.ends(),
                "when": match moment {
                    Moment::First => "first period begins",
                    Moment::Later => "period ends",
                },
                "found": ends(*found),
            })
        };
        let converging = |Converging { range, found }: &Converging| {
            let name = range.name(program);
            json!({ "name": name, "range": range.ends(), "found": ends(Some(*found)) })
        };
        let relied = |relied: &Relied| {
            json!({
                "place": program.word_text(relied.assumption.word as usize),
                "name": program.register_text(relied.register),
                "range": relied.assumption.ends(),
                "outputs": relied.outputs,
            })
        };
        json!({
            "machine": program.machine.name,
            "outputs": enclosure.outputs.iter().map(output).collect::<Vec<_>>(),
            "hazards": enclosure.hazards.iter().map(hazard).collect::<Vec<_>>(),
            "assumed": enclosure.assumed.iter().map(assumed).collect::<Vec<_>>(),
            "converging": enclosure.converging.iter().map(converging).collect::<Vec<_>>(),
            "relied": enclosure.relied.iter().map(relied).collect::<Vec<_>>(),
            "operations": enclosure.operations,
        })
    }

    pub(super) fn text(&self, out: &mut Out) -> Result<()> {
        let BoundReport { program, enclosure } = self;
        let machine = program.machine.name;
        writeln!(out, "one period on {machine}, all inputs and states in their ranges, the states exact")?;
        let outputs = &enclosure.outputs;
        let width = outputs.iter().map(|output| output.name.len()).max().unwrap_or(0).max(6);
        let wide = outputs.iter().map(|output| shown_range(output).len()).max().unwrap_or(0).max(5);
        let ulps = |output: &OutputBound| output.ulps().map_or_else(|| "-".to_owned(), ulps_text);
        let ulp_width = outputs.iter().map(|output| ulps(output).len()).max().unwrap_or(0).max(3);
        writeln!(
            out,
            "\n  {:<width$}  {:>wide$}  {:>11}  {:>ulp_width$}  most of it from",
            "output", "range", "error up to", "ulp"
        )?;
        for output in outputs {
            let error = output.error.map_or_else(|| "-".to_owned(), |error| rounded(error, 4));
            let ulps = ulps(output);
            let lines = self.parts(output);
            let lines = lines.iter().take(SHOWN_PARTS);
            // A part below half a percent would read "0 %".
            let lines = lines.filter(|(_, _, share)| *share >= 0.005 || *share == 0.0);
            let lines =
                lines.map(|(at, _, share)| format!("{} ({:.0} %)", line_text(program, *at), 100.0 * share));
            let open = self.needed(output);
            let lines: Vec<String> = match open.first() {
                Some(first) if open.len() > 1 => {
                    vec![format!("{first} and {} more", open.len() - 1)]
                }
                Some(first) => vec![first.clone()],
                None => lines.collect(),
            };
            let range = shown_range(output);
            writeln!(
                out,
                "  {:<width$}  {range:>wide$}  {error:>11}  {ulps:>ulp_width$}  {}",
                output.name,
                lines.join(", ")
            )?;
        }
        writeln!(out, "  ulp: of the largest value in the range")?;
        if outputs.iter().any(|output| output.ty == Type::I) {
            writeln!(out, "  an integer has no error: it counts as a decision of the run")?;
        }
        if enclosure.hazards.is_empty() {
            writeln!(
                out,
                "\nno NaN, no overflow, no division by zero, no conversion out of range is possible\n\
                 no integer sum wraps, no shift and no index is out of range"
            )?;
        } else {
            writeln!(out, "\nnot excluded (operations that depend on these are not examined)")?;
        }
        for hazard in &enclosure.hazards {
            let shown = |(register, range): &(Register, Option<Interval>)| match self
                .operand_text(*register, hazard.problem)
            {
                literal if self.is_literal(*register) => literal,
                name => format!("{name} in {}", interval(*range)),
            };
            let operands: Vec<String> = hazard.operands.iter().map(shown).collect();
            let what = hazard.problem;
            writeln!(out, "  {}: {what}: {}", program.word_text(hazard.word as usize), operands.join(", "))?;
        }
        let problems: BTreeSet<Problem> = enclosure.hazards.iter().map(|hazard| hazard.problem).collect();
        let conditions: Vec<&str> = problems.into_iter().filter_map(condition).collect();
        if !conditions.is_empty() {
            writeln!(out, "\nconditions that exclude these")?;
        }
        conditions.iter().try_for_each(|condition| writeln!(out, "  {condition}"))?;
        let states = |UnprovedRange { range, found, .. }: &UnprovedRange, found_text: &str, out: &mut Out| {
            let (low, high) = range.ends();
            let name = range.name(program);
            let found =
                found.map_or_else(|| "anywhere".to_owned(), |found| format!("in {}", interval(Some(found))));
            writeln!(out, "  {name}: {}, {found_text} {found}", ends_text(low, high))
        };
        if enclosure.first().next().is_some() {
            writeln!(
                out,
                "\nstates not shown to begin the first period in their range; then nothing above holds"
            )?;
        }
        enclosure.first().try_for_each(|state| states(state, "begins", out))?;
        if !enclosure.converging.is_empty() {
            writeln!(out, "\nkept by all periods together, whose linear part converges")?;
        }
        for Converging { range, found } in &enclosure.converging {
            let (low, high) = range.ends();
            let name = range.name(program);
            writeln!(out, "  {name}: {}, always in {}", ends_text(low, high), interval(Some(*found)))?;
        }
        if !enclosure.relied.is_empty() {
            writeln!(out, "\nrelied on, as the source assumes (`takt run --deny range` checks it)")?;
        }
        for Relied { assumption, register, outputs } in &enclosure.relied {
            let name = program.register_text(*register);
            let bounds = assumption.bounds().into_iter().map(|(sign, end)| format!("{name} {sign} {end}"));
            let bounds = bounds.collect::<Vec<_>>().join(", ");
            let place = program.word_text(assumption.word as usize);
            writeln!(out, "  {place}: {bounds}, for {}", outputs.join(", "))?;
        }
        if enclosure.later().next().is_some() {
            writeln!(out, "\nranges that a period is not shown to keep; they are taken as promised")?;
        }
        enclosure.later().try_for_each(|state| states(state, "may be left", out))?;
        Ok(())
    }
}
