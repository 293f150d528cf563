// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds from a host's command to an output, against the emulator's response to commands in every cycle.

use std::collections::BTreeMap;
use takt_analysis::Bounds;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_emu::testing::Random;
use takt_isa::{F1, Program};
use takt_system::latency::{Latency, LatencyError, MAX_PHASES, MAX_STEPS, latencies};
use takt_system::testing::describe;
use takt_system::{Description, System};

/// Cycles between base ticks.
const TICK: u64 = 400;

/// Program that reads its input at the end of a period of more than 200 cycles.
const AT_END: &str = ".input i:int\n.output o:int\n.reg x\n.once\n mov o, zero\n mov x, zero\n wait p\n.period\np: nop\n\
                      .rep n, 1, 10\n fdiv x, x, 1.0\n.endr\n mov o, i\n wait p\n";
/// Program that reads its input at once.
const SHOW: &str =
    ".input i:int\n.output o:int\n.once\n mov o, zero\n wait p\n.period\np: mov o, i\n wait p\n";

fn program(text: &str) -> Program {
    let options = Options { machine: &F1, ..Options::default() };
    assemble("p.s", &MemoryLoader::of("p.s", text), &options).unwrap_or_else(|e| panic!("{e:?}")).program
}

/// Two cores: a command goes over a wire to core `a` and over `link` to core `b`, whose tick is `offset` cycles later.
fn pair(first: &str, link: &str, every: u64, offset: u64) -> Description {
    chain([first, SHOW], link, every, offset)
}

/// Two cores like [`pair`], with two programs.
fn chain([first, second]: [&str; 2], link: &str, every: u64, offset: u64) -> Description {
    let text = format!(
        "tick = {TICK}\n[[core]]\nname = \"a\"\nprogram = \"a\"\nmachine = \"f1\"\n[[core]]\nname = \"b\"\nprogram = \"b\"\n\
         machine = \"f1\"\ntick = {every}\noffset = {offset}\n{link}\n[[wire]]\nfrom = \"host.i\"\nto = \"a.i\"\n\
         [[wire]]\nfrom = \"b.o\"\nto = \"host.o\"\n"
    );
    let programs = BTreeMap::from([("a".to_owned(), program(first)), ("b".to_owned(), program(second))]);
    describe(&text, &programs).unwrap_or_else(|error| panic!("{error}"))
}

/// Bounds of all paths through a system.
fn ways(description: &Description) -> Result<Vec<Latency>, LatencyError> {
    let bound = |core: &takt_system::Core| takt_analysis::bound(&core.program).expect("it can be bounded");
    let bounds: Vec<Bounds> = description.cores.iter().map(bound).collect();
    latencies(description, &bounds)
}

/// Response time in cycles of a command given `command` cycles after the first base tick following the start; `latest` limits the search.
fn response(description: &Description, command: u64, latest: u64) -> u64 {
    let mut system = System::new(description).expect("it can be emulated");
    let start = system.run_to_start(10_000).expect("no fault").expect("it starts") + TICK + command;
    system.run_until(start).expect("no fault");
    let before = system.output("o").expect("an output");
    system.set_input("i", 1).expect("an input");
    let shows = |cycle: &u64| {
        system.run_until(start + cycle).expect("no fault");
        system.output("o").expect("an output") != before
    };
    (1..latest).find(shows).expect("it follows")
}

/// Least and most response cycles of commands given in each cycle of `ticks` base ticks.
fn measured(description: &Description, ticks: u64) -> (u64, u64) {
    let cycles: Vec<u64> =
        (0..ticks * TICK).map(|command| response(description, command, 10 * TICK)).collect();
    (*cycles.iter().min().expect("some"), *cycles.iter().max().expect("some"))
}

#[test]
fn no_command_takes_fewer_cycles_or_more() {
    let snapshot = "[[snapshot]]\nname = \"s\"\nfrom = \"a\"\nto = \"b\"\nports = [\"o -> i\"]\n";
    let wire = "[[wire]]\nfrom = \"a.o\"\nto = \"b.i\"\nlatency = 7\n";
    let latched = format!(".ports latched\n{SHOW}");
    // Work of more than 200 cycles after the outputs are published.
    let early = AT_END.replace("p: nop\n", "p: mov o, i\n publish\n").replace(" mov o, i\n wait", " wait");
    let latched_early = format!(".ports latched\n{early}");
    let cases = [
        // Reads late in a period that is under way, just before the snapshot is taken.
        (AT_END, snapshot, 1, 230),
        (AT_END, wire, 1, 230),
        (AT_END, wire, 2, 50),
        (&latched, snapshot, 1, 230),
        (&latched, wire, 2, 10),
        (SHOW, wire, 1, 0),
        (&early, snapshot, 1, 230),
        (&latched_early, snapshot, 1, 230),
        (&latched_early, wire, 2, 10),
    ];
    for (first, link, every, offset) in cases {
        let description = pair(first, link, every, offset);
        let way = ways(&description).expect("there is a bound").remove(0);
        let (least, most) = measured(&description, every);
        assert!(way.best <= least && most <= way.worst, "{least} to {most}, and not {way:?}");
        // In the best case, a core reads in the last cycle of a period; in the worst, in the first.
        if first == AT_END && link == snapshot {
            assert!(least <= way.best + 28, "{least}, and not {}", way.best);
        } else if first != AT_END {
            assert!(way.worst <= most + 12, "{most}, and not {}", way.worst);
        }
    }
}

