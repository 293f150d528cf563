// SPDX-License-Identifier: MIT OR Apache-2.0
//! Software pipelining: a pipelined loop computes the same bits as the loop as written.

use proptest::prelude::*;
use std::fmt::Write as _;
use takt_asm::{AssembledProgram, MemoryLoader, Options, Schedule, assemble};
use takt_emu::{Emulator, Fault, FaultKind, Stop};
use takt_isa::{MACHINES, Machine, Op, Program, T4};

fn assembled(source: &str, machine: &'static Machine, schedule: Schedule) -> AssembledProgram {
    // The search for short blocks is not under test.
    let options = Options { machine, schedule, effort: 1, ..Options::default() };
    match assemble("loop.s", &MemoryLoader::of("loop.s", source), &options) {
        Ok(assembled) => assembled,
        Err(mistakes) => panic!("{}\n{source}", mistakes.render(false)),
    }
}

/// Memory and outputs where the program halts, and the cycle of the halt.
fn outcome(assembled: &AssembledProgram) -> (Vec<u32>, Vec<Option<u32>>, u64) {
    let mut emulator = Emulator::new(&assembled.program).expect("it fits");
    emulator.set_cycle_limit(1_000_000);
    assert_eq!(emulator.run(), Ok(Stop::Halted));
    observed(&assembled.program, &emulator)
}

fn observed(program: &Program, emulator: &Emulator) -> (Vec<u32>, Vec<Option<u32>>, u64) {
    let outputs = program.outputs.iter().map(|port| emulator.output_bits(port.register));
    (emulator.memory().to_vec(), outputs.collect(), emulator.now())
}

/// The same, unless the program's pointers leave the data memory.
fn outcome_within_memory(assembled: &AssembledProgram) -> Option<(Vec<u32>, Vec<Option<u32>>, u64)> {
    let mut emulator = Emulator::new(&assembled.program).expect("it fits");
    emulator.set_cycle_limit(1_000_000);
    match emulator.run() {
        Err(Fault { kind: FaultKind::DataAddress { .. }, .. }) => None,
        ended => {
            assert_eq!(ended, Ok(Stop::Halted));
            Some(observed(&assembled.program, &emulator))
        }
    }
}

fn operation_text((kind, d, a, b, c): (u8, u8, u8, u8, u8), steps: [i32; 2], text: &mut String) {
    let (d, a, b) = (d % 6, a % 6, b % 6);
    let (table, pointer) = (if c & 1 == 0 { "t" } else { "u" }, if c & 2 == 0 { "i" } else { "j" });
    let offset = c >> 2 & 7;
    let _ = match kind % 10 {
        0 => writeln!(text, "fadd f{d}, f{a}, f{b}"),
        1 => writeln!(text, "fmul f{d}, f{a}, f{b}"),
        2 => writeln!(text, "fsub f{d}, f{a}, f{d}"),
        3 | 4 => writeln!(text, "ld f{d}, ({table}+{offset})[{pointer}]"),
        5 => writeln!(text, "st ({table}+{offset})[{pointer}], f{a}"),
        6 => writeln!(text, "mov {}, f{a}", if c & 4 == 0 { "y" } else { "z" }),
        7 => writeln!(text, "st t+{offset}, f{a}"),
        8 => writeln!(text, "ld f{d}, t+{offset}"),
        _ => writeln!(text, "iadd {pointer}, {pointer}, {}", steps[usize::from(c & 2 != 0)]),
    };
}

/// Two loops over tables of 64 words with two pointers. Their count is a constant or, if it is not `known`, loaded. The code after
/// the first loop runs `again` times, from the label at its end.
fn source(count: u32, known: bool, again: u8, steps: [i32; 2], body: &[(u8, u8, u8, u8, u8)]) -> String {
    let mut text = String::from(
        ".output y, z\n.reg f0 f1 f2 f3 f4 f5 i:int j:int n:int left:int\n.data\nguard: .space 200\nt: .rep k, 1, 64\n.float k/3\n.endr\nu: .rep k, 1, 64\n.float 1/k\n.endr\nend: .space 200\n",
    );
    let _ = writeln!(text, "count: .word {count}\n.once\nld n, count\nli left, {again}");
    for r in 0..6 {
        let _ = writeln!(text, "mov f{r}, {}.5", r + 1);
    }
    text.push_str("li i, 0\nli j, 3\nmov y, zero\nmov z, zero\n");
    // The second loop begins right after the first.
    for (label, body) in [("done", body), ("end_of_all", &body[body.len() / 2..])] {
        let _ = match known {
            true => writeln!(text, "loop {count}, {label}"),
            false => writeln!(text, "loop n, {label}\n.loop_bound 20"),
        };
        body.iter().for_each(|operation| operation_text(*operation, steps, &mut text));
        let _ = writeln!(text, "iadd i, i, 1\nfadd f0, f0, f1\n{label}:");
    }
    text.push_str("isub left, left, 1\nbnz left, done\nfadd y, f0, f2\nfadd z, f3, f4\nst guard, f5\nhalt\n");
    text
}

