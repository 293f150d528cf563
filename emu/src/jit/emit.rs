// SPDX-License-Identifier: MIT OR Apache-2.0
//! Emitter of a block's machine code, scalar for one run, or SIMD for a vector of runs.
//!
//! The words of a single run are contiguous. In a batch, each word is a row with the word of every lane; SIMD code handles four lanes as
//! scalar code handles one word. Booleans are bytes, or masks of a vector's lanes.

use cranelift::codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift::codegen::ir::{ConstantData, Type};
use cranelift::prelude::{FunctionBuilder, Ieee32, InstBuilder, MemFlagsData, Value, types};

/// Number of lanes in one SIMD vector: four words of 32 bits.
pub(super) const VECTOR: usize = 4;

/// Target of code: scalar or SIMD.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Width {
    /// Scalar code for one run.
    One,
    /// SIMD code for a vector of runs, in rows of `row` words.
    Vector { row: usize },
}

impl Width {
    /// Distance between successive words of a run, in words.
    pub(super) fn stride(self) -> usize {
        match self {
            Width::One => 1,
            Width::Vector { row } => row,
        }
    }

    /// Number of runs that one call of the code executes.
    pub(super) fn lanes(self) -> usize {
        match self {
            Width::One => 1,
            Width::Vector { .. } => VECTOR,
        }
    }
}

/// A function under construction.
pub(super) struct Emit<'f> {
    pub(super) builder: FunctionBuilder<'f>,
    pub(super) width: Width,
}

