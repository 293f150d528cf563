// SPDX-License-Identifier: MIT OR Apache-2.0
//! Advice on a line whose instruction is unknown, or takes other operands: the part of [`resolve`](crate::resolve) that guesses
//! the intention.

use crate::context::{AstPlace, ErrorReported};
use crate::expand::load::Loader;
use crate::resolve::{Host, Resolver};
use takt_diagnostics::all_nearest;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::{Span, line_feeds};
use takt_isa::{Effect, Op, ROWS, Row};
use takt_syntax::ast::*;
use takt_syntax::foreign;
use takt_syntax::name::NameId;

impl Resolver<'_> {
    pub(crate) fn wrong_count(
        &mut self,
        at: AstPlace,
        row: &Row,
        written: &takt_syntax::ast::Operation,
        operands: &[Operand],
    ) -> ErrorReported {
        let places = row.shape.operands();
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        let message = format!(
            "`{}` takes {} operand{}, not {}",
            row.mnemonic,
            places.len(),
            plural(places.len()),
            operands.len()
        );
        // Point at the first operand too many, or else at the whole operation.
        let span = match operands.get(places.len()) {
            Some(first) => first.span.to(written.span),
            None => written.span,
        };
        let error = Diagnostic::error("operands", span, message);
        let write = format!("{} {}", row.mnemonic, row.shape.syntax());
        self.context.report(at.scope, error.help(format!("write `{}`", write.trim_end())))
    }

    pub(crate) fn unknown_mnemonic(
        &mut self,
        at: AstPlace,
        name: NameId,
        written: &takt_syntax::ast::Operation,
        of: usize,
    ) -> ErrorReported {
        let text = self.context.scopes.text(name).to_owned();
        let span = written.mnemonic.span;
        if let Some(definition) = self.context.scopes.macros.get(&name)
            && of > 1
        {
            let defined = definition.span(&self.context.asts);
            let error = Diagnostic::error("macro-in-bundle", span, format!("macro `{text}` within a bundle"))
                .also(defined, "defined here")
                .help("a macro's use stands alone on its line");
            return self.context.report(at.scope, error);
        }
        if let Some(definition) = self.context.scopes.macros.get(&name) {
            let defined = definition.span(&self.context.asts);
            let error = Diagnostic::error(
                "declared-later",
                span,
                format!("macro `{text}` is used before its definition"),
            )
            .also(defined, "defined only here")
            .help("move the definition up");
            return self.context.report(at.scope, error);
        }
        let directive = format!(".{text}");
        let error = Diagnostic::error(
            "unknown-instruction",
            span,
            format!("there is no instruction or macro `{text}`"),
        );
        let rest = Span::new(span.end, written.span.end);
        let rest = self.context.reports.sources.text(rest);
        let lower = text.to_ascii_lowercase();
        // The name of a function with an instruction, which the library has for other machines.
        let own = alias(&lower).filter(|name| {
            Op::from_mnemonic(name).is_some_and(|op| !matches!(self.slots[op as usize], Host::None))
        });
        let error = if let Some(help) = foreign::statement(&text, rest) {
            error.help(help)
        } else if own.is_some() {
            error.did_you_mean(own.map(str::to_owned))
        } else if Directive::ALL.iter().any(|known| known.name() == directive) {
            error.did_you_mean(Some(directive))
        } else if let Some(file) = self.library_with(&text) {
            from_library(error, &file)
        } else if let Some(help) = absent(&lower) {
            error.help(help)
        } else {
            let macros: Vec<&str> =
                self.context.scopes.macros.keys().map(|name| self.context.scopes.text(*name)).collect();
            let mut known: Vec<&str> = ROWS.iter().map(|row| row.mnemonic).chain(macros).collect();
            known[ROWS.len()..].sort_unstable();
            match alias(&lower) {
                Some(own) => error.did_you_mean(Some(own.to_owned())),
                None => error.did_you_mean_one_of(&all_nearest(&text, known)),
            }
        };
        self.context.report(at.scope, error)
    }
}

