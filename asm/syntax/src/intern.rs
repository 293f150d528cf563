//! Names as numbers. Equal text has equal numbers, so that later stages compare and index instead of hashing text.
//!
//! The interner starts with the names the language knows, in a fixed order: mnemonics, directives, functions, constants.
//! A name is recognised as a mnemonic by its number: the table of instructions is hashed once, here, and no other list of
//! mnemonics exists.

use crate::ast::Directive;
use crate::expr::{BUILTINS, Function};
use crate::name::NameId;
use takt_isa::{Op, ROWS};

const EMPTY: u32 = u32::MAX;

/// An entry of the table.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// The result of [`key`], which distinguishes short names without their text.
    key: u64,
    /// The name's number; [`EMPTY`] if the entry is free.
    id: u32,
}

const FREE: Entry = Entry { key: 0, id: EMPTY };

/// The set of all names.
#[derive(Clone, Debug)]
pub struct Interner {
    /// All names, one after another.
    text: String,
    /// The end of each name in `text`; it begins at the end of the one before.
    ends: Vec<u32>,
    /// Open addressing, by the hash of the key. A power of two of entries, at most half of them used.
    table: Vec<Entry>,
}

impl Default for Interner {
    fn default() -> Interner {
        Interner::new()
    }
}

impl Interner {
    /// An interner that knows the language's own names.
    pub fn new() -> Interner {
        let mut interner = Interner { text: String::new(), ends: Vec::new(), table: vec![FREE; 1 << 12] };
        let known = ROWS
            .iter()
            .map(|row| row.mnemonic)
            .chain(Directive::ALL.iter().map(|directive| directive.name()))
            .chain(Function::ALL.iter().map(|function| function.name()))
            .chain(BUILTINS.iter().map(|builtin| builtin.0));
        for name in known {
            interner.intern(name);
        }
        interner
    }

    /// The number of a name with this key, or the free entry of the table where it belongs.
    #[inline]
    fn find_or_slot(&self, name: &str, key: u64) -> Result<NameId, usize> {
        let mask = self.table.len() - 1;
        let mut slot = hash(key) as usize & mask;
        loop {
            let entry = self.table[slot];
            if entry.id == EMPTY {
                return Err(slot);
            }
            if entry.key == key && (key & LONG == 0 || self.text(NameId(entry.id)) == name) {
                return Ok(NameId(entry.id));
            }
            slot = (slot + 1) & mask;
        }
    }

    /// The name's number, if it has one.
    pub fn find(&self, name: &str) -> Option<NameId> {
        self.find_or_slot(name, key(name.as_bytes())).ok()
    }

    /// The name's number, new if the name is.
    #[inline]
    pub fn intern(&mut self, name: &str) -> NameId {
        let key = key(name.as_bytes());
        match self.find_or_slot(name, key) {
            Ok(id) => id,
            Err(slot) => self.add(name, key, slot),
        }
    }

    /// Adds a name at a free entry of the table.
    fn add(&mut self, name: &str, key: u64, slot: usize) -> NameId {
        let id = self.ends.len() as u32;
        self.table[slot] = Entry { key, id };
        self.text.push_str(name);
        self.ends.push(self.text.len() as u32);
        if self.ends.len() * 2 > self.table.len() {
            self.grow();
        }
        NameId(id)
    }

    /// The name's text.
    #[inline]
    pub fn text(&self, name: NameId) -> &str {
        let index = name.0 as usize;
        let start = if index == 0 { 0 } else { self.ends[index - 1] as usize };
        &self.text[start..self.ends[index] as usize]
    }

    /// The number of names, which are numbered from 0.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    fn grow(&mut self) {
        let size = self.table.len() * 4;
        let mut table = vec![FREE; size];
        for entry in self.table.iter().filter(|entry| entry.id != EMPTY) {
            let mut slot = hash(entry.key) as usize & (size - 1);
            while table[slot].id != EMPTY {
                slot = (slot + 1) & (size - 1);
            }
            table[slot] = *entry;
        }
        self.table = table;
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

/// In the key of a name that has more bytes than a key holds.
const LONG: u64 = 1 << 63;

const K: u64 = 0x9e37_79b9_7f4a_7c15;

/// Multiply and fold.
#[inline]
fn fold(h: u64, word: u64) -> u64 {
    let product = u128::from(h ^ word) * u128::from(K);
    (product as u64) ^ ((product >> 64) as u64)
}

/// Up to seven bytes are their own key, with their number in the eighth. A longer name's is a hash of its bytes, eight at a time;
/// the last eight overlap those before.
#[inline]
fn key(bytes: &[u8]) -> u64 {
    let four = |bytes: &[u8; 4]| u64::from(u32::from_le_bytes(*bytes));
    let length = bytes.len();
    if let Some(last) = bytes.last_chunk() {
        let mut h = K ^ length as u64;
        for chunk in bytes[..length - 1].as_chunks().0 {
            h = fold(h, u64::from_le_bytes(*chunk));
        }
        return fold(h, u64::from_le_bytes(*last)) | LONG;
    }
    let word = match (bytes.first_chunk(), bytes.last_chunk()) {
        // The bytes in which the two overlap are the same.
        (Some(first), Some(last)) => four(first) | four(last) << (8 * (length - 4)),
        _ => bytes.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte)),
    };
    word | (length as u64) << 56
}

/// The index of a key's entry.
#[inline]
fn hash(key: u64) -> u64 {
    let h = fold(K, key);
    h ^ h >> 29
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
        // One name in two lists would shift the numbers of all that follow.
        let count = NameId::BUILTINS as usize + BUILTINS.len();
        assert_eq!(Interner::new().count(), count);
    }

    #[test]
    fn names_of_every_length_are_told_apart() {
        let mut interner = Interner::new();
        let texts: Vec<String> = (0..40)
            .flat_map(|length| {
                let whole = "abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyz"[..length].to_owned();
                // Another in each place, and one that is longer by a byte that the key has too.
                let others = (0..length).map({
                    let whole = whole.clone();
                    move |at| format!("{}_{}", &whole[..at], &whole[at + 1..])
                });
                [format!("{whole}\0"), whole].into_iter().chain(others).collect::<Vec<_>>()
            })
            .collect();
        let first: Vec<NameId> = texts.iter().map(|text| interner.intern(text)).collect();
        for (text, id) in texts.iter().zip(first) {
            assert_eq!((interner.text(id), interner.find(text)), (text.as_str(), Some(id)));
        }
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
