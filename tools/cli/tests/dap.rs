// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt dap` with several clients: on standard input and output, on a socket, and with Microsoft's test client.

use crate::common;
mod systems;

use crate::common::protocol::Client;
use crate::common::{Folder, SUM};
use serde_json::{Value, json};
use std::process::Command;

/// Launches a session, which stops at its beginning.
fn launched(folder: &Folder, configuration: Value) -> Client {
    let mut client = Client::start(folder, "dap");
    assert_eq!(client.command("initialize", json!({ "adapterID": "takt" }))["success"], true);
    let answer = client.command("launch", configuration);
    assert_eq!(answer["success"], true, "{answer}");
    client.event("initialized");
    client
}

fn start(client: &mut Client) -> Value {
    client.command("configurationDone", json!({}));
    client.event("stopped")["body"].clone()
}

fn ok(client: &mut Client, command: &str, arguments: Value) -> Value {
    let answer = client.command(command, arguments);
    assert_eq!(answer["success"], true, "{command}: {answer}");
    answer["body"].clone()
}

/// Sends a request that leads to a stop; returns the reason and the line.
fn go(client: &mut Client, command: &str, arguments: Value) -> (String, u64) {
    ok(client, command, arguments);
    let body = client.event("stopped")["body"].clone();
    let frames = ok(client, "stackTrace", json!({ "threadId": 1 }));
    (body["reason"].as_str().unwrap().to_owned(), frames["stackFrames"][0]["line"].as_u64().unwrap())
}

fn value(client: &mut Client, expression: &str) -> String {
    let body = ok(client, "evaluate", json!({ "expression": expression, "context": "watch" }));
    body["result"].as_str().unwrap().to_owned()
}

fn end(mut client: Client) {
    assert_eq!(client.command("disconnect", json!({}))["success"], true);
    let (status, stderr) = client.end();
    assert_eq!((status, stderr.as_str()), (Some(0), ""));
}

#[test]
fn reports_a_broken_configuration() {
    let folder = Folder::new();
    folder.write("wrong.s", "fad a, b\n");
    folder.write("sum.s", SUM);
    let core = |name: &str, program: &str| format!("[[core]]\nname = \"{name}\"\nprogram = \"{program}\"\n");
    folder.write("broken.toml", "tick = 100\n[[core]]\nname = \n");
    for (file, program) in [("missing.toml", "sun.s"), ("wrong.toml", "wrong.s"), ("two.toml", "sum.s")] {
        folder.write(file, format!("tick = 100\n{}{}", core("a", "sum.s"), core("b", program)));
    }
    let mut client = Client::start(&folder, "dap");
    client.command("initialize", json!({}));
    for (configuration, told) in [
        (json!({}), "needs `program`, the path of a source or an image, or `track`"),
        (json!([]), "expected a launch configuration, an object"),
        (json!({ "program": 7 }), "`program` in the launch configuration is the path"),
        (json!({ "program": "none.s" }), "cannot open none.s"),
        (json!({ "program": "." }), "folder"),
        (json!({ "program": "wrong.s" }), "there is no instruction or macro `fad`"),
        (json!({ "program": "sum.s", "machine": "t9" }), "there is no machine `t9`"),
        (json!({ "program": "sum.s", "machina": "t1" }), "no `machina`; did you mean `machine`?"),
        (
            json!({ "program": "sum.s", "tick": "soon" }),
            "`tick` in the launch configuration is a whole number",
        ),
        (json!({ "program": "sum.s", "tick": 0 }), "less than 1"),
        (json!({ "program": "sum.s", "inputs": "none.csv" }), "none.csv"),
        (json!({ "track": "yes" }), "`true` or `false`"),
        (json!({ "track": true, "inputs": "a.csv" }), "cannot be used with"),
        (json!({ "program": "sum.s", "include": ["nowhere"] }), "there is no such folder"),
        (json!({ "program": "none.toml" }), "cannot open none.toml"),
        (json!({ "program": "broken.toml" }), "broken.toml:3"),
        (json!({ "program": "missing.toml" }), "there is no program sun.s"),
        (json!({ "program": "wrong.toml" }), "there is no instruction or macro `fad`"),
        (json!({ "program": "two.toml", "machine": "t1" }), "the system's file names each core's"),
        (json!({ "program": "two.toml", "tick": 7 }), "the system's file has it"),
        (json!({ "program": "two.toml", "inputs": "none.csv" }), "none.csv"),
    ] {
        let answer = client.command("launch", configuration.clone());
        assert_eq!(answer["success"], false, "{configuration}");
        let text = answer["body"]["error"]["variables"]["text"].as_str().unwrap();
        assert!(text.contains(told), "{configuration}: {text}");
    }
    // Many clients show only one line, so it must contain the place.
    let answer = client.command("launch", json!({ "program": "wrong.s" }));
    let line = answer["message"].as_str().unwrap();
    assert_eq!(line, "wrong.s:1:1: error[unknown-instruction]: there is no instruction or macro `fad`");
    // After all these errors a launch still succeeds; additional fields from clients are accepted.
    let socket = json!({ "program": "sum.s", "host": "localhost", "debugServer": 4711 });
    assert_eq!(client.command("launch", socket)["success"], true);
    assert_eq!(client.command("launch", json!({ "program": "sum.s" }))["success"], false);
    end(client);
}

