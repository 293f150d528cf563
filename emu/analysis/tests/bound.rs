// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds against the emulator: equal where no branch depends on data, never exceeded anywhere.

use std::collections::BTreeSet;
use std::num::NonZeroU64;
use takt_analysis::{Bounds, Refusal, SectionBounds, bound, section_cycles};
use takt_asm::{MemoryLoader, Options, assemble};
use takt_emu::testing::{self, Random, input_ports, random_program};
use takt_emu::{Emulator, FaultKind, PeriodError, PeriodReport, Stop};
use takt_isa::timing::{Cycle, Span};
use takt_isa::{BundleAddress, F3, MACHINES, Machine, Program, T3};

fn shipped(name: &str, machine: &'static Machine) -> Program {
    let loader = MemoryLoader::new(takt_programs::SOURCES);
    let options = Options { machine, ..Options::default() };
    assemble(&format!("hybrid/{name}.s"), &loader, &options).unwrap().program
}

fn source(text: &str, machine: &'static Machine) -> Program {
    let options = Options { machine, ..Options::default() };
    takt_asm::assemble_bytes("test.s", text.into(), &MemoryLoader::new(&[]), &options).unwrap().program
}

/// Cycles of a section, and the way in which it was entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SectionEntry {
    Reset,
    /// A tick this many cycles after the `wait`.
    Tick(Cycle),
    Missed,
}

#[derive(Clone, Copy, Debug)]
struct SectionCycles {
    address: BundleAddress,
    entered: SectionEntry,
    cycles: Cycle,
    /// Cycles to the publication of a period's outputs.
    published: Option<Cycle>,
}

/// Runs a program: the section `.once`, then up to `periods` periods. Ends early where the program halts.
fn measure(
    emulator: &mut Emulator,
    periods: u32,
    mut inputs: impl FnMut(&mut Emulator),
) -> Vec<SectionCycles> {
    inputs(emulator);
    let mut all = Vec::new();
    let mut waited = match emulator.run_to_wait().unwrap() {
        Stop::Wait { cycle, .. } => cycle,
        stop => {
            assert_eq!(stop, Stop::Halted);
            emulator.now() - 1
        }
    };
    all.push(SectionCycles {
        address: BundleAddress::RESET,
        entered: SectionEntry::Reset,
        cycles: waited + 1,
        published: None,
    });
    for _ in 0..periods {
        inputs(emulator);
        // Target of the `wait`, whether its tick has come or not.
        let address = emulator.next_address();
        match emulator.run_period(&[]) {
            Ok(PeriodReport { tick, start, published, wait, cycles, .. }) => {
                let entered = if start == tick && tick > waited {
                    SectionEntry::Tick(tick - waited)
                } else {
                    SectionEntry::Missed
                };
                all.push(SectionCycles { address, entered, cycles, published: Some(published - start) });
                waited = wait;
            }
            Err(PeriodError::Halted) => break,
            Err(error) => panic!("{error}"),
        }
    }
    all
}

fn section(bounds: &Bounds, measured: SectionCycles) -> &SectionBounds {
    let once = measured.entered == SectionEntry::Reset;
    bounds
        .sections
        .iter()
        .find(|section| (section.once, section.address) == (once, measured.address))
        .unwrap_or_else(|| panic!("{measured:?} has no section in {bounds:?}"))
}

/// Asserts that the measured cycles lie within the bounds. Returns whether the best and the worst case are equal.
fn check(bounds: &Bounds, measured: SectionCycles, refill: u32) -> bool {
    let section = section(bounds, measured);
    let span = match measured.entered {
        SectionEntry::Missed => section.missed,
        SectionEntry::Tick(after) if after < refill.into() => section.in_time,
        SectionEntry::Tick(_) | SectionEntry::Reset => section.cycles,
    };
    assert!(
        span.best <= measured.cycles && measured.cycles <= span.worst,
        "{measured:?} is not in {section:?}"
    );
    if let Some(cycles) = measured.published {
        let published = section.published.map(|published| match measured.entered {
            SectionEntry::Missed => published.missed,
            SectionEntry::Tick(after) if after < refill.into() => published.in_time,
            SectionEntry::Tick(_) | SectionEntry::Reset => published.cycles,
        });
        // Without a `publish`, the `wait` publishes.
        let to_outputs = published.unwrap_or(Span { best: measured.cycles, worst: measured.cycles });
        assert!(
            to_outputs.best <= cycles && cycles <= to_outputs.worst,
            "the publication of {measured:?} is not in {section:?}"
        );
    }
    span.best == span.worst
}

