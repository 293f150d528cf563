// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operations on abstract values: results, their rounding, hazards.

use super::affine::Affine;
use super::assume::View;
use super::bits;
use super::enclose::Explorer;
use super::interval::Interval;
use super::node::{Made, Meaning, Node};
use super::number::{Number, Problem, float_grid};
use super::operand::Operand;
use super::refine::MAX_NESTED;
use super::relation::{self, Limit};
use super::relative::Relative;
use super::rounding::{self, is_power};
use super::value::{MAX_PATTERNS, Value};
use super::{LARGEST_ROUNDED, ROUNDERS, is_rounder};
use std::cell::Cell;
use std::rc::Rc;
use takt_isa::fp::{Flags, Host};
use takt_isa::{Instruction, Register, Type, compute, real};

/// Factor by which a relation must narrow an error, or a range, to replace terms that are correlated with other values.
const WORTH: f64 = 1.25;
/// The same for an operand's error within a limit.
const WORTH_TERMS: f64 = 4.0;

impl Explorer<'_> {
    /// Result of an operation. A copy, a decided selection and a limit that is not reached return the operand's node, since they are the
    /// same number.
    pub(super) fn apply(&mut self, made: &Made) -> Rc<Node> {
        let Made { word, instruction, operands } = made;
        let meaning = Meaning::of(instruction);
        if self.plain && !matches!(meaning, Some(Meaning::Source(_))) {
            let values = operands.each_ref().map(|operand| operand.value.clone());
            let (value, _) = self.compute(*word, instruction, &values);
            return Node::new(value, made.clone());
        }
        match &meaning {
            Some(Meaning::Source(place)) => return Rc::clone(&operands[*place]),
            Some(Meaning::Choose(of)) => {
                let [Meaning::Source(condition), Meaning::Source(yes), Meaning::Source(no)] = **of else {
                    return Node::leaf(Value::Any);
                };
                let [condition, yes, no] = [condition, yes, no].map(|place| &operands[place]);
                match condition.value.tested() {
                    (false, _) => return Rc::clone(yes),
                    (_, false) => return Rc::clone(no),
                    _ => {}
                }
                if let Some(value) = self.selected(condition, yes, no) {
                    let value = self.own(*word, value);
                    return Node::new(value, made.clone());
                }
            }
            Some(Meaning::Minimum(of) | Meaning::Maximum(of)) => {
                let least = matches!(meaning, Some(Meaning::Minimum(_)));
                if let [Meaning::Source(a), Meaning::Source(b)] = **of
                    && let Some(taken) = passed(&operands[a], &operands[b], least)
                {
                    return taken;
                }
            }
            _ => {}
        }
        let values = operands.each_ref().map(|operand| operand.value.clone());
        let (mut value, mut problem) = self.compute(*word, instruction, &values);
        let limit = meaning.as_ref().and_then(|meaning| relation::limit(meaning, operands));
        // A rotation's coordinates may be too large for binary32 themselves.
        let is_number = |limit: &Limit| limit.magnitude <= f64::from(f32::MAX);
        let limit = limit.filter(|_| matches!(problem, None | Some(Problem::Overflow))).filter(is_number);
        if let Some(limit) = limit {
            (value, problem) = (self.limited(*word, &value, &limit), None);
        }
        if let Some(range) = meaning.as_ref().and_then(|meaning| relation::open(meaning, operands)) {
            value = self.clamped(*word, value, range);
        }
        let broken = value == Value::Broken;
        let mut node = Node::new(value, made.clone());
        if self.quiet == 0 && meaning.as_ref().is_some_and(|meaning| relation::is_steep(meaning, operands)) {
            let value = self.in_parts(&node);
            if value != node.value {
                node = Node::new(self.own(*word, value), made.clone());
            }
        }
        // Functions that take floats apart rely on wrapping sums and on the low bits of shift amounts.
        let is_intended = node.is_of_bits() && matches!(problem, Some(Problem::Wrap | Problem::Shift));
        let is_listed = |problem: &Problem| *problem != Problem::Told && !is_intended;
        let Some(problem) = problem.filter(is_listed).filter(|_| self.quiet == 0) else { return node };
        // Case distinctions in the operands' histories may exclude the hazard.
        if broken {
            let value = self.by_cases(&node);
            if !matches!(value, Value::Broken | Value::Any | Value::Unknown) {
                let value = self.own(*word, value);
                return Node::new(value, made.clone());
            }
        }
        let row = instruction.op.row();
        let range = |place: usize, value: &Value| match row.source_type(place) {
            Type::I => Some(value.whole().actual),
            Type::F | Type::B => value.float().ok().map(|number| number.actual),
        };
        let reads = instruction.reads().iter().zip(&values).enumerate();
        let reads = reads.map(|(place, (register, operand))| (*register, range(place, operand)));
        self.found.hazards.entry((*word, problem)).or_insert(reads.collect());
        node
    }

    /// Value that a relation of its operands limits, in the run and exactly.
    fn limited(&mut self, word: u32, value: &Value, limit: &Limit) -> Value {
        let range = Interval::new(-limit.magnitude, limit.magnitude);
        let Value::Float(number) = value else {
            // Two members of a symmetric range differ by at most twice its end.
            let most = Interval::new(-limit.error, limit.error);
            let error = Affine::of((range + range).meet(most), self.symbol(Some(word)));
            let form = Affine::of(range, self.symbol(None));
            let number = Number { actual: range, exact: range, form, error, grid: None, relative: None };
            return Value::Float(Rc::new(number));
        };
        let (actual, exact) = (number.actual.meet(range), number.exact.meet(range));
        let errs = WORTH * limit.error < number.error_range().magnitude();
        if actual == number.actual && exact == number.exact && !errs {
            return value.clone();
        }
        let mut number = Number { actual, exact, ..Number::clone(number) };
        if errs {
            let symbol = self.symbol_of(&number.error, word);
            number.error = Affine::of(Interval::new(-limit.error, limit.error), symbol);
        }
        if number.form.radius() > WORTH * exact.radius() {
            number.form = Affine::of(exact, self.symbol(None));
        }
        Value::Float(Rc::new(number.capped(|error| self.symbol_of(error, word))))
    }

    /// Result of a limit by a constant: its error is at most that of the operand where the limit does not give the result, in the run or
    /// exactly.
    fn clamped(&mut self, word: u32, value: Value, (operand, open): (Rc<Node>, Interval)) -> Value {
        let (Value::Float(number), Ok(inside)) = (&value, operand.value.float()) else { return value };
        let error = number.error_range().magnitude();
        let near = open.widened(inside.error_range().magnitude());
        if error == 0.0 || inside.actual.within(near) || self.nested >= MAX_NESTED {
            return value;
        }
        self.nested += 1;
        let scene = self.scene(|context| context.narrow(&operand, near, View::Float));
        let under = scene.map(|mut scene| self.under(&operand, &mut scene));
        self.nested -= 1;
        // Without a scene, the limit gives the result in every run.
        let left = match under.map(|node| node.value.float()) {
            Some(Ok(inside)) => inside.error_range().hull(Interval::ZERO),
            Some(Err(_)) => return value,
            None => Interval::ZERO,
        };
        if WORTH_TERMS * left.magnitude() >= error {
            return value;
        }
        let error = Affine::of(left, self.symbol_of(&number.error, word));
        let number = Number { error, relative: None, ..Number::clone(number) };
        Value::Float(Rc::new(number.capped(|error| self.symbol_of(error, word))))
    }

    /// Abstract result, and the hazard in its computation.
    fn compute(
        &mut self,
        word: u32,
        instruction: &Instruction,
        operands: &[Value; 3],
    ) -> (Value, Option<Problem>) {
        let (op, row) = (instruction.op, instruction.op.row());
        let sources = row.shape.sources();
        let integer = row.result_type() == Type::I;
        let hazard = bits::hazard(instruction, operands);
        if row.ulp.is_none() || integer {
            let raises = Cell::new(false);
            let known = patterns(operands, sources, |a, b, c| {
                let value = compute::<Host>(op, a, b, c);
                raises.set(raises.get() || value.flags != Flags::NONE);
                value.bits
            });
            if let Some(value) = known.filter(|_| !raises.get()) {
                return (value, hazard);
            }
        }
        let operand = |i: usize| Operand::of(operands[i].clone());
        let Some(result) = real(op, operand(0), operand(1), operand(2)) else { return (Value::Any, None) };
        let Operand { value, mut problem, terms } = result;
        let value = match value {
            value if problem.is_some() || row.result_type() != Type::F => value,
            Value::Whole(_) | Value::Float(_) => {
                let rounded =
                    value.float().and_then(|number| self.round(word, instruction, &number, terms, operands));
                rounded.unwrap_or_else(|overflow| {
                    problem = Some(overflow);
                    Value::Broken
                })
            }
            value => value,
        };
        (self.own(word, value), problem.or(hazard))
    }

    /// Caps a result's error, and gives an uncorrelated value a symbol of its own, so that later values can be correlated with it. Other
    /// values stay as they are: a copy is the same number.
    pub(super) fn own(&mut self, word: u32, value: Value) -> Value {
        match value {
            Value::Float(number) if number.form.is_slack() || number.is_loose() => {
                let number = Number::clone(&number).capped(|error| self.symbol_of(error, word));
                Value::Float(Rc::new(self.correlated(number)))
            }
            Value::Integer(number) if number.form.is_free() => {
                Value::Integer(Rc::new(self.correlated(Number::clone(&number))))
            }
            value => value,
        }
    }

    /// Symbol for an error whose terms it replaces: attributed to the operation with the largest of these terms.
    pub(super) fn symbol_of(&mut self, error: &Affine, word: u32) -> u32 {
        let largest = error.main_symbol().and_then(|symbol| self.symbols[symbol as usize]);
        self.symbol(Some(largest.unwrap_or(word)))
    }

    fn correlated(&mut self, number: Number) -> Number {
        if !number.form.is_slack() {
            return number;
        }
        let symbol = self.symbol(None);
        let form = match number.form.is_free() {
            true => Affine::of(number.exact, symbol),
            false => number.form.with_slack_as(symbol),
        };
        Number { form, ..number }
    }

    /// Rounds a result to binary32; `number` is the exact result for the run's operands.
    fn round(
        &mut self,
        word: u32,
        instruction: &Instruction,
        number: &Number,
        terms: Option<[Interval; 2]>,
        operands: &[Value; 3],
    ) -> Result<Value, Problem> {
        let number = number.clone().capped(|error| self.symbol_of(error, word));
        let rounder = |register: &Register| self.fixed.get(register).is_some_and(|bits| is_rounder(*bits));
        let terms = terms.filter(|_| instruction.reads().iter().any(rounder));
        let (may_decide, may_round) = terms.map_or((false, true), decides);
        let result = if !may_decide {
            self.rounded(word, instruction, number, operands)?
        } else {
            let decided = bits::nearest(&number, self.symbol(None));
            if may_round {
                decided.join(&self.rounded(word, instruction, number, operands)?)
            } else {
                decided
            }
        };
        Ok(Value::Float(Rc::new(result)))
    }

    /// Rounds a result, counting the rounding as an error.
    fn rounded(
        &mut self,
        word: u32,
        instruction: &Instruction,
        mut number: Number,
        operands: &[Value; 3],
    ) -> Result<Number, Problem> {
        let row = instruction.op.row();
        let actual = number.actual;
        let bound = row.ulp.unwrap_or(0.0);
        let magnitude = actual.magnitude();
        let fits = |grid: i32| grid >= -149 && magnitude <= 2f64.powi((24 + grid).min(127));
        let largest = f64::from(f32::MAX);
        if bound == 0.0 || number.grid.is_some_and(fits) {
            return if magnitude <= largest { Ok(number) } else { Err(Problem::Overflow) };
        }
        let scaled = scaled_by(instruction, operands).map(|power| rounding::of_scaled(power, actual));
        if scaled == Some(0.0) {
            number.grid = number.grid.max(float_grid(actual));
            return if magnitude <= largest { Ok(number) } else { Err(Problem::Overflow) };
        }
        let local = scaled.unwrap_or_else(|| rounding::bound(bound, actual));
        // Written so that a NaN does not fit.
        let fits = magnitude + local <= largest && number.error.range().is_finite();
        if !fits {
            return Err(Problem::Overflow);
        }
        // Operands known to the bit give a result known to the bit.
        let known = patterns(operands, row.shape.sources(), |a, b, c| compute::<Host>(row.op, a, b, c).bits);
        if let Some(Value::Patterns(known)) = &known
            && let (1, Some(bits)) = (known.len(), known.first())
        {
            let value = Interval::point(f64::from(f32::from_bits(*bits)));
            number.error = Affine::free(value - number.exact);
            number.actual = value;
            number.relative = None;
            return Ok(number);
        }
        let symbol = self.symbol(Some(word));
        number.relative = Some(match scaled {
            Some(by) => Relative::of(&number).widened(by),
            None => Relative::of(&number).rounded(bound),
        });
        number.error = number.error.with(symbol, local);
        number.actual = match bound == 0.5 {
            // Rounding to nearest is monotonic.
            true => Interval::new(f64::from(actual.low as f32), f64::from(actual.high as f32)),
            false => actual.outer(bound),
        };
        number.grid = number.grid.max(float_grid(number.actual));
        Ok(number.capped(|error| self.symbol_of(error, word)))
    }
}

