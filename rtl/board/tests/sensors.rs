// SPDX-License-Identifier: MIT OR Apache-2.0
//! Encoders and currents in the complete top level, from the sample to a pin, to the cycle; mistakes in their wirings.

use crate::harness::encoders::{BissEncoder, Encoder, SsiEncoder};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::SeedableRng as _;
use std::path::Path;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::latency::{PinPath, Sample, Until, samples, ways};
use takt_board::simulation::Simulation;
use takt_board::{Application, Board, Findings, Mistake, Wiring};
use takt_isa::{Program, T1};

/// A carrier of 1000 cycles that gives ticks; the program shows the lowest bit of what it reads.
const HEAD: &str = r#"
clock = 50
autostart = true
[signals]
drive = "gp12"
tick = "gp13"
[carrier.main]
half = 500
tick = "valley"
after = 5
[peripheral.lamp]
kind = "digital-out"
pins = { out = "gp1" }
ports = { level = "y" }
"#;

const PROGRAM: &str = "
.input x:int
.output y:int
.period
p:      iand y, x, 1
        wait p
";

fn program() -> Program {
    assembled(PROGRAM)
}

fn assembled(source: &str) -> Program {
    let options = Options { machine: &T1, ..Options::default() };
    let assembled = assemble("p.s", &MemoryLoader::new(&[("p.s", source)]), &options);
    assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

fn board() -> Board {
    Board::from_name("ulx3s-85f").expect("a board").expect("a right one")
}

fn read(text: &str) -> Result<Wiring, Vec<Mistake>> {
    Wiring::read("w.toml", &format!("{HEAD}{text}"), &board())
}

fn wiring(text: &str) -> Wiring {
    let wiring = read(text).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    let text = format!("{HEAD}{text}");
    wiring.check("w.toml", &text, &program()).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    wiring
}

fn findings(text: &str) -> Findings {
    let (wiring, program) = (wiring(text), program());
    let bounds = [takt_analysis::bound(&program).ok()];
    wiring.findings("w.toml", &format!("{HEAD}{text}"), &program, &bounds)
}

/// The path from the sensor to the lamp.
fn path(wiring: &Wiring) -> PinPath {
    let program = program();
    let bounds = takt_analysis::bound(&program).expect("bounds");
    let found = ways(wiring, &Application::from(&program), std::slice::from_ref(&bounds)).expect("ways");
    assert!(found.late.is_empty(), "{found:?}");
    let [path] = &found.ways[..] else { panic!("{found:?}") };
    path.clone()
}

fn simulation(name: &str, wiring: &Wiring, program: &Program) -> Simulation {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("sensors-{name}"));
    Simulation::new(&board(), wiring, program, &folder).unwrap_or_else(|error| panic!("{error}"))
}

/// Cycles from the clock's fall with which an encoder holds another position to the edge at the lamp, over some changes.
fn measured(name: &str, wiring: &Wiring, [clock, data]: [&str; 2], encoder: &mut dyn Encoder) -> Vec<u64> {
    let mut sim = simulation(name, wiring, &program());
    let mut random = Pcg64::seed_from_u64(1);
    let (mut was, mut frames, mut found) = (true, 0, Vec::new());
    let (mut sampled, mut lit) = (None, false);
    sim.set(data, true);
    sim.run(1, &[]).expect("it runs");
    while found.len() < 4 {
        assert!(sim.cycles < 200_000, "{name}: no edge at the lamp: {found:?}");
        let now = sim.output(clock).expect("a pin").0;
        let is_first = was && !now && !encoder.is_busy();
        was = now;
        if is_first {
            frames += 1;
            // The drive is on; the position is another one every fourth frame.
            if frames > 12 && frames % 4 == 0 {
                sampled = Some(sim.cycles);
            }
            encoder.holds(u64::from(frames > 11 && frames / 4 % 2 == 1));
        }
        let level = encoder.clock(now, &mut random);
        sim.run(1, &[]).expect("it runs");
        sim.set(data, level);
        let lamp = sim.output("lamp_out").expect("a pin").0;
        if lamp != lit
            && let Some(sampled) = sampled.take()
        {
            found.push(sim.cycles - sampled);
        }
        lit = lamp;
    }
    found
}

const SSI: &str = r#"
[peripheral.angle]
kind = "ssi"
pins = { clock = "gp0", data = "gn0" }
rate = 5
bits = 12
pause = 100
starts = "main.valley"
ports = { position = "x" }
"#;

