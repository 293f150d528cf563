// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every supported operator of ONNX on 10,000 inputs, the equivalent forms that exporters write, and 60 policies as exported by torch,
//! stable-baselines3, rsl_rl and skrl: compared with onnxruntime, through `operators.py`.
//!
//! `cargo xtask test` installs it; TAKT_VENV names another environment that has it.
#![allow(clippy::print_stdout)]

use crate::common::python;
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use takt_asm::{MemoryLoader, Options, Search};
use takt_emu::Emulator;
use takt_front::policy::{FUNCTIONS, Function, Network, OPERATORS, REFUSED, read, source};
use takt_isa::T3;

/// Folder with models, inputs and outputs, made once for all tests.
fn written() -> &'static (PathBuf, Vec<Value>) {
    static WRITTEN: std::sync::OnceLock<(PathBuf, Vec<Value>)> = std::sync::OnceLock::new();
    WRITTEN.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("operators-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let ranges: serde_json::Map<String, Value> = FUNCTIONS
            .iter()
            .map(|function| {
                (function.name.to_owned(), serde_json::json!([function.range.0, function.range.1]))
            })
            .collect();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/operators.py");
        let mut child = Command::new(python())
            .arg(script)
            .arg(&folder)
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("no Python environment: `cargo xtask test` makes one");
        let text = Value::Object(ranges).to_string();
        child.stdin.take().expect("its input").write_all(text.as_bytes()).expect("written");
        let done = child.wait_with_output().expect("it ends");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let index = std::fs::read_to_string(folder.join("index.json")).expect("the index");
        let index: Value = serde_json::from_str(&index).expect("JSON");
        (folder, index.as_array().expect("a list").clone())
    })
}

struct Case {
    kind: String,
    name: String,
    network: Network,
    inputs: Vec<Vec<f64>>,
    outputs: Vec<Vec<f64>>,
}

fn numbers(path: &Path, width: usize) -> Vec<Vec<f64>> {
    let bytes = std::fs::read(path).expect("numbers");
    let numbers = bytes.as_chunks::<4>().0.iter().map(|word| f64::from(f32::from_le_bytes(*word)));
    numbers.collect::<Vec<_>>().chunks(width).map(<[f64]>::to_vec).collect()
}

fn cases(kind: &str) -> Vec<Case> {
    let (folder, index) = written();
    let of_kind = index.iter().filter(|entry| entry["kind"] == kind);
    of_kind
        .map(|entry| {
            let text = |key: &str| entry[key].as_str().expect("text").to_owned();
            let width = |key: &str| entry[key].as_u64().expect("a number") as usize;
            let path = |ending: &str| folder.join(format!("{}.{ending}", text("file")));
            let bytes = std::fs::read(path("onnx")).expect("a model");
            let network = read(&bytes, &text("name"), None, &|_, _, _| Err(String::new()));
            let network = network.unwrap_or_else(|error| panic!("{}: {error}", text("name")));
            Case {
                kind: text("kind"),
                name: text("name"),
                network,
                inputs: numbers(&path("in"), width("ins")),
                outputs: numbers(&path("out"), width("outs")),
            }
        })
        .collect()
}

/// Outputs of the program for each input.
fn run(network: &Network, inputs: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let source =
        source(network, &T3, None, 16_384).unwrap_or_else(|error| panic!("{}: {error}", network.name));
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let options = Options { machine: source.machine, effort: 0, ..Options::default() };
    let assembled = takt_asm::assemble_bytes("policy.s", source.text.clone().into_bytes(), &loader, &options);
    let assembled = assembled
        .unwrap_or_else(|errors| panic!("{}: {}\n{}", network.name, errors.render(false), source.text));
    assert!(assembled.warnings.is_empty(), "{}", assembled.warnings.render(false));
    let program = &assembled.program;
    let register = |ports: &[takt_isa::program::Port], name: &str, length: usize| -> Vec<_> {
        let port = |index: usize| {
            let name = format!("{name}[{index}]");
            ports.iter().find(|port| port.name == name).unwrap_or_else(|| panic!("no port {name}")).register
        };
        (1..=length).map(port).collect()
    };
    let ins = register(&program.inputs, &source.input, network.input.length);
    let outs = register(&program.outputs, &source.output, network.output.length);
    let mut emulator = Emulator::new(program).expect("it fits");
    let mut results = Vec::new();
    for input in inputs {
        for (register, x) in ins.iter().zip(input) {
            emulator.set_input_bits(*register, (*x as f32).to_bits()).expect("an input");
        }
        emulator.run_period(&[]).expect("a period");
        let word = |register| f64::from(f32::from_bits(emulator.register(register).expect("a value")));
        results.push(outs.iter().map(|register| word(*register)).collect());
    }
    results
}

