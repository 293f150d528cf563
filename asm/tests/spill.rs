// SPDX-License-Identifier: MIT OR Apache-2.0
//! Blocks of equations with more values at a time than a bank has registers.

use takt_asm::{AssembledProgram, Diagnostics, MemoryLoader, Options, assemble};
use takt_emu::{Emulator, Number};
use takt_isa::{F3, Function, MACHINES, Machine};

/// A chain of `values` values, all read again in reverse order: any order of the operations needs them all at once.
fn source(values: usize) -> String {
    let mut text = ".schedule on\n.input a, b\n.output y, z\n".to_owned();
    for i in 0..values {
        text += &format!(".reg v{i} s{i}\n");
    }
    text += ".once\n wait p\n.period\np:\n v0 = a*b\n";
    for i in 1..values {
        text += &format!(" v{i} = v{} + b\n", i - 1);
    }
    text += &format!(" s{} = v{}*a\n", values - 1, values - 1);
    for i in (0..values - 1).rev() {
        text += &format!(" s{i} = v{i} - s{}\n", i + 1);
    }
    text + " y = s0\n z = v1*s1\n wait p\n"
}

/// The outputs of [`source`], computed in binary32.
fn expected(values: usize, a: f32, b: f32) -> [u32; 2] {
    let mut v = vec![a * b];
    for i in 1..values {
        v.push(v[i - 1] + b);
    }
    let mut s = vec![v[values - 1] * a; values];
    for i in (0..values - 1).rev() {
        s[i] = v[i] - s[i + 1];
    }
    [s[0], v[1] * s[1]].map(f32::to_bits)
}

/// The registers that a machine has for sums.
fn registers(machine: &Machine) -> usize {
    let (slot, _) = machine.host(Function::Add).unwrap();
    usize::from(machine.slot(slot).bank.depth - machine.outputs_per_bank)
}

fn assembled(text: &str, machine: &'static Machine) -> Result<AssembledProgram, Diagnostics> {
    let options = Options { machine, effort: 1, ..Options::default() };
    assemble("spill.s", &MemoryLoader::of("spill.s", text), &options)
}

fn run(assembled: &AssembledProgram, a: f32, b: f32) -> ([u32; 2], u64) {
    let mut emulator = Emulator::new(&assembled.program).unwrap();
    emulator.set_input("a", Number::Float(a)).unwrap();
    emulator.set_input("b", Number::Float(b)).unwrap();
    emulator.run_period(&[]).unwrap();
    let cycles = emulator.run_period(&[]).unwrap().cycles;
    let bits = |name: &str| match emulator.output(name).unwrap() {
        Some(Number::Float(value)) => value.to_bits(),
        other => panic!("{other:?}"),
    };
    ([bits("y"), bits("z")], cycles)
}

#[test]
fn values_without_a_register_keep_every_bit() {
    for machine in MACHINES {
        let mut seen = 0;
        let registers = registers(machine);
        for values in [20, registers - 60, registers + 10, registers + 140] {
            let text = source(values);
            let assembled = match assembled(&text, machine) {
                Ok(assembled) => assembled,
                Err(errors) => panic!("{values} on {}: {}", machine.name, errors.render(false)),
            };
            for (a, b) in [(0.99, 0.31), (-0.97, 0.5), (1.01, -0.99)] {
                let (found, cycles) = run(&assembled, a, b);
                assert_eq!(found, expected(values, a, b), "{values} values on {}", machine.name);
                let block =
                    assembled.blocks.iter().find(|block| block.label.as_deref() == Some("p")).unwrap();
                assert_eq!(cycles, u64::from(block.cycles), "{values} values on {}", machine.name);
                assert!(block.bound.cycles() <= block.cycles);
            }
            let spilled: usize = assembled.spills.iter().map(|spills| spills.values.len()).sum();
            seen += spilled;
            assert!(values > registers || assembled.spills.is_empty(), "{:?}", assembled.spills);
            let mut words: Vec<u32> = assembled
                .spills
                .iter()
                .flat_map(|spills| spills.values.iter().map(|value| value.word))
                .collect();
            words.sort_unstable();
            words.dedup();
            assert_eq!(words.len(), spilled, "each in a word of its own");
        }
        assert!(seen > 100, "{seen} on {}", machine.name);
    }
}

/// Words that the program uses are left alone; if these words are unknown, no value is kept in memory.
#[test]
fn words_of_the_program_are_left_alone() {
    let declared = source(300).replace(".once\n", ".data\ntable: .float 1, 2, 3\n.once\n");
    let touched = declared.replace(" v0 = a*b\n", " st 5[zero], a\n v0 = a*b\n");
    let assembled = assembled(&touched, &F3).unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    let words: Vec<u32> = assembled.spills[0].values.iter().map(|value| value.word).collect();
    assert!(!words.is_empty() && words.iter().all(|word| *word >= 3 && *word != 5), "{words:?}");
    let anywhere = touched.replace("5[zero]", "5[n]").replace(".once\n", ".state n:int\n.once\n li n, 0\n");
    let errors = self::assembled(&anywhere, &F3).unwrap_err().render(false);
    assert!(
        errors.contains("are needed, and f3 has 224") && errors.contains("may touch any word"),
        "{errors}"
    );
}

