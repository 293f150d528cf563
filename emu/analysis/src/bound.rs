// SPDX-License-Identifier: MIT OR Apache-2.0
//! Best-case and worst-case execution time of each section of a program, by static analysis.
//!
//! The analysis explores every control-flow path with the machine's exact timing state, by the same rules of
//! [`takt_isa::timing`] that the emulator applies. Paths that meet are merged only if their timing states are equivalent,
//! that is, if they time every continuation alike ([`Residue`]); the merged path keeps the shortest and the longest time.
//! Nothing else is merged, so timing anomalies need no assumption: a path that is longer so far may end earlier.
//! Subroutines, loops and iterations ([`Region`]) are analysed once for each state in which they are entered, and their
//! summaries reused. Counts of loops that depend on the iterations around them are computed along each path ([`Slice`]).
//! A promised total of a loop's iterations, which no merged path can count, enters by Lagrangian relaxation ([`bound_with`]).
//! `docs/analysis.md` has the argument.

use crate::certificate::{Log, LoggedPlace};
use crate::error::{BoundError, Refusal, place};
use crate::graph::{Edge, Graph, Loop};
use crate::values::{MAX_VALUES, Slice, Values};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;
use takt_isa::certificate::{Certificate, Proof, Step};
use takt_isa::program::{Location, SectionCycles};
use takt_isa::timing::{self, Cycle, Residue, Scoreboard, Span};
use takt_isa::{BundleAddress, Flow, Program, Register};

/// Limit on the steps of the analysis: straight-line pieces and loop iterations, counted again for each state at entry.
pub const MAX_STEPS: u64 = 1 << 20;
/// Limit on the nesting of subroutines and counted loops.
pub const MAX_DEPTH: usize = 64;

/// Limit on the cycles of a section.
pub const MAX_CYCLES: Cycle = 1 << 62;

/// Best and worst case of a section.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionBounds {
    /// Label of its first bundle; `once` for the section that runs once.
    pub name: String,
    /// First bundle: bundle 0, or the target of a `wait`.
    pub address: BundleAddress,
    /// Source line of the first bundle, if known.
    pub location: Option<Location>,
    /// Bundles that end the section, `wait`s and `halt`s, ascending.
    pub ends: Vec<BundleAddress>,
    /// Starts at reset; all other sections start at a tick.
    pub once: bool,
    /// Cycles. For the section that runs once: from reset to the issue of its `wait`, both included. For a period: from the cycle after its
    /// tick to the issue of its `wait`, provided that the tick comes after the front end has refilled ([`takt_isa::Machine::refill`] cycles
    /// after the previous `wait`, or later).
    pub cycles: Span,
    /// Cycles of a period whose tick comes after the previous `wait`, however soon: a tick during the refill adds the rest of the refill.
    pub in_time: Span,
    /// Cycles of a period whose tick came before the previous `wait` (a missed deadline), from the cycle after that `wait`.
    pub missed: Span,
    /// Cycles to the publication of the outputs; `None` without a `publish`: the `wait` publishes them.
    pub published: Option<Publication>,
}

/// Best and worst case from the beginning of a section to the issue of its first `publish`, or of its `wait` on a path without one; counted
/// as the cycles of [`SectionBounds`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Publication {
    /// Cycles up to the publication, in the cases of [`SectionBounds::cycles`].
    pub cycles: Span,
    /// Cycles up to the publication, in the cases of [`SectionBounds::in_time`].
    pub in_time: Span,
    /// Cycles up to the publication, in the cases of [`SectionBounds::missed`].
    pub missed: Span,
}

impl SectionBounds {
    /// Cycles to the publication of the outputs, by a `publish` or by the `wait`.
    pub fn to_outputs(&self) -> Span {
        self.published.map_or(self.cycles, |published| published.cycles)
    }
}

/// Best and worst case of each section of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// The section that runs once, then the periods by address: one for each bundle that is the target of a `wait`.
    pub sections: Vec<SectionBounds>,
    /// Steps that the analysis took, at most [`MAX_STEPS`].
    pub steps: u64,
}

impl Bounds {
    /// Worst case over all periods whose tick comes in time; `None` without periods.
    pub fn worst_period(&self) -> Option<Cycle> {
        self.sections.iter().filter(|section| !section.once).map(|section| section.in_time.worst).max()
    }
}