#[test]
fn an_ssi_position_arrives_as_the_bound_says() {
    let wiring = wiring(SSI);
    assert_eq!(findings(SSI), Findings::default());
    let path = path(&wiring);
    let total = path.total().expect("an edge");
    assert_eq!((path.inputs[0].sample, path.inputs[0].parts[0].best), (Some(Sample::Frame), 120));
    assert_eq!(total.best, total.worst, "jitter 0");
    let texts: Vec<String> = samples(&wiring).into_iter().map(|sampling| sampling.text).collect();
    assert_eq!(texts, ["1 cycle after main.valley, by a frame of 120 cycles at 5 MHz"]);
    let mut encoder = SsiEncoder::new(12, 5, 100, false);
    assert_eq!(measured("ssi", &wiring, ["angle_clock", "angle_data"], &mut encoder), [total.best; 4]);
}

const BISS: &str = r#"
[peripheral.angle]
kind = "biss-c"
pins = { ma = "gp0", slo = "gn0" }
rate = 10
bits = 12
wait = 10
timeout = 60
starts = "main.valley"
ports = { position = "x" }
"#;

#[test]
fn a_biss_position_arrives_as_the_bound_says() {
    let wiring = wiring(BISS);
    assert_eq!(findings(BISS), Findings::default());
    let path = path(&wiring);
    let total = path.total().expect("an edge");
    // The tick comes after the longest frame, whatever the line's delay.
    assert_eq!((path.inputs[0].parts[0].best, path.inputs[0].sample), (147, Some(Sample::Frame)));
    assert_eq!(total.best, total.worst, "jitter 0");
    let texts: Vec<String> = samples(&wiring).into_iter().map(|sampling| sampling.text).collect();
    assert_eq!(texts, ["1 cycle after main.valley, by a frame of 147 to 196 cycles at 8.333 MHz"]);
    let mut encoder = BissEncoder::new(12, 3, 60);
    assert_eq!(measured("biss", &wiring, ["angle_ma", "angle_slo"], &mut encoder), [total.best; 4]);
}

#[test]
fn what_does_not_fit_a_biss_encoder_is_refused() {
    each_is_refused(
        BISS,
        &[
            ("bits = 12", "bits = 11", "5:8: `bits` must be a whole number from 12 to 36, not 11"),
            (
                "rate = 10",
                "rate = 30",
                "4:8: 30 MHz are 0.83 cycles of 50 MHz for half a bit; expected 2 to 65535: 0.000381 to 12.500 MHz",
            ),
            ("wait = 10", "wait = 1", "6:8: `wait` must be a whole number from 2 to 255, not 1"),
            ("ma = \"gp0\", ", "", "3:8: `ma` is missing in [pins]"),
            (
                "timeout = 60",
                "timeout = 900",
                "4:1: starts of frames are lost: a frame of `angle` takes 196 cycles: half · (2 · (wait + bits) + 21) + 1, and its rest 903: half + timeout, and `main` starts one every 1000 cycles",
            ),
            (
                "wait = 10",
                "wait = 20",
                "4:1: `position` is a period old at each tick: a frame of `angle` takes 256 cycles: half · (2 · (wait + bits) + 21) + 1, and starts 250 cycles before the tick: `after` greater by 0.15 µs or more",
            ),
        ],
    );
    for (rate, half) in [("10", 3), ("13", 2), ("12.5", 2), ("8.33", 4), ("1", 25)] {
        let wiring = wiring(&BISS.replace("rate = 10", &format!("rate = {rate}")));
        assert_eq!(wiring.peripherals[1].parameter("half"), half, "{rate} MHz");
    }
}

const SINC3: &str = r#"
[peripheral.current]
kind = "sinc3"
pins = { data = "gn0", clock = "gp0" }
half = 2
osr = 25
limit = 1000
fast = 10
centre = "main.valley"
ports = { value = "x" }
[peripheral.brake]
kind = "digital-out"
pins = { out = "gp2" }
safe = 1
trips = ["current"]
"#;

/// The sign of the value, for steps of the modulator's input about the place of the carrier.
#[test]
fn a_window_is_centred_on_its_place() {
    let wiring = wiring(SINC3);
    assert_eq!(findings(SINC3), Findings::default());
    let path = path(&wiring);
    let total = path.total().expect("an edge");
    assert_eq!(path.inputs[0].parts[0].best, 2 * (3 * 25 - 1) + 6);
    assert_eq!((path.inputs[0].sample, total.best), (Some(Sample::Window), total.worst));
    let texts: Vec<String> = samples(&wiring).into_iter().map(|sampling| sampling.text).collect();
    assert_eq!(texts, ["about main.valley, by a window of 300 cycles at 12.5 MHz, group delay 154 cycles"]);
    let program = assembled(&PROGRAM.replace("iand y, x, 1", "ilt y, zero, x"));
    let mut sim = simulation("sinc3", &wiring, &program);
    // The carrier's valleys, from the ticks, which come 250 cycles later.
    sim.run(20_000, &[]).expect("it runs");
    while !sim.output("signal_tick").expect("a pin").0 {
        sim.run(1, &[]).expect("it runs");
    }
    let valley = sim.cycles - 250;
    let mut was = sim.output("current_clock").expect("a pin").0;
    let mut is_high = false;
    for (number, offset) in (-9..=9_i64).enumerate() {
        let centre = valley + 1000 * (3 * number as u64 + 3);
        let step = centre.wrapping_add_signed(offset);
        let mut lit = None;
        while sim.cycles < centre + 1000 {
            let clock = sim.output("current_clock").expect("a pin").0;
            if clock && !was {
                // The modulator samples.
                is_high = sim.cycles >= step;
            }
            was = clock;
            sim.set("current_data", is_high);
            sim.run(1, &[]).expect("it runs");
            if sim.output("lamp_out").expect("a pin").0 && lit.is_none() && sim.cycles > centre {
                lit = Some(sim.cycles - centre);
            }
        }
        // The middle bit of an odd number decides.
        assert_eq!(lit, (offset <= 0).then_some(total.best), "a step {offset} cycles after the place");
    }
    // The sums for overcurrent saw nothing but ones, or nothing but zeros.
    assert!(sim.output("brake_out").expect("a pin").0, "the trip holds the brake");
}

