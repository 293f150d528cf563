// SPDX-License-Identifier: MIT OR Apache-2.0
//! Flips of every flip-flop of the first core of a pair of t1, as it is after synthesis, and of a sample of its other bits: the second core
//! tells of every harmful one.
//! Flips in memories with error correction: none is harmful, or it is told.
#![allow(clippy::print_stdout)]

use crate::common::{assemble, folder};
use crate::ecc;
use crate::pair::{DELAY, pair};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use takt_asm::{MemoryLoader, Options, Search};
use takt_cosim::flips::{FlipModel, FlipRegister, Outcome, Stimulus};
use takt_isa::{Program, T1, Type};
use takt_programs::TRACKING_INPUTS;
use takt_rtl::Design;

/// Periods after a flip in which it may show.
const HORIZON: u32 = 3;
/// One flip in so many is of a memory's bit: most of these show late or never, and take as long as many others.
const MEMORY: u32 = 32;
/// One flip in so many of a flip-flop's is of the second core's or the comparison's, where none is harmful.
const OTHERS: u32 = 5;
/// Flip-flops from one flip to the next, so that few flips are of all structures; a prime.
const STRIDE: u64 = 7919;
/// Cycles from a difference at the first core's ports to `differs`, and more than to `upset`.
const TOLD: u32 = DELAY + 2;

/// A program whose bits are flipped.
struct Case {
    name: &'static str,
    program: Program,
    stimulus: Stimulus,
}

