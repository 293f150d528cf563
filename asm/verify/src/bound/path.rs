// SPDX-License-Identifier: MIT OR Apache-2.0
//! Execution of a straight line from a claimed state, by the check's own rules of issue.

use super::flow::{Flow, redirecting};
use crate::clock::{Clock, InFlight};
use crate::code::Operation;
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::certificate::{self, End};
use takt_isa::fp::Host;
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::{Effect, Machine, Register, compute};

/// State of a path at the delivery of a bundle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct State {
    pub(super) time: InFlight,
    pub(super) known: BTreeMap<usize, u32>,
    pub(super) count: Option<u32>,
    pub(super) published: bool,
}

impl State {
    /// State of a certificate; an error is the reason why the machine has no such state.
    pub(super) fn read(state: &certificate::State, machine: &Machine) -> Result<State, String> {
        let mut time = InFlight::default();
        for &(register, left) in &state.pending {
            let is_written =
                Register::new(register.into()).is_some_and(|of| machine.writers(of).iter().next().is_some());
            if !is_written || left == 0 || u32::from(left) >= MAX_LATENCY {
                return Err(format!("register {register} cannot have a result in flight for {left} cycles"));
            }
            time.pending.push((register.into(), left.into()));
        }
        for &(slot, unit, left) in &state.busy {
            let found =
                machine.slots.get(usize::from(slot)).and_then(|slot| slot.units.get(usize::from(unit)));
            if left == 0 || found.is_none_or(|unit| u32::from(left) > unit.interval) {
                return Err(format!("unit {unit} of slot {slot} cannot be busy for {left} cycles"));
            }
            time.busy.push(((slot.into(), unit.into()), left.into()));
        }
        let is_ascending =
            time.pending.is_sorted_by(|a, b| a.0 < b.0) && time.busy.is_sorted_by(|a, b| a.0 < b.0);
        if !is_ascending {
            return Err("its registers or units are not in ascending order".to_owned());
        }
        let known = state.known.iter().map(|(register, value)| (usize::from(*register), *value)).collect();
        Ok(State { time, known, count: state.count, published: state.published })
    }

    /// Checks that a claimed state stands for this one: the same results in flight, the same busy units, and no value that is not known.
    pub(super) fn is_covered_by(&self, claimed: &State, machine: &Machine) -> Result<(), String> {
        let name = |register: usize| {
            let name = Register::new(register).and_then(|register| machine.register_name(register));
            name.unwrap_or_else(|| format!("register {register}"))
        };
        let (here, there) = (&self.time.pending, &claimed.time.pending);
        if here != there {
            let left = |list: &[(usize, u64)], of: usize| {
                list.iter().find(|(register, _)| *register == of).map_or(0, |(_, left)| *left)
            };
            let differs = |(register, _): &&(usize, u64)| left(here, *register) != left(there, *register);
            let register = here.iter().chain(there).find(differs).map_or(0, |(register, _)| *register);
            let (found, claimed) = (left(here, register), left(there, register));
            let name = name(register);
            return Err(format!("the result for {name} comes in {found} cycles, and {claimed} are claimed"));
        }
        if self.time.busy != claimed.time.busy {
            return Err(format!(
                "units are busy (slot and unit, cycles): {:?}, and {:?} is claimed",
                self.time.busy, claimed.time.busy
            ));
        }
        if let Some((register, value)) =
            claimed.known.iter().find(|(register, value)| self.known.get(register) != Some(value))
        {
            return Err(format!("{} is not known to be {value}", name(*register)));
        }
        if claimed.count.is_some() && claimed.count != self.count {
            return Err("the loop is not known to begin with the count that is claimed".to_owned());
        }
        if claimed.published != self.published {
            return Err("it is claimed wrongly whether a `publish` has issued".to_owned());
        }
        Ok(())
    }
}

/// Best and worst case. Sums and products of a certificate's numbers cannot overflow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cost {
    pub(super) best: i128,
    pub(super) worst: i128,
}

impl Cost {
    pub(super) const fn exactly(cycles: u64) -> Cost {
        Cost { best: cycles as i128, worst: cycles as i128 }
    }

    pub(super) fn and(self, other: Cost) -> Cost {
        Cost { best: self.best.saturating_add(other.best), worst: self.worst.saturating_add(other.worst) }
    }

    /// Checks that claimed cycles contain these.
    pub(super) fn is_covered_by(self, claimed: Cost, what: &str) -> Result<(), String> {
        if claimed.best <= self.best && self.worst <= claimed.worst {
            return Ok(());
        }
        Err(format!(
            "{what} takes {} to {} cycles, and {} to {} are claimed",
            self.best, self.worst, claimed.best, claimed.worst
        ))
    }
}

impl From<certificate::Cost> for Cost {
    fn from((best, worst): certificate::Cost) -> Cost {
        Cost { best: best.into(), worst: worst.into() }
    }
}

/// Way on from a place.
#[derive(Clone, Debug)]
pub(super) struct Way {
    pub(super) end: End,
    pub(super) state: Option<State>,
    pub(super) cycles: Cost,
    /// False if the values of registers exclude it.
    pub(super) is_possible: bool,
}

/// Registers that a part of a program may write, and first bundles of loops that it may come to.
#[derive(Clone, Debug, Default)]
pub(super) struct Touched {
    pub(super) registers: BTreeSet<usize>,
    pub(super) heads: BTreeSet<u32>,
}

impl Touched {
    pub(super) fn include(&mut self, other: &Touched) {
        self.registers.extend(&other.registers);
        self.heads.extend(&other.heads);
    }
}

