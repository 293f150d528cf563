// SPDX-License-Identifier: MIT OR Apache-2.0
//! Control-flow graphs of a program's repeating periods: basic blocks, calls inlined, with the control dependences of each block.

use super::MAX_NODES;
use super::dominators::dominators;
use crate::error::{BoundError, Refusal};
use crate::graph::{Graph, Node};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use std::ops::Range;
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::{BundleAddress, Effect, Flow, Instruction, Program, Register, Slot};

/// Number of a storage place: a register that is written or is an input, a data word, or other state such as the flags.
pub(super) type Storage = usize;

/// Origin of a value.
#[derive(Clone, Debug)]
pub(super) enum ValueSource {
    /// Storage places known from the instruction alone.
    Places(Vec<Storage>),
    /// Word of the data memory at an address that is not constant, and the places that compute the address.
    Memory(Vec<Storage>),
}

/// Destination of a value.
#[derive(Clone, Copy, Debug)]
pub(super) enum ValueDestination {
    /// Storage place that takes the new value alone.
    Place(Storage),
    /// Storage place that also keeps its old value, as the sticky flags do.
    Gathered(Storage),
    /// Word of the data memory at an address that is not constant.
    Memory,
}

/// Data flow of a bundle; all reads precede all writes.
#[derive(Clone, Debug, Default)]
pub(super) struct Step {
    pub(super) moves: Vec<(ValueSource, ValueDestination)>,
    /// Output ports that this bundle sends: the place of the port, and the place that holds its sent value.
    pub(super) sends: Vec<(Storage, Storage)>,
}

/// Immediate post-dominator of a branch, where its paths meet again.
#[derive(Clone, Debug)]
pub(super) struct Gate {
    /// Block with the branch.
    pub(super) branch: usize,
    /// The branch dominates this place: every path to here passes it.
    pub(super) always: bool,
    /// Places written between the branch and here.
    pub(super) written: Vec<Storage>,
}

/// Basic block of a period.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub(super) before: Vec<usize>,
    pub(super) steps: Vec<Step>,
    /// Place tested by its final branch, if any.
    pub(super) tests: Option<Storage>,
    /// Control dependences: blocks whose branches decide if this block executes.
    pub(super) under: Vec<usize>,
    pub(super) gates: Vec<Gate>,
    /// The last bundle is a `wait`.
    pub(super) waits: bool,
}

/// Period: the code from one bundle to its `wait`s.
#[derive(Debug)]
pub(super) struct Section {
    /// Blocks in topological order, back edges excepted; the first is the entry.
    pub(super) blocks: Vec<Block>,
    /// Gates at the end: branches whose paths meet only there.
    pub(super) gates: Vec<Gate>,
    /// Following periods, by number.
    pub(super) next: Vec<usize>,
}

/// Graphs of all repeating periods, with the numbering of storage places.
#[derive(Debug)]
pub(super) struct PeriodGraphs {
    pub(super) sections: Vec<Section>,
    pub(super) places: usize,
    pub(super) registers: BTreeMap<Register, Storage>,
    /// Places of the data memory's words.
    pub(super) memory: Range<Storage>,
    /// Place that holds the value of a port last sent by a write to another port; the flag says that the sent value is certain.
    pub(super) sent: BTreeMap<(Register, Register), (Storage, bool)>,
    /// Place for the choice of the next period, if there are several.
    pub(super) which: Option<Storage>,
    /// Places that any period writes.
    pub(super) written: Vec<Storage>,
}

/// Bundle under its call path.
struct Bundle<'g> {
    node: &'g Node,
    to: Vec<usize>,
    before: Vec<usize>,
    waits: Option<BundleAddress>,
}

