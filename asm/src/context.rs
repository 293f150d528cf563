//! What every stage after parsing shares: names and what they are bound to, the values of expressions, and the report.

use crate::ast::*;
use crate::diag::{Diagnostic, Sink, nearest};
use crate::expr::{self, BUILTINS, EvalError, Fault, Function, Value};
use crate::intern::{Interner, NameId};
use crate::ir::{LabelId, Register, RegisterId, RegisterKind};
use crate::limits;
use crate::source::{Sources, Span};
use crate::types::GivenTypes;
use crate::unknown::{Unknown, Wanted};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::rc::Rc;
use takt_isa::program::Space;
use takt_isa::{Machine, Op, Type, ZERO};

/// What stands before a mnemonic in the name of the constant that says whether the machine has the instruction.
pub(crate) const HAS: &str = "has.";

/// An expansion: what a use of a macro, or one turn of a repetition, adds to the names around it.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) struct ScopeId(pub(crate) u32);

impl ScopeId {
    pub(crate) const ROOT: ScopeId = ScopeId(0);
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Scope {
    /// Where a name is looked up that is not found here.
    pub(crate) parent: ScopeId,
    /// The scope that takes declarations: the macro's use, or the root.
    pub(crate) owner: ScopeId,
    /// The expansion that this one stands in, for messages. Not the parent: a macro does not see its caller's names.
    pub(crate) within: ScopeId,
    pub(crate) kind: ScopeKind,
    /// The use of the macro, or the `.rep`.
    pub(crate) site: Span,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum ScopeKind {
    Root,
    /// A macro and which of its uses.
    Macro(NameId, u32),
    /// The name that counts, and its value.
    Rep(NameId, i64),
}

/// Where an expression or operand stands: its tree and its scope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At {
    pub(crate) ast: u32,
    pub(crate) scope: ScopeId,
}

/// What a name means.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Binding {
    None,
    Register(RegisterId),
    Constant(u32),
    Code(LabelId),
    Data(LabelId),
    /// A parameter: an index into the arguments.
    Argument(u32),
    /// The name that a repetition counts with.
    Count(i64),
    /// `pi` and the like.
    Builtin(u32),
    /// Whether the machine has the instruction that the name asks for.
    Has(bool),
}

#[derive(Clone, Debug)]
pub(crate) struct NamedConstant {
    pub(crate) name: String,
    /// None if its expression has a mistake, which is reported.
    pub(crate) value: Option<Value>,
    pub(crate) span: Span,
    pub(crate) used: bool,
    /// Whether that it is never used is worth a warning.
    pub(crate) watched: bool,
}

/// An argument of a macro's use.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Argument {
    pub(crate) operand: Operand,
    pub(crate) at: At,
    /// Its value, once computed: parameters passed on and on are computed once.
    pub(crate) value: Option<Value>,
}

/// The mistake is in the report.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Reported;

pub(crate) struct Context {
    pub(crate) machine: &'static Machine,
    pub(crate) sources: Sources,
    pub(crate) names: Interner,
    pub(crate) asts: Vec<Rc<Ast>>,
    pub(crate) sink: Sink,
    pub(crate) scopes: Vec<Scope>,
    /// What names mean in the root scope, by number.
    globals: Vec<Binding>,
    locals: HashMap<(u32, NameId), Binding>,
    pub(crate) constants: Vec<NamedConstant>,
    pub(crate) arguments: Vec<Argument>,
    /// Parameters of macros' uses that stand for registers, as far as operations use them.
    pub(crate) parameters: HashMap<(ScopeId, NameId), RegisterId>,
    pub(crate) registers: Vec<Register>,
    /// Registers with a given address.
    pub(crate) by_address: HashMap<u16, RegisterId>,
    /// Outputs with a given number.
    pub(crate) numbered: BTreeMap<u16, RegisterId>,
    /// Labels. While the source is read a code label's position counts the statements of its section.
    pub(crate) labels: Vec<crate::ir::Label>,
    /// The section of each label.
    pub(crate) label_sections: Vec<Section>,
    pub(crate) macros: HashMap<NameId, crate::expand::MacroDefinition>,
    pub(crate) unknown: Vec<Unknown>,
    /// What the source says of the types of operands that the instruction leaves open.
    pub(crate) given: GivenTypes,
    /// Registers that are declared with a type, rather than as floats by default.
    pub(crate) typed: HashSet<RegisterId>,
    /// The types of the words of data memory.
    pub(crate) data_types: Vec<Type>,
    /// Unknown names beyond those that are kept.
    pub(crate) more_unknown: usize,
    /// Arguments and templates under evaluation, one within the other.
    depth: usize,
}

