// SPDX-License-Identifier: MIT OR Apache-2.0
//! Executes statements. The result is the condition for reaching the statement's end; other ways out are outcomes.

use super::{Exec, Scope};
use crate::Error;
use crate::c::ir::Op;
use crate::c::value::{Condition, Exit, Outcome, Typed, Value};
use lang_c::ast::{BlockItem, Expression, Label, Statement, SwitchStatement};
use lang_c::span::Node;

const REACHED: Result<Condition, Error> = Ok(Condition::Known(true));

/// A statement of a `switch`, with the labels before it.
struct Arm<'a> {
    values: Vec<&'a Node<Expression>>,
    default: bool,
    item: Item<'a>,
}

#[derive(Clone, Copy)]
enum Item<'a> {
    Block(&'a Node<BlockItem>),
    Statement(&'a Node<Statement>),
}

impl<'a> Exec<'a> {
    /// Executes the items of a block. After an item whose end is reached only under a condition, the rest depends on it.
    pub(super) fn items(
        &mut self,
        items: &'a [Node<BlockItem>],
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        for (index, item) in items.iter().enumerate() {
            let rest = &items[index + 1..];
            let mut inner = Vec::new();
            let reached = self.item(item, &mut inner)?;
            let target = inner.iter().filter_map(|outcome| match &outcome.exit {
                Exit::Goto(label) => rest.iter().position(|item| label_of(item) == Some(label)),
                _ => None,
            });
            if let Some(target) = target.min() {
                return self.landed(reached, inner, rest, target, out);
            }
            out.extend(inner);
            match reached {
                Condition::Known(true) => {}
                Condition::Known(false) => return Ok(reached),
                Condition::Node(_) => {
                    return self.guarded(reached, &mut |exec, out| exec.items(rest, out), out);
                }
            }
        }
        REACHED
    }

    /// Continues at a label to which some paths jumped: the other paths execute the statements before it.
    fn landed(
        &mut self,
        reached: Condition,
        mut inner: Vec<Outcome>,
        rest: &'a [Node<BlockItem>],
        target: usize,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        let (between, behind) = rest.split_at(target);
        let label = label_of(&rest[target]).cloned().unwrap_or_default();
        let normal = self.guarded(reached, &mut |exec, out| exec.items(between, out), &mut inner)?;
        let lands = |exit: &Exit| matches!(exit, Exit::Goto(name) if *name == label);
        let mut leaving = Vec::new();
        let met = self.absorbed(normal, inner, &lands, &mut leaving)?;
        // Jumps to labels further on have not landed yet.
        let further = leaving.iter().any(|outcome| match &outcome.exit {
            Exit::Goto(label) => behind.iter().any(|item| label_of(item) == Some(label)),
            _ => false,
        });
        if further {
            return self.fail("jumps to several labels of one block cross: use `if` and `else`");
        }
        out.extend(leaving);
        self.guarded(met, &mut |exec, out| exec.items(behind, out), out)
    }

    fn item(&mut self, item: &'a Node<BlockItem>, out: &mut Vec<Outcome>) -> Result<Condition, Error> {
        match &item.node {
            BlockItem::Declaration(declaration) => {
                self.enter(declaration)?;
                self.declaration(&declaration.node)?;
                REACHED
            }
            BlockItem::StaticAssert(_) => REACHED,
            BlockItem::Statement(statement) => self.statement(statement, out),
        }
    }

    pub(super) fn statement(
        &mut self,
        statement: &'a Node<Statement>,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        self.enter(statement)?;
        self.depth += 1;
        let reached = self.decisive(&mut |exec, out| exec.executed(statement, out), out);
        self.depth -= 1;
        reached
    }

    fn executed(
        &mut self,
        statement: &'a Node<Statement>,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        match &statement.node {
            Statement::Compound(items) => {
                self.open();
                let reached = self.items(items, out);
                self.close();
                reached
            }
            Statement::Expression(expression) => {
                if let Some(expression) = expression {
                    self.effect(expression)?;
                }
                REACHED
            }
            Statement::If(node) => {
                let condition = self.condition(&node.node.condition)?;
                let (then, other) = (&*node.node.then_statement, node.node.else_statement.as_deref());
                self.go(statement.span);
                self.either(
                    condition,
                    &mut |exec, out| exec.statement(then, out),
                    &mut |exec, out| match other {
                        Some(other) => exec.statement(other, out),
                        None => REACHED,
                    },
                    out,
                )
            }
            Statement::Return(value) => {
                if let Some(value) = value {
                    let value = self.value(value)?;
                    self.give(value)?;
                }
                self.exit(Exit::Return, out)
            }
            Statement::Break => self.exit(Exit::Break, out),
            Statement::Continue => self.exit(Exit::Continue, out),
            Statement::Goto(label) => self.exit(Exit::Goto(label.node.name.clone()), out),
            Statement::Labeled(node) => match &node.node.label.node {
                Label::Identifier(_) => self.statement(&node.node.statement, out),
                _ => self.fail("`case` stands inside another statement of the `switch`: put it at the switch's own level"),
            },
            Statement::Switch(node) => self.switch(&node.node, out),
            Statement::While(_) | Statement::DoWhile(_) | Statement::For(_) => {
                self.repetition(statement, out)
            }
            Statement::Asm(_) => self.fail("`asm` is not translated: write the operation in C"),
        }
    }

    fn exit(&mut self, exit: Exit, out: &mut Vec<Outcome>) -> Result<Condition, Error> {
        out.push(Outcome { exit, when: Condition::Known(true), memory: self.memory.clone() });
        Ok(Condition::Known(false))
    }

    /// Executes the side that a condition chooses, or both.
    pub(super) fn either(
        &mut self,
        condition: Condition,
        then: super::paths::Side<'_, 'a>,
        other: super::paths::Side<'_, 'a>,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        match condition {
            Condition::Known(true) => then(self, out),
            Condition::Known(false) => other(self, out),
            Condition::Node(id) => self.fork(id, then, other, out),
        }
    }

    pub(super) fn open(&mut self) {
        if let Some(frame) = self.frames.last_mut() {
            frame.scopes.push(Scope::default());
        }
    }

    pub(super) fn close(&mut self) {
        if let Some(frame) = self.frames.last_mut() {
            frame.scopes.pop();
        }
    }

    fn switch(&mut self, switch: &'a SwitchStatement, out: &mut Vec<Outcome>) -> Result<Condition, Error> {
        let value = self.value(&switch.expression)?;
        let value = self.promoted(value)?;
        let Statement::Compound(items) = &switch.statement.node else {
            return self.fail("the body of a `switch` is a block in braces");
        };
        let mut arms = Vec::new();
        for item in items {
            arms.push(arm(item));
        }
        self.open();
        let mut inner = Vec::new();
        let normal = self.dispatched(&value, &arms, 0, &mut inner);
        self.close();
        self.absorbed(normal?, inner, &|exit| *exit == Exit::Break, out)
    }

    /// Executes the arm that the value chooses, among those from `from` on; the default if there is none.
    fn dispatched(
        &mut self,
        value: &Typed,
        arms: &[Arm<'a>],
        from: usize,
        out: &mut Vec<Outcome>,
    ) -> Result<Condition, Error> {
        for (index, arm) in arms.iter().enumerate().skip(from) {
            // A default next to values is taken unless another value matches.
            if arm.values.is_empty() || arm.default {
                continue;
            }
            let mut any = Condition::Known(false);
            for case in &arm.values {
                let case = self.value(case)?;
                let equal = self.compared(Op::IntEqual, value.clone(), case)?;
                any = self.or(any, equal)?;
            }
            match any {
                Condition::Known(false) => {}
                Condition::Known(true) => return self.arms(&arms[index..], out),
                Condition::Node(id) => {
                    return self.fork(
                        id,
                        &mut |exec, out| exec.arms(&arms[index..], out),
                        &mut |exec, out| exec.dispatched(value, arms, index + 1, out),
                        out,
                    );
                }
            }
        }
        match arms.iter().position(|arm| arm.default) {
            Some(index) => self.arms(&arms[index..], out),
            None => REACHED,
        }
    }

    fn arms(&mut self, arms: &[Arm<'a>], out: &mut Vec<Outcome>) -> Result<Condition, Error> {
        for (index, arm) in arms.iter().enumerate() {
            let reached = match arm.item {
                Item::Block(item) => self.item(item, out)?,
                Item::Statement(statement) => self.statement(statement, out)?,
            };
            match reached {
                Condition::Known(true) => {}
                Condition::Known(false) => return Ok(reached),
                Condition::Node(_) => {
                    let rest = &arms[index + 1..];
                    return self.guarded(reached, &mut |exec, out| exec.arms(rest, out), out);
                }
            }
        }
        REACHED
    }

    /// Writes a function's result.
    fn give(&mut self, value: Typed) -> Result<(), Error> {
        let Some(frame) = self.frames.last() else { return Ok(()) };
        let (Some(result), ty) = (frame.result, frame.signature.result.clone()) else {
            return Ok(());
        };
        let value = self.converted(value, &ty)?;
        let place = self.place_of(result);
        self.store(&place, Typed { ty, value })
    }

    pub(super) fn unset_is_read<T>(&self, name: &str) -> Result<T, Error> {
        self.fail(format!("`{name}` is read before it is written: give it a value where it is declared"))
    }

    /// Reads a scalar that must have a value.
    pub(super) fn present(&self, value: &Value, name: &str) -> Result<Value, Error> {
        match value {
            Value::Unset => self.unset_is_read(name),
            Value::Mixed(reason) => self.fail(format!("`{name}` is {reason}")),
            value => Ok(value.clone()),
        }
    }
}

fn label_of(item: &Node<BlockItem>) -> Option<&String> {
    match &item.node {
        BlockItem::Statement(Node { node: Statement::Labeled(node), .. }) => match &node.node.label.node {
            Label::Identifier(name) => Some(&name.node.name),
            _ => None,
        },
        _ => None,
    }
}

/// Splits labels from the statement after them.
fn arm(item: &Node<BlockItem>) -> Arm<'_> {
    let (mut values, mut default, mut found) = (Vec::new(), false, Item::Block(item));
    let mut next = match &item.node {
        BlockItem::Statement(statement) => Some(statement),
        _ => None,
    };
    while let Some(Node { node: Statement::Labeled(node), .. }) = next {
        match &node.node.label.node {
            Label::Case(value) => values.push(&**value),
            Label::Default => default = true,
            Label::Identifier(_) | Label::CaseRange(_) => break,
        }
        found = Item::Statement(&node.node.statement);
        next = Some(&node.node.statement);
    }
    Arm { values, default, item: found }
}
