// SPDX-License-Identifier: MIT OR Apache-2.0
//! Common-subexpression elimination in equations, by local value numbering (Cooper, Torczon, Engineering a Compiler, §8.4.1).
//!
//! Two subexpressions are equal if they are the same instruction of the same sources, and no source was written between them.
//! Knowledge ends at the end of a basic block (labels, branches, heads of loops, the section's end), and at operations that read
//! or clear the flags. An input port that is not latched may change between two lines: a subexpression that reads one is shared
//! within its equation only.

use crate::ir::RegisterId;
use crate::ir::arrays::ArrayId;
use foldhash::HashMap;
use takt_isa::Op;

/// Key of a subexpression: an instruction and its sources, each with its version; and the equation, if it matters.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Key {
    op: Op,
    sources: [(RegisterId, u32); 3],
    equation: u32,
    /// Loads only: the offset, the array, and the array's version.
    word: Option<(u32, ArrayId, u32)>,
}

/// An available subexpression: its register, the register's version, and the bundle that computes it.
#[derive(Clone, Copy, Debug)]
struct AvailableExpression {
    register: RegisterId,
    writes: u32,
    bundle: u32,
}

#[derive(Default)]
pub(crate) struct CommonSubexpressions {
    known: HashMap<Key, AvailableExpression>,
    /// Version of each register, by index: the number of its writes.
    writes: Vec<u32>,
    /// Version of each array, by index: the number of stores to it; then the number of stores to unknown words.
    stores: Vec<u32>,
    stores_anywhere: u32,
    equation: u32,
    /// Ranges of bundles that control must not enter: from after the computation of a subexpression to its use in another
    /// equation.
    pub(crate) stretches: Vec<(u32, u32)>,
}

impl CommonSubexpressions {
    /// Ends a basic block.
    pub(crate) fn cut(&mut self) {
        self.known.clear();
    }

    /// Begins the next equation.
    pub(crate) fn next(&mut self) {
        self.equation += 1;
    }

    /// Records a write of a register.
    pub(crate) fn write(&mut self, register: RegisterId) {
        let index = register.index();
        if index >= self.writes.len() {
            self.writes.resize(index + 1, 0);
        }
        self.writes[index] += 1;
    }

    fn writes(&self, register: RegisterId) -> u32 {
        self.writes.get(register.index()).copied().unwrap_or(0)
    }

    /// The key of a subexpression; with `own`, it is valid in its equation only.
    pub(crate) fn key(&self, op: Op, sources: [RegisterId; 3], own: bool) -> Key {
        let sources = sources.map(|register| (register, self.writes(register)));
        Key { op, sources, equation: if own { self.equation } else { 0 }, word: None }
    }

    /// The key of an array's element, given the load and its base.
    pub(crate) fn element(&self, op: Op, base: RegisterId, offset: u32, array: ArrayId) -> Key {
        let key = self.key(op, [base, RegisterId::ZERO, RegisterId::ZERO], false);
        let stores = self.stores.get(array.0 as usize).copied().unwrap_or(0);
        Key { word: Some((offset, array, stores + self.stores_anywhere)), ..key }
    }

    /// Records a store to an array, or to an unknown word.
    pub(crate) fn store(&mut self, array: Option<ArrayId>) {
        let Some(ArrayId(array)) = array else {
            self.stores_anywhere += 1;
            return;
        };
        let index = array as usize;
        if index >= self.stores.len() {
            self.stores.resize(index + 1, 0);
        }
        self.stores[index] += 1;
    }

    /// The register that holds a subexpression, and the bundle that computed it.
    pub(crate) fn find(&self, key: &Key) -> Option<(RegisterId, u32)> {
        let known = self.known.get(key)?;
        (self.writes(known.register) == known.writes).then_some((known.register, known.bundle))
    }

    /// Records that a register, just written, holds a subexpression.
    pub(crate) fn insert(&mut self, key: Key, register: RegisterId, bundle: u32) {
        let writes = self.writes(register);
        self.known.insert(key, AvailableExpression { register, writes, bundle });
    }

    /// Forgets a subexpression whose register is overwritten or unstable.
    pub(crate) fn remove(&mut self, key: &Key) {
        self.known.remove(key);
    }
}
