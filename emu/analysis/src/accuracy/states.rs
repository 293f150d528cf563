// SPDX-License-Identifier: MIT OR Apache-2.0
//! Induction over periods: states that begin the first period in their range, and that a period, or all periods together, keep there.

use super::converge::Linear;
use super::enclose::Explorer;
use super::enclosure::{Converging, Moment, StateRange, UnprovedRange};
use super::interval::Interval;
use super::number::{Number, float_grid};
use super::value::Value;
use std::rc::Rc;
use takt_isa::program::{ArrayRange, Range};
use takt_isa::{Register, Type};

/// Limit on the states whose linear map is examined.
pub(super) const MAX_LINEAR: usize = 64;

/// Location of a value that outlives a bundle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Place {
    Register(Register),
    /// Word of data memory.
    Word(u32),
}

/// State with its declared range.
#[derive(Clone, Copy)]
struct Tracked {
    place: Place,
    range: StateRange,
}

impl Tracked {
    fn ends(&self) -> Interval {
        interval(&self.range)
    }
}

fn interval(range: &StateRange) -> Interval {
    let (low, high) = range.ends();
    Interval::new(low, high)
}

/// Values of a state in the type of its range: binary32 or integer.
fn held(range: &StateRange, value: &Value) -> Option<Interval> {
    match range.ty() {
        Type::F => value.float().ok().map(|number| number.actual),
        Type::I | Type::B => Some(value.whole().actual),
    }
}

/// The state is proved to lie in its range.
fn shown(range: &StateRange, value: Option<&Value>) -> bool {
    value.and_then(|value| held(range, value)).is_some_and(|found| found.within(interval(range)))
}

/// The register is proved to lie in its range.
pub(super) fn is_shown(range: &Range, value: Option<&Value>) -> bool {
    shown(&StateRange::Register(*range), value)
}

/// The words are proved to lie in their array's range.
pub(super) fn is_word_shown(range: &ArrayRange, value: &Value) -> bool {
    shown(&StateRange::Array(*range), Some(value))
}

