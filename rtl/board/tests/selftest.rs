// SPDX-License-Identifier: MIT OR Apache-2.0
//! The hardware kit: its program on every machine, its wiring on every board, and all of it on a simulated board with t1, as it is, without
//! wires, and with faults planted in units and wires.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;
use takt_asm::{MemoryLoader, Options as AssemblyOptions, assemble};
use takt_board::selftest::{
    BATCH, Emulated, Options, Report, SelftestError, emulate, operations, run, source, wires, wiring,
};
use takt_board::simulation::Simulation;
use takt_board::{Board, Host, Wiring, top};
use takt_isa::{MACHINES, Machine, Program, ROWS, T1};
use takt_rtl::verilator;

fn program(machine: &'static Machine) -> Program {
    assembled(machine, &source(machine, "machine.toml").unwrap_or_else(|error| panic!("{error}")))
}

fn assembled(machine: &'static Machine, text: &str) -> Program {
    let loader = MemoryLoader::new(&[("selftest.s", text)]);
    let options = AssemblyOptions { machine, ..AssemblyOptions::default() };
    let assembled = assemble("selftest.s", &loader, &options).unwrap_or_else(|error| panic!("{error:?}"));
    assert_eq!(assembled.warnings.render(false), "", "{}", machine.name);
    assembled.program
}

/// Every row of the table that computes is there, in every slot, and its digest depends on the number of operands.
#[test]
fn every_computing_instruction_of_a_machine_has_a_digest() {
    for machine in MACHINES {
        let names: Vec<String> = operations(machine).into_iter().map(|operation| operation.name).collect();
        let own = |row: &takt_isa::Row| machine.host(row.function).is_some() && row.shape.sources() > 0;
        let rows = ROWS.iter().filter(|row| own(row) && row.effect == takt_isa::Effect::Compute);
        for row in rows {
            let is_there = |name: &String| name.split('.').next() == Some(row.mnemonic);
            assert_eq!(names.iter().filter(|name| is_there(name)).count(), machine.hosts(row.function).len());
        }
        let program = program(machine);
        let [some, more] = [64, 65].map(|operands| emulate(&program, operands).expect("it runs"));
        assert_eq!((some.done, more.done), (64, 64 + BATCH));
        assert_eq!(some.digests.len(), names.len());
        for ((name, some), more) in names.iter().zip(&some.digests).zip(&more.digests) {
            assert_ne!(some, more, "{} on {}", name, machine.name);
        }
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
    }
}

#[test]
fn the_wiring_fits_every_board() {
    let program = program(&T1);
    let cycles = emulate(&program, 64).expect("it runs").cycles;
    for board in Board::builtin().expect("boards") {
        let text = wiring(&board, cycles).expect("pins");
        let read = Wiring::read("selftest.toml", &text, &board);
        let read = read.unwrap_or_else(|mistakes| panic!("{}: {mistakes:?}\n{text}", board.name));
        read.check("selftest.toml", &text, &program).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        let bounds = [takt_analysis::bound(&program).ok()];
        let findings = read.findings("selftest.toml", &text, &program, &bounds);
        let all = [findings.mistakes, findings.late, findings.warnings].concat();
        assert!(all.is_empty(), "{}: {all:?}\n{text}", board.name);
        let ends: BTreeSet<String> =
            wires(&read).expect("wires").into_iter().flat_map(|wire| wire.pins).collect();
        assert_eq!(ends.len(), 4, "{}", board.name);
    }
}

/// A simulated board with the kit.
struct Bench {
    board: Board,
    wiring: Wiring,
    program: Program,
    files: Vec<takt_rtl::export::DesignFile>,
    expected: Emulated,
}

const OPERANDS: u32 = 128;

/// Faults in units: integers of large numbers, shifts to the right, the quadrant of a cosine; each with an instruction that differs.
const FAULTS: [((&str, &str, &str), &str); 3] = [
    (("takt_addmul", "too_large ? high1 : subtracts1", "subtracts1"), "ftoi"),
    (("takt_alu", "b[4:0] <= 31 - i", "b[4:0] < 31 - i"), "ishr"),
    (("takt_sine", "quadrant3[1] ^ (quadrant3[0] & op3)", "quadrant3[1]"), "fcos"),
];

