// SPDX-License-Identifier: MIT OR Apache-2.0
//! TextMate grammar, generated from the tables: syntax colours before the server answers, or without a server.

use serde_json::{Value, json};
use takt_asm::Directive;
use takt_asm::expr::{BUILTINS, Function};
use takt_isa::ROWS;

/// Alternation of words as a regular expression, longest first.
fn any_of<'w>(words: impl IntoIterator<Item = &'w str>) -> String {
    let mut words: Vec<&str> = words.into_iter().collect();
    words.sort_by_key(|word| (std::cmp::Reverse(word.len()), *word));
    words.join("|")
}

/// The TextMate grammar as JSON.
pub fn textmate() -> Value {
    let directives = any_of(Directive::ALL.iter().map(|directive| &directive.name()[1..]));
    let mnemonics = any_of(ROWS.iter().map(|row| row.mnemonic));
    let functions = any_of(Function::ALL.iter().map(|function| function.name()));
    let constants = any_of(BUILTINS.iter().map(|builtin| builtin.0));
    let name = "[A-Za-z_][A-Za-z0-9_.]*";
    json!({
        "$schema": "https://raw.githubusercontent.com/martinring/tmlanguage/master/tmlanguage.json",
        "comment": "Generated from the tables by `cargo xtask docs`; do not edit.",
        "name": "Takt",
        "scopeName": "source.takt",
        "fileTypes": ["s"],
        "patterns": [
            { "name": "comment.line.semicolon.takt", "match": ";.*$" },
            { "name": "string.quoted.double.takt", "match": "\"([^\"\\\\]|\\\\.)*\"" },
            { "match": "(\\.include)\\s*(<[^>]*>)", "captures": {
                "1": { "name": "keyword.control.directive.takt" }, "2": { "name": "string.quoted.other.takt" } } },
            { "match": format!("^\\s*({name}|[A-Za-z0-9_.]*\\{{[^:]*\\}}[A-Za-z0-9_.]*)(:)"), "captures": {
                "1": { "name": "entity.name.label.takt" }, "2": { "name": "punctuation.separator.takt" } } },
            { "name": "keyword.control.directive.takt", "match": format!("(?<![A-Za-z0-9_.])\\.({directives})(?![A-Za-z0-9_])") },
            { "name": "constant.numeric.takt",
              "match": "(?<![A-Za-z0-9_.}])(0[xX][0-9A-Fa-f_]*(\\.[0-9A-Fa-f_]*)?[pP][+-]?[0-9]+|0[xX][0-9A-Fa-f_]+|0[bB][01_]+|([0-9][0-9_]*(\\.[0-9_]*)?|\\.[0-9][0-9_]*)([eE][+-]?[0-9]+)?)" },
            { "name": "keyword.mnemonic.takt", "match": format!("(?<![A-Za-z0-9_.}}@])({mnemonics})(?![A-Za-z0-9_.{{(:])") },
            { "name": "support.function.takt", "match": format!("(?<![A-Za-z0-9_.}}])({functions})(?=\\()") },
            { "name": "support.constant.takt", "match": format!("(?<![A-Za-z0-9_.}}])({constants})(?![A-Za-z0-9_.{{])") },
            { "name": "keyword.operator.takt", "match": "\\|\\||==|!=|<=|>=|<<|>>|[-+*/%~!^&|<>=]" },
            { "name": "variable.other.takt", "match": name }
        ]
    })
}

/// Text of the grammar's file.
pub fn textmate_text() -> String {
    // Cannot fail: the value consists of literals and strings.
    serde_json::to_string_pretty(&textmate()).unwrap_or_default() + "\n"
}
