// SPDX-License-Identifier: MIT OR Apache-2.0
//! Trace of a run: every issue, the stalls before it, and the critical path through them.

use takt_emu::{Emulator, Fault, Status, Step};
use takt_isa::timing::{Bundle, Cause, Cycle, Scoreboard};
use takt_isa::{BundleAddress, Instruction, Program, Register, Slot, SlotIndex};

/// Limit on the bundles of a trace.
pub const MAX_ISSUES: usize = 1 << 16;

/// Bundle that issued, with the stalls before it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IssuedBundle {
    /// Address of the bundle.
    pub address: BundleAddress,
    /// Cycle of the issue.
    pub cycle: Cycle,
    /// Stalls before it, as cause and number of cycles, in time order.
    pub stalls: Vec<(Cause, u32)>,
    /// Cycles from the previous issue, or from the trace's start, to its delivery.
    distance: Cycle,
}

impl IssuedBundle {
    /// Issue for the critical path only: without the delivery distance that a replay needs.
    pub(crate) fn new(address: BundleAddress, cycle: Cycle, stalls: Vec<(Cause, u32)>) -> IssuedBundle {
        IssuedBundle { address, cycle, stalls, distance: 0 }
    }
}

/// Issues from a tick, or from reset, to a `wait` or `halt`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trace {
    /// Cycle of the tick, after which cycles are counted; `None` if they are counted from reset.
    pub tick: Option<Cycle>,
    /// Cycles that passed, the last issue's included.
    pub cycles: Cycle,
    /// Bundles that issued, in time order.
    pub issues: Vec<IssuedBundle>,
    /// Bundle that waited for the tick, and the cycle of its issue, since operations of that bundle may still be in flight.
    before: Option<(BundleAddress, Cycle)>,
}

/// Reason why there is no trace.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TraceError {
    /// Fault of the program.
    #[error("{0}")]
    Fault(#[from] Fault),
    /// The program has already halted.
    #[error("the program has halted: there is no further period")]
    Halted,
    /// The run exceeds [`MAX_ISSUES`].
    #[error("more than {MAX_ISSUES} bundles issue: too many to show one by one")]
    TooLong,
}

/// Runs the machine to the next `wait` or `halt`, cycle by cycle, and records every issue. If the machine waits and no tick is
/// scheduled, the tick comes when the front end has refilled, as in [`Emulator::run_period`].
///
/// # Errors
/// See [`TraceError`].
pub fn trace(emulator: &mut Emulator) -> Result<Trace, TraceError> {
    let refill = Cycle::from(emulator.machine().refill);
    let mut before = None;
    let mut start = None;
    if let Status::Waiting { since, address } = *emulator.status() {
        emulator.tick_at(emulator.now().max(since + refill));
        before = Some((address, since));
    }
    let first = emulator.now();
    let mut issues: Vec<IssuedBundle> = Vec::new();
    let mut stalls: Vec<(Cause, u32)> = Vec::new();
    loop {
        match emulator.step_cycle()? {
            Step::Halted => return Err(TraceError::Halted),
            // The last waiting cycle is the tick's.
            Step::Stalled { cycle, cause: Cause::Wait, .. } => start = Some(cycle),
            Step::Stalled { cause, .. } => match stalls.last_mut() {
                Some((last, cycles)) if *last == cause => *cycles += 1,
                _ => stalls.push((cause, 1)),
            },
            Step::Issued { cycle, address } => {
                let stalls = std::mem::take(&mut stalls);
                let held = |(cause, cycles): &(Cause, u32)| match cause {
                    Cause::Branch { .. } => 0,
                    _ => Cycle::from(*cycles),
                };
                let previous = issues.last().map_or(start.unwrap_or(first), |issue| issue.cycle);
                let distance = cycle - stalls.iter().map(held).sum::<Cycle>() - previous;
                issues.push(IssuedBundle { address, cycle, stalls, distance });
                if issues.len() > MAX_ISSUES {
                    return Err(TraceError::TooLong);
                }
                if !matches!(emulator.status(), Status::Running) {
                    let cycles = match start {
                        Some(tick) => cycle - tick,
                        None => cycle + 1 - first,
                    };
                    return Ok(Trace { tick: start, cycles, issues, before });
                }
            }
        }
    }
}