impl Bench {
    fn new() -> Bench {
        let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
        let program = program(&T1);
        let expected = emulate(&program, OPERANDS).expect("it runs");
        let text =
            wiring(&board, expected.cycles).expect("pins").replace("baud = 1000000", "baud = 5_000_000");
        let wiring = Wiring::read("selftest.toml", &text, &board).expect("a wiring");
        let mut files = top::circuit(&board, &wiring, &program).expect("a circuit").files;
        verilator::plant(&mut files, top::TOP, &FAULTS.map(|(fault, _)| fault))
            .unwrap_or_else(|error| panic!("{error}"));
        Bench { board, wiring, program, files, expected }
    }

    fn host(&self, fault: usize, is_wired: [bool; 2]) -> Host<Simulation> {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("selftest-{fault}-{is_wired:?}"));
        let sim = Simulation::with_fault(&self.files, &self.board, &self.wiring, &folder, fault);
        let mut sim = sim.unwrap_or_else(|error| panic!("{error}"));
        for (wire, _) in wires(&self.wiring).expect("wires").iter().zip(is_wired).filter(|(_, is)| *is) {
            let [from, to] = wire.names.each_ref().map(|name| name.replace('.', "_"));
            sim.wire(&from, &to);
        }
        Host::connect(sim, 1).expect("a board")
    }

    fn run(&self, host: &mut Host<Simulation>) -> Report {
        let options = Options { operands: OPERANDS, listen: Duration::ZERO };
        let report = run(host, &self.wiring, &self.program, &self.expected, options, |_| ());
        report.unwrap_or_else(|error| panic!("{error}"))
    }
}

fn different(report: &Report) -> Vec<&str> {
    report.digests.iter().filter(|(_, _, digest)| !digest.is_same()).map(|(name, ..)| &**name).collect()
}

#[test]
fn a_right_board_is_right_and_a_fault_is_named() {
    let bench = Bench::new();
    let report = bench.run(&mut bench.host(0, [true; 2]));
    assert!(report.is_right(), "{report:#?}");
    assert_eq!((report.operands, report.retries, report.digests.len()), (OPERANDS, 0, operations(&T1).len()));
    assert!(report.pulses.is_wired() && report.pulses.found >= 14 * 12, "{report:#?}");
    assert_eq!((report.words.found, report.words.expected), (14, 14));

    let mut host = bench.host(0, [true, false]);
    let report = bench.run(&mut host);
    assert!(report.is_right() && report.pulses.is_wired() && !report.words.is_wired(), "{report:#?}");
    // Again, on the same board; and as another kit.
    assert!(bench.run(&mut host).is_right());
    let other = Wiring { period: bench.wiring.period + 200, ..bench.wiring.clone() };
    let options = Options { operands: OPERANDS, listen: Duration::ZERO };
    let refused = run(&mut host, &other, &bench.program, &bench.expected, options, |_| ());
    assert!(matches!(refused, Err(SelftestError::Other { register: "period", .. })), "{refused:?}");
    // A wrong wire: the clock of the SPI in place of the PWM.
    host.line.wire("words_clock", "pulses_in");
    let report = bench.run(&mut host);
    assert!(different(&report).is_empty() && report.pulses.is_wired() && !report.is_right(), "{report:#?}");

    // Another program, whose registers may lie elsewhere.
    let mut host = bench.host(0, [true; 2]);
    let text = source(&T1, "")
        .expect("a source")
        .replace("result, a, b\n        fold    digest_fmul", "result, a, a\n        fold    digest_fmul");
    let other = assembled(&T1, &text);
    let expected = emulate(&other, OPERANDS).expect("it runs");
    let refused = run(&mut host, &bench.wiring, &other, &expected, options, |_| ());
    assert!(
        matches!(refused, Err(SelftestError::OtherProgram(_) | SelftestError::Other { .. })),
        "{refused:?}"
    );

    let found: Vec<Vec<String>> = (1..=FAULTS.len())
        .map(|fault| {
            let report = bench.run(&mut bench.host(fault, [false; 2]));
            let text = report.text(&bench.board, &bench.wiring, "t1", "0", 1).expect("a text");
            let is_named =
                different(&report).iter().all(|name| text.contains(&format!(" {name} DIFFERENT: 0x")));
            assert!(is_named && text.ends_with("NOT RIGHT\n"), "{text}");
            different(&report).into_iter().map(str::to_owned).collect()
        })
        .collect();
    // The random numbers are made by the ALU: a fault in it may show in all.
    let is_right = |(found, (_, name)): (&Vec<String>, &(_, &str))| {
        found.iter().any(|found| found == name) && (*name == "ishr" || found.len() < 6)
    };
    assert!(found.iter().zip(&FAULTS).all(is_right), "{found:?}");
}
