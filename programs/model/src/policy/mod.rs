// SPDX-License-Identifier: MIT OR Apache-2.0
//! Learned policies: a multi-layer perceptron in ONNX becomes a program of fixed cycles, with its weights in data memory.

mod merge;
mod onnx;
mod read;
mod write;

pub use read::{MAX_BYTES, read};
pub use write::{Source, source};

/// A function of one number that stands behind a layer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Activation {
    /// max(x, 0).
    Relu,
    /// The hyperbolic tangent.
    Tanh,
    /// 1/(1 + e⁻ˣ).
    Sigmoid,
    /// x, or alpha·(eˣ - 1) below 0.
    Elu(f64),
    /// The nearest number between the two.
    Clip(f64, f64),
}

impl Activation {
    /// Its name, as ONNX has it.
    pub fn name(self) -> &'static str {
        match self {
            Activation::Relu => "Relu",
            Activation::Tanh => "Tanh",
            Activation::Sigmoid => "Sigmoid",
            Activation::Elu(_) => "Elu",
            Activation::Clip(..) => "Clip",
        }
    }

    /// Its value, in binary64.
    pub fn of(self, x: f64) -> f64 {
        match self {
            Activation::Relu => x.max(0.0),
            Activation::Tanh => x.tanh(),
            Activation::Sigmoid => 1.0 / (1.0 + (-x).exp()),
            Activation::Elu(alpha) => x.max(0.0) + alpha * x.min(0.0).exp_m1(),
            Activation::Clip(low, high) => x.max(low).min(high),
        }
    }
}

/// What is done with a vector.
#[derive(Clone, PartialEq, Debug)]
pub enum Step {
    /// Products with weights, added to a bias.
    Dense {
        /// The matrix, row by row: a row for each result, of as many weights as the vector has elements.
        weights: Vec<f64>,
        /// A number for each result.
        bias: Vec<f64>,
    },
    /// The sum with a number for each element.
    Add(Vec<f64>),
    /// The product with a number for each element.
    Multiply(Vec<f64>),
    /// The quotient by a number for each element.
    Divide(Vec<f64>),
    /// A function of each element.
    Activation(Activation),
}

impl Step {
    /// What becomes of a vector, in binary64.
    pub fn of(&self, x: &[f64]) -> Vec<f64> {
        let each = |by: &[f64], f: fn(f64, f64) -> f64| x.iter().zip(by).map(|(x, by)| f(*x, *by)).collect();
        match self {
            Step::Dense { weights, bias } => {
                let row =
                    |(row, bias): (&[f64], &f64)| bias + row.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
                weights.chunks(x.len()).zip(bias).map(row).collect()
            }
            Step::Add(by) => each(by, |x, by| x + by),
            Step::Multiply(by) => each(by, |x, by| x * by),
            Step::Divide(by) => each(by, |x, by| x / by),
            Step::Activation(activation) => x.iter().map(|x| activation.of(*x)).collect(),
        }
    }
}

/// A vector of ports.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Vector {
    /// Its name in the file.
    pub name: String,
    /// The number of its elements.
    pub length: usize,
}

/// A policy: a chain of steps from the input to the output.
#[derive(Clone, PartialEq, Debug)]
pub struct Network {
    /// Its name.
    pub name: String,
    /// What it is a function of.
    pub input: Vector,
    /// What it computes.
    pub output: Vector,
    /// The steps, first to last. There is a layer of weights among them.
    pub steps: Vec<Step>,
    /// Lines for the head of the source.
    pub notes: Vec<String>,
    /// True if roundings are to be as near to those of the file as the machine's are: [`Network::merged`].
    pub exact: bool,
}

impl Network {
    /// The output for an input of [`Network::input`]'s length, in binary64.
    pub fn evaluate(&self, x: &[f64]) -> Vec<f64> {
        self.steps.iter().fold(x.to_vec(), |x, step| step.of(&x))
    }

    /// The number of weights, biases not among them.
    pub fn weights(&self) -> usize {
        let weights = |step: &Step| if let Step::Dense { weights, .. } = step { weights.len() } else { 0 };
        self.steps.iter().map(weights).sum()
    }

    /// Lengths of the vectors between layers, as `48-128-128-12`.
    pub fn shape(&self) -> String {
        let mut text = self.input.length.to_string();
        for step in &self.steps {
            if let Step::Dense { bias, .. } = step {
                text += &format!("-{}", bias.len());
            }
        }
        text
    }

    /// The names of its activation functions, each once.
    pub fn activations(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        for step in &self.steps {
            if let Step::Activation(activation) = step
                && !names.contains(&activation.name())
            {
                names.push(activation.name());
            }
        }
        names
    }

    /// The same with fewer steps: biases become part of layers. Unless `exact`, the factors of a normalisation do, too, which changes
    /// roundings, and tanh is computed to an absolute error of 10⁻⁷, and not to the last digit of small results. Differences at the
    /// input stay as they are: digits may cancel there that the sum of a layer would lose.
    #[must_use]
    pub fn merged(self, exact: bool) -> Network {
        Network { steps: merge::merged(self.steps, exact), exact, ..self }
    }
}
