// SPDX-License-Identifier: MIT OR Apache-2.0
//! Index of declarations and references for editors, whether the program assembles or not.
//!
//! The index is recorded while the assembler resolves names ([`check`](crate::check)), so that it knows what the assembler
//! knows: a name in a macro's body is found for each use, a name with `{}` for each value that it takes. Code that is never
//! expanded, as the body of an unused macro, is not resolved and not in the index.

use crate::context::{Binding, Context, ParameterType, ScopeKind, Table};
use crate::ir::{Ir, RegisterId, RegisterKind};
use std::collections::HashMap;
use takt_diagnostics::source::Span;
use takt_isa::program::Space;
use takt_isa::{Register, Type};
use takt_syntax::ast::{Directive, DirectiveKind};
use takt_syntax::expr::Value;
use takt_syntax::name::NameId;

/// The kind of a declaration.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum SymbolKind {
    /// Plain register, declared by `.reg`.
    Register,
    /// Register whose value outlives the period, declared by `.state`.
    State,
    /// Array of registers, declared by `.reg`.
    Array,
    /// Array in data memory, declared by `.array`.
    Table,
    /// Input port, declared by `.input`.
    Input,
    /// Output port, declared by `.output`.
    Output,
    /// Named constant, declared by `.const`.
    Constant,
    /// A label of code.
    Code,
    /// A label of data.
    Data,
    /// Macro, declared by `.macro`.
    Macro,
    /// Parameter that the host sets, declared by `.param`.
    Tunable,
    /// A parameter of a macro.
    Parameter,
    /// The counter of a `.rep` or a `.for`.
    Count,
}

impl SymbolKind {
    /// The kind in words.
    pub const fn text(self) -> &'static str {
        match self {
            SymbolKind::Register => "register",
            SymbolKind::State => "state",
            SymbolKind::Array => "array of registers",
            SymbolKind::Table => "array in data memory",
            SymbolKind::Input => "input port",
            SymbolKind::Output => "output port",
            SymbolKind::Constant => "constant",
            SymbolKind::Code => "code label",
            SymbolKind::Data => "data label",
            SymbolKind::Macro => "macro",
            SymbolKind::Tunable => "tunable parameter",
            SymbolKind::Parameter => "parameter",
            SymbolKind::Count => "count of a repetition",
        }
    }
}

/// A name that the source declares. One declaration in a repetition or a macro declares several.
#[derive(Clone, PartialEq, Debug)]
pub struct Symbol {
    /// The name in the symbol map; locals of a macro are prefixed with the use, `limit.2.done`.
    pub name: String,
    /// Kind of the declaration.
    pub kind: SymbolKind,
    /// Place of the name in the declaration.
    pub span: Span,
    /// The type of a register, a port, an array's elements, or a macro's parameter.
    pub ty: Option<Type>,
    /// Address that the source gives a register or port.
    pub place: Option<Register>,
    /// The value of a constant, if it has one.
    pub value: Option<Value>,
    /// Word of data memory of a label, or of an array's first element.
    pub word: Option<u32>,
    /// Number of elements of an array in each dimension; empty for other symbols.
    pub sizes: Vec<u32>,
    /// The parameters of a macro, each with its type if the source declares one: `x:float`.
    pub parameters: Vec<String>,
    /// The macro that a parameter belongs to.
    pub of: Option<String>,
}

/// A place in the source that names a symbol, its declaration included.
#[derive(Clone, Copy, PartialEq, Eq, Debug, PartialOrd, Ord)]
pub struct Reference {
    /// Place of the name.
    pub span: Span,
    /// The symbol: an index into [`Index::symbols`]. A place in a macro or a repetition may name several.
    pub symbol: u32,
}

/// A block of lines between the directives that open and close it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Block {
    /// `.macro`, `.rep`, `.for` or `.if`; an `.if` with branches has a block for each.
    pub directive: Directive,
    /// Place of the opening directive.
    pub open: Span,
    /// Line of the closing directive, from 1, in the same file.
    pub last_line: u32,
}

/// The names of a program.
#[derive(Clone, Debug, Default)]
pub struct Index {
    /// Declarations, in no particular order.
    pub symbols: Vec<Symbol>,
    /// References to the symbols, sorted by place, without duplicates.
    pub references: Vec<Reference>,
    /// `.include`s by place, each with the index of its source.
    pub includes: Vec<(Span, usize)>,
    /// Blocks of the sources.
    pub blocks: Vec<Block>,
    /// No reference was dropped: an index keeps at most [`limits::REFERENCES`](crate::limits::REFERENCES).
    pub complete: bool,
}

impl Index {
    /// The references at an offset, which may be the end of the name.
    pub fn at(&self, offset: u32) -> &[Reference] {
        // Names overlap only with names in their braces: the innermost begins last.
        let end = self.references.partition_point(|reference| reference.span.start <= offset);
        let holds = |reference: &&Reference| reference.span.end >= offset;
        // A template with its braces is at most a line, which bounds the search.
        let Some(found) = self.references[..end].iter().rev().take(256).find(holds) else { return &[] };
        self.of_span(found.span)
    }

