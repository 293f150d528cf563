// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every reason for which a row is no machine, each by the message that whoever writes the row gets from the compiler.

use takt_isa::spec::units::{ADD, ALU, ALU_LATE, CONVERT, MEMORY, SEQUENCER};
use takt_isa::{Bank, F1, F3, Function, MACHINES, Machine, Slot, Unit};

fn leak<T>(value: impl Into<Box<[T]>>) -> &'static [T] {
    Box::leak(value.into())
}

/// f3 with a slot changed.
fn slot(number: usize, change: impl FnOnce(&mut Slot)) -> Machine {
    let mut slots = F3.slots.to_vec();
    change(&mut slots[number]);
    Machine { slots: leak(slots), ..F3 }
}

/// f3 with other units in the slot `add`.
fn units(units: &[Unit]) -> Machine {
    slot(1, |slot| slot.units = leak(units))
}

fn bank(base: u16, depth: u16) -> Machine {
    slot(1, |slot| slot.bank = Bank { base, depth, ..slot.bank })
}

#[test]
fn rows_of_the_table_are_machines() {
    for machine in MACHINES {
        assert_eq!(machine.error(), None);
    }
}

#[test]
fn every_reason() {
    let many: Vec<Slot> = (0..9).map(|_| F3.slots[0]).collect();
    let cases: Vec<(Machine, &str)> = vec![
        (Machine { slots: &[], ..F3 }, "0 slots; a machine has 1 to 8"),
        (Machine { slots: leak(many), ..F3 }, "9 slots; a machine has 1 to 8"),
        (
            slot(1, |slot| slot.name = "2nd"),
            "slot `2nd`: a name is a lower-case letter, then lower-case letters, digits and single `_`",
        ),
        (
            slot(1, |slot| slot.name = "add__"),
            "slot `add__`: a name is a lower-case letter, then lower-case letters, digits and single `_`",
        ),
        (
            slot(1, |slot| slot.bank.name = ""),
            "bank ``: a name is a lower-case letter, then lower-case letters, digits and single `_`",
        ),
        (
            units(&[Unit { name: "Adder", ..ADD }]),
            "unit `Adder`: a name is a lower-case letter, then lower-case letters, digits and single `_`",
        ),
        (
            slot(1, |slot| slot.bank.name = "a2"),
            "bank `a2`: the name has letters only; a register's number follows it",
        ),
        (slot(1, |slot| slot.name = "mul"), "two slots are called `mul`"),
        (slot(1, |slot| slot.bank.name = "m"), "two banks are called `m`"),
        (Machine { inputs: Bank { name: "x", ..F3.inputs }, ..F3 }, "two banks are called `x`"),
        (bank(256, 0), "bank `a` has 0 registers; a bank has 1 to 512"),
        (bank(256, 513), "bank `a` has 513 registers; a bank has 1 to 512"),
        (bank(900, 200), "bank `a` has registers 900 to 1099; the register space ends at 1023"),
        (bank(128, 256), "banks `m` and `a` overlap in registers 128 to 255"),
        (
            Machine { inputs: Bank { base: 512, depth: 512, ..F3.inputs }, ..F3 },
            "banks `x` and `i` overlap in registers 512 to 767",
        ),
        (
            Machine { inputs: Bank { depth: 128, ..F3.inputs }, ..F3 },
            "the inputs' bank `i` ends at 895; its last register is `zero`, 1023",
        ),
        (
            Machine { outputs_per_bank: 257, ..F3 },
            "slot `mul`: outputs_per_bank is 257; bank `m` has 256 registers, of which 1 to all can be output ports",
        ),
        (
            Machine { outputs_per_bank: 0, ..F1 },
            "slot `one`: outputs_per_bank is 0; bank `r` has 512 registers, of which 1 to all can be output ports",
        ),
        (Machine { code_depth: 65537, ..F3 }, "code_depth is 65537; it is 1 to 65536"),
        (Machine { data_depth: 0, ..F3 }, "data_depth is 0; it is 1 to 4096"),
        (Machine { stack_depth: 0, ..F3 }, "stack_depth is 0; it is 1 to 65536"),
        (
            units(&[Unit { latency: 64, ..ADD }]),
            "slot `add`: unit `add` has latency 64; latencies stay below 64",
        ),
        (
            units(&[Unit { latency: 0, ..ADD }]),
            "slot `add`: unit `add` writes registers and has latency 0; it takes a cycle at least",
        ),
        (
            slot(2, |slot| slot.units = leak([Unit { latency: 2, ..SEQUENCER }])),
            "slot `aux`: unit `sequencer` writes no register and has latency 2; that is 0",
        ),
        (units(&[Unit { interval: 0, ..ADD }]), "slot `add`: unit `add` has interval 0; that is 1 to 63"),
        (units(&[Unit { interval: 64, ..ADD }]), "slot `add`: unit `add` has interval 64; that is 1 to 63"),
        (units(&[Unit { functions: &[], ..ADD }]), "slot `add`: unit `add` offers no function"),
        (
            units(&[Unit { functions: &[Function::Add, Function::Idle], ..ADD }]),
            "slot `add`: unit `add` offers Idle; every slot takes idle operations without a unit",
        ),
        (
            units(&[ADD, ALU, CONVERT, ALU_LATE]),
            "slot `add`: unit `alu` and unit `alu_late` both offer Alu; in a slot, one unit executes a function",
        ),
        (slot(2, |slot| slot.units = leak([ALU, MEMORY])), "no slot hosts the sequencer (function Control)"),
        (
            units(&[ADD, SEQUENCER]),
            "slot `add` and slot `aux` both host Control; a machine has one sequencer, and one data memory at most",
        ),
        (
            units(&[ADD, MEMORY]),
            "slot `add` and slot `aux` both host Memory; a machine has one sequencer, and one data memory at most",
        ),
    ];
    for (machine, message) in &cases {
        let error = machine.error().map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(error, format!("machine `{}`: {message}", machine.name));
    }
    let name = Machine { name: "t 3", ..F3 };
    assert!(
        name.error()
            .is_some_and(|error| error.to_string().starts_with("machine `t 3`: machine `t 3`: a name"))
    );
    // A case for each variant.
    let mut reasons: Vec<_> = cases.iter().filter_map(|(machine, _)| Some(machine.error()?.reason)).collect();
    reasons.dedup_by_key(|reason| std::mem::discriminant(reason));
    let distinct: std::collections::HashSet<_> = reasons.iter().map(std::mem::discriminant).collect();
    assert_eq!(distinct.len(), 19, "reasons without a case");
}

/// Two slots may host the same function, and an adder may take the place of another one.
#[test]
fn slots_may_share_functions() {
    let shared = slot(2, |slot| slot.units = leak([ALU, ADD, MEMORY, SEQUENCER]));
    assert_eq!(shared.error(), None);
}
