// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names and the scopes that they are declared in.

use crate::context::parameters::Parameters;
use crate::ir::{LabelId, RegisterId};
use foldhash::HashMap;
use std::fmt::Write as _;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_syntax::ast::{Ast, DirectiveKind};
use takt_syntax::intern::Interner;
use takt_syntax::name::NameId;

/// An expansion: the scope of a use of a macro, or of one turn of a repetition.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug, PartialOrd, Ord)]
pub(crate) struct ScopeId(pub(crate) u32);

impl ScopeId {
    pub(crate) const ROOT: ScopeId = ScopeId(0);
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Scope {
    /// The enclosing scope, where names that are not bound here are looked up.
    pub(crate) parent: ScopeId,
    /// The scope that takes declarations: the macro's use, or the root.
    pub(crate) owner: ScopeId,
    /// The scope that takes code labels: the owner, or within it an iteration of a counted loop as the assembler writes it.
    pub(crate) labels: ScopeId,
    /// The expansion that contains this one, for messages; unlike the parent, since a macro does not see its caller's names.
    pub(crate) within: ScopeId,
    pub(crate) kind: ScopeKind,
    /// Place of the macro's use, or of the `.rep`.
    pub(crate) site: Span,
    /// For a macro's use and an iteration: index of the latest entry in the list of near names, and number of such entries.
    latest: u32,
    near: u32,
}

/// A name of a macro's use, in a linked list: `before` is the index of the previous entry.
struct MacroName {
    name: NameId,
    binding: Binding,
    before: u32,
}

/// Names of a macro's use that are searched linearly, which is faster for the few parameters that most uses have. A table
/// for all uses holds the others.
const NEAR: u32 = 8;

#[derive(Clone, Copy, Debug)]
pub(crate) enum ScopeKind {
    Root,
    /// Name of the macro, and number of the use.
    Macro(NameId, u32),
    /// Name and value of the counter.
    Rep(NameId, i64),
    /// Name of the index variable, and its number in [`Declarations::indices`](crate::context::Declarations::indices).
    For(NameId, u32),
}

/// The binding of a name.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Binding {
    None,
    Register(RegisterId),
    /// An array of registers: an index into the arrays.
    Array(u32),
    Constant(u32),
    Code(LabelId),
    Data(LabelId),
    /// A parameter: an index into the arguments.
    Argument(u32),
    /// Value of the counter of a repetition.
    Count(i64),
    /// The index variable of a counted loop: an index into [`Declarations::indices`](crate::context::Declarations::indices).
    Index(u32),
    /// An array in data memory: an index into [`Declarations::tables`](crate::context::Declarations::tables).
    Table(u32),
    /// An array element in data memory; an index into the elements seen so far.
    Word(u32),
    /// A constant such as `pi`: an index into the built-in constants.
    Builtin(u32),
    /// A `has.` or `macro.` constant: true if the machine has the instruction, or the macro exists.
    Has(bool),
}

#[derive(Clone, Debug)]
pub(crate) struct MacroDefinition {
    /// The tree and the directive of the definition.
    pub(crate) ast: u32,
    pub(crate) directive: u32,
    /// First statement of the body.
    pub(crate) start: u32,
    pub(crate) uses: u32,
    /// Types of the parameters.
    pub(crate) types: Rc<Parameters>,
}

impl MacroDefinition {
    /// The number of parameters, and the place of the name in the definition.
    pub(crate) fn parameters(&self, asts: &[Rc<Ast>]) -> (usize, Span) {
        match &asts[self.ast as usize].directives[self.directive as usize].kind {
            DirectiveKind::Macro { parameters, name, .. } => (parameters.len(), name.span),
            _ => (0, self.span(asts)),
        }
    }

    /// The name and the parameters, as the definition writes them.
    pub(crate) fn declaration(&self, asts: &[Rc<Ast>]) -> Span {
        let line = &asts[self.ast as usize].directives[self.directive as usize];
        match &line.kind {
            DirectiveKind::Macro { name, .. } => Span::new(name.span.start, line.span.end),
            _ => line.span,
        }
    }

    pub(crate) fn span(&self, asts: &[Rc<Ast>]) -> Span {
        asts[self.ast as usize].directives[self.directive as usize].span
    }
}

