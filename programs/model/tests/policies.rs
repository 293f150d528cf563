// SPDX-License-Identifier: MIT OR Apache-2.0
//! Policies in ONNX against what onnxruntime computed of them, and what is said of files that are refused. `policies.py` writes both.

use serde_json::Value;
use std::path::{Path, PathBuf};
use takt_asm::{MemoryLoader, Options, Search};
use takt_emu::{Emulator, Number};
use takt_isa::{Machine, T3, T4};
use takt_model::policy::{Network, Step, read, source};

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/policies").join(name)
}

fn network(name: &str) -> Result<Network, String> {
    let bytes = std::fs::read(path(&format!("{name}.onnx"))).expect("the file");
    read(&bytes, name).map_err(|error| error.to_string())
}

struct Case {
    name: String,
    /// Inputs, and the outputs of onnxruntime, in binary32.
    states: Vec<(Vec<f64>, Vec<f64>)>,
}

fn cases() -> Vec<Case> {
    let text = std::fs::read_to_string(path("policies.json")).expect("the file");
    let table: Value = serde_json::from_str(&text).expect("JSON");
    let rows = |value: &Value| -> Vec<Vec<f64>> {
        let rows = value.as_array().expect("rows").iter();
        rows.map(crate::common::numbers).collect()
    };
    let policies = table["policies"].as_array().expect("a list").iter();
    policies
        .map(|policy| Case {
            name: policy["name"].as_str().expect("a name").to_owned(),
            states: rows(&policy["inputs"]).into_iter().zip(rows(&policy["outputs"])).collect(),
        })
        .collect()
}

/// The largest distance, relative to the largest output if that is above 1.
fn distance(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
    found.iter().zip(expected).map(|(a, b)| (a - b).abs() / scale).fold(0.0, f64::max)
}

/// Outputs for each input, and the cycles of a period, which are the same each time.
fn run(network: &Network, machine: &'static Machine, inputs: &[&[f64]]) -> (Vec<Vec<f64>>, u64) {
    let source = source(network, machine, Some((-2.0, 2.0)), 4096).expect("a source");
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let options = Options { machine: source.machine, ..Options::default() };
    let assembled = takt_asm::assemble_bytes("policy.s", source.text.clone().into_bytes(), &loader, &options);
    let assembled = assembled.unwrap_or_else(|errors| panic!("{}: {}", network.name, errors.render(false)));
    assert!(assembled.warnings.is_empty(), "{}", assembled.warnings.render(false));
    let bound = takt_analysis::bound(&assembled.program).expect("a bound").worst_period();
    let mut emulator = Emulator::new(&assembled.program).expect("it fits");
    let mut outputs = Vec::new();
    for input in inputs {
        let ports: Vec<String> = (1..=input.len()).map(|i| format!("{}[{i}]", source.input)).collect();
        let values: Vec<(&str, Number)> =
            ports.iter().zip(*input).map(|(port, x)| (port.as_str(), Number::Float(*x as f32))).collect();
        let report = emulator.run_period(&values).expect("a period");
        assert!(Some(report.cycles) <= bound, "{} cycles, the bound is {bound:?}", report.cycles);
        let output = (1..=network.output.length).map(|i| {
            let port = format!("{}[{i}]", source.output);
            match emulator.output(&port) {
                Ok(Some(Number::Float(value))) => f64::from(value),
                other => panic!("{port}: {other:?}"),
            }
        });
        outputs.push(output.collect());
    }
    (outputs, bound.expect("a period"))
}

