//! `takt dap` as clients meet it: over standard input and output, on a socket, and with Microsoft's test client.

mod common;

use common::protocol::Client;
use common::{Folder, SUM};
use serde_json::{Value, json};
use std::process::Command;

/// A session that is launched and stands at its beginning.
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

/// Does something that ends in a stop: why, and the line.
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
fn a_broken_configuration_is_told() {
    let folder = Folder::new();
    folder.write("wrong.s", "fad a, b\n");
    folder.write("sum.s", SUM);
    let core = |name: &str, program: &str| format!("[[core]]\nname = \"{name}\"\nprogram = \"{program}\"\n");
    folder.write("broken.toml", "tick = 100\n[[core]]\nname = \n");
    for (file, program) in [("missing.toml", "sun.s"), ("wrong.toml", "wrong.s"), ("two.toml", "sum.s")] {
        folder.write(file, &format!("tick = 100\n{}{}", core("a", "sum.s"), core("b", program)));
    }
    let mut client = Client::start(&folder, "dap");
    client.command("initialize", json!({}));
    for (configuration, told) in [
        (json!({}), "has `program`, the path of a source or an image, or `track`"),
        (json!([]), "is an object"),
        (json!({ "program": 7 }), "`program` in the launch configuration is the path"),
        (json!({ "program": "none.s" }), "cannot open none.s"),
        (json!({ "program": "." }), "folder"),
        (json!({ "program": "wrong.s" }), "there is no instruction or macro `fad`"),
        (json!({ "program": "sum.s", "machine": "t9" }), "there is no such machine"),
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
    // And after all that, it can be launched.
    assert_eq!(client.command("launch", json!({ "program": "sum.s" }))["success"], true);
    assert_eq!(client.command("launch", json!({ "program": "sum.s" }))["success"], false);
    end(client);
}

#[test]
fn nonsense_is_told_and_survived() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let mut client = Client::start(&folder, "dap");
    assert_eq!(client.command("stackTrace", json!({}))["message"], "`stackTrace` before `launch`");
    client.raw(b"Content-Length: 3\r\n\r\n{]}");
    let output = client.event("output");
    assert!(output["body"]["output"].as_str().unwrap().contains("no JSON"), "{output}");
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
fn it_goes_forward_and_back() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let path = folder.path().join("sum.s");
    let mut client = launched(&folder, json!({ "program": "sum.s" }));
    let breakpoints =
        json!({ "source": { "path": path }, "breakpoints": [{ "line": 12, "condition": "i == 1" }] });
    let answer = ok(&mut client, "setBreakpoints", breakpoints);
    assert_eq!(answer["breakpoints"][0]["verified"], true);
    assert_eq!(start(&mut client)["reason"], "entry");
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

    // Bundles, data memory, registers by bank, the debugger's own commands.
    let body = ok(&mut client, "disassemble", json!({ "memoryReference": "0x0", "instructionCount": 2 }));
    assert!(body["instructions"][0]["instruction"].as_str().unwrap().contains("li"), "{body}");
    let body = ok(&mut client, "readMemory", json!({ "memoryReference": "0", "count": 4 }));
    // 0.5 is 00 00 00 3f.
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

/// A program that never ends is stopped by `pause`, and one whose client goes ends with it.
#[test]
fn what_runs_can_be_paused() {
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
.reg n:int t
        li      n, 40
turn:   isub    n, n, 1
        bnz     n, turn
        fsqrt   t, -4.0
        mov     y, t
        fmul    t, 3e38, 10.0
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
    // Then it halts; there is still a way back.
    assert_eq!(go(&mut client, "continue", json!({ "threadId": 1 })).0, "pause");
    go(&mut client, "stepBack", json!({ "threadId": 1 }));
    end(client);

    // A fault is an exception that nobody has to ask for.
    folder.write("read.s", ".reg _a i:int\n li i, 5000\n ld _a, [i]\n halt\n");
    let mut client = launched(&folder, json!({ "program": "read.s" }));
    start(&mut client);
    let (reason, line) = go(&mut client, "continue", json!({ "threadId": 1 }));
    assert_eq!((reason.as_str(), line), ("exception", 3));
    end(client);
}

/// What an editor calls running without debugging: nothing stops it, and its end ends the session.
#[test]
fn it_runs_without_debugging() {
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

/// The closed loop: it begins where the tracking error is largest.
#[test]
fn it_attaches_to_the_closed_loop() {
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
fn it_listens_on_a_socket() {
    use std::io::{BufRead, BufReader, Read, Write};
    let folder = Folder::new();
    let mut child = folder.command(&["dap", "--listen", "127.0.0.1:0"]).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening on ").unwrap().to_owned();
    // One client after the other.
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

/// The three cores of the system that comes with the repository.
fn system(folder: &Folder) -> Client {
    let systems = concat!(env!("CARGO_MANIFEST_DIR"), "/../programs/systems");
    launched(
        folder,
        json!({ "program": "speed.toml", "inputs": format!("{systems}/speed.csv"), "cwd": systems }),
    )
}

/// What is in a core's frame.
fn of_core(client: &mut Client, thread: u64, expression: &str) -> String {
    let frames = ok(client, "stackTrace", json!({ "threadId": thread }));
    let frame = &frames["stackFrames"][0]["id"];
    let body =
        ok(client, "evaluate", json!({ "expression": expression, "frameId": frame, "context": "watch" }));
    body["result"].as_str().unwrap().to_owned()
}

#[test]
fn each_core_of_a_system_is_a_thread() {
    let folder = Folder::new();
    let mut client = system(&folder);
    assert_eq!(start(&mut client)["threadId"], 1);
    let threads = ok(&mut client, "threads", json!({}));
    let threads: Vec<_> = threads["threads"].as_array().unwrap().iter().collect();
    let names: Vec<_> =
        threads.iter().map(|thread| (thread["id"].as_u64(), thread["name"].as_str())).collect();
    assert_eq!(names, [(Some(1), Some("profile")), (Some(2), Some("servo")), (Some(3), Some("watch"))]);

    // Each has its own source, wherever that lies.
    let mut sources = Vec::new();
    for thread in 1..=3 {
        let frames = ok(&mut client, "stackTrace", json!({ "threadId": thread }));
        let path = frames["stackFrames"][0]["source"]["path"].as_str().unwrap().to_owned();
        assert!(std::path::Path::new(&path).is_file(), "{path}");
        sources.push(path);
    }
    assert!(sources[1].ends_with("pi.s") && sources[2].ends_with("watch.s"), "{sources:?}");

    // A breakpoint in the source of any core stops all of them, and says which core it was.
    let breakpoints =
        json!({ "source": { "path": sources[2] }, "breakpoints": [{ "line": 20 }, { "line": 1 }] });
    let answer = ok(&mut client, "setBreakpoints", breakpoints);
    assert_eq!(answer["breakpoints"][0]["verified"], true, "{answer}");
    assert_eq!(answer["breakpoints"][1]["verified"], false, "{answer}");
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    let stop = client.event("stopped")["body"].clone();
    assert_eq!((&stop["threadId"], &stop["allThreadsStopped"]), (&json!(3), &json!(true)), "{stop}");
    assert_eq!(stop["hitBreakpointIds"][0], answer["breakpoints"][0]["id"]);
    let frames = ok(&mut client, "stackTrace", json!({ "threadId": 3 }));
    assert_eq!(frames["stackFrames"][0]["line"], 20);
    // All are in the same cycle; each has names of its own.
    let cycle = of_core(&mut client, 1, "cycle");
    assert_eq!(of_core(&mut client, 3, "cycle"), cycle);
    assert_eq!(of_core(&mut client, 3, "values"), "0");
    let none = client.command("evaluate", json!({ "expression": "values", "frameId": 0 }));
    assert_eq!(none["success"], false, "core `profile` has none: {none}");

    // A step of one core is one of that core, and of time for the others; back is back.
    let now = |client: &mut Client| of_core(client, 1, "cycle").parse::<u64>().unwrap();
    let here = now(&mut client);
    for (command, thread) in [("next", 2), ("stepIn", 1), ("next", 3)] {
        ok(
            &mut client,
            command,
            json!({ "threadId": thread, "granularity": "instruction", "singleThread": true }),
        );
        assert_eq!(client.event("stopped")["body"]["threadId"], thread, "{command}");
    }
    let there = now(&mut client);
    assert!(there > here, "{here} {there}");
    ok(&mut client, "stepBack", json!({ "threadId": 3, "granularity": "instruction" }));
    assert_eq!(client.event("stopped")["body"]["threadId"], 3);
    assert!(now(&mut client) < there);
    ok(&mut client, "reverseContinue", json!({ "threadId": 1 }));
    client.event("stopped");
    assert_eq!(now(&mut client), here);

    // Variables of each core, which are set apart.
    for thread in [2, 3] {
        let frames = ok(&mut client, "stackTrace", json!({ "threadId": thread }));
        let scopes = ok(&mut client, "scopes", json!({ "frameId": frames["stackFrames"][0]["id"] }));
        let scopes = scopes["scopes"].as_array().unwrap();
        let scope = |name: &str| {
            scopes.iter().find(|scope| scope["name"] == name).unwrap()["variablesReference"].clone()
        };
        let links = ok(&mut client, "variables", json!({ "variablesReference": scope("Links") }));
        assert!(links["variables"].as_array().unwrap().iter().any(|link| link["name"] == "moves"), "{links}");
        let inputs = ok(&mut client, "variables", json!({ "variablesReference": scope("Inputs") }));
        let input = inputs["variables"][0]["name"].as_str().unwrap().to_owned();
        let set = json!({ "variablesReference": scope("Inputs"), "name": input, "value": "1.25" });
        ok(&mut client, "setVariable", set);
        assert_eq!(of_core(&mut client, thread, &input), "1.25");
    }
    assert_ne!(of_core(&mut client, 2, "w_ref"), "1.25", "`u` of the watch is set, not that of the servo");

    // The addresses of one core's bundles are not those of another.
    let body = ok(&mut client, "stackTrace", json!({ "threadId": 3 }));
    let place = body["stackFrames"][0]["instructionPointerReference"].clone();
    let rows = ok(&mut client, "disassemble", json!({ "memoryReference": place, "instructionCount": 1 }));
    assert!(rows["instructions"][0]["location"]["path"].as_str().unwrap().ends_with("watch.s"), "{rows}");
    assert_eq!(rows["instructions"][0]["address"], place);
    for (command, arguments) in [
        ("stackTrace", json!({ "threadId": 4 })),
        ("next", json!({ "threadId": 0 })),
        ("scopes", json!({ "frameId": 1 << 30 })),
        ("variables", json!({ "variablesReference": (4 << 16) + 1 })),
        ("disassemble", json!({ "memoryReference": "0x900000000", "instructionCount": 1 })),
    ] {
        assert_eq!(client.command(command, arguments.clone())["success"], false, "{command} {arguments}");
    }
    end(client);
}

#[test]
fn a_system_stops_at_events_on_links_and_in_any_core() {
    let folder = Folder::new();
    let mut client = system(&folder);
    let names = json!({ "breakpoints": [
        { "name": "link moves pushed" }, { "name": "servo.period" }, { "name": "period" }, { "name": "link move" },
        { "name": "link moves", "condition": "1" },
    ] });
    let answer = ok(&mut client, "setFunctionBreakpoints", names);
    let verified: Vec<_> =
        answer["breakpoints"].as_array().unwrap().iter().map(|one| one["verified"].clone()).collect();
    assert_eq!(verified, [true, true, true, false, false], "{answer}");
    assert!(
        answer["breakpoints"][3]["message"].as_str().unwrap().contains("did you mean `moves`?"),
        "{answer}"
    );
    start(&mut client);
    // A label that every core has stops in every core, the first time within a base tick.
    let mut met = std::collections::BTreeSet::new();
    for _ in 0..12 {
        ok(&mut client, "continue", json!({ "threadId": 1 }));
        let stop = client.event("stopped")["body"].clone();
        met.insert((stop["threadId"].as_u64().unwrap(), stop["text"].as_str().unwrap().to_owned()));
    }
    let said = |thread: u64, text: &str| met.contains(&(thread, text.to_owned()));
    assert!(said(1, "period") && said(3, "period") && said(2, "servo.period"), "{met:?}");
    assert!(met.iter().any(|(_, text)| text == "link moves pushed"), "{met:?}");

    // The same by what is watched: a link, and a value of a core.
    ok(&mut client, "setFunctionBreakpoints", json!({ "breakpoints": [] }));
    let link = ok(&mut client, "dataBreakpointInfo", json!({ "name": "moves", "variablesReference": 7 }));
    let frames = ok(&mut client, "stackTrace", json!({ "threadId": 2 }));
    let frame = frames["stackFrames"][0]["id"].clone();
    let u = ok(&mut client, "dataBreakpointInfo", json!({ "name": "u", "frameId": frame }));
    assert_eq!(u["dataId"], "servo:u");
    let data = json!({ "breakpoints": [{ "dataId": link["dataId"], "condition": "popped" }, { "dataId": u["dataId"] }] });
    let answer = ok(&mut client, "setDataBreakpoints", data);
    assert_eq!(answer["breakpoints"][0]["verified"], true, "{answer}");
    ok(&mut client, "takt/gotoCycle", json!({ "cycle": 0 }));
    client.event("stopped");
    let mut texts = String::new();
    for _ in 0..12 {
        ok(&mut client, "continue", json!({ "threadId": 1 }));
        texts += client.event("stopped")["body"]["text"].as_str().unwrap();
        texts += "\n";
    }
    assert!(texts.contains("link moves popped") && texts.contains("u: "), "{texts}");

    // Periods are those of the thread.
    ok(&mut client, "takt/gotoPeriod", json!({ "period": 2, "threadId": 3 }));
    assert_eq!(client.event("stopped")["body"]["reason"], "goto");
    assert_eq!(of_core(&mut client, 3, "period"), "2");
    assert!(of_core(&mut client, 1, "period").parse::<u64>().unwrap() > 2);

    // The console's commands that look: the system's, and those of the frame's core.
    let say = |client: &mut Client, line: &str| {
        let answer =
            client.command("evaluate", json!({ "expression": line, "frameId": frame, "context": "repl" }));
        let text = answer["body"]["result"].as_str().or(answer["message"].as_str());
        (answer["success"] == true, text.unwrap().to_owned())
    };
    assert!(say(&mut client, "links moves").1.starts_with("moves: "));
    assert!(say(&mut client, "cores").1.contains("> servo"));
    assert!(say(&mut client, "ports").1.contains("w_ref"));
    for line in ["step", "delete", "accuracy"] {
        let (done, text) = say(&mut client, line);
        assert!(!done && text.contains("which only looks"), "{line}: {text}");
    }
    let help = say(&mut client, "help").1;
    assert!(help.contains("links") && !help.contains("reverse"), "{help}");
    // Where the recorded inputs end.
    ok(&mut client, "setDataBreakpoints", json!({ "breakpoints": [] }));
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    assert_eq!(client.event("stopped")["body"]["text"], "the recorded inputs end here");
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    client.event("terminated");
    end(client);
}

/// Exceptions of a core stop the system where they are raised, in that core.
#[test]
fn exceptions_of_a_core_stop_a_system() {
    let folder = Folder::new();
    folder.write("idle.s", ".reg n:int\n li n, 0\nagain: iadd n, n, 1\n jmp again\n");
    folder.write(
        "nan.s",
        ".reg n:int t\n li n, 300\nturn: isub n, n, 1\n bnz n, turn\n fsqrt t, -4.0\n clrflags\n halt\n",
    );
    folder.write("two.toml", "tick = 100\n[[core]]\nname = \"a\"\nprogram = \"idle.s\"\n[[core]]\nname = \"b\"\nprogram = \"nan.s\"\n");
    let mut client = launched(&folder, json!({ "program": "two.toml" }));
    ok(&mut client, "setExceptionBreakpoints", json!({ "filters": ["invalid"] }));
    start(&mut client);
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    let stop = client.event("stopped")["body"].clone();
    assert_eq!((&stop["reason"], &stop["threadId"]), (&json!("exception"), &json!(2)), "{stop}");
    // A core that has halted steps no more; the other one does.
    for (thread, reason) in [(2, "step"), (2, "pause"), (1, "step")] {
        ok(&mut client, "next", json!({ "threadId": thread }));
        let stop = client.event("stopped")["body"].clone();
        assert_eq!((&stop["reason"], &stop["threadId"]), (&json!(reason), &json!(thread)), "{stop}");
    }
    end(client);
}

/// Microsoft's test client, which VS Code's own debuggers are tested with.
#[test]
fn a_client_that_is_not_ours_works_with_it() {
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
