// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ports and states: roles of the step's parameters, and of variables that outlive it.
//!
//! A scalar whose value from before the step is read and that the step does not write is an input; a scalar that the step only writes,
//! an output. A scalar with both is a state, if it belongs to a structure or a variable of the files; in an array or number that a
//! parameter points to, an input and an output. A scalar that some paths write and none reads is an output that keeps its value. If there
//! are more inputs or outputs than ports, the largest arrays among them stay in data memory.

use super::exec::call::adjusted;
use super::exec::places::kind_of;
use super::exec::{Exec, Key};
use super::ir::{Block, FULL, Id, Kind, Node, Op, Statement};
use super::live::Live;
use super::types::{Signature, Type};
use super::value::{Origin, Part, Pointer, Typed, Value};
use crate::Error;
use crate::sink::Names;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::rc::Rc;

/// Maximum number of ports of a program.
const MAX_INPUTS: usize = 255;
const MAX_OUTPUTS: usize = 32;

/// A port of the program, and the scalar in C that it carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Name in the program: `q[1]`.
    pub name: String,
    /// The scalar in C: `q[0]`, `in.speed`, `result`.
    pub c: String,
    /// A float; otherwise an integer.
    pub float: bool,
    /// Name and dimensions of the declaration.
    pub(super) declared: (String, Vec<usize>),
}

/// A register that outlives the period.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) initial: u32,
}

/// Ports and states of a program.
pub(super) struct Roles {
    pub(super) inputs: Vec<Port>,
    pub(super) outputs: Vec<Port>,
    pub(super) states: Vec<State>,
    /// Variables that ports and states hold: they have their names already.
    pub(super) fixed: Vec<usize>,
    pub(super) notes: Vec<String>,
    pub(super) names: Names,
}

/// A scalar with a register from before the step.
struct Start {
    object: usize,
    leaf: usize,
    var: usize,
    read: Id,
    /// The value wrapped to the scalar's type: a port may hold more.
    own: Id,
    /// Bits that `--init` or the declaration gives; `None` if nothing does.
    initial: Option<u32>,
}

/// State of the step before it runs: values from before it.
pub(super) struct Begun {
    starts: Vec<Start>,
}

/// Bits of a known scalar.
fn bits(value: &Value) -> Option<u32> {
    match value {
        Value::Int(value) => Some(*value as u32),
        Value::Real(value) => Some((*value as f32).to_bits()),
        _ => None,
    }
}

