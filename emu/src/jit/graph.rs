//! A block as a graph of values, with what must be looked at for its code to be trusted.
//!
//! The code does what the block's micros do as long as nothing is out of the ordinary: no infinity and no NaN where
//! arithmetic or a comparison could meet one, no flag raised. Few values need looking at for that. What is infinite or a NaN
//! makes a sum, a difference, a product or a root so too, and of a chain of these only the last result is looked at.

use super::host::Host;
use crate::machine::{WORDS, Word};
use crate::micro::{Kind, Micro};
use takt_isa::{Op, Register};

/// A value's place in [`Graph::nodes`], after those of its operands.
pub(super) type Id = usize;

/// A value, or what a block does to memory.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Node {
    /// The value of a register at the block's entry.
    Entry(Word),
    Constant(u32),
    /// The flags, as the block finds them.
    Flags,
    /// One of the host's instructions.
    Host(Host, [Id; 3]),
    /// The result of [`takt_isa::compute`].
    Call(Op, [Id; 3]),
    /// `memory[offset + base]`, and the number of the late result that it is.
    Load {
        base: Id,
        offset: u32,
        late: Option<usize>,
    },
    /// `memory[offset + base] = value`
    Store {
        base: Id,
        offset: u32,
        value: Id,
    },
    /// Goes to a watched port.
    Watched(Id),
}

impl Node {
    /// True if its value, bit by bit, is a binary32 that is neither infinite nor a NaN; `None` if that shows only in the run.
    fn finite(self) -> Option<bool> {
        match self {
            Node::Constant(bits) => Some(f32::from_bits(bits).is_finite()),
            Node::Flags => Some(true),
            Node::Host(host, _) if host.is_number() => Some(true),
            _ => None,
        }
    }
}

/// A block's values.
pub(super) struct Graph {
    pub(super) nodes: Vec<Node>,
    /// Registers, and words of late results, that the block writes, with their last values.
    pub(super) results: Vec<(Word, Id)>,
    /// The flags at the block's end; `None` if they are those that it found.
    pub(super) flags: Option<Id>,
    /// Numbers of the checks whose port is watched, in the order of [`Node::Watched`].
    pub(super) watches: Vec<u32>,
    /// For each node, whether it must be neither infinite nor a NaN.
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
        // Nobody looks at what is left in scratch words.
        written.retain(|word| word.index() < Register::COUNT || word.late_number().is_some());
        graph.results = written.into_iter().filter_map(|word| Some((word, words[word.index()]?))).collect();
        graph
    }

    fn push(&mut self, node: Node) -> Id {
        self.nodes.push(node);
        self.must.push(false);
        self.nodes.len() - 1
    }

    /// True if it reads or changes the flags.
    pub(super) fn uses_flags(&self) -> bool {
        self.flags.is_some() || self.nodes.contains(&Node::Flags)
    }

    /// The words that get each value as soon as it is there, and those that get it only at the end: those that the block also reads. (If it
    /// has to be run again it reads them again, and writes all others before it reads them.)
    pub(super) fn places(&self) -> (Vec<Vec<Word>>, Vec<(Word, Id)>) {
        let mut early = vec![Vec::new(); self.nodes.len()];
        let mut last = Vec::new();
        for &(word, id) in &self.results {
            let is_read = self.nodes.contains(&Node::Entry(word));
            if self.nodes[id] == Node::Entry(word) {
                // It is there.
            } else if is_read {
                last.push((word, id));
            } else {
                early[id].push(word);
            }
        }
        (early, last)
    }

    /// For each value whether it is to be looked at; `None` if one of them is never in order.
    pub(super) fn looked_at(&self) -> Option<Vec<bool>> {
        let mut looked_at = vec![false; self.nodes.len()];
        // Values that show in another's: those follow.
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
