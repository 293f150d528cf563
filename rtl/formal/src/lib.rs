// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bit-parallel simulation of a unit's netlist for every operand, compared with the specification: 512 operands in one pass over the gates.
//!
//! `prove.py` makes an and-inverter graph of a unit with one operand. Sign and exponent divide the operands into 512 cases. In each case
//! they are constants, which leave few gates where the result is the operand, a constant or NaN.

use std::array::from_fn;
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::fp::Reference;
use takt_isa::{Op, compute};
use thiserror::Error;

/// Operands in each pass.
const LANES: usize = 512;
/// Values of a literal in all lanes, 64 per element.
type Word = [u64; LANES / 64];
/// Bits of an operand that number the lanes, and all bits of its fraction.
const LANE_BITS: usize = LANES.ilog2() as usize;
const FRACTION_BITS: usize = 23;
/// Width of the result, and of the flags.
const RESULT_BITS: usize = 32;
const FLAG_BITS: usize = 3;

/// Number of cases: combinations of sign and exponent.
pub const CASES: u32 = 512;

/// Error of a text that is no graph of a function of one operand.
#[derive(Debug, Error, PartialEq, Eq)]
#[error("no and-inverter graph of a function of one operand: {0}")]
pub struct GraphError(String);

/// And-inverter graph without registers: a function of one operand. A literal is AIGER's: twice the variable, plus one if negated; 0 is
/// false.
#[derive(Debug)]
pub struct Graph {
    /// Literals of the operand, the lowest bit first.
    operand: Vec<u32>,
    /// Literals of the result, then of the flags.
    outputs: Vec<u32>,
    /// Output, left and right operand of each gate, in topological order.
    gates: Vec<[u32; 3]>,
}

impl Graph {
    /// Parses AIGER's ASCII form, with inputs a\[0\] to a\[31\], outputs result\[0\] to result\[31\] and flags\[0\] to flags\[2\].
    ///
    /// # Errors
    /// If the text has another form.
    pub fn parse(text: &str) -> Result<Graph, GraphError> {
        let error = |what: &str| GraphError(what.to_owned());
        let mut lines = text.lines();
        let header: Vec<&str> = lines.next().unwrap_or_default().split(' ').collect();
        let counts: Vec<usize> = header.iter().skip(1).filter_map(|count| count.parse().ok()).collect();
        let (Some(&"aag"), [_, inputs, 0, outputs, gates]) = (header.first(), &counts[..]) else {
            return Err(error("its first line is not `aag` and five numbers, the third 0"));
        };
        let mut rows = |count: usize| -> Result<Vec<Vec<u32>>, GraphError> {
            let row = |line: &str| line.split(' ').map(str::parse).collect::<Result<Vec<u32>, _>>();
            let rows = lines.by_ref().take(count).map(row).collect::<Result<Vec<_>, _>>();
            rows.ok().filter(|rows| rows.len() == count).ok_or_else(|| error("a line of numbers is missing"))
        };
        let [inputs, outputs, gates] = [rows(*inputs)?, rows(*outputs)?, rows(*gates)?];
        let mut named = BTreeMap::new();
        for line in lines {
            let Some((symbol, name)) = line.split_once(' ') else { continue };
            let (kind, at) = symbol.split_at_checked(1).unwrap_or_default();
            let list = if kind == "i" { &inputs } else { &outputs };
            if let Some(row) = at.parse().ok().and_then(|at: usize| list.get(at)) {
                named.insert(name, row[0]);
            }
        }
        let word = |name: &str, bits: usize| -> Result<Vec<u32>, GraphError> {
            let bit = |i| {
                let bit = format!("{name}[{i}]");
                named.get(&*bit).copied().ok_or_else(|| GraphError(format!("there is no {bit}")))
            };
            (0..bits).map(bit).collect()
        };
        let operand = word("a", RESULT_BITS)?;
        if operand.len() != inputs.len() {
            return Err(error("it has inputs beside the operand"));
        }
        let outputs = [word("result", RESULT_BITS)?, word("flags", FLAG_BITS)?].concat();
        let mut known: BTreeSet<u32> = operand.iter().copied().chain([0]).collect();
        let mut ordered = Vec::new();
        for row in gates {
            let Ok([out, left, right]) = <[u32; 3]>::try_from(row) else {
                return Err(error("a gate is not three literals"));
            };
            if !known.contains(&(left & !1)) || !known.contains(&(right & !1)) {
                return Err(error("a gate comes before one that it uses"));
            }
            known.insert(out);
            ordered.push([out, left, right]);
        }
        if !outputs.iter().all(|literal| known.contains(&(literal & !1))) {
            return Err(error("an output is none of its gates"));
        }
        Ok(Graph { operand, outputs, gates: ordered })
    }

    /// Finds the first operand of a case, below [`CASES`], whose result or flags differ from the specification's.
    #[must_use]
    pub fn differs(&self, case: u32, op: Op) -> Option<u32> {
        self.of_case(case).differs(case, op)
    }

