// SPDX-License-Identifier: MIT OR Apache-2.0
//! Comparisons next to `&`, `|` or another comparison without parentheses. Languages differ in the precedence of these operators:
//! a reader may group such a line differently from the assembler.

use crate::ast::{Node, NodeKind, Operator};
use crate::expr::{operands, parts};
use crate::grammar::{Builder, Mark};
use crate::limits;
use takt_diagnostics::diag::{Diagnostic, Severity, Sink};
use takt_diagnostics::source::{Source, Span};

/// Warns of comparisons without parentheses in the line whose nodes begin at `mark`.
pub(crate) fn check(builder: &Builder<'_>, mark: Mark, source: &Source, sink: &mut Sink) {
    let ast = &builder.ast;
    expression(&ast.nodes[mark.nodes as usize..], source, sink);
    let indices = ast.elements[mark.elements as usize..].iter().flat_map(|element| &element.indices);
    let braced = ast.templates[mark.templates as usize..].iter().flat_map(|template| &template.parts);
    for nodes in indices.chain(braced.map(|(_, nodes)| nodes)) {
        expression(nodes, source, sink);
    }
}

/// An operator between two operands, and whether these stand in parentheses.
#[derive(Clone, Copy)]
struct Infix {
    operator: Operator,
    span: Span,
    /// Node and whether it is parenthesised.
    operands: [(u32, bool); 2],
}

struct Tree<'n> {
    nodes: &'n [Node],
    parts: Vec<u32>,
    source: &'n Source,
}

impl Tree<'_> {
    fn infix(&self, node: u32) -> Option<Infix> {
        let Node { kind: NodeKind::Infix(operator), span } = self.nodes[node as usize] else { return None };
        let [(_, a), (_, b)] = operands(&self.parts, node)[..] else { return None };
        // A node's place excludes the node's own parentheses; the place of the node around it includes them.
        let (left, right) = (self.nodes[a as usize].span, self.nodes[b as usize].span);
        let operands = [(a, span.start < left.start), (b, right.end < span.end)];
        Some(Infix { operator, span, operands })
    }

    /// The operator of an operand that is a comparison without parentheses.
    fn compared(&self, (node, parenthesised): (u32, bool)) -> Option<Infix> {
        self.infix(node).filter(|inner| !parenthesised && inner.operator.compares())
    }

    /// The operator of an operand that `&` or `|` joins, without parentheses.
    fn joined(&self, (node, parenthesised): (u32, bool)) -> Option<Infix> {
        self.infix(node).filter(|inner| !parenthesised && inner.operator.joins())
    }

    fn text(&self, start: u32, end: u32) -> &str {
        self.source.slice(Span::new(start, end)).trim()
    }

    /// The text of a comparison as the assembler computes it, with all parentheses.
    fn as_computed(&self, infix: &Infix) -> String {
        let (a, b) = self.gap(infix);
        let [left, right] = infix.operands;
        let operand = |operand, start, end| match (self.compared(operand), self.joined(operand)) {
            (Some(inner), _) => format!("({})", self.as_computed(&inner)),
            (None, Some(_)) => format!("({})", self.text(start, end)),
            (None, None) => self.text(start, end).to_owned(),
        };
        let (left, right) = (operand(left, infix.span.start, a), operand(right, b, infix.span.end));
        format!("{left} {} {right}", infix.operator.text())
    }

    /// The end of the left operand and the beginning of the right one, parentheses included.
    fn gap(&self, infix: &Infix) -> (u32, u32) {
        let [(left, _), (right, _)] = infix.operands;
        let (from, to) = (self.nodes[left as usize].span.end, self.nodes[right as usize].span.start);
        let between = self.source.slice(Span::new(from, to));
        let symbol = infix.operator.text();
        let at = from + between.find(symbol).unwrap_or(0) as u32;
        (at, at + symbol.len() as u32)
    }

    /// The conditions that a chain of comparisons was probably meant to express: `(a == b) & (c < d)` for `a == b & c < d`,
    /// `(a < b) & (b < c)` for `a < b < c`.
    fn as_meant(&self, infix: Infix) -> String {
        let mut chain = vec![infix];
        while let Some(inner) = chain.last().and_then(|last| self.compared(last.operands[0])) {
            chain.push(inner);
        }
        chain.reverse();
        let mut text = String::new();
        // The start of the current comparison. The operands joined to the first one precede it.
        let mut from = infix.span.start;
        if let Some(joined) = self.joined(chain[0].operands[0]) {
            let (_, end) = self.join(joined, 1);
            text = self.text(from, end).to_owned() + " ";
            from = end;
        }
        for (index, this) in chain.iter().enumerate() {
            let (a, b) = self.gap(this);
            let (end, is_last) = (this.span.end, index + 1 == chain.len());
            text += &format!("({} {} ", self.text(from, a), this.operator.text());
            // The right side of a comparison: several joined operands with only the first compared, or an operand that the next
            // comparison takes, too.
            match self.joined(this.operands[1]) {
                Some(joined) => {
                    let ((first, _), (_, last)) = (self.join(joined, 0), self.join(joined, 1));
                    let rest = if is_last { end } else { last };
                    text += &format!("{}) {}", self.text(b, first), self.text(first, rest));
                    from = last;
                }
                None => {
                    text += &format!("{})", self.text(b, end));
                    text += if is_last { "" } else { " &" };
                    from = b;
                }
            }
            text += if is_last { "" } else { " " };
        }
        text
    }

    /// The place of the first (0) or the last (1) of the operators that join an operand's parts.
    fn join(&self, mut joined: Infix, side: usize) -> (u32, u32) {
        while let Some(inner) = self.joined(joined.operands[side]) {
            joined = inner;
        }
        self.gap(&joined)
    }
}

