// SPDX-License-Identifier: MIT OR Apache-2.0
//! The scheduler changes when operations issue, and nothing else: on random programs the scheduled program writes the same
//! values to every port, in the same order, and leaves the same memory and flags, in no more cycles than the source's order.

use crate::common;
use crate::random_source::{PUBLISHED, Random, source, source_with_loops};
use crate::rows;
use std::collections::BTreeMap;
use takt_asm::AssembledProgram;
use takt_asm::diag::{Diagnostics, Message, Severity};
use takt_asm::schedule::DemandKind;
use takt_asm::schedule::TimingReport;
use takt_asm::{MemoryLoader, Options, Schedule, assemble};
use takt_emu::{Emulator, Event};
use takt_isa::{F3, MACHINES, Machine, Program};

fn program(text: &str, machine: &'static Machine, schedule: Schedule, effort: u32) -> Program {
    let options = Options { machine, schedule, effort, ..Options::default() };
    let assembled = assemble("random.s", &MemoryLoader::of("random.s", text), &options);
    assembled.unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false))).program
}

/// Values written to each port, the memory, the flags, and the cycles of each period.
type RunResult = (BTreeMap<String, Vec<u32>>, Vec<u32>, u8);

fn run(program: &Program, seed: u64) -> (RunResult, Vec<u64>) {
    let random = &mut Random::new(seed + 77);
    let mut emulator = Emulator::new(program).expect("it fits");
    emulator.set_cycle_limit(1_000_000);
    let mut writes: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    let mut cycles = Vec::new();
    for _ in 0..4 {
        for port in &program.inputs {
            let bits = match random.below(4) {
                0 => random.below(9) as u32,
                1 => (random.below(1 << 32)) as u32,
                _ => (random.below(2000) as f32 / 64.0 - 10.0).to_bits(),
            };
            emulator.set_input_bits(port.register, bits).expect("it is an input");
        }
        let mut sink = |event: &Event| {
            if let Event::PortWrite(write) = event {
                writes.entry(program.register_text(write.register)).or_default().push(write.value);
            }
        };
        let report = emulator.observed(&mut sink).run_period(&[]).unwrap_or_else(|error| panic!("{error}"));
        cycles.push(report.cycles);
    }
    ((writes, emulator.memory().to_vec(), emulator.flags().bits()), cycles)
}

#[test]
fn scheduled_programs_compute_the_same() {
    let programs = common::programs(15, 200);
    let (mut before, mut after) = (0, 0);
    for seed in 0..programs {
        let text = if seed % 3 == 0 { source_with_loops(seed) } else { source(seed) };
        for machine in MACHINES {
            let plain = program(&text, machine, Schedule::None, 0);
            let (expected, plain_cycles) = run(&plain, seed);
            let scheduled = program(&text, machine, Schedule::AsWritten, 1);
            let (found, cycles) = run(&scheduled, seed);
            assert_eq!(found, expected, "seed {seed} on {}:\n{text}", machine.name);
            before += plain_cycles.iter().sum::<u64>();
            after += cycles.iter().sum::<u64>();
        }
    }
    // Scheduling saves a fifth of the cycles.
    assert!(10 * after < 8 * before, "{after} cycles scheduled, {before} as written");
}

