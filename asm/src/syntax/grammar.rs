//! The grammar of a line, in chumsky.
//!
//! It is generic in its errors: a line is parsed without collecting any, and only a line that fails is parsed again with
//! those a user reads. What it recognises goes into an [`Ast`] as it goes; chumsky's rewinding takes it out again.
//!
//! Combinators that drop a parser's output (`ignored`, `then_ignore`, `count`) do not run its closures: what writes to the
//! tree is therefore always kept, if only as a `Vec<()>`, which allocates nothing.

use crate::report::source::Span;
use crate::syntax::ast::Operator;
use crate::syntax::ast::*;
use crate::syntax::lex::Token;
use crate::syntax::name::{NameId, NameRef};
use chumsky::error::{Error, LabelError};
use chumsky::input::{Checkpoint, Cursor, InputRef, MapExtra, MappedInput};
use chumsky::inspector::Inspector;
use chumsky::pratt::{infix, left, prefix, right};
use chumsky::prelude::*;

/// Tokens and their places as chumsky reads them.
pub(crate) type Tokens<'t> = MappedInput<'t, Token, Span, &'t [(Token, Span)]>;

/// What the grammar writes to.
pub(crate) struct Builder<'a> {
    pub(crate) ast: Ast,
    /// The text of the file, and where it begins in the space of all files.
    pub(crate) text: &'a str,
    pub(crate) base: u32,
    pub(crate) line: u32,
}

/// Lengths of the lists that the grammar appends to.
#[derive(Clone, Copy)]
pub(crate) struct Mark {
    nodes: u32,
    operands: u32,
    operations: u32,
    memories: u32,
    casts: u32,
    elements: u32,
    equations: u32,
    sizes: u32,
    templates: u32,
}

impl Builder<'_> {
    #[inline(always)]
    pub(crate) fn mark(&self) -> Mark {
        Mark {
            nodes: self.ast.nodes.len() as u32,
            operands: self.ast.operands.len() as u32,
            operations: self.ast.operations.len() as u32,
            memories: self.ast.memories.len() as u32,
            casts: self.ast.casts.len() as u32,
            elements: self.ast.elements.len() as u32,
            equations: self.ast.equations.len() as u32,
            sizes: self.ast.sizes.len() as u32,
            templates: self.ast.templates.len() as u32,
        }
    }

    #[inline(always)]
    pub(crate) fn rewind(&mut self, mark: Mark) {
        self.ast.nodes.truncate(mark.nodes as usize);
        self.ast.operands.truncate(mark.operands as usize);
        self.ast.operations.truncate(mark.operations as usize);
        self.ast.memories.truncate(mark.memories as usize);
        self.ast.casts.truncate(mark.casts as usize);
        self.ast.elements.truncate(mark.elements as usize);
        self.ast.equations.truncate(mark.equations as usize);
        self.ast.sizes.truncate(mark.sizes as usize);
        self.ast.templates.truncate(mark.templates as usize);
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind, span: Span) {
        self.ast.nodes.push(Node { kind, span });
    }

    /// The nodes from `first` on.
    #[inline(always)]
    fn expr(&self, first: u32) -> ExprId {
        ExprId { first, count: self.ast.nodes.len() as u32 - first }
    }

    /// An operand that is an expression; one that is a name alone is kept as that.
    fn expression_operand(&mut self, first: u32, span: Span) -> Operand {
        let kind = match self.ast.nodes[first as usize..] {
            [Node { kind: NodeKind::Name(name), .. }] => {
                self.ast.nodes.truncate(first as usize);
                OperandKind::Name(name)
            }
            _ => OperandKind::Expr(self.expr(first)),
        };
        Operand { kind, span }
    }

    /// Closes a template whose expressions' nodes begin at `starts`: they move out of the list, so that a template within
    /// an expression does not interrupt the expression's own nodes.
    fn template(&mut self, heads: Vec<(NameId, u32)>, tail: NameId) -> NameRef {
        let first = heads.first().map_or(0, |head| head.1) as usize;
        let mut nodes = self.ast.nodes.split_off(first);
        let mut parts: Vec<(NameId, Vec<Node>)> = Vec::with_capacity(heads.len());
        for (head, start) in heads.into_iter().rev() {
            parts.push((head, nodes.split_off(start as usize - first)));
        }
        parts.reverse();
        self.ast.templates.push(Template { parts, tail });
        NameRef::template(self.ast.templates.len() as u32 - 1)
    }

    /// Closes an element whose indices' nodes begin at `starts`: they move out of the list, as those of a template do.
    fn element(&mut self, name: Name, starts: Vec<u32>) -> u32 {
        let first = starts.first().copied().unwrap_or(self.ast.nodes.len() as u32);
        let mut nodes = self.ast.nodes.split_off(first as usize);
        let mut indices: Vec<Vec<Node>> = Vec::with_capacity(starts.len());
        for start in starts.into_iter().rev() {
            indices.push(nodes.split_off((start - first) as usize));
        }
        indices.reverse();
        self.ast.elements.push(Element { name, indices });
        self.ast.elements.len() as u32 - 1
    }

    fn text_of(&self, span: Span) -> &str {
        self.text.get((span.start - self.base) as usize..(span.end - self.base) as usize).unwrap_or("")
    }

    /// The text between the quotes of a token, its escapes replaced.
    fn quoted(&self, span: Span) -> String {
        let mut text = String::new();
        let mut characters = self.text_of(Span::new(span.start + 1, span.end - 1)).chars();
        while let Some(c) = characters.next() {
            text.push(match c {
                '\\' => match characters.next() {
                    Some('n') => '\n',
                    Some('r') => '\r',
                    Some('t') => '\t',
                    Some(other) => other,
                    None => '\\',
                },
                c => c,
            });
        }
        text
    }
}

