//! Texts from outside (sources, names of files, other people's images) as they may be shown.

use std::borrow::Cow;
use std::fmt::Write as _;

/// True if a character would do something to a terminal, or change the order in which others are shown, rather than be shown.
/// A line break or a tab, which text consists of, counts as shown.
pub const fn is_hidden(c: char) -> bool {
    match c {
        '\n' | '\t' => false,
        // C0, DEL and C1: among these are all that begin a terminal's commands.
        '\0'..='\u{1f}' | '\u{7f}'..='\u{9f}' => true,
        // Line separators, and the marks, embeddings and isolates of the bidirectional algorithm.
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => true,
        _ => false,
    }
}

/// A text with hidden characters escaped, as `\u001b`: four hexadecimal digits, so that within JSON it is the same text.
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

/// Adds a character as [`visible`] shows it.
pub fn push_visible(shown: &mut String, c: char) {
    if is_hidden(c) {
        // A `String` takes all; every hidden character has a code of four digits at most.
        let _ = write!(shown, "\\u{:04x}", u32::from(c));
    } else {
        shown.push(c);
    }
}

/// A text in one line: hidden characters and line breaks escaped, a tab as a blank. For a name within a comment.
pub fn one_line(text: &str) -> String {
    let text = visible(text);
    text.replace('\n', "\\n").replace('\t', " ")
}

/// A text within `<script>` of a page, as JSON: with no `<`, neither `</script>` nor `<!--` can be in it.
pub fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_shown_instead() {
        assert!(matches!(visible("a\tµ\n€"), Cow::Borrowed("a\tµ\n€")));
        assert_eq!(visible("\u{1b}]0;x\u{7}\r\u{9b}1m\u{7f}"), "\\u001b]0;x\\u0007\\u000d\\u009b1m\\u007f");
        assert_eq!(visible("a\u{202e}b\u{2028}"), "a\\u202eb\\u2028");
        // Every control character that Unicode knows, but for those of plain text.
        let hidden = |c: &char| c.is_control() && !matches!(c, '\n' | '\t');
        assert!(('\0'..=char::MAX).filter(hidden).all(is_hidden));
        assert!(('\0'..=char::MAX).filter(|c| is_hidden(*c)).all(|c| u32::from(c) <= 0xffff));
        assert_eq!(one_line("a\nb\u{1b}\tc"), "a\\nb\\u001b c");
        assert_eq!(in_script("{\"a\":\"<!--<script>\"}"), "{\"a\":\"\\u003c!--\\u003cscript>\"}");
    }
}
