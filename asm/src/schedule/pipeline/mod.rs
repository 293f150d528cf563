// SPDX-License-Identifier: MIT OR Apache-2.0
//! Software pipelining of counted loops: if the body is one block, an iteration begins before the previous one has ended.
//!
//! [`modulo`](super::modulo) finds the cycles of an iteration's operations. The kernel, one interval long, then holds operations of
//! several iterations at once. The prologue goes before `loop`, the epilogue after the body's end; both become parts of the blocks
//! around the loop and are scheduled with them.
//!
//! Values that do not outlive their iteration get registers of their own first ([`rename::rename`]). The next iteration writes a register
//! after this iteration has read it, which is one more precedence: no value lives longer than an interval.
//!
//! A count that is known only at run time may be below the number of iterations that overlap. The program then holds the loop twice:
//! a branch before the prologue leads such a count to the loop as it is written.

mod induction;
mod parts;
mod rename;
mod rewrite;

use super::budget::{Budget, Steps};
use super::domains::Domains;
use super::modulo::{AdvancedAccess, IntervalBound, LoopEdge, LoopProblem};
use super::problem::Edge;
use super::{Block, latency, memory, solve};
use crate::ir::arrays::{ArrayAccess, LoopId};
use crate::ir::runs::{self, Run};
use crate::ir::{Bundle, Ir, Operation, RegisterId};
use crate::loops::LoopCount;
use induction::{Induction, inductions};
use parts::{Parts, PeeledIteration};
use rewrite::LoopChoice;
use std::collections::HashMap;
use std::ops::Range;
use takt_isa::program::{Location, Space};
use takt_isa::{BundleAddress, Effect, SlotIndex, Slots};

/// Intervals that are tried beyond the bound: an eighth of it, and four.
const SPARE: (u32, u32) = (8, 4);

/// Report of a pipelined loop.
#[derive(Clone, Debug)]
pub struct LoopReport {
    /// Index among the loops that may be pipelined.
    pub number: usize,
    /// Number of operations in the body.
    pub operations: u32,
    /// The source line of the body's first operation.
    pub location: Option<Location>,
    /// The address of the kernel.
    pub address: BundleAddress,
    /// Iterations each time that the loop is entered.
    pub iterations: LoopCount,
    /// Iterations that overlap in the kernel.
    pub stages: u32,
    /// Initiation interval, in cycles.
    pub interval: u32,
    /// The lower bounds of the interval.
    pub bound: IntervalBound,
    /// Cycles saved by all entries of the loop while the enclosing loops run once.
    pub(crate) saved: u64,
    /// Approximate number of bundles that the pipelined loop takes.
    pub(crate) bundles: u64,
}

impl LoopReport {
    /// Saves fewer cycles per bundle than another loop.
    pub(crate) fn is_of_less_use(&self, other: &LoopReport) -> bool {
        let product = |saved: u64, bundles: u64| u128::from(saved) * u128::from(bundles);
        product(self.saved, other.bundles) < product(other.saved, self.bundles)
    }
}

/// An innermost counted loop whose iterations are executed one after the other, as they are written.
#[derive(Clone, Debug)]
pub struct PlainLoop {
    /// The source line of the body's first operation.
    pub location: Option<Location>,
    /// Reason, a clause for the report.
    pub reason: String,
}

/// The number of iterations of a loop.
#[derive(Clone, Copy)]
enum Count {
    Exactly(u32),
    /// From one to this many, with the operations that choose between the pipelined loop and the source's.
    AtMost(u32, LoopChoice),
}

impl Count {
    fn iterations(self) -> LoopCount {
        match self {
            Count::Exactly(count) => LoopCount::Exactly(count),
            Count::AtMost(most, _) => LoopCount::AtMost(most),
        }
    }
}

/// A loop that may be pipelined: its body is one block.
struct Candidate {
    /// The bundle that holds `loop`.
    entry: usize,
    body: Run,
    count: Count,
    /// The source's `.for` loop, if it is one.
    of: Option<LoopId>,
}

/// A loop's new bundles.
struct Pipelined {
    candidate: Candidate,
    prologue: Vec<Bundle>,
    kernel: Vec<Bundle>,
    epilogue: Vec<Bundle>,
    report: LoopReport,
}

