// SPDX-License-Identifier: MIT OR Apache-2.0
//! A drive in the complete top level: samples, ticks and half bridges on a carrier, their latency to the cycle, trips, missed deadlines.

use std::path::Path;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::latency::{Part, PinPath, Sample, Until, undivided, ways};
use takt_board::protocol::{ENABLE, HOLD, INPUTS, RESTART, RUN};
use takt_board::simulation::Simulation;
use takt_board::{Application, Board, Host, Kind, Wiring, model};
use takt_isa::timing::Span;
use takt_isa::{Program, T1};

/// Half a carrier's period.
const HALF: u32 = 300;
const PERIOD: u32 = 2 * HALF;
/// Cycles of the trip's filter.
const FILTER: u64 = 4;

const WIRING: &str = r#"
clock = 50
baud = 5_000_000
autostart = true
deadlines = 1000

[signals]
drive = "gp12"
tick = "gp13"

[carrier.main]
half = 300
tick = "valley"
after = 2

[carrier.second]
half = 300
phase = 0.25

[peripheral.adc]
kind = "spi"
pins = { clock = "gp3", select = "gn3", in = "gp4" }
half = 3
bits = 8
starts = "main.valley"
ports = { received = "x" }

[peripheral.now]
kind = "pwm3"
carrier = "main"
pins = { high_a = "gp0", low_a = "gn0", high_b = "gp1", low_b = "gn1", high_c = "gp2", low_c = "gn2" }
tripped = "low"
trips = ["fault"]
ports = { a = "a" }

[peripheral.valley]
kind = "pwm3"
carrier = "main"
pins = { high_a = "gp5", low_a = "gn5", high_b = "gp6", low_b = "gn6", high_c = "gp7", low_c = "gn7" }
update = "valley"
ports = { a = "b" }

[peripheral.later]
kind = "pwm3"
carrier = "second"
pins = { high_a = "gp8", low_a = "gn8", high_b = "gp9", low_b = "gn9", high_c = "gp10", low_c = "gn10" }
update = "peak"
tripped = "low"
trips = ["short"]
ports = { a = "c" }

[peripheral.fault]
kind = "trip"
pins = { in = "gp11" }
filter = 4
ports = { state = "tripped", clear = "clear" }

[peripheral.short]
kind = "trip"
pins = { in = "gn13" }
filter = 0
direct = 1

[peripheral.switch]
kind = "digital-in"
pins = { in = "gn11" }
hold = 1
latch = "main.peak"
ports = { level = "limit" }
"#;

/// Program with three duties, `da` to `dc`, to which the sample adds the bits of `ma` to `mc`; with `work`, a period takes too long.
const PROGRAM: &str = "
.input x:int, tripped:int, limit:int, work:int, reset:int, ma:int, mb:int, mc:int, da:int, db:int, dc:int
.output a:int, b:int, c:int, clear:int, seen:int
.reg s:int
.period
p:      iand s, x, ma
        iadd a, s, da
        iand s, x, mb
        iadd b, s, db
        iand s, x, mc
        iadd c, s, dc
        mov clear, reset
        iadd seen, tripped, limit
        bz work, done
        .for i, 1, 400
        iadd s, s, 1
        .endfor
done:   wait p
";

