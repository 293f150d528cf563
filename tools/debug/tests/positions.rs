// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stop positions of a session, compared with a recording of the emulator's events that shares no code with the session's search.

use std::num::NonZeroU64;
use std::ops::RangeInclusive;
use std::sync::Arc;
use takt_debug::session::{Options, Session, Stop, StopReason, Test, Unit};
use takt_emu::Rows;
use takt_emu::testing::{Options as ProgramOptions, Random, input_ports, random_program};
use takt_emu::{Emulator, Event, PeriodError};
use takt_isa::program::Location;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Effect, Instruction, MACHINES, Program, Register};

/// Periods in a run.
const PERIODS: u64 = 4;
/// Maximum number of positions checked for `until`.
const HELD: usize = 150;

/// A random program whose bundles have source lines. With `bare`, nothing issues together with a `wait`, so nothing is in flight while
/// waiting.
fn program(seed: u64, bare: bool) -> Program {
    let machine = MACHINES[seed as usize % MACHINES.len()];
    let mut program = random_program(seed, machine, ProgramOptions::TAME);
    let slots = machine.slots.len();
    let filler = Instruction::NOP.encode().unwrap();
    let mut random = Random::new(seed);
    for address in 0..program.bundles() as usize {
        let words = address * slots..(address + 1) * slots;
        let waits = |word: u64| Instruction::decode(word).unwrap().effect() == Effect::Wait;
        if bare && program.code[words.clone()].iter().any(|word| waits(*word)) {
            for word in &mut program.code[words.clone()] {
                if !waits(*word) {
                    *word = filler;
                }
            }
        }
        let line = Location { file: 0, line: 1 + address as u32 / 2 };
        program.lines[words.start] = Some(line).filter(|_| !random.once_in(5));
    }
    program.files = vec!["a.s".to_owned()];
    program
}

/// Recorded events of a run.
struct Recording {
    program: Program,
    /// Issued bundles, by cycle.
    issues: Vec<(Cycle, BundleAddress)>,
    /// Register writes, by the first position at which they are visible.
    writes: Vec<(Cycle, Register, u32)>,
    /// Data memory writes, by the first position at which they are visible.
    stores: Vec<(Cycle, u32, u32)>,
    /// Length of the run in cycles.
    end: Cycle,
}

impl Recording {
    fn new(program: &Program, rows: &Rows, tick: Option<NonZeroU64>) -> Recording {
        let mut emulator = Emulator::new(program).unwrap();
        emulator.set_tick_period(tick);
        let mut recording = Recording {
            program: program.clone(),
            issues: vec![],
            writes: program.constants.iter().map(|&(register, bits)| (0, register, bits)).collect(),
            stores: vec![],
            end: 0,
        };
        for row in rows {
            for &(register, bits) in row {
                emulator.set_input_bits(register, bits).unwrap();
                recording.writes.push((emulator.now(), register, bits));
            }
            let Recording { issues, writes, stores, .. } = &mut recording;
            let mut sink = |event: &Event| match event {
                Event::Issue { cycle, address } => issues.push((*cycle, *address)),
                Event::Retire(retire) => {
                    if let Some(register) = retire.register {
                        writes.push((retire.cycle, register, retire.value));
                    } else if let Some(word) = retire.memory {
                        stores.push((retire.cycle + 1, word, retire.value));
                    }
                }
                _ => {}
            };
            match emulator.observed(&mut sink).run_period(&[]) {
                Ok(_) => {}
                Err(PeriodError::Halted) => break,
                Err(error) => panic!("{error}"),
            }
        }
        recording.end = emulator.now();
        // Results in flight at the end arrive later, but `halt` writes its results in flight at once.
        let halted = matches!(emulator.status(), takt_emu::Status::Halted { .. });
        for write in &mut recording.writes {
            write.0 = write.0.min(if halted { recording.end } else { Cycle::MAX });
        }
        recording.writes.sort_by_key(|(cycle, ..)| *cycle);
        recording
    }

