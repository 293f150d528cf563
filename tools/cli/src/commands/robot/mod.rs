// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt robot`: command level of the three-processor controller, at a prompt, from a script, or from a program file.

mod picture;
mod prompt;
mod summary;

use crate::run::system;
use crate::terminal::files::{self, OptionPath, Out};
use crate::terminal::interrupt;
use crate::terminal::options::{self, SourceArguments};
use crate::terminal::output::{self, Failure};
use anyhow::{Context, Result, anyhow};
use clap::Args;
use std::io::{BufRead, BufReader, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use summary::Summary;
use takt_asm::diag::{Diagnostics, Message as Mistake};
use takt_diagnostics::describe;
use takt_robot::controller::{Controller, standard};
use takt_robot::host::{Event, LinkFault};
use takt_robot::level::{Answer, Files, Message, Session};
use takt_robot::limits;
use takt_robot::plant::Plant;

/// Command a simulated six-joint robot that is controlled by three cores.
///
/// The controller is the three-processor one of the founding papers (`programs/three`): a communication, a kinematic and a
/// dynamic core in one clock, emulated cycle by cycle, and a plant in binary64. Commands come from a program in a file, from a script,
/// from standard input, or from a prompt; docs/robot-commands.md has them. Lengths are in mm, angles in degrees.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Robot {
    /// A robot program to run; without it, commands come from --script, or from standard input.
    #[arg(conflicts_with = "script")]
    file: Option<PathBuf>,
    /// Commands as at the prompt, from a file; `-` is standard input.
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Only check that FILE can run, on a copy of the robot, assuming that signals arrive.
    #[arg(long, requires = "file")]
    check: bool,
    /// Faults of the link, each at a time in s: corrupt, order, late or silent, as `corrupt@2.5,silent@4`.
    #[arg(long, value_name = "FAULT@S,...", value_delimiter = ',', value_parser = fault)]
    faults: Vec<(LinkFault, f64)>,
    /// Another controller: a system with the same host ports [default: the built-in controller].
    #[arg(long, value_name = "TOML")]
    system: Option<PathBuf>,
    /// Draw joint angles, velocities, tracking errors and the tool's path as SVG; `-` is standard output.
    #[arg(long, value_name = "SVG", value_parser = options::picture())]
    plot: Option<PathBuf>,
    /// Write what the host and the encoders say, a row for each base tick of 100 µs, as CSV for `takt run`, `cosim` and
    /// `debug` of the system; the line to the controller then takes one word a tick.
    #[arg(long, value_name = "CSV", conflicts_with = "check")]
    record: Option<PathBuf>,
    /// Print messages and tables as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt robot                                         at a prompt; `help` lists the commands
  takt robot programs/three/demonstration.robot      run a program, and print its results
  takt robot demonstration.robot --plot robot.svg    with a picture
  takt robot square.robot --check                    can it run?
  takt robot square.robot --record in.csv            keep what goes over the link, to run it again:
  takt cosim programs/three/controller.toml --inputs in.csv --periods 300
  takt robot square.robot --faults corrupt@1.5       what the controller does about a bad packet
  echo 'move joints(30, _, _, _, _, _)' | takt robot";

/// Maximum duration of a session, in s.
const LONGEST: f64 = limits::LONGEST;

/// Parses a link fault such as `corrupt@2.5`.
fn fault(text: &str) -> Result<(LinkFault, f64), String> {
    let names = || LinkFault::ALL.map(LinkFault::name).join(", ");
    let Some((name, time)) = text.split_once('@') else {
        return Err("expected a fault with its time, as in `corrupt@2.5`".to_owned());
    };
    let fault = LinkFault::ALL.into_iter().find(|fault| fault.name() == name);
    let fault = fault.ok_or_else(|| format!("there is no fault `{name}`: there are {}", names()))?;
    match time.parse::<f64>() {
        Ok(time) if (0.0..=LONGEST).contains(&time) => Ok((fault, time)),
        _ => Err(format!("`{time}` is not a time from 0 to {LONGEST} s")),
    }
}

/// Loader of files from disk.
struct DiskFiles;

impl Files for DiskFiles {
    fn read(&self, name: &str) -> Result<String, String> {
        let path = Path::new(name);
        let bytes = files::read(path, limits::PROGRAM_BYTES).map_err(|error| describe(error.as_ref()))?;
        String::from_utf8(bytes).map_err(|_| format!("{name} is not UTF-8 text"))
    }

    fn write(&self, name: &str, text: &str) -> Result<(), String> {
        files::write(Path::new(name), text.as_bytes()).map_err(|error| describe(error.as_ref()))
    }
}

/// A session with its output.
struct RobotConsole<'o> {
    session: Session<Controller>,
    interrupt: Arc<AtomicBool>,
    out: &'o mut Out,
    color: bool,
    json: bool,
    messages: Vec<Message>,
    mistakes: Vec<Mistake>,
    failed: bool,
}

