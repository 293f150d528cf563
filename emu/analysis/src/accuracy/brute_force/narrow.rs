// SPDX-License-Identifier: MIT OR Apache-2.0
//! Brute-force check of backward narrowing: the operands and symbols that a decision, a range or a constraint leaves possible.

use super::{Member, Sample, forms, noise, samples};
use crate::accuracy::assume::{Context, View};
use crate::accuracy::interval::Interval;
use crate::accuracy::node::{Made, Node};
use crate::accuracy::number::Number;
use crate::accuracy::operand::Operand;
use crate::accuracy::refine::lagrange;
use crate::accuracy::ulp;
use crate::accuracy::value::Value;
use std::collections::BTreeMap;
use std::rc::Rc;
use takt_isa::fp::Host;
use takt_isa::{BankIndex, Effect, Instruction, ROWS, Register, Row, Type, compute, real};

/// A member lies in an abstract value, up to binary64 rounding.
fn holds(value: &Value, member: &Member) -> bool {
    let slack = |at: f64| at.abs() * 1e-14 + 1e-300;
    let (float, whole) = (f64::from(f32::from_bits(member.bits)), f64::from(member.bits.cast_signed()));
    match value {
        Value::Patterns(patterns) => patterns.contains(&member.bits),
        Value::Float(number) => {
            number.actual.widened(slack(float)).contains(float)
                && number.exact.widened(slack(member.exact)).contains(member.exact)
        }
        Value::Integer(number) => number.actual.contains(whole),
        _ => true,
    }
}

/// Value of a row's result after its rounding.
fn rounded(row: &Row, value: Value) -> Value {
    match (row.ulp, value) {
        (Some(ulps), Value::Float(number)) if ulps > 0.0 => {
            let actual = number.actual.outer(ulps);
            let error = number.error.widened(ulps * ulp(number.actual.magnitude()));
            Value::Float(Rc::new(Number { actual, error, ..Number::clone(&number) }))
        }
        (_, value) => value,
    }
}

