// SPDX-License-Identifier: MIT OR Apache-2.0
//! Symbolic execution of one of the two programs, up to where its way depends on a value that is not known.
//!
//! A register is not read before its last result is there, and not written while a result for it is in flight (docs/timing.md): so
//! values do not depend on latencies, and bundles can be executed one after another.

use crate::Difference;
use crate::clock::Clock;
use crate::code::{Code, Fused, Operation};
use crate::memory::{Map, Memory};
use crate::term::{MAX_TERMS, Node, Term, Terms};
use foldhash::{HashMap, HashSet};
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::program::Location;
use takt_isa::{Effect, Machine, Type};

/// The most bundles that a check executes, of both programs together.
pub const MAX_STEPS: u64 = 50_000_000;

/// The state that both runs of a segment share.
pub(crate) struct World<'a> {
    pub(crate) terms: Terms,
    pub(crate) map: Map,
    pub(crate) machine: &'a Machine,
    /// The addresses that the source has accessed since the last cut, and the array of each that it says.
    pub(crate) touched: HashMap<Term, Option<usize>>,
    /// Registers that the source has read since the last cut though nothing may have written them: if nothing has, it has
    /// faulted there, and the image may.
    pub(crate) risked: HashSet<Term>,
    /// Branches of the source, by bundle, of which both ways are computed and selected from, as the image does.
    pub(crate) selected: HashSet<u32>,
    /// Counts of loops that the source has begun since the last cut and that are not known, with the most that it allows.
    pub(crate) counted: HashMap<Term, u32>,
    pub(crate) steps: u64,
    pub(crate) fused: BTreeSet<usize>,
}

/// A program that runs.
#[derive(Clone, Debug)]
pub(crate) struct Side<'a> {
    pub(crate) code: &'a Code,
    pub(crate) is_image: bool,
    pub(crate) at: u32,
    pub(crate) registers: Vec<Term>,
    pub(crate) calls: Vec<u32>,
    /// Loops under way: first bundle, and the one after the last.
    pub(crate) loops: Vec<(u32, u32)>,
    /// Their iterations left.
    pub(crate) left: Vec<Term>,
    pub(crate) memory: Memory,
    /// Flags raised before the last cut, and by what since.
    pub(crate) flags: (Term, BTreeSet<Term>),
    /// The values written to each output port since the last cut.
    pub(crate) ports: BTreeMap<usize, Vec<(Term, Option<Location>)>>,
    /// The stores since the last cut: address, word.
    pub(crate) stores: Vec<(Term, Term, Option<Location>)>,
    /// The loops begun since the last cut whose count is not known: the count, and the most that the source allows.
    pub(crate) counts: Vec<(Term, u32)>,
    /// Of each fused product the factors and the value.
    products: HashMap<usize, ([Term; 2], Term)>,
    pub(crate) clock: Option<Clock>,
}

/// The reason why a run stops.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Event {
    /// It goes on at one of two bundles, on whether a value is zero.
    Branch { condition: Term, target: u32, zero: bool },
    /// A loop goes on or ends.
    LoopEnd { condition: Term },
    /// It waits for the tick, to go on at a bundle.
    Wait(u32),
    /// It has ended.
    Halt,
}

