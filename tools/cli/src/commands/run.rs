// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt run`: runs a program or a system on the emulator, with inputs and outputs in CSV.

use crate::run::application::{Application, refuse};
use crate::run::batch;
use crate::run::deny::{DenyArguments, Watch};
use crate::run::load::is_system;
use crate::run::loaded_program::LoadedProgram;
use crate::run::memory;
use crate::run::nan::NanWrites;
use crate::run::outcome::{CoreOutcome, Execution, OutcomeOptions, PlantOutcome, RunOutcome};
use crate::run::parameters::ParameterArguments;
use crate::run::plant::{self, PlantArguments, ProgramLoop};
use crate::run::ports;
use crate::run::system::LoadedSystem;
use crate::run::system::observers::Observer;
use crate::run::system::run::SystemRun;
use crate::run::table_run::{TableApplication, Tables};
use crate::run::trace::TraceArguments;
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::options::{self, OptionalMachine, SourceArguments};
use crate::terminal::output::{self, Failure, message};
use crate::terminal::plot::curves::Curves;
use anyhow::{Context, Result, bail};
use clap::Args;
use std::cell::RefCell;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use takt_analysis::period::PERIOD_LIMIT;
use takt_asm::units;
use takt_debug::trace::Tracer;
use takt_emu::{Emulator, Row, Stop};
use takt_isa::program::Port;
use takt_isa::timing::Cycle;
use takt_isa::{Program, Type};
use takt_programs::plants::Interface;
use takt_system::CorePeriods;

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
    #[command(flatten, next_help_heading = "The program")]
    machine: OptionalMachine,
    #[command(flatten, next_help_heading = "The program")]
    source: SourceArguments,
    /// CSV with one named column for each input port and one row for each period; other columns are ignored; `-` is standard input.
    #[arg(long, value_name = "CSV", help_heading = INPUTS)]
    inputs: Option<PathBuf>,
    /// Many runs of the program at once, on all cores: a folder with a CSV of inputs for each run, or one CSV with a column
    /// `run`. --outputs gets that column too.
    #[arg(
        long,
        value_name = "DIR|CSV",
        help_heading = INPUTS,
        conflicts_with_all = ["inputs", "periods", "plant", "trace", "deny", "stats"]
    )]
    batch: Option<PathBuf>,
    /// Run at most this many periods.
    #[arg(long, value_name = "N", value_parser = number::count, allow_hyphen_values = true, help_heading = LENGTH)]
    periods: Option<u64>,
    /// Stop with an error after this many cycles, with --batch each run [default: 1000000000 in any one period].
    #[arg(long, value_name = "N", value_parser = number::count, allow_hyphen_values = true, help_heading = LENGTH)]
    max_cycles: Option<u64>,
    /// Cycles from tick to tick, up to 100000000 [default: the tick comes when the program is ready].
    #[arg(long, value_name = "CYCLES", value_parser = number::tick, allow_hyphen_values = true, help_heading = LENGTH)]
    tick: Option<NonZeroU64>,
    /// Also show these words of data memory, as they are when a period ends: all elements of an array, `P`, or one, `P[2,3]`, with indices
    /// from 1; of a label all words up to the next one, `table`, or one, `table[3]`, from 0, as floating-point numbers. May be given
    /// several times.
    #[arg(long, value_name = "NAME", conflicts_with = "batch", help_heading = RESULTS)]
    memory: Vec<String>,
    #[command(flatten, next_help_heading = INPUTS)]
    parameters: ParameterArguments,
    #[command(flatten, next_help_heading = "A closed loop")]
    plant: PlantArguments,
    /// Draw the columns of the table of --outputs over time, as SVG: the output ports; with --plant, the input ports and the plant's states,
    /// too. The input ports of --inputs are drawn as well.
    #[arg(long, value_name = "SVG", value_parser = options::picture(), conflicts_with = "batch", help_heading = RESULTS)]
    plot: Option<PathBuf>,
    #[command(flatten, next_help_heading = RESULTS)]
    trace: TraceArguments,
    #[command(flatten, next_help_heading = RESULTS)]
    deny: DenyArguments,
    #[command(flatten, next_help_heading = RESULTS)]
    shown: OutcomeOptions,
}

