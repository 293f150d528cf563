// SPDX-License-Identifier: MIT OR Apache-2.0
//! Expressions of a core, evaluated to nodes of the graph.

use super::operations::{REFUSED, constant, operation, own};
use super::syntax::{Kind, Node, Tree, number};
use super::truth::{Truth, Value};
use super::{Definition, MAX_DEPTH, MAX_STEPS, Scope, properties};
use crate::Error;
use crate::graph::{Binary, Expr, Graph};
use std::collections::HashMap;
use std::rc::Rc;

/// Cores that others may call, by symbol.
pub(super) type Definitions<'a, 't> = HashMap<&'a str, Definition<'a, 't>>;

pub(super) struct Reader<'a, 't, 'g> {
    graph: &'g Graph,
    cores: &'t Definitions<'a, 't>,
    scope: Scope<'a, 'g>,
    /// Comment lines for the head of the source.
    pub(super) notes: Vec<String>,
    depth: usize,
    steps: usize,
}

/// Checks an annotation of `!`. True if it asks for more digits than binary32 has.
pub(super) fn annotation(key: &str, value: Tree<'_, '_>) -> Result<bool, Error> {
    match key {
        ":precision" => match value.word() {
            Some("binary32") => Ok(false),
            Some("binary64" | "real") => Ok(true),
            _ => Err(value
                .error(format!("`:precision {value}` is not supported: the machine computes in binary32"))),
        },
        ":round" => match value.word() {
            Some("nearestEven") => Ok(false),
            _ => Err(value.error(format!(
                "`:round {value}` is not supported: the machine rounds to nearest, ties to even"
            ))),
        },
        // Other properties describe an expression.
        _ => Ok(false),
    }
}

