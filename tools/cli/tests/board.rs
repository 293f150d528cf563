// SPDX-License-Identifier: MIT OR Apache-2.0
//! The commands `takt board`, `load` and `live`: output, refusals, and the control loop through a simulated board's pins.
#![cfg(unix)]

use crate::common::{Folder, RunOutput, SimulatedBoard};
use std::io::Write;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::protocol::{ANSWER, CORE_REGISTERS, IMAGE, Line, Receiver, checksum};
use takt_board::serial::Serial;
use takt_board::terminal::Terminal;
use takt_isa::T1;

fn example(name: &str) -> String {
    format!("{}/../../programs/examples/board/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Wiring and program of the example, as command-line arguments.
fn position() -> String {
    format!("--wiring {} --program {} --machine t1", example("position.toml"), example("position.s"))
}

#[test]
fn boards_and_their_pins_are_listed() {
    let folder = Folder::new();
    let list = folder.line("board list").ok();
    assert!(list.contains("ulx3s-85f") && list.contains("colorlight-i5"), "{list}");
    assert!(list.lines().all(|line| line.chars().count() <= 80), "a terminal would break a line: {list}");
    let wiring = format!("--wiring {}", example("position.toml"));
    let pins = folder.line(&format!("board pins ulx3s-85f {wiring}")).ok();
    assert!(pins.contains("gp0      B11   encoder.a\n") && pins.contains("gp10"), "{pins}");
    let pins = folder.line(&format!("board pins ulx3s-85f --json {wiring}")).ok();
    assert!(serde_json::from_str::<serde_json::Value>(&pins).is_ok_and(|pins| pins.is_array()), "{pins}");
}

#[test]
fn the_example_fits_its_board_and_a_circuit_is_written() {
    let folder = Folder::new();
    let text = folder.line(&format!("board check --board ulx3s-85f {}", position())).ok();
    assert_eq!(
        text,
        "ulx3s-85f, t1: 2 peripherals, 2 of the program's ports on pins, a period of 5000 cycles at 50 MHz\n\
         the core takes about 5700 of 83640 LUT4, 21 of 208 block RAMs, 6 of 156 multipliers of the LFE5U-85F (estimated); `takt board \
         build` counts all cells\n"
    );
    let wiring = std::fs::read_to_string(example("position.toml")).unwrap();
    folder.write("two.toml", format!("{wiring}\n[second_core]\ndelay = 2\n"));
    let program = example("position.s");
    let two = folder
        .line(&format!("board check --board ulx3s-85f --wiring two.toml --program {program} -m t1"))
        .ok();
    assert!(two.contains("the core and its second one take about 11"), "{two}");
    assert!(two.contains(" 42 of 208 block RAMs, 12 of 156 multipliers"), "{two}");
    folder.write("ecc.toml", format!("ecc = true\n{wiring}"));
    let ecc = folder
        .line(&format!("board check --board ulx3s-85f --wiring ecc.toml --program {program} -m t1"))
        .ok();
    assert!(
        ecc.contains("the core takes about 6") && ecc.contains(" 23 of 208 block RAMs, 6 of 156"),
        "{ecc}"
    );
    folder.line(&format!("board build --board ulx3s-85f {} --sources -o out", position())).ok();
    let pins = folder.read_text("out/pins.lpf");
    assert!(pins.contains("LOCATE COMP \"encoder_a\" SITE \"B11\";"), "{pins}");
}

/// A servo by step and direction follows its steps on a board without a host, of which the command expects no answer.
#[test]
fn a_board_without_a_host_follows_steps() {
    let folder = Folder::new();
    let (wiring, servo) = (example("step/icebreaker.toml"), example("step/servo.s"));
    let steps =
        "set wanted.direction=1 wanted.step=1\nwait 0.05ms\nset wanted.step=0\nwait 0.05ms\n".repeat(120);
    folder.write("steps", format!("wait 1ms\n{steps}wait 40ms\nquit\n"));
    let sim = format!("board sim --wiring {wiring} --program {servo}");
    let run = folder.line(&format!("{sim} --axis motor,encoder,20000 --script steps"));
    assert!(run.status == Some(0) && run.stderr.contains("the board has no UART"), "{run:?}");
    let said = run.stdout;
    let counts = said.trim().strip_prefix("motor: ").and_then(|said| said.strip_suffix(" counts"));
    let counts: i32 = counts.and_then(|counts| counts.parse().ok()).unwrap_or_else(|| panic!("{said}"));
    assert!((115..=125).contains(&counts), "{counts}");
    for (line, says) in [
        (format!("{sim} --noise 3"), "--noise is for a board with a UART"),
        (format!("fmu {servo} --circuit --wiring {wiring} -o board.fmu"), "`uart = false`"),
    ] {
        let refused = folder.line(&line);
        assert!(refused.status == Some(1) && refused.stderr.contains(says), "{refused:?}");
    }
}

/// A program that always misses its tick is an error that states the figures; `takt-board` tests other checks of numbers.
#[test]
fn a_program_that_is_always_late_is_refused() {
    let folder = Folder::new();
    let wiring = std::fs::read_to_string(example("position.toml")).unwrap();
    folder.write("w.toml", wiring.replace("period = 100 ", "period = 2 "));
    folder.write(
        "late.s",
        ".input n:int, wanted:int\n.output duty, error:int\n.reg x\n.period\np: itof x, n\n .for i, 1, 200\n fadd x, x, x\n \
         .endfor\n mov duty, x\n isub error, wanted, n\n wait p\n",
    );
    let line = "--wiring w.toml --program late.s --machine t1";
    for command in ["check", "build --sources -o out"] {
        let done = folder.line(&format!("board {command} {line}"));
        assert_eq!((done.status, done.stdout.as_str()), (Some(1), ""), "{done:?}");
        assert!(
            done.stderr.contains("w.toml:")
                && done.stderr.contains(
                    "every tick is missed, and the outputs stay safe: a period of the program takes "
                ),
            "{done:?}"
        );
        assert!(done.stderr.contains("a tick comes every 100 cycles: `period = "), "{done:?}");
    }
}

#[test]
fn a_program_alone_is_a_circuit_too() {
    let folder = Folder::new();
    let program = format!("--program {} --machine t1", example("position.s"));
    folder.line(&format!("board build --board colorlight-i5 {program} --sources -o out")).ok();
    // Verilator parses everything except the device's own cells.
    let lint = "find . -name '*.v' -exec verilator --lint-only -Wno-fatal -Wno-lint -Wno-style --top-module takt_board {} +";
    let out = folder.path().join("out");
    let done = std::process::Command::new("/bin/sh").args(["-c", lint]).current_dir(out).output().unwrap();
    let text = String::from_utf8_lossy(&done.stderr);
    let family = takt_family::REFERENCE;
    let pll = family.pll.map(|pll| pll.stand_in.0.trim_end_matches(".v"));
    let cells =
        [family.cells.multipliers, family.cells.block_rams].into_iter().flatten().map(|(cell, _)| *cell);
    let cells: Vec<String> = cells.chain(pll).map(|cell| format!("module: '{cell}'")).collect();
    let known = |line: &str| {
        cells.iter().any(|cell| line.contains(cell))
            || line.contains("there's no search path specified")
            || line.contains("Exiting due to")
    };
    let errors: Vec<&str> = text.lines().filter(|line| line.starts_with("%Error") && !known(line)).collect();
    assert!(errors.is_empty(), "{text}");
}

#[test]
fn projects_for_makers_tools_are_written() {
    let folder = Folder::new();
    let program = format!("--program {} --machine t1", example("position.s"));
    let text = folder.line(&format!("board build --board de10-nano {program} --flow quartus -o de10")).ok();
    assert!(
        text.contains("for Intel Quartus Prime: README.md there; nobody has run such a project yet"),
        "{text}"
    );
    assert!(text.contains("  quartus_sh --flow compile takt\n"), "{text}");
    let settings = folder.read_text("de10/takt.qsf");
    assert!(settings.contains("set_global_assignment -name DEVICE 5CSEBA6U23I7\n"), "{settings}");
    let axi = format!("board build --board zybo-z7-10 {program} --flow vivado --axi --clock 62.5 -o zynq");
    folder.line(&axi).ok();
    let script = folder.read_text("zynq/project.tcl");
    assert!(script.contains("CONFIG.PCW_FPGA0_PERIPHERAL_FREQMHZ 62.5 "), "{script}");
    assert!(folder.read_text("zynq/takt_uio.c").contains("{ \"wanted\", 0x1001u, INT, 1 }"));
    for (line, status, says) in [
        ("--board arty-a7-35 --flow quartus", 1, "has the flow `vivado` (AMD Vivado), not `quartus`"),
        ("--board ulx3s-85f --flow vivado", 1, "Takt writes no project for"),
        ("--board arty-a7-35 --flow vivado --axi", 1, "has no processor whose bus the core could be on"),
        (
            "--board zybo-z7-10 --flow vivado --axi --clock 500",
            1,
            "--clock: expected 10 to 250 MHz, found 500",
        ),
        ("--board de10-nano --flow ise", 2, "[possible values: quartus, vivado]"),
        ("--board de10-nano --axi", 2, "--flow <FLOW>"),
        ("--board de10-nano", 1, "write a project for Intel Quartus Prime with `--flow quartus`"),
    ] {
        let done = folder.line(&format!("board build {line} {program} -o none"));
        assert_eq!(done.status, Some(status), "{line}: {done:?}");
        assert!(
            done.stderr.contains(says) && !folder.path().join("none").exists(),
            "{line}: {}",
            done.stderr
        );
    }
}

#[test]
fn wrong_boards_wirings_and_ports_are_refused() {
    let folder = Folder::new();
    let refused = |line: &str, says: &str| {
        let done = folder.line(line);
        assert_eq!(done.status, Some(1), "{line}: {done:?}");
        assert!(done.stderr.contains(says) && done.stdout.is_empty(), "{line}: {}", done.stderr);
    };
    refused("board pins ulx3s", "there is no board `ulx3s`, and no file of that name");
    refused(
        &format!("board check --board colorlight-i5 {}", position()),
        "position.toml:3:9: this wiring is for the board `ulx3s-85f`, not for `colorlight-i5`",
    );
    let twice = std::fs::read_to_string(example("position.toml")).unwrap().replace("\"gn2\"", "\"gp0\"");
    folder.write("twice.toml", twice);
    refused(
        &format!("board check --board ulx3s-85f --wiring twice.toml --program {}", example("position.s")),
        "pin `gp0` is used twice: line 16 has it for `encoder`",
    );
    folder.write("other.s", ".output y\n.once\n mov y, zero\n wait period\n.period\nperiod: wait period\n");
    refused(
        &format!("board check --board ulx3s-85f --wiring {} --program other.s", example("position.toml")),
        "the program has no input port `n`",
    );
    refused("live /dev/nothing status", "cannot open /dev/nothing: is the board plugged in");
    refused(&format!("load /dev/nothing {}", example("position.s")), "cannot open /dev/nothing");
}

#[test]
fn the_loop_closes_through_the_pins_of_a_simulated_board() {
    let folder = Folder::new();
    let line = format!("board sim --board ulx3s-85f {} --axis motor,encoder,20000", position());
    let board = SimulatedBoard::start(&line, folder.path());
    let (port, baud) = (board.port.clone(), board.baud.clone());
    let program = example("position.s");
    let live = |what: &str| {
        folder.line(&format!("live {port} --baud {baud} --program {program} --machine t1 {what}")).ok()
    };
    live("set wanted=30");
    // The axis covers a third of the error per millisecond of board time, until the dead time swallows the pulses.
    let error = || -> i32 { live("read error").trim().trim_start_matches("error = ").parse().unwrap() };
    assert!((0..200).any(|_| error().abs() <= 2), "{}", live("read"));
    // Requests may displace frames of the stream, which is then reported.
    let stream = folder.line(&format!(
        "live {port} --baud {baud} --program {program} --machine t1 stream n --every 20 --count 3"
    ));
    assert_eq!((stream.status, stream.stdout.lines().count()), (Some(0), 4), "{stream:?}");
    assert!(stream.stdout.starts_with("period n\n"), "{stream:?}");
    assert!(live("status").contains("the program runs; outputs drive"), "{}", live("status"));
    // While held, the axis stays; single steps move it.
    live("hold");
    live("set wanted=-30");
    assert!(error().abs() <= 2);
    live("step");
    // The error is about -60. If the host was slow, the axis moved further on the last duty before the outputs became safe, so compare
    // with the position where it stopped.
    let read = live("read");
    let value = |name: &str| -> i32 {
        let line = read.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(" = "));
        line.unwrap_or_else(|| panic!("{name}: {read}")).parse().unwrap()
    };
    assert!(value("error") == -30 - value("n") && (-90..=-30).contains(&value("error")), "{read}");
    // In step with the emulator from the start: first with the same program, then with one that has a different duty.
    let same = live("shadow wanted=7 --periods 12");
    assert_eq!(same, "12 periods, 2 input ports, 2 output ports: no difference; the board is held\n");
    let status = live("status");
    assert!(status.contains("the program held; outputs are safe"), "{status}");
    // The duty differs at every position, since the axis may be anywhere after a slow host.
    let planted =
        std::fs::read_to_string(&program).unwrap().replace("gain, 1), -1)", "gain, 1), -1) + 0.0625");
    assert!(planted.contains("0.0625"));
    folder.write("planted.s", planted);
    let shadow =
        format!("live {port} --baud {baud} --program planted.s --machine t1 shadow wanted=15 --periods 12");
    let different = folder.line(&shadow);
    assert_eq!((different.status, different.stdout.as_str()), (Some(1), ""), "{different:?}");
    let says = "period 1: output port `duty` is ";
    assert!(
        different.stderr.contains(says) && different.stderr.contains("wanted = 15"),
        "{}",
        different.stderr
    );
    // Data memory, which is all zero in this program.
    assert_eq!(live("read [0] [1023]"), "[0] = 0\n[1023] = 0\n");
    let beyond =
        folder.line(&format!("live {port} --baud {baud} --program {program} --machine t1 read [1024]"));
    assert!(beyond.stderr.contains("no port, register or data word `[1024]`"), "{}", beyond.stderr);
    let without = folder.line(&format!("live {port} --baud {baud} shadow"));
    assert!(
        without.stderr.contains("ports are named by the program: give it with --program FILE"),
        "{}",
        without.stderr
    );
    let loaded = folder.line(&format!("load {port} --baud {baud} {program} --machine t1 --stopped")).ok();
    assert!(loaded.contains("records loaded and compared; stopped"), "{loaded}");
    let broken = folder.line(&format!("live {port} --baud {baud} --program {program} set nothing=1"));
    assert_eq!(broken.status, Some(1));
    assert!(
        broken.stderr.contains("the program has no port, register or data word `nothing`"),
        "{}",
        broken.stderr
    );

    // Unplugged: the board ends while a host is connected.
    let mut host = std::process::Command::new(env!("CARGO_BIN_EXE_takt"));
    let shadow =
        format!("live {port} --baud {baud} --program {program} --machine t1 shadow --periods 1000000");
    host.args(shadow.split_whitespace()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut host = host.spawn().unwrap();
    wait_until_at(&mut host, &port);
    drop(board);
    let done = host.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&done.stderr);
    let says = "the connection is lost: the port was unplugged, or the simulated board has ended";
    assert!(done.status.code() == Some(1) && stderr.contains(says), "{done:?}");
    assert!(done.stdout.is_empty(), "{done:?}");
}

/// A position loop with a ring of its last eight errors.
const RING: &str = "\
.input  n:int, wanted:int
.output duty, error:int
.reg    at:int sum count:int x
.const  gain = 0.02
        mov     duty, zero
        mov     error, zero
        mov     at, zero
        mov     count, zero
        fadd    sum, zero, zero
        wait    period
.period
period: isub    error, wanted, n
        itof    x, error
        fmul    duty, x, gain
        fadd    sum, sum, x
        st      ring[at], x
        iadd    at, at, 1
        iand    at, at, 7
        iadd    count, count, 1
        wait    period
.data
ring:   .float  0, 0, 0, 0, 0, 0, 0, 0
";

/// Checks that hold while RING runs on the board.
const SAME: &str = "check error == wanted - n\ncheck x == error\ncheck abs(duty - x * gain) < 0.0001\ncheck ring[(at + 7) % 8] == x\n\
        check count == period\ncheck at == period % 8\n";

/// A simulated board that runs RING, and a folder with its files.
struct Bench {
    board: SimulatedBoard,
    folder: Folder,
    port: String,
    baud: String,
}

impl Bench {
    fn start() -> Bench {
        let folder = Folder::new();
        folder.write("ring.s", RING);
        // A faster serial line speeds up the many reads of the whole data memory.
        let wiring = std::fs::read_to_string(example("position.toml")).unwrap();
        assert_eq!(wiring.matches("baud = 1_000_000").count(), 1);
        folder.write("wiring.toml", wiring.replace("baud = 1_000_000", "baud = 10_000_000"));
        let board = SimulatedBoard::start(
            "board sim --board ulx3s-85f --wiring wiring.toml --program ring.s --machine t1 --axis motor,encoder,20000",
            folder.path(),
        );
        let (port, baud) = (board.port.clone(), board.baud.clone());
        Bench { board, folder, port, baud }
    }

    fn debug(&self, file: &str, more: &str, commands: &str) -> RunOutput {
        let line = format!("debug {file} --machine t1 --board {} --baud {} {more}", self.port, self.baud);
        self.folder.fed(&line, commands.as_bytes())
    }

    fn status(&self) -> String {
        self.folder.line(&format!("live {} --baud {} status", self.port, self.baud)).ok()
    }

    /// Loads a program, with the options behind its file.
    fn load(&self, program: &str) {
        self.folder.line(&format!("load {} --baud {} {program} --machine t1", self.port, self.baud)).ok();
    }

    /// Debugs a changed program on a board that claims to carry RING.
    fn planted(&self, what: &str, by: &str, commands: &str) -> RunOutput {
        assert_eq!(RING.matches(what).count(), 1);
        self.folder.write("planted.s", RING.replace(what, by));
        self.load("planted.s");
        let liar = Liar::start(&self.port, self.baud.parse().unwrap());
        let line = format!("debug ring.s --machine t1 --board {} --baud {}", liar.port, self.baud);
        self.folder.fed(&line, commands.as_bytes())
    }
}

/// The debugger on a simulated board: registers, memory, moves, differences, and the state in which the board is left.
#[test]
fn a_board_is_debugged() {
    let bench = Bench::start();
    values_agree_with_the_emulator(&bench);
    a_restart_leaves_the_program_held(&bench);
    other_programs_are_refused(&bench);
    differences_are_reported(&bench);
    a_program_halts(&bench);
    a_program_does_not_reach_its_wait(&bench);
    the_board_is_unplugged(bench);
}

fn values_agree_with_the_emulator(bench: &Bench) {
    assert!(bench.status().contains("the program runs; outputs drive"), "{}", bench.status());

    // The outputs have the computed values, and always agree with the emulator.
    let commands = format!(
        "print count, ring[1]\n{SAME}step\n{SAME}set wanted = 7\nstep 3\n{SAME}check wanted == 7\nuntil at == 2\ncheck at == 2\n{SAME}\
         watch at == 5\ncontinue\ncheck at == 5\nregisters\nmemory ring 8\nwhere\nquit\n"
    );
    let text = bench.debug("ring.s", "", &commands).ok();
    assert!(text.starts_with("period ") && text.contains(": waits for the tick, since bundle "), "{text}");
    assert!(text.contains("; outputs drive\n   12  period: isub    error, wanted, n\n"), "{text}");
    assert!(text.contains("at           r") && text.contains("    0 ring         "), "{text}");
    assert!(text.ends_with("(takt) quit\nthe program runs; outputs drive\n"), "{text}");
    assert!(bench.status().contains("the program runs; outputs drive"), "{}", bench.status());
}

/// After a restart unwritten values are known; the program stays held, as requested.
fn a_restart_leaves_the_program_held(bench: &Bench) {
    let commands = format!("print x\nstep 12\n{SAME}check sum == 12 * x\n");
    let text = bench.debug("ring.s", "--restart", &commands).ok();
    assert!(text.starts_with("period 0: waits") && text.contains("x = (never written)\n"), "{text}");
    assert!(text.ends_with("the program stays held; outputs are safe\n"), "{text}");
    assert!(bench.status().contains("the program held; outputs are safe"), "{}", bench.status());
    let text = bench.debug("ring.s", "", "goto start\nstep\ngo\nhold\ngo\n").ok();
    assert!(text.ends_with("the program runs; outputs are safe\n"), "{text}");
}

/// A session with another program is refused: names would be wrong.
fn other_programs_are_refused(bench: &Bench) {
    bench.folder.write("other.s", RING.replace("itof    x, error", "itof    x, wanted"));
    let other = bench.debug("other.s", "", "print x\n");
    assert_eq!((other.status, other.stdout.as_str()), (Some(1), ""));
    assert!(
        other.stderr.contains("the board does not carry other.s; `takt load")
            && other.stderr.contains("of the board's image differs from this program's"),
        "{}",
        other.stderr
    );
    bench.folder.write("longer.s", RING.replace("wait    period\n.data", "nop\n wait period\n.data"));
    let longer = bench.debug("longer.s", "", "print x\n");
    assert!(longer.stderr.contains("the board's image has "), "{}", longer.stderr);
}

/// Differences: the board runs a changed program but claims to run the original.
fn differences_are_reported(bench: &Bench) {
    let done = bench.planted(
        "isub    error, wanted, n",
        "iadd    error, wanted, n",
        "set wanted = 900\nstep 4\nprint error\n",
    );
    assert_eq!(done.status, Some(1), "{done:?}");
    let says = "output port `duty` is ";
    assert!(
        done.stderr.contains(says)
            && done.stderr.contains("inputs: n = ")
            && done.stderr.contains("wanted = 900"),
        "{done:?}"
    );
    assert!(done.stdout.ends_with("the program runs; outputs drive\n"), "{done:?}");
    let done = bench.planted("iadd    count, count, 1", "isub    count, count, 1", "step 2\n");
    assert!(done.stderr.contains("`count` (register r2) is -") && done.status == Some(1), "{done:?}");
    let done = bench.planted("st      ring[at], x", "st      ring[at], sum", "step 2\n");
    assert!(done.stderr.contains(": data word ") && done.stderr.contains(" (`ring"), "{done:?}");
    let done = bench.planted("gain = 0.02", "gain = 0.03", "");
    assert!(
        done.stdout
            .contains(" is 0.03 on the board, 0.02 in the emulator, and the program does not write it\n"),
        "{done:?}"
    );
}

fn a_program_halts(bench: &Bench) {
    bench.folder.write(
        "halts.s",
        RING.replace(
            "iadd    count, count, 1\n",
            "iadd    count, count, 1\n isub x, count, 5\n bz x, stop\n",
        )
        .replace(".data", "stop: halt\n.data"),
    );
    bench.load("halts.s --stopped");
    let stopped = bench.debug("halts.s", "", "step\ngoto start\nstep 9\ncheck count == 5\nstep\n");
    assert!(stopped.stdout.starts_with("stopped, in reset; outputs are safe\n"), "{stopped:?}");
    assert!(stopped.stdout.contains("the program has halted\nperiod 4: halted at bundle "), "{stopped:?}");
    assert!(stopped.stdout.ends_with("the program has halted; outputs are safe\n"), "{stopped:?}");
    let says = "standard input:1: the program is stopped: `goto start` starts it again\n";
    assert!(
        stopped.stderr.contains(says) && stopped.stderr.contains("standard input:5: the program has halted"),
        "{stopped:?}"
    );
}

fn a_program_does_not_reach_its_wait(bench: &Bench) {
    // A program that does not reach its `wait`, and outputs that drive while it is stepped.
    bench.folder.write("endless.s", RING.replace("count, 1\n", "count, 1\n bnz wanted, period\n"));
    bench.load("endless.s");
    let endless =
        bench.debug("endless.s", "--restart", "set wanted = 1\nstep\nwhere\nprint x\ngoto start\nprint x\n");
    let says = "error: standard input:2: the program does not come to its `wait`";
    assert!(endless.status == Some(1) && endless.stderr.contains(says), "{endless:?}");
    assert!(endless.stdout.contains("period 0: has not come to its `wait`; bundle "), "{endless:?}");
    assert!(endless.stderr.contains("standard input:4: the program is in a period"), "{endless:?}");
    assert!(endless.stdout.contains("x = (never written)\nthe program stays held"), "{endless:?}");
    let driven = bench.debug("endless.s", "--restart --drive", "step 2\n").ok();
    assert!(driven.ends_with("the program stays held; outputs drive\n"), "{driven}");

    // The emulator does not reach the `wait` either, and that is the message.
    let line = format!(
        "live {} --baud {} --program endless.s --machine t1 shadow wanted=1 --periods 3",
        bench.port, bench.baud
    );
    let shadow = bench.folder.line(&line);
    let says = "period 1: the program does not wait for its tick";
    assert!(shadow.status == Some(1) && shadow.stderr.contains(says), "{shadow:?}");
}

/// Unplugged while a script waits for its next command.
fn the_board_is_unplugged(bench: Bench) {
    let Bench { board, folder, port, baud } = bench;
    let mut host = std::process::Command::new(env!("CARGO_BIN_EXE_takt"));
    let line = format!("debug endless.s --machine t1 --board {port} --baud {baud} --restart");
    host.args(line.split_whitespace()).current_dir(folder.path());
    let mut host = host.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_until_at(&mut host, &port);
    drop(board);
    // The host may already have ended.
    let _ = host.stdin.take().unwrap().write_all(b"step\nprint count\n");
    let done = host.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&done.stderr);
    let says = "the connection is lost: the port was unplugged, or the simulated board has ended";
    assert!(done.status.code() == Some(1) && stderr.contains(says), "{done:?}");
}

