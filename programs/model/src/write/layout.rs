// SPDX-License-Identifier: MIT OR Apache-2.0
//! A layout says where the inputs and outputs of a function lie in a source: in ports, in data memory where the machine has too few
//! ports, or in the registers of a body that a hand-written law includes.

use super::inputs_read;
use super::terms::number;
use crate::Error;
use crate::arrays::{self, Arrays, Names};
use crate::functions::{Array, Function, Port};
use std::cmp::Reverse;
use std::collections::HashSet;
use std::fmt::Write;
use takt_isa::Machine;

/// The places of a function's inputs and outputs.
pub struct Layout {
    /// The name of each input; one without effect has none in ports.
    pub(super) inputs: Vec<Option<String>>,
    /// The places that hold each output; the first is read where its value is needed. None of a constant.
    pub(super) outputs: Vec<Vec<String>>,
    /// The declarations, with comments.
    pub(super) declarations: String,
    /// The names that are in use.
    pub(super) names: Names,
    /// What the names of a body begin with; none of a program.
    pub(super) prefix: Option<String>,
    /// The arrays of outputs that lie in data memory: the names of the function's, and in the source.
    memory: Vec<(String, String)>,
}

/// The two kinds of a body's arrays.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    In,
    Out,
}

impl Layout {
    /// A program of its own: a port for each input with an effect and each output that is no constant. Outputs that the machine has no ports
    /// for lie in data memory, the largest arrays first. (Inputs cannot: a host sets nothing but ports while a program runs.)
    ///
    /// # Errors
    /// If there are too few ports nevertheless, with the numbers.
    pub fn program(function: &Function, machine: &Machine) -> Result<Layout, Error> {
        let mut layout = Layout::empty(function, None);
        for (index, (port, read)) in function.inputs.iter().zip(inputs_read(function)).enumerate() {
            if read {
                let _ = writeln!(layout.declarations, ".input  {}{}", port.name, comment(port));
                layout.inputs[index] = Some(port.name.clone());
            } else {
                let _ = writeln!(layout.declarations, "; {} has no effect{}", port.name, comment(port));
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
            let _ = match function.graph.value(*id) {
                None => {
                    layout.outputs[index].push(port.name.clone());
                    writeln!(layout.declarations, ".output {}{}", port.name, comment(port))
                }
                Some(value) => {
                    writeln!(layout.declarations, "; {} = {}{}", port.name, number(value), comment(port))
                }
            };
        }
        if memory.words() > 0 {
            let _ = write!(
                layout.declarations,
                "; Outputs in data memory: {} has {} output ports.\n{}",
                machine.name,
                machine.outputs_per_bank,
                memory.text()
            );
        }
        Ok(layout)
    }

    /// A body: equations for `.include` in the period of a law, which sets the inputs before and reads the outputs behind. Both are arrays
    /// of registers whose names begin with the prefix, as all other names of the body do. Inputs without effect are declared, constants
    /// are preset.
    ///
    /// # Errors
    /// If the prefix is no beginning of a name.
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
        let mut presets = String::new();
        for (way, arrays) in [(Way::In, &function.input_arrays), (Way::Out, &function.output_arrays)] {
            let title = if way == Way::In { "Inputs, to be set before" } else { "Outputs" };
            let _ = writeln!(layout.declarations, "; {title}.");
            for array in arrays {
                let name = layout.names.unique(&format!("{prefix}{}", array.name));
                let size =
                    if array.shape.is_empty() { String::new() } else { format!("[{}]", list(&array.shape)) };
                let _ = writeln!(layout.declarations, ".reg    {name}{size}");
                for (element, index) in places(array) {
                    let place = format!("{name}{element}");
                    let Some(index) = index else {
                        if way == Way::Out {
                            let _ = writeln!(presets, ".preset {place} = 0.0");
                        }
                        continue;
                    };
                    let (text, note) = match way {
                        Way::In => {
                            layout.inputs[index] = Some(place.clone());
                            (&function.inputs[index].text, if read[index] { "" } else { " (no effect)" })
                        }
                        Way::Out => {
                            let (port, id) = &function.outputs[index];
                            match function.graph.value(*id) {
                                Some(value) => {
                                    let _ = writeln!(presets, ".preset {place} = {}", arrays::number(value)?);
                                }
                                // Of a symmetric matrix, the lower triangle comes last and is the one that is written.
                                None => layout.outputs[index] = vec![place.clone()],
                            }
                            (&port.text, "")
                        }
                    };
                    if !text.is_empty() {
                        let _ = writeln!(layout.declarations, ";       {place}: {text}{note}");
                    }
                }
                if array.is_symmetric() {
                    let _ = writeln!(
                        layout.declarations,
                        ";       The lower triangle is written, with the diagonal."
                    );
                }
            }
        }
        layout.declarations += &presets;
        Ok(layout)
    }

    /// The name of an input in the source; none if it has no effect and no place.
    pub fn input(&self, index: usize) -> Option<&str> {
        self.inputs.get(index)?.as_deref()
    }

    /// The name of an output in the source; none of a constant.
    pub fn output(&self, index: usize) -> Option<&str> {
        Some(self.outputs.get(index)?.first()?.as_str())
    }

    /// The name of the array in data memory that an array of the function is. Its words follow one another, the last index fastest.
    pub fn in_data(&self, array: &str) -> Option<&str> {
        self.memory.iter().find(|(name, _)| name == array).map(|(_, place)| place.as_str())
    }

    /// The array in data memory that an output lies in, and the number of its word there, from 0; none of a port.
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
            declarations: String::new(),
            names,
            prefix: prefix.map(str::to_owned),
            memory: Vec::new(),
        }
    }

    /// An array of outputs in data memory; constants and structural zeros are there from the beginning.
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

/// The arrays of outputs that lie in data memory, so that there are ports for the others.
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

/// The subscripts of each element of an array, and the input or output that it is, the last index fastest.
fn places(array: &Array) -> impl Iterator<Item = (String, Option<usize>)> {
    array.elements.iter().enumerate().map(|(flat, index)| (subscripts(&array.shape, flat), *index))
}

/// The subscripts of an element, from 1; nothing of a number.
fn subscripts(shape: &[usize], mut flat: usize) -> String {
    let mut indices = vec![0; shape.len()];
    for (index, size) in indices.iter_mut().zip(shape).rev() {
        *index = 1 + flat % size;
        flat /= size;
    }
    if shape.is_empty() { String::new() } else { format!("[{}]", list(&indices)) }
}

fn list(numbers: &[usize]) -> String {
    numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(",")
}

fn comment(port: &Port) -> String {
    match port.text.as_str() {
        "" => String::new(),
        text => format!(" ; {text}"),
    }
}
