// SPDX-License-Identifier: MIT OR Apache-2.0
//! A translation unit: preprocessed text, its tree, and the places of its lines in the files.

use crate::Error;
use lang_c::ast::{Declarator, DeclaratorKind, ExternalDeclaration, TranslationUnit};
use lang_c::driver::{Config, Flavor, parse_preprocessed};
use std::collections::HashMap;

mod packing;

/// Maximum nesting depth of parentheses and braces: the parser recurses.
const MAX_NESTING: usize = 200;

/// Maximum length of preprocessed text, in bytes.
const MAX_TEXT: usize = 16 << 20;

pub(super) struct Unit {
    pub(super) tree: TranslationUnit,
    /// Lines of the preprocessed text: offset, number of the file, line in that file.
    lines: Vec<(usize, usize, usize)>,
    pub(super) files: Vec<String>,
    /// Bounds of loops with the offsets of their pragmas.
    pub(super) bounds: Vec<(usize, u64)>,
    /// Structures whose members lie closer than their types ask, by the offsets of `struct` or `union`, with the largest alignment.
    pub(super) packed: HashMap<usize, usize>,
    /// Preprocessed text, for lines of files that are not available.
    text: String,
}

impl Unit {
    /// Reads preprocessed text (`cpp` with its line markers); `name` is the file's name until the first marker.
    pub(super) fn read(name: &str, text: &str) -> Result<Unit, Error> {
        if text.len() > MAX_TEXT {
            return Err(Error::plain(format!("{name}: more than {MAX_TEXT} bytes after preprocessing")));
        }
        let (mut files, mut lines, mut bounds) = (vec![name.to_owned()], Vec::new(), Vec::new());
        let mut packs = packing::Packs::default();
        let (mut file, mut line, mut offset, mut clean) = (0, 1, 0, String::with_capacity(text.len()));
        for row in text.split_inclusive('\n') {
            let plain = row.trim();
            lines.push((offset, file, line));
            line += 1;
            if let Some(rest) = plain.strip_prefix('#') {
                if let Some((number, name)) = marker(rest) {
                    line = number;
                    file = files.iter().position(|known| *known == name).unwrap_or_else(|| {
                        files.push(name);
                        files.len() - 1
                    });
                } else if let Some(rest) = rest.trim_start().strip_prefix("pragma") {
                    pragma(rest, offset, &mut bounds).and_then(|()| packs.pragma(rest, offset)).map_err(
                        |text| Error {
                            file: Some(files[file].clone()),
                            line: Some(line - 1),
                            text,
                            place: None,
                        },
                    )?;
                }
                // Blanks in place of directives, which the parser does not take everywhere.
                clean.extend(
                    row.chars().map(|c| if c == '\n' || c == '\r' { c } else { ' ' }).filter(char::is_ascii),
                );
                while clean.len() < offset + row.len() {
                    clean.push(' ');
                }
            } else {
                clean.push_str(row);
            }
            offset += row.len();
        }
        let tree = TranslationUnit(Vec::new());
        let mut unit = Unit { tree, lines, files, bounds, packed: HashMap::new(), text: clean };
        unit.nesting()?;
        unit.packed = packing::packed(&mut unit.text, &packs);
        let config = Config { cpp_command: String::new(), cpp_options: Vec::new(), flavor: Flavor::GnuC11 };
        match parse_preprocessed(&config, unit.text.clone()) {
            Ok(parse) => Ok(Unit { tree: parse.unit, ..unit }),
            Err(error) => {
                let found: String = unit.text[error.offset.min(unit.text.len())..]
                    .trim_start()
                    .chars()
                    .take_while(|c| !c.is_whitespace())
                    .take(24)
                    .collect();
                let text = match found.is_empty() {
                    true => "the file ends before the C does: a `}` or a `;` is missing".to_owned(),
                    false => format!("`takt cc` cannot read this as C99, at `{found}`"),
                };
                Err(unit.error(error.offset, text))
            }
        }
    }

