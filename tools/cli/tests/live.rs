// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt live` on a simulated board: array elements by their names in the source, settings, the stream as it arrives, and the reason for
//! safe outputs.
#![cfg(unix)]

use crate::common::{Folder, SimulatedBoard};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// Arrays in data memory and in registers, and a table after a label.
const PROGRAM: &str = "\
.input  n:int, gain
.output duty, k:int
.array  M[2,3]
.array  v[3]:int = 7, 8, 9
.reg    P[2,2]
.state  count:int
.data
table:  .float 1, 2, 4, 8
.once
        duty, k = 0, 0
        count = 0
        P[1,1], P[1,2], P[2,1], P[2,2] = 0.5, 1.5, 2.5, 3.5
        M[1,1] = 1.5
        M[2,3] = -2
        wait    period
.period
period: count = count + 1
        v[2] = count
        duty = gain * P[1,1]
        k = n
        wait    period
";

const WIRING: &str = r#"board = "ulx3s-85f"
clock = 50
period = 100
baud = 10_000_000
autostart = true

[peripheral.encoder]
kind = "quadrature"
pins = { a = "gp0", b = "gn0" }
ports = { count = "n" }

[peripheral.motor]
kind = "pwm"
pins = { high = "gp2" }
half = 1250
ports = { duty = "duty" }
scale = { duty = 1024 }
"#;

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("arrays.s", PROGRAM);
    folder.write("wiring.toml", WIRING);
    folder
}

fn board(folder: &Folder) -> SimulatedBoard {
    let line = "board sim --wiring wiring.toml --program arrays.s --machine t1";
    SimulatedBoard::start(line, folder.path())
}

/// An array element, or a word after a label, has the same name in the source, on a board, in a run and in the debugger.
#[test]
fn values_have_the_names_of_the_source() {
    let folder = folder();
    let board = board(&folder);
    let live = format!("live {} --baud {} --program arrays.s --machine t1", board.port, board.baud);
    let live = |what: &str| folder.line(&format!("{live} {what}"));
    let read = |names: &str| live(&format!("read {names}")).ok();
    assert_eq!(
        read("M[2,3] table[3] P[2,1] v[3] M[1,1]"),
        "M[2,3] = -2\ntable[3] = 8\nP[2,1] = 2.5\nv[3] = 9\nM[1,1] = 1.5\n"
    );
    assert_eq!(read("M"), "M[1,1] = 1.5\nM[1,2] = 0\nM[1,3] = 0\nM[2,1] = 0\nM[2,2] = 0\nM[2,3] = -2\n");
    assert_eq!(read("P"), "P[1,1] = 0.5\nP[1,2] = 1.5\nP[2,1] = 2.5\nP[2,2] = 3.5\n");
    assert!(read("v").starts_with("v[1] = 7\nv[2] = "), "{}", read("v"));
    for (name, says) in [
        ("M[0,1]", "`M` has no element [0,1]; there are `M[1,1]` to `M[2,3]`"),
        ("M[5]", "`M` has no element [5]; there are `M[1,1]` to `M[2,3]`"),
        ("v[4]", "`v` has no element [4]; there are `v[1]` to `v[3]`"),
        ("P[3,1]", "the program has no port, register or data word `P[3,1]`"),
    ] {
        let done = live(&format!("read {name}"));
        assert!(
            done.status == Some(1) && done.stdout.is_empty() && done.stderr.contains(says),
            "{name}: {done:?}"
        );
    }
    // The same names in a run, whose count is that of its periods, and in the debugger.
    let run = folder
        .line("run arrays.s --machine t1 --periods 3 --memory M[2,3] --memory v --memory table[3]")
        .ok();
    for says in ["  M[2,3] = -2.0\n", "  v[2] = 3\n", "  v[3] = 9\n", "  table[3] = 8.0\n"] {
        assert!(run.contains(says), "{says}: {run}");
    }
    let debugged =
        folder.fed("debug arrays.s --machine t1", b"step 3\nprint M[2,3], v[3], table[3]\nquit\n").ok();
    for says in ["M[2,3] = 0.0", "v[3] = 9", "table[3] = 8.0"] {
        assert!(debugged.contains(says), "{says}: {debugged}");
    }

    // Settings: ports from the host, between two periods. Everything else is refused by name, before the port is opened.
    live("set gain=0.25").ok();
    assert!(
        (0..50).any(|_| read("duty") == "duty = 0.125\n"),
        "the next period computes with it: {}",
        read("duty gain")
    );
    for (setting, says) in [
        ("k=1", "`k` is an output port, which the program sets"),
        ("M[1,1]=1", "`M[1,1]` is not a port but internal to the core: only its program writes it"),
        ("count=1", "`count` is not a port but internal to the core: only its program writes it"),
        ("gain=fast", "`fast` is not a value of `gain`"),
        ("gain", "`gain` is not `name=value`"),
        ("n=1", "the board refuses to set `n`: a peripheral of its wiring drives it"),
    ] {
        let done = live(&format!("set {setting}"));
        assert!(done.status == Some(1) && done.stderr.contains(says), "{setting}: {done:?}");
    }
    let wired = folder.line(&format!(
        "live {} --baud {} --program arrays.s --wiring wiring.toml --machine t1 set n=1",
        board.port, board.baud
    ));
    assert!(wired.stderr.contains("`n` cannot be set: the wiring connects it to "), "{wired:?}");

    // The reason for safe outputs: from the board itself, and from the live report.
    assert!(
        live("status").ok().starts_with("the program runs; outputs drive\n  periods "),
        "{:?}",
        live("status")
    );
    live("stop").ok();
    let status = live("status").ok();
    assert!(
        status.starts_with("the program stopped; outputs are safe: it is stopped, and not started again\n"),
        "{status}"
    );
    let told = folder.read_text("told.txt");
    assert!(told.contains(" ms: the outputs become safe: it is stopped\n"), "{told}");
}

