// SPDX-License-Identifier: MIT OR Apache-2.0
//! Structure of a file: document symbols, folds, selections, semantic tokens.

use crate::lsp::program::{File, Front};
use crate::lsp::text::{Encoding, width};
use lsp_types::{
    DocumentSymbol, FoldingRange, FoldingRangeKind, Range, SelectionRange, SemanticToken,
    SemanticTokenModifier, SemanticTokenType, SymbolKind as ValueNotations,
};
use std::collections::BTreeMap;
use takt_asm::Directive;
use takt_asm::index::SymbolKind;
use takt_asm::tokens::{self, Token, TokenKind};
use takt_isa::Op;

/// Directives that open a section.
const SECTIONS: [Directive; 3] = [Directive::Once, Directive::Period, Directive::Data];

/// Sections of a file: name, byte range of the directive, and the line where the next section starts, or the last line.
fn sections(file: &File, lines: &[Vec<Token>]) -> Vec<(&'static str, std::ops::Range<usize>, usize)> {
    let text = &file.text.text;
    let named =
        |token: &Token| SECTIONS.into_iter().find(|section| section.name() == &text[token.range.clone()]);
    let opens = |(line, tokens): (usize, &Vec<Token>)| {
        let (name, token) =
            tokens.iter().find_map(|token| Some((named(token)?.name(), token.range.clone())))?;
        Some((name, token, line))
    };
    let found: Vec<_> = lines.iter().enumerate().filter_map(opens).collect();
    let last = lines.len().saturating_sub(1);
    let ends: Vec<usize> = found.iter().skip(1).map(|next| next.2.saturating_sub(1)).chain([last]).collect();
    found.into_iter().zip(ends).map(|((name, range, _), end)| (name, range, end)).collect()
}

/// Line, from 0, of a label, or of the directive that opens a section with that name.
pub(crate) fn head_line(file: &File, name: &str) -> Option<u32> {
    let text = &file.text.text;
    let lines = tokens::lines(text);
    let word =
        |tokens: &[Token], index: usize| tokens.get(index).map_or("", |token| &text[token.range.clone()]);
    let label = lines.iter().position(|tokens| word(tokens, 0) == name && word(tokens, 1) == ":");
    let section = || sections(file, &lines).into_iter().find(|(section, ..)| section[1..] == *name);
    let line = label.or_else(|| Some(file.text.line_of(section()?.1.start)));
    line.map(|line| line as u32)
}

/// Kind of a symbol in the protocol; `None` for names within a macro or a repetition.
pub(crate) fn protocol_kind(kind: SymbolKind) -> Option<ValueNotations> {
    Some(match kind {
        SymbolKind::Register | SymbolKind::State => ValueNotations::VARIABLE,
        SymbolKind::Input | SymbolKind::Output | SymbolKind::Tunable => ValueNotations::PROPERTY,
        SymbolKind::Constant => ValueNotations::CONSTANT,
        SymbolKind::Code => ValueNotations::METHOD,
        SymbolKind::Data | SymbolKind::Array | SymbolKind::Table => ValueNotations::ARRAY,
        SymbolKind::Macro => ValueNotations::FUNCTION,
        SymbolKind::Parameter | SymbolKind::Count => return None,
    })
}

/// Symbols that a file declares, and its sections.
#[allow(deprecated, reason = "the protocol's type has the field")]
pub(crate) fn symbols(front: &Front, file: &File, encoding: Encoding) -> Vec<DocumentSymbol> {
    let lines = tokens::lines(&file.text.text);
    let symbol = |name: String, detail: String, kind, range: Range, selection| DocumentSymbol {
        name,
        detail: Some(detail).filter(|detail| !detail.is_empty()),
        kind,
        tags: None,
        deprecated: None,
        range,
        selection_range: selection,
        children: None,
    };
    let line_end = |line: usize| file.text.line(line).map_or(file.text.text.len(), |line| line.end);
    let mut out = Vec::new();
    for (name, range, end) in sections(file, &lines) {
        let selection = file.text.range(range.clone(), encoding);
        let whole = file.text.range(range.start..line_end(end), encoding);
        out.push(symbol(name.to_owned(), String::new(), ValueNotations::NAMESPACE, whole, selection));
    }
    // A declaration appears once, whatever the number of expansions.
    let mut declared = BTreeMap::new();
    for symbol in &front.index.symbols {
        let Some((number, bytes)) = front.files.place(symbol.span) else { continue };
        if std::ptr::eq(&front.files.0[number], file) {
            declared.entry((bytes.start, bytes.end)).or_insert(symbol);
        }
    }
    // Enclosing macro: its last line, and its index in the list.
    let mut within: Option<(usize, usize)> = None;
    for ((start, end), what) in declared {
        let Some(kind) = protocol_kind(what.kind) else { continue };
        let line = file.text.line_of(start);
        let selection = file.text.range(start..end, encoding);
        let block = front.index.blocks.iter().find(|block| {
            block.directive == Directive::Macro
                && (block.open.start..block.open.end).contains(&(file.base + start as u32))
        });
        let block = block.filter(|_| what.kind == SymbolKind::Macro);
        let last = block.map_or(line, |block| block.last_line as usize - 1);
        let first = block.map_or(start, |block| (block.open.start - file.base) as usize);
        let range = file.text.range(first..line_end(last).max(end), encoding);
        let written = file.text.text[start..end].to_owned();
        let shown = symbol(written, what.kind.text().to_owned(), kind, range, selection);
        match within.filter(|(last, _)| line <= *last) {
            Some((_, index)) if what.kind != SymbolKind::Macro => {
                let macro_: &mut DocumentSymbol = &mut out[index];
                macro_.children.get_or_insert_default().push(shown);
            }
            _ => {
                out.push(shown);
                within = (what.kind == SymbolKind::Macro).then_some((last, out.len() - 1));
            }
        }
    }
    out
}

