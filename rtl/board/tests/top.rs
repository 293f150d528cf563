// SPDX-License-Identifier: MIT OR Apache-2.0
//! The complete top level of a board in Verilator, with a plant behind its pins and the real host at its UART.

use crate::harness::board::{Ticks, refuses};
use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::latency::{self, Part, PinPath};
use takt_board::protocol::{IMAGE, INPUTS, LinkError, OUTPUTS};
use takt_board::simulation::{EncoderMotion, Simulation};
use takt_board::tools::Venv;
use takt_board::wiring::Peripheral;
use takt_board::{Application, Board, Host, Wiring, build, model, netlist, top};
use takt_family::Models;
use takt_isa::timing::Span;
use takt_isa::{Program, T1};

/// Wiring and program are files because `cargo xtask test` also makes the routed circuit from them, and runs the routed test if they have
/// changed.
pub(crate) const WIRING: &str = include_str!("top/wiring.toml");

/// Cycles of a period, as in the wiring.
pub(crate) const PERIOD: u32 = 2000;

/// A proportional controller with a set point from the host; `force` is a quarter of the difference, and the lamp is lit at odd counts.
const PROGRAM: &str = include_str!("top/loop.s");

/// More work than a period has cycles for.
const SLOW: &str = ".reg k:int
        mov     k, 2000
again:  isub    k, k, 1
        bnz     k, again
";

fn program(source: &str) -> Program {
    let loader = MemoryLoader::new(&[("p.s", source)]);
    let options = Options { machine: &T1, ..Options::default() };
    assemble("p.s", &loader, &options).unwrap_or_else(|e| panic!("{e:?}")).program
}

fn port(program: &Program, name: &str) -> u16 {
    let input = program.inputs.iter().find(|port| port.name == name);
    match input {
        Some(port) => INPUTS + program.machine.inputs.index(port.register).expect("an input").get(),
        None => {
            let port = program.outputs.iter().find(|port| port.name == name).expect("a port");
            OUTPUTS + port.register.get() % program.machine.outputs_per_bank
        }
    }
}

/// Runs whole periods.
pub(crate) fn periods(board: &mut Simulation, count: u32) {
    board.run(count * PERIOD, &[]).expect("it runs");
}

/// The outputs are safe: nothing drives.
pub(crate) fn safe(board: &mut Simulation) -> bool {
    periods(board, 1);
    let level = |name: &str| board.output(name).expect("a pin");
    ["signal_drive", "motor_high", "motor_low", "lamp_out"].iter().all(|name| level(name) == (false, 0))
}

/// Lets an encoder turn at two boards and stops them; their output pins must be the same after the reset, drive, and end safe.
pub(crate) fn have_the_same_pins(both: &mut [Simulation; 2]) {
    let mut drove = 0;
    for run in 0..400 {
        let levels: Vec<Vec<(bool, u32)>> = both
            .iter_mut()
            .map(|board| {
                // The encoder turns from the start on; `stop` ends the run.
                let pins = ["encoder_a", "encoder_b"].map(|pin| board.input(pin).expect("a pin"));
                board.turns = vec![EncoderMotion { pins, from: 3 * run, by: 3 }];
                board.set("signal_stop", run >= 380);
                board.run(211, &[]).expect("it runs");
                board.output_levels().collect()
            })
            .collect();
        // Before the reset has ended, registers hold anything.
        if run * 211 > top::RESET as i32 {
            assert_eq!(levels[0], levels[1], "run {run}");
        }
        drove += levels[1].iter().map(|(_, high)| high).sum::<u32>();
    }
    assert!(drove > 0 && both.iter_mut().all(safe));
}

/// Cycles in which the upper switch conducts, in one period of the PWM.
fn pulse(board: &mut Simulation) -> u32 {
    board.run(500, &[]).expect("it runs");
    board.output("motor_high").expect("a pin").1
}

