// SPDX-License-Identifier: MIT OR Apache-2.0
//! Measured errors of a program beside their bounds.

use super::bound_report::BoundReport;
use super::lines::{SHOWN_PARTS, line_text, location};
use crate::terminal::files::Out;
use crate::terminal::number::rounded;
use anyhow::Result;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::Write;
use takt_analysis::accuracy::{Enclosure, OutputBound, Shadow};
use takt_isa::{Instruction, Op, Program};

/// Factor between a bound and what was measured from which the text says what makes the bound.
const LOOSE: f64 = 100.0;

/// Errors of a run, each period alone, beside their bounds.
pub(super) struct Comparison<'a> {
    pub(super) program: &'a Program,
    pub(super) shadow: &'a Shadow,
    pub(super) enclosure: &'a Enclosure,
}

/// An output of both.
struct Compared<'a> {
    bound: &'a OutputBound,
    measured: Option<f64>,
    /// The bound over what was measured, if neither is missing or zero.
    factor: Option<f64>,
}

impl Comparison<'_> {
    fn outputs(&self) -> impl Iterator<Item = Compared<'_>> {
        self.shadow.outputs().iter().filter_map(|output| {
            let bound = self.enclosure.outputs.iter().find(|bound| bound.place == output.place)?;
            let measured = output.absolute.map(|worst| worst.error);
            let factor = bound.error.zip(measured).map(|(bound, measured)| bound / measured);
            Some(Compared { bound, measured, factor: factor.filter(|factor| factor.is_finite()) })
        })
    }

    /// The operation that contributes most to a bound, or a steep one in its line.
    fn operation(&self, bound: &OutputBound) -> Option<(u32, Op)> {
        let (word, _) = *bound.parts.first()?;
        let op = |word: u32| {
            let instruction = Instruction::decode(*self.program.code.get(word as usize)?).ok()?;
            Some((word, instruction.op))
        };
        let line = location(self.program, word);
        let words = 0..self.program.code.len() as u32;
        let of_line = words.filter(|other| line.is_some() && location(self.program, *other) == line);
        of_line.filter_map(op).find(|(_, op)| steep(*op).is_some()).or_else(|| op(word))
    }

    /// Adds the bounds to the results of a measurement.
    pub(super) fn add_to(&self, measurement: &mut Value) {
        let bounds = self.outputs().map(|Compared { bound, factor, .. }| {
            json!({ "name": bound.name, "error": bound.error, "factor": factor })
        });
        measurement["bounds"] = bounds.collect();
    }

    pub(super) fn text(&self, out: &mut Out) -> Result<()> {
        let report = BoundReport { program: self.program, enclosure: self.enclosure };
        let outputs: Vec<Compared<'_>> = self.outputs().collect();
        let width = outputs.iter().map(|output| output.bound.name.len()).max().unwrap_or(0).max(6);
        writeln!(
            out,
            "\nlargest error of each output beside its bound: of this run, and of all with the ranges in the source"
        )?;
        writeln!(
            out,
            "  {:<width$}  {:>12} {:>12} {:>10}  most of the bound from",
            "output", "measured", "at most", "factor"
        )?;
        for Compared { bound, measured, factor } in &outputs {
            let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| rounded(value, 4));
            let factor = factor.map_or_else(|| "-".to_owned(), |factor| rounded(factor, 3));
            let parts = report.parts(bound);
            let from = parts.iter().take(SHOWN_PARTS).map(|(location, _, share)| {
                format!("{} ({:.0} %)", line_text(self.program, *location), 100.0 * share)
            });
            let from = match bound.error {
                None => format!("open by {}", report.open(bound).join(", ")),
                Some(_) => from.collect::<Vec<_>>().join(", "),
            };
            let (measured, most) = (number(*measured), number(bound.error));
            writeln!(out, "  {:<width$}  {measured:>12} {most:>12} {factor:>10}  {from}", bound.name)?;
        }
        let loose = outputs.iter().filter(|output| output.factor.is_some_and(|factor| factor > LOOSE));
        let made = loose.filter_map(|output| self.operation(output.bound));
        let told: BTreeSet<(String, &str)> = made
            .filter_map(|(word, op)| Some((self.program.word_text(word as usize), advice(op)?)))
            .collect();
        if !told.is_empty() {
            writeln!(out, "\nbounds of more than {LOOSE} times the error of this run are made by")?;
        }
        for (place, advice) in told {
            writeln!(out, "  {place}: {advice}")?;
        }
        Ok(())
    }
}

/// Cause of large errors at an operation, and the mend.
fn advice(op: Op) -> Option<&'static str> {
    let arithmetic = [Op::fadd, Op::fsub, Op::fmul, Op::fma, Op::fms, Op::fnma, Op::fnms];
    let grows = "a rounding error that grows on the way to the output, by wide factors, or by a root or a quotient near zero; a narrower \
                 `.range`, `sat` or `max(x, least)` bounds them";
    steep(op).or_else(|| arithmetic.contains(&op).then_some(grows))
}

/// The same for functions that have a point at which they are infinitely steep, or jump.
fn steep(op: Op) -> Option<&'static str> {
    Some(match op {
        Op::fsqrt => {
            "a root, which is infinitely steep at zero; `sqrt(max(x, least))` with the least that matters is not"
        }
        Op::fdiv => {
            "a quotient, as steep as its divisor is small; `max(x, least)` keeps the divisor from zero, or `.assume x >= least` says that it is"
        }
        Op::fatan2 => {
            "an angle, which jumps by a turn on one side of the origin; a narrower `.range` that leaves out that side, or the sine of a difference of angles, does not"
        }
        Op::facos => "an arccosine, which is infinitely steep at -1 and 1; `atan2` of two sides is not",
        Op::fsign => "a sign, which jumps at zero; `sat(x/least, 1)` does not",
        _ => return None,
    })
}
