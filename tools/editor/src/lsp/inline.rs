// SPDX-License-Identifier: MIT OR Apache-2.0
//! Language server without threads or a clock, for hosts that have neither, such as web pages.

use crate::lsp::worker::JobResult;
use crate::lsp::{Phase, Server, Settings, program};
use crossbeam_channel::{Receiver, unbounded};
use lsp_server::Message;

/// A server that works only when called. The host calls [`Inline::check`] after a pause of the client, and [`Inline::schedule`] after a
/// longer pause.
pub struct Inline {
    server: Server,
    sent: Receiver<Message>,
}

impl Inline {
    /// Creates a server that waits for `initialize`.
    pub fn new(settings: Settings) -> Inline {
        let (sender, sent) = unbounded();
        Inline { server: Server::new(settings, sender, || None, None), sent }
    }

    /// Handles a message from the client; returns the server's messages.
    pub fn receive(&mut self, message: Message) -> Vec<Message> {
        match message {
            Message::Notification(notification) => self.server.notification(notification),
            Message::Request(request) => self.server.request(request),
            Message::Response(_) => {}
        }
        self.messages()
    }

    /// Reads and checks changed programs; returns the server's messages.
    pub fn check(&mut self) -> Vec<Message> {
        if self.server.phase == Phase::Running && !self.server.stale.is_empty() {
            self.server.read();
        }
        self.messages()
    }

    /// Schedules one changed program and counts its cycles; returns the server's messages, and whether more programs are waiting.
    pub fn schedule(&mut self) -> (Vec<Message>, bool) {
        let mut said = self.check();
        if let Some(root) = self.server.unscheduled.pop_first()
            && let Some(generation) = self.server.programs.get(&root).map(|program| program.generation)
        {
            let texts = self.server.workspace.texts();
            let (_, checked) = program::check(&self.server.settings, &root, &texts);
            let full = program::finish(&root, checked);
            self.server.scheduled(JobResult { root, generation, full });
        }
        said.extend(self.messages());
        (said, !self.server.unscheduled.is_empty())
    }

    fn messages(&self) -> Vec<Message> {
        self.sent.try_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lsp_server::{Notification, Request};
    use serde_json::{Value, json};

    fn settings() -> Settings {
        Settings {
            beside: &[("part.s", ".const half = 0.5\n")],
            library: &[("lib.s", ".const third = 0.25\n")],
            library_by_name: true,
            ..Settings::default()
        }
    }

    fn notify(server: &mut Inline, method: &str, params: Value) -> Vec<Message> {
        server.receive(Notification::new(method.to_owned(), params).into())
    }

    fn ask(server: &mut Inline, method: &str, params: Value) -> Value {
        let said = server.receive(Request::new(1.into(), method.to_owned(), params).into());
        let answer = said.into_iter().find_map(|message| match message {
            Message::Response(response) => response.response_result.ok(),
            _ => None,
        });
        answer.unwrap_or_default()
    }

    fn diagnostics(said: &[Message]) -> Vec<Value> {
        let published = said.iter().filter_map(|message| match message {
            Message::Notification(Notification { method, params }) => {
                (method == "textDocument/publishDiagnostics").then(|| params["diagnostics"].clone())
            }
            _ => None,
        });
        published.collect()
    }

    /// Calls alone replace both threads of [`crate::lsp::serve`]: diagnostics come after the pause, cycles after the longer one.
    #[test]
    fn works_when_called() {
        let mut server = Inline::new(settings());
        ask(&mut server, "initialize", json!({ "capabilities": {} }));
        let source = ".include \"part.s\"\n.input x\n.output y\n.reg a\n.period\n.schedule on\nstart:\n    fmul a, x, half\n    fadd y, a, x\n    wait start\n";
        let document = |text: &str| json!({ "textDocument": { "uri": "main.s", "languageId": "takt", "version": 1, "text": text } });
        let opened = notify(&mut server, "textDocument/didOpen", document(source));
        assert!(opened.is_empty(), "nothing is read while the client types: {opened:?}");
        assert_eq!(diagnostics(&server.check()), [json!([])]);
        let hints = json!({ "textDocument": { "uri": "main.s" }, "range": { "start": { "line": 0, "character": 0 }, "end": { "line": 99, "character": 0 } } });
        assert_eq!(ask(&mut server, "textDocument/inlayHint", hints.clone()), json!([]));
        let (_, more) = server.schedule();
        assert!(!more, "there is one program");
        let counted = ask(&mut server, "textDocument/inlayHint", hints);
        assert!(counted.as_array().is_some_and(|hints| !hints.is_empty()), "{counted}");
        assert!(
            counted.to_string().contains("(main.s:8)"),
            "what a line waits for is named by the document: {counted}"
        );
        let rename = |name: &str, line: u32, character: u32| json!({ "textDocument": { "uri": "main.s" }, "position": { "line": line, "character": character }, "newName": name });
        let here = ask(&mut server, "textDocument/rename", rename("other", 7, 12));
        assert_eq!(here["changes"]["main.s"].as_array().map(Vec::len), Some(3), "{here}");
        // `part.s` is not open in the client, so names that it declares cannot be renamed.
        let there = ask(&mut server, "textDocument/rename", rename("whole", 7, 15));
        assert_eq!(there, Value::Null);

        // A document without a file still has a name.
        notify(
            &mut server,
            "textDocument/didOpen",
            json!({ "textDocument": { "uri": "other.s", "languageId": "takt", "version": 1, "text": ".include <lib.s>\n.reg a\n li a, third\n halt\n" } }),
        );
        server.check();
        for (line, character, wanted) in [(2, 9, 7), (0, 12, 0)] {
            let at = json!({ "textDocument": { "uri": "other.s" }, "position": { "line": line, "character": character } });
            let found = ask(&mut server, "textDocument/definition", at);
            assert_eq!(found[0]["uri"], "%3Clib.s%3E", "{found}");
            assert_eq!(found[0]["range"]["start"]["character"], wanted, "{found}");
        }

        let change = json!({ "textDocument": { "uri": "main.s", "version": 2 }, "contentChanges": [{ "text": "    fmull\n" }] });
        notify(&mut server, "textDocument/didChange", change);
        let told = diagnostics(&server.check());
        assert!(told.iter().any(|told| told.to_string().contains("fmull")), "{told:?}");
    }
}
