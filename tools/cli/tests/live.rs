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
