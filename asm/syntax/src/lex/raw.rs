// SPDX-License-Identifier: MIT OR Apache-2.0
//! Kinds of token with their regular expressions.

use logos::Logos;

/// Kind of a token, decided by regular expressions alone.
#[derive(Logos, Clone, Copy, PartialEq, Eq, Debug)]
#[logos(skip r"[ \t\r\x0C]+")]
#[logos(skip(r";[^\n]*", allow_greedy = true))]
pub(crate) enum Raw {
    #[token("\n")]
    Newline,
    #[regex(r"[A-Za-z_][A-Za-z0-9_.]*")]
    Name,
    // The pieces of a name template: `l{`, `}m{`, `}`.
    #[regex(r"([A-Za-z_][A-Za-z0-9_.]*)?\{")]
    Begin,
    #[regex(r"\}[A-Za-z0-9_.]*\{")]
    Middle,
    #[regex(r"\}[A-Za-z0-9_.]*")]
    End,
    #[regex(r"\.[A-Za-z_][A-Za-z0-9_]*")]
    Directive,
    #[regex(r"[0-9][0-9_]*")]
    Decimal,
    #[regex(r"0[xX][0-9A-Fa-f_]+")]
    Hexadecimal,
    #[regex(r"0[bB][01_]+")]
    Binary,
    #[regex(r"[0-9][0-9_]*\.[0-9_]*([eE][+-]?[0-9]+)?")]
    #[regex(r"[0-9][0-9_]*[eE][+-]?[0-9]+")]
    #[regex(r"\.[0-9][0-9_]*([eE][+-]?[0-9]+)?")]
    Real,
    #[regex(r"0[xX][0-9A-Fa-f_]*(\.[0-9A-Fa-f_]*)?[pP][+-]?[0-9]+")]
    HexReal,
    // Anything else that begins like a number; the longest match wins, and of equals the one of higher priority.
    #[regex(r"[0-9][0-9A-Za-z_.]*", priority = 1)]
    NotNumber,
    #[regex(r#""([^"\\\n]|\\[^\n])*""#)]
    Text,
    #[regex(r#""([^"\\\n]|\\[^\n])*"#, priority = 1)]
    OpenText,
    #[token("..")]
    Dots,
    #[token(",")]
    Comma,
    #[token(":")]
    Colon,
    #[token("(")]
    Open,
    #[token(")")]
    Close,
    #[token("[")]
    BracketOpen,
    #[token("]")]
    BracketClose,
    #[token("@")]
    At,
    #[token("=")]
    Assign,
    #[token("?")]
    Question,
    #[token("||")]
    Bars,
    #[token("==")]
    Eq,
    #[token("!=")]
    Ne,
    #[token("<")]
    Lt,
    #[token("<=")]
    Le,
    #[token(">")]
    Gt,
    #[token(">=")]
    Ge,
    #[token("|")]
    Or,
    #[token("&")]
    And,
    #[token("<<")]
    Shl,
    #[token(">>")]
    Shr,
    #[token("+")]
    Add,
    #[token("-")]
    Sub,
    #[token("*")]
    Mul,
    #[token("/")]
    Div,
    // A comment elsewhere: with the rest of the line, which is then no further mistake.
    #[regex(r"//[^\n]*", allow_greedy = true)]
    Slashes,
    #[token("%")]
    Rem,
    #[token("~")]
    Complement,
    #[token("!")]
    Not,
    #[token("^")]
    Power,
}
