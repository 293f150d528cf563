// SPDX-License-Identifier: MIT OR Apache-2.0
//! Examples in `programs/examples/`: each on every machine, over its recorded inputs, against an independent implementation in binary64;
//! and their costs, in `docs/examples.md`.

mod axes;
mod listings;
mod reference;

use reference::Reference;
use takt_asm::loops::LoopForm;
use takt_asm::{AssembledProgram, Contract, MemoryLoader, Options, Search};
use takt_emu::Emulator;
use takt_isa::{MACHINES, Machine, T3, T4, Type};
use takt_programs::{EXAMPLES, LIBRARY, RECORDS};

/// Example with its reference and its tolerance.
struct Case {
    name: &'static str,
    reference: fn() -> Box<dyn Reference>,
    /// Absolute tolerance for each output, in its unit.
    tolerance: f64,
    /// Number of periods to run without inputs.
    periods: usize,
    /// Example whose inputs it takes.
    inputs: &'static str,
}

const fn case(name: &'static str, reference: fn() -> Box<dyn Reference>, tolerance: f64) -> Case {
    Case { name, reference, tolerance, periods: 0, inputs: name }
}

const CASES: &[Case] = &[
    Case { periods: 2600, ..case("blink", || Box::<reference::Blink>::default(), 0.0) },
    case("pi", || Box::new(reference::Pi::new([0.8, 12.0])), 1e-5),
    Case { inputs: "pi", ..case("gains", || Box::new(reference::Pi::new([0.3, 4.0])), 1e-5) },
    case("pendulum", || Box::<reference::Pendulum>::default(), 2e-6),
    case("foc", || Box::<reference::Foc>::default(), 2e-6),
    Case { inputs: "foc", ..case("foc_early", || Box::<reference::FocEarly>::default(), 5e-6) },
    case("biquads", || Box::<reference::Biquads>::default(), 1e-5),
    case("kalman", || Box::<reference::Kalman>::default(), 2e-5),
    case("lu", || Box::<reference::Lu>::default(), 2e-3),
    case("statespace", || Box::<reference::StateSpace>::default(), 2e-6),
    case("table", || Box::<reference::Table>::default(), 2e-5),
];

fn text(name: &str) -> Option<&'static str> {
    EXAMPLES.iter().chain(RECORDS).find(|(file, _)| *file == name).map(|(_, text)| *text)
}

/// Assembles an example; a warning is an error.
fn assemble(machine: &'static Machine, name: &str) -> AssembledProgram {
    let file = format!("{name}.s");
    let source = text(&file).unwrap_or_else(|| panic!("there is no {file}"));
    assemble_text(machine, &file, source)
}

fn assemble_text(machine: &'static Machine, file: &str, source: &str) -> AssembledProgram {
    let loader = Search::new(MemoryLoader::of(file, source)).library(LIBRARY);
    let options = Options { machine, ..Options::default() };
    let assembled = takt_asm::assemble(file, &loader, &options);
    let assembled = assembled.unwrap_or_else(|errors| panic!("{}: {}", machine.name, errors.render(false)));
    assert!(assembled.warnings.list.is_empty(), "{}: {}", machine.name, assembled.warnings.render(false));
    assembled
}

/// Rows of an example's inputs, in the order of its ports.
fn rows(case: &Case, assembled: &AssembledProgram) -> Vec<Vec<f32>> {
    let Some(csv) = text(&format!("{}.csv", case.inputs)) else {
        return vec![Vec::new(); case.periods];
    };
    let (head, rows) = csv.split_once('\n').expect("it has rows");
    let ports: Vec<&str> = assembled.program.inputs.iter().map(|port| port.name.as_str()).collect();
    assert_eq!(head.split(',').collect::<Vec<_>>(), ports, "{}.csv", case.inputs);
    rows.lines().map(|row| row.split(',').map(|value| value.parse().expect("a number")).collect()).collect()
}

/// Figures of each period after the first, which also runs `.once`.
struct Figures {
    /// Cycles to the outputs, and to the `wait`.
    published: u64,
    cycles: u64,
    operations: u64,
}