/// Largest distance in ulps of the larger of the result and 1, with its place.
fn ulps(found: &[Vec<f64>], expected: &[Vec<f64>]) -> (f64, usize, usize) {
    let mut worst = (0.0, 0, 0);
    for (row, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert_eq!(found.len(), expected.len());
        for (column, (x, y)) in found.iter().zip(expected).enumerate() {
            let size = x.abs().max(y.abs()).max(1.0);
            let ulp = 2_f64.powi(size.log2().floor() as i32 - 23);
            let error = if x == y { 0.0 } else { (x - y).abs() / ulp };
            if error > worst.0 || error.is_nan() {
                worst = (error, row, column);
            }
        }
    }
    worst
}

#[test]
fn every_operator_agrees_with_onnxruntime() {
    let cases = cases("operator");
    for function in FUNCTIONS {
        assert!(cases.iter().any(|case| case.name == function.name), "{} is not compared", function.name);
    }
    let mut wrong = Vec::new();
    for Case { name, network, inputs, outputs, .. } in cases {
        let stated = FUNCTIONS.iter().find(|function| function.name == name).expect("a row").error;
        for exact in [false, true] {
            let network = network.clone().merged(exact);
            let found = run(&network, &inputs);
            let (error, row, column) = ulps(&found, &outputs);
            let figures = format!(
                "{name}, exact {exact}: {error:.3} ulps of {stated} at {:?}: {} for {}",
                inputs[row].iter().skip(column).step_by(outputs[0].len()).collect::<Vec<_>>(),
                found[row][column],
                outputs[row][column]
            );
            println!("{figures}");
            if error.is_nan() || error > stated {
                wrong.push(figures);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

fn agree(kind: &str, count: usize, ways: &[bool]) {
    let cases = cases(kind);
    assert_eq!(cases.len(), count);
    let mut wrong = Vec::new();
    for Case { kind, name, network, inputs, outputs } in cases {
        for &exact in ways {
            let network = network.clone().merged(exact);
            let evaluated: Vec<Vec<f64>> = inputs.iter().map(|input| network.evaluate(input)).collect();
            let found = run(&network, &inputs);
            let size = outputs.iter().flatten().fold(1.0, |most: f64, value| most.max(value.abs()));
            let distance = |found: &[Vec<f64>]| {
                let pairs = found.iter().flatten().zip(outputs.iter().flatten());
                pairs.fold(0.0, |most: f64, (x, y)| most.max((x - y).abs() / size))
            };
            let (in_binary64, error) = (distance(&evaluated), distance(&found));
            let figures = format!(
                "{kind} {name} {}, exact {exact}: {error:.2e}, in binary64 {in_binary64:.2e}",
                network.shape()
            );
            println!("{figures}");
            if error.is_nan() || error > 4e-6 || in_binary64 > 2e-6 {
                wrong.push(figures);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn forms_of_exporters_agree_with_onnxruntime() {
    agree("form", 35, &[false, true]);
}

#[test]
fn policies_of_four_libraries_agree_with_onnxruntime() {
    agree("policy", 60, &[false]);
}

/// The table in the document is generated from the code's.
#[test]
fn the_document_lists_every_operator() {
    let mut table = String::from("| operator | treatment, or error in ulps |\n|---|---|\n");
    for operator in OPERATORS {
        let names: Vec<String> = operator.names.iter().map(|name| format!("`{name}`")).collect();
        table += &format!("| {} | {} |\n", names.join(" "), operator.treatment);
    }
    for Function { name, parameters, error, range: (low, high), .. } in FUNCTIONS {
        let (name, form) =
            name.split_once(' ').map_or((*name, ""), |(name, _)| (name, ", `approximate` is `tanh`"));
        let parameters: Vec<String> = parameters.iter().map(|(name, _)| format!("`{name}`")).collect();
        let parameters = if parameters.is_empty() {
            String::new()
        } else {
            format!(", with {}", parameters.join(" and "))
        };
        table += &format!("| `{name}`{form}{parameters} | {error} from {low} to {high} |\n");
    }
    for (name, reason) in REFUSED {
        table += &format!("| `{name}` | refused: {reason} |\n");
    }
    crate::common::check_table("docs/readers.md", "onnx", &table);
}
