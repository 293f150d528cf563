// SPDX-License-Identifier: MIT OR Apache-2.0
//! Products of integers, from parts of 16 bits or, by a constant, as shifts and sums; quotients and remainders by powers of two. The
//! machine multiplies 24 bits and does not divide integers. A part of [`expression`](crate::resolve::expression).
//!
//! Quotients are truncated, as in C: -7/4 is -1, and -7 % 4 is -3.

use crate::context::{AstPlace, ErrorReported};
use crate::ir::RegisterId;
use crate::ir::type_evidence::Kind;
use crate::resolve::Resolver;
use crate::resolve::term::{CurrentEquation, LineExpression, Term, TermForm};
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_syntax::ast::{ExprId, Node, NodeKind, Operator};
use takt_syntax::expr::{EvalError, Fault, Value};

/// The product of integers of 24 bits, as equations write it.
const PRODUCT: &str = "mul24";
/// Bits of a part of a product's factor, and a mask of them.
const PART: (u32, u32) = (16, 0xffff);
/// Factors that [`PRODUCT`] takes whole.
const WHOLE: std::ops::Range<i32> = -(1 << 23)..1 << 23;

/// A part of a factor: the exponent of a power of two, and whether it is subtracted.
type Digit = (u32, bool);

/// A factor as sums and differences of powers of two, modulo 2³²: binary digits or the non-adjacent form, whichever takes fewer
/// operations.
fn digits(factor: i64) -> Vec<Digit> {
    let binary = |factor: i64, negative: bool| -> Vec<Digit> {
        let magnitude = factor.unsigned_abs();
        (0..u32::BITS).filter(|bit| magnitude >> bit & 1 != 0).map(|bit| (bit, negative)).collect()
    };
    let plain = binary(factor, factor < 0);
    let (mut rest, mut signed) = (i128::from(factor), Vec::new());
    for bit in 0..u32::BITS {
        if rest & 1 != 0 {
            // In a run of ones, the last is subtracted.
            let digit = 2 - (rest & 3);
            signed.push((bit, digit < 0));
            rest -= digit;
        }
        rest >>= 1;
    }
    if operations(&signed) < operations(&plain) { signed } else { plain }
}

/// Operations that a factor's digits take: a shift for each digit but the units, a sum for each but the first, and a negation if all
/// digits are negative.
fn operations(digits: &[Digit]) -> usize {
    let shifts = digits.iter().filter(|(bit, _)| *bit > 0).count();
    let negation = usize::from(digits.iter().all(|(_, negative)| *negative));
    (shifts + digits.len() + negation).saturating_sub(1)
}

