// SPDX-License-Identifier: MIT OR Apache-2.0
//! Warnings at the operations where bounds are lost: ranges and errors of operands and result, in the bound and in the run, and the rewriting
//! that keeps the bound.

use super::comparison::{Compared, Comparison};
use super::lines::location;
use crate::run::load::in_folder;
use crate::run::loaded_program::LoadedProgram;
use crate::terminal::number::rounded;
use std::collections::BTreeMap;
use std::sync::Arc;
use takt_analysis::accuracy::{Extent, Interval, Loss, Seen, loss};
use takt_asm::diag::{Diagnostic, Diagnostics};
use takt_asm::source::{Sources, Span};
use takt_isa::{Instruction, Op, Program};

/// Factor between a bound and what was measured from which a bound counts as lost.
const LOOSE: f64 = 100.0;
/// Factor between the range of an operand and its values in the run from which the range is named as the cause.
const WIDE: f64 = 4.0;
/// Part of the factor that one operation must make to be named alone.
const MAIN: f64 = 10.0;

/// Outputs with the loss that they share, by the word of its operation.
type Losses<'a> = BTreeMap<u32, (Vec<&'a Compared<'a>>, Loss<'a>)>;

/// A warning for each operation at which bounds are lost.
pub(super) fn warnings(comparison: &Comparison<'_>) -> Vec<Diagnostics> {
    let outputs: Vec<Compared<'_>> = comparison.outputs().collect();
    let mut losses: Losses<'_> = BTreeMap::new();
    for output in &outputs {
        let is_open = output.bound.error.is_none();
        if !is_open && output.factor.is_none_or(|factor| factor <= LOOSE) {
            continue;
        }
        let Some(loss) = loss(comparison.enclosure, comparison.shadow, output.bound) else { continue };
        losses.entry(loss.word).or_insert((Vec::new(), loss)).0.push(output);
    }
    losses.into_values().filter_map(|(outputs, loss)| warning(comparison, &outputs, &loss)).collect()
}

fn warning(comparison: &Comparison<'_>, outputs: &[&Compared<'_>], loss: &Loss<'_>) -> Option<Diagnostics> {
    let program = comparison.program();
    let instruction = Instruction::decode(*program.code.get(loss.word as usize)?).ok()?;
    let problems = comparison.enclosure.hazards.iter();
    let problem = problems.filter(|hazard| hazard.word == loss.word).map(|hazard| hazard.problem).min();
    let named: Vec<String> = outputs.iter().map(|output| format!("`{}`", output.bound.name)).collect();
    let of = named.join(", ");
    let factor = outputs.iter().filter_map(|output| output.factor).fold(0.0, f64::max);
    let several = outputs.len() > 1;
    let message = match problem {
        Some(problem) if loss.gain.is_infinite() => format!("no bound for {of}: {problem}"),
        _ => {
            let (bounds, is) = if several { ("bounds", "are up to") } else { ("bound", "is") };
            format!("the {bounds} of {of} {is} {} times the error of this run", rounded(factor, 3))
        }
    };
    let words = Words { program, instruction, loss };
    let mut diagnostic =
        Diagnostic::warning("lost-bound", Span::default(), message).here(words.here()).help(words.mend());
    diagnostic.notes = words.notes();
    Some(placed(diagnostic, comparison.loaded, loss.word))
}

/// The diagnostic at the place of a word in its source, or without a place if the source is not known.
fn placed(mut diagnostic: Diagnostic, loaded: &LoadedProgram, word: u32) -> Diagnostics {
    let program = &loaded.program;
    let line = location(program, word)
        .and_then(|location| takt_debug::fault::line(program, location, &loaded.sources));
    let sources = match line {
        Some((sources, span)) => {
            diagnostic.labels.iter_mut().for_each(|label| label.span = part(program, word, &sources, span));
            sources
        }
        None => {
            diagnostic.message = format!("{}: {}", program.word_text(word as usize), diagnostic.message);
            diagnostic.notes.extend(diagnostic.labels.drain(..).map(|label| label.message));
            Sources::default()
        }
    };
    let told = Diagnostics { sources: Arc::new(sources), list: vec![diagnostic], ..Diagnostics::default() };
    in_folder(&loaded.folder, told)
}

