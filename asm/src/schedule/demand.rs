// SPDX-License-Identifier: MIT OR Apache-2.0
//! Timing demands on ports (`.deadline`, `.order`, `.late`): assigned to runs of bundles, added to the scheduling problem as
//! deadlines, edges and late tasks, checked in the schedule, and explained if none can meet them.

use super::Block;
use super::bound::{Bound, Resources};
use super::problem::{Edge, Problem};
use crate::ir::runs::Run;
use crate::ir::{Bundle, Demand, DemandKind, Ir, Operation, RegisterId, RegisterKind};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use takt_diagnostics::diag::{Diagnostic, Sink};
use takt_diagnostics::source::Span;
use takt_isa::SlotIndex;

/// Limit on the pairs of reads and writes that the orders of a run produce: far more than programs need.
const ORDER_EDGES: usize = 1 << 16;

/// Places of a chain of operations that an error points at.
const SHOWN: usize = 8;

/// Times at which a demand is met. All `.late` directives of a run share one report.
#[derive(Clone, Debug)]
pub struct TimingReport {
    /// The kind of demand.
    pub kind: DemandKind,
    /// The section is `.period`, not `.once`.
    pub period: bool,
    /// By port: name, and the cycles of its first and last read or write. The first bundle of the section issues in cycle 1;
    /// a later run of bundles has a cycle 1 of its own.
    pub ports: Vec<(String, u32, u32)>,
    /// For inputs read late: cycles from the first read to the last write of a dependent output, and the lower bound of this
    /// window.
    pub window: Option<(u32, u32)>,
}

/// A read or write of a port.
#[derive(Clone, Copy)]
struct Event {
    task: usize,
    /// Cycles after the task's issue.
    after: u32,
    span: Span,
}

/// The demands of each run, by index. A demand that spans several runs is reported.
pub(super) fn assign(ir: &Ir, runs: &[Run], sink: &mut Sink) -> Vec<Vec<usize>> {
    let mut assigned = vec![Vec::new(); runs.len()];
    if ir.demands.is_empty() {
        return assigned;
    }
    for (number, demand) in ir.demands.iter().enumerate() {
        let is_of_section = |run: &&Run| (run.start >= ir.period as usize) == demand.period;
        let section = if demand.period { ".period" } else { ".once" };
        // Runs that use each port, with the place of the first use.
        let mut users: Vec<(usize, RegisterId, Span)> = Vec::new();
        for (index, run) in runs.iter().enumerate().filter(|(_, run)| is_of_section(run)) {
            let operations = ir.bundles[run.start..run.end].iter().flat_map(|bundle| &bundle.operations);
            for operation in operations {
                for &(port, _) in demand.ports.iter().filter(|(port, _)| uses(ir, operation, *port)) {
                    if !users.iter().any(|&(run, other, _)| (run, other) == (index, port)) {
                        users.push((index, port, operation.span));
                    }
                }
            }
        }
        if !matches!(demand.kind, DemandKind::Late(_)) {
            let unused =
                demand.ports.iter().find(|(port, _)| !users.iter().any(|(_, other, _)| other == port));
            if let Some((port, span)) = unused {
                let name = &ir.register(*port).name;
                let message = format!("`{name}` is neither read nor written in `{section}`");
                let help = "the directive is about the section in which it stands";
                sink.push(Diagnostic::error("timing", *span, message).help(help));
                continue;
            }
            let first = match demand.kind {
                DemandKind::Deadline(_) => runs.iter().position(|run| is_of_section(&run)),
                _ => users.first().map(|(run, ..)| *run),
            };
            if let Some((_, port, span)) = users.iter().find(|(run, ..)| Some(*run) != first) {
                let name = &ir.register(*port).name;
                let (message, what) = match demand.kind {
                    DemandKind::Deadline(_) => (
                        format!("in which cycle `{name}` is written is not known"),
                        format!("written after a place that cuts `{section}`"),
                    ),
                    _ => (
                        "operations of different straight runs keep the source's order".to_owned(),
                        format!("`{name}` is used in another run"),
                    ),
                };
                let error = Diagnostic::error("timing", demand.span, message).also(*span, what);
                sink.push(error.note(
                    "labels, branches, calls, `rdflags` and `clrflags` cut a section into runs; times are known within one",
                ));
                continue;
            }
        }
        let mut of: Vec<usize> = users.iter().map(|(run, ..)| *run).collect();
        of.sort_unstable();
        of.dedup();
        for run in of {
            assigned[run].push(number);
        }
    }
    assigned
}

