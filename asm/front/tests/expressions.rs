// SPDX-License-Identifier: MIT OR Apache-2.0
//! CasADi's and SymPy's expressions compared with the values that both tools compute, and messages about wrong lists.
//!
//! `cargo xtask test` installs them; TAKT_VENV names another environment that has them.

use crate::common::assembled;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_emu::{Emulator, Number};
use takt_front::expressions::{FORMAT, OPERATIONS, REFUSED, read};
use takt_front::graph::{Delays, Function, Rewrites};
use takt_front::sink;

fn written() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let venv = std::env::var_os("TAKT_VENV").map_or_else(|| root.join("../../.venv"), PathBuf::from);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("expressions-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let done = Command::new(venv.join("bin/python3"))
        .arg(root.join("tests/expressions.py"))
        .arg(&folder)
        .output()
        .expect("no Python environment: `cargo xtask test` makes one");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    folder
}

#[test]
fn other_tools_agree() {
    let folder = written();
    let text = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a file");
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().expect("numbers").iter().map(|x| x.as_f64().expect("a number")).collect()
    };
    for name in ["every", "matrices", "mx", "symbols", "kin"] {
        for rewrites in [Rewrites::ALL, Rewrites::EXACT] {
            let function = read(&text(&format!("{name}.json")), rewrites).expect(name);
            let function = function.optimised(&Delays::of(&takt_isa::F3));
            for line in text(&format!("{name}.values")).lines() {
                let state: Value = serde_json::from_str(line).expect("JSON");
                let (computed, expected) =
                    (function.evaluate(&numbers(&state["inputs"])), numbers(&state["outputs"]));
                assert_eq!(computed.len(), expected.len(), "{name}");
                for ((port, _), (x, y)) in function.outputs.iter().zip(computed.iter().zip(&expected)) {
                    assert!(
                        (x - y).abs() <= 1e-12 * (1.0 + y.abs()),
                        "{name}: {}: {x} is not {y}",
                        port.name
                    );
                }
            }
        }
    }
    let names = |name: &str| -> Vec<String> {
        let function = read(&text(name), Rewrites::ALL).expect(name);
        let inputs = function.inputs.iter().chain(function.outputs.iter().map(|(port, _)| port));
        inputs.map(|port| port.name.clone()).collect()
    };
    assert_eq!(
        names("matrices.json")[..8],
        ["q_1_1", "q_2_1", "q_1_2", "q_2_2", "q_1_3", "q_2_3", "sparse_3_1", "sparse_1_2"]
    );
    assert_eq!(names("symbols.json")[..4], ["p_1", "p_2", "c", "y_1"]);
    let error = |name: &str| read(&text(name), Rewrites::ALL).err().expect("an error");
    assert_eq!(
        error("unknown.json").text,
        "operation `erfinv` is not supported; in `erfinv(0.5*sin(x))`: it has no macro; a polynomial over the range that is used can \
         take its place"
    );
    assert!(error("unknown.json").line.is_some_and(|line| line > 1));
    let notes = |name: &str| read(&text(name), Rewrites::ALL).expect(name).notes;
    assert_eq!(notes("impulse.json"), ["DiracDelta is 0: an impulse has no value at a point"]);
    assert_eq!(
        notes("kin.json"),
        [
            "`a` in Abs, im, re was taken to be real; a symbol with real=True says so to SymPy",
            "`b` in Abs, conjugate, im was taken to be real; a symbol with real=True says so to SymPy",
        ]
    );
    std::fs::remove_dir_all(folder).expect("removed");
}

/// A running program with one output.
struct RunningProgram(Emulator, Vec<String>);

impl RunningProgram {
    /// `None` if the output is a constant, which has no port.
    fn of(function: &Function) -> Option<RunningProgram> {
        if !sink::constants(function).is_empty() {
            return None;
        }
        let assembled = assembled(function);
        let inputs = assembled.program.inputs.iter().map(|port| port.name.clone()).collect();
        Some(RunningProgram(Emulator::new(&assembled.program).expect("it fits"), inputs))
    }

    fn run(&mut self, x: &[f64]) -> f64 {
        let RunningProgram(emulator, inputs) = self;
        let value = |name: &String| x[name[1..].parse::<usize>().expect("a number")] as f32;
        let values: Vec<(&str, Number)> =
            inputs.iter().map(|name| (name.as_str(), Number::Float(value(name)))).collect();
        emulator.run_period(&values).expect("a period");
        match emulator.output("y") {
            Ok(Some(Number::Float(value))) => f64::from(value),
            other => panic!("{other:?}"),
        }
    }
}

