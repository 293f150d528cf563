// SPDX-License-Identifier: MIT OR Apache-2.0
//! Neighbours of a row in the search: a unit is moved, duplicated, removed or replaced, or a slot added or removed. Validity is checked
//! later, by the rules for rows and circuits.

use std::collections::BTreeSet;
use takt_isa::spec::row::{BankOwned, RowOwned, SlotOwned, UnitOwned};
use takt_isa::{Function, Machine};

/// Units that may be duplicated in a second slot.
const DOUBLED: [&str; 6] = ["add", "multiply", "alu", "convert", "fused", "divroot"];
/// Names of slots and banks, in order of assignment.
const NAMES: [(&str, &str); 7] =
    [("mul", "m"), ("add", "a"), ("aux", "x"), ("mac", "p"), ("more", "q"), ("most", "u"), ("last", "v")];

/// Unit from the specification's table; `functions` and `cycles` replace its functions, latency and interval.
fn unit(name: &str, functions: &[Function], cycles: Option<(u32, u32)>) -> Option<UnitOwned> {
    let mut unit = UnitOwned::of(name)?;
    if !functions.is_empty() {
        unit.functions = functions.to_vec();
    }
    if let Some((latency, interval)) = cycles {
        (unit.latency, unit.interval) = (latency, interval);
    }
    Some(unit)
}

/// Replacements of a unit: other circuits for its functions, or other latencies and intervals of its circuit.
fn instead(of: &UnitOwned) -> Vec<UnitOwned> {
    use Function::{Fused, Multiply};
    let choices = match of.name {
        "divroot" => vec![unit("recurrence", &[], None)],
        "recurrence" => vec![unit("divroot", &[], None)],
        "alu" => [3, 4, 6].map(|latency| unit("alu_late", &[], Some((latency, 1)))).to_vec(),
        "alu_late" => vec![unit("alu", &[], None)],
        "convert" => [4, 5].map(|latency| unit("convert", &[], Some((latency, 1)))).to_vec(),
        "multiply" => vec![unit("fused", &[Multiply, Fused], None)],
        "fused" => vec![unit("multiply", &[], None)],
        "sine" => [1, 6].map(|interval| unit("sine", &[], Some((14, interval)))).to_vec(),
        _ => Vec::new(),
    };
    choices.into_iter().flatten().filter(|choice| choice != of).collect()
}

fn functions(units: &[UnitOwned]) -> BTreeSet<Function> {
    units.iter().flat_map(|unit| unit.functions.iter().copied()).collect()
}

/// Adds a unit to a slot, without functions that the slot already has; returns false if no function is left.
fn put(slot: &mut SlotOwned, mut unit: UnitOwned) -> bool {
    let own = functions(&slot.units);
    unit.functions.retain(|function| !own.contains(function));
    let is_new = !unit.functions.is_empty();
    if is_new {
        slot.units.push(unit);
    }
    is_new
}

/// Depths of the banks of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Depths {
    /// The greatest that there is room for in the space of registers.
    Most,
    /// Registers of each slot's bank, and inputs.
    Are(u16, u16),
}

impl Depths {
    /// Depths of a row.
    pub(super) fn of(row: &RowOwned) -> Depths {
        let registers = row.slots.iter().map(|slot| slot.bank.depth).max().unwrap_or(1);
        Depths::Are(registers, row.inputs.depth)
    }
}

/// All neighbours of a row, normalised by [`finished`].
pub(super) fn neighbours(row: &RowOwned, depths: Depths) -> Vec<RowOwned> {
    let mut all = Vec::new();
    let count = row.slots.len();
    let mut push = |slots: Vec<SlotOwned>| all.extend(finished(&RowOwned { slots, ..row.clone() }, depths));
    for (s, slot) in row.slots.iter().enumerate() {
        for (u, unit) in slot.units.iter().enumerate() {
            let mut without = row.slots.clone();
            without[s].units.remove(u);
            let is_core = unit.functions.iter().any(|f| matches!(f, Function::Control | Function::Store));
            if !is_core {
                push(without.clone());
            }
            for other in (0..count).filter(|other| *other != s) {
                let mut moved = without.clone();
                if put(&mut moved[other], unit.clone()) {
                    push(moved);
                }
                let mut doubled = row.slots.clone();
                let double = match unit.name {
                    "memory" => Some(UnitOwned { functions: vec![Function::Load], ..unit.clone() }),
                    name => DOUBLED.contains(&name).then(|| unit.clone()),
                };
                if double.is_some_and(|double| put(&mut doubled[other], double)) {
                    push(doubled);
                }
            }
            for choice in instead(unit) {
                let mut exchanged = without.clone();
                if put(&mut exchanged[s], choice) {
                    push(exchanged);
                }
            }
            // Add a slot for this unit, or for a second one of its kind.
            let mut alone = SlotOwned { units: Vec::new(), ..slot.clone() };
            put(&mut alone, unit.clone());
            if slot.units.len() > 1 && !is_core {
                push(without.iter().cloned().chain([alone.clone()]).collect());
            }
            if DOUBLED.contains(&unit.name) {
                push(row.slots.iter().cloned().chain([alone]).collect());
            }
        }
        // Combine sum, product and conversion in one circuit.
        let shared = ["add", "multiply", "convert"];
        if shared.iter().all(|name| slot.units.iter().any(|unit| unit.name == *name)) {
            let mut merged = row.slots.clone();
            merged[s].units.retain(|unit| !shared.contains(&unit.name));
            if unit("addmul", &[], None).is_some_and(|unit| put(&mut merged[s], unit)) {
                push(merged);
            }
        }
        // Remove a slot, and move its units to another.
        for other in (0..count).filter(|other| *other != s) {
            let mut merged = row.slots.clone();
            for unit in &slot.units {
                put(&mut merged[other], unit.clone());
            }
            merged.remove(s);
            push(merged);
        }
    }
    all
}

