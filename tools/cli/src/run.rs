//! `takt run`: a program on the emulator, with inputs and outputs as CSV.

use crate::account::Account;
use crate::batch;
use crate::deny::{Denials, DenyArguments, Watch};
use crate::fault;
use crate::files::{self, Out};
use crate::load::{self, Load};
use crate::nan::NanWrites;
use crate::number;
use crate::output::{self, Failure};
use crate::ports::{self, Inputs};
use crate::progress::{self, Late};
use crate::select::{OptionalMachine, SourceArguments};
use crate::system;
use crate::trace::{Trace, TraceArguments};
use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use takt_emu::{Emulator, Stop};

/// Run a program, counting cycles.
///
/// With --inputs, each row of the CSV is one period: its values are set on the input ports, the tick comes, and the program
/// runs until its `wait`. Without, the input ports are 0, and the program runs for --periods periods, or else until it halts.
///
/// With `--inputs - --outputs -` each row is answered as it comes, before the next one is waited for, so that a simulator in any
/// language closes the loop through two pipes (docs/plant.md).
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Run {
    /// Source or image, `-` being standard input; or a system, a `.toml` file.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// CSV with one named column for each input port and one row for each period; other columns are ignored; `-` is standard input.
    #[arg(long, value_name = "CSV")]
    inputs: Option<PathBuf>,
    /// Many runs of the program at once, on all cores: a folder with a CSV of inputs for each run, or one CSV with a column
    /// `run`. --outputs gets that column too.
    #[arg(
        long,
        value_name = "DIR|CSV",
        conflicts_with_all = ["inputs", "periods", "trace", "deny", "stats"]
    )]
    batch: Option<PathBuf>,
    /// Where the output ports go, as CSV, one row for each period, with a column `cycles`; `-` is standard output, where
    /// nothing else is written then.
    #[arg(long, value_name = "CSV")]
    outputs: Option<PathBuf>,
    /// Run at most this many periods.
    #[arg(long, value_name = "N", value_parser = number::count, allow_hyphen_values = true)]
    periods: Option<u64>,
    /// Stop with an error after this many cycles, with --batch each run [default: 1000000000 in any one period].
    #[arg(long, value_name = "N", value_parser = number::count, allow_hyphen_values = true)]
    max_cycles: Option<u64>,
    /// Cycles from tick to tick, up to 100000000 [default: the tick comes when the program is ready].
    #[arg(long, value_name = "CYCLES", value_parser = number::tick, allow_hyphen_values = true)]
    tick: Option<NonZeroU64>,
    #[command(flatten)]
    trace: TraceArguments,
    #[command(flatten)]
    deny: DenyArguments,
    /// Print where the cycles went; on standard error with `--outputs -`.
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
  takt run prog.s --inputs in.csv --deny all      for CI: status 3 if a flag is raised, …
  takt run prog.s --batch runs --outputs out.csv  a run for each CSV in the folder `runs`
  takt run system.toml --inputs in.csv --stats    several cores: a base tick for each row (docs/system.md)";

