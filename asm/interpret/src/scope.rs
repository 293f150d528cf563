// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names and their meanings, by scope.

use crate::Number;
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;
use takt_isa::Type;
use takt_syntax::ast::Operand;

/// An array: first cell or word, sizes, type.
#[derive(Clone, Debug)]
pub(crate) struct Array {
    pub(crate) first: usize,
    pub(crate) sizes: Vec<i64>,
    pub(crate) ty: Type,
}

/// Meaning of a name.
#[derive(Clone, Debug)]
pub(crate) enum Meaning {
    /// A register, by its cell.
    Cell(usize),
    Registers(Array),
    Memory(Array),
    /// A constant, a count, the index of a loop.
    Number(Number),
    /// A code label, by its number.
    Label(usize),
    /// A parameter: the argument in its place, and the argument's scope.
    Argument(Operand, Rc<Scope>),
}

/// Kinds of declarations that a scope accepts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum DeclarationFilter {
    /// Everything: the program, the use of a macro.
    All,
    /// Code labels: an iteration of a counted loop.
    Labels,
    /// No declaration: the scope holds only the names that it was made for.
    Nothing,
}

#[derive(Debug)]
pub(crate) struct Scope {
    around: Option<Rc<Scope>>,
    takes: DeclarationFilter,
    names: RefCell<HashMap<String, Meaning>>,
}

impl Scope {
    pub(crate) fn new(around: Option<&Rc<Scope>>, takes: DeclarationFilter) -> Rc<Scope> {
        Rc::new(Scope { around: around.cloned(), takes, names: RefCell::default() })
    }

    /// A nested scope that binds an index to a value.
    pub(crate) fn counting(
        around: &Rc<Scope>,
        takes: DeclarationFilter,
        name: &str,
        value: i64,
    ) -> Rc<Scope> {
        let scope = Scope::new(Some(around), takes);
        scope.bind(name, Meaning::Number(Number::Int(value)));
        scope
    }

    pub(crate) fn bind(&self, name: &str, meaning: Meaning) {
        self.names.borrow_mut().insert(name.to_owned(), meaning);
    }

    /// The meaning of a name in this scope.
    pub(crate) fn find(&self, name: &str) -> Option<Meaning> {
        let own = self.names.borrow().get(name).cloned();
        own.or_else(|| self.around.as_ref()?.find(name))
    }

    /// The innermost scope that accepts declarations: of labels if `labels`, of other names if not.
    pub(crate) fn declaring(scope: &Rc<Scope>, labels: bool) -> Rc<Scope> {
        match (scope.takes, &scope.around) {
            (DeclarationFilter::All, _) | (_, None) => Rc::clone(scope),
            (DeclarationFilter::Labels, _) if labels => Rc::clone(scope),
            (_, Some(around)) => Scope::declaring(around, labels),
        }
    }

    /// The name is declared in this scope itself.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.names.borrow().contains_key(name)
    }
}
