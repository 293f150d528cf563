// SPDX-License-Identifier: MIT OR Apache-2.0
//! Log of an analysis of bounds, as a certificate ([`takt_isa::certificate`]): each summary becomes a lemma.

use crate::bound::{Bounds, Cost, Outcome, Prices, SectionBounds, State, Summary};
use crate::graph::Edge;
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;
use takt_isa::certificate::{self, Certificate, Claim, Cycles, End, Entry, Exit, Lemma, Place, Proof};
use takt_isa::certificate::{Step, Target, Times, Turn};
use takt_isa::timing::{Residue, Span};
use takt_isa::{BundleAddress, Program};

/// Proof of an analysis, lemma by lemma.
#[derive(Default)]
pub(crate) struct Log {
    proof: Proof,
    states: HashMap<State, u32>,
}

/// Visit of a bundle in one state.
pub(crate) struct LoggedPlace {
    pub(crate) at: BundleAddress,
    pub(crate) state: State,
    pub(crate) before: Cost,
    pub(crate) step: Step,
    pub(crate) edges: Vec<Option<(Outcome, Cost)>>,
}

/// Ways out of a lemma, ascending.
type Outcomes = BTreeMap<Outcome, Cost>;

impl LoggedPlace {
    /// Targets of the edges of all places of a lemma. Values of registers may have been forgotten at a target.
    pub(crate) fn targets(
        places: &[LoggedPlace],
        stays: impl Fn(BundleAddress) -> bool,
        exits: &Outcomes,
    ) -> Vec<Vec<Target>> {
        let numbers: HashMap<(BundleAddress, &State), u32> =
            places.iter().zip(0..).map(|(place, number)| ((place.at, &place.state), number)).collect();
        let exits = exit_numbers(exits);
        let target = |edge: &Option<(Outcome, Cost)>| match edge {
            None => Target::None,
            Some((Outcome::Go { edge, state }, _)) if stays(edge.to) => {
                let forgotten = state.forgotten();
                let number = numbers.get(&(edge.to, state)).or_else(|| numbers.get(&(edge.to, &forgotten)));
                number.map_or(Target::None, |number| Target::Place(*number))
            }
            Some((outcome, _)) => exits.get(outcome).map_or(Target::None, |number| Target::Exit(*number)),
        };
        places.iter().map(|place| place.edges.iter().map(target).collect()).collect()
    }
}

fn exit_numbers(exits: &Outcomes) -> BTreeMap<&Outcome, u32> {
    exits.keys().zip(0..).collect()
}

impl Log {
    pub(crate) fn new(prices: &Prices) -> Log {
        let prices = prices.iter().map(|(head, price)| (head.get(), *price)).collect();
        Log { proof: Proof { prices, ..Proof::default() }, states: HashMap::new() }
    }

    pub(crate) fn proof(self) -> Proof {
        self.proof
    }

    /// Number of a state, the same for equal ones.
    fn state(&mut self, state: &State) -> u32 {
        if let Some(number) = self.states.get(state) {
            return *number;
        }
        let number = self.proof.states.len() as u32;
        let State { residue, values, published } = state;
        let pending = residue.pending().iter().map(|(register, left)| (register.get(), *left));
        let busy = residue.busy().iter().map(|(slot, unit, left)| (slot.index() as u8, *unit, *left));
        let known = values.known.iter().map(|(register, value)| (register.get(), *value));
        self.proof.states.push(certificate::State {
            pending: pending.collect(),
            busy: busy.collect(),
            known: known.collect(),
            count: values.count,
            published: *published,
        });
        self.states.insert(state.clone(), number);
        number
    }

    fn after_wait(&mut self, residue: &Residue, published: bool) -> u32 {
        self.state(&State { residue: residue.clone(), published, ..State::default() })
    }

    fn exits(&mut self, outcomes: &Outcomes) -> Vec<Exit> {
        let exit = |(outcome, cost): (&Outcome, &Cost)| {
            let (end, state) = match outcome {
                Outcome::Go { edge, state } => {
                    (End::Go { to: edge.to.get(), back: edge.back }, Some(self.state(state)))
                }
                Outcome::Return { at, state } => (End::Return { at: at.get() }, Some(self.state(state))),
                Outcome::Wait { at, target, residue, published } => {
                    let end = End::Wait { at: at.get(), target: target.get() };
                    (end, Some(self.after_wait(residue, *published)))
                }
                Outcome::Publish { at } => (End::Publish { at: at.get() }, None),
                Outcome::Halt { at } => (End::Halt { at: at.get() }, None),
            };
            Exit { end, state, cycles: cycles(*cost) }
        };
        outcomes.iter().map(exit).collect()
    }

