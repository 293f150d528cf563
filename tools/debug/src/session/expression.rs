// SPDX-License-Identifier: MIT OR Apache-2.0
//! Expressions over live values: the assembler's expression language, with these additional operands:
//!
//! | written | means |
//! |---|---|
//! | `x` | the value that the current source line would read: a port or register of that name, a label's address, or a constant |
//! | `P[2,3]` | the element of an array, in registers or in data memory; its indices count from 1 |
//! | `@m12` | the register at that place (`m12` too, if nothing else is named so) |
//! | `table[i]`, `4[i]`, `[i]` | the data word at that offset and index from 0, as binary32 |
//! | `x:int`, `@m12:bits`, `[i]:float` | the same bits as a value of that type |
//! | `cycle period address depth` | cycles and periods that have passed; the next bundle; entries of the return stack |

use super::machine::{Machine, Place};
use super::meaning::{LiveRange, Meaning, Name, NameMeaning, NameValue, held};
use std::collections::BTreeSet;
use takt_asm::Expression;
use takt_asm::diag::Diagnostics;
use takt_asm::expr::{BUILTINS, Value};
use takt_asm::names::{NamedArray, Names};
use takt_asm::nearest;
use takt_isa::program::Space;
use takt_isa::{BundleAddress, Program, Register, Type};

/// Maximum number of variants of a watched expression.
const VARIANTS: usize = 64;
/// Maximum nesting depth of brackets.
const NESTING: usize = 16;

/// Meaning of an operand.
#[derive(Clone, Debug)]
enum Operand {
    Register(Register, Type),
    /// A name whose meaning depends on the position, with the type in which it is read if one is given.
    Name(Box<Name>, Option<Type>),
    /// One specific value of a name that has several.
    Held(Box<NameValue>, Option<Type>),
    Memory {
        offset: Box<WatchExpression>,
        index: Box<WatchExpression>,
        ty: Type,
    },
    Constant(Value),
    Cycle,
    Period,
    Address,
    Depth,
}

/// State that an expression reads.
#[derive(Default)]
pub(crate) struct ReadSet {
    pub(crate) registers: BTreeSet<Register>,
    pub(crate) memory: bool,
    /// An operand changes in every cycle.
    pub(crate) clock: bool,
    /// An operand can change at every event.
    pub(crate) every: bool,
    /// Address ranges of the next bundle within which the operands' values are in their registers
    /// ([`NameValue::range`](super::meaning::NameValue::range)).
    pub(crate) ranges: Vec<(BundleAddress, BundleAddress)>,
}

/// An expression with its names resolved.
#[derive(Clone, Debug)]
pub struct WatchExpression {
    text: String,
    expression: Expression,
    /// Operands: placeholder in `expression`, meaning, and the user's text.
    operands: Vec<(String, Operand, String)>,
}

/// Interprets bits in a type.
pub(crate) fn value(ty: Type, bits: u32) -> Value {
    match ty {
        Type::F => Value::Real(f32::from_bits(bits).into()),
        Type::I => Value::Int(bits.cast_signed().into()),
        Type::B => Value::Int(bits.into()),
    }
}

fn type_of(name: &str) -> Option<Type> {
    match name {
        "float" => Some(Type::F),
        "int" => Some(Type::I),
        "bits" => Some(Type::B),
        _ => None,
    }
}

const fn is_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.')
}

impl WatchExpression {
    /// Parses an expression and resolves its names in a program.
    ///
    /// # Errors
    /// If the expression is malformed or a name is unknown; the message points at the mistake.
    pub fn parse(
        text: &str,
        program: &Program,
        constants: &[(String, Value)],
        names: &Names,
    ) -> Result<WatchExpression, String> {
        parse(text, LookupTables { program, constants, names }, NESTING)
    }