/// Program whose output follows its input through up to `periods` periods of state: registers, conditions or data words.
fn delays(random: &mut Random, periods: u32) -> String {
    let random_latched = if random.once_in(3) { ".ports latched\n" } else { "" };
    let mut head = format!("{random_latched}.input i:int\n.output o:int\n.reg x:int y:int\n");
    let mut once = " mov o, zero\n".to_owned();
    let (mut shift, mut value) = (Vec::new(), "i".to_owned());
    for stage in 1..=periods {
        // Stages run from last to first, so that each takes its predecessor's old value.
        shift.push(match random.below(3) {
            0 => {
                head += &format!(".state s{stage}:int\n");
                once += &format!(" mov s{stage}, zero\n");
                let step = format!(" mov s{stage}, {value}\n");
                value = format!("s{stage}");
                step
            }
            1 => {
                head += &format!(".state s{stage}:int\n");
                once += &format!(" mov s{stage}, zero\n");
                let step =
                    format!(" mov x, zero\n bz {value}, l{stage}\n mov x, 1\nl{stage}: mov s{stage}, x\n");
                value = format!("s{stage}");
                step
            }
            _ => {
                head += &format!(".data\nd{stage}: .word 0\n.once\n.reg y{stage}:int\n");
                let step = format!(" st d{stage}, {value}\n");
                value = format!("y{stage}");
                format!("{step} ; {value}")
            }
        });
    }
    // Loads precede all stores.
    let loads: String = (1..=periods)
        .filter(|stage| shift[*stage as usize - 1].contains(" ; "))
        .map(|stage| format!(" ld y{stage}, d{stage}\n"))
        .collect();
    let shift: String = shift.iter().rev().map(|step| step.split(" ; ").next().unwrap_or_default()).collect();
    let work = " fdiv y:float, y:float, 1.0\n".repeat(random.below(8) as usize);
    let out = format!(" mov o, {value}\n");
    let body = match random.below(3) {
        0 => format!("{loads}{out}{work}{shift}"),
        1 => format!("{loads}{out} publish\n{work}{shift}"),
        _ => format!("{work}{loads}{out}{shift}"),
    };
    format!("{head}.once\n{once} mov y, zero\n wait p\n.period\np: nop\n{body} wait p\n")
}

#[test]
fn delay_lines_take_the_periods_that_the_bound_counts() {
    let mut random = Random::new(3);
    let mut direct = 0;
    for case in 0..60 {
        let periods = [random.below(5), random.below(3)];
        let programs = periods.map(|periods| delays(&mut random, periods));
        let latency = 4 + random.below(20);
        let link = match random.below(2) {
            0 => format!(
                "[[snapshot]]\nname = \"s\"\nfrom = \"a\"\nto = \"b\"\nports = [\"o -> i\"]\nlatency = {latency}\n"
            ),
            _ => format!("[[wire]]\nfrom = \"a.o\"\nto = \"b.i\"\nlatency = {latency}\n"),
        };
        let (every, offset) = (1 + u64::from(random.below(3)), u64::from(random.below(300)));
        let description = chain([&programs[0], &programs[1]], &link, every, offset);
        let found = ways(&description).expect("there is a bound");
        let [way] = &found[..] else { panic!("{found:?}") };
        let told = || format!("case {case}: {way:?}\n{link}\n{}\n{}", programs[0], programs[1]);
        assert_eq!(
            (&way.least_states[..], way.most_states.as_deref()),
            (&periods[..], Some(&periods[..])),
            "{}",
            told()
        );
        direct += u64::from(periods == [0, 0]);
        assert_eq!(way.meets_deadline(way.worst, false), Some(true));
        let latest = way.worst + 10 * TICK;
        let cycles: Vec<u64> = (0..40)
            .map(|_| response(&description, u64::from(random.below(TICK as u32 * every as u32)), latest))
            .collect();
        let (least, most) = (*cycles.iter().min().expect("some"), *cycles.iter().max().expect("some"));
        assert!(way.best <= least && most <= way.worst, "{least} to {most}: {}", told());
        // The bound is tight up to the place in a period where an output is written, which can decide on a tick of the second core.
        assert!(
            way.worst < most + TICK * every + TICK && least < way.best + TICK * every + TICK,
            "{least} to {most}: {}",
            told()
        );
    }
    assert!((1..30).contains(&direct), "{direct}");
}

