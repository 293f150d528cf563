// SPDX-License-Identifier: MIT OR Apache-2.0
//! The commands `takt board`, `load` and `live` on a system of several cores: the example through a simulated board, and refusals.
#![cfg(unix)]

use crate::common::{Folder, SimulatedBoard};

fn example(name: &str) -> String {
    format!("{}/../../programs/examples/board/axis/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Wiring and system of the example, as command-line arguments.
fn axis() -> String {
    format!("--board ulx3s-85f --wiring {} --program {}", example("wiring.toml"), example("axis.toml"))
}

#[test]
fn a_system_fits_its_board_and_a_circuit_is_written() {
    let folder = Folder::new();
    let text = folder.line(&format!("board check {}", axis())).ok();
    assert!(
        text.starts_with(
            "ulx3s-85f, profile t1, servo t1, watch t1: 3 peripherals, 3 of the system's ports on pins, \
             a period of 5000 cycles at 50 MHz\nthe cores take about "
        ) && text.ends_with(
            " of 83640 LUT4, 63 of 208 block RAMs, 18 of 156 multipliers of the LFE5U-85F (estimated); \
             `takt board build` counts all cells\n"
        ),
        "{text}"
    );
    // The estimate of LUTs follows the fit, which each new synthesis moves: three cores t1 are 15,000 to 20,000.
    let luts = text.split("take about ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    assert!((15_000..20_000).contains(&luts.parse::<u32>().unwrap()), "{text}");
    folder.line(&format!("board build {} --sources -o out", axis())).ok();
    assert!(folder.read_text("out/takt_system_board.v").contains("module takt_system_board"));
    assert!(folder.read_text("out/pins.lpf").contains("LOCATE COMP \"encoder_a\" SITE \"B11\";"));
    // Without a wiring, all outer ends of links are at the host.
    let alone = format!("--board ulx3s-85f --program {}", example("axis.toml"));
    let text = folder.line(&format!("board check {alone}")).ok();
    assert!(
        text.contains("0 peripherals, 0 of the system's ports on pins, a period of 5000 cycles at 25 MHz"),
        "{text}"
    );
}

/// Runs a command that fails with these words, and prints nothing else.
fn refused_in(folder: &Folder, line: &str, says: &str) {
    let done = folder.line(line);
    assert!(done.status == Some(1) || done.status == Some(2), "{line}: {done:?}");
    assert!(done.stderr.contains(says) && done.stdout.is_empty(), "{line}: {}", done.stderr);
}

#[test]
fn wrong_systems_and_ports_are_refused() {
    let folder = Folder::new();
    let refused = |line: &str, says: &str| refused_in(&folder, line, says);
    let wiring = std::fs::read_to_string(example("wiring.toml")).unwrap();
    let wired = |from: &str, to: &str, says: &str| {
        assert!(wiring.contains(from));
        folder.write("wiring.toml", wiring.replace(from, to));
        refused(
            &format!("board check --board ulx3s-85f --wiring wiring.toml --program {}", example("axis.toml")),
            says,
        );
    };
    wired(
        "servo.n",
        "axis.n",
        "wiring.toml:17:19: the system has no core `axis`; there are profile, servo, watch",
    );
    wired("servo.n", "servo.m", "core `servo` has no input port `m`; there are wanted, n");
    wired(
        "servo.n",
        "servo.wanted",
        "`servo.wanted` comes from the link `reference`; a register can be a port that the host drives",
    );
    wired(
        "\"servo.duty\"",
        "\"profile.wanted\"",
        "`profile.wanted` is on no wire or snapshot to the host: `[[wire]]` with",
    );
    wired("\"servo.duty\"", "\"error\"", "`servo.error` is on no wire or snapshot to the host");
    wired("servo.n", "moves.target", "`moves` is a FIFO, whose entries the host takes and gives");
    wired(
        "servo.n",
        "nothing",
        "no core of the system has an input port `nothing`, and the host's ends of links are n, limit",
    );
    wired(
        "servo.n",
        "watch.limit",
        "input port `watch.limit` is a float; a register is an integer: declare it `limit:int`",
    );
    wired(
        "period = 100 ",
        "period = 200 ",
        "wiring.toml:5:1: the system's `tick` is 5000 cycles, which at 50 MHz are 100 µs; `period` is 10000 cycles",
    );
    let two = "[peripheral.other]\nkind = \"step\"\npins = { step = \"gp4\", direction = \"gn4\" }\nports = { count = \"n\" }\n[peripheral.lamp]";
    wired("[peripheral.lamp]", two, "input port `n` is driven twice: `encoder` drives it too");

    // Errors: one port of several cores; an offset that no board can keep; a system that is too large for any board.
    let system = std::fs::read_to_string(example("axis.toml")).unwrap();
    for name in ["profile.s", "servo.s", "watch.s"] {
        folder.write(name, std::fs::read_to_string(example(name)).unwrap());
    }
    folder.write("wiring.toml", wiring.replace("servo.n", "error"));
    folder.write("axis.toml", system.replace("[[core]]\nname = \"watch\"", "[[core]]\nname = \"spare\"\nprogram = \"servo.s\"\n[[wire]]\nfrom = \"host.n\"\nto = \"spare.n\"\n[[wire]]\nfrom = \"profile.wanted\"\nto = \"spare.wanted\"\n[[core]]\nname = \"watch\""));
    folder.write("wiring.toml", wiring.replace("servo.duty", "duty").replace("servo.n", "wanted"));
    refused(
        "board check --board ulx3s-85f --wiring wiring.toml --program axis.toml",
        "`wanted` is a port of several cores: `servo.wanted` or `spare.wanted`",
    );
    folder.write("wiring.toml", wiring.clone());
    folder.write("axis.toml", system.replace("offset = 300 ", "offset = 4990 "));
    refused(
        "board check --board ulx3s-85f --wiring wiring.toml --program axis.toml",
        "core `servo` has the offset 4990; on a board its tick must be given before its next base tick",
    );
    let many: String = (0..3).map(|n| format!("[[core]]\nname = \"c{n}\"\nprogram = \"servo.s\"\n[[wire]]\nfrom = \"host.n\"\nto = \"c{n}.n\"\n[[wire]]\nfrom = \"profile.wanted\"\nto = \"c{n}.wanted\"\n")).collect();
    folder.write("axis.toml", format!("{system}{many}"));
    refused(
        "board build --board ulx3s-85f --wiring wiring.toml --program axis.toml --sources -o out",
        "the system needs 252 block RAMs at least, 9 of them for the image of ",
    );
    refused(&format!("board check {} --machine t1", axis()), "--machine cannot be used with a system");
    refused(&format!("board sim {} --robot", axis()), "`takt track --system` drives it with one");

    // Detected before the serial port is opened.
    let live = |what: &str| format!("live /dev/nothing --program {} {what}", example("axis.toml"));
    refused(&live("set servo.wanted=1"), "`servo.wanted` comes from the link `reference`");
    refused(&live("set servo.duty=1"), "`servo.duty` is an output port, which the program sets");
    refused(&live("set limit=much"), "`much` is not a value of `limit`");
    refused(&live("push limits x=1"), "the system has no FIFO `limits` from the host; there are moves");
    refused(&live("push reached there=1"), "`reached` is a FIFO to the host, whose entries `pop` takes out");
    refused(
        &live("push moves target=1"),
        "an entry of `moves` has the fields target, rate: `field=value` for each",
    );
    refused(
        &live("push moves target=1 speed=2"),
        "entries of `moves` have no field `speed`; there are target, rate",
    );
    refused(&live("pop moves"), "`moves` is a FIFO from the host, into which `push` puts entries");
    refused(&live("stream servo.duty watch.peak"), "a stream can have up to 15 consecutive numbers");
    refused(
        "live /dev/nothing push moves target=1",
        "ports are named by the program: give it with --program FILE",
    );
}

/// Copies the example's files, with some texts replaced.
fn copied(folder: &Folder, changes: &[(&str, &str, &str)]) {
    for name in ["axis.toml", "wiring.toml", "profile.s", "servo.s", "watch.s"] {
        let mut text = std::fs::read_to_string(example(name)).unwrap();
        for (_, from, to) in changes.iter().filter(|(at, ..)| *at == name) {
            assert!(text.contains(from), "{name}: {from}");
            text = text.replace(from, to);
        }
        folder.write(name, text);
    }
}

#[test]
fn paths_from_pin_to_pin_over_cores_have_bounds() {
    let folder = Folder::new();
    let bound = "bound axis.toml --pins --wiring wiring.toml";
    copied(&folder, &[]);
    insta::assert_snapshot!("pins", folder.line(bound).ok());
    let json: serde_json::Value =
        serde_json::from_str(&folder.line(&format!("{bound} --json")).ok()).unwrap();
    let way = &json["ways"][1];
    assert_eq!(way["cores"], serde_json::json!(["servo", "watch"]));
    assert_eq!(way["links"][1], "servo.error -> watch.error");
    let parts = [&way["inputs"][0]["parts"], &way["between"], &way["outputs"][0]["parts"]];
    for edge in ["best", "worst"] {
        let parts = parts.iter().flat_map(|parts| parts.as_array().unwrap());
        assert_eq!(way["total"][edge], parts.map(|part| part[edge].as_u64().unwrap()).sum::<u64>());
    }

    // Encoders that differ only in their wires share a row; a converter that starts with the
    // outputs has no sample before the tick; a queue has no bounded time.
    let more = "[peripheral.second]\nkind = \"quadrature\"\npins = { a = \"gp4\", b = \"gn4\" }\nports = { count = \"servo.n2\" }\n\
                [peripheral.converter]\nkind = \"spi\"\npins = { clock = \"gp5\", select = \"gn5\", in = \"gp6\" }\n\
                starts = \"publish\"\nports = { received = \"servo.n3\" }\n[peripheral.lamp]";
    let links = "[[wire]]\nfrom = \"host.n2\"\nto = \"servo.n2\"\n[[wire]]\nfrom = \"host.n3\"\nto = \"servo.n3\"\n\
                 [[fifo]]\nname = \"errors\"\nfrom = \"servo\"\nto = \"watch\"\nports = [\"error -> late\"]\npush = \"error\"\n\
                 pop = \"next\"\ndepth = 2\n[[wire]]\nfrom = \"host.limit\"";
    let several = [
        ("wiring.toml", "[peripheral.lamp]", more),
        ("axis.toml", "[[wire]]\nfrom = \"host.limit\"", links),
        ("servo.s", ".input  n:int ", ".input  n2:int, n3:int\n.input  n:int "),
        ("servo.s", "wanted - itof(n)\n", "wanted - itof(n) - itof(n2) - itof(n3)\n"),
        ("watch.s", ".output peak ", ".input  late\n.output next\n.output peak "),
        ("watch.s", "        fabs    a, error\n", "        fadd    a, error, late\n        fabs    a, a\n"),
    ];
    copied(&folder, &several);
    let text = folder.line(&format!("{bound} -W allow=unused")).ok();
    for says in [
        "over host.n -> servo.n, host.n2 -> servo.n2; servo.duty -> host.duty\nencoder (servo.n), second (servo.n2)\n",
        "no edge to count from or to: converter\n",
        "left out, because the latency depends on what is queued: paths over errors\n",
    ] {
        assert!(text.contains(says), "{says}: {text}");
    }

    // A deadline that can be missed does not contribute to a bound.
    let slow = "        .loop_bound 2000\nagain:  isub    k, k, 1\n        bnz     k, again\n        fabs    a, error\n";
    copied(
        &folder,
        &[
            ("watch.s", ".reg    a\n", ".reg    a k:int\n        mov     k, 2000\n"),
            ("watch.s", "        fabs    a, error\n", slow),
        ],
    );
    let text = folder.line(bound).ok();
    assert!(text.contains("\na deadline can be missed: core watch: a period can take "), "{text}");

    let refused = |changes: &[(&str, &str, &str)], more: &str, says: &str| {
        copied(&folder, changes);
        let done = folder.line(&format!("{bound}{more}"));
        assert!(done.status == Some(1) && done.stdout.is_empty(), "{done:?}");
        assert!(done.stderr.contains(says), "{says}: {}", done.stderr);
    };
    refused(&[], " --deadline 100us", "--deadline is not for --pins");
    refused(&[("wiring.toml", "servo.n", "axle.n")], "", "wiring.toml:17:19: the system has no core `axle`");
    refused(&[("wiring.toml", "period = 100 ", "period = 50 ")], "", "the system's `tick` is 5000 cycles");
    // An encoder at a core that has no path to a pin; a lamp after a queue.
    let wiring = std::fs::read_to_string(example("wiring.toml")).unwrap();
    let [motor, lamp] = ["[peripheral.motor]", "[peripheral.lamp]"].map(|table| wiring.find(table).unwrap());
    let apart = [
        ("wiring.toml", "servo.n", "watch.count"),
        ("wiring.toml", &wiring[lamp..], ""),
        ("watch.s", ".output peak ", ".input  count:int\n.output peak "),
        (
            "axis.toml",
            "[[wire]]\nfrom = \"host.limit\"",
            "[[wire]]\nfrom = \"host.count\"\nto = \"watch.count\"\n[[wire]]\nfrom = \"host.limit\"",
        ),
    ];
    refused(
        &apart,
        " -W allow=unused",
        "wiring.toml: no path from pin to pin: the links of axis.toml lead from no input",
    );
    let queued = [
        ("wiring.toml", &wiring[motor..lamp], ""),
        ("watch.s", ".output peak ", ".output next\n.output peak "),
        (
            "axis.toml",
            "[[wire]]\nfrom = \"servo.error\"\nto = \"watch.error\"",
            "[[fifo]]\nname = \"errors\"\nfrom = \"servo\"\nto = \"watch\"\nports = [\"error\"]\npush = \"error\"\npop = \"next\"\ndepth = 2",
        ),
    ];
    refused(&queued, " -W allow=unused", "no bound from pin to pin: every path goes over a FIFO (errors)");
    let usage = folder.line("bound axis.toml --pins");
    assert!(usage.status == Some(2) && usage.stderr.contains("--wiring <TOML>"), "{usage:?}");
}

#[test]
fn a_simulated_board_carries_a_system() {
    let folder = Folder::new();
    let board =
        SimulatedBoard::start(&format!("board sim {} --axis motor,encoder,20000", axis()), folder.path());
    let (port, baud) = (&board.port, &board.baud);
    let system = example("axis.toml");
    let command = |what: &str| folder.line(&format!("live {port} --baud {baud} --program {system} {what}"));
    let live = |what: &str| command(what).ok();
    live("set limit=100");
    live("push moves target=30 rate=10");
    let count = || -> i32 { live("read servo.n").trim().trim_start_matches("servo.n = ").parse().unwrap() };
    assert!((0..200).any(|_| (count() - 30).abs() <= 2), "{}", live("read"));
    assert_eq!(
        live("read profile.wanted watch.limit limit"),
        "profile.wanted = 30\nwatch.limit = 100\nlimit = 100\n"
    );
    assert_eq!(
        (live("pop reached"), live("pop reached")),
        ("there = 30\n".to_owned(), "(nothing)\n".to_owned())
    );
    let status = live("status");
    let says = [
        "the system runs; outputs drive\n",
        "  profile: periods ",
        "  watch: periods ",
        "  moves: 0 of 4 entries\n",
    ];
    assert!(says.iter().all(|says| status.contains(says)), "{status}");
    let nameless = folder.line(&format!("live {port} --baud {baud} status")).ok();
    assert!(nameless.contains("  core 2: periods "), "{nameless}");
    // Several ports of a core in one frame.
    let stream = command("stream watch.peak watch.values --every 5 --count 3");
    let rows: Vec<Vec<&str>> = stream.stdout.lines().skip(1).map(|line| line.split(' ').collect()).collect();
    assert_eq!((stream.status, rows.len()), (Some(0), 3), "{stream:?}");
    assert!(rows.iter().all(|row| row.len() == 3 && row[0] == row[2]), "{stream:?}");
    // While the system is held, a FIFO fills up; single base ticks continue the ramp.
    live("hold");
    for _ in 0..4 {
        live("push moves target=40 rate=2");
    }
    let full = command("push moves target=40 rate=2");
    assert!(
        full.status == Some(1) && full.stderr.contains("`moves` is full: it holds 4 entries"),
        "{full:?}"
    );
    live("step");
    live("step");
    assert_eq!(live("read profile.wanted"), "profile.wanted = 34\n");
    assert!(live("status").contains("the system held; outputs drive"), "{}", live("status"));
    live("go");

    // In step with the emulator from the start.
    let same = live("shadow limit=0.5 --periods 12");
    assert_eq!(same, "12 base ticks, 2 inputs, 8 output ports: no difference; the board is held\n");

    // The circuit accepts other programs, but refuses a single program and a system with other links.
    let sources = ["profile.s", "servo.s", "watch.s"]
        .map(|name| (name, std::fs::read_to_string(example(name)).unwrap()));
    for (name, text) in &sources {
        folder.write(name, text.replace("iadd    values, values, 1", "iadd    values, values, 2"));
    }
    let text = std::fs::read_to_string(&system).unwrap();
    folder.write("other.toml", &text);
    folder.write("deeper.toml", text.replace("depth = 4", "depth = 8"));
    let load = |what: &str| folder.line(&format!("load {port} --baud {baud} {what}"));
    let refused = load("deeper.toml");
    assert!(
        refused.status == Some(1)
            && refused.stderr.contains("the board's circuit is that of another program or system"),
        "{refused:?}"
    );
    let refused = load(&format!("{} --machine t1", example("servo.s")));
    assert!(
        refused.status == Some(1)
            && refused.stderr.contains("number of cores: 3 on the board, 1 in the program or system"),
        "{refused:?}"
    );
    let loaded = load("other.toml --stopped").ok();
    assert!(loaded.contains("records loaded and compared; stopped"), "{loaded}");
    let different = command("shadow limit=2 --periods 4").stderr;
    let says = "base tick 1: output port `watch.values` is 2 on the board, 1 in the emulator; inputs: n = ";
    assert!(different.contains(says), "{different}");
    live("stop");
    let stopped = command("push moves target=1 rate=1");
    assert!(stopped.status == Some(1) && stopped.stderr.contains("the system is stopped"), "{stopped:?}");
    live("start");
    live("push moves target=3 rate=1");
    assert!((0..100).any(|_| live("pop reached") == "there = 3\n"), "{}", live("status"));
}
