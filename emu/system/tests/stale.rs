// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stale reads of a FIFO's fields after its pop: reports against the emulator.

use std::collections::BTreeMap;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_isa::{F1, Program};
use takt_system::stale_reads::{Doubt, StaleRead, stale_reads};
use takt_system::testing::describe;
use takt_system::{Description, System};

fn program(text: &str) -> Program {
    let options = Options { machine: &F1, ..Options::default() };
    match assemble("a.s", &MemoryLoader::of("a.s", text), &options) {
        Ok(assembled) => assembled.program,
        Err(mistakes) => panic!("{}", mistakes.render(false)),
    }
}

/// Core that takes entries of three fields from the host.
fn receiver(text: &str) -> Description {
    let system = "tick = 400\n[[core]]\nname = \"a\"\nprogram = \"a\"\nmachine = \"f1\"\n[[fifo]]\nname = \"q\"\nfrom = \"host\"\nto = \"a\"\n\
         ports = [\"x\", \"y\", \"z\"]\ndepth = 8\npop = \"p\"\nreceiver = { count = \"n\" }\n[[wire]]\nfrom = \"a.u\"\nto = \"host.u\"\n\
         [[wire]]\nfrom = \"a.v\"\nto = \"host.v\"\n[[wire]]\nfrom = \"a.w\"\nto = \"host.w\"\n";
    let programs = BTreeMap::from([("a".to_owned(), program(text))]);
    describe(system, &programs).unwrap_or_else(|error| panic!("{error}"))
}

const HEAD: &str =
    ".input x:int, y:int, z:int, n:int\n.output u:int, v:int, w:int, p:int\n.once\n wait q\n.period\nq:\n";

fn doubts(description: &Description) -> Vec<(String, Doubt)> {
    let name = |read: &StaleRead| description.cores[read.core].program.register_text(read.field);
    stale_reads(description).iter().map(|read| (name(read), read.doubt)).collect()
}

/// For every distance from a pop to reads of all fields: while the emulator shows the old entry, no read is reported; a reported read may
/// get either entry's field; later reads get the next entry's.
#[test]
fn reported_stale_reads_equal_the_observed_ones() {
    let (mut old, mut between, mut new) = (0, 0, 0);
    for distance in 0..24 {
        let nops = " nop\n".repeat(distance);
        let description =
            receiver(&format!("{HEAD} mov p, zero\n{nops} mov u, x\n mov v, y\n mov w, z\n wait q\n"));
        let mut system = System::new(&description).unwrap();
        for entry in [[1, 1, 1], [2, 2, 2]] {
            for (field, value) in ["q.x", "q.y", "q.z"].into_iter().zip(entry) {
                system.set_input(field, value).unwrap();
            }
            system.push(description.link_named("q").unwrap()).unwrap();
        }
        let start = system.run_to_start(10_000).unwrap().unwrap();
        system.run_until(start + 200).unwrap();
        let seen = ["u", "v", "w"].map(|port| system.output(port).unwrap());
        let told = stale_reads(&description);
        for (i, name) in ["x", "y", "z"].into_iter().enumerate() {
            let is_told = told.iter().any(|read| {
                assert_eq!(read.doubt, Doubt::Between);
                description.cores[0].program.register_text(read.field) == name
            });
            match (seen[i], is_told) {
                (1, false) => old += 1,
                (2, false) => new += 1,
                (_, true) => between += 1,
                other => panic!("distance {distance}, {name}: {other:?}"),
            }
            // Unreported reads get the old entry before the pop, and the new one after it.
            let cycle = distance as u64 + i as u64;
            assert!(is_told || (seen[i] == 1) == (cycle < 12), "distance {distance}, {name}: {}", seen[i]);
        }
    }
    assert!(old > 0 && between > 0 && new > 0, "{old} {between} {new}");
}

/// The scheduler moves a read after the pop that follows it in the source.
#[test]
fn reports_reads_moved_after_the_pop() {
    // The use of `x` waits for a long chain, and the read with it.
    let late = |demand: &str| {
        receiver(&format!(
            ".schedule on\n{HEAD}.reg a:int\n iadd a, n, 1\n{} iadd v, a, x\n mov p, zero\n{demand} wait q\n",
            " iadd a, a, 1\n".repeat(12)
        ))
    };
    let moved = late("");
    assert_eq!(doubts(&moved), [("x".to_owned(), Doubt::Moved)]);
    let [read] = &stale_reads(&moved)[..] else { panic!("one") };
    let line = |location: Option<takt_isa::program::Location>| location.unwrap().line;
    assert!(line(read.read) < line(read.popped), "{read:?}");
    // Without the move there is nothing to report: in the order of the source, with `.order`, and with latched ports.
    assert_eq!(doubts(&late(".order x, p\n")), []);
    let written = format!("{HEAD} mov u, x\n mov v, y\n mov p, zero\n wait q\n");
    assert_eq!(doubts(&receiver(&written)), []);
}

/// Correct reads are not reported: entry after entry in one straight line, and a macro defined above.
#[test]
fn corrected_program_has_no_stale_read() {
    let entry = format!(" mov u, x\n mov v, y\n mov w, z\n mov p, zero\n{}", " nop\n".repeat(20));
    let rep = format!("{HEAD} .rep i, 1, 2\n{entry} .endr\n wait q\n");
    assert_eq!(doubts(&receiver(&rep)), []);
    let used =
        format!(".macro take\n mov u, x\n.endm\n{HEAD} mov p, zero\n{} take\n wait q\n", " nop\n".repeat(20));
    assert_eq!(doubts(&receiver(&used)), []);
}
