// SPDX-License-Identifier: MIT OR Apache-2.0
//! Measured errors of a program, as text and as JSON.

use super::bound_report::ulps_text;
use super::lines::{SHOWN, SHOWN_PARTS, by_line, line_text, location};
use crate::terminal::files::Out;
use crate::terminal::number::rounded;
use anyhow::Result;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use takt_analysis::accuracy::{
    Decision, ErrorShare, LargestError, LostComparison, OperationAccuracy, OutputAccuracy, Shadow,
};
use takt_isa::program::Location;
use takt_isa::{Program, Type};

/// Accuracy of a source line, over all its operations.
#[derive(Default)]
pub(crate) struct LineAccuracy {
    accuracy: OperationAccuracy,
    /// Largest contribution of the line to an output's worst error, and that output.
    share: f64,
    output: Option<String>,
}

/// Measured errors of a program, ready for output.
pub(crate) struct MeasurementReport<'a> {
    program: &'a Program,
    shadow: &'a Shadow,
}

impl<'a> MeasurementReport<'a> {
    pub(crate) fn new(program: &'a Program, shadow: &'a Shadow) -> MeasurementReport<'a> {
        MeasurementReport { program, shadow }
    }

    fn by_line(&self, parts: &[ErrorShare]) -> Vec<(Option<Location>, f64, f64)> {
        by_line(self.program, parts)
    }

    fn place(&self, word: u32) -> String {
        self.program.word_text(word as usize)
    }

    /// Source lines with their accuracy, sorted by contribution to an output's error, largest first.
    pub(crate) fn lines(&self) -> Vec<(Location, LineAccuracy)> {
        let mut lines: BTreeMap<(u32, u32), (Location, LineAccuracy)> = BTreeMap::new();
        for (&word, operation) in self.shadow.operations() {
            let Some(location) = location(self.program, word) else { continue };
            let entry =
                lines.entry((location.file, location.line)).or_insert((location, LineAccuracy::default()));
            let known = &mut entry.1.accuracy;
            known.count += operation.count;
            known.rounding = known.rounding.max(operation.rounding);
            known.absorbed += operation.absorbed;
            if operation.cancelled > known.cancelled {
                (known.cancelled, known.cancelled_in) = (operation.cancelled, operation.cancelled_in);
            }
        }
        for output in self.shadow.outputs() {
            for (location, _, share) in self.by_line(&output.parts) {
                let Some(location) = location else { continue };
                let entry = lines.entry((location.file, location.line));
                let line = &mut entry.or_insert((location, LineAccuracy::default())).1;
                if share > line.share {
                    (line.share, line.output) = (share, Some(output.name.clone()));
                }
            }
        }
        let mut lines: Vec<_> = lines.into_values().collect();
        lines.sort_by(|a, b| b.1.share.total_cmp(&a.1.share));
        lines
    }

    fn line_text(&self, location: Option<Location>) -> String {
        line_text(self.program, location)
    }

    /// Results as JSON, without the program's name.
    pub(crate) fn json(&self) -> Value {
        let worst = |worst: Option<LargestError>| {
            worst.map(|LargestError { error, period, value, exact }| {
                json!({ "error": error, "period": period, "value": value, "exact": exact })
            })
        };
        let output = |output: &OutputAccuracy| {
            let from = self.by_line(&output.parts).into_iter().map(|(location, error, share)| {
                json!({ "place": self.line_text(location), "error": error, "share": share })
            });
            let operations = output.parts.iter();
            let operations =
                operations.map(|part| json!({ "place": self.place(part.word), "error": part.error }));
            json!({
                "name": output.name,
                "periods": output.periods,
                "absolute": worst(output.absolute),
                "ulp": worst(output.ulp),
                "relative": worst(output.relative),
                "lines": from.collect::<Vec<_>>(),
                "operations": operations.collect::<Vec<_>>(),
            })
        };
        let line = |(location, line): (Location, LineAccuracy)| {
            let OperationAccuracy { count, rounding, cancelled, cancelled_in, absorbed, .. } = line.accuracy;
            json!({
                "place": self.program.place_text(location),
                "operations": count,
                "rounding_ulp": rounding,
                "cancelled_digits": cancelled,
                "cancelled_in": (cancelled > 0.0).then_some(cancelled_in),
                "absorbed": absorbed,
                "share": line.share,
                "output": line.output,
            })
        };
        let decision = |(&word, decision): (&u32, &Decision)| json!({ "place": self.place(word), "count": decision.count, "period": decision.period });
        let lost = |(&word, lost): (&u32, &LostComparison)| {
            let why = if lost.infinite { "no finite number" } else { "taken as bits" };
            json!({ "place": self.place(word), "why": why, "count": lost.count, "period": lost.period })
        };
        json!({
            "machine": self.program.machine.name,
            "periods": self.shadow.periods(),
            "outputs": self.shadow.outputs().iter().map(output).collect::<Vec<_>>(),
            "lines": self.lines().into_iter().map(line).collect::<Vec<_>>(),
            "decisions": self.shadow.decisions().iter().map(decision).collect::<Vec<_>>(),
            "lost": self.shadow.lost().iter().map(lost).collect::<Vec<_>>(),
        })
    }

    pub(crate) fn text(&self, each_period: bool, out: &mut Out) -> Result<()> {
        let MeasurementReport { program, shadow } = self;
        let periods = shadow.periods();
        let plural = if periods == 1 { "" } else { "s" };
        let alone = if each_period { ", each period alone" } else { "" };
        writeln!(out, "{periods} period{plural} on {} beside binary64{alone}", program.machine.name)?;
        let outputs = shadow.outputs();
        let width = outputs.iter().map(|output| output.name.len()).max().unwrap_or(0).max(6);
        writeln!(out, "\nlargest error of each output, and its period")?;
        writeln!(
            out,
            "  {:<width$}  {:>10} {:>7}  {:>10} {:>7}  {:>10} {:>7}",
            "output", "absolute", "period", "ulp", "period", "relative", "period"
        )?;
        for output in outputs {
            let cell = |worst: Option<LargestError>, ulps: bool| match worst {
                Some(LargestError { error, period, .. }) if ulps => {
                    format!("{:>10} {period:>7}", ulps_text(error))
                }
                Some(LargestError { error, period, .. }) => format!("{:>10} {period:>7}", rounded(error, 4)),
                None => format!("{:>10} {:>7}", "-", "-"),
            };
            let [absolute, ulp, relative] =
                [(output.absolute, false), (output.ulp, true), (output.relative, false)]
                    .map(|(worst, ulps)| cell(worst, ulps));
            writeln!(out, "  {:<width$}  {absolute}  {ulp}  {relative}", output.name)?;
        }
        let others = program.outputs.iter().filter(|port| port.ty != Type::F).count();
        if others > 0 {
            writeln!(out, "  {others} more carry integers or bits")?;
        }

        writeln!(out, "\nlines that the largest absolute errors come from")?;
        for output in outputs {
            let lines = self.by_line(&output.parts);
            let shown = lines.iter().take(SHOWN_PARTS).map(|(location, error, share)| {
                format!("{} {error:+.2e} ({:.0} %)", self.line_text(*location), 100.0 * share)
            });
            let shown: Vec<String> = shown.collect();
            let shown = if shown.is_empty() { "exact".to_owned() } else { shown.join(", ") };
            writeln!(out, "  {:<width$}  {shown}", output.name)?;
        }

        let lines = self.lines();
        let places: Vec<String> =
            lines.iter().map(|(location, _)| program.place_text(*location)).take(SHOWN).collect();
        let wide = places.iter().map(String::len).max().unwrap_or(0).max(4);
        writeln!(out, "\nerrors by source line, the largest contribution to an output's error first")?;
        writeln!(
            out,
            "  {:<wide$}  {:>14}  {:>11}  {:>9}  {:>7}  share of",
            "line", "rounding (ulp)", "cancels", "in period", "absorbs"
        )?;
        for ((_, line), place) in lines.iter().zip(&places) {
            let OperationAccuracy { rounding, cancelled, cancelled_in, absorbed, .. } = line.accuracy;
            let cancels = if cancelled > 0.0 { format!("{cancelled:.1} digits") } else { "-".to_owned() };
            let period = if cancelled > 0.0 { cancelled_in.to_string() } else { "-".to_owned() };
            let share = line.output.as_ref();
            let share = share.map_or(String::new(), |name| format!("{:.0} % of {name}", 100.0 * line.share));
            let row = format!(
                "  {place:<wide$}  {rounding:>14.3}  {cancels:>11}  {period:>9}  {absorbed:>7}  {share}"
            );
            writeln!(out, "{}", row.trim_end())?;
        }
        if lines.len() > SHOWN {
            writeln!(out, "  and {} more (--json has all)", lines.len() - SHOWN)?;
        }

        if !shadow.decisions().is_empty() {
            writeln!(out, "\ndecisions that differ in binary64 (which follows the run's decisions)")?;
        }
        for (&word, decision) in shadow.decisions().iter().take(SHOWN) {
            let (count, period) = (decision.count, decision.period);
            writeln!(out, "  {}: {count} times, first in period {period}", self.place(word))?;
        }
        if !shadow.lost().is_empty() {
            writeln!(out, "\nerrors are not followed any further at")?;
        }
        for (&word, lost) in shadow.lost().iter().take(SHOWN) {
            let why =
                if lost.infinite { "a result that is not a finite number" } else { "a value taken as bits" };
            let (count, period) = (lost.count, lost.period);
            writeln!(out, "  {}: {why}, {count} times, first in period {period}", self.place(word))?;
        }
        Ok(())
    }
}
