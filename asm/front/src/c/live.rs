// SPDX-License-Identifier: MIT OR Apache-2.0
//! Liveness: which values the outputs, states and stores need.

use super::ir::{Block, Id, Node, Nodes, Statement};

/// Values and variables that are needed.
pub(super) struct Live {
    pub(super) nodes: Vec<bool>,
    pub(super) vars: Vec<bool>,
}

impl Live {
    /// Liveness of a block: stores, conditions of statements with an effect, and the given values and variables are live.
    pub(super) fn of(nodes: &Nodes, block: &Block, roots: &[Id], vars: &[usize]) -> Live {
        let mut live = Live { nodes: vec![false; nodes.len()], vars: vec![false; nodes.vars.len()] };
        for var in vars {
            live.vars[*var] = true;
        }
        for root in roots {
            live.mark(nodes, *root);
        }
        // Fixpoint: a loop's variables may need values from later in its body.
        while live.block(nodes, block).1 {}
        live
    }

    fn mark(&mut self, nodes: &Nodes, id: Id) -> bool {
        let mut stack = vec![id];
        let mut changed = false;
        while let Some(id) = stack.pop() {
            if std::mem::replace(&mut self.nodes[id.0 as usize], true) {
                continue;
            }
            changed = true;
            if let Node::Var(var, _) = nodes.node(id) {
                self.vars[var] = true;
            }
            stack.extend(nodes.operands(id));
        }
        changed
    }

    /// Marks a block backwards; returns (the block has an effect, a node or variable has become live).
    fn block(&mut self, nodes: &Nodes, block: &Block) -> (bool, bool) {
        let (mut effect, mut changed) = (false, false);
        for (statement, _) in block.iter().rev() {
            let (own, new) = match statement {
                Statement::Def(id) => (self.nodes[id.0 as usize], false),
                Statement::Store { index, value, .. } => {
                    (true, self.mark(nodes, *index) | self.mark(nodes, *value))
                }
                Statement::Set(pairs) => {
                    let mut found = (false, false);
                    for (var, value) in pairs {
                        if self.vars[*var] {
                            found = (true, found.1 | self.mark(nodes, *value));
                        }
                    }
                    found
                }
                Statement::If { condition, then, other } => {
                    let (a, b) = (self.block(nodes, then), self.block(nodes, other));
                    let own = a.0 || b.0;
                    (own, a.1 | b.1 | (own && self.mark(nodes, *condition)))
                }
                Statement::For { body, .. } => self.block(nodes, body),
                Statement::Loop { body, again, .. } => {
                    let found = self.block(nodes, body);
                    (found.0, found.1 | (found.0 && self.mark(nodes, *again)))
                }
            };
            effect |= own;
            changed |= new;
        }
        (effect, changed)
    }

    /// The block without dead values and statements.
    pub(super) fn pruned(&self, block: Block) -> Block {
        let mut kept = Block::new();
        for (statement, place) in block {
            let statement = match statement {
                Statement::Def(id) if !self.nodes[id.0 as usize] => continue,
                Statement::Set(mut pairs) => {
                    pairs.retain(|(var, _)| self.vars[*var]);
                    if pairs.is_empty() {
                        continue;
                    }
                    Statement::Set(pairs)
                }
                Statement::If { condition, then, other } => {
                    let (then, other) = (self.pruned(then), self.pruned(other));
                    if then.is_empty() && other.is_empty() {
                        continue;
                    }
                    Statement::If { condition, then, other }
                }
                Statement::For { index, first, last, step, body } => {
                    let body = self.pruned(body);
                    if body.is_empty() {
                        continue;
                    }
                    Statement::For { index, first, last, step, body }
                }
                Statement::Loop { bound, body, again } => {
                    let body = self.pruned(body);
                    if body.is_empty() || !self.nodes[again.0 as usize] {
                        continue;
                    }
                    Statement::Loop { bound, body, again }
                }
                other => other,
            };
            kept.push((statement, place));
        }
        kept
    }
}
