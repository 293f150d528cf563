// SPDX-License-Identifier: MIT OR Apache-2.0
//! Programs in C through `takt cc` and the emulator, and the same through gcc: outputs of every period, bit for bit.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use takt_asm::{MemoryLoader, Options as Assembling, Search};
use takt_emu::{Emulator, Number};
use takt_front::c::{Options, Preprocessor, Source, Translation, translate};
use takt_isa::{Machine, T1, T3, T4};

/// A program in C.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    /// Prefix of all names: programs of one call of gcc share a file.
    pub(crate) name: String,
    pub(crate) code: String,
    pub(crate) step: String,
    pub(crate) init: Option<String>,
    pub(crate) set: Vec<(String, Vec<f64>)>,
    pub(crate) ignore: Vec<String>,
    pub(crate) loop_bound: Option<u64>,
    pub(crate) double_is_float: bool,
}

impl Program {
    pub(crate) fn new(name: &str, code: &str) -> Program {
        Program {
            name: name.to_owned(),
            code: code.to_owned(),
            step: "step".to_owned(),
            init: code.contains("void init(").then(|| "init".to_owned()),
            set: Vec::new(),
            ignore: Vec::new(),
            loop_bound: None,
            double_is_float: code.contains("double"),
        }
    }
}

/// A folder of a test's own.
pub(crate) fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("c-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

/// Translates a program; the error is the message.
pub(crate) fn translated(program: &Program, folder: &Path) -> Result<Translation, String> {
    let path = folder.join(format!("{}.c", program.name));
    std::fs::write(&path, &program.code).expect("written");
    let define = program.double_is_float.then(|| "-DTAKT_DOUBLE_IS_FLOAT=1".to_owned());
    let preprocessor = Preprocessor::new(&define.into_iter().collect::<Vec<_>>()).expect("a folder");
    translated_text(program, preprocessor.run(&path).map_err(|error| error.to_string())?)
}

/// Translates a program, and compares it on t1, t3 and t4 with gcc's, bit for bit in all periods. `inputs` makes their rows.
pub(crate) fn matches_gcc(
    program: &Program,
    inputs: impl FnOnce(&Translation) -> Vec<Vec<u32>>,
) -> Translation {
    let folder = folder(&program.name);
    let translation =
        translated(program, &folder).unwrap_or_else(|error| panic!("{}: {error}", program.name));
    assert!(!translation.outputs.is_empty(), "{} has no outputs\n{}", program.name, translation.text);
    let inputs = inputs(&translation);
    let expected = compiled(&[(program, &translation, &inputs)], &folder).remove(0);
    for machine in [&T1, &T3, &T4] {
        let found = emulated(program, &translation, machine, &inputs);
        if let Some(text) = difference(program, &translation, &inputs, &expected, &found) {
            panic!("{}: {text}", machine.name);
        }
    }
    let _ = std::fs::remove_dir_all(folder);
    translation
}

/// Translates preprocessed text.
pub(crate) fn translated_text(program: &Program, source: Source) -> Result<Translation, String> {
    let options = Options {
        step: program.step.clone(),
        init: program.init.clone(),
        set: program.set.clone(),
        ignore: program.ignore.clone(),
        loop_bound: program.loop_bound,
        double_is_float: program.double_is_float,
    };
    translate(&[source], &options).map_err(|error| {
        let file = error.file.clone().unwrap_or_default();
        error.located_text(&file)
    })
}

/// The program for a machine, or the assembler's messages.
pub(crate) fn assembled(
    translation: &Translation,
    machine: &'static Machine,
) -> Result<takt_asm::AssembledProgram, String> {
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let machine = machine.holding(16_384, 8_192).expect("memories");
    let options = Assembling { machine, effort: 0, ..Assembling::default() };
    let text = translation.text.clone().into_bytes();
    let assembled = takt_asm::assemble_bytes("c.s", text, &loader, &options);
    assembled.map_err(|errors| errors.render(false))
}

/// Words of all outputs in every period.
pub(crate) fn emulated(
    program: &Program,
    translation: &Translation,
    machine: &'static Machine,
    inputs: &[Vec<u32>],
) -> Vec<Vec<u32>> {
    run(translation, machine, inputs).unwrap_or_else(|error| {
        panic!("{} on {}: {error}\n{}\n{}", program.name, machine.name, translation.text, program.code)
    })
}

/// The same, or the reason why the source is not assembled or does not run to its end.
pub(crate) fn run(
    translation: &Translation,
    machine: &'static Machine,
    inputs: &[Vec<u32>],
) -> Result<Vec<Vec<u32>>, String> {
    let assembled = assembled(translation, machine)?;
    let mut emulator = Emulator::new(&assembled.program).expect("it fits");
    let mut rows = Vec::new();
    for row in inputs {
        let set: Vec<(&str, Number)> = translation
            .inputs
            .iter()
            .zip(row)
            .map(|(port, word)| (port.name.as_str(), Number::Bits(*word)))
            .collect();
        emulator.run_period(&set).map_err(|error| format!("{error:?}"))?;
        let word = |port: &takt_front::c::Port| {
            let port = emulator.output_port(&port.name).unwrap_or_else(|| panic!("no port {}", port.name));
            emulator.output_bits(port.register).ok_or("an output that nothing writes")
        };
        rows.push(translation.outputs.iter().map(word).collect::<Result<Vec<u32>, &str>>()?);
    }
    Ok(rows)
}

/// The signature's parameters: type, name and elements.
fn parameters(code: &str, step: &str) -> (String, Vec<(String, String, Option<usize>)>) {
    let begins = |at: &usize| !code[..*at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let call = format!("{step}(");
    let mut places = code.match_indices(call.as_str()).map(|(at, _)| at);
    let at = places.find(begins).unwrap_or_else(|| panic!("no {step} in {code}"));
    let line = code[..at].rfind(['\n', '}', ';']).map_or(0, |at| at + 1);
    let result = code[line..at].trim().trim_start_matches("static ").to_owned();
    let list = &code[at + step.len() + 1..];
    let list = &list[..list.find(')').expect("a parenthesis")];
    let mut found = Vec::new();
    for parameter in list.split(',').map(str::trim).filter(|text| !text.is_empty() && *text != "void") {
        let (plain, elements) = match parameter.split_once('[') {
            Some((plain, size)) => (plain, Some(size.trim_end_matches(']').trim().parse().unwrap_or(64))),
            None => (parameter, None),
        };
        let name_at = plain.rfind(|c: char| !c.is_alphanumeric() && c != '_').map_or(0, |at| at + 1);
        let (ty, name) = plain.split_at(name_at);
        let (ty, name) = (ty.trim().trim_start_matches("const "), name.trim().to_owned());
        match ty.strip_suffix('*') {
            Some(to) => found.push((to.trim().to_owned(), name, Some(64))),
            None => found.push((ty.to_owned(), name, elements)),
        }
    }
    (result, found)
}

/// The C that runs a program's periods: reads words, calls the step, writes words.
fn driver(program: &Program, translation: &Translation, periods: usize) -> String {
    let Program { name, step, .. } = program;
    let mut text = String::new();
    let (result, parameters) = parameters(&program.code, step);
    let _ = writeln!(text, "static void drive_{name}(void) {{");
    for (ty, name, elements) in &parameters {
        match elements {
            Some(count) => {
                let _ = writeln!(text, "  static {ty} {name}_[{count}]; {ty} *{name} = {name}_;");
            }
            None => {
                let _ = writeln!(text, "  static {ty} {name};");
            }
        }
    }
    let result = if result == "void" { String::new() } else { result };
    if !result.is_empty() {
        let _ = writeln!(text, "  {result} result_;");
    }
    if let Some(init) = &program.init {
        let (_, own) = self::parameters(&program.code, init);
        let arguments: Vec<&str> = own.iter().map(|(_, name, _)| name.as_str()).collect();
        let _ = writeln!(text, "  {init}({});", arguments.join(", "));
    }
    let _ = writeln!(text, "  for (int k_ = 0; k_ < {periods}; k_++) {{");
    for port in &translation.inputs {
        let ty = if port.float { "float" } else { "int" };
        let _ = writeln!(text, "    {{ {ty} w_; get_(&w_); {} = w_; }}", port.c);
    }
    let arguments: Vec<&str> = parameters.iter().map(|(_, name, _)| name.as_str()).collect();
    let assigned = if result.is_empty() { "" } else { "result_ = " };
    let _ = writeln!(text, "    {assigned}{step}({});", arguments.join(", "));
    for port in &translation.outputs {
        let c = match port.c.strip_prefix(step.as_str()) {
            Some(rest) if rest.is_empty() || rest.starts_with(['.', '[']) => format!("result_{rest}"),
            _ => port.c.clone(),
        };
        let ty = if port.float { "float" } else { "int" };
        let _ = writeln!(text, "    {{ {ty} w_ = {c}; put_(&w_); }}");
    }
    text + "  }\n}\n"
}

/// Options of the oracle.
pub(crate) const GCC: [&str; 7] = [
    "-O0",
    "-fwrapv",
    "-ffp-contract=off",
    "-frounding-math",
    "-std=c99",
    "-fsingle-precision-constant",
    "-w",
];

/// Outputs of several programs by gcc, in one compilation.
pub(crate) fn compiled(
    programs: &[(&Program, &Translation, &[Vec<u32>])],
    folder: &Path,
) -> Vec<Vec<Vec<u32>>> {
    let mut text = "#define _GNU_SOURCE\n#include <stdio.h>\n#include <stdlib.h>\n#include <string.h>\n#include <stdint.h>\n#include <math.h>\n".to_owned();
    text.push_str("static void get_(void *w) { if (fread(w, 4, 1, stdin) != 1) exit(3); }\n");
    text.push_str("static void put_(void *w) { fwrite(w, 4, 1, stdout); }\n");
    if programs.iter().any(|(program, ..)| program.double_is_float) {
        // Projects in single precision build with these macros.
        text.push_str("#define double float\n");
        for name in ["sqrt", "fabs", "floor", "ceil", "trunc", "round", "fmod", "fmin", "fmax", "copysign"] {
            let _ = writeln!(text, "#define {name} {name}f");
        }
    }
    for (program, translation, inputs) in programs {
        text.push_str(&program.code);
        text.push_str(&driver(program, translation, inputs.len()));
    }
    text.push_str("int main(void) {\n");
    for (program, ..) in programs {
        let _ = writeln!(text, "  drive_{}();", program.name);
    }
    text.push_str("  return 0;\n}\n");
    let (file, binary) = (folder.join("driver.c"), folder.join("driver"));
    std::fs::write(&file, &text).expect("written");
    let done =
        Command::new("gcc").args(GCC).arg(&file).arg("-o").arg(&binary).arg("-lm").output().expect("gcc");
    assert!(done.status.success(), "{}\n{text}", String::from_utf8_lossy(&done.stderr));
    let mut child =
        Command::new(&binary).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("the program");
    let words: Vec<u8> = programs
        .iter()
        .flat_map(|(_, _, inputs)| inputs.iter().flatten().flat_map(|word| word.to_le_bytes()))
        .collect();
    let mut input = child.stdin.take().expect("piped");
    let writer = std::thread::spawn(move || {
        let _ = input.write_all(&words);
    });
    let done = child.wait_with_output().expect("it ends");
    writer.join().expect("no panic");
    assert!(done.status.success(), "the driver fails: {:?}\n{text}", done.status);
    let mut words = done.stdout.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word));
    programs
        .iter()
        .map(|(_, translation, inputs)| {
            let row = |_: &Vec<u32>| {
                translation.outputs.iter().map(|_| words.next().expect("a word")).collect::<Vec<_>>()
            };
            inputs.iter().map(row).collect()
        })
        .collect()
}

