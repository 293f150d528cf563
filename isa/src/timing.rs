//! The rules of issue and writeback, once. `docs/timing.md` says them in prose for who builds the circuit.
//!
//! A bundle issues as a whole, in order, in the first cycle that meets every rule; each cycle that it waits is charged to
//! the first rule, in this order, that is not met:
//!
//! 1. **front end**: not before the fetch has delivered it (after a taken branch, a wait, a reset);
//! 2. **operand**: every source's pending result is on its result bus; charged to the producer whose result comes last;
//! 3. **destination**: no earlier result for a register that the bundle writes is pending;
//! 4. **unit**: every unit that it uses accepts an operation;
//! 5. **drain**: for operations that ask for it, no result at all is pending;
//! 6. **write port**: no earlier operation writes the same bank in the cycle in which one of this bundle's will.
//!
//! Because rules 1 to 5 once met stay met while the bundle waits, and rule 6 is tried cycle by cycle after them, the charge of
//! each cycle is well defined and can be computed without stepping through the cycles. (After a drain nothing is booked, so
//! that a bundle is never charged to both.)

use crate::encode::Instruction;
use crate::number::{BundleAddress, Register, SlotIndex};
use crate::spec::instructions::Function;
use crate::spec::machines::Machine;
use crate::spec::units::{MAX_LATENCY, Unit};
use std::ops::Range;

/// A cycle's number; cycle 0 is the first after reset.
pub type Cycle = u64;

/// Cycles between a value on a core's input pins and the first cycle in which a bundle that issues reads it.
pub const INPUT_DELAY: Cycle = 3;
/// The same for latched ports, between a value on the input pins and the first tick that takes it.
pub const LATCHED_INPUT_DELAY: Cycle = 2;
/// Cycles between the tick on its pin and the cycle in which it is seen.
pub const TICK_DELAY: Cycle = 1;
/// Cycles between the issue of a `wait` and the cycle in which the pins tell of it.
pub const ENDED_DELAY: Cycle = 2;

/// Cycles, from the fewest to the most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Span {
    /// No run takes fewer.
    pub best: Cycle,
    /// No run takes more.
    pub worst: Cycle,
}

impl Span {
    /// No cycle.
    pub const ZERO: Span = Span { best: 0, worst: 0 };

    /// The cycles of two pieces of a run, one after the other.
    #[must_use]
    pub fn and(self, other: Span) -> Span {
        Span { best: self.best.saturating_add(other.best), worst: self.worst.saturating_add(other.worst) }
    }

    /// The cycles of two alternatives.
    #[must_use]
    pub fn or(self, other: Span) -> Span {
        Span { best: self.best.min(other.best), worst: self.worst.max(other.worst) }
    }

    /// The same after so many more cycles.
    #[must_use]
    pub fn after(self, cycles: Cycle) -> Span {
        self.and(Span { best: cycles, worst: cycles })
    }
}

/// The cause of a cycle without issue.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub enum Cause {
    /// The front end refills after a redirection or decides a conditional branch.
    Branch {
        /// The bundle that redirected (after reset: 0).
        from: BundleAddress,
    },
    /// A source is not ready.
    Operand {
        /// The register.
        register: Register,
        /// The bundle that computes it.
        producer: BundleAddress,
    },
    /// A destination still awaits an earlier result.
    Destination {
        /// The register.
        register: Register,
        /// The bundle that computes the earlier result.
        producer: BundleAddress,
    },
    /// A unit accepts no operation yet.
    Unit {
        /// Slot of the machine.
        slot: SlotIndex,
        /// Unit of the slot.
        unit: u8,
    },
    /// Earlier results must be written first.
    Drain,
    /// The bank's write port is taken in the cycle of this operation's writeback.
    WritePort {
        /// The slot whose bank it is.
        slot: SlotIndex,
    },
    /// The program waits for the tick.
    Wait,
}

impl Cause {
    /// Names of the kinds, in the order of the rules; indices are [`Cause::kind`].
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

    /// The names of the kinds that a machine can have: it waits for a unit only if one takes an operation in fewer than all cycles.
    pub fn kinds_of(machine: &Machine) -> impl Iterator<Item = &'static str> {
        let iterative = machine.slots.iter().flat_map(|slot| slot.units).any(|unit| unit.interval > 1);
        Cause::KINDS.into_iter().filter(move |&kind| kind != "unit" || iterative)
    }

    /// The kind's name.
    pub const fn name(self) -> &'static str {
        Cause::KINDS[self.kind()]
    }
}

/// A resource that one operation at most holds in a cycle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Resource {
    /// The issue slot.
    Slot(SlotIndex),
    /// A unit: an index over all units of the machine, slot after slot.
    Unit(u16),
    /// The write port of the bank of a slot.
    WritePort(SlotIndex),
}

/// Reservation table of one operation (Kogge 1981): the resources that it holds, in cycles after its issue. The scoreboard applies
/// rules 2 to 6 with it, and the assembler's scheduler plans with it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reservation {
    /// The slot that issues it.
    pub slot: SlotIndex,
    /// The unit that executes it: an index over all units of the machine, slot after slot; `None` for an idle operation.
    pub unit: Option<u16>,
    /// Cycles after the issue in which the unit accepts the next operation (rule 4).
    pub interval: u32,
    /// Cycles after the issue in which its result is on the bus and written to the bank, if it writes a register: until then
    /// rules 2, 3 and 5 hold others up, and rule 6 in this cycle alone.
    pub writeback: Option<u32>,
}