impl<'a, 't, 'g> Reader<'a, 't, 'g> {
    pub(super) fn new(graph: &'g Graph, cores: &'t Definitions<'a, 't>) -> Reader<'a, 't, 'g> {
        Reader { graph, cores, scope: Scope::new(), notes: Vec::new(), depth: 0, steps: 0 }
    }

    /// Notes that the core is written for more digits.
    pub(super) fn wide(&mut self) {
        self.note("written for binary64 or real numbers: computed in binary32");
    }

    fn note(&mut self, text: &str) {
        if !self.notes.iter().any(|known| known == text) {
            self.notes.push(text.to_owned());
        }
    }

    pub(super) fn precision(&mut self, value: Tree<'a, 't>) -> Result<(), Error> {
        if annotation(":precision", value)? {
            self.wide();
        }
        Ok(())
    }

    pub(super) fn rounding(&mut self, value: Tree<'a, 't>) -> Result<(), Error> {
        annotation(":round", value).map(|_| ())
    }

    /// Binds the core's arguments to its inputs, in this order.
    pub(super) fn bind_inputs(&mut self, arguments: &[&'a str]) {
        for (index, name) in arguments.iter().enumerate() {
            let input = self.graph.input(index);
            self.scope.insert(name, vec![Value::Number(input)]);
        }
    }

    pub(super) fn number(&mut self, tree: Tree<'a, 't>) -> Result<Expr<'g>, Error> {
        match self.value(tree)? {
            Value::Number(number) => Ok(number),
            Value::Truth(_) => Err(tree.error(format!("`{tree}` is a condition; expected a number"))),
        }
    }

    pub(super) fn truth(&mut self, tree: Tree<'a, 't>) -> Result<Rc<Truth<'g>>, Error> {
        match self.value(tree)? {
            Value::Truth(truth) => Ok(truth),
            Value::Number(_) => Err(tree.error(format!("`{tree}` is a number; expected a condition"))),
        }
    }

    fn value(&mut self, tree: Tree<'a, 't>) -> Result<Value<'g>, Error> {
        self.steps += 1;
        if self.steps > MAX_STEPS {
            return Err(tree.error(format!(
                "the core has more than {MAX_STEPS} expressions, loops and calls written out"
            )));
        }
        if self.depth >= MAX_DEPTH {
            return Err(tree.error(format!("expressions and calls nest deeper than {MAX_DEPTH}")));
        }
        self.depth += 1;
        let value = match tree.kind {
            Kind::Text(text) => Err(tree.error(format!("\"{text}\" is a text; expected a number"))),
            Kind::Word(word) => self.word(tree, word),
            Kind::List(parts) => self.list(tree, parts),
        };
        self.depth -= 1;
        value
    }

    fn word(&mut self, tree: Tree<'a, 't>, word: &'a str) -> Result<Value<'g>, Error> {
        if let Some(value) = self.scope.get(word).and_then(|values| values.last()) {
            return Ok(value.clone());
        }
        let known = match word {
            "TRUE" | "FALSE" => return Ok(Value::Truth(Rc::new(Truth::Known(word == "TRUE")))),
            _ => number(word).or_else(|| constant(word)),
        };
        match known {
            Some(value) if value.abs() <= f64::from(f32::MAX) => {
                Ok(Value::Number(self.graph.constant(value)))
            }
            Some(_) => {
                Err(tree
                    .error(format!("{word} does not fit binary32, whose largest number is {:e}", f32::MAX)))
            }
            None => {
                Err(tree.error(refused(word).unwrap_or_else(|| format!("there is no value `{word}` here"))))
            }
        }
    }

    fn list(&mut self, tree: Tree<'a, 't>, parts: &'t [Node<'a>]) -> Result<Value<'g>, Error> {
        let [head, operands @ ..] = parts else { return Err(tree.error("`()` has no value")) };
        let Some(name) = head.tree().word() else {
            return Err(tree.error(format!("`{tree}` begins with no operation")));
        };
        match (name, operands) {
            ("if", [condition, yes, no]) => {
                let condition = self.truth(condition.tree())?;
                match &*condition {
                    Truth::Known(true) => return self.value(yes.tree()),
                    Truth::Known(false) => return self.value(no.tree()),
                    _ => {}
                }
                match (self.value(yes.tree())?, self.value(no.tree())?) {
                    (Value::Number(yes), Value::Number(no)) => Ok(Value::Number(condition.choose(yes, no))),
                    (Value::Truth(yes), Value::Truth(no)) => {
                        let (yes, no) =
                            (Truth::all(vec![condition.clone(), yes]), Truth::all(vec![condition.not(), no]));
                        self.shallow(tree, Truth::any(vec![yes, no]))
                    }
                    _ => Err(tree.error(format!("one side of `{tree}` is a condition, the other a number"))),
                }
            }
            ("let" | "let*", [bindings, body]) => {
                let names = self.bind(bindings.tree(), name == "let*")?;
                let value = self.value(body.tree());
                self.unbind(&names);
                value
            }
            ("while" | "while*", [condition, bindings, body]) => {
                self.repeat(tree, name == "while*", condition.tree(), bindings.tree(), body.tree())
            }
            ("!", _) => {
                let (annotations, rest) = properties(operands)?;
                for (key, value) in annotations {
                    if annotation(key, value)? {
                        self.wide();
                    }
                }
                match rest {
                    [body] => self.value(body.tree()),
                    _ => Err(tree.error("`!` has properties and one expression")),
                }
            }
            ("cast", [operand]) => self.number(operand.tree()).map(Value::Number),
            ("digits", [digits, exponent, base]) => {
                let part = |node: &Node<'a>| node.tree().word().and_then(number);
                let value = match (part(digits), part(exponent), part(base)) {
                    (Some(digits), Some(exponent), Some(base)) => digits * base.powf(exponent),
                    _ => f64::NAN,
                };
                if value.abs() <= f64::from(f32::MAX) {
                    Ok(Value::Number(self.graph.constant(value)))
                } else {
                    Err(tree.error(format!("`{tree}` is no number of binary32")))
                }
            }
            ("and" | "or", _) => {
                let truths = operands
                    .iter()
                    .map(|operand| self.truth(operand.tree()))
                    .collect::<Result<Vec<_>, _>>()?;
                self.shallow(tree, if name == "and" { Truth::all(truths) } else { Truth::any(truths) })
            }
            ("not", [operand]) => Ok(Value::Truth(self.truth(operand.tree())?.not())),
            ("<" | ">" | "<=" | ">=" | "==" | "!=", _) => self.compared(name, operands),
            ("if" | "let" | "let*" | "while" | "while*" | "cast" | "digits" | "not", _) => Err(tree.error(
                format!("`{tree}` has {} parts, which is not the number for `{name}`", operands.len()),
            )),
            _ if self.cores.contains_key(name) => self.call(tree, name, operands),
            _ => self.operation(tree, name, operands).map(Value::Number),
        }
    }

    /// Comparison of each operand with the next; `!=` of each with every other.
    fn compared(&mut self, name: &str, operands: &'t [Node<'a>]) -> Result<Value<'g>, Error> {
        let numbers =
            operands.iter().map(|operand| self.number(operand.tree())).collect::<Result<Vec<_>, _>>()?;
        let mut all = Vec::new();
        for (place, a) in numbers.iter().enumerate() {
            let others = if name == "!=" {
                &numbers[place + 1..]
            } else {
                numbers.get(place + 1..=place + 1).unwrap_or_default()
            };
            for b in others {
                let truth = match name {
                    "<" => Truth::compare(Binary::Less, *a, *b),
                    "<=" => Truth::compare(Binary::LessEqual, *a, *b),
                    ">" => Truth::compare(Binary::Less, *b, *a),
                    ">=" => Truth::compare(Binary::LessEqual, *b, *a),
                    "==" => Truth::compare(Binary::Equal, *a, *b),
                    _ => Truth::compare(Binary::NotEqual, *a, *b),
                };
                all.push(Rc::new(truth));
            }
        }
        Ok(Value::Truth(Truth::all(all)))
    }

    /// A condition as a value.
    ///
    /// # Errors
    /// If conditions nest deeper than [`MAX_DEPTH`], which only loops can bring about.
    fn shallow(&self, tree: Tree<'a, 't>, truth: Rc<Truth<'g>>) -> Result<Value<'g>, Error> {
        match truth.depth() <= MAX_DEPTH {
            true => Ok(Value::Truth(truth)),
            false => Err(tree.error(format!("conditions nest deeper than {MAX_DEPTH}"))),
        }
    }

    fn operation(
        &mut self,
        tree: Tree<'a, 't>,
        name: &str,
        operands: &'t [Node<'a>],
    ) -> Result<Expr<'g>, Error> {
        let refused = || {
            tree.error(
                refused(name).unwrap_or_else(|| format!("there is no operation `{name}`; in `{tree}`")),
            )
        };
        let row = operation(name);
        if row.is_none() && !["fdim", "trunc", "round"].contains(&name) {
            return Err(refused());
        }
        let values =
            operands.iter().map(|operand| self.number(operand.tree())).collect::<Result<Vec<_>, _>>()?;
        if let Some(value) = own(name, &values) {
            return Ok(value);
        }
        let Some(row) = row.filter(|row| (row.operands.0..=row.operands.1).contains(&values.len())) else {
            return Err(tree.error(format!("`{name}` cannot have {} operands; in `{tree}`", values.len())));
        };
        if name == "fma" {
            self.note("fma is a product and a sum, each rounded");
        }
        Ok((row.meaning)(&values))
    }

    /// Calls another core of the file: its expression, with its arguments bound to the operands.
    fn call(&mut self, tree: Tree<'a, 't>, name: &str, operands: &'t [Node<'a>]) -> Result<Value<'g>, Error> {
        let cores = self.cores;
        let Some(core) = cores.get(name) else {
            return Err(tree.error(format!("there is no core `{name}`")));
        };
        if core.arguments.len() != operands.len() {
            let count = core.arguments.len();
            return Err(
                tree.error(format!("`{name}` has {count} arguments, and {} are given", operands.len()))
            );
        }
        let mut scope = Scope::new();
        for (argument, operand) in core.arguments.iter().zip(operands) {
            scope.insert(argument, vec![self.value(operand.tree())?]);
        }
        for key in [":precision", ":round"] {
            if let Some(value) = core.property(key)
                && annotation(key, value)?
            {
                self.wide();
            }
        }
        let outer = std::mem::replace(&mut self.scope, scope);
        let value = self.value(core.body);
        self.scope = outer;
        value
    }

    /// Binds names to values: one after the other, or all at once. Returns the names.
    fn bind(&mut self, bindings: Tree<'a, 't>, in_turn: bool) -> Result<Vec<&'a str>, Error> {
        let mut values = Vec::new();
        let mut names = Vec::new();
        for binding in bindings.list().unwrap_or_default() {
            let tree = binding.tree();
            let (Some(name), Some(first)) = parts_of_binding(tree) else {
                return Err(tree.error(format!("`{tree}` binds no name to a value")));
            };
            let value = self.value(first)?;
            if in_turn {
                self.scope.entry(name).or_default().push(value);
            } else {
                values.push((name, value));
            }
            names.push(name);
        }
        for (name, value) in values {
            self.scope.entry(name).or_default().push(value);
        }
        Ok(names)
    }

    fn unbind(&mut self, names: &[&'a str]) {
        for name in names {
            if let Some(values) = self.scope.get_mut(name) {
                values.pop();
            }
        }
    }

    /// Writes a loop out whose condition is known in every iteration.
    fn repeat(
        &mut self,
        tree: Tree<'a, 't>,
        in_turn: bool,
        condition: Tree<'a, 't>,
        bindings: Tree<'a, 't>,
        body: Tree<'a, 't>,
    ) -> Result<Value<'g>, Error> {
        let names = self.bind(bindings, in_turn)?;
        loop {
            match &*self.truth(condition)? {
                Truth::Known(true) => {}
                Truth::Known(false) => break,
                _ => {
                    return Err(tree.error(format!(
                        "the loop's condition `{condition}` depends on the arguments; a loop is written out only if its condition depends on \
                         constants"
                    )));
                }
            }
            let mut next = Vec::new();
            for binding in bindings.list().unwrap_or_default() {
                let tree = binding.tree();
                let update = tree.list().and_then(|parts| parts.get(2)).map(Node::tree);
                let (Some(name), Some(update)) = (parts_of_binding(tree).0, update) else {
                    return Err(tree.error(format!("`{tree}` has no value for the next iteration")));
                };
                let value = self.value(update)?;
                match in_turn {
                    true => self.set(name, value),
                    false => next.push((name, value)),
                }
            }
            for (name, value) in next {
                self.set(name, value);
            }
        }
        let value = self.value(body);
        self.unbind(&names);
        value
    }

    fn set(&mut self, name: &'a str, value: Value<'g>) {
        if let Some(last) = self.scope.get_mut(name).and_then(|values| values.last_mut()) {
            *last = value;
        }
    }
}

/// Name and first value of a binding.
fn parts_of_binding<'a, 't>(tree: Tree<'a, 't>) -> (Option<&'a str>, Option<Tree<'a, 't>>) {
    let part = |place: usize| tree.list().and_then(|parts| parts.get(place)).map(Node::tree);
    (part(0).and_then(Tree::word), part(1))
}

fn refused(name: &str) -> Option<String> {
    let (_, mend) = REFUSED.iter().find(|(refused, _)| *refused == name)?;
    Some(format!("`{name}` is not supported: {mend}"))
}
