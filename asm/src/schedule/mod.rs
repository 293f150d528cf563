// SPDX-License-Identifier: MIT OR Apache-2.0
//! Scheduler: packs operations into bundles and orders them, from the machine's tables and [`takt_isa::timing`]'s reservation
//! tables alone.
//!
//! The scheduler works on one basic block at a time: a straight run of bundles that control enters only at its first and leaves
//! only after its last. Dependences are edges between two tasks (see [`Block`]); everything else may move. List scheduling in
//! forward and backward passes ([`solve`]) is followed by an exact search ([`exact`]). `docs/scheduling.md` explains it to
//! programmers.

mod bound;
mod budget;
mod demand;
mod domains;
mod exact;
mod graph;
mod list;
mod memory;
mod modulo;
mod pipeline;
mod problem;
mod random;
mod reservations;
mod solve;
mod time_windows;

pub use crate::ir::DemandKind;
pub use bound::{Bound, Resources, SharedBound};
pub use budget::{Budget, most_steps};
pub use demand::TimingReport;
pub(crate) use memory::touched;
pub use modulo::IntervalBound;
pub use pipeline::{LoopReport, PlainLoop};

use crate::ir::arrays::LoopId;
use crate::ir::matching;
use crate::ir::runs;
use crate::ir::{Bundle, Ir, Operation, RegisterId, RegisterKind};
use demand::Demands;
use domains::Domains;
use list::Plan;
use memory::Memory;
use problem::{Edge, Problem, Task};
use smallvec::{SmallVec, smallvec};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use takt_diagnostics::diag::Sink;
use takt_isa::program::{Location, Space};
use takt_isa::timing::Reservation;
use takt_isa::{BundleAddress, Effect, Machine, SlotIndex, Slots};

/// The default effort of the search.
pub const DEFAULT_EFFORT: u32 = 20;

/// Report of a scheduled block.
#[derive(Clone, Debug)]
pub struct BlockReport {
    /// The source line of the block's first operation.
    pub location: Option<Location>,
    /// The label at the block's start, if there is one.
    pub label: Option<String>,
    /// Address of the first bundle.
    pub address: BundleAddress,
    /// Number of operations in the block.
    pub operations: u32,
    /// Number of bundles that the operations are packed into.
    pub bundles: u32,
    /// Cycles from the issue of the first bundle to the issue of the last, both included, if nothing is pending at the start.
    pub cycles: u32,
    /// Lower bound of the length.
    pub bound: Bound,
}

/// Report of a scheduled program.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Blocks that were scheduled.
    pub blocks: Vec<BlockReport>,
    /// Loops that were pipelined.
    pub loops: Vec<LoopReport>,
    /// Innermost loops that were not pipelined, with reasons.
    pub plain_loops: Vec<PlainLoop>,
    /// Times at which the demands on ports are met.
    pub timing: Vec<TimingReport>,
}

/// Freedom of a schedule to leave source order. Staying near it lowers the register pressure, and may lengthen the schedule.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Order {
    /// Operations may leave source order freely.
    Free,
    /// An operation does not issue before another that precedes it by this many bundles or more.
    Near(usize),
    /// The source's order: bundles stay as they are written, on the slots that they have without a scheduler.
    Written,
}

/// Schedules every block of bundles that ask for it ([`Bundle::scheduled`]), and checks the demands on ports.
pub fn schedule(ir: &mut Ir, budget: &mut Budget, order: Order, sink: &mut Sink) -> Report {
    schedule_without(ir, budget, order, &[], sink)
}