/// Least and most cycles until a change of the duty shows at each pin of a PWM, over all changes in all phases.
fn shows(pwm: &Peripheral, half: i32) -> [(u64, u64); 2] {
    let dead = pwm.parameter("dead").cast_signed();
    let (put, end) = (4 * half + dead, 12 * half + 4 * dead);
    let runs = |old: i32, new: i32, put: i32| -> Vec<[u32; 2]> {
        let mut model = model::of(pwm.kind, &pwm.parameters).expect("a model");
        let clock = |cycle: i32| {
            let duty = if cycle < put { old } else { new };
            model.clock(&[0, 1, (cycle == 0 || cycle == put).into(), duty as u32]);
            [model.outputs()[0], model.outputs()[1]]
        };
        (0..end).map(clock).collect()
    };
    let mut found = [(u64::MAX, 0); 2];
    for old in -half..=half {
        let without = runs(old, old, put);
        for (new, phase) in (-half..=half).flat_map(|new| (0..2 * half).map(move |phase| (new, phase))) {
            let with = runs(old, new, put + phase);
            for (pin, (least, most)) in found.iter_mut().enumerate() {
                let first = with.iter().zip(&without).position(|(a, b)| a[pin] != b[pin]);
                // Outputs after the clock's edge of a cycle are those of the next cycle. Pulses within the dead time are not seen.
                let Some(first) = first else { continue };
                let cycles = (first as i32 + 1 - put - phase) as u64;
                (*least, *most) = ((*least).min(cycles), (*most).max(cycles));
            }
        }
    }
    found
}

/// First cycle in which a new duty shows at a pin of a PWM, for any dead time.
#[test]
fn duty_latency_equals_the_bound() {
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    for (half, dead) in [(13, 3), (4, 0), (5, 1), (6, 2), (6, 7), (9, 8), (2, 5), (3, 20), (1, 9)] {
        let bound = |pins: &str| {
            let text = format!(
                "period = 40\n[peripheral.encoder]\nkind = \"quadrature\"\npins = {{ a = \"gp0\", b = \"gn0\" }}\nports = {{ count = \"n\" }}\n[peripheral.motor]\nkind = \"pwm\"\npins = {{ {pins} }}\nhalf = {half}\ndead = {dead}\nports = {{ duty = \"force\" }}\n"
            );
            let wiring = Wiring::read("w.toml", &text, &board).expect("a right wiring");
            let sum =
                Part::sum("", &latency::undivided(&wiring, Span { best: 0, worst: 0 })[0].outputs[0].parts);
            ((sum.best, sum.worst), wiring.peripherals[1].clone())
        };
        let (both, pwm) = bound("high = \"gp2\", low = \"gn2\"");
        let (high, _) = bound("high = \"gp2\"");
        let [upper, lower] = shows(&pwm, half);
        assert_eq!(upper, high, "half {half}, dead time {dead}");
        assert_eq!((upper.0.min(lower.0), upper.1.max(lower.1)), both, "half {half}, dead time {dead}");
    }
}

/// Board, wiring and program, and a folder for it.
pub(crate) fn target(folder: &str) -> (Board, Wiring, Program, PathBuf) {
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let wiring = Wiring::read("wiring.toml", WIRING, &board).expect("a right wiring");
    let first = program(PROGRAM);
    wiring.check("wiring.toml", WIRING, &first).expect("ports fit");
    (board, wiring, first, Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder))
}

#[test]
fn board_runs_talks_and_fails_safe() {
    let (board, wiring, first, folder) = target("board-wiring");
    let sim = Simulation::new(&board, &wiring, &first, &folder).unwrap_or_else(|error| panic!("{error}"));
    runs_talks_and_fails_safe(sim, &wiring, &first);
}

/// The period's end in `PROGRAM`, after `lit` is written.
const WAIT: &str = "        iand    lit, n, 1\n        wait    period\n";

