// SPDX-License-Identifier: MIT OR Apache-2.0
//! CasADi's and SymPy's expressions against what CasADi and SymPy compute, and what is said of lists that are wrong.
//!
//! `cargo xtask test` installs them; TAKT_VENV names another environment that has them.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_model::graph::{Delays, Rewrites};
use takt_model::instructions::{FORMAT, read};

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
    for name in ["every", "matrices", "mx", "symbols"] {
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
    assert_eq!(error("unknown.json").text, "operation `erf` has no meaning here; in `erf(sin(x) + 1.0)`");
    assert!(error("unknown.json").line.is_some_and(|line| line > 1));
    std::fs::remove_dir_all(folder).expect("removed");
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
        (r#"{"op": "sinh", "to": 1, "of": [0]}"#, "5: operation `sinh` has no meaning here; in `sinh(x)`"),
        (
            r#"{"op": "sin", "to": -1, "of": [7]}"#,
            "5: this is no list of instructions: invalid value: integer `-1`, expected usize",
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
    assert!(error.line == Some(1) && error.text.starts_with("this is no list of instructions"), "{error}");
}
