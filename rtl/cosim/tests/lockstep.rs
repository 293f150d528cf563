// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lockstep of every machine's circuit and the emulator.
#![allow(clippy::print_stdout)]

use crate::common::{assemble, drive, latched_model, model};
use crate::random_source::{Random, source};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::OnceLock;
use takt_asm::{MemoryLoader, Options, Schedule};
use takt_cosim::corners::corners;
use takt_cosim::{Lockstep, LockstepError, Simulation, random};
use takt_isa::timing::Cause;
use takt_isa::{Bank, Function, Instruction, MACHINES, Machine, Program, ROWS, Slot, SlotIndex, T1, T3};

/// Seeds of random programs: `TAKT_PROGRAMS` of them (by default 200), from `TAKT_SEED` (by default 0) on.
fn seeds() -> Range<u64> {
    let number = |name: &str| Some(std::env::var(name).ok()?.parse::<u64>().expect("a number"));
    let first = number("TAKT_SEED").unwrap_or(0);
    first..first + number("TAKT_PROGRAMS").unwrap_or(200)
}

/// Prints the coverage, for `cargo evidence campaign`.
fn figures(machine: &Machine, coverage: &random::Coverage) {
    let (name, random::Coverage { programs, cycles, events, missed, .. }) = (machine.name, coverage);
    let words = |names: &BTreeSet<&str>| names.iter().map(|name| name.replace(' ', "-")).collect::<Vec<_>>();
    println!(
        "figures: {name}.programs={programs} {name}.cycles={cycles} {name}.events={events} {name}.ticks_missed={missed} \
         operations={} faults={}",
        words(&coverage.operations).join(","),
        words(&coverage.faults).join(","),
    );
}

