//! What is computed of a robot: each a graph with named inputs and outputs.

pub mod inverse;
mod links;
mod vector;

use crate::graph::{Count, Delays, Graph, Id, depth, optimise};

/// An input or output.
#[derive(Clone, PartialEq, Debug)]
pub struct Port {
    /// Its name in the source.
    pub name: String,
    /// What it is, and its unit.
    pub text: String,
}

/// Named outputs as a graph of named inputs.
pub struct Function {
    /// What is computed.
    pub title: String,
    /// What the source says at its head.
    pub notes: Vec<String>,
    /// The inputs; the graph has them by their place here.
    pub inputs: Vec<Port>,
    /// The outputs and their nodes.
    pub outputs: Vec<(Port, Id)>,
    /// The graph.
    pub graph: Graph,
}

impl Function {
    /// The outputs' nodes.
    pub fn nodes(&self) -> Vec<Id> {
        self.outputs.iter().map(|(_, id)| *id).collect()
    }

    /// How many operations it takes.
    pub fn count(&self) -> Count {
        Count::of(&self.graph, &self.nodes())
    }

    /// Its longest chain, in cycles.
    pub fn depth(&self, delays: &Delays) -> u32 {
        depth(&self.graph, &self.nodes(), delays)
    }

    /// The outputs in binary64 for these inputs.
    pub fn evaluate(&self, inputs: &[f64]) -> Vec<f64> {
        crate::graph::evaluate(&self.graph, &self.nodes(), inputs)
    }

    /// The same with fewer operations.
    pub fn optimised(self, delays: &Delays) -> Function {
        let (graph, nodes) = optimise(&self.graph, &self.nodes(), delays);
        let outputs = self.outputs.into_iter().zip(nodes).map(|((port, _), id)| (port, id)).collect();
        Function { graph, outputs, ..self }
    }
}
