// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compares the emulated board with the circuit in Verilator, under the same host: the example `programs/examples/board/axis`, and the
//! addresses on which LinuxCNC's component relies.

use crate::system::{self, Names};
use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::emulated::{EmulatedBoard, EmulatedError};
use takt_board::endpoints::Endpoints;
use takt_board::protocol::{ENABLE, HOLD, IMAGE, Line, LinkError, RUN};
use takt_board::scope::{Recording, ScopeState, Setup};
use takt_board::simulation::{EncoderMotion, Simulation};
use takt_board::{Application, Board, Host, Wiring};
use takt_system::{Description, ProgramError, Request};

/// An emulated board on a line. A base tick passes whenever the host listens.
struct Emulation {
    board: EmulatedBoard,
    bytes: Vec<u8>,
    ticks: u64,
}

impl Line for Emulation {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bytes.extend(self.board.receive(bytes));
        Ok(())
    }

    fn receive(&mut self) -> io::Result<Vec<u8>> {
        self.ticks += 1;
        let sent = self.board.pass();
        self.bytes.extend(sent);
        Ok(std::mem::take(&mut self.bytes))
    }

    fn patience(&self) -> u32 {
        10
    }

    fn time(&self) -> Duration {
        Duration::from_micros(self.ticks)
    }
}

fn connect(board: EmulatedBoard) -> Host<Emulation> {
    let line = Emulation { board, bytes: Vec::new(), ticks: 0 };
    Host::connect(line, 3).unwrap_or_else(|error| panic!("{error}"))
}

/// The values that a host sees, and the registers that count, after each of `ticks` base ticks with the same inputs.
fn seen<L: Line>(
    host: &mut Host<L>,
    names: &Names,
    ticks: u32,
    mut turn: impl FnMut(&mut L, u32),
) -> Vec<Vec<u32>> {
    let outputs = names.ends.outputs.len();
    host.set("control", 0).expect("it stops");
    host.set("control", RUN | HOLD | ENABLE).expect("it starts, held");
    let moves = names.fifo("moves", false);
    // The host pushes twice before the first tick, and once later.
    let push = |host: &mut Host<L>, target: f32| {
        let words = [target.to_bits(), 0.5f32.to_bits(), 1];
        host.write(moves.field(0), &words).expect("an entry");
    };
    push(host, 3.0);
    push(host, 1.0);
    host.settle().expect("all cores wait");
    let mut all = Vec::new();
    for tick in 0..ticks {
        if tick == 20 {
            push(host, -2.0);
            host.set_ports(&[(names.set("limit"), 2.5f32.to_bits())]).expect("it is the host's");
        }
        turn(&mut host.line, tick);
        host.set("step", 1).expect("it is held");
        let mut words = host.read(Endpoints::output(0), outputs).expect("values");
        words.push(host.read(moves.address, 1).expect("a status")[0]);
        words.extend(["periods", "misses"].map(|name| host.register(name).expect("a register")));
        all.push(words);
    }
    all
}

#[test]
fn the_emulated_board_has_the_values_of_the_circuit() {
    let description = system::unchanged();
    let names = Names::of(&description);
    let wiring = system::wiring(&description);
    let counts = |tick: u32| (tick as i32 % 7 - 2) * 3;

    let mut host = connect(EmulatedBoard::new(&wiring, &description).expect("it has a circuit"));
    host.fits(&description).expect("it is that of the system");
    let encoder = host.line.board.input("servo.n").expect("the encoder's");
    let mut count = 0i32;
    let emulated = seen(&mut host, &names, 60, |line, tick| {
        count += counts(tick);
        line.board.capture(encoder, count.cast_unsigned());
    });

    let sim = system::board(&description, "emulated-board");
    let pins = ["encoder_a", "encoder_b"].map(|pin| sim.input(pin).expect("a pin"));
    let mut host = Host::connect(sim, 3).unwrap_or_else(|error| panic!("{error}"));
    let mut count = 0i32;
    let circuit = seen(&mut host, &names, 60, |sim: &mut Simulation, tick| {
        sim.turns.push(EncoderMotion { pins, from: count, by: counts(tick) });
        count += counts(tick);
        // The board runs until the edges have passed the filter, while it is held.
        sim.run(400, &[]).expect("it runs");
    });
    assert!(circuit.iter().any(|words| words != &circuit[0]), "something happens");
    for (tick, (emulated, circuit)) in emulated.iter().zip(&circuit).enumerate() {
        assert_eq!(emulated, circuit, "after tick {tick}");
    }
}

