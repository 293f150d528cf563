//! `takt debug`: a session at a prompt, from a script, or full-screen.

mod history;
mod prompt;
mod screen;

use crate::controller::OnEmulator;
use crate::files::{self, Given, Out};
use crate::load::{Load, Loaded};
use crate::output::{self, Failure};
use crate::ports;
use crate::run::tick;
use crate::select::{self, OptionalMachine, PAPER_CLOCK};
use crate::track::{self, period_cycles};
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use indicatif::HumanCount;
use std::io::{BufRead, BufReader, IsTerminal, Write};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;
use takt_debug::console::{Console, first_mistake};
use takt_debug::session::{Control, Options, Rows, Session, Unit, Why};
use takt_emu::Emulator;
use takt_programs::hybrid::closed_loop::ClosedLoop;

/// Step through a program, forth and back, and look at everything.
///
/// At the prompt, `help` lists the commands. They may also come from a script or from standard input; then the exit status
/// is 1 if a command was wrong or a `check` failed.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Debug {
    /// Source or image. With --track, `tracking` (as if nothing is said), `tracking_literal`, or a file.
    #[arg(required_unless_present = "track")]
    file: Option<PathBuf>,
    #[command(flatten)]
    machine: OptionalMachine,
    /// CSV with one named column for each input port and one row for each period.
    #[arg(long, value_name = "CSV", conflicts_with = "track")]
    inputs: Option<PathBuf>,
    /// The tick comes every so many cycles, up to 100000000 [default: when the program is ready].
    #[arg(long, value_name = "CYCLES", value_parser = tick, allow_negative_numbers = true, conflicts_with = "track")]
    tick: Option<NonZeroU64>,
    /// Commands from a file; `-` is standard input.
    #[arg(long, value_name = "FILE", conflicts_with = "tui")]
    script: Option<PathBuf>,
    /// Full-screen: source, bundle, registers, operations in flight, stalls, ports, watches, and the same commands.
    #[arg(long)]
    tui: bool,
    /// Run the program as the hybrid robot's controller along the tool path first, and begin in the period in which the
    /// tracking error is largest.
    #[arg(long)]
    track: bool,
    /// With --track: tool path in G-code [default: the letters AGH].
    #[arg(long, value_name = "FILE", requires = "track")]
    gcode: Option<PathBuf>,
    /// With --track: stop after this many periods [default: the whole path].
    #[arg(long, value_name = "N", value_parser = select::count, requires = "track", allow_negative_numbers = true)]
    periods: Option<u64>,
}

const EXAMPLES: &str = "\
Examples:
  takt debug prog.s                          at a prompt
  takt debug prog.s --tui                    full-screen; `?` shows keys and commands
  takt debug prog.s --inputs in.csv          with recorded inputs
  takt debug prog.s --script checks.txt      commands from a file: a test
  takt debug --track                         the robot's controller, where the tracking error is largest";

/// Rows of inputs; more is an error.
const ROWS: usize = 1 << 20;
/// Bytes of a script.
const SCRIPT_LIMIT: usize = 16 << 20;
/// How often a command that runs is looked after.
const WATCH: Duration = Duration::from_millis(50);

pub(crate) fn run(arguments: &Debug, color: bool, out: &mut Out) -> Result<()> {
    let mut reads: Vec<Given<'_>> = Vec::new();
    reads.extend(arguments.file.as_deref().map(|path| ("FILE", path)));
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    reads.extend(arguments.gcode.as_deref().map(|path| ("--gcode", path)));
    reads.extend(arguments.script.as_deref().map(|path| ("--script", path)));
    files::check(&reads, &[])?;
    let reads_stdin = arguments.script.is_none();
    if reads_stdin && reads.iter().any(|(_, path)| files::is_dash(path)) {
        let text = "commands come from standard input: give --script, or files in place of `-`";
        return Err(Failure::Usage(text.to_owned()).into());
    }
    // A mistake in a script is found before the program runs.
    let script = arguments.script.as_deref().map(script).transpose()?;

    if arguments.tui && !(std::io::stdin().is_terminal() && std::io::stdout().is_terminal()) {
        let text = "--tui wants a terminal as standard input and output; without one, commands come from --script or standard input";
        return Err(Failure::Usage(text.to_owned()).into());
    }

    let control = Arc::new(Control::default());
    let load = Load::new(arguments.machine.machine, color);
    let session = if arguments.track {
        let path = arguments.file.as_deref().unwrap_or(Path::new("tracking"));
        let (name, loaded) = track::program(path, load)?;
        along_path(arguments, &name, loaded, &control, out)?
    } else {
        let path = arguments.file.as_deref().context("no file")?;
        let loaded = load.with_source(path)?;
        let inputs = arguments.inputs.as_deref().map(|path| rows(path, &loaded)).transpose()?;
        changed_sources(path, &loaded, color);
        let Loaded { program, constants, sources, names } = loaded;
        let (tick, control) = (arguments.tick, Arc::clone(&control));
        Session::new(&program, Options { inputs, tick, constants, sources, names, control })?
    };
    let mut console = Console::new(session);
    if arguments.tui {
        out.flush()?;
        return screen::run(&mut console, &control);
    }
    let place = console.place();
    out.write_all(place.as_bytes())?;
    match script {
        Some((name, text)) => batch(&mut console, &name, &mut text.as_bytes(), color, out)?,
        None if std::io::stdin().is_terminal() => prompt::run(console, &control, color, out)?,
        None => batch(&mut console, "standard input", &mut BufReader::new(std::io::stdin()), color, out)?,
    }
    Ok(())
}

