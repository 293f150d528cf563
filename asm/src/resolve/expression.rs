// SPDX-License-Identifier: MIT OR Apache-2.0
//! Computation of expressions in equations: a loop over nodes in postfix order, like the evaluation of constants
//! ([`expr::evaluate`](takt_syntax::expr::evaluate)), with a stack of values that are constants or registers. Constant parts are
//! folded on the way. If the condition of a choice is a constant, only the chosen alternative is computed.

use crate::context::{AstPlace, Binding, ErrorReported, NameRole, ScopeKind};
use crate::expand::equation::SUM;
use crate::ir::type_evidence::Kind;
use crate::ir::{RegisterId, RegisterKind};
use crate::limits;
use crate::resolve::Resolver;
use crate::resolve::elements::Place;
use crate::resolve::forms::Meaning;
use crate::resolve::sums::CountedSum;
use crate::resolve::term::{CurrentEquation, LineExpression, Term, TermForm};
use smallvec::SmallVec;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_syntax::ast::*;
use takt_syntax::expr::{self, EvalError, Value};
use takt_syntax::name::{NameId, NameRef};

/// Structure of an expression, found before it is computed.
struct Plan {
    /// By first node: the last node of a part that a macro has computed.
    results: HashMap<u32, u32>,
    /// By first node: the node of a sum.
    sums: HashMap<u32, u32>,
    /// By first node of a choice's first alternative: the choice.
    choices: HashMap<u32, u32>,
    /// Choices that are the value of the whole expression, or an alternative of such a choice.
    whole: HashSet<u32>,
    /// First node of the part that each node heads.
    parts: Vec<u32>,
}

/// A stretch of nodes being computed.
struct NodeRange {
    at: AstPlace,
    next: u32,
    end: u32,
    /// The stretch is an alternative of a choice that is already made.
    chosen: bool,
    sum: Option<SumState>,
    /// The term of a sum that is a loop.
    counted: Option<CountedSum>,
}

/// The state of a sum.
struct SumState {
    variable: NameId,
    value: i64,
    last: i64,
    outer: AstPlace,
    start: u32,
    node: u32,
    total: Option<Term>,
}

/// An expression being computed: its nodes, in postfix order, and the terms so far.
struct Computation<'c> {
    ast: &'c Rc<Ast>,
    id: ExprId,
    plan: Plan,
    stack: Vec<Term>,
    /// Stretches of nodes that are entered, the innermost last.
    stretches: Vec<NodeRange>,
}

impl Computation<'_> {
    fn node(&self, index: u32) -> Node {
        self.ast.nodes[self.id.range()][index as usize]
    }

    /// Place of the part that ends at a node.
    fn place(&self, index: u32) -> LineExpression {
        let first = self.plan.parts[index as usize];
        (self.node(index).span, ExprId { first: self.id.first + first, count: index - first + 1 })
    }

    /// Nodes of the part that ends at a node.
    fn part(&self, index: u32) -> &[Node] {
        &self.ast.nodes[self.place(index).1.range()]
    }

    /// A constant as the term of the part that ends at a node.
    fn constant(&self, value: Value, index: u32) -> Term {
        let (span, id) = self.place(index);
        Term { form: TermForm::Constant(value, id), span }
    }

    /// Terms of a node's operands.
    fn take(&mut self, count: usize) -> Vec<Term> {
        self.stack.split_off(self.stack.len().saturating_sub(count))
    }

    fn skip_to(&mut self, node: u32) {
        if let Some(stretch) = self.stretches.last_mut() {
            stretch.next = node;
        }
    }

    /// Enters the chosen branch of a choice with a constant condition; returns false if no such choice has its first branch here.
    fn choose(&mut self, index: u32) -> bool {
        let Some(stretch) = self.stretches.last_mut() else { return false };
        if std::mem::replace(&mut stretch.chosen, false) {
            return false;
        }
        let Some(&choice) = self.plan.choices.get(&index) else { return false };
        let Some(value) = self.stack.last().and_then(Term::value) else { return false };
        self.stack.pop();
        stretch.next = choice + 1;
        let operands = expr::operands(&self.plan.parts, choice);
        let (next, last) = operands[if value.is_zero() { 2 } else { 1 }];
        let at = stretch.at;
        self.stretches.push(NodeRange { at, next, end: last + 1, chosen: true, sum: None, counted: None });
        true
    }
}