/// `PROGRAM` with its outputs published before some work.
fn published(work: &str) -> String {
    assert!(PROGRAM.contains(WAIT));
    let early = format!("        iand    lit, n, 1\n        publish\n{work}        wait    period\n");
    PROGRAM.replace(WAIT, &early)
}

/// The board does the same with outputs published some hundred cycles before the `wait`, and is as much earlier.
#[test]
fn outputs_published_early_reach_the_pins_early() {
    let (board, wiring, plain, folder) = target("board-published");
    let work = ".rep i, 1, 20\n        fdiv    f, f, 3.0\n.endr\n        st      [17], f\n";
    let early = program(&published(work));
    let late = program(
        &PROGRAM.replace(WAIT, &format!("        iand    lit, n, 1\n{work}        wait    period\n")),
    );
    let worst = |program: &Program| {
        let bounds = takt_analysis::bound(program).expect("it can be bounded");
        let ways = latency::ways(&wiring, &Application::from(program), &[bounds]).expect("it has a period");
        ways.ways[0].total().expect("an edge").worst
    };
    assert!(worst(&early) <= worst(&plain) && worst(&early) + 400 < worst(&late), "{}", worst(&early));
    let sim = Simulation::new(&board, &wiring, &early, &folder).unwrap_or_else(|error| panic!("{error}"));
    runs_talks_and_fails_safe(sim, &wiring, &early);
}

/// A period whose `wait` comes after the next tick misses its deadline, although its outputs were published long before.
#[test]
fn a_published_period_can_miss_its_deadline() {
    let (board, wiring, _, folder) = target("board-published-late");
    let program = program(&published(SLOW));
    let mut sim =
        Simulation::new(&board, &wiring, &program, &folder).unwrap_or_else(|error| panic!("{error}"));
    let mut driven = 0;
    for _ in 0..12 {
        periods(&mut sim, 1);
        driven += u32::from(sim.output("signal_drive").expect("a pin").0);
    }
    // It drives from the first outputs on, and until the second tick that comes too early.
    assert!((1..=3).contains(&driven), "{driven}");
    assert!(safe(&mut sim));
    let mut host = Host::connect(sim, 3).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(host.status().expect("status").causes().collect::<Vec<_>>(), ["missed deadline"]);
    assert!(host.register("periods").expect("a register") >= 1);
    assert!(host.register("misses").expect("a register") >= 2);
}