/// Lines of a stream are printed one by one: an output buffer would hold back about a thousand lines; fewer may follow the first one read.
#[test]
fn a_stream_is_printed_as_it_comes() {
    let folder = folder();
    let board = board(&folder);
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    let line = format!(
        "live {} --baud {} --program arrays.s --machine t1 stream M[2,3] M[1,1] --count 1000000",
        board.port, board.baud
    );
    command.args(line.split_whitespace()).current_dir(folder.path());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert_eq!(lines.next().unwrap().unwrap(), "period M[2,3] M[1,1]");
    let first = lines.next().unwrap().unwrap();
    let (period, values) = first.split_once(' ').unwrap();
    assert!(period.parse::<u32>().is_ok() && values == "-2 1.5", "{first}");
    drop(board);
    let rest = lines.map_while(Result::ok).count();
    assert_eq!(child.wait().unwrap().code(), Some(1), "the board has gone");
    assert!(rest < 600, "{rest} lines were kept back");
}

/// Program whose state rises by `gain` in each period, and that loads from beyond its memory once `bad` is set.
const RAMP: &str = "\
.input  gain, bad:int
.output duty, k:int
.array  M[2]
.reg    P[1,2]
.state  sum, count:int
.data
table:  .float 1, 2
.once
        sum, count = 0, 0
        duty, k = 0, 0
        M[1] = 0
        P[1,1], P[1,2] = 0, 0
        wait    period
.period
period: count = count + 1
        iand    k, count, 7
        sum = sum + gain
        P[1,2] = sum
        duty = P[1,2] * 0.5
        M[1] = sum
        ld      P[1,1], table[bad]
        wait    period
";

