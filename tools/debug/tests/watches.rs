// SPDX-License-Identifier: MIT OR Apache-2.0
//! Watchpoints stop at the same positions from any start of a search and in both directions; compared with a walk through all positions
//! that uses no search.

use std::fmt::Write as _;
use std::sync::Arc;
use takt_asm::names::{NamedValue, Names};
use takt_asm::{AssembledProgram, MemoryLoader, Options as AsmOptions, assemble};
use takt_debug::console::{Console, End};
use takt_debug::session::{Move, Options, Place, Session, Stop, StopReason, Test, WatchExpression};
use takt_debug::system::{SystemOptions, SystemSession};
use takt_emu::testing::Random;
use takt_isa::{MACHINES, Machine, Program, Register};
use takt_system::Description;
use takt_system::testing::random_description;

/// Number of names in the source, each written repeatedly.
const NAMES: u32 = 40;
/// Source that writes few names repeatedly: in straight lines, in loops, in skipped code and in a subroutine. Most results recur.
fn source(seed: u64, inputs: bool) -> String {
    let mut random = Random::new(seed);
    let names: Vec<String> = (0..NAMES).map(|i| format!("v{i}")).collect();
    let names = names.join(", ");
    let mut text = format!(
        "{} a\n.output F\n.state s, k:int\n.reg {names}\n.reg n:int, skip:int\n.once\n\
         \x20mov s, zero\n li k, 0\n{}",
        if inputs { ".input" } else { ".state" },
        if inputs { "" } else { " mov a, zero\n" }
    );
    for i in 0..NAMES {
        let _ = writeln!(text, " mov v{i}, zero");
    }
    let _ = writeln!(text, " wait p\n.period\np: iadd k, k, 1\n iand skip, k, 3\n fadd s, s, 0.5");
    let straight = |text: &mut String, random: &mut Random, lines: usize| {
        let _ = writeln!(text, ".schedule on");
        for _ in 0..lines {
            let mut name = || format!("v{}", random.below(NAMES));
            let (to, x, y) = (name(), name(), name());
            let op = ["fmin", "fmax", "fadd", "fmul"][random.below(4) as usize];
            let y = if random.once_in(5) { "a".to_owned() } else { y };
            let y = if random.once_in(12) { "s".to_owned() } else { y };
            let _ = writeln!(text, " {op} {to}, {x}, {y}");
        }
        let _ = writeln!(text, ".schedule off");
    };
    for block in 0..4 {
        straight(&mut text, &mut random, 240);
        match block {
            0 => {
                let _ = writeln!(text, " li n, 2\nturn:");
                straight(&mut text, &mut random, 30);
                let _ = writeln!(text, " isub n, n, 1\n bnz n, turn");
            }
            1 => {
                let _ = writeln!(text, " bnz skip, over");
                straight(&mut text, &mut random, 60);
                let _ = writeln!(text, "over: call sub");
            }
            _ => {}
        }
    }
    let _ = writeln!(text, " fadd F, v0, v1\n wait p\nsub:");
    straight(&mut text, &mut random, 40);
    let _ = writeln!(text, " ret");
    text
}

fn assembled(seed: u64, inputs: bool, machine: &'static Machine) -> AssembledProgram {
    let text = source(seed, inputs);
    let options = AsmOptions { machine, effort: 1, ..AsmOptions::default() };
    match assemble("a.s", &MemoryLoader::new(&[("a.s", text.as_str())]), &options) {
        Ok(assembled) => assembled,
        Err(errors) => panic!("{text}\n{}", errors.render(false)),
    }
}

/// Rows of inputs with few distinct values, so that most results recur.
fn rows(program: &Program, seed: u64, periods: usize) -> Vec<Vec<(Register, u32)>> {
    let mut random = Random::new(seed);
    let mut value = || [0.5f32, 0.5, 2.0][random.below(3) as usize].to_bits();
    (0..periods).map(|_| program.inputs.iter().map(|port| (port.register, value())).collect()).collect()
}

/// Watched names with their tests.
const WATCHES: [(&str, Kind); 5] = [
    ("v0", Kind::Changed),
    ("v3", Kind::Changed),
    ("v5 * 2.0", Kind::Changed),
    ("v7", Kind::Above("a")),
    ("v9", Kind::Above("v4")),
];

