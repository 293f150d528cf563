// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every macro of the library with every kind of argument: the right value, or an error with advice.
//!
//! The macros and the types of their parameters are read from the library itself, so that a new macro is covered at once. An
//! argument of the right type gives the bits of a register of that type, in whatever form it is written; functions that Rust has too
//! give Rust's values.

use std::path::PathBuf;
use std::sync::OnceLock;
use takt_asm::{AssembledProgram, MemoryLoader, Options, Search, diag::Diagnostics};
use takt_emu::Emulator;
use takt_isa::{Machine, Op, Slot, T1, T3, T4, Unit};

/// The folder of the library.
fn library() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../programs/library")
}

/// A parameter: its name, its type, and the number of indices that the body gives it.
#[derive(Clone, Debug)]
struct Parameter {
    name: String,
    ty: String,
    rank: usize,
}

/// A macro of the library.
#[derive(Debug)]
struct Macro {
    file: String,
    name: String,
    parameters: Vec<Parameter>,
    body: String,
}

/// The number of indices after a name in a body; 0 if it has none anywhere.
fn rank(body: &str, name: &str) -> usize {
    let bytes = body.as_bytes();
    let is_name = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'.';
    let starts = body.match_indices(name).map(|(start, _)| start);
    let mut ranks = starts.filter_map(|start| {
        let rest = body[start + name.len()..].strip_prefix('[')?;
        if start > 0 && is_name(bytes[start - 1]) {
            return None;
        }
        Some(1 + rest[..rest.find(']')?].matches(',').count())
    });
    ranks.next().unwrap_or(0)
}

/// The library's public macros.
fn macros() -> Vec<Macro> {
    let mut all: Vec<Macro> = Vec::new();
    for entry in std::fs::read_dir(library()).expect("it is there") {
        let path = entry.expect("it can be read").path();
        let file = path.file_name().expect("it has one").to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path).expect("it can be read");
        for definition in text.split("\n.macro").skip(1) {
            let (line, rest) = definition.split_once('\n').expect("a macro has a body");
            let body = rest.split("\n.endm").next().expect("a macro has an end").to_owned();
            let (name, parameters) = line.trim().split_once(' ').expect("each macro has parameters");
            let parameter = |written: &str| {
                let (name, ty) = written.trim().split_once(':').unwrap_or_else(|| {
                    panic!("`{}` of `{name}` in {file} has no type", written.trim());
                });
                Parameter { name: name.to_owned(), ty: ty.to_owned(), rank: rank(&body, name) }
            };
            let parameters = parameters.split(',').map(parameter).collect();
            all.push(Macro { file: file.clone(), name: name.to_owned(), parameters, body });
        }
    }
    // A parameter that is passed on has the indices that the other macro gives it.
    for _ in 0..4 {
        for index in 0..all.len() {
            for place in 0..all[index].parameters.len() {
                if all[index].parameters[place].rank == 0 {
                    all[index].parameters[place].rank = passed(&all, &all[index], place);
                }
            }
        }
    }
    all.retain(|one| !one.name.contains('.'));
    all
}

/// The number of indices of a parameter that a macro passes on to others.
fn passed(all: &[Macro], of: &Macro, place: usize) -> usize {
    let name = &of.parameters[place].name;
    let ranks = of.body.lines().filter_map(|line| {
        let (callee, given) = line.trim().split_once(' ')?;
        let callee = all.iter().find(|known| known.name == callee)?;
        let place = given.split(',').position(|given| given.trim() == name)?;
        Some(callee.parameters.get(place)?.rank)
    });
    ranks.max().unwrap_or(0)
}

/// Elements in each direction of the arrays, enough for every macro, and the value of numbers.
const ROWS: usize = 24;
const NUMBER: &str = "8";

/// An argument as the source spells it, for a parameter with `rank` indices.
fn argument(kind: &str, rank: usize) -> String {
    let array = if rank == 0 { 1 } else { rank };
    match kind {
        "float array" => format!("A{array}"),
        "int array" => format!("K{array}"),
        other => other.to_owned(),
    }
}

const KINDS: &[(&str, &str)] = &[
    ("float literal", "2.5"),
    ("whole literal", "3.0"),
    ("integer literal", "3"),
    ("float register", "x"),
    ("int register", "n"),
    ("float constant", "C"),
    ("integer constant", "N"),
    ("float array", "float array"),
    ("int array", "int array"),
];

