// SPDX-License-Identifier: MIT OR Apache-2.0
//! Validation of a program that is read from a file or written to one: invariants on which the loader, the debugger and the
//! disassembler rely.

use super::ImageError;
use crate::limits;
use std::collections::HashSet;
use takt_isa::encode::WORD_MASK;
use takt_isa::program::{LoopBound, Port, Space};
use takt_isa::{BundleAddress, Instruction, Machine, Program, Register, Type};

/// Maximum length of a source file's name, in bytes.
pub(super) const FILE_NAME: usize = 4096;

/// Checks that no word has more than 48 bits.
pub(super) fn words(code: &[u64]) -> Result<(), ImageError> {
    let wrong = code.iter().enumerate().find(|(_, word)| **word > WORD_MASK);
    wrong.map_or(Ok(()), |(index, &word)| Err(ImageError::WordBits { index, word }))
}

/// Register addresses and bits, from the words of their section.
pub(super) fn constants(words: &[u32], machine: &Machine) -> Result<Vec<(Register, u32)>, ImageError> {
    let mut constants: Vec<(Register, u32)> = Vec::with_capacity(words.len() / 2);
    for &[address, bits] in words.as_chunks::<2>().0 {
        let wrong = |reason| ImageError::Register { what: "a constant".to_owned(), address, reason };
        let register = register(machine, address).ok_or_else(|| wrong(NO_BANK))?;
        if register == Register::ZERO {
            return Err(wrong("nothing can be written there"));
        }
        if constants.last().is_some_and(|(last, _)| *last >= register) {
            return Err(wrong("constants are not in ascending order"));
        }
        constants.push((register, bits));
    }
    Ok(constants)
}

/// The reason why an address names no register.
pub(super) const NO_BANK: &str = "it is in no bank";

/// The register that a machine has at an address of an image.
pub(super) fn register(machine: &Machine, address: u32) -> Option<Register> {
    Register::new(address as usize).filter(|register| machine.has_register(*register))
}

/// The error for a named register whose address is not possible.
pub(super) fn wrong_port(kind: &str, name: &str, address: u16, reason: &'static str) -> ImageError {
    ImageError::Register { what: format!("{kind} `{name}`"), address: address.into(), reason }
}

/// A name is spelled like `P` or, for an array's element, `P[2,3]`, in at most `limit` letters. (Names from a macro's use may be
/// longer than a source's.)
pub(super) fn is_spelled(name: &str, limit: usize) -> bool {
    let first = |c: char| c.is_ascii_alphabetic() || c == '_';
    let other = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    let index = |index: &str| !index.is_empty() && index.bytes().all(|byte| byte.is_ascii_digit());
    let (head, indices) = match name.strip_suffix(']').and_then(|name| name.split_once('[')) {
        Some((head, indices)) => (head, Some(indices)),
        None => (name, None),
    };
    head.starts_with(first)
        && head.chars().all(other)
        && indices.is_none_or(|indices| indices.split(',').all(index))
        && name.len() <= limit
}

/// A source could declare the name.
pub(crate) fn is_name(name: &str) -> bool {
    is_spelled(name, limits::NAME_BYTES) && name != "zero"
}

pub(super) fn program(program: &Program) -> Result<(), ImageError> {
    let machine = program.machine;
    let slots = machine.slots.len();
    if !program.code.len().is_multiple_of(slots) {
        return Err(ImageError::WordCount { words: program.code.len(), slots, machine: machine.name });
    }
    let size = |what, found: usize, limit: u32| match found > limit as usize {
        true => Err(ImageError::MemorySize { what, found, limit, machine: machine.name }),
        false => Ok(()),
    };
    size("bundles", program.code.len() / slots, machine.most_bundles())?;
    size("words of data", program.data.len(), machine.data_depth)?;
    ports(program)?;
    names(program)?;
    labels(program)?;
    sections(program)?;
    loops(program)?;
    ranges(program)?;
    array_ranges(program)?;
    results(program)?;
    assumptions(program)?;
    lines(program)
}

