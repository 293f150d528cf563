// SPDX-License-Identifier: MIT OR Apache-2.0
//! Counted loops as the source has them: values of their indices, and bounds of affine functions of these over all iterations.

use crate::context::{AstPlace, Binding, Context, ErrorReported, ScopeId, ScopeKind};
use crate::ir::RegisterId;
use crate::ir::arrays::Affine;
use smallvec::SmallVec;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_syntax::ast::*;
use takt_syntax::expr::{self, EvalError, Fault, Value};
use takt_syntax::name::{NameId, NameRef};

/// Limit on the points of an iteration space that are enumerated.
const POINTS: u32 = 1 << 18;

/// A counted loop of [`Declarations::loops`](crate::context::Declarations::loops).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(crate) struct SourceLoopId(pub(crate) u32);

/// A loop that is counted when the program runs. Its iterations are the source's, even if the assembler writes several into one
/// turn.
#[derive(Clone, Debug)]
pub(crate) struct SourceLoop {
    /// Upper bound of the iterations, given the iterations of the enclosing loops.
    pub(crate) most: Affine<SourceLoopId>,
}

/// An integer that the assembler knows as a function of the iteration numbers of the enclosing loops.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct AffineInteger {
    /// The value as a function of the source's iterations.
    pub(crate) source: Affine<SourceLoopId>,
    /// The value as a function of the program's iterations.
    pub(crate) actual: Affine,
    /// Registers that are added, each times a factor, in a subscript that is known only when the program runs.
    pub(crate) registers: SmallVec<[(RegisterId, i64); 1]>,
}

impl AffineInteger {
    pub(crate) fn constant(value: i64) -> AffineInteger {
        AffineInteger::new(Affine::constant(value), Affine::constant(value))
    }

    pub(crate) fn new(source: Affine<SourceLoopId>, actual: Affine) -> AffineInteger {
        AffineInteger { source, actual, registers: SmallVec::new() }
    }

    /// The sum with a multiple of another; `None` if a number leaves 64 bits.
    pub(crate) fn plus(&self, other: &AffineInteger, factor: i64) -> Option<AffineInteger> {
        let source = self.source.plus(&other.source, factor)?;
        let mut registers = self.registers.clone();
        for (register, coefficient) in &other.registers {
            registers.push((*register, coefficient.checked_mul(factor)?));
        }
        Some(AffineInteger { source, actual: self.actual.plus(&other.actual, factor)?, registers })
    }

    /// The value, if it depends on no iteration and no register.
    pub(crate) fn as_constant(&self) -> Option<i64> {
        self.source.as_constant().and(self.actual.as_constant()).filter(|_| self.registers.is_empty())
    }
}

/// The index variable of a counted loop or a sum.
#[derive(Clone, Debug)]
pub(crate) struct Index {
    pub(crate) value: AffineInteger,
    /// The loop, while the name is its index in the loop's body; `None` in the iterations left over after it.
    pub(crate) of: Option<SourceLoopId>,
    /// Place of the `.for` or the sum.
    pub(crate) span: Span,
}

/// An operand during evaluation.
pub(crate) enum Operand {
    Value(Value),
    Counted(AffineInteger),
}

impl Operand {
    fn counted(self) -> Result<AffineInteger, Fault> {
        match self {
            Operand::Value(value) => Ok(AffineInteger::constant(value.integer()?)),
            Operand::Counted(counted) => Ok(counted),
        }
    }
}

impl Context {
    /// The value of an expression that may contain the indices of the enclosing loops.
    pub(crate) fn counted(&mut self, at: AstPlace, expr: Expr) -> Result<AffineInteger, ErrorReported> {
        let ast = std::rc::Rc::clone(&self.asts[at.ast as usize]);
        self.counted_nodes(at, &ast.nodes[expr.id.range()], expr.span, false)
    }

    /// The value of a subscript, given as its nodes.
    pub(crate) fn subscript(
        &mut self,
        at: AstPlace,
        nodes: &[Node],
        span: Span,
    ) -> Result<AffineInteger, ErrorReported> {
        self.counted_nodes(at, nodes, span, true)
    }

