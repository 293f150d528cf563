// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results of Pinocchio and CasADi, and the robots of `robots.json`.
//!
//! `cargo xtask test` installs them; TAKT_VENV names another environment that has them.

pub(crate) mod gcc;
pub(crate) mod processors;
#[path = "../../../../programs/tests/common/mod.rs"]
mod tables;

pub(crate) use tables::check_table;

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use takt_asm::{AssembledProgram, MemoryLoader, Options, Search};
use takt_front::graph::Function;
use takt_front::robot::{Robot, urdf};
use takt_front::sink::{self, Layout};

/// Process of a reference tool, which answers on its standard output.
pub(crate) struct Reference {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

pub(crate) fn python() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("the crate lies in the project's programs");
    std::env::var_os("TAKT_VENV").map_or_else(|| root.join(".venv"), PathBuf::from).join("bin/python3")
}

impl Reference {
    pub(crate) fn start() -> Reference {
        Reference::of("reference.py")
    }

    /// Starts one of the scripts beside the tests.
    pub(crate) fn of(script: &str) -> Reference {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(script);
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

    pub(crate) fn ask(&mut self, request: &Value) -> Value {
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

/// Assembles a function's source for t3, without a search for its schedule.
pub(crate) fn assembled(function: &Function) -> AssembledProgram {
    let layout = Layout::program(function, &takt_isa::T3).expect("it fits");
    let text = sink::source(function, &layout);
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let options = Options { machine: &takt_isa::T3, effort: 0, ..Options::default() };
    let assembled = takt_asm::assemble_bytes("f.s", text.clone().into_bytes(), &loader, &options);
    assembled.unwrap_or_else(|errors| panic!("{text}{}", errors.render(false)))
}

pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("numbers").iter().map(|x| x.as_f64().expect("a number")).collect()
}

pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) urdf: String,
    pub(crate) source: String,
    pub(crate) base: Option<String>,
    pub(crate) tip: Option<String>,
    pub(crate) end: String,
}

pub(crate) fn cases(reference: &mut Reference) -> Vec<Case> {
    let table: Value = serde_json::from_str(include_str!("../robots.json")).expect("robots.json");
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

pub(crate) fn robot(case: &Case, snap: f64) -> Robot {
    let tree = urdf::read(&case.source, snap).expect("URDF");
    tree.robot(case.base.as_deref(), case.tip.as_deref()).expect("a robot")
}
