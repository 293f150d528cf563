// SPDX-License-Identifier: MIT OR Apache-2.0
//! Hover texts in Markdown for the item under the cursor. Texts for instructions, directives and functions are taken from the tables.

use crate::lsp::functions::{self, EquationFunction};
use crate::lsp::program::{CountedProgram, File, Front};
use crate::lsp::{names, plural, timing};
use std::fmt::Write as _;
use takt_asm::Directive;
use takt_asm::expr::{BUILTINS, Function, Value};
use takt_asm::index::{Symbol, SymbolKind};
use takt_asm::source::Span;
use takt_asm::tokens::{self, TokenKind};
use takt_debug::session::{ValueNotations, ulp_distance};
use takt_isa::program::Space;
use takt_isa::{BundleAddress, Machine, Op, Register, Row, Type, manual};

/// Maximum number of symbols listed for one place in a macro or a repetition.
const TOLD: usize = 8;

/// Hover text at a byte offset of a file, with the range that it describes.
pub(crate) fn hover(
    front: &Front,
    counted: Option<&CountedProgram>,
    file: &File,
    byte: usize,
) -> Option<(std::ops::Range<usize>, String)> {
    if let Some((span, symbols)) = names::at(front, file, byte) {
        let mut text = String::new();
        for (number, symbol) in symbols.iter().map(|symbol| front.symbol(*symbol)).enumerate().take(TOLD) {
            if number > 0 {
                text.push_str("\n\n");
            }
            text.push_str(&symbol_text(front, counted, symbol));
        }
        if symbols.len() > TOLD {
            let _ = write!(text, "\n\n… and {}", plural((symbols.len() - TOLD) as u64, "more name"));
        }
        return Some((front.files.place(span)?.1, text));
    }
    let line = file.text.line(file.text.line_of(byte))?;
    let code = &file.text.text[line.clone()];
    let lines = tokens::lines(code);
    let at = byte - line.start;
    let tokens = lines.first()?;
    let index = tokens
        .iter()
        .position(|token| token.range.start <= at && at < token.range.end.max(token.range.start + 1))
        .or_else(|| tokens.iter().position(|token| token.range.end == at))?;
    let token = &tokens[index];
    let word = &code[token.range.clone()];
    let place = line.start + token.range.start..line.start + token.range.end;
    let text = match token.kind {
        TokenKind::Directive => directive(Directive::ALL.iter().find(|directive| directive.name() == word)?),
        TokenKind::Name => {
            let called = tokens.get(index + 1).is_some_and(|next| &code[next.range.clone()] == "(");
            let placed = index > 0 && &code[tokens[index - 1].range.clone()] == "@";
            let is_constant = tokens.iter().any(|token| token.kind == TokenKind::Directive);
            let function = functions::named(front.machine, word).filter(|_| called && !is_constant);
            if let Some(function) = function {
                return Some((place, function_text(&function, front.machine)));
            }
            match (Op::from_mnemonic(word), Function::ALL.iter().find(|function| function.name() == word)) {
                (_, Some(function)) if called => format!("`{}`: {}", function.name(), function.text()),
                (Some(op), _) if !placed => instruction(op.row(), front.machine),
                _ => match BUILTINS.iter().find(|builtin| builtin.0 == word) {
                    Some((name, value)) => format!("`{name}`, a constant\n\n{}", value_text(*value)),
                    None => place_text(front.machine, counted, word)?,
                },
            }
        }
        TokenKind::Number => {
            let value = takt_asm::Expression::parse(word).ok()?.evaluate(|_| None).ok()?;
            value_text(value)
        }
        _ => return None,
    };
    Some((place, text))
}

/// Text for a function of an equation, with the instruction that computes it.
fn function_text(function: &EquationFunction, machine: &'static Machine) -> String {
    let head = format!("`{}({})`", function.name, function.arguments.join(", "));
    match function.row {
        Some(row) => format!("{head}, in an equation\n\n{}", instruction(row, machine)),
        None => format!("{head}: {}", function.text),
    }
}

/// Text for an instruction, from the manual.
pub(crate) fn instruction(row: &Row, machine: &'static Machine) -> String {
    let manual = manual::manual();
    let Some(entry) = manual.instructions.iter().find(|entry| entry.mnemonic == row.mnemonic) else {
        return String::new();
    };
    let here = match manual::timings(row, machine.row()).into_iter().next() {
        Some(timing) => {
            let unit =
                if timing.unit.is_empty() { String::new() } else { format!(", unit `{}`", timing.unit) };
            format!(
                "On {}: slot `{}`{unit}, latency {}, interval {}",
                timing.machine, timing.slot, timing.latency, timing.interval
            )
        }
        None => format!("{} has no unit for it", machine.row_name()),
    };
    let head = format!("{} {}", entry.mnemonic, entry.syntax);
    let head = head.trim_end();
    let said = [head, entry.summary, entry.text];
    // Rest of the manual's entry, without the lines shown above.
    let more = manual::entry_text(entry);
    let more: Vec<&str> = more.lines().map(str::trim).filter(|line| !said.contains(line)).collect();
    format!(
        "```takt\n{head}\n```\n{}\n\n{}\n\n{here}\n\n```text\n{}\n```",
        entry.summary,
        entry.text,
        more.join("\n")
    )
}