#[test]
fn survives_and_reports_invalid_messages() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let mut client = Client::start(&folder, "dap");
    assert_eq!(client.command("stackTrace", json!({}))["message"], "`stackTrace` before `launch`");
    client.raw(b"Content-Length: 3\r\n\r\n{]}");
    let output = client.event("output");
    assert!(output["body"]["output"].as_str().unwrap().contains("not JSON"), "{output}");
    client.send(&json!({ "hello": 1 }));
    assert_eq!(client.wait(|message| message["type"] == "response")["success"], false);
    client.command("launch", json!({ "program": "sum.s" }));
    start(&mut client);
    assert_eq!(client.command("dance", json!({}))["message"], "Takt's debug adapter has no `dance`");
    let huge = json!(u64::MAX);
    for (command, arguments) in [
        ("variables", json!({ "variablesReference": huge })),
        ("variables", json!({})),
        ("setBreakpoints", json!({})),
        ("setDataBreakpoints", json!({ "breakpoints": [{}] })),
        ("setExceptionBreakpoints", json!({ "filters": ["all"] })),
        ("takt/gotoCycle", json!({ "cycle": -1 })),
        ("disassemble", json!({ "memoryReference": "?", "instructionCount": 1 })),
        ("readMemory", json!({ "memoryReference": "0", "count": "x" })),
        ("setVariable", json!({ "name": "zero", "value": "1" })),
        ("setVariable", json!({ "name": "nothing", "value": "1" })),
        ("source", json!({ "sourceReference": huge })),
        ("exceptionInfo", json!({})),
        ("evaluate", json!({ "expression": "" })),
    ] {
        let answer = client.command(command, arguments.clone());
        let refused = answer["success"] == false || answer["body"]["breakpoints"][0]["verified"] == false;
        assert!(refused, "{command} {arguments}: {answer}");
    }
    for (command, arguments) in [
        (
            "disassemble",
            json!({ "memoryReference": "0x0", "instructionOffset": i64::MIN, "instructionCount": 3 }),
        ),
        (
            "disassemble",
            json!({ "memoryReference": "0xffffffff", "instructionOffset": i64::MAX, "instructionCount": huge }),
        ),
        (
            "readMemory",
            json!({ "memoryReference": "0xffffffff", "offset": i64::MAX - (1 << 40), "count": huge }),
        ),
        ("stackTrace", json!({ "startFrame": huge, "levels": huge })),
        ("completions", json!({ "text": "i", "column": huge })),
    ] {
        ok(&mut client, command, arguments);
    }
    end(client);
}

