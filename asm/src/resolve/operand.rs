// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operands as registers, labels and numbers: the part of [`resolve`](crate::resolve) for one operand.

use crate::context::NameRole;
use crate::context::{Argument, Array, AstPlace, Binding, ErrorReported};
use crate::expand::{address, register_at};
use crate::ir::type_evidence::{Kind, OperandPosition, TypeEvidence, TypeOrigin};
use crate::ir::{Constant, Label, LabelId, Operation, RegisterId, RegisterKind, VirtualRegister};
use crate::resolve::Resolver;
use crate::resolve::advice::loading;
use crate::resolve::elements::Place as ElementPlace;
use crate::resolve::term::CurrentEquation;
use std::rc::Rc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;
use takt_isa::shape::Field;
use takt_isa::{Operand as Place, Row, Type};
use takt_syntax::ast::*;
use takt_syntax::expr::{EvalError, Value};
use takt_syntax::name::NameId;

/// An operand and its scope, parameters replaced by their arguments; and its binding, if it is a name.
type Meaning = (AstPlace, Operand, Option<(NameId, Binding)>);

impl Resolver<'_> {
    #[inline]
    pub(crate) fn operand(
        &mut self,
        at: AstPlace,
        row: &Row,
        place: Place,
        operand: Operand,
        operation: &mut Operation,
    ) -> Result<(), ErrorReported> {
        (self.cast, self.asked) = (None, None);
        match place {
            Place::Dest => {
                operation.dest = Some(self.dest(at, operand, NameRole::Dest)?);
                self.check_operand(row, (row.result_type(), false), operand.span, at.scope)?;
                self.note_cast(operation, OperandPosition::Dest);
                self.note_parameter_type(operation, OperandPosition::Dest);
            }
            Place::Source(index) => {
                let ty = row.source_type(index);
                let source = match self.plain(at, operand) {
                    Some(register) => register,
                    None => self.other_source(at, operand, ty)?,
                };
                operation.sources[index] = source;
                let asked = self.asked;
                self.check_operand(row, (ty, true), operand.span, at.scope)?;
                let is_constant = || {
                    let register = &self.context.declared.registers[source.index()];
                    matches!(register.kind, RegisterKind::Constant(_))
                };
                if ty == Type::B && self.type_of_parameter().is_none() && is_constant() {
                    self.note_literal(at, operand, operation, OperandPosition::Source(index as u8));
                }
                self.asked = asked;
                self.note_cast(operation, OperandPosition::Source(index as u8));
                self.note_parameter_type(operation, OperandPosition::Source(index as u8));
            }
            Place::Immediate => {
                operation.constant = match self.code_label(at, operand)? {
                    Some(label) => Constant::Code(label),
                    None => Constant::Value(self.constant(at, operand, row.result_type())?),
                };
                match operation.constant {
                    Constant::Code(_) => {
                        let given = TypeEvidence::Literal {
                            kind: Kind::Int,
                            what: TypeOrigin::Address,
                            span: operand.span,
                        };
                        self.context.declared.given.insert(operation, OperandPosition::Immediate, given);
                    }
                    Constant::Value(0) => {}
                    _ if row.result_type() == Type::B => {
                        self.note_literal(at, operand, operation, OperandPosition::Immediate);
                    }
                    _ => {}
                }
            }
            Place::Target => operation.constant = self.target(at, operand)?,
            Place::Memory => {
                let (_, _, meaning) = self.meaning(at, operand)?;
                if let Some((_, Binding::Word(word))) = meaning {
                    let mut line = CurrentEquation::new(self.line);
                    let word = self.words[word as usize].clone();
                    let address = self.word_address(at, &mut line, &word)?;
                    operation.constant = Constant::Value(address.offset);
                    operation.sources[0] = address.base;
                    operation.access = Some(address.access);
                    return Ok(());
                }
                let (offset, base) = self.memory(at, operand, row)?;
                operation.constant = Constant::Value(offset);
                operation.sources[0] = base;
                if let Some(table) = self.table_of(at, operand.kind) {
                    self.context.declared.given.insert(
                        operation,
                        OperandPosition::Table,
                        TypeEvidence::Table(table),
                    );
                }
                self.note_cast(operation, OperandPosition::Source(0));
            }
        }
        Ok(())
    }

    /// Records the type that the source casts the last operand to.
    #[inline]
    fn note_cast(&mut self, operation: &Operation, part: OperandPosition) {
        if let Some(ty) = self.cast {
            self.context.declared.given.insert(operation, part, TypeEvidence::Cast(ty));
        }
    }

    /// Records the type of a constant where the instruction takes any bits.
    fn note_literal(&mut self, at: AstPlace, operand: Operand, operation: &Operation, part: OperandPosition) {
        let Ok(value) = self.operand_value(at, operand) else { return };
        let is_address = self.table_of(at, operand.kind).is_some();
        let given = TypeEvidence::literal(value, is_address, operand.span);
        self.context.declared.given.insert(operation, part, given);
    }

    /// The register that an operand names, if it is a plain name and no address is required.
    #[inline(always)]
    fn plain(&self, at: AstPlace, operand: Operand) -> Option<RegisterId> {
        let OperandKind::Name(name) = operand.kind else { return None };
        match self.context.lookup(at.scope, name.resolve().ok()?) {
            Binding::Register(register) if self.context.notes.is_none() => Some(register),
            _ => None,
        }
    }

    /// Replaces parameters by their arguments, and looks up the binding if the operand is a name.
    pub(crate) fn meaning(
        &mut self,
        mut at: AstPlace,
        mut operand: Operand,
    ) -> Result<Meaning, ErrorReported> {
        let (mut parameter, mut asked) = (None, None);
        loop {
            if let OperandKind::Cast(cast) = operand.kind {
                let Cast { operand: inner, ty } = self.context.asts[at.ast as usize].casts[cast as usize];
                let ty = self.context.type_named(at, ty)?;
                if !matches!(inner.kind, OperandKind::Name(_) | OperandKind::Place(_)) {
                    let error = Diagnostic::error(
                        "type",
                        operand.span,
                        "only a register can be read as another type",
                    );
                    return Err(self.context.report(at.scope, error));
                }
                self.cast.get_or_insert(ty);
                operand = inner;
            }
            if let OperandKind::Element(_) | OperandKind::Memory(_) = operand.kind
                && let Some((name, indices)) = self.indexed(at, operand)
            {
                let place = self.element_place(at, name, &indices, operand.span)?;
                self.asked = asked;
                let id = self.context.name(at, name.name, name.span)?;
                let binding = match place {
                    ElementPlace::Register(register) => Binding::Register(register),
                    ElementPlace::Word(word) => {
                        self.words.push(word);
                        Binding::Word(self.words.len() as u32 - 1)
                    }
                };
                return Ok((at, operand, Some((id, binding))));
            }
            self.asked = asked;
            let OperandKind::Name(name) = operand.kind else { return Ok((at, operand, None)) };
            let name = self.context.name(at, name, operand.span)?;
            match self.context.lookup(at.scope, name) {
                // Arguments that are parameters themselves were replaced when the macro was used.
                Binding::Argument(argument) => {
                    parameter.get_or_insert((self.context.scopes.scope(at.scope).owner, name));
                    if self.context.declared.arguments[argument as usize].asked.is_some() {
                        asked.get_or_insert(argument);
                    }
                    Argument { operand, at, .. } = self.context.declared.arguments[argument as usize];
                }
                binding => {
                    if let (Some((scope, name)), Binding::Register(register)) = (parameter, binding) {
                        let known = &mut self.context.declared.parameters;
                        if known.last() != Some(&(scope, name, register)) {
                            known.push((scope, name, register));
                        }
                    }
                    self.check_array(binding)?;
                    return Ok((at, operand, Some((name, binding))));
                }
            }
        }
    }

    /// The register that an operand names as the target of an instruction or an equation.
    pub(crate) fn dest(
        &mut self,
        at: AstPlace,
        operand: Operand,
        wanted: NameRole,
    ) -> Result<RegisterId, ErrorReported> {
        if let Some(register) = self.plain(at, operand) {
            let VirtualRegister { kind, pinned, .. } = &self.context.declared.registers[register.index()];
            if matches!(kind, RegisterKind::Plain | RegisterKind::State | RegisterKind::Output)
                && pinned.is_none()
            {
                return Ok(register);
            }
        }
        let help = match wanted {
            NameRole::Left => "the left side of `=` is the register to write",
            _ => "the first operand is the register to write",
        };
        let (place, given, meaning) = self.meaning(at, operand)?;
        let register = match (given.kind, meaning) {
            (_, Some((_, Binding::Register(register)))) => {
                self.check_result(self.declared_kind(register).unwrap_or(Kind::None))?;
                register
            }
            // The store follows the bundle that computes the value.
            (_, Some((_, Binding::Word(word)))) => {
                let ty = self.element_type(&self.words[word as usize]);
                self.check_result(Kind::of(ty))?;
                let register = self.fresh(given.span);
                self.context.declared.registers[register.index()].ty = ty;
                self.stores.push((self.words[word as usize].clone(), register, given.span));
                return Ok(register);
            }
            (_, Some((_, Binding::Table(table)))) => return Err(self.whole_array(at, table, given.span)),
            (_, Some((name, Binding::None))) => {
                return Err(self.context.unknown(place.scope, name, given.span, wanted));
            }
            (OperandKind::Place(name), _) => {
                let address = address(self.context, place, Name { name, span: given.span })?;
                register_at(self.context, address, given.span)
            }
            (_, Some((name, binding))) => {
                let kind = self.context.declared.kind_text(binding);
                let message = format!("`{}` is {kind}: it cannot be written", self.context.scopes.text(name));
                let mut error = Diagnostic::error("not-writable", given.span, message);
                if let Some(declared) = self.context.declared.declaration(binding) {
                    error = error.also(declared, "declared here");
                }
                return Err(self.context.report(at.scope, error.help(help)));
            }
            _ => {
                let error =
                    Diagnostic::error("not-writable", given.span, "this cannot be written").help(help);
                return Err(self.context.report(at.scope, error));
            }
        };
        let VirtualRegister { kind, name, span, pinned, .. } =
            &self.context.declared.registers[register.index()];
        let machine = self.ir.machine;
        let input = kind.is_from_outside() || pinned.is_some_and(|address| machine.is_input(address));
        let error = match kind {
            RegisterKind::Zero => {
                let error = Diagnostic::error(
                    "not-writable",
                    given.span,
                    "`zero` always reads as zero: it cannot be written",
                );
                error.help("name a register for the result, even an unused one")
            }
            _ if input && name.is_empty() => {
                Diagnostic::error("not-writable", given.span, "an input port is written from outside only")
            }
            RegisterKind::Parameter => {
                let message = format!("`{name}` is a parameter: it is set from outside only");
                Diagnostic::error("not-writable", given.span, message).also(*span, "declared here")
            }
            _ if input => {
                let message = format!("`{name}` is an input port: it is written from outside only");
                Diagnostic::error("not-writable", given.span, message).also(*span, "declared here")
            }
            _ => return Ok(register),
        };
        Err(self.context.report(at.scope, error))
    }

    /// The array and the indices of an operand that is an array element. With one index it looks like a place in memory.
    fn indexed(&mut self, at: AstPlace, operand: Operand) -> Option<(Name, Vec<Vec<Node>>)> {
        let ast = Rc::clone(&self.context.asts[at.ast as usize]);
        match operand.kind {
            OperandKind::Element(element) => {
                let Element { name, indices } = &ast.elements[element as usize];
                Some((*name, indices.clone()))
            }
            OperandKind::Memory(memory) => {
                let Memory { offset: Some(offset), base } = ast.memories[memory as usize] else {
                    return None;
                };
                let [Node { kind: NodeKind::Name(name), span }] = ast.nodes[offset.id.range()] else {
                    return None;
                };
                let id = name.resolve().ok()?;
                let mut binding = self.context.lookup(at.scope, id);
                while let Binding::Argument(argument) = binding {
                    let argument = self.context.declared.arguments[argument as usize];
                    let OperandKind::Name(name) = argument.operand.kind else { return None };
                    binding = self.context.lookup(argument.at.scope, name.resolve().ok()?);
                }
                match (binding, base.kind) {
                    (Binding::Array(_) | Binding::Table(_), _) => {}
                    // An element that is declared with a place.
                    (Binding::None, OperandKind::Expr(expr)) => {
                        let [Node { kind: NodeKind::Int(index), .. }] = ast.nodes[expr.range()] else {
                            return None;
                        };
                        let element = format!("{}[{index}]", self.context.scopes.text(id));
                        let element = self.context.scopes.names_mut().intern(&element);
                        let Binding::Register(_) = self.context.lookup(at.scope, element) else {
                            return None;
                        };
                    }
                    _ => return None,
                }
                let index = match base.kind {
                    OperandKind::Name(name) => vec![Node { kind: NodeKind::Name(name), span: base.span }],
                    OperandKind::Expr(expr) => ast.nodes[expr.range()].to_vec(),
                    _ => return None,
                };
                Some((Name { name, span }, vec![index]))
            }
            _ => None,
        }
    }

    /// The register of an array element.
    pub(crate) fn element(
        &mut self,
        at: AstPlace,
        name: Name,
        indices: &[Vec<Node>],
        span: Span,
    ) -> Result<RegisterId, ErrorReported> {
        let operand = Operand { kind: OperandKind::Name(name.name), span: name.span };
        let (place, _, meaning) = self.meaning(at, operand)?;
        let array = match meaning {
            Some((_, Binding::Array(array))) => self.context.declared.arrays[array as usize].clone(),
            // Only an array in data memory takes the index of a loop at run time.
            Some((id, Binding::None)) if self.varies(at, indices) => {
                return Err(self.context.unknown(place.scope, id, name.span, NameRole::Array));
            }
            Some((id, Binding::None)) => {
                let indices: Result<Vec<String>, ErrorReported> = indices
                    .iter()
                    .map(|nodes| self.context.index(at, nodes, span).map(|index| index.to_string()))
                    .collect();
                let element = format!("{}[{}]", self.context.scopes.text(id), indices?.join(","));
                let element = self.context.scopes.names_mut().intern(&element);
                return match self.context.lookup(place.scope, element) {
                    Binding::Register(register) => Ok(register),
                    _ => Err(self.context.unknown(place.scope, id, name.span, NameRole::Array)),
                };
            }
            _ => {
                let text = self.context.reports.sources.text(name.span).to_owned();
                let kind =
                    meaning.map_or("no array", |(_, binding)| self.context.declared.kind_text(binding));
                let message = format!("`{text}` is {kind}, not an array of registers");
                let mut error = Diagnostic::error("array", name.span, message);
                if let Some(declared) =
                    meaning.and_then(|(_, binding)| self.context.declared.declaration(binding))
                {
                    error = error.also(declared, "declared here");
                }
                return Err(self.context.report(at.scope, error));
            }
        };
        let Array { name: text, first, sizes, span: declared } = &array;
        if indices.len() != sizes.len() {
            let (takes, found) = (sizes.len(), indices.len());
            let plural = if takes == 1 { "index" } else { "indices" };
            let message = format!("`{text}` has {takes} {plural}, not {found}");
            let error = Diagnostic::error("array", span, message)
                .also(*declared, format!("declared here as `{text}[{}]`", array.shape()));
            return Err(self.context.report(at.scope, error));
        }
        let mut number = 0;
        let mut slices = 0;
        for (nodes, size) in indices.iter().zip(sizes) {
            let is_slice = nodes.last().is_some_and(|node| node.kind.is_slice());
            slices += usize::from(is_slice);
            let index = match is_slice {
                true => self.slice_constant(at, nodes, slices, span)?,
                false => self.context.index(at, nodes, span)?,
            };
            let Some(index) = u32::try_from(index).ok().filter(|index| (1..=*size).contains(index)) else {
                let span = nodes.last().map_or(span, |node| node.span);
                let message = format!("`{text}` has no element {index} here: it is 1 to {size}");
                let error = Diagnostic::error("array", span, message)
                    .also(*declared, format!("declared here as `{text}[{}]`", array.shape()));
                return Err(self.context.report(at.scope, error));
            };
            number = number * size + index - 1;
        }
        Ok(RegisterId::new(first.index() + number as usize))
    }

    /// An index is a slice, or mentions the index of a loop at run time.
    fn varies(&self, at: AstPlace, indices: &[Vec<Node>]) -> bool {
        let is_index = |node: &Node| match node.kind {
            NodeKind::Name(name) => {
                name.resolve().is_ok_and(|id| matches!(self.context.lookup(at.scope, id), Binding::Index(_)))
            }
            kind => kind.is_slice(),
        };
        indices.iter().flatten().any(is_index)
    }

    /// The current value of an index that is a slice of an array of registers, whose loop is written out.
    fn slice_constant(
        &mut self,
        at: AstPlace,
        nodes: &[Node],
        number: usize,
        span: Span,
    ) -> Result<i64, ErrorReported> {
        let index = self.context.slice_index(at, nodes, number, span)?;
        index.as_constant().ok_or_else(|| {
            let message = "the elements of an array of registers are known when the program is assembled";
            self.context.error(at.scope, "slice", span, message)
        })
    }

    /// The port that a name stands for, an input or an output if `wanted`.
    pub(crate) fn port(
        &mut self,
        at: AstPlace,
        name: Name,
        wanted: Option<RegisterKind>,
    ) -> Result<RegisterId, ErrorReported> {
        let operand = Operand { kind: OperandKind::Name(name.name), span: name.span };
        let (place, given, meaning) = self.meaning(at, operand)?;
        if let Some((name, Binding::None)) = meaning {
            return Err(self.context.unknown(place.scope, name, given.span, NameRole::Source));
        }
        let is_port = |kind| match wanted {
            Some(wanted) => kind == wanted,
            None => matches!(kind, RegisterKind::Input | RegisterKind::Output),
        };
        if let Some((_, Binding::Register(register))) = meaning
            && is_port(self.context.declared.registers[register.index()].kind)
        {
            return Ok(register);
        }
        let wanted = match wanted {
            Some(RegisterKind::Output) => "an output port",
            Some(_) => "an input port",
            None => "a port",
        };
        let text = self.context.reports.sources.text(given.span);
        let message = match meaning {
            Some((_, binding)) => {
                format!("`{text}` is {}, not {wanted}", self.context.declared.kind_text(binding))
            }
            None => format!("{wanted} is needed here"),
        };
        let mut error = Diagnostic::error("operand", given.span, message);
        if let Some(declared) = meaning.and_then(|(_, binding)| self.context.declared.declaration(binding)) {
            error = error.also(declared, "declared here");
        }
        Err(self.context.report(at.scope, error))
    }

    /// The register that a `.preset` names, by its name or its place, or the element of an array.
    pub(crate) fn preset_register(
        &mut self,
        at: AstPlace,
        operand: Operand,
        placed: bool,
    ) -> Result<(RegisterId, Type), ErrorReported> {
        let (place, given, meaning) = if placed { (at, operand, None) } else { self.meaning(at, operand)? };
        let (register, ty) = match (given.kind, meaning) {
            (_, Some((_, Binding::Register(register)))) => {
                (register, self.context.declared.registers[register.index()].ty)
            }
            (_, Some((_, binding @ Binding::Array(array)))) => {
                let Array { name, sizes, .. } = &self.context.declared.arrays[array as usize];
                let first = vec!["1"; sizes.len()].join(",");
                let message = format!("`{name}` is an array, and one register is needed here");
                let help = format!("name its elements, as `{name}[{first}]`");
                let mut error = Diagnostic::error("operand", given.span, message).help(help);
                if let Some(declared) = self.context.declared.declaration(binding) {
                    error = error.also(declared, "declared here");
                }
                return Err(self.context.report(at.scope, error));
            }
            (_, Some((_, binding @ (Binding::Table(_) | Binding::Word(_))))) => {
                let message = format!("this is {}, not a register", self.context.declared.kind_text(binding));
                let error = Diagnostic::error("operand", given.span, message)
                    .help("give an array its values where it is declared: `.array x[3] = 1, 2, 3`");
                return Err(self.context.report(at.scope, error));
            }
            (OperandKind::Name(name) | OperandKind::Place(name), _) => {
                if let Some((id, Binding::None)) = meaning
                    && !self.looks_like_a_place(id)
                {
                    return Err(self.context.unknown(place.scope, id, given.span, NameRole::Dest));
                }
                let address = address(self.context, place, Name { name, span: given.span })?;
                (register_at(self.context, address, given.span), Type::B)
            }
            _ => {
                let error = Diagnostic::error("operand", given.span, "a register is needed here");
                return Err(self.context.report(at.scope, error));
            }
        };
        if register == RegisterId::ZERO {
            let error = Diagnostic::error("place", given.span, "`zero` always reads as zero");
            return Err(self.context.report(at.scope, error));
        }
        Ok((register, ty))
    }

    /// A name consists of a bank's name and a number.
    fn looks_like_a_place(&self, name: NameId) -> bool {
        let text = self.context.scopes.text(name);
        let digits = text.trim_end_matches(|c: char| c.is_ascii_digit());
        digits.len() < text.len() && self.ir.machine.banks().any(|bank| bank.name == digits)
    }

    /// The register of an operand to read: a named register, or a register that holds a constant.
    pub(crate) fn source(
        &mut self,
        at: AstPlace,
        operand: Operand,
        ty: Type,
    ) -> Result<RegisterId, ErrorReported> {
        match self.plain(at, operand) {
            Some(register) => Ok(register),
            None => self.other_source(at, operand, ty),
        }
    }

    /// The register of an operand to read that does not name it directly.
    fn other_source(
        &mut self,
        at: AstPlace,
        operand: Operand,
        ty: Type,
    ) -> Result<RegisterId, ErrorReported> {
        let (place, given, meaning) = self.meaning(at, operand)?;
        let asked = self.asked;
        let source = match (given.kind, meaning) {
            (_, Some((_, Binding::Register(register)))) => {
                self.check_register(register)?;
                register
            }
            (_, Some((_, Binding::Word(word)))) => {
                let ty = self.element_type(&self.words[word as usize]);
                self.check_argument(Kind::of(ty))?;
                let loaded = self.loaded(at, word, given.span)?;
                self.cast.get_or_insert(ty);
                loaded
            }
            (_, Some((_, Binding::Index(index)))) => {
                self.check_argument(Kind::Int)?;
                self.index_register(at, index, ty, given.span)?
            }
            (_, Some((name, Binding::None))) => {
                return Err(self.context.unknown(place.scope, name, given.span, NameRole::Source));
            }
            (OperandKind::Place(name), _) => {
                let address = address(self.context, place, Name { name, span: given.span })?;
                register_at(self.context, address, given.span)
            }
            (OperandKind::Memory(_), _) => {
                let error =
                    Diagnostic::error("operand", given.span, "a memory operand where a register is read")
                        .help("load it into a register with `ld` first");
                return Err(self.context.report(at.scope, error));
            }
            _ => {
                if let Some((_, binding)) = meaning {
                    self.check_address_of(binding)?;
                }
                // An argument has its parameter's type, also where its bits are taken.
                let bits = self.constant(place, given, self.type_of_parameter().unwrap_or(ty))?;
                self.pooled(bits, given.span)
            }
        };
        self.asked = asked;
        Ok(source)
    }

    /// The register that holds a constant.
    pub(crate) fn pooled(&mut self, bits: u32, span: Span) -> RegisterId {
        if bits == 0 {
            return RegisterId::ZERO;
        }
        let registers = &mut self.context.declared.registers;
        *self.pool.entry(bits).or_insert_with(|| {
            registers.push(VirtualRegister {
                name: String::new(),
                kind: RegisterKind::Constant(bits),
                ty: Type::B,
                pinned: None,
                preset: None,
                span,
            });
            RegisterId::new(registers.len() - 1)
        })
    }

    /// The bits of a constant operand.
    fn constant(&mut self, at: AstPlace, operand: Operand, ty: Type) -> Result<u32, ErrorReported> {
        let value = self.operand_value(at, operand)?;
        self.bits(at, value, ty, operand)
    }

    pub(crate) fn bits(
        &mut self,
        at: AstPlace,
        value: Value,
        ty: Type,
        operand: Operand,
    ) -> Result<u32, ErrorReported> {
        let span = operand.span;
        let bits = value.bits(ty).map_err(|fault| self.context.fault(at.scope, EvalError { span, fault }))?;
        if let Value::Real(real) = value
            && ty != Type::I
            && f64::from(f32::from_bits(bits)) != real
        {
            self.context.declared.reals.insert(real.to_bits());
        }
        if let Value::Real(real) = value
            && ty != Type::I
            && bits << 1 == 0
            && real != 0.0
        {
            let warning =
                Diagnostic::warning("underflow", span, format!("{real:e} rounds to zero in binary32"));
            self.context.report(at.scope, warning);
        }
        if let (Value::Int(_), Type::F) = (value, ty)
            && let Some(label) = self.table_of(at, operand.kind)
        {
            let Label { name, span: declared, .. } = &self.context.declared.labels[label.0 as usize];
            let message = format!("the address of `{name}` is taken as a float");
            let warning =
                Diagnostic::warning("types", span, message).also(*declared, "declared here").help(format!(
                    "load the word there with `{}`, or write `float(…)` if the address is meant",
                    loading()
                ));
            self.context.report(at.scope, warning);
        }
        Ok(bits)
    }

    pub(crate) fn operand_value(&mut self, at: AstPlace, operand: Operand) -> Result<Value, ErrorReported> {
        let (place, given, meaning) = self.meaning(at, operand)?;
        match (given.kind, meaning) {
            (OperandKind::Expr(expr), _) => self.context.value(place, expr),
            (_, Some((_, Binding::Word(_)))) => {
                let error = Diagnostic::error("operand", given.span, "a constant expression is needed here")
                    .note("an element of an array has no value before the program runs");
                Err(self.context.report(at.scope, error))
            }
            (_, Some((name, _))) => self.context.name_value(place.scope, name, given.span),
            _ => {
                let error = Diagnostic::error("operand", given.span, "a constant expression is needed here");
                Err(self.context.report(at.scope, error))
            }
        }
    }

    /// The code label that an operand names, if any.
    fn code_label(&mut self, at: AstPlace, operand: Operand) -> Result<Option<LabelId>, ErrorReported> {
        Ok(match self.meaning(at, operand)? {
            (_, _, Some((_, Binding::Code(label)))) => Some(label),
            _ => None,
        })
    }

    fn target(&mut self, at: AstPlace, operand: Operand) -> Result<Constant, ErrorReported> {
        let (place, given, meaning) = self.meaning(at, operand)?;
        match meaning {
            Some((_, Binding::Code(label))) => return Ok(Constant::Code(label)),
            Some((name, Binding::None)) => {
                return Err(self.context.unknown(place.scope, name, given.span, NameRole::Target));
            }
            Some((name, binding @ (Binding::Register(_) | Binding::Data(_)))) => {
                let kind = self.context.declared.kind_text(binding);
                let message = format!("`{}` is {kind}, not a code label", self.context.scopes.text(name));
                let mut error = Diagnostic::error("operand", given.span, message);
                if let Some(declared) = self.context.declared.declaration(binding) {
                    error = error.also(declared, "declared here");
                }
                return Err(self.context.report(at.scope, error));
            }
            _ => {}
        }
        let value = self.operand_value(place, given)?;
        let target = value
            .integer()
            .map_err(|fault| self.context.fault(at.scope, EvalError { span: given.span, fault }))?;
        self.field(at, target, Field::Target, given.span, "a bundle address")
    }

    /// A number for a field of the word.
    fn field(
        &mut self,
        at: AstPlace,
        value: i64,
        field: Field,
        span: Span,
        what: &str,
    ) -> Result<Constant, ErrorReported> {
        let most = field.bits().max();
        match u32::try_from(value) {
            Ok(value) if value <= most => Ok(Constant::Value(value)),
            _ => {
                let error = Diagnostic::error("range", span, format!("{what} is 0 to {most}, not {value}"));
                Err(self.context.report(at.scope, error))
            }
        }
    }

    /// Offset and base of a memory operand.
    fn memory(
        &mut self,
        at: AstPlace,
        operand: Operand,
        row: &Row,
    ) -> Result<(u32, RegisterId), ErrorReported> {
        let (place, given, meaning) = self.meaning(at, operand)?;
        let (value, span, base) = match (given.kind, meaning) {
            (OperandKind::Memory(memory), _) => {
                let Memory { offset, base } = self.context.asts[place.ast as usize].memories[memory as usize];
                let value = match offset {
                    Some(offset) => self.context.integer(place, offset).inspect_err(|_| {
                        self.context.unknown_tables(offset.span);
                    }),
                    None => Ok(0),
                };
                let base = self.source(place, base, row.source_type(0));
                (value?, offset.map_or(given.span, |offset| offset.span), base?)
            }
            (_, Some((name, binding @ (Binding::Register(_) | Binding::Code(_))))) => {
                let text = self.context.scopes.text(name).to_owned();
                let kind = self.context.declared.kind_text(binding);
                let mut error = Diagnostic::error(
                    "operand",
                    given.span,
                    format!("`{text}` is {kind}, not a place in memory"),
                );
                if matches!(binding, Binding::Register(_)) {
                    error = error.mend(
                        format!("write `[{text}]` for the word that it points to"),
                        format!("[{text}]"),
                    );
                }
                return Err(self.context.report(at.scope, error));
            }
            _ => {
                let value = self.operand_value(place, given).inspect_err(|_| {
                    self.context.unknown_tables(given.span);
                })?;
                let value = value.integer().map_err(|fault| {
                    let span = given.span;
                    self.context.fault(at.scope, EvalError { span, fault })
                })?;
                (value, given.span, RegisterId::ZERO)
            }
        };
        // If the data does not fit, its addresses are not reported as well.
        if self.is_full && self.table_of(place, given.kind).is_some() {
            return Err(ErrorReported);
        }
        match self.field(at, value, Field::Offset, span, "an offset")? {
            Constant::Value(offset) => {
                self.check_address(at, (place, given), offset, base, span);
                Ok((offset, base))
            }
            _ => Err(ErrorReported),
        }
    }
}
