// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compares every peripheral's circuit with its model, in every cycle; faults planted in the circuits must be found.
#![allow(clippy::print_stdout)]

use crate::harness::encoders::{BehindPins, BissEncoder, Encoder, SsiEncoder};
use crate::harness::{Part, RESET, build, compare, run};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use std::cell::RefCell;
use std::fs;
use std::path::PathBuf;
use std::rc::Rc;
use takt_board::model::{self, Carrier, Tick, UartReceive, UartSend};
use takt_board::{Kind, VERILOG, kind};

/// Cycles of a comparison.
const CYCLES: u32 = 30_000;

/// Random stimuli from a seed.
#[derive(Clone)]
struct Random(Pcg64);

impl Random {
    fn new(seed: u64) -> Random {
        Random(Pcg64::seed_from_u64(seed))
    }

    fn bits(&mut self) -> u32 {
        self.0.next_u32()
    }

    fn one_in(&mut self, n: u32) -> bool {
        self.bits().is_multiple_of(n)
    }

    /// A random number near an edge of `span`, within `span`, or anywhere.
    fn value(&mut self, span: u32) -> u32 {
        let near = self.bits() % 3;
        let value = match self.bits() % 6 {
            0 => near,
            1 => span.wrapping_sub(1).wrapping_add(near),
            2 | 3 => self.bits() % (span + 1),
            4 => [0, 1 << 31, u32::MAX, i32::MAX as u32][self.bits() as usize % 4],
            _ => self.bits(),
        };
        if self.bits().is_multiple_of(2) { value.wrapping_neg() } else { value }
    }
}

/// Parameters to test a kind with, in the order of its table: the shortest, the usual, and the longest that a short run can see.
fn variants(kind: &Kind) -> Vec<Vec<u32>> {
    match kind.name {
        "quadrature" => vec![vec![1, 0], vec![3, 3_572_338], vec![10, u32::MAX - 3]],
        "step" | "hall" => vec![vec![1], vec![3], vec![10]],
        "pwm" => vec![vec![1, 0, 1], vec![20, 3, 1], vec![33, 0, 0], vec![50, 60, 0], vec![7, 1, 0]],
        "pwm3" => vec![
            vec![0, 0, 0, 0, 0, 0, 0, 0, 9],
            vec![3, 2, 0, 1, 1, 0, 1, 2, 20],
            vec![2, 6, 1, 0, 0, 1, 2, 1, 12],
            vec![0, 5, 2, 1, 1, 1, 0, 1, 15],
            vec![5, 0, 3, 0, 0, 0, 2, 0, 11],
        ],
        "trip" => vec![vec![0, 0, 0], vec![1, 1, 0], vec![7, 0, 0], vec![0, 0, 1], vec![0, 1, 1]],
        "sigma-delta" => vec![vec![0], vec![1]],
        "spi" => vec![
            vec![3, 1, 0, 0, 0, 1],
            vec![3, 16, 0, 0, 1, 0x8001],
            vec![4, 24, 1, 0, 0, 0],
            vec![3, 32, 0, 1, 1, 0xdead_beef],
            vec![5, 12, 1, 1, 1, 0xfff],
        ],
        "ssi" => vec![
            vec![3, 8, 24, 0, 0, 1],
            vec![4, 13, 24, 1, 0, 30],
            vec![3, 25, 12, 1, 1, 20],
            vec![5, 36, 5, 0, 1, 17],
            vec![3, 36, 32, 0, 0, 9],
        ],
        "biss-c" => vec![
            vec![2, 12, 24, 9, 1],
            vec![3, 18, 12, 12, 40],
            vec![4, 26, 13, 10, 25],
            vec![2, 36, 5, 7, 60],
            vec![2, 36, 32, 30, 30],
        ],
        "sinc3" => vec![
            vec![2, 0, 8, 8, 200],
            vec![3, 0, 11, 9, 729],
            vec![2, 1, 16, 12, 600],
            vec![2, 0, 256, 32, 20_000],
            vec![4, 1, 64, 16, 0],
        ],
        "digital-in" => vec![vec![1, 0], vec![20, 1], vec![300, 0]],
        "digital-out" => vec![vec![0], vec![1]],
        other => panic!("write the stimuli of {other}"),
    }
}