/// Text for a directive, from the table.
pub(crate) fn directive(directive: &Directive) -> String {
    format!(
        "```takt\n{}\n```\n{}",
        format!("{} {}", directive.name(), directive.operands()).trim_end(),
        directive.text()
    )
}

/// Text for a register named by its place.
fn place_text(machine: &Machine, counted: Option<&CountedProgram>, word: &str) -> Option<String> {
    let address = machine.register_address(word)?;
    let mut text = format!("`{word}`, register {address} of {}", machine.name);
    if let Some(slot) = machine.slots.iter().find(|slot| slot.bank.contains(address)) {
        let _ = write!(text, ", written by slot `{}`", slot.name);
    }
    if let Some(counted) = counted {
        let name = counted.assembled.program.register_text(address);
        if name != word {
            let _ = write!(text, "\n\nholds `{name}`");
        }
    }
    Some(text)
}

fn symbol_text(front: &Front, counted: Option<&CountedProgram>, symbol: &Symbol) -> String {
    let Symbol { name, kind, .. } = symbol;
    let mut text = match symbol.ty {
        Some(ty) => format!("**{name}**: {}, `:{}`", kind.text(), ty.name()),
        None => format!("**{name}**: {}", kind.text()),
    };
    if let Some(of) = &symbol.of {
        let _ = write!(text, " of macro `{of}`");
    }
    match kind {
        SymbolKind::Macro => {
            let _ = write!(text, "\n```takt\n{name} {}\n```", symbol.parameters.join(", "));
        }
        SymbolKind::Constant => match symbol.value {
            Some(value) => {
                let _ = write!(text, "\n\n{}", value_text(value));
            }
            None => text.push_str("\n\nIts expression has a mistake."),
        },
        SymbolKind::Code => {
            if let Some(counted) = counted {
                let program = &counted.assembled.program;
                let at =
                    program.symbols.iter().find(|label| label.space == Space::Code && label.name == *name);
                if let Some(at) = at {
                    let _ = write!(text, "\n\nbundle {}", at.address);
                    if let Some(issue) = counted.issues.get(at.address as usize) {
                        let _ = write!(text, ", cycle {} from bundle {}", issue.cycle, issue.from);
                    }
                }
            }
        }
        SymbolKind::Data => {
            if let Some(word) = symbol.word {
                let _ = write!(text, "\n\nword {word} of data memory");
                if let Some(bits) =
                    counted.and_then(|counted| counted.assembled.program.data.get(word as usize))
                {
                    let _ = write!(text, "\n```text\n{}\n```", ValueNotations::every_way(Type::F, *bits));
                }
            }
        }
        SymbolKind::Register
        | SymbolKind::State
        | SymbolKind::Input
        | SymbolKind::Output
        | SymbolKind::Tunable => {
            register(front.machine, counted, symbol, &mut text);
        }
        SymbolKind::Table => {
            let sizes: Vec<String> = symbol.sizes.iter().map(u32::to_string).collect();
            let _ = write!(text, "\n\n`{name}[{}]`, indices from 1", sizes.join(","));
            if let Some(word) = symbol.word {
                let words: u32 = symbol.sizes.iter().product();
                let _ = write!(text, "\n\nwords {word} to {} of data memory", word + words.max(1) - 1);
            }
        }
        SymbolKind::Array => {
            let sizes: Vec<String> = symbol.sizes.iter().map(u32::to_string).collect();
            let _ = write!(text, "\n\n`{name}[{}]`, indices from 1", sizes.join(","));
            elements(counted, name, &mut text);
        }
        SymbolKind::Parameter | SymbolKind::Count => {}
    }
    let declared = declaration_line(front, symbol.span);
    if let Some(declared) = declared {
        let _ = write!(text, "\n\n{declared}");
    }
    text
}

/// Appends the places of an array's elements.
fn elements(counted: Option<&CountedProgram>, name: &str, text: &mut String) {
    let Some(program) = counted.map(|counted| &counted.assembled.program) else { return };
    let of = |port: &&takt_isa::program::Port| {
        port.name.strip_prefix(name).is_some_and(|rest| rest.starts_with('['))
    };
    for port in program.registers.iter().filter(of).take(TOLD) {
        let place = program.machine.register_name(port.register).unwrap_or_default();
        let _ = write!(text, "\n- `{}` in `{place}`", port.name);
    }
}