impl PeriodGraphs {
    /// Graphs of a program's periods; `None` if the program is too large.
    pub(super) fn new(
        program: &Program,
        sent_by: &BTreeSet<(Register, Register)>,
    ) -> Result<Option<PeriodGraphs>, BoundError> {
        let graph = Graph::new(program)?;
        // Worklist of periods: begins with those after the reset section, then follows their successors.
        let once = unfolded(&graph, BundleAddress::RESET)?;
        let (mut found, mut left, mut nodes) = (BTreeMap::new(), targets(&once), once.len());
        if nodes > MAX_NODES {
            return Ok(None);
        }
        while let Some(address) = left.pop() {
            let Entry::Vacant(place) = found.entry(address) else { continue };
            let bundles = place.insert(unfolded(&graph, address)?);
            nodes += bundles.len();
            if nodes > MAX_NODES {
                return Ok(None);
            }
            left.extend(targets(bundles));
        }
        keep_repeating(&mut found);
        let mut places = Places::new(&graph, &found);
        let sent =
            sent_by.iter().map(|&pair| (pair, (places.another(), ordered(&graph, &found, pair)))).collect();
        places.sent = sent;
        let which = (found.len() > 1).then(|| places.another());
        let numbers: BTreeMap<BundleAddress, usize> = found.keys().copied().zip(0..).collect();
        let sections: Vec<Section> =
            found.values().map(|bundles| section(&graph, bundles, &places, &numbers)).collect();
        let steps = sections.iter().flat_map(|section| &section.blocks).flat_map(|block| &block.steps);
        let written: BTreeSet<Storage> = steps.flat_map(|step| step.places(&places.memory)).collect();
        Ok(Some(PeriodGraphs {
            sections,
            places: places.count,
            registers: places.registers,
            memory: places.memory,
            sent: places.sent,
            which,
            written: written.into_iter().collect(),
        }))
    }
}

