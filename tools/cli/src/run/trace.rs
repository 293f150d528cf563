// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt run --trace`: writes the events of a run, cycle by cycle, to a file for other tools.

use crate::terminal::files::{OptionPath, Out};
use crate::terminal::number;
use crate::terminal::output::{self, Failure};
use anyhow::{Result, anyhow};
use clap::Args;
use std::ops::Range;
use std::path::{Path, PathBuf};
use takt_debug::trace::{Format, Options, Summary, SystemTracer, Tracer};
use takt_emu::Emulator;
use takt_isa::timing::Cycle;
use takt_system::System;

#[derive(Args)]
pub(crate) struct TraceArguments {
    /// Write what happens in each cycle: waveforms as .vcd or .fst, the pipeline for the viewer Konata as .kanata, completed
    /// operations as .jsonl.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Trace these cycles only; the last is left out, and either may be missing.
    #[arg(long, value_name = "A..B", value_parser = cycles, allow_hyphen_values = true, requires = "trace")]
    trace_cycles: Option<Range<u64>>,
    /// Trace these signals only: names of ports and registers, or names from docs/traces.md such as `outputs.*` and
    /// `takt.stall.*`; `*` stands for any characters.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "trace")]
    trace_signals: Vec<String>,
    /// End the trace when it reaches this size in MiB.
    #[arg(long, value_name = "MIB", default_value_t = 256, value_parser = number::count, requires = "trace", allow_hyphen_values = true)]
    trace_limit: u64,
}

fn cycles(text: &str) -> Result<Range<u64>, String> {
    let wanted = "takes two numbers of cycles as in 1000..2000";
    let (start, end) = text.split_once("..").ok_or(wanted)?;
    let number = |text: &str, missing| if text.is_empty() { Some(missing) } else { text.parse().ok() };
    let range = number(start, 0).ok_or(wanted)?..number(end, u64::MAX).ok_or(wanted)?;
    if range.is_empty() { Err("has no cycle between its ends".to_owned()) } else { Ok(range) }
}

impl TraceArguments {
    /// Path of the trace file, with its option.
    pub(crate) fn file_with_option(&self) -> Option<OptionPath<'_>> {
        Some(("--trace", self.trace.as_deref()?))
    }

    /// Trace format, from the file extension.
    fn format(path: &Path) -> Result<Format> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        Format::of_extension(extension).ok_or_else(|| {
            let all: Vec<String> = Format::ALL.iter().map(|(known, _)| format!(".{known}")).collect();
            let text = format!("--trace {}: the name must end in one of {}", path.display(), all.join(" "));
            Failure::Usage(text).into()
        })
    }

    /// Opens the file before the run, so that errors in the path come first.
    pub(crate) fn create(&self) -> Result<Option<Out>> {
        let Some(path) = self.trace.as_deref() else { return Ok(None) };
        Self::format(path)?;
        Out::create(path).map(Some)
    }

    fn options(&self, path: &Path) -> Result<Options> {
        Ok(Options {
            format: Self::format(path)?,
            cycles: self.trace_cycles.clone().unwrap_or(0..u64::MAX),
            signals: self.trace_signals.clone(),
            limit: self.trace_limit.saturating_mul(1 << 20),
        })
    }

    /// Starts the trace of a program.
    pub(crate) fn begin<'o>(&self, emulator: &Emulator, file: &'o mut Out) -> Result<Tracer<'o>> {
        let options = self.options(&self.path())?;
        Tracer::new(emulator, Box::new(file), options)
            .map_err(|error| Failure::Usage(format!("--trace-signals: {error}")).into())
    }

    /// Starts the trace of a system, which is a waveform.
    pub(crate) fn begin_system<'o>(&self, system: &System, file: &'o mut Out) -> Result<SystemTracer<'o>> {
        let path = self.path();
        let options = self.options(&path)?;
        if !matches!(options.format, Format::Vcd | Format::Fst) {
            let text = format!("--trace {}: a system is traced as .vcd or .fst", path.display());
            return Err(Failure::Usage(text).into());
        }
        SystemTracer::new(system, Box::new(file), options)
            .map_err(|error| Failure::Usage(format!("--trace-signals: {error}")).into())
    }

    /// Warns about an incomplete or empty trace; `passed` is the length of the run in cycles.
    pub(crate) fn finish(&self, summary: std::io::Result<Summary>, passed: Cycle, color: bool) -> Result<()> {
        // The error from `Out` already names the file.
        let summary = summary.map_err(|error| anyhow!(error))?;
        let path = self.path();
        let name = path.display();
        if summary.cut {
            let (end, limit) = (summary.cycles.end, self.trace_limit);
            let text = format!("{name} ends before cycle {end}: --trace-limit is {limit} MiB");
            output::warning(&text, color);
        } else if summary.cycles.is_empty() {
            output::warning(&format!("{name} is empty: the run has {passed} cycles"), color);
        }
        Ok(())
    }

    fn path(&self) -> PathBuf {
        self.trace.clone().unwrap_or_default()
    }
}
