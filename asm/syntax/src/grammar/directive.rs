// SPDX-License-Identifier: MIT OR Apache-2.0
//! The grammar of directives.

use super::expected::ExpectedItem;
use super::{Body, Builder, Extra, Rule, Tokens, indices, rule};
use crate::ast::*;
use crate::lex::Token;
use chumsky::prelude::*;

/// The parser of a directive with its operands.
pub(super) fn directive<'t, 'a: 't>(
    name: Rule<'t, 'a, Name>,
    expr: Rule<'t, 'a, Expr>,
    expression: Rule<'t, 'a, ()>,
) -> Rule<'t, 'a, Body> {
    let bare = select! {
        Token::Directive(Directive::Once) => DirectiveKind::Section(Section::Once),
        Token::Directive(Directive::Period) => DirectiveKind::Section(Section::Period),
        Token::Directive(Directive::Data) => DirectiveKind::Section(Section::Data),
        Token::Directive(Directive::EndMacro) => DirectiveKind::End(Directive::EndMacro),
        Token::Directive(Directive::EndRep) => DirectiveKind::End(Directive::EndRep),
        Token::Directive(Directive::EndFor) => DirectiveKind::End(Directive::EndFor),
        Token::Directive(Directive::EndIf) => DirectiveKind::End(Directive::EndIf),
        Token::Directive(Directive::Else) => DirectiveKind::Else(0),
    };
    let parts = Parts::new(name, expr, expression);
    let mut kinds = vec![rule(bare)];
    kinds.extend(parts.declarations());
    kinds.extend(parts.blocks());
    kinds.extend(parts.sources());
    kinds.extend(parts.modes());
    kinds.extend(parts.demands());
    rule(choice(kinds).map_with(|kind, e| Body::Directive(kind, e.span())))
}

fn comma<'t, 'a: 't>() -> impl Parser<'t, Tokens<'t>, Token, Extra<'a>> + Clone {
    just(Token::Comma).labelled(ExpectedItem::Comma)
}

fn is<'t, 'a: 't>(directive: Directive) -> impl Parser<'t, Tokens<'t>, Token, Extra<'a>> + Clone {
    just(Token::Directive(directive))
}

/// Rules that directives share.
struct Parts<'t, 'a> {
    name: Rule<'t, 'a, Name>,
    expr: Rule<'t, 'a, Expr>,
    text: Rule<'t, 'a, String>,
    /// Expressions separated by commas.
    values: Rule<'t, 'a, Vec<Expr>>,
    assigned: Rule<'t, 'a, (Name, Expr)>,
    register: Rule<'t, 'a, Operand>,
    /// Names after a first one, separated by blanks or commas.
    more: Rule<'t, 'a, Vec<Name>>,
}