    /// Gates that remain with a case's sign and exponent as constants.
    fn of_case(&self, case: u32) -> Program {
        // Literal that replaces each variable.
        let mut value: BTreeMap<u32, u32> = BTreeMap::from([(0, 0)]);
        for (i, &literal) in self.operand.iter().enumerate() {
            let constant = (i >= FRACTION_BITS).then(|| case >> (i - FRACTION_BITS) & 1);
            value.insert(literal, constant.unwrap_or(literal));
        }
        let of = |value: &BTreeMap<u32, u32>, literal: u32| value[&(literal & !1)] ^ literal & 1;
        let mut gates = Vec::new();
        for &[out, left, right] in &self.gates {
            let (left, right) = (of(&value, left), of(&value, right));
            let is = match (left.min(right), left.max(right)) {
                (0, _) => 0,
                (1, other) => other,
                (left, right) if left == right => left,
                (left, right) if left == right ^ 1 => 0,
                (left, right) => {
                    gates.push([out, left, right]);
                    out
                }
            };
            value.insert(out, is);
        }
        let outputs: Vec<u32> = self.outputs.iter().map(|&literal| of(&value, literal)).collect();
        Program::new(&self.operand[..FRACTION_BITS], &outputs, &gates)
    }
}

/// Gates in order of evaluation, on words that are reused.
struct Program {
    /// Word of the output; words of the operands, each times two, plus one if negated.
    steps: Vec<[u32; 3]>,
    /// Word of each bit of the fraction, if a gate needs it.
    fraction: Vec<Option<u32>>,
    outputs: Vec<u32>,
    words: usize,
}

impl Program {
    fn new(fraction: &[u32], outputs: &[u32], gates: &[[u32; 3]]) -> Program {
        // Last use of each variable: the first one met when iterating backwards.
        let mut last: BTreeMap<u32, usize> = BTreeMap::new();
        outputs.iter().for_each(|literal| _ = last.insert(literal & !1, usize::MAX));
        let mut kept = Vec::new();
        for (at, &gate) in gates.iter().enumerate().rev() {
            if last.contains_key(&gate[0]) {
                kept.push((at, gate));
                gate[1..].iter().for_each(|literal| _ = last.entry(literal & !1).or_insert(at));
            }
        }
        // Word 0 is false.
        let mut words = 1;
        let mut free = Vec::new();
        let mut place: BTreeMap<u32, u32> = BTreeMap::from([(0, 0)]);
        let given = |words: &mut u32, free: &mut Vec<u32>| {
            free.pop().unwrap_or_else(|| {
                *words += 1;
                *words - 1
            })
        };
        let fraction = fraction
            .iter()
            .map(|literal| {
                let used = last.insert(*literal, usize::MAX).is_some();
                used.then(|| *place.entry(*literal).or_insert_with(|| given(&mut words, &mut free)))
            })
            .collect();
        let mut steps = Vec::new();
        for (at, [out, left, right]) in kept.into_iter().rev() {
            let [left, right] =
                [left, right].map(|literal| (literal & !1, place[&(literal & !1)] << 1 | literal & 1));
            for (variable, word) in [left, right] {
                if last.get(&variable) == Some(&at) && variable != 0 {
                    free.push(word >> 1);
                    last.remove(&variable);
                }
            }
            let word = given(&mut words, &mut free);
            place.insert(out, word);
            steps.push([word, left.1, right.1]);
        }
        let outputs = outputs.iter().map(|literal| place[&(literal & !1)] << 1 | literal & 1).collect();
        Program { steps, fraction, outputs, words: words as usize }
    }

    /// Finds the first operand of a case whose result or flags differ from the specification's.
    fn differs(&self, case: u32, op: Op) -> Option<u32> {
        let mut words = vec![[0; LANES / 64]; self.words];
        for (bit, word) in self.fraction[..LANE_BITS].iter().enumerate() {
            let lanes = |block: usize| {
                (0..64).fold(0, |word, lane| word | (((block * 64 + lane) >> bit & 1) as u64) << lane)
            };
            if let Some(word) = word {
                words[*word as usize] = from_fn(lanes);
            }
        }
        for first in (0..1_u32 << FRACTION_BITS).step_by(LANES) {
            for (bit, word) in self.fraction.iter().enumerate().skip(LANE_BITS) {
                if let Some(word) = word {
                    words[*word as usize] = [0_u64.wrapping_sub(u64::from(first >> bit & 1)); LANES / 64];
                }
            }
            for &[out, left, right] in &self.steps {
                let (a, b) = (words[left as usize >> 1], words[right as usize >> 1]);
                let [left, right] = [left, right].map(|literal| 0_u64.wrapping_sub(u64::from(literal & 1)));
                words[out as usize] = from_fn(|i| (a[i] ^ left) & (b[i] ^ right));
            }
            let first = case << FRACTION_BITS | first;
            let differs = self.differing_operand(&words, first, op);
            if differs.is_some() {
                return differs;
            }
        }
        None
    }