/// Pipelines every loop that becomes shorter. The kernels are not scheduled again; the blocks around them are.
pub(super) fn pipeline(
    ir: &mut Ir,
    without: &[usize],
    budget: &mut Budget,
) -> (Vec<LoopReport>, Vec<PlainLoop>) {
    if !ir.operations().any(|operation| operation.row().effect == Effect::Loop) {
        return (Vec::new(), Vec::new());
    }
    let runs = runs::runs(ir);
    let fixed = memory::fixed(ir);
    let (candidates, mut plain) = candidates(ir, &runs, &fixed);
    candidates.iter().for_each(|candidate| rename::rename(ir, candidate.body));
    let fixed = memory::fixed(ir);
    let mut accesses = ir.accesses.clone();
    let mut pipelined: Vec<Pipelined> = Vec::new();
    let loops = candidates.len();
    for (number, candidate) in candidates.into_iter().enumerate() {
        if without.contains(&number) {
            continue;
        }
        let domains = Domains::new(ir, &runs, false);
        let location = location(ir, candidate.body);
        let mut steps = budget.of_loop(loops - number);
        let found = one(ir, &fixed, &domains, (number, candidate), &mut accesses, &mut steps);
        budget.take_for_loop(steps.taken());
        let Some(one) = found else {
            let reason = match steps.are_spent() {
                true => {
                    "no schedule with overlapping iterations was found in the steps of its search; `--effort` gives it more"
                }
                false => "no schedule with overlapping iterations is shorter",
            };
            let reason = reason.to_owned();
            plain.push(PlainLoop { location, reason });
            continue;
        };
        settle_slots(ir, &one.kernel);
        pipelined.push(one);
    }
    if pipelined.is_empty() {
        return (Vec::new(), plain);
    }
    ir.accesses = accesses;
    (rewrite::rewrite(ir, pipelined), plain)
}

/// The source line of a body's first operation.
fn location(ir: &Ir, body: Run) -> Option<Location> {
    let operations = ir.bundles[body.start..body.end].iter().flat_map(|bundle| &bundle.operations);
    operations.into_iter().find_map(|operation| ir.location(operation))
}

/// Candidates for pipelining: loops with a constant or bounded count, whose body is one block that the scheduler may move, and in
/// which no port has a demand. Also the other innermost loops, each with the reason.
fn candidates(ir: &Ir, runs: &[Run], fixed: &[Option<u32>]) -> (Vec<Candidate>, Vec<PlainLoop>) {
    let demanded =
        |id: &RegisterId| ir.demands.iter().flat_map(|demand| &demand.ports).any(|(port, _)| port == id);
    let ways = LoopChoice::of(ir.machine);
    let bounds: HashMap<u32, u32> = ir.loop_bounds.iter().map(|bound| (bound.position, bound.most)).collect();
    let labels: Vec<u32> =
        ir.labels.iter().filter(|label| label.space == Space::Code).map(|label| label.position).collect();
    let pairs = runs.windows(2).filter_map(|pair| {
        let ([before, body], entry) = (<[Run; 2]>::try_from(pair).ok()?, pair[0].end - 1);
        let operation = |operation: &&Operation| operation.row().effect == Effect::Loop;
        let last = ir.bundles[entry].operations.iter().find(operation)?;
        let label = last.target()?.ok()?;
        let head = body.start as u32;
        let constant = fixed[last.sources[0].index()];
        let count = constant.map(Count::Exactly);
        let count = count.or_else(|| Some(Count::AtMost(*bounds.get(&head)?, ways?)));
        let own = &ir.bundles[body.start..body.end];
        let end = ir.labels[label.0 as usize].position as usize;
        let whole = ir.bundles.get(body.start..end).unwrap_or_default();
        if whole.iter().flat_map(|bundle| &bundle.operations).any(|inner| operation(&inner)) {
            return None;
        }
        let operations = || own.iter().flat_map(|bundle| &bundle.operations);
        let obstacles = [
            (!before.scheduled || !body.scheduled, "`.schedule` is off"),
            (count.is_none(), "nothing says how many iterations it has at most"),
            (
                before.end != body.start || end != body.end,
                "its body is not one block: it branches, calls or waits",
            ),
            (operations().any(Operation::redirects), "its body branches, calls or waits"),
            (
                !count.is_none_or(|count| (2..=u32::from(u16::MAX)).contains(&count.iterations().most())),
                "it has one iteration",
            ),
            (
                labels.contains(&head) || constant.is_some() && bounds.contains_key(&head),
                "a label or a bound stands at its start",
            ),
            (
                ir.loop_bounds.iter().any(|bound| bound.position == head && bound.total.is_some()),
                "its `.loop_bound` has a total, which two loops cannot share",
            ),
            (own.iter().any(Bundle::is_opaque), "a raw word is in its body"),
            (
                operations().any(|operation| operation.row().effect.drains()),
                "its body reads or clears the flags",
            ),
            (
                operations().any(|operation| operation.reads().iter().chain(&operation.dest).any(demanded)),
                "its body reads or writes a port with a demand",
            ),
        ];
        let of = ir.loops.iter().position(|of| of.head == head).map(|index| LoopId(index as u32));
        Some(match (obstacles.iter().find(|(stands, _)| *stands), count) {
            (None, Some(count)) => Ok(Candidate { entry, body, count, of }),
            (obstacle, _) => {
                let reason = obstacle.map_or("", |(_, reason)| *reason).to_owned();
                Err(PlainLoop { location: location(ir, body), reason })
            }
        })
    });
    let (mut candidates, mut plain) = (Vec::new(), Vec::new());
    for found in pairs {
        match found {
            Ok(candidate) => candidates.push(candidate),
            Err(one) => plain.push(one),
        }
    }
    (candidates, plain)
}