/// A parameter takes an argument of a kind.
fn takes(parameter: &Parameter, kind: &str) -> bool {
    match (parameter.ty.as_str(), parameter.rank) {
        ("float", 0) => {
            matches!(
                kind,
                "float literal"
                    | "whole literal"
                    | "integer literal"
                    | "float register"
                    | "float constant"
                    | "integer constant"
            )
        }
        ("float", _) => kind == "float array",
        ("int", 0) => {
            matches!(kind, "whole literal" | "integer literal" | "int register" | "integer constant")
        }
        ("bits", 0) => !kind.ends_with("array"),
        // A bound has to be an integer; a size may be used as a real number, too.
        ("number", _) => kind.ends_with("literal") || kind.ends_with("constant"),
        (ty, rank) => panic!("what is a parameter of type {ty} with {rank} indices?"),
    }
}

/// t4 with large memories and without the units that macros of the library replace, which are defined only where a unit is missing.
fn machine() -> &'static Machine {
    static MACHINE: OnceLock<Machine> = OnceLock::new();
    MACHINE.get_or_init(|| {
        let replaced = ["fsin", "fatan2", "facos"];
        let replaced = replaced.map(|name| Op::from_mnemonic(name).expect("an instruction").row().function);
        let slots = T4.slots.iter().map(|slot| {
            let stays = |unit: &&Unit| !unit.functions.iter().any(|function| replaced.contains(function));
            Slot { units: Vec::leak(slot.units.iter().filter(stays).copied().collect()), ..*slot }
        });
        Machine { slots: Vec::leak(slots.collect()), code_depth: 4096, data_depth: 65536, ..T4 }
    })
}

/// A program with these lines in its period, and names for every kind of argument.
fn program(file: &str, lines: &str) -> Result<AssembledProgram, Diagnostics> {
    let machine = machine();
    let text = format!(
        ".include <math.s>
.include <{file}>
.const  C = 2.5
.const  N = 3
.array  A1[300], A2[{ROWS},{ROWS}], K1[300]:int, K2[{ROWS},{ROWS}]:int
.input  x, n:int
.output d, k:int
.reg    t r:int
.once
        wait    period
.period
period:
{lines}
        wait    period
"
    );
    let loader = Search::new(MemoryLoader::of("test.s", text)).folder(library());
    takt_asm::assemble("test.s", &loader, &Options { machine, ..Options::default() })
}

/// The bits of the output `d` of a program, given both inputs.
fn run(assembled: &AssembledProgram, x: f32, n: i32) -> u32 {
    let program = &assembled.program;
    let mut emulator = Emulator::new(program).expect("it fits");
    for (port, value) in program.inputs.iter().zip([x.to_bits(), n.cast_unsigned()]) {
        emulator.set_input_bits(port.register, value).expect("it is an input");
    }
    // The code before the first period counts as a period.
    for _ in 0..2 {
        emulator.run_period(&[]).expect("it runs");
    }
    let output = program.outputs.iter().find(|port| port.name == "d").expect("it is declared");
    emulator.register(output.register).expect("it is written")
}

/// Arguments for a use of a macro, each of its parameter's type: registers, arrays, numbers.
fn typed(parameters: &[Parameter]) -> Vec<String> {
    let one = |(number, parameter): (usize, &Parameter)| match (parameter.ty.as_str(), parameter.rank) {
        ("float", 0) if number == 0 => "t".to_owned(),
        ("float", 0) => "x".to_owned(),
        ("bits", 0) => "x".to_owned(),
        ("int", 0) if number < 2 => "r".to_owned(),
        ("int", 0) => "3".to_owned(),
        ("float", rank) => format!("A{rank}"),
        ("name", _) => "relu".to_owned(),
        ("number", _) => NUMBER.to_owned(),
        other => panic!("{other:?}"),
    };
    parameters.iter().enumerate().map(|(number, parameter)| one((number, parameter))).collect()
}

/// The report has an error about types, rather than only about consequences such as sizes.
fn about_types(report: &Diagnostics) -> bool {
    let codes =
        ["types", "arguments", "expression", "array", "not-a-value", "equation", "not-writable", "operand"];
    report.list.iter().any(|one| codes.contains(&one.code))
}

#[test]
fn each_argument_of_each_macro_is_right_or_an_error() {
    let all = macros();
    assert!(all.len() > 50, "{} macros", all.len());
    let mut tried = 0;
    for Macro { file, name, parameters, .. } in &all {
        for (number, parameter) in parameters.iter().enumerate() {
            if parameter.ty == "name" {
                continue;
            }
            for (kind, written) in KINDS {
                // The name of an array is the address of the first word, an integer.
                if matches!(parameter.ty.as_str(), "int" | "bits") && kind.ends_with("array") {
                    continue;
                }
                let mut arguments = typed(parameters);
                arguments[number] = argument(written, parameter.rank);
                let text = format!("        {name} {}", arguments.join(", "));
                let fits = takes(parameter, kind);
                tried += 1;
                let of = &parameter.name;
                match program(file, &text) {
                    // A literal cannot be written to, and neither can an input.
                    Ok(_) => assert!(fits, "{kind} as `{of}` is accepted:\n{text}"),
                    Err(report) => {
                        let rendered = report.render(false);
                        let unfit = !fits && about_types(&report);
                        let size = fits && !report.list.iter().any(|one| one.code == "types");
                        assert!(unfit || size, "{kind} as `{of}`:\n{text}\n{rendered}");
                    }
                }
            }
        }
    }
    assert!(tried > 1_000, "{tried} uses of {} macros", all.len());
}