/// [`schedule`], with the loops of these numbers ([`LoopReport::number`]) left as they are written.
pub fn schedule_without(
    ir: &mut Ir,
    budget: &mut Budget,
    order: Order,
    without: &[usize],
    sink: &mut Sink,
) -> Report {
    if ir.demands.is_empty() && !ir.scheduled {
        return Report::default();
    }
    let fixed = runs::jumps_to_numbers(ir);
    if fixed && ir.demands.is_empty() {
        return Report::default();
    }
    let (mut loops, plain_loops) = match order {
        Order::Free if !fixed && ir.scheduled => pipeline::pipeline(ir, without, budget),
        _ => Default::default(),
    };
    let fixed_registers = memory::fixed(ir);
    let runs = runs::runs(ir);
    let demands = demand::assign(ir, &runs, sink);
    let mut domains = Domains::new(ir, &runs, fixed);
    let mut report = Report { plain_loops, ..Report::default() };
    let mut bundles: Vec<Bundle> = Vec::with_capacity(ir.bundles.len());
    // New address of each block's start, by its old one.
    let mut moved = BTreeMap::new();
    let is_scheduled = |run: &runs::Run| run.scheduled && run.end - run.start >= 2 && !fixed;
    let mut left = runs.iter().filter(|run| is_scheduled(run)).count();
    for (run, demands) in runs.iter().zip(&demands) {
        let address = bundles.len() as u32;
        moved.insert(run.start as u32, address);
        let old = &ir.bundles[run.start..run.end];
        let scheduled = is_scheduled(run);
        if !scheduled && demands.is_empty() {
            bundles.extend_from_slice(old);
            continue;
        }
        let demands = Demands::new(ir, old, demands);
        let moves = scheduled && order != Order::Written;
        let mut block = Block::new(ir, &fixed_registers, old, moves.then_some(&domains));
        if !moves {
            let start = block.problem.as_written();
            report.timing.extend(demands.check(&block, &start, None, scheduled && moves, sink));
            if scheduled {
                let cycles = start.last().map_or(0, |last| last + 1);
                report.blocks.push(block.report(ir, *run, address, old.len(), cycles, block.problem.bound()));
            }
            bundles.extend_from_slice(old);
            continue;
        }
        if !demands.apply(&mut block, sink) {
            bundles.extend_from_slice(old);
            continue;
        }
        let bound = match order {
            Order::Near(reach) => Some(block.problem.keep_near(reach)),
            Order::Free | Order::Written => None,
        };
        let solution = solve::solve(&block.problem, budget.of_block(left));
        budget.take_for_block(solution.steps);
        left = left.saturating_sub(1);
        report.timing.extend(demands.check(&block, &solution.plan.start, solution.window, scheduled, sink));
        let packed = block.pack(old, &solution.plan);
        domains.settle(&packed);
        let bound = bound.unwrap_or(solution.bound);
        report.blocks.push(block.report(ir, *run, address, packed.len(), solution.length, bound));
        bundles.extend(packed);
    }
    let end = bundles.len() as u32;
    for pipelined in &mut loops {
        let address = moved.get(&pipelined.address.get()).copied().unwrap_or(end);
        pipelined.address = BundleAddress::new(address);
    }
    report.loops = loops;
    ir.replace_bundles(bundles, |position: u32| moved.get(&position).copied().unwrap_or(end));
    report
}

/// The cycle in which each bundle of a straight run issues in the order written. The first is 0.
pub(crate) fn as_written(ir: &Ir, bundles: &[Bundle]) -> Vec<u32> {
    Block::new(ir, &memory::fixed(ir), bundles, None).problem.as_written()
}

/// Cycles from an operation's issue to the earliest issue of an operation that reads its result.
pub(crate) fn latency(machine: &Machine, operation: &Operation) -> u32 {
    reservation(machine, operation, operation.slot).writeback.unwrap_or(0)
}

fn label_at(ir: &Ir, position: u32) -> Option<String> {
    ir.labels
        .iter()
        .find(|label| label.space == Space::Code && label.position == position)
        .map(|label| label.name.clone())
}

/// The reservation table of an operation on a slot; an idle one may have none, and takes the first.
fn reservation(machine: &Machine, operation: &Operation, slot: Option<SlotIndex>) -> Reservation {
    let slot = slot.unwrap_or(SlotIndex::FIRST);
    Reservation::new(machine, slot, operation.row().function, operation.dest.is_some())
}

/// A problem without tasks.
fn empty_problem(machine: &Machine) -> Problem {
    Problem {
        slots: machine.slots.len(),
        units: machine.slots.iter().map(|slot| slot.units.len()).sum(),
        ..Problem::default()
    }
}

/// Task of a bundle, with the reservations of each choice of slots.
fn task(ir: &Ir, bundle: &Bundle, domains: Option<&Domains>) -> Task {
    Task {
        operations: bundle.operations.len(),
        uses: choices(ir, bundle, domains)
            .iter()
            .flat_map(|slots| bundle.operations.iter().zip(slots))
            .map(|(operation, slot)| reservation(ir.machine, operation, *slot))
            .collect(),
        ..Task::default()
    }
}

/// Event of an earlier task for which a task waits.
#[derive(Clone, Copy)]
enum Wait {
    /// A number of cycles after its issue.
    Cycles(u32),
    /// Writeback of one of its operations.
    Written(usize),
}

