// SPDX-License-Identifier: MIT OR Apache-2.0
//! Layouts: locations of a function's inputs and outputs in a source. They are ports, words of data memory where the machine has too few
//! ports, or registers of a body that a hand-written law includes.

use super::head::brackets;
use super::terms::number;
use super::{Arrays, Head, Names, inputs_read};
use crate::Error;
use crate::graph::{Array, Function, Port};
use std::cmp::Reverse;
use std::collections::HashSet;
use takt_isa::Machine;

/// Locations of a function's inputs and outputs.
pub struct Layout {
    /// Name of each input; `None` for inputs without effect, which get no port.
    pub(super) inputs: Vec<Option<String>>,
    /// Names that hold each output; later equations read the first. Empty for a constant.
    pub(super) outputs: Vec<Vec<String>>,
    /// Lines of declarations, with comments.
    pub(super) declarations: Head,
    /// Names of ports and registers in use.
    pub(super) names: Names,
    /// Prefix of all names of a body; `None` for a program.
    pub(super) prefix: Option<String>,
    /// Output arrays in data memory: their names in the function and in the source.
    memory: Vec<(String, String)>,
}

/// Direction of a body's array.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    In,
    Out,
}

impl Layout {
    /// Layout of a program: a port for each input with an effect and each output that varies. If the machine has too few output ports, the
    /// largest arrays go to data memory. (Inputs cannot: while a program runs, the host writes only ports.)
    ///
    /// # Errors
    /// If there are still too few ports, with the numbers.
    pub fn program(function: &Function, machine: &Machine) -> Result<Layout, Error> {
        let mut layout = Layout::empty(function, None);
        for (index, (port, read)) in function.inputs.iter().zip(inputs_read(function)).enumerate() {
            if read {
                layout.declarations.input(&port.name, &[], &port.text);
                layout.inputs[index] = Some(port.name.clone());
            } else {
                layout.declarations.comment(&format!("{} has no effect{}", port.name, meaning(port)));
            }
        }
        if function.inputs.iter().any(|port| port.range.is_some()) {
            // Bounds rest on one value of an input in a period.
            layout.declarations.latched();
        }
        for port in function.inputs.iter().enumerate().filter(|(index, _)| layout.inputs[*index].is_some()) {
            if let (_, Port { name, range: Some(range), .. }) = port {
                layout.declarations.range(name, *range)?;
            }
        }
        let (inputs, most) = (layout.inputs.iter().flatten().count(), machine.input_count());
        if inputs > usize::from(most) {
            return Err(Error::plain(format!(
                "it does not fit: it has {inputs} inputs, {} has {most} input ports; a body (--body) has its inputs in registers, which a \
                 law may fill from anywhere",
                machine.name
            )));
        }
        let mut memory = Arrays::default();
        for array in in_memory(function, machine)? {
            layout.in_memory(function, array, &mut memory)?;
        }
        for (index, (port, id)) in function.outputs.iter().enumerate() {
            let element = |array: &Array| array.elements.contains(&Some(index));
            if function
                .output_arrays
                .iter()
                .any(|array| layout.in_data(&array.name).is_some() && element(array))
            {
                continue;
            }
            match function.graph.value(*id) {
                None => {
                    layout.outputs[index].push(port.name.clone());
                    layout.declarations.output(&port.name, &[], &port.text);
                }
                Some(value) => {
                    let text = format!("{} = {}{}", port.name, number(value), meaning(port));
                    layout.declarations.comment(&text);
                }
            }
        }
        if memory.words() > 0 {
            layout.declarations.comment(&format!(
                "Outputs in data memory: {} has {} output ports.",
                machine.name, machine.outputs_per_bank
            ));
            layout.declarations.lines(memory.text());
        }
        Ok(layout)
    }

    /// Layout of a body: equations for `.include` in the period of a law, which sets the inputs first and reads the outputs afterwards.
    /// Inputs and outputs are arrays of registers; all names of the body begin with the prefix. Inputs without effect are declared,
    /// constants are preset.
    ///
    /// # Errors
    /// If the prefix cannot begin a name.
    pub fn body(function: &Function, prefix: &str) -> Result<Layout, Error> {
        let begins = |c: char| c.is_ascii_alphabetic();
        let goes_on = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if !prefix.starts_with(begins) || !prefix.chars().all(goes_on) {
            return Err(Error::plain(format!(
                "`{prefix}` cannot begin a name: a prefix has letters, digits and `_`, and begins with a letter"
            )));
        }
        let mut layout = Layout::empty(function, Some(prefix));
        let read = inputs_read(function);
        let mut presets = Head::default();
        for (way, arrays) in
            [(Direction::In, &function.input_arrays), (Direction::Out, &function.output_arrays)]
        {
            let title = if way == Direction::In { "Inputs, to be set before" } else { "Outputs" };
            layout.declarations.comment(&format!("{title}."));
            for array in arrays {
                let name = layout.names.unique(&format!("{prefix}{}", array.name));
                layout.declarations.registers(&[format!("{name}{}", brackets(&array.shape))]);
                for (element, index) in places(array) {
                    let place = format!("{name}{element}");
                    let Some(index) = index else {
                        if way == Direction::Out {
                            presets.preset(&place, 0.0)?;
                        }
                        continue;
                    };
                    let (text, note) = match way {
                        Direction::In => {
                            layout.inputs[index] = Some(place.clone());
                            (&function.inputs[index].text, if read[index] { "" } else { " (no effect)" })
                        }
                        Direction::Out => {
                            let (port, id) = &function.outputs[index];
                            match function.graph.value(*id) {
                                Some(value) => presets.preset(&place, value)?,
                                // The lower triangle of a symmetric matrix comes last, so that it overwrites the upper one and is written.
                                None => layout.outputs[index] = vec![place.clone()],
                            }
                            (&port.text, "")
                        }
                    };
                    let range = function
                        .inputs
                        .get(index)
                        .filter(|_| way == Direction::In)
                        .and_then(|port| port.range);
                    let text = match range {
                        Some((low, high)) => {
                            format!("{text}{} [{low}, {high}]", if text.is_empty() { "in" } else { ", in" })
                        }
                        None => text.clone(),
                    };
                    if !text.is_empty() {
                        layout.declarations.comment(&format!("      {place}: {text}{note}"));
                    }
                }
                if array.is_symmetric() {
                    layout.declarations.comment("      The lower triangle is written, with the diagonal.");
                }
            }
        }
        layout.declarations.lines(presets.text());
        Ok(layout)
    }

