// SPDX-License-Identifier: MIT OR Apache-2.0
//! Grammar rules: syntax of lines as in `takt_asm`, and the blocks that lines form.
//!
//! tree-sitter's lexer tries only tokens that are valid at a place, while the assembler's takes the longest of all tokens. Where the two
//! differ, the longer token is declared valid, but followed by a token that never matches ([`NEVER`]).

use super::build::*;
use takt_asm::{Directive, Operator};

/// Kind of line. Each kind has its own syntax of expressions.
#[derive(Clone, Copy, PartialEq, Eq)]
enum In {
    /// Operations and directives, in which a bracket after an expression opens a memory operand.
    Line,
    /// Equations, in which a bracket after a name opens an array index.
    Equation,
}

impl In {
    /// Name of a rule for this kind of line.
    fn name(self, rule: &str) -> String {
        match self {
            In::Line => format!("_line_{rule}"),
            In::Equation => format!("_equation_{rule}"),
        }
    }

    /// Rule for this kind of line, with the node name that both kinds share.
    fn node(self, rule: &str) -> Rule {
        alias(symbol(self.name(rule)), rule)
    }

    fn expression(self) -> Rule {
        symbol(self.name("expression"))
    }

    /// A name, with or without braces. Inlined, so that a plain name is the same symbol in both kinds of line.
    fn any_name(self) -> Rule {
        choice([symbol("identifier"), self.node("template")])
    }
}

/// Token that never matches: all letters and digits, followed by one more digit.
const NEVER: &str = "_never";

const NEWLINE: &str = "_newline";

/// Conflicts: pairs of rules that only a later token distinguishes.
pub(super) fn conflicts() -> Vec<Vec<String>> {
    let both = |rule: &str| vec![In::Line.name(rule), In::Equation.name(rule)];
    vec![
        // A line that begins with `p[i` or `l{i` may be an equation or an operation.
        both("atom"),
        both("call"),
        // `t[b` starts an array element, or an offset with a register.
        vec!["_line_element".into(), "_line_atom".into()],
    ]
}

/// Rules that are inlined where they are used.
pub(super) fn inlined() -> Vec<String> {
    vec!["_label".into()]
}

/// All rules; the first is the start symbol.
pub(super) fn rules() -> Vec<(String, Rule)> {
    let mut rules =
        vec![("source_file".to_owned(), seq([optional(symbol("_lines")), optional(symbol("_line"))]))];
    let mut add = |name: &str, rule: Rule| rules.push((name.to_owned(), rule));
    lines(&mut add);
    for (directive, rule) in
        Directive::ALL.iter().filter_map(|directive| Some((directive, operands(*directive)?)))
    {
        add(&directive_rule(*directive), seq([text(directive.name()), rule]));
    }
    operations(&mut add);
    expressions(In::Line, &mut add);
    expressions(In::Equation, &mut add);
    tokens(&mut add);
    rules
}

/// Name of a directive's rule, such as `loop_bound_directive`.
fn directive_rule(directive: Directive) -> String {
    format!("{}_directive", &directive.name()[1..])
}

/// Operands of a directive that has its own rule. Directives that open, divide or close a block have none, nor has `.raw`, which occurs
/// in bundles.
fn operands(directive: Directive) -> Option<Rule> {
    use Directive::*;
    let expression = || In::Line.expression();
    let name = || In::Line.any_name();
    let named = || field("name", name());
    let assigned = || seq([text("="), field("value", expression())]);
    let indices = || seq([text("["), commas(field("index", expression())), text("]")]);
    Some(match directive {
        Once | Period | Data => blank(),
        Reg | State | Input | Output => blanks(symbol("declaration")),
        Machine => seq([
            choice([named(), field("file", symbol("text"))]),
            repeat(seq([optional(text(",")), field("option", name()), assigned()])),
        ]),
        Array => seq([
            blanks(symbol("declaration")),
            optional(seq([
                text("="),
                choice([field("file", symbol("text")), commas(field("value", expression()))]),
            ])),
        ]),
        Const => seq([named(), assigned()]),
        Param => seq([
            symbol("declaration"),
            text("="),
            commas(expression()),
            optional(seq([
                field("option", name()),
                choice([
                    seq([field("least", expression()), text(".."), field("largest", expression())]),
                    // `-1..1`, `0..2*pi`: no blank before `..`.
                    seq([
                        optional(text("-")),
                        symbol("range_ends"),
                        optional(field("largest", expression())),
                    ]),
                ]),
            ])),
        ]),
        Preset => seq([optional(text("@")), named(), optional(indices()), assigned()]),
        Float | Word => commas(expression()),
        Space => expression(),
        LoopBound => seq([expression(), optional(seq([field("option", name()), expression()]))]),
        Include => choice([
            symbol("text"),
            symbol("library"),
            // `<<` and `<=` are operators, and do not start the name of a library file.
            seq([choice([Operator::Shl, Operator::Le].map(|operator| text(operator.text()))), symbol(NEVER)]),
        ]),
        Error => symbol("text"),
        Loc => separated(symbol("_bars"), choice([symbol("location"), name()])),
        Schedule | Contract | Ports => name(),
        Fast | Order | Result => blanks(name()),
        Deadline => seq([blanks(name()), assigned()]),
        Range => seq([
            optional(text("@")),
            blanks(seq([named(), optional(indices())])),
            text("="),
            field("least", expression()),
            text(","),
            field("largest", expression()),
        ]),
        Assume => seq([
            named(),
            optional(indices()),
            choice([Operator::Ge, Operator::Le].map(|operator| text(operator.text()))),
            expression(),
        ]),
        Late => seq([blanks(name()), optional(assigned())]),
        Macro | EndMacro | Rep | EndRep | For | EndFor | If | Elif | Else | EndIf | Raw => return None,
    })
}

