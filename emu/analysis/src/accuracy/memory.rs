// SPDX-License-Identifier: MIT OR Apache-2.0
//! Data memory of the abstract states: words by address, one value for all words that an unknown index may read.

use super::enclose::{Explorer, State};
use super::interval::Interval;
use super::node::Node;
use super::number::{INTEGERS, Problem};
use super::states::Place;
use super::value::Value;
use crate::error::{BoundError, Refusal};
use std::collections::BTreeSet;
use std::rc::Rc;
use takt_isa::program::Space;
use takt_isa::{BundleAddress, Instruction, Program, Register};

/// Limit on the words of data memory that a load or store with an unknown address may touch.
const MAX_WORDS: usize = 4096;

impl Explorer<'_> {
    /// Value of a data word that this section has not written. In `.once` the loader's; in a period, that of the array's `.range`.
    pub(super) fn initial_word(&mut self, word: u32) -> Rc<Node> {
        let loaded = self.constant(self.program.data.get(word as usize).copied().unwrap_or(0));
        if self.once {
            return Node::leaf(loaded);
        }
        if let Some(known) = self.ranged_words.get(&word) {
            return Rc::clone(known);
        }
        let program = self.program;
        if let Some(range) = program.array_ranges.iter().find(|range| range.span().contains(&word)) {
            let node = Node::leaf(self.ranged(Place::Word(word), range.ty, range.ends()));
            self.ranged_words.insert(word, Rc::clone(&node));
            return node;
        }
        if self.stored.contains(&word) {
            return Node::leaf(Value::Unknown);
        }
        self.initial_words.insert(word);
        Node::leaf(loaded)
    }

    /// Value of a data word.
    pub(super) fn word_of(&mut self, state: &State, word: u32) -> Rc<Node> {
        state.memory.get(&word).cloned().unwrap_or_else(|| self.initial_word(word))
    }

    /// Result of a load: of several words, their join.
    pub(super) fn load(
        &mut self,
        state: &State,
        words: Vec<u32>,
        address: BundleAddress,
    ) -> Result<Rc<Node>, BoundError> {
        let mut loaded: Option<Rc<Node>> = None;
        for word in words {
            let node = self.word_of(state, word);
            if node.value == Value::Unknown {
                let array = self.program.data_array(word).unwrap_or("ARRAY").to_owned();
                let word = self.program.data_text(word);
                return Err(self.error(address, Refusal::NoRangeOfWord { word, array }));
            }
            loaded = Some(loaded.map_or_else(|| Rc::clone(&node), |known| known.join(&node)));
        }
        Ok(loaded.unwrap_or_else(|| Node::leaf(Value::Broken)))
    }

    /// Stores a value into one of several words: into a single word certainly.
    pub(super) fn store(&mut self, state: &mut State, words: Vec<u32>, value: &Rc<Node>) {
        let is_certain = words.len() == 1;
        for word in words {
            self.changed_words.insert(word);
            let node = if is_certain { Rc::clone(value) } else { self.word_of(state, word).join(value) };
            state.memory.insert(word, node);
        }
    }

    /// Data words that a load or store may touch. Lists the operation if they are not all of one array, the same in every iteration.
    pub(super) fn addresses(
        &mut self,
        word: u32,
        instruction: &Instruction,
        base: &Value,
        (address, calls): (BundleAddress, &[BundleAddress]),
    ) -> Result<Vec<u32>, BoundError> {
        let depth = self.program.machine.data_depth;
        // Addresses are counted modulo 2³²: an array's constant may lie below zero.
        let offset = f64::from(instruction.constant.cast_signed());
        let index = base.whole().actual;
        let range = index + Interval::point(offset);
        let words: Vec<u32> = match base {
            Value::Patterns(patterns) => {
                patterns.iter().map(|base| instruction.constant.wrapping_add(*base)).collect()
            }
            _ if range.high < 0.0 && range.low > INTEGERS.low => Vec::new(),
            _ if range.low > INTEGERS.low => {
                let within = range.low.max(0.0) as u32..=range.high.min(f64::from(depth)) as u32;
                within.take(MAX_WORDS + 1).collect()
            }
            _ => (0..depth).collect(),
        };
        let is_outside = match base {
            Value::Patterns(_) => words.iter().any(|word| *word >= depth),
            _ => range.low < 0.0 || range.high >= f64::from(depth),
        };
        // An address beyond the memory is a fault, which ends the run.
        let words: Vec<u32> = words.into_iter().filter(|word| *word < depth).collect();
        if *base != Value::Broken && (is_outside || !self.is_one_array((word, calls), instruction, &words)) {
            let operand = (instruction.reads()[0], Some(index));
            self.found.hazards.entry((word, Problem::Address)).or_insert_with(|| vec![operand]);
        }
        if words.len() > MAX_WORDS {
            let what = "data words that one operation may touch";
            return Err(self.error(address, Refusal::Limit { limit: MAX_WORDS as u64, what }));
        }
        Ok(words)
    }

    /// All words lie in the array that the access, in a subroutine of these calls, has touched so far. Behind the declared data lies no array,
    /// except for values that the assembler keeps in memory, by their constant address.
    fn is_one_array(
        &mut self,
        access: (u32, &[BundleAddress]),
        instruction: &Instruction,
        words: &[u32],
    ) -> bool {
        let declared = self.program.data.len() as u32;
        let of = |word: u32| self.arrays.range(..=word).next_back().copied();
        let Some((first, last)) = words.iter().min().zip(words.iter().max()) else { return true };
        let array = of(*first);
        let known = *self.found.touched.entry((access.0, access.1.to_vec())).or_insert(array);
        let is_declared = *last < declared || instruction.reads()[0] == Register::ZERO;
        array == of(*last) && array == known && is_declared
    }
}

/// First words of arrays, by their labels, and the end of the declared data.
pub(super) fn array_starts(program: &Program) -> BTreeSet<u32> {
    let labels = program.symbols.iter().filter(|symbol| symbol.space == Space::Data);
    labels.map(|label| label.address).chain([program.data.len() as u32]).collect()
}
