// SPDX-License-Identifier: MIT OR Apache-2.0
//! Debug session 10⁸ cycles from the start: steps and searches backwards, compared with the time of the run itself.
#![allow(missing_docs, clippy::print_stdout)]

use criterion::Criterion;
use takt_asm::{MemoryLoader, Options as AsmOptions};
use takt_benches::FastestTimes;
use takt_debug::session::{BreakpointLocation, Options, Session, Stop, StopReason, Unit};
use takt_isa::{BundleAddress, Program};

/// An endless loop with a counter; the branch to `rare` is never taken.
const SOURCE: &str = ".output n:int rare_seen\n.reg t:int\n        mov n, zero\nloop:   iadd n, n, 1\n        ieq t, n, zero\n        \
                      bnz t, rare\n        jmp loop\nrare:   fadd rare_seen, zero, zero\n        jmp loop\n";
const CYCLES: u64 = 100_000_000;

fn session(program: &Program) -> Session {
    Session::new(program, Options::default()).expect("it fits the machine")
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let loader = MemoryLoader::new(&[("loop.s", SOURCE)]);
    let program = takt_asm::assemble("loop.s", &loader, &AsmOptions::default()).expect("it is ours").program;
    let rare = program.symbols.iter().find(|symbol| symbol.name == "rare").expect("it is there").address;
    let mut group = FastestTimes::new(&mut criterion, "debugger");

    let run = group.seconds("run 10^8 cycles", CYCLES, || session(&program).go_to(CYCLES));
    let mut there = session(&program);
    assert_eq!(there.go_to(CYCLES), StopReason::Done);
    let mut rows = Vec::new();
    for (name, unit) in [("cycle", Unit::Cycle), ("bundle", Unit::Bundle), ("line", Unit::Line)] {
        // Positions spread over the run, between checkpoints: a step back replays the cycles since the checkpoint before.
        let mut at = 0;
        let seconds = group.seconds(&format!("back a {name}, anywhere"), 1, || {
            at = (at + 37_000_003) % CYCLES;
            assert_eq!(there.go_to(1 + at), StopReason::Done);
            there.step_back(unit)
        });
        rows.push((format!("go anywhere, back a {name}"), seconds));
    }
    assert_eq!(there.go_to(CYCLES), StopReason::Done);
    there.add_stop(Stop::Break {
        at: BreakpointLocation::Bundle(BundleAddress::new(rare)),
        condition: None,
        text: String::new(),
    });
    let seconds = group.seconds("reverse through 10^8 cycles", CYCLES, || {
        there.go_to(CYCLES);
        assert_eq!(there.resume_back(), StopReason::Start);
    });
    rows.push(("reverse through everything".to_owned(), seconds));

    println!("\n{:<36}{:>14}{:>20}", "10^8 cycles from the beginning", "seconds", "of the run's time");
    println!("{:<36}{run:>14.4}{:>20.4}", "the run", 1.0);
    for (name, seconds) in rows {
        println!("{name:<36}{seconds:>14.4}{:>20.4}", seconds / run);
    }
}