pub(crate) use takt_analysis::period::PERIOD_LIMIT;

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
    // A folder is no file that could be written over.
    let batch = arguments.batch.as_deref();
    reads.extend(batch.filter(|path| !path.is_dir()).map(|path| ("--batch", path)));
    let mut writes = Vec::new();
    writes.extend(arguments.outputs.as_deref().map(|path| ("--outputs", path)));
    writes.extend(arguments.trace.given());
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&reads, &writes)?;
    if load::is_system(&arguments.file) {
        return system::run::run(&arguments.of_system()?, color, out);
    }
    let has_periods = arguments.inputs.is_some() || arguments.periods.is_some() || batch.is_some();
    if arguments.outputs.is_some() && !has_periods {
        return Err(Failure::Usage(
            "--outputs has a row for each period: give --inputs or --periods".to_owned(),
        )
        .into());
    }

    let loaded =
        Load::new(arguments.machine.machine, color).with(&arguments.source).with_source(&arguments.file)?;
    if let Some(inputs) = batch {
        let Run { file, tick, max_cycles, json, .. } = arguments;
        let (outputs, max_cycles) = (arguments.outputs.as_deref(), *max_cycles);
        let arguments = batch::Arguments { file, inputs, outputs, tick: *tick, max_cycles, json: *json };
        return batch::run(&arguments, &loaded, color, out);
    }
    let program = &loaded.program;
    let mut emulator = Emulator::new(program)?;
    emulator.set_tick_period(arguments.tick);
    let mut trace_file = arguments.trace.create()?;
    let mut trace = trace_file.as_mut().map(|file| arguments.trace.begin(&emulator, file)).transpose()?;
    let mut observers = Observers { nans: NanWrites::default(), watch: arguments.deny.watch() };
    let result = if has_periods {
        run_periods(arguments, &mut emulator, trace.as_mut(), &mut observers).map(Some)
    } else {
        run_to_halt(arguments, &mut emulator, trace.as_mut(), &mut observers).map(|()| None)
    };
    let result = result.map_err(|error| fault::told(error, &loaded, color));
    let Observers { nans, watch } = observers;
    // What led to a fault is what a trace is for: it is kept.
    trace.map_or(Ok(()), |trace| trace.finish(&emulator, color))?;
    trace_file.map_or(Ok(()), Out::finish)?;
    let denials = watch.end(&emulator);
    let periods = match result {
        // A reader that has gone needs no summary; what happened until then counts.
        Err(error) if output::is_closed_pipe(&error) => return denials.verdict(),
        result => result?,
    };
    let statistics = emulator.statistics();
    nans.warn(program, statistics.nan_writes, color);

    let account = Account::of(&statistics);
    let ran = Ran { arguments, emulator: &emulator, periods, account, denials };
    if arguments.json {
        output::json(&ran.json(), out)?;
    } else if !arguments.outputs.as_deref().is_some_and(files::is_dash) {
        ran.text(out)?;
    } else if arguments.stats {
        let mut text = Vec::new();
        ran.text(&mut text)?;
        output::message(&String::from_utf8_lossy(&text));
    }
    ran.denials.verdict()
}

impl Run {
    /// What `takt run` of a system takes of it.
    fn of_system(&self) -> Result<system::run::Arguments<'_>> {
        let Run { file, source, inputs, outputs, periods, max_cycles, stats, json, .. } = self;
        let given = [
            ("--machine", self.machine.machine.is_some(), "the system's file names each core's"),
            ("--tick", self.tick.is_some(), "the system's file has it"),
            ("--batch", self.batch.is_some(), "a system runs once"),
            ("--deny", self.deny.is_given(), "a system's run is not watched"),
        ];
        if let Some((option, _, why)) = given.into_iter().find(|(_, given, _)| *given) {
            return Err(Failure::Usage(format!("{option} with a system: {why}")).into());
        }
        let (inputs, outputs) = (inputs.as_deref(), outputs.as_deref());
        let (periods, max_cycles) = (*periods, *max_cycles);
        Ok(system::run::Arguments {
            file,
            source,
            inputs,
            outputs,
            periods,
            max_cycles,
            stats: *stats,
            json: *json,
            trace: Some(&self.trace),
        })
    }
}

/// Who looks on while the program runs.
struct Observers {
    nans: NanWrites,
    watch: Watch,
}

fn run_to_halt(
    arguments: &Run,
    emulator: &mut Emulator,
    trace: Option<&mut Trace<'_>>,
    observers: &mut Observers,
) -> Result<()> {
    set_inputs(emulator, &mut Inputs::open(None, &emulator.program().inputs)?)?;
    emulator.set_cycle_limit(arguments.max_cycles.unwrap_or(PERIOD_LIMIT));
    let stop = observers.watch.run(emulator, trace);
    observers.nans.add(&emulator.take_nan_writes());
    match stop? {
        Stop::Idle => bail!("the program waits for the tick: give it periods with --inputs or --periods"),
        _ => Ok(()),
    }
}