    /// The value of an expression, given as its nodes. It may name registers if `registers` is true.
    fn counted_nodes(
        &mut self,
        at: AstPlace,
        nodes: &[Node],
        span: Span,
        registers: bool,
    ) -> Result<AffineInteger, ErrorReported> {
        let mut stack: Vec<Operand> = Vec::with_capacity(4);
        for node in nodes {
            let operand = self.operand(at, node, &mut stack, registers)?;
            stack.push(operand);
        }
        let value = stack.pop().unwrap_or(Operand::Value(Value::Int(0)));
        value.counted().map_err(|fault| self.fault(at.scope, EvalError { span, fault }))
    }

    /// The value of a node; takes its operands from the stack.
    fn operand(
        &mut self,
        at: AstPlace,
        node: &Node,
        stack: &mut Vec<Operand>,
        registers: bool,
    ) -> Result<Operand, ErrorReported> {
        let span = node.span;
        let operands = match node.kind {
            NodeKind::Int(value) => return Ok(Operand::Value(Value::Int(value))),
            NodeKind::Real(value) => return Ok(Operand::Value(Value::Real(value))),
            NodeKind::Name(name) => return self.counted_name(at, name, span, registers),
            NodeKind::Element(_) | NodeKind::All | NodeKind::Range => {
                return Err(self.fault(at.scope, EvalError { span, fault: Fault::Element }));
            }
            NodeKind::Prefix(_) => 1,
            NodeKind::Infix(_) => 2,
            NodeKind::Choice => 3,
            NodeKind::Call(_, count) => count as usize,
        };
        let operands = stack.split_off(stack.len().saturating_sub(operands));
        let values: Option<Vec<Value>> = operands
            .iter()
            .map(|operand| match operand {
                Operand::Value(value) => Some(*value),
                Operand::Counted(_) => None,
            })
            .collect();
        let value = match (node.kind, values.as_deref()) {
            (NodeKind::Prefix(operator), Some([a])) => expr::prefix(operator, *a),
            (NodeKind::Infix(operator), Some([a, b])) => expr::infix(operator, *a, *b),
            (NodeKind::Choice, Some([condition, a, b])) => Ok(if condition.is_zero() { *b } else { *a }),
            (NodeKind::Call(name, _), Some(values)) => match name.function() {
                Some(function) => expr::call(function, values),
                None => Err(Fault::UnknownFunction(self.scopes.text(name).to_owned())),
            },
            _ => return self.affine(at, node, operands),
        };
        value.map(Operand::Value).map_err(|fault| self.fault(at.scope, EvalError { span, fault }))
    }

    /// The value of a node with an operand that depends on an iteration.
    fn affine(
        &mut self,
        at: AstPlace,
        node: &Node,
        operands: Vec<Operand>,
    ) -> Result<Operand, ErrorReported> {
        let span = node.span;
        let fault = |context: &mut Context, fault| context.fault(at.scope, EvalError { span, fault });
        let mut counted = Vec::with_capacity(operands.len());
        for operand in operands {
            counted.push(operand.counted().map_err(|error| fault(self, error))?);
        }
        let overflow = Fault::IntegerOverflow("an index");
        let value = match (node.kind, &counted[..]) {
            (NodeKind::Prefix(Operator::Add), [a]) => Some(a.clone()),
            (NodeKind::Prefix(Operator::Sub), [a]) => AffineInteger::constant(0).plus(a, -1),
            (NodeKind::Infix(Operator::Add), [a, b]) => a.plus(b, 1),
            (NodeKind::Infix(Operator::Sub), [a, b]) => a.plus(b, -1),
            (NodeKind::Infix(Operator::Mul), [a, b]) if b.as_constant().is_some() => {
                AffineInteger::constant(0).plus(a, b.as_constant().unwrap_or(0))
            }
            (NodeKind::Infix(Operator::Mul), [a, b]) if a.as_constant().is_some() => {
                AffineInteger::constant(0).plus(b, a.as_constant().unwrap_or(0))
            }
            _ => {
                let message = "this is not affine: an index or a register may be added, subtracted, and multiplied by a constant";
                let error = Diagnostic::error("index", span, message)
                    .help("compute it into an int register of its own, and write that: `x[n]`");
                return Err(self.report(at.scope, error));
            }
        };
        value.map(Operand::Counted).ok_or_else(|| fault(self, overflow))
    }

