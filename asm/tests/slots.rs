// SPDX-License-Identifier: MIT OR Apache-2.0
//! Slots that share functions, as a program's author sees them: the slot of each operation, the slots that the source names, and
//! the messages if slots do not suffice.

use crate::common::{assemble, bad, bundles};
use crate::rows;
use std::path::Path;
use takt_asm::diag::Message;
use takt_asm::schedule::Resources;
use takt_asm::{AssembledProgram, FileLoader, MemoryLoader, Options, disasm, listing};
use takt_emu::Emulator;
use takt_isa::{F1, F3, Machine, Program, SlotIndex};

/// Assembles a text without mistakes for a row.
#[track_caller]
fn good(text: &str, row: &str) -> AssembledProgram {
    assemble(text, rows::named(row)).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

/// The only error of a text.
#[track_caller]
fn mistake(text: &str, row: &str) -> Message {
    let messages = bad(text, rows::named(row)).messages();
    assert_eq!(messages.len(), 1, "{messages:#?}");
    messages.into_iter().next().expect("there is one")
}

/// The bank in which a name's register lies.
fn bank(assembled: &AssembledProgram, name: &str) -> char {
    let program = &assembled.program;
    let mut ports = program.registers.iter().chain(&program.outputs);
    let port = ports.find(|port| port.name == name).expect("it has a register");
    program.machine.register_name(port.register).and_then(|name| name.chars().next()).expect("it has a name")
}

const HEAD: &str = ".input x, y\n.output o, p, q\n.reg a b c t\n.period\n";
const TAIL: &str = "\n fadd o, a, b\n fadd p, c, t\n mov q, x\n wait @start\n";

/// A period of these bundles, which reads every register.
fn period(lines: &str) -> String {
    format!("{HEAD}start: {lines}{}", TAIL.replace('@', ""))
}

#[test]
fn a_bundle_uses_every_slot_that_can_take_an_operation() {
    let lines = "fadd a, x, y || fsub b, x, y || fmul c, x, y\n fmov: fabs t, x";
    let text = period(&lines.replace("fmov: ", ""));
    let assembled = good(&text, "second_adder");
    assert_eq!(bundles(&assembled)[0], "fmul c, x, y || fadd a, x, y || fsub b, x, y");
    assert_eq!((bank(&assembled, "a"), bank(&assembled, "b")), ('a', 'x'));
    // The first operation gives way where the second has no other slot.
    let assembled =
        good(&period("fadd a, x, y || itof b, x:int || fmul c, x, y\n fabs t, x"), "second_adder");
    assert_eq!(bundles(&assembled)[0], "fmul c, x, y || itof b, x || fadd a, x, y");
}

#[test]
fn a_register_keeps_its_bank_whichever_bundle_decides() {
    // `b` shares a bundle with an operation that only `aux` executes, so it is in the bank of `add`, and `a` is not.
    let lines = "fadd a, x, y || fadd b, y, x\n fmul c, x, y\n fadd b, b, b || fabs t, x\n fadd a, a, b";
    let assembled = good(&period(lines), "second_adder");
    assert_eq!((bank(&assembled, "a"), bank(&assembled, "b")), ('x', 'a'));
    assert!(assembled.adjustments.is_empty(), "{:?}", assembled.adjustments);
    // No choice suits both bundles: a value is copied.
    let lines = "fadd a, x, y || fadd b, y, x\n fadd c, x, x || fabs t, x\n fadd b, b, b || fabs t, t\n fadd a, a, b || fabs t, t";
    let assembled = good(&period(lines), "second_adder");
    let program = &assembled.program;
    assert_eq!(
        outputs(program, &[1.5, 2.25]),
        outputs(&good(&serial(&period(lines)), "second_adder").program, &[1.5, 2.25])
    );
}

/// The operations of bundles one after another. (In these bundles, no operation reads the result of another.)
fn serial(text: &str) -> String {
    text.replace(" || ", "\n ")
}

/// The outputs of a program in its second period.
fn outputs(program: &Program, inputs: &[f32]) -> Vec<u32> {
    let mut emulator = Emulator::new(program).expect("it fits");
    for (port, value) in program.inputs.iter().zip(inputs) {
        emulator.set_input_bits(port.register, value.to_bits()).expect("it is an input");
    }
    for _ in 0..2 {
        emulator.run_period(&[]).expect("it waits");
    }
    program.outputs.iter().filter_map(|port| emulator.register(port.register)).collect()
}

#[test]
fn the_source_names_a_slot() {
    for schedule in ["", ".schedule on\n"] {
        let lines = "fadd.aux a, x, y\n fadd.add b, x, y\n fmul c, x, y\n fabs t, x";
        let assembled = good(&format!("{schedule}{}", period(lines)), "second_adder");
        assert_eq!((bank(&assembled, "a"), bank(&assembled, "b")), ('x', 'a'));
    }
    let assembled =
        good(&period("fadd.aux a, x, y || fadd b, x, y || fmul c, x, y\n fabs t, x"), "second_adder");
    assert_eq!(bank(&assembled, "b"), 'a');
    // A register's place names a slot, too.
    for (place, bank_of_b) in [("x3", 'a'), ("a3", 'x')] {
        let text = period("fadd a, x, y || fadd b, x, y || fmul c, x, y\n fabs t, x");
        let text = text.replace(".reg a b c t", &format!(".reg a @ {place}\n.reg b c t"));
        assert_eq!(bank(&good(&text, "second_adder"), "b"), bank_of_b);
    }
}

#[test]
fn reports_slots_that_an_operation_cannot_have() {
    let error =
        mistake(&period("fadd.mul a, x, y\n fadd b, x, y\n fmul c, x, y\n fabs t, x"), "second_adder");
    assert_eq!((error.code, &*error.message), ("no-unit", "slot `mul` has no unit for `fadd`"));
    assert_eq!(error.notes, ["second_adder: slots `add` and `aux`"]);
    let error = mistake(&period("fadd.ad a, x, y\n fadd b, x, y\n fmul c, x, y\n fabs t, x"), "second_adder");
    assert_eq!(&*error.message, "second_adder has no slot `ad`");

    let three = period("fadd a, x, y || fsub b, x, y || fabs t, x\n fmul c, x, y");
    let error = mistake(&three, "second_adder");
    assert_eq!(
        (error.code, &*error.message),
        ("slot-conflict", "3 operations of the bundle need slots `add` and `aux`")
    );
    let labels: Vec<&str> = error.places.iter().map(|place| &*place.message).collect();
    assert_eq!(labels, ["`fabs` needs one of them", "so does `fadd`", "so does `fsub`"]);

    // Two registers have places in one bank; the multiplication does not compete for their slot.
    let text = period("fmul c, x, y || fadd a, x, y || fadd b, x, y\n fabs t, x");
    let error = mistake(&text.replace(".reg a b c t", ".reg a @ a1\n.reg b @ a2\n.reg c t"), "second_adder");
    assert_eq!(&*error.message, "two operations of the bundle need slot `add`");
    assert_eq!(error.notes, ["slot `add` writes the bank of `a1`", "slot `add` writes the bank of `a2`"]);
}

#[test]
fn has_queries_a_slot() {
    let asked = |machine: &'static Machine, name: &str| {
        let text = format!(".const K = {name}\n.output o\n.period\nstart: fadd o, zero, K\n wait start\n");
        let assembled = assemble(&text, machine).unwrap_or_else(|report| panic!("{}", report.render(false)));
        format!("{:?}", assembled.constants[0].1)
    };
    let row = rows::named("second_adder");
    for (name, has) in [
        ("has.fadd", "Int(1)"),
        ("has.fadd.aux", "Int(1)"),
        ("has.fadd.add", "Int(1)"),
        ("has.fadd.mul", "Int(0)"),
        ("has.nop.mul", "Int(1)"),
    ] {
        assert_eq!(asked(row, name), has, "{name}");
    }
    assert_eq!(
        (asked(&F3, "has.fadd.aux"), asked(&F1, "has.fadd.aux")),
        ("Int(0)".to_owned(), "Int(0)".to_owned())
    );
}