// Groups of options in the help.
const INPUTS: &str = "Inputs";
const LENGTH: &str = "Length and tick";
const RESULTS: &str = "Results";

const EXAMPLES: &str = "\
Examples:
  takt run prog.s                                 until it halts
  takt run prog.s --inputs in.csv --stats         a period for each row; where did the cycles go?
  takt run prog.takt --inputs in.csv --outputs -  outputs and cycles of every period
  takt run prog.s --periods 3 --trace out.vcd     waveforms for GTKWave or Surfer
  takt run law.s --plant motor.toml --periods 400 --outputs loop.csv   in closed loop (docs/plant.md)
  takt run prog.s --inputs in.csv --deny all      for CI: status 3 if a flag is raised, …
  takt run prog.s --batch runs --outputs out.csv  a run for each CSV in the folder `runs`
  takt run system.toml --inputs in.csv --stats    several cores: a base tick for each row (docs/system.md)";

pub(crate) fn run(arguments: &Run, color: bool, out: &mut Out) -> Result<()> {
    let mut reads = vec![("FILE", arguments.file.as_path())];
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    reads.extend(arguments.parameters.file.as_deref().map(|path| ("--params", path)));
    reads.extend(arguments.plant.file());
    // An output folder is not checked: it cannot be overwritten by accident.
    let batch = arguments.batch.as_deref();
    reads.extend(batch.filter(|path| !path.is_dir()).map(|path| ("--batch", path)));
    let mut writes = Vec::new();
    writes.extend(arguments.shown.outputs.as_deref().map(|path| ("--outputs", path)));
    writes.extend(arguments.plot.as_deref().map(|path| ("--plot", path)));
    writes.extend(arguments.trace.file_with_option());
    if arguments.shown.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&reads, &writes)?;
    if is_system(&arguments.file) {
        let traced = arguments.deny.is_given() && arguments.trace.file_with_option().is_some();
        refuse(&[
            ("--tick", arguments.tick.is_some(), "the system's file has it"),
            ("--batch", batch.is_some(), "the lanes of a batch are runs of one program"),
            (
                "--plant",
                arguments.plant.plant.is_some(),
                "it closes the loop of one program; run the core's program",
            ),
            ("--memory", !arguments.memory.is_empty(), "a system shows its outputs; run the core's program"),
            ("--deny and --trace", traced, "both take the cores' events; run it once with each"),
        ])?;
    }
    if arguments.shown.outputs.is_some() && !arguments.has_rows() {
        return Err(Failure::Usage(
            "--outputs has a row for each period: give --inputs or --periods".to_owned(),
        )
        .into());
    }
    if arguments.plot.is_some() && !arguments.has_rows() {
        return Err(Failure::Usage(
            "--plot draws from period to period: give --inputs or --periods".to_owned(),
        )
        .into());
    }
    if arguments.plant.plant.is_some() && !arguments.has_rows() {
        return Err(Failure::Usage(
            "--plant moves from period to period: give --periods or --inputs".to_owned(),
        )
        .into());
    }
    let mut application = Application::load(&arguments.file, &arguments.machine, &arguments.source, color)?;
    arguments.parameters.apply(&mut application)?;
    if let (Some(inputs), Application::Program(loaded)) = (batch, &application) {
        let Run { file, tick, max_cycles, shown, .. } = arguments;
        let (tick, max_cycles) = (*tick, *max_cycles);
        let (outputs, json) = (shown.outputs.as_deref(), shown.json);
        let arguments = batch::Arguments { file, inputs, outputs, tick, max_cycles, json };
        return batch::run(&arguments, loaded, color, out);
    }
    let mut trace = arguments.trace.create()?;
    let (result, mut ran) = match &application {
        Application::Program(loaded) => {
            arguments.execute(arguments.of(loaded, trace.as_mut(), color)?, color)?
        }
        Application::System(system) => {
            arguments.execute(arguments.of_system(system, trace.as_mut())?, color)?
        }
    };
    trace.map_or(Ok(()), Out::finish)?;
    let rows = match result.map_err(|error| application.located_error(error, color)) {
        // A closed output needs no summary, but denied events still count.
        Err(error) if output::is_closed_pipe(&error) => return ran.verdict(),
        result => result?,
    };
    ran.zeros &= arguments.inputs.is_none() && arguments.plant.plant.is_none();
    ran.warn(color);
    ran.print(&arguments.file, &arguments.shown, rows, out)?;
    ran.verdict()
}

