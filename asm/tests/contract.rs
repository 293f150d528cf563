// SPDX-License-Identifier: MIT OR Apache-2.0
//! `.contract on` fuses products into sums, and changes nothing but the rounding.

use crate::common::{bad, bundles};
use crate::random_source::Random;
use crate::rows;
use std::collections::HashMap;
use std::fmt::Write as _;
use takt_asm::{AssembledProgram, Contract, MemoryLoader, Options, Schedule, Search, listing};
use takt_emu::{Emulator, Event};
use takt_isa::{F1, F3, Function, Machine};

fn assembled(
    text: &str,
    machine: &'static Machine,
    schedule: Schedule,
    contract: Contract,
) -> AssembledProgram {
    let options = Options { machine, schedule, contract, effort: 1, ..Options::default() };
    let assembled = takt_asm::assemble("test.s", &MemoryLoader::of("test.s", text), &options);
    assembled.unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)))
}

/// Assembles a text for a machine with one slot that fuses.
fn on_one(text: &str) -> AssembledProgram {
    assembled(text, rows::named("fused"), Schedule::AsWritten, Contract::AsWritten)
}

/// A machine with two slots that fuse, of four.
fn two() -> &'static Machine {
    rows::named("fused_twice")
}

const HEAD: &str = ".input a, b, c, d\n.output F, G\n.reg t u v\n.state s\n.preset s = 1.0\n";

/// Asserts that contraction turns a period into the program that one would write by hand.
#[track_caller]
fn becomes(period: &str, by_hand: &str) {
    let whole = |contract: &str, body: &str| format!("{HEAD}{contract}\n.period\np:\n{body}\n wait p\n");
    let (fused, hand) = (on_one(&whole(".contract on", period)), on_one(&whole("", by_hand)));
    assert_eq!(bundles(&fused), bundles(&hand), "{period}");
    // Contraction adds no warning of the names that it removes.
    let plain = on_one(&whole("", period)).warnings.render(false);
    assert_eq!(fused.warnings.render(false), plain, "{period}");
    let lines = |text: &str| text.lines().filter(|line| !line.trim_end().ends_with(':')).count();
    assert_eq!(fused.contractions.len(), lines(period) - lines(by_hand), "{period}");
}

#[track_caller]
fn stays(period: &str) {
    becomes(period, period);
}

#[test]
fn sums_and_differences() {
    becomes(" fmul t, a, b\n fadd F, t, c", " fma F, a, b, c");
    becomes(" fmul t, a, b\n fadd F, c, t", " fma F, a, b, c");
    becomes(" fmul t, a, b\n fsub F, t, c", " fms F, a, b, c");
    becomes(" fmul t, a, b\n fsub F, c, t", " fnma F, a, b, c");
    becomes(" fmul t, a, a\n fadd s, s, t\n mov F, s", " fma s, a, a, s\n mov F, s");
}

/// An equation's products, and a fused operation that an equation asks for, with or without contraction.
#[test]
fn equations() {
    let period = |contract: &str, body: &str| {
        let assembled = on_one(&format!("{HEAD}.contract {contract}\n.period\np:\n{body}\n wait p\n"));
        bundles(&assembled)[0].clone()
    };
    assert_eq!(period("on", " F = a*b + c"), "fma F, a, b, c");
    assert_eq!(period("on", " F = c - a*b"), "fnma F, a, b, c");
    for contract in ["on", "off"] {
        assert_eq!(period(contract, " F = fms(a, b, c)"), "fms F, a, b, c");
        assert_eq!(period(contract, " fnms F, a, b, c"), "fnms F, a, b, c");
    }
    assert!(period("off", " F = a*b + c").starts_with("fmul"));
}

/// Reused names: several values of one name, a factor that has the product's own name, operations between.
#[test]
fn does_not_fuse_products_used_twice() {
    becomes(
        " fmul t, a, b\n fadd u, t, c\n fmul t, c, d\n fadd F, u, t\n fmul t, t, t\n mov G, t",
        " fma u, a, b, c\n fmul t, c, d\n fadd F, u, t\n fmul t, t, t\n mov G, t",
    );
    becomes(" mov t, a\n fmul t, t, b\n fadd F, t, c", " mov t, a\n fma F, t, b, c");
    becomes(" mov t, a\n fmul t, t, b\n fadd t, t, c\n mov F, t", " mov t, a\n fma t, t, b, c\n mov F, t");
}

/// A chain longer than everything else, so that other operations have slack.
const LONG: &str = "\n fsqrt v, d\n fsqrt G, v";

#[track_caller]
fn becomes_beside(period: &str, by_hand: &str) {
    becomes(&format!("{period}{LONG}"), &format!("{by_hand}{LONG}"));
}