    /// The value of a name, which may be a loop's index.
    fn counted_name(
        &mut self,
        at: AstPlace,
        name: NameRef,
        span: Span,
        registers: bool,
    ) -> Result<Operand, ErrorReported> {
        let name = self.name(at, name, span)?;
        let mut binding = self.lookup(at.scope, name);
        // An argument may be an expression with the index of a loop around the macro's use.
        if let Binding::Argument(argument) = binding {
            let argument = self.declared.arguments[argument as usize];
            match argument.operand.kind {
                OperandKind::Name(inner) => {
                    let inner = self.name(argument.at, inner, argument.operand.span)?;
                    binding = self.lookup(argument.at.scope, inner);
                    if !matches!(binding, Binding::Index(_) | Binding::Register(_)) {
                        return self.name_value(at.scope, name, span).map(Operand::Value);
                    }
                }
                OperandKind::Expr(id) if self.names_index(argument.at, id) => {
                    let expr = Expr { id, span: argument.operand.span };
                    return self.counted(argument.at, expr).map(Operand::Counted);
                }
                _ => return self.name_value(at.scope, name, span).map(Operand::Value),
            }
        }
        match binding {
            Binding::Index(index) => {
                Ok(Operand::Counted(self.declared.indices[index as usize].value.clone()))
            }
            Binding::Register(RegisterId::ZERO) => Ok(Operand::Value(Value::Int(0))),
            Binding::Register(register) if registers => {
                let registers = SmallVec::from_elem((register, 1), 1);
                Ok(Operand::Counted(AffineInteger { registers, ..AffineInteger::constant(0) }))
            }
            _ => self.name_value(at.scope, name, span).map(Operand::Value),
        }
    }

    /// An expression names the index of a loop at run time.
    pub(crate) fn names_index(&self, at: AstPlace, id: ExprId) -> bool {
        self.depends(at, id, Context::is_index_itself)
    }

    fn is_index_itself(&self, scope: ScopeId, name: NameId) -> bool {
        matches!(self.lookup(scope, name), Binding::Index(_))
    }

    /// An expression names the index of a loop that is written out, or an argument of a macro that does.
    pub(crate) fn names_known_index(&self, at: AstPlace, id: ExprId) -> bool {
        self.depends(at, id, Context::is_known_index_itself)
    }

    /// A name is the index of a loop that is written out, or an argument of a macro that depends on such an index.
    pub(crate) fn is_known_index(&self, scope: ScopeId, name: NameId) -> bool {
        self.leads_to(scope, name, Context::is_known_index_itself)
    }

    fn is_known_index_itself(&self, scope: ScopeId, name: NameId) -> bool {
        self.scopes.is_loop_index(scope, name)
    }

    /// An expression has a name that leads to one of which `is` holds.
    fn depends(&self, at: AstPlace, id: ExprId, is: fn(&Context, ScopeId, NameId) -> bool) -> bool {
        self.asts[at.ast as usize].nodes[id.range()].iter().any(|node| match node.kind {
            NodeKind::Name(name) => name.resolve().is_ok_and(|name| self.leads_to(at.scope, name, is)),
            _ => false,
        })
    }