fn source(name: &str, files: &[(&str, &str)]) -> Program {
    let options = Options { machine: &T1, ..Options::default() };
    let loader = Search::new(MemoryLoader::new(files)).library(takt_programs::LIBRARY);
    let assembled = takt_asm::assemble(name, &loader, &options);
    assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

/// Values for an input that stay near those before them, as a controller's do.
fn walk(program: &Program, rows: usize, start: impl Fn(&str) -> (f64, f64)) -> Vec<Vec<u32>> {
    let mut random = Pcg64Mcg::seed_from_u64(57);
    let mut values: Vec<f64> = program.inputs.iter().map(|port| start(&port.name).0).collect();
    let mut row = || {
        let ports = program.inputs.iter().zip(&mut values);
        ports
            .map(|(port, value)| {
                *value += start(&port.name).1 * (f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5);
                if port.ty == Type::F { (*value as f32).to_bits() } else { *value as i32 as u32 }
            })
            .collect()
    };
    (0..rows).map(|_| row()).collect()
}

/// The programs: the hybrid robot's tracking, a servo axis, a lamp.
fn cases() -> Vec<Case> {
    let tracking = assemble(&T1, "hybrid/tracking.s");
    let mut lines = TRACKING_INPUTS.lines();
    let names: Vec<&str> = lines.next().expect("names").split(',').collect();
    let column = |name: &str| names.iter().position(|known| *known == name).expect("a column");
    let columns: Vec<usize> = tracking.inputs.iter().map(|port| column(&port.name)).collect();
    let value = |ty: Type, text: &str| match ty {
        Type::F => text.parse::<f32>().expect("a number").to_bits(),
        _ => text.parse::<f64>().expect("a number") as i32 as u32,
    };
    let rows = lines.take(60).map(|line| {
        let fields: Vec<&str> = line.split(',').collect();
        tracking.inputs.iter().zip(&columns).map(|(port, &at)| value(port.ty, fields[at])).collect()
    });
    let rows = rows.collect();
    let servo = source(
        "servo.s",
        &[
            ("servo.s", include_str!("../../../programs/servo/servo.s")),
            ("axis.s", include_str!("../../../programs/servo/axis.s")),
        ],
    );
    let servo_rows = walk(&servo, 60, |name| match name {
        "ia" | "ib" => (0.5, 0.4),
        "count" => (70_000.0, 300.0),
        "udc" => (48.0, 0.2),
        "enable" => (1.0, 0.0),
        "goal" => (0.7, 0.02),
        _ => (0.0, 0.0),
    });
    let blink = source("blink.s", &[("blink.s", include_str!("../../../programs/examples/blink.s"))]);
    let case = |name, program, period, rows| Case {
        name,
        program,
        stimulus: Stimulus { period, rows, horizon: HORIZON },
    };
    vec![
        case("tracking", tracking, 800, rows),
        case("servo", servo, 1000, servo_rows),
        case("blink", blink, 100, vec![Vec::new(); 400]),
    ]
}

fn build(design: &Design) -> FlipModel {
    FlipModel::build(design, &folder()).unwrap_or_else(|error| panic!("{error}"))
}

/// Core that a register belongs to, the first or the second; neither for what compares them.
fn core_of(register: &FlipRegister) -> Option<&str> {
    register.name.split('.').next().filter(|core| ["first", "second"].contains(core))
}

/// Structure that a register belongs to: the core or what compares, and of a core its part.
fn structure(register: &FlipRegister) -> String {
    let Some(core) = core_of(register) else { return "comparison".to_owned() };
    let rest = &register.name[core.len() + 1..];
    let part = match rest.split_once('.').map(|(part, _)| part) {
        _ if register.words > 0 => match rest {
            rest if rest.contains("program") => "memory_program",
            rest if rest.starts_with("memory.") => "memory_data",
            rest if rest.starts_with("outputs.") => "memory_outputs",
            rest if rest.starts_with("sequencer.") => "memory_stacks",
            rest if ["one_a.", "one_b.", "one_c."].iter().any(|own| rest.starts_with(own)) => {
                "memory_registers"
            }
            _ => "memory_tables",
        },
        None => "pipeline",
        Some("sequencer" | "issuing") => "sequencer",
        Some("one_program") => "fetch",
        Some("one_a" | "one_b" | "one_c") => "operands",
        Some("one_dest" | "one_results" | "one_recurrence_late" | "one_sine_late") => "scoreboard",
        Some("one_addmul" | "one_recurrence" | "one_sine" | "one_alu_late") => "units",
        Some("memory") => "data_port",
        Some("outputs" | "inputs") => "ports",
        Some(other) => panic!("`{other}` of the core belongs to no structure"),
    };
    format!("{core}.{part}")
}

/// A bit of a register, by the register's number.
type Bit = (usize, u32);

/// Flip-flops of the mapped netlist, each as the bits of the Verilog's registers that it is: one as a rule. `cargo evidence netlist --prove
/// --machine t1 --second-core` proves that they are, and that a flip of a flip-flop is a flip of these bits: the netlists are equal from any
/// state in which registers have the values of their flip-flops.
fn flip_flops(registers: &[FlipRegister]) -> Vec<Vec<Bit>> {
    let results: Value = serde_json::from_str(include_str!("../../formal/results.json")).expect("JSON");
    let design = format!("t1{}", pair(&T1, 0).safety.text());
    let known = &results["mapped"][&design]["flip_flops"];
    let numbers: BTreeMap<&str, usize> =
        registers.iter().enumerate().map(|(i, register)| (register.name.as_str(), i)).collect();
    // A wire that joins a register to others has names of its own.
    let bit = |names: &Value| -> Bit {
        let names = names.as_str().expect("names");
        let mut found = names.split(' ').filter_map(|text| {
            let (name, bit) = text.strip_suffix(']')?.rsplit_once('[')?;
            Some((*numbers.get(name)?, bit.parse().ok()?))
        });
        found.next().unwrap_or_else(|| panic!("`{names}` is no register: the proof is of another circuit"))
    };
    let list = |names: &Value| names.as_array().expect("a list").iter().map(bit).collect::<Vec<_>>();
    let none: BTreeSet<Bit> = list(&known["none"]).into_iter().collect();
    let several: Vec<Vec<Bit>> = known["one"].as_array().expect("a list").iter().map(list).collect();
    let further: BTreeSet<Bit> = several.iter().flat_map(|bits| &bits[1..]).copied().collect();
    let together: BTreeMap<Bit, &Vec<Bit>> = several.iter().map(|bits| (bits[0], bits)).collect();
    for bits in &several {
        let of = |&(register, _): &Bit| core_of(&registers[register]);
        assert!(bits.iter().all(|bit| of(bit) == of(&bits[0])), "a flip-flop is shared: {bits:?}");
    }
    let of_flip_flops = registers.iter().enumerate().filter(|(_, register)| register.words == 0);
    of_flip_flops
        .flat_map(|(i, register)| (0..register.count()).map(move |bit| (i, bit)))
        .filter(|bit| !none.contains(bit) && !further.contains(bit))
        .map(|bit| together.get(&bit).map_or_else(|| vec![bit], |bits| bits.to_vec()))
        .collect()
}

/// Counts by structure and outcome.
type Counts = BTreeMap<String, BTreeMap<&'static str, u64>>;

fn count(counts: &mut Counts, structure: String, at: u32, period: u32, outcome: Outcome) {
    let own = counts.entry(structure).or_default();
    let mut add = |name| *own.entry(name).or_default() += 1;
    add("flips");
    let Outcome { harmful, told, stops, is_over, is_corrected } = outcome;
    if told.is_some() {
        add("told");
    }
    if let Some(cycle) = told {
        add(match cycle - at {
            0..10 => "told_within_10",
            10..100 => "told_within_100",
            after if after < period => "told_within_a_period",
            _ => "told_later",
        });
    }
    if is_corrected {
        add("corrected");
    }
    match harmful {
        Some(wrong) => {
            add("harmful");
            let in_time = |by: Option<u32>| by.is_some_and(|cycle| cycle <= wrong + period);
            if in_time(told) {
                add("harmful_told");
            }
            if told.is_some_and(|cycle| cycle <= wrong + TOLD) {
                add("harmful_told_before_a_pin");
            }
            if in_time(stops) {
                add("harmful_stopped");
            }
        }
        None if told.is_some() || is_corrected => {}
        None if is_over => add("masked"),
        None => add("silent"),
    }
}

/// Flips `flips` bits of registers whose names begin with `only`: flip-flops by turns, each in a random cycle, and
/// random bits of memories; `first` is the number of the first flip. Returns the counts, and the harmful flips that were told late or not at all.
fn run(case: &Case, model: &FlipModel, (first, flips): (u64, u64), only: &str) -> (Counts, Vec<String>) {
    let (mut counts, mut late) = (Counts::default(), Vec::new());
    let mut simulation =
        model.start(&case.program, &case.stimulus).unwrap_or_else(|error| panic!("{}: {error}", case.name));
    let registers = &simulation.registers;
    let is_chosen = |register: usize| registers[register].name.starts_with(only);
    let (first_core, others): (Vec<_>, Vec<_>) = flip_flops(registers)
        .into_iter()
        .filter(|bits| is_chosen(bits[0].0))
        .partition(|bits| core_of(&registers[bits[0].0]) == Some("first"));
    // Small memories are met as often as large ones.
    let memories = registers.iter().enumerate().filter(|&(i, own)| own.words > 0 && is_chosen(i));
    let memories: Vec<Bit> = memories.map(|(i, own)| (i, own.count())).collect();
    let (first_bits, other_bits, memory_count) = (first_core.len(), others.len(), memories.len());
    println!("figures: circuit={first_bits}-and-{other_bits}-flip-flops,{memory_count}-memories");
    let mut random = Pcg64Mcg::seed_from_u64(first);
    let (begin, end) = simulation.cycles;
    for number in first..first + flips {
        let by_turns = |all: &[Vec<Bit>]| all[(number * STRIDE) as usize % all.len()].clone();
        let draw = random.next_u32();
        let bits = if draw % MEMORY == 0 || first_core.is_empty() {
            let (register, bits) = memories[random.next_u32() as usize % memories.len()];
            vec![(register, random.next_u32() % bits)]
        } else if (draw / MEMORY).is_multiple_of(OTHERS) {
            by_turns(&others)
        } else {
            by_turns(&first_core)
        };
        let cycle = begin + random.next_u32() % (end - begin);
        let outcome = simulation.flip(&bits, cycle).unwrap_or_else(|error| panic!("{error}"));
        let (register, bit) = bits[0];
        let of = structure(&simulation.registers[register]);
        assert!(!of.starts_with("second") || outcome.harmful.is_none(), "{of}: {outcome:?}");
        if outcome.harmful.is_some_and(|wrong| outcome.told.is_none_or(|told| told > wrong + TOLD)) {
            let name = &simulation.registers[register].name;
            late.push(format!("{}: bit {bit} of {name}, flipped in cycle {cycle}: {outcome:?}", case.name));
        }
        count(&mut counts, of, cycle, case.stimulus.period, outcome);
    }
    (counts, late)
}

fn sum(counts: &Counts, of: &str) -> u64 {
    counts.values().filter_map(|own| own.get(of)).sum()
}

/// Flips `TAKT_FLIPS` bits (by default 400) in each program, from number `TAKT_SEED` on.
#[test]
fn harmful_flips_are_told() {
    let number =
        |name: &str, usual| std::env::var(name).map_or(usual, |text| text.parse::<u64>().expect("a number"));
    let (first, flips) = (number("TAKT_SEED", 0), number("TAKT_FLIPS", 400));
    let model = build(&pair(&T1, 0));
    let mut harmful = 0;
    for case in cases() {
        let (counts, late) = run(&case, &model, (first, flips), "");
        let name = case.name;
        let totals = [
            ("flips", "flips"),
            ("harmful", "harmful"),
            ("told", "harmful_told"),
            ("stopped", "harmful_stopped"),
        ];
        let totals = totals.map(|(total, of)| format!("{name}.{total}={}", sum(&counts, of)));
        println!("figures: {}", totals.join(" "));
        for (structure, own) in &counts {
            let words = own.iter().map(|(name, count)| format!("{}.{structure}.{name}={count}", case.name));
            println!("figures: {}", words.collect::<Vec<_>>().join(" "));
        }
        assert!(late.is_empty(), "{}", late.join("\n"));
        harmful += sum(&counts, "harmful");
    }
    assert!(harmful > flips / 20, "{harmful} harmful flips");
}

/// A comparison that leaves out what the exchange reads misses flips in the memory of output ports.
#[test]
fn a_comparison_that_leaves_something_out_is_found() {
    let mut design = pair(&T1, 0);
    let file = design.files.iter_mut().find(|file| file.base() == format!("{}.v", design.top));
    let text = &mut file.expect("the pair").text;
    for (known, net) in [("known", "read_value"), ("later_known", "later_read_value")] {
        let term = format!("{{32{{{known}}}}} & {net}");
        assert_eq!(text.matches(&term).count(), 1, "{term}");
        *text = text.replace(&term, "32'd0");
    }
    let case = cases().into_iter().find(|case| case.name == "servo").expect("the servo");
    let (counts, late) = run(&case, &build(&design), (0, 2000), "first.outputs.g_bank");
    let (harmful, told) = (sum(&counts, "harmful"), sum(&counts, "harmful_told"));
    assert!(harmful > 20 && told < harmful / 2 && late.len() as u64 >= harmful - told, "{counts:#?}");
}

/// Structures whose words have codes.
const CODED: [&str; 3] = ["memory_program", "memory_data", "memory_registers"];

/// Flips of one or two bits of random words of the memories of a core with error correction.
fn run_coded(case: &Case, model: &FlipModel, first: u64, flips: u64, bits: usize) -> Counts {
    let mut counts = Counts::default();
    let mut simulation =
        model.start(&case.program, &case.stimulus).unwrap_or_else(|error| panic!("{}: {error}", case.name));
    let named =
        |own: &FlipRegister| structure(&FlipRegister { name: format!("first.{}", own.name), ..own.clone() });
    let coded = |own: &FlipRegister| own.words > 0 && CODED.iter().any(|name| named(own).ends_with(name));
    let all = simulation.registers.iter().enumerate().filter(|(_, own)| coded(own));
    let memories: Vec<(usize, FlipRegister)> = all.map(|(i, own)| (i, own.clone())).collect();
    assert_eq!(memories.len(), 1 + 1 + 3 * 2, "program, data, three copies of two banks");
    let mut random = Pcg64Mcg::seed_from_u64(first);
    let (begin, end) = simulation.cycles;
    for _ in 0..flips {
        let (register, own) = &memories[random.next_u32() as usize % memories.len()];
        let word = random.next_u32() % own.words;
        let one = random.next_u32() % own.bits;
        let other = (one + 1 + random.next_u32() % (own.bits - 1)) % own.bits;
        let flipped: Vec<Bit> =
            [one, other].iter().take(bits).map(|bit| (*register, word * own.bits + bit)).collect();
        let cycle = begin + random.next_u32() % (end - begin);
        let outcome = simulation.flip(&flipped, cycle).unwrap_or_else(|error| panic!("{error}"));
        let structure = named(own);
        let of = structure.trim_start_matches("first.");
        let in_time =
            outcome.harmful.is_none_or(|wrong| outcome.told.is_some_and(|told| told <= wrong + TOLD));
        let place = || {
            let bits = flipped.iter().map(|(_, bit)| bit).collect::<Vec<_>>();
            format!("{}: bits {bits:?} of {}, flipped in cycle {cycle}: {outcome:?}", case.name, own.name)
        };
        // Two wrong bits of a byte, or one and its parity, are seen by no parity.
        let byte = |bit: u32| if bit < 32 { bit / 8 } else { bit - 32 };
        let is_hidden = bits == 2 && of == "memory_registers" && byte(one) == byte(other);
        assert!(in_time || is_hidden, "{}", place());
        // A single wrong bit of program or data never stops the program.
        assert!(
            bits == 2 || of == "memory_registers" || outcome.harmful.or(outcome.told).is_none(),
            "{}",
            place()
        );
        count(&mut counts, of.to_owned(), cycle, case.stimulus.period, outcome);
    }
    counts
}

/// Flips `TAKT_FLIPS` words (by default 300) of memories with error correction in each program, from number `TAKT_SEED` on.
#[test]
fn wrong_words_are_corrected_or_told() {
    let number =
        |name: &str, usual| std::env::var(name).map_or(usual, |text| text.parse::<u64>().expect("a number"));
    let (first, flips) = (number("TAKT_SEED", 0), number("TAKT_FLIPS", 300));
    let model = build(&ecc::design(&T1, 0, None));
    let mut totals = [("flips", 0), ("corrected", 0), ("told", 0), ("harmful", 0)];
    for mut case in cases() {
        // The scrubber reads all memories in a wait of 2048 words, nine cycles each.
        if case.name == "blink" {
            case.stimulus.period = 20_000;
            case.stimulus.rows.truncate(4);
        }
        for (bits, name) in [(1, "one"), (2, "two")] {
            let counts = run_coded(&case, &model, first, flips, bits);
            totals.iter_mut().for_each(|(of, total)| *total += sum(&counts, of));
            for (structure, own) in &counts {
                let words =
                    own.iter().map(|(of, count)| format!("{}.{name}.{structure}.{of}={count}", case.name));
                println!("figures: {}", words.collect::<Vec<_>>().join(" "));
                if case.name == "blink" && bits == 1 {
                    // Input ports are detected, not repaired.
                    let (flips, corrected) = (own["flips"], own.get("corrected").copied().unwrap_or(0));
                    let all = structure == "memory_registers";
                    assert!(corrected == flips || all && corrected > flips / 3, "{structure}: {own:?}");
                }
            }
        }
    }
    let totals = totals.map(|(of, total)| format!("{of}={total}"));
    println!("figures: {}", totals.join(" "));
}
