// SPDX-License-Identifier: MIT OR Apache-2.0
//! The meaning of the language, rule by rule of `docs/language.md`.

use crate::common;
use crate::common::{bad, bundles, good};
use takt_asm::{Expression, expr::Value};
use takt_isa::program::Space;
use takt_isa::{BundleAddress, F1, F3, Register, Type};

/// The bits that the loader sets, in the order of their registers.
fn constants(text: &str) -> Vec<u32> {
    good(text).program.constants.iter().map(|constant| constant.1).collect()
}

#[test]
fn constants_are_kept_once_by_their_bits() {
    let text = ".input x\n.output F, k:int\n.period\n fadd F, x, 0.5\n fadd F, 0.25*2, F\n fmul F, F, 1/2\n iadd k, k, 3\n iadd k, k, 0b11\n";
    let mut bits = constants(text.replace(" fmul F, F, 1/2\n", "").as_str());
    bits.sort_unstable();
    assert_eq!(bits, [3, 0.5f32.to_bits()]);
}

#[test]
fn zero_needs_no_register() {
    let assembled =
        good(".input x\n.output F, k:int\n.period\n fadd F, x, 0.0\n iadd k, k, 0\n fadd F, F, -0.0\n");
    let bits: Vec<u32> = assembled.program.constants.iter().map(|constant| constant.1).collect();
    assert_eq!(bits, [(-0.0f32).to_bits()], "-0.0 is not zero's bits");
    let add = assembled.program.bundle(BundleAddress::RESET).expect("it is there").expect("it is legal")[1];
    assert_eq!(add.sources[1], Register::ZERO);
}

#[test]
fn value_takes_the_type_of_its_operand() {
    // float operand, integer operand, any operand; integers round to binary32 in one step.
    assert_eq!(constants(".input x\n.output F\n.period\n fadd F, x, 2\n"), [2.0f32.to_bits()]);
    assert_eq!(constants(".input x:int\n.output k:int\n.period\n iadd k, x, 8.0/4\n"), [2]);
    assert_eq!(constants(".input x\n.output b\n.period\n iand b, x, 2\n"), [2]);
    assert_eq!(constants(".input x\n.output b\n.period\n iand b, x, 2.0\n"), [2.0f32.to_bits()]);
    assert_eq!(constants(".input x\n.output b\n.period\n iand b, x, float(2)\n"), [2.0f32.to_bits()]);
    assert_eq!(constants(".input x\n.output b\n.period\n iand b, x, -1\n"), [u32::MAX]);
    // 2^24 + 1 + 2^-30 is just above halfway between binary32 numbers: rounding through binary64 first would lose the excess.
    let halfway = (1i64 << 54) + (1 << 30) + 1;
    let text = format!(".input x\n.output F\n.period\n fadd F, x, {halfway}\n");
    assert_eq!(constants(&text), [(halfway as f32).to_bits()]);
    assert_ne!((halfway as f32).to_bits(), (halfway as f64 as f32).to_bits(), "the case tells the two apart");
}

#[test]
fn constants_go_where_there_is_room() {
    // 220 registers of bank m are taken: the constants go elsewhere, though a multiplication reads them.
    let mut text = String::from(".input x\n.output F\n.once\n");
    for i in 0..220 {
        text += &format!(".state m{i}\n fmul m{i}, x, x\n");
    }
    text += ".period\nperiod:\n";
    for i in 0..220 {
        text += &format!(" fadd F, m{i}, {i}.5\n");
    }
    let assembled = good(&text);
    let in_m = assembled
        .program
        .constants
        .iter()
        .filter(|(register, _)| F3.slots[0].bank.contains(*register))
        .count();
    assert_eq!(assembled.program.constants.len(), 220);
    assert_eq!(in_m, 0, "the other banks have more room");
}

#[test]
fn registers_lie_in_the_bank_of_their_slot() {
    let assembled = good(
        ".input x\n.output F, G, H\n.state a b c\n.once\n fmul a, x, x\n fadd b, x, x\n mov c, x\n.period\n fmul F, a, b\n fadd G, b, c\n mov H, c\n",
    );
    let place = |name: &str| {
        let program = &assembled.program;
        let port =
            program.registers.iter().chain(&program.outputs).find(|port| port.name == name).expect(name);
        F3.register_name(port.register).expect("it is in a bank")
    };
    assert_eq!(["F", "G", "H"].map(place), ["m224", "a225", "x226"]);
    assert_eq!(["a", "b", "c"].map(|name| place(name).chars().next()), [Some('m'), Some('a'), Some('x')]);
}