fn expression(nodes: &[Node], source: &Source, sink: &mut Sink) {
    let compares = |node: &Node| matches!(node.kind, NodeKind::Infix(operator) if operator.compares());
    if !nodes.iter().any(compares) {
        return;
    }
    let tree = Tree { nodes, parts: parts(nodes), source };
    // Comparisons without parentheses inside a reported comparison.
    let mut told = vec![false; nodes.len()];
    for node in (0..nodes.len() as u32).rev() {
        let Some(infix) = tree.infix(node).filter(|infix| infix.operator.compares()) else { continue };
        let chained = tree.compared(infix.operands[0]);
        if chained.is_some() {
            told[infix.operands[0].0 as usize] = true;
        }
        let joined = infix.operands.into_iter().find_map(|operand| tree.joined(operand));
        if told[node as usize] || chained.is_none() && joined.is_none() {
            continue;
        }
        sink.add(Severity::Warning, "grouping", infix.span, || {
            let warning = |message: String| Diagnostic::warning("grouping", infix.span, message);
            // A longer correction is not written out: its nesting grows with its length.
            let is_short = (infix.span.end - infix.span.start) as usize <= limits::QUOTED_BYTES;
            let Some(joined) = joined.filter(|_| chained.is_none()) else {
                if !is_short {
                    return warning("the result of a comparison is compared".to_owned())
                        .help("put each condition in parentheses");
                }
                let (computed, meant) = (tree.as_computed(&infix), tree.as_meant(infix));
                return warning(format!("this is `{computed}`: the result of a comparison is compared"))
                    .mend(format!("write `{meant}` if each comparison is a condition"), meant);
            };
            let (join, symbol) = (joined.operator.text(), infix.operator.text());
            let warning = warning(format!("`{join}` binds more tightly than `{symbol}`"))
                .note("in other languages, as C, comparisons bind more tightly");
            if !is_short {
                return warning.help("put each part in parentheses");
            }
            let computed = tree.as_computed(&infix);
            warning.mend(format!("write `{computed}` if it is meant so"), computed)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intern::Interner;
    use crate::parse::parse;
    use takt_diagnostics::source::Sources;

    /// The replacements that the warnings of a line offer.
    fn offered(line: &str) -> Vec<String> {
        let (mut sources, mut sink) = (Sources::default(), Sink::default());
        sources.add("test.s", format!("{line}\n"));
        parse(&sources.files()[0].clone(), &mut Interner::new(), &mut sink);
        assert_eq!(sink.errors, 0, "{line}");
        let report = sink.finish(sources.into());
        report.list.iter().map(|warning| warning.replacement.clone().unwrap_or_default()).collect()
    }

    #[test]
    fn conditions_without_parentheses_get_them() {
        for (written, wanted) in [
            ("a == b & c < d", "(a == b) & (c < d)"),
            ("a < b < c", "(a < b) & (b < c)"),
            ("a<b|c<d&e<f", "(a < b) | (c < d) & (e < f)"),
            ("f & a < b & (g) | c+1 >= d & h", "f & (a < b) & (g) | (c+1 >= d) & h"),
            ("(a + 1) == (b) & (c - 2) < d", "((a + 1) == (b)) & ((c - 2) < d)"),
            // The computed grouping, where it may be the intended one.
            ("n & 1 == 0", "(n & 1) == 0"),
            ("a == b & c", "a == (b & c)"),
            ("a & b == c | d", "(a & b) == (c | d)"),
        ] {
            for line in
                [format!(" y = {written}"), format!(".const K = {written}"), format!(" li y, {written}")]
            {
                assert_eq!(offered(&line), [wanted], "{line}");
            }
            // The assembler accepts the corrections that it offers.
            assert!(offered(&format!(" y = {wanted}")).is_empty(), "{wanted}");
        }
        assert_eq!(offered(" y = x[a < b & c]"), ["a < (b & c)"]);
        assert_eq!(offered(" y = x{a < b & c}"), ["a < (b & c)"]);
    }

    #[test]
    fn accepts_unambiguous_conditions() {
        for line in [
            " y = (a < b) & (c < d)",
            " y = (n & 1) == 0",
            " y = (a < b) == (c < d)",
            " y = a & b | c << 2",
            " y = a < b ? c & d : e",
            " y = a < b + (c & d)",
            " fadd a, b, c || fmul d, e, f",
            " y, z = a < b, c < d",
        ] {
            assert!(offered(line).is_empty(), "{line}");
        }
    }

    #[test]
    fn long_chains_end() {
        let chain = vec!["a"; limits::EXPRESSION_NODES / 4].join("<");
        assert_eq!(offered(&format!(" y = {chain}")), [""]);
        assert_eq!(offered(&format!(" y = {}", chain.replacen('<', "&", 1))), [""]);
    }
}
