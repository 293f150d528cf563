// SPDX-License-Identifier: MIT OR Apache-2.0
//! Simulation relation between source and image, inferred at cuts: Kildall's algorithm on partitions (value numbering over both programs at
//! once).
//!
//! A cut is a pair of positions, after a decision on a value or a publication, or at a tick. There the registers of both programs, memory and flags are
//! cells; the relation knows which cells are equal, differ by a constant, or are constant. From a cut, both programs run independently to the next decision, which
//! must be the same, and their effects must agree. The partition at a cut is the meet over all paths to it.

use crate::clock::Clock;
use crate::code::{Code, Operation};
use crate::fields::Layout;
use crate::liveness::{Registers, live};
use crate::marks::{ComparedLoops, compare_labels};
use crate::memory::{Map, Memory};
use crate::run::{Event, Side, World};
use crate::term::{COPIES, Node, Term, Terms};
use crate::{Difference, SectionTime};
use foldhash::{HashMap, HashMapExt as _, HashSet, HashSetExt as _};
use std::collections::{BTreeMap, BTreeSet};
use takt_asm::plain::{PlainKind, PlainProgram};
use takt_isa::Register;
use takt_isa::program::Location;

/// Number of a pseudo-cut, for values that arrive with the tick.
const ARRIVING: u32 = u32::MAX;

type Place = (u32, Vec<u32>, Vec<(u32, u32)>);

/// Places of both programs in the order of their text, code of a subroutine where it is called.
type Order = [Vec<u32>; 2];

/// Limit on the nested cases of a visit.
const MAX_CASES: usize = 24;

/// A cut: positions of both programs.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
struct Key {
    source: Place,
    image: Place,
}

struct Cut {
    key: Key,
    cells: Vec<Term>,
    /// Time of the image, if exactly one path leads here.
    clock: Option<Clock>,
}

/// Result, while the check runs.
#[derive(Default)]
pub(crate) struct PartialReport {
    pub(crate) cuts: usize,
    pub(crate) steps: u64,
    pub(crate) fused: BTreeSet<usize>,
    pub(crate) times: BTreeMap<(u32, u32), SectionTime>,
    /// Files and lines at which the source faults on a path.
    pub(crate) faults: BTreeSet<(u32, u32)>,
}

pub(crate) struct Relation<'a> {
    plain: &'a PlainProgram,
    source: &'a Code,
    image: &'a Code,
    world: World<'a>,
    cuts: Vec<Cut>,
    numbers: HashMap<Key, usize>,
    /// Cuts to visit. Earlier places come first, so that the facts in a loop settle before the code behind is visited.
    queue: BTreeSet<(Order, usize)>,
    found: PartialReport,
    /// Last bundles of sections whose time depends on data.
    untimed: BTreeSet<u32>,
    layout: &'a Layout,
    /// Registers of the source that are live before each bundle.
    live: Vec<Registers>,
    /// Bounds of loops compared so far.
    compared: ComparedLoops,
    /// Branches of the source that were tried as selections, since the image's branch leads to another label.
    tried: BTreeSet<u32>,
}

fn place(side: &Side<'_>) -> Place {
    (side.at, side.calls.clone(), side.loops.clone())
}

fn order(key: &Key) -> Order {
    let called_from = |back: &u32| back.saturating_sub(1);
    [&key.source, &key.image].map(|(at, calls, _)| calls.iter().map(called_from).chain([*at]).collect())
}

