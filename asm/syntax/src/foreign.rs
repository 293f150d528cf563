// SPDX-License-Identifier: MIT OR Apache-2.0
//! Statements and operators of other languages, and the forms of this language for them.

use crate::ast::{Directive, Operator};
use crate::lex::{Token, is_equation};
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;

type Tokens<'t> = &'t [(Token, Span)];

/// Translates a statement of another language into this language, given its first word and the text after it.
pub fn statement(word: &str, rest: &str) -> Option<String> {
    let rest = rest.trim().trim_end_matches([':', '{']).trim_end();
    let condition = if rest.is_empty() { "c" } else { rest };
    let name = rest.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).next().unwrap_or_default();
    let named = |otherwise: &'static str| {
        if name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
            name.to_owned()
        } else {
            otherwise.to_owned()
        }
    };
    Some(match word {
        "if" => format!(
            "a choice is `y = {condition} ? a : b`; to skip lines, write `c = {condition}` and `bz c, LABEL`; `.if` … `.endif` chooses what is assembled"
        ),
        "elif" | "else" => {
            "a choice is `y = c ? a : b`; to skip lines, branch with `bz` and `jmp`; `.if` … `.else` … `.endif` chooses what is assembled"
                .to_owned()
        }
        "while" => format!(
            "a loop is a label, its lines, `c = {condition}` and `bnz c, LABEL`; `.loop_bound` says how often it turns at most"
        ),
        "for" => format!(
            "`.for {}, 1, 3` … `.endfor` repeats its lines for 1, 2 and 3; `.rep` … `.endr` writes them out",
            named("i")
        ),
        "int" => format!("declare it with `.reg {}:int`, then assign its value", named("n")),
        "let" | "var" | "float" | "double" if !named("").is_empty() => {
            format!("declare it with `.reg {}`, then assign its value", named("u"))
        }
        _ => return None,
    })
}

/// Diagnostic for a rejected line in another language's syntax, with the equivalent in this language. `at` is the token where the
/// grammar stopped.
pub(crate) fn describe<'s>(
    tokens: Tokens<'_>,
    at: usize,
    text: &dyn Fn(Span) -> &'s str,
) -> Option<Diagnostic> {
    let line = ForeignLine { tokens: body(tokens), text };
    line.statement().or_else(|| line.assignment()).or_else(|| line.operator(tokens[at].1))
}

/// A line's tokens without its label and without its end.
fn body(tokens: Tokens<'_>) -> Tokens<'_> {
    let tokens = match tokens {
        [inner @ .., (Token::Newline, _)] => inner,
        tokens => tokens,
    };
    match tokens {
        [(Token::Name(_), _), (Token::Colon, _), rest @ ..]
            if !rest.is_empty() && !matches!(rest[0].0, Token::Assign) =>
        {
            rest
        }
        tokens => tokens,
    }
}

struct ForeignLine<'t, 'f, 's> {
    tokens: Tokens<'t>,
    text: &'f dyn Fn(Span) -> &'s str,
}

impl<'s> ForeignLine<'_, '_, 's> {
    fn token(&self, index: usize) -> Option<Token> {
        self.tokens.get(index).map(|token| token.0)
    }

