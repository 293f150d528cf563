// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sources generated from learned policies: `takt_front::policy`, for `takt.onnx`.

use crate::model::{Element, Model, ShapedArray, located_error};
use crate::program::machine;
use pyo3::prelude::*;
use std::path::PathBuf;
use takt_front::policy::{self, Vector};

/// Program memory depth in bundles: enough for pipelined loops.
const BUNDLES: usize = 4096;

/// Generates a multi-layer perceptron from the contents of an ONNX file.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub(crate) fn perceptron(
    py: Python<'_>,
    bytes: &[u8],
    name: &str,
    exact: bool,
    range: Option<(f64, f64)>,
    machine: &str,
    result: Option<&str>,
    folder: Option<PathBuf>,
) -> PyResult<Model> {
    let machine = self::machine(machine)?;
    let made = || {
        let files = |name: &str, offset, length| match &folder {
            Some(folder) => policy::external_data(folder, name, offset, length),
            None => Err(format!(
                "its numbers lie in `{name}`; a model that is given as bytes has all of them in itself"
            )),
        };
        let network = policy::read(bytes, name, result, &files)?.merged(exact);
        let source = policy::source(&network, machine, range, BUNDLES)?;
        let ports = |vector: &Vector, name: &str| -> Vec<String> {
            (1..=vector.length).map(|i| format!("{name}[{i}]")).collect()
        };
        let ends = [(&network.input, &source.input), (&network.output, &source.output)];
        let texts = ends.iter().flat_map(|(vector, name)| {
            let text = |(index, port): (usize, String)| (port, format!("{}[{index}]", vector.name));
            ports(vector, name).into_iter().enumerate().map(text)
        });
        let shaped = |(vector, name): (&Vector, &String)| -> ShapedArray {
            let elements = ports(vector, name).into_iter().map(Element::Port).collect();
            (vector.name.clone(), vec![vector.length], elements)
        };
        Ok(Model {
            title: format!("{}: a policy {}", network.name, network.shape()),
            notes: network.notes.clone(),
            operations: 2 * network.weights(),
            texts: texts.collect(),
            inputs: vec![shaped(ends[0])],
            outputs: vec![shaped(ends[1])],
            data: Vec::new(),
            joints: Vec::new(),
            source: source.text,
        })
    };
    py.detach(made).map_err(|error| located_error(name, error))
}