/// The order that a block's operations must keep.
///
/// - A value is computed before it is read: by the unit's latency.
/// - A register is read before it is overwritten: in the same cycle at the latest, for a bundle reads before it writes.
/// - Values for one register, ports included, are written in the source's order: the earlier is written back when the later issues.
/// - Loads and stores that may touch the same word keep their order, except loads among loads.
/// - A load or store whose address is not known may fault, and the output ports must then show the same values as in source order:
///   outputs written before it in the source issue before it, outputs written after it not before it.
/// - Operations that redirect control come last; operations that drain issue after all writebacks.
struct Block {
    problem: Problem,
    /// The bundle of each task.
    origins: Vec<usize>,
}

impl Block {
    /// The problem of a run of bundles: as written; or with `domains` (the banks in which registers may lie) for a schedule, which
    /// drops fillers. `fixed` holds the bits of registers that never change ([`memory::fixed`]).
    fn new(ir: &Ir, fixed: &[Option<u32>], bundles: &[Bundle], domains: Option<&Domains>) -> Block {
        Block::iterations(ir, fixed, bundles, domains, usize::MAX, None).0
    }

    /// The problem of two iterations of a loop, where the second begins with the bundle `second`; `of` is the loop if the source has it by
    /// `.for`. Also returns the pairs of memory accesses that must keep their order over more than one iteration ([`Memory::far`]).
    fn iterations(
        ir: &Ir,
        fixed: &[Option<u32>],
        bundles: &[Bundle],
        domains: Option<&Domains>,
        second: usize,
        of: Option<LoopId>,
    ) -> (Block, Vec<(usize, usize, u32)>) {
        let is_output = |id: RegisterId| ir.register(id).kind == RegisterKind::Output;
        let mut problem = empty_problem(ir.machine);
        let mut origins = Vec::new();
        // For each register: the task and the operation of its last value, and the tasks that read it since.
        let mut values: HashMap<RegisterId, (usize, usize)> = HashMap::new();
        let mut readers: HashMap<RegisterId, Vec<usize>> = HashMap::new();
        let mut memory = Memory::new(ir, fixed);
        // Loads and stores that may fault; for each output port the task of its last write, and the number of such accesses
        // before it.
        let mut faults: Vec<usize> = Vec::new();
        let mut outputs: BTreeMap<RegisterId, (usize, usize)> = BTreeMap::new();
        for (b, bundle) in bundles.iter().enumerate() {
            if b == second {
                memory.start_iteration(of);
            }
            let effects = || bundle.operations.iter().map(|operation| operation.row().effect);
            if domains.is_some() && !bundle.explicit && effects().all(|effect| effect == Effect::Nothing) {
                continue;
            }
            let to = problem.tasks.len();
            origins.push(b);
            let mut task = task(ir, bundle, domains);
            let Problem { tasks, edges, .. } = &mut problem;
            let mut edge = |from: usize, distance: u32, latency_of: Option<usize>| {
                if from != to {
                    edges.push(Edge { from, to, distance, latency_of, demanded: false });
                }
            };
            let mut after = |from: usize, wait: Wait| match (wait, tasks.get(from)) {
                (Wait::Written(operation), Some(task)) => {
                    let varies = Some(operation).filter(|operation| task.varies(*operation));
                    edge(from, task.written(operation).unwrap_or(0), varies);
                }
                // The value comes from the bundle itself.
                (Wait::Written(_), None) => {}
                (Wait::Cycles(distance), _) => edge(from, distance, None),
            };
            for register in bundle.operations.iter().flat_map(Operation::reads) {
                if let Some(&(from, operation)) = values.get(register) {
                    after(from, Wait::Written(operation));
                }
                readers.entry(*register).or_default().push(to);
            }
            for access in
                bundle.operations.iter().filter_map(|operation| memory.access(operation)).collect::<Vec<_>>()
            {
                let may_fault = access.may_fault;
                for from in memory.follow(to, access) {
                    after(from, Wait::Cycles(1));
                }
                if may_fault {
                    for &(from, _) in outputs.values() {
                        after(from, Wait::Cycles(1));
                    }
                    faults.push(to);
                }
            }
            memory.write(&bundle.operations);
            for (index, operation) in bundle.operations.iter().enumerate() {
                let Some(dest) = operation.dest else { continue };
                for from in readers.remove(&dest).unwrap_or_default() {
                    after(from, Wait::Cycles(0));
                }
                if let Some((from, operation)) = values.insert(dest, (to, index)) {
                    after(from, Wait::Written(operation));
                }
                if is_output(dest) {
                    task.output = task.output.max(task.written(index));
                    // Accesses before the port's previous write precede this one transitively.
                    let known = outputs.insert(dest, (to, faults.len())).map_or(0, |(_, known)| known);
                    for &from in &faults[known..] {
                        after(from, Wait::Cycles(0));
                    }
                }
            }
            if effects().any(Effect::redirects) {
                let drains = effects().any(Effect::drains);
                for (from, earlier) in tasks.iter().enumerate() {
                    if drains {
                        (0..earlier.operations).for_each(|index| after(from, Wait::Written(index)));
                    } else {
                        after(from, Wait::Cycles(0));
                    }
                }
            }
            problem.tasks.push(task);
        }
        let far = if second < bundles.len() { memory.far(problem.tasks.len() / 2, of) } else { Vec::new() };
        (Block { problem, origins }, far)
    }

