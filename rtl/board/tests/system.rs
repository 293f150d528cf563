// SPDX-License-Identifier: MIT OR Apache-2.0
//! A system of three cores on a board, complete in Verilator: the example `programs/examples/board/axis`, with the real host at its UART.

use crate::harness::board::{Ticks, refuses};
use std::panic::AssertUnwindSafe;
use std::path::Path;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::endpoints::{Endpoints, Fifo};
use takt_board::latency::{Part, ways};
use takt_board::protocol::{IMAGE, LinkError};
use takt_board::simulation::{EncoderMotion, Simulation};
use takt_board::{Application, Board, Host, Wiring, top};
use takt_isa::Program;
use takt_rtl::verilator;
use takt_system::{Description, LinkKind, ProgramError, Request, System};

const SYSTEM: &str = include_str!("../../../programs/examples/board/axis/axis.toml");
const SOURCES: [(&str, &str); 3] = [
    ("profile.s", include_str!("../../../programs/examples/board/axis/profile.s")),
    ("servo.s", include_str!("../../../programs/examples/board/axis/servo.s")),
    ("watch.s", include_str!("../../../programs/examples/board/axis/watch.s")),
];

/// The example's wiring, with every condition that makes outputs safe.
fn wiring_text() -> String {
    let text = include_str!("../../../programs/examples/board/axis/wiring.toml");
    text.replace("baud = 1_000_000", "baud = 10_000_000\ndeadlines = 2")
        .replace("host = 0 ", "host = 60 ")
        .replace("[signals]", "[signals]\ndeadline = \"gp12\"\ntick = \"gp13\"\nstop = \"gn10\"")
}

/// Cycles of a base tick.
const PERIOD: u32 = 5000;
/// Half a period of the PWM, its dead time, and its steps for 1.0, in cycles.
const PWM: (i32, i32, f32) = (1250, 25, 1024.0);

fn program(name: &str, source: &str, request: &Request<'_>) -> Program {
    let loader = MemoryLoader::new(&[(name, source)]);
    let options = Options { machine: request.machine.expect("the file says it"), ..Options::default() };
    assemble(name, &loader, &options).unwrap_or_else(|error| panic!("{error:?}")).program
}

/// The system, with some of its sources changed.
fn system(change: &dyn Fn(&str, &str) -> String) -> Description {
    let read = takt_system::read("axis.toml", SYSTEM, |request: &Request<'_>| {
        let (name, source) = SOURCES.iter().find(|(name, _)| *name == request.path).expect("a source");
        Ok::<_, ProgramError<()>>(program(name, &change(name, source), request))
    });
    read.unwrap_or_else(|_| panic!("the system is right"))
}

pub(crate) fn unchanged() -> Description {
    system(&|_, source| source.to_owned())
}

pub(crate) fn ulx3s() -> Board {
    Board::from_name("ulx3s-85f").expect("a board").expect("a right one")
}

pub(crate) fn wiring(description: &Description) -> Wiring {
    wiring_with(description, "")
}

/// The wiring with more tables.
pub(crate) fn wiring_with(description: &Description, more: &str) -> Wiring {
    let text = wiring_text() + more;
    let wiring = Wiring::read("wiring.toml", &text, &ulx3s()).expect("a right wiring");
    wiring.check("wiring.toml", &text, description).expect("ports fit");
    wiring
}

/// A board with the system, from power-up on.
pub(crate) fn board(description: &Description, folder: &str) -> Simulation {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let sim = Simulation::new(&ulx3s(), &wiring(description), description, &folder);
    sim.unwrap_or_else(|error| panic!("{error}"))
}

fn periods(board: &mut Simulation, count: u32) {
    board.run(count * PERIOD, &[]).expect("it runs");
}

pub(crate) fn safe(board: &mut Simulation) -> bool {
    periods(board, 1);
    let level = |name: &str| board.output(name).expect("a pin");
    ["signal_drive", "motor_high", "motor_low", "lamp_out"].iter().all(|name| level(name) == (false, 0))
}

