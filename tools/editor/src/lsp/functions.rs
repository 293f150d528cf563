// SPDX-License-Identifier: MIT OR Apache-2.0
//! Functions of equations: instructions whose form in equations is a function's, as the table of instructions says, and `sum`.

use takt_isa::{Machine, ROWS, Row};

/// Function of an equation.
pub(crate) struct EquationFunction {
    pub(crate) name: &'static str,
    pub(crate) arguments: Vec<&'static str>,
    /// The result in one line.
    pub(crate) text: &'static str,
    /// Instruction that computes it.
    pub(crate) row: Option<&'static Row>,
}

/// Functions that equations for a machine have.
pub(crate) fn all(machine: &'static Machine) -> Vec<EquationFunction> {
    let here = |row: &&'static Row| machine.host(row.function).is_some();
    let forms = ROWS.iter().filter(here).flat_map(|row| row.forms.iter().map(move |form| (row, *form)));
    let mut found: Vec<EquationFunction> = Vec::new();
    for (row, form) in forms {
        let Some((name, arguments)) = form.strip_suffix(')').and_then(|form| form.split_once('(')) else {
            continue;
        };
        let is_name = name.chars().all(|c| c.is_ascii_alphanumeric()) && !name.is_empty();
        // Rows of several types share a form.
        if is_name && found.iter().all(|known| known.name != name) {
            let arguments = arguments.split(", ").collect();
            found.push(EquationFunction { name, arguments, text: row.summary, row: Some(row) });
        }
    }
    found.push(EquationFunction {
        name: "sum",
        arguments: vec!["i", "first", "last", "part"],
        text: "The sum of the parts for i = first … last, in this order; an empty one is 0.",
        row: None,
    });
    found
}

/// Function of this name, if equations for a machine have it.
pub(crate) fn named(machine: &'static Machine, name: &str) -> Option<EquationFunction> {
    all(machine).into_iter().find(|function| function.name == name)
}