    /// The references at exactly a place.
    pub fn of_span(&self, span: Span) -> &[Reference] {
        let start = self.references.partition_point(|reference| reference.span < span);
        let end = self.references.partition_point(|reference| reference.span <= span);
        &self.references[start..end]
    }
}

/// The index of a resolved program's declarations and references.
pub(crate) fn index(context: &mut Context, ir: &Ir) -> Index {
    let Some(notes) = context.notes.take() else { return Index::default() };
    let mut builder = Builder { context, index: Index { complete: !notes.cut, ..Index::default() } };
    let registers = builder.registers(ir);
    let constants = builder.constants();
    let labels = builder.labels(ir);
    let arrays = builder.arrays();
    let mut blocks = builder.blocks();
    for (sum, variable, name) in &notes.sums {
        if !blocks.contains_key(sum) {
            let text = builder.context.scopes.text(*name).to_owned();
            builder.add(text, SymbolKind::Count, *variable);
            blocks.insert(*sum, builder.last());
        }
    }
    let (macros, parameters) = builder.macros();
    let context = builder.context;
    let symbol = |scope, name: NameId| -> Option<u32> {
        match context.lookup(scope, name) {
            Binding::Register(id) => registers[id.index()],
            Binding::Array(id) => arrays.get(id as usize).copied(),
            Binding::Table(id) => labels.get(context.declared.tables[id as usize].label.0 as usize).copied(),
            Binding::Constant(id) => constants.get(id as usize).copied(),
            Binding::Code(id) | Binding::Data(id) => labels.get(id.0 as usize).copied(),
            Binding::Argument(_) => match context.scopes.scope(context.scopes.scope(scope).owner).kind {
                ScopeKind::Macro(of, _) => parameters.get(&(of, name)).copied(),
                _ => None,
            },
            Binding::Count(_) | Binding::Index(_) => {
                let mut scope = *context.scopes.scope(scope);
                loop {
                    match scope.kind {
                        ScopeKind::Rep(variable, _) | ScopeKind::For(variable, _) if variable == name => {
                            return blocks.get(&scope.site).copied();
                        }
                        ScopeKind::Rep(..) | ScopeKind::For(..) => {
                            scope = *context.scopes.scope(scope.parent)
                        }
                        _ => return None,
                    }
                }
            }
            Binding::None | Binding::Word(_) | Binding::Builtin(_) | Binding::Has(_) => None,
        }
    };
    let names = notes.names.iter().filter_map(|&(span, scope, name)| Some((span, symbol(scope, name)?)));
    let uses = notes.macros.iter().filter_map(|(span, name)| Some((*span, *macros.get(name)?)));
    let mut references: Vec<Reference> =
        names.chain(uses).map(|(span, symbol)| Reference { span, symbol }).collect();
    // Parameters and counts are declared without being looked up, and so are macros.
    let quiet = [SymbolKind::Parameter, SymbolKind::Count, SymbolKind::Macro];
    let declared = (0..).zip(&builder.index.symbols).filter(|(_, symbol)| quiet.contains(&symbol.kind));
    references.extend(declared.map(|(number, symbol)| Reference { span: symbol.span, symbol: number }));
    references.sort_unstable();
    references.dedup();
    let mut index = builder.index;
    index.references = references;
    index.includes = notes.includes;
    index.includes.sort_unstable();
    index.includes.dedup();
    index
}

struct Builder<'c> {
    context: &'c Context,
    index: Index,
}

