// SPDX-License-Identifier: MIT OR Apache-2.0
//! tree-sitter grammar for colours and folds in editors, generated from the assembler's tables.
//!
//! Directives, functions, operators and instructions come from the tables. `rules.rs` restates their syntax for tree-sitter, which
//! generates its own parser; `tests/tree_sitter.rs` compares that parser with that of `takt-asm`.

mod build;
mod queries;
mod rules;

pub use queries::{folds, helix_highlights, highlights};

use build::Rule;
use serde_json::json;

/// Text of `grammar.json`, the input of tree-sitter's parser generator, with one rule per line: the first is the start symbol, and of two
/// tokens of equal length the earlier one takes precedence.
pub fn grammar_text() -> String {
    let line = |(name, Rule(rule)): &(String, Rule)| format!("    {}: {rule}", json!(name));
    let rules: Vec<String> = rules::rules().iter().map(line).collect();
    format!(
        "{{\n  \"name\": \"takt\",\n  \"rules\": {{\n{}\n  }},\n  \"extras\": {},\n  \"conflicts\": {},\n  \"precedences\": [],\n  \
         \"externals\": [],\n  \"inline\": {},\n  \"supertypes\": []\n}}\n",
        rules.join(",\n"),
        json!([{ "type": "PATTERN", "value": "[ \\t\\f]" }, { "type": "SYMBOL", "name": "comment" }]),
        json!(rules::conflicts()),
        json!(rules::inlined()),
    )
}
