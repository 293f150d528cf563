// SPDX-License-Identifier: MIT OR Apache-2.0
//! Declarations: types, variables, functions.

use super::{Defined, Exec, Key, Named};
use crate::Error;
use crate::c::types::{BOOL, INT, Integer, Signature, Struct, Type, UNSIGNED};
use crate::c::unit::declared_name;
use crate::c::value::{Origin, Typed, Value};
use lang_c::ast::{
    ArraySize, Declaration, DeclarationSpecifier, Declarator, DeclaratorKind, DerivedDeclarator, Ellipsis,
    EnumType, ExternalDeclaration, FunctionDefinition, InitDeclarator, Initializer, SpecifierQualifier,
    StorageClassSpecifier, StructDeclaration, StructKind, StructType, TypeName, TypeOf, TypeQualifier,
    TypeSpecifier,
};
use lang_c::span::Node;
use std::rc::Rc;

/// Specifiers of a declaration.
struct Base {
    ty: Type,
    storage: Option<StorageClassSpecifier>,
    constant: bool,
}

impl<'a> Exec<'a> {
    /// Declares all of a file's names. Variables get their initial values.
    pub(in crate::c) fn file(&mut self, unit: usize) -> Result<(), Error> {
        self.at.unit = unit;
        self.scopes.push(super::Scope::default());
        let units = self.units;
        for external in &units[unit].tree.0 {
            self.go(external.span);
            match &external.node {
                ExternalDeclaration::StaticAssert(_) => {}
                ExternalDeclaration::Declaration(declaration) => {
                    if let Err(reason) = self.declaration(&declaration.node) {
                        for declarator in &declaration.node.declarators {
                            self.refuse(&declarator.node.declarator.node, &reason);
                        }
                    }
                }
                ExternalDeclaration::FunctionDefinition(node) => {
                    if let Err(reason) = self.function(unit, &node.node) {
                        self.refuse(&node.node.declarator.node, &reason);
                    }
                }
            }
        }
        Ok(())
    }

    /// A declaration that is not translated: an error only if its name is used.
    fn refuse(&mut self, declarator: &Declarator, reason: &Error) {
        if let Some(name) = declared_name(declarator) {
            self.scope().names.remove(name);
            self.scope().refused.insert(name.to_owned(), reason.clone());
        }
    }

    fn function(&mut self, unit: usize, definition: &'a FunctionDefinition) -> Result<(), Error> {
        let base = self.base(&definition.specifiers)?;
        let (name, ty) = self.declared(&definition.declarator.node, base.ty.clone())?;
        let (Some(name), Type::Function(signature)) = (name, ty) else {
            return self.fail("expected a function");
        };
        if !definition.declarations.is_empty() {
            return self.fail(format!(
                "`{name}` declares its parameters in the old style: put their types into the parentheses"
            ));
        }
        let key = match base.storage {
            Some(StorageClassSpecifier::Static) => format!("{name}@{unit}"),
            _ => name.clone(),
        };
        if self.functions.contains_key(&key) {
            return self.fail(format!("`{name}` is defined twice"));
        }
        self.functions.insert(key.clone(), Defined { unit, definition });
        self.scope().names.insert(name, Named::Function(key, signature));
        Ok(())
    }

    pub(super) fn declaration(&mut self, declaration: &'a Declaration) -> Result<(), Error> {
        let base = self.base(&declaration.specifiers)?;
        for declarator in &declaration.declarators {
            self.go(declarator.span);
            self.variable(&base, &declarator.node, declarator.span.start)?;
        }
        Ok(())
    }

