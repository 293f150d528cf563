// SPDX-License-Identifier: MIT OR Apache-2.0
//! The timing rules: in-order issue with hazard detection by a scoreboard. Emulator, scheduler and static analysis all use this
//! implementation; `docs/timing.md` states the rules in prose for the designer of the circuit.
//!
//! A bundle issues as a whole, in program order, in the first cycle that meets every rule. Each stalled cycle is charged to
//! the first rule, in this order, that is not met:
//!
//! 1. **front end**: the bundle has been fetched (after a taken branch, a wait or a reset, that takes cycles);
//! 2. **operand** (read after write): the pending result of every source is on its result bus, from which it is forwarded.
//!    The stall is charged to the producer whose result comes last;
//! 3. **destination** (write after write): no earlier result is pending for a register that the bundle writes;
//! 4. **unit** (structural): every unit that the bundle uses accepts an operation;
//! 5. **drain**: no result at all is pending, for operations that require it;
//! 6. **write port** (structural): no earlier operation writes to a bank in the cycle in which the bundle would write to it.
//!
//! Each cycle's charge is well defined and can be computed without stepping through the cycles, because rules 1 to 5, once
//! met, stay met while the bundle waits, and rule 6 is tried cycle by cycle after them. (After a drain no write port is
//! booked, so that a bundle is never charged for both.)

use crate::encode::Instruction;
use crate::number::{BundleAddress, Register, SlotIndex};
use crate::spec::instructions::Function;
use crate::spec::machines::Machine;
use crate::spec::units::{MAX_LATENCY, Unit};
use std::ops::Range;

/// A cycle's number; cycle 0 is the first after reset.
pub type Cycle = u64;

/// Cycles from a value's arrival at a core's input pins to the first cycle in which an issuing bundle reads it.
pub const INPUT_DELAY: Cycle = 3;
/// Cycles from a value's arrival at the input pins to the first tick that latches it, for latched ports.
pub const LATCHED_INPUT_DELAY: Cycle = 2;
/// Cycles from the tick on its pin to the cycle in which the core sees it.
pub const TICK_DELAY: Cycle = 1;
/// Cycles from the issue of a `wait` to the cycle in which the pins report it.
pub const ENDED_DELAY: Cycle = 2;

/// An interval of cycle counts: best and worst case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Span {
    /// Lower bound over all runs.
    pub best: Cycle,
    /// Upper bound over all runs.
    pub worst: Cycle,
}

impl Span {
    /// An interval of zero cycles.
    pub const ZERO: Span = Span { best: 0, worst: 0 };

    /// The cycles of two pieces of a run in sequence: the sum.
    #[must_use]
    pub fn and(self, other: Span) -> Span {
        Span { best: self.best.saturating_add(other.best), worst: self.worst.saturating_add(other.worst) }
    }

    /// The cycles of two alternatives: the interval that contains both.
    #[must_use]
    pub fn or(self, other: Span) -> Span {
        Span { best: self.best.min(other.best), worst: self.worst.max(other.worst) }
    }

    /// The interval with `cycles` added to both ends.
    #[must_use]
    pub fn after(self, cycles: Cycle) -> Span {
        self.and(Span { best: cycles, worst: cycles })
    }
}

/// The cause of a stalled cycle.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub enum Cause {
    /// The front end refills after a redirection or decides a conditional branch.
    Branch {
        /// The bundle that redirected; `None` after reset.
        from: Option<BundleAddress>,
    },
    /// A source is not ready.
    Operand {
        /// Address of the register.
        register: Register,
        /// Bundle that computes the operand.
        producer: BundleAddress,
    },
    /// A destination still waits for an earlier result.
    Destination {
        /// Address of the register.
        register: Register,
        /// Bundle that computes the earlier result.
        producer: BundleAddress,
    },
    /// A unit accepts no operation yet.
    Unit {
        /// Slot of the machine.
        slot: SlotIndex,
        /// Unit of the slot.
        unit: u8,
    },
    /// All earlier results must be written first.
    Drain,
    /// The bank's write port is taken in the cycle of this operation's writeback.
    WritePort {
        /// Slot that writes the bank.
        slot: SlotIndex,
    },
    /// The program waits for the tick.
    Wait,
}

