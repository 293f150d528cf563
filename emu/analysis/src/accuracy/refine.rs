// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values under assumptions: operations are evaluated again where a condition of a branch or a selection narrows their operands, and
//! results are evaluated case by case.

use super::affine::Affine;
use super::assume::{Context, Impossible, View, both};
use super::enclose::Explorer;
use super::interval::Interval;
use super::is_rounder;
use super::node::{Made, Meaning, Node};
use super::number::{Number, SIGN};
use super::relative::Relative;
use super::value::Value;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::rc::Rc;
use takt_isa::fp::Bitwise;

/// Limit on selections whose conditions are assumed within each other.
pub(super) const MAX_NESTED: u32 = 3;
/// Limit on the cases that are distinguished for a result, as a power of two.
const MAX_CASES: u32 = 6;
/// Limit on the divisions of a range.
const MAX_DIVISIONS: u32 = 128;
/// Limit on the constraints that assumptions leave for later values.
const MAX_CONSTRAINTS: usize = 16;
/// Limit on the operations of a function whose argument's range is divided.
const MAX_BETWEEN: usize = 512;
/// Factor by which parts must narrow a value or an error to replace terms that are correlated with other values; and the same where the value
/// is stored, as the result of a function.
const WORTH: f64 = 4.0;
const WORTH_STORED: f64 = 1.25;
/// Limit on the operations that are evaluated again for the cases of one result.
const MAX_AGAIN: usize = 1 << 14;

/// Assumptions with the nodes that were evaluated under them.
pub(super) struct Scene {
    context: Context,
    /// Confined symbols: middle, radius, and the symbol that replaces each.
    replaced: BTreeMap<u32, (f64, f64, u32)>,
    /// Nodes by address, each with its replacement under the assumptions.
    nodes: HashMap<*const Node, (Rc<Node>, Rc<Node>)>,
}

impl Scene {
    /// A form in the symbols of the scene.
    fn form(&self, form: &Affine) -> Affine {
        form.replaced(&self.replaced).unwrap_or_else(|| form.clone())
    }

    /// Forms that are not positive under the assumptions.
    fn constraints(&self) -> Vec<Affine> {
        self.context.constraints.iter().map(|constraint| self.form(constraint)).collect()
    }

    /// Adds the scene's constraints to those that hold already.
    pub(super) fn add_to(&self, known: &mut Vec<Affine>) {
        *known = known.iter().map(|constraint| self.form(constraint)).chain(self.constraints()).collect();
        known.truncate(MAX_CONSTRAINTS);
    }
}

/// Node whose range constraints narrow.
pub(super) fn constrained(node: Rc<Node>, constraints: &[Affine]) -> Rc<Node> {
    if constraints.is_empty() {
        return node;
    }
    let value = tightened(&node.value, constraints);
    if value == node.value { node } else { node.narrowed(value, node.made.clone()) }
}

/// Value that depends on one other value and on constants.
struct Function {
    argument: Rc<Node>,
    result: Rc<Node>,
}

/// Copies of the operations between a value and a result, being made.
struct Copies {
    /// Address of the value, and the node that stands for it.
    argument: (*const Node, Rc<Node>),
    /// Copies so far by the address of the original, with their numbers in the key.
    made: HashMap<*const Node, (Rc<Node>, u64)>,
    key: Vec<u64>,
}

