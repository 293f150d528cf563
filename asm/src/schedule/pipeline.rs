// SPDX-License-Identifier: MIT OR Apache-2.0
//! Software pipelining of counted loops: a loop whose body is one block begins an iteration before the one before has ended.
//!
//! [`modulo`](super::modulo) finds the cycles of an iteration's operations. The kernel, one interval long, then holds operations of
//! several iterations at once. What precedes its first run, the prologue, goes before `loop`; what follows its last, the
//! epilogue, behind the body's end. There both are parts of the blocks around the loop and are scheduled with them.
//!
//! Values that do not outlive their iteration get registers of their own first ([`rename`]). The next iteration writes a register after
//! this one has read it, which is one more precedence: no value lives longer than an interval.

use super::domains::Domains;
use super::modulo::{Advanced, IntervalBound, LoopEdge, LoopProblem, ModuloSchedule};
use super::problem::Edge;
use super::{Block, latency, memory, solve};
use crate::ir::arrays::{AccessId, ArrayAccess, LoopId};
use crate::ir::runs::{self, Run};
use crate::ir::{
    Bundle, Constant, Ir, Operation, RegisterId, RegisterKind, Version, VirtualRegister, numbered,
};
use smallvec::SmallVec;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;
use takt_isa::program::{Location, Space};
use takt_isa::shape::Field;
use takt_isa::{BundleAddress, Effect, SlotIndex, Slots, Type};

/// Advances of an induction register that an access may be ahead of, or behind.
const AHEAD: i64 = 8;

/// Beyond the bound, so many intervals are tried: an eighth of it and a few.
const SPARE: (u32, u32) = (8, 4);

/// Report of a pipelined loop.
#[derive(Clone, Debug)]
pub struct LoopReport {
    /// Its number among the loops that may be pipelined.
    pub number: usize,
    /// Operations of its body.
    pub operations: u32,
    /// The source line of the body's first operation.
    pub location: Option<Location>,
    /// The address of the kernel.
    pub address: BundleAddress,
    /// Its iterations, each time that it is entered.
    pub iterations: u32,
    /// Iterations that are under way at a time.
    pub stages: u32,
    /// Cycles from the beginning of one iteration to that of the next.
    pub interval: u32,
    /// The lower bounds of the interval.
    pub bound: IntervalBound,
}

/// A counted loop around no other whose iterations are executed one after the other, as they are written.
#[derive(Clone, Debug)]
pub struct PlainLoop {
    /// The source line of the body's first operation.
    pub location: Option<Location>,
    /// The reason, a clause.
    pub reason: String,
}