impl Cause {
    /// The names of the kinds, in the order of the rules, indexed by [`Cause::kind`].
    pub const KINDS: [&'static str; 7] =
        ["branch", "operand", "destination", "unit", "drain", "write port", "wait"];

    /// The cause's kind, as an index into [`Cause::KINDS`].
    #[inline]
    pub const fn kind(self) -> usize {
        match self {
            Cause::Branch { .. } => 0,
            Cause::Operand { .. } => 1,
            Cause::Destination { .. } => 2,
            Cause::Unit { .. } => 3,
            Cause::Drain => 4,
            Cause::WritePort { .. } => 5,
            Cause::Wait => 6,
        }
    }

    /// The names of the kinds that can occur on a machine: stalls for a unit need a unit that is not fully pipelined.
    pub fn kinds_of(machine: &Machine) -> impl Iterator<Item = &'static str> {
        let iterative = machine.slots.iter().flat_map(|slot| slot.units).any(|unit| unit.interval > 1);
        Cause::KINDS.into_iter().filter(move |&kind| kind != "unit" || iterative)
    }

    /// Name of the cause's kind.
    pub const fn name(self) -> &'static str {
        Cause::KINDS[self.kind()]
    }
}

/// A resource that at most one operation holds in a cycle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Resource {
    /// The issue slot of an operation.
    Slot(SlotIndex),
    /// A unit: an index over all units of the machine, slot after slot.
    Unit(u16),
    /// The write port of the bank of a slot.
    WritePort(SlotIndex),
}

/// Reservation table of one operation (Kogge 1981): the resources that it holds, in cycles relative to its issue. The scoreboard
/// applies rules 2 to 6 with it, and the assembler's scheduler plans with it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reservation {
    /// Slot that issues the operation.
    pub slot: SlotIndex,
    /// Unit that executes the operation: an index over all units of the machine, slot after slot; `None` for an idle operation.
    pub unit: Option<u16>,
    /// Initiation interval: cycles from the issue until the unit accepts the next operation (rule 4).
    pub interval: u32,
    /// Latency of an operation that writes a register: cycles from the issue to the cycle in which its result is on the bus
    /// and written to the bank. Rules 2, 3 and 5 stall other operations until then, rule 6 only in that very cycle.
    pub writeback: Option<u32>,
}

impl Reservation {
    /// The table of an operation in a slot of a machine; `writes` says whether the operation writes a register.
    pub fn new(machine: &Machine, slot: SlotIndex, function: Function, writes: bool) -> Reservation {
        let row = machine.slot(slot);
        let Some(unit) = row.unit_index(function) else {
            return Reservation { slot, unit: None, interval: 1, writeback: None };
        };
        let before: usize = machine.slots[..slot.index()].iter().map(|slot| slot.units.len()).sum();
        let Unit { latency, interval, .. } = row.units[unit];
        let unit = Some((before + unit) as u16);
        Reservation { slot, unit, interval, writeback: writes.then_some(latency) }
    }

    /// The resources, each with the cycles relative to the issue in which it is held.
    #[inline]
    pub fn held(&self) -> impl Iterator<Item = (Resource, Range<u32>)> + use<> {
        let unit = self.unit.map(|unit| (Resource::Unit(unit), 0..self.interval));
        let port = self.writeback.map(|cycle| (Resource::WritePort(self.slot), cycle..cycle + 1));
        [Some((Resource::Slot(self.slot), 0..1)), unit, port].into_iter().flatten()
    }
}

/// The properties of an operation on which the rules depend.
#[derive(Clone, Copy, Debug)]
struct Operation {
    reservation: Reservation,
    /// Index of the unit among the slot's units.
    unit: u8,
    /// Registers that the operation reads.
    sources: [Register; 3],
    source_count: u8,
    /// Register that the operation writes.
    dest: Option<Register>,
}

/// The properties of a bundle on which the rules depend, derived once for each address of a program.
#[derive(Clone, Debug, Default)]
pub struct Bundle {
    operations: Vec<Operation>,
    drains: bool,
}

