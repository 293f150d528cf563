//! `takt board`, `load` and `live` with a system of several cores: the example through a simulated board, and what is refused.
#![cfg(unix)]

mod common;

use common::{Folder, SimulatedBoard};

fn example(name: &str) -> String {
    format!("{}/../programs/examples/board/axis/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// The example's wiring and system, as arguments.
fn axis() -> String {
    format!("--board ulx3s-85f --wiring {} --program {}", example("wiring.toml"), example("axis.toml"))
}

#[test]
fn a_system_fits_its_board_and_a_circuit_is_written() {
    let folder = Folder::new();
    let text = folder.line(&format!("board check {}", axis())).ok();
    assert_eq!(
        text,
        "ulx3s-85f, profile t1, servo t1, watch t1: 3 peripherals, 3 of the system's ports on pins, a period of 5000 cycles at 50 MHz\n"
    );
    folder.line(&format!("board build {} --sources -o out", axis())).ok();
    assert!(folder.read_text("out/takt_system_board.v").contains("module takt_system_board"));
    assert!(folder.read_text("out/pins.lpf").contains("LOCATE COMP \"encoder_a\" SITE \"B11\";"));
    // Without a wiring, the host has all ends.
    let alone = format!("--board ulx3s-85f --program {}", example("axis.toml"));
    let text = folder.line(&format!("board check {alone}")).ok();
    assert!(
        text.contains("0 peripherals, 0 of the system's ports on pins, a period of 5000 cycles at 25 MHz"),
        "{text}"
    );
}

#[test]
fn wrong_systems_and_ports_are_refused() {
    let folder = Folder::new();
    let refused = |line: &str, says: &str| {
        let done = folder.line(line);
        assert!(done.status == Some(1) || done.status == Some(2), "{line}: {done:?}");
        assert!(done.stderr.contains(says) && done.stdout.is_empty(), "{line}: {}", done.stderr);
    };
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
    wired("[peripheral.lamp]", two, "input port `n` is driven twice: `encoder` drives it, too");

    // A port that several cores have; an offset that no board can keep; a system that no board can hold.
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
    refused(&format!("board check {} --machine t1", axis()), "--machine is for a program");
    refused(
        &format!("board sim {} --robot", axis()),
        "--robot is for a single program; this is a system of several cores",
    );

    // Before the line is opened.
    let live = |what: &str| format!("live /dev/nothing --program {} {what}", example("axis.toml"));
    refused(&live("set servo.wanted=1"), "`servo.wanted` comes from the link `reference`");
    refused(&live("set servo.duty=1"), "`servo.duty` is an output port, which the program sets");
    refused(&live("set limit=much"), "`much` is no value of `limit`");
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
    refused(&live("stream servo.duty watch.peak"), "one stream has 15 numbers that follow each other");
    refused("live /dev/nothing push moves target=1", "ports have names in the program: --program FILE");
    refused(
        &format!("bound {} --pins --wiring {}", example("axis.toml"), example("wiring.toml")),
        "--pins follows the way through a single program",
    );
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
    let rows: Vec<Vec<&str>> = stream.stdout.lines().map(|line| line.split(' ').collect()).collect();
    assert_eq!((stream.status, rows.len()), (Some(0), 3), "{stream:?}");
    assert!(rows.iter().all(|row| row.len() == 3 && row[0] == row[2]), "{stream:?}");
    // Held, a FIFO fills up; a base tick at a time the ramp goes on.
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

    // Beside the emulator, from the beginning.
    let same = live("shadow limit=0.5 --periods 12");
    assert_eq!(same, "12 base ticks, 2 inputs, 8 output ports: no difference; the board is held\n");

    // Other programs for the same circuit; a program, and a system with other links, are refused.
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
        refused.status == Some(1) && refused.stderr.contains("the board's circuit is that of another system"),
        "{refused:?}"
    );
    let refused = load(&format!("{} --machine t1", example("servo.s")));
    assert!(
        refused.status == Some(1) && refused.stderr.contains("the board carries a system of 3 cores"),
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
