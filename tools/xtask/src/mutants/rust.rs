// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mutants of Rust sources as schemata: one text holds all of them, and each is chosen when a program starts.
//!
//! A mutant's place becomes `(if mutant(N) { the mutant } else { the original })`. So hundreds of mutants cost one compilation, where
//! cargo-mutants compiles each: of the assembler that takes half a minute, of its tests as long again.

use anyhow::{Context, Result};
use quote::ToTokens;
use std::ops::Range;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, Block, Expr, ImplItemFn, Item, ItemFn, Lit, Stmt, UnOp};

/// A change of one place.
#[derive(Clone, Debug)]
pub(super) struct Mutant {
    /// The line of the place, from 1.
    pub(super) line: usize,
    /// The place as it is, on one line.
    pub(super) from: String,
    /// The change.
    pub(super) to: String,
    /// The bytes of the place, and the text around it that makes it a choice; `#` stands for the mutant's condition.
    range: Range<usize>,
    before: String,
    after: &'static str,
}

/// All mutants of a source.
///
/// # Errors
/// If it is no Rust.
pub(super) fn mutants(source: &str) -> Result<Vec<Mutant>> {
    let file = syn::parse_file(source).context("no Rust")?;
    let mut finder = Finder { source, found: Vec::new() };
    finder.visit_file(&file);
    finder.found.sort_by_key(|mutant| (mutant.range.start, mutant.range.end));
    Ok(finder.found)
}

/// A source with mutants, each chosen by `function(number)`.
pub(super) fn planted(source: &str, mutants: &[(u32, &Mutant)], function: &str) -> String {
    // Where mutants meet, what ends comes before what begins, and the longer begins first. All ends at one place read the same.
    let mut pieces: Vec<((usize, bool, isize), String)> = Vec::new();
    for (number, mutant) in mutants {
        let Range { start, end } = mutant.range;
        let length = (end - start) as isize;
        let before = mutant.before.replace('#', &format!("{function}({number})"));
        pieces.push(((start, true, -length), before));
        pieces.push(((end, false, length), mutant.after.to_owned()));
    }
    pieces.sort_by_key(|(key, _)| *key);
    let mut text = String::with_capacity(2 * source.len());
    let mut last = 0;
    for ((at, ..), piece) in pieces {
        text += &source[last..at];
        text += &piece;
        last = at;
    }
    text + &source[last..]
}

struct Finder<'s> {
    source: &'s str,
    found: Vec<Mutant>,
}

/// Tokens as text without line ends.
fn text(tokens: &impl ToTokens) -> String {
    tokens.to_token_stream().to_string().replace('\n', " ")
}

/// True if an expression binds names for what follows, so that its parts cannot be swapped.
fn binds(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(binary) => binds(&binary.left) || binds(&binary.right),
        Expr::Paren(inner) => binds(&inner.expr),
        _ => false,
    }
}

/// True if an operand is text, to which `+` alone applies.
fn is_text(expression: &Expr) -> bool {
    match expression {
        Expr::Reference(_) | Expr::Macro(_) => true,
        Expr::Lit(literal) => matches!(literal.lit, Lit::Str(_)),
        Expr::Binary(binary) => is_text(&binary.left) || is_text(&binary.right),
        _ => false,
    }
}

/// The operators that take an operator's place.
fn instead(op: &BinOp) -> &'static [&'static str] {
    match op {
        BinOp::Lt(_) => &["<=", ">="],
        BinOp::Le(_) => &["<"],
        BinOp::Gt(_) => &[">=", "<="],
        BinOp::Ge(_) => &[">"],
        BinOp::Eq(_) => &["!="],
        BinOp::Ne(_) => &["=="],
        BinOp::And(_) => &["||"],
        BinOp::Or(_) => &["&&"],
        BinOp::Add(_) => &["-"],
        BinOp::Sub(_) => &["+"],
        BinOp::Mul(_) => &["+"],
        BinOp::Div(_) => &["*"],
        BinOp::Rem(_) => &["/"],
        BinOp::BitAnd(_) => &["|"],
        BinOp::BitOr(_) => &["&"],
        BinOp::BitXor(_) => &["|"],
        BinOp::Shl(_) => &[">>"],
        BinOp::Shr(_) => &["<<"],
        _ => &[],
    }
}

impl Finder<'_> {
    fn put(&mut self, place: &impl Spanned, from: String, to: String, before: String, after: &'static str) {
        let span = place.span();
        let range = span.byte_range();
        let line = self.source[..range.start].matches('\n').count() + 1;
        self.found.push(Mutant { line, from, to, range, before, after });
    }

    fn expression(&mut self, place: &Expr, to: String) {
        let before = format!("(if # {{ {to} }} else {{ ");
        self.put(place, text(place), to, before, " })");
    }

    fn binary(&mut self, place: &Expr, binary: &syn::ExprBinary) {
        if binds(place) {
            return;
        }
        if matches!(binary.op, BinOp::Add(_)) && (is_text(&binary.left) || is_text(&binary.right)) {
            return;
        }
        for op in instead(&binary.op) {
            let swapped = format!("({}) {op} ({})", text(&binary.left), text(&binary.right));
            self.expression(place, swapped);
        }
    }

    fn statement(&mut self, statement: &Stmt, expression: &Expr) {
        let is_effect = match expression {
            Expr::Assign(_) | Expr::MethodCall(_) => true,
            Expr::Binary(binary) => matches!(
                binary.op,
                BinOp::AddAssign(_)
                    | BinOp::SubAssign(_)
                    | BinOp::BitAndAssign(_)
                    | BinOp::BitOrAssign(_)
                    | BinOp::MulAssign(_)
                    | BinOp::ShlAssign(_)
                    | BinOp::ShrAssign(_)
            ),
            _ => false,
        };
        if is_effect {
            self.put(statement, text(expression), "left out".to_owned(), "if !# { ".to_owned(), " }");
        }
    }
}

