// SPDX-License-Identifier: MIT OR Apache-2.0
//! TextMate grammar, Vim syntax and words for Emacs, generated from the tables: syntax colours before the server answers, or without one.

use serde_json::{Value, json};
use takt_asm::Directive;
use takt_asm::expr::{BUILTINS, Function};
use takt_isa::{Operand, ROWS};

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
    let labels = any_of(to_labels());
    let name = "[A-Za-z_][A-Za-z0-9_.]*";
    let options = optional().map(|(directive, options)| {
        json!({ "begin": format!("(?<![A-Za-z0-9_.])\\.({})(?![A-Za-z0-9_])", &directive[1..]), "end": "(?=;)|$",
            "beginCaptures": { "0": { "name": "keyword.control.directive.takt" } },
            "patterns": [
                { "name": "keyword.other.option.takt",
                  "match": format!("(?<![A-Za-z0-9_.}}])({})(?![A-Za-z0-9_.{{])", any_of(options.iter().copied())) },
                { "include": "$self" }
            ] })
    });
    let mut grammar = json!({
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
              "match": "(?:(?<=\\.\\.)|(?<![A-Za-z0-9_.}]))(0[xX][0-9A-Fa-f_]*(\\.[0-9A-Fa-f_]*)?[pP][+-]?[0-9]+|0[xX][0-9A-Fa-f_]+|0[bB][01_]+|([0-9][0-9_]*(\\.(?!\\.)[0-9_]*)?|\\.[0-9][0-9_]*)([eE][+-]?[0-9]+)?)" },
            { "match": format!("(?<![A-Za-z0-9_.}}@])({labels})\\s+(?:({name})(\\s*,\\s*))?({name})"), "captures": {
                "1": { "name": "keyword.mnemonic.takt" }, "2": { "name": "variable.other.takt" },
                "4": { "name": "entity.name.label.takt" } } },
            { "name": "keyword.mnemonic.takt", "match": format!("(?<![A-Za-z0-9_.}}@])({mnemonics})(?![A-Za-z0-9_.{{(:])") },
            { "name": "support.function.takt", "match": format!("(?<![A-Za-z0-9_.}}])({functions})(?=\\()") },
            { "name": "support.constant.takt", "match": format!("(?<![A-Za-z0-9_.}}])({constants})(?![A-Za-z0-9_.{{])") },
            { "name": "keyword.operator.takt", "match": "\\|\\||==|!=|<=|>=|<<|>>|[-+*/%~!^&|<>=]" },
            { "name": "variable.other.takt", "match": name }
        ]
    });
    // Before the pattern of all directives, as the first match counts.
    if let Some(patterns) = grammar["patterns"].as_array_mut() {
        patterns.splice(4..4, options);
    }
    grammar
}

/// Text of the grammar's file.
pub fn textmate_text() -> String {
    // Cannot fail: the value consists of literals and strings.
    serde_json::to_string_pretty(&textmate()).unwrap_or_default() + "\n"
}

/// Directives that declare the names behind them.
const DECLARING: [Directive; 7] = [
    Directive::Const,
    Directive::Param,
    Directive::Input,
    Directive::Output,
    Directive::State,
    Directive::Reg,
    Directive::Array,
];

/// Mnemonics whose operands name a label.
fn to_labels() -> impl Iterator<Item = &'static str> {
    ROWS.iter().filter(|row| row.shape.operands().contains(&Operand::Target)).map(|row| row.mnemonic)
}

