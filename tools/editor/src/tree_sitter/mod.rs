// SPDX-License-Identifier: MIT OR Apache-2.0
//! The tree-sitter grammar: what an editor colours and folds by, from the assembler's tables.
//!
//! Every directive, function, operator and instruction comes from a table; `rules.rs` says how they are put together, once
//! more than `takt-asm` does, because tree-sitter makes its own parser. `tests/tree_sitter.rs` holds one against the other.

mod build;
mod queries;
mod rules;

pub use queries::{folds, helix_highlights, highlights};

use build::Rule;
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::json;

/// The rules in their order, which counts: the first is the start, and of two tokens of the same length the earlier wins.
struct Ordered(Vec<(String, Rule)>);

impl Serialize for Ordered {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, Rule(rule)) in &self.0 {
            map.serialize_entry(name, rule)?;
        }
        map.end()
    }
}

/// The grammar's file, `grammar.json`, from which tree-sitter generates its parser.
pub fn grammar_text() -> String {
    #[derive(serde::Serialize)]
    struct Grammar {
        name: &'static str,
        rules: Ordered,
        extras: serde_json::Value,
        conflicts: Vec<Vec<String>>,
        precedences: [(); 0],
        externals: [(); 0],
        inline: Vec<String>,
        supertypes: [(); 0],
    }
    let grammar = Grammar {
        name: "takt",
        rules: Ordered(rules::rules()),
        extras: json!([
            { "type": "PATTERN", "value": "[ \\t\\f]" },
            { "type": "SYMBOL", "name": "comment" }
        ]),
        conflicts: rules::conflicts(),
        precedences: [],
        externals: [],
        inline: rules::inlined(),
        supertypes: [],
    };
    // A value made of literals and strings is always written.
    serde_json::to_string_pretty(&grammar).unwrap_or_default() + "\n"
}
