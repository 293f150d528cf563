// SPDX-License-Identifier: MIT OR Apache-2.0
//! Certificates: bounds with every step of their derivation, for a checker that shares nothing with this analysis.
//!
//! The rules are few and plain: intervals for values, affine forms for errors, one step for each operation. What the enclosure knows besides
//! (correlated ranges, conditions, cases, boxes, relations) is left out, so that a certificate may prove a larger bound than the printed one. It
//! says which one it proves. All numbers are binary64, and the checker reads each as the rational number that it is.

use super::affine::Affine;
use super::converge::Linear;
use super::enclose::Explorer;
use super::interval::Interval;
use super::node::{Made, Meaning, Node};
use super::number::{INTEGERS, power};
use super::rounding::{self, is_power};
use super::states::{MAX_LINEAR, Place};
use super::value::{SMALLEST_NORMAL, Value};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;
use takt_isa::{Program, Type};

/// Checker that goes with every certificate.
const CHECK: &str = include_str!("check.py");

/// Part of a state's range that a linear map must leave free, so that the checker's arithmetic finds the same.
const SURE: f64 = 1.0 - 1e-9;

/// Rules that goals for Gappa spell out; values of others are variables.
const IN_EXPRESSIONS: [&str; 6] = ["add", "mul", "div", "neg", "sqrt", "steep"];

/// Derivation of the bounds of a period's outputs.
#[derive(Serialize, Debug, PartialEq)]
pub struct Certificate {
    /// Promised ranges of inputs and states: the bounds hold for runs that keep them.
    pub promises: Vec<Promise>,
    /// Operations in order; each refers to earlier ones by their places.
    pub steps: Vec<Step>,
    /// Proved bounds.
    pub outputs: Vec<Proved>,
    /// States that a period leaves in their promised range, by this derivation.
    pub kept: Vec<Kept>,
    /// States that no single period keeps, and all periods together do: their linear map converges.
    pub converging: Vec<Convergent>,
    /// Promises about states that the derivation relies on without proving them, and outputs that it does not reach, with the reasons.
    pub open: Vec<Open>,
}

/// Range that the source promises.
#[derive(Serialize, Debug, PartialEq)]
pub struct Promise {
    /// Name of the port or the state.
    pub name: String,
    /// Least and largest value.
    pub range: [f64; 2],
    /// Values are integers; else they are of binary32.
    pub integer: bool,
}

/// Step of a derivation: a value, with the rule that encloses it.
#[derive(Serialize, Debug, PartialEq)]
pub struct Step {
    /// Rule: an operation in the real numbers, or `round`.
    pub rule: &'static str,
    /// Places of the operands.
    pub of: Vec<usize>,
    /// Range of the value in the run.
    pub run: [f64; 2],
    /// Range of the value in exact arithmetic.
    pub exact: [f64; 2],
    /// Value in the run less the exact one.
    pub error: Form,
    /// Range of the slope, for rules that need one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope: Option<[f64; 2]>,
    /// For `round`: bound of the rounding error, in units in the last place, and its symbol.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rounding: Option<Rounding>,
    /// Promise that the value is taken from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub promise: Option<usize>,
    /// Place of the operation in the source.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub source: String,
}

/// Rounding of a step.
#[derive(Serialize, Debug, PartialEq)]
pub struct Rounding {
    /// Units in the last place: 0.5 for IEEE operations, which Gappa proves; more is a hypothesis.
    pub ulps: f64,
    /// Bound of the rounding error.
    pub bound: f64,
    /// Symbol of the rounding error in later forms.
    pub symbol: u32,
}

/// Affine form: a center, coefficients of symbols in [-1, 1], and a slack.
#[derive(Serialize, Debug, PartialEq)]
pub struct Form {
    /// Center.
    pub center: f64,
    /// Symbols and coefficients.
    pub terms: Vec<(u32, f64)>,
    /// Bound of what the terms leave out.
    pub slack: f64,
}

/// Bound of an output's error.
#[derive(Serialize, Debug, PartialEq)]
pub struct Proved {
    /// Name of the output, or of an array's word.
    pub name: String,
    /// Step of the output's value.
    pub step: usize,
    /// Bound of the error's magnitude.
    pub bound: f64,
}

/// State that stays in its range.
#[derive(Serialize, Debug, PartialEq)]
pub struct Kept {
    /// Index of its promise.
    pub promise: usize,
    /// Step of its value at the end of the period.
    pub step: usize,
}

