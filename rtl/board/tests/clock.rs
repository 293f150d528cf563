// SPDX-License-Identifier: MIT OR Apache-2.0
//! Boards whose program, or clock, stops: the pin for a watchdog, and pins that go off without a clock.

use std::fs;
use std::path::Path;
use std::process::Command;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::simulation::Simulation;
use takt_board::{Board, Wiring, top};
use takt_family::FAMILIES;
use takt_isa::{Program, T1};

/// Clock of 50 MHz, periods of 400 cycles.
const WIRING: &str = r#"
clock = 50
period = 8
autostart = true
uart = false
[signals]
drive = "gp10"
watchdog = "gp11"
stop = "gn10"
[peripheral.motor]
kind = "pwm"
pins = { high = "gp2", low = "gn2" }
half = 100
dead = 5
ports = { duty = "force" }
[peripheral.brake]
kind = "digital-out"
pins = { out = "gp3" }
safe = 1
ports = { level = "brake" }
[peripheral.lamp]
kind = "digital-out"
pins = { out = "gp4" }
ports = { level = "lit" }
"#;

/// The brake is off, the lamp is on.
const PROGRAM: &str = "
.output force:int brake:int lit:int
.once
        mov     force, 0
        mov     brake, 0
        mov     lit, 1
        wait    period
.period
period: wait    period
";

/// Cycles of a period.
const PERIOD: u32 = 400;

/// Testbench: stops the clock, while the motor's upper, then its lower switch conducts, and at an edge of either level; prints the pins
/// before, and after as many ns as LIMIT. The oscillator runs at 9.6875 MHz.
const BENCH: &str = "`timescale 1ns / 1ps
module takt_oscillator (input wire pin, output reg oscillation);
    initial oscillation = 1'b0;
    always #51.613 oscillation = ~oscillation;
endmodule

