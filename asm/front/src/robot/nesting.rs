// SPDX-License-Identifier: MIT OR Apache-2.0
//! Limits on depth and width of an XML text, checked in a scan of its tags before the parser runs: the parser recurses into nested
//! elements, so unbounded nesting overflows the stack, and it compares each attribute with all others, which takes quadratic time.

/// A violated limit, with its line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Excess {
    /// Elements nested too deeply.
    Depth(usize),
    /// An element with too many attributes.
    Attributes(usize),
}

/// Finds the first place with more than `deep` nested elements, or more than `wide` attributes. `None` also if the text before is not
/// XML: the parser's message is better.
pub(super) fn excess(source: &str, deep: usize, wide: usize) -> Option<Excess> {
    let (mut rest, mut depth) = (source, 0_usize);
    while let Some(at) = rest.find('<') {
        rest = &rest[at..];
        let after = |end: &str| rest.find(end).map(|found| &rest[found + end.len()..]);
        rest = if rest.starts_with("<!--") {
            after("-->")?
        } else if rest.starts_with("<![CDATA[") {
            after("]]>")?
        } else if rest.starts_with("<?") {
            after("?>")?
        } else if rest.starts_with("<!") {
            after(">")?
        } else if rest.starts_with("</") {
            depth = depth.saturating_sub(1);
            after(">")?
        } else {
            let (tag, attributes) = tag(rest)?;
            if !tag.ends_with("/>") {
                depth += 1;
            }
            if depth > deep || attributes > wide {
                let before = source.len() - rest.len();
                let line = 1 + source[..before].matches('\n').count();
                return Some(if depth > deep { Excess::Depth(line) } else { Excess::Attributes(line) });
            }
            &rest[tag.len()..]
        };
    }
    None
}

/// Splits off a tag up to its unquoted end; returns it with the number of its attributes.
fn tag(text: &str) -> Option<(&str, usize)> {
    let mut quote = None;
    let mut attributes = 0;
    let end = text.find(|c| match (quote, c) {
        (None, '"' | '\'') => {
            quote = Some(c);
            attributes += 1;
            false
        }
        (Some(open), c) if open == c => {
            quote = None;
            false
        }
        (quote, c) => quote.is_none() && c == '>',
    })?;
    Some((&text[..=end], attributes))
}

#[cfg(test)]
mod tests {
    use super::{Excess, excess};

    #[test]
    fn only_elements_within_elements_count() {
        let text = "<?xml version='1.0'?><!DOCTYPE a><!-- <a><a> -->\n<a x='>' y=\"/>\"><b/><b></b>\n<b><![CDATA[<a><a><a>]]><c/>\n<c></c></b></a>";
        let expected = [Some(Excess::Depth(2)), Some(Excess::Depth(4)), None];
        assert_eq!([1, 2, 3].map(|deep| excess(text, deep, 2)), expected);
        assert_eq!(excess(text, 3, 1), Some(Excess::Attributes(2)));
        // Unterminated markup is left to the parser.
        for text in ["<a", "<a b='>", "<!-- <a>", "<a><![CDATA[", "<?", "<!", "</a", "no XML", "</a></a>"] {
            assert_eq!(excess(text, 1, 1), None, "{text}");
        }
    }
}
