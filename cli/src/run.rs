//! `takt run`: a program on the emulator, with inputs and outputs as CSV.

use crate::account::Account;
use crate::fault::explain;
use crate::files::{self, Out};
use crate::load::Load;
use crate::nan::NanWrites;
use crate::output::{self, Failure};
use crate::ports::{self, Inputs};
use crate::select::{self, OptionalMachine};
use crate::trace::{Trace, TraceArguments};
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use takt_emu::{Emulator, Stop};
use takt_isa::Program;

/// Run a program, counting cycles.
///
/// With --inputs, each row of the CSV is one period: its values are set on the input ports, the tick comes, and the program
/// runs until its `wait`. Without, the program runs for --periods periods, or else until it halts.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Run {
    /// Source or image; `-` is standard input.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    /// CSV with one named column for each input port and one row for each period; `-` is standard input.
    #[arg(long, value_name = "CSV")]
    inputs: Option<PathBuf>,
    /// Where the output ports go, as CSV, one row for each period, with a column `cycles`; `-` is standard output.
    #[arg(long, value_name = "CSV")]
    outputs: Option<PathBuf>,
    /// Run at most this many periods.
    #[arg(long, value_name = "N", value_parser = select::count, allow_negative_numbers = true)]
    periods: Option<u64>,
    /// Stop with an error after this many cycles [default: 1000000000 in any one period].
    #[arg(long, value_name = "N", value_parser = select::count, allow_negative_numbers = true)]
    max_cycles: Option<u64>,
    /// The tick comes every so many cycles, up to 100000000 [default: when the program is ready].
    #[arg(long, value_name = "CYCLES", value_parser = tick, allow_negative_numbers = true)]
    tick: Option<NonZeroU64>,
    #[command(flatten)]
    trace: TraceArguments,
    /// Print where the cycles went.
    #[arg(long)]
    stats: bool,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt run prog.s                                 until it halts
  takt run prog.s --inputs in.csv --stats         a period for each row; where did the cycles go?
  takt run prog.takt --inputs in.csv --outputs -  outputs and cycles of every period
  takt run prog.s --periods 3 --trace out.vcd     waveforms for GTKWave or Surfer

`takt track --csv in.csv` records inputs of the tracking programs.";

/// The longest time between ticks, cycles: well within [`PERIOD_LIMIT`].
const LONGEST_TICK: u64 = 100_000_000;

pub(crate) fn tick(text: &str) -> Result<NonZeroU64, String> {
    let cycles = NonZeroU64::new(select::count(text)?).filter(|cycles| cycles.get() <= LONGEST_TICK);
    cycles.ok_or_else(|| format!("more than {LONGEST_TICK}"))
}

/// Cycles in which a period ends, or nobody expects it to any more.
pub(crate) const PERIOD_LIMIT: u64 = 1_000_000_000;

/// What the periods of a run came to.
#[derive(Default)]
struct Periods {
    count: u64,
    shortest: u64,
    longest: u64,
    missed: u64,
}

pub(crate) fn run(arguments: &Run, color: bool, out: &mut Out) -> Result<()> {
    let mut reads = vec![("FILE", arguments.file.as_path())];
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    let mut writes = Vec::new();
    writes.extend(arguments.outputs.as_deref().map(|path| ("--outputs", path)));
    writes.extend(arguments.trace.given());
    if arguments.json || arguments.stats {
        writes.push((if arguments.json { "--json" } else { "--stats" }, Path::new("-")));
    }
    files::check(&reads, &writes)?;
    let has_periods = arguments.inputs.is_some() || arguments.periods.is_some();
    if arguments.outputs.is_some() && !has_periods {
        return Err(Failure::Usage(
            "--outputs has a row for each period: give --inputs or --periods".to_owned(),
        )
        .into());
    }

    let program = Load::new(arguments.machine.machine, color).program(&arguments.file)?;
    let mut emulator = Emulator::new(&program)?;
    emulator.set_tick_period(arguments.tick);
    let mut nans = NanWrites::default();
    let mut trace_file = arguments.trace.create()?;
    let mut trace = trace_file.as_mut().map(|file| arguments.trace.begin(&emulator, file)).transpose()?;
    let result = if has_periods {
        run_periods(arguments, &program, &mut emulator, trace.as_mut(), &mut nans).map(Some)
    } else {
        let result = run_to_halt(arguments, &program, &mut emulator, trace.as_mut());
        nans.add(&emulator.take_nan_writes());
        result.map(|()| None)
    };
    // What led to a fault is what a trace is for: it is kept.
    trace.map_or(Ok(()), |trace| trace.finish(&emulator, color))?;
    trace_file.map_or(Ok(()), Out::finish)?;
    let periods = result?;
    let statistics = emulator.statistics();
    nans.warn(&program, statistics.nan_writes, color);

    let account = Account::of(&statistics);
    if arguments.json {
        output::json(&result_json(arguments, &emulator, periods.as_ref(), &account), out)?;
    } else if !arguments.outputs.as_deref().is_some_and(files::is_dash) {
        write_text(arguments, &emulator, periods.as_ref(), &account, out)?;
    }
    Ok(())
}

fn run_to_halt(
    arguments: &Run,
    program: &Program,
    emulator: &mut Emulator,
    trace: Option<&mut Trace<'_>>,
) -> Result<()> {
    emulator.set_cycle_limit(arguments.max_cycles.unwrap_or(PERIOD_LIMIT));
    let stop = match trace {
        Some(trace) => trace.run(emulator),
        None => emulator.run().map_err(Into::into),
    };
    match stop.map_err(|error| anyhow!(explain(program, &error)))? {
        Stop::Idle => bail!("the program waits for the tick: give it periods with --inputs or --periods"),
        _ => Ok(()),
    }
}

