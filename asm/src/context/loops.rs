// SPDX-License-Identifier: MIT OR Apache-2.0
//! Counted loops as the source has them: what their indices stand for, and between which values an affine function of these lies
//! over all iterations.

use crate::context::{At, Binding, Context, Reported, ScopeId, ScopeKind};
use crate::ir::RegisterId;
use crate::ir::arrays::Affine;
use crate::report::diag::Diagnostic;
use crate::report::source::Span;
use crate::syntax::ast::*;
use crate::syntax::expr::{self, EvalError, Fault, Value};
use crate::syntax::name::{NameId, NameRef};
use smallvec::SmallVec;

/// Points of an iteration space that are looked at one by one.
const POINTS: u32 = 1 << 18;

/// A counted loop of [`Declared::loops`](crate::context::Declared::loops).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(crate) struct SourceLoopId(pub(crate) u32);

/// A loop that is counted when the program runs, as the source has it: an iteration is one of the source, however many of them the
/// assembler writes into one turn.
#[derive(Clone, Debug)]
pub(crate) struct SourceLoop {
    /// The most iterations that there can be, given the iterations of the loops around.
    pub(crate) most: Affine<SourceLoopId>,
}

/// An integer that the assembler knows up to the iteration numbers of the loops around.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Counted {
    /// As a function of the iterations that the source has.
    pub(crate) source: Affine<SourceLoopId>,
    /// As a function of the iterations that the program has.
    pub(crate) actual: Affine,
    /// Registers that are added, each times a factor: of a subscript that is known only when the program runs.
    pub(crate) registers: SmallVec<[(RegisterId, i64); 1]>,
}

impl Counted {
    pub(crate) fn constant(value: i64) -> Counted {
        Counted::new(Affine::constant(value), Affine::constant(value))
    }

    pub(crate) fn new(source: Affine<SourceLoopId>, actual: Affine) -> Counted {
        Counted { source, actual, registers: SmallVec::new() }
    }

    /// The sum with a multiple of another; `None` if a number leaves 64 bits.
    pub(crate) fn plus(&self, other: &Counted, factor: i64) -> Option<Counted> {
        let source = self.source.plus(&other.source, factor)?;
        let mut registers = self.registers.clone();
        for (register, coefficient) in &other.registers {
            registers.push((*register, coefficient.checked_mul(factor)?));
        }
        Some(Counted { source, actual: self.actual.plus(&other.actual, factor)?, registers })
    }

    /// Its value, if it depends on no iteration and no register.
    pub(crate) fn as_constant(&self) -> Option<i64> {
        self.source.as_constant().and(self.actual.as_constant()).filter(|_| self.registers.is_empty())
    }
}

/// What a name stands for that a counted loop counts with.
#[derive(Clone, Debug)]
pub(crate) struct Index {
    pub(crate) value: Counted,
    /// The loop, if the name is its index in the loop's body and not in what is left behind it.
    pub(crate) of: Option<SourceLoopId>,
    /// The `.for` or the sum.
    pub(crate) span: Span,
}

/// A value while an expression is computed.
pub(crate) enum Operand {
    Value(Value),
    Counted(Counted),
}

impl Operand {
    fn counted(self) -> Result<Counted, Fault> {
        match self {
            Operand::Value(value) => Ok(Counted::constant(value.integer()?)),
            Operand::Counted(counted) => Ok(counted),
        }
    }
}

impl Context {
    /// The value of an expression that may contain the indices of the loops around.
    pub(crate) fn counted(&mut self, at: At, expr: Expr) -> Result<Counted, Reported> {
        let ast = std::rc::Rc::clone(&self.asts[at.ast as usize]);
        self.counted_nodes(at, &ast.nodes[expr.id.range()], expr.span, false)
    }

    /// The value of a subscript, given as its nodes.
    pub(crate) fn subscript(&mut self, at: At, nodes: &[Node], span: Span) -> Result<Counted, Reported> {
        self.counted_nodes(at, nodes, span, true)
    }

    /// The value of an expression, given as its nodes; of one that may name registers, if `registers` is true.
    fn counted_nodes(
        &mut self,
        at: At,
        nodes: &[Node],
        span: Span,
        registers: bool,
    ) -> Result<Counted, Reported> {
        let mut stack: Vec<Operand> = Vec::with_capacity(4);
        for node in nodes {
            let operand = self.operand(at, node, &mut stack, registers)?;
            stack.push(operand);
        }
        let value = stack.pop().unwrap_or(Operand::Value(Value::Int(0)));
        value.counted().map_err(|fault| self.fault(at.scope, EvalError { span, fault }))
    }

