// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of the grammar: a place and the set of tokens expected there. An error costs no allocation, so that each line is parsed
//! once, correct or not.

use super::Tokens;
use crate::ast::Directive;
use crate::lex::Token;
use chumsky::DefaultExpected;
use chumsky::error::{Error, LabelError};
use chumsky::util::MaybeRef;
use takt_diagnostics::source::Span;

macro_rules! whats {
    ($($variant:ident $text:literal;)*) => {
        /// A token or a construct that may stand at a place of a line.
        #[derive(Clone, Copy, PartialEq, Eq, Debug)]
        pub(crate) enum ExpectedItem {
            $($variant,)*
        }

        impl ExpectedItem {
            const ALL: &[ExpectedItem] = &[$(ExpectedItem::$variant),*];

            /// Name of the token or construct in messages.
            pub(crate) const fn text(self) -> &'static str {
                match self { $(ExpectedItem::$variant => $text,)* }
            }
        }
    };
}

whats! {
    Comma "`,`";
    Dots "`..`";
    Colon "`:`";
    At "`@`";
    Assign "`=`";
    Question "`?`";
    Bars "`||`";
    Open "`(`";
    Close "`)`";
    BracketOpen "`[`";
    BracketClose "`]`";
    BraceClose "`}`";
    Greater "`>`";
    EndOfLine "the end of the line";
    Function "a function";
    Name "a name";
    Operand "an operand";
    Operator "an operator";
    Expression "an expression";
    Instruction "an instruction";
    InstructionOrDirective "an instruction or a directive";
    Slot "a slot";
    Register "a register";
    RegisterToWrite "a register to write";
    Type "a type";
    Place "a register's place or a port's number";
    Text "a text in `\"`";
    LibraryFile "a library file in `<>`";
    LineNumber "a line number";
    Machine "a machine";
    OnOrOff "`on` or `off`";
    LatchedOrDirect "`latched` or `direct`";
    Allowed "`reassociate`, `reciprocal` or `off`";
    LoopOption "`step`, `unroll` or `max`";
    LoopTotal "`total`";
    Compared "`>=` or `<=`";
    Port "a port";
    Array "an array";
    Cycle "a cycle";
    Cycles "cycles";
    Least "the least value";
    Largest "the largest value";
    Range "`range`";
    SomethingElse "something else";
}

// Every kind and every directive has a bit of its own.
const _: () = assert!(ExpectedItem::ALL.len() + Directive::ALL.len() <= 128);

/// The furthest place that the parser reached in a line, and the tokens that it expected there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExpectedItems {
    span: Span,
    set: u128,
}

impl ExpectedItems {
    /// The furthest place that the parser reached.
    pub(crate) fn span(&self) -> Span {
        self.span
    }

    /// The names of the expected tokens, in alphabetical order.
    pub(crate) fn texts(&self) -> Vec<String> {
        let is_in = |bit: usize| self.set >> bit & 1 != 0;
        let whats = ExpectedItem::ALL.iter().enumerate().filter(|(bit, _)| is_in(*bit));
        let directives = (ExpectedItem::ALL.len()..).zip(Directive::ALL).filter(|(bit, _)| is_in(*bit));
        let mut texts: Vec<String> = whats.map(|(_, what)| what.text().to_owned()).collect();
        texts.extend(directives.map(|(_, directive)| format!("`{}`", directive.name())));
        texts.sort();
        texts
    }
}

/// The bit of a kind, or of a directive.
trait Bit {
    fn bit(self) -> u128;
}

impl Bit for ExpectedItem {
    fn bit(self) -> u128 {
        1 << self as u32
    }
}

impl Bit for DefaultExpected<'_, Token> {
    fn bit(self) -> u128 {
        let what = match self {
            DefaultExpected::NothingElse => return 0,
            DefaultExpected::EndOfInput => ExpectedItem::EndOfLine,
            DefaultExpected::Token(token) => match *token {
                Token::Directive(directive) => return 1 << (ExpectedItem::ALL.len() + directive as usize),
                Token::Comma => ExpectedItem::Comma,
                Token::Dots => ExpectedItem::Dots,
                Token::Colon => ExpectedItem::Colon,
                Token::At => ExpectedItem::At,
                Token::Assign => ExpectedItem::Assign,
                Token::Question => ExpectedItem::Question,
                Token::Bars => ExpectedItem::Bars,
                Token::Open => ExpectedItem::Open,
                Token::Close => ExpectedItem::Close,
                Token::BracketOpen => ExpectedItem::BracketOpen,
                Token::BracketClose => ExpectedItem::BracketClose,
                Token::Newline => ExpectedItem::EndOfLine,
                _ => ExpectedItem::SomethingElse,
            },
            _ => ExpectedItem::SomethingElse,
        };
        what.bit()
    }
}

impl<'t> Error<'t, Tokens<'t>> for ExpectedItems {
    #[inline]
    fn merge(self, other: ExpectedItems) -> ExpectedItems {
        ExpectedItems { span: self.span, set: self.set | other.set }
    }
}

impl<'t, L: Bit> LabelError<'t, Tokens<'t>, L> for ExpectedItems {
    #[inline]
    fn expected_found<I: IntoIterator<Item = L>>(
        expected: I,
        _: Option<MaybeRef<'t, Token>>,
        span: Span,
    ) -> ExpectedItems {
        ExpectedItems { span, set: expected.into_iter().fold(0, |set, expected| set | expected.bit()) }
    }

    #[inline]
    fn label_with(&mut self, label: L) {
        self.set = label.bit();
    }
}