/// Cycles of a period of the PWM in which the upper switch conducts.
fn pulse(board: &mut Simulation) -> i32 {
    board.run(2 * PWM.0 as u32, &[]).expect("it runs");
    board.output("motor_high").expect("a pin").1 as i32
}

/// The pulse that belongs to an error.
fn expected(error: f32) -> i32 {
    let duty = (error * 0.02).clamp(-1.0, 1.0);
    PWM.0 + (duty * PWM.2).round_ties_even() as i32 - PWM.1
}

pub(crate) struct Names {
    description: Description,
    pub(crate) ends: Endpoints,
}

impl Names {
    pub(crate) fn of(description: &Description) -> Names {
        Names { description: description.clone(), ends: Endpoints::of(description) }
    }

    pub(crate) fn at(&self, name: &str) -> u16 {
        Application::from(&self.description).find(name).unwrap_or_else(|error| panic!("{error}")).read
    }

    pub(crate) fn set(&self, name: &str) -> u16 {
        Application::from(&self.description).settable(name).unwrap_or_else(|error| panic!("{error}")).0
    }

    pub(crate) fn fifo(&self, name: &str, to_host: bool) -> Fifo {
        self.ends.fifo(name, to_host).unwrap_or_else(|error| panic!("{error}")).clone()
    }

    fn read(&self, host: &mut Host<Simulation>, name: &str) -> u32 {
        host.read(self.at(name), 1).unwrap_or_else(|error| panic!("{name}: {error}"))[0]
    }
}

fn connect(sim: Simulation) -> Host<Simulation> {
    Host::connect(sim, 77).unwrap_or_else(|error| panic!("{error}"))
}

fn float(value: f32) -> u32 {
    value.to_bits()
}

/// Cycles from an edge of the encoder, `before` cycles before a tick, to the first cycle in which the PWM's pulse differs from the period
/// before.
fn measured_of_pulse(ticks: &Ticks, board: &mut Simulation, before: u64, turn: EncoderMotion) -> u64 {
    let period = 2 * PWM.0 as u32;
    ticks.run_to(board, before, period);
    let is_high = |board: &mut Simulation| {
        board.run(1, &[]).expect("it runs");
        board.output("motor_high").expect("a pin").1 == 1
    };
    let mut levels: Vec<bool> = (0..period).map(|_| is_high(board)).collect();
    board.turns.push(turn);
    let differs = |cycle: &usize| {
        levels.push(is_high(board));
        levels[cycle + period as usize] != levels[*cycle]
    };
    (0..4 * PERIOD as usize).find(differs).expect("the motor follows") as u64
}