impl Bundle {
    /// Derives the properties from instructions in slot order, one for each slot of `machine`, each accepted by
    /// [`Instruction::place`].
    pub fn new(machine: &Machine, instructions: &[Instruction]) -> Bundle {
        let mut bundle = Bundle::default();
        for ((s, slot), instruction) in machine.numbered_slots().zip(instructions) {
            let row = instruction.op.row();
            let Some(u) = slot.unit_index(row.function) else {
                continue;
            };
            let dest = instruction.writes(slot);
            bundle.operations.push(Operation {
                reservation: Reservation::new(machine, s, row.function, dest.is_some()),
                unit: u as u8,
                sources: instruction.sources,
                source_count: row.shape.sources() as u8,
                dest,
            });
            bundle.drains |= row.effect.drains();
        }
        bundle
    }

    /// The bundle on a machine that differs in the timing of one unit, to show what a faster or slower unit would do to a
    /// program that is not rescheduled.
    pub fn with_unit(mut self, slot: SlotIndex, unit: u8, latency: u32, interval: u32) -> Bundle {
        let same = |operation: &&mut Operation| (operation.reservation.slot, operation.unit) == (slot, unit);
        for operation in self.operations.iter_mut().filter(same) {
            let writeback = operation.dest.map(|_| latency);
            operation.reservation = Reservation { interval, writeback, ..operation.reservation };
        }
        self
    }

    /// The destinations, each with the cycles from issue to writeback.
    pub fn writebacks(&self) -> impl Iterator<Item = (Register, u32)> + '_ {
        self.operations
            .iter()
            .filter_map(|operation| Some((operation.dest?, operation.reservation.writeback?)))
    }
}

/// The issue of a bundle: its cycle, and the stalls before it. These add up to `cycle - earliest`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Issue {
    /// The cycle of issue.
    pub cycle: Cycle,
    stalls: [(Cause, u32); 5],
    count: u8,
}

impl Issue {
    /// The causes of stalls, each with its number of cycles, in time order.
    #[inline]
    pub fn stalls(&self) -> &[(Cause, u32)] {
        &self.stalls[..self.count.into()]
    }

    #[inline]
    fn advance(&mut self, to: Cycle, cause: Cause) {
        if to > self.cycle {
            self.stalls[usize::from(self.count)] = (cause, (to - self.cycle) as u32);
            self.count += 1;
            self.cycle = to;
        }
    }
}

/// The canonical timing state: the part of a scoreboard that still matters from some cycle on, in cycles relative to it. Two
/// scoreboards with equal residues time every continuation alike.
///
/// Pending results and busy units determine all else: `drained` is the cycle of the last pending result, and the bookings of a
/// bank's write port follow from its registers, since rule 3 lets no register have two pending results.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Debug, Default)]
pub struct Residue {
    /// Registers with a pending result, ascending, and the cycles until it is on the bus.
    pending: Vec<(Register, u16)>,
    /// Busy units (slot, unit), ascending, and the cycles until each accepts an operation.
    busy: Vec<(SlotIndex, u8, u16)>,
}

impl Residue {
    /// The residue after `cycles` more cycles without an issue.
    pub fn later(&self, cycles: u16) -> Residue {
        let pending = self.pending.iter().filter(|(_, left)| *left > cycles);
        let busy = self.busy.iter().filter(|(_, _, left)| *left > cycles);
        Residue {
            pending: pending.map(|&(register, left)| (register, left - cycles)).collect(),
            busy: busy.map(|&(slot, unit, left)| (slot, unit, left - cycles)).collect(),
        }
    }

    /// Registers with a pending result, ascending, and the cycles until it is on the bus.
    pub fn pending(&self) -> &[(Register, u16)] {
        &self.pending
    }

    /// Busy units (slot, unit), ascending, and the cycles until each accepts an operation.
    pub fn busy(&self) -> &[(SlotIndex, u8, u16)] {
        &self.busy
    }

    /// No result is pending and no unit busy, as after a reset.
    pub fn is_empty(&self) -> bool {
        self.pending.is_empty() && self.busy.is_empty()
    }
}