/// Foldable lines: blocks, sections, and comments of several lines.
pub(crate) fn folds(front: &Front, file: &File) -> Vec<FoldingRange> {
    let lines = tokens::lines(&file.text.text);
    let fold = |start: usize, end: usize, kind| FoldingRange {
        start_line: start as u32,
        end_line: end as u32,
        kind,
        ..FoldingRange::default()
    };
    let mut out = Vec::new();
    for block in &front.index.blocks {
        let Some((number, bytes)) = front.files.place(block.open) else { continue };
        let (start, end) = (file.text.line_of(bytes.start), (block.last_line as usize).saturating_sub(1));
        if std::ptr::eq(&front.files.0[number], file) && end > start {
            out.push(fold(start, end, Some(FoldingRangeKind::Region)));
        }
    }
    for (_, range, end) in sections(file, &lines) {
        let start = file.text.line_of(range.start);
        if end > start {
            out.push(fold(start, end, Some(FoldingRangeKind::Region)));
        }
    }
    let is_comment =
        |tokens: &Vec<Token>| matches!(tokens.as_slice(), [only] if only.kind == TokenKind::Comment);
    let mut line = 0;
    for group in lines.chunk_by(|a, b| is_comment(a) == is_comment(b)) {
        if group.len() > 1 && is_comment(&group[0]) {
            out.push(fold(line, line + group.len() - 1, Some(FoldingRangeKind::Comment)));
        }
        line += group.len();
    }
    out.sort_by_key(|fold| (fold.start_line, fold.end_line));
    out
}

/// Selections at a byte, each within the next: word, brackets, operand, operation, line, blocks, section, file.
pub(crate) fn selection(front: &Front, file: &File, byte: usize, encoding: Encoding) -> SelectionRange {
    let text = &file.text.text;
    let lines = tokens::lines(text);
    let number = file.text.line_of(byte);
    let mut ranges: Vec<std::ops::Range<usize>> = Vec::new();
    if let (Some(tokens), Some(line)) = (lines.get(number), file.text.line(number)) {
        let holds = |range: &std::ops::Range<usize>| range.start <= byte && byte <= range.end;
        ranges.extend(tokens.iter().map(|token| token.range.clone()).find(|range| holds(range)));
        ranges.extend(brackets(text, tokens, byte));
        let code: Vec<&Token> = tokens.iter().filter(|token| token.kind != TokenKind::Comment).collect();
        for separators in
            [&[TokenKind::Comma, TokenKind::Bars, TokenKind::Colon][..], &[TokenKind::Bars], &[]]
        {
            let mut groups = code.split(|token| separators.contains(&token.kind));
            ranges.extend(groups.find_map(|group| {
                let range = group.first()?.range.start..group.last()?.range.end;
                holds(&range).then_some(range)
            }));
        }
        ranges.push(line);
    }
    let from_to = |first: usize, last: usize| {
        Some(file.text.line(first)?.start..file.text.line(last).map_or(text.len(), |line| line.end))
    };
    for block in &front.index.blocks {
        let Some((of, bytes)) = front.files.place(block.open) else { continue };
        let first = file.text.line_of(bytes.start);
        if std::ptr::eq(&front.files.0[of], file) && (first..block.last_line as usize).contains(&number) {
            ranges.extend(from_to(first, block.last_line as usize - 1));
        }
    }
    for (_, range, end) in sections(file, &lines) {
        let first = file.text.line_of(range.start);
        if (first..=end).contains(&number) {
            ranges.extend(from_to(first, end));
        }
    }
    ranges.push(0..text.len());
    ranges.sort_by_key(ExactSizeIterator::len);
    // From the outermost inwards, each within the one before.
    let mut found: Option<SelectionRange> = None;
    let mut outer = 0..usize::MAX;
    for range in ranges.into_iter().rev() {
        if range != outer && outer.start <= range.start && range.end <= outer.end {
            let parent = found.take().map(Box::new);
            found = Some(SelectionRange { range: file.text.range(range.clone(), encoding), parent });
            outer = range;
        }
    }
    found.expect("the file itself is a selection")
}

