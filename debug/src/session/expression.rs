//! Expressions over live values: the assembler's own language, and in it, as operands write them,
//!
//! | written | means |
//! |---|---|
//! | `x` | the port or register of that name, or the label's address, or the constant |
//! | `@m12` | the register at that place (`m12` too, if nothing else is named so) |
//! | `table[i]`, `4[i]`, `[i]` | the data word at that offset and index, as binary32 |
//! | `x:int`, `@m12:bits`, `[i]:float` | the same bits as a value of that type |
//! | `cycle period address depth` | cycles and periods that have passed; the next bundle; entries of the return stack |

use std::collections::BTreeSet;
use takt_asm::Expression;
use takt_asm::diag::{Diagnostics, nearest};
use takt_asm::expr::{BUILTINS, Value};
use takt_emu::Emulator;
use takt_isa::program::Space;
use takt_isa::{Program, Type};

/// Brackets within brackets; more is an error.
const NESTING: usize = 16;

/// A register or a data word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A register by address.
    Register(u16),
    /// A data word by address.
    Word(u32),
}

/// What an operand of an expression stands for.
#[derive(Clone, Debug)]
enum Operand {
    Register(u16, Type),
    Memory { offset: Box<Live>, index: Box<Live>, ty: Type },
    Constant(Value),
    Cycle,
    Period,
    Address,
    Depth,
}

/// What of the machine an expression reads.
#[derive(Default)]
pub(crate) struct Reads {
    pub(crate) registers: BTreeSet<u16>,
    pub(crate) memory: bool,
    /// What changes in every cycle.
    pub(crate) clock: bool,
    /// What can change in every cycle in which something happens.
    pub(crate) every: bool,
}

/// An expression with its names resolved.
#[derive(Clone, Debug)]
pub struct Live {
    text: String,
    expression: Expression,
    /// Each as the expression has it, what it stands for, and as it was written.
    operands: Vec<(String, Operand, String)>,
}

/// The machine as expressions see it.
pub(crate) struct Machine<'e> {
    pub(crate) emulator: &'e Emulator,
    pub(crate) periods: u64,
}

impl Machine<'_> {
    /// What a bundle that issued in the cycle to come would read.
    pub(crate) fn register(&self, register: u16) -> Option<u32> {
        let now = self.emulator.now();
        let due = self.emulator.underway().filter(|retire| retire.cycle == now);
        due.filter(|retire| retire.register == Some(register))
            .map(|retire| retire.value)
            .next()
            .or_else(|| self.emulator.register(register))
    }

    pub(crate) fn read(&self, place: Place, program: &Program) -> Result<u32, String> {
        match place {
            Place::Register(register) => self
                .register(register)
                .ok_or_else(|| format!("{} was never written", program.register_text(register))),
            Place::Word(word) => self.emulator.memory().get(word as usize).copied().ok_or_else(|| {
                format!("data word {word}: the memory has words 0 to {}", self.emulator.memory().len() - 1)
            }),
        }
    }
}

/// A value of a type from its bits.
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

impl Live {
    /// Parses an expression and resolves its names in a program.
    ///
    /// # Errors
    /// What is wrong, with the place pointed at if it is the language's.
    pub fn parse(text: &str, program: &Program, constants: &[(String, Value)]) -> Result<Live, String> {
        parse(text, program, constants, NESTING)
    }

    /// The text that it was parsed from.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Adds what it reads.
    pub(crate) fn reads(&self, reads: &mut Reads) {
        for (_, operand, _) in &self.operands {
            match operand {
                Operand::Register(register, _) => {
                    reads.registers.insert(*register);
                }
                Operand::Memory { offset, index, .. } => {
                    reads.memory = true;
                    offset.reads(reads);
                    index.reads(reads);
                }
                Operand::Cycle => reads.clock = true,
                Operand::Address | Operand::Depth => reads.every = true,
                // Periods end where every search looks.
                Operand::Constant(_) | Operand::Period => {}
            }
        }
    }