impl Exec<'_> {
    /// The function with a name, in any file.
    pub(super) fn entry(&self, name: &str, option: &str) -> Result<(String, Rc<Signature>), Error> {
        if let Some(reason) = self.scopes.iter().find_map(|scope| scope.refused.get(name)) {
            return Err(reason.clone());
        }
        let mut keys: Vec<&String> =
            self.functions.keys().filter(|key| super::exec::plain(key) == name).collect();
        keys.sort();
        match keys.as_slice() {
            [key] => {
                let unit = self.functions[*key].unit;
                match self.scopes[unit].names.get(name) {
                    Some(super::exec::Named::Function(_, signature)) => {
                        Ok(((*key).clone(), signature.clone()))
                    }
                    _ => Err(Error::plain(format!("--{option} {name}: expected a function"))),
                }
            }
            [] => {
                let mut known: Vec<&str> = self.functions.keys().map(|key| super::exec::plain(key)).collect();
                known.sort_unstable();
                known.truncate(20);
                if known.is_empty() {
                    return Err(Error::plain(format!("--{option} {name}: the files define no function")));
                }
                Err(Error::plain(format!(
                    "--{option} {name}: the files define no such function (functions: {})",
                    known.join(", ")
                )))
            }
            _ => Err(Error::plain(format!(
                "--{option} {name}: several files define it as `static`: rename one"
            ))),
        }
    }

    /// Objects behind or of a function's parameters, by the parameters' names; for `--init`, the step's objects of the same name or type.
    pub(super) fn parameters(
        &mut self,
        signature: &Signature,
        step: Option<&[(String, usize)]>,
    ) -> Result<Vec<(String, usize)>, Error> {
        let mut found = Vec::new();
        for (index, (name, ty)) in signature.parameters.iter().enumerate() {
            let name = if name.is_empty() { format!("p{}", index + 1) } else { name.clone() };
            if let Some(step) = step {
                let by_name = step.iter().find(|(own, object)| {
                    *own == name && self.pointee_type(ty).is_some_and(|ty| self.is_same(*object, &ty))
                });
                let by_type: Vec<&(String, usize)> = step
                    .iter()
                    .filter(|(_, object)| self.pointee_type(ty).is_some_and(|ty| self.is_same(*object, &ty)))
                    .collect();
                let object = match (by_name, by_type.as_slice()) {
                    (Some((_, object)), _) | (None, [(_, object)]) => *object,
                    _ => {
                        return Err(Error::plain(format!(
                            "--init: its parameter `{name}` must point to what a parameter of the step points to, matched by name or type"
                        )));
                    }
                };
                found.push((name, object));
                continue;
            }
            let key = (format!("parameter {name}"), index, usize::MAX);
            let object = match (ty, adjusted(ty)) {
                (Type::Array(element, Some(count)), _) => {
                    let ty = Type::Array(element.clone(), Some(*count));
                    self.object(&name, &ty, Origin::Pointee, false, key)?
                }
                (_, Type::Pointer(to)) => {
                    let Some(object) = self.pointed_to(&name, &to, key)? else {
                        return self.fail(format!("`{name}` does not point to data: a parameter of the step is a number, a structure, or a pointer to these"));
                    };
                    object
                }
                (_, ty) => self.object(&name, &ty, Origin::Parameter, false, key)?,
            };
            found.push((name, object));
        }
        Ok(found)
    }

    /// An object behind a pointer to data of unknown number: as many as the step uses. `None` for what is no data.
    fn pointed_to(&mut self, name: &str, to: &Rc<Type>, key: Key) -> Result<Option<usize>, Error> {
        if matches!(**to, Type::Void | Type::Function(_)) || self.structs.size(to).is_none() {
            return Ok(None);
        }
        let extent = *self.facts.extents.entry(key.clone()).or_insert(1);
        let ty = if extent == 1 { (**to).clone() } else { Type::Array(to.clone(), Some(extent)) };
        self.object(name, &ty, Origin::Pointee, false, key).map(Some)
    }

    /// Puts objects behind the pointers that the step follows and nothing sets, and behind those in these objects.
    pub(super) fn behind(&mut self) -> Result<(), Error> {
        let mut object = 0;
        while object < self.objects.len() {
            let found = self.objects[object].clone();
            for (leaf, scalar) in found.leaves.iter().enumerate() {
                let followed = self.facts.behind.contains(&(found.key.clone(), leaf));
                let Type::Pointer(to) = &scalar.ty else { continue };
                if !followed || *self.memory.get(object, leaf) != Value::Unset {
                    continue;
                }
                let key = (format!("{}->{leaf}", found.key.0), found.key.1, found.key.2);
                let Some(pointee) = self.pointed_to(&found.leaf_name(leaf), to, key)? else { continue };
                self.objects[pointee].spelling = self.spelled(object, scalar);
                let value = Value::Pointer(Pointer { object: pointee, offset: 0, dynamic: None, part: None });
                self.memory.set(object, leaf, value);
            }
            object += 1;
        }
        Ok(())
    }

    /// Sets scalars and arrays among the step's parameters, and in objects behind them, to numbers that hold in every period. Returns the
    /// first name that no object has: a later translation may have it.
    pub(super) fn set(&mut self, numbers: &[(String, Vec<f64>)]) -> Result<Option<String>, Error> {
        let mut missing = None;
        for (name, numbers) in numbers {
            let (base, first) = match name.strip_suffix(']').and_then(|name| name.rsplit_once('[')) {
                Some((base, index)) if numbers.len() == 1 => (base, index.trim().parse().ok()),
                _ => (name.as_str(), None),
            };
            for (number, index) in numbers.iter().zip(first.unwrap_or(0)..) {
                let alone = first.is_none() && numbers.len() == 1;
                match self.named(base, (!alone).then_some(index)) {
                    Some((object, leaf)) => self.set_scalar(name, (object, leaf), *number)?,
                    None if !alone && self.lengthened(name, base, index + 1)? => {}
                    None => {
                        missing.get_or_insert(name.clone());
                    }
                }
            }
        }
        Ok(missing)
    }

    fn settable(&self) -> impl Iterator<Item = (usize, &super::value::Object)> {
        let given = |of: &super::value::Object| {
            matches!(of.origin, Origin::Parameter | Origin::Pointee | Origin::Global)
        };
        self.objects.iter().enumerate().filter(move |(_, of)| given(of))
    }

    /// The scalar that C writes as this name, or as this element of it.
    fn named(&self, name: &str, index: Option<usize>) -> Option<(usize, usize)> {
        let full = index.map_or(name.to_owned(), |index| format!("{name}[{index}]"));
        let only = format!("*{name}");
        self.settable().find_map(|(object, of)| {
            let is_it = |leaf| {
                let spelled = self.spelled(object, leaf);
                !matches!(leaf.ty, Type::Pointer(_))
                    && (spelled == full || index == Some(0) && spelled == only)
            };
            of.leaves.iter().position(is_it).map(|leaf| (object, leaf))
        })
    }

    /// Lengthens the object behind a pointer of unknown length, in the next translation; false if there is none of this name.
    fn lengthened(&mut self, name: &str, base: &str, length: usize) -> Result<bool, Error> {
        let (only, first) = (format!("*{base}"), format!("{base}[0]"));
        let found = self.settable().find_map(|(object, of)| {
            let spelled = self.spelled(object, of.leaves.first()?);
            (self.facts.extents.contains_key(&of.key) && (spelled == only || spelled == first))
                .then_some(of.key.clone())
        });
        let Some(key) = found else { return Ok(false) };
        if length > super::exec::places::MAX_EXTENT {
            let most = super::exec::places::MAX_EXTENT;
            return Err(Error::plain(format!("--set {name}: an array has at most {most} elements")));
        }
        let extent = self.facts.extents.entry(key).or_insert(1);
        if length > *extent {
            *extent = length;
            self.again = true;
        }
        Ok(true)
    }

    fn set_scalar(&mut self, name: &str, (object, leaf): (usize, usize), number: f64) -> Result<(), Error> {
        let value = match &self.objects[object].leaves[leaf].ty {
            Type::Int(integer) if number.fract() == 0.0 && integer.wrap(number as i64) == number as i64 => {
                Value::Int(number as i64)
            }
            Type::Float => Value::Real(f64::from(number as f32)),
            Type::Double => Value::Real(number),
            ty => {
                let ty = self.structs.shown(ty);
                return Err(Error::plain(format!("--set {name}={number}: {ty} does not hold it")));
            }
        };
        self.memory.set(object, leaf, value);
        Ok(())
    }

    fn pointee_type(&self, ty: &Type) -> Option<Type> {
        match adjusted(ty) {
            Type::Pointer(to) => Some((*to).clone()),
            _ => None,
        }
    }

    fn is_same(&self, object: usize, ty: &Type) -> bool {
        let own = &self.objects[object];
        own.origin == Origin::Pointee
            && (own.ty == *ty || matches!(&own.ty, Type::Array(element, _) if **element == *ty))
    }

    /// Binds parameters in a new frame.
    pub(super) fn bound(
        &mut self,
        key: &str,
        signature: &Rc<Signature>,
        objects: &[(String, usize)],
    ) -> Result<(), Error> {
        self.enter_function(key, signature)?;
        for ((name, object), (_, ty)) in objects.iter().zip(&signature.parameters) {
            if self.objects[*object].origin == Origin::Parameter {
                self.bind(name, *object);
                continue;
            }
            let ty = adjusted(ty);
            let variable =
                self.object(name, &ty, Origin::Local, false, (key.to_owned(), *object, usize::MAX - 1))?;
            let pointer = Pointer { object: *object, offset: 0, dynamic: None, part: None };
            let place = self.place_of(variable);
            self.store(&place, Typed { ty, value: Value::Pointer(pointer) })?;
            self.bind(name, variable);
        }
        Ok(())
    }

    /// Gives each object that outlives the step its value from before the step.
    pub(super) fn begin(&mut self) -> Result<Begun, Error> {
        self.stepping = true;
        let mut starts = Vec::new();
        for object in 0..self.objects.len() {
            let found = self.objects[object].clone();
            if found.origin == Origin::Local || found.constant && found.origin != Origin::Pointee {
                self.table(object)?;
                continue;
            }
            let is_struct = matches!(found.ty, Type::Struct(_));
            self.settle(object)?;
            let arrays = self.objects[object].arrays.clone();
            let written = |leaf| self.facts.written.contains(&(found.key.clone(), leaf));
            let kept = self.facts.kept.contains(&found.key);
            let own = matches!(found.origin, Origin::Static | Origin::Global)
                || kept
                || is_struct
                || self.has_struct(&found.ty);
            // An array that is the state itself; others are filled from inputs.
            let is_state = |part: Part| {
                let changes = found.origin != Origin::Parameter
                    && (part.range().any(written) || found.origin == Origin::Static);
                let values = &self.memory.0[object][part.range()];
                (kept || changes) && (own || values.iter().all(|value| *value != Value::Unset))
            };
            let (states, filled): (Vec<_>, Vec<_>) =
                arrays.into_iter().partition(|(part, _)| is_state(*part));
            for (part, array) in &states {
                self.loaded(object, *part, *array);
            }
            for leaf in 0..found.leaves.len() {
                if states.iter().any(|(part, _)| part.range().contains(&leaf)) {
                    continue;
                }
                let value = self.memory.get(object, leaf).clone();
                let changes = found.origin != Origin::Parameter
                    && self.facts.written.contains(&(found.key.clone(), leaf));
                if value != Value::Unset && !changes {
                    continue;
                }
                self.start(object, leaf, &value, &mut starts)?;
            }
            for (part, array) in filled {
                self.fill(object, part, array)?;
            }
        }
        Ok(Begun { starts })
    }

    fn has_struct(&self, ty: &Type) -> bool {
        match ty {
            Type::Array(element, _) => self.has_struct(element),
            Type::Struct(_) => true,
            _ => false,
        }
    }

    /// An object in memory whose words the loader sets.
    pub(super) fn table(&mut self, object: usize) -> Result<(), Error> {
        self.settle(object)?;
        for (part, array) in self.objects[object].arrays.clone() {
            self.loaded(object, part, array);
        }
        Ok(())
    }

    /// Sets the words of an array in memory to the scalars' known values.
    fn loaded(&mut self, object: usize, part: Part, array: usize) {
        for (word, leaf) in part.range().enumerate() {
            self.nodes.arrays[array].words[word] = bits(self.memory.get(object, leaf)).unwrap_or(0);
        }
    }

    /// Stores inputs into an array in memory.
    fn fill(&mut self, object: usize, part: Part, array: usize) -> Result<(), Error> {
        for (word, leaf) in part.range().enumerate() {
            let (value, ty) =
                (self.memory.get(object, leaf).clone(), self.objects[object].leaves[leaf].ty.clone());
            match bits(&value) {
                Some(known) => self.nodes.arrays[array].words[word] = known,
                None => {
                    let Some(value) = self.register(&value, &ty) else { continue };
                    let index = self.nodes.int(word as i32);
                    self.emit(Statement::Store { array, index, value });
                }
            }
        }
        Ok(())
    }

    fn start(
        &mut self,
        object: usize,
        leaf: usize,
        value: &Value,
        starts: &mut Vec<Start>,
    ) -> Result<(), Error> {
        let (ty, origin) = (self.objects[object].leaves[leaf].ty.clone(), self.objects[object].origin);
        let unfit = match &ty {
            Type::Double => Some("a double: give --double=float"),
            Type::Pointer(_) => match value {
                Value::Unset => return Ok(()),
                _ => Some("a pointer that the step changes and that outlives it: keep an index"),
            },
            _ => None,
        };
        if let Some(reason) = unfit {
            self.memory.set(object, leaf, Value::Mixed(reason));
            return Ok(());
        }
        let changes = self.facts.written.contains(&(self.objects[object].key.clone(), leaf));
        let kept = changes && (origin != Origin::Pointee || self.has_struct(&self.objects[object].ty));
        let name = self.objects[object].leaf_name(leaf);
        let var = self.nodes.var(&name, kind_of(&ty));
        let mut range = FULL;
        if let (Type::Int(integer), true) = (&ty, kept && origin != Origin::Parameter)
            && integer.bits < 32
        {
            range = integer.limits();
        }
        let read = self.nodes.read(var, range);
        let initial = bits(value).or((origin == Origin::Global && changes).then_some(0));
        let mut own = read;
        if let Type::Int(integer) = &ty {
            // A port may hold more than its type: convert as a call would.
            own = self.wrapped(read, *integer)?;
        }
        self.memory.set(object, leaf, Value::Node(own));
        starts.push(Start { object, leaf, var, read, own, initial });
        Ok(())
    }

    /// Ends the step: decides about ports and states, and sets them.
    pub(super) fn end(&mut self, begun: Begun, result: Option<usize>) -> Result<Roles, Error> {
        let mut roles = Roles {
            inputs: Vec::new(),
            outputs: Vec::new(),
            states: Vec::new(),
            fixed: Vec::new(),
            notes: Vec::new(),
            names: Names::of_language(),
        };
        let mut finals = Vec::new();
        for start in &begun.starts {
            let after = self.after(start.object, start.leaf)?;
            finals.push(after);
        }
        let results = self.returned(result)?;
        let mut roots: Vec<Id> = results.iter().map(|(_, id)| *id).collect();
        for (start, after) in begun.starts.iter().zip(&finals) {
            if self.objects[start.object].origin != Origin::Parameter
                && let Some(id) = after
                && *id != start.own
            {
                roots.push(*id);
            }
        }
        let live = Live::of(&self.nodes, &self.blocks[0], &roots, &[]);
        let mut sets = Vec::new();
        let mut groups = Groups::default();
        for (start, after) in begun.starts.iter().zip(&finals) {
            let held = after.is_some_and(|after| self.is_held(start, after, &live, &finals));
            self.role(start, *after, (&live, held), &mut roles, &mut groups, &mut sets);
        }
        for (leaf, id) in results {
            let object = result.expect("it has scalars");
            let var = groups.port(self, object, leaf, "", &mut roles, Way::Out);
            sets.push((var, id));
        }
        for (way, name, most) in [(Way::In, "inputs", MAX_INPUTS), (Way::Out, "outputs", MAX_OUTPUTS)] {
            let count: usize =
                groups.0.iter().filter(|group| group.way == way).map(|group| group.declared).sum();
            if count > most {
                if self.kept_in_memory(&groups, way) {
                    return Ok(roles);
                }
                return Err(Error::plain(format!(
                    "the step has {count} {name}, and a program has {most} at most: keep what only the step uses in `static` variables, or \
                     let arrays hold what is alike"
                )));
            }
        }
        self.emit(Statement::Set(sets));
        Ok(roles)
    }

    /// Lets the array with the most ports of a direction stay in data memory, in the next translation. False if there is none whose
    /// elements are all inputs or all outputs, or that is a variable of the files.
    fn kept_in_memory(&mut self, groups: &Groups, way: Way) -> bool {
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        for group in groups.0.iter().filter(|group| group.way == way) {
            let found = &self.objects[group.object];
            let both = groups.0.iter().any(|other| other.object == group.object && other.way != way);
            if matches!(found.ty, Type::Array(..)) && (!both || found.origin == Origin::Global) {
                *counts.entry(group.object).or_default() += group.declared;
            }
        }
        let Some((object, _)) =
            counts.into_iter().max_by_key(|(object, count)| (*count, usize::MAX - object))
        else {
            return false;
        };
        let key = self.objects[object].key.clone();
        let new = self.facts.arrays.insert((key.clone(), None)) | self.facts.kept.insert(key);
        self.again |= new;
        new
    }

    /// A scalar after the step; `None` if it has no register then.
    fn after(&mut self, object: usize, leaf: usize) -> Result<Option<Id>, Error> {
        let ty = self.objects[object].leaves[leaf].ty.clone();
        if let Some((part, array)) = self.objects[object].held(leaf) {
            let written = self.facts.written.contains(&(self.objects[object].key.clone(), leaf));
            if !written {
                return Ok(None);
            }
            let (index, serial) = (self.nodes.int((leaf - part.first) as i32), self.nodes.serial());
            return self.put(Node::Load(array, index, serial), kind_of(&ty), FULL).map(Some);
        }
        let value = self.memory.get(object, leaf).clone();
        if let Value::Mixed(reason) = value {
            let name = self.objects[object].leaf_name(leaf);
            return self.fail(format!("`{name}` is {reason}"));
        }
        Ok(self.register(&value, &ty))
    }

    fn returned(&mut self, result: Option<usize>) -> Result<Vec<(usize, Id)>, Error> {
        let Some(object) = result else { return Ok(Vec::new()) };
        let mut found = Vec::new();
        for leaf in 0..self.objects[object].leaves.len() {
            if let Some(id) = self.after(object, leaf)? {
                found.push((leaf, id));
            }
        }
        Ok(found)
    }

    fn role(
        &mut self,
        start: &Start,
        after: Option<Id>,
        (live, held): (&Live, bool),
        roles: &mut Roles,
        groups: &mut Groups,
        sets: &mut Vec<(usize, Id)>,
    ) {
        let object = self.objects[start.object].clone();
        let name = object.leaf_name(start.leaf);
        let read = live.nodes[start.read.0 as usize];
        let written = after.filter(|id| object.origin != Origin::Parameter && *id != start.own);
        let kept = object.origin != Origin::Pointee || self.has_struct(&object.ty) || start.initial.is_some();
        match (read, written) {
            (false, None) => {}
            (true, None) if start.initial.is_none() => {
                groups.input(self, start, roles);
            }
            (_, None) => self.state(start, &name, roles),
            (false, Some(_)) if object.origin == Origin::Static => {
                let base = match object.leaves[start.leaf].name.as_str() {
                    "" => object.name.clone(),
                    member => format!("{}.{member}", object.name),
                };
                let note = format!("{base} is written but never read: it is left out");
                if !roles.notes.contains(&note) {
                    roles.notes.push(note);
                }
            }
            (false, Some(id)) => {
                let var = groups.port(self, start.object, start.leaf, "", roles, Way::Out);
                sets.push((var, id));
            }
            (true, Some(id)) if object.origin != Origin::Static && held => {
                let var = groups.port(self, start.object, start.leaf, "", roles, Way::Out);
                self.state(start, &format!("{name}_held"), roles);
                sets.extend([(start.var, id), (var, id)]);
            }
            (true, Some(id)) if kept => {
                self.state(start, &name, roles);
                sets.push((start.var, id));
            }
            (true, Some(id)) => {
                groups.input(self, start, roles);
                let var = groups.port(self, start.object, start.leaf, "_out", roles, Way::Out);
                sets.push((var, id));
            }
        }
    }

    fn state(&mut self, start: &Start, name: &str, roles: &mut Roles) {
        let name = roles.names.unique(name);
        let kind = self.nodes.vars[start.var].kind;
        self.nodes.vars[start.var].name.clone_from(&name);
        roles.fixed.push(start.var);
        roles.states.push(State { name, kind, initial: start.initial.unwrap_or(0) });
    }

    /// The value from before the step only reaches the same scalar after it, through choices and branches.
    fn is_held(&self, start: &Start, after: Id, live: &Live, finals: &[Option<Id>]) -> bool {
        let mut uses = Uses::default();
        uses.collect(&self.blocks[0]);
        for index in (0..self.nodes.len()).filter(|index| live.nodes[*index]) {
            let id = Id(index as u32);
            for operand in self.nodes.operands(id) {
                uses.users.entry(operand).or_default().push(id);
            }
            if let Node::Var(var, _) = self.nodes.node(id) {
                uses.reads.entry(var).or_default().push(id);
            }
        }
        if finals.iter().flatten().filter(|id| **id == after).count() > 1 {
            return false;
        }
        let (mut stack, mut seen) = (vec![start.own], HashSet::new());
        while let Some(id) = stack.pop() {
            if !seen.insert(id) {
                continue;
            }
            let elsewhere = id != after && finals.contains(&Some(id)) && id != start.own;
            if uses.other.contains(&id) || elsewhere {
                return false;
            }
            for user in uses.users.get(&id).into_iter().flatten() {
                match self.nodes.node(*user) {
                    Node::Op(Op::Select | Op::SelectFloat, [condition, ..], _) if condition != id => {
                        stack.push(*user);
                    }
                    _ => return false,
                }
            }
            for var in uses.sets.get(&id).into_iter().flatten() {
                stack.extend(uses.reads.get(var).into_iter().flatten());
            }
        }
        true
    }
}