fn program() -> Program {
    let loader = MemoryLoader::new(&[("p.s", PROGRAM)]);
    let options = Options { machine: &T1, ..Options::default() };
    assemble("p.s", &loader, &options).unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

fn wiring() -> (Board, Wiring) {
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let wiring = Wiring::read("w.toml", WIRING, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    (board, wiring)
}

/// A board with the program in a folder, on which the host has set input ports, and which drives.
fn started(folder: &str, ports: &[(&str, u32)]) -> Host<Simulation> {
    let ((board, wiring), program) = (wiring(), program());
    wiring.check("w.toml", WIRING, &program).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let sim = Simulation::new(&board, &wiring, &program, &folder).unwrap_or_else(|error| panic!("{error}"));
    let mut host = Host::connect(sim, 5).unwrap_or_else(|error| panic!("{error}"));
    ports.iter().for_each(|(name, value)| set(&mut host, name, *value));
    host.line.run(5 * PERIOD, &[]).expect("it runs");
    assert!(level(&host.line, "signal_drive"), "the drive is on");
    host
}

/// Sets an input port of the program.
fn set(host: &mut Host<Simulation>, name: &str, value: u32) {
    let program = program();
    let port = program.inputs.iter().find(|port| port.name == name).expect("a port");
    let index = program.machine.inputs.index(port.register).expect("an input").get();
    host.write(INPUTS + index, &[value]).expect("it is written");
}

fn level(sim: &Simulation, pin: &str) -> bool {
    sim.output(pin).expect("a pin").0
}

/// Runs a cycle.
fn step(sim: &mut Simulation) {
    sim.run(1, &[]).expect("it runs");
}

/// Pins of a bridge's first phase, by its name.
fn phase(sim: &Simulation, bridge: &str) -> [bool; 2] {
    ["high_a", "low_a"].map(|pin| level(sim, &format!("{bridge}_{pin}")))
}

/// Runs until an output falls, or rises, and returns the number of the cycle.
fn run_to(sim: &mut Simulation, pin: &str, rises: bool) -> u64 {
    let mut was = level(sim, pin);
    for _ in 0..200 * PERIOD {
        step(sim);
        let now = level(sim, pin);
        if now != was && now == rises {
            return sim.cycles;
        }
        was = now;
    }
    panic!("`{pin}` does not change");
}

/// Cycles from the sample, the fall of the converter's select pin, until the duty of a bridge acts.
fn acts(bridge: &str) -> u64 {
    let ((_, wiring), program) = (wiring(), program());
    let bounds = takt_analysis::bound(&program).expect("bounds");
    let found = ways(&wiring, &Application::from(&program), std::slice::from_ref(&bounds)).expect("ways");
    let is_it = |way: &&PinPath| {
        way.inputs[0].sample == Some(Sample::Frame) && way.outputs.iter().any(|end| end.peripheral == bridge)
    };
    let mut way = found.ways.iter().find(is_it).expect("a way").clone();
    way.outputs.retain(|end| end.peripheral == bridge);
    let [acts, edge] = [Until::Acts, Until::Edge].map(|until| way.from_sample(until).expect("a bound"));
    // Without `work`, each period takes the least time.
    assert_eq!(edge.best, acts.best + 1);
    acts.best
}

const BRIDGES: [&str; 3] = ["now", "valley", "later"];

/// Cycles from the sample to the first difference at each bridge's pins between two boards, of which one has the other level at the
/// converter's pin from then on.
fn measured(duties: [u32; 3], mask: u32) -> [u64; 3] {
    let ports =
        [("ma", mask), ("mb", mask), ("mc", mask), ("da", duties[0]), ("db", duties[1]), ("dc", duties[2])];
    let mut sims = ["drive-low", "drive-high"].map(|folder| started(folder, &ports).line);
    let samples = sims.each_mut().map(|sim| run_to(sim, "adc_select", false));
    assert_eq!(samples[0], samples[1]);
    sims[1].set("adc_in", true);
    let mut found = [None; 3];
    while found.contains(&None) {
        sims.iter_mut().for_each(step);
        let cycles = sims[0].cycles - samples[0];
        assert!(cycles < 6 * u64::from(PERIOD), "no difference: {found:?}");
        for (bridge, found) in BRIDGES.iter().zip(&mut found) {
            let [low, high] = sims.each_ref().map(|sim| phase(sim, bridge));
            if low != high && found.is_none() {
                *found = Some(cycles);
            }
        }
    }
    found.map(|found| found.expect("found"))
}

#[test]
fn duties_act_as_early_and_as_late_as_the_bound_says() {
    let acts = BRIDGES.map(acts);
    // The sample falls in the second cycle of the carrier's period; the duty acts at place `q` of the rising half.
    let q = 1 + acts[0] as u32;
    assert!(q < HALF, "{q}");
    let at_q = 2 * (HALF - q);
    // The new edge is past, and comes at once; a valley comes with the longest pulse.
    let early = measured([at_q - 20, PERIOD - 64, 0], 64);
    assert_eq!(early[..2], [acts[0] + 1, acts[1] + 1]);
    // The edge that moves, by a cycle, is past; or it is the last of two halves.
    let late = measured([at_q, PERIOD - 1, 0], 1);
    assert_eq!(late, acts.map(|acts| acts + u64::from(PERIOD)));
}

/// The figures of docs/power-stage.md.
#[test]
fn the_example_acts_within_its_half() {
    let (text, source) = (
        include_str!("../../../programs/examples/board/drive.toml"),
        include_str!("../../../programs/examples/board/drive.s"),
    );
    let loader = MemoryLoader::new(&[("drive.s", source)]);
    let program = assemble("drive.s", &loader, &Options::default());
    let program = program.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program;
    let (board, _) = wiring();
    let wiring = Wiring::read("drive.toml", text, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    let bounds = takt_analysis::bound(&program).expect("bounds");
    let found = ways(&wiring, &Application::from(&program), std::slice::from_ref(&bounds)).expect("ways");
    assert!(found.late.is_empty(), "{:?}", found.late);
    // Currents reach the duties, and so does the encoder, which is latched with them.
    for (sample, inputs, before) in [(Sample::Frame, 2, 99), (Sample::Latch, 1, 0)] {
        let way = found.ways.iter().find(|way| way.inputs[0].sample == Some(sample)).expect("a way");
        assert_eq!((way.inputs.len(), way.outputs.len()), (inputs, 3), "{sample:?}");
        let cycles: Vec<(u64, u64)> = way.between.iter().map(|part| (part.best, part.worst)).collect();
        let until = if sample == Sample::Frame { 2 } else { 102 };
        assert_eq!(cycles, [(until, until), (6, 6), (111, 111), (12, 12)], "{sample:?}");
        let acts = way.from_sample(Until::Acts).expect("half bridges");
        let all = before + until + 6 + 111 + 12 + 2;
        assert_eq!((acts.best, acts.worst), (all, all), "{sample:?}");
        let edge = way.from_sample(Until::Edge).expect("half bridges");
        assert_eq!((edge.best, edge.worst), (all + 1, all + 3000), "{sample:?}");
    }
}

#[test]
fn trips_hold_until_they_are_cleared() {
    let mut host = started("drive-trip", &[("da", 300), ("db", 200), ("dc", 100)]);
    // The trip comes in each part of the carrier and of the exchange, among them the cycle of an update.
    for offset in (0..PERIOD).step_by(97).chain([160, 161, 162, 163, 164, 165]) {
        let sim = &mut host.line;
        run_to(sim, "signal_tick", true);
        sim.run(offset + 1, &[]).expect("it runs");
        sim.set("fault_in", true);
        for cycle in 1..=FILTER + 3 {
            step(sim);
            assert!(cycle < FILTER + 3 || phase(sim, "now") == [false, true], "offset {offset}");
        }
        for _ in 0..2 * PERIOD {
            step(sim);
            assert_eq!(phase(sim, "now"), [false, true], "offset {offset}");
            assert!(level(sim, "signal_drive"), "the others drive");
        }
        let text = host.tripped(Some(&wiring().1)).expect("it answers");
        assert_eq!(text, ["the trip `fault` is held: `now` is safe"]);
        assert_eq!(host.status().expect("it answers").causes().collect::<Vec<_>>(), ["trip"]);
        // Clearing has no effect while the pin still trips, nor has releasing the pin alone.
        set(&mut host, "reset", 1);
        host.line.run(3 * PERIOD, &[]).expect("it runs");
        assert!(!host.tripped(None).expect("it answers").is_empty());
        set(&mut host, "reset", 0);
        host.line.run(2 * PERIOD, &[]).expect("it runs");
        host.line.set("fault_in", false);
        host.line.run(3 * PERIOD, &[]).expect("it runs");
        assert!(!host.tripped(None).expect("it answers").is_empty());
        set(&mut host, "reset", 1);
        host.line.run(3 * PERIOD, &[]).expect("it runs");
        assert_eq!(host.tripped(None).expect("it answers"), Vec::<String>::new());
        set(&mut host, "reset", 0);
        run_to(&mut host.line, "now_high_a", true);
    }
}

#[test]
fn direct_trips_need_no_clock() {
    // A pin that stays, and a pulse that is gone before the trip is held.
    for (i, stays) in [true, false].into_iter().enumerate() {
        let mut host = started(&format!("drive-direct-{i}"), &[]);
        for (side, ends) in [("later_high_a", false), ("later_low_a", false), ("later_high_a", true)] {
            set(&mut host, "dc", 300);
            let sim = &mut host.line;
            run_to(sim, side, true);
            sim.run(if ends { 20 } else { 1 }, &[]).expect("it runs");
            assert!(level(sim, side));
            sim.set("short_in", true);
            step(sim);
            assert_eq!(phase(sim, "later"), [false; 2], "the same cycle");
            sim.set("short_in", stays);
            // Both are off until the trip is held, then the low one is on.
            for cycle in 2..=5 {
                step(sim);
                assert!(cycle == 5 || !level(sim, "later_high_a"), "cycle {cycle}");
            }
            assert_eq!(phase(sim, "later"), [false, true]);
            sim.set("short_in", false);
            sim.run(2 * PERIOD, &[]).expect("it runs");
            assert_eq!(phase(sim, "later"), [false, true], "held");
            let text = host.tripped(Some(&wiring().1)).expect("it answers");
            assert_eq!(text, ["the trip `short` is held: `later` is safe"]);
            host.set("control", RUN | ENABLE | RESTART).expect("it answers");
            host.line.run(4 * PERIOD, &[]).expect("it runs");
            assert_eq!(host.tripped(None).expect("it answers"), Vec::<String>::new(), "a start clears it");
        }
    }
}

#[test]
fn carriers_keep_their_phase() {
    let mut host = started("drive-phase", &[("da", 300), ("dc", 300)]);
    let period = u64::from(PERIOD);
    let place =
        |host: &mut Host<Simulation>, pin: &str, rises: bool| run_to(&mut host.line, pin, rises) % period;
    let sample = place(&mut host, "adc_select", false);
    // The tick comes 100 cycles after the valley, and the select pin falls one cycle after the valley.
    let tick = (sample + 99) % period;
    // Half a duty rises in the middle of the rising half; a quarter of a period later on the second carrier.
    let rises = (sample - 1 + u64::from(HALF) / 2 + 1) % period;
    let check = |host: &mut Host<Simulation>, when: &str| {
        assert_eq!(place(host, "signal_tick", true), tick, "{when}");
        assert_eq!(place(host, "adc_select", false), sample, "{when}");
        assert_eq!(place(host, "now_high_a", true), rises, "{when}");
        assert_eq!(place(host, "later_high_a", true), (rises + period / 4) % period, "{when}");
    };
    check(&mut host, "at the beginning");
    let misses = host.register("misses").expect("it answers");
    set(&mut host, "work", 1);
    host.line.run(7 * PERIOD, &[]).expect("it runs");
    set(&mut host, "work", 0);
    host.line.run(4 * PERIOD, &[]).expect("it runs");
    assert!(host.register("misses").expect("it answers") > misses, "a deadline is missed");
    check(&mut host, "after missed deadlines");
    let control = host.register("control").expect("it answers");
    host.set("control", control | HOLD).expect("it is held");
    host.line.run(2 * PERIOD + 77, &[]).expect("it runs");
    host.set("control", control).expect("it goes on");
    host.line.run(2 * PERIOD, &[]).expect("it runs");
    check(&mut host, "after it was held");
    // Neither period nor lead can be changed: ticks would leave the carrier.
    assert!(host.set("period", 1234).is_err() && host.set("lead", 3).is_err());
    // Whenever it starts, the switches are off until a valley.
    for pause in [13, 250, 411] {
        host.set("control", 0).expect("it stops");
        host.line.run(PERIOD + pause, &[]).expect("it runs");
        assert_eq!(phase(&host.line, "now"), [false; 2]);
        host.set("control", control | takt_board::protocol::RESTART).expect("it starts");
        let first = run_to(&mut host.line, "now_low_a", true) % period;
        assert_eq!(first, sample, "the low switch goes on a cycle after the valley");
        // A start writes zeros into input ports.
        set(&mut host, "da", 300);
        set(&mut host, "dc", 300);
        host.line.run(3 * PERIOD, &[]).expect("it runs");
        check(&mut host, "after a start");
    }
}

/// Least and most cycles from a put, at a position of the carrier, to the first change at a pin, over all pairs of duties.
fn shows(parameters: &[u32], half: u32, at: u32) -> (u64, u64) {
    let kind = Kind::from_name("pwm3").expect("a kind");
    let put = 4 * half + at;
    let runs = |old: u32, new: u32| -> Vec<Vec<u32>> {
        let parameters: Vec<u32> = parameters.iter().copied().chain([half]).collect();
        let mut model = model::of(kind, &parameters).expect("a model");
        let clock = |cycle: u32| {
            let duty = if cycle < put { old } else { new };
            let is_put = u32::from(cycle == 0 || cycle == put);
            model.clock(&[0, 1, 0, 0, cycle % half, cycle / half % 2, is_put, duty, 0, 0]);
            model.outputs()
        };
        (0..put + 6 * half).map(clock).collect()
    };
    let mut found = (u64::MAX, 0);
    for old in 0..=2 * half {
        let without = runs(old, old);
        for new in 0..=2 * half {
            let first = runs(old, new).iter().zip(&without).position(|(a, b)| a != b);
            let Some(first) = first else { continue };
            let cycles = first as u64 + 1 - u64::from(put);
            found = (found.0.min(cycles), found.1.max(cycles));
        }
    }
    found
}

/// The first cycle in which a new duty shows, for each kind of update and each place of a put; dead time makes it no later.
#[test]
fn a_duty_shows_as_late_as_the_bound_says() {
    let (board, _) = wiring();
    let half = 8;
    for (update, name) in ["now", "valley", "peak", "either"].iter().enumerate() {
        for after in 0..2 * half {
            let bound = |dead: u32| {
                let text = format!(
                    "clock = 50\n[carrier.main]\nhalf = {half}\ntick = \"valley\"\nevery = 4\nafter = {}\n[peripheral.s]\nkind = \"digital-in\"\npins = {{ in = \"gp3\" }}\nports = {{ level = \"n\" }}\n[peripheral.m]\nkind = \"pwm3\"\ncarrier = \"main\"\nupdate = \"{name}\"\ndead = {dead}\npins = {{ high_a = \"gp0\", low_a = \"gn0\", high_b = \"gp1\", low_b = \"gn1\", high_c = \"gp2\", low_c = \"gn2\" }}\nports = {{ a = \"a\" }}\n",
                    f64::from(after) / 50.0
                );
                let wiring = Wiring::read("w.toml", &text, &board).unwrap_or_else(|e| panic!("{e:?}"));
                let path = undivided(&wiring, Span { best: 0, worst: 0 }).remove(0);
                let busy = Part::sum("", &path.between[1..]).best;
                (Part::sum("", &path.outputs[0].parts), (u64::from(after) + busy) % u64::from(2 * half))
            };
            let (part, at) = bound(0);
            let found = shows(&[0, 0, update as u32, 0, 0, 0, 0, 0], half, at as u32);
            assert_eq!(found, (part.best, part.worst), "{name}, a put at {at}");
            let (part, at) = bound(2);
            let (least, most) = shows(&[2, 0, update as u32, 0, 0, 0, 0, 0], half, at as u32);
            assert!(
                part.best <= least && most <= part.worst,
                "{name}, a put at {at}: {least} to {most}: {part:?}"
            );
        }
    }
}