/// Rows with less than a row has, each in one place: a unit, counted loops, or half of a memory's words, registers or ports.
pub(super) fn smaller(row: &RowOwned) -> Vec<(RowOwned, Depths)> {
    let depths @ Depths::Are(registers, inputs) = Depths::of(row) else { return Vec::new() };
    let mut all: Vec<(RowOwned, Depths)> = Vec::new();
    for (s, slot) in row.slots.iter().enumerate() {
        for u in 0..slot.units.len() {
            let mut without = row.clone();
            without.slots[s].units.remove(u);
            all.push((without, depths));
        }
    }
    if row.loop_depth > 0 {
        let mut without = row.clone();
        let units = without.slots.iter_mut().flat_map(|slot| &mut slot.units);
        units.for_each(|unit| unit.functions.retain(|function| *function != Function::Loop));
        all.push((without, depths));
    }
    let half = |of: fn(&mut RowOwned) -> &mut u32| {
        let mut half = row.clone();
        let depth = of(&mut half);
        *depth /= 2;
        (*depth > 0).then_some((half, depths))
    };
    all.extend(half(|row| &mut row.code_depth));
    all.extend(half(|row| &mut row.data_depth));
    all.extend(half(|row| &mut row.stack_depth));
    if row.outputs_per_bank > 1 {
        all.push((RowOwned { outputs_per_bank: row.outputs_per_bank / 2, ..row.clone() }, depths));
    }
    if registers > 1 {
        all.push((row.clone(), Depths::Are(registers / 2, inputs)));
    }
    if inputs > 1 {
        all.push((row.clone(), Depths::Are(registers, inputs / 2)));
    }
    all
}

/// Normalises a row: units in table order, names and banks determined by the number of slots, banks of the given depths, and a name derived
/// from the contents. `None` if there are no slots, or more than names.
pub(super) fn finished(row: &RowOwned, depths: Depths) -> Option<RowOwned> {
    let mut slots: Vec<SlotOwned> = row.slots.iter().filter(|slot| !slot.units.is_empty()).cloned().collect();
    let order = |unit: &UnitOwned| takt_isa::UNITS.iter().position(|row| row.name == unit.name);
    // Banks start at multiples of the largest depth; the input bank comes last and ends the register space of 1,024.
    let (depths, inputs) = match (slots.len(), depths) {
        (1..=7, Depths::Are(registers, inputs)) => ([registers; 7], inputs),
        (1, Depths::Most) => ([512; 7], 256),
        (2 | 3, Depths::Most) => ([256; 7], 256),
        (4, Depths::Most) => ([256, 256, 256, 128, 0, 0, 0], 128),
        (5..=7, Depths::Most) => ([128; 7], 128),
        _ => return None,
    };
    let mut base = 0;
    for ((slot, (name, bank)), depth) in slots.iter_mut().zip(NAMES).zip(depths) {
        slot.units.sort_by_key(order);
        slot.name = name.to_owned();
        slot.bank = BankOwned { name: bank.to_owned(), base, depth };
        base += depth;
    }
    let loops = functions(&slots.iter().flat_map(|slot| slot.units.clone()).collect::<Vec<_>>());
    let mut row = RowOwned {
        name: String::new(),
        text: slots.iter().map(summary).collect::<Vec<_>>().join("; "),
        slots,
        inputs: BankOwned { name: "i".to_owned(), base: 1024 - inputs, depth: inputs },
        loop_depth: if loops.contains(&Function::Loop) { row.loop_depth.max(1) } else { 0 },
        ..row.clone()
    };
    row.name = format!("x{:08x}", content(&format!("{row:?}")) as u32);
    Some(row)
}

/// Units of a slot, as text.
fn summary(slot: &SlotOwned) -> String {
    let unit = |unit: &UnitOwned| match takt_isa::UNITS.iter().find(|row| row.name == unit.name) {
        Some(row) if (row.latency, row.interval) != (unit.latency, unit.interval) => {
            format!("{} {}/{}", unit.name, unit.latency, unit.interval)
        }
        _ => unit.name.to_owned(),
    };
    format!("{}: {}", slot.name, slot.units.iter().map(unit).collect::<Vec<_>>().join(" "))
}

/// Units of all slots of a machine, as text.
pub(super) fn summary_of(machine: &Machine) -> String {
    RowOwned::from(machine).slots.iter().map(summary).collect::<Vec<_>>().join("; ")
}

/// 64-bit FNV-1a hash, which is the same on every computer.
pub(super) fn content(text: &str) -> u64 {
    text.bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_isa::MACHINES;
    use takt_rtl::{Library, Plan};

    /// The neighbours of every machine in the table include rows with circuits, and rows with other numbers of slots.
    #[test]
    fn neighbours_have_circuits() {
        for &machine in MACHINES {
            let rows = neighbours(&RowOwned::from(machine), Depths::Most);
            let good: Vec<_> = rows
                .iter()
                .filter_map(|row| row.machine().ok())
                .filter(|machine| Plan::new(machine, &Library::builtin()).is_ok())
                .collect();
            let slots: BTreeSet<usize> = good.iter().map(|machine| machine.slots.len()).collect();
            assert!(slots.len() >= 2, "{}: {slots:?}", machine.name);
            assert!(good.len() > 8, "{}: {} of {}", machine.name, good.len(), rows.len());
            for row in rows {
                assert_eq!(finished(&row, Depths::Most).as_ref(), Some(&row));
            }
        }
    }
}