    fn variable(&mut self, base: &Base, declarator: &'a InitDeclarator, place: usize) -> Result<(), Error> {
        let (name, mut ty) = self.declared(&declarator.declarator.node, base.ty.clone())?;
        let Some(name) = name else { return self.fail("this declares no name") };
        if base.storage == Some(StorageClassSpecifier::Typedef) {
            self.scope().names.insert(name, Named::Type(ty));
            return Ok(());
        }
        if let Type::Function(signature) = ty {
            // A definition that is known already keeps its key.
            if !matches!(self.looked_up(&name), Some(Named::Function(..))) {
                let key = match base.storage {
                    Some(StorageClassSpecifier::Static) => format!("{name}@{}", self.unit()),
                    _ => name.clone(),
                };
                self.scope().names.insert(name, Named::Function(key, signature));
            }
            return Ok(());
        }
        let initializer = declarator.initializer.as_ref().map(|node| &node.node);
        if let (Type::Array(element, None), Some(initializer)) = (&ty, initializer) {
            let count = self.count(element, initializer)?;
            ty = Type::Array(element.clone(), Some(count));
        }
        let constant = base.constant && !matches!(ty, Type::Pointer(_))
            || self.is_constant_pointer(&declarator.declarator.node);
        let in_file = self.frames.is_empty();
        match (&base.storage, in_file) {
            (Some(StorageClassSpecifier::Static), false) => self.static_local(&name, place),
            (Some(StorageClassSpecifier::Extern), false) => {
                let Some(object) = self.globals.get(&name).copied() else {
                    return self.fail(format!(
                        "`{name}` is not declared at file scope: give the file that defines it"
                    ));
                };
                self.scope().names.insert(name, Named::Object(object));
                Ok(())
            }
            (_, false) => self.local(&name, &ty, initializer, place),
            (storage, true) => self.global(&name, &ty, storage.as_ref(), constant, initializer),
        }
    }

    fn is_constant_pointer(&self, declarator: &Declarator) -> bool {
        matches!(
            declarator.derived.first().map(|node| &node.node),
            Some(DerivedDeclarator::Pointer(qualifiers)) if qualifiers.iter().any(|qualifier| matches!(
                &qualifier.node,
                lang_c::ast::PointerQualifier::TypeQualifier(Node { node: TypeQualifier::Const, .. })
            ))
        )
    }

    fn refuse_double(&self, name: &str, ty: &Type) -> Result<(), Error> {
        let doubles = match self.structs.leaves(ty) {
            Some(leaves) => leaves.iter().any(|leaf| leaf.ty == Type::Double),
            None => false,
        };
        match doubles {
            true => self.fail(format!(
                "`{name}` is a double, and the machine computes in binary32: declare it as float, or give --double=float, which reads \
                 double as float everywhere"
            )),
            false => Ok(()),
        }
    }

    fn local(
        &mut self,
        name: &str,
        ty: &Type,
        initializer: Option<&'a Initializer>,
        place: usize,
    ) -> Result<(), Error> {
        self.refuse_double(name, ty)?;
        let function = self.frames.last().map_or_else(String::new, |frame| frame.key.clone());
        let key = (function, place, self.unit());
        let object = self.object(name, ty, Origin::Local, false, key)?;
        self.settle(object)?;
        self.scope().names.insert(name.to_owned(), Named::Object(object));
        match initializer {
            Some(initializer) => self.initialised(object, initializer),
            None => Ok(()),
        }
    }

    fn static_local(&mut self, name: &str, place: usize) -> Result<(), Error> {
        let function = self.frames.last().map_or_else(String::new, |frame| frame.key.clone());
        let key: Key = (function, place, self.unit());
        let Some(object) = self.statics.get(&key).copied() else {
            // All statics are made before the step runs: `statics` visits its functions.
            return self.fail(format!("`{name}` is static where no static is expected"));
        };
        self.scope().names.insert(name.to_owned(), Named::Object(object));
        Ok(())
    }

    /// Makes the object of a `static` variable of a function, with its initial value.
    pub(super) fn make_static(&mut self, declaration: &'a Declaration, function: &str) -> Result<(), Error> {
        let base = self.base(&declaration.specifiers)?;
        for declarator in &declaration.declarators {
            self.go(declarator.span);
            let (name, mut ty) = self.declared(&declarator.node.declarator.node, base.ty.clone())?;
            let (Some(name), key) = (name, (function.to_owned(), declarator.span.start, self.unit())) else {
                continue;
            };
            let initializer = declarator.node.initializer.as_ref().map(|node| &node.node);
            if let (Type::Array(element, None), Some(initializer)) = (&ty, initializer) {
                let count = self.count(element, initializer)?;
                ty = Type::Array(element.clone(), Some(count));
            }
            let constant = base.constant && !matches!(ty, Type::Pointer(_));
            if !constant {
                self.refuse_double(&name, &ty)?;
            }
            let object = self.object(&name, &ty, Origin::Static, constant, key.clone())?;
            self.zeros(object);
            if let Some(initializer) = initializer {
                self.initialised(object, initializer)?;
            }
            self.made(key, object);
            // Later declarations of the function may name it in their initial values.
            self.scope().names.insert(name, Named::Object(object));
        }
        Ok(())
    }