impl<'a> Relation<'a> {
    pub(crate) fn new(
        plain: &'a PlainProgram,
        source: &'a Code,
        image: &'a Code,
        layout: &'a Layout,
    ) -> Relation<'a> {
        Relation {
            plain,
            source,
            image,
            world: World {
                terms: Terms::new(),
                map: Map::new(plain),
                machine: plain.machine,
                touched: HashMap::new(),
                risked: HashSet::new(),
                selected: selected(source, image),
                faulted: false,
                fused: BTreeSet::new(),
            },
            cuts: Vec::new(),
            numbers: HashMap::new(),
            queue: BTreeSet::new(),
            found: PartialReport::default(),
            untimed: BTreeSet::new(),
            layout,
            live: live(source),
            compared: ComparedLoops::default(),
            tried: BTreeSet::new(),
        }
    }

    /// Follows both programs on every path.
    pub(crate) fn follow(mut self) -> Result<PartialReport, Difference> {
        let regions: Vec<Term> = (0..self.world.map.regions() as u32)
            .map(|region| self.world.terms.make(Node::Loaded(region)))
            .collect();
        let mut start = |code: &'a Code, is_image| {
            let mut side = Side::new(code, is_image, Memory::holding(regions.clone()));
            let terms = &mut self.world.terms;
            let unwritten = terms.make(Node::Unwritten);
            let held = code.initial.iter().map(|bits| bits.map_or(unwritten, |bits| terms.constant(bits)));
            side.registers = held.collect();
            for (output, port) in
                code.outputs.iter().enumerate().filter_map(|(id, port)| Some((id, (*port)?)))
            {
                side.ports.insert(port, vec![(side.registers[output], None)]);
            }
            side
        };
        let (mut source, mut image) = (start(self.source, false), start(self.image, true));
        self.compare_ports(&source, &image)?;
        image.clock = Some(Clock::new(image.at, self.world.machine.refill.into()));
        self.arrive(&mut source, &mut image, true);
        while let Some((_, number)) = self.queue.pop_first() {
            self.visit(number)?;
        }
        self.compared.finish(self.source, self.image)?;
        self.found.cuts = self.cuts.len();
        self.found.steps = self.world.terms.steps;
        self.found.fused = std::mem::take(&mut self.world.fused);
        self.found.times.retain(|(_, wait), _| !self.untimed.contains(wait));
        Ok(self.found)
    }

    /// Follows both programs from a cut to the next.
    fn visit(&mut self, number: usize) -> Result<(), Difference> {
        let result = self.visit_in(number, &mut Vec::new()).map_err(|refused| refused.difference);
        self.world.terms.assume(&[]);
        result
    }

    /// Visits a cut under assumptions about counts. If the image does not make the source's decision, it may have unrolled or replaced it:
    /// then a short branch is treated as a selection, or each value of a loop's count becomes a case of its own.
    fn visit_in(&mut self, number: usize, cases: &mut Vec<(Term, u32)>) -> Result<(), Mismatch> {
        self.world.terms.assume(cases);
        let (mut source, mut image) = self.restore(number);
        self.world.touched.clear();
        self.world.risked.clear();
        self.world.faulted = false;
        let said = match source.run(&mut self.world) {
            Ok(said) => said,
            Err(difference) if self.world.faulted => {
                self.found.faults.extend(difference.place.map(|at| (at.file, at.line)));
                return Ok(());
            }
            Err(difference) => return Err(Mismatch { difference, at_decision: false }),
        };
        let decides = matches!(said, Event::Branch { .. } | Event::LoopEnd { .. });
        let done = image.run(&mut self.world);
        let agree = done.as_ref().is_ok_and(|done| agree((said, *done)));
        // In copies of a loop's body, the image may select in one and branch in the next, on the same condition.
        let leads_elsewhere = done.as_ref().is_ok_and(|done| self.leads_elsewhere(said, *done));
        if agree && leads_elsewhere && source.passed_over(said).is_some() && self.tried.insert(source.at) {
            let selected = self.visit_selecting(source.at, number, cases);
            return selected.unwrap_or_else(|| self.visit_in(number, cases));
        }
        let compared = done.and_then(|done| self.compare(&source, &image, (said, done)).map(|()| done));
        let refused = match compared {
            Ok(done) => {
                let result = self.go_on(source, image, (said, done));
                return result.map_err(|difference| Mismatch { difference, at_decision: false });
            }
            // An image that runs past the source's decision has effects that the source has not reached.
            Err(difference) => {
                let at_decision = decides && !agree && !self.compared.is_mistaken;
                Mismatch { difference, at_decision }
            }
        };
        // The image may select instead of branching; if the branch is inside a loop, it may decide on the loop's count first.
        if source.passed_over(said).is_some() {
            if let Some(result) = self.visit_selecting(source.at, number, cases) {
                return result;
            }
            self.world.terms.assume(cases);
        }
        if agree || self.compared.is_mistaken {
            return Err(refused);
        }
        let Some(&(count, most)) = source.counts.first().filter(|_| cases.len() < MAX_CASES) else {
            return Err(refused);
        };
        for value in 1..=most {
            cases.push((count, value));
            let result = self.visit_in(number, cases);
            cases.pop();
            match result {
                Err(inner) if inner.at_decision => return Err(refused),
                result => result?,
            }
        }
        Ok(())
    }

    /// Visits a cut with the source's branch at `at` treated as a selection. Returns `None`, and takes that back, if the programs then
    /// disagree on a decision, or the branch is one already.
    fn visit_selecting(
        &mut self,
        at: u32,
        number: usize,
        cases: &mut Vec<(Term, u32)>,
    ) -> Option<Result<(), Mismatch>> {
        if !self.world.selected.insert(at) {
            return None;
        }
        match self.visit_in(number, cases) {
            Err(inner) if inner.at_decision => {
                self.world.selected.remove(&at);
                None
            }
            result => Some(result),
        }
    }

    /// Both programs branch, but to different labels.
    fn leads_elsewhere(&self, said: Event, done: Event) -> bool {
        let (Event::Branch { target: source, .. }, Event::Branch { target: image, .. }) = (said, done) else {
            return false;
        };
        let labels = &self.layout.labels;
        match (labels.source.get(&source), labels.image.get(&image)) {
            (Some(said), Some(done)) => said.1 < done.0 || done.1 < said.0,
            (None, Some(_)) => true,
            (_, None) => false,
        }
    }

    /// Compares the effects of both programs, and their next events.
    fn compare(
        &mut self,
        source: &Side<'_>,
        image: &Side<'_>,
        ways: (Event, Event),
    ) -> Result<(), Difference> {
        self.compared.compare_bounds(&self.world.terms, source, image)?;
        self.compare_ports(source, image)?;
        self.compare_memory(source, image)?;
        compare_labels(&self.layout.labels, source, image)?;
        self.compare_place(source, image)?;
        if source.flags != image.flags {
            let only = |a: &Side<'_>, b: &Side<'_>| a.flags.1.difference(&b.flags.1).next().copied();
            let (a, b) = (only(source, image), only(image, source));
            return Err(Difference {
                source: a.map(|term| self.text(term)),
                image: b.map(|term| self.text(term)),
                ..self.difference(source.location(), "the flags differ")
            });
        }
        if let (
            Event::Branch { condition: said, .. } | Event::LoopEnd { condition: said },
            Event::Branch { condition: done, .. } | Event::LoopEnd { condition: done },
        ) = ways
            && said != done
        {
            return Err(self.values(source.location(), "the condition of a branch or loop", said, done));
        }
        if agree(ways) {
            return Ok(());
        }
        let words = |event| match event {
            Event::Branch { condition, .. } | Event::LoopEnd { condition } => {
                format!("a decision on {}", self.text(condition))
            }
            Event::Publish => "publish".to_owned(),
            Event::Wait(_) => "wait".to_owned(),
            Event::Halt => "halt".to_owned(),
        };
        Err(Difference {
            source: Some(words(ways.0)),
            image: Some(words(ways.1)),
            ..self.difference(source.location(), "the programs continue differently")
        })
    }

    /// Resumes both programs, in each direction of the decision.
    fn go_on(
        &mut self,
        mut source: Side<'a>,
        mut image: Side<'a>,
        ways: (Event, Event),
    ) -> Result<(), Difference> {
        match ways.0 {
            Event::Wait(_) | Event::Halt => {
                self.time(&image);
                if let Event::Wait(next) = ways.0 {
                    self.compare_registers(&source, &image, next)?;
                    source.resume(ways.0, true, &mut self.world);
                    image.resume(ways.1, true, &mut self.world);
                    image.clock = Some(Clock::new(image.at, 0));
                    self.compare_place(&source, &image)?;
                    self.arrive(&mut source, &mut image, true);
                }
            }
            Event::Publish => {
                source.resume(ways.0, true, &mut self.world);
                image.resume(ways.1, true, &mut self.world);
                self.arrive(&mut source, &mut image, false);
            }
            Event::Branch { .. } | Event::LoopEnd { .. } => {
                for truth in [true, false] {
                    let (mut source, mut image) = (source.clone(), image.clone());
                    source.resume(ways.0, truth, &mut self.world);
                    image.resume(ways.1, truth, &mut self.world);
                    self.compare_place(&source, &image)?;
                    self.arrive(&mut source, &mut image, false);
                }
            }
        }
        Ok(())
    }

    /// Checks that both programs are in the same section.
    fn compare_place(&self, source: &Side<'_>, image: &Side<'_>) -> Result<(), Difference> {
        if (source.at < source.code.period) == (image.at < image.code.period) {
            return Ok(());
        }
        Err(self.difference(source.location(), "the image is in another section than the source"))
    }

    /// Compares the named registers that are live after a tick.
    fn compare_registers(&self, source: &Side<'_>, image: &Side<'_>, next: u32) -> Result<(), Difference> {
        let live = self.live.get(next as usize);
        let is_live = |(id, _): &&(usize, Register)| live.is_some_and(|live| live.contains(*id));
        for &(id, register) in self.layout.registers.iter().filter(is_live) {
            let (said, done) = (source.registers[id], image.registers[register.index()]);
            if said != done {
                let name = &self.plain.registers[id].name;
                return Err(self.values(source.location(), &format!("register `{name}`"), said, done));
            }
        }
        Ok(())
    }

    /// State of both programs at a cut, with its cells as registers.
    fn restore(&mut self, number: usize) -> (Side<'a>, Side<'a>) {
        let Cut { key, cells, clock, .. } = &self.cuts[number];
        self.world.terms.steps += cells.len() as u64 / COPIES;
        let mut cells = cells.iter().map(|cell| self.world.terms.restored(*cell));
        let mut side = |code: &'a Code, is_image: bool, place: &Place| {
            let mut side = Side::new(code, is_image, Memory::holding([]));
            side.registers = cells.by_ref().take(code.initial.len()).collect();
            side.left = cells.by_ref().take(place.2.len()).collect();
            (side.at, side.calls, side.loops) = place.clone();
            side
        };
        let mut source = side(self.source, false, &key.source);
        let mut image = side(self.image, true, &key.image);
        image.clock.clone_from(clock);
        let regions: Vec<Term> = cells.by_ref().take(self.world.map.regions()).collect();
        let flags = cells.next().unwrap_or(Terms::ZERO);
        for side in [&mut source, &mut image] {
            side.memory = Memory::holding(regions.iter().copied());
            side.flags.0 = flags;
        }
        (source, image)
    }

    /// Joins the state of both programs into the cut at their positions, and queues it if that changes it.
    fn arrive(&mut self, source: &mut Side<'a>, image: &mut Side<'a>, tick: bool) {
        if tick {
            for port in 0..self.source.inputs.len() {
                let arriving = self.world.terms.make(Node::Unknown { cut: ARRIVING, cell: port as u32 });
                for side in [&mut *source, &mut *image] {
                    if let Some(register) = side.registers.get_mut(side.code.inputs[port]) {
                        *register = arriving;
                    }
                }
            }
        }
        let terms = &mut self.world.terms;
        let flags = std::iter::once(source.flags.0).chain(source.flags.1.iter().copied());
        let flags =
            if source.flags.1.is_empty() { source.flags.0 } else { terms.list(flags.collect::<Vec<_>>()) };
        let mut cells: Vec<Term> = Vec::new();
        for side in [&*source, &*image] {
            cells.extend_from_slice(&side.registers);
            cells.extend_from_slice(&side.left);
        }
        cells.extend(source.memory.flat(terms));
        cells.push(flags);
        let key = Key { source: place(source), image: place(image) };
        let Some(&number) = self.numbers.get(&key) else {
            let number = self.cuts.len();
            self.numbers.insert(key.clone(), number);
            let cells = common(terms, number as u32, &cells, &cells);
            self.queue.insert((order(&key), number));
            self.cuts.push(Cut { key, cells, clock: image.clock.take() });
            return;
        };
        let cut = &mut self.cuts[number];
        let joined = common(terms, number as u32, &cut.cells, &cells);
        // Paths of different lengths leave no time, except after a tick, where time starts anew.
        let timed = cut.clock.is_some() && !tick;
        if timed {
            cut.clock = None;
        }
        if joined != cut.cells || timed {
            cut.cells = joined;
            self.queue.insert((order(&cut.key), number));
        }
    }

    fn time(&mut self, image: &Side<'_>) {
        let Some(clock) = &image.clock else {
            self.untimed.insert(image.at);
            return;
        };
        let mut outputs: Vec<(usize, u64)> = Vec::new();
        for (register, &cycle) in &clock.written {
            outputs.extend(self.image.outputs[*register].map(|port| (port, cycle)));
        }
        outputs.sort_unstable();
        let (start, before, cycles) = (clock.start, clock.before, clock.last);
        let time = SectionTime { start, before, wait: image.at, location: image.location(), cycles, outputs };
        let before = self.found.times.insert((clock.start, image.at), time.clone());
        if before.is_some_and(|before| before != time) {
            self.untimed.insert(image.at);
        }
    }

    fn compare_ports(&self, source: &Side<'_>, image: &Side<'_>) -> Result<(), Difference> {
        let outputs: Vec<(usize, &str)> = crate::code::named(self.plain, PlainKind::Output).collect();
        let mut first: Option<Difference> = None;
        for (port, (_, name)) in outputs.iter().enumerate() {
            let written = |side: &Side<'_>| side.ports.get(&port).cloned().unwrap_or_default();
            let (said, done) = (written(source), written(image));
            let length = said.len().max(done.len());
            let differs = |at: &usize| said.get(*at).map(|one| one.0) != done.get(*at).map(|one| one.0);
            let Some(at) = (0..length).find(differs) else { continue };
            let place = said.get(at).or(done.get(at)).and_then(|one| one.1);
            let pair = |at: usize| Some((said.get(at)?.0, done.get(at)?.0));
            let difference = match pair(at) {
                Some((said, done)) => self.values(place, &format!("output `{name}`"), said, done),
                None => Difference {
                    source: said.get(at).map(|one| self.text(one.0)),
                    image: done.get(at).map(|one| self.text(one.0)),
                    ..self.difference(place, &format!("output `{name}` is not written as often"))
                },
            };
            let line = |place: Option<Location>| place.map(|place| (place.file, place.line));
            if first.as_ref().is_none_or(|first| line(difference.place) < line(first.place)) {
                first = Some(difference);
            }
        }
        first.map_or(Ok(()), Err)
    }

    fn compare_memory(&mut self, source: &Side<'_>, image: &Side<'_>) -> Result<(), Difference> {
        if source.memory.flat(&mut self.world.terms) == image.memory.flat(&mut self.world.terms) {
            return Ok(());
        }
        let missing = |a: &Side<'_>, b: &Side<'_>| {
            let there: BTreeSet<(Term, Term)> = b.stores.iter().map(|store| (store.0, store.1)).collect();
            a.stores.iter().find(|store| !there.contains(&(store.0, store.1))).copied()
        };
        let (said, done) = (missing(source, image), missing(image, source));
        if let (Some((a, said, place)), Some((b, done, _))) = (said, done)
            && a == b
        {
            let what = format!("the data word at [{}]", self.text(a));
            return Err(self.values(place, &what, said, done));
        }
        let text = |store: Option<(Term, Term, Option<Location>)>| {
            store.map(|(address, value, _)| format!("[{}] = {}", self.text(address), self.text(value)))
        };
        let place = said.or(done).and_then(|store| store.2).or(source.location());
        Err(Difference {
            source: text(said),
            image: text(done),
            ..self.difference(place, "the data memory differs")
        })
    }

    /// A difference between two values, located where their terms begin to differ.
    fn values(&self, place: Option<Location>, what: &str, said: Term, done: Term) -> Difference {
        let (first, other) = self.world.terms.first_difference(said, done);
        let origin = self.world.terms.origins.get(&first).copied().filter(|origin| Some(*origin) != place);
        let written =
            place.and_then(|at| Some(format!("{}:{}", self.plain.files.get(at.file as usize)?, at.line)));
        let what = match (origin, written) {
            (Some(_), Some(written)) => {
                format!("{what} gets another value in {written}, which begins to differ here")
            }
            _ => format!("{what} gets another value"),
        };
        Difference {
            place: origin.or(place),
            what,
            source: Some(self.text(first)),
            image: Some(self.text(other)),
        }
    }

    fn difference(&self, place: Option<Location>, what: &str) -> Difference {
        Difference { place, what: what.to_owned(), source: None, image: None }
    }

    fn text(&self, term: Term) -> String {
        let name = |cell: u32| {
            let cell = cell as usize;
            let register = self.plain.registers.get(cell).filter(|register| !register.name.is_empty());
            register.map_or_else(|| format!("value {cell}"), |register| register.name.clone())
        };
        self.world.terms.text(term, &name)
    }
}