    fn differing_operand(&self, words: &[Word], first: u32, op: Op) -> Option<u32> {
        for (block, first) in (first..).step_by(64).enumerate().take(LANES / 64) {
            let mut expected: [u64; 64] = from_fn(|lane| {
                let value = compute::<Reference>(op, first + lane as u32, 0, 0);
                u64::from(value.bits) | u64::from(value.flags.bits() >> 2) << RESULT_BITS
            });
            transpose(&mut expected);
            let differ = self.outputs.iter().zip(expected).fold(0, |differ, (literal, expected)| {
                let found = words[*literal as usize >> 1][block] ^ 0_u64.wrapping_sub(u64::from(literal & 1));
                differ | (found ^ expected)
            });
            if differ != 0 {
                return Some(first + differ.trailing_zeros());
            }
        }
        None
    }
}

/// Transposes 64 words of 64 bits: bit i of word j becomes bit j of word i.
fn transpose(words: &mut [u64; 64]) {
    let (mut width, mut mask) = (32, 0x0000_0000_ffff_ffff_u64);
    while width != 0 {
        let mut at = 0;
        while at < 64 {
            let swapped = (words[at] >> width ^ words[at + width]) & mask;
            words[at] ^= swapped << width;
            words[at + width] ^= swapped;
            at = (at + width + 1) & !width;
        }
        width /= 2;
        mask ^= mask << width;
    }
}

#[cfg(test)]
mod tests {
    use super::{FLAG_BITS, Graph, RESULT_BITS, transpose};
    use takt_isa::Op;

    /// Graph of a function that returns its operand with some bits replaced: (bit, two literals whose conjunction it becomes).
    fn graph(changed: &[(usize, [u32; 2])]) -> String {
        let operand = |bit: usize| 2 * (bit as u32 + 1);
        let mut outputs: Vec<u32> = (0..RESULT_BITS).map(operand).collect();
        let mut gates = Vec::new();
        for (i, &(bit, [left, right])) in changed.iter().enumerate() {
            outputs[bit] = operand(RESULT_BITS + i);
            gates.push(format!("{} {left} {right}", outputs[bit]));
        }
        outputs.extend([0; FLAG_BITS]);
        let mut text = format!("aag 99 {RESULT_BITS} 0 {} {}\n", outputs.len(), gates.len());
        let mut line = |line: String| text += &(line + "\n");
        (0..RESULT_BITS).for_each(|bit| line(operand(bit).to_string()));
        outputs.iter().for_each(|literal| line(literal.to_string()));
        gates.into_iter().for_each(&mut line);
        (0..RESULT_BITS).for_each(|bit| line(format!("i{bit} a[{bit}]")));
        (0..RESULT_BITS).for_each(|bit| line(format!("o{bit} result[{bit}]")));
        (0..FLAG_BITS).for_each(|bit| line(format!("o{} flags[{bit}]", RESULT_BITS + bit)));
        text
    }

    #[test]
    fn finds_differing_operands() {
        // The magnitude: the operand without its sign.
        let magnitude = Graph::parse(&graph(&[(31, [0, 1])])).expect("a graph");
        for case in [0, 127, 255, 256, 383, 511] {
            assert_eq!(magnitude.differs(case, Op::fabs), None);
        }
        assert_eq!(magnitude.differs(0x17f, Op::fneg), None);
        assert_eq!(magnitude.differs(0x07f, Op::fneg), Some(0x3f80_0000));
        // Bit 13 lost where bits 13 and 2 are set, literals 28 and 6: the gate is 1 if bit 13 is set and bit 2 is not.
        let wrong = Graph::parse(&graph(&[(31, [0, 1]), (13, [28, 7])])).expect("a graph");
        assert_eq!(wrong.differs(0x07f, Op::fabs), Some(0x3f80_2004));
        assert_eq!(wrong.differs(0x17f, Op::fabs), Some(0xbf80_2004));
    }

    #[test]
    fn other_texts_are_refused() {
        let told = |text: &str| Graph::parse(text).expect_err("no graph").to_string();
        for (text, what) in [
            (String::new(), "first line"),
            ("aag 1 1 1 1 1\n".to_owned(), "first line"),
            (graph(&[]).replace("aag 99 32", "aag 99 31"), "there is no a[31]"),
            (graph(&[(3, [90, 4])]), "before one that it uses"),
            ("aag 1 1 0 0 0\nx\n".to_owned(), "missing"),
        ] {
            assert!(told(&text).contains(what), "{}", told(&text));
        }
    }

    #[test]
    fn transposing_twice_changes_nothing() {
        let mut words: [u64; 64] =
            std::array::from_fn(|i| 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(i as u64 + 1));
        let before = words;
        transpose(&mut words);
        for (i, word) in before.iter().enumerate() {
            assert!((0..64).all(|j| words[j] >> i & 1 == word >> j & 1));
        }
    }
}
