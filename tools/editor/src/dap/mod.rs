// SPDX-License-Identifier: MIT OR Apache-2.0
//! The debug adapter: the protocol's requests on a session that goes forward and back, of a program or of a system, each of
//! whose cores is a thread.
//!
//! One thread answers, one request after the other; whoever reads the stream hears a `pause` at once ([`interrupts`]).

mod breakpoints;
mod protocol;
mod run;
mod view;

pub use protocol::Message;

use breakpoints::Breakpoints;
use crossbeam_channel::{Receiver, Sender};
use protocol::{
    Answer, Body, Capabilities, Event, ExceptionInfo, GotoArguments, InitializeArguments, Kind,
    LaunchArguments, MoveArguments, Output, Refusal, Request, Response, Scoped, Thread, answer, read,
};
use run::Filters;
use serde_json::Value;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_debug::console::{Console, Target};
use takt_debug::session::{Control, Move, Session, Unit};

/// Numbers of frames and of lists of variables that a core has; the core's number stands above them.
const CORE: u64 = 1 << 16;

/// Makes a session of the arguments of a `launch` or `attach` request.
pub trait Launcher {
    /// Makes it.
    ///
    /// # Errors
    /// If something is wrong with the arguments, or with the program.
    fn launch(&mut self, arguments: &Value, control: &Arc<Control>) -> Result<Launched, String>;
}

/// A session that is to be debugged.
pub struct Launched {
    /// The session, at its beginning or where there is something to see.
    pub console: Console,
    /// A note for the user, if there is one.
    pub note: Option<String>,
    /// For each core, the folder that its program's sources lie in.
    pub folders: Vec<PathBuf>,
}

/// True if a message asks for what runs to be stopped: it is to be heard before its turn.
pub fn interrupts(message: &Value) -> bool {
    matches!(message["command"].as_str(), Some("pause" | "disconnect" | "terminate"))
}

struct Server<'c> {
    sender: &'c Sender<Option<Message>>,
    sent: i64,
    control: Arc<Control>,
    debugged: Option<Debugged>,
    filters: Filters,
    /// Lines and columns count from 1.
    from_one: (bool, bool),
    stop_on_entry: bool,
    /// The client only wants it run: nothing stops it, and its end is the session's.
    no_debug: bool,
    /// The consequence of the request, once the answer is sent.
    then: Then,
    ended: bool,
}

/// The session that is being debugged.
struct Debugged {
    console: Console,
    breakpoints: Breakpoints,
    /// For each core, where its sources are.
    folders: Vec<PathBuf>,
    /// The last exception, for `exceptionInfo`.
    exception: Option<(String, String)>,
    /// It has halted, and the client knows.
    over: bool,
}

/// The consequence of a request, once it is answered.
#[derive(Clone, Debug)]
enum Then {
    Nothing,
    Initialized,
    Enter,
    Continue,
    Back,
    /// A step of a core; true if it passes over calls.
    Step(usize, Unit, bool),
    /// Another move of a core, and the reason that the client is told.
    Move(usize, Move, &'static str),
}

/// Serves a client until it disconnects or goes. `control` is interrupted by whoever reads the client's stream.
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
        then: Then::Nothing,
        ended: false,
    };
    for message in receiver {
        server.message(&message, launcher);
        if server.ended {
            return;
        }
    }
}

/// The first line of a message, with the place that it is about: many a client shows nothing else.
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
        // If nobody receives it, the client is gone, and the loop ends.
        let _ = self.sender.send(Some(Message { seq: self.sent, kind }));
    }

    fn event(&mut self, event: Event) {
        self.send(Kind::Event(event));
    }

    /// A line in the client's console.
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
            let text = "this is no request: it has no `command` and `seq`";
            return self.respond(0, String::new(), Err(text.to_owned()));
        };
        self.then = Then::Nothing;
        // A mistake of ours in one answer is no reason to end the session.
        let answered = catch_unwind(AssertUnwindSafe(|| self.answer(&command, &arguments, launcher)));
        let answered =
            answered.unwrap_or_else(|_| Err(format!("a defect in Takt: `{command}` could not be answered")));
        let then = if answered.is_ok() { self.then.clone() } else { Then::Nothing };
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
            // Nothing runs while a request is answered; one that runs was interrupted.
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
        let Launched { console, note, folders } = launcher.launch(arguments, &self.control)?;
        let LaunchArguments { no_debug, stop_on_entry } = read(arguments)?;
        self.no_debug = no_debug.unwrap_or(false);
        self.stop_on_entry = !self.no_debug && stop_on_entry.unwrap_or(true);
        let breakpoints = Breakpoints::default();
        self.debugged = Some(Debugged { console, breakpoints, folders, exception: None, over: false });
        if let Some(note) = note {
            self.output(&note);
        }
        self.then = Then::Initialized;
        Ok(Value::Null)
    }
}