/// Measures from an edge of the encoder, which stands at 0, to the edges of motor and lamp, in many phases to the ticks.
fn pins_follow_as_the_bound_says(host: &mut Host<Simulation>, description: &Description, pins: [usize; 2]) {
    let bound = |core: &takt_system::Core| takt_analysis::bound(&core.program).expect("it can be bounded");
    let bounds: Vec<_> = description.cores.iter().map(bound).collect();
    let ways = ways(&wiring(description), &Application::from(description), &bounds).expect("few ways");
    let [motor, lamp] = &ways.ways[..] else { panic!("{:?}", ways.ways) };
    assert_eq!((motor.cores.join(" "), lamp.cores.join(" ")), ("servo".into(), "servo watch".into()));
    let edge = lamp.inputs[0].parts[0].best;
    let (ticks, mut count) = (Ticks::of(&mut host.line, PERIOD), 0);
    // The phases include both of the base ticks that a tick of the watch follows.
    let mut all = |before: &[u64], measured: &dyn Fn(&mut Simulation, u64, EncoderMotion) -> u64| {
        let phases = before.iter().flat_map(|&before| [(before, 0), (before, 1)]);
        let cycles = phases.map(|(before, more)| {
            // The host sends a request, so that outputs drive.
            assert!(host.status().expect("status").drives());
            periods(&mut host.line, more);
            let by = if count == 0 { 1 } else { -1 };
            let cycles = measured(&mut host.line, before, EncoderMotion { pins, from: count, by });
            count += by;
            periods(&mut host.line, 2);
            cycles
        });
        let cycles: Vec<u64> = cycles.collect();
        (*cycles.iter().min().expect("some"), *cycles.iter().max().expect("some"))
    };
    // The edge comes just in time for a tick, just too late, and between.
    let total = lamp.total().expect("an edge");
    let found = all(&[edge, edge - 1, 4999, 4000, 2600, 2500, 1234, 400, 20], &|sim, before, turn| {
        ticks.measured(sim, before, |sim| sim.turns.push(turn), "lamp_out")
    });
    assert_eq!(found, (total.best, total.worst));
    // Base ticks are a whole number of the PWM's periods apart, so values always come at the same place of a period.
    let (fixed, pwm) =
        (Part::sum("", motor.inputs[0].parts.iter().chain(&motor.between)), motor.total().expect("an edge"));
    let (least, most) =
        all(&[edge, edge - 1], &|sim, before, turn| measured_of_pulse(&ticks, sim, before, turn));
    assert!(least >= pwm.best && most <= pwm.worst, "{least} to {most}, and not {pwm:?}");
    assert_eq!(most - least, fixed.worst - fixed.best, "{least} to {most}");
}

#[test]
fn a_system_runs_talks_and_fails_safe() {
    let description = unchanged();
    let names = Names::of(&description);
    let mut sim = board(&description, "system-board");
    let encoder = [sim.input("encoder_a").expect("a pin"), sim.input("encoder_b").expect("a pin")];
    drives_after_power_up(&mut sim);
    let mut host = connect(sim);
    pins_follow_as_the_bound_says(&mut host, &description, encoder);
    ports_are_read_and_set(&mut host, &description, &names, encoder);
    let fifos = Fifos { moves: names.fifo("moves", false), reached: names.fifo("reached", true) };
    moves_end_in_order(&mut host, &names, &fifos);
    other_addresses_are_refused(&mut host, &names, &fifos);
    periods_are_counted_and_streamed(&mut host, &names);
    noise_loses_no_entry(&mut host, &fifos);
    full_fifos_refuse_entries(&mut host, &fifos);
    a_start_follows_silence(&mut host, &names, &fifos);
    stop_and_reset_make_outputs_safe(&mut host);
    wrong_programs_make_outputs_safe(&mut host, &names, &fifos);
    an_entry_starts_base_ticks(&mut host, &fifos);
    other_systems_are_refused(&mut host, &description);
}

/// FIFOs between host and system.
struct Fifos {
    moves: Fifo,
    reached: Fifo,
}

/// A register of each core.
fn registers(host: &mut Host<Simulation>, name: &str) -> [u32; 3] {
    [0, 1, 2].map(|core| host.register_of(core, name).expect("a register"))
}

fn causes(host: &mut Host<Simulation>, core: usize) -> Vec<&'static str> {
    host.status_of(core).expect("status").causes().collect()
}

/// The system with a text of one source replaced.
fn in_place(of: &str, from: &str, to: &str) -> Description {
    system(&|name, source| if name == of { source.replace(from, to) } else { source.to_owned() })
}

/// After power-up, without a host, the board is safe; then it drives, with an error of 0.
fn drives_after_power_up(sim: &mut Simulation) {
    sim.run(1000, &[]).expect("it runs");
    assert_eq!(sim.output("signal_drive"), Some((false, 0)), "before the first periods");
    periods(sim, 10);
    assert_eq!(sim.output("signal_drive").map(|(level, _)| level), Some(true), "it drives");
    assert_eq!(pulse(sim), expected(0.0));
}