    /// Text of the expression, as the user wrote it.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Adds the registers, memory and times that the expression reads.
    pub(crate) fn reads(&self, reads: &mut ReadSet) {
        for (_, operand, _) in &self.operands {
            match operand {
                Operand::Register(register, _) => {
                    reads.registers.insert(*register);
                }
                Operand::Name(name, _) => {
                    reads.registers.extend(name.values().map(|value| value.register));
                    // The value depends on the current line.
                    reads.every = true;
                }
                Operand::Held(value, _) => {
                    reads.registers.insert(value.register);
                    reads.ranges.extend(value.range());
                }
                Operand::Memory { offset, index, .. } => {
                    reads.memory = true;
                    offset.reads(reads);
                    index.reads(reads);
                }
                Operand::Cycle => reads.clock = true,
                Operand::Address | Operand::Depth => reads.every = true,
                // Every search visits the ends of periods anyway.
                Operand::Constant(_) | Operand::Period => {}
            }
        }
    }

    /// Every value of the expression is in its register. A register shared by several values holds each of them only in a range of
    /// addresses.
    pub(crate) fn is_there(&self, machine: &Machine<'_>, program: &Program) -> bool {
        self.operands.iter().all(|(_, operand, _)| match operand {
            Operand::Name(name, _) => match name.at(machine) {
                Ok(NameMeaning::Value(value)) => value.is_there(machine, program).is_ok(),
                Ok(NameMeaning::Constant(_)) => true,
                Err(_) => false,
            },
            Operand::Held(value, _) => value.is_there(machine, program).is_ok(),
            Operand::Memory { offset, index, .. } => {
                offset.is_there(machine, program) && index.is_there(machine, program)
            }
            _ => true,
        })
    }

    /// Registers that an evaluation reads, each with the operand's text.
    fn registers(&self, machine: &Machine<'_>) -> Vec<(&str, Register)> {
        let mut read = Vec::new();
        for (_, operand, written) in &self.operands {
            let register = match operand {
                Operand::Register(register, _) => Some(*register),
                Operand::Held(value, _) => Some(value.register),
                Operand::Name(name, _) => match name.at(machine) {
                    Ok(NameMeaning::Value(value)) => Some(value.register),
                    Ok(NameMeaning::Constant(_)) | Err(_) => None,
                },
                Operand::Memory { offset, index, .. } => {
                    read.extend([offset, index].iter().flat_map(|part| part.registers(machine)));
                    None
                }
                _ => None,
            };
            read.extend(register.map(|register| (written.as_str(), register)));
        }
        read
    }

