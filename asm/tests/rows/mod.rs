// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rows in which several slots host a function: f3's units, distributed differently; and random rows.

use std::sync::OnceLock;
use takt_isa::spec::units::*;
use takt_isa::{Bank, F3, Function, Machine, Slot, Unit};

const MUL: &[Unit] = &[MULTIPLY, DIVROOT, SINE, ARCTANGENT, ARCCOSINE];

/// The fused unit without its sums.
const PRODUCT_AND_SUM: Unit = Unit { functions: &[Function::Multiply, Function::Fused], ..FUSED };

/// The slots of a row: names and units.
type Slots = [(&'static str, &'static [Unit])];

const ROWS: &[(&str, &Slots)] = &[
    ("second_adder", &[("mul", MUL), ("add", &[ADD, CONVERT]), ("aux", &[ALU, ADD, MEMORY, SEQUENCER])]),
    (
        "second_multiplier",
        &[("mul", MUL), ("add", &[ADD, CONVERT, MULTIPLY]), ("aux", &[ALU, ADD, MEMORY, SEQUENCER])],
    ),
    (
        "two_dividers",
        &[("mul", MUL), ("add", &[ADD, CONVERT]), ("aux", &[ALU, RECURRENCE, MEMORY, SEQUENCER])],
    ),
    ("two_alus", &[("mul", MUL), ("add", &[ALU, ADD, CONVERT]), ("aux", &[ALU, MEMORY, SEQUENCER])]),
    // A function that takes longer in one slot than in the other.
    (
        "late_alu",
        &[
            ("mul", &[ALU_LATE, MULTIPLY, DIVROOT, SINE, ARCTANGENT, ARCCOSINE]),
            ("add", &[ADD, CONVERT]),
            ("aux", &[ALU, MEMORY, SEQUENCER]),
        ],
    ),
    // Products and sums fused in one slot alone, and in two of four.
    (
        "fused",
        &[
            ("mul", &[PRODUCT_AND_SUM, SINE, ARCTANGENT, ARCCOSINE]),
            ("add", &[ADD, DIVROOT]),
            ("aux", &[ALU, CONVERT, MEMORY, SEQUENCER]),
        ],
    ),
    (
        "fused_twice",
        &[
            ("mul", &[PRODUCT_AND_SUM, SINE, ARCTANGENT, ARCCOSINE]),
            ("add", &[ADD, DIVROOT]),
            ("aux", &[ALU, CONVERT, MEMORY, SEQUENCER]),
            ("mac", &[PRODUCT_AND_SUM, ADD, ALU]),
        ],
    ),
    (
        "four",
        &[
            ("mul", MUL),
            ("add", &[ADD, CONVERT]),
            ("aux", &[ALU, MEMORY, SEQUENCER]),
            ("more", &[MULTIPLY, ADD, ALU]),
        ],
    ),
];

/// A row with f3's registers, divided among its slots.
fn row(name: &'static str, slots: &Slots) -> Machine {
    let depth = F3.inputs.base / slots.len() as u16;
    let hosts = |unit: &Unit| unit.functions.contains(&Function::Loop);
    let counts = slots.iter().any(|(_, units)| units.iter().any(hosts));
    let loop_depth = if counts { 4 } else { 0 };
    let banks = ["m", "a", "x", "y", "w"];
    let slot = |(number, (name, units)): (u16, &(&'static str, &'static [Unit]))| Slot {
        name,
        bank: Bank { name: banks[usize::from(number)], base: number * depth, depth },
        units,
    };
    let slots: Vec<Slot> = (0..).zip(slots).map(slot).collect();
    let machine = Machine { name, slots: Vec::leak(slots), loop_depth, ..F3 };
    if let Some(error) = machine.error() {
        panic!("{error}");
    }
    machine
}

/// All rows, built once.
pub(crate) fn all() -> &'static [Machine] {
    static ALL: OnceLock<Vec<Machine>> = OnceLock::new();
    ALL.get_or_init(|| ROWS.iter().map(|(name, slots)| row(name, slots)).collect())
}

/// The row with a name.
pub(crate) fn named(name: &str) -> &'static Machine {
    all().iter().find(|machine| machine.name == name).expect("it is among the rows")
}

/// A row with two to four slots, in which each unit of f3, or a unit with the same functions and another timing, stands in one
/// slot or more.
pub(crate) fn random(mut below: impl FnMut(u64) -> u64) -> &'static Machine {
    let count = 2 + below(3) as usize;
    let mut units: Vec<Vec<Unit>> = vec![Vec::new(); count];
    let alternatives: [&[&[Unit]]; 7] = [
        &[&[MULTIPLY]],
        &[&[DIVROOT], &[RECURRENCE]],
        &[&[SINE], &[Unit { interval: 9, ..SINE }]],
        &[&[ARCTANGENT, ARCCOSINE]],
        &[&[ADD]],
        &[&[CONVERT]],
        &[&[ALU], &[ALU_LATE]],
    ];
    for kinds in alternatives {
        for slot in 0..1 + below(count as u64) {
            let first = if slot == 0 { below(count as u64) } else { slot };
            let place = &mut units[first as usize];
            let kind = kinds[below(kinds.len() as u64) as usize];
            if !place.iter().any(|unit| kind.iter().any(|new| new.functions[0] == unit.functions[0])) {
                place.extend_from_slice(kind);
            }
        }
    }
    units[below(count as u64) as usize].push(MEMORY);
    units[below(count as u64) as usize].push(SEQUENCER);
    let names = ["mul", "add", "aux", "more"];
    let slots: Vec<(&'static str, &'static [Unit])> =
        names.into_iter().zip(units).map(|(name, units)| (name, &*Vec::leak(units))).collect();
    Box::leak(Box::new(row("random", &slots)))
}