    fn global(
        &mut self,
        name: &str,
        ty: &Type,
        storage: Option<&StorageClassSpecifier>,
        constant: bool,
        initializer: Option<&'a Initializer>,
    ) -> Result<(), Error> {
        let internal = storage == Some(&StorageClassSpecifier::Static);
        let known = if internal {
            match self.scope().names.get(name) {
                Some(Named::Object(object)) => Some(*object),
                _ => None,
            }
        } else {
            self.globals.get(name).copied()
        };
        if !constant {
            self.refuse_double(name, ty)?;
        }
        let incomplete = self.structs.size(ty).is_none();
        let object = match known {
            Some(object) => object,
            // `extern float table[];`: its definition follows.
            None if incomplete && storage == Some(&StorageClassSpecifier::Extern) => return Ok(()),
            None => {
                let origin = if internal { Origin::Static } else { Origin::Global };
                let key = (name.to_owned(), usize::MAX, if internal { self.unit() } else { usize::MAX });
                let object = self.object(name, ty, origin, constant, key)?;
                if !internal {
                    self.globals.insert(name.to_owned(), object);
                }
                object
            }
        };
        self.scope().names.insert(name.to_owned(), Named::Object(object));
        if let Some(initializer) = initializer {
            self.objects[object].constant = constant;
            self.zeros(object);
            self.initialised(object, initializer)?;
        } else if internal && known.is_none() {
            self.zeros(object);
        }
        Ok(())
    }

    /// Sets all unset scalars of an object to zero.
    pub(in crate::c) fn zeros(&mut self, object: usize) {
        let leaves = self.objects[object].leaves.clone();
        for (index, leaf) in leaves.iter().enumerate() {
            let zero = match leaf.ty {
                Type::Float | Type::Double => Value::Real(0.0),
                _ => Value::Int(0),
            };
            self.memory.set(object, index, zero);
        }
    }

    fn base(&mut self, specifiers: &'a [Node<DeclarationSpecifier>]) -> Result<Base, Error> {
        let (mut types, mut storage, mut constant) = (Vec::new(), None, false);
        for specifier in specifiers {
            match &specifier.node {
                DeclarationSpecifier::StorageClass(class) => storage = Some(class.node.clone()),
                DeclarationSpecifier::TypeSpecifier(ty) => types.push(ty),
                DeclarationSpecifier::TypeQualifier(qualifier) => {
                    constant |= qualifier.node == TypeQualifier::Const;
                }
                DeclarationSpecifier::Function(_)
                | DeclarationSpecifier::Alignment(_)
                | DeclarationSpecifier::Extension(_) => {}
            }
        }
        Ok(Base { ty: self.specified(&types)?, storage, constant })
    }

    fn qualified(&mut self, specifiers: &'a [Node<SpecifierQualifier>]) -> Result<Type, Error> {
        let mut types = Vec::new();
        for specifier in specifiers {
            if let SpecifierQualifier::TypeSpecifier(ty) = &specifier.node {
                types.push(ty);
            }
        }
        self.specified(&types)
    }