/// A value that a hand-written operation writes stays in its register.
#[test]
fn named_registers_are_not_spilled() {
    let names: Vec<String> = (0..300).map(|i| format!("v{i}")).collect();
    let mut text = ".schedule on\n.input a, b\n.output y\n".to_owned();
    for names in names.chunks(20) {
        text += &format!(".reg {}\n", names.join(" "));
    }
    text += ".reg s\n.once\n wait p\n.period\np:\n fadd v0, a, b\n";
    for i in 1..300 {
        text += &format!(" fadd v{i}, v{}, b\n", i - 1);
    }
    text += " mov s, v299\n";
    for i in (0..299).rev() {
        text += &format!(" fsub s, s, v{i}\n");
    }
    text += " mov y, s\n wait p\n";
    let errors = assembled(&text, &F3).unwrap_err().render(false);
    assert!(errors.contains("registers in bank a are needed, and f3 has 224"), "{errors}");
    assert!(errors.contains("too few of those that find no register are computed by equations"), "{errors}");
}

#[test]
fn rejects_oversized_programs_with_figures() {
    let errors = assembled(&source(900), &F3).unwrap_err().render(false);
    assert!(errors.contains("and f3 has 1024"), "{errors}");
}

/// Values with few needed at a time in the source's order, and many in the order in which they are ready.
#[test]
fn an_order_near_to_the_source_may_be_enough() {
    let (mut text, mut names) = (".schedule on\n.output y\n.reg s0\n".to_owned(), String::new());
    for i in 0..20 {
        text += &format!(".input x{i}, y{i}\n");
    }
    // Products that wait for nothing, and a chain that reads them one after the other.
    for i in 0..400 {
        text += &format!(".reg p{i} s{}\n", i + 1);
        names += &format!(" p{i} = x{}*y{}\n s{} = s{i} - p{i}\n", i / 20, i % 20, i + 1);
    }
    text += &format!(".once\n wait p\n.period\np:\n s0 = x0\n{names} y = s400\n wait p\n");
    let assembled = assembled(&text, &F3).unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    assert!(assembled.spills.iter().all(|spills| spills.values.is_empty()), "{:?}", assembled.spills);
    let mut emulator = Emulator::new(&assembled.program).unwrap();
    for i in 0..20u8 {
        let value = f32::from(i) * 0.37 + 0.1;
        emulator.set_input(&format!("x{i}"), Number::Float(value)).unwrap();
        emulator.set_input(&format!("y{i}"), Number::Float(1.0 - value)).unwrap();
    }
    emulator.run_period(&[]).unwrap();
    let value = |i: usize| f32::from(i as u8) * 0.37 + 0.1;
    let expected = (0..400).fold(value(0), |s, i| s - value(i / 20) * (1.0 - value(i % 20)));
    assert_eq!(emulator.output("y").unwrap(), Some(Number::Float(expected)));
}

/// Sums of products of constants in registers, by hand-written operations.
fn products(constants: usize) -> String {
    let mut text = ".schedule on\n.input x\n.output y\n.reg s v\n.state g h\n.preset g = 1\n.preset h = 2\n.once\n wait p\n.period\np:\n mov s, x\n"
        .to_owned();
    let constant = |i: usize| 1.0 + i as f64 / 1024.0;
    for i in (0..constants).step_by(2) {
        let other = constant((i + 1).min(constants - 1));
        text += &format!(" fmul v, {}, {other}\n fadd s, s, v\n", constant(i));
    }
    text + " fadd g, g, h\n fadd h, h, g\n mov y, s\n wait p\n"
}

/// A short schedule that lacks registers gives way to longer schedules, in the end to the source's order: a program that
/// fits without the scheduler fits with it.
#[test]
fn scheduling_needs_no_more_registers() {
    for machine in MACHINES {
        let all: usize =
            machine.slots.iter().map(|slot| usize::from(slot.bank.depth - machine.outputs_per_bank)).sum();
        let (mut fitting, mut longer) = (0, 0);
        // Constants leave ever fewer registers: in the end no more than the source's own order needs.
        for constants in (all - 60..all - 12).step_by(8).chain(all - 12..=all) {
            let what = format!("{constants} constants on {}", machine.name);
            let text = products(constants);
            let Ok(written) = assembled(&text.replace(".schedule on", ""), machine) else { continue };
            let scheduled = assembled(&text, machine);
            let scheduled = scheduled.unwrap_or_else(|errors| panic!("{what}: {}", errors.render(false)));
            let ((y, cycles), (expected, most)) = (output(&scheduled), output(&written));
            assert_eq!(y, expected, "{what}");
            assert!(cycles <= most, "{what}: {cycles} cycles, {most} without the scheduler");
            let block = scheduled.blocks.iter().find(|block| block.label.as_deref() == Some("p")).unwrap();
            assert_eq!(cycles, u64::from(block.cycles), "{what}");
            assert!(block.bound.cycles() <= block.cycles, "{what}");
            assert!(scheduled.spills.iter().all(|of| of.values.is_empty()), "{what}");
            fitting += 1;
            longer += usize::from(!scheduled.spills.is_empty());
        }
        assert!(fitting > 6 && longer > 0, "{}: {fitting} fit, {longer} of them longer", machine.name);
    }
}

fn output(assembled: &AssembledProgram) -> (Option<Number>, u64) {
    let mut emulator = Emulator::new(&assembled.program).unwrap();
    emulator.set_input("x", Number::Float(0.7)).unwrap();
    emulator.run_period(&[]).unwrap();
    let cycles = emulator.run_period(&[]).unwrap().cycles;
    (emulator.output("y").unwrap(), cycles)
}

/// The message of a full bank names its contents, and points there.
#[test]
fn full_bank_error_names_its_contents() {
    let report = |text: &str, machine| assembled(text, machine).unwrap_err().render(false);
    insta::assert_snapshot!("constants", report(&products(500), &takt_isa::F1));
    // Room for all constants and names, and for one value where two are needed.
    insta::assert_snapshot!("few_left", report(&products(477), &takt_isa::F1));
    let values = source(300).replace(".once\n", ".state n:int\n.once\n li n, 0\n st 5[n], a\n");
    insta::assert_snapshot!("values", report(&values, &F3));
}
