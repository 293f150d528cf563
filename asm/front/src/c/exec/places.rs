// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reads and writes of objects: scalars known or in registers, or words of an array in memory if an index depends on data.

use super::{Exec, Key};
use crate::Error;
use crate::c::ir::{Array, FULL, Id, Kind, Node, Op, Statement};
use crate::c::types::{Integer, Leaf, Type};
use crate::c::value::{Lvalue, Object, Origin, Part, Pointer, Typed, Value};
use std::rc::Rc;

/// Maximum number of elements behind a pointer of unknown extent.
pub(in crate::c) const MAX_EXTENT: usize = 4096;

/// The remedy where a loop that is written out goes further than the data let it.
pub(super) const OUTSIDE: &str =
    ": if data end a loop before it comes so far, write `#pragma takt loop_bound(N)` before the loop";

/// Register that holds a scalar.
pub(in crate::c) fn kind_of(ty: &Type) -> Kind {
    if matches!(ty, Type::Float | Type::Double) { Kind::Float } else { Kind::Int }
}

impl Exec<'_> {
    /// A new object whose scalars are unset.
    pub(in crate::c) fn object(
        &mut self,
        name: &str,
        ty: &Type,
        origin: Origin,
        constant: bool,
        key: Key,
    ) -> Result<usize, Error> {
        let Some(leaves) = self.structs.leaves(ty) else {
            return self.fail(format!(
                "`{name}` is {}: its size is unknown, or it has more than {} scalars",
                self.structs.shown(ty),
                crate::c::types::MAX_LEAVES
            ));
        };
        let index = self.objects.len();
        let count = leaves.len();
        self.objects.push(Object {
            name: name.to_owned(),
            spelling: name.to_owned(),
            ty: ty.clone(),
            leaves: Rc::new(leaves),
            origin,
            constant,
            key,
            arrays: Vec::new(),
        });
        self.memory.0.resize(index, Rc::new(Vec::new()));
        self.memory.0.push(Rc::new(vec![Value::Unset; count]));
        Ok(index)
    }

    /// Remembers an object that came into being while functions run, with its contents: trials and sides of branches that began before do
    /// not have it in their memory.
    pub(super) fn made(&mut self, key: Key, object: usize) {
        self.statics.insert(key, object);
        self.contents.insert(object, self.memory.0[object].clone());
    }

    /// Puts an object that this memory does not have into it.
    fn restored(&mut self, object: usize) {
        if self.memory.0.get(object).is_none_or(|cells| cells.is_empty())
            && let Some(contents) = self.contents.get(&object)
        {
            let count = self.memory.0.len().max(object + 1);
            self.memory.0.resize(count, Rc::new(Vec::new()));
            self.memory.0[object] = contents.clone();
        }
    }

    /// Puts an object, or members of it, into data memory if an index into it depends on data.
    pub(in crate::c) fn settle(&mut self, index: usize) -> Result<(), Error> {
        let object = &self.objects[index];
        let demanded = self.facts.arrays.iter().filter(|(key, _)| *key == object.key);
        let mut parts: Vec<Option<Part>> = demanded.map(|(_, part)| *part).collect();
        // The whole object comes first: it holds its members.
        parts.sort_unstable();
        if parts.first() == Some(&None) {
            parts.truncate(1);
        }
        let mut arrays = Vec::with_capacity(parts.len());
        for part in parts {
            let found = part.unwrap_or(self.objects[index].whole());
            arrays.push((found, self.in_memory(index, found)?));
        }
        self.objects[index].arrays = arrays;
        Ok(())
    }

    /// The array in data memory for some scalars of an object.
    fn in_memory(&mut self, index: usize, part: Part) -> Result<usize, Error> {
        let object = &self.objects[index];
        let key = (object.key.clone(), part);
        if let Some(array) = self.arrays.get(&key) {
            return Ok(*array);
        }
        let name = self.part_name(index, Some(part));
        let leaves = &object.leaves[part.range()];
        let mut kinds = leaves.iter().map(|leaf| kind_of(&leaf.ty));
        let first = kinds.next().unwrap_or(Kind::Int);
        let kind = kinds.all(|kind| kind == first).then_some(first);
        let unfit = |leaf: &&Leaf| !matches!(leaf.ty, Type::Int(_) | Type::Float);
        if let Some(leaf) = leaves.iter().find(unfit) {
            return self.fail(format!(
                "`{name}` is indexed by data, but its scalars {} cannot lie in data memory: index only arrays of 32-bit numbers by data",
                self.structs.shown(&leaf.ty)
            ));
        }
        self.nodes.arrays.push(Array { name, kind, words: vec![0; part.count] });
        let array = self.nodes.arrays.len() - 1;
        self.arrays.insert(key, array);
        Ok(array)
    }

    /// Name of an object, or of a member of it.
    fn part_name(&self, object: usize, part: Option<Part>) -> String {
        let found = &self.objects[object];
        let first = part.filter(|part| *part != found.whole()).and_then(|part| found.leaves.get(part.first));
        match first.and_then(|leaf| self.structs.member_array(&found.ty, leaf.offset)) {
            Some((member, ..)) => format!("{}_{member}", found.name),
            None => found.name.clone(),
        }
    }

    /// The array that is a member of an object of a structure and has a scalar at this place.
    fn member_part(&self, object: usize, offset: i64) -> Option<Part> {
        let found = &self.objects[object];
        let (_, offset, ty) = self.structs.member_array(&found.ty, usize::try_from(offset).ok()?)?;
        let first = found.leaf(offset as i64)?;
        let count = self.structs.leaves(&ty)?.len();
        (count > 0 && first + count <= found.leaves.len()).then_some(Part { first, count })
    }

    /// A whole object as an lvalue.
    pub(in crate::c) fn place_of(&self, object: usize) -> Lvalue {
        let pointer = Pointer { object, offset: 0, dynamic: None, part: None };
        Lvalue { pointer, ty: self.objects[object].ty.clone() }
    }

    /// The value at a place; an array becomes a pointer to its first element.
    pub(in crate::c) fn load(&mut self, place: &Lvalue) -> Result<Typed, Error> {
        let Lvalue { pointer, ty } = place;
        match ty {
            Type::Array(element, _) => {
                let mut pointer = pointer.clone();
                if pointer.dynamic.is_none() && pointer.part.is_none() {
                    pointer.part = self.member_part(pointer.object, pointer.offset);
                }
                Ok(Typed { ty: Type::Pointer(element.clone()), value: Value::Pointer(pointer) })
            }
            Type::Struct(_) => {
                let Some(leaves) = self.structs.leaves(ty) else {
                    return self.fail("this structure is incomplete");
                };
                let mut values = Vec::with_capacity(leaves.len());
                for leaf in leaves {
                    let at = Pointer { offset: pointer.offset + leaf.offset as i64, ..pointer.clone() };
                    values.push(self.scalar(&at, &leaf.ty, true)?);
                }
                Ok(Typed { ty: ty.clone(), value: Value::Struct(Rc::new(values)) })
            }
            Type::Void | Type::Function(_) => self.fail("this has no value"),
            scalar => {
                let value = self.scalar(pointer, scalar, false)?;
                Ok(Typed { ty: scalar.clone(), value })
            }
        }
    }

    pub(in crate::c) fn store(&mut self, place: &Lvalue, value: Typed) -> Result<(), Error> {
        let Lvalue { pointer, ty } = place;
        match (ty, value.value) {
            (Type::Struct(_), Value::Struct(values)) => {
                let Some(leaves) = self.structs.leaves(ty) else {
                    return self.fail("this structure is incomplete");
                };
                for (leaf, value) in leaves.iter().zip(values.iter()) {
                    if *value == Value::Unset {
                        continue;
                    }
                    let at = Pointer { offset: pointer.offset + leaf.offset as i64, ..pointer.clone() };
                    self.put_scalar(&at, &leaf.ty, value.clone())?;
                }
                Ok(())
            }
            (Type::Array(..) | Type::Function(_) | Type::Void | Type::Struct(_), _) => {
                self.fail("this cannot be assigned as a whole")
            }
            (scalar, value) => self.put_scalar(pointer, scalar, value),
        }
    }

    /// The scalar at a known place; `None` if the next translation must extend the object of a pointer.
    fn leaf(&mut self, pointer: &Pointer) -> Result<Option<usize>, Error> {
        let object = &self.objects[pointer.object];
        if let Some(leaf) = object.leaf(pointer.offset) {
            let of_type = |part: Part| object.leaves[part.first].ty == object.leaves[leaf].ty;
            if pointer.part.is_none_or(|part| part.range().contains(&leaf) || of_type(part)) {
                return Ok(Some(leaf));
            }
            return self.fail(format!(
                "this is outside of `{}`{OUTSIDE}",
                self.part_name(pointer.object, pointer.part)
            ));
        }
        let (name, key) = (object.name.clone(), object.key.clone());
        if let (Some(extent), Some(first)) = (self.facts.extents.get(&key), object.leaves.first()) {
            let built = self.extents.get(&key).copied().unwrap_or(1);
            let element = self.structs.size(&first.ty).unwrap_or(4) * object.leaves.len() / built.max(1);
            let wanted =
                usize::try_from(pointer.offset).map_or(usize::MAX, |offset| offset / element.max(1) + 1);
            if wanted <= MAX_EXTENT && wanted > *extent {
                self.facts.extents.insert(key, wanted);
                self.again = true;
                return Ok(None);
            }
        }
        let union = object.leaves.iter().any(|leaf| {
            leaf.offset as i64 <= pointer.offset
                && pointer.offset < leaf.offset as i64 + self.structs.size(&leaf.ty).unwrap_or(0) as i64
        });
        if union {
            return self
                .fail(format!("this reads or writes a part of a scalar of `{name}`: use shifts and masks"));
        }
        self.fail(format!("this is outside of `{name}`{OUTSIDE}"))
    }

    /// Demands that an object, or a member of it, lies in memory, in the next translation.
    fn demand(&mut self, object: usize, part: Option<Part>) {
        let key = self.objects[object].key.clone();
        self.facts.arrays.insert((key, part));
        self.again = true;
    }

    /// The index of a word of an array. One that only loops count, and that is outside in some iterations, stands in a register: a
    /// condition may guard it, where the assembler refuses such a subscript.
    fn subscript(&mut self, (part, array): (Part, usize), pointer: &Pointer) -> Result<Id, Error> {
        let known = self.nodes.int((self.known_scalar(pointer)?.0 - part.first as i64) as i32);
        let index = match pointer.dynamic {
            Some(dynamic) => self.op(Op::IntAdd, &[dynamic, known])?,
            None => known,
        };
        if self.stays_within(array, index) || !self.nodes.is_counted(index) {
            return Ok(index);
        }
        self.op(Op::Copy, &[index])
    }

    /// Index of the scalar at the known part of a place, and a scalar of its type. The place may lie outside of the array in which the
    /// pointer moves, as in a[i - 1]: in whole elements of it.
    pub(super) fn known_scalar(&self, pointer: &Pointer) -> Result<(i64, usize), Error> {
        let object = &self.objects[pointer.object];
        let part = pointer.part.unwrap_or(object.whole());
        let leaves = &object.leaves[part.range()];
        let outside = || self.fail(format!("this is outside of `{}`", object.name));
        let Some(base) = leaves.first().map(|leaf| leaf.offset as i64) else { return outside() };
        let (first, count) = (part.first as i64, part.count as i64);
        let from_base = pointer.offset - base;
        let size = |ty| self.structs.size(ty).filter(|size| *size > 0).map(|size| size as i64);
        let stride = match leaves.get(1) {
            Some(leaf) => leaf.offset as i64 - base,
            None => size(&leaves[0].ty).unwrap_or(4),
        };
        let mut places = leaves.iter().zip(0..);
        if from_base % stride == 0 && places.all(|(leaf, index)| leaf.offset as i64 == base + index * stride)
        {
            let word = from_base / stride;
            return Ok((first + word, (first + word.rem_euclid(count)) as usize));
        }
        if let Some(leaf) = object.leaf(pointer.offset).filter(|leaf| part.range().contains(leaf)) {
            return Ok((leaf as i64, leaf));
        }
        let ty = match pointer.part {
            Some(_) => self.structs.member_array(&object.ty, base as usize).map(|(.., ty)| ty),
            None => Some(object.ty.clone()),
        };
        let Some(Type::Array(element, Some(_))) = ty else { return outside() };
        let Some(element) = size(&element) else { return outside() };
        let each = leaves.iter().filter(|leaf| (leaf.offset as i64) < base + element).count() as i64;
        match object.leaf(base + from_base.rem_euclid(element)) {
            Some(within) => Ok((from_base.div_euclid(element) * each + within as i64, within)),
            None => outside(),
        }
    }

    /// Extends an object of unknown length up to a place, in bytes, in the next translation; others must have it.
    pub(super) fn reach(&mut self, object: usize, end: i64) -> Result<(), Error> {
        let found = &self.objects[object];
        let size = self.structs.size(&found.ty).unwrap_or(0) as i64;
        if end <= size {
            return Ok(());
        }
        let built = self.extents.get(&found.key).copied().unwrap_or(1).max(1) as i64;
        let element = (size / built).max(1);
        let wanted = end.saturating_add(element - 1) / element;
        match self.facts.extents.get_mut(&found.key) {
            Some(extent) if wanted <= MAX_EXTENT as i64 => {
                *extent = (*extent).max(wanted as usize);
                self.again = true;
                Ok(())
            }
            _ => self.fail(format!("this copies or sets beyond the end of `{}`, at byte {size}", found.name)),
        }
    }

    /// Extends an object of unknown length to the greatest place of a pointer to its elements, in the next translation.
    pub(super) fn extend(&mut self, pointer: &Pointer, element: &Type) -> Result<(), Error> {
        let Pointer { object, offset, dynamic: Some(dynamic), .. } = pointer else { return Ok(()) };
        let found = &self.objects[*object];
        let Some(extent) = self.facts.extents.get(&found.key).copied() else { return Ok(()) };
        let built = self.extents.get(&found.key).copied().unwrap_or(1);
        let own = match &found.ty {
            Type::Array(own, _) if built > 1 => &**own,
            own => own,
        };
        if own != element {
            // An array inside of an element.
            return Ok(());
        }
        let size = self.structs.size(element).unwrap_or(4).max(1) as i64;
        let each = (found.leaves.len() / built.max(1)).max(1) as i64;
        let most = self.nodes.range(*dynamic).1 / each + offset / size;
        let wanted = usize::try_from(most).unwrap_or(0) + 1;
        if wanted > MAX_EXTENT {
            return self.fail(format!(
                "data index `{0}`, whose length is not known: declare its length (`{0}[N]`), or mask the index",
                found.name
            ));
        }
        if wanted > extent {
            let key = found.key.clone();
            self.facts.extents.insert(key, wanted);
            self.again = true;
        }
        Ok(())
    }

    /// Reads a scalar; a part of a structure may be unset.
    fn scalar(&mut self, pointer: &Pointer, ty: &Type, part: bool) -> Result<Value, Error> {
        if let Type::Int(integer) = ty
            && integer.bits > 32
        {
            return self.joined_words(pointer, *integer, |exec, at, ty| exec.scalar(at, ty, part));
        }
        let object = pointer.object;
        let is_known = self.objects[object].constant || !self.stepping;
        let leaf = match pointer.dynamic {
            None => match self.leaf(pointer)? {
                None => return Ok(Value::Node(self.placeholder(kind_of(ty), FULL))),
                leaf => leaf,
            },
            Some(_) => None,
        };
        if let Some(leaf) = leaf.filter(|leaf| is_known || self.objects[object].held(*leaf).is_none()) {
            let own = self.objects[object].leaves[leaf].ty.clone();
            self.restored(object);
            let mut value = self.memory.get(object, leaf).clone();
            if value == Value::Unset && !part && matches!(own, Type::Pointer(_)) {
                self.follows(object, leaf)?;
            }
            if value == Value::Unset && !self.stepping && self.objects[object].origin == Origin::Global {
                // Before the step, variables of the files begin as zeros.
                value = if kind_of(&own) == Kind::Float { Value::Real(0.0) } else { Value::Int(0) };
            }
            let value = match part {
                true => value,
                false => {
                    let name = self.objects[object].leaf_name(leaf);
                    self.present(&value, &name)?
                }
            };
            return self.punned(value, &own, ty);
        }
        if self.is_among_pointers(pointer) {
            self.restored(object);
            let own = self.word_type(pointer)?;
            let value = self.read_among(pointer)?;
            return self.punned(value, &own, ty);
        }
        let Some(held) = self.holding(pointer, leaf) else {
            self.demand(object, pointer.part);
            return Ok(Value::Node(self.placeholder(kind_of(ty), FULL)));
        };
        let (index, array) = (self.subscript(held, pointer)?, held.1);
        let own = self.word_type(pointer)?;
        let range = match &own {
            Type::Int(integer) if integer.bits < 32 => integer.limits(),
            _ => FULL,
        };
        let serial = self.nodes.serial();
        let id = self.put(Node::Load(array, index, serial), kind_of(&own), range)?;
        self.punned(Value::Node(id), &own, ty)
    }

    /// The array in data memory with a place, whose scalar is known or not.
    fn holding(&self, pointer: &Pointer, leaf: Option<usize>) -> Option<(Part, usize)> {
        let object = &self.objects[pointer.object];
        leaf.map_or_else(|| object.array(pointer.part), |leaf| object.held(leaf))
    }

    /// Demands that something lies behind a pointer of the caller's, in the next translation.
    fn follows(&mut self, object: usize, leaf: usize) -> Result<(), Error> {
        let found = &self.objects[object];
        let fact = (found.key.clone(), leaf);
        if self.stepping
            && matches!(found.origin, Origin::Pointee | Origin::Parameter | Origin::Global)
            && self.facts.behind.insert(fact)
        {
            self.again = true;
            return self.fail("a pointer is followed for the first time");
        }
        Ok(())
    }

    /// The type of the scalar at a place in an array.
    pub(super) fn word_type(&self, pointer: &Pointer) -> Result<Type, Error> {
        let leaf = self.known_scalar(pointer)?.1;
        Ok(self.objects[pointer.object].leaves[leaf].ty.clone())
    }

    /// The same bits read as another type, as a union's members are.
    fn punned(&mut self, value: Value, own: &Type, ty: &Type) -> Result<Value, Error> {
        if own == ty || value == Value::Unset {
            return Ok(value);
        }
        match (own, ty, value) {
            (Type::Int(a), Type::Int(b), value) if a.bits == b.bits => {
                // Only the signedness differs.
                Ok(match value {
                    Value::Int(known) => Value::Int(b.wrap(known)),
                    Value::Node(id) => Value::Node(self.wrapped(id, *b)?),
                    other => other,
                })
            }
            (Type::Pointer(_), Type::Pointer(_), value) => Ok(value),
            (Type::Int(Integer { bits: 32, .. }), Type::Float, Value::Int(known)) => {
                Ok(Value::Real(f64::from(f32::from_bits(known as u32))))
            }
            (Type::Int(Integer { bits: 32, .. }), Type::Float, Value::Node(id)) => {
                Ok(Value::Node(self.op(Op::FloatOf, &[id])?))
            }
            (Type::Float, Type::Int(to @ Integer { bits: 32, .. }), Value::Real(known)) => {
                Ok(Value::Int(to.wrap(i64::from((known as f32).to_bits()))))
            }
            (Type::Float, Type::Int(Integer { bits: 32, .. }), Value::Node(id)) => {
                Ok(Value::Node(self.op(Op::BitsOf, &[id])?))
            }
            (own, ty, _) => {
                let (own, ty) = (self.structs.shown(own), self.structs.shown(ty));
                self.fail(format!(
                    "{own} is read as {ty}: only 32-bit values can be read as another 32-bit type"
                ))
            }
        }
    }

    fn put_scalar(&mut self, pointer: &Pointer, ty: &Type, value: Value) -> Result<(), Error> {
        if let Type::Int(integer) = ty
            && integer.bits > 32
        {
            let words = self.split_words(&value, *integer)?;
            let types = self.structs.leaves(ty).unwrap_or_default();
            for (word, leaf) in words.into_iter().zip(types) {
                let at = Pointer { offset: pointer.offset + leaf.offset as i64, ..pointer.clone() };
                self.put_scalar(&at, &leaf.ty, word)?;
            }
            return Ok(());
        }
        let object = pointer.object;
        if self.objects[object].constant && self.stepping {
            return self.fail(format!("`{}` is const", self.objects[object].name));
        }
        let leaf = match pointer.dynamic {
            None => match self.leaf(pointer)? {
                None => return Ok(()),
                leaf => leaf,
            },
            Some(_) => None,
        };
        let in_register =
            |exec: &Self, leaf: &usize| !exec.stepping || exec.objects[object].held(*leaf).is_none();
        if let Some(leaf) = leaf.filter(|leaf| in_register(self, leaf)) {
            let own = self.objects[object].leaves[leaf].ty.clone();
            let value = self.punned(value, ty, &own)?;
            self.changes(object, leaf);
            self.restored(object);
            if let Value::Node(id) = value {
                let name = self.objects[object].leaf_name(leaf);
                self.label(id, &name);
            }
            self.memory.set(object, leaf, value);
            return Ok(());
        }
        if self.is_among_pointers(pointer) {
            self.restored(object);
            let own = self.word_type(pointer)?;
            let value = self.punned(value, ty, &own)?;
            return self.write_among(pointer, &value);
        }
        let Some(held) = self.holding(pointer, leaf) else {
            self.demand(object, pointer.part);
            self.changes_all(object, pointer.part);
            return Ok(());
        };
        let (index, array) = (self.subscript(held, pointer)?, held.1);
        let own = self.word_type(pointer)?;
        let value = self.punned(value, ty, &own)?;
        self.changes_all(object, Some(held.0));
        let Some(value) = self.register(&value, &own) else {
            return self.fail("no register holds this value");
        };
        self.emit(Statement::Store { array, index, value });
        Ok(())
    }

    /// Records that the step writes a scalar that outlives it.
    pub(super) fn changes(&mut self, object: usize, leaf: usize) {
        let found = &self.objects[object];
        if self.stepping && !matches!(found.origin, Origin::Local | Origin::Parameter) {
            let fact = (found.key.clone(), leaf);
            if self.facts.written.insert(fact) {
                self.again = true;
            }
        }
    }

    fn changes_all(&mut self, object: usize, part: Option<Part>) {
        for leaf in part.unwrap_or(self.objects[object].whole()).range() {
            self.changes(object, leaf);
        }
    }
}