/// Cycles of each section for a host's header file, or the reason why there is no bound.
///
/// # Errors
/// The text of the [`BoundError`].
pub fn section_cycles(program: &Program) -> Result<Vec<SectionCycles>, String> {
    let of = |section: SectionBounds| SectionCycles {
        name: section.name,
        address: section.address,
        once: section.once,
        cycles: if section.once { section.cycles } else { section.in_time },
        missed: (!section.once).then_some(section.missed),
    };
    let bounds = bound(program).map_err(|error| error.to_string())?;
    Ok(bounds.sections.into_iter().map(of).collect())
}

/// Bounds on the cycles of each section of a program: they hold for all inputs and data, in every run without a fault.
///
/// # Errors
/// If a program cannot be bounded: see [`Refusal`].
pub fn bound(program: &Program) -> Result<Bounds, BoundError> {
    Ok(bound_proved(program, false)?.0)
}

/// Bounds of [`bound`], with a certificate that a checker can follow step by step.
///
/// # Errors
/// If a program cannot be bounded: see [`Refusal`].
pub fn certify(program: &Program) -> Result<(Bounds, Certificate), BoundError> {
    let (bounds, proofs) = bound_proved(program, true)?;
    let certificate = crate::certificate::certificate(program, &bounds, proofs);
    Ok((bounds, certificate))
}

/// Bounds, and their proofs if `logged`.
fn bound_proved(program: &Program, logged: bool) -> Result<(Bounds, Vec<Proof>), BoundError> {
    let Found { mut bounds, prices, proof } = bound_by(program, &Prices::new(), logged)?;
    if prices.is_empty() {
        return Ok((bounds, proof.into_iter().collect()));
    }
    let by_totals = bound_by(program, &prices, logged)?;
    let proofs = proof.into_iter().chain(by_totals.proof).collect();
    let by_totals = by_totals.bounds;
    bounds.steps += by_totals.steps;
    let others: BTreeMap<_, _> =
        by_totals.sections.iter().map(|other| ((other.once, other.address), other)).collect();
    for section in &mut bounds.sections {
        let Some(other) = others.get(&(section.once, section.address)) else { continue };
        let spans = [
            (&mut section.cycles, other.cycles),
            (&mut section.in_time, other.in_time),
            (&mut section.missed, other.missed),
        ];
        // Take the smaller of two valid bounds.
        spans.into_iter().for_each(|(span, other)| span.worst = span.worst.min(other.worst));
        if let (Some(published), Some(other)) = (&mut section.published, other.published) {
            let spans = [
                (&mut published.cycles, other.cycles),
                (&mut published.in_time, other.in_time),
                (&mut published.missed, other.missed),
            ];
            spans.into_iter().for_each(|(span, other)| span.worst = span.worst.min(other.worst));
        }
    }
    Ok((bounds, proofs))
}

/// Price of an iteration in cycles, for each loop with a promised total, by the loop's head.
pub(crate) type Prices = BTreeMap<BundleAddress, Cycle>;

/// Result of an analysis: bounds, for each loop with a total the cycles of an iteration once iterations are alike, and the proof if logged.
struct Found {
    bounds: Bounds,
    prices: Prices,
    proof: Option<Proof>,
}

/// Result of [`bound_with`]; forgets the values of loop counts if the analysis exceeds its steps with them.
fn bound_by(program: &Program, prices: &Prices, logged: bool) -> Result<Found, BoundError> {
    let slice = Slice::new(&Graph::new(program)?);
    let has_slice = !slice.is_empty();
    match bound_with(program, slice, prices, logged) {
        // Without the values of counts, the states of iterations coincide much sooner.
        Err(BoundError { refusal: Refusal::Limit { limit: MAX_STEPS, .. }, .. }) if has_slice => {
            bound_with(program, Slice::default(), prices, logged)
        }
        result => result,
    }
}