impl Copies {
    /// Copy of a node. Its key lists operations in the order of a walk back to the argument, constants, and ranges of floats.
    fn of(&mut self, node: &Rc<Node>) -> Rc<Node> {
        if Rc::as_ptr(node) == self.argument.0 {
            self.key.push(u64::MAX);
            return Rc::clone(&self.argument.1);
        }
        if let Some((copy, number)) = self.made.get(&Rc::as_ptr(node)) {
            self.key.push(u64::MAX - 1 - number);
            return Rc::clone(copy);
        }
        let Some(made) = &node.made else {
            // `waist` leaves constants only.
            let bits = match &node.value {
                Value::Patterns(patterns) => patterns.first().copied().unwrap_or(0),
                Value::Float(number) => (number.actual.low as f32).to_bits(),
                _ => 0,
            };
            self.key.push(1 << 40 | u64::from(bits));
            return Rc::clone(node);
        };
        self.key.push(2 << 40 | u64::from(made.word));
        let operands = [0, 1, 2].map(|place: usize| self.of(&made.operands[place]));
        let value = match &node.value {
            Value::Float(number) => {
                self.describe(number);
                Value::Float(Rc::new(number.without_correlations()))
            }
            _ => Value::Any,
        };
        let copy = Node::new(value, Made { operands, ..made.clone() });
        self.made.insert(Rc::as_ptr(node), (Rc::clone(&copy), self.made.len() as u64));
        copy
    }

    /// Adds all of a number but its correlations to the key.
    fn describe(&mut self, number: &Number) {
        for range in [number.actual, number.exact, number.error_range()] {
            self.key.extend([range.low.to_bits(), range.high.to_bits()]);
        }
        let Relative { share, rest } = number.relative.unwrap_or(Relative { share: -1.0, rest: -1.0 });
        self.key.extend([share.to_bits(), rest.to_bits(), number.grid.map_or(u64::MAX, |grid| grid as u64)]);
    }
}

/// Question whose answers divide the runs into cases.
#[derive(Clone)]
enum Case {
    /// The condition holds or not.
    Condition(Rc<Node>),
    /// The value lies below the number or above.
    Cut(Rc<Node>, f64),
}

