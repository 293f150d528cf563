// SPDX-License-Identifier: MIT OR Apache-2.0
//! Measured errors of a program beside their bounds, and the operations at which bounds are lost.

use super::bound_report::BoundReport;
use super::lines::{SHOWN_PARTS, line_text};
use super::lost;
use crate::run::loaded_program::LoadedProgram;
use crate::terminal::files::Out;
use crate::terminal::number::rounded;
use anyhow::Result;
use serde_json::{Value, json};
use std::io::Write;
use takt_analysis::accuracy::{Enclosure, OutputBound, Shadow};
use takt_asm::diag::Diagnostics;
use takt_isa::Program;

/// Errors of a run, each period alone, beside their bounds.
pub(super) struct Comparison<'a> {
    pub(super) loaded: &'a LoadedProgram,
    pub(super) shadow: &'a Shadow,
    pub(super) enclosure: &'a Enclosure,
}

/// An output of both.
pub(super) struct Compared<'a> {
    pub(super) bound: &'a OutputBound,
    pub(super) measured: Option<f64>,
    /// The bound over what was measured, if neither is missing or zero.
    pub(super) factor: Option<f64>,
}

impl Comparison<'_> {
    pub(super) fn program(&self) -> &Program {
        &self.loaded.program
    }

    pub(super) fn outputs(&self) -> impl Iterator<Item = Compared<'_>> {
        self.shadow.outputs().iter().filter_map(|output| {
            let bound = self.enclosure.outputs.iter().find(|bound| bound.place == output.place)?;
            let measured = output.absolute.map(|worst| worst.error);
            let factor = bound.error.zip(measured).map(|(bound, measured)| bound / measured);
            Some(Compared { bound, measured, factor: factor.filter(|factor| factor.is_finite()) })
        })
    }

    /// Adds the bounds to the results of a measurement, and the operations at which they are lost.
    pub(super) fn add_to(&self, measurement: &mut Value) {
        let bounds = self.outputs().map(|Compared { bound, measured, factor }| {
            json!({ "name": bound.name, "measured": measured, "error": bound.error, "factor": factor })
        });
        measurement["bounds"] = bounds.collect();
        let messages: Vec<Value> = lost::warnings(self)
            .iter()
            .flat_map(Diagnostics::messages)
            .map(|message| json!(message))
            .collect();
        measurement["lost"] = messages.into();
    }

    pub(super) fn text(&self, out: &mut Out) -> Result<()> {
        let program = self.program();
        let report = BoundReport { program, enclosure: self.enclosure };
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
                format!("{} ({:.0} %)", line_text(program, *location), 100.0 * share)
            });
            let from = match bound.error {
                None => report.needed(bound).join(", "),
                Some(_) => from.collect::<Vec<_>>().join(", "),
            };
            let (measured, most) = (number(*measured), number(bound.error));
            writeln!(out, "  {:<width$}  {measured:>12} {most:>12} {factor:>10}  {from}", bound.name)?;
        }
        let lost = lost::warnings(self);
        if !lost.is_empty() {
            writeln!(out, "\nwhere bounds are lost\n")?;
        }
        lost.iter().try_for_each(|warning| Ok(write!(out, "{}", warning.render(false))?))
    }
}