    /// `is` holds of a name, or of a name in the argument of a macro that it stands for.
    fn leads_to(
        &self,
        mut scope: ScopeId,
        mut name: NameId,
        is: fn(&Context, ScopeId, NameId) -> bool,
    ) -> bool {
        for _ in 0..crate::limits::EVALUATION_DEPTH {
            let Binding::Argument(argument) = self.lookup(scope, name) else { break };
            let argument = self.declared.arguments[argument as usize];
            match argument.operand.kind {
                OperandKind::Name(inner) => match inner.resolve() {
                    Ok(inner) => (scope, name) = (argument.at.scope, inner),
                    Err(_) => return false,
                },
                OperandKind::Expr(id) => return self.depends(argument.at, id, is),
                _ => return false,
            }
        }
        is(self, scope, name)
    }

    /// The loops that enclose a scope, outer ones first.
    pub(crate) fn loops_around(&self, scope: ScopeId) -> Vec<SourceLoopId> {
        let mut loops = Vec::new();
        let mut scope = *self.scopes.scope(scope);
        loop {
            match scope.kind {
                ScopeKind::Root => break,
                ScopeKind::For(_, index) => loops.extend(self.declared.indices[index as usize].of),
                ScopeKind::Macro(..) | ScopeKind::Rep(..) => {}
            }
            scope = *self.scopes.scope(scope.within);
        }
        loops.reverse();
        loops
    }

    /// The least and the largest value of a function over all iterations of the enclosing loops; `None` without any iteration.
    ///
    /// # Errors
    /// If the iteration space has more points than may be enumerated.
    pub(crate) fn extremes(
        &self,
        around: &[SourceLoopId],
        function: &Affine<SourceLoopId>,
    ) -> Result<Option<[i64; 2]>, IterationLimitExceeded> {
        let space = Space { context: self, around, function };
        space.extremes(&mut vec![0; around.len()], 0, &mut POINTS.clone())
    }
}

/// An iteration space has too many points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IterationLimitExceeded;

/// The iteration space of a nest of loops, and a function on it.
struct Space<'c> {
    context: &'c Context,
    around: &'c [SourceLoopId],
    function: &'c Affine<SourceLoopId>,
}

impl Space<'_> {
    /// The least and the largest value, given the iterations of the loops before `level`. An iteration on which the counts of inner
    /// loops depend is enumerated.
    fn extremes(
        &self,
        at: &mut Vec<i64>,
        level: usize,
        points: &mut u32,
    ) -> Result<Option<[i64; 2]>, IterationLimitExceeded> {
        let Some(&this) = self.around.get(level) else {
            let value = self.value(at, self.function);
            return Ok(Some([value, value]));
        };
        let count = self.value(at, self.most(this));
        if count <= 0 {
            return Ok(None);
        }
        let depends = |inner: &SourceLoopId| self.most(*inner).terms.iter().any(|term| term.0 == this);
        if !self.around[level + 1..].iter().any(depends) {
            at[level] = 0;
            let slope = self.function.terms.iter().find(|term| term.0 == this).map_or(0, |term| term.1);
            let last = slope.saturating_mul(count - 1);
            let inner = self.extremes(at, level + 1, points)?;
            return Ok(
                inner.map(|[low, high]| [low.saturating_add(last.min(0)), high.saturating_add(last.max(0))])
            );
        }
        let mut all: Option<[i64; 2]> = None;
        for iteration in 0..count {
            *points = points.checked_sub(1).ok_or(IterationLimitExceeded)?;
            at[level] = iteration;
            let Some([low, high]) = self.extremes(at, level + 1, points)? else { continue };
            all = Some(all.map_or([low, high], |[least, most]| [least.min(low), most.max(high)]));
        }
        at[level] = 0;
        Ok(all)
    }

    fn most(&self, of: SourceLoopId) -> &Affine<SourceLoopId> {
        &self.context.declared.loops[of.0 as usize].most
    }

    fn value(&self, at: &[i64], function: &Affine<SourceLoopId>) -> i64 {
        let mut value = function.constant;
        for (of, factor) in &function.terms {
            if let Some(level) = self.around.iter().position(|around| around == of) {
                value = value.saturating_add(factor.saturating_mul(at[level]));
            }
        }
        value
    }
}