    /// The registers and data words that it reads, as written.
    pub(crate) fn places(&self) -> Vec<&str> {
        let is_place = |operand: &Operand| matches!(operand, Operand::Register(..) | Operand::Memory { .. });
        let mut places: Vec<&str> = Vec::new();
        for (_, operand, written) in &self.operands {
            if is_place(operand) && !places.contains(&written.as_str()) {
                places.push(written);
            }
        }
        places
    }

    /// The place that the expression is, if it is nothing else, and the type that it is read as.
    pub(crate) fn place(
        &self,
        machine: &Machine<'_>,
        program: &Program,
    ) -> Result<Option<(Place, Type)>, String> {
        let [(name, operand, _)] = &self.operands[..] else { return Ok(None) };
        // Placeholders are as long as what they stand for.
        let mut names = self.expression.names();
        if names.next() != Some(name) || self.text.len() != name.len() {
            return Ok(None);
        }
        Ok(match operand {
            Operand::Register(register, ty) => Some((Place::Register(*register), *ty)),
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
                Operand::Memory { offset, index, ty } => word(offset, index, machine, program)
                    .and_then(|word| machine.read(Place::Word(word), program))
                    .map(|bits| value(*ty, bits)),
                Operand::Constant(value) => Ok(*value),
                Operand::Cycle => Ok(Value::Int(machine.emulator.now() as i64)),
                Operand::Period => Ok(Value::Int(machine.periods as i64)),
                Operand::Address => Ok(Value::Int(machine.emulator.next_address().into())),
                Operand::Depth => Ok(Value::Int(machine.emulator.stack().len() as i64)),
            };
            // Any value will do: the fault is what is told.
            Some(read.unwrap_or_else(|error| {
                fault.get_or_insert(error);
                Value::Int(1)
            }))
        });
        match fault {
            Some(fault) => Err(fault),
            None => result.map_err(|diagnostics| told(&diagnostics)),
        }
    }
}

fn word(offset: &Live, index: &Live, machine: &Machine<'_>, program: &Program) -> Result<u32, String> {
    let integer = |live: &Live| {
        live.evaluate(machine, program)?.integer().map_err(|fault| format!("`{}`: {fault}", live.text))
    };
    let word = integer(offset)?.saturating_add(integer(index)?);
    u32::try_from(word).map_err(|_| format!("data word {word} does not exist"))
}

fn parse(text: &str, program: &Program, constants: &[(String, Value)], depth: usize) -> Result<Live, String> {
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
            let machine = program.machine;
            let register = machine.register_address(place).ok_or_else(|| {
                let banks: Vec<String> = machine.banks().map(|bank| format!("{}0 …", bank.name)).collect();
                format!("{} has no register {head} (registers: {})", machine.name, banks.join(" "))
            })?;
            operand = Some(Operand::Register(register, Type::F));
        } else if bytes.get(at) == Some(&b'[') {
            let end = closing(bytes, at).ok_or_else(|| format!("`{}`: a `]` is missing", &text[at..]))?;
            let part = |text: &str| parse(text, program, constants, depth - 1).map(Box::new);
            let offset = part(if head.is_empty() { "0" } else { head })?;
            let index = part(&text[at + 1..end])?;
            operand = Some(Operand::Memory { offset, index, ty: Type::F });
            at = end + 1;
        } else if head.is_empty() {
            plain.push(char::from(bytes[at]));
            at += 1;
            continue;
        }
        // A type behind it.
        let mut ty = None;
        if bytes.get(at) == Some(&b':') {
            let rest = &text[at + 1..];
            let length = rest.bytes().take_while(|byte| is_name(*byte)).count();
            let name = &rest[..length];
            ty = Some(type_of(name).ok_or_else(|| format!("`{name}` is no type (types: float int bits)"))?);
            at += 1 + length;
        }
        let is_name = head.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_');
        // Part of a name in braces, or a function: the language's own.
        let own = !is_name || matches!(bytes.get(at), Some(b'(' | b'{'));
        if operand.is_none() && own {
            plain.push_str(&text[start..at]);
            continue;
        }
        let mut operand = match operand {
            Some(operand) => operand,
            None => name(head, program, constants)?,
        };
        if let Some(wanted) = ty {
            match &mut operand {
                Operand::Register(_, ty) | Operand::Memory { ty, .. } => *ty = wanted,
                _ => return Err(format!("`{head}` is no register: it has no type")),
            }
        }
        // As long as what it stands for, so that messages point at the right place.
        let length = at - start;
        let placeholder = if head.len() == length && !head.starts_with('@') {
            head.to_owned()
        } else {
            format!("_{:0width$}", operands.len(), width = length - 1)
        };
        plain.push_str(&placeholder);
        operands.push((placeholder, operand, text[start..at].to_owned()));
    }
    let expression = Expression::parse(&plain).map_err(|diagnostics| told(&diagnostics))?;
    Ok(Live { text: text.to_owned(), expression, operands })
}

