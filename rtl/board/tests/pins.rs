// SPDX-License-Identifier: MIT OR Apache-2.0
//! Latencies from pin to pin over several cores, measured in a complete board: links of every kind, different ticks, a period under way.

use crate::harness::board::{STRETCH, Ticks};
use std::path::Path;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::kind::KINDS;
use takt_board::latency::{Answer, Part, PinPath, undivided, ways};
use takt_board::simulation::{EncoderMotion, Simulation};
use takt_board::{Application, Board, Wiring};
use takt_isa::T1;
use takt_system::{Description, ProgramError, Request};

/// Cycles of a base tick.
const TICK: u32 = 1000;

const WIRING: &str = r#"
clock = 50
period = 20
autostart = true

[signals]
drive = "gp10"
tick = "gp13"

[peripheral.switch]
kind = "digital-in"
pins = { in = "gp0" }
ports = { level = "first.i" }

[peripheral.direct]
kind = "digital-out"
pins = { out = "gp1" }
ports = { level = "first.o" }

[peripheral.slow]
kind = "digital-out"
pins = { out = "gp2" }
ports = { level = "second.o" }

[peripheral.far]
kind = "digital-out"
pins = { out = "gp3" }
ports = { level = "third.o" }

[peripheral.other]
kind = "digital-out"
pins = { out = "gp4" }
ports = { level = "third.p" }
"#;

/// System whose first core has every base tick; the second has every second base tick, and latched ports; the third has every third base
/// tick. The third core's period is longer than two base ticks and reads its input first and last, so a value can arrive while the
/// period is under way. Paths over the FIFO have no bound.
const SYSTEM: &str = r#"
tick = 1000
[[core]]
name = "first"
program = "first.s"
machine = "t1"
[[core]]
name = "second"
program = "second.s"
machine = "t1"
tick = 2
offset = 700
[[core]]
name = "third"
program = "third.s"
machine = "t1"
tick = 3
offset = 100
[[snapshot]]
name = "both"
from = "first"
to = "second"
ports = ["o -> i", "n"]
latency = 30
[[wire]]
from = "host.i"
to = "first.i"
latency = 9
[[wire]]
from = "second.o"
to = "third.i"
latency = 6
[[wire]]
from = "first.o"
to = "host.o"
[[wire]]
from = "second.o"
to = "host.s"
latency = 40
[[wire]]
from = "third.o"
to = "host.t"
latency = 20
[[snapshot]]
name = "last"
from = "third"
to = "host"
ports = ["p"]
latency = 7
[[fifo]]
name = "queue"
from = "first"
to = "third"
ports = ["n -> q"]
push = "n"
pop = "pop"
depth = 4
"#;

/// A wire over which a value takes nearly a base tick, to another output of the first core.
const DELAYED: [&str; 2] = [
    "[[wire]]\nfrom = \"first.n\"\nto = \"host.m\"\nlatency = 990\n",
    "[peripheral.delayed]\nkind = \"digital-out\"\npins = { out = \"gp5\" }\nports = { level = \"first.n\" }\n",
];

/// The first core's program, whose period is longer while the switch is on.
const FIRST: &str = "
.schedule on
.input i:int
.output o:int n:int
.once
        mov     o, zero
        mov     n, zero
        wait    period
.period
.reg k:int
period: mov     o, i
        mov     n, i
        bz      i, done
        mov     k, 20
again:  .loop_bound 20
        isub    k, k, 1
        bnz     k, again
done:   wait    period
";

const SECOND: &str = "
.schedule on
.ports latched
.input i:int n:int
.output o:int
.once
        mov     o, zero
        wait    period
.period
period: iand    o, i, n
        wait    period
";

const THIRD: &str = "
.input i:int q:int
.output o:int p:int pop:int
.reg first:int queued:int x
.once
        mov     o, zero
        mov     p, zero
        mov     pop, zero
        mov     x, zero
        wait    period
.period
period: mov     first, i
        iand    queued, q, zero                 ; it is read, but its value has no effect
.rep n, 1, 120
        fdiv    x, x, 1.0
.endr
        mov     p, first
        ior     o, i, queued
        wait    period
";

fn system(text: &str) -> Description {
    let sources = [("first.s", FIRST), ("second.s", SECOND), ("third.s", THIRD)];
    let read = takt_system::read("chain.toml", text, |request: &Request<'_>| {
        let options = Options { machine: &T1, ..Options::default() };
        let assembled = assemble(request.path, &MemoryLoader::new(&sources), &options);
        Ok::<_, ProgramError<()>>(assembled.unwrap_or_else(|error| panic!("{error:?}")).program)
    });
    read.unwrap_or_else(|_| panic!("the system is right"))
}

