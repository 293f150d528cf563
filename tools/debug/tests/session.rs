// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sessions compared with their run: a position shows the same state whether it is reached forward or back.

use std::sync::Arc;
use takt_asm::{MemoryLoader, Options as AsmOptions, assemble};
use takt_debug::console::Console;
use takt_debug::session::{
    BreakpointLocation, CHECKPOINTS, Options, Place, Session, Stop, StopReason, Test, Unit,
};
use takt_emu::testing::{Options as ProgramOptions, Random, input_ports, random_program};
use takt_isa::{BundleAddress, F3, MACHINES, Program, Register};

/// Session on a random program with inputs for some periods; `subroutines` adds calls.
fn random_session(seed: u64, index: usize, periods: u64) -> Session {
    let machine = MACHINES[index % MACHINES.len()];
    session(&random_program(seed, machine, ProgramOptions::TAME), seed, periods)
}

fn session(program: &Program, seed: u64, periods: u64) -> Session {
    let mut random = Random::new(seed);
    let ports = || input_ports(program.machine);
    let row = |random: &mut Random| ports().map(|port| (port, random.word())).collect::<Vec<_>>();
    let rows = (0..periods).map(|_| row(&mut random)).collect();
    Session::new(program, Options { inputs: Some(Arc::new(rows)), ..Options::default() }).unwrap()
}

/// Complete visible state at a position.
fn fingerprint(session: &mut Session) -> String {
    let registers: Vec<Option<u32>> = Register::all().map(|register| session.register(register)).collect();
    let (next, stall, flight) = (session.next_issue(), session.stall(), session.in_flight());
    let emulator = session.emulator();
    format!(
        "{} {} {next:?} {stall:?} {flight:?} {:?} {:?} {:?} {registers:?} {:?}",
        session.cycle(),
        session.period(),
        emulator.status(),
        emulator.stack(),
        emulator.flags(),
        emulator.statistics()
    ) + &format!("{:?} {:?}", emulator.loops().collect::<Vec<_>>(), emulator.memory())
}

/// Fingerprints of every position of a run, from single steps.
fn all(session: &mut Session) -> Vec<String> {
    session.go_to(0);
    let mut positions = vec![fingerprint(session)];
    while session.step(Unit::Cycle) == StopReason::Done {
        positions.push(fingerprint(session));
    }
    positions
}

#[test]
fn anywhere() {
    for seed in 0..12 {
        let mut session = random_session(seed, seed as usize, 6);
        let positions = all(&mut session);
        let end = positions.len() as u64 - 1;
        let mut random = Random::new(seed);
        for _ in 0..60 {
            let cycle = u64::from(random.below(end as u32 + 1));
            assert_eq!(session.go_to(cycle), StopReason::Done);
            assert!(fingerprint(&mut session) == positions[cycle as usize], "seed {seed}, cycle {cycle}");
            if random.once_in(3) && cycle > 0 {
                assert_eq!(session.step_back(Unit::Cycle), StopReason::Done);
                assert!(fingerprint(&mut session) == positions[cycle as usize - 1]);
            }
        }
        // The session's run equals the emulator's.
        session.go_to(end);
        let mut emulator = takt_emu::Emulator::new(session.program()).unwrap();
        let mut random = Random::new(seed);
        for _ in 0..session.period() {
            for input in input_ports(session.program().machine) {
                emulator.set_input_bits(input, random.word()).unwrap();
            }
            emulator.run_period(&[]).unwrap();
        }
        if session.period() == 6 {
            assert_eq!(emulator.now(), session.cycle());
            assert_eq!(emulator.statistics(), session.emulator().statistics());
        }
    }
}

/// Positions at which forward steps by a unit stop, from the beginning to the end.
fn forward(session: &mut Session, unit: Unit) -> Vec<u64> {
    session.go_to(0);
    let mut positions = vec![0];
    while session.step(unit) == StopReason::Done {
        positions.push(session.cycle());
    }
    positions
}

#[test]
fn backward_steps_reverse_forward_steps() {
    for seed in 0..16 {
        let mut session = random_session(seed, seed as usize, 3);
        for unit in [Unit::Bundle, Unit::Line, Unit::Period] {
            let forward = forward(&mut session, unit);
            let mut back = vec![];
            loop {
                let why = session.step_back(unit);
                back.push(session.cycle());
                if session.cycle() == 0 {
                    assert!(why == StopReason::Start || unit == Unit::Period);
                    break;
                }
                assert_eq!(why, StopReason::Done);
            }
            back.reverse();
            // The end of the run may itself be a stop position.
            let end = if forward.len() > back.len() { back.len() } else { forward.len() };
            assert_eq!(back[..end], forward[..end], "seed {seed} {unit:?}");
            assert!(forward.len() - end <= 1);
        }
    }
}