/// The cycles to a `publish`, on two paths of which one has none, and behind a loop.
#[test]
fn a_publication_has_bounds_of_its_own() {
    let text = "
.ports latched
.input n:int x
.output o
.reg k:int t
.once
        wait    period
.period
period: mov     o, x
        bz      n, without
        mov     k, 3
again:  .loop_bound 3
        isub    k, k, 1
        bnz     k, again
        publish
        fsqrt   t, x
        fadd    _e, t, x
        wait    period
without: wait   period
.reg _e
";
    for machine in MACHINES {
        let program = source(text, machine);
        let bounds = bound(&program).unwrap();
        let [_, period] = &bounds.sections[..] else { panic!("{bounds:?}") };
        let published = period.published.expect("it publishes");
        assert_eq!(published.cycles.best, period.cycles.best, "the short path has no `publish`");
        assert!(published.cycles.worst + 10 < period.cycles.worst, "{period:?}");
        assert_eq!(period.to_outputs(), published.cycles);
        let mut emulator = Emulator::new(&program).unwrap();
        let mut found = BTreeSet::new();
        for (n, blocks) in [(0, true), (1, true), (1, false)] {
            emulator.set_blocks(blocks);
            let set = |emulator: &mut Emulator| {
                emulator.set_input("x", 2.0.into()).unwrap();
                emulator.set_input("n", n.into()).unwrap();
            };
            for one in measure(&mut emulator, 3, set).into_iter().skip(1) {
                check(&bounds, one, machine.refill);
                found.extend(one.published);
            }
            emulator.reset();
        }
        assert_eq!(found, BTreeSet::from([published.cycles.best, published.cycles.worst]));
    }
}

#[test]
fn shipped_programs_take_exactly_their_bounds() {
    for machine in MACHINES {
        for name in ["tracking", "tracking_literal"] {
            let program = shipped(name, machine);
            let bounds = bound(&program).unwrap();
            assert_eq!(bounds.sections.len(), 3, "once, the first period, the others: {bounds:?}");
            assert_eq!(bounds.steps, 3, "a straight run each");
            let worst = bounds.worst_period().unwrap();
            let steady = bounds.sections.last().unwrap().in_time.worst;
            for tick in [None, Some(1), Some(steady - 20), Some(steady), Some(worst + 1), Some(12_500)] {
                let mut emulator = Emulator::new(&program).unwrap();
                emulator.set_tick_period(tick.and_then(NonZeroU64::new));
                let set = |emulator: &mut Emulator| {
                    for port in &program.inputs {
                        emulator.set_input_bits(port.register, 0).unwrap();
                    }
                };
                let measured = measure(&mut emulator, 20, set);
                assert_eq!(measured.len(), 21);
                for &one in &measured {
                    check(&bounds, one, machine.refill);
                    let SectionBounds { cycles, missed, .. } = section(&bounds, one);
                    assert_eq!(
                        (cycles.best, missed.best),
                        (cycles.worst, missed.worst),
                        "{name} does not branch"
                    );
                }
                // The first period begins at a different bundle.
                let periods = bounds.sections.iter().filter(|section| !section.once);
                let measured: BTreeSet<BundleAddress> = measured[1..].iter().map(|one| one.address).collect();
                assert!(measured.into_iter().eq(periods.map(|section| section.address)));
                // A tick period above the worst case keeps every deadline. A shorter one misses some, perhaps only after a while: each
                // late period leaves less of the refill hidden in the next.
                assert_eq!(
                    emulator.deadline_missed(),
                    tick.is_some_and(|tick| tick <= worst),
                    "{name} {tick:?}"
                );
            }
        }
    }
}