fn ports_are_read_and_set(
    host: &mut Host<Simulation>,
    description: &Description,
    names: &Names,
    encoder: [usize; 2],
) {
    // The loop through the pins is closed: the servo reads the encoder, and the watch lights the lamp.
    host.line.turns.push(EncoderMotion { pins: encoder, from: 0, by: 20 });
    periods(&mut host.line, 3);
    periods(&mut host.line, 3);
    assert_eq!(pulse(&mut host.line), expected(-20.0));
    assert_eq!(host.line.output("lamp_out").map(|(level, _)| level), Some(true));

    // The host reads and sets ports of each core, and the values that the host drives.
    assert_eq!(host.cores, 3);
    host.fits(description).expect("it is this system's circuit");
    assert!((0..3).all(|core| host.status_of(core).expect("status").drives()));
    assert_eq!(names.read(host, "servo.n"), 20);
    assert_eq!(names.read(host, "n"), 20, "the wire that the encoder drives");
    assert_eq!(names.read(host, "servo.error"), float(-20.0));
    assert_eq!(names.read(host, "watch.error"), float(-20.0));
    assert_eq!(names.read(host, "seen.peak"), float(20.0));
    assert_eq!(names.read(host, "watch.limit"), 0);
    host.write(names.set("watch.limit"), &[float(25.0)]).expect("a port");
    periods(&mut host.line, 4);
    assert_eq!(names.read(host, "watch.limit"), float(25.0));
    assert_eq!(host.line.output("lamp_out").map(|(level, _)| level), Some(false), "below the limit");
}

/// Two moves go into a FIFO, and the places where they end come out of another.
fn moves_end_in_order(host: &mut Host<Simulation>, names: &Names, fifos: &Fifos) {
    assert_eq!(host.pop(&fifos.reached).expect("a FIFO"), None);
    for target in [10.0, 15.0] {
        assert!(host.push(&fifos.moves, &[float(target), float(5.0)]).expect("a FIFO"));
    }
    periods(&mut host.line, 6);
    assert_eq!(names.read(host, "profile.wanted"), float(15.0));
    assert_eq!(pulse(&mut host.line), expected(-5.0));
    assert_eq!(host.fifo(&fifos.reached).expect("a FIFO").count(), 2);
    assert_eq!(host.pop(&fifos.reached).expect("a FIFO"), Some(vec![float(10.0)]));
    assert_eq!(host.pop(&fifos.reached).expect("a FIFO"), Some(vec![float(15.0)]));
    assert_eq!(host.pop(&fifos.reached).expect("a FIFO"), None);
}

/// A write to an address that cannot be written is refused: registers, a core's ports, a value that the encoder drives or that a link
/// brings, a FIFO's status, the fields of a FIFO to the host, the image of a running program.
fn other_addresses_are_refused(host: &mut Host<Simulation>, names: &Names, fifos: &Fifos) {
    let drives = names.at("n");
    for address in [0, 15, 16, 0x102, names.at("servo.n"), drives, names.at("watch.lit"), 0x3400, 0x8000] {
        refuses(host, address, &[1]);
    }
    for address in [fifos.moves.address, fifos.reached.address, fifos.reached.field(0), IMAGE] {
        refuses(host, address, &[1]);
    }
}

fn periods_are_counted_and_streamed(host: &mut Host<Simulation>, names: &Names) {
    // Each core has counters: the watch has every second base tick.
    let counted = registers(host, "periods");
    assert!(counted[0].abs_diff(2 * counted[2]) <= 4 && counted[0].abs_diff(counted[1]) <= 2, "{counted:?}");
    assert_eq!(registers(host, "misses"), [0; 3]);

    // The stream carries a core's port.
    host.set("stream", 2 << 20 | 1 << 16 | u32::from(names.at("watch.values"))).expect("stream");
    let mut seen = Vec::new();
    while seen.len() < 4 {
        if let Some(frame) = host.streamed().expect("a line") {
            seen.push((frame.words[0], frame.words[1]));
        }
    }
    assert!(seen.windows(2).all(|pair| pair[1].0 == pair[0].0 + 2 && pair[1].1 == pair[0].1 + 2), "{seen:?}");
    assert!(seen.iter().all(|(period, values)| period == values), "periods are the watch's: {seen:?}");
    host.set("stream", 0).expect("stream");
}