/// Slots that share functions give the values of f3, in the cycles that the scheduler states and no fewer than its bound; the
/// disassembly, with the chosen slots, is the program.
#[test]
fn slots_that_share_functions_compute_the_same() {
    let mut machines: Vec<&'static Machine> = rows::all().iter().collect();
    let random = &mut Random::new(5);
    machines.extend((0..common::programs(3, 12)).map(|_| rows::random(|n| random.below(n))));
    let mut shared = 0;
    let programs = machines.len() * common::programs(1, 2) as usize;
    for (seed, machine) in (0..).zip(machines.iter().cycle()).take(programs) {
        for (text, is_block) in [(source(seed), false), (straight(seed), true)] {
            // A random row need not have the slots for a bundle.
            let text = if machine.name == "random" { text.replace(" || ", "\n ") } else { text };
            let expected = run(&program(&text, &F3, Schedule::None, 0), seed).0;
            let plain = program(&text, machine, Schedule::None, 0);
            assert_eq!(
                run(&plain, seed).0,
                expected,
                "seed {seed} as written on {:#?}:\n{text}",
                machine.slots
            );
            let options = Options { machine, effort: 1, ..Options::default() };
            let assembled = assemble("random.s", &MemoryLoader::of("random.s", text.as_str()), &options)
                .unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)));
            let (found, cycles) = run(&assembled.program, seed);
            assert_eq!(found, expected, "seed {seed} scheduled on {:#?}:\n{text}", machine.slots);
            for block in &assembled.blocks {
                assert!(block.bound.cycles() <= block.cycles, "{block:?} on {:#?}:\n{text}", machine.slots);
                shared +=
                    usize::from(block.bound.shared.iter().any(|one| one.cycles == block.bound.cycles()));
            }
            if is_block {
                let block = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
                let predicted = u64::from(block.expect("the period is a block").cycles);
                assert_eq!(cycles, [predicted; 4], "seed {seed} on {:#?}:\n{text}", machine.slots);
            }
            for program in [&plain, &assembled.program] {
                let text = takt_asm::disasm::disassemble(program);
                let again = assemble("again.s", &MemoryLoader::of("again.s", text.as_str()), &options);
                let again = again.unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)));
                assert_eq!(again.program.code, program.code, "{text}");
            }
        }
    }
    // Some bounds come from several slots together.
    assert!(
        shared > common::programs(programs as u64 / 2, 20) as usize,
        "{shared} blocks of {programs} programs"
    );
}

#[test]
fn the_same_source_gives_the_same_image() {
    for seed in 0..common::programs(2, 20) {
        let text = source(seed).replace("period:\n", ".late in0, in1 = 3\nperiod:\n");
        for machine in [MACHINES[0], rows::named("second_adder")] {
            let image = || {
                takt_asm::image::write(&program(&text, machine, Schedule::AsWritten, 3))
                    .expect("an image holds it")
            };
            assert_eq!(image(), image());
        }
    }
}

/// A source whose period has no branches: one block.
fn straight(seed: u64) -> String {
    source(seed)
        .replace(PUBLISHED, "")
        .lines()
        .filter(|l| ["skip", "flags", " of,"].iter().all(|word| !l.contains(word)))
        .fold(String::new(), |text, line| text + line + "\n")
}

#[test]
fn predicted_cycles_equal_the_machines() {
    for seed in 0..common::programs(10, 40) {
        let text = straight(seed);
        for machine in MACHINES {
            let options = Options { machine, effort: 1, ..Options::default() };
            let assembled = assemble("random.s", &MemoryLoader::of("random.s", text.as_str()), &options)
                .unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)));
            let block = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
            let predicted = u64::from(block.expect("the period is a block").cycles);
            let (_, cycles) = run(&assembled.program, seed);
            assert_eq!(cycles, [predicted; 4], "seed {seed} on {}:\n{text}", machine.name);
        }
    }
}

/// The shipped machines, and one in which the latency depends on the slot.
fn machines() -> impl Iterator<Item = &'static Machine> {
    MACHINES.iter().copied().chain([rows::named("late_alu")])
}

/// Assembles a source whose period has demands on ports.
fn demanding(text: &str, demand: &str, machine: &'static Machine) -> Result<AssembledProgram, Diagnostics> {
    let text = text.replace("period:\n", &format!("{demand}\nperiod:\n"));
    let options = Options { machine, effort: 1, ..Options::default() };
    assemble("random.s", &MemoryLoader::of("random.s", text), &options)
}

/// The first error, which is about a demand.
fn refusal(errors: &Diagnostics) -> Message {
    let error = errors.messages().into_iter().find(|message| message.severity == Severity::Error);
    error.filter(|error| error.code == "timing").unwrap_or_else(|| panic!("{}", errors.render(false)))
}