/// Source with a subroutine and a loop.
const SOURCE: &str = "\
.output sum, count:int
.reg    i:int n:int x q
        li      n, 3
        mov     i, zero
        fadd    sum, zero, zero
next:   call    add
        iadd    i, i, 1
        ilt     x, i, n
        bnz     x, next
        mov     count, i
        halt
add:    ld      x, table[i]
        st      out[i], x
        fadd    sum, sum, x
        fdiv    q, x, zero
        ret
.data
table:  .float  0.5, 0.25, -1.75
out:    .space  3
";

fn console(source: &str) -> Console {
    let files = [("a.s", source)];
    let options = AsmOptions { machine: &F3, ..AsmOptions::default() };
    let assembled = assemble("a.s", &MemoryLoader::new(&files), &options).unwrap();
    let sources = vec![("a.s".to_owned(), source.to_owned())];
    let options = Options { sources, constants: assembled.constants, ..Options::default() };
    Console::new(Session::new(&assembled.program, options).unwrap())
}

fn value(console: &Console, text: &str) -> f64 {
    console.session().evaluate(&console.session().parse(text).unwrap()).unwrap().real()
}

/// The fixture has no counted loops, so this source names a machine that has them.
#[test]
fn loops_show_the_iterations_left() {
    let mut console = console(
        ".machine t3\n.reg n k i\n.preset i = 0\nli n, 3\nli k, 2\nloop n, outer\nloop k, inner\niadd i, i, n\ninner:\nnop\nouter:\nhalt\n",
    );
    let loops = |console: &mut Console| -> Vec<String> {
        let place = console.execute("where").unwrap();
        let lines = place.lines().filter(|line| line.contains("left of the loop"));
        lines.map(|line| line.trim().chars().take_while(char::is_ascii_digit).collect()).collect()
    };
    console.execute("break :8").unwrap();
    let mut seen = Vec::new();
    while console.execute("continue").unwrap().starts_with("stop 1") {
        seen.push(loops(&mut console).join(" "));
    }
    assert_eq!(seen, ["2 3", "1 3", "2 2", "1 2", "2 1", "1 1"]);
    console.execute("back").unwrap();
    assert!(loops(&mut console).len() < 2, "the loops have ended");
}

#[test]
fn calls() {
    let mut console = console(SOURCE);
    console.execute("break next").unwrap();
    console.execute("continue").unwrap();
    let depth = |console: &Console| value(console, "depth");
    assert_eq!((value(&console, "address"), depth(&console)), (3.0, 0.0));
    console.execute("step call").unwrap();
    assert_eq!((value(&console, "address"), depth(&console)), (4.0, 0.0), "over it");
    console.execute("back call").unwrap();
    assert_eq!((value(&console, "address"), depth(&console)), (3.0, 0.0), "and back");
    console.execute("step").unwrap();
    assert_eq!((value(&console, "address"), depth(&console)), (9.0, 1.0), "into it");
    console.execute("step out").unwrap();
    assert_eq!((value(&console, "address"), depth(&console)), (4.0, 0.0));
}

#[test]
fn stops_forth_and_back() {
    for (stop, expected) in [
        ("break add", 3),
        ("break add if i == 1", 1),
        ("break :8", 3),
        ("break next+1", 3),
        ("break cycle 40", 1),
        ("watch i", 4),
        ("watch sum > 0.6", 1),
        ("watch sum == 0.75", 1),
        ("watch q nan", 0),
        ("watch out[1]", 1),
        ("watch i > 0", 1),
        ("watch [table+2] > -2", 0),
    ] {
        let mut console = console(SOURCE);
        let kind = stop.split(' ').next().unwrap();
        console.execute(stop).unwrap();
        let mut forward = vec![];
        while matches!(console.session_mut().resume(), StopReason::Stop { id: 1, .. }) {
            forward.push((console.session().cycle(), fingerprint(console.session_mut())));
        }
        let mut back = vec![];
        while matches!(console.session_mut().resume_back(), StopReason::Stop { id: 1, .. }) {
            back.push((console.session().cycle(), fingerprint(console.session_mut())));
        }
        back.reverse();
        assert_eq!(forward.len(), expected, "{stop}");
        assert!(
            forward == back,
            "{kind} {stop}: {:?}",
            back.iter().map(|(cycle, _)| cycle).collect::<Vec<_>>()
        );
    }
}

