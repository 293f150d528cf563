// SPDX-License-Identifier: MIT OR Apache-2.0
//! Meaning of names at a position: the value that the current line reads, checked against the program words.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::sync::Arc;
use takt_asm::names::DebugInfo;
use takt_asm::{AssembledProgram, MemoryLoader, Options as AsmOptions, assemble, image};
use takt_debug::console::Console;
use takt_debug::session::{Options, Place, Session, StopReason, Unit};
use takt_emu::testing::Random;
use takt_isa::{F3, MACHINES, Machine, Register};

fn assembled(source: &str, machine: &'static Machine) -> AssembledProgram {
    let files = [("a.s", source)];
    let options = AsmOptions { machine, effort: 1, ..AsmOptions::default() };
    match assemble("a.s", &MemoryLoader::new(&files), &options) {
        Ok(assembled) => assembled,
        Err(errors) => panic!("{}", errors.render(false)),
    }
}

/// A session on an image after some periods, with inputs 1, 2, ….
fn session(assembled: &AssembledProgram, periods: usize) -> Session {
    let bytes =
        image::write_with(&assembled.program, Some(&assembled.debug_info())).expect("an image holds it");
    let (program, debug) = image::read_with(&bytes).unwrap();
    let DebugInfo { sources, constants, names } = debug.unwrap();
    let ports = program.inputs.iter().zip(1u16..);
    let row: Vec<(Register, u32)> = ports.map(|(port, i)| (port.register, f32::from(i).to_bits())).collect();
    let inputs = Some(Arc::new(vec![row; periods]));
    Session::new(&program, Options { inputs, sources, constants, names, ..Options::default() }).unwrap()
}

const MACRO: &str = "\
.macro blend to, from, other
.reg own
        fmul    own, from, other
        fadd    own, own, from
        fadd    own, own, own
        fsub    to, own, other
.endm
";

/// A straight-line program that writes few names repeatedly, inside and outside macros. Values live long, so that many share few
/// registers.
fn random_source(seed: u64, lines: usize) -> String {
    let mut random = Random::new(seed);
    let names: Vec<String> = (0..12).map(|i| format!("v{i}")).collect();
    let mut text =
        format!(".input a, b\n.output F\n.reg {}\n{MACRO}.period\n.schedule on\np:\n", names.join(", "));
    for name in &names {
        let _ = writeln!(text, "        fadd    {name}, a, b");
    }
    let mut pick = || names[random.below(names.len() as u32) as usize].clone();
    for i in 0..lines {
        let (to, x, y) = (pick(), pick(), pick());
        let op = ["fadd", "fmul", "fsub", "blend", "fmax"][i % 5];
        let _ = writeln!(text, "        {op}    {to}, {x}, {y}");
    }
    let _ = writeln!(text, "        fadd    F, v0, v1\n.schedule off\n        wait    p");
    text
}

/// Names that a line reads.
fn read_names(line: &str) -> Vec<&str> {
    let words: Vec<&str> = line.split([' ', ',']).filter(|word| !word.is_empty()).collect();
    match words[..] {
        [op, _, x, y] if op.starts_with('f') => vec![x, y],
        _ => vec![],
    }
}

#[test]
fn name_means_the_value_read_at_the_line() {
    let (mut looked, mut renamed, mut inside) = (0, BTreeSet::new(), 0);
    for (seed, machine) in (0..6).zip(MACHINES.iter().cycle()) {
        let assembled = assembled(&random_source(seed, 120), machine);
        let mut session = session(&assembled, 2);
        let program = session.program().clone();
        while session.step(Unit::Bundle) == StopReason::Done {
            let address = session.emulator().next_address();
            let Some(location) = session.location() else { continue };
            let line = session.source_line(location).unwrap().to_owned();
            let words = program.locations(address);
            let slot = words.iter().position(|place| *place == Some(location)).unwrap();
            let instruction = &program.bundle(address).unwrap().unwrap()[slot];
            for (name, register) in read_names(&line).into_iter().zip(instruction.reads()) {
                let live = session.parse(name).unwrap();
                let place = session.place(&live).unwrap_or_else(|error| panic!("{line}: {error}"));
                let (place, _, bits) = place.unwrap();
                assert_eq!(
                    place,
                    Place::Register(*register),
                    "seed {seed}, {}: {line}: {name}",
                    program.bundle_text(address)
                );
                assert_eq!(bits, session.register(*register));
                looked += 1;
                renamed.extend(session.label(&live).filter(|label| label != name));
                inside += u32::from(["own", "from", "other"].contains(&name));
            }
        }
    }
    assert!(looked > 1000 && renamed.len() > 100 && inside > 300, "{looked} {} {inside}", renamed.len());
}