/// Analyses a program, tracking the registers of `slice`.
///
/// Lagrangian relaxation of the promised totals: each iteration of a loop with a price costs its cycles less the price, and a section that
/// enters the loop pays the price times the total. At any price the result bounds every path that keeps to the total; at a price equal to
/// the cycles of a steady iteration, it is the longest such path.
fn bound_with(program: &Program, slice: Slice, prices: &Prices, logged: bool) -> Result<Found, BoundError> {
    let graph = Graph::new(program)?;
    let machine = program.machine;
    let at_reset = slice.at_reset(program);
    let mut explorer = Explorer {
        graph,
        slice,
        prices,
        found: Prices::new(),
        used: HashMap::new(),
        known: HashMap::new(),
        orders: HashMap::new(),
        active: Vec::new(),
        steps: 0,
        log: logged.then(|| Log::new(prices)),
    };
    // Worklist over sections and their timing states at entry. A period's tick may come any time after the `wait`, so results may
    // still be pending or not when its first bundle is delivered: each such state, up to the empty one, is analysed (`delivered`). The
    // first of these states also arises after a missed deadline.
    let mut sections: BTreeMap<(bool, BundleAddress), SectionBounds> = BTreeMap::new();
    let mut publications: BTreeMap<(bool, BundleAddress), Publication> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    let mut left = vec![(true, BundleAddress::RESET, Residue::default())];
    while let Some((once, address, residue)) = left.pop() {
        if !seen.insert((once, address, residue.clone())) {
            continue;
        }
        let mut delivered = vec![residue];
        while let Some(later) = delivered.last().filter(|last| !once && !last.is_empty()) {
            delivered.push(later.later(1));
        }
        for (later, residue) in delivered.into_iter().enumerate() {
            let region = Region::Subroutine(address);
            // A period may begin with any register values that another period has left.
            let values = if once { at_reset.clone() } else { Values::default() };
            let state = State { residue, values, published: false };
            let summary = explorer.explore(region, &state)?;
            if let Some(log) = &mut explorer.log {
                log.enter(once, address, &state, later == 0, summary.number);
            }
            let Needs { calls, counted, .. } = summary.needs;
            if calls > machine.stack_depth {
                let refusal = Refusal::StackOverflow { needed: calls, depth: machine.stack_depth };
                return Err(BoundError::new(program, address, refusal));
            }
            if counted > machine.loop_depth {
                let refusal = Refusal::LoopOverflow { needed: counted, depth: machine.loop_depth };
                return Err(BoundError::new(program, address, refusal));
            }
            let totals = explorer.totals(&summary.needs);
            let publishes = summary.outcomes.keys().any(|outcome| matches!(outcome, Outcome::Publish { .. }));
            for (outcome, cost) in &summary.outcomes {
                let span = cost.span(totals);
                let (end, is_publication) = match *outcome {
                    Outcome::Wait { at, target, ref residue, published } => {
                        left.push((false, target, residue.clone()));
                        (Some(at), publishes && !published)
                    }
                    Outcome::Publish { .. } => (None, true),
                    Outcome::Halt { at } => (Some(at), false),
                    Outcome::Return { at, .. } => {
                        return Err(BoundError::new(program, at, Refusal::StackUnderflow));
                    }
                    Outcome::Go { .. } => continue,
                };
                // The last issue's cycle counts too, hence the 1.
                let refill = Cycle::from(machine.refill);
                let plain = span.after(1 + if once { refill } else { 0 });
                let missed = span.after(1 + refill);
                // The earliest tick in time comes in the cycle after the `wait`: one cycle of the refill has passed by then.
                let soonest = span.after(1 + refill.saturating_sub(1));
                let mut in_time = plain;
                if !once && later == 0 {
                    in_time = in_time.or(soonest);
                }
                if missed.worst >= MAX_CYCLES {
                    let what = "cycles in a section";
                    return Err(BoundError::new(
                        program,
                        address,
                        Refusal::Limit { limit: MAX_CYCLES, what },
                    ));
                }
                if is_publication {
                    let known = publications.entry((!once, address)).or_insert(Publication {
                        cycles: plain,
                        in_time,
                        missed,
                    });
                    known.cycles = known.cycles.or(plain);
                    known.in_time = known.in_time.or(in_time);
                    if later == 0 {
                        known.missed = known.missed.or(missed);
                    }
                }
                let Some(end) = end else { continue };
                let section = sections.entry((!once, address)).or_insert_with(|| SectionBounds {
                    name: program.section_name(once, address),
                    address,
                    location: program.location(address),
                    ends: Vec::new(),
                    once,
                    cycles: plain,
                    in_time,
                    missed,
                    published: None,
                });
                section.cycles = section.cycles.or(plain);
                section.in_time = section.in_time.or(in_time);
                if later == 0 {
                    section.missed = section.missed.or(missed);
                }
                if let Err(place) = section.ends.binary_search(&end) {
                    section.ends.insert(place, end);
                }
            }
        }
    }
    for (key, section) in &mut sections {
        section.published = publications.get(key).copied();
    }
    let Explorer { steps, found, log, .. } = explorer;
    let bounds = Bounds { sections: sections.into_values().collect(), steps };
    Ok(Found { bounds, prices: found, proof: log.map(Log::proof) })
}