/// State of a linear map that converges.
#[derive(Serialize, Clone, Debug, PartialEq)]
pub struct Convergent {
    /// Index of its promise.
    pub promise: usize,
    /// Step of its value at the end of the period.
    pub step: usize,
    /// Range when the first period begins.
    pub first: [f64; 2],
}

/// Value of the run as a sum of states' multiples and a rest.
#[derive(Clone)]
struct Sum {
    /// Factors by the states' promises.
    terms: BTreeMap<usize, Interval>,
    rest: Interval,
}

impl Sum {
    fn of(rest: Interval) -> Sum {
        Sum { terms: BTreeMap::new(), rest }
    }

    fn times(&self, factor: Interval) -> Sum {
        let terms = self.terms.iter().map(|(state, by)| (*state, factor * *by)).collect();
        Sum { terms, rest: factor * self.rest }
    }

    fn plus(mut self, other: &Sum) -> Sum {
        for (state, by) in &other.terms {
            let known = self.terms.entry(*state).or_insert(Interval::ZERO);
            *known = *known + *by;
        }
        self.rest = self.rest + other.rest;
        self
    }
}

/// Part of the statement that the derivation does not reach.
#[derive(Serialize, Debug, PartialEq)]
pub struct Open {
    /// Name of the output or the state.
    pub name: String,
    /// Reason.
    pub reason: String,
}

/// Value under derivation.
#[derive(Clone)]
struct Known {
    place: usize,
    run: Interval,
    exact: Interval,
    error: Affine,
}

struct Builder<'p> {
    program: &'p Program,
    steps: Vec<Step>,
    /// Places and promises of values that enter the period, by their symbols.
    entering: BTreeMap<u32, usize>,
    promises: Vec<Promise>,
    /// Derived values by their nodes.
    known: HashMap<*const Node, Result<Known, String>>,
    symbols: u32,
}

impl Certificate {
    /// Names and contents of the files: the derivation, the goals for Gappa, and the checker, `check.py`.
    pub fn files(&self) -> Vec<(String, String)> {
        let derivation = serde_json::to_string_pretty(self).unwrap_or_default();
        let fixed = [("certificate.json".to_owned(), derivation), ("check.py".to_owned(), CHECK.to_owned())];
        let goals = self.goals().into_iter().map(|(place, goal)| (format!("step-{place}.g"), goal));
        fixed.into_iter().chain(goals).collect()
    }

    /// Goals for Gappa: the place of each operation that rounds as IEEE 754 says, with the script that states its range and rounding.
    pub fn goals(&self) -> Vec<(usize, String)> {
        let rounds = |step: &Step| step.rounding.as_ref().is_some_and(|rounding| rounding.ulps == 0.5);
        let places = (0..self.steps.len()).filter(|place| rounds(&self.steps[*place]));
        places.map(|place| (place, self.goal(place))).collect()
    }

    fn goal(&self, place: usize) -> String {
        let step = &self.steps[place];
        let mut operands = BTreeSet::new();
        let expression = self.expression(step.of[0], &mut operands);
        let range = |[low, high]: [f64; 2]| format!("[{}, {}]", exact(low), exact(high));
        let mut text = "@rnd = float<ieee_32, ne>;\n".to_owned();
        for operand in &operands {
            let format = if self.steps[*operand].rule == "integer" { "int<ne>" } else { "rnd" };
            text += &format!("v{operand} = {format}(u{operand});\n");
        }
        let given: Vec<String> = operands
            .iter()
            .map(|operand| format!("v{operand} in {}", range(self.steps[*operand].run)))
            .collect();
        let bound = step.rounding.as_ref().map_or(0.0, |rounding| rounding.bound);
        let hint = match scaled_by(&self.steps, step.of[0]).filter(|_| bound == rounding::LEAST) {
            // Gappa distinguishes subnormal results from others.
            Some((operand, by)) => {
                let at = SMALLEST_NORMAL / by;
                format!("$ v{operand} in ({}, {});\n", exact(-at), exact(at))
            }
            None => String::new(),
        };
        text + &format!(
            "r = rnd({expression});\n{{ {} -> r in {} /\\ |r - ({expression})| in {} }}\n{hint}",
            given.join(" /\\ "),
            range(step.run),
            range([0.0, bound])
        )
    }