    /// Note on operands that are stale at the current line; `None` if all are current.
    pub(crate) fn note(&self, machine: &Machine<'_>, program: &Program) -> Option<String> {
        let is_alone = matches!(self.only(), Some(operand) if !matches!(operand, Operand::Memory { .. }));
        let mut notes: Vec<String> = Vec::new();
        for (name, register) in self.registers(machine) {
            let Some(stale) = machine.stale(register) else { continue };
            let text = stale.text(program);
            let note = if is_alone { text } else { format!("{name}: {text}") };
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        (!notes.is_empty()).then(|| notes.join("; "))
    }

    /// First operand that is unknown on a remote machine.
    pub(crate) fn hidden(&self) -> Option<&str> {
        self.operands.iter().find_map(|(_, operand, written)| match operand {
            Operand::Cycle | Operand::Depth => Some(written.as_str()),
            Operand::Memory { offset, index, .. } => offset.hidden().or_else(|| index.hidden()),
            _ => None,
        })
    }

    /// Registers and data words that the expression reads, in the user's notation.
    pub(crate) fn places(&self) -> Vec<&str> {
        let is_place = |operand: &Operand| {
            matches!(
                operand,
                Operand::Register(..) | Operand::Name(..) | Operand::Held(..) | Operand::Memory { .. }
            )
        };
        let mut places: Vec<&str> = Vec::new();
        for (_, operand, written) in &self.operands {
            if is_place(operand) && !places.contains(&written.as_str()) {
                places.push(written);
            }
        }
        places
    }

    /// All variants of the expression: one for each combination of values of names that have several.
    ///
    /// # Errors
    /// If their number exceeds [`VARIANTS`].
    pub(crate) fn variants(&self) -> Result<Vec<WatchExpression>, String> {
        let mut variants = vec![self.clone()];
        for (i, (_, operand, written)) in self.operands.iter().enumerate() {
            let values: Vec<Operand> = match operand {
                Operand::Name(name, ty) => {
                    name.values().map(|value| Operand::Held(Box::new(value.clone()), *ty)).collect()
                }
                Operand::Memory { offset, index, ty } => {
                    let (offsets, indices) = (offset.variants()?, index.variants()?);
                    let pairs =
                        offsets.iter().flat_map(|offset| indices.iter().map(move |index| (offset, index)));
                    let memory = |(offset, index): (&WatchExpression, &WatchExpression)| Operand::Memory {
                        offset: Box::new(offset.clone()),
                        index: Box::new(index.clone()),
                        ty: *ty,
                    };
                    pairs.take(VARIANTS + 1).map(memory).collect()
                }
                _ => continue,
            };
            if values.len() * variants.len() > VARIANTS {
                return Err(format!(
                    "`{written}` has {} values, more than the {VARIANTS} that one watchpoint watches: name one (`info {written}` lists them)",
                    values.len()
                ));
            }
            let with = |value: &Operand| {
                let value = value.clone();
                variants.iter().cloned().map(move |mut variant| {
                    variant.operands[i].1 = value.clone();
                    variant
                })
            };
            variants = values.iter().flat_map(with).collect();
        }
        Ok(variants)
    }

    /// All variants of the expression; the expression itself if their number exceeds the limit.
    pub(crate) fn each(&self) -> Vec<WatchExpression> {
        self.variants().unwrap_or_else(|_| vec![self.clone()])
    }

    /// Name of the value, if this variant consists of a single value of a name.
    pub(crate) fn held(&self) -> Option<&str> {
        match self.only()? {
            Operand::Held(value, _) => Some(&value.label),
            _ => None,
        }
    }

    /// The operand, if the expression consists of exactly one.
    fn only(&self) -> Option<&Operand> {
        let [(name, operand, _)] = &self.operands[..] else { return None };
        // A placeholder is as long as the text that it replaces.
        let mut names = self.expression.names();
        (names.next() == Some(name) && self.text.len() == name.len()).then_some(operand)
    }

    /// Registers that the expression may denote, if it is the name of registers.
    pub(crate) fn lives(&self, machine: &Machine<'_>, program: &Program) -> Vec<LiveRange> {
        let life = |value: &NameValue, at_hand| LiveRange {
            label: value.label.clone(),
            register: value.register,
            ty: value.ty,
            bundles: value.bundles,
            at_hand,
        };
        match self.only() {
            Some(Operand::Name(name, _)) => {
                let at_hand = match name.at(machine) {
                    Ok(NameMeaning::Value(value)) => Some(value),
                    _ => None,
                };
                name.values().map(|value| life(value, at_hand == Some(value))).collect()
            }
            Some(Operand::Held(value, _)) => vec![life(value, true)],
            Some(Operand::Register(register, ty)) => {
                let (label, register, ty) = (program.register_text(*register), *register, *ty);
                vec![LiveRange { label, register, ty, bundles: None, at_hand: true }]
            }
            _ => Vec::new(),
        }
    }

    /// Name of the current value, if the expression is a name with several values.
    pub(crate) fn label(&self, machine: &Machine<'_>) -> Option<String> {
        match self.only()? {
            Operand::Name(name, _) => match name.at(machine).ok()? {
                NameMeaning::Value(value) => Some(value.label.clone()),
                NameMeaning::Constant(_) => None,
            },
            _ => None,
        }
    }

    /// Register or data word that the expression denotes, and the type in which it is read.
    pub(crate) fn place(
        &self,
        machine: &Machine<'_>,
        program: &Program,
    ) -> Result<Option<(Place, Type)>, String> {
        let Some(operand) = self.only() else { return Ok(None) };
        Ok(match operand {
            Operand::Register(register, ty) => Some((Place::Register(*register), *ty)),
            Operand::Name(name, ty) => match name.at(machine)? {
                NameMeaning::Constant(_) => None,
                NameMeaning::Value(value) => {
                    value.is_there(machine, program)?;
                    Some((Place::Register(value.register), ty.unwrap_or(value.ty)))
                }
            },
            Operand::Held(value, ty) => {
                value.is_there(machine, program)?;
                Some((Place::Register(value.register), ty.unwrap_or(value.ty)))
            }
            Operand::Memory { offset, index, ty } => {
                Some((Place::Word(word(offset, index, machine, program)?), *ty))
            }
            _ => None,
        })
    }

    pub(crate) fn evaluate(&self, machine: &Machine<'_>, program: &Program) -> Result<Value, String> {
        let mut fault = None;
        let result = self.expression.evaluate(|name| {
            let (_, operand, _) = self.operands.iter().find(|operand| operand.0 == name)?;
            let read = match operand {
                Operand::Register(register, ty) => {
                    machine.read(Place::Register(*register), program).map(|bits| value(*ty, bits))
                }
                Operand::Name(name, ty) => name.at(machine).and_then(|at| match at {
                    NameMeaning::Constant(constant) => Ok(constant),
                    NameMeaning::Value(held) => read_held(held, *ty, machine, program),
                }),
                Operand::Held(held, ty) => read_held(held, *ty, machine, program),
                Operand::Memory { offset, index, ty } => word(offset, index, machine, program)
                    .and_then(|word| machine.read(Place::Word(word), program))
                    .map(|bits| value(*ty, bits)),
                Operand::Constant(value) => Ok(*value),
                Operand::Cycle => Ok(Value::Int(machine.emulator.now() as i64)),
                Operand::Period => Ok(Value::Int(machine.periods as i64)),
                Operand::Address => Ok(Value::Int(machine.emulator.next_address().get().into())),
                Operand::Depth => Ok(Value::Int(machine.emulator.stack().len() as i64)),
            };
            // After a fault the value is arbitrary: report only the fault.
            Some(read.unwrap_or_else(|error| {
                fault.get_or_insert(error);
                Value::Int(1)
            }))
        });
        match fault {
            Some(fault) => Err(fault),
            None => result.map_err(|diagnostics| rendered(&diagnostics)),
        }
    }
}

fn read_held(
    held: &NameValue,
    ty: Option<Type>,
    machine: &Machine<'_>,
    program: &Program,
) -> Result<Value, String> {
    held.is_there(machine, program)?;
    let bits = machine.read(Place::Register(held.register), program)?;
    Ok(value(ty.unwrap_or(held.ty), bits))
}

fn word(
    offset: &WatchExpression,
    index: &WatchExpression,
    machine: &Machine<'_>,
    program: &Program,
) -> Result<u32, String> {
    let integer = |live: &WatchExpression| {
        live.evaluate(machine, program)?.integer().map_err(|fault| format!("`{}`: {fault}", live.text))
    };
    let word = integer(offset)?.saturating_add(integer(index)?);
    u32::try_from(word).map_err(|_| format!("data word {word} does not exist"))
}

/// Tables for the lookup of names.
#[derive(Clone, Copy)]
struct LookupTables<'k> {
    program: &'k Program,
    constants: &'k [(String, Value)],
    names: &'k Names,
}