/// True if an item is compiled for tests only.
fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let text = text(attribute);
        text.contains("cfg (test)") || text.contains("test]") || text.contains("# [test")
    })
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        match item {
            // Constants are evaluated by the compiler, which cannot choose.
            Item::Const(_) | Item::Static(_) | Item::Enum(_) | Item::Struct(_) | Item::Macro(_) => {}
            Item::Mod(module) if is_test(&module.attrs) => {}
            _ => visit::visit_item(self, item),
        }
    }

    fn visit_item_fn(&mut self, function: &'ast ItemFn) {
        if function.sig.constness.is_none() && !is_test(&function.attrs) {
            visit::visit_block(self, &function.block);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'ast ImplItemFn) {
        // What an error says and how a value looks in a message is no behaviour of which a test's verdict should depend.
        let shows = function.sig.ident == "fmt";
        if function.sig.constness.is_none() && !is_test(&function.attrs) && !shows {
            visit::visit_block(self, &function.block);
        }
    }

    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}

    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}

    fn visit_type(&mut self, _: &'ast syn::Type) {}

    fn visit_pat(&mut self, _: &'ast syn::Pat) {}

    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}

    fn visit_expr_repeat(&mut self, repeat: &'ast syn::ExprRepeat) {
        self.visit_expr(&repeat.expr);
    }

    fn visit_block(&mut self, block: &'ast Block) {
        for statement in &block.stmts {
            if let Stmt::Expr(expression, Some(_)) = statement {
                self.statement(statement, expression);
            }
        }
        visit::visit_block(self, block);
    }

    fn visit_expr(&mut self, expression: &'ast Expr) {
        match expression {
            Expr::Binary(binary) => self.binary(expression, binary),
            Expr::Unary(unary) if matches!(unary.op, UnOp::Not(_)) => {
                self.expression(expression, text(&unary.expr));
            }
            Expr::Lit(literal) => {
                if let Lit::Int(number) = &literal.lit
                    && let Ok(value) = number.base10_parse::<u64>()
                    && value < 1 << 16
                {
                    let to = format!("{}{}", value + 1, number.suffix());
                    self.expression(expression, to);
                }
            }
            Expr::MethodCall(call) => {
                let other = match call.method.to_string().as_str() {
                    "min" => "max",
                    "max" => "min",
                    "any" => "all",
                    "all" => "any",
                    "is_some" => "is_none",
                    "is_none" => "is_some",
                    _ => "",
                };
                if !other.is_empty() {
                    let arguments = text(&call.args);
                    self.expression(expression, format!("({}).{other}({arguments})", text(&call.receiver)));
                }
            }
            Expr::If(chosen)
                if !binds(&chosen.cond) && !matches!(*chosen.cond, Expr::Binary(_) | Expr::Unary(_)) =>
            {
                let to = format!("!({})", text(&chosen.cond));
                self.expression(&chosen.cond, to);
            }
            _ => {}
        }
        visit::visit_expr(self, expression);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_place_is_a_choice() {
        let source = "fn f(a: u32, b: bool) -> u32 {\n    let mut x = a + 1;\n    if !b && a < 7 { x += 2; }\n    x\n}\n";
        let found = mutants(source).unwrap();
        let texts: Vec<String> =
            found.iter().map(|mutant| format!("{} -> {}", mutant.from, mutant.to)).collect();
        for wanted in
            ["a + 1 -> (a) - (1)", "1 -> 2", "! b -> b", "a < 7 -> (a) <= (7)", "x += 2 -> left out"]
        {
            assert!(texts.iter().any(|text| text == wanted), "{wanted} is not among {texts:?}");
        }
        let numbered: Vec<_> = (1..).zip(&found).collect();
        let all = planted(source, &numbered, "mutant");
        syn::parse_file(&all).unwrap_or_else(|error| panic!("{error}: {all}"));
        // Lines stay where they are, so that a place that does not compile is known.
        assert_eq!(all.matches('\n').count(), source.matches('\n').count());
        assert_eq!(all.matches("mutant(").count(), found.len());
    }

    #[test]
    fn constants_tests_and_bindings_are_left_alone() {
        let source = "const A: u32 = 1 + 2;\nconst fn g() -> u32 { 1 + 1 }\n#[cfg(test)]\nmod t { fn f() -> u32 { 1 + 1 } }\n\
                      fn h(a: Option<u32>) { if let Some(b) = a && let Some(c) = a {} }";
        assert!(mutants(source).unwrap().is_empty());
    }
}
