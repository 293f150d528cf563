// SPDX-License-Identifier: MIT OR Apache-2.0
//! Data memory as terms: a region for each array, and one for the words outside all of them.

use crate::term::{Node, Term, Terms};
use std::collections::BTreeMap;

/// The regions of a data memory.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    /// The arrays, by ascending first word: first word, words, number.
    arrays: Vec<(u32, u32, usize)>,
    /// The words of the memory.
    pub(crate) depth: u32,
    data: Vec<u32>,
}

impl Map {
    pub(crate) fn new(arrays: &[(String, u32, u32)], depth: u32, data: &[u32]) -> Map {
        let numbered = arrays.iter().enumerate();
        let mut arrays: Vec<_> = numbered.map(|(number, (_, base, words))| (*base, *words, number)).collect();
        arrays.sort_unstable();
        Map { arrays, depth, data: data.to_vec() }
    }

    pub(crate) fn regions(&self) -> usize {
        self.arrays.len() + 1
    }

    /// The region of a word.
    fn of(&self, address: u32) -> usize {
        let before = self.arrays.partition_point(|(base, ..)| *base <= address);
        let around = before.checked_sub(1).map(|at| self.arrays[at]);
        around.filter(|(base, words, _)| address - base < *words).map_or(self.arrays.len(), |found| found.2)
    }

    /// The region of an address: known from its number, or from what the source says about it; else any.
    pub(crate) fn region(&self, terms: &Terms, address: Term, said: Option<usize>) -> Option<usize> {
        terms.known(address).map(|address| self.of(address)).or(said)
    }
}

/// The words of a region.
#[derive(Clone, Debug)]
struct Region {
    /// Its contents before the words below were stored.
    base: Term,
    /// The unknown part of the addresses of `words`.
    unknown: Term,
    /// Words stored, by the known part of the address.
    words: BTreeMap<u32, Term>,
}

impl Region {
    fn holding(base: Term) -> Region {
        Region { base, unknown: Terms::ZERO, words: BTreeMap::new() }
    }

    /// The region as one term.
    fn flat(&self, terms: &mut Terms) -> Term {
        let mut flat = self.base;
        for (&offset, &value) in &self.words {
            let address = terms.offset(self.unknown, offset);
            flat = terms.make(Node::Store(flat, address, value));
        }
        flat
    }
}

/// A data memory.
#[derive(Clone, Debug)]
pub(crate) struct Memory(Vec<Region>);

impl Memory {
    /// The memory whose regions hold these terms.
    pub(crate) fn holding(regions: impl IntoIterator<Item = Term>) -> Memory {
        Memory(regions.into_iter().map(Region::holding).collect())
    }

    /// Its regions, each as one term.
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
        match (terms.node(base), terms.known(address)) {
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