/// Names, scopes, and the bindings of names in scopes.
pub(crate) struct Scopes {
    names: Interner,
    scopes: Vec<Scope>,
    /// The bindings of the root scope, by the name's number.
    globals: Vec<Binding>,
    near: Vec<MacroName>,
    locals: HashMap<(u32, NameId), Binding>,
    pub(crate) macros: HashMap<NameId, MacroDefinition>,
    /// By name: the number of labels in counted loops so far.
    iterated: HashMap<NameId, u32>,
}

impl Scopes {
    pub(crate) fn new() -> Scopes {
        let root = Scope {
            parent: ScopeId::ROOT,
            owner: ScopeId::ROOT,
            labels: ScopeId::ROOT,
            within: ScopeId::ROOT,
            kind: ScopeKind::Root,
            site: Span::default(),
            latest: 0,
            near: 0,
        };
        Scopes {
            names: Interner::new(),
            scopes: vec![root],
            globals: Vec::new(),
            near: Vec::new(),
            locals: HashMap::default(),
            macros: HashMap::default(),
            iterated: HashMap::default(),
        }
    }

    pub(crate) fn names(&self) -> &Interner {
        &self.names
    }

    pub(crate) fn names_mut(&mut self) -> &mut Interner {
        &mut self.names
    }

    pub(crate) fn text(&self, name: NameId) -> &str {
        self.names.text(name)
    }

    /// Number of scopes; all ids are below it.
    pub(crate) fn count(&self) -> usize {
        self.scopes.len()
    }

    pub(crate) fn scope(&self, id: ScopeId) -> &Scope {
        &self.scopes[id.0 as usize]
    }

    /// A new scope, for an expansion.
    pub(crate) fn open(&mut self, parent: ScopeId, within: ScopeId, kind: ScopeKind, site: Span) -> ScopeId {
        let id = ScopeId(self.scopes.len() as u32);
        let Scope { owner, labels, .. } = *self.scope(parent);
        let (owner, labels) = if matches!(kind, ScopeKind::Macro(..)) { (id, id) } else { (owner, labels) };
        self.scopes.push(Scope { parent, owner, labels, within, kind, site, latest: 0, near: 0 });
        id
    }

    /// A new scope for a written-out iteration of a counted loop, or for the body of a loop at run time. The scope takes code labels.
    pub(crate) fn open_iteration(&mut self, parent: ScopeId, kind: ScopeKind, site: Span) -> ScopeId {
        let id = self.open(parent, parent, kind, site);
        self.scopes[id.0 as usize].labels = id;
        id
    }

    /// The binding of a name in a scope, or in the enclosing scopes.
    #[inline(always)]
    pub(crate) fn lookup(&self, scope: ScopeId, name: NameId) -> Binding {
        if scope != ScopeId::ROOT
            && let Some(binding) = self.expanded(scope, name)
        {
            return binding;
        }
        self.globals.get(name.0 as usize).copied().unwrap_or(Binding::None)
    }

    /// The name is the index of a `.for` loop of which this scope is an iteration that is written out.
    pub(crate) fn is_loop_index(&self, mut scope: ScopeId, name: NameId) -> bool {
        while scope != ScopeId::ROOT {
            let here = self.scope(scope);
            if matches!(here.kind, ScopeKind::Rep(variable, _) if variable == name) {
                return here.labels == scope;
            }
            scope = here.parent;
        }
        false
    }

    /// The binding of a name by an expansion, or by the enclosing expansions.
    fn expanded(&self, mut scope: ScopeId, name: NameId) -> Option<Binding> {
        while scope != ScopeId::ROOT {
            let here = self.scope(scope);
            match here.kind {
                ScopeKind::Rep(variable, value) if variable == name => return Some(Binding::Count(value)),
                ScopeKind::For(variable, index) if variable == name => return Some(Binding::Index(index)),
                _ if here.labels == scope => {
                    if let Some(binding) = self.local(scope, name) {
                        return Some(binding);
                    }
                }
                _ => {}
            }
            scope = here.parent;
        }
        None
    }

    /// The binding of a name in one scope that takes declarations.
    pub(crate) fn bound(&self, owner: ScopeId, name: NameId) -> Binding {
        let binding = if owner == ScopeId::ROOT {
            self.globals.get(name.0 as usize).copied()
        } else {
            self.local(owner, name)
        };
        binding.unwrap_or(Binding::None)
    }