/// A loop that may be pipelined: its body is one block.
struct Candidate {
    /// The bundle that holds `loop`.
    entry: usize,
    body: Run,
    count: u32,
    /// The loop that the source has there.
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

/// Pipelines every loop for which it pays. The kernels are not scheduled again; the blocks around them are.
pub(super) fn pipeline(ir: &mut Ir, without: &[usize]) -> (Vec<LoopReport>, Vec<PlainLoop>) {
    if !ir.operations().any(|operation| operation.row().effect == Effect::Loop) {
        return (Vec::new(), Vec::new());
    }
    let runs = runs::runs(ir);
    let fixed = memory::fixed(ir);
    let (candidates, mut plain) = candidates(ir, &runs, &fixed);
    candidates.iter().for_each(|candidate| rename(ir, candidate.body));
    let fixed = memory::fixed(ir);
    let mut accesses = ir.accesses.clone();
    let mut pipelined: Vec<Pipelined> = Vec::new();
    for (number, candidate) in candidates.into_iter().enumerate() {
        if without.contains(&number) {
            continue;
        }
        let domains = Domains::new(ir, &runs, false);
        let location = location(ir, candidate.body);
        let Some(one) = one(ir, &fixed, &domains, (number, candidate), &mut accesses) else {
            let reason = "no schedule with overlapping iterations is shorter".to_owned();
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
    (rewrite(ir, pipelined), plain)
}

/// The source line of a body's first operation.
fn location(ir: &Ir, body: Run) -> Option<Location> {
    let operations = ir.bundles[body.start..body.end].iter().flat_map(|bundle| &bundle.operations);
    operations.into_iter().find_map(|operation| ir.location(operation))
}

/// The loops with a constant count whose body is one block that the scheduler may move, and in which no port has a demand; and the others
/// around no loop.
fn candidates(ir: &Ir, runs: &[Run], fixed: &[Option<u32>]) -> (Vec<Candidate>, Vec<PlainLoop>) {
    let demanded =
        |id: &RegisterId| ir.demands.iter().flat_map(|demand| &demand.ports).any(|(port, _)| port == id);
    let heads: Vec<u32> = ir.loop_bounds.iter().map(|bound| bound.position).collect();
    let labels: Vec<u32> =
        ir.labels.iter().filter(|label| label.space == Space::Code).map(|label| label.position).collect();
    let pairs = runs.windows(2).filter_map(|pair| {
        let ([before, body], entry) = (<[Run; 2]>::try_from(pair).ok()?, pair[0].end - 1);
        let operation = |operation: &&Operation| operation.row().effect == Effect::Loop;
        let last = ir.bundles[entry].operations.iter().find(operation)?;
        let label = last.target()?.ok()?;
        let head = body.start as u32;
        let count = fixed[last.sources[0].index()];
        let own = &ir.bundles[body.start..body.end];
        let end = ir.labels[label.0 as usize].position as usize;
        let whole = ir.bundles.get(body.start..end).unwrap_or_default();
        if whole.iter().flat_map(|bundle| &bundle.operations).any(|inner| operation(&inner)) {
            return None;
        }
        let operations = || own.iter().flat_map(|bundle| &bundle.operations);
        let obstacles = [
            (!before.scheduled || !body.scheduled, "`.schedule` is off"),
            (count.is_none(), "its count is known at run time only"),
            (
                before.end != body.start || end != body.end,
                "its body is not one block: it branches, calls or waits",
            ),
            (operations().any(Operation::redirects), "its body branches, calls or waits"),
            (!count.is_none_or(|count| (2..=u32::from(u16::MAX)).contains(&count)), "it has one iteration"),
            (labels.contains(&head) || heads.contains(&head), "a label or a bound stands at its start"),
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

/// Gives each value of a body a register of its own, but for the last that is written to a name, which may be read after it. A name that
/// is an output, has a place or shares a bundle keeps all its values.
fn rename(ir: &mut Ir, body: Run) {
    let bundles = body.start..body.end;
    let mut writes: HashMap<RegisterId, Vec<usize>> = HashMap::new();
    for at in bundles.clone() {
        for dest in ir.bundles[at].operations.iter().filter_map(|operation| operation.dest) {
            writes.entry(dest).or_default().push(at);
        }
    }
    let mut several: Vec<(RegisterId, Vec<usize>)> =
        writes.into_iter().filter(|(_, writes)| writes.len() > 1).collect();
    several.sort_unstable();
    for (name, writes) in several {
        let register = ir.register(name);
        let is_plain = matches!(register.kind, RegisterKind::Plain | RegisterKind::State);
        let alone = writes.iter().all(|at| ir.bundles[*at].operations.len() == 1);
        if !is_plain || register.pinned.is_some() || !alone {
            continue;
        }
        for (number, span) in (1..).zip(writes.windows(2)) {
            let mut own =
                VirtualRegister { preset: None, kind: RegisterKind::Plain, ..ir.register(name).clone() };
            if !own.name.is_empty() {
                own.name = numbered(&own.name, &format!(".{number}"));
            }
            ir.registers.push(own);
            let own = RegisterId::new(ir.registers.len() - 1);
            let [first, last] = [span[0], span[1]];
            let (after, through) =
                (ir.bundles[first].operations[0].order, ir.bundles[last].operations[0].order);
            ir.versions.push(Version { name, register: own, after, through });
            ir.bundles[first].operations[0].dest = Some(own);
            // The operation that writes the next value still reads this one.
            for operation in ir.bundles[first + 1..=last].iter_mut().flat_map(|bundle| &mut bundle.operations)
            {
                let reads = operation.row().shape.sources();
                let sources = operation.sources[..reads].iter_mut().filter(|source| **source == name);
                sources.for_each(|source| *source = own);
            }
        }
    }
    ir.versions.sort_by_key(|version| version.after);
}

/// One iteration as a problem.
struct Iteration {
    problem: LoopProblem,
    /// The bundle of each task.
    origins: Vec<usize>,
    inductions: Vec<Induction>,
}

/// One iteration as a problem: the edges between two iterations, one after the other, tell those within one and those to the next.
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
        advanced.push(Advanced { access, advance, latency });
    }
    Iteration { problem: LoopProblem { tasks, edges, advanced }, origins, inductions }
}

/// A load or store whose address is an induction register and an offset.
#[derive(Clone, Copy, Debug)]
struct Induction {
    /// The task of the access, and that which advances the register.
    access: usize,
    advance: usize,
    /// The offset that the source has, and what is added to the register.
    offset: i64,
    step: i64,
    /// Advances of its own iteration that the access sees in the source: 1 if it follows, else 0.
    seen: i64,
}

impl Induction {
    /// The offset of an access that sees so many advances more than iterations have begun before its own.
    fn offset(&self, advances: i64) -> i64 {
        self.offset + self.step * (self.seen - advances)
    }

    /// The least and the most advances that it can see, that is, for which there is an offset.
    fn advances(&self) -> (i64, i64) {
        let fits =
            |advances: &i64| (0..=i64::from(Field::Offset.bits().max())).contains(&self.offset(*advances));
        let most = (self.seen..=self.seen + AHEAD).take_while(fits).last().unwrap_or(self.seen);
        let least = (self.seen - AHEAD..=self.seen).rev().take_while(fits).last().unwrap_or(self.seen);
        (least, most)
    }
}

/// The accesses of a body whose address is a register that one of its operations advances by a constant, and nothing else writes.
fn inductions(ir: &Ir, fixed: &[Option<u32>], own: &[Bundle], origins: &[usize]) -> Vec<Induction> {
    let single = |task: usize| match &own[origins[task]].operations[..] {
        [operation] => Some(operation),
        _ => None,
    };
    let dests = own.iter().flat_map(|bundle| &bundle.operations).filter_map(|operation| operation.dest);
    let mut writes: HashMap<RegisterId, u32> = HashMap::new();
    dests.for_each(|dest| *writes.entry(dest).or_default() += 1);
    let mut found = Vec::new();
    for advance in 0..origins.len() {
        let Some(operation) = single(advance) else { continue };
        let (Some(register), Some(step)) = (operation.dest, memory::step(operation, fixed)) else { continue };
        if operation.sources.contains(&register)
            && writes[&register] == 1
            && ir.register(register).pinned.is_none()
        {
            for access in 0..origins.len() {
                let Some(operation) = single(access) else { continue };
                let is_access = matches!(operation.row().effect, Effect::Load | Effect::Store);
                let is_address =
                    operation.sources[0] == register && !operation.sources[1..].contains(&register);
                if let (true, Constant::Value(offset)) = (is_access && is_address, operation.constant) {
                    let (offset, seen) = (i64::from(offset), i64::from(access > advance));
                    found.push(Induction { access, advance, offset, step, seen });
                }
            }
        }
    }
    found
}

/// Pipelines a loop, if that makes it shorter. `accesses` are the program's, to which those before and after the kernel are added.
fn one(
    ir: &Ir,
    fixed: &[Option<u32>],
    domains: &Domains,
    (number, candidate): (usize, Candidate),
    accesses: &mut Vec<ArrayAccess>,
) -> Option<Pipelined> {
    let own = &ir.bundles[candidate.body.start..candidate.body.end];
    let Iteration { problem, origins, inductions } = problem(ir, fixed, domains, own, candidate.of);
    if problem.tasks.is_empty() {
        return None;
    }
    let machine = ir.machine;
    let units = machine.slots.iter().map(|slot| slot.units.len()).sum();
    let bound = problem.bound(machine.slots.len(), units);
    let least = bound.cycles();
    let schedule = problem.schedule(least..=least + least / SPARE.0 + SPARE.1, candidate.count)?;
    let stages = schedule.stages();
    // One after the other, iterations take at least as long as each would by itself.
    let alone = solve::solve(&Block::new(ir, fixed, own, Some(domains)).problem, 0).length;
    if stages < 2 || schedule.cycles(candidate.count) >= u64::from(candidate.count) * u64::from(alone) {
        return None;
    }
    let of = candidate.of;
    let count = i64::from(candidate.count);
    let (origins, inductions) = (&origins, &inductions);
    let mut parts =
        Parts { own, origins, inductions, count, problem: &problem, schedule: &schedule, of, accesses };
    let last = i64::from(candidate.count) - 1;
    // The iteration of a stage in a block: the first blocks begin iterations, the last ones end them.
    let begun = |block: u32| move |stage: u32| block.checked_sub(stage).map(i64::from);
    let ended =
        |block: u32| move |stage: u32| (stage >= block).then(|| last - i64::from(stage) + i64::from(block));
    let mut blocks = |mut blocks: Range<u32>, ended_not_begun: bool| {
        blocks.try_fold(Vec::new(), |mut bundles, block| {
            bundles.extend(match ended_not_begun {
                true => parts.block(ended(block))?,
                false => parts.block(begun(block))?,
            });
            Some(bundles)
        })
    };
    let (prologue, epilogue) = (blocks(0..stages - 1, false)?, blocks(1..stages, true)?);
    let kernel = parts.kernel();
    let report = LoopReport {
        location: location(ir, candidate.body),
        number,
        operations: problem.tasks.len() as u32,
        address: BundleAddress::RESET,
        iterations: candidate.count,
        stages,
        interval: schedule.interval,
        bound,
    };
    Some(Pipelined { candidate, prologue, kernel, epilogue, report })
}

/// The operations of an iteration and their cycles.
struct Parts<'a> {
    own: &'a [Bundle],
    origins: &'a [usize],
    inductions: &'a [Induction],
    /// Iterations each time that the loop is entered.
    count: i64,
    problem: &'a LoopProblem,
    schedule: &'a ModuloSchedule,
    /// The loop that the source has there.
    of: Option<LoopId>,
    accesses: &'a mut Vec<ArrayAccess>,
}

impl Parts<'_> {
    /// The stage of a task: the number of intervals that have passed when it issues.
    fn stage(&self, task: usize) -> u32 {
        self.schedule.start[task] / self.schedule.interval
    }

    /// The offset of a task's access to memory by an induction register, in the kernel or, with its number, in an iteration before or after
    /// it, when not all advances have begun or some have ended; `None` if the task is no such access.
    fn offset(&self, task: usize, iteration: Option<i64>) -> Option<i64> {
        let induction = self.inductions.iter().find(|induction| induction.access == task)?;
        let start = |task: usize| i64::from(self.schedule.start[task]);
        let since = start(task) - start(induction.advance) - 1;
        let advances = since.div_euclid(i64::from(self.schedule.interval)) + 1;
        Some(induction.offset(match iteration {
            None => advances,
            Some(iteration) => (iteration + advances).clamp(0, self.count) - iteration,
        }))
    }

    /// Makes a task's operations those of one certain iteration of the loop. `None` if there is no such offset.
    fn settle(&mut self, task: usize, operations: &mut [Operation], iteration: i64) -> Option<()> {
        if let Some(offset) = self.offset(task, Some(iteration)) {
            let offset = u32::try_from(offset).ok().filter(|offset| *offset <= Field::Offset.bits().max())?;
            operations[0].constant = Constant::Value(offset);
        }
        let Some(of) = self.of else { return Some(()) };
        for operation in operations {
            let Some(AccessId(access)) = operation.access else { continue };
            let access = &self.accesses[access as usize];
            let word = access.word.as_ref().and_then(|word| word.at(of, iteration));
            let access = ArrayAccess { word, ..access.clone() };
            operation.access = Some(AccessId(self.accesses.len() as u32));
            self.accesses.push(access);
        }
        Some(())
    }

    /// The operations of a task, on their slots, which they keep.
    fn placed(&self, task: usize) -> SmallVec<[Operation; 1]> {
        let uses = self.problem.tasks[task].choice(self.schedule.choice[task]);
        let operations = &self.own[self.origins[task]].operations;
        let placed = operations.iter().zip(uses).map(|(operation, usage)| {
            let slot = operation.slot.map(|_| usage.slot);
            let slots = slot.map_or(operation.slots, Slots::of);
            Operation { slot, slots, ..*operation }
        });
        placed.collect()
    }

    /// The tasks in the order of the kernel, with their cycles in it. Of those in one cycle, what reads a register comes before what
    /// writes it, for all of them read before any writes.
    fn order(&self) -> Vec<(u32, usize)> {
        let interval = self.schedule.interval;
        let cycle = |task: usize| self.schedule.start[task] % interval;
        let mut tasks: Vec<usize> = (0..self.problem.tasks.len()).collect();
        tasks.sort_by_key(|task| cycle(*task));
        let reads = |task: usize, written: usize| {
            let dests =
                || self.own[self.origins[written]].operations.iter().filter_map(|operation| operation.dest);
            let mut operations = self.own[self.origins[task]].operations.iter();
            operations.any(|operation| dests().any(|dest| operation.reads().contains(&dest)))
        };
        let mut order = Vec::new();
        for group in tasks.chunk_by(|a, b| cycle(*a) == cycle(*b)) {
            let mut left = group.to_vec();
            while !left.is_empty() {
                // The first that writes nothing that another of them still has to read; any, in a ring of them.
                let free =
                    |&at: &usize| left.iter().all(|other| *other == left[at] || !reads(*other, left[at]));
                let at = (0..left.len()).find(free).unwrap_or(0);
                order.push((cycle(group[0]), left.remove(at)));
            }
        }
        order
    }

    /// Operations of one interval before or after the kernel: those of the stages that are in an `iteration` there, a bundle each; in a
    /// ring of reads and writes, together.
    fn block(&mut self, iteration: impl Fn(u32) -> Option<i64>) -> Option<Vec<Bundle>> {
        let mut by_cycle: BTreeMap<u32, Vec<(usize, i64)>> = BTreeMap::new();
        for (cycle, task) in self.order() {
            if let Some(iteration) = iteration(self.stage(task)) {
                by_cycle.entry(cycle).or_default().push((task, iteration));
            }
        }
        let bundle = |operations| Bundle { operations, explicit: false, scheduled: true };
        let mut bundles = Vec::new();
        for tasks in by_cycle.into_values() {
            let mut placed: Vec<SmallVec<[Operation; 1]>> = Vec::new();
            for (task, iteration) in tasks {
                let mut operations = self.placed(task);
                self.settle(task, &mut operations, iteration)?;
                placed.push(operations);
            }
            let late = (1..placed.len()).any(|at| {
                let dests = placed[..at].iter().flatten().filter_map(|operation| operation.dest);
                let mut dests = dests.filter(|dest| *dest != RegisterId::ZERO);
                dests.any(|dest| placed[at].iter().any(|operation| operation.reads().contains(&dest)))
            });
            if late {
                let operations = placed.into_iter().flatten().collect();
                bundles.push(Bundle { operations, explicit: true, scheduled: true });
            } else {
                bundles.extend(placed.into_iter().map(bundle));
            }
        }
        Some(bundles)
    }

    /// The bundles of the kernel.
    fn kernel(&self) -> Vec<Bundle> {
        let mut by_cycle: BTreeMap<u32, SmallVec<[Operation; 1]>> = BTreeMap::new();
        for (cycle, task) in self.order() {
            let mut operations = self.placed(task);
            if let Some(offset) = self.offset(task, None) {
                operations[0].constant = Constant::Value(offset as u32);
            }
            by_cycle.entry(cycle).or_default().extend(operations);
        }
        let bundle = |mut operations: SmallVec<[Operation; 1]>| {
            operations.sort_by_key(|operation| operation.slot);
            Bundle { operations, explicit: true, scheduled: false }
        };
        by_cycle.into_values().map(bundle).collect()
    }
}

/// Lets all that writes a register do so from the slot that a kernel writes it from.
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

/// For each register that the assembler may place, the range of bundles that use it; `None` for others and for unused ones.
fn inside(ir: &Ir) -> Vec<Option<Range<usize>>> {
    let mut uses: Vec<Option<Range<usize>>> = vec![None; ir.registers.len()];
    for (at, bundle) in ir.bundles.iter().enumerate() {
        for register in
            bundle.operations.iter().flat_map(|operation| operation.reads().iter().chain(&operation.dest))
        {
            let range = uses[register.index()].get_or_insert(at..at);
            range.end = at + 1;
        }
    }
    for (range, register) in uses.iter_mut().zip(&ir.registers) {
        if register.kind != RegisterKind::Plain || register.pinned.is_some() || register.preset.is_some() {
            *range = None;
        }
    }
    uses
}

/// True if a register is read before it is written, or only read.
fn read_first(bundles: &[Bundle], register: RegisterId) -> bool {
    for bundle in bundles {
        if bundle.operations.iter().any(|operation| operation.reads().contains(&register)) {
            return true;
        }
        if bundle.operations.iter().any(|operation| operation.dest == Some(register)) {
            return false;
        }
    }
    true
}

/// Gives the values of one iteration registers of their own before the kernel and behind it, so that they take a register only as
/// long as they live. Only a value that an iteration keeps from one run of the kernel to the next has the kernel's register there, too.
fn localise(
    ir: &mut Ir,
    values: &HashSet<RegisterId>,
    kernel: &[Bundle],
    prologue: &mut [Bundle],
    epilogue: &mut [Bundle],
) {
    let mut now: HashMap<RegisterId, RegisterId> = HashMap::new();
    let last = rename_values(ir, values, prologue, &mut now);
    // What the kernel reads first is what the prologue has written last.
    for (&value, &own) in now.iter().filter(|(value, _)| read_first(kernel, **value)) {
        for operation in prologue[last[&value]..].iter_mut().flat_map(|bundle| &mut bundle.operations) {
            let reads = operation.row().shape.sources();
            operation.sources[..reads]
                .iter_mut()
                .filter(|source| **source == own)
                .for_each(|source| *source = value);
            if operation.dest == Some(own) {
                operation.dest = Some(value);
            }
        }
    }
    rename_values(ir, values, epilogue, &mut HashMap::new());
}

/// Gives each value that is written in straight-line bundles a register of its own. `now` has the present one of each, and the result the
/// bundle of the last write.
fn rename_values(
    ir: &mut Ir,
    values: &HashSet<RegisterId>,
    bundles: &mut [Bundle],
    now: &mut HashMap<RegisterId, RegisterId>,
) -> HashMap<RegisterId, usize> {
    let mut last = HashMap::new();
    for (at, bundle) in bundles.iter_mut().enumerate() {
        for operation in &mut bundle.operations {
            let reads = operation.row().shape.sources();
            for source in &mut operation.sources[..reads] {
                *source = now.get(source).copied().unwrap_or(*source);
            }
        }
        for operation in &mut bundle.operations {
            let Some(dest) = operation.dest.filter(|dest| values.contains(dest)) else { continue };
            // It has no name: the debugger shows the kernel's.
            let own = VirtualRegister { name: String::new(), ..ir.register(dest).clone() };
            ir.registers.push(own);
            let own = RegisterId::new(ir.registers.len() - 1);
            operation.dest = Some(own);
            now.insert(dest, own);
            last.insert(dest, at);
        }
    }
    last
}

/// Puts the new bundles in place of the loops'.
fn rewrite(ir: &mut Ir, pipelined: Vec<Pipelined>) -> Vec<LoopReport> {
    let mut bundles = Vec::with_capacity(ir.bundles.len());
    let mut moved = BTreeMap::new();
    let mut reports = Vec::new();
    let mut next = 0;
    let inside = inside(ir);
    for Pipelined { candidate, mut prologue, kernel, mut epilogue, mut report } in pipelined {
        let Candidate { entry, body, count, .. } = candidate;
        let own = |register: RegisterId| {
            inside[register.index()]
                .as_ref()
                .is_some_and(|uses| body.start <= uses.start && uses.end <= body.end)
                && !read_first(&ir.bundles[body.start..body.end], register)
        };
        let values: HashSet<RegisterId> = kernel
            .iter()
            .flat_map(|bundle| &bundle.operations)
            .filter_map(|operation| operation.dest)
            .filter(|dest| own(*dest))
            .collect();
        localise(ir, &values, &kernel, &mut prologue, &mut epilogue);
        let counter = constant(ir, count + 1 - report.stages);
        for at in next..entry {
            // The bundle behind a loop stands behind its epilogue; what is placed before it, as the loop's end, before that.
            moved.entry(at as u32).or_insert(bundles.len() as u32);
            bundles.push(ir.bundles[at].clone());
        }
        let mut last = ir.bundles[entry].clone();
        for operation in last.operations.iter_mut().filter(|operation| operation.row().effect == Effect::Loop)
        {
            operation.sources[0] = counter;
        }
        moved.entry(entry as u32).or_insert(bundles.len() as u32);
        // What shared the bundle with `loop` precedes it.
        let (looped, rest) = last
            .operations
            .into_iter()
            .partition::<SmallVec<[Operation; 1]>, _>(|operation| operation.row().effect == Effect::Loop);
        if !rest.is_empty() {
            bundles.push(Bundle { operations: rest, explicit: last.explicit, scheduled: true });
        }
        bundles.extend(prologue);
        bundles.push(Bundle { operations: looped, explicit: false, scheduled: true });
        report.address = BundleAddress::new(bundles.len() as u32);
        (body.start..body.end).for_each(|at| _ = moved.insert(at as u32, bundles.len() as u32));
        bundles.extend(kernel);
        moved.insert(body.end as u32, bundles.len() as u32);
        bundles.extend(epilogue);
        reports.push(report);
        next = body.end;
    }
    for at in next..ir.bundles.len() {
        moved.entry(at as u32).or_insert(bundles.len() as u32);
        bundles.push(ir.bundles[at].clone());
    }
    let end = bundles.len() as u32;
    ir.replace_bundles(bundles, |position| moved.get(&position).copied().unwrap_or(end));
    reports
}

/// The register that holds an integer constant.
fn constant(ir: &mut Ir, value: u32) -> RegisterId {
    let kind = RegisterKind::Constant(value);
    let known = ir.registers.iter().position(|register| register.kind == kind);
    let index = known.unwrap_or_else(|| {
        let span = crate::report::source::Span::default();
        let (name, ty) = (String::new(), Type::I);
        ir.registers.push(VirtualRegister { name, kind, ty, pinned: None, preset: None, span });
        ir.registers.len() - 1
    });
    RegisterId::new(index)
}
