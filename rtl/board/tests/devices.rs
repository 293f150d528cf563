// SPDX-License-Identifier: MIT OR Apache-2.0
//! Devices at simulated pins against the models of their peripherals, with planted faults; actuators; runs that end with an edge at a pin.

use std::path::Path;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::device::{self, Actuator, BridgeState, Device, NeededPin};
use takt_board::model::{self, Model};
use takt_board::simulation::{Edge, Simulation, Watched};
use takt_board::{Board, Wiring};
use takt_isa::T1;

fn wiring(peripheral: &str) -> Wiring {
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let text = format!("clock = 50\nperiod = 100\n[peripheral.p]\n{peripheral}");
    Wiring::read("w.toml", &text, &board).unwrap_or_else(|mistakes| panic!("{}", mistakes[0]))
}

/// Fault at the pins between device and peripheral.
type Fault = fn(cycle: u64, levels: &mut [bool]);

/// A device at the pins of a peripheral's model.
struct Bench {
    wiring: Wiring,
    model: Box<dyn Model>,
    device: Box<dyn Device>,
    cycle: u64,
    was: Vec<bool>,
    fault: Fault,
}

impl Bench {
    fn new(peripheral: &str, register: &str, value: f64) -> Bench {
        Bench::with_fault(peripheral, register, value, |_, _| {})
    }

    fn with_fault(peripheral: &str, register: &str, value: f64, fault: Fault) -> Bench {
        let wiring = wiring(peripheral);
        let of = &wiring.peripherals[0];
        let model = model::of(of.kind, &of.parameters).unwrap();
        let device = device::of(of, register, value).unwrap_or_else(|text| panic!("{text}"));
        let mut bench = Bench { wiring, model, device, cycle: 0, was: Vec::new(), fault };
        for _ in 0..10 {
            bench.cycle(value, &["rst"]);
        }
        bench
    }

    /// A cycle in which these inputs of the peripheral are 1.
    fn cycle(&mut self, value: f64, high: &[&str]) {
        let kind = self.wiring.peripherals[0].kind;
        let (takes, gives) = kind.ports();
        let outputs = self.model.outputs();
        let pins = self.device.pins();
        let levels: Vec<bool> = pins
            .needed
            .iter()
            .map(|(pin, _)| outputs[gives.iter().position(|(n, _)| *n == format!("pin_{pin}")).unwrap()] == 1)
            .collect();
        let edge = |(i, (_, edge)): (usize, &(&str, Edge))| {
            let changed = self.was.get(i).is_some_and(|was| *was != levels[i]);
            let counts = match edge {
                Edge::Rise => levels[i],
                Edge::Fall => !levels[i],
                Edge::Both => true,
            };
            NeededPin { level: levels[i], edge: changed && counts }
        };
        let needed: Vec<NeededPin> = pins.needed.iter().enumerate().map(edge).collect();
        // A simulation calls a device only when it must.
        let is_due = self.device.next().is_some_and(|next| next <= self.cycle);
        if is_due || needed.iter().any(|pin| pin.edge) || self.cycle.is_multiple_of(40) {
            self.device.act(self.cycle, &needed, value);
        }
        self.was = levels;
        let mut driven = self.device.levels().to_vec();
        (self.fault)(self.cycle, &mut driven);
        let inputs = takes.iter().map(|(name, _)| {
            let pin = pins.driven.iter().position(|pin| *name == format!("pin_{pin}"));
            u32::from(pin.map_or(high.contains(&name.as_str()), |pin| driven[pin]))
        });
        let inputs: Vec<u32> = inputs.collect();
        self.model.clock(&inputs);
        self.cycle += 1;
    }

    fn run(&mut self, value: f64, cycles: u32) {
        for _ in 0..cycles {
            self.cycle(value, &[]);
        }
    }

