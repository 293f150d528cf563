// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assembler listings in documents: what is shown, and the whole program that it is a part of.
//!
//! A listing is a block ```` ```asm ````. A comment right before it, which nobody sees who reads the document, completes it:
//!
//! ```text
//! <!-- listing: NAME -->      a name, for tests of what it costs
//! <!-- around:                what stands around it; the line `...` is its place
//! <!-- in place of ...:       what its own line `...` leaves out
//! ```

/// A listing of a document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listing<'d> {
    /// Its name, if it has one.
    pub name: Option<&'d str>,
    /// The line of the document that it begins behind, from 1.
    pub line: usize,
    /// The text that is shown.
    pub text: &'d str,
    /// The program that it is, or is a part of.
    pub program: String,
}

const FENCE: &str = "```asm\n";
/// The content of a line that stands for others.
const DOTS: &str = "...";

/// The listings of a document, in its order.
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
        // From the nearest comment up.
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

/// A text with another in place of its lines that are dots.
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
