// SPDX-License-Identifier: MIT OR Apache-2.0
//! Texts of open documents, and positions in them.

use lsp_types::{Position, Range, TextDocumentContentChangeEvent};
use std::sync::Arc;
use takt_asm::source::Lines;

/// Unit of a position's column.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) enum Encoding {
    Utf8,
    #[default]
    Utf16,
}

/// A text with an index of its lines.
#[derive(Clone, Debug)]
pub(crate) struct Text {
    pub(crate) text: Arc<String>,
    lines: Lines,
}

impl Text {
    pub(crate) fn new(text: impl Into<String>) -> Text {
        Text::shared(Arc::new(text.into()))
    }

    /// Creates a text that shares its string with the assembler's sources.
    pub(crate) fn shared(text: Arc<String>) -> Text {
        let lines = Lines::of(&text);
        Text { text, lines }
    }

    /// Position of a byte offset.
    pub(crate) fn position(&self, byte: usize, encoding: Encoding) -> Position {
        let mut byte = byte.min(self.text.len());
        while !self.text.is_char_boundary(byte) {
            byte -= 1;
        }
        let line = self.lines.index(byte as u32);
        let start = self.lines.range(line).map_or(0, |range| range.start);
        Position::new(line as u32, width(&self.text[start..byte], encoding))
    }

    pub(crate) fn range(&self, bytes: std::ops::Range<usize>, encoding: Encoding) -> Range {
        Range::new(self.position(bytes.start, encoding), self.position(bytes.end, encoding))
    }

    /// Byte offset of a position, clamped to the line and to the text.
    pub(crate) fn byte(&self, position: Position, encoding: Encoding) -> usize {
        let Some(range) = self.lines.range(position.line as usize) else { return self.text.len() };
        let line = self.text[range.clone()].trim_end_matches(['\n', '\r']);
        let mut column = 0;
        for (index, c) in line.char_indices() {
            if column >= position.character {
                return range.start + index;
            }
            column += match encoding {
                Encoding::Utf8 => c.len_utf8() as u32,
                Encoding::Utf16 => c.len_utf16() as u32,
            };
        }
        range.start + line.len()
    }

    /// Byte range of a line (from 0), without the line break.
    pub(crate) fn line(&self, line: usize) -> Option<std::ops::Range<usize>> {
        let range = self.lines.range(line)?;
        let text = self.text[range.clone()].trim_end_matches(['\n', '\r']);
        Some(range.start..range.start + text.len())
    }

    /// Line of a byte offset, from 0.
    pub(crate) fn line_of(&self, byte: usize) -> usize {
        self.lines.index(byte as u32)
    }

    /// Text after changes, each applied to the result of the previous one.
    pub(crate) fn changed(&self, changes: Vec<TextDocumentContentChangeEvent>, encoding: Encoding) -> Text {
        let mut text = self.clone();
        for change in changes {
            text = match change.range {
                None => Text::new(change.text),
                Some(range) => {
                    let (start, end) = (text.byte(range.start, encoding), text.byte(range.end, encoding));
                    let (start, end) = (start.min(end), start.max(end));
                    Text::new([&text.text[..start], &change.text, &text.text[end..]].concat())
                }
            };
        }
        text
    }
}

/// Width of a text, in columns of the encoding.
pub(crate) fn width(text: &str, encoding: Encoding) -> u32 {
    match encoding {
        Encoding::Utf8 => text.len() as u32,
        Encoding::Utf16 => text.encode_utf16().count() as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_the_clients_units() {
        let text = Text::new("a\n; µ𝄞b\r\n\nend");
        for (encoding, column) in [(Encoding::Utf16, 5), (Encoding::Utf8, 8)] {
            let byte = text.text.find('b').expect("it is there");
            assert_eq!(text.position(byte, encoding), Position::new(1, column));
            assert_eq!(text.byte(Position::new(1, column), encoding), byte);
            // A position beyond a line is clamped to the line's end before the line break; beyond the text, to its end.
            assert_eq!(text.byte(Position::new(1, 99), encoding), byte + 1);
            assert_eq!(text.byte(Position::new(99, 0), encoding), text.text.len());
        }
    }

    #[test]
    fn changes_apply_one_after_the_other() {
        let change = |line, from, to, text: &str| TextDocumentContentChangeEvent {
            range: Some(Range::new(Position::new(line, from), Position::new(line, to))),
            range_length: None,
            text: text.to_owned(),
        };
        let text = Text::new("one\ntwo\n");
        let changes = vec![change(0, 0, 1, "µ\nO"), change(1, 0, 1, "o"), change(9, 9, 9, "end")];
        assert_eq!(&*text.changed(changes, Encoding::Utf16).text, "µ\none\ntwo\nend");
        // A reversed range, and a range inside a character, are applied as far as possible.
        let back = TextDocumentContentChangeEvent {
            range: Some(Range::new(Position::new(1, 2), Position::new(0, 1))),
            range_length: None,
            text: String::new(),
        };
        assert_eq!(&*text.changed(vec![back], Encoding::Utf16).text, "oo\n");
    }
}