/// Noise on the line loses no entry, and no entry goes in or comes out twice.
fn noise_loses_no_entry(host: &mut Host<Simulation>, fifos: &Fifos) {
    host.line.noise = 300;
    let mut ended = Vec::new();
    for target in 0..24 {
        while !host.push(&fifos.moves, &[float(target as f32), float(50.0)]).expect("in spite of noise") {
            periods(&mut host.line, 1);
        }
        periods(&mut host.line, 1);
        while let Some(entry) = host.pop(&fifos.reached).expect("in spite of noise") {
            ended.push(entry[0]);
        }
    }
    host.line.noise = 0;
    periods(&mut host.line, 6);
    while let Some(entry) = host.pop(&fifos.reached).expect("a FIFO") {
        ended.push(entry[0]);
    }
    assert_eq!(ended, (0..24).map(|target| float(target as f32)).collect::<Vec<_>>());
    assert!(host.retries > 0, "there was no noise");
    assert!(!host.fifo(&fifos.reached).expect("a FIFO").overflow());
}

/// A FIFO that nobody empties refuses an entry and reports it; so does a full FIFO.
fn full_fifos_refuse_entries(host: &mut Host<Simulation>, fifos: &Fifos) {
    host.set("control", 0b111).expect("hold");
    let pushed =
        (0..6).filter(|_| host.push(&fifos.moves, &[float(1.0), float(9.0)]).expect("a FIFO")).count();
    assert_eq!(pushed, 4);
    let status = host.fifo(&fifos.moves).expect("a FIFO");
    assert!(status.full() && !status.overflow() && status.count() == 4, "{status:?}");
    host.set("control", 0b101).expect("go");
    periods(&mut host.line, 8);
    assert!(host.fifo(&fifos.reached).expect("a FIFO").overflow(), "depth 2, four moves");
}

fn a_start_follows_silence(host: &mut Host<Simulation>, names: &Names, fifos: &Fifos) {
    // The host is gone.
    host.line.unplugged = true;
    periods(&mut host.line, 70);
    assert!(safe(&mut host.line), "without a host");
    host.line.unplugged = false;
    assert_eq!(causes(host, 1), ["host silent"]);
    // A start empties FIFOs, and clears the values that the host had set. A value that the host sets at once waits until all is loaded.
    host.set("control", 0x105).expect("control");
    host.write(names.set("limit"), &[float(7.0)]).expect("a port");
    assert_eq!(names.read(host, "limit"), float(7.0));
    assert!(host.fifo(&fifos.moves).expect("a FIFO").empty());
    periods(&mut host.line, 6);
    assert!(host.status().expect("status").drives());
    assert_eq!(names.read(host, "watch.limit"), float(7.0));
}

/// The stop input makes outputs safe, and so does a reset in mid-period.
fn stop_and_reset_make_outputs_safe(host: &mut Host<Simulation>) {
    host.line.set("signal_stop", true);
    periods(&mut host.line, 1);
    assert!(safe(&mut host.line), "stopped");
    host.line.set("signal_stop", false);
    assert_eq!(causes(host, 2), ["stop"]);
    host.set("control", 0x105).expect("control");
    periods(&mut host.line, 5);
    host.line.run(1037, &[]).expect("it runs");
    host.line.set("button", true);
    host.line.run(10, &[]).expect("it runs");
    assert!(safe(&mut host.line), "in reset");
    host.line.set("button", false);
    periods(&mut host.line, 6);
    assert!(host.status().expect("status").drives(), "after a reset");
}