#[test]
fn inputs_follow_one_another_around_those_with_a_place() {
    let assembled =
        good(".input a, b @ i1, c:int, d:bits\n.output F\n.period\n fadd F, a, b\n fadd F, c, d\n");
    let inputs: Vec<(&str, u16, Type)> = assembled
        .program
        .inputs
        .iter()
        .map(|port| (port.name.as_str(), F3.input_number(port.register).expect("an input"), port.ty))
        .collect();
    assert_eq!(inputs, [("a", 0, Type::F), ("b", 1, Type::F), ("c", 2, Type::I), ("d", 3, Type::B)]);
}

#[test]
fn unused_registers_take_no_place() {
    let assembled =
        good(".reg a b c\n.output F\n.input x\n.period\np: fadd b, x, 1\n fadd F, b, 1\n wait p\n");
    let names: Vec<&str> = assembled.program.registers.iter().map(|port| port.name.as_str()).collect();
    assert_eq!(names, ["b"]);
    assert_eq!(assembled.warnings.list.len(), 2);
}

#[test]
fn sections_are_joined_in_order() {
    let assembled = good(
        ".reg a\n mov a, 1\n.period\np1: mov a, 2\n.once\no2: mov a, 3\n.period\np2: wait p1\n.data\nd: .word 7\n.once\n jmp p2\n",
    );
    assert_eq!(bundles(&assembled).len(), 5);
    let sections: Vec<(&str, u32, u32)> =
        assembled.program.sections.iter().map(|s| (s.name.as_str(), s.start.get(), s.end.get())).collect();
    assert_eq!(sections, [("once", 0, 3), ("period", 3, 5)]);
    let label = |name: &str| {
        let symbol = assembled.program.symbols.iter().find(|symbol| symbol.name == name).expect(name);
        (symbol.space, symbol.address)
    };
    assert_eq!(label("o2"), (Space::Code, 1));
    assert_eq!(label("p1"), (Space::Code, 3));
    assert_eq!(label("p2"), (Space::Code, 4));
    assert_eq!(label("d"), (Space::Data, 0));
    assert_eq!(bundles(&assembled)[4], "wait 3");
}

#[test]
fn one_slot_keeps_the_meaning_of_a_bundle() {
    let order = |bundle: &str| {
        let text = format!(
            ".reg a b c d\n.input x\n.output F\n.period\np: mov d, x\n mov a, x\n mov b, x\n mov c, x\n {bundle}\n fadd F, a, b\n fadd F, c, d\n"
        );
        let assembled = match common::assemble(&text, &F1) {
            Ok(assembled) => assembled,
            Err(report) => panic!("{}", report.render(false)),
        };
        let all = bundles(&assembled);
        all[4..all.len() - 2]
            .iter()
            .map(|text| text.split(' ').next().unwrap_or("").to_owned())
            .collect::<Vec<_>>()
    };
    // Readers before writers, whatever the order of the source.
    assert_eq!(order("mov b, x || fadd a, b, c"), ["fadd", "mov"]);
    assert_eq!(order("fadd a, b, c || mov b, x"), ["fadd", "mov"]);
    assert_eq!(order("fmul a, x, x || fsub b, a, x || mov c, b"), ["mov", "fsub", "fmul"]);
    // A branch comes last, `rdflags` first, a load before a store.
    assert_eq!(order("jmp p || mov a, x"), ["mov", "jmp"]);
    assert_eq!(order("fadd a, x, x || rdflags b || clrflags"), ["rdflags", "clrflags", "fadd"]);
    assert_eq!(order("st [zero], x || ld a, 0"), ["ld", "st"]);
}

#[test]
fn operations_go_to_their_slots_in_any_order() {
    let one = good(".input x\n.output F, G, H\n.period\n mov H, x || fmul F, x, x || fadd G, x, x\n");
    let other = good(".input x\n.output F, G, H\n.period\n fadd G, x, x || mov H, x || fmul F, x, x\n");
    assert_eq!(one.program.code, other.program.code);
    assert_eq!(one.program.bundles(), 1);
}

