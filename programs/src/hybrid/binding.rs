// SPDX-License-Identifier: MIT OR Apache-2.0
//! The registers that an assembled program has for the ports of the tracking algorithm.

use super::controller::Outputs;
use super::ports::{INPUTS, OUTPUTS, Port};
use takt_isa::{Program, Register, Type, program};
use thiserror::Error;

/// Registers of a program for [`INPUTS`] and [`OUTPUTS`], in their order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Of the inputs.
    pub inputs: [Register; INPUTS.len()],
    /// Of the outputs.
    pub outputs: [Register; OUTPUTS.len()],
}

/// The reason why a program is no tracking program.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BindingError {
    /// It has an input that the algorithm does not know.
    #[error("this is no tracking program: nothing gives its input port `{0}` a value")]
    Undriven(String),
    /// A port is missing.
    #[error("this is no tracking program: it has no {kind} port `{name}`")]
    Missing {
        /// `input` or `output`.
        kind: &'static str,
        /// The port.
        name: &'static str,
        /// The program's ports of that kind that the algorithm does not have.
        others: Vec<String>,
    },
    /// A port has another type.
    #[error("{kind} port `{name}` must carry {}", if *.ty == Type::I { format!("integers: declare it `{name}:int`") } else { format!("binary32: declare it `{name}:float`") })]
    Type {
        /// `input` or `output`.
        kind: &'static str,
        /// The port.
        name: &'static str,
        /// The type that it should have.
        ty: Type,
    },
}

/// An output port, by its name, that the program has not written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the program has not written output port `{0}`")]
pub struct Unwritten(pub &'static str);

impl Binding {
    /// The registers of a program that has the algorithm's ports. It may have further outputs.
    ///
    /// # Errors
    /// The first port that is missing, has another type, or is an input that nothing drives.
    pub fn new(program: &Program) -> Result<Binding, BindingError> {
        if let Some(port) = program.inputs.iter().find(|port| !is_among(&INPUTS, &port.name)) {
            return Err(BindingError::Undriven(port.name.clone()));
        }
        let mut binding =
            Binding { inputs: [Register::ZERO; INPUTS.len()], outputs: [Register::ZERO; OUTPUTS.len()] };
        for (port, register) in INPUTS.iter().zip(&mut binding.inputs) {
            *register = find("input", port, &program.inputs, &INPUTS)?;
        }
        for (port, register) in OUTPUTS.iter().zip(&mut binding.outputs) {
            *register = find("output", port, &program.outputs, &OUTPUTS)?;
        }
        Ok(binding)
    }

    /// The results of the program, their bits read by register.
    ///
    /// # Errors
    /// The first output that was not written.
    pub fn outputs(&self, read: impl Fn(Register) -> Option<u32>) -> Result<Outputs<f64>, Unwritten> {
        let mut values = [0.0; OUTPUTS.len()];
        for ((value, register), port) in values.iter_mut().zip(&self.outputs).zip(&OUTPUTS) {
            let bits = read(*register).ok_or(Unwritten(port.name))?;
            *value = f64::from(f32::from_bits(bits));
        }
        Ok(Outputs::from_array(values))
    }
}

fn is_among(ports: &[Port], name: &str) -> bool {
    ports.iter().any(|port| port.name == name)
}

/// The register of one of the algorithm's ports in a program.
fn find(
    kind: &'static str,
    wanted: &Port,
    have: &[program::Port],
    all: &[Port],
) -> Result<Register, BindingError> {
    let name = wanted.name;
    let Some(port) = have.iter().find(|port| port.name == name) else {
        let others = have.iter().map(|port| &port.name).filter(|name| !is_among(all, name)).cloned();
        return Err(BindingError::Missing { kind, name, others: others.collect() });
    };
    if port.ty != wanted.ty {
        return Err(BindingError::Type { kind, name, ty: wanted.ty });
    }
    Ok(port.register)
}