impl Explorer<'_> {
    /// Scene of assumptions; `None` if no run makes them.
    pub(super) fn scene(
        &mut self,
        assume: impl FnOnce(&mut Context) -> Result<(), Impossible>,
    ) -> Option<Scene> {
        let mut context = Context::default();
        assume(&mut context).and_then(|()| context.confine()).ok()?;
        let mut replaced = BTreeMap::new();
        for (symbol, range) in &context.confined {
            let new = self.symbol(self.symbols[*symbol as usize]);
            replaced.insert(*symbol, (range.middle(), range.radius(), new));
        }
        Some(Scene { context, replaced, nodes: HashMap::new() })
    }

    /// Node under the assumptions of a scene.
    pub(super) fn under(&mut self, node: &Rc<Node>, scene: &mut Scene) -> Rc<Node> {
        if scene.context.is_empty() {
            return Rc::clone(node);
        }
        let key = Rc::as_ptr(node);
        if let Some((_, known)) = scene.nodes.get(&key) {
            return Rc::clone(known);
        }
        let operands = node
            .made
            .as_ref()
            .map(|made| [0, 1, 2].map(|place: usize| self.under(&made.operands[place], scene)));
        let moved = node.made.as_ref().zip(operands).filter(|(made, operands)| {
            made.operands.iter().zip(operands).any(|(old, new)| !Rc::ptr_eq(old, new))
        });
        let known = scene.context.current(node);
        let narrowed = *known != node.value;
        let replaced = replaced(known, &scene.replaced);
        let value = replaced.clone().unwrap_or_else(|| known.clone());
        let result = match moved {
            Some((made, operands)) => {
                let made = Made { operands, ..made.clone() };
                let again = self.quietly(|explorer| explorer.apply(&made));
                Node::narrowed(node, both(&value, again.value.clone()), again.made.clone())
            }
            None if narrowed || replaced.is_some() => Node::narrowed(node, value, node.made.clone()),
            None => Rc::clone(node),
        };
        scene.nodes.insert(key, (Rc::clone(node), Rc::clone(&result)));
        result
    }

    /// Evaluates without listing hazards or counting.
    fn quietly<T>(&mut self, evaluate: impl FnOnce(&mut Self) -> T) -> T {
        self.quiet += 1;
        let operations = self.found.operations;
        let result = evaluate(self);
        self.found.operations = operations;
        self.quiet -= 1;
        result
    }

    /// Selection by a condition that is not decided: each operand under the condition that takes it.
    pub(super) fn selected(&mut self, condition: &Rc<Node>, yes: &Rc<Node>, no: &Rc<Node>) -> Option<Value> {
        if self.nested >= MAX_NESTED {
            return None;
        }
        self.nested += 1;
        let mut joined: Option<Value> = None;
        for (taken, holds) in [(yes, true), (no, false)] {
            if let Some(mut scene) = self.scene(|context| context.decide(condition, holds)) {
                let node = self.under(taken, &mut scene);
                let value = tightened(&node.value, &scene.constraints());
                joined = Some(joined.map_or_else(|| value.clone(), |known| known.join(&value)));
            }
        }
        self.nested -= 1;
        joined
    }

    /// Value of a node, from the cases of the selections and limits that it depends on.
    pub(super) fn by_cases(&mut self, node: &Rc<Node>) -> Value {
        let mut seen = HashSet::new();
        let mut questions = Vec::new();
        cases(node, &mut seen, &mut questions);
        let most = (MAX_AGAIN / seen.len().max(1)).max(1).ilog2().min(MAX_CASES);
        if questions.is_empty() || most == 0 {
            return node.value.clone();
        }
        let split = self.quietly(|explorer| explorer.split(node, most));
        split.map_or_else(|| node.value.clone(), |value| both(&node.value, value))
    }

    /// Value of a node by dividing the range of the last value on which all of it depends: parts in which the result is largest, or errs
    /// most, are divided further.
    pub(super) fn in_parts(&mut self, node: &Rc<Node>) -> Value {
        self.in_parts_worth(node, WORTH)
    }

    fn in_parts_worth(&mut self, node: &Rc<Node>, worth: f64) -> Value {
        let Some(waist) = waist(node) else { return node.value.clone() };
        let Some((function, key)) = self.function(node, &waist) else { return node.value.clone() };
        let known = match self.divided.get(&key) {
            Some(known) => known.clone(),
            None => {
                let value = self.of_parts(&function);
                self.divided.insert(key, value.clone());
                value
            }
        };
        let (Some(parts), Some(made)) = (known, &node.made) else { return node.value.clone() };
        let mut number = Number::clone(&parts);
        let mut terms = Affine::constant(0.0);
        if let Value::Float(whole) = &node.value {
            // Narrower ranges cost the correlations: a small gain is not worth it.
            if whole.form.radius() < worth * parts.form.radius() {
                number.form = whole.form.clone();
            }
            terms = whole.error.clone();
        }
        if matches!(node.value, Value::Float(_)) && terms.radius() < worth * parts.error.radius() {
            number.error = terms;
        } else if !parts.error.is_zero() {
            number.error = Affine::of(parts.error.range(), self.symbol_of(&terms, made.word));
        }
        both(&node.value, Value::Float(Rc::new(number)))
    }

    /// Node of a value that is stored: if it is a function of one value, with selections or limits, from parts of that value's range. So
    /// are elements of vectors that an activation was applied to.
    pub(super) fn settled(&mut self, node: &Rc<Node>) -> Rc<Node> {
        let Some(made) = node.made.as_ref().filter(|_| self.quiet == 0 && !self.plain) else {
            return Rc::clone(node);
        };
        let word = made.word;
        let is_open = waist(node).is_some_and(|waist| {
            let (mut seen, mut questions) = (HashSet::from([Rc::as_ptr(&waist)]), Vec::new());
            cases(node, &mut seen, &mut questions);
            !questions.is_empty()
        });
        let value = if is_open { self.in_parts_worth(node, WORTH_STORED) } else { node.value.clone() };
        if value == node.value {
            return Rc::clone(node);
        }
        let value = self.own(word, value);
        Node::new(value, made.clone())
    }

    /// A node as a function of one value: a copy of the operations between them, and a key that is the same for all copies with the same
    /// operations, constants and ranges. Nothing else is in the copy: no correlation with other values.
    fn function(&mut self, node: &Rc<Node>, waist: &Rc<Node>) -> Option<(Function, Vec<u64>)> {
        let number = waist.value.float().ok()?;
        let error = number.error_range();
        let symbols = [self.symbol(None), self.symbol(None)];
        let argument = Node::leaf(Value::Float(Rc::new(Number {
            form: Affine::of(number.exact, symbols[0]),
            error: if number.error.is_zero() { number.error.clone() } else { Affine::of(error, symbols[1]) },
            ..Number::clone(&number)
        })));
        let mut copies = Copies {
            argument: (Rc::as_ptr(waist), Rc::clone(&argument)),
            made: HashMap::new(),
            key: Vec::new(),
        };
        copies.describe(&number);
        let result = copies.of(node);
        Some((Function { argument, result }, copies.key))
    }

    /// Value of a function, from parts of its argument's range; `None` if some part has none.
    fn of_parts(&mut self, function: &Function) -> Option<Rc<Number>> {
        let Function { argument, result } = function;
        let whole = argument.value.float().ok()?.actual;
        let mut parts: Vec<(Interval, Option<Rc<Number>>)> = vec![(whole, result.value.float().ok())];
        for turn in 0..MAX_DIVISIONS {
            // A part without a bound comes first.
            let size = |(_, number): &(Interval, Option<Rc<Number>>)| match number {
                None => f64::INFINITY,
                Some(number) if turn % 2 == 0 => number.actual.magnitude(),
                Some(number) => number.error_range().magnitude(),
            };
            let divisible = parts.iter().enumerate().filter(|(_, (range, _))| middle(*range).is_some());
            let Some((at, _)) = divisible.max_by(|(_, a), (_, b)| size(a).total_cmp(&size(b))) else { break };
            let (range, _) = parts.swap_remove(at);
            let Some(middle) = middle(range) else { break };
            for part in [Interval::new(range.low, middle), Interval::new(middle, range.high)] {
                let Some(mut scene) = self.scene(|context| context.pin(argument, part)) else { continue };
                self.parts = self.parts.saturating_sub(1);
                let under = self.quietly(|explorer| explorer.under(result, &mut scene));
                parts.push((part, under.value.float().ok()));
            }
            if self.parts == 0 {
                break;
            }
        }
        let numbers = parts.into_iter().map(|(_, number)| number).collect::<Option<Vec<_>>>()?;
        let joined = numbers.into_iter().reduce(|all, number| Rc::new(all.join(&number)))?;
        Some(Rc::new(joined.without_correlations()))
    }

    /// Joins the values of all cases; `None` if no case is possible.
    fn split(&mut self, node: &Rc<Node>, most: u32) -> Option<Value> {
        let mut questions = Vec::new();
        cases(node, &mut HashSet::new(), &mut questions);
        let Some(question) = questions.first().filter(|_| most > 0) else { return Some(node.value.clone()) };
        let mut joined: Option<Value> = None;
        for answer in [false, true] {
            let scene = self.scene(|context| match question {
                Case::Condition(node) => context.decide(node, answer),
                Case::Cut(node, at) if answer => {
                    context.narrow(node, Interval::new(*at, f64::INFINITY), View::Float)
                }
                Case::Cut(node, at) => {
                    context.narrow(node, Interval::new(f64::NEG_INFINITY, *at), View::Float)
                }
            });
            let Some(mut scene) = scene else { continue };
            let under = self.under(node, &mut scene);
            // Without progress, another question would be no better.
            if Rc::ptr_eq(&under, node) {
                return Some(node.value.clone());
            }
            let Some(value) = self.split(&under, most - 1) else { continue };
            let value = tightened(&value, &scene.constraints());
            joined = Some(joined.map_or_else(|| value.clone(), |known| known.join(&value)));
        }
        joined
    }
}