impl<'t> Inspector<'t, Tokens<'t>> for Builder<'_> {
    type Checkpoint = Mark;
    #[inline(always)]
    fn on_token(&mut self, _: &Token) {}
    #[inline(always)]
    fn on_save<'parse>(&self, _: &Cursor<'t, 'parse, Tokens<'t>>) -> Mark {
        self.mark()
    }
    #[inline(always)]
    fn on_rewind<'parse>(&mut self, checkpoint: &Checkpoint<'t, 'parse, Tokens<'t>, Mark>) {
        self.rewind(*checkpoint.inspector());
    }
}

/// A parsed line.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    pub(crate) label: Option<Name>,
    pub(crate) body: Body,
}

#[derive(Clone, Debug)]
pub(crate) enum Body {
    Empty,
    /// This many operations, the last of the list.
    Bundle(u32),
    Directive(DirectiveKind, Span),
    /// An equation, the last of the list.
    Equation,
}

type Extra<'a, E> = extra::Full<E, Builder<'a>, ()>;

/// Errors that the grammar can fill.
pub(crate) trait LineError<'t>:
    Error<'t, Tokens<'t>> + LabelError<'t, Tokens<'t>, &'static str> + 't
{
}
impl<'t, E: Error<'t, Tokens<'t>> + LabelError<'t, Tokens<'t>, &'static str> + 't> LineError<'t> for E {}

/// The line that most are: perhaps a label, then operations whose operands are names, numbers and `offset[name]` with one
/// of each. It says nothing that the grammar proper does not, only sooner; anything else it leaves to that.
#[inline]
fn common_line<'t, 'a, E: LineError<'t>>(
    input: &mut InputRef<'t, '_, Tokens<'t>, Extra<'a, E>>,
) -> Result<Line, E> {
    let start = input.cursor();
    let mut label = None;
    let mut count = 0;
    let parsed = loop {
        let before = input.cursor();
        let Some(Token::Name(mnemonic)) = input.next() else { break None };
        let span = input.span_since(&before);
        let mnemonic = Name { name: NameRef::plain(mnemonic), span };
        let after = input.peek();
        if after == Some(Token::Colon) && label.is_none() && count == 0 {
            input.skip();
            label = Some(mnemonic);
            if input.peek() == Some(Token::Newline) {
                input.skip();
                break Some(Body::Empty);
            }
            continue;
        }
        let Some(end) = common_operands(input, mnemonic) else { break None };
        count += 1;
        if end == Token::Newline {
            break Some(Body::Bundle(count));
        }
    };
    match parsed {
        Some(body) => Ok(Line { label, body }),
        None => {
            let span = input.span_since(&start);
            Err(LabelError::<Tokens<'t>, &'static str>::expected_found([], None, span))
        }
    }
}