/// Magnitudes of the power of two by which a product or quotient scales its other operand in every run; `None` for other operations.
fn scaled_by(instruction: &Instruction, operands: &[Value; 3]) -> Option<Interval> {
    let power = |of: &Meaning| match of {
        Meaning::Source(place) => powers(&operands[*place]),
        _ => None,
    };
    match Meaning::of(instruction)? {
        Meaning::Mul(of) => power(&of[0]).or_else(|| power(&of[1])),
        Meaning::Div(of) => power(&of[1]).map(|power| Interval::point(1.0) / power),
        _ => None,
    }
}

/// Magnitudes of an operand that is a power of two in every run.
fn powers(value: &Value) -> Option<Interval> {
    let magnitudes = match value {
        Value::Patterns(patterns) => {
            let values = patterns.iter().map(|bits| f64::from(f32::from_bits(*bits)));
            values
                .map(|value| is_power(value).then(|| Interval::point(value.abs())))
                .collect::<Option<Vec<_>>>()?
        }
        Value::Float(number) if is_power(number.actual.low) && number.actual.low == number.actual.high => {
            vec![number.actual.abs()]
        }
        _ => return None,
    };
    magnitudes.into_iter().reduce(Interval::hull)
}

/// Operand that a minimum or maximum takes in every run, if there is one.
fn passed(a: &Rc<Node>, b: &Rc<Node>, least: bool) -> Option<Rc<Node>> {
    let (Value::Float(x), Value::Float(y)) = (&a.value, &b.value) else { return None };
    let below = |x: &Number, y: &Number| x.actual.high <= y.actual.low && x.exact.high <= y.exact.low;
    let (less, more) = if below(x, y) {
        (a, b)
    } else if below(y, x) {
        (b, a)
    } else {
        return None;
    };
    Some(Rc::clone(if least { less } else { more }))
}