/// Diagnostics without their head, which says that they are errors: whoever shows them says so.
fn told(diagnostics: &Diagnostics) -> String {
    let text = diagnostics.render(false);
    text.split_once("]: ").map_or(text.as_str(), |(_, text)| text).trim_end().to_owned()
}

/// The bracket that closes the one at `open`.
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

fn name(name: &str, program: &Program, constants: &[(String, Value)]) -> Result<Operand, String> {
    let ports = || program.inputs.iter().chain(&program.outputs).chain(&program.registers);
    if let Some(port) = ports().find(|port| port.name == name) {
        return Ok(Operand::Register(port.register, port.ty));
    }
    if let Some(symbol) = program.symbols.iter().find(|symbol| symbol.name == name) {
        return Ok(Operand::Constant(Value::Int(symbol.address.into())));
    }
    if let Some((_, value)) = constants.iter().find(|constant| constant.0 == name) {
        return Ok(Operand::Constant(*value));
    }
    match name {
        "cycle" => return Ok(Operand::Cycle),
        "period" => return Ok(Operand::Period),
        "address" => return Ok(Operand::Address),
        "depth" => return Ok(Operand::Depth),
        _ => {}
    }
    if let Some(register) = program.machine.register_address(name) {
        return Ok(Operand::Register(register, Type::F));
    }
    if let Some((_, value)) = BUILTINS.iter().find(|builtin| builtin.0 == name) {
        return Ok(Operand::Constant(*value));
    }
    let symbols = program.symbols.iter().map(|symbol| symbol.name.as_str());
    let near = nearest(name, ports().map(|port| port.name.as_str()).chain(symbols));
    let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    Err(format!("nothing is named `{name}`{near}"))
}

/// Names that complete one that is being typed.
pub(crate) fn names<'p>(
    program: &'p Program,
    constants: &'p [(String, Value)],
) -> impl Iterator<Item = &'p str> {
    let ports = program.inputs.iter().chain(&program.outputs).chain(&program.registers);
    ports
        .map(|port| port.name.as_str())
        .chain(program.symbols.iter().map(|symbol| symbol.name.as_str()))
        .chain(constants.iter().map(|constant| constant.0.as_str()))
}

/// The label and the distance that a code place such as `loop+3` names.
pub(crate) fn code_address(text: &str, program: &Program) -> Option<u32> {
    let (label, distance) = match text.split_once('+') {
        Some((label, distance)) => (label.trim(), distance.trim().parse().ok()?),
        None => (text, 0),
    };
    let code = program.symbols.iter().filter(|symbol| symbol.space == Space::Code);
    let symbol = code.into_iter().find(|symbol| symbol.name == label)?;
    symbol.address.checked_add(distance)
}