impl Context {
    pub(crate) fn new(machine: &'static Machine) -> Context {
        let mut names = Interner::new();
        let zero = names.intern("zero");
        let register = Register {
            name: "zero".to_owned(),
            kind: RegisterKind::Zero,
            ty: Type::B,
            pinned: Some(ZERO),
            preset: None,
            span: Span::default(),
        };
        let root = Scope {
            parent: ScopeId::ROOT,
            owner: ScopeId::ROOT,
            within: ScopeId::ROOT,
            kind: ScopeKind::Root,
            site: Span::default(),
        };
        let mut context = Context {
            machine,
            sources: Sources::default(),
            names,
            asts: Vec::new(),
            sink: Sink::default(),
            scopes: vec![root],
            globals: Vec::new(),
            locals: HashMap::new(),
            constants: Vec::new(),
            arguments: Vec::new(),
            parameters: HashMap::new(),
            registers: vec![register],
            by_address: HashMap::from([(ZERO, RegisterId::ZERO)]),
            numbered: BTreeMap::new(),
            labels: Vec::new(),
            label_sections: Vec::new(),
            macros: HashMap::new(),
            unknown: Vec::new(),
            given: GivenTypes::default(),
            typed: HashSet::new(),
            data_types: Vec::new(),
            more_unknown: 0,
            depth: 0,
        };
        context.bind(ScopeId::ROOT, zero, Binding::Register(RegisterId::ZERO));
        context
    }

    pub(crate) fn scope(&self, id: ScopeId) -> &Scope {
        &self.scopes[id.0 as usize]
    }

    /// Reports a mistake in a scope, with the expansions that led there.
    pub(crate) fn report(&mut self, scope: ScopeId, mut diagnostic: Diagnostic) -> Reported {
        if self.sink.keeps(diagnostic.severity) {
            diagnostic = self.with_expansions(scope, diagnostic);
        }
        self.sink.push(diagnostic);
        Reported
    }

    pub(crate) fn error(
        &mut self,
        scope: ScopeId,
        code: &'static str,
        span: Span,
        message: impl Into<String>,
    ) -> Reported {
        self.report(scope, Diagnostic::error(code, span, message))
    }

    fn with_expansions(&self, mut scope: ScopeId, mut diagnostic: Diagnostic) -> Diagnostic {
        let mut shown = 0;
        while scope != ScopeId::ROOT {
            let Scope { kind, site, within, .. } = *self.scope(scope);
            if diagnostic.labels.iter().any(|label| label.span == site) {
                // A macro that uses itself.
                scope = within;
                continue;
            }
            shown += 1;
            if shown > 4 {
                return diagnostic.note("… and further expansions around these");
            }
            diagnostic = match kind {
                ScopeKind::Macro(name, _) => {
                    diagnostic.also(site, format!("in this use of `{}`", self.names.text(name)))
                }
                ScopeKind::Rep(name, value) => {
                    diagnostic.also(site, format!("with {} = {value}", self.names.text(name)))
                }
                ScopeKind::Root => diagnostic,
            };
            scope = within;
        }
        diagnostic
    }

    /// What a name means in a scope.
    #[inline]
    pub(crate) fn lookup(&self, mut scope: ScopeId, name: NameId) -> Binding {
        while scope != ScopeId::ROOT {
            let here = self.scope(scope);
            match here.kind {
                ScopeKind::Rep(variable, value) if variable == name => return Binding::Count(value),
                ScopeKind::Macro(..) => {
                    if let Some(binding) = self.locals.get(&(scope.0, name)) {
                        return *binding;
                    }
                }
                _ => {}
            }
            scope = here.parent;
        }
        match self.globals.get(name.0 as usize) {
            Some(Binding::None) | None => match name.builtin() {
                Some(builtin) => Binding::Builtin(builtin as u32),
                None => self.has(name).map_or(Binding::None, Binding::Has),
            },
            Some(binding) => *binding,
        }
    }

    /// Whether the machine has an instruction, where the name asks for that: `has.` and a mnemonic.
    fn has(&self, name: NameId) -> Option<bool> {
        let row = Op::from_mnemonic(self.names.text(name).strip_prefix(HAS)?)?.row();
        Some(row.function == takt_isa::Function::Idle || self.machine.host(row.function).is_some())
    }

    /// Binds a name in a scope, without asking whether it is bound.
    pub(crate) fn bind(&mut self, scope: ScopeId, name: NameId, binding: Binding) {
        if scope == ScopeId::ROOT {
            let index = name.0 as usize;
            if index >= self.globals.len() {
                self.globals.resize((index + 1).max(self.names.len()), Binding::None);
            }
            self.globals[index] = binding;
        } else {
            self.locals.insert((scope.0, name), binding);
        }
    }

