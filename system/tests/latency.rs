//! Bounds from a command of the host to an output, against what the emulator shows for commands in every cycle.

use std::collections::BTreeMap;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_isa::T1;
use takt_system::latency::latencies;
use takt_system::testing::describe;
use takt_system::{Description, System};

/// Cycles of a base tick.
const TICK: u64 = 400;

/// Reads its input at the end of a period of nearly 200 cycles.
const AT_END: &str = ".input i:int\n.output o:int\n.reg x\n.once\n mov o, zero\n mov x, zero\n wait p\n.period\np: nop\n\
                      .rep n, 1, 10\n fdiv x, x, 1.0\n.endr\n mov o, i\n wait p\n";
/// Reads it at once.
const SHOW: &str =
    ".input i:int\n.output o:int\n.once\n mov o, zero\n wait p\n.period\np: mov o, i\n wait p\n";

/// A command goes over a wire to one core and over a link to another, whose tick is `offset` cycles later.
fn pair(first: &str, link: &str, every: u64, offset: u64) -> Description {
    let text = format!(
        "tick = {TICK}\n[[core]]\nname = \"a\"\nprogram = \"a\"\nmachine = \"t1\"\n[[core]]\nname = \"b\"\nprogram = \"b\"\n\
         machine = \"t1\"\ntick = {every}\noffset = {offset}\n{link}\n[[wire]]\nfrom = \"host.i\"\nto = \"a.i\"\n\
         [[wire]]\nfrom = \"b.o\"\nto = \"host.o\"\n"
    );
    let program = |text: &str| {
        let options = Options { machine: &T1, ..Options::default() };
        assemble("p.s", &MemoryLoader::of("p.s", text), &options).unwrap_or_else(|e| panic!("{e:?}")).program
    };
    let programs = BTreeMap::from([("a".to_owned(), program(first)), ("b".to_owned(), program(SHOW))]);
    describe(&text, &programs).unwrap_or_else(|error| panic!("{error}"))
}

/// The least and the most cycles of a command, given in any cycle of so many base ticks.
fn measured(description: &Description, ticks: u64) -> (u64, u64) {
    let mut cycles = Vec::new();
    for command in 0..ticks * TICK {
        let mut system = System::new(description).expect("it can be emulated");
        let start = system.run_to_start(10_000).expect("no fault").expect("it starts") + TICK + command;
        system.run_until(start).expect("no fault");
        system.set_input("i", 1).expect("an input");
        let shows = |cycle: &u64| {
            system.run_until(start + cycle).expect("no fault");
            system.output("o").expect("an output") == 1
        };
        cycles.push((1..10 * TICK).find(shows).expect("it follows"));
    }
    (*cycles.iter().min().expect("some"), *cycles.iter().max().expect("some"))
}

#[test]
fn no_command_takes_fewer_cycles_or_more() {
    let snapshot = "[[snapshot]]\nname = \"s\"\nfrom = \"a\"\nto = \"b\"\nports = [\"o -> i\"]\n";
    let wire = "[[wire]]\nfrom = \"a.o\"\nto = \"b.i\"\nlatency = 7\n";
    let latched = format!(".ports latched\n{SHOW}");
    let cases = [
        // In a period that is under way, just before the snapshot is taken.
        (AT_END, snapshot, 1, 230),
        (AT_END, wire, 1, 230),
        (AT_END, wire, 2, 50),
        (&latched, snapshot, 1, 230),
        (&latched, wire, 2, 10),
        (SHOW, wire, 1, 0),
    ];
    for (first, link, every, offset) in cases {
        let description = pair(first, link, every, offset);
        let bounds: Vec<_> = description
            .cores
            .iter()
            .map(|core| takt_analysis::bound(&core.program).expect("it can be bounded"))
            .collect();
        let way = latencies(&description, &bounds).expect("there is a bound").remove(0);
        let (least, most) = measured(&description, every);
        assert!(way.best <= least && most <= way.worst, "{least} to {most}, and not {way:?}");
        // The best has a core read in the last cycle of a period, the worst in the first.
        if first == AT_END && link == snapshot {
            assert!(least <= way.best + 24, "{least}, and not {}", way.best);
        } else if first != AT_END {
            assert!(way.worst <= most + 12, "{most}, and not {}", way.worst);
        }
    }
}
