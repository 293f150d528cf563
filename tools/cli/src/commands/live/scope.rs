// SPDX-License-Identifier: MIT OR Apache-2.0
//! Subcommand `scope` of `takt live`: records registers and ports of every period on the board, around a trigger, and shows them.

use crate::terminal::files::{self, Out};
use crate::terminal::number::{self, rounded};
use crate::terminal::options;
use crate::terminal::output::{message, note};
use crate::terminal::plot::curves::Curves;
use crate::terminal::plot::terminal::{Trace, traces};
use crate::terminal::progress::{DelayedActivity, progress};
use anyhow::{Result, anyhow, bail};
use clap::Args;
use std::fmt::Write as _;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use takt_board::protocol::{HOLD, Line, RUN};
use takt_board::scope::{MOST_EVERY, Recording, Scope, ScopeState, Setup};
use takt_board::{Application, Host, Wiring};
use takt_isa::Type;
use takt_live::recording::{cells, summary, table};

/// Pause between two questions whether the recording is done.
const PAUSE: Duration = Duration::from_millis(50);

/// Options of `takt live scope`.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ScopeArguments {
    /// Channels: registers and ports by name (`iq`, `@m12`, in a system `core.iq`); `iq:57` is what line 57 of the source writes.
    #[arg(required = true)]
    names: Vec<String>,
    /// Trigger: `x >= 1.5` (or >, <, <=, ==), `x rises 1.5`, `x falls 1.5`, `x changes` of a channel; fault, miss, trip, safe. Several
    /// may be given, one of them a comparison. Without any, the recording begins at once.
    #[arg(long, short, value_name = "WHEN", allow_hyphen_values = true)]
    trigger: Vec<String>,
    /// Periods from one sample to the next.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EVERY)))]
    every: u32,
    /// Samples [default: as many as the board's scope has].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=32_768))]
    samples: Option<u32>,
    /// Samples before the trigger's [default: a quarter; none without a trigger].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=32_767))]
    before: Option<u32>,
    /// Give up if the recording is not done after this time (`5s`); the scope stays armed.
    #[arg(long, value_name = "TIME", value_parser = number::seconds, allow_hyphen_values = true)]
    wait: Option<f64>,
    /// Arm, and wait for nothing: `--read` with the same channels reads the recording later.
    #[arg(long, conflicts_with_all = ["read", "wait", "csv", "vcd", "plot"])]
    arm: bool,
    /// Read the recording of a scope that was armed before, with the same channels.
    #[arg(long, conflicts_with_all = ["every", "samples", "before"])]
    read: bool,
    /// Write the samples as CSV, a row for each; `-` is standard output.
    #[arg(long, value_name = "CSV")]
    csv: Option<PathBuf>,
    /// Write the samples as a waveform, with the trigger as a signal; with --wiring in nanoseconds, else in periods.
    #[arg(long, value_name = "VCD")]
    vcd: Option<PathBuf>,
    /// Draw the samples: as SVG; without a file on the terminal, which is done if there is no other output.
    #[arg(long, value_name = "SVG", value_parser = options::picture(), num_args = 0..=1)]
    plot: Option<Option<PathBuf>>,
}

const EXAMPLES: &str = "\
Examples (each after `takt live PORT --program servo.s`):
  scope iq iq_ref                                  from now on, as long as the board's memory lasts
  scope iq iq_ref duty -t 'iq_ref rises 2'         a step of the reference, with a quarter before it
  scope iq speed -t fault -t trip --before 200     what led to a fault or a trip
  scope state -t 'state changes' --csv out.csv     to a table
  scope theta --every 100 --samples 256 --wait 10s slower, and not for ever";

/// Checks the names and triggers, before the serial port is opened.
pub(super) fn prepare(application: &Application<'_>, arguments: &ScopeArguments) -> Result<Setup> {
    let mut writes = Vec::new();
    writes.extend(arguments.csv.as_deref().map(|path| ("--csv", path)));
    writes.extend(arguments.vcd.as_deref().map(|path| ("--vcd", path)));
    writes.extend(arguments.plot.iter().flatten().map(|path| ("--plot", path.as_path())));
    files::check(&[], &writes)?;
    let setup = Setup::new(application, &arguments.names, &arguments.trigger);
    let mut setup = setup.map_err(|text| anyhow!("{text}"))?;
    (setup.every, setup.samples, setup.before) = (arguments.every, arguments.samples, arguments.before);
    Ok(setup)
}

