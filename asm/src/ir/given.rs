// SPDX-License-Identifier: MIT OR Apache-2.0
//! Types that the source gives to operands whose type the instruction leaves open.

use crate::ir::{Label, LabelId, Operation};
use crate::report::source::Span;
use crate::syntax::expr::Value;
use foldhash::HashMap;
use smallvec::SmallVec;
use takt_isa::Type;
use takt_isa::program::Space;

/// The known type of a value: an abstract value of the type check.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind {
    /// Nothing is written yet.
    None,
    Float,
    Int,
    /// Any bits, or either.
    Any,
}

impl Kind {
    pub(crate) const fn of(ty: Type) -> Kind {
        match ty {
            Type::F => Kind::Float,
            Type::I => Kind::Int,
            Type::B => Kind::Any,
        }
    }

    pub(crate) fn join(self, other: Kind) -> Kind {
        match (self, other) {
            (Kind::None, kind) | (kind, Kind::None) => kind,
            (a, b) if a == b => a,
            _ => Kind::Any,
        }
    }

    /// The type, if it is certainly not the wanted one.
    pub(crate) fn mistaken_for(self, wanted: Type) -> Option<Type> {
        match (self, wanted) {
            (Kind::Float, Type::I) => Some(Type::F),
            (Kind::Int, Type::F) => Some(Type::I),
            _ => None,
        }
    }
}

/// The types of the tables of data memory, given those of its words: what all words of a table have in common. Each goes from
/// its label to the next table's.
pub(crate) fn tables(labels: &[Label], types: &[Type]) -> HashMap<LabelId, Kind> {
    let mut starts: Vec<usize> =
        labels.iter().filter(|label| label.is_table()).map(|label| label.position as usize).collect();
    starts.push(types.len());
    starts.sort_unstable();
    let table = |(number, label): (usize, &Label)| {
        let start = label.position as usize;
        let end = starts[starts.partition_point(|next| *next <= start).min(starts.len() - 1)];
        let kinds = types.get(start..end).unwrap_or(&[]).iter().map(|ty| Kind::of(*ty));
        (LabelId(number as u32), kinds.reduce(Kind::join).unwrap_or(Kind::Any))
    };
    let labels = labels.iter().enumerate().filter(|(_, label)| label.space == Space::Data);
    labels.map(table).collect()
}

/// An operand of an operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum OperandPosition {
    Dest,
    Source(u8),
    Immediate,
    /// The table that a memory operand lies in.
    Table,
}

/// The evidence of a type in the source.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Given {
    /// It is taken as this type.
    Cast(Type),
    Literal {
        kind: Kind,
        what: TypeOrigin,
        span: Span,
    },
    Table(LabelId),
}

impl Given {
    /// A constant where any bits are taken, and whether it is an address.
    pub(crate) fn literal(value: Value, is_address: bool, span: Span) -> Given {
        let (kind, what) = match value {
            Value::Int(_) if is_address => (Kind::Int, TypeOrigin::Address),
            // The pattern of an ordinary number, as `bits(0.5)` gives it, may be either.
            Value::Int(int) => {
                let bits = f32::from_bits(int as u32);
                let kind = if bits.is_subnormal() || bits.is_nan() { Kind::Int } else { Kind::Any };
                (kind, TypeOrigin::Literal(value))
            }
            Value::Real(_) => (Kind::Float, TypeOrigin::Literal(value)),
        };
        Given::Literal { kind, what, span }
    }
}

/// An operation: the tree that it is written in, its number there, and the expansion.
type OperationKey = (u32, u32, u32);

/// The evidence for operands, by tree, operation of the tree, and expansion.
#[derive(Default)]
pub(crate) struct GivenTypes(HashMap<OperationKey, SmallVec<[(OperandPosition, Given); 1]>>);

impl GivenTypes {
    pub(crate) fn insert(&mut self, operation: &Operation, part: OperandPosition, given: Given) {
        let (ast, number) = operation.written;
        let parts = self.0.entry((ast, number, operation.expansion)).or_default();
        // The same source twice, as a file that is included twice.
        parts.retain(|(known, _)| *known != part);
        parts.push((part, given));
    }

    #[inline]
    pub(crate) fn get(&self, operation: &Operation, part: OperandPosition) -> Option<Given> {
        if self.0.is_empty() { None } else { self.find(operation, part) }
    }

    fn find(&self, operation: &Operation, part: OperandPosition) -> Option<Given> {
        let (ast, number) = operation.written;
        let parts = self.0.get(&(ast, number, operation.expansion))?;
        parts.iter().find(|(known, _)| *known == part).map(|(_, given)| *given)
    }
}

/// The origin of a value's type.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TypeOrigin {
    Literal(Value),
    /// A label's address.
    Address,
    /// An operation's result.
    Result(&'static str),
    /// A declaration.
    Declared,
    /// A table in data memory.
    Table,
}