    /// Registers, captured now.
    fn read(&mut self, value: f64) -> impl Fn(&str) -> i32 + use<> {
        self.cycle(value, &["take"]);
        let (_, gives) = self.wiring.peripherals[0].kind.ports();
        let outputs = self.model.outputs();
        move |name| {
            let at = gives.iter().position(|(own, _)| *own == format!("r_{name}")).unwrap();
            outputs[at].cast_signed()
        }
    }

    /// A frame of at most so many cycles, with the rest after it.
    fn frame(&mut self, value: f64, cycles: u32) -> impl Fn(&str) -> i32 + use<> {
        self.cycle(value, &["start"]);
        self.run(value, cycles);
        self.read(value)
    }
}

const PINS: &str = "pins = { clock = \"gp0\", select = \"gn0\", in = \"gp1\" }";

#[test]
fn a_converter_is_read_in_all_modes() {
    for (mode, signed) in (0..4).flat_map(|mode| [(mode, 0), (mode, 1)]) {
        for (bits, half) in [(12, 3), (16, 5), (32, 4)] {
            let text = format!(
                "kind = \"spi\"\n{PINS}\nhalf = {half}\nbits = {bits}\npolarity = {}\nphase = {}\nsigned = {signed}\n\
                 ports = {{ received = \"x\" }}",
                mode & 1,
                mode >> 1
            );
            let mut bench = Bench::new(&text, "received", 0.0);
            let (least, most) = device::range(&bench.wiring.peripherals[0]).unwrap();
            // Whole numbers, the next lower one of others, and ends of the range for what is beyond.
            let cases = [
                (1.0, 1.0),
                (1234.9, 1234.0),
                (-3.5, if signed == 1 { -4.0 } else { 0.0 }),
                (1e12, most),
                (-1e12, least),
                (2047.0, 2047.0),
            ];
            for (i, (value, wanted)) in (1..).zip(cases) {
                let read = bench.frame(value, 40 * (2 * bits + 3));
                let got = if signed == 1 {
                    f64::from(read("received"))
                } else {
                    f64::from(read("received").cast_unsigned())
                };
                assert_eq!(
                    (got, read("frames")),
                    (wanted, i),
                    "mode {mode}, {bits} bits, signed {signed}: {value}"
                );
            }
        }
    }
}

#[test]
fn a_converter_samples_at_the_fall_of_its_select_pin() {
    let text = format!("kind = \"spi\"\n{PINS}\nports = {{ received = \"x\" }}");
    let mut bench = Bench::new(&text, "received", 100.0);
    bench.run(100.0, 20);
    bench.cycle(100.0, &["start"]);
    // The select pin falls in the next cycle.
    bench.cycle(200.0, &[]);
    bench.run(300.0, 400);
    assert_eq!(bench.read(300.0)("received"), 200);
    // A line that is stuck, and a bit that is inverted.
    let stuck = |_: u64, levels: &mut [bool]| levels[0] = false;
    assert_eq!(Bench::with_fault(&text, "received", 100.0, stuck).frame(100.0, 400)("received"), 0);
    let spoiled = |cycle: u64, levels: &mut [bool]| levels[0] ^= (60..70).contains(&cycle);
    assert_ne!(Bench::with_fault(&text, "received", 100.0, spoiled).frame(100.0, 400)("received"), 100);
}

/// Converters with a line each, which share clock and select.
#[test]
fn lines_of_a_converter_are_read_at_once() {
    let pins = "pins = { clock = \"gp0\", select = \"gn0\", in = \"gp1\", in2 = \"gn1\", in8 = \"gp2\" }";
    let ports = "ports = { received = \"x\", received2 = \"y\", received8 = \"z\" }";
    let text = format!("kind = \"spi\"\n{pins}\nbits = 14\nsigned = 1\n{ports}");
    for register in ["received", "received2", "received8"] {
        let mut bench = Bench::new(&text, register, 0.0);
        for value in [-8192.0, 8191.0, -1.0, 3.0] {
            let read = bench.frame(value, 400);
            for other in ["received", "received2", "received3", "received8"] {
                let wanted = if other == register { value as i32 } else { 0 };
                assert_eq!(read(other), wanted, "{register} of {value}: {other}");
            }
        }
    }
}

