// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pins of a simulated board and their drivers, the board named in a wiring, and latency bounds of pins with pulse-density outputs.
#![cfg(unix)]

use crate::common::{Folder, RunOutput};
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

const WIRING: &str = r#"board = "ulx3s-85f"
clock = 50
period = 100
baud = 1_000_000
autostart = true

[peripheral.limit]
kind = "digital-in"
pins = { in = "gp0" }
ports = { level = "at_end" }

[peripheral.encoder]
kind = "quadrature"
pins = { a = "gp3", b = "gn3" }
start = 5
ports = { count = "n" }

[peripheral.motor]
kind = "pwm"
pins = { high = "gp2" }
half = 1250
ports = { duty = "duty" }
scale = { duty = 1024 }

[peripheral.lamp]
kind = "digital-out"
pins = { out = "gp1" }
ports = { level = "lit" }
"#;

/// Drives towards a limit switch and lights a lamp there; goes faster once the encoder has turned.
const PROGRAM: &str = "\
.schedule on
.input  at_end:int, n:int
.output duty, lit:int
.once
        duty, lit = 0, 0
        wait    period
.period
period: duty = at_end ? 0 : n > 10 ? 1 : 0.5
        lit = at_end
        wait    period
";

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("limit.toml", WIRING);
    folder.write("limit.s", PROGRAM);
    folder
}

const TARGET: &str = "--wiring limit.toml --program limit.s --machine t1";

/// Runs a simulation; Verilator needs more memory than the limit of other tests allows.
fn sim(folder: &Folder, more: &str, input: &str) -> RunOutput {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    let line = format!("board sim {TARGET} {more}");
    command.args(line.split_whitespace()).current_dir(folder.path());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // The process may end before it has read all input.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    RunOutput::from(child.wait_with_output().unwrap())
}

#[test]
fn the_wiring_names_the_board() {
    let folder = folder();
    let text = folder.line(&format!("board check {TARGET}")).ok();
    assert!(text.starts_with("ulx3s-85f, t1: 4 peripherals"), "{text}");
    assert_eq!(folder.line(&format!("board check --board ulx3s-85f {TARGET}")).ok(), text);
    folder.line(&format!("board build {TARGET} --sources -o out")).ok();
    let pins = folder.line("board pins --wiring limit.toml").ok();
    assert!(pins.contains("limit.in"), "{pins}");
    // If neither wiring nor arguments name a board, the message states what to write.
    folder.write("limit.toml", WIRING.split_once('\n').unwrap().1);
    for line in [
        &format!("board check {TARGET}"),
        "board pins --wiring limit.toml",
        "bound --pins --wiring limit.toml limit.s",
    ] {
        let done = folder.line(line);
        let says = "limit.toml does not name a board: give `--board NAME`, or begin it with a line `board = \"NAME\"`; \
            there are ulx3s-85f";
        assert!(done.status == Some(1) && done.stderr.contains(says), "{line}: {done:?}");
    }
    let done = folder.line("board check --program limit.s");
    assert!(done.status == Some(2) && done.stderr.contains("--board"), "{done:?}");
}