/// The operands of [`common_line`] and the token that ends them: `||` or the end of the line.
#[inline(always)]
fn common_operands<'t, 'a, E: LineError<'t>>(
    input: &mut InputRef<'t, '_, Tokens<'t>, Extra<'a, E>>,
    mnemonic: Name,
) -> Option<Token> {
    let mut count = 0;
    let mut last = mnemonic.span;
    let mut token = input.peek()?;
    while !matches!(token, Token::Newline | Token::Bars) {
        let before = input.cursor();
        let value = input.next()?;
        let mut span = input.span_since(&before);
        token = input.peek()?;
        let builder = input.state();
        let first = builder.ast.nodes.len() as u32;
        let mut kind = match value {
            Token::Name(name) => OperandKind::Name(NameRef::plain(name)),
            Token::Int(value) => {
                builder.node(NodeKind::Int(value), span);
                OperandKind::Expr(ExprId { first, count: 1 })
            }
            Token::Real(value) => {
                builder.node(NodeKind::Real(value), span);
                OperandKind::Expr(ExprId { first, count: 1 })
            }
            _ => return None,
        };
        if token == Token::BracketOpen {
            input.skip();
            let inside = input.cursor();
            let Some(Token::Name(base)) = input.next() else { return None };
            let base =
                Operand { kind: OperandKind::Name(NameRef::plain(base)), span: input.span_since(&inside) };
            let Some(Token::BracketClose) = input.next() else { return None };
            let whole = input.span_since(&before);
            token = input.peek()?;
            let builder = input.state();
            if let OperandKind::Name(name) = kind {
                builder.node(NodeKind::Name(name), span);
            }
            let offset = Some(Expr { id: ExprId { first, count: 1 }, span });
            builder.ast.memories.push(Memory { offset, base });
            kind = OperandKind::Memory(builder.ast.memories.len() as u32 - 1);
            span = whole;
        }
        input.state().ast.operands.push(Operand { kind, span });
        last = span;
        count += 1;
        match token {
            Token::Comma => {
                input.skip();
                token = input.peek()?;
                // A comma is followed by an operand.
                if matches!(token, Token::Newline | Token::Bars) {
                    return None;
                }
            }
            Token::Newline | Token::Bars => {}
            _ => return None,
        }
    }
    input.skip();
    push_operation(input.state(), mnemonic, count, mnemonic.span.to(last));
    Some(token)
}

/// Where the nodes of what follows begin.
fn here<'t, 'a: 't, E: LineError<'t>>() -> impl Parser<'t, Tokens<'t>, u32, Extra<'a, E>> + Clone {
    empty().map_with(|(), e| (e.state() as &mut Builder<'a>).ast.nodes.len() as u32)
}

/// A name, plain or a template of expressions.
fn name_ref<'t, 'a: 't, E: LineError<'t>>(
    expression: impl Parser<'t, Tokens<'t>, (), Extra<'a, E>> + Clone + 't,
) -> Boxed<'t, 't, Tokens<'t>, NameRef, Extra<'a, E>> {
    let plain = select! { Token::Name(name) => NameRef::plain(name) };
    let template = {
        let begin = select! { Token::Begin(name) => name }
            .then(here())
            .then(expression.clone())
            .map(|(head, ())| head);
        let middle = select! { Token::Middle(name) => name }
            .labelled("`}`")
            .then(here())
            .then(expression.clone())
            .map(|(head, ())| head);
        begin
            .then(middle.repeated().collect::<Vec<_>>())
            .then(select! { Token::End(name) => name }.labelled("`}`"))
            .map_with(|((head, mut more), tail), e| {
                more.insert(0, head);
                let builder: &mut Builder<'a> = e.state();
                builder.template(more, tail)
            })
    };
    plain.or(template).labelled("a name").boxed()
}

/// The indices of an element, in brackets: where the nodes of each begin. As many as `least` or more.
fn indices<'t, 'a: 't, E: LineError<'t>>(
    expression: impl Parser<'t, Tokens<'t>, (), Extra<'a, E>> + Clone + 't,
    least: usize,
) -> impl Parser<'t, Tokens<'t>, Vec<u32>, Extra<'a, E>> + Clone {
    here()
        .then(expression)
        .map(|(start, ())| start)
        .separated_by(just(Token::Comma).labelled("`,`"))
        .at_least(least)
        .collect::<Vec<_>>()
        .delimited_by(just(Token::BracketOpen).labelled("`[`"), just(Token::BracketClose).labelled("`]`"))
}

