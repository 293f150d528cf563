// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loops too long to be followed iteration by iteration: one abstract state for the head of all iterations.
//!
//! The state is an inductive invariant, found by iteration with widening to thresholds (Cousot, Cousot, POPL 1977) and improved by
//! narrowing. A value that grows by a step in each iteration is at most as many steps from its first value as the loop has iterations: so
//! counters, sums and their errors have bounds without a limit in the program. The invariant keeps ranges and errors of what the
//! loop changes, and no correlations; what the loop does not change keeps all.

use super::affine::Affine;
use super::enclose::{Explorer, Operands, State, Walk};
use super::interval::Interval;
use super::node::Node;
use super::number::{INTEGERS, Number, Problem};
use super::states::Place;
use super::value::Value;
use crate::error::BoundError;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use takt_isa::{BundleAddress, Register, SlotIndex};

/// Iterations of the search in which values are joined only; in which steps are counted; after which values count as unbounded.
const JOINED: u32 = 2;
const COUNTED: u32 = 8;
const WIDENED: u32 = 32;
/// Passes of narrowing.
const NARROWED: u32 = 3;
/// Limit on the bit patterns that an invariant lists, such as flags and modes.
const FEW: usize = 16;
/// Largest number of binary32.
const LARGEST: f64 = f32::MAX as f64;

/// Values of a register or word at a loop's head, over all iterations.
#[derive(Clone, PartialEq, Debug)]
enum Shape {
    /// Few bit patterns; arbitrary bits; bits that depend on a hazard; an unknown value.
    Bits(Value),
    Float(Bounds),
    Integer(Bounds),
}

/// Ranges of a number: in the run, in exact arithmetic, and of the difference.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Bounds {
    actual: Interval,
    exact: Interval,
    error: Interval,
}

impl Bounds {
    fn of(number: &Number) -> Bounds {
        Bounds { actual: number.actual, exact: number.exact, error: number.error_range() }
    }

    fn two(self, other: Bounds, of: impl Fn(Interval, Interval) -> Interval) -> Bounds {
        Bounds {
            actual: of(self.actual, other.actual),
            exact: of(self.exact, other.exact),
            error: of(self.error, other.error),
        }
    }

    fn within(self, outer: Bounds) -> bool {
        self.actual.within(outer.actual) && self.exact.within(outer.exact) && self.error.within(outer.error)
    }

    fn is_finite(self) -> bool {
        self.actual.magnitude() <= LARGEST && self.exact.is_finite() && self.error.is_finite()
    }
}

impl Shape {
    fn of(value: &Value) -> Shape {
        match value {
            Value::Patterns(patterns) if patterns.len() > FEW => {
                let float = value.float().ok().map(|number| Bounds::of(&number));
                // Small integers are subnormal numbers as floats.
                let float = float.filter(|float| float.actual.magnitude() >= f64::from(f32::MIN_POSITIVE));
                float.map_or_else(|| Shape::Integer(Bounds::of(&value.whole())), Shape::Float)
            }
            Value::Patterns(_) | Value::Any | Value::Broken | Value::Unknown => Shape::Bits(value.clone()),
            Value::Float(number) => Shape::Float(Bounds::of(number)),
            Value::Integer(_) | Value::Offset(_) | Value::Whole(_) => {
                Shape::Integer(Bounds::of(&value.whole()))
            }
        }
    }

    /// Ranges as a float; `None` if the bits are not known to be one.
    fn float(&self) -> Option<Bounds> {
        match self {
            Shape::Float(bounds) => Some(*bounds),
            Shape::Bits(value) => value.float().ok().map(|number| Bounds::of(&number)),
            Shape::Integer(_) => None,
        }
    }

    /// Ranges as an integer; `None` if a float, or unknown.
    fn integer(&self) -> Option<Bounds> {
        match self {
            Shape::Integer(bounds) => Some(*bounds),
            Shape::Bits(value @ Value::Patterns(_)) => Some(Bounds::of(&value.whole())),
            _ => None,
        }
    }

