// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of the grammar: a place and the set of tokens expected there. An error costs no allocation, so that a line is parsed once
//! whether or not it has one.

use super::Tokens;
use crate::ast::Directive;
use crate::lex::Token;
use crate::report::source::Span;
use chumsky::DefaultExpected;
use chumsky::error::{Error, LabelError};
use chumsky::util::MaybeRef;

macro_rules! whats {
    ($($variant:ident $text:literal;)*) => {
        /// Something that may stand at a place of a line.
        #[derive(Clone, Copy, PartialEq, Eq, Debug)]
        pub(crate) enum What {
            $($variant,)*
        }

        impl What {
            const ALL: &[What] = &[$(What::$variant),*];

            /// Its name in messages.
            pub(crate) const fn text(self) -> &'static str {
                match self { $(What::$variant => $text,)* }
            }
        }
    };
}

whats! {
    Comma "`,`";
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
    Port "a port";
    Cycle "a cycle";
    Cycles "cycles";
    Least "the least value";
    Largest "the largest value";
    SomethingElse "something else";
}

// Every kind and every directive has a bit of its own.
const _: () = assert!(What::ALL.len() + Directive::ALL.len() <= 128);

/// The furthest place that a parser of a line came to, and what would have been taken there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expected {
    span: Span,
    set: u128,
}

impl Expected {
    /// The place.
    pub(crate) fn span(&self) -> Span {
        self.span
    }

    /// The names of the expected tokens, in alphabetical order.
    pub(crate) fn texts(&self) -> Vec<String> {
        let is_in = |bit: usize| self.set >> bit & 1 != 0;
        let whats = What::ALL.iter().enumerate().filter(|(bit, _)| is_in(*bit));
        let directives = (What::ALL.len()..).zip(Directive::ALL).filter(|(bit, _)| is_in(*bit));
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

impl Bit for What {
    fn bit(self) -> u128 {
        1 << self as u32
    }
}

impl Bit for DefaultExpected<'_, Token> {
    fn bit(self) -> u128 {
        let what = match self {
            DefaultExpected::NothingElse => return 0,
            DefaultExpected::EndOfInput => What::EndOfLine,
            DefaultExpected::Token(token) => match *token {
                Token::Directive(directive) => return 1 << (What::ALL.len() + directive as usize),
                Token::Comma => What::Comma,
                Token::Colon => What::Colon,
                Token::At => What::At,
                Token::Assign => What::Assign,
                Token::Question => What::Question,
                Token::Bars => What::Bars,
                Token::Open => What::Open,
                Token::Close => What::Close,
                Token::BracketOpen => What::BracketOpen,
                Token::BracketClose => What::BracketClose,
                Token::Newline => What::EndOfLine,
                _ => What::SomethingElse,
            },
            _ => What::SomethingElse,
        };
        what.bit()
    }
}

impl<'t> Error<'t, Tokens<'t>> for Expected {
    #[inline]
    fn merge(self, other: Expected) -> Expected {
        Expected { span: self.span, set: self.set | other.set }
    }
}

impl<'t, L: Bit> LabelError<'t, Tokens<'t>, L> for Expected {
    #[inline]
    fn expected_found<I: IntoIterator<Item = L>>(
        expected: I,
        _: Option<MaybeRef<'t, Token>>,
        span: Span,
    ) -> Expected {
        Expected { span, set: expected.into_iter().fold(0, |set, expected| set | expected.bit()) }
    }

    #[inline]
    fn label_with(&mut self, label: L) {
        self.set = label.bit();
    }
}
