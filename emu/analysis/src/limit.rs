// SPDX-License-Identifier: MIT OR Apache-2.0
//! Limits of output ports: plots show them as lines.

use takt_isa::{BundleAddress, Instruction, Program, Register, SlotIndex};

/// Maximum number of copies to follow from a port back to a limiting operation.
const COPIES: usize = 8;

/// Symmetric limit of an output port: the constant limit of the `fsat` that writes it, directly or through copies.
pub fn limit(program: &Program, port: Register) -> Option<f32> {
    // If several operations write the port, one of them perhaps in `.once`, take the first limit found.
    let writers = writers(program, port);
    writers.iter().find_map(|(address, instruction)| saturated(program, *address, instruction, COPIES))
}

/// Operations that write a register, with their bundles, in code order.
fn writers(program: &Program, register: Register) -> Vec<(BundleAddress, Instruction)> {
    let all = program.addresses().flat_map(|address| {
        let bundle = program.bundle(address).and_then(Result::ok).unwrap_or_default();
        SlotIndex::all().zip(bundle).map(move |(slot, instruction)| (address, slot, instruction))
    });
    all.filter(|(_, slot, instruction)| instruction.writes(program.machine.slot(*slot)) == Some(register))
        .map(|(address, _, instruction)| (address, instruction))
        .collect()
}

fn saturated(
    program: &Program,
    address: BundleAddress,
    instruction: &Instruction,
    copies: usize,
) -> Option<f32> {
    match instruction.op.row().mnemonic {
        "fsat" => {
            let limit = *instruction.reads().get(1)?;
            let bits = program.initial(limit)?;
            Some(f32::from_bits(bits).abs()).filter(|limit| limit.is_finite())
        }
        "mov" if copies > 0 => {
            let source = *instruction.reads().first()?;
            // Follow the nearest preceding write, in code order.
            let (before, writer) = writers(program, source).into_iter().rfind(|(at, _)| *at < address)?;
            saturated(program, before, &writer, copies - 1)
        }
        _ => None,
    }
}
