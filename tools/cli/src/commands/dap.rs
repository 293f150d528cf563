// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt dap`: debug adapter on standard input and output, or on a socket for one client after another.

use crate::commands::debug::{self, Debug, OpenedSession};
use crate::commands::track;
use crate::terminal::files::Out;
use crate::terminal::output::message;
use anyhow::{Context, Result};
use clap::{Args, Parser};
use crossbeam_channel::unbounded;
use serde_json::Value;
use std::io::{self, BufReader, Read, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_debug::session::Control;
use takt_diagnostics::describe;
use takt_editor::dap::{self, LaunchedSession, Launcher, Message};
use takt_editor::wire::{self, WireError};

/// Serve an editor's debugger: breakpoints, steps forward and back, registers, ports, operations in flight.
///
/// Speaks the debug adapter protocol on standard input and output, or on a socket. The editor's launch
/// configuration says what is debugged (docs/editors.md).
#[derive(Args)]
pub(crate) struct Dap {
    /// Serve clients on this address, one after the other, until it is killed: `127.0.0.1:4711`.
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<String>,
}

pub(crate) fn run(arguments: &Dap, _color: bool, _out: &mut Out) -> Result<()> {
    let Some(address) = &arguments.listen else {
        client(io::stdin(), io::stdout());
        return Ok(());
    };
    let listener = TcpListener::bind(address).with_context(|| format!("cannot listen on {address}"))?;
    // With port 0, the operating system chooses a port.
    message(&format!("listening on {}", listener.local_addr()?));
    loop {
        let (stream, _) = listener.accept().context("cannot accept a client")?;
        let reader = stream.try_clone().context("cannot accept a client")?;
        client(reader, &stream);
        // Also ends the reader of the other half.
        let _ = stream.shutdown(std::net::Shutdown::Both);
    }
}

/// Serves a client until it disconnects or its stream ends.
fn client(input: impl Read + Send + 'static, mut output: impl Write + Send) {
    let control = Arc::new(Control::default());
    let (requests, received) = unbounded::<Value>();
    let (sender, sent) = unbounded::<Option<Message>>();
    let (heard, complaints) = (Arc::clone(&control), sender.clone());
    // Do not join this thread: it may block on standard input forever.
    std::thread::spawn(move || {
        let mut input = BufReader::new(input);
        let lost = loop {
            match wire::read(&mut input) {
                Ok(None) => break None,
                Ok(Some(request)) => {
                    if dap::interrupts(&request) {
                        heard.interrupt();
                    }
                    if requests.send(request).is_err() {
                        break None;
                    }
                }
                Err(WireError::Message(text)) => {
                    if complaints.send(Some(Message::complaint(&text))).is_err() {
                        break None;
                    }
                }
                Err(WireError::Lost(text)) => break Some(text),
            }
        };
        // Stop a run whose client is gone.
        heard.interrupt();
        if let Some(text) = lost {
            message(&format!("takt dap: {text}"));
        }
    });
    std::thread::scope(|scope| {
        scope.spawn(move || {
            // `None` ends the messages.
            for message in sent.iter().map_while(|message| message) {
                if wire::write(&mut output, &message).is_err() {
                    return;
                }
            }
        });
        dap::serve(&received, &sender, &control, &mut CommandLine);
        // The reader still has a sender and may block on a silent client, so end the writer explicitly.
        let _ = sender.send(None);
    });
}

/// Launch configuration, translated to the command line of `takt debug`.
struct CommandLine;

#[derive(Parser)]
#[command(name = "launch", no_binary_name = true, disable_help_flag = true)]
struct Launch {
    #[command(flatten)]
    debug: Debug,
}

/// Fields of a configuration, with the corresponding options of `takt debug` and their types.
const FIELDS: [(&str, &str, Kind); 8] = [
    ("machine", "--machine", Kind::Text),
    ("inputs", "--inputs", Kind::Text),
    ("tick", "--tick", Kind::Number),
    ("track", "--track", Kind::Switch),
    ("gcode", "--gcode", Kind::Text),
    ("periods", "--periods", Kind::Number),
    ("include", "--include", Kind::Texts),
    ("warnings", "--warnings", Kind::Texts),
];

#[derive(Clone, Copy)]
enum Kind {
    Text,
    Texts,
    Number,
    Switch,
}

/// Fields that editors add, or that the adapter itself reads.
const OTHERS: [&str; 17] = [
    "program",
    "cwd",
    "stopOnEntry",
    "name",
    "type",
    "request",
    "noDebug",
    "restart",
    "presentation",
    "preLaunchTask",
    "postDebugTask",
    "internalConsoleOptions",
    // Address of an adapter on a socket: VS Code's field, and Emacs's, which includes the host.
    "debugServer",
    "host",
    "serverReadyAction",
    "trace",
    "suppressMultipleSessionWarning",
];

/// Translates a configuration to arguments of `takt debug`.
fn arguments(configuration: &Value, folder: Option<&Path>) -> Result<Vec<String>, String> {
    let Some(fields) = configuration.as_object() else {
        return Err("expected a launch configuration, an object with `program` or with `track`".to_owned());
    };
    let wrong = |name: &str, what: &str| format!("`{name}` in the launch configuration is {what}");
    // Paths are relative to `cwd`, if it is given.
    let path = |text: &str| match folder {
        Some(folder) if track::builtin_names().all(|name| name != text) => {
            folder.join(text).display().to_string()
        }
        _ => text.to_owned(),
    };
    let loops = fields.get("track").is_some_and(|track| *track != Value::Bool(false));
    if !fields.contains_key("program") && !loops {
        return Err(
            "a launch configuration needs `program`, the path of a source or an image, or `track`".to_owned()
        );
    }
    let mut list = Vec::new();
    for (name, value) in fields {
        if name == "program" {
            let text = value.as_str().filter(|text| !text.is_empty() && *text != "-");
            list.push(path(text.ok_or_else(|| wrong(name, "the path of a source or an image"))?));
            continue;
        }
        let Some((_, option, kind)) = FIELDS.iter().find(|field| field.0 == name) else {
            if OTHERS.contains(&name.as_str()) || name.starts_with("__") {
                continue;
            }
            let known = FIELDS.iter().map(|field| field.0).chain(OTHERS);
            let meant = takt_asm::nearest(name, known)
                .map_or(String::new(), |meant| format!("; did you mean `{meant}`?"));
            return Err(format!("a launch configuration has no `{name}`{meant}"));
        };
        let is_path = matches!(name.as_str(), "inputs" | "gcode" | "include");
        let mut push = |text: &str| {
            list.push(format!("{option}={}", if is_path { path(text) } else { text.to_owned() }))
        };
        match kind {
            Kind::Text => push(value.as_str().ok_or_else(|| wrong(name, "a text"))?),
            Kind::Texts => {
                let texts = value.as_array().ok_or_else(|| wrong(name, "a list of texts"))?;
                for text in texts {
                    push(text.as_str().ok_or_else(|| wrong(name, "a list of texts"))?);
                }
            }
            Kind::Number => push(&value.as_u64().ok_or_else(|| wrong(name, "a whole number"))?.to_string()),
            Kind::Switch => match value.as_bool() {
                Some(true) => list.push((*option).to_owned()),
                Some(false) => {}
                None => return Err(wrong(name, "`true` or `false`")),
            },
        }
    }
    Ok(list)
}

impl Launcher for CommandLine {
    fn launch(&mut self, configuration: &Value, control: &Arc<Control>) -> Result<LaunchedSession, String> {
        let cwd = configuration["cwd"].as_str().map(PathBuf::from);
        let list = arguments(configuration, cwd.as_deref())?;
        let parsed = Launch::try_parse_from(&list).map_err(|error| {
            // Keep the first line; the rest refers to a command line that the user never typed.
            let text = error.to_string();
            let text =
                text.lines().take_while(|line| !line.starts_with("Usage:")).collect::<Vec<_>>().join("\n");
            text.trim().trim_start_matches("error: ").to_owned()
        })?;
        let OpenedSession { console, note, files } =
            debug::open(&parsed.debug, control, false).map_err(|error| describe(error.as_ref()))?;
        Ok(LaunchedSession { console, note, folders: files.iter().map(|file| folder(file)).collect() })
    }
}

/// Folder of a file; the current folder for a bare name.
fn folder(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned())
}
