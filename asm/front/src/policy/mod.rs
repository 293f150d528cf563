// SPDX-License-Identifier: MIT OR Apache-2.0
//! Learned policies: a network in ONNX becomes a program of fixed cycles, with its weights in data memory.

mod external_data;
mod functions;
mod merge;
mod moves;
mod onnx;
mod operators;
mod read;
mod stages;
mod tensor;
mod write;

pub use external_data::external_data;
pub use functions::{FUNCTIONS, Function};
pub use operators::{OPERATORS, Operator, REFUSED};
pub use read::{MAX_BYTES, read};
pub use tensor::{Element, Files};
pub use write::{Source, source};

use crate::graph::{Expr, Graph, Id, evaluate};
use functions::REWRITES;

/// Maximum number of weights of a layer, or of elements of an array: the largest data memory in words.
pub const MAX_NUMBERS: usize = 1 << 16;

/// Operand of an elementwise step.
#[derive(Clone, PartialEq, Debug)]
pub enum Operand {
    /// Element of a vector, at the result's index plus `first`.
    Vector {
        /// Step that computes the vector.
        vector: usize,
        /// Index of the element that the first result reads.
        first: usize,
    },
    /// A single element, for all results.
    One {
        /// Step that computes the vector.
        vector: usize,
        /// Index of the element, from 0.
        at: usize,
    },
    /// A constant for each result.
    Numbers(Vec<f64>),
}

/// Reduction of several numbers to one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reduction {
    /// Sum of the elements.
    Sum,
    /// Arithmetic mean of the elements.
    Mean,
    /// Greatest of the elements.
    Max,
    /// Least of the elements.
    Min,
}

/// A step: the computation of one vector.
#[derive(Clone, Debug)]
pub enum Step {
    /// Input of the network, step 0.
    Input,
    /// Dense layer: products with weights, added to a bias.
    Dense {
        /// Step whose vector is multiplied.
        vector: usize,
        /// Index of the first element that is multiplied.
        first: usize,
        /// Weight matrix in row-major order: a row per result, a column per multiplied element.
        weights: Vec<f64>,
        /// Summands, a number per result.
        bias: Vec<f64>,
    },
    /// Elementwise function of vectors and constants.
    Each {
        /// Row of the table of operators.
        function: &'static Function,
        /// Values for [`Function::parameters`], in order.
        parameters: Vec<f64>,
        /// Operands in the order of the function's arguments.
        operands: Vec<Operand>,
    },
    /// A number for each group of adjacent elements.
    Reduce {
        /// Reduction applied to each group.
        reduction: Reduction,
        /// Step whose whole vector is reduced.
        vector: usize,
        /// Number of elements of a group.
        group: usize,
    },
    /// Elements of other vectors, and constants, put together.
    Gather(Vec<Element>),
}

impl Step {
    /// Steps whose vectors this step reads.
    pub fn reads(&self) -> Vec<usize> {
        match self {
            Step::Input => Vec::new(),
            Step::Dense { vector, .. } | Step::Reduce { vector, .. } => vec![*vector],
            Step::Each { operands, .. } => operands.iter().filter_map(Operand::vector).collect(),
            Step::Gather(elements) => {
                let vector = |element: &Element| match element {
                    Element::Of { vector, .. } => Some(*vector),
                    Element::Number(_) => None,
                };
                let mut vectors: Vec<usize> = elements.iter().filter_map(vector).collect();
                vectors.dedup();
                vectors
            }
        }
    }
}

impl Operand {
    fn vector(&self) -> Option<usize> {
        match self {
            Operand::Vector { vector, .. } | Operand::One { vector, .. } => Some(*vector),
            Operand::Numbers(_) => None,
        }
    }

    /// The constant, if it is the same for every result.
    fn uniform(&self) -> Option<f64> {
        match self {
            Operand::Numbers(values) if values.iter().all(|value| *value == values[0]) => {
                values.first().copied()
            }
            _ => None,
        }
    }
}

/// An array of ports.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Vector {
    /// Name in the ONNX file, not yet unique.
    pub name: String,
    /// Number of elements, and so of ports.
    pub length: usize,
}

/// A policy: steps in order, each reading only vectors of earlier steps.
#[derive(Clone, Debug)]
pub struct Network {
    /// Name of the policy, for the head of the source.
    pub name: String,
    /// Argument of the network: the vector of step 0.
    pub input: Vector,
    /// Result of the network: the vector of step [`Network::result`].
    pub output: Vector,
    /// Steps in order of computation; some may be unused.
    pub steps: Vec<Step>,
    /// Length of each step's vector.
    pub lengths: Vec<usize>,
    /// Step that computes the output.
    pub result: usize,
    /// Comment lines for the head of the source.
    pub notes: Vec<String>,
    /// Roundings stay as in the file, as far as the machine's operations allow: see [`Network::merged`].
    pub exact: bool,
}