#[test]
fn steps_forward_and_back_in_the_editor() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let path = folder.path().join("sum.s");
    let mut client = launched(&folder, json!({ "program": "sum.s" }));
    let breakpoints =
        json!({ "source": { "path": path }, "breakpoints": [{ "line": 12, "condition": "i == 1" }] });
    let answer = ok(&mut client, "setBreakpoints", breakpoints);
    assert_eq!(answer["breakpoints"][0]["verified"], true);
    assert_eq!(start(&mut client)["reason"], "entry");
    // The first step has an effect, although the first bundle is not about to issue yet.
    assert_eq!(go(&mut client, "next", json!({ "threadId": 1 })), ("step".to_owned(), 4));
    assert_eq!(go(&mut client, "continue", json!({ "threadId": 1 })), ("breakpoint".to_owned(), 12));
    assert_eq!(value(&mut client, "i"), "1");
    let frames = ok(&mut client, "stackTrace", json!({ "threadId": 1 }));
    assert_eq!(frames["totalFrames"], 2);
    assert_eq!(frames["stackFrames"][1]["line"], 6);
    assert_eq!(frames["stackFrames"][0]["source"]["path"], path.to_str().unwrap());
    let cycle: u64 = value(&mut client, "cycle").parse().unwrap();
    go(&mut client, "next", json!({ "threadId": 1, "granularity": "instruction" }));
    go(&mut client, "stepBack", json!({ "threadId": 1, "granularity": "instruction" }));
    assert_eq!(value(&mut client, "cycle"), cycle.to_string());
    assert_eq!(go(&mut client, "stepOut", json!({ "threadId": 1 })).1, 7);
    let (_, line) = go(&mut client, "reverseContinue", json!({ "threadId": 1 }));
    assert_eq!((line, value(&mut client, "cycle")), (12, cycle.to_string()));
    go(&mut client, "takt/gotoCycle", json!({ "cycle": cycle + 3 }));
    assert_eq!(value(&mut client, "cycle"), (cycle + 3).to_string());
    assert_eq!(go(&mut client, "takt/gotoCycle", json!({ "cycle": 0 })).0, "goto");

    // Bundles, data memory, registers by bank, and debugger commands.
    let body = ok(&mut client, "disassemble", json!({ "memoryReference": "0x0", "instructionCount": 2 }));
    assert!(body["instructions"][0]["instruction"].as_str().unwrap().contains("li"), "{body}");
    let body = ok(&mut client, "readMemory", json!({ "memoryReference": "0", "count": 4 }));
    // 0.5 is 00 00 00 3f in little-endian bytes.
    assert_eq!(body["data"], "AAAAPw==");
    let body = ok(&mut client, "evaluate", json!({ "expression": "table[2]", "context": "hover" }));
    assert_eq!(body["result"], "-1.75");
    let body = ok(&mut client, "evaluate", json!({ "expression": "info n", "context": "repl" }));
    assert!(body["result"].as_str().unwrap().contains("written in bundle"), "{body}");
    let scopes = ok(&mut client, "scopes", json!({ "frameId": 0 }));
    for scope in scopes["scopes"].as_array().unwrap() {
        ok(&mut client, "variables", json!({ "variablesReference": scope["variablesReference"] }));
    }
    end(client);
}

/// `pause` stops an endless program, which ends with its client.
#[test]
fn a_running_program_can_be_paused() {
    let folder = Folder::new();
    folder.write("loop.s", ".reg n:int\n li n, 0\nagain: iadd n, n, 1\n jmp again\n");
    let mut client = launched(&folder, json!({ "program": "loop.s" }));
    start(&mut client);
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    ok(&mut client, "pause", json!({ "threadId": 1 }));
    assert_eq!(client.event("stopped")["body"]["reason"], "pause");
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    let (status, stderr) = client.end();
    assert_eq!((status, stderr.as_str()), (Some(0), ""));
}

#[test]
fn exceptions_stop_where_they_are_raised() {
    let folder = Folder::new();
    folder.write(
        "nan.s",
        "\
.output y
.reg n:int _t
        li      n, 40
turn:   isub    n, n, 1
        bnz     n, turn
        fsqrt   _t, -4.0
        mov     y, _t
        fmul    _t, 3e38, 10.0
        halt
",
    );
    let mut client = launched(&folder, json!({ "program": "nan.s" }));
    let filters = json!({ "filters": ["invalid", "overflow", "nan"] });
    ok(&mut client, "setExceptionBreakpoints", filters);
    start(&mut client);
    let mut met = Vec::new();
    for _ in 0..3 {
        let (reason, _) = go(&mut client, "continue", json!({ "threadId": 1 }));
        assert_eq!(reason, "exception");
        let info = ok(&mut client, "exceptionInfo", json!({ "threadId": 1 }));
        met.push(info["exceptionId"].as_str().unwrap().to_owned());
    }
    assert_eq!(met, ["invalid", "nan", "overflow"]);
    // At a halt, steps back are still possible.
    assert_eq!(go(&mut client, "continue", json!({ "threadId": 1 })).0, "pause");
    go(&mut client, "stepBack", json!({ "threadId": 1 }));
    end(client);

    // A fault always stops the program, even without a filter.
    folder.write("read.s", ".reg _a i:int\n li i, 5000\n ld _a, [i]\n halt\n");
    let mut client = launched(&folder, json!({ "program": "read.s" }));
    start(&mut client);
    let (reason, line) = go(&mut client, "continue", json!({ "threadId": 1 }));
    assert_eq!((reason.as_str(), line), ("exception", 3));
    end(client);
}