const CLOCKED: &str = "pins = { clock = \"gp0\", data = \"gp1\" }";

#[test]
fn an_ssi_encoder_is_read() {
    for (bits, turn, gray, double, half) in
        [(13, 13, 0, 0, 3), (25, 13, 1, 0, 5), (36, 32, 1, 1, 4), (17, 12, 0, 1, 30)]
    {
        let text = format!(
            "kind = \"ssi\"\n{CLOCKED}\nhalf = {half}\nbits = {bits}\nturn = {turn}\ngray = {gray}\ndouble = {double}\npause = 200\n\
             ports = {{ position = \"n\" }}"
        );
        let mut bench = Bench::new(&text, "position", 5.0);
        bench.run(5.0, 300);
        for (i, value) in (1..).zip([5.5, 8000.0, 123_456.7, -1.0, -70_000.2]) {
            let read = bench.frame(value, 2 * half * (2 * bits + 2) + 210);
            let whole = (value.floor() as i64).rem_euclid(1 << bits);
            let wanted = ((whole % (1 << turn)) as i32, (whole >> turn) as i32, i, 0);
            assert_eq!(
                (read("position"), read("turns"), read("frames"), read("errors")),
                wanted,
                "{bits}: {value}"
            );
        }
    }
}

#[test]
fn a_broken_cable_of_an_ssi_encoder_counts_as_an_error() {
    let text = |double: u32| {
        format!(
            "kind = \"ssi\"\n{CLOCKED}\nhalf = 3\nbits = 13\ndouble = {double}\npause = 100\nports = {{ position = \"n\" }}"
        )
    };
    let broken = |cycle: u64, levels: &mut [bool]| levels[0] &= cycle < 1000;
    let mut bench = Bench::with_fault(&text(0), "position", 77.0, broken);
    bench.run(77.0, 200);
    let read = bench.frame(77.0, 300);
    assert_eq!((read("position"), read("frames"), read("errors")), (77, 1, 0));
    bench.run(99.0, 600);
    let read = bench.frame(99.0, 300);
    assert_eq!((read("position"), read("frames"), read("errors")), (77, 1, 1));
    // Frames that are sent twice show a bit that is inverted.
    let spoiled = |cycle: u64, levels: &mut [bool]| levels[0] ^= (260..266).contains(&cycle);
    let mut bench = Bench::with_fault(&text(1), "position", 77.0, spoiled);
    bench.run(77.0, 200);
    let read = bench.frame(77.0, 400);
    assert_eq!((read("frames"), read("errors")), (0, 1));
}

const BISS: &str = "kind = \"biss-c\"\npins = { ma = \"gp0\", slo = \"gp1\" }";

#[test]
fn a_biss_encoder_is_read_and_its_crc_is_right() {
    for (bits, turn, half) in [(18, 18, 2), (26, 14, 4), (36, 32, 9)] {
        let text = format!(
            "{BISS}\nhalf = {half}\nbits = {bits}\nturn = {turn}\ntimeout = 120\nports = {{ position = \"n\" }}"
        );
        let mut bench = Bench::new(&text, "position", 1.0);
        bench.run(1.0, 200);
        for (i, value) in (1..).zip([1.0, 100_000.9, -5.0, 262_143.0, 0.0]) {
            let read = bench.frame(value, 2 * half * (bits + 16) + 150);
            let whole = (value.floor() as i64).rem_euclid(1 << bits);
            let wanted = ((whole % (1 << turn)) as i32, (whole >> turn) as i32, i);
            assert_eq!((read("position"), read("turns"), read("frames")), wanted, "{bits}: {value}");
            assert_eq!(
                ["error", "warning", "errors", "silent", "delay"].map(&read),
                [0; 5],
                "{bits}: {value}"
            );
        }
    }
}

