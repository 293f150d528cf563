// SPDX-License-Identifier: MIT OR Apache-2.0
//! The table of instructions.
//!
//! A row reads, from left to right: mnemonic; opcode; the [`Function`] that a unit must offer to execute it; the operand
//! [`Shape`]; the types of result and sources (`F` binary32, `I` 32-bit integer, `B` any 32 bits); the meaning; the manual's text;
//! and, where the assembler's equations have an operator or a function for it, how an equation writes it ([`Form`]).
//!
//! The meaning is either `= expression`, a value computed from the source operands `a`, `b`, `c` (the arithmetic `A` is
//! Berkeley SoftFloat as the reference, or the host's binary32, which the tests prove identical), or `do Effect`, an effect
//! on the machine beyond the destination. A row without a meaning does not compile.
//!
//! After a semicolon follows, for an operation on floats or one that moves any bits, its meaning in the real numbers ([`Real`]), and a
//! bound in ulps on the error of the result: [`ROUNDED`], [`EXACT`], or the kernel's measured bound. Operations on bits have no such
//! meaning: they name themselves ([`Bitwise`]), for abstract domains that can handle bits. The meaning of an integer sum does not
//! wrap, even though its value does.

use crate::fp::{self, Arithmetic, Bitwise, Flags, Real, Value};
use crate::shape::Shape;

macro_rules! functions {
    ($(#[doc = $text:literal] $name:ident,)*) => {
        /// The function that an instruction asks of its unit. A machine can execute an instruction if one of its slots hosts a
        /// unit with the function.
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord, serde::Serialize)]
        #[serde(rename_all = "lowercase")]
        pub enum Function {
            $(#[doc = $text] $name,)*
        }

        impl Function {
            /// Name of the function in the tables.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Function::$name => stringify!($name),)*
                }
            }
        }
    };
}

functions! {
    /// No function: every slot of every machine offers it.
    Idle,
    /// Sequencing: branches, calls, the period's end.
    Control,
    /// Loops that the sequencer counts.
    Loop,
    /// Reading the data memory.
    Load,
    /// Writing the data memory.
    Store,
    /// Integer, logic, comparison and selection, for which one carry chain is enough.
    Alu,
    /// Sum and difference of binary32 numbers.
    Add,
    /// Conversion between integer and binary32.
    Convert,
    /// Product of binary32 numbers, and of integers of 24 bits.
    Multiply,
    /// binary32 product and sum with one rounding.
    Fused,
    /// Quotient of binary32 numbers.
    Divide,
    /// Square root of a binary32 number.
    Root,
    /// Sine and cosine, in radians.
    Sine,
    /// Arctangent of a quotient.
    Arctangent,
    /// Arccosine, in radians, in [0, π].
    Arccosine,
}

/// The type of an operand, by which literals are converted to bits and bits are shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
pub enum Type {
    /// A binary32 number of IEEE 754.
    #[serde(rename = "float")]
    F,
    /// A 32-bit integer in two's complement.
    #[serde(rename = "integer")]
    I,
    /// Any pattern of 32 bits.
    #[serde(rename = "bits")]
    B,
}

impl Type {
    /// Name of the type in the language: `float`, `int`, `bits`.
    pub const fn name(self) -> &'static str {
        match self {
            Type::F => "float",
            Type::I => "int",
            Type::B => "bits",
        }
    }
}

/// The effect of an instruction beyond its arithmetic.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Effect {
    /// Writes `compute(a, b, c)` to the destination, and has no other effect.
    Compute,
    /// No effect at all.
    Nothing,
    /// Writes the immediate to the destination.
    Immediate,
    /// Writes the data word at `offset + a` to the destination.
    Load,
    /// Writes `b` to the data word at `offset + a`.
    Store,
    /// Continues at the target.
    Jump,
    /// Continues at the target if `a` is zero (all 32 bits).
    BranchZero,
    /// Continues at the target if `a` is not zero.
    BranchNonzero,
    /// Pushes the next bundle's address on the return stack and continues at the target.
    Call,
    /// Pops an address from the return stack and continues there.
    Return,
    /// Repeats the bundles from the next one to the bundle before the target, `a` times.
    Loop,
    /// Publishes the outputs: all earlier results are written; the period goes on at the next bundle.
    Publish,
    /// Ends the period: all earlier results are written; continues at the target on the next tick.
    Wait,
    /// Stops the machine for good.
    Halt,
    /// Writes the sticky exception flags of all earlier operations to the destination.
    ReadFlags,
    /// Clears the sticky exception flags, including flags of all earlier operations.
    ClearFlags,
}