/// The position after the last cycle is complete: it shows operations that issue together with `halt`.
#[test]
fn the_last_position_counts() {
    let source = ".output y\n nop\n fadd y, 3.5, 3.5 || halt\n";
    for command in ["watch y", "until y == 7", "watch y > 6"] {
        let mut console = console(source);
        let said = console.execute(command).unwrap();
        let said = if command.starts_with("until") { said } else { console.execute("continue").unwrap() };
        assert!(
            said.starts_with("stop 1: ") || said.starts_with("the expression holds"),
            "{command}: {said}"
        );
        assert!(said.contains("halted at bundle 1"), "{command}: {said}");
        let end = console.session().cycle();
        assert!(console.execute("continue").unwrap().starts_with("the program has halted"));
        assert_eq!(console.session().cycle(), end);
    }
}

/// `until` goes to the next position at which its expression holds, even if it already holds.
#[test]
fn until_is_the_next_position() {
    let mut console = console(SOURCE);
    for expected in [1, 2, 3] {
        console.execute("until 1").unwrap();
        assert_eq!(console.session().cycle(), expected);
    }
}

/// In random runs a breakpoint stops before each issue of its bundle and a watchpoint at each change, and nowhere else.
#[test]
fn stops_are_complete() {
    let mut stopped = 0;
    for seed in 0..16 {
        let mut session = random_session(seed, seed as usize, 3);
        let (program, end) = (session.program().clone(), all(&mut session).len() as u64 - 1);
        let mut random = Random::new(seed);
        let address = BundleAddress::new(random.below(program.bundles()));
        let mut registers = program.machine.slots[0].bank.registers();
        let register = registers.nth(8 + random.below(4) as usize).unwrap();
        let (mut issues, mut changes) = (vec![], vec![]);
        for cycle in 1..=end {
            let before = session.go_to(cycle - 1);
            let old = session.register(register);
            assert_eq!((before, session.go_to(cycle)), (StopReason::Done, StopReason::Done));
            if session.next_issue() == (address, Some(cycle)) {
                issues.push(cycle);
            }
            if session.register(register) != old {
                changes.push(cycle);
            }
        }
        let name = format!("@{}", program.machine.register_name(register).unwrap());
        let what = session.parse(&name).unwrap();
        for (stop, expected) in [
            (
                Stop::Break { at: BreakpointLocation::Bundle(address), condition: None, text: String::new() },
                issues,
            ),
            (Stop::Watch { what: Box::new(what), test: Test::Changed, text: String::new() }, changes),
        ] {
            session.go_to(0);
            let id = session.add_stop(stop);
            let mut found = vec![];
            while matches!(session.resume(), StopReason::Stop { .. }) {
                found.push(session.cycle());
            }
            assert_eq!(found, expected, "seed {seed}");
            stopped += found.len();
            session.remove_stop(id);
        }
    }
    assert!(stopped > 100);
}

#[test]
fn edits_belong_to_the_run() {
    let mut console = console(SOURCE);
    console.execute("break add if i == 1").unwrap();
    console.execute("continue").unwrap();
    let at = console.session().cycle();
    console.execute("set table[1] = 100").unwrap();
    console.execute("set @m5:int = -7").unwrap();
    assert_eq!(value(&console, "table[1]"), 100.0);
    console.execute("goto cycle 100000").unwrap_or_default();
    assert_eq!(value(&console, "sum"), 0.5 + 100.0 - 1.75);
    let end = fingerprint(console.session_mut());
    // Before the edit the value is the old one; after it, the new one again.
    console.execute("back cycle 100").unwrap();
    assert!(console.session().cycle() < at);
    assert_eq!(value(&console, "table[1]"), 0.25);
    console.execute("goto cycle 100000").unwrap_or_default();
    assert!(fingerprint(console.session_mut()) == end);
    // An edit at the same position replaces the previous one.
    console.execute(&format!("goto cycle {at}")).unwrap();
    console.execute("set table[1] = 1").unwrap();
    console.execute("goto cycle 100000").unwrap_or_default();
    assert_eq!(value(&console, "sum"), 0.5 + 1.0 - 1.75);
    assert!(console.session_mut().set(Place::Register(Register::ZERO), 1).is_err());
    assert!(console.session_mut().set(Place::Word(1 << 20), 1).is_err());
}