#[test]
fn random_programs() {
    let (seeds, mut faults) = (seeds(), BTreeSet::new());
    let count = seeds.end - seeds.start;
    for machine in MACHINES {
        let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        let mut coverage = random::Coverage::default();
        println!("{}: seeds {} to {}", machine.name, seeds.start, seeds.end - 1);
        for seed in seeds.clone() {
            simulation = random::run(seed, machine, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{} seed {seed}: {error}", machine.name));
        }
        figures(machine, &coverage);
        let never: Vec<_> = ROWS
            .iter()
            .filter(|row| machine.host(row.function).is_some())
            .map(|row| row.mnemonic)
            .filter(|name| !coverage.operations.contains(name))
            .collect();
        assert_eq!(never, [""; 0], "{}: instructions that no program executed", machine.name);
        assert_eq!(coverage.stalls, Cause::kinds_of(machine).collect(), "{}", machine.name);
        assert!(coverage.missed > count, "{}: {} deadlines missed", machine.name, coverage.missed);
        faults.extend(coverage.faults);
    }
    for fault in [
        "data address",
        "illegal word",
        "loop count",
        "loop nesting",
        "loops too deep",
        "program counter",
        "return stack empty",
        "return stack full",
    ] {
        assert!(faults.contains(fault), "no program had the fault: {fault}");
    }
}

/// Short programs with one or two bits of a word changed: most stop at once, with results in flight.
#[test]
fn short_programs() {
    let seeds = seeds();
    for machine in MACHINES {
        let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        let mut coverage = random::Coverage::default();
        for seed in seeds.start..seeds.start + 3 * (seeds.end - seeds.start) {
            simulation = random::run_short(seed, machine, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{} seed {seed}: {error}", machine.name));
        }
        assert!(coverage.faults.contains("illegal word"), "{}: {:?}", machine.name, coverage.faults);
    }
}

/// Every instruction of every slot with each of its bits changed, a fifth of them unless `TAKT_FULL=1`: nearly all must be rejected.
#[test]
fn changed_words() {
    let is_full = std::env::var_os("TAKT_FULL").is_some();
    for machine in MACHINES {
        let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        let (mut coverage, mut refused) = (random::Coverage::default(), 0);
        let programs = random::words(machine);
        // Each instruction has 49 programs, which is not a multiple of 5, so the sample covers every bit.
        for program in programs.iter().step_by(if is_full { 1 } else { 5 }) {
            simulation = random::run_directed(program, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{}: {:x?}: {error}", machine.name, program.code));
            refused += u64::from(std::mem::take(&mut coverage.faults).contains("illegal word"));
        }
        assert!(programs.len() > 2000 && refused > 200, "{}: {refused} refused", machine.name);
    }
}

/// A result of every unit, read by every operand of every slot after every number of bundles.
#[test]
fn results_at_every_distance() {
    for machine in MACHINES {
        let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        let mut coverage = random::Coverage::default();
        for (i, program) in random::distances(machine).iter().enumerate() {
            simulation = random::run_directed(program, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{} program {i}: {error}", machine.name));
        }
        assert_eq!(coverage.faults, ["program counter"].into(), "each runs to its end: {}", machine.name);
    }
}

/// Calls to every depth, faults beside results and other faults, and loops across each carry of an address: each program ends with its
/// expected event, in the same cycle on both sides.
#[test]
fn directed_programs_end_with_their_expected_event() {
    for machine in MACHINES {
        let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        for corner in corners(machine) {
            let (name, mut coverage) =
                (format!("{}: {}", machine.name, corner.name), random::Coverage::default());
            simulation = random::run_corner(&corner, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(coverage.faults, corner.fault.into_iter().collect(), "{name}");
        }
    }
}

/// Programs with loops of 2^k + 1 iterations, which a single wrong bit would end early. They are not run to their end.
pub(crate) fn early_ends(machine: &'static Machine) -> Vec<Program> {
    let program = |(bit, body): (u32, usize)| {
        let source = format!(
            ".machine {}\n.reg n:int\n.once\n  li n, {count}\n  loop n, end\n  .loop_bound {count}\n{}end:\n  wait end\n.period\n  wait end\n",
            machine.name,
            "  nop\n".repeat(body),
            count = (1 << bit) + 1
        );
        let assembled =
            takt_asm::assemble("early.s", &MemoryLoader::of("early.s", source.as_str()), &Options::default());
        assembled.unwrap_or_else(|errors| panic!("{source}\n{}", errors.render(false))).program
    };
    (4..16).flat_map(|bit| (1..10).map(move |body| (bit, body))).map(program).collect()
}

/// Runs a program of [`early_ends`] for a few iterations; returns the simulation.
pub(crate) fn runs_early_end(program: &Program, simulation: Simulation) -> Result<Simulation, LockstepError> {
    let mut lockstep = Lockstep::new(program, simulation, &[])?;
    assert!(lockstep.run_until(120), "{:?}", lockstep.emulator().status());
    lockstep.finish()?;
    Ok(lockstep.into_simulation())
}

#[test]
fn loops_do_not_end_early() {
    for machine in MACHINES {
        let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        for program in early_ends(machine) {
            simulation = runs_early_end(&program, simulation)
                .unwrap_or_else(|error| panic!("{}: {error}", machine.name));
        }
    }
}

/// Program with long counted loops: each bit of a count is 1 in one loop and 0 in another; two loops are nested.
pub(crate) fn long_loops(machine: &'static Machine) -> Program {
    let counted = |count: u32| {
        format!(
            "  li n, {count}\n  loop n, end{count}\n  .loop_bound {count}\n  iadd x, x, one\nend{count}:\n"
        )
    };
    let loops: String = [0xa5a5, 0x5a5a, 300].into_iter().map(counted).collect();
    let source = format!(
        "
        .machine {}
        .output z:int
        .reg x:int, one:int, n:int, k:int
        .once
                wait    begin
        .period
        begin:  li      x, 0
                li      one, 1
        {loops}
                li      k, 3
                li      n, 1025
                loop    k, outer
                .loop_bound 3
                iadd    x, x, one
                loop    n, inner
                .loop_bound 1025
                nop
        inner:  iadd    x, x, one
        outer:  mov     z, x
                wait    begin
        ",
        machine.name
    );
    let assembled =
        takt_asm::assemble("loops.s", &MemoryLoader::of("loops.s", source.as_str()), &Options::default());
    assembled.unwrap_or_else(|errors| panic!("{source}\n{}", errors.render(false))).program
}

/// Counted loops of up to 42,405 iterations end at the right iteration.
#[test]
fn loops_of_many_iterations() {
    for machine in MACHINES {
        let simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        runs_long_loops(machine, simulation).unwrap_or_else(|error| panic!("{}: {error}", machine.name));
    }
}

/// Runs [`long_loops`]; returns the simulation.
pub(crate) fn runs_long_loops(
    machine: &'static Machine,
    simulation: Simulation,
) -> Result<Simulation, LockstepError> {
    let program = long_loops(machine);
    let mut lockstep = Lockstep::new(&program, simulation, &[])?;
    assert!(lockstep.run_period(&[]), "{:?}", lockstep.emulator().status());
    assert_eq!(lockstep.emulator().register(program.outputs[0].register), Some(0xa5a5 + 0x5a5a + 300 + 6));
    lockstep.finish()?;
    Ok(lockstep.into_simulation())
}

/// Rows other than the table's: four slots with two adders and two ALUs; two slots with iterative units, and banks of different depths
/// that leave gaps in the register space. The programs assembled for the first row use both adders and both ALUs.
#[test]
fn rows_of_an_independent_author() {
    use takt_isa::spec::units::*;
    let slot = |name, bank, base, depth, units| Slot { name, bank: Bank { name: bank, base, depth }, units };
    static FOUR: OnceLock<Machine> = OnceLock::new();
    static TWO: OnceLock<Machine> = OnceLock::new();
    let four = FOUR.get_or_init(|| Machine {
        name: "four",
        slots: Vec::leak(vec![
            slot("mul", "m", 0, 128, &[MULTIPLY, DIVROOT, SINE, ARCTANGENT]),
            slot("add", "a", 128, 128, &[ADD, CONVERT]),
            slot("sum", "b", 256, 128, &[ADD, ALU]),
            slot("aux", "x", 384, 128, &[ALU, MEMORY, SEQUENCER]),
        ]),
        inputs: Bank { name: "i", base: 896, depth: 128 },
        outputs_per_bank: 16,
        ..T3
    });
    let two = TWO.get_or_init(|| Machine {
        name: "two",
        slots: Vec::leak(vec![
            slot(
                "mul",
                "m",
                0,
                256,
                &[MULTIPLY, Unit { interval: 16, ..RECURRENCE }, Unit { interval: 9, ..SINE }],
            ),
            slot("rest", "a", 256, 128, &[ADD, CONVERT, ALU_LATE, MEMORY, SEQUENCER]),
        ]),
        ..T3
    });
    for machine in [four, two] {
        let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        let mut coverage = random::Coverage::default();
        for seed in 0..60 {
            simulation = random::run(seed, machine, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{} seed {seed}: {error}", machine.name));
        }
        assert!(coverage.events > 10_000, "{}: only {} events", machine.name, coverage.events);
        if machine == four {
            let programs = scheduled(machine, simulation, 0..10);
            for function in [Function::Add, Function::Alu] {
                for slot in machine.hosts(function).iter() {
                    let count = operations(&programs, function, slot);
                    assert!(count > 20, "slot {slot} has {count} of {function:?}");
                }
            }
        }
    }
}

/// Machine from a file (docs/machines.md): t3 with a second adder, with random programs and with scheduled ones, whose sums both adders
/// execute.
#[test]
fn machine_of_a_file() {
    let text =
        T3.to_toml().replace("name = \"t3\"", "name = \"t3a\"").replace("\"alu\",", "\"alu\",\n    \"add\",");
    let machine = takt_asm::machine::read("t3a.toml", &text)
        .unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false)));
    let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
    let mut coverage = random::Coverage::default();
    for seed in 0..20 {
        simulation = random::run(seed, machine, simulation, &mut coverage)
            .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    }
    assert!(coverage.events > 2000, "only {} events", coverage.events);
    let programs = scheduled(machine, simulation, 0..3);
    for slot in machine.hosts(Function::Add).iter() {
        let count = operations(&programs, Function::Add, slot);
        assert!(count > 5, "slot {slot} has {count} sums");
    }
}

/// Memories of other depths: random programs, which use both ends of the data memory, and a program that calls, branches, loads and stores
/// at the ends of both memories, with and without an index, and then leaves the memory at either end.
#[test]
fn memories_of_other_depths() {
    for (name, count) in
        [("t3,data=4096", 60), ("t1,code=4096,data=8192", 60), ("t3,code=65536,data=65536", 3)]
    {
        let machine = Machine::from_name(name).unwrap_or_else(|error| panic!("{error}"));
        let mut simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        let mut coverage = random::Coverage::default();
        for seed in 0..count {
            simulation = random::run(seed, machine, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{name} seed {seed}: {error}"));
        }
        assert!(coverage.events > 25 * count, "{name}: only {} events", coverage.events);
        let (bundles, words) = (machine.most_bundles(), machine.data_depth);
        let source = format!(
            "
            .machine {}{}
            .input  n:int
            .output y, z
            .reg    a, b
            .data
            low:    .float 1, 2
                    .space {words} - 4
            high:   .float 3, 4
            .once
                    wait    begin
            .period
            begin:  jmp     far
            .rep    i, 1, {bundles} - 10
                    nop
            .endr
            sum:    fadd    y, a, b
                    ret
            far:    ld      a, high+1
                    ld      b, 1[n]
                    call    sum
                    st      high, y
                    ld      z, [n]
                    wait    begin
            ",
            machine.row_name(),
            machine.options(),
        );
        let assembled =
            takt_asm::assemble("ends.s", &MemoryLoader::of("ends.s", source.as_str()), &Options::default());
        let program = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program;
        assert_eq!((program.machine, program.bundles()), (machine, bundles));
        let words = words.cast_signed();
        for (index, result) in [
            (words - 2, Some((8.0_f32, 8.0_f32))),
            (0, Some((6.0, 1.0))),
            (words - 1, None),
            (words, None),
            (-1, None),
            (-words, None),
            (i32::MAX, None),
            (i32::MIN, None),
        ] {
            let mut lockstep =
                Lockstep::new(&program, simulation, &[]).unwrap_or_else(|error| panic!("{error}"));
            lockstep.run_period(&[(program.inputs[0].register, index.cast_unsigned())]);
            lockstep.finish().unwrap_or_else(|error| panic!("{name}, index {index}: {error}"));
            let emulator = lockstep.emulator();
            let output = |i: usize| emulator.register(program.outputs[i].register).map(f32::from_bits);
            let outputs = lockstep.fault().is_none().then(|| output(0).zip(output(1))).flatten();
            assert_eq!(outputs, result, "{name}, index {index}");
            simulation = lockstep.into_simulation();
        }
    }
}

/// Half as many random programs with latched ports.
#[test]
fn random_programs_with_latched_ports() {
    let seeds = seeds();
    let count = (seeds.end - seeds.start) / 2;
    for machine in MACHINES {
        let model = latched_model(machine, machine.inputs.depth);
        let mut simulation = model.start(&[]).unwrap_or_else(|error| panic!("{error}"));
        let mut coverage = random::Coverage::default();
        for seed in seeds.start..seeds.start + count {
            simulation = random::run(seed, machine, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{} seed {seed}: {error}", machine.name));
        }
        assert!(coverage.missed > count, "{}: {} deadlines missed", machine.name, coverage.missed);
    }
}

/// A circuit has direct or latched ports, and a fixed number of latched ones.
#[test]
fn ports_of_program_and_circuit_must_agree() {
    let program = assemble(&T1, "hybrid/tracking.s");
    let latched = Program { latched: true, ..program.clone() };
    assert!(latched.latched_inputs() >= 16, "{} inputs are latched", latched.latched_inputs());
    for (program, ports) in [(&program, T1.inputs.depth), (&latched, 0), (&latched, 2)] {
        let simulation = latched_model(&T1, ports).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        assert!(matches!(Lockstep::new(program, simulation, &[]), Err(LockstepError::Ports { .. })));
    }
}

/// Runs a tracking program in closed loop with the robot for some periods, on the circuit with its latched ports.
fn tracking(program: &Program, periods: usize) {
    let model = latched_model(program.machine, program.latched_inputs());
    track(program, model.start(&[]).unwrap_or_else(|error| panic!("{error}")), periods);
}

/// Runs a tracking program on a given circuit, in closed loop.
pub(crate) fn track(program: &Program, simulation: Simulation, periods: usize) {
    let mut lockstep = Lockstep::new(program, simulation, &[]).unwrap_or_else(|error| panic!("{error}"));
    drive(program, periods, |inputs| -> Result<_, LockstepError> {
        assert!(lockstep.run_period(inputs), "{:?}", lockstep.emulator().status());
        lockstep.compare()?;
        let ports = program.outputs.iter().map(|port| port.register);
        Ok(ports.filter_map(|port| Some((port, lockstep.emulator().output_bits(port)?))).collect())
    });
    lockstep.finish().unwrap_or_else(|error| panic!("{}: {error}", program.machine.name));
    assert!(lockstep.compared() > 300 * periods as u64, "only {} events", lockstep.compared());
}

#[test]
fn tracking_programs() {
    for machine in MACHINES {
        let program = assemble(machine, "hybrid/tracking.s");
        tracking(&program, 100);
        tracking(&Program { latched: true, ..program }, 20);
        tracking(&assemble(machine, "hybrid/tracking_literal.s"), 20);
    }
}

/// Scheduled programs run alike on circuit and emulator, and give the same results as unscheduled ones.
#[test]
fn scheduled_programs() {
    for machine in MACHINES {
        let simulation = model(machine).start(&[]).unwrap_or_else(|error| panic!("{error}"));
        scheduled(machine, simulation, 0..30);
    }
}

/// Runs random sources on a machine, as written and scheduled; returns the programs.
fn scheduled(machine: &'static Machine, mut simulation: Simulation, seeds: Range<u64>) -> Vec<Program> {
    let mut programs = Vec::new();
    for seed in seeds {
        let text = source(seed);
        let mut outcomes = Vec::new();
        for schedule in [Schedule::None, Schedule::AsWritten] {
            let options = Options { machine, schedule, effort: 1, ..Options::default() };
            let assembled =
                takt_asm::assemble("random.s", &MemoryLoader::of("random.s", text.as_str()), &options);
            let program =
                assembled.unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false))).program;
            let mut lockstep =
                Lockstep::new(&program, simulation, &[]).unwrap_or_else(|error| panic!("{error}"));
            let random = &mut Random::new(seed + 77);
            let mut seen = Vec::new();
            for _ in 0..4 {
                let value = |random: &mut Random| (random.below(2000) as f32 / 64.0 - 10.0).to_bits();
                let inputs: Vec<_> =
                    program.inputs.iter().map(|port| (port.register, value(random))).collect();
                assert!(lockstep.run_period(&inputs), "{:?}", lockstep.emulator().status());
                lockstep.compare().unwrap_or_else(|error| panic!("seed {seed}: {error}\n{text}"));
                let outputs = program.outputs.iter();
                seen.extend(outputs.map(|port| lockstep.emulator().register(port.register)));
            }
            outcomes.push((seen, lockstep.emulator().memory().to_vec(), lockstep.emulator().flags()));
            lockstep.finish().unwrap_or_else(|error| panic!("seed {seed}: {error}\n{text}"));
            simulation = lockstep.into_simulation();
            programs.push(program);
        }
        assert_eq!(outcomes[0], outcomes[1], "seed {seed} on {}:\n{text}", machine.name);
    }
    programs
}

/// Number of operations of a function in a slot of some programs.
fn operations(programs: &[Program], function: Function, slot: SlotIndex) -> usize {
    let words = |program: &Program| {
        let slots = program.machine.slots.len();
        program.code.iter().skip(slot.index()).step_by(slots).copied().collect::<Vec<u64>>()
    };
    let decoded = programs.iter().flat_map(words).filter_map(|word| Instruction::decode(word).ok());
    decoded.filter(|instruction| instruction.op.row().function == function).count()
}
