// SPDX-License-Identifier: MIT OR Apache-2.0
//! The emulator reproduces the examples in `docs/timing.md`. `TAKT_BLESS=1 cargo test -p takt-emu --test suite document::` rewrites them.

use crate::common::{input, program};
use std::fmt::Write as _;
use std::path::Path;
use takt_emu::{Emulator, Event, Step};
use takt_isa::timing::{Cause, Cycle};
use takt_isa::{BundleAddress, Machine, Program, SlotIndex, T1, T3};

struct Example {
    name: &'static str,
    machine: &'static Machine,
    source: &'static str,
    ticks: &'static [Cycle],
    cycles: Cycle,
}

const EXAMPLES: &[Example] = &[
    Example {
        name: "rules",
        machine: &T3,
        source: "
            fsin m1, i0 || fadd a1, i0, i1
            fmul m2, i0, i1
            fadd a2, m2, i0
            mov x1, i0
            nop
            fmul m3, i0, i1
            flt x2, a2, i0
            bz x2, again
            nop
    again:  nop",
        ticks: &[],
        cycles: 27,
    },
    Example {
        name: "iterative",
        machine: &T1,
        source: "
            fdiv r1, i0, i1
            fadd r2, i0, i1
            fdiv r3, i0, r2
            fadd r3, i0, i1
            rdflags r4
            nop",
        ticks: &[],
        cycles: 53,
    },
    Example {
        name: "loops",
        machine: &T3,
        source: "
            li x1, 3
            li x2, 2
            loop x2, done
            loop x1, once
            mov x3, i0
            nop
    once:   nop
            nop
            fadd a1, i0, i1
    done:   nop",
        ticks: &[],
        cycles: 43,
    },
    Example {
        name: "wait",
        machine: &T3,
        source: "
            fadd a1, i0, i1
            wait period
    period: mov x224, i0
            wait period",
        ticks: &[14, 24],
        cycles: 28,
    },
    Example {
        name: "publish",
        machine: &T3,
        source: "
            wait period
    period: fadd a224, i0, i1
            publish
            fsin m1, i0
            wait period",
        ticks: &[14],
        cycles: 44,
    },
    Example {
        name: "missed",
        machine: &T3,
        source: "
            wait period
    period: fadd a224, i0, i1
            nop
            wait period",
        ticks: &[8, 16],
        cycles: 30,
    },
];

fn describe(program: &Program, cause: Cause) -> String {
    match cause {
        Cause::Branch { from } => {
            format!("front end, after {}", from.map_or("reset".to_owned(), |from| format!("bundle {from}")))
        }
        Cause::Operand { register, producer } => {
            format!("operand {} of bundle {producer}", program.register_text(register))
        }
        Cause::Destination { register, producer } => {
            format!("destination {} of bundle {producer}", program.register_text(register))
        }
        Cause::Unit { slot, unit } => {
            format!("unit {}", program.machine.slot(slot).units[usize::from(unit)].name)
        }
        Cause::WritePort { slot } => {
            format!("write port of slot {}", program.machine.slot(slot).name)
        }
        Cause::Drain => "drain".to_owned(),
        Cause::Wait => "wait".to_owned(),
    }
}

fn bundle_text(program: &Program, address: BundleAddress) -> String {
    let instructions = program.bundle(address).unwrap().unwrap();
    let texts = SlotIndex::all()
        .zip(&instructions)
        .map(|(slot, instruction)| instruction.text(program.machine, slot));
    let texts: Vec<String> = texts.filter(|text| text != "nop").collect();
    if texts.is_empty() { "nop".to_owned() } else { texts.join(" || ") }
}

/// Renders an example as in the document: its program, then its cycles.
fn render(example: &Example) -> String {
    let program = program(example.machine, example.source);
    let mut emulator = Emulator::new(&program).unwrap();
    for i in 0..2 {
        emulator.set_input_bits(input(example.machine, i), 1.0f32.to_bits()).unwrap();
    }
    for &tick in example.ticks {
        emulator.tick_at(tick);
    }
    let mut text = format!("```text\n{}, bundle by bundle:\n", example.machine.name);
    for address in program.addresses() {
        writeln!(text, "  {address:2}  {}", bundle_text(&program, address)).unwrap();
    }
    text.push_str("\ncycle\n");
    while emulator.now() < example.cycles {
        let mut notes = Vec::new();
        let result = emulator
            .observed(&mut |event| match event {
                Event::Tick { .. } => notes.push("tick".to_owned()),
                Event::DeadlineMissed { .. } => notes.push("deadline missed".to_owned()),
                Event::Retire(retire) => {
                    notes.extend(
                        retire
                            .register
                            .map(|register| format!("{} written", program.register_text(register))),
                    );
                }
                _ => {}
            })
            .step_cycle();
        // The example ends with a halt or a fault.
        let Ok(step) = result else { break };
        let (cycle, what) = match step {
            Step::Issued { cycle, address } => {
                (cycle, format!("{address}  {}", bundle_text(&program, address)))
            }
            Step::Stalled { cycle, cause, .. } => (cycle, format!("   [{}]", describe(&program, cause))),
            Step::Halted => break,
        };
        let line = format!("{cycle:5}  {what:38}  {}", notes.join(", "));
        writeln!(text, "{}", line.trim_end()).unwrap();
    }
    text.push_str("```\n");
    text
}

#[test]
fn documented_examples_equal_the_emulators_timing() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/timing.md");
    let document = std::fs::read_to_string(&path).unwrap();
    let mut expected = String::new();
    let mut rest = document.as_str();
    for example in EXAMPLES {
        let marker = format!("<!-- example: {} -->\n", example.name);
        let (before, after) = rest.split_once(&marker).unwrap_or_else(|| panic!("no {marker}"));
        expected.push_str(before);
        expected.push_str(&marker);
        expected.push_str(&render(example));
        // An old table, if any, ends with the fence.
        rest = match after.strip_prefix("```text\n").and_then(|table| table.split_once("```\n")) {
            Some((_, rest)) => rest,
            None => after,
        };
    }
    expected.push_str(rest);
    if std::env::var_os("TAKT_BLESS").is_some() {
        std::fs::write(&path, &expected).unwrap();
    } else {
        assert!(
            document == expected,
            "docs/timing.md is stale: TAKT_BLESS=1 cargo test -p takt-emu --test suite document::"
        );
    }
}
