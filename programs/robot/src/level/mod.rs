// SPDX-License-Identifier: MIT OR Apache-2.0
//! Command level: a session that executes commands and programs on a [`Robot`] behind the [`Host`]'s end of the link. Nothing here prints
//! or opens files: messages are taken with [`Session::take_messages`], files are [`Files`].
//!
//! The files import each other in a circle because they share the session: it executes operations (`execute.rs`), which act on it
//! (`actions.rs`).

mod actions;
mod execute;
pub mod value;

use crate::dynamics::Joints;
use crate::geometry::pose_of;
use crate::host::{Event, Host, HostEvent, Problem, Robot, degrees};
use crate::language::code::{Code, KnownNames, compile};
use crate::language::tree::{Console, StatementKind};
use crate::language::{parse, table};
use crate::limits;
use crate::packet::{JogMode, Profile, ReportKind};
use execute::Machine;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use takt_diagnostics::diag::{Diagnostic, Diagnostics};
use takt_diagnostics::nearest;
use takt_diagnostics::source::{Lines, Sources, Span};
use value::Value;

/// File access of a session. Errors are texts for the user.
pub trait Files {
    /// Returns the text of a file.
    ///
    /// # Errors
    /// If it cannot be read.
    fn read(&self, name: &str) -> Result<String, String>;
    /// Writes a file, replacing its contents.
    ///
    /// # Errors
    /// If it cannot be written.
    fn write(&self, name: &str, text: &str) -> Result<(), String>;
}

/// File access that refuses every file.
pub struct NoFiles;

impl Files for NoFiles {
    fn read(&self, name: &str) -> Result<String, String> {
        Err(format!("there is no file {name}"))
    }

    fn write(&self, name: &str, _: &str) -> Result<(), String> {
        Err(format!("{name} cannot be written"))
    }
}

/// Message to the session's observer.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Message {
    /// Time since power-up, s.
    pub time: f64,
    /// Kind: `say`, `note`, `signal`, `stopped`, `caught` or `check`.
    pub kind: &'static str,
    /// Text of the message.
    pub text: String,
}

/// Outcome of an entered text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The text has been executed.
    Done,
    /// A block is open: enter the same text again with further lines.
    More,
}

/// Defaults for motions without settings of their own.
#[derive(Clone, Debug)]
struct Settings {
    /// Speeds in deg/s and mm/s; `None`: as fast as the limits allow.
    speed: Option<(f64, f64)>,
    profile: Profile,
    /// Tool point in the flange's frame, mm.
    tool: [f64; 3],
    /// Limits in rad/s and N·m.
    limits: [[f32; 6]; 2],
}

/// Initial speeds of a session: deg/s of the fastest joint, mm/s along lines.
pub const SPEEDS: (f64, f64) = (45.0, 150.0);
/// Limits of the controller itself, rad/s and N·m: it refuses higher ones.
const BUILT_IN: [[f64; 6]; 2] = [takt_programs::three::VELOCITIES, takt_programs::three::TORQUES];

/// Subprogram from any text entered so far.
#[derive(Clone, Debug)]
struct Subprogram {
    code: Arc<Code>,
    parameters: Vec<String>,
    entry: usize,
}

/// Program in execution: [`Session::begin`] starts it.
#[derive(Clone, Debug)]
pub struct Execution(Machine);

/// Session of the command level with a robot.
#[derive(Clone)]
pub struct Session<R> {
    host: Host<R>,
    files: Arc<dyn Files + Send + Sync>,
    interrupt: Arc<AtomicBool>,
    sources: Sources,
    values: BTreeMap<String, Value>,
    subprograms: BTreeMap<String, Subprogram>,
    settings: Settings,
    /// Joint angles at the end of the last accepted motion, deg.
    planned: Joints,
    /// Commands whose end has not been reported, by sequence number.
    open: Vec<u32>,
    /// Source places of the latest motions, by sequence number.
    motions: VecDeque<(u32, Span)>,
    /// Mode of the active jog.
    jogging: Option<JogMode>,
    cause: u32,
    messages: Vec<Message>,
    /// Lines of the session's program.
    program: Vec<String>,
    recording: bool,
    stepping: Option<Machine>,
    /// Dry run that only checks that a program can run.
    checking: bool,
    /// The session has ended.
    pub quit: bool,
}

