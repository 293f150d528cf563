// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compiled blocks, interpreted blocks and the stepper agree in all observable state: random programs run in both modes, in the same
//! chunks.

use crate::common::machines;
use std::num::NonZeroU64;
use takt_emu::testing::{INPUTS, Options, Random, input_ports, random_program};
use takt_emu::{Emulator, Event, Fault, PeriodError, PeriodReport, Status, Stop};
use takt_isa::timing::Cause;
use takt_isa::{BundleAddress, Effect, MACHINES, Program, ROWS, Register, Row};

/// Number of programs of each kind for each machine.
const PROGRAMS: u64 = 1500;

/// One in this many programs is compiled: compilation takes longer than everything else here.
const COMPILED: u32 = 5;

/// Asserts that all externally observable state is equal.
fn assert_same(seed: u64, fast: &mut Emulator, step: &mut Emulator) {
    let now = step.now();
    let context = |what: &str| format!("seed {seed}: {what} in cycle {now}");
    assert_eq!(fast.now(), step.now(), "{}", context("now"));
    assert_eq!(fast.status(), step.status(), "{}", context("status"));
    assert_eq!(fast.next_address(), step.next_address(), "{}", context("next"));
    for register in Register::all() {
        assert_eq!(
            fast.register(register),
            step.register(register),
            "{}",
            context(&format!("register {register}"))
        );
    }
    for register in Register::all().filter(|register| fast.machine().is_output(*register)) {
        let (fast, step) = (fast.output_bits(register), step.output_bits(register));
        assert_eq!(fast, step, "{}", context(&format!("output at {register}")));
    }
    assert_eq!(fast.memory(), step.memory(), "{}", context("memory"));
    assert_eq!(fast.stack(), step.stack(), "{}", context("stack"));
    assert_eq!(fast.flags(), step.flags(), "{}", context("flags"));
    let in_flight = |emulator: &Emulator| {
        let mut all: Vec<_> = emulator.in_flight().copied().collect();
        all.sort_by_key(|retire| (retire.cycle, retire.slot));
        all
    };
    assert_eq!(in_flight(fast), in_flight(step), "{}", context("in_flight"));
    let statistics = fast.statistics();
    assert_eq!(statistics, step.statistics(), "{}", context("statistics"));
    assert_eq!(statistics.cycles, statistics.bundles + statistics.stalled(), "{}", context("accounting"));
    assert_eq!(statistics.stalls().iter().sum::<u64>(), statistics.stalled());
    assert_eq!(statistics.visits.iter().sum::<u64>(), statistics.bundles);
    assert_eq!(fast.deadline_missed(), step.deadline_missed(), "{}", context("missed"));
    let writes = fast.take_nan_writes();
    assert_eq!(writes, step.take_nan_writes(), "{}", context("NaN writes"));
    assert_eq!(fast.take_port_writes(), step.take_port_writes(), "{}", context("watched ports"));
}

/// Two emulators of a program, with equal random inputs. In some wild programs an input stays unset.
fn pair(program: &Program, random: &mut Random, wild: bool) -> [Emulator; 2] {
    let mut fast = Emulator::new(program).unwrap();
    for input in input_ports(program.machine) {
        if !(wild && random.once_in(20)) {
            fast.set_input_bits(input, random.word()).unwrap();
        }
    }
    // Watch about half of the output ports.
    let outputs = program.outputs.iter().map(|port| port.register);
    fast.set_watched(outputs.filter(|_| random.once_in(2)).collect::<Vec<_>>());
    // Compile some programs, if the host can, at once or after a few runs.
    let compiled = random.once_in(COMPILED).then(|| u64::from(random.below(3)));
    fast.set_compile_after(compiled);
    let mut step = fast.clone();
    step.set_blocks(false);
    [fast, step]
}

/// Gives every third program latched ports.
fn latched(seed: u64, program: Program) -> Program {
    Program { latched: seed % 3 == 2, ..program }
}

