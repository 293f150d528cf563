// SPDX-License-Identifier: MIT OR Apache-2.0
//! Combinators for a tree-sitter grammar in the form of `grammar.json`.

use serde_json::{Value, json};

/// A grammar rule or a part of one.
#[derive(Clone, PartialEq)]
pub(super) struct Rule(pub(super) Value);

/// Rule that matches the empty text.
pub(super) fn blank() -> Rule {
    Rule(json!({ "type": "BLANK" }))
}

pub(super) fn symbol(name: impl AsRef<str>) -> Rule {
    Rule(json!({ "type": "SYMBOL", "name": name.as_ref() }))
}

/// Token with fixed text.
pub(super) fn text(value: &str) -> Rule {
    Rule(json!({ "type": "STRING", "value": value }))
}

/// Token given by a regular expression.
pub(super) fn pattern(value: &str) -> Rule {
    Rule(json!({ "type": "PATTERN", "value": value }))
}

/// Token that must follow without a blank.
pub(super) fn immediate(rule: Rule) -> Rule {
    Rule(json!({ "type": "IMMEDIATE_TOKEN", "content": rule.0 }))
}

pub(super) fn seq<const N: usize>(members: [Rule; N]) -> Rule {
    let members: Vec<Value> = members.into_iter().map(|member| member.0).collect();
    Rule(json!({ "type": "SEQ", "members": members }))
}

pub(super) fn choice(members: impl IntoIterator<Item = Rule>) -> Rule {
    let members: Vec<Value> = members.into_iter().map(|member| member.0).collect();
    Rule(json!({ "type": "CHOICE", "members": members }))
}

pub(super) fn optional(rule: Rule) -> Rule {
    choice([rule, blank()])
}

pub(super) fn repeat(rule: Rule) -> Rule {
    Rule(json!({ "type": "REPEAT", "content": rule.0 }))
}

pub(super) fn repeat1(rule: Rule) -> Rule {
    Rule(json!({ "type": "REPEAT1", "content": rule.0 }))
}

/// Nonempty list of elements with separators.
pub(super) fn separated(separator: Rule, rule: Rule) -> Rule {
    seq([rule.clone(), repeat(seq([separator, rule]))])
}

/// Nonempty list, separated by commas.
pub(super) fn commas(rule: Rule) -> Rule {
    separated(text(","), rule)
}

/// Nonempty list, separated by blanks or commas.
pub(super) fn blanks(rule: Rule) -> Rule {
    separated(optional(text(",")), rule)
}

/// Rule with a field name in its node.
pub(super) fn field(name: &str, rule: Rule) -> Rule {
    Rule(json!({ "type": "FIELD", "name": name, "content": rule.0 }))
}

/// Rule with a different node name in the tree.
pub(super) fn alias(rule: Rule, name: &str) -> Rule {
    Rule(json!({ "type": "ALIAS", "content": rule.0, "named": true, "value": name }))
}

pub(super) fn left(precedence: u16, rule: Rule) -> Rule {
    Rule(json!({ "type": "PREC_LEFT", "value": precedence, "content": rule.0 }))
}

pub(super) fn right(precedence: u16, rule: Rule) -> Rule {
    Rule(json!({ "type": "PREC_RIGHT", "value": precedence, "content": rule.0 }))
}
