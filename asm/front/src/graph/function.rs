// SPDX-License-Identifier: MIT OR Apache-2.0
//! Functions: graphs with named inputs and outputs. Readers make functions, the sink writes them.

use super::{Count, Delays, Graph, Id, depth, evaluate, optimise};

/// A scalar input or output.
#[derive(Clone, PartialEq, Debug)]
pub struct Port {
    /// Name in the source; unique among the ports of a function.
    pub name: String,
    /// Meaning and unit, for a comment.
    pub text: String,
    /// Least and largest value of an input, where its source states them.
    pub range: Option<(f64, f64)>,
}

impl Port {
    /// A port without a range.
    pub fn new(name: String, text: String) -> Port {
        Port { name, text, range: None }
    }
}

/// Direction of an assumption.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Bound {
    /// The value is at least the number.
    AtLeast,
    /// The value is at most the number.
    AtMost,
}

/// Bound of a value that the function's source promises.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Assumption {
    /// Node of the value.
    pub node: Id,
    /// Direction of the bound.
    pub bound: Bound,
    /// The least or the largest value.
    pub value: f64,
}

/// Inputs or outputs that form one array.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Array {
    /// Name of the array, without indices.
    pub name: String,
    /// Dimensions; empty for a number.
    pub shape: Vec<usize>,
    /// Index of the input or output of each element, the last dimension fastest; `None` for a structural zero. In a symmetric matrix,
    /// elements above the diagonal share the index of their mirror image.
    pub elements: Vec<Option<usize>>,
}

impl Array {
    /// An array whose elements are the inputs or outputs from `first` on.
    pub fn new(name: &str, first: usize, shape: &[usize]) -> Array {
        let count = shape.iter().product::<usize>();
        let elements = (first..first + count).map(Some).collect();
        Array { name: name.to_owned(), shape: shape.to_vec(), elements }
    }

    /// Some elements share an input or output, as in a symmetric matrix.
    pub fn is_symmetric(&self) -> bool {
        let mut seen = std::collections::HashSet::new();
        !self.elements.iter().flatten().all(|index| seen.insert(index))
    }
}

/// Named outputs, computed by a graph from named inputs.
pub struct Function {
    /// Title of the source, in its first comment.
    pub title: String,
    /// Comment lines at the head of the source.
    pub notes: Vec<String>,
    /// Inputs; [`Graph::input`] takes an index into them.
    pub inputs: Vec<Port>,
    /// Outputs with their nodes.
    pub outputs: Vec<(Port, Id)>,
    /// Grouping of the inputs into arrays.
    pub input_arrays: Vec<Array>,
    /// Grouping of the outputs into arrays.
    pub output_arrays: Vec<Array>,
    /// Promised bounds of values, outputs or not.
    pub assumptions: Vec<Assumption>,
    /// Expressions of all outputs.
    pub graph: Graph,
}

impl Function {
    /// Function without title, notes, arrays and assumptions.
    pub fn new(graph: Graph, inputs: Vec<Port>, outputs: Vec<(Port, Id)>) -> Function {
        Function {
            title: String::new(),
            notes: Vec::new(),
            inputs,
            outputs,
            input_arrays: Vec::new(),
            output_arrays: Vec::new(),
            assumptions: Vec::new(),
            graph,
        }
    }

    /// Nodes of the outputs, in order.
    pub fn nodes(&self) -> Vec<Id> {
        self.outputs.iter().map(|(_, id)| *id).collect()
    }

    /// Nodes that the program computes: of the outputs, then of the assumptions.
    pub fn roots(&self) -> Vec<Id> {
        let assumed = self.assumptions.iter().map(|assumption| assumption.node);
        self.outputs.iter().map(|(_, id)| *id).chain(assumed).collect()
    }

    /// Number of operations of all outputs and assumptions.
    pub fn count(&self) -> Count {
        Count::of(&self.graph, &self.roots())
    }

    /// Length of the critical path, in cycles.
    pub fn depth(&self, delays: &Delays) -> u32 {
        depth(&self.graph, &self.roots(), delays)
    }

    /// Values of the outputs in binary64.
    pub fn evaluate(&self, inputs: &[f64]) -> Vec<f64> {
        evaluate(&self.graph, &self.nodes(), inputs)
    }

    /// An equal function with fewer operations, or a shorter critical path.
    pub fn optimised(self, delays: &Delays) -> Function {
        self.improved(delays, true)
    }

    pub(crate) fn improved(self, delays: &Delays, thorough: bool) -> Function {
        let (graph, nodes) = optimise(&self.graph, &self.roots(), delays, thorough);
        let mut nodes = nodes.into_iter();
        let outputs = self.outputs.into_iter().zip(&mut nodes).map(|((port, _), id)| (port, id)).collect();
        let assumptions = self.assumptions.into_iter().zip(nodes);
        let assumptions = assumptions.map(|(assumption, node)| Assumption { node, ..assumption }).collect();
        Function { graph, outputs, assumptions, ..self }
    }
}
