// SPDX-License-Identifier: MIT OR Apache-2.0
//! The table of units: the circuits that a slot can host.
//!
//! **Latency** is the distance in cycles from the issue of an operation to the earliest issue of an operation that uses its
//! result, forwarding included: an operation issued in cycle `c` has its result on the slot's result bus in cycle `c +
//! latency`. **Interval** is the distance between two issues to the same unit. **Cuts** names the contents of each pipeline
//! register after the operand register; a fully pipelined unit has `latency - 1` of them.

use super::instructions::Function;

/// A row of the table of units.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
pub struct Unit {
    /// Name of the unit, also in Verilog.
    pub name: &'static str,
    /// Functions that the unit executes.
    pub functions: &'static [Function],
    /// Cycles from issue to the earliest issue of a dependent operation; 0 for a unit that writes no register.
    pub latency: u32,
    /// Cycles between two issues to this unit.
    pub interval: u32,
    /// Contents of the pipeline registers, in the order of the data.
    pub cuts: &'static [&'static str],
    /// Name of the Verilog module.
    pub rtl: &'static str,
    /// Description in the manual.
    pub text: &'static str,
}

/// Upper limit of latencies, exclusive: the write-port bookings of a bank fit a 64-cycle window.
pub const MAX_LATENCY: u32 = 64;

macro_rules! units {
    ($($constant:ident $name:ident [$($function:ident)*] $latency:literal / $interval:literal [$($cut:literal)*] $text:literal;)*) => {
        $(#[doc = $text] pub const $constant: Unit = Unit {
            name: stringify!($name),
            functions: &[$(Function::$function),*],
            latency: $latency,
            interval: $interval,
            cuts: &[$($cut),*],
            rtl: concat!("takt_", stringify!($name)),
            text: $text,
        };)*

        /// Every unit of the table.
        pub const UNITS: &[Unit] = &[$($constant),*];
    };
}

#[rustfmt::skip]
units! {
    // constant name functions latency/interval cuts text
    SEQUENCER sequencer [Control Loop] 0/1 [] "Branches, calls, loops, the period's end; writes no register.";
    ALU       alu       [Alu]         2/1  ["result"] "Integer, logic, comparison, selection, minimum, maximum, saturation.";
    ALU_LATE  alu_late  [Alu]         8/1  ["result" "result" "result" "result" "result" "result" "result"] "The ALU with its result as late as addmul's, so that one write port serves both without conflict.";
    MEMORY    memory    [Load Store]  4/1  ["address" "memory output" "output register"] "The data memory: a load or a store a cycle. A second slot may have a port for loads alone.";
    ADD       add       [Add]         5/1  ["swapped operands" "aligned operands" "sum, leading zeros" "normalised, rounded"] "binary32 adder.";
    CONVERT   convert   [Convert]     5/1  ["operand" "magnitude, leading zeros" "shifted" "rounded"] "Integer to binary32 and back.";
    MULTIPLY  multiply  [Multiply]    5/1  ["partial products" "product, shift count" "normalised" "rounded"] "binary32 multiplier: three 18x18 products, and 6x6 bits in logic.";
    ADDMUL    addmul    [Add Multiply Convert] 8/1 ["swapped operands, partial products" "product, distance" "shifted right" "sum" "shifted left by bytes" "normalised" "rounded"] "binary32 sum, product and conversion in one pipeline: they share alignment, normalisation and rounding; small.";
    FUSED     fused     [Fused Multiply Add] 6/1 ["partial products" "product, aligned addend" "sum" "leading zeros, shifted by nibbles" "normalised, rounded"] "binary32 product and sum with one rounding; a product, or a sum, alone has the bits of the units that compute only that. A machine's row says which functions it executes there.";
    DIVROOT   divroot   [Divide Root] 11/1 ["classified" "normalised" "table's words" "reciprocal" "first digit" "first product" "first residual" "second digit" "second product" "rounded"] "Division and square root, very high radix: a reciprocal table, two quotient digits of 14 and 10 bits, rounding by the sign of the last residual.";
    RECURRENCE recurrence [Divide Root] 21/15 [] "Division and square root by one digit recurrence, two bits a cycle; no multiplier.";
    SINE      sine      [Sine]        14/1 ["aligned" "multiple" "table" "multiple of π/2" "remainder" "segment" "coefficients" "slope's product" "polynomial" "product" "sums" "difference" "rounded"] "Sine and cosine: the distance from the nearest multiple of π/2, which comes from a table, and a piecewise quadratic; three 18x18 products.";
    ARCTANGENT arctangent [Arctangent] 24/16 [] "Digit-by-digit division whose divisor grows with the digits found; a table of arctangents; no multiplier.";
    ARCCOSINE arccosine [Arccosine]   30/16 [] "Digit-by-digit square root; each digit adds its multiple of a function from a table; no multiplier.";
}