    /// Binds a name in a scope, replacing an earlier binding.
    pub(crate) fn bind(&mut self, scope: ScopeId, name: NameId, binding: Binding) {
        if scope == ScopeId::ROOT {
            let index = name.0 as usize;
            if index >= self.globals.len() {
                self.globals.resize((index + 1).max(self.names.count()), Binding::None);
            }
            self.globals[index] = binding;
        } else {
            match self.near_index(scope, name) {
                Some(index) => self.near[index].binding = binding,
                None if self.scope(scope).near < NEAR => {
                    let index = self.near.len() as u32;
                    let of = &mut self.scopes[scope.0 as usize];
                    self.near.push(MacroName { name, binding, before: of.latest });
                    (of.latest, of.near) = (index, of.near + 1);
                }
                None => {
                    self.locals.insert((scope.0, name), binding);
                }
            }
        }
    }

    /// The index of a name in the list that is searched linearly.
    #[inline]
    fn near_index(&self, scope: ScopeId, name: NameId) -> Option<usize> {
        let Scope { latest, near, .. } = *self.scope(scope);
        let mut index = latest as usize;
        for _ in 0..near {
            if self.near[index].name == name {
                return Some(index);
            }
            index = self.near[index].before as usize;
        }
        None
    }

    /// The binding of a name in a use of a macro.
    #[inline]
    fn local(&self, scope: ScopeId, name: NameId) -> Option<Binding> {
        if let Some(index) = self.near_index(scope, name) {
            return Some(self.near[index].binding);
        }
        if self.scope(scope).near < NEAR {
            return None;
        }
        self.locals.get(&(scope.0, name)).copied()
    }

    /// The text of a name declared in a scope, as the symbol map shows it: unique to a macro's use.
    pub(crate) fn full_name(&self, scope: ScopeId, name: NameId) -> String {
        let text = self.text(name);
        self.scope_name(scope).map_or_else(|| text.to_owned(), |scope| format!("{scope}.{text}"))
    }

    /// The text of a code label, as the symbol map shows it; a label in a counted loop gets a running number, which makes it unique.
    pub(crate) fn label_name(&mut self, scope: ScopeId, name: NameId) -> String {
        let text = self.full_name(scope, name);
        let Scope { owner, labels, .. } = *self.scope(scope);
        if owner == labels {
            return text;
        }
        let number = self.iterated.entry(name).or_default();
        *number += 1;
        format!("{text}.{number}")
    }

    /// Prefix of names that are declared in a scope: the macro and the number of its use; `None` outside of macros.
    pub(crate) fn scope_name(&self, scope: ScopeId) -> Option<String> {
        let owner = self.scope(scope).owner;
        match self.scope(owner).kind {
            ScopeKind::Macro(of, number) => {
                let of = self.text(of);
                // Reserve room for any number, since every use has such a name.
                let mut name = String::with_capacity(of.len() + 11);
                name.push_str(of);
                // Writing to a string cannot fail.
                let _ = write!(name, ".{number}");
                Some(name)
            }
            _ => None,
        }
    }

    /// A diagnostic with the expansions that led to its scope.
    pub(crate) fn with_expansions(&self, mut scope: ScopeId, mut diagnostic: Diagnostic) -> Diagnostic {
        let mut shown = 0;
        while scope != ScopeId::ROOT {
            let Scope { kind, site, within, .. } = *self.scope(scope);
            if diagnostic.labels.iter().any(|label| label.span == site) {
                // A macro that uses itself is shown once.
                scope = within;
                continue;
            }
            shown += 1;
            if shown > 4 {
                return diagnostic.note("… and further expansions around these");
            }
            diagnostic = match kind {
                ScopeKind::Macro(name, _) => {
                    diagnostic.also(site, format!("in this use of `{}`", self.text(name)))
                }
                ScopeKind::Rep(name, value) => {
                    diagnostic.also(site, format!("with {} = {value}", self.text(name)))
                }
                // A loop at run time has no value to show: every iteration is the same.
                ScopeKind::For(..) | ScopeKind::Root => diagnostic,
            };
            scope = within;
        }
        diagnostic
    }
}