impl<'t, 'a: 't> Parts<'t, 'a> {
    fn new(name: Rule<'t, 'a, Name>, expr: Rule<'t, 'a, Expr>, expression: Rule<'t, 'a, ()>) -> Self {
        let text = rule(select! { Token::Text => () }.labelled(ExpectedItem::Text).map_with(|(), e| {
            let span = e.span();
            (e.state() as &mut Builder<'a>).quoted(span)
        }));
        let values = rule(expr.clone().separated_by(comma()).at_least(1).collect::<Vec<_>>());
        let assigned =
            name.clone().then_ignore(just(Token::Assign).labelled(ExpectedItem::Assign)).then(expr.clone());
        let assigned = rule(assigned);
        // A register by its name, or an element of an array.
        let register = name.clone().then(indices(expression, 1).or_not()).map_with(|(name, starts), e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            let kind = match starts {
                Some(starts) => OperandKind::Element(builder.element(name, starts)),
                None => OperandKind::Name(name.name),
            };
            Operand { kind, span }
        });
        let register = rule(register);
        let more = rule(comma().or_not().ignore_then(name.clone()).repeated().collect::<Vec<_>>());
        Parts { name, expr, text, values, assigned, register, more }
    }

    /// Register, port or array.
    fn declaration(&self) -> Rule<'t, 'a, Declaration> {
        let Parts { name, expr, .. } = self;
        let sizes = expr
            .clone()
            .separated_by(comma())
            .at_least(1)
            .collect::<Vec<_>>()
            .delimited_by(
                just(Token::BracketOpen).labelled(ExpectedItem::BracketOpen),
                just(Token::BracketClose).labelled(ExpectedItem::BracketClose),
            )
            .or_not()
            .map_with(|sizes, e| {
                let all = &mut (e.state() as &mut Builder<'a>).ast.sizes;
                let sizes = sizes.unwrap_or_default();
                all.extend(&sizes);
                ((all.len() - sizes.len()) as u32, sizes.len() as u32)
            });
        let declaration = name
            .clone()
            .then(rule(sizes))
            .then(
                just(Token::Colon)
                    .labelled(ExpectedItem::Colon)
                    .ignore_then(name.clone().labelled(ExpectedItem::Type))
                    .or_not(),
            )
            .then(
                just(Token::At)
                    .labelled(ExpectedItem::At)
                    .ignore_then(expr.clone().labelled(ExpectedItem::Place))
                    .or_not(),
            )
            .map(|(((name, sizes), ty), place)| Declaration { name, sizes, ty, place });
        rule(declaration)
    }

    /// Registers, ports and arrays, separated by blanks or commas.
    fn declared(&self) -> Rule<'t, 'a, Vec<Declaration>> {
        let declaration = self.declaration();
        let declarations = declaration
            .clone()
            .then(comma().or_not().ignore_then(declaration).repeated().collect::<Vec<_>>())
            .map(|(first, mut more)| {
                more.insert(0, first);
                more
            });
        rule(declarations)
    }

    /// Machine, registers, ports, arrays, constants and data.
    fn declarations(&self) -> Vec<Rule<'t, 'a, DirectiveKind>> {
        let Parts { name, expr, text, values, assigned, register, .. } = self;
        let options = rule(comma().or_not().ignore_then(assigned.clone()).repeated().collect::<Vec<_>>());
        let row = name.clone().labelled(ExpectedItem::Machine).map(MachineName::Row);
        let machine = row.or(text.clone().map_with(|path, e| MachineName::File(path, e.span())));
        let machine = is(Directive::Machine)
            .ignore_then(machine)
            .then(options)
            .map(|(machine, options)| DirectiveKind::Machine(machine, options));
        let declares = select! {
            Token::Directive(Directive::Reg) => DeclarationKind::Register,
            Token::Directive(Directive::State) => DeclarationKind::State,
            Token::Directive(Directive::Input) => DeclarationKind::Input,
            Token::Directive(Directive::Output) => DeclarationKind::Output,
        };
        let declarations = self.declared();
        let declare =
            declares.then(declarations.clone()).map(|(what, names)| DirectiveKind::Declare(what, names));
        let listed = text
            .clone()
            .map_with(|path, e| ArrayValues::File(path, e.span()))
            .or(values.clone().map(ArrayValues::Listed));
        let array = is(Directive::Array)
            .ignore_then(declarations)
            .then(just(Token::Assign).labelled(ExpectedItem::Assign).ignore_then(listed).or_not())
            .map(|(arrays, values)| {
                DirectiveKind::Array(arrays, values.unwrap_or(ArrayValues::Listed(Vec::new())))
            });
        let float = is(Directive::Float).ignore_then(values.clone()).map(DirectiveKind::Float);
        let word = is(Directive::Word).ignore_then(values.clone()).map(DirectiveKind::Word);
        let constant = is(Directive::Const)
            .ignore_then(assigned.clone())
            .map(|(name, value)| DirectiveKind::Const(name, value));
        let dots = just(Token::Dots).labelled(ExpectedItem::Dots);
        let ends = name
            .clone()
            .labelled(ExpectedItem::Range)
            .then(expr.clone().labelled(ExpectedItem::Least))
            .then_ignore(dots)
            .then(expr.clone().labelled(ExpectedItem::Largest))
            .map(|((name, least), largest)| (name, least, largest));
        let param = is(Directive::Param)
            .ignore_then(self.declaration())
            .then_ignore(just(Token::Assign).labelled(ExpectedItem::Assign))
            .then(values.clone())
            .then(ends.or_not())
            .map(|((declaration, values), range)| DirectiveKind::Param { declaration, values, range });
        let preset = is(Directive::Preset)
            .ignore_then(just(Token::At).or_not())
            .then(register.clone().labelled(ExpectedItem::Register))
            .then_ignore(just(Token::Assign).labelled(ExpectedItem::Assign))
            .then(expr.clone())
            .map(|((at, register), value)| DirectiveKind::Preset { register, placed: at.is_some(), value });
        let space = is(Directive::Space).ignore_then(expr.clone()).map(DirectiveKind::Space);
        vec![
            rule(machine),
            rule(declare),
            rule(array),
            rule(float),
            rule(word),
            rule(constant),
            rule(param),
            rule(preset),
            rule(space),
        ]
    }

    /// Conditions, repetitions and macros.
    fn blocks(&self) -> Vec<Rule<'t, 'a, DirectiveKind>> {
        let Parts { name, expr, .. } = self;
        let branch =
            is(Directive::If).ignore_then(expr.clone()).map(|condition| DirectiveKind::If(condition, 0));
        let elif = is(Directive::Elif)
            .ignore_then(expr.clone())
            .map(|condition| DirectiveKind::Elif(condition, 0, 0));
        let rep = is(Directive::Rep)
            .ignore_then(name.clone())
            .then_ignore(comma())
            .then(expr.clone())
            .then_ignore(comma())
            .then(expr.clone())
            .map(|((variable, first), last)| DirectiveKind::Rep { variable, first, last, end: 0 });
        let option = name.clone().labelled(ExpectedItem::LoopOption).then(expr.clone());
        let for_ = is(Directive::For)
            .ignore_then(name.clone())
            .then_ignore(comma())
            .then(expr.clone())
            .then_ignore(comma())
            .then(expr.clone())
            .then(option.repeated().collect::<Vec<_>>())
            .map(|(((variable, first), last), options)| DirectiveKind::For {
                variable,
                first,
                last,
                options,
                end: 0,
            });
        let parameter = name
            .clone()
            .then(
                just(Token::Colon)
                    .labelled(ExpectedItem::Colon)
                    .ignore_then(name.clone().labelled(ExpectedItem::Type))
                    .or_not(),
            )
            .map(|(name, ty)| Parameter { name, ty });
        let parameters = rule(comma().or_not().ignore_then(parameter).repeated().collect::<Vec<_>>());
        let macro_ = is(Directive::Macro)
            .ignore_then(name.clone())
            .then(parameters)
            .map(|(name, parameters)| DirectiveKind::Macro { name, parameters, end: 0 });
        vec![rule(branch), rule(elif), rule(rep), rule(for_), rule(macro_)]
    }

    /// Files, messages and source locations.
    fn sources(&self) -> Vec<Rule<'t, 'a, DirectiveKind>> {
        let Parts { name, expr, text, .. } = self;
        // A library file's name may consist of any tokens: only its text counts.
        let library = select! {
            token if !matches!(token, Token::Newline | Token::Operator(Operator::Gt)) => (),
        }
        .repeated()
        .at_least(1)
        .collect::<Vec<()>>()
        .map_with(|_, e| {
            let span = e.span();
            (e.state() as &mut Builder<'a>).text_of(span).to_owned()
        })
        .delimited_by(
            just(Token::Operator(Operator::Lt)).labelled(ExpectedItem::LibraryFile),
            just(Token::Operator(Operator::Gt)).labelled(ExpectedItem::Greater),
        );
        let include = is(Directive::Include)
            .ignore_then(text.clone().map(|name| (name, false)).or(library.map(|name| (name, true))))
            .map(|(name, library)| DirectiveKind::Include(name, library));
        let error = is(Directive::Error).ignore_then(text.clone()).map(DirectiveKind::Error);
        let columns = expr
            .clone()
            .then_ignore(comma())
            .then(expr.clone())
            .delimited_by(
                just(Token::BracketOpen).labelled(ExpectedItem::BracketOpen),
                just(Token::BracketClose).labelled(ExpectedItem::BracketClose),
            )
            .or_not();
        let at = text
            .clone()
            .then(expr.clone().labelled(ExpectedItem::LineNumber))
            .then(columns)
            .map(|((file, line), columns)| Loc::At(file, line, columns))
            .or(name.clone().map(Loc::None));
        let loc = is(Directive::Loc)
            .ignore_then(
                at.separated_by(just(Token::Bars).labelled(ExpectedItem::Bars))
                    .at_least(1)
                    .collect::<Vec<_>>(),
            )
            .map(DirectiveKind::Loc);
        vec![rule(include), rule(error), rule(loc)]
    }

    /// Modes of the assembler, and bounds of loops.
    fn modes(&self) -> Vec<Rule<'t, 'a, DirectiveKind>> {
        let Parts { name, expr, more, .. } = self;
        let schedule = is(Directive::Schedule)
            .ignore_then(name.clone().labelled(ExpectedItem::OnOrOff))
            .map(DirectiveKind::Schedule);
        let contract = is(Directive::Contract)
            .ignore_then(name.clone().labelled(ExpectedItem::OnOrOff))
            .map(DirectiveKind::Contract);
        let fast = is(Directive::Fast)
            .ignore_then(name.clone().labelled(ExpectedItem::Allowed).then(more.clone()))
            .map(|(first, mut more)| {
                more.insert(0, first);
                DirectiveKind::Fast(more)
            });
        let latched = is(Directive::Ports)
            .ignore_then(name.clone().labelled(ExpectedItem::LatchedOrDirect))
            .map(DirectiveKind::Ports);
        let total = name.clone().labelled(ExpectedItem::LoopTotal).then(expr.clone());
        let loop_bound = is(Directive::LoopBound)
            .ignore_then(expr.clone())
            .then(total.or_not())
            .map(|(most, total)| DirectiveKind::LoopBound(most, total));
        vec![rule(schedule), rule(contract), rule(fast), rule(latched), rule(loop_bound)]
    }

    /// Ranges of registers, and demands on ports.
    fn demands(&self) -> Vec<Rule<'t, 'a, DirectiveKind>> {
        let Parts { name, expr, register, more, .. } = self;
        let ports =
            rule(name.clone().labelled(ExpectedItem::Port).then(more.clone()).map(|(first, mut more)| {
                more.insert(0, first);
                more
            }));
        let registers = register
            .clone()
            .labelled(ExpectedItem::Register)
            .then(comma().or_not().ignore_then(register.clone()).repeated().collect::<Vec<_>>())
            .map(|(first, mut more)| {
                more.insert(0, first);
                more
            });
        let range = is(Directive::Range)
            .ignore_then(just(Token::At).or_not())
            .then(registers)
            .then_ignore(just(Token::Assign).labelled(ExpectedItem::Assign))
            .then(expr.clone().labelled(ExpectedItem::Least))
            .then_ignore(comma())
            .then(expr.clone().labelled(ExpectedItem::Largest))
            .map(|(((at, registers), low), high)| DirectiveKind::Range {
                registers,
                placed: at.is_some(),
                low,
                high,
            });
        let deadline = is(Directive::Deadline)
            .ignore_then(ports.clone())
            .then_ignore(just(Token::Assign).labelled(ExpectedItem::Assign))
            .then(expr.clone().labelled(ExpectedItem::Cycle))
            .map(|(ports, cycle)| DirectiveKind::Deadline(ports, cycle));
        let arrays =
            name.clone().labelled(ExpectedItem::Array).then(more.clone()).map(|(first, mut more)| {
                more.insert(0, first);
                more
            });
        let result = is(Directive::Result).ignore_then(arrays).map(DirectiveKind::Result);
        let compared = select! {
            Token::Operator(Operator::Ge) => true,
            Token::Operator(Operator::Le) => false,
        };
        let assume = is(Directive::Assume)
            .ignore_then(register.clone().labelled(ExpectedItem::Register))
            .then(compared.labelled(ExpectedItem::Compared))
            .then(expr.clone())
            .map(|((register, least), bound)| DirectiveKind::Assume { register, least, bound });
        let order = is(Directive::Order).ignore_then(ports.clone()).map(DirectiveKind::Order);
        let late = is(Directive::Late)
            .ignore_then(ports.clone())
            .then(
                just(Token::Assign)
                    .labelled(ExpectedItem::Assign)
                    .ignore_then(expr.clone().labelled(ExpectedItem::Cycles))
                    .or_not(),
            )
            .map(|(ports, cost)| DirectiveKind::Late(ports, cost));
        vec![rule(range), rule(result), rule(assume), rule(deadline), rule(order), rule(late)]
    }
}