/// Channels, trigger, and periods to a sample, samples, samples before the trigger's, base ticks.
type Asked<'a> = (&'a [&'a str], &'a str, [u32; 4]);

/// Recordings of the same run, with these triggers, on a board whose wiring has a scope for the servo.
fn recordings<L: Line>(
    host: &mut Host<L>,
    description: &Description,
    mut turn: impl FnMut(&mut L, u32),
) -> Vec<Recording> {
    let application = Application::from(description);
    let scope = host.scope().expect("it has a scope");
    assert_eq!((scope.depth, scope.channels, scope.core), (32, 4, 1));
    let mut tick = 0;
    let mut pass = |host: &mut Host<L>, ticks: u32| {
        for _ in 0..ticks {
            turn(&mut host.line, tick);
            tick += 1;
            host.set("step", 1).expect("it is held");
            host.register("periods").expect("a register");
        }
    };
    host.set("control", 0).expect("it stops");
    host.set("control", RUN | HOLD | ENABLE).expect("it starts, held");
    host.settle().expect("all cores wait");
    pass(host, 3);
    let setups: [Asked<'_>; 6] = [
        (&["servo.n", "servo.error"], "", [1, 8, 0, 12]),
        (&["servo.n", "servo.error"], "servo.n >= -9", [1, 10, 4, 30]),
        (&["servo.n"], "servo.n rises -9", [1, 6, 2, 60]),
        (&["servo.error", "servo.n"], "servo.error < 3", [2, 9, 3, 60]),
        (&["servo.n"], "servo.n changes", [3, 5, 0, 40]),
        (&["servo.error", "servo.n"], "safe", [1, 9, 6, 12]),
    ];
    setups
        .map(|(names, trigger, [every, samples, before, ticks])| {
            let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
            let triggers: Vec<String> =
                (!trigger.is_empty()).then(|| trigger.to_owned()).into_iter().collect();
            let mut setup = Setup::new(&application, &names, &triggers).expect("a right one");
            (setup.every, setup.samples, setup.before) = (every, Some(samples), Some(before));
            host.arm(&application, &scope, &setup).expect("it is armed");
            if trigger == "safe" {
                pass(host, 8);
                host.set("control", RUN | HOLD).expect("it no longer drives");
            }
            pass(host, ticks);
            assert_eq!(host.scope_state().expect("a state"), ScopeState::Done, "{trigger}");
            host.recording(&scope, &setup, |_, _| ControlFlow::Continue(())).expect("a recording")
        })
        .to_vec()
}