impl Resolver<'_> {
    /// Computes a product, quotient or remainder of integers; `None` for operands of another kind.
    pub(super) fn integers(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        symbol: &str,
        terms: &[Term],
        here: LineExpression,
    ) -> Result<Option<Term>, ErrorReported> {
        let operators = [Operator::Mul, Operator::Div, Operator::Rem];
        let Some(operator) = operators.into_iter().find(|operator| operator.text() == symbol) else {
            return Ok(None);
        };
        let [a, b] = terms else { return Ok(None) };
        let is_int = |term: &Term| match term.form {
            TermForm::Register(_, kind) => kind == Kind::Int,
            TermForm::Constant(value, _) => value.integer().is_ok(),
            TermForm::Chain(..) | TermForm::Counted(_) => false,
        };
        if !(is_int(a) && is_int(b)) {
            return Ok(None);
        }
        match (operator, a.form, b.form) {
            (Operator::Mul, TermForm::Register(register, _), TermForm::Constant(factor, _))
            | (Operator::Mul, TermForm::Constant(factor, _), TermForm::Register(register, _)) => {
                let span = if a.value().is_some() { a.span } else { b.span };
                let factor = self.word_of(at, factor, span)?;
                if factor == 0 {
                    return Ok(Some(Term { form: TermForm::Constant(Value::Int(0), here.1), span: here.0 }));
                }
                // In parts, a factor of 24 bits takes six operations, another eight.
                let in_parts = if WHOLE.contains(&factor) { 6 } else { 8 };
                let is_long = operations(&digits(factor.into())) > in_parts;
                let product = match is_long && self.multiplies_integers() {
                    true => self.product(at, line, [a, b], here.0)?,
                    false => self.scaled(at, line, register, factor.into(), here.0)?,
                };
                Ok(Some(Term { form: TermForm::Register(product, Kind::Int), span: here.0 }))
            }
            (Operator::Mul, ..) => {
                let form = TermForm::Register(self.product(at, line, [a, b], here.0)?, Kind::Int);
                Ok(Some(Term { form, span: here.0 }))
            }
            (_, TermForm::Register(register, _), TermForm::Constant(divisor, _)) => {
                let number = self.word_of(at, divisor, b.span)?;
                if number == 0 {
                    let fault = Fault::DivisionByZero;
                    return Err(self.context.fault(at.scope, EvalError { span: b.span, fault }));
                }
                if !number.unsigned_abs().is_power_of_two() {
                    return Err(self.no_quotient(at, operator, terms, here.0));
                }
                self.by_power(at, line, operator, register, number, here).map(Some)
            }
            _ => Err(self.no_quotient(at, operator, terms, here.0)),
        }
    }

    /// A constant as a signed word.
    fn word_of(&mut self, at: AstPlace, value: Value, span: Span) -> Result<i32, ErrorReported> {
        let bits =
            value.bits(Type::I).map_err(|fault| self.context.fault(at.scope, EvalError { span, fault }))?;
        Ok(bits.cast_signed())
    }

    /// The machine has the product of integers of 24 bits.
    fn multiplies_integers(&self) -> bool {
        self.forms
            .get(PRODUCT, 2)
            .iter()
            .any(|meaning| !self.context.machine.hosts(meaning.op.row().function).is_empty())
    }

    /// Multiplies modulo 2³², from parts of 16 bits; of the product of the upper parts nothing is left. A constant of 24 bits stays whole.
    fn product(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        factors: [&Term; 2],
        span: Span,
    ) -> Result<RegisterId, ErrorReported> {
        let int = |register| Term { form: TermForm::Register(register, Kind::Int), span };
        let multiply = |resolver: &mut Self, line: &mut CurrentEquation, a, b| {
            let here = (span, ExprId { first: 0, count: 0 });
            match resolver.operate(at, line, PRODUCT, &[int(a), int(b)], here, Kind::Int)?.form {
                TermForm::Register(register, _) => Ok(register),
                _ => Err(ErrorReported),
            }
        };
        let mut parts = [[RegisterId::ZERO; 2]; 2];
        let shift = self.pooled(PART.0, span);
        for (parts, factor) in parts.iter_mut().zip(factors) {
            *parts = match factor.form {
                TermForm::Register(register, _) => {
                    let mask = self.pooled(PART.1, span);
                    let low = self.integer_operation(at, line, Operator::And, [register, mask], span)?;
                    [low, self.integer_operation(at, line, Operator::Shr, [register, shift], span)?]
                }
                TermForm::Constant(value, _) => {
                    let word = self.word_of(at, value, factor.span)?;
                    let (low, high) = match WHOLE.contains(&word) {
                        true => (word, 0),
                        false => (word & PART.1 as i32, word >> PART.0),
                    };
                    [low, high].map(|part| self.pooled(part.cast_unsigned(), span))
                }
                TermForm::Chain(..) | TermForm::Counted(_) => return Err(ErrorReported),
            };
        }
        let [[a_low, a_high], [b_low, b_high]] = parts;
        let low = multiply(self, line, a_low, b_low)?;
        let mut upper: Option<RegisterId> = None;
        for (a, b) in [(a_high, b_low), (a_low, b_high)] {
            if a == RegisterId::ZERO || b == RegisterId::ZERO {
                continue;
            }
            let part = multiply(self, line, a, b)?;
            upper = Some(match upper {
                Some(upper) => self.integer_operation(at, line, Operator::Add, [upper, part], span)?,
                None => part,
            });
        }
        let Some(upper) = upper else { return Ok(low) };
        let upper = self.integer_operation(at, line, Operator::Shl, [upper, shift], span)?;
        self.integer_operation(at, line, Operator::Add, [low, upper], span)
    }

    /// Multiplies a register by a constant.
    pub(super) fn scaled(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        register: RegisterId,
        factor: i64,
        span: Span,
    ) -> Result<RegisterId, ErrorReported> {
        let mut digits = digits(factor);
        // Positive digits come first, so that there is a value to subtract from.
        digits.sort_by_key(|(bit, negative)| (*negative, *bit));
        let mut sum: Option<RegisterId> = None;
        for (bit, negative) in digits {
            let part = match bit {
                0 => register,
                bit => {
                    let by = self.pooled(bit, span);
                    self.integer_operation(at, line, Operator::Shl, [register, by], span)?
                }
            };
            sum = Some(match (sum, negative) {
                (None, false) => part,
                (None, true) => {
                    self.integer_operation(at, line, Operator::Sub, [RegisterId::ZERO, part], span)?
                }
                (Some(sum), false) => self.integer_operation(at, line, Operator::Add, [sum, part], span)?,
                (Some(sum), true) => self.integer_operation(at, line, Operator::Sub, [sum, part], span)?,
            });
        }
        Ok(sum.unwrap_or(RegisterId::ZERO))
    }

    /// A quotient or a remainder by a power of two or its negative, truncated. A sum without a branch moves a negative dividend to
    /// the next multiple towards zero.
    fn by_power(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        operator: Operator,
        register: RegisterId,
        divisor: i32,
        (span, id): LineExpression,
    ) -> Result<Term, ErrorReported> {
        let power = divisor.unsigned_abs().trailing_zeros();
        let term = |register| Term { form: TermForm::Register(register, Kind::Int), span };
        if power == 0 && operator == Operator::Rem {
            return Ok(Term { form: TermForm::Constant(Value::Int(0), id), span });
        }
        let mut quotient = register;
        if power > 0 {
            let (sign, shift) = (self.pooled(31, span), self.pooled(power, span));
            let mask = self.pooled((1 << power) - 1, span);
            let negative = self.integer_operation(at, line, Operator::Shr, [register, sign], span)?;
            let bias = self.integer_operation(at, line, Operator::And, [negative, mask], span)?;
            let biased = self.integer_operation(at, line, Operator::Add, [register, bias], span)?;
            if operator == Operator::Rem {
                let low = self.integer_operation(at, line, Operator::And, [biased, mask], span)?;
                return self.integer_operation(at, line, Operator::Sub, [low, bias], span).map(term);
            }
            quotient = self.integer_operation(at, line, Operator::Shr, [biased, shift], span)?;
        }
        if divisor < 0 {
            let zero = RegisterId::ZERO;
            quotient = self.integer_operation(at, line, Operator::Sub, [zero, quotient], span)?;
        }
        Ok(term(quotient))
    }

    /// Rejects a quotient or remainder that the index of a loop decides, in an iteration that is written out, if the machine would find
    /// another one: the same line must not mean two things.
    pub(super) fn same_at_run_time(
        &mut self,
        at: AstPlace,
        operator: Operator,
        operands: (Value, Value),
        nodes: &[Node],
        span: Span,
    ) -> Result<(), ErrorReported> {
        let (Value::Int(a), Value::Int(b)) = operands else { return Ok(()) };
        let Some(rest) = a.checked_rem(b).filter(|rest| *rest != 0) else { return Ok(()) };
        let differs = match operator {
            Operator::Rem => (rest < 0) != (b < 0),
            // By other divisors the machine computes no quotient.
            Operator::Div => b.unsigned_abs().is_power_of_two(),
            _ => false,
        };
        if !differs {
            return Ok(());
        }
        let mut names = nodes.iter().filter_map(|node| match node.kind {
            NodeKind::Name(name) => name.resolve().ok(),
            _ => None,
        });
        let Some(index) = names.find(|name| self.context.is_known_index(at.scope, *name)) else {
            return Ok(());
        };
        let index = self.context.scopes.text(index).to_owned();
        let place = format!("in an iteration of the loop over `{index}` that is written out");
        let two = |at_run_time: i64, exact: Value| {
            let text = operator.text();
            format!(
                "{a} {text} {b} is {at_run_time} where the program computes it, and {exact} where the assembler does"
            )
        };
        let error = match operator {
            Operator::Rem => {
                Diagnostic::error("equation", span, format!("`%` of a negative number, {place}"))
                    .note(two(rest, Value::Int(rest + b)))
                    .help(format!("add a multiple of {b} to the dividend, so that it is never negative"))
            }
            _ => Diagnostic::error("equation", span, format!("`/` of numbers that do not divide, {place}"))
                .note(two(a / b, Value::Real(a as f64 / b as f64)))
                .help(format!(
                    "`>> {}` gives the integer below the quotient, `itof(a)/{b}.0` the float",
                    b.unsigned_abs().trailing_zeros()
                )),
        };
        Err(self.context.report(at.scope, error))
    }

    fn no_quotient(&mut self, at: AstPlace, operator: Operator, terms: &[Term], span: Span) -> ErrorReported {
        let text = |term: &Term| self.context.reports.sources.text(term.span).to_owned();
        let (a, b) = (text(&terms[0]), text(&terms[1]));
        let as_float = |term: &Term, text: &str| match term.value() {
            Some(_) => text.to_owned(),
            None => format!("itof({text})"),
        };
        let quotient = format!("`quotient({a}, {b})` of `<c.s>`, truncated");
        let (a, b) = (as_float(&terms[0], &a), as_float(&terms[1], &b));
        let message = format!("`{}` of integers needs a constant power of two on its right", operator.text());
        let help = match operator {
            Operator::Rem => format!("for floats, `fmod({a}, {b})` of `<math.s>` computes remainders"),
            _ => format!(
                "`{a}/{b}` is the quotient as a float; `ftoi` rounds it, and `trunc` of `<math.s>` cuts it off"
            ),
        };
        let exact =
            format!("of any integers: {quotient}; the rest is what its product with the divisor leaves");
        self.context.report(at.scope, Diagnostic::error("equation", span, message).note(exact).help(help))
    }
}

#[cfg(test)]
mod tests {
    use super::digits;

    #[test]
    fn digits_add_up_to_the_factor() {
        let all = (-2000..2000).chain([i64::from(i32::MIN), i64::from(i32::MAX), 0x5555_5555, -0x5555_5555]);
        for factor in all {
            let part = |(bit, negative): (u32, bool)| if negative { -(1i64 << bit) } else { 1 << bit };
            let sum: i64 = digits(factor).into_iter().map(part).sum();
            assert_eq!(sum as u32, factor as u32, "{factor}");
            assert!(digits(factor).len() <= 16, "{factor}");
        }
    }
}