impl<R: Robot + Clone> Session<R> {
    /// Session with a robot that has just been powered up.
    ///
    /// # Errors
    /// If the controller does not get ready.
    pub fn new(
        robot: R,
        files: Arc<dyn Files + Send + Sync>,
        interrupt: Arc<AtomicBool>,
    ) -> Result<Session<R>, Problem> {
        let mut host = Host::new(robot);
        host.power_up()?;
        let planned = degrees(&host.view().joints);
        Ok(Session {
            host,
            files,
            interrupt,
            sources: Sources::default(),
            values: BTreeMap::new(),
            subprograms: BTreeMap::new(),
            settings: Settings {
                speed: Some(SPEEDS),
                profile: Profile::Trapezoidal,
                tool: [0.0; 3],
                limits: BUILT_IN.map(|limits| limits.map(|limit| limit as f32)),
            },
            planned,
            open: Vec::new(),
            motions: VecDeque::new(),
            jogging: None,
            cause: 0,
            messages: Vec::new(),
            program: Vec::new(),
            recording: false,
            stepping: None,
            checking: false,
            quit: false,
        })
    }

    /// Host's end of the link.
    pub fn host(&self) -> &Host<R> {
        &self.host
    }

    /// Schedules an event around the robot in `after` seconds.
    pub fn schedule(&mut self, after: f64, event: Event) {
        self.host.schedule(after, event);
    }

    /// Messages since the last call, in order.
    pub fn take_messages(&mut self) -> Vec<Message> {
        self.hear();
        std::mem::take(&mut self.messages)
    }

    fn say(&mut self, kind: &'static str, text: impl Into<String>) {
        self.hear();
        let message = Message { time: self.host.time(), kind, text: text.into() };
        if self.messages.len() < limits::MESSAGES {
            self.messages.push(message);
        }
    }

    /// Turns news of the link into messages.
    fn hear(&mut self) {
        for (time, news) in self.host.take_news() {
            let (kind, text) = match news {
                HostEvent::Output(number, on) => {
                    ("signal", format!("output {number} {}", if on { "on" } else { "off" }))
                }
                HostEvent::Level(channel, value) => {
                    ("signal", format!("level {channel} is {}", value::short(f64::from(value))))
                }
                HostEvent::Report(report) if report.kind == ReportKind::Stopped && report.cause.is_some() => {
                    ("stopped", Problem::Stopped(report).to_string())
                }
                HostEvent::Report(_) => continue,
            };
            if self.messages.len() < limits::MESSAGES {
                self.messages.push(Message { time, kind, text });
            }
        }
    }

    fn diagnostics(&self, list: Vec<Diagnostic>) -> Diagnostics {
        Diagnostics { sources: Arc::new(self.sources.clone()), list, ..Diagnostics::default() }
    }

    fn known_names(&self) -> KnownNames {
        KnownNames {
            values: self.values.keys().cloned().collect(),
            subprograms: self
                .subprograms
                .iter()
                .map(|(name, sub)| (name.clone(), sub.parameters.len()))
                .collect(),
        }
    }

    /// Planned position of the robot, as a pose: mm, deg.
    fn planned_pose(&self) -> [f64; 6] {
        pose_of(&self.planned, self.settings.tool).0
    }

    /// Parses and compiles a text. Returns `Ok(None)` if a block is open at its end and `more` lines may come.
    fn read(
        &mut self,
        name: &str,
        text: &str,
        console: bool,
        more: bool,
    ) -> Result<Option<Code>, Diagnostics> {
        if text.len() > limits::PROGRAM_BYTES {
            let message = format!("{name} has more than {} bytes", limits::PROGRAM_BYTES);
            return Err(self.diagnostics(vec![Diagnostic::placeless("limit", message)]));
        }
        let before = self.sources.clone();
        let Some(file) = self.sources.add(name, text.into()) else {
            let message = "this session has read too much text";
            return Err(self.diagnostics(vec![Diagnostic::placeless("limit", message)]));
        };
        let base = self.sources.files()[file].base;
        let parsed = parse(text, base);
        if parsed.open && more && parsed.mistakes.len() == 1 {
            self.sources = before;
            return Ok(None);
        }
        if !parsed.mistakes.is_empty() {
            return Err(self.diagnostics(parsed.mistakes));
        }
        let has_console =
            parsed.block.iter().any(|statement| matches!(statement.kind, StatementKind::Console(_)));
        if has_console && console && parsed.block.len() > 1 {
            let place = parsed.block.iter().find(|one| matches!(one.kind, StatementKind::Console(_)));
            let span = place.map_or(Span::default(), |one| one.span);
            let mistake = Diagnostic::error("command", span, "this command must stand by itself");
            return Err(self.diagnostics(vec![mistake]));
        }
        compile(&parsed.block, &self.known_names(), console).map(Some).map_err(|list| self.diagnostics(list))
    }