/// A scope of the emulated board records what the circuit's does: the same periods, triggers and causes, and the same values, where the
/// circuit has one.
#[test]
fn the_emulated_scope_records_as_the_circuits_does() {
    let description = system::unchanged();
    let wiring = system::wiring_with(&description, "[scope]\ncore = \"servo\"\nchannels = 4\ndepth = 32\n");
    let counts = |tick: u32| (tick as i32 % 7 - 3) * 3;

    let mut host = connect(EmulatedBoard::new(&wiring, &description).expect("it has a circuit"));
    let encoder = host.line.board.input("servo.n").expect("the encoder's");
    let mut count = 0i32;
    let emulated = recordings(&mut host, &description, |line, tick| {
        count += counts(tick);
        line.board.capture(encoder, count.cast_unsigned());
    });

    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("emulated-scope");
    let sim = Simulation::new(&system::ulx3s(), &wiring, &description, &folder);
    let sim = sim.unwrap_or_else(|error| panic!("{error}"));
    let pins = ["encoder_a", "encoder_b"].map(|pin| sim.input(pin).expect("a pin"));
    let mut host = Host::connect(sim, 3).unwrap_or_else(|error| panic!("{error}"));
    let mut count = 0i32;
    let circuit = recordings(&mut host, &description, |sim: &mut Simulation, tick| {
        sim.turns.push(EncoderMotion { pins, from: count, by: counts(tick) });
        count += counts(tick);
        sim.run(400, &[]).expect("it runs");
    });
    for (number, (emulated, circuit)) in emulated.iter().zip(&circuit).enumerate() {
        let seen = |recording: &Recording| {
            let Recording { channels, periods, trigger, causes, is_stopped, .. } = recording.clone();
            (channels, periods, trigger, causes, is_stopped)
        };
        assert_eq!(seen(emulated), seen(circuit), "recording {number}");
        for (emulated, circuit) in emulated.values.iter().zip(&circuit.values) {
            let known: Vec<_> =
                emulated.iter().zip(circuit).filter(|(_, circuit)| circuit.is_some()).collect();
            assert!(
                known.len() > 2 && known.iter().all(|(emulated, circuit)| emulated == circuit),
                "{number}: {known:?}"
            );
        }
    }
}

static TOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());

#[test]
fn emulated_board_fails_safe_and_rejects_unknown_addresses() {
    let description = system::unchanged();
    let names = Names::of(&description);
    let mut host =
        connect(EmulatedBoard::new(&system::wiring(&description), &description).expect("a circuit"));
    let pass = |host: &mut Host<Emulation>, ticks: u32| {
        (0..ticks).for_each(|_| drop(host.line.board.pass()));
    };
    let causes = |host: &mut Host<Emulation>| {
        host.status().expect("it answers").causes().map(str::to_owned).collect::<Vec<_>>()
    };
    // The board starts by itself, and drives from the end of its first period on.
    pass(&mut host, 5);
    assert!(host.line.board.drives() && host.line.board.output("motor") == Some(0));
    // The motor has the error of 2 counts, in steps of its register.
    let encoder = host.line.board.input("servo.n").expect("an encoder");
    host.line.board.capture(encoder, 2);
    pass(&mut host, 2);
    assert_eq!(host.line.board.output("motor"), Some((-2.0 * 0.02 * 1024.0f64).round() as i32));
    // The host sends no request for as many periods as the wiring allows.
    host.line.board.tell = Some(|text| TOLD.lock().expect("no panic").push(text.to_owned()));
    pass(&mut host, 58);
    assert!(!host.line.board.drives(), "the host is silent");
    let told = std::mem::take(&mut *TOLD.lock().expect("no panic"));
    let says = ": the outputs become safe: host silent: no request for as many periods as the wiring's `host` allows";
    assert!(told.len() == 1 && told[0].starts_with("tick ") && told[0].ends_with(says), "{told:?}");
    assert_eq!(
        (host.line.board.output("motor"), causes(&mut host)),
        (Some(0), vec!["host silent".to_owned()])
    );
    // A start lets the outputs drive again; the cause `stop` stays until the next start.
    host.set("control", 0).expect("it stops");
    host.set("control", RUN | ENABLE).expect("it starts");
    pass(&mut host, 3);
    assert!(host.line.board.drives() && causes(&mut host).is_empty());
    host.line.board.set_stop(true);
    pass(&mut host, 1);
    host.line.board.set_stop(false);
    pass(&mut host, 1);
    assert_eq!((host.line.board.drives(), causes(&mut host)), (false, vec!["stop".to_owned()]));
    // The board has no program to load, and no port to set that a peripheral drives.
    for address in [IMAGE, names.at("n"), names.at("servo.error")] {
        let refused = host.write(address, &[1]);
        assert!(matches!(refused, Err(LinkError::ReadOnly { .. })), "{address:#x}: {refused:?}");
    }
    // The board sends a frame of the stream for every second base tick.
    host.set("stream", 2 << 20 | 1 << 16 | u32::from(names.at("servo.error"))).expect("a stream");
    let first = host.streamed().expect("a line");
    let periods: Vec<u32> =
        (0..8).filter_map(|_| host.streamed().expect("a line")).map(|frame| frame.words[0]).collect();
    let first = first.map_or_else(|| periods[0], |frame| frame.words[0]);
    assert!(
        periods.len() >= 3 && periods.windows(2).all(|pair| pair[1] - pair[0] == 2),
        "{first}: {periods:?}"
    );
    let program = assemble(
        "p.s",
        &MemoryLoader::new(&[("p.s", ".once\n wait p\n.period\np: wait p\n")]),
        &Options::default(),
    );
    let alone = Wiring::none(
        &Board::from_name("ulx3s-85f").expect("a board").expect("right"),
        &program.as_ref().expect("right").program,
    );
    let refused = EmulatedBoard::new(&alone, &program.expect("right").program);
    assert!(matches!(refused, Err(EmulatedError::Program)), "{refused:?}");
}

