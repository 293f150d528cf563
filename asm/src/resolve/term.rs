// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operands of equations, and the state of the equation being compiled.

use crate::expand::Fast;
use crate::expand::equation::Results;
use crate::ir::arrays::Affine;
use crate::ir::type_evidence::Kind;
use crate::ir::{Attribution, RegisterId};
use crate::resolve::common_subexpressions::Key;
use takt_diagnostics::source::Span;
use takt_syntax::ast::ExprId;
use takt_syntax::expr::Value;

/// The current part of a line, and its expression.
pub(super) type LineExpression = (Span, ExprId);

/// The form of an operand in an equation.
#[derive(Clone, Copy, Debug)]
pub(super) enum TermForm {
    /// A constant, and its expression.
    Constant(Value, ExprId),
    /// A register and its type, if known.
    Register(RegisterId, Kind),
    /// A sum or a product that is still to be computed: its index in the line, and its type.
    Chain(usize, Kind),
    /// An affine function of the indices of loops at run time: its index in the line.
    Counted(usize),
}

/// An operand in an equation, and its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    pub(super) form: TermForm,
    pub(super) span: Span,
}

impl Term {
    pub(super) fn value(&self) -> Option<Value> {
        match self.form {
            TermForm::Constant(value, _) => Some(value),
            TermForm::Register(..) | TermForm::Chain(..) | TermForm::Counted(_) => None,
        }
    }

    pub(super) fn kind(&self) -> Option<Kind> {
        match self.form {
            TermForm::Register(_, kind) | TermForm::Chain(_, kind) => Some(kind),
            TermForm::Counted(_) => Some(Kind::Int),
            TermForm::Constant(..) => None,
        }
    }
}

/// The equation being compiled.
pub(super) struct CurrentEquation {
    pub(super) location: Attribution,
    pub(super) scheduled: bool,
    /// The subexpressions computed so far: register, bundle, and key.
    pub(super) computed: Vec<(RegisterId, usize, Key)>,
    pub(super) results: Results,
    /// The transformations that `.fast` allows.
    pub(super) fast: Fast,
    /// Sums and products that are not computed yet.
    pub(super) chains: Vec<Chain>,
    /// Affine functions of the indices of loops.
    pub(super) counted: Vec<Affine>,
}

impl CurrentEquation {
    /// An equation on a line, given its attribution and whether it is scheduled.
    pub(super) fn new((location, scheduled): (Attribution, bool)) -> CurrentEquation {
        let (results, fast) = (Results::default(), Fast::default());
        let (computed, chains, counted) = (Vec::new(), Vec::new(), Vec::new());
        CurrentEquation { location, scheduled, computed, results, fast, chains, counted }
    }
}

/// A sum or a product that is not computed yet.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) is_product: bool,
    /// Terms, each with a flag that is true if it is subtracted; or factors.
    pub(super) terms: Vec<(Term, bool)>,
}
