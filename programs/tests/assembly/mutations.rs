// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mutation test: every single mistake in `tracking.s` and `tracking_friction.s` must be noticed.
//!
//! Mutations change the source's text: every instruction gets another operation, exchanged operands, or a constant off by a
//! ten-thousandth; every named constant of the robot is changed likewise; and a few mistakes are made by hand. Exchanging the operands of
//! sums and products is no mistake, and must pass.

use super::integrator::{self, EncoderError};
use super::measure::bounds;
use super::points;
use super::processor::{FRICTION, Processor, TRACKING, source};
use takt_asm::{MemoryLoader, Options, Schedule, Search};
use takt_isa::{Program, T1};
use takt_programs::{LIBRARY, SOURCES};

const ROBOT: &str = "hybrid/robot.s";

/// Source with one line changed.
struct Mutation {
    file: &'static str,
    /// Line of the change, from 0.
    line: usize,
    to: String,
}

/// The line of `tracking.s` is in a part that only its friction variant assembles.
fn is_variants(line: usize) -> bool {
    let mut within = false;
    for text in source(TRACKING).lines().take(line) {
        match text.trim().split(' ').next() {
            Some(".if") => within = text.contains("macro.feedforward"),
            Some(".else" | ".endif") => within = false,
            _ => {}
        }
    }
    within
}

/// The line of `tracking_friction.s` is in a part that only an axis with Stribeck's effect assembles; [`friction`](super::friction) tests
/// that part.
fn is_sticking(line: usize) -> bool {
    let before = source(FRICTION).lines().take(line);
    before.fold(false, |within, text| match text.trim() {
        ".else" => true,
        ".endif" => false,
        _ => within,
    })
}

/// Program that assembles the mutated line.
fn victim(mutation: &Mutation) -> &'static str {
    let friction = mutation.file == FRICTION || mutation.file == TRACKING && is_variants(mutation.line);
    if friction { FRICTION } else { TRACKING }
}

/// Assembles the program with its mistakes, for the machine with one slot, where any operation may write any register.
fn assemble(path: &str, mutations: &[Mutation]) -> Program {
    let mut loader = MemoryLoader::new(SOURCES);
    for file in [TRACKING, ROBOT, FRICTION] {
        let line = |(i, line): (usize, &'static str)| {
            let change = mutations.iter().find(|mutation| mutation.file == file && mutation.line == i);
            change.map_or_else(|| line.to_owned(), |mutation| mutation.to.clone())
        };
        let lines: Vec<String> = source(file).lines().enumerate().map(line).collect();
        loader.add(file, lines.join("\n"));
    }
    let options = Options { machine: &T1, schedule: Schedule::None, effort: 0, ..Options::default() };
    let assembled = takt_asm::assemble(path, &Search::new(loader).library(LIBRARY), &options);
    assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

/// Runs the tests on a program; the error names the first violation.
fn judge(path: &str, program: &Program) -> Result<(), String> {
    let processor = Processor::new(program);
    let limits = bounds(path);
    points::measure(path, &processor, 250, 5).within(&limits)?;
    for off in EncoderError::ALL {
        let figures = integrator::measure(path, processor.clone(), off).map_err(|error| error.to_string())?;
        figures.within(&limits)?;
    }
    Ok(())
}

/// Instruction of a line: mnemonic and operands.
fn instruction(line: &str) -> Option<(&str, Vec<&str>)> {
    let code = line.split(';').next().unwrap_or_default().trim();
    let (mnemonic, operands) = code.split_once(' ')?;
    let known = takt_isa::ROWS.iter().any(|row| row.mnemonic == mnemonic) && mnemonic != "wait";
    known.then(|| (mnemonic, operands.split(',').map(str::trim).collect()))
}

/// Operation with the same operands and a different result.
fn other(mnemonic: &str) -> &'static str {
    match mnemonic {
        "fadd" => "fsub",
        "fsub" | "fmul" => "fadd",
        "fdiv" => "fmul",
        "fsqrt" | "fsin" | "fsign" => "fabs",
        "fabs" | "itof" => "mov",
        "isub" => "iadd",
        "fmax" | "fsat" => "fmin",
        "feq" => "flt",
        "fle" => "feq",
        _ => panic!("say what else there is for {mnemonic}"),
    }
}

/// The operand is a constant expression other than a name.
fn is_expression(operand: &str) -> bool {
    operand.contains(['*', '/', '^', '(']) || operand.starts_with(|c: char| c.is_ascii_digit())
}

/// Factor for a mistake in a constant: the smallest that the tests must notice.
///
/// - `ec` is a threshold between errors that are whole counts.
/// - `fall` and its sources change only the second half of a boost; a change by a ten-thousandth is less than rounding.
/// - The threshold for `tc ≤ Tc/2` is deliberately half a step off, and a step is 0.3 % of it.
fn factor(name: &str) -> &'static str {
    match name {
        "ec{i}" => "2.2",
        "fall" | "Tc" => "1.001",
        "xc*gain - fall/2" => "1.01",
        // The constant matters only within a few v0 of standstill, where points are rare.
        "1/(v0)" => "1.1",
        _ => "1.0001",
    }
}

