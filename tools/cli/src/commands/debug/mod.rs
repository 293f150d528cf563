// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt debug`: a session at a prompt, from a script, or in the full-screen view.

#[cfg(feature = "board")]
mod board;
mod prompt;
#[cfg(feature = "tui")]
mod screen;

use crate::commands::left_out;
use crate::commands::track::{ClosedLoopArguments, Recording};
use crate::run::load::{self, Load};
use crate::run::loaded_program::LoadedProgram;
use crate::run::parameters::ParameterArguments;
use crate::run::ports;
use crate::run::system;
use crate::terminal::files::{self, OptionPath, Out};
use crate::terminal::interrupt;
use crate::terminal::number;
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::output::{self, Failure};
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use indicatif::HumanCount;
use std::io::{BufRead, BufReader, IsTerminal, Write};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;
use takt_debug::console::{Console, Target, first_mistake};
use takt_debug::session::{Control, Options, Session, StopReason, Unit};
use takt_emu::Rows;

/// Step through a program, forward and back, and look at everything.
///
/// At the prompt, `help` lists the commands. They may also come from a script or from standard input; then the exit status
/// is 1 if a command was wrong or a `check` failed.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Debug {
    /// Source or image, or a system, a `.toml` file. With --track, `tracking` (the default), another name that
    /// `takt track --program` knows, or a file.
    #[arg(required_unless_present = "track")]
    pub(crate) file: Option<PathBuf>,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// CSV with one named column for each input port and one row for each period [default: the ports are 0].
    #[arg(long, value_name = "CSV", conflicts_with = "track")]
    inputs: Option<PathBuf>,
    #[command(flatten)]
    parameters: ParameterArguments,
    /// Cycles from tick to tick, up to 100000000 [default: the tick comes when the program is ready].
    #[arg(long, value_name = "CYCLES", value_parser = number::tick, allow_hyphen_values = true, conflicts_with = "track")]
    tick: Option<NonZeroU64>,
    /// Commands from a file; `-` is standard input.
    #[arg(long, value_name = "FILE", conflicts_with = "tui")]
    script: Option<PathBuf>,
    /// Full-screen: source, bundle, registers, operations in flight, stalls, ports, watches, and the same commands.
    #[arg(long)]
    tui: bool,
    /// Debug the program on the board at this serial port, which must carry it; it stops only at the end of a period.
    #[arg(long, value_name = "PORT", conflicts_with_all = ["inputs", "tick", "track", "tui"])]
    board: Option<PathBuf>,
    /// Baud rate of the board, as in the wiring file.
    #[arg(long, default_value_t = number::BAUD, requires = "board")]
    baud: u32,
    /// Start the board's program again and hold it at its first `wait`; otherwise it is held at the end of the current period.
    #[arg(long, requires = "board")]
    restart: bool,
    /// Let the board's outputs drive after --restart or `goto start`. Periods then last as long as commands take: connect nothing that
    /// depends on their timing.
    #[arg(long, requires = "board")]
    drive: bool,
    #[command(flatten)]
    closed_loop: ClosedLoopArguments,
}

const EXAMPLES: &str = "\
Examples:
  takt debug prog.s                          at a prompt
  takt debug prog.s --tui                    full-screen; `?` shows keys and commands
  takt debug prog.s --inputs in.csv          with recorded inputs
  takt debug prog.s --script checks.txt      commands from a file: a test
  takt debug system.toml --inputs in.csv     several cores in one time: a base tick for each row; with --tui, too
  takt debug prog.s --board /dev/ttyUSB0     on a board that carries it, a period at a time
  takt debug --track                         the robot's controller, where the tracking error is largest";

/// Maximum number of input rows.
const ROWS: usize = 1 << 20;
/// Maximum size of a script in bytes.
const SCRIPT_LIMIT: usize = 16 << 20;
/// Interval between two progress checks of a running command.
const WATCH: Duration = Duration::from_millis(50);

