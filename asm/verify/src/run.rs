// SPDX-License-Identifier: MIT OR Apache-2.0
//! Symbolic execution of one of the programs, up to a decision on an unknown value.
//!
//! An operation reads a register only after the last result has arrived, and issues only when no result for its destination is in flight
//! (docs/timing.md). So values do not depend on latencies, and bundles can be executed one after another.

use crate::Difference;
use crate::clock::Clock;
use crate::code::{Code, ContractionRole, Operation};
use crate::marks::Marks;
use crate::memory::{Map, Memory};
use crate::term::{COPIES, MAX_STEPS, Node, Term, Terms};
use foldhash::{HashMap, HashSet};
use std::collections::{BTreeMap, BTreeSet};
use takt_isa::program::Location;
use takt_isa::{Effect, Machine, Type};

/// State shared by both programs of a visit.
pub(crate) struct World<'a> {
    pub(crate) terms: Terms,
    pub(crate) map: Map,
    pub(crate) machine: &'a Machine,
    /// Addresses that the source has accessed since the last cut, with the array that it names.
    pub(crate) touched: HashMap<Term, Option<usize>>,
    /// Possibly unwritten values that the source has read since the last cut. If they are unwritten, the source has faulted, and the image
    /// may read them as well.
    pub(crate) risked: HashSet<Term>,
    /// Branches of the source, by bundle, that are executed as selections, as in the image.
    pub(crate) selected: HashSet<u32>,
    /// The source has faulted: from there on, the image may do anything.
    pub(crate) faulted: bool,
    pub(crate) fused: BTreeSet<usize>,
}

/// State of one running program.
#[derive(Clone, Debug)]
pub(crate) struct Side<'a> {
    pub(crate) code: &'a Code,
    pub(crate) is_image: bool,
    pub(crate) at: u32,
    pub(crate) registers: Vec<Term>,
    pub(crate) calls: Vec<u32>,
    /// Active loops: first bundle, and the bundle after the last.
    pub(crate) loops: Vec<(u32, u32)>,
    /// Remaining iterations of each active loop.
    pub(crate) left: Vec<Term>,
    pub(crate) memory: Memory,
    /// Flags raised before the last cut, and the terms that raised flags since.
    pub(crate) flags: (Term, BTreeSet<Term>),
    /// Values written to each output port since the last cut.
    pub(crate) ports: BTreeMap<usize, Vec<(Term, Option<Location>)>>,
    /// Stores since the last cut: address, word, source line.
    pub(crate) stores: Vec<(Term, Term, Option<Location>)>,
    /// Unknown counts of loops started since the last cut, with the source's bound.
    pub(crate) counts: Vec<(Term, u32)>,
    /// Marks since the last cut.
    pub(crate) marks: Marks,
    /// Factors and value of each fused product.
    products: HashMap<usize, ([Term; 2], Term)>,
    /// Values that the image has spilled since the last cut to data words that the source cannot reach.
    kept: HashMap<u32, Term>,
    pub(crate) clock: Option<Clock>,
}

