// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sources generated from control problems: `takt_front::mpc`, for `takt.mpc`.

use crate::model::{Element, Model, ShapedArray, located_error};
use crate::program::machine;
use pyo3::prelude::*;
use takt_front::mpc::{self, Controller, MAX_RESTARTS, Search};
use takt_front::{Error, no_files};

/// Program memory depth in bundles: enough for pipelined loops.
const BUNDLES: usize = 4096;

type Ports = [(&'static str, Vec<usize>, &'static str)];

fn controller(text: &str) -> Result<Controller, Error> {
    mpc::read(text, "mpc", &no_files).and_then(Controller::new).map_err(|error| error.located(text))
}

/// Arrays of ports, with elements numbered from 1, last index fastest.
fn shaped(ports: &Ports) -> Vec<ShapedArray> {
    let array = |(name, dims, _): &(&'static str, Vec<usize>, &'static str)| -> ShapedArray {
        let mut indices = vec![Vec::new()];
        for size in dims {
            indices = indices
                .into_iter()
                .flat_map(|index: Vec<String>| {
                    (1..=*size).map(move |i| index.iter().cloned().chain([i.to_string()]).collect())
                })
                .collect();
        }
        let port = |index: Vec<String>| match index.is_empty() {
            true => (*name).to_owned(),
            false => format!("{name}[{}]", index.join(",")),
        };
        ((*name).to_owned(), dims.clone(), indices.into_iter().map(port).map(Element::Port).collect())
    };
    ports.iter().map(array).collect()
}

/// Generates a controller from a control problem in JSON.
#[pyfunction]
pub(crate) fn predictive(py: Python<'_>, text: &str, machine: &str) -> PyResult<Model> {
    let machine = self::machine(machine)?;
    let made = || {
        let controller = controller(text)?;
        let source = mpc::source(&controller, machine, BUNDLES)?;
        let system = &controller.system;
        let (inputs, outputs) = (shaped(&source.inputs), shaped(&source.outputs));
        let all = || source.inputs.iter().zip(&inputs).chain(source.outputs.iter().zip(&outputs));
        let texts: Vec<_> = all()
            .flat_map(|((_, _, about), (_, _, elements))| {
                let text = |element: &Element| match element {
                    Element::Port(port) => Some((port.clone(), (*about).to_owned())),
                    Element::Constant(_) | Element::None(_) => None,
                };
                elements.iter().filter_map(text).collect::<Vec<_>>()
            })
            .collect();
        let (n, m, steps) = (system.states(), system.inputs(), system.horizon);
        Ok(Model {
            title: format!(
                "{}: model-predictive control, {n} states, {m} inputs, a horizon of {steps}, {} iterations",
                system.name, system.iterations
            ),
            notes: Vec::new(),
            // Products and sums in both passes, for dense matrices.
            operations: system.iterations * (steps - 1) * 2 * (2 * n * n + 4 * n * m + m * m),
            texts,
            inputs,
            outputs,
            data: Vec::new(),
            joints: Vec::new(),
            source: source.text,
        })
    };
    py.detach(made).map_err(|error| located_error("mpc", error))
}

/// Weight of the plan's last state, row by row: cost-to-go of the infinite horizon.
#[pyfunction]
pub(crate) fn predictive_weight(py: Python<'_>, text: &str) -> PyResult<Vec<Vec<f64>>> {
    let controller = py.detach(|| controller(text)).map_err(|error| located_error("mpc", error))?;
    let weight = &controller.factors.p;
    Ok(weight.row_iter().map(|row| row.iter().copied().collect()).collect())
}

/// Worst residuals and violation found within the problem's range: name, value and state.
#[pyfunction]
pub(crate) fn predictive_worst(
    py: Python<'_>,
    text: &str,
    starts: usize,
    seed: u64,
    periods: usize,
) -> PyResult<Vec<(&'static str, f64, Vec<f64>)>> {
    let found = || {
        let search = Search { restarts: starts.clamp(1, MAX_RESTARTS), seed, periods: periods.max(1) };
        let worst = mpc::search(&controller(text)?, search)?;
        Ok(worst.into_iter().map(|worst| (worst.name, worst.value, worst.state)).collect())
    };
    py.detach(found).map_err(|error| located_error("mpc", error))
}