/// Systems with a program that faults, halts, misses its deadline or computes a NaN: the core, and the cause in its status.
fn wrong_programs() -> [(Description, usize, &'static str); 4] {
    let slow = "        mov     k, 9000\nagain:  isub    k, k, 1\n        bnz     k, again\n        wait    period\n";
    [
        (in_place("watch.s", "        flt     lit, limit, a\n", "        ret\n"), 2, "fault"),
        (in_place("profile.s", "        bnz     empty, idle\n", "        halt\n"), 0, "halt"),
        (
            in_place(
                "watch.s",
                ".reg    a\n",
                &format!(".reg    a k:int\n{}", slow.replace("        wait    period\n", "")),
            ),
            2,
            "missed deadline",
        ),
        (
            in_place(
                "servo.s",
                "        wait    period\n",
                "        fdiv    duty, zero, zero\n        wait    period\n",
            ),
            1,
            "NaN output",
        ),
    ]
}

/// With other programs in the same circuit, each core's fault, halt, missed deadline or NaN makes outputs safe, and the status says the
/// cause.
fn wrong_programs_make_outputs_safe(host: &mut Host<Simulation>, names: &Names, fifos: &Fifos) {
    for (other, core, cause) in wrong_programs() {
        host.fits(&other).expect("the circuit is the same");
        host.load(&top::image(&other).expect("it fits").records).expect("it is loaded");
        assert!(safe(&mut host.line), "while it is loaded");
        assert!(matches!(host.push(&fifos.moves, &[0, 0]), Err(LinkError::Stopped)), "entries would be lost");
        host.set("control", 5).expect("control");
        periods(&mut host.line, 12);
        assert!(safe(&mut host.line), "{cause}");
        for each in 0..3 {
            let found = causes(host, each);
            assert_eq!(found.contains(&cause), each == core, "{cause}: core {each}: {found:?}");
        }
        let status = host.status_of(core).expect("status");
        assert_eq!((status.fault(), status.halted()), (cause == "fault", cause == "halt"));
        // The host can read ports of a core that has stopped, and of the other cores, but no ports of a core that never waits.
        let is_late = |name: &str| cause == "missed deadline" && name == "watch.peak";
        for name in ["profile.wanted", "servo.n", "watch.peak"].into_iter().filter(|name| !is_late(name)) {
            names.read(host, name);
        }
        let misses = registers(host, "misses");
        // Every tick comes too early to a core that has halted.
        assert_eq!(misses[core] > 1, ["missed deadline", "halt"].contains(&cause), "{cause}: {misses:?}");
    }
}

/// A core waits for an entry before its first period: the host can push an entry, and then base ticks begin.
fn an_entry_starts_base_ticks(host: &mut Host<Simulation>, fifos: &Fifos) {
    let first = "        mov     wanted, zero\n";
    let waits = in_place("profile.s", first, &format!("{first}boot:   bnz     empty, boot\n"));
    host.load(&top::image(&waits).expect("it fits").records).expect("it is loaded");
    host.set("control", 5).expect("control");
    periods(&mut host.line, 6);
    assert_eq!(registers(host, "periods"), [0; 3]);
    assert!(host.push(&fifos.moves, &[float(4.0), float(4.0)]).expect("a FIFO"));
    periods(&mut host.line, 6);
    assert!(host.status().expect("status").drives());
    assert_eq!(host.pop(&fifos.reached).expect("a FIFO"), Some(vec![float(4.0)]));
}

/// The board has the first programs again, and another system's programs are refused before anything happens.
fn other_systems_are_refused(host: &mut Host<Simulation>, description: &Description) {
    host.load(&top::image(description).expect("it fits").records).expect("it is loaded");
    host.set("control", 5).expect("control");
    periods(&mut host.line, 12);
    assert!(host.status().expect("status").drives());
    let mut other = description.clone();
    for link in &mut other.links {
        if let LinkKind::Fifo { depth, .. } = &mut link.kind {
            *depth += 1;
        }
    }
    assert!(matches!(host.fits(&other), Err(LinkError::OtherCircuit)));
    let single = &description.cores[0].program;
    assert!(matches!(host.fits(&**single), Err(LinkError::OtherCores { there: 3, wanted: 1 })));
}

/// Compares board and emulator, a base tick at a time, with the same inputs and noise on the UART: every output port of every core, the
/// values that the host sees and the entries that it pops have the same words, and the PWM has the pulse that belongs to the words.
fn compare(description: &Description, sim: Simulation, ticks: u32) {
    let names = Names::of(description);
    let mut host = connect(sim);
    host.line.noise = 1000;
    let encoder = ["encoder_a", "encoder_b"].map(|pin| host.line.input(pin).expect("a pin"));
    // The board is held from the beginning on.
    host.set("control", 0x107).expect("control");
    let mut system = System::new(description).expect("it can be emulated");
    let start = system.run_to_start(1 << 20).expect("no fault").expect("it starts");
    let mut next = start - description.lead();
    let (moves, reached) = (names.fifo("moves", false), names.fifo("reached", true));
    let (mut seed, mut position) = (1_u32, 0_i32);
    let mut chance = |most: u32| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) % most
    };
    let mut compared = 0;
    for tick in 0..ticks {
        let by = chance(25) as i32 - 12;
        host.line.turns.push(EncoderMotion { pins: encoder, from: position, by });
        host.line.run(3000, &[]).expect("it runs");
        position += by;
        let limit = float(chance(200) as f32 / 16.0);
        host.write(names.set("limit"), &[limit]).expect("a port");
        system.run_until(next).expect("no fault");
        system.set_input("n", position as u32).expect("an input");
        system.set_input("limit", limit).expect("an input");
        if chance(3) == 0 {
            let entry = [float(chance(99) as f32 / 4.0), float(chance(40) as f32 / 8.0 + 0.5)];
            for (name, value) in ["moves.target", "moves.rate"].into_iter().zip(entry) {
                system.set_input(name, value).expect("an input");
            }
            let room = host.push(&moves, &entry).expect("a FIFO");
            if room {
                assert!(system.push(moves.link).expect("a FIFO"), "tick {tick}");
            }
        }
        host.set("step", 1).expect("step");
        next += description.tick;
        system.run_until(next).expect("no fault");
        for (number, core) in description.cores.iter().enumerate() {
            for port in &core.program.outputs {
                let name = format!("{}.{}", core.name, port.name);
                let circuit = names.read(&mut host, &name);
                // A port that was never written may hold any value.
                if let Some(emulated) = system.core(number).output_bits(port.register) {
                    assert_eq!(circuit, emulated, "tick {tick}: {name}");
                    compared += 1;
                }
            }
        }
        let error = f32::from_bits(names.read(&mut host, "servo.error"));
        // The PWM takes the new duty with its next period.
        pulse(&mut host.line);
        let pulse = pulse(&mut host.line);
        // Outputs drive from the end of the first periods on, and take on the values that come after it.
        assert!(tick == 0 || pulse == expected(error), "tick {tick}: error {error}: {pulse}");
        for end in &names.ends.outputs {
            let emulated = system.output(&end.name).expect("an output");
            assert_eq!(names.read(&mut host, &end.name), emulated, "tick {tick}: {}", end.name);
        }
        if chance(2) == 0 {
            let emulated = system.pop(reached.link).expect("a FIFO");
            assert_eq!(host.pop(&reached).expect("a FIFO"), emulated, "tick {tick}");
        }
    }
    assert!(compared > 6 * ticks, "{compared}");
    // At the end, the host compares all registers and data words of each core, in answers so long that noise would break most of them.
    host.line.noise = 0;
    let on_board = Application::from(description);
    for (number, core) in description.cores.iter().enumerate() {
        let machine = core.program.machine;
        let emulator = system.core(number);
        for slot in machine.slots {
            let first = slot.bank.registers().next().expect("a bank has registers");
            let at = on_board.register(number, first).expect("it can be read");
            let read = host.read(at, slot.bank.depth.into()).expect("a bank");
            for (register, bits) in slot.bank.registers().zip(read) {
                let known = emulator.register(register).unwrap_or(bits);
                assert_eq!(bits, known, "{}.{}", core.name, core.program.register_text(register));
            }
        }
        let words = emulator.memory();
        let read =
            host.read(on_board.word(number, 0).expect("it can be read"), words.len()).expect("the memory");
        let differs = words.iter().zip(&read).position(|(word, read)| word != read);
        assert_eq!(differs, None, "{}: a data word", core.name);
    }
    assert!(host.retries > 0, "there was no noise");
    for (core, name) in description.cores.iter().enumerate().map(|(number, core)| (number, &core.name)) {
        let periods = host.register_of(core, "periods").expect("a register");
        assert_eq!(u64::from(periods), system.periods(core).count, "{name}");
    }
}