#[test]
fn uncertain_dependences_are_dropped() {
    let wire = "[[wire]]\nfrom = \"a.o\"\nto = \"b.i\"\n";
    let ring = ".input i:int\n.output o:int\n.state n:int\n.data\nd: .word 0, 0, 0, 0\n.once\n mov n, zero\n mov o, zero\n wait p\n\
                .period\np: ld o, d[n]\n st d[n], i\n iadd n, n, 1\n iand n, n, 3\n wait p\n";
    let seldom = ".input i:int\n.output o:int\n.state n:int\n.once\n mov n, 9\n mov o, zero\n wait p\n\
                  .period\np: isub n, n, 1\n bnz n, l\n mov o, i\n mov n, 9\nl: wait p\n";
    for (first, least) in [(ring, 1), (seldom, 0)] {
        let description = chain([first, SHOW], wire, 1, 0);
        let way = ways(&description).expect("there is a bound").remove(0);
        assert_eq!((&way.least_states[..], &way.most_states), (&[least, 0][..], &None));
        // Only the shortest path is certain: a deadline below its time is missed, above it nothing is certain.
        assert_eq!(
            [way.worst, way.worst - 1, 1 << 40].map(|deadline| way.meets_deadline(deadline, true)),
            [None, Some(false), None]
        );
        let found = response(&description, 7, 20 * TICK);
        assert!(found >= way.best && found > way.worst, "{found}: {way:?}");
    }
    // Entries queued in a FIFO come first.
    let queue = "[[fifo]]\nname = \"q\"\nfrom = \"a\"\nto = \"b\"\nports = [\"o -> i\"]\ndepth = 4\npush = \"o\"\npop = \"pop\"\n";
    let second = SHOW
        .replace(".output o:int", ".output o:int\n.output pop:int")
        .replace(" wait p\n.period", " mov pop, zero\n wait p\n.period");
    let second = second.replace("p: mov o, i\n", "p: mov o, i\n mov pop, zero\n");
    let way = ways(&chain([SHOW, &second], queue, 1, 0)).expect("there is a bound").remove(0);
    assert_eq!(
        (way.queues.len(), way.meets_deadline(1 << 40, false), way.meets_deadline(1 << 40, true)),
        (1, None, Some(true)),
        "{way:?}"
    );
}

/// Mesh of cores: each has a wire from the host and one to every other core, with ticks of these numbers of base ticks; `out` adds links to
/// the host.
fn meshed(every: &[u64], out: &str) -> Description {
    let (mut text, mut programs) = (format!("tick = {TICK}\n"), BTreeMap::new());
    for (core, every) in every.iter().enumerate() {
        text += &format!(
            "[[core]]\nname = \"c{core}\"\nprogram = \"c{core}\"\nmachine = \"f1\"\ntick = {every}\n"
        );
    }
    for to in 0..every.len() {
        let senders = (0..every.len()).filter(|from| *from != to);
        let sum: String = senders.clone().map(|from| format!(" iadd o, o, i{from}\n")).collect();
        let wires =
            senders.clone().map(|from| format!("[[wire]]\nfrom = \"c{from}.o\"\nto = \"c{to}.i{from}\"\n"));
        text += &wires.collect::<String>();
        text += &format!("[[wire]]\nfrom = \"host.h\"\nto = \"c{to}.h\"\n");
        let inputs: String = senders.map(|from| format!(".input i{from}:int\n")).collect();
        let rest = format!(
            ".input h:int\n.output o:int\n.once\n mov o, zero\n wait p\n.period\np: mov o, h\n{sum} wait p\n"
        );
        programs.insert(format!("c{to}"), program(&(inputs + &rest)));
    }
    describe(&(text + out), &programs).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn too_many_ways_or_phases_end() {
    let limit = |description: Description| match ways(&description) {
        Err(LatencyError::Limit { limit, what }) => (limit, what),
        other => panic!("{other:?}"),
    };
    assert_eq!(limit(meshed(&[1; 16], "")), (MAX_STEPS, "links to follow"));
    let out = "[[wire]]\nfrom = \"c1.o\"\nto = \"host.o\"\n";
    assert_eq!(limit(meshed(&[499, 997], out)), (MAX_PHASES, "phases of the ticks to each other"));
}