fn run_periods(
    arguments: &Run,
    program: &Program,
    emulator: &mut Emulator,
    mut trace: Option<&mut Trace<'_>>,
    nans: &mut NanWrites,
) -> Result<Periods> {
    let mut inputs = arguments.inputs.as_ref().map(|path| Inputs::open(path, &program.inputs)).transpose()?;
    let mut outputs = arguments.outputs.as_ref().map(|path| Out::create(path)).transpose()?;
    if let Some(outputs) = &mut outputs {
        let names = program.outputs.iter().map(|port| port.name.clone());
        ports::write_row(outputs, names.chain(["cycles".to_owned()]))?;
    }
    let mut periods = Periods { shortest: u64::MAX, ..Periods::default() };
    let mut values = Vec::new();
    while arguments.periods.is_none_or(|wanted| periods.count < wanted) {
        if let Some(inputs) = &mut inputs {
            if !inputs.next(&mut values)? {
                break;
            }
            for &(register, bits) in &values {
                emulator.set_input_bits(register, bits)?;
            }
        }
        emulator.set_cycle_limit(arguments.max_cycles.unwrap_or(emulator.now() + PERIOD_LIMIT));
        let report = match &mut trace {
            Some(trace) => trace.run_period(emulator),
            None => emulator.run_period(&[]),
        };
        let report =
            report.map_err(|error| anyhow!("period {}: {}", periods.count, explain(program, &error)))?;
        if trace.as_ref().is_some_and(|trace| trace.has_failed()) {
            break;
        }
        periods.count += 1;
        periods.shortest = periods.shortest.min(report.cycles);
        periods.longest = periods.longest.max(report.cycles);
        periods.missed += u64::from(report.missed) + report.lost;
        nans.add(&report.nan_writes);
        if let Some(outputs) = &mut outputs {
            let values = program.outputs.iter().map(|port| {
                emulator.output_bits(port.register).map_or(String::new(), |bits| ports::format(port.ty, bits))
            });
            ports::write_row(outputs, values.chain([report.cycles.to_string()]))?;
        }
    }
    if periods.count == 0 {
        let name = arguments.inputs.as_deref().map(files::input_name).context("no period")?;
        bail!("{name} has a header and no row, so there is no period to run");
    }
    outputs.map_or(Ok(()), Out::finish)?;
    Ok(periods)
}

/// The output ports' last values; `None` where nothing was written.
fn outputs<'a, T>(
    emulator: &'a Emulator,
    show: impl Fn(takt_isa::Type, u32) -> T + 'a,
) -> impl Iterator<Item = (&'a str, Option<T>)> {
    let ports = emulator.program().outputs.iter();
    ports.map(move |port| {
        (port.name.as_str(), emulator.output_bits(port.register).map(|bits| show(port.ty, bits)))
    })
}

fn result_json(arguments: &Run, emulator: &Emulator, periods: Option<&Periods>, account: &Account) -> Value {
    json!({
        "program": files::input_name(&arguments.file),
        "machine": emulator.machine().name,
        "periods": periods.map_or(0, |periods| periods.count),
        "cycles": {
            "min": periods.map(|periods| periods.shortest),
            "max": periods.map(|periods| periods.longest),
            "total": account.cycles,
        },
        "deadlines_missed": periods.map_or(0, |periods| periods.missed),
        "nan_writes": emulator.statistics().nan_writes,
        "flags": emulator.flags().to_string(),
        "outputs": outputs(emulator, ports::json).collect::<std::collections::BTreeMap<_, _>>(),
        "bundles": account.bundles,
        "operations": account.operations,
        "stalls": account.stalls_json(),
    })
}

fn write_text(
    arguments: &Run,
    emulator: &Emulator,
    periods: Option<&Periods>,
    account: &Account,
    out: &mut Out,
) -> Result<()> {
    let (machine, cycles) = (emulator.machine().name, account.cycles);
    match periods {
        None => writeln!(out, "{cycles} cycles on {machine}")?,
        Some(Periods { count, shortest, longest, missed }) => {
            let periods = if *count == 1 { "period" } else { "periods" };
            write!(out, "{count} {periods} on {machine}: {shortest} ")?;
            if shortest != longest {
                write!(out, "to {longest} ")?;
            }
            let each = if *count == 1 { "cycles" } else { "cycles each" };
            writeln!(out, "{each}, {cycles} in all, {missed} deadlines missed")?;
        }
    }
    if arguments.outputs.is_none() {
        for (name, value) in outputs(emulator, ports::format) {
            writeln!(out, "  {name} = {}", value.as_deref().unwrap_or("(never written)"))?;
        }
    }
    writeln!(out, "  exception flags: {}", emulator.flags())?;
    if arguments.stats {
        writeln!(out, "\ncycles, waiting for the tick left out:")?;
        out.write_all(account.stall_table(emulator.program(), 10).as_bytes())?;
        writeln!(out, "\noperations:")?;
        for (mnemonic, count) in &account.operations {
            writeln!(out, "  {mnemonic:<14} {count:>9}")?;
        }
        writeln!(out, "  {:<14} {:>9}", "all", account.total_operations())?;
    }
    Ok(())
}