/// Runs both emulators in random chunks, with ticks at random times.
fn compare_runs(seed: u64, program: &Program, wild: bool) -> Result<Stop, Fault> {
    let mut random = Random::new(!seed);
    let [mut fast, mut step] = pair(program, &mut random, wild);
    if random.once_in(2) {
        let period = NonZeroU64::new(u64::from(1 + random.below(900)));
        for emulator in [&mut fast, &mut step] {
            emulator.set_tick_period(period);
        }
    }
    let limit = u64::from(1000 + random.below(3000));
    for emulator in [&mut fast, &mut step] {
        emulator.set_cycle_limit(limit);
    }
    loop {
        if random.once_in(10) {
            let pauses: Vec<BundleAddress> =
                (0..random.below(4)).map(|_| BundleAddress::new(random.below(program.bundles()))).collect();
            let acting: Vec<Register> = program.outputs.iter().map(|port| port.register).collect();
            let acting = &acting[..random.below(acting.len() as u32 + 1) as usize];
            for emulator in [&mut fast, &mut step] {
                emulator.set_pauses(pauses.iter().copied());
                emulator.set_acting(acting.iter().copied());
            }
        }
        if random.once_in(3) {
            let from = fast.now() + u64::from(random.below(400));
            for emulator in [&mut fast, &mut step] {
                emulator.set_pause_from(from);
            }
        }
        if random.once_in(4) {
            let port = input_ports(program.machine).nth(random.below(INPUTS as u32) as usize).unwrap();
            let bits = random.word();
            for emulator in [&mut fast, &mut step] {
                emulator.set_input_bits(port, bits).unwrap();
            }
        }
        for _ in 0..random.below(3) {
            let tick = fast.now() + u64::from(random.below(300));
            assert!(fast.tick_at(tick) && step.tick_at(tick));
        }
        let until = fast.now() + u64::from(random.below(400));
        let results = match random.below(4) {
            0 => [&mut fast, &mut step].map(|emulator| emulator.step_bundle()),
            1 => [&mut fast, &mut step].map(|emulator| emulator.run_to_wait()),
            _ => [&mut fast, &mut step].map(|emulator| emulator.run_until(until)),
        };
        assert_eq!(results[0], results[1], "seed {seed}");
        assert_same(seed, &mut fast, &mut step);
        if let [result @ (Err(_) | Ok(Stop::Halted)), _] = results {
            return result;
        }
    }
}

#[test]
fn tame_programs_agree() {
    for machine in machines() {
        for seed in 0..PROGRAMS {
            let program = latched(seed, random_program(seed, machine, Options::TAME));
            match compare_runs(seed, &program, false) {
                Err(fault) => {
                    assert!(
                        matches!(fault.kind, takt_emu::FaultKind::CycleLimit { .. }),
                        "seed {seed}: {fault}"
                    );
                }
                Ok(stop) => assert_eq!(stop, Stop::Halted),
            }
        }
    }
}

#[test]
fn wild_programs_agree() {
    let mut kinds = std::collections::BTreeMap::new();
    for machine in machines() {
        for seed in 0..PROGRAMS {
            let program = latched(seed, random_program(seed, machine, Options::WILD));
            let outcome = match compare_runs(seed, &program, true) {
                Ok(_) => "halt".to_owned(),
                Err(fault) => format!("{:?}", fault.kind).split([' ', '(']).next().unwrap().to_owned(),
            };
            *kinds.entry(outcome).or_insert(0) += 1;
        }
    }
    // Every kind of fault must have occurred several times.
    for kind in [
        "halt",
        "IllegalWord",
        "ProgramCounter",
        "DataAddress",
        "UnwrittenRegister",
        "StackOverflow",
        "StackUnderflow",
        "LoopOverflow",
        "LoopCount",
        "LoopNesting",
        "LoopBound",
        "CycleLimit",
    ] {
        assert!(kinds.get(kind).is_some_and(|&count| count >= 5), "{kind} is rare: {kinds:?}");
    }
}

