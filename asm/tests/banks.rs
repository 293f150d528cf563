// SPDX-License-Identifier: MIT OR Apache-2.0
//! Registers that operations of several slots write: every such program assembles for every machine, and gives the same values.

use crate::common::{self, assemble, bad, bundles, good};
use crate::random_source::Random;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use takt_asm::{AssembledProgram, MemoryLoader, Options, Schedule, Transfer, listing};
use takt_emu::{Emulator, Event};
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::timing::Cycle;
use takt_isa::{F1, F3, MACHINES, Machine, Program, ROWS};

/// Instructions of each slot of f3, with two sources.
const MNEMONICS: [&[&str]; 3] =
    [&["fmul", "fmul"], &["fadd", "fsub"], &["fmax", "ixor", "fdiv", "fsat", "ior"]];

/// A program whose states, temporary names and ports are written from all slots, in straight code, branches, a loop and a subroutine.
fn source(seed: u64) -> String {
    let random = &mut Random::new(seed);
    let mut text = String::from(
        ".input x, y, n:int\n.output F, G, H:bits\n.state s0, s1, s2, s3 @ x9\n.reg t u k:int c:int\n.preset s2 = 0.5\n.state s2b\n\
         .data\nbuf: .float 1, -2.5, 3, 4\n.once\n",
    );
    let initial = |random: &mut Random, name: &str| match random.below(7) {
        0 => format!(" mov {name}, zero\n"),
        1 => format!(" li {name}, 1.5\n"),
        2 => format!(" fadd {name}, 1.0, -0.25\n"),
        3 => format!(" ld {name}, buf+{}\n", random.below(4)),
        4 => format!(" fmul {name}, x, x\n"),
        5 => format!(" mov {name}, x\n"),
        _ => format!(" mov {name}, nan\n"),
    };
    for name in ["s0", "s1", "s3", "s2b", "t", "u"] {
        text += &initial(random, name);
    }
    text += " mov s3, s2\n mov F, x\n fadd G, x, 1.0\n fmul H, x, x\n";
    if random.below(2) == 0 {
        text += " bz n, begin\n mov s1, zero\n mov F, zero\nbegin:\n";
    }
    text += " wait period\n.period\nperiod:\n";
    if random.below(3) == 0 {
        text = text.replace(".period\n", ".schedule on\n.period\n");
    }
    let mut open: Option<(u64, u64)> = None;
    let names = ["s0", "s1", "s2", "s3", "s2b", "t", "u"];
    for step in 0..6 + random.below(24) {
        if let Some((name, 0)) = open {
            let _ = writeln!(text, "skip{name}:");
            open = None;
        }
        open = open.map(|(name, left)| (name, left - 1));
        let operand = |random: &mut Random| match random.below(8) {
            0 => random.pick(&["x", "y"]).to_owned(),
            1 => random.pick(&["0.5", "2.0", "zero", "F"]).to_owned(),
            _ => random.pick(&names).to_owned(),
        };
        let dest = match random.below(6) {
            0 => random.pick(&["F", "G", "H"]),
            _ => random.pick(&names),
        };
        let (a, b) = (operand(random), operand(random));
        let (slot, two) = (MNEMONICS[random.below(3) as usize], MNEMONICS[random.below(2) as usize]);
        let _ = match random.below(16) {
            0 => writeln!(text, " mov {dest}, zero"),
            1 => writeln!(text, " li {dest}, -0.0"),
            2 => writeln!(text, " ld {dest}, buf+{}", random.below(4)),
            3 => writeln!(text, " st buf+{}, {a}", random.below(4)),
            4 => writeln!(text, " flt k, {a}, {b}\n sel {dest}, k, zero, {dest}"),
            5 if open.is_none() => {
                open = Some((step, 1 + random.below(4)));
                writeln!(text, " flt k, {a}, {b}\n {} k, skip{step}", random.pick(&["bz", "bnz"]))
            }
            6 if open.is_none() => writeln!(
                text,
                " li c, 3\n .loop_bound 3\nturn{step}:\n {} {dest}, {a}, {dest}\n isub c, c, 1\n bnz c, turn{step}",
                random.pick(slot)
            ),
            7 => writeln!(text, " call routine"),
            8 => writeln!(text, " {} {dest}, {a}, {b} || flt k, {b}, {a}", random.pick(MNEMONICS[1])),
            9 if open.is_none() => writeln!(
                text,
                " {} {dest}, {a}, {b} || bz n, over{step}\n mov u, s0\nover{step}:",
                random.pick(two)
            ),
            10 => writeln!(text, " rdflags k\n clrflags"),
            _ => writeln!(text, " {} {dest}, {a}, {b}", random.pick(slot)),
        };
    }
    if let Some((name, _)) = open {
        let _ = writeln!(text, "skip{name}:");
    }
    for (name, port) in names.iter().zip(["F", "G", "H", "F", "G", "H", "F"]) {
        let slot = MNEMONICS[random.below(3) as usize];
        let _ = writeln!(text, " {} {port}, {name}, 1.0", random.pick(slot));
    }
    let last = random.pick(&[" wait period\n", " fadd s0, s0, x || wait period\n"]);
    text += last;
    text += "routine: fmul s1, s1, 0.5\n mov t, s0\n fadd u, s1, t\n ret\n";
    text
}