#[test]
fn circuit_and_emulator_have_the_same_words() {
    let description = unchanged();
    compare(&description, board(&description, "system-words"), 20);
}

/// Servo and watch publish their outputs and work on for more than 100 cycles; the servo's ports are latched.
#[test]
fn outputs_published_early_reach_the_pins() {
    let description = system(&|name, source| {
        let work = "        spare = spare*0.5 + 1\n".repeat(20);
        let ports = if name == "servo.s" { ".ports latched\n" } else { "" };
        let (head, end) = source.rsplit_once("        wait    period").expect("a period");
        let (once, period) = head.split_once("        wait    period").expect("a first `wait`");
        match name {
            "profile.s" => source.to_owned(),
            _ => format!(
                "{ports}.state spare\n{once}        mov spare, zero\n        wait    period{period}        publish\n{work}        wait    period{end}"
            ),
        }
    });
    let watch = takt_analysis::bound(&description.cores[2].program).expect("it can be bounded");
    let period = watch.sections.iter().find(|section| !section.once).expect("a period");
    assert!(period.to_outputs().worst + 100 < period.cycles.best, "{period:?}");
    let mut sim = board(&description, "system-early");
    let encoder = [sim.input("encoder_a").expect("a pin"), sim.input("encoder_b").expect("a pin")];
    drives_after_power_up(&mut sim);
    pins_follow_as_the_bound_says(&mut connect(sim), &description, encoder);
    compare(&description, board(&description, "system-early"), 8);
}