impl Resolver<'_> {
    /// Analyses the structure of an expression before it is computed.
    fn plan(
        &mut self,
        at: AstPlace,
        line: &CurrentEquation,
        ast: &Ast,
        id: ExprId,
    ) -> Result<Plan, ErrorReported> {
        let nodes = &ast.nodes[id.range()];
        let parts = expr::parts(nodes);
        let (results, sums) = (HashMap::new(), HashMap::new());
        let (choices, whole) = (HashMap::new(), HashSet::new());
        let mut plan = Plan { results, sums, choices, whole, parts };
        let mut top = vec![nodes.len() as u32 - 1];
        while let Some(node) = top.pop() {
            if nodes[node as usize].kind == NodeKind::Choice {
                plan.whole.insert(node);
                let operands = expr::operands(&plan.parts, node);
                top.extend(operands[1..].iter().map(|(_, last)| *last));
            }
        }
        for (index, node) in (0..).zip(nodes) {
            let first = plan.parts[index as usize];
            match node.kind {
                NodeKind::Call(..) if line.results.contains_key(&(id.first + index)) => {
                    // If several parts begin at one node, the outermost counts.
                    plan.results.insert(first, index);
                }
                NodeKind::Call(name, count) if self.context.scopes.text(name) == SUM => {
                    let counts = matches!(nodes[first as usize].kind, NodeKind::Name(_));
                    if count != 4 || !counts {
                        let message =
                            format!("a `{SUM}` has an index, its first and its last value, and a term");
                        let error = Diagnostic::error("arguments", node.span, message)
                            .help(format!("write it as `{SUM}(i, 1, 4, a[i]*b[i])`"));
                        return Err(self.context.report(at.scope, error));
                    }
                    plan.sums.insert(first, index);
                }
                NodeKind::Choice => {
                    let operands = expr::operands(&plan.parts, index);
                    plan.choices.insert(operands[1].0, index);
                }
                _ => {}
            }
        }
        Ok(plan)
    }

    /// Computes an expression. `wanted` is the type of the target register, if it has one.
    pub(super) fn compute(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        ast: &Rc<Ast>,
        id: ExprId,
        wanted: Kind,
    ) -> Result<Term, ErrorReported> {
        let plan = self.plan(at, line, ast, id)?;
        let end = id.range().len() as u32;
        let whole = NodeRange { at, next: 0, end, chosen: false, sum: None, counted: None };
        let mut run = Computation { ast, id, plan, stack: Vec::with_capacity(8), stretches: vec![whole] };
        while let Some(&NodeRange { at, next: index, end, .. }) = run.stretches.last() {
            if index == end {
                self.end_stretch(line, &mut run)?;
                continue;
            }
            if run.choose(index) {
                continue;
            }
            if let Some(&call) = run.plan.results.get(&index)
                && let Some(&register) = line.results.get(&(id.first + call))
            {
                run.skip_to(call + 1);
                let form = TermForm::Register(register, self.kind(register));
                let span = run.node(call).span;
                run.stack.push(Term { form, span });
            } else if let Some(&sum) = run.plan.sums.get(&index) {
                run.skip_to(sum + 1);
                self.start_sum(at, line, &mut run, (index, sum))?;
            } else {
                run.skip_to(index + 1);
                if run.node(index).kind != NodeKind::Prefix(Operator::Add) {
                    let term = self.node_term(at, line, &mut run, index, wanted)?;
                    run.stack.push(term);
                }
            }
        }
        let value = run.stack.pop().ok_or(ErrorReported)?;
        self.settled(at, line, value)
    }

    /// Ends a stretch of nodes. For a sum, adds the term of this turn and begins the next turn.
    fn end_stretch(
        &mut self,
        line: &mut CurrentEquation,
        run: &mut Computation<'_>,
    ) -> Result<(), ErrorReported> {
        let Some(NodeRange { at, sum, counted, .. }) = run.stretches.pop() else { return Ok(()) };
        if let Some(sum) = counted {
            let term = run.stack.pop().ok_or(ErrorReported)?;
            let total = self.end_sum(line, sum, term)?;
            run.stack.push(total);
            return Ok(());
        }
        let Some(turns) = sum else { return Ok(()) };
        let span = run.node(turns.node).span;
        let term = run.stack.pop().ok_or(ErrorReported)?;
        let total = match turns.total {
            None => term,
            Some(total) => match (total.value(), term.value()) {
                (Some(a), Some(b)) => {
                    let value = self.folded(at, expr::infix(Operator::Add, a, b), span)?;
                    run.constant(value, turns.node)
                }
                _ => {
                    let (symbol, here) = (Operator::Add.text(), run.place(turns.node));
                    self.apply(at, line, symbol, &[total, term], here, Kind::None)?
                }
            },
        };
        if turns.value == turns.last {
            run.stack.push(Term { span, ..total });
            return Ok(());
        }
        let value = turns.value + 1;
        let next = self.turn(SumState { value, total: Some(total), ..turns }, span)?;
        run.stretches.push(next);
        Ok(())
    }

    /// Begins a sum, given its first node and its call: as a counted loop, or one turn at a time.
    fn start_sum(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        run: &mut Computation<'_>,
        (index, sum): (u32, u32),
    ) -> Result<(), ErrorReported> {
        let operands = expr::operands(&run.plan.parts, sum);
        let expression = |(first, last): (u32, u32)| Expr {
            id: ExprId { first: run.id.first + first, count: last - first + 1 },
            span: run.node(last).span,
        };
        let NodeKind::Name(variable) = run.node(index).kind else { return Err(ErrorReported) };
        let counts = run.node(index).span;
        let variable = self.context.spelled(at, variable, counts)?;
        let span = run.node(sum).span;
        if let Some(notes) = &mut self.context.notes {
            notes.sum(span, counts, variable);
        }
        let bounds = [expression(operands[1]), expression(operands[2])];
        let start = operands[3].0;
        if bounds.iter().any(|bound| self.context.names_index(at, bound.id)) {
            match self.begin_sum(at, line, variable, bounds, span)? {
                Some((counted, at)) => run.stretches.push(NodeRange {
                    at,
                    next: start,
                    end: sum,
                    chosen: false,
                    sum: None,
                    counted: Some(counted),
                }),
                None => run.stack.push(run.constant(Value::Int(0), sum)),
            }
            return Ok(());
        }
        let from = self.context.integer(at, bounds[0])?;
        let last = self.context.integer(at, bounds[1])?;
        if from > last {
            run.stack.push(run.constant(Value::Int(0), sum));
            return Ok(());
        }
        let turns = SumState { variable, value: from, last, outer: at, start, node: sum, total: None };
        let first = self.turn(turns, span)?;
        run.stretches.push(first);
        Ok(())
    }

    /// Computes a node from the terms of its operands, which it takes from the stack.
    fn node_term(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        run: &mut Computation<'_>,
        index: u32,
        wanted: Kind,
    ) -> Result<Term, ErrorReported> {
        let (node, here) = (run.node(index), run.place(index));
        let span = node.span;
        let folded = match node.kind {
            NodeKind::Int(value) => Ok(Value::Int(value)),
            NodeKind::Real(value) => Ok(Value::Real(value)),
            NodeKind::Name(name) => return self.name(at, line, name, here),
            NodeKind::All | NodeKind::Range => return Err(ErrorReported),
            NodeKind::Element(element) => {
                let Element { name, indices } = &run.ast.elements[element as usize];
                let (register, kind) = match self.element_place(at, *name, indices, span)? {
                    Place::Register(register) => (register, self.kind(register)),
                    // The register may be the one that an element was stored from, such as a constant's, which has no type of its own.
                    Place::Word(word) => {
                        (self.load(at, line, &word, span)?, Kind::of(self.element_type(&word)))
                    }
                };
                return Ok(Term { form: TermForm::Register(register, kind), span });
            }
            NodeKind::Prefix(operator) => {
                let terms = run.take(1);
                match terms[..] {
                    [Term { form: TermForm::Constant(value, _), .. }] => expr::prefix(operator, value),
                    _ => return self.operator_term(at, line, operator, &terms, here),
                }
            }
            NodeKind::Infix(operator) => {
                let terms = run.take(2);
                match (terms[0].value(), terms[1].value()) {
                    (Some(a), Some(b)) => {
                        if self.context.names_known_index(at, here.1) {
                            let words = (a.word(), b.word());
                            self.same_at_run_time(at, operator, words, run.part(index), span)?;
                            expr::infix_of_words(operator, a, b)
                        } else {
                            expr::infix(operator, a, b)
                        }
                    }
                    _ => return self.operator_term(at, line, operator, &terms, here),
                }
            }
            NodeKind::Choice => {
                let terms = run.take(3);
                let wanted = if run.plan.whole.contains(&index) { wanted } else { Kind::Any };
                return self.apply(at, line, "?:", &terms, here, wanted);
            }
            NodeKind::Call(name, count) => {
                let terms = run.take(count as usize);
                let values: Option<Vec<Value>> = terms.iter().map(Term::value).collect();
                match (name.function(), values) {
                    (Some(function), Some(values)) => expr::call(function, &values),
                    _ => return self.function(at, line, name, &terms, here),
                }
            }
        };
        let value = self.folded(at, folded, span)?;
        Ok(run.constant(value, index))
    }

    /// An operation on terms that are not all constant: on indices of counted loops, or on registers.
    fn operator_term(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        operator: Operator,
        terms: &[Term],
        here: LineExpression,
    ) -> Result<Term, ErrorReported> {
        match self.counted_operation(line, operator, terms) {
            Some(form) => Ok(Term { form, span: here.0 }),
            None => self.apply(at, line, operator.text(), terms, here, Kind::None),
        }
    }

    pub(super) fn folded(
        &mut self,
        at: AstPlace,
        value: Result<Value, expr::Fault>,
        span: Span,
    ) -> Result<Value, ErrorReported> {
        value.map_err(|fault| self.context.fault(at.scope, EvalError { span, fault }))
    }

    /// The next turn of a sum.
    fn turn(&mut self, turns: SumState, span: Span) -> Result<NodeRange, ErrorReported> {
        self.turns += 1;
        if self.turns > limits::STATEMENTS {
            let message = format!("sums of more than {} turns in all", limits::STATEMENTS);
            return Err(self.context.error(turns.outer.scope, "limit", span, message));
        }
        let outer = turns.outer;
        let kind = ScopeKind::Rep(turns.variable, turns.value);
        let scope = self.context.scopes.open(outer.scope, outer.scope, kind, span);
        let (next, end) = (turns.start, turns.node);
        Ok(NodeRange {
            at: AstPlace { scope, ..outer },
            next,
            end,
            chosen: false,
            sum: Some(turns),
            counted: None,
        })
    }

    /// The operand that a name denotes.
    fn name(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        name: NameRef,
        (span, id): LineExpression,
    ) -> Result<Term, ErrorReported> {
        (self.cast, self.asked) = (None, None);
        let (place, given, meaning) = self.meaning(at, Operand { kind: OperandKind::Name(name), span })?;
        let register = |resolver: &Self, register| {
            let taken = resolver.cast.or(resolver.type_of_parameter());
            let kind = taken.map_or_else(|| resolver.kind(register), Kind::of);
            Term { form: TermForm::Register(register, kind), span }
        };
        match (given.kind, meaning) {
            (_, Some((_, Binding::Register(RegisterId::ZERO)))) => {
                Ok(Term { form: TermForm::Constant(Value::Int(0), id), span })
            }
            (_, Some((_, Binding::Register(found)))) => {
                self.check_register(found)?;
                Ok(register(self, found))
            }
            (_, Some((_, Binding::Word(word)))) => {
                let word = self.words[word as usize].clone();
                self.check_argument(Kind::of(self.element_type(&word)))?;
                let asked = self.asked;
                let loaded = self.load(at, line, &word, span)?;
                self.asked = asked;
                let taken = self.cast.or(self.type_of_parameter());
                let kind = Kind::of(taken.unwrap_or_else(|| self.element_type(&word)));
                Ok(Term { form: TermForm::Register(loaded, kind), span })
            }
            (_, Some((_, Binding::Index(index)))) => {
                self.check_argument(Kind::Int)?;
                let function = self.context.declared.indices[index as usize].value.actual.clone();
                line.counted.push(function);
                Ok(Term { form: TermForm::Counted(line.counted.len() - 1), span })
            }
            (_, Some((name, Binding::None))) => {
                Err(self.context.unknown(place.scope, name, given.span, NameRole::Source))
            }
            (OperandKind::Place(_), _) => {
                let found = self.source(place, given, Type::B)?;
                Ok(register(self, found))
            }
            (OperandKind::Memory(_), _) => {
                let error = Diagnostic::error("operand", span, "a word of memory in an equation")
                    .also(given.span, "it is the argument")
                    .help("load it into a register with `ld` first");
                Err(self.context.report(at.scope, error))
            }
            (OperandKind::Expr(expr), _) => {
                let value = self.context.equation_value(place, expr)?;
                let value = self.value_of_parameter_type(value, span)?;
                Ok(Term { form: TermForm::Constant(value, id), span })
            }
            (_, Some((name, binding))) => {
                self.check_address_of(binding)?;
                let value = self.context.name_value(place.scope, name, given.span)?;
                let value = self.value_of_parameter_type(value, span)?;
                Ok(Term { form: TermForm::Constant(value, id), span })
            }
            _ => Err(self.context.error(at.scope, "operand", span, "this has no value")),
        }
    }

    /// Computes a call of a function.
    fn function(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        name: NameId,
        terms: &[Term],
        here: LineExpression,
    ) -> Result<Term, ErrorReported> {
        let text = self.context.scopes.text(name).to_owned();
        // Least or greatest of several values.
        let takes_any = name.function().is_some_and(|function| function.arguments() == 0);
        if let [first, rest @ ..] = terms
            && takes_any
            && terms.len() != 2
        {
            return rest.iter().try_fold(*first, |least, term| {
                self.apply(at, line, &text, &[least, *term], here, Kind::None)
            });
        }
        self.apply(at, line, &text, terms, here, Kind::None)
    }

    /// Applies an operator or function to terms: the instruction that has this form for the terms' types.
    pub(super) fn apply(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        symbol: &str,
        terms: &[Term],
        here: LineExpression,
        wanted: Kind,
    ) -> Result<Term, ErrorReported> {
        if let Some(term) = self.fast(at, line, symbol, terms, here)? {
            return Ok(term);
        }
        let mut settled: SmallVec<[Term; 3]> = SmallVec::new();
        for term in terms {
            settled.push(self.settled(at, line, *term)?);
        }
        self.operate(at, line, symbol, &settled, here, wanted)
    }

    /// Applies an operator or function to settled terms, without the transformations of `.fast`.
    pub(super) fn operate(
        &mut self,
        at: AstPlace,
        line: &mut CurrentEquation,
        symbol: &str,
        terms: &[Term],
        here: LineExpression,
        wanted: Kind,
    ) -> Result<Term, ErrorReported> {
        if let Some(term) = self.integers(at, line, symbol, terms, here)? {
            return Ok(term);
        }
        let fitting: Vec<Meaning> = self
            .forms
            .get(symbol, terms.len())
            .iter()
            .filter(|meaning| self.fits(meaning, terms))
            .cloned()
            .collect();
        // If the terms leave the type open, as constants do, it is float.
        let is_float = |meaning: &&Meaning| meaning.op.row().types.contains(&Type::F);
        let is_int =
            terms.iter().all(|term| term.value().is_some_and(|value| matches!(value, Value::Int(_))));
        let found = match is_int {
            true => fitting.iter().find(|meaning| !is_float(meaning)),
            false => fitting.iter().find(is_float),
        };
        let Some(Meaning { op, sources }) = found.or(fitting.first()) else {
            // A comparison may be computed as the negation of its opposite.
            if let Some(opposite) = opposite(symbol)
                && self.forms.get(opposite, terms.len()).iter().any(|meaning| self.fits(meaning, terms))
            {
                let term = self.operate(at, line, opposite, terms, here, Kind::None)?;
                return self.operate(at, line, Operator::Not.text(), &[term], here, Kind::None);
            }
            return Err(self.no_form(at, symbol, terms, here.0));
        };
        let (op, row) = (*op, op.row());
        let slots = self.hosting(at, op, None, self.symbol_span(symbol, terms, here.0))?;
        // Constants whose bits the instruction passes on have the type of the other alternatives.
        let passed = self.forms.passed(op).to_vec();
        let among = |which: &usize| passed.is_empty() || passed.contains(which);
        let mut kind = Kind::None;
        for (term, _) in terms.iter().zip(sources).filter(|(_, which)| among(which)) {
            kind = kind.join(term.kind().unwrap_or(Kind::None));
        }
        let is_real = |term: &Term| matches!(term.value(), Some(Value::Real(_)));
        let open = match (kind, wanted) {
            (Kind::Float, _) => Type::F,
            (Kind::Int, _) => Type::I,
            (Kind::Any, _) => Type::B,
            (Kind::None, Kind::Float | Kind::None) => Type::F,
            (Kind::None, Kind::Int) => Type::I,
            (Kind::None, Kind::Any) => {
                match terms.iter().zip(sources).any(|(t, which)| among(which) && is_real(t)) {
                    true => Type::F,
                    false => Type::I,
                }
            }
        };
        let mut registers = [RegisterId::ZERO; 3];
        let mut kinds = [Kind::Any; 3];
        for (term, &which) in terms.iter().zip(sources) {
            let ty = match row.source_type(which) {
                Type::B if among(&which) => open,
                Type::B => Type::I,
                ty => ty,
            };
            (registers[which], kinds[which]) = match term.form {
                TermForm::Register(register, kind) => (register, kind),
                TermForm::Constant(value, expr) => {
                    (self.holding(at, value, expr, term.span, ty)?, Kind::of(ty))
                }
                // Does not occur: the caller has settled chains and functions of indices.
                TermForm::Chain(..) | TermForm::Counted(_) => return Err(ErrorReported),
            };
        }
        let result = self.forms.result(op, |which| kinds[which]);
        let own = !self.ir.latched && registers.iter().any(|register| self.is_input(*register));
        let key = self.subexpressions.key(op, registers, own);
        if let Some((register, bundle)) = self.subexpressions.find(&key) {
            let here_bundle = self.ir.bundles.len() as u32;
            if !line.computed.iter().any(|(_, at, _)| *at as u32 == bundle) {
                self.subexpressions.stretches.push((bundle, here_bundle));
            }
            return Ok(Term { form: TermForm::Register(register, result), span: here.0 });
        }
        let register = self.fresh(here.0);
        let bundle = self.ir.bundles.len();
        self.emit(at, line, op, slots, registers, register, here.0);
        self.note_computed(result);
        self.subexpressions.insert(key, register, bundle as u32);
        line.computed.push((register, bundle, key));
        Ok(Term { form: TermForm::Register(register, result), span: here.0 })
    }

    /// Input port that may change within a period.
    fn is_input(&self, id: RegisterId) -> bool {
        let register = &self.context.declared.registers[id.index()];
        match register.kind {
            RegisterKind::Input => true,
            RegisterKind::Parameter => false,
            _ => register.pinned.is_some_and(|address| self.ir.machine.is_input(address)),
        }
    }

    /// The types of the terms fit an instruction.
    pub(super) fn fits(&self, meaning: &Meaning, terms: &[Term]) -> bool {
        let row = meaning.op.row();
        let passed = self.forms.passed(meaning.op);
        let takes = |(term, &which): (&Term, &usize)| match (row.source_type(which), term.form) {
            (Type::F, TermForm::Counted(_)) => false,
            (_, TermForm::Counted(_)) => true,
            (Type::F, TermForm::Register(_, kind) | TermForm::Chain(_, kind)) => kind != Kind::Int,
            (Type::I, TermForm::Register(_, kind) | TermForm::Chain(_, kind)) => kind != Kind::Float,
            (Type::B, TermForm::Register(_, kind) | TermForm::Chain(_, kind)) => {
                passed.contains(&which) || kind != Kind::Float
            }
            (Type::B, TermForm::Constant(value, _)) if !passed.contains(&which) => value.integer().is_ok(),
            (Type::I, TermForm::Constant(value, _)) => value.integer().is_ok(),
            (_, TermForm::Constant(..)) => true,
        };
        let mut kinds = terms.iter().zip(&meaning.sources).filter(|(_, which)| passed.contains(which));
        let mixed = {
            let kinds: Vec<Kind> = kinds.by_ref().filter_map(|(term, _)| term.kind()).collect();
            kinds.contains(&Kind::Int) && kinds.contains(&Kind::Float)
        };
        !mixed && terms.iter().zip(&meaning.sources).all(takes)
    }

    /// The place of an operator between or before its operands, or of a function's name.
    pub(super) fn symbol_span(&self, symbol: &str, terms: &[Term], whole: Span) -> Span {
        let sources = &self.context.reports.sources;
        let (from, to) = match terms {
            [a, b] if a.span.end <= b.span.start => (a.span.end, b.span.start),
            _ => (whole.start, whole.end),
        };
        let symbol = if symbol == "?:" { "?" } else { symbol };
        let first = match symbol {
            "?" => terms.first().map_or(whole.start, |condition| condition.span.end),
            _ => from,
        };
        let gap = Span::new(first, to.max(first));
        match sources.text(gap).find(symbol) {
            Some(offset) => Span::new(gap.start + offset as u32, gap.start + (offset + symbol.len()) as u32),
            None => whole,
        }
    }
}

/// The comparison that negates another.
pub(super) fn opposite(symbol: &str) -> Option<&'static str> {
    Some(match symbol {
        "!=" => "==",
        "<=" => ">",
        ">=" => "<",
        _ => return None,
    })
}
