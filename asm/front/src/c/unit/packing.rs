// SPDX-License-Identifier: MIT OR Apache-2.0
//! Structures whose members lie closer than their types ask: `__attribute__((packed))` and `#pragma pack`, which the parser does not
//! keep.

use std::collections::HashMap;

/// Alignments that `#pragma pack` sets, with the offsets from which they hold; `None` for the types' own.
#[derive(Default)]
pub(super) struct Packs {
    changes: Vec<(usize, Option<usize>)>,
    stack: Vec<Option<usize>>,
}

impl Packs {
    fn now(&self) -> Option<usize> {
        self.changes.last().and_then(|(_, most)| *most)
    }

    /// Reads a pragma; others than `pack` are passed over.
    pub(super) fn pragma(&mut self, rest: &str, offset: usize) -> Result<(), String> {
        let Some(inner) = rest.trim().strip_prefix("pack").map(str::trim_start) else { return Ok(()) };
        let Some(inner) = inner.strip_prefix('(').and_then(|inner| inner.split(')').next()) else {
            return Ok(());
        };
        let mut most = None;
        for word in inner.split(',').map(str::trim) {
            match word {
                "push" => {
                    self.stack.push(self.now());
                    most = most.or(self.now());
                }
                "pop" => most = self.stack.pop().flatten(),
                "" => {}
                number => match number.parse() {
                    Ok(bytes @ (1 | 2 | 4 | 8 | 16)) => most = Some(bytes),
                    _ => {
                        return Err(format!("`#pragma pack({inner})`: expected push, pop, 1, 2, 4, 8 or 16"));
                    }
                },
            }
        }
        self.changes.push((offset, most));
        Ok(())
    }

    fn at(&self, offset: usize) -> Option<usize> {
        let count = self.changes.partition_point(|(from, _)| *from <= offset);
        count.checked_sub(1).and_then(|index| self.changes[index].1)
    }
}

/// Finds the packed structures, by the offsets of their keywords, and blanks attributes between keyword and tag, which the parser does
/// not take.
pub(super) fn packed(text: &mut String, packs: &Packs) -> HashMap<usize, usize> {
    let mut found = HashMap::new();
    let mut blanks = Vec::new();
    let bytes = text.as_bytes();
    let mut at = 0;
    while let Some((start, end)) = word(bytes, at) {
        at = end;
        if !matches!(&text[start..end], "struct" | "union" | "enum") {
            continue;
        }
        let mut packed = false;
        while let Some(attribute) = attribute(text, at) {
            packed |= names_packed(&text[attribute.0..attribute.1]);
            blanks.push(attribute);
            at = attribute.1;
        }
        // The tag, and the members.
        let after = word(bytes, at).filter(|(start, _)| text[at..*start].trim().is_empty());
        let open = after.map_or(at, |(_, end)| end);
        if let Some(close) = closing(bytes, open) {
            let mut behind = close;
            while let Some((start, end)) = attribute(text, behind) {
                packed |= names_packed(&text[start..end]);
                behind = end;
            }
            let most = if packed { Some(1) } else { packs.at(start) };
            found.extend(most.map(|most| (start, most)));
        }
    }
    for (start, end) in blanks {
        text.replace_range(start..end, &" ".repeat(end - start));
    }
    found
}

fn names_packed(attribute: &str) -> bool {
    attribute
        .split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
        .any(|word| matches!(word, "packed" | "__packed__"))
}

/// The next word at or after an offset, outside of quotes.
fn word(bytes: &[u8], mut at: usize) -> Option<(usize, usize)> {
    let is_word = |c: u8| c.is_ascii_alphanumeric() || c == b'_';
    while at < bytes.len() {
        match bytes[at] {
            quote @ (b'"' | b'\'') => {
                at += 1;
                while at < bytes.len() && bytes[at] != quote && bytes[at] != b'\n' {
                    at += if bytes[at] == b'\\' { 2 } else { 1 };
                }
                at += 1;
            }
            c if is_word(c) => {
                let end =
                    bytes[at..].iter().position(|c| !is_word(*c)).map_or(bytes.len(), |count| at + count);
                return Some((at, end));
            }
            _ => at += 1,
        }
    }
    None
}

/// An attribute that follows an offset with only blanks between.
fn attribute(text: &str, from: usize) -> Option<(usize, usize)> {
    let bytes = text.as_bytes();
    let (start, end) = word(bytes, from)?;
    let named = matches!(&text[start..end], "__attribute__" | "__attribute");
    if !named || !text[from..start].trim().is_empty() {
        return None;
    }
    let mut depth = 0_usize;
    for (index, c) in bytes.iter().enumerate().skip(end) {
        match c {
            b'(' => depth += 1,
            b')' if depth == 1 => return Some((start, index + 1)),
            b')' => depth = depth.checked_sub(1)?,
            c if depth == 0 && !c.is_ascii_whitespace() => return None,
            _ => {}
        }
    }
    None
}

/// The end of a block in braces that follows an offset with only blanks between.
fn closing(bytes: &[u8], from: usize) -> Option<usize> {
    let mut depth = 0_usize;
    for (index, c) in bytes.iter().enumerate().skip(from) {
        match c {
            b'{' => depth += 1,
            b'}' if depth == 1 => return Some(index + 1),
            b'}' => depth = depth.checked_sub(1)?,
            c if depth == 0 && !c.is_ascii_whitespace() => return None,
            _ => {}
        }
    }
    None
}
