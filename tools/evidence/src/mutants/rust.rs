// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mutant schemata for Rust sources: one source contains all mutants, and a program selects one at its start.
//!
//! A mutated place becomes `(if mutant(N) { the mutant } else { the original })`. Hundreds of mutants thus need one compilation.
//! cargo-mutants compiles each mutant, which takes half a minute for the assembler and another half for its tests.

use anyhow::{Context, Result};
use quote::ToTokens;
use std::collections::BTreeMap;
use std::ops::Range;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, Block, Expr, ImplItemFn, Item, ItemFn, Lit, Stmt, UnOp};

/// A change at one place in a source.
#[derive(Clone, Debug)]
pub(super) struct Mutant {
    /// Path of the function within the file, such as `Interval::new` or `Add for Interval::add`.
    function: String,
    /// Kind of the change, such as `< → <=`.
    operator: String,
    /// Number among the function's mutants with this operator, from 1, in source order.
    ordinal: usize,
    /// Line number of the place, from 1.
    pub(super) line: usize,
    /// Original text, joined to one line.
    pub(super) from: String,
    /// Replacement text.
    pub(super) to: String,
    /// Byte range of the place, and the template of the choice around it, in which `#` stands for the mutant's condition.
    range: Range<usize>,
    before: String,
    after: String,
}

impl Mutant {
    /// Key of a mutant in a file: stable under reformatting, renamed variables, and changes of other functions.
    pub(super) fn key(&self, file: &str) -> String {
        format!("{file} {}: {} #{}", self.function, self.operator, self.ordinal)
    }

    /// The change as text.
    pub(super) fn change(&self) -> String {
        format!("{} → {}", self.from, self.to)
    }
}

/// Finds all mutants of a source.
///
/// # Errors
/// If the source cannot be parsed.
pub(super) fn mutants(source: &str) -> Result<Vec<Mutant>> {
    let file = syn::parse_file(source).context("no Rust")?;
    let mut finder = Finder { source, path: Vec::new(), found: Vec::new() };
    finder.visit_file(&file);
    finder.found.sort_by_key(|mutant| (mutant.range.start, mutant.range.end));
    let mut counts: BTreeMap<(String, String), usize> = BTreeMap::new();
    for mutant in &mut finder.found {
        let count = counts.entry((mutant.function.clone(), mutant.operator.clone())).or_default();
        *count += 1;
        mutant.ordinal = *count;
    }
    Ok(finder.found)
}

/// Plants mutants in a source; `function(number)` selects one.
pub(super) fn planted(source: &str, mutants: &[(u32, &Mutant)], function: &str) -> String {
    // At equal positions, ends sort before begins, and the longer range begins first. All ends at one position have the same text.
    let mut pieces: Vec<((usize, bool, isize), String)> = Vec::new();
    for (number, mutant) in mutants {
        let Range { start, end } = mutant.range;
        let length = (end - start) as isize;
        let before = mutant.before.replace('#', &format!("{function}({number})"));
        pieces.push(((start, true, -length), before));
        pieces.push(((end, false, length), mutant.after.clone()));
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
    /// Modules, types and functions that enclose the current place.
    path: Vec<String>,
    found: Vec<Mutant>,
}

/// Tokens as text without line breaks.
fn text(tokens: &impl ToTokens) -> String {
    tokens.to_token_stream().to_string().replace('\n', " ")
}

/// Name of a type or trait in a function's path: its last segment, without generic arguments.
fn last_name(path: &syn::Path) -> String {
    path.segments.last().map(|segment| segment.ident.to_string()).unwrap_or_default()
}

/// The expression binds names for later parts, so that its operands cannot be swapped.
fn binds(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(binary) => binds(&binary.left) || binds(&binary.right),
        Expr::Paren(inner) => binds(&inner.expr),
        _ => false,
    }
}

/// The operand is text, for which only `+` is defined.
fn is_text(expression: &Expr) -> bool {
    match expression {
        Expr::Reference(_) | Expr::Macro(_) => true,
        Expr::Lit(literal) => matches!(literal.lit, Lit::Str(_)),
        Expr::Binary(binary) => is_text(&binary.left) || is_text(&binary.right),
        _ => false,
    }
}

