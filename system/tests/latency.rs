//! Bounds from a command of the host to an output, against what the emulator shows for commands in every cycle.

use std::collections::BTreeMap;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_isa::{Program, T1};
use takt_system::latency::{LatencyError, MAX_PHASES, MAX_STEPS, latencies};
use takt_system::testing::describe;
use takt_system::{Description, System};

/// Cycles of a base tick.
const TICK: u64 = 400;

/// Reads its input at the end of a period of more than 200 cycles.
const AT_END: &str = ".input i:int\n.output o:int\n.reg x\n.once\n mov o, zero\n mov x, zero\n wait p\n.period\np: nop\n\
                      .rep n, 1, 10\n fdiv x, x, 1.0\n.endr\n mov o, i\n wait p\n";
/// Reads it at once.
const SHOW: &str =
    ".input i:int\n.output o:int\n.once\n mov o, zero\n wait p\n.period\np: mov o, i\n wait p\n";

fn program(text: &str) -> Program {
    let options = Options { machine: &T1, ..Options::default() };
    assemble("p.s", &MemoryLoader::of("p.s", text), &options).unwrap_or_else(|e| panic!("{e:?}")).program
}

/// A command goes over a wire to one core and over a link to another, whose tick is `offset` cycles later.
fn pair(first: &str, link: &str, every: u64, offset: u64) -> Description {
    let text = format!(
        "tick = {TICK}\n[[core]]\nname = \"a\"\nprogram = \"a\"\nmachine = \"t1\"\n[[core]]\nname = \"b\"\nprogram = \"b\"\n\
         machine = \"t1\"\ntick = {every}\noffset = {offset}\n{link}\n[[wire]]\nfrom = \"host.i\"\nto = \"a.i\"\n\
         [[wire]]\nfrom = \"b.o\"\nto = \"host.o\"\n"
    );
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
            assert!(least <= way.best + 28, "{least}, and not {}", way.best);
        } else if first != AT_END {
            assert!(way.worst <= most + 12, "{most}, and not {}", way.worst);
        }
    }
}

/// Cores each of which has a wire to each other one, and none to the host; with ticks of these numbers of base ticks.
fn meshed(every: &[u64], out: &str) -> Description {
    let (mut text, mut programs) = (format!("tick = {TICK}\n"), BTreeMap::new());
    for (core, every) in every.iter().enumerate() {
        text += &format!(
            "[[core]]\nname = \"c{core}\"\nprogram = \"c{core}\"\nmachine = \"t1\"\ntick = {every}\n"
        );
    }
    for to in 0..every.len() {
        let senders = (0..every.len()).filter(|from| *from != to);
        let wires =
            senders.clone().map(|from| format!("[[wire]]\nfrom = \"c{from}.o\"\nto = \"c{to}.i{from}\"\n"));
        text += &wires.collect::<String>();
        text += &format!("[[wire]]\nfrom = \"host.h\"\nto = \"c{to}.h\"\n");
        let inputs: String = senders.map(|from| format!(".input i{from}:int\n")).collect();
        let rest =
            ".input h:int\n.output o:int\n.once\n mov o, zero\n wait p\n.period\np: mov o, h\n wait p\n";
        programs.insert(format!("c{to}"), program(&(inputs + rest)));
    }
    describe(&(text + out), &programs).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn too_many_ways_or_phases_end() {
    let limit = |description: Description| {
        let bound =
            |core: &takt_system::Core| takt_analysis::bound(&core.program).expect("it can be bounded");
        let bounds: Vec<_> = description.cores.iter().map(bound).collect();
        match latencies(&description, &bounds) {
            Err(LatencyError::Limit { limit, what }) => (limit, what),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(limit(meshed(&[1; 16], "")), (MAX_STEPS, "links to follow"));
    let out = "[[wire]]\nfrom = \"c1.o\"\nto = \"host.o\"\n";
    assert_eq!(limit(meshed(&[499, 997], out)), (MAX_PHASES, "phases of the ticks to each other"));
}
