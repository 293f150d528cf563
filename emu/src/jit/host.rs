// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instruction selection: the operations for which the host has an instruction.
//!
//! Operations are matched by their meaning: an operation is compiled to the host instruction that gives the same results for all probe
//! operands. Thus no instruction of the machine is named here.

use std::sync::OnceLock;
use takt_isa::fp::{self, is_nan};
use takt_isa::{Effect, Op, ROWS, compute};

/// Instructions of the host.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Host {
    Copy,
    Choose,
    // Integers and bits.
    Sum,
    Difference,
    And,
    Or,
    Xor,
    ShiftLeft,
    ShiftRight,
    ShiftSigned,
    Same,
    Below,
    BelowUnsigned,
    // binary32, not rounded.
    Magnitude,
    Negation,
    Sign,
    Minimum,
    Maximum,
    Saturation,
    Equal,
    Less,
    LessOrEqual,
    // binary32, rounded.
    Add,
    Subtract,
    Multiply,
    Divide,
    Root,
    FromInteger,
    ToInteger,
    /// Fused multiply-add `±a · b ± c`: the flags negate the product and the addend.
    Fused(bool, bool),
}

const ALL: [Host; 33] = [
    Host::Copy,
    Host::Choose,
    Host::Sum,
    Host::Difference,
    Host::And,
    Host::Or,
    Host::Xor,
    Host::ShiftLeft,
    Host::ShiftRight,
    Host::ShiftSigned,
    Host::Same,
    Host::Below,
    Host::BelowUnsigned,
    Host::Magnitude,
    Host::Negation,
    Host::Sign,
    Host::Minimum,
    Host::Maximum,
    Host::Saturation,
    Host::Equal,
    Host::Less,
    Host::LessOrEqual,
    Host::Add,
    Host::Subtract,
    Host::Multiply,
    Host::Divide,
    Host::Root,
    Host::FromInteger,
    Host::ToInteger,
    Host::Fused(false, false),
    Host::Fused(false, true),
    Host::Fused(true, false),
    Host::Fused(true, true),
];

/// Operands for which an operation is compared with the host's: zeros, ones, halves, ends of the ranges, subnormals, and arbitrary
/// numbers.
const PROBES: [u32; 24] = [
    0,
    0x8000_0000,
    0x3f80_0000,
    0xbf80_0000,
    0x3f00_0000,
    0x4020_0000,
    0xc060_0000,
    0x4049_0fdb,
    0x3dcc_cccd,
    0x4b80_0001,
    0xcb00_0001,
    0x4eff_ffff,
    0x0080_0000,
    0x8000_0003,
    0x7f7f_ffff,
    0x7f80_0000,
    1,
    2,
    31,
    33,
    0x7fff_ffff,
    0xffff_ffff,
    0x5a31_c0e7,
    0xa5f0_1b2d,
];

impl Host {
    /// Binary32 arithmetic: finite operands may give an infinity or a NaN.
    pub(super) fn is_arithmetic(self) -> bool {
        use Host::{Add, Divide, Fused, Multiply, Root, Subtract};
        matches!(self, Add | Subtract | Multiply | Divide | Root | Fused(..))
    }

    /// Operands whose infinity or NaN propagates to the result.
    pub(super) fn passes_on(self) -> [bool; 3] {
        match self {
            Host::Magnitude | Host::Negation | Host::Divide | Host::Root => [true, false, false],
            Host::Add | Host::Subtract | Host::Multiply => [true, true, false],
            Host::Fused(..) => [true; 3],
            _ => [false; 3],
        }
    }

    /// Operands that must not be NaN, because the host's instruction treats NaNs differently.
    pub(super) fn compares(self) -> [bool; 3] {
        use Host::{Equal, Less, LessOrEqual, Maximum, Minimum, Saturation, Sign};
        match self {
            Sign => [true, false, false],
            Equal | Less | LessOrEqual | Minimum | Maximum | Saturation => [true, true, false],
            _ => [false; 3],
        }
    }

    /// The result is finite if the operands named by [`Host::compares`] are.
    pub(super) fn is_number(self) -> bool {
        use Host::{FromInteger, Maximum, Minimum, Saturation, Sign};
        matches!(self, FromInteger | Sign | Minimum | Maximum | Saturation)
    }

