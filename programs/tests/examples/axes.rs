// SPDX-License-Identifier: MIT OR Apache-2.0
//! The law of `foc.s` several times in one program: every copy computes bit for bit what the law by itself computes, but for other fused
//! products, in the cycles that docs/motor.md has.

use super::text;
use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;
use takt_asm::{Contract, MemoryLoader, Options};
use takt_emu::Emulator;
use takt_isa::{Machine, Program, T1, T3, T4};

/// Numbers of axes. The last has duties as its only outputs: machines have 32 output ports.
const AXES: [usize; 6] = [1, 2, 3, 4, 6, 8];
/// Periods that are compared.
const PERIODS: usize = 60;
/// Difference that other fused products make: a few roundings of currents up to 16 A.
const ROUNDING: f32 = 4e-6;
/// Rows between one axis and the next.
const APART: usize = 41;

/// Source lines of `foc.s`, by their place in a program of several axes.
#[derive(Default)]
struct Law {
    constants: Vec<&'static str>,
    declarations: Vec<&'static str>,
    once: Vec<&'static str>,
    period: Vec<&'static str>,
    /// Names of ports, states and registers, of which every axis has its own.
    names: HashSet<&'static str>,
}

impl Law {
    fn read() -> Law {
        let lines = text("foc.s").expect("it is there").lines();
        let code: Vec<&str> = lines.map(|line| line.split(';').next().unwrap_or("").trim()).collect();
        let (mut law, mut section) = (Law::default(), "");
        for line in code.into_iter().filter(|line| !line.is_empty()) {
            let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            if [".input", ".output", ".state", ".reg"].contains(&first) {
                law.names.extend(rest.split([',', ' ']).filter(|name| !name.is_empty()));
            }
            match (first, section) {
                (".once" | ".period", _) => section = first,
                ("wait" | "period:", _) => {}
                (".input" | ".output" | ".state" | ".range", _) => law.declarations.push(line),
                (_, ".once") => law.once.push(line),
                (_, ".period") => law.period.push(line),
                _ => law.constants.push(line),
            }
        }
        law
    }

    /// The program of this many axes; `id` and `iq` are left out unless `currents`.
    fn program(&self, axes: usize, currents: bool) -> String {
        let mut out = self.constants.join("\n") + "\n";
        let each = |out: &mut String, lines: &[&str]| {
            for axis in 1..=axes {
                let lines = lines.iter().map(|line| self.renamed(line, axis));
                for line in lines.filter(|line| currents || !is_of_currents(line, axis)) {
                    writeln!(out, "{line}").unwrap();
                }
            }
        };
        each(&mut out, &self.declarations);
        out += ".once\n";
        each(&mut out, &self.once);
        out += " wait period\n.period\nperiod:\n";
        each(&mut out, &self.period);
        out + " wait period\n"
    }

    /// A line with the names of an axis.
    fn renamed(&self, line: &str, axis: usize) -> String {
        let mut out = String::new();
        let ends = |c: char| !c.is_ascii_alphanumeric() && c != '_';
        for word in line.split_inclusive(ends) {
            let name = word.trim_end_matches(ends);
            match self.names.contains(name) {
                true => write!(out, "{name}_{axis}{}", &word[name.len()..]).unwrap(),
                false => out += word,
            }
        }
        out
    }
}

/// The line declares or writes the measured currents as outputs.
fn is_of_currents(line: &str, axis: usize) -> bool {
    let of =
        |name: &str| line.contains(&format!(" {name}_{axis},")) || line.ends_with(&format!(" {name}_{axis}"));
    (line.starts_with("mov") || line.starts_with(".output")) && (of("id") || of("iq"))
}

fn assemble(machine: &'static Machine, contract: Contract, source: &str) -> Program {
    let options = Options { machine, contract, ..Options::default() };
    let assembled = takt_asm::assemble("axes.s", &MemoryLoader::of("axes.s", source), &options);
    assembled.unwrap_or_else(|errors| panic!("{}: {}", machine.name, errors.render(false))).program
}

