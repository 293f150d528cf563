// SPDX-License-Identifier: MIT OR Apache-2.0
//! Syntax colours of listings: the language server's tokens as CSS classes.

use lsp_server::{Message, Notification, Request};
use serde_json::{Value, json};
use std::fmt::Write;
use takt_editor::lsp::{Inline, Settings};

/// Coloured token types of the language server. Registers stay uncoloured, since most words are registers.
const KINDS: [&str; 10] = [
    "keyword",
    "function",
    "macro",
    "property",
    "enumMember",
    "label",
    "parameter",
    "number",
    "string",
    "comment",
];

/// Colours of the token types in light and dark themes, as in the playground.
pub(super) const CSS: &str = "\
code.language-takt { --keyword: #8a3ffc; --function: #1f5fae; --property: #00695c; --number: #9a4a00; --string: #2e7d32; --comment: #697386; --label: #a3156b; }
:is(.navy, .coal, .ayu) code.language-takt { --keyword: #c4a5ff; --function: #82b6f5; --property: #6fd3c1; --number: #f0b070; --string: #8fce93; --comment: #8d98aa; --label: #ff9dcb; }
.takt-keyword { color: var(--keyword); } .takt-function, .takt-macro { color: var(--function); } .takt-property { color: var(--property); }
.takt-number, .takt-enumMember { color: var(--number); } .takt-string { color: var(--string); } .takt-label { color: var(--label); }
.takt-comment { color: var(--comment); font-style: italic; } .takt-parameter { font-style: italic; }
";

/// Token of a line: first byte, length in bytes, type.
type Word = (usize, usize, &'static str);

/// Coloured tokens of each line of a program; empty if the language server does not answer.
fn words(program: &str) -> Vec<Vec<Word>> {
    let mut server = Inline::new(Settings { library: takt_programs::LIBRARY, ..Settings::default() });
    let capabilities = json!({
        "general": { "positionEncodings": ["utf-8"] },
        "textDocument": { "semanticTokens": {
            "requests": { "full": true }, "tokenTypes": [], "tokenModifiers": [], "formats": ["relative"],
        } },
    });
    let begun = ask(&mut server, "initialize", json!({ "capabilities": capabilities }));
    let document = json!({ "uri": "listing.s", "languageId": "takt", "version": 1, "text": program });
    let opened = Notification::new("textDocument/didOpen".to_owned(), json!({ "textDocument": document }));
    server.receive(opened.into());
    server.check();
    let tokens = ask(
        &mut server,
        "textDocument/semanticTokens/full",
        json!({ "textDocument": { "uri": "listing.s" } }),
    );
    let legend = &begun["capabilities"]["semanticTokensProvider"]["legend"]["tokenTypes"];
    let numbers: Vec<usize> = tokens["data"]
        .as_array()
        .map(|data| data.iter().filter_map(|number| Some(number.as_u64()? as usize)).collect())
        .unwrap_or_default();
    let mut lines: Vec<Vec<Word>> = vec![Vec::new(); program.lines().count()];
    let (mut line, mut column) = (0, 0);
    for token in numbers.chunks_exact(5) {
        line += token[0];
        column = if token[0] > 0 { token[1] } else { column + token[1] };
        let kind = legend[token[3]].as_str().unwrap_or_default();
        let kind = KINDS.iter().find(|name| **name == kind);
        if let (Some(kind), Some(line)) = (kind, lines.get_mut(line)) {
            line.push((column, token[2], kind));
        }
    }
    lines
}

fn ask(server: &mut Inline, method: &str, params: Value) -> Value {
    let said = server.receive(Request::new(1.into(), method.to_owned(), params).into());
    let answer = said.into_iter().find_map(|message| match message {
        Message::Response(response) => response.response_result.ok(),
        _ => None,
    });
    answer.unwrap_or_default()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Listing as HTML. `shown` consists of lines of `program`, in order, and of placeholder lines.
pub(super) fn html(shown: &str, program: &str) -> String {
    let words = words(program);
    let lines: Vec<&str> = program.lines().collect();
    let mut next = 0;
    let mut out = "<pre><code class=\"language-takt nohighlight hljs\">".to_owned();
    for line in shown.lines() {
        let found = lines[next..].iter().position(|other| *other == line).map(|offset| next + offset);
        let mut at = 0;
        if let Some(found) = found {
            next = found + 1;
            for (start, length, kind) in &words[found] {
                let (Some(before), Some(word)) = (line.get(at..*start), line.get(*start..start + length))
                else {
                    continue;
                };
                let _ =
                    write!(out, "{}<span class=\"takt-{kind}\">{}</span>", escaped(before), escaped(word));
                at = start + length;
            }
        }
        let _ = writeln!(out, "{}", escaped(&line[at..]));
    }
    out.push_str("</code></pre>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn highlighting_classifies_words_and_keeps_the_text() {
        let program = ".input x\n.output y\n.period\nperiod: fmul y, x, 2\n    wait period ; a < b\n";
        let html = html("...\nperiod: fmul y, x, 2\n    wait period ; a < b\n", program);
        assert!(html.contains("<span class=\"takt-comment\">; a &lt; b</span>"), "{html}");
        for (class, word) in [("function", "fmul"), ("label", "period"), ("number", "2"), ("property", "y")] {
            assert!(html.contains(&format!("takt-{class}\">{word}</span>")), "{class}: {html}");
        }
        let mut text = String::new();
        let mut is_tag = false;
        for one in html.chars() {
            match one {
                '<' => is_tag = true,
                '>' if is_tag => is_tag = false,
                one if !is_tag => text.push(one),
                _ => {}
            }
        }
        assert_eq!(text, "...\nperiod: fmul y, x, 2\n    wait period ; a &lt; b\n\n");
    }
}