    /// Declares a name in the scope that takes declarations, unless it is declared there.
    pub(crate) fn declare(
        &mut self,
        at: At,
        name: NameId,
        span: Span,
        binding: Binding,
    ) -> Result<(), Reported> {
        let owner = self.scope(at.scope).owner;
        let before = if owner == ScopeId::ROOT {
            self.globals.get(name.0 as usize).copied().unwrap_or(Binding::None)
        } else {
            self.locals.get(&(owner.0, name)).copied().unwrap_or(Binding::None)
        };
        if before == Binding::None {
            self.bind(owner, name, binding);
            return Ok(());
        }
        let text = self.names.text(name).to_owned();
        let error = Diagnostic::error("declared-twice", span, format!("`{text}` is declared already"));
        let error = match (before, self.declaration(before)) {
            (Binding::Register(RegisterId::ZERO), _) => {
                error.note("`zero` is the register that always reads as zero").help("choose another name")
            }
            (Binding::Argument(_), Some(span)) => error.also(span, "as a parameter, for this argument"),
            (_, Some(first)) if first == span => error.help(
                "each turn of the repetition declares it: make the name depend on the count, as in `name{i}`",
            ),
            (_, Some(first)) => error.also(first, "declared here first").help("choose another name"),
            _ => error,
        };
        Err(self.report(at.scope, error))
    }

    /// Where something was declared.
    pub(crate) fn declaration(&self, binding: Binding) -> Option<Span> {
        match binding {
            Binding::Register(id) => Some(self.registers[id.index()].span),
            Binding::Constant(id) => Some(self.constants[id as usize].span),
            Binding::Code(id) | Binding::Data(id) => Some(self.labels[id.0 as usize].span),
            Binding::Argument(id) => Some(self.arguments[id as usize].operand.span),
            Binding::None | Binding::Count(_) | Binding::Builtin(_) | Binding::Has(_) => None,
        }
    }

