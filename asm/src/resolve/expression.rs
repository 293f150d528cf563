// SPDX-License-Identifier: MIT OR Apache-2.0
//! Expressions of equations, computed: a loop over nodes in postfix order, as a constant's
//! ([`expr::evaluate`](crate::syntax::expr::evaluate)) is, with a stack of values that are constants or registers. Constant parts are
//! folded on the way, and of a choice whose condition is a constant only the alternative is computed that it chooses.

use crate::context::{At, Binding, Reported, ScopeKind, Wanted};
use crate::expand::equation::SUM;
use crate::ir::given::Kind;
use crate::ir::{RegisterId, RegisterKind};
use crate::limits;
use crate::report::diag::Diagnostic;
use crate::report::source::Span;
use crate::resolve::Resolver;
use crate::resolve::elements::Place;
use crate::resolve::forms::Meaning;
use crate::resolve::sums::CountedSum;
use crate::resolve::term::{CurrentEquation, Here, Term, TermForm};
use crate::syntax::ast::*;
use crate::syntax::expr::{self, EvalError, Value};
use crate::syntax::name::{NameId, NameRef};
use smallvec::SmallVec;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use takt_isa::Type;

/// Structure of an expression, found before it is computed.
struct Plan {
    /// By first node: the last node of what a macro has computed.
    results: HashMap<u32, u32>,
    /// By first node: the node of a sum.
    sums: HashMap<u32, u32>,
    /// By first node of a choice's first alternative: the choice.
    choices: HashMap<u32, u32>,
    /// Choices that are the value of the whole, or an alternative of such a choice.
    whole: HashSet<u32>,
    /// First node of the part that each node heads.
    parts: Vec<u32>,
}

/// A stretch of nodes being computed.
struct Stretch {
    at: At,
    next: u32,
    end: u32,
    /// True if it is an alternative of a choice that is made already.
    chosen: bool,
    sum: Option<Turns>,
    /// The term of a sum that is a loop.
    counted: Option<CountedSum>,
}

/// The state of a sum.
struct Turns {
    variable: NameId,
    value: i64,
    last: i64,
    outer: At,
    start: u32,
    node: u32,
    total: Option<Term>,
}