/// Nearest value that all other dependences of a node pass through; `None` without one, if it is an operand that is used once, or behind more
/// than [`MAX_BETWEEN`] operations.
fn waist(node: &Rc<Node>) -> Option<Rc<Node>> {
    let mut open = BTreeMap::from([((node.depth(), Rc::as_ptr(node)), Rc::clone(node))]);
    let mut steps = 0;
    while let Some((_, next)) = open.pop_last() {
        if steps > 1 && open.is_empty() {
            return Some(next);
        }
        steps += 1;
        if steps > MAX_BETWEEN {
            return None;
        }
        for operand in &next.made.as_ref()?.operands {
            if !is_constant(operand) {
                open.insert((operand.depth(), Rc::as_ptr(operand)), Rc::clone(operand));
            }
        }
    }
    None
}

/// The node is a constant.
fn is_constant(node: &Rc<Node>) -> bool {
    match &node.value {
        Value::Patterns(patterns) => patterns.len() == 1,
        // A constant that stands for a real number.
        Value::Float(number) => node.made.is_none() && number.actual.low == number.actual.high,
        _ => false,
    }
}

/// Point that divides a range: zero, or in the middle of the exponents, or of the numbers.
pub(super) fn middle(range: Interval) -> Option<f64> {
    let Interval { low, high } = range;
    let size = |low: f64, high: f64| {
        if low < high / 16.0 { (low * high).sqrt().max(high / 256.0) } else { low / 2.0 + high / 2.0 }
    };
    let middle = if low < 0.0 && high > 0.0 {
        0.0
    } else if low >= 0.0 {
        size(low, high)
    } else {
        -size(-high, -low)
    };
    let middle = f64::from(middle as f32);
    (low < middle && middle < high).then_some(middle)
}