/// Register at a place of the machine, such as `@m12`.
fn machine_register(place: &str, known: LookupTables<'_>) -> Result<Register, String> {
    let machine = known.program.machine;
    machine.register_address(place).ok_or_else(|| {
        let banks: Vec<String> = machine.banks().map(|bank| format!("{}0 …", bank.name)).collect();
        format!("{} has no register @{place} (registers: {})", machine.name, banks.join(" "))
    })
}

/// Parses an array element or a data word at the start of a text; `head` precedes the bracket. Also returns the end of the match.
fn element(
    text: &str,
    head: &str,
    known: LookupTables<'_>,
    depth: usize,
) -> Result<(Operand, usize), String> {
    let open = head.len();
    let close =
        closing(text.as_bytes(), open).ok_or_else(|| format!("`{}`: a `]` is missing", &text[open..]))?;
    let element = text[..=close].replace(' ', "");
    if meanings(&element, known).is_some() {
        return Ok((name(&element, known)?, close + 1));
    }
    let part = |text: &str| parse(text, known, depth - 1).map(Box::new);
    if let Some(array) = known.names.arrays.iter().find(|array| array.name == head) {
        let (offset, index) = place(array, &text[open + 1..close])?;
        return Ok((
            Operand::Memory { offset: part(&offset)?, index: part(&index)?, ty: array.ty },
            close + 1,
        ));
    }
    let offset = part(if head.is_empty() { "0" } else { head })?;
    let index = part(&text[open + 1..close])?;
    Ok((Operand::Memory { offset, index, ty: Type::F }, close + 1))
}