fn loops(program: &Program) -> Result<(), ImageError> {
    let mut last = None;
    for &LoopBound { address, most, total } in &program.loop_bounds {
        let reason = match () {
            () if address.get() >= program.bundles() => "there is no such bundle",
            () if most == 0 || total == Some(0) => "a loop that is entered turns at least once",
            () if last.is_some_and(|last| last >= address) => "bounds are not in ascending order",
            () => "",
        };
        if !reason.is_empty() {
            return Err(ImageError::Loop { address, reason });
        }
        last = Some(address);
    }
    Ok(())
}

fn ranges(program: &Program) -> Result<(), ImageError> {
    let mut last = None;
    for range in &program.ranges {
        let register = range.register;
        let reason = match range.mistake() {
            _ if !program.machine.has_register(register) || register == Register::ZERO => {
                "there is no such register"
            }
            _ if last.is_some_and(|last| last >= register) => "ranges are not in ascending order",
            mistake => mistake.unwrap_or_default(),
        };
        if !reason.is_empty() {
            return Err(ImageError::Range { register: register.get(), reason });
        }
        last = Some(register);
    }
    Ok(())
}

/// Each range is one label's words, so that a disassembly can name them.
fn array_ranges(program: &Program) -> Result<(), ImageError> {
    let mut last = None;
    for range in &program.array_ranges {
        let first = range.first;
        let reason = match range.mistake() {
            _ if program.label_words(first) != Some(range.span()) => "it is not the words of a label",
            _ if last.is_some_and(|last| last >= first) => "ranges are not in ascending order",
            mistake => mistake.unwrap_or_default(),
        };
        if !reason.is_empty() {
            return Err(ImageError::ArrayRange { first, reason });
        }
        last = Some(first);
    }
    Ok(())
}

/// Each result is one label's words, as for ranges.
fn results(program: &Program) -> Result<(), ImageError> {
    let mut last = None;
    for result in &program.results {
        let first = result.first;
        let reason = match () {
            () if program.label_words(first) != Some(result.span()) => "it is not the words of a label",
            () if last.is_some_and(|last| last >= first) => "results are not in ascending order",
            () => "",
        };
        if !reason.is_empty() {
            return Err(ImageError::Result { first, reason });
        }
        last = Some(first);
    }
    Ok(())
}

fn assumptions(program: &Program) -> Result<(), ImageError> {
    let slots = program.machine.slots;
    let mut last = None;
    for assumption in &program.assumptions {
        let word = assumption.word;
        let code = program.code.get(word as usize).and_then(|code| Instruction::decode(*code).ok());
        let writes = code.is_some_and(|code| code.writes(&slots[word as usize % slots.len()]).is_some());
        let reason = match assumption.mistake() {
            _ if !writes => "no operation there writes a register",
            _ if last.is_some_and(|last| last >= word) => "assumptions are not in ascending order",
            mistake => mistake.unwrap_or_default(),
        };
        if !reason.is_empty() {
            return Err(ImageError::Assumption { word, reason });
        }
        last = Some(word);
    }
    Ok(())
}

fn ports(program: &Program) -> Result<(), ImageError> {
    let machine = program.machine;
    let mut seen = HashSet::new();
    let mut check = |what: &str, port: &Port, fits: bool| {
        let wrong = |reason| Err(wrong_port(what, &port.name, port.register.get(), reason));
        if !machine.has_register(port.register) || port.register == Register::ZERO {
            return wrong(NO_BANK);
        }
        if !fits {
            return wrong("it lies outside the registers of its kind");
        }
        if !seen.insert(port.register) {
            return wrong("two names share the register");
        }
        Ok(())
    };
    for port in &program.inputs {
        check("input", port, machine.is_input(port.register))?;
    }
    for port in &program.parameters {
        check("parameter", port, machine.is_input(port.register))?;
        let value = program.initial(port.register);
        if value.is_none_or(|bits| port.ty == Type::F && !f32::from_bits(bits).is_finite()) {
            let reason = "it has no finite value at the start";
            return Err(wrong_port("parameter", &port.name, port.register.get(), reason));
        }
    }
    let mut numbers = HashSet::new();
    for port in &program.outputs {
        let number = machine.output_number(port.register);
        check("output", port, number.is_some())?;
        if !numbers.insert(number) {
            let reason = "another output has the same number, in another bank: assemble its source again";
            return Err(wrong_port("output", &port.name, port.register.get(), reason));
        }
    }
    for port in &program.registers {
        let plain = !machine.is_input(port.register) && !machine.is_output(port.register);
        check("register", port, plain)?;
    }
    Ok(())
}