/// Names that two uses of a macro declare in turn stay apart, few or many.
#[test]
fn uses_keep_their_many_locals_apart() {
    let locals: String = (0..20).map(|i| format!(".const K{i} = BASE + {i}\n")).collect();
    let body = "m.word K0\n.word K7\n.word K8\n.word K19\n";
    let source = format!(
        ".macro m BASE, inner\n{locals}.if inner\n m BASE + 100, 0\n.endif\n{}.endm\n.data\n m 1000, 1\n m 2000, 0\n",
        body.replacen('m', "", 1)
    );
    let words = |base: u32| [base, base + 7, base + 8, base + 19];
    assert_eq!(good(&source).program.data, [words(1100), words(1000), words(2000)].concat());
}

/// Types are followed in the order of the source, and a value may come from further down.
#[test]
fn warns_of_types_from_later_lines() {
    let text =
        ".input n:int\n.output F\n.reg b\n.period\nagain:\n fadd F, b, 1\nlow:\n mov b, n\n wait again\n";
    let warnings = good(text).warnings;
    let codes: Vec<&str> = warnings.list.iter().map(|warning| warning.code).collect();
    assert_eq!(codes, ["types"], "{}", warnings.render(false));
}

#[test]
fn macro_locals_are_of_each_use() {
    let assembled = good(
        ".macro m x\n.reg t\n.const K = 2\n fadd t, x, K\n bz t, skip\n fadd x, t, 1\nskip:\n.endm\n.input i\n.output F\n.reg a\n.period\n fadd a, i, 0\n m a\n m a\n fadd F, a, 0\n",
    );
    let names: Vec<&str> = assembled.program.symbols.iter().map(|symbol| symbol.name.as_str()).collect();
    assert_eq!(names, ["m.1.skip", "m.2.skip"]);
    let registers: Vec<&str> = assembled.program.registers.iter().map(|port| port.name.as_str()).collect();
    assert!(registers.contains(&"m.1.t") && registers.contains(&"m.2.t"), "{registers:?}");
    // A macro does not see its caller's locals.
    let report = bad(
        ".macro inner\n fadd @a1, t, 1\n.endm\n.macro outer\n.reg t\n inner\n.endm\n.period\n outer\n",
        &F3,
    );
    assert!(report.render(false).contains("`t` is not declared"));
}

#[test]
fn generated_names_do_not_clash() {
    let assembled = good(".macro m\nx: nop\n.endm\n.period\nm.1.x: nop\n m\n");
    let names: Vec<&str> = assembled.program.symbols.iter().map(|symbol| symbol.name.as_str()).collect();
    assert_eq!(names.len(), 2);
    assert_ne!(names[0], names[1]);
    // Names made of the longest names stay within the limit.
    let long = "n".repeat(255);
    let assembled = good(&format!(".macro {long}\n{long}: nop\n.endm\n.period\n {long}\n {long}\n"));
    let names: Vec<&str> = assembled.program.symbols.iter().map(|symbol| symbol.name.as_str()).collect();
    assert!(names[0] != names[1] && names.iter().all(|name| name.len() <= 255), "{names:?}");
}

#[test]
fn parameters_stand_for_operands_and_for_text() {
    let assembled = good(
        ".macro put what, n, at\n fadd {what}{n}, {what}{n}, n\n st at, {what}{n}\n.endm\n.data\ntab: .space 4\n.const TWO = 2\n.reg q1 q2 q3\n.output F\n.once\n fadd q1, zero, 1\n fadd q2, zero, 1\n fadd q3, zero, 1\n.period\n.rep i, 1, 2\n put q, i, tab+i\n.endr\n put q, TWO+1, 1[zero]\n",
    );
    let all = bundles(&assembled);
    assert!(all[3].starts_with("fadd q1, q1") && all[4] == "st 1[zero], q1", "{all:?}");
    assert!(all[5].starts_with("fadd q2, q2") && all[6] == "st 2[zero], q2", "{all:?}");
    assert!(all[7].starts_with("fadd q3, q3") && all[8] == "st 1[zero], q3", "{all:?}");
}

#[test]
fn repetition_counts_both_ends() {
    let count = |first: i64, last: i64| {
        good(&format!(".period\n nop\n.rep i, {first}, {last}\n nop\n.endr\n")).program.bundles() - 1
    };
    assert_eq!(count(1, 3), 3);
    assert_eq!(count(-1, 1), 3);
    assert_eq!(count(2, 2), 1);
    assert_eq!(count(3, 1), 0);
    assert_eq!(count(i64::MAX - 1, i64::MAX), 2);
}