/// The values on a kind's inputs, except for the reset.
fn stimulus(kind: &'static Kind, parameters: &[u32], seed: u64) -> Box<dyn FnMut(u32) -> Vec<u32>> {
    let mut random = Random::new(seed);
    let (takes, _) = kind.ports();
    let names: Vec<String> = takes.into_iter().skip(1).map(|(name, _)| name).collect();
    let is_hall = kind.name == "hall";
    let hold = match kind.name {
        "quadrature" | "step" | "hall" | "digital-in" => parameters[0],
        "trip" => parameters[0].max(1),
        _ => 1,
    };
    if kind.name == "sinc3" {
        return modulated(kind, parameters, random);
    }
    let mut behind = encoder(kind, parameters);
    let half = parameters.get(kind.parameters.len()).copied();
    let span = if kind.name == "pwm" { parameters[0] } else { half.unwrap_or(1 << 15) };
    // Most pins stay for about as long as the filter needs to pass a level; an encoder's pins change in order most of the time.
    let mut levels = vec![(0, 0); names.len()];
    let (mut place, mut upward, mut until, mut disabled) = (0_u32, true, 0, 0);
    Box::new(move |cycle| {
        if cycle >= until {
            until = cycle + if random.one_in(3) { hold } else { 1 + random.bits() % (2 * hold + 3) };
            upward ^= random.one_in(20);
            place = place.wrapping_add(if random.one_in(30) {
                2
            } else if upward {
                1
            } else {
                3
            });
        }
        if random.one_in(2000) {
            disabled = cycle + random.bits() % 30;
        }
        let mut value = |i: usize, name: &str| match name {
            "enable" => u32::from(cycle >= disabled),
            "start" => random.one_in(if cycle % 4096 < 1024 { 20 } else { 400 }).into(),
            // The trip outlasts the time without enable, and comes alone.
            "trip" => u32::from(cycle < disabled + 5 && disabled.is_multiple_of(2) || random.one_in(300)),
            "off" => random.one_in(500).into(),
            "clear" => random.one_in(50).into(),
            "place" => cycle % half.expect("a carrier"),
            "back" => cycle / half.expect("a carrier") % 2,
            "w_clear" => random.bits() % 2,
            "w_stop" => random.one_in(4).into(),
            "take" => random.one_in(11).into(),
            "put" => random.one_in(if cycle % 4096 < 1024 { 5 } else { 150 }).into(),
            // A third of a turn between the pins of Hall sensors; a jump of the place makes a forbidden state now and then.
            "pin_a" | "pin_b" | "pin_c" if is_hall => {
                let at = (place + 4 * u32::from(name == "pin_b") + 2 * u32::from(name == "pin_c")) % 6;
                u32::from(if random.one_in(4000) { at < 5 } else { at < 3 })
            }
            "pin_a" => u32::from((place + 1) & 2 != 0),
            "pin_b" => u32::from(place & 2 != 0),
            "w_level" => random.bits() % 3,
            name if name.starts_with("w_") => random.value(span),
            _ => {
                let (level, until) = &mut levels[i];
                if cycle >= *until {
                    *level ^= 1;
                    *until = cycle + 1 + random.bits() % (2 * hold + 2);
                }
                *level
            }
        };
        let mut inputs: Vec<u32> = names.iter().enumerate().map(|(i, name)| value(i, name)).collect();
        if let Some((pin, behind)) = &mut behind {
            inputs[*pin] = behind.level(&inputs, cycle < RESET);
        }
        inputs
    })
}

/// The inputs of a filter: bits whose density drifts, a clock of the modulator, and starts that come in step with the windows most of the
/// time.
fn modulated(kind: &'static Kind, parameters: &[u32], mut random: Random) -> Box<dyn FnMut(u32) -> Vec<u32>> {
    let (takes, _) = kind.ports();
    let names: Vec<String> = takes.into_iter().skip(1).map(|(name, _)| name).collect();
    let window = 2 * parameters[0] * parameters[2];
    let (mut density, mut step, mut next) = (500_u32, 1, 700);
    let (mut clock, mut edge) = (0, 0);
    Box::new(move |cycle| {
        if random.one_in(200) {
            step = random.bits() % 7;
        }
        density = (density + step).saturating_sub(3).min(1000);
        if cycle >= edge {
            clock ^= 1;
            edge = cycle + 2 + random.bits() % 2;
        }
        let is_start = cycle == next;
        if is_start {
            next +=
                if random.one_in(6) { 1 + random.bits() % window } else { window * (1 + random.bits() % 5) };
        }
        let mut value = |name: &str| match name {
            "clear" => u32::from(random.one_in(90)),
            "start" => is_start.into(),
            "take" => random.one_in(5).into(),
            "put" => random.one_in(60).into(),
            "pin_data" => u32::from(random.bits() % 1000 < density),
            "pin_clock_in" => clock,
            "w_clear" => random.bits() % 2,
            other => panic!("write the stimulus of {other}"),
        };
        names.iter().map(|name| value(name)).collect()
    })
}