impl Emit<'_> {
    fn is_vector(&self) -> bool {
        self.width != Width::One
    }

    fn float_type(&self) -> Type {
        if self.is_vector() { types::F32X4 } else { types::F32 }
    }

    fn integer_type(&self) -> Type {
        if self.is_vector() { types::I32X4 } else { types::I32 }
    }

    /// Offset in bytes of a word from a run's first word.
    fn offset(&self, word: usize) -> i32 {
        (4 * word * self.width.stride()) as i32
    }

    /// Flags of memory accesses. Vectors are aligned to words only, not to their full width.
    fn flags(&self) -> MemFlagsData {
        if self.is_vector() { MemFlagsData::new().with_notrap() } else { MemFlagsData::trusted() }
    }

    pub(super) fn load_float(&mut self, words: Value, word: usize) -> Value {
        let (ty, flags, offset) = (self.float_type(), self.flags(), self.offset(word));
        self.builder.ins().load(ty, flags, words, offset)
    }

    pub(super) fn load(&mut self, words: Value, word: usize) -> Value {
        let (ty, flags, offset) = (self.integer_type(), self.flags(), self.offset(word));
        self.builder.ins().load(ty, flags, words, offset)
    }

    pub(super) fn store(&mut self, value: Value, words: Value, word: usize) {
        let (flags, offset) = (self.flags(), self.offset(word));
        self.builder.ins().store(flags, value, words, offset);
    }

    /// Address of word `number`, which is the same in all lanes.
    pub(super) fn address(&mut self, words: Value, number: Value) -> Value {
        let wide = self.builder.ins().uextend(types::I64, number);
        let size = i64::from(self.offset(1));
        let size = self.builder.ins().iconst(types::I64, size);
        let bytes = self.builder.ins().imul(wide, size);
        self.builder.ins().iadd(words, bytes)
    }

    /// Broadcasts a word to all lanes.
    pub(super) fn every(&mut self, word: Value) -> Value {
        if self.is_vector() { self.builder.ins().splat(types::I32X4, word) } else { word }
    }

    pub(super) fn constant(&mut self, bits: u32) -> Value {
        if self.is_vector() {
            return self.vector(types::I32X4, bits);
        }
        self.builder.ins().iconst(types::I32, i64::from(bits))
    }

    pub(super) fn float_constant(&mut self, value: f32) -> Value {
        if self.is_vector() {
            return self.vector(types::F32X4, value.to_bits());
        }
        self.builder.ins().f32const(Ieee32::with_float(value))
    }

    fn vector(&mut self, ty: Type, bits: u32) -> Value {
        let data: ConstantData = [bits; VECTOR].iter().flat_map(|bits| bits.to_le_bytes()).collect();
        let constant = self.builder.func.dfg.constants.insert(data);
        self.builder.ins().vconst(ty, constant)
    }

    pub(super) fn as_float(&mut self, value: Value) -> Value {
        let ty = self.float_type();
        self.builder.ins().bitcast(ty, MemFlagsData::new(), value)
    }

    pub(super) fn as_integer(&mut self, value: Value) -> Value {
        let ty = self.integer_type();
        self.builder.ins().bitcast(ty, MemFlagsData::new(), value)
    }

    // ---- Booleans.

    /// Converts a Boolean to 1 or 0, in each lane.
    pub(super) fn truth_as_integer(&mut self, truth: Value) -> Value {
        if self.is_vector() {
            let one = self.constant(1);
            return self.builder.ins().band(truth, one);
        }
        self.builder.ins().uextend(types::I32, truth)
    }

    pub(super) fn is_not_zero(&mut self, value: Value) -> Value {
        let zero = self.constant(0);
        self.builder.ins().icmp(IntCC::NotEqual, value, zero)
    }

    pub(super) fn choose(&mut self, truth: Value, yes: Value, no: Value) -> Value {
        if self.is_vector() {
            return self.builder.ins().bitselect(truth, yes, no);
        }
        self.builder.ins().select(truth, yes, no)
    }

    pub(super) fn choose_float(&mut self, truth: Value, yes: Value, no: Value) -> Value {
        let truth = if self.is_vector() { self.as_float(truth) } else { truth };
        self.choose(truth, yes, no)
    }

    /// Reduces a Boolean over all lanes to a byte: nonzero if it is true in any lane.
    pub(super) fn any(&mut self, truth: Value) -> Value {
        if self.is_vector() { self.builder.ins().vany_true(truth) } else { truth }
    }

    // ---- Numbers.

    /// Magnitude of one value with the sign of another.
    pub(super) fn with_sign(&mut self, magnitude: Value, sign: Value) -> Value {
        if !self.is_vector() {
            return self.builder.ins().fcopysign(magnitude, sign);
        }
        let (magnitude, sign) = (self.as_integer(magnitude), self.as_integer(sign));
        let top = self.constant(1 << 31);
        let sign = self.builder.ins().band(sign, top);
        let magnitude = self.builder.ins().band_not(magnitude, top);
        let bits = self.builder.ins().bor(magnitude, sign);
        self.as_float(bits)
    }

    pub(super) fn signed_as_float(&mut self, value: Value) -> Value {
        let ty = self.float_type();
        self.builder.ins().fcvt_from_sint(ty, value)
    }

    /// Nearest integer, ties to even, and a Boolean that marks results out of range.
    pub(super) fn nearest(&mut self, value: Value) -> (Value, Value) {
        let magnitude = self.builder.ins().fabs(value);
        let limit = self.float_constant(2_147_483_648.0);
        let wrong = self.builder.ins().fcmp(FloatCC::UnorderedOrGreaterThanOrEqual, magnitude, limit);
        if self.is_vector() {
            let rounded = self.builder.ins().nearest(value);
            return (self.builder.ins().fcvt_to_sint_sat(types::I32X4, rounded), wrong);
        }
        // Method of `takt_isa::fp::Host`: a sum that is rounded at the units' place has the integer in its low word.
        let wide = self.builder.ins().fpromote(types::F64, value);
        let units = self.builder.ins().f64const(6_755_399_441_055_744.0);
        let rounded = self.builder.ins().fadd(wide, units);
        let bits = self.builder.ins().bitcast(types::I64, MemFlagsData::new(), rounded);
        (self.builder.ins().ireduce(types::I32, bits), wrong)
    }

    // ---- Lanes.

    /// Extracts the word of the first lane.
    pub(super) fn first(&mut self, value: Value) -> Value {
        if self.is_vector() { self.builder.ins().extractlane(value, 0) } else { value }
    }
}
