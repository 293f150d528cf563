// SPDX-License-Identifier: MIT OR Apache-2.0
//! Language server of the playground, with JSON messages.

use crate::examples;
use lsp_server::Message;
use serde_json::{Value, json};
use takt_editor::lsp::{Inline, Settings};
use takt_isa::Machine;

pub(crate) fn server(machine: &'static Machine) -> Inline {
    Inline::new(Settings {
        machine,
        library: takt_programs::LIBRARY,
        beside: examples::includable_sources(),
        library_by_name: true,
        ..Settings::default()
    })
}

pub(crate) fn receive(server: &mut Inline, message: Value) -> Result<Value, String> {
    let message: Message =
        serde_json::from_value(message).map_err(|error| format!("not a message of the protocol: {error}"))?;
    Ok(messages(server.receive(message)))
}

pub(crate) fn check(server: &mut Inline) -> Result<Value, String> {
    Ok(messages(server.check()))
}

pub(crate) fn schedule(server: &mut Inline) -> Result<Value, String> {
    let (said, more) = server.schedule();
    Ok(json!({ "messages": messages(said), "more": more }))
}

fn messages(messages: Vec<Message>) -> Value {
    let whole = |message: Message| {
        let mut value = serde_json::to_value(message).unwrap_or_default();
        value["jsonrpc"] = "2.0".into();
        value
    };
    messages.into_iter().map(whole).collect()
}
