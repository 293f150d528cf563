// SPDX-License-Identifier: MIT OR Apache-2.0
//! Highlighting and folding queries over tree-sitter nodes. Each node is captured once, since editors disagree on the precedence of
//! captures.

use takt_asm::Directive;
use takt_asm::expr::{BUILTINS, Function};
use takt_isa::ROWS;

const HEADER: &str = "; Generated from the tables by `cargo xtask docs`; do not edit.\n\n";

/// Words in quotes, for a predicate or a node list.
fn quoted<'w>(words: impl IntoIterator<Item = &'w str>) -> String {
    words.into_iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(" ")
}

/// `highlights.scm` with Helix's capture names.
pub fn helix_highlights() -> String {
    highlights().replace("@number", "@constant.numeric")
}

/// Text of `highlights.scm`: colours for tokens and names.
pub fn highlights() -> String {
    let mnemonics = quoted(ROWS.iter().map(|row| row.mnemonic));
    let functions = quoted(Function::ALL.iter().map(|function| function.name()));
    let constants = quoted(BUILTINS.iter().map(|builtin| builtin.0));
    let directives = quoted(Directive::ALL.iter().map(|directive| directive.name()));
    format!(
        r##"{HEADER}(comment) @comment
(text) @string
(library) @string.special.path
(number) @number

[{directives}] @keyword.directive

(operation mnemonic: (identifier) @keyword (#any-of? @keyword {mnemonics}))
(operation mnemonic: (identifier) @function.macro (#not-any-of? @function.macro {mnemonics}))
(macro_definition name: (identifier) @function.macro)
(macro_definition parameter: (identifier) @variable.parameter)
(counted_loop option: (identifier) @keyword)
(label name: (identifier) @label)
[(template_begin) (template_middle) (template_end)] @variable
(const_directive name: (identifier) @constant)
(cast type: (identifier) @type)
(declaration type: (identifier) @type)
(macro_definition type: (identifier) @type)
(call function: (identifier) @function.builtin (#any-of? @function.builtin {functions}))

([
  (binary (identifier) @constant.builtin)
  (unary operand: (identifier) @constant.builtin)
  (parenthesized (identifier) @constant.builtin)
  (call (identifier) @constant.builtin)
  (choice (identifier) @constant.builtin)
  (const_directive value: (identifier) @constant.builtin)
  (float_directive (identifier) @constant.builtin)
  (equation value: (identifier) @constant.builtin)
] (#any-of? @constant.builtin {constants}))

(binary operator: _ @operator)
(unary operator: _ @operator)
(choice ["?" ":"] @operator)
"||" @operator
"=" @operator
["(" ")" "[" "]"] @punctuation.bracket
"," @punctuation.delimiter
"##
    )
}

/// Text of `folds.scm`: the foldable blocks.
pub fn folds() -> String {
    format!("{HEADER}[\n  (macro_definition)\n  (repetition)\n  (counted_loop)\n  (conditional)\n] @fold\n")
}
