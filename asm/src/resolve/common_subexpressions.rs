//! What is computed already: of equal parts of equations one is computed.
//!
//! Two parts are equal if they are the same instruction of the same sources, and no source was written between them. What is
//! known ends where control may come from elsewhere or leave (labels, branches, heads of loops, the section's end), and at
//! operations that read or clear the flags. An input port that is not latched may change between two lines: what reads one is
//! shared within its equation only.

use crate::ir::RegisterId;
use foldhash::HashMap;
use takt_isa::Op;

/// A part: an instruction and its sources, each with how often it was written; and the equation, if it matters.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Key {
    op: Op,
    sources: [(RegisterId, u32); 3],
    equation: u32,
}

/// Where a part's value is, and how often that register had been written then; and the bundle that computes it.
#[derive(Clone, Copy, Debug)]
struct Known {
    register: RegisterId,
    writes: u32,
    bundle: u32,
}

#[derive(Default)]
pub(crate) struct CommonSubexpressions {
    known: HashMap<Key, Known>,
    /// How often each register was written, by index.
    writes: Vec<u32>,
    equation: u32,
    /// Stretches of bundles that control must not enter: from behind what computes a part to where another equation uses it.
    pub(crate) stretches: Vec<(u32, u32)>,
}

impl CommonSubexpressions {
    /// What is known ends.
    pub(crate) fn cut(&mut self) {
        self.known.clear();
    }

    /// The next equation begins.
    pub(crate) fn next(&mut self) {
        self.equation += 1;
    }

    /// A register is written.
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

    /// A part, and whether it is one of its equation only.
    pub(crate) fn key(&self, op: Op, sources: [RegisterId; 3], own: bool) -> Key {
        let sources = sources.map(|register| (register, self.writes(register)));
        Key { op, sources, equation: if own { self.equation } else { 0 } }
    }

    /// The register that has a part's value, and the bundle that computed it.
    pub(crate) fn find(&self, key: &Key) -> Option<(RegisterId, u32)> {
        let known = self.known.get(key)?;
        (self.writes(known.register) == known.writes).then_some((known.register, known.bundle))
    }

    /// A part's value is in a register, which was just written.
    pub(crate) fn insert(&mut self, key: Key, register: RegisterId, bundle: u32) {
        let writes = self.writes(register);
        self.known.insert(key, Known { register, writes, bundle });
    }

    /// A part's value is nowhere that lasts.
    pub(crate) fn remove(&mut self, key: &Key) {
        self.known.remove(key);
    }
}