/// Narrows every row's operands by the row's result: every combination of members with that result must remain, and its noise must stay
/// within the confined symbols. Returns the number of narrowed operands.
fn narrowing_holds(part: usize) -> u64 {
    let all = [samples(0), samples(1), samples(2)];
    let (mut turn, mut narrowed) = (0, 0);
    let mut check = |row: &Row, samples: [&Sample; 3]| {
        let [a, b, c] = samples.map(|sample| Operand::of(sample.value.clone()));
        let Some(Operand { value, problem: None, .. }) = real(row.op, a, b, c) else { return };
        let value = rounded(row, value);
        let sources = row.shape.sources();
        let operands = samples.map(|sample| Node::leaf(sample.value.clone()));
        let zero = Register::ZERO;
        let instruction = Instruction {
            op: row.op,
            dest: BankIndex::new(0).expect("there is a first"),
            sources: [zero; 3],
            constant: 0,
        };
        let node = Node::new(value, Made { word: 0, instruction, operands: operands.clone() });
        let (mut results, one) = (Vec::new(), [samples[0].members[0]]);
        let members = |place: usize| if sources > place { &samples[place].members[..] } else { &one };
        for x in members(0) {
            for y in members(1) {
                for z in members(2) {
                    results.push(([*x, *y, *z], compute::<Host>(row.op, x.bits, y.bits, z.bits).bits));
                }
            }
        }
        // Overflow is a hazard, which leaves no number.
        if row.result_type() == Type::F && results.iter().any(|(_, bits)| !f32::from_bits(*bits).is_finite())
        {
            return;
        }
        let (first, last) = (results[0].1, results[results.len() - 1].1);
        let ends = |of: fn(u32) -> f64| Interval::new(of(first).min(of(last)), of(first).max(of(last)));
        let float = |bits: u32| f64::from(f32::from_bits(bits));
        let whole = |bits: u32| f64::from(bits.cast_signed());
        type Kept<'k> = Box<dyn Fn(u32) -> bool + 'k>;
        let questions: [(bool, Option<View>, Kept<'_>); 4] = [
            (true, None, Box::new(|bits| bits != 0)),
            (false, None, Box::new(|bits| bits == 0)),
            (true, Some(View::Float), Box::new(move |bits| ends(float).contains(float(bits)))),
            (true, Some(View::Integer), Box::new(move |bits| ends(whole).contains(whole(bits)))),
        ];
        for (truth, view, kept) in questions {
            // The analysis claims nothing about a word that is not a number in this view.
            if view == Some(View::Float) && results.iter().any(|(_, bits)| float(*bits).is_nan()) {
                continue;
            }
            let mut context = Context::default();
            let followed = match view {
                None => context.decide(&node, truth),
                Some(View::Float) => context.narrow(&node, ends(float), View::Float),
                Some(View::Integer) => context.narrow(&node, ends(whole), View::Integer),
            };
            let possible = followed.and_then(|()| context.confine()).is_ok();
            narrowed +=
                operands.iter().filter(|operand| *context.current(operand) != operand.value).count() as u64;
            for (members, bits) in results.iter().filter(|(_, bits)| kept(*bits)) {
                let about = || {
                    format!(
                        "{} of {members:x?} in {samples:x?} is {bits:08x}, {view:?} {truth}",
                        row.mnemonic
                    )
                };
                assert!(possible, "impossible: {}", about());
                for (place, member) in members.iter().enumerate().take(sources) {
                    assert!(holds(context.current(&operands[place]), member), "{place}: {}", about());
                    for (symbol, noise) in [place, place + 3].into_iter().zip(member.noise) {
                        let confined = context.confined.get(&(symbol as u32));
                        let within = confined.is_none_or(|range| range.widened(1e-9).contains(noise));
                        assert!(within, "{place}: noise {noise} not in {confined:?}: {}", about());
                    }
                }
            }
        }
    };
    for row in ROWS.iter().filter(|row| row.effect == Effect::Compute) {
        for (i, a) in all[0].iter().enumerate() {
            for (j, b) in all[1].iter().enumerate() {
                turn += 1;
                if row.shape.sources() < 2 && j > 0 || row.shape.sources() > 1 && turn % part != 0 {
                    continue;
                }
                check(row, [a, b, &all[2][(7 * i + 11 * j) % all[2].len()]]);
            }
        }
    }
    narrowed
}

/// Soundness of backward narrowing for every row. `TAKT_FULL=1` tries all combinations.
#[test]
fn narrowed_operands_hold_what_gives_the_result() {
    let full = std::env::var("TAKT_FULL").is_ok_and(|value| value == "1");
    let narrowed = narrowing_holds(if full { 1 } else { 23 });
    assert!(narrowed > 5_000, "{narrowed} operands are narrowed");
}

/// Symbols that a constraint confines, forms with confined symbols replaced, and bounds by multipliers hold every point that the constraint
/// leaves.
#[test]
fn constraints_leave_every_point_that_keeps_them() {
    let member = |[center, first, second, slack]: [f64; 4], [e0, e1, part]: [f64; 3]| {
        center + first * e0 + second * e1 + slack * part
    };
    let steps = [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0];
    let all = forms();
    let mut narrower = 0;
    for (constraint, of_constraint) in &all {
        let confined = constraint.confines(&|_| None);
        let map: BTreeMap<u32, Interval> = confined.clone().unwrap_or_default().into_iter().collect();
        let by = map
            .iter()
            .map(|(symbol, range)| (*symbol, (range.middle(), range.radius(), symbol + 10)))
            .collect();
        for (form, of_form) in all.iter().step_by(5) {
            let (replaced, bound) = (form.replaced(&by), lagrange(form, constraint));
            narrower += u64::from(bound != form.range());
            for e0 in steps {
                for e1 in steps {
                    // The slack may make the constraint hold.
                    if member(*of_constraint, [e0, e1, -1.0]) > 0.0 {
                        continue;
                    }
                    assert!(confined.is_some(), "{constraint:?} holds at {e0} {e1}");
                    let noise = |symbol: u32| {
                        let value = [e0, e1][symbol as usize % 10];
                        let range = map.get(&(symbol % 10)).filter(|_| symbol >= 10);
                        range.map_or(value, |range| noise(*range, value))
                    };
                    for symbol in [0, 1] {
                        assert!(map.get(&symbol).is_none_or(|range| range.contains(noise(symbol))));
                    }
                    for part in [-1.0, 1.0] {
                        let value = member(*of_form, [e0, e1, part]);
                        assert!(
                            bound.contains(value),
                            "{value} of {form:?} is not in {bound:?} by {constraint:?}"
                        );
                        let replaced = replaced.as_ref().map(|form| form.at(&noise).widened(1e-12));
                        assert!(replaced.is_none_or(|range| range.contains(value)), "{form:?} {replaced:?}");
                    }
                }
            }
        }
    }
    assert!(narrower > 200, "{narrower}");
}
