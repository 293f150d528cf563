// SPDX-License-Identifier: MIT OR Apache-2.0
//! Choice of the products to fuse, by critical-path lengths.
//!
//! Fusing saves an operation. It also saves time where the sum waits for the product; where the sum waits for the addend, or for
//! another product, it costs the cycles by which a fused operation takes longer than a sum. So a product is fused if, with unlimited
//! slots, its sum becomes ready earlier or at the same time; any other product is fused if the run's longest chain does not grow, or
//! does not exceed the cycles that the slots need for the run's products and sums alone.
//!
//! The body of a counted loop is executed again before it ends (software pipelining), so only chains from one iteration to
//! the next count: there every product is fused unless that lengthens the initiation interval.

use super::{FusionCandidates, OperationPosition};
use crate::ir::{Ir, LabelId, RegisterId, runs};
use smallvec::SmallVec;
use std::cmp::Reverse;
use std::collections::{HashMap, HashSet};
use takt_isa::{Function, Fusion, Op};

/// An operation of the run.
struct Node {
    at: OperationPosition,
    op: Op,
    /// Registers that the operation reads and that no earlier operation of the run writes.
    before: SmallVec<[RegisterId; 3]>,
    dest: Option<RegisterId>,
    /// By source: the operation of the run that computes it.
    from: SmallVec<[Option<usize>; 3]>,
    /// Products that are candidates for fusing into this operation.
    wishes: SmallVec<[(usize, Fusion); 2]>,
}

/// The decisions, by operation.
struct Decisions {
    /// The product that is fused into the operation.
    fused: Vec<Option<(usize, Fusion)>>,
    /// Cycle from the run's start in which the result is ready.
    done: Vec<u32>,
}

/// Chooses the sums of a run to fuse, each with its product, in source order.
pub(super) fn choose(
    ir: &Ir,
    run: runs::Run,
    wishes: &FusionCandidates,
) -> Vec<(OperationPosition, OperationPosition, Fusion)> {
    let nodes = nodes(ir, run, wishes);
    if nodes.iter().all(|node| node.wishes.is_empty()) {
        return Vec::new();
    }
    let soonest = decide(ir, &nodes, |_, _| false);
    let longest = soonest.done.iter().copied().max().unwrap_or(0).max(work(ir, &nodes));
    let after = after(ir, &nodes, &soonest);
    let mut decisions = decide(ir, &nodes, |sum, done| done + after[sum] <= longest);
    if is_loop(ir, run) {
        let all = decide(ir, &nodes, |_, _| true);
        if interval(ir, &nodes, &all) <= interval(ir, &nodes, &decisions) {
            decisions = all;
        }
    }
    let Decisions { fused, .. } = decisions;
    let chosen = nodes.iter().zip(fused);
    chosen
        .filter_map(|(sum, fused)| fused.map(|(product, fusion)| (sum.at, nodes[product].at, fusion)))
        .collect()
}

/// Cycles to issue the products and sums of a run on the slots that host them, without fusing.
fn work(ir: &Ir, nodes: &[Node]) -> u32 {
    let functions = [Function::Multiply, Function::Add];
    let counted = nodes.iter().filter(|node| functions.contains(&node.op.row().function)).count();
    let hosts = functions.map(|function| ir.machine.hosts(function));
    let slots = hosts[0].or(hosts[1]).len().max(1);
    u32::try_from(counted.div_ceil(slots)).unwrap_or(u32::MAX)
}

/// A run is the whole body of a loop of the source.
fn is_loop(ir: &Ir, run: runs::Run) -> bool {
    let end = |label: LabelId| ir.labels[label.0 as usize].position as usize;
    ir.loops.iter().any(|counted| counted.head as usize == run.start && end(counted.end) == run.end)
}

/// Lower bound of the initiation interval: the bound of the slots, and the longest chain from a value of one iteration to the same
/// value of the next.
fn interval(ir: &Ir, nodes: &[Node], decisions: &Decisions) -> u32 {
    let gone: HashSet<usize> = decisions.fused.iter().flatten().map(|(product, _)| *product).collect();
    let left = |functions: &[Function]| {
        let found = |(number, node): &(usize, &Node)| {
            let function = node.op.row().function;
            !gone.contains(number) && (functions.is_empty() || functions.contains(&function))
        };
        nodes.iter().enumerate().filter(found).count()
    };
    let functions = [Function::Multiply, Function::Add];
    let hosts = functions.map(|function| ir.machine.hosts(function));
    let arithmetic = left(&functions).div_ceil(hosts[0].or(hosts[1]).len().max(1));
    let slots = arithmetic.max(left(&[]).div_ceil(ir.machine.slots.len()));
    let written: HashMap<RegisterId, usize> =
        nodes.iter().enumerate().filter_map(|(number, node)| Some((node.dest?, number))).collect();
    let carried: HashSet<RegisterId> = nodes.iter().flat_map(|node| node.before.iter().copied()).collect();
    let chains = carried.iter().filter_map(|register| {
        let last = *written.get(register)?;
        // By operation: cycles from the register's value to its result.
        let mut from: Vec<Option<u32>> = Vec::with_capacity(nodes.len());
        for (number, node) in nodes.iter().enumerate() {
            let reads = |node: &Node| node.before.contains(register).then_some(0);
            let sources = |node: &Node| node.from.iter().flatten().filter_map(|&source| from[source]).max();
            let ready = match decisions.fused[number] {
                Some((product, fusion)) => waits_for(nodes, node, product, fusion)
                    .filter_map(|source| from[source])
                    .max()
                    .max(reads(node))
                    .max(reads(&nodes[product]))
                    .map(|ready| ready + latency(ir, fusion.fused)),
                None => sources(node).max(reads(node)).map(|ready| ready + latency(ir, node.op)),
            };
            from.push(ready);
        }
        from[last]
    });
    chains.max().unwrap_or(0).max(u32::try_from(slots).unwrap_or(u32::MAX))
}