/// A board without a UART drives its pins as one with a UART to which nobody talks, cycle by cycle.
#[test]
fn without_a_uart_the_pins_are_the_same() {
    let (board, _, first, folder) = target("board-alone");
    let of = |text: &str, name: &str| {
        let wiring =
            Wiring::read("wiring.toml", text, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        let folder = folder.join(name);
        Simulation::new(&board, &wiring, &first, &folder).unwrap_or_else(|error| panic!("{error}"))
    };
    let heard = WIRING.replace("host = 400\n", "");
    assert_ne!(heard, WIRING);
    let alone = heard.replace("baud = 5_000_000\n", "uart = false\n");
    assert_ne!(alone, heard);
    let mut both = [of(&heard, "uart"), of(&alone, "none")];
    have_the_same_pins(&mut both);
}

static TOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Each reason for safe outputs is reported when it occurs: a pin, the host, a value in the program.
#[test]
fn reports_the_reason_for_safe_outputs_at_once() {
    let (board, wiring, first, folder) = target("board-reasons");
    let mut sim = Simulation::new(&board, &wiring, &first, &folder).unwrap_or_else(|error| panic!("{error}"));
    sim.tell = Some(|text| TOLD.lock().expect("no panic").push(text.to_owned()));
    let mut host = Host::connect(sim, 7).unwrap_or_else(|error| panic!("{error}"));
    let drives = |host: &mut Host<Simulation>| {
        host.set("control", 0x105).expect("it starts");
        periods(&mut host.line, 8);
        assert!(host.status().expect("status").drives());
        TOLD.lock().expect("no panic").clear();
    };
    let told = |host: &mut Host<Simulation>, says: &str| {
        periods(&mut host.line, 6);
        let told = std::mem::take(&mut *TOLD.lock().expect("no panic"));
        let [told] = &told[..] else { panic!("{says}: {told:?}") };
        let (time, reason) = told.split_once(" ms: the outputs become safe: ").expect("a time");
        let now = host.line.cycles as f64 / wiring.clock / 1e3;
        let time: f64 = time.parse().expect("a number");
        // A period takes 0.04 ms; the request that caused the reason takes several.
        assert!(reason.starts_with(says) && (now - 1.0..now).contains(&time), "{says}: {told} at {now}");
    };
    // By the host, and by the pin.
    drives(&mut host);
    host.set("control", 0x105).expect("control");
    told(&mut host, "it is started again");
    drives(&mut host);
    host.set("control", 1).expect("control");
    told(&mut host, "outputs are no longer enabled");
    drives(&mut host);
    host.set("control", 0).expect("control");
    told(&mut host, "it is stopped");
    drives(&mut host);
    host.line.set("signal_stop", true);
    told(&mut host, "stop: the pin `stop` was 1, or open");
    host.line.set("signal_stop", false);
    // By programs that run until the host sets a value.
    let lit = "        iand    lit, n, 1\n";
    let instead = |what: &str| PROGRAM.replace(lit, &format!("{what}{lit}"));
    let slow =
        ".reg k:int\n        iadd    k, wanted, 1\nagain:  isub    k, k, 1\n        bnz     k, again\n";
    for (source, wanted, says) in [
        (PROGRAM.replace("fmul    force, f, 0.25", "fsqrt   force, f"), -1, "NaN output: `force`"),
        (instead(".reg t\n        ld      t, [wanted]\n"), 5000, "fault: data address at bundle "),
        (instead("        bz      wanted, goes\n        halt\ngoes:\n"), 1, "halt"),
        (instead(slow), 2000, "missed deadline: 2 of them; a period took "),
    ] {
        let program = program(&source);
        host.load(&top::image(&program).expect("it fits").records).expect("it is loaded");
        drives(&mut host);
        host.write(port(&program, "wanted"), &[wanted as u32]).expect("a port");
        told(&mut host, says);
    }
    // By silence.
    host.load(&top::image(&first).expect("it fits").records).expect("it is loaded");
    drives(&mut host);
    periods(&mut host.line, 410);
    told(&mut host, "host silent: no request for as many periods as the wiring's `host` allows");
}

/// Runs the same test on the placed and routed netlist, from which the bitstream is made; a fault planted there must be found.
///
/// Synthesis, place and route take minutes: with `TAKT_ROUTED=1` only, as `cargo xtask test` sets it, in the tools' environment that
/// `TAKT_VENV` names, or `.venv`.
#[test]
fn the_routed_design_does_the_same() {
    if std::env::var_os("TAKT_ROUTED").is_none() {
        return;
    }
    let (board, wiring, first, folder) = target("board-routed");
    let venv = tools(&board);
    let models = board.family.models.as_ref().expect("models of the cells");
    let options = build::Options { seed: 1, seeds: 1, time: None, netlist: true };
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    build::build(&venv, &board, &wiring, &first, options, &folder, &|_| ()).unwrap_or_else(|e| panic!("{e}"));
    let simulated = |change: &dyn Fn(&mut serde_json::Map<String, serde_json::Value>)| {
        let files =
            netlist::verilog(&venv, models, &folder, change).unwrap_or_else(|error| panic!("{error}"));
        Simulation::of(&files, &board, &wiring, &folder.join("simulation")).unwrap_or_else(|e| panic!("{e}"))
    };
    runs_talks_and_fails_safe(simulated(&|_| ()), &wiring, &first);
    // One table of the PWM's logic inverted.
    let faulty = simulated(&|cells| invert_a_table(cells, models, "u_motor"));
    let noticed = std::panic::catch_unwind(AssertUnwindSafe(|| {
        runs_talks_and_fails_safe(faulty, &wiring, &first);
    }));
    assert!(noticed.is_err(), "the planted fault was not noticed");
}

/// The example for small devices.
const STEP: &str = "../../programs/examples/board/step";

/// Runs the placed and routed netlist of the example for small devices on a board beside its circuit: the pins are the same in each
/// cycle. A fault planted in the netlist must be found. With `TAKT_ROUTED=1` only, like the test above.
fn routed_pins_are_those_of_the_circuit(name: &str) {
    if std::env::var_os("TAKT_ROUTED").is_none() {
        return;
    }
    let read = |name: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(STEP).join(name);
        std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let file = format!("{name}.toml");
    let (source, row, text) = (read("servo.s"), read("machine.toml"), read(&file));
    let board = Board::from_name(name).expect("a board").expect("a right one");
    let wiring = Wiring::read(&file, &text, &board).expect("a right wiring");
    let loader = MemoryLoader::new(&[("servo.s", source.as_str()), ("machine.toml", row.as_str())]);
    let servo = assemble("servo.s", &loader, &Options::default()).unwrap_or_else(|e| panic!("{e:?}")).program;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("board-routed-{name}"));
    let venv = tools(&board);
    let models = board.family.models.as_ref().expect("models of the cells");
    let options = build::Options { seed: 1, seeds: 1, time: None, netlist: true };
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    build::build(&venv, &board, &wiring, &servo, options, &folder, &|_| ()).unwrap_or_else(|e| panic!("{e}"));
    let circuit = || {
        let folder = folder.join("circuit");
        Simulation::new(&board, &wiring, &servo, &folder).unwrap_or_else(|error| panic!("{error}"))
    };
    let simulated = |change: &dyn Fn(&mut serde_json::Map<String, serde_json::Value>)| {
        let files =
            netlist::verilog(&venv, models, &folder, change).unwrap_or_else(|error| panic!("{error}"));
        Simulation::of(&files, &board, &wiring, &folder.join("simulation")).unwrap_or_else(|e| panic!("{e}"))
    };
    assert_eq!(first_difference(circuit(), simulated(&|_| ())), None);
    let faulty = simulated(&|cells| invert_a_table(cells, models, "u_motor"));
    assert!(first_difference(circuit(), faulty).is_some(), "the planted fault was not noticed");
}