#[derive(Clone, Copy, Debug)]
enum Kind {
    Changed,
    /// The value is above that of another expression.
    Above(&'static str),
}

fn stop(session: &Session, (what, kind): (&str, Kind)) -> Stop {
    let parse = |text: &str| Box::new(session.parse(text).expect("it is an expression"));
    let test = match kind {
        Kind::Changed => Test::Changed,
        Kind::Above(other) => Test::Above(parse(other)),
    };
    Stop::Watch { what: parse(what), test, text: what.to_owned() }
}

/// Value of a name, from the assembler's debug information.
struct NameValue {
    register: Register,
    /// Range of addresses of the next bundle within which the register holds the value: after the first, up to and including the second.
    range: Option<(u32, u32)>,
    /// The register also holds other values.
    shares: bool,
}

impl NameValue {
    fn each(names: &Names, name: &str) -> Vec<NameValue> {
        let held = |value: &NamedValue| {
            let first = |value: &NamedValue| value.bundles.map(|(first, _)| first.get());
            let others =
                names.values.iter().filter(|other| other.register == value.register && *other != value);
            let rivals: Vec<u32> = others.filter_map(first).collect();
            let shares = !rivals.is_empty();
            let range = first(value).filter(|_| shares || value.orders.is_some()).map(|first| {
                (first, rivals.into_iter().filter(|rival| *rival > first).min().unwrap_or(u32::MAX))
            });
            NameValue { register: value.register, range, shares }
        };
        names.values.iter().filter(|value| value.name == name).map(held).collect()
    }

    /// Bits of the value; `None` if it is not in its register.
    fn bits(&self, session: &Session) -> Option<Option<u32>> {
        let next = session.emulator().next_address().get();
        if self.range.is_some_and(|(after, through)| next <= after || next > through)
            || self.shares
                && session.in_flight().iter().any(|(retire, _)| retire.register == Some(self.register))
        {
            return None;
        }
        Some(session.register(self.register))
    }
}

/// Reference: the visible values of a watched name, position by position.
struct Walk {
    values: Vec<NameValue>,
    other: Option<WatchExpression>,
    kind: Kind,
    /// Per value: bits when last seen, and whether they were above the other expression.
    last: Vec<Option<(Option<u32>, bool)>>,
    stops: Vec<u64>,
}

impl Walk {
    fn new(session: &Session, names: &Names, (what, kind): (&str, Kind)) -> Walk {
        let (name, _) = what.split_once(' ').unwrap_or((what, ""));
        let values = NameValue::each(names, name);
        let other = match kind {
            Kind::Changed => None,
            Kind::Above(other) => Some(session.parse(other).expect("it is a name")),
        };
        Walk { last: values.iter().map(|_| None).collect(), values, other, kind, stops: Vec::new() }
    }