/// A run pauses wherever a bundle with a breakpoint is about to issue, and nowhere else.
#[test]
fn pauses_are_complete() {
    let mut paused = 0;
    for machine in MACHINES {
        for seed in 0..PROGRAMS / 10 {
            let program = random_program(seed, machine, Options::TAME);
            let mut random = Random::new(seed);
            let [mut fast, mut step] = pair(&program, &mut random, false);
            let pauses: Vec<BundleAddress> =
                (0..2).map(|_| BundleAddress::new(random.below(program.bundles()))).collect();
            fast.set_pauses(pauses.iter().copied());
            for emulator in [&mut fast, &mut step] {
                emulator.set_tick_period(NonZeroU64::new(500));
            }
            while fast.now() < 3000 && fast.run_until(3000) == Ok(Stop::Paused) {
                paused += 1;
                while step.now() < fast.now() {
                    step.step_cycle().unwrap();
                    let upcoming = step.upcoming().filter(|upcoming| upcoming.issue.cycle == step.now());
                    let is_pause = upcoming.is_some_and(|upcoming| pauses.contains(&upcoming.address));
                    assert_eq!(is_pause, step.now() == fast.now(), "seed {seed}, cycle {}", step.now());
                }
                assert_same(seed, &mut fast, &mut step);
            }
            while step.now() < fast.now() {
                step.step_cycle().unwrap();
                let upcoming = step.upcoming().filter(|upcoming| upcoming.issue.cycle == step.now());
                let is_pause = upcoming.is_some_and(|upcoming| pauses.contains(&upcoming.address));
                assert!(!is_pause || step.now() == 3000, "seed {seed}, cycle {}", step.now());
            }
        }
    }
    assert!(paused > 1000, "{paused}");
}

/// Programs of arbitrary words: mostly instructions with random fields, in any slot.
#[test]
fn any_words_agree() {
    for machine in MACHINES {
        for seed in 0..PROGRAMS {
            let mut program = random_program(seed, machine, Options::TAME);
            let mut random = Random::new(seed);
            let registers = Register::all()
                .filter(|&register| register != Register::ZERO && machine.has_register(register));
            program.constants = registers.map(|register| (register, random.word())).collect();
            program.data.truncate(random.below(machine.data_depth) as usize);
            for word in &mut program.code {
                let row = &ROWS[random.below(ROWS.len() as u32) as usize];
                // Make some targets and destinations valid.
                let bits = random.bits()
                    & if random.once_in(2) { !0 } else { !0xffc0 }
                    & if random.once_in(4) { !0 } else { !(0x100 << 32) };
                match random.below(60) {
                    0 => *word = bits,
                    1..6 => {}
                    _ => *word = bits & row.shape.mask() & !(0x7f << 41) | u64::from(row.opcode) << 41,
                }
            }
            // Most programs fault soon; the modes must fault alike, without a panic.
            let _ = compare_runs(seed, &program, true);
        }
    }
}

/// Successive periods, with changing inputs and missed deadlines.
#[test]
fn periods_agree() {
    for machine in MACHINES {
        for seed in 0..PROGRAMS / 3 {
            let options = Options { bundles: 12, ..Options::TAME };
            let program = random_program(seed, machine, options);
            let mut random = Random::new(!seed);
            let [mut fast, mut step] = pair(&program, &mut random, false);
            let period = NonZeroU64::new(u64::from(random.below(1000)));
            for emulator in [&mut fast, &mut step] {
                emulator.set_tick_period(period);
            }
            for _ in 0..8 {
                let inputs = [("in0", random.word().into()), ("in3", random.word().into())];
                let reports = [&mut fast, &mut step].map(|emulator| emulator.run_period(&inputs));
                assert_eq!(reports[0], reports[1], "seed {seed}");
                assert_same(seed, &mut fast, &mut step);
                match &reports[0] {
                    Ok(PeriodReport { tick, start, wait, cycles, .. }) => {
                        assert!(tick <= start && start + cycles == *wait);
                    }
                    Err(PeriodError::Halted) => break,
                    Err(error) => panic!("seed {seed}: {error}"),
                }
            }
        }
    }
}