/// An operation reads an input port, or writes an output port. (Reads of an output are invisible outside.)
fn uses(ir: &Ir, operation: &Operation, port: RegisterId) -> bool {
    match ir.register(port).kind {
        RegisterKind::Output => operation.dest == Some(port),
        _ => operation.reads().contains(&port),
    }
}

/// A run's problem and its demands.
pub(super) struct Demands<'a> {
    ir: &'a Ir,
    bundles: &'a [Bundle],
    /// Demands of the run, as indices into the program's demands.
    of: &'a [usize],
}

impl<'a> Demands<'a> {
    pub(super) fn new(ir: &'a Ir, bundles: &'a [Bundle], of: &'a [usize]) -> Demands<'a> {
        Demands { ir, bundles, of }
    }

    /// Reads and writes of a port, in the order of the source.
    fn events(&self, block: &Block, port: RegisterId) -> Vec<Event> {
        let mut events = Vec::new();
        for (task, &origin) in block.origins.iter().enumerate() {
            for (index, operation) in self.bundles[origin].operations.iter().enumerate() {
                let span = operation.span;
                if uses(self.ir, operation, port) {
                    // Equal for every choice of slots: ports are written by the quickest ([`Domains`](super::domains::Domains)).
                    let written = || block.problem.tasks[task].written(index).unwrap_or(0);
                    let after = if operation.dest == Some(port) { written() } else { 0 };
                    events.push(Event { task, after, span });
                }
            }
        }
        events.sort_by_key(|event| block.origins[event.task]);
        events
    }

    fn name(&self, port: RegisterId) -> &'a str {
        &self.ir.register(port).name
    }

    /// Adds the demands to a problem. Returns false, after a report, if a demand cannot be met.
    pub(super) fn apply(&self, block: &mut Block, sink: &mut Sink) -> bool {
        self.order(block, sink) && {
            let mut possible = true;
            for &number in self.of {
                let demand = &self.ir.demands[number];
                match demand.kind {
                    DemandKind::Order => {}
                    DemandKind::Late(cost) => {
                        block.problem.slack = block.problem.slack.max(cost);
                        for &(port, _) in &demand.ports {
                            for event in self.events(block, port) {
                                block.problem.tasks[event.task].late = true;
                            }
                        }
                    }
                    DemandKind::Deadline(limit) => {
                        for &(port, span) in &demand.ports {
                            let Some(last) = self.last(block, port) else { continue };
                            possible &= self.can_meet(block, limit, port, span, last, sink);
                            let latest = (limit - 1).saturating_sub(last.after);
                            let task = &mut block.problem.tasks[last.task];
                            task.latest = Some(task.latest.map_or(latest, |other| other.min(latest)));
                        }
                    }
                }
            }
            possible
        }
    }

    fn last(&self, block: &Block, port: RegisterId) -> Option<Event> {
        self.events(block, port).into_iter().rfind(|event| event.after > 0)
    }

    /// Adds the orders as edges, and sorts the tasks so that every edge leads to a later one.
    fn order(&self, block: &mut Block, sink: &mut Sink) -> bool {
        let mut ordered: Vec<(&Demand, usize, Event, Event)> = Vec::new();
        for &number in self.of {
            let demand = &self.ir.demands[number];
            if demand.kind != DemandKind::Order {
                continue;
            }
            for (at, pair) in demand.ports.windows(2).enumerate() {
                let (before, after) = (self.events(block, pair[0].0), self.events(block, pair[1].0));
                // Writes keep their own order, so the last and the first are enough.
                let writes = |events: &[Event]| events.iter().all(|event| event.after > 0);
                let before =
                    if writes(&before) { &before[before.len().saturating_sub(1)..] } else { &before };
                let after = if writes(&after) { &after[..after.len().min(1)] } else { &after };
                if before.len().saturating_mul(after.len()) > ORDER_EDGES - ordered.len() {
                    let message = format!("more than {ORDER_EDGES} pairs of reads and writes to order");
                    sink.push(Diagnostic::error("limit", demand.span, message));
                    return false;
                }
                for &x in before {
                    ordered.extend(after.iter().map(|&y| (demand, at, x, y)));
                }
            }
        }
        for (demand, at, x, y) in &ordered {
            // `y` happens after `x`. An earlier issue of `y` is forbidden, too: this asks for more than the demand, and keeps
            // bundles in order.
            let distance = (x.after + 1).saturating_sub(y.after);
            if x.task == y.task {
                self.contradiction(demand, *at, x, y, "one bundle uses both", sink);
                return false;
            }
            let (from, to) = (x.task, y.task);
            block.problem.edges.push(Edge { from, to, distance, latency_of: None, demanded: true });
        }
        if ordered.iter().all(|(_, _, x, y)| x.task < y.task) || sort(block) {
            return true;
        }
        // There is a cycle, which only an order can have closed.
        let mut succs = vec![Vec::new(); block.problem.tasks.len()];
        for edge in &block.problem.edges {
            succs[edge.from].push(edge.to);
        }
        for (demand, at, x, y) in ordered {
            let mut seen = vec![false; succs.len()];
            let mut reached = vec![y.task];
            while let Some(task) = reached.pop() {
                if !std::mem::replace(&mut seen[task], true) {
                    reached.extend_from_slice(&succs[task]);
                }
            }
            if seen[x.task] {
                self.contradiction(demand, at, &x, &y, "it must wait for it", sink);
                break;
            }
        }
        false
    }