/// The parser of an expression, with or without elements of arrays: elsewhere than in equations a bracket after a name is
/// that of a memory operand. It knows itself weakly: one that owned itself would never be freed.
fn expression<'t, 'a: 't, E: LineError<'t>>(
    elements: bool,
) -> impl Parser<'t, Tokens<'t>, (), Extra<'a, E>> + Clone {
    fn fold<'t, 'a, 'b, E: LineError<'t>>(
        _: (),
        operator: Operator,
        _: (),
        e: &mut MapExtra<'t, 'b, Tokens<'t>, Extra<'a, E>>,
    ) {
        let span = e.span();
        e.state().node(NodeKind::Infix(operator), span);
    }
    recursive(move |expression| {
        let name_ref = name_ref(expression.clone());
        let element = name_ref
            .clone()
            .map_with(|name, e| Name { name, span: e.span() })
            .then(indices(expression.clone(), 1))
            .filter(move |_| elements)
            .map_with(|(name, starts), e| {
                let span = e.span();
                let builder: &mut Builder<'a> = e.state();
                let element = builder.element(name, starts);
                builder.node(NodeKind::Element(element), span);
            });
        let arguments = expression
            .clone()
            .separated_by(just(Token::Comma))
            .collect::<Vec<()>>()
            .delimited_by(just(Token::Open), just(Token::Close).labelled("`)`"));
        let call_or_name = name_ref.clone().then(arguments.or_not()).try_map_with(|(name, arguments), e| {
            let span = e.span();
            let kind = match (name.resolve(), arguments) {
                (_, None) => NodeKind::Name(name),
                (Ok(name), Some(count)) => NodeKind::Call(name, count.len() as u32),
                (Err(_), Some(_)) => {
                    return Err(LabelError::<Tokens<'t>, &'static str>::expected_found(
                        ["a function"],
                        None,
                        span,
                    ));
                }
            };
            let builder: &mut Builder<'a> = e.state();
            builder.node(kind, span);
            Ok(())
        });
        let literal = select! {
            Token::Int(value) => NodeKind::Int(value),
            Token::Real(value) => NodeKind::Real(value),
        }
        .map_with(|kind, e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            builder.node(kind, span);
        });
        let parenthesised =
            expression.clone().delimited_by(just(Token::Open), just(Token::Close).labelled("`)`"));
        // Where there are no elements, what follows a name is not looked at.
        let element = match elements {
            true => element.boxed(),
            false => call_or_name.clone().boxed(),
        };
        let atom = choice((literal, element, call_or_name, parenthesised)).labelled("an operand");

        let operator = |level: u16| {
            select! { Token::Operator(operator) if operator.precedence() == level => operator }
                .labelled("an operator")
        };
        let computed = atom.pratt((
            prefix(
                7,
                select! { Token::Operator(operator) if operator.is_prefix() => operator }
                    .labelled("an operand"),
                |operator, (), e| {
                    let span = e.span();
                    let builder: &mut Builder<'a> = e.state();
                    builder.node(NodeKind::Prefix(operator), span);
                },
            ),
            infix(right(8), operator(8), fold),
            infix(left(6), operator(6), fold),
            infix(left(5), operator(5), fold),
            infix(left(4), operator(4), fold),
            infix(left(3), operator(3), fold),
            infix(left(2), operator(2), fold),
            infix(left(1), operator(1), fold),
        ));
        let choices = just(Token::Question)
            .labelled("an operator")
            .ignore_then(expression.clone())
            .then(just(Token::Colon).labelled("`:`").ignore_then(expression))
            .or_not();
        computed
            .then(choices)
            .map_with(|(_, choices): ((), Option<((), ())>), e| {
                let span = e.span();
                if choices.is_some() {
                    let builder: &mut Builder<'a> = e.state();
                    builder.node(NodeKind::Choice, span);
                }
            })
            .boxed()
    })
}