/// The encoder behind the pins of a kind that speaks with one, and the index of the input that its data pin is.
fn encoder(kind: &'static Kind, parameters: &[u32]) -> Option<(usize, BehindPins)> {
    let value = |name: &str| {
        let at = kind.parameters.iter().position(|parameter| parameter.name == name).expect("a parameter");
        parameters[at]
    };
    let of: Box<dyn Encoder> = match kind.name {
        "ssi" => {
            Box::new(SsiEncoder::new(value("bits"), value("half"), value("pause"), value("double") == 1))
        }
        "biss-c" => Box::new(BissEncoder::new(value("bits"), value("half"), value("timeout"))),
        _ => return None,
    };
    let (takes, _) = kind.ports();
    let pin = takes.iter().position(|(name, _)| name.starts_with("pin_")).expect("a pin") - 1;
    Some((pin, BehindPins::new(model::of(kind, parameters).expect("a model"), of, 3)))
}

/// Every kind with every variant of its parameters, then the parts that every board has.
fn parts() -> Vec<Part> {
    let mut parts = Vec::new();
    for kind in kind::KINDS {
        for (i, values) in variants(kind).into_iter().enumerate() {
            let (takes, drives) = kind.ports();
            let on_carrier = usize::from(kind.strobes.carrier);
            assert_eq!(values.len(), kind.parameters.len() + on_carrier);
            let names = kind.parameters.iter().map(|parameter| parameter.name).chain(["half"]);
            let parameters = names.zip(&values);
            parts.push(Part {
                name: format!("{}_{i}", kind.module),
                module: kind.module.to_owned(),
                parameters: parameters.map(|(name, &value)| (name.to_uppercase(), value)).collect(),
                takes,
                drives,
                model: model::of(kind, &values).expect("every kind has a model"),
                stimulus: stimulus(kind, &values, 1000 * parts.len() as u64 + 17),
            });
        }
    }
    let ports = |names: &[(&str, u32)]| names.iter().map(|&(name, width)| (name.to_owned(), width)).collect();
    let mut random = Random::new(5);
    let mut settings = [0, 5, 0];
    parts.push(Part {
        name: "tick".to_owned(),
        module: "takt_tick".to_owned(),
        parameters: Vec::new(),
        takes: ports(&[("rst", 1), ("run", 1), ("period", 32), ("lead", 32)]),
        drives: ports(&[("tick", 1), ("early", 1), ("left", 32)]),
        model: Box::new(Tick::default()),
        stimulus: Box::new(move |_| {
            if random.one_in(100) {
                settings = [u32::from(!random.one_in(3)), random.bits() % 30, random.bits() % 40];
                // A long period shows its beginning.
                if random.one_in(5) {
                    settings[1] = random.bits();
                }
            }
            settings.to_vec()
        }),
    });
    for (half, start) in [(8, 0), (9, 13), (300, 300)] {
        parts.push(Part {
            name: format!("carrier_{half}"),
            module: "takt_carrier".to_owned(),
            parameters: vec![("HALF".to_owned(), half), ("START".to_owned(), start)],
            takes: ports(&[("rst", 1)]),
            drives: ports(&[("place", 16), ("back", 1)]),
            model: Box::new(Carrier::new(half, start)),
            stimulus: Box::new(|_| Vec::new()),
        });
    }
    for divide in [4_u32, 7, 16, 300] {
        let mut random = Random::new(u64::from(divide));
        // The line carries bytes as another sender makes them, up to 1/40 too fast or too slow, and noise between them.
        let (mut line, mut next) = (Vec::new(), 0);
        parts.push(Part {
            name: format!("receive_{divide}"),
            module: "takt_uart_receive".to_owned(),
            parameters: vec![("DIVIDE".to_owned(), divide)],
            takes: ports(&[("rst", 1), ("pin_receive", 1)]),
            drives: ports(&[("valid", 1), ("data", 8), ("broken", 1)]),
            model: Box::new(UartReceive::new(divide)),
            stimulus: Box::new(move |_| {
                if next == line.len() {
                    (line, next) = (Vec::new(), 0);
                    let noise = random.one_in(6);
                    let byte = random.bits() % 256;
                    let frame = byte << 1 | if random.one_in(20) { 0 } else { 1 << 9 };
                    for cycle in 0..10 * divide {
                        let bit = frame >> (cycle / divide) & 1;
                        line.push(if noise && random.one_in(9) { bit ^ 1 } else { bit });
                    }
                    line.extend(vec![1; (random.bits() % (2 * divide)) as usize]);
                }
                next += 1;
                vec![line[next - 1]]
            }),
        });
        let mut random = Random::new(u64::from(divide) + 90);
        parts.push(Part {
            name: format!("send_{divide}"),
            module: "takt_uart_send".to_owned(),
            parameters: vec![("DIVIDE".to_owned(), divide)],
            takes: ports(&[("rst", 1), ("start", 1), ("data", 8)]),
            drives: ports(&[("ready", 1), ("pin_send", 1)]),
            model: Box::new(UartSend::new(divide)),
            stimulus: Box::new(move |_| vec![random.one_in(3).into(), random.bits() % 256]),
        });
    }
    parts
}