/// Rule that prevented a bundle from issuing sooner after an earlier one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkKind {
    /// Data hazard: the bundle reads or overwrites a result of the earlier one, whose unit's latency counts.
    Result {
        /// Register of the result.
        register: Register,
    },
    /// Structural hazard: the bundle uses a unit that the earlier one keeps busy.
    Unit {
        /// Slot of the machine.
        slot: SlotIndex,
        /// Unit of the slot.
        unit: u8,
    },
    /// Drain: the result of the earlier bundle is the last to be written back.
    Drain,
    /// Write port conflict: both results would be written in the same cycle.
    WritePort {
        /// Slot whose bank both results go to.
        slot: SlotIndex,
    },
    /// The earlier bundle redirected the fetch or resolved a branch.
    FrontEnd,
    /// Order of issue: the earlier bundle issued in the previous cycle, and only one bundle issues per cycle.
    Order,
}

/// Edge of the critical path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// Index of the earlier issue.
    pub from: usize,
    /// Index of the later issue.
    pub to: usize,
    /// Rule that set the distance between the issues.
    pub kind: LinkKind,
    /// Cycles between the issues.
    pub cycles: Cycle,
}

/// Effect of a faster unit, or front end, on the unchanged program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WhatIf {
    /// Faster unit, by slot and index; `None` is the front end.
    pub unit: Option<(SlotIndex, u8)>,
    /// Cycles that the trace would take with the faster unit.
    pub cycles: Cycle,
    /// Additional stalled cycles, by kind of cause ([`Cause::KINDS`]), without the front end's. They explain why a faster unit may cost
    /// cycles.
    pub stalls: Stalls,
}

/// Stalled cycles by kind of cause.
pub type Stalls = [i64; Cause::KINDS.len()];

/// Timing properties of an operation.
struct OperationTiming {
    slot: SlotIndex,
    unit: u8,
    latency: Cycle,
    dest: Option<Register>,
    sources: Vec<Register>,
}

impl Trace {
    /// Trace that begins with reset.
    pub(crate) fn from_reset(cycles: Cycle, issues: Vec<IssuedBundle>) -> Trace {
        Trace { tick: None, cycles, issues, before: None }
    }

    /// Cycle after which the first bundle could issue at the earliest.
    pub(crate) fn start(&self) -> Cycle {
        let first = self.issues.last().map_or(0, |last| (last.cycle + 1).saturating_sub(self.cycles));
        self.tick.unwrap_or(first.saturating_sub(1))
    }

    /// Critical path: a chain of issues from the first to the last, in which each delayed the next. Its cycles add up to the distance of
    /// the first and the last issue. If several reasons hold, a data dependence takes precedence over the order of issue.
    pub fn critical_path(&self, program: &Program) -> Vec<Link> {
        let parts: Vec<Vec<OperationTiming>> =
            self.issues.iter().map(|issue| parts(program, issue.address)).collect();
        let mut chain = Vec::new();
        let mut to = self.issues.len().saturating_sub(1);
        while to > 0 {
            let link = self.link(&parts, to);
            chain.push(link);
            to = link.from;
        }
        chain.reverse();
        chain
    }

    fn link(&self, parts: &[Vec<OperationTiming>], to: usize) -> Link {
        let issue = &self.issues[to];
        let link = |from: usize, kind| Link { from, to, kind, cycles: issue.cycle - self.issues[from].cycle };
        let earlier = |wanted: &dyn Fn(&OperationTiming, Cycle) -> bool| {
            (0..to).rev().find(|&from| parts[from].iter().any(|part| wanted(part, self.issues[from].cycle)))
        };
        let just_written = |register: Register| {
            earlier(&|part, cycle| part.dest == Some(register) && cycle + part.latency == issue.cycle)
        };
        let found = match issue.stalls.last() {
            Some(&(Cause::Operand { register, .. } | Cause::Destination { register, .. }, _)) => {
                just_written(register).map(|from| (from, LinkKind::Result { register }))
            }
            Some(&(Cause::Unit { slot, unit }, _)) => {
                earlier(&|part, _| (part.slot, part.unit) == (slot, unit))
                    .map(|from| (from, LinkKind::Unit { slot, unit }))
            }
            Some((Cause::Drain, _)) => {
                earlier(&|part, cycle| part.dest.is_some() && cycle + part.latency == issue.cycle)
                    .map(|from| (from, LinkKind::Drain))
            }
            Some(&(Cause::WritePort { slot }, _)) => {
                // The conflict was in the previous cycle: the earlier result is written one cycle before this one.
                let mine = parts[to].iter().find(|part| part.slot == slot).map_or(0, |part| part.latency);
                earlier(&|part, cycle| {
                    part.slot == slot && part.dest.is_some() && cycle + part.latency + 1 == issue.cycle + mine
                })
                .map(|from| (from, LinkKind::WritePort { slot }))
            }
            Some((Cause::Branch { .. }, _)) => Some((to - 1, LinkKind::FrontEnd)),
            Some((Cause::Wait, _)) => None,
            None => {
                let mut sources = parts[to].iter().flat_map(|part| part.sources.iter().copied());
                sources.find_map(|register| Some((just_written(register)?, LinkKind::Result { register })))
            }
        };
        let (from, kind) = found.unwrap_or((to - 1, LinkKind::Order));
        link(from, kind)
    }