#[test]
fn spoiled_and_broken_biss_lines_are_counted() {
    let text = format!("{BISS}\nhalf = 2\nbits = 18\ntimeout = 120\nports = {{ position = \"n\" }}");
    let at = |fault: Fault| {
        let mut bench = Bench::with_fault(&text, "position", 1000.0, fault);
        bench.run(1000.0, 200);
        let read = bench.frame(1000.0, 400);
        ["position", "frames", "errors", "silent"].map(&read)
    };
    assert_eq!(at(|_, _| {}), [1000, 1, 0, 0]);
    assert_eq!(at(|cycle, levels| levels[0] ^= (250..254).contains(&cycle)), [0, 0, 1, 0]);
    assert_eq!(at(|_, levels| levels[0] = true), [0, 0, 0, 1]);
    assert_eq!(at(|_, levels| levels[0] = false), [0, 0, 0, 1]);
}

#[test]
fn a_modulator_has_the_mean_of_its_value() {
    let out = "pins = { data = \"gp0\", clock = \"gn0\" }\nclock = \"out\"";
    let own = "pins = { data = \"gp0\", clock_in = \"gn0\" }\nclock = \"in\"";
    for (pins, half) in [(out, 3), (out, 2), (own, 4)] {
        let text = format!(
            "kind = \"sinc3\"\n{pins}\nhalf = {half}\nosr = 64\nfast = 16\nlimit = 3900\nports = {{ value = \"x\" }}"
        );
        let full = 64.0_f64.powi(3);
        for part in [0.0, 0.1, -0.33, 0.5, -0.78] {
            let value = part * full;
            let mut bench = Bench::new(&text, "value", value);
            let mut most = 0.0_f64;
            bench.run(value, 2 * half * 64 * 6);
            for _ in 0..20 {
                bench.run(value, 2 * half * 64);
                let read = bench.read(value);
                most = most.max((f64::from(read("value")) - value).abs());
                assert_eq!(read("trips"), 0);
            }
            // Quantisation noise of a second-order modulator behind this filter.
            assert!(most < 2e-3 * full, "{part} of full scale: {most}");
        }
        // Beyond full scale it is at its end, which is an overcurrent; so is a line that no longer changes.
        let mut bench = Bench::new(&text, "value", 0.0);
        bench.run(0.0, 3000);
        assert_eq!(bench.read(0.0)("trips"), 0);
        bench.run(2.0 * full, 2 * half * 64 * 8);
        let read = bench.read(2.0 * full);
        assert_eq!((read("value"), read("trips")), (64 * 64 * 64, 1));
        let mut bench = Bench::with_fault(&text, "value", 0.0, |cycle, levels| levels[0] &= cycle < 3000);
        bench.run(0.0, 6000);
        assert_eq!(bench.read(0.0)("trips"), 1);
    }
}

#[test]
fn an_incremental_encoder_counts_both_ways() {
    let text =
        "kind = \"quadrature\"\npins = { a = \"gp0\", b = \"gn0\" }\nstart = -7\nports = { count = \"n\" }";
    let mut bench = Bench::new(text, "count", -6.5);
    let mut value = -6.5;
    // Faster and faster, back, and to and fro about an edge; a count takes more than the filter's cycles.
    for i in 0..40_000_u32 {
        value += match i {
            0..=19_999 => f64::from(i) * 8e-6,
            20_000..=38_999 => 0.16 - f64::from(i - 20_000) * 1.6e-5,
            _ => 0.01 * f64::from(i).sin(),
        };
        bench.cycle(value, &[]);
        if i.is_multiple_of(97) {
            let (before, read) = (value, bench.read(value));
            assert!(
                (f64::from(read("count")) - before.floor()).abs() <= 2.0,
                "{i}: {} at {before}",
                read("count")
            );
            assert_eq!(read("errors"), 0, "{i}");
        }
    }
    bench.run(value, 50);
    assert_eq!(f64::from(bench.read(value)("count")), value.floor());
    // Tracks that are exchanged count the other way.
    let mut bench = Bench::with_fault(text, "count", -6.5, |_, levels| levels.swap(0, 1));
    (0..1000).for_each(|i| bench.cycle(-6.5 + 0.05 * f64::from(i), &[]));
    assert!(bench.read(43.0)("count") < -40);
}

