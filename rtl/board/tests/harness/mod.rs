// SPDX-License-Identifier: MIT OR Apache-2.0
//! Simulates peripherals in Verilog: all in a single simulation, each compared with its model in every cycle.

pub(crate) mod board;
pub(crate) mod encoders;

use std::fmt::Write as _;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use takt_board::model::Model;
use takt_rtl::verilator::Sources;

/// A module under test.
pub(crate) struct Part {
    pub(crate) name: String,
    pub(crate) module: String,
    pub(crate) parameters: Vec<(String, u32)>,
    pub(crate) takes: Vec<(String, u32)>,
    pub(crate) drives: Vec<(String, u32)>,
    pub(crate) model: Box<dyn Model>,
    /// The inputs of a cycle, except for the reset, by the cycle's number.
    pub(crate) stimulus: Box<dyn FnMut(u32) -> Vec<u32>>,
}

/// Cycles of reset at the beginning, which are not compared: registers start with random values.
pub(crate) const RESET: u32 = 40;

const DRIVER: &str = r#"
#include "Vparts.h"
#include <cstdint>
#include <cstdio>
#include <vector>
int main(int argc, char **argv) {
    VerilatedContext context;
    context.commandArgs(argc, argv);
    context.randReset(2);
    context.randSeed(1);
    Vparts parts(&context);
    std::vector<uint32_t> in(TAKES), out(DRIVES);
    parts.clk = 0;
    while (fread(in.data(), 4, TAKES, stdin) == TAKES) {
        for (unsigned i = 0; i < TAKES; i++) parts.in[i] = in[i];
        parts.clk = 0;
        parts.eval();
        for (unsigned i = 0; i < DRIVES; i++) out[i] = parts.out[i];
        fwrite(out.data(), 4, DRIVES, stdout);
        parts.clk = 1;
        parts.eval();
    }
    return 0;
}
"#;

/// A module with all parts, in which each signal has a word of its own.
fn wrapper(parts: &[Part]) -> (String, usize, usize) {
    let (mut text, mut takes, mut drives) = (String::new(), 0, 0);
    for part in parts {
        let parameters: Vec<_> =
            part.parameters.iter().map(|(name, value)| format!(".{name}({value})")).collect();
        let list =
            if parameters.is_empty() { String::new() } else { format!("#({}) ", parameters.join(", ")) };
        let _ = write!(text, "    {} {list}{} (.clk(clk)", part.module, part.name);
        for (name, width) in &part.takes {
            let _ = write!(text, ", .{name}(in[{} +: {width}])", 32 * takes);
            takes += 1;
        }
        let mut padding = String::new();
        for (name, width) in &part.drives {
            let _ = write!(text, ", .{name}(out[{} +: {width}])", 32 * drives);
            if *width < 32 {
                let _ = writeln!(
                    padding,
                    "    assign out[{} +: {}] = 0;",
                    32 * drives + *width as usize,
                    32 - width
                );
            }
            drives += 1;
        }
        let _ = writeln!(text, ");\n{padding}");
    }
    let text = format!(
        "module parts (input wire clk, input wire [{}:0] in, output wire [{}:0] out);\n{text}endmodule\n",
        32 * takes - 1,
        32 * drives - 1
    );
    (text, takes, drives)
}

/// Builds all parts from these files.
pub(crate) fn build(name: &str, files: &[(&str, String)], parts: &[Part]) -> PathBuf {
    let (top, takes, drives) = wrapper(parts);
    let driver = format!("#define TAKES {takes}\n#define DRIVES {drives}\n{DRIVER}");
    let own = files.iter().map(|(name, text)| (*name, text.as_str()));
    let sources = Sources {
        name: &format!("parts-{name}"),
        top: "parts",
        prefix: "Vparts",
        files: [("parts.v", top.as_str())].into_iter().chain(own).collect(),
        driver: &driver,
        headers: Vec::new(),
        arguments: vec!["-Wno-fatal".to_owned()],
        defines: Vec::new(),
        optimise: "-O1",
        trace: false,
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    sources
        .build(folder)
        .unwrap_or_else(|error| panic!("{error}: `cargo xtask test` installs what the tests need"))
}

/// Runs `cycles` cycles; returns for each part the cycle of the first difference from its model, and the difference.
pub(crate) fn compare(
    name: &str,
    files: &[(&str, String)],
    parts: &mut [Part],
    cycles: u32,
) -> Vec<Option<String>> {
    run(&build(name, files, parts), &[], parts, cycles)
}

/// Runs a program that [`build`] has built, with arguments, and compares the parts as [`compare`] does.
pub(crate) fn run(
    program: &Path,
    arguments: &[String],
    parts: &mut [Part],
    cycles: u32,
) -> Vec<Option<String>> {
    let mut process = Command::new(program)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("what was built can be started");
    let (mut stdin, mut stdout) =
        (process.stdin.take().expect("piped"), process.stdout.take().expect("piped"));
    let stimuli: Vec<Vec<Vec<u32>>> = (0..RESET + cycles)
        .map(|cycle| {
            let stimulus = |part: &mut Part| {
                let mut inputs = vec![u32::from(cycle < RESET)];
                inputs.extend((part.stimulus)(cycle));
                assert_eq!(inputs.len(), part.takes.len(), "{}", part.name);
                inputs
            };
            parts.iter_mut().map(stimulus).collect()
        })
        .collect();
    let bytes: Vec<u8> = stimuli.iter().flatten().flatten().flat_map(|word| word.to_le_bytes()).collect();
    let writer = std::thread::spawn(move || stdin.write_all(&bytes));
    let mut answer = Vec::new();
    stdout.read_to_end(&mut answer).expect("the simulation answers");
    writer.join().expect("no panic").expect("the simulation listens");
    assert!(process.wait().expect("it ends").success());
    let mut words = answer.chunks_exact(4).map(|bytes| u32::from_le_bytes(bytes.try_into().expect("four")));
    let mut differences: Vec<Option<String>> = parts.iter().map(|_| None).collect();
    for (cycle, inputs) in stimuli.iter().enumerate() {
        for ((part, inputs), difference) in parts.iter_mut().zip(inputs).zip(&mut differences) {
            let circuit: Vec<u32> = words.by_ref().take(part.drives.len()).collect();
            assert_eq!(circuit.len(), part.drives.len(), "the simulation ended early");
            part.model.settle(inputs);
            let model = part.model.outputs();
            if cycle >= RESET as usize && model != circuit && difference.is_none() {
                let names: Vec<_> = part.drives.iter().map(|(name, _)| name.as_str()).collect();
                *difference = Some(format!(
                    "{}: cycle {cycle}: {names:?}: the circuit has {circuit:x?}, the model {model:x?}",
                    part.name
                ));
            }
            part.model.clock(inputs);
        }
    }
    differences
}