    /// Effect of one cycle less in the latency (and interval) of each unit that the trace uses, and in the front end's refill, found by
    /// replaying the unchanged bundles on the scoreboard.
    pub fn what_if(&self, program: &Program) -> Vec<WhatIf> {
        let machine = program.machine;
        let mut used: Vec<(SlotIndex, u8)> = self
            .issues
            .iter()
            .flat_map(|issue| parts(program, issue.address))
            .map(|part| (part.slot, part.unit))
            .collect();
        used.sort_unstable();
        used.dedup();
        let (_, today) = self.replay(program, |bundle| bundle, 0);
        let what = |unit, (cycles, stalls): (Cycle, Stalls)| WhatIf {
            unit,
            cycles,
            stalls: std::array::from_fn(|kind| stalls[kind] - today[kind]),
        };
        let faster = used.into_iter().filter_map(|(slot, unit)| {
            let row = &machine.slot(slot).units[usize::from(unit)];
            // A latency is at least one cycle; a unit that writes nothing has none.
            (row.latency > 1).then_some(())?;
            let interval = row.interval.saturating_sub(1).max(1);
            let change = |bundle: Bundle| bundle.with_unit(slot, unit, row.latency - 1, interval);
            Some(what(Some((slot, unit)), self.replay(program, change, 0)))
        });
        let front = what(None, self.replay(program, |bundle| bundle, 1));
        faster.chain([front].into_iter().filter(|_| machine.refill > 0)).collect()
    }

    /// Cycles of a replay without changes. They equal [`Trace::cycles`], unless the emulator and the rules disagree.
    pub fn replayed(&self, program: &Program) -> Cycle {
        self.replay(program, |bundle| bundle, 0).0
    }

    /// Replays the trace with changed bundles, and with `sooner` fewer cycles of refill. Returns the cycles and the stalls.
    fn replay(&self, program: &Program, change: impl Fn(Bundle) -> Bundle, sooner: Cycle) -> (Cycle, Stalls) {
        let bundle = |address| {
            let instructions = program.bundle(address).and_then(Result::ok).unwrap_or_default();
            change(Bundle::new(program.machine, &instructions))
        };
        let mut scoreboard = Scoreboard::new(program.machine);
        if let Some((address, cycle)) = self.before {
            scoreboard.issue(&bundle(address), address, cycle);
        }
        let mut stalls = Stalls::default();
        let Some(first) = self.issues.first() else { return (0, stalls) };
        let redirects = 1 + Cycle::from(program.machine.refill);
        let held: Cycle = first.stalls.iter().map(|(_, cycles)| Cycle::from(*cycles)).sum();
        let branch: Cycle = first
            .stalls
            .iter()
            .filter(|(cause, _)| matches!(cause, Cause::Branch { .. }))
            .map(|(_, cycles)| Cycle::from(*cycles))
            .sum();
        let mut delivered = first.cycle - held + branch - sooner.min(branch);
        let mut last = delivered;
        for issue in &self.issues {
            if issue.cycle != first.cycle {
                let less = if issue.distance == redirects { sooner } else { 0 };
                delivered = last + issue.distance - less;
            }
            let issued = scoreboard.issue(&bundle(issue.address), issue.address, delivered);
            for &(cause, cycles) in issued.stalls() {
                stalls[cause.kind()] += i64::from(cycles);
            }
            last = issued.cycle;
        }
        let end = self.issues.last().map_or(0, |issue| issue.cycle);
        ((self.cycles + last).saturating_sub(end), stalls)
    }
}

/// Operations of a bundle that use a unit.
fn parts(program: &Program, address: BundleAddress) -> Vec<OperationTiming> {
    let instructions: Vec<Instruction> = program.bundle(address).and_then(Result::ok).unwrap_or_default();
    let part = |((s, slot), instruction): ((SlotIndex, &Slot), &Instruction)| {
        let function = instruction.op.row().function;
        let unit = slot.unit_index(function)?;
        Some(OperationTiming {
            slot: s,
            unit: unit as u8,
            latency: slot.units[unit].latency.into(),
            dest: instruction.writes(slot),
            sources: instruction.reads().to_vec(),
        })
    };
    program.machine.numbered_slots().zip(&instructions).filter_map(part).collect()
}