/// Sets random inputs before every period.
fn random_inputs(random: &mut Random) -> impl FnMut(&mut Emulator) + use<'_> {
    |emulator| {
        for input in input_ports(emulator.machine()) {
            emulator.set_input_bits(input, random.word()).unwrap();
        }
    }
}

fn random_programs(
    options: testing::Options,
    programs: u64,
    mut judge: impl FnMut(u64, &Program, &Bounds, &[SectionCycles]),
) {
    for machine in MACHINES {
        for seed in 0..programs {
            let program = random_program(seed, machine, options);
            let bounds =
                bound(&program).unwrap_or_else(|error| panic!("seed {seed} on {}: {error}", machine.name));
            let mut random = Random::new(!seed);
            for _ in 0..3 {
                let mut emulator = Emulator::new(&program).unwrap();
                if random.once_in(2) {
                    emulator.set_tick_period(NonZeroU64::new(u64::from(1 + random.below(900))));
                }
                let measured = measure(&mut emulator, 6, random_inputs(&mut random));
                judge(seed, &program, &bounds, &measured);
            }
        }
    }
}

#[test]
fn straight_programs_take_exactly_their_bounds() {
    let options = testing::Options { control: false, ..testing::Options::TAME };
    let mut kinds = [0; 3];
    random_programs(options, 300, |seed, program, bounds, measured| {
        for &one in measured {
            let exact = check(bounds, one, program.machine.refill);
            // The bundle of the `wait` may leave results in flight, so the period's cycles may depend on when the tick comes.
            let section = section(bounds, one);
            if one.entered == SectionEntry::Reset {
                assert!(exact, "seed {seed}");
            } else if section.cycles == section.in_time {
                assert_eq!(section.missed.best, section.missed.worst, "seed {seed}");
            }
            kinds[match one.entered {
                SectionEntry::Reset => 0,
                SectionEntry::Tick(_) => 1,
                SectionEntry::Missed => 2,
            }] += 1;
        }
    });
    assert!(kinds.iter().all(|&count| count > 500), "{kinds:?}");
}

#[test]
fn random_programs_keep_to_their_bounds() {
    let (mut tight, mut wide, mut reached) = (0, 0, [0; 2]);
    random_programs(testing::Options::TAME, 300, |_, program, bounds, measured| {
        for &one in measured {
            if check(bounds, one, program.machine.refill) {
                tight += 1;
            } else {
                wide += 1;
                let section = section(bounds, one);
                reached[0] += u32::from(one.cycles == section.in_time.best);
                reached[1] += u32::from(one.cycles == section.in_time.worst);
            }
        }
    });
    // Bounds must be tight: some runs reach the best and the worst case.
    assert!(
        tight > 1000 && wide > 1000 && reached.iter().all(|&count| count > 20),
        "{tight} {wide} {reached:?}"
    );
}