#[test]
fn the_routed_design_on_an_icebreaker_drives_the_same_pins() {
    routed_pins_are_those_of_the_circuit("icebreaker");
}

#[test]
fn the_routed_design_on_a_tang_nano_drives_the_same_pins() {
    routed_pins_are_those_of_the_circuit("tang-nano-9k");
}

/// The first run of a drive by step and direction in which two boards' output pins differ. The motor turns as the PWM drives it.
fn first_difference(mut one: Simulation, mut other: Simulation) -> Option<u32> {
    let (mut position, mut drove) = (0, 0);
    for run in 0..600 {
        let high = one.output("motor_high").expect("a pin").1 as i32;
        let low = one.output("motor_low").expect("a pin").1 as i32;
        let moves = if high + low > 0 { (high - 600) / 40 } else { 0 };
        for board in [&mut one, &mut other] {
            let pins = ["encoder_a", "encoder_b"].map(|pin| board.input(pin).expect("a pin"));
            board.turns = vec![EncoderMotion { pins, from: position, by: moves }];
            board.set("wanted_direction", run % 200 < 120);
            board.set("wanted_step", run % 2 == 0);
            // The button, of a board that has one, is not pressed, but for a while.
            board.set("button", !(300..310).contains(&run));
            board.run(1200, &[]).expect("it runs");
        }
        position += moves;
        let levels = |board: &Simulation| board.output_levels().collect::<Vec<_>>();
        if run > 0 && levels(&one) != levels(&other) {
            return Some(run);
        }
        drove += i32::from(moves != 0);
    }
    assert!(drove > 50, "the motor has turned in {drove} runs");
    None
}