/// The cycles of a period in which a port's register is read or written, from 1.
fn seen_cycles(program: &Program, register: takt_isa::Register) -> Vec<u32> {
    let mut emulator = Emulator::new(program).expect("it fits");
    for port in &program.inputs {
        emulator.set_input_bits(port.register, 1.5f32.to_bits()).expect("it is an input");
    }
    emulator.run_to_wait().expect("it waits");
    let mut cycles = Vec::new();
    let mut sink = |event: &Event| match event {
        Event::PortWrite(write) if write.register == register => cycles.push(write.cycle),
        Event::Issue { cycle, address } => {
            let bundle = program.bundle(*address).and_then(Result::ok);
            if bundle.iter().flatten().any(|instruction| instruction.reads().contains(&register)) {
                cycles.push(*cycle);
            }
        }
        _ => {}
    };
    let report = emulator.observed(&mut sink).run_period(&[]).expect("it waits again");
    cycles.iter().map(|cycle| (cycle - report.start) as u32).collect()
}

/// A report on a port agrees with the machine.
fn agrees(report: &TimingReport, program: &Program, text: &str) {
    for (name, first, last) in &report.ports {
        let mut ports = program.inputs.iter().chain(&program.outputs);
        let port = ports.find(|port| port.name == *name).expect("it is a port");
        let cycles = seen_cycles(program, port.register);
        let found = (cycles.iter().min(), cycles.iter().max());
        assert_eq!(found, (Some(first), Some(last)), "{name} on {}:\n{text}", program.machine.name);
    }
}

#[test]
fn deadlines_are_met_or_refused() {
    let (mut met, mut refused) = (0, 0);
    let programs = common::programs(2, 20);
    for seed in 0..programs {
        let text = straight(seed);
        for machine in machines() {
            let random = &mut Random::new(seed * 7 + 3);
            let values = run(&program(&text, machine, Schedule::None, 0), seed).0;
            let free = demanding(&text, ".deadline oa = 100000", machine).expect("it has all the time");
            let [report] = &free.timing[..] else { panic!("one demand, one report") };
            agrees(report, &free.program, &text);
            // From far too early to the cycle without a deadline.
            let freely = report.ports[0].2;
            for earlier in [0, 1, random.below(8), random.below(16)] {
                let limit = freely.saturating_sub(earlier as u32).max(1);
                let demand = format!(".deadline {} = {limit}", random.pick(&["oa", "oa", "om, oa"]));
                match demanding(&text, &demand, machine) {
                    Ok(assembled) => {
                        met += 1;
                        let [report] = &assembled.timing[..] else { panic!("one demand, one report") };
                        assert_eq!(report.kind, DemandKind::Deadline(limit));
                        assert!(report.ports.iter().all(|(_, _, last)| *last <= limit), "{report:?}\n{text}");
                        agrees(report, &assembled.program, &text);
                        assert_eq!(run(&assembled.program, seed).0, values, "seed {seed}, {demand}:\n{text}");
                    }
                    Err(errors) => {
                        refused += 1;
                        let message = &refusal(&errors);
                        // No schedule is better than the stated bound.
                        if let Some((_, bound)) =
                            message.message.split_once("cannot be written before cycle ")
                        {
                            let bound: u32 = bound.parse().expect("a number");
                            assert!(bound > limit, "{message:?}");
                            let name = if message.message.contains("`oa`") { "oa" } else { "om" };
                            let all = format!(".deadline {name} = 100000");
                            let free = demanding(&text, &all, machine).expect("it has all the time");
                            assert!(free.timing[0].ports[0].2 >= bound, "{message:?}\n{text}");
                        }
                    }
                }
            }
        }
    }
    assert!(met > programs && refused > programs, "{met} met, {refused} refused");
}

