//! The scheduler: packs operations into bundles and orders them for the machine, from the specification alone.
//!
//! It works on one block at a time: a straight run of bundles that control enters only at its first and leaves only after
//! its last. What must keep its order is an edge between two operations (see [`Block`]); everything else may move.
//! `docs/scheduling.md` says what that means for who writes a program.

mod demand;
mod memory;
mod solve;

pub use crate::ir::DemandKind;
pub use demand::TimingReport;
pub use solve::Bound;

use crate::ir::runs;
use crate::ir::{Bundle, Ir, Operation, RegisterId, RegisterKind};
use crate::report::diag::Sink;
use demand::Demands;
use memory::Memory;
use smallvec::{SmallVec, smallvec};
use solve::{Edge, Part, Problem, Task};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use takt_isa::program::{Location, Space};
use takt_isa::{BundleAddress, Effect, Function, Machine, SlotIndex};

/// How long the scheduler searches unless told otherwise.
pub const DEFAULT_EFFORT: u32 = 20;

/// What became of a block.
#[derive(Clone, Debug)]
pub struct BlockReport {
    /// Where the block's first operation stands in the source.
    pub location: Option<Location>,
    /// The label at the block's start, if there is one.
    pub label: Option<String>,
    /// Address of its first bundle.
    pub address: BundleAddress,
    /// Operations.
    pub operations: u32,
    /// Bundles that they are packed into.
    pub bundles: u32,
    /// Cycles from the issue of its first bundle to that of its last, both included, if nothing is pending at its start.
    pub cycles: u32,
    /// What no schedule can be shorter than.
    pub bound: Bound,
}

/// What became of a program.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Of each block that was scheduled.
    pub blocks: Vec<BlockReport>,
    /// Of each demand on ports.
    pub timing: Vec<TimingReport>,
}

/// Schedules every block of bundles that ask for it ([`Bundle::scheduled`]), and checks what is demanded of ports.
pub fn schedule(ir: &mut Ir, effort: u32, sink: &mut Sink) -> Report {
    let fixed = runs::jumps_to_numbers(ir);
    if fixed && ir.demands.is_empty() {
        return Report::default();
    }
    let fixed_registers = memory::fixed(ir);
    let runs = runs::runs(ir);
    let demands = demand::assign(ir, &runs, sink);
    let mut report = Report::default();
    let mut bundles: Vec<Bundle> = Vec::with_capacity(ir.bundles.len());
    // New address of each block's start, by its old one.
    let mut moved = BTreeMap::new();
    for (run, demands) in runs.iter().zip(&demands) {
        let address = bundles.len() as u32;
        moved.insert(run.start as u32, address);
        let old = &ir.bundles[run.start..run.end];
        let scheduled = run.scheduled && old.len() >= 2 && !fixed;
        if !scheduled && demands.is_empty() {
            bundles.extend_from_slice(old);
            continue;
        }
        let demands = Demands::new(ir, old, demands);
        let mut block = Block::new(ir, &fixed_registers, old, scheduled);
        if !scheduled {
            let start = block.problem.as_written();
            report.timing.extend(demands.check(&block, &start, None, scheduled, sink));
            bundles.extend_from_slice(old);
            continue;
        }
        if !demands.apply(&mut block, sink) {
            bundles.extend_from_slice(old);
            continue;
        }
        let solution = solve::solve(&block.problem, effort);
        report.timing.extend(demands.check(&block, &solution.start, solution.window, scheduled, sink));
        let packed = block.pack(old, &solution.start);
        report.blocks.push(BlockReport {
            location: old.first().and_then(|bundle| bundle.operations.first()?.location),
            label: label_at(ir, run.start as u32),
            address: BundleAddress::new(address),
            operations: block.problem.tasks.iter().map(|task| task.parts.len() as u32).sum(),
            bundles: packed.len() as u32,
            cycles: solution.length,
            bound: solution.bound,
        });
        bundles.extend(packed);
    }
    let end = bundles.len() as u32;
    let relocate = |position: u32| moved.get(&position).copied().unwrap_or(end);
    ir.period = relocate(ir.period);
    for label in ir.labels.iter_mut().filter(|label| label.space == Space::Code) {
        label.position = relocate(label.position);
    }
    for bound in &mut ir.loop_bounds {
        bound.position = relocate(bound.position);
    }
    ir.bundles = bundles;
    report
}

/// The cycle in which each bundle of a straight run issues, if the run stays as it is written. The first is 0.
pub(crate) fn as_written(ir: &Ir, bundles: &[Bundle]) -> Vec<u32> {
    Block::new(ir, &memory::fixed(ir), bundles, false).problem.as_written()
}

/// Cycles from an operation's issue to the earliest one of an operation that reads its result.
pub(crate) fn latency(machine: &Machine, operation: &Operation) -> u32 {
    part(machine, operation).writes.unwrap_or(0)
}

fn label_at(ir: &Ir, position: u32) -> Option<String> {
    ir.labels
        .iter()
        .find(|label| label.space == Space::Code && label.position == position)
        .map(|label| label.name.clone())
}

/// Which unit of a machine an operation uses, by slot.
fn part(machine: &Machine, operation: &Operation) -> Part {
    let function = operation.row().function;
    let slot = operation.slot.unwrap_or(SlotIndex::FIRST).index();
    let before: usize = machine.slots[..slot].iter().map(|slot| slot.units.len()).sum();
    match machine.slots[slot].unit_for(function).filter(|_| function != Function::Idle) {
        Some(unit) => {
            let row = &machine.slots[slot].units[unit];
            let writes = operation.dest.map(|_| row.latency);
            Part { slot, unit: Some(before + unit), interval: row.interval, writes }
        }
        None => Part { slot, unit: None, interval: 1, writes: None },
    }
}

