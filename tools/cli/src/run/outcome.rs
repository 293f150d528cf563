// SPDX-License-Identifier: MIT OR Apache-2.0
//! Outcome of `takt run`, as text and as JSON: for each core, and for the links of a system.

use crate::run::account::Account;
use crate::run::deny::Denials;
use crate::run::nan::NanWrites;
use crate::run::ports;
use crate::run::table_run::TableApplication;
use crate::run::trace::TraceArguments;
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::output;
use anyhow::Result;
use clap::Args;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_emu::Emulator;
use takt_isa::fp::Flags;
use takt_isa::timing::Cycle;
use takt_isa::{Program, Type};
use takt_system::{CorePeriods, Description, FifoCounts};

/// Execution of an application, from reset to its end.
pub(crate) trait Execution<'a>: TableApplication {
    /// Length of a period in s, if it is known.
    fn period(&self) -> Option<f64> {
        None
    }

    /// Runs without input rows until all cores halt.
    fn run_to_halt(&mut self) -> Result<()>;

    /// Completes the trace; returns the outcome.
    fn end(self, trace: &TraceArguments, color: bool) -> Result<RunOutcome<'a>>;
}

/// Options that say where the outcome goes.
#[derive(Args)]
pub(crate) struct OutcomeOptions {
    /// Table of the output ports, as CSV, one row for each period, with a column `cycles`; `-` is standard output, where
    /// nothing else is written then.
    #[arg(long, value_name = "CSV")]
    pub(crate) outputs: Option<PathBuf>,
    /// Print where the cycles went; on standard error with `--outputs -`.
    #[arg(long)]
    stats: bool,
    /// Print the result as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Outcome of a core.
pub(crate) struct CoreOutcome<'a> {
    /// Name of the core; empty for a single program.
    name: &'a str,
    program: &'a Program,
    periods: CorePeriods,
    account: Account,
    missed: u64,
    nan_writes: u64,
    flags: Flags,
    denials: Denials,
}

/// Outcome of a system apart from its cores.
pub(crate) struct SystemOutcome<'a> {
    pub(crate) description: &'a Description,
    pub(crate) first_tick: Option<Cycle>,
    pub(crate) cycles: Cycle,
    pub(crate) fifos: Vec<(&'a str, FifoCounts)>,
    /// Number of entries that full FIFOs rejected.
    pub(crate) refused: u64,
}

/// Outcome of a run.
pub(crate) struct RunOutcome<'a> {
    pub(crate) cores: Vec<CoreOutcome<'a>>,
    /// Last value of each output; `None` if never written.
    pub(crate) outputs: Vec<(String, Option<(Type, u32)>)>,
    /// The application has inputs, but no input table was given.
    pub(crate) zeros: bool,
    pub(crate) nans: NanWrites,
    /// Outcome of a system apart from its cores; `None` for a single program.
    pub(crate) system: Option<SystemOutcome<'a>>,
    pub(crate) plant: Option<PlantOutcome>,
}

/// Last state of a plant.
pub(crate) struct PlantOutcome {
    pub(crate) name: String,
    pub(crate) states: Vec<(String, f64)>,
}

impl<'a> CoreOutcome<'a> {
    pub(crate) fn new(
        name: &'a str,
        program: &'a Program,
        emulator: &Emulator,
        periods: CorePeriods,
        denials: Denials,
    ) -> CoreOutcome<'a> {
        let statistics = emulator.statistics();
        CoreOutcome {
            name,
            program,
            periods,
            account: Account::of(&statistics),
            missed: statistics.missed + statistics.lost,
            nan_writes: statistics.nan_writes,
            flags: emulator.flags(),
            denials,
        }
    }

    fn json(&self) -> Value {
        let CoreOutcome { program, periods, account, .. } = self;
        json!({
            "machine": program.machine.name,
            "periods": periods.count,
            "cycles": {
                "min": (periods.count > 0).then_some(periods.shortest),
                "max": (periods.count > 0).then_some(periods.longest),
                "total": account.cycles,
            },
            "deadlines_missed": self.missed,
            "nan_writes": self.nan_writes,
            "flags": self.flags.to_string(),
            "denied": self.denials.json,
            "bundles": account.bundles,
            "operations": account.operations,
            "stalls": account.stalls_json(),
        })
    }

    /// Shortest and longest period in cycles.
    fn cycles(&self) -> String {
        let CorePeriods { shortest, longest, .. } = self.periods;
        if shortest == longest { shortest.to_string() } else { format!("{shortest} to {longest}") }
    }

    /// Writes a line with periods and cycles of the core, preceded by its name in a system.
    fn line(&self, out: &mut impl Write) -> Result<()> {
        let (machine, count, cycles) = (self.program.machine.name, self.periods.count, self.account.cycles);
        let (periods, each) = if count == 1 { ("period", "cycles") } else { ("periods", "cycles each") };
        // All cycles together contain those before the first period and the waits for the tick: beside the cycles of a period they
        // would not add up.
        let took =
            if count == 0 { format!("{cycles} cycles in all") } else { format!("{} {each}", self.cycles()) };
        let missed = self.missed;
        write!(out, "{count} {periods} on {machine}: {took}, {missed} deadlines missed")?;
        if self.periods.skipped > 0 {
            write!(out, ", snapshots skipped at {} ticks", self.periods.skipped)?;
        }
        writeln!(out)?;
        Ok(())
    }

    fn statistics(&self, out: &mut impl Write) -> Result<()> {
        let of = if self.name.is_empty() { String::new() } else { format!("{}: ", self.name) };
        writeln!(out, "\n{of}cycles, waiting for the tick left out:")?;
        out.write_all(self.account.stall_table(self.program, 10).as_bytes())?;
        writeln!(out, "\n{of}operations:")?;
        for (mnemonic, count) in &self.account.operations {
            writeln!(out, "  {mnemonic:<14} {count:>9}")?;
        }
        writeln!(out, "  {:<14} {:>9}", "all", self.account.total_operations())?;
        Ok(())
    }
}