    /// Executes a text typed at the prompt, or a line of a script.
    ///
    /// # Errors
    /// A mistake in the text, or an error while it runs.
    pub fn enter(&mut self, name: &str, text: &str, more: bool) -> Result<Answer, Diagnostics> {
        let Some(code) = self.read(name, text, true, more)? else { return Ok(Answer::More) };
        if let Some((_, span, console)) = code.console.first().cloned() {
            self.console(span, &console)?;
            return Ok(Answer::Done);
        }
        let result = self.execute(code);
        if self.recording && result.is_ok() {
            self.record(text);
        }
        result.map(|()| Answer::Done)
    }

    /// Runs a program to its end.
    ///
    /// # Errors
    /// A mistake in the text, or an error while it runs.
    pub fn run(&mut self, name: &str, text: &str) -> Result<(), Diagnostics> {
        match self.read(name, text, false, false)? {
            Some(code) => self.execute(code),
            None => Ok(()),
        }
    }

    /// Compiles a program for execution by [`Session::advance`], operation by operation.
    ///
    /// # Errors
    /// A mistake in the text.
    pub fn begin(&mut self, name: &str, text: &str) -> Result<Execution, Diagnostics> {
        let code = self.read(name, text, false, false)?.unwrap_or_default();
        Ok(Execution(Machine::new(self.adopt(code))))
    }

    /// Executes a program's next operation; returns false at its end.
    ///
    /// # Errors
    /// An error of the run, which ends the program.
    pub fn advance(&mut self, running: &mut Execution) -> Result<bool, Diagnostics> {
        self.step(&mut running.0).map_err(|mistake| self.broken_off(*mistake))
    }

    /// Runs a program in a copy of the robot; the robot itself does not move. Awaited signals count as given.
    ///
    /// # Errors
    /// A mistake in the text, or the error with which the run would end.
    pub fn check(&mut self, name: &str, text: &str) -> Result<(), Diagnostics> {
        let Some(code) = self.read(name, text, false, false)? else { return Ok(()) };
        let mut copy = self.clone();
        copy.checking = true;
        copy.recording = false;
        copy.take_messages();
        let result = copy.execute(code);
        let takes = copy.host.time() - self.host.time();
        for message in copy.take_messages() {
            let text = format!("at {} s: {}", value::short(message.time - self.host.time()), message.text);
            self.say("check", text);
        }
        if result.is_ok() {
            self.say("check", format!("{name} can run: it takes {} s", value::short(takes)));
        }
        result
    }

    fn adopt(&mut self, code: Code) -> Arc<Code> {
        let code = Arc::new(code);
        for (name, sub) in &code.subprograms {
            let (parameters, entry) = (sub.parameters.clone(), sub.entry);
            self.subprograms.insert(name.clone(), Subprogram { code: Arc::clone(&code), parameters, entry });
        }
        code
    }

    fn execute(&mut self, code: Code) -> Result<(), Diagnostics> {
        let machine = Machine::new(self.adopt(code));
        self.drive(machine)
    }

    fn drive(&mut self, mut machine: Machine) -> Result<(), Diagnostics> {
        loop {
            match self.step(&mut machine) {
                Ok(true) => {}
                Ok(false) => return Ok(()),
                Err(mistake) => return Err(self.broken_off(*mistake)),
            }
        }
    }

    /// Ends a program after an error: stops the robot, which must not move on without its program.
    fn broken_off(&mut self, mistake: Diagnostic) -> Diagnostics {
        self.interrupt.store(false, Ordering::Relaxed);
        let list = match (self.host.stopped(), self.host.stands()) {
            (None, false) => match self.halt() {
                Ok(()) => vec![mistake.note("the robot was stopped")],
                Err(_) => vec![mistake.note("and the robot did not stop")],
            },
            _ => vec![mistake],
        };
        self.diagnostics(list)
    }

    /// Waits until the robot stands, at the end of a script.
    ///
    /// # Errors
    /// If the robot is stopped with an error.
    pub fn finish(&mut self) -> Result<(), Diagnostics> {
        if self.host.stopped().is_some() {
            return Ok(());
        }
        self.enter("end", "wait done", false).map(|_| ())
    }

    /// An interrupt has been requested.
    fn interrupted(&self) -> bool {
        self.interrupt.load(Ordering::Relaxed)
    }