/// A limit switch, driven by a script file and by standard input; the host at the UART also sees it.
#[test]
fn a_script_drives_a_limit_switch() {
    let folder = folder();
    let script = "set limit=0   # not there yet\nwait 1ms\nshow\n\nset limit.in=1\nwait 50000\nshow\nquit\n";
    folder.write("script.txt", script);
    let shown = |done: RunOutput| {
        assert_eq!((done.status, done.stderr.as_str()), (Some(0), ""));
        let (_, shown) = done.stdout.split_once('\n').unwrap();
        shown.to_owned()
    };
    let text = shown(sim(&folder, "--script script.txt", ""));
    let (before, after) = text.split_once("2.000 ms\n").unwrap();
    assert!(before.starts_with("1.000 ms\n") && before.contains("  limit.in = 0\n"), "{text}");
    assert!(before.contains("  lamp.out = 0 (output)\n"), "{text}");
    assert!(after.contains("  limit.in = 1\n") && after.contains("  lamp.out = 1 (output)\n"), "{text}");
    // A level that is set from power-up on, and interactive commands.
    let done = sim(&folder, "--script - --set limit=1", "wait 1ms\nshow\nfly\n");
    assert!(done.stdout.ends_with("  lamp.out = 1 (output)\n"), "{done:?}");
    assert!(done.status == Some(1) && done.stderr.contains("standard input:3: no command `fly`"), "{done:?}");

    // Mistakes are reported before the circuit is compiled; those in standard input, with the line number.
    for (line, text, says) in [
        ("--set limt=1", "", "--set no input pin `limt`; did you mean `limit`?; there are "),
        ("--set limit", "", "--set `limit` is not `pin=level`"),
        ("--set limit=7", "", "--set `limit=7`: a pin's level is 0 or 1"),
        ("--set lamp.out=1", "", "`lamp.out` is an output pin, which the board drives"),
        ("--axis motor,encoder,1 --set encoder.a=1", "", "no input pin `encoder.a`"),
        (
            "--script bad.txt",
            "wait 1ms\nwait 3 parsecs\n",
            "bad.txt:2: `wait 3 parsecs`: `parsecs` is not one of the units",
        ),
        ("--script bad.txt", "jump\n", "bad.txt:1: no command `jump`; there are `set pin=level …`"),
        ("--script bad.txt", "set\n", "bad.txt:1: `set` needs `pin=level`"),
        ("--script bad.txt", "quit now\n", "bad.txt:1: `quit` takes no arguments, found `now`"),
    ] {
        folder.write("bad.txt", if text.is_empty() { "show\n" } else { text });
        let done = sim(&folder, line, "");
        assert!(done.status == Some(1) && done.stderr.contains(says), "{line}: {done:?}");
        assert!(!done.stderr.contains("compiling"), "{line}: {done:?}");
    }
    for line in
        ["--inputs in.csv --script s", "--outputs -", "--robot --set limit=1", "--inputs - --axis a,b,1"]
    {
        assert_eq!(sim(&folder, line, "").status, Some(2), "{line}");
    }
}

/// A plant at two pipes: converts the motor's pulses to encoder counts, and has a limit switch at the end of its travel.
#[test]
fn a_plant_closes_the_loop_at_the_pins() {
    let folder = folder();
    let mut command = Command::new("timeout");
    command.args(["300", env!("CARGO_BIN_EXE_takt"), "board", "sim", "--inputs", "-", "--outputs", "-"]);
    command.args(TARGET.split_whitespace()).current_dir(folder.path());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut rows = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut row = || rows.next().unwrap().unwrap();
    assert_eq!(row(), "motor.high,lamp.out");
    let mut stdin = child.stdin.take().unwrap();
    writeln!(stdin, "limit,encoder").unwrap();
    let (mut position, mut fastest, mut lit) = (5.0, 0.0_f64, 0.0);
    for _ in 0..60 {
        let limit = u8::from(position >= 20.0);
        writeln!(stdin, "{limit},{}", position as i32).unwrap();
        let values: Vec<f64> = row().split(',').map(|field| field.parse().unwrap()).collect();
        (fastest, lit) = (fastest.max(values[0]), values[1]);
        // The outputs are safe at first; later, one half means 0.
        position += (4.0 * (values[0] - 0.5)).max(0.0);
        if lit == 1.0 {
            break;
        }
    }
    drop(stdin);
    let done = RunOutput::from(child.wait_with_output().unwrap());
    assert_eq!(done.status, Some(0), "{done:?}");
    let mut said = done.stderr.lines();
    assert!(said.any(|line| line.starts_with("/dev/") && line.ends_with(" 1000000")), "the port: {done:?}");
    // Half a period at 0.5 of full duty gives 512 of 1250 cycles; beyond 10 counts, full duty gives 1024.
    assert!(lit == 1.0 && position >= 20.0, "it has come to its end: {position}");
    assert!((fastest - (1250.0 + 1024.0) / 2500.0).abs() < 1e-9, "{fastest}");

    // From a file: rows are answered up to the first malformed row.
    folder.write("in.csv", "limit\n1\n1\n1\n1\n1\n1\n1\n1\n2\n");
    let done = sim(&folder, "--inputs in.csv --outputs -", "");
    let says = "in.csv:10: column limit.in: a pin's level is 0 or 1, not 2";
    assert!(done.status == Some(1) && done.stderr.contains(says), "{done:?}");
    assert!(done.stdout.lines().count() == 9 && done.stdout.ends_with("0.5,1\n"), "{done:?}");
    for (text, says) in [
        ("limt\n1\n", "in.csv: a column `limt`; did you mean `limit`?; there can be "),
        ("limit;encoder\n1;2\n", "columns are separated by `,`"),
    ] {
        folder.write("in.csv", text);
        let done = sim(&folder, "--inputs in.csv", "");
        assert!(done.status == Some(1) && done.stderr.contains(says), "{text}: {done:?}");
        assert!(!done.stderr.contains("compiling"), "{text}: {done:?}");
    }
}

