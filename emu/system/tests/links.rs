// SPDX-License-Identifier: MIT OR Apache-2.0
//! Each kind of link by itself: the cycle in which each side sees a value, as docs/system.md defines it.

use std::collections::BTreeMap;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_isa::{F1, Program};
use takt_system::testing::describe;
use takt_system::{Description, LinkEventKind, System};

fn program(text: &str) -> Program {
    let options = Options { machine: &F1, ..Options::default() };
    match assemble("p.s", &MemoryLoader::of("p.s", text), &options) {
        Ok(assembled) => assembled.program,
        Err(mistakes) => panic!("{}", mistakes.render(false)),
    }
}

fn system(text: &str, programs: &[(&str, &str)]) -> Description {
    let programs: BTreeMap<String, Program> =
        programs.iter().map(|(name, text)| ((*name).to_owned(), program(text))).collect();
    describe(text, &programs).unwrap_or_else(|error| panic!("{error}"))
}

/// Program that counts its periods on `n`.
const COUNT: &str = ".output n:int\n.state c:int\n.once\n mov c, zero\n mov n, zero\n wait p\n.period\np: iadd c, c, 1\n nop\n nop\n nop\n nop\n nop\n mov n, c\n wait p\n";
/// Program that shows its input `i` in each period on `o`.
const SHOW: &str =
    ".input i:int\n.output o:int\n.once\n mov o, zero\n wait p\n.period\np: mov o, i\n wait p\n";

fn pair(link: &str, offset: u64) -> Description {
    let text = format!(
        "tick = 200\n[[core]]\nname = \"a\"\nprogram = \"a\"\nmachine = \"f1\"\n[[core]]\nname = \"b\"\nprogram = \"b\"\n\
         machine = \"f1\"\noffset = {offset}\n{link}\n[[wire]]\nfrom = \"b.o\"\nto = \"host.o\"\n"
    );
    system(&text, &[("a", COUNT), ("b", SHOW)])
}

#[test]
fn a_wire_is_read_from_its_latency_on() {
    // Delay of the write of `n` after the tick; `b` reads `i` in the cycle after its own tick.
    let mut seen = Vec::new();
    for offset in 0..40 {
        let description = pair("[[wire]]\nfrom = \"a.n\"\nto = \"b.i\"\nlatency = 10\n", offset);
        let mut system = System::new(&description).unwrap();
        let start = system.run_to_start(10_000).unwrap().unwrap();
        system.run_until(start + 150).unwrap();
        seen.push(system.output("o").unwrap());
    }
    // `mov n` issues at the tick + 9 (when `c` is ready), is written 8 cycles later, and read 10 after that: at 27, by the bundle that
    // issues one cycle after the tick of offset 26.
    let first = seen.iter().position(|&value| value == 1).unwrap();
    assert_eq!(first, 26);
    assert!(seen[..first].iter().all(|&value| value == 0) && seen[first..].iter().all(|&value| value == 1));
}

#[test]
fn a_snapshot_is_taken_before_the_tick() {
    let mut seen = Vec::new();
    for offset in 0..60 {
        let link =
            "[[snapshot]]\nname = \"s\"\nfrom = \"a\"\nto = \"b\"\nports = [\"n -> i\"]\nlatency = 10\n";
        let description = pair(link, offset);
        let mut system = System::new(&description).unwrap();
        let start = system.run_to_start(10_000).unwrap().unwrap();
        system.run_until(start + 150).unwrap();
        seen.push(system.output("o").unwrap());
    }
    // The `wait` issues when `n` is written, at 17: T >= 17 + 10 + 1 + 1.
    assert_eq!(seen.iter().position(|&value| value == 1), Some(29));
}

#[test]
fn fifo_keeps_the_order_and_counts_refusals() {
    // Core `a` pushes its count in every period, `b` pops an entry in every third.
    let push = COUNT
        .replace(".output n:int", ".output n:int, push:int")
        .replace(" mov n, c\n", " mov n, c\n mov push, c\n");
    let take = ".input i:int, e:int\n.output o:int, pop:int\n.once\n mov o, zero\n wait p\n.period\np: bnz e, no\n mov o, i\n mov pop, zero\nno: wait p\n";
    let text = "tick = 200\n[[core]]\nname = \"a\"\nprogram = \"a\"\nmachine = \"f1\"\n[[core]]\nname = \"b\"\nprogram = \"b\"\n\
                machine = \"f1\"\ntick = 3\n[[fifo]]\nname = \"q\"\nfrom = \"a\"\nto = \"b\"\ndepth = 4\nports = [\"n -> i\"]\npush = \"push\"\npop = \"pop\"\n\
                receiver = { empty = \"e\" }\n[[wire]]\nfrom = \"b.o\"\nto = \"host.o\"\n";
    let description = system(text, &[("a", &push), ("b", take)]);
    let mut system = System::new(&description).unwrap();
    system.keep_events();
    let start = system.run_to_start(10_000).unwrap().unwrap();
    let mut taken = Vec::new();
    for period in 1..=10 {
        system.run_until(start + 600 * period - 1).unwrap();
        taken.push(system.output("o").unwrap());
    }
    let fifo = description.link_named("q").unwrap();
    let counts = system.fifo_counts(fifo).unwrap();
    assert_eq!(counts.pushed - counts.popped, system.fifo_entries(fifo).len() as u64);
    assert_eq!(counts.pushed + counts.overflows, 30);
    assert_eq!((counts.most, counts.underflows), (4, 0));
    // Empty at the first tick; then entries in order, without the refused ones.
    assert_eq!(taken[..4], [0, 1, 2, 3]);
    assert!(taken.windows(2).all(|pair| pair[0] < pair[1]), "{taken:?}");
    let refused = system.take_events().iter().filter(|event| event.kind == LinkEventKind::Overflow).count();
    assert_eq!(refused as u64, counts.overflows);
}