    fn join(&self, other: &Shape) -> Shape {
        match (self, other) {
            (Shape::Bits(a), Shape::Bits(b)) => Shape::of(&a.join(b)),
            (Shape::Float(_), _) | (_, Shape::Float(_)) => match (self.float(), other.float()) {
                (Some(a), Some(b)) => Shape::Float(a.two(b, Interval::hull)),
                _ => Shape::Bits(self.unknown(other)),
            },
            _ => match (self.integer(), other.integer()) {
                (Some(a), Some(b)) => Shape::Integer(a.two(b, Interval::hull)),
                _ => Shape::Bits(self.unknown(other)),
            },
        }
    }

    /// Least of the values without ranges that covers both.
    fn unknown(&self, other: &Shape) -> Value {
        let open = |shape: &Shape| match shape {
            Shape::Bits(value @ (Value::Broken | Value::Unknown)) => value.clone(),
            _ => Value::Any,
        };
        open(self).join(&open(other))
    }

    fn within(&self, outer: &Shape) -> bool {
        match outer {
            Shape::Float(all) => self.float().is_some_and(|bounds| bounds.within(*all)),
            Shape::Integer(all) => self.integer().is_some_and(|bounds| bounds.within(*all)),
            Shape::Bits(_) => self.join(outer) == *outer,
        }
    }

    /// Shape that both enclose.
    fn meet(&self, other: &Shape) -> Shape {
        match (self, other) {
            (Shape::Float(_), _) => {
                self.float().zip(other.float()).map(|(a, b)| Shape::Float(a.two(b, Interval::meet)))
            }
            (Shape::Integer(_), _) => {
                self.integer().zip(other.integer()).map(|(a, b)| Shape::Integer(a.two(b, Interval::meet)))
            }
            (Shape::Bits(_), _) => None,
        }
        .unwrap_or_else(|| self.clone())
    }
}

/// Search for an invariant of one loop.
struct Search {
    entry: State,
    /// Most iterations; `None` for any number.
    turns: Option<u32>,
    /// Values of what the loop changes.
    shapes: BTreeMap<Place, Shape>,
    /// Operations that errors come from.
    blamed: BTreeMap<Place, u32>,
    /// Changed values without a limit.
    unbounded: BTreeSet<Place>,
    /// Hazards of an iteration that made a value depend on one.
    hazards: BTreeMap<(u32, Problem), Operands>,
    /// Ends of ranges that widening tries, ascending.
    floats: Vec<f64>,
    integers: Vec<f64>,
}

/// Value of a place in a state; `None` for a word that the section has not written.
fn node_at(state: &State, place: Place) -> Option<&Rc<Node>> {
    match place {
        Place::Register(register) => state.registers.get(&register),
        Place::Word(word) => state.memory.get(&word),
    }
}