impl<'a> Side<'a> {
    pub(crate) fn new(code: &'a Code, is_image: bool, memory: Memory) -> Side<'a> {
        Side {
            code,
            is_image,
            at: 0,
            registers: Vec::new(),
            calls: Vec::new(),
            loops: Vec::new(),
            left: Vec::new(),
            memory,
            flags: (Terms::ZERO, BTreeSet::new()),
            ports: BTreeMap::new(),
            stores: Vec::new(),
            counts: Vec::new(),
            products: HashMap::default(),
            clock: None,
        }
    }

    pub(crate) fn location(&self) -> Option<Location> {
        self.code.bundles.get(self.at as usize)?.iter().find_map(|operation| operation.location)
    }

    fn wrong(&self, operation: Option<&Operation>, what: &str) -> Difference {
        let whose = if self.is_image { "the image" } else { "the source" };
        Difference {
            place: operation.map_or_else(|| self.location(), |operation| operation.location),
            what: format!("{whose} {what}"),
            source: None,
            image: None,
        }
    }

    /// Runs to the next event. The program stays at the bundle of the event, which has been executed.
    pub(crate) fn run(&mut self, world: &mut World<'_>) -> Result<Event, Difference> {
        loop {
            world.steps += 1;
            if world.steps > MAX_STEPS || world.terms.count() > MAX_TERMS {
                return Err(self.wrong(None, "takes longer than the check's limit of bundles and terms"));
            }
            let code = self.code;
            let Some(bundle) = code.bundles.get(self.at as usize) else {
                return Err(self.wrong(None, "runs past its last bundle"));
            };
            if let Some(clock) = &mut self.clock {
                clock.issue(bundle);
            }
            let flow = self.execute(bundle, world)?;
            if let Some(event) = self.follow(flow, world)? {
                match event {
                    Event::Branch { condition, .. } | Event::LoopEnd { condition } => {
                        match world.terms.known(condition) {
                            Some(bits) => self.resume(event, bits != 0, world),
                            None if self.selects(event, world) => {}
                            None => return Ok(event),
                        }
                    }
                    Event::Wait(_) | Event::Halt => return Ok(event),
                }
            }
        }
    }

    fn read(
        &self,
        operation: &Operation,
        register: usize,
        world: &mut World<'_>,
    ) -> Result<Term, Difference> {
        let value = self.registers[register];
        if world.terms.may_be_unwritten(value) {
            if !self.is_image {
                world.risked.insert(value);
            } else if !world.risked.contains(&value) {
                return Err(self.wrong(Some(operation), "reads a register that may be unwritten"));
            }
        }
        Ok(value)
    }

    /// Executes a bundle. Returns the operation that decides where it goes on, and the value that this one reads.
    fn execute(
        &mut self,
        bundle: &'a [Operation],
        world: &mut World<'_>,
    ) -> Result<Option<(&'a Operation, Term)>, Difference> {
        let mut flow = None;
        let mut results: Vec<(&Operation, Term)> = Vec::with_capacity(bundle.len());
        let mut raised: Vec<Term> = Vec::new();
        let mut clears = false;
        for operation in bundle {
            let mut sources = [Terms::ZERO; 3];
            for (value, &register) in sources.iter_mut().zip(operation.reads()) {
                *value = self.read(operation, register, world)?;
            }
            let value = match operation.op.row().effect {
                Effect::Compute => {
                    let (value, flags) = self.compute(operation, sources, world)?;
                    raised.extend(flags);
                    value
                }
                Effect::Immediate => world.terms.constant(operation.constant),
                Effect::Load | Effect::Store => self.access(operation, sources, world)?,
                Effect::ReadFlags => {
                    let all = std::iter::once(self.flags.0).chain(self.flags.1.iter().copied());
                    world.terms.list(all.collect::<Vec<Term>>())
                }
                Effect::ClearFlags => {
                    clears = true;
                    continue;
                }
                Effect::Nothing => continue,
                _ => {
                    flow = Some((operation, sources[0]));
                    continue;
                }
            };
            results.push((operation, value));
        }
        if clears {
            self.flags = (Terms::ZERO, BTreeSet::new());
        }
        self.flags.1.extend(raised);
        for (operation, value) in results {
            let Some(dest) = operation.dest else { continue };
            self.registers[dest] = value;
            if let Some(location) = operation.location.filter(|_| !self.is_image)
                && matches!(world.terms.node(value), Node::Apply(..))
            {
                world.terms.origins.entry(value).or_insert(location);
            }
            if let Some(port) = self.code.outputs[dest] {
                self.ports.entry(port).or_default().push((value, operation.location));
            }
        }
        Ok(flow)
    }

    /// The value of an operation; of a sum that is fused with a product that of the fused instruction.
    fn compute(
        &mut self,
        operation: &Operation,
        sources: [Term; 3],
        world: &mut World<'_>,
    ) -> Result<(Term, Option<Term>), Difference> {
        match operation.fused {
            Fused::No => Ok(world.terms.apply(operation.op, sources)),
            Fused::Product(number) => {
                // The product's own flags are not raised: the fused operation raises those of the whole.
                let (value, _) = world.terms.apply(operation.op, sources);
                self.products.insert(number, ([sources[0], sources[1]], value));
                Ok((value, None))
            }
            Fused::Sum { product, source, op } => match self.products.get(&product) {
                Some(&([a, b], value)) if value == sources[source] => {
                    world.fused.insert(product);
                    Ok(world.terms.apply(op, [a, b, sources[1 - source]]))
                }
                _ => {
                    Err(self.wrong(Some(operation), "adds something else than the product it is fused with"))
                }
            },
        }
    }

    fn access(
        &mut self,
        operation: &Operation,
        sources: [Term; 3],
        world: &mut World<'_>,
    ) -> Result<Term, Difference> {
        let address = world.terms.offset(sources[0], operation.constant);
        let outside = world.terms.known(address).is_some_and(|word| word >= world.map.depth);
        if outside {
            return Err(self.wrong(Some(operation), "leaves the data memory"));
        }
        let said = if self.is_image {
            match (world.terms.known(address), world.touched.get(&address)) {
                (_, Some(said)) => *said,
                (Some(_), None) => None,
                (None, None) => {
                    return Err(self.wrong(Some(operation), "accesses a word that the source does not"));
                }
            }
        } else {
            world.touched.insert(address, operation.array);
            operation.array
        };
        let region = world.map.region(&world.terms, address, said);
        if operation.op.row().effect == Effect::Load {
            return Ok(self.memory.load(&mut world.terms, &world.map, region, address));
        }
        self.memory.store(&mut world.terms, region, address, sources[1]);
        self.stores.push((address, sources[1], operation.location));
        Ok(sources[1])
    }

    /// Goes on after a bundle, unless that depends on a value.
    fn follow(
        &mut self,
        flow: Option<(&Operation, Term)>,
        world: &mut World<'_>,
    ) -> Result<Option<Event>, Difference> {
        let (next, machine) = (self.at + 1, world.machine);
        let ends = self.loops.last().is_some_and(|(_, end)| *end == next);
        let Some((operation, value)) = flow else {
            if ends {
                let left = self.left.last().copied().unwrap_or(Terms::ZERO);
                let condition = world.terms.more_than_one(left);
                return Ok(Some(Event::LoopEnd { condition }));
            }
            self.at = next;
            return Ok(None);
        };
        if ends {
            return Err(self.wrong(Some(operation), "leaves a loop's last bundle by a jump"));
        }
        let target = operation.constant;
        match operation.op.row().effect {
            Effect::Jump => self.jump(target, machine),
            effect @ (Effect::BranchZero | Effect::BranchNonzero) => {
                let zero = effect == Effect::BranchZero;
                return Ok(Some(Event::Branch { condition: value, target, zero }));
            }
            Effect::Call => {
                if self.calls.len() >= machine.stack_depth as usize {
                    return Err(self.wrong(Some(operation), "calls more deeply than the machine can"));
                }
                self.calls.push(next);
                self.jump(target, machine);
            }
            Effect::Return => {
                let Some(back) = self.calls.pop() else {
                    return Err(self.wrong(Some(operation), "returns from no call"));
                };
                self.jump(back, machine);
            }
            Effect::Loop => {
                let cut = self.loops.last().is_some_and(|(_, end)| *end > self.at && *end <= target);
                let known = world.terms.known(value);
                let count = known.is_some_and(|count| count == 0 || count > u32::from(u16::MAX));
                if cut || count || self.loops.len() >= machine.loop_depth as usize {
                    return Err(self.wrong(Some(operation), "starts a loop that the machine cannot execute"));
                }
                let bound = self.code.bounds.get(&next).copied();
                match (known, bound) {
                    (Some(count), Some(most)) if count > most => {
                        return Err(
                            self.wrong(Some(operation), "iterates more often than its loop bound allows")
                        );
                    }
                    (None, Some(most)) if !self.is_image => {
                        self.counts.push((value, most));
                        world.counted.insert(value, most);
                    }
                    (None, Some(most)) if world.counted.get(&value).is_none_or(|allowed| most < *allowed) => {
                        return Err(self.wrong(Some(operation), "has a loop bound that the source does not"));
                    }
                    _ => {}
                }
                self.loops.push((next, target));
                self.left.push(value);
                if let Some(clock) =
                    self.clock.as_mut().filter(|_| target.saturating_sub(next) < machine.refill)
                {
                    clock.redirect(machine);
                }
                self.at = next;
            }
            Effect::Wait => return Ok(Some(Event::Wait(target))),
            Effect::Halt => return Ok(Some(Event::Halt)),
            _ => self.at = next,
        }
        Ok(None)
    }

    /// The bundles that a branch of the source passes over, if they do nothing but write registers that are no ports: no flags, no
    /// memory.
    pub(crate) fn passed_over(&self, event: Event) -> Option<&'a [Vec<Operation>]> {
        let Event::Branch { target, .. } = event else { return None };
        let passed = self.code.bundles.get(self.at as usize + 1..target as usize)?;
        let is_harmless = |operation: &Operation| {
            let row = operation.op.row();
            let is_port = operation.dest.is_some_and(|dest| self.code.outputs[dest].is_some());
            matches!(row.effect, Effect::Compute | Effect::Immediate)
                && matches!(operation.fused, Fused::No)
                && !row.types.contains(&Type::F)
                && !is_port
        };
        let leads_on = self.loops.last().is_none_or(|(_, end)| *end > target);
        (leads_on && !self.is_image && passed.iter().flatten().all(is_harmless)).then_some(passed)
    }

