// SPDX-License-Identifier: MIT OR Apache-2.0
//! Calls: a function that the files define is executed in place.

use super::{Exec, Frame, Named, Scope, plain};
use crate::Error;
use crate::c::types::{Signature, Type};
use crate::c::value::{Choice, Condition, Exit, Memory, Origin, Typed, Value};
use lang_c::ast::{
    BlockItem, CallExpression, Declaration, DeclarationSpecifier, Expression, ForInitializer, Statement,
    StorageClassSpecifier,
};
use lang_c::span::Node;
use std::rc::Rc;

/// Maximum nesting depth of calls.
const MAX_CALLS: usize = 64;

impl<'a> Exec<'a> {
    /// The call is one that the user leaves out.
    pub(super) fn is_ignored(&self, call: &CallExpression) -> bool {
        matches!(&call.callee.node, Expression::Identifier(name) if self.ignored.contains(&name.node.name))
    }

    pub(super) fn call(&mut self, call: &'a CallExpression) -> Result<Typed, Error> {
        if let Expression::Identifier(name) = &call.callee.node {
            let name = name.node.name.as_str();
            if self.is_ignored(call) {
                return match self.looked_up(name) {
                    Some(Named::Function(_, signature)) if signature.result != Type::Void => {
                        self.fail(format!("--ignore {name}: its result is used here"))
                    }
                    _ => Ok(Typed { ty: Type::Void, value: Value::Unset }),
                };
            }
            let defined = match self.looked_up(name) {
                Some(Named::Function(key, _)) => self.functions.contains_key(key),
                Some(_) => true,
                None => false,
            };
            if !defined && self.scopes[self.unit()].refused.contains_key(name) {
                return self.unknown(name);
            }
            if !defined {
                return self.builtin(name, &call.arguments);
            }
        }
        let mut callee = self.value(&call.callee)?;
        callee.value = self.followed(callee.value)?;
        let signature = match &callee.ty {
            Type::Function(signature) => signature.clone(),
            Type::Pointer(to) => match &**to {
                Type::Function(signature) => signature.clone(),
                _ => return self.fail("expected a function"),
            },
            _ => return self.fail("expected a function"),
        };
        let key = match callee.value {
            Value::Function(key) => key,
            Value::Node(_) => {
                return self.fail("the function that this pointer calls depends on data: write `if` or `switch` with a call in each case");
            }
            Value::Int(0) => return self.fail("this calls the null pointer"),
            _ => return self.fail(
                "the function that this pointer calls is not known: set it where it is declared or in --init",
            ),
        };
        let mut arguments = Vec::new();
        for argument in &call.arguments {
            arguments.push(self.value(argument)?);
        }
        // The definition has the parameters' names.
        let own = &self.scopes[self.functions.get(&key).map_or(0, |found| found.unit)];
        let signature = match own.names.get(plain(&key)) {
            Some(Named::Function(_, own)) => own.clone(),
            _ => signature,
        };
        if !self.functions.contains_key(&key) {
            return self.fail(format!("`{}` is defined in none of the files", plain(&key)));
        }
        self.defined(&key, &signature, arguments)
    }