#[test]
fn orders_are_kept_or_refused() {
    let (mut kept, mut refused) = (0, 0);
    for seed in 0..common::programs(5, 20) {
        let text = straight(seed);
        for machine in machines() {
            let random = &mut Random::new(seed * 5 + 1);
            let values = run(&program(&text, machine, Schedule::None, 0), seed).0;
            for _ in 0..3 {
                let mut ports = vec!["om", "oa", "ox", "in0"];
                let mut chosen = Vec::new();
                for _ in 0..2 + random.below(2) {
                    chosen.push(ports.remove(random.below(ports.len() as u64) as usize));
                }
                let demand = format!(".order {}", chosen.join(", "));
                match demanding(&text, &demand, machine) {
                    Ok(assembled) => {
                        kept += 1;
                        let [report] = &assembled.timing[..] else { panic!("one demand, one report") };
                        let ordered = report.ports.windows(2).all(|pair| pair[0].2 < pair[1].1);
                        assert!(ordered, "{demand}: {report:?}\n{text}");
                        agrees(report, &assembled.program, &text);
                        assert_eq!(run(&assembled.program, seed).0, values, "seed {seed}, {demand}:\n{text}");
                    }
                    Err(errors) => {
                        refused += 1;
                        refusal(&errors);
                    }
                }
            }
        }
    }
    assert!(kept > 10 && refused > 10, "{kept} kept, {refused} refused");
}

/// The source writes the ports the other way round.
#[test]
fn keeps_a_demanded_order_against_the_source() {
    let text = ".input x, y\n.output first, second\n.schedule on\n.period\nperiod:\n fabs first, x\n fabs second, y\n wait period\n";
    for machine in machines() {
        let assembled = demanding(text, ".order second, first", machine).expect("nothing is in its way");
        let [report] = &assembled.timing[..] else { panic!("one demand, one report") };
        assert!(report.ports[0].2 < report.ports[1].1, "{}: {report:?}", machine.name);
        agrees(report, &assembled.program, text);
    }
}

/// One slot hosts all loads and computes quickly; another slot has nothing to do, but takes longer. A deadline is met from the
/// quick slot.
#[test]
fn a_port_is_written_from_the_quickest_slot() {
    let mut text = String::from(
        ".input x\n.output o\n.reg r0 r1 r2 r3 r4\n.data\nt: .space 5\n.schedule on\n.period\nperiod:\n",
    );
    (0..5).for_each(|n| text += &format!(" ld r{n}, t+{n}\n"));
    text += " fabs o, x\n";
    (0..5).for_each(|n| text += &format!(" st t+{n}, r{}\n", 4 - n));
    text += " wait period\n";
    let machine = rows::named("late_alu");
    let assembled = demanding(&text, ".deadline o = 100", machine).expect("it has all the time");
    let [report] = &assembled.timing[..] else { panic!("one demand, one report") };
    agrees(report, &assembled.program, &text);
}

#[test]
fn late_reads_come_later_within_their_cost() {
    let (mut before, mut after) = (0, 0);
    for seed in 0..common::programs(3, 12) {
        let text = straight(seed);
        for machine in machines() {
            let values = run(&program(&text, machine, Schedule::None, 0), seed).0;
            let block = |assembled: &AssembledProgram| {
                let start = assembled.program.sections[1].start;
                let block = assembled.blocks.iter().find(|block| block.address == start);
                block.map(|block| (block.cycles, block.cycles == block.bound.cycles()))
            };
            let Ok(plain) = demanding(&text, ".deadline ox = 100000", machine) else { continue };
            for cost in [0, 4] {
                let demand = format!(".late in1, in2 = {cost}");
                let late = demanding(&text, &demand, machine).expect("a wish is never refused");
                let Some(report) = late.timing.first() else { continue };
                agrees(report, &late.program, &text);
                assert_eq!(run(&late.program, seed).0, values, "seed {seed}, {demand}:\n{text}");
                // Two searches without a proof may differ by a cycle, which is allowed here.
                let (length, allowed) = (block(&late), block(&plain));
                let allowed = allowed.map(|(cycles, shortest)| cycles + cost + u32::from(!shortest));
                assert!(
                    length.map(|(cycles, _)| cycles) <= allowed,
                    "seed {seed}, {demand}: {length:?}, {allowed:?}"
                );
                let first = |program: &Program| {
                    let ports = program.inputs.iter().filter(|port| ["in1", "in2"].contains(&&*port.name));
                    ports.flat_map(|port| seen_cycles(program, port.register)).min().unwrap_or(0)
                };
                before += first(&plain.program);
                after += first(&late.program);
                if let Some((window, bound)) = report.window {
                    assert!(bound <= window, "{report:?}");
                    let outputs = &late.program.outputs;
                    let last =
                        outputs.iter().flat_map(|port| seen_cycles(&late.program, port.register)).max();
                    assert!(first(&late.program) + window <= last.unwrap_or(0), "{report:?}");
                }
            }
        }
    }
    assert!(2 * after > 3 * before, "first reads in cycles {before} in all, late in {after}");
}