fn assembled(text: &str, machine: &'static Machine, schedule: Schedule) -> AssembledProgram {
    let options = Options { machine, schedule, effort: 1, ..Options::default() };
    let assembled = takt_asm::assemble("test.s", &MemoryLoader::of("test.s", text), &options);
    assembled.unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false)))
}

/// Values written to each port, the memory, and the flags.
type RunResult = (BTreeMap<String, Vec<u32>>, Vec<u32>, u8);

fn run(program: &Program, seed: u64) -> RunResult {
    let random = &mut Random::new(seed + 77);
    let mut emulator = Emulator::new(program).expect("it fits");
    emulator.set_cycle_limit(1_000_000);
    let mut writes: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    for _ in 0..6 {
        for port in &program.inputs {
            let bits = match (port.name.as_str(), random.below(16)) {
                ("n", value) => (value % 2) as u32,
                (_, 0) => 0x7f80_0001,
                (_, value) => (value as f32 / 4.0 - 2.0).to_bits(),
            };
            emulator.set_input_bits(port.register, bits).expect("it is an input");
        }
        let mut sink = |event: &Event| {
            if let Event::PortWrite(write) = event {
                writes.entry(program.register_text(write.register)).or_default().push(write.value);
            }
        };
        emulator.observed(&mut sink).run_period(&[]).unwrap_or_else(|error| panic!("{error}"));
    }
    // An operation that shares a bundle with the last `wait` is in flight when that issues: its flags are still to come.
    let landed = emulator.now() + Cycle::from(MAX_LATENCY);
    emulator.run_until(landed).unwrap_or_else(|error| panic!("{error}"));
    (writes, emulator.memory().to_vec(), emulator.flags().bits())
}

#[test]
fn every_machine_gives_the_same_values() {
    let (mut presets, mut operations, mut shared, mut alone) = (0, 0, 0, 0);
    let programs = common::programs(80, 3000);
    for seed in 0..programs {
        let text = source(seed);
        let expected = run(&assembled(&text.replace(" @ x9", ""), &F1, Schedule::None).program, seed);
        for schedule in [Schedule::None, Schedule::AsWritten, Schedule::All] {
            let assembled = assembled(&text, &F3, schedule);
            assert_eq!(run(&assembled.program, seed), expected, "seed {seed}, {schedule:?}:\n{text}");
            for adjustment in &assembled.adjustments {
                *match adjustment.transfer {
                    Transfer::Preset(_) => &mut presets,
                    Transfer::Rematerialised(_) => &mut operations,
                    Transfer::Copy { alone: false, .. } => &mut shared,
                    Transfer::Copy { alone: true, .. } => &mut alone,
                } += 1;
            }
        }
    }
    let seen = [presets, operations, shared, alone];
    assert!(
        seen.iter().all(|count| *count > programs.min(250) / 5),
        "{seen:?} presets, operations, copies shared and alone"
    );
}

/// The bundles of the period of a program for f3, which f1 takes too.
fn period(text: &str) -> (Vec<String>, AssembledProgram) {
    assert!(assemble(text, &F1).is_ok_and(|assembled| assembled.adjustments.is_empty()), "{text}");
    let assembled = good(text);
    let start =
        assembled.program.sections.iter().find(|section| section.name == "period").expect("it has one").start;
    (bundles(&assembled)[start.index()..].to_vec(), assembled)
}

#[test]
fn table_tells_bit_copies_from_arithmetic() {
    let copies: Vec<&str> = ROWS.iter().filter(|row| row.copies()).map(|row| row.mnemonic).collect();
    assert_eq!(copies, ["mov"]);
}

