// SPDX-License-Identifier: MIT OR Apache-2.0
//! Systems of several cores in the debug adapter: each core is a thread.

use super::{end, launched, ok, start};
use crate::common::Folder;
use crate::common::protocol::Client;
use serde_json::json;

/// Session on the repository's system of three cores.
fn system(folder: &Folder) -> Client {
    let systems = concat!(env!("CARGO_MANIFEST_DIR"), "/../../programs/systems");
    launched(
        folder,
        json!({ "program": "speed.toml", "inputs": format!("{systems}/speed.csv"), "cwd": systems }),
    )
}

/// Value of an expression in a core's frame.
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

    // Each core has its own source, in an arbitrary folder.
    let mut sources = Vec::new();
    for thread in 1..=3 {
        let frames = ok(&mut client, "stackTrace", json!({ "threadId": thread }));
        let path = frames["stackFrames"][0]["source"]["path"].as_str().unwrap().to_owned();
        assert!(std::path::Path::new(&path).is_file(), "{path}");
        sources.push(path);
    }
    assert!(sources[1].ends_with("pi.s") && sources[2].ends_with("watch.s"), "{sources:?}");

    // A breakpoint in any core's source stops all cores, and the stop names the core.
    let breakpoints =
        json!({ "source": { "path": sources[2] }, "breakpoints": [{ "line": 19 }, { "line": 1 }] });
    let answer = ok(&mut client, "setBreakpoints", breakpoints);
    assert_eq!(answer["breakpoints"][0]["verified"], true, "{answer}");
    assert_eq!(answer["breakpoints"][1]["verified"], false, "{answer}");
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    let stop = client.event("stopped")["body"].clone();
    assert_eq!((&stop["threadId"], &stop["allThreadsStopped"]), (&json!(3), &json!(true)), "{stop}");
    assert_eq!(stop["hitBreakpointIds"][0], answer["breakpoints"][0]["id"]);
    let frames = ok(&mut client, "stackTrace", json!({ "threadId": 3 }));
    assert_eq!(frames["stackFrames"][0]["line"], 19);
    // All cores are in the same cycle; each resolves its own names.
    let cycle = of_core(&mut client, 1, "cycle");
    assert_eq!(of_core(&mut client, 3, "cycle"), cycle);
    assert_eq!(of_core(&mut client, 3, "values"), "0");
    let none = client.command("evaluate", json!({ "expression": "values", "frameId": 0 }));
    assert_eq!(none["success"], false, "core `profile` has none: {none}");

    // A step of one core moves the others along; a step back returns.
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

    // Each core has separate variables: setting one does not affect other cores.
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
    assert_ne!(of_core(&mut client, 2, "u"), "1.25", "`u` of the watch is set, not that of the servo");

    // Bundle addresses of different cores are distinct.
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
    // A label that exists in every core stops the run in each of them.
    let mut met = std::collections::BTreeSet::new();
    for _ in 0..12 {
        ok(&mut client, "continue", json!({ "threadId": 1 }));
        let stop = client.event("stopped")["body"].clone();
        met.insert((stop["threadId"].as_u64().unwrap(), stop["text"].as_str().unwrap().to_owned()));
    }
    let said = |thread: u64, text: &str| met.contains(&(thread, text.to_owned()));
    assert!(said(1, "period") && said(3, "period") && said(2, "servo.period"), "{met:?}");
    assert!(met.iter().any(|(_, text)| text == "link moves pushed"), "{met:?}");

    // Data breakpoints on a link and on a value of a core behave alike.
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

    // Periods are those of the request's thread.
    ok(&mut client, "takt/gotoPeriod", json!({ "period": 2, "threadId": 3 }));
    assert_eq!(client.event("stopped")["body"]["reason"], "goto");
    assert_eq!(of_core(&mut client, 3, "period"), "2");
    assert!(of_core(&mut client, 1, "period").parse::<u64>().unwrap() > 2);

    // Read-only console commands: on the system, and on the frame's core.
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
        assert!(!done && text.contains("which only inspects"), "{line}: {text}");
    }
    let help = say(&mut client, "help").1;
    assert!(help.contains("links") && !help.contains("reverse"), "{help}");
    // The recorded inputs end.
    ok(&mut client, "setDataBreakpoints", json!({ "breakpoints": [] }));
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    assert_eq!(client.event("stopped")["body"]["text"], "the recorded inputs end here");
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    client.event("terminated");
    end(client);
}

/// Exceptions of a core stop the system where they occur, even if the flag is cleared in the same cycle.
#[test]
fn exceptions_of_a_core_stop_a_system() {
    let folder = Folder::new();
    folder.write("idle.s", ".reg n:int\n li n, 0\nagain: iadd n, n, 1\n jmp again\n");
    folder.write(
        "nan.s",
        ".reg n:int _t\n li n, 300\nturn: isub n, n, 1\n bnz n, turn\n fsqrt _t, -4.0\n clrflags\n halt\n",
    );
    folder.write("two.toml", "tick = 100\n[[core]]\nname = \"a\"\nprogram = \"idle.s\"\n[[core]]\nname = \"b\"\nprogram = \"nan.s\"\n");
    let mut client = launched(&folder, json!({ "program": "two.toml" }));
    ok(&mut client, "setExceptionBreakpoints", json!({ "filters": ["invalid"] }));
    start(&mut client);
    ok(&mut client, "continue", json!({ "threadId": 1 }));
    let stop = client.event("stopped")["body"].clone();
    assert_eq!((&stop["reason"], &stop["threadId"]), (&json!("exception"), &json!(2)), "{stop}");
    // A halted core does not step; the other one does.
    for (thread, reason) in [(2, "step"), (2, "pause"), (1, "step")] {
        ok(&mut client, "next", json!({ "threadId": thread }));
        let stop = client.event("stopped")["body"].clone();
        assert_eq!((&stop["reason"], &stop["threadId"]), (&json!(reason), &json!(thread)), "{stop}");
    }
    end(client);
}