/// Warns of sources that were changed since the image that is debugged was made of them. They are looked for where the
/// assembler looks, from the image's folder on; one that is not there is no one's mistake, for the image has its text.
fn changed_sources(path: &Path, loaded: &Loaded, color: bool) {
    let folder = path.parent().unwrap_or(Path::new(""));
    for (name, text) in &loaded.sources {
        let file = folder.join(name);
        let Some(size) = file.metadata().ok().filter(|of| of.is_file()).map(|of| of.len()) else { continue };
        let is_same = || std::fs::read(&file).is_ok_and(|now| now == text.as_bytes());
        if size != text.len() as u64 || !is_same() {
            let text =
                format!("{name} has changed since {} was made; shown is what it was then", path.display());
            output::warning(&text, color);
        }
    }
}

/// A script's name and text.
fn script(path: &Path) -> Result<(String, String)> {
    let name = files::input_name(path);
    let text = String::from_utf8(files::read(path, SCRIPT_LIMIT)?);
    let text = text.map_err(|_| anyhow!("{name} is not UTF-8 text"))?;
    if let Some((line, mistake)) = first_mistake(&text) {
        bail!("{name}:{line}: {mistake}");
    }
    Ok((name, text))
}

fn rows(path: &Path, loaded: &Loaded) -> Result<Arc<Rows>> {
    let name = files::input_name(path);
    let rows = ports::read_rows(path, &loaded.program.inputs, ROWS as u64 + 1)?;
    if rows.len() > ROWS {
        bail!("{name} has more than {ROWS} rows");
    }
    if rows.is_empty() {
        bail!("{name} has a header and no row, so there is no period to run");
    }
    Ok(Arc::new(rows))
}

/// A session on what the controller did along the tool path, where the tracking error is largest.
fn along_path(
    arguments: &Debug,
    name: &str,
    loaded: Loaded,
    control: &Arc<Control>,
    out: &mut Out,
) -> Result<Session> {
    let Loaded { program, constants, sources, names } = loaded;
    let (path, trajectory) = track::trajectory(arguments.gcode.as_deref())?;
    let periods = arguments.periods.unwrap_or(u64::MAX).min(trajectory.periods());
    if periods > ROWS as u64 {
        bail!("{path} has {periods} periods; a session holds {ROWS} (see --periods)");
    }
    let tick = period_cycles(PAPER_CLOCK);
    let mut emulator = Emulator::new(&program)?;
    emulator.set_tick_period(tick);
    let controller = OnEmulator::new(emulator, periods - 1).with_context(|| name.to_owned())?;
    let registers = controller.inputs();
    let mut closed_loop = ClosedLoop::new(&trajectory, controller);
    let (mut rows, mut worst) = (Vec::new(), (0, -1.0, false));
    let progress = track::progress(periods, "periods", false);
    for _ in 0..periods {
        let record = closed_loop.next().context("the path ended early")?.with_context(|| path.clone())?;
        rows.push(registers.iter().copied().zip(record.inputs.to_words()).collect::<Vec<_>>());
        if record.tool_error > worst.1 {
            worst = (record.period, record.tool_error, record.sample.cutting);
        }
        if record.period.is_multiple_of(4096) {
            progress.set_position(record.period);
        }
    }
    progress.finish_and_clear();
    let inputs = Some(Arc::new(rows));
    let control = Arc::clone(control);
    let mut session = Session::new(&program, Options { inputs, tick, constants, sources, names, control })?;
    let (period, error, cutting) = worst;
    let doing = if cutting { "cutting" } else { "not cutting" };
    writeln!(
        out,
        "{name} along {path}, {periods} periods: the largest tracking error is {:.3} µm, in period {period} ({doing})",
        error * 1e6
    )?;
    // To where the period's first bundle is about to issue.
    let why = match session.go_to_period(period) {
        Why::Done => session.step(Unit::Bundle),
        why => why,
    };
    if why != Why::Done {
        bail!("period {period} cannot be reached: {why:?}");
    }
    Ok(session)
}

/// Commands from a file or a pipe: all are executed, whatever becomes of one.
fn batch(
    console: &mut Console,
    name: &str,
    lines: &mut dyn BufRead,
    color: bool,
    out: &mut Out,
) -> Result<()> {
    let mut failed = false;
    for (number, line) in (1..).zip(lines.lines()) {
        let line = line.with_context(|| format!("cannot read {name}"))?;
        if !line.trim().is_empty() {
            writeln!(out, "(takt) {}", line.trim())?;
        }
        match console.execute(&line) {
            Ok(text) => out.write_all(text.as_bytes())?,
            Err(error) => {
                failed = true;
                // In order with what was written before.
                out.flush()?;
                output::error(&format!("{name}:{number}: {error}"), color);
            }
        }
        if console.quit {
            break;
        }
    }
    if failed { Err(Failure::Reported.into()) } else { Ok(()) }
}

/// Executes a line in a thread of its own; `meanwhile` is called every so often until there is an answer.
fn execute(
    console: &mut Console,
    line: &str,
    control: &Control,
    mut meanwhile: impl FnMut() -> Result<()>,
) -> Result<Result<String, String>> {
    control.clear();
    thread::scope(|scope| {
        let (sender, answer) = mpsc::channel();
        scope.spawn(move || sender.send(console.execute(line)));
        loop {
            match answer.recv_timeout(WATCH) {
                Ok(answer) => return Ok(answer),
                Err(mpsc::RecvTimeoutError::Timeout) => meanwhile().inspect_err(|_| control.interrupt())?,
                Err(mpsc::RecvTimeoutError::Disconnected) => bail!("`{line}` ended without an answer"),
            }
        }
    })
}

/// What to say of a command that runs.
fn running(control: &Control) -> String {
    format!("in cycle {}; Ctrl-C stops", HumanCount(control.cycle()))
}