const PORT_WINDOW: usize = MAX_LATENCY as usize;

/// The scoreboard: pending results, busy units, booked write ports.
#[derive(Clone, Debug)]
pub struct Scoreboard {
    /// For each register, the cycle in which its last result is (or was) on the bus, and the bundle that computes it.
    ready: Box<[(Cycle, BundleAddress); Register::COUNT]>,
    /// For each slot and unit, the first cycle in which the unit accepts an operation.
    free: Vec<Vec<Cycle>>,
    /// For each slot, the cycles in which its bank is written: `booked[slot][cycle % PORT_WINDOW] == cycle`.
    booked: Vec<[Cycle; PORT_WINDOW]>,
    /// The cycle of the last writeback.
    drained: Cycle,
}

impl Scoreboard {
    /// The scoreboard after reset.
    pub fn new(machine: &Machine) -> Scoreboard {
        Scoreboard {
            ready: vec![(0, BundleAddress::RESET); Register::COUNT]
                .try_into()
                .expect("the vector has that length"),
            free: machine.slots.iter().map(|slot| vec![0; slot.units.len()]).collect(),
            booked: vec![[0; PORT_WINDOW]; machine.slots.len()],
            drained: 0,
        }
    }

    /// Issues a bundle from address `at` in the first cycle from `earliest` on that meets every rule.
    pub fn issue(&mut self, bundle: &Bundle, at: BundleAddress, earliest: Cycle) -> Issue {
        let issue = self.plan(bundle, earliest);
        for operation in &bundle.operations {
            let Reservation { slot, interval, writeback, .. } = operation.reservation;
            let (slot, unit) = (slot.index(), usize::from(operation.unit));
            self.free[slot][unit] = issue.cycle + Cycle::from(interval);
            if let (Some(dest), Some(after)) = (operation.dest, writeback) {
                let writeback = issue.cycle + Cycle::from(after);
                self.ready[dest.index()] = (writeback, at);
                self.booked[slot][writeback as usize % PORT_WINDOW] = writeback;
                self.drained = self.drained.max(writeback);
            }
        }
        issue
    }

    /// The issue that [`Scoreboard::issue`] would return, without a change of state.
    pub fn plan(&self, bundle: &Bundle, earliest: Cycle) -> Issue {
        let mut issue = Issue { cycle: earliest, stalls: [(Cause::Drain, 0); 5], count: 0 };

        let last = |registers: &mut dyn Iterator<Item = Register>,
                    ready: &[(Cycle, BundleAddress); Register::COUNT]| {
            registers.fold((0, Register::ZERO, BundleAddress::RESET), |last, register| {
                let (cycle, producer) = ready[register.index()];
                if cycle > last.0 { (cycle, register, producer) } else { last }
            })
        };
        let mut sources = bundle
            .operations
            .iter()
            .flat_map(|operation| &operation.sources[..operation.source_count.into()])
            .copied();
        let (cycle, register, producer) = last(&mut sources, &self.ready);
        issue.advance(cycle, Cause::Operand { register, producer });

        let mut dests = bundle.operations.iter().filter_map(|operation| operation.dest);
        let (cycle, register, producer) = last(&mut dests, &self.ready);
        issue.advance(cycle, Cause::Destination { register, producer });

        let busiest = bundle
            .operations
            .iter()
            .map(|operation| {
                (self.free[operation.reservation.slot.index()][usize::from(operation.unit)], operation)
            })
            .reduce(|last, next| if next.0 > last.0 { next } else { last });
        if let Some((cycle, &Operation { reservation, unit, .. })) = busiest {
            issue.advance(cycle, Cause::Unit { slot: reservation.slot, unit });
        }

        if bundle.drains {
            issue.advance(self.drained, Cause::Drain);
        }

        // This ends: no port is booked more than MAX_LATENCY cycles after the last issue.
        let (mut cycle, mut last_taken) = (issue.cycle, None);
        let taken = |cycle: Cycle| {
            bundle.operations.iter().map(|operation| operation.reservation).find(|reservation| {
                reservation.writeback.is_some_and(|after| {
                    let writeback = cycle + Cycle::from(after);
                    self.booked[reservation.slot.index()][writeback as usize % PORT_WINDOW] == writeback
                })
            })
        };
        while let Some(Reservation { slot, .. }) = taken(cycle) {
            cycle += 1;
            last_taken = Some(slot);
        }
        if let Some(slot) = last_taken {
            issue.advance(cycle, Cause::WritePort { slot });
        }
        issue
    }

