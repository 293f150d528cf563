// SPDX-License-Identifier: MIT OR Apache-2.0
//! `docs/models.md`: the cost of every function of every robot compared with CasADi, and its error relative to Pinocchio.
//!
//! With TAKT_BLESS the test writes the table, from 10,000 states each (or TAKT_STATES); otherwise it makes a part of it again and compares.

use crate::common::processors::{self, PROCESSORS};
use crate::common::{Case, Reference, cases, numbers, robot};
use serde_json::json;
use std::fmt::Write;
use std::path::Path;
use takt_asm::{MemoryLoader, Options as Assembling, Search};
use takt_emu::{Emulator, Number};
use takt_front::graph::{Delays, Function, Rewrites};
use takt_front::robot::functions::{Options, RobotFunction, derive};
use takt_front::robot::urdf;
use takt_front::sink::{self, Layout};
use takt_isa::program::{Space, Symbol};
use takt_isa::{Machine, T1, T3};

/// Cost of a program on a machine.
struct ProgramCost {
    cycles: u64,
    bound: u64,
    emulator: Emulator,
    layout: Layout,
}

impl ProgramCost {
    /// Value of an output that is not constant.
    fn output(&self, function: &Function, index: usize) -> f64 {
        let bits = match self.layout.word(function, index) {
            Some((array, word)) => {
                let symbols = &self.emulator.program().symbols;
                let of = |symbol: &&Symbol| symbol.space == Space::Data && symbol.name == array;
                let address = symbols.iter().find(of).expect("the array").address;
                self.emulator.memory()[address as usize + word]
            }
            None => {
                let name = self.layout.output(index).expect("a place");
                match self.emulator.output(name).expect("a port") {
                    Some(Number::Float(value)) => value.to_bits(),
                    other => panic!("{name}: {other:?}"),
                }
            }
        };
        f64::from(f32::from_bits(bits))
    }
}

fn function(case: &Case, what: RobotFunction, machine: &Machine) -> Function {
    let options = Options {
        rewrites: Rewrites::ALL,
        delays: Delays::of(machine),
        tip: Some(&case.end),
        kp: 100.0,
        kd: 20.0,
    };
    derive(&robot(case, urdf::SNAP), what, &options).expect("equations")
}

/// Builds the program; the error says why it does not fit.
fn built(function: &Function, machine: &'static Machine) -> Result<ProgramCost, String> {
    let layout = Layout::program(function, machine).map_err(|error| error.to_string())?;
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let options = Assembling { machine, ..Assembling::default() };
    let source = sink::source(function, &layout).into_bytes();
    let assembled = takt_asm::assemble_bytes("model.s", source, &loader, &options).map_err(|errors| {
        let text = errors.render(false);
        let first = text.lines().next().unwrap_or("it does not fit").to_owned();
        first.split_once(": ").map_or(first.clone(), |(_, text)| text.to_owned())
    })?;
    let bounds = takt_analysis::bound(&assembled.program).map_err(|error| error.to_string())?;
    let [block] = &assembled.blocks[..] else { return Err(format!("{} blocks", assembled.blocks.len())) };
    let cycles = bounds.worst_period().unwrap_or(0);
    Ok(ProgramCost {
        cycles,
        // No schedule changes the cycles of the period beyond its block.
        bound: cycles - u64::from(block.cycles - block.bound.cycles()),
        emulator: Emulator::new(&assembled.program).map_err(|error| error.to_string())?,
        layout,
    })
}

/// A row of the table.
struct Row {
    operations: usize,
    casadi: u64,
    t3: Result<ProgramCost, String>,
    t1: Result<ProgramCost, String>,
    /// Cycles on other processors.
    others: Option<[u64; PROCESSORS.len()]>,
    /// Error of the equations in binary64.
    error: f64,
    /// Error of the machine: the largest, and the ninth decile over the states.
    machine: Option<(f64, f64)>,
}

