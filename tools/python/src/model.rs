// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sources generated from robot descriptions and from expressions of other tools: `takt_front`, for `takt.urdf`, `takt.casadi`, ….

use crate::program::{machine, suggest};
use pyo3::exceptions::PyValueError;
use pyo3::import_exception;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use takt_front::graph::{Array, Delays, Function, Port, Rewrites};
use takt_front::robot::functions::{Options, RobotFunction, derive};
use takt_front::robot::{Tree, dh, read as described, urdf};
use takt_front::sink::{self, Layout};
use takt_front::{DecodedText, Error, decode, no_files};

import_exception!(takt._errors, ModelError);

/// An element of an array of ports.
#[derive(IntoPyObject)]
pub(crate) enum Element {
    /// Element with a port of this name.
    Port(String),
    /// Output with a constant value, which needs no port.
    Constant(f64),
    /// Input without effect, which needs no port.
    None(Option<u8>),
}

/// Name, dimensions and elements of an array, last index fastest.
pub(crate) type ShapedArray = (String, Vec<usize>, Vec<Element>);

/// A generated source, with a description of its ports.
#[derive(IntoPyObject)]
pub(crate) struct Model {
    pub(crate) source: String,
    pub(crate) title: String,
    pub(crate) notes: Vec<String>,
    pub(crate) operations: usize,
    /// Meaning and unit of each port.
    pub(crate) texts: Vec<(String, String)>,
    pub(crate) inputs: Vec<ShapedArray>,
    pub(crate) outputs: Vec<ShapedArray>,
    /// Outputs in data memory: name, array, and index of the word in it.
    pub(crate) data: Vec<(String, String, usize)>,
    pub(crate) joints: Vec<String>,
}

impl Model {
    fn of(function: &Function, layout: &Layout, joints: Vec<String>) -> Model {
        let read = sink::inputs_read(function);
        let input = |index: Option<usize>| match index.filter(|index| read[*index]) {
            Some(index) => Element::Port(function.inputs[index].name.clone()),
            None => Element::None(None),
        };
        let output = |index: Option<usize>| match index {
            None => Element::Constant(0.0),
            Some(index) => {
                let name = || Element::Port(layout.output(index).unwrap_or_default().to_owned());
                function.graph.value(function.outputs[index].1).map_or_else(name, Element::Constant)
            }
        };
        let in_data = |index: usize| {
            let (array, word) = layout.word(function, index)?;
            Some((layout.output(index)?.to_owned(), array.to_owned(), word))
        };
        let shaped = |arrays: &[Array], element: &dyn Fn(Option<usize>) -> Element| {
            let array = |array: &Array| {
                let elements = array.elements.iter().map(|index| element(*index)).collect();
                (array.name.clone(), array.shape.clone(), elements)
            };
            arrays.iter().map(array).collect()
        };
        let ports = function.inputs.iter().chain(function.outputs.iter().map(|(port, _)| port));
        let text = |port: &Port| (port.name.clone(), port.text.clone());
        Model {
            source: sink::source(function, layout),
            title: function.title.clone(),
            notes: function.notes.clone(),
            operations: function.count().total(),
            texts: ports.map(text).collect(),
            inputs: shaped(&function.input_arrays, &input),
            outputs: shaped(&function.output_arrays, &output),
            data: (0..function.outputs.len()).filter_map(in_data).collect(),
            joints,
        }
    }
}

/// Error with its place; `name` is the input that was read.
pub(crate) fn located_error(name: &str, error: Error) -> PyErr {
    let text = error.located_text(name);
    ModelError::new_err((text, error.line))
}

fn rewrites(exact: bool, without: &[String]) -> PyResult<Rewrites> {
    let mut rewrites = if exact { Rewrites::EXACT } else { Rewrites::ALL };
    for name in without {
        if !rewrites.without(name) {
            let names = Rewrites::NAMES.map(|(name, _)| name);
            let near = suggest(name, names);
            let text =
                format!("without: there is no rewriting `{name}`{near} (there are: {})", names.join(", "));
            return Err(PyValueError::new_err(text));
        }
    }
    Ok(rewrites)
}

/// Functions of a robot that can be generated: name and description.
#[pyfunction]
pub(crate) fn robot_functions() -> Vec<(&'static str, &'static str)> {
    RobotFunction::ALL.iter().map(|(_, name, text)| (*name, *text)).collect()
}

/// Reads a file that a description includes.
fn text_of(path: &Path) -> Result<String, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    decode(bytes).map(|decoded| decoded.text).map_err(|why| format!("{}: {why}", path.display()))
}

/// Generates a function of a robot. The robot is described in URDF or in MJCF, with includes from `folder`, or by a table of
/// Denavit-Hartenberg parameters.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub(crate) fn robot(
    py: Python<'_>,
    bytes: &[u8],
    name: &str,
    folder: Option<PathBuf>,
    table: bool,
    function: &str,
    base: Option<&str>,
    tip: Option<&str>,
    held: bool,
    gains: (f64, f64),
    snap: f64,
    exact: bool,
    without: Vec<String>,
    machine: &str,
) -> PyResult<Model> {
    let what = RobotFunction::from_name(function).ok_or_else(|| {
        let names = RobotFunction::ALL.map(|(_, name, _)| name);
        let near = suggest(function, names);
        let text =
            format!("there is no function `{function}` of a robot{near} (functions: {})", names.join(", "));
        PyValueError::new_err(text)
    })?;
    for (gain, name) in [(gains.0, "kp"), (gains.1, "kd")] {
        if !gain.is_finite() || gain < 0.0 {
            return Err(PyValueError::new_err(format!(
                "{name} is {gain}: a gain must be finite and not negative"
            )));
        }
    }
    if !(0.0..=urdf::MAX_SNAP).contains(&snap) {
        let text = format!("snap is {snap}: it is between 0 and {} rad", urdf::MAX_SNAP);
        return Err(PyValueError::new_err(text));
    }
    let machine = self::machine(machine)?;
    let delays = Delays::of(machine);
    let rewrites = rewrites(exact, &without)?;
    let made = || {
        let DecodedText { text, note } = decode(bytes.to_vec()).map_err(Error::from)?;
        let file = |name: &str| match &folder {
            Some(folder) => text_of(&folder.join(name)),
            None => no_files(name),
        };
        let mut tree: Tree =
            if table { dh::read(&text, name, snap)? } else { described(&text, snap, &file)? };
        tree.notes.extend(note);
        if held {
            tree = tree.held();
        }
        let robot = tree.robot(base, tip).map_err(|error| error.located(&text))?;
        let options = Options { rewrites, delays, tip, kp: gains.0, kd: gains.1 };
        let function = derive(&robot, what, &options)?;
        let layout = Layout::program(&function, machine)?;
        let joints = robot.joints.iter().map(|joint| joint.name.clone()).collect();
        Ok(Model::of(&function, &layout, joints))
    };
    py.detach(made).map_err(|error| located_error(name, error))
}

/// Generates a program from a list of instructions, as written by `takt_expressions`.
#[pyfunction]
pub(crate) fn expressions(
    py: Python<'_>,
    text: &str,
    name: &str,
    exact: bool,
    without: Vec<String>,
    machine: &str,
) -> PyResult<Model> {
    let machine = self::machine(machine)?;
    let delays = Delays::of(machine);
    let rewrites = rewrites(exact, &without)?;
    let made = || {
        let function = takt_front::expressions::read(text, rewrites)?.optimised(&delays);
        let layout = Layout::program(&function, machine)?;
        Ok(Model::of(&function, &layout, Vec::new()))
    };
    py.detach(made).map_err(|error| located_error(name, error))
}