    /// Value at each position, reconstructed from a list of changes.
    fn history<K: PartialEq + Copy>(
        &self,
        changes: &[(Cycle, K, u32)],
        place: K,
        first: Option<u32>,
    ) -> Vec<Option<u32>> {
        let mut changes = changes.iter().filter(|(_, changed, _)| *changed == place).peekable();
        let mut value = first;
        let at = |position| {
            while let Some((_, _, now)) = changes.next_if(|(cycle, ..)| *cycle <= position) {
                value = Some(*now);
            }
            value
        };
        (0..=self.end).map(at).collect()
    }

    fn register(&self, register: Register) -> Vec<Option<u32>> {
        self.history(&self.writes, register, None)
    }

    fn word(&self, word: u32) -> Vec<Option<u32>> {
        self.history(&self.stores, word, self.program.data.get(word as usize).copied())
    }

    /// Next bundle at each position up to the last issue.
    fn address(&self) -> Vec<Option<u32>> {
        let mut issues = self.issues.iter().peekable();
        let last = self.issues.last().unwrap().0;
        let at = |position| {
            while issues.next_if(|(cycle, _)| *cycle < position).is_some() {}
            issues.peek().map(|(_, address)| address.get())
        };
        (0..=last).map(at).collect()
    }

    /// Depth of the return stack at each position.
    fn depth(&self) -> Vec<Option<u32>> {
        let (mut issues, mut depth) = (self.issues.iter().peekable(), 0);
        let at = |position| {
            while let Some((_, address)) = issues.next_if(|(cycle, _)| *cycle < position) {
                for instruction in self.program.bundle(*address).unwrap().unwrap() {
                    match instruction.effect() {
                        Effect::Call => depth += 1,
                        Effect::Return => depth -= 1,
                        _ => {}
                    }
                }
            }
            Some(depth)
        };
        (0..=self.end).map(at).collect()
    }

    /// Positions just before the issue of a bundle whose line differs from that of the previous bundle.
    fn lines(&self) -> Vec<Cycle> {
        let line = |address| self.program.location(address);
        let begins = |i: &usize| {
            let (now, before) =
                (line(self.issues[*i].1), i.checked_sub(1).and_then(|i| line(self.issues[i].1)));
            now.is_some() && now != before
        };
        (0..self.issues.len()).filter(begins).map(|i| self.issues[i].0).collect()
    }
}

/// Runs under test: each program without and with results in flight during its waits; with a tick on demand, a tick that is sometimes
/// early, and a late tick.
fn runs(seeds: RangeInclusive<u64>) -> impl Iterator<Item = (String, Session, Recording)> {
    let cases = seeds.flat_map(|seed| [true, false].map(|bare| (seed, bare)));
    let cases = cases.flat_map(|(seed, bare)| [0, 211, 3001].map(|tick| (seed, bare, tick)));
    cases.map(|(seed, bare, tick)| {
        let (program, tick) = (program(seed, bare), NonZeroU64::new(tick));
        let mut random = Random::new(seed);
        let mut row = || input_ports(program.machine).map(|port| (port, random.word())).collect::<Vec<_>>();
        let rows: Rows = (0..PERIODS).map(|_| row()).collect();
        let recording = Recording::new(&program, &rows, tick);
        let options = Options { inputs: Some(Arc::new(rows)), tick, ..Options::default() };
        (
            format!("seed {seed}, bare {bare}, tick {tick:?}"),
            Session::new(&program, options).unwrap(),
            recording,
        )
    })
}

/// Stop positions of a command that is repeated up to the end or the start of the run.
fn all(session: &mut Session, mut command: impl FnMut(&mut Session) -> StopReason) -> Vec<Cycle> {
    let mut positions = vec![];
    while matches!(command(session), StopReason::Done | StopReason::Stop { .. } | StopReason::Holds) {
        positions.push(session.cycle());
    }
    positions
}

#[test]
fn steps_are_all_issues() {
    for (run, mut session, recording) in runs(0..=8) {
        let issues: Vec<Cycle> = recording.issues.iter().map(|(cycle, _)| *cycle).collect();
        for (unit, expected) in [(Unit::Bundle, issues), (Unit::Line, recording.lines())] {
            session.go_to(0);
            let forward = all(&mut session, |session| session.step(unit));
            assert_eq!(forward, expected, "{run}, {unit:?}");
            assert_eq!(session.go_to(recording.end), StopReason::Done, "{run}");
            let mut back = all(&mut session, |session| session.step_back(unit));
            back.reverse();
            assert_eq!(back, expected, "{run}, {unit:?}, back");
        }
    }
}

