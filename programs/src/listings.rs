// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assembler listings in documents: the text shown, and the complete program that it belongs to.
//!
//! A listing is a block ```` ```asm ````. Comments right before it, invisible to the document's readers, complete it:
//!
//! ```text
//! <!-- listing: NAME -->      name, for tests of the listing's cost
//! <!-- around:                text around the listing, whose place is the line `...`
//! <!-- in place of ...:       text in place of the listing's own line `...`
//! ```

/// Listing of a document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listing<'d> {
    /// Name for tests, if given.
    pub name: Option<&'d str>,
    /// Line of the document before the listing's text, from 1.
    pub line: usize,
    /// Text shown in the document.
    pub text: &'d str,
    /// Complete program that the listing is part of.
    pub program: String,
}

const FENCE: &str = "```asm\n";
/// Content of a placeholder line.
const DOTS: &str = "...";

/// Listings of a document, in its order.
pub fn listings(document: &str) -> Vec<Listing<'_>> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(fence) = document[at..].find(FENCE).map(|offset| at + offset) {
        let start = fence + FENCE.len();
        let end = document[start..].find("```").map_or(document.len(), |offset| start + offset);
        at = end;
        if fence > 0 && !document[..fence].ends_with('\n') {
            continue;
        }
        let text = &document[start..end];
        let (mut name, mut program) = (None, text.to_owned());
        let mut before = document[..fence].trim_end();
        // Comments from the nearest up.
        while let Some(rest) = before.strip_suffix("-->") {
            let Some(open) = rest.rfind("<!--") else { break };
            let comment = &rest[open + "<!--".len()..];
            if let Some(named) = comment.trim().strip_prefix("listing: ") {
                name = Some(named.trim());
            } else if let Some(around) = comment.trim_start().strip_prefix("around:\n") {
                program = instead(around, &program);
            } else if let Some(left_out) = comment.trim_start().strip_prefix("in place of ...:\n") {
                program = instead(&program, left_out);
            }
            before = rest[..open].trim_end();
        }
        let line = document[..start].lines().count();
        found.push(Listing { name, line, text, program });
    }
    found
}

/// Replaces the placeholder lines of a text.
fn instead(text: &str, other: &str) -> String {
    let line = |line: &str| if line.trim() == DOTS { other.to_owned() } else { format!("{line}\n") };
    text.lines().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_complete_a_listing() {
        let document = "text\n\n<!-- listing: one -->\n```asm\na\n```\n<!-- around:\n.period\n...\nend\n-->\n<!-- in place of ...:\nc\nd\n-->\n```asm\nb\n   ...\n```\n```console\n$ x\n```\n";
        let found = listings(document);
        let programs: Vec<_> = found.iter().map(|one| (one.name, one.line, one.program.as_str())).collect();
        assert_eq!(programs, [(Some("one"), 4, "a\n"), (None, 16, ".period\nb\nc\nd\nend\n")]);
        assert_eq!(found[1].text, "b\n   ...\n");
    }
}