/// Arms the scope, waits for the recording, and writes it.
pub(super) fn run<L: Line>(
    host: &mut Host<L>,
    application: &Application<'_>,
    (arguments, setup): (&ScopeArguments, &Setup),
    wiring: Option<&Wiring>,
    out: &mut Out,
) -> Result<()> {
    let scope = host.scope()?;
    setup.fits(&scope)?;
    if !arguments.read {
        let control = host.register("control")?;
        if control & RUN == 0 && !arguments.arm {
            bail!(
                "the program is stopped, and has no periods to record: `takt live PORT start` starts it; to record its start, arm with \
                 --arm, start it, and read with --read"
            );
        }
        host.arm(application, &scope, setup)?;
        if arguments.arm {
            return Ok(writeln!(out, "armed: {}", setup.triggers())?);
        }
        if control & HOLD != 0 {
            note("the program is held: a period is recorded with each `takt live PORT step`");
        }
        wait(host, &scope, setup, arguments.wait)?;
    }
    let bar = std::cell::OnceCell::new();
    let recording = host.recording(&scope, setup, |passed, all| {
        bar.get_or_init(|| progress(all as u64, "words", false)).set_position(passed as u64);
        ControlFlow::Continue(())
    });
    if let Some(bar) = bar.get() {
        bar.finish_and_clear();
    }
    let recording = recording?;
    if recording.periods.is_empty() {
        bail!("the recording is empty: no period has ended since the scope was armed");
    }
    let outputs = [&arguments.csv, &arguments.vcd, &arguments.plot.clone().flatten()];
    // Standard output may be one of the files.
    match outputs.into_iter().flatten().any(|path| files::is_dash(path)) {
        true => message(&summary(&recording)),
        false => writeln!(out, "{}", summary(&recording))?,
    }
    write(&recording, arguments, host.register("period")?, wiring, out)
}

/// Waits until the recording is done.
fn wait<L: Line>(host: &mut Host<L>, scope: &Scope, setup: &Setup, limit: Option<f64>) -> Result<()> {
    let begin = Instant::now();
    let _activity = DelayedActivity::new(format!("waiting for {}", setup.triggers()));
    loop {
        let state = host.scope_state()?;
        if state == ScopeState::Done {
            return Ok(());
        }
        let status = host.status_of(scope.core)?;
        let stopped = status.fault() || status.halted() || host.register("control")? & RUN == 0;
        // The last sample comes after a stop.
        if stopped && host.scope_state()? != ScopeState::Done {
            std::thread::sleep(PAUSE);
            if host.scope_state()? != ScopeState::Done {
                let what = match () {
                    () if status.fault() => "stopped with a fault",
                    () if status.halted() => "halted",
                    () => "was stopped",
                };
                bail!(
                    "the program {what} before {}: `--trigger fault` records what leads to a fault or halt",
                    setup.triggers()
                );
            }
            return Ok(());
        }
        if limit.is_some_and(|limit| begin.elapsed().as_secs_f64() > limit) {
            let what = match state {
                ScopeState::Triggered => "the samples after the trigger are not complete",
                _ => "no trigger",
            };
            bail!(
                "{what} within {} s ({}): the scope stays armed, and --read reads the recording later",
                rounded(limit.unwrap_or(0.0), 6),
                setup.triggers()
            );
        }
        std::thread::sleep(PAUSE);
    }
}

fn write(
    recording: &Recording,
    arguments: &ScopeArguments,
    period: u32,
    wiring: Option<&Wiring>,
    out: &mut Out,
) -> Result<()> {
    let ScopeArguments { csv, vcd, plot, .. } = arguments;
    if let Some(path) = csv {
        let mut file = Out::create(path)?;
        file.write_all(table(recording).as_bytes())?;
        file.finish()?;
    }
    let cycle = wiring.map(|wiring| 1e3 / wiring.clock);
    if let Some(path) = vcd {
        let mut file = Out::create(path)?;
        file.write_all(waveform(recording, cycle.map(|cycle| cycle * f64::from(period))).as_bytes())?;
        file.finish()?;
    }
    let seconds = cycle.map(|cycle| cycle * f64::from(period) * 1e-9);
    match plot {
        Some(Some(path)) => {
            let titles = recording.channels.iter().map(|(name, _)| name.clone()).collect();
            let mut curves = Curves::new(titles, seconds.map(|seconds| seconds * f64::from(arguments.every)));
            for row in 0..recording.periods.len() {
                curves.add(&cells(recording, row).collect::<Vec<_>>());
            }
            files::write(path, curves.draw(&summary(recording))?.as_bytes())?;
        }
        Some(None) => out.lines(&drawn(recording, out))?,
        None if csv.is_none() && vcd.is_none() => out.lines(&drawn(recording, out))?,
        None => {}
    }
    Ok(())
}