    /// Position 0 has no previous value to compare with.
    fn visit(&mut self, session: &Session, position: u64) {
        let there = |live: &WatchExpression| Some(session.place(live).ok()??.2);
        let real = |bits: Option<u32>| bits.map(f32::from_bits);
        let other = self.other.as_ref().map(there);
        let mut hit = false;
        for (live, last) in self.values.iter().zip(&mut self.last) {
            let Some(bits) = live.bits(session) else { continue };
            if other == Some(None) {
                continue;
            }
            let is =
                real(bits).zip(real(other.flatten().flatten())).is_some_and(|(value, other)| value > other);
            let (before, was) = last.replace((bits, is)).unwrap_or_default();
            hit |= match self.kind {
                Kind::Changed => bits != before,
                Kind::Above(_) => is && !was,
            };
        }
        if hit && position > 0 {
            self.stops.push(position);
        }
    }
}

/// Maximum number of stops checked from each start, in each direction.
const MOST: usize = 8;

/// Stop positions of a repeated command.
fn all(session: &mut Session, command: impl Fn(&mut Session) -> StopReason) -> Vec<u64> {
    let mut positions = Vec::new();
    while positions.len() < MOST && matches!(command(session), StopReason::Stop { .. }) {
        positions.push(session.cycle());
    }
    positions
}

/// Stops before and after a position.
fn split(stops: &[u64], begin: u64) -> (Vec<u64>, Vec<u64>) {
    let back = stops.iter().rev().copied().filter(|stop| *stop < begin);
    (stops.iter().copied().filter(|stop| *stop > begin).take(MOST).collect(), back.take(MOST).collect())
}

#[test]
fn stops_are_independent_of_the_start() {
    let mut seen = 0;
    for (seed, machine) in (0..2).zip(MACHINES) {
        let AssembledProgram { program, names, .. } = assembled(seed, true, machine);
        let inputs = Some(Arc::new(rows(&program, seed, 9)));
        let options = Options { inputs, names: names.clone(), ..Options::default() };
        let fresh = || Session::new(&program, options.clone()).expect("it loads");
        let mut random = Random::new(seed);
        for &watch in WATCHES.iter().skip(seed as usize).step_by(2) {
            let mut session = fresh();
            let mut walk = Walk::new(&session, &names, watch);
            assert!(walk.values.len() > 3 && walk.values.len() < 60, "{watch:?}: {}", walk.values.len());
            // Half of the runs include an edit.
            let edit = random.once_in(2).then(|| u64::from(3000 + random.below(1000)));
            let edited = |session: &mut Session| {
                if let Some(edit) = edit {
                    session.go_to(edit);
                    let port = program.inputs[0].register;
                    session.set(Place::Register(port), 3f32.to_bits()).expect("a port");
                }
            };
            edited(&mut session);
            session.go_to(0);
            walk.visit(&session, 0);
            while session.go_to(session.cycle() + 1) == StopReason::Done {
                walk.visit(&session, session.cycle());
            }
            let (end, stops) = (session.cycle(), &walk.stops);
            seen += stops.len();
            let mut kept = fresh();
            edited(&mut kept);
            kept.add_stop(stop(&kept, watch));
            for begin in [0, end].into_iter().chain((0..3).map(|_| u64::from(random.below(end as u32)))) {
                let mut new = fresh();
                edited(&mut new);
                new.add_stop(stop(&new, watch));
                let (forward, back) = split(stops, begin);
                // One session with earlier searches, and a new one.
                for session in [&mut kept, &mut new] {
                    let told = format!("seed {seed}, {watch:?}, edit {edit:?}, from {begin}");
                    assert_eq!(session.go_to(begin), StopReason::Done);
                    assert_eq!(all(session, Session::resume), forward, "{told}");
                    assert_eq!(session.go_to(begin), StopReason::Done);
                    assert_eq!(all(session, Session::resume_back), back, "{told}, back");
                }
            }
        }
    }
    assert!(seen > 100, "{seen}");
}

/// A system of two cores that run such programs.
fn description() -> (Description, Vec<AssembledProgram>) {
    let programs: Vec<AssembledProgram> =
        (10..).zip(MACHINES).take(2).map(|(seed, machine)| assembled(seed, false, machine)).collect();
    let core = |number: usize| {
        let machine = MACHINES[number].name;
        format!("[[core]]\nname = \"c{number}\"\nprogram = \"{number}.s\"\nmachine = \"{machine}\"\n")
    };
    let text = format!("tick = 3000\n{}{}", core(0), core(1));
    let program = |request: &takt_system::Request<'_>| -> Result<_, takt_system::ProgramError<()>> {
        Ok(programs[usize::from(request.path == "1.s")].program.clone())
    };
    let Ok(description) = takt_system::read("system.toml", &text, program) else { panic!("it is one") };
    (description, programs)
}

fn is_stop(end: Result<End, String>) -> bool {
    matches!(end, Ok(End { why: StopReason::Stop { .. }, .. }))
}