/// Sources without a bound, with the refusal; each message names the line.
#[test]
fn rejects_unbounded_programs() {
    let cases = [
        (
            "loop: nop\n jmp loop\n",
            "test.s:1: bundle 0 (loop): a loop begins here (test.s:2: bundle 1 (loop + 1) leads back)",
        ),
        (".input n\nloop: nop\n bnz n, loop\n halt\n", "test.s:2: bundle 0 (loop): a loop begins here"),
        (".input n\n.loop_bound 3\nloop: nop\n bz n, on\n jmp loop\non: halt\n nop\n", ""),
        (".loop_bound 3\n nop\n halt\n", "test.s:2: bundle 0: .loop_bound stands here"),
        // Control that falls into the head restarts the count.
        (
            ".input n\n jmp head\na: jmp head\n.loop_bound 3\nhead: bz n, a\n bnz n, head\n halt\n",
            "test.s:5: bundle 2 (head): this loop has a bound, but test.s:3: bundle 1 (a) leads to it again",
        ),
        (" call f\n halt\nf: nop\n call f\n ret\n", "test.s:4: bundle 3 (f + 1): recursion"),
        (" call f\n halt\nf: call g\n ret\ng: call f\n ret\n", "test.s:5: bundle 4 (g): recursion"),
        (" nop\n ret\n", "test.s:2: bundle 1: a return without a call"),
        (" call f\n halt\nf: wait f\n", "test.s:3: bundle 2 (f): `wait` within a subroutine"),
        (" nop\n nop\n", "bundle 2: execution continues past the end"),
        (" .raw aux 0\n halt\n", "illegal word in slot aux"),
    ];
    for (text, wanted) in cases {
        let result = bound(&source(text, &F3));
        match result {
            Ok(_) => assert_eq!(wanted, "", "{text}"),
            Err(error) => {
                assert!(!wanted.is_empty() && error.to_string().contains(wanted), "{text}: {error}");
            }
        }
    }
    let calls: String = (0..20).map(|i| format!("f{i}: call f{}\n ret\n", i + 1)).collect();
    let error = bound(&source(&format!(" call f0\n halt\n{calls}f20: ret\n"), &F3)).unwrap_err();
    assert!(matches!(error.refusal, Refusal::StackOverflow { needed: 21, depth: 16 }), "{error}");
}

/// Sequencer-counted loops in subroutines add to the caller's nesting depth, as in a run.
#[test]
fn loops_deeper_than_the_sequencer_counts_have_no_bound() {
    let text = ".reg k:int\n.once\n k = 0\n .for i, 1, 9\n .for j, 1, 9\n call sub\n .endfor\n .endfor\n halt\n\
                sub:\n .for h, 1, 9\n k = k + 1\n .endfor\n ret\n";
    let mut program = source(text, &T3);
    assert!(bound(&program).is_ok());
    let run = |program: &Program| Emulator::new(program).expect("it fits").run();
    assert_eq!(run(&program), Ok(Stop::Halted));
    program.machine = Box::leak(Box::new(Machine { loop_depth: 2, ..T3 }));
    let error = bound(&program).unwrap_err();
    assert!(matches!(error.refusal, Refusal::LoopOverflow { needed: 3, depth: 2 }), "{error}");
    assert!(run(&program).is_err());
}

/// Loop of `turns` iterations around a loop of 3; the counter's register is `n`.
fn nest(turns: u32, bound: u32) -> String {
    format!(
        ".reg n:int m:int\n.output k:int\n.once\n li n, {turns}\n.loop_bound {bound}\nouter: li m, 3\n.loop_bound 3\n\
         inner: isub m, m, 1\n bnz m, inner\n isub n, n, 1\n bnz n, outer\n mov k, n\n halt\n"
    )
}

#[test]
fn counted_loops_are_bounded_by_their_turns() {
    for machine in MACHINES {
        for turns in [1, 2, 7, 1000] {
            let program = source(&nest(turns, turns), machine);
            let bounds = bound(&program).unwrap();
            let mut emulator = Emulator::new(&program).unwrap();
            assert_eq!(emulator.run(), Ok(Stop::Halted));
            assert_eq!(bounds.sections[0].cycles.worst, emulator.now(), "all turns are taken: the worst");
            // A loop bound that is too small by one is a fault in both modes.
            if turns > 1 {
                let program = source(&nest(turns, turns - 1), machine);
                for blocks in [true, false] {
                    let mut emulator = Emulator::new(&program).unwrap();
                    emulator.set_blocks(blocks);
                    let fault = emulator.run().unwrap_err();
                    assert_eq!(fault.kind, FaultKind::LoopBound { most: turns - 1 });
                    let shown = fault.show(&program).to_string();
                    assert!(shown.starts_with("test.s:6: bundle 1"), "{shown}");
                }
            }
        }
        // Bounding a steady loop takes no longer for more iterations.
        let bounds = bound(&source(&nest(u32::MAX, u32::MAX), machine)).unwrap();
        let small = bound(&source(&nest(1000, 1000), machine)).unwrap().sections[0].cycles.worst;
        let each = small - bound(&source(&nest(999, 999), machine)).unwrap().sections[0].cycles.worst;
        assert_eq!(bounds.sections[0].cycles.worst, small + each * (Cycle::from(u32::MAX) - 1000));
        assert!(bounds.steps < 1000, "{}", bounds.steps);
    }
}

