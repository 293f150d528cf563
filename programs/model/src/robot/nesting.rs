// SPDX-License-Identifier: MIT OR Apache-2.0
//! The depth of an XML text, from a scan of its tags, before a recursive parser sees it: parsers that call themselves for each element within
//! another have no stack for what is nested without end.

/// The place where more than `most` elements are within one another: its line. None if there is no such place, or if what comes before
/// it is no XML, which the parser then says better.
pub(super) fn too_deep(source: &str, most: usize) -> Option<usize> {
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
        } else if rest.starts_with("</") {
            depth = depth.saturating_sub(1);
            after(">")?
        } else {
            let tag = tag(rest)?;
            if !tag.ends_with("/>") {
                depth += 1;
            }
            if depth > most {
                let before = source.len() - rest.len();
                return Some(1 + source[..before].matches('\n').count());
            }
            &rest[tag.len()..]
        };
    }
    None
}

/// A tag up to its end, which is not within quotes.
fn tag(text: &str) -> Option<&str> {
    let mut quote = None;
    let end = text.find(|c| match (quote, c) {
        (None, '"' | '\'') => {
            quote = Some(c);
            false
        }
        (Some(open), c) if open == c => {
            quote = None;
            false
        }
        (quote, c) => quote.is_none() && c == '>',
    })?;
    Some(&text[..=end])
}

#[cfg(test)]
mod tests {
    use super::too_deep;

    #[test]
    fn only_elements_within_elements_count() {
        let text = "<?xml version='1.0'?><!-- <a><a> -->\n<a x='>' y=\"/>\"><b/><b></b>\n<b><![CDATA[<a><a><a>]]><c/>\n<c></c></b></a>";
        assert_eq!([1, 2, 3].map(|most| too_deep(text, most)), [Some(2), Some(4), None]);
        // A comment that never ends is for the parser.
        for text in ["<a", "<a b='>", "<!-- <a>", "<a><![CDATA[", "<?", "</a", "no XML", "</a></a>"] {
            assert_eq!(too_deep(text, 1), None, "{text}");
        }
    }
}