/// Lines, and the blocks that they form.
fn lines(add: &mut impl FnMut(&str, Rule)) {
    // Macros are defined at top level or in branches; the bodies of macros and repetitions have rules without them.
    conditionals(add, "", true);
    conditionals(add, "_within", false);
    definitions(add);
    let directives = Directive::ALL.iter().filter(|directive| operands(**directive).is_some());
    let directives = directives.map(|directive| symbol(directive_rule(*directive)));
    let body = choice(std::iter::once(symbol("bundle")).chain(directives));
    let label = choice([symbol("label"), In::Equation.node("label")]);
    add(
        "_plain_line",
        choice([
            symbol("_label"),
            seq([optional(symbol("_label")), body]),
            seq([optional(label), symbol("equation")]),
        ]),
    );
    // A label without braces is the same symbol before either kind of line.
    add("_label", choice([symbol("label"), In::Line.node("label")]));
    add("label", seq([field("name", symbol("identifier")), text(":")]));
    for kind in [In::Line, In::Equation] {
        add(&kind.name("label"), seq([field("name", kind.node("template")), text(":")]));
    }
}

/// Lines with blocks, bodies, and conditionals; the suffix belongs to the names of their rules.
fn conditionals(add: &mut impl FnMut(&str, Rule), suffix: &str, macros: bool) {
    let expression = || In::Line.expression();
    let rule = |name: &str| format!("{name}{suffix}");
    let mut blocks = vec!["_conditional", "_repetition", "_counted_loop"];
    blocks.extend(macros.then_some("_macro"));
    let block = blocks.into_iter().map(|name| {
        let rule = if name == "_conditional" { rule(name) } else { name.to_owned() };
        let shown = match name {
            "_macro" => "macro_definition",
            _ => &name[1..],
        };
        alias(symbol(rule), shown)
    });
    add(&rule("_line"), choice([symbol("_plain_line"), seq([optional(symbol("_label")), choice(block)])]));
    add(&rule("_lines"), repeat1(choice([symbol(NEWLINE), seq([symbol(rule("_line")), symbol(NEWLINE)])])));
    // Lines of a block; a label may precede the closing directive.
    let lines = symbol(rule("_lines"));
    add(&rule("_body"), choice([seq([lines, optional(symbol("_label"))]), symbol("_label")]));
    let body = || optional(alias(symbol(rule("_body")), "body"));
    let branch = |directive: Directive, condition: Option<Rule>| match condition {
        Some(condition) => {
            seq([text(directive.name()), field("condition", condition), symbol(NEWLINE), body()])
        }
        None => seq([text(directive.name()), symbol(NEWLINE), body()]),
    };
    add(&rule("_elif"), branch(Directive::Elif, Some(expression())));
    add(&rule("_else"), branch(Directive::Else, None));
    add(
        &rule("_conditional"),
        seq([
            branch(Directive::If, Some(expression())),
            repeat(alias(symbol(rule("_elif")), "elif_clause")),
            optional(alias(symbol(rule("_else")), "else_clause")),
            text(Directive::EndIf.name()),
        ]),
    );
}