/// Part of a statement that a word computes.
fn part(program: &Program, word: u32, sources: &Sources, statement: Span) -> Span {
    let columns = program.part(word as usize);
    let Some((columns, file)) = columns.zip(sources.files().first()) else { return statement };
    let start = file.text[..statement.start as usize].rfind('\n').map_or(0, |at| at + 1);
    let at = |column: u32| {
        let line = file.text[start..].char_indices().map(|(at, _)| at);
        line.skip(column as usize).map(|at| (start + at) as u32).next()
    };
    match (at(columns.first.saturating_sub(1)), at(columns.last)) {
        (Some(first), Some(last)) if first < last => Span::new(first, last),
        _ => statement,
    }
}

/// Text about an operation at which a bound is lost.
struct Words<'l> {
    program: &'l Program,
    instruction: Instruction,
    loss: &'l Loss<'l>,
}

fn ends(range: Interval) -> String {
    if range.low == range.high {
        return rounded(range.low, 4);
    }
    format!("[{}, {}]", rounded(range.low, 4), rounded(range.high, 4))
}

/// A number of one digit below a number, or above it.
fn round(value: f64, up: bool) -> f64 {
    let digit = 10f64.powf(value.abs().log10().floor());
    let digits = value / digit;
    let whole = if up { digits.ceil() } else { digits.floor() };
    // Printed and read again, so that no digits follow the first.
    rounded(whole * digit, 1).parse().unwrap_or(value)
}