    fn lemma(&mut self, lemma: Lemma) -> u32 {
        self.proof.lemmas.push(lemma);
        self.proof.lemmas.len() as u32 - 1
    }

    /// Lemma of code without a loop of its own.
    pub(crate) fn code(
        &mut self,
        places: Vec<LoggedPlace>,
        targets: Vec<Vec<Target>>,
        outcomes: &Outcomes,
    ) -> u32 {
        let place = |(place, targets): (LoggedPlace, Vec<Target>)| {
            let edge = |(edge, to): (Option<(Outcome, Cost)>, Target)| {
                let cost = edge.map_or(Cost::ZERO, |(_, cost)| cost);
                certificate::Edge { to, cycles: cycles(cost) }
            };
            Place {
                at: place.at.get(),
                state: self.state(&place.state),
                cycles: cycles(place.before),
                step: place.step,
                edges: place.edges.into_iter().zip(targets).map(edge).collect(),
            }
        };
        let places = places.into_iter().zip(targets).map(place).collect();
        let exits = self.exits(outcomes);
        self.lemma(Lemma::Code { places, exits })
    }

    /// Lemma of all iterations of a loop. `is_never` tells the exits of an iteration, by its number from 1, that no run takes.
    pub(crate) fn turns(
        &mut self,
        again: Edge,
        entry: &State,
        turns: &[Vec<(State, Cost, Rc<Summary>)>],
        recurrence: Option<Cost>,
        is_never: impl Fn(u32, &Outcome) -> bool,
        outcomes: &Outcomes,
    ) -> u32 {
        let exits = exit_numbers(outcomes);
        let mut all = Vec::new();
        for (turn, number) in turns.iter().zip(1..) {
            let next: HashMap<&State, u32> = match turns.get(number as usize) {
                Some(next) => next.iter().map(|(state, ..)| state).zip(0..).collect(),
                None => HashMap::new(),
            };
            let target = |outcome: &Outcome| match outcome {
                outcome if is_never(number, outcome) => Target::None,
                Outcome::Go { edge, state } if *edge == again => {
                    let place = next.get(state).or_else(|| next.get(&state.forgotten()));
                    place.map_or(Target::None, |place| Target::Place(*place))
                }
                outcome => exits.get(outcome).map_or(Target::None, |exit| Target::Exit(*exit)),
            };
            let place = |(state, before, lemma): &(State, Cost, Rc<Summary>)| Turn {
                state: self.state(state),
                cycles: cycles(*before),
                lemma: lemma.number,
                edges: lemma.outcomes.keys().map(target).collect(),
            };
            all.push(turn.iter().map(place).collect());
        }
        let (head, state, steady) = (again.to.get(), self.state(entry), recurrence.map(cycles));
        let exits = self.exits(outcomes);
        self.lemma(Lemma::Loop { head, state, turns: all, steady, exits })
    }

    /// Beginning of a section.
    pub(crate) fn enter(
        &mut self,
        once: bool,
        address: BundleAddress,
        state: &State,
        soonest: bool,
        lemma: u32,
    ) {
        let state = self.state(state);
        self.proof.entries.push(Entry { address: address.get(), once, state, soonest, lemma });
    }
}

fn cycles(cost: Cost) -> certificate::Cost {
    (cost.best, cost.worst)
}

/// Certificate of a program's bounds.
pub(crate) fn certificate(program: &Program, bounds: &Bounds, proofs: Vec<Proof>) -> Certificate {
    let span = |span: Span| -> Cycles { (span.best, span.worst) };
    let claim = |section: &SectionBounds| {
        let times = |cycles: Span, in_time: Span, missed: Span| Times {
            refilled: span(cycles),
            in_time: (!section.once).then(|| span(in_time)),
            missed: (!section.once).then(|| span(missed)),
        };
        Claim {
            name: section.name.clone(),
            address: section.address.get(),
            once: section.once,
            cycles: times(section.cycles, section.in_time, section.missed),
            published: section.published.map(|of| times(of.cycles, of.in_time, of.missed)),
        }
    };
    Certificate {
        format: certificate::FORMAT.to_owned(),
        machine: program.machine.name.to_owned(),
        program: certificate::fingerprint(program),
        sections: bounds.sections.iter().map(claim).collect(),
        proofs,
    }
}