#[test]
fn the_simplest_integrator() {
    for initial in [" mov s, zero\n", " li s, 0\n", " mov s, 0.0\n", " fmul s, 0, 2.5\n"] {
        let text = format!(
            ".input x\n.output y\n.state s\n.once\n{initial} wait period\n.period\nperiod: fadd s, s, x\n mov y, s\n wait period\n"
        );
        let (period, assembled) = period(&text);
        assert_eq!(period.len(), 3, "{period:?}");
        assert_eq!(assembled.program.constants.len(), 1, "{initial}");
        assert!(matches!(assembled.adjustments[..], [ref one] if one.transfer == Transfer::Preset(0)));
    }
}

#[test]
fn a_preset_may_come_before_its_register() {
    let text = ".preset s = 1.5\n.input x\n.output y\n.state s\n.period\nperiod: fadd s, s, x\n mov y, s\n wait period\n";
    for machine in MACHINES {
        let assembled = assemble(text, machine).unwrap_or_else(|errors| panic!("{}", errors.render(false)));
        assert_eq!(
            assembled.program.constants.iter().map(|(_, bits)| *bits).collect::<Vec<_>>(),
            [1.5f32.to_bits()]
        );
    }
}

#[test]
fn reused_initial_values_are_no_presets() {
    // Control returns to the beginning.
    let text = ".input x, n:int\n.output y\n.state s\n.once\nagain: mov s, zero\n wait period\n.period\nperiod: fadd s, s, x\n mov y, s\n bnz n, again\n wait period\n";
    let (_, assembled) = period(text);
    assert_eq!(
        assembled.adjustments.iter().map(|a| &a.transfer).collect::<Vec<_>>(),
        [&Transfer::Rematerialised("fadd")]
    );
    // An operation reads the preset value before the write.
    let text = ".input x\n.output y\n.state s\n.preset s = 2.0\n.once\n mov y, s\n mov s, zero\n wait period\n.period\nperiod: fadd s, s, x\n mov y, s\n wait period\n";
    let (_, assembled) = period(text);
    assert_eq!(
        assembled.adjustments.iter().map(|a| &a.transfer).collect::<Vec<_>>(),
        [&Transfer::Rematerialised("fadd")]
    );
    assert_eq!(assembled.program.constants.iter().filter(|(_, bits)| *bits == 2.0f32.to_bits()).count(), 1);
}

#[test]
fn accumulators_and_resets() {
    // Loaded: the register lies where `ld` writes, and the sum is copied while the source leaves the slot free.
    let (lines, assembled) = period(
        ".input x\n.output y\n.state s\n.data\nw: .float 2\n.once\n ld s, w\n wait period\n.period\nperiod: fadd s, s, x\n fmul y, s, 2.0\n nop\n nop\n nop\n nop\n nop\n nop\n wait period\n",
    );
    assert_eq!(lines.len(), 9);
    assert!(
        matches!(assembled.adjustments[..], [ref one] if matches!(one.transfer, Transfer::Copy { alone: false, cycles: Some(0), .. })),
        "{:?}",
        assembled.adjustments
    );
    // Reset by `sel`: the sum needs no place of its own.
    let (lines, assembled) = period(
        ".input x, r:int\n.output y\n.state s\n.once\n mov s, zero\n wait period\n.period\nperiod: fadd s, s, x\n sel s, r, zero, s\n mov y, s\n wait period\n",
    );
    assert_eq!((lines.len(), assembled.adjustments.len()), (4, 0));
    // Reset by a branch: an operation of the right slot.
    let (lines, assembled) = period(
        ".input x, r:int\n.output y\n.state s\n.once\n mov s, zero\n wait period\n.period\nperiod: bz r, keep\n mov s, zero\nkeep: fadd s, s, x\n mov y, s\n wait period\n",
    );
    assert_eq!(lines[1], "fadd s, zero, zero");
    assert_eq!(assembled.adjustments.len(), 2);
    // A copy in a bundle of its own is reported, with its line and its cycles.
    let (lines, assembled) = period(
        ".input x\n.output y\n.state s\n.once\n mov s, x\n wait period\n.period\nperiod: fadd s, s, x\n wait period\n",
    );
    assert_eq!(lines[1], "mov s, s.1");
    let [one] = &assembled.adjustments[..] else { panic!("one copy") };
    assert_eq!(one.location.map(|at| at.line), Some(8));
    assert!(matches!(one.transfer, Transfer::Copy { alone: true, cycles: Some(2), .. }), "{one:?}");
    assert!(
        listing::listing(&assembled).contains("test.s:8+       mov s, s.1"),
        "{}",
        listing::listing(&assembled)
    );
}