pub(crate) fn run(arguments: &Debug, color: bool, out: &mut Out) -> Result<()> {
    let mut reads: Vec<OptionPath<'_>> = Vec::new();
    reads.extend(arguments.file.as_deref().map(|path| ("FILE", path)));
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    reads.extend(arguments.closed_loop.gcode.as_deref().map(|path| ("--gcode", path)));
    reads.extend(arguments.closed_loop.spread.as_deref().map(|path| ("--spread", path)));
    reads.extend(arguments.script.as_deref().map(|path| ("--script", path)));
    files::check(&reads, &[])?;
    let reads_stdin = arguments.script.is_none();
    if reads_stdin && reads.iter().any(|(_, path)| files::is_dash(path)) {
        let text = "commands come from standard input: give --script, or files in place of `-`";
        return Err(Failure::Usage(text.to_owned()).into());
    }
    if let Some(_port) = &arguments.board {
        #[cfg(feature = "board")]
        return board::run(arguments, _port, color, out);
        #[cfg(not(feature = "board"))]
        return left_out::left_out("board");
    }
    let is_system = arguments.file.as_deref().is_some_and(load::is_system);
    let target = if is_system { Target::System } else { Target::Program };
    // Check the script before anything runs.
    let script = arguments.script.as_deref().map(|path| script(path, target)).transpose()?;

    if arguments.tui && !cfg!(feature = "tui") {
        return left_out::left_out("tui");
    }
    if arguments.tui && !(std::io::stdin().is_terminal() && std::io::stdout().is_terminal()) {
        let text = "--tui needs a terminal as standard input and output; without one, commands come from --script or standard input";
        return Err(Failure::Usage(text.to_owned()).into());
    }

    let control = Arc::new(Control::default());
    let OpenedSession { mut console, note, .. } = open(arguments, &control, color)?;
    if let Some(note) = note {
        writeln!(out, "{note}")?;
    }
    #[cfg(feature = "tui")]
    if arguments.tui {
        out.flush()?;
        return screen::run(&mut console, &control);
    }
    if script.is_none() && std::io::stdin().is_terminal() {
        let heard = Arc::clone(&control);
        interrupt::on_interrupt(move || heard.interrupt())?;
    }
    let place = console.place();
    converse(console, &place, script, &control, &AtomicBool::new(false), color, out)
}

/// Executes commands from a script, the prompt or standard input until they end or `ended` is set; `place` describes the start of the
/// session.
fn converse(
    mut console: Console,
    place: &str,
    script: Option<(String, String)>,
    control: &Arc<Control>,
    ended: &AtomicBool,
    color: bool,
    out: &mut Out,
) -> Result<()> {
    out.write_all(place.as_bytes())?;
    let mut stdin = BufReader::new(std::io::stdin());
    let done = match script {
        Some((name, text)) => batch(&mut console, &name, &mut text.as_bytes(), ended, color, out),
        None if std::io::stdin().is_terminal() => return prompt::run(console, control, color, out),
        None => batch(&mut console, "standard input", &mut stdin, ended, color, out),
    };
    done.and(leave(&mut console, out))
}

/// Ends a session and prints its final message.
fn leave(console: &mut Console, out: &mut Out) -> Result<()> {
    let left = console.leave().map_err(|error| anyhow!("{error}"))?;
    Ok(out.write_all(left.as_bytes())?)
}

/// A session opened from the command line.
pub(crate) struct OpenedSession {
    pub(crate) console: Console,
    /// Reason for the initial position.
    pub(crate) note: Option<String>,
    /// Source files of the cores' programs, for the debug adapter.
    #[cfg_attr(not(feature = "editor"), expect(dead_code, reason = "the debug adapter is left out"))]
    pub(crate) files: Vec<PathBuf>,
}

/// Opens a session on the emulator for a program or a system.
pub(crate) fn open(arguments: &Debug, control: &Arc<Control>, color: bool) -> Result<OpenedSession> {
    if let Some(file) = arguments.file.as_deref().filter(|file| load::is_system(file)) {
        check_system(arguments)?;
        let mut loaded = system::load(file, &arguments.source, color)?;
        arguments.parameters.apply_to_system(&mut loaded)?;
        let files = loaded.files.clone();
        let console = system::debug::console(loaded, arguments.inputs.as_deref(), ROWS, control)?;
        return Ok(OpenedSession { console, note: None, files });
    }
    let (session, note) = open_program(arguments, control, color)?;
    let files = vec![arguments.file.clone().unwrap_or_default()];
    Ok(OpenedSession { console: Console::new(session), note, files })
}

/// Rejects options that sessions on systems lack.
fn check_system(arguments: &Debug) -> Result<()> {
    let refused = [
        ("--machine", arguments.machine.machine.is_some(), "the system's file names each core's"),
        ("--tick", arguments.tick.is_some(), "the system's file has it"),
        ("--track", arguments.closed_loop.track, "it is for a program"),
    ];
    for (option, given, why) in refused {
        if given {
            return Err(Failure::Usage(format!("{option} cannot be used with a system: {why}")).into());
        }
    }
    Ok(())
}

