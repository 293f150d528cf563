// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sums as loops: their bounds depend on the index of a loop at run time. A part of [`expression`](crate::resolve::expression).

use crate::context::loops::{AffineInteger, Index, IterationLimitExceeded, SourceLoop, SourceLoopId};
use crate::context::{AstPlace, ErrorReported, ScopeKind};
use crate::expand::equation::SUM;
use crate::expand::loops::{Count, Share};
use crate::ir::RegisterId;
use crate::ir::arrays::{Affine, LoopId};
use crate::ir::type_evidence::Kind;
use crate::limits;
use crate::resolve::Resolver;
use crate::resolve::loops::LoopStart;
use crate::resolve::term::{CurrentEquation, Term, TermForm};
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_syntax::ast::*;
use takt_syntax::expr::Value;
use takt_syntax::name::NameId;

/// A sum that is a loop, whose term is being computed.
pub(super) struct CountedSum {
    /// The place of the sum.
    at: AstPlace,
    id: LoopId,
    /// First bundle of the loop's setup, and the last one before its body.
    start: usize,
    setup: usize,
    /// The sum may have no terms.
    may_be_empty: bool,
    name: String,
    span: Span,
}

impl Resolver<'_> {
    /// Begins the loop of a sum; `None` if the sum never has terms.
    pub(super) fn begin_sum(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        variable: NameId,
        [first, last]: [Expr; 2],
        span: Span,
    ) -> Result<Option<(CountedSum, AstPlace)>, ErrorReported> {
        let beyond =
            |resolver: &mut Self| resolver.context.error(at.scope, "range", span, "a range beyond 64 bits");
        let first = self.context.counted(at, first)?;
        let last = self.context.counted(at, last)?;
        let count = last.plus(&first, -1).and_then(|count| count.plus(&AffineInteger::constant(1), 1));
        let count = count.ok_or_else(|| beyond(self))?;
        let around = self.context.loops_around(at.scope);
        let range = match self.context.extremes(&around, &count.source) {
            Ok(Some(range)) => range,
            Ok(None) => [0, 0],
            Err(IterationLimitExceeded) => {
                let message = "this nest has too many iterations for its subscripts to be checked";
                return Err(self.context.error(at.scope, "limit", span, message));
            }
        };
        if range[1] <= 0 {
            return Ok(None);
        }
        if range[1] > i64::from(limits::LOOP_COUNT) {
            let message = format!("a `{SUM}` of {} terms: a loop counts to {}", range[1], limits::LOOP_COUNT);
            return Err(self.context.report(at.scope, Diagnostic::error("range", span, message)));
        }
        let source = SourceLoopId(self.context.declared.loops.len() as u32);
        self.context.declared.loops.push(SourceLoop { most: count.source.clone() });
        let id = self.new_loop(span);
        let one = AffineInteger::new(Affine::iteration(source, 1), Affine::iteration(id, 1));
        let value = first.plus(&one, 1).ok_or_else(|| beyond(self))?;
        let start = self.ir.bundles.len();
        let name = self.context.scopes.text(variable).to_owned();
        let opened = LoopStart { variable: name.clone(), id, share: Share::All, range, span };
        self.begin_loop(at, line, &opened, &Count::Known(count.actual))?;
        let setup = self.ir.bundles.len() - 1;
        let index = self.context.declared.indices.len() as u32;
        self.context.declared.indices.push(Index { value, of: Some(source), span });
        let kind = ScopeKind::For(variable, index);
        let scope = self.context.scopes.open(at.scope, at.scope, kind, span);
        let sum = CountedSum { at, id, start, setup, may_be_empty: range[0] < 1, name, span };
        Ok(Some((sum, AstPlace { scope, ..at })))
    }

    /// Adds the term and ends the loop.
    pub(super) fn end_sum(
        &mut self,
        line: &mut CurrentEquation,
        sum: CountedSum,
        term: Term,
    ) -> Result<Term, ErrorReported> {
        let CountedSum { at, id, start, setup, may_be_empty, name, span } = sum;
        let term = self.settled(at, line, term)?;
        let kind = match term.form {
            TermForm::Register(_, Kind::None) => Kind::Float,
            TermForm::Register(_, kind) => kind,
            TermForm::Constant(Value::Int(_), _) => Kind::Int,
            _ => Kind::Float,
        };
        let ty = if kind == Kind::Int { Type::I } else { Type::F };
        let total = self.named_register(format!("{name}.sum"), ty, span);
        let here = (span, ExprId { first: 0, count: 0 });
        let so_far = Term { form: TermForm::Register(total, kind), span };
        self.operate(at, line, Operator::Add.text(), &[so_far, term], here, Kind::None)?;
        self.redirect(line, total);
        self.end_loop(at, line, id)?;
        // The start value must not change the first term: -0 for floats. A sum without terms is 0.
        let from = if ty == Type::I { 0.0f32 } else { -0.0 };
        self.set_before(at, line, total, from.to_bits(), setup, span)?;
        if may_be_empty {
            self.set_before(at, line, total, 0, start, span)?;
        }
        Ok(Term { form: TermForm::Register(total, kind), span })
    }

    /// Sets a register to a constant before an existing bundle.
    fn set_before(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        register: RegisterId,
        bits: u32,
        before: usize,
        span: Span,
    ) -> Result<(), ErrorReported> {
        let from = self.pooled(bits, span);
        let term = Term { form: TermForm::Register(from, Kind::Any), span };
        self.copy(at, line, term, Type::B, Some(register))?;
        self.defer(before);
        Ok(())
    }
}