proptest! {
    #![proptest_config(ProptestConfig { cases: crate::common::programs(25, 100) as u32, ..ProptestConfig::default() })]

    /// Values and memory are the same as after the loop as written, on every machine that counts loops.
    #[test]
    fn as_written(
        count in 1u32..20,
        known: bool,
        again in 1u8..3,
        steps in [-2i32..3, -2i32..3],
        body in prop::collection::vec(any::<(u8, u8, u8, u8, u8)>(), 0..24),
    ) {
        let source = source(count, known, again, steps, &body);
        for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
            // Pointers that go down in many places of a body pass the guard.
            let Some(written) = outcome_within_memory(&assembled(&source, machine, Schedule::None)) else {
                return Err(TestCaseError::reject("a pointer leaves the data memory"));
            };
            let pipelined = assembled(&source, machine, Schedule::All);
            // Some iterations lie outside of the kernel.
            prop_assert!(pipelined.program.loop_bounds.iter().all(|bound| bound.most <= 20), "{}", source);
            let pipelined = outcome(&pipelined);
            prop_assert_eq!((&written.0, &written.1), (&pipelined.0, &pipelined.1), "{}\n{}", machine.name, source);
        }
    }
}

/// A sum of products with two words a product to load: the data memory is the bound, and it is reached.
#[test]
fn memory_is_the_bound() {
    let mut text = String::from(
        ".output y\n.reg s0 s1 s2 s3 i:int\n.data\na: .rep k, 1, 256\n.float k\n.endr\nb: .rep k, 1, 256\n.float 1/k\n.endr\n.once\nli i, 0\n",
    );
    for s in 0..4 {
        let _ = writeln!(text, "mov s{s}, zero");
    }
    text.push_str("loop 32, done\n");
    for k in 0..8 {
        let _ = writeln!(
            text,
            ".reg p{k} q{k}\nld p{k}, (a+{k})[i]\nld q{k}, (b+{k})[i]\nfmul p{k}, p{k}, q{k}\nfadd s{0}, s{0}, p{k}",
            k % 4
        );
    }
    text.push_str("iadd i, i, 8\ndone:\nfadd s0, s0, s1\nfadd s2, s2, s3\nfadd y, s0, s2\nhalt\n");
    for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
        let written = assembled(&text, machine, Schedule::None);
        let pipelined = assembled(&text, machine, Schedule::All);
        assert_eq!(outcome(&written).1, outcome(&pipelined).1);
        assert!(2 * outcome(&pipelined).2 < outcome(&written).2, "{}", machine.name);
        // A single slot is full without overlap, too.
        if machine.slots.len() > 1 {
            let report = pipelined.loops.first().expect("it is pipelined");
            assert!(report.interval <= report.bound.cycles() + 2, "{}: {report:?}", machine.name);
        }
    }
}

/// A loop that loads and stores by one pointer.
const POINTER: &str = ".data\nt: .rep k, 1, 40\n.float k/3\n.endr\nu: .space 40\n.reg f i:int\n.once\nli i, 0\nloop 40, done\n\
                       ld f, (t)[i]\nfmul f, f, 0.5\nfadd f, f, 1.0\nst (u)[i], f\niadd i, i, 1\ndone:\nhalt\n";