/// Proxy between host and board which claims that any image is RING's.
struct Liar {
    port: String,
    over: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Liar {
    fn start(port: &str, baud: u32) -> Liar {
        let options = Options { machine: &T1, ..Options::default() };
        let program = assemble("ring.s", &MemoryLoader::new(&[("ring.s", RING)]), &options).unwrap().program;
        let records = takt_board::top::image(&program).unwrap().records;
        let image: Vec<u32> =
            records.iter().flat_map(|[low, high, place]| [*low, *high, *place, 0]).collect();
        let mut host = Terminal::new().unwrap();
        let mut board = Serial::open(port.as_ref(), baud).unwrap();
        let (port, over) = (host.path().to_str().unwrap().to_owned(), Arc::new(AtomicBool::new(false)));
        let ends = Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            let (mut request, mut receiver) = (Vec::new(), Receiver::default());
            while !ends.load(Ordering::Relaxed) {
                request.extend(host.receive().unwrap());
                let [_, _, command, count, low, high, ..] = request[..] else {
                    std::thread::sleep(Duration::from_millis(1));
                    continue;
                };
                let data = if command == 2 { 4 * usize::from(count) } else { 0 };
                if request.len() < 8 + data {
                    continue;
                }
                board.send(&request).unwrap();
                request.clear();
                let frame = loop {
                    receiver.put(&board.receive().unwrap());
                    if let Some(frame) = receiver.frame() {
                        break frame;
                    }
                };
                let mut words = frame.words;
                let address = u16::from_le_bytes([low, high]);
                if (IMAGE..CORE_REGISTERS).contains(&address) {
                    words = image[usize::from(address - IMAGE)..][..words.len()].to_vec();
                }
                let mut answer = vec![ANSWER, frame.number, frame.status, words.len() as u8];
                answer.extend(words.iter().flat_map(|word| word.to_le_bytes()));
                let sum = checksum(&answer[1..]);
                answer.extend(sum.to_le_bytes());
                host.send(&answer).unwrap();
            }
        });
        Liar { port, over, thread: Some(thread) }
    }
}