pub(crate) fn run(arguments: &Robot, color: bool, out: &mut Out) -> Result<()> {
    let mut reads: Vec<OptionPath<'_>> = Vec::new();
    reads.extend(arguments.file.as_deref().map(|path| ("FILE", path)));
    reads.extend(arguments.script.as_deref().map(|path| ("--script", path)));
    reads.extend(arguments.system.as_deref().map(|path| ("--system", path)));
    let mut writes: Vec<OptionPath<'_>> = Vec::new();
    writes.extend(arguments.plot.as_deref().map(|path| ("--plot", path)));
    writes.extend(arguments.record.as_deref().map(|path| ("--record", path)));
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&reads, &writes)?;
    let text_of = |path: &Path| -> Result<(String, String)> {
        let name = files::input_name(path);
        let bytes = files::read(path, limits::PROGRAM_BYTES)?;
        let text = String::from_utf8(bytes).map_err(|_| anyhow!("{name} is not UTF-8 text"))?;
        Ok((name, text))
    };
    let program = arguments.file.as_deref().map(text_of).transpose()?;
    let script = arguments.script.as_deref().map(text_of).transpose()?;

    let description = match &arguments.system {
        Some(path) => system::load(path, &SourceArguments::default(), color)?.description,
        None => standard().map_err(Failure::Diagnostics)?,
    };
    let mut controller = Controller::new(&description, Plant::standard())?;
    if arguments.record.is_some() {
        controller.keep_host_actions();
    }
    let interrupt = Arc::new(AtomicBool::new(false));
    let mut session = Session::new(controller, Arc::new(DiskFiles), Arc::clone(&interrupt))?;
    for (fault, time) in &arguments.faults {
        session.schedule(time - session.host().time(), Event::Fault(*fault));
    }
    let heard = Arc::clone(&interrupt);
    interrupt::on_interrupt(move || heard.store(true, Ordering::Relaxed))?;
    let json = arguments.json;
    let (messages, mistakes) = (Vec::new(), Vec::new());
    let mut desk = RobotConsole { session, interrupt, out, color, json, messages, mistakes, failed: false };
    let plotted =
        [&arguments.plot, &arguments.record].iter().any(|path| path.as_deref().is_some_and(files::is_dash));
    desk.json |= plotted;
    match (program, script) {
        (Some((name, text)), _) if arguments.check => {
            let result = desk.session.check(&name, &text);
            desk.print_messages(result)?;
        }
        (Some((name, text)), _) => desk.program(&name, &text)?,
        (None, Some((name, text))) => desk.lines(&name, &mut text.as_bytes())?,
        (None, None) if std::io::stdin().is_terminal() && !desk.json => prompt::run(&mut desk)?,
        (None, None) => desk.lines("standard input", &mut BufReader::new(std::io::stdin()))?,
    }
    // An error that aborted the program has already stopped the robot.
    let broken_off = desk.failed && arguments.file.is_some();
    if !(arguments.check || desk.session.quit || broken_off) {
        let result = desk.session.finish();
        desk.print_messages(result)?;
    }
    let controller = desk.session.host().robot();
    if let Some(path) = &arguments.record {
        system::record::write(controller.system(), path)?;
    }
    let summary = Summary::of(controller, desk.session.host().time());
    if let Some(path) = &arguments.plot {
        let name = arguments.file.as_deref().or(arguments.script.as_deref());
        let title = name.map_or_else(|| "the session".to_owned(), files::input_name);
        let svg = picture::draw(&title, controller.records())?;
        if files::is_dash(path) {
            desk.out.write_all(svg.as_bytes())?;
        } else {
            files::write(path, svg.as_bytes())?;
        }
    }
    if arguments.json {
        let value = summary.json(&desk.messages, &desk.mistakes);
        files::json(&value, desk.out)?;
    } else if !plotted && summary.moved() {
        desk.out.write_all(summary.text().as_bytes())?;
    }
    if desk.failed { Err(Failure::Reported.into()) } else { Ok(()) }
}

impl RobotConsole<'_> {
    /// Prints the pending messages.
    fn show(&mut self) -> Result<()> {
        for message in self.session.take_messages() {
            if self.json {
                self.messages.push(message);
                continue;
            }
            let mut lines = message.text.lines();
            let first = lines.next().unwrap_or("");
            writeln!(self.out, "{:>9.3} s  {first}", message.time)?;
            for line in lines {
                writeln!(self.out, "{:13}{line}", "")?;
            }
            // Show messages at once: a minute of robot time takes a while to simulate.
            self.out.flush()?;
        }
        Ok(())
    }

    /// Prints the messages of a command and any mistakes in it.
    fn print_messages<T>(&mut self, result: Result<T, Diagnostics>) -> Result<Option<T>> {
        self.show()?;
        match result {
            Ok(value) => Ok(Some(value)),
            Err(mistakes) => {
                self.failed = true;
                if self.json {
                    self.mistakes.extend(mistakes.messages());
                } else {
                    // Flush, to keep the order with earlier output.
                    self.out.flush()?;
                    output::message(&mistakes.render(self.color));
                }
                Ok(None)
            }
        }
    }

    /// Runs a program; prints its messages as they occur.
    fn program(&mut self, name: &str, text: &str) -> Result<()> {
        let begun = self.session.begin(name, text);
        let Some(mut running) = self.print_messages(begun)? else { return Ok(()) };
        loop {
            let more = self.session.advance(&mut running);
            if self.print_messages(more)? != Some(true) {
                return Ok(());
            }
        }
    }

    /// Executes all commands, each a line or a block of lines, and continues after errors.
    fn lines(&mut self, name: &str, lines: &mut dyn BufRead) -> Result<()> {
        let mut text = String::new();
        let mut lines = lines.lines();
        loop {
            let line = lines.next().transpose().with_context(|| format!("cannot read {name}"))?;
            let last = line.is_none();
            if let Some(line) = line {
                text.push_str(&line);
                text.push('\n');
            }
            let answer = self.session.enter(name, &text, !last);
            if self.print_messages(answer)? != Some(Answer::More) {
                text.clear();
            }
            if last || self.session.quit {
                return Ok(());
            }
            if text.len() > limits::PROGRAM_BYTES {
                return Err(anyhow!("{name}: a block of more than {} bytes", limits::PROGRAM_BYTES));
            }
        }
    }
}