#[test]
fn one_branch_is_taken() {
    let value = |n: i64| {
        let text = format!(
            ".const N = {n}\n.if N == 1\n.const X = 10\n.elif N == 2\n.const X = 20\n.elif N == 3\n.if N > 2\n.const X = 30\n.else\n.const X = 31\n.endif\n.else\n.const X = 40\n.endif\n.data\n .word X\n"
        );
        good(&text).program.data[0]
    };
    assert_eq!([1, 2, 3, 4].map(value), [10, 20, 30, 40]);
}

#[test]
fn data_is_laid_out_in_order() {
    let assembled = good(".data\n .float 1, 0.5\na: .word -1, 0x10, b\n .space 2\nb: .word a, b-a\n");
    assert_eq!(assembled.program.data, [0x3f80_0000, 0x3f00_0000, u32::MAX, 16, 7, 0, 0, 2, 5]);
}

#[test]
fn canonical_names_are_only_recognised_behind_an_at() {
    let assembled =
        good(".reg m3 @ m7\n.output F\n.period\n fmul m3, F, F\n fadd F, m3, @m7\n fmul @m9, m3, 1\n");
    assert_eq!(bundles(&assembled)[..2], ["fmul m3, F, F", "fadd F, m3, m3"]);
    assert_eq!(assembled.program.registers.len(), 1);
}

#[test]
fn names_of_values_can_be_declared_as_something_else() {
    let assembled = good(".reg e\n.input pi\n.output F\n.period\n fadd e, pi, 1\n fadd F, e, e\n");
    assert_eq!(bundles(&assembled)[1], "fadd F, e, e");
}

#[test]
fn locations_are_those_of_the_lines() {
    let assembled = good(
        ".reg a\n.output F\n.period\n fadd a, F, 1 ||\n\n mov F, a\n.rep i, 1, 2\n nop\n.endr\n.loc \"x.s\" 7\n nop\n.loc none\n nop\n",
    );
    let lines: Vec<Option<(String, u32)>> = assembled
        .program
        .lines
        .iter()
        .map(|line| line.map(|line| (assembled.program.files[line.file as usize].clone(), line.line)))
        .collect();
    let at = |file: &str, line| Some((file.to_owned(), line));
    assert_eq!(lines[0..3], [None, at("test.s", 4), at("test.s", 6)]);
    assert_eq!([&lines[3], &lines[6]], [&at("test.s", 8), &at("test.s", 8)]);
    assert_eq!(lines[9], at("x.s", 7));
    assert_eq!(lines[12], None);
}

#[test]
fn a_name_split_over_slots_is_one_name() {
    let assembled =
        good(".input x\n.output F\n.reg t\n.period\n fmul t, x, x\n fadd t, t, 1\n fadd F, t, 0\n");
    assert_eq!(assembled.program.bundles(), 3);
}