/// A run without debugging ignores stops, and ends the session when it ends.
#[test]
fn runs_without_debugging() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    folder.write("read.s", ".reg _a i:int\n li i, 5000\n ld _a, [i]\n halt\n");
    for (program, told) in [("sum.s", "the program has halted"), ("read.s", "5000")] {
        let mut client = launched(&folder, json!({ "program": program, "noDebug": true }));
        let source = json!({ "source": { "path": program }, "breakpoints": [{ "line": 3 }] });
        ok(&mut client, "setBreakpoints", source);
        ok(&mut client, "configurationDone", json!({}));
        let said = client.wait(|message| message["event"] == "output" || message["event"] == "stopped");
        assert!(said["body"]["output"].as_str().is_some_and(|output| output.contains(told)), "{said}");
        let ended = client.wait(|message| message["event"] == "terminated" || message["event"] == "stopped");
        assert_eq!(ended["event"], "terminated");
        end(client);
    }
}

#[test]
fn a_missed_deadline_stops() {
    let folder = Folder::new();
    folder.write(
        "slow.s",
        ".output y\n.period\nperiod: mov y, 1.0\n nop\n nop\n nop\n nop\n nop\n wait period\n",
    );
    let mut client = launched(&folder, json!({ "program": "slow.s", "tick": 6 }));
    ok(&mut client, "setExceptionBreakpoints", json!({ "filters": ["missed"] }));
    start(&mut client);
    assert_eq!(go(&mut client, "continue", json!({ "threadId": 1 })).0, "exception");
    let cycle: u64 = value(&mut client, "cycle").parse().unwrap();
    assert!(cycle < 40, "{cycle}");
    end(client);
}

/// The session on the closed loop starts at the largest tracking error.
#[test]
fn attaches_to_the_closed_loop() {
    let folder = Folder::new();
    let mut client = launched(&folder, json!({ "track": true, "periods": 40 }));
    let note = client.event("output");
    assert!(note["body"]["output"].as_str().unwrap().contains("the largest tracking error is"), "{note}");
    start(&mut client);
    let body = ok(&mut client, "stackTrace", json!({ "threadId": 1 }));
    let source = &body["stackFrames"][0]["source"];
    let text = ok(&mut client, "source", json!({ "source": source }));
    assert_eq!(text["content"], std::fs::read_to_string(common::source("tracking.s")).unwrap());
    go(&mut client, "takt/gotoPeriod", json!({ "period": 2 }));
    assert_eq!(value(&mut client, "period"), "2");
    end(client);
}

#[test]
fn listens_on_a_socket() {
    use std::io::{BufRead, BufReader, Read, Write};
    let folder = Folder::new();
    let mut child = folder.command(&["dap", "--listen", "127.0.0.1:0"]).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening on ").unwrap().to_owned();
    // Clients are served one after another.
    for _ in 0..2 {
        let mut stream = std::net::TcpStream::connect(&address).unwrap();
        let text =
            json!({ "seq": 1, "type": "request", "command": "initialize", "arguments": {} }).to_string();
        let bye = json!({ "seq": 2, "type": "request", "command": "disconnect" }).to_string();
        for text in [text, bye] {
            write!(stream, "Content-Length: {}\r\n\r\n{text}", text.len()).unwrap();
        }
        let mut all = String::new();
        stream.read_to_string(&mut all).unwrap();
        assert!(all.contains("supportsStepBack") && all.contains("\"command\":\"disconnect\""), "{all}");
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(folder.line("dap --listen nowhere").status, Some(1));
}

/// Emacs's dap-mode, with the repository's configuration file.
#[test]
fn emacs_debugs_a_program() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    folder.write("wrong.s", "fad a, b\n");
    folder.write("loop.s", ".reg n:int\n li n, 0\nagain: iadd n, n, 1\n jmp again\n");
    let core = |name: &str, program: &str| format!("[[core]]\nname = \"{name}\"\nprogram = \"{program}\"\n");
    folder.write("two.toml", format!("tick = 100\n{}{}", core("adds", "sum.s"), core("loops", "loop.s")));
    folder.write("broken.toml", "tick = 100\n[[core]]\nname = \n");
    let clients = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clients/emacs_dap.el");
    let configuration = concat!(env!("CARGO_MANIFEST_DIR"), "/../editors/emacs");
    let mut emacs = Command::new("emacs");
    emacs.args(["--batch", "-L", configuration, "-l", clients, "-f", "takt-test"]);
    emacs.arg(env!("CARGO_BIN_EXE_takt")).arg(folder.path()).env("HOME", folder.path());
    let output = emacs.output().expect("emacs is there: `cargo xtask test` installs it");
    let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_str(stdout.trim()).unwrap_or_else(|_| panic!("{stdout}{stderr}"));
    assert_eq!(found.get("problem"), None, "{found:#}");
    let refused = |file: usize, told: &str| {
        let text = found["refused"][file].as_str().unwrap();
        assert!(text.contains(told), "{text}");
    };
    refused(0, "cannot open none.s");
    refused(1, "wrong.s:1:1: error[unknown-instruction]: there is no instruction or macro `fad`");
    refused(2, "broken.toml:3");
    assert_eq!(found["mode"], "takt-mode");
    // File in the editor, line of the frame, line of the cursor, thread.
    assert_eq!(found["entry"], json!(["sum.s", 3, 3, 1]));
    assert_eq!(found["breakpoint"], json!(["sum.s", 12, 12, 1]));
    assert_eq!(found["i"], "0");
    assert_eq!(found["out"], json!(["sum.s", 7, 7, 1]));
    assert_eq!(found["next"], json!(["sum.s", 8, 8, 1]));
    assert_eq!(found["back"], json!(["sum.s", 7, 7, 1]));
    assert_eq!(found["reverse"], json!(["sum.s", 12, 12, 1]));
    assert_eq!(found["threads"], json!(["adds", "loops"]));
    assert_eq!((&found["first"][0], &found["second"][0]), (&json!("sum.s"), &json!("loop.s")));
    assert_eq!(found["stepped"], json!(["loop.s", 3, 3, 2]));
    assert_eq!(found["n"], "0");
}