/// Least and most cycles of a part of a path. The most is negative where iterations in it have a price above their cycles.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Cost {
    pub(crate) best: Cycle,
    pub(crate) worst: i64,
}

impl Cost {
    pub(crate) const ZERO: Cost = Cost { best: 0, worst: 0 };

    const fn exactly(cycles: Cycle) -> Cost {
        Cost { best: cycles, worst: cycles.cast_signed() }
    }

    const fn and(self, other: Cost) -> Cost {
        Cost { best: self.best.saturating_add(other.best), worst: self.worst.saturating_add(other.worst) }
    }

    fn or(self, other: Cost) -> Cost {
        Cost { best: self.best.min(other.best), worst: self.worst.max(other.worst) }
    }

    /// Span of a section: adds the price of its loops' totals to the most.
    fn span(self, totals: Cycle) -> Span {
        let totals = i64::try_from(totals).unwrap_or(i64::MAX);
        Span { best: self.best, worst: self.worst.saturating_add(totals).max(0).cast_unsigned() }
    }
}

/// State of a path: its timing state, the known values of the registers that loop counts depend on, and whether a `publish` has issued.
#[derive(Clone, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(crate) struct State {
    pub(crate) residue: Residue,
    pub(crate) values: Values,
    pub(crate) published: bool,
}

impl State {
    /// The state without the values of registers, or a count.
    pub(crate) fn forgotten(&self) -> State {
        State { values: Values::default(), ..self.clone() }
    }
}

/// Part of the program that is analysed as a unit, entered at one bundle.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
enum Region {
    /// Code from a first bundle to a return, a `wait` or a `halt`. A section is analysed as one, too.
    Subroutine(BundleAddress),
    /// Iterations of the counted loop with this head, all together.
    Loop(BundleAddress),
    /// Single iteration of the counted loop with this head.
    Turn(BundleAddress),
}

/// Exit of a region. Its residue is the timing state at the delivery of the next bundle, up to which its cycles are counted. The cycles of
/// `wait` and `halt` are counted up to their issue.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Outcome {
    /// Edge to a bundle outside of the loop or, from an iteration, also back to the loop's head.
    Go {
        edge: Edge,
        state: State,
    },
    Return {
        at: BundleAddress,
        state: State,
    },
    /// Residue: timing state at the earliest possible delivery of the target. Published: a `publish` has issued on the way.
    Wait {
        at: BundleAddress,
        target: BundleAddress,
        residue: Residue,
        published: bool,
    },
    /// Issue of the first `publish`; the path goes on by another outcome.
    Publish {
        at: BundleAddress,
    },
    Halt {
        at: BundleAddress,
    },
}

/// Summary of a region for one timing state at entry: its exits, each with its cycles.
#[derive(Default, Debug)]
pub(crate) struct Summary {
    pub(crate) outcomes: BTreeMap<Outcome, Cost>,
    needs: Needs,
    /// Number of its lemma in the certificate, if one is made.
    pub(crate) number: u32,
}

/// Resources that a part of the program needs.
#[derive(Default, Debug)]
struct Needs {
    /// Most entries of the return stack in use.
    calls: u32,
    /// Deepest nesting of loops counted by the sequencer.
    counted: u32,
    /// Loops with a price.
    priced: BTreeSet<BundleAddress>,
}

impl Needs {
    /// Takes over the needs of another part of the program.
    fn contain(&mut self, part: &Needs) {
        self.calls = self.calls.max(part.calls);
        self.counted = self.counted.max(part.counted);
        self.priced.extend(&part.priced);
    }
}

/// Part of a path from one bundle: straight-line code, with the callee of a call, or a loop.
struct Piece {
    step: Step,
    /// Ways on, in the order of [`takt_isa::certificate::Place::edges`]; `None` is one that is never taken.
    edges: Vec<Option<(Outcome, Cost)>>,
    needs: Needs,
}

