// SPDX-License-Identifier: MIT OR Apache-2.0
//! Definitions and references of names, and renames.

use crate::lsp::Settings;
use crate::lsp::program::{self, File, Front};
use crate::lsp::text::Encoding;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_asm::index::{Symbol, SymbolKind};
use takt_asm::source::Span;
use takt_asm::tokens::{self, TokenKind};
use takt_asm::{Directive, Open};
use takt_isa::Op;

/// Edits by file: byte ranges with their replacements.
type Edits = BTreeMap<PathBuf, BTreeMap<(usize, usize), String>>;

/// Splits a name before its first brace: `l{i}d` into `l` and `{i}d`.
fn halves(name: &str) -> (&str, &str) {
    name.split_at(name.find('{').unwrap_or(name.len()))
}

/// Text of a reference after its declaration is renamed from `old` to `new`: an identical text is replaced, and so is the common
/// beginning of a name with braces. `None` if the reference is composed differently.
fn renamed(reference: &str, old: &str, new: &str) -> Option<String> {
    if reference == old {
        return Some(new.to_owned());
    }
    let ((old, old_rest), (new, new_rest)) = (halves(old), halves(new));
    if old.is_empty() || old_rest.is_empty() || old_rest != new_rest {
        return None;
    }
    Some(format!("{new}{}", reference.strip_prefix(old)?))
}

/// First and last line, from 0, of the macro that contains a byte of a file.
fn macro_around(front: &Front, file: &File, byte: usize) -> Option<(usize, usize)> {
    let line = file.text.line_of(byte);
    front.index.blocks.iter().filter(|block| block.directive == Directive::Macro).find_map(|block| {
        let (number, bytes) = front.files.place(block.open)?;
        let (first, last) = (file.text.line_of(bytes.start), block.last_line as usize - 1);
        (std::ptr::eq(&front.files.0[number], file) && (first..=last).contains(&line))
            .then_some((first, last))
    })
}

/// The byte lies in the repetition whose index is declared at `span`.
fn repeats(front: &Front, file: &File, byte: usize, span: Span) -> bool {
    let line = file.text.line_of(byte);
    let mut counting = front.index.blocks.iter().filter(|block| {
        matches!(block.directive, Directive::Rep | Directive::For)
            && (block.open.start..block.open.end).contains(&span.start)
    });
    counting.any(|block| {
        let open = front.files.place(block.open);
        open.is_some_and(|(number, bytes)| {
            let lines = file.text.line_of(bytes.start)..block.last_line as usize;
            std::ptr::eq(&front.files.0[number], file) && lines.contains(&line)
        })
    })
}

/// Symbols that can be named at a byte of a file: number, symbol, and name as it is written there.
pub(crate) fn visible<'a>(
    front: &'a Front,
    file: &'a File,
    byte: usize,
) -> impl Iterator<Item = (u32, &'a Symbol, &'a str)> {
    let around = macro_around(front, file, byte);
    (0..).zip(&front.index.symbols).filter_map(move |(number, symbol)| {
        let (place, bytes) = front.files.place(symbol.span)?;
        let of = &front.files.0[place];
        if symbol.kind == SymbolKind::Count && !repeats(front, file, byte, symbol.span) {
            return None;
        }
        // Names in a macro are visible only within its body.
        let Some(within) = macro_around(front, of, bytes.start) else {
            return Some((number, symbol, symbol.name.as_str()));
        };
        let is_here = Some(within) == around && std::ptr::eq(of, file);
        is_here.then(|| (number, symbol, front.files.text(symbol.span)))
    })
}

/// Symbols that the name at a byte of a file stands for, with the span of the name. Operands of an unknown instruction stand for what
/// is visible there.
pub(crate) fn at(front: &Front, file: &File, byte: usize) -> Option<(Span, Vec<u32>)> {
    if let Some(found) = front.at(file.base + byte as u32) {
        return Some(found);
    }
    let line = file.text.line(file.text.line_of(byte))?;
    let code = &file.text.text[line.clone()];
    let lines = tokens::lines(code);
    let (head, operands) = lines.first()?.split_first()?;
    let head = (head.kind == TokenKind::Name).then(|| &code[head.range.clone()])?;
    let here = |token: &&tokens::Token| (token.range.start..=token.range.end).contains(&(byte - line.start));
    let token = operands.iter().find(|token| token.kind == TokenKind::Name && here(token))?;
    let word = &code[token.range.clone()];
    if Op::from_mnemonic(head).is_some() || Op::from_mnemonic(word).is_some() {
        return None;
    }
    let found: Vec<u32> =
        visible(front, file, byte).filter(|one| one.2 == word).map(|(number, ..)| number).collect();
    let span = file.span(line.start + token.range.start..line.start + token.range.end);
    (!found.is_empty()).then_some((span, found))
}