fn nodes(ir: &Ir, run: runs::Run, wishes: &FusionCandidates) -> Vec<Node> {
    let mut nodes = Vec::new();
    let mut numbers: HashMap<OperationPosition, usize> = HashMap::new();
    let mut writer: HashMap<RegisterId, usize> = HashMap::new();
    for bundle in run.start..run.end {
        let mut written: SmallVec<[(RegisterId, usize); 4]> = SmallVec::new();
        for (which, operation) in ir.bundles[bundle].operations.iter().enumerate() {
            let at = (bundle, which);
            let known = wishes.get(&at).into_iter().flatten();
            numbers.insert(at, nodes.len());
            written.extend(operation.dest.map(|dest| (dest, nodes.len())));
            nodes.push(Node {
                at,
                op: operation.op,
                before: operation
                    .reads()
                    .iter()
                    .filter(|source| !writer.contains_key(source))
                    .copied()
                    .collect(),
                dest: operation.dest,
                from: operation.reads().iter().map(|source| writer.get(source).copied()).collect(),
                wishes: known
                    .filter_map(|&(product, fusion)| Some((*numbers.get(&product)?, fusion)))
                    .collect(),
            });
        }
        writer.extend(written);
    }
    nodes
}

fn latency(ir: &Ir, op: Op) -> u32 {
    let function = op.row().function;
    let slot = ir.machine.hosts(function).first();
    slot.and_then(|slot| ir.machine.unit(slot, function)).map_or(0, |unit| unit.latency)
}

/// The operations that a fused operation waits for: sources of the product's factors and of the addend.
fn waits_for<'a>(
    nodes: &'a [Node],
    sum: &'a Node,
    product: usize,
    fusion: Fusion,
) -> impl Iterator<Item = usize> + 'a {
    let addend = sum.from.get(1 - fusion.source).copied().flatten();
    nodes[product].from.iter().copied().flatten().chain(addend)
}

/// Decides in source order. `may_wait` says whether the fused operation may be ready in a cycle in which the sum alone would have
/// been ready for some time.
fn decide(ir: &Ir, nodes: &[Node], may_wait: impl Fn(usize, u32) -> bool) -> Decisions {
    let mut decisions =
        Decisions { fused: Vec::with_capacity(nodes.len()), done: Vec::with_capacity(nodes.len()) };
    for (number, node) in nodes.iter().enumerate() {
        let Decisions { fused, done } = &mut decisions;
        let latest =
            |sources: &mut dyn Iterator<Item = usize>| sources.map(|source| done[source]).max().unwrap_or(0);
        let plain = latest(&mut node.from.iter().copied().flatten()) + latency(ir, node.op);
        let with = |&(product, fusion): &(usize, Fusion)| {
            let ready = latest(&mut waits_for(nodes, node, product, fusion)) + latency(ir, fusion.fused);
            (ready, product, fusion)
        };
        // Ties go to the later product.
        let best = node.wishes.iter().map(with).min_by_key(|&(ready, product, _)| (ready, Reverse(product)));
        let best = best.filter(|&(ready, ..)| ready <= plain || may_wait(number, ready));
        fused.push(best.map(|(_, product, fusion)| (product, fusion)));
        done.push(best.map_or(plain, |(ready, ..)| ready));
    }
    decisions
}

/// The cycles from an operation's result to the end of the longest chain that begins with it.
fn after(ir: &Ir, nodes: &[Node], decisions: &Decisions) -> Vec<u32> {
    let mut after = vec![0; nodes.len()];
    let mut gone = vec![false; nodes.len()];
    for number in (0..nodes.len()).rev() {
        let node = &nodes[number];
        let mut chain = |sources: &mut dyn Iterator<Item = usize>, op: Op| {
            let length = latency(ir, op) + after[number];
            sources.for_each(|source| after[source] = after[source].max(length));
        };
        match decisions.fused[number] {
            _ if gone[number] => {}
            Some((product, fusion)) => {
                gone[product] = true;
                chain(&mut waits_for(nodes, node, product, fusion), fusion.fused);
            }
            None => chain(&mut node.from.iter().copied().flatten(), node.op),
        }
    }
    after
}