/// A loop iteration as a modulo scheduling problem.
struct Iteration {
    problem: LoopProblem,
    /// The bundle of each task.
    origins: Vec<usize>,
    inductions: Vec<Induction>,
}

/// Builds the problem of an iteration from two iterations one after the other: edges within the first, and edges to the second.
fn problem(
    ir: &Ir,
    fixed: &[Option<u32>],
    domains: &Domains,
    own: &[Bundle],
    of: Option<LoopId>,
) -> Iteration {
    let twice = [own, own].concat();
    let (Block { problem, origins }, far) =
        Block::iterations(ir, fixed, &twice, Some(domains), own.len(), of);
    let count = problem.tasks.len() / 2;
    let slowest = |edge: &Edge| {
        let operation = edge.latency_of?;
        problem.tasks[edge.from].operation(operation).filter_map(|usage| usage.writeback).max()
    };
    let edges = problem.edges.iter().filter(|edge| edge.from < count).map(|edge| {
        let iterations = u32::from(edge.to >= count);
        let distance = slowest(edge).unwrap_or(edge.distance);
        LoopEdge { edge: Edge { to: edge.to % count, distance, ..*edge }, iterations }
    });
    let far = far.into_iter().map(|(from, to, iterations)| {
        let edge = Edge { from, to, distance: 1, latency_of: None, demanded: false };
        LoopEdge { edge, iterations }
    });
    let mut edges: Vec<LoopEdge> = edges.chain(far).collect();
    let tasks = problem.tasks.into_iter().take(count).collect();
    let inductions = inductions(ir, fixed, own, &origins[..count]);
    let mut advanced = Vec::new();
    for induction in &inductions {
        let Induction { access, advance, .. } = *induction;
        edges.retain(|LoopEdge { edge: Edge { from, to, .. }, .. }| {
            (*from, *to) != (access, advance) && (*from, *to) != (advance, access)
        });
        let (least, most) = induction.advances();
        let edge = |from, to, distance| Edge { from, to, distance, latency_of: None, demanded: false };
        edges.push(LoopEdge { edge: edge(access, advance, 0), iterations: most as u32 });
        edges.push(LoopEdge { edge: edge(advance, access, 1), iterations: (1 - least) as u32 });
        let latency = latency(ir.machine, &own[origins[advance]].operations[0]);
        advanced.push(AdvancedAccess { access, advance, latency });
    }
    Iteration { problem: LoopProblem { tasks, edges, advanced }, origins, inductions }
}

/// Maximum number of times that a loop is entered while the enclosing loops run once.
fn entries(ir: &Ir, of: Option<LoopId>) -> u64 {
    let parent = |of: LoopId| ir.loops[of.0 as usize].parent;
    let around = std::iter::successors(of.and_then(parent), |of| parent(*of));
    around.map(|of| u64::from(ir.loops[of.0 as usize].iterations.most())).fold(1, u64::saturating_mul)
}