/// Macros, repetitions and counted loops.
fn definitions(add: &mut impl FnMut(&str, Rule)) {
    let expression = || In::Line.expression();
    let body = || optional(alias(symbol("_body_within"), "body"));
    let name = |role: &str| field(role, In::Line.any_name());
    add(
        "_macro",
        seq([
            text(Directive::Macro.name()),
            name("name"),
            repeat(seq([optional(text(",")), name("parameter"), optional(seq([text(":"), name("type")]))])),
            symbol(NEWLINE),
            body(),
            text(Directive::EndMacro.name()),
        ]),
    );
    add(
        "_repetition",
        seq([
            text(Directive::Rep.name()),
            name("variable"),
            text(","),
            field("first", expression()),
            text(","),
            field("last", expression()),
            symbol(NEWLINE),
            body(),
            text(Directive::EndRep.name()),
        ]),
    );
    let option = seq([field("option", In::Line.any_name()), expression()]);
    add(
        "_counted_loop",
        seq([
            text(Directive::For.name()),
            name("variable"),
            text(","),
            field("first", expression()),
            text(","),
            field("last", expression()),
            repeat(option),
            symbol(NEWLINE),
            body(),
            text(Directive::EndFor.name()),
        ]),
    );
}

/// Bundles, equations, and the parts of directives.
fn operations(add: &mut impl FnMut(&str, Rule)) {
    let (line, equation) = (In::Line, In::Equation);
    let name = || line.any_name();
    // `.rawx`, or `.raw` joined to a name, is not a directive; the same holds for every directive.
    let unknown = seq([symbol("directive_name"), symbol(NEVER)]);
    let operation = choice([symbol("operation"), symbol("raw_operation"), unknown]);
    add("bundle", separated(symbol("_bars"), operation));
    // A line that ends in `||` continues on the next line.
    add("_bars", seq([text("||"), repeat(symbol(NEWLINE))]));
    let operand = || symbol("_operand");
    add("operation", seq([field("mnemonic", name()), optional(commas(field("operand", operand())))]));
    add(
        "raw_operation",
        seq([text(Directive::Raw.name()), field("slot", name()), field("word", line.expression())]),
    );
    let cast = |of: Rule| seq([of, text(":"), field("type", name())]);
    let operand = || choice([line.node("place"), symbol("memory"), line.node("element"), line.expression()]);
    add("_operand", choice([operand(), symbol("cast")]));
    add("cast", cast(operand()));
    let base = || choice([line.node("place"), line.expression()]);
    add(
        "memory",
        seq([
            optional(field("offset", line.expression())),
            text("["),
            field("base", choice([base(), alias(symbol("_base_cast"), "cast")])),
            text("]"),
        ]),
    );
    add("_base_cast", cast(base()));
    // A memory operand takes precedence over an array element with one index.
    add(
        &line.name("element"),
        seq([
            field("array", name()),
            text("["),
            line.expression(),
            text(","),
            commas(line.expression()),
            text("]"),
        ]),
    );
    for kind in [line, equation] {
        add(&kind.name("place"), seq([text("@"), kind.any_name()]));
    }
    let target = choice([equation.node("place"), equation.node("element"), equation.any_name()]);
    add(
        "equation",
        seq([commas(field("target", target)), text("="), commas(field("value", equation.expression()))]),
    );
    let sizes = seq([text("["), commas(field("size", line.expression())), text("]")]);
    add(
        "declaration",
        seq([
            field("name", name()),
            optional(sizes),
            optional(seq([text(":"), field("type", name())])),
            optional(seq([text("@"), field("place", line.expression())])),
        ]),
    );
    let columns = seq([text("["), line.expression(), text(","), line.expression(), text("]")]);
    add(
        "location",
        seq([field("file", symbol("text")), field("line", line.expression()), optional(columns)]),
    );
}