impl Explorer<'_> {
    /// Value within a promised range, without error unless it is an input that stands for a real number.
    pub(super) fn ranged(&mut self, place: Place, ty: Type, (low, high): (f64, f64)) -> Value {
        let symbol = self.symbol(None);
        self.state_symbols.insert(place, symbol);
        if self.plain {
            self.entered.push((symbol, place));
        }
        let ends = Interval::new(low, high);
        let grid = if ty == Type::F { float_grid(ends) } else { Some(0) };
        let is_input = matches!(place, Place::Register(register) if self.program.machine.is_input(register));
        let number = match self.real_inputs && is_input && ty == Type::F {
            true => Number::rounded(ends, [symbol, self.symbol(None)], grid),
            false => Number::of(ends, symbol, grid),
        };
        let number = Rc::new(number);
        match ty {
            Type::F => Value::Float(number),
            Type::I | Type::B => Value::Integer(number),
        }
    }

    /// States that periods write: registers with a range, and the written words of arrays with one.
    fn tracked(&self) -> Vec<Tracked> {
        let registers = self.program.ranges.iter();
        let registers =
            registers.filter(|range| !self.program.machine.is_input(range.register)).map(|range| Tracked {
                place: Place::Register(range.register),
                range: StateRange::Register(*range),
            });
        let words = self.program.array_ranges.iter().flat_map(|range| {
            let word = |word| Tracked { place: Place::Word(word), range: StateRange::Array(*range) };
            range.span().map(word)
        });
        registers.chain(words).filter(|state| self.found.left.contains_key(&state.place)).collect()
    }

    /// States that no single period keeps in their ranges, if their linear part proves that all of them stay there for all time.
    pub(super) fn converging(&self) -> Vec<Converging> {
        let is_open = |state: &Tracked| !shown(&state.range, self.found.left.get(&state.place));
        let tracked = self.tracked();
        let open: Vec<Tracked> = tracked.iter().copied().filter(is_open).collect();
        // With several periods, each has its own symbols for the states.
        if open.is_empty() || self.periods != 1 {
            return Vec::new();
        }
        // A state whose range is proved already may converge with the others, or not (a limited integrator): try with and without these.
        let is_float = |state: &Tracked| matches!(self.found.left.get(&state.place), Some(Value::Float(_)));
        let all: Vec<Tracked> = tracked.into_iter().filter(is_float).collect();
        let kept = [&all, &open].into_iter().find_map(|states| {
            let bounded = self.bounded_by_convergence(states)?;
            let found = bounded.into_iter().filter(|(state, _)| is_open(state));
            let found: Vec<(Tracked, Interval)> = found.collect();
            let within = |(state, found): &(Tracked, Interval)| found.within(state.ends());
            (found.len() == open.len() && found.iter().all(within)).then_some(found)
        });
        let mut converging: Vec<Converging> = Vec::new();
        for (Tracked { range, .. }, found) in kept.unwrap_or_default() {
            // The words of an array follow one another.
            match converging.last_mut().filter(|last| last.range == range) {
                Some(last) => last.found = last.found.hull(found),
                None => converging.push(Converging { range, found }),
            }
        }
        converging
    }

    fn bounded_by_convergence(&self, states: &[Tracked]) -> Option<Vec<(Tracked, Interval)>> {
        if states.len() > MAX_LINEAR {
            return None;
        }
        let symbols: Option<Vec<u32>> =
            states.iter().map(|state| self.state_symbols.get(&state.place).copied()).collect();
        let (symbols, mut linear) =
            (symbols?, Linear { rows: Vec::new(), added: Vec::new(), first: Vec::new() });
        for state in states {
            let Some(Value::Float(number)) = self.found.left.get(&state.place) else { return None };
            let (middle, radius) = (state.ends().middle(), Interval::point(state.ends().radius()));
            if radius.low <= 0.0 {
                return None;
            }
            let (row, rest) = number.form.apart(&symbols, middle);
            let added = Interval::point(rest) + Interval::point(number.error_range().magnitude());
            linear.rows.push(row.into_iter().map(|factor| Interval::point(factor) / radius).collect());
            linear.added.push((added / radius).high);
            let initial = self.first_value(state.place).filter(|value| shown(&state.range, Some(value)));
            let first = initial.and_then(|value| held(&state.range, &value)).unwrap_or(state.ends());
            linear.first.push(((first - Interval::point(middle)).abs() / radius).high);
        }
        let found = states.iter().zip(linear.largest()?).map(|(state, most)| {
            let most = (Interval::point(most) * Interval::point(state.ends().radius())).high;
            (*state, Interval::point(state.ends().middle()).widened(most))
        });
        Some(found.collect())
    }

    /// Value of a state when the first period begins.
    pub(super) fn first_value(&self, place: Place) -> Option<Value> {
        let loaded = match place {
            Place::Register(_) => None,
            Place::Word(word) => Some(self.program.data.get(word as usize).copied().unwrap_or(0)),
        };
        self.initial.get(&place).cloned().or_else(|| loaded.map(Value::bits))
    }

    /// States whose declared range is not proved, at one of the two points of the induction.
    pub(super) fn unproved(&self, converging: &[Converging]) -> Vec<UnprovedRange> {
        let later = |range: StateRange, places: &[Place]| {
            let left: Vec<&Value> = places.iter().filter_map(|place| self.found.left.get(place)).collect();
            let converges = converging.iter().any(|state| state.range == range);
            let is_open = !converges && !left.iter().all(|value| shown(&range, Some(value)));
            is_open.then(|| UnprovedRange { range, moment: Moment::Later, found: hull(&range, left) })
        };
        let states =
            self.program.ranges.iter().filter(|range| !self.program.machine.is_input(range.register));
        let registers = states.flat_map(|state| {
            let (range, place) = (StateRange::Register(*state), Place::Register(state.register));
            let first = self.needed.contains(&state.register).then(|| {
                let found = self.initial.get(&place).and_then(|value| held(&range, value));
                UnprovedRange { range, moment: Moment::First, found }
            });
            first.into_iter().chain(later(range, &[place]))
        });
        let arrays = self.program.array_ranges.iter().flat_map(|array| {
            let range = StateRange::Array(*array);
            let places: Vec<Place> = array.span().map(Place::Word).collect();
            let first: Vec<Value> = places.iter().filter_map(|place| self.first_value(*place)).collect();
            let is_open = self.periods > 0 && !first.iter().all(|value| shown(&range, Some(value)));
            let first = is_open.then(|| UnprovedRange {
                range,
                moment: Moment::First,
                found: hull(&range, first.iter().collect()),
            });
            first.into_iter().chain(later(range, &places))
        });
        registers.chain(arrays).collect()
    }
}

/// Range of several values; `None` if any has none.
fn hull(range: &StateRange, values: Vec<&Value>) -> Option<Interval> {
    let found: Option<Vec<Interval>> = values.into_iter().map(|value| held(range, value)).collect();
    found?.into_iter().reduce(Interval::hull)
}
