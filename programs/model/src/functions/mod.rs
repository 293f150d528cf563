// SPDX-License-Identifier: MIT OR Apache-2.0
//! The functions of a robot: each a graph with named inputs and outputs. The search for the shortest graph derives [`Function`]s, which are
//! defined here, and is re-exported: the files of this folder are one module.

mod inverse;
mod kinematics;
mod links;
mod mass;
mod search;
mod vector;

use crate::graph::{Count, Delays, Graph, Id, depth, optimise};
pub use search::{Options, derive};

/// A function of a robot.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum What {
    /// The tip's pose.
    ForwardKinematics,
    /// The tip's velocity per joint's.
    Jacobian,
    /// The joints' forces for a motion.
    InverseDynamics,
    /// The joints' forces at rest.
    Gravity,
    /// The joints' inertia.
    MassMatrix,
    /// The joints' acceleration under forces.
    ForwardDynamics,
    /// The joints' forces that make errors decay.
    ComputedTorque,
}

impl What {
    /// All of them, their names, and what they are.
    pub const ALL: [(What, &'static str, &'static str); 7] = [
        (
            What::ForwardKinematics,
            "forward-kinematics",
            "pose of the tip in the base's frame: rotation and position",
        ),
        (
            What::Jacobian,
            "jacobian",
            "geometric Jacobian of the tip, in the base's axes: linear velocity, then angular",
        ),
        (What::InverseDynamics, "inverse-dynamics", "joint forces that a motion takes"),
        (What::Gravity, "gravity", "joint forces that hold the robot at rest"),
        (What::MassMatrix, "mass-matrix", "joint-space inertia, the lower triangle"),
        (What::ForwardDynamics, "forward-dynamics", "joint accelerations under joint forces"),
        (
            What::ComputedTorque,
            "computed-torque",
            "joint forces that follow a reference: inverse dynamics of qddr + kp (qr - q) + kd (qdr - qd)",
        ),
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        What::ALL.iter().find(|(what, ..)| *what == self).map_or("", |(_, name, _)| name)
    }

    /// The text that describes it.
    pub fn text(self) -> &'static str {
        What::ALL.iter().find(|(what, ..)| *what == self).map_or("", |(_, _, text)| text)
    }

    /// The one of a name.
    pub fn from_name(name: &str) -> Option<What> {
        What::ALL.iter().find(|(_, other, _)| *other == name).map(|(what, ..)| *what)
    }
}

/// An input or output.
#[derive(Clone, PartialEq, Debug)]
pub struct Port {
    /// Its name in the source.
    pub name: String,
    /// Its meaning, and its unit.
    pub text: String,
}

/// Inputs or outputs that are one array.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Array {
    /// Its name.
    pub name: String,
    /// Its dimensions; none if it is a number.
    pub shape: Vec<usize>,
    /// Which input or output each element is, the last index fastest; none of a structural zero. Those above the diagonal of a symmetric
    /// matrix are those below it.
    pub elements: Vec<Option<usize>>,
}

impl Array {
    /// An array whose elements are the inputs or outputs from `first` on.
    pub fn new(name: &str, first: usize, shape: &[usize]) -> Array {
        let count = shape.iter().product::<usize>();
        let elements = (first..first + count).map(Some).collect();
        Array { name: name.to_owned(), shape: shape.to_vec(), elements }
    }

    /// True if some elements are the same input or output: those of a symmetric matrix.
    pub fn is_symmetric(&self) -> bool {
        let mut seen = std::collections::HashSet::new();
        !self.elements.iter().flatten().all(|index| seen.insert(index))
    }
}

/// Named outputs as a graph of named inputs.
pub struct Function {
    /// Its title.
    pub title: String,
    /// The lines at the head of the source.
    pub notes: Vec<String>,
    /// The inputs; the graph has them by their place here.
    pub inputs: Vec<Port>,
    /// The outputs and their nodes.
    pub outputs: Vec<(Port, Id)>,
    /// The arrays that the inputs are.
    pub input_arrays: Vec<Array>,
    /// And the outputs.
    pub output_arrays: Vec<Array>,
    /// The graph.
    pub graph: Graph,
}

impl Function {
    /// The outputs' nodes.
    pub fn nodes(&self) -> Vec<Id> {
        self.outputs.iter().map(|(_, id)| *id).collect()
    }

    /// The number of operations that it takes.
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
        self.improved(delays, true)
    }

    fn improved(self, delays: &Delays, thorough: bool) -> Function {
        let (graph, nodes) = optimise(&self.graph, &self.nodes(), delays, thorough);
        let outputs = self.outputs.into_iter().zip(nodes).map(|((port, _), id)| (port, id)).collect();
        Function { graph, outputs, ..self }
    }
}
