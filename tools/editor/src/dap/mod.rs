//! The debug adapter: the protocol's requests on a session that goes forward and back, of a program or of a system, each of
//! whose cores is a thread.
//!
//! One thread answers, one request after the other; whoever reads the stream hears a `pause` at once ([`interrupts`]). No crate of
//! the protocol's types is used: those there are lag behind it, and it is JSON with a dozen fields.

mod breakpoints;
mod run;
mod target;
mod view;

pub use target::{Launched, Target};

use breakpoints::Breakpoints;
use crossbeam_channel::{Receiver, Sender};
use run::Filters;
use serde_json::{Value, json};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_debug::session::{Control, Unit};

/// Numbers of frames and of lists of variables that a core has; the core's number stands above them.
const CORE: u64 = 1 << 16;

/// Makes a session of the arguments of a `launch` or `attach` request.
pub trait Launcher {
    /// Makes it.
    ///
    /// # Errors
    /// What is wrong with the arguments, or with the program.
    fn launch(&mut self, arguments: &Value, control: &Arc<Control>) -> Result<Launched, String>;
}

/// Whether a message asks for what runs to be stopped: it is to be heard before its turn.
pub fn interrupts(message: &Value) -> bool {
    matches!(message["command"].as_str(), Some("pause" | "disconnect" | "terminate"))
}

/// What a request comes to: the body of its answer.
type Answer = Result<Value, String>;

struct Server<'c> {
    sender: &'c Sender<Value>,
    sent: i64,
    control: Arc<Control>,
    debugged: Option<Debugged>,
    filters: Filters,
    /// Lines and columns count from 1.
    from_one: (bool, bool),
    stop_on_entry: bool,
    /// The client only wants it run: nothing stops it, and its end is the session's.
    no_debug: bool,
    /// What is to be done once the answer is sent.
    then: Then,
    ended: bool,
}

/// What is being debugged.
struct Debugged {
    target: Target,
    breakpoints: Breakpoints,
    /// For each core, where its sources are.
    folders: Vec<PathBuf>,
    /// The last exception, for `exceptionInfo`.
    exception: Option<(String, String)>,
    /// It has halted, and the client knows.
    over: bool,
}

/// What follows an answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Then {
    Nothing,
    Initialized,
    Enter,
    Continue,
    Back,
    /// A step of a core, and whether it passes over calls.
    Step(usize, Unit, bool),
    StepBack(usize, Unit),
    GoTo(Goal),
}

/// Where a request of our own goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Goal {
    Cycle(u64),
    /// So many periods of a core have ended.
    Period(usize, u64),
}

/// Serves a client until it disconnects or goes. `control` is interrupted by whoever reads the client's stream.
pub fn serve(
    receiver: &Receiver<Value>,
    sender: &Sender<Value>,
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

/// A number among the arguments.
fn number(arguments: &Value, name: &str) -> Result<u64, String> {
    arguments[name].as_u64().ok_or_else(|| format!("`{name}` is a whole number, and not negative"))
}

/// The first line of a message, with the place that it is about: many a client shows nothing else.
fn brief(text: &str) -> String {
    let first = text.lines().next().unwrap_or("");
    match text.lines().find_map(|line| line.trim_start().strip_prefix("┌─ ")) {
        Some(place) => format!("{}: {first}", place.trim()),
        None => first.to_owned(),
    }
}

/// A text among the arguments.
fn text<'a>(arguments: &'a Value, name: &str) -> Result<&'a str, String> {
    arguments[name].as_str().ok_or_else(|| format!("`{name}` is a text"))
}