fn row(reference: &mut Reference, case: &Case, what: RobotFunction, states: usize) -> Row {
    let function_t3 = function(case, what, &T3);
    let robot = robot(case, urdf::SNAP);
    let joints: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    let answer = reference.ask(&json!({
        "urdf": case.urdf, "joints": joints, "base": robot.base, "tip": case.end, "function": what.name(),
        "states": states, "seed": 7, "kp": 100.0, "kd": 20.0, "casadi": true,
    }));
    let mut t3 = built(&function_t3, &T3);
    let read = sink::inputs_read(&function_t3);
    let (mut error, mut machine) = (0.0f64, Vec::new());
    let states = answer["inputs"]
        .as_array()
        .expect("states")
        .iter()
        .zip(answer["outputs"].as_array().expect("states"));
    for (inputs, outputs) in states {
        let (inputs, expected) = (numbers(inputs), numbers(outputs));
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        let worst = |computed: &[f64]| {
            computed.iter().zip(&expected).map(|(x, y)| (x - y).abs() / size).fold(0.0, f64::max)
        };
        error = error.max(worst(&function_t3.evaluate(&inputs)));
        let Ok(built) = &mut t3 else { continue };
        for ((port, value), _) in function_t3.inputs.iter().zip(&inputs).zip(&read).filter(|(_, read)| **read)
        {
            built.emulator.set_input(&port.name, Number::Float(*value as f32)).expect("a port");
        }
        built.emulator.run_period(&[]).expect("a period");
        let outputs = function_t3.outputs.iter().enumerate();
        let computed: Vec<f64> = outputs
            .map(|(index, (_, id))| {
                function_t3.graph.value(*id).unwrap_or_else(|| built.output(&function_t3, index))
            })
            .collect();
        machine.push(worst(&computed));
    }
    machine.sort_by(f64::total_cmp);
    let machine = machine.last().map(|last| (*last, machine[machine.len() * 9 / 10]));
    let operations = function_t3.count().total();
    let casadi = answer["operations"].as_u64().expect("a count");
    let others = processors::cycles(&function_t3);
    Row { operations, casadi, t3, t1: built(&function(case, what, &T1), &T1), others, error, machine }
}

fn cell(built: &Result<ProgramCost, String>) -> String {
    match built {
        Ok(built) => format!("{} / {}", built.cycles, built.bound),
        Err(why) => why.clone(),
    }
}

fn line(case: &Case, what: RobotFunction, row: &Row) -> String {
    let less = 100.0 * (1.0 - row.operations as f64 / row.casadi as f64);
    let machine = row.machine.map_or("".to_owned(), |(worst, most)| format!("{most:.0e} / {worst:.0e}"));
    let others = row
        .others
        .map_or([const { String::new() }; PROCESSORS.len()], |cycles| cycles.map(|n| n.to_string()));
    let others = others.join(" | ");
    format!(
        "| {} | {} | {} | {} | {less:.0} % | {} | {} | {others} | {:.0e} | {machine} |\n",
        case.name,
        what.name(),
        row.operations,
        row.casadi,
        cell(&row.t3),
        cell(&row.t1),
        row.error
    )
}

const HEAD: &str = "\
# Robots and what their equations take

<!-- Written by `TAKT_BLESS=1 cargo test --release -p takt-front --test suite table::`. -->

How the equations come about: [model.md](model.md).

- *operations*: sums, products, divisions, roots, sines and cosines, signs, as `takt model` prints them.
- *CasADi*: the same function in CasADi 3.7 as the textbooks have it (`asm/front/tests/reference.py`: Newton and Euler in
  link frames, composite bodies, articulated bodies or elimination, whichever is shorter), zeros of the geometry left
  out, after `cse`.
- *saved*: operations fewer than CasADi's.
- *t3*, *t1*: cycles of a period, and the bound that no schedule can beat; or why it does not fit. Outputs
  beyond the output ports of the machine are stored in data memory.