/// A sum whose other operand comes late would end later if it were fused: it is fused where the run takes no longer for it.
#[test]
fn does_not_fuse_sums_that_wait_for_another_operand() {
    stays(" fsqrt u, c\n fmul t, a, b\n fadd F, t, u");
    becomes_beside(" fsqrt u, c\n fmul t, a, b\n fadd F, t, u", " fsqrt u, c\n fma F, a, b, u");
    // The sum waits for the product, too: it is fused.
    becomes(" fadd u, c, d\n fmul t, a, b\n fadd F, t, u", " fadd u, c, d\n fma F, a, b, u");
}

/// In a sum of two products, the product whose factors come later is fused, or else the second.
#[test]
fn two_products_in_one_sum() {
    stays(" fmul t, a, b\n fmul u, c, d\n fadd F, t, u");
    becomes_beside(" fmul t, a, b\n fmul u, c, d\n fadd F, t, u", " fmul t, a, b\n fma F, c, d, t");
    becomes(
        " fsqrt t, a\n fmul t, t, b\n fmul u, c, d\n fsub F, t, u",
        " fsqrt t, a\n fmul u, c, d\n fms F, t, b, u",
    );
}

#[test]
fn keeps_products_with_other_uses() {
    // Two sums, one sum twice, another operation, an output, a state.
    stays(" fmul t, a, b\n fadd F, t, c\n fadd G, t, d");
    stays(" fmul t, a, b\n fadd F, t, t");
    stays(" fmul t, a, b\n fadd F, t, c\n mov G, t");
    stays(" fmul F, a, b\n fadd G, F, c");
    stays(" fmul s, a, b\n fadd G, s, c");
    // Read in another run, before it is written there.
    stays(" fadd G, t, d\n bz a, q\n fmul t, a, b\n fadd F, t, c\nq:");
    stays(" fmul t, a, b\n bz a, q\n fadd F, t, c\nq:");
    // A factor that has another value by then, in an earlier bundle or in the product's own.
    stays(" mov u, a\n fmul t, u, b\n mov u, c\n fadd F, t, u\n mov G, u");
    stays(" mov u, a\n fmul t, u, b || mov u, c\n fadd F, t, u\n mov G, u");
    // The bundle that the fused operation would stand in has its slot taken.
    stays(" fmul t, a, b\n fadd F, t, c || fmul G, c, d");
    // A sum whose place that slot does not write.
    stays(" fmul t, a, b\n fadd @a7, t, c\n mov F, @a7");
}

/// Contraction needs `.contract on` at the product and at the sum, or the caller's request.
#[test]
fn fuses_where_contract_is_on() {
    let text = |before: &str, between: &str| {
        format!("{HEAD}.period\np:\n{before} fmul t, a, b\n{between} fadd F, t, c\n wait p\n")
    };
    let count = |text: &str, machine, contract| {
        let assembled = assembled(text, machine, Schedule::AsWritten, contract);
        let words = assembled.program.addresses().flat_map(|at| assembled.program.bundle(at));
        let operations = words.flat_map(|bundle| bundle.expect("it is legal"));
        let fused = operations.filter(|one| one.op.row().function == Function::Fused).count();
        assert_eq!(fused, assembled.contractions.len());
        fused
    };
    for (before, between, expected) in [
        ("", "", [0, 1, 0]),
        (".contract on\n", "", [1, 1, 0]),
        (".contract on\n", ".contract off\n", [0, 1, 0]),
        ("", ".contract on\n", [0, 1, 0]),
        (".contract off\n", "", [0, 1, 0]),
    ] {
        let text = text(before, between);
        let wishes = [Contract::AsWritten, Contract::All, Contract::None];
        assert_eq!(wishes.map(|wish| count(&text, two(), wish)), expected, "{text}");
        // A machine without the operation.
        assert_eq!([&F1, &F3].map(|machine| count(&text, machine, Contract::All)), [0, 0]);
    }
}

/// Programs whose bundles must keep their places, or that hold unknown words, are left alone.
#[test]
fn keeps_bundles_with_branches_intact() {
    for last in [" wait 0\n", " .raw mul 0x020000000000\n wait p\n"] {
        let text = format!("{HEAD}.contract on\n.period\np: fmul t, a, b\n fadd F, t, c\n{last}");
        assert_eq!(on_one(&text).contractions, [], "{text}");
    }
}