impl Words<'_> {
    /// Values of an operand; of the result, whose number follows those of the operands.
    fn bound(&self, value: usize) -> Extent {
        let operand = self.loss.bound.operands.get(value);
        operand.map_or(self.loss.bound.result, |operand| operand.extent)
    }

    /// The same as the run shows them.
    fn seen(&self, value: usize) -> Seen {
        if value == self.operands() { self.loss.seen.result } else { self.loss.seen.reads[value] }
    }

    fn operands(&self) -> usize {
        self.loss.bound.operands.len()
    }

    /// Name of a value in the source. The register of several values has numbers behind the name.
    fn source_name(&self, value: usize) -> Option<&str> {
        let register = match self.instruction.reads().get(value) {
            Some(register) if value < self.operands() => *register,
            _ => {
                let slot = self.loss.word as usize % self.program.machine.slots.len();
                self.instruction.writes(&self.program.machine.slots[slot])?
            }
        };
        let name = &self.program.named_registers().find(|port| port.register == register)?.name;
        let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        Some(name.rsplit_once('.').filter(|(_, number)| is_number(number)).map_or(name, |(name, _)| name))
    }

    /// Name of a value in the source; for one without a name, its part in the operation.
    fn name(&self, value: usize) -> String {
        let role = match (self.instruction.op, value) {
            _ if value == self.operands() => "the result",
            (Op::fdiv, 0) => "the dividend",
            (Op::fdiv, _) => "the divisor",
            _ if self.operands() == 1 => "the operand",
            (_, 0) => "the first operand",
            (_, 1) => "the second operand",
            _ => "the third operand",
        };
        self.source_name(value).map_or_else(|| role.to_owned(), |name| format!("`{name}`"))
    }

    /// Text for a value in a rewriting.
    fn short(&self, value: usize) -> &str {
        self.source_name(value).unwrap_or("x")
    }

    fn here(&self) -> String {
        let error = |error: Option<f64>| error.map_or_else(|| "any".to_owned(), |error| rounded(error, 3));
        let into: Vec<Option<f64>> =
            self.loss.bound.operands.iter().map(|operand| operand.extent.error).collect();
        let most = into.iter().copied().reduce(|a, b| a.zip(b).map(|(a, b)| a.max(b))).flatten();
        let out = self.loss.bound.result.error;
        let mnemonic = self.instruction.op.row().mnemonic;
        match out {
            None => format!("{mnemonic}: error up to {} in, no bound out", error(most)),
            Some(_) => format!("{mnemonic}: error up to {} in, {} out", error(most), error(out)),
        }
    }

    /// Ranges and errors of operands and result, as bounded and as the run shows them.
    fn notes(&self) -> Vec<String> {
        let text = |what: String, bound: Extent, seen: Seen| {
            let range = bound.range.map_or_else(|| "no known range".to_owned(), ends);
            let error = |error: f64| {
                if error == 0.0 { "exact".to_owned() } else { format!("error up to {}", rounded(error, 3)) }
            };
            let of_bound = bound.error.map_or_else(|| "error not bounded".to_owned(), error);
            let run = seen.range.map_or_else(
                || "not in this run".to_owned(),
                |range| format!("in this run {}, {}", ends(range), error(seen.error)),
            );
            format!("{what} in {range}, {of_bound}; {run}")
        };
        let values = (0..=self.operands()).filter_map(|value| {
            let bound = self.bound(value);
            let is_constant = bound.range.is_some_and(|range| range.low == range.high);
            let what = if value == self.operands() { "result".to_owned() } else { self.name(value) };
            (!is_constant || value == self.operands()).then(|| text(what, bound, self.seen(value)))
        });
        let spread = self.loss.factor / self.loss.gain > MAIN && self.loss.gain < MAIN;
        let rest = spread.then(|| {
            format!(
                "the factor grows by {} here, and by less at each of the other operations on the way",
                rounded(self.loss.gain, 2)
            )
        });
        values.chain(rest).collect()
    }

    /// Least magnitude of an operand in the run, rounded down, with its sign there, if the bound must expect much smaller ones.
    fn least(&self, operand: usize) -> Option<f64> {
        let seen = self.seen(operand).range?;
        let least = magnitudes(seen).low;
        let known = self.bound(operand).range.map_or(0.0, |range| magnitudes(range).low);
        let signed = |least: f64| if seen.low < 0.0 { -least } else { least };
        (least > 0.0 && known < least / 2.0).then(|| signed(round(least, false)))
    }

    /// Operand or result whose range exceeds its values in the run most, with their largest magnitude, rounded up.
    fn widest(&self) -> Option<(usize, f64)> {
        let wide = |value: usize| {
            let seen = self.seen(value).range?.magnitude();
            let known = self.bound(value).range.map_or(f64::INFINITY, Interval::magnitude);
            Some((value, known / seen, seen)).filter(|(_, factor, seen)| *factor > WIDE && *seen > 0.0)
        };
        let values = (0..=self.operands()).filter_map(wide);
        let (value, _, seen) = values.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((value, round(seen, true)))
    }

    /// The rewriting that keeps the bound.
    fn mend(&self) -> String {
        let number = |value: f64| rounded(value, 1);
        let away = |operand: usize, least: f64| {
            let (name, x) = (self.name(operand), self.short(operand));
            let (below, max, sign) =
                if least < 0.0 { ("above", "min", "<=") } else { ("below", "max", ">=") };
            let least = number(least);
            format!(
                "{name} is never {below} {least} in this run: `{max}({x}, {least})` keeps it there, or `.assume {x} {sign} {least}` says that it is"
            )
        };
        let within = |(value, most): (usize, f64)| {
            let (x, most) = (self.short(value), number(most));
            // An operand and the result may have the same name.
            let name = match self.source_name(value).filter(|_| value == self.operands()) {
                Some(name) => format!("the result `{name}`"),
                None => self.name(value),
            };
            let is_signed = self.seen(value).range.is_some_and(|range| range.low < 0.0);
            let below = if is_signed { format!("`.assume {x} >= -{most}` and ") } else { String::new() };
            format!(
                "{name} is never beyond {most} in this run: a narrower `.range`, `sat({x}, {most})`, or {below}`.assume {x} <= {most}` limits it"
            )
        };
        let wide = || self.widest().map(within);
        match self.instruction.op {
            Op::fdiv => {
                let steep = "a quotient is as steep as its divisor is small";
                match self.least(1).map(|least| away(1, least)).or_else(wide) {
                    Some(text) => format!("{steep}; {text}"),
                    None => format!("{steep}; `max(x, least)` keeps the divisor from zero, or `.assume x >= least` says that it is"),
                }
            }
            Op::fsqrt => {
                let steep = "a root is infinitely steep at zero";
                match self.least(0) {
                    Some(least) => format!("{steep}; {}", away(0, least)),
                    None => format!("{steep}; `sqrt(max(x, least))` with the least that matters is not"),
                }
            }
            Op::fatan2 => "an angle jumps by a turn on one side of the origin; a narrower `.range` that leaves out that side, or the angle's distance from another by `wrap`, does not".to_owned(),
            Op::facos => "an arccosine is infinitely steep at -1 and 1; `atan2` of two sides is not".to_owned(),
            Op::fsign => "a sign jumps at zero; `sat(x/least, 1)` does not".to_owned(),
            _ => wide().unwrap_or_else(|| {
                "errors that cancel in the run add up in the bound; a narrower `.range` of what the operands depend on, or `sat` of the result, limits them".to_owned()
            }),
        }
    }
}

fn magnitudes(range: Interval) -> Interval {
    let (low, high) = (range.low.abs(), range.high.abs());
    let least = if range.low <= 0.0 && range.high >= 0.0 { 0.0 } else { low.min(high) };
    Interval { low: least, high: low.max(high) }
}
