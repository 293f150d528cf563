// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instructions for the operators and functions of equations, from the instruction table, by form and by type.

use crate::ir::type_evidence::Kind;
use std::collections::HashMap;
use takt_isa::spec::instructions::compute;
use takt_isa::{Effect, Op, ROWS, Row, Type};

/// An instruction that computes an operator or a function.
#[derive(Clone, Debug)]
pub(crate) struct Meaning {
    pub(crate) op: Op,
    /// By operand of the form: the index of the instruction's source.
    pub(crate) sources: Vec<usize>,
}

/// Instructions by their form in equations: symbol and number of operands.
pub(crate) struct Forms {
    forms: HashMap<(String, usize), Vec<Meaning>>,
    /// By instruction: sources whose bits may become the result ([`passed`]).
    passed: Vec<Vec<usize>>,
}

impl Forms {
    pub(crate) fn new() -> Forms {
        let mut forms: HashMap<(String, usize), Vec<Meaning>> = HashMap::new();
        for row in ROWS {
            for form in row.forms() {
                let meaning = Meaning { op: row.op, sources: form.sources.clone() };
                forms.entry((form.symbol, form.sources.len())).or_default().push(meaning);
            }
        }
        Forms { forms, passed: ROWS.iter().map(passed).collect() }
    }

    /// The instructions of a symbol with this number of operands.
    pub(crate) fn get(&self, symbol: &str, operands: usize) -> &[Meaning] {
        self.forms.get(&(symbol.to_owned(), operands)).map_or(&[], Vec::as_slice)
    }

    /// The least number of operands with which a symbol has a meaning.
    pub(crate) fn operands(&self, symbol: &str) -> Option<usize> {
        self.forms.keys().filter(|(known, _)| known == symbol).map(|(_, operands)| *operands).min()
    }

    /// The names of functions.
    pub(crate) fn functions(&self) -> Vec<&str> {
        let names = self.forms.keys().map(|(symbol, _)| symbol.as_str());
        let mut names: Vec<&str> =
            names.filter(|name| name.starts_with(|c: char| c.is_ascii_alphabetic())).collect();
        names.sort_unstable();
        names
    }

    /// Sources of an instruction whose bits may become its result.
    pub(crate) fn passed(&self, op: Op) -> &[usize] {
        &self.passed[op as usize]
    }

    /// The function that converts from one type to another.
    pub(crate) fn conversion(&self, from: Type, to: Type) -> Option<&str> {
        let converts = |row: &Row| row.effect == Effect::Compute && row.types == [to, from];
        let mut found =
            self.forms.iter().filter(|(_, meanings)| meanings.iter().any(|m| converts(m.op.row())));
        found.next().map(|((symbol, _), _)| symbol.as_str())
    }

    /// Type of an instruction's result, given the types of its sources.
    pub(crate) fn result(&self, op: Op, source: impl Fn(usize) -> Kind) -> Kind {
        let row = op.row();
        if row.result_type() != Type::B {
            return Kind::of(row.result_type());
        }
        let passed = self.passed(op);
        let all: Vec<usize> = (0..row.shape.sources()).collect();
        let from = if passed.is_empty() { &all[..] } else { passed };
        from.iter().map(|which| source(*which)).reduce(Kind::join).unwrap_or(Kind::Any)
    }
}

/// Sources whose bits may become an instruction's result; empty if it computes new bits. Found by executing the instruction
/// on patterns that only a copy returns.
pub(crate) fn passed(row: &Row) -> Vec<usize> {
    const PATTERNS: [u32; 3] = [0x1234_5679, 0xa5b6_c7d3, 0x5e8f_9a1b];
    let mut passed = Vec::new();
    if row.effect != Effect::Compute || row.result_type() != Type::B {
        return passed;
    }
    for first in [PATTERNS[0], 0] {
        let sources = [first, PATTERNS[1], PATTERNS[2]];
        let result = compute::<takt_isa::fp::Host>(row.op, sources[0], sources[1], sources[2]).bits;
        match sources[..row.shape.sources()].iter().position(|source| *source == result) {
            Some(which) if passed.contains(&which) => {}
            Some(which) => passed.push(which),
            None => return Vec::new(),
        }
    }
    passed
}