fn names(program: &Program) -> Result<(), ImageError> {
    let names = program
        .named_registers()
        .map(|port| &port.name)
        .chain(program.symbols.iter().map(|symbol| &symbol.name));
    let mut seen = HashSet::new();
    for name in names {
        if !is_name(name) {
            return Err(ImageError::Name(name.clone()));
        }
        if !seen.insert(name.as_str()) {
            return Err(ImageError::RepeatedName(name.clone()));
        }
    }
    let mut seen = HashSet::new();
    for file in &program.files {
        if file.is_empty() || file.len() > FILE_NAME {
            return Err(ImageError::Name(file.chars().take(80).collect()));
        }
        if !seen.insert(file.as_str()) {
            return Err(ImageError::RepeatedName(file.clone()));
        }
    }
    Ok(())
}

fn labels(program: &Program) -> Result<(), ImageError> {
    let mut last = None;
    for symbol in &program.symbols {
        let wrong = |reason| ImageError::Label { name: symbol.name.clone(), address: symbol.address, reason };
        let end = match symbol.space {
            Space::Code => program.bundles() as usize,
            Space::Data => program.data.len(),
        };
        if symbol.address as usize > end {
            return Err(wrong("it points past the end of its memory"));
        }
        let place = (symbol.space, symbol.address);
        if last.is_some_and(|last| last > place) {
            return Err(wrong("labels are not in ascending order"));
        }
        last = Some(place);
    }
    Ok(())
}

fn sections(program: &Program) -> Result<(), ImageError> {
    let bundles = program.bundles();
    let (wrong, end) = (ImageError::Sections { bundles }, BundleAddress::new(bundles));
    let mut at = BundleAddress::RESET;
    let mut allowed: &[&str] = &["once", "period"];
    for section in &program.sections {
        let Some(position) = allowed.iter().position(|name| *name == section.name) else { return Err(wrong) };
        allowed = &allowed[position + 1..];
        if section.start != at || section.end <= section.start || section.end > end {
            return Err(wrong);
        }
        at = section.end;
    }
    if at == end { Ok(()) } else { Err(wrong) }
}

fn lines(program: &Program) -> Result<(), ImageError> {
    let wrong = |message: String| Err(ImageError::Lines(message));
    if program.lines.len() != program.code.len() {
        return wrong(format!("{} for {} words", program.lines.len(), program.code.len()));
    }
    let origins = program.origins.iter().flat_map(|(at, from)| [at, from]);
    for location in program.lines.iter().flatten().chain(origins) {
        if location.file as usize >= program.files.len() {
            return wrong(format!(
                "a location is in file {}, and there are {}",
                location.file,
                program.files.len()
            ));
        }
        if location.line == 0 {
            return wrong("a location has line 0, and lines count from 1".to_owned());
        }
    }
    if !program.origins.is_sorted_by(|(one, _), (other, _)| one < other) {
        return wrong("lines from another language are out of order".to_owned());
    }
    let mut next = 0;
    for (word, columns) in &program.parts {
        if *word < next || program.lines.get(*word as usize).is_none_or(Option::is_none) {
            return wrong(format!("word {word} has columns out of order, or without a line"));
        }
        if columns.first == 0 || columns.first > columns.last {
            return wrong(format!("there are no columns {} to {}", columns.first, columns.last));
        }
        next = word + 1;
    }
    Ok(())
}
