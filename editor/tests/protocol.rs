//! Requests of Takt's own, and where the debug adapter goes back to, without a process in between.

use crossbeam_channel::unbounded;
use lsp_server::{Message, Notification, Request};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;
use takt_asm::MemoryLoader;
use takt_debug::session::{Control, Options, Session};
use takt_editor::dap::{Launched, Launcher, serve};
use takt_editor::lsp::{Inline, Settings};

const SOURCE: &str = ".input x
.output y
.period
.schedule on
start:
    fmul y, x, 0.5
    wait start
";

fn ask(server: &mut Inline, method: &str, params: Value) -> Value {
    let said = server.receive(Request::new(1.into(), method.to_owned(), params).into());
    let answer = said.into_iter().find_map(|message| match message {
        Message::Response(response) => response.response_result.ok(),
        _ => None,
    });
    answer.expect("it is answered")
}

fn notify(server: &mut Inline, method: &str, params: Value) {
    server.receive(Notification::new(method.to_owned(), params).into());
}

/// The picture of the pipeline comes when the program is counted, which those hear who want to; its lines follow what is
/// written.
#[test]
fn the_picture_follows_the_text() {
    let counted = |said: &[Message]| {
        said.iter()
            .any(|message| matches!(message, Message::Notification(told) if told.method == "takt/counted"))
    };
    for wants in [true, false] {
        let mut server = Inline::new(Settings::default());
        let capabilities = json!({ "experimental": { "takt/counted": wants } });
        ask(&mut server, "initialize", json!({ "capabilities": capabilities }));
        let document = json!({ "uri": "main.s", "languageId": "takt", "version": 1, "text": SOURCE });
        notify(&mut server, "textDocument/didOpen", json!({ "textDocument": document }));
        server.check();
        let params = json!({ "textDocument": { "uri": "main.s" } });
        assert_eq!(ask(&mut server, "takt/pipeline", params.clone()), Value::Null);
        let (said, _) = server.schedule();
        assert_eq!(counted(&said), wants);

        let operations = |picture: &Value| -> Vec<(String, u64)> {
            let bundles = picture["bundles"].as_array().expect("it has bundles").iter();
            let all = bundles.flat_map(|bundle| bundle["operations"].as_array().expect("it has operations"));
            let one = |operation: &Value| {
                let word = operation["text"].as_str()?.split_whitespace().next()?.to_owned();
                Some((word, operation["line"].as_u64()?))
            };
            all.map(|operation| one(operation).expect("it has a text and a line")).collect()
        };
        let picture = ask(&mut server, "takt/pipeline", params.clone());
        assert_eq!(operations(&picture), [("fmul".to_owned(), 5), ("wait".to_owned(), 6)], "{picture:#}");
        assert_eq!(picture["bundles"][0]["cycle"], 1);
        assert_eq!(picture["bundles"][0]["from"], "period");

        // Until it is counted again, what is known stands at the lines where it is now.
        let text = format!("; more\n{SOURCE}");
        let change = json!({ "textDocument": { "uri": "main.s", "version": 2 }, "contentChanges": [{ "text": text }] });
        notify(&mut server, "textDocument/didChange", change);
        let moved = ask(&mut server, "takt/pipeline", params);
        assert_eq!(operations(&moved), [("fmul".to_owned(), 6), ("wait".to_owned(), 7)]);
    }
}

/// A program that counts to 3.
const LOOP: &str = ".reg i:int, x:int
    li i, 0
next: iadd i, i, 1
    ilt x, i, 3
    bnz x, next
    halt
";

struct Loop;

impl Launcher for Loop {
    fn launch(&mut self, _: &Value, _: &Arc<Control>) -> Result<Launched, String> {
        let source = MemoryLoader::of("loop.s", LOOP);
        let assembled = takt_asm::assemble("loop.s", &source, &takt_asm::Options::default());
        let assembled = assembled.map_err(|mistakes| mistakes.render(false))?;
        let options = Options { names: assembled.names.clone(), ..Options::default() };
        let session = Session::new(&assembled.program, options).map_err(|error| error.to_string())?;
        Ok(Launched { session, note: None, folder: PathBuf::from("/nowhere") })
    }
}

/// Backwards as forwards, what only logs is no stop, nor is a data breakpoint whose condition does not hold.
#[test]
fn only_what_stops_forward_stops_backward() {
    let lines = |breakpoint: Value| json!(["setBreakpoints", { "source": { "path": "/nowhere/loop.s" }, "breakpoints": [breakpoint] }]);
    let data = |condition: &str| json!(["setDataBreakpoints", { "breakpoints": [{ "dataId": "i", "condition": condition }] }]);
    for (breakpoint, expected) in [
        (lines(json!({ "line": 4, "logMessage": "i is {i}" })), "entry"),
        (lines(json!({ "line": 4 })), "breakpoint"),
        (data("i > 9"), "entry"),
        (data("i > 1"), "data breakpoint"),
    ] {
        let (requests, received) = unbounded();
        let (sender, sent) = unbounded();
        let to_the_end = json!(["continue", { "threadId": 1 }]);
        let list = [
            json!(["initialize", {}]),
            json!(["launch", {}]),
            json!(["configurationDone", {}]),
            to_the_end,
            breakpoint.clone(),
            json!(["reverseContinue", { "threadId": 1 }]),
            json!(["disconnect", {}]),
        ];
        for (seq, request) in (1..).zip(list) {
            let message =
                json!({ "seq": seq, "type": "request", "command": request[0], "arguments": request[1] });
            requests.send(message).expect("it is there");
        }
        serve(&received, &sender, &Arc::default(), &mut Loop);
        let stops = sent.try_iter().filter(|message: &Value| message["event"] == "stopped");
        let reasons: Vec<Value> = stops.map(|stop| stop["body"]["reason"].clone()).collect();
        assert_eq!(reasons, ["entry", "pause", expected], "{breakpoint}");
    }
}