/// `tools/linuxcnc/hal_takt.c` has addresses, depths and periods of `followed.toml`, its wiring and `interpolation.s` as numbers: the
/// defaults of parameters, and constants.
#[test]
fn the_addresses_of_linuxcncs_component_are_those_of_its_system() {
    const SOURCES: [(&str, &str); 3] = [
        ("interpolation.s", include_str!("../../../programs/hybrid/interpolation.s")),
        ("tracking.s", include_str!("../../../programs/hybrid/tracking.s")),
        ("robot.s", include_str!("../../../programs/hybrid/robot.s")),
    ];
    let text = include_str!("../../../programs/hybrid/followed.toml");
    let read = takt_system::read("followed.toml", text, |request: &Request<'_>| {
        let assembled = assemble(request.path, &MemoryLoader::new(&SOURCES), &Options::default());
        Ok::<_, ProgramError<()>>(assembled.unwrap_or_else(|error| panic!("{error:?}")).program)
    });
    let description = read.unwrap_or_else(|_| panic!("the system is right"));
    let ends = Endpoints::of(&description);
    let place = |name: &str| ends.place(name).unwrap_or_else(|| panic!("{name}")).read;
    let axes = 5;
    assert_eq!((place("n1"), place("n5")), (0x3000, 0x3000 + axes - 1));
    let measured = ["m1", "m2", "m3", "m4", "m5", "knot", "phase", "starved", "standing"];
    for (i, name) in measured.iter().enumerate() {
        assert_eq!(place(&format!("measured.{name}")), 0x3400 + axes + i as u16, "{name}");
    }
    let knots = ends.fifo("knots", false).expect("a FIFO");
    let fields: Vec<&str> = knots.fields.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!((knots.address, fields.len()), (0x3800, 2 * usize::from(axes)));
    assert_eq!(fields.join(" "), "to_1 to_2 to_3 to_4 to_5 speed_1 speed_2 speed_3 speed_4 speed_5");
    let component = include_str!("../../../tools/linuxcnc/hal_takt.c");
    for says in [
        "static int encoders = 0x3000;",
        "static int measured = 0x3405;",
        "static int fifo = 0x3801;",
        "enum { M1 = 1, KNOT = 0, PHASE, STARVED, STANDING, BEHIND };",
        "static char *joints = \"LLLRR\";",
        "static int cores = 2;",
        "static int every = 10;",
        "BEGIN = 3,",
        "{1.0 / (1 << 30), 1.0 / (1 << 26)}",
    ] {
        assert!(component.contains(says), "hal_takt.c no longer says `{says}`");
    }
    let core = include_str!("../../../programs/hybrid/interpolation.s");
    for says in ["N     = 10 ", "um    = 2^-30 ", "ua    = 2^-26 ", "BEGIN = 3 "] {
        assert!(core.contains(says), "interpolation.s no longer says `{says}`");
    }
}