/// Name at a place, as spelled in its declaration: start of a rename.
pub(crate) fn renamable(front: &Front, offset: u32) -> Result<(Span, String), String> {
    let (span, symbols) = front.at(offset).ok_or("there is no name here that the program declares")?;
    let declared = front.symbol(symbols[0]).span;
    if symbols.iter().any(|symbol| front.symbol(*symbol).span != declared) {
        let text = front.files.text(span);
        return Err(format!(
            "`{text}` stands for names of several declarations: rename one of the declarations"
        ));
    }
    match front.files.place(declared).map(|(file, _)| &front.files.0[file]) {
        Some(file) if file.path.is_some() => Ok((span, front.files.text(declared).to_owned())),
        Some(file) => Err(format!("it is declared in the library, {}", file.name)),
        None => Err("its declaration is not available".to_owned()),
    }
}

/// Edits that rename a name in all programs that contain a file.
///
/// The edited programs are read again: each must declare and reference the same names as before, and have no new mistakes.
pub(crate) fn rename(
    settings: &Settings,
    fronts: &[(&Path, &Front)],
    path: &Path,
    byte: usize,
    new: &str,
    open: &Open,
) -> Result<Edits, String> {
    check_name(new)?;
    let mut edits = Edits::new();
    let mut counts = Vec::new();
    for (_, front) in fronts {
        let Some(file) = front.files.of(path) else { continue };
        let Ok((span, old)) = renamable(front, file.base + byte as u32) else {
            counts.push(None);
            continue;
        };
        let symbols = front.at(span.start).map_or(Vec::new(), |(_, symbols)| symbols);
        let references = front.references(&symbols);
        let mut spans = BTreeSet::new();
        for reference in &references {
            let text = front.files.text(reference.span);
            let Some(text) = renamed(text, &old, new) else {
                let (file, bytes) =
                    front.files.place(reference.span).ok_or("a place in the source is not available")?;
                let file = &front.files.0[file];
                let line = file.text.line_of(bytes.start) + 1;
                return Err(if halves(&old).1.is_empty() {
                    format!(
                        "`{old}` is put together at {}:{line}, as `{text}`: rename that by hand",
                        file.name
                    )
                } else if halves(new).1 != halves(&old).1 {
                    format!(
                        "`{old}` stands for several names: the new one must end in `{}` too",
                        halves(&old).1
                    )
                } else {
                    format!("at {}:{line} it is written `{text}`: rename that by hand", file.name)
                });
            };
            spans.insert((reference.span, text));
        }
        // In code that is not assembled, names are matched as text.
        for span in unresolved(front, &old, &symbols) {
            spans.insert((span, new.to_owned()));
        }
        for (span, text) in spans {
            let (file, bytes) = front.files.place(span).ok_or("a place in the source is not available")?;
            let file = &front.files.0[file];
            let path =
                file.path.clone().ok_or_else(|| format!("it is used in the library, {}", file.name))?;
            if path.is_relative() && !open.contains_key(&path) {
                return Err(format!("it is used in {}, which cannot be changed here", file.name));
            }
            edits.entry(path).or_default().insert((bytes.start, bytes.end), text);
        }
        counts.push(Some(references.len()));
    }
    if counts.iter().all(Option::is_none) {
        let front = fronts.first().ok_or("the file belongs to no program")?.1;
        let file = front.files.of(path).ok_or("the file belongs to no program")?;
        renamable(front, file.base + byte as u32)?;
    }
    verify(settings, fronts, &edits, open)?;
    Ok(edits)
}

/// Checks that a text is a valid name.
fn check_name(name: &str) -> Result<(), String> {
    let lines = tokens::lines(name);
    let [tokens] = lines.as_slice() else { return Err("a name is one line".to_owned()) };
    let is_name = match tokens.as_slice() {
        [one] => one.kind == TokenKind::Name,
        [first, .., last] => first.kind == TokenKind::TemplateBegin && last.kind == TokenKind::TemplateEnd,
        [] => false,
    };
    let whole = tokens.first().is_some_and(|token| token.range.start == 0)
        && tokens.last().is_some_and(|token| token.range.end == name.len());
    match is_name && whole {
        true => Ok(()),
        false => Err(format!(
            "`{name}` is not a name: it begins with a letter or `_` and has letters, digits, `_` and `.`"
        )),
    }
}

