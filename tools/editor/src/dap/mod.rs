// SPDX-License-Identifier: MIT OR Apache-2.0
//! Debug adapter: serves the protocol's requests from a reversible debug session of a program or a system. Each core is a thread.
//!
//! A single thread answers the requests in order. Only `pause` and similar requests are handled immediately, by the reader of the stream
//! ([`interrupts`]).

mod breakpoints;
mod protocol;
mod run;
mod view;

pub use protocol::Message;

use breakpoints::Breakpoints;
use crossbeam_channel::{Receiver, Sender};
use protocol::{
    Answer, Body, Capabilities, Event, ExceptionInfo, GotoArguments, InitializeArguments, Kind,
    LaunchArguments, MoveArguments, Output, Refusal, Request, Response, ScopeArguments, Thread, answer, read,
};
use run::Filters;
use serde_json::Value;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_debug::console::{Console, Target};
use takt_debug::session::{Control, Move, Session, Unit};

/// Number of frame and variable-list numbers per core; the core's number occupies the higher bits.
const CORE: u64 = 1 << 16;

/// Creates sessions from the arguments of `launch` and `attach` requests.
pub trait Launcher {
    /// Creates the session that a request describes.
    ///
    /// # Errors
    /// If an argument is invalid, or the program cannot be loaded.
    fn launch(&mut self, arguments: &Value, control: &Arc<Control>) -> Result<LaunchedSession, String>;
}

/// A session to debug.
pub struct LaunchedSession {
    /// Console of the session, at its beginning or at a position of interest.
    pub console: Console,
    /// Note to show to the user.
    pub note: Option<String>,
    /// Folder of each core's sources.
    pub folders: Vec<PathBuf>,
}

/// The message interrupts a running command and must be handled immediately.
pub fn interrupts(message: &Value) -> bool {
    matches!(message["command"].as_str(), Some("pause" | "disconnect" | "terminate"))
}

struct Server<'c> {
    sender: &'c Sender<Option<Message>>,
    sent: i64,
    control: Arc<Control>,
    debugged: Option<DebuggedSession>,
    filters: Filters,
    /// Lines and columns are counted from 1 (otherwise from 0).
    from_one: (bool, bool),
    stop_on_entry: bool,
    /// Run without stops; the session ends with the run.
    no_debug: bool,
    /// Action to take once the answer has been sent.
    then: FollowUp,
    ended: bool,
}

/// Session being debugged, with the state that the client sees.
struct DebuggedSession {
    console: Console,
    breakpoints: Breakpoints,
    /// Folder of each core's sources.
    folders: Vec<PathBuf>,
    /// Last exception, for `exceptionInfo`: name and description.
    exception: Option<(String, String)>,
    /// The run has ended, and the client has been notified.
    over: bool,
}

/// Action that follows the answer to a request.
#[derive(Clone, Debug)]
enum FollowUp {
    Nothing,
    Initialized,
    Enter,
    Continue,
    Back,
    /// Step of a core; with `true`, over calls.
    Step(usize, Unit, bool),
    /// Other move of a core, with the stop reason to report to the client.
    Move(usize, Move, &'static str),
}

/// Serves a client until it disconnects or its stream ends. The reader of the client's stream uses `control` to interrupt commands.
pub fn serve(
    receiver: &Receiver<Value>,
    sender: &Sender<Option<Message>>,
    control: &Arc<Control>,
    launcher: &mut dyn Launcher,
) {
    let mut server = Server {
        sender,
        sent: 0,
        control: Arc::clone(control),
        debugged: None,
        filters: Filters::default(),
        from_one: (true, true),
        stop_on_entry: true,
        no_debug: false,
        then: FollowUp::Nothing,
        ended: false,
    };
    for message in receiver {
        server.message(&message, launcher);
        if server.ended {
            return;
        }
    }
}

/// First line of a message, with its place: many clients show only one line.
fn brief(text: &str) -> String {
    let first = text.lines().next().unwrap_or("");
    match text.lines().find_map(|line| line.trim_start().strip_prefix("┌─ ")) {
        Some(place) => format!("{}: {first}", place.trim()),
        None => first.to_owned(),
    }
}

impl Server<'_> {
    fn send(&mut self, kind: Kind) {
        self.sent += 1;
        // If the receiver is gone, so is the client, and the loop ends.
        let _ = self.sender.send(Some(Message { seq: self.sent, kind }));
    }

    fn event(&mut self, event: Event) {
        self.send(Kind::Event(event));
    }

    /// Prints a line to the client's console.
    fn output(&mut self, text: &str) {
        let output = format!("{}\n", text.trim_end());
        self.event(Event::Output(Output { category: "console", output }));
    }