/// Bound of the path to each of the outputs, and the least and the most measured cycles.
fn bound_and_measured<const N: usize>(
    [system_text, wiring_text]: [&str; 2],
    folder: &str,
    outputs: [&str; N],
) -> [[(u64, u64); 2]; N] {
    let description = system(system_text);
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let wiring = Wiring::read("w.toml", wiring_text, &board).expect("a right wiring");
    wiring.check("w.toml", wiring_text, &description).expect("ports fit");
    let bound = |core: &takt_system::Core| takt_analysis::bound(&core.program).expect("it can be bounded");
    let bounds: Vec<_> = description.cores.iter().map(bound).collect();
    let ways = ways(&wiring, &Application::from(&description), &bounds).expect("few ways");
    assert_eq!((ways.ways.len(), &ways.queues[..]), (N, &["queue".to_owned()][..]));

    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let mut sim = Simulation::new(&board, &wiring, &description, &folder).unwrap_or_else(|e| panic!("{e}"));
    sim.run(20 * TICK, &[]).expect("it runs");
    assert_eq!(sim.output("signal_drive").map(|(level, _)| level), Some(true), "it drives");
    let (ticks, mut on) = (Ticks::of(&mut sim, TICK), false);
    outputs.map(|output| {
        let ends = |way: &&PinPath| way.outputs.iter().any(|end| end.peripheral == output);
        let way = ways.ways.iter().find(ends).expect("a way");
        let edge = way.inputs[0].parts[0].best;
        let mut cycles = Vec::new();
        // All ticks come again after six base ticks. The switch turns on and off just in time for a tick, just too late, and between.
        for (more, before) in (0..6).flat_map(|more| [edge, edge - 1, 600].map(|before| (more, before))) {
            for _ in 0..2 {
                sim.run((1 + more) * TICK, &[]).expect("it runs");
                on = !on;
                let switch = |sim: &mut Simulation| sim.set("switch_in", on);
                cycles.push(ticks.measured(&mut sim, before, switch, &format!("{output}_out")));
            }
        }
        let total = way.total().expect("an edge");
        let found = (*cycles.iter().min().expect("some"), *cycles.iter().max().expect("some"));
        assert!(found.0 >= total.best && found.1 <= total.worst, "{output}: {found:?}, and not {total:?}");
        [(total.best, total.worst), found]
    })
}

#[test]
fn paths_over_every_kind_of_link_keep_their_bound() {
    let outputs = ["direct", "slow", "far", "other"];
    let [direct, slow, last, first] = bound_and_measured([SYSTEM, WIRING], "board-pins", outputs);
    assert_eq!((direct[0], slow[0]), (direct[1], slow[1]));
    // The third core writes to an output the value that it reads last, which makes the best case, and to the other the value that it reads
    // first, which makes the worst.
    assert_eq!((last[0], last[0].0, first[0].1), (first[0], last[1].0, first[1].1));
}

/// An output of a core may come over a much longer path than another output. The other output's values can then be taken before their own
/// `wait`, and a `wait` can come while the values of the `wait` before are being put.
#[test]
fn a_slow_link_beside_a_fast_one_is_within_the_bound() {
    let text = [SYSTEM, WIRING].iter().zip(DELAYED).map(|(text, more)| format!("{text}{more}"));
    let [system, wiring] = &text.collect::<Vec<_>>()[..] else { panic!("two") };
    let outputs = ["direct", "slow", "far", "other", "delayed"];
    let [direct, .., delayed] = bound_and_measured([system, wiring], "board-pins-slow", outputs);
    assert!(direct[1].0 < delayed[0].0, "{direct:?} {delayed:?}");
}