impl Explorer<'_> {
    /// Bundles that a loop executes abstractly if it is followed iteration by iteration, without its subroutines.
    pub(super) fn unrolled_size(&self, head: BundleAddress) -> u64 {
        let all = &self.graph.loops;
        let inner = |outer: &BTreeSet<BundleAddress>, of: &BundleAddress| {
            outer.contains(of) && all[of].body.len() < outer.len()
        };
        let turned = &all[&head];
        let nested: Vec<BundleAddress> = all.keys().copied().filter(|of| inner(&turned.body, of)).collect();
        // Loops directly inside: of no other inner loop.
        let direct = nested.iter().filter(|of| !nested.iter().any(|outer| inner(&all[outer].body, of)));
        let (mut once, mut repeated) = (turned.body.len() as u64, 0u64);
        for of in direct {
            once = once.saturating_sub(all[of].body.len() as u64);
            repeated = repeated.saturating_add(self.unrolled_size(*of));
        }
        u64::from(turned.most).saturating_mul(once.saturating_add(repeated))
    }

    /// Leaves a loop after any number of its iterations: the edges by which control may leave, with the states there.
    pub(super) fn summary(&mut self, head: BundleAddress, entry: State) -> Result<Walk, BoundError> {
        let (floats, integers) = self.thresholds();
        let mut search = Search {
            turns: Some(self.graph.loops[&head].most).filter(|most| *most != u32::MAX),
            shapes: BTreeMap::new(),
            blamed: BTreeMap::new(),
            unbounded: BTreeSet::new(),
            hazards: BTreeMap::new(),
            floats,
            integers,
            entry,
        };
        let found = self.found.clone();
        let mut state = search.entry.clone();
        for round in 0.. {
            let walk = self.iteration(head, &state)?;
            let hazards = std::mem::replace(&mut self.found, found.clone()).hazards;
            search.keep(hazards, &walk.back);
            if !self.grow(&mut search, &state, &walk.back, round) {
                break;
            }
            state = self.invariant(&search, head);
        }
        for _ in 0..NARROWED {
            let walk = self.iteration(head, &state)?;
            self.found.clone_from(&found);
            self.shrink(&mut search, &state, &walk.back);
            state = self.invariant(&search, head);
        }
        let walk = self.iteration(head, &state)?;
        for (place, operands) in search.hazards {
            self.found.hazards.entry(place).or_insert(operands);
        }
        Ok(walk)
    }

    /// Follows one iteration from the loop's head.
    fn iteration(&mut self, head: BundleAddress, state: &State) -> Result<Walk, BoundError> {
        let mut walk = Walk::new(Some((state.calls.len(), head)));
        self.join(&mut walk, head, state.clone())?;
        self.follow(walk)
    }

    /// Values at the head after one more iteration, beside those at the loop's entry; and the bound by counting steps, if there is one.
    fn next(
        &mut self,
        search: &Search,
        place: Place,
        state: &State,
        back: &[State],
    ) -> (Shape, Option<Shape>) {
        let word = |explorer: &mut Self, state: &State| match place {
            Place::Register(register) => state.registers.get(&register).cloned(),
            Place::Word(word) => Some(explorer.word_of(state, word)),
        };
        let unknown = || Node::leaf(Value::Unknown);
        let entry = word(self, &search.entry).unwrap_or_else(unknown);
        let head = word(self, state).unwrap_or_else(unknown);
        let ends: Vec<Rc<Node>> =
            back.iter().map(|state| word(self, state).unwrap_or_else(unknown)).collect();
        let first = Shape::of(&entry.value);
        let plain = ends.iter().fold(first.clone(), |all, end| all.join(&Shape::of(&end.value)));
        let counted = search.turns.and_then(|turns| counted(&entry.value, &head.value, &ends, turns));
        (plain, counted)
    }

    /// Extends the candidate by what one iteration makes of it; false if it is inductive.
    fn grow(&mut self, search: &mut Search, state: &State, back: &[State], round: u32) -> bool {
        let mut places: BTreeSet<Place> =
            search.entry.registers.keys().map(|r| Place::Register(*r)).collect();
        places.extend(back.iter().flat_map(|state| state.memory.keys().map(|word| Place::Word(*word))));
        let mut grown = false;
        for place in places {
            let known = search.shapes.get(&place).cloned();
            let head = node_at(state, place).cloned();
            let is_kept = |state: &State| match (&head, node_at(state, place)) {
                (Some(head), Some(node)) => node.narrows(head),
                (None, None) => true,
                _ => false,
            };
            if known.is_none() && back.iter().all(is_kept) {
                continue;
            }
            let (plain, counted) = self.next(search, place, state, back);
            let within = |shape: &Shape| known.as_ref().is_some_and(|known| shape.within(known));
            if within(&plain) || counted.as_ref().is_some_and(within) {
                continue;
            }
            grown = true;
            let blamed = back.iter().find_map(|state| self.blamed(node_at(state, place)?));
            search.blamed.extend(blamed.map(|word| (place, word)));
            let joined = known.map_or_else(|| plain.clone(), |known| known.join(&plain));
            let next = match (round, counted) {
                (0..JOINED, _) => Some(joined.clone()),
                (JOINED..COUNTED, Some(counted)) => Some(joined.join(&inflated(&counted))),
                (JOINED..WIDENED, _) => Some(search.widened(&joined)),
                _ => None,
            };
            match next {
                Some(shape) => {
                    if shape == Shape::Bits(Value::Broken) && plain != shape {
                        search.unbounded.insert(place);
                    }
                    search.shapes.insert(place, shape);
                }
                None => {
                    let integers = Bounds { actual: INTEGERS, exact: INTEGERS, error: Interval::ZERO };
                    let is_integer = matches!(joined, Shape::Integer(_));
                    let all = if is_integer { Shape::Integer(integers) } else { Shape::Bits(Value::Broken) };
                    search.shapes.insert(place, all);
                    search.unbounded.insert(place);
                }
            }
        }
        grown
    }

    /// Narrows the invariant to what one iteration leaves of it.
    fn shrink(&mut self, search: &mut Search, state: &State, back: &[State]) {
        for (place, shape) in search.shapes.clone() {
            let (plain, counted) = self.next(search, place, state, back);
            let smaller = if plain.within(&shape) { plain } else { shape.meet(&plain) };
            let smaller = counted.map_or(smaller.clone(), |counted| smaller.meet(&counted));
            search.shapes.insert(place, smaller);
        }
    }

    /// Operation that most of a value's error comes from.
    fn blamed(&self, node: &Rc<Node>) -> Option<u32> {
        let Value::Float(number) = &node.value else { return None };
        number.error.main_symbol().and_then(|symbol| self.symbols[symbol as usize])
    }

    /// State at the head of every iteration.
    fn invariant(&mut self, search: &Search, head: BundleAddress) -> State {
        let mut state = search.entry.clone();
        for (place, shape) in &search.shapes {
            let value = match shape {
                Shape::Bits(value) => value.clone(),
                Shape::Float(bounds) => {
                    let number = self.number(bounds, search.blamed.get(place).copied());
                    Value::Float(Rc::new(number))
                }
                Shape::Integer(bounds) => {
                    let mut number = self.number(bounds, None);
                    number.grid = Some(0);
                    Value::Integer(Rc::new(number))
                }
            };
            let is_unbounded = value == Value::Broken && search.unbounded.contains(place);
            match *place {
                Place::Register(register) => {
                    if is_unbounded {
                        self.list_unbounded(head, register);
                    }
                    state.registers.insert(register, Node::leaf(value));
                }
                Place::Word(array) => {
                    if is_unbounded {
                        let word = self.word(head, SlotIndex::FIRST);
                        self.found.hazards.entry((word, Problem::Unbounded)).or_default();
                    }
                    state.memory.insert(array, Node::leaf(value));
                }
            }
        }
        state
    }

    /// Lists a register that a loop may change without limit.
    fn list_unbounded(&mut self, head: BundleAddress, register: Register) {
        let word = self.word(head, SlotIndex::FIRST);
        self.found.hazards.entry((word, Problem::Unbounded)).or_default().push((register, None));
    }

    fn number(&mut self, bounds: &Bounds, blamed: Option<u32>) -> Number {
        let Bounds { actual, exact, error } = *bounds;
        let form = Affine::of(exact, self.symbol(None));
        let error = match error == Interval::ZERO {
            true => Affine::constant(0.0),
            false => Affine::of(error, self.symbol(blamed)),
        };
        Number { actual, exact, form, error, grid: None, relative: None }
    }

    /// Ends of ranges that widening tries: the program's constants and ranges, and powers of four.
    fn thresholds(&self) -> (Vec<f64>, Vec<f64>) {
        let constants = || self.fixed.values().copied();
        let ends = self.program.ranges.iter().flat_map(|range| <[f64; 2]>::from(range.ends()));
        let ends =
            ends.chain(self.program.array_ranges.iter().flat_map(|range| <[f64; 2]>::from(range.ends())));
        let ends: Vec<f64> = ends.collect();
        let powers = || (-40..63).map(|power| 4f64.powi(power));
        let floats = constants().map(|bits| f64::from(f32::from_bits(bits)));
        let integers = constants().map(|bits| f64::from(bits.cast_signed()));
        let symmetric = |values: &mut dyn Iterator<Item = f64>, most: f64| {
            let mut all: Vec<f64> =
                values.filter(|value| value.is_finite()).flat_map(|value| [value, -value]).collect();
            all.extend([0.0, most, -most]);
            all.retain(|value| value.abs() <= most);
            all.sort_by(f64::total_cmp);
            all
        };
        let whole = |value: &f64| value.fract() == 0.0;
        (
            symmetric(&mut floats.chain(ends.iter().copied()).chain(powers()), LARGEST),
            symmetric(&mut integers.chain(ends.iter().copied()).chain(powers()).filter(whole), -INTEGERS.low),
        )
    }
}