    /// Executes a function.
    fn defined(
        &mut self,
        key: &str,
        signature: &Rc<Signature>,
        arguments: Vec<Typed>,
    ) -> Result<Typed, Error> {
        if self.frames.iter().any(|frame| frame.key == key) {
            return self
                .fail(format!("`{}` calls itself: write it as a loop with a known bound", plain(key)));
        }
        if self.frames.len() >= MAX_CALLS {
            return self.fail(format!("calls nest deeper than {MAX_CALLS}"));
        }
        if arguments.len() != signature.parameters.len() {
            return self.fail(format!(
                "`{}` takes {} arguments and gets {}",
                plain(key),
                signature.parameters.len(),
                arguments.len()
            ));
        }
        let mut values = Vec::new();
        for (argument, (_, ty)) in arguments.into_iter().zip(&signature.parameters) {
            let ty = adjusted(ty);
            let value = self.converted(argument, &ty)?;
            values.push(Typed { ty, value });
        }
        let (at, depth) = (self.at, self.depth);
        let (before, first) = (self.memory.clone(), self.objects.len());
        self.enter_function(key, signature)?;
        for (index, (value, (name, _))) in values.into_iter().zip(&signature.parameters).enumerate() {
            let object =
                self.object(name, &value.ty, Origin::Local, false, (key.to_owned(), index, usize::MAX))?;
            self.settle(object)?;
            let place = self.place_of(object);
            if value.value != Value::Unset {
                self.store(&place, value)?;
            }
            self.scope().names.insert(name.clone(), Named::Object(object));
        }
        let result = self.body(key)?;
        self.frames.pop();
        (self.at, self.depth) = (at, depth);
        let mut result = match result {
            Some(object) => {
                let place = self.place_of(object);
                match (&place.ty, self.memory.get(object, 0)) {
                    (Type::Struct(_), _) => self.load(&place)?,
                    (_, Value::Unset) => Typed { ty: place.ty, value: Value::Unset },
                    _ => self.load(&place)?,
                }
            }
            None => Typed { ty: Type::Void, value: Value::Unset },
        };
        self.release(first);
        self.left_behind(&before, &mut result.value);
        Ok(result)
    }

    /// Removes the last objects if they are local and not among the first: nothing uses them any more.
    pub(super) fn release(&mut self, first: usize) {
        let others = self.objects.iter().rposition(|object| object.origin != Origin::Local);
        let kept = others.map_or(0, |last| last + 1).max(first);
        self.objects.truncate(kept);
        self.memory.0.truncate(kept);
    }

    /// Pointers to local variables of a function that has returned are known to point nowhere.
    fn left_behind(&mut self, before: &Memory, result: &mut Value) {
        let kept = self.objects.len();
        fn dangles(value: &Value, kept: usize) -> Option<Value> {
            const NOWHERE: Value = Value::Mixed("a pointer to a variable of a function that has returned");
            match value {
                Value::Pointer(pointer) if pointer.object >= kept => Some(NOWHERE),
                Value::Choice(choice) => {
                    let (yes, no) = (dangles(&choice.yes, kept), dangles(&choice.no, kept));
                    (yes.is_some() || no.is_some()).then(|| {
                        let yes = yes.unwrap_or(choice.yes.clone());
                        let no = no.unwrap_or(choice.no.clone());
                        Value::Choice(Choice { when: choice.when, yes, no }.into())
                    })
                }
                _ => None,
            }
        }
        if let Some(nowhere) = dangles(result, kept) {
            *result = nowhere;
        }
        for object in 0..self.memory.0.len() {
            if before.0.get(object).is_some_and(|old| Rc::ptr_eq(old, &self.memory.0[object])) {
                continue;
            }
            for leaf in 0..self.memory.0[object].len() {
                if let Some(nowhere) = dangles(self.memory.get(object, leaf), kept) {
                    self.memory.set(object, leaf, nowhere);
                }
            }
        }
    }

    /// Opens a function's frame, with an object for the result.
    pub(in crate::c) fn enter_function(&mut self, key: &str, signature: &Rc<Signature>) -> Result<(), Error> {
        let unit = self.functions[key].unit;
        let result = match &signature.result {
            Type::Void => None,
            ty => {
                let key = (key.to_owned(), usize::MAX, unit);
                Some(self.object(plain(&key.0), ty, Origin::Local, false, key.clone())?)
            }
        };
        self.frames.push(Frame {
            key: key.to_owned(),
            unit,
            scopes: vec![Scope::default()],
            result,
            signature: signature.clone(),
        });
        self.prepare(key)
    }

    /// Executes the body of the function in the last frame; returns the object of its result.
    fn body(&mut self, key: &str) -> Result<Option<usize>, Error> {
        let definition = self.functions[key].definition;
        let mut outcomes = Vec::new();
        let normal = match &definition.statement.node {
            Statement::Compound(items) => {
                self.open();
                let normal = self.items(items, &mut outcomes)?;
                self.close();
                normal
            }
            _ => Condition::Known(true),
        };
        let mut rest = Vec::new();
        self.absorbed(normal, outcomes, &|exit| *exit == Exit::Return, &mut rest)?;
        if let Some(outcome) = rest.first() {
            let text = match &outcome.exit {
                Exit::Goto(label) => {
                    format!("`goto {label}` jumps back or into a block: write a loop with a known bound")
                }
                _ => "`break` or `continue` outside of a loop".to_owned(),
            };
            return self.fail(text);
        }
        Ok(self.frames.last().and_then(|frame| frame.result))
    }