/// The order that a block's operations must keep.
///
/// - A value is computed before it is read: by the unit's latency.
/// - A register is read before it is overwritten: in the same cycle at the latest, for a bundle reads before it writes.
/// - Values for one register, ports included, are written in the source's order: the earlier is written back when the later issues.
/// - Loads and stores that may touch the same word keep their order, except loads among loads.
/// - A load or store whose address is not known may fault, and what was on the output ports before must be the same: outputs
///   written before it in the source issue before it, outputs written after it not before it.
/// - What redirects control comes last; what drains comes when all is written.
struct Block {
    problem: Problem,
    /// For each task the bundle that it is.
    origins: Vec<usize>,
}

impl Block {
    /// The problem of a run of bundles. Fillers, which a schedule has no use for, are tasks only where it is as written.
    /// `fixed` holds the bits of registers that never change ([`memory::fixed`]).
    fn new(ir: &Ir, fixed: &[Option<u32>], bundles: &[Bundle], scheduled: bool) -> Block {
        let machine = ir.machine;
        let is_output = |id: RegisterId| ir.register(id).kind == RegisterKind::Output;
        let mut problem = Problem {
            slots: machine.slots.len(),
            units: machine.slots.iter().map(|slot| slot.units.len()).sum(),
            ..Problem::default()
        };
        let mut origins = Vec::new();
        // For each register: the task of its last value with that value's latency, and the tasks that read it since.
        let mut values: HashMap<RegisterId, (usize, u32)> = HashMap::new();
        let mut readers: HashMap<RegisterId, Vec<usize>> = HashMap::new();
        let mut memory = Memory::new(ir, fixed);
        // Loads and stores that may fault; for each output port the task of its last write, and how many of those precede it.
        let mut faults: Vec<usize> = Vec::new();
        let mut outputs: BTreeMap<RegisterId, (usize, usize)> = BTreeMap::new();
        for (b, bundle) in bundles.iter().enumerate() {
            let effects = || bundle.operations.iter().map(|operation| operation.row().effect);
            if scheduled && !bundle.explicit && effects().all(|effect| effect == Effect::Nothing) {
                continue;
            }
            let to = problem.tasks.len();
            origins.push(b);
            let parts: Vec<Part> =
                bundle.operations.iter().map(|operation| part(machine, operation)).collect();
            let mut after = |from: usize, distance: u32| {
                if from != to {
                    problem.edges.push(Edge { from, to, distance, demanded: false });
                }
            };
            for register in bundle.operations.iter().flat_map(Operation::reads) {
                if let Some(&(from, latency)) = values.get(register) {
                    after(from, latency);
                }
                readers.entry(*register).or_default().push(to);
            }
            for access in
                bundle.operations.iter().filter_map(|operation| memory.access(operation)).collect::<Vec<_>>()
            {
                for from in memory.follow(to, access) {
                    after(from, 1);
                }
                if access.may_fault {
                    for &(from, _) in outputs.values() {
                        after(from, 1);
                    }
                    faults.push(to);
                }
            }
            memory.write(&bundle.operations);
            let mut output = None;
            for (operation, part) in bundle.operations.iter().zip(&parts) {
                let Some(dest) = operation.dest else { continue };
                for from in readers.remove(&dest).unwrap_or_default() {
                    after(from, 0);
                }
                if let Some((from, latency)) = values.insert(dest, (to, part.writes.unwrap_or(0))) {
                    after(from, latency);
                }
                if is_output(dest) {
                    output = output.max(part.writes);
                    // What precedes the port's write before this one precedes this one.
                    let known = outputs.insert(dest, (to, faults.len())).map_or(0, |(_, known)| known);
                    for &from in &faults[known..] {
                        after(from, 0);
                    }
                }
            }
            if effects().any(Effect::redirects) {
                let drains = effects().any(Effect::drains);
                for from in 0..to {
                    let written = problem.tasks[from].parts.iter().filter_map(|part| part.writes).max();
                    after(from, written.filter(|_| drains).unwrap_or(0));
                }
            }
            problem.tasks.push(Task { parts, output, ..Task::default() });
        }
        Block { problem, origins }
    }

    /// The bundles of a schedule: tasks that issue in one cycle become one bundle. A gap that only a demand makes is filled, for
    /// the machine would not wait.
    fn pack(&self, old: &[Bundle], start: &[u32]) -> Vec<Bundle> {
        let mut by_cycle: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (&origin, &cycle) in self.origins.iter().zip(start) {
            by_cycle.entry(cycle).or_default().push(origin);
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
                members.iter().flat_map(|&b| old[b].operations.iter().copied()).collect();
            operations.sort_by_key(|operation| operation.slot);
            if let Some(first) = operations.first().filter(|_| held.contains(&cycle)) {
                let filler = Bundle { operations: smallvec![first.idle()], explicit: false, scheduled: true };
                bundles.extend(std::iter::repeat_n(filler, (cycle - next) as usize));
            }
            let explicit = members.iter().any(|&b| old[b].explicit);
            bundles.push(Bundle { operations, explicit, scheduled: true });
            next = cycle + 1;
        }
        bundles
    }
}