/// No access waits for an advance of its pointer, since another offset makes up for it: an iteration waits only for the slowest value of
/// the previous iteration, until that is written and read.
#[test]
fn a_pointer_is_no_recurrence() {
    for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
        let pipelined = assembled(POINTER, machine, Schedule::All);
        assert_eq!(outcome(&pipelined).0, outcome(&assembled(POINTER, machine, Schedule::None)).0);
        let report = pipelined.loops.first().expect("it is pipelined");
        let functions = [Op::ld, Op::fmul, Op::fadd].map(|op| op.row().function);
        let units = functions.into_iter().filter_map(|function| machine.host(function));
        let slowest = units.map(|(_, unit)| unit.latency).max();
        assert_eq!(Some(report.bound.recurrence), slowest, "{}: {report:?}", machine.name);
    }
}

/// A value that a loop's body writes first, and that the code after the loop reads last.
#[test]
fn the_last_value_is_read_behind_the_loop() {
    let text = POINTER
        .replace(".reg", ".output y\n.reg g")
        .replace("fadd f, f, 1.0\nst (u)[i], f", "fadd g, f, 1.0\nst (u)[i], g");
    let text = text.replace("done:\n", "done:\nfadd y, g, g\n");
    for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
        let (written, pipelined) =
            (assembled(&text, machine, Schedule::None), assembled(&text, machine, Schedule::All));
        assert_eq!(pipelined.loops.len(), 1, "{}", machine.name);
        assert_eq!(outcome(&pipelined).1, outcome(&written).1, "{}", machine.name);
    }
}

/// Operations of one cycle of the kernel are put in its prologue so that each reads before another writes, and is scheduled by itself.
/// In bundles, which keep together, they take a cycle more.
#[test]
fn a_prologue_is_no_row_of_bundles() {
    let (_, _, cycles) = outcome(&assembled(POINTER, &T4, Schedule::All));
    assert!(cycles <= 264, "{cycles} cycles, 264 before");
}

/// A recurrence over several iterations: the load of an iteration waits for the store of an iteration a fixed number before. The way
/// from load to store is longer than the interval of a loop that did not wait.
#[test]
fn stored_values_are_loaded_iterations_later() {
    let data = ".data\nt: .rep k, 1, 64\n.float k/3\n.endr\n.reg f i:int j:int\n.once\n";
    let array = ".array x[64]\n.reg f\n.once\n.for k, 1, 64\nx[k] = itof(k)\n.endfor\n";
    let chain = "fmul f, f, 0.5\nfadd f, f, 1.0\nfmul f, f, f\nfsub f, f, 3.0\n";
    for gap in 2..=7 {
        for step in [1, 2] {
            let far = gap * step;
            let count = (62 - far) / step;
            let up = format!(
                "{data}li i, 0\nloop {count}, done\nld f, (t)[i]\n{chain}st (t+{far})[i], f\niadd i, i, {step}\ndone:\nhalt\n"
            );
            let down = format!(
                "{data}li i, 62\nloop {count}, done\nld f, (t)[i]\n{chain}isub j, i, {far}\nst (t)[j], f\nisub i, i, {step}\n\
                 done:\nhalt\n"
            );
            let elements = format!(
                "{array}.for k, 1, {} step {step} unroll 1\nf = x[k]\n{chain}x[k+{far}] = f\n.endfor\nhalt\n",
                64 - far
            );
            for text in [up, down, elements] {
                for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
                    let written = outcome(&assembled(&text, machine, Schedule::None)).0;
                    let pipelined = outcome(&assembled(&text, machine, Schedule::All)).0;
                    let differs =
                        written.iter().zip(&pipelined).position(|(written, pipelined)| written != pipelined);
                    assert_eq!(differs, None, "a word of memory, {gap}, {step} on {}:\n{text}", machine.name);
                }
            }
        }
    }
}

/// A count that is known only at run time: the loop is there twice, and pipelining pays for many iterations, where an iteration
/// costs an interval.
#[test]
fn run_time_counts_are_pipelined_for_many_iterations() {
    let data = "count: .word COUNT\n.reg n:int ";
    let varying = POINTER
        .replace(".reg ", data)
        .replace("li i, 0\nloop 40, done", "li i, 0\nld n, count\nloop n, done\n.loop_bound 40");
    for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
        let of = |count: u32, schedule| {
            let assembled = assembled(&varying.replace("COUNT", &count.to_string()), machine, schedule);
            (outcome(&assembled), assembled)
        };
        let ends = [1, 2, 3, 20, 30, 40].map(|count| {
            let ((memory, _, cycles), pipelined) = of(count, Schedule::All);
            let (written, _) = of(count, Schedule::None);
            assert_eq!(memory, written.0, "{count} iterations on {}", machine.name);
            let report = pipelined.loops.first().expect("it is pipelined");
            // Half of the largest count pays, too.
            assert!(count < 20 || cycles < written.2, "{count} iterations on {}", machine.name);
            (u64::from(report.interval), cycles)
        });
        let [.., (_, twenty), (interval, thirty), (_, forty)] = ends;
        assert_eq!([thirty - twenty, forty - thirty], [10 * interval; 2], "{}", machine.name);
    }
}