#[test]
fn expressions() {
    let cases: &[(&str, Value)] = &[
        ("1 + 2*3", Value::Int(7)),
        ("(1 + 2)*3", Value::Int(9)),
        ("-2^2", Value::Int(-4)),
        ("2^-1", Value::Real(0.5)),
        ("2^3^2", Value::Int(512)),
        ("2^-2*4", Value::Real(1.0)),
        ("-2^-2", Value::Real(-0.25)),
        ("10 - 3 - 2", Value::Int(5)),
        ("7/2", Value::Real(3.5)),
        ("6/2", Value::Int(3)),
        ("-6/4", Value::Real(-1.5)),
        ("-7 % 3", Value::Int(2)),
        ("7 % -3", Value::Int(-2)),
        ("-7.5 % 2", Value::Real(0.5)),
        ("1 << 4 + 1", Value::Int(32)),
        ("-16 >> 2", Value::Int(-4)),
        ("1 | 6 & 3", Value::Int(3)),
        ("1 + 1 == 2", Value::Int(1)),
        ("1 < 2 == 1", Value::Int(1)),
        ("1 | 2 == 3", Value::Int(1)),
        ("1.5 >= 2", Value::Int(0)),
        ("2 != 2.0", Value::Int(0)),
        ("nan == nan", Value::Int(0)),
        ("~5", Value::Int(-6)),
        ("!5", Value::Int(0)),
        ("!0.0", Value::Int(1)),
        ("--3", Value::Int(3)),
        ("+3", Value::Int(3)),
        ("9223372036854775807", Value::Int(i64::MAX)),
        ("2^62", Value::Int(1 << 62)),
        ("2^64", Value::Real(18_446_744_073_709_551_616.0)),
        ("0xff + 0b11 + 1_000", Value::Int(1258)),
        ("0x1.8p1", Value::Real(3.0)),
        ("sqrt(16)", Value::Real(4.0)),
        ("abs(-3)", Value::Int(3)),
        ("abs(-3.5)", Value::Real(3.5)),
        ("min(3, 1, 2)", Value::Int(1)),
        ("max(3, 1, 2.5)", Value::Real(3.0)),
        ("floor(-1.5)", Value::Int(-2)),
        ("ceil(-1.5)", Value::Int(-1)),
        ("round(2.5)", Value::Int(2)),
        ("round(3.5)", Value::Int(4)),
        ("int(-1.9)", Value::Int(-1)),
        ("float(3)", Value::Real(3.0)),
        ("xor(6, 3)", Value::Int(5)),
        ("bits(1.0)", Value::Int(0x3f80_0000)),
        ("bits(1)", Value::Int(0x3f80_0000)),
        ("atan2(0, 1)", Value::Real(0.0)),
        ("exp(0) + log(1) + sin(0) + cos(0) + tan(0) + asin(0) + acos(1)", Value::Real(2.0)),
        ("-inf", Value::Real(f64::NEG_INFINITY)),
        ("x{1+1} * 2", Value::Int(84)),
        ("x2 % 5", Value::Int(2)),
        ("pi", Value::Real(std::f64::consts::PI)),
        ("PI - pi", Value::Real(0.0)),
    ];
    for (text, expected) in cases {
        let expression = Expression::parse(text).unwrap_or_else(|report| panic!("{}", report.render(false)));
        let value = expression.evaluate(|name| (name == "x2").then_some(Value::Int(42)));
        match value {
            Ok(value) => assert_eq!(value, *expected, "{text}"),
            Err(report) => panic!("{}", report.render(false)),
        }
    }
}

#[test]
fn rejects_invalid_expressions() {
    for text in
        ["", "1 +", "(1", "1 2", "1 = 2", "f(", "a:b", "1\n2", "1 || 2", "x[1]", "@m3", ".reg", "\"x\"", "5x"]
    {
        assert!(Expression::parse(text).is_err(), "{text}");
    }
    let fault = |text: &str| {
        let expression = Expression::parse(text).expect("it is an expression");
        expression.evaluate(|_| None).expect_err("it has no value").render(false)
    };
    assert!(fault("1 + missing").contains("`missing` is not known"));
    assert!(fault("frob(1)").contains("`frob` is not a function"));
    assert!(fault("1/0").contains("division by zero"));
}