/// Causes of safe outputs, selected by the pins: `/` by 0, an access before the start of memory, one iteration too many.
const MISTAKES: &str = "\
.input  at_end:int, n:int
.output duty, lit:int
.reg    t, k:int
.data
table:  .float 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
        .space 100
.once
        duty, lit = 0, 0
        wait    period
.period
period: ld      t, table[n]
        fdiv    t, t, t
        sel     duty, at_end, t, zero
        mov     lit, at_end
        li      k, 20
        isub    k, n, k
        bnz     k, done
        li      k, 6000
        loop    k, done
        .loop_bound 6000
        nop
done:   wait    period
";

/// When outputs become safe, time and reason are reported at once, whatever the cause.
#[test]
fn reports_the_reason_for_safe_outputs_at_once() {
    let folder = folder();
    folder.write("limit.s", MISTAKES);
    folder.write(
        "limit.toml",
        WIRING.replace("autostart = true", "autostart = true\nhost = 12\n[signals]\nstop = \"gp4\""),
    );
    let row = |i: usize, case: usize| match (case, i >= 6) {
        (0, true) => "0,1,5",
        (1, true) => "1,0,5",
        (2, true) => "0,0,-3",
        (3, true) => "0,0,20",
        _ => "0,0,5",
    };
    for (case, says) in [
        "stop: the pin `stop` was 1, or open\n",
        "NaN output: `duty`\n",
        "fault: data address at bundle 3\n",
        "missed deadline: 1 of them; a period took ",
        "host silent: no request for as many periods as the wiring's `host` allows\n",
    ]
    .into_iter()
    .enumerate()
    {
        let rows: Vec<&str> =
            ["limit,stop,encoder"].into_iter().chain((0..20).map(|i| row(i, case))).collect();
        folder.write("in.csv", rows.join("\n") + "\n");
        let done = sim(&folder, "--inputs in.csv --outputs out.csv", "");
        assert_eq!(done.status, Some(0), "{done:?}");
        let told: Vec<&str> =
            done.stderr.split_inclusive('\n').filter(|line| line.contains("become safe")).collect();
        let [told] = told[..] else { panic!("{done:?}") };
        let (time, told) = told.split_once(" ms: the outputs become safe: ").unwrap();
        assert!(told.starts_with(says), "{told}");
        // A silent host is noticed after twelve periods of 0.1 ms. Other causes come after six, and are noticed in a further period; the
        // encoder takes the seventh to count to 20.
        let time: f64 = time.parse().unwrap();
        let from = [0.6, 0.6, 0.6, 0.7, 1.1][case];
        assert!((from..from + 0.25).contains(&time), "{case}: {time}");
        // The last line has the same reason, beside the host's silence, which comes later.
        let last =
            done.stderr.lines().find_map(|line| line.strip_prefix("at the end the outputs are safe: "));
        let reason = told.split(':').next().unwrap();
        assert!(last.is_some_and(|last| last.contains(reason)), "{done:?}");
    }
}