#[test]
fn calls_are_passed_over() {
    let mut inside = 0;
    for (run, mut session, recording) in runs(0..=8) {
        let depth = recording.depth();
        let depth = |cycle: Cycle| depth[cycle as usize].unwrap();
        let issues = || recording.issues.iter().map(|(cycle, _)| *cycle);
        let mut random = Random::new(recording.end);
        for _ in 0..8 {
            let from = Cycle::from(random.below(recording.end as u32));
            let here = depth(from);
            let over = issues().find(|cycle| *cycle > from && depth(*cycle) <= here);
            session.go_to(from);
            let stopped = session.step(Unit::Call) == StopReason::Done;
            assert_eq!(over, stopped.then(|| session.cycle()), "{run}, call from {from}");
            session.go_to(from);
            let before = issues().rfind(|cycle| *cycle < from && depth(*cycle) <= here);
            let stopped = session.step_back(Unit::Call) == StopReason::Done;
            assert_eq!(before, stopped.then(|| session.cycle()), "{run}, back call from {from}");
            if here > 0 {
                inside += 1;
                let out = issues().find(|cycle| *cycle > from && depth(*cycle) < here);
                session.go_to(from);
                let stopped = session.step(Unit::Out) == StopReason::Done;
                assert_eq!(out, stopped.then(|| session.cycle()), "{run}, out from {from}");
            }
        }
    }
    assert!(inside > 10, "{inside}");
}

/// Watched expressions with their values at each position.
fn watched(recording: &Recording, random: &mut Random) -> Vec<(String, Vec<Option<u32>>)> {
    let machine = recording.program.machine;
    let name = |register| format!("@{}:bits", machine.register_name(register).unwrap());
    let written: Vec<Register> = recording.writes.iter().map(|(_, register, _)| *register).collect();
    let mut all: Vec<(String, Vec<Option<u32>>)> = (0..3)
        .map(|_| written[random.below(written.len() as u32) as usize])
        .chain(machine.inputs.registers().take(1))
        .map(|register| (name(register), recording.register(register)))
        .collect();
    if let Some((_, word, _)) = recording.stores.first() {
        all.push((format!("[{word}]:bits"), recording.word(*word)));
    }
    all.push(("address".to_owned(), recording.address()));
    all.push(("depth".to_owned(), recording.depth()));
    all
}

#[test]
fn watch_and_until_see_every_change() {
    let mut seen = 0;
    for (run, mut session, recording) in runs(16..=20) {
        let mut random = Random::new(recording.end);
        for (text, history) in watched(&recording, &mut random) {
            let end = history.len() as Cycle - 1;
            let within =
                |positions: Vec<Cycle>| positions.into_iter().filter(|at| *at <= end).collect::<Vec<_>>();
            let what = session.parse(&text).unwrap();
            let changes: Vec<Cycle> =
                (1..=end).filter(|at| history[*at as usize] != history[*at as usize - 1]).collect();
            seen += changes.len();
            session.go_to(0);
            let stop = Stop::Watch { what: Box::new(what), test: Test::Changed, text: String::new() };
            let id = session.add_stop(stop);
            let forward = all(&mut session, Session::resume);
            assert_eq!(within(forward), changes, "{run}, watch {text}");
            let mut back = all(&mut session, Session::resume_back);
            back.reverse();
            assert_eq!(within(back), changes, "{run}, watch {text}, back");
            session.remove_stop(id);

            let Some(value) = history[random.below(end as u32 + 1) as usize] else { continue };
            let live = session.parse(&format!("{text} == {value}")).unwrap();
            let holds: Vec<Cycle> =
                (1..=end).filter(|at| history[*at as usize] == Some(value)).take(HELD).collect();
            session.go_to(0);
            let found: Vec<Cycle> = holds
                .iter()
                .map_while(|_| (session.run_until(&live) == StopReason::Holds).then(|| session.cycle()))
                .collect();
            assert_eq!(found, holds, "{run}, until {text} == {value}");
        }
    }
    assert!(seen > 500, "{seen}");
}