    /// Report of the block, whose run now begins at `address`.
    fn report(
        &self,
        ir: &Ir,
        run: runs::Run,
        address: u32,
        bundles: usize,
        cycles: u32,
        bound: Bound,
    ) -> BlockReport {
        let first = ir.bundles[run.start..run.end].first();
        BlockReport {
            location: first.and_then(|bundle| ir.location(bundle.operations.first()?)),
            label: label_at(ir, run.start as u32),
            address: BundleAddress::new(address),
            operations: self.problem.tasks.iter().map(|task| task.operations as u32).sum(),
            bundles: bundles as u32,
            cycles,
            bound,
        }
    }

    /// The bundles of a schedule: tasks that issue in one cycle become one bundle. A gap that only a demand causes is filled
    /// with idle bundles, since the machine would not wait.
    fn pack(&self, old: &[Bundle], plan: &Plan) -> Vec<Bundle> {
        let start = &plan.start;
        let mut by_cycle: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (task, &cycle) in start.iter().enumerate() {
            by_cycle.entry(cycle).or_default().push(task);
        }
        let demanded = self.problem.edges.iter().filter(|edge| edge.demanded);
        let held: BTreeSet<u32> = demanded
            .filter(|edge| start[edge.to] == start[edge.from] + edge.distance)
            .map(|edge| start[edge.to])
            .collect();
        let mut bundles = Vec::with_capacity(by_cycle.len());
        let mut next = 0;
        for (cycle, members) in by_cycle {
            let mut operations: SmallVec<[Operation; 1]> =
                members.iter().flat_map(|&task| self.placed(old, plan, task)).collect();
            operations.sort_by_key(|operation| operation.slot);
            if let Some(first) = operations.first().filter(|_| held.contains(&cycle)) {
                let filler = Bundle { operations: smallvec![first.idle()], explicit: false, scheduled: true };
                bundles.extend(std::iter::repeat_n(filler, (cycle - next) as usize));
            }
            let explicit = members.iter().any(|&task| old[self.origins[task]].explicit);
            bundles.push(Bundle { operations, explicit, scheduled: true });
            next = cycle + 1;
        }
        bundles
    }

    /// The operations of a task, on their slots.
    fn placed<'b>(
        &self,
        old: &'b [Bundle],
        plan: &Plan,
        task: usize,
    ) -> impl Iterator<Item = Operation> + use<'_, 'b> {
        let uses = self.problem.tasks[task].choice(plan.choice[task]);
        old[self.origins[task]].operations.iter().zip(uses).map(|(operation, usage)| {
            let slot = operation.slot.map(|_| usage.slot);
            Operation { slot, ..*operation }
        })
    }
}

/// Limit on the choices of slots that the scheduler examines for a bundle.
const CHOICES: usize = 120;

/// The choices of slots for the operations of a bundle, the current one first; without domains, only the current one.
fn choices(ir: &Ir, bundle: &Bundle, domains: Option<&Domains>) -> Vec<Vec<Option<SlotIndex>>> {
    let present: Vec<Option<SlotIndex>> = bundle.operations.iter().map(|operation| operation.slot).collect();
    let Some(domains) = domains else { return vec![present] };
    let placed = || bundle.operations.iter().filter(|operation| operation.slot.is_some());
    let sets: Vec<Slots> = placed().map(|operation| domains.able(ir, operation)).collect();
    if sets.iter().copied().eq(present.iter().flatten().map(|slot| Slots::of(*slot))) {
        return vec![present];
    }
    let mut all = Vec::new();
    for slots in matching::all(&sets, CHOICES) {
        let mut slots = slots.into_iter();
        let choice: Vec<Option<SlotIndex>> =
            present.iter().map(|slot| slot.and_then(|_| slots.next())).collect();
        let first = if choice == present { 0 } else { all.len() };
        all.insert(first, choice);
    }
    if all.is_empty() { vec![present] } else { all }
}
