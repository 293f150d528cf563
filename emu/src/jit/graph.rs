// SPDX-License-Identifier: MIT OR Apache-2.0
//! Data-flow graph of a block, with the checks under which its compiled code is valid.
//!
//! The code is equivalent to the block's micros in the ordinary case: arithmetic and comparisons meet no infinity and no NaN, and no flag
//! is raised. Few values need a check for that: since sum, difference, product and root propagate infinities and NaNs, only the last result
//! of a chain of these is checked.

use super::host::Host;
use crate::machine::{WORDS, Word};
use crate::micro::{Kind, Micro};
use takt_isa::{Op, Register};

/// Index of a value in [`Graph::nodes`], greater than the indices of its operands.
pub(super) type Id = usize;

/// Value, or access to memory.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Node {
    /// Value of a register at the block's entry.
    Entry(Word),
    Constant(u32),
    /// Flags at the block's entry.
    Flags,
    /// Result of one of the host's instructions.
    Host(Host, [Id; 3]),
    /// Result of [`takt_isa::compute`] for operations without a host instruction.
    Call(Op, [Id; 3]),
    /// Load of `memory[offset + base]`, with the number of its late result, if it is one.
    Load {
        base: Id,
        offset: u32,
        late: Option<usize>,
    },
    /// Store: `memory[offset + base] = value`
    Store {
        base: Id,
        offset: u32,
        value: Id,
    },
    /// Value written to a watched port.
    Watched(Id),
}

impl Node {
    /// Classifies the bits as a finite binary32: true or false, or `None` if that is known only at run time.
    fn finite(self) -> Option<bool> {
        match self {
            Node::Constant(bits) => Some(f32::from_bits(bits).is_finite()),
            Node::Flags => Some(true),
            Node::Host(host, _) if host.is_number() => Some(true),
            _ => None,
        }
    }
}

/// Values of a block in topological order, with its results.
pub(super) struct Graph {
    pub(super) nodes: Vec<Node>,
    /// Registers and late-result words that the block writes, each with its final value.
    pub(super) results: Vec<(Word, Id)>,
    /// Flags at the block's end; `None` if the block does not change them.
    pub(super) flags: Option<Id>,
    /// Numbers of the checks whose port is watched, in the order of [`Node::Watched`].
    pub(super) watches: Vec<u32>,
    /// Marks the nodes that must be finite.
    must: Vec<bool>,
}

impl Graph {
    pub(super) fn new(micros: &[Micro]) -> Graph {
        let mut graph = Graph {
            nodes: vec![Node::Constant(0)],
            results: Vec::new(),
            flags: None,
            watches: Vec::new(),
            must: vec![false],
        };
        let mut words: Vec<Option<Id>> = vec![None; WORDS];
        let mut written = Vec::new();
        words[Word::from(Register::ZERO).index()] = Some(0);
        for micro in micros {
            let [a, b, c] = [micro.a, micro.b, micro.c].map(|word| match words[word.index()] {
                Some(id) => id,
                None => {
                    let id = graph.push(Node::Entry(word));
                    words[word.index()] = Some(id);
                    id
                }
            });
            let late = micro.dest.late_number();
            let value = match micro.kind {
                Kind::Compute => match Host::of(micro.op) {
                    Some(Host::Copy) => a,
                    Some(host) => {
                        for (source, _) in [a, b, c].into_iter().zip(host.compares()).filter(|&(_, it)| it) {
                            graph.must[source] = true;
                        }
                        let id = graph.push(Node::Host(host, [a, b, c]));
                        graph.must[id] = host.is_arithmetic();
                        id
                    }
                    None => graph.push(Node::Call(micro.op, [a, b, c])),
                },
                Kind::Immediate => graph.push(Node::Constant(micro.constant)),
                Kind::Move => a,
                Kind::Load => graph.push(Node::Load { base: a, offset: micro.constant, late }),
                Kind::Store => {
                    graph.push(Node::Store { base: a, offset: micro.constant, value: b });
                    continue;
                }
                Kind::ReadFlags => match graph.flags {
                    Some(id) => id,
                    None => graph.push(Node::Flags),
                },
                Kind::ClearFlags => {
                    graph.flags = Some(0);
                    continue;
                }
                Kind::Check => {
                    graph.must[a] = true;
                    continue;
                }
                Kind::Watch => {
                    graph.push(Node::Watched(a));
                    graph.watches.push(micro.constant);
                    continue;
                }
            };
            words[micro.dest.index()] = Some(value);
            written.push(micro.dest);
        }
        written.sort_unstable_by_key(|word| word.index());
        written.dedup();
        // Values left in scratch words are dead.
        written.retain(|word| word.index() < Register::COUNT || word.late_number().is_some());
        graph.results = written.into_iter().filter_map(|word| Some((word, words[word.index()]?))).collect();
        graph
    }

    fn push(&mut self, node: Node) -> Id {
        self.nodes.push(node);
        self.must.push(false);
        self.nodes.len() - 1
    }

    /// The block reads or changes the flags.
    pub(super) fn uses_flags(&self) -> bool {
        self.flags.is_some() || self.nodes.contains(&Node::Flags)
    }

    /// Words by the time of their store. First, for each value, the words written as soon as it is computed; then the words that the block
    /// also reads, which are written only at the end. (If the interpreter must run the block again, it reads the latter again, and writes
    /// the former before it reads them.)
    pub(super) fn places(&self) -> (Vec<Vec<Word>>, Vec<(Word, Id)>) {
        let mut early = vec![Vec::new(); self.nodes.len()];
        let mut last = Vec::new();
        for &(word, id) in &self.results {
            let is_read = self.nodes.contains(&Node::Entry(word));
            if self.nodes[id] == Node::Entry(word) {
                // The word keeps its value: no store.
            } else if is_read {
                last.push((word, id));
            } else {
                early[id].push(word);
            }
        }
        (early, last)
    }

    /// Marks the values that must be checked; `None` if a check always fails.
    pub(super) fn looked_at(&self) -> Option<Vec<bool>> {
        let mut looked_at = vec![false; self.nodes.len()];
        // A checked later value that propagates an infinity or NaN makes a check superfluous.
        let mut shows = vec![false; self.nodes.len()];
        for (id, &node) in self.nodes.iter().enumerate().rev() {
            looked_at[id] = self.must[id] && !shows[id];
            if looked_at[id] {
                match node.finite() {
                    Some(true) => looked_at[id] = false,
                    Some(false) => return None,
                    None => {}
                }
            }
            if let Node::Host(host, sources) = node
                && (shows[id] || looked_at[id])
            {
                let passed = sources.into_iter().zip(host.passes_on()).filter(|&(_, passes)| passes);
                passed.for_each(|(source, _)| shows[source] = true);
            }
        }
        Some(looked_at)
    }
}
