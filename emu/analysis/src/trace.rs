// SPDX-License-Identifier: MIT OR Apache-2.0
//! Trace of a run: every issue, the stalls before it, and the critical path through them.

use takt_emu::{Emulator, Fault, Status, Step};
use takt_isa::timing::{Bundle, Cause, Cycle, Scoreboard};
use takt_isa::{BundleAddress, Instruction, Program, Register, Slot, SlotIndex};

/// Limit on the bundles of a trace.
pub const MAX_ISSUES: usize = 1 << 16;

/// A bundle that issued.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Issued {
    /// Its address.
    pub address: BundleAddress,
    /// The cycle of its issue.
    pub cycle: Cycle,
    /// The stalls before it, as cause and number of cycles, in time order.
    pub stalls: Vec<(Cause, u32)>,
    /// Cycles from the previous issue, or from the trace's start, to its delivery.
    distance: Cycle,
}

impl Issued {
    /// An issue of which only the critical path is asked for, not a replay.
    pub(crate) fn new(address: BundleAddress, cycle: Cycle, stalls: Vec<(Cause, u32)>) -> Issued {
        Issued { address, cycle, stalls, distance: 0 }
    }
}

/// The issues from a tick, or from reset, to a `wait` or `halt`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trace {
    /// The cycle of the tick, after which cycles are counted; `None` if they are counted from reset.
    pub tick: Option<Cycle>,
    /// Cycles that passed, the last issue's included.
    pub cycles: Cycle,
    /// The bundles, in order.
    pub issues: Vec<Issued>,
    /// The bundle that waited for the tick, and the cycle of its issue, since operations of that bundle may still be in flight.
    before: Option<(BundleAddress, Cycle)>,
}

/// The reason why there is no trace.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TraceError {
    /// The program faulted.
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
    let mut issues: Vec<Issued> = Vec::new();
    let mut stalls: Vec<(Cause, u32)> = Vec::new();
    loop {
        match emulator.step_cycle()? {
            Step::Halted => return Err(TraceError::Halted),
            // The last of these cycles is the tick's.
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
                issues.push(Issued { address, cycle, stalls, distance });
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

/// The rule that prevented a bundle from issuing sooner after an earlier one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkKind {
    /// It reads or overwrites a result of the earlier one (a data hazard), whose unit's latency counts.
    Result {
        /// The register.
        register: Register,
    },
    /// It uses a unit that the earlier one keeps busy.
    Unit {
        /// Slot of the machine.
        slot: SlotIndex,
        /// Unit of the slot.
        unit: u8,
    },
    /// It drains, and the result of the earlier one is the last to be written.
    Drain,
    /// Its result would be written in the same cycle as that of the earlier one.
    WritePort {
        /// The slot whose bank it is.
        slot: SlotIndex,
    },
    /// The earlier one redirected the fetch or resolved a branch.
    FrontEnd,
    /// The earlier one issued in the previous cycle; only one bundle issues per cycle.
    Order,
}

/// An edge of the critical path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// Index of the earlier issue.
    pub from: usize,
    /// Index of the later one.
    pub to: usize,
    /// The rule.
    pub kind: LinkKind,
    /// Cycles between their issues.
    pub cycles: Cycle,
}

/// The effect of a faster unit, or front end, on the unchanged program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WhatIf {
    /// The unit, by slot and index; `None` is the front end.
    pub unit: Option<(SlotIndex, u8)>,
    /// Cycles that the trace would then take.
    pub cycles: Cycle,
    /// The stalled cycles that it adds, by kind of cause ([`Cause::KINDS`]), those of the front end excluded. If there are more
    /// cycles than before, these are the reason.
    pub stalls: Stalls,
}

/// Stalled cycles by kind of cause.
pub type Stalls = [i64; Cause::KINDS.len()];

/// The properties of an operation on which the rules depend.
struct OperationTiming {
    slot: SlotIndex,
    unit: u8,
    latency: Cycle,
    dest: Option<Register>,
    sources: Vec<Register>,
}

impl Trace {
    /// A trace that begins with reset.
    pub(crate) fn from_reset(cycles: Cycle, issues: Vec<Issued>) -> Trace {
        Trace { tick: None, cycles, issues, before: None }
    }

    /// The cycle after which the first bundle could issue at the earliest.
    pub(crate) fn start(&self) -> Cycle {
        let first = self.issues.last().map_or(0, |last| (last.cycle + 1).saturating_sub(self.cycles));
        self.tick.unwrap_or(first.saturating_sub(1))
    }

    /// The critical path: a chain of issues from the first to the last, each of which could not have been earlier because of the
    /// one before. Its cycles add up to those between the first and the last issue. If several reasons hold, a data dependence
    /// takes precedence over the order of issue.
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
                // It prevented the issue in the previous cycle.
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

    /// The effect of one cycle less in the latency (and interval) of each unit that the trace uses, and in the front end's refill, found
    /// by replaying the unchanged bundles on the scoreboard.
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

    /// The cycles of a replay without changes. They equal [`Trace::cycles`], unless the emulator and the rules disagree.
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

/// The operations of a bundle that use a unit.
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