/// A recording as table, waveform and picture; triggers; mistakes before and after the port is opened.
#[test]
fn a_scope_records_around_a_trigger() {
    let folder = Folder::new();
    folder.write("ramp.s", RAMP);
    let head = "board = \"ulx3s-85f\"\nclock = 50\nperiod = 40\nbaud = 10_000_000\nautostart = true\n";
    folder.write("scoped.toml", format!("{head}[scope]\nchannels = 2\ndepth = 64\n"));
    let check = folder.line("board check --wiring scoped.toml --program ramp.s --machine t1").ok();
    assert!(check.contains("scope: 2 channels of 64 samples, in 1 block RAM\n"), "{check}");
    let line = "board sim --wiring scoped.toml --program ramp.s --machine t1";
    let board = SimulatedBoard::start(line, folder.path());
    let open = format!("live {} --baud {} --program ramp.s --machine t1", board.port, board.baud);
    let live = |what: &[&str]| {
        let arguments: Vec<&str> = open.split_whitespace().chain(what.iter().copied()).collect();
        folder.takt(&arguments)
    };
    live(&["set", "gain=0.5"]).ok();

    // From now on, to a table.
    let done = live(&["scope", "P[1,2]", "k", "--csv", "-", "--samples", "10"]);
    assert!(
        done.stderr.starts_with("10 samples of 2 channels, period ") && done.stderr.ends_with(": the host\n"),
        "{done:?}"
    );
    let table = done.stdout;
    let rows: Vec<Vec<f64>> = table
        .lines()
        .skip(1)
        .map(|row| row.split(',').map(|cell| cell.parse().expect("a number")).collect())
        .collect();
    assert!(table.starts_with("period,\"P[1,2]\",k\n") && rows.len() == 10, "{table}");
    for pair in rows.windows(2) {
        assert!(pair[1][0] == pair[0][0] + 1.0 && pair[1][1] == pair[0][1] + 0.5, "{table}");
        assert_eq!(pair[1][2], pair[1][0] % 8.0, "{table}");
    }

    // An edge, with samples before it, as waveform and as pictures.
    let edge =
        ["scope", "k", "duty", "-t", "k falls 1", "--samples", "20", "--before", "5", "--wait", "100s"];
    let files = ["--csv", "edge.csv", "--vcd", "edge.vcd", "--plot", "edge.svg"];
    let done = live(&[&edge[..], &files].concat()).ok();
    assert!(
        done.starts_with("20 samples of 2 channels, period ") && done.ends_with(": `k falls 1`\n"),
        "{done}"
    );
    let table = folder.read_text("edge.csv");
    let k: Vec<&str> = table.lines().skip(1).map(|row| row.split(',').nth(1).expect("a cell")).collect();
    assert_eq!(k[..9], ["3", "4", "5", "6", "7", "0", "1", "2", "3"], "{table}");
    let wave = folder.read_text("edge.vcd");
    assert!(wave.contains("#5\n1#\n") && wave.contains("#6\n0#\n"), "{wave}");
    let picture = folder.read_text("edge.svg");
    assert!(picture.contains(": `k falls 1`") && picture.contains("duty"), "{picture}");
    let drawn = live(&["scope", "k", "duty", "-t", "k falls 1", "--samples", "20"]).ok();
    assert!(
        drawn.contains("periods from the trigger") && drawn.contains("⠤") || drawn.contains("⣀"),
        "{drawn}"
    );

    // A level that does not come; it is read after the trigger by the host's other command.
    let never = live(&["scope", "duty", "-t", "duty < -1", "--wait", "200ms"]);
    assert!(
        never.status == Some(1) && never.stderr.contains("no trigger within 0.2 s (duty < -1)"),
        "{never:?}"
    );
    let unread = live(&["scope", "duty", "--read"]);
    assert!(unread.stderr.contains("the board's scope waits for its trigger"), "{unread:?}");

    // Mistakes before the port is opened, and such that only the board knows.
    for (arguments, says) in [
        (&["gian"][..], "no port, register or data word `gian`"),
        (&["M[1]"], "`M[1]` lies in data memory"),
        (&["k", "-t", "k > 1.5"], "`1.5` is not a level for a channel of type int"),
        (&["k", "-t", "sum > 1"], "the trigger compares `sum`, which is not a channel"),
        (&["k", "-t", "often"], "`often` is not a trigger"),
        (&["k", "duty", "sum"], "3 channels are asked for; the board's scope has 2"),
        (&["k", "--samples", "65"], "65 samples are asked for; the board's scope has 64"),
        (&["k", "--samples", "4", "--before", "4"], "4 samples before the trigger leave none for it"),
    ] {
        let done = live(&[&["scope"], arguments].concat());
        assert!(
            done.status == Some(1) && done.stderr.contains(says) && done.stdout.is_empty(),
            "{arguments:?}: {done:?}"
        );
    }

    // What leads to a fault, armed by one command and read by another.
    live(&["scope", "count", "sum", "-t", "fault", "--before", "9", "--arm"]).ok();
    let periods = || -> u32 {
        live(&["read", "count"])
            .ok()
            .trim()
            .rsplit(' ')
            .next()
            .and_then(|count| count.parse().ok())
            .expect("a count")
    };
    // A stop triggers whether or not the samples before it are there.
    let armed = periods();
    (0..1000).find(|_| periods() > armed + 9).expect("the program runs on");
    live(&["set", "bad=1000000"]).ok();
    let read = ["scope", "count", "sum", "-t", "fault", "--read", "--csv", "-"];
    let done = (0..100).map(|_| live(&read)).find(|done| done.status == Some(0)).expect("it stops");
    assert!(
        done.stderr.contains(": the program stopped; the last sample is what the program left"),
        "{done:?}"
    );
    let table = done.stdout;
    let rows: Vec<&str> = table.lines().skip(1).collect();
    let first = |row: &str| {
        row.split(',').take(2).map(|cell| cell.parse::<i64>().expect("whole")).collect::<Vec<_>>()
    };
    assert!(rows.len() == 10 && rows.iter().all(|row| first(row)[0] == first(row)[1]), "{table}");
    let stopped = live(&["scope", "count", "-t", "count > 0", "--wait", "30s"]);
    assert!(stopped.stderr.contains("the program stopped with a fault before count > 0"), "{stopped:?}");
    live(&["stop"]).ok();
    assert!(
        live(&["scope", "count"]).stderr.contains("the program is stopped, and has no periods to record")
    );
}

/// A board whose wiring has no scope says so.
#[test]
fn a_board_without_a_scope_says_so() {
    let folder = folder();
    let board = board(&folder);
    let line =
        format!("live {} --baud {} --program arrays.s --machine t1 scope count", board.port, board.baud);
    let done = folder.line(&line);
    assert!(
        done.status == Some(1)
            && done.stderr.contains("the board has no scope: a table `[scope]` in its wiring"),
        "{done:?}"
    );
}