/// Nest of counted loops whose bounds depend on the loops around, on constants and, if `varies`, on an input `n` up to 9.
fn triangular(random: &mut Random, varies: bool) -> String {
    let mut text = String::from(
        ".input n:int, x\n.output y\n.array V[80]\n.reg s\n.schedule on\n.once\n wait period\n.period\nperiod:\n mov s, zero\n",
    );
    let depth = 2 + random.below(2);
    for level in 0..depth {
        let outer = |level: u32| format!("{}*i{level} + {}", 1 + level % 2, level + 1);
        let (first, last) = (1 + random.below(3), 3 + random.below(6));
        text.push_str(&match (level, random.below(3)) {
            (0, _) | (_, 0) if !varies || level + 1 < depth => format!(".for i{level}, {first}, {last}\n"),
            (0, _) | (_, 0) => format!(".for i{level}, {first}, n max 9\n"),
            (_, 1) => format!(".for i{level}, {}, {}\n", first, outer(level - 1)),
            _ => format!(".for i{level}, i{}, {}\n", level - 1, 9 + last),
        });
        if random.below(3) == 0 {
            text.push_str(" s = s + x\n");
        }
    }
    let last = depth - 1;
    for _ in 0..1 + random.below(4) {
        text.push_str(&match random.below(3) {
            0 => format!(" V[i{last}+1] = V[i{last}]*x\n"),
            1 => format!(" s = s + V[i{last}]\n"),
            _ => format!(" V[i{last}] = s*x + 1\n"),
        });
    }
    (0..depth).for_each(|_| text.push_str(".endfor\n"));
    text + " mov y, s\n wait period\n"
}

#[test]
fn triangular_nests_take_exactly_their_bounds() {
    let random = &mut Random::new(35);
    let mut varying = 0;
    for number in 0..60 {
        let varies = number % 3 == 0;
        let text = triangular(random, varies);
        for machine in MACHINES {
            let program = source(&text, machine);
            let bounds = bound(&program).unwrap_or_else(|error| panic!("{error}\n{text}"));
            let mut emulator = Emulator::new(&program).unwrap();
            let mut n = 0;
            let count = |emulator: &mut Emulator| {
                for port in &program.inputs {
                    let bits = if port.name == "n" { n } else { 1.5f32.to_bits() };
                    emulator.set_input_bits(port.register, bits).unwrap();
                }
                n = if n == 0 { 9 } else { n - 1 };
            };
            let measured = measure(&mut emulator, 12, count);
            let exact = measured.iter().filter(|one| check(&bounds, **one, machine.refill)).count();
            let steady = &measured[1..];
            let reached = |cycles: Cycle| steady.iter().any(|one| one.cycles == cycles);
            let section = section(&bounds, measured[2]);
            assert!(reached(section.cycles.worst) || varies, "{section:?} {steady:?}\n{text}");
            if varies && exact < measured.len() {
                varying += 1;
                assert!(reached(section.cycles.worst), "the most iterations: {section:?} {steady:?}\n{text}");
            } else {
                assert_eq!(exact, measured.len(), "{}: {bounds:?}\n{text}", machine.name);
            }
        }
    }
    assert!(varying > 10, "{varying}");
}

/// Loop over four rows whose lengths, 1 to 7 each, are the digits of the input `n` to base 8; `work` stands in the inner loop.
fn rows(total: &str, work: &str) -> String {
    format!(
        ".input n:int, x\n.output y\n.reg w:int m:int k:int s\n.schedule on\n.once\n wait period\n\
         .period\nperiod:\n mov w, n\n mov s, zero\n li k, 4\n .loop_bound 4\nrow:\n iand m, w, 7\n ishr w, w, 3\n \
         .loop_bound 7{total}\nnext:\n isub m, m, 1\n{work} bnz m, next\n isub k, k, 1\n bnz k, row\n mov y, s\n wait period\n"
    )
}