#[test]
fn the_listing_and_the_disassembly_name_the_slot() {
    let assembled = good(&period("fadd a, x, y || fsub b, x, y || fmul c, x, y\n fabs t, x"), "second_adder");
    let text = listing::listing(&assembled);
    assert!(text.contains("add aux start: fadd a, x, y || fsub b, x, y"), "{text}");
    assert!(text.contains("       fabs t, x"), "what has one slot only says nothing of it:\n{text}");
    let text = disasm::disassemble(&assembled.program);
    assert!(text.contains("fmul c, x, y || fadd.add a, x, y || fsub.aux b, x, y"), "{text}");
    // No slot is named on f3.
    let assembled =
        assemble(&period("fadd a, x, y || fmul c, x, y\n fadd b, x, y\n fabs t, x"), &F3).expect("good");
    assert!(!disasm::disassemble(&assembled.program).contains("fadd."));
}

/// A program of this repository for a machine, and the cycles of its period or else of its longest block.
fn shipped(folder: &str, name: &str, machine: &'static Machine, effort: u32) -> (Program, u32) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../programs").join(folder);
    let options = Options { machine, effort, ..Options::default() };
    let assembled = takt_asm::assemble(name, &FileLoader::new(root), &options)
        .unwrap_or_else(|errors| panic!("{}: {}", machine.name, errors.render(false)));
    let period = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
    let longest = assembled.blocks.iter().map(|block| block.cycles).max();
    let cycles = period.map(|block| block.cycles).or(longest).expect("it has a scheduled block");
    (assembled.program, cycles)
}