    /// Name of an input in the source; `None` if it has no effect and no location.
    pub fn input(&self, index: usize) -> Option<&str> {
        self.inputs.get(index)?.as_deref()
    }

    /// Name of an output in the source; `None` for a constant.
    pub fn output(&self, index: usize) -> Option<&str> {
        Some(self.outputs.get(index)?.first()?.as_str())
    }

    /// Name in the source of an output array in data memory. Its words are consecutive, in row-major order.
    pub fn in_data(&self, array: &str) -> Option<&str> {
        self.memory.iter().find(|(name, _)| name == array).map(|(_, place)| place.as_str())
    }

    /// Array in data memory that holds an output, and the index of its word, from 0; `None` for a port.
    pub fn word(&self, function: &Function, index: usize) -> Option<(&str, usize)> {
        function.output_arrays.iter().find_map(|array| {
            let place = self.in_data(&array.name)?;
            Some((place, array.elements.iter().position(|element| *element == Some(index))?))
        })
    }

    fn empty(function: &Function, prefix: Option<&str>) -> Layout {
        let mut names = Names::new();
        if prefix.is_none() {
            let ports = function.inputs.iter().chain(function.outputs.iter().map(|(port, _)| port));
            ports.for_each(|port| names.take(&port.name));
        }
        Layout {
            inputs: vec![None; function.inputs.len()],
            outputs: vec![Vec::new(); function.outputs.len()],
            declarations: Head::default(),
            names,
            prefix: prefix.map(str::to_owned),
            memory: Vec::new(),
        }
    }

    /// Places an output array in data memory; constants and structural zeros become initial values.
    fn in_memory(&mut self, function: &Function, array: &Array, memory: &mut Arrays) -> Result<(), Error> {
        let name = self.names.unique(&array.name);
        let mut values = vec![0.0; array.elements.len()];
        for (flat, (element, index)) in places(array).enumerate() {
            let Some(index) = index else { continue };
            match function.graph.value(function.outputs[index].1) {
                Some(value) => values[flat] = value,
                None => self.outputs[index].push(format!("{name}{element}")),
            }
        }
        if values.iter().all(|value| *value == 0.0) {
            memory.zeros(&name, &array.shape);
        } else {
            memory.values(&name, &array.shape, &values)?;
        }
        self.memory.push((array.name.clone(), name));
        Ok(())
    }
}

/// Chooses output arrays for data memory, largest first, until the ports suffice for the rest.
fn in_memory<'a>(function: &'a Function, machine: &Machine) -> Result<Vec<&'a Array>, Error> {
    let varies = |index: &usize| function.graph.value(function.outputs[*index].1).is_none();
    let ports = |array: &Array| -> usize {
        array.elements.iter().flatten().filter(|index| varies(index)).collect::<HashSet<_>>().len()
    };
    let mut arrays: Vec<&Array> = function.output_arrays.iter().collect();
    arrays.sort_by_key(|array| Reverse(ports(array)));
    let mut rest: usize = arrays.iter().map(|array| ports(array)).sum();
    let most = usize::from(machine.outputs_per_bank);
    let mut chosen = Vec::new();
    for array in arrays.into_iter().filter(|array| !array.shape.is_empty()) {
        if rest <= most {
            break;
        }
        rest -= ports(array);
        chosen.push(array);
    }
    if rest <= most {
        return Ok(chosen);
    }
    Err(Error::plain(format!(
        "it does not fit: it has {rest} outputs that are numbers, {} has {most} output ports; make a vector of them, which can lie in data \
         memory",
        machine.name
    )))
}

/// Subscripts of each element of an array with its input or output, in row-major order.
fn places(array: &Array) -> impl Iterator<Item = (String, Option<usize>)> {
    array.elements.iter().enumerate().map(|(flat, index)| (subscripts(&array.shape, flat), *index))
}

/// Subscripts of an element, from 1; empty for a number.
fn subscripts(shape: &[usize], mut flat: usize) -> String {
    let mut indices = vec![0; shape.len()];
    for (index, size) in indices.iter_mut().zip(shape).rev() {
        *index = 1 + flat % size;
        flat /= size;
    }
    brackets(&indices)
}

fn meaning(port: &Port) -> String {
    match port.text.as_str() {
        "" => String::new(),
        text => format!(" ; {text}"),
    }
}