#[test]
fn hall_sensors_and_switches_are_read() {
    let text = "kind = \"hall\"\npins = { a = \"gp0\", b = \"gn0\", c = \"gp1\" }\nports = { count = \"n\", sector = \"s\" }";
    let mut bench = Bench::new(text, "count", 0.5);
    for value in [0.5, 1.5, 2.0, 3.9, 4.0, 5.5, 6.5, 5.5, 3.2, -0.5, -2.5] {
        bench.run(value, 100);
        let read = bench.read(value);
        let whole = value.floor() as i32;
        assert_eq!(
            ["count", "sector", "fault", "errors"].map(&read),
            [whole, whole.rem_euclid(6), 0, 0],
            "{value}"
        );
    }
    // A sensor that is stuck leads to forbidden states.
    let mut bench = Bench::with_fault(text, "count", 0.5, |_, levels| levels[1] = false);
    (0..600).for_each(|i| bench.cycle(0.01 * f64::from(i), &[]));
    assert!(bench.read(6.0)("errors") > 0);
    for invert in [0, 1] {
        let text = format!(
            "kind = \"digital-in\"\npins = {{ in = \"gp0\" }}\ninvert = {invert}\nports = {{ level = \"x\" }}"
        );
        let mut bench = Bench::new(&text, "level", 0.0);
        bench.run(0.0, 100);
        assert_eq!(bench.read(0.0)("level"), 0);
        bench.run(1.0, 100);
        assert_eq!(bench.read(1.0)("level"), 1);
    }
}

#[test]
fn refuses_kinds_without_device_and_values_out_of_range() {
    let refuse = |text: &str, register: &str, value: f64| {
        device::of(&wiring(text).peripherals[0], register, value).map(|_| ()).unwrap_err()
    };
    let step = "kind = \"step\"\npins = { step = \"gp0\", direction = \"gn0\" }\nports = { count = \"n\" }";
    assert!(refuse(step, "count", 0.0).contains("`p` is of the kind `step`, which has no device"));
    let ssi = format!("kind = \"ssi\"\n{CLOCKED}\nports = {{ frames = \"n\" }}");
    assert!(refuse(&ssi, "frames", 0.0).contains("a signal feeds `position`"));
    let spi = format!("kind = \"spi\"\n{PINS}\nbits = 12\nports = {{ received = \"x\" }}");
    assert!(refuse(&spi, "received", 5000.0).contains("`received` has 0 to 4095"));
    let encoder = "kind = \"quadrature\"\npins = { a = \"gp0\", b = \"gn0\" }\nports = { count = \"n\" }";
    assert!(refuse(encoder, "count", 12.5).contains("`start = 12` in the wiring"));
}

#[test]
fn actuators_have_the_facts_of_their_wiring() {
    let wiring = wiring(
        "kind = \"pwm\"\npins = { high = \"gp0\", low = \"gn0\" }\nhalf = 500\nports = { duty = \"x\" }\nscale = { duty = 256 }\n\
         [peripheral.level]\nkind = \"sigma-delta\"\npins = { out = \"gp1\" }\nports = { value = \"y\" }\nscale = { value = 16384 }",
    );
    let pwm = Actuator::of(&wiring, "x").unwrap().unwrap();
    assert_eq!((pwm.duty(), pwm.pins.len(), pwm.is_bridge()), (Some((0.256, 0.5)), 2, true));
    let states =
        [[true, false], [false, true], [false, false], [true, true]].map(|levels| pwm.state(&levels));
    assert_eq!(states, [BridgeState::High, BridgeState::Low, BridgeState::Off, BridgeState::Short]);
    assert_eq!(pwm.state(&[false]), BridgeState::Low);
    // The upper switch is on in 600 of 1000 cycles, the lower one in 344.
    assert!((pwm.mean(&[600, 344], 1000) - 0.628).abs() < 1e-12 && pwm.mean(&[250], 1000) == 0.25);
    // A pulse of 628 cycles in 1000 is 128 more than half: 0.5 of the port.
    assert!((pwm.port(0.628) - 0.5).abs() < 1e-12);
    let level = Actuator::of(&wiring, "y").unwrap().unwrap();
    assert!((level.port(0.75) - 1.0).abs() < 1e-12 && level.duty().is_none());
    assert!(Actuator::of(&wiring, "z").is_none());
}