    fn contradiction(&self, demand: &Demand, at: usize, x: &Event, y: &Event, why: &str, sink: &mut Sink) {
        let name = |index: usize| self.name(demand.ports[index].0);
        let does = |event: &Event| if event.after > 0 { "written" } else { "read" };
        let message = format!("`{}` cannot come before `{}`: {why}", name(at), name(at + 1));
        let error = Diagnostic::error("timing", demand.ports[at].1.to(demand.ports[at + 1].1), message)
            .here("this order")
            .also(x.span, format!("`{}` is {} here", name(at), does(x)))
            .also(y.span, format!("`{}` is {} here", name(at + 1), does(y)));
        sink.push(error.note("operations wait for results, memory accesses, faults and other orders"));
    }

    /// Checks that lower bounds allow a write of the port by cycle `limit`; otherwise reports the chain or the resource that prevents it.
    fn can_meet(
        &self,
        block: &Block,
        limit: u32,
        port: RegisterId,
        span: Span,
        last: Event,
        sink: &mut Sink,
    ) -> bool {
        let keep = block.problem.before(|i| i == last.task);
        let (cone, kept) = block.problem.subproblem(&keep, |i| (i == last.task).then_some(last.after));
        let bound = cone.bound();
        if bound.cycles() <= limit {
            return true;
        }
        let name = self.name(port);
        let cycles = bound.cycles();
        let mut error =
            Diagnostic::error("timing", span, format!("`{name}` cannot be written before cycle {cycles}"))
                .here(format!("demanded in cycle {limit}"));
        let operation = |task: usize| self.bundles[block.origins[kept[task]]].operations.first();
        if bound.critical_path == cycles {
            let chain: Vec<usize> =
                cone.critical_path().into_iter().filter(|&task| task < kept.len()).collect();
            error = error.note(format!("a chain of {} dependent operations leads there", chain.len()));
            // The first and the last operations of a long chain.
            let (head, tail) = (SHOWN / 2, chain.len().saturating_sub(SHOWN / 2));
            let shown = (1..).zip(&chain).filter(|(place, _)| *place <= head || *place > tail);
            for (place, operation) in shown.filter_map(|(place, &task)| Some((place, operation(task)?))) {
                error = error.also(operation.span, format!("{place} of the chain"));
            }
        } else {
            let single = |bounds: &[u32]| bounds.iter().position(|bound| *bound == cycles);
            let shared = || bound.shared.iter().find(|shared| shared.cycles == cycles);
            let resources = match (single(&bound.slots), single(&bound.units)) {
                (Some(slot), _) => Some(Resources::Slots(SlotIndex::new(slot).into_iter().collect())),
                (None, Some(unit)) => Some(Resources::Units(vec![unit])),
                (None, None) => shared().map(|shared| shared.resources.clone()),
            };
            if let Some(resources) = resources {
                let count = Bound::operations(&cone, &resources);
                let text = resources.text(self.ir.machine);
                let (kind, names) = text.split_once(' ').unwrap_or_default();
                let (has, how) = match kind.strip_suffix('s') {
                    None => ("has", ", one after another"),
                    Some(_) => ("have", ""),
                };
                error = error.note(format!("{kind} `{names}` {has} {count} operations to issue for it{how}"));
            }
            error = error.also(last.span, "written here");
        }
        sink.push(error.help(later(cycles)));
        false
    }

