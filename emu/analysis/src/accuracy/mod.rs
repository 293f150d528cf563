// SPDX-License-Identifier: MIT OR Apache-2.0
//! Accuracy analysis of a program's results, down to the operations that cause errors.
//!
//! [`enclose()`] proves bounds on the errors of all runs, from the ranges of inputs and states, by abstract interpretation. [`Shadow`]
//! measures the errors of one run, by shadow execution: beside the bit-exact run it computes, for every register and data word, the
//! value that the same operations give in binary64. `docs/accuracy.md` defines which differences count as errors.

mod affine;
mod assume;
mod bits;
mod boxes;
#[cfg(test)]
mod brute_force;
mod certificate;
mod compute;
mod converge;
mod enclose;
mod enclosure;
mod extent;
mod interval;
mod loops;
mod loss;
mod memory;
mod node;
mod number;
mod operand;
mod probe;
mod refine;
mod relation;
mod relative;
mod rounding;
mod shadow;
mod states;
mod value;

use std::collections::{BTreeMap, BTreeSet};
use takt_isa::{BundleAddress, Flow, Instruction, Program, Register};

pub use boxes::enclose_in_boxes;
pub use certificate::{Certificate, Form, Kept, Open, Promise, Proved, Rounding, Step, exact as in_gappa};
pub use enclose::{MAX_BUNDLES, MAX_UNROLLED, Reals, certify, enclose, enclose_reals, enclose_within};
pub use enclosure::{
    Converging, Enclosure, Hazard, Moment, OutputBound, OutputPlace, Relied, StateRange, UnprovedRange,
};
pub use extent::{Extent, OperandExtent, OperationExtent};
pub use interval::Interval;
pub use loss::{Loss, loss};
pub use number::Problem;
pub use shadow::{
    Decision, ErrorShare, LargestError, LostComparison, OperationAccuracy, OutputAccuracy, Seen, Shadow,
};

/// Rounding constants: programs add them to round to integers, since binary32 has no fraction bits at that magnitude.
const ROUNDERS: [f64; 2] = [8_388_608.0, 12_582_912.0];
/// Largest magnitude that a rounding constant can round.
const LARGEST_ROUNDED: f64 = 4_194_304.0;

fn is_rounder(bits: u32) -> bool {
    ROUNDERS.contains(&f64::from(f32::from_bits(bits)).abs())
}

/// Registers that the loader sets, with their bits; without input ports and parameters, which the host may set afterwards.
fn preset(program: &Program) -> impl Iterator<Item = (Register, u32)> {
    program.constants.iter().copied().filter(|(register, _)| !program.machine.is_input(*register))
}

/// Constant registers with their bits: set by the loader, written by no operation.
fn fixed(program: &Program) -> BTreeMap<Register, u32> {
    let mut fixed: BTreeMap<Register, u32> = preset(program).collect();
    for bundle in program.code.chunks_exact(program.machine.slots.len()) {
        for (word, slot) in bundle.iter().zip(program.machine.slots) {
            if let Some(register) = Instruction::decode(*word).ok().and_then(|i| i.writes(slot)) {
                fixed.remove(&register);
            }
        }
    }
    fixed
}

/// Registers that are written, and by no bundle that a period can reach: they keep what the code before the first period leaves in them.
fn kept(program: &Program) -> BTreeSet<Register> {
    let slots = program.machine.slots;
    let bundle = |address: BundleAddress| {
        let start = address.index() * slots.len();
        let words = program.code.get(start..start + slots.len()).unwrap_or_default();
        words.iter().map(|word| Instruction::decode(*word).ok()).collect::<Vec<_>>()
    };
    let writes = |address: BundleAddress| {
        let instructions = bundle(address).into_iter().zip(slots);
        instructions.filter_map(|(instruction, slot)| instruction?.writes(slot)).collect::<Vec<_>>()
    };
    let flow = |address: BundleAddress| Flow::of(bundle(address).iter().flatten());
    let mut open: Vec<BundleAddress> = program
        .addresses()
        .filter_map(|address| match flow(address) {
            Flow::Wait(target) => Some(target),
            _ => None,
        })
        .collect();
    let mut in_periods = BTreeSet::new();
    while let Some(address) = open.pop() {
        if address.index() >= program.bundles() as usize || !in_periods.insert(address) {
            continue;
        }
        let next = address.next();
        match flow(address) {
            Flow::Jump(target) | Flow::Wait(target) => open.push(target),
            Flow::Branch { target, .. } | Flow::Call(target) => open.extend([target, next]),
            Flow::Loop { end, .. } => open.extend([end, next]),
            Flow::Next | Flow::LoopEnd | Flow::Publish => open.push(next),
            // A call goes on behind itself.
            Flow::Return | Flow::Halt => {}
        }
    }
    let of = |in_period: bool| {
        let addresses = program.addresses().filter(|address| in_periods.contains(address) == in_period);
        addresses.flat_map(writes).collect::<BTreeSet<_>>()
    };
    let ranged = |register: &Register| program.ranges.iter().any(|range| range.register == *register);
    of(false).difference(&of(true)).filter(|register| !ranged(register)).copied().collect()
}

/// Exponent of the smallest normal binary32.
const LEAST_EXPONENT: i32 = -126;
/// Fraction bits of a binary32.
const FRACTION: i32 = 23;

/// Unit in the last place of binary32 at a value: the distance of the numbers in its binade; infinite beyond the largest.
pub fn ulp(value: f64) -> f64 {
    if !value.is_finite() || value.abs() >= 2f64.powi(128) {
        return f64::INFINITY;
    }
    // Exact in binary64, subnormal numbers too: the exponent is read from the bits.
    let exponent = ((value.abs().to_bits() >> 52) as i32 - 1023).max(LEAST_EXPONENT);
    2f64.powi(exponent - FRACTION)
}