/// Wiring with every register of every input peripheral that states a bound, each with a lamp that shows its lowest bit, and with streams.
const KINDS_WIRING: &str = r#"
clock = 50
period = 40
autostart = true
[signals]
drive = "gp10"
tick = "gp13"
[peripheral.encoder]
kind = "quadrature"
pins = { a = "gp0", b = "gn0", index = "gp1" }
filter = 4
ports = { count = "count", at_index = "at_index", indices = "indices", errors = "errors" }
[peripheral.stepper]
kind = "step"
pins = { step = "gp2", direction = "gn2" }
filter = 5
ports = { count = "steps" }
[peripheral.switch]
kind = "digital-in"
pins = { in = "gp3" }
hold = 7
ports = { level = "level", rises = "rises" }
[peripheral.sensors]
kind = "hall"
pins = { a = "gp14", b = "gn14", c = "gp15" }
filter = 6
ports = { sector = "sector", fault = "broken", count = "sectors", errors = "jumps" }
[peripheral.lamp0]
kind = "digital-out"
pins = { out = "gp4" }
ports = { level = "l0" }
[peripheral.lamp1]
kind = "digital-out"
pins = { out = "gp5" }
ports = { level = "l1" }
[peripheral.lamp2]
kind = "digital-out"
pins = { out = "gp6" }
ports = { level = "l2" }
[peripheral.lamp3]
kind = "digital-out"
pins = { out = "gp7" }
ports = { level = "l3" }
[peripheral.lamp4]
kind = "digital-out"
pins = { out = "gp8" }
ports = { level = "l4" }
[peripheral.lamp5]
kind = "digital-out"
pins = { out = "gp9" }
ports = { level = "l5" }
[peripheral.lamp6]
kind = "digital-out"
pins = { out = "gp11" }
ports = { level = "l6" }
[peripheral.lamp7]
kind = "digital-out"
pins = { out = "gp16" }
ports = { level = "l7" }
[peripheral.lamp8]
kind = "digital-out"
pins = { out = "gp17" }
ports = { level = "l8" }
[peripheral.lamp9]
kind = "digital-out"
pins = { out = "gp18" }
ports = { level = "l9" }
[peripheral.lamp10]
kind = "digital-out"
pins = { out = "gp19" }
ports = { level = "l10" }
[peripheral.full]
kind = "sigma-delta"
pins = { out = "gp12" }
signed = 0
ports = { value = "full" }
[peripheral.faint]
kind = "sigma-delta"
pins = { out = "gn12" }
signed = 0
ports = { value = "faint" }
"#;

/// Program of that wiring, in which the level also makes the stream `full` all ones, and `faint` a pulse in 32768 cycles.
const KINDS_PROGRAM: &str = "
.schedule on
.input count:int at_index:int indices:int errors:int steps:int level:int rises:int sector:int broken:int sectors:int jumps:int
.output l0:int l1:int l2:int l3:int l4:int l5:int l6:int l7:int l8:int l9:int l10:int full:int faint:int
.once
        l0, l1, l2, l3, l4, l5, l6, full, faint = 0, 0, 0, 0, 0, 0, 0, 0, 0
        l7, l8, l9, l10 = 0, 0, 0, 0
        wait    period
.period
period: l0, l1, l2, l3 = count & 1, at_index & 1, indices & 1, errors & 1
        l4, l5, l6 = steps & 1, level, rises & 1
        l7, l8, l9, l10 = sector & 1, broken, sectors & 1, jumps & 1
        full, faint = level << 16, level << 1
        wait    period
";

/// A kind that the wiring omits has its own test (`pwm` in top.rs, `pwm3`, `trip` and `spi` in drive.rs, absolute encoders and `sinc3` in
/// sensors.rs).
fn every_other_kind_is_tried(wiring: &Wiring) {
    for kind in KINDS
        .iter()
        .filter(|kind| !["spi", "pwm", "pwm3", "trip", "ssi", "biss-c", "sinc3"].contains(&kind.name))
    {
        assert!(
            wiring.peripherals.iter().any(|known| known.kind == kind),
            "{} is not tried: add it to KINDS_WIRING, or name its test in the comment above",
            kind.name
        );
    }
}