/// Each iteration takes one interval, even if accesses are close to the advances of their pointers, for whose results they would wait.
#[test]
fn an_iteration_takes_an_interval() {
    let bodies = [
        "ld f, (t)[i]\niadd i, i, 1\nfadd f, f, 1.0\nst (u)[i], f\n",
        "iadd i, i, 1\nld f, (t)[i]\nfadd f, f, 1.0\nst (u)[i], f\n",
        "ld f, (t)[i]\nld g, (u+1)[j]\niadd i, i, 1\nfadd f, f, g\nst (u)[j], f\niadd j, j, 1\n",
        "iadd j, j, 1\nld f, (t)[i]\nfmul f, f, f\nld g, (u)[j]\nfadd f, f, g\nst (t)[j], f\niadd i, i, 1\n",
    ];
    let text = |count: u32, body: &str| {
        format!(
            ".data\nt: .rep k, 1, 50\n.float k/3\n.endr\nu: .space 50\n.reg f g i:int j:int\n.once\nli i, 0\nli j, 0\n\
             loop {count}, done\n{body}done:\nhalt\n"
        )
    };
    let mut stages = Vec::new();
    for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
        for body in bodies {
            let [twenty, thirty] = [20, 30].map(|count| {
                let text = text(count, body);
                let pipelined = assembled(&text, machine, Schedule::All);
                let (memory, _, cycles) = outcome(&pipelined);
                let written = outcome(&assembled(&text, machine, Schedule::None)).0;
                assert_eq!(memory, written, "{}:\n{text}", machine.name);
                (cycles, pipelined.loops.first().map(|report| (report.stages, u64::from(report.interval))))
            });
            if let (Some((count, interval)), Some(_)) = (twenty.1, thirty.1) {
                assert_eq!(thirty.0 - twenty.0, 10 * interval, "{}:\n{body}", machine.name);
                stages.push(count);
            }
        }
    }
    // In some of them, two iterations at a time are enough.
    assert!(stages.len() >= bodies.len() && stages.contains(&2), "{stages:?}");
}

/// Each set of slots has a bound: the operations that only it can issue.
#[test]
fn sets_of_slots_bound_the_interval() {
    let text = POINTER.replace("fadd f, f, 1.0\n", &"fmul f, f, f\n".repeat(6));
    for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
        let pipelined = assembled(&text, machine, Schedule::All);
        let report = pipelined.loops.first().expect("it is pipelined");
        let able = machine.hosts(Op::fmul.row().function);
        let products = report.bound.slots.iter().find(|(slots, _)| *slots == able);
        assert_eq!(report.bound.slots.len(), (1 << machine.slots.len()) - 1, "{}", machine.name);
        assert!(
            products.is_some_and(|(_, cycles)| *cycles >= 7u32.div_ceil(able.len() as u32)),
            "{}: {report:?}",
            machine.name
        );
    }
}

/// A port with a demand has one known cycle; in a loop it would have a cycle for each iteration.
#[test]
fn a_loop_with_a_demanded_port_stays_as_written() {
    let text = POINTER.replace(".reg", ".input x\n.reg").replace("fadd f, f, 1.0", "fadd f, f, x");
    for machine in MACHINES.iter().filter(|machine| machine.loop_depth > 0) {
        assert_eq!(assembled(&text, machine, Schedule::All).loops.len(), 1, "{}", machine.name);
        let late = text.replace(".once", ".once\n.late x = 3");
        let plain = assembled(&late, machine, Schedule::All);
        assert!(plain.loops.is_empty(), "{}", machine.name);
        let reasons: Vec<&str> = plain.plain_loops.iter().map(|plain| plain.reason.as_str()).collect();
        assert_eq!(reasons, ["its body reads or writes a port with a demand"], "{}", machine.name);
    }
}
