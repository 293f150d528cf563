// SPDX-License-Identifier: MIT OR Apache-2.0
//! C's types: sizes, the places of members, and the scalars that an object consists of. ILP32.

use std::collections::HashMap;
use std::rc::Rc;

/// An integer type.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Integer {
    pub(super) bits: u32,
    pub(super) signed: bool,
    pub(super) boolean: bool,
}

impl Integer {
    pub(super) const fn new(bits: u32, signed: bool) -> Integer {
        Integer { bits, signed, boolean: false }
    }

    /// The value modulo the type's range.
    pub(super) fn wrap(self, value: i64) -> i64 {
        if self.boolean {
            return i64::from(value != 0);
        }
        match (self.bits, self.signed) {
            (8, true) => i64::from(value as i8),
            (8, false) => i64::from(value as u8),
            (16, true) => i64::from(value as i16),
            (16, false) => i64::from(value as u16),
            (32, true) => i64::from(value as i32),
            (32, false) => i64::from(value as u32),
            _ => value,
        }
    }

    /// The type after the integer promotions.
    pub(super) fn promoted(self) -> Integer {
        if self.bits < 32 { INT } else { self }
    }

    /// Least and greatest value.
    pub(super) fn limits(self) -> (i64, i64) {
        match (self.boolean, self.bits, self.signed) {
            (true, ..) => (0, 1),
            (_, 64, _) => (i64::MIN, i64::MAX),
            (_, bits, true) => (-(1 << (bits - 1)), (1 << (bits - 1)) - 1),
            (_, bits, false) => (0, (1 << bits) - 1),
        }
    }
}

pub(super) const INT: Integer = Integer::new(32, true);
pub(super) const UNSIGNED: Integer = Integer::new(32, false);
pub(super) const BOOL: Integer = Integer { bits: 8, signed: false, boolean: true };

#[derive(Clone, PartialEq, Debug)]
pub(super) enum Type {
    Void,
    Int(Integer),
    Float,
    Double,
    Pointer(Rc<Type>),
    /// Elements and their number; `None` while it is unknown.
    Array(Rc<Type>, Option<usize>),
    Struct(usize),
    Function(Rc<Signature>),
}

#[derive(Clone, PartialEq, Debug)]
pub(super) struct Signature {
    pub(super) result: Type,
    pub(super) parameters: Vec<(String, Type)>,
}

#[derive(Clone, Debug)]
pub(super) struct Field {
    /// `None` for an anonymous structure or union.
    pub(super) name: Option<String>,
    pub(super) ty: Type,
    pub(super) offset: usize,
}

/// A structure or union.
#[derive(Clone, Debug)]
pub(super) struct Struct {
    pub(super) name: String,
    pub(super) union: bool,
    pub(super) fields: Vec<Field>,
    pub(super) size: usize,
    pub(super) align: usize,
    pub(super) complete: bool,
}

/// A scalar of an object.
#[derive(Clone, Debug)]
pub(super) struct Leaf {
    pub(super) offset: usize,
    pub(super) ty: Type,
    /// Names of the members on the path, joined by `_`.
    pub(super) name: String,
    /// All indices on the path, with the number of elements of each.
    pub(super) indices: Vec<(usize, usize)>,
}

/// Maximum number of scalars of an object.
pub(super) const MAX_LEAVES: usize = 65_536;

/// All structures of a program.
#[derive(Default)]
pub(super) struct Structs {
    pub(super) list: Vec<Struct>,
    /// Members by which unions are laid out, by structure, where it is not the largest.
    pub(super) members: HashMap<usize, usize>,
}

impl Structs {
    /// Size in bytes; `None` if the type is incomplete.
    pub(super) fn size(&self, ty: &Type) -> Option<usize> {
        Some(match ty {
            Type::Void | Type::Function(_) => return None,
            Type::Int(integer) => integer.bits as usize / 8,
            Type::Float | Type::Pointer(_) => 4,
            Type::Double => 8,
            Type::Array(element, count) => self.size(element)?.checked_mul((*count)?)?,
            Type::Struct(index) => {
                let found = &self.list[*index];
                if !found.complete {
                    return None;
                }
                found.size
            }
        })
    }

    pub(super) fn align(&self, ty: &Type) -> usize {
        match ty {
            Type::Array(element, _) => self.align(element),
            Type::Struct(index) => self.list[*index].align,
            // The ABI of 32-bit x86 aligns 64-bit values of a structure at 4.
            Type::Void | Type::Function(_) => 1,
            other => self.size(other).unwrap_or(1).min(4),
        }
    }

    /// Sets members, their places, and the size; `most` is the largest alignment of a packed structure's members.
    pub(super) fn complete(
        &mut self,
        index: usize,
        members: Vec<(Option<String>, Type)>,
        most: Option<usize>,
    ) {
        let union = self.list[index].union;
        let (mut offset, mut size, mut align, mut fields) = (0_usize, 0, 1, Vec::new());
        for (name, ty) in members {
            let own = self.align(&ty).min(most.unwrap_or(usize::MAX));
            offset = if union { 0 } else { offset.next_multiple_of(own) };
            let length = self.size(&ty).unwrap_or(0);
            fields.push(Field { name, ty, offset });
            offset = offset.saturating_add(length);
            size = size.max(offset);
            align = align.max(own);
        }
        let found = &mut self.list[index];
        (found.fields, found.align, found.complete) = (fields, align, true);
        found.size = size.next_multiple_of(align);
    }

    /// A member with its place, through anonymous structures.
    pub(super) fn member(&self, index: usize, name: &str) -> Option<(usize, Type)> {
        self.list[index].fields.iter().find_map(|field| match (&field.name, &field.ty) {
            (Some(own), ty) if own == name => Some((field.offset, ty.clone())),
            (None, Type::Struct(inner)) => {
                self.member(*inner, name).map(|(offset, ty)| (field.offset + offset, ty))
            }
            _ => None,
        })
    }