/// Microsoft's test client, which also tests VS Code's debuggers.
#[test]
fn an_independent_client_debugs_a_program() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clients/dap/client.js");
    let output = Command::new("node").arg(script).arg(env!("CARGO_BIN_EXE_takt")).arg(folder.path()).output();
    let output = output.expect("node is there: `cargo xtask test` installs it, and what the client needs");
    let stderr = String::from_utf8_lossy(&output.stderr);
    let stdout = String::from_utf8_lossy(&output.stdout);
    let found: Value = serde_json::from_str(stdout.trim()).unwrap_or_else(|_| panic!("{stdout}{stderr}"));
    assert_eq!(found.get("problem"), None, "{found:#}");
    assert_eq!(found["stepsBack"], true);
    assert!(found["refused"].as_str().unwrap().contains("none.s"), "{found:#}");
    assert_eq!(found["verified"], json!([true, true, false]));
    assert_eq!(found["unverified"], "line 1 of sum.s has no instruction; the next line with one is 3");
    assert_eq!(found["entry"], "entry");
    let stop = |name: &str| (found[name]["reason"].as_str().unwrap(), found[name]["line"].as_u64().unwrap());
    assert_eq!(stop("second"), ("breakpoint", 12));
    assert_eq!(found["second"]["depth"], 2);
    assert_eq!(found["logged"], json!(["i is 1"]));
    assert_eq!((&found["i"], &found["evaluated"]), (&json!("1"), &json!("41")));
    assert_eq!(found["views"], json!(["float", "hex float", "int", "bits", "1 ulp"]));
    assert!(found["wrong"].as_str().unwrap().contains("incomplete"), "{found:#}");
    assert_eq!(stop("out"), ("step", 7));
    assert_eq!(stop("back").0, "step");
    assert_eq!(found["set"], "2");
    assert_eq!(stop("changed").0, "data breakpoint");
    assert_eq!(stop("reverse"), ("function breakpoint", 12));
    assert_eq!(found["count"], "2");
    assert_eq!(found["terminated"], "terminated");
    assert_eq!((stop("cycle").0, &found["atCycle"]), ("goto", &json!("9")));
    assert!(found["noCycle"].as_str().unwrap().contains("`cycle` is a whole number"), "{found:#}");
    assert_eq!(stop("beginning").0, "entry");
    assert_eq!(found["filters"], json!(["invalid", "overflow", "missed", "nan"]));
    assert_eq!((&found["gone"], &found["period"]), (&json!("goto"), &json!("3")));
    for value in found["hex"].as_array().unwrap() {
        assert!(value.as_str().unwrap().starts_with("0x"), "{found:#}");
    }
    assert_eq!(found["ulp"]["name"], "1 ulp");
    assert_eq!((&found["port"], &found["another"]), (&json!("data breakpoint"), &json!(true)));
    assert_eq!(found["nan"], true);
}