impl Drop for Liar {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(std::thread::JoinHandle::join);
    }
}

/// Waits until a process has opened the port, according to Linux's list of its open files, or has ended.
fn wait_until_at(host: &mut std::process::Child, port: &str) {
    let open = std::path::PathBuf::from(format!("/proc/{}/fd", host.id()));
    let is_at_the_port = || {
        let files = std::fs::read_dir(&open).into_iter().flatten().flatten();
        files.filter_map(|file| std::fs::read_link(file.path()).ok()).any(|file| file.as_os_str() == port)
    };
    while host.try_wait().unwrap().is_none() && !is_at_the_port() {
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn rejects_unavailable_board_commands_first() {
    let folder = Folder::new();
    folder.write("ring.s", RING);
    folder.write("typo.txt", "step\nback\n");
    folder.write("system.toml", "");
    for (line, status, says) in [
        ("debug ring.s --board /dev/nothing", 1, "cannot open /dev/nothing: is the board plugged in"),
        (
            "debug ring.s --board /dev/nothing --script typo.txt",
            1,
            "typo.txt:2: `back`: a circuit does not go back",
        ),
        (
            "debug system.toml --board /dev/nothing",
            2,
            "--board is for a single program, and system.toml is a system",
        ),
        ("debug ring.s --board /dev/nothing --tui", 2, "cannot be used with"),
        ("debug ring.s --board /dev/nothing --inputs in.csv", 2, "cannot be used with"),
        ("debug ring.s --board /dev/nothing --tick 100", 2, "cannot be used with"),
        ("debug --track --board /dev/nothing", 2, "cannot be used with"),
        ("debug ring.s --baud 9600", 2, "--board <PORT>"),
        ("debug ring.s --restart", 2, "--board <PORT>"),
        ("debug ring.s --drive", 2, "--board <PORT>"),
    ] {
        let done = folder.line(line);
        assert_eq!((done.status, done.stdout.as_str()), (Some(status), ""), "{line}: {done:?}");
        assert!(done.stderr.contains(says), "{line}: {}", done.stderr);
    }
}

fn hybrid(name: &str) -> String {
    format!("{}/../../programs/hybrid/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// The tracking error through encoders, PWMs and UART of the complete top level equals the emulator's, plus the effect of the pins:
/// forces are quantised to 0.5 N and delayed by a PWM period.
#[test]
fn the_hybrid_robot_closes_its_loop_through_pins() {
    let folder = Folder::new();
    let sim = |wiring: &str, more: &str| {
        let program = hybrid("tracking.s");
        folder.line(&format!(
            "board sim --board ulx3s-85f --wiring {wiring} --program {program} --robot {more}"
        ))
    };
    let wiring = std::fs::read_to_string(hybrid("board.toml")).unwrap();
    for (what, by, says) in [
        (
            "start = 3572338 ",
            "start = 3572000 ",
            "the robot stands at 3572338 counts of `n1`, and `encoder1` starts at 3572000",
        ),
        ("{ count = \"n5\" }", "{}", "the wiring has no quadrature whose `count` is the port `n5`"),
        (
            "{ duty = \"tau5\" }\nscale = { duty = 8 }",
            "{}",
            "the wiring has no pwm whose `duty` is the port `tau5`",
        ),
        ("tick = \"gp23\"", "", "the robot needs the signal `tick` on a pin"),
        ("period = 100 ", "period = 200 ", "the robot's period is 100 µs, the wiring's 200 µs"),
        (", low = \"gn7\"", "", "`motor1`: a force in both directions needs a signed pwm with both pins"),
        ("deadlines = 2", "autostart = true", "the host starts the robot: leave out `autostart`"),
    ] {
        assert_eq!(wiring.matches(what).count().min(1), 1, "{what}");
        folder.write("wrong.toml", wiring.replacen(what, by, 1));
        let done = sim("wrong.toml", "");
        assert!(done.status == Some(1) && done.stderr.contains(says), "{by}: {done:?}");
    }
    let done = sim(&hybrid("board.toml"), "--periods 400");
    assert_eq!((done.status, done.stderr.as_str()), (Some(0), ""));
    let text = done.stdout;
    assert!(
        text.starts_with("tracking.s on ulx3s-85f, simulated: t3 at 60 MHz, 400 periods of agh.ngc"),
        "{text}"
    );
    assert!(text.contains("0 deadlines missed; 0 points of the path late"), "{text}");
    let overall = text.lines().find(|line| line.starts_with("  overall")).unwrap_or_else(|| panic!("{text}"));
    let errors: Vec<f64> = overall.split_whitespace().skip(1).map(|error| error.parse().unwrap()).collect();
    let [pins, alone] = errors[..] else { panic!("{text}") };
    assert!(alone > 5.0 && (pins / alone - 1.0).abs() < 0.1, "{text}");
}

#[test]
fn path_from_pin_to_pin_has_a_bound() {
    let folder = Folder::new();
    let program = hybrid("tracking.s");
    let bound = |more: &str| folder.line(&format!("bound {program} --pins {more}"));
    let wiring = hybrid("board.toml");
    let text = bound(&format!("--wiring {wiring}")).ok();
    for says in [
        "  edge to `count`                                   6 ",
        "encoder4 (n4), encoder5 (n5)\n",
        "motor5 (tau5)\n",
    ] {
        assert!(text.contains(says), "{says}: {text}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&bound(&format!("--wiring {wiring} --json")).ok()).unwrap();
    let way = &json["ways"][0];
    let sum = |edge: &str| {
        let parts = [&way["inputs"][0]["parts"], &way["between"], &way["outputs"][0]["parts"]];
        parts
            .iter()
            .flat_map(|parts| parts.as_array().unwrap())
            .map(|part| part[edge].as_u64().unwrap())
            .sum::<u64>()
    };
    assert_eq!(way["total"]["best"], sum("best"));
    assert_eq!(way["total"]["worst"], sum("worst"));
    // Two periods of state lengthen the path by two periods; pins without a dependence are on no path.
    let delayed = "delayed.s";
    folder.write(
        delayed,
        ".input n1:int n2:int n3:int n4:int n5:int\n.output F1 F2 F3 tau4 tau5\n.state s:int\n.state t:int\n.once\n mov s, zero\n\
         mov t, zero\n mov F2, zero\n mov F3, zero\n mov tau5, zero\n wait p\n.period\np: itof F1, t\n mov t, s\n mov s, n1\n itof tau4, n1\n wait p\n",
    );
    let bound = folder.line(&format!("bound {delayed} --pins --wiring {wiring} -W allow=unused")).ok();
    let json: serde_json::Value = serde_json::from_str(
        &folder.line(&format!("bound {delayed} --pins --wiring {wiring} -W allow=unused --json")).ok(),
    )
    .unwrap();
    assert!(bound.contains("  through 2 periods of states                   12000 "), "{bound}");
    assert!(!bound.contains("encoder2") && !bound.contains("motor2"), "{bound}");
    let totals: Vec<u64> =
        json["ways"].as_array().unwrap().iter().map(|way| way["total"]["best"].as_u64().unwrap()).collect();
    assert_eq!((totals.len(), totals[0] + 12000), (2, totals[1]), "{json}");
    let bound = |more: &str| folder.line(&format!("bound {program} --pins {more}"));
    let refused = |more: &str, says: &str| {
        let done = bound(more);
        assert!(done.status == Some(1) && done.stderr.contains(says), "{more}: {done:?}");
    };
    refused(&format!("--wiring {wiring} --board colorlight-i5"), "this wiring is for the board `ulx3s-85f`");
    refused(&format!("--wiring {wiring} --deadline 100us"), "--deadline is not for --pins");
    folder.write("none.toml", "period = 100\n");
    refused("--wiring none.toml", "none.toml does not name a board: give `--board NAME`, or begin it");
    // The message is the same for a board given by --board and in the file.
    folder.write("system.toml", "[core.one]\nmachine = \"t1\"\n");
    for board in ["", " --board ulx3s-85f"] {
        refused(
            &format!("--wiring system.toml{board}"),
            "system.toml:1:2: expected a wiring, which assigns peripherals to a board's pins; found a system of several cores",
        );
    }
    folder.write("broken.toml", "period = \n");
    refused("--wiring broken.toml", "broken.toml:1:10:");
    refused("--wiring none.toml --board ulx3s-85f", "none.toml: no path from pin to pin");
}

/// A program that is stored in the flash starts at the next power-up, until the flash forgets it; a board without a flash is told so.
#[test]
fn a_stored_program_starts_at_power_up() {
    let folder = Folder::new();
    let program = |mark: u32| {
        format!(
            ".schedule on\n.output mark:int\n.param gain = 1 range 0..9\n.output twice\n.once\n mark = {mark}\n twice = 2*gain\n wait period\n.period\nperiod: mark = {mark}\n twice = 2*gain\n wait period\n"
        )
    };
    folder.write("first.s", program(1));
    folder.write("second.s", program(2));
    let plain = "clock = 50\nperiod = 40\nbaud = 10_000_000\nautostart = true\n";
    folder.write("plain.toml", plain);
    let flash = "[flash]\npins = { select = \"gp0\", clock = \"gp1\", out = \"gp2\", in = \"gp3\" }\nfirst = 0x100000\nsecond = 0x110000\n";
    folder.write("wiring.toml", format!("{plain}{flash}"));
    let start = |more: &str| {
        let line = format!("board sim --board ulx3s-85f --program first.s --machine t1 {more}");
        SimulatedBoard::start(&line, folder.path())
    };
    let live = |board: &SimulatedBoard, command: &str| {
        folder.line(&format!("live {} --baud {} {command}", board.port, board.baud))
    };
    let load = |board: &SimulatedBoard, more: &str| {
        folder.line(&format!("load {} --baud {} --machine t1 {more}", board.port, board.baud))
    };
    let values = |board: &SimulatedBoard| live(board, "--program second.s --machine t1 read mark twice").ok();
    {
        let board = start("--wiring wiring.toml --flash kept.bin");
        assert!(
            live(&board, "flash")
                .ok()
                .starts_with("started with the bitstream's program\nfirst image, at 0x100000: none")
        );
        let told = load(&board, "second.s --param gain=3 --flash").ok();
        assert!(told.contains("image 1 stored in the flash and compared, as the first of two"), "{told}");
    }
    {
        let board = start("--wiring wiring.toml --flash kept.bin");
        assert!(live(&board, "flash").ok().starts_with("started with the first image\n"));
        assert_eq!(values(&board), "mark = 2\ntwice = 6\n");
        assert!(live(&board, "flash --forget").ok().starts_with("no image is valid now"));
    }
    {
        let board = start("--wiring wiring.toml --flash kept.bin");
        assert_eq!(values(&board), "mark = 1\ntwice = 2\n");
    }
    let board = start("--wiring plain.toml");
    let refused = load(&board, "second.s --flash");
    assert_eq!(refused.status, Some(1));
    assert!(
        refused
            .stderr
            .contains("this board has no flash: its wiring names the pins of one in the table `[flash]`"),
        "{}",
        refused.stderr
    );
    let refused = folder.line(
        "board sim --board ulx3s-85f --program first.s --machine t1 --wiring plain.toml --flash kept.bin",
    );
    assert_eq!(refused.status, Some(1));
    assert!(
        refused.stderr.contains("--flash is for a wiring with the table `[flash]`"),
        "{}",
        refused.stderr
    );
    // A source would be overwritten, and a folder is no file.
    for (file, message) in [("first.s", "first.s"), (".", "cannot use .")] {
        let line = format!(
            "board sim --board ulx3s-85f --program first.s --machine t1 --wiring wiring.toml --flash {file}"
        );
        let refused = folder.line(&line);
        assert_ne!(refused.status, Some(0), "{refused:?}");
        assert!(refused.stderr.contains(message), "{refused:?}");
    }
}