    /// The array that is a member of a structure, at a place in it, or a member of such a member: its name on the path, place and type.
    pub(super) fn member_array(&self, ty: &Type, at: usize) -> Option<(String, usize, Type)> {
        let Type::Struct(index) = ty else { return None };
        let found = &self.list[*index];
        let field = match found.union {
            true => found.fields.get(self.laid_out(*index)),
            false => found.fields.iter().rev().find(|field| field.offset <= at),
        }?;
        let (inner, offset, ty) = match &field.ty {
            Type::Array(..) => (String::new(), 0, field.ty.clone()),
            ty => self.member_array(ty, at - field.offset)?,
        };
        let names =
            field.name.iter().map(String::as_str).chain((!inner.is_empty()).then_some(inner.as_str()));
        Some((names.collect::<Vec<_>>().join("_"), field.offset + offset, ty))
    }

    /// Scalars of a type in the order of their places, two of an integer of 64 bits; `None` if there are more than [`MAX_LEAVES`] or its size is unknown. A union has
    /// the scalars of its largest member.
    pub(super) fn leaves(&self, ty: &Type) -> Option<Vec<Leaf>> {
        let mut leaves = Vec::new();
        self.collect(ty, 0, "", &[], &mut leaves)?;
        Some(leaves)
    }

    fn collect(
        &self,
        ty: &Type,
        offset: usize,
        name: &str,
        indices: &[(usize, usize)],
        leaves: &mut Vec<Leaf>,
    ) -> Option<()> {
        match ty {
            Type::Array(element, count) => {
                let size = self.size(element)?;
                for index in 0..(*count)? {
                    let mut inner = indices.to_vec();
                    inner.push((index, (*count)?));
                    self.collect(element, offset + index * size, name, &inner, leaves)?;
                }
                Some(())
            }
            Type::Struct(index) => {
                let found = &self.list[*index];
                let mut fields: Vec<&Field> = found.fields.iter().collect();
                if found.union {
                    fields = fields.get(self.laid_out(*index)).copied().into_iter().collect();
                }
                for field in fields {
                    let inner = match (&field.name, name) {
                        (None, _) => name.to_owned(),
                        (Some(own), "") => own.clone(),
                        (Some(own), name) => format!("{name}_{own}"),
                    };
                    self.collect(&field.ty, offset + field.offset, &inner, indices, leaves)?;
                }
                Some(())
            }
            Type::Void | Type::Function(_) => None,
            Type::Int(integer) if integer.bits > 32 => {
                // Two words, each a scalar of its own.
                for (word, signed, at) in [("low", false, 0), ("high", integer.signed, 4)] {
                    let name = if name.is_empty() { word.to_owned() } else { format!("{name}_{word}") };
                    let word = Type::Int(Integer::new(32, signed));
                    self.collect(&word, offset + at, &name, indices, leaves)?;
                }
                Some(())
            }
            scalar => {
                leaves.push(Leaf {
                    offset,
                    ty: scalar.clone(),
                    name: name.to_owned(),
                    indices: indices.to_vec(),
                });
                (leaves.len() <= MAX_LEAVES).then_some(())
            }
        }
    }

    /// The member of a union that its scalars are of.
    pub(super) fn laid_out(&self, index: usize) -> usize {
        let fields = &self.list[index].fields;
        let largest =
            || (0..fields.len()).rev().max_by_key(|field| self.size(&fields[*field].ty).unwrap_or(0));
        self.members.get(&index).copied().or_else(largest).unwrap_or(0)
    }

    /// The union on the way to a member, and the field that leads there, if the union's scalars are not those of the field.
    pub(super) fn unlike(&self, index: usize, name: &str) -> Option<(usize, usize)> {
        let found = &self.list[index];
        let field = found.fields.iter().position(|field| match (&field.name, &field.ty) {
            (Some(own), _) => own == name,
            (None, Type::Struct(inner)) => self.member(*inner, name).is_some(),
            _ => false,
        })?;
        let own = &found.fields[field];
        if found.union {
            let scalars = |ty| self.leaves(ty).unwrap_or_default();
            let laid_out = scalars(&found.fields[self.laid_out(index)].ty);
            let same = |leaf: &Leaf| {
                laid_out
                    .iter()
                    .any(|other| other.offset == leaf.offset && self.size(&other.ty) == self.size(&leaf.ty))
            };
            if !scalars(&own.ty).iter().all(same) {
                return Some((index, field));
            }
        }
        match (&own.name, &own.ty) {
            (None, Type::Struct(inner)) => self.unlike(*inner, name),
            _ => None,
        }
    }

    /// Spells a type for messages.
    pub(super) fn shown(&self, ty: &Type) -> String {
        match ty {
            Type::Void => "void".to_owned(),
            Type::Int(Integer { boolean: true, .. }) => "_Bool".to_owned(),
            Type::Int(Integer { bits, signed, .. }) => {
                let name = match bits {
                    8 => "char",
                    16 => "short",
                    32 => "int",
                    _ => "long long",
                };
                format!("{}{name}", if *signed { "" } else { "unsigned " })
            }
            Type::Float => "float".to_owned(),
            Type::Double => "double".to_owned(),
            Type::Pointer(to) => format!("{} *", self.shown(to)),
            Type::Array(element, Some(count)) => format!("{}[{count}]", self.shown(element)),
            Type::Array(element, None) => format!("{}[]", self.shown(element)),
            Type::Struct(index) => {
                let found = &self.list[*index];
                format!("{} {}", if found.union { "union" } else { "struct" }, found.name)
            }
            Type::Function(_) => "a function".to_owned(),
        }
    }
}