module bench;
    reg clk = 1'b0, runs = 1'b1, stop = 1'b0;
    wire drive, high, low, brake, lamp;
    always #10 if (runs) clk = ~clk;
    takt_board board (
        .clk_in(clk), .button(1'b0), .signal_stop(stop), .signal_drive(drive), .motor_high(high), .motor_low(low), .brake_out(brake),
        .lamp_out(lamp)
    );
    task stopped(input level);
        begin
            while (clk != level) #1;
            runs = 1'b0;
            $display(\"runs %b%b%b%b%b\", drive, high, low, brake, lamp);
            #LIMIT $display(\"stands %b%b%b%b%b\", drive, high, low, brake, lamp);
            #100000 $display(\"stands %b%b%b%b%b\", drive, high, low, brake, lamp);
            runs = 1'b1;
            #1000;
        end
    endtask
    initial #1 $display(\"stands %b%b%b%b%b\", drive, high, low, brake, lamp);
    initial begin
        wait (lamp === 1'b1 && high === 1'b1) stopped(1'b0);
        wait (lamp === 1'b1 && low === 1'b1) stopped(1'b1);
        wait (lamp === 1'b1 && high === 1'b1) $finish;
    end
endmodule
";

fn board() -> Board {
    Board::from_name("ulx3s-85f").expect("a board").expect("a right one")
}

fn program() -> Program {
    let options = Options { machine: &T1, ..Options::default() };
    assemble("p.s", &MemoryLoader::new(&[("p.s", PROGRAM)]), &options)
        .unwrap_or_else(|errors| panic!("{}", errors.render(false)))
        .program
}

fn wiring(board: &Board, more: &str) -> Wiring {
    Wiring::read("w.toml", &format!("{more}{WIRING}"), board)
        .unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
}

/// With and without the watch of the clock, whose reset lasts longer, the circuit runs in Verilator.
#[test]
fn the_watchdogs_pin_changes_once_a_period_while_outputs_drive() {
    for more in ["", "clock_watch = true\n"] {
        let (board, program) = (board(), program());
        let wiring = wiring(&board, more);
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("watchdog-{}", more.len()));
        let mut board =
            Simulation::new(&board, &wiring, &program, &folder).unwrap_or_else(|error| panic!("{error}"));
        let mut run = |stop: bool| {
            board.set("signal_stop", stop);
            board.run(PERIOD, &[]).expect("it runs");
            (board.output("signal_drive").expect("a pin").0, board.output("signal_watchdog").expect("a pin"))
        };
        assert!((0..20).any(|_| run(false).0), "it drives");
        let levels: Vec<bool> = (0..20).map(|_| run(false).1.0).collect();
        assert!(levels.windows(2).all(|pair| pair[0] != pair[1]), "{levels:?}");
        run(true);
        let (drives, (level, _)) = run(true);
        assert!(!drives);
        for _ in 0..20 {
            let (_, (now, high)) = run(true);
            assert_eq!((now, high), (level, if level { PERIOD } else { 0 }));
        }
    }
}

#[test]
fn pins_are_off_before_the_first_clock_edge_and_when_the_clock_stops() {
    let (on, off) = (["11001", "10101"], "00010");
    let watched = stopped("clock_watch = true\n");
    let first = [format!("stands {off}")];
    let expected = on.map(|on| [format!("runs {on}"), format!("stands {off}"), format!("stands {off}")]);
    assert_eq!(watched, [&first, expected.as_flattened()].concat());
    // Without the watch, each pin stays as it is.
    let expected = on.map(|on| [format!("runs {on}"), format!("stands {on}"), format!("stands {on}")]);
    assert_eq!(stopped(""), [&first, expected.as_flattened()].concat());
}

/// Lines of the testbench for a board with more keys in its wiring.
fn stopped(more: &str) -> Vec<String> {
    let (board, program) = (board(), program());
    let wiring = wiring(&board, more);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("clock-stop-{}", more.len()));
    let circuit = top::circuit(&board, &wiring, &program).unwrap_or_else(|error| panic!("{error}"));
    let (name, text) = board.family.pll.expect("a PLL").stand_in;
    // 2.2 us, as the file says of its time.
    let mut files =
        vec![(name.to_owned(), text.to_owned()), ("bench.v".to_owned(), BENCH.replace("LIMIT", "2200"))];
    for file in circuit.files.into_iter().filter(|file| file.name != top::OSCILLATOR) {
        assert!(file.name != "takt_board.v" || more.is_empty() || file.text.contains(": 2.2 us after"));
        files.push((file.name, file.text));
    }
    for (name, text) in &files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("the target folder can be written");
        fs::write(path, text).expect("the target folder can be written");
    }
    let sources = files.iter().map(|(name, _)| name.as_str()).filter(|name| name.ends_with(".v"));
    let run = |program: &str, arguments: &[&str]| {
        let output = Command::new(program).current_dir(&folder).args(arguments).output();
        let output = output.unwrap_or_else(|error| panic!("{program}: {error}"));
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{program}: {text}{}", String::from_utf8_lossy(&output.stderr));
        text
    };
    let options = ["-g2005", "-s", "bench", "-o", "bench"];
    run("iverilog", &options.into_iter().chain(sources).collect::<Vec<_>>());
    let text = run("vvp", &["-n", "bench"]);
    text.lines()
        .filter(|line| line.starts_with("runs") || line.starts_with("stands"))
        .map(str::to_owned)
        .collect()
}

#[test]
fn a_watch_of_the_clock_needs_an_oscillator() {
    let board = Board::from_name("gatemate-evb").expect("a board").expect("a right one");
    assert!(board.family.oscillator.is_none());
    let mistakes =
        Wiring::read("w.toml", "period = 100\nclock_watch = true\n", &board).expect_err("no oscillator");
    let text = mistakes.iter().map(ToString::to_string).collect::<String>();
    assert!(text.contains("which Cologne Chip GateMate does not have: the signal `watchdog`"), "{text}");
}

/// The oscillator's cell is the family's own, at a frequency that it has.
#[test]
fn oscillators_run_at_a_frequency_that_they_have() {
    for family in FAMILIES {
        let Some(oscillator) = family.oscillator else { continue };
        let (lowest, highest) = oscillator.mhz;
        assert!((lowest..=highest).contains(&oscillator.runs), "{}", family.name);
        assert!(oscillator.instance.starts_with(oscillator.cell), "{}", family.name);
    }
}