/// Expression of a function whose operands are inputs of the graph, except for uniform constants.
fn expression<'g>(
    graph: &'g Graph,
    function: &Function,
    parameters: &[f64],
    operands: &[Operand],
) -> Expr<'g> {
    let operand = |(index, operand): (usize, &Operand)| match operand.uniform() {
        Some(value) => graph.constant(value),
        None => graph.input(index),
    };
    let operands: Vec<Expr<'g>> = operands.iter().enumerate().map(operand).collect();
    (function.meaning)(&operands, parameters)
}

impl Network {
    /// Output for an input of `self.input.length` numbers, in binary64.
    pub fn evaluate(&self, x: &[f64]) -> Vec<f64> {
        let used = self.uses();
        let mut vectors: Vec<Vec<f64>> = Vec::new();
        for (index, step) in self.steps.iter().enumerate() {
            vectors.push(match step {
                Step::Input => x.to_vec(),
                _ if used[index] == 0 => Vec::new(),
                _ => self.step(index, step, &vectors),
            });
        }
        vectors.swap_remove(self.result)
    }

    fn step(&self, index: usize, step: &Step, vectors: &[Vec<f64>]) -> Vec<f64> {
        let element = |element: &Element| match element {
            Element::Number(value) => *value,
            Element::Of { vector, at } => vectors[*vector][*at],
        };
        match step {
            Step::Input => Vec::new(),
            Step::Dense { vector, first, weights, bias } => {
                let columns = weights.len() / bias.len();
                let x = &vectors[*vector][*first..first + columns];
                let row =
                    |(row, bias): (&[f64], &f64)| bias + row.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
                weights.chunks(columns).zip(bias).map(row).collect()
            }
            Step::Each { function, parameters, operands } => {
                let graph = Graph::new(REWRITES);
                let result: Id = expression(&graph, function, parameters, operands).id();
                let value = |operand: &Operand, at: usize| match operand {
                    Operand::Vector { vector, first } => vectors[*vector][first + at],
                    Operand::One { vector, at } => vectors[*vector][*at],
                    Operand::Numbers(values) => values[at],
                };
                let each = |at: usize| {
                    let inputs: Vec<f64> = operands.iter().map(|operand| value(operand, at)).collect();
                    evaluate(&graph, &[result], &inputs)[0]
                };
                (0..self.lengths[index]).map(each).collect()
            }
            Step::Reduce { reduction, vector, group } => {
                vectors[*vector].chunks(*group).map(|group| reduction.of(group)).collect()
            }
            Step::Gather(elements) => elements.iter().map(element).collect(),
        }
    }

    /// Number of reads of each step's vector, by live steps and by the output.
    pub fn uses(&self) -> Vec<u32> {
        let mut uses = vec![0; self.steps.len()];
        uses[self.result] = 1;
        for (index, step) in self.steps.iter().enumerate().rev() {
            if uses[index] > 0 {
                step.reads().into_iter().for_each(|vector| uses[vector] += 1);
            }
        }
        uses
    }

    /// Steps on which the output depends.
    fn used(&self) -> impl Iterator<Item = &Step> {
        self.steps.iter().zip(self.uses()).filter(|(_, uses)| *uses > 0).map(|(step, _)| step)
    }

    /// Number of weights, without biases.
    pub fn weights(&self) -> usize {
        let weights = |step: &Step| if let Step::Dense { weights, .. } = step { weights.len() } else { 0 };
        self.used().map(weights).sum()
    }

    /// Lengths of the vectors between layers, as in `48-128-128-12`.
    pub fn shape(&self) -> String {
        let mut text = self.input.length.to_string();
        for step in self.used() {
            if let Step::Dense { bias, .. } = step {
                text += &format!("-{}", bias.len());
            }
        }
        text
    }

    /// Names of the activation functions, each once.
    pub fn activations(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        for step in self.used() {
            if let Step::Each { function, .. } = step
                && !function.is_arithmetic()
                && !names.contains(&function.name)
            {
                names.push(function.name);
            }
        }
        names
    }

    /// Merges steps: layers absorb biases. Unless `exact`, layers also absorb normalisation factors, which changes rounding, and tanh is
    /// accurate to an absolute 10⁻⁷ rather than to the last digit near zero. Subtractions at the input are kept: folded into a layer's
    /// bias, they would lose digits to cancellation.
    #[must_use]
    pub fn merged(self, exact: bool) -> Network {
        merge::merged(Network { exact, ..self })
    }
}

impl Reduction {
    fn of(self, group: &[f64]) -> f64 {
        let sum = || group.iter().sum::<f64>();
        match self {
            Reduction::Sum => sum(),
            Reduction::Mean => sum() / group.len() as f64,
            Reduction::Max => group.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            Reduction::Min => group.iter().copied().fold(f64::INFINITY, f64::min),
        }
    }
}