    fn respond(&mut self, request_seq: i64, command: String, answered: Answer) {
        let success = answered.is_ok();
        let (message, body) = match answered {
            Ok(body) => (None, body),
            Err(text) => (Some(brief(&text)), answer(Refusal::of(text)).unwrap_or_default()),
        };
        self.send(Kind::Response(Response { request_seq, command, success, message, body }));
    }

    fn message(&mut self, message: &Value, launcher: &mut dyn Launcher) {
        let Ok(Request { seq, command, arguments }) = read(message) else {
            let text = "this is not a request: it needs `command` and `seq`";
            return self.respond(0, String::new(), Err(text.to_owned()));
        };
        self.then = FollowUp::Nothing;
        // A panic in one answer must not end the session.
        let answered = catch_unwind(AssertUnwindSafe(|| self.answer(&command, &arguments, launcher)));
        let answered =
            answered.unwrap_or_else(|_| Err(format!("a defect in Takt: `{command}` could not be answered")));
        let then = if answered.is_ok() { self.then.clone() } else { FollowUp::Nothing };
        self.respond(seq, command, answered);
        if catch_unwind(AssertUnwindSafe(|| self.go(then))).is_err() {
            self.output("a defect in Takt: the run ended");
        }
    }

    fn answer(&mut self, command: &str, arguments: &Value, launcher: &mut dyn Launcher) -> Answer {
        match command {
            "initialize" => {
                let arguments: InitializeArguments = read(arguments)?;
                let from_one = [arguments.lines_start_at1, arguments.columns_start_at1];
                self.from_one = from_one.map(|from_one| from_one.unwrap_or(true)).into();
                return answer(Capabilities::new(Filters::described()));
            }
            "launch" | "attach" => return self.launch(arguments, launcher),
            "disconnect" | "terminate" => {
                self.ended = command == "disconnect";
                if !self.ended {
                    self.event(Event::Terminated);
                }
                return Ok(Value::Null);
            }
            // No command is running at this point: it has already been interrupted.
            "pause" => return Ok(Value::Null),
            _ => {}
        }
        let Some(debugged) = &mut self.debugged else {
            return Err(format!("`{command}` before `launch`"));
        };
        if let Some(then) = debugged.moves(command, arguments, self.stop_on_entry)? {
            self.then = then;
            return match command {
                "continue" => answer(Body::AllThreadsContinued(true)),
                _ => Ok(Value::Null),
            };
        }
        if command == "setExceptionBreakpoints" {
            self.filters = Filters::of(read(arguments)?)?;
            return Ok(Value::Null);
        }
        debugged.answer(command, arguments, self.from_one)
    }

    fn launch(&mut self, arguments: &Value, launcher: &mut dyn Launcher) -> Answer {
        if self.debugged.is_some() {
            return Err("a program is being debugged already".to_owned());
        }
        let LaunchedSession { console, note, folders } = launcher.launch(arguments, &self.control)?;
        let LaunchArguments { no_debug, stop_on_entry } = read(arguments)?;
        self.no_debug = no_debug.unwrap_or(false);
        self.stop_on_entry = !self.no_debug && stop_on_entry.unwrap_or(true);
        let breakpoints = Breakpoints::default();
        self.debugged = Some(DebuggedSession { console, breakpoints, folders, exception: None, over: false });
        if let Some(note) = note {
            self.output(&note);
        }
        self.then = FollowUp::Initialized;
        Ok(Value::Null)
    }
}

impl DebuggedSession {
    /// Move that a request asks for, if any.
    fn moves(
        &self,
        command: &str,
        arguments: &Value,
        stop_on_entry: bool,
    ) -> Result<Option<FollowUp>, String> {
        Ok(Some(match command {
            "configurationDone" if stop_on_entry => FollowUp::Enter,
            "configurationDone" | "continue" => FollowUp::Continue,
            "reverseContinue" => FollowUp::Back,
            "next" | "stepIn" | "stepOut" | "stepBack" => {
                let MoveArguments { thread_id, granularity } = read(arguments)?;
                let core = self.thread(thread_id)?;
                match (command, granularity.as_deref() == Some("instruction")) {
                    ("next", true) => FollowUp::Step(core, Unit::Call, true),
                    ("next", false) => FollowUp::Step(core, Unit::Line, true),
                    ("stepIn", true) => FollowUp::Step(core, Unit::Bundle, false),
                    ("stepIn", false) => FollowUp::Step(core, Unit::Line, false),
                    ("stepOut", _) => FollowUp::Step(core, Unit::Out, false),
                    (_, true) => FollowUp::Move(core, Move::Back(Unit::Bundle, 1), "step"),
                    (_, false) => FollowUp::Move(core, Move::Back(Unit::Line, 1), "step"),
                }
            }
            "takt/gotoCycle" | "takt/gotoPeriod" => {
                let name = if command == "takt/gotoCycle" { "cycle" } else { "period" };
                let wrong = |_| format!("`{name}` is a whole number that is not negative");
                let GotoArguments { count, thread_id } = read(arguments).map_err(wrong)?;
                let to = if name == "cycle" { Move::Cycle(count) } else { Move::Period(count) };
                FollowUp::Move(self.thread(thread_id)?, to, "goto")
            }
            _ => return Ok(None),
        }))
    }