/// A pin with a pulse-density stream has no latency bound; the path to its modulator has one.
#[test]
fn a_density_has_no_bound_at_its_pin() {
    let folder = folder();
    let stream = "kind = \"sigma-delta\"\npins = { out = \"gp2\" }\nports = { value = \"duty\" }\nscale = { value = 64 }\n";
    let (rest, lamp) = WIRING.split_once("[peripheral.lamp]").unwrap();
    let (rest, _) = rest.split_once("[peripheral.motor]").unwrap();
    let lamp = format!("[peripheral.lamp]{lamp}");
    folder.write("both.toml", format!("{rest}[peripheral.analog]\n{stream}{lamp}"));
    folder.write("alone.toml", format!("{rest}[peripheral.analog]\n{stream}"));
    let bound = |wiring: &str, more: &str| {
        folder.line(&format!("bound --pins --wiring {wiring} limit.s --machine t1 {more}")).ok()
    };
    insta::assert_snapshot!(bound("both.toml", "") + &bound("alone.toml", ""));
    let json: serde_json::Value = serde_json::from_str(&bound("alone.toml", "--json")).unwrap();
    let way = &json["ways"][0];
    assert!(way["total"].is_null() && way["total_to_modulator"]["worst"].is_u64(), "{json}");
    assert_eq!(way["outputs"][0]["answer"], "density");
    // A path has a total if one of its pins responds with an edge.
    let json: serde_json::Value = serde_json::from_str(&bound("both.toml", "--json")).unwrap();
    let mut totals = 0;
    for way in json["ways"].as_array().unwrap() {
        let edge = way["outputs"].as_array().unwrap().iter().any(|output| output["answer"] == "edge");
        assert_eq!(way["total"]["worst"].is_u64(), edge, "{json}");
        totals += u32::from(edge);
    }
    assert_eq!(totals, 1, "{json}");
}

/// Options that do not belong together are reported before anything is compiled.
#[test]
fn an_fmu_of_a_circuit_takes_its_numbers_from_the_wiring() {
    let folder = folder();
    folder.write("none.so", "");
    let circuit = "fmu limit.s --machine t1 -o limit.fmu --circuit";
    for (options, status, says) in [
        ("", 2, "--wiring <TOML>"),
        (
            "--wiring limit.toml --period 1ms",
            2,
            "--period cannot be used with --circuit: a step is the wiring's `period`",
        ),
        (
            "--wiring limit.toml --clock 60",
            2,
            "--clock cannot be used with --circuit: the clock is the wiring's `clock`",
        ),
        (
            "--wiring limit.toml --library none.so",
            1,
            "--library none.so: no shared library for Linux or Windows",
        ),
        ("--wiring nowhere.toml", 1, "nowhere.toml"),
        ("--wiring limit.toml --board nowhere", 1, "there is no board `nowhere`"),
        ("--wiring limit.toml --param kp=1", 1, "kp"),
    ] {
        let done = folder.line(&format!("{circuit} {options}"));
        assert!(done.status == Some(status) && done.stderr.contains(says), "{options}: {done:?}");
        assert!(!done.stderr.contains("compiling"), "{options}: {done:?}");
    }
    for option in ["--wiring limit.toml", "--board ulx3s-85f"] {
        let done = folder.line(&format!("fmu limit.s --period 1ms -o limit.fmu {option}"));
        assert!(done.status == Some(2) && done.stderr.contains("--circuit"), "{option}: {done:?}");
    }
    folder.write("limit.s", PROGRAM.replace("n > 10", "m > 10").replace("n:int", "m:int"));
    let done = folder.line(&format!("{circuit} --wiring limit.toml"));
    assert!(done.status == Some(1) && done.stderr.contains("limit.toml:"), "{done:?}");
    assert!(!folder.list().contains(&"limit.fmu".to_owned()));
}