- OTHERS: cycles of the same operations in binary32 on commercial processors, and on
  one of the class of soft cores: models of LLVM RELEASE (`llvm-mca`), not measurements, with perfect caches. Products
  are fused into sums; sine and cosine are polynomials in line (12 products and sums each). Rocket has no conditional
  move: both ways of a branch count.
- *binary64*: the largest relative error of the equations, in binary64, against Pinocchio over STATES random states. It
  is not less where the file writes quarter turns with ten digits, which are taken for exact ones.
- *t3's result*: the relative error of what the machine computes, in binary32: nine states of ten stay below the first
  figure, the second is the worst. Relative to the largest output of the state.

";

/// Text before the rows.
fn head(states: usize) -> String {
    let names = PROCESSORS.each_ref().map(|processor| processor.name);
    let text = HEAD.replace("STATES", &states.to_string()).replace("RELEASE", &processors::release());
    let text = text.replace("OTHERS", &names.map(|name| format!("*{name}*")).join(", "));
    let titles = ["robot", "function", "operations", "CasADi", "saved", "t3", "t1"];
    let titles = [&titles[..], &names, &["binary64", "t3's result"]].concat();
    format!("{text}| {} |\n|{}\n", titles.join(" | "), "---|".repeat(titles.len()))
}

#[test]
fn documented_table_equals_the_measured_costs() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/models.md");
    let mut reference = Reference::start();
    let cases = cases(&mut reference);
    if std::env::var_os("TAKT_BLESS").is_some() {
        let states: usize = match std::env::var("TAKT_STATES") {
            Ok(states) => states.parse().expect("a number of states"),
            Err(_) => 10_000,
        };
        let mut text = head(states);
        for case in &cases {
            for (what, ..) in RobotFunction::ALL {
                let row = row(&mut reference, case, what, states);
                let _ = write!(text, "{}", line(case, what, &row));
            }
        }
        std::fs::write(path, text).expect("docs/models.md");
        return;
    }
    let table = std::fs::read_to_string(path).expect("docs/models.md");
    let full = std::env::var_os("TAKT_FULL").is_some();
    let same_models = table.contains(&format!("models of LLVM {} ", processors::release()));
    for case in &cases {
        for (what, ..) in RobotFunction::ALL {
            // The quick test takes the best-known robot.
            if !full && case.name != "UR5" {
                continue;
            }
            let row = row(&mut reference, case, what, if full { 10_000 } else { 20 });
            let line = line(case, what, &row);
            // Compares all columns except for the errors, which depend on the number of states, and the processors' cycles under another
            // release of LLVM.
            let depends = if same_models { 4 } else { 4 + PROCESSORS.len() };
            let fixed = line.rsplitn(depends, '|').last().expect("columns");
            assert!(table.contains(fixed), "docs/models.md has not: {line}\nTAKT_BLESS=1 rewrites it");
            assert!(row.error < 1e-6, "{line}");
        }
    }
}

/// Targets of the project: fewer operations than CasADi, UR5 and TALOS' arm in their cycles and near the bound.
#[test]
fn targets_are_kept() {
    let table = include_str!("../../../docs/models.md");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| robot"))
        .map(|line| line.split('|').map(str::trim).collect())
        .collect();
    assert!(rows.len() >= 8 * RobotFunction::ALL.len());
    let number =
        |text: &str| -> u64 { text.split(' ').next().and_then(|text| text.parse().ok()).expect("a number") };
    for row in &rows {
        let (operations, casadi) = (number(row[3]), number(row[4]));
        assert!(10 * operations <= 9 * casadi, "{row:?}");
        if row[1].starts_with("UR") || row[1] == "TALOS, left arm" {
            let Some((cycles, bound)) = row[6].split_once(" / ") else { continue };
            assert!(100 * number(cycles) <= 103 * number(bound), "{row:?}");
        }
    }
    let cycles = |robot: &str| {
        let row = rows.iter().find(|row| row[1] == robot && row[2] == "inverse-dynamics");
        number(row.expect("the robot")[6])
    };
    assert!(cycles("UR5") <= 260 && cycles("TALOS, left arm") <= 470);
}