impl Server<'_> {
    fn send(&mut self, mut message: Value) {
        self.sent += 1;
        message["seq"] = self.sent.into();
        // If nobody receives it, the client is gone, and the loop ends.
        let _ = self.sender.send(message);
    }

    fn event(&mut self, event: &str, body: Value) {
        self.send(json!({ "type": "event", "event": event, "body": body }));
    }

    /// A line in the client's console.
    fn output(&mut self, text: &str) {
        let text = format!("{}\n", text.trim_end());
        self.event("output", json!({ "category": "console", "output": text }));
    }

    fn message(&mut self, message: &Value, launcher: &mut dyn Launcher) {
        let (Some(command), Some(seq)) = (message["command"].as_str(), message["seq"].as_i64()) else {
            let error = json!({ "id": 1, "format": "a request has `command` and `seq`" });
            let answer = json!({ "type": "response", "request_seq": 0, "success": false, "command": "",
                "message": "this is no request", "body": { "error": error } });
            return self.send(answer);
        };
        self.then = Then::Nothing;
        // A mistake of ours in one answer is no reason to end the session.
        let answer = catch_unwind(AssertUnwindSafe(|| self.answer(command, &message["arguments"], launcher)));
        let answer =
            answer.unwrap_or_else(|_| Err(format!("a defect in Takt: `{command}` could not be answered")));
        let mut response =
            json!({ "type": "response", "request_seq": seq, "command": command, "success": answer.is_ok() });
        match answer {
            Ok(body) => response["body"] = body,
            Err(text) => {
                response["message"] = brief(&text).into();
                // The text as it is: nothing in it stands for a variable.
                response["body"] = json!({ "error": { "id": 1, "format": "{text}", "variables": { "text": text }, "showUser": true } });
                self.then = Then::Nothing;
            }
        }
        self.send(response);
        let then = self.then;
        if catch_unwind(AssertUnwindSafe(|| self.go(then))).is_err() {
            self.output("a defect in Takt: the run ended");
        }
    }

    fn answer(&mut self, command: &str, arguments: &Value, launcher: &mut dyn Launcher) -> Answer {
        match command {
            "initialize" => {
                let from_one = |name: &str| arguments[name].as_bool().unwrap_or(true);
                self.from_one = (from_one("linesStartAt1"), from_one("columnsStartAt1"));
                return Ok(capabilities());
            }
            "launch" | "attach" => {
                if self.debugged.is_some() {
                    return Err("a program is being debugged already".to_owned());
                }
                let Launched { target, note, folders } = launcher.launch(arguments, &self.control)?;
                self.no_debug = arguments["noDebug"].as_bool().unwrap_or(false);
                self.stop_on_entry = !self.no_debug && arguments["stopOnEntry"].as_bool().unwrap_or(true);
                self.debugged = Some(Debugged {
                    target,
                    breakpoints: Breakpoints::default(),
                    folders,
                    exception: None,
                    over: false,
                });
                if let Some(note) = note {
                    self.output(&note);
                }
                self.then = Then::Initialized;
                return Ok(Value::Null);
            }
            "disconnect" | "terminate" => {
                self.ended = command == "disconnect";
                if !self.ended {
                    self.event("terminated", json!({}));
                }
                return Ok(Value::Null);
            }
            // Nothing runs while a request is answered; one that runs was interrupted.
            "pause" => return Ok(Value::Null),
            _ => {}
        }
        let from_one = self.from_one;
        let Some(debugged) = &mut self.debugged else {
            return Err(format!("`{command}` before `launch`"));
        };
        let by_instruction = arguments["granularity"] == "instruction";
        let line = if by_instruction { Unit::Bundle } else { Unit::Line };
        match command {
            "configurationDone" => self.then = if self.stop_on_entry { Then::Enter } else { Then::Continue },
            "continue" => {
                self.then = Then::Continue;
                return Ok(json!({ "allThreadsContinued": true }));
            }
            "reverseContinue" => self.then = Then::Back,
            "next" => {
                let unit = if by_instruction { Unit::Call } else { Unit::Line };
                self.then = Then::Step(debugged.thread(arguments)?, unit, true);
            }
            "stepIn" => self.then = Then::Step(debugged.thread(arguments)?, line, false),
            "stepOut" => self.then = Then::Step(debugged.thread(arguments)?, Unit::Out, false),
            "stepBack" => self.then = Then::StepBack(debugged.thread(arguments)?, line),
            "takt/gotoCycle" => self.then = Then::GoTo(Goal::Cycle(number(arguments, "cycle")?)),
            "takt/gotoPeriod" => {
                let goal = Goal::Period(debugged.thread(arguments)?, number(arguments, "period")?);
                self.then = Then::GoTo(goal);
            }
            "threads" => {
                let thread = |core| json!({ "id": core + 1, "name": debugged.target.name(core) });
                return Ok(
                    json!({ "threads": (0..debugged.target.cores()).map(thread).collect::<Vec<_>>() }),
                );
            }
            "setBreakpoints" => return debugged.set_lines(arguments, from_one.0),
            "setFunctionBreakpoints" => return debugged.set_functions(arguments),
            "setInstructionBreakpoints" => return debugged.set_instructions(arguments),
            "dataBreakpointInfo" => return debugged.data_info(arguments),
            "setDataBreakpoints" => return debugged.set_data(arguments),
            "setExceptionBreakpoints" => {
                self.filters = Filters::of(arguments)?;
                return Ok(json!({}));
            }
            "exceptionInfo" => {
                let Some((id, description)) = &debugged.exception else {
                    return Err("the program has not stopped for an exception".to_owned());
                };
                return Ok(json!({ "exceptionId": id, "description": description, "breakMode": "always" }));
            }
            "stackTrace" => return debugged.stack(arguments, from_one),
            "scopes" => return debugged.scopes(arguments),
            "variables" => return debugged.variables(arguments),
            "setVariable" => return debugged.set_variable(text(arguments, "name")?, arguments),
            "setExpression" => return debugged.set_variable(text(arguments, "expression")?, arguments),
            "evaluate" => return debugged.evaluate(arguments),
            "completions" => return debugged.completions(arguments),
            "disassemble" => return debugged.disassemble(arguments, from_one.0),
            "readMemory" => return debugged.read_memory(arguments),
            "source" => return debugged.source_text(arguments),
            "loadedSources" => {
                let cores = 0..debugged.target.cores();
                let files = |core: usize| 0..debugged.target.session(core).program().files.len() as u32;
                let sources: Vec<Value> = cores
                    .flat_map(|core| files(core).map(move |file| (core, file)))
                    .map(|(core, file)| debugged.source(core, file))
                    .collect();
                return Ok(json!({ "sources": sources }));
            }
            _ => return Err(format!("Takt's debug adapter has no `{command}`")),
        }
        Ok(json!({}))
    }
}