/// The tools' environment that `TAKT_VENV` names, or `.venv`, with the tools of a board.
fn tools(board: &Board) -> Venv {
    let folder = std::env::var_os("TAKT_VENV")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.venv"), PathBuf::from);
    Venv::with(&folder, &build::packages(board).expect("tools")).unwrap_or_else(|error| panic!("{error}"))
}

/// Inverts a table of the logic of a part of the circuit.
fn invert_a_table(cells: &mut serde_json::Map<String, serde_json::Value>, models: &Models, part: &str) {
    let mut own = cells.iter_mut().filter(|(name, _)| name.contains(part)).map(|(_, cell)| cell);
    let table = own.find_map(|cell| (models.truth_table)(cell)).expect("the part has logic");
    let bits = table.as_str().expect("a table").chars();
    let inverted: String = bits.map(|bit| if bit == '0' { '1' } else { '0' }).collect();
    *table = inverted.into();
}

/// Tests everything that the board has to do, from power-up on.
pub(crate) fn runs_talks_and_fails_safe(mut sim: Simulation, wiring: &Wiring, first: &Program) {
    let encoder = [sim.input("encoder_a").expect("a pin"), sim.input("encoder_b").expect("a pin")];
    drives_after_power_up(&mut sim, encoder);
    let bounds = takt_analysis::bound(first).expect("it can be bounded");
    let ways = latency::ways(wiring, &Application::from(first), &[bounds]).expect("it has a period");
    let way = &ways.ways[0];
    pins_follow_as_the_bound_says(&mut sim, way, encoder);
    glitches_are_not_counted(&mut sim);
    let mut host = Host::connect(sim, 77).unwrap_or_else(|error| panic!("{error}"));
    ports_are_read_and_set(&mut host, first, way);
    other_addresses_are_refused(&mut host, first);
    periods_are_stepped_and_streamed(&mut host, first);
    noise_loses_no_step(&mut host);
    a_start_follows_silence(&mut host, first);
    stop_and_reset_make_outputs_safe(&mut host);
    wrong_programs_make_outputs_safe(&mut host, first);
}

fn drives_after_power_up(sim: &mut Simulation, encoder: [usize; 2]) {
    // From power-up, without a host: safe, then it drives. The encoder stands at 0, so half of the time each way.
    sim.run(1000, &[]).expect("it runs");
    assert_eq!(sim.output("signal_drive"), Some((false, 0)), "before the first period");
    periods(sim, 10);
    assert_eq!(sim.output("signal_drive").map(|(level, _)| level), Some(true), "it drives");
    assert_eq!(pulse(sim), 250 - 5, "half of the time, less the dead time");

    // The loop through the pins: 40 counts forward are a force of -10, which is 160 cycles less.
    sim.turns.push(EncoderMotion { pins: encoder, from: 0, by: 40 });
    periods(sim, 3);
    periods(sim, 3);
    assert_eq!(pulse(sim), 250 - 160 - 5);
}

/// From pin to pin, in cycles: with an edge that is counted just before a tick, and one that is counted just after it.
fn pins_follow_as_the_bound_says(sim: &mut Simulation, way: &PinPath, encoder: [usize; 2]) {
    let [edge, lamp] = [&way.inputs[0].parts, &way.outputs[1].parts];
    let bound = Part::sum("", edge.iter().chain(&way.between).chain(lamp));
    let ticks = Ticks::of(sim, PERIOD);
    for (before, from, cycles) in [(edge[0].best, 40, bound.best), (edge[0].best - 1, 41, bound.worst)] {
        let turn = |sim: &mut Simulation| sim.turns.push(EncoderMotion { pins: encoder, from, by: 1 });
        assert_eq!(ticks.measured(sim, before, turn, "lamp_out"), cycles);
    }
    sim.turns.push(EncoderMotion { pins: encoder, from: 42, by: -2 });
    periods(sim, 2);
}