    /// Runs the step or the initialisation, whose parameters are bound in the last frame; returns the object of the result.
    pub(in crate::c) fn run(&mut self, key: &str) -> Result<Option<usize>, Error> {
        let result = self.body(key)?;
        self.frames.pop();
        Ok(result)
    }

    /// Sets the place for messages to the beginning of a function.
    pub(in crate::c) fn here(&mut self, key: &str) {
        let found = &self.functions[key];
        let (unit, span) = (found.unit, found.definition.declarator.span);
        self.at = crate::c::ir::Place { unit, offset: span.start };
    }

    pub(in crate::c) fn bind(&mut self, name: &str, object: usize) {
        self.scope().names.insert(name.to_owned(), Named::Object(object));
    }

    /// Makes the objects of a function's `static` variables: before the step, from the second translation on.
    fn prepare(&mut self, key: &str) -> Result<(), Error> {
        if self.prepared.contains(key) {
            return Ok(());
        }
        self.prepared.insert(key.to_owned());
        let mut found = Vec::new();
        statics(&self.functions[key].definition.statement, &mut found);
        if found.is_empty() {
            return Ok(());
        }
        if self.facts.called.insert(key.to_owned()) {
            self.again = true;
        }
        let at = self.at;
        self.open();
        for declaration in found {
            self.make_static(declaration, key)?;
        }
        self.close();
        self.at = at;
        Ok(())
    }

    /// Makes the statics of all functions that an earlier translation called.
    pub(in crate::c) fn prepare_all(&mut self) -> Result<(), Error> {
        let mut called: Vec<String> = self.facts.called.iter().cloned().collect();
        called.sort();
        for key in called {
            if !self.functions.contains_key(&key) {
                continue;
            }
            let signature = Rc::new(Signature { result: Type::Void, parameters: Vec::new() });
            self.enter_function(&key, &signature)?;
            self.frames.pop();
        }
        Ok(())
    }
}

/// The type of a parameter: arrays and functions are pointers.
pub(in crate::c) fn adjusted(ty: &Type) -> Type {
    match ty {
        Type::Array(element, _) => Type::Pointer(element.clone()),
        Type::Function(_) => Type::Pointer(ty.clone().into()),
        other => other.clone(),
    }
}

/// Declarations of `static` variables in a statement.
fn statics<'a>(statement: &'a Node<Statement>, found: &mut Vec<&'a Declaration>) {
    match &statement.node {
        Statement::Compound(items) => {
            for item in items {
                match &item.node {
                    BlockItem::Declaration(node) => found.extend(is_static(node).then_some(&node.node)),
                    BlockItem::Statement(statement) => statics(statement, found),
                    BlockItem::StaticAssert(_) => {}
                }
            }
        }
        Statement::Labeled(node) => statics(&node.node.statement, found),
        Statement::If(node) => {
            statics(&node.node.then_statement, found);
            if let Some(other) = &node.node.else_statement {
                statics(other, found);
            }
        }
        Statement::Switch(node) => statics(&node.node.statement, found),
        Statement::While(node) => statics(&node.node.statement, found),
        Statement::DoWhile(node) => statics(&node.node.statement, found),
        Statement::For(node) => {
            if let ForInitializer::Declaration(node) = &node.node.initializer.node {
                found.extend(is_static(node).then_some(&node.node));
            }
            statics(&node.node.statement, found);
        }
        _ => {}
    }
}

fn is_static(declaration: &Node<Declaration>) -> bool {
    declaration.node.specifiers.iter().any(|specifier| match &specifier.node {
        DeclarationSpecifier::StorageClass(class) => class.node == StorageClassSpecifier::Static,
        _ => false,
    })
}
