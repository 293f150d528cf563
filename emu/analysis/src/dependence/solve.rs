// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fixed-point solver of the data-flow analysis for one input, one period per iteration.

use super::cell::Cell;
use super::graph::{Gate, PeriodGraphs, Section, Step, Storage, ValueDestination, ValueSource};
use super::{MAX_ROUNDS, OutputEvent, Periods};
use takt_isa::Register;

/// Abstract value of every storage place.
type State = Vec<Cell>;

/// States at the end of a section, joined over all paths.
struct SectionStates {
    /// States before the bundle with the `wait`, and after it.
    before: State,
    after: State,
    /// Least ages of the places anywhere in the section: an output port may be read in mid-period.
    any: State,
}

/// Solution for one input: the states of [`SectionStates`], joined over all sections.
#[derive(Debug)]
pub(super) struct Solution<'a> {
    flat: &'a PeriodGraphs,
    /// The iteration reached a fixed point.
    whole: bool,
    before: State,
    after: State,
    any: State,
}

/// Joins the state of a control-flow path into the state of a block.
fn merge(into: &mut Option<State>, state: &State) {
    match into {
        None => *into = Some(state.clone()),
        Some(into) => into.iter_mut().zip(state).for_each(|(one, other)| *one = one.or(*other)),
    }
}

impl<'a> Solution<'a> {
    pub(super) fn new(flat: &'a PeriodGraphs, input: Register) -> Solution<'a> {
        let source = flat.registers.get(&input).copied();
        let none = || {
            let mut state = vec![Cell::NONE; flat.places];
            source.into_iter().for_each(|source| state[source] = Cell::INPUT);
            state
        };
        let solved = |whole, before, after, any| Solution { flat, whole, before, after, any };
        if source.is_none() {
            return solved(true, none(), none(), none());
        }
        // Start with no dependence; each iteration adds one period, and with it more dependences.
        let mut entries: Vec<State> = flat.sections.iter().map(|_| none()).collect();
        for _ in 0..MAX_ROUNDS {
            let ends: Vec<SectionStates> =
                flat.sections.iter().zip(&entries).map(|(section, entry)| flat.run(section, entry)).collect();
            let mut next: Vec<Option<State>> = vec![None; entries.len()];
            for (section, ends) in flat.sections.iter().zip(&ends) {
                let mut later: State = ends.after.iter().map(|cell| cell.later()).collect();
                source.into_iter().for_each(|source| later[source] = Cell::INPUT);
                for &to in &section.next {
                    merge(&mut next[to], &later);
                }
            }
            let next: Vec<State> = next.into_iter().map(|state| state.unwrap_or_else(none)).collect();
            if next == entries {
                let all = |pick: fn(&SectionStates) -> &State| {
                    let mut all = None;
                    ends.iter().for_each(|ends| merge(&mut all, pick(ends)));
                    all.unwrap_or_else(none)
                };
                return solved(
                    true,
                    all(|ends| &ends.before),
                    all(|ends| &ends.after),
                    all(|ends| &ends.any),
                );
            }
            entries = next;
        }
        solved(false, none(), none(), none())
    }

    pub(super) fn output(&self, output: Register, sent: OutputEvent) -> Option<Periods> {
        if !self.whole {
            return Some(Periods::UNKNOWN);
        }
        let place = *self.flat.registers.get(&output)?;
        let (least, most) = match sent {
            OutputEvent::Written => (self.any[place], self.after[place]),
            OutputEvent::AtWait => (self.before[place], self.before[place]),
            OutputEvent::By(by) => match self.flat.sent.get(&(output, by))? {
                (sent, true) => (self.any[*sent], self.after[*sent]),
                (sent, false) => {
                    let any = self.any[place].with(self.any[*sent]).uncertain();
                    (any, any)
                }
            },
        };
        // Least and most come from different states: at first, an output may still hold the previous period's value.
        let (least, end) = (least.periods()?, most.periods());
        let (most, lasting) = end.map_or((None, false), |end| (end.most, end.lasting));
        Some(Periods { least: least.least, most, lasting })
    }
}

impl PeriodGraphs {
    /// Runs one period from the state at its entry, to the fixed point over its loops.
    fn run(&self, section: &Section, entry: &State) -> SectionStates {
        let blocks = &section.blocks;
        let mut after: Vec<Option<State>> = vec![None; blocks.len()];
        // Abstract value of each block's branch condition; bottom until a path reaches it.
        let mut tested = vec![Cell::BOTTOM; blocks.len()];
        let mut changed;
        loop {
            changed = false;
            let (mut before_end, mut after_end) = (None, None);
            let mut any = entry.clone();
            for (number, block) in blocks.iter().enumerate() {
                let mut state = (number == 0).then(|| entry.clone());
                for state_before in block.before.iter().filter_map(|&before| after[before].as_ref()) {
                    merge(&mut state, state_before);
                }
                let Some(mut state) = state else { continue };
                open(&block.gates, &tested, &mut state, &mut any);
                let mut decided =
                    block.under.iter().fold(Cell::NONE, |all, &branch| all.under(tested[branch]));
                if let Some(which) = self.which {
                    decided = decided.under(state[which]);
                }
                let mut memory = None;
                for (at, step) in block.steps.iter().enumerate() {
                    if at + 1 == block.steps.len() {
                        let test = block.tests.map_or(Cell::NONE, |place| state[place]);
                        changed |= std::mem::replace(&mut tested[number], test) != test;
                        if block.waits {
                            merge(&mut before_end, &state);
                        }
                    }
                    self.step(step, decided, &mut state, &mut memory, &mut any);
                }
                if block.waits {
                    merge(&mut after_end, &state);
                }
                if after[number].as_ref() != Some(&state) {
                    (after[number], changed) = (Some(state), true);
                }
            }
            if changed {
                continue;
            }
            let mut end = |end: Option<State>| {
                let mut end = end.unwrap_or_else(|| vec![Cell::NONE; self.places]);
                open(&section.gates, &tested, &mut end, &mut any);
                self.choose(section, &tested, &mut end);
                end
            };
            let (before, after) = (end(before_end), end(after_end));
            any.iter_mut().zip(&after).for_each(|(any, cell)| *any = any.under(*cell));
            return SectionStates { before, after, any };
        }
    }