/// Faults in the module around the system, planted one at a time, are noticed.
#[test]
fn planted_faults_are_noticed() {
    let description = unchanged();
    let wiring = wiring(&description);
    let circuit = top::circuit(&ulx3s(), &wiring, &description).expect("there is a circuit");
    let faults = [
        // The faults: a repeated request is made twice; a core has every base tick, or no offset; a float is not scaled.
        ("board/takt_bridge.v", "has_data & known", "has_data & ~known"),
        ("board/takt_tick_divider.v", "turns == LAST ? 32'd0 : turns + 32'd1", "32'd0"),
        ("board/takt_tick_divider.v", "begins ? FIRST : left - 32'd1", "begins ? LEAD - 2 : left - 32'd1"),
        ("board/takt_output_latch.v", "EXPONENTS[10*which1 +: 10]", "10'd0"),
        // A core is loaded with the records of another core.
        ("takt_peripherals.v", "loads[1]", "loads[0]"),
    ];
    let mut files = circuit.files.clone();
    verilator::plant(&mut files, top::TOP, &faults).unwrap_or_else(|error| panic!("{error}"));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("system-faults");
    for fault in 0..=faults.len() {
        let sim = Simulation::with_fault(&files, &ulx3s(), &wiring, &folder, fault);
        let sim = sim.unwrap_or_else(|error| panic!("{error}"));
        let noticed = std::panic::catch_unwind(AssertUnwindSafe(|| compare(&description, sim, 36)));
        assert_eq!(noticed.is_err(), fault > 0, "{:?}", fault.checked_sub(1).map(|fault| faults[fault]));
    }
}
