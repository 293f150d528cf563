// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tree-height reduction of sums and products, and division by constants as multiplication, where `.fast` allows it. A part of
//! [`expression`](crate::resolve::expression).
//!
//! A sum of several terms is kept as a list of terms, and a product as a list of factors, until the value is needed. Then
//! neighbours are paired until one is left, so that n terms make a dependence chain of ⌈log₂ n⌉ operations.

use crate::context::{AstPlace, ErrorReported};
use crate::ir::type_evidence::Kind;
use crate::resolve::Resolver;
use crate::resolve::term::{Chain, CurrentEquation, LineExpression, Term, TermForm};
use takt_syntax::ast::{ExprId, Operator};
use takt_syntax::expr::{self, Value};

impl Resolver<'_> {
    /// Applies a symbol by a transformation that `.fast` allows; `None` if none applies.
    pub(super) fn fast(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        symbol: &str,
        terms: &[Term],
        here: LineExpression,
    ) -> Result<Option<Term>, ErrorReported> {
        let [a, b] = terms else { return Ok(None) };
        let (sum, difference) = (Operator::Add.text(), Operator::Sub.text());
        let product = Operator::Mul.text();
        if line.fast.reciprocal
            && symbol == Operator::Div.text()
            && a.kind() != Some(Kind::Int)
            && let TermForm::Constant(divisor, id) = b.form
        {
            let inverse = 1.0 / divisor.real();
            if (inverse as f32).is_normal() {
                let factor = Term { form: TermForm::Constant(Value::Real(inverse), id), span: b.span };
                return self.apply(at, line, product, &[*a, factor], here, Kind::None).map(Some);
            }
        }
        let is_product = symbol == product;
        if !line.fast.reassociate || !(is_product || symbol == sum || symbol == difference) {
            return Ok(None);
        }
        let kinds = [a.kind(), b.kind()];
        let kind = kinds.into_iter().flatten().fold(Kind::None, Kind::join);
        let fits = self.forms.get(symbol, 2).iter().any(|meaning| self.fits(meaning, terms));
        if !fits || !matches!(kind, Kind::Float | Kind::Int) {
            return Ok(None);
        }
        let mut all = self.flattened(at, line, *a, is_product)?;
        let more = self.flattened(at, line, *b, is_product)?;
        all.extend(more.into_iter().map(|(term, negative)| (term, negative != (symbol == difference))));
        line.chains.push(Chain { is_product, terms: all });
        let form = TermForm::Chain(line.chains.len() - 1, kind);
        Ok(Some(Term { form, span: here.0 }))
    }

    /// The terms or factors of a value; the value itself if it is computed already, or by another operator.
    fn flattened(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        term: Term,
        is_product: bool,
    ) -> Result<Vec<(Term, bool)>, ErrorReported> {
        if let TermForm::Chain(index, _) = term.form
            && line.chains[index].is_product == is_product
        {
            // Every value is used once, so the chain is not needed again.
            return Ok(std::mem::take(&mut line.chains[index].terms));
        }
        Ok(vec![(self.settled(at, line, term)?, false)])
    }

    /// Computes a value that is still a chain or a function of indices.
    pub(super) fn settled(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        term: Term,
    ) -> Result<Term, ErrorReported> {
        if let TermForm::Counted(index) = term.form {
            let form = self.counted_form(at, line, index)?;
            return Ok(Term { form, ..term });
        }
        let TermForm::Chain(index, _) = term.form else { return Ok(term) };
        let Chain { is_product, terms } = line.chains[index].clone();
        let (constants, mut left): (Vec<_>, Vec<_>) =
            terms.into_iter().partition(|(term, _)| term.value().is_some());
        let mut folded: Option<(Value, Term)> = None;
        for (constant, negative) in constants {
            let (value, id) = match constant.form {
                TermForm::Constant(value, id) => (value, id),
                _ => continue,
            };
            let value = match (folded, is_product, negative) {
                (None, _, false) => Ok(value),
                (None, _, true) => expr::prefix(Operator::Sub, value),
                (Some((before, _)), true, _) => expr::infix(Operator::Mul, before, value),
                (Some((before, _)), false, false) => expr::infix(Operator::Add, before, value),
                (Some((before, _)), false, true) => expr::infix(Operator::Sub, before, value),
            };
            let value = self.folded(at, value, term.span)?;
            folded = Some((value, Term { form: TermForm::Constant(value, id), span: constant.span }));
        }
        left.extend(folded.map(|(_, constant)| (constant, false)));
        let here = (term.span, ExprId { first: 0, count: 0 });
        while left.len() > 1 {
            let mut next = Vec::with_capacity(left.len().div_ceil(2));
            for pair in left.chunks(2) {
                next.push(match *pair {
                    [(a, minus_a), (b, minus_b)] => {
                        let (symbol, terms, negative) = match (is_product, minus_a, minus_b) {
                            (true, ..) => (Operator::Mul, [a, b], false),
                            (false, true, false) => (Operator::Sub, [b, a], false),
                            (false, false, true) => (Operator::Sub, [a, b], false),
                            (false, both, _) => (Operator::Add, [a, b], both),
                        };
                        (self.operate(at, line, symbol.text(), &terms, here, Kind::None)?, negative)
                    }
                    [one] => one,
                    _ => continue,
                });
            }
            left = next;
        }
        match left[..] {
            [(value, false)] => Ok(Term { span: term.span, ..value }),
            [(value, true)] => self.operate(at, line, Operator::Sub.text(), &[value], here, Kind::None),
            _ => Err(ErrorReported),
        }
    }
}