impl Effect {
    /// Execution may continue elsewhere than at the next bundle, or the front end refills first (a short loop), or the outputs are
    /// published: the operation ends a basic block.
    pub const fn redirects(self) -> bool {
        matches!(
            self,
            Effect::Jump
                | Effect::BranchZero
                | Effect::BranchNonzero
                | Effect::Call
                | Effect::Return
                | Effect::Loop
                | Effect::Publish
                | Effect::Wait
                | Effect::Halt
        )
    }

    /// Execution may continue at the next bundle.
    pub const fn falls_through(self) -> bool {
        !self.redirects() || self.is_conditional() || matches!(self, Effect::Loop | Effect::Publish)
    }

    /// The redirection depends on an operand.
    pub const fn is_conditional(self) -> bool {
        matches!(self, Effect::BranchZero | Effect::BranchNonzero)
    }

    /// Issue waits until every earlier result is written (see `timing`).
    pub const fn drains(self) -> bool {
        matches!(self, Effect::Publish | Effect::Wait | Effect::Halt | Effect::ReadFlags | Effect::ClearFlags)
    }
}

/// A row of the table of instructions.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Variant of the instruction.
    pub op: Op,
    /// Name in the source.
    pub mnemonic: &'static str,
    /// Bits 47..41 of the word.
    pub opcode: u8,
    /// The function that the executing unit must offer.
    pub function: Function,
    /// Operands and their bit fields.
    pub shape: Shape,
    /// Type of the result, if any, then of the sources.
    pub types: &'static [Type],
    /// Effect beyond the arithmetic.
    pub effect: Effect,
    /// Meaning in symbols, one line.
    pub summary: &'static str,
    /// The manual's text: special cases, flags, error bound.
    pub text: &'static str,
    /// Bound in ulps on the difference of the result from the exact value, [`real`]; `None` without a meaning in the reals.
    pub ulp: Option<f64>,
    /// Forms in equations, with the letters of the sources: `a + b`. Several rows may share a form if their types differ.
    pub forms: &'static [&'static str],
}

/// The form of an instruction in equations.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Form {
    /// The operator or the function's name; `?:` for a choice, empty for a value alone.
    pub symbol: String,
    /// Sources of the instruction (0 = a, 1 = b, 2 = c), in the order in which they occur in the equation. Others are zero.
    pub sources: Vec<usize>,
}

impl Form {
    /// Parses a form: single letters are sources; everything else, except blanks, commas and parentheses, is the symbol.
    fn read(text: &str) -> Form {
        let mut form = Form { symbol: String::new(), sources: Vec::new() };
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let mut rest = text;
        while let Some(first) = rest.chars().next() {
            let length = match is_word(first) {
                true => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
                false => first.len_utf8(),
            };
            let (piece, after) = rest.split_at(length);
            match piece {
                "a" => form.sources.push(0),
                "b" => form.sources.push(1),
                "c" => form.sources.push(2),
                " " | "," | "(" | ")" => {}
                piece => form.symbol.push_str(piece),
            }
            rest = after;
        }
        form
    }
}

impl Row {
    /// Type of the destination; `B` without a destination.
    #[inline]
    pub fn result_type(&self) -> Type {
        if self.shape.has_dest() { self.types[0] } else { Type::B }
    }