/// Three sums, one after another, and an operation that waits for none of them: the bound is the sums', up to the wait for the
/// last.
#[test]
fn a_block_is_no_shorter_than_its_chain() {
    let text = ".input x\n.output y, z\n.reg t\n.schedule on\n.period\nperiod:\n fadd t, x, x\n fadd t, t, x\n fadd y, t, x\n fabs z, x\n \
                wait period\n";
    for machine in MACHINES {
        let assembled = demanding(text, "", machine).expect("it asks for nothing");
        let [block] = &assembled.blocks[..] else { panic!("one block") };
        let (_, adder) = machine.host(takt_isa::Op::fadd.row().function).expect("it adds");
        assert_eq!(block.bound.critical_path, 3 * adder.latency + 1, "{}: {block:?}", machine.name);
    }
}

/// A small kernel packed by hand: the scheduler needs no more cycles, and the values are the same.
#[test]
fn as_good_as_by_hand() {
    let kernel = |name: &str, text: &str| {
        let assembled =
            assemble(name, &MemoryLoader::of(name, text), &Options { machine: &F3, ..Options::default() });
        let program = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program;
        let (seen, cycles) = run(&program, 5);
        let values: Vec<Vec<u32>> = seen.0.into_values().collect();
        (values, cycles.into_iter().max())
    };
    let (values, cycles) = kernel("arm.s", include_str!("kernels/arm.s"));
    let (expected, by_hand) = kernel("arm_by_hand.s", include_str!("kernels/arm_by_hand.s"));
    assert!(cycles <= by_hand, "{cycles:?} cycles scheduled, {by_hand:?} by hand");
    let sorted = |mut values: Vec<Vec<u32>>| {
        values.sort_unstable();
        values
    };
    assert_eq!(sorted(values), sorted(expected));
}

/// Cycles of the periods of random sources, in total: after the first passes, and after a short search. The upper limits keep changes
/// from lengthening them unnoticed.
#[test]
fn short_searches_keep_their_results() {
    let most = [(0, 23_608), (1, 5561)];
    let found = most.map(|(effort, _)| {
        let mut cycles = 0;
        for seed in 40..if effort == 0 { 70 } else { 46 } {
            let text = straight(seed);
            for machine in machines().chain([rows::named("second_adder")]) {
                let options = Options { machine, effort, ..Options::default() };
                let assembled = assemble("random.s", &MemoryLoader::of("random.s", text.as_str()), &options)
                    .unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)));
                let block = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
                cycles += block.map_or(0, |block| block.cycles);
            }
        }
        (effort, cycles)
    });
    assert!(
        found.iter().zip(&most).all(|(found, most)| found <= most),
        "{found:?} cycles by effort, {most:?} before"
    );
}

/// A source whose chain of sums leaves the adder free only when it ends, and a sum that the chain does not need.
const CHAIN: &str = ".input x\n.output y, z\n.reg t u v w\n.schedule on\n.period\nperiod:\n fadd t, x, x\n fadd u, t, x\n fadd v, u, t\n \
                     fadd w, v, u\n fadd z, w, v\n fadd y, x, 1.0\n wait period\n";

