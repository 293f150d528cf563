//! Names and the scopes that they are declared in.

use crate::ir::{LabelId, RegisterId};
use crate::report::diag::Diagnostic;
use crate::report::source::Span;
use crate::syntax::ast::{Ast, DirectiveKind};
use crate::syntax::intern::Interner;
use crate::syntax::name::NameId;
use std::collections::HashMap;
use std::rc::Rc;

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

/// What a name means.
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
    /// The name that a repetition counts with.
    Count(i64),
    /// `pi` and the like.
    Builtin(u32),
    /// Whether the machine has the instruction that the name asks for.
    Has(bool),
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct MacroDefinition {
    /// The tree that it is defined in, and the directive there.
    pub(crate) ast: u32,
    pub(crate) directive: u32,
    /// First statement of the body.
    pub(crate) start: u32,
    pub(crate) uses: u32,
}

impl MacroDefinition {
    /// How many parameters it has, and where its name stands in the definition.
    pub(crate) fn parameters(&self, asts: &[Rc<Ast>]) -> (usize, Span) {
        match &asts[self.ast as usize].directives[self.directive as usize].kind {
            DirectiveKind::Macro { parameters, name, .. } => (parameters.len(), name.span),
            _ => (0, self.span(asts)),
        }
    }

    /// Where the macro is defined.
    pub(crate) fn span(&self, asts: &[Rc<Ast>]) -> Span {
        asts[self.ast as usize].directives[self.directive as usize].span
    }
}

/// Every name, and what it is bound to in each scope.
pub(crate) struct Scopes {
    names: Interner,
    scopes: Vec<Scope>,
    /// What names mean in the root scope, by number.
    globals: Vec<Binding>,
    locals: HashMap<(u32, NameId), Binding>,
    pub(crate) macros: HashMap<NameId, MacroDefinition>,
}

impl Scopes {
    pub(crate) fn new() -> Scopes {
        let root = Scope {
            parent: ScopeId::ROOT,
            owner: ScopeId::ROOT,
            within: ScopeId::ROOT,
            kind: ScopeKind::Root,
            site: Span::default(),
        };
        Scopes {
            names: Interner::new(),
            scopes: vec![root],
            globals: Vec::new(),
            locals: HashMap::new(),
            macros: HashMap::new(),
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

    pub(crate) fn scope(&self, id: ScopeId) -> &Scope {
        &self.scopes[id.0 as usize]
    }

    /// A new scope, for an expansion.
    pub(crate) fn open(&mut self, parent: ScopeId, within: ScopeId, kind: ScopeKind, site: Span) -> ScopeId {
        let id = ScopeId(self.scopes.len() as u32);
        let owner = if matches!(kind, ScopeKind::Macro(..)) { id } else { self.scope(parent).owner };
        self.scopes.push(Scope { parent, owner, within, kind, site });
        id
    }

    /// What a name is bound to in a scope, or in those around it.
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
        self.globals.get(name.0 as usize).copied().unwrap_or(Binding::None)
    }

    /// What a name is bound to in one scope that takes declarations.
    pub(crate) fn bound(&self, owner: ScopeId, name: NameId) -> Binding {
        let binding = if owner == ScopeId::ROOT {
            self.globals.get(name.0 as usize)
        } else {
            self.locals.get(&(owner.0, name))
        };
        binding.copied().unwrap_or(Binding::None)
    }

    /// Binds a name in a scope, without asking whether it is bound.
    pub(crate) fn bind(&mut self, scope: ScopeId, name: NameId, binding: Binding) {
        if scope == ScopeId::ROOT {
            let index = name.0 as usize;
            if index >= self.globals.len() {
                self.globals.resize((index + 1).max(self.names.count()), Binding::None);
            }
            self.globals[index] = binding;
        } else {
            self.locals.insert((scope.0, name), binding);
        }
    }

    /// The text of a name declared in a scope, as the symbol map shows it: unique to a macro's use.
    pub(crate) fn full_name(&self, scope: ScopeId, name: NameId) -> String {
        let text = self.text(name);
        self.scope_name(scope).map_or_else(|| text.to_owned(), |scope| format!("{scope}.{text}"))
    }

    /// What stands before the names that are declared in a scope: the macro and which of its uses; `None` outside of macros.
    pub(crate) fn scope_name(&self, scope: ScopeId) -> Option<String> {
        let owner = self.scope(scope).owner;
        match self.scope(owner).kind {
            ScopeKind::Macro(of, number) => Some(format!("{}.{number}", self.text(of))),
            _ => None,
        }
    }

    /// A diagnostic with the expansions that led to its scope.
    pub(crate) fn with_expansions(&self, mut scope: ScopeId, mut diagnostic: Diagnostic) -> Diagnostic {
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
                    diagnostic.also(site, format!("in this use of `{}`", self.text(name)))
                }
                ScopeKind::Rep(name, value) => {
                    diagnostic.also(site, format!("with {} = {value}", self.text(name)))
                }
                ScopeKind::Root => diagnostic,
            };
            scope = within;
        }
        diagnostic
    }
}
