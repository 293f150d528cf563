// SPDX-License-Identifier: MIT OR Apache-2.0
//! Client for a server that exchanges framed JSON messages on standard input and output.

use super::Folder;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};

/// A running server process.
pub(crate) struct Client {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: BufReader<ChildStdout>,
    sent: i64,
    /// Messages received while waiting for an answer.
    pub(crate) other: VecDeque<Value>,
}

impl Client {
    pub(crate) fn start(folder: &Folder, line: &str) -> Client {
        let mut command = folder.command(&line.split_whitespace().collect::<Vec<_>>());
        let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
        let (stdin, stdout) = (child.stdin.take(), BufReader::new(child.stdout.take().unwrap()));
        Client { child, stdin, stdout, sent: 0, other: VecDeque::new() }
    }

    /// Sends bytes without a frame.
    pub(crate) fn raw(&mut self, bytes: &[u8]) {
        let stdin = self.stdin.as_mut().unwrap();
        stdin.write_all(bytes).and_then(|()| stdin.flush()).unwrap();
    }

    pub(crate) fn send(&mut self, message: &Value) {
        let text = message.to_string();
        self.raw(format!("Content-Length: {}\r\n\r\n{text}", text.len()).as_bytes());
    }

    /// Next message; unread earlier ones come first.
    #[track_caller]
    pub(crate) fn receive(&mut self) -> Value {
        self.read().expect("the server has not ended")
    }

    fn read(&mut self) -> Option<Value> {
        let mut length = 0;
        loop {
            let mut line = String::new();
            if self.stdout.read_line(&mut line).unwrap() == 0 {
                return None;
            }
            match line.trim_end().split_once(": ") {
                Some(("Content-Length", value)) => length = value.parse().unwrap(),
                Some(_) => {}
                None => break,
            }
        }
        let mut bytes = vec![0; length];
        self.stdout.read_exact(&mut bytes).unwrap();
        Some(serde_json::from_slice(&bytes).unwrap())
    }

    /// Waits for a message with a property, considering unread earlier ones first.
    #[track_caller]
    pub(crate) fn wait(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        if let Some(at) = self.other.iter().position(&wanted) {
            return self.other.remove(at).unwrap();
        }
        loop {
            let message = self.receive();
            if wanted(&message) {
                return message;
            }
            self.other.push_back(message);
        }
    }

    /// Sends a request of the language server protocol; returns the whole answer.
    #[track_caller]
    pub(crate) fn ask(&mut self, method: &str, params: Value) -> Value {
        self.sent += 1;
        let id = self.sent;
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params }));
        self.wait(|message| message["id"] == id && message.get("method").is_none())
    }

    pub(crate) fn notify(&mut self, method: &str, params: Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": params }));
    }

    /// Sends a request of the debug adapter protocol; returns the whole answer.
    #[track_caller]
    pub(crate) fn command(&mut self, command: &str, arguments: Value) -> Value {
        self.sent += 1;
        let id = self.sent;
        self.send(&json!({ "seq": id, "type": "request", "command": command, "arguments": arguments }));
        self.wait(|message| message["type"] == "response" && message["request_seq"] == id)
    }

    #[track_caller]
    pub(crate) fn event(&mut self, event: &str) -> Value {
        self.wait(|message| message["type"] == "event" && message["event"] == event)
    }

    /// Closes standard input; returns the exit status and standard error.
    pub(crate) fn end(mut self) -> (Option<i32>, String) {
        drop(self.stdin.take());
        while self.read().is_some() {}
        let output = self.child.wait_with_output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    }
}
