// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names as numbers. Equal text has equal numbers, so that later stages compare and index instead of hashing text.
//!
//! The interner starts with the names the language knows, in a fixed order: mnemonics, directives, functions, constants.
//! A name is recognised as a mnemonic by its number: the table of instructions is hashed once, here, and no other list of
//! mnemonics exists.

use crate::ast::Directive;
use crate::expr::{BUILTINS, Function};
use crate::name::NameId;
use foldhash::fast::RandomState;
use indexmap::IndexSet;
use takt_isa::{Op, ROWS};

/// The set of all names, by number.
#[derive(Clone, Debug)]
pub struct Interner {
    names: IndexSet<Box<str>, RandomState>,
}

impl Default for Interner {
    fn default() -> Interner {
        Interner::new()
    }
}

impl Interner {
    /// An interner that knows the language's own names.
    pub fn new() -> Interner {
        let known = ROWS
            .iter()
            .map(|row| row.mnemonic)
            .chain(Directive::ALL.iter().map(|directive| directive.name()))
            .chain(Function::ALL.iter().map(|function| function.name()))
            .chain(BUILTINS.iter().map(|builtin| builtin.0));
        Interner { names: known.map(Box::from).collect() }
    }

    /// The number of a name; `None` if the interner does not know the name.
    pub fn find(&self, name: &str) -> Option<NameId> {
        self.names.get_index_of(name).map(|index| NameId(index as u32))
    }

    /// The number of a name, which is added if it is new.
    #[inline]
    pub fn intern(&mut self, name: &str) -> NameId {
        self.find(name).unwrap_or_else(|| NameId(self.names.insert_full(name.into()).0 as u32))
    }

    /// The text of a name, by its number.
    #[inline]
    pub fn text(&self, name: NameId) -> &str {
        &self.names[name.0 as usize]
    }

    /// The number of names, which are numbered from 0.
    pub fn count(&self) -> usize {
        self.names.len()
    }
}

impl NameId {
    const DIRECTIVES: u32 = ROWS.len() as u32;
    const FUNCTIONS: u32 = NameId::DIRECTIVES + Directive::ALL.len() as u32;
    const BUILTINS: u32 = NameId::FUNCTIONS + Function::ALL.len() as u32;

    /// The instruction of this mnemonic.
    #[inline]
    pub fn op(self) -> Option<Op> {
        ROWS.get(self.0 as usize).map(|row| row.op)
    }

    /// The directive of this name, its point included.
    #[inline]
    pub fn directive(self) -> Option<Directive> {
        self.0.checked_sub(NameId::DIRECTIVES).and_then(|i| Directive::ALL.get(i as usize)).copied()
    }

    /// The number of a directive's name.
    pub fn of_directive(directive: Directive) -> NameId {
        let index = Directive::ALL.iter().position(|known| *known == directive).unwrap_or(0);
        NameId(NameId::DIRECTIVES + index as u32)
    }

    /// The function of this name.
    pub fn function(self) -> Option<Function> {
        self.0.checked_sub(NameId::FUNCTIONS).and_then(|i| Function::ALL.get(i as usize)).copied()
    }

    /// The index in [`BUILTINS`] of the constant of this name. `e`, `pi` and the like may be declared as something else.
    pub fn builtin(self) -> Option<usize> {
        let index = self.0.checked_sub(NameId::BUILTINS)? as usize;
        (index < BUILTINS.len()).then_some(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_names_are_found_by_number() {
        let mut interner = Interner::new();
        assert_eq!(interner.intern("fadd").op(), Some(Op::fadd));
        assert_eq!(interner.intern(".rep").directive(), Some(Directive::Rep));
        assert_eq!(interner.intern("sqrt").function(), Some(Function::Sqrt));
        assert_eq!(interner.intern("pi").builtin().map(|b| BUILTINS[b].0), Some("pi"));
        let new = interner.intern("q1");
        assert_eq!((new.op(), new.directive(), new.function(), new.builtin()), (None, None, None, None));
    }

    #[test]
    fn known_names_are_distinct() {
        // A name in two lists would shift the numbers of all names after it.
        let count = NameId::BUILTINS as usize + BUILTINS.len();
        assert_eq!(Interner::new().count(), count);
    }

    #[test]
    fn growth_keeps_numbers() {
        let mut interner = Interner::new();
        let first: Vec<NameId> = (0..20_000).map(|i| interner.intern(&format!("n{i}"))).collect();
        for (i, id) in first.iter().enumerate() {
            assert_eq!(interner.text(*id), format!("n{i}"));
            assert_eq!(interner.intern(&format!("n{i}")), *id);
        }
    }
}