/// Appends the place of a register, and the ranges of the values that it holds.
fn register(machine: &Machine, counted: Option<&CountedProgram>, symbol: &Symbol, text: &mut String) {
    let place = |address: Register| {
        let name = machine.register_name(address).unwrap_or_default();
        let bank = machine.slots.iter().find(|slot| slot.bank.contains(address));
        let writer =
            bank.map_or(String::new(), |slot| format!(", bank `{}` of slot `{}`", slot.bank.name, slot.name));
        let number = machine.input_number(address).or_else(|| machine.output_number(address));
        let number = number.map_or(String::new(), |number| format!(", number {number}"));
        format!("`{name}` (address {address}{writer}{number})")
    };
    let Some(counted) = counted else {
        if let Some(address) = symbol.place {
            let _ = write!(text, "\n\nplace {}", place(address));
        }
        return;
    };
    let assembled = &counted.assembled;
    let program = &assembled.program;
    let values: Vec<_> = assembled.names.values.iter().filter(|value| value.name == symbol.name).collect();
    if values.is_empty() {
        match program.named_registers().find(|port| port.name == symbol.name) {
            Some(port) => {
                let _ = write!(text, "\n\nplace {}{}", place(port.register), uses(program, port.register));
            }
            None => text.push_str("\n\nNothing uses it: it has no place."),
        }
        return;
    }
    let _ = write!(text, "\n\n{}, one for each value:\n", plural(values.len() as u64, "register"));
    for value in values.iter().take(TOLD) {
        let _ = write!(text, "\n- `{}` in {}", value.label, place(value.register));
        match value.bundles {
            Some((first, last)) => {
                let _ = write!(text, ", alive in bundles {first} to {last}");
            }
            None => text.push_str(&uses(program, value.register)),
        }
    }
    if values.len() > TOLD {
        let _ = write!(text, "\n- … and {} more", values.len() - TOLD);
    }
}

/// Lists the bundles that write and read a register.
fn uses(program: &takt_isa::Program, register: Register) -> String {
    let (mut written, mut read) = (Vec::new(), Vec::new());
    for address in program.addresses() {
        let Some(Ok(instructions)) = program.bundle(address) else { continue };
        for (instruction, slot) in instructions.iter().zip(program.machine.slots) {
            if instruction.writes(slot) == Some(register) {
                written.push(address);
            }
            if instruction.reads().contains(&register) {
                read.push(address);
            }
        }
    }
    let list = |what: &str, bundles: &[BundleAddress]| match bundles {
        [] => String::new(),
        [one] => format!(", {what} in bundle {one}"),
        [first, .., last] => format!(", {what} in {} bundles, {first} to {last}", bundles.len()),
    };
    list("written", &written) + &list("read", &read)
}

/// Text for a constant: value, bits, and rounding error.
fn value_text(value: Value) -> String {
    match value {
        Value::Int(value) => {
            let hex = u32::try_from(value).or_else(|_| i32::try_from(value).map(i32::cast_unsigned));
            match hex {
                Ok(bits) => format!(
                    "```text\n{value} = 0x{bits:08x} as an integer\n{} as binary32{}\n```",
                    value as f32,
                    rounding(value as f64)
                ),
                Err(_) => format!(
                    "```text\n{value}, beyond 32 bits\n{} as binary32{}\n```",
                    value as f32,
                    rounding(value as f64)
                ),
            }
        }
        Value::Real(value) => {
            let rounded = ValueNotations::every_way(Type::F, (value as f32).to_bits());
            format!("```text\n{value:?}\n{rounded}{}\n```", rounding(value))
        }
    }
}

/// Rounding error of the nearest binary32.
fn rounding(value: f64) -> String {
    let rounded = f64::from(value as f32);
    if !value.is_finite() || rounded.is_infinite() {
        return if value.is_finite() { "; beyond binary32".to_owned() } else { String::new() };
    }
    match rounded - value {
        0.0 => "; exact".to_owned(),
        error => format!("; rounded by {error:.3e}, {:.3} ulp", ulp_distance(rounded, value).error),
    }
}

/// Source line of a declaration, if it is short enough.
fn declaration_line(front: &Front, span: Span) -> Option<String> {
    let (file, bytes) = front.files.place(span)?;
    let file = &front.files.0[file];
    let line = file.text.line_of(bytes.start);
    let text = file.text.text[file.text.line(line)?].trim();
    (text.len() <= 160 && !text.is_empty())
        .then(|| format!("{}:{}\n```takt\n{text}\n```", file.name, line + 1))
}

/// Full timing hint of a line.
pub(crate) fn of_line(counted: &CountedProgram, file: &str, line: u32) -> Option<String> {
    timing::hints(counted, file).into_iter().find(|hint| hint.line == line).map(|hint| hint.more)
}