/// Executes the straight line from bundle `first` to `last`. The ways of a call are one, to its first bundle.
pub(super) fn line(
    flow: &Flow<'_>,
    (first, last): (u32, u32),
    state: &State,
    touched: &mut Touched,
    steps: &mut u64,
) -> Result<Vec<Way>, (u32, String)> {
    let machine = flow.program.machine;
    let mut clock = Clock::resume(&state.time, machine);
    let mut known = state.known.clone();
    let mut at = first;
    loop {
        *steps += 1;
        let bundle = flow.bundle(at).map_err(|what| (at, what))?;
        clock.issue(bundle);
        let redirecting = redirecting(bundle);
        let value = redirecting.and_then(|(_, operation)| read(flow, &known, operation.sources[0]));
        execute(flow, bundle, &mut known, touched);
        let is_end = redirecting.is_some() || flow.closes.contains_key(&at);
        if at == last || is_end {
            if at != last {
                return Err((at, format!("the straight line from {first} ends here, and not at {last}")));
            }
            let after = After { flow, at, clock, known, published: state.published };
            return Ok(after.ways(redirecting, value));
        }
        at += 1;
        if flow.loops.contains_key(&at) {
            touched.heads.insert(at);
        }
    }
}

fn read(flow: &Flow<'_>, known: &BTreeMap<usize, u32>, register: usize) -> Option<u32> {
    flow.constants.get(&register).or_else(|| known.get(&register)).copied()
}

/// Executes a bundle on the known values: all operations read before any writes.
fn execute(flow: &Flow<'_>, bundle: &[Operation], known: &mut BTreeMap<usize, u32>, touched: &mut Touched) {
    let result = |operation: &Operation| match operation.op.row().effect {
        Effect::Immediate => Some(operation.constant),
        Effect::Compute => {
            let mut sources = [0; 3];
            for (source, register) in sources.iter_mut().zip(operation.reads()) {
                *source = read(flow, known, *register)?;
            }
            let [a, b, c] = sources;
            Some(compute::<Host>(operation.op, a, b, c).bits)
        }
        _ => None,
    };
    let writes = bundle.iter().filter_map(|operation| Some((operation.dest?, result(operation))));
    let results: Vec<(usize, Option<u32>)> = writes.collect();
    for (dest, value) in results {
        touched.registers.insert(dest);
        match value {
            Some(value) => _ = known.insert(dest, value),
            None => _ = known.remove(&dest),
        }
    }
}

/// Moment after the issue of the last bundle of a line.
struct After<'f> {
    flow: &'f Flow<'f>,
    at: u32,
    clock: Clock,
    known: BTreeMap<usize, u32>,
    published: bool,
}

impl After<'_> {
    /// Ways on, in the order of [`certificate::Place::edges`].
    fn ways(&self, redirecting: Option<(Effect, &Operation)>, value: Option<u32>) -> Vec<Way> {
        let (at, next) = (self.at, self.at.saturating_add(1));
        let machine = self.flow.program.machine;
        let issued = Cost::exactly(self.clock.last);
        let (mut refilled, mut resolved) = (self.clock.clone(), self.clock.clone());
        refilled.redirect(machine);
        resolved.not_taken(machine);
        let on = |end: End, clock: &Clock| {
            let state = State {
                time: clock.in_flight(),
                known: self.known.clone(),
                count: None,
                published: self.published,
            };
            let cycles = Cost::exactly(clock.delivered());
            Way { end, state: Some(state), cycles, is_possible: true }
        };
        let ends = |end: End| Way { end, state: None, cycles: issued, is_possible: true };
        let go = |to: u32, is_jump: bool| End::Go { to, back: is_jump && to <= at };
        let Some((effect, operation)) = redirecting else {
            let head = self.flow.closes.get(&at);
            let back = head.map(|head| on(End::Go { to: *head, back: true }, &self.clock));
            return back.into_iter().chain([on(go(next, false), &self.clock)]).collect();
        };
        let target = operation.constant;
        match effect {
            Effect::Jump => vec![on(go(target, true), &refilled)],
            Effect::BranchZero | Effect::BranchNonzero => {
                let is_taken = value.map(|value| (value == 0) == (effect == Effect::BranchZero));
                let taken = Way { is_possible: is_taken != Some(false), ..on(go(target, true), &refilled) };
                vec![taken, Way { is_possible: is_taken != Some(true), ..on(go(next, false), &resolved) }]
            }
            Effect::Call => vec![on(go(target, false), &refilled)],
            Effect::Return => vec![on(End::Return { at }, &refilled)],
            Effect::Loop => {
                // A body that is shorter than the refill has been fetched past its end.
                let is_short = target.saturating_sub(next) < machine.refill;
                let mut way = on(go(next, false), if is_short { &refilled } else { &self.clock });
                way.state.iter_mut().for_each(|state| state.count = value);
                vec![way]
            }
            Effect::Publish => {
                let mut way = on(go(next, false), &self.clock);
                way.state.iter_mut().for_each(|state| state.published = true);
                let first = (!self.published).then(|| ends(End::Publish { at }));
                [way].into_iter().chain(first).collect()
            }
            Effect::Wait => {
                let mut way = on(End::Wait { at, target }, &refilled);
                way.state.iter_mut().for_each(|state| state.known.clear());
                vec![Way { cycles: issued, ..way }]
            }
            _ => vec![ends(End::Halt { at })],
        }
    }
}
