// SPDX-License-Identifier: MIT OR Apache-2.0
//! Initial values: `= value` and `= { … }`, with designators, over the members of arrays and structures in their order.

use super::Exec;
use crate::Error;
use crate::c::types::Type;
use crate::c::value::{Condition, Lvalue, Outcome, Pointer, Typed, Value};
use lang_c::ast::{Designator, Expression, Initializer, InitializerListItem};
use lang_c::span::Node;
use std::rc::Rc;

impl<'a> Exec<'a> {
    /// Gives an object its initial value; members without an initialiser are zero.
    pub(super) fn initialised(&mut self, object: usize, initializer: &'a Initializer) -> Result<(), Error> {
        let place = self.place_of(object);
        self.initial(&place, initializer)
    }

    pub(super) fn initial(&mut self, place: &Lvalue, initializer: &'a Initializer) -> Result<(), Error> {
        match initializer {
            Initializer::Expression(expression) => {
                if let (Type::Array(element, Some(count)), Expression::StringLiteral(_)) =
                    (&place.ty, &expression.node)
                {
                    return self.text(place, element, *count, expression);
                }
                let mut run = |exec: &mut Exec<'a>, _: &mut Vec<Outcome>| {
                    let value = exec.value(expression)?;
                    let value = exec.converted(value, &place.ty)?;
                    exec.store(place, Typed { ty: place.ty.clone(), value })?;
                    Ok(Condition::Known(true))
                };
                self.decisive(&mut run, &mut Vec::new()).map(|_| ())
            }
            Initializer::List(items) => {
                if !matches!(place.ty, Type::Array(..) | Type::Struct(_)) {
                    return match items.as_slice() {
                        [item] if item.node.designation.is_empty() => {
                            self.initial(place, &item.node.initializer.node)
                        }
                        _ => self.fail("a number has one initial value"),
                    };
                }
                self.cleared(place)?;
                let mut at = 0;
                self.list(place, items, &mut at, true)
            }
        }
    }

    /// The value of a literal `(type){ … }`.
    pub(super) fn literal(
        &mut self,
        place: &Lvalue,
        items: &'a [Node<InitializerListItem>],
    ) -> Result<(), Error> {
        if !matches!(place.ty, Type::Array(..) | Type::Struct(_)) {
            return match items {
                [item] => self.initial(place, &item.node.initializer.node),
                _ => self.fail("a number has one value"),
            };
        }
        self.cleared(place)?;
        self.list(place, items, &mut 0, true)
    }

    /// Sets all scalars at a place to zero.
    pub(super) fn cleared(&mut self, place: &Lvalue) -> Result<(), Error> {
        let Some(leaves) = self.structs.leaves(&place.ty) else { return self.fail("this has no known size") };
        for leaf in leaves {
            let pointer =
                Pointer { offset: place.pointer.offset + leaf.offset as i64, ..place.pointer.clone() };
            let value = match leaf.ty {
                Type::Float | Type::Double => Value::Real(0.0),
                _ => Value::Int(0),
            };
            self.store(&Lvalue { pointer, ty: leaf.ty.clone() }, Typed { ty: leaf.ty, value })?;
        }
        Ok(())
    }

    /// Number of members of an array or structure.
    fn members(&self, ty: &Type) -> usize {
        match ty {
            Type::Array(_, count) => count.unwrap_or(0),
            Type::Struct(index) if self.structs.list[*index].union => 1,
            Type::Struct(index) => self.structs.list[*index].fields.len(),
            _ => 1,
        }
    }

    fn part(&self, place: &Lvalue, index: usize) -> Result<Lvalue, Error> {
        let (offset, ty) = match &place.ty {
            Type::Array(element, _) => (index * self.size_of(element)?, (**element).clone()),
            Type::Struct(which) => {
                let field = &self.structs.list[*which].fields[index];
                (field.offset, field.ty.clone())
            }
            other => (0, other.clone()),
        };
        let pointer = Pointer { offset: place.pointer.offset + offset as i64, ..place.pointer.clone() };
        Ok(Lvalue { pointer, ty })
    }

    /// Takes items of a list, from `at` on, for the members of a place. `outer`: the list's own braces, where designators count.
    fn list(
        &mut self,
        place: &Lvalue,
        items: &'a [Node<InitializerListItem>],
        at: &mut usize,
        outer: bool,
    ) -> Result<(), Error> {
        let mut member = 0;
        while let Some(item) = items.get(*at) {
            self.go(item.span);
            let mut target = None;
            if !item.node.designation.is_empty() {
                if !outer {
                    return Ok(());
                }
                let (first, path) = self.designated(place, &item.node.designation)?;
                (member, target) = (first, Some(path));
            }
            if member >= self.members(&place.ty) {
                return if outer { self.fail("more initial values than members") } else { Ok(()) };
            }
            let part = match target {
                Some(path) => path,
                None => self.part(place, member)?,
            };
            self.item_of(&part, items, at)?;
            member += 1;
        }
        Ok(())
    }

    fn item_of(
        &mut self,
        part: &Lvalue,
        items: &'a [Node<InitializerListItem>],
        at: &mut usize,
    ) -> Result<(), Error> {
        let initializer = &items[*at].node.initializer.node;
        let aggregate = matches!(part.ty, Type::Array(..) | Type::Struct(_));
        let whole = match initializer {
            Initializer::List(_) => true,
            Initializer::Expression(expression) => {
                !aggregate
                    || matches!(expression.node, Expression::StringLiteral(_))
                    || matches!(part.ty, Type::Struct(_))
                        && matches!(self.type_of(expression)?, Type::Struct(_))
            }
        };
        if whole {
            *at += 1;
            return self.initial(part, initializer);
        }
        // Braces are left out: the members take the items that follow. A designator belongs to the list outside.
        let mut inner = *at;
        let designated = !items[*at].node.designation.is_empty();
        if designated {
            // The first member takes the item, whatever its designator.
            let first = self.part(part, 0)?;
            self.item_of(&first, items, at)?;
            return Ok(());
        }
        self.list(part, items, &mut inner, false)?;
        *at = inner;
        Ok(())
    }

    /// The member that a designation names: the first index, and the whole path.
    fn designated(
        &mut self,
        place: &Lvalue,
        designation: &'a [Node<Designator>],
    ) -> Result<(usize, Lvalue), Error> {
        let (mut first, mut found) = (None, place.clone());
        for designator in designation {
            let index = match (&designator.node, &found.ty) {
                (Designator::Index(index), Type::Array(..)) => {
                    let index = self.known_integer(index)?;
                    usize::try_from(index).ok()
                }
                (Designator::Member(name), Type::Struct(which)) => self.structs.list[*which]
                    .fields
                    .iter()
                    .position(|field| field.name.as_ref() == Some(&name.node.name)),
                _ => None,
            };
            let count = match &found.ty {
                Type::Struct(which) => self.structs.list[*which].fields.len(),
                other => self.members(other),
            };
            let Some(index) = index.filter(|index| *index < count) else {
                return self.fail("this designator does not name a member");
            };
            first = first.or(Some(index));
            found = self.part(&found, index)?;
        }
        Ok((first.unwrap_or(0), found))
    }

    /// Elements that an initial value gives an array without a length.
    pub(super) fn count(&mut self, element: &Rc<Type>, initializer: &'a Initializer) -> Result<usize, Error> {
        match initializer {
            Initializer::Expression(expression) => match &expression.node {
                Expression::StringLiteral(text) => Ok(super::expression::text(&text.node).len() + 1),
                _ => self.fail("expected a list in braces as the array's initial value"),
            },
            Initializer::List(items) => {
                let per = match &**element {
                    Type::Array(..) | Type::Struct(_) => {
                        self.structs.leaves(element).map_or(1, |leaves| leaves.len().max(1))
                    }
                    _ => 1,
                };
                let (mut next, mut most, mut loose) = (0_usize, 0_usize, 0_usize);
                for item in items {
                    if let Some(Node { node: Designator::Index(index), .. }) = item.node.designation.first() {
                        next = usize::try_from(self.known_integer(index)?).unwrap_or(0);
                        loose = 0;
                    }
                    let whole = per == 1
                        || match &item.node.initializer.node {
                            Initializer::List(_) => true,
                            Initializer::Expression(expression) => {
                                matches!(self.type_of(expression)?, Type::Struct(_))
                            }
                        };
                    loose += 1;
                    if whole || loose == per {
                        next += 1;
                        loose = 0;
                    }
                    most = most.max(next + usize::from(loose > 0));
                }
                Ok(most)
            }
        }
    }

    fn text(
        &mut self,
        place: &Lvalue,
        element: &Rc<Type>,
        count: usize,
        expression: &'a Node<Expression>,
    ) -> Result<(), Error> {
        let Expression::StringLiteral(literal) = &expression.node else {
            return self.fail("expected a string");
        };
        let bytes = super::expression::text(&literal.node);
        let Type::Int(integer) = **element else {
            return self.fail("a string can only be the initial value of an array of char");
        };
        for index in 0..count {
            let part = self.part(place, index)?;
            let byte = bytes.get(index).copied().unwrap_or(0);
            let value = Value::Int(integer.wrap(i64::from(byte)));
            self.store(&part, Typed { ty: part.ty.clone(), value })?;
        }
        Ok(())
    }
}