#[test]
fn what_does_not_fit_a_filter_is_refused() {
    each_is_refused(
        SINC3,
        &[
            ("osr = 25", "osr = 7", "5:7: `osr` must be a whole number from 8 to 256, not 7"),
            (
                "osr = 25",
                "osr = 24",
                "5:1: the period of `main`, 1000 cycles, is no multiple of the windows': 24 bits of `current` take 96 cycles: 2 · half · osr: `osr = 25`",
            ),
            (
                "half = 2\n",
                "half = 3\n",
                "5:1: the period of `main`, 1000 cycles, is no multiple of the windows': 25 bits of `current` take 150 cycles: 2 · half · osr: a carrier with `half = 525`",
            ),
            (
                "osr = 25",
                "osr = 50",
                "5:1: `value` is a period old at each tick: it comes 304 cycles after its window's centre, and the tick 250 cycles after it: `after` greater by 1.08 µs or more",
            ),
            (
                ", clock = \"gp0\"",
                "",
                "3:1: with `clock = \"out\"` `current` needs the pin `clock`, which is not connected",
            ),
            (
                "half = 2\n",
                "half = 2\nclock = \"in\"\n",
                "3:1: with `clock = \"in\"` `current` needs the pin `clock_in`, which is not connected",
            ),
            (
                "half = 2\nosr = 25",
                "half = 3\nosr = 60\nclock = \"in\"\n",
                "5:1: windows are cut off: 60 bits of `current` take 360 cycles: 2 · half · osr, a window three times as many, and with the modulator's own clock it must end before the next begins, but `main` has a period of 1000 cycles: `osr = 55` at most",
            ),
            (
                "limit = 1000",
                "limit = 1001",
                "6:1: `current` never trips: `limit` is 1001, and a sum with `fast = 10` reaches fast³ = 1000 at most",
            ),
            ("limit = 1000\n", "", "1:13: `current` never trips: it has no `limit`, of 1000 at most"),
            (
                "trips = [\"current\"]",
                "",
                "6:1: the trip `current` makes nothing safe: no peripheral names it in `trips`",
            ),
            ("main.valley", "lead", "8:10: `lead` is not a carrier; there are main"),
            (
                "half = 2\n",
                "rate = 60\n",
                "4:8: 60 MHz are 0.42 cycles of 50 MHz for half a bit; expected 2 to 255: 0.098039 to 12.500 MHz",
            ),
        ],
    );
}

#[test]
fn a_lead_counts_as_an_instant() {
    let text = SSI.replace("starts = \"main.valley\"\n", "");
    // Without `lead` a frame starts with the tick, and the next tick reads what it brings.
    let lead = |lead: &str| {
        let head = HEAD.replace("autostart = true\n", lead);
        let wiring = Wiring::read("w.toml", &format!("{head}{text}"), &board()).expect("it is right");
        let path = path(&wiring);
        let text = samples(&wiring).remove(0).text;
        (path.inputs[0].parts[0].best, path.inputs[0].until.best, path.inputs[0].until.worst, text)
    };
    let by = "by a frame of 120 cycles at 5 MHz";
    assert_eq!(lead(""), (120, 879, 879, format!("1 cycle after the tick, {by}")));
    assert_eq!(lead("lead = 4\n"), (120, 79, 79, format!("199 cycles before the tick, {by}")));
    assert_eq!(lead("lead = 2.4\n"), (120, 999, 999, format!("119 cycles before the tick, {by}")));
}

fn lines(mistakes: &[Mistake]) -> Vec<String> {
    mistakes.iter().map(Mistake::to_string).collect()
}

