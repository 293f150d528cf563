//! `takt debug`: a session at a prompt, from a script, or full-screen.

use crate::controller::OnEmulator;
use crate::files::{self, Given, Out};
use crate::load::{Load, Loaded};
use crate::output::{self, Failure};
use crate::ports::Inputs;
use crate::run::tick;
use crate::select::PAPER_CLOCK;
use crate::select::{self, OptionalMachine};
use crate::track::{self, period_cycles};
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use rustyline::completion::Completer;
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::MemHistory;
use rustyline::validate::Validator;
use rustyline::{Config, Editor, Helper};
use std::cell::RefCell;
use std::io::{BufRead, BufReader, IsTerminal, Write};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use takt_debug::console::{Console, complete, first_mistake};
use takt_debug::session::{Options, Rows, Session, Unit, Why};
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
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
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
  takt debug prog.s --inputs in.csv          with recorded inputs
  takt debug prog.s --script checks.txt      commands from a file: a test
  takt debug --track                         the robot's controller, where the tracking error is largest";

/// Rows of inputs; more is an error.
const ROWS: usize = 1 << 20;
/// Bytes of a script.
const SCRIPT_LIMIT: usize = 16 << 20;

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

    let interrupt = Arc::new(AtomicBool::new(false));
    let load = Load::new(arguments.machine.machine, color);
    let session = if arguments.track {
        let path = arguments.file.as_deref().unwrap_or(Path::new("tracking"));
        let (name, loaded) = track::program(path, load)?;
        along_path(arguments, &name, loaded, &interrupt, out)?
    } else {
        let path = arguments.file.as_deref().context("no file")?;
        let loaded = load.with_source(path)?;
        let inputs = arguments.inputs.as_deref().map(|path| rows(path, &loaded)).transpose()?;
        let Loaded { program, constants, sources } = loaded;
        let tick = arguments.tick;
        Session::new(
            &program,
            Options { inputs, tick, constants, sources, interrupt: Arc::clone(&interrupt) },
        )?
    };
    let mut console = Console::new(session);
    let place = console.place();
    out.write_all(place.as_bytes())?;
    match script {
        Some((name, text)) => batch(&mut console, &name, &mut text.as_bytes(), color, out)?,
        None if std::io::stdin().is_terminal() => prompt(console, &interrupt, color, out)?,
        None => batch(&mut console, "standard input", &mut BufReader::new(std::io::stdin()), color, out)?,
    }
    Ok(())
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
    let mut inputs = Inputs::open(path, &loaded.program.inputs)?;
    let (mut rows, mut row) = (Vec::new(), Vec::new());
    while inputs.next(&mut row)? {
        if rows.len() == ROWS {
            bail!("{name} has more than {ROWS} rows");
        }
        rows.push(row.clone());
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
    interrupt: &Arc<AtomicBool>,
    out: &mut Out,
) -> Result<Session> {
    let Loaded { program, constants, sources } = loaded;
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
    let mut session = Session::new(
        &program,
        Options { inputs, tick, constants, sources, interrupt: Arc::clone(interrupt) },
    )?;
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

/// Completion over the session of the prompt.
struct Prompt(Rc<RefCell<Console>>);

impl Helper for Prompt {}
impl Highlighter for Prompt {}
impl Validator for Prompt {}
impl Hinter for Prompt {
    type Hint = String;
}

impl Completer for Prompt {
    type Candidate = String;

    fn complete(
        &self,
        line: &str,
        at: usize,
        _: &rustyline::Context<'_>,
    ) -> rustyline::Result<(usize, Vec<String>)> {
        Ok(complete(&self.0.borrow().session, &line[..at]))
    }
}

fn prompt(console: Console, interrupt: &Arc<AtomicBool>, color: bool, out: &mut Out) -> Result<()> {
    let flag = Arc::clone(interrupt);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("cannot catch Ctrl-C")?;
    let console = Rc::new(RefCell::new(console));
    let config = Config::builder().auto_add_history(true).build();
    let mut editor: Editor<Prompt, MemHistory> =
        Editor::with_history(config, MemHistory::new()).context("cannot use the terminal")?;
    editor.set_helper(Some(Prompt(Rc::clone(&console))));
    loop {
        out.flush()?;
        let line = match editor.readline("(takt) ") {
            Ok(line) => line,
            Err(ReadlineError::Interrupted) => continue,
            Err(ReadlineError::Eof) => return Ok(()),
            Err(error) => return Err(error).context("cannot read the terminal"),
        };
        interrupt.store(false, Ordering::Relaxed);
        let mut console = console.borrow_mut();
        match console.execute(&line) {
            Ok(text) => out.write_all(text.as_bytes())?,
            Err(error) => output::error(&error, color),
        }
        if console.quit {
            return Ok(());
        }
    }
}