/// An output's number is its place among the outputs, or the source's number; the slot that writes it only chooses the bank.
#[test]
fn an_output_has_one_number() {
    let numbers = |text: &str, machine: &'static takt_isa::Machine| -> Vec<(String, u16)> {
        let options = takt_asm::Options { machine, ..takt_asm::Options::default() };
        let assembled = takt_asm::assemble("a.s", &takt_asm::MemoryLoader::of("a.s", text), &options);
        let program = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program;
        let number = |register| {
            let machine = program.machine;
            machine.output_number(register).or(machine.input_number(register)).expect("a port")
        };
        let ports = program.inputs.iter().chain(&program.outputs);
        ports.map(|port| (port.name.clone(), number(port.register))).collect()
    };
    let expect = |text: &str, expected: &[(&str, u16)]| {
        for machine in [&F3, &F1] {
            let expected: Vec<_> =
                expected.iter().map(|(name, number)| ((*name).to_owned(), *number)).collect();
            assert_eq!(numbers(text, machine), expected, "{}: {text}", machine.name);
        }
    };
    let ports = ".input x, y\n.output F, G, H\n.period\n";
    let all = [("x", 0), ("y", 1), ("F", 0), ("G", 1), ("H", 2)];
    // The number depends neither on the slot that writes the output nor on the order of writes.
    expect(&format!("{ports} fmul F, x, y\n fadd G, x, y\n mov H, x\n"), &all);
    expect(&format!("{ports} mov G, x\n fmul H, x, y\n fmul F, x, y\n"), &all);
    // Given numbers, as expressions too, and the rest around them.
    expect(
        ".const K = 3\n.input x @ 1, y, z @ K, w\n.rep i, 1, 2\n.output F{i} @ i*2-2, G{i} @ i\n.endr\n.output H, J @ 31\n.period\n".replace("G{i} @ i\n", "G{i} @ i + 10\n").as_str(),
        &[("x", 1), ("y", 0), ("z", 3), ("w", 2), ("F1", 0), ("G1", 11), ("F2", 2), ("G2", 12), ("H", 1), ("J", 31)],
    );
    // A port at a register's place takes the place's number; a nameless register takes its number, too.
    let text = ".input x\n.output F @ x230, G, H\n.period\n mov F, x\n fadd @a224, x, x\n fmul G, x, x\n";
    assert_eq!(numbers(text, &F3)[1..], [("F".to_owned(), 6), ("G".to_owned(), 1), ("H".to_owned(), 2)]);
    // The machine's number of ports is accepted, and not one more.
    let ports = |kind: &str, count: u16| (0..count).map(|i| format!(".{kind} p{i}\n")).collect::<String>();
    for (kind, most) in [("output", 32), ("input", 255)] {
        let all = numbers(&format!("{}.period\n nop\n", ports(kind, most)), &F3);
        assert!(all.iter().map(|(_, number)| *number).eq(0..most));
        let errors = bad(&format!("{}.period\n nop\n", ports(kind, most + 1)), &F3);
        let message = format!("{} {kind} ports are needed, and f3 has {most}", most + 1);
        assert!(errors.render(false).contains(&message), "{}", errors.render(false));
    }
}

#[test]
fn ports_may_be_latched() {
    let latched =
        |text: &str| good(&format!(".input x\n.output F\n{text}.period\n fadd F, x, x\n")).program.latched;
    assert!(!latched("") && !latched(".ports direct\n"));
    assert!(latched(".ports latched\n") && latched(".ports latched\n.ports latched\n"));
}

#[test]
fn predefined_names_query_the_machine() {
    // Machines differ in the instructions that they execute: the expected values come from the tables.
    let text = |mnemonic: &str| format!(".if has.{mnemonic}\n.data\n.word has.{mnemonic} + 1\n.endif\n");
    let mut answers = [0; 2];
    for machine in takt_isa::MACHINES {
        for row in takt_isa::ROWS {
            let assembled = common::assemble(&text(row.mnemonic), machine);
            let data = assembled.unwrap_or_else(|report| panic!("{}", report.render(false))).program.data;
            let idle = row.function == takt_isa::Function::Idle;
            let has = idle || machine.host(row.function).is_some();
            assert_eq!(data, if has { vec![2] } else { vec![] }, "{} on {}", row.mnemonic, machine.name);
            answers[usize::from(has)] += 1;
        }
    }
    assert!(answers.iter().all(|&count| count > 0), "some machine lacks something");
    // A declaration in the source takes precedence, as with `pi`.
    assert_eq!(good(".const has.fadd = 7\n.data\n.word has.fadd\n").program.data, [7]);
}

#[test]
fn predefined_names_query_macros() {
    let asked = ".if macro.extra\n.data\n.word 1\n.else\n.data\n.word 0\n.endif\n";
    let macro_ = ".macro extra\n nop\n.endm\n";
    assert_eq!(good(asked).program.data, [0]);
    assert_eq!(good(&format!("{macro_}{asked}")).program.data, [1]);
    assert_eq!(good(&format!("{asked}{macro_}")).program.data, [0], "only what stands above counts");
    assert_eq!(good(&format!(".const extra = 2\n{asked}")).program.data, [0], "a constant is no macro");
}

#[test]
fn advice_on_a_cast_operand_assembles() {
    let text = ".input x\n.output y\n.period\np: flt y:int, x, 1.0\n wait p\n";
    let report = good(text).warnings.render(false);
    assert!(report.contains("`y:bits`") && !report.contains("y:int:bits"), "{report}");
    assert!(good(&text.replace("y:int", "y:bits")).warnings.list.is_empty());
}