    /// Refuses nesting that would exhaust the parser's stack.
    fn nesting(&self) -> Result<(), Error> {
        let (mut depth, mut quoted, mut escaped) = (0_usize, None, false);
        for (at, c) in self.text.bytes().enumerate() {
            match (quoted, c) {
                (Some(_), _) if escaped => escaped = false,
                (Some(_), b'\\') => escaped = true,
                (Some(quote), c) if c == quote || c == b'\n' => quoted = None,
                (Some(_), _) => {}
                (None, b'"' | b'\'') => quoted = Some(c),
                (None, b'(' | b'[' | b'{') => depth += 1,
                (None, b')' | b']' | b'}') => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth > MAX_NESTING {
                return Err(self.error(at, format!("brackets nest deeper than {MAX_NESTING}")));
            }
        }
        Ok(())
    }

    /// File and line of a place in the text.
    pub(super) fn line(&self, offset: usize) -> (&str, usize) {
        let index = self.lines.partition_point(|(start, ..)| *start <= offset).saturating_sub(1);
        match self.lines.get(index) {
            Some((_, file, line)) => (&self.files[*file], *line),
            None => (&self.files[0], 1),
        }
    }

    /// Functions that the file itself defines, with their lines.
    pub(super) fn functions(&self) -> Vec<(String, usize)> {
        let mut found = Vec::new();
        for external in &self.tree.0 {
            let (file, line) = self.line(external.span.start);
            if let ExternalDeclaration::FunctionDefinition(definition) = &external.node
                && file == self.files[0]
                && let Some(name) = declared_name(&definition.node.declarator.node)
            {
                found.push((name.to_owned(), line));
            }
        }
        found
    }

    /// Only blanks stand between a pragma's line and a place.
    pub(super) fn between(&self, pragma: usize, place: usize) -> bool {
        self.text.get(pragma..place).is_some_and(|text| text.trim().is_empty())
    }

    /// The line of the text that holds a place, without blanks around it.
    pub(super) fn text_of(&self, offset: usize) -> &str {
        let offset = offset.min(self.text.len());
        let start = self.text[..offset].rfind('\n').map_or(0, |at| at + 1);
        let end = self.text[offset..].find('\n').map_or(self.text.len(), |at| offset + at);
        self.text[start..end].trim()
    }

    pub(super) fn error(&self, offset: usize, text: impl Into<String>) -> Error {
        let (file, line) = self.line(offset);
        Error { file: Some(file.to_owned()), line: Some(line), text: text.into(), place: None }
    }
}

/// The name that a declarator declares.
pub(super) fn declared_name(declarator: &Declarator) -> Option<&str> {
    match &declarator.kind.node {
        DeclaratorKind::Identifier(name) => Some(&name.node.name),
        DeclaratorKind::Declarator(inner) => declared_name(&inner.node),
        DeclaratorKind::Abstract => None,
    }
}

/// A line marker of the preprocessor: ` 12 "file.c" 1`.
fn marker(rest: &str) -> Option<(usize, String)> {
    let rest = rest.trim_start();
    let rest = rest.strip_prefix("line").unwrap_or(rest).trim_start();
    let end = rest.find(|c: char| !c.is_ascii_digit())?;
    let number = rest[..end].parse().ok()?;
    let name = rest[end..].trim_start().strip_prefix('"')?;
    let mut file = String::new();
    let mut characters = name.chars();
    loop {
        match characters.next()? {
            '"' => return Some((number, file)),
            '\\' => file.push(characters.next()?),
            c => file.push(c),
        }
    }
}

/// `#pragma takt loop_bound(N)`; other pragmas are ignored.
fn pragma(rest: &str, offset: usize, bounds: &mut Vec<(usize, u64)>) -> Result<(), String> {
    let Some(rest) = rest.trim().strip_prefix("takt") else { return Ok(()) };
    let number = rest.trim().strip_prefix("loop_bound").map(str::trim);
    let number = number.and_then(|rest| rest.strip_prefix('(')?.strip_suffix(')'));
    match number.map(|number| number.trim().parse::<u64>()) {
        Some(Ok(bound)) if (1..=65_535).contains(&bound) => {
            bounds.push((offset, bound));
            Ok(())
        }
        Some(_) => Err("`#pragma takt loop_bound(N)` takes a number from 1 to 65535".to_owned()),
        None => Err("the only pragma for takt is `#pragma takt loop_bound(N)`".to_owned()),
    }
}