fn capabilities() -> Value {
    let filters: Vec<Value> = Filters::ALL.iter().map(|(filter, label, description)| {
        json!({ "filter": filter, "label": label, "description": description, "default": false })
    }).collect();
    json!({
        "supportsConfigurationDoneRequest": true,
        "supportsFunctionBreakpoints": true,
        "supportsConditionalBreakpoints": true,
        "supportsHitConditionalBreakpoints": true,
        "supportsLogPoints": true,
        "supportsInstructionBreakpoints": true,
        "supportsDataBreakpoints": true,
        "supportsEvaluateForHovers": true,
        "supportsSetVariable": true,
        "supportsSetExpression": true,
        "supportsStepBack": true,
        "supportsSteppingGranularity": true,
        "supportsDisassembleRequest": true,
        "supportsReadMemoryRequest": true,
        "supportsExceptionInfoRequest": true,
        "supportsValueFormattingOptions": true,
        "supportsCompletionsRequest": true,
        "supportsLoadedSourcesRequest": true,
        "supportsTerminateRequest": true,
        "exceptionBreakpointFilters": filters,
    })
}

impl Debugged {
    /// The core of a request's thread; if none is said, the one that stopped last.
    fn thread(&self, arguments: &Value) -> Result<usize, String> {
        let thread = &arguments["threadId"];
        let core = if thread.is_null() {
            Some(self.target.selected())
        } else {
            thread.as_u64().and_then(|thread| self.target.checked(thread.checked_sub(1)?))
        };
        core.ok_or_else(|| format!("there is no thread {thread} (threads: 1 to {})", self.target.cores()))
    }

    /// The core that a request's frame or list of variables is of; if neither is said, the one that stopped last.
    fn core_of(&self, arguments: &Value) -> Result<usize, String> {
        for name in ["frameId", "variablesReference"] {
            if let Some(number) = arguments[name].as_u64() {
                return self
                    .target
                    .checked(number / CORE)
                    .ok_or_else(|| format!("there is no `{name}` {number}"));
            }
        }
        Ok(self.target.selected())
    }

    /// The path of a source, if it lies on the disk.
    fn path_of(&self, core: usize, file: u32) -> Option<PathBuf> {
        let name = self.target.session(core).program().files.get(file as usize)?;
        let path = self.folders.get(core)?.join(name);
        (!name.starts_with('<') && Path::new(&path).is_file()).then_some(path)
    }
}
