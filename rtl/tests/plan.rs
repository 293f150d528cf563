// SPDX-License-Identifier: MIT OR Apache-2.0
//! Valid machines without a circuit: every reason, reported with machine, slot, unit and value. Every machine of the table has a circuit.

use takt_isa::spec::fixture::FIXTURES;
use takt_isa::spec::units::*;
use takt_isa::{Bank, F1, F3, Function, MACHINES, Machine, Slot};
use takt_rtl::verilog::ModuleError;
use takt_rtl::{ExportError, Library, Plan, export};

fn leak<T>(value: impl Into<Box<[T]>>) -> &'static [T] {
    Box::leak(value.into())
}

fn refused(machine: Machine) -> String {
    assert_eq!(machine.error(), None, "it is no machine at all");
    let machine: &'static Machine = Box::leak(Box::new(machine));
    Plan::new(machine, &Library::builtin()).map(|_| ()).expect_err("no circuit").to_string()
}

/// The machine f3 with a slot changed.
fn slot(number: usize, change: impl FnOnce(&mut Slot)) -> Machine {
    let mut slots = F3.slots.to_vec();
    change(&mut slots[number]);
    Machine { slots: leak(slots), ..F3 }
}

fn units(number: usize, units: &[Unit]) -> Machine {
    slot(number, |slot| slot.units = leak(units))
}

/// Adds counted loops to a machine's sequencer.
fn counting(machine: Machine) -> Machine {
    Machine { loop_depth: 1, ..machine }
}

#[test]
fn machines_and_fixtures_have_circuits() {
    for machine in MACHINES.iter().chain(FIXTURES) {
        export(machine, &Library::builtin()).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn every_reason() {
    let cases: [(Machine, &str); 18] = [
        (
            counting(units(2, &[ALU, SEQUENCER])),
            "no slot hosts the data memory (functions Load and Store), which the core has",
        ),
        (
            slot(1, |slot| slot.bank.depth = 192),
            "the depth of bank `a` is 192; the circuit needs a power of two from 2 to 512",
        ),
        (
            slot(1, |slot| slot.bank = Bank { base: 384, depth: 128, ..slot.bank }),
            "bank `a` begins at 384; the circuit needs a multiple of 256, the depth of the deepest bank",
        ),
        (
            Machine { outputs_per_bank: 12, ..F3 },
            "outputs_per_bank is 12; the circuit needs a power of two from 2 to 128",
        ),
        (
            Machine { outputs_per_bank: 256, ..F3 },
            "outputs_per_bank is 256; the circuit needs a power of two from 2 to 128",
        ),
        (
            Machine { outputs_per_bank: 1, ..F3 },
            "outputs_per_bank is 1; the circuit needs a power of two from 2 to 128",
        ),
        (
            Machine { code_depth: 1500, ..F3 },
            "code_depth is 1500; the circuit needs a power of two from 2 to 65536",
        ),
        (
            Machine { data_depth: 1000, ..F3 },
            "data_depth is 1000; the circuit needs a power of two from 2 to 65536",
        ),
        (Machine { refill: 5, ..F3 }, "refill is 5; rtl/core/takt_sequencer.v needs refill 6"),
        (Machine { resolve: 1, ..F1 }, "resolve is 1; rtl/core/takt_sequencer.v needs resolve 2"),
        (
            counting(units(1, &[ADD, CONVERT, Unit { functions: &[Function::Loop], ..SEQUENCER }])),
            "slot `add` hosts the sequencer's loops, slot `aux` its branches; the circuit needs both in one slot",
        ),
        (
            Machine { stack_depth: 24, ..F3 },
            "stack_depth is 24; the circuit needs a power of two from 2 to 64",
        ),
        (
            counting(units(2, &[ALU, Unit { latency: 3, ..MEMORY }, SEQUENCER])),
            "slot `aux`: the latency of unit `memory` is 3; rtl/core/takt_memory.v needs latency 4",
        ),
        (
            units(1, &[Unit { latency: 4, ..ADD }, CONVERT]),
            "slot `add`: unit `add` has latency 4; rtl/units/add.v needs latency 5",
        ),
        (
            units(0, &[MULTIPLY, Unit { interval: 14, ..RECURRENCE }]),
            "slot `mul`: unit `recurrence` has interval 14; rtl/units/recurrence.v needs interval 15 at least",
        ),
        (
            units(0, &[Unit { name: "twofold", ..MULTIPLY }]),
            "slot `mul`: unit `twofold`: there is no circuit rtl/units/twofold.v: write it and list it in rtl/src/files.rs",
        ),
        // A sine every other cycle, beside an adder.
        (
            units(1, &[ADD, CONVERT, Unit { interval: 2, ..SINE }]),
            "slot `add`: unit `sine` has latency 14 and interval 2; beside results that are in flight for 12 cycles, a unit of \
             interval above 1 needs a latency of 14 and an interval of 3 at least",
        ),
        // An adder every third cycle beside a pipelined divider.
        (
            units(1, &[Unit { interval: 3, ..ADD }, DIVROOT]),
            "slot `add`: unit `add` has latency 5 and interval 3; beside results that are in flight for 11 cycles, a unit of \
             interval above 1 needs a latency of 13 and an interval of 3 at least",
        ),
    ];
    for (machine, message) in cases {
        let name = machine.name;
        assert_eq!(refused(machine), format!("machine `{name}`: {message}"));
    }
}

/// Exporting a machine with an invalid row fails with the row's error.
#[test]
fn no_machine() {
    let machine = Box::leak(Box::new(Machine { slots: &[], ..F3 }));
    let error = export(machine, &Library::builtin()).expect_err("no machine");
    assert_eq!(error.to_string(), "machine `f3`: 0 slots; a machine has 1 to 8");
}

/// A slot must not have a name that the core already uses.
#[test]
fn names_that_clash() {
    for name in ["m_mul", "r"] {
        let clash = slot(1, |slot| slot.name = name);
        let machine: &'static Machine = Box::leak(Box::new(clash));
        match export(machine, &Library::builtin()) {
            Err(ExportError::Module(ModuleError::Twice { module, .. })) => assert_eq!(module, "takt_f3"),
            other => panic!("{name}: {:?}", other.map(|design| design.top)),
        }
    }
}