fn open_program(arguments: &Debug, control: &Arc<Control>, color: bool) -> Result<(Session, Option<String>)> {
    let load = Load::new(arguments.machine.machine, color).with(&arguments.source);
    if arguments.closed_loop.track {
        let recording = arguments.closed_loop.record(arguments.file.as_deref(), load, ROWS)?;
        let (session, why) = in_recording(recording, control)?;
        return Ok((session, Some(why)));
    }
    let path = arguments.file.as_deref().context("no file")?;
    let mut loaded = load.with_source(path)?;
    arguments.parameters.set(&mut loaded.program)?;
    let inputs = arguments.inputs.as_deref().map(|path| rows(path, &loaded)).transpose()?;
    changed_sources(path, &loaded, color);
    let LoadedProgram { program, constants, sources, names, .. } = loaded;
    let (tick, control) = (arguments.tick, Arc::clone(control));
    Ok((Session::new(&program, Options { inputs, tick, constants, sources, names, control })?, None))
}

/// Warns of sources that have changed since the image was written. They are searched like includes, starting from the image's folder; a
/// missing source is not an error, since the image contains its text.
fn changed_sources(path: &Path, loaded: &LoadedProgram, color: bool) {
    let folder = path.parent().unwrap_or(Path::new(""));
    for (name, text) in &loaded.sources {
        let file = folder.join(name);
        let Some(size) = file.metadata().ok().filter(|of| of.is_file()).map(|of| of.len()) else { continue };
        let is_same = || std::fs::read(&file).is_ok_and(|now| now == text.as_bytes());
        if size != text.len() as u64 || !is_same() {
            let text = format!(
                "{name} has changed since {} was made; the listing shows its text of that time",
                path.display()
            );
            output::warning(&text, color);
        }
    }
}

/// Name and text of a script.
fn script(path: &Path, target: Target) -> Result<(String, String)> {
    let name = files::input_name(path);
    let text = String::from_utf8(files::read(path, SCRIPT_LIMIT)?);
    let text = text.map_err(|_| anyhow!("{name} is not UTF-8 text"))?;
    if let Some((line, mistake)) = first_mistake(&text, target) {
        bail!("{name}:{line}: {mistake}");
    }
    Ok((name, text))
}

fn rows(path: &Path, loaded: &LoadedProgram) -> Result<Arc<Rows>> {
    let rows = ports::rows(Some(path), Some(ROWS as u64 + 1), 0, &loaded.program.inputs)?;
    if rows.len() > ROWS {
        bail!("{} has more than {ROWS} rows", files::input_name(path));
    }
    Ok(Arc::new(rows))
}

/// Opens a session on a recorded closed loop, at the period of interest.
fn in_recording(recording: Recording, control: &Arc<Control>) -> Result<(Session, String)> {
    let Recording { loaded, inputs, tick, period, why: reason } = recording;
    let LoadedProgram { program, constants, sources, names, .. } = loaded;
    let (inputs, control) = (Some(Arc::new(inputs)), Arc::clone(control));
    let mut session = Session::new(&program, Options { inputs, tick, constants, sources, names, control })?;
    // Advance to just before the period's first bundle issues.
    let why = match session.go_to_period(period) {
        StopReason::Done => session.step(Unit::Bundle),
        why => why,
    };
    if why != StopReason::Done {
        bail!("period {period} cannot be reached: {why:?}");
    }
    Ok((session, reason))
}

/// Executes all commands of a file or pipe, even after errors.
fn batch(
    console: &mut Console,
    name: &str,
    lines: &mut dyn BufRead,
    ended: &AtomicBool,
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
                // Flush, to keep the order with earlier output.
                out.flush()?;
                output::error(&format!("{name}:{number}: {error}"), color);
            }
        }
        if ended.load(Ordering::Relaxed) {
            bail!("{name}:{number}: interrupted");
        }
        if console.quit {
            break;
        }
    }
    if failed { Err(Failure::Reported.into()) } else { Ok(()) }
}

/// Executes a line in another thread; calls `meanwhile` at intervals until the line is done.
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

/// Progress text of a running command.
fn running(counts: &str, control: &Control) -> String {
    format!("in {counts} {}; Ctrl-C stops", HumanCount(control.cycle()))
}
