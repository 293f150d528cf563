// SPDX-License-Identifier: MIT OR Apache-2.0
//! Minimal assembler, so that these tests depend on the specification alone.
//!
//! A line is a label, a bundle (`op d, a, b || op …`, canonical register names, labels as targets), or a directive:
//! `.preset register value`, `.input name register`, `.output name register type`.

use std::collections::HashMap;
use takt_emu::{Batch, Emulator};
use takt_isa::program::{Location, Port};
use takt_isa::{
    BundleAddress, Function, Instruction, MACHINES, Machine, Operand, Program, ROWS, Register, SlotIndex,
    Type,
};

/// Every machine, and one with a deep data memory.
pub(crate) fn machines() -> Vec<&'static Machine> {
    let deep = Machine::from_name("t3,data=4096").expect("it is a machine");
    MACHINES.iter().copied().chain([deep]).collect()
}

pub(crate) fn program(machine: &'static Machine, source: &str) -> Program {
    let mut program = Program {
        machine,
        code: Vec::new(),
        data: Vec::new(),
        constants: Vec::new(),
        inputs: Vec::new(),
        outputs: Vec::new(),
        registers: Vec::new(),
        symbols: Vec::new(),
        loop_bounds: Vec::new(),
        ranges: Vec::new(),
        array_ranges: Vec::new(),
        results: Vec::new(),
        assumptions: Vec::new(),
        parts: Vec::new(),
        origins: Vec::new(),
        parameters: Vec::new(),
        latched: false,
        sections: Vec::new(),
        files: vec!["test.s".to_owned()],
        lines: Vec::new(),
    };
    let mut labels = HashMap::new();
    let mut bundles = Vec::new();
    for (number, line) in source.lines().enumerate() {
        let mut line = line.split(';').next().unwrap().trim();
        if let Some((label, rest)) = line.split_once(':') {
            labels.insert(label.trim(), bundles.len() as u32);
            line = rest.trim();
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let register =
            |name: &str| machine.register_address(name).unwrap_or_else(|| panic!("no register {name}"));
        let port = |ty: Option<&&str>| Port {
            name: words[1].to_owned(),
            register: register(words[2]),
            ty: match ty {
                Some(&"int") => Type::I,
                Some(&"bits") => Type::B,
                _ => Type::F,
            },
        };
        match words.first() {
            None => {}
            Some(&".preset") => program.constants.push((register(words[1]), value(words[2]))),
            Some(&".input") => program.inputs.push(port(words.get(3))),
            Some(&".output") => program.outputs.push(port(words.get(3))),
            Some(_) => bundles.push((number as u32 + 1, line)),
        }
    }
    for (line, bundle) in bundles {
        let mut words = vec![Instruction::NOP.encode().unwrap(); machine.slots.len()];
        let mut lines = vec![None; machine.slots.len()];
        for operation in bundle.split("||") {
            let (slot, instruction) = parse(machine, operation.trim(), &labels);
            let slot = slot.index();
            words[slot] = instruction.encode().unwrap();
            lines[slot] = Some(Location { file: 0, line });
        }
        program.code.extend(words);
        program.lines.extend(lines);
    }
    program.constants.sort_unstable();
    program
}

/// Address of bundle `number`.
pub(crate) fn at(number: impl TryInto<u32>) -> BundleAddress {
    BundleAddress::new(number.try_into().ok().unwrap())
}

/// Input port `number` of a machine.
pub(crate) fn input(machine: &Machine, number: usize) -> Register {
    machine.inputs.registers().nth(number).unwrap()
}

/// Latency and interval of a machine's unit.
pub(crate) fn unit(machine: &Machine, function: Function) -> (u64, u64) {
    let (_, unit) = machine.host(function).unwrap();
    (unit.latency.into(), unit.interval.into())
}

/// Latency of a machine's unit.
pub(crate) fn latency(machine: &Machine, function: Function) -> u64 {
    unit(machine, function).0
}

fn parse(machine: &Machine, text: &str, labels: &HashMap<&str, u32>) -> (SlotIndex, Instruction) {
    let (mnemonic, operands) = text.split_once(' ').unwrap_or((text, ""));
    let row = ROWS.iter().find(|row| row.mnemonic == mnemonic).unwrap_or_else(|| panic!("no {mnemonic}"));
    let register = |name: &str| {
        machine.register_address(name.trim()).unwrap_or_else(|| panic!("no register {name} in {text}"))
    };
    let mut instruction = Instruction::bare(row.op);
    let operands: Vec<&str> = operands.split(',').map(str::trim).filter(|o| !o.is_empty()).collect();
    // Among the slots that host the function, choose the one whose bank has the destination.
    let dest = row.shape.operands().iter().position(|operand| *operand == Operand::Dest);
    let writes = |slot: &SlotIndex| {
        dest.is_none_or(|dest| machine.slot(*slot).bank.index(register(operands[dest])).is_some())
    };
    // Operations that do nothing may stand in any slot.
    let slot = machine.hosts(row.function).iter().find(writes).or(SlotIndex::new(0)).unwrap();
    assert_eq!(operands.len(), row.shape.operands().len(), "{text}");
    for (operand, text) in row.shape.operands().iter().zip(operands) {
        match *operand {
            Operand::Dest => instruction.dest = machine.slot(slot).bank.index(register(text)).unwrap(),
            Operand::Source(n) => instruction.sources[n] = register(text),
            Operand::Immediate => instruction.constant = value(text),
            Operand::Target => {
                instruction.constant = labels
                    .get(text)
                    .copied()
                    .unwrap_or_else(|| text.parse().unwrap_or_else(|_| panic!("{text}")));
            }
            Operand::Memory => {
                let (offset, base) = text.trim_end_matches(']').split_once('[').unwrap();
                instruction.constant = offset.parse().unwrap();
                instruction.sources[0] = register(base);
            }
        }
    }
    (slot, instruction)
}

/// Word from a number: binary32 if it has a decimal point, otherwise an integer.
fn value(text: &str) -> u32 {
    if text == "nan" {
        0x7fc0_0000
    } else if text.contains('.') {
        text.parse::<f32>().unwrap().to_bits()
    } else {
        text.parse::<i32>().unwrap() as u32
    }
}

/// Asserts that all observable state of a lane equals that of its own emulator.
pub(crate) fn assert_lane(context: &str, batch: &Batch, lane: usize, single: &Emulator) {
    assert_eq!(batch.now(lane), single.now(), "{context}: now");
    assert_eq!(batch.flags(lane), single.flags(), "{context}: flags");
    for register in Register::all() {
        assert_eq!(batch.register(lane, register), single.register(register), "{context}: {register}");
        let (found, expected) = (batch.output_bits(lane, register), single.output_bits(register));
        assert_eq!(found, expected, "{context}: output at {register}");
    }
    assert_eq!(batch.memory(lane), single.memory(), "{context}: memory");
}