/// Reason why a run stops.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Event {
    /// Branch on whether `condition` is zero.
    Branch { condition: Term, target: u32, zero: bool },
    /// End of an iteration: the loop continues if `condition` is not zero.
    LoopEnd { condition: Term },
    /// Publication of the outputs; execution continues at the next bundle.
    Publish,
    /// Wait for the tick, which continues at a bundle.
    Wait(u32),
    /// End of the program.
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
            marks: Marks::default(),
            products: HashMap::default(),
            kept: HashMap::default(),
            clock: None,
        }
    }

    pub(crate) fn location(&self) -> Option<Location> {
        self.code.location(self.at)
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

    /// A fault on data: in the source it ends the path.
    fn fault(&self, operation: &Operation, what: &str, world: &mut World<'_>) -> Difference {
        world.faulted |= !self.is_image;
        self.wrong(Some(operation), what)
    }

    /// Runs to the next event. The program stays at the event's bundle, which has been executed.
    pub(crate) fn run(&mut self, world: &mut World<'_>) -> Result<Event, Difference> {
        loop {
            world.terms.steps += 1;
            if world.terms.steps > MAX_STEPS {
                let what = format!(
                    "the checker's limit of {MAX_STEPS} steps is reached before every path has been followed: whether the image is \
                     its source is not known"
                );
                return Err(Difference { place: self.location(), what, source: None, image: None });
            }
            let code = self.code;
            let Some(bundle) = code.bundles.get(self.at as usize) else {
                return Err(self.wrong(None, "runs past its last bundle"));
            };
            if let Some(clock) = &mut self.clock {
                clock.issue(bundle);
            }
            self.marks.arrive(code, self.at);
            let flow = self.execute(bundle, world)?;
            if let Some(event) = self.follow(flow, world)? {
                match event {
                    Event::Branch { condition, .. } | Event::LoopEnd { condition } => {
                        match world.terms.constant_value(condition) {
                            Some(bits) => self.resume(event, bits != 0, world),
                            None if self.selects(event, world) => {}
                            None => return Ok(event),
                        }
                    }
                    Event::Publish | Event::Wait(_) | Event::Halt => return Ok(event),
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

    /// Executes a bundle. Returns its control-flow operation with the value that it reads.
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
                Effect::Jump
                | Effect::BranchZero
                | Effect::BranchNonzero
                | Effect::Call
                | Effect::Return
                | Effect::Loop
                | Effect::Publish
                | Effect::Wait
                | Effect::Halt => {
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
                self.marks.done += 1;
            }
        }
        Ok(flow)
    }

    /// Value of an operation; of a contracted sum, the value of the fused instruction.
    fn compute(
        &mut self,
        operation: &Operation,
        sources: [Term; 3],
        world: &mut World<'_>,
    ) -> Result<(Term, Option<Term>), Difference> {
        match operation.fused {
            ContractionRole::No => Ok(world.terms.apply(operation.op, sources)),
            ContractionRole::Product(number) => {
                // The product's own flags are not raised: the fused operation raises the flags of the whole.
                let (value, _) = world.terms.apply(operation.op, sources);
                self.products.insert(number, ([sources[0], sources[1]], value));
                Ok((value, None))
            }
            ContractionRole::Sum { product, source, op } => match self.products.get(&product) {
                Some(&([a, b], value)) if value == sources[source] => {
                    world.fused.insert(product);
                    Ok(world.terms.apply(op, [a, b, sources[1 - source]]))
                }
                _ => {
                    Err(self.wrong(Some(operation), "adds something other than the product it is fused with"))
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
        let outside = world.terms.constant_value(address).is_some_and(|word| word >= world.map.depth);
        if outside {
            return Err(self.fault(operation, "leaves the data memory", world));
        }
        if !self.is_image
            && operation.array.is_some_and(|array| !world.map.is_within(&world.terms, address, array))
        {
            return Err(self.fault(operation, "leaves its array", world));
        }
        let said = if self.is_image {
            match (world.terms.constant_value(address), world.touched.get(&address)) {
                (_, Some(said)) => *said,
                (Some(word), None) if world.map.is_free(word) => {
                    return self.keep(operation, word, sources[1]);
                }
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
        self.marks.done += 1;
        Ok(sources[1])
    }

    /// Stores a value in a spill word, which the source cannot reach, or loads it from there.
    fn keep(&mut self, operation: &Operation, word: u32, value: Term) -> Result<Term, Difference> {
        if operation.op.row().effect == Effect::Store {
            self.kept.insert(word, value);
            return Ok(value);
        }
        let kept = self.kept.get(&word).copied();
        kept.ok_or_else(|| self.wrong(Some(operation), "loads a data word that it has not stored before"))
    }

    /// Moves to the next bundle, or returns the decision that it depends on.
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
                self.marks.done += 1;
                self.jump(target, machine);
            }
            Effect::Return => {
                let Some(back) = self.calls.pop() else {
                    return Err(self.wrong(Some(operation), "returns without a call"));
                };
                self.marks.done += 1;
                self.jump(back, machine);
            }
            Effect::Loop => {
                let cut = self.loops.last().is_some_and(|(_, end)| *end > self.at && *end <= target);
                let known = world.terms.constant_value(value);
                if cut || self.loops.len() >= machine.loop_depth as usize {
                    return Err(self.wrong(Some(operation), "starts a loop that the machine cannot execute"));
                }
                if known.is_some_and(|count| count == 0 || count > u32::from(u16::MAX)) {
                    return Err(self.fault(
                        operation,
                        "starts a loop of no iteration, or of too many",
                        world,
                    ));
                }
                let bound = self.code.bounds.get(&next).map(|bound| bound.most);
                match (known, bound) {
                    (Some(count), Some(most)) if count > most => {
                        let what = "iterates more often than its loop bound allows";
                        return Err(self.fault(operation, what, world));
                    }
                    (None, Some(most)) => self.counts.push((value, most)),
                    _ => {}
                }
                self.marks.begin(value, next, operation.location);
                self.loops.push((next, target));
                self.left.push(value);
                if let Some(clock) =
                    self.clock.as_mut().filter(|_| target.saturating_sub(next) < machine.refill)
                {
                    clock.redirect(machine);
                }
                self.at = next;
            }
            Effect::Publish => return Ok(Some(Event::Publish)),
            Effect::Wait => return Ok(Some(Event::Wait(target))),
            Effect::Halt => return Ok(Some(Event::Halt)),
            // These do not redirect: the next bundle follows.
            Effect::Compute
            | Effect::Nothing
            | Effect::Immediate
            | Effect::Load
            | Effect::Store
            | Effect::ReadFlags
            | Effect::ClearFlags => self.at = next,
        }
        Ok(None)
    }

    /// Bundles that a branch of the source skips, if they only write registers other than ports: no flags, no memory.
    pub(crate) fn passed_over(&self, event: Event) -> Option<&'a [Vec<Operation>]> {
        let Event::Branch { target, .. } = event else { return None };
        let passed = self.code.bundles.get(self.at as usize + 1..target as usize)?;
        let is_harmless = |operation: &Operation| {
            let row = operation.op.row();
            let is_port = operation.dest.is_some_and(|dest| self.code.outputs[dest].is_some());
            matches!(row.effect, Effect::Compute | Effect::Immediate)
                && matches!(operation.fused, ContractionRole::No)
                && !row.types.contains(&Type::F)
                && !is_port
        };
        // Neither direction ends an iteration of the active loop, whose body may call this code from elsewhere.
        let ends = |(_, end): &(u32, u32)| self.at < *end && *end <= target;
        let leads_on = !self.loops.last().is_some_and(ends);
        (leads_on && !self.is_image && passed.iter().flatten().all(is_harmless)).then_some(passed)
    }

    /// Executes a branch as a selection, if it is marked for that: each register that differs between both directions becomes a `sel`.
    fn selects(&mut self, event: Event, world: &mut World<'_>) -> bool {
        let Event::Branch { condition, target, zero } = event else { return false };
        if self.is_image || !world.selected.contains(&self.at) {
            return false;
        }
        let Some(passed) = self.passed_over(event) else { return false };
        let before = self.registers.clone();
        world.terms.steps += before.len() as u64 / COPIES;
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
            // A branch on zero skips the computation if the condition is zero.
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

    /// Continues after an event, with the condition nonzero, or zero if `truth` is false.
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
            Event::Publish => self.at += 1,
            Event::Wait(target) => self.at = target,
            Event::Halt => {}
        }
    }
}