/// Directives with options, and these.
fn optional() -> impl Iterator<Item = (&'static str, &'static [&'static str])> {
    let all = Directive::ALL.iter().map(|directive| (directive.name(), directive.options()));
    all.filter(|(_, options)| !options.is_empty())
}

/// Words of the language by kind, in the order of the tables.
struct Words {
    directives: Vec<&'static str>,
    mnemonics: Vec<&'static str>,
    /// Names of built-in constants; those of one letter are left out, since most programs call a register so.
    constants: Vec<&'static str>,
}

impl Words {
    fn of_the_tables() -> Words {
        Words {
            directives: Directive::ALL.iter().map(|directive| directive.name()).collect(),
            mnemonics: ROWS.iter().map(|row| row.mnemonic).collect(),
            constants: BUILTINS.iter().map(|builtin| builtin.0).filter(|name| name.len() > 1).collect(),
        }
    }
}

/// Syntax file for Vim and Neovim.
pub fn vim() -> String {
    let Words { directives, mnemonics, constants } = Words::of_the_tables();
    let [directives, mnemonics, constants] = [directives, mnemonics, constants].map(|words| words.join(" "));
    let declaring = DECLARING.map(|directive| &directive.name()[1..]).join(r"\|");
    let labels = to_labels().collect::<Vec<_>>().join("|");
    let options: String = optional()
        .map(|(directive, options)| {
            let (directive, options) = (&directive[1..], options.join("|"));
            format!("syntax match taktOption /\\v(^\\s*\\.{directive}\\s[^;]*)@<=<({options})>/\n")
        })
        .collect();
    format!(
        r#"" Takt in Vim and Neovim. Generated from the tables by `cargo xtask docs`; do not edit.
if exists('b:current_syntax')
  finish
endif
syntax iskeyword @,48-57,_,.
syntax keyword taktDirective {directives}
syntax keyword taktMnemonic {mnemonics}
syntax keyword taktConstant {constants}
syntax match taktNumber /\v(\.\.@2<=|[0-9A-Za-z_.}}]@1<!)(0[xX]\x[0-9a-fA-F_]*|0[bB][01][01_]*|\d[0-9_]*(\.\.@![0-9_]*)?([eE][-+]?\d+)?|\.\d[0-9_]*([eE][-+]?\d+)?)/
syntax match taktFunction /[A-Za-z_][A-Za-z0-9_.]*\ze(/
syntax match taktName /\(^\s*\.\({declaring}\)\s\+\)\@<=[^;=]*/ contains=taktNumber,taktOption
{options}syntax match taktLabel /\v(<({labels})\s+([A-Za-z0-9_.]+\s*,\s*)?)@<=<[A-Za-z_][A-Za-z0-9_.]*>(\s*,)@!/
syntax match taktLabel /^\s*[A-Za-z_][A-Za-z0-9_.{{}}]*\ze:/
syntax match taktFile /\(\.include\s*\)\@<=<[^>]*>/
syntax region taktText start=/"/ skip=/\\./ end=/"/ oneline
syntax match taktComment /;.*$/ contains=@Spell
highlight default link taktDirective PreProc
highlight default link taktMnemonic Statement
highlight default link taktOption Keyword
highlight default link taktFunction Function
highlight default link taktConstant Constant
highlight default link taktName Identifier
highlight default link taktNumber Number
highlight default link taktLabel Label
highlight default link taktFile String
highlight default link taktText String
highlight default link taktComment Comment
let b:current_syntax = 'takt'
"#
    )
}

/// Words for the colours of Emacs' `takt-mode`.
pub fn emacs() -> String {
    let Words { directives, mnemonics, constants } = Words::of_the_tables();
    let list = |name: &str, text: &str, words: Vec<&str>| {
        let words: Vec<String> = words.iter().map(|word| format!("{word:?}")).collect();
        format!("(defconst takt-{name}\n  '({})\n  \"{text}\")\n\n", words.join(" "))
    };
    let options: Vec<String> = optional()
        .map(|(directive, options)| {
            let options: Vec<String> = options.iter().map(|option| format!("{option:?}")).collect();
            format!("({directive:?} {})", options.join(" "))
        })
        .collect();
    let options = format!(
        "(defconst takt-options\n  '({})\n  \"Directives with words of their own, and these.\")\n\n",
        options.join(" ")
    );
    format!(
        ";;; takt-words.el --- Words of Takt's sources  -*- lexical-binding: t -*-\n\n\
         ;; Generated from the tables by `cargo xtask docs'; do not edit.\n\n;;; Code:\n\n{}{}{}{}{}{}\
         (provide 'takt-words)\n;;; takt-words.el ends here\n",
        list("directives", "Directives.", directives),
        list("mnemonics", "Names of instructions.", mnemonics),
        list("constants", "Names of constants.", constants),
        list("declaring", "Directives that declare names.", DECLARING.map(Directive::name).to_vec()),
        list("to-labels", "Names of instructions with a label among the operands.", to_labels().collect()),
        options
    )
}