#[test]
fn total_bounds_a_nest_by_the_sum_of_its_rows() {
    for work in ["", " s = s + x\n", " s = s*x + x/s\n"] {
        for machine in MACHINES {
            let total = 4 + 9;
            let program = source(&rows(&format!(" total {total}"), work), machine);
            let bounds = bound(&program).unwrap();
            let without = bound(&source(&rows("", work), machine)).unwrap();
            let mut worst = [0; 2];
            for digits in 0..7u32.pow(4) {
                let lengths: Vec<u32> = (0..4).map(|row| 1 + digits / 7u32.pow(row) % 7).collect();
                let sum: u32 = lengths.iter().sum();
                // Inputs that end the period with the most iterations, and a sample of the others.
                if !(sum == total || sum == 28 || digits % 211 == 0) {
                    continue;
                }
                let n = lengths.iter().rev().fold(0, |n, length| n << 3 | length);
                let program = if sum <= total { &program } else { &source(&rows("", work), machine) };
                let mut emulator = Emulator::new(program).unwrap();
                emulator.set_blocks(digits % 2 == 0);
                let set = |emulator: &mut Emulator| {
                    for port in &program.inputs {
                        let bits = if port.name == "n" { n } else { 1.5f32.to_bits() };
                        emulator.set_input_bits(port.register, bits).unwrap();
                    }
                };
                // Each period restarts the count.
                let measured = measure(&mut emulator, 3, set);
                for one in &measured {
                    check(if sum <= total { &bounds } else { &without }, *one, machine.refill);
                }
                let longest = measured[2].cycles;
                let of = &mut worst[usize::from(sum > total)];
                *of = longest.max(*of);
            }
            let section = |bounds: &Bounds| bounds.sections.iter().find(|one| !one.once).unwrap().cycles;
            assert_eq!(section(&without).worst, worst[1], "{}", machine.name);
            assert_eq!(section(&bounds).worst, worst[0], "{}: {bounds:?}", machine.name);
            assert!(section(&bounds).worst < section(&without).worst);
        }
    }
}

#[test]
fn one_iteration_beyond_a_total_is_a_fault() {
    for (blocks, lengths) in [(true, 0o3333), (false, 0o3333), (true, 0o7117), (false, 0o1461)] {
        let program = source(&rows(" total 11", ""), &F3);
        let mut emulator = Emulator::new(&program).unwrap();
        emulator.set_blocks(blocks);
        let n = program.inputs.iter().find(|port| port.name == "n").unwrap().register;
        emulator.run_to_wait().unwrap();
        for fits in [0o1234, 0o2144, 0o5141] {
            emulator.set_input_bits(n, fits).unwrap();
            emulator.run_period(&[]).unwrap();
        }
        emulator.set_input_bits(n, lengths).unwrap();
        let Err(PeriodError::Fault(fault)) = emulator.run_period(&[]) else { panic!("no fault") };
        assert_eq!(fault.kind, FaultKind::LoopTotal { total: 11 });
        let shown = fault.show(&program).to_string();
        assert!(shown.contains("more often in this section than `total 11`"), "{shown}");
    }
}

