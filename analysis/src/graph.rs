//! The control flow of a program, bundle by bundle.

use crate::error::{BoundError, Refusal};
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::program::{IllegalWord, LoopBound};
use takt_isa::timing::{Address, Bundle};
use takt_isa::{Effect, Instruction, Program, ZERO};

/// Where execution goes on after a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    /// At the next bundle.
    Next,
    /// At the target.
    Jump(Address),
    /// At the target or at the next bundle: `taken` where that is known.
    Branch { target: Address, taken: Option<bool> },
    /// In the subroutine, and then at the next bundle.
    Call(Address),
    /// Where the call came from.
    Return,
    /// At the target, on the tick.
    Wait(Address),
    /// Nowhere.
    Halt,
    /// Unknown: two operations redirect.
    Two,
}

/// A bundle.
pub(crate) struct Node {
    pub(crate) timing: Bundle,
    pub(crate) flow: Flow,
}

/// A way from one bundle to another within a subroutine. A call is passed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Edge {
    pub(crate) to: Address,
    /// Whether it is a jump or a taken branch to the same or an earlier address: what a loop's bound counts.
    pub(crate) back: bool,
}

/// A loop that has a bound.
#[derive(Debug)]
pub(crate) struct Loop {
    pub(crate) most: u32,
    /// Its bundles: those from which a backward jump to the head can be reached without passing the head.
    pub(crate) body: BTreeSet<Address>,
    /// Ways out of it.
    pub(crate) exits: BTreeSet<Edge>,
}

/// A program's control flow.
pub(crate) struct Graph<'p> {
    pub(crate) program: &'p Program,
    nodes: Vec<Result<Node, (usize, IllegalWord)>>,
    /// Where ways meet or a counted loop begins.
    leaders: BTreeSet<Address>,
    pub(crate) loops: BTreeMap<Address, Loop>,
}

impl<'p> Graph<'p> {
    pub(crate) fn new(program: &'p Program) -> Result<Graph<'p>, BoundError> {
        let known = known_registers(program);
        let bundles = (0..program.bundles()).filter_map(|address| program.bundle(address));
        let node = |instructions: Vec<Instruction>| {
            let mut flows = instructions
                .iter()
                .filter(|instruction| instruction.effect().redirects())
                .map(|instruction| flow(instruction, &known));
            let first = flows.next().unwrap_or(Flow::Next);
            let flow = if flows.next().is_some() { Flow::Two } else { first };
            Node { timing: Bundle::new(program.machine, &instructions), flow }
        };
        let nodes = bundles.map(|bundle| bundle.map(node)).collect();
        let mut graph = Graph { program, nodes, leaders: BTreeSet::new(), loops: BTreeMap::new() };
        let all = || 0..program.bundles();
        let jumps = all().flat_map(|from| graph.edges(from)).filter(|(jump, _)| *jump);
        graph.leaders = jumps
            .map(|(_, edge)| edge.to)
            .chain(program.loop_bounds.iter().map(|bound| bound.address))
            .collect();
        let mut before: BTreeMap<Address, Vec<Address>> = BTreeMap::new();
        for from in all() {
            for (_, edge) in graph.edges(from) {
                before.entry(edge.to).or_default().push(from);
            }
        }
        for &LoopBound { address: head, most } in &program.loop_bounds {
            let closes =
                |from: &Address| graph.successors(*from).any(|edge| edge == Edge { to: head, back: true });
            let mut left: Vec<Address> =
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
            let exits = exits.collect();
            graph.loops.insert(head, Loop { most, body, exits });
        }
        Ok(graph)
    }

    /// The bundle at an address.
    pub(crate) fn node(&self, address: Address) -> Result<&Node, BoundError> {
        let refusal = match self.nodes.get(address as usize) {
            Some(Ok(node)) if node.flow == Flow::Two => Refusal::TwoRedirections,
            Some(Ok(node)) => return Ok(node),
            Some(Err((slot, reason))) => {
                let slot = self.program.machine.slots[*slot].name;
                Refusal::IllegalWord { slot, reason: reason.to_string() }
            }
            None => Refusal::LeavesProgram { bundles: self.program.bundles() },
        };
        Err(BoundError::new(self.program, address, refusal))
    }

    /// Whether ways meet at an address, or a counted loop begins.
    pub(crate) fn is_leader(&self, address: Address) -> bool {
        self.leaders.contains(&address)
    }

    /// Ways out of a bundle, and whether each is a jump.
    fn edges(&self, from: Address) -> impl Iterator<Item = (bool, Edge)> + use<'p> {
        let flow = match self.nodes.get(from as usize) {
            Some(Ok(node)) => node.flow,
            _ => Flow::Halt,
        };
        let next = (false, Edge { to: from + 1, back: false });
        let jump = |to| (true, Edge { to, back: to <= from });
        let (next, jump) = match flow {
            Flow::Next | Flow::Call(_) => (Some(next), None),
            Flow::Jump(target) => (None, Some(jump(target))),
            Flow::Branch { target, taken } => (
                Some(next).filter(|_| taken != Some(true)),
                Some(jump(target)).filter(|_| taken != Some(false)),
            ),
            Flow::Return | Flow::Wait(_) | Flow::Halt | Flow::Two => (None, None),
        };
        next.into_iter().chain(jump)
    }

    /// Ways out of a bundle.
    pub(crate) fn successors(&self, from: Address) -> impl Iterator<Item = Edge> + use<'p> {
        self.edges(from).map(|(_, edge)| edge)
    }
}

/// Where execution goes on after an instruction that redirects it; `known` holds the bits of registers that never change.
pub(crate) fn flow(instruction: &Instruction, known: &BTreeMap<u16, u32>) -> Flow {
    let target = instruction.constant;
    let branch = |zero| {
        let value = known.get(&instruction.sources[0]);
        Flow::Branch { target, taken: value.map(|value| (*value == 0) == zero) }
    };
    match instruction.effect() {
        Effect::Jump => Flow::Jump(target),
        Effect::BranchZero => branch(true),
        Effect::BranchNonzero => branch(false),
        Effect::Call => Flow::Call(target),
        Effect::Return => Flow::Return,
        Effect::Wait => Flow::Wait(target),
        _ => Flow::Halt,
    }
}

/// Registers that hold one value for good: `zero`, and what the loader sets and nothing writes.
fn known_registers(program: &Program) -> BTreeMap<u16, u32> {
    let mut known: BTreeMap<u16, u32> = program.constants.iter().copied().collect();
    known.retain(|register, _| !program.machine.is_input(*register));
    for word in program.code.chunks_exact(program.machine.slots.len()) {
        for (word, slot) in word.iter().zip(program.machine.slots) {
            if let Some(register) = Instruction::decode(*word).ok().and_then(|i| i.writes(slot)) {
                known.remove(&register);
            }
        }
    }
    known.insert(ZERO, 0);
    known
}
