// SPDX-License-Identifier: MIT OR Apache-2.0
//! Variables of an FMU: the program's ports and parameters, and what became of the last period.

use takt_isa::program::Port;
use takt_isa::{Program, Register, Type};

/// Value reference of the time.
pub(crate) const TIME: u32 = 0;

/// Role of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Input port.
    Input,
    /// Parameter (`.param`), which may be set between any two steps.
    Parameter,
    /// Output port, or a result of the period.
    Output,
}

/// Origin of a variable's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// Port or parameter in this register.
    Port(Register),
    /// Cycles of the last period.
    Cycles,
    /// Periods so far that did not end before the next tick.
    Missed,
    /// Sticky exception flags.
    Flags,
}

/// Variable of an FMU. Its value reference is its index plus 1; 0 is the time.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name: that of the port or parameter.
    pub name: String,
    /// Type of the port.
    pub ty: Type,
    /// Role of the variable.
    pub causality: Causality,
    /// Range that the source states, as bits of the least and the largest value.
    pub range: Option<(u32, u32)>,
    /// Value at the start, as bits.
    pub start: u32,
    /// Meaning in words; empty for ports and parameters.
    pub description: &'static str,
    pub(crate) source: Source,
}

impl Variable {
    fn of_port(program: &Program, port: &Port, causality: Causality) -> Variable {
        let range = program.range(port.register).filter(|_| causality != Causality::Output);
        let start = match causality {
            Causality::Output => 0,
            Causality::Input | Causality::Parameter => program.initial(port.register).unwrap_or(0),
        };
        // Zero, unless the range leaves it out: then the end next to zero.
        let start = match range {
            Some(range) if !range.holds(start) => match range.ends().0 > 0.0 {
                true => range.low,
                false => range.high,
            },
            _ => start,
        };
        Variable {
            name: port.name.clone(),
            ty: port.ty,
            causality,
            range: range.map(|range| (range.low, range.high)),
            start,
            description: "",
            source: Source::Port(port.register),
        }
    }

    /// Value in words.
    pub(crate) fn text(&self, bits: u32) -> String {
        match self.ty {
            Type::F => format!("{:?}", f32::from_bits(bits)),
            Type::I => bits.cast_signed().to_string(),
            Type::B => bits.to_string(),
        }
    }

    /// The range that the source states has the value; so has no range at all.
    pub(crate) fn holds(&self, bits: u32) -> bool {
        let Some((low, high)) = self.range else { return true };
        match self.ty {
            Type::F => (f32::from_bits(low)..=f32::from_bits(high)).contains(&f32::from_bits(bits)),
            Type::I | Type::B => (low.cast_signed()..=high.cast_signed()).contains(&bits.cast_signed()),
        }
    }
}

/// A name that no port or parameter has: `name`, or else `takt.name`, as ports have no dot in their names.
pub(crate) fn free_name(program: &Program, name: &str) -> String {
    let is_taken = program.host_registers().chain(&program.outputs).any(|port| port.name == name);
    if is_taken { format!("takt.{name}") } else { name.to_owned() }
}

/// Variables of a program, in the order of their value references.
pub(crate) fn of(program: &Program) -> Vec<Variable> {
    let of = |ports: &[Port], causality| -> Vec<Variable> {
        ports.iter().map(|port| Variable::of_port(program, port, causality)).collect()
    };
    let mut variables = of(&program.inputs, Causality::Input);
    variables.extend(of(&program.parameters, Causality::Parameter));
    variables.extend(of(&program.outputs, Causality::Output));
    let results = [
        ("cycles", Source::Cycles, "Cycles of the last period, from its tick to its wait"),
        ("missed", Source::Missed, "Periods so far that did not end before the next tick"),
        (
            "flags",
            Source::Flags,
            "Sticky exception flags: 4 overflow, 8 division by zero, 16 invalid operation",
        ),
    ];
    variables.extend(results.map(|(name, source, description)| Variable {
        name: free_name(program, name),
        ty: Type::I,
        causality: Causality::Output,
        range: None,
        start: 0,
        description,
        source,
    }));
    variables
}