    fn sources(self) -> usize {
        use Host::{Copy, FromInteger, Magnitude, Negation, Root, Sign, ToInteger};
        match self {
            Copy | Magnitude | Negation | Sign | Root | FromInteger | ToInteger => 1,
            Host::Choose | Host::Fused(..) => 3,
            _ => 2,
        }
    }

    /// Result of the compiled instructions; `None` where they leave the block to the interpreter.
    fn value(self, [a, b, c]: [u32; 3]) -> Option<u32> {
        let [x, y, z] = [a, b, c].map(f32::from_bits);
        let finite = |value: f32| value.is_finite().then_some(value.to_bits());
        if self.compares().into_iter().zip([a, b, c]).any(|(compared, bits)| compared && is_nan(bits)) {
            return None;
        }
        match self {
            Host::Copy => Some(a),
            Host::Choose => Some(if a != 0 { b } else { c }),
            Host::Sum => Some(a.wrapping_add(b)),
            Host::Difference => Some(a.wrapping_sub(b)),
            Host::And => Some(a & b),
            Host::Or => Some(a | b),
            Host::Xor => Some(a ^ b),
            Host::ShiftLeft => Some(a.wrapping_shl(b)),
            Host::ShiftRight => Some(a.wrapping_shr(b)),
            Host::ShiftSigned => Some(a.cast_signed().wrapping_shr(b).cast_unsigned()),
            Host::Same => Some(u32::from(a == b)),
            Host::Below => Some(u32::from(a.cast_signed() < b.cast_signed())),
            Host::BelowUnsigned => Some(u32::from(a < b)),
            Host::Magnitude => Some(x.abs().to_bits()),
            Host::Negation => Some((-x).to_bits()),
            Host::Sign => Some(if x == 0.0 { 0 } else { 1_f32.copysign(x).to_bits() }),
            // −0 is less than +0.
            Host::Minimum => Some(if x == y { a | b & 0x8000_0000 } else { x.min(y).to_bits() }),
            Host::Maximum => Some(if x == y { a & (b | 0x7fff_ffff) } else { x.max(y).to_bits() }),
            Host::Saturation => Some(if x.abs() > y.abs() { y.abs().copysign(x).to_bits() } else { a }),
            Host::Equal => Some(u32::from(x == y)),
            Host::Less => Some(u32::from(x < y)),
            Host::LessOrEqual => Some(u32::from(x <= y)),
            Host::Add => finite(x + y),
            Host::Subtract => finite(x - y),
            Host::Multiply => finite(x * y),
            Host::Divide => finite(x / y),
            Host::Root => finite(x.sqrt()),
            Host::FromInteger => Some((a.cast_signed() as f32).to_bits()),
            Host::ToInteger => {
                (x.abs() < 2_147_483_648.0).then(|| (x.round_ties_even() as i32).cast_unsigned())
            }
            Host::Fused(product, addend) => {
                finite((if product { -x } else { x }).mul_add(y, if addend { -z } else { z }))
            }
        }
    }

    /// Equivalence to `op`: the same bits, and no flag, for all probes with a value.
    fn is(self, op: Op) -> bool {
        let sources = self.sources();
        let probes = |source: usize| if source < sources { &PROBES[..] } else { &PROBES[..1] };
        let alike = op.row().effect == Effect::Compute && op.row().shape.sources() == sources;
        alike
            && probes(0).iter().all(|&a| {
                probes(1).iter().all(|&b| {
                    probes(2).iter().all(|&c| {
                        let value = compute::<fp::Host>(op, a, b, c);
                        self.value([a, b, c]).is_none_or(|bits| bits == value.bits && value.flags.is_empty())
                    })
                })
            })
    }

    /// Host instruction for an operation; `None` if the operation must be a call.
    pub(super) fn of(op: Op) -> Option<Host> {
        static FOUND: OnceLock<Vec<Option<Host>>> = OnceLock::new();
        let found = FOUND
            .get_or_init(|| ROWS.iter().map(|row| ALL.into_iter().find(|host| host.is(row.op))).collect());
        found.get(op as usize).copied().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Host instructions are distinct: no two are equivalent, and each is an operation of the machine, so none is taken for another.
    #[test]
    fn operations_are_told_apart() {
        for host in ALL {
            let operations = ROWS.iter().filter(|row| host.is(row.op));
            assert_eq!(operations.count(), 1, "{host:?}");
        }
    }
}