fn add<K: Ord>(costs: &mut BTreeMap<K, Cost>, key: K, cost: Cost) {
    costs.entry(key).and_modify(|known| *known = known.or(cost)).or_insert(cost);
}

/// Limits the states at one bundle: beyond [`MAX_VALUES`], drops the register values, which leaves one state for each timing state.
fn widened(states: BTreeMap<State, Cost>) -> BTreeMap<State, Cost> {
    if states.len() <= MAX_VALUES {
        return states;
    }
    let mut forgotten = BTreeMap::new();
    for (State { residue, published, .. }, cost) in states {
        add(&mut forgotten, State { residue, values: Values::default(), published }, cost);
    }
    forgotten
}

struct Explorer<'p> {
    graph: Graph<'p>,
    slice: Slice,
    /// Prices of iterations, and the cycles that iterations were found to take.
    prices: &'p Prices,
    found: Prices,
    /// Registers of the slice that each loop's bundles use.
    used: HashMap<Region, Rc<BTreeSet<Register>>>,
    known: HashMap<(Region, State), Rc<Summary>>,
    /// Topological order of each region's bundles, by position.
    orders: HashMap<Region, Rc<HashMap<BundleAddress, usize>>>,
    active: Vec<Region>,
    steps: u64,
    log: Option<Log>,
}

