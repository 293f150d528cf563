// SPDX-License-Identifier: MIT OR Apache-2.0
//! Types that the source gives to operands whose type the instruction leaves open.

use crate::ir::{Label, LabelId, Operation};
use foldhash::HashMap;
use smallvec::SmallVec;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_isa::program::Space;
use takt_syntax::expr::Value;

/// The known type of a value: an abstract value of the type check.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind {
    /// No value has been written yet.
    None,
    Float,
    Int,
    /// Any bits, or a float or an integer.
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

    /// The kind; `other` for untyped bits and for values not yet written.
    pub(crate) fn or(self, other: Kind) -> Kind {
        match self {
            Kind::None | Kind::Any if other != Kind::None => other,
            kind => kind,
        }
    }

    /// The type, if it certainly differs from the wanted one.
    pub(crate) fn mistaken_for(self, wanted: Type) -> Option<Type> {
        match (self, wanted) {
            (Kind::Float, Type::I) => Some(Type::F),
            (Kind::Int, Type::F) => Some(Type::I),
            _ => None,
        }
    }
}

/// Types of the tables of data memory: the common type of a table's words. A table goes from its label to the next table's.
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
pub(crate) enum TypeEvidence {
    /// The source takes the operand as this type.
    Cast(Type),
    /// The operand is an argument of a macro whose parameter asks for this type, float or int.
    Asked(Type),
    Literal {
        kind: Kind,
        what: TypeOrigin,
        span: Span,
    },
    Table(LabelId),
}

impl TypeEvidence {
    /// Evidence from a constant as an operand that takes any bits; `is_address` marks the address of a label.
    pub(crate) fn literal(value: Value, is_address: bool, span: Span) -> TypeEvidence {
        let (kind, what) = match value {
            Value::Int(_) if is_address => (Kind::Int, TypeOrigin::Address),
            // The bits of an ordinary number, such as `bits(0.5)`, may be of either type.
            Value::Int(int) => {
                let bits = f32::from_bits(int as u32);
                let kind = if bits.is_subnormal() || bits.is_nan() { Kind::Int } else { Kind::Any };
                (kind, TypeOrigin::Literal(value))
            }
            Value::Real(_) => (Kind::Float, TypeOrigin::Literal(value)),
        };
        TypeEvidence::Literal { kind, what, span }
    }
}

/// Key of an operation: its tree, its number there, and the expansion.
type OperationKey = (u32, u32, u32);

/// The evidence for operands, by tree, operation of the tree, and expansion.
#[derive(Default)]
pub(crate) struct GivenTypes(HashMap<OperationKey, SmallVec<[(OperandPosition, TypeEvidence); 1]>>);

impl GivenTypes {
    pub(crate) fn insert(&mut self, operation: &Operation, part: OperandPosition, given: TypeEvidence) {
        let (ast, number) = operation.written;
        let parts = self.0.entry((ast, number, operation.expansion)).or_default();
        // A file that is included twice gives the same evidence again.
        parts.retain(|(known, _)| *known != part);
        parts.push((part, given));
    }

    #[inline]
    pub(crate) fn get(&self, operation: &Operation, part: OperandPosition) -> Option<TypeEvidence> {
        if self.0.is_empty() { None } else { self.find(operation, part) }
    }

    fn find(&self, operation: &Operation, part: OperandPosition) -> Option<TypeEvidence> {
        let (ast, number) = operation.written;
        let parts = self.0.get(&(ast, number, operation.expansion))?;
        parts.iter().find(|(known, _)| *known == part).map(|(_, given)| *given)
    }
}

/// The origin of a value's type.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TypeOrigin {
    Literal(Value),
    /// An address is an integer.
    Address,
    /// Result of an operation, with the mnemonic.
    Result(&'static str),
    /// Declaration of the register.
    Declared,
    /// A table in data memory.
    Table,
}
