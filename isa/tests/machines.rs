// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every reason for which a row is invalid, each with the message that the compiler shows the row's author.

use takt_isa::spec::configuration::OPTIONS;
use takt_isa::spec::units::{ADD, ALU, ALU_LATE, CONVERT, MEMORY, SEQUENCER};
use takt_isa::{Bank, F1, F3, Function, MACHINES, Machine, RowError, RowOwned, Slot, T1, T3, Unit};

/// A memory port that only loads.
const PORT: Unit = Unit { functions: &[Function::Load], ..MEMORY };

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

/// An invalid row, and its message after the name.
type Case = (Machine, &'static str);

/// Numbers and names of slots, units and banks.
fn names() -> Vec<Case> {
    let many: Vec<Slot> = (0..9).map(|_| F3.slots[0]).collect();
    vec![
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
    ]
}

/// Depths and places of banks and memories.
fn depths() -> Vec<Case> {
    vec![
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
        (Machine { data_depth: 0, ..F3 }, "data_depth is 0; it is 1 to 65536"),
        (Machine { stack_depth: 0, ..F3 }, "stack_depth is 0; it is 1 to 65536"),
    ]
}

/// Units of one slot.
fn slot_units() -> Vec<Case> {
    vec![
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
    ]
}

/// Functions that slots share, and counts of loops.
fn functions() -> Vec<Case> {
    vec![
        (slot(2, |slot| slot.units = leak([ALU, MEMORY])), "no slot hosts the sequencer (function Control)"),
        (
            units(&[ADD, SEQUENCER]),
            "slot `add` and slot `aux` both host Control; a machine has one sequencer, and one slot at most that stores",
        ),
        (
            units(&[ADD, MEMORY]),
            "slot `add` and slot `aux` both host Store; a machine has one sequencer, and one slot at most that stores",
        ),
        (
            Machine { slots: leak([F3.slots[2], Slot { units: leak([PORT]), ..F3.slots[1] }]), ..F3 },
            "slot `add` hosts Load after slot `aux`, which hosts Store; a bundle's loads read what was there before its store, so they come before it",
        ),
        (
            Machine {
                slots: leak([
                    Slot { units: leak([PORT]), ..F3.slots[0] },
                    Slot { units: leak([PORT]), ..F3.slots[1] },
                    F3.slots[2],
                ]),
                ..F3
            },
            "slot `aux` is the third that hosts Load; the data memory has two ports",
        ),
        (Machine { loop_depth: 4, ..F3 }, "loop_depth is 4; the sequencer does not offer Loop, so it is 0"),
    ]
}

#[test]
fn every_reason() {
    let cases = [names(), depths(), slot_units(), functions()].concat();
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
    assert_eq!(distinct.len(), 22, "reasons without a case");
}

/// Two slots may host the same function, and an adder may take the place of another one.
#[test]
fn slots_may_share_functions() {
    let shared = slot(2, |slot| slot.units = leak([ALU, ADD, MEMORY, SEQUENCER]));
    assert_eq!(Machine { loop_depth: 4, ..shared }.error(), None);
}

fn named(name: &str) -> &'static Machine {
    Machine::from_name(name).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Names with depths beyond the row's; names with equal depths are one name and one machine.
#[test]
fn machines_by_name() {
    let machine = named("t3,code=4096,data=32768");
    assert_eq!((machine.name, machine.row_name()), ("t3,code=4096,data=32768", "t3"));
    assert_eq!((machine.code_depth, machine.data_depth), (4096, 32768));
    assert_eq!(machine.identifier(), "t3_code_4096_data_32768");
    assert_eq!(machine.options(), " code=4096 data=32768");
    assert_eq!(machine.row(), &T3);
    assert_eq!(machine.error(), None);
    for same in ["t3,data=32768,code=4096", "t3, code = 4096 , data=032768"] {
        assert!(std::ptr::eq(named(same), machine), "{same}");
    }
    for row in ["t3", "t3,data=1024", "t3,code=1024,data=1024"] {
        assert!(std::ptr::eq(named(row), &T3), "{row}");
    }
    let back = machine.with_options([("data", "1024")]).unwrap();
    assert_eq!(back.name, "t3,code=4096");
    for option in &OPTIONS {
        let deepest = named(&format!("t1,{}={}", option.name, option.most));
        assert_eq!(deepest.error(), None, "{}", deepest.name);
    }
}

#[test]
fn rejects_unknown_machine_names() {
    let cases = [
        ("", "there is no machine ``"),
        ("t5", "there is no machine `t5`"),
        ("t5,data=2", "there is no machine `t5`"),
        ("t3,", "a machine has no option ``"),
        ("t3,dat=4096", "a machine has no option `dat`"),
        ("t3,stack_depth=4", "a machine has no option `stack_depth`"),
        ("t3,data", "`data` needs a number, as `data=4096`"),
        ("t3,data=", "`data` needs a number, as `data=4096`"),
        ("t3,data=4k", "`data=4k`: `4k` is not a number"),
        ("t3,data=-4", "`data=-4`: `-4` is not a number"),
        ("t3,data=24064", "`data=24064`: a depth is a power of two from 2 to 65536; the next is 32768"),
        ("t3,data=0", "`data=0`: a depth is a power of two from 2 to 65536; the next is 2"),
        ("t3,data=131072", "`data=131072`: a depth is a power of two from 2 to 65536"),
        ("t3,code=4294967295", "`code=4294967295`: a depth is a power of two from 2 to 65536"),
        ("t3,data=4096,data=4096", "`data` is given twice"),
    ];
    for (name, message) in cases {
        assert_eq!(Machine::from_name(name).map_err(|error| error.to_string()), Err(message.to_owned()));
    }
    let huge = Machine::from_name(&format!("t3,data={}", "9".repeat(40)));
    assert!(
        huge.is_err_and(|error| error.to_string().starts_with("`data=18446744073709551615`: a depth is"))
    );
}

/// The smallest machine of the same row that is large enough.
#[test]
fn machines_that_hold_a_program() {
    let holding = |machine: &'static Machine, bundles, words| {
        machine.holding(bundles, words).map(|machine| machine.name)
    };
    assert_eq!(holding(&T3, 1024, 1024), Some("t3"));
    assert_eq!(holding(&T3, 1, 24064), Some("t3,data=32768"));
    assert_eq!(holding(&T1, 2049, 1025), Some("t1,code=4096,data=2048"));
    assert_eq!(holding(named("t3,data=4096"), 1025, 1), Some("t3,code=2048,data=4096"));
    assert_eq!(holding(&T3, 1, 65536), Some("t3,data=65536"));
    assert_eq!(holding(&T3, 1, 65537), None);
    assert_eq!(holding(&T3, 1, u64::MAX), None);
    assert_eq!(holding(&T3, 65535, 1), Some("t3,code=65536"));
    assert_eq!(holding(&T3, 65536, 1), None);
    assert_eq!((T3.most_bundles(), named("t3,code=65536").most_bundles()), (1024, 65535));
}

/// Rows made at run time pass the same checks as the table's rows, with the same messages.
#[test]
fn rows_of_files_are_checked_alike() {
    let of = |machine: &Machine| RowOwned { name: "mine".to_owned(), ..RowOwned::from(machine) }.machine();
    assert_eq!(of(&F3).map(|machine| machine.slots.len()), Ok(3));
    for machine in [
        Machine { slots: &[], ..F3 },
        Machine { outputs_per_bank: 257, ..F3 },
        Machine { loop_depth: 4, ..F3 },
        Machine { refill: 64, ..F3 },
        bank(128, 256),
        units(&[ALU, ALU_LATE, MEMORY, SEQUENCER]),
    ] {
        let expected = machine.error().expect("it is wrong").to_string().replace("`f3`", "`mine`");
        assert_eq!(of(&machine).map_err(|error| error.to_string()), Err(expected));
    }
    let taken = RowOwned { refill: 7, ..RowOwned::from(&F3) }.machine();
    assert_eq!(taken, Err(RowError::Taken { name: "f3" }));
}