/// Offset and index of an array element, as expressions over its subscripts.
fn place(array: &NamedArray, subscripts: &str) -> Result<(String, String), String> {
    let NamedArray { name, base, sizes, .. } = array;
    let mut parts = vec![String::new()];
    let mut nesting = 0;
    for c in subscripts.chars() {
        match c {
            '[' | '(' => nesting += 1,
            ']' | ')' => nesting -= 1,
            _ => {}
        }
        match parts.last_mut() {
            Some(part) if c != ',' || nesting > 0 => part.push(c),
            _ => parts.push(String::new()),
        }
    }
    if parts.len() != sizes.len() {
        return Err(format!("`{name}` has {} indices, not {}", sizes.len(), parts.len()));
    }
    let mut index = String::from("0");
    for (part, size) in parts.iter().zip(sizes) {
        if let Ok(number) = part.trim().parse::<i64>()
            && !(1..=i64::from(*size)).contains(&number)
        {
            return Err(format!("`{name}` has no element {number} here: it is 1 to {size}"));
        }
        index = format!("({index})*{size} + ({part}) - 1");
    }
    Ok((base.to_string(), index))
}

fn parse(text: &str, known: LookupTables<'_>, depth: usize) -> Result<WatchExpression, String> {
    if depth == 0 {
        return Err(format!("brackets nested more than {NESTING} deep"));
    }
    if !text.is_ascii() {
        return Err(format!("`{text}`: expressions are written in ASCII"));
    }
    let bytes = text.as_bytes();
    let (mut plain, mut operands, mut at) = (String::new(), Vec::new(), 0);
    while at < bytes.len() {
        let start = at;
        if bytes[at] == b'@' {
            at += 1;
        }
        while at < bytes.len() && is_name(bytes[at]) {
            at += 1;
        }
        let mut operand = None;
        let head = &text[start..at];
        if let Some(place) = head.strip_prefix('@') {
            operand = Some(Operand::Register(machine_register(place, known)?, Type::F));
        } else if bytes.get(at) == Some(&b'[') {
            let (found, end) = element(&text[start..], head, known, depth)?;
            operand = Some(found);
            at = start + end;
        } else if head.is_empty() {
            plain.push(char::from(bytes[at]));
            at += 1;
            continue;
        }
        let mut ty = None;
        if let Some(rest) = text[at..].strip_prefix(':') {
            let length = rest.bytes().take_while(|byte| is_name(*byte)).count();
            let name = &rest[..length];
            ty =
                Some(type_of(name).ok_or_else(|| format!("`{name}` is not a type (types: float int bits)"))?);
            at += 1 + length;
        }
        let is_name = head.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_');
        // Functions, and names with parts in braces, belong to the assembler's language.
        let own = !is_name || matches!(bytes.get(at), Some(b'(' | b'{'));
        if operand.is_none() && own {
            plain.push_str(&text[start..at]);
            continue;
        }
        let mut operand = match operand {
            Some(operand) => operand,
            None => name(head, known)?,
        };
        if let Some(wanted) = ty {
            match &mut operand {
                Operand::Register(_, ty) | Operand::Memory { ty, .. } => *ty = wanted,
                Operand::Name(_, ty) => *ty = Some(wanted),
                _ => return Err(format!("`{head}` is not a register: it has no type")),
            }
        }
        // The placeholder is as long as the text, which keeps the columns in messages correct.
        let length = at - start;
        let placeholder = if head.len() == length && !head.starts_with('@') {
            head.to_owned()
        } else {
            format!("_{:0width$}", operands.len(), width = length - 1)
        };
        plain.push_str(&placeholder);
        operands.push((placeholder, operand, text[start..at].to_owned()));
    }
    let expression = Expression::parse(&plain).map_err(|diagnostics| rendered(&diagnostics))?;
    Ok(WatchExpression { text: text.to_owned(), expression, operands })
}