#[test]
fn reports_fused_products() {
    let text = format!(
        "{HEAD}.contract on\n.period\np: fmul t, a, b\n fadd F, t, c\n fmul u, a, a\n fsub G, u, d\n wait p\n"
    );
    let one = on_one(&text);
    let warnings = one.warnings.render(false);
    assert!(!warnings.contains("`t`") && !warnings.contains("`u`"), "{warnings}");
    let places = |at: Option<_>| at.map(|at| one.program.place_text(at)).unwrap_or_default();
    let said: Vec<_> =
        one.contractions.iter().map(|one| (one.mnemonic, places(one.product), places(one.sum))).collect();
    let expected = [("fma", "test.s:8", "test.s:9"), ("fms", "test.s:10", "test.s:11")];
    assert_eq!(said, expected.map(|(name, product, sum)| (name, product.to_owned(), sum.to_owned())));
    let listing = listing::listing(&one);
    assert!(listing.contains("\n; 2 products fused into sums\n"), "{listing}");
    assert!(listing.contains("test.s:9+       fma F, a, b, c"), "{listing}");

    let wrong = bad(&format!("{HEAD}.contract yes\n.period\np: wait p\n"), two()).render(false);
    assert!(wrong.contains("`.contract` is `on` or `off`, not `yes`"), "{wrong}");
}

/// A library file with `.contract off` keeps its operations, and with them its error bounds, wherever its macros are used.
#[test]
fn the_library_speaks_for_itself() {
    let body = ".macro muladd d, a, b, c\n.reg t\n fmul t, a, b\n fadd d, t, c\n.endm\n";
    let text = format!(
        "{HEAD}.contract on\n.include <f.s>\n.period\np: muladd F, a, b, c\n fmul t, a, b\n fadd G, t, d\n wait p\n"
    );
    for (head, fused) in [("", 2), (".contract off\n", 1)] {
        let file = format!("{head}{body}");
        for contract in [Contract::AsWritten, Contract::All] {
            let options = Options { machine: two(), contract, ..Options::default() };
            let loader =
                Search::new(MemoryLoader::of("test.s", text.as_str())).library(&[("f.s", file.as_str())]);
            let assembled = takt_asm::assemble("test.s", &loader, &options);
            let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
            assert_eq!(bundles(&assembled)[3 - fused], "fma G, a, b, d");
            assert_eq!(assembled.contractions.len(), fused);
        }
    }
}

/// A period of sums and products of few names, in runs that branches part, in which products are sometimes used elsewhere.
fn source(seed: u64) -> String {
    let random = &mut Random::new(seed);
    let mut text = String::from(
        ".input x, y, n:int\n.output F, G, H\n.reg t u v w\n.state s0, s1\n.once\n mov s0, zero\n mov s1, zero\n mov t, zero\n mov u, zero\n \
         mov v, zero\n mov w, zero\n wait p\n.period\np:\n",
    );
    let names = ["t", "u", "v", "w"];
    for step in 0..4 + random.below(16) {
        let operand = |random: &mut Random| match random.below(8) {
            0 | 1 => random.pick(&["x", "y"]).to_owned(),
            2 => random.pick(&["s0", "s1", "1.0", "-2.0"]).to_owned(),
            _ => random.pick(&names).to_owned(),
        };
        let dest = match random.below(8) {
            0 => random.pick(&["s0", "s1"]),
            1 => random.pick(&["F", "G", "H"]),
            _ => random.pick(&names),
        };
        let (a, b, c) = (operand(random), operand(random), operand(random));
        let (mnemonic, sum) = (random.pick(&["fmul", "fadd", "fsub"]), random.pick(&["fadd", "fsub"]));
        let product = random.pick(&names);
        let _ = match random.below(8) {
            0..=2 => writeln!(text, " fmul {product}, {a}, {b}\n {sum} {dest}, {product}, {c}"),
            3 => writeln!(text, " fmul {product}, {a}, {b}\n {sum} {dest}, {c}, {product}"),
            4 => writeln!(text, " {mnemonic} {product}, {a}, {b} || mov {}, {c}", random.pick(&["s0", "s1"])),
            5 if random.below(3) == 0 => writeln!(text, " bz n, q{step}\n {sum} {dest}, {a}, {b}\nq{step}:"),
            _ => writeln!(text, " {mnemonic} {dest}, {a}, {b}"),
        };
    }
    // States stay small.
    text += " fsat s0, s0, 3.0\n fsat s1, s1, 3.0\n mov F, t\n mov G, v\n fadd H, u, w\n wait p\n";
    text
}

/// The writes to ports over some periods; and whether every sum and product was an integer that binary32 holds.
fn run(assembled: &AssembledProgram, seed: u64) -> (Vec<Vec<u32>>, bool) {
    let random = &mut Random::new(seed + 5);
    let program = &assembled.program;
    let mut emulator = Emulator::new(program).expect("it fits");
    emulator.set_cycle_limit(100_000);
    let mut seen = Vec::new();
    let mut exact = true;
    for _ in 0..6 {
        for port in &program.inputs {
            let value = random.below(5) as i32 - 2;
            let bits = if port.name == "n" { u32::from(value > 0) } else { (value as f32).to_bits() };
            emulator.set_input_bits(port.register, bits).expect("it is an input");
        }
        let mut sink = |event: &Event| {
            if let Event::Retire(retire) = event
                && matches!(retire.op.row().function, Function::Add | Function::Multiply | Function::Fused)
            {
                exact &= f32::from_bits(retire.value).abs() <= 16_777_216.0;
            }
        };
        emulator.observed(&mut sink).run_period(&[]).unwrap_or_else(|error| panic!("{error}"));
        let value = |name: &str| {
            let port = program.outputs.iter().find(|port| port.name == name).expect("it is declared");
            emulator.output_bits(port.register).unwrap_or_default()
        };
        seen.push(["F", "G", "H"].map(value).to_vec());
    }
    (seen, exact)
}