/// Output ports of a period, by name, with their bits.
type Outputs = HashMap<String, u32>;

/// Outputs of each period of a program whose axes take the rows of `foc.csv`, each some rows before the one after it and the first `ahead` rows
/// ahead; and the cycles of a period.
fn run(program: &Program, axes: usize, ahead: usize) -> (Vec<Outputs>, u64) {
    let (head, rows) = text("foc.csv").expect("it is there").split_once('\n').expect("it has rows");
    let names: Vec<&str> = head.split(',').collect();
    let rows: Vec<Vec<f32>> = rows
        .lines()
        .map(|row| row.split(',').map(|value| value.parse().expect("a number")).collect())
        .collect();
    let mut emulator = Emulator::new(program).expect("it fits");
    let mut cycles = 0;
    let outputs = (0..PERIODS).map(|period| {
        for axis in 1..=axes {
            let row = &rows[(period + ahead + APART * (axis - 1)) % rows.len()];
            for (name, value) in names.iter().zip(row) {
                let name = format!("{name}_{axis}");
                let port = program.inputs.iter().find(|port| port.name == name).expect("an input");
                emulator.set_input_bits(port.register, value.to_bits()).expect("it is an input");
            }
        }
        cycles = emulator.run_period(&[]).expect("it cannot fault").cycles;
        let value = |register| emulator.register(register).expect("it is written");
        program.outputs.iter().map(|port| (port.name.clone(), value(port.register))).collect()
    });
    (outputs.collect(), cycles)
}

#[test]
fn axes_side_by_side_compute_what_each_computes_alone() {
    let law = Law::read();
    let columns = [
        ("t3", &T3, Contract::AsWritten),
        ("t4", &T4, Contract::AsWritten),
        ("t4, contracted", &T4, Contract::All),
        ("t1", &T1, Contract::AsWritten),
    ];
    let column = |(_, machine, contract): (&str, &'static Machine, Contract)| {
        let most = AXES[AXES.len() - 1];
        let alone = assemble(machine, contract, &law.program(1, true));
        // Each axis alone, with its rows.
        let alone: Vec<Vec<Outputs>> = (0..most).map(|axis| run(&alone, 1, APART * axis).0).collect();
        AXES.map(|axes| {
            let currents = axes < most;
            let program = assemble(machine, contract, &law.program(axes, currents));
            let (outputs, cycles) = run(&program, axes, 0);
            for (period, outputs) in outputs.iter().enumerate() {
                assert_eq!(outputs.len(), axes * if currents { 5 } else { 3 });
                for (port, bits) in outputs {
                    let (name, axis) = port.rsplit_once('_').expect("it has an axis");
                    let axis: usize = axis.parse().expect("a number");
                    let expected = alone[axis - 1][period][&format!("{name}_1")];
                    // The choice of a sum's product to fuse depends on the rest of the block.
                    let apart = f32::from_bits(*bits) - f32::from_bits(expected);
                    let is_same = *bits == expected || contract == Contract::All && apart.abs() <= ROUNDING;
                    assert!(
                        is_same,
                        "{}, {axes} axes, period {period}: {port} is {apart:e} off",
                        machine.name
                    );
                }
            }
            cycles
        })
    };
    let cycles: Vec<[u64; AXES.len()]> = std::thread::scope(|scope| {
        let threads = columns.map(|of| scope.spawn(move || column(of)));
        threads.map(|thread| thread.join().expect("it ends")).to_vec()
    });
    let mut table = String::from("| axes |");
    let heads = columns.iter().map(|(name, ..)| format!(" {name} |"));
    table += &(heads.collect::<String>() + "\n|---|---|---|---|---|\n");
    for (i, axes) in AXES.iter().enumerate() {
        let only = if i + 1 == AXES.len() { ", duties only" } else { "" };
        let cells: String = cycles.iter().map(|column| format!(" {} |", column[i])).collect();
        writeln!(table, "| {axes}{only} |{cells}").unwrap();
    }
    crate::common::check_table("docs/motor.md", "axes", &table);
}