/// Bound of a value by the number of iterations: its first value, and at most as many steps as the loop has iterations after the first.
fn counted(entry: &Value, head: &Value, ends: &[Rc<Node>], turns: u32) -> Option<Shape> {
    let times = Interval::new(0.0, f64::from(turns.saturating_sub(1)));
    let is_float = |value: &Value| matches!(value, Value::Float(_));
    let float = is_float(head) || ends.iter().any(|end| is_float(&end.value));
    let number = |value: &Value| match (float, value) {
        (true, Value::Float(_) | Value::Patterns(_)) => value.float().ok(),
        (false, Value::Integer(_) | Value::Patterns(_)) => Some(value.whole()),
        _ => None,
    };
    let (first, from) = (number(entry)?, number(head)?);
    let (mut exact, mut error) = (Interval::ZERO, Interval::ZERO);
    for end in ends {
        let to = number(&end.value)?;
        exact = exact.hull(to.form.sub(&from.form).range());
        error = error.hull(to.error.sub(&from.error).range());
    }
    let exact = first.exact + times * exact;
    let error = first.error_range() + times * error;
    let bounds = Bounds { actual: first.actual.hull(exact + error), exact, error };
    if !float {
        return bounds.actual.within(INTEGERS).then_some(Shape::Integer(bounds));
    }
    bounds.is_finite().then_some(Shape::Float(bounds))
}