/// Functions of floats that Rust has, too.
fn reference(name: &str, x: f64, y: f64) -> Option<f64> {
    Some(match name {
        "trunc" => x.trunc(),
        "floor" => x.floor(),
        "ceil" => x.ceil(),
        "round" => x.round(),
        "rint" => x.round_ties_even(),
        "exp" => x.exp(),
        "log" => x.ln(),
        "tan" | "tan_quick" => x.tan(),
        "asin" => x.asin(),
        "atan" => x.atan(),
        "tanh" | "tanh_quick" => x.tanh(),
        "sigmoid" => 1.0 / (1.0 + (-x).exp()),
        "elu" => {
            if x > 0.0 {
                x
            } else {
                x.exp_m1()
            }
        }
        "pow" => x.powf(y),
        "fmod" | "fmod_in" => x % y,
        "layer_linear" => x,
        "layer_relu" => x.max(0.0),
        "layer_tanh" | "layer_tanh_quick" => x.tanh(),
        "layer_sigmoid" => 1.0 / (1.0 + (-x).exp()),
        "layer_elu" => {
            if x > 0.0 {
                x
            } else {
                x.exp_m1()
            }
        }
        _ => return None,
    })
}

/// Left and right side of each line of a body: written and read operands of an equation, an instruction or a macro.
fn sides(body: &str) -> impl Iterator<Item = (&str, &str)> {
    body.lines().filter_map(|line| {
        let code = line.split(';').next()?.trim();
        code.split_once(" = ").or_else(|| code.split_once(' ')?.1.split_once(','))
    })
}

/// A side of a line contains a name.
fn has(side: &str, name: &str) -> bool {
    side.split(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '.').any(|word| word == name)
}

/// A macro writes a parameter.
fn writes(body: &str, name: &str) -> bool {
    sides(body).any(|(left, _)| has(left.split('[').next().unwrap_or_default(), name))
}

/// A macro reads a parameter before it is written.
fn is_in_place(body: &str, name: &str) -> bool {
    let mut uses = sides(body).filter(|(left, right)| has(left, name) || has(right, name));
    uses.next().is_some_and(|(_, right)| has(right, name))
}

/// The macros that are functions of floats, and how many floats each takes.
fn functions() -> Vec<(Macro, usize)> {
    let mut found = Vec::new();
    for one in macros() {
        let floats = one.parameters.iter().filter(|p| p.ty == "float" && p.rank == 0).count();
        let numbers = one.parameters.iter().filter(|p| p.ty == "number").count();
        let is_of_floats = one.parameters.len() == floats + numbers && floats > 1;
        let writes_one = one.parameters.iter().skip(1).all(|p| !writes(&one.body, &p.name));
        if is_of_floats && writes_one && !is_in_place(&one.body, &one.parameters[0].name) {
            found.push((one, floats - 1));
        }
    }
    found
}

