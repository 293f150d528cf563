//! Every function of every robot of `robots.json` against Pinocchio, in binary64: what is compared is whether the equations
//! are right. (How they round in binary32 is the table in docs/models.md.)
//!
//! `cargo xtask test` installs Pinocchio and the robots; TAKT_VENV names another environment that has them.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use takt_model::functions::{Options, What, derive};
use takt_model::graph::{Delays, Rewrites};
use takt_model::robot::{Robot, urdf};

/// The process that answers.
struct Reference {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

fn python() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the project");
    std::env::var_os("TAKT_VENV").map_or_else(|| root.join(".venv"), PathBuf::from).join("bin/python3")
}

impl Reference {
    fn start() -> Reference {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference.py");
        let mut child = Command::new(python())
            .arg(script)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("no Python environment: `cargo xtask test` makes one");
        let input = child.stdin.take().expect("piped");
        let output = BufReader::new(child.stdout.take().expect("piped"));
        Reference { child, input, output }
    }

    fn ask(&mut self, request: &Value) -> Value {
        writeln!(self.input, "{request}").expect("the reference runs");
        let mut line = String::new();
        self.output.read_line(&mut line).expect("the reference answers");
        serde_json::from_str(&line).unwrap_or_else(|_| panic!("the reference failed: {request}"))
    }
}

impl Drop for Reference {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("numbers").iter().map(|x| x.as_f64().expect("a number")).collect()
}

struct Case {
    name: String,
    urdf: String,
    source: String,
    base: Option<String>,
    tip: Option<String>,
    end: String,
}

fn cases(reference: &mut Reference) -> Vec<Case> {
    let table: Value = serde_json::from_str(include_str!("robots.json")).expect("robots.json");
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let rows = table.as_array().expect("a list").iter();
    rows.map(|row| {
        let urdf = text(&row["urdf"]).expect("a path");
        let path = reference.ask(&json!({ "locate": urdf }));
        let path = path.as_str().expect("a path").to_owned();
        Case {
            name: text(&row["name"]).expect("a name"),
            source: std::fs::read_to_string(&path).expect("the robot's file"),
            urdf,
            base: text(&row["base"]),
            tip: text(&row["tip"]),
            end: text(&row["end"]).expect("a link"),
        }
    })
    .collect()
}

fn robot(case: &Case, snap: f64) -> Robot {
    let tree = urdf::read(&case.source, snap).expect("URDF");
    tree.robot(case.base.as_deref(), case.tip.as_deref()).expect("a robot")
}

/// The largest error of any output, beside the largest output of its state.
fn error(reference: &mut Reference, case: &Case, what: What, rewrites: Rewrites, snap: f64, states: usize) -> f64 {
    let robot = robot(case, snap);
    let delays = Delays::of(&takt_isa::T3);
    let options = Options { rewrites, delays, tip: Some(&case.end), kp: 100.0, kd: 20.0 };
    let function = derive(&robot, what, &options).expect("equations");
    let joints: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    let answer = reference.ask(&json!({
        "urdf": case.urdf, "joints": joints, "base": robot.base, "tip": case.end, "function": what.name(),
        "states": states, "seed": 1, "kp": options.kp, "kd": options.kd,
    }));
    let states = answer["inputs"].as_array().expect("states").iter().zip(answer["outputs"].as_array().expect("states"));
    let mut worst: f64 = 0.0;
    for (inputs, outputs) in states {
        let expected = numbers(outputs);
        let computed = function.evaluate(&numbers(inputs));
        assert_eq!(computed.len(), expected.len());
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for (computed, expected) in computed.iter().zip(&expected) {
            let error = (computed - expected).abs() / size;
            assert!(error.is_finite(), "{}: {}", case.name, what.name());
            worst = worst.max(error);
        }
    }
    worst
}

fn states() -> usize {
    if std::env::var_os("TAKT_FULL").is_some() { 10_000 } else { 10 }
}

#[test]
fn equations_are_right() {
    let mut reference = Reference::start();
    for case in cases(&mut reference) {
        for (what, name, _) in What::ALL {
            // Angles that are taken for quarter turns are off by up to 3e-9 in these files.
            let error = error(&mut reference, &case, what, Rewrites::ALL, urdf::SNAP, states());
            println!("{} {name}: {error:.1e}", case.name);
            assert!(error < 1e-6, "{}: {name}: {error:.1e}", case.name);
        }
    }
}

/// Angles as they are written, which leaves hardly any zero in the geometry; and nothing rewritten that changes rounding.
#[test]
fn equations_are_right_without_quarter_turns() {
    let mut reference = Reference::start();
    for case in cases(&mut reference) {
        for (what, name, _) in What::ALL {
            if case.name.contains("whole") && what == What::ForwardDynamics {
                continue;
            }
            let error = error(&mut reference, &case, what, Rewrites::EXACT, 0.0, states());
            println!("{} {name}: {error:.1e}", case.name);
            assert!(error < 1e-8, "{}: {name}: {error:.1e}", case.name);
        }
    }
}
