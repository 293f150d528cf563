// SPDX-License-Identifier: MIT OR Apache-2.0
//! Declarations: registers and their places, presets, data. The part of [`expand`](crate::expand) that records the program's
//! contents, as opposed to control flow.

use crate::context::{Array, AstPlace, Binding, Context, ErrorReported, ScopeId, Table};
use crate::expand::load::include_path;
use crate::expand::numbers::{Table as Numbers, shape_text};
use crate::expand::{Data, Expander, Fast};
use crate::ir::arrays;
use crate::ir::{Label, LabelId, RegisterId, RegisterKind, VirtualRegister};
use crate::limits;
use smallvec::SmallVec;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::machine::{MachineMistake, machine_file, machine_from};
use takt_diagnostics::source::Span;
use takt_isa::program::{Columns, Location, Space};
use takt_isa::{Machine, MachineNameError, Register, Type};
use takt_syntax::ast::*;
use takt_syntax::name::NameId;

impl Expander<'_> {
    pub(crate) fn data_section(&mut self, at: AstPlace, span: Span) -> Result<(), ErrorReported> {
        if self.section == Section::Data {
            return Ok(());
        }
        let error =
            Diagnostic::error("section", span, "data outside of `.data`").help("open `.data` before it");
        Err(self.context.report(at.scope, error))
    }

    pub(crate) fn data(
        &mut self,
        at: AstPlace,
        values: &[Expr],
        ty: Type,
        span: Span,
    ) -> Result<(), ErrorReported> {
        self.data_section(at, span)?;
        self.flat.data.extend(values.iter().map(|value| Data::Value(at, *value, ty)));
        self.data_words += values.len();
        self.check_data(at, span);
        Ok(())
    }

    pub(crate) fn check_data(&mut self, at: AstPlace, span: Span) {
        if self.data_words > limits::DATA_WORDS {
            let message = format!("the program expands to more than {} words of data", limits::DATA_WORDS);
            self.limit(at.scope, span, message);
        }
    }

    pub(crate) fn declare(
        &mut self,
        at: AstPlace,
        what: DeclarationKind,
        declaration: &Declaration,
    ) -> Result<(), ErrorReported> {
        let Name { name, span } = declaration.name;
        let id = self.context.name(at, name, span)?;
        self.declare_name(at, what, declaration, id)
    }

    fn declare_name(
        &mut self,
        at: AstPlace,
        what: DeclarationKind,
        declaration: &Declaration,
        id: NameId,
    ) -> Result<(), ErrorReported> {
        let span = declaration.name.span;
        let kind = kind_of(what);
        let register = RegisterId::new(self.context.declared.registers.len());
        self.context.declare(at, id, span, Binding::Register(register))?;
        // From here on the name is known: a mistake in its type or place is reported, and the declaration stands.
        let name = self.context.scopes.full_name(at.scope, id);
        self.context.declared.registers.push(VirtualRegister {
            name,
            kind,
            ty: Type::F,
            pinned: None,
            preset: None,
            span,
        });
        if let Some(ty) = declaration.ty {
            self.context.declared.registers[register.index()].ty = self.context.type_named(at, ty)?;
            self.context.declared.typed.insert(register);
        }
        match declaration.place {
            Some(place) => self.place(at, register, place),
            None => Ok(()),
        }
    }

    /// Declares an array of registers.
    pub(crate) fn declare_array(
        &mut self,
        at: AstPlace,
        what: DeclarationKind,
        declaration: &Declaration,
        sizes: &[Expr],
    ) -> Result<(), ErrorReported> {
        let Name { name, span } = declaration.name;
        let id = self.context.name(at, name, span)?;
        let text = self.context.scopes.full_name(at.scope, id);
        let kind = kind_of(what);
        // With a place, one element is declared: disassembly writes arrays like this.
        if declaration.place.is_some() {
            let mut indices = Vec::with_capacity(sizes.len());
            for size in sizes {
                let index = self.context.integer(at, *size)?;
                if index < 1 {
                    let message = format!("there is no element {index}: indices count from 1");
                    return Err(self.context.error(at.scope, "range", size.span, message));
                }
                indices.push(index.to_string());
            }
            if let Binding::Array(_) = self.context.lookup(at.scope, id) {
                let message = format!("`{text}` is declared already, as an array without places");
                return Err(self.context.error(at.scope, "declared-twice", span, message));
            }
            let element = format!("{}[{}]", self.context.scopes.text(id), indices.join(","));
            let id = self.context.scopes.names_mut().intern(&element);
            return self.declare_name(at, what, declaration, id);
        }
        let most = limits::ARRAY_ELEMENTS - self.context.declared.elements;
        let (count, shape) = self.shape(at, span, sizes, most, limits::ARRAY_ELEMENTS)?;
        let ty = match declaration.ty {
            Some(ty) => Some(self.context.type_named(at, ty)?),
            None => None,
        };
        let number = self.context.declared.arrays.len() as u32;
        self.context.declare(at, id, span, Binding::Array(number))?;
        self.context.declared.elements += count as usize;
        let first = RegisterId::new(self.context.declared.registers.len());
        let mut indices: SmallVec<[u32; 2]> = SmallVec::from_elem(1, shape.len());
        for _ in 0..count {
            let texts: Vec<String> = indices.iter().map(u32::to_string).collect();
            let name = format!("{text}[{}]", texts.join(","));
            let register = RegisterId::new(self.context.declared.registers.len());
            self.context.declared.typed.extend(ty.map(|_| register));
            let ty = ty.unwrap_or(Type::F);
            self.context.declared.registers.push(VirtualRegister {
                name,
                kind,
                ty,
                pinned: None,
                preset: None,
                span,
            });
            for (index, size) in indices.iter_mut().zip(&shape).rev() {
                *index += 1;
                if *index <= *size {
                    break;
                }
                *index = 1;
            }
        }
        self.context.declared.arrays.push(Array { name: text, first, sizes: shape, span });
        Ok(())
    }

    /// Number of elements and sizes of an array. The array may have `most` elements, the rest of the limit `in_all` on all arrays.
    fn shape(
        &mut self,
        at: AstPlace,
        span: Span,
        sizes: &[Expr],
        most: usize,
        in_all: usize,
    ) -> Result<(u32, SmallVec<[u32; 2]>), ErrorReported> {
        if sizes.len() > limits::ARRAY_INDICES {
            let message = format!("an array has at most {} indices", limits::ARRAY_INDICES);
            return Err(self.context.error(at.scope, "limit", span, message));
        }
        let mut count = 1u32;
        let mut shape = SmallVec::new();
        for size in sizes {
            let value = self.context.integer(at, *size)?;
            if value < 1 {
                let message = format!("{value} elements: an array has 1 or more in each direction");
                return Err(self.context.error(at.scope, "range", size.span, message));
            }
            if value.saturating_mul(i64::from(count)) > most as i64 {
                let message = format!("arrays of more than {in_all} elements in all");
                return Err(self.context.error(at.scope, "limit", size.span, message));
            }
            // Within the limit, which 32 bits hold.
            count *= value as u32;
            shape.push(value as u32);
        }
        Ok((count, shape))
    }

    /// Declares an array in data memory. Its values may be listed or in a file; without any, they are zeros.
    pub(crate) fn declare_table(
        &mut self,
        at: AstPlace,
        declaration: &Declaration,
        sizes: &[Expr],
        values: Option<&ArrayValues>,
    ) -> Result<(), ErrorReported> {
        let Name { name, span } = declaration.name;
        let id = self.context.name(at, name, span)?;
        let text = self.context.scopes.full_name(at.scope, id);
        let file = match values {
            Some(ArrayValues::File(path, span)) => Some((self.numbers(at, path, *span)?, *span)),
            _ => None,
        };
        if sizes.is_empty() && file.is_none() {
            let error = Diagnostic::error("array", span, format!("`{text}` has no size"))
                .help(format!("write `{text}[n]`, or `{text}[n,m]`"));
            return Err(self.context.report(at.scope, error));
        }
        if let Some(place) = declaration.place {
            let error =
                Diagnostic::error("place", place.span, "an array in data memory has no place of its own")
                    .note("arrays and words of data follow one another in the order of the source");
            return Err(self.context.report(at.scope, error));
        }
        let most = limits::DATA_WORDS.saturating_sub(self.data_words);
        let (words, sizes) = match &file {
            // A file has at most as many numbers as there are words.
            Some((table, _)) if sizes.is_empty() => {
                let sizes = table.sizes().into_iter().map(|size| size as u32).collect();
                (table.values.len() as u32, sizes)
            }
            _ => self.shape(at, span, sizes, most, limits::DATA_WORDS)?,
        };
        let ty = match declaration.ty {
            Some(ty) => self.context.type_named(at, ty)?,
            None => Type::F,
        };
        let number = self.context.declared.tables.len() as u32;
        self.context.declare(at, id, span, Binding::Table(number))?;
        let label = LabelId(self.context.declared.labels.len() as u32);
        let base = self.data_words as u32;
        let (space, position) = (Space::Data, base);
        self.context.declared.labels.push(Label { name: text.clone(), space, position, span });
        self.context.declared.label_sections.push(Section::Data);
        let array = arrays::Array { name: text, base, words, sizes, ty, span };
        let table = Table { array, label, used: false };
        match (file, values) {
            (Some((numbers, span)), _) => self.values_of_file(at, &table, &numbers, span),
            (None, Some(ArrayValues::Listed(values))) if !values.is_empty() => {
                self.listed_values(at, &table, values);
            }
            _ => self.flat.data.push(Data::Space(at, span, words, ty)),
        }
        self.context.declared.tables.push(table);
        self.data_words += words as usize;
        self.check_data(at, span);
        Ok(())
    }

    /// Appends the values that an array's declaration lists.
    fn listed_values(&mut self, at: AstPlace, table: &Table, values: &[Expr]) {
        let arrays::Array { name, words, ty, span, .. } = table.array.clone();
        self.flat.data.extend(values.iter().take(words as usize).map(|value| Data::Value(at, *value, ty)));
        let given = values.len() as u32;
        if given != words {
            let message = format!("`{name}` has {words} elements, and these are {given} values");
            let last = values.last().map_or(span, |last| values[0].span.to(last.span));
            let error = Diagnostic::error("array", last, message)
                .also(span, format!("declared here as `{name}[{}]`", table.shape()))
                .help(
                    "give a value for each element, the last index counting fastest, or none: then all are 0",
                );
            self.context.report(at.scope, error);
            self.flat.data.push(Data::Space(at, span, words.saturating_sub(given), ty));
        }
    }

    /// Appends the values of an array from a file, whose path stands at `place`.
    fn values_of_file(&mut self, at: AstPlace, table: &Table, numbers: &Numbers, place: Span) {
        let arrays::Array { name, words, ty, span, sizes, .. } = table.array.clone();
        if numbers.fits(&sizes) {
            let values = numbers.values.iter().map(|value| Data::Value(numbers.at, *value, ty));
            self.flat.data.extend(values);
            return;
        }
        let message =
            format!("`{name}` is `{name}[{}]`, and the file has {}", table.shape(), shape_text(numbers));
        let error = Diagnostic::error("array", place, message)
            .also(span, "declared here")
            .help(format!("leave the size out, `{name}` alone: then it is the file's"));
        self.context.report(at.scope, error);
        self.flat.data.push(Data::Space(at, span, words, ty));
    }

    /// Resolves the operand of the `@` of a declaration: a register's canonical name, or a port's number.
    fn place(&mut self, at: AstPlace, register: RegisterId, place: Expr) -> Result<(), ErrorReported> {
        let name = match self.context.asts[at.ast as usize].nodes[place.id.range()] {
            [Node { kind: NodeKind::Name(name), span }] => Some(Name { name, span }),
            _ => None,
        };
        if let Some(name) = name {
            let id = self.context.spelled(at, name.name, name.span)?;
            let is_register = self.context.machine.register_address(self.context.scopes.text(id)).is_some();
            let binding = self.context.lookup(at.scope, id);
            // Any operand that is neither a register nor a number is taken for a misspelt register.
            let is_number =
                matches!(binding, Binding::Constant(_) | Binding::Count(_) | Binding::Argument(_));
            if is_register || !is_number {
                let address = address(&mut self.context, at, name)?;
                return self.pin(at, register, address, place.span);
            }
        }
        let number = self.context.integer(at, place)?;
        self.number(at, register, number, place.span)
    }

    /// Gives a port its number.
    fn number(
        &mut self,
        at: AstPlace,
        register: RegisterId,
        number: i64,
        span: Span,
    ) -> Result<(), ErrorReported> {
        let machine = self.context.machine;
        let (what, count) = match self.context.declared.registers[register.index()].kind {
            RegisterKind::Input | RegisterKind::Parameter => ("input", machine.input_count()),
            RegisterKind::Output => ("output", machine.outputs_per_bank),
            _ => {
                let error = Diagnostic::error(
                    "place",
                    span,
                    format!("`{number}` is not a place: only ports have numbers"),
                )
                .help(format!("a register's place is its name, as `@ {}3`", machine.slots[0].bank.name));
                return Err(self.context.report(at.scope, error));
            }
        };
        let Some(number) = u16::try_from(number).ok().filter(|number| *number < count) else {
            let message = format!("{} has no {what} {number}", machine.name);
            let error = Diagnostic::error("place", span, message)
                .note(format!("{what}s have the numbers 0 to {}", count - 1));
            return Err(self.context.report(at.scope, error));
        };
        if what == "input"
            && let Some(port) = machine.inputs.registers().nth(number.into())
        {
            return self.pin(at, register, port, span);
        }
        self.take_number(at, register, number, span)
    }

    /// Reserves the number of an output port.
    fn take_number(
        &mut self,
        at: AstPlace,
        register: RegisterId,
        number: u16,
        span: Span,
    ) -> Result<(), ErrorReported> {
        if let Some(other) = self.context.declared.numbered.get(&number) {
            let VirtualRegister { name, span: first, .. } = &self.context.declared.registers[other.index()];
            let error = Diagnostic::error("place", span, format!("output {number} is taken"))
                .also(*first, format!("by `{name}`"))
                .note("an output has one number, whichever slot writes it");
            return Err(self.context.report(at.scope, error));
        }
        self.context.declared.numbered.insert(number, register);
        Ok(())
    }

    /// The setting of a directive that switches `on` or `off`.
    pub(crate) fn is_on(
        &mut self,
        at: AstPlace,
        word: Name,
        directive: &'static str,
    ) -> Result<bool, ErrorReported> {
        let name = self.context.spelled(at, word.name, word.span)?;
        match self.context.scopes.text(name) {
            "on" => Ok(true),
            "off" => Ok(false),
            other => {
                let message = format!("`.{directive}` is `on` or `off`, not `{other}`");
                Err(self.context.error(at.scope, directive, word.span, message))
            }
        }
    }

    /// The transformations that a `.fast` allows from here on.
    pub(crate) fn allowed(&mut self, at: AstPlace, words: &[Name]) -> Result<Fast, ErrorReported> {
        let mut fast = Fast::default();
        for word in words {
            let name = self.context.name(at, word.name, word.span)?;
            match self.context.scopes.text(name) {
                "reassociate" => fast.reassociate = true,
                "reciprocal" => fast.reciprocal = true,
                "off" if words.len() == 1 => {}
                other => {
                    let message =
                        format!("`.fast` is `reassociate`, `reciprocal`, both, or `off`, not `{other}`");
                    return Err(self.context.error(at.scope, "fast", word.span, message));
                }
            }
        }
        Ok(fast)
    }

    fn columns(&mut self, at: AstPlace, first: Expr, last: Expr) -> Result<Columns, ErrorReported> {
        let span = first.span.to(last.span);
        let (first, last) = (self.context.integer(at, first)?, self.context.integer(at, last)?);
        match (u32::try_from(first), u32::try_from(last)) {
            (Ok(first), Ok(last)) if 0 < first && first <= last => Ok(Columns { first, last }),
            _ => {
                let message = format!("columns {first} to {last} do not exist: columns count from 1");
                Err(self.context.error(at.scope, "range", span, message))
            }
        }
    }

    pub(crate) fn set_loc(&mut self, at: AstPlace, places: &[Loc]) -> Result<(), ErrorReported> {
        let mut locations = Vec::with_capacity(places.len());
        for place in places {
            locations.push(match place {
                Loc::None(name) => {
                    let text = self.context.reports.sources.text(name.span);
                    if text != "none" {
                        let message =
                            format!("`{text}` is not a place: a file in `\"` and a line, or `none`");
                        return Err(self.context.error(at.scope, "syntax", name.span, message));
                    }
                    None
                }
                Loc::At(file, line, columns) => {
                    let number = self.context.integer(at, *line)?;
                    let Some(number) = u32::try_from(number).ok().filter(|number| *number > 0) else {
                        let message = format!("there is no line {number}: lines count from 1");
                        return Err(self.context.error(at.scope, "range", line.span, message));
                    };
                    let columns = match columns {
                        Some((first, last)) => Some(self.columns(at, *first, *last)?),
                        None => None,
                    };
                    let file = self.flat.file(file);
                    Some((Location { file, line: number }, columns))
                }
            });
        }
        self.flat.locs.push(locations);
        self.loc = self.flat.locs.len() as u32 - 1;
        Ok(())
    }

    /// `.machine`: the machine of the whole program, replacing the caller's.
    pub(crate) fn machine(
        &mut self,
        at: AstPlace,
        machine: &MachineName,
        options: &[(Name, Expr)],
        index: u32,
        span: Span,
    ) -> Result<(), ErrorReported> {
        if index > 0 || self.include_depth > 1 || at.scope != ScopeId::ROOT {
            let error = Diagnostic::error("machine", span, "`.machine` is the first line of a program")
                .help("move it before everything else in the source that is assembled");
            return Err(self.context.report(at.scope, error));
        }
        let row = match machine {
            MachineName::Row(name) => {
                let id = self.context.spelled(at, name.name, name.span)?;
                let text = self.context.scopes.text(id).to_owned();
                Machine::from_name(&text).map_err(|error| self.no_machine(at, name.span, error))?
            }
            MachineName::File(path, span) => self.machine_of_file(at, path, *span)?,
        };
        let mut given = Vec::new();
        for (option, value) in options {
            let id = self.context.spelled(at, option.name, option.span)?;
            let depth = self.context.integer(at, *value)?;
            given.push((self.context.scopes.text(id).to_owned(), depth.to_string()));
            let known = given.iter().map(|(option, value)| (option.as_str(), value.as_str()));
            self.context.machine = row.with_options(known).map_err(|error| {
                let span =
                    if matches!(error, MachineNameError::Option(_)) { option.span } else { value.span };
                self.no_machine(at, span, error)
            })?;
        }
        if options.is_empty() {
            self.context.machine = row;
        }
        Ok(())
    }

    /// The machine of a file, whose path is relative to the folder of the assembled source.
    fn machine_of_file(
        &mut self,
        at: AstPlace,
        path: &str,
        span: Span,
    ) -> Result<&'static Machine, ErrorReported> {
        let within = include_path("", path).filter(|path| machine_file(path) == Some((path.as_str(), "")));
        let Some(within) = within else {
            let message = format!("`{path}` is not a machine's file within the project");
            let error = Diagnostic::error("machine", span, message)
                .help("a path relative to this source's folder that ends in `.toml`");
            return Err(self.context.report(at.scope, error));
        };
        let loader = self.loader;
        let read = machine_from(&within, |path| loader.load(path).map_err(|error| error.to_string()));
        read.map_err(|mistake| self.context.report(at.scope, mistake.diagnose(span)))
    }

    fn no_machine(&mut self, at: AstPlace, span: Span, error: MachineNameError) -> ErrorReported {
        self.context.report(at.scope, MachineMistake::Name(error).diagnose(span))
    }

    /// `.ports`: whether ports are latched or direct.
    pub(crate) fn ports(&mut self, at: AstPlace, word: Name) -> Result<(), ErrorReported> {
        let name = self.context.spelled(at, word.name, word.span)?;
        let latched = match self.context.scopes.text(name) {
            "latched" => true,
            "direct" => false,
            other => {
                let message = format!("`.ports` is `latched` or `direct`, not `{other}`");
                return Err(self.context.error(at.scope, "ports", word.span, message));
            }
        };
        match self.flat.ports {
            Some((before, first)) if before != latched => {
                let error = Diagnostic::error("ports", word.span, "ports are latched or direct, all of them")
                    .also(first, "said otherwise here");
                Err(self.context.report(at.scope, error))
            }
            _ => {
                self.flat.ports.get_or_insert((latched, word.span));
                Ok(())
            }
        }
    }

    fn pin(
        &mut self,
        at: AstPlace,
        register: RegisterId,
        address: Register,
        span: Span,
    ) -> Result<(), ErrorReported> {
        let machine = self.context.machine;
        let place = machine.register_name(address).unwrap_or_default();
        let wrong = match self.context.declared.registers[register.index()].kind {
            _ if address == Register::ZERO => {
                Some("`zero` is never written: nothing can be placed there".to_owned())
            }
            RegisterKind::Input | RegisterKind::Parameter if !machine.is_input(address) => {
                Some(format!("`{place}` is not an input port"))
            }
            RegisterKind::Output if !machine.is_output(address) => {
                Some(format!("`{place}` is not an output port"))
            }
            RegisterKind::Plain | RegisterKind::State if machine.is_output(address) => {
                Some(format!("`{place}` is an output port"))
            }
            RegisterKind::Plain | RegisterKind::State if machine.is_input(address) => {
                Some(format!("`{place}` is an input port"))
            }
            _ => None,
        };
        if let Some(message) = wrong {
            let note = ports_text(machine);
            return Err(self.context.report(at.scope, Diagnostic::error("place", span, message).note(note)));
        }
        if let Some(other) = self.context.declared.by_address.get(&address).copied() {
            let VirtualRegister { name, span: first, .. } =
                self.context.declared.registers[other.index()].clone();
            let what = if name.is_empty() { "preset" } else { &name };
            let error = Diagnostic::error("place", span, format!("`{place}` is taken"))
                .also(first, format!("by `{what}`"));
            return Err(self.context.report(at.scope, error));
        }
        if let Some(number) = machine.output_number(address) {
            self.take_number(at, register, number, span)?;
        }
        self.context.declared.by_address.insert(address, register);
        self.context.declared.registers[register.index()].pinned = Some(address);
        Ok(())
    }
}