#[test]
fn dead_values_are_not_copied() {
    let (lines, assembled) = period(
        ".input x, n:int\n.output F, G\n.reg t\n.period\nperiod: fmul t, x, x\n fadd F, t, 0.5\n bz n, over\n fadd t, x, x\n fmul G, t, t\nover: mov t, F\n mov F, t\n wait period\n",
    );
    assert!(
        assembled.adjustments.iter().all(|adjustment| adjustment.register == "F"),
        "{:?}",
        assembled.adjustments
    );
    assert!(lines.iter().all(|line| !line.starts_with("mov t,") || line == "mov t, F"), "{lines:?}");
}

#[test]
fn a_port_shows_every_value_in_order() {
    // The quotient is ready long after the sum, when a slot would be free.
    let text = format!(
        ".input x\n.output F\n.period\nperiod: fdiv F, x, 3.0\n fadd F, x, 1.0\n{} mov F, x\n fmul F, x, 2.0\n wait period\n",
        " nop\n".repeat(14)
    );
    let text = text.as_str();
    let seen = |machine, schedule| run(&assembled(text, machine, schedule).program, 3).0;
    for schedule in [Schedule::None, Schedule::All] {
        assert_eq!(seen(&F3, schedule), seen(&F1, schedule));
    }
}

#[test]
fn suggested_fixes_assemble() {
    let program = |declaration: &str, body: &str| {
        format!(
            ".input x, n:int\n.output y\n{declaration}\n.once\n li s, 1.5\n wait period\n.period\nperiod: {body}\nover: mov y, s\n wait period\n"
        )
    };
    // A place out of reach of a copy.
    let pinned = program(".state s @ a3", "fadd s, s, x\n ld s, [n]");
    let help = |text: &str| bad(text, &F3).messages()[0].help.clone().expect("it has a help");
    assert_eq!(help(&pinned), "leave its place to the assembler, or place it in bank x");
    good(&pinned.replace(" @ a3", ""));
    good(&pinned.replace("a3", "x3"));
    // A branch that reads a result of its own bundle.
    let branch = program(".state s", "fadd s, s, x || bz s, over\n ld s, [n]");
    assert_eq!(help(&branch), "write `bz` as a bundle of its own");
    good(&branch.replace("|| bz", "\n bz"));
    // Bundles that must stay at their addresses.
    let numbers = program(".state s", "fadd s, s, x\n bz n, 5\n ld s, [n]");
    assert_eq!(help(&numbers), "jump to labels, so that the assembler can add an operation that copies");
    good(&numbers.replace(", 5", ", over"));
}

#[test]
fn a_jump_to_a_number_is_a_way_in() {
    // Bundle 2 reads the result of bundle 1, or its own.
    let text = ".input x, n:int\n.output F\n.reg t\n.once\n wait 1\n.period\n fmul t, x, x\n fadd t, t, 1.0\n mov F, t\n bnz n, 2\n wait 1\n";
    let report = bad(text, &F3);
    assert_eq!(report.messages()[0].code, "two-slots", "{}", report.render(false));
    let labels = text.replace(" fadd", "again: fadd").replace("n, 2", "n, again");
    let labels = labels.replace("wait 1", "wait period").replace(".period\n", ".period\nperiod:");
    assert_eq!(good(&labels).adjustments.len(), 2);
}

#[test]
fn two_values_of_a_branching_bundle() {
    // The values are both in their registers before control leaves.
    let text = ".input x, n:int\n.output F, G\n.state s, t\n.once\n mov s, x\n mov t, x\n wait period\n.period\nperiod: fadd s, s, x || fmul t, t, x || bz n, over\n mov F, s\nover: mov G, t\n wait period\n";
    let (lines, assembled) = period(text);
    let place = |what: &str| lines.iter().position(|line| line.contains(what)).expect(what);
    assert!(place("mov s, s.1") < place("bz n") && place("mov t, t.1") < place("bz n"), "{lines:?}");
    for seed in 0..4 {
        let small = self::assembled(text, &F1, Schedule::None);
        assert_eq!(run(&assembled.program, seed), run(&small.program, seed));
    }
}