    /// The residue for bundles delivered in cycle `now`; no bundle may have issued in that cycle or after it.
    pub fn residue(&self, now: Cycle) -> Residue {
        let pending = Register::all().zip(&self.ready[..]).filter(|(_, (ready, _))| *ready > now);
        let units = SlotIndex::all().zip(&self.free).flat_map(|(s, units)| {
            units.iter().enumerate().filter(|(_, free)| **free > now).map(move |(u, free)| (s, u, free))
        });
        Residue {
            pending: pending.map(|(register, (ready, _))| (register, (ready - now) as u16)).collect(),
            busy: units.map(|(slot, unit, free)| (slot, unit as u8, (free - now) as u16)).collect(),
        }
    }

    /// The scoreboard that has a given residue in cycle 0: the inverse of [`Scoreboard::residue`].
    pub fn resume(machine: &Machine, residue: &Residue) -> Scoreboard {
        let mut scoreboard = Scoreboard::new(machine);
        for &(register, cycles) in &residue.pending {
            let writeback = Cycle::from(cycles);
            scoreboard.ready[register.index()] = (writeback, BundleAddress::RESET);
            scoreboard.drained = scoreboard.drained.max(writeback);
            if let Some(slot) = machine.slots.iter().position(|slot| slot.bank.contains(register)) {
                scoreboard.booked[slot][writeback as usize % PORT_WINDOW] = writeback;
            }
        }
        for &(slot, unit, cycles) in &residue.busy {
            scoreboard.free[slot.index()][usize::from(unit)] = cycles.into();
        }
        scoreboard
    }

    /// The cycle in which the last pending result is on its bus.
    pub fn drained(&self) -> Cycle {
        self.drained
    }

    /// The cycle in which a register's last result is (or was) on its bus, and the bundle that computed it.
    pub fn ready(&self, register: Register) -> (Cycle, BundleAddress) {
        self.ready[register.index()]
    }
}

/// The first cycle in which a bundle may issue after its predecessor issued in `cycle`, if nothing redirects.
#[inline]
pub fn after_sequential(cycle: Cycle) -> Cycle {
    cycle + 1
}

/// The first cycle in which a bundle may issue after a conditional branch issued in `cycle` and is not taken.
#[inline]
pub fn after_not_taken(machine: &Machine, cycle: Cycle) -> Cycle {
    cycle + 1 + Cycle::from(machine.resolve)
}

/// The first cycle in which the target of a bundle that issued in `cycle` and redirects may issue.
#[inline]
pub fn after_redirect(machine: &Machine, cycle: Cycle) -> Cycle {
    cycle + 1 + Cycle::from(machine.refill)
}

/// The first cycle in which a bundle may issue after a `loop` in bundle `at` whose body ends before `end`. A body that is empty or shorter
/// than the refill has been fetched past its end by then, and is fetched again; a longer one loses no cycle.
#[inline]
pub fn after_loop(machine: &Machine, at: BundleAddress, end: BundleAddress, cycle: Cycle) -> Cycle {
    let body = end.get().saturating_sub(at.get() + 1);
    if body < machine.refill { after_redirect(machine, cycle) } else { after_sequential(cycle) }
}

/// The first cycle in which bundle 0 may issue after reset.
#[inline]
pub fn after_reset(machine: &Machine) -> Cycle {
    Cycle::from(machine.refill)
}

/// The first cycle in which the target of a `wait` issued in `waited` may issue, when the tick is seen in cycle `tick`.
#[inline]
pub fn after_tick(machine: &Machine, waited: Cycle, tick: Cycle) -> Cycle {
    after_redirect(machine, waited).max(tick + 1)
}