/// A value-change dump; `period` is a period's length in ns.
fn waveform(recording: &Recording, period: Option<f64>) -> String {
    let unit = if period.is_some() { "1 ns" } else { "1 us" };
    let comment = if period.is_some() { "" } else { "; one time unit is one period" };
    let mut text = format!(
        "$comment takt live scope{comment} $end\n$version takt {} $end\n$timescale {unit} $end\n$scope module scope $end\n",
        env!("CARGO_PKG_VERSION")
    );
    let code = |number: usize| char::from(b'!' + number as u8);
    for (number, (name, ty)) in recording.channels.iter().enumerate() {
        let kind = if *ty == Type::F { "real 64" } else { "wire 32" };
        let _ = writeln!(text, "$var {kind} {} {name} $end", code(number));
    }
    let trigger = code(recording.channels.len());
    let _ = writeln!(text, "$var wire 1 {trigger} trigger $end\n$upscope $end\n$enddefinitions $end");
    let mut last = vec![None; recording.channels.len()];
    let first = recording.periods.first().copied().unwrap_or(0);
    for (row, at) in recording.periods.iter().enumerate() {
        let periods = f64::from(at.wrapping_sub(first));
        let _ = writeln!(text, "#{}", (periods * period.unwrap_or(1.0)).round());
        let is_trigger = recording.trigger.is_some_and(|(index, _)| index == row);
        let was_trigger = recording.trigger.is_some_and(|(index, _)| index + 1 == row);
        if row == 0 || is_trigger || was_trigger {
            let _ = writeln!(text, "{}{trigger}", u8::from(is_trigger));
        }
        for (number, ((_, ty), values)) in recording.channels.iter().zip(&recording.values).enumerate() {
            if row > 0 && last[number] == values[row] {
                continue;
            }
            last[number] = values[row];
            let code = code(number);
            let _ = match (ty, values[row]) {
                (Type::F, Some(bits)) => writeln!(text, "r{} {code}", f32::from_bits(bits)),
                (Type::F, None) => writeln!(text, "rnan {code}"),
                (_, Some(bits)) => writeln!(text, "b{bits:032b} {code}"),
                (_, None) => writeln!(text, "bx {code}"),
            };
        }
    }
    text
}

/// A panel for each channel, over periods from the trigger.
fn drawn(recording: &Recording, out: &Out) -> String {
    let from = recording.trigger.map_or_else(|| recording.periods[0], |(_, period)| period);
    let number = |ty: Type, bits: u32| match ty {
        Type::F => f64::from(f32::from_bits(bits)),
        Type::I => f64::from(bits.cast_signed()),
        Type::B => f64::from(bits),
    };
    let panel = |((name, ty), values): (&(String, Type), &Vec<Option<u32>>)| Trace {
        name: name.clone(),
        points: (recording.periods.iter().zip(values))
            .filter_map(|(period, bits)| {
                Some((f64::from(period.wrapping_sub(from).cast_signed()), number(*ty, (*bits)?)))
            })
            .filter(|(_, value)| value.is_finite())
            .collect(),
    };
    let all: Vec<Trace> = recording.channels.iter().zip(&recording.values).map(panel).collect();
    let unit = if recording.trigger.is_some() { "periods from the trigger" } else { "periods" };
    traces(&all, unit, recording.trigger.map(|_| 0.0), out.page())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording() -> Recording {
        Recording {
            channels: vec![("x".to_owned(), Type::F), ("P[1,2]".to_owned(), Type::I)],
            periods: vec![7, 9, 10],
            values: vec![
                vec![None, Some(1.5f32.to_bits()), Some(f32::NAN.to_bits())],
                vec![Some(3), Some(u32::MAX), Some(u32::MAX)],
            ],
            trigger: Some((1, 9)),
            causes: vec!["`x > 1`".to_owned()],
            is_stopped: true,
        }
    }

    #[test]
    fn a_waveform_has_changes_only_and_the_trigger() {
        let text = waveform(&recording(), Some(20_000.0));
        let (_, changes) = text.split_once("$enddefinitions $end\n").unwrap();
        let ones = "1".repeat(32);
        assert_eq!(
            changes,
            format!("#0\n0#\nrnan !\nb{:032b} \"\n#40000\n1#\nr1.5 !\nb{ones} \"\n#60000\n0#\nrNaN !\n", 3)
        );
        assert!(text.contains("$timescale 1 ns") && waveform(&recording(), None).contains("#2\n"));
    }
}