    /// Answers a request that reads or sets state without a move.
    fn answer(&mut self, command: &str, arguments: &Value, from_one: (bool, bool)) -> Answer {
        let cores = 0..self.console.cores();
        match command {
            "threads" => {
                let thread = |core| Thread { id: core + 1, name: self.name(core) };
                answer(Body::Threads(cores.map(thread).collect()))
            }
            "setBreakpoints" => self.set_lines(read(arguments)?, from_one.0),
            "setFunctionBreakpoints" => self.set_functions(read(arguments)?),
            "setInstructionBreakpoints" => self.set_instructions(read(arguments)?),
            "dataBreakpointInfo" => self.data_info(read(arguments)?),
            "setDataBreakpoints" => self.set_data(read(arguments)?),
            "exceptionInfo" => {
                let Some((id, description)) = &self.exception else {
                    return Err("the program has not stopped for an exception".to_owned());
                };
                answer(ExceptionInfo { exception_id: id, description, break_mode: "always" })
            }
            "stackTrace" => self.stack(read(arguments)?, from_one),
            "scopes" => self.scopes(&read(arguments)?),
            "variables" => self.variables(&read(arguments)?),
            "setVariable" | "setExpression" => self.set_variable(&read(arguments)?),
            "evaluate" => self.evaluate(&read(arguments)?),
            "completions" => self.completions(&read(arguments)?),
            "disassemble" => self.disassemble(&read(arguments)?, from_one.0),
            "readMemory" => self.read_memory(&read(arguments)?),
            "source" => self.source_text(&read(arguments)?),
            "loadedSources" => {
                let files = |core: usize| 0..self.session(core).program().files.len() as u32;
                let all = cores.flat_map(|core| files(core).map(move |file| (core, file)));
                answer(Body::Sources(all.map(|(core, file)| self.source(core, file)).collect()))
            }
            _ => Err(format!("Takt's debug adapter has no `{command}`")),
        }
    }

    /// Session of a core; the number must be valid.
    fn session(&self, core: usize) -> &Session {
        self.console.core(core).unwrap_or_else(|| self.console.session())
    }

    /// Checks a core number.
    fn checked(&self, core: u64) -> Option<usize> {
        usize::try_from(core).ok().filter(|core| *core < self.console.cores())
    }

    fn name(&self, core: usize) -> String {
        match self.console.target() {
            Target::System => self.console.name(core).to_owned(),
            Target::Program | Target::Board => format!("core {core}"),
        }
    }

    /// In systems, splits a text at a separator that follows a core's name.
    fn split<'t>(&self, text: &'t str, separator: char) -> Option<(usize, &'t str)> {
        let (name, rest) = text.split_once(separator)?;
        let core = self.console.system()?.system().description().core_named(name.trim())?;
        Some((core, rest))
    }

    /// Core of a request's thread; by default the core that stopped last.
    fn thread(&self, thread: Option<u64>) -> Result<usize, String> {
        let Some(thread) = thread else { return Ok(self.console.selected()) };
        let core = thread.checked_sub(1).and_then(|core| self.checked(core));
        core.ok_or_else(|| format!("there is no thread {thread} (threads: 1 to {})", self.console.cores()))
    }

    /// Core of a request's frame or variable list; by default the core that stopped last.
    fn core_of(&self, of: &ScopeArguments) -> Result<usize, String> {
        let (name, number) = match (of.frame_id, of.variables_reference) {
            (Some(frame), _) => ("frameId", frame),
            (None, Some(list)) => ("variablesReference", list),
            (None, None) => return Ok(self.console.selected()),
        };
        self.checked(number / CORE).ok_or_else(|| format!("there is no `{name}` {number}"))
    }

    /// Path of a source file on disk, if it exists.
    fn path_of(&self, core: usize, file: u32) -> Option<PathBuf> {
        let name = self.session(core).program().files.get(file as usize)?;
        let path = self.folders.get(core)?.join(name);
        (!name.starts_with('<') && Path::new(&path).is_file()).then_some(path)
    }
}