/// An observer does not change the run, and its events are consistent with the statistics.
#[test]
fn observed_runs_agree() {
    for machine in MACHINES {
        for seed in 0..PROGRAMS / 3 {
            let program = random_program(seed, machine, Options::WILD);
            let mut random = Random::new(!seed);
            let [mut fast, mut heard] = pair(&program, &mut random, true);
            for emulator in [&mut fast, &mut heard] {
                emulator.set_tick_period(NonZeroU64::new(500));
            }
            for emulator in [&mut fast, &mut heard] {
                emulator.set_cycle_limit(3000);
            }
            let mut events = Vec::new();
            let end = heard.observed(&mut |event| events.push(event.clone())).run();
            assert_eq!(fast.run(), end, "seed {seed}");
            assert_same(seed, &mut fast, &mut heard);

            let statistics = heard.statistics();
            let count = |which: fn(&Event) -> bool| events.iter().filter(|event| which(event)).count() as u64;
            assert_eq!(count(|event| matches!(event, Event::Issue { .. })), statistics.bundles);
            assert_eq!(count(|event| matches!(event, Event::Tick { .. })), statistics.ticks);
            assert_eq!(count(|event| matches!(event, Event::DeadlineMissed { .. })), statistics.missed);
            assert_eq!(count(|event| matches!(event, Event::TickLost { .. })), statistics.lost);
            let in_flight = heard.in_flight().count() as u64;
            assert_eq!(
                count(|event| matches!(event, Event::Retire(_))) + in_flight,
                statistics.total_operations(),
                "seed {seed}"
            );
            assert!(matches!(
                events.last(),
                Some(Event::Fault(_) | Event::Halt { .. } | Event::Retire(_) | Event::PortWrite(_))
            ));
            let written: Vec<_> = events
                .iter()
                .filter_map(|event| match event {
                    Event::Retire(retire) if retire.register.is_some() => Some((retire.cycle, retire.slot)),
                    _ => None,
                })
                .collect();
            assert!(written.is_sorted_by(|a, b| a < b), "seed {seed}: a bank has one write port");
            let cycles: Vec<u64> = events.iter().map(cycle).collect();
            let halted = matches!(heard.status(), Status::Halted { .. });
            assert!(halted || cycles.is_sorted(), "seed {seed}: events out of order");
        }
    }
}

fn cycle(event: &Event) -> u64 {
    match event {
        Event::Issue { cycle, .. }
        | Event::Tick { cycle }
        | Event::DeadlineMissed { cycle }
        | Event::TickLost { cycle }
        | Event::Publish { cycle, .. }
        | Event::Wait { cycle, .. }
        | Event::Halt { cycle, .. } => *cycle,
        Event::Retire(retire) => retire.cycle,
        Event::PortWrite(write) => write.cycle,
        Event::Fault(fault) => fault.cycle,
    }
}

/// Random programs cover every instruction, and on every machine every cause of stalls that it can have.
#[test]
fn random_programs_cover_the_machine() {
    for machine in MACHINES {
        let mut operations = [0; ROWS.len()];
        let mut stalls = [0; Cause::KINDS.len()];
        for seed in 0..200 {
            let program = random_program(seed, machine, Options::TAME);
            let mut emulator = pair(&program, &mut Random::new(seed), false)[0].clone();
            emulator.set_tick_period(NonZeroU64::new(2000));
            emulator.run_until(10_000).unwrap();
            let statistics = emulator.statistics();
            operations.iter_mut().zip(statistics.operations).for_each(|(sum, count)| *sum += count);
            stalls.iter_mut().zip(statistics.stalls()).for_each(|(sum, cycles)| *sum += cycles);
        }
        let hosted = |row: &&Row| machine.host(row.function).is_some();
        for row in ROWS.iter().filter(|row| row.effect != Effect::Nothing).filter(hosted) {
            assert!(operations[row.op as usize] > 0, "{}: no {}", machine.name, row.mnemonic);
        }
        let seen = Cause::KINDS.into_iter().zip(stalls).filter(|(_, cycles)| *cycles > 0);
        let kinds: Vec<_> = seen.map(|(kind, _)| kind).collect();
        assert_eq!(kinds, Cause::kinds_of(machine).collect::<Vec<_>>(), "{}", machine.name);
    }
}