impl Resolver<'_> {
    /// Analyses the structure of an expression before it is computed.
    fn plan(&mut self, at: At, line: &CurrentEquation, ast: &Ast, id: ExprId) -> Result<Plan, Reported> {
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
                    // Of several that begin at one node the last, around the others, counts.
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

    /// Computes an expression. `wanted` is the type of the register that its value goes to, if it has one.
    pub(super) fn compute(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        ast: &Rc<Ast>,
        id: ExprId,
        wanted: Kind,
    ) -> Result<Term, Reported> {
        let nodes = &ast.nodes[id.range()];
        let plan = self.plan(at, line, ast, id)?;
        let mut stack: Vec<Term> = Vec::with_capacity(8);
        let end = nodes.len() as u32;
        let mut stretches = vec![Stretch { at, next: 0, end, chosen: false, sum: None, counted: None }];
        let constant = |value, first: u32, last: u32, span| {
            let id = ExprId { first: id.first + first, count: last - first + 1 };
            Term { form: TermForm::Constant(value, id), span }
        };
        while let Some(stretch) = stretches.last_mut() {
            let at = stretch.at;
            if stretch.next == stretch.end {
                let Some(stretch) = stretches.pop() else { break };
                if let Some(sum) = stretch.counted {
                    let Some(term) = stack.pop() else { return Err(Reported) };
                    stack.push(self.end_sum(line, sum, term)?);
                    continue;
                }
                let Some(turns) = stretch.sum else { continue };
                let span = nodes[turns.node as usize].span;
                let Some(term) = stack.pop() else { return Err(Reported) };
                let total = match turns.total {
                    None => term,
                    Some(total) => {
                        let first = plan.parts[turns.node as usize];
                        let id = ExprId { first: id.first + first, count: turns.node - first + 1 };
                        match (total.value(), term.value()) {
                            (Some(a), Some(b)) => {
                                let value = self.folded(at, expr::infix(Operator::Add, a, b), span)?;
                                Term { form: TermForm::Constant(value, id), span }
                            }
                            _ => {
                                let symbol = Operator::Add.text();
                                self.apply(at, line, symbol, &[total, term], (span, id), Kind::None)?
                            }
                        }
                    }
                };
                if turns.value == turns.last {
                    stack.push(Term { span, ..total });
                    continue;
                }
                let value = turns.value + 1;
                stretches.push(self.turn(Turns { value, total: Some(total), ..turns }, span)?);
                continue;
            }
            let index = stretch.next;
            if !std::mem::replace(&mut stretch.chosen, false)
                && let Some(&choice) = plan.choices.get(&index)
                && let Some(value) = stack.last().and_then(Term::value)
            {
                stack.pop();
                stretch.next = choice + 1;
                let operands = expr::operands(&plan.parts, choice);
                let (first, last) = operands[if value.is_zero() { 2 } else { 1 }];
                stretches.push(Stretch {
                    at,
                    next: first,
                    end: last + 1,
                    chosen: true,
                    sum: None,
                    counted: None,
                });
                continue;
            }
            if let Some(&call) = plan.results.get(&index)
                && let Some(&register) = line.results.get(&(id.first + call))
            {
                stretch.next = call + 1;
                let form = TermForm::Register(register, self.kind(register));
                stack.push(Term { form, span: nodes[call as usize].span });
                continue;
            }
            if let Some(&sum) = plan.sums.get(&index) {
                stretch.next = sum + 1;
                let operands = expr::operands(&plan.parts, sum);
                let expression = |(first, last): (u32, u32)| Expr {
                    id: ExprId { first: id.first + first, count: last - first + 1 },
                    span: nodes[last as usize].span,
                };
                let NodeKind::Name(variable) = nodes[index as usize].kind else { return Err(Reported) };
                let counts = nodes[index as usize].span;
                let variable = self.context.spelled(at, variable, counts)?;
                let span = nodes[sum as usize].span;
                if let Some(notes) = &mut self.context.notes {
                    notes.sum(span, counts, variable);
                }
                let bounds = [expression(operands[1]), expression(operands[2])];
                if bounds.iter().any(|bound| self.context.names_index(at, bound.id)) {
                    let (start, end) = (operands[3].0, sum);
                    match self.begin_sum(at, line, variable, bounds, span)? {
                        Some((counted, at)) => {
                            let counted = Some(counted);
                            stretches.push(Stretch {
                                at,
                                next: start,
                                end,
                                chosen: false,
                                sum: None,
                                counted,
                            });
                        }
                        None => stack.push(constant(Value::Int(0), index, sum, span)),
                    }
                    continue;
                }
                let from = self.context.integer(at, bounds[0])?;
                let last = self.context.integer(at, bounds[1])?;
                if from > last {
                    stack.push(constant(Value::Int(0), index, sum, span));
                    continue;
                }
                let start = operands[3].0;
                let turns = Turns { variable, value: from, last, outer: at, start, node: sum, total: None };
                stretches.push(self.turn(turns, span)?);
                continue;
            }
            stretch.next += 1;
            let node = nodes[index as usize];
            let here = (
                node.span,
                ExprId {
                    first: id.first + plan.parts[index as usize],
                    count: index - plan.parts[index as usize] + 1,
                },
            );
            let mut take = |count: usize| stack.split_off(stack.len().saturating_sub(count));
            let term = match node.kind {
                NodeKind::Int(value) => constant(Value::Int(value), index, index, node.span),
                NodeKind::Real(value) => constant(Value::Real(value), index, index, node.span),
                NodeKind::Name(name) => self.name(at, line, name, here)?,
                NodeKind::All | NodeKind::Range => return Err(Reported),
                NodeKind::Element(element) => {
                    let Element { name, indices } = &ast.elements[element as usize];
                    let register = match self.element_place(at, *name, indices, node.span)? {
                        Place::Register(register) => register,
                        Place::Word(word) => self.load(at, line, &word, node.span)?,
                    };
                    Term { form: TermForm::Register(register, self.kind(register)), span: node.span }
                }
                NodeKind::Prefix(Operator::Add) => continue,
                NodeKind::Prefix(operator) => {
                    let terms = take(1);
                    match terms[..] {
                        [Term { form: TermForm::Constant(value, _), .. }] => constant(
                            self.folded(at, expr::prefix(operator, value), node.span)?,
                            plan.parts[index as usize],
                            index,
                            node.span,
                        ),
                        _ => match self.counted_operation(line, operator, &terms) {
                            Some(form) => Term { form, span: node.span },
                            None => self.apply(at, line, operator.text(), &terms, here, Kind::None)?,
                        },
                    }
                }
                NodeKind::Infix(operator) => {
                    let terms = take(2);
                    match (terms[0].value(), terms[1].value()) {
                        (Some(a), Some(b)) => constant(
                            self.folded(at, expr::infix(operator, a, b), node.span)?,
                            plan.parts[index as usize],
                            index,
                            node.span,
                        ),
                        _ => match self.counted_operation(line, operator, &terms) {
                            Some(form) => Term { form, span: node.span },
                            None => self.apply(at, line, operator.text(), &terms, here, Kind::None)?,
                        },
                    }
                }
                NodeKind::Choice => {
                    let terms = take(3);
                    let wanted = if plan.whole.contains(&index) { wanted } else { Kind::Any };
                    self.apply(at, line, "?:", &terms, here, wanted)?
                }
                NodeKind::Call(name, count) => {
                    let terms = take(count as usize);
                    let values: Option<Vec<Value>> = terms.iter().map(Term::value).collect();
                    match (name.function(), values) {
                        (Some(function), Some(values)) => constant(
                            self.folded(at, expr::call(function, &values), node.span)?,
                            plan.parts[index as usize],
                            index,
                            node.span,
                        ),
                        _ => self.function(at, line, name, &terms, here)?,
                    }
                }
            };
            stack.push(term);
        }
        let value = stack.pop().ok_or(Reported)?;
        self.settled(at, line, value)
    }

    pub(super) fn folded(
        &mut self,
        at: At,
        value: Result<Value, expr::Fault>,
        span: Span,
    ) -> Result<Value, Reported> {
        value.map_err(|fault| self.context.fault(at.scope, EvalError { span, fault }))
    }

    /// The next turn of a sum.
    fn turn(&mut self, turns: Turns, span: Span) -> Result<Stretch, Reported> {
        self.turns += 1;
        if self.turns > limits::STATEMENTS {
            let message = format!("sums of more than {} turns in all", limits::STATEMENTS);
            return Err(self.context.error(turns.outer.scope, "limit", span, message));
        }
        let outer = turns.outer;
        let kind = ScopeKind::Rep(turns.variable, turns.value);
        let scope = self.context.scopes.open(outer.scope, outer.scope, kind, span);
        let (next, end) = (turns.start, turns.node);
        Ok(Stretch { at: At { scope, ..outer }, next, end, chosen: false, sum: Some(turns), counted: None })
    }

    /// The operand that a name denotes.
    fn name(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        name: NameRef,
        (span, id): Here,
    ) -> Result<Term, Reported> {
        self.cast = None;
        let (place, given, meaning) = self.meaning(at, Operand { kind: OperandKind::Name(name), span })?;
        let register = |resolver: &Self, register| {
            let kind = resolver.cast.map_or_else(|| resolver.kind(register), Kind::of);
            Term { form: TermForm::Register(register, kind), span }
        };
        match (given.kind, meaning) {
            (_, Some((_, Binding::Register(RegisterId::ZERO)))) => {
                Ok(Term { form: TermForm::Constant(Value::Int(0), id), span })
            }
            (_, Some((_, Binding::Register(found)))) => Ok(register(self, found)),
            (_, Some((_, Binding::Word(word)))) => {
                let word = self.words[word as usize].clone();
                let loaded = self.load(at, line, &word, span)?;
                Ok(register(self, loaded))
            }
            (_, Some((_, Binding::Index(index)))) => {
                let function = self.context.declared.indices[index as usize].value.actual.clone();
                line.counted.push(function);
                Ok(Term { form: TermForm::Counted(line.counted.len() - 1), span })
            }
            (_, Some((name, Binding::None))) => {
                Err(self.context.unknown(place.scope, name, given.span, Wanted::Source))
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
                let value = self.context.value(place, expr)?;
                Ok(Term { form: TermForm::Constant(value, id), span })
            }
            (_, Some((name, _))) => {
                let value = self.context.name_value(place.scope, name, given.span)?;
                Ok(Term { form: TermForm::Constant(value, id), span })
            }
            _ => Err(self.context.error(at.scope, "operand", span, "this has no value")),
        }
    }

    /// Computes a function.
    fn function(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        name: NameId,
        terms: &[Term],
        here: Here,
    ) -> Result<Term, Reported> {
        let text = self.context.scopes.text(name).to_owned();
        // The least or greatest of several.
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

    /// Computes what a symbol means between terms: of the instructions that have the form, the one for the terms' types.
    pub(super) fn apply(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        symbol: &str,
        terms: &[Term],
        here: Here,
        wanted: Kind,
    ) -> Result<Term, Reported> {
        if let Some(term) = self.fast(at, line, symbol, terms, here)? {
            return Ok(term);
        }
        let mut settled: SmallVec<[Term; 3]> = SmallVec::new();
        for term in terms {
            settled.push(self.settled(at, line, *term)?);
        }
        self.operate(at, line, symbol, &settled, here, wanted)
    }

    /// The same, of values that are computed, as written.
    pub(super) fn operate(
        &mut self,
        at: At,
        line: &mut CurrentEquation,
        symbol: &str,
        terms: &[Term],
        here: Here,
        wanted: Kind,
    ) -> Result<Term, Reported> {
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
        // Constants that the instruction takes as any bits are of the type of what they are an alternative to.
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
                // Its caller has computed it.
                TermForm::Chain(..) | TermForm::Counted(_) => return Err(Reported),
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
        self.subexpressions.insert(key, register, bundle as u32);
        line.computed.push((register, bundle, key));
        Ok(Term { form: TermForm::Register(register, result), span: here.0 })
    }

    fn is_input(&self, id: RegisterId) -> bool {
        let register = &self.context.declared.registers[id.index()];
        register.kind == RegisterKind::Input
            || register.pinned.is_some_and(|address| self.ir.machine.is_input(address))
    }

    /// True if an instruction takes the types of the terms.
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

/// The comparison that is true where another is not.
pub(super) fn opposite(symbol: &str) -> Option<&'static str> {
    Some(match symbol {
        "!=" => "==",
        "<=" => ">",
        ">=" => "<",
        _ => return None,
    })
}