/// The parser of one line, from its first token to its [`Token::Newline`].
///
/// With `shortcut` the commonest lines are recognised without it; what is recognised is the same.
pub(crate) fn line<'t, 'a: 't, E: LineError<'t>>(
    shortcut: bool,
) -> impl Parser<'t, Tokens<'t>, Line, Extra<'a, E>> {
    let expression = expression(false).boxed();
    let name_ref = name_ref(expression.clone());
    let name = name_ref.clone().map_with(|name, e| Name { name, span: e.span() });
    let expr = here()
        .then(expression.clone())
        .map_with(|(first, ()), e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            Expr { id: builder.expr(first), span }
        })
        .labelled("an expression")
        .boxed();

    let place = just(Token::At)
        .ignore_then(name_ref.clone())
        .map_with(|name, e| Operand { kind: OperandKind::Place(name), span: e.span() });
    let base = place.clone().or(here().then(expression.clone()).map_with(|(first, ()), e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        builder.expression_operand(first, span)
    }));
    let ty = just(Token::Colon).labelled("`:`").ignore_then(name.clone().labelled("a type")).or_not().boxed();
    let cast = |(operand, ty): (Operand, Option<Name>),
                e: &mut MapExtra<'t, '_, Tokens<'t>, Extra<'a, E>>| {
        let Some(ty) = ty else { return operand };
        let span = e.span();
        let casts = &mut e.state().ast.casts;
        casts.push(Cast { operand, ty });
        Operand { kind: OperandKind::Cast(casts.len() as u32 - 1), span }
    };
    let brackets = base
        .then(ty.clone())
        .map_with(cast)
        .labelled("a register")
        .delimited_by(just(Token::BracketOpen), just(Token::BracketClose).labelled("`]`"))
        .boxed();
    let offset = here().then(expression.clone()).map_with(|(first, ()), e| (first, e.span()));
    let memory_or_expression = offset.then(brackets.clone().or_not()).map_with(|((first, span), base), e| {
        let whole = e.span();
        let builder: &mut Builder<'a> = e.state();
        match base {
            None => builder.expression_operand(first, span),
            Some(base) => {
                // The base, if an expression, put its nodes behind the offset's.
                let count = match base.kind {
                    OperandKind::Expr(base) => base.first - first,
                    _ => builder.ast.nodes.len() as u32 - first,
                };
                let offset = Some(Expr { id: ExprId { first, count }, span });
                builder.ast.memories.push(Memory { offset, base });
                Operand { kind: OperandKind::Memory(builder.ast.memories.len() as u32 - 1), span: whole }
            }
        }
    });
    let memory_alone = brackets.map_with(|base, e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        builder.ast.memories.push(Memory { offset: None, base });
        Operand { kind: OperandKind::Memory(builder.ast.memories.len() as u32 - 1), span }
    });
    // With one index it may be a place in memory: what the name means decides.
    let element = name.clone().then(indices(expression.clone(), 2)).map_with(|(name, starts), e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        Operand { kind: OperandKind::Element(builder.element(name, starts)), span }
    });
    let operand = choice((place.clone(), memory_alone, element, memory_or_expression))
        .then(ty)
        .map_with(cast)
        .map_with(|operand, e| (e.state() as &mut Builder<'a>).ast.operands.push(operand))
        .labelled("an operand")
        .boxed();
    let operands = operand.separated_by(just(Token::Comma).labelled("`,`")).collect::<Vec<()>>();

    let operation = name
        .clone()
        .labelled("an instruction")
        .then(operands)
        .map_with(|(mnemonic, count), e| {
            let span = e.span();
            push_operation(e.state(), mnemonic, count.len(), span);
        })
        .boxed();
    let raw = just(Token::Directive(Directive::Raw))
        .labelled("an instruction")
        .map_with(|_, e| e.span())
        .then(name.clone().labelled("a slot"))
        .then(expr.clone())
        .map_with(|((raw, slot), word), e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            builder.ast.operands.push(Operand { kind: OperandKind::Name(slot.name), span: slot.span });
            builder.ast.operands.push(Operand { kind: OperandKind::Expr(word.id), span: word.span });
            push_operation(
                builder,
                Name { name: NameRef::plain(NameId::of_directive(Directive::Raw)), span: raw },
                2,
                span,
            );
        })
        .boxed();
    let bundle = operation
        .or(raw)
        .separated_by(just(Token::Bars).labelled("`||`"))
        .at_least(1)
        .collect::<Vec<()>>()
        .map(|count| Body::Bundle(count.len() as u32));

    let directive = directive(name.clone().boxed(), expr).boxed();
    let body = bundle.or(directive).labelled("an instruction or a directive").or(empty().to(Body::Empty));
    // A plain label takes one look ahead; only a template is read twice.
    let label = name.then_ignore(just(Token::Colon)).or_not();
    let proper = label
        .then(body)
        .then_ignore(just(Token::Newline).labelled("the end of the line"))
        .map(|(label, body)| Line { label, body });
    let quick = custom(common_line).filter(move |_| shortcut);
    quick.or(proper)
}