/// Two flags: the sum of these terms may round to the nearest integer, and may be an ordinary sum. It rounds if one term is of a magnitude
/// at which binary32 has no fraction, and the other is small. [`Shadow`](super::Shadow) decides the same by the terms of the run.
fn decides(terms: [Interval; 2]) -> (bool, bool) {
    let [a, b] = terms;
    let (mut may, mut must) = (false, false);
    for (rounder, small) in [(a, b), (b, a)] {
        let magnitude = small.abs();
        for value in ROUNDERS.into_iter().flat_map(|value| [value, -value]) {
            if rounder.contains(value) && magnitude.low <= LARGEST_ROUNDED {
                may = true;
                must |= rounder.low == rounder.high && magnitude.high <= LARGEST_ROUNDED;
            }
        }
    }
    (may, !must)
}

/// Results of an operation on every combination of its operands' patterns, if these are known and not too many.
fn patterns(operands: &[Value; 3], sources: usize, of: impl Fn(u32, u32, u32) -> u32) -> Option<Value> {
    let mut lists: [Vec<u32>; 3] = [vec![0], vec![0], vec![0]];
    for (list, operand) in lists.iter_mut().zip(operands).take(sources) {
        match operand {
            Value::Patterns(patterns) => *list = patterns.iter().copied().collect(),
            _ => return None,
        }
    }
    let [a, b, c] = &lists;
    if a.len() * b.len() * c.len() > MAX_PATTERNS {
        return None;
    }
    let all = a.iter().flat_map(|a| b.iter().flat_map(move |b| c.iter().map(move |c| (*a, *b, *c))));
    Some(Value::patterns(all.map(|(a, b, c)| of(a, b, c)).collect()))
}