/// Glitches shorter than the filter are not counted.
fn glitches_are_not_counted(sim: &mut Simulation) {
    for _ in 0..5 {
        sim.set("encoder_a", true);
        sim.run(2, &[]).expect("it runs");
        sim.set("encoder_a", false);
        sim.run(7, &[]).expect("it runs");
    }
}

/// The host reads ports and sets them.
fn ports_are_read_and_set(host: &mut Host<Simulation>, first: &Program, way: &PinPath) {
    assert!(host.status().expect("status").drives());
    assert_eq!(host.read(port(first, "n"), 1).expect("a port")[0], 40);
    assert_eq!(host.read(port(first, "force"), 1).expect("a port")[0], (-10.0_f32).to_bits());
    host.write(port(first, "wanted"), &[52]).expect("a port");
    periods(&mut host.line, 4);
    assert_eq!(host.read(port(first, "force"), 1).expect("a port")[0], 3.0_f32.to_bits());
    assert_eq!(pulse(&mut host.line), 250 + 48 - 5);
    let cycles = host.register("cycles").expect("a register");
    // The first of these parts, the wait for the tick, is not counted.
    let exact = Part::sum("", &way.between[1..]);
    assert_eq!((exact.best, exact.worst), (cycles.into(), cycles.into()), "cycles from tick to outputs");
    assert_eq!(host.register("misses").expect("a register"), 0);
}

/// A write to an address that cannot be written is refused as a whole: read-only registers, and addresses without one; ports that the
/// program or a peripheral drives, and the last port, which the machine does not have; the image of a running program; a tick of the
/// host's own while the program is not held, with two writable registers before it; memories of the core.
fn other_addresses_are_refused(host: &mut Host<Simulation>, first: &Program) {
    let n = port(first, "n");
    for address in [0, 2, 9, 20, 0xfff, port(first, "force"), n, INPUTS + 255, INPUTS + 256, 0x3000] {
        refuses(host, address, &[1]);
    }
    for (address, words) in
        [(4, &[9999, 5, 1][..]), (12, &[1]), (IMAGE, &[1, 2, 3, 0]), (0x8000, &[7]), (0xc000, &[7])]
    {
        refuses(host, address, words);
    }
    assert!((INPUTS..n + 2).contains(&port(first, "wanted")), "next to `n`");
    refuses(host, n.min(port(first, "wanted")), &[7, 7]);
    assert_eq!(host.read(port(first, "wanted"), 1).expect("a port")[0], 52);
}

fn periods_are_stepped_and_streamed(host: &mut Host<Simulation>, first: &Program) {
    // Hold, then one period at a time.
    host.set("control", 0b111).expect("control");
    let before = host.register("periods").expect("a register");
    periods(&mut host.line, 5);
    assert_eq!(host.register("periods").expect("a register"), before);
    host.set("step", 1).expect("step");
    assert_eq!(host.register("periods").expect("a register"), before + 1);
    host.set("control", 0b101).expect("control");

    // A stream: every second period, with its number.
    host.set("stream", 2 << 20 | 1 << 16 | u32::from(port(first, "force"))).expect("stream");
    let mut seen = Vec::new();
    while seen.len() < 6 {
        if let Some(frame) = host.streamed().expect("a line") {
            assert_eq!(frame.words[1], 3.0_f32.to_bits());
            seen.push(frame.words[0]);
        }
    }
    assert!(seen.windows(2).all(|pair| pair[1] == pair[0] + 2), "{seen:?}");
    host.set("stream", 0).expect("stream");
}