    /// Adds the control dependence on the choice of the period: a written value depends on which period ran, and that depends on the
    /// branches on the path to the previous `wait`.
    fn choose(&self, section: &Section, tested: &[Cell], end: &mut State) {
        let Some(which) = self.which else { return };
        let ran = end[which];
        self.written.iter().for_each(|&place| end[place] = end[place].under(ran));
        if section.next.len() > 1 {
            let branches = section.gates.iter().map(|gate| tested[gate.branch]);
            end[which] = branches.fold(ran, Cell::under);
        }
    }

    /// Executes a bundle abstractly. `memory` caches the join of all data words, for loads from an unknown address.
    fn step(
        &self,
        step: &Step,
        decided: Cell,
        state: &mut State,
        memory: &mut Option<Cell>,
        any: &mut State,
    ) {
        let mut read = |from: &ValueSource| match from {
            ValueSource::Places(from) => of_all(from, state),
            ValueSource::Memory(which) => {
                let words = memory.get_or_insert_with(|| {
                    let words = state[self.memory.clone()].iter().copied().reduce(Cell::or);
                    words.unwrap_or(Cell::NONE)
                });
                words.with(of_all(which, state))
            }
        };
        let values: Vec<Cell> = step.moves.iter().map(|(from, _)| read(from).under(decided)).collect();
        for (&(_, to), value) in step.moves.iter().zip(values) {
            let (place, value) = match to {
                ValueDestination::Place(place) => (place, value),
                ValueDestination::Gathered(place) => (place, state[place].or(value)),
                ValueDestination::Memory => {
                    state[self.memory.clone()].iter_mut().for_each(|word| *word = word.or(value));
                    *memory = memory.map(|words| words.or(value));
                    continue;
                }
            };
            if self.memory.contains(&place) {
                *memory = None;
            }
            (state[place], any[place]) = (value, any[place].under(value));
        }
        for &(port, sent) in &step.sends {
            let value = state[port].under(decided);
            (state[sent], any[sent]) = (value, any[sent].under(value));
        }
    }
}

/// Dependences of an operation that reads all these places.
fn of_all(places: &[Storage], state: &State) -> Cell {
    places.iter().fold(Cell::NONE, |all, &place| all.with(state[place]))
}

/// Adds control dependences where the paths of a branch meet again: the places that one of these paths may have written.
fn open(gates: &[Gate], tested: &[Cell], state: &mut State, any: &mut State) {
    for Gate { branch, always, written } in gates {
        let test = tested[*branch];
        for &place in written {
            let cell = if *always { state[place].with(test) } else { state[place].under(test) };
            (state[place], any[place]) = (cell, any[place].under(cell));
        }
    }
}