/// Branches of the source whose lines have no branch in the image, which may select instead.
fn selected(source: &Code, image: &Code) -> HashSet<u32> {
    let is_branch = |operation: &&Operation| operation.op.row().effect.is_conditional();
    let branches = image.bundles.iter().flatten().filter(is_branch);
    let kept: HashSet<Location> = branches.filter_map(|operation| operation.location).collect();
    let is_gone = |operation: Operation| operation.location.is_some_and(|location| !kept.contains(&location));
    let gone = |bundle: &Vec<Operation>| bundle.iter().find(is_branch).cloned().is_some_and(is_gone);
    (0..).zip(&source.bundles).filter(|(_, bundle)| gone(bundle)).map(|(at, _)| at).collect()
}

/// A difference, and whether the programs disagree on the decision itself.
struct Mismatch {
    difference: Difference,
    at_decision: bool,
}

/// The programs agree: both publish, both wait, both halt, or both decide on the same condition.
fn agree(ways: (Event, Event)) -> bool {
    match ways {
        (Event::Publish, Event::Publish) | (Event::Wait(_), Event::Wait(_)) | (Event::Halt, Event::Halt) => {
            true
        }
        (
            Event::Branch { condition: a, .. } | Event::LoopEnd { condition: a },
            Event::Branch { condition: b, .. } | Event::LoopEnd { condition: b },
        ) => a == b,
        _ => false,
    }
}