fn files() -> Vec<(&'static str, String)> {
    VERILOG.iter().map(|&(name, text)| (name, text.to_owned())).collect()
}

#[test]
fn every_peripheral_is_its_model() {
    let differences = compare("all", &files(), &mut parts(), CYCLES);
    let found: Vec<String> = differences.into_iter().flatten().collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Prints each tested part with its settings, for `cargo evidence mutants`.
#[test]
#[ignore = "a list for `cargo evidence mutants`"]
fn settings() {
    for part in parts() {
        let values: String = part.parameters.iter().map(|(name, value)| format!(" {name}={value}")).collect();
        println!("setting {} {}{values}", part.name, part.module);
    }
}

/// Tries the mutants that yosys has planted in netlists of peripherals for `cargo evidence mutants`. `TAKT_MUTANTS` names a folder with a
/// netlist for each setting, in which the plusarg `fault` chooses a mutant, and with a file of the mutants' numbers to be tried.
#[test]
#[ignore = "of netlists that `cargo evidence mutants` makes"]
fn mutants() {
    let folder = PathBuf::from(std::env::var_os("TAKT_MUTANTS").expect("TAKT_MUTANTS names a folder"));
    let of = |name: &str, kind: &str| fs::read_to_string(folder.join(format!("{name}.{kind}")));
    let changed = || -> Vec<Part> {
        let planted = parts().into_iter().filter(|part| of(&part.name, "txt").is_ok());
        planted.map(|part| Part { module: part.name.clone(), parameters: Vec::new(), ..part }).collect()
    };
    let names: Vec<String> = changed().into_iter().map(|part| part.name).collect();
    let netlists: Vec<(String, String)> = names
        .iter()
        .map(|name| (format!("{name}.v"), of(name, "v").expect("there is its netlist")))
        .collect();
    let files: Vec<(&str, String)> =
        netlists.iter().map(|(name, text)| (name.as_str(), text.clone())).collect();
    let program = build("mutants", &files, &changed());
    let met = |number: u32| run(&program, &[format!("+fault={number}")], &mut changed(), CYCLES);
    assert!(met(0).iter().all(Option::is_none), "without a mutant: {:?}", met(0));
    for (i, name) in names.iter().enumerate() {
        for number in of(name, "txt").expect("a list").lines().map(|line| line.parse().expect("a number")) {
            match &met(number)[i] {
                Some(_) => println!("mutant {name} {number} found peripherals"),
                None => println!("mutant {name} {number} survived"),
            }
        }
    }
    // These netlists' simulation will not be needed again.
    let _ = fs::remove_file(program);
}

/// Faults: file, text that occurs there once, and its replacement. The faults of a round are planted together, because every module is
/// compared by itself.
const FAULTS: &[&[(&str, &str, &str)]] = &[
    &[
        ("takt_quadrature.v", "at_index <= count", "at_index <= count + 32'd1"),
        ("takt_step.v", "if (step & ~was)", "if (step)"),
        ("takt_pwm.v", "on[16:1] + {15'd0, on[0]}", "on[16:1]"),
        ("takt_sigma_delta.v", "|wanted[32:16] ? 17'd65536", "|wanted[32:16] ? 17'd65535"),
        ("takt_digital_in.v", "pin_in ^ (INVERT != 0)", "pin_in"),
        ("takt_digital_out.v", "pin_out <= SAFE != 0;", "pin_out <= 1'b0;"),
        ("takt_spi.v", "~active & half != END - 7'd1", "~active"),
        ("takt_ssi.v", "number == BETWEEN;", "number == END;"),
        ("takt_biss_c.v", "s1 ^ is_crc;", "s1;"),
        ("takt_sinc3.v", "first | bits == LAST;", "bits == LAST;"),
        ("takt_hall.v", "since > last ? since : last", "last"),
        ("takt_tick.v", "lead < period", "lead <= period"),
        ("takt_carrier.v", "START - HALF : START", "START - HALF : START + 1"),
        ("takt_pwm_phase.v", "on[16:1] + {15'd0, on[0]}", "on[16:1]"),
        ("takt_trip.v", "asks | held;", "held;"),
        ("takt_uart_receive.v", "bits == 4'd10 & s1 ? 4'd0 : ", ""),
        ("takt_uart_send.v", "bits  <= 4'd10;", "bits  <= 4'd9;"),
    ],
    &[
        ("takt_quadrature.v", "one | both ? 31'd1", "one ? 31'd1"),
        ("takt_step.v", "direction ? count", "pin_direction ? count"),
        ("takt_pwm.v", "pulse & since_rise == LATE", "pulse"),
        ("takt_sigma_delta.v", "{1'b0, sum} + value", "{1'b0, sum} + (value | 17'd1)"),
        ("takt_digital_in.v", "level & ~was", "level ^ was"),
        ("takt_digital_out.v", "|w_level", "w_level[0]"),
        ("takt_spi.v", "if (start & busy) lost", "if (start & ~busy) lost"),
        ("takt_ssi.v", "GRAY != 0 & above", "GRAY != 0 & word[0]"),
        ("takt_biss_c.v", "answers ? FIRST - 17'd1 :", "answers ? FIRST :"),
        ("takt_sinc3.v", "quick >= BOUND | quick <= -BOUND", "quick >= BOUND"),
        ("takt_hall.v", "now == 3'd5 ? 3'd0 : now + 3'd1", "now + 3'd1"),
        ("takt_tick.v", "count == ahead + ONE", "count == ahead"),
        ("takt_carrier.v", "if (place == TOP) back", "if (place == TOP - 16'd1) back"),
        ("takt_pwm_phase.v", "(~first & was)", "(1'b0 & was)"),
        ("takt_trip.v", "if (asks) held", "if (asks & take) held"),
        ("takt_uart_receive.v", "DIVIDE / 2 - 1", "DIVIDE / 2 - 2"),
        ("takt_uart_send.v", "{1'b1, shift[9:1]}", "{1'b0, shift[9:1]}"),
    ],
    &[("takt_filter.v", "rst | s1 == level", "rst"), ("takt_pwm3.v", "enable & ~trip", "enable")],
    &[
        (
            "takt_quadrature.v",
            "{count, at_index, indices, errors, since} <= {START",
            "{count, at_index, indices, errors, since} <= {32'd0",
        ),
        ("takt_pwm.v", "wanted[33] ? 17'd0 :", ""),
        ("takt_pwm_phase.v", "is_all ? MOST : ", ""),
        ("takt_trip.v", "clear | (put & |w_clear)", "clear | put"),
        ("takt_pwm3.v", "if (put) stopped <= |w_stop", "stopped <= |w_stop"),
        // A bit of more than 256 cycles.
        ("takt_uart_receive.v", "left <= LAST;", "left <= {8'd0, LAST[7:0]};"),
        ("takt_uart_send.v", "left  <= LAST;", "left  <= {8'd0, LAST[7:0]};"),
        ("takt_spi.v", "(bits & mask) | sign", "bits & mask"),
        ("takt_ssi.v", "bad       <= ~s1;", "bad       <= 1'b0;"),
        ("takt_biss_c.v", "{31'd0, ~word[1]}", "{31'd0, word[1]}"),
        ("takt_sinc3.v", "anew[2] ? 3'b001 : ", ""),
        ("takt_hall.v", "(none & ~fault)", "none"),
    ],
];

#[test]
fn every_kind_has_planted_faults() {
    for kind in kind::KINDS {
        let file = format!("{}.v", kind.module);
        assert!(
            FAULTS.iter().any(|faults| faults.iter().any(|(name, ..)| *name == file)),
            "no fault is planted in {file}: add one to FAULTS in rtl/board/tests/peripherals.rs, (\"{file}\", what to replace, by what)"
        );
    }
}

#[test]
fn planted_faults_are_found() {
    for (round, faults) in FAULTS.iter().enumerate() {
        let mut files = files();
        for (name, what, by) in *faults {
            let (_, text) = files.iter_mut().find(|(file, _)| file == name).expect("there is the file");
            assert_eq!(text.matches(what).count(), 1, "{name}: {what}");
            *text = text.replace(what, by);
        }
        let mut parts = parts();
        let differences = compare(&format!("faults{round}"), &files, &mut parts, CYCLES / 3);
        for (name, what, _) in *faults {
            let module = name.trim_end_matches(".v");
            // Faults in an inner module show in the modules around it.
            let is_hit = |part: &Part| match module {
                "takt_filter" => true,
                "takt_pwm_phase" => part.module == "takt_pwm3",
                _ => part.module == module,
            };
            let hit = parts.iter().zip(&differences).any(|(part, found)| is_hit(part) && found.is_some());
            assert!(hit, "{name}: the fault in `{what}` was not found");
        }
    }
}

/// The models keep the numbers that contracts promise, and the circuits are equal to the models.
#[test]
fn contracts_hold() {
    let (pwm, spi) = (Kind::from_name("pwm").expect("a kind"), Kind::from_name("spi").expect("a kind"));
    for (half, dead) in [(50, 0), (50, 4)] {
        for duty in [-60_i32, -50, -49, -1, 0, 1, 30, 49, 50, 60] {
            let mut model = model::of(pwm, &[half, dead, 1]).expect("a model");
            let (mut high, mut low) = (0, 0);
            for cycle in 0..400 {
                if cycle >= 300 {
                    let pins = model.outputs();
                    assert!(pins[0] & pins[1] == 0, "both pins");
                    (high, low) = (high + pins[0], low + pins[1]);
                }
                model.clock(&[0, 1, (cycle == 0).into(), duty as u32]);
            }
            let on = (duty.clamp(-50, 50) + 50) as u32;
            let less = |on: u32| if on == 100 { 100 } else { on.saturating_sub(dead) };
            assert_eq!((high, low), (less(on), less(100 - on)), "duty {duty}, dead {dead}");
        }
    }
    // A frame of SPI as a converter sees it, in all four modes.
    for (polarity, phase) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let mut model = model::of(spi, &[4, 12, polarity, phase, 0, 0xa53]).expect("a model");
        let seen = Rc::new(RefCell::new(Vec::new()));
        let (mut answer, mut was, mut selected) = (0x5c6_u32, polarity, 0);
        for cycle in 0..200 {
            let pins = model.outputs();
            let (clock, select, out) = (pins[0], pins[1], pins[2]);
            selected += u32::from(select == 0);
            if select == 0 && clock != was {
                let first = (clock != polarity) == (phase == 0);
                if first {
                    seen.borrow_mut().push(out);
                } else if phase == 0 || seen.borrow().len() < 12 {
                    answer <<= u32::from(!seen.borrow().is_empty());
                }
            }
            was = clock;
            model.clock(&[0, (cycle == 3).into(), 1, 0, answer >> 11 & 1, 0]);
        }
        let sent = seen.borrow().iter().fold(0, |sent, bit| sent << 1 | bit);
        assert_eq!((seen.borrow().len(), sent, selected), (12, 0xa53, 4 * 25), "mode {polarity}{phase}");
        assert_eq!(model.outputs()[3..5], [0x5c6, 1], "mode {polarity}{phase}");
    }
}