    /// The value of a node, given those of its operands.
    fn operand(
        &mut self,
        at: At,
        node: &Node,
        stack: &mut Vec<Operand>,
        registers: bool,
    ) -> Result<Operand, Reported> {
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

    /// The value of a node one of whose operands depends on an iteration.
    fn affine(&mut self, at: At, node: &Node, operands: Vec<Operand>) -> Result<Operand, Reported> {
        let span = node.span;
        let fault = |context: &mut Context, fault| context.fault(at.scope, EvalError { span, fault });
        let mut counted = Vec::with_capacity(operands.len());
        for operand in operands {
            counted.push(operand.counted().map_err(|error| fault(self, error))?);
        }
        let overflow = Fault::IntegerOverflow("an index");
        let value = match (node.kind, &counted[..]) {
            (NodeKind::Prefix(Operator::Add), [a]) => Some(a.clone()),
            (NodeKind::Prefix(Operator::Sub), [a]) => Counted::constant(0).plus(a, -1),
            (NodeKind::Infix(Operator::Add), [a, b]) => a.plus(b, 1),
            (NodeKind::Infix(Operator::Sub), [a, b]) => a.plus(b, -1),
            (NodeKind::Infix(Operator::Mul), [a, b]) if b.as_constant().is_some() => {
                Counted::constant(0).plus(a, b.as_constant().unwrap_or(0))
            }
            (NodeKind::Infix(Operator::Mul), [a, b]) if a.as_constant().is_some() => {
                Counted::constant(0).plus(b, a.as_constant().unwrap_or(0))
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
        at: At,
        name: NameRef,
        span: Span,
        registers: bool,
    ) -> Result<Operand, Reported> {
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
                Ok(Operand::Counted(Counted { registers, ..Counted::constant(0) }))
            }
            _ => self.name_value(at.scope, name, span).map(Operand::Value),
        }
    }

    /// True if an expression names the index of a loop that runs.
    pub(crate) fn names_index(&self, at: At, id: ExprId) -> bool {
        self.asts[at.ast as usize].nodes[id.range()].iter().any(|node| match node.kind {
            NodeKind::Name(name) => name.resolve().is_ok_and(|name| self.is_index(at.scope, name)),
            _ => false,
        })
    }

    /// True if a name is the index of a loop that runs, or the argument of a macro that depends on one.
    pub(crate) fn is_index(&self, scope: ScopeId, name: NameId) -> bool {
        let mut binding = self.lookup(scope, name);
        for _ in 0..crate::limits::EVALUATION_DEPTH {
            let Binding::Argument(argument) = binding else { break };
            let argument = self.declared.arguments[argument as usize];
            match argument.operand.kind {
                OperandKind::Name(inner) => match inner.resolve() {
                    Ok(inner) => binding = self.lookup(argument.at.scope, inner),
                    Err(_) => return false,
                },
                OperandKind::Expr(id) => return self.names_index(argument.at, id),
                _ => return false,
            }
        }
        matches!(binding, Binding::Index(_))
    }

    /// The loops around a scope, outer ones first.
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

    /// The least and the largest value that a function has over all iterations of the loops around; `None` if there are none.
    ///
    /// # Errors
    /// If there are more than it looks at.
    pub(crate) fn extremes(
        &self,
        around: &[SourceLoopId],
        function: &Affine<SourceLoopId>,
    ) -> Result<Option<[i64; 2]>, TooMany> {
        let space = Space { context: self, around, function };
        space.extremes(&mut vec![0; around.len()], 0, &mut POINTS.clone())
    }
}

/// An iteration space has too many points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TooMany;

/// The iteration space of a nest of loops, and a function on it.
struct Space<'c> {
    context: &'c Context,
    around: &'c [SourceLoopId],
    function: &'c Affine<SourceLoopId>,
}

impl Space<'_> {
    /// The least and the largest value, given the iterations of the loops before `level`. Where the counts of inner loops depend on
    /// an iteration, its values are tried one by one.
    fn extremes(
        &self,
        at: &mut Vec<i64>,
        level: usize,
        points: &mut u32,
    ) -> Result<Option<[i64; 2]>, TooMany> {
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
            *points = points.checked_sub(1).ok_or(TooMany)?;
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