/// Rules for expressions in one kind of line.
fn expressions(kind: In, add: &mut impl FnMut(&str, Rule)) {
    let expression = || kind.expression();
    add(
        &kind.name("expression"),
        choice(
            ["unary", "binary", "choice"]
                .map(|rule| kind.node(rule))
                .into_iter()
                .chain([symbol(kind.name("atom"))]),
        ),
    );
    let mut atoms = vec![symbol("number"), kind.any_name(), kind.node("call"), kind.node("parenthesized")];
    atoms.push(symbol(NEVER));
    if kind == In::Equation {
        atoms.push(kind.node("element"));
        add(
            &kind.name("element"),
            seq([field("array", kind.any_name()), text("["), commas(symbol("_index")), text("]")]),
        );
        let several = seq([field("first", expression()), text(":"), field("last", expression())]);
        add("_index", choice([expression(), alias(symbol("_slice"), "slice")]));
        add("_slice", choice([text(":"), several]));
    }
    add(&kind.name("atom"), choice(atoms));
    add(&kind.name("parenthesized"), seq([text("("), expression(), text(")")]));
    add(
        &kind.name("call"),
        seq([field("function", symbol("identifier")), text("("), optional(commas(expression())), text(")")]),
    );
    // Precedence ascends from the conditional over binary to unary operators; only the power operator binds tighter.
    let operator = |operator: &Operator| field("operator", text(operator.text()));
    let highest = Operator::Power.precedence();
    add(
        &kind.name("choice"),
        right(
            0,
            seq([
                field("condition", expression()),
                text("?"),
                field("then", expression()),
                text(":"),
                field("else", expression()),
            ]),
        ),
    );
    let prefixes = Operator::ALL.iter().filter(|operator| operator.is_prefix());
    add(
        &kind.name("unary"),
        right(highest - 1, seq([choice(prefixes.map(operator)), field("operand", expression())])),
    );
    let infixes = Operator::ALL.iter().filter(|operator| operator.precedence() > 0);
    add(
        &kind.name("binary"),
        choice(infixes.map(|infix| {
            let parts = seq([field("left", expression()), operator(infix), field("right", expression())]);
            let associate = if *infix == Operator::Power { right } else { left };
            associate(infix.precedence(), parts)
        })),
    );
    let part = |begin: &str| seq([symbol(begin), expression()]);
    add(
        &kind.name("template"),
        seq([part("template_begin"), repeat(part("template_middle")), symbol("template_end")]),
    );
}

/// Tokens of the assembler's lexer.
fn tokens(add: &mut impl FnMut(&str, Rule)) {
    let operators = || Operator::ALL.iter().map(|operator| text(operator.text()));
    // The name of a library file may contain any of these tokens.
    let tokens = ["identifier", "number", "text", "template_begin", "template_middle", "template_end"];
    let tokens = tokens.into_iter().chain(["directive_name"]).map(|token| alias(symbol(token), "path"));
    let signs = [",", ":", "(", ")", "[", "]", "@", "=", "?"].map(text);
    let closing = Operator::Gt.text();
    let operators = operators().filter(|operator| *operator != text(closing));
    let slashes = seq([pattern("//"), symbol(NEVER)]);
    let part = choice(tokens.chain(signs).chain(operators).chain([symbol("_bars"), symbol(NEVER), slashes]));
    add("library", seq([text(Operator::Lt.text()), repeat1(part), text(closing)]));

    add(NEWLINE, pattern("\\r?\\n|\\r"));
    add("comment", pattern(";[^\\r\\n]*"));
    add("text", pattern("\"([^\"\\\\\\r\\n]|\\\\[^\\r\\n])*\""));
    add("directive_name", pattern("\\.[A-Za-z_][A-Za-z0-9_]*"));
    // The start of a parameter's range up to `..`, a number or a name, and what is behind it; before `identifier`, which matches as much.
    add("range_ends", pattern("[0-9A-Za-z_.]+\\.\\.[0-9A-Za-z_.]*"));
    add("identifier", pattern("[A-Za-z_][A-Za-z0-9_.]*"));
    add("template_begin", pattern("([A-Za-z_][A-Za-z0-9_.]*)?\\{"));
    add("template_middle", pattern("\\}[A-Za-z0-9_.]*\\{"));
    add("template_end", pattern("\\}[A-Za-z0-9_.]*"));
    let exponent = "[eE][+-]?[0-9]+";
    let (digit, digits) = ("[0-9A-Fa-f]", "[0-9A-Fa-f_]*");
    add(
        "number",
        pattern(
            &[
                "[0-9][0-9_]*".to_owned(),
                format!("[0-9][0-9_]*\\.[0-9_]*({exponent})?"),
                format!("[0-9][0-9_]*{exponent}"),
                format!("\\.[0-9][0-9_]*({exponent})?"),
                // At least one digit, with any number of separators.
                format!("0[xX]_*{digit}{digits}"),
                "0[bB]_*[01][01_]*".to_owned(),
                format!("0[xX]_*({digit}{digits}(\\.{digits})?|\\._*{digit}{digits})[pP][+-]?[0-9]+"),
            ]
            .join("|"),
        ),
    );
    // Declared after `number`, which takes precedence if lengths are equal.
    add("_no_number", pattern("[0-9][0-9A-Za-z_.]*"));
    add(NEVER, seq([symbol("_no_number"), immediate(pattern("[0-9]"))]));
}