/// Pairs of brackets of a line around a byte, with what stands between them and with the brackets.
fn brackets(text: &str, tokens: &[Token], byte: usize) -> Vec<std::ops::Range<usize>> {
    let (mut open, mut found) = (Vec::new(), Vec::new());
    for token in tokens {
        match &text[token.range.clone()] {
            "(" | "[" => open.push(token.range.clone()),
            ")" | "]" => {
                let Some(begin) = open.pop() else { continue };
                if begin.end <= byte && byte <= token.range.start {
                    found.extend([begin.end..token.range.start, begin.start..token.range.end]);
                }
            }
            _ => {}
        }
    }
    found
}

/// Types and modifiers of semantic tokens, in the order announced to the client.
pub(crate) fn legend() -> (Vec<SemanticTokenType>, Vec<SemanticTokenModifier>) {
    let types = [
        SemanticTokenType::KEYWORD,
        SemanticTokenType::FUNCTION,
        SemanticTokenType::MACRO,
        SemanticTokenType::VARIABLE,
        SemanticTokenType::PROPERTY,
        SemanticTokenType::ENUM_MEMBER,
        SemanticTokenType::new("label"),
        SemanticTokenType::PARAMETER,
        SemanticTokenType::NUMBER,
        SemanticTokenType::STRING,
        SemanticTokenType::COMMENT,
        SemanticTokenType::OPERATOR,
    ];
    (types.to_vec(), vec![SemanticTokenModifier::DECLARATION, SemanticTokenModifier::READONLY])
}

const DECLARATION: u32 = 1;
const READONLY: u32 = 2;

/// Token type and modifiers for a kind of symbol.
fn colour(kind: SymbolKind) -> (u32, u32) {
    match kind {
        SymbolKind::Macro => (2, 0),
        SymbolKind::Register | SymbolKind::State | SymbolKind::Array | SymbolKind::Table => (3, 0),
        SymbolKind::Output => (4, 0),
        SymbolKind::Input | SymbolKind::Tunable => (4, READONLY),
        SymbolKind::Constant => (5, READONLY),
        SymbolKind::Count => (7, READONLY),
        SymbolKind::Code | SymbolKind::Data => (6, 0),
        SymbolKind::Parameter => (7, 0),
    }
}

/// Semantic tokens of a range of lines, in the protocol's relative encoding.
pub(crate) fn colours(
    front: &Front,
    file: &File,
    of: std::ops::Range<usize>,
    encoding: Encoding,
) -> Vec<SemanticToken> {
    let text = &file.text.text;
    let start = file.text.line(of.start).map_or(text.len(), |line| line.start);
    let end = of.end.checked_sub(1).and_then(|last| file.text.line(last)).map_or(text.len(), |line| line.end);
    let part = &text[start.min(end)..end];
    let mut out = Vec::new();
    let (mut last_line, mut last_column) = (0, 0);
    for (line, tokens) in (of.start..).zip(tokens::lines(part)) {
        let Some(bytes) = file.text.line(line) else { break };
        // Stack of open names with braces, with their types.
        let mut open: Vec<Option<(u32, u32)>> = Vec::new();
        for (index, token) in tokens.iter().enumerate() {
            let place = token.range.start + start..token.range.end + start;
            let word = &text[place.clone()];
            let meaning = || {
                let span = file.span(place.clone());
                let found = front.index.at(span.start);
                let reference = found.first().filter(|reference| reference.span.start == span.start)?;
                let symbol = front.symbol(reference.symbol);
                let (ty, modifiers) = colour(symbol.kind);
                Some((ty, modifiers | if symbol.span == reference.span { DECLARATION } else { 0 }))
            };
            let begins = index == 0 || matches!(tokens[index - 1].kind, TokenKind::Bars | TokenKind::Colon);
            let called = || {
                tokens.get(index + 1).is_some_and(|next| text[next.range.start + start..].starts_with('('))
            };
            let shown = match token.kind {
                TokenKind::Directive => Some((0, 0)),
                TokenKind::Name => match meaning() {
                    Some(meaning) => Some(meaning),
                    None if begins && Op::from_mnemonic(word).is_some() || called() => Some((1, 0)),
                    None => None,
                },
                TokenKind::TemplateBegin => {
                    let meaning = meaning();
                    open.push(meaning);
                    meaning
                }
                TokenKind::TemplateMiddle => open.last().copied().flatten(),
                TokenKind::TemplateEnd => open.pop().flatten(),
                TokenKind::Number => Some((8, 0)),
                TokenKind::Text => Some((9, 0)),
                TokenKind::Comment => Some((10, 0)),
                TokenKind::Operator | TokenKind::Bars => Some((11, 0)),
                _ => None,
            };
            let Some((token_type, token_modifiers_bitset)) = shown else { continue };
            let column = width(&text[bytes.start.min(place.start)..place.start], encoding);
            let delta_line = line as u32 - last_line;
            out.push(SemanticToken {
                delta_line,
                delta_start: if delta_line == 0 { column - last_column } else { column },
                length: width(word, encoding),
                token_type,
                token_modifiers_bitset,
            });
            (last_line, last_column) = (line as u32, column);
        }
    }
    out
}