#[test]
fn programs_compute_what_onnxruntime_does() {
    for Case { name, states } in cases() {
        let network = network(&name).expect("a policy");
        for exact in [true, false] {
            let network = network.clone().merged(exact);
            let inputs: Vec<&[f64]> = states.iter().map(|(input, _)| &input[..]).collect();
            for (input, expected) in &states {
                let error = distance(&network.evaluate(input), expected);
                assert!(error < 5e-7, "{name}, exact {exact}: {error:e} in binary64");
            }
            // The scheduler takes long, above all for t1, and the arithmetic of the source is the same.
            let machines: &[&'static Machine] = match (name.as_str(), exact) {
                ("tanh", false) => &[&T3, &T4],
                ("relu", true) => &[],
                _ => &[&T3],
            };
            for machine in machines {
                let (found, _) = run(&network, machine, &inputs);
                for (found, (_, expected)) in found.iter().zip(&states) {
                    let error = distance(found, expected);
                    assert!(error < 1e-6, "{name} on {}, exact {exact}: {error:e}", machine.name);
                }
            }
        }
    }
}

#[test]
fn normalisation_becomes_part_of_layers() {
    let kinds = |network: Network| -> String {
        let kind = |step: &Step| match step {
            Step::Dense { .. } => "W",
            Step::Add(_) => "+",
            Step::Multiply(_) => "*",
            Step::Divide(_) => "/",
            Step::Activation(_) => "f",
        };
        network.steps.iter().map(kind).collect()
    };
    for (name, as_it_is, exact, merged) in [
        ("relu", "WfWfW", "WfWfW", "WfWfW"),
        ("tanh", "+/W+fWf*+", "+/WfWf*+", "+WfWf*+"),
        ("elu", "*+W+fWfW*+", "*+WfWfW*+", "+WfWfW"),
        ("sigmoid", "+WfWff", "+WfWff", "+WfWff"),
    ] {
        let network = network(name).expect("a policy");
        assert_eq!(kinds(network.clone()), as_it_is, "{name}");
        assert_eq!(kinds(network.clone().merged(true)), exact, "{name}");
        assert_eq!(kinds(network.merged(false)), merged, "{name}");
    }
}

#[test]
fn what_is_no_chain_of_layers_is_refused_by_name() {
    for (name, expected) in [
        ("conv", "node `/Conv_1` (Conv): this operator is not read; Gemm, MatMul,"),
        (
            "branch",
            "node `/Add_2` (Add): it joins two computed values; a chain of layers is read, without branches",
        ),
        ("fork", "node `/Tanh_2` (Tanh): what it reads is also read by a node before it;"),
        ("outputs", "a policy with one input and one output is read; this has 2 outputs (`action`, `v1`)."),
        ("inputs", "a policy with one input and one output is read; this has 2 inputs (`obs`, `task`)."),
        ("width", "node `/MatMul_0` (MatMul): its weights are those of 9 numbers, and the vector has 8"),
        ("quotient", "node `/Div_1` (Div): it divides by what is computed; constants divide"),
        ("zero", "node `/Div_0` (Div): it divides by zero"),
        ("bias", "node `/Gemm_0` (Gemm): its bias has shape [4], and it has 3 results"),
        ("none", "it has no layer of weights (Gemm, MatMul)"),
        ("shape", "input `obs`: its shape is [3, 4, 8]; a vector [n], or [1, n], is read"),
        ("external", "`c0`: its numbers lie in another file;"),
        ("half", "`half`: its numbers are float16; float and double are read"),
        ("nan", "`c0`: one of its numbers is NaN"),
    ] {
        let error = network(&format!("bad_{name}")).expect_err(name);
        assert!(error.starts_with(expected), "{name}: {error}");
    }
    for bytes in [
        &b"not a model"[..],
        b"\x08",
        b"",
        &[0x3a, 0x00],
        &std::fs::read(path("relu.onnx")).expect("the file")[..5000],
    ] {
        let error = read(bytes, "x").expect_err("no model").to_string();
        assert!(error.starts_with("this is no model of ONNX: "), "{error}");
    }
    let wide = network("bad_wide").expect("a policy");
    let error = source(&wide, &T3, None, 0).err().expect("40 outputs");
    assert_eq!(error.to_string(), "it does not fit: `action` has 40 numbers, t3 has 32 output ports");
}