/// The tick may come at any distance from the `wait`, while a result of the `wait`'s own bundle is still in flight. At a single distance,
/// that result conflicts with the product at the write port, which costs a cycle: at an odd distance with one first bundle, at an even
/// one with the other.
#[test]
fn ticks_at_every_distance_are_bounded_exactly() {
    for first in ["", " nop\n"] {
        let sums = " fadd a, a, a\n".repeat(6);
        let text = format!(
            ".input x\n.output y\n.reg a m s\n.once\n wait p\n.period\np:\n{first} fmul m, x, x\n fadd a, m, m\n{sums} \
             fsin s, x || wait p\n"
        );
        let program = source(&text, &F3);
        let bounds = bound(&program).unwrap();
        let refill = Cycle::from(F3.refill);
        let (mut all, mut refilled) = (BTreeSet::new(), BTreeSet::new());
        for after in 1..60 {
            let mut emulator = Emulator::new(&program).unwrap();
            emulator.set_input_bits(program.inputs[0].register, 1.0f32.to_bits()).unwrap();
            emulator.run_to_wait().unwrap();
            // The first period has no predecessor.
            let waited = emulator.run_period(&[]).unwrap().wait;
            emulator.tick_at(waited + after);
            let cycles = emulator.run_period(&[]).unwrap().cycles;
            all.insert(cycles);
            if after >= refill {
                refilled.insert(cycles);
            }
        }
        let section = bounds.sections.last().unwrap();
        let ends = |set: &BTreeSet<Cycle>| (*set.first().unwrap(), *set.last().unwrap());
        assert_eq!((section.cycles.best, section.cycles.worst), ends(&refilled), "{text}");
        assert_eq!((section.in_time.best, section.in_time.worst), ends(&all), "{text}");
        assert!(refilled.len() > 1, "{refilled:?}");
    }
}

#[test]
fn counted_loop_may_end_in_a_halting_subroutine() {
    let text = ".input n:int\n.output y:int\n.reg c:int\n.once\n li c, 5\n loop c, done\n.loop_bound 5\n call f\n nop\n\
                done: halt\nf: bz n, on\n halt\non: ret\n";
    for machine in MACHINES {
        let program = source(text, machine);
        let section = bound(&program).unwrap().sections.remove(0);
        let cycles = |n: u32| {
            let mut emulator = Emulator::new(&program).unwrap();
            emulator.set_input_bits(program.inputs[0].register, n).unwrap();
            assert_eq!(emulator.run(), Ok(Stop::Halted));
            emulator.now()
        };
        assert_eq!((section.cycles.best, section.cycles.worst), (cycles(1), cycles(0)), "{}", machine.name);
    }
}

#[test]
fn a_jump_into_a_counted_loop_is_refused() {
    // Jumps to the first bundle of the body, past the `loop`, and to the second.
    for body in ["in: nop\n nop\n", " nop\nin: nop\n"] {
        let text = format!(
            ".input n:int\n.reg c:int\n bnz n, in\n li c, 3\n loop c, on\n.loop_bound 3\n{body}on: halt\n"
        );
        let error = bound(&source(&text, &T3)).unwrap_err();
        assert_eq!(error.refusal, Refusal::Unstructured, "{error}");
    }
}

/// The sequencer does not count a jump back to the head, and a jump past the body leaves the loop on its stack.
#[test]
fn a_jump_to_either_end_of_a_counted_loop_is_refused() {
    for target in ["head", "end"] {
        let text = format!(
            ".input n:int\n.reg k:int\n.preset k = 3\n.once\n loop k, end\nhead: nop\n nop\n bnz n, {target}\n nop\nend: halt\n"
        );
        for machine in MACHINES {
            let error = bound(&source(&text, machine)).unwrap_err();
            assert_eq!(error.refusal, Refusal::Unstructured, "{error}");
        }
    }
}

