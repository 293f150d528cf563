// SPDX-License-Identifier: MIT OR Apache-2.0
//! Equations of an element: the functions of a stage as one expression, with shared subexpressions in registers.

use super::super::functions::{Function, REWRITES};
use super::super::stages::Stage;
use super::super::{Operand, Step};
use super::Writer;
use crate::Error;
use crate::graph::Port;
use crate::graph::{Expr, Graph, Id};
use crate::sink::{Terms, of_library};
use std::collections::HashMap;
use std::fmt::Write;

/// Texts of the elements that an expression reads, each once.
#[derive(Default)]
struct Leaves {
    ports: Vec<Port>,
    index: HashMap<String, usize>,
    /// By text: reading it costs a load or a computation, so repeated reads deserve a register.
    heavy: Vec<bool>,
}

impl Leaves {
    fn leaf<'g>(&mut self, graph: &'g Graph, text: String, heavy: bool) -> Expr<'g> {
        let index = *self.index.entry(text.clone()).or_insert_with(|| {
            self.ports.push(Port::new(text, String::new()));
            self.heavy.push(heavy);
            self.ports.len() - 1
        });
        graph.input(index)
    }
}

/// Expressions of steps, each built once.
type BuiltSteps<'g> = HashMap<usize, Expr<'g>>;

/// Location of the element being computed.
struct ElementPosition<'a> {
    /// Texts of elements already computed, by step.
    known: &'a HashMap<usize, String>,
    index: &'a str,
    /// Inside a loop, which reads vectors in memory.
    loops: bool,
}

impl Writer<'_> {
    /// Functions of a stage, in order.
    pub(super) fn functions(&self, stage: &Stage) -> Vec<&'static Function> {
        let steps = self.network.steps.iter().zip(&stage.inside).filter(|(_, inside)| **inside);
        steps
            .filter_map(
                |(step, _)| if let Step::Each { function, .. } = step { Some(*function) } else { None },
            )
            .collect()
    }

    /// The stage calls a macro.
    pub(super) fn is_long(&self, stage: &Stage) -> bool {
        let steps = self.network.steps.iter().zip(&stage.inside).filter(|(_, inside)| **inside);
        steps.into_iter().any(|(step, _)| match step {
            Step::Each { function, parameters, .. } => function.is_long(parameters),
            _ => false,
        })
    }

    /// Writes the equations of a step's element and assigns it to `to`.
    pub(super) fn element(
        &mut self,
        stage: &Stage,
        step: usize,
        known: &HashMap<usize, String>,
        to: &str,
        index: &str,
        loops: bool,
    ) -> Result<(), Error> {
        let graph = Graph::new(REWRITES);
        let mut leaves = Leaves::default();
        let at = ElementPosition { known, index, loops };
        let result = self.expression(&graph, (&mut leaves, &mut BuiltSteps::new()), stage, step, &at)?.id();
        let uses = graph.uses(&[result]);
        let mut names: HashMap<Id, String> = HashMap::new();
        for (place, &used) in uses.iter().enumerate() {
            let id = graph.id_at(place);
            let node = graph.node(id);
            self.library |= used > 0 && of_library(node);
            let heavy = match node {
                crate::graph::Node::Input(input) => leaves.heavy[input as usize],
                _ => node.operates() && !graph.is_condition(id),
            };
            if used > 1 && heavy {
                let name = self.names.unique("t");
                let text = self.terms(&graph, &leaves, &names).operation(id).text;
                let _ = writeln!(self.code, "        {name} = {text}");
                self.scalars.push(name.clone());
                names.insert(id, name);
            }
        }
        let text = self.terms(&graph, &leaves, &names).operand(result).text;
        let _ = writeln!(self.code, "        {to} = {text}");
        Ok(())
    }

    /// Text of a step's element within a larger expression; free of macros.
    pub(super) fn term(&mut self, stage: &Stage, step: usize, index: &str) -> Result<String, Error> {
        let graph = Graph::new(REWRITES);
        let mut leaves = Leaves::default();
        let at = ElementPosition { known: &HashMap::new(), index, loops: false };
        let result = self.expression(&graph, (&mut leaves, &mut BuiltSteps::new()), stage, step, &at)?.id();
        Ok(self.terms(&graph, &leaves, &HashMap::new()).operand(result).text)
    }

    fn terms<'t>(&self, graph: &'t Graph, leaves: &'t Leaves, names: &'t HashMap<Id, String>) -> Terms<'t> {
        Terms { graph, inputs: &leaves.ports, names, depth: usize::MAX, quick: !self.network.exact }
    }

    fn expression<'g>(
        &mut self,
        graph: &'g Graph,
        (leaves, made): (&mut Leaves, &mut BuiltSteps<'g>),
        stage: &Stage,
        step: usize,
        at: &ElementPosition<'_>,
    ) -> Result<Expr<'g>, Error> {
        if let Some(expression) = made.get(&step) {
            return Ok(*expression);
        }
        if let Some(text) = at.known.get(&step) {
            return Ok(leaves.leaf(graph, text.clone(), true));
        }
        let (Step::Each { function, parameters, operands }, true) =
            (&self.network.steps[step], stage.inside[step])
        else {
            return Ok(self.read(graph, leaves, step, at.index, at.loops));
        };
        let length = self.network.lengths[step];
        let mut values = Vec::new();
        for operand in operands {
            values.push(match operand {
                Operand::Vector { vector, first: 0 } => {
                    self.expression(graph, (&mut *leaves, &mut *made), stage, *vector, at)?
                }
                Operand::Vector { vector, first } => {
                    self.read(graph, leaves, *vector, &super::plus(*first, at.index), at.loops)
                }
                Operand::One { vector, at: place } => {
                    self.read(graph, leaves, *vector, &(place + 1).to_string(), false)
                }
                Operand::Numbers(by) => match operand.uniform() {
                    Some(value) => graph.constant(value),
                    None => {
                        let name = self.names.unique("c1");
                        self.arrays.values(&name, &[length], by)?;
                        leaves.leaf(graph, format!("{name}[{}]", at.index), true)
                    }
                },
            });
        }
        let expression = (function.meaning)(&values, parameters);
        made.insert(step, expression);
        Ok(expression)
    }

    /// Reads an element of a stored vector.
    fn read<'g>(
        &self,
        graph: &'g Graph,
        leaves: &mut Leaves,
        step: usize,
        index: &str,
        loops: bool,
    ) -> Expr<'g> {
        let place = self.places.get(&step);
        let copy = self.copies.get(&step).filter(|_| loops);
        let in_memory = copy.is_some() || matches!(place, Some(super::Place::Memory(_)));
        let name = copy.map(String::as_str).or(place.map(super::Place::name)).unwrap_or_default();
        leaves.leaf(graph, format!("{name}[{index}]"), in_memory)
    }
}