#[test]
fn expressions() {
    let mut console = console(SOURCE);
    console.execute("until i == 2").unwrap();
    for (text, expected) in [
        ("i*2+1", 5.0),
        ("[2]", -1.75),
        ("table[1]", 0.25),
        ("table[i-1]:bits", f64::from(0.25f32.to_bits())),
        ("1[1]", -1.75),
        ("abs(table[table[0]*4])", 1.75),
        ("max(i, 3)", 3.0),
        ("sum:bits", f64::from(0.75f32.to_bits())),
        ("add", 9.0),
        ("bits(sum)", f64::from(0.75f32.to_bits())),
        ("-table[2]^2", -3.0625),
        ("x1:int*0 + pi > 3", 1.0),
    ] {
        if text.starts_with("x1") {
            console.execute("set x1 = 1").unwrap();
        }
        assert_eq!(value(&console, text), expected, "{text}");
    }
    let mut errors = String::new();
    for text in [
        "",
        "sun",
        "sum +",
        "table[",
        "table[1.5]",
        "[5000]",
        "@q7",
        "sum:flot",
        "add:int",
        "1/0",
        "count",
        "sqrt(-1)",
        "[[[[[[[[[[[[[[[[[0]]]]]]]]]]]]]]]]]",
        "ß",
    ] {
        let error = match console.session().parse(text) {
            Ok(live) => console.session().evaluate(&live).unwrap_err(),
            Err(error) => error,
        };
        errors.push_str(&format!("{text}\n    {}\n", error.replace('\n', "\n    ")));
    }
    insta::assert_snapshot!(errors);
}

/// 10⁸ cheap cycles: checkpoints stay few, yet dense enough to reach any earlier position by a short run.
#[test]
fn a_long_run() {
    let loader = MemoryLoader::new(takt_programs::SOURCES);
    let options = AsmOptions { machine: &F3, effort: 0, ..AsmOptions::default() };
    let program = assemble("hybrid/tracking.s", &loader, &options).unwrap().program;
    let zeros: Vec<(Register, u32)> = program.inputs.iter().map(|port| (port.register, 0)).collect();
    let rows = Some(Arc::new(vec![zeros; 10_000]));
    let options = Options { inputs: rows, tick: std::num::NonZeroU64::new(12_500), ..Options::default() };
    let mut session = Session::new(&program, options).unwrap();
    assert_eq!(session.go_to(100_000_000), StopReason::Done);
    let cycles = session.checkpoints();
    assert!(cycles.len() <= CHECKPOINTS);
    assert!(cycles.windows(2).all(|pair| pair[1] - pair[0] <= 1 << 19) && cycles.last() > Some(&99_000_000));
    let at_end = fingerprint(&mut session);
    for cycle in [99_999_999, 50_000_001, 3] {
        assert_eq!(session.go_to(cycle), StopReason::Done);
        assert_eq!(session.cycle(), cycle);
    }
    assert_eq!(session.go_to(100_000_000), StopReason::Done);
    assert!(fingerprint(&mut session) == at_end);
    // A search through the whole run, for a value that never occurs.
    let [what, never] = ["F1", "1e9"].map(|text| Box::new(session.parse(text).unwrap()));
    let rare = Stop::Watch { what, test: Test::Above(never), text: String::new() };
    let id = session.add_stop(rare);
    assert_eq!(session.resume_back(), StopReason::Start);
    session.remove_stop(id);
    assert_eq!(session.go_to(100_000_000), StopReason::Done);
    session.add_stop(Stop::Break { at: BreakpointLocation::Period(7), condition: None, text: String::new() });
    assert!(matches!(session.resume_back(), StopReason::Stop { .. }) && session.period() == 7);
    // A stop in a cycle without events, during a wait, is also found.
    session.go_to(0);
    session.add_stop(Stop::Break {
        at: BreakpointLocation::Cycle(59_000),
        condition: None,
        text: String::new(),
    });
    assert!(matches!(session.resume(), StopReason::Stop { .. }) && session.cycle() == 59_000);
    let clock = session.parse("cycle == 71999").unwrap();
    assert!(session.run_until(&clock) == StopReason::Holds && session.cycle() == 71_999);
}

/// Most programs have a label `period`; in a condition, `period` means the counter, not the address.
#[test]
fn counters_come_before_labels() {
    let mut console = console(
        ".output y\n.state s\n.once\n mov s, zero\n wait period\n.period\nperiod: fadd s, s, 1.0\n mov y, s\n wait period\n",
    );
    console.execute("until period == 3").expect("it comes");
    assert_eq!(value(&console, "period"), 3.0);
}

/// Elements of register arrays have names, and operations of an equation have the columns of their terms.
#[test]
fn equations_and_arrays() {
    let source = ".input x\n.output y\n.state P[2,2]\n.once\n P[1,1], P[1,2], P[2,1], P[2,2] = 1, 2, 3, 4\n wait p\n\
                  .period\np: y = x*P[1,2] + P[2,1]*2\n P[1,2] = P[1,2] + 0.5\n wait p\n";
    let mut console = console(source);
    console.execute("break p if P[1,2] > 2.75").unwrap();
    console.execute("continue").unwrap();
    assert_eq!(value(&console, "P[1,2]"), 3.0);
    assert_eq!(value(&console, "P[2, 1]*2 + P[2,2]"), 10.0);
    let said = console.execute("info P[2,1]").unwrap();
    assert!(said.contains(":8:19-26)"), "{said}");
}