    /// Expression of a step that is not rounded yet, over values of binary32.
    fn expression(&self, place: usize, operands: &mut BTreeSet<usize>) -> String {
        let step = &self.steps[place];
        let mut of = |index: usize| self.expression(step.of[index], operands);
        match step.rule {
            "add" => format!("({} + {})", of(0), of(1)),
            "mul" => format!("({} * {})", of(0), of(1)),
            "div" => format!("({} / {})", of(0), of(1)),
            "neg" => format!("(-{})", of(0)),
            "sqrt" | "steep" => format!("sqrt({})", of(0)),
            _ => {
                operands.insert(place);
                format!("v{place}")
            }
        }
    }
}

/// A binary64 as Gappa spells it: an integer times a power of two that is not positive, exactly.
pub fn exact(value: f64) -> String {
    let (bits, sign) = (value.abs().to_bits(), if value < 0.0 { "-" } else { "" });
    let exponent = (bits >> 52) as i32;
    let fraction = bits & ((1 << 52) - 1);
    let digits = u128::from(if exponent == 0 { fraction } else { fraction | 1 << 52 });
    let power = exponent.max(1) - 1075;
    if digits == 0 {
        return "0b0".to_owned();
    }
    let shift = (digits.trailing_zeros() as i32).min(-power.min(0));
    match power {
        // Values of the certificate are below the largest binary32.
        1.. => format!("{sign}{}b0", digits << power.min(74)),
        _ => format!("{sign}{}b{}", digits >> shift, power + shift),
    }
}

fn ends(range: Interval) -> [f64; 2] {
    [range.low, range.high]
}

fn form(affine: &Affine) -> Form {
    let (center, slack) = affine.center_and_slack();
    Form { center, terms: affine.terms().collect(), slack }
}

/// For a product of a rounded value with a constant that is a power of two: the value's step, and the magnitude of the power.
fn scaled_by(steps: &[Step], product: usize) -> Option<(usize, f64)> {
    let step = steps.get(product).filter(|step| step.rule == "mul")?;
    let [a, b] = *step.of.as_slice() else { return None };
    let power = |place: usize| {
        let [value, _] = steps.get(place).filter(|step| step.rule == "constant")?.run;
        is_power(value).then_some(value.abs())
    };
    let (value, by) =
        [(a, power(b)), (b, power(a))].into_iter().find_map(|(value, by)| Some((value, by?)))?;
    (!IN_EXPRESSIONS.contains(&steps.get(value)?.rule)).then_some((value, by))
}

/// Name of a place in the source.
fn name(program: &Program, place: Place) -> String {
    match place {
        Place::Register(register) => program.register_text(register),
        Place::Word(word) => program.element_text(word).unwrap_or_else(|| program.data_text(word)),
    }
}

/// Derivation for the values that a period leaves, as `explorer` has followed it without case distinctions.
pub(super) fn derive(explorer: &Explorer<'_>, finals: &[(u32, Place, Rc<Node>)]) -> Certificate {
    let program = explorer.program;
    let mut builder = Builder {
        program,
        steps: Vec::new(),
        entering: BTreeMap::new(),
        promises: Vec::new(),
        known: HashMap::new(),
        symbols: 0,
    };
    let mut promised = BTreeMap::new();
    for (symbol, place) in &explorer.entered {
        let range = match place {
            Place::Register(register) => program
                .ranges
                .iter()
                .find(|range| range.register == *register)
                .map(|range| (range.ends(), range.ty)),
            Place::Word(word) => {
                let range = program.array_ranges.iter().find(|range| range.span().contains(word));
                range.map(|range| (range.ends(), range.ty))
            }
        };
        let Some(((low, high), ty)) = range else { continue };
        let promise = *promised.entry(*place).or_insert_with(|| {
            let (name, integer) = (name(program, *place), ty != Type::F);
            builder.promises.push(Promise { name, range: [low, high], integer });
            builder.promises.len() - 1
        });
        builder.entering.insert(*symbol, promise);
    }
    let (mut outputs, mut kept, mut open) = (Vec::new(), Vec::new(), Vec::new());
    // States with their values at the end of the period, and those of them that it may leave.
    let (mut states, mut left) = (Vec::new(), BTreeMap::new());
    for (period, place, node) in finals {
        let is_output = match place {
            Place::Register(register) => {
                program.outputs.iter().any(|port| port.register == *register && port.ty == Type::F)
            }
            Place::Word(word) => program.results.iter().any(|array| array.span().contains(word)),
        };
        let name = match explorer.periods {
            1 => name(program, *place),
            _ => format!("{}, period {period}", name(program, *place)),
        };
        match builder.node(node) {
            Err(reason) => open.push(Open { name, reason }),
            Ok(known) => {
                if let Some(promise) = promised.get(place) {
                    let [low, high] = builder.promises[*promise].range;
                    let first = explorer.first_value(*place).and_then(|value| value.float().ok());
                    let first = first.map_or([low, high], |number| ends(number.actual));
                    states.push(Convergent { promise: *promise, step: known.place, first });
                    match known.run.within(Interval::new(low, high)) {
                        true => kept.push(Kept { promise: *promise, step: known.place }),
                        false => _ = left.insert(*promise, name.clone()),
                    }
                }
                if is_output {
                    let bound = known.error.range().magnitude();
                    outputs.push(Proved { name, step: known.place, bound });
                }
            }
        }
    }
    let converging = match explorer.periods {
        1 => builder.converging(&states, &left),
        // With several periods, each has its own values of the states.
        _ => Vec::new(),
    };
    left.retain(|promise, _| converging.iter().all(|state| state.promise != *promise));
    for (promise, name) in left {
        let [low, high] = builder.promises[promise].range;
        let reason = format!("its range [{low}, {high}] is assumed: by itself, a period may leave it");
        open.push(Open { name, reason });
    }
    Certificate { promises: builder.promises, steps: builder.steps, outputs, kept, converging, open }
}

