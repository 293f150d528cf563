// SPDX-License-Identifier: MIT OR Apache-2.0
//! Registers of an assembled program for the ports of the tracking algorithm.

use super::controller::Outputs;
use super::ports::{INPUTS, OUTPUTS, Port};
use takt_isa::{Program, Register, Type, program};
use thiserror::Error;

/// Registers of a program for [`INPUTS`] and [`OUTPUTS`], in their order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Registers of [`INPUTS`], in their order.
    pub inputs: [Register; INPUTS.len()],
    /// Registers of [`OUTPUTS`], in their order.
    pub outputs: [Register; OUTPUTS.len()],
}

/// Reason why a program is not a tracking program.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BindingError {
    /// An input port that the algorithm does not have.
    #[error("not a tracking program: the tracking algorithm does not drive input port `{0}`")]
    Undriven(String),
    /// A missing port of the algorithm.
    #[error("not a tracking program: it has no {kind} port `{name}`")]
    Missing {
        /// Direction of the port: `input` or `output`.
        kind: &'static str,
        /// Name of the missing port.
        name: &'static str,
        /// Ports of the program in that direction that the algorithm does not have.
        others: Vec<String>,
    },
    /// A port with a different type.
    #[error("{kind} port `{name}` must carry {}", if *.ty == Type::I { format!("integers: declare it `{name}:int`") } else { format!("binary32: declare it `{name}:float`") })]
    Type {
        /// Direction of the port: `input` or `output`.
        kind: &'static str,
        /// Name of the port.
        name: &'static str,
        /// Type that the algorithm needs.
        ty: Type,
    },
}

/// An output port, by name, that the program has not written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the program has not written output port `{0}`")]
pub struct UnwrittenOutput(pub &'static str);

impl Binding {
    /// Registers of a program with the algorithm's ports. The program may have further outputs.
    ///
    /// # Errors
    /// The first port that is missing or has a different type, or an input that nothing drives.
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

    /// Results of the program; `read` returns the bits of a register, `None` before the first write.
    ///
    /// # Errors
    /// The first unwritten output.
    pub fn outputs(&self, read: impl Fn(Register) -> Option<u32>) -> Result<Outputs<f64>, UnwrittenOutput> {
        let mut values = [0.0; OUTPUTS.len()];
        for ((value, register), port) in values.iter_mut().zip(&self.outputs).zip(&OUTPUTS) {
            let bits = read(*register).ok_or(UnwrittenOutput(port.name))?;
            *value = f64::from(f32::from_bits(bits));
        }
        Ok(Outputs::from_array(values))
    }
}

fn is_among(ports: &[Port], name: &str) -> bool {
    ports.iter().any(|port| port.name == name)
}

/// Register of a port of the algorithm in a program.
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
