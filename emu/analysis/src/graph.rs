// SPDX-License-Identifier: MIT OR Apache-2.0
//! Control flow of a program, bundle by bundle.

use crate::error::{BoundError, Refusal};
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::program::{IllegalWord, LoopBound};
use takt_isa::timing::Bundle;
use takt_isa::{BundleAddress, Flow, Instruction, Program, Register, SlotIndex};

/// Bundle with its timing and its flow.
pub(crate) struct Node {
    pub(crate) instructions: Vec<Instruction>,
    pub(crate) timing: Bundle,
    pub(crate) flow: Flow,
    /// Head of the loop whose last bundle this is, if any.
    pub(crate) closes: Option<BundleAddress>,
    /// Outcome of the branch, if the tested register holds a constant: true if always taken, false if never.
    pub(crate) taken: Option<bool>,
}

/// Control-flow edge between two bundles of a subroutine. A call's edge leads to the bundle after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Edge {
    pub(crate) to: BundleAddress,
    /// Back edge: a jump or taken branch to the same or an earlier address, counted by a loop's bound.
    pub(crate) back: bool,
}

/// Loop with a bound.
#[derive(Debug)]
pub(crate) struct Loop {
    /// Least and most iterations per entry.
    pub(crate) least: u32,
    pub(crate) most: u32,
    /// Most iterations in one section, over all entries, if the source promises a total.
    pub(crate) total: Option<u32>,
    /// Counted by the sequencer: the loop ends by its count alone.
    pub(crate) counted: bool,
    /// Bundles from which a backward jump to the head can be reached without passing the head.
    pub(crate) body: BTreeSet<BundleAddress>,
    /// Edges that leave the loop.
    pub(crate) exits: BTreeSet<Edge>,
}

/// Control-flow graph of a program.
pub(crate) struct Graph<'p> {
    pub(crate) program: &'p Program,
    /// Registers with a constant value.
    pub(crate) known: BTreeMap<Register, u32>,
    nodes: Vec<Result<Node, (SlotIndex, IllegalWord)>>,
    /// Leaders: addresses at which paths meet or a counted loop begins.
    leaders: BTreeSet<BundleAddress>,
    pub(crate) loops: BTreeMap<BundleAddress, Loop>,
}