impl Debugged {
    /// The move that a request asks for; `None` if it asks for none.
    fn moves(&self, command: &str, arguments: &Value, stop_on_entry: bool) -> Result<Option<Then>, String> {
        Ok(Some(match command {
            "configurationDone" if stop_on_entry => Then::Enter,
            "configurationDone" | "continue" => Then::Continue,
            "reverseContinue" => Then::Back,
            "next" | "stepIn" | "stepOut" | "stepBack" => {
                let MoveArguments { thread_id, granularity } = read(arguments)?;
                let core = self.thread(thread_id)?;
                match (command, granularity.as_deref() == Some("instruction")) {
                    ("next", true) => Then::Step(core, Unit::Call, true),
                    ("next", false) => Then::Step(core, Unit::Line, true),
                    ("stepIn", true) => Then::Step(core, Unit::Bundle, false),
                    ("stepIn", false) => Then::Step(core, Unit::Line, false),
                    ("stepOut", _) => Then::Step(core, Unit::Out, false),
                    (_, true) => Then::Move(core, Move::Back(Unit::Bundle, 1), "step"),
                    (_, false) => Then::Move(core, Move::Back(Unit::Line, 1), "step"),
                }
            }
            "takt/gotoCycle" | "takt/gotoPeriod" => {
                let name = if command == "takt/gotoCycle" { "cycle" } else { "period" };
                let wrong = |_| format!("`{name}` is a whole number, and not negative");
                let GotoArguments { count, thread_id } = read(arguments).map_err(wrong)?;
                let to = if name == "cycle" { Move::Cycle(count) } else { Move::Period(count) };
                Then::Move(self.thread(thread_id)?, to, "goto")
            }
            _ => return Ok(None),
        }))
    }

    /// The answer to a request that only asks, or sets something.
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

    /// The session of a core whose number has been checked.
    fn session(&self, core: usize) -> &Session {
        self.console.core(core).unwrap_or_else(|| self.console.session())
    }

    /// The number of a core, if there is such a one.
    fn checked(&self, core: u64) -> Option<usize> {
        usize::try_from(core).ok().filter(|core| *core < self.console.cores())
    }

    fn name(&self, core: usize) -> String {
        match self.console.target() {
            Target::System => self.console.name(core).to_owned(),
            Target::Program | Target::Board => format!("core {core}"),
        }
    }

    /// The core that a name before a separator says, and what follows: of a system.
    fn split<'t>(&self, text: &'t str, separator: char) -> Option<(usize, &'t str)> {
        let (name, rest) = text.split_once(separator)?;
        let core = self.console.system()?.system().description().core_named(name.trim())?;
        Some((core, rest))
    }

    /// The core of a request's thread; if none is said, the one that stopped last.
    fn thread(&self, thread: Option<u64>) -> Result<usize, String> {
        let Some(thread) = thread else { return Ok(self.console.selected()) };
        let core = thread.checked_sub(1).and_then(|core| self.checked(core));
        core.ok_or_else(|| format!("there is no thread {thread} (threads: 1 to {})", self.console.cores()))
    }

    /// The core that a request's frame or list of variables is of; if neither is said, the one that stopped last.
    fn core_of(&self, of: &Scoped) -> Result<usize, String> {
        let (name, number) = match (of.frame_id, of.variables_reference) {
            (Some(frame), _) => ("frameId", frame),
            (None, Some(list)) => ("variablesReference", list),
            (None, None) => return Ok(self.console.selected()),
        };
        self.checked(number / CORE).ok_or_else(|| format!("there is no `{name}` {number}"))
    }

    /// The path of a source, if it lies on the disk.
    fn path_of(&self, core: usize, file: u32) -> Option<PathBuf> {
        let name = self.session(core).program().files.get(file as usize)?;
        let path = self.folders.get(core)?.join(name);
        (!name.starts_with('<') && Path::new(&path).is_file()).then_some(path)
    }
}