/// Shape a little larger, so that steps that grow with the value soon fit.
fn inflated(shape: &Shape) -> Shape {
    let Shape::Float(bounds) = shape else { return shape.clone() };
    let wider =
        |range: Interval| if range == Interval::ZERO { range } else { range.widened(range.radius() / 64.0) };
    let Bounds { actual, exact, error } = *bounds;
    Shape::Float(Bounds { actual: wider(actual), exact: wider(exact), error: wider(error) })
}

impl Search {
    /// Keeps the hazards of an iteration that made a value depend on one: later iterations begin with that value, and list nothing.
    fn keep(&mut self, hazards: BTreeMap<(u32, Problem), Operands>, back: &[State]) {
        let is_broken = |(place, node): (Place, &Rc<Node>)| {
            node.value == Value::Broken && self.shapes.get(&place) != Some(&Shape::Bits(Value::Broken))
        };
        let registers = |state: &'_ State| {
            state.registers.iter().any(|(register, node)| is_broken((Place::Register(*register), node)))
        };
        let words =
            |state: &'_ State| state.memory.iter().any(|(word, node)| is_broken((Place::Word(*word), node)));
        if back.iter().any(|state| registers(state) || words(state)) {
            self.hazards.extend(hazards);
        }
    }

    /// Ranges widened to the next thresholds. An error that widening does not end is as wide as the ranges.
    fn widened(&self, shape: &Shape) -> Shape {
        let next = |range: Interval, all: &[f64]| {
            let low = all.iter().rev().find(|end| **end <= range.low).copied();
            let high = all.iter().find(|end| **end >= range.high).copied();
            Interval::new(low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY))
        };
        match shape {
            Shape::Bits(_) => shape.clone(),
            Shape::Float(Bounds { actual, exact, error }) => {
                let (actual, exact) = (next(*actual, &self.floats), next(*exact, &self.floats));
                let error = if *error == Interval::ZERO { *error } else { next(*error, &self.floats) };
                let bounds = Bounds { actual, exact, error: error.meet(actual - exact) };
                if bounds.is_finite() { Shape::Float(bounds) } else { Shape::Bits(Value::Broken) }
            }
            Shape::Integer(Bounds { actual, .. }) => {
                let range = next(*actual, &self.integers).meet(INTEGERS);
                Shape::Integer(Bounds { actual: range, exact: range, error: Interval::ZERO })
            }
        }
    }
}