/// Replacements of an operator.
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
    fn put(
        &mut self,
        place: &impl Spanned,
        operator: &str,
        [from, to]: [String; 2],
        [before, after]: [&str; 2],
    ) {
        let range = place.span().byte_range();
        let line = self.source[..range.start].matches('\n').count() + 1;
        self.found.push(Mutant {
            function: self.path.join("::"),
            operator: operator.to_owned(),
            // Assigned once all mutants are found.
            ordinal: 0,
            line,
            from,
            to,
            range,
            before: before.to_owned(),
            after: after.to_owned(),
        });
    }

    fn expression(&mut self, place: &Expr, operator: &str, to: String) {
        let before = format!("(if # {{ {to} }} else {{ ");
        self.put(place, operator, [text(place), to], [&before, " })"]);
    }

    /// Visits the contents of an item that adds `name` to the path.
    fn within(&mut self, name: String, visit: impl FnOnce(&mut Self)) {
        self.path.push(name);
        visit(self);
        self.path.pop();
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
            self.expression(place, &format!("{} → {op}", text(&binary.op)), swapped);
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
            let texts = [text(expression), "left out".to_owned()];
            self.put(statement, "statement left out", texts, ["if !# { ", " }"]);
        }
    }
}

/// The item is compiled only for tests.
fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let text = text(attribute);
        text.contains("cfg (test)") || text.contains("test]") || text.contains("# [test")
    })
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        match item {
            // Constants are evaluated at compile time, where no selection is possible.
            Item::Const(_) | Item::Static(_) | Item::Enum(_) | Item::Struct(_) | Item::Macro(_) => {}
            Item::Mod(module) if is_test(&module.attrs) => {}
            _ => visit::visit_item(self, item),
        }
    }

    fn visit_item_fn(&mut self, function: &'ast ItemFn) {
        if function.sig.constness.is_none() && !is_test(&function.attrs) {
            self.within(function.sig.ident.to_string(), |own| own.visit_block(&function.block));
        }
    }

    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        self.within(module.ident.to_string(), |own| visit::visit_item_mod(own, module));
    }

    fn visit_item_trait(&mut self, item: &'ast syn::ItemTrait) {
        self.within(item.ident.to_string(), |own| visit::visit_item_trait(own, item));
    }

    fn visit_trait_item_fn(&mut self, function: &'ast syn::TraitItemFn) {
        if let Some(block) = &function.default {
            self.within(function.sig.ident.to_string(), |own| own.visit_block(block));
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        let mut own = &*item.self_ty;
        while let syn::Type::Reference(reference) = own {
            own = &reference.elem;
        }
        let own = match own {
            syn::Type::Path(path) => last_name(&path.path),
            other => text(other),
        };
        let name = match &item.trait_ {
            Some((_, path, _)) => format!("{} for {own}", last_name(path)),
            None => own,
        };
        self.within(name, |own| visit::visit_item_impl(own, item));
    }

    fn visit_impl_item_fn(&mut self, function: &'ast ImplItemFn) {
        // Leave out error texts and formatting: no test's verdict should depend on them.
        let shows = function.sig.ident == "fmt";
        if function.sig.constness.is_none() && !is_test(&function.attrs) && !shows {
            self.within(function.sig.ident.to_string(), |own| own.visit_block(&function.block));
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
                self.expression(expression, "! left out", text(&unary.expr));
            }
            Expr::Lit(literal) => {
                if let Lit::Int(number) = &literal.lit
                    && let Ok(value) = number.base10_parse::<u64>()
                    && value < 1 << 16
                {
                    let to = format!("{}{}", value + 1, number.suffix());
                    self.expression(expression, &format!("{value} → {}", value + 1), to);
                }
            }
            Expr::MethodCall(call) => {
                let method = call.method.to_string();
                let other = match method.as_str() {
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
                    let to = format!("({}).{other}({arguments})", text(&call.receiver));
                    self.expression(expression, &format!("{method} → {other}"), to);
                }
            }
            Expr::If(chosen)
                if !binds(&chosen.cond) && !matches!(*chosen.cond, Expr::Binary(_) | Expr::Unary(_)) =>
            {
                let to = format!("!({})", text(&chosen.cond));
                self.expression(&chosen.cond, "condition negated", to);
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
        let texts: Vec<String> = found.iter().map(Mutant::change).collect();
        for wanted in ["a + 1 → (a) - (1)", "1 → 2", "! b → b", "a < 7 → (a) <= (7)", "x += 2 → left out"]
        {
            assert!(texts.iter().any(|text| text == wanted), "{wanted} is not among {texts:?}");
        }
        let numbered: Vec<_> = (1..).zip(&found).collect();
        let all = planted(source, &numbered, "mutant");
        syn::parse_file(&all).unwrap_or_else(|error| panic!("{error}: {all}"));
        // Line numbers are preserved, so that compiler errors identify their mutants.
        assert_eq!(all.matches('\n').count(), source.matches('\n').count());
        assert_eq!(all.matches("mutant(").count(), found.len());
    }

    #[test]
    fn constants_tests_and_bindings_are_left_alone() {
        let source = "const A: u32 = 1 + 2;\nconst fn g() -> u32 { 1 + 1 }\n#[cfg(test)]\nmod t { fn f() -> u32 { 1 + 1 } }\n\
                      fn h(a: Option<u32>) { if let Some(b) = a && let Some(c) = a {} }";
        assert!(mutants(source).unwrap().is_empty());
    }

    /// Keys of the mutants whose description begins with `change`.
    fn keys(source: &str, change: &str) -> Vec<String> {
        let all = mutants(source).unwrap();
        all.iter()
            .filter(|mutant| mutant.change().starts_with(change))
            .map(|mutant| mutant.key("a.rs"))
            .collect()
    }

    #[test]
    fn keys_name_function_operator_and_ordinal() {
        let source = "fn f(a: u32) -> bool { a < 1 || a < 9 }
mod m { impl Set<u8> { fn f(&self) -> bool { fn inner() -> bool { 2 < 3 } self.any(|x| x < 4) } } }
impl Add for &Set<u8> { fn add(self) -> u32 { if self.is_odd() { self.min(5) } else { 6 } } }
trait T { fn g() -> u32 { 7 } }";
        let key = |change| keys(source, change).join(", ");
        assert_eq!(key("a < 1 → (a) <="), "a.rs f: < → <= #1");
        assert_eq!(key("a < 9 → (a) <="), "a.rs f: < → <= #2");
        assert_eq!(key("2 < 3 → (2) >="), "a.rs m::Set::f::inner: < → >= #1");
        assert_eq!(key("x < 4 → (x) <="), "a.rs m::Set::f: < → <= #1");
        assert_eq!(key("self . min (5) → "), "a.rs Add for Set::add: min → max #1");
        assert_eq!(key("self . is_odd"), "a.rs Add for Set::add: condition negated #1");
        assert_eq!(key("7 → 8"), "a.rs T::g: 7 → 8 #1");
        let all: Vec<String> = mutants(source).unwrap().iter().map(|mutant| mutant.key("a.rs")).collect();
        let unique: std::collections::BTreeSet<&String> = all.iter().collect();
        assert_eq!(unique.len(), all.len(), "{all:?}");
    }

    #[test]
    fn keys_outlast_a_reformat_and_lines_elsewhere() {
        let source = "fn f(a: u32) -> bool { a < 1 || g(a) < 9 }\nfn g(a: u32) -> u32 { a + 1 }\n";
        let reformatted = "fn f(\n    value: u32,\n) -> bool {\n    value < 1\n        || g(value) < 9\n}\n\nfn g(a: u32) -> u32 {\n    a + 1\n}\n";
        let longer = "fn h() -> u32 { 1 + 1 }\nfn f(a: u32) -> bool { a < 1 || g(a) < 9 }\nfn g(a: u32) -> u32 { let b = 3 < 4; a + 1 }\n";
        let own = |source: &str| -> Vec<String> {
            keys(source, "").into_iter().filter(|key| key.starts_with("a.rs f: ")).collect()
        };
        assert_eq!(own(source).len(), 7);
        assert_eq!(own(reformatted), own(source));
        assert_eq!(own(longer), own(source));
    }
}