impl<'p> Graph<'p> {
    /// Graph in which every loop has a bound.
    pub(crate) fn new(program: &'p Program) -> Result<Graph<'p>, BoundError> {
        Graph::of(program, false)
    }

    /// Graph in which loops without a bound may have any number of iterations, stated as [`u32::MAX`].
    pub(crate) fn with_open_loops(program: &'p Program) -> Result<Graph<'p>, BoundError> {
        Graph::of(program, true)
    }

    fn of(program: &'p Program, open: bool) -> Result<Graph<'p>, BoundError> {
        let known = known_registers(program);
        let bundles = program.addresses().filter_map(|address| program.bundle(address));
        let node = |instructions: Vec<Instruction>| {
            let (flow, timing) = (Flow::of(&instructions), Bundle::new(program.machine, &instructions));
            Node { timing, flow, closes: None, taken: taken(flow, &known), instructions }
        };
        let nodes = bundles.map(|bundle| bundle.map(node)).collect();
        let mut graph = Graph { program, known, nodes, leaders: BTreeSet::new(), loops: BTreeMap::new() };
        let counts = graph.close_loops()?;
        let jumps = program.addresses().flat_map(|from| graph.edges(from)).filter(|(jump, _)| *jump);
        graph.leaders = jumps
            .map(|(_, edge)| edge.to)
            .chain(program.loop_bounds.iter().map(|bound| bound.address))
            .chain(counts.keys().copied())
            .collect();
        let mut before: BTreeMap<BundleAddress, Vec<BundleAddress>> = BTreeMap::new();
        for from in program.addresses() {
            for (_, edge) in graph.edges(from) {
                before.entry(edge.to).or_default().push(from);
            }
        }
        let totals: BTreeMap<BundleAddress, u32> =
            program.loop_bounds.iter().filter_map(|bound| Some((bound.address, bound.total?))).collect();
        let bounds = program
            .loop_bounds
            .iter()
            .map(|&LoopBound { address, most, total }| (address, (1, most.min(total.unwrap_or(u32::MAX)))));
        let mut bounds: BTreeMap<BundleAddress, (u32, u32)> = bounds.collect();
        for (&head, count) in &counts {
            match (count, bounds.get(&head)) {
                (Some(count), _) => _ = bounds.insert(head, (*count, *count)),
                (None, Some(_)) => {}
                (None, None) => return Err(BoundError::new(program, head, Refusal::UnknownCount)),
            }
        }
        if open {
            let back = program.addresses().flat_map(|from| graph.successors(from)).filter(|edge| edge.back);
            for edge in back {
                bounds.entry(edge.to).or_insert((1, u32::MAX));
            }
        }
        for (head, (least, most)) in bounds {
            let closes = |from: &BundleAddress| {
                graph.successors(*from).any(|edge| edge == Edge { to: head, back: true })
            };
            let mut left: Vec<BundleAddress> =
                before.get(&head).into_iter().flatten().copied().filter(closes).collect();
            if left.is_empty() {
                return Err(BoundError::new(program, head, Refusal::NoLoop));
            }
            let mut body = BTreeSet::from([head]);
            while let Some(address) = left.pop() {
                if body.insert(address) {
                    left.extend(before.get(&address).into_iter().flatten());
                }
            }
            let exits =
                body.iter().flat_map(|from| graph.successors(*from)).filter(|edge| !body.contains(&edge.to));
            let exits: BTreeSet<Edge> = exits.collect();
            let counted = counts.contains_key(&head);
            if counted {
                // The sequencer's count is known only if control enters through `loop` and leaves after the body's end.
                let enters = |from: &BundleAddress| !body.contains(from) && from.next() != head;
                let entered = body.iter().any(|at| before.get(at).into_iter().flatten().any(enters));
                // A jump back to the head is an iteration that the sequencer does not count, and one out of the body, even to the bundle
                // after it, leaves the loop on the stack.
                let is_last = |from: &BundleAddress| matches!(graph.nodes.get(from.index()), Some(Ok(node)) if node.closes == Some(head));
                let leaves = |edge: Edge| edge.to == head || !body.contains(&edge.to);
                let left =
                    body.iter().filter(|from| !is_last(from)).any(|from| graph.successors(*from).any(leaves));
                if entered || left || exits.len() > 1 {
                    return Err(BoundError::new(program, head, Refusal::Unstructured));
                }
            }
            let total = totals.get(&head).copied();
            graph.loops.insert(head, Loop { least, most, total, counted, body, exits });
        }
        Ok(graph)
    }

    /// Marks the bundles that close sequencer-counted loops. Returns the heads of these loops, each with its count if that is a constant.
    fn close_loops(&mut self) -> Result<BTreeMap<BundleAddress, Option<u32>>, BoundError> {
        let mut counts = BTreeMap::new();
        for at in self.program.addresses() {
            let Some(Ok(Node { flow: Flow::Loop { count, end }, .. })) = self.nodes.get(at.index()) else {
                continue;
            };
            let (head, last) = (at.next(), end.previous());
            let error = |refusal| Err(BoundError::new(self.program, at, refusal));
            counts.insert(head, self.known.get(count).copied());
            match self.nodes.get_mut(last.index()) {
                Some(Ok(node)) if last >= head && node.closes.is_none() && node.flow == Flow::Next => {
                    (node.closes, node.flow) = (Some(head), Flow::LoopEnd);
                }
                Some(Err(_)) => {}
                _ => return error(Refusal::Unstructured),
            }
        }
        Ok(counts)
    }

    /// Decoded bundle at an address.
    pub(crate) fn node(&self, address: BundleAddress) -> Result<&Node, BoundError> {
        let refusal = match self.nodes.get(address.index()) {
            Some(Ok(node)) => return Ok(node),
            Some(Err((slot, reason))) => {
                let slot = self.program.machine.slot(*slot).name;
                Refusal::IllegalWord { slot, reason: reason.to_string() }
            }
            None => Refusal::LeavesProgram { bundles: self.program.bundles() },
        };
        Err(BoundError::new(self.program, address, refusal))
    }

    /// Leader of a basic block: paths meet at this address, or a counted loop begins.
    pub(crate) fn is_leader(&self, address: BundleAddress) -> bool {
        self.leaders.contains(&address)
    }

    /// Edges out of a bundle; the flag marks jumps.
    fn edges(&self, from: BundleAddress) -> impl Iterator<Item = (bool, Edge)> + use<'p> {
        let (flow, taken, closes) = match self.nodes.get(from.index()) {
            Some(Ok(node)) => (node.flow, node.taken, node.closes),
            _ => (Flow::Halt, None, None),
        };
        let next = (false, Edge { to: from.next(), back: false });
        let jump = |to| (true, Edge { to, back: to <= from });
        let (next, jump) = match flow {
            Flow::Next | Flow::Publish | Flow::Call(_) | Flow::Loop { .. } => (Some(next), None),
            Flow::LoopEnd => (Some(next), closes.map(jump)),
            Flow::Jump(target) => (None, Some(jump(target))),
            Flow::Branch { target, .. } => (
                Some(next).filter(|_| taken != Some(true)),
                Some(jump(target)).filter(|_| taken != Some(false)),
            ),
            Flow::Return | Flow::Wait(_) | Flow::Halt => (None, None),
        };
        next.into_iter().chain(jump)
    }

    /// Edges out of a bundle.
    pub(crate) fn successors(&self, from: BundleAddress) -> impl Iterator<Item = Edge> + use<'p> {
        self.edges(from).map(|(_, edge)| edge)
    }
}

/// Outcome of a branch on a constant register: true if always taken, false if never; `None` if unknown.
fn taken(flow: Flow, known: &BTreeMap<Register, u32>) -> Option<bool> {
    match flow {
        Flow::Branch { register, zero, .. } => known.get(&register).map(|value| (*value == 0) == zero),
        _ => None,
    }
}

/// Registers with a constant value: `zero`, and registers that the loader sets and no operation writes.
fn known_registers(program: &Program) -> BTreeMap<Register, u32> {
    let mut known: BTreeMap<Register, u32> = program.constants.iter().copied().collect();
    known.retain(|register, _| !program.machine.is_input(*register));
    for word in program.code.chunks_exact(program.machine.slots.len()) {
        for (word, slot) in word.iter().zip(program.machine.slots) {
            if let Some(register) = Instruction::decode(*word).ok().and_then(|i| i.writes(slot)) {
                known.remove(&register);
            }
        }
    }
    known.insert(Register::ZERO, 0);
    known
}