/// Noise on the line: requests are repeated, and none is lost or carried out twice.
fn noise_loses_no_step(host: &mut Host<Simulation>) {
    host.line.noise = 400;
    host.set("control", 0b111).expect("control");
    let before = host.register("periods").expect("a register");
    for _ in 0..40 {
        host.set("step", 1).expect("in spite of noise");
    }
    assert_eq!(host.register("periods").expect("a register"), before + 40);
    host.set("control", 0b101).expect("control");
    host.line.noise = 0;
    assert!(host.retries > 0, "there was no noise");
    assert!(host.register("errors").expect("a register") > 0);
}

fn a_start_follows_silence(host: &mut Host<Simulation>, first: &Program) {
    // The host is gone.
    host.line.unplugged = true;
    periods(&mut host.line, 420);
    assert!(safe(&mut host.line), "without a host");
    assert!(matches!(host.register("id"), Err(LinkError::Silence(_))));
    host.line.unplugged = false;
    let status = host.status().expect("it is back");
    assert_eq!(status.causes().collect::<Vec<_>>(), ["host silent"]);
    // A start lets the board drive again. A value set immediately waits until the start's zeros are written.
    host.set("control", 0x105).expect("control");
    host.write(port(first, "wanted"), &[52]).expect("a port");
    assert_eq!(host.read(port(first, "wanted"), 1).expect("a port")[0], 52);
    periods(&mut host.line, 5);
    assert!(host.status().expect("status").drives());
}

fn stop_and_reset_make_outputs_safe(host: &mut Host<Simulation>) {
    // The stop input.
    host.line.set("signal_stop", true);
    periods(&mut host.line, 1);
    assert!(safe(&mut host.line), "stopped");
    host.line.set("signal_stop", false);
    assert!(safe(&mut host.line), "and it stays so");
    assert_eq!(host.status().expect("status").causes().collect::<Vec<_>>(), ["stop"]);

    // Reset in mid-period: pins are safe at once, and the machine starts from the beginning.
    host.set("control", 0x105).expect("control");
    periods(&mut host.line, 5);
    host.line.run(37, &[]).expect("it runs");
    host.line.set("button", true);
    host.line.run(10, &[]).expect("it runs");
    assert!(safe(&mut host.line), "in reset");
    host.line.set("button", false);
    periods(&mut host.line, 6);
    assert!(host.status().expect("status").drives(), "after a reset");
}

fn wrong_programs_make_outputs_safe(host: &mut Host<Simulation>, first: &Program) {
    // Programs that miss their deadlines, halt, or compute a NaN.
    host.set("control", 0).expect("control");
    refuses(host, IMAGE + 4 * top::RECORDS as u16, &[1, 2, 3, 0]);
    let instead = |what: &str| PROGRAM.replace("        iand    lit, n, 1\n", what);
    let nan = PROGRAM.replace("fmul    force, f, 0.25", "fdiv    force, zero, zero");
    for (source, cause) in
        [(instead(SLOW), "missed deadline"), (instead("        halt\n"), "halt"), (nan, "NaN output")]
    {
        let records = top::image(&program(&source)).expect("it fits").records;
        host.load(&records).expect("it is loaded");
        assert!(safe(&mut host.line), "while it is loaded");
        host.set("control", 5).expect("control");
        periods(&mut host.line, 8);
        assert!(safe(&mut host.line), "{cause}");
        let status = host.status().expect("status");
        assert!(
            status.causes().any(|name| name == cause),
            "{cause}: {:?}",
            status.causes().collect::<Vec<_>>()
        );
    }
    assert!(host.register("misses").expect("a register") == 0, "of this program, none");
    // The first program again.
    host.load(&top::image(first).expect("it fits").records).expect("it is loaded");
    host.set("control", 5).expect("control");
    periods(&mut host.line, 6);
    assert!(host.status().expect("status").drives());
    // An invalid image: an image that does not fit is refused before anything happens.
    let record = top::image(first).expect("it fits").records[0];
    let error = host.load(&vec![record; top::RECORDS + 1]).expect_err("too big");
    assert_eq!(error.to_string(), "the program takes 2049 records; the board has room for 2048");
}