/// Every row of the table in binary32, compared with binary64 within the error of its operations.
#[test]
fn programs_compute_the_values_of_the_tables() {
    let operand = |place: usize| format!("{{\"op\": \"input\", \"to\": {place}, \"port\": [{place}, 0]}},\n");
    let port = |name: &str| format!("{{\"name\": \"{name}\", \"rows\": 1, \"columns\": 1}}");
    for operation in OPERATIONS {
        let (_, most) = operation.operands;
        let name = operation.names[0];
        let inputs: Vec<String> = (0..most).map(|i| port(&format!("x{i}"))).collect();
        let of: Vec<String> = (0..most).map(|i| i.to_string()).collect();
        let code: String = (0..most).map(operand).collect();
        let source = format!(
            "{{\"format\": \"{FORMAT}\", \"name\": \"f\", \"inputs\": [{}], \"outputs\": [{}], \"code\": [{code}{{\"op\": \"{name}\", \
             \"to\": 9, \"of\": [{}]}}, {{\"op\": \"output\", \"of\": [9], \"port\": [0, 0]}}]}}",
            inputs.join(", "),
            port("y"),
            of.join(", ")
        );
        let function = read(&source, Rewrites::EXACT).expect(name);
        let Some(mut program) = RunningProgram::of(&function) else { continue };
        // Operands between 0.05 and 0.95, above 1 and below 0, where the function has a value.
        for step in 0..400 {
            let x: Vec<f64> = (0..most)
                .map(|i| f64::from((-4.0 + 0.0201 * f64::from(step) + 1.7 * i as f64) as f32))
                .collect();
            let expected = function.evaluate(&x)[0];
            if !expected.is_finite() {
                continue;
            }
            let found = program.run(&x);
            let error = (found - expected).abs() / expected.abs().max(1.0);
            assert!(error < 2e-6, "{name} of {x:?}: {found}, not {expected}");
        }
    }
}

/// The table in the document is generated from the code's.
#[test]
fn the_document_lists_every_operation() {
    let mut table = String::from("| operation | becomes |\n|---|---|\n");
    for operation in OPERATIONS {
        let names: Vec<String> = operation.names.iter().map(|name| format!("`{name}`")).collect();
        table += &format!("| {} | {} |\n", names.join(" "), operation.becomes);
    }
    for (name, mend) in REFUSED {
        table += &format!("| `{name}` | refused: {mend} |\n");
    }
    crate::common::check_table("docs/readers.md", "expressions", &table);
}

#[test]
fn wrong_lists_are_refused() {
    let list = |inputs: &str, outputs: &str, code: &str| {
        let source = format!(
            "{{\"format\": \"{FORMAT}\", \"name\": \"f\", \"inputs\": [{inputs}],\n\"outputs\": [{outputs}],\n\"code\": [\n{code}\n]}}"
        );
        match read(&source, Rewrites::ALL) {
            Ok(_) => String::new(),
            Err(error) => format!("{}: {error}", error.line.unwrap_or(0)),
        }
    };
    let x = r#"{"name": "x", "rows": 1, "columns": 1}"#;
    let y = r#"{"name": "y", "rows": 1, "columns": 1}"#;
    let input = r#"{"op": "input", "to": 0, "port": [0, 0]}"#;
    assert_eq!(list(x, y, &format!("{input},\n{}", r#"{"op": "output", "of": [0], "port": [0, 0]}"#)), "");
    for (code, expected) in [
        (r#"{"op": "sin", "to": 1, "of": [7]}"#, "5: `sin` reads place 7, which nothing wrote"),
        (r#"{"op": "input", "to": 1, "port": [3, 0]}"#, "5: there is no input 3 with a scalar 0"),
        (r#"{"op": "input", "to": 1, "port": [0, 1]}"#, "5: there is no input 0 with a scalar 1"),
        (r#"{"op": "const", "to": 1}"#, "5: `const` has no `value`"),
        (r#"{"op": "sine", "to": 1, "of": [0]}"#, "5: operation `sine` is not supported; in `sine(x)`"),
        (r#"{"op": "add", "to": 1, "of": [0]}"#, "5: `add` has 1 operands; it takes 2"),
        (r#"{"op": "sin", "to": 1, "of": [0, 0]}"#, "5: `sin` has 2 operands; it takes 1"),
        (r#"{"op": "Heaviside", "to": 1, "of": []}"#, "5: `Heaviside` has 0 operands; it takes 1 to 2"),
        (
            r#"{"op": "sin", "to": -1, "of": [7]}"#,
            "5: this is not a list of instructions: invalid value: integer `-1`, expected usize",
        ),
    ] {
        assert_eq!(list(x, y, &format!("{input},\n{code}")), expected);
    }
    let large = r#"{"name": "x", "rows": 100000, "columns": 100000}"#;
    assert_eq!(list(large, y, ""), "0: `x`: 100000 by 100000 is more than 65536 scalars");
    assert_eq!(list(x, x, ""), "0: two inputs or outputs would be the port `x`: rename one");
    let outside = r#"{"name": "x", "rows": 1, "columns": 1, "nonzeros": [[1, 0]]}"#;
    assert_eq!(list(outside, y, ""), "0: `x`: (1, 0) lies outside 1 by 1");
    let error = read("{", Rewrites::ALL).err().expect("an error");
    assert!(error.line == Some(1) && error.text.starts_with("this is not a list of instructions"), "{error}");
}