/// Open questions in a node's history, the nearest first.
fn cases(node: &Rc<Node>, seen: &mut HashSet<*const Node>, questions: &mut Vec<Case>) {
    let mut next = vec![Rc::clone(node)];
    let mut asked = HashSet::new();
    while !next.is_empty() {
        let mut behind = Vec::new();
        for node in next {
            if !seen.insert(Rc::as_ptr(&node)) {
                continue;
            }
            let Some(made) = &node.made else { continue };
            for case in Meaning::of(&made.instruction).iter().flat_map(|meaning| questions_of(meaning, made))
            {
                let key = match &case {
                    Case::Condition(node) => (Rc::as_ptr(node), 0),
                    Case::Cut(node, at) => (Rc::as_ptr(node), at.to_bits()),
                };
                if asked.insert(key) {
                    questions.push(case);
                }
            }
            behind.extend(made.operands.iter().cloned());
        }
        next = behind;
    }
}

/// Questions that an operation leaves open.
fn questions_of(meaning: &Meaning, made: &Made) -> Vec<Case> {
    let node = |meaning: &Meaning| match meaning {
        Meaning::Source(place) => Some(&made.operands[*place]),
        _ => None,
    };
    let range = |node: &Rc<Node>| node.value.float().ok().map(|number| number.actual);
    // A constant limit divides the range of the operand.
    let cut = |node: &Rc<Node>, at: f64| {
        let open = range(node).is_some_and(|range| range.low < at && at < range.high);
        open.then(|| Case::Cut(Rc::clone(node), at))
    };
    let limit = |a: &Meaning, b: &Meaning| {
        let (a, b) = (node(a)?, node(b)?);
        let limit = range(b).filter(|range| range.low == range.high)?;
        Some((Rc::clone(a), limit.low))
    };
    match meaning {
        Meaning::Choose(of) => match node(&of[0]) {
            Some(condition) if condition.value.tested() == (true, true) => {
                vec![Case::Condition(Rc::clone(condition))]
            }
            _ => Vec::new(),
        },
        Meaning::Minimum(of) | Meaning::Maximum(of) => {
            let limits = [limit(&of[0], &of[1]), limit(&of[1], &of[0])].into_iter().flatten();
            limits.filter_map(|(node, at)| cut(&node, at)).collect()
        }
        Meaning::Saturate(of) => {
            let limits = limit(&of[0], &of[1]).into_iter();
            limits.flat_map(|(node, at)| [at, -at].map(|at| cut(&node, at))).flatten().collect()
        }
        // Rounding to an integer by a sum: between two integers, if the operand is near no others.
        Meaning::Add(of) => {
            let is_rounder = |meaning: &Meaning| {
                let range = node(meaning).and_then(range);
                range.is_some_and(|range| range.low == range.high && is_rounder((range.low as f32).to_bits()))
            };
            let rounded = if is_rounder(&of[1]) { &of[0] } else { &of[1] };
            let Some(node) = node(rounded).filter(|_| is_rounder(&of[0]) != is_rounder(&of[1])) else {
                return Vec::new();
            };
            let between = range(node).map(|range| (range.low.round() + 0.5, range.high - range.low));
            let near = between.filter(|(_, width)| *width <= 2.0);
            near.into_iter()
                .flat_map(|(at, _)| [at - 1.0, at, at + 1.0])
                .filter_map(|at| cut(node, at))
                .collect()
        }
        Meaning::Abs(of) => node(of).and_then(|node| cut(node, 0.0)).into_iter().collect(),
        Meaning::Bitwise(Bitwise::And, of) => {
            let (Some(a), Some(b)) = (node(&of[0]), node(&of[1])) else { return Vec::new() };
            let sign = |mask: &Rc<Node>| [SIGN, !SIGN].map(Value::bits).contains(&mask.value);
            let of = [(a, b), (b, a)].into_iter().find(|(_, mask)| sign(mask));
            of.and_then(|(node, _)| cut(node, 0.0)).into_iter().collect()
        }
        _ => Vec::new(),
    }
}