/// Occurrences of a name in code that is not assembled: the body of an unused macro, or a branch not taken. Names that such a body
/// declares are excluded.
fn unresolved(front: &Front, name: &str, symbols: &[u32]) -> Vec<Span> {
    let is_macro = symbols.iter().any(|symbol| front.symbol(*symbol).kind == SymbolKind::Macro);
    let local = symbols.iter().any(|symbol| front.symbol(*symbol).kind == SymbolKind::Parameter);
    let of = symbols.iter().find_map(|symbol| front.symbol(*symbol).of.clone());
    let mut found = Vec::new();
    for file in &front.files.0 {
        let text = &file.text.text;
        if !text.contains(name) {
            continue;
        }
        // Within a macro: its name, and its local names.
        let mut within: Option<(String, BTreeSet<String>)> = None;
        for tokens in tokens::lines(text) {
            let word = |index: usize| {
                tokens.get(index).map_or("", |token: &tokens::Token| &text[token.range.clone()])
            };
            let declares = [".reg", ".state", ".const", ".input", ".output"];
            match word(0) {
                ".macro" => {
                    let names = (2..tokens.len()).map(|index| word(index).to_owned());
                    within = Some((word(1).to_owned(), names.collect()));
                }
                ".endm" => within = None,
                first if declares.contains(&first) => {
                    if let Some((_, names)) = &mut within {
                        names.extend((1..tokens.len()).map(|index| word(index).to_owned()));
                    }
                }
                _ => {}
            }
            for (index, token) in tokens.iter().enumerate() {
                if token.kind != TokenKind::Name || word(index) != name {
                    continue;
                }
                let span = file.span(token.range.clone());
                let before = index.checked_sub(1).map(|index| tokens[index].kind);
                let heads = matches!(before, None | Some(TokenKind::Colon | TokenKind::Bars))
                    && word(index + 1) != ":";
                let is_other = heads != is_macro
                    || Op::from_mnemonic(name).is_some() && heads
                    || word(index.wrapping_sub(1)) == "@"
                    || word(index + 1) == "(" && !heads
                    || matches!(word(0), ".schedule" | ".ports" | ".macro");
                let shadowed = within.as_ref().is_some_and(|(_, names)| names.contains(name));
                let outside = match (&within, &of) {
                    (Some((name, _)), Some(of)) => name != of,
                    (None, Some(_)) => true,
                    (_, None) => shadowed,
                };
                let known = !front.index.of_span(span).is_empty();
                if !is_other && !(outside && (local || shadowed)) && !known {
                    found.push(span);
                }
            }
        }
    }
    found
}

/// Reads the edited programs again, and compares their declarations and references.
fn verify(settings: &Settings, fronts: &[(&Path, &Front)], edits: &Edits, open: &Open) -> Result<(), String> {
    let mut texts = (**open).clone();
    for (path, edits) in edits {
        let known = fronts.iter().find_map(|(_, front)| Some(Arc::clone(&front.files.of(path)?.text.text)));
        let text = known.ok_or("a file is not available")?;
        texts.insert(path.clone(), apply(&text, edits).into());
    }
    let texts = Arc::new(texts);
    for (root, front) in fronts {
        let (after, _) = program::check(settings, root, &texts);
        let shape = |front: &Front| {
            let kinds: Vec<SymbolKind> = front.index.symbols.iter().map(|symbol| symbol.kind).collect();
            let names: Vec<u32> = front.index.references.iter().map(|reference| reference.symbol).collect();
            (kinds, names)
        };
        let codes = |front: &Front| {
            let mut codes: Vec<&str> =
                front.diagnostics.list.iter().map(|diagnostic| diagnostic.code).collect();
            codes.sort_unstable();
            codes
        };
        let new = after
            .diagnostics
            .list
            .iter()
            .find(|one| !front.diagnostics.list.iter().any(|old| old.message == one.message));
        if shape(front) != shape(&after) || codes(front) != codes(&after).as_slice() {
            let why = new.map_or("somewhere the name would then refer to something else".to_owned(), |new| {
                new.message.clone()
            });
            return Err(format!("the program would change: {why}"));
        }
    }
    Ok(())
}

/// Text after the edits.
fn apply(text: &str, edits: &BTreeMap<(usize, usize), String>) -> String {
    let mut out = String::with_capacity(text.len());
    let mut end = 0;
    for (&(start, stop), new) in edits {
        out.push_str(&text[end..start.max(end)]);
        out.push_str(new);
        end = stop;
    }
    out + &text[end..]
}

/// Edits in the form of the protocol.
pub(crate) fn as_edits(
    fronts: &[(&Path, &Front)],
    edits: &Edits,
    encoding: Encoding,
) -> Vec<(PathBuf, Vec<lsp_types::TextEdit>)> {
    let mut out = Vec::new();
    for (path, edits) in edits {
        let Some(file) = fronts.iter().find_map(|(_, front)| front.files.of(path)) else { continue };
        let edits = edits.iter().map(|(&(start, end), text)| lsp_types::TextEdit {
            range: file.text.range(start..end, encoding),
            new_text: text.clone(),
        });
        out.push((path.clone(), edits.collect()));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_their_braces() {
        assert_eq!(renamed("x", "x", "y").as_deref(), Some("y"));
        assert_eq!(renamed("p{j}", "p{i}", "pos{i}").as_deref(), Some("pos{j}"));
        assert_eq!(renamed("p1", "p{i}", "pos{i}").as_deref(), Some("pos1"));
        assert_eq!(renamed("p1", "p{i}", "pos"), None);
        assert_eq!(renamed("{s}2", "ll2", "m"), None);
    }

    #[test]
    fn recognises_valid_names() {
        for good in ["a", "_x.1", "l{i}", "l{i}d", "c{i}{j}", "{s}2"] {
            assert_eq!(check_name(good), Ok(()), "{good}");
        }
        for bad in ["", "1a", "a b", " a", "a+b", "l{i", "a\nb", ".reg", "a;b", "µ"] {
            assert!(check_name(bad).is_err(), "{bad}");
        }
    }
}
