// SPDX-License-Identifier: MIT OR Apache-2.0
//! Escaping of untrusted text (sources, file names, images from elsewhere) for display.

use std::borrow::Cow;
use std::fmt::Write as _;

/// A character is a terminal control or changes the display order of others. Line breaks and tabs, as parts of ordinary
/// text, are not hidden.
pub const fn is_hidden(c: char) -> bool {
    match c {
        '\n' | '\t' => false,
        // C0, DEL and C1 include every character that begins a terminal's control sequence.
        '\0'..='\u{1f}' | '\u{7f}'..='\u{9f}' => true,
        // Line separators, and the marks, embeddings and isolates of the bidirectional algorithm.
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => true,
        _ => false,
    }
}

/// Escapes hidden characters, as in `\u001b`: with four hexadecimal digits, which is JSON's notation, too.
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        push_visible(&mut shown, c);
    }
    Cow::Owned(shown)
}

/// Appends a character, escaped if it is hidden.
pub fn push_visible(shown: &mut String, c: char) {
    if is_hidden(c) {
        // Writing to a `String` cannot fail; every hidden character has a code of at most four digits.
        let _ = write!(shown, "\\u{:04x}", u32::from(c));
    } else {
        shown.push(c);
    }
}

/// Escapes hidden characters and line breaks, and turns a tab into a blank, so that a name fits into a comment.
pub fn one_line(text: &str) -> String {
    let text = visible(text);
    text.replace('\n', "\\n").replace('\t', " ")
}

/// Escapes `<` in JSON for use within a page's `<script>`, so that it contains neither `</script>` nor `<!--`.
pub fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}

/// Names of an array's elements: `M[1,1]`, `M[1,2]`, …. Each index counts from 1 to its size, the last index fastest.
pub fn element_names(name: &str, sizes: &[u32]) -> Vec<String> {
    let mut all = vec![String::new()];
    for size in sizes {
        let with = |before: &String| {
            let comma = if before.is_empty() { "" } else { "," };
            (1..=*size).map(|index| format!("{before}{comma}{index}")).collect::<Vec<_>>()
        };
        all = all.iter().flat_map(with).collect();
    }
    all.into_iter().map(|indices| format!("{name}[{indices}]")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_terminal_control_characters() {
        assert!(matches!(visible("a\tµ\n€"), Cow::Borrowed("a\tµ\n€")));
        assert_eq!(visible("\u{1b}]0;x\u{7}\r\u{9b}1m\u{7f}"), "\\u001b]0;x\\u0007\\u000d\\u009b1m\\u007f");
        assert_eq!(visible("a\u{202e}b\u{2028}"), "a\\u202eb\\u2028");
        // Unicode's control characters, except line feed and tab, are hidden.
        let hidden = |c: &char| c.is_control() && !matches!(c, '\n' | '\t');
        assert!(('\0'..=char::MAX).filter(hidden).all(is_hidden));
        assert!(('\0'..=char::MAX).filter(|c| is_hidden(*c)).all(|c| u32::from(c) <= 0xffff));
        assert_eq!(one_line("a\nb\u{1b}\tc"), "a\\nb\\u001b c");
        assert_eq!(in_script("{\"a\":\"<!--<script>\"}"), "{\"a\":\"\\u003c!--\\u003cscript>\"}");
    }
}