impl Run {
    fn has_rows(&self) -> bool {
        self.inputs.is_some() || self.periods.is_some() || self.batch.is_some()
    }

    /// Executes the run; returns the number of rows, if any, and the outcome. An error of the run does not discard the other results.
    fn execute<'a>(
        &self,
        mut run: impl Execution<'a>,
        color: bool,
    ) -> Result<(Result<Option<u64>>, RunOutcome<'a>)> {
        let (inputs, outputs) = (self.inputs.as_deref(), self.shown.outputs.as_deref());
        let result = match self.has_rows() {
            true => {
                let curves = self.plot.is_some().then(|| {
                    let (mut titles, mut units): (Vec<_>, Vec<_>) = run.further_curves().into_iter().unzip();
                    titles.extend(run.titles());
                    units.extend(run.units());
                    RefCell::new(
                        Curves::new(titles, run.period()).with_units(units).with_limits(run.limits()),
                    )
                });
                let tables = Tables { inputs, outputs, curves: curves.as_ref(), most: self.periods };
                let result = tables.drive(&mut run);
                // What came before a fault is worth a picture.
                if let (Some(path), Some(curves)) =
                    (&self.plot, curves.filter(|curves| !curves.borrow().is_empty()))
                {
                    let name = self.file.file_name().filter(|_| !files::is_dash(&self.file));
                    let title =
                        name.map_or_else(|| files::input_name(&self.file), |name| name.display().to_string());
                    files::write(path, curves.into_inner().draw(&title)?.as_bytes())?;
                    if !files::is_dash(path) {
                        message(&format!("the curves are in {}", path.display()));
                    }
                }
                result.map(Some)
            }
            false => run.run_to_halt().map(|()| None),
        };
        // Keep the trace: it shows the events before a fault.
        Ok((result, run.end(&self.trace, color)?))
    }

    fn of<'a, 't>(
        &self,
        loaded: &'a LoadedProgram,
        trace: Option<&'t mut Out>,
        color: bool,
    ) -> Result<ProgramRun<'a, 't>> {
        let plant = self.plant.close(loaded, self.inputs.is_some(), color)?;
        let mut emulator = Emulator::new(&loaded.program)?;
        emulator.set_tick_period(self.tick);
        let tracer = trace.map(|file| self.trace.begin(&emulator, file)).transpose()?;
        let (nans, watch, periods) = (NanWrites::default(), self.deny.watch(&loaded.program), NO_PERIODS);
        let (program, max_cycles) = (&loaded.program, self.max_cycles);
        let words =
            self.memory.iter().map(|name| memory::words(loaded, name)).collect::<Result<Vec<_>>>()?.concat();
        Ok(ProgramRun {
            file: self.file.clone(),
            loaded,
            program,
            words,
            emulator,
            max_cycles,
            tracer,
            nans,
            watch,
            periods,
            last: 0,
            reads_table: self.inputs.is_some(),
            plant,
        })
    }

    fn of_system<'a, 't>(
        &self,
        system: &'a LoadedSystem,
        trace: Option<&'t mut Out>,
    ) -> Result<SystemRun<'a, 't>> {
        let mut run = SystemRun::new(&system.description)?;
        run.max_cycles = self.max_cycles;
        run.tracer = trace.map(|file| self.trace.begin_system(&run.system, file)).transpose()?;
        run.observer = Observer::watching(&mut run.system, &self.deny);
        Ok(run)
    }
}

const NO_PERIODS: CorePeriods = CorePeriods { count: 0, shortest: 0, longest: 0, skipped: 0 };