    fn record(&mut self, text: &str) {
        for line in text.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words[..] {
                ["teach", name, ..] => {
                    if let Some(value) = self.values.get(name) {
                        self.program.push(format!("let {name} = {value}"));
                    }
                }
                _ => self.program.push(line.to_owned()),
            }
        }
    }

    fn program_text(&self) -> String {
        self.program.iter().map(|line| format!("{line}\n")).collect()
    }

    /// Name and text of a file, or of the session's program.
    fn text_of(&self, file: Option<&crate::language::tree::Name>) -> Result<(String, String), Diagnostics> {
        match file {
            Some(file) => {
                let text = self
                    .files
                    .read(&file.text)
                    .map_err(|error| self.diagnostics(vec![Diagnostic::error("file", file.span, error)]))?;
                Ok((file.text.clone(), text))
            }
            None => Ok(("program".to_owned(), self.program_text())),
        }
    }

    // ---- Commands of the prompt.

    fn console(&mut self, span: Span, console: &Console) -> Result<(), Diagnostics> {
        match console {
            Console::Help(None) => {
                let width = table::COMMANDS.iter().map(|command| command.name.len()).max().unwrap_or(0);
                let rows = table::COMMANDS.iter().map(|command| {
                    let text = command.text.split(['.', ';', ':']).next().unwrap_or("");
                    format!("{:width$}  {text}", command.name)
                });
                let text: Vec<String> = rows.collect();
                self.say("note", format!("{}\n`help COMMAND` explains one", text.join("\n")));
            }
            Console::Help(Some(name)) => {
                let text = if let Some(command) = table::command_named(&name.text) {
                    format!(
                        "{}\n{}\nas in: {}",
                        command.syntax,
                        command.text,
                        command.example.replace('\n', "; ")
                    )
                } else if let Some(function) = table::function_named(&name.text) {
                    format!("{}\n{}", function.syntax, function.text)
                } else {
                    let names = table::COMMANDS.iter().map(|command| command.name);
                    let names = names.chain(table::FUNCTIONS.iter().map(|function| function.name));
                    let message = format!("there is no command `{}`", name.text);
                    let mistake = Diagnostic::error("command", name.span, message);
                    return Err(self.diagnostics(vec![mistake.did_you_mean(nearest(&name.text, names))]));
                };
                self.say("note", text);
            }
            Console::Quit => self.quit = true,
            Console::Run(file) => {
                let (name, text) = self.text_of(file.as_ref())?;
                self.run(&name, &text)?;
            }
            Console::Check(file) => {
                let (name, text) = self.text_of(file.as_ref())?;
                self.check(&name, &text)?;
            }
            Console::Load(file) => {
                let (_, text) = self.text_of(Some(file))?;
                self.program = text.lines().map(str::to_owned).collect();
                self.stepping = None;
                let lines = self.program.len();
                self.say("note", format!("{}: {lines} lines", file.text));
            }
            Console::Save(file) => {
                if let Err(error) = self.files.write(&file.text, &self.program_text()) {
                    return Err(self.diagnostics(vec![Diagnostic::error("file", file.span, error)]));
                }
                let lines = self.program.len();
                self.say("note", format!("{}: {lines} lines written", file.text));
            }
            Console::List => {
                let numbered =
                    self.program.iter().zip(1..).map(|(line, number)| format!("{number:>4}  {line}"));
                let text: Vec<String> = numbered.collect();
                let text = if text.is_empty() { "the program is empty".to_owned() } else { text.join("\n") };
                self.say("note", text);
            }
            Console::New => {
                self.program.clear();
                self.stepping = None;
            }
            Console::Record(on) => {
                self.recording = *on;
                self.stepping = None;
            }
            Console::Step => return self.single_step(span),
            Console::Continue => {
                let Some(machine) = self.stepping.take() else {
                    let mistake = Diagnostic::error("command", span, "no program is being stepped through");
                    return Err(self.diagnostics(vec![mistake.help("`step` begins the session's program")]));
                };
                self.drive(machine)?;
            }
        }
        Ok(())
    }

    /// Executes one statement of the session's program, and announces the next.
    fn single_step(&mut self, span: Span) -> Result<(), Diagnostics> {
        let mut machine = match self.stepping.take() {
            Some(machine) => machine,
            None if self.program.is_empty() => {
                let mistake = Diagnostic::error("command", span, "the session has no program");
                return Err(
                    self.diagnostics(vec![mistake.help("`load \"FILE\"` or `record on` gives it one")])
                );
            }
            None => {
                let text = self.program_text();
                let Some(code) = self.read("program", &text, false, false)? else { return Ok(()) };
                Machine::new(self.adopt(code))
            }
        };
        let more = loop {
            let shown = machine.is_shown();
            match self.step(&mut machine) {
                Ok(false) => break false,
                Ok(true) if shown => break true,
                Ok(true) => {}
                Err(mistake) => return Err(self.broken_off(*mistake)),
            }
        };
        let next = if more { machine.next_span() } else { None };
        match next {
            Some(span) => {
                let file = &self.sources.files()[self.sources.file_of(span.start)];
                let line = Lines::of(&file.text).index(span.start - file.base) + 1;
                let text = format!("next: line {line}: {}", self.sources.text(span));
                self.say("note", text);
                self.stepping = Some(machine);
            }
            None => self.say("note", "the program has ended"),
        }
        Ok(())
    }
}