/// Kind of the registers that a directive declares.
fn kind_of(what: DeclarationKind) -> RegisterKind {
    match what {
        DeclarationKind::Register => RegisterKind::Plain,
        DeclarationKind::State => RegisterKind::State,
        DeclarationKind::Input => RegisterKind::Input,
        DeclarationKind::Output => RegisterKind::Output,
        DeclarationKind::Parameter => RegisterKind::Parameter,
    }
}

/// The address of a register by its canonical name.
pub(crate) fn address(context: &mut Context, at: AstPlace, place: Name) -> Result<Register, ErrorReported> {
    let id = context.spelled(at, place.name, place.span)?;
    let text = context.scopes.text(id).to_owned();
    let machine = context.machine;
    machine.register_address(&text).ok_or_else(|| {
        let banks: Vec<String> =
            machine.banks().map(|bank| format!("{0}0…{0}{1}", bank.name, bank.depth - 1)).collect();
        let error =
            Diagnostic::error("place", place.span, format!("{} has no register `{text}`", machine.name))
                .note(format!("registers: {}", banks.join(", ")));
        context.report(at.scope, error)
    })
}

/// The register at an address: the source's named register, or else a new nameless register.
pub(crate) fn register_at(context: &mut Context, address: Register, span: Span) -> RegisterId {
    if let Some(register) = context.declared.by_address.get(&address) {
        return *register;
    }
    let register = RegisterId::new(context.declared.registers.len());
    let (kind, ty) = (RegisterKind::Plain, Type::B);
    context.declared.registers.push(VirtualRegister {
        name: String::new(),
        kind,
        ty,
        pinned: Some(address),
        preset: None,
        span,
    });
    context.declared.by_address.insert(address, register);
    register
}

fn ports_text(machine: &Machine) -> String {
    let outputs: Vec<String> = machine
        .slots
        .iter()
        .map(|slot| {
            let (name, depth) = (slot.bank.name, slot.bank.depth);
            format!("{name}{}…{name}{}", depth - machine.outputs_per_bank, depth - 1)
        })
        .collect();
    let inputs = machine.inputs;
    let last = machine.input_count() - 1;
    format!("inputs: {0}0…{0}{last}; outputs: {1}", inputs.name, outputs.join(", "))
}
