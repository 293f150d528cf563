// SPDX-License-Identifier: MIT OR Apache-2.0
//! Policies in ONNX compared with onnxruntime, and messages about refused files. `policies.py` writes both.

use serde_json::Value;
use std::path::{Path, PathBuf};
use takt_asm::{MemoryLoader, Options, Search};
use takt_emu::{Emulator, Number};
use takt_front::policy::{Network, Operand, Step, external_data, read, source};
use takt_isa::{Machine, T3, T4};

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/policies").join(name)
}

fn network(name: &str) -> Result<Network, String> {
    let bytes = std::fs::read(path(&format!("{name}.onnx"))).expect("the file");
    read(&bytes, name, None, &beside_data).map_err(|error| error.to_string())
}

/// Bytes of a file beside the models.
fn beside_data(name: &str, offset: u64, length: usize) -> Result<Vec<u8>, String> {
    external_data(&path(""), name, offset, length)
}

struct Case {
    name: String,
    /// Inputs, and onnxruntime's outputs, in binary32.
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

/// Largest distance, relative to the largest output if that is above 1.
fn distance(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
    found.iter().zip(expected).map(|(a, b)| (a - b).abs() / scale).fold(0.0, f64::max)
}

/// Outputs for each input, and the cycles of a period, which are constant.
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
fn programs_agree_with_onnxruntime() {
    for Case { name, states } in cases() {
        let network = network(&name).expect("a policy");
        for exact in [true, false] {
            let network = network.clone().merged(exact);
            let inputs: Vec<&[f64]> = states.iter().map(|(input, _)| &input[..]).collect();
            for (input, expected) in &states {
                let error = distance(&network.evaluate(input), expected);
                assert!(error < 5e-7, "{name}, exact {exact}: {error:e} in binary64");
            }
            // Scheduling takes long, above all for t1, and the arithmetic of the source is the same.
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
            Step::Each { function, operands, .. } => match (function.name, &operands[..]) {
                ("Add", _) => "+",
                ("Sub", [Operand::Numbers(_), _]) => "~",
                ("Sub", _) => "-",
                ("Mul", _) => "*",
                ("Div", _) => "/",
                _ => "f",
            },
            Step::Input | Step::Reduce { .. } | Step::Gather(_) => "",
        };
        let used = network.uses();
        network.steps.iter().zip(used).filter(|(_, uses)| *uses > 0).map(|(step, _)| kind(step)).collect()
    };
    for (name, as_it_is, exact, merged) in [
        ("relu", "W+fW+fW+", "WfWfW", "WfWfW"),
        ("tanh", "-/W+fW+f*+", "-/WfWf*+", "-WfWf*+"),
        ("elu", "*+W+fWfW~", "*+WfWfW", "+WfWfW"),
        ("sigmoid", "-W+fW+ff", "-WfWff", "-WfWff"),
    ] {
        let network = network(name).expect("a policy");
        assert_eq!(kinds(network.clone()), as_it_is, "{name}");
        assert_eq!(kinds(network.clone().merged(true)), exact, "{name}");
        assert_eq!(kinds(network.merged(false)), merged, "{name}");
    }
}

#[test]
fn rejects_unsupported_operators_by_name() {
    const RECURRENT: &str =
        "this operator is not supported: a recurrent layer keeps a state from period to period";
    for (name, expected) in [
        (
            "conv",
            "node `/Conv_1` (Conv): this operator is not supported: convolutions and pooling are not read",
        ),
        ("lstm", &format!("node `/LSTM_0` (LSTM): {RECURRENT}")),
        ("gru", &format!("node `/GRU_0` (GRU): {RECURRENT}")),
        ("index", "node `/ArgMax_1` (ArgMax): this operator is not supported: its results are indices"),
        (
            "random",
            "node `/RandomNormalLike_1` (RandomNormalLike): this operator is not supported: it draws at random",
        ),
        (
            "unknown",
            "node `/Gizmo_1` (Gizmo): this operator is not supported; docs/readers.md lists the supported ones",
        ),
        (
            "product",
            "node `/MatMul_1` (MatMul): both of its factors are computed, but a layer needs a constant matrix",
        ),
        (
            "outputs",
            "expected one output that depends on the input, found 2 (`action`, `v1`): name one of them",
        ),
        ("inputs", "expected one input, but output `action` depends on 2 (`obs`, `task`)."),
        ("width", "node `/MatMul_0` (MatMul): its weights expect 9 numbers, and the vector has 8"),
        ("zero", "node `/Div_0` (Div): it divides by zero"),
        ("bias", "node `/Gemm_0` (Gemm): its operands have the shapes [1, 3] and [4], which do not fit"),
        ("shape", "input `obs`: its shape is [3, 4, 8]; expected a vector [n], or a batch of one [1, n]"),
        (
            "integers",
            "node `/Cast_1` (Cast): it converts computed values to int64; only floats are supported",
        ),
        ("words", "node `/Mul_0` (Mul): its constant `words`: its elements are string; expected numbers"),
        (
            "external",
            "node `/Gemm_0` (Gemm): its constant `c0`: its numbers are in another file, whose name is missing",
        ),
        (
            "missing",
            "node `/Gemm_0` (Gemm): its constant `c0`: `nowhere.bin`, in which its numbers lie, is not beside",
        ),
        (
            "outside",
            "node `/Gemm_0` (Gemm): its constant `c0`: its numbers lie in `../beside.onnx.data`; the file must be in the folder of the",
        ),
        (
            "absolute",
            "node `/Gemm_0` (Gemm): its constant `c0`: its numbers lie in `/etc/passwd`; the file must be in the folder",
        ),
        (
            "inner",
            "node `/Gemm_0` (Gemm): its constant `c0`: its numbers lie in `a/../../b.bin`; the file must be in the folder",
        ),
        (
            "short",
            "node `/Gemm_0` (Gemm): its constant `c0`: `beside.onnx.data` has 7696 bytes, and its numbers are those from 7650 to 7746",
        ),
        (
            "length",
            "node `/Gemm_0` (Gemm): its constant `c0`: its numbers need 96 bytes, but 20 are given for them",
        ),
        (
            "offset",
            "node `/Gemm_0` (Gemm): its constant `c0`: `offset` of its numbers in `beside.onnx.data` is not a number",
        ),
        ("nan", "node `/MatMul_0` (MatMul): one of its constants is NaN; constants must be finite"),
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
        let error = read(bytes, "x", None, &beside_data).expect_err("no model").to_string();
        assert!(error.starts_with("this is not an ONNX model: "), "{error}");
    }
    let wide = network("bad_wide").expect("a policy");
    let error = source(&wide, &T3, None, 0).err().expect("40 outputs");
    assert_eq!(error.to_string(), "it does not fit: `action` has 40 numbers, t3 has 32 output ports");
}

#[test]
fn weights_may_be_in_external_files() {
    let x: Vec<f64> = (0..20).map(|i| f64::from(i) / 20.0 - 0.5).collect();
    let whole = network("relu").expect("a policy").evaluate(&x);
    for name in ["beside", "apart"] {
        assert_eq!(network(name).expect(name).evaluate(&x), whole, "{name}");
    }
}

#[cfg(unix)]
#[test]
fn a_link_does_not_leave_the_folder_of_the_model() {
    let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("links-{}", std::process::id()));
    let folder = root.join("model");
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(root.join("secret"), b"12345678").expect("written");
    std::fs::write(folder.join("data"), b"12345678").expect("written");
    std::os::unix::fs::symlink("../secret", folder.join("link")).expect("a link");
    assert_eq!(external_data(&folder, "data", 2, 4), Ok(b"3456".to_vec()));
    let error = external_data(&folder, "link", 0, 4).expect_err("it leaves");
    assert_eq!(error, "`link` is a link that leaves the folder of the model");
    assert!(
        external_data(&folder, "data", u64::MAX, 4).expect_err("too far").starts_with("`data` has 8 bytes")
    );
    assert!(external_data(&folder, "model", 0, 4).is_err());
    std::fs::remove_dir_all(root).expect("removed");
}

#[test]
fn selects_an_output_by_name() {
    let bytes = std::fs::read(path("bad_outputs.onnx")).expect("the file");
    let read = |name| read(&bytes, "x", Some(name), &beside_data);
    let hidden = read("v1").expect("a policy");
    assert_eq!((hidden.output.name.as_str(), hidden.output.length), ("v1", 8));
    assert_eq!(hidden.notes, ["written by policies.py", "passed over: output `action`"]);
    assert_eq!(read("action").expect("a policy").shape(), "8-8-3");
    let error = read("std").expect_err("no such output").to_string();
    assert_eq!(error, "it has no output `std`; its outputs are `action`, `v1`");
}