impl RunOutcome<'_> {
    /// Warns about NaNs on a program's output ports.
    pub(crate) fn warn(&self, color: bool) {
        if let ([core], None) = (&self.cores[..], &self.system) {
            self.nans.warn(core.program, core.nan_writes, color);
        }
    }

    /// # Errors
    /// If a denied event occurred.
    pub(crate) fn verdict(self) -> Result<()> {
        Denials::verdict(self.cores.into_iter().map(|core| core.denials))
    }

    /// Prints the outcome of the application in `file`; `rows` is the number of periods or base ticks.
    pub(crate) fn print(
        &self,
        file: &Path,
        shown: &OutcomeOptions,
        rows: Option<u64>,
        out: &mut Out,
    ) -> Result<()> {
        if shown.json {
            return files::json(&self.json(file, rows), out);
        }
        if !shown.outputs.as_deref().is_some_and(files::is_dash) {
            return self.text(shown, rows, out);
        }
        if shown.stats {
            let mut text = Vec::new();
            self.text(shown, rows, &mut text)?;
            output::message(&String::from_utf8_lossy(&text));
        }
        Ok(())
    }

    fn json(&self, file: &Path, rows: Option<u64>) -> Value {
        let outputs = self.outputs.iter();
        let outputs: Map<_, _> = outputs
            .map(|(name, value)| (name.clone(), json!(value.map(|(ty, bits)| ports::json(ty, bits)))))
            .collect();
        let file = files::input_name(file);
        let Some(system) = &self.system else {
            let mut value = self.cores[0].json();
            value["program"] = file.into();
            value["outputs"] = outputs.into();
            if let Some(PlantOutcome { name, states }) = &self.plant {
                let states: Map<_, _> =
                    states.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
                value["plant"] = json!({ "name": name, "states": states });
            }
            return value;
        };
        let cores = self.cores.iter().zip(&system.description.cores).map(|(ran, core)| {
            let mut value = ran.json();
            value["program"] = core.path.clone().into();
            value["snapshots_skipped"] = ran.periods.skipped.into();
            (core.name.clone(), value)
        });
        let fifos = system.fifos.iter().map(|(name, counts)| {
            let FifoCounts { pushed, popped, overflows, underflows, most } = counts;
            let value = json!({
                "pushed": pushed, "popped": popped, "overflows": overflows, "underflows": underflows, "most": most,
            });
            ((*name).to_owned(), value)
        });
        json!({
            "system": file,
            "ticks": rows,
            "first_tick": system.first_tick,
            "cycles": system.cycles,
            "cores": cores.collect::<Map<_, _>>(),
            "fifos": fifos.collect::<Map<_, _>>(),
            "refused": system.refused,
            "outputs": outputs,
        })
    }

    fn text(&self, shown: &OutcomeOptions, rows: Option<u64>, out: &mut impl Write) -> Result<()> {
        let (what, none) = match &self.system {
            None => ("input ports", "(never written)"),
            Some(_) => ("system's inputs", "(nothing)"),
        };
        match (&self.system, rows) {
            (None, None) => {
                let core = &self.cores[0];
                writeln!(out, "{} cycles on {}", core.account.cycles, core.program.machine.name)?;
            }
            (None, Some(_)) => self.cores[0].line(out)?,
            (Some(system), _) => self.system_lines(system, rows, out)?,
        }
        if self.zeros {
            writeln!(out, "  without --inputs the {what} are 0")?;
        }
        if shown.outputs.is_none() {
            for (name, value) in &self.outputs {
                let value = value.map(|(ty, bits)| ports::format(ty, bits));
                writeln!(out, "  {name} = {}", value.as_deref().unwrap_or(none))?;
            }
        }
        if let Some(PlantOutcome { name, states }) = self.plant.as_ref().filter(|_| shown.outputs.is_none()) {
            for (state, value) in states {
                writeln!(out, "  {name}.{state} = {}", number::rounded(*value, 7))?;
            }
        }
        if let ([core], None) = (&self.cores[..], &self.system) {
            writeln!(out, "  exception flags: {}", core.flags)?;
        }
        if shown.stats {
            self.cores.iter().try_for_each(|core| core.statistics(out))?;
        }
        Ok(())
    }

    /// Writes lines about a system: ticks, each core, each FIFO.
    fn system_lines(
        &self,
        system: &SystemOutcome<'_>,
        rows: Option<u64>,
        out: &mut impl Write,
    ) -> Result<()> {
        match rows {
            None => writeln!(out, "every core has halted")?,
            Some(count) => {
                let plural = if count == 1 { "" } else { "s" };
                writeln!(out, "{count} base tick{plural} of {} cycles", system.description.tick)?;
            }
        }
        for core in &self.cores {
            write!(out, "{}: ", core.name)?;
            core.line(out)?;
            if core.nan_writes > 0 {
                writeln!(out, "  NaN written to output ports {} times", core.nan_writes)?;
            }
            writeln!(out, "  exception flags: {}", core.flags)?;
        }
        for (name, FifoCounts { pushed, popped, overflows, underflows, most }) in &system.fifos {
            writeln!(
                out,
                "  {name}: {pushed} entries in, {popped} out, {most} at most; {overflows} refused when full, {underflows} \
                 asked for when empty"
            )?;
        }
        Ok(())
    }
}