/// The outputs of a program in some periods, by name.
fn periods(program: &Program) -> Vec<(String, Vec<u32>)> {
    let mut emulator = Emulator::new(program).expect("it fits");
    let mut seen: Vec<(String, Vec<u32>)> =
        program.outputs.iter().map(|port| (port.name.clone(), Vec::new())).collect();
    for period in 0..8u32 {
        for (number, port) in (0..).zip(&program.inputs) {
            let value = match port.ty {
                takt_isa::Type::F => {
                    (0.01 * f32::from(number as u16) + 0.003 * f32::from(period as u16)).to_bits()
                }
                _ => 1000 * number + 37 * period,
            };
            emulator.set_input_bits(port.register, value).expect("it is an input");
        }
        emulator.run_period(&[]).unwrap_or_else(|error| panic!("{}: {error}", program.machine.name));
        for (port, (_, values)) in program.outputs.iter().zip(&mut seen) {
            values.extend(emulator.register(port.register));
        }
    }
    seen
}

#[test]
fn shipped_programs_give_the_same_bits_on_every_row() {
    for (folder, name) in [
        ("hybrid", "tracking.s"),
        ("hybrid", "tracking_literal.s"),
        ("arm", "forward.s"),
        ("arm", "inverse.s"),
    ] {
        let expected = periods(&shipped(folder, name, &F3, 0).0);
        assert!(expected.iter().any(|(_, values)| values.iter().any(|bits| *bits != 0)), "{name}");
        for machine in rows::all() {
            let found = periods(&shipped(folder, name, machine, 0).0);
            assert_eq!(found, expected, "{name} on {}", machine.name);
        }
    }
}

/// Asserts an upper limit on the cycles of a shipped program on a row, at the default effort.
#[track_caller]
fn takes_no_more(row: &str, most: u32) {
    let (_, cycles) = shipped("hybrid", "tracking.s", rows::named(row), takt_asm::schedule::DEFAULT_EFFORT);
    assert!(cycles <= most, "tracking.s on {row}: {cycles} cycles, {most} before");
}

#[test]
fn a_further_adder_saves_cycles() {
    takes_no_more("second_adder", 120);
}

#[test]
fn a_further_multiplier_saves_cycles() {
    takes_no_more("second_multiplier", 111);
}

/// A register that several runs write has one bank, whichever of them is scheduled first; so has a register of a loop.
#[test]
fn a_register_of_several_runs_has_one_bank() {
    let text = ".schedule on\n.input x\n.output o\n.reg n:int s r\n.once\n fadd s, x, 1.0\n wait start\n.period\n\
        start: li n, 3\n mov r, x\n.loop_bound 3\nagain: fadd s, s, r\n fadd r, r, x\n isub n, n, 1\n bnz n, again\n\
        fadd o, s, r\n wait start\n";
    let expected = outputs(&assemble(text, &F3).expect("good").program, &[0.3]);
    for machine in rows::all() {
        let options = Options { machine, ..Options::default() };
        let assembled = takt_asm::assemble("t.s", &MemoryLoader::of("t.s", text), &options);
        let program = assembled.unwrap_or_else(|report| panic!("{}", report.render(false))).program;
        assert_eq!(outputs(&program, &[0.3]), expected, "{}", machine.name);
    }
}

#[test]
fn resources_have_their_names() {
    let slots =
        |all: &[usize]| Resources::Slots(all.iter().filter_map(|slot| SlotIndex::new(*slot)).collect());
    assert_eq!(slots(&[1]).text(&F3), "slot add");
    assert_eq!(slots(&[1, 2]).text(&F3), "slots add+aux");
    // Units are numbered over all slots.
    let adder = F3.slots[0].units.len();
    assert_eq!(Resources::Units(vec![adder]).text(&F3), "unit add");
    assert_eq!(Resources::Units(vec![adder, adder + 1]).text(&F3), "units add.add+aux.alu");
}

#[test]
fn unscheduled_code_stays_as_written() {
    let work = " fadd y, x, x\n fmul z, x, x\n wait period\n";
    let text =
        format!(".input x\n.output y, z\n.schedule on\n.once\n{work}.schedule off\n.period\nperiod:\n{work}");
    let assembled = assemble(&text, &F3).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let period =
        assembled.program.sections.iter().find(|section| section.name == "period").expect("it has one");
    let bundles = bundles(&assembled).len();
    assert_eq!((period.start.index(), bundles - period.start.index()), (2, 3));
}
