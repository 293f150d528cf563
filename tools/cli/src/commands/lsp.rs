// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt lsp`: language server on standard input and output.

use crate::terminal::files::Out;
use crate::terminal::number::{self, Time};
use crate::terminal::options::{self, MachineArgument, SourceArguments};
use crate::terminal::output::{Failure, message};
use anyhow::Result;
use clap::Args;
use lsp_server::{Connection, ErrorCode, Message};
use serde_json::json;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use takt_editor::lsp::{self, Settings};
use takt_editor::wire::{self, WireError};

/// Serve an editor: diagnostics, hover, completion, cycles beside each line, renaming, formatting.
///
/// Speaks the language server protocol on standard input and output, until the editor ends it. docs/editors.md says how each
/// editor is told.
#[derive(Args)]
pub(crate) struct Lsp {
    #[command(flatten)]
    machine: MachineArgument,
    #[command(flatten)]
    source: SourceArguments,
    /// The time that a period may take, shown above it: `100us`, `0.1ms`, or a number of cycles.
    #[arg(long, value_name = "TIME", value_parser = number::time, allow_hyphen_values = true)]
    deadline: Option<Time>,
    /// Clock in MHz, for a deadline in seconds.
    #[arg(long, value_name = "MHZ", default_value_t = options::PAPER_CLOCK, value_parser = number::clock, allow_hyphen_values = true)]
    clock: f64,
    /// Ignored: clients add it to say that they use standard input and output, as Takt does.
    #[arg(long, hide = true)]
    stdio: bool,
}

/// Folder for copies of library files that are opened in an editor.
fn library_folder() -> Option<PathBuf> {
    Some(takt_cache::folder().ok()?.join("library"))
}

pub(crate) fn run(arguments: &Lsp, _color: bool, _out: &mut Out) -> Result<()> {
    let settings = Settings {
        machine: arguments.machine.machine,
        levels: arguments.source.warnings.iter().copied().collect(),
        folders: arguments.source.folders.clone(),
        library: takt_programs::LIBRARY,
        beside: &[],
        library_folder: library_folder(),
        library_by_name: false,
        deadline: arguments.deadline.as_ref().map(|deadline| deadline.cycles(arguments.clock)),
    };
    let (to_server, from_client) = crossbeam_channel::unbounded();
    let (to_client, from_server) = crossbeam_channel::unbounded();
    let connection = Connection { sender: to_client, receiver: from_client };
    // Two threads write here: answers, and reports of malformed messages.
    let out = std::sync::Arc::new(Mutex::new(io::stdout()));
    let for_reader = std::sync::Arc::clone(&out);
    // The reader ends with its stream or with the process.
    std::thread::spawn(move || {
        let mut stdin = io::stdin().lock();
        loop {
            let complaint = match wire::read(&mut stdin) {
                Ok(None) => return,
                Ok(Some(value)) => match serde_json::from_value::<Message>(value) {
                    Ok(received) => match to_server.send(received) {
                        Ok(()) => continue,
                        Err(_) => return,
                    },
                    Err(_) => (
                        ErrorCode::InvalidRequest,
                        "a message is not a request, notification or response".to_owned(),
                    ),
                },
                Err(WireError::Message(text)) => (ErrorCode::ParseError, text),
                Err(WireError::Lost(text)) => {
                    message(&format!("takt lsp: {text}"));
                    return;
                }
            };
            let (code, text) = complaint;
            let answer =
                json!({ "jsonrpc": "2.0", "id": null, "error": { "code": code as i32, "message": text } });
            let mut out = for_reader.lock().unwrap_or_else(PoisonError::into_inner);
            if wire::write(&mut *out, &answer).is_err() {
                return;
            }
        }
    });
    let writer = std::thread::spawn(move || {
        for sent in from_server {
            let Ok(mut sent) = serde_json::to_value(&sent) else { continue };
            sent["jsonrpc"] = "2.0".into();
            let mut out = out.lock().unwrap_or_else(PoisonError::into_inner);
            if wire::write(&mut *out, &sent).is_err() {
                return;
            }
        }
    });
    let in_order = lsp::serve(&connection, settings);
    drop(connection);
    // Let the writer finish the last answer before the process ends.
    let _ = writer.join();
    let _ = io::stdout().flush();
    if in_order { Ok(()) } else { Err(Failure::Reported.into()) }
}