/// Renders diagnostics without `error:`, which the caller prints.
fn rendered(diagnostics: &Diagnostics) -> String {
    let text = diagnostics.render(false);
    text.split_once("]: ").map_or(text.as_str(), |(_, text)| text).trim_end().to_owned()
}

/// Index of the bracket that closes the bracket at `open`.
fn closing(bytes: &[u8], open: usize) -> Option<usize> {
    let mut depth = 0;
    for (i, byte) in bytes.iter().enumerate().skip(open) {
        match byte {
            b'[' => depth += 1,
            b']' if depth == 1 => return Some(i),
            b']' => depth -= 1,
            _ => {}
        }
    }
    None
}

/// Counters of the session itself: cycle, period, address, depth.
fn counter(name: &str) -> Option<Operand> {
    Some(match name {
        "cycle" => Operand::Cycle,
        "period" => Operand::Period,
        "address" => Operand::Address,
        "depth" => Operand::Depth,
        _ => return None,
    })
}

fn name(name: &str, known: LookupTables<'_>) -> Result<Operand, String> {
    let LookupTables { program, names, .. } = known;
    if let Some(found) = meanings(name, known) {
        return Ok(match found.fixed() {
            Some(Meaning::Constant(value)) => Operand::Constant(*value),
            Some(Meaning::Values(values)) if values.len() == 1 => {
                Operand::Register(values[0].register, values[0].ty)
            }
            _ => Operand::Name(Box::new(found), None),
        });
    }
    if let Some(counter) = counter(name) {
        return Ok(counter);
    }
    if let Some(register) = program.machine.register_address(name) {
        return Ok(Operand::Register(register, Type::F));
    }
    if let Some((_, value)) = BUILTINS.iter().find(|builtin| builtin.0 == name) {
        return Ok(Operand::Constant(*value));
    }
    let ports = program.named_registers();
    let symbols = program.symbols.iter().map(|symbol| symbol.name.as_str());
    let values = names.values.iter().map(|value| value.name.as_str());
    let near = nearest(name, ports.map(|port| port.name.as_str()).chain(symbols).chain(values));
    let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    Err(format!("nothing is named `{name}`{near}"))
}

/// Meanings of a name in the source.
fn meanings(name: &str, known: LookupTables<'_>) -> Option<Name> {
    let LookupTables { program, constants, names } = known;
    let constant = |value| Some(Meaning::Constant(value));
    let global = held(name, names).map(Meaning::Values).or_else(|| {
        let mut ports = program.named_registers();
        Some(Meaning::Values(vec![NameValue::always(ports.find(|port| port.name == name)?)]))
    });
    // Many programs have a label `period`, but `until period == 3` means the counter.
    let symbol =
        || program.symbols.iter().find(|symbol| symbol.name == name).filter(|_| counter(name).is_none());
    let named = || constants.iter().find(|constant| constant.0 == name);
    let global =
        global.or_else(|| constant(Value::Int(symbol()?.address.into()))).or_else(|| constant(named()?.1));
    Name::find(name, global, program, names)
}

/// Completions of a partial name.
pub(crate) fn names<'p>(
    program: &'p Program,
    constants: &'p [(String, Value)],
    names: &'p Names,
) -> impl Iterator<Item = &'p str> {
    program
        .named_registers()
        .map(|port| port.name.as_str())
        .chain(program.symbols.iter().map(|symbol| symbol.name.as_str()))
        .chain(constants.iter().map(|constant| constant.0.as_str()))
        .chain(names.values.iter().flat_map(|value| [value.name.as_str(), value.label.as_str()]))
}

/// Address of a place in the code, such as `loop+3`.
pub(crate) fn code_address(text: &str, program: &Program) -> Option<u32> {
    let (label, distance) = match text.split_once('+') {
        Some((label, distance)) => (label.trim(), distance.trim().parse().ok()?),
        None => (text, 0),
    };
    let code = program.symbols.iter().filter(|symbol| symbol.space == Space::Code);
    let symbol = code.into_iter().find(|symbol| symbol.name == label)?;
    symbol.address.checked_add(distance)
}