/// The parser of a line that holds an equation: an optional label, what is written, `=`, and what is computed.
pub(crate) fn equation<'t, 'a: 't, E: LineError<'t>>() -> impl Parser<'t, Tokens<'t>, Line, Extra<'a, E>> {
    let expression = expression(true).boxed();
    let name = name_ref(expression.clone()).map_with(|name, e| Name { name, span: e.span() }).boxed();
    let place = just(Token::At)
        .ignore_then(name.clone())
        .map_with(|name, e| Operand { kind: OperandKind::Place(name.name), span: e.span() });
    let element = name.clone().then(indices(expression.clone(), 1)).map_with(|(name, starts), e| {
        let span = e.span();
        let builder: &mut Builder<'a> = e.state();
        Operand { kind: OperandKind::Element(builder.element(name, starts)), span }
    });
    let plain = name.clone().map(|name| Operand { kind: OperandKind::Name(name.name), span: name.span });
    let target = choice((place, element, plain)).labelled("a register to write").boxed();
    let value = here()
        .then(expression)
        .map_with(|(first, ()), e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            Expr { id: builder.expr(first), span }
        })
        .labelled("an expression")
        .boxed();
    let comma = || just(Token::Comma).labelled("`,`");
    let body = target
        .separated_by(comma())
        .at_least(1)
        .collect::<Vec<_>>()
        .then_ignore(just(Token::Assign).labelled("`=`"))
        .then(value.separated_by(comma()).at_least(1).collect::<Vec<_>>())
        .map_with(|(targets, values), e| {
            let span = e.span();
            let builder: &mut Builder<'a> = e.state();
            builder.ast.equations.push(Equation { targets, values, span });
        });
    let label = name.then_ignore(just(Token::Colon)).or_not();
    label
        .then(body)
        .then_ignore(just(Token::Newline).labelled("the end of the line"))
        .map(|(label, ())| Line { label, body: Body::Equation })
}

#[inline]
fn push_operation(builder: &mut Builder<'_>, mnemonic: Name, count: usize, span: Span) {
    let first = builder.ast.operands.len() as u32 - count as u32;
    let operation = Operation { mnemonic, first, count: count as u32, line: builder.line, span };
    builder.ast.operations.push(operation);
}