    /// The type of source `index` (0 = a, 1 = b, 2 = c).
    #[inline]
    pub fn source_type(&self, index: usize) -> Type {
        let skip = usize::from(self.shape.has_dest());
        self.types.get(skip + index).copied().unwrap_or(Type::B)
    }

    /// Parsed forms in equations.
    pub fn forms(&self) -> impl Iterator<Item = Form> {
        self.forms.iter().map(|form| Form::read(form))
    }

    /// The instruction copies its source to its destination, bit for bit, and has no other effect. Tested by execution:
    /// patterns with one bit set, or one bit clear, must pass unchanged.
    pub fn copies(&self) -> bool {
        let of = |a| compute::<fp::Host>(self.op, a, 0, 0);
        self.effect == Effect::Compute
            && self.shape == Shape::Da
            && self.types == [Type::B, Type::B]
            && (0..32).flat_map(|bit| [1 << bit, !(1 << bit)]).all(|bits| of(bits) == Value::exact(bits))
    }
}

const fn flag(condition: bool) -> Value {
    Value { bits: condition as u32, flags: Flags::NONE }
}

const fn bits(bits: u32) -> Value {
    Value { bits, flags: Flags::NONE }
}

/// Mnemonic of a variant: without the `r#` that Rust demands before its keywords.
const fn name(variant: &'static str) -> &'static str {
    match variant.as_bytes() {
        [b'r', b'#', ..] => variant.split_at(2).1,
        _ => variant,
    }
}

/// The error of rounding to nearest, in ulps.
const ROUNDED: f64 = 0.5;
/// The error of an exact result.
const EXACT: f64 = 0.0;

macro_rules! effect {
    (= $e:expr $(; $real:expr $(, $ulp:expr)?)?) => {
        Effect::Compute
    };
    (do $effect:ident) => {
        Effect::$effect
    };
}

macro_rules! value {
    (= $e:expr $(; $real:expr $(, $ulp:expr)?)?) => {
        $e
    };
    (do $effect:ident) => {
        Value { bits: 0, flags: Flags::NONE }
    };
}

macro_rules! real {
    (= $e:expr; $real:expr $(, $ulp:expr)?) => {
        Some($real)
    };
    ($($other:tt)*) => {
        None
    };
}

macro_rules! ulp {
    (= $e:expr; $real:expr, $ulp:expr) => {
        Some($ulp)
    };
    ($($other:tt)*) => {
        None
    };
}

macro_rules! instructions {
    ([$a:ident $b:ident $c:ident]
     $($mnemonic:ident $opcode:literal $function:ident $shape:ident [$($ty:ident)*] { $($meaning:tt)* } $summary:literal $text:literal $($form:literal)*;)*) => {
        /// An instruction. Variants are named by their mnemonics.
        #[allow(non_camel_case_types)]
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
        #[repr(u8)]
        pub enum Op {
            $(#[doc = $summary] $mnemonic,)*
        }

        /// Rows of all instructions; `ROWS[op as usize]` is `op`'s row.
        pub const ROWS: &[Row] = &[
            $(Row {
                op: Op::$mnemonic,
                mnemonic: name(stringify!($mnemonic)),
                opcode: $opcode,
                function: Function::$function,
                shape: Shape::$shape,
                types: &[$(Type::$ty),*],
                effect: effect!($($meaning)*),
                summary: $summary,
                text: $text,
                ulp: ulp!($($meaning)*),
                forms: &[$($form),*],
            },)*
        ];

        /// The value that `op` computes from its sources, with arithmetic `A`. Sources that the instruction does not have are
        /// ignored. The value is zero if the effect of the instruction is not [`Effect::Compute`].
        #[inline(always)]
        #[allow(unused_variables)]
        pub fn compute<A: Arithmetic>(op: Op, $a: u32, $b: u32, $c: u32) -> Value {
            match op {
                $(Op::$mnemonic => value!($($meaning)*),)*
            }
        }

        /// The meaning of `op` in the real numbers, without rounding; for operations on bits, the result that the domain defines.
        /// `None` if the effect is not [`Effect::Compute`]. [`Row::ulp`] bounds the distance of the rounded result.
        #[allow(unused_variables)]
        pub fn real<R: Real>(op: Op, $a: R, $b: R, $c: R) -> Option<R> {
            match op {
                $(Op::$mnemonic => real!($($meaning)*),)*
            }
        }

        /// Applies [`compute`] to many operands, into `results`, with a loop for each instruction that the compiler vectorises if
        /// `A` has no branches ([`fp::ScreenedFloat`]). Returns whether any of the values has a flag set.
        #[inline(always)]
        #[allow(unused_variables)]
        pub fn compute_lanes<A: Arithmetic, const L: usize>(
            op: Op,
            sources: [&[u32; L]; 3],
            results: &mut [u32; L],
        ) -> bool {
            // A single word collects the flags of all lanes: with a word for each lane, the loops are not vectorised (a third of the
            // speed).
            let mut raised = 0;
            match op {
                $(Op::$mnemonic => {
                    for lane in 0..L {
                        let [$a, $b, $c] = [sources[0][lane], sources[1][lane], sources[2][lane]];
                        let value: Value = value!($($meaning)*);
                        results[lane] = value.bits;
                        raised |= u32::from(value.flags.bits());
                    }
                })*
            }
            raised != 0
        }
    };
}

#[rustfmt::skip]
instructions! { [a b c]
    // mnemonic opcode function shape types meaning summary text forms

    // ---- 0x0_ idle and sequencing. Opcode 0 stays illegal: execution that strays into unwritten memory must stop.
    nop      0x01 Idle     None  []        { do Nothing }       "no operation"                            "Fills a slot.";
    jmp      0x02 Control  T     []        { do Jump }          "continue at target"                      "";
    bz       0x03 Control  At    [B]       { do BranchZero }    "if a = 0, continue at target"            "Tests all 32 bits as an integer; a comparison's result is 0 or 1. (-0.0 is not zero here.)";
    bnz      0x04 Control  At    [B]       { do BranchNonzero } "if a ≠ 0, continue at target"            "Tests all 32 bits as an integer.";
    call     0x05 Control  T     []        { do Call }          "push return address, continue at target" "The return stack is hardware; its depth belongs to the machine. A full stack is a fault.";
    ret      0x06 Control  None  []        { do Return }        "pop return address, continue there"      "An empty stack is a fault.";
    wait     0x07 Control  T     []        { do Wait }          "end of period; at the tick, continue at target" "Issues when every earlier result is written, so that all outputs of the period are written. If the next tick has come already, the deadline was missed: the event is recorded and execution continues at once.";
    halt     0x08 Control  None  []        { do Halt }          "stop"                                    "Issues when every earlier result is written. Only a reset restarts the machine.";
    r#loop   0x09 Loop     At    [I]       { do Loop }          "repeat the bundles up to target a times"  "From the next bundle to the one before target, at no cost of time per iteration. The count is 1 to 65,535: any other is a fault. Loops nest as deep as the machine's row says. The last bundle of a body holds no operation that redirects, and no loop around it ends within the body: otherwise a fault.";
    publish  0x0a Control  None  []        { do Publish }       "publish the outputs; the period goes on" "Issues when every earlier result is written, so that the outputs that the host sees, and those that a board takes, are complete. What follows in the period costs them no time. As an operation that redirects, it cannot be in the last bundle of a loop.";

    // ---- 0x1_ data memory: words of 32 bits, addressed by word.
    ld       0x10 Load     Load  [B I]     { do Load }          "d = memory[offset + a]"                  "The address is the sum of the 16-bit unsigned offset and the signed integer a. An address outside the data memory is a fault.";
    st       0x11 Store    Store [I B]     { do Store }         "memory[offset + a] = b"                  "In order with every other load and store.";

    // ---- 0x2_ 32-bit integers and logic.
    mov      0x20 Alu      Da    [B B]     { = bits(a); a, EXACT }        "d = a"                                   "" "a";
    li       0x21 Alu      Dimm  [B]       { do Immediate }     "d = immediate"                           "32 bits; in the source an integer, a float or a label.";
    iadd     0x22 Alu      Dab   [I I I]   { = bits(a.wrapping_add(b)); a.integer() + b.integer(), EXACT }                         "d = a + b"  "Modulo 2^32." "a + b";
    isub     0x23 Alu      Dab   [I I I]   { = bits(a.wrapping_sub(b)); a.integer() - b.integer(), EXACT }                         "d = a - b"  "Modulo 2^32." "a - b" "-b";
    iand     0x24 Alu      Dab   [B B B]   { = bits(a & b); a.bitwise(Bitwise::And, b) }                                     "d = a ∧ b"  "Bit by bit." "a & b";
    ior      0x25 Alu      Dab   [B B B]   { = bits(a | b); a.bitwise(Bitwise::Or, b) }                                     "d = a ∨ b"  "Bit by bit." "a | b";
    ixor     0x26 Alu      Dab   [B B B]   { = bits(a ^ b); a.bitwise(Bitwise::Xor, b) }                                     "d = a ⊕ b"  "Bit by bit." "xor(a, b)";
    ishl     0x27 Alu      Dab   [B B I]   { = bits(a << (b & 31)); a.bitwise(Bitwise::Left, b) }                             "d = a << b" "By the low five bits of b." "a << b";
    ishr     0x28 Alu      Dab   [B B I]   { = bits(a >> (b & 31)); a.bitwise(Bitwise::Right, b) }                             "d = a >> b, zeros shifted in" "By the low five bits of b.";
    isar     0x29 Alu      Dab   [I I I]   { = bits(((a as i32) >> (b & 31)) as u32); a.bitwise(Bitwise::RightSigned, b) }           "d = a >> b, sign shifted in"  "By the low five bits of b." "a >> b";
    ieq      0x2a Alu      Dab   [I I I]   { = flag(a == b); a.bitwise(Bitwise::Equal, b) }                                    "d = (a = b)" "1 or 0." "a == b" "!a";
    ilt      0x2b Alu      Dab   [I I I]   { = flag((a as i32) < (b as i32)); a.bitwise(Bitwise::Less, b) }                   "d = (a < b), signed"   "1 or 0." "a < b" "b > a";
    iltu     0x2c Alu      Dab   [I I I]   { = flag(a < b); a.bitwise(Bitwise::LessUnsigned, b) }                                     "d = (a < b), unsigned" "1 or 0.";

    // ---- 0x3_ selection and the status register.
    sel      0x30 Alu      Dabc  [B B B B] { = bits(if a != 0 { b } else { c }); a.choose(b, c), EXACT }                "d = a ≠ 0 ? b : c" "Tests all 32 bits of a as an integer." "a ? b : c";
    rdflags  0x31 Alu      D     [I]       { do ReadFlags }     "d = sticky exception flags"              "Invalid 16, divide by zero 8, overflow 4 (SoftFloat's positions). Issues when every earlier result is written, so that no flag of an earlier operation is missed.";
    clrflags 0x32 Alu      None  []        { do ClearFlags }    "clear the sticky exception flags"        "Issues when every earlier result is written.";

    // ---- 0x4_ binary32 without rounding.
    fabs     0x40 Alu      Da    [F F]     { = fp::abs(a); a.abs(), EXACT }                                      "d = |a|"     "Clears the sign bit, of a NaN too. No flags." "abs(a)";
    fneg     0x41 Alu      Da    [F F]     { = fp::neg(a); -a, EXACT }                                      "d = -a"      "Flips the sign bit, of a NaN too. No flags." "-a";
    fsign    0x42 Alu      Da    [F F]     { = fp::sign(a); a.sign(), EXACT }                                     "d = sign(a)" "-1.0, +0.0 or 1.0; zero of either sign gives +0.0; NaN gives NaN. Invalid on a signaling NaN." "sign(a)";
    fmin     0x43 Alu      Dab   [F F F]   { = fp::minimum(a, b); a.minimum(b), EXACT }                               "d = min(a, b)" "IEEE 754-2019 minimum: a NaN operand gives NaN, so that it is not hidden from the controller; -0.0 < +0.0. Invalid on a signaling NaN." "min(a, b)";
    fmax     0x44 Alu      Dab   [F F F]   { = fp::maximum(a, b); a.maximum(b), EXACT }                               "d = max(a, b)" "IEEE 754-2019 maximum, as fmin." "max(a, b)";
    fsat     0x45 Alu      Dab   [F F F]   { = fp::saturate(a, b); a.saturate(b), EXACT }                              "d = a, kept within ±|b|" "a itself where |a| ≤ |b|, else |b| with the sign of a. A NaN operand gives NaN. Invalid on a signaling NaN." "sat(a, b)";
    feq      0x46 Alu      Dab   [I F F]   { = A::eq(a, b); a.equal(b), EXACT }                                     "d = (a = b)" "1 or 0; 0 if either is NaN. Invalid on a signaling NaN." "a == b";
    flt      0x47 Alu      Dab   [I F F]   { = A::lt(a, b); a.less(b), EXACT }                                     "d = (a < b)" "1 or 0; 0 if either is NaN. Invalid on any NaN." "a < b" "b > a";
    fle      0x48 Alu      Dab   [I F F]   { = A::le(a, b); a.less_or_equal(b), EXACT }                                     "d = (a ≤ b)" "1 or 0; 0 if either is NaN. Invalid on any NaN." "a <= b" "b >= a";

    // ---- 0x5_ binary32 addition and conversion, rounded to nearest even.
    fadd     0x50 Add      Dab   [F F F]   { = A::add(a, b); a + b, ROUNDED }                                    "d = a + b"   "Invalid on ∞ - ∞ and on a signaling NaN; overflow." "a + b";
    fsub     0x51 Add      Dab   [F F F]   { = A::sub(a, b); a - b, ROUNDED }                                    "d = a - b"   "As fadd." "a - b";
    itof     0x52 Convert  Da    [F I]     { = A::itof(a); a.integer(), ROUNDED }                                      "d = float(a)" "From a signed integer, rounded to nearest even. No flags." "itof(a)";
    ftoi     0x53 Convert  Da    [I F]     { = A::ftoi(a); a.nearest(), EXACT }                                      "d = integer(a)" "Rounded to nearest even, saturating at -2^31 and 2^31 - 1; NaN gives 2^31 - 1. Invalid where the value does not fit." "ftoi(a)";

    // ---- 0x6_ binary32 multiplication, division, root, and product and sum in one, rounded to nearest even; the multiplier's product
    // of integers.
    fmul     0x60 Multiply Dab   [F F F]   { = A::mul(a, b); a * b, ROUNDED }                                    "d = a · b"   "Invalid on 0 · ∞ and on a signaling NaN; overflow." "a * b";
    fdiv     0x61 Divide   Dab   [F F F]   { = A::div(a, b); a / b, ROUNDED }                                    "d = a / b"   "Invalid on 0/0, ∞/∞ and a signaling NaN; divide by zero on finite/0; overflow." "a / b";
    fsqrt    0x62 Root     Da    [F F]     { = A::sqrt(a); a.sqrt(), ROUNDED }                                      "d = √a"      "√-0.0 = -0.0. Invalid on a negative operand and on a signaling NaN." "sqrt(a)";
    imul24   0x63 Multiply Dab   [I I I]   { = bits(((a << 8) as i32 >> 8).wrapping_mul((b << 8) as i32 >> 8) as u32); a.bitwise(Bitwise::Product24, b) } "d = a · b, of 24 bits" "Of the low 24 bits of both, read as signed integers: the low 32 bits of the product. No flags. Three of them, two shifts and two sums make a product modulo 2^32." "mul24(a, b)";
    fma      0x64 Fused    Dabc  [F F F F] { = A::mul_add(a, b, c); a * b + c, ROUNDED }                             "d = a · b + c"    "Rounded once, as fms, fnma and fnms are: the product is exact. The letter n negates the product, s subtracts c (as in x86's names; RISC-V's fnmsub is fnma, its fnmadd fnms). Invalid on 0 · ∞ whatever c is, on ∞ - ∞ and on a signaling NaN; overflow." "fma(a, b, c)";
    fms      0x65 Fused    Dabc  [F F F F] { = A::mul_add(a, b, fp::neg(c).bits); a * b - c, ROUNDED }               "d = a · b - c"    "As fma with -c." "fms(a, b, c)";
    fnma     0x66 Fused    Dabc  [F F F F] { = A::mul_add(fp::neg(a).bits, b, c); c - a * b, ROUNDED }               "d = -(a · b) + c" "As fma with -a. What cancels exactly gives +0." "fnma(a, b, c)";
    fnms     0x67 Fused    Dabc  [F F F F] { = A::mul_add(fp::neg(a).bits, b, fp::neg(c).bits); -(a * b) - c, ROUNDED } "d = -(a · b) - c" "As fma with -a and -c." "fnms(a, b, c)";

    // ---- 0x7_ trigonometric functions, in radians.
    fsin     0x70 Sine       Da  [F F]   { = fp::sin(a); a.sin(), fp::SIN_MAX_ULP }                                      "d = sin(a)"  "At most 0.79499 ulp for |a| ≤ 2π·64 (0x43c90fda), measured over every such operand. Beyond, on ∞ and on a NaN: NaN and invalid." "sin(a)";
    fcos     0x71 Sine       Da  [F F]   { = fp::cos(a); a.cos(), fp::COS_MAX_ULP }                                      "d = cos(a)"  "At most 0.78306 ulp for |a| ≤ 2π·64 (0x43c90fda), measured over every such operand. Beyond, on ∞ and on a NaN: NaN and invalid." "cos(a)";
    fatan2   0x72 Arctangent Dab [F F F] { = fp::atan2(a, b); a.atan2(b), fp::ATAN2_MAX_ULP }                                 "d = angle of the point (b, a)" "The arctangent of a/b in [-π, π], in the quadrant that the signs of both give. Less than 0.75 ulp: over 10⁹ random pairs of all kinds, at most 0.6444. The signs of zeros count: (+0, -0) gives π, (-0, -1) gives -π; infinities lie on the axes and diagonals (IEEE 754-2019, 9.2.1). NaN and invalid on a NaN." "atan2(a, b)";
    facos    0x73 Arccosine  Da  [F F]   { = fp::acos(a); a.acos(), fp::ACOS_MAX_ULP }                                     "d = arccosine of a" "In [0, π]. At most 0.73241 ulp, measured over every operand in [-1, 1]. Beyond, and on a NaN: NaN and invalid." "acos(a)";
}

impl Op {
    /// Row of the instruction in [`ROWS`].
    #[inline(always)]
    pub fn row(self) -> &'static Row {
        &ROWS[self as usize]
    }

    /// The instruction with this opcode.
    #[inline]
    pub fn from_opcode(opcode: u8) -> Option<Op> {
        OPCODES.get(opcode as usize).copied().flatten()
    }

    /// The instruction with a mnemonic.
    pub fn from_mnemonic(mnemonic: &str) -> Option<Op> {
        ROWS.iter().find(|row| row.mnemonic == mnemonic).map(|row| row.op)
    }
}

/// Decoding table from opcodes to instructions. At compile time, its construction rejects duplicate opcodes and opcodes of more
/// than seven bits.
static OPCODES: [Option<Op>; 128] = {
    let mut table = [None; 128];
    let mut i = 0;
    while i < ROWS.len() {
        let Row { opcode, op, .. } = ROWS[i];
        assert!(opcode != 0 && opcode < 128, "an opcode is 1..=127");
        assert!(table[opcode as usize].is_none(), "two instructions share an opcode");
        table[opcode as usize] = Some(op);
        i += 1;
    }
    table
};