/// Uses of values: by operations, by writes of variables, and by others.
#[derive(Default)]
struct Uses {
    users: HashMap<Id, Vec<Id>>,
    sets: HashMap<Id, Vec<usize>>,
    reads: HashMap<usize, Vec<Id>>,
    other: HashSet<Id>,
}

impl Uses {
    fn collect(&mut self, block: &Block) {
        for (statement, _) in block {
            match statement {
                Statement::Def(_) => {}
                Statement::Store { index, value, .. } => self.other.extend([*index, *value]),
                Statement::Set(pairs) => {
                    for (var, value) in pairs {
                        self.sets.entry(*value).or_default().push(*var);
                    }
                }
                Statement::If { condition, then, other } => {
                    self.other.insert(*condition);
                    self.collect(then);
                    self.collect(other);
                }
                Statement::For { body, .. } => self.collect(body),
                Statement::Loop { body, again, .. } => {
                    self.other.insert(*again);
                    self.collect(body);
                }
            }
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    In,
    Out,
}

/// Declarations of ports so far.
#[derive(Default)]
struct Groups(Vec<Group>);

/// A declaration: the ports of a scalar, or of an array's.
struct Group {
    object: usize,
    /// Name of the member.
    member: String,
    suffix: String,
    way: Way,
    /// Name in the program.
    name: String,
    /// Number of ports that the declaration makes.
    declared: usize,
}

impl Groups {
    /// The variable of a port for a scalar.
    fn port(
        &mut self,
        exec: &mut Exec<'_>,
        object: usize,
        leaf: usize,
        suffix: &str,
        roles: &mut Roles,
        way: Way,
    ) -> usize {
        let kind = kind_of(&exec.objects[object].leaves[leaf].ty);
        let var = exec.nodes.var("", kind);
        self.declare(exec, (object, leaf), suffix, roles, way, var);
        var
    }

    fn input(&mut self, exec: &mut Exec<'_>, start: &Start, roles: &mut Roles) {
        self.declare(exec, (start.object, start.leaf), "", roles, Way::In, start.var);
    }

    fn declare(
        &mut self,
        exec: &mut Exec<'_>,
        (object, leaf): (usize, usize),
        suffix: &str,
        roles: &mut Roles,
        way: Way,
        var: usize,
    ) {
        let found = exec.objects[object].clone();
        let leaf = &found.leaves[leaf];
        let base =
            if leaf.name.is_empty() { found.name.clone() } else { format!("{}_{}", found.name, leaf.name) };
        let dims: Vec<usize> = leaf.indices.iter().map(|(_, count)| *count).collect();
        let known = self.0.iter().find(|group| {
            group.object == object && group.member == leaf.name && group.suffix == suffix && group.way == way
        });
        let name = match known {
            Some(group) => group.name.clone(),
            None => {
                let name = roles.names.unique(&format!("{base}{suffix}"));
                let (member, suffix, name_too) = (leaf.name.clone(), suffix.to_owned(), name.clone());
                let declared = dims.iter().product();
                self.0.push(Group { object, member, suffix, way, name: name_too, declared });
                name
            }
        };
        let place: Vec<String> = leaf.indices.iter().map(|(index, _)| (index + 1).to_string()).collect();
        let own = if place.is_empty() { name.clone() } else { format!("{name}[{}]", place.join(",")) };
        let kind = exec.nodes.vars[var].kind;
        exec.nodes.vars[var].name.clone_from(&own);
        roles.fixed.push(var);
        let c = exec.spelled(object, leaf);
        let port = Port { name: own, c, float: kind == Kind::Float, declared: (name, dims) };
        match way {
            Way::In => roles.inputs.push(port),
            Way::Out => roles.outputs.push(port),
        }
    }
}

impl Exec<'_> {
    /// Arrays that stay in data memory for want of ports: C's name, and whether the step writes them.
    pub(super) fn kept(&self) -> HashMap<usize, (&str, bool)> {
        let kept = self.objects.iter().filter(|object| self.facts.kept.contains(&object.key));
        kept.filter_map(|object| {
            let written = self.facts.written.iter().any(|(key, _)| *key == object.key);
            Some((object.arrays.first()?.1, (object.spelling.as_str(), written)))
        })
        .collect()
    }

    /// A scalar as C writes it.
    fn spelled(&self, object: usize, leaf: &super::types::Leaf) -> String {
        let found = &self.objects[object];
        let (mut text, mut ty, mut rest) = (found.spelling.clone(), found.ty.clone(), leaf.offset);
        let mut joint = if found.origin == Origin::Pointee { "->" } else { "." };
        loop {
            match ty.clone() {
                Type::Array(element, _) => {
                    let size = self.structs.size(&element).unwrap_or(1).max(1);
                    text = format!("{text}[{}]", rest / size);
                    rest %= size;
                    ty = (*element).clone();
                    joint = ".";
                }
                Type::Struct(index) => {
                    let fields = &self.structs.list[index].fields;
                    let field = match self.structs.list[index].union {
                        true => fields.get(self.structs.laid_out(index)),
                        false => fields.iter().rev().find(|field| field.offset <= rest),
                    };
                    let Some(field) = field else { return text };
                    if let Some(name) = &field.name {
                        text = format!("{text}{joint}{name}");
                        joint = ".";
                    }
                    rest -= field.offset;
                    ty = field.ty.clone();
                }
                Type::Int(integer) if integer.bits > 32 => {
                    return if rest == 0 { format!("(unsigned){text}") } else { format!("{text} >> 32") };
                }
                _ => break,
            }
        }
        let plain = text == found.spelling && found.origin == Origin::Pointee;
        if plain { format!("*{text}") } else { text }
    }
}
