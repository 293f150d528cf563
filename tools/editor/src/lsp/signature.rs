// SPDX-License-Identifier: MIT OR Apache-2.0
//! Signature help: the operands of the instruction, macro, directive or function that contains the cursor, and the one that is typed.

use crate::lsp::functions;
use crate::lsp::program::{File, Front};
use lsp_types::{Documentation, ParameterInformation, ParameterLabel, SignatureHelp, SignatureInformation};
use takt_asm::Directive;
use takt_asm::expr::Function;
use takt_asm::index::SymbolKind;
use takt_asm::tokens::{self, Token, TokenKind};
use takt_isa::{Op, manual};

/// An operation with its operands in order.
struct Signature {
    head: String,
    /// Text between the operation and the first operand, and after the last.
    around: (&'static str, &'static str),
    operands: Vec<String>,
    text: String,
}

/// Signature at a byte offset of a file.
pub(crate) fn signature(front: &Front, file: &File, byte: usize) -> Option<SignatureHelp> {
    let line = file.text.line(file.text.line_of(byte))?;
    let before = &file.text.text[line.start..byte.max(line.start)];
    let lines = tokens::lines(before);
    let tokens = lines.first()?;
    if tokens.last().is_some_and(|token| token.kind == TokenKind::Comment) {
        return None;
    }
    let word = |token: &Token| &before[token.range.clone()];
    // The operation of the bundle that contains the cursor, without its label.
    let begin = tokens.iter().rposition(|token| token.kind == TokenKind::Bars).map_or(0, |bars| bars + 1);
    let operation = match &tokens[begin..] {
        [name, colon, rest @ ..] if colon.kind == TokenKind::Colon && name.kind == TokenKind::Name => rest,
        operation => operation,
    };
    // Open parentheses: the token before each, and the number of commas since it.
    let mut open: Vec<(Option<&Token>, usize)> = vec![(None, 0)];
    for (index, token) in operation.iter().enumerate() {
        match word(token) {
            "(" | "[" => open.push((index.checked_sub(1).map(|before| &operation[before]), 0)),
            ")" | "]" if open.len() > 1 => {
                open.pop();
            }
            _ if token.kind == TokenKind::Comma => open.last_mut()?.1 += 1,
            _ => {}
        }
    }
    // The innermost call, otherwise the operation itself once a blank follows it.
    let is_constant = operation.first().is_some_and(|head| head.kind == TokenKind::Directive);
    let called = open
        .iter()
        .skip(1)
        .rev()
        .find_map(|(name, number)| Some((called(front, word((*name)?), is_constant)?, *number)));
    let (signature, number) = match called {
        Some(found) => found,
        None => {
            let head = operation.first().filter(|head| head.range.end < before.len())?;
            (operated(front, head.kind, word(head))?, open[0].1)
        }
    };
    Some(shown(&signature, number))
}

/// A function or macro of an equation, or of constants.
fn called(front: &Front, name: &str, is_constant: bool) -> Option<Signature> {
    if let Some(function) = functions::named(front.machine, name).filter(|_| !is_constant) {
        return Some(Signature {
            head: name.to_owned(),
            around: ("(", ")"),
            operands: function.arguments.iter().map(|&name| name.to_owned()).collect(),
            text: function.text.to_owned(),
        });
    }
    if let Some(function) = Function::ALL.iter().find(|function| function.name() == name) {
        let operands = match function.arguments() {
            0 => vec!["a".to_owned(), "…".to_owned()],
            count => ["a", "b", "c"][..count.min(3)].iter().map(|&name| name.to_owned()).collect(),
        };
        return Some(Signature {
            head: name.to_owned(),
            around: ("(", ")"),
            operands,
            text: function.text().to_owned(),
        });
    }
    macro_of(front, name, ("(", ")"))
}

/// An instruction, macro or directive at the beginning of an operation.
fn operated(front: &Front, kind: TokenKind, name: &str) -> Option<Signature> {
    if kind == TokenKind::Directive {
        let directive = Directive::ALL.iter().find(|directive| directive.name() == name)?;
        let operands = Some(directive.operands().to_owned()).filter(|text| !text.is_empty())?;
        let text = directive.text().to_owned();
        return Some(Signature { head: name.to_owned(), around: (" ", ""), operands: vec![operands], text });
    }
    let Some(op) = Op::from_mnemonic(name) else { return macro_of(front, name, (" ", "")) };
    let syntax = op.row().shape.syntax();
    let operands: Vec<String> = syntax.split(", ").filter(|one| !one.is_empty()).map(str::to_owned).collect();
    let entry = manual::manual().instructions.into_iter().find(|entry| entry.mnemonic == name)?;
    (!operands.is_empty()).then(|| Signature {
        head: name.to_owned(),
        around: (" ", ""),
        operands,
        text: entry.summary.to_owned(),
    })
}

fn macro_of(front: &Front, name: &str, around: (&'static str, &'static str)) -> Option<Signature> {
    let mut symbols = front.index.symbols.iter();
    let found = symbols.find(|symbol| symbol.kind == SymbolKind::Macro && symbol.name == name)?;
    let operands = found.parameters.clone();
    (!operands.is_empty()).then(|| Signature { head: name.to_owned(), around, operands, text: String::new() })
}

/// The protocol's form, with the operand that is typed.
fn shown(signature: &Signature, number: usize) -> SignatureHelp {
    let Signature { head, around, operands, text } = signature;
    let mut label = format!("{head}{}", around.0);
    let mut parameters = Vec::new();
    let units = |text: &str| text.encode_utf16().count() as u32;
    for (index, operand) in operands.iter().enumerate() {
        if index > 0 {
            label.push_str(", ");
        }
        let begin = units(&label);
        label.push_str(operand);
        let label = ParameterLabel::LabelOffsets([begin, units(&label)]);
        parameters.push(ParameterInformation { label, documentation: None });
    }
    label.push_str(around.1);
    // A function of any number of operands, and the text of a directive, take all that follow.
    let last = operands.last().map(String::as_str);
    let takes_all = operands.len() == 1 && head.starts_with('.') || last == Some("…");
    let active = if takes_all { number.min(operands.len() - 1) } else { number };
    SignatureHelp {
        signatures: vec![SignatureInformation {
            label,
            documentation: Some(Documentation::String(text.clone())).filter(|_| !text.is_empty()),
            parameters: Some(parameters),
            active_parameter: None,
        }],
        active_signature: Some(0),
        active_parameter: Some(active as u32),
    }
}