/// With more values than registers, values share registers; an overwritten value cannot be read.
#[test]
fn overwritten_values_are_unavailable() {
    let assembled = assembled(&random_source(7, 700), MACHINES[MACHINES.len() - 1]);
    let shared = assembled.names.values.iter().filter(|value| {
        assembled.names.values.iter().filter(|other| other.register == value.register).count() > 1
    });
    let split = shared.filter(|value| value.orders.is_some());
    let labels: Vec<&str> = split.map(|value| value.label.as_str()).collect();
    assert!(labels.len() > 100, "{}", labels.len());
    let mut session = session(&assembled, 1);
    let labels: Vec<_> = labels.iter().map(|label| (label, session.parse(label).unwrap())).collect();
    let reasons = ["is not computed yet: bundle", "is gone: its register", "is in flight: it arrives in"];
    let (mut there, mut not) = (0, BTreeSet::<&str>::new());
    while session.step(Unit::Bundle) == StopReason::Done {
        if !session.cycle().is_multiple_of(37) {
            continue;
        }
        let mut holders = BTreeSet::new();
        for (label, live) in &labels {
            match session.place(live) {
                Ok(Some((Place::Register(register), ..))) => {
                    assert!(holders.insert(register), "{label} is in a register that another value is in");
                    there += 1;
                }
                Ok(place) => panic!("{label}: {place:?}"),
                Err(error) => not.extend(reasons.iter().find(|reason| error.contains(**reason))),
            }
        }
    }
    assert!(there > 1000, "{there}");
    assert_eq!(not.len(), reasons.len(), "{not:?}");
}

const SOURCE: &str = "\
.input  a, b
.output F, G, H
.reg    t
.macro  grow to, by
.reg    own
        fmul    own, by, by
        fadd    own, own, by
        fadd    to, own, 1.0
.endm
.period
.schedule on
p:      fadd    t, a, b
        fmul    t, t, t
        fadd    t, t, a
        grow    F, a
        grow    G, t
        grow    H, b
.schedule off
        wait    p
";

fn console() -> Console {
    Console::new(session(&assembled(SOURCE, &F3), 2))
}

#[test]
fn info_describes_names() {
    let mut console = console();
    let mut text = String::new();
    for line in [
        "info t",
        "info own",
        "info by",
        "info grow.2.own",
        "info F",
        "info a",
        "info p",
        "info tt",
        "break :6",
        "break :8",
        "break :13",
        "stops",
        "continue",
        "print t, own, by",
        "continue",
        "print own, by",
        "watch t",
        "watch own",
        "delete 1",
        "delete 2",
        "delete 3",
        "continue",
        "continue",
        "continue",
        "continue",
        "print t, t.1, t.2",
        "set t = 5",
        "print t",
        "until own > 0",
        "goto start",
        "print t",
        "set t = 5",
        "list 7",
    ] {
        let said = console.execute(line).unwrap_or_else(|error| format!("error: {error}\n"));
        let _ = writeln!(text, "(takt) {line}\n{}", said.trim_end());
    }
    insta::assert_snapshot!(text);
}

/// A breakpoint on a line of a macro or repetition stops in each use; a watchpoint on a name, at each of its values.
#[test]
fn every_place_and_every_value() {
    let mut console = console();
    assert!(console.execute("break :7").unwrap().starts_with("stop 1 at 3 places: bundle "));
    let mut stops = 0;
    while console.execute("continue").unwrap().starts_with("stop 1") {
        // The current line is that of the breakpoint, whatever other operations the bundle has.
        let place = console.execute("where").unwrap();
        assert!(
            place.contains("(a.s:7)") && place.contains("\n    7          fadd    own, own, by\n"),
            "{place}"
        );
        let said = console.execute("print own").unwrap();
        assert!(said.contains(".own.1 in m") && !said.contains("still"), "{said}");
        stops += 1;
    }
    assert_eq!(stops, 9, "three in each of two periods, and before the first tick");
    console.execute("goto start").unwrap();
    // The condition also reads names as of the breakpoint's line.
    console.execute("delete").unwrap();
    console.execute("break :7 if own == 4.0").unwrap();
    let mut uses = vec![];
    while console.execute("continue").unwrap().starts_with("stop 2") {
        let said = console.execute("print own").unwrap();
        uses.push(said.split_once('(').unwrap().1.split('.').nth(1).unwrap().to_owned());
    }
    assert_eq!(uses, ["3", "3", "3"], "b is 2: the use with b as parameter");
    console.execute("goto start").unwrap();
    console.execute("delete").unwrap();
    console.execute("watch t").unwrap();
    let mut seen = vec![];
    loop {
        let said = console.execute("continue").unwrap();
        let Some(stop) = said.strip_prefix("stop 3: watch t ").and_then(|said| said.lines().next()) else {
            break;
        };
        seen.push(stop.to_owned());
    }
    // The second period computes the same values.
    assert_eq!(seen, ["(t.1): (no value) -> 3.0", "(t.2): (no value) -> 9.0", "(t): (no value) -> 10.0"]);
}

#[test]
fn too_many_values_to_watch() {
    let mut source = String::from(".input a\n.output F\n.reg t\n.period\n.schedule on\np: fadd t, a, a\n");
    (0..70).for_each(|_| source.push_str(" fadd t, t, a\n"));
    source.push_str(" fadd F, t, a\n.schedule off\n wait p\n");
    let mut console = Console::new(session(&assembled(&source, &F3), 1));
    let error = console.execute("watch t").unwrap_err();
    assert!(error.contains("`t` has 71 values") && error.contains("`info t`"), "{error}");
    assert!(console.execute("watch t.70").unwrap().starts_with("stop 1"));
}