impl Builder<'_> {
    fn add(&mut self, name: String, kind: SymbolKind, span: Span) -> &mut Symbol {
        let symbols = &mut self.index.symbols;
        symbols.push(Symbol {
            name,
            kind,
            span,
            ty: None,
            place: None,
            value: None,
            word: None,
            sizes: Vec::new(),
            parameters: Vec::new(),
            of: None,
        });
        let last = symbols.len() - 1;
        &mut symbols[last]
    }

    fn last(&self) -> u32 {
        self.index.symbols.len() as u32 - 1
    }

    fn registers(&mut self, ir: &Ir) -> Vec<Option<u32>> {
        let mut numbers = Vec::with_capacity(ir.registers.len());
        for (index, register) in ir.registers.iter().enumerate() {
            let kind = match register.kind {
                _ if register.name.is_empty() => None,
                _ if self.context.declared.results.contains(&RegisterId::new(index)) => None,
                RegisterKind::Plain => Some(SymbolKind::Register),
                RegisterKind::State => Some(SymbolKind::State),
                RegisterKind::Input => Some(SymbolKind::Input),
                RegisterKind::Parameter => Some(SymbolKind::Tunable),
                RegisterKind::Output => Some(SymbolKind::Output),
                RegisterKind::Constant(_) | RegisterKind::Zero => None,
            };
            numbers.push(kind.map(|kind| {
                let symbol = self.add(register.name.clone(), kind, register.span);
                (symbol.ty, symbol.place) = (Some(register.ty), register.pinned);
                self.last()
            }));
        }
        numbers
    }

    fn constants(&mut self) -> Vec<u32> {
        let mut numbers = Vec::new();
        for constant in &self.context.declared.constants {
            self.add(constant.name.clone(), SymbolKind::Constant, constant.span).value = constant.value;
            numbers.push(self.last());
        }
        numbers
    }

    fn arrays(&mut self) -> Vec<u32> {
        let mut numbers = Vec::new();
        for array in &self.context.declared.arrays {
            self.add(array.name.clone(), SymbolKind::Array, array.span).sizes = array.sizes.to_vec();
            numbers.push(self.last());
        }
        numbers
    }

    fn labels(&mut self, ir: &Ir) -> Vec<u32> {
        let mut numbers = Vec::new();
        let tables: HashMap<u32, &Table> =
            self.context.declared.tables.iter().map(|table| (table.label.0, table)).collect();
        // Labels of the assembler itself come last, and have no names.
        for (number, label) in (0..).zip(&ir.labels).filter(|(_, label)| !label.name.is_empty()) {
            let is_data = label.space == Space::Data;
            let kind = match tables.get(&number) {
                Some(_) => SymbolKind::Table,
                None if is_data => SymbolKind::Data,
                None => SymbolKind::Code,
            };
            let symbol = self.add(label.name.clone(), kind, label.span);
            symbol.word = is_data.then_some(label.position);
            if let Some(table) = tables.get(&number) {
                (symbol.sizes, symbol.ty) = (table.array.sizes.to_vec(), Some(table.array.ty));
            }
            numbers.push(self.last());
        }
        numbers
    }

    /// The blocks of the sources, and the symbols of repetitions' counters, by their directive's place.
    fn blocks(&mut self) -> HashMap<Span, u32> {
        let mut counts = HashMap::new();
        for ast in &self.context.asts {
            let line = |statement: u32| {
                let last = || ast.statements.last().map_or(1, |statement| statement.line);
                ast.statements.get(statement as usize).map_or_else(last, |statement| statement.line)
            };
            for directive in &ast.directives {
                let (what, end) = match &directive.kind {
                    DirectiveKind::Macro { end, .. } => (Directive::Macro, *end),
                    DirectiveKind::Rep { variable, end, .. } | DirectiveKind::For { variable, end, .. } => {
                        if let Ok(name) = variable.name.resolve() {
                            let text = self.context.scopes.text(name).to_owned();
                            self.add(text, SymbolKind::Count, variable.span);
                            counts.insert(directive.span, self.last());
                        }
                        let is_rep = matches!(directive.kind, DirectiveKind::Rep { .. });
                        (if is_rep { Directive::Rep } else { Directive::For }, *end)
                    }
                    DirectiveKind::If(_, next) => (Directive::If, *next),
                    DirectiveKind::Elif(_, next, _) => (Directive::If, *next),
                    DirectiveKind::Else(end) => (Directive::If, *end),
                    _ => continue,
                };
                self.index.blocks.push(Block { directive: what, open: directive.span, last_line: line(end) });
            }
        }
        counts
    }

    /// The symbols of macros, and of their parameters.
    fn macros(&mut self) -> (HashMap<NameId, u32>, HashMap<(NameId, NameId), u32>) {
        let (mut macros, mut all) = (HashMap::new(), HashMap::new());
        let scopes = &self.context.scopes;
        let mut definitions: Vec<_> = scopes.macros.iter().collect();
        definitions.sort_by_key(|(_, definition)| definition.span(&self.context.asts));
        for (&id, definition) in definitions {
            let directive =
                &self.context.asts[definition.ast as usize].directives[definition.directive as usize];
            let DirectiveKind::Macro { name, parameters, .. } = &directive.kind else { continue };
            let plain = parameters
                .iter()
                .filter_map(|parameter| Some((parameter.name.name.resolve().ok()?, parameter.name.span)));
            let plain: Vec<(NameId, Span)> = plain.collect();
            let of = scopes.text(id).to_owned();
            let declared = |asked: &Option<ParameterType>| asked.filter(|asked| asked.declared);
            let typed =
                plain.iter().zip(&definition.types.asked).map(|((name, _), asked)| match declared(asked) {
                    Some(asked) => format!("{}:{}", scopes.text(*name), asked.takes.name()),
                    None => scopes.text(*name).to_owned(),
                });
            let names = typed.collect();
            self.add(of.clone(), SymbolKind::Macro, name.span).parameters = names;
            macros.insert(id, self.last());
            for ((parameter, span), asked) in plain.into_iter().zip(&definition.types.asked) {
                let text = scopes.text(parameter).to_owned();
                let symbol = self.add(text, SymbolKind::Parameter, span);
                (symbol.of, symbol.ty) = (Some(of.clone()), declared(asked).and_then(|asked| asked.value()));
                all.insert((id, parameter), self.last());
            }
        }
        (macros, all)
    }
}