/// Each kind of peripheral keeps the latency that it states, in the complete top level: an edge just in time for a tick shows at the lamp
/// after the best case, an edge a cycle later after the worst case.
#[test]
fn each_peripheral_keeps_its_stated_latency() {
    const PERIOD: u32 = 2000;
    let options = Options { machine: &T1, ..Options::default() };
    let program = assemble("kinds.s", &MemoryLoader::new(&[("kinds.s", KINDS_PROGRAM)]), &options);
    let program = program.unwrap_or_else(|error| panic!("{}", error.render(false))).program;
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let wiring = Wiring::read("w.toml", KINDS_WIRING, &board).expect("a right wiring");
    wiring.check("w.toml", KINDS_WIRING, &program).expect("ports fit");
    let bounds = takt_analysis::bound(&program).expect("it can be bounded");
    let period = bounds.sections.iter().find(|section| !section.once).expect("a period").cycles;
    let way = undivided(&wiring, period).into_iter().next().expect("inputs and outputs");
    every_other_kind_is_tried(&wiring);

    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("board-kinds");
    let mut sim = Simulation::new(&board, &wiring, &program, &folder).unwrap_or_else(|e| panic!("{e}"));
    sim.run(20 * PERIOD, &[]).expect("it runs");
    assert_eq!(sim.output("signal_drive").map(|(level, _)| level), Some(true), "it drives");
    let ticks = Ticks::of(&mut sim, PERIOD);
    let encoder = ["encoder_a", "encoder_b"].map(|name| sim.input(name).expect("a pin"));
    let mut at = 0;
    let mut turn = |sim: &mut Simulation, by: i32| {
        sim.turns.push(EncoderMotion { pins: encoder, from: at, by });
        at += by;
    };
    for (end, lamp) in way.inputs.iter().zip(0..) {
        let lamp = format!("lamp{lamp}");
        let out = way.outputs.iter().find(|output| output.peripheral == lamp).expect("a lamp");
        assert_eq!(out.answer, Answer::Edge);
        let bound = Part::sum("", end.parts.iter().chain(&way.between).chain(&out.parts));
        for (before, expected) in [(end.parts[0].best, bound.best), (end.parts[0].best - 1, bound.worst)] {
            // The pins are at rest long enough for every filter; the pulse of an index comes at an odd count, and then at an even count.
            for pin in ["encoder_index", "stepper_step", "sensors_b", "sensors_c"] {
                sim.set(pin, false);
            }
            sim.set("sensors_a", true);
            match &*end.port {
                "rises" => sim.set("switch_in", false),
                "at_index" => turn(&mut sim, 1),
                _ => {}
            }
            sim.run(2 * PERIOD, &[]).expect("it runs");
            let change = |sim: &mut Simulation| match &*end.port {
                "count" => turn(sim, 1),
                "at_index" | "indices" => sim.set("encoder_index", true),
                // A turn of both pins at once counts as an error.
                "errors" => turn(sim, 2),
                "steps" => sim.set("stepper_step", true),
                "sector" | "sectors" => sim.set("sensors_b", true),
                // Without any pin the state is forbidden.
                "broken" | "jumps" => sim.set("sensors_a", false),
                "level" => {
                    let (_, level) = sim.inputs().find(|(name, _)| *name == "switch_in").expect("a pin");
                    sim.set("switch_in", !level);
                }
                _ => sim.set("switch_in", true),
            };
            let measured = ticks.measured(&mut sim, before, change, &format!("{lamp}_out"));
            assert_eq!(
                measured, expected,
                "{} of {}, {before} cycles before the tick",
                end.port, end.peripheral
            );
        }
    }

    // The modulator takes a stream's value on as stated. A value of ones alone shows that at once, with the next bit; the first bit of a
    // small value comes any time later, so the pin has no stated bound.
    for stream in ["full", "faint"] {
        let out = way.outputs.iter().find(|output| output.peripheral == stream).expect("a stream");
        assert_eq!(out.answer, Answer::Density);
    }
    let level = way.inputs.iter().find(|end| end.port == "level").expect("an input");
    let full = way.outputs.iter().find(|output| output.peripheral == "full").expect("a stream");
    let bound = Part::sum("", level.parts.iter().chain(&way.between).chain(&full.parts));
    let total = way.total_to_modulator().expect("streams");
    assert!(total.best <= bound.best && bound.worst <= total.worst, "{total:?}");
    let edge = level.parts[0].best;
    for (before, expected) in [(edge, bound.best), (edge - 1, bound.worst)] {
        sim.set("switch_in", false);
        // All pulses of a small value are over.
        sim.run(2 * PERIOD + (1 << 16), &[]).expect("it runs");
        let on = |sim: &mut Simulation| sim.set("switch_in", true);
        // The bit that the modulator makes of its value is at the pin a cycle later.
        assert_eq!(ticks.measured(&mut sim, before, on, "full_out"), expected + 1);
    }
    let mut silent = 0;
    while sim.output("faint_out").expect("a pin").1 == 0 {
        sim.run(STRETCH, &[]).expect("it runs");
        silent += u64::from(STRETCH);
        assert!(silent <= 1 << 16, "a pulse comes");
    }
    assert!(silent > total.worst, "{silent}");
    // Over any stretch, the cycles in which the pin is 1 differ from the value by less than 1.
    for cycles in [100_000, 65_536, 12_345] {
        sim.run(cycles, &[]).expect("it runs");
        let high = sim.output("faint_out").expect("a pin").1;
        let expected = f64::from(cycles) * 2.0 / 65536.0;
        assert!((f64::from(high) - expected).abs() < 1.0, "{high} {expected}");
    }
}