/// Replacements in a wiring, each with the mistake that it makes, with its line within the peripheral.
fn each_is_refused(text: &str, replacements: &[(&str, &str, &str)]) {
    let lines_before = HEAD.lines().count() + 1;
    for (what, by, expected) in replacements {
        assert!(text.contains(what), "{what}");
        let wrong = text.replacen(what, by, 1);
        let found = match read(&wrong) {
            Err(mistakes) => lines(&mistakes),
            Ok(_) => {
                let found = findings(&wrong);
                lines(&[found.mistakes, found.warnings].concat())
            }
        };
        let (line, rest) = expected.split_once(':').expect("a line");
        let line: usize = line.parse().expect("a number");
        let expected = format!("w.toml:{}:{rest}", lines_before + line);
        assert!(
            found.iter().any(|found| found.starts_with(&expected)),
            "{what} -> {by}: {expected}: {found:#?}"
        );
    }
}

#[test]
fn what_does_not_fit_an_ssi_encoder_is_refused() {
    each_is_refused(
        SSI,
        &[
            ("bits = 12", "bits = 0", "5:8: `bits` must be a whole number from 8 to 36, not 0"),
            ("bits = 12", "bits = 37", "5:8: `bits` must be a whole number from 8 to 36, not 37"),
            (
                "rate = 5",
                "rate = 60",
                "4:8: 60 MHz are 0.42 cycles of 50 MHz for half a bit; expected 3 to 65535: 0.000381 to 8.333 MHz",
            ),
            ("rate = 5", "rate = 0", "4:8: `rate` must be a number from 0.000001 to 1000000, not 0"),
            ("rate = 5", "rate = 5\nhalf = 5", "4:8: `half` already determines the rate"),
            (", data = \"gn0\"", "", "3:8: `data` is missing in [pins]"),
            ("position = \"x\"", "value = \"x\"", "8:11: `value` is not a key of [ports]"),
            (
                "pause = 100",
                "pause = 880",
                "4:1: starts of frames are lost: a frame of `angle` takes 120 cycles: 2 · half · bits, and its rest 880: pause, and `main` starts one every 1000 cycles: a smaller `half`, or a carrier of 1001 cycles or more",
            ),
            (
                "rate = 5",
                "rate = 2",
                "4:1: `position` is a period old at each tick: a frame of `angle` takes 312 cycles: 2 · half · bits, and starts 250 cycles before the tick: `after` greater by 1.26 µs or more",
            ),
            (
                "bits = 12",
                "bits = 12\ndouble = 1",
                "4:1: `position` is a period old at each tick: a frame of `angle` takes 250 cycles: 2 · half · (2 · bits + 1)",
            ),
            (
                "starts = \"main.valley\"\n",
                "",
                "4:1: `position` is a period old at each tick: a frame of `angle` takes 120 cycles: 2 · half · bits, and starts 0 cycles before the tick: `lead = 2.42` or more",
            ),
            (
                "pause = 100\nstarts = \"main.valley\"\n",
                "pause = 900\n",
                "4:1: starts of frames are lost: a frame of `angle` takes 120 cycles: 2 · half · bits, and its rest 900: pause, and one starts every 1000 cycles: `half = 4` at most",
            ),
        ],
    );
    // The highest rate that the clock makes, of at most the given one.
    for (rate, half) in [("5", 5), ("5.1", 5), ("4.9", 6), ("8.3333", 4), ("0.5", 50), ("2.5", 10)] {
        let wiring = wiring(&SSI.replace("rate = 5", &format!("rate = {rate}")));
        assert_eq!(wiring.peripherals[1].parameter("half"), half, "{rate} MHz");
    }
}

/// The example wirings with sensors fit a program, and their angle and currents reach the duties in a fixed time.
#[test]
fn the_examples_fit() {
    let (text, source) = (
        include_str!("../../../programs/examples/board/absolute.toml"),
        include_str!("../../../programs/examples/board/absolute.s"),
    );
    let assembled =
        assemble("absolute.s", &MemoryLoader::new(&[("absolute.s", source)]), &Options::default());
    let program = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program;
    let wiring = Wiring::read("absolute.toml", text, &board()).unwrap_or_else(|wrong| panic!("{wrong:?}"));
    wiring.check("absolute.toml", text, &program).unwrap_or_else(|wrong| panic!("{wrong:?}"));
    let bounds = takt_analysis::bound(&program).expect("bounds");
    let found = ways(&wiring, &Application::from(&program), std::slice::from_ref(&bounds)).expect("ways");
    assert_eq!(wiring.findings("absolute.toml", text, &program, &[Some(bounds)]), Findings::default());
    let sensed = |way: &&PinPath| way.inputs.iter().any(|end| ["n", "ca"].contains(&end.port.as_str()));
    for way in found.ways.iter().filter(sensed) {
        let acts = way.from_sample(Until::Acts);
        assert!(acts.is_none_or(|acts| acts.best == acts.worst), "{way:?}");
    }
}