/// Watches on a core of a system stop where those on a single core do.
#[test]
fn stops_of_a_systems_core_are_independent_of_the_start() {
    const END: u64 = 20_000;
    let (description, programs) = description();
    let fresh = || {
        let views = programs.iter().map(|assembled| {
            let options = Options { names: assembled.names.clone(), ..Options::default() };
            Session::new(&assembled.program, options).expect("it loads")
        });
        let session = SystemSession::new(&description, SystemOptions::default()).expect("it loads");
        let mut console = Console::of_system(session, views.collect());
        console.set_run_limit(2 * END);
        console
    };
    let mut seen = 0;
    let mut random = Random::new(3);
    for (core, watch) in [(0, WATCHES[0]), (1, WATCHES[3])] {
        let mut console = fresh();
        let mut walk = Walk::new(console.core(core).expect("a core"), &programs[core].names, watch);
        for position in 0..END {
            console.go(0, &Move::Cycle(position)).expect("it moves");
            walk.visit(console.core(core).expect("a core"), position);
        }
        let stops = &walk.stops;
        seen += stops.len();
        let add = |console: &mut Console| {
            let stop = stop(console.core(core).expect("a core"), watch);
            console.add_stop(core, stop);
        };
        let mut kept = fresh();
        add(&mut kept);
        for begin in [0, END - 1].into_iter().chain((0..5).map(|_| u64::from(random.below(END as u32)))) {
            let mut new = fresh();
            add(&mut new);
            let (forward, back) = split(stops, begin);
            for console in [&mut kept, &mut new] {
                let told = format!("core {core}, {watch:?}, from {begin}");
                console.go(0, &Move::Cycle(begin)).expect("it moves");
                let mut found = Vec::new();
                while found.len() < MOST
                    && is_stop(console.go(0, &Move::Resume))
                    && console.session().cycle() < END
                {
                    found.push(console.session().cycle());
                }
                assert_eq!(found, forward, "{told}");
                console.go(0, &Move::Cycle(begin)).expect("it moves");
                let mut found = Vec::new();
                while found.len() < MOST && is_stop(console.go(0, &Move::ResumeBack)) {
                    found.push(console.session().cycle());
                }
                assert_eq!(found, back, "{told}, back");
            }
        }
    }
    assert!(seen > 50, "{seen}");
}

/// An event at the end of a searched stretch takes effect a few positions later: shown for an input port of a random system.
#[test]
fn an_input_is_seen_over_the_end_of_a_stretch() {
    const END: u64 = 9000;
    let mut seen = 0;
    for seed in 0..16 {
        let description = random_description(seed, MACHINES);
        let cores = || description.cores.iter();
        let views = || cores().map(|core| Session::new(&core.program, Options::default()).expect("it loads"));
        let console = || {
            let session = SystemSession::new(&description, SystemOptions::default()).expect("it loads");
            let mut console = Console::of_system(session, views().collect());
            console.set_run_limit(2 * END);
            console
        };
        let Some(port) = description.cores[1].program.inputs.first() else { continue };
        let value = |console: &mut Console| console.core(1).expect("a core").register(port.register);
        let mut walking = console();
        let mut stops = Vec::new();
        let mut before = value(&mut walking);
        for position in 1..END {
            if walking.go(0, &Move::Cycle(position)).expect("it moves").why != StopReason::Done {
                break;
            }
            let now = value(&mut walking);
            if std::mem::replace(&mut before, now) != now {
                stops.push(position);
            }
        }
        seen += stops.len();
        // Stretches that end just before a change, at it, and after it.
        for stop in stops.iter().filter(|stop| **stop > 4200).take(3) {
            for begin in stop - 4096 - 4..=stop - 4096 + 4 {
                let mut watching = console();
                let what = watching.core(1).expect("a core").parse(&format!("{}:int", port.name));
                let what = Box::new(what.expect("it is a name"));
                let stop = Stop::Watch { what, test: Test::Changed, text: String::new() };
                watching.add_stop(1, stop);
                watching.go(0, &Move::Cycle(begin)).expect("it moves");
                let mut found = Vec::new();
                while watching.go(0, &Move::Resume).expect("it moves").why != StopReason::Done
                    && watching.session().cycle() < 4300 + begin
                {
                    found.push(watching.session().cycle());
                }
                let expected: Vec<u64> =
                    stops.iter().copied().filter(|stop| *stop > begin && *stop < 4300 + begin).collect();
                assert_eq!(found, expected, "seed {seed}, from {begin}");
            }
        }
    }
    assert!(seen > 20, "{seen}");
}