/// Adds the library file that defines the missing macro to an error.
pub(crate) fn from_library(error: Diagnostic, file: &str) -> Diagnostic {
    let line = format!(".include <{file}>");
    error.help(format!("the library defines it: `{line}`")).missing([line])
}

impl Resolver<'_> {
    /// The file of a library that defines a macro.
    pub(crate) fn library_with(&self, macro_name: &str) -> Option<String> {
        let defines = |line: &str| {
            let rest = line.trim_start().strip_prefix(".macro").unwrap_or_default();
            rest.split_whitespace().next() == Some(macro_name)
        };
        let libraries = self.loader.places().iter().filter(|place| !place.takes_quoted());
        let mut files =
            libraries.flat_map(|place| place.sources().into_iter().map(move |name| (place, name)));
        let found = files.find(|(place, name)| {
            place
                .load(name)
                .is_ok_and(|bytes| line_feeds(&String::from_utf8_lossy(&bytes)).lines().any(defines))
        });
        found.map(|(_, name)| name)
    }
}

/// The instruction that loads a word.
pub(super) fn loading() -> &'static str {
    ROWS.iter().find(|row| row.effect == Effect::Load).map_or("", |row| row.mnemonic)
}

/// Advice on instructions of other processors that Takt lacks, where a similar name may mean another operation.
fn absent(name: &str) -> Option<&'static str> {
    Some(match name {
        "fmadd" | "fmac" | "fmla" | "mac" | "madd" => "`fma` is a · b + c; a machine may lack it",
        "fmsub" | "fmls" => "`fms` is a · b - c, `fnma` is c - a · b; a machine may lack them",
        "fnmadd" | "fnmsub" => {
            "RISC-V's fnmsub is `fnma`, c - a · b, and its fnmadd is `fnms`, -(a · b) - c; a machine may lack them"
        }
        "imul" | "idiv" | "imod" | "irem" | "imin" | "imax" | "iabs" | "ineg" => {
            "integers have sums, shifts, logic and comparisons: `itof` converts, and `ishl` multiplies by a power of two"
        }
        "fgt" | "fge" | "fcmp" => "swap the operands of `flt` or `fle`",
        "igt" | "igtu" | "ige" | "ile" => {
            "`ilt` with its operands swapped, or with its result tested by `bz`"
        }
        "fne" | "ine" => "test the result of `feq` or `ieq` with `bz`",
        "beq" | "bne" | "blt" | "bgt" | "ble" | "bge" => {
            "compare with `ieq`, `ilt`, `feq` or `flt`, then `bnz` or `bz`"
        }
        "not" | "inot" => "`ixor` with -1",
        _ => return None,
    })
}

/// Mnemonics of other assemblers.
fn alias(name: &str) -> Option<&'static str> {
    Some(match name {
        "add" => "fadd",
        "sub" => "fsub",
        "mul" => "fmul",
        "div" => "fdiv",
        "sqrt" => "fsqrt",
        "sin" => "fsin",
        "cos" => "fcos",
        "atan2" => "fatan2",
        "acos" => "facos",
        "abs" => "fabs",
        "neg" => "fneg",
        "min" => "fmin",
        "max" => "fmax",
        "and" => "iand",
        "or" => "ior",
        "xor" => "ixor",
        "shl" | "sll" => "ishl",
        "shr" | "srl" => "ishr",
        "sar" | "sra" => "isar",
        "load" | "lw" => "ld",
        "store" | "sw" => "st",
        "move" | "mv" => "mov",
        "jump" | "br" | "b" | "j" => "jmp",
        "beqz" | "brz" => "bz",
        "bnez" | "brnz" => "bnz",
        "return" => "ret",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Advice must name existing instructions only.
    #[test]
    fn advice_names_instructions() {
        let known = |name: &str| ROWS.iter().any(|row| row.mnemonic == name);
        for name in ["fmadd", "fmsub", "fnmadd", "imul", "fgt", "igt", "fne", "beq", "not"] {
            assert!(!known(name));
            let help = absent(name).expect("there is advice");
            assert!(help.split('`').skip(1).step_by(2).all(known), "{help}");
        }
    }
}