#[test]
fn functions_give_the_value_of_the_literal_as_written() {
    let mut compared = 0;
    for (one, takes) in functions() {
        let name = &one.name;
        let numbers = one.parameters.iter().filter(|p| p.ty == "number").map(|_| NUMBER.to_owned());
        let numbers: Vec<String> = numbers.collect();
        for whole in [0i32, 1, 3, 10] {
            let value = whole as f32;
            // The other arguments are the register `x`, which holds 0.5.
            let call = |number: usize, written: &str| {
                let mut arguments: Vec<String> = vec!["x".to_owned(); takes];
                arguments[number] = written.to_owned();
                arguments.extend(numbers.clone());
                format!("        d = {name}({})*1.0", arguments.join(", "))
            };
            for number in 0..takes {
                let bits = |written: &str, x: f32| {
                    let text = call(number, written);
                    let assembled =
                        program(&one.file, &text).unwrap_or_else(|e| panic!("{text}\n{}", e.render(false)));
                    let about = assembled.warnings.list.iter().find(|warning| warning.code != "unused");
                    assert!(about.is_none(), "{text}\n{}", assembled.warnings.render(false));
                    run(&assembled, x, whole)
                };
                // Constants of functions that the language has, too, are computed by the assembler, which refuses poles.
                let refused = |written: &str| match program(&one.file, &call(number, written)) {
                    Ok(_) => false,
                    Err(report) => {
                        report.list.iter().all(|one| one.code == "expression" || one.code == "unused")
                    }
                };
                if refused(&format!("{whole}.0")) {
                    assert!(refused(&whole.to_string()), "{}", call(number, &whole.to_string()));
                    continue;
                }
                let constant = format!("(N - 3 + {whole})");
                let expected = bits(&format!("{whole}.0"), 0.5);
                for written in [format!("{whole}"), constant] {
                    assert_eq!(bits(&written, 0.5), expected, "{}", call(number, &written));
                }
                // Functions of the language are the assembler's where all is constant: half an ulp more exact.
                let run = bits("itof(n)", 0.5);
                let near = run.cast_signed().wrapping_sub(expected.cast_signed()).abs() <= 16;
                let nan = f32::from_bits(run).is_nan() && f32::from_bits(expected).is_nan();
                assert!(near || nan, "{}: {run:#x}, {expected:#x}", call(number, "itof(n)"));
                let others: Vec<f64> =
                    (0..takes).map(|at| if at == number { value.into() } else { 0.5 }).collect();
                let second = others.get(1).copied().unwrap_or(0.0);
                if let Some(exact) = reference(name, others[0], second) {
                    let found = f64::from(f32::from_bits(expected));
                    let same = found == exact as f32 as f64
                        || (found - exact).abs() <= 1e-5 * exact.abs().max(1e-30)
                        || found.is_nan() && exact.is_nan();
                    assert!(same, "{}: {found}, {exact}", call(number, &whole.to_string()));
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 80, "{compared} values compared");
}

#[test]
fn results_go_to_floats_only() {
    for (one, takes) in functions() {
        let mut arguments: Vec<String> = vec!["x".to_owned(); takes];
        arguments.extend(one.parameters.iter().filter(|p| p.ty == "number").map(|_| NUMBER.to_owned()));
        let arguments = arguments.join(", ");
        for text in [
            format!("        k = {}({arguments})", one.name),
            format!("        r = {}({arguments})", one.name),
            format!("        k = {}({arguments}) + n", one.name),
            format!("        K1[2] = {}({arguments})", one.name),
            format!("        {} k, {arguments}", one.name),
        ] {
            let report =
                program(&one.file, &text).err().unwrap_or_else(|| panic!("this is accepted: {text}"));
            let rendered = report.render(false);
            assert!(rendered.contains("ftoi") || rendered.contains("itof"), "{text}\n{rendered}");
        }
        let text = format!("        k = ftoi({}({arguments}))", one.name);
        assert!(program(&one.file, &text).is_ok(), "{text}");
    }
}

/// An instruction of a unit that the machine lacks: the error names the file whose macro an equation uses, and with the file the equation
/// is right; where the machine has the unit, the name of the function is no statement.
#[test]
fn a_missing_unit_is_replaced_by_the_library() {
    let of = |text: &str, machine: &'static Machine| {
        let library = [("math.s", include_str!("../../programs/library/math.s"))];
        let loader = Search::new(MemoryLoader::of("test.s", text)).library(&library);
        takt_asm::assemble("test.s", &loader, &Options { machine, ..Options::default() })
    };
    let text = ".input y, x\n.output d\n.once\n wait p\n.period\np: d = atan2(y, x)\n wait p\n";
    for text in [text, &text.replace("d = atan2(y, x)", "fatan2 d, y, x")] {
        let report = of(text, &T1).expect_err("t1 has no arctangent").render(false);
        assert!(
            report.contains("with `.include <math.s>`, `atan2` in an equation is computed by other units"),
            "{report}"
        );
        of(text, &T3).unwrap_or_else(|report| panic!("{}", report.render(false)));
    }
    let with = format!(".include <math.s>\n{text}");
    let [small, fast] = [&T1, &T3].map(|machine| {
        let assembled = of(&with, machine).unwrap_or_else(|report| panic!("{}", report.render(false)));
        let mut emulator = Emulator::new(&assembled.program).expect("it fits");
        for (port, value) in assembled.program.inputs.iter().zip([1.5_f32, -0.75]) {
            emulator.set_input_bits(port.register, value.to_bits()).expect("it is an input");
        }
        (0..2).for_each(|_| drop(emulator.run_period(&[]).expect("it runs")));
        emulator
            .output_bits(assembled.program.outputs[0].register)
            .map(f32::from_bits)
            .expect("it is written")
    });
    assert!(small == 1.5_f32.atan2(-0.75) && (small - fast).abs() <= 2.4e-7, "{small} {fast}");
    let report =
        of(&with.replace("d = atan2(y, x)", "atan2 d, y, x"), &T3).expect_err("no macro").render(false);
    assert!(report.contains("did you mean `fatan2`?"), "{report}");
}
