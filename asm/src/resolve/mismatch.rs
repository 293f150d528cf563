// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnostics for expressions that no instruction computes. A part of [`equation`](crate::resolve::equation).

use crate::context::{AstPlace, ErrorReported};
use crate::ir::type_evidence::Kind;
use crate::resolve::Resolver;
use crate::resolve::advice::from_library;
use crate::resolve::term::Term;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::nearest;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_syntax::ast::Operator;

impl Resolver<'_> {
    /// Reports that no instruction computes a symbol between these terms.
    pub(super) fn no_form(
        &mut self,
        at: AstPlace,
        symbol: &str,
        terms: &[Term],
        span: Span,
    ) -> ErrorReported {
        let place = self.symbol_span(symbol, terms, span);
        if self.forms.get(symbol, terms.len()).is_empty() {
            return self.no_symbol(at, symbol, terms, place);
        }
        let shown = if symbol == "?:" { "`? :`".to_owned() } else { format!("`{symbol}`") };
        let condition = symbol == "?:";
        // The type of a choice's condition does not matter to its alternatives.
        let mixed = if condition { &terms[1..] } else { terms };
        let find = |kind| mixed.iter().find(|term| term.kind() == Some(kind));
        let convert = |from, to| self.forms.conversion(from, to);
        if condition && terms[0].kind() == Some(Kind::Float) {
            let condition = self.text(&terms[0]);
            let error = Diagnostic::error(
                "equation",
                terms[0].span,
                "expected an integer as the condition, as comparisons give it, found a float",
            )
            .mend(format!("compare it: `{condition} != 0`"), format!("{condition} != 0"));
            return self.context.report(at.scope, error);
        }
        // Instructions of this form take the type.
        let wants = |ty| {
            self.forms
                .get(symbol, terms.len())
                .iter()
                .any(|meaning| meaning.sources.iter().any(|which| meaning.op.row().source_type(*which) == ty))
        };
        let error = match (find(Kind::Int), find(Kind::Float)) {
            // If no instruction takes either type, converting one operand does not help.
            (Some(int), Some(float)) if condition || wants(Type::F) => {
                self.mixed(symbol, &shown, int, float, wants(Type::I))
            }
            (Some(int), None) if wants(Type::F) => {
                let name = self.text(int);
                let real = terms.iter().find(|term| term.kind().is_none());
                let message = match (real, wants(Type::I)) {
                    (Some(_), true) => format!("{shown} between an integer and a real number"),
                    _ => format!("{shown} takes floats, and `{name}` is an integer"),
                };
                let mut error = Diagnostic::error("equation", int.span, message).here("an integer");
                if let (Some(real), true) = (real, wants(Type::I)) {
                    error = error.also(real.span, "a real number");
                }
                match convert(Type::I, Type::F) {
                    Some(convert) => {
                        error.mend(format!("convert it: `{convert}({name})`"), format!("{convert}({name})"))
                    }
                    None => error,
                }
            }
            (_, Some(float)) => self.unexpected_float(symbol, &shown, float, span),
            _ => {
                let real = terms.iter().find(|term| term.kind().is_none());
                let message = format!("{shown} takes integers");
                Diagnostic::error("equation", real.map_or(place, |term| term.span), message)
            }
        };
        self.context.report(at.scope, error)
    }

    fn text(&self, term: &Term) -> String {
        self.context.reports.sources.text(term.span).to_owned()
    }

    /// Error of a symbol, `shown` in the message, between an integer and a float.
    fn mixed(&self, symbol: &str, shown: &str, int: &Term, float: &Term, takes_integers: bool) -> Diagnostic {
        let (name, other) = (self.text(int), self.text(float));
        let message = format!("{shown} between an integer and a float");
        let error =
            Diagnostic::error("equation", int.span, message).here("an integer").also(float.span, "a float");
        // Rounding a float before a comparison would compare another value.
        let compares = Operator::COMPARISONS.iter().any(|operator| operator.text() == symbol);
        match (self.forms.conversion(Type::I, Type::F), self.forms.conversion(Type::F, Type::I)) {
            (Some(float_of), Some(int_of)) if takes_integers && !compares => {
                error.help(format!("convert one of them: `{float_of}({name})` or `{int_of}({other})`"))
            }
            (Some(float_of), _) => {
                error.mend(format!("convert it: `{float_of}({name})`"), format!("{float_of}({name})"))
            }
            _ => error,
        }
    }

    /// Error of a float, where a symbol, `shown` in the message, takes integers.
    fn unexpected_float(&self, symbol: &str, shown: &str, float: &Term, span: Span) -> Diagnostic {
        let name = self.text(float);
        let message = format!("{shown} takes integers, and `{name}` is a float");
        let error = Diagnostic::error("equation", float.span, message).here("a float");
        let (and, or, not) = (Operator::And.text(), Operator::Or.text(), Operator::Not.text());
        if symbol == not {
            let zero = format!("{name} == 0");
            let message = error.message;
            return Diagnostic::error("equation", span, message).mend(format!("compare it: `{zero}`"), zero);
        }
        if symbol == and || symbol == or {
            // Either the bits of a number as a condition, or a comparison without its parentheses.
            return error.help(format!(
                "conditions are comparisons in parentheses, as `({name} > 0) {symbol} …`; declare `{name}:bits` if its pattern is meant"
            ));
        }
        match self.forms.conversion(Type::F, Type::I) {
            Some(convert) => error.mend(
                format!("convert it: `{convert}({name})`, or declare it `:bits` if its pattern is meant"),
                format!("{convert}({name})"),
            ),
            None => error,
        }
    }

    /// Reports that no instruction has the form at all.
    fn no_symbol(&mut self, at: AstPlace, symbol: &str, terms: &[Term], place: Span) -> ErrorReported {
        let is_name = symbol.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        if !is_name {
            let message = format!("no instruction computes `{symbol}`");
            let text = |term: &Term| self.context.reports.sources.text(term.span);
            let help = match (symbol, terms) {
                ("^", [base, _]) => Some(format!(
                    "multiply: `{0}*{0}`; `pow(x, y)` of `<math.s>` takes any exponent",
                    text(base)
                )),
                ("%", _) => Some("`fmod(x, y)` of `<math.s>` computes remainders".to_owned()),
                ("~", [operand]) => Some(format!("`xor({}, -1)` flips all bits", text(operand))),
                _ => None,
            };
            let mut error = Diagnostic::error("equation", place, message);
            error.help = help;
            return self.context.report(at.scope, error);
        }
        if let Some(takes) = self.forms.operands(symbol) {
            let plural = if takes == 1 { "" } else { "s" };
            let message = format!("`{symbol}` takes {takes} argument{plural}, not {}", terms.len());
            return self.context.error(at.scope, "arguments", place, message);
        }
        let message = format!("`{symbol}` is not a function");
        let error = Diagnostic::error("equation", place, message);
        let library = self.library_with(symbol);
        let macros = &self.context.scopes.macros;
        let later = macros.iter().find(|(name, _)| self.context.scopes.text(**name) == symbol);
        let error = match (later, library) {
            (Some((_, definition)), _) => {
                let defined = definition.span(&self.context.asts);
                error
                    .also(defined, "a macro of that name is defined only here")
                    .help("move the definition up")
            }
            (None, Some(file)) => from_library(error, &file),
            (None, None) => {
                let mut known: Vec<&str> =
                    macros.keys().map(|name| self.context.scopes.text(*name)).collect();
                known.sort_unstable();
                let functions = self.forms.functions();
                let meant = nearest(symbol, functions.iter().copied().chain(known));
                match meant {
                    Some(_) => error.did_you_mean(meant),
                    None => error.note(format!(
                        "functions: {}; and macros, as those of `<math.s>`",
                        functions.join(" ")
                    )),
                }
            }
        };
        self.context.report(at.scope, error)
    }
}