/// Value with confined symbols replaced, if it has any.
fn replaced(value: &Value, by: &BTreeMap<u32, (f64, f64, u32)>) -> Option<Value> {
    if by.is_empty() {
        return None;
    }
    let of = |number: &Rc<Number>| {
        let (form, error) = (number.form.replaced(by), number.error.replaced(by));
        if form.is_none() && error.is_none() {
            return None;
        }
        let form = form.unwrap_or_else(|| number.form.clone());
        let error = error.unwrap_or_else(|| number.error.clone());
        let exact = number.exact.meet(form.range());
        let actual = if error.is_zero() {
            number.actual.meet(exact)
        } else {
            number.actual.meet(exact + error.range())
        };
        let exact = if error.is_zero() { actual } else { exact.meet(actual - error.range()) };
        Some(Rc::new(Number { actual, exact, form, error, ..Number::clone(number) }))
    };
    match value {
        Value::Float(number) => of(number).map(Value::Float),
        Value::Integer(number) => of(number).map(Value::Integer),
        _ => None,
    }
}

/// Value with ranges that constraints narrow: for a form `f` and a constraint `g` ≤ 0, f ≤ f - λ·g for each λ ≥ 0.
fn tightened(value: &Value, constraints: &[Affine]) -> Value {
    let Value::Float(number) = value else { return value.clone() };
    let (mut exact, mut error) = (number.exact, number.error_range());
    for constraint in constraints {
        exact = exact.meet(lagrange(&number.form, constraint));
        error = error.meet(lagrange(&number.error, constraint));
    }
    let actual = number.actual.meet(exact + error);
    let exact = if number.error.is_zero() { exact.meet(actual) } else { exact };
    if actual == number.actual && exact == number.exact {
        return value.clone();
    }
    Value::Float(Rc::new(Number { actual, exact, ..Number::clone(number) }))
}

/// Range of a form where a constraint is not positive.
pub(super) fn lagrange(form: &Affine, constraint: &Affine) -> Interval {
    let mut range = form.range();
    // The best multipliers are those that remove a symbol.
    for (symbol, by) in constraint.terms() {
        let of = form.coefficient(symbol);
        if of == 0.0 {
            continue;
        }
        let factor = of / by;
        let left = Affine::combine(form, 1.0, constraint, -factor).range();
        if factor > 0.0 {
            range.high = range.high.min(left.high)
        } else {
            range.low = range.low.max(left.low)
        }
    }
    range
}