impl Explorer<'_> {
    fn error(&self, address: BundleAddress, refusal: Refusal) -> BoundError {
        BoundError::new(self.graph.program, address, refusal)
    }

    fn step(&mut self, address: BundleAddress) -> Result<(), BoundError> {
        self.steps += 1;
        if self.steps > MAX_STEPS {
            return Err(
                self.error(address, Refusal::Limit { limit: MAX_STEPS, what: "steps on the way here" })
            );
        }
        Ok(())
    }

    /// Cycles that the totals of a section's loops cost: price times total.
    fn totals(&self, section: &Needs) -> Cycle {
        let of = |head: &BundleAddress| {
            self.prices[head].saturating_mul(self.graph.loops[head].total.unwrap_or(0).into())
        };
        section.priced.iter().map(of).fold(0, Cycle::saturating_add)
    }

    /// Summary of a region, reused for equal states at entry.
    fn explore(&mut self, region: Region, entry: &State) -> Result<Rc<Summary>, BoundError> {
        let key = (region, entry.clone());
        if let Some(known) = self.known.get(&key) {
            return Ok(Rc::clone(known));
        }
        let (Region::Subroutine(address) | Region::Loop(address) | Region::Turn(address)) = region;
        if self.active.len() >= MAX_DEPTH {
            let what = "subroutines and loops within one another";
            return Err(self.error(address, Refusal::Limit { limit: MAX_DEPTH as u64, what }));
        }
        if self.active.contains(&region) {
            return Err(self.error(address, Refusal::Overlap));
        }
        self.active.push(region);
        let summary = match region {
            Region::Loop(head) => self.turns(head, entry)?,
            Region::Subroutine(_) | Region::Turn(_) => self.ways(region, address, entry)?,
        };
        self.active.pop();
        let summary = Rc::new(summary);
        self.known.insert(key, Rc::clone(&summary));
        Ok(summary)
    }

    /// Summary of a loop: iterates over the set of states at its head, at most `most` times.
    fn turns(&mut self, head: BundleAddress, entry: &State) -> Result<Summary, BoundError> {
        let Loop { mut least, mut most, total, counted, .. } = self.graph.loops[&head];
        let price = self.prices.get(&head).copied();
        // Counts of 0, or beyond the loop bound, are faults.
        if let Some(count) = entry.values.count.filter(|count| (1..=most).contains(count) && counted) {
            (least, most) = (count, count);
        }
        let again = Edge { to: head, back: true };
        let mut summary = Summary::default();
        let first = State { values: Values { count: None, ..entry.values.clone() }, ..entry.clone() };
        let mut heads = BTreeMap::from([(first, Cost::ZERO)]);
        summary.needs.priced.extend(price.map(|_| head));
        let price = price.unwrap_or(0).cast_signed();
        let (mut logged, mut recurrence) = (Vec::new(), None);
        for turn in 1..=most {
            let mut next: BTreeMap<State, Cost> = BTreeMap::new();
            let mut left: Vec<(Outcome, Cost)> = Vec::new();
            let mut places = Vec::new();
            for (state, before) in &heads {
                self.step(head)?;
                let one = self.explore(Region::Turn(head), state)?;
                summary.needs.contain(&one.needs);
                if self.log.is_some() {
                    places.push((state.clone(), *before, Rc::clone(&one)));
                }
                for (outcome, cost) in &one.outcomes {
                    let cost = before.and(Cost { worst: cost.worst - price, ..*cost });
                    match outcome {
                        Outcome::Go { edge, state } if *edge == again => add(&mut next, state.clone(), cost),
                        _ => left.push((outcome.clone(), cost)),
                    }
                }
            }
            // Fixed point: a single state at the head, which leads to itself. All remaining iterations then take the same cycles, and
            // are multiplied instead of explored.
            let steady = heads.len() == 1 && next.keys().eq(heads.keys());
            let best = |costs: &BTreeMap<State, Cost>| costs.values().map(|cost| cost.best).max();
            let worst = |costs: &BTreeMap<State, Cost>| costs.values().map(|cost| cost.worst).max();
            let best = best(&next).unwrap_or(0).saturating_sub(best(&heads).unwrap_or(0));
            let worst = worst(&next).unwrap_or(0).saturating_sub(worst(&heads).unwrap_or(0));
            if total.is_some() {
                // Cycles of the last iteration before a steady state, or of the first steady iteration.
                self.found.insert(head, worst.max(0).cast_unsigned());
            }
            for (outcome, cost) in left {
                // A sequencer-counted loop exits only when its count is used up.
                let is_exit = counted && matches!(outcome, Outcome::Go { .. });
                let soonest = if is_exit { least.saturating_sub(turn) } else { 0 };
                if !steady && soonest > 0 {
                    continue;
                }
                let latest = if steady { most - turn } else { 0 };
                // Iterations whose price is above their cycles make the shortest way the costliest.
                let costliest = if worst < 0 { soonest } else { latest };
                let more = Cost {
                    best: best.saturating_mul(soonest.into()),
                    worst: worst.saturating_mul(costliest.into()),
                };
                add(&mut summary.outcomes, outcome, cost.and(more));
            }
            logged.push(places);
            if steady {
                recurrence = Some(Cost { best, worst });
            }
            if next.is_empty() || steady {
                break;
            }
            heads = widened(next);
        }
        summary.needs.counted += u32::from(counted);
        if let Some(log) = &mut self.log {
            let last = logged.len() as u32;
            let is_never = |turn: u32, outcome: &Outcome| match outcome {
                Outcome::Go { edge, .. } if *edge == again => turn == most,
                Outcome::Go { .. } => counted && turn < least && !(recurrence.is_some() && turn == last),
                _ => false,
            };
            summary.number = log.turns(again, entry, &logged, recurrence, is_never, &summary.outcomes);
        }
        Ok(summary)
    }

    /// Summary of a subroutine or of one iteration of a loop: propagates states along its edges in topological order, so that all paths to
    /// a bundle have met when it is visited.
    fn ways(&mut self, region: Region, entry: BundleAddress, state: &State) -> Result<Summary, BoundError> {
        let order = self.order(region, entry)?;
        let mut summary = Summary::default();
        let mut places = Vec::new();
        let mut left =
            BTreeMap::from([((order[&entry], entry), BTreeMap::from([(state.clone(), Cost::ZERO)]))]);
        while let Some(((_, address), states)) = left.pop_first() {
            for (state, before) in widened(states) {
                let piece = if self.graph.loops.contains_key(&address) && region != Region::Turn(address) {
                    self.inner(Region::Loop(address), &state)?
                } else {
                    self.step(address)?;
                    self.run(address, &state)?
                };
                summary.needs.contain(&piece.needs);
                for (outcome, cost) in piece.edges.iter().flatten() {
                    let cost = before.and(*cost);
                    match outcome {
                        Outcome::Go { edge, state } if self.stays(region, edge.to) => {
                            // The bundle has no position if an inner loop has an exit to outside of this one.
                            let number = order.get(&edge.to).copied();
                            let place = number.ok_or_else(|| self.error(address, Refusal::Overlap))?;
                            add(left.entry((place, edge.to)).or_default(), state.clone(), cost);
                        }
                        _ => add(&mut summary.outcomes, outcome.clone(), cost),
                    }
                }
                if self.log.is_some() {
                    places.push(LoggedPlace {
                        at: address,
                        state,
                        before,
                        step: piece.step,
                        edges: piece.edges,
                    });
                }
            }
        }
        if self.log.is_some() {
            let stays = |to| self.stays(region, to);
            let targets = LoggedPlace::targets(&places, stays, &summary.outcomes);
            summary.number = self.log.as_mut().map_or(0, |log| log.code(places, targets, &summary.outcomes));
        }
        Ok(summary)
    }

    /// Loop within a region. Only the registers that the loop uses enter the summary's key; the other values pass unchanged.
    fn inner(&mut self, region: Region, state: &State) -> Result<Piece, BoundError> {
        let (Region::Subroutine(head) | Region::Loop(head) | Region::Turn(head)) = region;
        let used = self
            .used
            .get(&region)
            .cloned()
            .unwrap_or_else(|| Rc::new(self.slice.used(&self.graph, &self.graph.loops[&head].body)));
        self.used.insert(region, Rc::clone(&used));
        let values = Values { count: state.values.count, ..state.values.of(&used) };
        let inside = self.explore(region, &State { values, ..state.clone() })?;
        let mut needs = Needs::default();
        needs.contain(&inside.needs);
        let edge = |(outcome, cost): (&Outcome, &Cost)| {
            let mut outcome = outcome.clone();
            if let Outcome::Go { state: after, .. } | Outcome::Return { state: after, .. } = &mut outcome {
                after.values = state.values.with(&used, &after.values);
            }
            Some((outcome, *cost))
        };
        Ok(Piece {
            step: Step::Loop(inside.number),
            edges: inside.outcomes.iter().map(edge).collect(),
            needs,
        })
    }

    /// The edge to this bundle stays in the region; an edge to the head of a loop leaves the iteration.
    fn stays(&self, region: Region, to: BundleAddress) -> bool {
        match region {
            Region::Turn(head) => to != head && self.graph.loops[&head].body.contains(&to),
            Region::Subroutine(_) | Region::Loop(_) => true,
        }
    }

    /// Straight-line code: from a bundle to the next one that branches or is a branch target. A call's callee is included.
    fn run(&mut self, entry: BundleAddress, state: &State) -> Result<Piece, BoundError> {
        let machine = self.graph.program.machine;
        let mut scoreboard = Scoreboard::resume(machine, &state.residue);
        let mut values = state.values.clone();
        let (mut address, mut delivered) = (entry, 0);
        let (at, cycle, flow, taken, closes) = loop {
            let node = self.graph.node(address)?;
            let cycle = scoreboard.issue(&node.timing, address, delivered).cycle;
            // The branch reads its register before the bundle writes.
            let mut taken = node.taken;
            if let Flow::Branch { register, zero, .. } = node.flow {
                taken = taken.or_else(|| values.get(register).map(|value| (value == 0) == zero));
            }
            let mut count = None;
            if let Flow::Loop { count: register, .. } = node.flow {
                count = values.get(register);
            }
            if !self.slice.is_empty() {
                self.slice.execute(&self.graph, &node.instructions, &mut values);
            }
            values.count = count;
            if node.flow != Flow::Next || self.graph.is_leader(address.next()) {
                break (address, cycle, node.flow, taken, node.closes);
            }
            (address, delivered) = (address.next(), timing::after_sequential(cycle));
        };
        let published = state.published || flow == Flow::Publish;
        let go = |to, back, delivered| {
            let state = State { residue: scoreboard.residue(delivered), values: values.clone(), published };
            Some((Outcome::Go { edge: Edge { to, back }, state }, Cost::exactly(delivered)))
        };
        let last = at.get();
        let (mut step, mut needs) = (Step::To(last), Needs::default());
        let redirected = timing::after_redirect(machine, cycle);
        let edges = match flow {
            Flow::Next => vec![go(at.next(), false, timing::after_sequential(cycle))],
            Flow::Publish => {
                let mut edges = vec![go(at.next(), false, timing::after_sequential(cycle))];
                if !state.published {
                    edges.push(Some((Outcome::Publish { at }, Cost::exactly(cycle))));
                }
                edges
            }
            Flow::Loop { end, .. } => vec![go(at.next(), false, timing::after_loop(machine, at, end, cycle))],
            Flow::LoopEnd => {
                let back = closes.and_then(|head| go(head, true, timing::after_sequential(cycle)));
                vec![back, go(at.next(), false, timing::after_sequential(cycle))]
            }
            Flow::Jump(target) => vec![go(target, target <= at, redirected)],
            Flow::Branch { target, .. } => {
                let is_taken = go(target, target <= at, redirected).filter(|_| taken != Some(false));
                let next = go(at.next(), false, timing::after_not_taken(machine, cycle));
                vec![is_taken, next.filter(|_| taken != Some(true))]
            }
            Flow::Call(target) => {
                if self.active.contains(&Region::Subroutine(target)) {
                    let callee = place(self.graph.program, target);
                    return Err(self.error(at, Refusal::Recursion { callee }));
                }
                let state = State { residue: scoreboard.residue(redirected), values, published };
                let callee = self.explore(Region::Subroutine(target), &state)?;
                needs.contain(&callee.needs);
                needs.calls = callee.needs.calls + 1;
                step = Step::Call(last, callee.number);
                let mut edges = Vec::new();
                for (outcome, cost) in &callee.outcomes {
                    let outcome = match outcome {
                        Outcome::Return { state, .. } => {
                            Outcome::Go { edge: Edge { to: at.next(), back: false }, state: state.clone() }
                        }
                        Outcome::Wait { at, .. } => return Err(self.error(*at, Refusal::WaitInSubroutine)),
                        Outcome::Publish { .. } | Outcome::Halt { .. } | Outcome::Go { .. } => {
                            outcome.clone()
                        }
                    };
                    edges.push(Some((outcome, cost.and(Cost::exactly(redirected)))));
                }
                edges
            }
            Flow::Return => {
                let state = State { residue: scoreboard.residue(redirected), values, published };
                vec![Some((Outcome::Return { at, state }, Cost::exactly(redirected)))]
            }
            Flow::Wait(target) => {
                let residue = scoreboard.residue(redirected);
                vec![Some((Outcome::Wait { at, target, residue, published }, Cost::exactly(cycle)))]
            }
            Flow::Halt => vec![Some((Outcome::Halt { at }, Cost::exactly(cycle)))],
        };
        Ok(Piece { step, edges, needs })
    }

    /// Numbers the bundles of a region in topological order. A counted loop inside it is a single node; any other cycle is an error, since
    /// it has no bound.
    fn order(
        &mut self,
        region: Region,
        entry: BundleAddress,
    ) -> Result<Rc<HashMap<BundleAddress, usize>>, BoundError> {
        if let Some(known) = self.orders.get(&region) {
            return Ok(Rc::clone(known));
        }
        let follow = |address: BundleAddress| -> Result<Vec<BundleAddress>, BoundError> {
            let inner = self.graph.loops.get(&address).filter(|_| region != Region::Turn(address));
            let edges: Vec<Edge> = match inner {
                Some(inner) => inner.exits.iter().copied().collect(),
                None => self.graph.successors(address).collect(),
            };
            if let Region::Turn(head) = region
                && edges.contains(&Edge { to: head, back: false })
            {
                return Err(self.error(head, Refusal::Uncounted { from: place(self.graph.program, address) }));
            }
            Ok(edges.iter().map(|edge| edge.to).filter(|to| self.stays(region, *to)).collect())
        };
        // Reverse postorder of a depth-first search: numbers are given from the largest down, to a bundle after all its successors.
        let mut order = HashMap::new();
        let mut open = BTreeSet::from([entry]);
        let mut stack = vec![(entry, follow(entry)?)];
        let mut number = usize::MAX;
        while let Some((address, following)) = stack.last_mut() {
            let address = *address;
            match following.pop() {
                Some(to) if open.contains(&to) => {
                    let from = place(self.graph.program, address);
                    let counted = self.graph.loops.contains_key(&to);
                    let refusal = if counted {
                        Refusal::Uncounted { from }
                    } else {
                        Refusal::Unbounded { closed: from }
                    };
                    return Err(self.error(to, refusal));
                }
                Some(to) if !order.contains_key(&to) => {
                    let follows = follow(to)?;
                    open.insert(to);
                    stack.push((to, follows));
                }
                Some(_) => {}
                None => {
                    order.insert(address, number);
                    number -= 1;
                    open.remove(&address);
                    stack.pop();
                }
            }
        }
        let order = Rc::new(order);
        self.orders.insert(region, Rc::clone(&order));
        Ok(order)
    }
}