/// A run of a program.
struct ProgramRun<'a, 't> {
    file: PathBuf,
    loaded: &'a LoadedProgram,
    program: &'a Program,
    /// Data words to show in the results.
    words: Vec<memory::Word>,
    emulator: Emulator,
    max_cycles: Option<u64>,
    tracer: Option<Tracer<'t>>,
    nans: NanWrites,
    watch: Watch,
    periods: CorePeriods,
    /// Cycles of the last period.
    last: Cycle,
    /// The inputs come from a table.
    reads_table: bool,
    plant: Option<ProgramLoop>,
}

impl ProgramRun<'_, '_> {
    /// Last values of the output ports (`None` if never written), and of the data words to show.
    fn outputs(&self) -> impl Iterator<Item = (&str, Type, Option<u32>)> {
        let ports = self.program.outputs.iter();
        let ports = ports.map(|port| (port.name.as_str(), port.ty, self.emulator.output_bits(port.register)));
        let memory = self.emulator.memory();
        ports.chain(
            self.words
                .iter()
                .map(|word| (word.title.as_str(), word.ty, memory.get(word.address as usize).copied())),
        )
    }

    fn set_inputs(&mut self, row: &Row) -> Result<()> {
        for &(register, bits) in row {
            self.emulator.set_input_bits(register, bits)?;
        }
        Ok(())
    }

    /// Inputs that the curves show beside the output table: those of a table. With a plant, the output table has all inputs.
    fn drawn_inputs(&self) -> &[Port] {
        if self.reads_table && self.plant.is_none() { &self.program.inputs } else { &[] }
    }

    /// Units that the source gives ports, as far as it does.
    fn units_of(&self, directive: &'static str, ports: &[Port]) -> Vec<Option<String>> {
        ports.iter().map(|port| units::unit(&self.loaded.sources, directive, &port.name)).collect()
    }
}

impl TableApplication for ProgramRun<'_, '_> {
    const ROWS: &'static str = "periods";

    fn units(&self) -> Vec<Option<String>> {
        let outputs = self.units_of(".output", &self.program.outputs).into_iter();
        let outputs = outputs.chain(self.words.iter().map(|_| None));
        let Some(plant) = &self.plant else { return outputs.collect() };
        let inputs = self.units_of(".input", &self.program.inputs).into_iter();
        inputs.chain(outputs).chain(plant.state_units()).collect()
    }

    fn limits(&self) -> Vec<(String, f64)> {
        let limit = |port: &Port| {
            Some((port.name.clone(), takt_analysis::limit(self.program, port.register)?.into()))
        };
        self.program.outputs.iter().filter_map(limit).collect()
    }

    fn inputs(&self) -> Vec<Port> {
        match &self.plant {
            None => self.program.inputs.clone(),
            Some(plant) => plant.connection().rest.clone(),
        }
    }

    fn optional_inputs(&self) -> Vec<Port> {
        self.plant.as_ref().map_or(Vec::new(), |plant| plant.connection().optional())
    }

    fn titles(&self) -> Vec<String> {
        let names = self.outputs().map(|(name, ..)| name.to_owned());
        let Some(plant) = &self.plant else { return names.chain(["cycles".to_owned()]).collect() };
        let inputs = self.program.inputs.iter().map(|port| port.name.clone());
        inputs.chain(names).chain(plant.state_names()).chain(["cycles".to_owned()]).collect()
    }

    fn further_curves(&self) -> Vec<(String, Option<String>)> {
        let names = self.drawn_inputs().iter().map(|port| port.name.clone());
        names.zip(self.units_of(".input", self.drawn_inputs())).collect()
    }

    fn further_values(&self) -> Vec<String> {
        let ports = self.drawn_inputs().iter();
        let text =
            |port: &Port| self.emulator.register(port.register).map(|bits| ports::format(port.ty, bits));
        ports.map(|port| text(port).unwrap_or_default()).collect()
    }