/// Wiring and program of a lamp that is lit in every second period.
const LAMP: &str = "clock = 50\nperiod = 10\nautostart = true\n[signals]\ntick = \"gp13\"\n[peripheral.lamp]\nkind = \"digital-out\"\n\
    pins = { out = \"gp1\" }\nports = { level = \"y\" }\n[peripheral.switch]\nkind = \"digital-in\"\npins = { in = \"gp2\" }\n\
    ports = { level = \"x\" }\n";
const PROGRAM: &str = "
.input x:int
.output y:int
.state s:int
.once
        s = 0
        wait p
.period
p:      iadd s, s, 1
        iand y, s, 1
        wait p
";

#[test]
fn a_watched_run_ends_with_the_first_edge() {
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let wiring = Wiring::read("w.toml", LAMP, &board).unwrap_or_else(|mistakes| panic!("{}", mistakes[0]));
    let loader = MemoryLoader::new(&[("p.s", PROGRAM)]);
    let options = Options { machine: &T1, ..Options::default() };
    let program = assemble("p.s", &loader, &options)
        .unwrap_or_else(|errors| panic!("{}", errors.render(false)))
        .program;
    let folder = |name: &str| Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("devices-{name}"));
    let start = |name: &str| {
        let mut sim = Simulation::new(&board, &wiring, &program, &folder(name)).unwrap();
        sim.run(3000, &[]).unwrap();
        sim
    };
    // Cycle by cycle: the edges of the lamp, and the ticks.
    let mut single = start("single");
    let (mut rises, mut falls, mut ticks) = (Vec::new(), Vec::new(), Vec::new());
    let mut was = single.output("lamp_out").unwrap().0;
    for _ in 0..4000 {
        single.run(1, &[]).unwrap();
        let (level, cycle) = (single.output("lamp_out").unwrap().0, single.cycles);
        if level != was {
            if level { rises.push(cycle) } else { falls.push(cycle) }
        }
        if single.output("signal_tick").unwrap().1 > 0 {
            ticks.push(cycle);
        }
        was = level;
    }
    assert!(rises.len() == 3 && falls.len() == 2 && ticks.len() == 7, "{rises:?}, {falls:?}, {ticks:?}");
    let lamp = single.outputs().iter().position(|pin| pin == "lamp_out").unwrap();
    for (edge, tick, wanted) in
        [(Edge::Rise, false, &rises), (Edge::Fall, false, &falls), (Edge::Both, true, &ticks)]
    {
        let mut sim = start("watched");
        let pins = if tick { Vec::new() } else { vec![(lamp, edge)] };
        let watched = Watched { pins, tick };
        for cycle in wanted {
            let stop = sim.run_watched(100_000, &[], &watched).unwrap();
            assert_eq!((sim.cycles, stop.tick), (*cycle, tick), "{edge:?}");
            assert_eq!(stop.edges, if tick { vec![] } else { vec![true] });
        }
        // A run without an edge has its length.
        let stop = sim.run_watched(3, &[], &watched).unwrap();
        assert_eq!((stop.cycles, stop.edges.contains(&true)), (3, false));
    }
    // The register that the program reads, as it was captured at the tick.
    single.set("switch_in", true);
    let seen =
        |sim: &Simulation| sim.seen().map(|(port, value)| (port.to_owned(), value)).collect::<Vec<_>>();
    assert_eq!(seen(&single), [("x".to_owned(), 0)]);
    single.run(1000, &[]).unwrap();
    assert_eq!(seen(&single), [("x".to_owned(), 1)]);
}