/// Runs an example.
fn run(
    case: &Case,
    machine: &'static Machine,
    assembled: &AssembledProgram,
    wrong: &mut Vec<String>,
) -> Figures {
    let name = format!("{} on {}", case.name, machine.name);
    let program = &assembled.program;
    let mut emulator = Emulator::new(program).expect("it fits");
    let mut reference = (case.reference)();
    let (mut cycles, mut operations) = (Vec::new(), Vec::new());
    let (mut largest, mut worst) = (0.0_f64, String::new());
    for (period, row) in rows(case, assembled).iter().enumerate() {
        for (port, value) in program.inputs.iter().zip(row) {
            emulator.set_input_bits(port.register, value.to_bits()).expect("it is an input");
        }
        let report = emulator.run_period(&[]).expect("it cannot fault");
        cycles.push((report.published - report.start, report.cycles));
        operations.push(emulator.statistics().total_operations());
        let inputs: Vec<f64> = row.iter().map(|&value| value.into()).collect();
        let expected = reference.period(&inputs);
        assert_eq!(expected.len(), program.outputs.len(), "{name}");
        for (port, exact) in program.outputs.iter().zip(expected) {
            let bits = emulator.register(port.register).expect("it is written");
            let got = match port.ty {
                Type::F => f64::from(f32::from_bits(bits)),
                _ => f64::from(bits.cast_signed()),
            };
            let error = (got - exact).abs();
            if error > largest {
                (largest, worst) = (error, format!("period {period}: {} is {got}, not {exact}", port.name));
            }
        }
    }
    // The tolerance is at most eight times the largest difference.
    if largest > case.tolerance || largest * 8.0 < case.tolerance {
        wrong.push(format!("{name}: {largest:e} apart, {:e} allowed; {worst}", case.tolerance));
    }
    assert!(cycles[1..].iter().all(|&count| count == cycles[1]), "{name}: {cycles:?}");
    let (published, cycles) = cycles[1];
    Figures { published, cycles, operations: operations[1] - operations[0] }
}

#[test]
fn examples_compute_expected_values_in_documented_cycles() {
    let mut table = String::from("| example | operations of a period |");
    let mut rule = String::from("|---|---|");
    for machine in MACHINES {
        table += &format!(" {0}: cycles | bound |", machine.name);
        rule += "---|---|";
    }
    table += &format!("\n{rule}\n");
    let mut wrong = Vec::new();
    for case in CASES {
        let mut row = String::new();
        let mut operations = 0;
        for machine in MACHINES {
            let assembled = assemble(machine, case.name);
            let figures = run(case, machine, &assembled, &mut wrong);
            let Figures { published, cycles, .. } = figures;
            operations = operations.max(figures.operations);
            if published < cycles {
                // The period has two blocks, before the `publish` and behind it.
                row += &format!(" {published} of {cycles} | |");
                continue;
            }
            if assembled.counted_loops.iter().any(|counted| !matches!(counted.form, LoopForm::Unrolled(_))) {
                // Periods with loops have several blocks, and some blocks run repeatedly.
                row += &format!(" {cycles} | |");
                continue;
            }
            let block = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
            let block = block.expect("it is scheduled");
            assert_eq!(u64::from(block.cycles), cycles, "{} on {}", case.name, machine.name);
            row += &format!(" {cycles} | {} |", block.bound.cycles());
        }
        table += &format!("| `{}.s` | {operations} |{row}\n", case.name);
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    crate::common::check_table("docs/examples.md", "cycles", &table);
}

/// Cycles from the tick to the published duties, and to the `wait`, of `foc_early.s`; docs/motor.md has them.
#[test]
fn duties_are_published_long_before_the_wait() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/motor.md");
    let document = std::fs::read_to_string(path).expect("it is there");
    for (machine, contract, name, most) in
        [(&T3, Contract::AsWritten, "Takt t3", 115), (&T4, Contract::All, "Takt t4, contracted", 95)]
    {
        let loader = MemoryLoader::of("foc_early.s", text("foc_early.s").expect("it is there"));
        let options = Options { machine, contract, ..Options::default() };
        let assembled = takt_asm::assemble("foc_early.s", &loader, &options);
        let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
        let mut emulator = Emulator::new(&assembled.program).expect("it fits");
        for port in &assembled.program.inputs {
            emulator.set_input_bits(port.register, 24.0_f32.to_bits()).expect("it is an input");
        }
        emulator.run_period(&[]).expect("it cannot fault");
        let period = emulator.run_period(&[]).expect("it cannot fault");
        // Nothing in it depends on data.
        let duties = period.published - period.start;
        assert!(duties <= most, "{name}: {duties}");
        let row = format!(
            "| {name}, `examples/foc_early.s` | one axis, to the published duties | {:.2} µs, {} cycles of {} |",
            duties as f64 / 125.0,
            duties,
            period.cycles
        );
        assert!(document.contains(&row), "docs/motor.md lacks `{row}`");
    }
}

#[test]
fn every_example_is_tried() {
    for (file, _) in EXAMPLES.iter().chain(RECORDS) {
        let name = file.split('.').next().expect("it has a name");
        assert!(CASES.iter().any(|case| case.name == name), "{file}");
    }
}