/// Iterations of one entry are shorter than those of the other, in either order: the price of an iteration is above the cycles of some.
#[test]
fn totals_hold_for_entries_with_iterations_of_different_lengths() {
    for long in ["first", "second"] {
        let [a, b] = if long == "first" { [1, 0] } else { [0, 1] };
        let nops = " nop\n".repeat(8);
        let text = format!(
            ".input n:int, k:int\n.output y:int\n.reg r:int q:int m:int c:int\n.once\n wait p\n.period\np: li r, {a}\n \
             iadd c, r, 1\n loop c, e\n.loop_bound 3\n nop\ne: mov q, n\n call f\n li r, {b}\n mov q, k\n call f\n \
             mov y, m\n wait p\nf: mov m, q\n{nops}{nops}.loop_bound 8 total 10\nnext: isub m, m, 1\n bz r, short\n nop\n nop\n \
             nop\n nop\n nop\n nop\n nop\n nop\nshort: bnz m, next\n ret\n"
        );
        for machine in MACHINES {
            let program = source(&text, machine);
            let bounds = bound(&program).unwrap();
            let mut worst = 0;
            for (first, second) in (1..9).flat_map(|n| (1..9).map(move |k| (n, k))) {
                if first + second > 10 {
                    continue;
                }
                let mut emulator = Emulator::new(&program).unwrap();
                let set = |emulator: &mut Emulator| {
                    emulator.set_input("n", first.into()).unwrap();
                    emulator.set_input("k", second.into()).unwrap();
                };
                let measured = measure(&mut emulator, 2, set);
                check(&bounds, measured[2], machine.refill);
                worst = worst.max(measured[2].cycles);
            }
            let section = bounds.sections.iter().find(|one| !one.once).unwrap().cycles;
            assert!(section.worst >= worst && section.worst < 2 * worst, "{section:?} {worst}");
        }
    }
}

/// Paths that meet repeatedly are followed once from each meeting point, whatever the layout of the program.
#[test]
fn diamonds_laid_out_backwards_take_a_few_steps_each() {
    let diamonds: String = (0..20)
        .rev()
        .map(|i| format!("d{i}: bnz n, e{i}\n jmp d{}\ne{i}: nop\n jmp d{}\n", i + 1, i + 1))
        .collect();
    let program = source(&format!(".input n:int\n jmp d0\nd20: halt\n{diamonds}"), &F3);
    let bounds = bound(&program).unwrap();
    assert!(bounds.steps < 100, "{}", bounds.steps);
    let mut cycles = [0, 1].map(|n| {
        let mut emulator = Emulator::new(&program).unwrap();
        emulator.set_input_bits(program.inputs[0].register, n).unwrap();
        assert_eq!(emulator.run(), Ok(Stop::Halted));
        emulator.now()
    });
    cycles.sort_unstable();
    let span = bounds.sections[0].cycles;
    assert!(span.best <= cycles[0] && cycles[1] <= span.worst, "{cycles:?} {span:?}");
}

#[test]
fn steps_are_counted_and_calls_may_fill_the_stack() {
    assert_eq!(bound(&source(" nop\n halt\n", &F3)).unwrap().steps, 1);
    let depth = F3.stack_depth;
    let calls: String = (1..depth).map(|i| format!("f{i}: call f{}\n ret\n", i + 1)).collect();
    let program = source(&format!(" call f1\n halt\n{calls}f{depth}: ret\n"), &F3);
    let cycles = bound(&program).unwrap().sections[0].cycles;
    let mut emulator = Emulator::new(&program).unwrap();
    assert_eq!(emulator.run(), Ok(Stop::Halted));
    assert_eq!((cycles.best, cycles.worst), (emulator.now(), emulator.now()));
}

/// Cycles of the sections in a host's header file.
#[test]
fn hosts_get_the_cycles_of_ticks_in_time() {
    let text = ".once\n wait p\n.period\np: nop\n wait q\nq: nop\n nop\n nop\n wait p\n";
    let program = source(text, &F3);
    let bounds = bound(&program).unwrap();
    let refill = Cycle::from(F3.refill);
    let of = |best: Cycle, worst: Cycle| takt_isa::timing::Span { best, worst };
    let sections = section_cycles(&program).unwrap();
    let found: Vec<_> = sections.iter().map(|one| (&*one.name, one.once, one.cycles, one.missed)).collect();
    let once = refill + 1;
    let expected = [
        ("once", true, of(once, once), None),
        ("p", false, of(2, 2 + refill - 1), Some(of(2 + refill, 2 + refill))),
        ("q", false, of(4, 4 + refill - 1), Some(of(4 + refill, 4 + refill))),
    ];
    assert_eq!(found, expected);
    assert_eq!(bounds.worst_period(), Some(4 + refill - 1));
}
