// SPDX-License-Identifier: MIT OR Apache-2.0
//! Builder of the syntax tree, to which the grammar's rules write.

use super::Tokens;
use crate::ast::*;
use crate::lex::Token;
use crate::name::{NameId, NameRef};
use chumsky::input::{Checkpoint, Cursor};
use chumsky::inspector::Inspector;
use takt_diagnostics::source::Span;

pub(crate) struct Builder<'a> {
    pub(crate) ast: Ast,
    /// Text of the file, and its offset in the space of all files.
    pub(crate) text: &'a str,
    pub(crate) base: u32,
    pub(crate) line: u32,
}

/// Lengths of the lists that the grammar appends to.
#[derive(Clone, Copy)]
pub(crate) struct Mark {
    pub(crate) nodes: u32,
    operands: u32,
    operations: u32,
    memories: u32,
    casts: u32,
    pub(crate) elements: u32,
    equations: u32,
    sizes: u32,
    pub(crate) templates: u32,
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
    pub(super) fn node(&mut self, kind: NodeKind, span: Span) {
        self.ast.nodes.push(Node { kind, span });
    }

    /// The nodes from `first` on.
    #[inline(always)]
    pub(super) fn expr(&self, first: u32) -> ExprId {
        ExprId { first, count: self.ast.nodes.len() as u32 - first }
    }

    /// An operand for an expression; a name alone becomes a name operand.
    pub(super) fn expression_operand(&mut self, first: u32, span: Span) -> Operand {
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
    pub(super) fn template(&mut self, heads: Vec<(NameId, u32)>, tail: NameId) -> NameRef {
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

    /// Closes an element whose indices' nodes begin at `starts`: they move out of the list, like the nodes of a template.
    pub(super) fn element(&mut self, name: Name, starts: Vec<u32>) -> u32 {
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

    pub(super) fn text_of(&self, span: Span) -> &str {
        self.text.get((span.start - self.base) as usize..(span.end - self.base) as usize).unwrap_or("")
    }

    /// The text between the quotes of a token, its escapes replaced.
    pub(super) fn quoted(&self, span: Span) -> String {
        let mut text = String::new();
        let mut characters = self.text_of(Span::new(span.start + 1, span.end - 1)).chars();
        while let Some(c) = characters.next() {
            text.push(match c {
                '\\' => match characters.next() {
                    Some('n') => '\n',
                    Some('r') => '\r',
                    Some('t') => '\t',
                    // A character by its code, in four hexadecimal digits; without them it is a `u`.
                    Some('u') => match code(characters.as_str()) {
                        Some(c) => {
                            characters.nth(3);
                            c
                        }
                        None => 'u',
                    },
                    Some(other) => other,
                    None => '\\',
                },
                c => c,
            });
        }
        text
    }
}

/// The character whose code is given by the first four hexadecimal digits of a text.
fn code(text: &str) -> Option<char> {
    let digits = text.get(..4).filter(|digits| digits.bytes().all(|byte| byte.is_ascii_hexdigit()))?;
    char::from_u32(u32::from_str_radix(digits, 16).ok()?)
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

impl Builder<'_> {
    #[inline]
    pub(super) fn push_operation(&mut self, mnemonic: Name, count: usize, span: Span) {
        let first = self.ast.operands.len() as u32 - count as u32;
        let operation = Operation { mnemonic, first, count: count as u32, line: self.line, span };
        self.ast.operations.push(operation);
    }
}
