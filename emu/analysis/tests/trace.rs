// SPDX-License-Identifier: MIT OR Apache-2.0
//! Traces against the emulator's statistics.

use takt_analysis::{Trace, static_issue, trace};
use takt_asm::{MemoryLoader, Options, assemble};
use takt_emu::Emulator;
use takt_emu::testing::{self, Random, random_program};
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{MACHINES, Program};

/// Checks the invariants of every trace.
fn check(program: &Program, trace: &Trace) {
    let stalled: Cycle =
        trace.issues.iter().flat_map(|issue| &issue.stalls).map(|(_, cycles)| Cycle::from(*cycles)).sum();
    assert_eq!(trace.cycles, trace.issues.len() as Cycle + stalled, "every cycle issued or is charged");
    assert_eq!(trace.replayed(program), trace.cycles);
    let chain = trace.critical_path(program);
    let (first, last) = (&trace.issues[0], trace.issues.last().unwrap());
    assert_eq!(chain.iter().map(|link| link.cycles).sum::<Cycle>(), last.cycle - first.cycle);
    assert!(chain.windows(2).all(|pair| pair[0].to == pair[1].from), "a chain");
}

#[test]
fn traces_account_for_every_cycle() {
    let mut gains = 0;
    for machine in MACHINES {
        for seed in 0..200 {
            let program = random_program(seed, machine, testing::Options::TAME);
            let mut emulator = Emulator::new(&program).unwrap();
            let mut random = Random::new(seed);
            for input in testing::input_ports(machine) {
                emulator.set_input_bits(input, random.word()).unwrap();
            }
            let once = trace(&mut emulator).unwrap();
            assert_eq!(once.cycles, emulator.now());
            check(&program, &once);
            let mut other = emulator.clone();
            let Ok(period) = trace(&mut emulator) else { continue };
            check(&program, &period);
            if let Ok(report) = other.run_period(&[]) {
                assert_eq!((report.cycles, Some(report.tick)), (period.cycles, period.tick), "seed {seed}");
            }
            gains += period.what_if(&program).iter().filter(|what| what.cycles < period.cycles).count();
        }
    }
    assert!(gains > 500, "{gains}");
}

#[test]
fn the_tracking_program_waits_for_its_units() {
    for machine in MACHINES {
        let options = Options { machine, ..Options::default() };
        let loader = MemoryLoader::new(takt_programs::SOURCES);
        let program = assemble("hybrid/tracking.s", &loader, &options).unwrap().program;
        let mut emulator = Emulator::new(&program).unwrap();
        for port in &program.inputs {
            emulator.set_input_bits(port.register, 0).unwrap();
        }
        emulator.run_period(&[]).unwrap();
        let period = trace(&mut emulator).unwrap();
        check(&program, &period);
        for what in period.what_if(&program) {
            // A faster unit may cost cycles, because its results conflict with others at the write port.
            assert!(what.cycles.abs_diff(period.cycles) < 60, "{what:?} {}", period.cycles);
            // The additional cycles are stalls with a named cause, except in the front end.
            let more: i64 = what.stalls.iter().sum();
            if what.unit.is_some() {
                assert_eq!(period.cycles.cast_signed() + more, what.cycles.cast_signed(), "{what:?}");
            }
            let write_port = what.stalls[Cause::KINDS.iter().position(|kind| *kind == "write port").unwrap()];
            // (A single cycle may be charged to another kind: the delayed operation delays others.)
            assert!(what.cycles <= period.cycles + 1 || write_port > 0, "{what:?}");
        }
    }
}

/// Loops have their own iterations and cycles, closed by a branch or by the hardware; a call closes none.
#[test]
fn loops_are_found_with_their_turns() {
    let source = "
.input x
.output y
.reg a n:int
.period
start:
    mov a, x
    li n, 3
    .loop_bound 3
again:
    fmul a, a, x
    call half
    isub n, n, 1
    bnz n, again
    mov y, a
    wait start
half:
    fadd a, a, x
    ret
";
    let loader = MemoryLoader::new(&[("a.s", source)]);
    let options = Options { machine: MACHINES[0], ..Options::default() };
    let program = match assemble("a.s", &loader, &options) {
        Ok(assembled) => assembled.program,
        Err(mistakes) => panic!("{}", mistakes.render(false)),
    };
    let mut emulator = Emulator::new(&program).unwrap();
    for port in &program.inputs {
        emulator.set_input_bits(port.register, 1f32.to_bits()).unwrap();
    }
    let period = trace(&mut emulator).unwrap();
    let [found] = &period.loops(&program)[..] else { panic!("{:?}", period.loops(&program)) };
    assert_eq!(program.nearest_label(found.first), Some(("again", 0)));
    assert_eq!(found.turns, 3);
    assert!(found.cycles < period.cycles && found.stalled < found.cycles && found.stalled > 0, "{found:?}");
}

/// Straight lines: the static prediction issues each block's last bundle in the cycle that the scheduler gives, and accounts for every
/// stall.
#[test]
fn straight_lines_issue_as_scheduled() {
    for machine in MACHINES {
        let loader = MemoryLoader::new(takt_programs::SOURCES);
        let options = Options { machine, ..Options::default() };
        let assembled = assemble("hybrid/tracking.s", &loader, &options).expect("it assembles");
        let issues = static_issue(&assembled.program);
        assert_eq!(issues.len(), assembled.program.bundles() as usize);
        for block in assembled.blocks.iter().filter(|block| block.bundles > 1) {
            let last = &issues[block.address.index() + block.bundles as usize - 1];
            if last.from == block.address {
                assert_eq!(last.cycle, u64::from(block.cycles), "{} {:?}", machine.name, block.label);
            }
        }
        let period =
            assembled.program.sections.iter().find(|section| section.name == "period").expect("it has one");
        assert!(issues[period.end.index() - 1].from == period.start);
        for issue in &issues {
            let stalled: u64 = issue.stalls.iter().map(|(_, cycles)| u64::from(*cycles)).sum();
            let before =
                issues.get(issue.address.index().wrapping_sub(1)).filter(|before| before.from == issue.from);
            assert!(before.is_none_or(|before| before.cycle + stalled < issue.cycle));
        }
    }
}