    /// What a binding is, in words.
    pub(crate) fn kind_text(&self, binding: Binding) -> &'static str {
        match binding {
            Binding::Register(id) => match self.registers[id.index()].kind {
                RegisterKind::Input => "an input port",
                RegisterKind::Output => "an output port",
                RegisterKind::Zero => "the register that always reads as zero",
                _ => "a register",
            },
            Binding::Constant(_) | Binding::Builtin(_) | Binding::Has(_) => "a constant",
            Binding::Code(_) => "a code label",
            Binding::Data(_) => "a data label",
            Binding::Argument(_) => "a parameter",
            Binding::Count(_) => "the count of a repetition",
            Binding::None => "unknown",
        }
    }

    /// The text of a name declared in a scope, as the symbol map shows it: unique to a macro's use.
    pub(crate) fn full_name(&self, scope: ScopeId, name: NameId) -> String {
        let text = self.names.text(name);
        self.scope_name(scope).map_or_else(|| text.to_owned(), |scope| format!("{scope}.{text}"))
    }

    /// What stands before the names that are declared in a scope: the macro and which of its uses; `None` outside of macros.
    pub(crate) fn scope_name(&self, scope: ScopeId) -> Option<String> {
        let owner = self.scope(scope).owner;
        match self.scope(owner).kind {
            ScopeKind::Macro(of, number) => Some(format!("{}.{number}", self.names.text(of))),
            _ => None,
        }
    }

    /// The name that a reference stands for where it stands.
    #[inline]
    pub(crate) fn name(&mut self, at: At, name: NameRef, span: Span) -> Result<NameId, Reported> {
        match name.resolve() {
            Ok(name) => Ok(name),
            Err(template) => self.nested(at, span, |context| context.instantiate(at, template, span)),
        }
    }

    /// Guards an evaluation within an evaluation.
    fn nested<T>(
        &mut self,
        at: At,
        span: Span,
        evaluate: impl FnOnce(&mut Context) -> Result<T, Reported>,
    ) -> Result<T, Reported> {
        if self.depth >= limits::EVALUATION_DEPTH {
            let message = "names and arguments depend on one another too deeply";
            return Err(self.error(at.scope, "limit", span, message));
        }
        self.depth += 1;
        let value = evaluate(self);
        self.depth -= 1;
        value
    }

    fn instantiate(&mut self, at: At, template: usize, span: Span) -> Result<NameId, Reported> {
        let ast = Rc::clone(&self.asts[at.ast as usize]);
        let Template { parts, tail } = &ast.templates[template];
        let mut text = String::new();
        for (head, nodes) in parts {
            text.push_str(self.names.text(*head));
            text.push_str(&self.piece(at, nodes, span)?);
        }
        text.push_str(self.names.text(*tail));
        let valid = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        if !valid || text.len() > limits::NAME_BYTES {
            let message = if valid {
                format!("a name of {} characters", text.len())
            } else {
                format!("`{text}` is not a name")
            };
            let help = if valid {
                format!("a name has at most {}", limits::NAME_BYTES)
            } else {
                "a name begins with a letter or `_` and has letters, digits, `_` and `.`".to_owned()
            };
            return Err(self.report(at.scope, Diagnostic::error("name", span, message).help(help)));
        }
        if self.names.len() >= limits::NAMES {
            let message = format!("more than {} names", limits::NAMES);
            return Err(self.error(at.scope, "limit", span, message));
        }
        Ok(self.names.intern(&text))
    }

    /// The text for one braced part of a name.
    fn piece(&mut self, at: At, nodes: &[Node], span: Span) -> Result<String, Reported> {
        // A parameter whose argument is a name gives the name's text, unless that is an integer.
        if let [Node { kind: NodeKind::Name(name), .. }] = *nodes {
            let name = self.name(at, name, span)?;
            let argument = match self.lookup(at.scope, name) {
                Binding::Argument(argument) => Some(self.arguments[argument as usize]),
                _ => None,
            };
            if let Some(Argument {
                operand: Operand { kind: OperandKind::Name(inner), span },
                at: outer,
                ..
            }) = argument
            {
                let inner = self.name(outer, inner, span)?;
                let integer = match self.lookup(outer.scope, inner) {
                    Binding::Count(value) => Some(value),
                    Binding::Constant(id) => match self.constants[id as usize].value {
                        Some(Value::Int(value)) => Some(value),
                        _ => None,
                    },
                    _ => None,
                };
                return Ok(
                    integer.map_or_else(|| self.names.text(inner).to_owned(), |value| value.to_string())
                );
            }
        }
        let id = ExprId { first: 0, count: nodes.len() as u32 };
        let value = expr::evaluate(nodes, id, &mut Environment { context: self, at });
        let integer = value.and_then(|value| {
            let span = nodes.last().map_or(span, |node| node.span);
            value.integer().map_err(|fault| EvalError { span, fault })
        });
        match integer {
            Ok(value) if value < 0 => Err(self.error(
                at.scope,
                "name",
                span,
                format!("a name cannot contain {value}: it has a sign"),
            )),
            Ok(value) => Ok(value.to_string()),
            Err(error) => Err(self.fault(at.scope, error)),
        }
    }

    /// The type of a name.
    pub(crate) fn type_named(&mut self, at: At, ty: Name) -> Result<Type, Reported> {
        let text = self.sources.text(ty.span).to_owned();
        let types = [Type::F, Type::I, Type::B];
        if let Some(ty) = types.into_iter().find(|ty| type_name(*ty) == text) {
            return Ok(ty);
        }
        let error = Diagnostic::error("type", ty.span, format!("`{text}` is not a type"))
            .note(format!("types: {}", types.map(type_name).join(" ")))
            .did_you_mean(nearest(&text, types.map(type_name)));
        Err(self.report(at.scope, error))
    }

    /// Reports why an expression has no value.
    pub(crate) fn fault(&mut self, scope: ScopeId, EvalError { span, fault }: EvalError) -> Reported {
        let help = match &fault {
            Fault::Reported => return Reported,
            Fault::UnknownFunction(name) => {
                let meant = nearest(name, Function::ALL.iter().map(|function| function.name()));
                let all: Vec<&str> = Function::ALL.iter().map(|function| function.name()).collect();
                let error = Diagnostic::error("expression", span, fault.to_string());
                let error = match meant {
                    Some(_) => error.did_you_mean(meant),
                    None => error.note(format!("functions: {}", all.join(" "))),
                };
                return self.report(scope, error);
            }
            Fault::NotInteger(_) => Some("`round`, `floor`, `ceil` or `int` makes it one"),
            Fault::NeedsInteger { .. } => Some("`round`, `floor`, `ceil` or `int` makes an integer of it"),
            Fault::IntegerOverflow(_) => Some("write an operand as a real number to compute in binary64"),
            Fault::DivisionByZero | Fault::Overflow(_) => Some("write `inf` if infinity is meant"),
            Fault::FloatRange(_) => Some("write `inf` if infinity is meant"),
            Fault::NotANumber(_) => Some("write `nan` if no number is meant"),
            _ => None,
        };
        let mut error = Diagnostic::error("expression", span, fault.to_string());
        error.help = help.map(str::to_owned);
        self.report(scope, error)
    }

    /// The value of an expression.
    pub(crate) fn value(&mut self, at: At, expr: ExprId) -> Result<Value, Reported> {
        let ast = &self.asts[at.ast as usize];
        if let [node] = ast.nodes[expr.range()] {
            match node.kind {
                NodeKind::Int(value) => return Ok(Value::Int(value)),
                NodeKind::Real(value) => return Ok(Value::Real(value)),
                _ => {}
            }
        }
        let ast = Rc::clone(ast);
        let value = expr::evaluate(&ast.nodes, expr, &mut Environment { context: self, at });
        value.map_err(|error| self.fault(at.scope, error))
    }

    /// The value of an expression that is to be an integer.
    pub(crate) fn integer(&mut self, at: At, expr: Expr) -> Result<i64, Reported> {
        let value = self.value(at, expr.id)?;
        value.integer().map_err(|fault| self.fault(at.scope, EvalError { span: expr.span, fault }))
    }

    /// The value of a name that is not an argument.
    pub(crate) fn name_value(&mut self, scope: ScopeId, name: NameId, span: Span) -> Result<Value, Reported> {
        match self.lookup(scope, name) {
            Binding::Count(value) => Ok(Value::Int(value)),
            Binding::Builtin(builtin) => Ok(BUILTINS[builtin as usize].1),
            Binding::Has(has) => Ok(Value::Int(has.into())),
            Binding::Constant(id) => {
                let constant = &mut self.constants[id as usize];
                constant.used = true;
                constant.value.ok_or(Reported)
            }
            Binding::Data(id) => Ok(Value::Int(self.labels[id.0 as usize].position.into())),
            Binding::Argument(id) => self.argument_value(id, span),
            Binding::None => Err(self.unknown(scope, name, span, Wanted::Value)),
            binding => {
                let kind = self.kind_text(binding);
                let message = format!("`{}` is {kind}: it has no value here", self.names.text(name));
                let mut error = Diagnostic::error("not-a-value", span, message);
                error = match binding {
                    Binding::Code(_) => error
                        .note("the addresses of code are known only after scheduling")
                        .help("a code label stands alone, as a target or as the immediate of `li`"),
                    _ => error.note("an expression is computed by the assembler, before the program runs"),
                };
                if let Some(declared) = self.declaration(binding) {
                    error = error.also(declared, "declared here");
                }
                Err(self.report(scope, error))
            }
        }
    }

    fn argument_value(&mut self, id: u32, span: Span) -> Result<Value, Reported> {
        let Argument { operand, at, value } = self.arguments[id as usize];
        if let Some(value) = value {
            return Ok(value);
        }
        let value = match operand.kind {
            OperandKind::Expr(expr) => self.nested(at, span, |context| context.value(at, expr))?,
            OperandKind::Name(name) => self.nested(at, span, |context| {
                let name = context.name(at, name, operand.span)?;
                context.name_value(at.scope, name, operand.span)
            })?,
            OperandKind::Place(_) | OperandKind::Memory(_) | OperandKind::Cast(_) => {
                let error = Diagnostic::error("not-a-value", span, "a value is needed here")
                    .also(operand.span, "the argument is an operand without one");
                return Err(self.report(at.scope, error));
            }
        };
        self.arguments[id as usize].value = Some(value);
        Ok(value)
    }
}

/// The names of an expression where it stands.
struct Environment<'c> {
    context: &'c mut Context,
    at: At,
}

impl expr::Names for Environment<'_> {
    fn value(&mut self, name: NameRef, span: Span) -> Result<Value, EvalError> {
        let name = self.context.name(self.at, name, span);
        name.and_then(|name| self.context.name_value(self.at.scope, name, span))
            .map_err(|Reported| EvalError { span, fault: Fault::Reported })
    }

    fn function(&mut self, name: NameId, span: Span) -> Result<Function, EvalError> {
        name.function().ok_or_else(|| EvalError {
            span,
            fault: Fault::UnknownFunction(self.context.names.text(name).to_owned()),
        })
    }
}

/// A type as the source writes it.
pub(crate) const fn type_name(ty: Type) -> &'static str {
    match ty {
        Type::F => "float",
        Type::I => "int",
        Type::B => "bits",
    }
}

/// Whether a label is of a space, for the listing and the report.
pub(crate) fn space_of(section: Section) -> Space {
    if section == Section::Data { Space::Data } else { Space::Code }
}