    fn specified(&mut self, types: &[&'a Node<TypeSpecifier>]) -> Result<Type, Error> {
        let (mut long, mut short, mut signed, mut unsigned, mut char, mut int, mut double) =
            (0, false, false, false, false, false, false);
        for ty in types {
            match &ty.node {
                TypeSpecifier::Void => return Ok(Type::Void),
                TypeSpecifier::Bool => return Ok(Type::Int(BOOL)),
                TypeSpecifier::Float => return Ok(Type::Float),
                TypeSpecifier::Double => double = true,
                TypeSpecifier::Char => char = true,
                TypeSpecifier::Short => short = true,
                TypeSpecifier::Int => int = true,
                TypeSpecifier::Long => long += 1,
                TypeSpecifier::Signed => signed = true,
                TypeSpecifier::Unsigned => unsigned = true,
                TypeSpecifier::Struct(node) => return self.structure(node),
                TypeSpecifier::Enum(node) => return self.enumeration(&node.node),
                TypeSpecifier::TypedefName(name) => {
                    return match self.looked_up(&name.node.name) {
                        Some(Named::Type(ty)) => Ok(ty.clone()),
                        _ if name.node.name.starts_with("__builtin") => Ok(Type::Void),
                        Some(_) => self.fail(format!("`{}` is not a type", name.node.name)),
                        None => self.unknown(&name.node.name),
                    };
                }
                TypeSpecifier::TypeOf(node) => {
                    return match &node.node {
                        TypeOf::Expression(expression) => self.type_of(expression),
                        TypeOf::Type(name) => self.type_name(&name.node),
                    };
                }
                TypeSpecifier::Complex | TypeSpecifier::Atomic(_) | TypeSpecifier::TS18661Float(_) => {
                    return self.fail("complex, atomic and extended types are not translated: use float");
                }
            }
        }
        if double {
            return Ok(if self.double_is_float { Type::Float } else { Type::Double });
        }
        let bits = match (char, short, long) {
            (true, ..) => 8,
            (_, true, _) => 16,
            (_, _, 2..) => 64,
            _ => 32,
        };
        if bits == 32 && !unsigned && !signed && !int && long == 0 {
            return self.fail("a declaration without a type: C99 has no implicit int");
        }
        Ok(Type::Int(Integer::new(bits, !unsigned)))
    }

    fn structure(&mut self, node: &'a Node<StructType>) -> Result<Type, Error> {
        let most = self.units[self.unit()].packed.get(&node.span.start).copied();
        let node = &node.node;
        let union = node.kind.node == StructKind::Union;
        let tag = node.identifier.as_ref().map(|name| name.node.name.clone());
        let own = tag.as_ref().and_then(|tag| self.scope().tags.get(tag).cloned());
        let seen = match (&tag, &node.declarations) {
            (Some(_), Some(_)) => own,
            (Some(tag), None) => self.tag(tag).cloned(),
            _ => None,
        };
        let index = match seen {
            Some(Type::Struct(index)) => index,
            Some(_) => return self.fail("this tag names an enumeration"),
            None => {
                let name = tag.clone().unwrap_or_else(|| "without a name".to_owned());
                self.structs.list.push(Struct {
                    name,
                    union,
                    fields: Vec::new(),
                    size: 0,
                    align: 1,
                    complete: false,
                });
                let index = self.structs.list.len() - 1;
                if let Some(tag) = tag {
                    self.scope().tags.insert(tag, Type::Struct(index));
                }
                index
            }
        };
        if let Some(declarations) = &node.declarations {
            let mut members = Vec::new();
            for declaration in declarations {
                let StructDeclaration::Field(field) = &declaration.node else { continue };
                self.go(declaration.span);
                let base = self.qualified(&field.node.specifiers)?;
                if field.node.declarators.is_empty() {
                    members.push((None, base.clone()));
                }
                for declarator in &field.node.declarators {
                    if declarator.node.bit_width.is_some() {
                        return self.fail("bit-fields are not supported: declare an integer of its own");
                    }
                    let Some(declarator) = &declarator.node.declarator else { continue };
                    let (name, ty) = self.declared(&declarator.node, base.clone())?;
                    if self.structs.size(&ty).is_none() {
                        return self.fail("a member has an unknown size: give the length of its array");
                    }
                    members.push((name, ty));
                }
            }
            self.structs.complete(index, members, most);
        }
        Ok(Type::Struct(index))
    }

    fn enumeration(&mut self, node: &'a EnumType) -> Result<Type, Error> {
        let (mut next, mut least) = (0, 0);
        for enumerator in &node.enumerators {
            if let Some(expression) = &enumerator.node.expression {
                next = self.known_integer(expression)?;
            }
            least = least.min(next);
            let name = enumerator.node.identifier.node.name.clone();
            self.scope().names.insert(name, Named::Constant(next));
            next += 1;
        }
        // gcc makes the type unsigned if no constant is negative.
        let ty = Type::Int(if least < 0 { INT } else { UNSIGNED });
        match &node.identifier {
            Some(tag) if node.enumerators.is_empty() => Ok(self.tag(&tag.node.name).cloned().unwrap_or(ty)),
            Some(tag) => {
                self.scope().tags.insert(tag.node.name.clone(), ty.clone());
                Ok(ty)
            }
            None => Ok(ty),
        }
    }

    pub(super) fn type_name(&mut self, name: &'a TypeName) -> Result<Type, Error> {
        let base = self.qualified(&name.specifiers)?;
        match &name.declarator {
            Some(declarator) => Ok(self.declared(&declarator.node, base)?.1),
            None => Ok(base),
        }
    }

    /// Name and type of a declarator.
    fn declared(&mut self, declarator: &'a Declarator, base: Type) -> Result<(Option<String>, Type), Error> {
        let mut ty = base;
        let split =
            declarator.derived.partition_point(|part| matches!(part.node, DerivedDeclarator::Pointer(_)));
        let (pointers, rest) = declarator.derived.split_at(split);
        for _ in pointers {
            ty = Type::Pointer(Rc::new(ty));
        }
        for part in rest.iter().rev() {
            ty = match &part.node {
                DerivedDeclarator::Pointer(_) => Type::Pointer(Rc::new(ty)),
                DerivedDeclarator::Array(array) => match &array.node.size {
                    ArraySize::Unknown => Type::Array(Rc::new(ty), None),
                    ArraySize::VariableExpression(size) | ArraySize::StaticExpression(size) => {
                        let count = self.known_integer(size)?;
                        let Ok(count) = usize::try_from(count) else {
                            return self.fail(format!("an array cannot have {count} elements"));
                        };
                        if count > crate::c::types::MAX_LEAVES {
                            return self.fail(format!(
                                "an array of more than {} elements",
                                crate::c::types::MAX_LEAVES
                            ));
                        }
                        Type::Array(Rc::new(ty), Some(count))
                    }
                    ArraySize::VariableUnknown => {
                        return self.fail("this array has an unknown length: give a number of elements");
                    }
                },
                DerivedDeclarator::Function(function) => {
                    let mut parameters = Vec::new();
                    for parameter in &function.node.parameters {
                        let base = self.base(&parameter.node.specifiers)?;
                        let (name, ty) = match &parameter.node.declarator {
                            Some(declarator) => self.declared(&declarator.node, base.ty)?,
                            None => (None, base.ty),
                        };
                        parameters.push((name.unwrap_or_default(), ty));
                    }
                    if matches!(parameters.as_slice(), [(name, Type::Void)] if name.is_empty()) {
                        parameters.clear();
                    }
                    if function.node.ellipsis == Ellipsis::Some {
                        parameters.push(("...".to_owned(), Type::Void));
                    }
                    Type::Function(Rc::new(Signature { result: ty, parameters }))
                }
                DerivedDeclarator::KRFunction(_) => {
                    Type::Function(Rc::new(Signature { result: ty, parameters: Vec::new() }))
                }
                DerivedDeclarator::Block(_) => return self.fail("blocks are not part of C99"),
            };
        }
        match &declarator.kind.node {
            DeclaratorKind::Abstract => Ok((None, ty)),
            DeclaratorKind::Identifier(name) => Ok((Some(name.node.name.clone()), ty)),
            DeclaratorKind::Declarator(inner) => self.declared(&inner.node, ty),
        }
    }

    /// An integer that is known while translating.
    pub(super) fn known_integer(
        &mut self,
        expression: &'a Node<lang_c::ast::Expression>,
    ) -> Result<i64, Error> {
        match self.value(expression)? {
            Typed { value: Value::Int(value), .. } => Ok(value),
            _ => self.fail("expected a constant, but this depends on inputs or states"),
        }
    }
}