    /// Takes both ways of a branch at once, if it is one of those: each register that they leave different is selected.
    fn selects(&mut self, event: Event, world: &mut World<'_>) -> bool {
        let Event::Branch { condition, target, zero } = event else { return false };
        if self.is_image || !world.selected.contains(&self.at) {
            return false;
        }
        let Some(passed) = self.passed_over(event) else { return false };
        let before = self.registers.clone();
        for bundle in passed {
            let apply = |operation: &Operation| {
                let mut sources = [Terms::ZERO; 3];
                for (value, &register) in sources.iter_mut().zip(operation.reads()) {
                    *value = self.registers[register];
                }
                let value = match operation.op.row().effect {
                    Effect::Immediate => world.terms.constant(operation.constant),
                    _ => world.terms.apply(operation.op, sources).0,
                };
                (operation.dest, value)
            };
            let results: Vec<(Option<usize>, Term)> = bundle.iter().map(apply).collect();
            results.into_iter().for_each(|(dest, value)| {
                if let Some(dest) = dest {
                    self.registers[dest] = value;
                }
            });
        }
        for (now, before) in self.registers.iter_mut().zip(before) {
            // A branch if zero passes over what is done otherwise.
            let values = if zero { [*now, before] } else { [before, *now] };
            *now = world.terms.select(condition, values);
        }
        self.at = target;
        true
    }

    fn jump(&mut self, target: u32, machine: &Machine) {
        self.at = target;
        if let Some(clock) = &mut self.clock {
            clock.redirect(machine);
        }
    }

    /// Goes on after an event, where a condition is not zero or, if `truth` is false, zero.
    pub(crate) fn resume(&mut self, event: Event, truth: bool, world: &mut World<'_>) {
        match event {
            Event::Branch { target, zero, .. } if truth != zero => self.jump(target, world.machine),
            Event::Branch { .. } => {
                self.at += 1;
                if let Some(clock) = &mut self.clock {
                    clock.not_taken(world.machine);
                }
            }
            Event::LoopEnd { .. } if truth => {
                let Some(left) = self.left.last_mut() else { return };
                *left = world.terms.one_less(*left);
                self.at = self.loops.last().map_or(self.at, |(start, _)| *start);
            }
            Event::LoopEnd { .. } => {
                self.loops.pop();
                self.left.pop();
                self.at += 1;
            }
            Event::Wait(target) => self.at = target,
            Event::Halt => {}
        }
    }
}