impl Builder<'_> {
    fn node(&mut self, node: &Rc<Node>) -> Result<Known, String> {
        if let Some(known) = self.known.get(&Rc::as_ptr(node)) {
            return known.clone();
        }
        let known: Result<Known, String> = match &node.made {
            Some(made) => self.made(made).and_then(|known| {
                let is_finite =
                    known.run.is_finite() && known.exact.is_finite() && known.error.range().is_finite();
                let place = || self.program.word_text(made.word as usize);
                if is_finite {
                    Ok(known)
                } else {
                    Err(format!("by intervals alone, the value at {} has no bound", place()))
                }
            }),
            None => self.leaf(node),
        };
        self.known.insert(Rc::as_ptr(node), known.clone());
        known
    }

    fn step(
        &mut self,
        rule: &'static str,
        of: &[&Known],
        run: Interval,
        exact: Interval,
        error: Affine,
    ) -> Known {
        let place = self.steps.len();
        self.steps.push(Step {
            rule,
            of: of.iter().map(|known| known.place).collect(),
            run: ends(run),
            exact: ends(exact),
            error: form(&error),
            slope: None,
            rounding: None,
            promise: None,
            source: String::new(),
        });
        Known { place, run, exact, error }
    }

    fn leaf(&mut self, node: &Rc<Node>) -> Result<Known, String> {
        let zero = Affine::constant(0.0);
        match &node.value {
            Value::Float(number) | Value::Integer(number) if number.error.is_zero() => {
                let symbol = number.form.largest();
                let promise = symbol.and_then(|symbol| self.entering.get(&symbol).copied());
                let promise = promise
                    .ok_or("it depends on a value that no `.range` encloses, or on paths that meet")?;
                let known = self.step("promise", &[], number.actual, number.actual, zero);
                self.steps[known.place].promise = Some(promise);
                Ok(known)
            }
            Value::Patterns(patterns) if patterns.len() == 1 => {
                let bits = patterns.first().copied().unwrap_or(0);
                let at = Interval::point(f64::from(f32::from_bits(bits)));
                if !at.is_finite() {
                    return Err("it depends on a constant that is not finite".to_owned());
                }
                Ok(self.step("constant", &[], at, at, zero))
            }
            _ => {
                Err("it depends on paths that meet, on bits, or on more than 200 operations in a row"
                    .to_owned())
            }
        }
    }

    fn made(&mut self, made: &Made) -> Result<Known, String> {
        let row = made.instruction.op.row();
        let source = self.program.word_text(made.word as usize);
        let operands = [0, 1, 2].map(|place: usize| &made.operands[place]);
        let sources = row.shape.sources();
        let value = match row.mnemonic {
            "fsin" | "fcos" => {
                let x = self.node(operands[0])?;
                let one = Interval::new(-1.0, 1.0);
                let error = match x.error.is_zero() {
                    true => Affine::constant(0.0),
                    false => centered(x.error.range().magnitude().min(2.0)),
                };
                let rule = if row.mnemonic == "fsin" { "sin" } else { "cos" };
                self.step(rule, &[&x], one, one, error)
            }
            _ => {
                let meaning = Meaning::of(&made.instruction);
                let meaning = meaning.ok_or_else(|| format!("`{}` at {source} has no rule", row.mnemonic))?;
                let copy = matches!(meaning, Meaning::Source(_));
                let value = self.meaning(&meaning, made, &source)?;
                if copy || row.result_type() != Type::F {
                    return Ok(value);
                }
                value
            }
        };
        let ulps = row.ulp.unwrap_or(0.0);
        if ulps == 0.0 || sources == 0 {
            return Ok(value);
        }
        let bound = self.scaled(&value).unwrap_or_else(|| rounding::bound(ulps, value.run));
        if !bound.is_finite() {
            return Err(format!("the result at {source} may be too large"));
        }
        let run = match ulps == 0.5 {
            true => Interval::new(f64::from(value.run.low as f32), f64::from(value.run.high as f32)),
            false => value.run.widened(bound),
        };
        self.symbols += 1;
        let error = value.error.with(self.symbols, bound);
        let known = self.step("round", &[&value], run, value.exact, error);
        self.steps[known.place].rounding = Some(Rounding { ulps, bound, symbol: self.symbols });
        self.steps[known.place].source = source;
        Ok(self.capped(known))
    }

    /// The step is an integer from a promise, or a sum of such.
    fn is_whole(&self, place: usize) -> bool {
        let step = &self.steps[place];
        match step.rule {
            "promise" => step.promise.is_some_and(|promise| self.promises[promise].integer),
            "integer" => true,
            "add" | "neg" => step.of.iter().all(|of| self.is_whole(*of)),
            _ => false,
        }
    }

    /// Bound of the rounding of a product with a constant that is a power of two, and of an integer that binary32 has.
    fn scaled(&self, value: &Known) -> Option<f64> {
        if self.steps[value.place].rule == "integer" && value.run.magnitude() <= power(24) {
            return Some(0.0);
        }
        let (_, by) = scaled_by(&self.steps, value.place)?;
        Some(rounding::of_scaled(Interval::point(by), value.run))
    }

    /// States whose linear map keeps all of them in their ranges for all time, those that a period may leave among them.
    fn converging(&self, states: &[Convergent], left: &BTreeMap<usize, String>) -> Vec<Convergent> {
        if left.is_empty() {
            return Vec::new();
        }
        // A state that each period keeps may converge with the others, or not (a limited integrator): try with and without these.
        let floats = states.iter().filter(|state| !self.promises[state.promise].integer);
        let all: Vec<Convergent> = floats.cloned().collect();
        let open: Vec<Convergent> =
            all.iter().filter(|state| left.contains_key(&state.promise)).cloned().collect();
        let tried = [all, open].into_iter().filter(|states| states.len() <= MAX_LINEAR);
        let mut kept = tried.filter(|states| {
            let largest = self.linear(states).and_then(|linear| linear.largest());
            largest.is_some_and(|largest| largest.iter().all(|most| *most < SURE))
        });
        kept.next().unwrap_or_default()
    }

    /// Linear map of the period on states, as the checker finds it.
    fn linear(&self, states: &[Convergent]) -> Option<Linear> {
        let order: Vec<usize> = states.iter().map(|state| state.promise).collect();
        let sums = self.sums(&order);
        let range = |promise: usize| {
            let [low, high] = self.promises[promise].range;
            Interval::new(low, high)
        };
        let mut linear = Linear { rows: Vec::new(), added: Vec::new(), first: Vec::new() };
        for state in states {
            let sum = &sums[state.step];
            let (middle, radius) =
                (Interval::point(range(state.promise).middle()), range(state.promise).radius());
            if radius <= 0.0 {
                return None;
            }
            let radius = Interval::point(radius);
            let factor = |promise: &usize| sum.terms.get(promise).copied().unwrap_or(Interval::ZERO);
            let scaled =
                |promise: &usize| factor(promise) * Interval::point(range(*promise).radius()) / radius;
            let middles =
                order.iter().map(|promise| factor(promise) * Interval::point(range(*promise).middle()));
            let offset = middles.fold(-middle, |sum, term| sum + term);
            linear.rows.push(order.iter().map(scaled).collect());
            linear.added.push(((sum.rest + offset).abs() / radius).high);
            let [low, high] = state.first;
            linear.first.push(((Interval::new(low, high) - middle).abs() / radius).high);
        }
        Some(linear)
    }

    /// Each step's value in the run as a sum of states, as far as the steps are linear in them.
    fn sums(&self, states: &[usize]) -> Vec<Sum> {
        let mut sums: Vec<Sum> = Vec::with_capacity(self.steps.len());
        for step in &self.steps {
            let run = |place: usize| {
                let [low, high] = self.steps[place].run;
                Interval::new(low, high)
            };
            let point = |index: usize| run(step.of[index]).low == run(step.of[index]).high;
            let of = |index: usize| &sums[step.of[index]];
            let value = match step.rule {
                "promise" if step.promise.is_some_and(|promise| states.contains(&promise)) => {
                    let terms = step.promise.map(|promise| (promise, Interval::point(1.0)));
                    Sum { terms: terms.into_iter().collect(), rest: Interval::ZERO }
                }
                "neg" => of(0).times(Interval::point(-1.0)),
                "add" => of(0).clone().plus(of(1)),
                "mul" if point(0) => of(1).times(run(step.of[0])),
                "mul" if point(1) => of(0).times(run(step.of[1])),
                "round" => {
                    let bound = step.rounding.as_ref().map_or(0.0, |rounding| rounding.bound);
                    of(0).clone().plus(&Sum::of(Interval::new(-bound, bound)))
                }
                "cap" | "integer" => of(0).clone(),
                _ => Sum::of(Interval::ZERO),
            };
            let [low, high] = step.run;
            sums.push(if value.terms.is_empty() { Sum::of(Interval::new(low, high)) } else { value });
        }
        sums
    }

    /// Replaces an error by the distance of both ranges, where that is narrower.
    fn capped(&mut self, known: Known) -> Known {
        let distance = known.run - known.exact;
        if known.error.is_zero() || distance.magnitude() >= known.error.range().magnitude() {
            return known;
        }
        self.step("cap", &[&known], known.run, known.exact, Affine::free(distance))
    }

    fn meaning(&mut self, meaning: &Meaning, made: &Made, source: &str) -> Result<Known, String> {
        let join = |a: Interval, b: Interval| a.hull(b);
        match meaning {
            Meaning::Source(place) => self.node(&made.operands[*place]),
            Meaning::Neg(of) => {
                let x = self.meaning(of, made, source)?;
                Ok(self.step("neg", &[&x], -x.run, -x.exact, x.error.neg()))
            }
            Meaning::Abs(of) => {
                let x = self.meaning(of, made, source)?;
                Ok(self.magnitude(x))
            }
            Meaning::Sign(of) => {
                let x = self.meaning(of, made, source)?;
                let error = if x.error.is_zero() { Affine::constant(0.0) } else { centered(2.0) };
                let known = self.step("sign", &[&x], x.run.sign(), x.exact.sign(), error);
                Ok(self.capped(known))
            }
            Meaning::Integer(of) => {
                let x = self.meaning(of, made, source)?;
                if !self.is_whole(x.place) || !x.run.within(INTEGERS) {
                    return Err(format!("the integer at {source} is neither an input nor a sum of these"));
                }
                Ok(self.step("integer", &[&x], x.run, x.exact, x.error.clone()))
            }
            Meaning::Add(of) => {
                let [a, b] = self.two(of, made, source)?;
                Ok(self.step("add", &[&a, &b], a.run + b.run, a.exact + b.exact, a.error.add(&b.error)))
            }
            Meaning::Mul(of) => {
                let [a, b] = self.two(of, made, source)?;
                let (run, exact) = match a.place == b.place {
                    true => (a.run.square(), a.exact.square()),
                    false => (a.run * b.run, a.exact * b.exact),
                };
                let rest = a.error.range().magnitude() * b.error.range().magnitude();
                let error = b.error.scale(a.exact).add(&a.error.scale(b.exact)).widened(rest * 1.001);
                let error =
                    if a.error.is_zero() && b.error.is_zero() { Affine::constant(0.0) } else { error };
                Ok(self.step("mul", &[&a, &b], run, exact, error))
            }
            Meaning::Div(of) => {
                let [a, b] = self.two(of, made, source)?;
                if b.run.contains(0.0) || b.exact.contains(0.0) {
                    return Err(format!("by intervals alone, the divisor at {source} may be zero"));
                }
                let (run, exact) = (a.run / b.run, a.exact / b.exact);
                let inverse = Interval::point(1.0) / b.run;
                let error = a.error.scale(inverse).sub(&b.error.scale(exact * inverse));
                let known = self.step("div", &[&a, &b], run, exact, error);
                self.steps[known.place].slope = Some(ends(inverse));
                Ok(known)
            }
            Meaning::Sqrt(of) => {
                let x = self.meaning(of, made, source)?;
                if x.run.low < 0.0 || x.exact.low < 0.0 {
                    return Err(format!(
                        "by intervals alone, the operand of the root at {source} may be negative"
                    ));
                }
                let both = x.run.hull(x.exact);
                let (run, exact) = (x.run.sqrt(), x.exact.sqrt());
                if both.low == 0.0 {
                    let most = Interval::point(x.error.range().magnitude()).sqrt().high;
                    let error = if x.error.is_zero() { Affine::constant(0.0) } else { centered(most) };
                    return Ok(self.step("steep", &[&x], run, exact, error));
                }
                let slope = Interval::point(0.5) / both.sqrt();
                let known = self.step("sqrt", &[&x], run, exact, x.error.scale(slope));
                self.steps[known.place].slope = Some(ends(slope));
                Ok(known)
            }
            Meaning::Minimum(of) => {
                let [a, b] = self.two(of, made, source)?;
                Ok(self.least(&a, &b))
            }
            Meaning::Maximum(of) => {
                let [a, b] = self.two(of, made, source)?;
                Ok(self.most(&a, &b))
            }
            Meaning::Saturate(of) => {
                let [x, limit] = self.two(of, made, source)?;
                let Interval { low, high } = limit.run;
                if low != high || !limit.error.is_zero() || low < 0.0 {
                    let limit = self.magnitude(limit);
                    let below = self.least(&x, &limit);
                    let least = self.step("neg", &[&limit], -limit.run, -limit.exact, limit.error.neg());
                    return Ok(self.most(&below, &least));
                }
                let within = |range: Interval| {
                    Interval::new(range.low.clamp(-high, high), range.high.clamp(-high, high))
                };
                let error = x.error.join(&Affine::constant(0.0));
                let known = self.step("sat", &[&x, &limit], within(x.run), within(x.exact), error);
                Ok(self.capped(known))
            }
            Meaning::Choose(of) => {
                let [yes, no] = [&of[1], &of[2]].map(|side| self.meaning(side, made, source));
                let (yes, no) = (yes?, no?);
                let error = yes.error.join(&no.error);
                let known = self.step(
                    "choose",
                    &[&yes, &no],
                    join(yes.run, no.run),
                    join(yes.exact, no.exact),
                    error,
                );
                Ok(self.capped(known))
            }
            // A decision has no error.
            Meaning::Equal(_) | Meaning::Less(_) | Meaning::LessOrEqual(_) => {
                let either = Interval::new(0.0, 1.0);
                Ok(self.step("decision", &[], either, either, Affine::constant(0.0)))
            }
            _ => {
                let row = made.instruction.op.row();
                Err(format!("`{}` at {source} has no rule", row.mnemonic))
            }
        }
    }

    fn magnitude(&mut self, x: Known) -> Known {
        if x.run.low >= 0.0 && x.exact.low >= 0.0 {
            return x;
        }
        let error = centered(x.error.range().magnitude());
        self.step("abs", &[&x], x.run.abs(), x.exact.abs(), error)
    }

    fn least(&mut self, a: &Known, b: &Known) -> Known {
        let (run, exact) = (a.run.minimum(b.run), a.exact.minimum(b.exact));
        let known = self.step("min", &[a, b], run, exact, a.error.join(&b.error));
        self.capped(known)
    }

    fn most(&mut self, a: &Known, b: &Known) -> Known {
        let larger = |a: Interval, b: Interval| -((-a).minimum(-b));
        let (run, exact) = (larger(a.run, b.run), larger(a.exact, b.exact));
        let known = self.step("max", &[a, b], run, exact, a.error.join(&b.error));
        self.capped(known)
    }

    fn two(&mut self, of: &[Meaning; 2], made: &Made, source: &str) -> Result<[Known; 2], String> {
        Ok([self.meaning(&of[0], made, source)?, self.meaning(&of[1], made, source)?])
    }
}

/// Form of an error of at most this magnitude.
fn centered(most: f64) -> Affine {
    Affine::constant(0.0).widened(most)
}