/// If nothing is rounded, contraction changes nothing; and whatever is rounded, the bits do not depend on the schedule.
#[test]
fn nothing_but_the_rounding_changes() {
    let (mut fused, mut compared) = (0, 0);
    for seed in 0..if cfg!(debug_assertions) { 400 } else { 4000 } {
        let text = source(seed);
        let (plain, exact) = run(&assembled(&text, two(), Schedule::None, Contract::None), seed);
        let contracted = [Schedule::None, Schedule::All].map(|schedule| {
            let assembled = assembled(&text, two(), schedule, Contract::All);
            fused += assembled.contractions.len();
            run(&assembled, seed).0
        });
        assert_eq!(contracted[0], contracted[1], "{text}");
        if exact {
            compared += 1;
            assert_eq!(contracted[0], plain, "{text}");
        }
    }
    assert!(fused > 400 && compared > 100, "{fused} fused, {compared} compared");
}

/// Inverse dynamics in binary64, operation by operation: the outputs, by name.
fn in_binary64(text: &str, inputs: &HashMap<String, f64>) -> HashMap<String, f64> {
    let mut values = inputs.clone();
    for line in text.lines().skip_while(|line| *line != "period:").skip(1) {
        let words: Vec<&str> = line.split([' ', ',']).filter(|word| !word.is_empty()).collect();
        let value = |index: usize| {
            let word: &str = words[index];
            // A constant is a binary32 on the machine.
            word.parse().map_or_else(|_| values[word], |number: f64| f64::from(number as f32))
        };
        let result = match words[0] {
            "fmul" => value(2) * value(3),
            "fadd" => value(2) + value(3),
            "fsub" => value(2) - value(3),
            "fsin" => value(2).sin(),
            "fcos" => value(2).cos(),
            "fneg" => -value(2),
            "mov" => value(2),
            "wait" => break,
            other => panic!("{other}"),
        };
        values.insert(words[1].to_owned(), result);
    }
    values
}

/// Fusing shortens the dynamics' longest chain, and their errors do not grow.
#[test]
fn dynamics() {
    let text = include_str!("kernels/rnea6.s");
    let with = |contract| {
        let options = Options { machine: two(), contract, effort: 0, ..Options::default() };
        takt_asm::assemble("rnea6.s", &MemoryLoader::of("rnea6.s", text), &options)
            .unwrap_or_else(|errors| panic!("{}", errors.render(false)))
    };
    let [plain, contracted] = [Contract::None, Contract::All].map(with);
    let chain =
        |assembled: &AssembledProgram| assembled.blocks.iter().map(|block| block.bound.critical_path).max();
    let operations =
        |assembled: &AssembledProgram| assembled.blocks.iter().map(|block| block.operations).sum::<u32>();
    assert_eq!((chain(&plain), operations(&plain)), (Some(296), 676));
    assert_eq!((chain(&contracted), operations(&contracted)), (Some(267), 510));
    assert_eq!(contracted.contractions.len(), 166);

    let random = &mut Random::new(0x3243_f6a8_885a_308d);
    let mut errors = [0.0_f64; 2];
    for _ in 0..200 {
        let mut inputs = HashMap::new();
        let mut bits = HashMap::new();
        for port in &plain.program.inputs {
            let value = (random.below(2001) as f32 - 1000.0) / 500.0;
            inputs.insert(port.name.clone(), f64::from(value));
            bits.insert(port.name.clone(), value.to_bits());
        }
        let exact = in_binary64(text, &inputs);
        for (assembled, worst) in [&plain, &contracted].into_iter().zip(&mut errors) {
            let mut emulator = Emulator::new(&assembled.program).expect("it fits");
            for port in &assembled.program.inputs {
                emulator.set_input_bits(port.register, bits[&port.name]).expect("it is an input");
            }
            emulator.run_period(&[]).unwrap_or_else(|error| panic!("{error}"));
            for port in &assembled.program.outputs {
                let found = f32::from_bits(emulator.output_bits(port.register).expect("it is written"));
                *worst = worst.max((f64::from(found) - exact[&port.name]).abs());
            }
        }
    }
    // Newton metres.
    assert!(errors[1] <= errors[0] && errors[0] < 5e-5, "{errors:?}");
}
