//! Rows in which several slots host a function: t3's units, placed otherwise.
#![allow(dead_code)]

use std::sync::OnceLock;
use takt_isa::spec::units::*;
use takt_isa::{Bank, Machine, Slot, T3, Unit};

const MUL: &[Unit] = &[MULTIPLY, DIVROOT, SINE, ARCTANGENT, ARCCOSINE];
const MUL_WITHOUT_DIVROOT: &[Unit] = &[MULTIPLY, SINE, ARCTANGENT, ARCCOSINE];

/// The slots of each row beyond t3: names and units.
const ROWS: &[(&str, &[(&str, &[Unit])])] = &[
    ("second_adder", &[("mul", MUL), ("add", &[ADD, CONVERT]), ("aux", &[ALU, ADD, MEMORY, SEQUENCER])]),
    (
        "two_dividers",
        &[("mul", MUL), ("add", &[ADD, CONVERT]), ("aux", &[ALU, DIVROOT, MEMORY, SEQUENCER])],
    ),
    (
        "two_alus",
        &[("mul", MUL), ("add", &[ALU, ADD, CONVERT]), ("aux", &[ALU, MEMORY, SEQUENCER])],
    ),
    // Where a function takes as long in one slot as in another no longer: which is the better choice depends on what follows.
    (
        "late_alu",
        &[("mul", &[MULTIPLY, DIVROOT, SINE, ARCTANGENT, ARCCOSINE, ALU_LATE]), ("add", &[ADD, CONVERT]), ("aux", &[ALU, ADD, MEMORY, SEQUENCER])],
    ),
    (
        "second_multiplier",
        &[("mul", MUL), ("add", &[ADD, CONVERT, MULTIPLY]), ("aux", &[ALU, ADD, MEMORY, SEQUENCER])],
    ),
    (
        "four",
        &[
            ("mul", MUL),
            ("add", &[ADD, CONVERT]),
            ("aux", &[ALU, MEMORY, SEQUENCER]),
            ("more", &[MULTIPLY, ADD, ALU, DIVIDE]),
        ],
    ),
    ("divider_moved", &[("mul", MUL_WITHOUT_DIVROOT), ("add", &[ADD, CONVERT]), ("aux", &[ALU, DIVROOT, MEMORY, SEQUENCER])]),
];

/// The machines. Each has t3's registers, divided among its slots.
pub(crate) fn all() -> &'static [Machine] {
    static ALL: OnceLock<Vec<Machine>> = OnceLock::new();
    ALL.get_or_init(|| {
        let machine = |(name, slots): &(&'static str, &[(&'static str, &'static [Unit])])| {
            let depth = T3.inputs.base / slots.len() as u16;
            let banks = ["m", "a", "x", "y"];
            let slot = |((number, (name, units)), bank): ((u16, &(&'static str, &'static [Unit])), &'static str)| {
                Slot { name, bank: Bank { name: bank, base: number * depth, depth }, units }
            };
            let slots: Vec<Slot> = (0..).zip(*slots).zip(banks).map(slot).collect();
            let machine = Machine { name, slots: Vec::leak(slots), ..T3 };
            assert_eq!(machine.error(), None, "{name}");
            machine
        };
        ROWS.iter().map(machine).collect()
    })
}