fn targets(bundles: &[Bundle<'_>]) -> Vec<BundleAddress> {
    bundles.iter().filter_map(|bundle| bundle.waits).collect()
}

/// Bundles reachable from `start`, calls inlined: one entry for each call path. A search beyond [`MAX_NODES`] is cut off: its result has
/// more bundles than that, and must not be analysed.
fn unfolded<'g>(graph: &'g Graph<'_>, start: BundleAddress) -> Result<Vec<Bundle<'g>>, BoundError> {
    let error = |at, refusal| BoundError::new(graph.program, at, refusal);
    // A call path is its parent path and a return address; the first is the empty path.
    let mut calls: Vec<Option<(usize, BundleAddress)>> = vec![None];
    let mut call_numbers = HashMap::new();
    let mut numbers = HashMap::from([((0, start), 0)]);
    let (mut bundles, mut left) = (Vec::new(), VecDeque::from([(0, start)]));
    while let Some((call, address)) = left.pop_front() {
        let node = graph.node(address)?;
        let mut waits = None;
        let next: Vec<(usize, BundleAddress)> = match node.flow {
            Flow::Call(target) => {
                let next = calls.len();
                let number = *call_numbers.entry((call, address.next())).or_insert(next);
                if number == next {
                    calls.push(Some((call, address.next())));
                }
                vec![(number, target)]
            }
            Flow::Return => match calls[call] {
                Some(before) => vec![before],
                None => return Err(error(address, Refusal::StackUnderflow)),
            },
            Flow::Wait(_) if call > 0 => return Err(error(address, Refusal::WaitInSubroutine)),
            Flow::Wait(target) => {
                waits = Some(target);
                Vec::new()
            }
            _ => graph.successors(address).map(|edge| (call, edge.to)).collect(),
        };
        let mut to = Vec::new();
        for place in next {
            let number = numbers.len();
            let number = *numbers.entry(place).or_insert_with(|| {
                left.push_back(place);
                number
            });
            if !to.contains(&number) {
                to.push(number);
            }
        }
        bundles.push(Bundle { node, to, before: Vec::new(), waits });
        if bundles.len() > MAX_NODES {
            return Ok(bundles);
        }
    }
    prune(&mut bundles);
    Ok(bundles)
}

/// Removes bundles that only lead to a `halt`, since no period follows them, and records the predecessors of each bundle.
fn prune(bundles: &mut [Bundle<'_>]) {
    let mut before = vec![Vec::new(); bundles.len()];
    for (from, bundle) in bundles.iter().enumerate() {
        bundle.to.iter().for_each(|&to| before[to].push(from));
    }
    let mut ends = vec![false; bundles.len()];
    let mut left: Vec<usize> = (0..bundles.len()).filter(|&bundle| bundles[bundle].waits.is_some()).collect();
    while let Some(bundle) = left.pop() {
        if !std::mem::replace(&mut ends[bundle], true) {
            left.extend(&before[bundle]);
        }
    }
    for (bundle, before) in bundles.iter_mut().zip(before) {
        bundle.to.retain(|&to| ends[to]);
        bundle.before = before.into_iter().filter(|&from| ends[from]).collect();
    }
}

/// Removes periods that lie on no cycle, and so cannot repeat.
fn keep_repeating(found: &mut BTreeMap<BundleAddress, Vec<Bundle<'_>>>) {
    let next: BTreeMap<BundleAddress, Vec<BundleAddress>> =
        found.iter().map(|(&address, bundles)| (address, targets(bundles))).collect();
    found.retain(|start, _| {
        let (mut seen, mut left) = (BTreeSet::new(), next[start].clone());
        while let Some(address) = left.pop() {
            if seen.insert(address) {
                left.extend(&next[&address]);
            }
        }
        seen.contains(start)
    });
}

/// Numbering of storage places.
struct Places {
    count: usize,
    registers: BTreeMap<Register, Storage>,
    known: BTreeMap<Register, u32>,
    words: BTreeMap<i64, Storage>,
    memory: Range<Storage>,
    flags: Option<Storage>,
    sent: BTreeMap<(Register, Register), (Storage, bool)>,
}

impl Places {
    fn new(graph: &Graph<'_>, found: &BTreeMap<BundleAddress, Vec<Bundle<'_>>>) -> Places {
        let machine = graph.program.machine;
        let mut places = Places {
            count: 0,
            registers: BTreeMap::new(),
            known: graph.known.clone(),
            words: BTreeMap::new(),
            memory: 0..0,
            flags: None,
            sent: BTreeMap::new(),
        };
        let instructions = || {
            let bundles = found.values().flatten();
            bundles.flat_map(|bundle| bundle.node.instructions.iter().zip(machine.slots))
        };
        let (mut registers, mut words) = (BTreeSet::new(), BTreeSet::new());
        for (instruction, slot) in instructions() {
            registers.extend(instruction.writes(slot));
            registers.extend(instruction.reads().iter().filter(|register| machine.is_input(**register)));
            if matches!(instruction.effect(), Effect::Load | Effect::Store) {
                words.extend(places.word(instruction));
            }
        }
        places.registers = registers.into_iter().zip(0..).collect();
        places.count = places.registers.len();
        let first = places.count;
        places.words = words.into_iter().zip(first..).collect();
        // The last place stands for all words that no constant address names.
        places.count += places.words.len() + 1;
        places.memory = first..places.count;
        let reads_flags = instructions().any(|(instruction, _)| instruction.effect() == Effect::ReadFlags);
        places.flags = reads_flags.then(|| places.another());
        places
    }

    fn another(&mut self) -> Storage {
        self.count += 1;
        self.count - 1
    }

    /// Word that a load or store uses, if its address is constant.
    fn word(&self, instruction: &Instruction) -> Option<i64> {
        let base = self.known.get(&instruction.sources[0])?;
        Some(i64::from(instruction.constant) + i64::from(base.cast_signed()))
    }

    fn of(&self, registers: &[Register]) -> Vec<Storage> {
        registers.iter().filter_map(|register| self.registers.get(register).copied()).collect()
    }

    /// Data flow of a bundle.
    fn step(&self, instructions: &[Instruction], slots: &[Slot]) -> Step {
        let mut step = Step::default();
        for (instruction, slot) in instructions.iter().zip(slots) {
            let to = instruction.writes(slot).and_then(|register| self.registers.get(&register).copied());
            let reads = self.of(instruction.reads());
            let word = || self.word(instruction).and_then(|word| self.words.get(&word).copied());
            let (from, to) = match instruction.effect() {
                Effect::Compute => {
                    if let Some(flags) = self.flags {
                        step.moves
                            .push((ValueSource::Places(reads.clone()), ValueDestination::Gathered(flags)));
                    }
                    (ValueSource::Places(reads), to.map(ValueDestination::Place))
                }
                Effect::Immediate => (ValueSource::Places(Vec::new()), to.map(ValueDestination::Place)),
                Effect::Load => match word() {
                    Some(word) => (ValueSource::Places(vec![word]), to.map(ValueDestination::Place)),
                    None => (ValueSource::Memory(reads), to.map(ValueDestination::Place)),
                },
                Effect::Store => match word() {
                    Some(word) => (
                        ValueSource::Places(self.of(&instruction.sources[1..2])),
                        Some(ValueDestination::Place(word)),
                    ),
                    None => (ValueSource::Places(reads), Some(ValueDestination::Memory)),
                },
                Effect::ReadFlags => {
                    (ValueSource::Places(self.flags.into_iter().collect()), to.map(ValueDestination::Place))
                }
                Effect::ClearFlags => {
                    (ValueSource::Places(Vec::new()), self.flags.map(ValueDestination::Place))
                }
                // Control operations write no place.
                Effect::Nothing | Effect::Publish | Effect::Wait | Effect::Halt => continue,
                Effect::Jump | Effect::BranchZero | Effect::BranchNonzero => continue,
                Effect::Call | Effect::Return | Effect::Loop => continue,
            };
            step.moves.extend(to.map(|to| (from, to)));
        }
        let writes: Vec<Register> = instructions
            .iter()
            .zip(slots)
            .filter_map(|(instruction, slot)| instruction.writes(slot))
            .collect();
        for ((port, by), (place, _)) in &self.sent {
            if let Some(port) = self.registers.get(port).filter(|_| writes.contains(by)) {
                step.sends.push((*port, *place));
            }
        }
        step
    }
}

impl Step {
    /// Places that the bundle may write.
    pub(super) fn places(&self, memory: &Range<Storage>) -> impl Iterator<Item = Storage> {
        let moves = self.moves.iter().flat_map(|(_, to)| match to {
            ValueDestination::Place(place) | ValueDestination::Gathered(place) => *place..place + 1,
            ValueDestination::Memory => memory.clone(),
        });
        moves.chain(self.sends.iter().map(|(_, place)| *place))
    }
}

/// A write to `by` always sends the value that the last preceding bundle, or its own, wrote to `port`. Writebacks that come out of order,
/// since latencies differ by more than the distance of the bundles, break this.
fn ordered(
    graph: &Graph<'_>,
    found: &BTreeMap<BundleAddress, Vec<Bundle<'_>>>,
    (port, by): (Register, Register),
) -> bool {
    let slots = graph.program.machine.slots;
    let latency = |bundle: &Bundle<'_>, register: Register| {
        let mut writes = bundle.node.instructions.iter().zip(slots);
        writes.find_map(|(instruction, slot)| {
            instruction.writes(slot).filter(|written| *written == register)?;
            Some(slot.unit(instruction.op.row().function)?.latency)
        })
    };
    found.values().all(|bundles| {
        (0..bundles.len()).all(|at| {
            let Some(own) = latency(&bundles[at], by) else { return true };
            // Writes of the bundle with the `wait` arrive in the next period.
            if bundles[at].waits.is_some() {
                return false;
            }
            [true, false].into_iter().all(|is_before| {
                let (mut seen, mut level) = (BTreeSet::from([at]), vec![at]);
                (0..MAX_LATENCY).all(|distance| {
                    let right = level.iter().all(|&other| match latency(&bundles[other], port) {
                        Some(_) if bundles[other].waits.is_some() => false,
                        Some(latency) if is_before => latency <= own + distance,
                        Some(latency) => distance == 0 || latency + distance > own,
                        None => true,
                    });
                    let further = |&other: &usize| {
                        if is_before { &bundles[other].before } else { &bundles[other].to }
                    };
                    let next: Vec<usize> = level.iter().flat_map(further).copied().collect();
                    level = next.into_iter().filter(|&other| seen.insert(other)).collect();
                    right
                })
            })
        })
    }) && found.values().flatten().all(|bundle| bundle.waits.is_none() || latency(bundle, port).is_none())
}

/// Groups bundles into basic blocks and finds their control dependences.
fn section(
    graph: &Graph<'_>,
    bundles: &[Bundle<'_>],
    places: &Places,
    numbers: &BTreeMap<BundleAddress, usize>,
) -> Section {
    let slots = graph.program.machine.slots;
    let heads = order(bundles);
    let block_of: HashMap<usize, usize> = heads.iter().copied().zip(0..).collect();
    let mut blocks: Vec<Block> = Vec::new();
    let mut to: Vec<Vec<usize>> = Vec::new();
    for &head in &heads {
        let (mut at, mut block) = (head, Block::default());
        loop {
            block.steps.push(places.step(&bundles[at].node.instructions, slots));
            match bundles[at].to[..] {
                [next] if !block_of.contains_key(&next) => at = next,
                _ => break,
            }
        }
        if let (Flow::Branch { register, .. }, [_, _, ..]) = (bundles[at].node.flow, &bundles[at].to[..]) {
            block.tests = places.registers.get(&register).copied();
        }
        block.waits = bundles[at].waits.is_some();
        to.push(bundles[at].to.iter().filter_map(|next| block_of.get(next).copied()).collect());
        blocks.push(block);
    }
    // Add a virtual exit node, after the last block, as the root of the post-dominators.
    let end = blocks.len();
    for (block, to) in blocks.iter().zip(&mut to) {
        to.extend(block.waits.then_some(end));
    }
    to.push(Vec::new());
    let mut before = vec![Vec::new(); end + 1];
    for (from, to) in to.iter().enumerate() {
        to.iter().for_each(|&to| before[to].push(from));
    }
    let first = dominators(&to, &before, 0);
    let last = dominators(&before, &to, end);
    let mut end_gates = Vec::new();
    for branch in
        (0..end).filter(|&block| to[block].len() > 1 && blocks[block].tests.is_some()).collect::<Vec<_>>()
    {
        let Some(meet) = last[branch] else { continue };
        let (mut region, mut left) = (BTreeSet::new(), to[branch].clone());
        while let Some(block) = left.pop() {
            if block != meet && region.insert(block) {
                left.extend(&to[block]);
            }
        }
        let written = region
            .iter()
            .flat_map(|&block| &blocks[block].steps)
            .flat_map(|step| step.places(&places.memory));
        let written: BTreeSet<Storage> = written.collect();
        region.iter().for_each(|&block| blocks[block].under.push(branch));
        let always = is_over(&first, branch, meet);
        let gate = Gate { branch, always, written: written.into_iter().collect() };
        if meet == end { end_gates.push(gate) } else { blocks[meet].gates.push(gate) }
    }
    for (block, before) in blocks.iter_mut().zip(before) {
        block.before = before;
    }
    let next: BTreeSet<usize> =
        targets(bundles).iter().filter_map(|target| numbers.get(target).copied()).collect();
    Section { blocks, gates: end_gates, next: next.into_iter().collect() }
}

/// Dominance: every path to `block` passes `over`.
fn is_over(dominators: &[Option<usize>], over: usize, mut block: usize) -> bool {
    while let Some(next) = dominators[block].filter(|&next| next != block) {
        if next == over {
            return true;
        }
        block = next;
    }
    false
}

/// Leaders of the basic blocks, in topological order (back edges excepted).
fn order(bundles: &[Bundle<'_>]) -> Vec<usize> {
    let begins = |bundle: usize| match bundles[bundle].before[..] {
        [before] if bundle > 0 => bundles[before].to.len() > 1,
        _ => true,
    };
    let (mut order, mut seen) = (Vec::new(), vec![false; bundles.len()]);
    let mut stack = vec![(0, 0)];
    if let Some(first) = seen.first_mut() {
        *first = true;
    }
    while let Some((bundle, next)) = stack.last_mut() {
        let bundle = *bundle;
        match bundles.get(bundle).and_then(|at| at.to.get(*next)) {
            Some(&to) => {
                *next += 1;
                if !std::mem::replace(&mut seen[to], true) {
                    stack.push((to, 0));
                }
            }
            None => {
                order.extend(begins(bundle).then_some(bundle));
                stack.pop();
            }
        }
    }
    order.reverse();
    order
}