/// Changes without effect: `wu` and `t23` are only squared.
const EQUIVALENT: [&str; 2] = ["fsub wu, u, w", "fsub t23, w, t12"];

/// Mistakes made by rule, in every line.
fn by_rule() -> Vec<Mutation> {
    let mut mutations = Vec::new();
    for file in [TRACKING, ROBOT, FRICTION] {
        for (line, text) in source(file).lines().enumerate() {
            if file == FRICTION && is_sticking(line) {
                continue;
            }
            let mut add = |to: String| mutations.push(Mutation { file, line, to });
            if let Some((name, value)) = text.strip_prefix(".const").and_then(|rest| rest.split_once('=')) {
                let value = value.split(';').next().unwrap_or_default().trim();
                add(format!(".const {name} = ({value})*{}", factor(name.trim())));
            }
            let Some((mnemonic, operands)) = instruction(text) else { continue };
            let with = |operands: &[&str]| format!("{mnemonic} {}", operands.join(", "));
            if mnemonic == "mov" {
                add(with(&[operands[0], "1e6"]));
                continue;
            }
            if mnemonic != "sel" {
                add(format!("{} {}", other(mnemonic), operands.join(", ")));
            }
            if matches!(mnemonic, "fsub" | "fdiv" | "isub" | "fle" | "fsat" | "sel") {
                let mut exchanged = operands.clone();
                let last = exchanged.len() - 1;
                exchanged.swap(last - 1, last);
                add(with(&exchanged));
            }
            for (i, operand) in operands.iter().enumerate().filter(|(_, operand)| is_expression(operand)) {
                let scaled = format!("({operand})*{}", factor(operand));
                let mut operands = operands.clone();
                operands[i] = &scaled;
                add(with(&operands));
            }
        }
    }
    mutations.retain(|mutation| !EQUIVALENT.contains(&mutation.to.as_str()));
    mutations
}

/// Typical mistakes in copying formulas: the text of a line, and its replacement.
const BY_HAND: [(&str, &str); 12] = [
    ("fmul    xv, x, vx", "fmul    xv, x, vy"),
    ("fmul    za, z, az", "fmul    za, z, vz"),
    ("fsub    {s}2, side, px2", "fsub    {s}2, sum, px2"),
    ("fdiv    w{i}, w{i}, ll{i}", "fdiv    w{i}, w{i}, ll1"),
    ("arms    dv, 1, vx, vy, dv", "arms    dv, 2, vx, vy, dv"),
    ("mov     om5d, omega_gamma", "mov     om5d, omega_alpha"),
    ("fsub    w, q1, q3", "fsub    w, q2, q3"),
    ("mass    1, 2, s12, 3, s13", "mass    1, 3, s12, 2, s13"),
    ("mass    3, 1, s13, 2, s23", "mass    3, 1, s13, 2, s12"),
    ("fadd    la3, la1, w", "fadd    la3, la1, u"),
    ("sel     ramp, large, held, gain", "sel     ramp, same, held, gain"),
    ("control i, l{i}d, v{i}d, zero", "control i, l{i}d, v{i}d, a{i}d"),
];

fn by_hand() -> impl Iterator<Item = Mutation> {
    BY_HAND.iter().map(|(from, to)| {
        let mut lines = source(TRACKING).lines().enumerate().filter(|(_, line)| line.contains(from));
        let (line, text) = lines.next().unwrap_or_else(|| panic!("there is no `{from}`"));
        assert_eq!(lines.next(), None, "`{from}` is there more than once");
        Mutation { file: TRACKING, line, to: text.replace(from, to) }
    })
}

#[test]
fn every_mistake_is_noticed() {
    let mut unnoticed = Vec::new();
    let mut mistakes = 0;
    for mutation in by_rule().into_iter().chain(by_hand()) {
        let Mutation { file, line, ref to } = mutation;
        let place = format!("{file}:{}: {to}", line + 1);
        let path = victim(&mutation);
        mistakes += 1;
        if judge(path, &assemble(path, &[mutation])).is_ok() {
            unnoticed.push(place);
        }
    }
    assert!(unnoticed.is_empty(), "of {mistakes} mistakes these go unnoticed:\n{}", unnoticed.join("\n"));
    assert!(mistakes > 200, "only {mistakes}");
}

#[test]
fn equivalent_mutations_are_not_reported() {
    assert_eq!(judge(FRICTION, &assemble(FRICTION, &[])), Ok(()));
    assert_eq!(judge(TRACKING, &assemble(TRACKING, &[])), Ok(()));
    let lines = source(TRACKING).lines().enumerate();
    let exchanged: Vec<Mutation> = lines
        .filter_map(|(line, text)| {
            let (mnemonic, operands) = instruction(text)?;
            let [d, a, b] = operands[..] else { return None };
            let to = format!("{mnemonic} {d}, {b}, {a}");
            matches!(mnemonic, "fadd" | "fmul").then_some(Mutation { file: TRACKING, line, to })
        })
        .collect();
    assert!(exchanged.len() > 50, "only {}", exchanged.len());
    assert_eq!(judge(TRACKING, &assemble(TRACKING, &exchanged)), Ok(()));
}