/// Sets the input ports for the period to come; false if there is none.
fn set_inputs(emulator: &mut Emulator, inputs: &mut Inputs) -> Result<bool> {
    let Some(row) = inputs.next()? else { return Ok(false) };
    for &(register, bits) in row {
        emulator.set_input_bits(register, bits)?;
    }
    Ok(true)
}

fn run_periods(
    arguments: &Run,
    emulator: &mut Emulator,
    mut trace: Option<&mut Trace<'_>>,
    observers: &mut Observers,
) -> Result<Periods> {
    let path = arguments.inputs.as_deref();
    let live = path.is_some_and(files::is_live);
    let program = emulator.program();
    let titles = program.outputs.iter().map(|port| port.name.clone()).chain(["cycles".to_owned()]);
    let open = || Inputs::open(path, &program.inputs);
    let (mut inputs, mut outputs) = ports::open_both(path, open, arguments.outputs.as_deref(), titles)?;
    // Where a row appears for each period, that is progress enough.
    let all = arguments.periods.or_else(|| progress::rows(path)).filter(|_| !live);
    let shows_rows = arguments.outputs.as_deref().is_some_and(files::is_dash);
    let mut bar = Late::new(all.filter(|_| !shows_rows), "periods");
    let mut periods = Periods { shortest: u64::MAX, ..Periods::default() };
    let mut period = |periods: &mut Periods| -> Result<bool> {
        if !set_inputs(emulator, &mut inputs)? {
            return Ok(false);
        }
        emulator.set_cycle_limit(arguments.max_cycles.unwrap_or(emulator.now() + PERIOD_LIMIT));
        let report = observers.watch.run_period(emulator, trace.as_deref_mut(), None);
        let report = report.with_context(|| format!("period {}", periods.count))?;
        if trace.as_ref().is_some_and(|trace| trace.has_failed()) {
            return Ok(false);
        }
        periods.count += 1;
        bar.add(1);
        periods.shortest = periods.shortest.min(report.cycles);
        periods.longest = periods.longest.max(report.cycles);
        periods.missed += u64::from(report.missed) + report.lost;
        observers.nans.add(&report.nan_writes);
        if let Some(outputs) = &mut outputs {
            let values = emulator.program().outputs.iter().map(|port| {
                emulator.output_bits(port.register).map_or(String::new(), |bits| ports::format(port.ty, bits))
            });
            ports::write_row(outputs, values.chain([report.cycles.to_string()]))?;
        }
        if let Some(outputs) = outputs.as_mut().filter(|_| live) {
            outputs.flush()?;
        }
        Ok(true)
    };
    let mut result = Ok(true);
    while matches!(result, Ok(true)) && arguments.periods.is_none_or(|wanted| periods.count < wanted) {
        result = period(&mut periods);
    }
    drop(bar);
    ports::finish(outputs, periods.count, result.map(|_| ()))?;
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

/// What came of a run.
struct Ran<'a> {
    arguments: &'a Run,
    emulator: &'a Emulator,
    /// `None` if it ran to its `halt`.
    periods: Option<Periods>,
    account: Account,
    denials: Denials,
}

impl Ran<'_> {
    fn json(&self) -> Value {
        let Ran { arguments, emulator, account, denials, .. } = self;
        let periods = self.periods.as_ref();
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
            "denied": denials.json,
            "outputs": outputs(emulator, ports::json).collect::<std::collections::BTreeMap<_, _>>(),
            "bundles": account.bundles,
            "operations": account.operations,
            "stalls": account.stalls_json(),
        })
    }

    fn text(&self, out: &mut impl Write) -> Result<()> {
        let Ran { arguments, emulator, account, .. } = self;
        let (machine, cycles) = (emulator.machine().name, account.cycles);
        match &self.periods {
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
        if arguments.inputs.is_none() && !emulator.program().inputs.is_empty() {
            writeln!(out, "  without --inputs the input ports are 0")?;
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
}