/// Meet of two partitions of cells. Cells keep their difference, 0 included, if both partitions know the same one; constants stay if they are
/// the same.
fn common(terms: &mut Terms, cut: u32, old: &[Term], new: &[Term]) -> Vec<Term> {
    terms.steps += old.len() as u64;
    // By both symbolic parts of a cell and the difference between its constants: the unknown of the class, and the first cell's constant.
    let mut classes: HashMap<(Term, Term, u32, bool), (Term, u32)> = HashMap::new();
    let mut of = |((&old, &new), cell): ((&Term, &Term), u32)| {
        if old == new && matches!(terms.node(old), Node::Constant(_) | Node::Loaded(_) | Node::Unwritten) {
            return old;
        }
        let risky = terms.may_be_unwritten(old) || terms.may_be_unwritten(new);
        // A sum is written even if its operand may not be.
        let (((x, m), (y, n)), class) = match risky {
            true => (((old, 0), (new, 0)), Node::PerhapsUnwritten { cut, cell }),
            false => ((terms.linear(old), terms.linear(new)), Node::Unknown { cut, cell }),
        };
        let named = || (terms.in_any_case(class), m);
        let (unknown, first) = *classes.entry((x, y, m.wrapping_sub(n), risky)).or_insert_with(named);
        terms.offset_in_any_case(unknown, m.wrapping_sub(first))
    };
    old.iter().zip(new).zip(0..).map(&mut of).collect()
}