/// Pipelines a loop, if that makes it shorter. `accesses` are the program's; those before and after the kernel are appended.
fn one(
    ir: &Ir,
    fixed: &[Option<u32>],
    domains: &Domains,
    (number, candidate): (usize, Candidate),
    accesses: &mut Vec<ArrayAccess>,
    steps: &mut Steps,
) -> Option<Pipelined> {
    let own = &ir.bundles[candidate.body.start..candidate.body.end];
    let Iteration { problem, origins, inductions } = problem(ir, fixed, domains, own, candidate.of);
    if problem.tasks.is_empty() {
        return None;
    }
    let machine = ir.machine;
    let units = machine.slots.iter().map(|slot| slot.units.len()).sum();
    let bound = problem.bound(machine.slots.len(), units, steps);
    let least = bound.cycles();
    let (count, most) = (candidate.count.iterations(), candidate.count.iterations().most());
    let schedule = problem.schedule(least..=least + least / SPARE.0 + SPARE.1, most, steps)?;
    let stages = schedule.stages();
    // Without pipelining, each iteration takes at least the length of the body scheduled alone.
    let alone = solve::solve(&Block::new(ir, fixed, own, Some(domains)).problem, 0);
    steps.add(alone.steps);
    let alone = alone.length;
    let entry = match candidate.count {
        Count::Exactly(_) => 0,
        Count::AtMost(..) => LoopChoice::cycles(machine),
    };
    let pays = |count: u32| schedule.cycles(count) + u64::from(entry) < u64::from(count) * u64::from(alone);
    // A variable count must also gain halfway between its largest value and the number of stages.
    if stages < 2 || !pays(most) || entry > 0 && !pays(most.midpoint(stages)) {
        return None;
    }
    let of = candidate.of;
    let (origins, inductions) = (&origins, &inductions);
    let mut parts = Parts { own, origins, inductions, problem: &problem, schedule: &schedule, of, accesses };
    // The iteration of a stage in a block: the first blocks begin iterations, the last ones end them.
    let begun = |block: u32| {
        move |stage: u32| block.checked_sub(stage).map(i64::from).map(PeeledIteration::FromFirst)
    };
    let ended = |block: u32| {
        move |stage: u32| {
            (stage >= block).then(|| PeeledIteration::FromEnd(1 + i64::from(stage) - i64::from(block)))
        }
    };
    let mut blocks = |mut blocks: Range<u32>, ended_not_begun: bool| {
        blocks.try_fold(Vec::new(), |mut bundles, block| {
            bundles.extend(match ended_not_begun {
                true => parts.block(count, ended(block))?,
                false => parts.block(count, begun(block))?,
            });
            Some(bundles)
        })
    };
    let (prologue, epilogue) = (blocks(0..stages - 1, false)?, blocks(1..stages, true)?);
    let kernel = parts.kernel();
    let (interval, alone) = (u64::from(schedule.interval), u64::from(alone));
    let saved = (u64::from(most) * alone).saturating_sub(schedule.cycles(most) + u64::from(entry));
    let twice = if count.is_exact() { 0 } else { alone };
    let report = LoopReport {
        saved: saved.saturating_mul(entries(ir, candidate.of)),
        bundles: interval * u64::from(stages) + twice,
        location: location(ir, candidate.body),
        number,
        operations: problem.tasks.len() as u32,
        address: BundleAddress::RESET,
        iterations: count,
        stages,
        interval: schedule.interval,
        bound,
    };
    Some(Pipelined { candidate, prologue, kernel, epilogue, report })
}

/// Moves every write of a kernel's register to the slot from which the kernel writes it.
fn settle_slots(ir: &mut Ir, kernel: &[Bundle]) {
    let operations = kernel.iter().flat_map(|bundle| &bundle.operations);
    let slots: HashMap<RegisterId, (Slots, Option<SlotIndex>)> = operations
        .filter_map(|operation| Some((operation.dest?, (operation.slots, operation.slot))))
        .collect();
    for operation in ir.bundles.iter_mut().flat_map(|bundle| &mut bundle.operations) {
        if let Some((able, slot)) = operation.dest.and_then(|dest| slots.get(&dest)) {
            (operation.slots, operation.slot) = (*able, *slot);
        }
    }
}