impl Reservation {
    /// The table of an operation on a slot of a machine; `writes` if it writes a register.
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

    /// Each resource, and the cycles after the issue in which it is held.
    #[inline]
    pub fn held(&self) -> impl Iterator<Item = (Resource, Range<u32>)> + use<> {
        let unit = self.unit.map(|unit| (Resource::Unit(unit), 0..self.interval));
        let port = self.writeback.map(|cycle| (Resource::WritePort(self.slot), cycle..cycle + 1));
        [Some((Resource::Slot(self.slot), 0..1)), unit, port].into_iter().flatten()
    }
}

/// One operation of a bundle, as the rules see it.
#[derive(Clone, Copy, Debug)]
struct Operation {
    reservation: Reservation,
    /// Its unit, as an index in the slot.
    unit: u8,
    /// Registers that it reads.
    sources: [Register; 3],
    source_count: u8,
    /// The register that it writes.
    dest: Option<Register>,
}

/// A bundle, as the rules see it: made once for each address of a program.
#[derive(Clone, Debug, Default)]
pub struct Bundle {
    operations: Vec<Operation>,
    drains: bool,
}

impl Bundle {
    /// The parts of a bundle that the rules need: one instruction for each slot of `machine`, each of which
    /// [`Instruction::place`] accepts.
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

    /// The bundle on a machine that differs in one unit: what a unit of another speed would do to a program as it is.
    pub fn with_unit(mut self, slot: SlotIndex, unit: u8, latency: u32, interval: u32) -> Bundle {
        let same = |operation: &&mut Operation| (operation.reservation.slot, operation.unit) == (slot, unit);
        for operation in self.operations.iter_mut().filter(same) {
            let writeback = operation.dest.map(|_| latency);
            operation.reservation = Reservation { interval, writeback, ..operation.reservation };
        }
        self
    }

    /// The destinations, each with the cycles from issue to its writeback.
    pub fn writebacks(&self) -> impl Iterator<Item = (Register, u32)> + '_ {
        self.operations
            .iter()
            .filter_map(|operation| Some((operation.dest?, operation.reservation.writeback?)))
    }
}

/// The issue of a bundle: its cycle, and the causes of the cycles before it. The charges add up to `cycle - earliest`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Issue {
    /// The cycle of issue.
    pub cycle: Cycle,
    stalls: [(Cause, u32); 5],
    count: u8,
}

impl Issue {
    /// Causes and numbers of stalled cycles, in time order.
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

/// The part of a scoreboard that counts from some cycle on, in cycles from that one: two states with equal residues time every
/// program alike.
///
/// The results still pending say it all but for the units that are busy: `drained` is the last of them, and a bank's bookings are
/// those of its registers, since rule 3 lets no register have two results pending.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Debug, Default)]
pub struct Residue {
    /// Registers, ascending, and the cycles until their results are on the bus.
    pending: Vec<(Register, u16)>,
    /// Slots, units, ascending, and the cycles until they accept an operation.
    busy: Vec<(SlotIndex, u8, u16)>,
}

impl Residue {
    /// The residue after so many more cycles without an issue.
    pub fn later(&self, cycles: u16) -> Residue {
        let pending = self.pending.iter().filter(|(_, left)| *left > cycles);
        let busy = self.busy.iter().filter(|(_, _, left)| *left > cycles);
        Residue {
            pending: pending.map(|&(register, left)| (register, left - cycles)).collect(),
            busy: busy.map(|&(slot, unit, left)| (slot, unit, left - cycles)).collect(),
        }
    }

    /// True if nothing is left: the state after a reset.
    pub fn is_empty(&self) -> bool {
        self.pending.is_empty() && self.busy.is_empty()
    }
}

const PORT_WINDOW: usize = MAX_LATENCY as usize;

/// The scoreboard: what is pending, busy and booked.
#[derive(Clone, Debug)]
pub struct Scoreboard {
    /// For each register, the cycle in which its pending result is on the bus, and who computes it.
    ready: Box<[(Cycle, BundleAddress); Register::COUNT]>,
    /// For each slot and unit, the first cycle in which the unit accepts an operation.
    free: Vec<Vec<Cycle>>,
    /// For each slot, the cycles in which its bank is written: `booked[slot][cycle % PORT_WINDOW] == cycle`.
    booked: Vec<[Cycle; PORT_WINDOW]>,
    /// The last writeback.
    drained: Cycle,
}

impl Scoreboard {
    /// Nothing pending.
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

    /// The issue that a bundle would have from `earliest` on; nothing changes.
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

        // A later cycle can only be free: bookings end MAX_LATENCY cycles after the last issue.
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

    /// The past that can still hold up bundles delivered in cycle `now`, which no bundle has issued in or after.
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

    /// A scoreboard on which a bundle delivered in cycle 0 meets what one delivered in a residue's cycle did.
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

/// The first cycle in which the bundle after one issued in `cycle` may issue, if nothing redirects.
#[inline]
pub fn after_sequential(cycle: Cycle) -> Cycle {
    cycle + 1
}

/// As [`after_sequential`], after a conditional branch that is not taken.
#[inline]
pub fn after_not_taken(machine: &Machine, cycle: Cycle) -> Cycle {
    cycle + 1 + Cycle::from(machine.resolve)
}

/// The first cycle in which the target of a bundle that issued in `cycle` and redirects may issue.
#[inline]
pub fn after_redirect(machine: &Machine, cycle: Cycle) -> Cycle {
    cycle + 1 + Cycle::from(machine.refill)
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