    /// Checks the demands in a schedule, and returns the times of reads and writes. Demands that are not met are reported.
    pub(super) fn check(
        &self,
        block: &Block,
        start: &[u32],
        window: Option<(u32, u32)>,
        scheduled: bool,
        sink: &mut Sink,
    ) -> Vec<TimingReport> {
        let mut reports: Vec<TimingReport> = Vec::new();
        for demand in self.of.iter().map(|&number| &self.ir.demands[number]) {
            let is_late = |kind| matches!(kind, DemandKind::Late(_));
            // Without a scheduler, nothing is made late.
            if is_late(demand.kind) && !scheduled {
                continue;
            }
            let cycle = |event: &Event| start[event.task] + event.after + 1;
            let mut ports: Vec<(String, u32, u32)> = Vec::new();
            let mut before: Option<(RegisterId, u32)> = None;
            for &(port, span) in &demand.ports {
                let events = self.events(block, port);
                let (Some(first), Some(last)) =
                    (events.iter().map(cycle).min(), events.iter().map(cycle).max())
                else {
                    continue;
                };
                let name = self.name(port);
                let help = if scheduled {
                    "`takt asm --effort` lets the scheduler search longer"
                } else {
                    "`.schedule on` lets the assembler order the operations"
                };
                match (demand.kind, before) {
                    (DemandKind::Deadline(limit), _) if last > limit => {
                        let message = format!("`{name}` is written in cycle {last}, demanded in {limit}");
                        let mut error = Diagnostic::error("timing", span, message).help(help);
                        if let Some(event) = self.last(block, port) {
                            let keep = block.problem.before(|i| i == event.task);
                            let ends = |i| (i == event.task).then_some(event.after);
                            let bound = block.problem.subproblem(&keep, ends).0.bound().cycles();
                            error = error
                                .also(event.span, "written here")
                                .note(format!("by itself it cannot be written before cycle {bound}"));
                            // No order of the operations meets the limit.
                            if bound > limit {
                                error = error.help(later(bound));
                            }
                        }
                        sink.push(error);
                    }
                    (DemandKind::Order, Some((other, end))) if first <= end => {
                        let other = self.name(other);
                        let message =
                            format!("`{name}` comes in cycle {first}, and `{other}` before it in {end}");
                        sink.push(Diagnostic::error("timing", span, message).help(help));
                    }
                    _ => {}
                }
                before = Some((port, last));
                ports.push((name.to_owned(), first, last));
            }
            let window = window.filter(|_| is_late(demand.kind));
            match reports.iter_mut().find(|report| is_late(report.kind)) {
                Some(report) if is_late(demand.kind) => report.ports.extend(ports),
                _ => reports.push(TimingReport { kind: demand.kind, period: demand.period, ports, window }),
            }
        }
        reports
    }
}

/// Advice on a deadline that no schedule can meet.
fn later(cycles: u32) -> String {
    format!("allow cycle {cycles} or later, or compute less before it")
}

/// Topological sort of the tasks that otherwise keeps their order. Returns false on a cycle.
fn sort(block: &mut Block) -> bool {
    let n = block.problem.tasks.len();
    let mut succs = vec![Vec::new(); n];
    let mut waiting = vec![0u32; n];
    for edge in &block.problem.edges {
        succs[edge.from].push(edge.to);
        waiting[edge.to] += 1;
    }
    let mut ready: BinaryHeap<Reverse<usize>> = (0..n).filter(|&i| waiting[i] == 0).map(Reverse).collect();
    let mut order = Vec::with_capacity(n);
    while let Some(Reverse(task)) = ready.pop() {
        order.push(task);
        for &next in &succs[task] {
            waiting[next] -= 1;
            if waiting[next] == 0 {
                ready.push(Reverse(next));
            }
        }
    }
    if order.len() < n {
        return false;
    }
    let mut place = vec![0; n];
    for (new, &old) in order.iter().enumerate() {
        place[old] = new;
    }
    let Problem { tasks, edges, .. } = &mut block.problem;
    *tasks = order.iter().map(|&old| tasks[old].clone()).collect();
    block.origins = order.iter().map(|&old| block.origins[old]).collect();
    for edge in edges {
        (edge.from, edge.to) = (place[edge.from], place[edge.to]);
    }
    true
}