    fn word(&self, index: usize) -> &'s str {
        match self.tokens.get(index) {
            Some(&(Token::Name(_), span)) => (self.text)(span),
            _ => "",
        }
    }

    /// Place and text of a range of tokens.
    fn part(&self, range: std::ops::Range<usize>) -> (Span, &'s str) {
        let Some(tokens) = self.tokens.get(range).filter(|tokens| !tokens.is_empty()) else {
            return (Span::default(), "");
        };
        let span = tokens[0].1.to(tokens[tokens.len() - 1].1);
        (span, (self.text)(span))
    }

    fn whole(&self) -> (Span, &'s str) {
        self.part(0..self.tokens.len())
    }

    /// No blank separates the token from the next.
    fn touch(&self, index: usize) -> bool {
        matches!(self.tokens.get(index..index + 2), Some([first, second]) if first.1.end == second.1.start)
    }

    fn statement(&self) -> Option<Diagnostic> {
        let word = self.word(0);
        // The word may be a register's name.
        if matches!(
            self.token(1),
            None | Some(Token::Assign | Token::Comma | Token::BracketOpen | Token::Operator(_))
        ) {
            return None;
        }
        let help = statement(word, self.part(1..self.tokens.len()).1)?;
        let span = self.tokens[0].1;
        Some(Diagnostic::error("syntax", span, format!("`{word}` is not part of the language")).help(help))
    }

    /// `u += 1`, `u++` and `u := 1`.
    fn assignment(&self) -> Option<Diagnostic> {
        if !matches!(self.token(0), Some(Token::Name(_) | Token::Begin(_) | Token::At)) {
            return None;
        }
        let (whole, _) = self.whole();
        let error = |symbol: &str| {
            Diagnostic::error("syntax", whole, format!("`{symbol}` is not part of the language"))
        };
        if let [.., (Token::Operator(a), _), (Token::Operator(b), _)] = self.tokens
            && let last = self.tokens.len() - 2
            && a == b
            && matches!(a, Operator::Add | Operator::Sub)
            && last > 0
            && self.touch(last)
        {
            let (_, target) = self.part(0..last);
            let instead = format!("{target} = {target} {} 1", a.text());
            return Some(error(self.part(last..last + 2).1).mend(format!("write `{instead}`"), instead));
        }
        let assign = self.tokens.iter().position(|(token, _)| *token == Token::Assign)?;
        let before = assign.checked_sub(1).filter(|before| *before > 0 && self.touch(*before))?;
        let (_, target) = self.part(0..before);
        let (_, value) = self.part(assign + 1..self.tokens.len());
        let symbol = self.part(before..assign + 1).1;
        let instead = match self.token(before)? {
            Token::Colon => format!("{target} = {value}"),
            // In other languages `^` is exclusive or.
            Token::Operator(Operator::Power) => format!("{target} = xor({target}, {value})"),
            Token::Operator(operator) if operator.precedence() > Operator::Eq.precedence() => {
                let value =
                    if self.tokens.len() - assign > 2 { format!("({value})") } else { value.to_owned() };
                format!("{target} = {target} {} {value}", operator.text())
            }
            _ => return None,
        };
        Some(match value {
            "" => error(symbol).help(format!("write `{}`", instead.trim_end())),
            _ => error(symbol).mend(format!("write `{instead}`"), instead),
        })
    }

    /// `**`, `&&`, `||` between conditions, `and`, `or`, `not`, `a if c else b`.
    fn operator(&self, at: Span) -> Option<Diagnostic> {
        let error = |span, symbol: &str| {
            Diagnostic::error("syntax", span, format!("`{symbol}` is not an operator of the language"))
        };
        let is_equation = is_equation(self.tokens);
        let alike = |index: usize, operator: Operator| {
            let both = [self.token(index), self.token(index + 1)];
            both == [Some(Token::Operator(operator)); 2] && self.touch(index)
        };
        if let Some(index) = (0..self.tokens.len()).find(|index| alike(*index, Operator::Mul)) {
            let (span, symbol) = self.part(index..index + 2);
            if !is_equation {
                return Some(error(span, symbol).mend("a power is written `^`", "^"));
            }
            let base = index.checked_sub(1).map(|base| self.word(base)).unwrap_or_default();
            let help = "multiply, as `x*x`; `pow(x, y)` of `<math.s>` takes any exponent, and of constants `^` is the power";
            return Some(match self.token(index + 2) {
                Some(Token::Int(exponent @ 2..=4)) if !base.is_empty() => {
                    let product = format!("({})", vec![base; exponent as usize].join("*"));
                    let (span, _) = self.part(index - 1..index + 3);
                    error(span, symbol).mend(format!("write `{product}`"), product)
                }
                _ => error(span, symbol).help(help),
            });
        }
        let joins = |index: usize| -> Option<(usize, Operator)> {
            match self.token(index)? {
                Token::Operator(Operator::And) if alike(index, Operator::And) => Some((2, Operator::And)),
                Token::Bars if self.is_or(index, is_equation) => Some((1, Operator::Or)),
                Token::Name(_) if index > 0 && self.word(index) == "and" => Some((1, Operator::And)),
                Token::Name(_) if index > 0 && self.word(index) == "or" => Some((1, Operator::Or)),
                _ => None,
            }
        };
        if let Some((index, (width, operator))) =
            (0..self.tokens.len()).find_map(|index| Some((index, joins(index)?)))
        {
            let (span, symbol) = self.part(index..index + width);
            // A register may have such a name.
            if !self.word(index).is_empty()
                && at != span
                && Some(at) != self.tokens.get(index + 1).map(|token| token.1)
            {
                return None;
            }
            let operator = operator.text();
            return Some(match self.conditions(&joins) {
                Some((span, instead)) => error(span, symbol).mend(format!("write `{instead}`"), instead),
                None => error(span, symbol).help(format!(
                    "write `{operator}` between conditions in parentheses: `(a < b) {operator} (c < d)`"
                )),
            });
        }
        let index = self.tokens.iter().position(|token| token.1 == at)?;
        match self.word(index) {
            "if" if is_equation => {
                Some(error(at, "if").help("a choice is written with the condition first: `c ? a : b`"))
            }
            _ if is_equation && index > 0 && self.word(index - 1) == "not" => Some(
                error(self.tokens[index - 1].1, "not")
                    .mend("write `!`, before a condition in parentheses", "!"),
            ),
            _ => None,
        }
    }

    /// Bars join conditions: they stand in an equation or a directive, and no operation follows them.
    fn is_or(&self, index: usize, is_equation: bool) -> bool {
        match self.token(0) {
            Some(Token::Directive(directive)) => {
                matches!(directive, Directive::If | Directive::Elif | Directive::Const) && index > 1
            }
            _ => {
                let rest = &self.tokens[index + 1..];
                let is_operation =
                    matches!(rest.first(), Some((Token::Name(name), _)) if name.op().is_some());
                let assigns = rest.iter().any(|(token, _)| *token == Token::Assign);
                is_equation && !rest.is_empty() && !is_operation && !assigns
            }
        }
    }

    /// The expression with conditions in parentheses and the language's operators between them, and its place.
    fn conditions(&self, joins: &dyn Fn(usize) -> Option<(usize, Operator)>) -> Option<(Span, String)> {
        let start = match self.token(0)? {
            Token::Directive(Directive::If | Directive::Elif) => 1,
            _ => self.tokens.iter().position(|(token, _)| *token == Token::Assign)? + 1,
        };
        let (mut out, mut depth, mut from, mut compares) = (String::new(), 0usize, start, false);
        let add = |out: &mut String, range: std::ops::Range<usize>, compares: bool| -> Option<()> {
            let (_, text) = self.part(range);
            *out += &if compares { format!("({text})") } else { text.to_owned() };
            (!text.is_empty()).then_some(())
        };
        let mut index = start;
        while let Some(token) = self.token(index) {
            if depth == 0
                && let Some((width, operator)) = joins(index)
            {
                add(&mut out, from..index, compares)?;
                out += &format!(" {} ", operator.text());
                index += width;
                (from, compares) = (index, false);
                continue;
            }
            match token {
                Token::Open | Token::BracketOpen => depth += 1,
                Token::Close | Token::BracketClose => depth = depth.checked_sub(1)?,
                // No correction for a join within parentheses.
                _ if joins(index).is_some() => return None,
                Token::Operator(operator) if depth == 0 => compares |= operator.compares(),
                Token::Comma | Token::Question | Token::Assign if depth == 0 => return None,
                _ => {}
            }
            index += 1;
        }
        add(&mut out, from..self.tokens.len(), compares)?;
        Some((self.part(start..self.tokens.len()).0, out))
    }
}