    fn row(&mut self, row: &Row) -> Result<bool> {
        match &mut self.plant {
            None => self.set_inputs(row)?,
            Some(plant) => {
                let mut row = row.clone();
                plant.begin(&mut row, |register| self.emulator.output_bits(register))?;
                self.set_inputs(&row)?;
            }
        }
        self.emulator.set_cycle_limit(self.max_cycles.unwrap_or(self.emulator.now() + PERIOD_LIMIT));
        let report = self.watch.run_period(&mut self.emulator, self.tracer.as_mut(), None);
        let report = report.with_context(|| format!("period {}", self.periods.count))?;
        if self.tracer.as_ref().is_some_and(Tracer::has_failed) {
            return Ok(false);
        }
        let periods = &mut self.periods;
        periods.shortest =
            if periods.count == 0 { report.cycles } else { periods.shortest.min(report.cycles) };
        periods.longest = periods.longest.max(report.cycles);
        periods.count += 1;
        self.last = report.cycles;
        self.nans.add(&report.nan_writes);
        Ok(true)
    }

    fn values(&self) -> Vec<String> {
        let text = |ty: Type, bits: Option<u32>| bits.map_or(String::new(), |bits| ports::format(ty, bits));
        let outputs = self.outputs().map(|(_, ty, bits)| text(ty, bits));
        let cycles = [self.last.to_string()];
        let Some(plant) = &self.plant else { return outputs.chain(cycles).collect() };
        let inputs = self.program.inputs.iter();
        let inputs = inputs.map(|port| text(port.ty, self.emulator.register(port.register)));
        inputs.chain(outputs).chain(plant.states().iter().map(f64::to_string)).chain(cycles).collect()
    }
}

impl<'a> Execution<'a> for ProgramRun<'a, '_> {
    fn period(&self) -> Option<f64> {
        let LoadedProgram { sources, constants, .. } = self.loaded;
        let plant = self.plant.as_ref().map(ProgramLoop::period);
        plant.or_else(|| units::sampling_period(sources, constants))
    }

    fn run_to_halt(&mut self) -> Result<()> {
        let zeros: Row = self.program.inputs.iter().map(|port| (port.register, 0)).collect();
        self.set_inputs(&zeros)?;
        self.emulator.set_cycle_limit(self.max_cycles.unwrap_or(PERIOD_LIMIT));
        let stop = self.watch.run(&mut self.emulator, self.tracer.as_mut());
        self.nans.add(&self.emulator.take_nan_writes());
        match stop? {
            Stop::Idle => {
                let plant = plant::beside(&self.file, self.loaded);
                let plant = plant.map(|path| format!("`--plant {} --periods 400`", path.display()));
                let table = Some(self.file.with_extension("csv")).filter(|table| table.is_file());
                let table = table.map(|path| format!("`--inputs {}`", path.display()));
                let known: Vec<String> = plant.into_iter().chain(table).collect();
                let beside = match known.is_empty() {
                    true => String::new(),
                    false => format!(", such as {}", known.join(" or ")),
                };
                bail!(
                    "the program waits for the tick: give it periods with --plant, --inputs or --periods{beside}"
                )
            }
            _ => Ok(()),
        }
    }

    fn end(mut self, trace: &TraceArguments, color: bool) -> Result<RunOutcome<'a>> {
        if let Some(tracer) = self.tracer.take() {
            trace.finish(tracer.finish(&self.emulator), self.emulator.now(), color)?;
        }
        let outputs = self.outputs().map(|(name, ty, bits)| (name.to_owned(), bits.map(|bits| (ty, bits))));
        let outputs = outputs.collect();
        let denials = self.watch.end(&self.emulator, "");
        let core = CoreOutcome::new("", self.program, &self.emulator, self.periods, denials);
        let (zeros, nans) = (!self.program.inputs.is_empty(), self.nans);
        let plant = self.plant.map(|plant| {
            let Interface { name, states, .. } = plant.interface().clone();
            PlantOutcome { name, states: states.into_iter().zip(plant.states().iter().copied()).collect() }
        });
        Ok(RunOutcome { cores: vec![core], outputs, zeros, nans, system: None, plant })
    }
}
