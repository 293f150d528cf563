// SPDX-License-Identifier: MIT OR Apache-2.0
//! Data memory as terms: a region for each array, and one for all words outside of arrays.

use crate::term::{Node, Term, Terms};
use std::collections::{BTreeMap, HashSet};
use takt_asm::plain::{PlainKind, PlainOperation, PlainProgram};
use takt_isa::Effect;

/// Partition of the data memory into regions.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    /// Arrays in ascending order: first word, length, number.
    arrays: Vec<(u32, u32, usize)>,
    /// Words of the memory.
    pub(crate) depth: u32,
    data: Vec<u32>,
    /// Words that the source accesses outside of arrays; `None` if they are unknown.
    touched: Option<HashSet<u32>>,
}

impl Map {
    pub(crate) fn new(plain: &PlainProgram) -> Map {
        let numbered = plain.arrays.iter().enumerate();
        let mut arrays: Vec<_> = numbered.map(|(number, (_, base, words))| (*base, *words, number)).collect();
        arrays.sort_unstable();
        Map { arrays, depth: plain.machine.data_depth, data: plain.data.clone(), touched: touched(plain) }
    }

    /// Neither an access of the source nor a host's access by name can reach the word, so that the assembler may spill there.
    pub(crate) fn is_free(&self, word: u32) -> bool {
        let is_touched = |touched: &HashSet<u32>| touched.contains(&word);
        word < self.depth
            && word as usize >= self.data.len()
            && self.of(word) == self.arrays.len()
            && !self.touched.as_ref().is_none_or(is_touched)
    }

    pub(crate) fn regions(&self) -> usize {
        self.arrays.len() + 1
    }

    /// Region of a word.
    fn of(&self, address: u32) -> usize {
        let before = self.arrays.partition_point(|(base, ..)| *base <= address);
        let around = before.checked_sub(1).map(|at| self.arrays[at]);
        around.filter(|(base, words, _)| address - base < *words).map_or(self.arrays.len(), |found| found.2)
    }

    /// The address may be a word of an array: it is unknown, or one.
    pub(crate) fn is_within(&self, terms: &Terms, address: Term, array: usize) -> bool {
        terms.constant_value(address).is_none_or(|word| self.of(word) == array)
    }

    /// Region of an address: from its value, or from the array that the source names; `None` if unknown.
    pub(crate) fn region(&self, terms: &Terms, address: Term, said: Option<usize>) -> Option<usize> {
        terms.constant_value(address).map(|address| self.of(address)).or(said)
    }
}

/// Words that the source accesses outside of arrays; `None` if an address depends on a register that is written.
fn touched(plain: &PlainProgram) -> Option<HashSet<u32>> {
    let operations = || plain.bundles.iter().flat_map(|bundle| &bundle.operations);
    let written: HashSet<u32> = operations().filter_map(|operation| operation.dest).collect();
    let accesses = operations().filter(|operation| {
        operation.array.is_none() && matches!(operation.op.row().effect, Effect::Load | Effect::Store)
    });
    let word = |operation: &PlainOperation| {
        let base = operation.sources[0];
        let register =
            plain.registers.get(base as usize).filter(|register| register.kind == PlainKind::Plain)?;
        let bits = register.preset.filter(|_| !written.contains(&base))?;
        Some(bits.wrapping_add(operation.constant))
    };
    accesses.map(word).collect()
}

/// Contents of a region.
#[derive(Clone, Debug)]
struct Region {
    /// Contents before the stores in `words`.
    base: Term,
    /// Symbolic part of the addresses of `words`.
    unknown: Term,
    /// Stored words, by the constant part of the address.
    words: BTreeMap<u32, Term>,
}

impl Region {
    fn holding(base: Term) -> Region {
        Region { base, unknown: Terms::ZERO, words: BTreeMap::new() }
    }

    /// The contents as one term.
    fn flat(&self, terms: &mut Terms) -> Term {
        let mut flat = self.base;
        for (&offset, &value) in &self.words {
            let address = terms.offset(self.unknown, offset);
            flat = terms.make(Node::Store(flat, address, value));
        }
        flat
    }
}

/// Contents of a data memory, by region.
#[derive(Clone, Debug)]
pub(crate) struct Memory(Vec<Region>);

impl Memory {
    /// A memory whose regions hold these terms.
    pub(crate) fn holding(regions: impl IntoIterator<Item = Term>) -> Memory {
        Memory(regions.into_iter().map(Region::holding).collect())
    }

    /// Contents of each region, as one term each.
    pub(crate) fn flat(&self, terms: &mut Terms) -> Vec<Term> {
        self.0.iter().map(|region| region.flat(terms)).collect()
    }

    pub(crate) fn load(&self, terms: &mut Terms, map: &Map, region: Option<usize>, address: Term) -> Term {
        let Some(number) = region else {
            let all = self.flat(terms);
            let all = terms.list(all);
            return terms.make(Node::Load(all, address));
        };
        let region = &self.0[number];
        let (unknown, offset) = terms.linear(address);
        let base = match region.words.get(&offset) {
            Some(&value) if unknown == region.unknown => return value,
            _ if unknown == region.unknown || region.words.is_empty() => region.base,
            _ => region.flat(terms),
        };
        match (terms.node(base), terms.constant_value(address)) {
            (Node::Loaded(_), Some(word)) => {
                terms.constant(map.data.get(word as usize).copied().unwrap_or(0))
            }
            _ => terms.make(Node::Load(base, address)),
        }
    }

    pub(crate) fn store(&mut self, terms: &mut Terms, region: Option<usize>, address: Term, value: Term) {
        let Some(number) = region else {
            let all = self.flat(terms);
            let all = terms.list(all);
            let stored = terms.make(Node::Store(all, address, value));
            for (number, region) in (0..).zip(&mut self.0) {
                *region = Region::holding(terms.make(Node::StoredAnywhere(number, stored)));
            }
            return;
        };
        let (unknown, offset) = terms.linear(address);
        let region = &mut self.0[number];
        if unknown != region.unknown {
            if !region.words.is_empty() {
                *region = Region::holding(region.flat(terms));
            }
            region.unknown = unknown;
        }
        region.words.insert(offset, value);
    }
}