/// The parser of a directive with its operands.
fn directive<'t, 'a: 't, E: LineError<'t>>(
    name: impl Parser<'t, Tokens<'t>, Name, Extra<'a, E>> + Clone + 't,
    expr: impl Parser<'t, Tokens<'t>, Expr, Extra<'a, E>> + Clone + 't,
) -> impl Parser<'t, Tokens<'t>, Body, Extra<'a, E>> {
    let comma = || just(Token::Comma).labelled("`,`");
    let is = |directive| just(Token::Directive(directive));
    let text = || {
        select! { Token::Text => () }.labelled("a text in `\"`").map_with(|(), e| {
            let span = e.span();
            (e.state() as &mut Builder<'a>).quoted(span)
        })
    };
    let bare = select! {
        Token::Directive(Directive::Once) => DirectiveKind::Section(Section::Once),
        Token::Directive(Directive::Period) => DirectiveKind::Section(Section::Period),
        Token::Directive(Directive::Data) => DirectiveKind::Section(Section::Data),
        Token::Directive(Directive::EndMacro) => DirectiveKind::End(Directive::EndMacro),
        Token::Directive(Directive::EndRep) => DirectiveKind::End(Directive::EndRep),
        Token::Directive(Directive::EndIf) => DirectiveKind::End(Directive::EndIf),
        Token::Directive(Directive::Else) => DirectiveKind::Else(0),
    };
    let declares = select! {
        Token::Directive(Directive::Reg) => Declares::Register,
        Token::Directive(Directive::State) => Declares::State,
        Token::Directive(Directive::Input) => Declares::Input,
        Token::Directive(Directive::Output) => Declares::Output,
    };
    let sizes = expr
        .clone()
        .separated_by(comma())
        .at_least(1)
        .collect::<Vec<_>>()
        .delimited_by(just(Token::BracketOpen).labelled("`[`"), just(Token::BracketClose).labelled("`]`"))
        .or_not()
        .map_with(|sizes, e| {
            let all = &mut (e.state() as &mut Builder<'a>).ast.sizes;
            let sizes = sizes.unwrap_or_default();
            all.extend(&sizes);
            ((all.len() - sizes.len()) as u32, sizes.len() as u32)
        });
    let declaration = name
        .clone()
        .then(sizes)
        .then(just(Token::Colon).labelled("`:`").ignore_then(name.clone().labelled("a type")).or_not())
        .then(
            just(Token::At)
                .labelled("`@`")
                .ignore_then(expr.clone().labelled("a register's place or a port's number"))
                .or_not(),
        )
        .map(|(((name, sizes), ty), place)| Declaration { name, sizes, ty, place });
    // Separated by blanks or commas.
    let declarations = declaration
        .clone()
        .then(comma().or_not().ignore_then(declaration).repeated().collect::<Vec<_>>())
        .map(|(first, mut more)| {
            more.insert(0, first);
            more
        });
    let declare = declares.then(declarations).map(|(what, names)| DirectiveKind::Declare(what, names));
    let values = || expr.clone().separated_by(comma()).at_least(1).collect::<Vec<_>>();
    let float = is(Directive::Float).ignore_then(values()).map(DirectiveKind::Float);
    let word = is(Directive::Word).ignore_then(values()).map(DirectiveKind::Word);
    let assigned = || name.clone().then_ignore(just(Token::Assign).labelled("`=`")).then(expr.clone());
    let constant =
        is(Directive::Const).ignore_then(assigned()).map(|(name, value)| DirectiveKind::Const(name, value));
    let preset = is(Directive::Preset)
        .ignore_then(just(Token::At).or_not())
        .then(assigned())
        .map(|(at, (register, value))| DirectiveKind::Preset { register, placed: at.is_some(), value });
    let space = is(Directive::Space).ignore_then(expr.clone()).map(DirectiveKind::Space);
    let branch = is(Directive::If).ignore_then(expr.clone()).map(|condition| DirectiveKind::If(condition, 0));
    let elif =
        is(Directive::Elif).ignore_then(expr.clone()).map(|condition| DirectiveKind::Elif(condition, 0, 0));
    let rep = is(Directive::Rep)
        .ignore_then(name.clone())
        .then_ignore(comma())
        .then(expr.clone())
        .then_ignore(comma())
        .then(expr.clone())
        .map(|((variable, first), last)| DirectiveKind::Rep { variable, first, last, end: 0 });
    let parameters = comma().or_not().ignore_then(name.clone()).repeated().collect::<Vec<_>>();
    let macro_ = is(Directive::Macro)
        .ignore_then(name.clone())
        .then(parameters)
        .map(|(name, parameters)| DirectiveKind::Macro { name, parameters, end: 0 });
    // Whatever tokens a library file's name is made of: its text counts.
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
        just(Token::Operator(Operator::Lt)).labelled("a library file in `<>`"),
        just(Token::Operator(Operator::Gt)).labelled("`>`"),
    );
    let include = is(Directive::Include)
        .ignore_then(text().map(|name| (name, false)).or(library.map(|name| (name, true))))
        .map(|(name, library)| DirectiveKind::Include(name, library));
    let schedule = is(Directive::Schedule)
        .ignore_then(name.clone().labelled("`on` or `off`"))
        .map(DirectiveKind::Schedule);
    let allowed = comma().or_not().ignore_then(name.clone()).repeated().collect::<Vec<_>>();
    let fast = is(Directive::Fast)
        .ignore_then(name.clone().labelled("`reassociate`, `reciprocal` or `off`").then(allowed))
        .map(|(first, mut more)| {
            more.insert(0, first);
            DirectiveKind::Fast(more)
        });
    let contract = is(Directive::Contract)
        .ignore_then(name.clone().labelled("`on` or `off`"))
        .map(DirectiveKind::Contract);
    let latched = is(Directive::Ports)
        .ignore_then(name.clone().labelled("`latched` or `direct`"))
        .map(DirectiveKind::Ports);
    let loop_bound = is(Directive::LoopBound).ignore_then(expr.clone()).map(DirectiveKind::LoopBound);
    let ports = || {
        let more = comma().or_not().ignore_then(name.clone()).repeated().collect::<Vec<_>>();
        name.clone().labelled("a port").then(more).map(|(first, mut more)| {
            more.insert(0, first);
            more
        })
    };
    let range = is(Directive::Range)
        .ignore_then(just(Token::At).or_not())
        .then(ports())
        .then_ignore(just(Token::Assign).labelled("`=`"))
        .then(expr.clone().labelled("the least value"))
        .then_ignore(comma())
        .then(expr.clone().labelled("the largest value"))
        .map(|(((at, registers), low), high)| DirectiveKind::Range {
            registers,
            placed: at.is_some(),
            low,
            high,
        });
    let deadline = is(Directive::Deadline)
        .ignore_then(ports())
        .then_ignore(just(Token::Assign).labelled("`=`"))
        .then(expr.clone().labelled("a cycle"))
        .map(|(ports, cycle)| DirectiveKind::Deadline(ports, cycle));
    let order = is(Directive::Order).ignore_then(ports()).map(DirectiveKind::Order);
    let late = is(Directive::Late)
        .ignore_then(ports())
        .then(just(Token::Assign).labelled("`=`").ignore_then(expr.clone().labelled("cycles")).or_not())
        .map(|(ports, cost)| DirectiveKind::Late(ports, cost));
    let error = is(Directive::Error).ignore_then(text()).map(DirectiveKind::Error);
    let columns = expr
        .clone()
        .then_ignore(comma())
        .then(expr.clone())
        .delimited_by(just(Token::BracketOpen).labelled("`[`"), just(Token::BracketClose).labelled("`]`"))
        .or_not();
    let at = text()
        .then(expr.clone().labelled("a line number"))
        .then(columns)
        .map(|((file, line), columns)| Loc::At(file, line, columns))
        .or(name.map(Loc::None));
    let loc = is(Directive::Loc)
        .ignore_then(at.separated_by(just(Token::Bars).labelled("`||`")).at_least(1).collect::<Vec<_>>())
        .map(DirectiveKind::Loc);
    // Boxed, so that the type of the whole stays small: a nested one took the compiler half a minute.
    choice([
        bare.boxed(),
        declare.boxed(),
        float.boxed(),
        word.boxed(),
        constant.boxed(),
        preset.boxed(),
        space.boxed(),
        branch.boxed(),
        elif.boxed(),
        rep.boxed(),
        macro_.boxed(),
        include.boxed(),
        error.boxed(),
        loc.boxed(),
        schedule.boxed(),
        contract.boxed(),
        fast.boxed(),
        latched.boxed(),
        loop_bound.boxed(),
        range.boxed(),
        deadline.boxed(),
        order.boxed(),
        late.boxed(),
    ])
    .map_with(|kind, e| Body::Directive(kind, e.span()))
}