/// The machines with one adder, each with the cycle of its first result, from 1.
fn adders() -> impl Iterator<Item = (&'static Machine, u32)> {
    let adder = takt_isa::Op::fadd.row().function;
    let single = MACHINES.iter().copied().filter(move |machine| machine.hosts(adder).len() == 1);
    single.filter_map(move |machine| Some((machine, machine.host(adder)?.1.latency + 1)))
}

/// The earlier of two deadlines of one port counts, whatever their order.
#[test]
fn the_earlier_of_two_deadlines_counts() {
    for (machine, limit) in adders() {
        let free = demanding(CHAIN, ".deadline y = 100000", machine).expect("it has all the time");
        assert!(free.timing[0].ports[0].2 > limit, "{}: {:?}", machine.name, free.timing);
        for limits in [[limit, 100_000], [100_000, limit]] {
            let demand = limits.map(|limit| format!(".deadline y = {limit}\n")).concat();
            let assembled = demanding(CHAIN, &demand, machine)
                .unwrap_or_else(|errors| panic!("{}", errors.render(false)));
            assert_eq!(assembled.timing[0].ports[0].2, limit, "{}: {limits:?}", machine.name);
        }
    }
}

/// The bound of a block holds for all its schedules, not only for schedules that meet the deadlines.
#[test]
fn a_deadline_is_no_bound_of_the_block() {
    for (machine, limit) in adders() {
        let cycles = |demand: &str| {
            let assembled = demanding(CHAIN, demand, machine).expect("it can be met");
            let [block] = &assembled.blocks[..] else { panic!("one block") };
            (block.cycles, block.bound.cycles())
        };
        let (free, bound) = cycles("");
        let (met, other) = cycles(&format!(".deadline y = {}", limit));
        assert!(free < met, "{}: the chain waits", machine.name);
        assert_eq!((bound, other), (free, free), "{}", machine.name);
    }
}

/// An operation reads an input and writes a port: the window from read to write is the operation's latency, no less and no more, which
/// is the bound.
#[test]
fn the_least_window_is_its_bound() {
    let text = ".input x, a\n.output y\n.reg t\n.schedule on\n.period\nperiod:\n fsqrt t, a\n fadd y, t, x\n wait period\n";
    for (machine, first) in adders() {
        let late = demanding(text, ".late x = 0", machine).expect("a wish is never refused");
        assert_eq!(
            late.timing[0].window,
            Some((first - 1, first - 1)),
            "{}: {:?}",
            machine.name,
            late.timing
        );
    }
}

/// Two ports that can each be written in a cycle, but not both: the search goes on until its effort is spent, and says so.
#[test]
fn deadlines_that_exclude_one_another_are_refused() {
    let text = ".input x\n.output y, z\n.schedule on\n.period\nperiod:\n fadd y, x, x\n fadd z, x, 1.0\n wait period\n";
    for (machine, limit) in adders() {
        demanding(text, &format!(".deadline z = {limit}"), machine).expect("one can be met");
        let errors = demanding(text, &format!(".deadline y, z = {limit}"), machine).expect_err("both cannot");
        let message = refusal(&errors).message;
        assert!(
            message.ends_with(&format!("is written in cycle {}, demanded in {limit}", limit + 1)),
            "{message}"
        );
    }
}

/// A branch issues with the last operations of its block, if nothing else is in its way.
#[test]
fn a_branch_issues_with_the_last_operations() {
    let text = ".input x, n:int\n.output y, z\n.schedule on\n.period\nperiod:\n fmul y, x, x\n fadd z, x, x\n bnz n, other\n \
                wait period\nother:\n wait period\n";
    let assembled = demanding(text, "", &F3).expect("it asks for nothing");
    let block = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
    assert_eq!(block.map(|block| (block.cycles, block.bundles)), Some((1, 1)), "{:?}", assembled.blocks);
}