/// The same bits, or both NaNs of a float.
pub(crate) fn same(float: bool, a: u32, b: u32) -> bool {
    a == b || float && f32::from_bits(a).is_nan() && f32::from_bits(b).is_nan()
}

/// Compares a program's outputs; the error shows the first difference.
pub(crate) fn difference(
    program: &Program,
    translation: &Translation,
    inputs: &[Vec<u32>],
    expected: &[Vec<u32>],
    found: &[Vec<u32>],
) -> Option<String> {
    for (period, (expected, found)) in expected.iter().zip(found).enumerate() {
        for ((port, expected), found) in translation.outputs.iter().zip(expected).zip(found) {
            if !same(port.float, *expected, *found) {
                let shown = |word: u32| match port.float {
                    true => format!("{} ({word:#x})", f32::from_bits(word)),
                    false => format!("{} ({word:#x})", word as i32),
                };
                let row: Vec<String> = translation
                    .inputs
                    .iter()
                    .zip(&inputs[period])
                    .map(|(port, word)| match port.float {
                        true => format!("{} = {}", port.name, f32::from_bits(*word)),
                        false => format!("{} = {}", port.name, *word as i32),
                    })
                    .collect();
                return Some(format!(
                    "{}, period {period}, {}: gcc {}, takt {}; {}\n{}\n{}",
                    program.name,
                    port.name,
                    shown(*expected),
                    shown(*found),
                    row.join(", "),
                    program.code,
                    translation.text
                ));
            }
        }
    }
    None
}
