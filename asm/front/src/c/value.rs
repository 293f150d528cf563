// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values while the C is executed: known, or a node; and the memory that holds them.

use super::ir::Id;
use super::types::{Leaf, Type};
use std::rc::Rc;

/// Scalars of an object that follow one another: an array, with all that its elements have.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub(super) struct Part {
    pub(super) first: usize,
    pub(super) count: usize,
}

impl Part {
    pub(super) fn range(self) -> std::ops::Range<usize> {
        self.first..self.first + self.count
    }
}

/// A pointer to a place in an object.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Pointer {
    pub(super) object: usize,
    /// Bytes from the object's beginning.
    pub(super) offset: i64,
    /// Number of scalars to add, if the place depends on inputs.
    pub(super) dynamic: Option<Id>,
    /// The member in which the pointer moves, if it began as an array that is one; otherwise the whole object.
    pub(super) part: Option<Part>,
}

/// Pointers of which data choose one; the null pointer and functions are pointers too.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Choice {
    /// A node that is 1 for the first, 0 for the second.
    pub(super) when: Id,
    pub(super) yes: Value,
    pub(super) no: Value,
}

#[derive(Clone, Debug)]
pub(super) enum Value {
    /// Not written yet.
    Unset,
    Int(i64),
    /// A known number: of type float it is a binary32 number.
    Real(f64),
    Node(Id),
    /// An integer of 64 bits that depends on data: low and high word. Memory holds the words.
    Wide(Id, Id),
    Pointer(Pointer),
    /// A function, by its key.
    Function(String),
    /// One of two pointers, as data choose.
    Choice(Rc<Choice>),
    /// Scalars of a structure.
    Struct(Rc<Vec<Value>>),
    /// A value that depends on data and for which the language has no register; the text gives the reason.
    Mixed(&'static str),
}

impl PartialEq for Value {
    /// Numbers are equal if their bits are: zeros have signs.
    fn eq(&self, other: &Value) -> bool {
        match (self, other) {
            (Value::Unset, Value::Unset) => true,
            (Value::Int(a), Value::Int(b)) => a == b,
            (Value::Real(a), Value::Real(b)) => a.to_bits() == b.to_bits(),
            (Value::Node(a), Value::Node(b)) => a == b,
            (Value::Wide(a, c), Value::Wide(b, d)) => a == b && c == d,
            (Value::Pointer(a), Value::Pointer(b)) => a == b,
            (Value::Function(a), Value::Function(b)) => a == b,
            (Value::Choice(a), Value::Choice(b)) => a == b,
            (Value::Struct(a), Value::Struct(b)) => a == b,
            (Value::Mixed(a), Value::Mixed(b)) => a == b,
            _ => false,
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Typed {
    pub(super) ty: Type,
    pub(super) value: Value,
}

/// A condition.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Condition {
    Known(bool),
    /// A node that is 0 or 1.
    Node(Id),
}

/// An lvalue.
#[derive(Clone, Debug)]
pub(super) struct Lvalue {
    pub(super) pointer: Pointer,
    pub(super) ty: Type,
}

/// The origin of an object.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Origin {
    Local,
    /// File scope or `static`, initialised, with internal linkage or const.
    Static,
    /// File scope with external linkage.
    Global,
    /// The object behind a pointer parameter of the step function.
    Pointee,
    /// A parameter of the step that is passed by value.
    Parameter,
}

/// An object: a variable, or the target of a parameter.
#[derive(Clone, Debug)]
pub(super) struct Object {
    pub(super) name: String,
    /// The name as C spells it, as `motor->conf`.
    pub(super) spelling: String,
    pub(super) ty: Type,
    pub(super) leaves: Rc<Vec<Leaf>>,
    pub(super) origin: Origin,
    pub(super) constant: bool,
    /// Name and place of the declaration, by which a later translation recognises the object.
    pub(super) key: (String, usize, usize),
    /// Arrays in data memory, with the scalars that each holds.
    pub(super) arrays: Vec<(Part, usize)>,
}

impl Object {
    /// The scalar at a place.
    pub(super) fn leaf(&self, offset: i64) -> Option<usize> {
        let offset = usize::try_from(offset).ok()?;
        self.leaves.binary_search_by_key(&offset, |leaf| leaf.offset).ok()
    }

    /// All scalars.
    pub(super) fn whole(&self) -> Part {
        Part { first: 0, count: self.leaves.len() }
    }

    /// The array in data memory that holds a scalar.
    pub(super) fn held(&self, leaf: usize) -> Option<(Part, usize)> {
        self.arrays.iter().copied().find(|(part, _)| part.range().contains(&leaf))
    }

    /// The array in data memory that holds all scalars of a member, or of the object.
    pub(super) fn array(&self, part: Option<Part>) -> Option<(Part, usize)> {
        let Part { first, count } = part.unwrap_or(self.whole());
        self.arrays
            .iter()
            .copied()
            .find(|(held, _)| held.first <= first && first + count <= held.first + held.count)
    }

    /// Name of a scalar: `q_2`, `state_angle`.
    pub(super) fn leaf_name(&self, leaf: usize) -> String {
        let leaf = &self.leaves[leaf];
        let mut name = self.name.clone();
        if !leaf.name.is_empty() {
            name = format!("{name}_{}", leaf.name);
        }
        for (index, _) in &leaf.indices {
            name = format!("{name}_{index}");
        }
        name
    }
}

/// Values of all scalars, object by object; copies share unchanged objects.
#[derive(Clone, Default)]
pub(super) struct Memory(pub(super) Vec<Rc<Vec<Value>>>);

impl Memory {
    pub(super) fn get(&self, object: usize, leaf: usize) -> &Value {
        &self.0[object][leaf]
    }

    pub(super) fn set(&mut self, object: usize, leaf: usize, value: Value) {
        Rc::make_mut(&mut self.0[object])[leaf] = value;
    }
}

/// The way in which control leaves a statement.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Exit {
    Break,
    Continue,
    Return,
    Goto(String),
}

/// An exit from a block, with its condition and the memory at that point.
pub(super) struct Outcome {
    pub(super) exit: Exit,
    pub(super) when: Condition,
    pub(super) memory: Memory,
}
